"""Audit of runs that go on after a contact is lost.

A pivot is put into the balances as :mod:`ringsweep.physics.pivot` declares them, with the accelerations of the
dense output: they give the reaction and the friction, which must obey the law. Gaps follow from the places of the
balls.

Read :mod:`ringsweep.models.interface.audit` and :mod:`mode` first. `one` and `other` hold the outcomes of two runs of
each cell, by name.
"""

from __future__ import annotations

from math import inf
from types import SimpleNamespace

import numpy as np

from ringsweep.compile import inlined
from ringsweep.models.interface import audit
from ringsweep.models.ring.audit import rates_and_times, undecided_on_contacts
from ringsweep.models.ring.impact.mode import (
    BOTH,
    NONE,
    coefficients_there,
    distances_to_edges,
    frame,
    place_of,
    ring_of,
)
from ringsweep.models.ring.impact.switch import SUMMED, motion_of
from ringsweep.models.sliding import REACTION_TOLERANCE, larger, rate_at_rest, speed_in
from ringsweep.physics import pivot, ring
from ringsweep.physics.friction.velocity import friction_at
from ringsweep.physics.impact import ImpactRing, contact_of, inertia
from ringsweep.physics.zones import PER_TURN, roughness
from ringsweep.quantities.flags import SEPARATING

# Rounding of an acceleration or a reaction as a share of its largest terms, and of a gap as a share of rho.
_ROUNDING, _GAP_ROUNDING = 1e-12, 1e-12

# Distance from the edge of a zone within which both sides are right, rad.
_ON_EDGE = 1e-8


@audit.violation.implements(ImpactRing)
def _violation_with_impact(scene, mode, forcing, y, rates, s, tolerance):
    """Implement :func:`audit.violation`: as on the ring while both contacts hold; open gaps must not be negative."""
    contacts = mode.contacts
    if contacts.open == NONE:
        closed = ring_of(scene, contacts.turned)
        return audit.violation(closed, mode, forcing, (y[0], y[1]), (rates[0], rates[1]), s, tolerance)
    motion, largest = motion_of(scene, y, forcing[1]), 0.0
    allowed = scene.balls.reach * (_GAP_ROUNDING + tolerance)
    for contact in (1, 2):
        if (contact == 1 or ring.contact_count(scene.closed.body) == 2) and contacts.open & contact:
            largest = larger(largest, -contact_of(scene.balls, contact, motion).gap / allowed)
    if contacts.open == BOTH:
        return largest, 0.0
    violation, power = _violation_of_pivot(scene, mode, forcing, y, rates, s, tolerance)
    return larger(largest, violation), power


@inlined
def _violation_of_pivot(scene, mode, forcing, y, rates, s, tolerance):
    """Violation and power of a pivot; arguments and results as for :func:`audit.violation`."""
    body, balls = scene.closed.body, scene.balls
    theta, ring_omega, ring_epsilon = forcing
    f = frame(scene, y, ring_omega)
    v, largest = y[1], 0.0
    # psi_dot = (v + rho eta_dot)/R + ring_omega, and alpha = psi - eta but for a constant.
    psi_dd = (rates[1] + balls.reach * rates[3]) / body.radius + ring_epsilon
    alpha_dd = psi_dd - rates[3]
    load = pivot.size(f) + balls.reach * abs(psi_dd)
    # What the balances of momentum lack without a reaction and friction.
    normal, lack, _ = pivot.imbalance(f, (psi_dd, alpha_dd, 0.0, 0.0))
    along = -lack
    rho, (mu_s, mu_k, _) = f.alpha - theta, coefficients_there(scene, place_of(mode))
    ahead, behind = distances_to_edges(scene, mode, rho)
    if (mu_s, mu_k) != roughness(scene.closed.surface, rho * PER_TURN, 0.0) and min(abs(ahead), abs(behind)) > _ON_EDGE:
        largest = inf
    # Errors of the rates, and of friction by that of the sliding velocity, which the implicit steps allow.
    speed = speed_in(scene, mode, body.radius * (rate_at_rest(scene.closed) + abs(f.psi_dot) + abs(f.alpha_dot)))
    relaxation = 0.0
    if mode.sign == 0:
        short = max(0.0, abs(along) - mu_s * normal)
    else:
        mu, slope = friction_at(scene.law, abs(v), (mu_s, mu_k))
        short = abs(along + (mu if v > 0.0 else -mu) * normal)
        relaxation = abs(slope) * (pivot.size(f) + abs(normal) / body.mass)
        largest = larger(largest, -mode.sign * v / (tolerance * speed))
    _, _, moment = pivot.imbalance(f, (psi_dd, alpha_dd, normal, along))
    rate = (1.0 / s + relaxation) * tolerance * speed + _ROUNDING * load
    per_force = 1.0 / (body.mass * (rate * REACTION_TOLERANCE * 1e-2 + REACTION_TOLERANCE * tolerance * load))
    largest = larger(largest, short * per_force)
    largest = larger(largest, -normal * per_force)
    largest = larger(largest, abs(moment) * per_force / (balls.reach + abs(inertia(body)) / (body.mass * balls.reach)))
    return largest, along * (v + body.radius * ring_omega)


