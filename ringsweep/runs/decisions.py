"""Which cells of a map come next: decisions on labels alone, without solver, scene or files.

The cells of a coarse lattice come first. Each level halves the intervals of the lattice. A new point of the lattice
takes the label of the points around it if these agree, and is computed if they do not. Then every pair of neighbours in
the lattice that differ is computed. Around each point that differs from what was inferred, the points within three
steps that differ from it are computed too, until no new one appears. So a boundary is followed from point to point,
even if it leaves a block through an edge whose ends agree. Around what is thinner than the lattice all points within
three steps are computed, since its parts may lie between the points. On the last level the lattice is the grid. What it
infers is audited.
"""

from __future__ import annotations

import math
from bisect import bisect_left
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ringsweep.quantities.variables import AUDITED, COMPUTED, INFERRED

#: Confidence of the bound on wrong cells.
CONFIDENCE = 0.95

_NEAR = tuple((down, right) for down in range(-3, 4) for right in range(-3, 4) if 0 < abs(down) + abs(right) <= 3)

Cells = NDArray[np.intp]

#: Runs the cells at some flat indices, and returns the label of each: at least 0, or its complement, which is negative,
#: if the cell is not certain. A neighbour cannot take the label of such a cell, so beside it every cell is run.
Run = Callable[[Cells], NDArray[np.int16]]


@dataclass(frozen=True)
class Findings:
    """What the audit of a map found.

    Attributes
    ----------
    cells : int
        Inferred cells that were drawn at random and computed.
    wrong : int
        How many of them had been inferred wrongly.
    corrected : int
        Cells inferred wrongly that were found, the drawn ones and those that following them has found.
    bound : float
        Upper bound, at 95 % confidence, on the share of wrong cells among those that are still inferred.
    """

    cells: int
    wrong: int
    corrected: int
    bound: float


@dataclass(frozen=True)
class Decided:
    """A refined map; arrays have the shape of the grid.

    Attributes
    ----------
    labels : ndarray of int16
    origin : ndarray of int8
        `COMPUTED`, `INFERRED` or `AUDITED`.
    level : ndarray of int8
        How often the coarse block around the cell was halved when the cell was computed or inferred.
    audit : Findings
    """

    labels: NDArray[np.int16]
    origin: NDArray[np.int8]
    level: NDArray[np.int8]
    audit: Findings


def refine(shape: tuple[int, int, int], stride: int, audit: float, run: Run, *, seed: int = 0) -> Decided:
    """Refine the last two axes of a grid.

    Parameters
    ----------
    shape : tuple of int
        Number of maps, and rows and columns of each.
    stride : int
        Rows and columns from one point of the coarse lattice to the next.
    audit : float
        Share of the inferred cells that are audited.
    run : callable
        Runs cells; it is called with no cell twice.
    seed : int
        Seed of the audit.
    """
    grid = _Grid(shape, stride, run)
    grid.compute(np.arange(grid.labels.size))
    while not grid.is_finest:
        grid.halve()
    return _audited(grid, audit, np.random.default_rng(seed))


