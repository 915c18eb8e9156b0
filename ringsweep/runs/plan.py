"""What a sweep needs: cells, memory, disk and time, before it runs."""

from __future__ import annotations

import math
import os
import shutil
from contextlib import suppress
from dataclasses import fields, replace
from pathlib import Path
from threading import Event, Thread
from time import monotonic

import joblib
import numpy as np
from numpy.typing import NDArray

from ringsweep.config import Config
from ringsweep.config.axes import values_at
from ringsweep.errors import InputError
from ringsweep.models import model_of
from ringsweep.quantities.variables import INFERRED, LABELS, OUTCOMES
from ringsweep.runs import sampled
from ringsweep.runs.cells import TaskResult, compute_task
from ringsweep.runs.reuse import EarlierSweep
from ringsweep.solvers.certificate import with_errors
from ringsweep.storage.chunks import Layout
from ringsweep.storage.netcdf import COMPRESSED_FROM

# Bytes of this process without cells, and for each cell of the grid; from benchmarks/results/sizes.md.
_PROCESS, _BOOKKEEPING = 300e6, 33.0

# Bytes for each cell of the picture, which has no more pixels than that; for each cell if numbers are interpolated.
_PICTURE, _MOST_DRAWN, _INTERPOLATING = 120.0, 1 << 20, 40.0

# Bytes of a finished file without cells, and the share of its columns that compression leaves: 0.55 of some thousand
# cells, 0.4 of millions.
_FILE, _COMPRESSED = 40e3, 0.55

# Most cells of a refined sweep of which it is estimated how many are run.
_MOST_GUESSED = 1 << 20

# Most steps of the cells that are run so that their kernels are compiled.
_FEW = 1000

# Seconds to measure cells, seconds to wait for the first ones (they may be compiled), and the most cells to measure.
_MEASURING, _FIRST, _MOST = 1.0, 120.0, 100_000


def bytes_of_cell(config: Config) -> int:
    """Size of the columns of a cell, or of its sums; variables that some solvers leave out are counted."""
    if config.sample is not None:
        return sampled.bytes_of_part(config) * config.sample.replicates
    model = model_of(config.scene.structure)
    columns = model.columns(config.scene.structure)
    names = [*(name for name in columns if name not in model.absent), "steps", "certified", "uncertified_because"]
    bounded = with_errors(model.outcomes) if getattr(config.solver, "certify", False) else ()
    names += ["stiffness", *(f"{name}_error" for name in bounded)]
    return sum(np.dtype(OUTCOMES[name].dtype).itemsize for name in names)


def check_room(config: Config, cells: int, folder: Path | None) -> None:
    """Make sure that a sweep fits into the memory, and onto the disk.

    Parameters
    ----------
    config : Config
    cells : int
        Number of cells that are still to be computed.
    folder : Path, optional
        Where the file is written; None for a sweep in memory.

    Raises
    ------
    InputError
        If it does not fit.
    """
    needed, there = memory_needed(config, folder is None), memory_of_machine()
    if needed > there:
        raise InputError("sweep", f"the grid needs {size(needed)} of memory, and this machine has {size(there)}")
    # How many cells a refined sweep runs is not known before.
    if folder is None or config.refine is not None:
        return
    needed, there = float(cells * bytes_of_cell(config)), shutil.disk_usage(folder).free
    if needed > there:
        raise InputError(
            "sweep", f"{cells} cells need {size(needed)} on the disk, and {size(there)} are free in {folder}"
        )


def memory_needed(config: Config, in_memory: bool) -> float:
    """Bytes of memory that a sweep takes at most."""
    total = Layout(tuple(config.axes.sizes.values())).total
    interpolates = config.refine is not None and config.refine.also is not None
    each = _BOOKKEEPING + _INTERPOLATING * interpolates + (2.0 * bytes_of_cell(config) if in_memory else 0.0)
    return _PROCESS + total * each + min(total, _MOST_DRAWN) * _PICTURE


def memory_of_machine() -> float:
    """Bytes of memory that this process may use at most."""
    found = math.inf
    # Some systems do not tell.
    with suppress(AttributeError, OSError, ValueError):
        found = float(os.sysconf("SC_PHYS_PAGES") * os.sysconf("SC_PAGE_SIZE"))
    # A container may have less.
    with suppress(OSError, ValueError):
        found = min(found, float(Path("/sys/fs/cgroup/memory.max").read_text()))
    return found


