"""A sweep as a page for the browser: zoom, numbers of the cell under the pointer, a choice of variable and slice."""

from __future__ import annotations

import math
import os
from collections.abc import Mapping
from dataclasses import dataclass
from importlib.resources import files
from typing import Any

import numpy as np
import xarray as xr
from matplotlib.colors import LogNorm, to_hex
from numpy.typing import NDArray

from ringsweep.errors import InputError
from ringsweep.plots import look
from ringsweep.plots.datasets import mapped, numeric_names, require_sweep
from ringsweep.plots.labels import axis_label, displayed, in_units, long_name, plain_text, value_text
from ringsweep.plots.map_axes import Axis, choose_axes, is_scattered, thinned
from ringsweep.plots.map_colours import ZERO, ColourScale
from ringsweep.plots.maps import audit_texts
from ringsweep.plots.saving import suffix_of
from ringsweep.quantities.variables import swept
from ringsweep.storage.files import check_writable, replacing

# Greatest number of cells along an axis, and in a page: a million make some 20 MB.
_MOST_ALONG, _MOST_CELLS = 512, 1_000_000

# Pixels along an axis whose values have unequal distances.
_PIXELS = 1000

# Binary digits kept of numbers and of bounds on errors: four decimal digits, and two.
_DIGITS, _BOUND_DIGITS = 15, 8

# A telephone would show the page as if it were 980 pixels wide.
_VIEWPORT = '<meta name="viewport" content="width=device-width, initial-scale=1">'

# Beside the pointer there is at least half of the page.
_TOOLTIP = '<div style="white-space: pre-wrap; max-width: 42vw">@{value}{custom}</div>'

# The script sees to the rest of a dark page.
_DARK = "@media (prefers-color-scheme: dark) { .bk-input { background-color: #303030; color: #e0e0e0 } }"


def save_page(
    ds: xr.Dataset,
    path: str | os.PathLike[str],
    x: str | None = None,
    y: str | None = None,
    var: str = "regime",
    sel: Mapping[str, float | str] | None = None,
) -> None:
    """Write a sweep as a page for the browser, which needs neither Python nor the internet.

    The page shows one variable over one or two swept quantities. The reader can zoom, read the numbers of the cell
    under the pointer, and choose the variable and the values of further quantities. Numbers have four digits, bounds
    on errors have two. Cells that are not certified are hatched, or crossed among points. The page is dark if the
    browser is. To write it needs Bokeh (``pip install bokeh``).

    If writing fails, an older file of that name stays as it was.

    Parameters
    ----------
    ds : xarray.Dataset
        Result of a sweep.
    path : path-like
        File to write or replace, ``*.html``.
    x, y : str, optional
        Coordinates of the horizontal and the vertical axis; by default the first and the second that were swept.
    var : str
        Variable that the page shows first.
    sel : mapping of str to float or str, optional
        Coordinates held at the value nearest to the one given, which must lie within the axis: a plain number is SI,
        text may have a unit. A warning and the title state the value taken if it is another.

    Raises
    ------
    InputError
        If a name is unknown, a single cell is left, there are more than a million cells, `path` cannot be written, or
        Bokeh is not installed.

    Examples
    --------
    >>> import numpy as np
    >>> import xarray as xr
    >>> ds = xr.Dataset({"phi_max": (("speed", "angle"), np.eye(2))}, {"speed": [1.0, 2.0], "angle": [0.1, 0.2]})
    >>> save_page(ds, "map.txt")
    Traceback (most recent call last):
    ringsweep.errors.InputError: map.txt: pages end in .html, not in '.txt'
    """
    check_page(path)
    from bokeh.embed import file_html
    from bokeh.resources import INLINE

    sweep = _Sweep.of(ds, x, y, var, sel or {})
    with replacing(path) as temporary:
        page = file_html(_document(sweep), INLINE, str(ds.attrs.get("title", "ringsweep")))
        temporary.write_text(page.replace("<head>", f"<head>\n    {_VIEWPORT}", 1), encoding="utf-8")


