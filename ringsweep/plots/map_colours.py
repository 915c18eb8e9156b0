"""Colours, hatching and legend of a regime map."""

from __future__ import annotations

import json
from dataclasses import dataclass
from itertools import cycle
from typing import Any

import numpy as np
import xarray as xr
from matplotlib import colormaps, colors
from numpy.typing import NDArray

from ringsweep.errors import InputError
from ringsweep.plots import look
from ringsweep.plots.labels import number_text
from ringsweep.quantities.flags import FAILED, JAMMED
from ringsweep.quantities.variables import (
    INFERRED,
    SAMPLED,
    check_flags,
    configuration_of,
    is_classification,
    meanings_of,
    written,
)


@dataclass(frozen=True)
class ColourScale:
    """Colours of the values of a variable; `flags` and `meanings` are those of a classification."""

    colours: colors.Colormap
    norm: colors.Normalize
    flags: NDArray[Any] | None = None
    meanings: tuple[str, ...] | None = None

    @classmethod
    def of(cls, data: xr.DataArray, norm: str | None = None, cmap: str | None = None) -> ColourScale:
        """The colours of a variable: by the meaning of its flags, or from its least to its greatest value.

        `norm` is ``"linear"`` or ``"log"``; by default numbers over powers of ten, zeros among them, are logarithmic.
        """
        if norm not in (None, "linear", "log"):
            raise InputError("norm", f"{norm!r} is none: it is linear or log")
        if cmap is not None and cmap not in colormaps:
            raise InputError("cmap", f"{cmap!r} is no colour map of matplotlib, such as viridis or magma")
        if not is_classification(data):
            finite = data.values[np.isfinite(data.values)]
            positive = finite[finite > 0.0]
            palette = _with_grey(cmap or "viridis")
            if norm == "log" and (not positive.size or finite.min() < 0.0):
                raise InputError("norm", f"{data.name} has no logarithm: its values are not positive")
            if positive.size and positive.max() > positive.min() and _is_logarithmic(data, finite, norm):
                return cls(palette.with_extremes(under=ZERO), colors.LogNorm(positive.min(), positive.max()))
            if str(data.name) in SAMPLED and data.dtype.kind == "f" and norm is None:
                # Shares: every map of them has the same colours.
                return cls(palette, colors.Normalize(0.0, 1.0))
            limits = (finite.min(), finite.max()) if finite.size else (0.0, 1.0)
            return cls(palette, colors.Normalize(*limits))
        check_flags(data)
        meanings = meanings_of(data)
        # The colour of a class does not depend on which other classes occur.
        colours = [_WORDS.get(m, colour) for m, colour in zip(meanings.values(), cycle(look.CLASS_COLOURS))]
        classes = colors.BoundaryNorm(np.arange(len(meanings) + 1) - 0.5, len(meanings))
        names = tuple(meaning.replace("_", " ") for meaning in meanings.values())
        return cls(_with_grey(colors.ListedColormap(colours)), classes, np.array(list(meanings)), names)

    def numbers(self, data: xr.DataArray) -> xr.DataArray:
        """Numbers for `norm`: the value, or the position of its flag; NaN where there is none."""
        numbers = data.astype(float).where(np.isfinite(data))
        if self.flags is None:
            return numbers
        classes = xr.full_like(numbers, np.nan)
        for k, flag in enumerate(self.flags):
            classes = classes.where(numbers != flag, k)
        return classes

    def rgba(self, numbers: NDArray[Any]) -> NDArray[Any]:
        """Colours of such numbers, shape ``(..., 4)``."""
        if isinstance(self.norm, colors.LogNorm):
            # A zero has no logarithm, and the colour of what lies below the scale.
            numbers = np.where(numbers <= 0.0, 0.5 * float(self.norm.vmin or 0.0), numbers)
        return np.asarray(self.colours(self.norm(np.ma.masked_invalid(numbers))))


_WORDS = look.REGIME_COLOURS | look.AFTERMATH_COLOURS

#: Colour of zeros among numbers on a logarithmic scale: lighter than most numbers, and of another hue.
ZERO = "#FBDFCB"