class _Grid:
    """A lattice in a grid that becomes finer; `labels`, `known` and `level` are those of its points."""

    def __init__(self, shape: tuple[int, int, int], stride: int, run: Run):
        self.shape, self.stride, self.run = shape, stride, run
        self.rows, self.columns = (_coarse(size, stride) for size in shape[1:])
        self.depth = 0
        lattice = shape[0], len(self.rows), len(self.columns)
        self.labels = np.zeros(lattice, dtype=np.int16)
        self.known = np.zeros(lattice, dtype=bool)
        self.level = np.zeros(lattice, dtype=np.int8)

    @property
    def is_finest(self) -> bool:
        """Whether the lattice is the grid."""
        return self.labels.shape == self.shape

    def halve(self) -> None:
        """Halve all intervals, and compute what cannot be inferred."""
        self.depth += 1
        (rows, *row_parents), (columns, *column_parents) = _halved(self.rows), _halved(self.columns)
        corners = [(r, c) for r in row_parents for c in column_parents]
        around = [self.labels[:, r][:, :, c] for r, c in corners]
        is_old = (row_parents[0] == row_parents[1])[:, None] & (column_parents[0] == column_parents[1])
        agree = around[0] >= 0
        for other in around[1:]:
            agree &= around[0] == other
        level = np.where(is_old, self.level[:, corners[0][0]][:, :, corners[0][1]], self.depth)
        # Within a block whose corners agree a point belongs to that block, however small the lattice has become.
        ancestor = np.minimum.reduce([self.level[:, r][:, :, c] for r, c in corners])
        inferred = [~self.known[:, r][:, :, c] for r, c in corners]
        level = np.where(~is_old & agree & np.logical_or.reduce(inferred), ancestor, level)
        self.known = self.known[:, row_parents[0]][:, :, column_parents[0]] & is_old
        self.labels, self.level = around[0], level.astype(np.int8)
        self.rows, self.columns = rows, columns
        self.compute(np.flatnonzero(~agree & ~is_old))
        self.follow(self._beside_others())
        while len(near_thin := self._near_thin()):
            self.follow(near_thin)

    def follow(self, cells: Cells) -> None:
        """Compute points, and those near them that differ from them where they differ from what was inferred."""
        while len(cells):
            surprising = self.compute(cells)
            cells = self._differing_near(cells[surprising])

    def compute(self, points: Cells) -> NDArray[np.bool_]:
        """Compute points of the lattice that are not known; returns which differ from what was inferred."""
        if not len(points):
            return np.zeros(0, dtype=bool)
        layer, row, column = np.unravel_index(points, self.labels.shape)
        labels = self.run(np.ravel_multi_index((layer, self.rows[row], self.columns[column]), self.shape))
        surprising = self.labels.flat[points] != labels
        self.labels.flat[points], self.known.flat[points], self.level.flat[points] = labels, True, self.depth
        return surprising

    def _beside_others(self) -> Cells:
        """Points that are not known and have a neighbour with another label."""
        found = np.zeros(self.labels.shape, dtype=bool)
        for axis in (1, 2):
            labels, beside = np.moveaxis(self.labels, axis, 0), np.moveaxis(found, axis, 0)
            differ = (labels[:-1] != labels[1:]) | (labels[:-1] < 0)
            beside[:-1] |= differ
            beside[1:] |= differ
        return np.flatnonzero(found & ~self.known)

    def _near_thin(self) -> Cells:
        """Points that are not known, near a point that differs from those on both sides of it."""
        thin = np.zeros(self.labels.shape, dtype=bool)
        for axis in (1, 2):
            labels = np.moveaxis(self.labels, axis, 0)
            differ = labels[:-1] != labels[1:]
            np.moveaxis(thin, axis, 0)[1:-1] |= differ[:-1] & differ[1:]
        points = np.flatnonzero(thin)
        cells = np.union1d(points, self._around(points)[0])
        return cells[~self.known.flat[cells]]

    def _differing_near(self, points: Cells) -> Cells:
        """Points near some points that are not known and have another label."""
        cells, which = self._around(points)
        cells = cells[self.labels.flat[cells] != self.labels.flat[points[which]]]
        return np.unique(cells[~self.known.flat[cells]])

    def _around(self, points: Cells) -> tuple[Cells, Cells]:
        """Points of the lattice within three steps of each point, and the index of that point."""
        layer, row, column = np.unravel_index(points, self.labels.shape)
        cells, which = [], []
        for down, right in _NEAR:
            there = row + down, column + right
            inside = (there[0] >= 0) & (there[0] < len(self.rows)) & (there[1] >= 0) & (there[1] < len(self.columns))
            place = layer[inside], there[0][inside], there[1][inside]
            cells.append(np.ravel_multi_index(place, self.labels.shape))
            which.append(np.flatnonzero(inside))
        return np.concatenate(cells), np.concatenate(which)


