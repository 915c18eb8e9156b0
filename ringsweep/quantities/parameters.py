"""What a number of the scene is: unit, meaning, admissible interval.

Physics declares its parameters where it defines them, as annotated fields of a
``NamedTuple``; configuration, schema, coordinates of a dataset and messages about
wrong input are all derived from these declarations.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cache
from types import MappingProxyType
from typing import get_type_hints

import numpy as np
from numpy.typing import NDArray

#: A number of one cell, or of every cell of a batch: shape ``(cells,)``.
Leaf = float | NDArray[np.float64]


@dataclass(frozen=True)
class Parameter:
    """One numeric parameter of a scene.

    Attributes
    ----------
    unit : str
        SI unit; ``"1"`` if it has none, ``""`` if it depends on another parameter.
    long_name : str
        What it is, for documentation and coordinate attributes.
    lower, upper : float
        Ends of the admissible interval.
    open_lower, open_upper : bool
        Whether the end itself is excluded.
    default : float or None
        Value where the configuration is silent; None if it must be given.
    optional : bool
        True where silence is allowed and means "derived from the others".
    """

    unit: str
    long_name: str
    lower: float = -math.inf
    upper: float = math.inf
    open_lower: bool = False
    open_upper: bool = False
    default: float | None = None
    optional: bool = False

    def allows(self, value: float) -> bool:
        """Whether a finite `value` lies within the interval."""
        above = value > self.lower if self.open_lower else value >= self.lower
        below = value < self.upper if self.open_upper else value <= self.upper
        return math.isfinite(value) and above and below

    @property
    def attributes(self) -> dict[str, str]:
        """CF attributes."""
        return {"long_name": self.long_name, "units": self.unit or "1"}

    def along_a_line(self) -> Parameter:
        """The same quantity where what turns on a ring moves along a line: m in place of rad."""
        name = self.long_name.replace("angular velocity of the ring", "velocity of the belt")
        name = name.replace("ring's angular velocity", "belt's velocity").replace("rocking angle", "displacement")
        name = name.replace("angle of the ring", "displacement of the belt")
        unit = {"rad": "m", "rad/s": "m/s"}.get(self.unit, self.unit)
        return replace(self, long_name=name, unit=unit if "phase" not in name else self.unit)

    @property
    def interval(self) -> str:
        """The admissible interval in words, such as ``"greater than 0"``."""
        parts = []
        if math.isfinite(self.lower):
            parts.append(f"{'greater than' if self.open_lower else 'at least'} {self.lower:.6g}")
        if math.isfinite(self.upper):
            parts.append(f"{'less than' if self.open_upper else 'at most'} {self.upper:.6g}")
        return " and ".join(parts) or "any finite number"


@dataclass(frozen=True)
class Choice:
    """One of several names, where a parameter is a number.

    Attributes
    ----------
    long_name : str
        What is chosen.
    names : tuple of str
        What there is to choose from.
    """

    long_name: str
    names: tuple[str, ...]

    @property
    def attributes(self) -> dict[str, str]:
        """CF attributes; a name has no unit."""
        return {"long_name": self.long_name}


@cache
def declared(cls: type) -> Mapping[str, Parameter]:
    """Parameters that a ``NamedTuple`` class declares by ``Annotated`` fields."""
    found = {}
    for name, hint in get_type_hints(cls, include_extras=True).items():
        for note in getattr(hint, "__metadata__", ()):
            if isinstance(note, Parameter):
                found[name] = note
    return MappingProxyType(found)
