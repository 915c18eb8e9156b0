"""Friction laws. ``docs/extending.md`` shows how to add one.

Every law gives a coefficient of friction, the force per unit of the normal load. So the same law holds on the belt,
where the load is the weight of the body, and on the ring, where the reactions vary.
"""

from importlib import import_module
from pkgutil import iter_modules

from ringsweep.physics.friction import bristles, laws, rate_and_state  # noqa: F401
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

for _name, (_law, _traits) in (bristles.LAWS | rate_and_state.LAWS).items():
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

# A file that is put into this folder registers what it holds.
for _module in iter_modules(__path__):
    import_module(f"{__name__}.{_module.name}")
