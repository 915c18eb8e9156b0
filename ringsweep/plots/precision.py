"""Work-precision diagrams: error against run time of several methods."""

from __future__ import annotations

from typing import Any

import numpy as np
import xarray as xr
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch

from ringsweep.errors import InputError
from ringsweep.plots import look
from ringsweep.plots.datasets import resolve
from ringsweep.plots.labels import axis_label, number_text

# Error above which a run has diverged: no axis need reach beyond it.
_DIVERGED = 1e3

# Own methods, which look the same in every picture.
_OWN = ("implicit", "event", "rk4")

# One colour is one method. The number of markers and the number of colours have no common factor, so a pair of the two
# returns only after 143 methods.
_METHOD_COLOURS = (*look.CURVE_COLOURS, "#882255", "#999933", "#332288", "#7F7F7F", "#661100", "#44AA99")
_METHOD_MARKERS = ("o", "s", "^", "D", "v", "P", "<", "p", ">", "h", "*")


def work_precision(ds: xr.Dataset, error: str = "error_end") -> Figure:
    """Draw error against run time, a curve for each method, as a new figure; see :func:`precision_panel`.

    Parameters
    ----------
    ds : xarray.Dataset
        Result of :func:`ringsweep.precision`.
    error : str
        Variable to draw.

    Returns
    -------
    matplotlib.figure.Figure

    Raises
    ------
    InputError
        If the dataset is of another kind, or `error` is unknown or has no value in any cell.

    Examples
    --------
    >>> import xarray as xr
    >>> work_precision(xr.Dataset())
    Traceback (most recent call last):
    ringsweep.errors.InputError: ds: has no contender, cell, time_per_run, method: it is not error against run time
    """
    width = look.figure_width()
    figure = look.picture(width, (1.15 if look.is_narrow(width) else 0.63) * width)
    precision_panel(ds, error, figure.add_subplot())
    return figure


