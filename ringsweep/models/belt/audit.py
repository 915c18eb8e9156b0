"""Audit of runs on the belt: violations of the friction law and of the balance of momentum."""

from __future__ import annotations

from math import inf

from ringsweep.models.belt.bristles import contact_force
from ringsweep.models.belt.force import friction_force, holds_in_band, length_scale
from ringsweep.models.interface import audit, implicit
from ringsweep.physics.belt import Belt, BristleBelt
from ringsweep.physics.friction.velocity import stiction_band

# Rounding of an acceleration, as a share of its largest terms.
_ROUNDING = 1e-12


@audit.violation.implements(Belt)
def _violation(scene, mode, forcing, y, rates, s, tolerance):
    x, v = y
    _, belt_velocity, belt_acceleration = forcing
    stiffness_per_mass, load = scene.stiffness / scene.mass, scene.mass * scene.gravity
    length = abs(x) + length_scale(scene, abs(v + belt_velocity) + abs(belt_velocity))
    speed = length * (stiffness_per_mass**0.5 if stiffness_per_mass > 0.0 else 1.0)
    # In a dead band the sliding velocity need not have the direction of the force.
    in_dead_band, largest, relaxation = holds_in_band(scene.law) and mode.region < 0, 0.0, 0.0
    if mode.sign == 0:
        friction = -scene.stiffness * x - scene.mass * belt_acceleration
        allowed = tolerance * (load + scene.stiffness * length + scene.mass * abs(belt_acceleration)) + 1e-300
        largest = (abs(friction) - scene.mu_s * load) / allowed
    else:
        friction, slope = friction_force(scene, x, v)
        relaxation = abs(slope) / scene.mass
        if not in_dead_band:
            if mode.region < 0:
                speed = min(speed, 1e3 * stiction_band(scene.law))
            largest = -mode.sign * v / (tolerance * speed)
    terms = stiffness_per_mass * abs(x) + abs(friction) / scene.mass + abs(belt_acceleration)
    imbalance = abs(-stiffness_per_mass * x - friction / scene.mass - belt_acceleration - rates[1])
    imbalance = imbalance / ((1.0 / s + relaxation) * tolerance * speed + _ROUNDING * terms)
    return (max(largest, imbalance) if largest + imbalance < inf else inf), -friction * (v + belt_velocity)


@audit.energy.implements(Belt, BristleBelt)
def _energy(scene, forcing, y):
    x, velocity = y[0], y[1] + forcing[1]
    return 0.5 * (scene.mass * velocity * velocity + scene.stiffness * x * x)


@audit.violation.implements(BristleBelt)
def _bristle_violation(scene, mode, forcing, y, rates, s, tolerance):
    x, v, z = y
    _, belt_velocity, belt_acceleration = forcing
    rate, rate_v, rate_z, friction, by_v, by_z = contact_force(scene, v, z, 1.0 if v >= 0.0 else -1.0, mode.region)
    _, speed, deflection, _ = implicit.error_scales(scene, implicit.IMPLICIT_TOLERANCE * tolerance, y)
    stiffness_per_mass = scene.stiffness / scene.mass
    terms = stiffness_per_mass * abs(x) + abs(friction) / scene.mass + abs(belt_acceleration)
    allowed = speed / s + (abs(by_v) * speed + abs(by_z) * deflection) / scene.mass + _ROUNDING * terms
    imbalance = abs(-stiffness_per_mass * x - friction / scene.mass - belt_acceleration - rates[1]) / allowed
    allowed = (1.0 / s + abs(rate_z)) * deflection + abs(rate_v) * speed + _ROUNDING * abs(v)
    imbalance = max(imbalance, abs(rate - rates[2]) / allowed)
    return (max(-mode.sign * v / speed, imbalance) if imbalance < inf else inf), -friction * (v + belt_velocity)
