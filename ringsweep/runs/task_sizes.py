"""Division of a sweep into tasks: their sizes follow from the cost of earlier tasks."""

from __future__ import annotations

import logging
import math
from collections.abc import Callable, Hashable, Iterator
from threading import Event

import numpy as np
from numpy.typing import NDArray

from ringsweep.runs.cells import TaskResult
from ringsweep.storage.chunks import CHUNK

logger = logging.getLogger("ringsweep")


# Cost of recent tasks, s and cells, and cells of the largest one, by kind of sweep.
_known: dict[Hashable, tuple[list[float], int]] = {}


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
    kind : hashable, optional
        Sweeps of one kind in this process have cells of about the same cost: the second one need not find it out.
    """

    #: Bounds on the seconds of a task; the last bound holds towards the end.
    min_seconds, max_seconds, last_seconds = 0.1, 2.0, 0.005
    max_cells = CHUNK

    def __init__(self, side_by_side: int, workers: Callable[[], int], kind: Hashable = None):
        self.side_by_side, self.workers, self.kind = side_by_side, workers, kind
        self.seconds = 0.0
        self._recent, self.largest = _known.get(kind, ([0.0, 0.0], side_by_side))

    @property
    def seconds_per_cell(self) -> float:
        """Time that a cell of recent tasks took, s; NaN before the first one."""
        seconds, cells = self._recent
        return max(seconds, 1e-9) / cells if cells else math.nan

    def learn(self, result: TaskResult) -> TaskResult:
        """Update the cost of a cell from a finished task, which is returned."""
        cells, seconds = len(result.positions), result.seconds
        logger.debug("a task of %d cells: %s", cells, "compiling" if seconds is None else f"{seconds:.3g} s")
        if seconds is not None:
            self.seconds += seconds
            # Neighbours in the order of the layout are neighbours in the grid, and cost about as much. A task has its
            # own cost, so one of few cells says little.
            self._recent = [0.5 * before + now for before, now in zip(self._recent, (seconds, cells), strict=True)]
            self.largest = max(self.largest, cells)
            if self.kind is not None:
                _known[self.kind] = self._recent, self.largest
        return result

    def next(self, left: int) -> int:
        """Cells of the next task if `left` cells are left."""
        if math.isnan(self.seconds_per_cell):
            return self.side_by_side
        seconds = min(max(0.01 * self.seconds, self.min_seconds), self.max_seconds)
        workers = self.workers()
        # A single worker waits for no other.
        share = left if workers == 1 else left / (3 * max(workers, 1))
        share = max(share, self.last_seconds / self.seconds_per_cell)
        size = min(seconds / self.seconds_per_cell, share, 8 * self.largest, self.max_cells)
        return self.side_by_side * max(1, round(size / self.side_by_side))


def divide_into_tasks(
    done: NDArray[np.bool_], sizes: TaskSizes, stopped: Event, groups: NDArray[np.integer] | None = None
) -> Iterator[NDArray[np.integer]]:
    """Positions of the cells of one task after another, ascending.

    Parameters
    ----------
    done : ndarray of bool, shape ``(cells,)``
        Cells that are in no task.
    sizes : TaskSizes
    stopped : Event
        Once it is set there are no more tasks.
    groups : ndarray of int, shape ``(groups, cells of a group)``, optional
        Positions of cells that stay in one task; by default each cell is alone. A group of which some cells are not
        done is computed again.
    """
    groups = np.flatnonzero(~done)[:, None] if groups is None else groups[~done[groups].all(axis=1)]
    while len(groups) and not stopped.is_set():
        count = max(sizes.next(groups.size) // groups.shape[1], sizes.side_by_side)
        yield np.sort(groups[:count], axis=None)
        groups = groups[count:]
