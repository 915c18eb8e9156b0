"""Datasets into pictures: regime maps of sweeps, time histories of single runs, error against run time.

Figures are built without pyplot: no global state, no display, safe in threads.
"""

from __future__ import annotations

import difflib
import math
import os
import re
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr
from matplotlib import colormaps
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.cm import ScalarMappable
from matplotlib.colors import BoundaryNorm, Colormap, ListedColormap, Normalize, to_rgb
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch, PathPatch
from matplotlib.path import Path as Outline
from numpy.typing import NDArray

from ringsweep import storage
from ringsweep.errors import InputError
from ringsweep.solvers.rk4 import STABILITY_LIMIT

# Okabe and Ito's hues, which colour-blind readers tell apart, with lightness spread so that
# the regimes of one model stay apart in greyscale too.
REGIME_COLOURS: dict[str, str] = {
    "resting": "#F0E442",
    "oscillatory": "#84CAF2",
    "revolving": "#00507F",
    "separating": "#CC5500",
    "jammed": "#D086B1",
    "failed": "#1A1A1A",
    "stick-slip": "#008C66",
}

#: Kinds of file that `save` writes.
SUFFIXES = (".pdf", ".png", ".svg")

# Lines of friction laws, which may lie on top of each other: told apart by hue and, the one below showing through
# gaps, by style. The lengths have no common factor, so that no pair returns soon.
_LAW_COLOURS = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9", "#000000")
_LAW_STYLES: tuple[Any, ...] = ("-", "--", "-.", ":", (0, (8, 3)))

# Methods, whose curves cross: told apart by marker as well. Lengths without a common factor, as above.
_METHOD_MARKERS = ("o", "s", "^", "D", "v", "P", "<", "p", ">", "h", "*")

_NO_VALUE = "#DDDDDD"
_OTHER_COLOURS = ("#BBBBBB", "#0072B2", "#E69F00", "#009E73", "#CC79A7", "#D55E00", "#56B4E9", "#F0E442")
_SMALL = 8
_MOST_PANELS = 25

# Fraction of a run that the detail of its start shows, before which what happens can count as part of the
# start, and fraction of the force that counts as a difference.
_DETAIL = 0.02
_LATEST = 0.1
_APART = 0.05

# Columns into which a history is condensed: finer than the pixels of a printed panel.
_COLUMNS = 4000


