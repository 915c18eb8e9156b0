"""Implicit steps of a body that may leave the race, in the stiction band of a smooth law.

While both contacts hold, the steps are those of the closed ring. In a pivot the state is
``(psi - theta, v, eta, eta_dot, code)``, see :mod:`mode`, so that no state is the difference of two large numbers.

`f` is the :class:`ringsweep.physics.pivot.Frame` of the pivot, `found` its solution: accelerations of psi and alpha
(rad/s^2), normal reaction and friction (N).
"""

from __future__ import annotations

from math import inf, sqrt

from ringsweep.compile import inlined
from ringsweep.models.interface import implicit
from ringsweep.models.interface.shock import Located
from ringsweep.models.ring.impact.mode import (
    FIRST,
    NONE,
    coefficients_there,
    distances_to_edges,
    frame,
    gap_measure,
    place_of,
    ring_of,
)
from ringsweep.models.ring.record import extremes_of
from ringsweep.models.sliding import rate_at_rest
from ringsweep.numerics.terms import joined
from ringsweep.physics import drives, pivot
from ringsweep.physics.friction.velocity import friction_in, region_bounds
from ringsweep.physics.impact import ImpactRing, inertia

# Error allowed to a gap, in units of that allowed to the angle: the instant of an impact follows from it.
_GAP_TOLERANCE = 1e-2

# A contact that pivots crosses an edge this far behind it, rad, so that it does not cross back by rounding.
_BEYOND = 1e-12


@implicit.to_implicit.implements(ImpactRing)
def _to_implicit_with_impact(scene, forcing, y):
    """Implement :func:`implicit.to_implicit`: ``(psi - theta, v, eta, eta_dot, code)``."""
    return y[0] - forcing[0], y[1], y[2], y[3], y[-1]


@implicit.from_implicit.implements(ImpactRing)
def _from_implicit_with_impact(scene, forcing, x):
    """Implement :func:`implicit.from_implicit`."""
    return x[0] + forcing[0], x[1], x[2], x[3], 0.0, 0.0, 0.0, 0.0, x[4]


@implicit.common.implements(ImpactRing)
def _common_with_impact(scene, mode, forcing, x):
    """Implement :func:`implicit.common`, for the steps of the closed ring."""
    return implicit.common(ring_of(scene, mode.contacts.turned), mode, forcing, (x[0], x[1]))


@implicit.is_stiff.implements(ImpactRing)
def _is_stiff_with_impact(scene, mode, y, linear):
    """Implement :func:`implicit.is_stiff`."""
    # A gap that has just opened grows from zero: its first step is a series.
    return y[2] != 0.0 and implicit.is_stiff(scene.closed, mode, y, linear)


@implicit.error_scales.implements(ImpactRing)
def _error_scales_with_impact(scene, tolerance, x):
    """Implement :func:`implicit.error_scales` for psi - theta, v, eta, its rate, and the code, which has no error."""
    place, speed, _ = implicit.error_scales(scene.closed, tolerance, (x[0], x[1]))
    gap = tolerance * _GAP_TOLERANCE
    return (
        place,
        speed,
        gap,
        gap * (rate_at_rest(scene.closed) + sqrt(scene.closed.body.gravity / scene.balls.reach)),
        1.0,
        inf,
    )


@inlined
def _friction(scene, mode, v):
    """K at the contact that holds, and its derivative, s/m."""
    sign, (mu_s, mu_k, _) = 1.0 if v >= 0.0 else -1.0, coefficients_there(scene, place_of(mode))
    mu, slope = friction_in(scene.law, mode.region, abs(v), (mu_s, mu_k))
    return -sign * mu, -slope


@inlined
def _frame_of_implicit(scene, forcing, x):
    """The :class:`Frame` of the pivot in the state `x` of an implicit step."""
    return frame(scene, implicit.from_implicit(scene, forcing, x), forcing[1])


@inlined
def _rates_from(scene, forcing, x, f, found):
    """Rates of the state `x`, from the solution `found` of the balances of the pivot `f`."""
    v_dot = pivot.sliding_acceleration(f, found, scene.closed.body.radius * forcing[2])
    turning = (x[1] + scene.balls.reach * x[3]) / scene.closed.body.radius
    return turning, v_dot, x[3], found[0] - found[1], 0.0


@implicit.rates.implements(ImpactRing)
def _rates_with_impact(scene, mode, common, forcing, x):
    """Implement :func:`implicit.rates` in a pivot."""
    f, (K, _) = _frame_of_implicit(scene, forcing, x), _friction(scene, mode, x[1])
    return _rates_from(scene, forcing, x, f, pivot.in_slip(f, K))


