"""Boundaries of a map as curves."""

from __future__ import annotations

import logging
from collections.abc import Callable, Collection, Mapping
from dataclasses import replace
from itertools import chain
from typing import Any

import numpy as np
import xarray as xr
from contourpy import contour_generator
from numpy.lib.stride_tricks import sliding_window_view
from numpy.typing import NDArray

from ringsweep.config import Axes, Config, load
from ringsweep.config.axes import check_consistency
from ringsweep.config.reading import suggestion
from ringsweep.errors import InputError
from ringsweep.models import WITH_IMPACT, model_of
from ringsweep.models.scene import Scene
from ringsweep.quantities.flags import AFTERMATHS, LONG_RUNS
from ringsweep.quantities.parameters import Parameter
from ringsweep.quantities.units import quantity, show
from ringsweep.quantities.variables import INFERRED, configuration_of, meanings_of, swept
from ringsweep.runs.executors import Execution
from ringsweep.runs.sweep import compute

logger = logging.getLogger("ringsweep")

#: How many cells of a dataset are run again before its boundaries are located.
_CHECKED_CELLS = 64

_TOLERANCE = Parameter("", "tolerance of a boundary", lower=0.0, open_lower=True)


def boundary(ds: xr.Dataset, regime: str, tolerance: float = 1e-6, *, jobs: int | None = None) -> xr.Dataset:
    """Curves between the cells of one regime and the others, located by bisection.

    Between two neighbouring cells of the map, of which one has the regime and the other has not, runs are made halfway
    until the place is known to the tolerance. Only certified runs count: where a run is not certified the place stays
    as uncertain as it is then.

    Parameters
    ----------
    ds : xarray.Dataset
        Result of a sweep over a grid, refined or not, of one or two dimensions. Hold further ones by ``ds.isel`` or
        ``ds.sel``.
    regime : str
        Name of the regime, such as ``"separating"``, or a word of ``aftermath``, such as ``"tumbled"``.
    tolerance : float
        Largest distance of a point from the boundary along its axis, in the unit of that axis (rad for angles).
    jobs : int, optional
        Number of threads; all cores by default.

    Returns
    -------
    xarray.Dataset
        Along the dimension ``vertex``: the swept coordinates, ``line`` (the number of the curve), ``error`` (the
        boundary lies within ± this), ``axis`` (along which of the two) and ``beyond`` (the word on the other side).

    Raises
    ------
    InputError
        If the regime is unknown, the dataset has not one or two grid dimensions, the tolerance is not positive, or the
        cells of the dataset are not those of the configuration in its attributes.

    Examples
    --------
    >>> import ringsweep
    >>> from ringsweep.config import load
    >>> scene = load("my-sweep.yaml").source["scene"]
    >>> maps = ringsweep.sweep(scene, {"drive.amplitude": [0.1, 1.0, 2.0]})
    >>> found = ringsweep.boundary(maps, "separating", 1e-3)
    >>> bool((found.error <= 1e-3).all())
    True
    """
    tolerance = quantity(tolerance, _TOLERANCE, "tolerance")
    label, _, _ = _checked(ds, regime)
    configuration = load(configuration_of(ds))
    check_word(regime, configuration.scene, configuration.axes.columns)
    _check_cells(ds, label, configuration, jobs)
    found = located(ds, regime, configuration, tolerance, jobs=jobs)
    if not found.sizes["vertex"]:
        logger.warning("no boundary of %s: no two neighbouring certified cells differ in it", regime)
    return found


