"""The ring for steps of constant length: rates, reactions, and what ends a run. The state is ``(phi, omega)``."""

from __future__ import annotations

from math import inf, isfinite, isnan
from typing import NamedTuple

from ringsweep.compile import absorbed, inlined
from ringsweep.models.interface import constant_step
from ringsweep.models.interface.shock import Unlocated
from ringsweep.models.interface.status import BROKEN, JAM, RUNNING
from ringsweep.models.parts import exceeds, larger_eigenvalue
from ringsweep.models.ring.contacts import zones_at
from ringsweep.models.ring.record import ENDS
from ringsweep.numerics.functions import any_of, select, sine_cosine, sine_cosine_carried, sine_cosine_near
from ringsweep.physics import contact, ring, zones
from ringsweep.physics.friction.velocity import passes_band, steepest, stiction_band


class Inspection(NamedTuple):
    """Inspection of a state of the ring.

    Attributes
    ----------
    rates : tuple of float
        Angular velocity and angular acceleration of the body.
    v : float
        Sliding velocity, m/s.
    normal_1, normal_2 : float
        Normal reactions, N.
    determinant : float
        Determinant of the balances, kg m^2; the body jams where it is not positive.
    slope : float
        Derivative of the angular acceleration by the angular velocity through the friction coefficients, 1/s.
    by_phi, by_omega : float
        Derivatives of the angular acceleration by angle and angular velocity at constant friction coefficients.
    phi, sin_phi, cos_phi, omega : float
        Angle, its sine and cosine, and angular velocity of the body.
    """

    rates: tuple[float, float]
    v: float
    normal_1: float
    normal_2: float
    determinant: float
    slope: float
    by_phi: float
    by_omega: float
    phi: float
    sin_phi: float
    cos_phi: float
    omega: float


@constant_step.initial_state.implements(ring.Ring)
def _initial_state(scene):
    return scene.initial_phi, scene.initial_omega


@constant_step.rates.implements(ring.Ring)
def _rates(scene, now, y, forcing):
    phi, omega = y
    _, K1, K2, _, _ = ring.friction(scene, phi, omega, forcing[0], forcing[1])
    sin_phi, cos_phi = sine_cosine_near(phi, now.phi, now.sin_phi, now.cos_phi)
    return omega, ring.acceleration(scene.body, K1, K2, sin_phi, cos_phi, omega)[0]


@constant_step.inspect.implements(ring.Ring)
def _inspect(scene, y, forcing):
    return _inspection(scene, y, forcing, sine_cosine(y[0]))


@constant_step.inspect_next.implements(ring.Ring)
def _inspect_next(scene, before, y, forcing, afresh):
    at = sine_cosine_carried(y[0], before.phi, before.sin_phi, before.cos_phi, afresh)
    return _inspection(scene, y, forcing, at)


@absorbed
def _inspection(scene, y, forcing, at):
    """Inspection of a state, given sine and cosine of the angle."""
    (phi, omega), (sin_phi, cos_phi) = y, at
    v, K1, K2, slope_1, slope_2 = ring.friction(scene, phi, omega, forcing[0], forcing[1])
    epsilon, determinant = ring.acceleration(scene.body, K1, K2, sin_phi, cos_phi, omega)
    normal_1, normal_2 = ring.reactions(scene.body, K1, K2, sin_phi, cos_phi, omega)
    slope = ring.acceleration_slope(scene.body, K1, K2, slope_1, slope_2, sin_phi, cos_phi, omega)
    by_phi, by_omega = ring.acceleration_gradient(scene.body, K1, K2, sin_phi, cos_phi, omega)
    return Inspection(
        (omega, epsilon), v, normal_1, normal_2, determinant, slope, by_phi, by_omega, phi, sin_phi, cos_phi, omega
    )


