"""Pictures of sections: bifurcation diagrams, the points of one motion, multipliers and exponents along an axis."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
import xarray as xr
from matplotlib import colors, lines, patches, rcParams, ticker, transforms
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import NDArray

from ringsweep.errors import InputError
from ringsweep.plots import look
from ringsweep.plots.datasets import resolve, scene_text
from ringsweep.plots.labels import display_factor, unit_text
from ringsweep.plots.map_axes import Axis
from ringsweep.plots.selection import select
from ringsweep.quantities.variables import POINTS, words

# Their full names would take half of a narrow picture.
_SHORT = {"x_section": "x", "velocity_section": "velocity", "deflection_section": "deflection"}
_SHORT |= {"contact_age_section": "age"}
_SHORT |= {"phi_section": r"$\varphi$", "omega_section": r"$\omega$"}
_SHORT |= {f"deflection_{k}_section": f"deflection {k}" for k in (1, 2)}

# Points of the diagram, in points of a page squared, and the height of the strip of regimes as a share of the axes.
_DOT, _STRIP = 1.0, 0.025

# Heights of diagram, exponent, multipliers and unit circle, as multiples of the width.
_HEIGHTS = {"diagram": 0.5, "lyapunov": 0.25, "multiplier_1": 0.25, "circle": 0.75}

_DIRECTION = "direction"


def points_of(ds: xr.Dataset) -> list[str]:
    """Variables of the points of a section, place and velocity first; none without a section."""
    return [name for name in POINTS if name in ds]


def axes_of(ds: xr.Dataset, name: str) -> list[str]:
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
    axis = _axis(ds, x)
    below = {name: draw for name, draw in _BELOW.items() if name in ds and bool(np.isfinite(ds[name]).any())}
    heights = [_HEIGHTS[name] for name in ("diagram", *below)]
    width = look.figure_width()
    figure = look.picture(width, sum(heights) * width + 0.6)
    panels = figure.subplots(len(heights), 1, sharex=True, squeeze=False, height_ratios=heights)[:, 0]
    bifurcation_panel(ds, x, var, panels[0])
    for draw, ax in zip(below.values(), panels[1:], strict=True):
        # The diagram has the key to the directions.
        look.legend_above(ax, draw(ax, axis, ds))
    for ax in panels[:-1]:
        ax.set_xlabel("")
        ax.tick_params(labelbottom=False, which="both")
    if text := look.folded([*scene_text(ds), *held], width):
        figure.suptitle(text, fontsize=look.SMALL)
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
    ax = look.axes_or_current(ax, _HEIGHTS["diagram"])
    branches = _branches(ds)
    # Where both branches are the same, the second one must not hide the first: it has smaller points.
    for k, (_, branch) in enumerate(branches):
        points = axis.along(branch[name]) * display_factor(ds[name])
        size = _DOT * (2.5 if k == 0 and len(branches) > 1 else 1.0)
        _scatter(ax, np.repeat(axis.values, points.shape[1]), points.ravel(), s=size, color=look.pair(k), zorder=2 + k)
    regimes = _strips(ax, axis, ds) if "regime" in ds else []
    _finish(ax, axis, _label(ds, name))
    look.legend_above(ax, [*_directions(ds), *regimes])
    return ax


def _strips(ax: Axes, axis: Axis, ds: xr.Dataset) -> list[Artist]:
    """Draw the regimes as a strip at the upper edge for each direction, the first at the top; entries of a legend."""
    found: dict[str, Artist] = {}
    across = transforms.blended_transform_factory(ax.transData, ax.transAxes)
    edges, branches = axis.edges, _branches(ds)
    for k, (_, branch) in enumerate(branches, start=1):
        regime = axis.along(words(branch["regime"])).astype(str)
        for word in dict.fromkeys(regime.tolist()):
            colour = look.on_page(look.REGIME_COLOURS.get(word, look.NO_VALUE))
            spans = [(edges[a], edges[b] - edges[a]) for a, b in look.true_ranges(regime == word)]
            strip = (1.0 - k * _STRIP, _STRIP)
            ax.broken_barh(spans, strip, transform=across, facecolors=colour, linewidth=0, zorder=5)
            found.setdefault(word, patches.Patch(color=colour, label=word))
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
    ax = look.axes_or_current(ax, 0.75)
    x, velocity = (ds[name].values * display_factor(ds[name]) for name in (place, speed))
    kept = np.isfinite(x) & np.isfinite(velocity)
    order = np.arange(1, kept.sum() + 1)
    drawn = _scatter(ax, x[kept], velocity[kept], c=order, s=8.0, cmap="viridis")
    look.label_axes(ax, _label(ds, place), _label(ds, speed))
    if len(order) > 1:
        look.colour_bar(drawn, [ax], "point, in time", ticker.MaxNLocator(6, integer=True))
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
    ax = look.axes_or_current(ax, _HEIGHTS["lyapunov"])
    look.legend_above(ax, [*_directions(ds), *_draw_exponents(ax, axis, ds)])
    return ax


def _draw_exponents(ax: Axes, axis: Axis, ds: xr.Dataset) -> list[Artist]:
    """Draw exponents; no entries of a legend."""
    ax.axhline(0.0, color=rcParams["axes.edgecolor"], linewidth=0.8, zorder=1)
    for k, (_, branch) in enumerate(_branches(ds)):
        value = axis.along(branch["lyapunov"])
        finite = np.where(np.isfinite(value), value, np.nan)
        ax.plot(axis.values, finite, ".-", color=look.pair(k), markersize=2, linewidth=0.8)
        if "lyapunov_error" in branch:
            error = axis.along(branch["lyapunov_error"])
            look.band(ax, axis.values, finite - error, finite + error, look.pair(k))
        erased = axis.values[np.isneginf(value)]
        edge = transforms.blended_transform_factory(ax.transData, ax.transAxes)
        ax.plot(erased, np.full(len(erased), 0.03), "v", transform=edge, color=look.pair(k), markersize=2)
    _finish(ax, axis, "exponent (s$^{-1}$)")
    return []


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
    ax = look.axes_or_current(ax, _HEIGHTS["multiplier_1"])
    look.legend_above(ax, [*_directions(ds), *_draw_multipliers(ax, axis, ds)])
    return ax


def _draw_multipliers(ax: Axes, axis: Axis, ds: xr.Dataset) -> list[Artist]:
    """Draw magnitudes of multipliers; returns the entries of a legend for the larger and the smaller one."""
    ax.axhspan(0.0, 1.0, color=look.on_page(look.STICK), linewidth=0, zorder=0)
    marks = {name: mark for name, mark in (("multiplier_1", "."), ("multiplier_2", "x")) if name in ds}
    for k, (_, branch) in enumerate(_branches(ds)):
        for name, mark in marks.items():
            ax.plot(axis.values, axis.along(branch[name]), mark, color=look.pair(k), markersize=2.5)
    ax.set_ylim(0.0, max(1.1, ax.get_ylim()[1]))
    _finish(ax, axis, "multipliers")
    return [_dot(mark, text) for mark, text in zip(marks.values(), ("larger one", "smaller one"), strict=False)]


_BELOW = {"lyapunov": _draw_exponents, "multiplier_1": _draw_multipliers}


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
    ax = look.axes_or_current(ax, _HEIGHTS["circle"])
    turn, frame = np.linspace(0.0, 2.0 * np.pi, 181), rcParams["axes.edgecolor"]
    ax.fill(np.cos(turn), np.sin(turn), color=look.on_page(look.STICK), linewidth=0, zorder=0)
    ax.plot(np.cos(turn), np.sin(turn), color=frame, linewidth=0.8, zorder=1)
    for centred in (ax.axhline, ax.axvline):
        centred(0.0, color=frame, linewidth=0.4, zorder=1)
    norm = (colors.LogNorm if axis.scale == "log" else colors.Normalize)(axis.edges[0], axis.edges[-1])
    reach = 1.1
    for k, (_, branch) in enumerate(_branches(ds)):
        for angle in (name for name in ("multiplier_angle_1", "multiplier_angle_2") if name in branch):
            value = axis.along(branch[angle.replace("_angle", "")]) * np.exp(1j * axis.along(branch[angle]))
            reach = max(reach, 1.1 * np.abs(value[np.isfinite(value)]).max(initial=0.0))
            colours = {"c": axis.values, "cmap": "viridis", "norm": norm}
            drawn = _scatter(ax, value.real, value.imag, s=10.0, marker="o^"[k], zorder=2 + k, **colours)
    ax.set(xlim=(-reach, reach), ylim=(-reach, reach), aspect="equal")
    look.label_axes(ax, "real part of the multipliers", "imaginary part")
    bar = look.colour_bar(drawn, [ax], axis.label)
    if axis.names:
        bar.set_ticks(range(len(axis.names)), labels=axis.names)
    look.legend_above(ax, _directions(ds, "o^"))
    return ax


def _scatter(ax: Axes, x: NDArray[Any], y: NDArray[Any], **style: Any) -> Any:
    """Draw points, which are a picture in vector formats: there may be very many."""
    return ax.scatter(x, y, linewidths=0, rasterized=True, **style)


def _dot(marker: str, label: str, colour: Any = None) -> lines.Line2D:
    """Entry of a legend for points."""
    colour = rcParams["text.color"] if colour is None else colour
    return lines.Line2D([], [], linestyle="", marker=marker, markersize=4, color=colour, label=label)


def _directions(ds: xr.Dataset, markers: str = "") -> list[Artist]:
    """Entries of a legend for the directions, which differ by their colours, or by these markers."""
    ways = [way for way, _ in _branches(ds) if way]
    return [_dot(markers[k], way) if markers else _dot("o", way, look.pair(k)) for k, way in enumerate(ways)]


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


def _axis(ds: xr.Dataset, x: str | None, needed: str | None = None) -> Axis:
    """The axis of a diagram."""
    if needed is None:
        _require_section(ds)
    dims = axes_of(ds, needed or points_of(ds)[0])
    if len(dims) != 1:
        problem = f"sections along {', '.join(dims) or 'no axis'}, and a diagram has one axis: hold the others by sel"
        if needed is not None:
            problem = f"no {needed} along one axis: record: {{exponent: true}} gives it"
        raise InputError("ds", f"has {problem}")
    (dim,) = dims
    along = [str(name) for name, coordinate in ds.coords.items() if coordinate.dims == (dim,)]
    name = resolve("x", x, along) if x else next(iter([*along, dim]))
    return Axis.of(ds[name], ds)


def _finish(ax: Axes, axis: Axis, label: str) -> None:
    look.small_ticks(ax)
    axis.apply(ax.set_xscale, ax.xaxis)
    edges = axis.edges
    ax.set_xlim(edges[0], edges[-1])
    look.label_axes(ax, axis.label, label)
