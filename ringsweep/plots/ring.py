"""The body in the ring: phase portrait and polar view of a single run."""

from __future__ import annotations

import json
import math
from collections.abc import Iterator
from dataclasses import dataclass
from functools import partial
from typing import Any, Literal

import numpy as np
import xarray as xr
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.lines import Line2D
from matplotlib.patches import Circle, Patch, Polygon, Wedge
from matplotlib.quiver import Quiver
from numpy.typing import NDArray

from ringsweep.compile import take
from ringsweep.config import load
from ringsweep.errors import InputError
from ringsweep.models import MODELS
from ringsweep.physics import ring
from ringsweep.plots.style import (
    PAIR_COLOURS,
    PAIR_STYLES,
    REST,
    SMALL,
    arc_colour,
    arc_names,
    axes_or_current,
    beside,
    runs,
)
from ringsweep.quantities.variables import MODES

# Slip is of the body's hue in every picture; the darker is forward.
_MODE_LINES: dict[int, dict[str, Any]] = {
    1: {"color": PAIR_COLOURS[0], "linewidth": 1.1},
    -1: {"color": "#56B4E9", "linewidth": 1.1},
    0: {"color": "black", "linewidth": 2.6, "solid_capstyle": "round"},
}

# An angle that goes through more than this is shown modulo a turn, degrees.
_LONGEST = 720.0

MINUS, TIMES = "\N{MINUS SIGN}", "\N{MULTIPLICATION SIGN}"

_SIZE = (7.6, 4.8)
_SQUARE = (6.6, 5.2)


