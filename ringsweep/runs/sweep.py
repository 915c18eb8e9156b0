"""Sweeps: tasks are computed by an executor, and their outcomes become a dataset in memory or on disk."""

from __future__ import annotations

import logging
import math
import os
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager, nullcontext, suppress
from pathlib import Path
from threading import Event
from time import monotonic
from typing import TYPE_CHECKING, Any

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from ringsweep.config import Axes, Config, load
from ringsweep.errors import InputError
from ringsweep.quantities.variables import error_attribute
from ringsweep.runs.cells import TaskResult, kernels_of
from ringsweep.runs.executors import Execution, progress_bar, stop_on_interrupt
from ringsweep.runs.grid import Grid
from ringsweep.runs.needs import check_room
from ringsweep.runs.plans import plan_of
from ringsweep.runs.task_sizes import TaskSizes, divide_into_tasks
from ringsweep.storage import netcdf
from ringsweep.storage.checkpoint import Checkpoint, Columns, DamagedTask, another_sweep, open_checkpoint
from ringsweep.storage.provenance import differences, environment, identity

if TYPE_CHECKING:
    import pandas as pd

logger = logging.getLogger("ringsweep")

# Name of a file.
Name = str | os.PathLike[str]

# Seconds of a refined sweep that are lost if it is killed.
_WRITE_INTERVAL = 1.0


def run(
    config: str | os.PathLike[str] | Mapping[str, Any],
    output: str | os.PathLike[str] | None = None,
    *,
    jobs: int | None = None,
    fresh: bool = False,
    reuse: str | os.PathLike[str] | None = None,
    refine: Mapping[str, Any] | bool | None = None,
    scheduler: str | None = None,
    progress: bool = True,
) -> xr.Dataset:
    """Run the sweep that a configuration describes.

    Parameters
    ----------
    config : path or mapping
        A YAML file, the mapping that it would hold, or a result file, whose sweep is repeated.
    output : path-like, optional
        NetCDF file to write. Until it is complete, finished cells are kept in a folder beside it, and not in memory. If
        the sweep is stopped, the same call continues it.
    jobs : int, optional
        Number of threads; by default that of ``joblib.parallel_config``, or else all cores.
    fresh : bool
        Whether to discard what an earlier call computed.
    reuse : path-like, optional
        File of an earlier sweep. Cells that both sweeps have are taken from it.
    refine : mapping or bool, optional
        What stands under ``sweep.refine`` in a configuration; True stands for the defaults. Then only the boundaries
        of the map are computed, and the other cells are inferred.
    scheduler : str, optional
        Address of a Dask scheduler whose workers compute the cells, in place of threads.
    progress : bool
        Whether to show a progress bar, if there is a terminal or a notebook.

    Returns
    -------
    xarray.Dataset
        One dimension per swept path; see :data:`ringsweep.quantities.variables.OUTCOMES`. With an output file, values
        are read when they are needed; ``.load()`` reads all.

    Raises
    ------
    InputError
        If the configuration is wrong, the output cannot be written, another process computes it, it is damaged, or it
        or the folder beside it holds another sweep.

    Warns
    -----
    Through the logger ``"ringsweep"``: if steps of rk4 exceed its limit of stability, and if most runs end at t = 0.

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
    return _run(load(config, refine=refine), output, Execution(jobs, scheduler, progress), fresh, reuse)


def _run(config: Config, output: Name | None, execution: Execution, fresh: bool, reuse: Name | None) -> xr.Dataset:
    if output is None:
        return compute(config, execution, reuse=reuse)
    write(config, Path(output), execution, fresh=fresh, reuse=reuse)
    return netcdf.open_dataset(output)


def sweep(
    scene: str | os.PathLike[str] | Mapping[str, Any],
    axes: Mapping[str, Any] | pd.DataFrame,
    output: str | os.PathLike[str] | None = None,
    *,
    solver: str | Mapping[str, Any] | None = None,
    jobs: int | None = None,
    fresh: bool = False,
    reuse: str | os.PathLike[str] | None = None,
    refine: Mapping[str, Any] | bool | None = None,
    record: Mapping[str, Any] | None = None,
    follow: str | Mapping[str, Any] | None = None,
    scheduler: str | None = None,
    progress: bool = True,
) -> xr.Dataset:
    """Run a scene over axes.

    Parameters
    ----------
    scene : mapping or path
        The mapping under ``scene`` in a configuration, or a whole configuration, or the path of one. Then ``axes`` take
        the place of its sweep.
    axes : mapping of str to sequence or xarray.DataArray, or pandas.DataFrame
        Values for paths of the scene, such as ``"drive.amplitude"``, or names for ``"friction.law"``.
        A 1-D sequence is a grid axis. DataArrays that share a dimension vary together along it. Each row of a DataFrame
        is a run: its columns are paths, which vary together along the dimension ``point``.
    solver : str or mapping, optional
        Name of a method, or the mapping under ``solver`` in a configuration; by default that of the configuration, else
        ``"auto"``.
    record, follow : mapping, optional
        The mappings under ``record`` (by default that of the configuration) and ``sweep.follow``.
    output, jobs, fresh, reuse, refine, scheduler, progress
        As for :func:`run`.

    Returns
    -------
    xarray.Dataset

    Raises
    ------
    InputError
        If scene, axes, solver, record or follow are wrong; see also :func:`run`.

    Examples
    --------
    A mass on a spring; a grid over the speed of the belt and the static friction coefficient:

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
    if hasattr(axes, "itertuples"):
        axes = {str(path): xr.DataArray(column.to_numpy(), dims="point") for path, column in axes.items()}
    given: Any = scene
    if not (isinstance(given, str | os.PathLike) or (isinstance(given, Mapping) and "scene" in given)):
        given = {"scene": given}
    config = load(given, axes=axes, solver=solver, record=record, refine=refine or None, follow=follow or None)
    config.source["sweep"] |= _sweep_section(config.axes)
    return _run(config, output, Execution(jobs, scheduler, progress), fresh, reuse)


