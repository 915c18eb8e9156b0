"""Sweeps: cells to tasks, tasks to workers, outcomes to a dataset in memory or on disk."""

from __future__ import annotations

import logging
import math
import os
from collections.abc import Mapping
from contextlib import ExitStack
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from ringsweep.config import Axes, Config, load, read_axes, read_scene
from ringsweep.config.scene import sweepable
from ringsweep.config.solver import read_solver
from ringsweep.errors import InputError
from ringsweep.quantities.variables import OUTCOMES, linked
from ringsweep.runs.cells import ComputeCells, Finished
from ringsweep.runs.executors import executor, progress_bar, stop_on_interrupt
from ringsweep.runs.pace import Pace
from ringsweep.runs.pace import tasks as tasks_of
from ringsweep.runs.reuse import Earlier
from ringsweep.storage import netcdf
from ringsweep.storage.chunks import Layout
from ringsweep.storage.partial import Columns, Damaged, Partial, owned
from ringsweep.storage.provenance import attributes, differences, environment, identity

logger = logging.getLogger("ringsweep")


#: Cells of a sweep that has no file to go to: some gigabytes.
MOST_IN_MEMORY = 10_000_000


def run(
    config: str | os.PathLike[str] | Mapping[str, Any],
    output: str | os.PathLike[str] | None = None,
    *,
    jobs: int | None = None,
    fresh: bool = False,
    reuse: str | os.PathLike[str] | None = None,
    scheduler: str | None = None,
    progress: bool = True,
) -> xr.Dataset:
    """Run the sweep that a configuration describes.

    Parameters
    ----------
    config : path or mapping
        A YAML file, the mapping that it would hold, or a result file, whose sweep is repeated.
    output : path-like, optional
        NetCDF file to write. Finished cells are kept beside it meanwhile, in memory they are not: the same call goes
        on after whatever stopped it, and the number of cells is bounded by the disk.
    jobs : int, optional
        Threads; all cores unless given.
    fresh : bool
        Whether to start over, whatever is there.
    reuse : path-like, optional
        File of an earlier sweep, some of whose cells are those of this one: they are taken from there.
    scheduler : str, optional
        Address of a Dask scheduler whose workers compute the cells, in place of threads.
    progress : bool
        Whether to show a progress bar where there is a terminal or a notebook.

    Returns
    -------
    xarray.Dataset
        One dimension per swept path; see :data:`ringsweep.quantities.variables.OUTCOMES`. The dataset of an output
        file reads values when they are asked for; ``.load()`` reads all.

    Raises
    ------
    InputError
        If the configuration is wrong, the output cannot be written or is being computed by another process, or the
        tasks beside it are of another sweep.

    Examples
    --------
    A mass on a spring, on belts of three speeds:

    >>> import ringsweep
    >>> config = {
    ...     "scene": {
    ...         "model": "belt",
    ...         "body": {"mass": "1 kg"},
    ...         "spring": {"stiffness": "2 N/m"},
    ...         "belt": {"velocity": "0.1 m/s"},
    ...         "friction": {"law": "stiction", "mu_s": 0.15, "mu_k": 0.1},
    ...         "time": {"span": "60 s"},
    ...     },
    ...     "sweep": {"grid": {"belt.velocity": ["5 cm/s", "10 cm/s", "20 cm/s"]}},
    ... }
    >>> ds = ringsweep.run(config)
    >>> ds.period.round(3).values
    array([12.234,  7.523,  5.414])
    >>> ds.regime.attrs["flag_meanings"].split()[ds.regime.values[0]]
    'stick-slip'
    >>> bool((ds.certified == 1).all())
    True
    """
    return _run(load(config), output, fresh, jobs=jobs, reuse=reuse, scheduler=scheduler, progress=progress)


def _run(config: Config, output: str | os.PathLike[str] | None, fresh: bool, **options: Any) -> xr.Dataset:
    if output is None:
        return compute(config, **options)
    write(config, Path(output), fresh=fresh, **options)
    return netcdf.open_dataset(output)


