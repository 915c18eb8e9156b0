"""Sweeps into regime maps."""

from __future__ import annotations

import math
import textwrap
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import xarray as xr
from matplotlib import colormaps
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.cm import ScalarMappable
from matplotlib.colors import BoundaryNorm, Colormap, ListedColormap, LogNorm, Normalize, to_rgb
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch, PathPatch
from matplotlib.path import Path as Outline
from matplotlib.ticker import LogFormatterSciNotation, MaxNLocator
from numpy.typing import NDArray

from ringsweep.errors import InputError
from ringsweep.plots.style import (
    NO_VALUE,
    OTHER_COLOURS,
    REGIME_COLOURS,
    SMALL,
    axes_or_current,
    beside,
    factor,
    is_dark,
    known,
    label_of,
    long_name,
    runs,
    value_text,
)
from ringsweep.quantities.parameters import Parameter
from ringsweep.quantities.units import quantity

_MOST_PANELS = 25

# Cells along an axis that are drawn: more than the pixels of a printed page. Millions of others take gigabytes.
_MOST_ACROSS = 1200

# Letters in a line of a title, and in one of a small panel's.
_WIDEST, _PANEL_WIDTH = 60, 30


def regime_map(
    ds: xr.Dataset,
    x: str | None = None,
    y: str | None = None,
    var: str = "regime",
    sel: Mapping[str, float | str] | None = None,
) -> Figure:
    """Draw one variable of a sweep over what was swept, as a figure of its own.

    A grid becomes tiled cells, points become a scatter plot, a single swept quantity becomes a strip
    (classifications) or a line (numbers), and more than two dimensions become small multiples. Of an axis with more
    values than a page has pixels every second, third, ... is drawn, and the title says so; shares in the legend are
    those of all cells.

    Parameters
    ----------
    ds : xarray.Dataset
        Result of a sweep.
    x, y : str, optional
        Coordinates across and up; by default the first and the second that were swept.
    var : str
        Variable to draw.
    sel : mapping of str to float or str, optional
        Coordinates held at the value nearest to the one given, which must lie within the axis: a plain number is SI,
        text may have a unit.

    Returns
    -------
    matplotlib.figure.Figure

    Raises
    ------
    InputError
        If a name is unknown, nothing is left to draw along, or more than 25 panels would be needed.

    Examples
    --------
    >>> import numpy as np
    >>> import xarray as xr
    >>> speed, angle = np.geomspace(0.1, 10, 8), np.radians(np.linspace(5, 60, 6))
    >>> ds = xr.Dataset(
    ...     {"phi_max": (("speed", "angle"), np.outer(speed, angle), {"units": "rad"})},
    ...     coords={"speed": ("speed", speed, {"units": "rad s-1"}), "angle": ("angle", angle, {"units": "rad"})},
    ... )
    >>> regime_map(ds, var="phi_max").axes[0].get_ylabel()
    'angle (°)'
    """
    found = Map.of(ds, x, y, var, sel or {})
    panels, up = found.panels, found.up
    columns = found.columns
    rows = math.ceil(len(panels) / columns)
    if len(panels) > 1:
        size = (2.4 * columns + 2.2, 2.1 * rows + 0.9)
    else:
        size = (7.6, 4.8 if up else 2.2 if found.field.meanings else 3.6)
    figure = Figure(figsize=size, layout="constrained")
    grid = figure.subplots(rows, columns, sharex=True, sharey=True, squeeze=False)
    for axes in grid.flat[len(panels) :]:
        axes.remove()
    # Where the last row is short, the panels above its gap carry the ticks.
    for axes in grid.flat[max(0, len(panels) - columns) : len(panels)]:
        axes.xaxis.set_tick_params(labelbottom=True)
    for axes, (name, index) in zip(grid.flat, panels, strict=False):
        axes.set_title(name, fontsize=SMALL)
        axes.tick_params(labelsize=SMALL if len(panels) > 1 else None)
        found.draw(axes, index)
    if len(panels) > 1:
        figure.supxlabel(found.across.label, fontsize=10)
        figure.supylabel(found.up_label, fontsize=10)
    else:
        found.name_axes(grid[0, 0])
    if found.title:
        figure.suptitle(found.title, fontsize=11)
    if found.field.meanings is None and up:
        found.add_bar(list(grid.flat[: len(panels)]))
    if found.entries:
        figure.legend(
            handles=found.entries,
            # Below several panels stands the name of the axis that they share.
            loc="outside right upper" if found.field.meanings or len(panels) > 1 else "outside lower center",
            fontsize=SMALL,
            frameon=False,
            handleheight=1.4,
        )
    return figure