def regime_map(
    ds: xr.Dataset,
    x: str | None = None,
    y: str | None = None,
    var: str = "regime",
    sel: Mapping[str, float | str] | None = None,
) -> Figure:
    """Draw one variable of a sweep over what was swept.

    A grid becomes tiled cells, points become a scatter plot, a single swept quantity becomes a strip
    (classifications) or a line (numbers), and more than two dimensions become small multiples.

    Parameters
    ----------
    ds : xarray.Dataset
        Result of a sweep.
    x, y : str, optional
        Coordinates across and up; by default the first and the second that were swept.
    var : str
        Variable to draw.
    sel : mapping of str to float or str, optional
        Coordinates held at the value nearest to the one given, in SI units.

    Returns
    -------
    matplotlib.figure.Figure

    Raises
    ------
    InputError
        If a name is unknown, nothing is left to draw along, or more than 25 panels would be needed.
    """
    if "time" in ds.dims:
        raise InputError("ds", "is the time history of one run, not a sweep; draw it with history")
    if "contender" in ds.dims:
        raise InputError("ds", "is error against run time, not a sweep; draw it with work_precision")
    var = _known("var", var, [name for name, data in ds.data_vars.items() if data.dtype.kind in "iuf"])
    ds, held = _select(ds, sel or {})
    if not ds[var].dims:
        raise InputError("sel" if sel else "ds", "a single cell has no map; at least one swept dimension must remain")

    across, up = _choose_axes(ds, ds[var], x, y)
    field = _Field.of(ds[var])
    marks = _marks(ds, var, field.data)
    panels = _panels(ds, [str(d) for d in field.data.dims if d not in {*across.dims, *(up.dims if up else ())}])
    title = "; ".join(filter(None, ["" if field.meanings is None and up else _long_name(ds[var]), *held]))

    columns = math.ceil(math.sqrt(len(panels)))
    rows = math.ceil(len(panels) / columns)
    if len(panels) > 1:
        size = (2.4 * columns + 2.2, 2.1 * rows + 0.9)
    else:
        size = (7.6, 4.8 if up else 2.2 if field.meanings else 3.6)
    figure = Figure(figsize=size, layout="constrained")
    grid = figure.subplots(rows, columns, sharex=True, sharey=True, squeeze=False)
    for axes in grid.flat[len(panels) :]:
        axes.remove()
    # Where the last row is short, the panels above its gap carry the ticks.
    for axes in grid.flat[max(0, len(panels) - columns) : len(panels)]:
        axes.xaxis.set_tick_params(labelbottom=True)

    scattered = not across.gridded or (up is not None and not up.gridded)
    for axes, (name, index) in zip(grid.flat, panels, strict=False):
        axes.set_title(name, fontsize=_SMALL)
        axes.tick_params(labelsize=_SMALL if len(panels) > 1 else None)
        across.dress(axes.set_xscale, axes.xaxis)
        if up:
            up.dress(axes.set_yscale, axes.yaxis)
        part = replace(field, data=field.data.isel(index))
        masks = [replace(mark, cells=mark.cells.isel(index)) for mark in marks]
        if up is None and field.meanings is None:
            _draw_line(axes, across, part)
            axes.set_ylabel(_label(ds[var], ds))
        elif up is None:
            _draw_cells(axes, across, up, part, masks)
            axes.set_yticks([])
        elif scattered:
            _draw_points(axes, across, up, part, masks)
        else:
            _draw_cells(axes, across, up, part, masks)
    if len(panels) > 1:
        figure.supxlabel(across.label, fontsize=10)
        figure.supylabel(up.label if up else "", fontsize=10)
    else:
        grid[0, 0].set_xlabel(across.label)
        if up:
            grid[0, 0].set_ylabel(up.label)
    if title:
        figure.suptitle(title, fontsize=11)

    if field.meanings is None and up:
        bar = ScalarMappable(field.norm, field.colours)
        figure.colorbar(bar, ax=list(grid.flat[: len(panels)]), label=_label(ds[var], ds))
    entries = _legend(field, marks, scattered)
    if entries:
        figure.legend(
            handles=entries,
            loc="outside right upper" if field.meanings else "outside lower center",
            fontsize=_SMALL,
            frameon=False,
            handleheight=1.4,
        )
    return figure


def history(ds: xr.Dataset) -> Figure:
    """Draw the time history of one run, or of one under each of several friction laws: the paper's panels.

    For a ring these are angle, angular velocity, angular acceleration and normal reactions, above a strip
    that shows which arc lies under each contact; for a belt displacement, velocity, friction force, and the
    force just after the start. Stick is shaded. Of several laws each is a line, and neither arcs nor stick are
    shown; the last panel goes on for as long again as the differences between their forces at the start last,
    over a logarithmic time if these are of more than one scale.

    Parameters
    ----------
    ds : xarray.Dataset
        Result of a simulation.

    Returns
    -------
    matplotlib.figure.Figure

    Raises
    ------
    InputError
        If the dataset has no dimension ``time``.
    """
    if "time" not in ds.dims or not ds.sizes["time"]:
        raise InputError("ds", "has no dimension time: it is not the history of a run; draw a sweep with regime_map")
    if ds.sizes.get("friction_law") == 1:
        ds = ds.isel(friction_law=0)
    compared = "friction_law" in ds.dims
    if "phi" not in ds:
        panels = [["x"], ["velocity"], ["friction_force"]]
    elif compared:
        panels = [[name] for name in ("phi", "omega", "epsilon", "normal_1", "normal_2") if name in ds]
    else:
        panels = [["phi"], ["omega", "ring_omega"], ["epsilon"], ["normal_1", "normal_2"]]
        panels = [[name for name in panel if name in ds] for panel in panels]
    zones = [] if compared else [name for name in ("zone_1", "zone_2") if name in ds]
    detail = "phi" not in ds

    time = ds["time"].values
    heights = [1.0] * (len(panels) + detail) + [0.13 * len(zones)] * bool(zones)
    figure = Figure(figsize=(8.5, 1.9 * sum(heights) + 0.8), layout="constrained")
    axes = list(figure.subplots(len(heights), 1, gridspec_kw={"height_ratios": heights}))
    timed = axes[:-1] if detail else axes
    for ax in timed[1:]:
        ax.sharex(timed[0])
    for ax in timed[:-1]:
        ax.tick_params(labelbottom=False)
    draw = _draw_laws if compared else _draw_history
    for ax, names in zip(axes, panels, strict=False):
        draw(ax, ds, names)
    if zones:
        _draw_zones(axes[-1], ds, zones)
    if detail:
        first, last = _transients(ds) if compared else (0.0, _DETAIL / 2 * (time[-1] - time[0]))
        start = ds.isel(time=slice(0, max(20, int(np.searchsorted(time, time[0] + 2.0 * last)))))
        draw(axes[-1], start, ["friction_force"])
        if 0.0 < first < 0.05 * last:
            axes[-1].set_xscale("log")
            axes[-1].set_xlim(left=first / 20.0)
        axes[-1].set_title("friction force just after the start", fontsize=_SMALL, loc="left")
        timed[-1].set_xlabel(_label(ds["time"], ds))
    if time[-1] > time[0]:
        timed[0].set_xlim(time[0], time[-1])
    axes[-1].set_xlabel(_label(ds["time"], ds))
    figure.align_ylabels(axes)
    if compared:
        lines = axes[0].get_legend_handles_labels()
        figure.legend(*lines, loc="outside upper center", ncols=3, fontsize=_SMALL, frameon=False, handlelength=4)
    elif outcome := ds.attrs.get("outcome"):
        figure.suptitle(str(outcome), fontsize=11)
    return figure


