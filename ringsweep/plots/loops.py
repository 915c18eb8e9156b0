"""Friction force of a body on a belt over its sliding."""

from __future__ import annotations

from typing import Any, Literal

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from numpy.typing import NDArray

from ringsweep.errors import InputError
from ringsweep.plots import look
from ringsweep.plots.histories import clip
from ringsweep.plots.labels import label_axis
from ringsweep.plots.phase import draw_modes
from ringsweep.plots.rig import belt_history

# Share of the greatest velocity that the inset shows.
_NEAR = 0.02


def friction_loop(
    ds: xr.Dataset, against: Literal["velocity", "distance"] = "velocity", ax: Axes | None = None
) -> Axes:
    """Draw the friction force on a belt over the sliding velocity, or over the distance slid.

    A law of the sliding velocity alone gives one curve, and a vertical line where the body sticks. Bristles give loops,
    which an inset shows at small velocities. Over the distance slid, the area of a closed loop is the energy that
    friction takes in a cycle. For the loops of some cycles only, draw ``ds.sel(time=slice(...))``.

    Parameters
    ----------
    ds : xarray.Dataset
        Result of :func:`ringsweep.simulate` on a belt.
    against : {"velocity", "distance"}
        Whether the horizontal axis has the sliding velocity, or the distance slid on the belt since the first instant
        of `ds`. Forwards is positive for both.
    ax : matplotlib.axes.Axes, optional
        Axes to draw in, by default pyplot's current ones. The legend stands outside them: a figure with
        ``layout="constrained"`` makes room for it.

    Returns
    -------
    matplotlib.axes.Axes

    Raises
    ------
    InputError
        If the dataset is not the history of one run on a belt, or `against` is unknown.

    Examples
    --------
    >>> import ringsweep
    >>> from matplotlib.figure import Figure
    >>> scene = {
    ...     "model": "belt",
    ...     "body": {"mass": 1.0},
    ...     "spring": {"stiffness": 2.0},
    ...     "belt": {"velocity": 0.1},
    ...     "friction": {"law": "stiction", "mu_s": 0.15, "mu_k": 0.1},
    ...     "time": {"span": 60.0},
    ... }
    >>> friction_loop(ringsweep.simulate(scene), ax=Figure().add_subplot()).get_xlabel()
    'sliding velocity (m s$^{-1}$)'
    """
    if against not in ("velocity", "distance"):
        raise InputError("against", f"{against!r} is neither 'velocity' nor 'distance'")
    run = belt_history(ds)
    ax = look.axes_or_current(ax, 0.63)
    if against == "velocity":
        across = (run["velocity"] - run["belt_velocity"]).values
        label = "sliding velocity", "m s$^{-1}$"
    else:
        across = (run["x"] - run["belt_x"]).values
        across -= across[0]
        label = "distance slid on the belt", "m"
    force = run["friction_force"].values
    entries = draw_modes(ax, run["mode"].values, across, force)
    clip(ax, run["time"].values, force)
    label_axis(ax.xaxis, *label)
    label_axis(ax.yaxis, "friction force", "N")
    if against == "velocity" and "deflection" in run and run["deflection"].values.any():
        _draw_near_zero(ax, run["mode"].values, across, force)
    look.place_legend(ax, entries)
    return ax


def _draw_near_zero(ax: Axes, mode: NDArray[Any], velocity: NDArray[Any], force: NDArray[Any]) -> None:
    """Draw small velocities, at which bristles make loops, as an inset where friction, which opposes slip, never is."""
    width = _NEAR * float(np.nanmax(np.abs(velocity)))
    inset = ax.inset_axes((0.6, 0.24, 0.37, 0.36))
    draw_modes(inset, mode, velocity, force)
    for line in inset.lines:
        line.set_linewidth(min(line.get_linewidth(), 0.9))
        if line.get_marker() != "None":
            line.set_visible(False)
    inset.set(xlim=(-width, width), ylim=ax.get_ylim(), yticks=[])
    look.small_ticks(inset)
    label_axis(inset.xaxis, "near 0", "m s$^{-1}$")
    inset.xaxis.label.set_fontsize(look.SMALL)
