"""Audit of runs on the belt: violations of the friction law and of the balance of momentum.

Solvers call what this file implements through :mod:`ringsweep.models.interface.audit`. K is friction per unit of the
load; `motion` is displacement (m), force (N) and velocity in space (m/s); `forcing` begins with place, velocity and
acceleration of the belt. A violation of 1 is what the tolerance explains.
"""

from __future__ import annotations

import numpy as np

from ringsweep.compile import inlined
from ringsweep.models.belt.force import breakaway_force, in_segment, length_scale, moving, slip_from, speed_scale
from ringsweep.models.belt.mode import yields
from ringsweep.models.belt.stops import SUMMED, beside_stops
from ringsweep.models.interface import audit, implicit
from ringsweep.models.sliding import audited, imbalances, larger, speed_in, violation_on_bristles
from ringsweep.models.slip import acceleration_slopes, slip
from ringsweep.physics import ring
from ringsweep.physics.belt import Belt, BristleBelt, laden
from ringsweep.physics.forces import force_in
from ringsweep.physics.zones import Segments
from ringsweep.quantities.flags import OSCILLATORY, SEPARATING

# An oscillation is certain if the two runs of a cell differ by less than this share of its swing.
_SMALLEST_SHARE = 0.1

# Statistics of two runs agree if the ranges of their displacements and their shares of stick differ by less than the
# first, and their stops in a cycle by less than the second: laps of chaotic motions are no longer than 64 cycles.
_SAME_SHARE, _SAME_STOPS = 0.1, 0.25

# Errors of the steps around steady sliding look like a swing of a smaller share of the range of the displacement.
_SMALLEST_SWING = 1e-2


# A separation is certain if the reaction needs more time to rise again than this multiple of the error of the instant.
_FALL_FACTOR = 5.0


@audit.least_scales.implements(Belt, BristleBelt)
def _least_scales_on_belt(batch):
    """Implement :func:`audit.least_scales`: of times, s, that of a swing on the spring; of velocities that of a launch.

    A body that is launched at rest on the spot slides on its belt. In a creep friction is small beside breakaway.
    """
    with np.errstate(divide="ignore", over="ignore"):
        swing = np.sqrt(batch.body.mass / np.abs(batch.body.stiffness))
    load = ring.reactions(batch.body, 0.0, 0.0, (batch.initial_x, 0.0, 0.0))[0]
    breakaway = np.atleast_2d(batch.mu_s).max(axis=0) * np.abs(load)
    return {"s": np.minimum(swing, batch.span), "m s-1": np.abs(batch.initial_v), "friction": breakaway}


@audit.disturbed.implements(Belt)
def _disturbed_rebounds_and_edges(batch, share):
    """Implement :func:`audit.disturbed`: impacts magnify an error, and so do narrow zones that of their edges."""
    if batch.stops:
        stops = batch.stops
        batch = batch._replace(stops=stops._replace(restitution=stops.restitution * (1.0 - share)))
    if not isinstance(batch.surface, Segments):
        return batch
    ruler = batch.surface.ruler
    ruler = ruler._replace(period=np.nextafter(ruler.period, np.inf))
    return batch._replace(surface=batch.surface._replace(ruler=ruler))


@audit.violation.implements(Belt)
def _violation_on_belt(scene, mode, forcing, y, rates, s, tolerance):
    """Implement :func:`audit.violation` for laws of the velocity: law, balance, and sign of the reaction."""
    (x, v), scene = y, laden(scene.drive, in_segment(scene.surface, scene, mode.place), forcing)
    body, push = scene.body, force_in(scene.drive, forcing)
    velocity = forcing[1] if mode.sign == 0 else moving(scene, v + forcing[1], v, forcing[1])
    moves = abs(velocity) + abs(forcing[1])
    length = abs(x) + length_scale(scene, moves)
    speed, largest, relaxation = speed_scale(scene, length, moves), 0.0, 0.0
    if mode.sign == 0:
        motion = x, push, velocity
        normal, _, friction = ring.held(body, 1.0, motion, x * x * x, forcing[2], 0.0)
        K = friction / normal if normal != 0.0 else 0.0
        sizes = ring.size(body, (length, push, velocity)) + body.mass * (body.gravity + abs(forcing[2]))
        largest = (abs(friction) - breakaway_force(scene, -friction, x)) / (tolerance * sizes + 1e-300)
    else:
        now = slip_from(scene, x, velocity, v, forcing)
        (K, _), motion = now.K, now.motion
        relaxation = abs(acceleration_slopes(scene, now)[1])
        # In a dead band the sliding velocity need not have the direction of the force.
        if not yields(scene, mode):
            speed = speed_in(scene, mode, speed)
            largest = -mode.sign * v / (tolerance * speed)
    scales = (1.0 / s + relaxation) * tolerance * speed, _terms(body, motion, forcing), tolerance
    violation, power = imbalances(scene, (K, K), ring.reactions(body, K, K, motion), motion, forcing, rates[1], scales)
    found = larger(largest, violation), power
    return beside_stops(scene.stops, scene, mode, forcing, y, s, tolerance, found)