def phase_portrait(ds: xr.Dataset, frame: Literal["space", "ring"] = "space", ax: Axes | None = None) -> Axes:
    """Draw angular velocity over angle, coloured by slip and stick, with the ring's speed and the rough arcs.

    In space the ring's own speed is a curve beside the body's, which they share in stick, and the body's curve is
    underlaid where a contact is on a rough arc. Seen from the ring the arcs stand still, a band for each contact, and
    stick lies on zero. Angles of more than two turns are taken modulo a turn.

    Parameters
    ----------
    ds : xarray.Dataset
        Result of :func:`ringsweep.simulate` on a ring.
    frame : {"space", "ring"}
        What stands still.
    ax : matplotlib.axes.Axes, optional
        Where to draw; pyplot's current axes unless given. For the legend beside them a figure with
        ``layout="constrained"`` makes room.

    Returns
    -------
    matplotlib.axes.Axes

    Raises
    ------
    InputError
        If the dataset is not the history of one run on a ring, or `frame` is unknown.

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
    run, rig = run_of(ds), Rig.of(ds)
    ax = axes_or_current(ax, _SIZE)
    theta, still = run["theta"].values, not run["theta"].values.any()
    seen_from_ring = frame == "ring"
    angle = np.degrees(run["phi"].values - theta if seen_from_ring else run["phi"].values)
    speed = run["omega"].values - run["ring_omega"].values if seen_from_ring else run["omega"].values
    wrapped = bool(np.ptp(angle) > _LONGEST)
    entries = _mark_arcs(ax, rig, angle, wrapped) if seen_from_ring or still else []
    if not entries:
        entries = _underlay_arcs(ax, run, angle, speed, wrapped)
    # In stick the two are one.
    own: dict[str, Any] = {"color": PAIR_COLOURS[1], "linewidth": 0.8, "alpha": 0.7, "zorder": 1.8}
    if seen_from_ring or still:
        own |= {"linestyle": PAIR_STYLES[1], "linewidth": 1.2, "alpha": 1.0}
        ax.axhline(0.0, **own)
    else:
        ax.plot(*_laid(angle, run["ring_omega"].values, wrapped), **own)
    entries.append(Line2D([], [], **own, label="speed of the ring" + (", stick" if seen_from_ring else "")))
    mode = run["mode"].values
    # A way that slip begins or ends is one of slip, however long it is.
    way = np.where(mode[:-1] != 0, mode[:-1], mode[1:])
    for value, style in _MODE_LINES.items():
        if not (mode == value).any():
            continue
        ax.plot(*_laid(*_pieces(way == value, angle, speed), wrapped), **style)
        # Seen from the ring a stick is a point.
        dot: dict[str, Any] = {"marker": "o", "markersize": 3.5} if value == 0 else {}
        if dot:
            first = [i for i, _ in runs(mode == value)]
            ax.plot(_turned(angle[first], wrapped), speed[first], color=style["color"], linestyle="", **dot)
        entries.append(Line2D([], [], **style, **dot, label=MODES[value].replace("_", " ")))
    for k, label, look in ((0, "start", {"markerfacecolor": "white"}), (-1, "end", {"markerfacecolor": "black"})):
        mark: dict[str, Any] = {"marker": "s", "markersize": 5.5, "color": "black", "linestyle": "", **look}
        ax.plot(_turned(angle[[k]], wrapped), speed[[k]], zorder=4, **mark)
        entries.append(Line2D([], [], label=label, **mark))
    ax.set_xlabel("angle of the body on the ring (°)" if seen_from_ring else "angle of the body (°)")
    ax.set_ylabel(f"angular velocity{' relative to the ring' if seen_from_ring else ''} (rad s$^{{-1}}$)")
    if wrapped:
        ax.set_xlim(-180.0, 180.0)
        ax.set_xticks(np.arange(-180.0, 181.0, 60.0))
    if seen_from_ring:
        slide = ax.secondary_yaxis(
            "right", functions=(partial(np.multiply, rig.radius), partial(np.multiply, 1.0 / rig.radius))
        )
        slide.set_ylabel("sliding velocity (m s$^{-1}$)")
    beside(ax, entries, bbox_to_anchor=(1.16 if seen_from_ring else 1.0, 1.0), handleheight=1.2)
    return ax


def polar_view(ds: xr.Dataset, time: float, ax: Axes | None = None) -> Axes:
    """Draw the body in the ring at one instant, to scale, with all forces.

    Angles count from the downward vertical, counter-clockwise; a mark on the ring shows where it is and the way it
    turns. Reactions and weight are arrows of one scale, the same for all instants of a run, and so are frictions, by
    the factor that the legend gives. In stick too the frictions are those that act: they follow from the balances of
    momentum.

    Parameters
    ----------
    ds : xarray.Dataset
        Result of :func:`ringsweep.simulate` on a ring.
    time : float
        Instant, s.
    ax : matplotlib.axes.Axes, optional
        Where to draw; pyplot's current axes unless given. For the legend beside them a figure with
        ``layout="constrained"`` makes room.

    Returns
    -------
    matplotlib.axes.Axes

    Raises
    ------
    InputError
        If the dataset is not the history of one run on a ring, or does not reach to `time`.

    Examples
    --------
    >>> import ringsweep
    >>> from matplotlib.figure import Figure
    >>> run = ringsweep.simulate("my-sweep.yaml")
    >>> polar_view(run, 1.5, Figure().add_subplot()).get_title()
    't = 1.5000 s, slip backward'
    """
    stage = Stage(run_of(ds), Rig.of(ds))
    first, last = stage.run["time"].values[[0, -1]]
    if not first <= time <= last:
        raise InputError("time", f"{time:g} s is not within the run, from {first:g} s to {last:.6g} s")
    ax = axes_or_current(ax, _SQUARE)
    stage.build(ax)
    stage.show(instants(stage.run, np.array([time])), 0)
    beside(ax, stage.legend())
    return ax


@dataclass(frozen=True)
class Rig:
    """Measures of ring and body, SI; `arcs` are centre and half-angle in the ring's frame, the later above."""

    body: Any
    radius: float
    ball: float
    beta: float
    contacts: tuple[int, ...]
    arcs: tuple[tuple[float, float], ...]

    @classmethod
    def of(cls, ds: xr.Dataset) -> Rig:
        """Those of the scene that a run was made from."""
        if "configuration" not in ds.attrs:
            raise InputError("ds", "has no attribute configuration: the measures of the ring are not known")
        scene = load(json.loads(ds.attrs["configuration"])).scene
        model: Any = MODELS[scene.structure.model]
        body = take(model.build_body({path: np.array([value]) for path, value in scene.values.items()}), 0)
        arcs = tuple((scene.values[f"{a}.center"], scene.values[f"{a}.half_angle"]) for a in scene.structure.arcs)
        beta = float(ring.contact_offset(body))
        contacts = (1, 2) if beta else (1,)
        # A body without measures is drawn as a small ball; one of no radius is still to be seen.
        ball = max(scene.values.get("body.ball_radius", 0.07 * body.radius), 0.02 * body.radius)
        return cls(body, float(body.radius), float(ball), beta, contacts, arcs)

    def offset(self, contact: int) -> float:
        """Angle of a contact from that of the body, rad."""
        return -self.beta if contact == 1 else self.beta


