"""The limit of a jam (Painleve), where the determinant of the balances vanishes.

A run ends a little before it: there the acceleration grows like the reciprocal of the determinant, which falls with the
sliding speed. So the velocity nears its limit like the root of the time left. The determinant of a place depends on the
sliding velocity alone, so the limit is one of its roots. Reactions that grow with the acceleration have no greatest
value: they are infinite.

`y` is the state of a mode, whose second number is the sliding velocity v, m/s. ``modes.limit_of_jam`` is called once,
after a run has ended with JAM.
"""

from __future__ import annotations

from math import inf

from ringsweep.compile import hook, inlined
from ringsweep.models.interface import modes, recorder
from ringsweep.models.ring.record import with_peaks
from ringsweep.models.ring.series import LEAST_DETERMINANT, NEARLY_JAMMED, friction_and_motion
from ringsweep.physics import drives, ring
from ringsweep.physics.ring import BristleRing, Ring

# A reaction does not grow if its product with the determinant, in units of the load and of the determinant without
# friction, is rounding.
_NO_GROWTH = 1e-9

# Share of the sliding velocity by which the determinant is looked at first, and most steps to its root.
_FIRST_STEP, _MOST_STEPS = 1e-7, 30


@hook
def balance(scene, mode, t, y, v):
    """Determinant and accelerations in slip at the sliding velocity `v`, otherwise in the state `y`.

    Returns
    -------
    tuple of float
        Determinant, in units of its value without friction; sliding acceleration, m/s^2; acceleration of the gap's
        angle in a pivot, rad/s^2; reactions in units of the load.
    """


@balance.implements(Ring, BristleRing)
def _balance_on_ring(scene, mode, t, y, v):
    """Implement :func:`balance`; there is no pivot, so the third number is 0."""
    body, (K, motion) = scene.body, friction_and_motion(scene, mode, t, (y[0], v, *y[2:]))
    epsilon, determinant = ring.acceleration(body, *K, motion)
    normal_1, normal_2 = ring.reactions(body, *K, motion)
    load = body.mass * (body.gravity + body.radius * motion[2] * motion[2]) + 1e-300
    sliding = body.radius * (epsilon - drives.turn(scene.drive, t)[2])
    return determinant / ring.free_determinant(body), sliding, 0.0, normal_1 / load, normal_2 / load


@inlined
def limit(scene, mode, t, y):
    """``(s, change, tilt, (N1, N2))``: what lies between the state `y` and the limit of a jam.

    Time, s; changes of the sliding velocity, m/s, and of the gap's angular velocity, rad/s; reactions, infinite or 0.
    """
    share, acceleration, tilt, load_1, load_2 = balance(scene, mode, t, y, y[1])
    nothing = 0.0, 0.0, 0.0, (0.0, 0.0)
    # Where friction has jumped, a run may end with any determinant below zero.
    if not -LEAST_DETERMINANT <= share <= NEARLY_JAMMED or acceleration == 0.0:
        return nothing
    before, share_before = y[1], share
    v = before + _FIRST_STEP * (abs(before) if acceleration > 0.0 else -abs(before))
    for _ in range(_MOST_STEPS):
        share_now, _, _, _, _ = balance(scene, mode, t, y, v)
        if share_now == share_before or share_now == 0.0:
            break
        before, share_before, v = v, share_now, v - share_now * (v - before) / (share_now - share_before)
    change = v - y[1]
    # Friction that does not vary with the speed gives no limit: then a jump has made the determinant small.
    if not abs(balance(scene, mode, t, y, v)[0]) <= _NO_GROWTH or not change * acceleration * share >= 0.0:
        return nothing
    # Simpson's rule for the time that the velocity takes: at its limit the acceleration is infinite.
    _, halfway, _, _, _ = balance(scene, mode, t, y, y[1] + 0.5 * change)
    s = change * (1.0 / acceleration + 4.0 / halfway) / 6.0
    normal_1 = inf if abs(load_1 * share) > _NO_GROWTH else 0.0
    normal_2 = inf if abs(load_2 * share) > _NO_GROWTH else 0.0
    return max(s, 0.0), change, tilt / acceleration * change, (normal_1, normal_2)


@modes.limit_of_jam.implements(Ring, BristleRing)
def _limit_of_jam_on_ring(scene, mode, t, y):
    """Implement :func:`modes.limit_of_jam`; a body that sticks is already there."""
    if mode.sign == 0:
        return 0.0, y, (0.0, 0.0)
    s, change, _, normals = limit(scene, mode, t, y)
    return s, (y[0], y[1] + change, *y[2:]), normals


@recorder.at_jam.implements(Ring, BristleRing)
def _at_jam_on_ring(scene, record, normals, velocity):
    """Implement :func:`recorder.at_jam`: extremes of the angular velocity, and greatest reactions."""
    return with_peaks(
        record,
        min(record.omega_min, velocity),
        max(record.omega_max, velocity),
        max(record.normal_max_1, normals[0]),
        max(record.normal_max_2, normals[1]),
    )
