"""The belt with bristles, for all solvers.

The state is ``(x, velocity, z)`` for steps of constant length, with the velocity in space. Otherwise it is
``(x, v, z)``, with the sliding velocity. z is the deflection of the bristles.

Read :mod:`ringsweep.physics.friction.presliding` first. `sign` is the direction of the slip that the bristles resist;
`region` is BAND while the contact counts as stuck, else KINETIC.
"""

from __future__ import annotations

from ringsweep.compile import absorbed, feature
from ringsweep.models.belt.force import at_place, coefficients, in_segment, length_scale
from ringsweep.models.belt.mode import FAST, NORMAL, SLOW, Mode, after_guard, mode_at
from ringsweep.models.belt.record import record_at_launch
from ringsweep.models.belt.switch import after_load, beyond, deflection_at_start
from ringsweep.models.inspection import slip_in_space
from ringsweep.models.interface import constant_step, implicit, modes, recorder
from ringsweep.models.interface.status import RUNNING, SEPARATED_1
from ringsweep.models.slip import Slip, bundled, region_guards, slip, slip_at
from ringsweep.numerics.functions import select
from ringsweep.numerics.memory import select_all
from ringsweep.numerics.terms import joined
from ringsweep.physics import drives, ring
from ringsweep.physics.belt import BristleBelt, laden
from ringsweep.physics.forces import force_in, load_rate
from ringsweep.physics.friction.presliding import (
    after_yield,
    part_before_bend,
    region_guard,
    scales,
    shown,
    stick_speed,
)
from ringsweep.physics.friction.velocity import BAND, KINETIC
from ringsweep.physics.friction.ways import along


@absorbed
def _sliding(scene, motion, x, sign, region):
    """The :class:`Slip` of a sliding velocity and a deflection, `x`."""
    K, slope, bundle = bundled(scene.law, coefficients(scene, sign), *x, sign, region)
    return Slip(motion, x[0], (K, K), (slope, slope), 0.0, (bundle,))


@absorbed
def _in_band(scene, v, z, sign):
    """Whether the contact counts as stuck: the guard of the region BAND is positive."""
    return region_guard(scene.law, *coefficients(scene, sign), v, z, sign, BAND) > 0.0


@constant_step.initial_state.implements(BristleBelt)
def _initial_state_on_bristle_belt(scene):
    """Implement :func:`constant_step.initial_state`: ``(x, velocity, z)``; m, m/s in space, m."""
    velocity = scene.initial_v + drives.turn(scene.drive, 0.0)[1]
    return joined((scene.initial_x, velocity), deflection_at_start(scene.initial_z, scene))


@slip_in_space.implements(BristleBelt)
def _slip_on_bristle_belt(scene, y, v, forcing, angle):
    """Implement :func:`slip_in_space`; what it adds to the slip is 1 if the body counts as stuck, else 0."""
    sign, scene = select(v >= 0.0, 1.0, -1.0), at_place(scene.surface, scene, y[0], forcing[0])
    stuck = _in_band(scene, v, y[2], sign)
    motion = y[0], force_in(scene.drive, forcing), y[1]
    a, b = _sliding(scene, motion, (v, y[2]), sign, BAND), _sliding(scene, motion, (v, y[2]), sign, KINETIC)
    return select_all(stuck, a, b), select(stuck, 1.0, 0.0)


@recorder.begin.implements(BristleBelt)
def _begin_record_on_bristle_belt(scene, t, seen):
    """Implement :func:`recorder.begin`, for the speed and the distance at which bristles yield."""
    # The body moves so far while its bristles go from one largest deflection to the other.
    length, _, recoil, _ = scales(scene.law, along(scene.mu_s, 0.0), scene.body.gravity, scene.initial_z)
    return record_at_launch(scene, t, seen, stick_speed(scene.law, recoil), 2.0 * length)


@recorder.keep_memory.implements(BristleBelt)
def _keep_deflection(scene, row, column, y):
    """Implement :func:`recorder.keep_memory`: the deflection of the bristles, m, or their age, s."""
    if column < len(row):
        row[column] = shown(scene.law, y[2])


