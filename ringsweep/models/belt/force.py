"""Friction force on the belt, from a law of the sliding velocity alone."""

from __future__ import annotations

from ringsweep.compile import inlined
from ringsweep.physics.friction.velocity import (
    BAND,
    constant_weights,
    stiction_band,
    weights,
)


@inlined
def holds_in_band(law):
    """Whether a contact in the band of the law is held by whatever force it takes, as at rest or in a dead band."""
    return constant_weights(law, BAND)


@inlined
def _bound(scene):
    """Force up to which a stuck contact holds, N."""
    return scene.mu_s * scene.mass * scene.gravity


@inlined
def friction_force(scene, x, v):
    """Friction force, N, and its derivative by the sliding velocity, N s/m."""
    if holds_in_band(scene.law) and abs(v) < stiction_band(scene.law):
        return max(-_bound(scene), min(_bound(scene), -scene.stiffness * x)), 0.0
    w_s, w_k, dw_s, dw_k = weights(scene.law, abs(v))
    load = scene.mass * scene.gravity
    sign = 1.0 if v > 0.0 else -1.0 if v < 0.0 else 0.0
    return (
        sign * load * (w_s * scene.mu_s + w_k * scene.mu_k) + scene.viscous * v,
        load * (dw_s * scene.mu_s + dw_k * scene.mu_k) + scene.viscous,
    )


@inlined
def length_scale(scene, velocity):
    """A length to measure errors by, m."""
    push = scene.mu_s * scene.gravity * scene.mass
    if scene.stiffness > 0.0:
        return velocity * (scene.mass / scene.stiffness) ** 0.5 + push / scene.stiffness + 1e-300
    return velocity + push / scene.mass + 1e-300
