"""The pivot: a body on one contact, which slides or sticks while the body swings about it.

Symbols: alpha is the angle of the ball that touches, ``delta = psi - alpha``. The vector from the centre of the ball to
the centre of mass is u outwards and w along the race, ``q = r - u``; F is the friction along the race, in slip
``F = K N``. Momentum, radial and tangential, and moment of momentum about the centre of mass:

.. math::

    M (-\\rho \\dot\\alpha^2 - w \\ddot\\psi - u \\dot\\psi^2) &= M g \\cos\\alpha - N \\\\
    M (\\rho \\ddot\\alpha + u \\ddot\\psi - w \\dot\\psi^2) &= -M g \\sin\\alpha + F \\\\
    J \\ddot\\psi &= -w N + q F

and a fourth equation: ``F = K N`` in slip; ``\\rho \\ddot\\alpha + r \\ddot\\psi = R \\ddot\\theta`` in stick. These
equations are linear in both accelerations, N and F. So are those for their derivatives, and for the coefficients of
their power series, with other right sides: :func:`solved_in_slip` and :func:`solved_in_stick` solve all of them.

In slip the contact jams where the determinant, which is M J times the acceleration of its gap per unit of N, is not
positive.
"""

from __future__ import annotations

from math import cos, isnan, sin
from typing import NamedTuple

from ringsweep.compile import inlined, replacing
from ringsweep.models.interface.status import BROKEN, JAM, RUNNING
from ringsweep.models.ring.impact.mode import (
    RING,
    coefficients_there,
    delta_when_closed,
    holding,
    place_of,
    with_place,
    with_slip,
)
from ringsweep.models.ring.series import EQUAL, SLOW
from ringsweep.physics import drives
from ringsweep.physics.friction.velocity import friction_in, region_at, stiction_band
from ringsweep.physics.impact import inertia, side_of
from ringsweep.physics.zones import leave_edge

# Rounding of accelerations, as a share of their terms.
_ROUNDING = 1e-13

# A gap whose acceleration is zero opens by its third derivative. This share of the terms counts as zero.
_SHUT = 1e-6


class Frame(NamedTuple):
    """Place and rates of a pivot: angles in rad, rates in rad/s, lengths in m."""

    alpha: float
    sin_alpha: float
    cos_alpha: float
    u: float
    w: float
    q: float
    psi_dot: float
    alpha_dot: float


#: Frame with other rates of psi and alpha.
with_rates = replacing("psi_dot", "alpha_dot")


@inlined
def frame(scene, contact, turned, y, ring_omega):
    """Place and rates of a pivot on a contact, in the state `y`."""
    balls = scene.balls
    delta = delta_when_closed(scene.closed.body, contact, turned) + y[2]
    alpha = y[0] - delta
    a, h, s, c = side_of(contact) * balls.half_distance, balls.offset, sin(delta), cos(delta)
    u = h * c - a * s
    psi_dot = (y[1] + balls.reach * y[3]) / scene.closed.body.radius + ring_omega
    return Frame(alpha, sin(alpha), cos(alpha), u, a * c + h * s, balls.radius - u, psi_dot, psi_dot - y[3])


@inlined
def load(scene, f):
    """G of the module's text, m/s^2."""
    return (
        scene.closed.body.gravity * f.cos_alpha
        + scene.balls.reach * f.alpha_dot * f.alpha_dot
        + f.u * f.psi_dot * f.psi_dot
    )


@inlined
def size(scene, f):
    """Size of the terms in the balances per unit of mass, m/s^2."""
    square = scene.balls.reach * f.alpha_dot * f.alpha_dot + (abs(f.u) + abs(f.w)) * f.psi_dot * f.psi_dot
    return scene.closed.body.gravity + square + 1e-300


@inlined
def sides(scene, f):
    """Right sides of the three balances: the terms without accelerations and forces, N, N and N m."""
    body = scene.closed.body
    along = body.gravity * f.sin_alpha - f.w * f.psi_dot * f.psi_dot
    return body.mass * load(scene, f), body.mass * along, 0.0