def check_page(path: str | os.PathLike[str]) -> None:
    """Check that a page can be written to `path`.

    Raises
    ------
    InputError
        If the suffix is not ``.html``, the file cannot be written, or Bokeh is not installed.
    """
    suffix_of(path, (".html",), "pages")
    check_writable(path)
    try:
        import bokeh  # noqa: F401
    except ImportError as error:
        problem = "Bokeh, which writes .html, is not installed (pip install bokeh); .png, .pdf and .svg do not need it"
        raise InputError(str(path), problem) from error


@dataclass(frozen=True)
class _Sweep:
    """What a page shows. Its dimensions are in the order of the page: those of the slices, then those of the axes.

    A view shows a slice of the cells: all along the axes, at one value along each further dimension.

    Attributes
    ----------
    ds, whole : xarray.Dataset
        The cells that are shown, and all cells of the file.
    var : str
        Variable that is shown first.
    notes : list of str
        What is held, how many cells are shown, and what the audit of a refined sweep says.
    horizontal, vertical : Axis
        `vertical` is None if one quantity was swept.
    slices : list of str
        Dimensions of the slices.
    """

    ds: xr.Dataset
    whole: xr.Dataset
    var: str
    notes: list[str]
    horizontal: Axis
    vertical: Axis | None
    slices: list[str]

    @classmethod
    def of(cls, ds: xr.Dataset, x: str | None, y: str | None, var: str, sel: Mapping[str, float | str]) -> _Sweep:
        """Choose the axes, and put the cells in their order; arguments and errors as for :func:`save_page`."""
        require_sweep(ds)
        ds = in_units(ds)
        ds, var = mapped(ds, var, sel)
        ds, held, horizontal, vertical = choose_axes(ds, var, sel, x, y)
        notes = [*held, *audit_texts(ds)]
        axes = [axis for axis in (vertical, horizontal) if axis]
        whole = ds
        if not (vertical and is_scattered(horizontal, vertical)):
            # A picture of cells needs their values in ascending order.
            ds = ds.isel({axis.dims[0]: axis.order for axis in axes} | thinned(axes, _MOST_ALONG))
            if ds[var].size < whole[var].size:
                notes.append(f"1 cell in {whole[var].size / ds[var].size:.0f} shown; shares are those of all cells")
            axes = [axis.within(ds) for axis in axes]
        dims = list(dict.fromkeys(dim for axis in axes for dim in axis.dims))
        slices = [str(dim) for dim in ds[var].dims if dim not in dims]
        ds, whole = (one.transpose(*slices, *dims, ...) for one in (ds, whole))
        if ds[var].size > _MOST_CELLS:
            left = ", ".join(f"{dim} ({size})" for dim, size in ds[var].sizes.items())
            raise InputError("sel", f"{left} are more than {_MOST_CELLS:,} cells: hold some of these: --sel DIM=VALUE")
        return cls(ds, whole, var, notes, axes[-1], axes[0] if vertical else None, slices)

    @property
    def points(self) -> xr.DataArray | None:
        """The cells of a slice, if they are points; None if they are those of a grid."""
        if self.vertical is None or not is_scattered(self.horizontal, self.vertical):
            return None
        return self.ds[self.var][dict.fromkeys(self.slices, 0)]