def located(ds: xr.Dataset, regime: str, configuration: Config, tolerance: float, *, jobs: int | None) -> xr.Dataset:
    """Boundary of a regime in a map whose cells are known to be runs of a configuration; see :func:`boundary`."""
    label, flag, dims = _checked(ds, regime)
    inside = ds[label].values == flag
    usable = ds["certified"].values == 1 if configuration.certifies else _was_run(ds)
    # Indices of neighbouring cells, both usable, of which one is inside.
    along = [sliding_window_view(usable, 2, k).all(axis=-1) & np.diff(inside, axis=k) for k in range(len(dims))]
    low, axis = np.concatenate(list(map(np.argwhere, along))), np.repeat(np.arange(len(dims)), list(map(np.sum, along)))
    high = low + np.eye(len(dims), dtype=int)[axis]
    columns = {str(c.name): c for c in swept(ds)}
    place = {name: _values(c, dims, low) for name, c in columns.items()}
    ends = np.zeros((2, len(low)))
    for k, dim in enumerate(dims):
        values = ds[dim].values
        ends[:, axis == k] = values[low[axis == k, k]], values[high[axis == k, k]]
    within = inside[tuple(low.T)]
    beyond = ds[label].values[tuple(np.where(within[:, None], high, low).T)].copy()

    def run(which: NDArray[np.intp], at: NDArray[np.float64]) -> tuple[NDArray[np.bool_], NDArray[np.bool_]]:
        values = {name: column[which] for name, column in place.items()}
        for k, dim in enumerate(dims):
            values[dim] = np.where(axis[which] == k, at, values[dim])
        by_path = {columns[name].attrs["path"]: column for name, column in values.items()}
        found = run_points(configuration, by_path, jobs)
        certified = (found["certified"].values == 1) | (not configuration.certifies)
        here = found[label].values == flag
        outside = ~here & certified
        beyond[which[outside]] = found[label].values[outside]
        return here == within[which], certified

    bisect(ends, tolerance, run)
    for k, dim in enumerate(dims):
        place[dim] = np.where(axis == k, 0.5 * (ends[0] + ends[1]), place[dim])
    order, line = _joined(inside, usable, 0.5 * (low + high))
    error = 0.5 * np.abs(ends[1] - ends[0])
    if count := int((error > tolerance).sum()):
        logger.warning("%d of %d points are less certain than asked for: runs there are not certified", count, len(low))
    axes = {"flag_values": np.arange(len(dims), dtype=np.int8), "flag_meanings": " ".join(dims)}
    return xr.Dataset(
        {
            "line": ("vertex", line, {"long_name": "number of the curve"}),
            "error": ("vertex", error[order], {"long_name": "largest distance of the boundary along its axis"}),
            "axis": ("vertex", axis[order].astype(np.int8), {"long_name": "axis along which it is located", **axes}),
            "beyond": ("vertex", beyond[order].astype(np.int8), ds[label].attrs | {"long_name": f"{label} beyond"}),
        },
        coords={name: ("vertex", column[order], columns[name].attrs) for name, column in place.items()},
        attrs={**ds.attrs, "boundary_of": regime, "boundary_tolerance": tolerance},
    )


def bisect(
    ends: NDArray[np.float64],
    tolerance: float,
    run: Callable[[NDArray[np.intp], NDArray[np.float64]], tuple[NDArray[np.bool_], NDArray[np.bool_]]],
    only: NDArray[np.bool_] | None = None,
) -> None:
    """Halve intervals until the middle of each is within the tolerance, or a run in it is not certified.

    Parameters
    ----------
    ends : ndarray of shape ``(2, intervals)``
        Ends of the intervals, which move.
    tolerance : float
    run : callable
        Takes numbers of intervals and a value in each; returns whether what it finds there is as at the first end, and
        whether that is certified.
    only : ndarray of bool, shape ``(intervals,)``, optional
        Intervals that are halved; all by default.
    """
    left = np.ones(ends.shape[1], dtype=bool) if only is None else only.copy()
    while True:
        middle = 0.5 * (ends[0] + ends[1])
        left &= (np.abs(ends[1] - ends[0]) > 2.0 * tolerance) & (middle != ends[0]) & (middle != ends[1])
        which = np.flatnonzero(left)
        if not len(which):
            return
        first, certified = run(which, middle[which])
        for end, moves in enumerate((first & certified, ~first & certified)):
            ends[end, which[moves]] = middle[which[moves]]
        left[which[~certified]] = False


