"""Audit of two masses on a belt: violations of the friction law and of the balances, and energy.

A violation of 1 is what the tolerance explains.
"""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np

from ringsweep.compile import inlined
from ringsweep.models.interface import audit
from ringsweep.models.pair.contact_modes import forces_of, friction_of, kind_of, motion_of, scales_of
from ringsweep.models.sliding import larger
from ringsweep.physics import pair

# Rounding of an acceleration, and an error of the balances that is more than rounding, as shares of their terms.
_ROUNDING, _UNBALANCED = 1e-12, 1e-9


@inlined
def _of_contact(mass, sign, now, units, found):
    """Largest violation of the law and of the balance along the belt at one contact.

    Parameters
    ----------
    mass : Belt
    sign : int
        Of its sliding velocity.
    now : tuple of float
        Sliding velocity, m/s, and its rate from the dense output, m/s^2.
    units : tuple of float
        Speed, m/s, force, N, relaxation, 1/s, length of the step, s, tolerance.
    found : tuple of float
        w, N and F from the balances.
    """
    (v, rate), (speed, force, relaxation, s, tolerance), (w, N, F) = now, units, found
    allowed = (1.0 / s + relaxation) * tolerance * speed + _ROUNDING * force / mass.body.mass
    law = (abs(F) - mass.mu_s * N) / (tolerance * force) if sign == 0 else -sign * v / (tolerance * speed)
    return larger(larger(0.0, law), abs(w - rate) / allowed)


@audit.violation.implements(pair.BeltPair)
def _violation_of_pair(scene, mode, forcing, y, rates, s, tolerance):
    """Implement :func:`audit.violation`: at both contacts, and in the balances as they are declared."""
    body, motion = scene.body, motion_of(y, forcing)
    w, N, F = pair.solved(body, kind_of(mode.signs), friction_of(scene, mode.signs), motion)
    force_1, force_2 = forces_of(scene, y, forcing)
    speed_1 = scales_of(scene.first, motion[0], motion[1], forcing)[1]
    speed_2 = scales_of(scene.second, motion[2], motion[3], forcing)[1]
    relax_1 = (body.damping_1 + body.coupling_damping) / body.mass_1
    relax_2 = (body.damping_2 + body.coupling_damping) / body.mass_2
    units_1, units_2 = (speed_1, force_1, relax_1, s, tolerance), (speed_2, force_2, relax_2, s, tolerance)
    first = _of_contact(scene.first, mode.signs[0], (y[1], rates[1]), units_1, (w[0], N[0], F[0]))
    second = _of_contact(scene.second, mode.signs[1], (y[3], rates[3]), units_2, (w[1], N[1], F[1]))
    unbalanced = pair.imbalance(body, motion, w, N, F) / _UNBALANCED
    return larger(larger(first, second), unbalanced), pair.power(body, motion, F)


@audit.energy_of.implements(pair.BeltPair)
def _energy_of_pair(scene, forcing, y):
    """Implement :func:`audit.energy_of`."""
    return pair.energy(scene.body, motion_of(y, forcing))


@audit.least_scales.implements(pair.BeltPair)
def _least_scales_of_pair(batch):
    """Implement :func:`audit.least_scales`: the larger of those of both masses."""
    found = [audit.least_scales(mass) for mass in (batch.first, batch.second)]
    return {key: np.maximum(*(scales[key] for scales in found)) for key in found[0]}


def _of_masses(found):
    """Outcomes of each mass by their names on a belt."""
    for i in "12":
        of_mass = {name[:-2]: numbers for name, numbers in vars(found).items() if name.endswith(f"_{i}")}
        yield SimpleNamespace(regime=of_mass["motion"], **of_mass)


@audit.undecided.implements(pair.BeltPair)
def _undecided_of_pair(batch, one, other, fall_rates):
    """Implement :func:`audit.undecided`: what is undecided of one mass."""
    masses = zip((batch.first, batch.second), _of_masses(one), _of_masses(other), strict=True)
    return np.logical_or(*(audit.undecided(*mass, fall_rates) for mass in masses))


@audit.same_statistics.implements(pair.BeltPair)
def _same_statistics_of_pair(batch, one, other):
    """Implement :func:`audit.same_statistics`: those of both masses."""
    masses = zip((batch.first, batch.second), _of_masses(one), _of_masses(other), strict=True)
    return np.logical_and(*(audit.same_statistics(*mass) for mass in masses))
