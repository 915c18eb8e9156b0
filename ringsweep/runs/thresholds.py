"""The values of one number at which a regime begins or ends."""

from __future__ import annotations

import os
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from math import ceil, floor, log10
from typing import Any

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from ringsweep.config import Config, as_named, load, sweepable, tell_unit, with_values
from ringsweep.config.axes import Axes, dimension, sweep_section, swept_parameter, swept_paths
from ringsweep.config.reading import read
from ringsweep.errors import InputError
from ringsweep.quantities.parameters import Key, Parameter
from ringsweep.quantities.quantity import after_number
from ringsweep.quantities.units import check_unit, quantity, show, spelled
from ringsweep.quantities.variables import QUANTILE_ENDS, common_unit, in_unit, words, written_unit, written_values
from ringsweep.runs.boundaries import bisect, check_word, located, run_points, word_in
from ringsweep.runs.executors import Execution
from ringsweep.runs.sweep import compute
from ringsweep.runs.warnings import warn_of_results
from ringsweep.statistics import quantiles
from ringsweep.storage.provenance import attributes

#: Levels of the quantiles of a threshold.
LEVELS = (0.05, 0.25, 0.5, 0.75, 0.95)

#: Number of runs in which changes of the regime are looked for.
SCAN = 128

# Error allowed, relative to the greatest value.
_TOLERANCE = 1e-6

# From this ratio of the ends on, the runs of a scan stand in geometric progression, unless an axis says how they stand.
_WIDE = 10.0

_MISSED = "two changes between neighbours among these runs would be missed"


def threshold(
    config: str | os.PathLike[str] | Mapping[str, Any],
    path: str,
    regime: str,
    between: Sequence[Any] | None = None,
    tolerance: Any = None,
    *,
    set: Mapping[str, Any] | Iterable[str] = (),  # noqa: A002  as --set
    scan: int | None = None,
    jobs: int | None = None,
    unit: str | None = None,
) -> xr.Dataset:
    """Values of one number of a scene at which a regime begins or ends.

    Runs at values between two ends show between which of them the regime changes. There runs are made halfway until
    the value is known to the tolerance. Only certified runs count: where a run is not certified the value stays as
    uncertain as it is then.

    Parameters
    ----------
    config : path or mapping
        A configuration, the mapping under ``scene`` in one, or a result file. What it sweeps, other than `path`, has
        the value that the scene gives it.
    path : str
        Path of the number, such as ``"drive.amplitude"``.
    regime : str
        Name of the regime, such as ``"separating"``; with ``impact`` in the scene also a word of ``aftermath``.
    between : tuple of two values, optional
        Ends of the interval; text may have a unit. By default those between which the configuration sweeps the path.
    tolerance : float or str, optional
        Largest error, in the unit of the path; by default a millionth of the greatest value.
    set : mapping of str to number or str, optional
        Values that replace those of the scene, by path, as for :func:`ringsweep.simulate`.
    scan : int, optional
        Least number of runs between the ends, both included; 128 by default. Two changes between two of them are
        missed. They divide the intervals between the values that the configuration sweeps. If it sweeps none, they
        stand in geometric progression where the ends have a ratio of 10 or more, else at equal distances.
    jobs : int, optional
        Number of threads; all cores by default.
    unit : str, optional
        Unit of the answer in words; by default that of the ends, or else that of the number in the configuration.

    Returns
    -------
    xarray.Dataset
        Along the dimension ``vertex``: the values as a coordinate, ``error`` (the threshold lies within ± this),
        ``begins`` (1 where the regime begins as the number grows, 0 where it ends) and ``beyond`` (the regime on the
        other side). If the configuration has a sample, the quantiles of the least value.

    Raises
    ------
    InputError
        If the configuration, the path, the regime or an end is wrong.

    Examples
    --------
    A weight at rest on a belt is carried along until the spring pulls with the greatest friction. Within 10 s:

    >>> import ringsweep
    >>> scene = {
    ...     "model": "belt",
    ...     "body": {"mass": 1.0},
    ...     "spring": {"stiffness": 2.0},
    ...     "belt": {"velocity": 0.1},
    ...     "friction": {"law": "stiction", "mu_s": 0.15, "mu_k": 0.1},
    ...     "time": {"span": 10.0},
    ... }
    >>> found = ringsweep.threshold(scene, "friction.mu_s", "riding", (0.12, 0.4))
    >>> found.friction_mu_s.round(5).values, 0.1 * 10.0 * 2.0 / 9.81
    (array([0.20387]), 0.2038735983690112)
    """
    if isinstance(config, Mapping) and "scene" not in config:
        config = {"scene": config}
    settings: list[Any] = list(set.items() if isinstance(set, Mapping) else set)
    whole = load(config, _beside_axes(config, path, settings))
    path = as_named(path, whole.scene.structure.elsewhere)
    sampled = () if whole.sample is None else (one for factor in whole.sample.factors for one in factor.paths)
    check_word(regime, whole.scene, {path, *whole.axes.columns, *sampled})
    low, high = interval(whole, path, between)
    si = sweepable(whole.scene)[path].attributes["units"]
    if unit is None:
        given = (str(spelled(end)) for end in (() if between is None else between) if end is not None)
        unit = common_unit(given) or written_unit(whole.source, path)
    else:
        check_unit(unit, Parameter(si, path), "unit")
    within = Parameter(si, "tolerance of a threshold", lower=0.0, open_lower=True)
    allowed = quantity(_TOLERANCE * max(abs(low), abs(high)) if tolerance is None else tolerance, within, "tolerance")
    count = SCAN if scan is None else int(quantity(scan, Parameter("1", "number of runs", lower=2, whole=True), "scan"))
    values = _to_scan(whole.axes.columns.get(path), low, high, count)
    if whole.sample is not None:
        found = distribution(whole, path, regime, values, allowed, jobs=jobs)
        return found.assign_attrs(threshold_unit=unit)
    try:
        one = with_values(config, [*settings, (path, low)])
    except InputError as error:
        if error.problem.startswith("missing"):
            raise
        raise InputError("from", f"{path} = {low:g} is not allowed: {error.path}: {error.problem}") from None
    if one.axes.sizes:
        raise InputError("sweep", "several friction laws, but a threshold is that of one: --set friction.law=...")
    scanned = load(dict(one.source) | {"sweep": {"grid": {path: values.tolist()}}})
    runs = compute(scanned, Execution(jobs, progress=False), warn=False)
    warn_of_results(runs, scanned, counted=True)
    name = dimension(path)
    sure = runs.isel({name: (runs["certified"].values == 1) | (not scanned.certifies)})
    found = located(sure, regime, scanned, allowed, jobs=jobs)
    above = np.searchsorted(sure[name].values, found[name].values)
    label, _ = word_in(sure, regime)
    begins = (words(sure[label]).values[above] == regime).astype(np.int8)
    flags = {"flag_values": np.arange(2, dtype=np.int8), "flag_meanings": "ends begins"}
    return (
        found.drop_vars(["line", "axis"])
        .assign(begins=("vertex", begins, {"long_name": "whether the regime begins as the number grows"} | flags))
        .assign_attrs(threshold_path=path, threshold_unit=unit, scan=_scanned(runs, in_unit(runs[name], unit), label))
    )


