"""Cells of a sweep: the values of each cell, and the computation of a task."""

from __future__ import annotations

import logging
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, replace
from threading import Timer
from time import perf_counter
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ringsweep.compile import readable_compile_errors
from ringsweep.config import Axes, Config
from ringsweep.models import batch, model_of
from ringsweep.models.scene import LAW, Scene
from ringsweep.quantities.variables import OUTCOMES
from ringsweep.solvers.certificate import with_errors
from ringsweep.solvers.method import Result
from ringsweep.storage.chunks import Layout
from ringsweep.storage.provenance import environment, processor

#: Index of each cell along each dimension, by name of the dimension.
Indices = Mapping[str, NDArray[np.intp]]

logger = logging.getLogger("ringsweep")

#: Seconds after which a task that still runs is named; most take less than two.
LONG = 60.0

# Solvers and structures whose kernels this process has compiled.
_compiled: set[Any] = set()


def values_of_cells(scene: Scene, axes: Axes, numbers: NDArray[np.intp]) -> dict[str, NDArray[np.float64]]:
    """Values of every numeric path in cells that are given by their numbers, the last dimension varying fastest.

    Returns
    -------
    dict of str to ndarray of shape ``(len(numbers),)``
    """
    indices = np.unravel_index(numbers, tuple(axes.sizes.values()) or (1,))
    return values_at(scene, axes, dict(zip(axes.sizes, indices, strict=False)), len(numbers))


def values_at(scene: Scene, axes: Axes, indices: Indices, count: int) -> dict[str, NDArray[np.float64]]:
    """Values of every numeric path in `count` cells, each of shape ``(count,)``."""
    values = {path: np.full(count, value) for path, value in scene.values.items()}
    for path, (dims, column) in axes.columns.items():
        if path != LAW:
            values[path] = np.ascontiguousarray(column[tuple(indices[dim] for dim in dims)], dtype=float)
    return values


def laws_at(scene: Scene, axes: Axes, indices: Indices, count: int) -> NDArray[np.str_]:
    """Names of the friction laws in `count` cells, shape ``(count,)``."""
    if LAW not in axes.columns:
        return np.full(count, scene.structure.law)
    dims, names = axes.columns[LAW]
    return np.asarray(names[tuple(indices[dim] for dim in dims)])


@dataclass(frozen=True)
class TaskResult:
    """Outcomes of the cells of a task.

    Attributes
    ----------
    positions : ndarray of shape ``(cells,)``
        Positions of the cells in the order of the layout.
    columns : dict of str to ndarray of shape ``(cells,)``
        Outcomes by name of the variable.
    seconds : float, optional
        Run time; None if kernels may have been compiled meanwhile.
    environment : dict of str to str
        Versions of the process that computed it.
    processor : str
        Name of its processor.
    """

    positions: NDArray[np.integer]
    columns: dict[str, NDArray[Any]]
    seconds: float | None
    environment: dict[str, str]
    processor: str


def compute_task(config: Config, layout: Layout, positions: NDArray[np.integer]) -> TaskResult:
    """Compute the cells at some positions of the layout."""
    scene, axes = config.scene, config.axes
    model = model_of(scene.structure)
    indices = dict(zip(axes.sizes, layout.indices(positions), strict=True))
    # Kernels depend on the paths that have a value, but not on the numbers of a table.
    structures = (replace(one, table=None, force=None, curve=None) for one in scene.structures.values())
    compiled = config.solver, frozenset((*scene.values, *axes.columns)), *structures
    compiles = compiled not in _compiled
    start = perf_counter()
    columns: dict[str, NDArray[Any]] = {}
    laws = laws_at(scene, axes, indices, len(positions))
    # Each law has kernels of its own, so a batch has one law.
    for law, structure in scene.structures.items():
        own = np.flatnonzero(laws == law)
        if not len(own):
            continue
        values = values_at(scene, axes, {dim: along[own] for dim, along in indices.items()}, len(own))
        with readable_compile_errors(), _named_if_long(axes, indices, compiles):
            began = perf_counter()
            result = config.solver.run(batch(structure, values), model.outcomes)
            # A compilation would count as time of the cells.
            if not compiles and (took := perf_counter() - began) >= LONG:
                _name_longest(axes, {dim: along[own] for dim, along in indices.items()}, result, took)
        # A bound beyond the range of a float of 32 bits is infinite.
        with np.errstate(over="ignore"):
            for name, column in _columns(model.outcomes, result):
                if name not in model.absent:
                    columns.setdefault(name, np.empty(len(positions), dtype=OUTCOMES[name].dtype))[own] = column
    seconds = perf_counter() - start
    _compiled.add(compiled)
    return TaskResult(positions, columns, None if compiles else seconds, environment(), processor())


@contextmanager
def _named_if_long(axes: Axes, indices: Indices, compiles: bool) -> Iterator[None]:
    """Name the cells of a task, and say why one may be slow, if the block takes long."""
    timer = Timer(
        LONG,
        logger.info,
        (
            "not done after %g s: %s; %sevents, or friction that changes within a tiny speed, take many steps",
            LONG,
            _place(axes, indices),
            "kernels are still compiled, or " * compiles,
        ),
    )
    timer.daemon = True
    timer.start()
    try:
        yield
    finally:
        timer.cancel()


def _name_longest(axes: Axes, indices: Indices, result: Result, seconds: float) -> None:
    """Name the cell that took most of a long task, and say which limit of steps stands for a minute."""
    longest = int(np.argmax(result.steps))
    place = _place(axes, {dim: along[longest : longest + 1] for dim, along in indices.items()})
    most, total = float(result.steps[longest]), max(float(result.steps.sum()), 1.0)
    logger.info(
        "%s took %.2g steps, %.2g s; a run of %.2g steps takes a minute here: solver.max_steps bounds each",
        place,
        most,
        seconds * most / total,
        60.0 * total / seconds,
    )


def _place(axes: Axes, indices: Indices) -> str:
    """Values of some cells, or the ends of their ranges, in words."""
    words = []
    for path, (dims, column) in axes.columns.items():
        found = np.unique(column[tuple(indices[dim] for dim in dims)])
        ends = dict.fromkeys(one if isinstance(one, str) else f"{one:g}" for one in (found[0], found[-1]))
        words.append(f"{path} = {' to '.join(ends)}")
    return f"{', '.join(words)} (SI units)" if words else "the run"


def _columns(outcomes: tuple[str, ...], result: Result) -> Iterator[tuple[str, NDArray[Any]]]:
    yield from zip(outcomes, result.rows.T, strict=True)
    yield "steps", result.steps
    yield "certified", result.certified
    if result.because is not None:
        yield "uncertified_because", result.because
    if result.stiffness is not None:
        yield "stiffness", result.stiffness
    if result.errors is not None:
        yield from zip((f"{name}_error" for name in with_errors(outcomes)), result.errors.T, strict=True)
