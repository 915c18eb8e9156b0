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
    """A structure, its values in SI units by dotted path, and the mapping that they came from."""

    structure: Structure
    values: Mapping[str, float]
    source: Mapping[str, Any] = field(default_factory=dict)


def require(allowed: Any, path: str, values: Any, problem: str) -> None:
    """Raise an `InputError` that names the first of `values` for which `allowed` is false."""
    allowed, values = np.broadcast_arrays(np.atleast_1d(allowed), np.atleast_1d(values))
    if not allowed.all():
        raise InputError(f"scene.{path}", problem.format(f"{values[~allowed][0]:.6g}"))