def _sweep_section(axes: Axes) -> dict[str, Any]:
    """Axes as the section ``sweep`` of a configuration. Paths over shared or several dimensions become points."""
    columns = {path: xr.DataArray(values, dims=dims) for path, (dims, values) in axes.columns.items()}
    uses = [dim for one in columns.values() for dim in one.dims]
    alone = [path for path, one in columns.items() if [uses.count(dim) for dim in one.dims] == [1]]
    others = [path for path in columns if path not in alone]
    every = xr.broadcast(*(columns[path] for path in others))
    order = [dim for dim in axes.sizes if every and dim in every[0].dims]
    points = {path: one.transpose(*order).values.ravel().tolist() for path, one in zip(others, every, strict=True)}
    grid = {path: columns[path].values.tolist() for path in alone}
    return {kind: given for kind, given in (("points", points), ("grid", grid)) if given}


def compute(config: Config, execution: Execution, *, reuse: Name | None = None, warn: bool = True) -> xr.Dataset:
    """Run a validated configuration in memory, with or without warnings about the results; see :func:`run`."""
    plan = plan_of(config, reuse, whole=True)
    layout = plan.layout
    check_room(plan, plan.grid.total, None)
    store = MemoryStore(layout.total)
    plan.compute(Work(plan, store, execution))
    columns = {name: column.reshape((*layout.sizes, *column.shape[1:])) for name, column in store.columns.items()}
    columns, variables = plan.columns(columns), plan.variables()
    data = {
        name: (
            (*plan.config.axes.sizes, *variables[name].dims),
            column,
            variables[name].attributes | error_attribute(name, columns),
        )
        for name, column in columns.items()
    }
    results = xr.Dataset(data, plan.coordinates(), plan.attributes())
    if warn:
        plan.warn(results)
    return results