def precision_panel(ds: xr.Dataset, error: str = "error_end", ax: Axes | None = None) -> Axes:
    """Draw error against run time, a curve for each method.

    A point shows the median over the cells; a bar goes up to the largest error. A point is hollow if the regime of
    some cell is wrong. A median of zero lies on a floor below all other points. An infinite median, of runs that
    failed, lies on a ceiling above them, and so does an error above 1000, of runs that diverged. Arrows mark floor and
    ceiling.

    Parameters
    ----------
    ds : xarray.Dataset
        Dimensions ``contender`` and ``cell``, variables ``time_per_run`` (s) and `error`, coordinate ``method``.
        A line joins the points of a method in the order of the dataset. If the dataset has them, as that of
        :func:`ringsweep.precision` does, the picture also shows the target, the recommended setting and the
        uncertainty of the reference.
    error : str
        Variable to draw. NaN means that a cell has no such error.
    ax : matplotlib.axes.Axes, optional
        Axes to draw in, by default pyplot's current ones. The legend stands outside them: a figure with
        ``layout="constrained"`` makes room for it.

    Returns
    -------
    matplotlib.axes.Axes

    Raises
    ------
    InputError
        If the dataset is of another kind, or `error` is unknown or has no value in any cell.

    Examples
    --------
    >>> import xarray as xr
    >>> from matplotlib.figure import Figure
    >>> ds = xr.Dataset(
    ...     {
    ...         "time_per_run": ("contender", [1e-4, 1e-3], {"units": "s"}),
    ...         "error_end": (("contender", "cell"), [[1e-3, 2e-3], [1e-6, 1e-6]], {"units": "rad"}),
    ...     },
    ...     coords={"method": ("contender", ["rk4", "rk4"])},
    ... )
    >>> precision_panel(ds, ax=Figure().add_subplot()).get_ylabel()
    'error_end (rad)'
    """
    lacking = [name for name in ("contender", "cell") if name not in ds.dims]
    lacking += [name for name in ("time_per_run", "method") if name not in ds.variables]
    if lacking:
        raise InputError("ds", f"has no {', '.join(lacking)}: it is not error against run time")
    error = resolve("error", error, [name for name, data in ds.items() if set(data.dims) == {"contender", "cell"}])
    numbers = ds[error].transpose("contender", "cell").values.astype(float)
    rows = np.flatnonzero(~np.isnan(numbers).all(axis=1))
    positive = numbers[np.isfinite(numbers) & (numbers > 0.0)]
    if not len(rows):
        raise InputError("error", f"{error} has no value in any cell")
    seconds, methods = ds["time_per_run"].values, ds["method"].values
    median, largest = np.full((2, len(numbers)), np.nan)
    median[rows], largest[rows] = np.nanmedian(numbers[rows], axis=1), np.nanmax(numbers[rows], axis=1)
    floor, ceiling = (positive.min() / 10.0, positive.max() * 10.0) if len(positive) else (1e-17, 1.0)
    if ceiling > _DIVERGED > 10.0 * floor:
        ceiling = _DIVERGED
    # Infinite, or beyond the ceiling.
    diverged = median > ceiling
    low, high = np.clip(median, floor, ceiling), np.clip(largest, floor, ceiling)
    wrong = (ds["regime_wrong"] == 1).any("cell").values if "regime_wrong" in ds else np.zeros(len(numbers), bool)

    ax = look.axes_or_current(ax, 0.63)
    ax.set_xscale("log")
    ax.set_yscale("log")
    ax.grid(True, color=look.on_page(look.GRID), linewidth=0.6)
    ax.set_axisbelow(True)
    curves: list[Artist] = []
    entries: list[Artist] = []
    if f"reference_{error}" in ds and (uncertainty := np.nanmedian(ds[f"reference_{error}"])) > 0.0:
        ax.axhspan(0.0, uncertainty, color=look.on_page("#EEEEEE"), linewidth=0)
        entries.append(Patch(color=look.on_page("#EEEEEE"), label="within the median\nuncertainty of the reference"))
    if target := ds.attrs.get("target"):
        dashed: dict[str, Any] = {"color": look.on_page("0.25"), "linewidth": 1, "linestyle": (0, (5, 3))}
        ax.axhline(target, **dashed)
        entries.append(Line2D([], [], **dashed, label=f"target, {number_text(target)}"))
    drawn = dict.fromkeys(methods[rows].tolist())
    # The attribute names the methods of all pictures that are compared, so a method looks the same in each of them.
    numbered = list(dict.fromkeys([*_OWN, *ds.attrs.get("methods", ()), *drawn]))
    for method in drawn:
        own = rows[methods[rows] == method]
        style = _method_style(numbered.index(method))
        bars = {"linestyle": "", "color": style["color"], "alpha": 0.45, "elinewidth": 1, "capsize": 2.5}
        ax.errorbar(seconds[own], low[own], yerr=[np.zeros(len(own)), high[own] - low[own]], **bars)
        curves += ax.plot(seconds[own], low[own], label=str(method), **style)
        hollow = own[wrong[own]]
        ax.plot(seconds[hollow], low[hollow], **style | {"linestyle": "", "markerfacecolor": look.page_colour()})
    if wrong[rows].any():
        circle: dict[str, Any] = {"color": look.on_page("0.4"), "linestyle": "", "marker": "o"}
        circle["markerfacecolor"] = look.page_colour()
        entries.append(Line2D([], [], label="hollow: a regime\nis wrong in some cell", **circle))
    failure = "failed" + " or diverged" * bool(np.isfinite(median[diverged]).any()) + " (at the ceiling)"
    for height, where, arrow, meaning in (
        (0.6 * floor, median[rows] <= 0.0, "$\\downarrow$", "no error (at the floor)"),
        (1.7 * ceiling, diverged[rows], "$\\uparrow$", failure),
    ):
        if where.any():
            arrows: dict[str, Any] = {"color": look.on_page("black"), "marker": arrow, "linestyle": "", "markersize": 8}
            ax.plot(seconds[rows[where]], np.full(where.sum(), height), **arrows)
            entries.append(Line2D([], [], label=meaning, **arrows))
    if "recommended" in ds.attrs and "solver" in ds.coords:
        (chosen,) = np.flatnonzero(ds["solver"].values == ds.attrs["recommended"])[:1]
        circle = {"color": look.on_page("black"), "marker": "o", "markerfacecolor": "none", "linestyle": ""}
        ax.plot(seconds[chosen], low[chosen], markersize=13, markeredgewidth=1.4, **circle)
        meaning = "recommended:\n" + str(ds.attrs["recommended"]).replace("method: ", "")
        entries.append(Line2D([], [], markersize=9, label=meaning, **circle))
    cells = ds.sizes["cell"]
    if cells > 1:
        text = f"points: median of {cells} cells; bars: up to the largest"
        ax.set_title(look.folded([text], look.width_of(ax)), fontsize=look.SMALL, loc="left")
    # A target is given in rad, so errors of angles are too.
    look.label_axes(ax, axis_label(ds["time_per_run"], ds), axis_label(ds[error], ds).replace("(°)", "(rad)"))
    look.place_legend(ax, [*curves, *entries], handlelength=3)
    return ax


def _method_style(number: int) -> dict[str, Any]:
    """Line and marker of a method; `number` counts from 0."""
    return {
        "color": look.on_page(_METHOD_COLOURS[number % len(_METHOD_COLOURS)]),
        "marker": _METHOD_MARKERS[number % len(_METHOD_MARKERS)],
        "markersize": 5.5,
        "linestyle": look.CURVE_STYLES[number // len(_METHOD_COLOURS) % len(look.CURVE_STYLES)],
        "linewidth": 1.3,
    }
