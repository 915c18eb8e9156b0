"""Phase portraits of runs."""

from __future__ import annotations

import math
from collections.abc import Iterator
from functools import partial
from typing import Any, Literal

import numpy as np
import xarray as xr
from matplotlib import rcParams
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.lines import Line2D
from matplotlib.patches import Patch
from matplotlib.transforms import ScaledTranslation
from numpy.typing import NDArray

from ringsweep.errors import InputError
from ringsweep.plots import look
from ringsweep.plots.datasets import FLIGHT, PIVOT, mode_name, on_ring, require_history, zones
from ringsweep.plots.labels import label_axis
from ringsweep.plots.rig import Rig, belt_history, ring_history

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
    if on_ring(require_history(ds)):
        return _ring_portrait(ds, frame, ax)
    if frame == "ring":
        raise InputError("frame", "'ring' is for a body in a ring; on a belt the frame is 'space'")
    run = belt_history(ds)
    ax = look.axes_or_current(ax, 0.9 if look.is_narrow(look.figure_width()) else 0.63)
    look.place_legend(ax, draw_belt_portrait(ax, run))
    look.make_room(ax)
    return ax


def draw_belt_portrait(ax: Axes, run: xr.Dataset) -> list[Artist]:
    """Draw velocity over displacement of a run of :func:`belt_history`; returns the legend entries."""
    look.small_ticks(ax)
    place, speed, belt_speed = (run[name].values for name in ("x", "velocity", "belt_velocity"))
    if fixed := not np.ptp(belt_speed):
        ax.axhline(belt_speed[0], **_driven_style(fixed))
    else:
        ax.plot(place, belt_speed, **_driven_style(fixed))
    entries: list[Artist] = [Line2D([], [], **_driven_style(fixed), label="speed of the belt")]
    entries += draw_modes(ax, run["mode"].values, place, speed)
    label_axis(ax.xaxis, "displacement", "m")
    label_axis(ax.yaxis, "velocity", "m s$^{-1}$")
    return entries


def _ring_portrait(ds: xr.Dataset, frame: str, ax: Axes | None) -> Axes:
    """Draw angular velocity over angle."""
    run, rig = ring_history(ds)
    ax = look.axes_or_current(ax, 0.9 if look.is_narrow(look.figure_width()) else 0.63)
    factor, unit = look.angle_unit()
    relative = frame == "ring"
    fixed_arcs = relative or not run["theta"].values.any()
    angle = factor * (run["phi"].values - run["theta"].values if relative else run["phi"].values)
    speed = run["omega"].values - run["ring_omega"].values if relative else run["omega"].values
    wrapped = bool(np.ptp(angle) > _LONGEST * _turn())
    entries = _draw_bands(ax, rig, angle, wrapped) if fixed_arcs else []
    if not entries:
        entries = _draw_broad_lines(ax, run, angle, speed, wrapped)
    ring_style = _driven_style(fixed_arcs)
    if fixed_arcs:
        ax.axhline(0.0, **ring_style)
    else:
        ax.plot(*_curve(angle, run["ring_omega"].values, wrapped), **ring_style)
    entries.append(Line2D([], [], **ring_style, label="speed of the ring" + (", stick" if relative else "")))
    jumps = np.diff(run["time"].values) == 0.0
    jumps &= np.abs(np.diff(speed)) > 1e-6 * np.ptp(speed)
    entries += draw_modes(ax, run["mode"].values, angle, speed, wrapped, jumps)
    look.label_axes(
        ax,
        f"angle of the body{' on the ring' if relative else ''} ({unit})",
        f"angular velocity{' relative to the ring' if relative else ''} (rad s$^{{-1}}$)",
    )
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
    labels = ScaledTranslation(0.065 * rcParams["font.size"] * relative, 0.0, figure.dpi_scale_trans)
    look.place_legend(ax, entries, bbox_transform=ax.transAxes + labels, handleheight=1.2)
    look.make_room(ax)
    return ax


def _driven_style(constant: bool) -> dict[str, Any]:
    """Line of the speed of ring or belt; a thin one over the broad curve of the body in stick, which would hide it."""
    style: dict[str, Any] = {"color": look.pair(1), "linewidth": 0.8, "zorder": 2.5}
    return style | {"linestyle": look.PAIR_STYLES[1], "linewidth": 1.2} if constant else style


