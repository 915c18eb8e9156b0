"""The body in the ring at an instant, to scale, with all forces."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import xarray as xr
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.lines import Line2D
from matplotlib.patches import Circle, Patch, Polygon, Wedge
from matplotlib.patheffects import withStroke
from matplotlib.quiver import Quiver
from numpy.typing import NDArray

from ringsweep.errors import InputError
from ringsweep.plots.datasets import mode_name
from ringsweep.plots.labels import MINUS, TIMES, number_text
from ringsweep.plots.rig import Rig, ring_history
from ringsweep.plots.style import (
    PAIR_COLOURS,
    REST,
    SMALL,
    angle_unit,
    arc_colour,
    arc_names,
    axes_or_current,
    figure_width,
    is_narrow,
    on_page,
    page_colour,
    place_legend,
)
from ringsweep.quantities.parameters import Parameter
from ringsweep.quantities.units import quantity

#: Arrows whose lengths are in the units of the axes.
ARROWS: dict[str, Any] = {"angles": "xy", "scale_units": "xy", "scale": 1.0, "minlength": 0.1, "zorder": 6}

# Length of an arrow below which it has no name, as a multiple of the radius of the ring: the name would hide it.
_SHORTEST = 0.04

# Length from which on the tip of a friction force is outside the ring, as a multiple of its radius.
_LONG = 0.6


def polar_view(ds: xr.Dataset, time: float | str, ax: Axes | None = None) -> Axes:
    """Draw the body in the ring at one instant, to scale, with all forces.

    Angles count from the downward vertical, counter-clockwise. A mark shows the angle θ of the ring, and an arrow
    beside it the sense in which the ring turns. Arrows have the names of their forces: normal reactions N, friction
    forces F, weight Mg. Reactions and weight have one scale in all pictures of a run; friction forces, which are
    smaller, are longer by the factor beside their scale. They follow from the balances of momentum, in stick too.

    Parameters
    ----------
    ds : xarray.Dataset
        Result of :func:`ringsweep.simulate` on a ring.
    time : float or str
        Instant: a plain number is in seconds, text may have a unit.
    ax : matplotlib.axes.Axes, optional
        Axes to draw in, by default pyplot's current ones. The legend stands below them: a figure with
        ``layout="constrained"`` makes room for it.

    Returns
    -------
    matplotlib.axes.Axes

    Raises
    ------
    InputError
        If the dataset is not the history of one run on a ring, or `time` is no time within the run.

    Examples
    --------
    >>> import ringsweep
    >>> from matplotlib.figure import Figure
    >>> run = ringsweep.simulate("my-sweep.yaml")
    >>> polar_view(run, 1.5, Figure().add_subplot()).get_title()
    't = 1.5000 s, slip backward'
    """
    run, rig = ring_history(ds)
    first, last = run["time"].values[[0, -1]]
    time = quantity(time, Parameter("s", "time"), "time") if isinstance(time, str) else float(time)
    if not first <= time <= last:
        raise InputError("time", f"{time:g} s is not within the run, from {first:g} s to {last:.6g} s")
    ax = axes_or_current(ax, 1.2 if is_narrow(figure_width()) else 0.8)
    artists = RingArtists(ax, run, rig)
    artists.show(states_at(run, np.array([time])), 0)
    place_legend(ax, artists.legend_entries(), "below")
    return ax


def states_at(run: xr.Dataset, times: NDArray[np.float64]) -> dict[str, NDArray[Any]]:
    """State of a run at given times, by variable: numbers interpolated linearly, the mode of the sample before."""
    own = run["time"].values
    before = np.maximum(np.searchsorted(own, times, side="right") - 1, 0)
    states = {str(name): np.interp(times, own, one.values) for name, one in run.items() if one.dims == ("time",)}
    return states | {"time": times, "mode": run["mode"].values[before]}


class RingArtists:
    """Artists of the body and the ring. They are made once; :meth:`show` moves them to an instant."""

    def __init__(self, ax: Axes, run: xr.Dataset, rig: Rig):
        self.ax, self.rig = ax, rig
        self.weight = float(rig.body.mass * rig.body.gravity)
        self.reference = reference_force([run[f"normal_{k}"].values for k in rig.contacts], self.weight or 1.0)
        # Length of an arrow, m/N.
        self.scale = 0.75 * rig.radius / self.reference
        # Friction forces are small beside reactions, so a round factor magnifies them. Their peaks on a narrow
        # zone are no outliers: they must be shown.
        friction = reference_force([np.abs(run[f"friction_{k}"].values) for k in rig.contacts], 0.0, outlier=6.0)
        self.magnification = max(1.0, float(f"{1.5 * self.reference / friction:.0e}")) if friction else 1.0

        R = rig.radius
        ax.set_aspect("equal")
        ax.set_axis_off()
        ax.set_xlim(-1.55 * R, 1.55 * R)
        ax.set_ylim(-2.0 * R, 1.5 * R)
        edge, ink = on_page("0.3"), on_page("black")
        surface: dict[str, Any] = {"width": 0.1 * R, "edgecolor": edge}
        ax.add_patch(Wedge((0.0, 0.0), 1.1 * R, 0.0, 360.0, facecolor=on_page(REST), zorder=1, **surface))
        self._draw_angles()
        self.arcs = []
        for k, (_, half_angle) in enumerate(rig.arcs, start=1):
            wedge = Wedge((0.0, 0.0), 1.1 * R, 0.0, 1.0, facecolor=arc_colour(k), **surface)
            wedge.set(zorder=2, visible=half_angle > 0.0)
            self.arcs.append(wedge)
        self.mark = Polygon(np.zeros((3, 2)), facecolor=on_page("0.2"), edgecolor="none", zorder=3)
        self.turning = Polygon(np.zeros((3, 2)), facecolor=on_page("0.2"), edgecolor="none", zorder=3)
        (self.turn,) = ax.plot([], [], color=on_page("0.2"), linewidth=1.2, zorder=3)
        (self.rod,) = ax.plot([], [], color=on_page("0.45"), linewidth=4, solid_capstyle="round", zorder=3)
        self.balls = []
        for _ in rig.contacts:
            ball = Circle((0.0, 0.0), rig.ball, facecolor=on_page("0.85"), edgecolor=on_page("0.2"), zorder=4)
            ball.set_linewidth(1.2)
            self.balls.append(ball)
        for patch in (*self.arcs, self.mark, self.turning, *self.balls):
            ax.add_patch(patch)
        # A single contact needs no number.
        texts = [str(k) if len(rig.contacts) > 1 else "" for k in rig.contacts]
        self.numbers = [ax.text(0.0, 0.0, text, ha="center", va="center", fontsize=SMALL, zorder=5) for text in texts]
        (self.centre,) = ax.plot([], [], marker="o", markersize=4, color=ink, linestyle="", zorder=5)
        halo = withStroke(linewidth=2.0, foreground=page_colour())
        colours = [on_page(PAIR_COLOURS[k - 1]) for k in rig.contacts]
        self.reactions = self._arrows(colours, 0.032)
        self.frictions = self._arrows(colours, 0.016)
        self.gravity = self._arrows([ink], 0.016)
        marks = [f"_{k}" if text else "" for k, text in zip(rig.contacts, texts, strict=True)]
        names = [*(f"$N{mark}$" for mark in marks), *(f"$F{mark}$" for mark in marks), "$Mg$"]
        self.names = [
            ax.text(0.0, 0.0, name, color=colour, ha="center", va="center", zorder=8, path_effects=[halo])
            for name, colour in zip(names, [*colours, *colours, ink], strict=True)
        ]
        self._draw_scale_bars()
        self.speeds = ax.text(0.5, 0.0, "", transform=ax.transAxes, ha="center", va="bottom", fontsize=SMALL)
        ax.set_title(" ", fontsize="medium")

    def show(self, states: dict[str, NDArray[Any]], k: int) -> None:
        """Move all artists to the `k`-th state of :func:`states_at`."""
        rig, R = self.rig, self.rig.radius
        theta = float(states["theta"][k])
        ring_omega, omega = float(states["ring_omega"][k]), float(states["omega"][k])
        for wedge, (center, half_angle) in zip(self.arcs, rig.arcs, strict=True):
            middle = theta + center
            # Matplotlib counts angles from the horizontal.
            wedge.set_theta1(math.degrees(middle - half_angle) - 90.0)
            wedge.set_theta2(math.degrees(middle + half_angle) - 90.0)
        self.mark.set_xy([_point(1.12 * R, theta), _point(1.22 * R, theta - 0.05), _point(1.22 * R, theta + 0.05)])
        # The arrow begins at the mark.
        sense = float(np.sign(ring_omega))
        along = theta + sense * np.linspace(0.09, 0.36, 20)
        self.turn.set_data(*_point(1.18 * R, along))
        end, tip = theta + sense * 0.34, theta + sense * 0.46
        self.turning.set_xy([_point(1.18 * R, tip), _point(1.14 * R, end), _point(1.22 * R, end)])
        for artist in (self.turn, self.turning):
            artist.set_visible(sense != 0.0)
        contacts = np.array([_point(R, states[f"alpha_{c}"][k]) for c in rig.contacts])
        gaps = np.array([states[f"gap_{c}"][k] if f"gap_{c}" in states else 0.0 for c in rig.contacts])
        centres = contacts * (1.0 - (rig.ball + gaps) / R)[:, None]
        self.rod.set_data(*centres.T)
        inwards = -contacts / R
        forwards = np.column_stack([inwards[:, 1], -inwards[:, 0]])
        for c, ball, number, at, forward in zip(rig.contacts, self.balls, self.numbers, centres, forwards, strict=True):
            ball.set_center(tuple(at))
            # The arrow of the reaction passes through the centre of the ball.
            number.set_position(tuple(at + (0.55 if c == 2 else -0.55) * rig.ball * forward))
        centre_of_mass = np.array([states["x"][k], states["y"][k]])
        self.centre.set_data(*centre_of_mass[:, None])
        normals = np.array([states[f"normal_{c}"][k] for c in rig.contacts])
        frictions = np.array([states[f"friction_{c}"][k] for c in rig.contacts])
        reactions = inwards * (normals * self.scale)[:, None]
        frictions = forwards * (frictions * self.scale * self.magnification)[:, None]
        weight = np.array([[0.0, -self.weight * self.scale]])
        _set_arrows(self.reactions, contacts, reactions)
        _set_arrows(self.frictions, contacts, frictions)
        _set_arrows(self.gravity, centre_of_mass[None], weight)
        starts = np.concatenate([contacts, contacts])
        *names, weight_name = self.names
        for j, (name, start, arrow) in enumerate(
            zip(names, starts, np.concatenate([reactions, frictions]), strict=True)
        ):
            length = float(np.hypot(*arrow))
            name.set_visible(length > _SHORTEST * R)
            if not name.get_visible():
                continue
            c = j % len(contacts)
            if j < len(contacts):
                # The ball would hide the name of a short reaction.
                beyond = max(length, 2.0 * rig.ball + gaps[c])
                name.set_position(tuple(start + arrow * ((beyond + 0.12 * R) / length)))
            elif length < _LONG * R:
                # Beside ball and rim, in the free space within the ring.
                away = max(length / R + 0.06, 0.15 + rig.ball / R) * float(np.sign(arrow @ forwards[c]))
                name.set_position(_point(0.87 * R, float(states[f"alpha_{rig.contacts[c]}"][k]) + away))
            else:
                name.set_position(tuple(start + arrow * (1.0 + 0.12 * R / length)))
        # At the tip would be the number of the angle 0.
        weight_name.set_position(tuple(centre_of_mass + 0.6 * weight[0] + (0.13 * R, 0.0)))
        weight_name.set_visible(self.weight > 0.0)
        self.ax.set_title(f"t = {states['time'][k]:.4f} s, {mode_name(states['mode'][k])}", fontsize="medium")
        self.speeds.set_text(
            f"body {number_text(omega, '+.2f')} rad s⁻¹, ring {number_text(ring_omega, '+.2f')} rad s⁻¹"
        )

    @property
    def moving(self) -> list[Artist]:
        """Artists that :meth:`show` changes."""
        arrows = [self.reactions, self.frictions, self.gravity]
        body = [self.rod, *self.balls, *self.numbers, self.centre]
        ring = [*self.arcs, self.mark, self.turn, self.turning]
        return [*ring, *body, *arrows, *self.names, self.speeds, self.ax.title]

    def legend_entries(self) -> list[Artist]:
        """Legend entries of the surfaces and the mark; arrows have their names beside them."""
        entries: list[Artist] = [
            Patch(facecolor=arc_colour(k), edgecolor=on_page("0.3"), label=name)
            for k, name in enumerate(arc_names(len(self.rig.arcs)), start=1)
        ]
        entries.append(Patch(facecolor=on_page(REST), edgecolor=on_page("0.3"), label="elsewhere"))
        style: dict[str, Any] = {"marker": "v", "color": on_page("0.2"), "linestyle": "", "markersize": 5}
        return [*entries, Line2D([], [], label="angle θ of the ring", **style)]

    def _draw_angles(self) -> None:
        """Ticks and labels of angles around the ring."""
        R = self.rig.radius
        for angle in range(0, 360, 15):
            inner, outer = _point(1.1 * R, math.radians(angle)), _point(1.13 * R, math.radians(angle))
            self.ax.plot(*zip(inner, outer, strict=True), color=on_page("0.5"), linewidth=0.6, zorder=1)
        degrees = {angle: number_text(angle, "d") + "°" for angle in (0, 90, 180, -90)}
        radians = {0: "0", 90: "π/2", 180: "π", -90: f"{MINUS}π/2"}
        for angle, name in (degrees if angle_unit()[1] == "°" else radians).items():
            x, y = _point(1.37 * R, math.radians(angle))
            self.ax.text(x, y, name, fontsize=SMALL, color=on_page("0.35"), ha="center", va="center", zorder=7)

    def _arrows(self, colours: list[str], width: float) -> Quiver:
        """An arrow of each colour; `width` is a multiple of the radius of the ring."""
        # With long heads short arrows would all look alike.
        look = ARROWS | {"headwidth": 3.2, "headlength": 3.6, "headaxislength": 3.2, "width": width * self.rig.radius}
        return self.ax.quiver(*np.zeros((4, len(colours))), color=colours, units="xy", **look)

    def _draw_scale_bars(self) -> None:
        """Bars of round forces and of a round length below the ring."""
        R = self.rig.radius
        y = -1.62 * R
        force, length = round_down(0.75 * self.reference), round_down(0.5 * R)
        magnified = self.magnification > 1.0
        bars = [(force * self.scale, f"{force:g} N", "$N$, $Mg$" if magnified else "$N$, $F$, $Mg$")]
        if magnified:
            friction = round_down(0.75 * self.reference / self.magnification)
            extent = friction * self.scale * self.magnification
            bars.append((extent, f"{friction:g} N", f"$F$ ({TIMES}{self.magnification:g})"))
        bars.append((length, f"{1000 * length:g} mm", ""))
        style: dict[str, Any] = {"color": on_page("0.3"), "linewidth": 1.2}
        for x, (extent, text, what) in zip((-1.4 * R, -0.35 * R, 0.7 * R), bars, strict=False):
            self.ax.plot([x, x + extent], [y, y], marker="|", **style)
            self.ax.text(x + extent / 2, y + 0.05 * R, text, ha="center", va="bottom", fontsize=SMALL)
            self.ax.text(x + extent / 2, y - 0.08 * R, what, ha="center", va="top", fontsize=SMALL)


def _point(radius: float, angle: Any) -> tuple[Any, Any]:
    """Point at an angle, or points at several, from the downward vertical, counter-clockwise."""
    return radius * np.sin(angle), -radius * np.cos(angle)


def _set_arrows(arrows: Quiver, points: NDArray[Any], vectors: NDArray[Any]) -> None:
    arrows.set_offsets(points)
    arrows.set_UVC(*vectors.T)


def reference_force(forces: list[NDArray[Any]], default: float, outlier: float = 3.0) -> float:
    """Force that sets the scale of the arrows, N: the greatest, or the 95th percentile if the greatest is an outlier.

    An outlier is at least `outlier` times the 95th percentile. If all forces are zero, the result is `default`.
    """
    finite = np.concatenate(forces)
    finite = finite[np.isfinite(finite)]
    usual = float(np.percentile(finite, 95)) if finite.size else 0.0
    greatest = float(finite.max(initial=0.0))
    return (greatest if greatest < outlier * usual else usual) or default


def round_down(value: float) -> float:
    """The greatest of 1, 2, 5, 10, ... that is not above `value`."""
    power = 10.0 ** math.floor(math.log10(value))
    return next(digit * power for digit in (5.0, 2.0, 1.0) if digit * power <= value * (1.0 + 1e-12))
