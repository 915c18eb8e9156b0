"""A regime map that draws the history of a cell when the cell is clicked."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import matplotlib
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.backend_bases import Event, MouseEvent
from matplotlib.backends import BackendFilter, backend_registry
from matplotlib.figure import Figure

from ringsweep.plots.datasets import swept
from ringsweep.plots.histories import draw_history
from ringsweep.plots.labels import value_text
from ringsweep.plots.maps import Map
from ringsweep.plots.selection import cell, select
from ringsweep.runs import simulate

_SIZE = (9.0, 11.0)


def explore(
    ds: xr.Dataset,
    x: str | None = None,
    y: str | None = None,
    var: str = "regime",
    sel: Mapping[str, float | str] | None = None,
    at: Mapping[str, float | str] | None = None,
) -> Figure:
    """Draw a map, and below it the history of the cell that is clicked.

    Clicks need an interactive figure: in a notebook ``%matplotlib widget`` (ipympl), elsewhere a window of pyplot.
    Without one, for example under ``%matplotlib inline``, the figure shows the map and the history of one cell.

    Parameters
    ----------
    ds : xarray.Dataset
        Result of a sweep.
    x, y : str, optional
        Coordinates of the horizontal and the vertical axis; by default the first and the second that were swept.
    var : str
        Variable to draw.
    sel : mapping of str to float or str, optional
        Coordinates held at the value nearest to the one given, which must lie within the axis: a plain number is SI,
        text may have a unit.
    at : mapping of str to float or str, optional
        Coordinates of the cell whose history is drawn first, given as in `sel`; on other axes the middle cell.

    Returns
    -------
    matplotlib.figure.Figure
        It responds to clicks for as long as it is open.

    Raises
    ------
    InputError
        If a name is unknown, more than two dimensions are left, or the dataset has no attribute ``configuration``.

    Examples
    --------
    >>> import ringsweep
    >>> from ringsweep.config import load
    >>> scene = load("my-sweep.yaml").source["scene"]
    >>> maps = ringsweep.sweep(scene, {"drive.amplitude": [1.0, 2.0], "zone.half_angle": ["10 deg", "20 deg"]})
    >>> figure = explore(maps, at={"drive.amplitude": 1.0})
    """
    found = Map.of(ds, x, y, var, sel or {})
    first, _ = select(found.ds, at or {})
    first = first.isel({dim: size // 2 for dim, size in first.sizes.items()})
    figure = _figure()
    subfigures: Any = figure.subfigures(2, 1, height_ratios=[1.0, 1.5])
    above, below = subfigures
    ax: Axes = above.add_subplot()
    found.draw_alone(ax)
    style: dict[str, Any] = {"marker": "o", "markersize": 9, "markerfacecolor": "none", "zorder": 5, "clip_on": False}
    # A black circle in a white one is visible on every colour.
    circles = [*ax.plot([], [], color="white", markeredgewidth=3.5, **style), *ax.plot([], [], color="black", **style)]

    def show(one: xr.Dataset) -> None:
        run = simulate.simulate(cell(one))
        for circle in circles:
            circle.set_data(*([value] for value in found.position(one)))
        below.clear()
        draw_history(below, run)
        where = ", ".join(value_text(coordinate) for coordinate in swept(one))
        below.suptitle(f"{where}\n{run.attrs['outcome']}", fontsize=10)

    def clicked(event: Event) -> None:
        # While zoom or pan is active in the toolbar, a click belongs to that tool.
        tool = str(getattr(figure.canvas.toolbar, "mode", ""))
        if not isinstance(event, MouseEvent) or event.inaxes is not ax or event.button != 1 or tool:
            return
        if event.xdata is not None and event.ydata is not None:
            show(found.cell_at(ax, event.xdata, event.ydata))
            figure.canvas.draw_idle()

    show(first)
    figure.canvas.mpl_connect("button_press_event", clicked)
    return figure


def _figure() -> Figure:
    """A figure of pyplot if the backend can be interactive, else a figure that a notebook shows once."""
    backend = matplotlib.get_backend()
    if "inline" in backend or backend.lower() in backend_registry.list_builtin(BackendFilter.NON_INTERACTIVE):
        return Figure(figsize=_SIZE, layout="constrained")
    from matplotlib import pyplot

    return pyplot.figure(figsize=_SIZE, layout="constrained")