def run_of(ds: xr.Dataset) -> xr.Dataset:
    """The history of one run on a ring, up to its end, with the frictions that it tells; others are refused."""
    if "time" not in ds.dims or not ds.sizes["time"]:
        raise InputError("ds", "has no dimension time: it is not the history of a run; see ringsweep.simulate")
    if "phi" not in ds:
        raise InputError("ds", "is the history of a body on a belt: there is no ring to draw; see history")
    if ds.sizes.get("friction_law", 1) > 1:
        laws = ", ".join(map(str, ds["friction_law"].values))
        raise InputError("ds", f"holds a run under each of {laws}: choose one, as with ds.sel(friction_law=...)")
    if "friction_law" in ds.dims:
        ds = ds.isel(friction_law=0)
    if "theta" not in ds:
        raise InputError("ds", "has no theta, the angle of the ring: it is of an earlier version; run it again")
    ds = ds.isel(time=np.isfinite(ds["phi"].values))
    body = Rig.of(ds).body
    phi, second = ds["phi"].values, ds["normal_2" if "normal_2" in ds else "normal_1"].values
    state = np.sin(phi), np.cos(phi), ds["omega"].values, ds["epsilon"].values, ds["normal_1"].values, second
    found = ring.tractions(body, *state)
    return ds.assign({f"friction_{k}": ("time", values) for k, values in enumerate(found, start=1)})


def instants(run: xr.Dataset, times: NDArray[np.float64]) -> dict[str, NDArray[Any]]:
    """State at other times: numbers from the line between two samples, the mode from the one before."""
    own = run["time"].values
    before = np.maximum(np.searchsorted(own, times, side="right") - 1, 0)
    found: dict[str, NDArray[Any]] = {"time": times, "mode": run["mode"].values[before]}
    names = ("phi", "theta", "omega", "ring_omega", "normal_1", "normal_2", "friction_1", "friction_2")
    return found | {name: np.interp(times, own, run[name].values) for name in names if name in run}


