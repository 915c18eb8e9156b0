"""Phase portraits of runs, and friction forces over sliding."""

from __future__ import annotations

import math
from collections.abc import Iterator
from functools import partial
from typing import Any, Literal

import numpy as np
import xarray as xr
from matplotlib import patches, rcParams, transforms
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.lines import Line2D
from numpy.typing import NDArray

from ringsweep.errors import InputError
from ringsweep.plots import look
from ringsweep.plots.datasets import FLIGHT, PIVOT, mode_name, on_ring, require_history, zones
from ringsweep.plots.histories import clip
from ringsweep.plots.labels import label_axis
from ringsweep.plots.rig import Rig, belt_history, ring_history

Numbers = NDArray[Any]

# In place of a mode: the velocity jumps.
_JUMP = 4

# Slip has the hue of the body; slip forward is darker.
_MODE_STYLES: dict[int, dict[str, Any]] = {
    1: {"color": look.PAIR_COLOURS[0], "linewidth": 1.1},
    -1: {"color": "#56B4E9", "linewidth": 1.1},
    0: {"color": "black", "linewidth": 2.6, "solid_capstyle": "round"},
    PIVOT: {"color": look.OPEN, "linewidth": 1.1, "linestyle": (0, (5, 1.5))},
    FLIGHT: {"color": look.OPEN, "linewidth": 1.1, "linestyle": (0, (1, 1))},
    _JUMP: {"color": "0.55", "linewidth": 0.6},
}

# Range of an angle above which it is shown modulo a full turn, turns.
_LONGEST = 2.0

# Share of the greatest velocity that the inset of a friction loop shows.
_NEAR = 0.02


def phase_portrait(ds: xr.Dataset, frame: Literal["space", "ring"] = "space", ax: Axes | None = None) -> Axes:
    """Draw velocity over place, with stick, slip, open contacts, impacts, and the speed of the ring or belt.

    For a ring, in space, the angular velocity of the ring is a curve of its own, which the body follows while it
    sticks. A broad line lies under the curve of the body while a contact is on a zone. In the frame of the ring
    the zones are fixed: a band shows where a contact is on a zone. There the body sticks at zero velocity. Angles of
    more than two turns are shown modulo a full turn.

    For a belt the velocity is drawn over the displacement. While the body sticks, its curve lies on that of the belt.

    Parameters
    ----------
    ds : xarray.Dataset
        Result of :func:`ringsweep.simulate`.
    frame : {"space", "ring"}
        Frame of reference; on a belt always space.
    ax : matplotlib.axes.Axes, optional
        Axes to draw in, by default pyplot's current ones. The legend stands outside them: a figure whose
        layout was not chosen gets the constrained one, which makes room for it.

    Returns
    -------
    matplotlib.axes.Axes

    Raises
    ------
    InputError
        If the dataset is not the history of one run on a ring or a belt, or `frame` is unknown.

    Examples
    --------
    >>> import ringsweep
    >>> from matplotlib.figure import Figure
    >>> run = ringsweep.simulate("my-sweep.yaml")
    >>> phase_portrait(run, ax=Figure().add_subplot()).get_xlabel()
    'angle of the body (°)'
    """
    if frame not in ("space", "ring"):
        raise InputError("frame", f"{frame!r} is neither 'space' nor 'ring'")
    if ringed := on_ring(require_history(ds)):
        run, rig = ring_history(ds)
    elif frame == "ring":
        raise InputError("frame", "'ring' is for a body in a ring; on a belt the frame is 'space'")
    else:
        run = belt_history(ds)
    ax = look.axes_or_current(ax, 0.9 if look.is_narrow(look.figure_width()) else 0.63)
    if ringed:
        _draw_ring_portrait(ax, run, rig, frame == "ring")
    else:
        look.place_legend(ax, draw_belt_portrait(ax, run))
    look.make_room(ax)
    return ax


def draw_belt_portrait(ax: Axes, run: xr.Dataset) -> list[Artist]:
    """Draw velocity over displacement of a run of :func:`belt_history`; returns the legend entries."""
    look.small_ticks(ax)
    place, speed, belt_speed = (run[name].values for name in ("x", "velocity", "belt_velocity"))
    entries = [_draw_driven(ax, "belt", place, belt_speed, not np.ptp(belt_speed))]
    entries += draw_modes(ax, run["mode"].values, place, speed)
    label_axis(ax.xaxis, "displacement", "m")
    label_axis(ax.yaxis, "velocity", "m s$^{-1}$")
    return entries


