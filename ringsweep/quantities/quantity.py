"""What every number of a scene or of a dataset has: a unit and a meaning."""

from __future__ import annotations

import re
from dataclasses import dataclass
from functools import cache
from typing import Any

_FACTOR = re.compile(r"([\s*/·]*)([A-Za-zµμ°%_]+)(?:\^|\*\*)?(-?[0-9]*)")


@dataclass(frozen=True)
class Quantity:
    """A physical quantity.

    Attributes
    ----------
    unit : str
        SI unit as people write it, such as ``"rad/s"`` or ``"kg m^2"``; ``"1"`` if there is none, ``""`` if it depends
        on another quantity.
    long_name : str
        Meaning, for documentation, messages and the attributes of a dataset.
    """

    unit: str
    long_name: str

    @property
    def units(self) -> str:
        """Unit as files write it, such as ``"rad s-1"`` or ``"kg m2"``."""
        return cf_units(self.unit)

    @property
    def attributes(self) -> dict[str, Any]:
        """CF attributes."""
        return {"long_name": self.long_name, "units": self.units}


def after_number(unit: str) -> str:
    """Unit as it follows a number in a text: with a space, or empty if there is none."""
    return "" if unit in ("", "1") else f" {unit}"


@cache
def cf_units(unit: str) -> str:
    """Unit in the spelling of the CF conventions.

    Parameters
    ----------
    unit : str
        Unit names with powers, divided by ``/`` or not: ``"m/s^2"``, ``"kg*m**2"``, ``"rad s-1"``.

    Returns
    -------
    str
        Names with powers, separated by spaces: ``"m s-2"``, ``"kg m2"``, ``"rad s-1"``; ``"1"`` without a unit.
    """
    factors = []
    for separator, name, power in _FACTOR.findall(unit):
        exponent = int(power or 1) * (-1 if "/" in separator else 1)
        factors.append(name if exponent == 1 else f"{name}{exponent}")
    return " ".join(factors) or "1"
