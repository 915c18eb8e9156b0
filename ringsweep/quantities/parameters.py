"""Numbers of a scene: unit, meaning, admissible interval.

Physics declares its parameters where it defines them, as annotated fields of a ``NamedTuple``. Configuration, schema,
coordinates of a dataset and error messages are derived from these declarations.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from functools import cache
from types import MappingProxyType
from typing import Any, get_type_hints

import numpy as np
from numpy.typing import NDArray

from ringsweep.quantities.quantity import Quantity

#: A number of one cell, or of every cell of a batch: shape ``(cells,)``.
Leaf = float | NDArray[np.float64]


@dataclass(frozen=True)
class Parameter(Quantity):
    """One numeric parameter of a scene or of a solver.

    Attributes
    ----------
    unit, long_name : str
        As for :class:`ringsweep.quantities.quantity.Quantity`.
    lower, upper : float
        Ends of the admissible interval.
    open_lower, open_upper : bool
        Whether the end itself is excluded.
    default : float or None
        Value if the configuration gives none; None if it must give one.
    optional : bool
        Whether the configuration may leave it out although it has no default: it then follows from other parameters.
    whole : bool
        Whether it must be a whole number.
    unit_in_words : str
        Unit that depends on another parameter, for messages; its `unit` is empty.
    """

    lower: float = -math.inf
    upper: float = math.inf
    open_lower: bool = False
    open_upper: bool = False
    default: float | None = None
    optional: bool = False
    whole: bool = False
    unit_in_words: str = ""

    @property
    def attributes(self) -> dict[str, Any]:
        """CF attributes. A value that is given has no default, so the name does not tell one."""
        return super().attributes | {"long_name": self.long_name.partition(" (default: ")[0]}

    def allows(self, value: float) -> bool:
        """Whether a finite `value` lies within the interval."""
        above = value > self.lower if self.open_lower else value >= self.lower
        below = value < self.upper if self.open_upper else value <= self.upper
        return math.isfinite(value) and above and below

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
class Key:
    """A key of a configuration whose value is no number.

    Attributes
    ----------
    long_name : str
    names : mapping of str to str, optional
        Names to choose from, and what each says; empty texts if the names tell it.
    default : str or bool, optional
        A default that is true or false allows nothing else.
    example : str
        A value, for the message about a key that is missing; without one it may be.
    """

    long_name: str
    names: Mapping[str, str] = field(default_factory=dict)
    default: str | bool | None = None
    example: str = ""

    @property
    def attributes(self) -> dict[str, str]:
        """CF attributes; a name has no unit."""
        return {"long_name": self.long_name}


@cache
def declared(cls: type) -> Mapping[str, Any]:
    """Parameters and keys that a class declares by ``Annotated`` fields; ``Annotated[int, ...]`` is a whole number."""
    found = {}
    for name, hint in get_type_hints(cls, include_extras=True).items():
        for note in getattr(hint, "__metadata__", ()):
            if isinstance(note, Parameter):
                note = replace(note, whole=note.whole or hint.__origin__ is int)
            if isinstance(note, Parameter | Key):
                found[name] = note
    return MappingProxyType(found)
