"""Error against run time."""

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
from ringsweep.plots.style import LAW_COLOURS, LAW_STYLES, SMALL, axes_or_current, beside, known, label_of

# Methods, whose curves cross: told apart by marker as well. Lengths without a common factor, as above.
_METHOD_MARKERS = ("o", "s", "^", "D", "v", "P", "<", "p", ">", "h", "*")

_SIZE = (7.6, 4.8)


def work_precision(ds: xr.Dataset, error: str = "error_end") -> Figure:
    """Draw error against run time, a curve for each method, as a figure of its own; see :func:`precision_panel`.

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
        If the dataset is of another kind, or `error` is unknown, or a number in no cell.

    Examples
    --------
    >>> import xarray as xr
    >>> work_precision(xr.Dataset())
    Traceback (most recent call last):
    ringsweep.errors.InputError: ds: has no contender, cell, time_per_run, method: it is not error against run time
    """
    figure = Figure(figsize=_SIZE, layout="constrained")
    precision_panel(ds, error, figure.add_subplot())
    return figure


def precision_panel(ds: xr.Dataset, error: str = "error_end", ax: Axes | None = None) -> Axes:
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
        Where to draw; pyplot's current axes unless given. For the legend beside them a figure with
        ``layout="constrained"`` makes room.

    Returns
    -------
    matplotlib.axes.Axes

    Raises
    ------
    InputError
        If the dataset is of another kind, or `error` is unknown, or a number in no cell.

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
    error = known("error", error, [name for name, data in ds.items() if set(data.dims) == {"contender", "cell"}])
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

    ax = axes_or_current(ax, _SIZE)
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
    present = dict.fromkeys(methods[rows].tolist())
    # Pictures that are compared name all their methods, so that each looks the same in all of them.
    family = list(dict.fromkeys([*ds.attrs.get("methods", ()), *present]))
    for method in present:
        k = family.index(method)
        own = rows[methods[rows] == method]
        colour = LAW_COLOURS[k % len(LAW_COLOURS)]
        style: dict[str, Any] = {
            "color": colour,
            "marker": _METHOD_MARKERS[k % len(_METHOD_MARKERS)],
            "markersize": 5.5,
        }
        style |= {"linestyle": LAW_STYLES[k // len(LAW_COLOURS) % len(LAW_STYLES)], "linewidth": 1.3}
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
        ax.set_title(f"points: median of {cells} cells; bars: up to the largest", fontsize=SMALL, loc="left")
    ax.set_xlabel(label_of(ds["time_per_run"], ds))
    ax.set_ylabel(label_of(ds[error], ds))
    beside(ax, [*curves, *entries], handlelength=3)
    return ax
