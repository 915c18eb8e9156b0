"""Draw the picture of docs/physics.md, one instant of the run in the README: `python docs/ring.py [FILE]`."""

import sys
from math import degrees
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Arc

import ringsweep
from ringsweep import plots
from ringsweep.plots.rig import Rig

CONFIG = Path(__file__).parents[1] / "configs" / "regime_map.yaml"
TIME = 2.05


def place(radius: float, angle: float) -> np.ndarray:
    """Point at a radius and at an angle from the downward vertical, counter-clockwise, rad."""
    return radius * np.array([np.sin(angle), -np.cos(angle)])


def name(ax: Axes, text: str, low: float, high: float, radius: float) -> None:
    """Draw an arc between two angles (rad), with an arrow at its end and a name."""
    ax.add_patch(Arc((0, 0), 2 * radius, 2 * radius, theta1=degrees(low) - 90, theta2=degrees(high) - 90, zorder=8))
    tip, before = place(radius, high), place(radius, high - 0.04)
    ax.annotate("", tip, before, arrowprops={"arrowstyle": "-|>", "color": "black", "shrinkA": 0, "shrinkB": 0})
    beside = place(radius + 0.055 * ax.get_xlim()[1], (low + high) / 2)
    ax.text(*beside, text, ha="center", va="center", fontsize=12, zorder=8)


def draw() -> Figure:
    """Draw the body in the ring with phi, beta, theta, R and r."""
    run = ringsweep.simulate(CONFIG)
    figure = Figure(figsize=(5.0, 5.6), layout="constrained")
    ax = plots.polar_view(run, TIME, figure.add_subplot())
    now = run.drop_duplicates("time").interp(time=TIME)
    rig = Rig.of(run)
    phi, theta, beta, R, r = float(now.phi), float(now.theta), rig.beta, rig.radius, rig.ball
    thin = {"color": "black", "linewidth": 0.7, "linestyle": "--", "zorder": 7}
    for angle, reach in ((0.0, 0.9), (phi, 0.8), (phi + beta, 1.0), (theta, 1.0)):
        ax.plot(*zip((0, 0), place(reach * R, angle), strict=True), **thin)
    name(ax, r"$\varphi$", 0.0, phi, 0.3 * R)
    name(ax, r"$\beta$", phi, phi + beta, 0.3 * R)
    name(ax, r"$\theta$", 0.0, theta, 0.17 * R)
    straight = {"arrowprops": {"arrowstyle": "-|>", "color": "black", "shrinkA": 0, "shrinkB": 0}}
    ax.annotate("", place(R, -2.2), (0, 0), **straight)
    ax.text(*place(0.6 * R, -2.3), "$R$", fontsize=12)
    centre = place(R - r, phi - beta)
    ax.annotate("", centre + place(r, 0.7), centre, zorder=8, **straight)
    ax.text(*(centre + place(0.5 * r, 1.3)), "$r$", fontsize=12, zorder=8)
    ax.set_title("")
    return figure


if __name__ == "__main__":
    plots.save(draw(), sys.argv[1] if len(sys.argv) > 1 else "ring.png")
