"""Implicit steps on the ring, in the stiction band of a smooth law, where the body creeps on a slow manifold.

The state is ``(rho, v)``: angle in the ring's frame and sliding velocity. So no state is the difference of two large
numbers, however slow the creep.
"""

from __future__ import annotations

from math import cos, sin, sqrt

from ringsweep.compile import inlined
from ringsweep.models.interface import implicit
from ringsweep.models.ring.contacts import coefficients_under, edges_ahead, zones_under
from ringsweep.physics import drives, ring
from ringsweep.physics.friction.velocity import stiction_band, weights_in

#: Indices of the guards, in the order of the rows of the series.
INERTIA, SLOW, NORMAL_1, NORMAL_2, EDGE, FAST = range(6)


@inlined
def _friction(scene, mode, v):
    """K at contacts 1 and 2, and their derivatives by the angular velocity, in the segments of the mode."""
    mu_s1, mu_k1, mu_s2, mu_k2 = coefficients_under(scene, mode)
    sign = 1.0 if v >= 0.0 else -1.0
    w_s, w_k, dw_s, dw_k = weights_in(scene.law, mode.region, abs(v))
    radius = scene.body.radius
    return (
        -sign * (w_s * mu_s1 + w_k * mu_k1),
        -sign * (w_s * mu_s2 + w_k * mu_k2),
        -radius * (dw_s * mu_s1 + dw_k * mu_k1),
        -radius * (dw_s * mu_s2 + dw_k * mu_k2),
    )


# The place is relative to the drive, so that no large numbers cancel in slow creep.
@implicit.to_implicit.implements(ring.Ring)
def _to_implicit(scene, forcing, y):
    return y[0] - forcing[0], y[1]


@implicit.from_implicit.implements(ring.Ring)
def _from_implicit(scene, forcing, x):
    return x[0] + forcing[0], x[1]


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
def _rates(scene, mode, forcing, x):
    radius = scene.body.radius
    theta, ring_omega, ring_epsilon = forcing
    phi, omega = x[0] + theta, x[1] / radius + ring_omega
    K1, K2, _, _ = _friction(scene, mode, x[1])
    epsilon, _, _ = ring.acceleration(scene.body, K1, K2, sin(phi), cos(phi), omega)
    return x[1] / radius, radius * (epsilon - ring_epsilon)


@implicit.linearise.implements(ring.Ring)
def _linearise(scene, mode, t, x):
    b = scene.body
    radius = b.radius
    theta, ring_omega, ring_epsilon = drives.turn(scene.drive, t)
    ring_jerk = drives.jerk(scene.drive, t)
    phi, omega = x[0] + theta, x[1] / radius + ring_omega
    K1, K2, slope_1, slope_2 = _friction(scene, mode, x[1])
    sin_phi, cos_phi = sin(phi), cos(phi)
    epsilon, _, _ = ring.acceleration(b, K1, K2, sin_phi, cos_phi, omega)
    # epsilon = p omega^2 + q cos phi + r sin phi + epsilon_0
    epsilon_0, _, _ = ring.constant_terms(b, K1, K2)
    p, _, _ = ring.acceleration(b, K1, K2, 0.0, 0.0, 1.0)
    by_phi, _, _ = ring.acceleration(b, K1, K2, cos_phi, -sin_phi, 0.0)
    p, by_phi = p - epsilon_0, by_phi - epsilon_0
    by_omega = 2.0 * p * omega
    by_v = ring.acceleration_slope(b, K1, K2, slope_1, slope_2, sin_phi, cos_phi, omega)
    return (
        (x[1] / radius, radius * (epsilon - ring_epsilon)),
        (0.0, 1.0 / radius, radius * by_phi, by_omega + by_v),
        (),
        (0.0, radius * (by_phi * ring_omega + by_omega * ring_epsilon - ring_jerk)),
    )


@implicit.guards_and_motion.implements(ring.Ring)
def _guards_and_motion(scene, mode, t, x):
    theta, ring_omega, _ = drives.turn(scene.drive, t)
    phi, omega = x[0] + theta, x[1] / scene.body.radius + ring_omega
    K1, K2, _, _ = _friction(scene, mode, x[1])
    sin_phi, cos_phi = sin(phi), cos(phi)
    epsilon, determinant, inertia = ring.acceleration(scene.body, K1, K2, sin_phi, cos_phi, omega)
    normal_1, normal_2 = ring.reactions(scene.body, K1, K2, sin_phi, cos_phi, omega, epsilon)
    ahead_1, ahead_2 = edges_ahead(scene, mode, x[0])
    speed = mode.sign * x[1]
    guards = (
        min(determinant, inertia),
        speed,
        normal_1,
        normal_2,
        min(ahead_1, ahead_2),
        stiction_band(scene.law) - speed,
    )
    return guards, (phi, omega, epsilon, ring_omega)


@implicit.near_zero.implements(ring.Ring, ring.BristleRing)
def _near_zero(scene, motion):
    b = scene.body
    _, omega, _, _ = motion
    load = 0.05 * b.mass * (b.gravity + b.radius * omega * omega)
    inertia = 0.02 * ring.reaction_determinant(b) * min(1.0, ring.about_axis(b))
    return inertia, 0.0, load, load, 0.0, 0.0


@implicit.motion.implements(ring.Ring, ring.BristleRing)
def _motion(scene, t, x, linear):
    _, ring_omega, ring_epsilon = drives.turn(scene.drive, t)
    return x[1] / scene.body.radius + ring_omega, linear[0][1] / scene.body.radius + ring_epsilon


@implicit.seen.implements(ring.Ring, ring.BristleRing)
def _seen(scene, view):
    guards, (phi, omega, _, _) = view
    return phi, omega, guards[NORMAL_1], guards[NORMAL_2]


@implicit.row.implements(ring.Ring)
def _row(scene, mode, t, x):
    guards, (phi, omega, epsilon, ring_omega) = implicit.guards_and_motion(scene, mode, t, x)
    zone_1, zone_2 = zones_under(scene, mode)
    return phi, omega, epsilon, guards[NORMAL_1], guards[NORMAL_2], ring_omega, zone_1, zone_2, 0.0