def run_at(ds: xr.Dataset, held: Mapping[str, float], regime: str, *, jobs: int | None = None) -> xr.Dataset:
    """Run the cells of a map at other values of coordinates that are held, to locate a boundary there.

    Parameters
    ----------
    ds : xarray.Dataset
        As for :func:`boundary`.
    held : mapping of str to float
        By coordinate its other value, in SI units.
    regime : str
        As for :func:`boundary`.
    jobs : int, optional
        Number of threads; all cores by default.

    Returns
    -------
    xarray.Dataset
        The same cells but for those values; refined if the sweep was.

    Raises
    ------
    InputError
        As for :func:`boundary`.
    """
    label, _, dims = _checked(ds, regime)
    source = configuration_of(ds)
    _check_cells(ds, label, load(source), jobs)
    columns = {str(c.name): c for c in swept(ds)}
    fixed = {name: held.get(name, c.item()) for name, c in columns.items() if name not in dims}
    values = {dim: columns[dim].values.tolist() for dim in dims} | {name: [value] for name, value in fixed.items()}
    sweep: dict[str, Any] = {"grid": {columns[name].attrs["path"]: along for name, along in values.items()}}
    if refine := source["sweep"].get("refine"):
        sweep["refine"] = refine
    found = compute(load(source | {"sweep": sweep}), Execution(jobs, progress=False))
    return found.isel(dict.fromkeys(fixed, 0))


def word_in(ds: xr.Dataset, word: str) -> tuple[str, int]:
    """Classification that has a word, `regime`, `aftermath` or `long_run`, and the flag of the word.

    Raises
    ------
    InputError
        If the dataset has no such word.
    """
    known: list[str] = []
    for name in ("regime", "aftermath", "long_run"):
        if name in ds:
            flags = {meaning: flag for flag, meaning in meanings_of(ds[name]).items()}
            if word in flags:
                return name, flags[word]
            known += flags
    raise InputError("regime", f"{show(word)} is not a regime{suggestion(word, known)}")


def check_word(word: object, scene: Scene, varied: Collection[str] = ()) -> None:
    """Refuse a word that no run of a scene can have.

    Parameters
    ----------
    word : object
    scene : Scene
    varied : collection of str
        Paths of numbers that vary.

    Raises
    ------
    InputError
        If it is no word of a regime, of an aftermath or of a long run, or none of this scene.
    """
    structure = scene.structure
    model, after = model_of(structure), WITH_IMPACT.get(structure.model)
    may_go_on = after is not None and "aftermath" in after.outcomes
    known = model.regimes({*varied, *scene.values})
    known += LONG_RUNS if "long_run" in model.columns(structure) else ()
    known += AFTERMATHS if may_go_on and structure.impact else ()
    if word not in known:
        needs_impact = may_go_on and word in AFTERMATHS
        problem = "needs impact in the scene" if needs_impact else "is not a regime of this scene"
        raise InputError("regime", f"{show(word)} {problem}" + suggestion(word, known))


def _checked(ds: xr.Dataset, regime: str) -> tuple[str, int, list[str]]:
    """Classification that has the word, its flag, and the dimensions of the map."""
    if "regime" not in ds or "time" in ds.dims:
        raise InputError("ds", "is no sweep: it has no regimes")
    label, flag = word_in(ds, regime)
    dims = [str(dim) for dim in ds["regime"].dims]
    numeric = {c.name for c in swept(ds) if c.dtype.kind == "f"}
    if not numeric.issuperset(dims) or not 1 <= len(dims) <= 2:
        problem = "one or two axes of numbers are needed; hold others"
        raise InputError("ds", f"has the dimensions {', '.join(dims) or 'none'}: {problem}")
    for coordinate in swept(ds):
        if coordinate.name not in dims and coordinate.dims:
            along, what = ", ".join(map(str, coordinate.dims)), coordinate.name
            raise InputError("ds", f"{what} varies along {along}: a boundary needs axes along which one number varies")
    return label, flag, dims


