"""Audit of runs on the ring: violations of the friction law, of the balances and of the signs of the reactions.

The audit uses neither the series nor the segments of a mode. The coefficients are those of the surface at the angle of
each contact; reactions and accelerations are those of :mod:`ringsweep.physics.ring`, and they are put into the balances
as these are written down. The formulas of the friction law are also used by the solver.

Solvers call what this file implements through :mod:`ringsweep.models.interface.audit`. `rho` is the angle of the body
in the ring's frame, `under` the static and kinetic coefficient under contact 1 and contact 2. A violation of 1 is
what the tolerance explains.
"""

from __future__ import annotations

from math import cos, inf, sin

import numpy as np

from ringsweep.compile import inlined, take
from ringsweep.models.interface import audit, implicit
from ringsweep.models.ring.bristles import slip_of
from ringsweep.models.ring.contacts import coefficients_under
from ringsweep.models.ring.series import NORMAL_1, NORMAL_2
from ringsweep.models.sliding import REACTION_TOLERANCE, audited, imbalances, larger, rate_at_rest, speed_in
from ringsweep.physics import contact, drives, ring
from ringsweep.physics.friction import SetValued, family_of
from ringsweep.physics.friction.velocity import friction_at
from ringsweep.physics.friction.ways import TwoWay, along, towards
from ringsweep.physics.zones import Segments, edge_ahead, roughest
from ringsweep.quantities.flags import SEPARATING

# Rounding of an acceleration or a reaction, as a share of its largest terms.
_ROUNDING = 1e-12

# Distance from the edge of a zone within which a contact counts as on the edge, where both sides are right, rad.
_ON_EDGE = 1e-8


@inlined
def _names_wrong_segment(scene, mode, rho, under):
    """Whether the mode names another segment than the one under a contact, unless the contact is on an edge.

    `under` has the coefficients under the contacts, as :func:`ring.coefficients_at` returns them.
    """
    way = float(mode.sign)
    of_mode, under = towards(scene.law, coefficients_under(scene, mode), way), towards(scene.law, under, way)
    offset = ring.contact_offset(scene.body)
    wrong = False
    for place, angle, assumed, found in (
        (mode.place_1, rho - offset, of_mode[:2], under[:2]),
        (mode.place_2, rho + offset, of_mode[2:4], under[2:4]),
    ):
        if assumed != found:
            ahead, back = edge_ahead(scene.surface, place, 1) - angle, angle - edge_ahead(scene.surface, place, -1)
            wrong = wrong or min(abs(ahead), abs(back)) > _ON_EDGE
    return wrong


@audit.violation.implements(ring.Ring)
def _violation_on_ring(scene, mode, forcing, y, rates, s, tolerance):
    """Implement :func:`audit.violation` for laws of the velocity: law, balances, and signs of the reactions."""
    body = scene.body
    phi, v = y
    theta, ring_omega, ring_epsilon = forcing
    omega = v / body.radius + ring_omega
    motion = sin(phi), cos(phi), omega
    under = ring.coefficients_at(scene, phi - theta)
    largest = inf if _names_wrong_segment(scene, mode, phi - theta, under) else 0.0
    terms = body.gravity + body.radius * (omega * omega + abs(ring_epsilon))
    speed = body.radius * (rate_at_rest(scene) + abs(omega))
    if mode.sign == 0:
        kappa, reserve, normal_1, normal_2 = contact.stick(body, under[0], under[2], motion, ring_epsilon)
        K1, K2 = -kappa * along(under[0], kappa), -kappa * along(under[2], kappa)
        largest, relaxation = larger(largest, -reserve / (body.mass * terms * REACTION_TOLERANCE * tolerance)), 0.0
    else:
        sign = 1.0 if v > 0.0 else -1.0
        mu_1, mu_2, slope_1, slope_2 = friction_at(scene.law, abs(v), towards(scene.law, under, sign))
        K1, K2 = -sign * mu_1, -sign * mu_2
        _, determinant = ring.acceleration(body, K1, K2, motion)
        normal_1, normal_2 = ring.reactions(body, K1, K2, motion)
        relaxation = body.radius * abs(ring.acceleration_slope(body, K1, K2, slope_1, slope_2, motion))
        speed = speed_in(scene, mode, speed)
        largest = larger(largest, -mode.sign * v / (tolerance * speed))
        if not determinant > 0.0:
            largest = inf
    # An error of the velocity changes the acceleration through the slope of friction, and the mean rate over the step.
    scales = (1.0 / s + relaxation) * tolerance * speed, terms, tolerance
    violation, power = imbalances(scene, (K1, K2), (normal_1, normal_2), motion, forcing, rates[1], scales)
    return larger(largest, violation), power


@audit.energy_of.implements(ring.Ring, ring.BristleRing)
def _energy_on_ring(scene, forcing, y):
    """Implement :func:`audit.energy_of`; with bristles the place in the state is the angle in the ring's frame."""
    phi = implicit.to_implicit(scene, forcing, y)[0] + forcing[0]
    return ring.energy(scene.body, (sin(phi), cos(phi), y[1] / scene.body.radius + forcing[1]))


