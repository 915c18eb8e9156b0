"""A scene: which model, law and drive it is made of, and the numbers that fill them.

The *structure* of a scene decides what is compiled; its *values*, keyed by dotted path, are what a
sweep varies.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ringsweep.errors import InputError

Values = Mapping[str, NDArray[np.float64]]

#: Path of the friction law: the one choice, among numbers, that a sweep can go through.
LAW = "friction.law"


@dataclass(frozen=True)
class Structure:
    """Everything of a scene that is not a number.

    Attributes
    ----------
    model, law, drive : str
        Names in the registries of models, friction laws and drives.
    arcs : tuple of str
        Paths under which the rough arcs stand: ``()``, ``("zone",)`` or ``("zones.0", "zones.1", ...)``.
    table : tuple of ndarray, optional
        Times (s) and angles (rad), each of shape ``(samples,)``, of a tabulated drive.
    """

    model: str
    law: str
    drive: str = "none"
    arcs: tuple[str, ...] = ()
    table: tuple[NDArray[np.float64], NDArray[np.float64]] | None = None


@dataclass(frozen=True)
class Scene:
    """What a configuration describes.

    Attributes
    ----------
    structures : dict of str to Structure
        By the name of the friction law; several, alike in all else, where a sweep goes through laws.
    values : mapping of str to float
        In SI units by dotted path. Where there are several laws, each finds its own among them.
    source : mapping
        What they came from.
    """

    structures: dict[str, Structure]
    values: Mapping[str, float]
    source: Mapping[str, Any] = field(default_factory=dict)

    @property
    def structure(self) -> Structure:
        """The structure; the first, where a sweep goes through laws."""
        return next(iter(self.structures.values()))


def require(allowed: Any, path: str, values: Any, problem: str) -> None:
    """Raise an `InputError` that names the first of `values` for which `allowed` is false."""
    allowed, values = np.broadcast_arrays(np.atleast_1d(allowed), np.atleast_1d(values))
    if not allowed.all():
        raise InputError(f"scene.{path}", problem.format(f"{values[~allowed][0]:.6g}"))
