"""Friction force on the belt, for laws of the sliding velocity alone."""

from __future__ import annotations

from ringsweep.compile import absorbed, hook, inlined
from ringsweep.numerics.functions import opposing, select
from ringsweep.physics.friction.registry import SetValued, family
from ringsweep.physics.friction.velocity import friction_at, stiction_band


@hook(optional=True)
def _is_set_valued(family):
    return False


@_is_set_valued.implements(SetValued)
def _set_valued(family):
    return True


@inlined
def holds_in_band(law):
    """Whether friction in the band of the law takes any value up to the breakaway force, as in a dead band."""
    return _is_set_valued(family(law))


@inlined
def breakaway_force(scene):
    """Largest friction force of a stuck contact, N."""
    return scene.mu_s * scene.mass * scene.gravity


@absorbed
def friction_force(scene, x, v):
    """Friction force (N) at the displacement `x` and the sliding velocity `v`, and its derivative by `v` (N s/m)."""
    mu, mu_slope = friction_at(scene.law, abs(v), (scene.mu_s, scene.mu_k))
    load = scene.mass * scene.gravity
    force = scene.viscous * v - opposing(load * mu, v)
    slope = load * mu_slope + scene.viscous
    if holds_in_band(scene.law):
        held, bound = abs(v) < stiction_band(scene.law), breakaway_force(scene)
        force = select(held, max(-bound, min(bound, -scene.stiffness * x)), force)
        slope = select(held, 0.0, slope)
    return force, slope


@absorbed
def acceleration(scene, x, force):
    """Acceleration of the body in space at the displacement `x` under a friction force, m/s^2."""
    per_mass = 1.0 / scene.mass
    return -(scene.stiffness * per_mass) * x - force * per_mass


@inlined
def length_scale(scene, velocity):
    """Length in units of which errors are measured, m, for a body with this velocity (m/s)."""
    load = scene.mu_s * scene.gravity * scene.mass
    if scene.stiffness > 0.0:
        return velocity * (scene.mass / scene.stiffness) ** 0.5 + load / scene.stiffness + 1e-300
    return velocity + load / scene.mass + 1e-300
