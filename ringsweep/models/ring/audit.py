"""Whether a run on the ring obeys its law: violations of friction law, balances and signs, from the plain formulas.

No series is used, and no segment that a mode names: friction is that of the surface at the angle of each contact,
reactions and accelerations are those of :mod:`ringsweep.physics.ring`. The formulas of the law are shared, of course.
"""

from __future__ import annotations

from math import cos, inf, sin

import numpy as np

from ringsweep.compile import inlined, take
from ringsweep.models.interface import audit, implicit
from ringsweep.models.ring.contacts import coefficients_under
from ringsweep.models.ring.record import Outcome
from ringsweep.physics import contact, drives, ring
from ringsweep.physics.friction import SetValued, family_of
from ringsweep.physics.friction.bristles import bristle
from ringsweep.physics.friction.velocity import BAND, stiction_band, weights
from ringsweep.physics.zones import PER_TURN, Segments, edge_ahead, roughest, roughness
from ringsweep.quantities.variables import SEPARATING

# Rounding of accelerations, as a share of their largest terms.
_ROUNDING = 1e-12

# Angle within which a contact counts as on the edge of an arc, where either side may hold, rad.
_ON_EDGE = 1e-8

# Tolerance of an implicit step, and error allowed to the reactions as a share of the weight, in units of the tolerance
# of the series.
_LOADS = 1e3


@inlined
def _misplaced(scene, mode, rho, under):
    """Whether the surface under the contacts is another than the mode says, away from any edge."""
    mu_s1, mu_k1, mu_s2, mu_k2 = coefficients_under(scene, mode)
    at_1, at_2 = under
    offset = ring.contact_offset(scene.body)
    wrong = False
    for place, angle, there, at in (
        (mode.place_1, rho - offset, (mu_s1, mu_k1), at_1),
        (mode.place_2, rho + offset, (mu_s2, mu_k2), at_2),
    ):
        if there != at:
            ahead, back = edge_ahead(scene.surface, place, 1) - angle, angle - edge_ahead(scene.surface, place, -1)
            wrong = wrong or min(abs(ahead), abs(back)) > _ON_EDGE
    return wrong


@inlined
def _at(scene, rho):
    """Static and kinetic coefficient under each contact, at an angle in the ring's frame."""
    offset = ring.contact_offset(scene.body)
    return roughness(scene.surface, (rho - offset) * PER_TURN), roughness(scene.surface, (rho + offset) * PER_TURN)


@inlined
def _worst(a, b):
    """The larger of two violations; one that is not a number is infinite."""
    return max(a, b) if b < inf else inf


@audit.violation.implements(ring.Ring)
def _breach(scene, mode, force, y, rates, s, tolerance):
    body = scene.body
    phi, v = y
    theta, ring_omega, ring_epsilon = force
    omega = v / body.radius + ring_omega
    sin_phi, cos_phi = sin(phi), cos(phi)
    under = _at(scene, phi - theta)
    (mu_s1, mu_k1), (mu_s2, mu_k2) = under
    worst = inf if _misplaced(scene, mode, phi - theta, under) else 0.0
    terms = body.gravity + body.radius * (omega * omega + abs(ring_epsilon))
    speed = body.radius * (1.0 + abs(omega))
    if mode.sign == 0:
        kappa, reserve, normal_1, normal_2 = contact.stick(body, mu_s1, mu_s2, sin_phi, cos_phi, omega, ring_epsilon)
        K1, K2 = -kappa * mu_s1, -kappa * mu_s2
        epsilon, _, _ = ring.acceleration(body, K1, K2, sin_phi, cos_phi, omega)
        least, relaxation = min(reserve, min(normal_1, normal_2)), 0.0
    else:
        w_s, w_k, dw_s, dw_k = weights(scene.law, abs(v))
        sign = 1.0 if v > 0.0 else -1.0
        K1, K2 = -sign * (w_s * mu_s1 + w_k * mu_k1), -sign * (w_s * mu_s2 + w_k * mu_k2)
        slope_1, slope_2 = dw_s * mu_s1 + dw_k * mu_k1, dw_s * mu_s2 + dw_k * mu_k2
        epsilon, determinant, inertia = ring.acceleration(body, K1, K2, sin_phi, cos_phi, omega)
        normal_1, normal_2 = ring.reactions(body, K1, K2, sin_phi, cos_phi, omega, epsilon)
        least = min(normal_1, normal_2)
        relaxation = body.radius * abs(ring.acceleration_slope(body, K1, K2, slope_1, slope_2, sin_phi, cos_phi, omega))
        if mode.region == BAND:
            speed = min(speed, 1e3 * stiction_band(scene.law))
        worst = _worst(worst, -mode.sign * v / (tolerance * speed))
        if not (determinant > 0.0 and inertia > 0.0):
            worst = inf
    # An error of the velocity makes one of its rate: over the step, and by the slope of friction.
    pull = 1.0 / s + relaxation
    off = abs(body.radius * (epsilon - ring_epsilon) - rates[1])
    worst = _worst(worst, off / (pull * tolerance * speed + _ROUNDING * terms))
    worst = _worst(worst, -least / (body.mass * terms * _LOADS * tolerance))
    return worst, ring.friction_power(body, K1, K2, normal_1, normal_2, omega)


