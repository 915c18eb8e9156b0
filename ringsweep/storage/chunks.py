"""Order of the cells of a sweep: chunk by chunk, a chunk being what is compressed and read as one.

A map of two dimensions of a sweep over five then reads the few chunks that it passes through, a chunk of finished
cells touches few chunks, and a file is written chunk after chunk, each of them once.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

#: Cells of a chunk at most: 256 KiB of a variable of doubles.
CHUNK = 32_768


class Layout:
    """Cells of a grid and the order in which they stand, one chunk after another.

    Parameters
    ----------
    sizes : sequence of int
        Length of each dimension.
    chunk : sequence of int, optional
        Length of a chunk along each dimension, those at the edges being shorter. By default the longest is
        halved until the product is at most :data:`CHUNK`.
    """

    def __init__(self, sizes: Sequence[int], chunk: Sequence[int] | None = None):
        self.sizes = tuple(sizes)
        self.total = math.prod(self.sizes)
        self.chunk = tuple(chunk) if chunk is not None else _halved(self.sizes)

    @cached_property
    def _chunks(self) -> tuple[NDArray[np.intp], NDArray[np.intp], NDArray[np.intp]]:
        """First index and shape of each chunk, ``(chunks, dimensions)``, and the position of its first cell."""
        firsts = [np.arange(0, size, edge) for size, edge in zip(self.sizes, self.chunk, strict=True)]
        origins = np.stack(np.meshgrid(*firsts, indexing="ij"), axis=-1).reshape(-1, len(firsts))
        shapes = np.minimum(np.array(self.sizes, dtype=np.intp) - origins, self.chunk)
        return origins, shapes, np.cumsum(shapes.prod(axis=1)) - shapes.prod(axis=1)

    def indices(self, positions: NDArray[np.integer]) -> tuple[NDArray[np.intp], ...]:
        """Where along each dimension the cells at these positions of the order lie; each as long as `positions`."""
        if not self.sizes:
            return ()
        origins, shapes, begins = self._chunks
        which = np.searchsorted(begins, positions, side="right") - 1
        rest = positions - begins[which]
        found = []
        for dim in reversed(range(len(self.sizes))):
            rest, along = np.divmod(rest, shapes[which, dim])
            found.append(origins[which, dim] + along)
        return tuple(found[::-1])

    def chunks(self) -> Iterator[tuple[int, int, tuple[slice, ...]]]:
        """First position, the one after the last, and place in the grid of every chunk, in order."""
        if not self.sizes:
            yield 0, 1, ()
            return
        for origin, shape, begin in zip(*self._chunks, strict=True):
            place = tuple(slice(int(o), int(o + n)) for o, n in zip(origin, shape, strict=True))
            yield int(begin), int(begin + shape.prod()), place


def _halved(sizes: tuple[int, ...]) -> tuple[int, ...]:
    chunk = list(sizes)
    while math.prod(chunk) > CHUNK:
        longest = chunk.index(max(chunk))
        chunk[longest] = -(-chunk[longest] // 2)
    return tuple(chunk)
