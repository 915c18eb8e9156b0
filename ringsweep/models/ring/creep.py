"""Implicit steps on the ring, in the stiction band of a smooth law, where the body creeps on a slow manifold.

The state is ``(rho, v)``: angle in the ring's frame and sliding velocity. So no state is the difference of two large
numbers, however slow the creep.
"""

from __future__ import annotations

from math import cos, sin, sqrt
from typing import NamedTuple

from ringsweep.compile import inlined
from ringsweep.models.interface import implicit
from ringsweep.models.interface.shock import Located
from ringsweep.models.ring.contacts import coefficients_under, edges_ahead, zones_under
from ringsweep.numerics.functions import ROTATED, rotated, sine_cosine_from
from ringsweep.physics import drives, ring
from ringsweep.physics.friction.velocity import friction_in, region_bounds, stiction_band

#: Indices of the guards, in the order of the rows of the series.
DETERMINANT, SLOW, NORMAL_1, NORMAL_2, EDGE, FAST = range(6)


class Common(NamedTuple):
    """What the equations have in common within a step.

    Attributes
    ----------
    rho, phi, sin_phi, cos_phi : float
        Angle of the body at the beginning, in the ring's frame and in space, rad; sine and cosine of the latter.
    per_radius : float
        Reciprocal of the radius of the ring, 1/m.
    surfaces : tuple of float
        Coefficients of the surfaces under contacts 1 and 2.
    """

    rho: float
    phi: float
    sin_phi: float
    cos_phi: float
    per_radius: float
    surfaces: tuple[float, float, float, float]


@implicit.common.implements(ring.Ring)
def _common(scene, mode, forcing, x):
    phi = x[0] + forcing[0]
    return Common(x[0], phi, sin(phi), cos(phi), 1.0 / scene.body.radius, coefficients_under(scene, mode))


@inlined
def _friction(scene, mode, common, v):
    """K at contacts 1 and 2, and their derivatives by the sliding velocity (s/m), in the segments of the mode."""
    sign = 1.0 if v >= 0.0 else -1.0
    mu_1, mu_2, slope_1, slope_2 = friction_in(scene.law, mode.region, abs(v), common.surfaces)
    return -sign * mu_1, -sign * mu_2, -slope_1, -slope_2


@inlined
def _in_space(common, forcing, x):
    """Angle of the body in space, and its motion: sine and cosine of the angle, and angular velocity."""
    phi, omega = x[0] + forcing[0], x[1] * common.per_radius + forcing[1]
    # The drive turns the body by more than it creeps. A stage depends on the stage before by the creep alone, so the
    # processor can compute this turn ahead.
    sin_phi, cos_phi = sine_cosine_from(common.rho + forcing[0], common.phi, common.sin_phi, common.cos_phi)
    crept = x[0] - common.rho
    if not abs(crept) < ROTATED:
        return phi, (sin(phi), cos(phi), omega)
    sin_phi, cos_phi = rotated(sin_phi, cos_phi, crept)
    return phi, (sin_phi, cos_phi, omega)


@implicit.is_stiff.implements(ring.Ring)
def _is_stiff(scene, mode, y, linear):
    (_, acceleration), (_, _, _, decay), _, _ = linear
    # The decay must be fast compared with the motion of the body. And the transient must be over: transients into the
    # band, and out of it at its top, are as fast as the decay itself.
    natural_frequency = sqrt(scene.body.gravity / scene.body.radius) + abs(y[1]) / scene.body.radius
    return -decay > 50.0 * natural_frequency and abs(acceleration) < 0.01 * -decay * stiction_band(scene.law)


@implicit.error_scales.implements(ring.Ring)
def _error_scales(scene, tolerance, x):
    return tolerance, tolerance * stiction_band(scene.law) * ring.reaction_determinant(scene.body)


@implicit.rates.implements(ring.Ring)
def _rates(scene, mode, common, forcing, x):
    radius = scene.body.radius
    _, motion = _in_space(common, forcing, x)
    K1, K2, _, _ = _friction(scene, mode, common, x[1])
    epsilon, _ = ring.acceleration(scene.body, K1, K2, motion)
    return x[1] * common.per_radius, radius * (epsilon - forcing[2])


@implicit.linearise.implements(ring.Ring)
def _linearise(scene, mode, common, t, forcing, x):
    b = scene.body
    radius = b.radius
    _, ring_omega, ring_epsilon = forcing
    _, motion = _in_space(common, forcing, x)
    K1, K2, slope_1, slope_2 = _friction(scene, mode, common, x[1])
    epsilon, _ = ring.acceleration(b, K1, K2, motion)
    by_phi, by_omega = ring.acceleration_gradient(b, K1, K2, motion)
    by_v = ring.acceleration_slope(b, K1, K2, slope_1, slope_2, motion)
    jerk = drives.jerk(scene.drive, t)
    return (
        (x[1] * common.per_radius, radius * (epsilon - ring_epsilon)),
        (0.0, common.per_radius, radius * by_phi, by_omega + radius * by_v),
        (),
        (0.0, radius * (by_phi * ring_omega + by_omega * ring_epsilon - jerk)),
    )


@implicit.guards_and_motion.implements(ring.Ring)
def _guards_and_motion(scene, mode, common, forcing, x):
    phi, motion = _in_space(common, forcing, x)
    K1, K2, _, _ = _friction(scene, mode, common, x[1])
    epsilon, determinant = ring.acceleration(scene.body, K1, K2, motion)
    normal_1, normal_2 = ring.reactions(scene.body, K1, K2, motion)
    ahead_1, ahead_2 = edges_ahead(scene, mode, x[0])
    low, high = region_bounds(scene.law, mode.region)
    speed = mode.sign * x[1]
    guards = (
        determinant,
        speed - low,
        normal_1,
        normal_2,
        min(ahead_1, ahead_2),
        high - speed,
    )
    return guards, (phi, motion[2], epsilon, forcing[1])


@implicit.near_zero.implements(ring.Ring, ring.BristleRing)
def _near_zero(scene, motion):
    b = scene.body
    omega = motion[1]
    load = 0.05 * b.mass * (b.gravity + b.radius * omega * omega)
    return 0.02 * ring.free_determinant(b), 0.0, load, load, 0.0, 0.0


@implicit.seen.implements(ring.Ring)
def _seen(scene, view):
    guards, (phi, omega, epsilon, _) = view
    size = scene.body.gravity / scene.body.radius + omega * omega + abs(epsilon)
    return phi, omega, guards[NORMAL_1], guards[NORMAL_2], Located(epsilon, size)


@implicit.row.implements(ring.Ring)
def _row(scene, mode, forcing, x):
    common = implicit.common(scene, mode, forcing, x)
    guards, (phi, omega, epsilon, ring_omega) = implicit.guards_and_motion(scene, mode, common, forcing, x)
    zone_1, zone_2 = zones_under(scene, mode)
    return phi, omega, epsilon, guards[NORMAL_1], guards[NORMAL_2], ring_omega, zone_1, zone_2, 0.0
