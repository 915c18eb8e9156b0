"""Pictures of sections: bifurcation diagrams, the points of one motion, multipliers and exponents along an axis."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
import xarray as xr
from matplotlib import rcParams
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.colors import LogNorm, Normalize
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch
from matplotlib.ticker import MaxNLocator
from matplotlib.transforms import blended_transform_factory

from ringsweep.errors import InputError
from ringsweep.plots.datasets import resolve, scene_text
from ringsweep.plots.labels import display_factor, unit_text
from ringsweep.plots.map_axes import Axis
from ringsweep.plots.selection import select
from ringsweep.plots.style import (
    NO_VALUE,
    PAIR_COLOURS,
    REGIME_COLOURS,
    SMALL,
    STICK,
    axes_or_current,
    figure_width,
    folded,
    label_axes,
    legend_above,
    on_page,
    small_ticks,
    true_ranges,
)
from ringsweep.quantities.variables import POINTS, words

# Their full names would take half of a narrow picture.
_SHORT = {"x_section": "x", "velocity_section": "velocity", "deflection_section": "deflection"}
_SHORT |= {"phi_section": r"$\varphi$", "omega_section": r"$\omega$"}
_SHORT |= {f"deflection_{k}_section": f"deflection {k}" for k in (1, 2)}

# Points of the diagram, in points of a page squared, and the height of the strip of regimes as a share of the axes.
_DOT, _STRIP = 1.0, 0.025

# Heights of diagram, exponent, multipliers and unit circle, as multiples of the width.
_HEIGHTS = {"diagram": 0.5, "lyapunov": 0.25, "multiplier_1": 0.25, "circle": 0.75}

_DIRECTION = "direction"


def has_diagram(ds: xr.Dataset) -> bool:
    """Whether a dataset holds sections along one axis."""
    return any(len(_axes_of(ds, name)) == 1 for name in points_of(ds)[:1])


def has_circle(ds: xr.Dataset) -> bool:
    """Whether a dataset holds multipliers with their arguments along one axis."""
    return len(_axes_of(ds, "multiplier_angle_1")) == 1


def points_of(ds: xr.Dataset) -> list[str]:
    """Variables of the points of a section, place and velocity first; none without a section."""
    return [name for name in POINTS if name in ds]


def _axes_of(ds: xr.Dataset, name: str) -> list[str]:
    """Dimensions of a variable beside its section and the direction; none without this variable."""
    return [str(dim) for dim in ds[name].dims if dim not in ("section", _DIRECTION)] if name in ds else []


def bifurcation(
    ds: xr.Dataset, x: str | None = None, var: str | None = None, sel: Mapping[str, float | str] | None = None
) -> Figure:
    """Draw a bifurcation diagram as a new figure, with exponent and multipliers below if the dataset has them.

    Parameters
    ----------
    ds : xarray.Dataset
        Result of a sweep with a section along one axis, maybe followed up and down.
    x : str, optional
        Coordinate of the axis; by default the first that was swept along it.
    var : str, optional
        Variable of the section; by default the place of the body.
    sel : mapping of str to float or str, optional
        Other coordinates held at the value nearest to the one given.

    Returns
    -------
    matplotlib.figure.Figure

    Raises
    ------
    InputError
        If there is no section, or it has further axes.

    Examples
    --------
    >>> import xarray as xr
    >>> points = ("speed", "section"), [[0.0, 0.0], [-1.0, 1.0]], {"units": "m", "long_name": "x"}
    >>> ds = xr.Dataset({"x_section": points}, coords={"speed": [1.0, 2.0]})
    >>> len(bifurcation(ds).axes)
    1
    """
    ds, held = select(ds, sel or {})
    _require_diagram(ds)
    below = [name for name in ("lyapunov", "multiplier_1") if name in ds and bool(np.isfinite(ds[name]).any())]
    heights = [_HEIGHTS[name] for name in ("diagram", *below)]
    width = figure_width()
    figure = Figure(figsize=(width, sum(heights) * width + 0.6), layout="constrained")
    panels = figure.subplots(len(heights), 1, sharex=True, squeeze=False, height_ratios=heights)[:, 0]
    bifurcation_panel(ds, x, var, panels[0])
    for name, ax in zip(below, panels[1:], strict=True):
        if name == "multiplier_1":
            multiplier_panel(ds, x, ax)
            if _DIRECTION in ds.dims:
                # The diagram has the key to the directions; theirs would cover the name of the axis.
                handles, texts = ax.get_legend_handles_labels()
                both = zip(handles[:2], texts[:2], strict=True)
                colour = rcParams["text.color"]
                legend_above(ax, [_dot(drawn.get_marker(), colour, text.split(", ")[1]) for drawn, text in both])
        elif (legend := exponent_panel(ds, x, ax).get_legend()) is not None:
            # The panel above has the key to the directions.
            legend.remove()
    for ax in panels[:-1]:
        ax.set_xlabel("")
        ax.tick_params(labelbottom=False, which="both")
    if text := folded([*scene_text(ds), *held], width):
        figure.suptitle(text, fontsize=SMALL)
    return figure


def bifurcation_panel(ds: xr.Dataset, x: str | None = None, var: str | None = None, ax: Axes | None = None) -> Axes:
    """Draw the points of the sections over the axis, in a colour for each direction, under a strip of the regimes.

    Parameters
    ----------
    ds, x, var
        As for :func:`bifurcation`.
    ax : matplotlib.axes.Axes, optional
        Axes to draw in, by default pyplot's current ones.

    Returns
    -------
    matplotlib.axes.Axes

    Raises
    ------
    InputError
        As for :func:`bifurcation`.

    Examples
    --------
    >>> import numpy as np, xarray as xr
    >>> points = np.array([[[0.0, 0.0], [0.0, 0.1]], [[-1.0, 1.0], [-1.0, 1.0]]])
    >>> ds = xr.Dataset(
    ...     {"x_section": (("speed", "direction", "section"), points, {"units": "m", "long_name": "x"})},
    ...     coords={"speed": [1.0, 2.0], "direction": ["up", "down"]},
    ... )
    >>> [text.get_text() for text in bifurcation_panel(ds).get_legend().get_texts()]
    ['up', 'down']
    """
    axis = _axis(ds, x)
    known = points_of(ds)
    name = resolve("var", var, known) if var else known[0]
    ax = axes_or_current(ax, _HEIGHTS["diagram"])
    handles: list[Artist] = []
    branches = list(_branches(ds))
    # Where both branches are the same, the second one must not hide the first: it has smaller points.
    for k, (way, branch) in enumerate(branches):
        points = axis.along(branch[name]) * display_factor(ds[name])
        colour = on_page(PAIR_COLOURS[k])
        place = np.repeat(axis.values, points.shape[1])
        size = _DOT * (2.5 if k == 0 and len(branches) > 1 else 1.0)
        ax.scatter(place, points.ravel(), s=size, color=colour, linewidths=0, rasterized=True, zorder=2 + k)
        if way:
            handles.append(_dot("o", colour, way))
    if "regime" in ds:
        handles += _strips(ax, axis, ds)
    _finish(ax, axis, _label(ds, name))
    legend_above(ax, handles)
    return ax


def _strips(ax: Axes, axis: Axis, ds: xr.Dataset) -> list[Artist]:
    """Draw the regimes as a strip at the upper edge for each direction, the first at the top; entries of a legend."""
    found: dict[str, Artist] = {}
    across = blended_transform_factory(ax.transData, ax.transAxes)
    edges = axis.edges
    branches = list(_branches(ds))
    for k, (_, branch) in enumerate(branches):
        regime = axis.along(words(branch["regime"])).astype(str)
        for word in dict.fromkeys(regime.tolist()):
            colour = on_page(REGIME_COLOURS.get(word, NO_VALUE))
            spans = [(edges[a], edges[b] - edges[a]) for a, b in true_ranges(regime == word)]
            strip = (1.0 - (k + 1) * _STRIP, _STRIP)
            ax.broken_barh(spans, strip, transform=across, facecolors=colour, linewidth=0, zorder=5)
            found.setdefault(word, Patch(color=colour, label=word))
    low, high = ax.get_ylim()
    ax.set_ylim(low, high + 1.3 * len(branches) * _STRIP * (high - low))
    return list(found.values())


def section_panel(ds: xr.Dataset, ax: Axes | None = None) -> Axes:
    """Draw the points of one motion in the plane of place and velocity, coloured by their order in time.

    Parameters
    ----------
    ds : xarray.Dataset
        One cell of a sweep with a section.
    ax : matplotlib.axes.Axes, optional
        Axes to draw in, by default pyplot's current ones.

    Returns
    -------
    matplotlib.axes.Axes

    Raises
    ------
    InputError
        If there is no section, or the dataset has several cells.

    Examples
    --------
    >>> import xarray as xr
    >>> attributes = {"units": "m", "long_name": "x"}, {"units": "m/s", "long_name": "velocity"}
    >>> x, v = (("section", [0.0, 1.0, 0.5], one) for one in attributes)
    >>> section_panel(xr.Dataset({"x_section": x, "velocity_section": v})).get_xlabel()
    'x (m)'
    """
    _require_section(ds)
    ds = ds.squeeze()
    place, speed, *_ = points_of(ds)
    if ds[place].dims != ("section",):
        several = ", ".join(str(dim) for dim in ds[place].dims if dim != "section")
        raise InputError("ds", f"has sections along {several}, and this picture shows one: choose a cell by ds.sel")
    ax = axes_or_current(ax, 0.75)
    x, velocity = (ds[name].values * display_factor(ds[name]) for name in (place, speed))
    kept = np.isfinite(x) & np.isfinite(velocity)
    order = np.arange(1, kept.sum() + 1)
    drawn = ax.scatter(x[kept], velocity[kept], c=order, s=8.0, cmap="viridis", linewidths=0, rasterized=True)
    label_axes(ax, _label(ds, place), _label(ds, speed))
    if len(order) > 1:
        bar = ax.figure.colorbar(drawn, ax=ax, label="point, in time", ticks=MaxNLocator(6, integer=True))
        small_ticks(bar.ax)
    return ax


def exponent_panel(ds: xr.Dataset, x: str | None = None, ax: Axes | None = None) -> Axes:
    """Draw the largest Lyapunov exponent over the axis, with its standard error.

    Where it is -inf, since stick erases the past, a mark stands at the lower edge.

    Parameters
    ----------
    ds, x
        As for :func:`bifurcation`; the dataset has ``lyapunov``.
    ax : matplotlib.axes.Axes, optional
        Axes to draw in, by default pyplot's current ones.

    Returns
    -------
    matplotlib.axes.Axes

    Raises
    ------
    InputError
        If the dataset has no exponents along one axis.

    Examples
    --------
    >>> import xarray as xr
    >>> attributes = {"units": "s-1", "long_name": "exponent"}
    >>> numbers = {"lyapunov": ("speed", [-1.0, 0.5], attributes), "lyapunov_error": ("speed", [0.1, 0.1], attributes)}
    >>> exponent_panel(xr.Dataset(numbers, coords={"speed": [1.0, 2.0]})).get_xlabel()
    'speed'
    """
    axis = _axis(ds, x, "lyapunov")
    ax = axes_or_current(ax, _HEIGHTS["lyapunov"])
    ax.axhline(0.0, color=rcParams["axes.edgecolor"], linewidth=0.8, zorder=1)
    for k, (way, branch) in enumerate(_branches(ds)):
        value = axis.along(branch["lyapunov"])
        colour = on_page(PAIR_COLOURS[k])
        finite = np.where(np.isfinite(value), value, np.nan)
        ax.plot(axis.values, finite, ".-", color=colour, markersize=2, linewidth=0.8, label=way or None)
        if "lyapunov_error" in branch:
            error = axis.along(branch["lyapunov_error"])
            band = finite - error, finite + error
            ax.fill_between(axis.values, *band, color=colour, alpha=0.3, linewidth=0)
        erased = axis.values[np.isneginf(value)]
        edge = blended_transform_factory(ax.transData, ax.transAxes)
        ax.plot(erased, np.full(len(erased), 0.03), "v", transform=edge, color=colour, markersize=2)
    _finish(ax, axis, "exponent (s$^{-1}$)")
    legend_above(ax)
    return ax


def multiplier_panel(ds: xr.Dataset, x: str | None = None, ax: Axes | None = None) -> Axes:
    """Draw the magnitudes of the Floquet multipliers over the axis; the inside of the unit circle is shaded.

    Parameters
    ----------
    ds, x
        As for :func:`bifurcation`; the dataset has ``multiplier_1``.
    ax : matplotlib.axes.Axes, optional
        Axes to draw in, by default pyplot's current ones.

    Returns
    -------
    matplotlib.axes.Axes

    Raises
    ------
    InputError
        If the dataset has no multipliers along one axis.

    Examples
    --------
    >>> import xarray as xr
    >>> attributes = {"units": "1", "long_name": "multiplier"}
    >>> numbers = {f"multiplier_{k}": ("speed", [0.5, 0.9], attributes) for k in (1, 2)}
    >>> multiplier_panel(xr.Dataset(numbers, coords={"speed": [1.0, 2.0]})).get_xlabel()
    'speed'
    """
    axis = _axis(ds, x, "multiplier_1")
    ax = axes_or_current(ax, _HEIGHTS["multiplier_1"])
    ax.axhspan(0.0, 1.0, color=on_page(STICK), linewidth=0, zorder=0)
    for k, (way, branch) in enumerate(_branches(ds)):
        for name, dots, which in (("multiplier_1", ".", "larger one"), ("multiplier_2", "x", "smaller one")):
            if name in branch:
                value = axis.along(branch[name])
                label = f"{way}, {which}" if way else which
                ax.plot(axis.values, value, dots, color=on_page(PAIR_COLOURS[k]), markersize=2.5, label=label)
    ax.set_ylim(0.0, max(1.1, ax.get_ylim()[1]))
    _finish(ax, axis, "multipliers")
    legend_above(ax)
    return ax


def multiplier_circle(ds: xr.Dataset, x: str | None = None, ax: Axes | None = None) -> Axes:
    """Draw the Floquet multipliers in the complex plane with the unit circle, coloured by their place on the axis.

    A periodic motion is stable if all of them lie inside. Where one leaves the circle tells what the motion turns into:
    at 1 it meets an unstable one and vanishes (fold), at -1 its period doubles (flip), and a pair elsewhere gives a
    motion on a torus.

    Parameters
    ----------
    ds, x
        As for :func:`bifurcation`; the dataset has ``multiplier_1`` and ``multiplier_angle_1``.
    ax : matplotlib.axes.Axes, optional
        Axes to draw in, by default pyplot's current ones.

    Returns
    -------
    matplotlib.axes.Axes

    Raises
    ------
    InputError
        If the dataset has no multipliers along one axis.

    Examples
    --------
    >>> import xarray as xr
    >>> numbers = {"multiplier_1": ("speed", [0.5, 0.9]), "multiplier_angle_1": ("speed", [0.0, 3.0])}
    >>> multiplier_circle(xr.Dataset(numbers, coords={"speed": [1.0, 2.0]})).get_xlabel()
    'real part of the multipliers'
    """
    axis = _axis(ds, x, "multiplier_angle_1")
    ax = axes_or_current(ax, _HEIGHTS["circle"])
    turn = np.linspace(0.0, 2.0 * np.pi, 181)
    ax.fill(np.cos(turn), np.sin(turn), color=on_page(STICK), linewidth=0, zorder=0)
    ax.plot(np.cos(turn), np.sin(turn), color=rcParams["axes.edgecolor"], linewidth=0.8, zorder=1)
    for centred in (ax.axhline, ax.axvline):
        centred(0.0, color=rcParams["axes.edgecolor"], linewidth=0.4, zorder=1)
    handles: list[Artist] = []
    reach = 1.1
    edges = axis.edges
    colours: dict[str, Any] = {"c": axis.values, "cmap": "viridis"}
    colours["norm"] = (LogNorm if axis.scale == "log" else Normalize)(edges[0], edges[-1])
    for k, (way, branch) in enumerate(_branches(ds)):
        for name in ("1", "2"):
            if f"multiplier_angle_{name}" not in branch:
                continue
            size, angle = (axis.along(branch[f"{kind}_{name}"]) for kind in ("multiplier", "multiplier_angle"))
            known = np.isfinite(size) & np.isfinite(angle)
            reach = max(reach, 1.1 * size[known].max(initial=0.0))
            x_part, y_part = size * np.cos(angle), size * np.sin(angle)
            drawn = ax.scatter(
                x_part, y_part, s=10.0, marker="o^"[k], linewidths=0, rasterized=True, zorder=2 + k, **colours
            )
        if way:
            handles.append(_dot("o^"[k], rcParams["text.color"], way))
    ax.set(xlim=(-reach, reach), ylim=(-reach, reach), aspect="equal")
    label_axes(ax, "real part of the multipliers", "imaginary part")
    bar = ax.figure.colorbar(drawn, ax=ax, label=axis.label)
    if axis.names:
        bar.set_ticks(range(len(axis.names)), labels=axis.names)
    small_ticks(bar.ax)
    legend_above(ax, handles)
    return ax


def _dot(marker: str, colour: Any, label: str) -> Line2D:
    """Entry of a legend for points."""
    return Line2D([], [], linestyle="", marker=marker, markersize=4, color=colour, label=label)


def _label(ds: xr.Dataset, name: str) -> str:
    return f"{_SHORT[name]} ({unit_text(ds[name])})"


def _branches(ds: xr.Dataset) -> list[tuple[str, xr.Dataset]]:
    """Name and dataset of each direction; without directions one with no name."""
    if _DIRECTION not in ds.dims:
        return [("", ds)]
    return [(str(ds[_DIRECTION].values[k]), ds.isel({_DIRECTION: k})) for k in range(ds.sizes[_DIRECTION])]


def _require_section(ds: xr.Dataset) -> None:
    if not points_of(ds):
        raise InputError("ds", "has no section: give record: {section: {at: period}} in the configuration")


def _require_diagram(ds: xr.Dataset) -> None:
    _require_section(ds)
    if not has_diagram(ds):
        along = ", ".join(_axes_of(ds, points_of(ds)[0])) or "no axis"
        raise InputError("ds", f"has sections along {along}, and a diagram has one axis: hold the others by sel")


def _axis(ds: xr.Dataset, x: str | None, needed: str | None = None) -> Axis:
    """The axis of a diagram."""
    if needed is None:
        _require_diagram(ds)
        needed = points_of(ds)[0]
    dims = _axes_of(ds, needed)
    if len(dims) != 1:
        raise InputError("ds", f"has no {needed} along one axis: record: {{exponent: true}} gives it")
    (dim,) = dims
    along = [str(name) for name, coordinate in ds.coords.items() if coordinate.dims == (dim,)]
    name = resolve("x", x, along) if x else next(iter([*along, dim]))
    return Axis.of(ds[name], ds)


def _finish(ax: Axes, axis: Axis, label: str) -> None:
    axis.apply(ax.set_xscale, ax.xaxis)
    edges = axis.edges
    ax.set_xlim(edges[0], edges[-1])
    label_axes(ax, axis.label, label)