@inlined
def determinant(scene, f, K):
    """Determinant of the equations in slip, kg m^2."""
    return inertia(scene.closed.body) + scene.closed.body.mass * f.w * (f.w - K * f.q)


@inlined
def solved_in_slip(scene, f, K, sides, pull):
    """Solution of the balances in slip.

    Parameters
    ----------
    scene : ImpactRing
    f : Frame
    K : float
        Friction per unit of N, 1.
    sides : tuple of float
        N less what is due to ``psi_dd``, F less what is due to both accelerations, and the moment ``J psi_dd + w N - q
        F``: N, N, N m.
    pull : float
        ``F - K N``, N.

    Returns
    -------
    tuple of float
        Accelerations of psi and alpha, rad/s^2; N and F, N.
    """
    (across, along, turning), mass = sides, scene.closed.body.mass
    inverse, lever, turning = 1.0 / determinant(scene, f, K), f.w - K * f.q, turning + f.q * pull
    psi_dd = (turning - lever * across) * inverse
    normal = (inertia(scene.closed.body) * across + mass * f.w * turning) * inverse
    friction = pull + K * normal
    return psi_dd, ((friction - along) / mass - f.u * psi_dd) / scene.balls.reach, normal, friction


@inlined
def solved_in_stick(scene, f, sides, carried):
    """As :func:`solved_in_slip`, in stick: the touching point has the acceleration `carried` along the race, m/s^2."""
    (across, along, turning), mass = sides, scene.closed.body.mass
    inverse = 1.0 / (inertia(scene.closed.body) + mass * (f.w * f.w + f.q * f.q))
    along = along + mass * carried
    psi_dd = (turning + f.q * along - f.w * across) * inverse
    alpha_dd = (carried - scene.balls.radius * psi_dd) / scene.balls.reach
    return psi_dd, alpha_dd, across + mass * f.w * psi_dd, along - mass * f.q * psi_dd


@inlined
def in_slip(scene, f, K):
    """Accelerations of psi and alpha (rad/s^2), normal reaction (N), and determinant (kg m^2), in slip."""
    psi_dd, alpha_dd, normal, _ = solved_in_slip(scene, f, K, sides(scene, f), 0.0)
    return psi_dd, alpha_dd, normal, determinant(scene, f, K)


@inlined
def in_stick(scene, f, ring_epsilon):
    """Accelerations of psi and alpha (rad/s^2), normal reaction and friction (N) while the contact sticks."""
    return solved_in_stick(scene, f, sides(scene, f), scene.closed.body.radius * ring_epsilon)


@inlined
def sliding_acceleration(scene, psi_dd, alpha_dd, ring_epsilon):
    """Rate of the sliding velocity, m/s^2."""
    return scene.balls.reach * alpha_dd + scene.balls.radius * psi_dd - scene.closed.body.radius * ring_epsilon


@inlined
def friction(scene, mode, v):
    """K at the contact that holds, at the sliding velocity `v`, and its derivative, s/m, by the formula of the mode."""
    mu_s, mu_k, _ = coefficients_there(scene, place_of(mode))
    mu, slope = friction_in(scene.law, mode.region, mode.sign * v, (mu_s, mu_k))
    return -mode.sign * mu, -slope


@inlined
def _heading(scene, y, sign):
    """Direction in which the ball moves over the ring: a ball that does not roll moves as it slides, with `sign`."""
    rolls = y[1] - scene.balls.radius * y[3]
    return sign if rolls == 0.0 else 1 if rolls > 0.0 else -1


