"""Attractors: which cells of a sweep end on the same motion."""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from ringsweep.errors import InputError
from ringsweep.quantities.variables import POINTS, words
from ringsweep.statistics import Floats

#: Long runs and regimes whose motion is a point: then the section is not looked at.
_STILL = ("rest", "steady")
_STEADY = ("sliding",)

#: Long runs and regimes that end on no motion.
_NONE = ("transient", "unbounded")
_ENDED = ("failed", "separating", "jammed")

#: Name of cells that end on no motion.
NONE = "none"

# Clouds of points are one if the points of each lie as near to the other as to their own neighbours, within a factor.
_AS_NEAR = 3.0


class _Motion(NamedTuple):
    """Points of a motion in scaled units, whether they return in this order, and how far the same ones may differ.

    The points have the shape ``(points, variables)``, the distance that of the variables.
    """

    points: Floats
    periodic: bool
    within: Floats


def attractors(ds: xr.Dataset, tolerance: float = 1e-3) -> xr.Dataset:
    """Label the cells of a sweep that end on the same motion, and tell the share of each motion.

    Motions are compared by their last points (``record.section``). Points that return in the same order are a periodic
    motion. Two of these are the same if one is the other from a later point on. Other motions are clouds of points,
    which are the same if each lies as near to the other as its points lie to each other. Steady slip and rest are
    single points. Cells that have not settled, or whose run ended early, have no motion.

    Parameters
    ----------
    ds : xarray.Dataset
        Result of a sweep over initial states with a section. Cells of different parameters are compared too: choose
        one value of other axes before.
    tolerance : float
        Largest distance between two points that are the same, as a share of the range of all points in each variable,
        and for velocities at least of the greatest one. Steady slip and rest are approached, not reached: they may
        also differ by this share of the range of displacements in their runs.

    Returns
    -------
    xarray.Dataset
        ``attractor`` of each cell: a classification, 0 for no motion, the others in the order of their shares. Their
        names are the regime and a number. Along ``label``: ``share`` of the cells and ``share_error``, its standard
        error. For points that is the binomial one of independent draws. For a grid each cell at a boundary counts half
        a cell more or less, all independent of each other: a boundary along the grid errs by more.

    Raises
    ------
    InputError
        If the dataset has no section, or the tolerance is not positive.

    Examples
    --------
    Three runs: two end on one motion of two points, the third at rest:

    >>> import numpy as np, ringsweep, xarray as xr
    >>> x = np.array([[0.0, 1.0] * 4, [1.0, 0.0] * 4, [0.5] * 8])
    >>> dims = "initial_x", "section"
    >>> section = xr.Dataset({"x_section": (dims, x), "velocity_section": (dims, 0.0 * x)})
    >>> found = ringsweep.attractors(section)
    >>> found.attractor.values, found.share.values.round(2)
    (array([1, 1, 2], dtype=int16), array([0.  , 0.67, 0.33]))
    """
    place = next((name for name in POINTS if name in ds), None)
    if place is None:
        raise InputError("ds", "has no section: give record: {section: {at: period}} in the configuration")
    if not tolerance > 0.0:
        raise InputError("tolerance", f"{tolerance!r} is not greater than 0")
    dims = tuple(str(dim) for dim in ds[place].dims if dim != "section")
    ds = ds.transpose(*dims, ..., missing_dims="ignore")
    shape = tuple(ds.sizes[dim] for dim in dims)
    named = {name: words(ds[name]).values.astype(str).ravel() for name in ("regime", "long_run") if name in ds}
    motions = list(_motions(ds, named, tolerance))
    labels = np.zeros(len(motions), dtype=np.int64)
    known: list[_Motion] = []
    for cell, motion in enumerate(motions):
        if motion is not None:
            number = next((k for k, other in enumerate(known) if _same(motion, other)), len(known))
            if number == len(known):
                known.append(motion)
            labels[cell] = number + 1
    # The most frequent first; of equal ones the one that was met first.
    counts = np.bincount(labels, minlength=len(known) + 1)
    order = np.argsort(-counts[1:], kind="stable") + 1
    rank = np.zeros(len(counts), dtype=np.int64)
    rank[order] = np.arange(1, len(counts))
    labels = rank[labels]
    names = [NONE]
    for k in range(1, len(known) + 1):
        # The most frequent regime of its cells.
        own, often = np.unique(named["regime"][labels == k] if "regime" in named else ["motion"], return_counts=True)
        names.append(f"{own[often.argmax()]}_{k}")
    share = np.bincount(labels, minlength=len(names)) / max(len(labels), 1)
    errors = _errors(labels.reshape(shape), share, dims == ("point",) or len(dims) == 0)
    attributes = {"long_name": "motion on which the cell ends", "units": "1", "flag_meanings": " ".join(names)}
    flags = {"flag_values": np.arange(len(names), dtype=np.int16)}
    return xr.Dataset(
        {
            "attractor": (dims, labels.astype(np.int16).reshape(shape), attributes | flags),
            "share": ("label", share, {"long_name": "share of the cells", "units": "1"}),
            "share_error": ("label", errors, {"long_name": "standard error of the share", "units": "1"}),
        },
        coords={
            **{name: coordinate for name, coordinate in ds.coords.items() if set(coordinate.dims) <= set(dims)},
            "label": ("label", names, {"long_name": "motion"}),
        },
        attrs=ds.attrs,
    )


