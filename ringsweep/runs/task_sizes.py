"""Division of a sweep into tasks: their sizes follow from the cost of earlier tasks."""

from __future__ import annotations

import logging
import math
from collections.abc import Callable, Iterator
from threading import Event

import numpy as np
from numpy.typing import NDArray

from ringsweep.runs.cells import TaskResult
from ringsweep.storage.chunks import CHUNK, Layout

logger = logging.getLogger("ringsweep")


class TaskSizes:
    """Number of cells of the next task.

    A task takes a hundredth of the time that all earlier tasks took, within bounds: a stopped sweep loses little, and
    there are few files. Towards the end tasks become smaller, so that no worker waits long for another.

    Parameters
    ----------
    side_by_side : int
        Cells that the solver runs at once: sizes are multiples of it.
    workers : callable
        Returns the number of tasks that are computed at once.
    """

    #: Bounds on the seconds of a task; the last bound holds towards the end.
    min_seconds, max_seconds, last_seconds = 0.1, 2.0, 0.005
    max_cells = CHUNK

    def __init__(self, side_by_side: int, workers: Callable[[], int]):
        self.side_by_side = side_by_side
        self.workers = workers
        self.seconds = 0.0
        self.seconds_per_cell = math.nan
        self.largest = side_by_side

    def learn(self, result: TaskResult) -> TaskResult:
        """Update the cost of a cell from a finished task, which is returned."""
        cells, seconds = len(result.positions), result.seconds
        logger.debug("a task of %d cells: %s", cells, "compiling" if seconds is None else f"{seconds:.3g} s")
        if seconds is not None:
            self.seconds += seconds
            cost = max(seconds, 1e-9) / cells
            # Neighbours in the order of the layout are neighbours in the grid, and cost about as much.
            self.seconds_per_cell = cost if math.isnan(self.seconds_per_cell) else 0.5 * (self.seconds_per_cell + cost)
            self.largest = max(self.largest, cells)
        return result

    def next(self, left: int) -> int:
        """Cells of the next task if `left` cells are left."""
        if math.isnan(self.seconds_per_cell):
            return self.side_by_side
        seconds = min(max(0.01 * self.seconds, self.min_seconds), self.max_seconds)
        share = max(left / (3 * max(self.workers(), 1)), self.last_seconds / self.seconds_per_cell)
        size = min(seconds / self.seconds_per_cell, share, 8 * self.largest, self.max_cells)
        return self.side_by_side * max(1, round(size / self.side_by_side))


def divide_cells(cells: NDArray[np.integer], sizes: TaskSizes, stopped: Event) -> Iterator[NDArray[np.integer]]:
    """Parts of some cells, which ascend; see :func:`divide_into_tasks`."""
    start = 0
    while start < len(cells) and not stopped.is_set():
        stop = start + min(sizes.next(len(cells) - start), len(cells) - start)
        yield cells[start:stop]
        start = stop


def divide_into_chains(
    layout: Layout, chain: int, dim: int, done: NDArray[np.bool_], sizes: TaskSizes, stopped: Event
) -> Iterator[NDArray[np.integer]]:
    """Positions of the cells of one task after another, ascending: of whole chains, of which no cell is done.

    Parameters
    ----------
    layout : Layout
    chain : int
        Number of cells of a chain.
    dim : int
        Place of their dimension among those of the layout.
    done, sizes, stopped
        As for :func:`divide_into_tasks`. Chains of which some cells are not done are computed again.
    """
    along = np.array(layout.sizes, dtype=np.intp)
    along[dim] = 1
    left = np.arange(layout.total // chain)

    def cells(chains: NDArray[np.intp]) -> NDArray[np.intp]:
        others = np.unravel_index(np.repeat(chains, chain), tuple(along))
        within = np.tile(np.arange(chain), len(chains))
        return layout.positions([within if k == dim else index for k, index in enumerate(others)])

    while len(left) and not stopped.is_set():
        size = max(sizes.next(len(left) * chain) // chain, sizes.side_by_side)
        positions = np.sort(cells(left[:size]))
        left = left[size:]
        if not done[positions].all():
            yield positions


def divide_into_tasks(done: NDArray[np.bool_], sizes: TaskSizes, stopped: Event) -> Iterator[NDArray[np.integer]]:
    """Positions of the cells of one task after another, ascending.

    Parameters
    ----------
    done : ndarray of bool, shape ``(cells,)``
        Cells that are in no task.
    sizes : TaskSizes
    stopped : Event
        Once it is set there are no more tasks.
    """
    left = len(done) - int(np.count_nonzero(done))
    start = 0
    while left and not stopped.is_set():
        size = min(sizes.next(left), left)
        left -= size
        found: list[NDArray[np.integer]] = []
        while size:
            stop = start + max(size, CHUNK)
            open_cells = start + np.flatnonzero(~done[start:stop])[:size]
            found.append(open_cells)
            size -= len(open_cells)
            start = stop if size else int(open_cells[-1]) + 1
        yield np.concatenate(found)