def _column(
    data: xr.DataArray, ds: xr.Dataset, every: xr.DataArray, others: int
) -> tuple[NDArray[Any], dict[str, Any], tuple[Any, ...]]:
    """Values of a variable in compact form, what a page says of it, and its colours with their ends.

    `every` has the cells that are not shown too; the first `others` of its dimensions are those of the slices. The
    values of a classification are the positions among its words, or -1; of others see :func:`_packed`.
    """
    data = displayed(data)
    scale = ColourScale.of(data)
    numbers = scale.numbers(data).values.ravel()
    error = f"{data.name}_error"
    about: dict[str, Any] = {
        "title": long_name(data),
        "label": plain_text(axis_label(data, ds)),
        "words": None,
        "shares": None,
        "error": error if error in ds else None,
        "logarithmic": isinstance(scale.norm, LogNorm),
    }
    if scale.meanings is not None:
        flags = [] if scale.flags is None else [every.values == flag for flag in scale.flags]
        # Classes that do not occur would only fill the legend; cells that are not shown count.
        present = [k for k, cells in enumerate(flags) if cells.any()]
        positions = np.full(numbers.shape, -1, dtype=np.int8)
        for position, k in enumerate(present):
            positions[numbers == k] = position
        about["words"] = [scale.meanings[k] for k in present]
        within = tuple(range(others, every.ndim))
        about["shares"] = [np.atleast_1d(flags[k].mean(axis=within)).ravel().tolist() for k in present]
        colours = [to_hex(scale.colours(k)) for k in present]
        return positions, about, (colours or [look.NO_VALUE], -0.5, max(len(present), 1) - 0.5)
    colours = [to_hex(colour) for colour in scale.colours(np.linspace(0.0, 1.0, 64))]
    limits = float(scale.norm.vmin or 0.0), float(scale.norm.vmax or 0.0)
    return _packed(numbers, str(data.name).endswith("_error")), about, (colours, *limits)


def _packed(numbers: NDArray[Any], bound: bool) -> NDArray[np.uint8]:
    """Numbers with few digits, in a form that compresses well, shape ``(3, size)``; a bound is rounded upwards.

    The bits of the numbers, as ``float32`` without their last nine, are integers. Neighbours differ little, so their
    differences are stored: those below zero as odd numbers, the bytes of equal weight side by side.
    """
    digits, rounding = (_BOUND_DIGITS, np.ceil) if bound else (_DIGITS, np.round)
    fraction, exponent = np.frexp(numbers)
    few = np.ldexp(rounding(np.ldexp(fraction, digits)), exponent - digits).astype(np.float32)
    steps = np.diff(few.view(np.int32) >> 9, prepend=0)
    unsigned = np.where(steps < 0, -2 * steps - 1, 2 * steps)
    return np.stack([unsigned >> shift & 255 for shift in (0, 8, 16)]).astype(np.uint8)


def _coordinate(coordinate: xr.DataArray, template: xr.DataArray) -> dict[str, Any]:
    sizes = list(template.sizes.values())
    strides = dict(zip(template.dims, np.cumprod([1, *sizes[:0:-1]])[::-1].tolist(), strict=True))
    return {
        "texts": [plain_text(value_text(coordinate[index])) for index in np.ndindex(coordinate.shape)],
        "along": [[strides[dim], size] for dim, size in coordinate.sizes.items()],
    }


def _slice_text(ds: xr.Dataset, dim: str, k: int) -> str:
    """Values at a place along a dimension."""
    along = [coordinate for coordinate in ds.coords.values() if coordinate.dims == (dim,)]
    return ", ".join(plain_text(value_text(coordinate[k])) for coordinate in along) or f"{dim} {k}"