def _is_logarithmic(data: xr.DataArray, finite: NDArray[Any], norm: str | None) -> bool:
    """Whether colours follow the logarithm: as asked for, for bounds on errors, or for numbers over decades."""
    if norm is not None:
        return norm == "log"
    if str(data.name).endswith("_error"):
        return True
    positive = finite[finite > 0.0]
    if not positive.size or finite.min() < 0.0:
        return False
    low, middle, high = np.quantile(positive, (0.05, 0.5, 0.95))
    # Half of the values in the lowest twentieth of the scale, or nine in ten of them over two decades.
    return bool(positive.max() > max(100.0 * positive.min(), 20.0 * middle) or high > 100.0 * low)


@dataclass(frozen=True)
class CellWarning:
    """A warning and the cells that have it: in a grid they are hatched, among points they have a marker.

    If all cells have it, only the legend says so: hatching everywhere would hide the map.
    """

    label: str
    hatch: str
    marker: str
    cells: xr.DataArray
    everywhere: bool = False


def cell_warnings(ds: xr.Dataset, data: xr.DataArray) -> list[CellWarning]:
    """Warnings of a map of regimes, motions or aftermaths: not certified, or beyond the stability limit of ``rk4``."""
    found: list[CellWarning] = []
    if data.name not in ("regime", "motion", "aftermath"):
        return found
    if "certified" in ds:
        cells = (ds["certified"] == 0).broadcast_like(data)
        everywhere = bool(cells.any() and not (ds["certified"] == 1).any())
        off = everywhere and not json.loads(ds.attrs.get("solver", "{}")).get("certify", True)
        label = "no cell is certified:\ncertify is false" if off else "not certified"
        found.append(CellWarning(label, "//////", "x", cells, everywhere))
    if "stiffness" in ds:
        # Solvers are slow to import, and only maps of rk4 need this one.
        from ringsweep.solvers.rk4 import STABILITY_LIMIT

        beyond = (ds["stiffness"] > STABILITY_LIMIT).broadcast_like(data)
        found.append(CellWarning("step beyond\nstability limit", "..", "+", beyond, bool(beyond.all())))
    if len(found) == 2 and found[0].cells.equals(found[1].cells) and "false" not in found[0].label:
        both = "not certified: step\nbeyond stability limit"
        found = [CellWarning(both, "//////", "x", found[0].cells, found[0].everywhere)]
    return [warning for warning in found if warning.cells.any()]


def missing_text(ds: xr.Dataset, data: xr.DataArray) -> str:
    """What it means that cells have no value, as far as the dataset tells."""
    name, missing = str(data.name), data.isnull()
    text = "no bound" if name.endswith("_error") else _ABSENT.get(name, "no value")
    # A run that jams or fails ends before its span.
    ended_early = "regime" in ds and bool((missing & ds["regime"].isin([JAMMED, FAILED])).any())
    if name in _EVENTS and not ended_early and (span := _span(ds)):
        text += f"\nwithin {span}"
    if "origin" in ds and (missing & (inferred := ds["origin"] == INFERRED)).any():
        text = f"{text}, or\n" * bool((missing & ~inferred).any()) + "inferred, not run"
    return text


# Events that a run may lack, and what it lacks if another variable is missing.
_EVENTS = {"t_separation": "no separation", "first_slip": "no slip"}
_ABSENT = _EVENTS | dict.fromkeys(("period", "stick_share", "stops_per_cycle", "swing"), "no cycle")
_ABSENT |= {"t_recovered": "none lost, or\nopen at the end"}


def _span(ds: xr.Dataset) -> str:
    """Span of the runs as text; empty if the dataset does not tell it, or if it was swept."""
    if "configuration" not in ds.attrs or any(c.attrs.get("path") == "time.span" for c in ds.coords.values()):
        return ""
    span = written(configuration_of(ds), "time.span") or ""
    return str(span) if isinstance(span, str) else f"{number_text(span, 'g')} s"


def _with_grey(colours: str | colors.Colormap) -> colors.Colormap:
    """A colour map with grey for missing values."""
    palette = colormaps[colours] if isinstance(colours, str) else colours
    return palette.with_extremes(bad=colors.to_rgb(look.on_page(look.NO_VALUE)))


def share_text(mask: NDArray[Any]) -> str:
    percent = 100 * float(np.mean(mask))
    return "< 0.1 %" if percent < 0.1 else "> 99.9 %" if 99.9 < percent < 100 else f"{percent:.1f} %"