@audit.violation.implements(BristleBelt)
def _violation_on_bristle_belt(scene, mode, forcing, y, rates, s, tolerance):
    """Implement :func:`audit.violation` for laws with bristles."""
    found = violation_on_bristles(scene, mode, forcing, y, rates, s, tolerance)
    return beside_stops(scene.stops, scene, mode, forcing, y, s, tolerance, found)


@inlined
def _terms(body, motion, forcing):
    """Size of the terms of the acceleration, m/s^2."""
    return body.gravity + ring.size(body, motion) / body.mass + abs(forcing[2]) + 1e-200


@audit.energy_of.implements(Belt, BristleBelt)
def _energy_on_belt(scene, forcing, y):
    """Implement :func:`audit.energy_of`: of the body and of the spring."""
    # The momentum in a dead band moves with the belt.
    hidden = y[1] - moving(scene, y[1], y[1], 0.0)
    return ring.energy(scene.body, (y[0], 0.0, y[1] + forcing[1])) - 0.5 * scene.body.mass * hidden * hidden


@audited.implements(BristleBelt)
def _audited_on_bristle_belt(scene, mode, forcing, y):
    """Implement :func:`audited`: slip, size of the terms of the acceleration, and no violation so far."""
    now = slip(scene, mode, (), forcing, implicit.to_implicit(scene, forcing, y))
    return now, _terms(scene.body, now.motion, forcing), 0.0


@audit.undecided.implements(Belt, BristleBelt)
def _undecided_on_belt(batch, one, other, fall_rates):
    """Implement :func:`audit.undecided`: sliding or oscillatory, separated or not, and as many impacts or not."""
    with np.errstate(invalid="ignore", over="ignore", divide="ignore"):
        found = _sliding_or_swing(batch, one, other) | _may_hold(batch, one, other, fall_rates)
    return found | (one.impacts != other.impacts) if batch.stops else found


@audit.of_events.implements(Belt, BristleBelt)
def _of_impacts_at_stops(batch, one):
    """Implement :func:`audit.of_events`: rebounds are summed."""
    hit = one.impacts > 0.0 if batch.stops else np.zeros(len(batch.span), dtype=bool)
    return hit & False, hit, SUMMED * hit


def _sliding_or_swing(batch, one, other):
    """Which oscillatory runs may only slide: around steady sliding the errors of the steps look like a swing."""
    stiffness = batch.body.stiffness
    pace = np.where(stiffness > 0.0, np.sqrt(batch.body.mass / stiffness), 0.0)
    apart = np.maximum(np.abs(one.x_end - other.x_end), np.abs(one.swing - other.swing))
    apart = np.fmax(apart, np.abs(one.velocity_end - other.velocity_end) * pace)
    swing = np.minimum(one.swing, other.swing)
    swings = (apart <= _SMALLEST_SHARE * swing) | (swing > _SMALLEST_SWING * (one.x_max - one.x_min))
    return (one.regime == OSCILLATORY) & ~swings


def _may_hold(batch, one, other, fall_rates):
    """Which runs an error could make separate, or keep from separating; `fall_rates` in N/s."""
    body = batch.body
    if not ring.if_load_varies(body, True, False):
        return np.zeros(len(fall_rates), dtype=bool)
    growth, weight = getattr(body, "normal_stiffness", 0.0), body.mass * body.gravity
    weight = weight + getattr(batch.drive, "least_load", 0.0)
    least, second = (weight + np.minimum(growth * found.x_min, growth * found.x_max) for found in (one, other))
    separated = one.regime == SEPARATING
    # The acceleration is at most about that of the spring and of the load where the reaction vanishes.
    far = np.maximum(np.abs(one.x_min), np.abs(one.x_max))
    curvature = np.abs(growth) * (body.gravity + (body.stiffness + np.abs(growth)) / body.mass * far)
    curvature += getattr(body, "load", 0.0) * (2.0 * np.pi / np.minimum(batch.forcing_period, batch.span)) ** 2
    slow = _FALL_FACTOR * np.abs(one.t_end - other.t_end) * curvature > fall_rates
    # A load that is least at launch, where it may be zero, is the same in both runs.
    return np.where(separated, (one.t_end > 0.0) & slow, least < 2.0 * np.abs(least - second))


@audit.same_statistics.implements(Belt, BristleBelt)
def _same_statistics_on_belt(batch, one, other):
    """Implement :func:`audit.same_statistics`: range of the displacement, share of stick, stops in a cycle."""
    with np.errstate(invalid="ignore", over="ignore"):
        range_1, range_2 = one.x_max - one.x_min, other.x_max - other.x_min
        same = np.abs(range_1 - range_2) <= _SAME_SHARE * np.minimum(range_1, range_2)
        # Without a cycle there are no shares.
        same &= ~(np.abs(one.stick_share - other.stick_share) > _SAME_SHARE)
        return same & ~(np.abs(one.stops_per_cycle - other.stops_per_cycle) > _SAME_STOPS)
