"""What all pictures share: colours, sizes, words with units, saving."""

from __future__ import annotations

import difflib
import math
import os
import re
from collections.abc import Iterable
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import NDArray

from ringsweep.errors import InputError
from ringsweep.storage import netcdf

# Okabe and Ito's hues, which colour-blind readers tell apart, with lightness spread so that
# the regimes of one model stay apart in greyscale too.
REGIME_COLOURS: dict[str, str] = {
    "resting": "#F0E442",
    "oscillatory": "#84CAF2",
    "revolving": "#00507F",
    "separating": "#CC5500",
    "jammed": "#D086B1",
    "failed": "#1A1A1A",
    "stick-slip": "#008C66",
}

#: Kinds of file that `save` writes.
SUFFIXES = (".pdf", ".png", ".svg")

# Lines of friction laws, which may lie on top of each other: told apart by hue and, the one below showing through
# gaps, by style. The lengths have no common factor, so that no pair returns soon.
LAW_COLOURS = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9", "#000000")

LAW_STYLES: tuple[Any, ...] = ("-", "--", "-.", ":", (0, (8, 3)))

NO_VALUE = "#DDDDDD"
OTHER_COLOURS = ("#BBBBBB", "#0072B2", "#E69F00", "#009E73", "#CC79A7", "#D55E00", "#56B4E9", "#F0E442")

#: Of what there are two: the body and the ring, contact 1 and contact 2. Told apart by style as well.
PAIR_COLOURS = ("#0072B2", "#D55E00")
PAIR_STYLES = ("-", "--")

#: Stick, and the surface of the ring where it is not rough.
STICK = "#E6E6E6"
REST = "#F2F2F2"

#: Size of the letters of legends and of what stands above a panel, points.
SMALL = 8


def arc_colour(number: int) -> str:
    """Colour of the rough arc of that number, counted from 1, in every picture."""
    return OTHER_COLOURS[2 + (number - 1) % (len(OTHER_COLOURS) - 2)]


def arc_names(count: int) -> list[str]:
    """What a legend calls so many rough arcs."""
    return ["rough arc"] if count == 1 else [f"rough arc {k + 1}" for k in range(count)]


def axes_or_current(ax: Axes | None, size: tuple[float, float]) -> Axes:
    """The axes given, or pyplot's current ones; a figure that has to be made for them has `size`, inches."""
    if ax is not None:
        return ax
    # What draws elsewhere, or on a machine without a display, is to stay clear of it.
    from matplotlib import pyplot

    if not pyplot.get_fignums():
        pyplot.figure(figsize=size, layout="constrained")
    return pyplot.gca()


def beside(ax: Axes, handles: list[Artist] | None = None, **options: Any) -> None:
    """A legend to the right of the axes, where it hides no data."""
    look: dict[str, Any] = {"loc": "upper left", "bbox_to_anchor": (1.0, 1.0), "fontsize": SMALL, "frameon": False}
    if handles is None:
        handles = list(ax.get_legend_handles_labels()[0])
    if handles:
        ax.legend(handles=handles, **look | options)


def save(figure: Figure, path: str | os.PathLike[str]) -> None:
    """Write a figure, whole or not at all.

    Parameters
    ----------
    figure : matplotlib.figure.Figure
        Figure to write.
    path : path-like
        File to be written or replaced; its suffix, one of `SUFFIXES`, decides its kind.

    Raises
    ------
    InputError
        If the suffix is unknown or `path` cannot be written.

    Examples
    --------
    >>> from matplotlib.figure import Figure
    >>> save(Figure(), "my.txt")
    Traceback (most recent call last):
    ringsweep.errors.InputError: my.txt: pictures end in .pdf, .png, .svg, not in '.txt'
    """
    suffix = Path(path).suffix.lower()
    if suffix not in SUFFIXES:
        raise InputError(str(path), f"pictures end in {', '.join(SUFFIXES)}, not in {suffix or 'nothing'!r}")
    with netcdf.replacing(path) as temporary:
        figure.savefig(temporary, dpi=150, format=suffix[1:])


def known(argument: str, name: str, available: Iterable[Any]) -> str:
    """The name that is meant by `name`, with dots or underscores; others are refused with the nearest one."""
    # Paths of the configuration are names too: the user wrote them there.
    wanted, names = name.replace(".", "_"), [str(one) for one in available]
    if wanted in names:
        return wanted
    close = difflib.get_close_matches(wanted, names, n=1)
    hint = f"; did you mean {close[0]}?" if close else ""
    raise InputError(argument, f"{name!r} is not in the dataset, which has {', '.join(names) or 'none'}{hint}")


def factor(coordinate: xr.DataArray) -> float:
    """What numbers of a coordinate are multiplied by to be shown: angles are in degrees."""
    return 180 / math.pi if coordinate.attrs.get("units") == "rad" else 1.0


def long_name(data: xr.DataArray) -> str:
    """What a quantity is called."""
    return str(data.attrs.get("long_name", data.name))


def label_of(data: xr.DataArray, ds: xr.Dataset, angle: str = "rad") -> str:
    """What a quantity is called, with its unit."""
    name = long_name(data)
    # Two arcs, say, have coefficients of one long name: then only the path tells which is meant.
    if sum(long_name(other) == name for other in ds.coords.values()) > 1:
        name = f"{name}, {data.name}"
    units = units_of(data, angle)
    return f"{name} ({units})" if units else name


def units_of(data: xr.DataArray, angle: str) -> str:
    """Unit as text for a picture; `angle` stands for the radian."""
    units = str(data.attrs.get("units", "1"))
    units = angle if units == "rad" else "" if units == "1" else units
    # Parameters have "m/s^2" where variables have "m s-2".
    units = re.sub(r"/([A-Za-z]+)\^?(\d*)", lambda unit: f" {unit[1]}-{unit[2] or 1}", units)
    return re.sub(r"(?<=[A-Za-z])\^?(-?\d+)", r"$^{\1}$", units)


def value_text(value: xr.DataArray) -> str:
    """A value of a coordinate in words."""
    name = long_name(value)
    if value.dtype.kind not in "iuf":
        return f"{name} = {value.item()}"
    units = units_of(value, "°")
    number = f"{value.item() * factor(value):.4g}"
    return f"{name} = {number}{units if units == '°' else f' {units}'.rstrip()}"


def runs(mask: NDArray[Any]) -> NDArray[np.intp]:
    """Begin and end (exclusive) of every run of True."""
    steps = np.diff(np.concatenate([[0], np.asarray(mask, dtype=np.int8), [0]]))
    return np.column_stack([np.flatnonzero(steps == 1), np.flatnonzero(steps == -1)])


def is_dark(rgba: NDArray[Any]) -> NDArray[np.bool_]:
    """Whether colours, shape ``(..., 4)``, need white ink."""
    return np.asarray(rgba[..., :3] @ [0.299, 0.587, 0.114] < 0.45)