def describe(config: Config, target: Path, jobs: int | None, reuse: str | os.PathLike[str] | None = None) -> str:
    """Cells, memory, disk and estimated time of a sweep, as lines of text. Some of its cells are run for it.

    Cells that the file `reuse` of an earlier sweep has are counted, and take no time.

    Raises
    ------
    InputError
        If it fits neither into the memory nor onto the disk.
    """
    folder = target.resolve().parent
    layout = Layout(tuple(config.axes.sizes.values()))
    taken = 0
    if reuse is not None and config.sample is None:
        earlier = EarlierSweep(reuse, config)
        config = earlier.align_axes(config)
        none = np.zeros(layout.total, dtype=bool)
        taken = sum(len(positions) for positions, _ in earlier.shared_cells(config, layout, none, ()))
    check_room(config, layout.total, folder)
    shape = f" ({', '.join(f'{name} {length}' for name, length in config.axes.sizes.items())})" * bool(layout.sizes)
    columns = float(layout.total * bytes_of_cell(config))
    finished = _FILE + columns * (_COMPRESSED if layout.total >= COMPRESSED_FROM else 1.0)
    free = shutil.disk_usage(folder).free
    threads = jobs or joblib.cpu_count()
    each = 0 if config.sample is None else config.sample.n * config.sample.rows
    runs = f", {each} runs in each, {each * layout.total} in all" if each else ""
    most = "at most " if config.refine is not None else ""
    time, expected = _time(config, layout, threads, taken)
    return "\n".join(
        (
            f"cells: {most}{layout.total}{shape}{runs}{expected}",
            *([] if reuse is None or config.sample is not None else [f"reuse: {taken} of them are taken from {reuse}"]),
            f"memory: some {size(memory_needed(config, False))} of {size(memory_of_machine())}",
            f"disk: {most}{size(columns + finished)} while it runs, then {most}{size(finished)}"
            f"; {size(free)} are free in {folder}",
            f"time: {most}{time}",
            "nothing was written",
        )
    )


def _time(config: Config, layout: Layout, threads: int, taken: int) -> tuple[str, str]:
    """Estimated time of a sweep of which an earlier one has some cells, and how many cells are expected, in words."""
    if config.sample is not None:
        layout = sampled.part_layout(config, layout)
    count = layout.total - taken
    if not count:
        return "hardly any: no cell is run", ""
    results, whole = _measure(config, layout)
    if results is None:
        return f"not known: the first cells took more than {_FIRST:.0f} s, compilation included", ""
    cells = sum(len(result.positions) for result in results)
    cost = sum(result.seconds or 0.0 for result in results) / cells if cells else whole or _MEASURING
    seconds = cost * count / min(threads, count)
    what = "cells" if config.sample is None else "replicates of cells"
    basis = f"measured on {cells} {what} spread over the grid"
    if not cells:
        basis = f"from {_FEW} steps of a cell: a whole one takes longer than the measurement"
        basis = basis if whole else "one cell takes longer than the measurement"
    about = "about" if cells or whole else "more than"
    told = f"{about} {duration(seconds)} on {threads} threads, once the kernels are compiled ({basis})"
    run = 0 if taken else expected_cells(config, layout, results)
    if not run:
        return told, ""
    less = f"; some {duration(cost * run / min(threads, run))} for the cells that are expected"
    return told + less, f"; some {run} are expected to be run ({run / layout.total:.2g} of all)"