def _draw_ring_portrait(ax: Axes, run: xr.Dataset, rig: Rig, relative: bool) -> None:
    """Draw angular velocity over angle, `relative` to the ring or not."""
    factor, unit = look.angle_unit()
    angle, speed, theta, driven = (run[name].values for name in ("phi", "omega", "theta", "ring_omega"))
    fixed_arcs = relative or not theta.any()
    if relative:
        angle, speed, driven = angle - theta, speed - driven, 0.0 * driven
    angle = factor * angle
    wrapped = bool(np.ptp(angle) > _LONGEST * _turn())
    entries = _draw_bands(ax, rig, angle, wrapped) if fixed_arcs else []
    entries = entries or _draw_broad_lines(ax, run, angle, speed, wrapped)
    name = "ring, stick" if relative else "ring"
    entries.append(_draw_driven(ax, name, *_curve(angle, driven, wrapped), constant=fixed_arcs))
    jumps = np.diff(run["time"].values) == 0.0
    jumps &= np.abs(np.diff(speed)) > 1e-6 * np.ptp(speed)
    entries += draw_modes(ax, run["mode"].values, angle, speed, wrapped, jumps)
    across, up = (" on the ring", " relative to the ring") if relative else ("", "")
    look.label_axes(ax, f"angle of the body{across} ({unit})", f"angular velocity{up} (rad s$^{{-1}}$)")
    if wrapped:
        ax.set_xlim(-0.5 * _turn(), 0.5 * _turn())
        if unit == "°":
            ax.set_xticks(np.arange(-180.0, 181.0, 60.0))
    if relative:
        to_sliding, to_angular = partial(np.multiply, rig.radius), partial(np.multiply, 1.0 / rig.radius)
        second = ax.secondary_yaxis("right", functions=(to_sliding, to_angular))
        second.set_ylabel("sliding velocity (m s$^{-1}$)")
        second.tick_params(labelsize=look.SMALL)
    figure: Any = ax.figure
    # The second axis has its labels between axes and legend.
    room = transforms.ScaledTranslation(0.065 * rcParams["font.size"] * relative, 0.0, figure.dpi_scale_trans)
    look.place_legend(ax, entries, bbox_transform=ax.transAxes + room, handleheight=1.2)


def _draw_driven(ax: Axes, name: str, across: Numbers, up: Numbers, constant: bool) -> Artist:
    """Draw the speed of ring or belt: thin, over the broad curve of the body in stick, which would hide it."""
    style: dict[str, Any] = {"color": look.pair(1), "linewidth": 0.8, "zorder": 2.5, "label": f"speed of the {name}"}
    if not constant:
        return ax.plot(across, up, **style)[0]
    return ax.axhline(up[0], **style | {"linestyle": look.PAIR_STYLES[1], "linewidth": 1.2})


def draw_modes(
    ax: Axes, mode: Numbers, across: Numbers, up: Numbers, wrapped: bool = False, jumps: Numbers | None = None
) -> list[Artist]:
    """Draw the curve of a run with a line for each friction mode, its start and its end; returns the legend entries.

    Parameters
    ----------
    ax : matplotlib.axes.Axes
        Axes to draw in.
    mode, across, up : ndarray of shape ``(samples,)``
        Friction mode, and coordinates in the axes.
    wrapped : bool
        Whether `across` is an angle, shown modulo a full turn.
    jumps : ndarray of shape ``(samples - 1,)``, optional
        Whether an impact lies between a sample and the next.
    """
    entries: list[Artist] = []
    # From one sample to the next the body slips if it slips at either of them.
    between = np.where(mode[:-1] != 0, mode[:-1], mode[1:])
    if jumps is not None:
        between = np.where(jumps, _JUMP, between)
    for value, usual in _MODE_STYLES.items():
        if not ((mode == value).any() or (between == value).any()):
            continue
        style = usual | {"color": look.on_page(usual["color"])}
        ax.plot(*_curve(*_segments(between == value, across, up), wrapped), **style)
        # In the frame of the ring or belt the curve of a stick may have no length.
        dot: dict[str, Any] = {"marker": "o", "markersize": 3.5} if value == 0 else {}
        if dot:
            first = [i for i, _ in look.true_ranges(mode == value)]
            ax.plot(_wrap(across[first], wrapped), up[first], color=style["color"], linestyle="", **dot)
        entries.append(Line2D([], [], **style, **dot, label="impact" if value == _JUMP else mode_name(value)))
    ink = look.on_page("black")
    for k, label, colour in ((0, "start", look.page_colour()), (-1, "end", ink)):
        square: dict[str, Any] = {"marker": "s", "markersize": 5.5, "color": ink, "linestyle": ""}
        square["markerfacecolor"] = colour
        ax.plot(_wrap(across[[k]], wrapped), up[[k]], zorder=4, **square)
        entries.append(Line2D([], [], label=label, **square))
    return entries


