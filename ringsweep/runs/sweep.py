"""Sweeps: tasks are computed by an executor, and their outcomes become a dataset in memory or on disk."""

from __future__ import annotations

import logging
import math
import os
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager, nullcontext, suppress
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from threading import Event
from time import monotonic
from typing import TYPE_CHECKING, Any

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from ringsweep.config import Axes, Config, assembled, load, read_axes, read_scene, read_solver, with_refine
from ringsweep.config.follow import BOTH, DIRECTION
from ringsweep.config.yaml_text import read
from ringsweep.errors import InputError
from ringsweep.models import model_of
from ringsweep.quantities.variables import INFERRED, OUTCOMES, Variable, error_attribute
from ringsweep.runs import probabilities
from ringsweep.runs.cells import TaskResult, compute_task, coordinates, kernels_of
from ringsweep.runs.executors import Execution, Executor, progress_bar, stop_on_interrupt
from ringsweep.runs.needs import check_room
from ringsweep.runs.refined import KnownLabels, complete, decide, gaps, with_nan
from ringsweep.runs.refined import attributes as refinement_attributes
from ringsweep.runs.refinement import Refined
from ringsweep.runs.reuse import EarlierSweep
from ringsweep.runs.task_sizes import TaskSizes, chains_of, divide_into_tasks
from ringsweep.runs.warnings import warn_of_results, warn_of_sample
from ringsweep.storage import netcdf
from ringsweep.storage.checkpoint import Checkpoint, Columns, DamagedTask, another_sweep, open_checkpoint
from ringsweep.storage.chunks import Layout
from ringsweep.storage.provenance import attributes, differences, environment, identity

if TYPE_CHECKING:
    import pandas as pd

logger = logging.getLogger("ringsweep")

#: Largest number of cells of a sweep in memory, where they take some gigabytes.
MAX_CELLS_IN_MEMORY = 10_000_000

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
    loaded = with_refine(load(config), refine)
    return _run(loaded, output, Execution(jobs, scheduler, progress), fresh, reuse)


def _run(
    config: Config,
    output: str | os.PathLike[str] | None,
    execution: Execution,
    fresh: bool,
    reuse: str | os.PathLike[str] | None,
) -> xr.Dataset:
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
    is_whole = isinstance(given, str | os.PathLike) or (isinstance(given, Mapping) and "scene" in given)
    whole: Mapping[str, Any] = load(given).source if is_whole else {"scene": given}
    record = whole.get("record") if record is None else record
    solver = whole.get("solver", "auto") if solver is None else solver
    parsed = read_scene(whole["scene"], axes, record)
    found = read_axes(parsed, axes)
    method = read_solver(solver, parsed)
    of_method = {"method": solver} if isinstance(solver, str) else dict(solver)
    also = {key: value for key, value in (("follow", follow), ("refine", refine)) if value not in (None, False)}
    section = _sweep_section(found) | read(also).tree
    source = {"scene": dict(parsed.source), "solver": of_method, "sweep": section}
    if record is not None:
        source["record"] = dict(record)
    config = assembled(Config(parsed, method, found, source, name="ringsweep"))
    return _run(config, output, Execution(jobs, scheduler, progress), fresh, reuse)


def _sweep_section(axes: Axes) -> dict[str, Any]:
    """Axes as the section ``sweep`` of a configuration. Paths over shared or several dimensions become points."""
    shared = {dim for dims, _ in axes.columns.values() if len(dims) > 1 for dim in dims}
    names = [dims for dims, _ in axes.columns.values()]
    shared |= {dims[0] for dims in names if names.count(dims) > 1}
    grid = {path: values.tolist() for path, (dims, values) in axes.columns.items() if shared.isdisjoint(dims)}
    sizes = {dim: size for dim, size in axes.sizes.items() if dim in shared}
    index = np.unravel_index(np.arange(math.prod(sizes.values())), tuple(sizes.values())) if sizes else ()
    indices = dict(zip(sizes, index, strict=True))
    points = {
        path: values[tuple(indices[dim] for dim in dims)].tolist()
        for path, (dims, values) in axes.columns.items()
        if not shared.isdisjoint(dims)
    }
    return {kind: columns for kind, columns in (("points", points), ("grid", grid)) if columns}


