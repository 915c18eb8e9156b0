"""What a body on a ring and a body on a belt have in common. A belt is kinematically a ring of radius 1."""

from __future__ import annotations

from math import inf, isfinite, isnan

import numpy as np

from ringsweep.compile import hook, inlined
from ringsweep.models.interface import audit, constant_step, implicit, modes, series
from ringsweep.models.interface.status import BROKEN, JAM, RUNNING, SEPARATED_1, SEPARATED_2, SEPARATED_BOTH
from ringsweep.models.parts import exceeds, larger_eigenvalue
from ringsweep.models.slip import acceleration_slopes, couplings
from ringsweep.numerics.functions import any_of, select
from ringsweep.numerics.series import slope, value
from ringsweep.numerics.terms import set_terms, terms
from ringsweep.physics import contact, drives, ring
from ringsweep.physics.belt import Belt, BristleBelt
from ringsweep.physics.friction.registry import holds_in_band
from ringsweep.physics.friction.velocity import passes_band, steepest, stiction_band
from ringsweep.physics.ring import BristleRing, Ring

#: Status of a run for each mode of :mod:`ringsweep.physics.contact`.
ENDS = np.full(8, RUNNING)
ENDS[[contact.OPEN_1, contact.OPEN_2, contact.OPEN_BOTH]] = SEPARATED_1, SEPARATED_2, SEPARATED_BOTH
ENDS[contact.IMPOSSIBLE] = JAM

#: Error allowed to the reactions as a share of the load, in units of the tolerance of the series.
REACTION_TOLERANCE = 1e3

# Rounding of an acceleration, as a share of its largest terms.
_ROUNDING = 1e-12

# Square of an error of the balances, as a share of their terms, that is more than rounding.
_UNBALANCED = 1e-9 * 1e-9


# ---- states -----------------------------------------------------------------------------------

# Place and sliding velocity are the first rows of a table of series.


@series.state_at.implements(Ring, Belt)
def _state_at(scene, c, s):
    return value(c[0], s), value(c[1], s)


@series.rates_at.implements(Ring, Belt)
def _rates_at(scene, c, s):
    return slope(c[0], s), slope(c[1], s)


@modes.in_space.implements(Ring, Belt, BristleBelt)
def _in_space(scene, t, y):
    return y[0], y[1] / ring.radius(scene.body) + drives.turn(scene.drive, t)[1]


# The place of an implicit step is relative to the drive, so that no large numbers cancel in slow creep.
@implicit.to_implicit.implements(Ring, Belt)
def _to_implicit(scene, forcing, y):
    return y[0] - forcing[0], y[1]


@implicit.from_implicit.implements(Ring, Belt)
def _from_implicit(scene, forcing, x):
    return x[0] + forcing[0], x[1]


@implicit.motion.implements(Ring, BristleRing, Belt, BristleBelt)
def _motion(scene, forcing, x, linear):
    radius = ring.radius(scene.body)
    return x[1] / radius + forcing[1], linear[0][1] / radius + forcing[2]


# ---- series ----------------------------------------------------------------------------------


@inlined
def expand_bounds(c, rows, mode, bounds, size):
    """Fill the guards of slip for both bounds of the region of the friction law, m/s.

    Parameters
    ----------
    c : ndarray of shape ``(rows, columns)``
        Table of series.
    rows : tuple of int
        Rows of the sliding velocity, and of the guards of the lower and of the upper bound.
    mode : NamedTuple
    bounds : tuple of float
        The bounds, m/s.
    size : float
        Size of the terms of the sliding acceleration, m/s^2.
    """
    (v, slow, fast), (low, high), sign = rows, bounds, float(mode.sign)
    set_terms(c[slow], terms(c[v]) * sign)
    set_terms(c[fast], terms(c[v]) * -sign)
    c[slow, 0] = 0.0 if mode.entry_guard == slow else sign * c[v, 0] - low
    c[fast, 0] = 0.0 if mode.entry_guard == fast else high - sign * c[v, 0]
    # If friction does not drop at breakaway, the slope is zero there: what is computed is rounding.
    if mode.entry_guard == slow and low == 0.0 and abs(c[v, 1]) <= 1e-12 * size:
        c[slow, 1] = 0.0


# ---- audit ------------------------------------------------------------------------------------


@inlined
def larger(a, b):
    """The larger of two violations; infinite if `b` is not a number."""
    return max(a, b) if b < inf else inf


@inlined
def of_balances(scene, friction, normals, motion, forcing, rate, scales):
    """Violation of the balances and of the signs of the reactions by a state in slip or stick, and power, W.

    Parameters
    ----------
    scene : NamedTuple
    friction, normals : tuple of float
        K, and the reaction (N), at each contact.
    motion : tuple of float
        As for :func:`ringsweep.physics.ring.acceleration`.
    forcing : tuple of float
        What :func:`ringsweep.models.interface.implicit.forcing` returned.
    rate : float
        Rate of the sliding velocity from the dense output, m/s^2.
    scales : tuple of float
        Error allowed to this rate; size of the terms of the acceleration, m/s^2; tolerance of the run.
    """
    body, (allowed, terms, tolerance) = scene.body, scales
    acceleration, _ = ring.acceleration(body, *friction, motion)
    error = abs(ring.radius(body) * (acceleration - forcing[2]) - rate)
    violation = larger(0.0, error / (allowed + _ROUNDING * terms))
    least = ring.if_load_varies(body, min(normals[0], normals[1]), 0.0)
    violation = larger(violation, -least / (body.mass * terms * REACTION_TOLERANCE * tolerance))
    violation = larger(violation, ring.imbalance(body, *friction, *normals, acceleration, motion) / _UNBALANCED)
    return violation, ring.power(body, *friction, *normals, motion)


