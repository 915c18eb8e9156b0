"""Regime maps of sweeps."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np
import xarray as xr
from matplotlib import cm, colors, patches, patheffects, rcParams, ticker
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.path import Path as Outline
from numpy.typing import NDArray

from ringsweep.errors import InputError
from ringsweep.plots import labels, look, map_colours
from ringsweep.plots.datasets import is_sampled, mapped, require_sweep, scene_text
from ringsweep.plots.map_axes import Axis, as_matrix, choose_axes, is_scattered, thinned
from ringsweep.plots.probability import probability_panel
from ringsweep.plots.sections import axes_of, bifurcation, multiplier_circle, points_of
from ringsweep.plots.selection import select
from ringsweep.quantities.units import percent_at_most
from ringsweep.quantities.variables import AUDITED, INFERRED, POINTS, swept

_MOST_PANELS = 25

# Greatest number of cells drawn along an axis: more than a printed page has pixels. Drawing all of millions takes
# gigabytes.
_MOST_CELLS = 1200

# Probabilities whose curves are drawn, and their style.
_LEVELS: dict[float, Any] = {0.05: ":", 0.5: "-", 0.95: "--"}

_CURVE: dict[str, Any] = {
    "color": "black",
    "linewidth": 0.8,
    # Visible on dark cells too.
    "path_effects": [patheffects.withStroke(linewidth=2.0, foreground="white")],
}


def regime_map(
    ds: xr.Dataset,
    x: str | None = None,
    y: str | None = None,
    var: str | None = None,
    sel: Mapping[str, float | str] | None = None,
    boundaries: xr.Dataset | None = None,
    title: bool | str = True,
    legend: bool | str = True,
    norm: str | None = None,
    cmap: str | None = None,
    units: Mapping[str, str] | None = None,
) -> Figure:
    """Draw one variable of a sweep over the swept quantities, as a new figure.

    The cells of a grid are coloured rectangles, points make a scatter plot. One swept quantity makes a strip (of a
    classification) or a line (of numbers). More than two dimensions make small multiples. If an axis has more values
    than a page has pixels, only every second, third, ... is drawn, and the title says so; the legend gives shares of
    all cells.

    Parameters
    ----------
    ds : xarray.Dataset
        Result of a sweep.
    x, y : str, optional
        Coordinates of the horizontal and the vertical axis; by default the first and the second that were swept.
    var : str, optional
        Variable to draw; by default the regime. If the sweep has sections along one axis, they are drawn as a
        :func:`bifurcation` diagram instead, and one sampled cell as a :func:`probability_panel`, unless a further
        argument asks for what only a map has.
    sel : mapping of str to float or str, optional
        Coordinates held at the value nearest to the one given, which must lie within the axis: a plain number is SI,
        text may have a unit. A warning and the title state the value taken if it is another.
    boundaries : xarray.Dataset, optional
        Curves of :func:`ringsweep.boundary`, which are drawn over a map of one panel.
    title : bool or str
        Whether the map has its title, or the title in its place.
    legend : bool or str
        Whether the map has a legend, or its place: ``"beside"``, ``"below"``, or a location of matplotlib within the
        axes, such as ``"upper left"``. By default it stands beside the map, and below one that is
        narrower than 117 mm. The legend of several panels always stands above them.
    norm : {"linear", "log"}, optional
        Scale of the colours of numbers; by default logarithmic for bounds on errors, and where most of a map would
        be dark.
    cmap : str, optional
        Colour map of matplotlib for numbers.
    units : mapping of str to str, optional
        Units of axes or of the variable, such as ``{"ring.radius": "mm"}``. By default swept quantities have the unit
        in which the configuration wrote them, and angles that of :func:`style`. The file stays SI.

    Returns
    -------
    matplotlib.figure.Figure

    Raises
    ------
    InputError
        If a name or a place is unknown, a unit does not fit, a single cell is left, or more than 25 panels would be
        needed.

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
    plain = boundaries is None and title is True and legend is True and not (y or norm or cmap or units)
    kind, var = suitable(ds, var, sel or {}, plain)
    if kind == "diagram":
        return bifurcation(ds, x, var, sel)
    width = look.figure_width()
    if kind != "map":
        figure = look.picture(width, 0.65 * width)
        one, ax = select(ds, sel or {})[0], figure.add_subplot()
        _ = multiplier_circle(one, x, ax) if kind == "circle" else probability_panel(one, ax)
        return figure
    found = Map(ds, (x, y), var, sel, (norm, cmap), units)
    if boundaries is not None:
        found.entries.append(found.curve_entry(boundaries))
        if found.vertical is None:
            # Cells of a strip meet where the boundary is: halfway would leave slivers of the wrong colour beside it.
            places = boundaries[found.horizontal.name].values * found.horizontal.factor
            found.horizontal = replace(found.horizontal, meet=places)
    if len(found.panels) > 1:
        return found.draw_panels(width, title, legend)
    height = 0.62 if found.vertical else 0.3 if found.scale.meanings else 0.45
    extra = 0.7 if look.is_narrow(width) else 0.3
    figure = look.picture(width, height * width + extra)
    ax = figure.add_subplot()
    found.draw_alone(ax, title, legend)
    if boundaries is not None:
        found.draw_curves(ax, boundaries)
    return figure


