"""Order of the cells of a sweep: chunk by chunk, as NetCDF compresses and reads them.

A file is written chunk after chunk, each chunk once. The cells of a task lie in few chunks. A map of two dimensions of
a sweep over five reads only the chunks that it crosses.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    import xarray as xr

#: Largest number of cells of a chunk: 256 KiB of a variable of doubles.
CHUNK = 32_768


class Layout:
    """Cells of a grid in their order, one chunk after another.

    Parameters
    ----------
    sizes : sequence of int
        Length of each dimension.
    chunk : sequence of int, optional
        Length of a chunk along each dimension; chunks at the edges may be shorter. By default the longest dimension is
        halved until a chunk has at most :data:`CHUNK` numbers.
    points : int, optional
        Numbers of a cell in its longest variable.
    """

    def __init__(self, sizes: Sequence[int], chunk: Sequence[int] | None = None, points: int = 1):
        self.sizes = tuple(sizes)
        self.total = math.prod(self.sizes)
        self.chunk = tuple(chunk) if chunk is not None else chunk_shape(self.sizes, max(CHUNK // points, 1))

    @cached_property
    def _chunks(self) -> tuple[NDArray[np.intp], NDArray[np.intp], NDArray[np.intp]]:
        """First index and shape of each chunk, both ``(chunks, dimensions)``, and the position of its first cell."""
        # A single cell is one along a dimension that no caller sees.
        sizes, chunk = self.sizes or (1,), self.chunk or (1,)
        firsts = [np.arange(0, size, edge) for size, edge in zip(sizes, chunk, strict=True)]
        origins = np.stack(np.meshgrid(*firsts, indexing="ij"), axis=-1).reshape(-1, len(firsts))
        shapes = np.minimum(np.array(sizes, dtype=np.intp) - origins, chunk)
        return origins, shapes, np.cumsum(shapes.prod(axis=1)) - shapes.prod(axis=1)

    def indices(self, positions: NDArray[np.integer]) -> tuple[NDArray[np.intp], ...]:
        """Index along each dimension of the cells at these positions, each of shape ``(len(positions),)``."""
        origins, shapes, starts = self._chunks
        which = np.searchsorted(starts, positions, side="right") - 1
        rest = positions - starts[which]
        found = []
        for dim in reversed(range(len(self.sizes))):
            rest, within = np.divmod(rest, shapes[which, dim])
            found.append(origins[which, dim] + within)
        return tuple(found[::-1])

    def positions(self, indices: Sequence[NDArray[np.integer]]) -> NDArray[np.intp]:
        """Positions of the cells at these indices along each dimension; the inverse of :meth:`indices`."""
        if not self.sizes:
            return np.zeros(1, dtype=np.intp)
        _, shapes, starts = self._chunks
        counts = [-(-size // edge) for size, edge in zip(self.sizes, self.chunk, strict=True)]
        which = np.ravel_multi_index([i // edge for i, edge in zip(indices, self.chunk, strict=True)], counts)
        place = np.zeros(len(which), dtype=np.intp)
        for dim, (index, edge) in enumerate(zip(indices, self.chunk, strict=True)):
            place = place * shapes[which, dim] + index % edge
        return starts[which] + place

    def chunks(self) -> Iterator[tuple[int, int, tuple[slice, ...]]]:
        """First position, last position plus one, and slices in the grid of every chunk, in order."""
        for origin, shape, start in zip(*self._chunks, strict=True):
            region = tuple(slice(int(o), int(o + n)) for o, n, _ in zip(origin, shape, self.sizes, strict=False))
            yield int(start), int(start + shape.prod()), region


def chunk_shape(sizes: Sequence[int], most: int) -> tuple[int, ...]:
    """Lengths of a chunk of at most so many cells: the longest dimension is halved until they fit."""
    shape = list(sizes)
    while math.prod(shape) > most:
        longest = shape.index(max(shape))
        shape[longest] = -(-shape[longest] // 2)
    return tuple(shape)


def parts(ds: xr.Dataset, *names: str) -> Iterator[list[Any]]:
    """Values of variables of one shape, chunk by chunk: a dataset would keep all that was read at once.

    Parameters
    ----------
    ds : xarray.Dataset
    *names : str
        The dataset has the first one. In the place of another one that it lacks is None.
    """
    variables = [ds.variables[name] if name in ds else None for name in names]
    for _, _, region in Layout(ds.variables[names[0]].shape).chunks():
        yield [None if variable is None else np.atleast_1d(variable[region].values) for variable in variables]
