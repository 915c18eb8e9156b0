"""The ring for steps of constant length: rates, reactions, and what ends a run; for one run or several side by side."""

from __future__ import annotations

from math import inf, isfinite, isnan
from typing import NamedTuple

from ringsweep.compile import inlined
from ringsweep.models.interface import constant_step
from ringsweep.models.interface.status import BROKEN, JAM, RUNNING
from ringsweep.models.parts import largest_eigenvalue
from ringsweep.models.ring.contacts import zones_at
from ringsweep.models.ring.record import ENDS
from ringsweep.numerics.functions import any_of, select, sine_cosine, sine_cosine_near
from ringsweep.numerics.memory import Several
from ringsweep.physics import contact, ring, zones
from ringsweep.physics.friction.velocity import passes_band, steepest, stiction_band


class Inspection(NamedTuple):
    """A state of the ring seen from within: what a step needs and what ends a run.

    ``slope`` is how the acceleration depends on the angular velocity by way of the friction coefficients; ``by_phi``
    and ``by_omega`` how it depends on angle and angular velocity with these held.
    """

    rates: tuple[float, float]
    v: float
    normal_1: float
    normal_2: float
    D: float
    inertia: float
    slope: float
    by_phi: float
    by_omega: float
    phi: float
    sin_phi: float
    cos_phi: float
    omega: float


@constant_step.side_by_side.implements(ring.Ring)
def _lanes(scene):
    return Several()


@constant_step.initial_state.implements(ring.Ring)
def _launch(scene):
    return scene.initial_phi, scene.initial_omega


@constant_step.rates.implements(ring.Ring)
def _rates(scene, now, y, drive_at, drive_rate):
    phi, omega = y
    _, K1, K2, _, _ = ring.friction(scene, phi, omega, drive_at, drive_rate)
    sin_phi, cos_phi = sine_cosine_near(phi, now.phi, now.sin_phi, now.cos_phi)
    return omega, ring.acceleration(scene.body, K1, K2, sin_phi, cos_phi, omega)[0]


@constant_step.inspect.implements(ring.Ring)
def _inspect(scene, y, drive_at, drive_rate):
    phi, omega = y
    v, K1, K2, slope_1, slope_2 = ring.friction(scene, phi, omega, drive_at, drive_rate)
    sin_phi, cos_phi = sine_cosine(phi)
    epsilon, D, inertia = ring.acceleration(scene.body, K1, K2, sin_phi, cos_phi, omega)
    normal_1, normal_2 = ring.reactions(scene.body, K1, K2, sin_phi, cos_phi, omega, epsilon)
    slope = ring.acceleration_slope(scene.body, K1, K2, slope_1, slope_2, sin_phi, cos_phi, omega)
    by_phi, by_omega = ring.acceleration_gradient(scene.body, K1, K2, sin_phi, cos_phi, omega)
    return Inspection(
        (omega, epsilon), v, normal_1, normal_2, D, inertia, slope, by_phi, by_omega, phi, sin_phi, cos_phi, omega
    )


@constant_step.holds.implements(ring.Ring, ring.BristleRing)
def _holds(scene, now):
    # Of a NaN every comparison is false.
    supported = (now.D > 0.0) & (now.inertia > 0.0) & (now.normal_1 > 0.0) & (now.normal_2 > 0.0)
    return supported & (abs(now.rates[1]) < inf) & (abs(now.omega) < inf)


@constant_step.verdict.implements(ring.Ring, ring.BristleRing)
def _verdict(scene, before, now):
    if not (now.D > 0.0 and now.inertia > 0.0):
        return (BROKEN if isnan(now.inertia) else JAM), 1.0
    if not (isfinite(now.rates[1]) and isfinite(now.omega)):
        return BROKEN, 1.0
    first, second = _zero(before.normal_1, now.normal_1), _zero(before.normal_2, now.normal_2)
    fraction = min(first, second)
    if fraction > 1.0:
        return RUNNING, 1.0
    return ENDS[contact.lost(scene.body, first == fraction, second == fraction)], fraction


@inlined
def _zero(before, now):
    """Where a straight line from `before` to `now` vanishes, as a fraction of the way; 2 if it does not."""
    if now > 0.0:
        return 2.0
    return before / (before - now) if before > now else 0.0


@constant_step.stiffness.implements(ring.Ring)
def _stiffness(scene, before, now, h):
    # The stages reach about as far as the acceleration at the beginning takes the body in one step.
    radius = scene.body.radius
    ring_gains = (radius * now.omega - now.v) - (radius * before.omega - before.v)
    ahead = before.v + h * radius * before.rates[1] - ring_gains
    band = stiction_band(scene.law)
    friction = _steeper(before.slope, now.slope)
    # A step that jumps the band, or its edge, never samples the slope there, and is the one that is
    # wrong in kind: it has met it all the same.
    low, high = min(min(before.v, now.v), ahead), max(max(before.v, now.v), ahead)
    if any_of((low <= band) & (high >= -band)):
        rest, edge, _ = passes_band(scene.law, before.v, now.v, ahead)
        mu_s, mu_k = zones.roughest(scene.surface)
        (rest_s, rest_k), (edge_s, edge_k) = steepest(scene.law)
        scale = -radius * ring.friction_gain(scene.body, now.cos_phi, now.omega)
        friction = _steeper(friction, select(rest, scale * (rest_s * mu_s + rest_k * mu_k), 0.0))
        friction = _steeper(friction, select(edge, scale * (edge_s * mu_s + edge_k * mu_k), 0.0))
    # Even without friction the body swings, and under friction its speed loads the contacts.
    return largest_eigenvalue(friction + now.by_omega, -now.by_phi) * h


@inlined
def _steeper(a, b):
    """The one of two slopes that is the larger in magnitude."""
    return select(abs(b) > abs(a), b, a)


@constant_step.margin.implements(ring.Ring, ring.BristleRing)
def _slack(scene, before, now):
    first = min(before.normal_1, now.normal_1) - 0.25 * abs(now.normal_1 - before.normal_1)
    second = min(before.normal_2, now.normal_2) - 0.25 * abs(now.normal_2 - before.normal_2)
    return min(first, second)


@constant_step.arc_share.implements(ring.Ring, ring.BristleRing)
def _stride(scene, now, h):
    return abs(now.v) * h / (scene.body.radius * zones.narrowest(scene.surface))


@constant_step.fall_rate.implements(ring.Ring, ring.BristleRing)
def _falls(scene, before, now, h):
    first = before.normal_1 - now.normal_1 if now.normal_1 <= 0.0 else 0.0
    second = before.normal_2 - now.normal_2 if now.normal_2 <= 0.0 else 0.0
    return max(first, second) / h


@constant_step.seen.implements(ring.Ring, ring.BristleRing)
def _seen(scene, y, now):
    return y[0], y[1], now.normal_1, now.normal_2


@constant_step.sticks.implements(ring.Ring)
def _sticks(scene, before, now):
    # Whether the step lay in the stiction band or jumped across it.
    return (abs(before.v) < stiction_band(scene.law)) | (before.v * now.v < 0.0)


@constant_step.row.implements(ring.Ring)
def _describe(scene, y, drive_at, drive_rate):
    now = constant_step.inspect(scene, y, drive_at, drive_rate)
    band = stiction_band(scene.law)
    mode = 0.0 if abs(now.v) < band or now.v == 0.0 else 1.0 if now.v > 0.0 else -1.0
    zone_1, zone_2 = zones_at(scene, y[0] - drive_at)
    return y[0], y[1], now.rates[1], now.normal_1, now.normal_2, drive_rate, zone_1, zone_2, mode