def write(
    config: Config, target: Path, execution: Execution, *, fresh: bool = False, reuse: Name | None = None
) -> bool:
    """Run a validated configuration into a file, or continue such a run; see :func:`run`.

    Returns
    -------
    bool
        False if the file held this sweep already.
    """
    plan, target = plan_of(config, reuse), target.resolve()
    if target.exists():
        netcdf.check_kind(target, *plan.kind)
    with open_checkpoint(target, identity(plan.config), plan.layout, fresh=fresh) as checkpoint:
        computed = fresh or not _holds_sweep(target, checkpoint)
        if computed:
            try:
                _compute_file(Work(plan, checkpoint, execution), target, checkpoint)
            except BaseException as error:
                with suppress(InputError, OSError):
                    checkpoint.keep()
                if (finished := int(checkpoint.done.sum())) and checkpoint.folder.exists():
                    again = f"the same command{' without --fresh' * fresh} goes on"
                    kept = f"{finished} of {plan.layout.total} {plan.parts} are kept in {checkpoint.folder}"
                    error.add_note(f"{kept}: {again}")
                raise
        if not checkpoint.other:
            checkpoint.clear()
    with netcdf.reading(target) as results:
        plan.warn(results)
    return computed


def _compute_file(work: Work, target: Path, checkpoint: Checkpoint) -> None:
    """Compute the cells that the checkpoint lacks, and write the file from it."""
    plan, finished = work.plan, int(checkpoint.done.sum())
    check_room(plan, (plan.layout.total - finished) // plan.parts_of_cell, target.parent)
    if finished:
        logger.info("going on: %d of %d %s are done", finished, plan.layout.total, plan.parts)
    for is_last in (False, True):
        try:
            plan.compute(work)
            frame = xr.Dataset(coords=plan.coordinates(), attrs=plan.attributes())
            frame.attrs["processors"] = ", ".join(sorted(checkpoint.processors))
            destination = target, checkpoint.working_folder, plan.variables(), plan.grid
            netcdf.save(frame, *destination, plan.chunks(checkpoint), plan.gaps)
            return
        except DamagedTask as damage:
            if is_last:
                raise
            logger.warning("%s: the missing cells are computed again", damage)
            checkpoint.scan()


def _holds_sweep(target: Path, checkpoint: Checkpoint) -> bool:
    """Whether a file holds the sweep of a checkpoint, undamaged.

    Raises
    ------
    InputError
        If it is damaged, or it or the folder beside it holds another sweep, and no cell of this one is finished.
    """
    if not target.exists():
        if checkpoint.other:
            raise another_sweep(str(checkpoint.folder), "holds finished cells of another sweep", checkpoint.other)
        return False
    with netcdf.open_dataset(target) as ds:
        stored_fingerprint = ds.attrs.get("fingerprint")
    if stored_fingerprint == checkpoint.fingerprint:
        try:
            netcdf.verify(target)
        except InputError as error:
            cure = "--fresh (in Python fresh=True) computes it again"
            raise InputError(str(target), f"{error.problem}; {cure}") from error
        return True
    try:
        changes = differences(identity(load(target)), checkpoint.identity) or "the version of ringsweep"
    except InputError:
        changes = "the keys that a configuration can have"
    # Finished cells of this sweep beside it were begun with --fresh.
    if not checkpoint.done.any():
        raise another_sweep(str(target), "holds another sweep", changes)
    logger.warning("%s is replaced when this sweep is done; what changed: %s", target, changes)
    return False


class MemoryStore:
    """Finished cells in memory, as whole columns.

    Attributes
    ----------
    done : ndarray of bool, shape ``(cells,)``
        Whether the cell at each position of the layout is finished.
    columns : dict of str to ndarray of shape ``(cells,)``
    """

    def __init__(self, total: int):
        self.done = np.zeros(total, dtype=bool)
        self.columns: dict[str, NDArray[Any]] = {}

    def finished(self) -> Iterator[tuple[NDArray[np.intp], Columns]]:
        """Positions and columns of cells that an earlier call has finished: there are none."""
        return iter(())

    def put(self, positions: NDArray[np.integer], columns: Columns, processor: str) -> None:
        """Store the columns of the cells at these positions."""
        for name, column in columns.items():
            if name not in self.columns:
                self.columns[name] = np.empty((len(self.done), *column.shape[1:]), dtype=column.dtype)
            self.columns[name][positions] = column
        self.done[positions] = True


class Work:
    """A plan that is carried out: its tasks run, and their results are stored.

    Attributes
    ----------
    plan : Grid
    store : Checkpoint or MemoryStore
    notice : callable, optional
        Called with positions and columns of each result; then results of small tasks are stored together.
    """

    def __init__(self, plan: Grid, store: Checkpoint | MemoryStore, execution: Execution):
        self.plan, self.store, self._execution = plan, store, execution
        self.notice: Callable[[NDArray[np.integer], dict[str, NDArray[Any]]], None] | None = None
        self._waiting: list[TaskResult] = []
        self._last: TaskResult | None = None
        self._written = monotonic()

    def take_shared(self, done: NDArray[np.bool_]) -> None:
        """Take the cells that are not done from the earlier sweep, as far as there is one that has them."""
        plan, taken = self.plan, 0
        if plan.earlier is None:
            return
        for positions, columns in plan.earlier.shared_cells(plan.config, plan.layout, done):
            self.store.put(positions, columns, plan.earlier.processors)
            taken += len(positions)
        level = logging.INFO if taken else logging.WARNING
        logger.log(level, "%d of %d cells are taken from %s", taken, plan.layout.total, plan.earlier.path)

    @contextmanager
    def begun(self, total: int | None) -> Iterator[None]:
        """Let tasks be run within the block; `total` is the number of all parts, if all of them are computed."""
        config, store = self.plan.config, self.store
        with self._execution.open() as self._workers:
            span = config.scene.values.get("time.span", 1.0)
            kind = kernels_of(config), self.plan.parts, round(math.log2(span))
            self._sizes = TaskSizes(self.plan.side_by_side, self._workers.concurrency, kind)
            # What is in memory is lost anyway: there the first Ctrl-C ends the sweep.
            stopping = stop_on_interrupt() if isinstance(store, Checkpoint) else nullcontext(Event())
            bar = progress_bar(total, self._execution.progress, int(store.done.sum()))
            with stopping as self._stopped, bar as self._bar:
                try:
                    yield
                finally:
                    self._store_waiting()

    def run(self, groups: NDArray[np.integer] | None = None) -> None:
        """Run tasks of the parts that are not done: of all, or of those in groups that stay together."""
        tasks = divide_into_tasks(self.store.done, self._sizes, self._stopped, groups)
        results = self._workers.results(self.plan.task(), tasks, self._sizes.learn, self._stopped)
        try:
            for self._last in results:
                self._keep(self._last)
        except KeyboardInterrupt as interrupt:
            self._stopped.set()
            # Finished tasks are kept. Tasks under way are not waited for.
            if self._last is not None:
                self._keep(self._last)
            self._last = results.throw(interrupt)
            while True:
                self._keep(self._last)
                self._last = next(results)
        except BaseException:
            self._stopped.set()
            # Tasks under way cannot be interrupted. Wait for their end.
            for _ in results:
                pass
            raise

    def _keep(self, result: TaskResult) -> None:
        if result.environment != environment():
            changes = differences(environment(), result.environment)
            raise InputError("--scheduler", f"a worker has other versions than this process: {changes}")
        if self.notice is None:
            self.store.put(result.positions, result.columns, result.processor)
        else:
            self.notice(result.positions, result.columns)
            self._waiting.append(result)
            if monotonic() - self._written > _WRITE_INTERVAL:
                self._store_waiting()
        self._bar.update(len(result.positions))
        self._last = None

    def _store_waiting(self) -> None:
        """Store the results of small tasks together: a file for each would take longer than its cells."""
        waiting, self._waiting = self._waiting, []
        self._written = monotonic()
        for processor in sorted({result.processor for result in waiting}):
            some = [result for result in waiting if result.processor == processor]
            positions = np.concatenate([result.positions for result in some])
            order = np.argsort(positions)
            columns = {
                name: np.concatenate([result.columns[name] for result in some])[order] for name in some[0].columns
            }
            self.store.put(positions[order], columns, processor)
