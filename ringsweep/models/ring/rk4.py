"""The ring for steps of constant length: rates, reactions, and what ends a run. The state is ``(phi, omega)``."""

from __future__ import annotations

from typing import NamedTuple

from ringsweep.compile import absorbed
from ringsweep.models.interface import constant_step
from ringsweep.models.interface.shock import Unlocated
from ringsweep.models.ring.contacts import zones_at
from ringsweep.numerics.functions import sine_cosine, sine_cosine_carried, sine_cosine_near
from ringsweep.physics import ring, zones
from ringsweep.physics.friction.velocity import stiction_band


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
    by_place, by_velocity : float
        Derivatives of the angular acceleration by angle and angular velocity at constant friction coefficients.
    phi : float
        Angle of the body.
    motion : tuple of float
        Sine and cosine of the angle, and angular velocity of the body.
    """

    rates: tuple[float, float]
    v: float
    normal_1: float
    normal_2: float
    determinant: float
    slope: float
    by_place: float
    by_velocity: float
    phi: float
    motion: tuple[float, float, float]


@constant_step.initial_state.implements(ring.Ring)
def _initial_state(scene):
    return scene.initial_phi, scene.initial_omega


@constant_step.rates.implements(ring.Ring)
def _rates(scene, now, y, forcing):
    phi, omega = y
    _, K1, K2, _, _ = ring.friction(scene, phi, omega, forcing[0], forcing[1])
    sin_phi, cos_phi = sine_cosine_near(phi, now.phi, now.motion[0], now.motion[1])
    return omega, ring.acceleration(scene.body, K1, K2, (sin_phi, cos_phi, omega))[0]


@constant_step.inspect.implements(ring.Ring)
def _inspect(scene, y, forcing):
    return _inspection(scene, y, forcing, sine_cosine(y[0]))


@constant_step.inspect_next.implements(ring.Ring)
def _inspect_next(scene, before, y, forcing, afresh):
    carried = sine_cosine_carried(y[0], before.phi, before.motion[0], before.motion[1], afresh)
    return _inspection(scene, y, forcing, carried)


@absorbed
def _inspection(scene, y, forcing, sine_and_cosine):
    """Inspection of a state, given sine and cosine of the angle."""
    (phi, omega), motion = y, (*sine_and_cosine, y[1])
    v, K1, K2, slope_1, slope_2 = ring.friction(scene, phi, omega, forcing[0], forcing[1])
    epsilon, determinant = ring.acceleration(scene.body, K1, K2, motion)
    normal_1, normal_2 = ring.reactions(scene.body, K1, K2, motion)
    slope = ring.acceleration_slope(scene.body, K1, K2, slope_1, slope_2, motion)
    by_phi, by_omega = ring.acceleration_gradient(scene.body, K1, K2, motion)
    return Inspection((omega, epsilon), v, normal_1, normal_2, determinant, slope, by_phi, by_omega, phi, motion)


@constant_step.arc_share.implements(ring.Ring, ring.BristleRing)
def _arc_share(scene, now, h):
    return abs(now.v) * (h / (scene.body.radius * zones.narrowest(scene.surface)))


@constant_step.seen.implements(ring.Ring, ring.BristleRing)
def _seen(scene, y, now):
    return y[0], y[1], now.normal_1, now.normal_2, Unlocated()


@constant_step.row.implements(ring.Ring)
def _row(scene, y, forcing):
    now = constant_step.inspect(scene, y, forcing)
    band = stiction_band(scene.law)
    mode = 0.0 if abs(now.v) < band or now.v == 0.0 else 1.0 if now.v > 0.0 else -1.0
    zone_1, zone_2 = zones_at(scene, y[0] - forcing[0])
    return y[0], y[1], now.rates[1], now.normal_1, now.normal_2, forcing[1], zone_1, zone_2, mode