def map_panel(
    ds: xr.Dataset,
    x: str | None = None,
    y: str | None = None,
    var: str = "regime",
    sel: Mapping[str, float | str] | None = None,
    ax: Axes | None = None,
) -> Axes:
    """Draw one variable of a sweep over one or two swept quantities; see :func:`regime_map`.

    Parameters
    ----------
    ds : xarray.Dataset
        Result of a sweep.
    x, y : str, optional
        Coordinates across and up; by default the first and the second that were swept.
    var : str
        Variable to draw.
    sel : mapping of str to float or str, optional
        Coordinates held at the value nearest to the one given, which must lie within the axis: a plain number is SI,
        text may have a unit.
    ax : matplotlib.axes.Axes, optional
        Where to draw; pyplot's current axes unless given. For the legend beside them a figure with
        ``layout="constrained"`` makes room.

    Returns
    -------
    matplotlib.axes.Axes

    Raises
    ------
    InputError
        If a name is unknown, nothing is left to draw along, or more than two dimensions are.

    Examples
    --------
    >>> import numpy as np
    >>> import xarray as xr
    >>> from matplotlib.figure import Figure
    >>> ds = xr.Dataset({"phi_max": ("speed", [0.1, 0.3, 0.2], {"units": "rad"})}, coords={"speed": [1.0, 2.0, 3.0]})
    >>> map_panel(ds, var="phi_max", ax=Figure().add_subplot()).get_ylabel()
    'phi_max (rad)'
    """
    found = Map.of(ds, x, y, var, sel or {})
    ax = axes_or_current(ax, (7.6, 4.8))
    found.draw_alone(ax)
    return ax