def _to_scan(swept: tuple[Any, NDArray[np.float64]] | None, low: float, high: float, count: int) -> NDArray[np.float64]:
    """Values of the runs of a scan. Those that are swept are among them: a scan misses nothing that a map shows."""
    if swept is None:
        return (np.geomspace if low > 0.0 and high >= _WIDE * low else np.linspace)(low, high, count)
    inner = swept[1][(low < swept[1]) & (swept[1] < high)]
    known = np.unique(np.concatenate([[low, high], inner]))
    parts = ceil((count - 1) / (len(known) - 1))
    return np.interp(np.arange(parts * (len(known) - 1) + 1) / parts, np.arange(len(known)), known)


def distribution(
    config: Config, path: str, regime: str, values: NDArray[np.float64], tolerance: float, *, jobs: int | None = None
) -> xr.Dataset:
    """Distribution of the least value of a number at which a regime begins, over the sample of a configuration.

    Each point of the sample has its own threshold. It is infinite if the regime begins nowhere in the interval, and
    negatively infinite if it is there at the first value already. Where runs that decide it are not certified, it is
    not known, and counts both ways in the intervals of the quantiles.

    Parameters
    ----------
    config : Config
        With a sample, and no axes but `path`.
    path, regime : str
    values : ndarray of shape ``(scan,)``
        Values of the number at which changes of the regime are looked for.
    tolerance : float
        Largest error of a threshold.
    jobs : int, optional

    Returns
    -------
    xarray.Dataset
        ``threshold`` (dimensions ``replicate`` and ``sample``; NaN where it is not known), and along ``quantile``
        ``threshold_quantile`` with ``threshold_quantile_low`` and ``threshold_quantile_high`` (95 %).

    Raises
    ------
    InputError
        If the sweep has other axes, or a number of the sample is a ratio to the one that varies.
    """
    assert config.sample is not None
    sample = replace(config.sample, sensitivity=False, sensitive=(), keep=False, quantiles={}, survival=())
    if others := [name for name in config.axes.columns if name != path]:
        raise InputError("sweep", f"also varies {', '.join(others)}, but a threshold is that of one cell: leave it out")
    for factor in sample.factors:
        if path in factor.paths:
            raise InputError("path", f"{path} is uncertain itself: a threshold is that of another number")
        if factor.over == path:
            raise InputError("path", f"{factor.paths[0]} is drawn over {path}: give it a distribution of its own")
    size = sample.size
    shares = sample.shares
    drawn = {name: column for name, (_, column) in sample.axes(config.scene, Axes(), shares).columns.items()}

    def runs(points: NDArray[np.intp], at: NDArray[np.float64]) -> tuple[NDArray[np.bool_], NDArray[np.bool_]]:
        """Whether runs of some points of the sample are in the regime, and whether they are certified."""
        found = run_points(config, {name: column[points] for name, column in drawn.items()} | {path: at}, jobs)
        label, flag = word_in(found, regime)
        return found[label].values == flag, (found["certified"].values == 1) | (not config.certifies)

    total, every = len(shares), np.arange(len(shares))
    inside, sure = (part.reshape(total, -1) for part in runs(np.repeat(every, len(values)), np.tile(values, total)))
    begins = inside.argmax(axis=1)
    never = ~inside.any(axis=1)
    # Runs before the first in the regime decide that it is the first.
    deciding = np.where(never, len(values), begins + 1)
    known = np.logical_and.reduce(sure | (np.arange(len(values)) >= deciding[:, None]), axis=1)
    found: NDArray[np.float64] = np.where(never, np.inf, np.where(begins == 0, -np.inf, 0.0))
    inner = (found == 0.0) & known
    ends = values[np.stack([np.maximum(begins - 1, 0), begins])]

    def run(which: NDArray[np.intp], at: NDArray[np.float64]) -> tuple[NDArray[np.bool_], NDArray[np.bool_]]:
        here, certain = runs(which, at)
        known[which[~certain]] = False
        return ~here, certain

    bisect(ends, tolerance, run, inner)
    found = np.where(known, np.where(inner, 0.5 * (ends[0] + ends[1]), found), np.nan).reshape(sample.replicates, size)
    columns = quantiles(found, LEVELS, sample.independent)
    parameter = sweepable(config.scene)[path]
    about = parameter.attributes
    return xr.Dataset(
        {
            "threshold": (("replicate", "sample"), found, about | {"long_name": f"{path} at which {regime} begins"}),
            **{
                f"threshold_quantile{end}": ("quantile", column, about | {"long_name": f"{name} of the threshold"})
                for (end, name), column in zip(QUANTILE_ENDS.items(), columns, strict=True)
            },
        },
        coords={"quantile": ("quantile", list(LEVELS), {"units": "1", "long_name": "level of the quantile"})},
        attrs=attributes(config)
        | {
            "threshold_path": path,
            "boundary_of": regime,
            "boundary_tolerance": tolerance,
            "scan": f"{len(values)} runs for each of {total} points of the sample",
        },
    )


