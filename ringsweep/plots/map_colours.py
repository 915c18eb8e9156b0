"""Colours, hatching and legend of a regime map."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import xarray as xr
from matplotlib import colormaps
from matplotlib.artist import Artist
from matplotlib.colors import BoundaryNorm, Colormap, ListedColormap, LogNorm, Normalize, to_rgb
from matplotlib.lines import Line2D
from matplotlib.patches import Patch
from numpy.typing import NDArray

from ringsweep.plots.style import CLASS_COLOURS, NO_VALUE, REGIME_COLOURS


@dataclass(frozen=True)
class ColourScale:
    """Colours of the values of a variable; `flags` and `meanings` are those of a classification."""

    colours: Colormap
    norm: Normalize
    flags: NDArray[Any] | None = None
    meanings: tuple[str, ...] | None = None

    @classmethod
    def of(cls, data: xr.DataArray) -> ColourScale:
        """The colours of a variable: by the meaning of its flags, or from its least to its greatest value."""
        if "flag_values" not in data.attrs:
            finite = data.values[np.isfinite(data.values)]
            positive = finite[finite > 0.0]
            if str(data.name).endswith("_error") and positive.size and positive.max() > positive.min():
                # Bounds on errors differ by powers of ten.
                return cls(_with_grey("viridis"), LogNorm(positive.min(), positive.max()))
            limits = (finite.min(), finite.max()) if finite.size else (0.0, 1.0)
            return cls(_with_grey("viridis"), Normalize(*limits))
        flags = np.atleast_1d(data.attrs["flag_values"])
        meanings = str(data.attrs["flag_meanings"]).split()
        # The colour of a class does not depend on which other classes occur.
        colours = [REGIME_COLOURS.get(m, CLASS_COLOURS[k % len(CLASS_COLOURS)]) for k, m in enumerate(meanings)]
        norm = BoundaryNorm(np.arange(len(flags) + 1) - 0.5, len(flags))
        return cls(_with_grey(ListedColormap(colours)), norm, flags, tuple(m.replace("_", " ") for m in meanings))

    def numbers(self, data: xr.DataArray) -> xr.DataArray:
        """Numbers for `norm`: the value, or the position of its flag; NaN where there is none."""
        numbers = data.astype(float).where(np.isfinite(data))
        if isinstance(self.norm, LogNorm):
            return numbers.clip(min=self.norm.vmin)
        if self.flags is None:
            return numbers
        classes = xr.full_like(numbers, np.nan)
        for k, flag in enumerate(self.flags):
            classes = classes.where(numbers != flag, k)
        return classes

    def rgba(self, numbers: NDArray[Any]) -> NDArray[Any]:
        """Colours of such numbers, shape ``(..., 4)``."""
        return np.asarray(self.colours(self.norm(np.ma.masked_invalid(numbers))))


@dataclass(frozen=True)
class CellWarning:
    """A warning and the cells that have it: in a grid they are hatched, among points they have a marker."""

    label: str
    hatch: str
    marker: str
    cells: xr.DataArray


def cell_warnings(ds: xr.Dataset, data: xr.DataArray) -> list[CellWarning]:
    """Warnings of a map of regimes or motions: not certified, or beyond the stability limit of ``rk4``."""
    if data.name not in ("regime", "motion"):
        return []
    found = []
    if "certified" in ds:
        found.append(CellWarning("not certified", "//////", "x", (ds["certified"] == 0).broadcast_like(data)))
    if "stiffness" in ds:
        # Solvers are slow to import, and only maps of rk4 need this one.
        from ringsweep.solvers.rk4 import STABILITY_LIMIT

        beyond = (ds["stiffness"] > STABILITY_LIMIT).broadcast_like(data)
        found.append(CellWarning("step beyond\nstability limit", "..", "+", beyond))
    if len(found) == 2 and found[0].cells.equals(found[1].cells):
        found = [CellWarning("not certified: step\nbeyond stability limit", "//////", "x", found[0].cells)]
    return [warning for warning in found if warning.cells.any()]


def legend_entries(
    scale: ColourScale, data: xr.DataArray, warnings: list[CellWarning], scattered: bool
) -> list[Artist]:
    """Entries of the legend for classes, missing values and warnings, each with its share of the cells."""
    entries: list[Artist] = []
    shown = np.isfinite(data.values)
    if scale.flags is not None and scale.meanings is not None:
        shown = np.isin(data.values, scale.flags)
        for k, (flag, meaning) in enumerate(zip(scale.flags, scale.meanings, strict=True)):
            where = data.values == flag
            if where.any():
                entries.append(Patch(color=scale.colours(k), label=f"{meaning}, {_share(where)}"))
    if not shown.all():
        entries.append(Patch(color=NO_VALUE, label=f"no value, {_share(~shown)}"))
    for warning in warnings:
        label = f"{warning.label}, {_share(warning.cells.values)}"
        if scattered:
            entries.append(Line2D([], [], color="black", linestyle="", marker=warning.marker, label=label))
        else:
            entries.append(Patch(facecolor="white", edgecolor="black", hatch=warning.hatch, linewidth=0.5, label=label))
            entries[-1].set(hatch_linewidth=0.5)
    return entries


def _with_grey(colours: str | Colormap) -> Colormap:
    """A colour map with grey for missing values."""
    return (colormaps[colours] if isinstance(colours, str) else colours).with_extremes(bad=to_rgb(NO_VALUE))


def _share(mask: NDArray[Any]) -> str:
    percent = 100 * float(np.mean(mask))
    return "< 0.1 %" if percent < 0.1 else "> 99.9 %" if 99.9 < percent < 100 else f"{percent:.1f} %"