@audit.energy_of.implements(ImpactRing)
def _energy_with_impact(scene, forcing, y):
    """Implement :func:`audit.energy_of`."""
    body, motion = scene.closed.body, motion_of(scene, y, forcing[1])
    spin = 0.0 if ring.contact_count(body) == 1 else inertia(body) * motion.psi_dot * motion.psi_dot
    speed = motion.x_dot * motion.x_dot + motion.y_dot * motion.y_dot
    return 0.5 * body.mass * speed + 0.5 * spin + body.mass * body.gravity * motion.y


# Largest violation of the impact law, and gain of energy in an impact, in a certified run: shares of the scales.
_MOST_VIOLATION = 1e-9


@audit.is_reaction.implements(ImpactRing)
def _is_reaction_with_impact(scene, guard):
    """Implement :func:`audit.is_reaction`; the guard of an open contact, its gap, counts as one."""
    return audit.is_reaction(scene.closed, guard)


@audit.undecided.implements(ImpactRing)
def _undecided_with_impact(batch, one, other, fall_rates):
    """Implement :func:`audit.undecided`; every contact that has been open counts as separated."""
    return undecided_on_contacts(batch.closed, _all_lost(one), _all_lost(other), fall_rates)


def _all_lost(one):
    """Outcomes in which ``separating_contact`` has all contacts that were ever open."""
    lost = 1.0 * (one.normal_min_1 == 0.0) + 2.0 * (one.normal_min_2 == 0.0)
    contacts = np.where(one.regime == SEPARATING, lost, one.separating_contact)
    return SimpleNamespace(**vars(one) | {"separating_contact": contacts})


@audit.disturbed.implements(ImpactRing)
def _disturbed_restitution(batch, share):
    """Implement :func:`audit.disturbed`: flights are in closed form, so only the restitution is disturbed."""
    return batch._replace(restitution=batch.restitution * (1.0 - share))


@audit.least_scales.implements(ImpactRing)
def _least_scales_with_impact(batch):
    """Implement :func:`audit.least_scales`: those of the ring, and of lengths, speeds, impulses and energies."""
    body, reach, scales = batch.closed.body, batch.balls.reach, rates_and_times(batch.closed)
    speed = reach * (scales["rad s-1"] + np.sqrt(body.gravity / reach))
    return scales | {"m": reach, "m s-1": speed, "N s": body.mass * speed, "J": body.mass * speed * speed}


@audit.of_events.implements(ImpactRing)
def _of_impacts(batch, one):
    """Implement :func:`audit.of_events`."""
    # Each loss of a contact ends with rebounds that are summed.
    return ~(one.impact_violation <= _MOST_VIOLATION), one.impacts > 0.0, SUMMED * one.separations