def interval(whole: Config, path: str, between: Any, *forms: tuple[str, str]) -> tuple[float, float]:
    """Ends of an interval in SI units: as given, or those of the sweep; `forms` are options as for `tell_unit`."""
    parameter = swept_parameter(sweepable(whole.scene), path, "path")
    if isinstance(parameter, Key) or parameter.whole:
        raise InputError("path", f"{path} is no number that varies continuously: there is nothing to halve")
    try:
        low, high = (None, None) if between is None else between
    except (TypeError, ValueError):
        problem = f"the two ends of an interval are expected, such as (0.5, 8), got {show(between)}"
        raise InputError("between", problem) from None
    swept = whole.axes.columns
    own: NDArray[Any] | None = swept[path][1] if path in swept else None
    ends = []
    forms = forms or (("--from", "{}"), ("--to", "{}"))
    for where, form, given, of_sweep in zip(("from", "to"), forms, (low, high), (np.min, np.max), strict=True):
        if given is None and own is None:
            options = " and ".join(dict.fromkeys(option for option, _ in forms))
            raise InputError(where, f"the configuration does not sweep {path}: say where to look, by {options}")
        if isinstance(given, str):
            tell_unit(*form, given, written_values(whole.source, path)[0], parameter)
        ends.append(float(of_sweep(np.asarray(own))) if given is None else quantity(given, parameter, where))
    if not ends[0] < ends[1]:
        unit = after_number(parameter.unit)
        raise InputError("to", f"{ends[1]:g}{unit} is not greater than {ends[0]:g}{unit}, where the interval begins")
    return ends[0], ends[1]