def expected_cells(config: Config, layout: Layout, results: list[TaskResult]) -> int:
    """About how many cells a refined sweep runs: those of a map in which each cell is as the nearest one that was run.

    Returns
    -------
    int
        0 if the sweep is not refined, or if nothing follows from the results.
    """
    known = [result for result in results if "regime" in result.columns]
    if config.refine is None or config.refine.also is not None or layout.total > _MOST_GUESSED or not known:
        return 0
    # Slow to import, and only this needs it.
    from scipy.spatial import KDTree

    from ringsweep.runs.refined import KnownLabels, decide

    labels = KnownLabels(config, layout.total)
    positions = np.concatenate([result.positions for result in known])
    columns = {
        name: np.concatenate([result.columns[name] for result in known]) for name in LABELS if name in known[0].columns
    }
    # Cells of one map are nearer to each other than to those of any other map.
    apart = [1.0 if dim in config.refine.dims else 4.0 * layout.total for dim in config.axes.sizes]
    places = np.stack(layout.indices(np.arange(layout.total)), axis=1) * apart
    _, nearest = KDTree(places[positions]).query(places)
    guessed = {name: column[nearest] for name, column in columns.items()}
    labels.put(np.arange(layout.total), guessed | {"certified": np.ones(layout.total, dtype=np.int8)})
    found = decide(config, layout, labels, lambda _: None)
    return int(np.count_nonzero(found.origin != INFERRED))


def _whole(config: Config, layout: Layout, few: TaskResult) -> float:
    """Seconds that a whole cell takes, from cells that were run with at most :data:`_FEW` steps; 0 if not known."""
    most: int = getattr(config.solver, "steps", getattr(config.solver, "max_steps", _FEW))
    share = min(_FEW / most, 1.0)
    if "t_end" in few.columns and not hasattr(config.solver, "steps"):
        indices = dict(zip(config.axes.sizes, layout.indices(few.positions), strict=True))
        spans = values_at(config.scene, config.axes, indices, len(few.positions))["time.span"]
        share = max(share, float(np.mean(few.columns["t_end"] / spans)))
    known = config.sample is None and few.seconds is not None
    return few.seconds / len(few.positions) / share if known and few.seconds else 0.0


def _measure(config: Config, layout: Layout) -> tuple[list[TaskResult] | None, float]:
    """Results of cells spread over the grid, and seconds that a cell takes by a few steps of the first ones.

    The first cells, which may compile kernels, are left out. If they do not come, there are no results: None.
    """
    draw = np.random.default_rng(0)
    few = layout.total <= _MOST
    drawn = draw.permutation(layout.total) if few else draw.integers(layout.total, size=_MOST)
    side = 1 if config.sample else config.solver.side_by_side
    limits = {field.name for field in fields(config.solver)} & {"steps", "max_steps"}
    few_steps = replace(config.solver, **{name: min(getattr(config.solver, name), _FEW) for name in limits})
    results: list[TaskResult] = []
    errors: list[BaseException] = []
    begun: list[float] = []
    began = Event()

    def compute(config: Config, positions: NDArray[np.integer]) -> None:
        if config.sample is None:
            # A cell that starts from another one costs about as much.
            results.append(compute_task(replace(config, follow=None), layout, positions))
        else:
            results.append(sampled.compute_parts(config, layout, positions))

    def work() -> None:
        try:
            # The first ones may compile or load kernels. Of them a few steps are enough.
            for _ in range(2):
                compute(replace(config, solver=few_steps), drawn[:side])
                began.set()
            begun.append(_whole(config, layout, results.pop()))
            start, stop, until = 0, side, monotonic() + _MEASURING / 2
            while start < len(drawn) and monotonic() < until:
                compute(config, drawn[start:stop])
                start, stop = stop, 2 * stop
        except BaseException as error:
            errors.append(error)
            began.set()

    # A thread, since cells may run longer than anyone waits.
    thread = Thread(target=work, daemon=True)
    thread.start()
    if not began.wait(_FIRST):
        return None, 0.0
    thread.join(2.0 * _MEASURING)
    if errors:
        raise errors[0]
    return results[1:], begun[0] if begun else 0.0


def size(number: float) -> str:
    """A number of bytes in words."""
    power = min(int(math.log10(max(number, 1.0)) / 3.0), 4)
    return f"{number / 1000.0**power:.3g} {('B', 'kB', 'MB', 'GB', 'TB')[power]}"


def duration(seconds: float) -> str:
    """A time in words."""
    for unit, length in (("days", 86400.0), ("h", 3600.0), ("min", 60.0)):
        if seconds >= 2.0 * length:
            return f"{seconds / length:.2g} {unit}"
    return f"{max(seconds, 0.1):.2g} s"
