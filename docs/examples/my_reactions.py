"""A picture: one normal reaction over the other."""

from ringsweep.plots.datasets import require_one_run
from ringsweep.plots.labels import label_axis
from ringsweep.plots.look import axes_or_current, place_legend
from ringsweep.plots.phase import draw_modes


def reactions(ds, ax=None):
    """Draw the normal reaction at contact 2 over that at contact 1, for one run of a body with two contacts."""
    run = require_one_run(ds, ("phi", "normal_1", "normal_2", "mode"))
    ax = axes_or_current(ax, 0.8)
    entries = draw_modes(ax, run["mode"].values, run["normal_1"].values, run["normal_2"].values)
    for axis, contact in ((ax.xaxis, 1), (ax.yaxis, 2)):
        label_axis(axis, f"normal reaction at contact {contact}", "N")
    place_legend(ax, entries)
    return ax