def _wrap(angle: Numbers, wrapped: bool) -> Numbers:
    """Angles from minus half a turn to half a turn if `wrapped`."""
    return (angle + 0.5 * _turn()) % _turn() - 0.5 * _turn() if wrapped else angle


def _turn() -> float:
    """A full turn in the unit of angles."""
    return 2.0 * math.pi * look.angle_unit()[0]


def _curve(angle: Numbers, speed: Numbers, wrapped: bool) -> tuple[Numbers, Numbers]:
    """A curve with NaN wherever its angle jumps by a full turn if `wrapped`."""
    if not wrapped:
        return angle, speed
    turns = np.floor((angle + 0.5 * _turn()) / _turn())
    jumps = np.flatnonzero(np.diff(turns)) + 1
    return np.insert(_wrap(angle, True), jumps, np.nan), np.insert(speed, jumps, np.nan)


def _segments(kept: Numbers, angle: Numbers, speed: Numbers) -> tuple[Numbers, Numbers]:
    """Parts of a curve with NaN between them; `kept`, shape ``(samples - 1,)``, says from which sample to the next."""
    pieces = [np.append(np.arange(i, j + 1), -1) for i, j in look.true_ranges(kept)]
    index = np.concatenate([*pieces, np.array([-1])])
    return np.where(index < 0, np.nan, angle[index]), np.where(index < 0, np.nan, speed[index])


def _draw_bands(ax: Axes, rig: Rig, angle: Numbers, wrapped: bool) -> list[Artist]:
    """Draw bands where a contact is on a zone, in all turns shown; returns their legend entries."""
    low, high = (-0.5 * _turn(), 0.5 * _turn()) if wrapped else (float(angle.min()), float(angle.max()))
    margin = 0.0 if wrapped else 0.05 * (high - low) or _turn() / 72.0
    low, high = low - margin, high + margin
    entries: list[Artist] = []
    hatches = ("///", "\\\\\\") if len(rig.contacts) > 1 else (None,)
    grey, edge, factor = look.on_page("0.45"), look.on_page("0.3"), look.angle_unit()[0]
    for (name, colour), (center, half_angle) in zip(look.arcs(len(rig.arcs)), rig.arcs, strict=True):
        for contact, hatch in zip(rig.contacts, hatches, strict=True):
            style: dict[str, Any] = {"hatch": hatch, "linewidth": 0}
            middle, half = factor * (center - rig.offset(contact)), factor * half_angle
            for left, right in _every_turn(middle - half, middle + half, low, high):
                ax.axvspan(left, right, fc=(colour, 0.35), ec=grey, zorder=0.5, **style).set(hatch_linewidth=0.4)
            entry = patches.Patch(fc=colour, ec=edge, alpha=0.55, label=f"contact {contact} on {name}", **style)
            entry.set(hatch_linewidth=0.4)
            entries.append(entry)
    ax.set_xlim(low, high)
    return entries


def _every_turn(left: float, right: float, low: float, high: float) -> Iterator[tuple[float, float]]:
    """Copies of an interval at every full turn, cut to the range from `low` to `high`."""
    full = _turn()
    for turn in range(math.floor((low - right) / full), math.ceil((high - left) / full) + 1):
        a, b = max(left + full * turn, low), min(right + full * turn, high)
        if a < b:
            yield a, b


