"""Sweeps: cells to chunks, chunks to workers, outcomes to a dataset."""

from __future__ import annotations

import json
import math
import os
import platform
import sys
from collections.abc import Iterator, Mapping
from importlib.metadata import version
from typing import Any

import joblib
import numpy as np
import xarray as xr
from numpy.typing import NDArray
from tqdm.auto import tqdm

from ringsweep.config import Axes, Config, load, read_axes, read_scene, read_solver, sweepable
from ringsweep.jit import SOURCES_DIGEST
from ringsweep.models import MODELS, batch
from ringsweep.scene import LAW, Scene, Structure, Values
from ringsweep.solvers.common import Result
from ringsweep.variables import OUTCOMES

# A task of fewer cells is overhead where there are many of them.
_LEAST = 8


def run(
    config: str | os.PathLike[str] | Mapping[str, Any], *, jobs: int | None = None, progress: bool = True
) -> xr.Dataset:
    """Run the sweep that a configuration describes.

    Parameters
    ----------
    config : path or mapping
        A YAML file, or the mapping that it would hold.
    jobs : int, optional
        Threads; all cores unless given.
    progress : bool
        Whether to show a progress bar where there is a terminal or a notebook.

    Returns
    -------
    xarray.Dataset
        One dimension per swept path; see :data:`ringsweep.variables.OUTCOMES`.

    Raises
    ------
    InputError
        If the configuration is wrong.
    """
    return compute(load(config), jobs=jobs, progress=progress)


def sweep(
    scene: Mapping[str, Any],
    axes: Mapping[str, Any],
    *,
    solver: str | Mapping[str, Any] = "auto",
    jobs: int | None = None,
    progress: bool = True,
) -> xr.Dataset:
    """Run a scene over axes.

    Parameters
    ----------
    scene : mapping
        The configuration's ``scene``.
    axes : mapping of str to sequence or xarray.DataArray
        Values for paths of the scene, such as ``"drive.amplitude"``, and names for ``"friction.law"``.
        A 1-D sequence is a grid axis; ``DataArray`` that share a dimension vary together along it.
    solver : str or mapping
        A method's name, or the configuration's ``solver``.
    jobs, progress
        As for :func:`run`.

    Returns
    -------
    xarray.Dataset

    Raises
    ------
    InputError
        If scene, axes or solver are wrong.
    """
    parsed = read_scene(scene, swept=axes)
    found = read_axes(parsed, axes)
    method = {"method": solver} if isinstance(solver, str) else dict(solver)
    source = {"scene": dict(parsed.source), "solver": method, "sweep": _as_sweep(found)}
    chosen = read_solver(method, parsed)
    config = Config(scene=parsed, solver=chosen, axes=found, source=source, name="ringsweep")
    return compute(config, jobs=jobs, progress=progress)


def _as_sweep(axes: Axes) -> dict[str, Any]:
    """Axes as the configuration would give them; what varies over several dimensions becomes points."""
    shared = {dim for dims, _ in axes.columns.values() if len(dims) > 1 for dim in dims}
    names = [dims for dims, _ in axes.columns.values()]
    shared |= {dims[0] for dims in names if names.count(dims) > 1}
    grid = {path: values.tolist() for path, (dims, values) in axes.columns.items() if shared.isdisjoint(dims)}
    sizes = {dim: size for dim, size in axes.sizes.items() if dim in shared}
    index = np.unravel_index(np.arange(math.prod(sizes.values())), tuple(sizes.values())) if sizes else ()
    place = dict(zip(sizes, index, strict=True))
    points = {
        path: values[tuple(place[dim] for dim in dims)].tolist()
        for path, (dims, values) in axes.columns.items()
        if not shared.isdisjoint(dims)
    }
    return {name: part for name, part in (("points", points), ("grid", grid)) if part}


def compute(config: Config, *, jobs: int | None, progress: bool) -> xr.Dataset:
    """Run a validated configuration; see :func:`run`."""
    axes, scene = config.axes, config.scene
    outcomes = MODELS[scene.structure.model].outcomes
    total = math.prod(axes.sizes.values())
    jobs = jobs or joblib.cpu_count()
    tasks = [
        (structure, part)
        for structure, own in _by_law(scene, axes)
        for part in _parts(own, config.solver.cells_per_task, jobs)
    ]
    parallel = joblib.Parallel(n_jobs=jobs, prefer="threads", return_as="generator_unordered")
    results = parallel(joblib.delayed(_task)(config, structure, chunk, outcomes) for structure, chunk in tasks)

    columns: dict[str, NDArray[Any]] = {}
    with progress_bar(total, progress) as bar:
        for chunk, result in results:
            for name, column in _columns(outcomes, result):
                columns.setdefault(name, np.full(total, np.nan))[chunk] = column
            bar.update(len(chunk))
    return _dataset(config, columns)


