"""Cells of a sweep: the values of each cell, and the computation of a task."""

from __future__ import annotations

from collections.abc import Hashable, Iterator, Mapping
from dataclasses import dataclass, replace
from itertools import groupby
from time import perf_counter
from typing import Any

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from ringsweep.compile import readable_compile_errors, take
from ringsweep.config import Axes, Config, sweepable
from ringsweep.config.axes import Indices, by_law, dimension, values_at
from ringsweep.config.options import DIRECTION
from ringsweep.models import batch, model_of
from ringsweep.models.model import Continues
from ringsweep.models.scene import Scene, Structure
from ringsweep.physics.drives import turn
from ringsweep.quantities.flags import FAILED
from ringsweep.quantities.variables import OUTCOMES
from ringsweep.solvers.certificate import with_errors
from ringsweep.solvers.method import Result
from ringsweep.storage.chunks import Layout
from ringsweep.storage.provenance import environment, processor

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


def coordinates(scene: Scene, columns: Mapping[str, tuple[Any, Any]]) -> dict[str, Any]:
    """Coordinates of a dataset by name: dimensions, values and attributes of paths that vary."""
    known = sweepable(scene)
    return {
        dimension(path): (dims, column, {**known[path].attributes, "path": path})
        for path, (dims, column) in columns.items()
    }