def _document(sweep: _Sweep) -> Any:
    """The document of Bokeh. The script beside this file fills it when the page is loaded."""
    from bokeh import models
    from bokeh.document import Document
    from bokeh.events import DocumentReady
    from bokeh.layouts import column, row

    ds, template = sweep.ds, sweep.ds[sweep.var]
    names = [name for name in numeric_names(ds) if set(ds[name].dims) == set(template.dims)]
    columns = {name: _column(ds[name], ds, sweep.whole[name], len(sweep.slices)) for name in names}
    variables = {name: about for name, (_, about, _) in columns.items()}
    plot = _plot(sweep.horizontal, sweep.vertical)
    bars = {name: _colour_bars(plot, about, colours) for name, (_, about, colours) in columns.items()}
    paint = models.LinearColorMapper(palette=[look.NO_VALUE], nan_color=look.NO_VALUE)
    shown = _points(plot, sweep, paint) if sweep.points is not None else _cells(plot, sweep, paint)
    choice = {"stylesheets": [models.InlineStyleSheet(css=_DARK)], "sizing_mode": "stretch_width"}
    titles = [(name, about["title"]) for name, about in variables.items()]
    variable = models.Select(title="variable", value=sweep.var, options=titles, **choice)
    slices = []
    for dim in sweep.slices:
        options = [(str(k), _slice_text(ds, dim, k)) for k in range(ds.sizes[dim])]
        slices.append(models.Select(title="slice", value="0", options=options, **choice))
    coordinates = [_coordinate(c, template) for c in swept(ds) or template.coords.values() if c.dims]
    cells = {name: values for name, (values, _, _) in columns.items()}
    known = {"plot": plot, "paint": paint, "bars": bars, "axes": [*plot.xaxis, *plot.yaxis], "variable": variable}
    known |= {"slices": slices, "cells": cells, "variables": variables, "coordinates": coordinates}
    code = (files("ringsweep.plots") / "page.js").read_text(encoding="utf-8")
    show = models.CustomJS(args=known | shown, code=code)
    for chooser in (variable, *slices):
        chooser.js_on_change("value", show)
    tell = models.CustomJSHover(code="return ringsweep_tell(special_vars)")
    for renderer in (shown["drawn"], *shown["curve"][-1:]):
        # Over a line, wherever the pointer is, the nearest cell tells its numbers.
        how = {"mode": "vline" if renderer in shown["curve"] else "mouse", "limit": 1}
        plot.add_tools(models.HoverTool(tooltips=_TOOLTIP, formatters={"@{value}": tell}, renderers=[renderer], **how))
    document = Document()
    heading = "; ".join([str(ds.attrs.get("title", "ringsweep")), *map(plain_text, sweep.notes)])
    notes = models.Div(text=heading, render_as_text=True, sizing_mode="stretch_width")
    choosers = row(variable, *slices, sizing_mode="stretch_width", styles={"flex-wrap": "wrap"})
    document.add_root(column(notes, choosers, plot, sizing_mode="stretch_both"))
    document.js_on_event(DocumentReady, show)
    return document


def _plot(horizontal: Axis, vertical: Axis | None) -> Any:
    """An empty plot with its axes."""
    from bokeh import models
    from bokeh.plotting import figure

    scales = {"x_axis_type": horizontal.scale, "y_axis_type": vertical.scale if vertical else "linear"}
    below, beside = plain_text(horizontal.label), plain_text(vertical.label) if vertical else ""
    names = {"x_axis_label": below, "y_axis_label": beside}
    tools = {"tools": "pan,wheel_zoom,box_zoom,reset,save", "active_scroll": "wheel_zoom"}
    plot = figure(**scales, **names, **tools, sizing_mode="stretch_both", min_height=360, outline_line_color=None)
    plot.grid.visible = False
    plot.toolbar.logo = None
    plot.axis.axis_label_text_font_style = "normal"
    plot.axis.axis_label_text_font_size = "14px"
    plot.axis.major_label_text_font_size = "12px"
    for axis, drawn in ((horizontal, plot.xaxis), (vertical, plot.yaxis)):
        if axis and axis.scale == "log":
            # Over less than two decades the ticks are those of a linear axis: many, of which those that fit are shown.
            drawn.ticker, drawn.major_label_policy = models.LogTicker(desired_num_ticks=20), models.NoOverlap()
            drawn.formatter = models.LogTickFormatter(min_exponent=4)
        if axis and axis.names:
            drawn.ticker = models.FixedTicker(ticks=list(range(len(axis.names))))
            drawn.major_label_overrides = dict(enumerate(axis.names))
    return plot


def _colour_bars(plot: Any, about: dict[str, Any], colours: tuple[list[str], float, float]) -> list[Any]:
    """Colour bars of a variable, to the right of a plot and, for a narrow page, below."""
    from bokeh import models

    palette, low, high = colours
    kind = models.LogColorMapper if about["logarithmic"] else models.LinearColorMapper
    # Numbers of a page are rounded: the least one must not fall below the scale, where only zeros are.
    zeros = {"low": 0.99 * low, "low_color": ZERO} if about["logarithmic"] else {"low": low}
    style: dict[str, Any] = {"color_mapper": kind(palette=palette, high=high, **zeros), "visible": False}
    if about["words"] is not None:
        style["ticker"] = models.FixedTicker(ticks=list(range(len(about["words"]))))
    bars = [models.ColorBar(**style, major_label_text_font_size=f"{size}px") for size in (12, 11)]
    for bar, side in zip(bars, ("right", "below"), strict=True):
        plot.add_layout(bar, side)
    return bars


