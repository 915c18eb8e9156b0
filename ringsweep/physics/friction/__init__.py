"""Friction laws: to add a law is to write a class, its formula and its name in one file.

Every law gives a coefficient of friction, the force per unit of the normal load. So one law serves the belt under the
weight of its body, and the ring under reactions that vary. ``docs/extending.md`` shows how a law is written.
"""

from ringsweep.physics.friction import bristles, coulomb, regularised
from ringsweep.physics.friction.registry import (
    LAWS,
    TRAITS,
    Dynamic,
    SetValued,
    Smooth,
    Traits,
    add_law,
    coefficients_of,
    family,
    family_of,
)

for _laws in (coulomb.LAWS, regularised.LAWS, bristles.LAWS):
    for _name, (_law, _traits) in _laws.items():
        add_law(_name, _law, _traits)

__all__ = [
    "LAWS",
    "TRAITS",
    "Dynamic",
    "SetValued",
    "Smooth",
    "Traits",
    "add_law",
    "coefficients_of",
    "family",
    "family_of",
]
