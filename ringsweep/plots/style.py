"""Colours, line styles and legends that all pictures share."""

from __future__ import annotations

from typing import Any

import numpy as np
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from numpy.typing import NDArray

#: The colour of each regime in every picture. These are the colours of Okabe and Ito, which colour-blind readers tell
#: apart. Their lightness is changed so that the regimes of one model differ in greyscale too.
REGIME_COLOURS: dict[str, str] = {
    "resting": "#F0E442",
    "oscillatory": "#84CAF2",
    "revolving": "#00507F",
    "separating": "#CC5500",
    "jammed": "#D086B1",
    "failed": "#1A1A1A",
    "stick-slip": "#008C66",
    "sliding": "#F0E442",
    "sticking": "#6A3D9A",
    "riding": "#B48FD0",
}

#: Curves of friction laws and of methods, which may cover each other. The numbers of colours and of styles have no
#: common factor, so a pair of the two returns only after 35 curves.
CURVE_COLOURS = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9", "#000000")
CURVE_STYLES: tuple[Any, ...] = ("-", "--", "-.", ":", (0, (8, 3)))

#: Cells without a value.
NO_VALUE = "#DDDDDD"

#: Classes that are not regimes, and zones.
CLASS_COLOURS = ("#BBBBBB", "#0072B2", "#E69F00", "#009E73", "#CC79A7", "#D55E00", "#56B4E9", "#F0E442")

#: The body and the ring, or contact 1 and contact 2.
PAIR_COLOURS = ("#0072B2", "#D55E00")
PAIR_STYLES = ("-", "--")

#: Shading of times at which the body sticks.
STICK = "#E6E6E6"

#: Surface of the ring outside the zones.
REST = "#F2F2F2"

#: Font size of legends and of titles above panels, points.
SMALL = 8


def arc_colour(number: int) -> str:
    """Colour of a zone in every picture; `number` counts from 1."""
    return CLASS_COLOURS[2 + (number - 1) % (len(CLASS_COLOURS) - 2)]


def arc_names(count: int) -> list[str]:
    """Names of `count` zones in a legend."""
    return ["zone"] if count == 1 else [f"zone {k + 1}" for k in range(count)]


def axes_or_current(ax: Axes | None, size: tuple[float, float]) -> Axes:
    """`ax`, or pyplot's current axes if it is None. A new figure has the given size, inches."""
    if ax is not None:
        return ax
    # Importing pyplot chooses a backend, which may fail on a machine without a display.
    from matplotlib import pyplot

    if not pyplot.get_fignums():
        pyplot.figure(figsize=size, layout="constrained")
    return pyplot.gca()


def legend_beside(ax: Axes, handles: list[Artist] | None = None, **options: Any) -> None:
    """Put a legend to the right of the axes, where it hides no data; by default with all that has a label."""
    style: dict[str, Any] = {"loc": "upper left", "bbox_to_anchor": (1.0, 1.0), "fontsize": SMALL, "frameon": False}
    if handles is None:
        handles = list(ax.get_legend_handles_labels()[0])
    if handles:
        ax.legend(handles=handles, **style | options)


def true_ranges(mask: NDArray[Any]) -> NDArray[np.intp]:
    """First index and index after the last of each unbroken range of True, shape ``(ranges, 2)``."""
    steps = np.diff(np.concatenate([[0], np.asarray(mask, dtype=np.int8), [0]]))
    return np.column_stack([np.flatnonzero(steps == 1), np.flatnonzero(steps == -1)])


def is_dark(rgba: NDArray[Any]) -> NDArray[np.bool_]:
    """Whether marks on these colours, shape ``(..., 4)``, must be white."""
    return np.asarray(rgba[..., :3] @ [0.299, 0.587, 0.114] < 0.45)