@audited.implements(ring.BristleRing)
def _audited_on_bristle_ring(scene, mode, forcing, y):
    """Implement :func:`audited`; a mode that names another segment than the one under a contact is a violation."""
    rho, v, _, _ = y
    body, phi, omega = scene.body, rho + forcing[0], v / scene.body.radius + forcing[1]
    under, sign = ring.coefficients_at(scene, rho), 1.0 if v >= 0.0 else -1.0
    now = slip_of(scene, towards(scene.law, under, sign), (sin(phi), cos(phi), omega), y, sign, mode.region)
    terms = body.gravity + body.radius * (omega * omega + abs(forcing[2]))
    return now, terms, inf if _names_wrong_segment(scene, mode, rho, under) else 0.0


# Largest rounding of an angle, rad.
_ANGLE_ROUNDING = 1e-12

# A run that ends before this share of the least scale of times ends at its launch.
_LAUNCH = 1e-13

# A separation is certain if the reaction needs more time to rise again than this multiple of the error of the instant.
_FALL_FACTOR = 5.0


@audit.least_scales.implements(ring.Ring, ring.BristleRing)
def rates_and_times(batch):
    """Implement :func:`audit.least_scales`: of angular velocities, accelerations and times; the impact calls it too.

    See :func:`ringsweep.models.sliding.rate_at_rest`.
    """
    rate = rate_at_rest(batch)
    acceleration = batch.body.gravity / batch.body.radius
    return {"rad s-1": rate, "rad s-2": acceleration, "s": np.minimum(1.0 / rate, batch.span)}


@audit.is_reaction.implements(ring.Ring, ring.BristleRing)
def _is_reaction_on_ring(scene, guard):
    """Implement :func:`audit.is_reaction`; DETERMINANT, the guard of a jam, is none."""
    return guard in (NORMAL_1, NORMAL_2)


@audit.undecided.implements(ring.Ring, ring.BristleRing)
def undecided_on_contacts(batch, one, other, fall_rates):
    """Implement :func:`audit.undecided`; the impact calls it too."""
    # Comparisons with NaN are false.
    with np.errstate(invalid="ignore", over="ignore"):
        return _is_near_another_regime(batch, one, other, fall_rates) | _is_launched_on_edge(batch)


def _is_launched_on_edge(batch):
    """Whether each body is launched at rest with a contact on an edge: rounding decides which side holds the body."""
    if not isinstance(batch.surface, Segments) or family_of(type(batch.law)) is not SetValued:
        return np.zeros(len(batch.span), dtype=bool)
    rho, offset = batch.initial_phi - drives.angle_at_start(batch.drive), ring.contact_offset(batch.body)
    found = np.zeros(len(batch.span), dtype=bool)
    for angle in (rho - offset, rho + offset):
        distance = (angle[:, None] - batch.surface.edges + np.pi) % (2.0 * np.pi) - np.pi
        found |= (np.abs(distance) < _ANGLE_ROUNDING).any(axis=1)
    for i in np.flatnonzero(found):
        found[i] = ring.launch_velocity(take(batch, i)) == 0.0
    return found


def _is_near_another_regime(batch, a, b, fall_rates):
    """Whether the difference between the outcomes `a` and `b` of two runs is large enough to change the regime."""
    separating, moved = a.regime == SEPARATING, a.t_end * rate_at_rest(batch) > _LAUNCH
    found = np.zeros(len(fall_rates), dtype=bool)
    # A least reaction that is smaller than its error leaves separation open.
    body, omega_squared = batch.body, np.maximum(np.abs(a.omega_min), np.abs(a.omega_max)) ** 2
    rounding = _ROUNDING * body.mass * (body.gravity + body.radius * omega_squared)
    contacts = (1, a.normal_min_1, b.normal_min_1), (2, a.normal_min_2, b.normal_min_2)
    for number, least, second_least in contacts[: ring.contact_count(body)]:
        separated = separating & ((a.separating_contact.astype(int) & number) > 0)
        found |= moved & ~separated & (least <= np.maximum(2.0 * np.abs(least - second_least), rounding))
    # A reaction that falls slowly may rise again before it vanishes. Its second derivative is at most about that of the
    # weight of a body that swings or revolves, plus that of the centrifugal load, which friction changes.
    mu, _ = roughest(batch.surface)
    mu = np.maximum(*mu) if isinstance(mu, TwoWay) else mu
    friction_term = np.minimum(1.0, 4.0 * mu * mu) * body.radius * omega_squared * omega_squared
    curvature = body.mass * (body.gravity * (body.gravity / body.radius + omega_squared) + friction_term)
    found |= separating & moved & (_FALL_FACTOR * np.abs(a.t_separation - b.t_separation) * curvature > fall_rates)
    # A reversal or a full turn that the error could undo or add.
    difference = 2.0 * np.maximum(np.abs(a.omega_min - b.omega_min), np.abs(a.omega_max - b.omega_max))
    over_positive, over_negative = a.omega_max - batch.epsilon_omega, a.omega_min + batch.epsilon_omega
    close = ((np.abs(over_positive) < difference) & (over_negative < difference)) | (
        (np.abs(over_negative) < difference) & (over_positive > -difference)
    )
    found |= (a.reversals <= 1) & close
    difference = 2.0 * (np.abs(a.phi_min - b.phi_min) + np.abs(a.phi_max - b.phi_max))
    return found | ((a.reversals == 0) & (np.abs(a.phi_max - a.phi_min - 2.0 * np.pi) < difference))