@dataclass(frozen=True)
class TaskResult:
    """Outcomes of the cells of a task.

    Attributes
    ----------
    positions : ndarray of shape ``(cells,)``
        Positions of the cells in the order of the layout.
    columns : dict of str to ndarray of shape ``(cells,)`` or ``(cells, points)``
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


def kernels_of(config: Config) -> Hashable:
    """What decides which kernels the cells of a sweep compile."""
    # They depend on the paths that have a value, but not on the numbers of a table.
    structures = (
        replace(one, table=None, force=None, load=None, curve=None) for one in config.scene.structures.values()
    )
    return config.solver, frozenset((*config.scene.values, *config.axes.columns)), *structures


def compute_task(config: Config, layout: Layout, positions: NDArray[np.integer]) -> TaskResult:
    """Compute the cells at some positions of the layout."""
    scene, axes = config.scene, config.axes
    indices = dict(zip(axes.sizes, layout.indices(positions), strict=True))
    compiled = kernels_of(config)
    compiles = compiled not in _compiled
    start = perf_counter()
    columns: dict[str, NDArray[Any]] = {}
    for structure, own, values in by_law(scene, axes, indices, len(positions)):
        with readable_compile_errors():
            for cells, found in _runs(config, structure, {dim: along[own] for dim, along in indices.items()}, values):
                # A bound beyond the range of a float of 32 bits is infinite.
                with np.errstate(over="ignore"):
                    for name, column in found.items():
                        columns.setdefault(name, _missing(name, len(positions), column))[own[cells]] = column
    seconds = perf_counter() - start
    _compiled.add(compiled)
    # A compilation would count as time of the cells.
    return TaskResult(positions, columns, None if compiles else seconds, environment(), processor())


def _missing(name: str, count: int, like: NDArray[Any]) -> NDArray[Any]:
    """Column of a variable in which `count` cells have no value."""
    dtype = np.dtype(OUTCOMES[name].dtype)
    return np.full((count, *like.shape[1:]), np.nan if dtype.kind == "f" else 0, dtype=dtype)


def _runs(
    config: Config, structure: Structure, indices: Indices, values: dict[str, NDArray[np.float64]]
) -> Iterator[tuple[Any, dict[str, NDArray[Any]]]]:
    """Cells of one law that are run side by side, as places in `indices`, and their outcomes."""
    if config.follow is None:
        yield slice(None), _outcomes(config, structure, values)
        return
    before = dict[str, NDArray[Any]]()
    for cells in in_chains(config, indices):
        now, held = _started(structure, {path: column[cells] for path, column in values.items()}, before)
        found = _outcomes(config, structure, now)
        yield cells, found | {"started_from": held.astype(np.int8)}
        before = now | found


def _started(
    structure: Structure, now: dict[str, NDArray[np.float64]], before: Mapping[str, NDArray[Any]]
) -> tuple[dict[str, NDArray[np.float64]], NDArray[np.bool_]]:
    """Values of cells that start where those before them ended, and whether they do: not after runs without an end."""
    model, held = model_of(structure), np.zeros(len(now["time.span"]), dtype=bool)
    assert isinstance(model, Continues)
    if before:
        held = (before["regime"] == before["motion"]) & (before["motion"] != FAILED)
        for path, column in model.continued(structure, now, before).items():
            now[path] = np.where(held, column, now.get(path, _default(structure, path, now)))
    return now | {"time.span": _whole_periods(structure, now)}, held


def start_of(ds: xr.Dataset, config: Config, cell: Mapping[str, int]) -> dict[str, float]:
    """Values of a cell of a sweep that follows an axis, by path, where they differ from those of the scene.

    The cells before it end as the dataset says. `cell` is its index along each dimension.
    """
    assert config.follow is not None
    dim, orders = config.follow.chains(config.axes)
    order = orders[cell.get(DIRECTION, 0)].tolist()
    now, before = dict[str, NDArray[np.float64]](), dict[str, NDArray[Any]]()
    for k in order[: order.index(cell[dim]) + 1]:
        here = {name: np.array([place]) for name, place in {**cell, dim: k}.items()}
        structure, _, values = next(by_law(config.scene, config.axes, here, 1))
        now, _ = _started(structure, values, before)
        ended = ds.drop_dims("section", errors="ignore").isel({**cell, dim: k})
        before = now | {str(name): np.atleast_1d(number.values) for name, number in ended.items()}
    return {path: one.item() for path, one in now.items() if one.item() != config.scene.values.get(path)}


def _default(structure: Structure, path: str, values: Mapping[str, NDArray[np.float64]]) -> NDArray[np.float64]:
    """Values of an optional initial value that a scene lacks: phase 0, or the velocity of the belt."""
    if path != "initial.velocity":
        return np.zeros(len(values["time.span"]))
    drive = batch(structure, values).drive
    return np.array([turn(take(drive, i), 0.0)[1] for i in range(len(values["time.span"]))])


def _whole_periods(structure: Structure, values: Mapping[str, NDArray[np.float64]]) -> NDArray[np.float64]:
    """Spans, each extended to a whole number of periods of the forcing if it is longer than one, s.

    So the phase is the same at the start of all cells of a chain, and their sections can be compared.
    """
    model = model_of(structure)
    assert isinstance(model, Continues)
    span, period = values["time.span"], model.forcing_period(structure, values)
    repeats = period <= span
    periods = np.ceil(span / np.where(repeats, period, 1.0) * (1.0 - 1e-12))
    return np.where(repeats, periods * np.where(repeats, period, 0.0), span)


def in_chains(config: Config, indices: Indices) -> list[NDArray[np.intp]]:
    """Places in `indices` of the cells of whole chains: the first cells of all chains, the second ones, and so on."""
    assert config.follow is not None
    dim, orders = config.follow.chains(config.axes)
    which = indices[DIRECTION] if DIRECTION in indices else np.zeros(len(indices[dim]), dtype=np.intp)
    rank = np.argsort(orders, axis=1)[which, indices[dim]]
    others = [along for name, along in indices.items() if name != dim]
    # The last key is the first by which cells are sorted.
    order = np.lexsort((*others[::-1], rank))
    return np.split(order, np.flatnonzero(np.diff(rank[order])) + 1)


def _outcomes(
    config: Config, structure: Structure, values: Mapping[str, NDArray[np.float64]]
) -> dict[str, NDArray[Any]]:
    model = model_of(structure)
    names = model.columns(structure)
    result = config.solver.run(batch(structure, values), names)
    return {name: column for name, column in _columns(names, result) if name not in model.absent}


def _columns(outcomes: tuple[str, ...], result: Result) -> Iterator[tuple[str, NDArray[Any]]]:
    start = 0
    for name, side_by_side in groupby(outcomes):
        stop = start + len(list(side_by_side))
        # Certificates use numbers that are no outcomes.
        is_wide = name in OUTCOMES and OUTCOMES[name].dims
        yield name, result.rows[:, start:stop] if is_wide else result.rows[:, start]
        start = stop
    yield "steps", result.steps
    yield "certified", result.certified
    for name, column in (("uncertified_because", result.because), ("stiffness", result.stiffness)):
        if column is not None:
            yield name, column
    if result.errors is not None:
        yield from zip((f"{name}_error" for name in with_errors(outcomes)), result.errors.T, strict=True)