def _motions(ds: xr.Dataset, named: dict[str, NDArray[np.str_]], tolerance: float) -> Iterator[_Motion | None]:
    """The motion of each cell; None if it ends on none."""
    variables = [name for name in POINTS if name in ds and bool(ds[name].notnull().any())]
    points = np.stack([ds[name].values for name in variables], axis=-1)
    points = points.reshape(-1, *points.shape[-2:])
    ends = np.full((len(points), len(variables)), np.nan)
    for k, name in enumerate(variables):
        # The end of a run stands for a motion that is a point.
        state = name.replace("_section", "_end")
        if state in ds:
            ends[:, k] = ds[state].values.ravel()
    if "phi_section" in variables:
        # An angle is a point of a circle.
        variables.append("phi_section")
        points, ends = (
            np.concatenate([np.cos(found[..., :1]), found[..., 1:], np.sin(found[..., :1])], axis=-1)
            for found in (points, ends)
        )
    regime = named.get("regime", np.full(len(points), ""))
    long_run = named.get("long_run", np.full(len(points), ""))
    lost = np.isin(regime, _ENDED) | np.isin(long_run, _NONE)
    if "long_run" not in named and "settled" in ds:
        lost |= ds["settled"].values.ravel() != 1
    still = np.isin(long_run, _STILL) | (np.isin(regime, _STEADY) & (long_run != "periodic"))
    seen = np.concatenate([points[~lost & ~still].reshape(-1, len(variables)), ends[~lost & still]])
    seen = seen[np.isfinite(seen[:, :2]).all(axis=1)]
    scale = np.ptp(seen, axis=0) if len(seen) else np.ones(len(variables))
    # At turns all velocities are zero: their range would be that of rounding.
    if "velocity_max" in ds and (fastest := np.abs(ds["velocity_max"].values[np.isfinite(ds["velocity_max"])])).size:
        scale[1] = max(scale[1], fastest.max())
    scale[~(scale > 0.0)] = 1.0
    within = np.full(len(variables), tolerance)
    travel = np.zeros(len(points))
    if "x_min" in ds and "x_max" in ds:
        travel = (ds["x_max"] - ds["x_min"]).values.ravel()
    for cell in range(len(points)):
        kept = points[cell][np.isfinite(points[cell][:, :2]).all(axis=1)]
        if lost[cell]:
            yield None
        elif still[cell] or not len(kept):
            # The deflection of bristles follows from displacement and velocity here, and its range may be rounding.
            near = np.array([tolerance * max(1.0, travel[cell] / scale[0]), tolerance, np.inf])[: len(variables)]
            end = np.nan_to_num(ends[cell : cell + 1] / scale)
            yield _Motion(end, True, near) if np.isfinite(ends[cell, :2]).all() else None
        else:
            yield _cycle(np.nan_to_num(kept / scale), within)


def _cycle(points: Floats, within: Floats) -> _Motion:
    """The last lap of points that return in the same order twice; all points if they do not."""
    for lap in range(1, len(points) // 2 + 1):
        # Twice the longest lap is the record: shorter ones must return over all of its later half.
        compared = max(lap, len(points) // 2)
        last, before = points[-compared:], points[-compared - lap : len(points) - lap]
        if (np.abs(last - before) <= within).all():
            return _Motion(points[-lap:], True, within)
    return _Motion(points, len(points) == 1, within)


def _same(a: _Motion, b: _Motion) -> bool:
    if a.periodic != b.periodic or (a.periodic and len(a.points) != len(b.points)):
        return False
    within = np.maximum(a.within, b.within)
    if a.periodic:
        starts = np.flatnonzero((np.abs(b.points - a.points[0]) <= within).all(axis=1))
        return any((np.abs(np.roll(b.points, -start, axis=0) - a.points) <= within).all() for start in starts)
    between = np.abs(a.points[:, None] - b.points[None]).max(axis=2)
    spacing = max(_spacing(a.points), _spacing(b.points), within.max())
    return bool(max(np.median(between.min(axis=0)), np.median(between.min(axis=1))) <= _AS_NEAR * spacing)


def _spacing(points: Floats) -> float:
    """Median distance of a point to the nearest other one."""
    distance = np.abs(points[:, None] - points[None]).max(axis=2)
    np.fill_diagonal(distance, np.inf)
    return float(np.median(distance.min(axis=1)))


def _errors(labels: NDArray[np.int64], share: Floats, independent: bool) -> Floats:
    """Standard errors of the shares."""
    if independent:
        return np.sqrt(share * (1.0 - share) / max(labels.size, 1))
    # It is slow to import, and only shares of a grid need it.
    from scipy.ndimage import binary_erosion

    found = np.empty(len(share))
    for k in range(len(share)):
        inside = labels == k
        edge = inside & ~binary_erosion(inside, border_value=1)
        # A share of a cell between 0 and 1, each as probable as the others, has the variance 1/12.
        found[k] = np.sqrt(edge.sum() / 12.0) / labels.size
    return found