@inlined
def begun(scene, t, y, stick, stick_end):
    """Status and mode of a pivot that begins in the state `y`, or whose sliding velocity is zero.

    `stick` is the mode if the contact sticks. `stick_end` is 0 if it may; +1 or -1 if stick has just ended by breakaway
    in this direction.
    """
    body = scene.closed.body
    theta, ring_omega, ring_epsilon = drives.turn(scene.drive, t)
    contact, place, v = holding(stick), place_of(stick), y[1]
    f = frame(scene, contact, stick.turned, y, ring_omega)
    rho = f.alpha - theta
    if isnan(f.alpha + f.psi_dot + ring_epsilon):
        return BROKEN, stick
    least = _ROUNDING * body.mass * size(scene, f)
    # The other contact, if it touches and does not move yet, must open by its acceleration.
    touches = y[2] == 0.0 and y[3] == 0.0
    arm = 2.0 * scene.balls.half_distance * side_of(contact) * cos(delta_when_closed(body, contact, stick.turned))
    shut = -_SHUT * size(scene, f)
    if v == 0.0 and stiction_band(scene.law) == 0.0:
        mu_s, _, _ = coefficients_there(scene, place)
        if stick_end == 0:
            psi_dd, alpha_dd, normal, along = in_stick(scene, f, ring_epsilon)
            holds = normal > least and abs(along) <= mu_s * normal and mu_s > 0.0
            if holds and not (touches and arm * (psi_dd - alpha_dd) < shut):
                return RUNNING, stick
        region = region_at(scene.law, 0.0)
        best, best_sign = -1e300, 0
        several = False
        for sign in (1, -1):
            there = leave_edge(scene.closed.surface, place, rho, _heading(scene, y, sign))
            slip = with_slip(with_place(stick, there), sign, region, RING + SLOW)
            K, _ = friction(scene, slip, 0.0)
            psi_dd, alpha_dd, normal, denominator = in_slip(scene, f, K)
            push = sign * sliding_acceleration(scene, psi_dd, alpha_dd, ring_epsilon)
            # At breakaway no friction is greater than that in stick. Where it does not fall, the push begins at zero.
            if stick_end == sign and abs(K) <= (1.0 + EQUAL) * mu_s:
                push = max(push, 1e-12 * size(scene, f))
            if touches and arm * (psi_dd - alpha_dd) < shut:
                continue
            if denominator > 0.0 and normal > least and push > best:
                several = several or (best > least / body.mass and push > least / body.mass)
                best, best_sign = push, sign
        if several:
            return JAM, stick
        # A tie: for example a contact without friction.
        if best_sign == 0 or best < -least / body.mass:
            return JAM, stick
        there = leave_edge(scene.closed.surface, place, rho, _heading(scene, y, best_sign))
        return RUNNING, with_slip(with_place(stick, there), best_sign, region, RING + SLOW)
    sign, region, entry_guard = (1 if v > 0.0 else -1), region_at(scene.law, abs(v)), -1
    if v == 0.0:
        # Friction is zero here, so that the ball slides in the direction in which the other forces accelerate it.
        psi_dd, alpha_dd, _, _ = in_slip(scene, f, 0.0)
        sign = 1 if sliding_acceleration(scene, psi_dd, alpha_dd, ring_epsilon) >= 0.0 else -1
        entry_guard = RING + SLOW
    there = leave_edge(scene.closed.surface, place, rho, _heading(scene, y, sign))
    slip = with_slip(with_place(stick, there), sign, region, entry_guard)
    K, _ = friction(scene, slip, v)
    denominator = in_slip(scene, f, K)[3]
    return (RUNNING if denominator > 0.0 else JAM), slip


@inlined
def acceleration(scene, mode, t, y):
    """Accelerations of psi and alpha, and normal reaction, in a pivot: rad/s^2, N."""
    _, ring_omega, ring_epsilon = drives.turn(scene.drive, t)
    f = frame(scene, holding(mode), mode.turned, y, ring_omega)
    if mode.sign == 0:
        psi_dd, alpha_dd, normal, _ = in_stick(scene, f, ring_epsilon)
    else:
        K, _ = friction(scene, mode, y[1])
        psi_dd, alpha_dd, normal, _ = in_slip(scene, f, K)
    return psi_dd, alpha_dd, normal
