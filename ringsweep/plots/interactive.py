"""A map whose cells can be asked for their history."""

from __future__ import annotations

import json
from collections.abc import Mapping
from typing import Any

import matplotlib
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.backend_bases import Event, MouseEvent
from matplotlib.backends import BackendFilter, backend_registry
from matplotlib.figure import Figure

from ringsweep.config import with_values
from ringsweep.errors import InputError
from ringsweep.plots.histories import draw_history
from ringsweep.plots.maps import Map, select
from ringsweep.plots.style import value_text
from ringsweep.runs import simulate

_SIZE = (9.0, 11.0)


def cell(ds: xr.Dataset, sel: Mapping[str, float | str] | None = None) -> dict[str, Any]:
    """The configuration of one cell of a sweep, as :func:`ringsweep.simulate` takes it.

    Parameters
    ----------
    ds : xarray.Dataset
        Result of a sweep, or a part of one: what ``ds.isel(...)`` has left out is held already.
    sel : mapping of str to float or str, optional
        Coordinates held at the value nearest to the one given, which must lie within the axis: a plain number is SI,
        text may have a unit.

    Returns
    -------
    dict
        The configuration of the sweep with the cell's values in it, and nothing swept.

    Raises
    ------
    InputError
        If a name is unknown, more than one cell is left, or the dataset does not say what it was made from.

    Examples
    --------
    >>> import ringsweep
    >>> from ringsweep.config import load
    >>> scene = load("my-sweep.yaml").source["scene"]
    >>> maps = ringsweep.sweep(scene, {"drive.amplitude": [1.0, 2.0], "zone.half_angle": ["10 deg", "20 deg"]})
    >>> cell(maps, {"drive.amplitude": 1.9, "zone.half_angle": 0.2})["scene"]["drive"]
    {'amplitude': 2.0, 'law': 'arctan'}
    """
    ds, _ = select(ds, sel or {})
    if ds.sizes:
        left = ", ".join(f"{dim} ({size})" for dim, size in ds.sizes.items())
        raise InputError("sel", f"one cell is wanted, but {left} is left: hold it too")
    if "configuration" not in ds.attrs:
        raise InputError("ds", "has no attribute configuration: it does not say what it was made from")
    places = {str(c.attrs["path"]): c.item() for c in ds.coords.values() if "path" in c.attrs}
    # Text keeps every digit of a float.
    settings = [f"{path}={value}" for path, value in places.items()]
    return with_values(json.loads(ds.attrs["configuration"]), settings).source


def explore(
    ds: xr.Dataset,
    x: str | None = None,
    y: str | None = None,
    var: str = "regime",
    sel: Mapping[str, float | str] | None = None,
    at: Mapping[str, float | str] | None = None,
) -> Figure:
    """Draw a map, and below it the history of the cell that is clicked.

    Clicks need a figure that hears them: in a notebook ``%matplotlib widget`` (ipympl), elsewhere a window of
    pyplot's. Where there is none, as with ``%matplotlib inline``, the figure is a picture of the map and of one cell.

    Parameters
    ----------
    ds : xarray.Dataset
        Result of a sweep.
    x, y : str, optional
        Coordinates across and up; by default the first and the second that were swept.
    var : str
        Variable to draw.
    sel : mapping of str to float or str, optional
        Coordinates held at the value nearest to the one given, which must lie within the axis: a plain number is SI,
        text may have a unit.
    at : mapping of str to float or str, optional
        The cell whose history is drawn first, found in the same way; on an axis that it does not name, the middle.

    Returns
    -------
    matplotlib.figure.Figure
        It hears clicks for as long as it is open.

    Raises
    ------
    InputError
        If a name is unknown, more than two dimensions are left, or the dataset does not say what it was made from.

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
    parts: Any = figure.subfigures(2, 1, height_ratios=[1.0, 1.5])
    above, below = parts
    ax: Axes = above.add_subplot()
    found.draw_alone(ax)
    look: dict[str, Any] = {"marker": "o", "markersize": 9, "markerfacecolor": "none", "zorder": 5, "clip_on": False}
    # Of two inks one is seen on any ground.
    marks = [*ax.plot([], [], color="white", markeredgewidth=3.5, **look), *ax.plot([], [], color="black", **look)]

    def show(one: xr.Dataset) -> None:
        run = simulate.simulate(cell(one))
        for mark in marks:
            mark.set_data(*([value] for value in found.position(one)))
        below.clear()
        draw_history(below, run)
        where = ", ".join(value_text(c) for c in one.coords.values() if "path" in c.attrs)
        below.suptitle(f"{where}\n{run.attrs['outcome']}", fontsize=10)

    def clicked(event: Event) -> None:
        # While a tool of the toolbar is in hand, a click is its own.
        held = str(getattr(figure.canvas.toolbar, "mode", ""))
        if not isinstance(event, MouseEvent) or event.inaxes is not ax or event.button != 1 or held:
            return
        if event.xdata is not None and event.ydata is not None:
            show(found.cell_at(ax, event.xdata, event.ydata))
            figure.canvas.draw_idle()

    show(first)
    figure.canvas.mpl_connect("button_press_event", clicked)
    return figure


def _figure() -> Figure:
    """One that hears clicks where there can be one; else one that a notebook shows because it is returned."""
    backend = matplotlib.get_backend()
    if "inline" in backend or backend.lower() in backend_registry.list_builtin(BackendFilter.NON_INTERACTIVE):
        return Figure(figsize=_SIZE, layout="constrained")
    from matplotlib import pyplot

    return pyplot.figure(figsize=_SIZE, layout="constrained")
