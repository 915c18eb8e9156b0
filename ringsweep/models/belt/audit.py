"""Whether a run on the belt obeys its law: violations of friction law and balance, from the plain formulas."""

from __future__ import annotations

from math import inf

from ringsweep.models.belt.bristles import contact_force
from ringsweep.models.belt.force import friction_force, holds_in_band, length_scale
from ringsweep.models.interface import audit, implicit
from ringsweep.physics.belt import Belt, BristleBelt
from ringsweep.physics.friction.velocity import BAND, stiction_band

# Rounding of accelerations, as a share of their largest terms.
_ROUNDING = 1e-12

# The tolerance of an implicit step, in units of that of the series.
_IMPLICIT = 1e3


@audit.violation.implements(Belt)
def _breach(scene, mode, force, y, rates, s, tolerance):
    x, v = y
    _, belt_velocity, belt_acceleration = force
    swing, load = scene.stiffness / scene.mass, scene.mass * scene.gravity
    length = abs(x) + length_scale(scene, abs(v + belt_velocity) + abs(belt_velocity))
    speed = length * (swing**0.5 if swing > 0.0 else 1.0)
    # In a dead band the body moves as it came, whichever way it is pulled.
    held, worst, relaxation = holds_in_band(scene.law) and mode.region == BAND, 0.0, 0.0
    if mode.sign == 0:
        drag = -scene.stiffness * x - scene.mass * belt_acceleration
        allowed = tolerance * (load + scene.stiffness * length + scene.mass * abs(belt_acceleration)) + 1e-300
        worst = (abs(drag) - scene.mu_s * load) / allowed
    else:
        drag, slope = friction_force(scene, x, v)
        relaxation = abs(slope) / scene.mass
        if not held:
            if mode.region == BAND:
                speed = min(speed, 1e3 * stiction_band(scene.law))
            worst = -mode.sign * v / (tolerance * speed)
    terms = swing * abs(x) + abs(drag) / scene.mass + abs(belt_acceleration)
    off = abs(-swing * x - drag / scene.mass - belt_acceleration - rates[1])
    off = off / ((1.0 / s + relaxation) * tolerance * speed + _ROUNDING * terms)
    return (max(worst, off) if worst + off < inf else inf), -drag * (v + belt_velocity)


@audit.energy.implements(Belt, BristleBelt)
def _energy(scene, force, y):
    x, velocity = y[0], y[1] + force[1]
    return 0.5 * (scene.mass * velocity * velocity + scene.stiffness * x * x)


@audit.violation.implements(BristleBelt)
def _bristle_breach(scene, mode, force, y, rates, s, tolerance):
    x, v, z = y
    _, belt_velocity, belt_acceleration = force
    rate, rate_v, rate_z, drag, by_v, by_z = contact_force(scene, v, z, 1.0 if v >= 0.0 else -1.0, mode.region)
    _, speed, deflection, _ = implicit.error_scales(scene, _IMPLICIT * tolerance, y)
    swing = scene.stiffness / scene.mass
    terms = swing * abs(x) + abs(drag) / scene.mass + abs(belt_acceleration)
    allowed = speed / s + (abs(by_v) * speed + abs(by_z) * deflection) / scene.mass + _ROUNDING * terms
    off = abs(-swing * x - drag / scene.mass - belt_acceleration - rates[1]) / allowed
    allowed = (1.0 / s + abs(rate_z)) * deflection + abs(rate_v) * speed + _ROUNDING * abs(v)
    off = max(off, abs(rate - rates[2]) / allowed)
    return (max(-mode.sign * v / speed, off) if off < inf else inf), -drag * (v + belt_velocity)
