"""The key ``sweep.refine``: which cells of a grid are computed, and which are inferred."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from ringsweep.config.axes import Axes, dimension
from ringsweep.config.sections import Key, Keys, one_of, read_keys
from ringsweep.errors import InputError
from ringsweep.quantities.parameters import Parameter
from ringsweep.quantities.units import show

#: Keys of ``sweep.refine``.
KEYS: Keys = {
    "stride": Parameter("1", "cells from one cell of the first round to the next", lower=1, upper=1024, whole=True,
                        default=32),
    "audit": Parameter("1", "share of the inferred cells that is computed after all", lower=0, upper=1, default=0.02),
    "axes": Key("one or two paths that are refined (default: the longest two)"),
}  # fmt: skip


@dataclass(frozen=True)
class Refinement:
    """How a grid is refined.

    Attributes
    ----------
    dims : tuple of str
        Dimensions that are refined, one or two; along the others the map is a stack.
    stride : int
        Cells from one cell of the first round to the next.
    audit : float
        Share of the inferred cells that is computed after all.
    """

    dims: tuple[str, ...]
    stride: int
    audit: float


def read_refinement(given: Any, axes: Axes) -> Refinement | None:
    """Read and validate the value under ``sweep.refine``, or under ``refine`` in Python.

    Parameters
    ----------
    given : mapping or bool or None
        True stands for the defaults.
    axes : Axes

    Raises
    ------
    InputError
        If a key or value is wrong, or the sweep is no grid.
    """
    if given is None or given is False:
        return None
    section = read_keys({} if given is True else given, KEYS, "sweep.refine")
    return Refinement(_dims(section["axes"], axes), section["stride"], section["audit"])


def _dims(given: Any, axes: Axes) -> tuple[str, ...]:
    """The dimensions that are refined: those named, or the two longest."""
    columns = {path: values for path, (_, values) in axes.columns.items() if values.dtype.kind == "f"}
    for path, (dims, _) in axes.columns.items():
        if dims != (dimension(path),):
            problem = f"varies along {' x '.join(dims)}, but only a grid can be refined: a point has no neighbours"
            raise InputError("sweep.refine", f"{path} {problem}")
    names = {path: values for path, values in columns.items() if len(values) > 1}
    if not names:
        raise InputError("sweep.refine", "the sweep has no grid axis of two or more numbers: nothing can be refined")
    chosen = sorted(names, key=lambda path: -len(names[path]))[:2] if given is None else given
    if not isinstance(chosen, list) or not 1 <= len(chosen) <= 2 or len(set(map(str, chosen))) != len(chosen):
        raise InputError("sweep.refine.axes", f"one or two paths of sweep.grid are expected, got {show(given)}")
    for k, path in enumerate(chosen):
        problem = "is an axis of one value" if path in columns else "is no axis of numbers"
        one_of(path, names, f"sweep.refine.axes.{k}", problem)
        steps = np.diff(names[path])
        if not ((steps > 0).all() or (steps < 0).all()):
            problem = "values go up and down: along an axis that is refined they must ascend or descend"
            raise InputError(f"sweep.grid.{path}", problem)
    # In the order of the grid.
    return tuple(dimension(path) for path in names if path in chosen)