class Stage:
    """The body in the ring as artists that are made once and moved from instant to instant."""

    def __init__(self, run: xr.Dataset, rig: Rig):
        self.run, self.rig = run, rig
        self.weight = float(rig.body.mass * rig.body.gravity)
        self.reference = _reference([run[f"normal_{k}"].values for k in rig.contacts], self.weight or 1.0)
        # Metres of arrow to a newton; frictions, which are small beside reactions, are magnified by a round factor.
        self.scale = 0.75 * rig.radius / self.reference
        # A scratch makes peaks of friction that are what is to be seen.
        friction = _reference([np.abs(run[f"friction_{k}"].values) for k in rig.contacts], 0.0, spike=6.0)
        self.magnified = max(1.0, float(f"{1.5 * self.reference / friction:.0e}")) if friction else 1.0

    def build(self, ax: Axes) -> None:
        """Make the artists; what does not move is in its place already."""
        rig, R = self.rig, self.rig.radius
        self.ax = ax
        ax.set_aspect("equal")
        ax.set_axis_off()
        ax.set_xlim(-1.45 * R, 1.45 * R)
        ax.set_ylim(-1.75 * R, 1.4 * R)
        ax.add_patch(Wedge((0.0, 0.0), 1.1 * R, 0.0, 360.0, width=0.1 * R, facecolor=REST, edgecolor="0.3", zorder=1))
        self._graduate()
        self.arcs = []
        for k, (_, half_angle) in enumerate(rig.arcs, start=1):
            wedge = Wedge((0.0, 0.0), 1.1 * R, 0.0, 1.0, width=0.1 * R, facecolor=arc_colour(k), edgecolor="0.3")
            wedge.set(zorder=2, visible=half_angle > 0.0)
            self.arcs.append(wedge)
        self.notch = Polygon(np.zeros((3, 2)), facecolor="0.2", edgecolor="none", zorder=3)
        (self.rod,) = ax.plot([], [], color="0.45", linewidth=4, solid_capstyle="round", zorder=3)
        self.balls = []
        for _ in rig.contacts:
            ball = Circle((0.0, 0.0), rig.ball, facecolor="0.85", edgecolor="0.2", linewidth=1.2, zorder=4)
            self.balls.append(ball)
        for patch in (*self.arcs, self.notch, *self.balls):
            ax.add_patch(patch)
        # A single contact needs no number.
        words = [str(k) if len(rig.contacts) > 1 else "" for k in rig.contacts]
        self.numbers = [ax.text(0.0, 0.0, word, ha="center", va="center", fontsize=SMALL, zorder=5) for word in words]
        (self.centre,) = ax.plot([], [], marker="o", markersize=4, color="black", linestyle="", zorder=5)
        colours = [PAIR_COLOURS[k - 1] for k in rig.contacts]
        self.reactions = self._arrows(colours, 0.032)
        # Of friction the arrows are slender.
        self.frictions = self._arrows(colours, 0.016)
        self.gravity = self._arrows(["black"], 0.016)
        self._give_scales()
        self.words = ax.text(0.5, 0.0, "", transform=ax.transAxes, ha="center", va="bottom", fontsize=9)
        ax.set_title(" ", fontsize=11)

    def show(self, state: dict[str, NDArray[Any]], k: int) -> None:
        """Move everything to the `k`-th of the states that :func:`instants` gives."""
        rig, R = self.rig, self.rig.radius
        phi, theta = float(state["phi"][k]), float(state["theta"][k])
        spin, speed = float(state["ring_omega"][k]), float(state["omega"][k])
        for wedge, (center, half_angle) in zip(self.arcs, rig.arcs, strict=True):
            middle = theta + center
            # Matplotlib counts from the horizontal.
            wedge.set_theta1(math.degrees(middle - half_angle) - 90.0)
            wedge.set_theta2(math.degrees(middle + half_angle) - 90.0)
        ahead = 0.07 * np.sign(spin)
        self.notch.set_xy([_at(1.11 * R, theta - 0.03), _at(1.2 * R, theta + ahead), _at(1.11 * R, theta + 0.03)])
        places = np.array([_at(R, phi + rig.offset(c)) for c in rig.contacts])
        centres = places * (1.0 - rig.ball / R)
        self.rod.set_data(*centres.T)
        inwards = -places / R
        forwards = np.column_stack([inwards[:, 1], -inwards[:, 0]])
        for c, ball, number, at, along in zip(rig.contacts, self.balls, self.numbers, centres, forwards, strict=True):
            ball.set_center(tuple(at))
            # Beside the arrow, which goes through the middle.
            number.set_position(tuple(at + (0.55 if c == 2 else -0.55) * rig.ball * along))
        middle_of_mass = centres.mean(axis=0)
        self.centre.set_data(*middle_of_mass[:, None])
        normals = np.array([state[f"normal_{c}"][k] for c in rig.contacts])
        frictions = np.array([state[f"friction_{c}"][k] for c in rig.contacts])
        _aim(self.reactions, places, inwards * (normals * self.scale)[:, None])
        _aim(self.frictions, places, forwards * (frictions * self.scale * self.magnified)[:, None])
        _aim(self.gravity, middle_of_mass[None], np.array([[0.0, -self.weight * self.scale]]))
        mode = MODES[int(state["mode"][k])].replace("_", " ")
        self.ax.set_title(f"t = {state['time'][k]:.4f} s, {mode}", fontsize=11)
        self.words.set_text(f"body {speed:+.2f} rad s⁻¹, ring {spin:+.2f} rad s⁻¹")

    @property
    def moving(self) -> list[Artist]:
        """Artists that :meth:`show` moves."""
        arrows = [self.reactions, self.frictions, self.gravity]
        parts = [*self.arcs, self.notch, self.rod, *self.balls, *self.numbers, self.centre, *arrows, self.words]
        return [*parts, self.ax.title]

    def legend(self) -> list[Artist]:
        """What the colours and arrows are."""
        entries: list[Artist] = [
            Patch(facecolor=arc_colour(k), edgecolor="0.3", label=name)
            for k, name in enumerate(arc_names(len(self.rig.arcs)), start=1)
            if self.rig.arcs
        ]
        entries.append(Patch(facecolor=REST, edgecolor="0.3", label="elsewhere"))
        for c in self.rig.contacts:
            words = f" at {c}" if len(self.rig.contacts) > 1 else ""
            enlarged = f", {TIMES}{self.magnified:g}" if self.magnified > 1.0 else ""
            for label, width in (("reaction" + words, 3.5), ("friction" + words + enlarged, 1.6)):
                entries.append(Line2D([], [], color=PAIR_COLOURS[c - 1], linewidth=width, label=label))
        entries.append(Line2D([], [], color="black", linewidth=1.6, label="weight"))
        notch: dict[str, Any] = {"marker": "^", "color": "0.2", "linestyle": "", "markersize": 5}
        return [*entries, Line2D([], [], label="mark on the ring", **notch)]

    def _graduate(self) -> None:
        R = self.rig.radius
        for angle in range(0, 360, 15):
            inner, outer = _at(1.1 * R, math.radians(angle)), _at(1.13 * R, math.radians(angle))
            self.ax.plot(*zip(inner, outer, strict=True), color="0.5", linewidth=0.6, zorder=1)
        for angle in (0, 90, 180, -90):
            x, y = _at(1.3 * R, math.radians(angle))
            words = self.ax.text(x, y, f"{angle}°".replace("-", MINUS), fontsize=SMALL, color="0.35", zorder=7)
            words.set(ha="center", va="center", bbox={"facecolor": "white", "edgecolor": "none", "pad": 0.5})

    def _arrows(self, colours: list[str], width: float) -> Quiver:
        count = len(colours)
        return self.ax.quiver(
            np.zeros(count),
            np.zeros(count),
            np.zeros(count),
            np.zeros(count),
            color=colours,
            angles="xy",
            scale_units="xy",
            scale=1.0,
            units="xy",
            width=width * self.rig.radius,
            # A head as long as the shaft would make short arrows look alike.
            minlength=0.1,
            headwidth=3.2,
            headlength=3.6,
            headaxislength=3.2,
            zorder=6,
        )

    def _give_scales(self) -> None:
        """A force and a length for comparison, below the ring."""
        R = self.rig.radius
        y = -1.5 * R
        force, length = _round(0.75 * self.reference), _round(0.5 * R)
        bar: dict[str, Any] = {"color": "0.3", "linewidth": 1.2}
        for x, extent, words in (
            (-1.2 * R, force * self.scale, f"{force:g} N"),
            (0.35 * R, length, f"{1000 * length:g} mm"),
        ):
            self.ax.plot([x, x + extent], [y, y], marker="|", **bar)
            self.ax.text(x + extent / 2, y + 0.04 * R, words, ha="center", va="bottom", fontsize=SMALL)


