"""Axes of a regime map: values, order and scale of the coordinates along them."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
import xarray as xr
from matplotlib.ticker import LogFormatterSciNotation
from numpy.typing import NDArray

from ringsweep.errors import InputError
from ringsweep.plots.datasets import WITHIN, is_numeric, resolve
from ringsweep.plots.labels import axis_label, display_factor, number_text, value_text
from ringsweep.plots.selection import select
from ringsweep.quantities.variables import swept


class _PlainNumbers(LogFormatterSciNotation):
    """Ticks of a logarithmic axis as plain numbers."""

    def __call__(self, x: float, pos: int | None = None) -> str:
        return number_text(x, "g") if super().__call__(x, pos) else ""


_LARGEST = 1e300


@dataclass(frozen=True)
class Axis:
    """A coordinate as an axis of a map.

    Attributes
    ----------
    name : str
        Name of the coordinate.
    dims : tuple of str
        Its dimensions.
    label : str
        Text beside the axis.
    values : ndarray of shape ``(size,)``
        Sorted values as displayed, angles in degrees. A name has its position among `names` as value.
    order : ndarray of shape ``(size,)``
        Index in the dataset of each value.
    factor : float
        From numbers of the dataset to those displayed.
    scale : str
        ``"log"`` or ``"linear"``.
    names : tuple of str
        Values that are names, friction laws for example, in the order of the dataset; empty for numbers.
    meet : ndarray of shape ``(boundaries,)``
        Positions at which neighbouring cells meet, where that is not halfway between them.
    """

    name: str
    dims: tuple[str, ...]
    label: str
    values: NDArray[Any]
    order: NDArray[np.intp]
    factor: float
    scale: str
    names: tuple[str, ...] = ()
    meet: NDArray[Any] = field(default_factory=lambda: np.empty(0))

    @classmethod
    def of(cls, coordinate: xr.DataArray, ds: xr.Dataset) -> Axis:
        """The axis of a coordinate of a dataset; InputError if its values are too large."""
        names: tuple[str, ...] = ()
        factor = display_factor(coordinate)
        if is_numeric(coordinate):
            with np.errstate(over="ignore"):
                values = coordinate.values * factor
            # The edges of its cells lie beyond the values.
            if not (np.abs(values) < _LARGEST).all():
                raise InputError("ds", f"values of {coordinate.name} are too large to be drawn")
        else:
            given = coordinate.values.astype(str).tolist()
            names = tuple(dict.fromkeys(given))
            values = np.array([names.index(name) for name in given], dtype=float)
        order = np.argsort(values, kind="stable")
        scale = "log" if _is_geometric(np.unique(values)) else "linear"
        dims = tuple(map(str, coordinate.dims))
        return cls(str(coordinate.name), dims, axis_label(coordinate, ds), values[order], order, factor, scale, names)

    def within(self, ds: xr.Dataset) -> Axis:
        """The axis of a part of the dataset, in the same scale."""
        return replace(Axis.of(ds[self.name], ds), scale=self.scale)

    @property
    def is_gridded(self) -> bool:
        """Whether the axis can be an edge of a grid: one dimension, no value twice, and not a list of points."""
        return len(self.dims) == 1 and self.dims != ("point",) and len(np.unique(self.values)) == len(self.values)

    def along(self, data: xr.DataArray) -> NDArray[Any]:
        """Values of a variable, in the order of the axis; dimensions other than its own come last."""
        return np.asarray(data.transpose(*self.dims, ...).values[self.order])

    @property
    def edges(self) -> NDArray[Any]:
        """Edges of the cells, shape ``(size + 1,)``: halfway between neighbours in its scale, or at `meet`."""
        if len(self.values) == 1:
            half = 0.5 * abs(self.values[0]) or 0.5
            return np.array([self.values[0] - half, self.values[0] + half])
        at = np.log(self.values) if self.scale == "log" else self.values
        middles = (at[1:] + at[:-1]) / 2
        edges = np.concatenate([[2 * at[0] - middles[0]], middles, [2 * at[-1] - middles[-1]]])
        edges = np.exp(edges) if self.scale == "log" else edges
        if self.values[0] >= 0.0:
            # What has no negative values is not drawn with them.
            edges[0] = max(edges[0], 0.0)
        between = self.meet[(self.meet > self.values[0]) & (self.meet < self.values[-1])]
        edges[np.searchsorted(self.values, between)] = between
        return edges

    def values_at(self, data: xr.DataArray) -> NDArray[Any]:
        """Value at every element of `data`, shape ``(data.size,)``."""
        unsorted = np.empty_like(self.values)
        unsorted[self.order] = self.values
        return xr.DataArray(unsorted, dims=self.dims).broadcast_like(data).transpose(*data.dims).values.ravel()

    def apply(self, set_scale: Any, axis: Any) -> None:
        """Give scale and ticks to an axis of matplotlib; `set_scale` is ``Axes.set_xscale`` or ``set_yscale``."""
        set_scale(self.scale)
        if self.scale == "log" and self.values[0] >= 1e-3 and self.values[-1] < 1e5:
            axis.set_major_formatter(_PlainNumbers())
            axis.set_minor_formatter(_PlainNumbers(labelOnlyBase=False))
        if self.names:
            axis.set_ticks(range(len(self.names)), labels=self.names)


def choose_axes(
    ds: xr.Dataset, var: str, sel: Mapping[str, float | str], x: str | None, y: str | None
) -> tuple[xr.Dataset, list[str], Axis, Axis | None]:
    """Hold coordinates of a variable, and choose the axes of its map.

    Returns
    -------
    xarray.Dataset
        Without the dimensions that are held.
    list of str
        What is held.
    Axis, Axis
        The horizontal axis, and the vertical one if a second quantity was swept.

    Raises
    ------
    InputError
        If a single cell is left, `x` or `y` is no coordinate of the variable, or both are the same; see also
        :func:`ringsweep.plots.selection.select`.
    """
    # The texts also name what was held before, by `ds.isel` for example.
    held = [value_text(coordinate) for coordinate in swept(ds) if not coordinate.dims]
    ds, held_now = select(ds, sel)
    data = ds[var]
    if not data.dims or not (x or set(data.dims) - set(WITHIN)):
        raise InputError("sel" if sel else "ds", "a single cell has no map; at least one swept dimension must remain")
    candidates: list[str] = []
    for dim in [dim for dim in data.dims if dim not in WITHIN]:
        along = [str(name) for name, c in data.coords.items() if c.dims == (dim,)]
        # The number of a point is only a label: the coordinates of the points are the axes. Else other coordinates vary
        # together with that of the dimension.
        others = [name for name in along if name != dim]
        candidates += [str(dim)] if "path" in ds[dim].attrs else others or [str(dim)]
    available = [*dict.fromkeys([*candidates, *map(str, data.dims)])]
    x = resolve("x", x, available) if x else None
    y = resolve("y", y, available) if y else None
    x = x or next((name for name in candidates if name != y), None)
    y = y or next((name for name in candidates if name != x), None)
    if x is None or x == y:
        raise InputError("x", f"x and y must differ; choose from {', '.join(available)}")
    return ds, [*held, *held_now], Axis.of(ds[x], ds), Axis.of(ds[y], ds) if y else None


def is_scattered(horizontal: Axis, vertical: Axis | None) -> bool:
    """Whether a map shows points; else it shows the cells of a grid."""
    if vertical is None:
        return horizontal.dims != (horizontal.name,)
    return horizontal.dims == vertical.dims or not (horizontal.is_gridded and vertical.is_gridded)


def thinned(axes: list[Axis], most: int) -> dict[str, NDArray[np.intp]]:
    """Indices by dimension that are drawn of axes with more than `most` values: every second, third, ... in order."""
    steps = [math.ceil(len(axis.values) / most) for axis in axes]
    return {axis.dims[0]: axis.order[step // 2 :: step] for axis, step in zip(axes, steps, strict=True) if step > 1}


def as_matrix(data: xr.DataArray, horizontal: Axis, vertical: Axis | None) -> NDArray[Any]:
    """Values in the order of the axes, shape ``(rows, columns)``; one row if there is no vertical axis."""
    if vertical is None:
        return data.values[np.newaxis, horizontal.order]
    return data.transpose(*vertical.dims, *horizontal.dims).values[np.ix_(vertical.order, horizontal.order)]


def _is_geometric(values: NDArray[Any]) -> bool:
    if len(values) < 3 or not np.isfinite(values).all() or values[0] <= 0:
        return False
    steps, ratios = np.diff(values), values[1:] / values[:-1]
    return bool(np.ptp(ratios) <= 1e-6 * ratios.mean() and np.ptp(steps) > 1e-6 * steps.mean())
