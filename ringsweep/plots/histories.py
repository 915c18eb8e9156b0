"""Time histories of runs."""

from __future__ import annotations

import math
from itertools import chain
from typing import Any, Literal

import numpy as np
import xarray as xr
from matplotlib import colors, patches, rcParams
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import NDArray

from ringsweep.plots import datasets, look
from ringsweep.plots.labels import axis_label, displayed, label_axis, long_name, number_text, unit_text
from ringsweep.quantities.flags import JAMMED, SEPARATING
from ringsweep.quantities.variables import words

# Panels in which a few outliers must not flatten the rest.
_CLIPPED = ("epsilon", "friction_force")

# Impact speeds below this share of the greatest are not shown: the last rebounds of a contact are endless.
_WEAKEST = 1e-4

# Cycles from which on a printed curve is a block; cycles that are then drawn beside it; and steps of its envelope.
_MANY_CYCLES, _LAST_CYCLES, _STEPS = 40, 5, 200

_SHORT_NAMES = {
    "phi": "angle",
    "omega": "angular velocity",
    "epsilon": "angular\nacceleration",
    "normal_1": "normal reaction",
    "normal_2": "normal reaction",
    "gap_1": "gap",
    "gap_2": "gap",
    "impact_speed": "impact speed",
    "x": "displacement",
    "velocity": "velocity",
    "friction_force": "friction force",
}

_LEGEND = {"omega": "body", "ring_omega": "ring", "velocity": "body", "belt_velocity": "belt"}
_LEGEND |= {f"{name}_{k}": f"contact {k}" for name in ("normal", "gap") for k in (1, 2)}
_OF_MASSES = {f"{name}_{k}": f"mass {k}" for name in ("x", "velocity", "friction_force") for k in (1, 2)}
_SHORT_NAMES |= {name: _SHORT_NAMES[name[:-2]] for name in _OF_MASSES}
_LEGEND |= _OF_MASSES


def history(ds: xr.Dataset) -> Figure:
    """Draw the time history of one run, or of a run under each of several friction laws.

    The panels are those of the paper. For a ring they show angle, angular velocity, angular acceleration and normal
    reactions, with a mark where a contact separates; a strip below shows which zone lies under each contact. If the run
    goes on after that, panels below show the gaps and, as marks, the speeds of impacts. For a belt the panels show
    displacement, velocity and friction force. Times at which the body sticks, or a contact is open, are shaded. Of a
    run with more than 40 cycles the panels show the band from the least to the greatest value in each of them or of a
    few, and beside it the last five cycles with their shading.

    Several friction laws are a line each, without strip and shading.

    Parameters
    ----------
    ds : xarray.Dataset
        Result of :func:`ringsweep.simulate`.

    Returns
    -------
    matplotlib.figure.Figure

    Raises
    ------
    InputError
        If the dataset has no dimension ``time``, or no variable of any panel.

    Examples
    --------
    >>> import numpy as np
    >>> import xarray as xr
    >>> t = np.linspace(0, 10, 50)
    >>> ds = xr.Dataset({name: ("time", np.sin(t)) for name in ("phi", "omega", "epsilon", "normal_1")}, {"time": t})
    >>> len(history(ds).axes)
    4
    """
    ds = datasets.require_history(ds)
    panels, strip, several = datasets.panels_of(ds), datasets.zones(ds), datasets.compares_laws(ds)
    cycles = _cycles(ds)
    many = len(cycles) > _MANY_CYCLES
    heights = [1.0] * len(panels) + [0.13 * len(strip)] * bool(strip)
    width = look.figure_width()
    # Panels must be as high as their labels.
    height = min(max(0.2 * width, 13.5 * rcParams["font.size"] / 100.0), 1.9)
    figure = look.picture(width, height * sum(heights) + 0.8)
    grid = figure.subplots(len(heights), 1 + many, sharex="col", squeeze=False, height_ratios=heights)
    whole = list(grid[:, 0])
    for ax, names in zip(whole, panels, strict=False):
        if several:
            _draw_laws(ax, ds, names)
        else:
            draw_panel(ax, ds, names, band=cycles if many else None)
    if strip:
        _draw_zones(whole[-1], ds, strip)
    whole[-1].set_xlabel(axis_label(ds["time"], ds))
    first, last = time_limits(ds)
    if last > first:
        whole[0].set_xlim(first, last)
    if many:
        late = ds.isel(time=slice(cycles[-_LAST_CYCLES - 1], None))
        _draw_late(list(grid[:, 1]), late, panels, strip, whole)
    figure.align_ylabels(whole)
    if several:
        lines = list(whole[0].get_legend_handles_labels()[0])
        columns = look.columns_of(lines, width - look.MARGIN)
        figure.legend(handles=lines, loc="outside upper center", ncols=columns, handlelength=4, **look.LEGEND)
    elif texts := list(filter(None, [*datasets.outcome(ds).splitlines(), "; ".join(datasets.scene_text(ds))])):
        figure.suptitle("\n".join(look.folded([text], width) for text in texts), fontsize="medium")
    return figure


