"""What ends a step of constant length on a ring or a belt, and its stiffness.

The inspections of both have the fields that are used here. A belt is kinematically a ring of radius 1.
"""

from __future__ import annotations

from math import inf, isfinite, isnan

from ringsweep.compile import inlined
from ringsweep.models.interface import constant_step
from ringsweep.models.interface.status import BROKEN, JAM, RUNNING
from ringsweep.models.parts import exceeds, larger_eigenvalue
from ringsweep.models.ring.record import ENDS
from ringsweep.numerics.functions import any_of, select
from ringsweep.physics import contact, ring
from ringsweep.physics.belt import Belt, BristleBelt
from ringsweep.physics.friction.registry import holds_in_band
from ringsweep.physics.friction.velocity import passes_band, steepest, stiction_band
from ringsweep.physics.ring import BristleRing, Ring


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
    scale = -radius * ring.friction_gain(scene.body, *now.at)
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
