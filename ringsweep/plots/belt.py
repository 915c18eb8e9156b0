"""The body on the belt at an instant, above its phase portrait."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import xarray as xr
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.patches import Rectangle
from numpy.typing import NDArray

from ringsweep.plots import look
from ringsweep.plots.phase import draw_belt_portrait
from ringsweep.plots.polar import ARROWS, Instant, reference_force, round_down
from ringsweep.plots.rig import has_spring

# Heights in the picture, where the body stands on the belt at 0.
_BODY, _SPRING, _BELT, _ARROW = 0.5, 0.25, -0.18, 0.08

_FRICTION = "#009E73"


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
        self.body = Rectangle(
            (0.0, 0.0), 2 * self.half, _BODY, facecolor=look.on_page("0.85"), edgecolor=dark, zorder=4
        )
        belt = Rectangle((left, _BELT), right - left, -_BELT, facecolor=look.on_page(look.REST), edgecolor=edge)
        wall = Rectangle((left, 0.0), self.wall - left, 0.7, facecolor=look.on_page("0.8"), edgecolor=edge)
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