def _audited(grid: _Grid, share: float, random: np.random.Generator) -> Decided:
    """Compute a sample of the inferred cells, follow what was wrong, and state how much may still be wrong.

    One sample is drawn, before anything is known of it, so the bound holds for the labels of that moment. From then on
    no cell changes its label unless it is computed: the number of wrong cells falls by those that are found.
    """
    inferred = np.flatnonzero(~grid.known)
    before = grid.labels.copy()
    count = min(len(inferred), math.ceil(share * len(inferred)))
    sample = np.sort(random.choice(inferred, count, replace=False))
    surprising = grid.compute(sample)
    wrong = _differ(grid.labels.flat[sample], before.flat[sample])
    blocks = _Blocks(grid)
    found = sample[surprising]
    grid.follow(grid._differing_near(found))
    while len(found):
        opened = blocks.reopened(found)
        surprising = grid.compute(opened)
        found = opened[surprising]
        grid.follow(grid._differing_near(found))
    followed = inferred[grid.known.flat[inferred]]
    corrected = int(_differ(grid.labels.flat[followed], before.flat[followed]).sum())
    origin = np.where(grid.known, np.int8(COMPUTED), np.int8(INFERRED))
    origin.flat[sample] = AUDITED
    left = len(inferred) - len(followed)
    most = largest_number(len(inferred), count, int(wrong.sum())) - corrected
    bound = min(max(most, 0), left) / left if left else 0.0
    labels = np.where(grid.labels < 0, ~grid.labels, grid.labels)
    return Decided(labels, origin, grid.level, Findings(count, int(wrong.sum()), corrected, bound))


class _Blocks:
    """Coarse blocks, and how often the lattice of each was halved when it was reopened."""

    def __init__(self, grid: _Grid):
        self.grid = grid
        self.counts = [max(-(-(size - 1) // grid.stride), 1) for size in grid.shape[1:]]
        self.halvings = np.zeros((grid.shape[0], *self.counts), dtype=np.int8)

    def reopened(self, cells: Cells) -> Cells:
        """Inferred cells that are computed next, in the blocks of some cells and beside these blocks."""
        layer, row, column = np.unravel_index(cells, self.grid.shape)
        before = self.halvings
        own = np.zeros(before.shape, dtype=bool)
        # The last row and column of the grid belong to the blocks before them.
        rows, columns = (
            np.minimum(k // self.grid.stride, n - 1) for k, n in zip((row, column), self.counts, strict=True)
        )
        own[layer, rows, columns] = True
        # This import takes longer than a small sweep.
        from scipy.ndimage import binary_dilation

        beside = binary_dilation(own, np.ones((1, 3, 3)))
        self.halvings = np.where(own, before + 1, np.maximum(before, beside))
        found = [np.empty(0, dtype=np.intp)]
        for k, i, j in np.argwhere(self.halvings != before):
            step = max(self.grid.stride >> int(self.halvings[k, i, j]), 1)
            rows, columns = (
                np.arange(n * self.grid.stride, min((n + 1) * self.grid.stride + 1, size), step)
                for n, size in ((i, self.grid.shape[1]), (j, self.grid.shape[2]))
            )
            found.append(np.ravel_multi_index(np.ix_([k], rows, columns), self.grid.shape).ravel())
        points = np.unique(np.concatenate(found))
        return points[~self.grid.known.flat[points]]


def _differ(one: NDArray[np.int16], other: NDArray[np.int16]) -> NDArray[np.bool_]:
    """Whether labels differ, certain or not."""
    return np.where(one < 0, ~one, one) != np.where(other < 0, ~other, other)


def _coarse(size: int, stride: int) -> Cells:
    """Every `stride`-th index, and the last one."""
    return np.unique(np.append(np.arange(0, size, stride), size - 1))


def _halved(points: Cells) -> tuple[Cells, Cells, Cells]:
    """Indices with those between them, and the place among `points` of the last before and the first after each."""
    between = (points[:-1] + points[1:]) // 2
    fine = np.union1d(points, between)
    return fine, np.searchsorted(points, fine, side="right") - 1, np.searchsorted(points, fine)


def largest_number(total: int, drawn: int, wrong: int) -> int:
    """Largest number of wrong cells that a sample does not contradict.

    The bound of Clopper and Pearson, one-sided at 95 %, for a sample drawn without replacement; a share of about 3/n
    for a sample of n cells of which none is wrong.

    Parameters
    ----------
    total, drawn : int
        Cells, and how many of them were drawn at random.
    wrong : int
        How many of the drawn ones are wrong.
    """
    # It is slow to import, and only an audit needs it.
    from scipy.stats import hypergeom

    more = range(wrong + 1, total - (drawn - wrong) + 1)
    return wrong + bisect_left(more, CONFIDENCE - 1.0, key=lambda number: -hypergeom.cdf(wrong, total, number, drawn))