def _draw_broad_lines(ax: Axes, run: xr.Dataset, angle: Numbers, speed: Numbers, wrapped: bool) -> list[Artist]:
    """Draw a broad line under the curve where a contact is on a zone; returns the legend entries."""
    arcs = np.array([run[name].values for name in zones(run)])
    entries: list[Artist] = []
    for number, (name, colour) in enumerate(look.arcs(int(arcs.max())), start=1):
        here = np.where((arcs == number).any(axis=0), 0.0, np.nan)
        style: dict[str, Any] = {"color": colour, "linewidth": 6, "alpha": 0.45, "solid_capstyle": "butt"}
        label = f"a contact on {name}"
        entries += ax.plot(*_curve(angle, speed + here, wrapped), zorder=1.5, label=label, **style)
    return entries


def friction_loop(
    ds: xr.Dataset, against: Literal["velocity", "distance"] = "velocity", ax: Axes | None = None
) -> Axes:
    """Draw the friction force on a belt over the sliding velocity, or over the distance slid.

    A law of the sliding velocity alone gives one curve, and a vertical line where the body sticks. Bristles give loops,
    which an inset shows at small velocities. Over the distance slid, the area of a closed loop is the energy that
    friction takes in a cycle. For the loops of some cycles only, draw ``ds.sel(time=slice(...))``.

    Parameters
    ----------
    ds : xarray.Dataset
        Result of :func:`ringsweep.simulate` on a belt.
    against : {"velocity", "distance"}
        Whether the horizontal axis has the sliding velocity, or the distance slid on the belt since the first instant
        of `ds`. Forwards is positive for both.
    ax : matplotlib.axes.Axes, optional
        Axes to draw in, by default pyplot's current ones. The legend stands outside them: a figure with
        ``layout="constrained"`` makes room for it.

    Returns
    -------
    matplotlib.axes.Axes

    Raises
    ------
    InputError
        If the dataset is not the history of one run on a belt, or `against` is unknown.

    Examples
    --------
    >>> import ringsweep
    >>> from matplotlib.figure import Figure
    >>> scene = {
    ...     "model": "belt",
    ...     "body": {"mass": 1.0},
    ...     "spring": {"stiffness": 2.0},
    ...     "belt": {"velocity": 0.1},
    ...     "friction": {"law": "stiction", "mu_s": 0.15, "mu_k": 0.1},
    ...     "time": {"span": 60.0},
    ... }
    >>> friction_loop(ringsweep.simulate(scene), ax=Figure().add_subplot()).get_xlabel()
    'sliding velocity (m s$^{-1}$)'
    """
    if against not in ("velocity", "distance"):
        raise InputError("against", f"{against!r} is neither 'velocity' nor 'distance'")
    run = belt_history(ds)
    ax = look.axes_or_current(ax, 0.63)
    if against == "velocity":
        across = (run["velocity"] - run["belt_velocity"]).values
        label = "sliding velocity", "m s$^{-1}$"
    else:
        across = (run["x"] - run["belt_x"]).values
        across -= across[0]
        label = "distance slid on the belt", "m"
    force = run["friction_force"].values
    entries = draw_modes(ax, run["mode"].values, across, force)
    clip(ax, run["time"].values, force)
    label_axis(ax.xaxis, *label)
    label_axis(ax.yaxis, "friction force", "N")
    if against == "velocity" and "deflection" in run and run["deflection"].values.any():
        _draw_near_zero(ax, run["mode"].values, across, force)
    look.place_legend(ax, entries)
    return ax


def _draw_near_zero(ax: Axes, mode: Numbers, velocity: Numbers, force: Numbers) -> None:
    """Draw small velocities, at which bristles make loops, as an inset where friction, which opposes slip, never is."""
    width = _NEAR * float(np.nanmax(np.abs(velocity)))
    inset = ax.inset_axes((0.6, 0.24, 0.37, 0.36))
    draw_modes(inset, mode, velocity, force)
    for line in inset.lines:
        line.set_linewidth(min(line.get_linewidth(), 0.9))
        if line.get_marker() != "None":
            line.set_visible(False)
    inset.set(xlim=(-width, width), ylim=ax.get_ylim(), yticks=[])
    look.small_ticks(inset)
    label_axis(inset.xaxis, "near 0", "m s$^{-1}$")
    inset.xaxis.label.set_fontsize(look.SMALL)