@mode_at.implements(BristleBelt)
def _mode_at_on_bristle_belt(scene, place, t, y):
    """Implement :func:`mode_at`."""
    (_, v, z), scene = y, in_segment(scene.surface, scene, place)
    sign = 1 if v > 0.0 else -1
    now = slip_at(scene, Mode(1, BAND, -1, place, ()), t, y)
    forcing = drives.turn(scene.drive, t)
    body = laden(scene.drive, scene, forcing).body
    acceleration, _ = ring.acceleration(body, *now.K, now.motion)
    if v == 0.0:
        # The body begins to slide in the direction of the net force; without a net force the belt leaves it behind.
        sign = 1 if acceleration > forcing[2] else -1
    mode = Mode(sign, BAND if _in_band(scene, v, z, float(sign)) else KINETIC, -1, place, ())
    load = ring.reactions(body, *now.K, now.motion)[0]
    if load == 0.0:
        # The contact holds if the load begins to grow.
        ahead = now.motion[2] if now.motion[2] != 0.0 else acceleration
        load = load_rate(scene.drive, ring.held(body, 0.0, (ahead, 0.0, 0.0), 0.0, 0.0, 0.0)[0], forcing)
        opens = load <= 0.0
    else:
        opens = load < 0.0
    return (SEPARATED_1 if ring.if_load_varies(scene.body, opens, False) else RUNNING), mode


@after_guard.implements(BristleBelt)
def _after_guard_on_bristle_belt(scene, mode, guard, t, y):
    """Implement :func:`after_guard`; FAST is the guard of the bristles, those after it are edges."""
    x, v, z = y
    if guard == NORMAL:
        return after_load(scene, mode, t, y)
    if guard == SLOW:
        return RUNNING, Mode(-mode.sign, BAND, -1, mode.place, ()), (x, 0.0, z)
    if guard > FAST:
        mode, z = _across(scene.surface, scene, mode, guard, v, z)
        return RUNNING, mode, (x, v, z)
    sign, scene = float(mode.sign), in_segment(scene.surface, scene, mode.place)
    z, region = after_yield(scene.law, *coefficients(scene, sign), z, sign, mode.region)
    return RUNNING, Mode(mode.sign, region, -1, mode.place, ()), (x, v, z)


@feature("mode, z")
def _across(surface, scene, mode, guard, v, z):
    """Mode and deflection of a body that has crossed an edge; beyond it bristles may yield, or hold again, at once."""
    place, sign, region = beyond(surface, mode.place, guard), float(mode.sign), mode.region
    mu_s, mu_k = coefficients(in_segment(surface, scene, place), sign)
    while region_guard(scene.law, mu_s, mu_k, v, z, sign, region) < 0.0:
        z, region = after_yield(scene.law, mu_s, mu_k, z, sign, region)
    return Mode(mode.sign, region, -1, place, ()), z


@modes.is_lost.implements(BristleBelt)
def _is_lost_on_bristle_belt(scene, t, s):
    """Implement :func:`modes.is_lost`: nothing jams, and a contact that stops slows down by many decades."""
    return s == 0.0


@slip.implements(BristleBelt)
def _slip_of_bristle_belt(scene, mode, common, forcing, x):
    """Implement :func:`slip`; `x` is the displacement relative to the belt, the sliding velocity, the deflection."""
    motion = x[0] + forcing[0], force_in(scene.drive, forcing), x[1] + forcing[1]
    scene = in_segment(scene.surface, scene, mode.place)
    return _sliding(scene, motion, x[1:], float(mode.sign), mode.region)


@region_guards.implements(BristleBelt)
def _region_guards_on_bristle_belt(scene, mode, common, x):
    """Implement :func:`region_guards`: the sliding speed, m/s, and the guard of the bristles."""
    _, v, z = x
    sign, scene = float(mode.sign), in_segment(scene.surface, scene, mode.place)
    return sign * v, region_guard(scene.law, *coefficients(scene, sign), v, z, sign, mode.region)


@implicit.part_before_bend.implements(BristleBelt)
def _part_before_bend_on_bristle_belt(scene, mode, common, x, x_next):
    """Implement :func:`implicit.part_before_bend`."""
    sign, scene = float(mode.sign), in_segment(scene.surface, scene, mode.place)
    return part_before_bend(scene.law, *coefficients(scene, sign), *x[1:], sign, *x_next[1:])


@implicit.error_scales.implements(BristleBelt)
def _error_scales_on_bristle_belt(scene, tolerance, x):
    """Implement :func:`implicit.error_scales`, from the largest deflection that friction can hold."""
    length, state, speed, friction = scales(scene.law, along(scene.mu_s, 0.0), scene.body.gravity, x[2])
    return (
        tolerance * (length_scale(scene, abs(x[1])) + length),
        tolerance * (abs(x[1]) + speed),
        tolerance * state,
        tolerance * friction * scene.body.gravity,
    )