def history_panel(ds: xr.Dataset, var: str = "phi", ax: Axes | None = None) -> Axes:
    """Draw one quantity of a run over time; times at which the body sticks, or a contact is open, are shaded.

    The panel of ``omega`` also shows the angular velocity of the ring, and the panel of a normal reaction also shows
    that of the other contact. Several friction laws are a line each.

    Parameters
    ----------
    ds : xarray.Dataset
        Result of :func:`ringsweep.simulate`.
    var : str
        Variable to draw.
    ax : matplotlib.axes.Axes, optional
        Axes to draw in, by default pyplot's current ones. The legend stands above them: a figure with
        ``layout="constrained"`` makes room for it.

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
    ds = datasets.require_history(ds)
    var = datasets.resolve("var", var, [name for name, data in ds.items() if {"time", "impact"} & set(data.dims)])
    ax = look.axes_or_current(ax, 0.34)
    ax.set_xlabel(axis_label(ds["time"], ds))
    if datasets.compares_laws(ds):
        _draw_laws(ax, ds, (var,))
        look.place_legend(ax, list(ax.get_legend_handles_labels()[0]), handlelength=4)
    else:
        names = next((panel for panel in chain(*datasets.PANELS.values()) if var in panel), (var,))
        draw_panel(ax, ds, names, explain=True)
    return ax


def _draw_late(
    panels: list[Axes], late: xr.Dataset, names: list[tuple[str, ...]], strip: list[str], whole: list[Axes]
) -> None:
    """Draw the last cycles beside the panels of the whole run."""
    for ax, beside, own in zip(panels, whole, names, strict=False):
        draw_panel(ax, late, own)
        ax.set(ylim=beside.get_ylim(), ylabel="")
        # The axis beside it says so.
        ax.set_title("", loc="left")
        ax.set_title("", loc="right")
    if strip:
        _draw_zones(panels[-1], late, strip)
        panels[-1].set_yticks([])
    panels[0].set_xlim(*time_limits(late))
    for ax, what in ((whole[-1], "band: least to greatest"), (panels[-1], f"the last {_LAST_CYCLES} cycles")):
        ax.set_xlabel(look.folded([axis_label(late["time"], late), what], look.width_of(whole[-1]) - look.MARGIN))


def draw_panel(axes: Axes, ds: xr.Dataset, names: tuple[str, ...], explain: bool = False, band: Any = None) -> None:
    """Draw quantities of one run in one panel; those that the dataset does not have are left out.

    The legend explains the shading in the panel that shows where the body is, elsewhere if `explain`. With the
    first samples of cycles as `band` the curves are bands from the least to the greatest value, without shading.
    """
    look.small_ticks(axes)
    time, names = ds["time"].values, tuple(datasets.present(ds, names))
    first, explain = names[0], explain or names[0] in datasets.PANELS
    if "mode" in ds and band is None:
        _shade(axes, time, datasets.phases(ds), explain)
    if first == "impact_speed":
        _draw_impacts(axes, ds)
    else:
        for k, name in enumerate(names):
            curve = {"color": look.pair(k), "label": _LEGEND.get(name)}
            numbers = displayed(ds[name]).values
            if band is not None:
                _draw_range(axes, time, numbers, band, **curve)
            else:
                axes.plot(time, numbers, linestyle=look.PAIR_STYLES[k], linewidth=1, **curve)
        _mark_separation(axes, ds, names)
    look.legend_above(axes)
    axes.set_ylabel(_short_label(ds, first))
    if (unit := unit_text(ds[first])) == "m":
        label_axis(axes.yaxis, _SHORT_NAMES.get(first, long_name(ds[first])), unit)
    axes.margins(x=0)
    if first == "impact_speed" or time_limits(ds)[1] > time[-1]:
        axes.set_xlim(*time_limits(ds))
    if first in _CLIPPED:
        clip(axes, time, displayed(ds[first]).values, "left" if explain else "right")


def _cycles(ds: xr.Dataset) -> NDArray[np.intp]:
    """First sample of each cycle of one run: where its velocity rises through the middle of its range."""
    name = next(iter(datasets.present(ds, ("omega", "velocity"))), None)
    if name is None or datasets.compares_laws(ds):
        return np.empty(0, dtype=np.intp)
    numbers = ds[name].values
    low, high = np.nanquantile(numbers, (0.01, 0.99))
    # Noise around the middle is no cycle.
    middle, margin = 0.5 * (low + high), 0.2 * (high - low)
    apart = np.flatnonzero(np.abs(numbers - middle) > margin)
    above = numbers[apart] > middle
    return apart[1:][above[1:] & ~above[:-1]]


def _draw_range(
    axes: Axes, time: NDArray[Any], numbers: NDArray[Any], cycles: NDArray[np.intp], **options: Any
) -> None:
    """Draw the band from the least to the greatest value in every cycle, or in every few of very many."""
    starts = np.append(0, cycles[:: math.ceil(len(cycles) / _STEPS)])
    # The last cycle may be a part of one, whose band would be narrower.
    starts = np.unique(starts[:-1] if len(starts) > 2 else starts)
    low, high = np.fmin.reduceat(numbers, starts), np.fmax.reduceat(numbers, starts)
    edges = np.append(time[starts], time[-1])
    style: dict[str, Any] = {"step": "post", "alpha": 0.45, "linewidth": 0.8}
    axes.fill_between(edges, np.append(low, low[-1]), np.append(high, high[-1]), **style, **options)


def _shade(axes: Axes, time: NDArray[Any], phases: NDArray[Any], explain: bool) -> None:
    """Shade times of stick and of open contacts; the legend may explain the shading."""
    stick = look.on_page(look.STICK)
    shades = ((0, stick, 1.0), (datasets.PIVOT, look.OPEN, 0.18), (datasets.FLIGHT, look.OPEN, 0.45))
    limits = axes.dataLim.frozen()
    for value, colour, alpha in shades:
        ends = time[np.minimum(look.true_ranges(phases == value), len(time) - 1)]
        spans = [(begin, end - begin) for begin, end in ends if end > begin]
        style: dict[str, Any] = {"color": colour, "alpha": alpha}
        style["label"] = datasets.mode_name(value) if explain and spans else None
        axes.broken_barh(spans, (0, 1), transform=axes.get_xaxis_transform(), linewidth=0, **style)
    # Before version 3.11 matplotlib takes the share of the height for data.
    axes.dataLim.set(limits)


def _draw_impacts(axes: Axes, ds: xr.Dataset) -> None:
    """Draw the speed of each impact as a mark."""
    first, last = map(float, ds["time"].values[[0, -1]])
    time, contact, speed = (ds[name].values for name in ("impact_time", "impact_contact", "impact_speed"))
    shown = (first <= time) & (time <= last) & (speed > _WEAKEST * speed.max(initial=0.0))
    colours = [look.pair(0), look.pair(1), look.on_page("black")]
    for which, colour, mark, label in zip((1, 2, 3), colours, "+x*", ("contact 1", "contact 2", "both"), strict=True):
        here = shown & (contact == which)
        if here.any():
            axes.plot(time[here], speed[here], mark, color=colour, markersize=4, label=label)
            axes.set_yscale("log")


def time_limits(ds: xr.Dataset) -> tuple[float, float]:
    """Limits of the time axis of a history, s: with a margin behind an end that comes before the end of the span."""
    first, last = map(float, ds["time"].values[[0, -1]])
    ends = [JAMMED] if "aftermath" in ds else [SEPARATING, JAMMED]
    ends_early = "regime" in ds and bool(ds["regime"].isin(ends).any())
    return first, last + 0.03 * (last - first) * ends_early


def _mark_separation(axes: Axes, ds: xr.Dataset, names: tuple[str, ...]) -> None:
    """Mark where a contact separates first, in the panel of the normal reactions."""
    if not {"separating_contact", "t_separation"} <= set(ds.variables):
        return
    which, instant, time = int(ds["separating_contact"]), float(ds["t_separation"]), ds["time"].values
    # A part of a run may have no separation.
    if not time[0] <= instant <= time[-1] * (1.0 + 1e-9):
        return
    text = "both contacts separate" if which == 3 else f"contact {which} separates"
    text += f", t = {number_text(instant, '.4g')} s"
    style: dict[str, Any] = {"color": look.on_page("black"), "markerfacecolor": "none", "markersize": 5, "zorder": 5}
    for name in names:
        if name == f"normal_{which}" or (which == 3 and name.startswith("normal")):
            known = np.isfinite(ds[name].values) & (time <= instant * (1.0 + 1e-9))
            axes.plot([instant], [ds[name].values[known][-1]], "o", clip_on=False, label=text, **style)
            text = "_"


def _draw_laws(axes: Axes, ds: xr.Dataset, names: tuple[str, ...]) -> None:
    """Draw one quantity under each friction law."""
    (name,) = names
    look.small_ticks(axes)
    numbers = displayed(ds[name]).transpose("friction_law", "time").values
    regimes = words(ds["regime"]).values if "regime" in ds else None
    for k, law in enumerate(ds["friction_law"].values):
        label = str(law) if regimes is None else f"{law}: {regimes[k]}"
        axes.plot(ds["time"].values, numbers[k], label=label, **_law_style(k))
    axes.set_ylabel(_short_label(ds, name))
    axes.margins(x=0)
    if name.startswith(("normal", "gap")):
        axes.set_title(f"contact {name[-1]}", fontsize=look.SMALL, loc="left")
    if name in _CLIPPED:
        clip(axes, ds["time"].values, numbers)


def _law_style(k: int) -> dict[str, Any]:
    """Line of the `k`-th friction law."""
    colour, style = look.CURVE_COLOURS[k % len(look.CURVE_COLOURS)], look.CURVE_STYLES[k % len(look.CURVE_STYLES)]
    # Where lines coincide, the earlier ones show on both sides of the later ones.
    return {"color": look.on_page(colour), "linestyle": style, "linewidth": max(1.2, 3.0 - 0.6 * k)}


def _draw_zones(axes: Axes, ds: xr.Dataset, names: list[str]) -> None:
    """Draw the strip that shows which zone lies under each contact."""
    time, arcs = ds["time"].values, np.array([ds[name].values for name in names])
    starts = np.append(0, 1 + np.flatnonzero((arcs[:, 1:] != arcs[:, :-1]).any(axis=0)))
    at, strip = np.append(time[starts], time[-1]), arcs[:, starts]
    surfaces = [("elsewhere", look.on_page(look.REST)), *look.arcs(int(max(1, strip.max())))]
    palette = colors.ListedColormap([colour for _, colour in surfaces])
    limits: dict[str, Any] = {"vmin": -0.5, "vmax": len(surfaces) - 0.5}
    axes.pcolormesh(at, np.arange(len(names) + 1), strip, cmap=palette, rasterized=True, **limits)
    axes.hlines(range(1, len(names)), at[0], at[-1], color=look.page_colour(), linewidth=2)
    axes.set_yticks(np.arange(len(names)) + 0.5, labels=[f"contact {name[-1]}" for name in names], fontsize=look.SMALL)
    axes.tick_params(axis="y", length=0)
    axes.invert_yaxis()
    handles: list[Artist] = [patches.Patch(facecolor=colour, edgecolor="0.7", label=name) for name, colour in surfaces]
    look.legend_above(axes, handles)
    axes.tick_params(axis="x", labelsize=look.SMALL)


def clip(axes: Axes, time: NDArray[Any], numbers: NDArray[Any], loc: Literal["left", "right"] = "right") -> None:
    """Limit the vertical axis to where values are for 98 % of the time, if outliers would flatten the rest, and say so.

    Parameters
    ----------
    axes : matplotlib.axes.Axes
        Axes in which the values are drawn.
    time : ndarray of shape ``(samples,)``
        Instants, s. They may be dense where values change fast.
    numbers : ndarray of shape ``(..., samples)``
        Values of one or several curves.
    loc : {"left", "right"}
        Where above the axes it says so.
    """
    gaps = np.diff(time)
    durations = np.broadcast_to(np.append(gaps, 0.0) + np.append(0.0, gaps), numbers.shape)
    known = np.isfinite(numbers)
    if not durations[known].any():
        return
    order = np.argsort(numbers[known])
    values, share = numbers[known][order], np.cumsum(durations[known][order])
    low, high = values[np.searchsorted(share, np.array([0.01, 0.99]) * share[-1])]
    if high > low and values[-1] - values[0] > 5 * (high - low):
        margin = 0.15 * (high - low)
        axes.set_ylim(low - margin, high + margin)
        ends = number_text(values[0]), number_text(values[-1])
        axes.set_title(f"axis clipped; values from {ends[0]} to {ends[1]}", fontsize=look.SMALL, loc=loc)


def _short_label(ds: xr.Dataset, name: str) -> str:
    short, unit = _SHORT_NAMES.get(name, long_name(ds[name])), unit_text(ds[name])
    return f"{short}\n({unit})" if unit else short