def draw_modes(
    ax: Axes,
    mode: NDArray[Any],
    across: NDArray[Any],
    up: NDArray[Any],
    wrapped: bool = False,
    jumps: NDArray[np.bool_] | None = None,
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


def _wrap(angle: NDArray[Any], wrapped: bool) -> NDArray[Any]:
    """Angles from minus half a turn to half a turn if `wrapped`."""
    return (angle + 0.5 * _turn()) % _turn() - 0.5 * _turn() if wrapped else angle


def _turn() -> float:
    """A full turn in the unit of angles."""
    return 2.0 * math.pi * look.angle_unit()[0]


def _curve(angle: NDArray[Any], speed: NDArray[Any], wrapped: bool) -> tuple[NDArray[Any], NDArray[Any]]:
    """A curve with NaN wherever its angle jumps by a full turn if `wrapped`."""
    if not wrapped:
        return angle, speed
    turns = np.floor((angle + 0.5 * _turn()) / _turn())
    jumps = np.flatnonzero(np.diff(turns)) + 1
    return np.insert(_wrap(angle, True), jumps, np.nan), np.insert(speed, jumps, np.nan)


def _segments(kept: NDArray[Any], angle: NDArray[Any], speed: NDArray[Any]) -> tuple[NDArray[Any], NDArray[Any]]:
    """Parts of a curve with NaN between them; `kept`, shape ``(samples - 1,)``, says from which sample to the next."""
    pieces = [np.append(np.arange(i, j + 1), -1) for i, j in look.true_ranges(kept)]
    index = np.concatenate([*pieces, np.array([-1])])
    return np.where(index < 0, np.nan, angle[index]), np.where(index < 0, np.nan, speed[index])


def _draw_bands(ax: Axes, rig: Rig, angle: NDArray[Any], wrapped: bool) -> list[Artist]:
    """Draw bands where a contact is on a zone, in all turns shown; returns their legend entries."""
    low, high = (-0.5 * _turn(), 0.5 * _turn()) if wrapped else (float(angle.min()), float(angle.max()))
    margin = 0.0 if wrapped else 0.05 * (high - low) or _turn() / 72.0
    low, high = low - margin, high + margin
    entries: list[Artist] = []
    arcs = zip(look.arc_names(len(rig.arcs)), rig.arcs, strict=True)
    for number, (name, (center, half_angle)) in enumerate(arcs, start=1):
        for contact in rig.contacts:
            lines = ("///", "\\\\\\")[contact - 1] if len(rig.contacts) > 1 else None
            fill: dict[str, Any] = {"facecolor": look.arc_colour(number), "alpha": 0.35, "linewidth": 0}
            hatch: dict[str, Any] = {
                "facecolor": "none",
                "edgecolor": look.on_page("0.45"),
                "linewidth": 0,
                "hatch": lines,
            }
            middle, half = look.angle_unit()[0] * (center - rig.offset(contact)), look.angle_unit()[0] * half_angle
            for left, right in _every_turn(middle - half, middle + half, low, high):
                ax.axvspan(left, right, zorder=0.5, **fill)
                ax.axvspan(left, right, zorder=0.6, **hatch).set(hatch_linewidth=0.4)
            entry = Patch(
                facecolor=look.arc_colour(number), alpha=0.55, hatch=lines, edgecolor=look.on_page("0.3"), linewidth=0
            )
            entry.set(label=f"contact {contact} on {name}", hatch_linewidth=0.4)
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


def _draw_broad_lines(
    ax: Axes, run: xr.Dataset, angle: NDArray[Any], speed: NDArray[Any], wrapped: bool
) -> list[Artist]:
    """Draw a broad line under the curve where a contact is on a zone; returns the legend entries."""
    arcs = np.array([run[name].values for name in zones(run)])
    entries: list[Artist] = []
    for number, name in enumerate(look.arc_names(int(arcs.max())), start=1):
        here = np.where((arcs == number).any(axis=0), 0.0, np.nan)
        style: dict[str, Any] = {
            "color": look.arc_colour(number),
            "linewidth": 6,
            "alpha": 0.45,
            "solid_capstyle": "butt",
        }
        ax.plot(*_curve(angle, speed + here, wrapped), zorder=1.5, **style)
        entries.append(Line2D([], [], label=f"a contact on {name}", **style))
    return entries
