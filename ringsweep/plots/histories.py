"""Histories of single runs over time."""

from __future__ import annotations

from typing import Any

import numpy as np
import xarray as xr
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.colors import BoundaryNorm, ListedColormap
from matplotlib.figure import Figure, SubFigure
from matplotlib.patches import Patch
from numpy.typing import NDArray

from ringsweep.errors import InputError
from ringsweep.plots.style import (
    LAW_COLOURS,
    LAW_STYLES,
    PAIR_COLOURS,
    PAIR_STYLES,
    REST,
    SMALL,
    STICK,
    arc_colour,
    arc_names,
    axes_or_current,
    beside,
    known,
    label_of,
    long_name,
    runs,
    units_of,
)

# Fraction of a run that the detail of its start shows, before which what happens can count as part of the
# start, and fraction of the force that counts as a difference.
_DETAIL = 0.02

_LATEST = 0.1

_APART = 0.05

# Columns into which a history is condensed: finer than the pixels of a printed panel.
_COLUMNS = 4000

# Quantities that share a panel.
TOGETHER = (("omega", "ring_omega"), ("normal_1", "normal_2"))


def history(ds: xr.Dataset) -> Figure:
    """Draw the time history of one run, or of one under each of several friction laws: the paper's panels.

    For a ring these are angle, angular velocity, angular acceleration and normal reactions, above a strip
    that shows which arc lies under each contact; for a belt displacement, velocity and friction force, and for laws
    with bristles the force just after the start. Stick is shaded. Of several laws each is a line, and neither arcs
    nor stick are shown; where their forces differ at the start a last panel goes on for as long again as that lasts,
    over a logarithmic time if the differences are of more than one scale.

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

    Examples
    --------
    >>> import numpy as np
    >>> import xarray as xr
    >>> t = np.linspace(0, 10, 50)
    >>> ds = xr.Dataset({name: ("time", np.sin(t)) for name in ("phi", "omega", "epsilon", "normal_1")}, {"time": t})
    >>> len(history(ds).axes)
    4
    """
    ds = _run(ds)
    figure = Figure(figsize=(8.5, 1.9 * sum(_heights(ds)) + 0.8), layout="constrained")
    draw_history(figure, ds)
    return figure


def history_panel(ds: xr.Dataset, var: str = "phi", ax: Axes | None = None) -> Axes:
    """Draw one quantity of a run over time, stick shaded; what belongs together is drawn together.

    With ``omega`` goes the angular velocity of the ring, with a normal reaction that of the other contact. Of several
    friction laws each is a line.

    Parameters
    ----------
    ds : xarray.Dataset
        Result of a simulation.
    var : str
        Variable to draw.
    ax : matplotlib.axes.Axes, optional
        Where to draw; pyplot's current axes unless given. For the legend beside them a figure with
        ``layout="constrained"`` makes room.

    Returns
    -------
    matplotlib.axes.Axes

    Raises
    ------
    InputError
        If the dataset has no dimension ``time``, or no such variable.

    Examples
    --------
    >>> import numpy as np
    >>> import xarray as xr
    >>> from matplotlib.figure import Figure
    >>> t = np.linspace(0, 10, 50)
    >>> ds = xr.Dataset({"phi": ("time", np.sin(t), {"units": "rad"})}, {"time": ("time", t, {"units": "s"})})
    >>> history_panel(ds, "phi", Figure().add_subplot()).get_xlabel()
    'time (s)'
    """
    ds = _run(ds)
    var = known("var", var, [name for name, data in ds.items() if "time" in data.dims])
    ax = axes_or_current(ax, (7.6, 2.6))
    if "friction_law" in ds.dims:
        _draw_laws(ax, ds, [var])
        beside(ax, handlelength=4)
    else:
        together = next((pair for pair in TOGETHER if var in pair), (var,))
        draw_panel(ax, ds, [name for name in together if name in ds], told=True)
    ax.set_xlabel(label_of(ds["time"], ds))
    return ax


