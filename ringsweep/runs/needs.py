"""What a sweep needs: cells, memory, disk and time, before it runs."""

from __future__ import annotations

import math
import os
import shutil
from contextlib import suppress
from dataclasses import fields, replace
from pathlib import Path

import joblib
import numpy as np

from ringsweep.config import Config
from ringsweep.config.axes import values_at
from ringsweep.errors import InputError
from ringsweep.quantities.flags import FAILED
from ringsweep.runs.cells import compute_task
from ringsweep.runs.grid import Grid
from ringsweep.runs.plans import plan_of
from ringsweep.storage import netcdf
from ringsweep.storage.checkpoint import cells_done
from ringsweep.storage.chunks import Layout
from ringsweep.storage.provenance import fingerprint, identity

# Bytes of this process without cells, and for each cell of the grid; from benchmarks/results/sizes.md.
_PROCESS, _BOOKKEEPING = 300e6, 33.0

# Bytes for each cell of the picture, which has no more pixels than that.
_PICTURE, _MOST_DRAWN = 120.0, 1 << 20

# Bytes of a finished file without cells, and the share of its columns that compression leaves: 0.55 of some thousand
# cells, 0.4 of millions.
_FILE, _COMPRESSED = 40e3, 0.55

# Steps of each run that is measured, most of these runs, and seconds to measure them.
_FEW, _MOST, _MEASURING = 1000, 100_000, 0.5


def check_room(plan: Grid, cells: int, folder: Path | None) -> None:
    """Make sure that a sweep fits into the memory, and onto the disk.

    Parameters
    ----------
    plan : Grid
    cells : int
        Number of cells that are still to be computed.
    folder : Path, optional
        Where the file is written; None for a sweep in memory.

    Raises
    ------
    InputError
        If it does not fit.
    """
    needed, there = memory_needed(plan, folder is None), memory_of_machine()
    if needed > there:
        cure = ": name a file as output" * (folder is None)
        raise InputError("sweep", f"the grid needs {size(needed)} of memory, and this machine has {size(there)}{cure}")
    if folder is None or plan.at_most:
        return
    needed, there = float(cells * plan.bytes_of_cell()), shutil.disk_usage(folder).free
    if needed > there:
        problem = f"{cells} cells need {size(needed)} on the disk, and {size(there)} are free in {folder}"
        raise InputError("sweep", problem)


def memory_needed(plan: Grid, in_memory: bool) -> float:
    """Bytes of memory that a sweep takes at most."""
    total = plan.grid.total
    each = _BOOKKEEPING + (2.0 * plan.bytes_of_cell() if in_memory else 0.0)
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
    """Cells, memory, disk and estimated time of a sweep, as lines of text. Some of its runs are begun for it.

    Cells that are done, or that the file `reuse` of an earlier sweep has, are counted and take no time.

    Raises
    ------
    InputError
        If it fits neither into the memory nor onto the disk.
    """
    plan, folder, threads = plan_of(config, reuse), target.resolve().parent, jobs or joblib.cpu_count()
    sizes, total, key = plan.config.axes.sizes, plan.grid.total, fingerprint(identity(plan.config))
    done = cells_done(target.resolve(), key) // plan.parts_of_cell
    if target.exists():
        with netcdf.open_dataset(target) as ds:
            done = total if ds.attrs.get("fingerprint") == key else done
    elif plan.earlier is not None:
        none = np.zeros(total, dtype=bool)
        done += sum(len(positions) for positions, _ in plan.earlier.shared_cells(plan.config, plan.grid, none, ()))
    check_room(plan, total - done, folder)
    columns, left = float(total * plan.bytes_of_cell()), (total - done) * plan.runs_of_cell
    finished = _FILE + columns * (_COMPRESSED if total >= netcdf.COMPRESSED_FROM else 1.0)
    seconds = _seconds_of_run(plan.config) * left / min(threads, left) if left else 0.0
    most, several = "at most " * plan.at_most, plan.runs_of_cell > 1
    words = [f"{most}{total}", f"{plan.runs_of_cell} runs in each" * several, f"{done} of them are done" * bool(done)]
    words[0] += f" ({', '.join(f'{name} {length}' for name, length in sizes.items())})" * bool(sizes)
    return "\n".join(
        (
            f"cells: {'; '.join(filter(None, words))}",
            f"memory: some {size(memory_needed(plan, False))} of {size(memory_of_machine())}",
            f"disk: {most}{size(columns + finished)} while it runs, then {most}{size(finished)}"
            f"; {size(shutil.disk_usage(folder).free)} are free in {folder}",
            f"time: {most}about {duration(seconds)} on {threads} threads, once the kernels are compiled",
        )
    )


def _seconds_of_run(config: Config) -> float:
    """Seconds of a run in one thread, from the first steps of runs that are spread over the sweep."""
    solver, sample = config.solver, config.sample
    limits = {field.name for field in fields(solver)} & {"steps", "max_steps"}
    few = replace(solver, **{name: min(getattr(solver, name), _FEW) for name in limits})
    axes = config.axes if sample is None else sample.axes(config.scene, config.axes, sample.shares)
    # A cell that starts from another one costs about as much.
    one = replace(config, axes=axes, sample=None, follow=None, solver=few)
    layout = Layout(tuple(axes.sizes.values()))
    drawn = np.random.default_rng(0).integers(layout.total, size=_MOST)
    run, side, seconds, finished = 0, solver.side_by_side, 0.0, 0.0
    while run < len(drawn) and seconds < _MEASURING:
        positions = drawn[run : run + side]
        result = compute_task(one, layout, positions)
        if result.seconds is None:
            # Kernels may have been compiled: the next task has the same runs.
            continue
        indices = dict(zip(axes.sizes, layout.indices(positions), strict=True))
        spans = values_at(config.scene, axes, indices, len(positions))["time.span"]
        unfinished = result.columns["regime"] == FAILED
        finished += float(np.where(unfinished, result.columns["t_end"] / spans, 1.0).sum())
        run, side, seconds = run + side, 2 * side, seconds + result.seconds
    return seconds / finished * getattr(solver, "steps", 1) / getattr(few, "steps", 1)


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
