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
from matplotlib.quiver import Quiver
from numpy.typing import NDArray

from ringsweep.errors import InputError
from ringsweep.plots.datasets import present
from ringsweep.plots.labels import number_text
from ringsweep.plots.rig import Rig, mode_name, ring_history
from ringsweep.plots.style import PAIR_COLOURS, REST, SMALL, arc_colour, arc_names, axes_or_current, legend_beside

TIMES = "\N{MULTIPLICATION SIGN}"


def polar_view(ds: xr.Dataset, time: float, ax: Axes | None = None) -> Axes:
    """Draw the body in the ring at one instant, to scale, with all forces.

    Angles count from the downward vertical, counter-clockwise. A mark on the ring shows its angle and the direction
    in which it turns. Arrows of reactions and of the weight have one scale in all pictures of a run. Arrows of
    friction forces are longer by a factor that the legend gives. The friction forces follow from the balances of
    momentum, in stick too.

    Parameters
    ----------
    ds : xarray.Dataset
        Result of :func:`ringsweep.simulate` on a ring.
    time : float
        Instant, s.
    ax : matplotlib.axes.Axes, optional
        Axes to draw in, by default pyplot's current ones. The legend stands beside them: a figure with
        ``layout="constrained"`` makes room for it.

    Returns
    -------
    matplotlib.axes.Axes

    Raises
    ------
    InputError
        If the dataset is not the history of one run on a ring, or `time` is not within the run.

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
    if not first <= time <= last:
        raise InputError("time", f"{time:g} s is not within the run, from {first:g} s to {last:.6g} s")
    ax = axes_or_current(ax, (6.6, 5.2))
    artists = RingArtists(ax, run, rig)
    artists.show(states_at(run, np.array([time])), 0)
    legend_beside(ax, artists.legend_entries())
    return ax


def states_at(run: xr.Dataset, times: NDArray[np.float64]) -> dict[str, NDArray[Any]]:
    """State of a run at given times, by variable: numbers interpolated linearly, the mode of the sample before."""
    own = run["time"].values
    before = np.maximum(np.searchsorted(own, times, side="right") - 1, 0)
    states: dict[str, NDArray[Any]] = {"time": times, "mode": run["mode"].values[before]}
    ring = ("phi", "theta", "omega", "ring_omega", "normal_1", "normal_2", "friction_1", "friction_2")
    belt = ("x", "velocity", "friction_force", "belt_x", "belt_velocity")
    return states | {name: np.interp(times, own, run[name].values) for name in present(run, (*ring, *belt))}


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
        ax.set_xlim(-1.45 * R, 1.45 * R)
        ax.set_ylim(-1.75 * R, 1.4 * R)
        ax.add_patch(Wedge((0.0, 0.0), 1.1 * R, 0.0, 360.0, width=0.1 * R, facecolor=REST, edgecolor="0.3", zorder=1))
        self._draw_angles()
        self.arcs = []
        for k, (_, half_angle) in enumerate(rig.arcs, start=1):
            wedge = Wedge((0.0, 0.0), 1.1 * R, 0.0, 1.0, width=0.1 * R, facecolor=arc_colour(k), edgecolor="0.3")
            wedge.set(zorder=2, visible=half_angle > 0.0)
            self.arcs.append(wedge)
        self.mark = Polygon(np.zeros((3, 2)), facecolor="0.2", edgecolor="none", zorder=3)
        (self.rod,) = ax.plot([], [], color="0.45", linewidth=4, solid_capstyle="round", zorder=3)
        self.balls = []
        for _ in rig.contacts:
            ball = Circle((0.0, 0.0), rig.ball, facecolor="0.85", edgecolor="0.2", linewidth=1.2, zorder=4)
            self.balls.append(ball)
        for patch in (*self.arcs, self.mark, *self.balls):
            ax.add_patch(patch)
        # A single contact needs no number.
        texts = [str(k) if len(rig.contacts) > 1 else "" for k in rig.contacts]
        self.numbers = [ax.text(0.0, 0.0, text, ha="center", va="center", fontsize=SMALL, zorder=5) for text in texts]
        (self.centre,) = ax.plot([], [], marker="o", markersize=4, color="black", linestyle="", zorder=5)
        colours = [PAIR_COLOURS[k - 1] for k in rig.contacts]
        self.reactions = self._arrows(colours, 0.032)
        self.frictions = self._arrows(colours, 0.016)
        self.gravity = self._arrows(["black"], 0.016)
        self._draw_scale_bars()
        self.speeds = ax.text(0.5, 0.0, "", transform=ax.transAxes, ha="center", va="bottom", fontsize=9)
        ax.set_title(" ", fontsize=11)

    def show(self, states: dict[str, NDArray[Any]], k: int) -> None:
        """Move all artists to the `k`-th state of :func:`states_at`."""
        rig, R = self.rig, self.rig.radius
        phi, theta = float(states["phi"][k]), float(states["theta"][k])
        ring_omega, omega = float(states["ring_omega"][k]), float(states["omega"][k])
        for wedge, (center, half_angle) in zip(self.arcs, rig.arcs, strict=True):
            middle = theta + center
            # Matplotlib counts angles from the horizontal.
            wedge.set_theta1(math.degrees(middle - half_angle) - 90.0)
            wedge.set_theta2(math.degrees(middle + half_angle) - 90.0)
        lean = 0.07 * np.sign(ring_omega)
        self.mark.set_xy(
            [_point(1.11 * R, theta - 0.03), _point(1.2 * R, theta + lean), _point(1.11 * R, theta + 0.03)]
        )
        contacts = np.array([_point(R, phi + rig.offset(c)) for c in rig.contacts])
        centres = contacts * (1.0 - rig.ball / R)
        self.rod.set_data(*centres.T)
        inwards = -contacts / R
        forwards = np.column_stack([inwards[:, 1], -inwards[:, 0]])
        for c, ball, number, at, forward in zip(rig.contacts, self.balls, self.numbers, centres, forwards, strict=True):
            ball.set_center(tuple(at))
            # The arrow of the reaction passes through the centre of the ball.
            number.set_position(tuple(at + (0.55 if c == 2 else -0.55) * rig.ball * forward))
        centre_of_mass = centres.mean(axis=0)
        self.centre.set_data(*centre_of_mass[:, None])
        normals = np.array([states[f"normal_{c}"][k] for c in rig.contacts])
        frictions = np.array([states[f"friction_{c}"][k] for c in rig.contacts])
        _set_arrows(self.reactions, contacts, inwards * (normals * self.scale)[:, None])
        _set_arrows(self.frictions, contacts, forwards * (frictions * self.scale * self.magnification)[:, None])
        _set_arrows(self.gravity, centre_of_mass[None], np.array([[0.0, -self.weight * self.scale]]))
        self.ax.set_title(f"t = {states['time'][k]:.4f} s, {mode_name(states['mode'][k])}", fontsize=11)
        self.speeds.set_text(
            f"body {number_text(omega, '+.2f')} rad s⁻¹, ring {number_text(ring_omega, '+.2f')} rad s⁻¹"
        )

    @property
    def moving(self) -> list[Artist]:
        """Artists that :meth:`show` changes."""
        arrows = [self.reactions, self.frictions, self.gravity]
        body = [self.rod, *self.balls, *self.numbers, self.centre]
        return [*self.arcs, self.mark, *body, *arrows, self.speeds, self.ax.title]

    def legend_entries(self) -> list[Artist]:
        """Legend entries of all colours and arrows."""
        entries: list[Artist] = [
            Patch(facecolor=arc_colour(k), edgecolor="0.3", label=name)
            for k, name in enumerate(arc_names(len(self.rig.arcs)), start=1)
        ]
        entries.append(Patch(facecolor=REST, edgecolor="0.3", label="elsewhere"))
        for c in self.rig.contacts:
            contact = f" at {c}" if len(self.rig.contacts) > 1 else ""
            factor = f", {TIMES}{self.magnification:g}" if self.magnification > 1.0 else ""
            for label, width in (("reaction" + contact, 3.5), ("friction" + contact + factor, 1.6)):
                entries.append(Line2D([], [], color=PAIR_COLOURS[c - 1], linewidth=width, label=label))
        entries.append(Line2D([], [], color="black", linewidth=1.6, label="weight"))
        style: dict[str, Any] = {"marker": "^", "color": "0.2", "linestyle": "", "markersize": 5}
        return [*entries, Line2D([], [], label="mark on the ring", **style)]

    def _draw_angles(self) -> None:
        """Ticks and labels of angles around the ring."""
        R = self.rig.radius
        for angle in range(0, 360, 15):
            inner, outer = _point(1.1 * R, math.radians(angle)), _point(1.13 * R, math.radians(angle))
            self.ax.plot(*zip(inner, outer, strict=True), color="0.5", linewidth=0.6, zorder=1)
        for angle in (0, 90, 180, -90):
            x, y = _point(1.3 * R, math.radians(angle))
            text = self.ax.text(x, y, number_text(angle, "d") + "°", fontsize=SMALL, color="0.35", zorder=7)
            text.set(ha="center", va="center", bbox={"facecolor": "white", "edgecolor": "none", "pad": 0.5})

    def _arrows(self, colours: list[str], width: float) -> Quiver:
        """An arrow of each colour; `width` is a multiple of the radius of the ring."""
        return self.ax.quiver(
            *np.zeros((4, len(colours))),
            color=colours,
            angles="xy",
            scale_units="xy",
            scale=1.0,
            units="xy",
            width=width * self.rig.radius,
            # With long heads short arrows would all look alike.
            minlength=0.1,
            headwidth=3.2,
            headlength=3.6,
            headaxislength=3.2,
            zorder=6,
        )

    def _draw_scale_bars(self) -> None:
        """A bar of a round force and one of a round length below the ring."""
        R = self.rig.radius
        y = -1.5 * R
        force, length = round_down(0.75 * self.reference), round_down(0.5 * R)
        style: dict[str, Any] = {"color": "0.3", "linewidth": 1.2}
        for x, extent, text in (
            (-1.2 * R, force * self.scale, f"{force:g} N"),
            (0.35 * R, length, f"{1000 * length:g} mm"),
        ):
            self.ax.plot([x, x + extent], [y, y], marker="|", **style)
            self.ax.text(x + extent / 2, y + 0.04 * R, text, ha="center", va="bottom", fontsize=SMALL)


def _point(radius: float, angle: float) -> tuple[float, float]:
    """Point at an angle from the downward vertical, counter-clockwise."""
    return radius * math.sin(angle), -radius * math.cos(angle)


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
