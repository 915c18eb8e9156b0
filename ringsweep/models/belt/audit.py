"""Audit of runs on the belt: violations of the friction law and of the balance of momentum."""

from __future__ import annotations

from math import inf

import numpy as np

from ringsweep.models.belt.bristles import contact_force
from ringsweep.models.belt.force import (
    damping,
    friction_force,
    holds_in_band,
    length_scale,
    pull,
    speed_scale,
    stuck_pull,
    with_cubic_energy,
    with_loads,
    with_sizes,
)
from ringsweep.models.belt.record import Outcome
from ringsweep.models.interface import audit, implicit
from ringsweep.physics.belt import Belt, BristleBelt
from ringsweep.physics.forces import force_in
from ringsweep.physics.friction.velocity import stiction_band
from ringsweep.quantities.flags import OSCILLATORY

# An oscillation is certain if the two runs of a cell differ by less than this share of its swing.
_SMALLEST_SHARE = 0.1

# Statistics of two runs agree if the ranges of their displacements and their shares of stick differ by less than the
# first, and their stops in a cycle by less than the second: laps of chaotic motions are no longer than 64 cycles.
_SAME_SHARE, _SAME_STOPS = 0.1, 0.25

# Errors of the steps around steady sliding look like a swing of a smaller share of the range of the displacement.
_SMALLEST_SWING = 1e-2

# Rounding of an acceleration, as a share of its largest terms.
_ROUNDING = 1e-12


@audit.violation.implements(Belt)
def _violation(scene, mode, forcing, y, rates, s, tolerance):
    x, v = y
    belt_velocity, belt_acceleration, push = forcing[1], forcing[2], force_in(scene.drive, forcing)
    velocity, cube = v + belt_velocity, x * x * x
    stiffness_per_mass, load = scene.stiffness / scene.mass, scene.mass * scene.gravity
    length = abs(x) + length_scale(scene, abs(velocity) + abs(belt_velocity))
    speed = speed_scale(scene, length)
    # In a dead band the sliding velocity need not have the direction of the force.
    in_dead_band, largest, relaxation = holds_in_band(scene.law) and mode.region < 0, 0.0, 0.0
    if mode.sign == 0:
        friction = stuck_pull(scene, x, v, forcing)
        sizes = load + scene.stiffness * length + scene.mass * abs(belt_acceleration)
        allowed = tolerance * with_sizes(scene, sizes, 1.0, velocity, length * length * length, push) + 1e-300
        largest = (abs(friction) - scene.mu_s * load) / allowed
    else:
        friction, slope = friction_force(scene, pull(scene, x, velocity, forcing), v)
        relaxation = abs(damping(scene, slope)) / scene.mass
        if not in_dead_band:
            if mode.region < 0:
                speed = min(speed, 1e3 * stiction_band(scene.law))
            largest = -mode.sign * v / (tolerance * speed)
    per_mass = 1.0 / scene.mass
    terms = stiffness_per_mass * abs(x) + abs(friction) / scene.mass + abs(belt_acceleration)
    terms = with_sizes(scene, terms, per_mass, velocity, cube, push)
    balance = -stiffness_per_mass * x - friction / scene.mass - belt_acceleration - rates[1]
    imbalance = abs(with_loads(scene, balance, per_mass, velocity, cube, push))
    imbalance = imbalance / ((1.0 / s + relaxation) * tolerance * speed + _ROUNDING * terms)
    power = with_loads(scene, -friction * velocity, velocity, velocity, 0.0, push)
    return (max(largest, imbalance) if largest + imbalance < inf else inf), power


@audit.energy.implements(Belt, BristleBelt)
def _energy(scene, forcing, y):
    x, velocity = y[0], y[1] + forcing[1]
    found = 0.5 * (scene.mass * velocity * velocity + scene.stiffness * x * x)
    return with_cubic_energy(scene, found, x)


@audit.violation.implements(BristleBelt)
def _bristle_violation(scene, mode, forcing, y, rates, s, tolerance):
    x, v, z = y
    belt_velocity, belt_acceleration, push = forcing[1], forcing[2], force_in(scene.drive, forcing)
    velocity, cube, per_mass = v + belt_velocity, x * x * x, 1.0 / scene.mass
    rate, rate_v, rate_z, friction, by_v, by_z = contact_force(scene, v, z, 1.0 if v >= 0.0 else -1.0, mode.region)
    _, speed, deflection, _ = implicit.error_scales(scene, implicit.IMPLICIT_TOLERANCE * tolerance, y)
    stiffness_per_mass = scene.stiffness / scene.mass
    terms = stiffness_per_mass * abs(x) + abs(friction) / scene.mass + abs(belt_acceleration)
    terms = with_sizes(scene, terms, per_mass, velocity, cube, push)
    allowed = speed / s + (abs(damping(scene, by_v)) * speed + abs(by_z) * deflection) / scene.mass + _ROUNDING * terms
    balance = -stiffness_per_mass * x - friction / scene.mass - belt_acceleration - rates[1]
    imbalance = abs(with_loads(scene, balance, per_mass, velocity, cube, push)) / allowed
    allowed = (1.0 / s + abs(rate_z)) * deflection + abs(rate_v) * speed + _ROUNDING * abs(v)
    imbalance = max(imbalance, abs(rate - rates[2]) / allowed)
    power = with_loads(scene, -friction * velocity, velocity, velocity, 0.0, push)
    return (max(-mode.sign * v / speed, imbalance) if imbalance < inf else inf), power


@audit.undecided.implements(Belt, BristleBelt)
def _undecided(batch, rows, second_rows, fall_rates):
    """Around steady sliding the errors of the steps look like an oscillation, in both runs."""
    one, other = Outcome(*rows.T), Outcome(*second_rows.T)
    with np.errstate(invalid="ignore", over="ignore", divide="ignore"):
        pace = np.where(batch.stiffness > 0.0, np.sqrt(batch.mass / batch.stiffness), 0.0)
        apart = np.maximum(np.abs(one.x_end - other.x_end), np.abs(one.swing - other.swing))
        apart = np.fmax(apart, np.abs(one.velocity_end - other.velocity_end) * pace)
        swing = np.minimum(one.swing, other.swing)
        swings = (apart <= _SMALLEST_SHARE * swing) | (swing > _SMALLEST_SWING * (one.x_max - one.x_min))
        return (one.regime == OSCILLATORY) & ~swings


@audit.same_statistics.implements(Belt, BristleBelt)
def _same_statistics(batch, rows, second_rows):
    one, other = Outcome(*rows.T), Outcome(*second_rows.T)
    with np.errstate(invalid="ignore", over="ignore"):
        range_1, range_2 = one.x_max - one.x_min, other.x_max - other.x_min
        same = np.abs(range_1 - range_2) <= _SAME_SHARE * np.minimum(range_1, range_2)
        # Without a cycle there are no shares.
        same &= ~(np.abs(one.stick_share - other.stick_share) > _SAME_SHARE)
        return same & ~(np.abs(one.stops_per_cycle - other.stops_per_cycle) > _SAME_STOPS)
