"""A body that slides, for steps of constant length: rates, reactions, and what ends a run.

They are the same on the ring and on the belt, with bristles and without. The state is the place and the velocity in
space, and the deflection of each bundle of bristles.

Read :mod:`ringsweep.models.interface.constant_step` first. `before` and `now` are an :class:`Inspection` each, at
both ends of a step of length `h`. All numbers may be vector lanes.
"""

from __future__ import annotations

from math import inf, isfinite, isnan
from typing import Any, NamedTuple

from ringsweep.compile import absorbed, feature, hook, inlined, replacing, unrolled
from ringsweep.models.interface import constant_step
from ringsweep.models.interface.status import BROKEN, JAM, RUNNING
from ringsweep.models.parts import exceeds, larger_eigenvalue
from ringsweep.models.sliding import ENDS
from ringsweep.models.slip import by_deflections, deflection_rates
from ringsweep.numerics.functions import any_of, select
from ringsweep.numerics.terms import joined
from ringsweep.physics import contact, ring
from ringsweep.physics.belt import Belt, BristleBelt, laden
from ringsweep.physics.friction.registry import holds_in_band
from ringsweep.physics.friction.velocity import passes_band, steepest, stiction_band
from ringsweep.physics.ring import BristleRing, Ring


class Inspection(NamedTuple):
    """Inspection of a state.

    Attributes
    ----------
    rates : tuple of float
        Time derivative of the state.
    v : float
        Sliding velocity, m/s.
    place : float
        Angle of the body, rad, or its displacement relative to the belt, m.
    motion : tuple of float
        As for :func:`ringsweep.physics.ring.acceleration`.
    normal_1, normal_2 : float
        Normal reactions, N.
    determinant : float
        Determinant of the balances; the body jams where it is not positive.
    friction : float
        Friction at contact 1, N, with viscous friction.
    slope : float
        Derivative of the acceleration by the velocity through the friction coefficients, 1/s.
    by_place, by_velocity : float
        Derivatives of the acceleration by place and velocity at constant friction coefficients, 1/s^2 and 1/s.
    creep : tuple of float
        Trace, 1/s, and determinant, 1/s^2, of the linearised equations of sliding with its bristles; empty without
        bristles.
    stuck : float
        1 if a body on bristles counts as stuck, else 0; an empty tuple without bristles.
    """

    rates: Any
    v: float
    place: float
    motion: tuple[float, float, float]
    normal_1: float
    normal_2: float
    determinant: float
    friction: float
    slope: float
    by_place: float
    by_velocity: float
    creep: Any
    stuck: Any


@hook(absorb=True)
def slip_in_space(scene, y, v, forcing, angle):
    """The :class:`ringsweep.models.slip.Slip` of a state, and whether it counts as stuck, as for :class:`Inspection`.

    Parameters
    ----------
    scene : NamedTuple
        One cell, or several in vector lanes.
    y : tuple of float or Lanes
        State.
    v : float or Lanes
        Sliding velocity, m/s.
    forcing : tuple of float
        Forcing at the time of the state.
    angle : tuple of float or Lanes
        Sine and cosine of the angle of the body; empty on a belt.
    """


@absorbed
def _sliding_velocity(scene, y, forcing):
    """Sliding velocity, m/s, of a state in space."""
    return (y[1] - forcing[1]) * ring.radius(scene.body)


@absorbed
def rates_in_space(scene, y, forcing, angle):
    """Time derivative of a state; the arguments are those of :func:`slip_in_space`."""
    now, _ = slip_in_space(scene, y, _sliding_velocity(scene, y, forcing), forcing, angle)
    scene = laden(scene.drive, scene, forcing)
    acceleration = ring.acceleration(scene.body, *now.K, now.motion)[0]
    return joined((now.motion[2], acceleration), deflection_rates(now.bristles))


@absorbed
def inspection(scene, y, place, forcing, angle):
    """The :class:`Inspection` of a state at a place; the other arguments are those of :func:`slip_in_space`."""
    v = _sliding_velocity(scene, y, forcing)
    now, stuck = slip_in_space(scene, y, v, forcing, angle)
    scene = laden(scene.drive, scene, forcing)
    body = scene.body
    acceleration, determinant = ring.acceleration(body, *now.K, now.motion)
    normal_1, normal_2 = ring.reactions(body, *now.K, now.motion)
    slope = ring.radius(body) * ring.acceleration_slope(body, *now.K, *now.slopes, now.motion)
    gradient = ring.acceleration_gradient(body, *now.K, now.motion)
    return Inspection(
        joined((now.motion[2], acceleration), deflection_rates(now.bristles)),
        v,
        place,
        now.motion,
        normal_1,
        normal_2,
        determinant,
        now.damping * body.mass * v - now.K[0] * normal_1,
        slope,
        gradient[0],
        gradient[1] - now.damping,
        _creep(now.bristles, by_deflections(now.bristles, scene, now), slope),
        stuck,
    )