def _parts(cells: NDArray[np.intp], most: int, jobs: int) -> Iterator[NDArray[np.intp]]:
    """Cells in tasks of `most` at most, the last ones smaller so that no job is left with a large one alone."""
    least = min(_LEAST, math.ceil(len(cells) / (4 * jobs)))
    start = 0
    while start < len(cells):
        size = min(most, max(least, math.ceil((len(cells) - start) / (4 * jobs))))
        yield cells[start : start + size]
        start += size


def cells(scene: Scene, axes: Axes, indices: NDArray[np.intp]) -> Values:
    """Values of every numeric path in the cells with these flat indices, each of shape ``(len(indices),)``."""
    values = {path: np.full(len(indices), value) for path, value in scene.values.items()}
    place = _places(axes, indices)
    for path, (dims, column) in axes.columns.items():
        if path != LAW:
            values[path] = np.ascontiguousarray(column[tuple(place[dim] for dim in dims)], dtype=float)
    return values


def _places(axes: Axes, indices: NDArray[np.intp]) -> dict[str, NDArray[np.intp]]:
    """Where along each dimension the cells with these flat indices lie."""
    return dict(zip(axes.sizes, np.unravel_index(indices, tuple(axes.sizes.values()) or (1,)), strict=False))


def _by_law(scene: Scene, axes: Axes) -> Iterator[tuple[Structure, NDArray[np.intp]]]:
    """Flat indices of the cells under each friction law: one decides what is compiled, so that no task has two."""
    every = np.arange(math.prod(axes.sizes.values()))
    if LAW not in axes.columns:
        yield scene.structure, every
        return
    place = _places(axes, every)
    dims, names = axes.columns[LAW]
    for law, structure in scene.structures.items():
        yield structure, every[(names == law)[tuple(place[dim] for dim in dims)]]


def _task(
    config: Config, structure: Structure, chunk: NDArray[np.intp], outcomes: tuple[str, ...]
) -> tuple[NDArray[np.intp], Result]:
    part = batch(structure, cells(config.scene, config.axes, chunk))
    return chunk, config.solver.run(part, outcomes)


def _columns(outcomes: tuple[str, ...], result: Result) -> Iterator[tuple[str, NDArray[Any]]]:
    yield from zip(outcomes, result.rows.T, strict=True)
    yield "steps", result.steps
    yield "certified", result.certified
    if result.stiffness is not None:
        yield "stiffness", result.stiffness


def progress_bar(total: int, progress: bool) -> Any:
    """A bar of so many runs, where there is a terminal or a notebook to show it."""
    # tqdm takes a notebook's stream for a pipe and would stay silent there.
    notebook = "ipykernel" in sys.modules
    return tqdm(total=total, unit="run", disable=(False if notebook else None) if progress else True)


def _dataset(config: Config, columns: Mapping[str, NDArray[Any]]) -> xr.Dataset:
    """Label the columns of a sweep."""
    axes, scene = config.axes, config.scene
    model = MODELS[scene.structure.model]
    known = sweepable(scene)
    shape = tuple(axes.sizes.values())
    dataset = xr.Dataset(
        {
            name: (tuple(axes.sizes), column.reshape(shape).astype(OUTCOMES[name].dtype), OUTCOMES[name].attributes)
            for name, column in columns.items()
            if name not in model.absent
        },
        coords={
            path.replace(".", "_"): (dims, column, {**known[path].attributes, "path": path})
            for path, (dims, column) in axes.columns.items()
        },
    )
    return dataset.assign_attrs(provenance(config))


def provenance(config: Config) -> dict[str, Any]:
    """Attributes from which a file's contents can be computed again."""
    return {
        "Conventions": "CF-1.11",
        "title": f"ringsweep: {MODELS[config.scene.structure.model].doc}",
        "source": f"ringsweep {version('ringsweep')}",
        "ringsweep_version": version("ringsweep"),
        "ringsweep_sources": SOURCES_DIGEST,
        "versions": json.dumps(
            {"python": platform.python_version()} | {name: version(name) for name in ("numpy", "numba", "xarray")}
        ),
        "method": config.solver.name,
        "configuration": json.dumps(config.source, sort_keys=True),
    }