@audit.energy.implements(ring.Ring)
def _energy(scene, force, y):
    return ring.energy(scene.body, cos(y[0]), y[1] / scene.body.radius + force[1])


@audit.violation.implements(ring.BristleRing)
def _bristle_breach(scene, mode, force, y, rates, s, tolerance):
    body = scene.body
    rho, v, z_1, z_2 = y
    theta, ring_omega, ring_epsilon = force
    phi, omega = rho + theta, v / body.radius + ring_omega
    sin_phi, cos_phi = sin(phi), cos(phi)
    under = _at(scene, rho)
    (mu_s1, mu_k1), (mu_s2, mu_k2) = under
    worst = inf if _misplaced(scene, mode, rho, under) else 0.0
    sign = 1.0 if v >= 0.0 else -1.0
    rate_1, rate_v1, rate_z1, pull_1, v_1, stretch_1 = bristle(scene.law, mu_s1, mu_k1, v, z_1, sign, mode.region)
    rate_2, rate_v2, rate_z2, pull_2, v_2, stretch_2 = bristle(scene.law, mu_s2, mu_k2, v, z_2, sign, mode.region)
    epsilon, determinant, inertia = ring.acceleration(body, -pull_1, -pull_2, sin_phi, cos_phi, omega)
    normal_1, normal_2 = ring.reactions(body, -pull_1, -pull_2, sin_phi, cos_phi, omega, epsilon)
    if not (determinant > 0.0 and inertia > 0.0):
        worst = inf
    terms = body.gravity + body.radius * (omega * omega + abs(ring_epsilon))
    _, speed, deflection, _, _ = implicit.error_scales(scene, _LOADS * tolerance, y)
    by_v = ring.acceleration_slope(body, -pull_1, -pull_2, -v_1, -v_2, sin_phi, cos_phi, omega)
    by_1 = ring.acceleration_slope(body, -pull_1, -pull_2, -stretch_1, 0.0, sin_phi, cos_phi, omega)
    by_2 = ring.acceleration_slope(body, -pull_1, -pull_2, 0.0, -stretch_2, sin_phi, cos_phi, omega)
    allowed = speed / s + body.radius * (abs(by_v) * speed + (abs(by_1) + abs(by_2)) * deflection)
    off = abs(body.radius * (epsilon - ring_epsilon) - rates[1])
    worst = _worst(worst, off / (allowed + _ROUNDING * terms))
    for rate, given, rate_v, rate_z in ((rate_1, rates[2], rate_v1, rate_z1), (rate_2, rates[3], rate_v2, rate_z2)):
        allowed = (1.0 / s + abs(rate_z)) * deflection + abs(rate_v) * speed
        worst = _worst(worst, abs(rate - given) / (allowed + _ROUNDING * abs(v)))
    worst = _worst(worst, -mode.sign * v / speed)
    worst = _worst(worst, -min(normal_1, normal_2) / (body.mass * terms * _LOADS * tolerance))
    return worst, ring.friction_power(body, -pull_1, -pull_2, normal_1, normal_2, omega)