@constant_step.holds.implements(ring.Ring, ring.BristleRing)
def _holds(scene, now):
    # Comparisons with NaN are false.
    supported = (now.determinant > 0.0) & (now.normal_1 > 0.0) & (now.normal_2 > 0.0)
    return supported & (abs(now.rates[1]) < inf) & (abs(now.omega) < inf)


@constant_step.verdict.implements(ring.Ring, ring.BristleRing)
def _verdict(scene, before, now):
    if not now.determinant > 0.0:
        return (BROKEN if isnan(now.determinant) else JAM), 1.0
    if not (isfinite(now.rates[1]) and isfinite(now.omega)):
        return BROKEN, 1.0
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


@constant_step.eigenvalue.implements(ring.Ring)
def _eigenvalue(scene, before, now, h, most):
    radius = scene.body.radius
    friction_slope = _steeper(before.slope, now.slope)
    # A step that jumps over the band, or over its edge, does not sample the slope there. The slope counts all the same,
    # since just such a step may lead to a wrong regime.
    at_rest, at_edge = steepest(scene.law)
    scale = -radius * ring.friction_gain(scene.body, now.sin_phi, now.cos_phi, now.omega)
    bound = max(abs(at_rest), abs(at_edge)) * abs(scale) + abs(now.by_omega)
    if any_of(exceeds(most, bound, -now.by_phi)):
        # The stages of the step reach about as far as the acceleration at its beginning takes the body.
        ring_gains = (radius * now.omega - now.v) - (radius * before.omega - before.v)
        ahead = before.v + h * radius * before.rates[1] - ring_gains
        rest, edge, _ = passes_band(scene.law, before.v, now.v, ahead)
        if any_of(edge):
            friction_slope = _steeper(friction_slope, select(rest, scale * at_rest, 0.0))
            friction_slope = _steeper(friction_slope, select(edge, scale * at_edge, 0.0))
    # The body swings even without friction; with friction, its speed changes the load of the contacts.
    return larger_eigenvalue(most, friction_slope + now.by_omega, -now.by_phi)


@inlined
def _steeper(a, b):
    """The slope with the larger magnitude."""
    return select(abs(b) > abs(a), b, a)


@constant_step.margin.implements(ring.Ring, ring.BristleRing)
def _margin(scene, before, now):
    first = min(before.normal_1, now.normal_1) - 0.25 * abs(now.normal_1 - before.normal_1)
    second = min(before.normal_2, now.normal_2) - 0.25 * abs(now.normal_2 - before.normal_2)
    return min(first, second)


@constant_step.arc_share.implements(ring.Ring, ring.BristleRing)
def _arc_share(scene, now, h):
    return abs(now.v) * (h / (scene.body.radius * zones.narrowest(scene.surface)))


@constant_step.fall_rate.implements(ring.Ring, ring.BristleRing)
def _fall_rate(scene, before, now, h):
    first = before.normal_1 - now.normal_1 if now.normal_1 <= 0.0 else 0.0
    second = before.normal_2 - now.normal_2 if now.normal_2 <= 0.0 else 0.0
    return max(first, second) / h


@constant_step.seen.implements(ring.Ring, ring.BristleRing)
def _seen(scene, y, now):
    return y[0], y[1], now.normal_1, now.normal_2, Unlocated()


@constant_step.sticks.implements(ring.Ring)
def _sticks(scene, before, now):
    # The step lies in the stiction band or jumps over it.
    return (abs(before.v) < stiction_band(scene.law)) | (before.v * now.v < 0.0)


@constant_step.row.implements(ring.Ring)
def _row(scene, y, forcing):
    now = constant_step.inspect(scene, y, forcing)
    band = stiction_band(scene.law)
    mode = 0.0 if abs(now.v) < band or now.v == 0.0 else 1.0 if now.v > 0.0 else -1.0
    zone_1, zone_2 = zones_at(scene, y[0] - forcing[0])
    return y[0], y[1], now.rates[1], now.normal_1, now.normal_2, forcing[1], zone_1, zone_2, mode