def suitable(ds: xr.Dataset, var: str | None, sel: Mapping[str, float | str], plain: bool) -> tuple[str, str]:
    """Kind of picture that suits a variable of a sweep, and the variable; `var` is None for any.

    The kind is ``"diagram"``, ``"circle"``, ``"bars"`` or ``"map"``. Unless `plain`, something is wanted that only a
    map has.
    """
    require_sweep(ds)
    ds = ds.isel({name: 0 for name in (one.replace(".", "_") for one in sel) if name in ds.dims})
    if var in POINTS or (plain and var is None and any(len(axes_of(ds, name)) == 1 for name in points_of(ds))):
        return "diagram", var or points_of(ds)[0]
    if plain and str(var).startswith("multiplier_") and len(axes_of(ds, "multiplier_angle_1")) == 1:
        return "circle", str(var)
    is_cell = is_sampled(ds) and all(dim == "word" or size == 1 for dim, size in ds["probability"].sizes.items())
    if plain and var in (None, "probability") and is_cell and "word" in ds.dims:
        return "bars", "probability"
    return "map", var or "regime"


def map_panel(
    ds: xr.Dataset,
    x: str | None = None,
    y: str | None = None,
    var: str = "regime",
    sel: Mapping[str, float | str] | None = None,
    ax: Axes | None = None,
    title: bool | str = True,
    legend: bool | str = True,
) -> Axes:
    """Draw one variable of a sweep over one or two swept quantities; see :func:`regime_map`.

    Parameters
    ----------
    ds : xarray.Dataset
        Result of a sweep.
    x, y : str, optional
        Coordinates of the horizontal and the vertical axis; by default the first and the second that were swept.
    var : str
        Variable to draw.
    sel : mapping of str to float or str, optional
        Coordinates held at the value nearest to the one given, which must lie within the axis: a plain number is SI,
        text may have a unit. A warning and the title state the value taken if it is another.
    ax : matplotlib.axes.Axes, optional
        Axes to draw in, by default pyplot's current ones. The legend stands outside them: a figure with
        ``layout="constrained"`` makes room for it.
    title : bool or str
        Whether the map has its title, or the title in its place.
    legend : bool or str
        Whether the map has a legend, or its place: ``"beside"``, ``"below"``, or a location of matplotlib within the
        axes, such as ``"upper left"``.

    Returns
    -------
    matplotlib.axes.Axes

    Raises
    ------
    InputError
        If a name or a place is unknown, a single cell is left, or more than two dimensions are left.

    Examples
    --------
    >>> import numpy as np
    >>> import xarray as xr
    >>> from matplotlib.figure import Figure
    >>> ds = xr.Dataset({"phi_max": ("speed", [0.1, 0.3, 0.2], {"units": "rad"})}, coords={"speed": [1.0, 2.0, 3.0]})
    >>> map_panel(ds, var="phi_max", ax=Figure().add_subplot()).get_ylabel()
    'phi_max (°)'
    """
    found = Map(ds, (x, y), var, sel)
    ax = look.axes_or_current(ax, 0.65)
    found.draw_alone(ax, title, legend)
    return ax