@audit.energy.implements(ring.BristleRing)
def _bristle_energy(scene, force, y):
    return ring.energy(scene.body, cos(y[0] + force[0]), y[1] / scene.body.radius + force[1])


# What rounding makes of an angle at most, rad.
_ROUNDED = 1e-12

# Time up to which a run has ended at its launch, s.
_AT_LAUNCH = 1e-13

# A separation counts where the reaction goes on to sink by several times what the resolutions differ by.
_SINKS = 5.0


@audit.undecided.implements(ring.Ring, ring.BristleRing)
def _undecided(batch, rows, witness, fall):
    # Of what is not a number every comparison is false.
    with np.errstate(invalid="ignore", over="ignore"):
        return _hangs(batch, Outcome(*rows.T), Outcome(*witness.T), fall) | _rests_on_edge(batch)


def _rests_on_edge(batch):
    """Which bodies are launched at rest with a contact on an edge, where rounding tells which side of it holds them."""
    if not isinstance(batch.surface, Segments) or family_of(type(batch.law)) is not SetValued:
        return np.zeros(len(batch.span), dtype=bool)
    drive = batch.drive
    if isinstance(drive, drives.Table):
        turned = np.array([drives.turn(take(drive, i), 0.0)[0] for i in range(len(batch.span))])
    else:
        turned = drive.amplitude * np.sin(drive.phase) if isinstance(drive, drives.Sinusoidal) else 0.0
    rho, offset = batch.initial_phi - turned, ring.contact_offset(batch.body)
    found = np.zeros(len(batch.span), dtype=bool)
    for angle in (rho - offset, rho + offset):
        away = (angle[:, None] - batch.surface.edges + np.pi) % (2.0 * np.pi) - np.pi
        found |= (np.abs(away) < _ROUNDED).any(axis=1)
    for i in np.flatnonzero(found):
        found[i] = ring.launch_velocity(take(batch, i)) == 0.0
    return found


def _hangs(batch, a, b, fall):
    """Which runs hang by less than the outcomes `a` and `b` of two resolutions differ."""
    separating, moved = a.regime == SEPARATING, a.t_end > _AT_LAUNCH
    found = np.zeros(len(fall), dtype=bool)
    # A contact that holds by less than its reaction is uncertain.
    contacts = (1, a.normal_min_1, b.normal_min_1), (2, a.normal_min_2, b.normal_min_2)
    for number, least, other in contacts[: 1 if isinstance(batch.body, ring.OneContact) else 2]:
        lost = separating & ((a.separating_contact.astype(int) & number) > 0)
        found |= moved & ~lost & (least <= 2.0 * np.abs(least - other))
    # A contact lost in passing: a reaction that falls slowly may turn before it vanishes. Its greatest curvature is
    # about that of the weight as the body swings or turns, and of the load of a turning that friction slows down.
    body, (mu, _) = batch.body, roughest(batch.surface)
    square = np.maximum(np.abs(a.omega_min), np.abs(a.omega_max)) ** 2
    slowed = np.minimum(1.0, 4.0 * mu * mu) * body.radius * square * square
    curvature = body.mass * (body.gravity * (body.gravity / body.radius + square) + slowed)
    found |= separating & moved & (_SINKS * np.abs(a.t_separation - b.t_separation) * curvature > fall)
    # A reversal, or a turn, that is only just one.
    off = 2.0 * np.maximum(np.abs(a.omega_min - b.omega_min), np.abs(a.omega_max - b.omega_max))
    above, below = a.omega_max - batch.epsilon_omega, a.omega_min + batch.epsilon_omega
    close = ((np.abs(above) < off) & (below < off)) | ((np.abs(below) < off) & (above > -off))
    found |= (a.reversals <= 1) & close
    off = 2.0 * (np.abs(a.phi_min - b.phi_min) + np.abs(a.phi_max - b.phi_max))
    return found | ((a.reversals == 0) & (np.abs(a.phi_max - a.phi_min - 2.0 * np.pi) < off))
