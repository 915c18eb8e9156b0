"""The body in the ring at an instant, to scale, with all forces; and on the belt, above its phase portrait."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import xarray as xr
from matplotlib import lines, patches, patheffects, quiver
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.text import Text
from numpy.typing import NDArray

from ringsweep.errors import InputError
from ringsweep.plots import look
from ringsweep.plots.datasets import mode_name
from ringsweep.plots.labels import MINUS, TIMES, number_text
from ringsweep.plots.phase import draw_belt_portrait
from ringsweep.plots.rig import Rig, has_spring, ring_history
from ringsweep.quantities.parameters import Parameter
from ringsweep.quantities.units import quantity
from ringsweep.runs.events import history_at

#: Arrows whose lengths are in the units of the axes.
ARROWS: dict[str, Any] = {"angles": "xy", "scale_units": "xy", "scale": 1.0, "minlength": 0.1, "zorder": 6}

# Length of an arrow below which it has no name, as a multiple of the radius of the ring: the name would hide it.
_SHORTEST = 0.04

# Length from which on the tip of a friction force is outside the ring, as a multiple of its radius.
_LONG = 0.6


# Heights in the picture, where the body stands on the belt at 0.
_BODY, _SPRING, _BELT, _ARROW = 0.5, 0.25, -0.18, 0.08

_FRICTION = "#009E73"


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
    ax = look.axes_or_current(ax, 1.2 if look.is_narrow(look.figure_width()) else 0.8)
    artists = RingArtists(ax, run, rig)
    artists.show(states_at(run, np.array([time])), 0)
    look.place_legend(ax, artists.entries, "below")
    return ax


def states_at(run: xr.Dataset, times: NDArray[np.float64]) -> dict[str, NDArray[Any]]:
    """State of a run at given times, by variable."""
    found = history_at(run[[name for name, one in run.items() if one.dims == ("time",)]], times)
    return {str(name): one.values for name, one in found.variables.items()}


class Instant:
    """Artists of a body at an instant. They are made once, and moved."""

    def __init__(self, ax: Axes):
        self.ax = ax
        ax.set_axis_off()
        ax.set_title(" ", fontsize="medium")
        self.speeds = self.write(0.5, 0.0, "", transform=ax.transAxes, va="bottom")

    def write(self, x: float, y: float, text: str, **style: Any) -> Text:
        """A small text in the middle of a place."""
        return self.ax.text(x, y, text, **{"ha": "center", "va": "center", "fontsize": look.SMALL} | style)

    def name_of_force(self, name: str, colour: Any) -> Text:
        """A name beside an arrow, visible on whatever lies below."""
        halo = patheffects.withStroke(linewidth=2.0, foreground=look.page_colour())
        return self.write(0.0, 0.0, name, fontsize=None, color=colour, zorder=8, path_effects=[halo])

    def draw_bar(self, left: float, y: float, length: float, texts: tuple[str, str], away: tuple[float, float]) -> None:
        """Draw a scale bar with these texts this far above and below it."""
        self.ax.plot([left, left + length], [y, y], marker="|", color=look.on_page("0.3"), linewidth=1.2)
        self.write(left + length / 2, y + away[0], texts[0], va="bottom")
        self.write(left + length / 2, y - away[1], texts[1], va="top")

    def tell(self, states: dict[str, NDArray[Any]], k: int, names: dict[str, str], digits: int, unit: str) -> None:
        """Write time and mode, and speeds: what moves by the variable."""
        self.ax.set_title(f"t = {states['time'][k]:.4f} s, {mode_name(states['mode'][k])}", fontsize="medium")
        texts = [f"{what} {number_text(states[name][k], f'+.{digits}f')} {unit}" for name, what in names.items()]
        self.speeds.set_text(", ".join(texts))


class RingArtists(Instant):
    """Artists of the body and the ring. :meth:`show` moves them to an instant."""

    def __init__(self, ax: Axes, run: xr.Dataset, rig: Rig):
        super().__init__(ax)
        self.rig = rig
        self.weight = float(rig.body.mass * rig.body.gravity)
        self.reference = reference_force([run[f"normal_{k}"].values for k in rig.contacts], self.weight or 1.0)
        # Length of an arrow, m/N.
        self.scale = 0.75 * rig.radius / self.reference
        # Friction forces are small beside reactions, so a round factor magnifies them. Their peaks on a narrow
        # zone are no outliers: they must be shown.
        friction = reference_force([np.abs(run[f"friction_{k}"].values) for k in rig.contacts], 0.0, outlier=6.0)
        self.magnification = max(1.0, float(f"{1.5 * self.reference / friction:.0e}")) if friction else 1.0

        R = rig.radius
        ax.set(aspect="equal", xlim=(-1.55 * R, 1.55 * R), ylim=(-2.0 * R, 1.5 * R))
        edge, dark, ink = map(look.on_page, ("0.3", "0.2", "black"))
        surface: dict[str, Any] = {"width": 0.1 * R, "edgecolor": edge}
        race = patches.Wedge((0.0, 0.0), 1.1 * R, 0.0, 360.0, facecolor=look.on_page(look.REST), zorder=1, **surface)
        self._draw_angles()
        self.arcs = []
        surfaces = look.arcs(len(rig.arcs))
        for (_, colour), (_, half_angle) in zip(surfaces, rig.arcs, strict=True):
            wedge = patches.Wedge((0.0, 0.0), 1.1 * R, 0.0, 1.0, facecolor=colour, **surface)
            wedge.set(zorder=2, visible=half_angle > 0.0)
            self.arcs.append(wedge)
        triangle: dict[str, Any] = {"xy": np.zeros((3, 2)), "facecolor": dark, "edgecolor": "none", "zorder": 3}
        self.mark, self.turning = patches.Polygon(**triangle), patches.Polygon(**triangle)
        (self.turn,) = ax.plot([], [], color=dark, linewidth=1.2, zorder=3)
        (self.rod,) = ax.plot([], [], color=look.on_page("0.45"), linewidth=4, solid_capstyle="round", zorder=3)
        ball: dict[str, Any] = {"facecolor": look.on_page("0.85"), "edgecolor": dark, "linewidth": 1.2, "zorder": 4}
        self.balls = [patches.Circle((0.0, 0.0), rig.ball, **ball) for _ in rig.contacts]
        for patch in (race, *self.arcs, self.mark, self.turning, *self.balls):
            ax.add_patch(patch)
        # A single contact needs no number.
        texts = [str(k) if len(rig.contacts) > 1 else "" for k in rig.contacts]
        self.numbers = [self.write(0.0, 0.0, text, zorder=5) for text in texts]
        (self.centre,) = ax.plot([], [], marker="o", markersize=4, color=ink, linestyle="", zorder=5)
        colours = [look.pair(k - 1) for k in rig.contacts]
        self.reactions = self._arrows(colours, 0.032)
        self.frictions = self._arrows(colours, 0.016)
        self.gravity = self._arrows([ink], 0.016)
        forces = [f"${force}{text and f'_{text}'}$" for force in "NF" for text in texts]
        pairs = zip([*forces, "$Mg$"], [*colours, *colours, ink], strict=True)
        self.names = [self.name_of_force(name, colour) for name, colour in pairs]
        self._draw_scale_bars()
        surfaces.append(("elsewhere", look.on_page(look.REST)))
        #: Entries of a legend for the surfaces and the mark; arrows have their names beside them.
        self.entries: list[Artist] = [patches.Patch(fc=colour, ec=edge, label=name) for name, colour in surfaces]
        angle: dict[str, Any] = {"marker": "v", "color": dark, "linestyle": "", "markersize": 5}
        self.entries.append(lines.Line2D([], [], label="angle θ of the ring", **angle))
        #: Artists that :meth:`show` changes.
        self.moving: list[Artist] = [*self.arcs, self.mark, self.turn, self.turning, self.rod, *self.balls]
        self.moving += [*self.numbers, self.centre, self.reactions, self.frictions, self.gravity]
        self.moving += [*self.names, self.speeds, ax.title]

    def show(self, states: dict[str, NDArray[Any]], k: int) -> None:
        """Move all artists to the `k`-th state of :func:`states_at`."""
        self._show_ring(float(states["theta"][k]), float(np.sign(states["ring_omega"][k])))
        rig, R = self.rig, self.rig.radius
        angles = np.array([states[f"alpha_{c}"][k] for c in rig.contacts])
        contacts = np.column_stack(_point(R, angles))
        gaps = np.array([states[f"gap_{c}"][k] if f"gap_{c}" in states else 0.0 for c in rig.contacts])
        centres = contacts * (1.0 - (rig.ball + gaps) / R)[:, None]
        self.rod.set_data(*centres.T)
        inwards = -contacts / R
        forwards = np.column_stack([inwards[:, 1], -inwards[:, 0]])
        for side, ball, number, at, forward in zip((-1, 1), self.balls, self.numbers, centres, forwards, strict=False):
            ball.set_center(tuple(at))
            # The arrow of the reaction passes through the centre of the ball.
            number.set_position(tuple(at + 0.55 * side * rig.ball * forward))
        centre = np.array([states["x"][k], states["y"][k]])
        self.centre.set_data(*centre[:, None])
        reactions, frictions = (
            np.array([states[f"{name}_{c}"][k] * self.scale * way for c, way in zip(rig.contacts, ways, strict=True)])
            for name, ways in (("normal", inwards), ("friction", self.magnification * forwards))
        )
        weight = np.array([0.0, -self.weight * self.scale])
        for arrows, points, vectors in (
            (self.reactions, contacts, reactions),
            (self.frictions, contacts, frictions),
            (self.gravity, centre[None], weight[None]),
        ):
            arrows.set_offsets(points)
            arrows.set_UVC(*vectors.T)
        count = len(contacts)
        for j, (name, arrow) in enumerate(zip(self.names, [*reactions, *frictions], strict=False)):
            c, length = j % count, float(np.hypot(*arrow))
            name.set_visible(length > _SHORTEST * R)
            if not name.get_visible():
                continue
            if j >= count and length < _LONG * R:
                # Beside ball and rim, in the free space within the ring.
                away = max(length / R + 0.06, 0.15 + rig.ball / R) * float(np.sign(arrow @ forwards[c]))
                name.set_position(_point(0.87 * R, angles[c] + away))
            else:
                # The ball would hide the name of a short reaction.
                tip = length if j >= count else max(length, 2.0 * rig.ball + gaps[c])
                name.set_position(tuple(contacts[c] + arrow * ((tip + 0.12 * R) / length)))
        # At the tip would be the number of the angle 0.
        self.names[-1].set(position=tuple(centre + 0.6 * weight + (0.13 * R, 0.0)), visible=self.weight > 0.0)
        self.tell(states, k, {"omega": "body", "ring_omega": "ring"}, 2, "rad s⁻¹")

    def _show_ring(self, theta: float, sense: float) -> None:
        """Turn the ring to an angle; `sense` is the sign of its angular velocity."""
        R = self.rig.radius
        for wedge, (center, half_angle) in zip(self.arcs, self.rig.arcs, strict=True):
            # Matplotlib counts angles from the horizontal.
            ends = np.degrees(theta + center + np.array([-half_angle, half_angle])) - 90.0
            wedge.set(theta1=ends[0], theta2=ends[1])
        self.mark.set_xy([_point(1.12 * R, theta), _point(1.22 * R, theta - 0.05), _point(1.22 * R, theta + 0.05)])
        # The arrow begins at the mark.
        self.turn.set_data(*_point(1.18 * R, theta + sense * np.linspace(0.09, 0.36, 20)))
        end, tip = theta + sense * 0.34, theta + sense * 0.46
        self.turning.set_xy([_point(1.18 * R, tip), _point(1.14 * R, end), _point(1.22 * R, end)])
        for artist in (self.turn, self.turning):
            artist.set_visible(sense != 0.0)

    def _draw_angles(self) -> None:
        """Ticks and labels of angles around the ring."""
        R = self.rig.radius
        for angle in np.radians(range(0, 360, 15)):
            ends = zip(_point(1.1 * R, angle), _point(1.13 * R, angle), strict=True)
            self.ax.plot(*ends, color=look.on_page("0.5"), linewidth=0.6, zorder=1)
        degrees = {angle: number_text(angle, "d") + "°" for angle in (0, 90, 180, -90)}
        radians = {0: "0", 90: "π/2", 180: "π", -90: f"{MINUS}π/2"}
        for angle, name in (degrees if look.angle_unit()[1] == "°" else radians).items():
            self.write(*_point(1.37 * R, math.radians(angle)), name, color=look.on_page("0.35"), zorder=7)

    def _arrows(self, colours: list[str], width: float) -> quiver.Quiver:
        """An arrow of each colour; `width` is a multiple of the radius of the ring."""
        # With long heads short arrows would all look alike.
        arrow = ARROWS | {"headwidth": 3.2, "headlength": 3.6, "headaxislength": 3.2, "width": width * self.rig.radius}
        return self.ax.quiver(*np.zeros((4, len(colours))), color=colours, units="xy", **arrow)

    def _draw_scale_bars(self) -> None:
        """Bars of round forces and of a round length below the ring."""
        R, factor = self.rig.radius, self.magnification
        force, length = round_down(0.75 * self.reference), round_down(0.5 * R)
        bars = [(force * self.scale, f"{force:g} N", "$N$, $Mg$" if factor > 1.0 else "$N$, $F$, $Mg$")]
        if factor > 1.0:
            friction = round_down(0.75 * self.reference / factor)
            bars.append((friction * self.scale * factor, f"{friction:g} N", f"$F$ ({TIMES}{factor:g})"))
        bars.append((length, f"{1000 * length:g} mm", ""))
        for x, (extent, *texts) in zip((-1.4 * R, -0.35 * R, 0.7 * R), bars, strict=False):
            self.draw_bar(x, -1.62 * R, extent, (texts[0], texts[1]), (0.05 * R, 0.08 * R))


class BeltArtists(Instant):
    """Artists of the body and the belt, and a dot in the phase portrait below. :meth:`show` moves them to an instant.

    Places across are to scale, in m; both axes have the same range. Heights mean nothing.
    """

    def __init__(self, pair: tuple[Axes, Axes], run: xr.Dataset):
        ax, below = pair
        super().__init__(ax)
        #: Entries of a legend for the phase portrait; the arrow has its name beside it.
        self.entries = draw_belt_portrait(below, run)
        x = run["x"].values
        # The place of the relaxed spring is always in view.
        low, high = min(0.0, float(x.min())), max(0.0, float(x.max()))
        self.range = (high - low) or 1.0
        self.half = 0.07 * self.range
        self.wall = low - 0.45 * self.range
        self.ends = left, right = self.wall - 0.05 * self.range, high + 0.35 * self.range
        self.spacing = 0.125 * (right - left)
        reference = reference_force([np.abs(run["friction_force"].values)], 1.0)
        # Length of an arrow, m/N.
        self.scale = 0.3 * self.range / reference
        speeds = np.abs([run["velocity"].values, run["belt_velocity"].values])
        self.digits = max(0, 2 - math.floor(math.log10(float(np.nanmax(speeds)) or 1.0)))

        ax.set_ylim(-0.65, 0.95)
        for axes in pair:
            axes.set_xlim(left, right)
        edge, dark, green = map(look.on_page, ("0.3", "0.2", _FRICTION))
        body: dict[str, Any] = {"facecolor": look.on_page("0.85"), "edgecolor": dark, "zorder": 4}
        self.body = patches.Rectangle((0.0, 0.0), 2 * self.half, _BODY, **body)
        belt = patches.Rectangle((left, _BELT), right - left, -_BELT, facecolor=look.on_page(look.REST), edgecolor=edge)
        wall = patches.Rectangle((left, 0.0), self.wall - left, 0.7, facecolor=look.on_page("0.8"), edgecolor=edge)
        for patch in (belt, wall, self.body):
            ax.add_patch(patch)
        (self.marks,) = ax.plot([], [], color=dark, linewidth=1.4, zorder=2)
        (self.spring,) = ax.plot([], [], color=edge, linewidth=1.2, zorder=3, visible=has_spring(run))
        if has_spring(run):
            ax.plot([0.0, 0.0], [0.0, 0.66], color=look.on_page("0.5"), linewidth=0.8, linestyle=":", zorder=1)
            self.write(0.0, 0.68, "spring relaxed", va="bottom", color=look.on_page("0.35"))
        self.friction = ax.quiver(*np.zeros((4, 1)), color=green, units="width", width=0.01, **ARROWS)
        self.name = self.name_of_force("$F$", green)
        force = round_down(0.75 * reference)
        bar = left + 0.03 * self.range, 0.78, force * self.scale
        self.draw_bar(*bar, (f"$F$: {force:g} N", ""), (0.04, 0.0))
        dot: dict[str, Any] = {"marker": "o", "markersize": 8, "markeredgewidth": 1.5, "markerfacecolor": look.pair(0)}
        (self.dot,) = below.plot([], [], color=look.on_page("black"), linestyle="", zorder=7, **dot)
        #: Artists that :meth:`show` changes.
        self.moving: list[Artist] = [self.marks, self.spring, self.body, self.friction, self.name]
        self.moving += [self.speeds, self.dot, ax.title]

    def show(self, states: dict[str, NDArray[Any]], k: int) -> None:
        """Move all artists to the `k`-th state of :func:`ringsweep.plots.polar.states_at`."""
        x, velocity, force = (float(states[name][k]) for name in ("x", "velocity", "friction_force"))
        self.body.set_x(x - self.half)
        self.spring.set_data(*_zigzag(self.wall, x - self.half))
        left, right = self.ends
        marks = np.arange(left + (float(states["belt_x"][k]) - left) % self.spacing, right, self.spacing)
        across = np.column_stack([marks, marks, np.full(len(marks), np.nan)]).ravel()
        self.marks.set_data(across, np.tile([_BELT, 0.0, np.nan], len(marks)))
        # The force counts positive against x.
        self.friction.set_offsets([(x, _ARROW)])
        self.friction.set_UVC([-force * self.scale], [0.0])
        # Beyond the tip of the arrow.
        self.name.set(x=x - force * self.scale - 0.03 * self.range * np.sign(force), y=_ARROW, visible=force != 0.0)
        self.name.set_horizontalalignment("right" if force > 0.0 else "left")
        self.tell(states, k, {"velocity": "body", "belt_velocity": "belt"}, self.digits, "m s⁻¹")
        self.dot.set_data([x], [velocity])


def _zigzag(left: float, right: float) -> tuple[NDArray[Any], NDArray[Any]]:
    """A spring between two places, m."""
    coils = 10
    share = np.concatenate([[0.0, 0.08], np.linspace(0.08, 0.92, 2 * coils + 2)[1:-1], [0.92, 1.0]])
    side = np.concatenate([[0.0, 0.0], np.tile([1.0, -1.0], coils), [0.0, 0.0]])
    return left + share * (right - left), _SPRING + 0.12 * side


def _point(radius: float, angle: Any) -> tuple[Any, Any]:
    """Point at an angle, or points at several, from the downward vertical, counter-clockwise."""
    return radius * np.sin(angle), -radius * np.cos(angle)


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