def compute(
    config: Config,
    execution: Execution,
    *,
    reuse: str | os.PathLike[str] | None = None,
    warn: bool = True,
) -> xr.Dataset:
    """Run a validated configuration in memory, with or without warnings about the results; see :func:`run`."""
    config, earlier = _earlier_sweep(config, reuse)
    layout = _layout(config, whole=True)
    if layout.total > MAX_CELLS_IN_MEMORY:
        raise InputError("sweep", f"{layout.total:.3g} cells do not fit into memory: name a file as output")
    check_room(config, layout.total // _parts_of_cell(config), None)
    store = MemoryStore(layout.total)
    found = _Work(config, layout, store, earlier, execution).compute()
    columns = {name: column.reshape((*layout.sizes, *column.shape[1:])) for name, column in store.columns.items()}
    if config.sample is not None:
        columns = probabilities.statistics(config, columns)
    elif found is not None and config.refine is not None:
        complete(config.refine, found, tuple(slice(None) for _ in layout.sizes), columns)
        columns |= {name: with_nan(columns[name]) for name in gaps(columns)}
    variables = _variables(config)
    data = {
        name: (
            (*config.axes.sizes, *variables[name].dims),
            column,
            variables[name].attributes | error_attribute(name, columns),
        )
        for name, column in columns.items()
    }
    results = xr.Dataset(data, *_coordinates_and_attributes(config, found))
    if warn:
        _warn(results, config)
    return results


def _layout(config: Config, whole: bool = False) -> Layout:
    """Order of the cells of a sweep, or of the parts of the cells of a sampled one; in one chunk for a `whole` one."""
    if config.sample is not None:
        return probabilities.part_layout(config, probabilities.grid_layout(config, whole))
    sizes, section = tuple(config.axes.sizes.values()), config.scene.structure.section
    return Layout(sizes, sizes if whole else None, 1 if section is None else section.keep)


def _variables(config: Config) -> Mapping[str, Variable]:
    """Declarations of the variables of a sweep."""
    return model_of(config.scene.structure).variables if config.sample is None else probabilities.variables(config)


def _warn(results: xr.Dataset, config: Config) -> None:
    (warn_of_results if config.sample is None else warn_of_sample)(results, config)


def write(
    config: Config,
    target: Path,
    execution: Execution,
    *,
    fresh: bool = False,
    reuse: str | os.PathLike[str] | None = None,
) -> bool:
    """Run a validated configuration into a file, or continue such a run; see :func:`run`.

    Returns
    -------
    bool
        False if the file held this sweep already.
    """
    config, earlier = _earlier_sweep(config, reuse)
    target = target.resolve()
    if target.exists():
        netcdf.check_kind(target, *(("regime", "sweep") if config.sample is None else ("probability", "sampled sweep")))
    layout = _layout(config)
    with open_checkpoint(target, identity(config), layout, fresh=fresh) as checkpoint:
        computed = fresh or not _holds_sweep(target, checkpoint)
        if computed:
            try:
                _compute_file(_Work(config, layout, checkpoint, earlier, execution), target, checkpoint)
            except BaseException as error:
                with suppress(InputError, OSError):
                    checkpoint.keep()
                if (finished := int(checkpoint.done.sum())) and checkpoint.folder.exists():
                    again = "the same command without --fresh" if fresh else "the same command"
                    error.add_note(
                        f"{finished} of {layout.total} {_parts(config)} are kept in {checkpoint.folder}: "
                        f"{again} goes on"
                    )
                raise
        if not checkpoint.other:
            checkpoint.clear()
    with netcdf.reading(target) as results:
        _warn(results, config)
    return computed


def _parts_of_cell(config: Config) -> int:
    return 1 if config.sample is None else config.sample.replicates


def _parts(config: Config) -> str:
    return "cells" if config.sample is None else "replicates of cells"


def _compute_file(work: _Work, target: Path, checkpoint: Checkpoint) -> None:
    """Compute the cells that the checkpoint lacks, and write the file from it."""
    config, layout = work.config, work.layout
    finished = int(checkpoint.done.sum())
    check_room(config, (layout.total - finished) // _parts_of_cell(config), target.parent)
    if finished:
        logger.info("going on: %d of %d %s are done", finished, layout.total, _parts(config))
    try:
        _write_file(config, target, layout, checkpoint, work.compute())
    except DamagedTask as damage:
        logger.warning("%s: the missing cells are computed again", damage)
        checkpoint.scan()
        _write_file(config, target, layout, checkpoint, work.compute())


def _write_file(config: Config, target: Path, layout: Layout, checkpoint: Checkpoint, found: Refined | None) -> None:
    """Write the file of a sweep whose cells are all in the checkpoint, but for those that were inferred."""
    coords, attrs = _coordinates_and_attributes(config, found)
    frame = xr.Dataset(coords=coords, attrs=attrs)
    frame.attrs["processors"] = ", ".join(sorted(checkpoint.processors))
    destination = target, checkpoint.working_folder, frame, _variables(config)
    if config.sample is not None:
        chunks = ((region[:-1], probabilities.statistics(config, sums)) for region, sums in checkpoint.chunks())
        netcdf.write(*destination, probabilities.grid_layout(config), chunks)
    elif found is None or config.refine is None:
        netcdf.write(*destination, layout, checkpoint.chunks())
    else:
        refine = config.refine

        def fill(region: tuple[slice, ...], missing: NDArray[np.bool_], columns: dict[str, NDArray[Any]]) -> bool:
            complete(refine, found, region, columns)
            return not (missing & (found.origin[region] != INFERRED)).any()

        netcdf.write(*destination, layout, checkpoint.chunks(fill), gaps(OUTCOMES))


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
        """Positions and columns of finished cells."""
        positions = np.flatnonzero(self.done)
        if len(positions):
            yield positions, {name: column[positions] for name, column in self.columns.items()}

    def put(self, positions: NDArray[np.integer], columns: Columns, processor: str) -> None:
        """Store the columns of the cells at these positions."""
        for name, column in columns.items():
            if name not in self.columns:
                self.columns[name] = np.empty((len(self.done), *column.shape[1:]), dtype=column.dtype)
            self.columns[name][positions] = column
        self.done[positions] = True


@dataclass(frozen=True)
class _Work:
    """A sweep, the store of its cells, and what fills the store.

    Attributes
    ----------
    config : Config
    layout : Layout
        Order of the cells, or of the parts of the cells of a sampled sweep.
    store : Checkpoint or MemoryStore
    earlier : EarlierSweep, optional
        Sweep whose cells are taken.
    execution : Execution
    """

    config: Config
    layout: Layout
    store: Checkpoint | MemoryStore
    earlier: EarlierSweep | None
    execution: Execution

    def compute(self) -> Refined | None:
        """Compute the cells that the store lacks, task after task: every cell, or those that a refinement asks for."""
        if self.config.refine is not None:
            return self._refine()
        self._take_shared(self.store.done)
        if not self.store.done.all():
            with self._open_tasks(self.layout.total) as tasks:
                follow, chains = self.config.follow, None
                if follow is not None:
                    dim, _ = follow.chains(self.config.axes)
                    chains = chains_of(self.layout, list(self.config.axes.sizes).index(dim))
                tasks.run(divide_into_tasks(self.store.done, tasks.sizes, tasks.stopped, chains))
                if not self.store.done.all():
                    raise KeyboardInterrupt
        return None

    def _refine(self) -> Refined:
        """Compute the cells that a refinement asks for."""
        labels = KnownLabels(self.config, self.layout.total)
        for positions, columns in self.store.finished():
            labels.put(positions, dict(columns))
        # Which cells an earlier sweep must give is known at the end: until then its labels are enough.
        if self.earlier is not None:
            for positions, columns in self.earlier.shared_cells(self.config, self.layout, labels.known, labels.names):
                labels.put(positions, columns)
        with self._open_tasks(None) as tasks:
            tasks.notice = labels.put

            def run(cells: NDArray[np.intp]) -> None:
                tasks.run(divide_into_tasks(self.store.done, tasks.sizes, tasks.stopped, cells[:, None]))
                if not labels.known[cells].all():
                    raise KeyboardInterrupt

            found = decide(self.config, self.layout, labels, run)
        if self.earlier is not None:
            needed = np.zeros(self.layout.total, dtype=bool)
            needed[self.layout.positions(np.nonzero(found.origin != INFERRED))] = True
            self._take_shared(self.store.done | ~needed)
        return found

    def _take_shared(self, done: NDArray[np.bool_]) -> None:
        """Take the cells that are not done from the earlier sweep, as far as there is one that has them."""
        if self.earlier is None:
            return
        taken = 0
        for positions, columns in self.earlier.shared_cells(self.config, self.layout, done):
            self.store.put(positions, columns, self.earlier.processors)
            taken += len(positions)
        level = logging.INFO if taken else logging.WARNING
        logger.log(level, "%d of %d cells are taken from %s", taken, self.layout.total, self.earlier.path)

    @contextmanager
    def _open_tasks(self, total: int | None) -> Iterator[_Tasks]:
        """Tasks that compute cells; `total` is the number of all, if all of them are computed."""

        def under_way() -> str:
            learnt = not math.isnan(sizes.seconds_per_cell)
            return "the tasks under way are done" if learnt else "compilation and the first cells are done"

        config, store, execution = self.config, self.store, self.execution
        with execution.open() as workers:
            span = config.scene.values.get("time.span", 1.0)
            kind = kernels_of(config), config.sample is None, round(math.log2(span))
            sizes = TaskSizes(1 if config.sample else config.solver.side_by_side, workers.concurrency, kind)
            # What is in memory is lost anyway: there the first Ctrl-C ends the sweep.
            stopping = stop_on_interrupt(under_way) if isinstance(store, Checkpoint) else nullcontext(Event())
            with stopping as stopped, progress_bar(total, execution.progress, int(store.done.sum())) as bar:
                # Other processes get it with every task: points as they were written are long.
                sent = replace(config, source={})
                task: Callable[..., TaskResult] = partial(compute_task, sent, self.layout)
                if config.sample is not None:
                    task = partial(probabilities.compute_parts, sent, self.layout)
                tasks = _Tasks(task, store, workers, sizes, stopped, bar)
                try:
                    yield tasks
                finally:
                    tasks.store_waiting()


class _Tasks:
    """Runs tasks and stores their results; made by :class:`_Work`.

    Attributes
    ----------
    sizes : TaskSizes
    stopped : Event
        Set once the user has interrupted.
    notice : callable, optional
        Called with positions and columns of each result; then results of small tasks are stored together.
    """

    def __init__(
        self, compute: Callable[..., TaskResult], store: Checkpoint | MemoryStore, workers: Executor, sizes: TaskSizes,
        stopped: Event, bar: Any,
    ):  # fmt: skip
        self._compute, self._store, self._workers, self._bar = compute, store, workers, bar
        self.sizes, self.stopped = sizes, stopped
        self.notice: Callable[[NDArray[np.integer], dict[str, NDArray[Any]]], None] | None = None
        self._waiting: list[TaskResult] = []
        self._last: TaskResult | None = None
        self._written = monotonic()

    def run(self, tasks: Iterator[NDArray[np.integer]]) -> None:
        """Run tasks, each given by the positions of its cells."""
        results = self._workers.results(self._compute, tasks, self.sizes.learn, self.stopped)
        try:
            for self._last in results:
                self._keep(self._last)
        except KeyboardInterrupt as interrupt:
            self.stopped.set()
            # Finished tasks are kept. Tasks under way are not waited for.
            if self._last is not None:
                self._keep(self._last)
            self._last = results.throw(interrupt)
            while True:
                self._keep(self._last)
                self._last = next(results)
        except BaseException:
            self.stopped.set()
            # Tasks under way cannot be interrupted. Wait for their end.
            for _ in results:
                pass
            raise

    def _keep(self, result: TaskResult) -> None:
        if result.environment != environment():
            changes = differences(environment(), result.environment)
            raise InputError("--scheduler", f"a worker has other versions than this process: {changes}")
        if self.notice is None:
            self._store.put(result.positions, result.columns, result.processor)
        else:
            self.notice(result.positions, result.columns)
            self._waiting.append(result)
            if monotonic() - self._written > _WRITE_INTERVAL:
                self.store_waiting()
        self._bar.update(len(result.positions))
        self._last = None

    def store_waiting(self) -> None:
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
            self._store.put(positions[order], columns, processor)


def _coordinates_and_attributes(config: Config, found: Refined | None) -> tuple[dict[str, Any], dict[str, Any]]:
    """Coordinates and attributes of the dataset of a sweep."""
    coords, attrs = coordinates(config.scene, config.axes.columns), attributes(config)
    if config.sample is not None:
        coords |= probabilities.coordinates(config)
        attrs |= probabilities.attributes(config)
    if config.refine is not None and found is not None:
        attrs |= refinement_attributes(config.refine, found)
    if config.follow is not None and DIRECTION in config.axes.sizes:
        about = {"long_name": f"direction in which {config.follow.path} is followed"}
        coords[DIRECTION] = DIRECTION, list(BOTH), about
    return coords, attrs


def _earlier_sweep(config: Config, reuse: str | os.PathLike[str] | None) -> tuple[Config, EarlierSweep | None]:
    """The configuration, with its axes aligned to those of the earlier sweep, and that sweep."""
    if reuse is None:
        return config, None
    if config.follow is not None:
        raise InputError("--reuse", "cells of sweep.follow start from the cells before them: leave one of them out")
    if config.sample is not None:
        raise InputError("--reuse", "a sampled sweep has no cells that another one could take: leave it out")
    earlier = EarlierSweep(reuse, config)
    return earlier.align_axes(config), earlier
