"""A regime map that draws the history of the cell that is clicked, or that the arrow keys move to."""

from __future__ import annotations

from collections.abc import Mapping
from functools import partial
from typing import Any

import matplotlib
import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.backend_bases import Event, KeyEvent, MouseEvent, key_press_handler
from matplotlib.backends import BackendFilter, backend_registry
from matplotlib.figure import Figure

from ringsweep.errors import InputError
from ringsweep.plots.datasets import is_sampled
from ringsweep.plots.histories import draw_history
from ringsweep.plots.labels import axis_label, displayed, number_text, plain_text, value_text
from ringsweep.plots.maps import Map
from ringsweep.plots.selection import cell, select
from ringsweep.plots.style import SMALL
from ringsweep.quantities.units import rounded_up
from ringsweep.quantities.variables import swept, words
from ringsweep.runs import simulate

# Inches. A notebook is some thousand pixels wide. The toolbar of a notebook lies on this part of the figure.
_SIZE, _TOOLBAR = (9.8, 6.0), 0.4

# Axis and direction of each arrow key.
_ARROWS = {"left": (0, -1), "right": (0, 1), "down": (1, -1), "up": (1, 1)}


def explore(
    ds: xr.Dataset,
    x: str | None = None,
    y: str | None = None,
    var: str = "regime",
    sel: Mapping[str, float | str] | None = None,
    at: Mapping[str, float | str] | None = None,
) -> Figure:
    """Draw a map, and beside it the history of the cell that is clicked.

    Arrow keys move from cell to cell. The coordinates of the cell under the pointer, its regime, its
    certificate, and the number shown with the bound on its error are written below the figure.

    Clicks and keys need an interactive figure: in a notebook ``%matplotlib widget`` (ipympl), elsewhere a window of
    pyplot. Without one, for example under ``%matplotlib inline``, the figure shows the map and the history of one cell.

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
        text may have a unit. A warning and the title state the value taken if it is another.
    at : mapping of str to float or str, optional
        Coordinates of the cell whose history is drawn first, given as in `sel`; on other axes the middle cell.

    Returns
    -------
    matplotlib.figure.Figure
        It responds to clicks and keys for as long as it is open.

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
    if is_sampled(ds):
        raise InputError("ds", "is a sampled sweep, which has no runs to point at: draw a picture, *.png")
    found = Map.of(ds, (x, y), var, sel)
    first, _ = select(found.ds, at or {})
    first = first.isel({dim: size // 2 for dim, size in first.sizes.items()})
    figure = _figure()
    subfigures: Any = figure.subfigures(1, 2, width_ratios=[1.0, 1.1])
    left, right = subfigures
    ax: Axes = left.add_subplot()
    # Beside the map there is no place for a legend.
    found.draw_alone(ax, legend="below")
    ax.format_coord = lambda x, y: _description(found.cell_at(ax, x, y), found)  # type: ignore[method-assign]
    style: dict[str, Any] = {"marker": "o", "markersize": 9, "markerfacecolor": "none", "zorder": 5, "clip_on": False}
    # A black circle in a white one is visible on every colour.
    circles = [*ax.plot([], [], color="white", markeredgewidth=3.5, **style), *ax.plot([], [], color="black", **style)]

    here = found.position(first)

    def show(one: xr.Dataset) -> None:
        nonlocal here
        run = simulate.simulate(cell(one))
        here = found.position(one)
        for circle in circles:
            circle.set_data(*([value] for value in here))
        right.clear()
        draw_history(right, run)
        for panel in right.axes:
            panel.yaxis.label.set_fontsize(SMALL)
        right.suptitle("\n".join([*_coordinates(one, found), run.attrs["outcome"]]), fontsize=9)
        figure.canvas.draw_idle()

    def clicked(event: Event) -> None:
        # While zoom or pan is active in the toolbar, a click belongs to that tool.
        tool = str(getattr(figure.canvas.toolbar, "mode", ""))
        if not isinstance(event, MouseEvent) or event.inaxes is not ax or event.button != 1 or tool:
            return
        if event.xdata is not None and event.ydata is not None:
            show(found.cell_at(ax, event.xdata, event.ydata))

    def pressed(event: Event) -> None:
        if not isinstance(event, KeyEvent):
            return
        if event.key not in _ARROWS:
            key_press_handler(event)
            return
        there = _neighbour(found, here, *_ARROWS[event.key])
        if there != here:
            show(found.cell_at(ax, *there))

    show(first)
    figure.canvas.mpl_connect("button_press_event", clicked)
    if figure.canvas.manager is not None and figure.canvas.manager.key_press_handler_id is not None:
        # Arrow keys would go back and forth between zooms.
        figure.canvas.mpl_disconnect(figure.canvas.manager.key_press_handler_id)
    figure.canvas.mpl_connect("key_press_event", pressed)
    return figure


def _neighbour(found: Map, here: tuple[float, float], along: int, step: int) -> tuple[float, float]:
    """Position of the next cell in the direction of an axis; the same position at the end."""
    if found.scattered and found.vertical is not None:
        points = np.column_stack([axis.values_at(found.data) for axis in (found.horizontal, found.vertical)])
        # Points at the same place of the axis follow each other.
        points = points[np.lexsort((points[:, 1 - along], points[:, along]))]
        k = int(np.argmin(((points - here) ** 2).sum(axis=1))) + step
        return (float(points[k, 0]), float(points[k, 1])) if 0 <= k < len(points) else here
    axis = (found.horizontal, found.vertical)[along]
    if axis is None:
        return here
    k = int(np.argmin(np.abs(axis.values - here[along]))) + step
    there = float(axis.values[min(max(k, 0), len(axis.values) - 1)])
    return (there, here[1]) if along == 0 else (here[0], there)


def _coordinates(one: xr.Dataset, found: Map) -> list[str]:
    """Values of a cell along the axes of the map; its title has the others."""
    return [value_text(one[coordinate.name]) for coordinate in swept(found.ds) if coordinate.dims]


def _description(one: xr.Dataset, found: Map) -> str:
    """What the toolbar says of a cell."""
    texts = _coordinates(one, found)
    names = dict.fromkeys([*(name for name in ("regime", "motion") if name in one), found.data.name])
    classes = [name for name in names if "flag_values" in one[name].attrs]
    texts += dict.fromkeys(words(one[name]).item().replace("_", " ") or "no value" for name in classes)
    if found.data.name not in classes:
        value = float(displayed(one[found.data.name]))
        texts.append(f"{axis_label(found.data, found.ds)}: {number_text(value, '.6g')}")
        bound = float(displayed(one.get(f"{found.data.name}_error", xr.DataArray(np.nan))))
        if np.isfinite(bound):
            texts.append(f"error at most {number_text(rounded_up(bound), '.2g')}")
        elif f"{found.data.name}_error" in one and np.isfinite(value) and one.get("certified", 0) == 1:
            texts.append("no bound on the error: nearby runs diverge")
    if "certified" in one:
        texts.append(words(one["certified"]).item().replace("_", " ") or "inferred")
    return plain_text(", ".join(texts))


def _show_live(figure: Figure) -> None:
    """Show the live canvas of a figure, unless pyplot shows every new figure by itself."""
    if not matplotlib.is_interactive():
        from IPython.display import display

        display(figure.canvas)


def _figure() -> Figure:
    """A figure of pyplot if the backend can be interactive, else a figure that a notebook shows once."""
    backend = matplotlib.get_backend()
    if "inline" in backend or backend.lower() in backend_registry.list_builtin(BackendFilter.NON_INTERACTIVE):
        return Figure(figsize=_SIZE, layout="constrained")
    from matplotlib import pyplot

    figure = pyplot.figure(figsize=_SIZE, layout="constrained")
    canvas: Any = figure.canvas
    if hasattr(canvas, "toolbar_position"):
        canvas.toolbar_position, canvas.toolbar_visible, canvas.header_visible = "top", True, False
        layout: Any = figure.get_layout_engine()
        layout.set(rect=(0.0, 0.0, 1.0, 1.0 - _TOOLBAR / _SIZE[1]))
        # IPython shows a figure that is the value of a cell by this. Its other way is a picture: a dead copy.
        canvas.manager.reshow = partial(_show_live, figure)
    return figure