def work_precision(ds: xr.Dataset, error: str = "error_end", ax: Axes | None = None) -> Figure:
    """Draw error against run time, a curve for each method.

    A point is the median over the cells, the bar above it reaches to the largest. It is hollow where a regime is
    wrong. Medians of zero lie on a floor beneath all others, and infinite ones, of runs that failed, on a ceiling;
    both are marked as such.

    Parameters
    ----------
    ds : xarray.Dataset
        Dimensions ``contender`` and ``cell``, with ``time_per_run`` (s) and `error` as variables and ``method``
        as a coordinate; the points of a method are joined in the order of the dataset. What else
        :func:`ringsweep.precision` puts there is shown where it is present: the target, the setting
        recommended, and the uncertainty of the reference.
    error : str
        Variable to draw; NaN stands for a cell that has no such error.
    ax : matplotlib.axes.Axes, optional
        Where to draw; a figure of its own unless given.

    Returns
    -------
    matplotlib.figure.Figure

    Raises
    ------
    InputError
        If the dataset is of another kind, or `error` is unknown, or a number in no cell.
    """
    lacking = [name for name in ("contender", "cell") if name not in ds.dims]
    lacking += [name for name in ("time_per_run", "method") if name not in ds.variables]
    if lacking:
        raise InputError("ds", f"has no {', '.join(lacking)}: it is not error against run time")
    error = _known("error", error, [name for name, data in ds.items() if set(data.dims) == {"contender", "cell"}])
    numbers = ds[error].transpose("contender", "cell").values.astype(float)
    rows = np.flatnonzero(~np.isnan(numbers).all(axis=1))
    positive = numbers[np.isfinite(numbers) & (numbers > 0.0)]
    if not len(rows):
        raise InputError("error", f"{error} has no value in any cell")
    seconds, methods = ds["time_per_run"].values, ds["method"].values
    middle, largest = np.full((2, len(numbers)), np.nan)
    middle[rows], largest[rows] = np.nanmedian(numbers[rows], axis=1), np.nanmax(numbers[rows], axis=1)
    floor, ceiling = (positive.min() / 10.0, positive.max() * 10.0) if len(positive) else (1e-17, 1.0)
    wrong = (ds["regime_wrong"] == 1).any("cell").values if "regime_wrong" in ds else np.zeros(len(numbers), bool)

    if ax is None:
        ax = Figure(figsize=(7.6, 4.8), layout="constrained").add_subplot()
    ax.set_xscale("log")
    ax.set_yscale("log")
    ax.grid(True, color="#E6E6E6", linewidth=0.6)
    ax.set_axisbelow(True)
    entries: list[Artist] = []
    if f"reference_{error}" in ds and (least := np.nanmedian(ds[f"reference_{error}"])) > 0.0:
        ax.axhspan(0.0, least, color="#EEEEEE", linewidth=0)
        entries.append(Patch(color="#EEEEEE", label="within the median\nuncertainty of the reference"))
    if target := ds.attrs.get("target"):
        ax.axhline(target, color="0.25", linewidth=1, linestyle=(0, (5, 3)))
        entries.append(Line2D([], [], color="0.25", linewidth=1, linestyle=(0, (5, 3)), label=f"target, {target:g}"))
    curves: list[Artist] = []
    for k, method in enumerate(dict.fromkeys(methods[rows].tolist())):
        own = rows[methods[rows] == method]
        colour = _LAW_COLOURS[k % len(_LAW_COLOURS)]
        style: dict[str, Any] = {
            "color": colour,
            "marker": _METHOD_MARKERS[k % len(_METHOD_MARKERS)],
            "markersize": 5.5,
        }
        style |= {"linestyle": _LAW_STYLES[k // len(_LAW_COLOURS) % len(_LAW_STYLES)], "linewidth": 1.3}
        low, high = (np.clip(part[own], floor, ceiling) for part in (middle, largest))
        ax.errorbar(
            seconds[own],
            low,
            yerr=[np.zeros(len(own)), high - low],
            linestyle="",
            color=colour,
            alpha=0.45,
            elinewidth=1,
            capsize=2.5,
        )
        curves += ax.plot(seconds[own], low, label=str(method), **style)
        hollow = own[wrong[own]]
        at = np.clip(middle[hollow], floor, ceiling)
        ax.plot(seconds[hollow], at, **style | {"linestyle": "", "markerfacecolor": "white"})
    if wrong[rows].any():
        hollow_style: dict[str, Any] = {"color": "0.4", "linestyle": "", "marker": "o", "markerfacecolor": "white"}
        entries.append(Line2D([], [], label="hollow: a regime\nis wrong in some cell", **hollow_style))
    for edge, where, sign, label in (
        (floor, middle[rows] <= 0.0, "$\\downarrow$", "no error (at the floor)"),
        (ceiling, np.isinf(middle[rows]), "$\\uparrow$", "failed (at the ceiling)"),
    ):
        if where.any():
            mark: dict[str, Any] = {"color": "black", "marker": sign, "linestyle": "", "markersize": 8}
            shift = 0.6 if edge == floor else 1.7
            ax.plot(seconds[rows[where]], np.full(where.sum(), edge * shift), **mark)
            entries.append(Line2D([], [], label=label, **mark))
    if "recommended" in ds.attrs and "solver" in ds.coords:
        (chosen,) = np.flatnonzero(ds["solver"].values == ds.attrs["recommended"])[:1]
        ring: dict[str, Any] = {"color": "black", "marker": "o", "markerfacecolor": "none", "linestyle": ""}
        ax.plot(seconds[chosen], np.clip(middle[chosen], floor, ceiling), markersize=13, markeredgewidth=1.4, **ring)
        words = "recommended:\n" + str(ds.attrs["recommended"]).replace("method: ", "")
        entries.append(Line2D([], [], markersize=9, label=words, **ring))
    cells = ds.sizes["cell"]
    if cells > 1:
        ax.set_title(f"points: median of {cells} cells; bars: up to the largest", fontsize=_SMALL, loc="left")
    ax.set_xlabel(_label(ds["time_per_run"], ds))
    ax.set_ylabel(_label(ds[error], ds))
    ax.legend(
        handles=[*curves, *entries],
        loc="upper left",
        bbox_to_anchor=(1.0, 1.0),
        fontsize=_SMALL,
        frameon=False,
        handlelength=3,
    )
    figure = ax.figure
    return figure if isinstance(figure, Figure) else figure.figure


def save(figure: Figure, path: str | os.PathLike[str]) -> None:
    """Write a figure, whole or not at all.

    Parameters
    ----------
    figure : matplotlib.figure.Figure
        Figure to write.
    path : path-like
        File to be written or replaced; its suffix, one of `SUFFIXES`, decides its kind.

    Raises
    ------
    InputError
        If the suffix is unknown or `path` cannot be written.
    """
    suffix = Path(path).suffix.lower()
    if suffix not in SUFFIXES:
        raise InputError(str(path), f"pictures end in {', '.join(SUFFIXES)}, not in {suffix or 'nothing'!r}")
    with storage.replacing(path) as temporary:
        figure.savefig(temporary, dpi=150, format=suffix[1:])


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
            values = coordinate.values * _factor(coordinate)
        else:
            named, positions = np.unique(coordinate.values.astype(str), return_inverse=True)
            categories, values = tuple(named), positions.astype(float)
        order = np.argsort(values, kind="stable")
        scale = "log" if _is_geometric(np.unique(values)) else "linear"
        return cls(name, dims, _label(coordinate, ds, angle="°"), values[order], order, scale, categories)

    @property
    def gridded(self) -> bool:
        return self.dims == (self.name,)

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

    def dress(self, set_scale: Any, ticks: Any) -> None:
        set_scale(self.scale)
        if self.categories:
            ticks.set_ticks(range(len(self.categories)), labels=self.categories)


@dataclass(frozen=True)
class _Field:
    """What is painted: finite numbers or NaN, and how they become colours; `meanings` only for classes."""

    data: xr.DataArray
    colours: Colormap
    norm: Normalize
    meanings: tuple[str, ...] | None

    @classmethod
    def of(cls, data: xr.DataArray) -> _Field:
        numbers = data.astype(float).where(np.isfinite(data))
        if "flag_values" not in data.attrs:
            finite = numbers.values[np.isfinite(numbers.values)]
            limits = (finite.min(), finite.max()) if finite.size else (0.0, 1.0)
            return cls(numbers, _with_bad("viridis"), Normalize(*limits), None)
        flags = np.atleast_1d(data.attrs["flag_values"])
        meanings = str(data.attrs["flag_meanings"]).split()
        classes = xr.full_like(numbers, np.nan)
        for k, flag in enumerate(flags):
            classes = classes.where(numbers != flag, k)
        # A colour belongs to a meaning, whether or not the others occur.
        colours = [REGIME_COLOURS.get(m, _OTHER_COLOURS[k % len(_OTHER_COLOURS)]) for k, m in enumerate(meanings)]
        norm = BoundaryNorm(np.arange(len(flags) + 1) - 0.5, len(flags))
        return cls(classes, _with_bad(ListedColormap(colours)), norm, tuple(m.replace("_", " ") for m in meanings))

    def paint(self, numbers: NDArray[Any]) -> NDArray[Any]:
        return np.asarray(self.colours(self.norm(np.ma.masked_invalid(numbers))))


@dataclass(frozen=True)
class _Mark:
    """Cells that carry a warning, and how it looks in cells and on points."""

    label: str
    hatch: str
    marker: str
    cells: xr.DataArray


def _known(argument: str, name: str, available: Iterable[Any]) -> str:
    # Paths of the configuration are names too: the user wrote them there.
    wanted, names = name.replace(".", "_"), [str(one) for one in available]
    if wanted in names:
        return wanted
    close = difflib.get_close_matches(wanted, names, n=1)
    hint = f"; did you mean {close[0]}?" if close else ""
    raise InputError(argument, f"{name!r} is not in the dataset, which has {', '.join(names) or 'none'}{hint}")


def _select(ds: xr.Dataset, sel: Mapping[str, float | str]) -> tuple[xr.Dataset, list[str]]:
    """Hold coordinates at the nearest value; also tell in words at which."""
    held = []
    for wanted, value in sel.items():
        name = _known("sel", wanted, [n for n in {**ds.sizes, **ds.coords} if n in ds.dims or ds[n].ndim == 1])
        coordinate = ds[name]
        if coordinate.dtype.kind in "iuf":
            try:
                distance = np.abs(coordinate.values - float(value))
            except ValueError:
                raise InputError("sel", f"{name} takes a number, not {value!r}") from None
            if np.isnan(distance).all():
                raise InputError("sel", f"{name} takes a finite number, not {value!r}")
            index = int(np.nanargmin(distance))
        else:
            names = [str(one) for one in coordinate.values]
            index = names.index(_known("sel", str(value), names))
        ds = ds.isel({coordinate.dims[0]: index})
        held.append(_value_text(coordinate[index]))
    return ds, held


def _choose_axes(ds: xr.Dataset, data: xr.DataArray, x: str | None, y: str | None) -> tuple[_Axis, _Axis | None]:
    candidates: list[str] = []
    for dim in data.dims:
        along = [str(name) for name, c in data.coords.items() if c.dims == (dim,)]
        # Points are places in the space of their coordinates; their number is only a label.
        others = [name for name in along if name != dim]
        candidates += others or [str(dim)]
    available = [*dict.fromkeys([*candidates, *map(str, data.dims)])]
    x = _known("x", x, available) if x else None
    y = _known("y", y, available) if y else None
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
        panels.append(("\n".join(_value_text(ds[dim][k]) for dim, k in place.items()), place))
    return panels


def _marks(ds: xr.Dataset, var: str, data: xr.DataArray) -> list[_Mark]:
    if var not in ("regime", "motion"):
        return []
    marks = []
    if "certified" in ds:
        marks.append(_Mark("not certified", "//////", "x", (ds["certified"] == 0).broadcast_like(data)))
    if "stiffness" in ds:
        beyond = (ds["stiffness"] > STABILITY_LIMIT).broadcast_like(data)
        marks.append(_Mark("step beyond\nstability limit", "..", "+", beyond))
    if len(marks) == 2 and marks[0].cells.equals(marks[1].cells):
        marks = [_Mark("not certified: step\nbeyond stability limit", "//////", "x", marks[0].cells)]
    return [mark for mark in marks if mark.cells.any()]


def _legend(field: _Field, marks: list[_Mark], scattered: bool) -> list[Artist]:
    numbers = field.data.values
    entries: list[Artist] = []
    for k, meaning in enumerate(field.meanings or ()):
        if (numbers == k).any():
            entries.append(Patch(color=field.colours(k), label=f"{meaning}, {_share(numbers == k)}"))
    if np.isnan(numbers).any():
        entries.append(Patch(color=_NO_VALUE, label=f"no value, {_share(np.isnan(numbers))}"))
    for mark in marks:
        label = f"{mark.label}, {_share(mark.cells.values)}"
        if scattered:
            entries.append(Line2D([], [], color="black", linestyle="", marker=mark.marker, label=label))
        else:
            entries.append(Patch(facecolor="white", edgecolor="black", hatch=mark.hatch, linewidth=0.5, label=label))
            entries[-1].set(hatch_linewidth=0.5)
    return entries


def _draw_cells(axes: Axes, across: _Axis, up: _Axis | None, field: _Field, marks: list[_Mark]) -> None:
    x, y = across.edges, up.edges if up else np.array([0.0, 1.0])
    numbers = _matrix(field.data, across, up)
    axes.pcolormesh(x, y, np.ma.masked_invalid(numbers), cmap=field.colours, norm=field.norm, rasterized=True)
    dark = _is_dark(field.paint(numbers))
    for mark in marks:
        cells = _matrix(mark.cells, across, up)
        for ink, where in (("white", cells & dark), ("black", cells & ~dark)):
            if where.any():
                patch = PathPatch(_outline(where, x, y), fill=False, linewidth=0, edgecolor=ink, hatch=mark.hatch)
                patch.set(hatch_linewidth=0.5)
                # Unlike add_patch, this does not visit every rectangle to find limits that are known already.
                axes.add_artist(patch)


def _draw_points(axes: Axes, across: _Axis, up: _Axis, field: _Field, marks: list[_Mark]) -> None:
    x, y = _spread(across, field.data), _spread(up, field.data)
    colours = field.paint(field.data.values.ravel())
    area = float(np.clip(6000 / x.size, 4, 60))
    axes.scatter(x, y, c=colours, s=area, rasterized=x.size > 5000)
    dark = _is_dark(colours)
    for mark in marks:
        cells = mark.cells.transpose(*field.data.dims).values.ravel()
        for ink, where in (("white", cells & dark), ("black", cells & ~dark)):
            axes.scatter(x[where], y[where], s=area / 3, c=ink, marker=mark.marker, linewidths=0.6)


def _draw_line(axes: Axes, across: _Axis, field: _Field) -> None:
    numbers = field.data.values[across.order]
    edges = across.edges
    gaps = [(edges[i], edges[j] - edges[i]) for i, j in _runs(np.isnan(numbers))]
    axes.broken_barh(gaps, (0, 1), transform=axes.get_xaxis_transform(), color=_NO_VALUE, linewidth=0)
    axes.plot(across.values, numbers, marker="o" if len(numbers) <= 100 else ".", markersize=4, color="#0072B2")


def _draw_history(axes: Axes, ds: xr.Dataset, names: list[str]) -> None:
    time = ds["time"].values
    # One panel explains the shading for all.
    first = names[0] in ("phi", "x")
    if "mode" in ds:
        at, mode = _sampled(time, ds["mode"].values)
        spans = [(at[i], at[j] - at[i]) for i, j in _runs(mode == 0)]
        axes.broken_barh(
            spans,
            (0, 1),
            transform=axes.get_xaxis_transform(),
            color="#E6E6E6",
            linewidth=0,
            label="stick" if first and spans else None,
        )
    labels = {"omega": "body", "ring_omega": "ring", "normal_1": "contact 1", "normal_2": "contact 2"}
    for name, colour, style in zip(names, ("#0072B2", "#D55E00"), ("-", "--"), strict=False):
        axes.plot(*_envelope(time, ds[name].values), color=colour, linestyle=style, linewidth=1, label=labels.get(name))
    if axes.get_legend_handles_labels()[0]:
        axes.legend(loc="upper left", bbox_to_anchor=(1.0, 1.0), fontsize=_SMALL, frameon=False)
    axes.set_ylabel(_symbol(ds, names))
    axes.margins(x=0)
    if names == ["epsilon"]:
        _clip(axes, ds["epsilon"].values)


def _draw_laws(axes: Axes, ds: xr.Dataset, names: list[str]) -> None:
    """One quantity under each friction law."""
    (name,) = names
    numbers = ds[name].transpose("friction_law", "time").values
    for k, law in enumerate(ds["friction_law"].values):
        axes.plot(
            *_envelope(ds["time"].values, numbers[k]),
            color=_LAW_COLOURS[k % len(_LAW_COLOURS)],
            linestyle=_LAW_STYLES[k % len(_LAW_STYLES)],
            linewidth=1.8 if k == 0 else 1.2,
            label=f"{law}: {_regime(ds, k)}" if "regime" in ds else str(law),
        )
    axes.set_ylabel(_symbol(ds, names))
    axes.margins(x=0)
    if name.startswith("normal"):
        axes.set_title(f"contact {name[-1]}", fontsize=_SMALL, loc="left")
    if name in ("epsilon", "friction_force"):
        _clip(axes, numbers)


def _regime(ds: xr.Dataset, k: int) -> str:
    """Regime under the friction law at place `k`, in words."""
    flags = np.atleast_1d(ds["regime"].attrs["flag_values"]).tolist()
    meanings = str(ds["regime"].attrs["flag_meanings"]).split()
    return meanings[flags.index(int(ds["regime"][k]))]


def _transients(ds: xr.Dataset) -> tuple[float, float]:
    """When the first and the last of the differences at the start of runs under several friction laws are over.

    A difference between their forces is over if they agree for as long again as has gone by then. The
    bristles of a law bend within milliseconds, and the body rings on them for longer.
    """
    since = ds["time"].values - ds["time"].values[0]
    force = ds["friction_force"].transpose("friction_law", "time").values
    spread = np.fmax.reduce(force) - np.fmin.reduce(force)
    # Not of the greatest force: it may be a spike.
    apart = np.flatnonzero((spread > _APART * np.nanpercentile(np.abs(force), 95)) & (since > 0.0))
    again = np.append(apart[1:], len(since) - 1)
    ends = since[apart[(since[again] > 2.0 * since[apart]) & (again > apart + 1)]]
    ends = ends[ends < _LATEST * since[-1]]
    if not len(ends):
        return _DETAIL / 2 * since[-1], _DETAIL / 2 * since[-1]
    return ends[0], ends[-1]


def _draw_zones(axes: Axes, ds: xr.Dataset, zones: list[str]) -> None:
    rows = []
    for name in zones:
        at, row = _sampled(ds["time"].values, ds[name].values)
        rows.append(row)
    strip = np.array(rows)
    arcs = int(max(1, strip.max()))
    colours = ["#F2F2F2", *(_OTHER_COLOURS[2 + k % (len(_OTHER_COLOURS) - 2)] for k in range(arcs))]
    norm = BoundaryNorm(np.arange(arcs + 2) - 0.5, arcs + 1)
    axes.pcolormesh(at, np.arange(len(zones) + 1), strip, cmap=ListedColormap(colours), norm=norm, rasterized=True)
    axes.hlines(range(1, len(zones)), at[0], at[-1], color="white", linewidth=2)
    axes.set_yticks(np.arange(len(zones)) + 0.5, labels=[f"contact {name[-1]}" for name in zones], fontsize=_SMALL)
    axes.tick_params(axis="y", length=0)
    axes.invert_yaxis()
    names = ["rest", "rough arc"] if arcs == 1 else ["rest", *(f"rough arc {k + 1}" for k in range(arcs))]
    handles = [Patch(facecolor=c, edgecolor="0.7", label=n) for c, n in zip(colours, names, strict=True)]
    axes.legend(handles=handles, loc="upper left", bbox_to_anchor=(1.0, 1.2), fontsize=_SMALL, frameon=False)


def _clip(axes: Axes, numbers: NDArray[Any]) -> None:
    """Limit an axis to the bulk of its data where a few spikes would flatten it, and say so."""
    finite = numbers[np.isfinite(numbers)]
    if not finite.size:
        return
    low, high = np.percentile(finite, [1, 99])
    if high > low and finite.max() - finite.min() > 5 * (high - low):
        margin = 0.15 * (high - low)
        axes.set_ylim(low - margin, high + margin)
        axes.set_title(
            f"axis clipped; values from {finite.min():.3g} to {finite.max():.3g}", fontsize=_SMALL, loc="right"
        )


def _envelope(time: NDArray[Any], numbers: NDArray[Any]) -> tuple[NDArray[Any], NDArray[Any]]:
    """Least and greatest value per column of a long history, which draws the same in a fraction of the time."""
    if len(time) <= 4 * _COLUMNS:
        return time, numbers
    starts = np.unique(np.searchsorted(time, np.linspace(time[0], time[-1], _COLUMNS, endpoint=False)))
    low, high = np.fmin.reduceat(numbers, starts), np.fmax.reduceat(numbers, starts)
    # A line that went back and forth where it falls would fill the gaps between its dashes.
    falls = numbers[starts] > numbers[np.append(starts[1:], len(time)) - 1]
    columns = np.where(falls, (high, low), (low, high))
    return np.repeat(time[starts], 2), columns.T.ravel()


def _sampled(time: NDArray[Any], states: NDArray[Any]) -> tuple[NDArray[Any], NDArray[Any]]:
    """Edges of the columns of a history, and the state that holds in each."""
    edges = np.linspace(time[0], time[-1], _COLUMNS + 1)
    middles = (edges[1:] + edges[:-1]) / 2
    return edges, states[np.clip(np.searchsorted(time, middles, side="right") - 1, 0, None)]


def _runs(mask: NDArray[Any]) -> NDArray[np.intp]:
    """Begin and end (exclusive) of every run of True."""
    steps = np.diff(np.concatenate([[0], np.asarray(mask, dtype=np.int8), [0]]))
    return np.column_stack([np.flatnonzero(steps == 1), np.flatnonzero(steps == -1)])


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


def _is_dark(rgba: NDArray[Any]) -> NDArray[np.bool_]:
    return np.asarray(rgba[..., :3] @ [0.299, 0.587, 0.114] < 0.45)


def _with_bad(colours: str | Colormap) -> Colormap:
    return (colormaps[colours] if isinstance(colours, str) else colours).with_extremes(bad=to_rgb(_NO_VALUE))


def _share(mask: NDArray[Any]) -> str:
    percent = 100 * float(np.mean(mask))
    return "< 0.1 %" if percent < 0.1 else "> 99.9 %" if 99.9 < percent < 100 else f"{percent:.1f} %"


def _factor(coordinate: xr.DataArray) -> float:
    return 180 / math.pi if coordinate.attrs.get("units") == "rad" else 1.0


def _long_name(data: xr.DataArray) -> str:
    return str(data.attrs.get("long_name", data.name))


def _label(data: xr.DataArray, ds: xr.Dataset, angle: str = "rad") -> str:
    name = _long_name(data)
    # Two arcs, say, have coefficients of one long name: then only the path tells which is meant.
    if sum(_long_name(other) == name for other in ds.coords.values()) > 1:
        name = f"{name}, {data.name}"
    units = _units(data, angle)
    return f"{name} ({units})" if units else name


def _symbol(ds: xr.Dataset, names: list[str]) -> str:
    short = {
        "phi": "angle",
        "omega": "angular velocity",
        "epsilon": "angular\nacceleration",
        "normal_1": "normal reaction",
        "normal_2": "normal reaction",
        "x": "displacement",
        "velocity": "velocity",
        "friction_force": "friction force",
    }
    return f"{short[names[0]]}\n({_units(ds[names[0]], 'rad')})"


def _units(data: xr.DataArray, angle: str) -> str:
    units = str(data.attrs.get("units", "1"))
    units = angle if units == "rad" else "" if units == "1" else units
    # Parameters have "m/s^2" where variables have "m s-2".
    units = re.sub(r"/([A-Za-z]+)\^?(\d*)", lambda unit: f" {unit[1]}-{unit[2] or 1}", units)
    return re.sub(r"(?<=[A-Za-z])\^?(-?\d+)", r"$^{\1}$", units)


def _value_text(value: xr.DataArray) -> str:
    if value.dtype.kind not in "iuf":
        return f"{value.name} = {value.item()}"
    units = _units(value, "°")
    number = f"{value.item() * _factor(value):.4g}"
    return f"{value.name} = {number}{units if units == '°' else f' {units}'.rstrip()}"