def _points(plot: Any, sweep: _Sweep, paint: Any) -> dict[str, Any]:
    """Draw cells that are points; returns what the script knows of them."""
    from bokeh import models

    assert sweep.points is not None
    assert sweep.vertical is not None
    count = sweep.points.size
    places = {"x": sweep.horizontal.values_at(sweep.points), "y": sweep.vertical.values_at(sweep.points)}
    view = models.ColumnDataSource(places | {"value": np.zeros(count, dtype=np.float32)})
    size = float(np.clip(300 / math.sqrt(count), 5, 14))
    fill = {"field": "value", "transform": paint}
    drawn = plot.scatter("x", "y", size=size, line_color=None, fill_color=fill, source=view)
    doubtful = models.ColumnDataSource({"x": [], "y": []})
    plot.scatter("x", "y", marker="x", size=0.6 * size, line_color="black", source=doubtful)
    known = {"drawn": drawn, "view": view, "edges": None, "doubtful": doubtful, "line": None, "curve": []}
    return known | {"columns": np.arange(count, dtype=np.int32), "rows": np.zeros(1, dtype=np.int32), "size": count}


def _cells(plot: Any, sweep: _Sweep, paint: Any) -> dict[str, Any]:
    """Draw cells of a grid, over one quantity a curve too; returns what the script knows of them."""
    from bokeh import models

    horizontal, vertical = sweep.horizontal, sweep.vertical
    edges = [horizontal.edges, vertical.edges if vertical else np.array([0.0, 1.0])]
    columns = _cells_of_pixels(edges[0], horizontal.scale)
    rows = _cells_of_pixels(edges[1], vertical.scale if vertical else "linear")
    view = models.ColumnDataSource({"value": [np.zeros((len(rows), len(columns)), dtype=np.float32)]})
    (left, right), (bottom, top) = ((float(e[0]), float(e[-1])) for e in edges)
    plot.x_range, plot.y_range = models.Range1d(left, right), models.Range1d(bottom, top)
    drawn = plot.image("value", x=left, y=bottom, dw=right - left, dh=top - bottom, source=view, color_mapper=paint)
    doubtful = models.ColumnDataSource({"left": [], "right": [], "bottom": [], "top": []})
    style = {"fill_color": None, "line_color": None, "hatch_pattern": "/", "hatch_scale": 8, "hatch_weight": 0.5}
    plot.quad("left", "right", "bottom", "top", source=doubtful, **style)
    known = {"drawn": drawn, "view": view, "edges": edges, "doubtful": doubtful, "line": None, "curve": []}
    width, height = len(horizontal.values), len(vertical.values) if vertical else 1
    if vertical is None:
        known["line"] = models.ColumnDataSource({"x": horizontal.values, "value": np.zeros(width, dtype=np.float32)})
        style = {"color": look.CURVE_COLOURS[0], "source": known["line"]}
        known["curve"] = [plot.line("x", "value", **style), plot.scatter("x", "value", size=5, **style)]
    pixels = {"columns": columns.astype(np.int32), "rows": (rows * width).astype(np.int32)}
    return known | pixels | {"size": width * height}


def _cells_of_pixels(edges: NDArray[Any], scale: str) -> NDArray[np.intp]:
    """The cell that each pixel along an axis shows; one pixel a cell if their distances are equal."""
    at = np.log(edges) if scale == "log" else edges
    count = len(edges) - 1
    if np.ptp(np.diff(at)) > 1e-6 * (at[-1] - at[0]) / count:
        count = _PIXELS
    middles = at[0] + (np.arange(count) + 0.5) / count * (at[-1] - at[0])
    return np.searchsorted(at[1:-1], middles)