@unrolled
def _creep(count, bristles, by_z, slope):
    """Field ``creep`` of an :class:`Inspection`; `by_z` are derivatives by the deflections, `slope` that by v."""
    if count == 0:
        return ["return ()"]
    decay = "-bristles[0].rate_z" if count == 1 else "max(-bristles[0].rate_z, -bristles[1].rate_z)"
    coupling = " + ".join(f"abs(by_z[{i}] * bristles[{i}].rate_v)" for i in range(count))
    return [f"decay, coupling = {decay}, {coupling}", "return decay - slope, coupling - decay * slope"]


@constant_step.holds.implements(Ring, BristleRing, Belt, BristleBelt)
def _holds_in_slip(scene, now):
    """Implement :func:`constant_step.holds`: finite, not jammed, and no contact pulls."""
    # Comparisons with NaN are false.
    finite = (abs(now.rates[1]) < inf) & (abs(now.rates[0]) < inf)
    supported = (now.determinant > 0.0) & (now.normal_1 > 0.0) & (now.normal_2 > 0.0)
    return ring.if_load_varies(scene.body, supported & finite, finite)


@constant_step.verdict.implements(Ring, BristleRing, Belt, BristleBelt)
def _verdict_in_slip(scene, before, now):
    """Implement :func:`constant_step.verdict`: jammed, separated where a reaction vanishes, or running."""
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


_with_contacts = replacing("rates", "normal_1", "normal_2", "determinant")


@constant_step.at_once.implements(Ring, BristleRing)
def _at_once_in_slip(scene, y, forcing, now):
    """Implement :func:`constant_step.at_once`; a body that jams has no determinant."""
    if constant_step.holds(scene, now) or not isfinite(now.rates[1]):
        return now
    (K, motion), body = (slip_in_space(scene, y, now.v, forcing, now.motion[:2])[0].K, now.motion), scene.body
    found, closed = contact.sliding(body, *K, motion), (now.normal_1, now.normal_2, now.rates[1])
    normal_1, normal_2, acceleration = contact.opened(body, found, closed, K, (0.0, 0.0), 1, motion, 0.0)
    rates = joined((now.rates[0], acceleration), now.rates[2:])
    return _with_contacts(now, rates, normal_1, normal_2, 0.0 if found == contact.IMPOSSIBLE else 1.0)


@inlined
def _root_fraction(before, now):
    """Fraction of a step at which a value that changes linearly from `before` to `now` is zero; 2 if it is positive."""
    if now > 0.0:
        return 2.0
    return before / (before - now) if before > now else 0.0


@constant_step.eigenvalue.implements(Ring, Belt)
def _eigenvalue_without_bristles(scene, before, now, h, most):
    """Implement :func:`constant_step.eigenvalue`; the slope of friction in a band that a step jumps over counts."""
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
def _margin_in_slip(scene, before, now):
    """Implement :func:`constant_step.margin`: lower bound on both reactions within the step, N."""
    first = min(before.normal_1, now.normal_1) - 0.25 * abs(now.normal_1 - before.normal_1)
    second = min(before.normal_2, now.normal_2) - 0.25 * abs(now.normal_2 - before.normal_2)
    return ring.if_load_varies(scene.body, min(first, second), inf)


@constant_step.fall_rate.implements(Ring, BristleRing, Belt, BristleBelt)
def _fall_rate_in_slip(scene, before, now, h):
    """Implement :func:`constant_step.fall_rate`: of the reaction that vanished, N/s."""
    first = before.normal_1 - now.normal_1 if now.normal_1 <= 0.0 else 0.0
    second = before.normal_2 - now.normal_2 if now.normal_2 <= 0.0 else 0.0
    return max(first, second) / h


@constant_step.sticks.implements(Ring, Belt)
def _sticks_without_bristles(scene, before, now):
    """Implement :func:`constant_step.sticks`: the step lies in the stiction band or jumps over it."""
    # The step lies in the stiction band or jumps over it.
    return (abs(before.v) < stiction_band(scene.law)) | (before.v * now.v < 0.0)


@constant_step.eigenvalue.implements(BristleRing, BristleBelt)
def _eigenvalue_with_bristles(scene, before, now, h, most):
    """Implement :func:`constant_step.eigenvalue`; the first step counts at its beginning too."""
    if any_of(most == 0.0):
        most = _larger_eigenvalue_at(before, most)
    return _larger_eigenvalue_at(now, most)


@absorbed
def _larger_eigenvalue_at(now, most):
    """Largest magnitude of an eigenvalue up to now, 1/s: `most`, or that of an :class:`Inspection` on bristles."""
    # The body swings even where friction is small.
    return larger_eigenvalue(larger_eigenvalue(most, *now.creep), now.by_velocity, -now.by_place)


@constant_step.sticks.implements(BristleRing, BristleBelt)
def _sticks_on_bristles(scene, before, now):
    """Implement :func:`constant_step.sticks`."""
    return before.stuck > 0.0


@feature("abs(now.v) < stiction_band(scene.law)")
def _counts_as_stuck(stuck, scene, now):
    """Whether the body counts as stuck: within the stiction band, or while the guard of the bristles is positive."""
    return stuck > 0.0


@inlined
def word_of_mode(scene, now):
    """Number for the mode of an :class:`Inspection` in a history: 0 in stick, else the sign of the sliding velocity."""
    sticks = _counts_as_stuck(now.stuck, scene, now) or now.v == 0.0
    return 0.0 if sticks else 1.0 if now.v > 0.0 else -1.0