@implicit.linearise.implements(ImpactRing)
def _linearise_with_impact(scene, mode, common, t, forcing, x):
    """Implement :func:`implicit.linearise` in a pivot."""
    nothing, (_, ring_omega, ring_epsilon) = (0.0, 0.0, 0.0, 0.0), forcing
    f, friction = _frame_of_implicit(scene, forcing, x), _friction(scene, mode, x[1])
    found = pivot.in_slip(f, friction[0])
    # Columns of the Jacobian, and the derivative by time at a constant state.
    by_place = _derivative(scene, f, friction, found, (1.0, 0.0, 0.0, 0.0), (0.0, 0.0, 0.0))
    by_v = _derivative(scene, f, friction, found, (0.0, 1.0, 0.0, 0.0), (0.0, 0.0, 0.0))
    by_eta = _derivative(scene, f, friction, found, (0.0, 0.0, 1.0, 0.0), (0.0, 0.0, 0.0))
    by_rate = _derivative(scene, f, friction, found, (0.0, 0.0, 0.0, 1.0), (0.0, 0.0, 0.0))
    by_time = _derivative(
        scene, f, friction, found, nothing, (ring_omega, ring_epsilon, drives.jerk_at(scene.drive, t))
    )
    per_radius = 1.0 / scene.closed.body.radius
    jacobian = (
        (0.0, per_radius, 0.0, scene.balls.reach * per_radius, 0.0),
        (by_place[0], by_v[0], by_eta[0], by_rate[0], 0.0),
        (0.0, 0.0, 0.0, 1.0, 0.0),
        (by_place[1], by_v[1], by_eta[1], by_rate[1], 0.0),
        (0.0, 0.0, 0.0, 0.0, 0.0),
    )
    return _rates_from(scene, forcing, x, f, found), jacobian, (0.0, by_time[0], 0.0, by_time[1], 0.0)


@inlined
def _derivative(scene, f, friction, found, state, forcing):
    """Derivatives of the rates of v and of eta_dot along a change of the state and of the forcing.

    `friction` is K and its slope, `found` the solution of the balances.
    """
    (K, slope), (d_place, d_v, d_eta, d_rate), (d_theta, d_omega, d_epsilon) = friction, state, forcing
    radius, d_alpha = scene.closed.body.radius, d_place + d_theta - d_eta
    d_psi_dot = (d_v + f.reach * d_rate) / radius + d_omega
    squares = 2.0 * f.psi_dot * d_psi_dot, 2.0 * f.alpha_dot * (d_psi_dot - d_rate)
    change = f.cos_alpha * d_alpha, -f.sin_alpha * d_alpha, -f.w * d_eta, f.u * d_eta, *squares
    rest = pivot.imbalance_of_change(f, found, change, pivot.NO_PRODUCTS)
    changed = pivot.solved_in_slip(f, K, (*rest, slope * d_v * found[2]))
    return pivot.sliding_acceleration(f, changed, radius * d_epsilon), changed[0] - changed[1]


# The motion in a view is what the recorder is shown, and how near to zero the guards may come before their roots are
# looked for.


@implicit.guards_and_motion.implements(ImpactRing)
def _guards_and_motion_with_impact(scene, mode, common, forcing, x):
    """Implement :func:`implicit.guards_and_motion`.

    The motion is psi, its rate and its acceleration, then what :func:`implicit.seen` and :func:`implicit.near_zero`
    return. The guard of an open contact is its gap.
    """
    body, contacts = scene.closed.body, mode.contacts
    if contacts.open == NONE:
        closed = ring_of(scene, contacts.turned)
        view = implicit.guards_and_motion(closed, mode, common, forcing, (x[0], x[1]))
        shown = joined(implicit.seen(closed, view), (0.0, 0.0, 0.0))
        return view[0], (view[1][0], view[1][1], view[1][2], shown, implicit.near_zero(closed, view[1]))
    f, (K, _) = _frame_of_implicit(scene, forcing, x), _friction(scene, mode, x[1])
    psi_dd, _, normal, _ = pivot.in_slip(f, K)
    gap, speed, (low, high) = gap_measure(scene, mode, x[2]), mode.sign * x[1], region_bounds(scene.law, mode.region)
    above, below = distances_to_edges(scene, mode, f.alpha - forcing[0])
    ahead = (above + _BEYOND) * (below + _BEYOND) if above < inf else inf
    load = 0.05 * body.mass * pivot.size(f)
    reactions, gaps, loads, guards = (normal, 0.0), (0.0, gap), (load, 0.0), (normal, gap)
    if contacts.open == FIRST:
        reactions, gaps, loads, guards = (0.0, normal), (gap, 0.0), (0.0, load), (gap, normal)
    acceleration = Located(psi_dd, body.gravity / body.radius + f.psi_square + abs(psi_dd))
    psi = x[0] + forcing[0]
    seen = psi, f.psi_dot, *reactions, acceleration, gaps[0], gaps[1], float(contacts.open)
    near_zero = 0.02 * inertia(body), 0.0, *loads, 0.0, 0.0
    motion = psi, f.psi_dot, psi_dd, seen, near_zero
    return (pivot.determinant(f, K), speed - low, *guards, ahead, high - speed), motion


@implicit.near_zero.implements(ImpactRing)
def _near_zero_with_impact(scene, motion):
    """Implement :func:`implicit.near_zero`."""
    return motion[4]


@implicit.seen.implements(ImpactRing)
def _seen_in_implicit_step_with_impact(scene, view):
    """Implement :func:`implicit.seen`: what ``_observe_with_impact`` in :mod:`record` takes."""
    return view[1][3]


@implicit.sought.implements(ImpactRing)
def _sought_with_impact(scene, record, view):
    """Implement :func:`implicit.sought`: as on the ring, and both gaps."""
    psi, psi_dot, normal_1, normal_2, _, gap_1, gap_2, _ = view[1][3]
    most = record.gap_max
    return (*extremes_of(record.base, psi, psi_dot, normal_1, normal_2), (gap_1, 0.0, most), (gap_2, 0.0, most))
