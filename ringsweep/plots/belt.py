"""The body on the belt at an instant, above its phase portrait."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import xarray as xr
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.patches import Rectangle
from matplotlib.patheffects import withStroke
from numpy.typing import NDArray

from ringsweep.config import load
from ringsweep.plots.datasets import mode_name
from ringsweep.plots.labels import number_text
from ringsweep.plots.phase import draw_belt_portrait
from ringsweep.plots.polar import ARROWS, reference_force, round_down
from ringsweep.plots.style import PAIR_COLOURS, REST, SMALL, on_page, page_colour
from ringsweep.quantities.variables import configuration_of

# Heights in the picture, where the body stands on the belt at 0.
_BODY, _SPRING, _BELT, _ARROW = 0.5, 0.25, -0.18, 0.08

_FRICTION = "#009E73"


class BeltArtists:
    """Artists of the body and the belt, and a dot in the phase portrait below. :meth:`show` moves them to an instant.

    Places across are to scale, in m; both axes have the same range. Heights mean nothing.
    """

    def __init__(self, ax: Axes, below: Axes, run: xr.Dataset):
        self.ax = ax
        self.portrait = draw_belt_portrait(below, run)
        x = run["x"].values
        # The place of the relaxed spring is always in view.
        low, high = min(0.0, float(x.min())), max(0.0, float(x.max()))
        self.range = (high - low) or 1.0
        self.half = 0.07 * self.range
        self.wall = low - 0.45 * self.range
        self.ends = self.wall - 0.05 * self.range, high + 0.35 * self.range
        force = run["friction_force"].values
        self.reference = reference_force([np.abs(force)], 1.0)
        # Length of an arrow, m/N.
        self.scale = 0.3 * self.range / self.reference
        speeds = np.abs([run["velocity"].values, run["belt_velocity"].values])
        self.digits = max(0, 2 - math.floor(math.log10(float(np.nanmax(speeds)) or 1.0)))

        ax.set_axis_off()
        ax.set_ylim(-0.65, 0.95)
        for axes in (ax, below):
            axes.set_xlim(*self.ends)
        left, width = self.ends[0], self.ends[1] - self.ends[0]
        fixed: dict[str, Any] = {"edgecolor": on_page("0.3"), "zorder": 1}
        ax.add_patch(Rectangle((left, _BELT), width, -_BELT, facecolor=on_page(REST), **fixed))
        ax.add_patch(Rectangle((left, 0.0), self.wall - left, 0.7, facecolor=on_page("0.8"), **fixed))
        (self.marks,) = ax.plot([], [], color=on_page("0.2"), linewidth=1.4, zorder=2)
        (self.spring,) = ax.plot([], [], color=on_page("0.3"), linewidth=1.2, zorder=3)
        scene = load(configuration_of(run)).scene
        if any(value for path, value in scene.values.items() if path.startswith("spring.")):
            ax.plot([0.0, 0.0], [0.0, 0.66], color=on_page("0.5"), linewidth=0.8, linestyle=":", zorder=1)
            ax.text(0.0, 0.68, "spring relaxed", ha="center", va="bottom", fontsize=SMALL, color=on_page("0.35"))
        else:
            self.spring.set_visible(False)
        self.body = Rectangle((0.0, 0.0), 2 * self.half, _BODY, facecolor=on_page("0.85"), zorder=4)
        self.body.set_edgecolor(on_page("0.2"))
        ax.add_patch(self.body)
        self.friction = ax.quiver(*np.zeros((4, 1)), color=on_page(_FRICTION), units="width", width=0.01, **ARROWS)
        halo = withStroke(linewidth=2.0, foreground=page_colour())
        self.name = ax.text(0.0, 0.0, "$F$", color=on_page(_FRICTION), va="center", zorder=7, path_effects=[halo])
        self._draw_scale_bar()
        self.spacing = 0.125 * (self.ends[1] - self.ends[0])
        self.speeds = ax.text(0.5, 0.0, "", transform=ax.transAxes, ha="center", va="bottom", fontsize=SMALL)
        ax.set_title(" ", fontsize="medium")
        dot: dict[str, Any] = {"marker": "o", "markersize": 8, "markeredgewidth": 1.5, "linestyle": "", "zorder": 7}
        dot["markerfacecolor"] = on_page(PAIR_COLOURS[0])
        (self.dot,) = below.plot([], [], color=on_page("black"), **dot)

    def show(self, states: dict[str, NDArray[Any]], k: int) -> None:
        """Move all artists to the `k`-th state of :func:`ringsweep.plots.polar.states_at`."""
        x, velocity, force = (float(states[name][k]) for name in ("x", "velocity", "friction_force"))
        belt_x, belt_velocity = float(states["belt_x"][k]), float(states["belt_velocity"][k])
        self.body.set_x(x - self.half)
        self.spring.set_data(*_zigzag(self.wall, x - self.half))
        left, right = self.ends
        first = left + (belt_x - left) % self.spacing
        marks = np.arange(first, right, self.spacing)
        across = np.column_stack([marks, marks, np.full(len(marks), np.nan)]).ravel()
        self.marks.set_data(across, np.tile([_BELT, 0.0, np.nan], len(marks)))
        # The force counts positive against x.
        self.friction.set_offsets([(x, _ARROW)])
        self.friction.set_UVC([-force * self.scale], [0.0])
        # Beyond the tip of the arrow.
        self.name.set(x=x - force * self.scale - 0.03 * self.range * np.sign(force), y=_ARROW, visible=force != 0.0)
        self.name.set_horizontalalignment("right" if force > 0.0 else "left")
        self.ax.set_title(f"t = {states['time'][k]:.4f} s, {mode_name(states['mode'][k])}", fontsize="medium")
        body, belt = (number_text(speed, f"+.{self.digits}f") for speed in (velocity, belt_velocity))
        self.speeds.set_text(f"body {body} m s⁻¹, belt {belt} m s⁻¹")
        self.dot.set_data([x], [velocity])

    @property
    def moving(self) -> list[Artist]:
        """Artists that :meth:`show` changes."""
        return [self.marks, self.spring, self.body, self.friction, self.name, self.speeds, self.dot, self.ax.title]

    def legend_entries(self) -> list[Artist]:
        """Legend entries of the phase portrait; the arrow has its name beside it."""
        return self.portrait

    def _draw_scale_bar(self) -> None:
        """A bar of a round force."""
        force = round_down(0.75 * self.reference)
        left, y = self.ends[0] + 0.03 * self.range, 0.78
        right = left + force * self.scale
        self.ax.plot([left, right], [y, y], marker="|", color=on_page("0.3"), linewidth=1.2)
        self.ax.text((left + right) / 2, y + 0.04, f"$F$: {force:g} N", ha="center", va="bottom", fontsize=SMALL)


def _zigzag(left: float, right: float) -> tuple[NDArray[Any], NDArray[Any]]:
    """A spring between two places, m."""
    coils = 10
    share = np.concatenate([[0.0, 0.08], np.linspace(0.08, 0.92, 2 * coils + 2)[1:-1], [0.92, 1.0]])
    side = np.concatenate([[0.0, 0.0], np.tile([1.0, -1.0], coils), [0.0, 0.0]])
    return left + share * (right - left), _SPRING + 0.12 * side