@dataclass(frozen=True)
class Map:
    """A map before it is drawn: what is painted, along which axes, in which panels.

    `ds` is the dataset with what is held taken out; `picks` are the places along its dimensions that are drawn.
    """

    ds: xr.Dataset
    var: str
    across: _Axis
    up: _Axis | None
    field: _Field
    data: xr.DataArray
    marks: list[_Mark]
    panels: list[tuple[str, dict[str, int]]]
    picks: dict[str, NDArray[np.intp]]
    entries: list[Artist]
    title: str

    @classmethod
    def of(cls, ds: xr.Dataset, x: str | None, y: str | None, var: str, sel: Mapping[str, float | str]) -> Map:
        if "time" in ds.dims:
            raise InputError("ds", "is the time history of one run, not a sweep; draw it with history")
        if "contender" in ds.dims:
            raise InputError("ds", "is error against run time, not a sweep; draw it with work_precision")
        var = known("var", var, [name for name, data in ds.data_vars.items() if data.dtype.kind in "iuf"])
        # What was held before stands in the title as well.
        earlier = [value_text(c) for c in ds.coords.values() if not c.dims and "path" in c.attrs]
        ds, held = select(ds, sel)
        held = earlier + held
        if not ds[var].dims:
            raise InputError(
                "sel" if sel else "ds", "a single cell has no map; at least one swept dimension must remain"
            )
        across, up = _choose_axes(ds, ds[var], x, y)
        field = _Field.of(ds[var])
        marks = _marks(ds, var, ds[var])
        others = [str(d) for d in ds[var].dims if d not in {*across.dims, *(up.dims if up else ())}]
        panels = _panels(ds, others)
        scattered = _is_scattered(across, up)
        entries = _legend(field, ds[var], marks, scattered)
        # A line shows its spikes, however many values it has.
        picks = {} if scattered or up is None else _picks([across, up], _MOST_ACROSS // _columns(panels))
        thin = ds.isel(picks)
        share = math.prod(ds.sizes[dim] / len(pick) for dim, pick in picks.items())
        words = [f"1 cell in {share:.0f} drawn"] if picks else []
        return cls(
            ds,
            var,
            _Axis.of(thin[across.name], thin),
            _Axis.of(thin[up.name], thin) if up else None,
            field,
            thin[var],
            [replace(mark, cells=mark.cells.isel(picks)) for mark in marks],
            panels,
            picks,
            entries,
            _lines(["" if field.meanings is None else long_name(ds[var]), *held, *words]),
        )

    @property
    def columns(self) -> int:
        return _columns(self.panels)

    @property
    def scattered(self) -> bool:
        return _is_scattered(self.across, self.up)

    @property
    def up_label(self) -> str:
        if self.up:
            return self.up.label
        return "" if self.field.meanings else label_of(self.ds[self.var], self.ds)

    def draw(self, axes: Axes, index: Mapping[str, int]) -> None:
        """Draw the panel at a place along the dimensions that make panels."""
        self.across.dress(axes.set_xscale, axes.xaxis)
        if self.up:
            self.up.dress(axes.set_yscale, axes.yaxis)
        numbers = self.field.numbers(self.data.isel(index))
        masks = [replace(mark, cells=mark.cells.isel(index)) for mark in self.marks]
        if self.up is None and self.field.meanings is None:
            _draw_line(axes, self.across, numbers)
            axes.set_ylabel(self.up_label)
        elif self.up is None:
            _draw_cells(axes, self.across, None, self.field, numbers, masks)
            axes.set_yticks([])
        elif self.scattered:
            _draw_points(axes, self.across, self.up, self.field, numbers, masks)
        else:
            _draw_cells(axes, self.across, self.up, self.field, numbers, masks)

    def draw_alone(self, axes: Axes) -> None:
        """Draw the only panel with all that belongs to it."""
        if len(self.panels) > 1:
            left = ", ".join(self.panels[0][1])
            raise InputError("sel", f"one panel has no room for {left}: hold it, or draw regime_map's small multiples")
        self.draw(axes, self.panels[0][1])
        self.name_axes(axes)
        axes.set_title(self.title, fontsize=11)
        if self.field.meanings is None and self.up:
            self.add_bar([axes])
            beside(axes, self.entries, loc="upper right", bbox_to_anchor=(1.0, -0.1))
        else:
            beside(axes, self.entries, handleheight=1.4)

    def name_axes(self, axes: Axes) -> None:
        axes.set_xlabel(self.across.label)
        axes.set_ylabel(self.up_label)

    def add_bar(self, panels: list[Axes]) -> None:
        """A scale of the colours beside the panels."""
        bar = ScalarMappable(self.field.norm, self.field.colours)
        ticks = MaxNLocator(integer=True) if self.data.dtype.kind in "iu" else None
        panels[0].figure.colorbar(bar, ax=panels, label=label_of(self.ds[self.var], self.ds), ticks=ticks)

    def cell_at(self, axes: Axes, x: float, y: float) -> xr.Dataset:
        """The cell that is drawn at a point of the only panel."""
        if self.scattered and self.up is not None:
            drawn = np.column_stack([_spread(self.across, self.data), _spread(self.up, self.data)])
            # What looks nearest is meant, whatever the scales of the axes.
            away = axes.transData.transform(drawn) - axes.transData.transform([(x, y)])
            found = np.unravel_index(int(np.nanargmin((away**2).sum(axis=1))), self.data.shape)
            return self.ds.isel(dict(zip(self.data.dims, map(int, found), strict=True)))
        place = {}
        for axis, at in ((self.across, x), (self.up, y)):
            if axis is not None:
                k = int(axis.order[np.searchsorted(axis.edges[1:-1], at)])
                (dim,) = axis.dims
                place[dim] = int(self.picks[dim][k]) if dim in self.picks else k
        return self.ds.isel(place)

    def position(self, one: xr.Dataset) -> tuple[float, float]:
        """Where in the only panel a single cell is drawn."""
        if self.up:
            return self.across.shown(one), self.up.shown(one)
        return self.across.shown(one), 0.5 if self.field.meanings else float(one[self.var])


class _Plain(LogFormatterSciNotation):
    """Plain numbers at the ticks of a logarithmic axis."""

    def __call__(self, x: float, pos: int | None = None) -> str:
        return f"{x:g}" if super().__call__(x, pos) else ""


@dataclass(frozen=True)
class _Axis:
    """A coordinate as an axis: values as displayed, sorted where they span a grid."""

    name: str
    dims: tuple[str, ...]
    label: str
    values: NDArray[Any]
    order: NDArray[np.intp]
    scale: str
    categories: tuple[str, ...] = ()

    @classmethod
    def of(cls, coordinate: xr.DataArray, ds: xr.Dataset) -> _Axis:
        name, dims = str(coordinate.name), tuple(map(str, coordinate.dims))
        categories: tuple[str, ...] = ()
        if coordinate.dtype.kind in "iuf":
            values = coordinate.values * factor(coordinate)
        else:
            # In the order in which they were given.
            named = coordinate.values.astype(str).tolist()
            categories = tuple(dict.fromkeys(named))
            values = np.array([categories.index(name) for name in named], dtype=float)
        order = np.argsort(values, kind="stable")
        scale = "log" if _is_geometric(np.unique(values)) else "linear"
        return cls(name, dims, label_of(coordinate, ds, angle="°"), values[order], order, scale, categories)

    @property
    def gridded(self) -> bool:
        """Whether it has a dimension of its own, along which others may vary with it; points have none."""
        return len(self.dims) == 1 and self.dims != ("point",) and len(np.unique(self.values)) == len(self.values)

    @property
    def edges(self) -> NDArray[Any]:
        """Edges of the cells, midway in the scale of the axis, so that cells tile without gap or overlap."""
        if len(self.values) == 1:
            half = 0.5 * abs(self.values[0]) or 0.5
            return np.array([self.values[0] - half, self.values[0] + half])
        at = np.log(self.values) if self.scale == "log" else self.values
        middles = (at[1:] + at[:-1]) / 2
        edges = np.concatenate([[2 * at[0] - middles[0]], middles, [2 * at[-1] - middles[-1]]])
        return np.exp(edges) if self.scale == "log" else edges

    def shown(self, one: xr.Dataset) -> float:
        """Where along the axis a dataset of a single cell lies."""
        value = one[self.name]
        return float(self.categories.index(str(value.item()))) if self.categories else value.item() * factor(value)

    def dress(self, set_scale: Any, ticks: Any) -> None:
        set_scale(self.scale)
        if self.scale == "log" and self.values[0] >= 1e-3 and self.values[-1] < 1e5:
            ticks.set_major_formatter(_Plain())
            ticks.set_minor_formatter(_Plain(labelOnlyBase=False))
        if self.categories:
            ticks.set_ticks(range(len(self.categories)), labels=self.categories)


@dataclass(frozen=True)
class _Field:
    """How numbers become colours; `flags` and `meanings` only for classes."""

    colours: Colormap
    norm: Normalize
    flags: NDArray[Any] | None = None
    meanings: tuple[str, ...] | None = None

    @classmethod
    def of(cls, data: xr.DataArray) -> _Field:
        if "flag_values" not in data.attrs:
            finite = data.values[np.isfinite(data.values)]
            positive = finite[finite > 0.0]
            if str(data.name).endswith("_error") and positive.size and positive.max() > positive.min():
                # Bounds on errors lie decades apart.
                return cls(_with_bad("viridis"), LogNorm(positive.min(), positive.max()))
            limits = (finite.min(), finite.max()) if finite.size else (0.0, 1.0)
            return cls(_with_bad("viridis"), Normalize(*limits))
        flags = np.atleast_1d(data.attrs["flag_values"])
        meanings = str(data.attrs["flag_meanings"]).split()
        # A colour belongs to a meaning, whether or not the others occur.
        colours = [REGIME_COLOURS.get(m, OTHER_COLOURS[k % len(OTHER_COLOURS)]) for k, m in enumerate(meanings)]
        norm = BoundaryNorm(np.arange(len(flags) + 1) - 0.5, len(flags))
        return cls(_with_bad(ListedColormap(colours)), norm, flags, tuple(m.replace("_", " ") for m in meanings))

    def numbers(self, data: xr.DataArray) -> xr.DataArray:
        """What is painted: finite numbers or NaN, or the position of a class among the flags."""
        numbers = data.astype(float).where(np.isfinite(data))
        if isinstance(self.norm, LogNorm):
            return numbers.clip(min=self.norm.vmin)
        if self.flags is None:
            return numbers
        classes = xr.full_like(numbers, np.nan)
        for k, flag in enumerate(self.flags):
            classes = classes.where(numbers != flag, k)
        return classes

    def paint(self, numbers: NDArray[Any]) -> NDArray[Any]:
        return np.asarray(self.colours(self.norm(np.ma.masked_invalid(numbers))))


@dataclass(frozen=True)
class _Mark:
    """Cells that carry a warning, and how it looks in cells and on points."""

    label: str
    hatch: str
    marker: str
    cells: xr.DataArray


def _is_scattered(across: _Axis, up: _Axis | None) -> bool:
    """Whether values are those of points rather than of the cells of a grid."""
    if up is None:
        return across.dims != (across.name,)
    return across.dims == up.dims or not (across.gridded and up.gridded)


def _columns(panels: list[tuple[str, dict[str, int]]]) -> int:
    return math.ceil(math.sqrt(len(panels)))


def _lines(words: list[str]) -> str:
    """Words parted by semicolons, in lines that are no wider than a map."""
    lines = [""]
    for word in filter(None, words):
        if len(lines[-1]) + len(word) > _WIDEST and lines[-1]:
            lines.append("")
        lines[-1] += ("; " if lines[-1] else "") + word
    return ";\n".join(lines)


def _picks(axes: list[_Axis], most: int) -> dict[str, NDArray[np.intp]]:
    """Places along the dimensions of a grid that are drawn, in ascending order of their values, where not all are."""
    picks = {}
    for axis in axes:
        step = math.ceil(len(axis.values) / most)
        if step > 1:
            picks[axis.dims[0]] = axis.order[step // 2 :: step]
    return picks


def select(ds: xr.Dataset, sel: Mapping[str, float | str]) -> tuple[xr.Dataset, list[str]]:
    """Hold coordinates at the nearest value; also tell in words at which."""
    held = []
    for wanted, value in sel.items():
        name = known("sel", wanted, [n for n in {**ds.sizes, **ds.coords} if n in ds.dims or ds[n].ndim == 1])
        coordinate = ds[name]
        if coordinate.dtype.kind in "iuf":
            number = quantity(value, _within(coordinate), f"sel.{wanted}")
            index = int(np.nanargmin(np.abs(coordinate.values - number)))
        else:
            names = [str(one) for one in coordinate.values]
            index = names.index(known("sel", str(value), names))
        ds = ds.isel({coordinate.dims[0]: index})
        held.append(value_text(coordinate[index]))
    return ds, held


def _within(coordinate: xr.DataArray) -> Parameter:
    """What can be held: no value that the nearest one would have to stand in for from outside the axis."""
    values = coordinate.values[np.isfinite(coordinate.values)]
    low, high = float(values.min()), float(values.max())
    # Degrees have few digits.
    slack = 1e-4 * ((high - low) or abs(high))
    return Parameter(str(coordinate.attrs.get("units", "1")), long_name(coordinate), low - slack, high + slack)


def _choose_axes(ds: xr.Dataset, data: xr.DataArray, x: str | None, y: str | None) -> tuple[_Axis, _Axis | None]:
    candidates: list[str] = []
    for dim in data.dims:
        along = [str(name) for name, c in data.coords.items() if c.dims == (dim,)]
        # Points are places in the space of their coordinates; their number is only a label.
        others = [name for name in along if name != dim]
        candidates += others or [str(dim)]
    available = [*dict.fromkeys([*candidates, *map(str, data.dims)])]
    x = known("x", x, available) if x else None
    y = known("y", y, available) if y else None
    x = x or next((name for name in candidates if name != y), None)
    y = y or next((name for name in candidates if name != x), None)
    if x is None or x == y:
        raise InputError("x", f"x and y must differ; choose from {', '.join(available)}")
    return _Axis.of(ds[x], ds), _Axis.of(ds[y], ds) if y else None


def _panels(ds: xr.Dataset, dims: list[str]) -> list[tuple[str, dict[str, int]]]:
    """Panels over the dimensions that are left: what each is called, and where in the data it lies."""
    sizes = [ds.sizes[dim] for dim in dims]
    if math.prod(sizes) > _MOST_PANELS:
        left = ", ".join(f"{dim} ({size})" for dim, size in zip(dims, sizes, strict=True))
        raise InputError(
            "sel",
            f"small multiples over {left} need {math.prod(sizes)} panels, at most {_MOST_PANELS} (5 x 5) fit; "
            f"hold some of them: --sel {dims[0]}=VALUE",
        )
    panels = []
    for index in np.ndindex(*sizes):
        place = dict(zip(dims, map(int, index), strict=True))
        words = [textwrap.fill(value_text(ds[dim][k]), _PANEL_WIDTH) for dim, k in place.items()]
        panels.append(("\n".join(words), place))
    return panels


def _marks(ds: xr.Dataset, var: str, data: xr.DataArray) -> list[_Mark]:
    if var not in ("regime", "motion"):
        return []
    marks = []
    if "certified" in ds:
        marks.append(_Mark("not certified", "//////", "x", (ds["certified"] == 0).broadcast_like(data)))
    if "stiffness" in ds:
        # Solvers are slow to import, and few maps need one.
        from ringsweep.solvers.rk4 import STABILITY_LIMIT

        beyond = (ds["stiffness"] > STABILITY_LIMIT).broadcast_like(data)
        marks.append(_Mark("step beyond\nstability limit", "..", "+", beyond))
    if len(marks) == 2 and marks[0].cells.equals(marks[1].cells):
        marks = [_Mark("not certified: step\nbeyond stability limit", "//////", "x", marks[0].cells)]
    return [mark for mark in marks if mark.cells.any()]


def _legend(field: _Field, data: xr.DataArray, marks: list[_Mark], scattered: bool) -> list[Artist]:
    entries: list[Artist] = []
    shown = np.isfinite(data.values)
    if field.flags is not None and field.meanings is not None:
        shown = np.isin(data.values, field.flags)
        for k, (flag, meaning) in enumerate(zip(field.flags, field.meanings, strict=True)):
            where = data.values == flag
            if where.any():
                entries.append(Patch(color=field.colours(k), label=f"{meaning}, {_share(where)}"))
    if not shown.all():
        entries.append(Patch(color=NO_VALUE, label=f"no value, {_share(~shown)}"))
    for mark in marks:
        label = f"{mark.label}, {_share(mark.cells.values)}"
        if scattered:
            entries.append(Line2D([], [], color="black", linestyle="", marker=mark.marker, label=label))
        else:
            entries.append(Patch(facecolor="white", edgecolor="black", hatch=mark.hatch, linewidth=0.5, label=label))
            entries[-1].set(hatch_linewidth=0.5)
    return entries


def _draw_cells(
    axes: Axes, across: _Axis, up: _Axis | None, field: _Field, data: xr.DataArray, marks: list[_Mark]
) -> None:
    x, y = across.edges, up.edges if up else np.array([0.0, 1.0])
    numbers = _matrix(data, across, up)
    axes.pcolormesh(x, y, np.ma.masked_invalid(numbers), cmap=field.colours, norm=field.norm, rasterized=True)
    dark = is_dark(field.paint(numbers))
    for mark in marks:
        cells = _matrix(mark.cells, across, up)
        for ink, where in (("white", cells & dark), ("black", cells & ~dark)):
            if where.any():
                patch = PathPatch(_outline(where, x, y), fill=False, linewidth=0, edgecolor=ink, hatch=mark.hatch)
                patch.set(hatch_linewidth=0.5)
                # Unlike add_patch, this does not visit every rectangle to find limits that are known already.
                axes.add_artist(patch)


def _draw_points(axes: Axes, across: _Axis, up: _Axis, field: _Field, data: xr.DataArray, marks: list[_Mark]) -> None:
    x, y = _spread(across, data), _spread(up, data)
    colours = field.paint(data.values.ravel())
    area = float(np.clip(6000 / x.size, 4, 60))
    axes.scatter(x, y, c=colours, s=area, rasterized=x.size > 5000)
    dark = is_dark(colours)
    for mark in marks:
        cells = mark.cells.transpose(*data.dims).values.ravel()
        for ink, where in (("white", cells & dark), ("black", cells & ~dark)):
            axes.scatter(x[where], y[where], s=area / 3, c=ink, marker=mark.marker, linewidths=0.6)


def _draw_line(axes: Axes, across: _Axis, data: xr.DataArray) -> None:
    numbers = data.values[across.order]
    edges = across.edges
    gaps = [(edges[i], edges[j] - edges[i]) for i, j in runs(np.isnan(numbers))]
    axes.broken_barh(gaps, (0, 1), transform=axes.get_xaxis_transform(), color=NO_VALUE, linewidth=0)
    axes.plot(across.values, numbers, marker="o" if len(numbers) <= 100 else ".", markersize=4, color="#0072B2")


def _outline(cells: NDArray[Any], x: NDArray[Any], y: NDArray[Any]) -> Outline:
    """One path around all marked cells, a rectangle per run in a row: hatching cell by cell takes minutes."""
    steps = np.diff(np.pad(cells.astype(np.int8), ((0, 0), (1, 1))), axis=1)
    row, begin = np.nonzero(steps == 1)
    end = np.nonzero(steps == -1)[1]
    left, right, low, high = x[begin], x[end], y[row], y[row + 1]
    corners = [(left, low), (right, low), (right, high), (left, high), (left, low)]
    vertices = np.stack([np.column_stack(corner) for corner in corners], axis=1).reshape(-1, 2)
    codes = np.tile([Outline.MOVETO, Outline.LINETO, Outline.LINETO, Outline.LINETO, Outline.CLOSEPOLY], len(row))
    return Outline(vertices, codes.astype(Outline.code_type))


def _matrix(data: xr.DataArray, across: _Axis, up: _Axis | None) -> NDArray[Any]:
    """Rows from bottom to top, columns from left to right; one row if there is only one axis."""
    if up is None:
        return data.values[np.newaxis, across.order]
    return data.transpose(*up.dims, *across.dims).values[np.ix_(up.order, across.order)]


def _spread(axis: _Axis, data: xr.DataArray) -> NDArray[Any]:
    """Value of an axis at every element of `data`."""
    unsorted = np.empty_like(axis.values)
    unsorted[axis.order] = axis.values
    return xr.DataArray(unsorted, dims=axis.dims).broadcast_like(data).transpose(*data.dims).values.ravel()


def _is_geometric(values: NDArray[Any]) -> bool:
    if len(values) < 3 or not np.isfinite(values).all() or values[0] <= 0:
        return False
    steps, ratios = np.diff(values), values[1:] / values[:-1]
    return bool(np.ptp(ratios) <= 1e-6 * ratios.mean() and np.ptp(steps) > 1e-6 * steps.mean())


def _with_bad(colours: str | Colormap) -> Colormap:
    return (colormaps[colours] if isinstance(colours, str) else colours).with_extremes(bad=to_rgb(NO_VALUE))


def _share(mask: NDArray[Any]) -> str:
    percent = 100 * float(np.mean(mask))
    return "< 0.1 %" if percent < 0.1 else "> 99.9 %" if 99.9 < percent < 100 else f"{percent:.1f} %"