def draw_history(figure: Figure | SubFigure, ds: xr.Dataset) -> None:
    """Fill a figure, or a part of one, with the panels of :func:`history`."""
    ds = _run(ds)
    compared = "friction_law" in ds.dims
    panels = _panels(ds)
    zones = _zones(ds)
    detail = _start(ds)
    time = ds["time"].values
    heights = _heights(ds)
    axes = list(figure.subplots(len(heights), 1, gridspec_kw={"height_ratios": heights}))
    timed = axes[:-1] if detail else axes
    for ax in timed[1:]:
        ax.sharex(timed[0])
    for ax in timed[:-1]:
        ax.tick_params(labelbottom=False)
    draw = _draw_laws if compared else draw_panel
    for ax, names in zip(axes, panels, strict=False):
        draw(ax, ds, names)
    if zones:
        _draw_zones(axes[-1], ds, zones)
    if detail:
        first, last = detail
        start = ds.isel(time=slice(0, max(20, int(np.searchsorted(time, time[0] + 2.0 * last)))))
        draw(axes[-1], start, ["friction_force"])
        if 0.0 < first < 0.05 * last:
            axes[-1].set_xscale("log")
            axes[-1].set_xlim(left=first / 20.0)
        axes[-1].set_title("friction force just after the start", fontsize=SMALL, loc="left")
        timed[-1].set_xlabel(label_of(ds["time"], ds))
    if time[-1] > time[0]:
        timed[0].set_xlim(time[0], time[-1])
    axes[-1].set_xlabel(label_of(ds["time"], ds))
    figure.align_ylabels(axes)
    if compared:
        lines = axes[0].get_legend_handles_labels()
        look: dict[str, Any] = {"fontsize": SMALL, "frameon": False, "handlelength": 4}
        figure.legend(*lines, loc="outside upper center", ncols=4 if len(lines[0]) == 4 else 3, **look)
    elif outcome := ds.attrs.get("outcome"):
        figure.suptitle(str(outcome), fontsize=11)


def _run(ds: xr.Dataset) -> xr.Dataset:
    if "time" not in ds.dims or not ds.sizes["time"]:
        raise InputError("ds", "has no dimension time: it is not the history of a run; draw a sweep with regime_map")
    return ds.isel(friction_law=0) if ds.sizes.get("friction_law") == 1 else ds


def _panels(ds: xr.Dataset) -> list[list[str]]:
    """Quantities of each panel."""
    if "phi" not in ds:
        return [["x"], ["velocity"], ["friction_force"]]
    if "friction_law" in ds.dims:
        return [[name] for name in ("phi", "omega", "epsilon", "normal_1", "normal_2") if name in ds]
    panels: list[tuple[str, ...]] = [("phi",), TOGETHER[0], ("epsilon",), TOGETHER[1]]
    return [[name for name in panel if name in ds] for panel in panels]


def _zones(ds: xr.Dataset) -> list[str]:
    return [] if "friction_law" in ds.dims else [name for name in ("zone_1", "zone_2") if name in ds]


def _heights(ds: xr.Dataset) -> list[float]:
    """Of all panels, the detail of a belt's start and the strip of a ring's arcs among them."""
    zones = len(_zones(ds))
    return [1.0] * (len(_panels(ds)) + (_start(ds) is not None)) + [0.13 * zones] * bool(zones)


def _start(ds: xr.Dataset) -> tuple[float, float] | None:
    """When what a belt's start has of its own begins and ends: the bending of bristles, or how several laws differ."""
    if "phi" in ds:
        return None
    if "friction_law" in ds.dims:
        return _transients(ds)
    return (0.0, _DETAIL / 2 * float(np.ptp(ds["time"].values))) if "deflection" in ds else None