@hook
def audited(scene, mode, forcing, y):
    """What the audit looks at, of a body on bristles.

    Returns
    -------
    tuple
        The :class:`ringsweep.models.slip.Slip` of the state `y`, the size of the terms of the acceleration, m/s^2, and
        a violation already found.
    """


@audit.violation.implements(BristleRing, BristleBelt)
def _bristle_violation(scene, mode, forcing, y, rates, s, tolerance):
    now, terms, largest = audited(scene, mode, forcing, y)
    body, v = scene.body, y[1]
    if not ring.acceleration(body, *now.K, now.motion)[1] > 0.0:
        largest = inf
    scales = implicit.error_scales(scene, implicit.IMPLICIT_TOLERANCE * tolerance, y)
    speed, deflection = scales[1], scales[2]
    allowed = (1.0 / s + abs(acceleration_slopes(scene, now)[1])) * speed
    by_bristles = couplings(now.bristles, scene, now)
    for i in range(len(by_bristles)):
        by_z, rate_v, rate_z = by_bristles[i]
        allowed += abs(by_z) * deflection
        error = abs(now.bristles[i].rate - rates[2 + i])
        largest = larger(
            largest, error / ((1.0 / s + abs(rate_z)) * deflection + abs(rate_v) * speed + _ROUNDING * abs(v))
        )
    normals = ring.reactions(body, *now.K, now.motion)
    violation, power = of_balances(scene, now.K, normals, now.motion, forcing, rates[1], (allowed, terms, tolerance))
    return larger(larger(largest, -mode.sign * v / speed), violation), power


# ---- steps of constant length -----------------------------------------------------------------


@constant_step.holds.implements(Ring, BristleRing, Belt, BristleBelt)
def _holds(scene, now):
    # Comparisons with NaN are false.
    finite = (abs(now.rates[1]) < inf) & (abs(now.rates[0]) < inf)
    supported = (now.determinant > 0.0) & (now.normal_1 > 0.0) & (now.normal_2 > 0.0)
    return ring.if_load_varies(scene.body, supported & finite, finite)


@constant_step.verdict.implements(Ring, BristleRing, Belt, BristleBelt)
def _verdict(scene, before, now):
    if not now.determinant > 0.0:
        return (BROKEN if isnan(now.determinant) else JAM), 1.0
    if not (isfinite(now.rates[1]) and isfinite(now.rates[0])):
        return BROKEN, 1.0
    if not ring.if_load_varies(scene.body, True, False):
        return RUNNING, 1.0
    first, second = _root_fraction(before.normal_1, now.normal_1), _root_fraction(before.normal_2, now.normal_2)
    fraction = min(first, second)
    if fraction > 1.0:
        return RUNNING, 1.0
    return ENDS[contact.lost(scene.body, first == fraction, second == fraction)], fraction


@inlined
def _root_fraction(before, now):
    """Fraction of a step at which a value that changes linearly from `before` to `now` is zero; 2 if it is positive."""
    if now > 0.0:
        return 2.0
    return before / (before - now) if before > now else 0.0


@constant_step.eigenvalue.implements(Ring, Belt)
def _eigenvalue(scene, before, now, h, most):
    radius = ring.radius(scene.body)
    friction_slope = _steeper(before.slope, now.slope)
    # A step that jumps over the band, or over its edge, does not sample the slope there. The slope counts all the same,
    # since just such a step may lead to a wrong regime.
    at_rest, at_edge = steepest(scene.law)
    scale = -radius * ring.friction_gain(scene.body, now.motion)
    bound = max(abs(at_rest), abs(at_edge)) * abs(scale) + abs(now.by_velocity)
    if any_of(exceeds(most, bound, -now.by_place)):
        # The stages of the step reach about as far as the acceleration at its beginning takes the body.
        ring_gains = (radius * now.rates[0] - now.v) - (radius * before.rates[0] - before.v)
        ahead = before.v + h * radius * before.rates[1] - ring_gains
        rest, edge, jumped = passes_band(scene.law, before.v, now.v, ahead)
        if holds_in_band(scene.law):
            # A step may end in the dead band.
            jumped = jumped | (stiction_band(scene.law) == 0.0)
            rest, edge = rest & jumped, edge & jumped
        if any_of(edge):
            friction_slope = _steeper(friction_slope, select(rest, scale * at_rest, 0.0))
            friction_slope = _steeper(friction_slope, select(edge, scale * at_edge, 0.0))
    # The body swings even without friction; with friction, its speed changes the load of the contacts.
    return larger_eigenvalue(most, friction_slope + now.by_velocity, -now.by_place)


@inlined
def _steeper(a, b):
    """The slope with the larger magnitude."""
    return select(abs(b) > abs(a), b, a)


@constant_step.margin.implements(Ring, BristleRing, Belt, BristleBelt)
def _margin(scene, before, now):
    first = min(before.normal_1, now.normal_1) - 0.25 * abs(now.normal_1 - before.normal_1)
    second = min(before.normal_2, now.normal_2) - 0.25 * abs(now.normal_2 - before.normal_2)
    return ring.if_load_varies(scene.body, min(first, second), inf)


@constant_step.fall_rate.implements(Ring, BristleRing, Belt, BristleBelt)
def _fall_rate(scene, before, now, h):
    first = before.normal_1 - now.normal_1 if now.normal_1 <= 0.0 else 0.0
    second = before.normal_2 - now.normal_2 if now.normal_2 <= 0.0 else 0.0
    return max(first, second) / h


@constant_step.sticks.implements(Ring, Belt)
def _sticks(scene, before, now):
    # The step lies in the stiction band or jumps over it.
    return (abs(before.v) < stiction_band(scene.law)) | (before.v * now.v < 0.0)
