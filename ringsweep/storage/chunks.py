"""Order of the cells of a sweep: brick by brick, a brick being what is compressed and read as one.

A map of two dimensions of a sweep over five then reads the few bricks that it passes through, a chunk of finished
cells touches few bricks, and a file is written brick after brick, each of them once.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

#: Cells of a brick at most: 256 KiB of a variable of doubles.
BRICK = 32_768


class Layout:
    """Cells of a grid and the order in which they stand, one brick after another.

    Parameters
    ----------
    sizes : sequence of int
        Length of each dimension.
    brick : sequence of int, optional
        Length of a brick along each dimension, those at the edges being shorter. By default the longest is
        halved until the product is at most :data:`BRICK`.
    """

    def __init__(self, sizes: Sequence[int], brick: Sequence[int] | None = None):
        self.sizes = tuple(sizes)
        self.total = math.prod(self.sizes)
        self.brick = tuple(brick) if brick is not None else _halved(self.sizes)

    @cached_property
    def _bricks(self) -> tuple[NDArray[np.intp], NDArray[np.intp], NDArray[np.intp]]:
        """First index and shape of each brick, ``(bricks, dimensions)``, and the position of its first cell."""
        firsts = [np.arange(0, size, edge) for size, edge in zip(self.sizes, self.brick, strict=True)]
        origins = np.stack(np.meshgrid(*firsts, indexing="ij"), axis=-1).reshape(-1, len(firsts))
        shapes = np.minimum(np.array(self.sizes, dtype=np.intp) - origins, self.brick)
        return origins, shapes, np.cumsum(shapes.prod(axis=1)) - shapes.prod(axis=1)

    def indices(self, positions: NDArray[np.integer]) -> tuple[NDArray[np.intp], ...]:
        """Where along each dimension the cells at these positions of the order lie; each as long as `positions`."""
        if not self.sizes:
            return ()
        origins, shapes, begins = self._bricks
        which = np.searchsorted(begins, positions, side="right") - 1
        rest = positions - begins[which]
        found = []
        for dim in reversed(range(len(self.sizes))):
            rest, along = np.divmod(rest, shapes[which, dim])
            found.append(origins[which, dim] + along)
        return tuple(found[::-1])

    def bricks(self) -> Iterator[tuple[int, int, tuple[slice, ...]]]:
        """First position, the one after the last, and place in the grid of every brick, in order."""
        if not self.sizes:
            yield 0, 1, ()
            return
        for origin, shape, begin in zip(*self._bricks, strict=True):
            place = tuple(slice(int(o), int(o + n)) for o, n in zip(origin, shape, strict=True))
            yield int(begin), int(begin + shape.prod()), place


def _halved(sizes: tuple[int, ...]) -> tuple[int, ...]:
    brick = list(sizes)
    while math.prod(brick) > BRICK:
        longest = brick.index(max(brick))
        brick[longest] = -(-brick[longest] // 2)
    return tuple(brick)
