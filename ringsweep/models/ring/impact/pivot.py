"""The pivot: a body on one contact, see :mod:`ringsweep.physics.pivot`, in the friction and the motion of a mode.

Only ``switch.py``, ``jam.py`` and ``creep.py`` beside this file call it. `y` is the state of a pivot, see
:mod:`mode`; `f` its :class:`ringsweep.physics.pivot.Frame`; `carried` the acceleration of the race, m/s^2.
"""

from __future__ import annotations

from math import cos, inf, isnan

from ringsweep.compile import inlined
from ringsweep.models.interface.status import BROKEN, JAM, RUNNING
from ringsweep.models.ring.impact.mode import (
    coefficients_there,
    delta_when_closed,
    frame,
    holding,
    place_of,
    with_place,
)
from ringsweep.models.ring.series import EQUAL, SLOW, with_slip
from ringsweep.physics import drives
from ringsweep.physics.friction.velocity import friction_in, region_at, stiction_band
from ringsweep.physics.impact import side_of
from ringsweep.physics.pivot import determinant, in_slip, in_stick, size, sliding_acceleration
from ringsweep.physics.zones import leave_edge

# Rounding of accelerations, as a share of their terms.
_ROUNDING = 1e-13

# A gap whose acceleration is zero opens by its third derivative. This share of the terms counts as zero.
_SHUT = 1e-6


@inlined
def friction(scene, mode, v):
    """K at the contact that holds, at the sliding velocity `v`, and its derivative, s/m, by the formula of the mode."""
    mu_s, mu_k, _ = coefficients_there(scene, place_of(mode))
    mu, slope = friction_in(scene.law, mode.region, mode.sign * v, (mu_s, mu_k))
    return -mode.sign * mu, -slope


@inlined
def _slipping(scene, stick, y, rho, slip):
    """Mode of a pivot that begins to slip; `slip` is the sign, the region of the law, and the entry guard."""
    # Over the ring the ball moves in the direction of its slip, unless it rolls.
    rolls = y[1] - scene.balls.radius * y[3]
    heading = slip[0] if rolls == 0.0 else 1 if rolls > 0.0 else -1
    place = leave_edge(scene.closed.surface, place_of(stick), rho, heading)
    return with_slip(with_place(stick, place), *slip)


@inlined
def begun(scene, t, y, stick, stick_end):
    """Status and mode of a pivot that begins in the state `y`, or whose sliding velocity is zero.

    `stick` is the mode if the contact sticks. `stick_end` is 0 if it may; +1 or -1 if stick has just ended by breakaway
    in this direction.
    """
    body = scene.closed.body
    theta, ring_omega, ring_epsilon = drives.turn(scene.drive, t)
    contact, v = holding(stick), y[1]
    f, carried = frame(scene, y, ring_omega), body.radius * ring_epsilon
    rho = f.alpha - theta
    if isnan(f.alpha + f.psi_dot + ring_epsilon):
        return BROKEN, stick
    least = _ROUNDING * body.mass * size(f)
    # The other contact, if it touches and does not move yet, must open by its acceleration.
    touches = y[2] == 0.0 and y[3] == 0.0
    delta = delta_when_closed(scene, contact, stick.contacts.turned)
    arm = 2.0 * scene.balls.half_distance * side_of(contact) * cos(delta)
    shut = -_SHUT * size(f)
    if v == 0.0 and stiction_band(scene.law) == 0.0:
        mu_s, _, _ = coefficients_there(scene, place_of(stick))
        if stick_end == 0:
            psi_dd, alpha_dd, normal, along = in_stick(f, carried)
            holds = normal > least and abs(along) <= mu_s * normal and mu_s > 0.0
            if holds and not (touches and arm * (psi_dd - alpha_dd) < shut):
                return RUNNING, stick
        region = region_at(scene.law, 0.0)
        best, best_mode, several = -inf, stick, False
        for sign in (1, -1):
            slip = _slipping(scene, stick, y, rho, (sign, region, SLOW))
            K, _ = friction(scene, slip, 0.0)
            found = in_slip(f, K)
            psi_dd, alpha_dd, normal, _ = found
            push = sign * sliding_acceleration(f, found, carried)
            # At breakaway no friction is greater than that in stick. Where it does not fall, the push begins at zero.
            if stick_end == sign and abs(K) <= (1.0 + EQUAL) * mu_s:
                push = max(push, 1e-12 * size(f))
            if touches and arm * (psi_dd - alpha_dd) < shut:
                continue
            if determinant(f, K) > 0.0 and normal > least and push > best:
                several = several or (best > least / body.mass and push > least / body.mass)
                best, best_mode = push, slip
        # A push of nothing is a tie: for example a contact without friction.
        return (JAM, stick) if several or not best > -least / body.mass else (RUNNING, best_mode)
    sign, region, entry_guard = (1 if v > 0.0 else -1), region_at(scene.law, abs(v)), -1
    if v == 0.0:
        # Friction is zero here, so that the ball slides in the direction in which the other forces accelerate it.
        sign = 1 if sliding_acceleration(f, in_slip(f, 0.0), carried) >= 0.0 else -1
        entry_guard = SLOW
    slip = _slipping(scene, stick, y, rho, (sign, region, entry_guard))
    K, _ = friction(scene, slip, v)
    return (RUNNING if determinant(f, K) > 0.0 else JAM), slip


@inlined
def solution(scene, mode, t, y):
    """Accelerations of psi and alpha (rad/s^2), reaction and friction (N) in the slip or stick of a mode."""
    _, ring_omega, ring_epsilon = drives.turn(scene.drive, t)
    f = frame(scene, y, ring_omega)
    if mode.sign == 0:
        return in_stick(f, scene.closed.body.radius * ring_epsilon)
    return in_slip(f, friction(scene, mode, y[1])[0])
