"""Draw the map of the README, with a mark on the cell whose history stands below it: `python docs/map.py [FILE]`."""

import sys
from math import degrees
from pathlib import Path

from matplotlib import patheffects
from matplotlib.figure import Figure

import ringsweep
from ringsweep import plots
from ringsweep.config import load

CONFIG = Path(__file__).parents[1] / "configs" / "regime_map.yaml"


def draw() -> Figure:
    """Draw the map, and mark the scene of the configuration in it."""
    ds = ringsweep.run(CONFIG)
    scene = load(CONFIG).scene.values
    figure = plots.regime_map(ds)
    cell = scene["drive.amplitude"], degrees(scene["zone.half_angle"])
    style = {"path_effects": [patheffects.withStroke(linewidth=3.0, foreground="white")]}
    figure.axes[0].plot(*cell, "o", markersize=9, color="none", markeredgecolor="black", markeredgewidth=1.6, **style)
    figure.axes[0].annotate("the run below", cell, (8, 8), textcoords="offset points", **style)
    return figure


if __name__ == "__main__":
    plots.save(draw(), sys.argv[1] if len(sys.argv) > 1 else "map.png")