def _beside_axes(config: Any, path: str, settings: list[Any]) -> list[Any]:
    """Settings without those of axes other than `path`: what is swept beside it has one value here, which they give."""
    doc = read(config)
    with doc.locating_errors():
        sweep = sweep_section(doc)
    others = set() if "sample" in sweep else set(swept_paths(sweep)) - {path.removeprefix("scene.")}
    paths = (one.partition("=")[0].strip() if isinstance(one, str) else one[0] for one in settings)
    known = zip(settings, paths, strict=True)
    return [one for one, given in known if given.removeprefix("scene.") not in others]


def _scanned(runs: xr.Dataset, axis: xr.DataArray, label: str) -> str:
    """What a scan found, in words."""
    regimes = words(runs[label]).values
    seen = ", ".join(f"{count} {regime}" for regime, count in zip(*np.unique(regimes, return_counts=True), strict=True))
    ends = " to ".join(f"{end:.6g}{after_number(axis.attrs.get('units', '1'))}" for end in axis.values[[0, -1]])
    text = f"{len(regimes)} runs from {ends}: {seen}"
    unsure = int((runs["certified"] != 1).sum())
    return text + (f"; {unsure} not certified" if unsure else "")


def plain(found: xr.Dataset) -> dict[str, Any]:
    """What :func:`threshold` found, as plain numbers in the unit of the answer."""
    path, unit = found.attrs["threshold_path"], found.attrs.get("threshold_unit", "")
    if "quantile" in found.dims:
        si = found["threshold"].attrs.get("units", "1")
        columns = {"value": found["threshold_quantile"]}
        columns |= {end: found[f"threshold_quantile_{end}"] for end in ("low", "high")}
        labels = {"share": found["quantile"].values.tolist()}
    else:
        si = found[dimension(path)].attrs.get("units", "1")
        columns = {"value": found[dimension(path)], "error": found["error"]}
        does = np.where(found["begins"] == 1, "begins", "ends").tolist()
        labels = {"does": does, "beyond": words(found["beyond"]).values.tolist()}
    numbers = {name: in_unit(column.assign_attrs(units=si), unit) for name, column in columns.items()}
    labels |= {name: column.values.tolist() for name, column in numbers.items()}
    return {
        "path": path,
        "regime": found.attrs["boundary_of"],
        "unit": numbers["value"].attrs["units"],
        "thresholds": [dict(zip(labels, row, strict=True)) for row in zip(*labels.values(), strict=True)],
        "scan": found.attrs["scan"],
    }


def in_words(found: xr.Dataset) -> str:
    """What :func:`threshold` found, a line for each threshold."""
    told = plain(found)
    path, regime, unit = told["path"], told["regime"], after_number(told["unit"])
    if "quantile" in found.dims:
        values = found["threshold"].values
        counts = {
            "begins at the first value or before": np.count_nonzero(np.isneginf(values)),
            "begins nowhere there": np.count_nonzero(np.isposinf(values)),
            "is not known, for lack of certified runs": np.count_nonzero(np.isnan(values)),
        }
        lines = [f"{regime} begins at {path}, by its probability (95 % interval):"]
        for one in told["thresholds"]:
            interval = f"({one['low']:.6g} to {one['high']:.6g})"
            lines.append(f"  {one['share']:.0%} below {one['value']:.6g}{unit} {interval}")
        told["scan"] += "".join(f"; in {count} it {what}" for what, count in counts.items() if count)
    else:
        lines = []
        for one in told["thresholds"]:
            # As many digits as the error leaves.
            digits = max(1 - floor(log10(one["error"])), 0) if one["error"] > 0.0 else 15
            at = f"{path} = {one['value']:.{digits}f} ± {one['error']:.1e}{unit}"
            side = "below" if one["does"] == "begins" else "above"
            lines.append(f"{regime} {one['does']} at {at}; {side}: {one['beyond']}")
    return "\n".join(
        [*(lines or [f"{regime} neither begins nor ends along {path}"]), f"scan: {told['scan']}; {_MISSED}"]
    )
