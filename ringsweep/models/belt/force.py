"""Friction force on the belt, for laws of the sliding velocity alone."""

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
    """Whether friction in the band of the law takes any value up to the breakaway force, as in a dead band."""
    return constant_weights(law, BAND)


@inlined
def breakaway_force(scene):
    """Largest friction force of a stuck contact, N."""
    return scene.mu_s * scene.mass * scene.gravity


@inlined
def friction_force(scene, x, v):
    """Friction force (N) at the displacement `x` and the sliding velocity `v`, and its derivative by `v` (N s/m)."""
    if holds_in_band(scene.law) and abs(v) < stiction_band(scene.law):
        return max(-breakaway_force(scene), min(breakaway_force(scene), -scene.stiffness * x)), 0.0
    w_s, w_k, dw_s, dw_k = weights(scene.law, abs(v))
    load = scene.mass * scene.gravity
    sign = 1.0 if v > 0.0 else -1.0 if v < 0.0 else 0.0
    return (
        sign * load * (w_s * scene.mu_s + w_k * scene.mu_k) + scene.viscous * v,
        load * (dw_s * scene.mu_s + dw_k * scene.mu_k) + scene.viscous,
    )


@inlined
def length_scale(scene, velocity):
    """Length in units of which errors are measured, m, for a body with this velocity (m/s)."""
    load = scene.mu_s * scene.gravity * scene.mass
    if scene.stiffness > 0.0:
        return velocity * (scene.mass / scene.stiffness) ** 0.5 + load / scene.stiffness + 1e-300
    return velocity + load / scene.mass + 1e-300