def _at(radius: float, angle: float) -> tuple[float, float]:
    """Place at an angle from the downward vertical, counter-clockwise."""
    return radius * math.sin(angle), -radius * math.cos(angle)


def _aim(arrows: Quiver, places: NDArray[Any], vectors: NDArray[Any]) -> None:
    arrows.set_offsets(places)
    arrows.set_UVC(*vectors.T)


def _reference(forces: list[NDArray[Any]], least: float, spike: float = 3.0) -> float:
    """The force that arrows are scaled by, N: the greatest, unless that is a spike; `least` if there are none.

    A spike is one so many times greater than what is usual.
    """
    finite = np.concatenate(forces)
    finite = finite[np.isfinite(finite)]
    usual = float(np.percentile(finite, 95)) if finite.size else 0.0
    greatest = float(finite.max(initial=0.0))
    return (greatest if greatest < spike * usual else usual) or least


def _round(value: float) -> float:
    """The greatest of 1, 2, 5, 10, ... that is not above `value`."""
    power = 10.0 ** math.floor(math.log10(value))
    return next(digit * power for digit in (5.0, 2.0, 1.0) if digit * power <= value * (1.0 + 1e-12))


def _turned(angle: NDArray[Any], wrapped: bool) -> NDArray[Any]:
    """Degrees, from -180 to 180 where they are wrapped."""
    return (angle + 180.0) % 360.0 - 180.0 if wrapped else angle


