"""Cells of a sweep: the values that each has, and the task of computing a task of them."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from time import perf_counter
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ringsweep.config import Axes, Config
from ringsweep.models import MODELS, batch
from ringsweep.models.scene import LAW, Scene, Values
from ringsweep.quantities.variables import OUTCOMES
from ringsweep.solvers.certificate import with_errors
from ringsweep.solvers.method import Result
from ringsweep.storage.chunks import Layout
from ringsweep.storage.provenance import environment, processor

#: Where along each dimension cells lie, by name of the dimension.
Place = Mapping[str, NDArray[np.intp]]

# What of this process has been compiled.
_warm: set[Any] = set()


def cells(scene: Scene, axes: Axes, indices: NDArray[np.intp]) -> Values:
    """Values of every numeric path in the cells with these flat indices, each of shape ``(len(indices),)``."""
    place = np.unravel_index(indices, tuple(axes.sizes.values()) or (1,))
    return values_at(scene, axes, dict(zip(axes.sizes, place, strict=False)), len(indices))


def values_at(scene: Scene, axes: Axes, place: Place, count: int) -> dict[str, NDArray[np.float64]]:
    """Values of every numeric path in `count` cells, given where along each dimension they lie."""
    values = {path: np.full(count, value) for path, value in scene.values.items()}
    for path, (dims, column) in axes.columns.items():
        if path != LAW:
            values[path] = np.ascontiguousarray(column[tuple(place[dim] for dim in dims)], dtype=float)
    return values


def laws_at(scene: Scene, axes: Axes, place: Place, count: int) -> NDArray[np.str_]:
    """Names of the friction laws of `count` cells, given where along each dimension they lie."""
    if LAW not in axes.columns:
        return np.full(count, scene.structure.law)
    dims, names = axes.columns[LAW]
    return np.asarray(names[tuple(place[dim] for dim in dims)])


@dataclass(frozen=True)
class Finished:
    """A task of cells: where they stand, their outcomes, and what they cost."""

    positions: NDArray[np.integer]
    columns: dict[str, NDArray[Any]]
    seconds: float | None
    """None if kernels may have been compiled meanwhile."""
    environment: dict[str, str]
    processor: str


@dataclass(frozen=True)
class ComputeCells:
    """The task of computing the cells at some positions, which other machines can take too."""

    config: Config
    layout: Layout

    def __call__(self, positions: NDArray[np.integer]) -> Finished:
        scene, axes = self.config.scene, self.config.axes
        place = dict(zip(axes.sizes, self.layout.indices(positions), strict=True))
        # Numbers of a table are nothing to the compiler.
        warm = self.config.solver, *(replace(structure, table=None) for structure in scene.structures.values())
        cold = warm not in _warm
        begin = perf_counter()
        columns: dict[str, NDArray[Any]] = {}
        names = MODELS[scene.structure.model].outcomes
        laws = laws_at(scene, axes, place, len(positions))
        for law, structure in scene.structures.items():
            own = np.flatnonzero(laws == law)
            if not len(own):
                continue
            # The law decides what is compiled: no batch has two.
            here = {dim: along[own] for dim, along in place.items()}
            result = self.config.solver.run(batch(structure, values_at(scene, axes, here, len(own))), names)
            for name, column in _columns(names, result):
                columns.setdefault(name, np.empty(len(positions), dtype=OUTCOMES[name].dtype))[own] = column
        seconds = perf_counter() - begin
        _warm.add(warm)
        absent = MODELS[scene.structure.model].absent
        kept = {name: column for name, column in columns.items() if name not in absent}
        return Finished(positions, kept, None if cold else seconds, environment(), processor())


def _columns(outcomes: tuple[str, ...], result: Result) -> Iterator[tuple[str, NDArray[Any]]]:
    yield from zip(outcomes, result.rows.T, strict=True)
    yield "steps", result.steps
    yield "certified", result.certified
    if result.stiffness is not None:
        yield "stiffness", result.stiffness
    if result.errors is not None:
        yield from zip((f"{name}_error" for name in with_errors(outcomes)), result.errors.T, strict=True)
