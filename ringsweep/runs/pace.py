"""Cells to tasks, sized by what those before have cost."""

from __future__ import annotations

import logging
import math
from collections.abc import Callable, Iterator
from threading import Event
from typing import Generic, Protocol, TypeVar

import numpy as np
from numpy.typing import NDArray

from ringsweep.storage.chunks import CHUNK


class _Measured(Protocol):
    """Cells at some positions, and the seconds that they took: None if something else came between."""

    @property
    def positions(self) -> NDArray[np.integer]: ...

    @property
    def seconds(self) -> float | None: ...


Measured = TypeVar("Measured", bound=_Measured)

logger = logging.getLogger("ringsweep")


class Pace(Generic[Measured]):
    """How many cells the next task takes, from what those before have cost.

    A task takes a hundredth of the time that all before it have taken, within bounds: what a stopped sweep loses
    stays small, and so does the number of files. Towards the end it takes a share of what is left, so that no worker
    waits long for another.
    """

    shortest, longest, last = 0.1, 2.0, 0.02
    most = CHUNK

    def __init__(self, side_by_side: int, workers: Callable[[], int]):
        self.side_by_side = side_by_side
        self.workers = workers
        self.spent = 0.0
        self.cost = math.nan
        self.largest = side_by_side

    def learn(self, finished: Measured) -> Measured:
        """Take note of what a task has cost; returns it."""
        cells, seconds = len(finished.positions), finished.seconds
        logger.debug("a task of %d cells: %s", cells, "compiling" if seconds is None else f"{seconds:.3g} s")
        if seconds is not None:
            self.spent += seconds
            cost = max(seconds, 1e-9) / cells
            # Neighbours in the order are neighbours in the grid, and alike.
            self.cost = cost if math.isnan(self.cost) else 0.5 * (self.cost + cost)
            self.largest = max(self.largest, cells)
        return finished

    def next(self, left: int) -> int:
        """Cells of the next task where so many are left."""
        if math.isnan(self.cost):
            return self.side_by_side
        seconds = min(max(0.01 * self.spent, self.shortest), self.longest)
        share = max(left / (3 * max(self.workers(), 1)), self.last / self.cost)
        size = min(seconds / self.cost, share, 8 * self.largest, self.most)
        return self.side_by_side * max(1, round(size / self.side_by_side))


def tasks(done: NDArray[np.bool_], left: int, pace: Pace, stopped: Event) -> Iterator[NDArray[np.integer]]:
    """Positions of the `left` cells that are not done, ascending, as many at a time as `pace` says, until `stopped`."""
    begin = 0
    while left and not stopped.is_set():
        size = min(pace.next(left), left)
        found: list[NDArray[np.integer]] = []
        while size:
            end = begin + max(size, CHUNK)
            free = begin + np.flatnonzero(~done[begin:end])[:size]
            found.append(free)
            size -= len(free)
            left -= len(free)
            begin = end if size else int(free[-1]) + 1
        yield np.concatenate(found)