def _laid(angle: NDArray[Any], speed: NDArray[Any], wrapped: bool) -> tuple[NDArray[Any], NDArray[Any]]:
    """A curve, broken where its angle is wrapped."""
    if not wrapped:
        return angle, speed
    turns = np.floor((angle + 180.0) / 360.0)
    breaks = np.flatnonzero(np.diff(turns)) + 1
    return np.insert(_turned(angle, True), breaks, np.nan), np.insert(speed, breaks, np.nan)


def _pieces(kept: NDArray[Any], angle: NDArray[Any], speed: NDArray[Any]) -> tuple[NDArray[Any], NDArray[Any]]:
    """Of a curve the ways from one sample to the next that are kept, shape ``(samples - 1,)``, NaN between them."""
    places = [np.append(np.arange(i, j + 1), -1) for i, j in runs(kept)]
    index = np.concatenate([*places, np.array([-1])])
    return np.where(index < 0, np.nan, angle[index]), np.where(index < 0, np.nan, speed[index])


def _mark_arcs(ax: Axes, rig: Rig, angle: NDArray[Any], wrapped: bool) -> list[Artist]:
    """Bands where a contact is on a rough arc, over as many turns as are shown."""
    low, high = (-180.0, 180.0) if wrapped else (float(angle.min()), float(angle.max()))
    margin = 0.0 if wrapped else 0.05 * (high - low) or 5.0
    low, high = low - margin, high + margin
    names = arc_names(len(rig.arcs))
    entries: list[Artist] = []
    for number, (center, half_angle) in enumerate(rig.arcs, start=1):
        for contact in rig.contacts:
            lines = ("///", "\\\\\\")[contact - 1] if len(rig.contacts) > 1 else None
            look: dict[str, Any] = {"facecolor": arc_colour(number), "alpha": 0.35, "linewidth": 0}
            hatch: dict[str, Any] = {"facecolor": "none", "edgecolor": "0.45", "linewidth": 0, "hatch": lines}
            middle, half = math.degrees(center - rig.offset(contact)), math.degrees(half_angle)
            for left, right in _images(middle - half, middle + half, low, high):
                ax.axvspan(left, right, zorder=0.5, **look)
                ax.axvspan(left, right, zorder=0.6, **hatch).set(hatch_linewidth=0.4)
            band = Patch(facecolor=arc_colour(number), alpha=0.55, hatch=lines, edgecolor="0.3", linewidth=0)
            band.set(label=f"contact {contact} on {names[number - 1]}", hatch_linewidth=0.4)
            entries.append(band)
    ax.set_xlim(low, high)
    return entries


def _images(left: float, right: float, low: float, high: float) -> Iterator[tuple[float, float]]:
    """An interval repeated every turn, as far as it lies between `low` and `high`, degrees."""
    for turn in range(math.floor((low - right) / 360.0), math.ceil((high - left) / 360.0) + 1):
        a, b = max(left + 360.0 * turn, low), min(right + 360.0 * turn, high)
        if a < b:
            yield a, b


def _underlay_arcs(ax: Axes, run: xr.Dataset, angle: NDArray[Any], speed: NDArray[Any], wrapped: bool) -> list[Artist]:
    """A broad line beneath the body's where a contact is on a rough arc."""
    zones = np.array([run[name].values for name in ("zone_1", "zone_2") if name in run])
    count = int(zones.max())
    entries: list[Artist] = []
    for number, name in enumerate(arc_names(count) if count else [], start=1):
        here = np.where((zones == number).any(axis=0), 0.0, np.nan)
        look: dict[str, Any] = {"color": arc_colour(number), "linewidth": 6, "alpha": 0.45, "solid_capstyle": "butt"}
        ax.plot(*_laid(angle, speed + here, wrapped), zorder=1.5, **look)
        entries.append(Line2D([], [], label=f"a contact on {name}", **look))
    return entries
