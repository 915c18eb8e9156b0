"""The drawing of docs/scenes.md, an instant of the README's run with its angles named: `python docs/ring.py [FILE]`."""

import sys
from math import asin, degrees
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Arc

import ringsweep
from ringsweep import plots

CONFIG = Path(__file__).parents[1] / "configs" / "regime_map.yaml"
TIME, RADIUS, HALF_DISTANCE, BALL = 1.1, 0.043378, 0.025, 0.010


def place(radius: float, angle: float) -> np.ndarray:
    """Point at an angle from the downward vertical, counter-clockwise."""
    return radius * np.array([np.sin(angle), -np.cos(angle)])


def name(ax: Axes, text: str, low: float, high: float, radius: float) -> None:
    """An arc between two angles, an arrow at its end, and what it is called."""
    ax.add_patch(Arc((0, 0), 2 * radius, 2 * radius, theta1=degrees(low) - 90, theta2=degrees(high) - 90, zorder=8))
    tip, before = place(radius, high), place(radius, high - 0.04)
    ax.annotate("", tip, before, arrowprops={"arrowstyle": "-|>", "color": "black", "shrinkA": 0, "shrinkB": 0})
    ax.text(*place(radius - 0.0035, (low + high) / 2), text, ha="center", va="center", fontsize=12, zorder=8)


def draw() -> Figure:
    """The body in the ring with phi, beta, theta, R and r."""
    run = ringsweep.simulate(CONFIG)
    figure = Figure(figsize=(6.6, 5.0), layout="constrained")
    ax = plots.polar_view(run, TIME, figure.add_subplot())
    now = run.drop_duplicates("time").interp(time=TIME)
    phi, theta, beta = float(now.phi), float(now.theta), asin(HALF_DISTANCE / (RADIUS - BALL))
    thin = {"color": "black", "linewidth": 0.7, "linestyle": "--", "zorder": 7}
    for angle, reach in ((0.0, 0.9), (phi, 0.8), (phi + beta, 1.0), (theta, 1.0)):
        ax.plot(*zip((0, 0), place(reach * RADIUS, angle), strict=True), **thin)
    name(ax, r"$\varphi$", 0.0, phi, 0.62 * RADIUS)
    name(ax, r"$\beta$", phi, phi + beta, 0.5 * RADIUS)
    name(ax, r"$\theta$", 0.0, theta, 0.28 * RADIUS)
    straight = {"arrowprops": {"arrowstyle": "-|>", "color": "black", "shrinkA": 0, "shrinkB": 0}}
    ax.annotate("", place(RADIUS, -2.2), (0, 0), **straight)
    ax.text(*place(0.6 * RADIUS, -2.3), "$R$", fontsize=12)
    centre = place(RADIUS - BALL, phi - beta)
    ax.annotate("", centre + place(BALL, 0.7), centre, zorder=8, **straight)
    ax.text(*(centre + place(0.5 * BALL, 1.3)), "$r$", fontsize=12, zorder=8)
    ax.set_title("")
    return figure


if __name__ == "__main__":
    plots.save(draw(), sys.argv[1] if len(sys.argv) > 1 else "ring.png")