def sweep(
    scene: Mapping[str, Any],
    axes: Mapping[str, Any],
    output: str | os.PathLike[str] | None = None,
    *,
    solver: str | Mapping[str, Any] = "auto",
    jobs: int | None = None,
    fresh: bool = False,
    reuse: str | os.PathLike[str] | None = None,
    scheduler: str | None = None,
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
    output, jobs, fresh, reuse, scheduler, progress
        As for :func:`run`.

    Returns
    -------
    xarray.Dataset

    Raises
    ------
    InputError
        If scene, axes or solver are wrong; see :func:`run` too.

    Examples
    --------
    A mass on a spring; a grid over the speed of the belt and static friction:

    >>> import numpy as np, ringsweep
    >>> scene = {
    ...     "model": "belt",
    ...     "body": {"mass": 1.0},
    ...     "spring": {"stiffness": 2.0},
    ...     "belt": {"velocity": 0.1},
    ...     "friction": {"law": "stiction", "mu_s": 0.15, "mu_k": 0.1},
    ...     "time": {"span": 60.0},
    ... }
    >>> ds = ringsweep.sweep(scene, {"belt.velocity": np.geomspace(0.05, 0.2, 3), "friction.mu_s": [0.12, 0.15]})
    >>> dict(ds.sizes)
    {'belt_velocity': 3, 'friction_mu_s': 2}
    >>> ds.period.sel(friction_mu_s=0.15, belt_velocity=0.1).round(3).item()
    7.523
    """
    parsed = read_scene(scene, swept=axes)
    found = read_axes(parsed, axes)
    method = {"method": solver} if isinstance(solver, str) else dict(solver)
    source = {"scene": dict(parsed.source), "solver": method, "sweep": _as_sweep(found)}
    chosen = read_solver(method, parsed)
    config = Config(scene=parsed, solver=chosen, axes=found, source=source, name="ringsweep")
    return _run(config, output, fresh, jobs=jobs, reuse=reuse, scheduler=scheduler, progress=progress)


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


def compute(
    config: Config,
    *,
    jobs: int | None = None,
    reuse: str | os.PathLike[str] | None = None,
    scheduler: str | None = None,
    progress: bool = True,
) -> xr.Dataset:
    """Run a validated configuration in memory; see :func:`run`."""
    config, earlier = _earlier(config, reuse)
    sizes = tuple(config.axes.sizes.values())
    layout = Layout(sizes, chunk=sizes)
    if layout.total > MOST_IN_MEMORY:
        raise InputError("sweep", f"{layout.total:.3g} cells do not fit into memory: name a file as output")
    kept = _InMemory(layout.total)
    _fill(config, layout, kept, earlier, jobs, scheduler, progress)
    return _frame(config).assign(
        {
            name: (
                tuple(config.axes.sizes),
                column.reshape(sizes),
                OUTCOMES[name].attributes | linked(name, kept.columns),
            )
            for name, column in kept.columns.items()
        }
    )


def write(
    config: Config,
    target: Path,
    *,
    jobs: int | None = None,
    fresh: bool = False,
    reuse: str | os.PathLike[str] | None = None,
    scheduler: str | None = None,
    progress: bool = True,
) -> bool:
    """Run a validated configuration into a file, going on from where an earlier run was stopped; see :func:`run`.

    Returns
    -------
    bool
        False if the file held this sweep already.
    """
    config, earlier = _earlier(config, reuse)
    target = target.resolve()
    if target.exists():
        netcdf.check_kind(target, "regime", "sweep")
    layout = Layout(tuple(config.axes.sizes.values()))
    described = identity(config)
    with owned(target, described, layout, fresh=fresh) as partial:
        if not fresh and _holds(target, partial):
            partial.clear()
            return False
        if resumed := int(partial.done.sum()):
            logger.info("going on: %d of %d cells are done", resumed, layout.total)
        try:
            _fill(config, layout, partial, earlier, jobs, scheduler, progress)
            try:
                _merge(config, target, layout, partial)
            except Damaged as damage:
                logger.warning("%s: looking for what is missing", damage)
                partial.take_stock()
                _fill(config, layout, partial, earlier, jobs, scheduler, progress)
                _merge(config, target, layout, partial)
        except BaseException as error:
            if (kept := int(partial.done.sum())) and partial.folder.exists():
                again = "the same command without --fresh" if fresh else "the same command"
                error.add_note(
                    f"{kept} of {layout.total} cells are kept in {partial.folder}: {again} goes on from there"
                )
            raise
        partial.clear()
    return True


def _merge(config: Config, target: Path, layout: Layout, partial: Partial) -> None:
    """Make the file of finished partial."""
    frame = _frame(config)
    frame.attrs["processors"] = ", ".join(sorted(partial.processors))
    netcdf.write(target, partial.folder, frame, OUTCOMES, layout, partial.chunks())


def _holds(target: Path, partial: Partial) -> bool:
    """Whether a file holds this very sweep; how another differs from it is told."""
    if not target.exists():
        return False
    with netcdf.open_dataset(target) as ds:
        found = dict(ds.attrs)
    if found.get("fingerprint") == partial.key:
        return True
    try:
        changes = differences(identity(load(target)), partial.identity) or "the version of ringsweep"
    except InputError:
        changes = "what a configuration may say"
    logger.warning("%s is replaced when this sweep is done; what changed: %s", target, changes)
    return False


class _InMemory:
    """Finished cells as whole columns."""

    def __init__(self, total: int):
        self.done = np.zeros(total, dtype=bool)
        self.columns: dict[str, NDArray[Any]] = {}

    def put(self, positions: NDArray[np.integer], columns: Columns, processor: str) -> None:
        """Keep the columns of the cells at these positions."""
        for name, column in columns.items():
            self.columns.setdefault(name, np.empty(len(self.done), dtype=column.dtype))[positions] = column
        self.done[positions] = True


def _fill(
    config: Config,
    layout: Layout,
    kept: Partial | _InMemory,
    earlier: Earlier | None,
    jobs: int | None,
    scheduler: str | None,
    progress: bool,
) -> None:
    """Compute every cell that is not there yet, task after task."""
    computing = executor(jobs, scheduler)
    if earlier is not None:
        count = earlier.give(config, layout, kept)
        tell = logger.info if count else logger.warning
        tell("%d of %d cells are taken from %s", count, layout.total, earlier.path)
    left = layout.total - int(kept.done.sum())
    if not left:
        return
    with ExitStack() as stack:
        stopped = stack.enter_context(stop_on_interrupt())
        workers = stack.enter_context(computing)
        pace: Pace[Finished] = Pace(config.solver.side_by_side, workers.threads)
        tasks = tasks_of(kept.done, left, pace, stopped)
        results = workers.results(ComputeCells(config, layout), tasks, pace.learn, stopped)
        bar = stack.enter_context(progress_bar(layout.total, progress, layout.total - left))
        try:
            for finished in results:
                if finished.environment != environment():
                    changes = differences(environment(), finished.environment)
                    raise InputError("--scheduler", f"a worker has other versions than this process: {changes}")
                kept.put(finished.positions, finished.columns, finished.processor)
                bar.update(len(finished.positions))
        finally:
            # Partial under way cannot be interrupted; nobody is to wait for what comes after them.
            stopped.set()
            for _ in results:
                pass
        if not kept.done.all():
            raise KeyboardInterrupt


def _frame(config: Config) -> xr.Dataset:
    """Coordinates and attributes of a sweep's dataset."""
    known = sweepable(config.scene)
    return xr.Dataset(
        coords={
            path.replace(".", "_"): (dims, column, {**known[path].attributes, "path": path})
            for path, (dims, column) in config.axes.columns.items()
        },
        attrs=attributes(config),
    )


def _earlier(config: Config, reuse: str | os.PathLike[str] | None) -> tuple[Config, Earlier | None]:
    """The configuration, its axes at the very values of an earlier file's where these differ by rounding alone."""
    if reuse is None:
        return config, None
    earlier = Earlier(reuse, config)
    return earlier.aligned(config), earlier