def _check_cells(ds: xr.Dataset, label: str, config: Config, jobs: int | None) -> None:
    """Refuse a dataset whose cells are not those of its configuration: bisection would run another scene."""
    known = {str(c.attrs["path"]): c for c in swept(ds)}
    for path, (_, column) in config.axes.columns.items():
        if path not in known:
            raise InputError("ds", f"has no coordinate for {path}, which its sweep varies: do not drop it")
        foreign = np.setdiff1d(known[path].values, column)
        if len(foreign):
            cure = "give the values and units of the sweep"
            raise InputError("ds", f"has {path} = {foreign[0]}, which its sweep has not: {cure}")
    run = np.argwhere(_was_run(ds))
    if not len(run):
        # A line of a refined map may have inferred cells only.
        return
    cells = run[np.linspace(0, len(run) - 1, min(len(run), _CHECKED_CELLS)).astype(int)]
    dims = [str(dim) for dim in ds["regime"].dims]
    values = {path: _values(c, dims, cells) for path, c in known.items() if path in config.axes.columns}
    again = run_points(config, values, jobs)
    sure = (ds["certified"].values[tuple(cells.T)] == 1) & (again["certified"].values == 1)
    if (sure & (again[label].values != ds[label].values[tuple(cells.T)])).any():
        raise InputError("ds", "has other regimes than runs of its configuration: was it put together from several?")


def _was_run(ds: xr.Dataset) -> NDArray[np.bool_]:
    return ds["origin"].values != INFERRED if "origin" in ds else np.ones(ds["regime"].shape, dtype=bool)


def _values(coordinate: xr.DataArray, dims: list[str], cells: NDArray[np.intp]) -> NDArray[Any]:
    """Values of a coordinate in cells that are given by their indices."""
    index = tuple(cells[:, dims.index(str(dim))] for dim in coordinate.dims)
    return np.array(np.broadcast_to(coordinate.values[index], len(cells)))


def run_points(config: Config, values: Mapping[str, NDArray[Any]], jobs: int | None) -> xr.Dataset:
    """Run a configuration at some values of its paths; the progress of each of many rounds is not shown."""
    axes = Axes({"point": len(next(iter(values.values())))}, {path: (("point",), at) for path, at in values.items()})
    check_consistency(config.scene, axes)
    points = replace(config, axes=axes, refine=None, sample=None)
    return compute(points, Execution(jobs, progress=False), warn=False)


def _joined(
    inside: NDArray[np.bool_], usable: NDArray[np.bool_], middles: NDArray[np.float64]
) -> tuple[NDArray[np.intp], NDArray[np.int32]]:
    """Order of pairs of neighbouring cells along curves, and the number of the curve of each.

    `middles` are the indices halfway between the cells of each pair, shape ``(pairs, dimensions)``.
    """
    number = {tuple(middle): k for k, middle in enumerate(middles.tolist())}
    curves: list[list[int]] = []
    if inside.ndim == 2 and min(inside.shape) > 1:
        levels = np.ma.masked_array(inside.astype(float), ~usable)
        for curve in contour_generator(z=levels, corner_mask=True).lines(0.5):
            # The last point of a closed curve is its first. Beside a cell that is left out, one may be on a diagonal.
            found = (number.get((y, x)) for x, y in np.asarray(curve).tolist())
            curves.append([k for k in dict.fromkeys(found) if k is not None])
    curves += [[k] for k in sorted(set(number.values()).difference(*curves))]
    lengths = [len(curve) for curve in curves]
    order = np.fromiter(chain.from_iterable(curves), np.intp)
    return order, np.repeat(np.arange(len(curves), dtype=np.int32), lengths)