def draw_panel(axes: Axes, ds: xr.Dataset, names: list[str], told: bool = False) -> None:
    """Draw quantities of one run in one panel; the first of several tells what the shading is, others if `told`."""
    time = ds["time"].values
    # One panel explains the shading for all.
    first = told or names[0] in ("phi", "x")
    if "mode" in ds:
        at, mode = _sampled(time, ds["mode"].values)
        spans = [(at[i], at[j] - at[i]) for i, j in runs(mode == 0)]
        axes.broken_barh(
            spans,
            (0, 1),
            transform=axes.get_xaxis_transform(),
            color=STICK,
            linewidth=0,
            label="stick" if first and spans else None,
        )
    labels = {"omega": "body", "ring_omega": "ring", "normal_1": "contact 1", "normal_2": "contact 2"}
    for name, colour, style in zip(names, PAIR_COLOURS, PAIR_STYLES, strict=False):
        axes.plot(*envelope(time, ds[name].values), color=colour, linestyle=style, linewidth=1, label=labels.get(name))
    beside(axes)
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
            *envelope(ds["time"].values, numbers[k]),
            color=LAW_COLOURS[k % len(LAW_COLOURS)],
            linestyle=LAW_STYLES[k % len(LAW_STYLES)],
            # Of lines that coincide the earlier are seen on both sides of the later.
            linewidth=max(1.2, 3.0 - 0.6 * k),
            label=f"{law}: {_regime(ds, k)}" if "regime" in ds else str(law),
        )
    axes.set_ylabel(_symbol(ds, names))
    axes.margins(x=0)
    if name.startswith("normal"):
        axes.set_title(f"contact {name[-1]}", fontsize=SMALL, loc="left")
    if name in ("epsilon", "friction_force"):
        _clip(axes, numbers)


def _regime(ds: xr.Dataset, k: int) -> str:
    """Regime under the friction law at place `k`, in words."""
    flags = np.atleast_1d(ds["regime"].attrs["flag_values"]).tolist()
    meanings = str(ds["regime"].attrs["flag_meanings"]).split()
    return meanings[flags.index(int(ds["regime"][k]))]


def _transients(ds: xr.Dataset) -> tuple[float, float] | None:
    """When the first and the last of the differences at the start of runs under several friction laws are over.

    None if there are no such differences.

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
    return (float(ends[0]), float(ends[-1])) if len(ends) else None


def _draw_zones(axes: Axes, ds: xr.Dataset, zones: list[str]) -> None:
    rows = []
    for name in zones:
        at, row = _sampled(ds["time"].values, ds[name].values)
        rows.append(row)
    strip = np.array(rows)
    arcs = int(max(1, strip.max()))
    colours = [REST, *(arc_colour(k + 1) for k in range(arcs))]
    norm = BoundaryNorm(np.arange(arcs + 2) - 0.5, arcs + 1)
    axes.pcolormesh(at, np.arange(len(zones) + 1), strip, cmap=ListedColormap(colours), norm=norm, rasterized=True)
    axes.hlines(range(1, len(zones)), at[0], at[-1], color="white", linewidth=2)
    axes.set_yticks(np.arange(len(zones)) + 0.5, labels=[f"contact {name[-1]}" for name in zones], fontsize=SMALL)
    axes.tick_params(axis="y", length=0)
    axes.invert_yaxis()
    names = ["elsewhere", *arc_names(arcs)]
    handles: list[Artist] = [Patch(facecolor=c, edgecolor="0.7", label=n) for c, n in zip(colours, names, strict=True)]
    beside(axes, handles, bbox_to_anchor=(1.0, 1.2))


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
            f"axis clipped; values from {finite.min():.3g} to {finite.max():.3g}", fontsize=SMALL, loc="right"
        )


def envelope(time: NDArray[Any], numbers: NDArray[Any]) -> tuple[NDArray[Any], NDArray[Any]]:
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
    name, units = short.get(names[0], long_name(ds[names[0]])), units_of(ds[names[0]], "rad")
    return f"{name}\n({units})" if units else name