Pair = tuple[str | None, str | None]

#: Warnings of a panel with the cells that have them.
Warnings = list[tuple[map_colours.CellWarning, xr.DataArray]]


class Map:
    """A map before it is drawn; arguments and errors as for :func:`regime_map`.

    Parameters
    ----------
    axes : tuple of str or None
        `x` and `y`.
    colours : tuple of str or None
        `norm` and `cmap`.

    Attributes
    ----------
    ds : xarray.Dataset
        The sweep without the dimensions that are held.
    data : xarray.DataArray
        The variable, at the cells that are drawn.
    horizontal, vertical : Axis
        Axes of the cells that are drawn; `vertical` is None if one quantity was swept.
    scattered : bool
        Whether points are drawn; else the cells of a grid.
    scale : ColourScale
    warnings : list of CellWarning
    panels : list of (list of str, dict)
        Texts of the title of each panel, and its index along the dimensions that are not axes.
    columns : int
        Columns of panels.
    entries : list of Artist
        Entries of the legend.
    texts : list of str
        What the title says: the variable, values held, cells left out.
    """

    def __init__(self, ds: xr.Dataset, axes: Pair, var: str, sel: Any, colours: Pair = (None, None), units: Any = None):
        require_sweep(ds)
        ds, sel = labels.in_units(ds, units), sel or {}
        ds, var = mapped(ds, var, sel)
        if var in POINTS:
            raise InputError("var", f"{var} are the points of sections: plots.bifurcation draws them")
        self.ds, held, horizontal, vertical = choose_axes(ds, var, sel, *axes)
        data = labels.displayed(self.ds[var])
        self.scattered = is_scattered(horizontal, vertical)
        self.scale = map_colours.ColourScale.of(data, *colours)
        warnings = map_colours.cell_warnings(self.ds, data)
        along = {*horizontal.dims, *(vertical.dims if vertical else ())}
        self.panels = _panels(self.ds, [str(dim) for dim in data.dims if dim not in along])
        self.columns = math.ceil(math.sqrt(len(self.panels)))
        # A line is drawn with all its values: every peak stays visible.
        drawn = {}
        if not self.scattered and vertical:
            drawn = thinned([horizontal, vertical], _MOST_CELLS // self.columns)
        thin = self.ds.isel(drawn)
        self.data = labels.displayed(thin[var])
        self.horizontal, self.vertical = horizontal.within(thin), vertical.within(thin) if vertical else None
        self.warnings = [replace(warning, cells=warning.cells.isel(drawn)) for warning in warnings]
        self.entries = self._legend(data, warnings)
        share = math.prod(self.ds.sizes[dim] / len(indices) for dim, indices in drawn.items())
        thinning = [f"1 cell in {share:.0f} drawn"] if drawn else []
        # The legend of a map of origins has the shares, and its title is long.
        name = "" if self.scale.meanings is None else labels.long_name(data)
        told, audit = scene_text(self.ds), audit_texts(self.ds)
        if var == "origin":
            name, told = "cells run or inferred", []
            audit = [text.replace("others: at most", "inferred: ≤") for text in audit[1:]]
        only = self.panels[0][0] if len(self.panels) == 1 else []
        self.texts = [name, *only, *held, *told, *thinning, *audit]

    def _legend(self, data: xr.DataArray, warnings: list[map_colours.CellWarning]) -> list[Artist]:
        """Entries of the legend for classes, missing values and warnings, each with its share of the cells."""
        entries: list[Artist] = []

        def add(where: NDArray[Any], label: str, colour: Any) -> None:
            if where.any():
                entries.append(patches.Patch(color=colour, label=f"{label}, {map_colours.share_text(where)}"))

        shown = np.isfinite(data.values)
        if self.scale.flags is not None and self.scale.meanings is not None:
            shown = np.isin(data.values, self.scale.flags)
            for k, (flag, meaning) in enumerate(zip(self.scale.flags, self.scale.meanings, strict=True)):
                add(data.values == flag, meaning, self.scale.colours(k))
        if not shown.all():
            add(~shown, map_colours.missing_text(self.ds, data), look.on_page(look.NO_VALUE))
        if isinstance(self.scale.norm, colors.LogNorm) and self.vertical:
            add(data.values == 0.0, "exactly 0", map_colours.ZERO)
        ink = look.on_page("black")
        for warning in warnings:
            label = f"{warning.label}, {map_colours.share_text(warning.cells.values)}"
            if warning.everywhere:
                label = warning.label if "certify is" in label else label
                entries.append(Line2D([], [], linestyle="", label=label))
            elif self.scattered:
                entries.append(Line2D([], [], color=ink, linestyle="", marker=warning.marker, label=label))
            else:
                entries.append(patches.Patch(fc="none", ec=ink, hatch=warning.hatch, linewidth=0.5, label=label))
                entries[-1].set(hatch_linewidth=0.5)
        return entries

    @property
    def vertical_label(self) -> str:
        """Text beside the vertical axis."""
        if self.vertical:
            return self.vertical.label
        return "" if self.scale.meanings else labels.axis_label(self.data, self.ds)

    def title_text(self, title: bool | str, inches: float) -> str:
        """The title in lines of at most this width; empty if the user wants none."""
        if isinstance(title, str):
            return title
        return look.folded(self.texts, inches) if title else ""

    def draw_panels(self, width: float, title: bool | str, legend: bool | str) -> Figure:
        """A new figure of this width with a panel for each value along the dimensions that are not axes."""
        # Narrower panels have no room for ticks and titles.
        columns = max(1, min(self.columns, int((width - look.MARGIN) / 1.2)))
        count = len(self.panels)
        rows = math.ceil(count / columns)
        bar = self.scale.meanings is None and self.vertical is not None
        each = (width - look.MARGIN * (2 if bar else 1)) / columns
        titles = ["\n".join(look.folded([text], each) for text in texts) for texts, _ in self.panels]
        lines = max(title.count("\n") + 1 for title in titles)
        height = rows * (0.75 * each + 0.0175 * rcParams["font.size"] * lines) + 1.3
        figure = look.picture(width, height)
        grid = figure.subplots(rows, columns, sharex=True, sharey=True, squeeze=False)
        for axes in grid.flat[count:]:
            axes.remove()
        # If the last row is short, panels of the row above it need tick labels.
        for axes in grid.flat[count - columns : count]:
            axes.xaxis.set_tick_params(labelbottom=True)
        for axes, words, (_, index) in zip(grid.flat, titles, self.panels, strict=False):
            axes.set_title(words, fontsize=look.SMALL)
            self.draw(axes, index)
        figure.supxlabel(self.horizontal.label, fontsize="medium")
        figure.supylabel(self.vertical_label, fontsize="medium")
        if bar:
            self.add_colour_bar(list(grid.flat[:count]))
        text = self.title_text(title, width)
        if self.entries and legend is not False:
            # A legend above the panels would cover a title of the figure, and one below them the label of the axis.
            style = look.LEGEND | {"handleheight": 1.4, "columnspacing": 1.2, "title": text, "title_fontsize": "medium"}
            columns = look.columns_of(self.entries, width)
            figure.legend(handles=self.entries, loc="outside upper center", ncols=columns, **style)
        elif text:
            figure.suptitle(text, fontsize="medium")
        return figure

    def draw(self, axes: Axes, index: Mapping[str, int]) -> None:
        """Draw the panel at an index along the dimensions that are not axes."""
        look.small_ticks(axes)
        self.horizontal.apply(axes.set_xscale, axes.xaxis)
        if self.vertical:
            self.vertical.apply(axes.set_yscale, axes.yaxis)
        numbers = self.scale.numbers(self.data.isel(index))
        if self.vertical is None and self.scale.meanings is None:
            self._draw_line(axes, numbers, index)
            return
        seen = [warning for warning in self.warnings if not warning.everywhere]
        warnings = [(warning, warning.cells.isel(index).transpose(*numbers.dims)) for warning in seen]
        if self.scattered and self.vertical:
            self._draw_points(axes, self.vertical, numbers, warnings)
        else:
            self._draw_cells(axes, numbers, warnings)
            if self.data.name == "probability" and self.vertical and min(numbers.shape) > 1:
                self._draw_levels(axes, self.vertical, numbers)

    def draw_curves(self, axes: Axes, boundaries: xr.Dataset) -> None:
        """Draw the curves of boundaries over a panel."""
        for number in np.unique(boundaries["line"]):
            line = boundaries.isel(vertex=boundaries["line"].values == number)
            if self.vertical is None:
                axes.axvline(line[self.horizontal.name].values[0] * self.horizontal.factor, **_CURVE)
            else:
                points = self._whole_curve(self.vertical, line)
                axes.plot(*points.T, marker="." if len(points) == 1 else "", **_CURVE)

    def _whole_curve(self, vertical: Axis, line: xr.Dataset) -> NDArray[Any]:
        """Points of a curve, shape ``(points, 2)``: up to the frame if it ends at it, and closed if it is.

        The points of a boundary lie between the middles of cells, so the last of them is half a cell from the frame.
        """
        pair = self.horizontal, vertical
        points = np.column_stack([line[axis.name].values * axis.factor for axis in pair])
        along = line["axis"].attrs["flag_meanings"].split()
        inside = True
        for end in (0, -1):
            across = 1 - [axis.name for axis in pair].index(along[int(line["axis"].values[end])])
            for value, edge in zip(pair[across].values[[0, -1]], pair[across].edges[[0, -1]], strict=True):
                if np.isclose(points[end, across], value, rtol=1e-9, atol=0.0):
                    outer = points[end].copy()
                    outer[across] = edge
                    points = np.insert(points, end if end == 0 else len(points), outer, axis=0)
                    inside = False
                    break
        # A curve that uncertified cells interrupt has its ends apart.
        cells = np.column_stack([np.interp(points[:, k], pair[k].values, range(len(pair[k].values))) for k in (0, 1)])
        if inside and len(points) > 3 and (np.abs(cells[0] - cells[-1]) <= 1.0).all():
            points = np.vstack([points, points[:1]])
        return points

    def check_takes_curves(self) -> None:
        """Raise an error unless the curves of boundaries can be drawn over the map."""
        if self.scattered or len(self.panels) > 1:
            raise InputError("boundaries", "are drawn over one map of a grid: hold the other axes")

    def curve_entry(self, boundaries: xr.Dataset) -> Artist:
        """Entry of the legend for the curves of boundaries."""
        self.check_takes_curves()
        for held in swept(self.ds):
            if not held.dims and held.name in boundaries.coords and (boundaries[held.name].values != held.values).any():
                own = labels.plain_text(labels.value_text(held))
                raise InputError("boundaries", f"are those of another map: this one has {own}")
        regime, tolerance = boundaries.attrs["boundary_of"], boundaries.attrs["boundary_tolerance"]
        # Along each axis the error is a number in the unit of the axis.
        along = [self.ds[axis.name][0] for axis in (self.horizontal, self.vertical) if axis is not None]
        errors = [labels.amount_text(value.astype(float).copy(data=tolerance), 2) for value in along]
        text = labels.plain_text(" or ".join(dict.fromkeys(errors)))
        return Line2D([], [], label=f"boundary of {regime}\n± {text}", **_CURVE)

    def _draw_line(self, axes: Axes, data: xr.DataArray, index: Mapping[str, int]) -> None:
        """Draw numbers along one axis, with the interval of a probability or a quantile if the dataset has it."""
        x, numbers, edges = self.horizontal.values, self.horizontal.along(data), self.horizontal.edges
        gaps = [(edges[i], edges[j] - edges[i]) for i, j in look.true_ranges(np.isnan(numbers))]
        grey = look.on_page(look.NO_VALUE)
        axes.broken_barh(gaps, (0, 1), transform=axes.get_xaxis_transform(), color=grey, linewidth=0)
        axes.plot(x, numbers, marker="o" if len(x) <= 100 else ".", markersize=4, color=look.pair(0))
        if self.data.name == "probability":
            axes.set_ylim(-0.02, 1.02)
        ends = [f"{self.data.name}{end}" for end in ("_low", "_high")]
        if all(end in self.ds for end in ends):
            low, high = (self.horizontal.along(labels.displayed(self.ds[end].isel(index))) for end in ends)
            look.band(axes, x, low, high, look.pair(0))

    def _draw_levels(self, axes: Axes, vertical: Axis, data: xr.DataArray) -> None:
        """Draw the curves along which a probability is 5, 50 and 95 %."""
        numbers = as_matrix(data, self.horizontal, vertical)
        x, y = self.horizontal.values, vertical.values
        levels = [level for level in _LEVELS if numbers.min() < level < numbers.max()]
        if levels:
            styles = [_LEVELS[level] for level in levels]
            curves = axes.contour(x, y, numbers, levels, colors="white", linewidths=1.2, linestyles=styles)
            stroke: list[Any] = [patheffects.withStroke(linewidth=2.2, foreground="#404040")]
            curves.set_path_effects(stroke)
            for text in axes.clabel(curves, fmt=lambda level: f"{level:.0%}", fontsize=look.SMALL):
                text.set_path_effects(stroke)

    def _draw_points(self, axes: Axes, vertical: Axis, data: xr.DataArray, warnings: Warnings) -> None:
        x, y = self.horizontal.values_at(data), vertical.values_at(data)
        colours = self.scale.rgba(data.values.ravel())
        area = float(np.clip(6000 / x.size, 4, 60))
        axes.scatter(x, y, c=colours, s=area, rasterized=x.size > 5000)
        for warning, cells in warnings:
            for colour, where in _in_contrast(cells.values.ravel(), colours):
                axes.scatter(x[where], y[where], s=area / 3, c=colour, marker=warning.marker, linewidths=0.6)

    def _draw_cells(self, axes: Axes, data: xr.DataArray, warnings: Warnings) -> None:
        x, y = self.horizontal.edges, self.vertical.edges if self.vertical else np.array([0.0, 1.0])
        numbers = as_matrix(data, self.horizontal, self.vertical)
        colours = self.scale.rgba(numbers)
        if isinstance(self.scale.norm, colors.LogNorm):
            axes.pcolormesh(x, y, colours, rasterized=True)
        else:
            palette: dict[str, Any] = {"cmap": self.scale.colours, "norm": self.scale.norm}
            axes.pcolormesh(x, y, np.ma.masked_invalid(numbers), rasterized=True, **palette)
        for warning, cells in warnings:
            for colour, where in _in_contrast(as_matrix(cells, self.horizontal, self.vertical), colours):
                style: dict[str, Any] = {"edgecolor": colour, "hatch": warning.hatch, "hatch_linewidth": 0.5}
                # add_patch would visit every rectangle to update the limits of the axes, which are known.
                axes.add_artist(patches.PathPatch(_outline(where, x, y), fill=False, linewidth=0, **style))
        if self.vertical is None:
            axes.set_yticks([])
        elif data.name == "origin":
            self._mark_audited(axes, self.vertical, data)

    def _mark_audited(self, axes: Axes, vertical: Axis, data: xr.DataArray) -> None:
        """Mark audited cells, which are smaller than a dot of a large map."""
        row, column = np.nonzero(as_matrix(data == AUDITED, self.horizontal, vertical))
        colour = self.scale.colours(int(np.flatnonzero(np.asarray(self.scale.flags) == AUDITED)[0]))
        style: dict[str, Any] = {"edgecolors": "black", "linewidths": 0.3, "s": 9, "rasterized": len(row) > 2000}
        axes.scatter(self.horizontal.values[column], vertical.values[row], color=colour, **style)

    def draw_alone(self, axes: Axes, title: bool | str = True, legend: bool | str = True) -> None:
        """Draw a map of one panel with labels, title, colour bar and legend."""
        if len(self.panels) > 1:
            left = ", ".join(self.panels[0][1])
            cure = "hold it, or draw regime_map, which makes a panel for each value"
            raise InputError("sel", f"one panel cannot show {left}: {cure}")
        self.draw(axes, self.panels[0][1])
        look.label_axes(axes, self.horizontal.label, self.vertical_label)
        bar = self.scale.meanings is None and self.vertical is not None
        if bar:
            self.add_colour_bar([axes])
        if legend is True:
            legend = "below" if bar or look.is_narrow(look.width_of(axes)) else "beside"
        beside = look.legend_width(self.entries) if legend == "beside" else look.MARGIN * bar
        # A title above the axes alone meets no legend.
        text = self.title_text(title, look.width_of(axes) - look.MARGIN - beside)
        axes.set_title(text, fontsize="medium")
        look.place_legend(axes, self.entries, legend, handleheight=1.4)

    def add_colour_bar(self, panels: list[Axes]) -> None:
        """Draw one colour bar beside the panels."""
        bar = cm.ScalarMappable(self.scale.norm, self.scale.colours)
        ticks = ticker.MaxNLocator(integer=True) if self.data.dtype.kind in "iu" else None
        height = 0.75 * look.size_of(panels[0])[1] * (1 + (len(panels) > 1))
        look.colour_bar(bar, panels, look.folded([labels.axis_label(self.data, self.ds)], height), ticks)


def audit_texts(ds: xr.Dataset) -> list[str]:
    """What a refined sweep says of itself, for the title."""
    if "origin" not in ds or "audit_bound" not in ds.attrs:
        return []
    run = ds["origin"].values != INFERRED
    words = [f"{100 * run.mean():.3g} % of the cells run"]
    if not ds.attrs["audit_cells"]:
        return [*words, "the others are not audited"]
    # The bound is on the whole sweep, and says nothing of a part.
    if run.sum() != ds.attrs["cells_computed"]:
        return words
    return [*words, f"others: at most {percent_at_most(ds.attrs['audit_bound'])} wrong (95 % confidence)"]


def _panels(ds: xr.Dataset, dims: list[str]) -> list[tuple[list[str], dict[str, int]]]:
    """Texts of the title, and index of a panel for each combination of values along the dimensions."""
    sizes = [ds.sizes[dim] for dim in dims]
    if math.prod(sizes) > _MOST_PANELS:
        left = ", ".join(f"{dim} ({size})" for dim, size in zip(dims, sizes, strict=True))
        need = f"need {math.prod(sizes)} panels, at most {_MOST_PANELS} (5 x 5) fit"
        raise InputError("sel", f"small multiples over {left} {need}; hold some of them: --sel {dims[0]}=VALUE")
    places = [dict(zip(dims, map(int, position), strict=True)) for position in np.ndindex(*sizes)]
    return [([labels.value_text(ds[dim][k]) for dim, k in index.items()], index) for index in places]


def _in_contrast(cells: NDArray[Any], colours: NDArray[Any]) -> list[tuple[str, NDArray[np.bool_]]]:
    """Which of some cells are marked in white, and which in black, so that the marks stand out from the colours."""
    dark = look.is_dark(colours)
    return [(colour, where) for colour, where in (("white", cells & dark), ("black", cells & ~dark)) if where.any()]


def _outline(cells: NDArray[Any], x: NDArray[Any], y: NDArray[Any]) -> Outline:
    """One path around all True cells, a rectangle for each unbroken range in a row.

    Hatching cell by cell would take minutes.
    """
    steps = np.diff(np.pad(cells.astype(np.int8), ((0, 0), (1, 1))), axis=1)
    row, begin = np.nonzero(steps == 1)
    end = np.nonzero(steps == -1)[1]
    left, right, low, high = x[begin], x[end], y[row], y[row + 1]
    corners = np.array([(left, low), (right, low), (right, high), (left, high)])
    return Outline.make_compound_path_from_polys(corners.transpose(2, 0, 1))
