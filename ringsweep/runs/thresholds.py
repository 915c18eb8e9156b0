"""The values of one number at which a regime begins or ends."""

from __future__ import annotations

import os
from collections.abc import Iterable, Mapping
from math import degrees, floor, log10
from typing import Any

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from ringsweep.config import Config, load, sweepable, with_values
from ringsweep.config.axes import dimension, swept_parameter
from ringsweep.errors import InputError
from ringsweep.quantities.parameters import Choice, Parameter
from ringsweep.quantities.units import quantity
from ringsweep.quantities.variables import words
from ringsweep.runs.boundaries import located
from ringsweep.runs.executors import Execution
from ringsweep.runs.sweep import compute

#: Number of runs in which changes of the regime are looked for.
SCAN = 128

# Error allowed, relative to the greatest value.
_TOLERANCE = 1e-6

# From this ratio of the ends on, the runs of a scan stand in geometric progression.
_WIDE = 10.0


def threshold(
    config: str | os.PathLike[str] | Mapping[str, Any],
    path: str,
    regime: str,
    between: tuple[Any, Any] | None = None,
    tolerance: Any = None,
    *,
    scan: int | None = None,
    jobs: int | None = None,
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
        Name of the regime, such as ``"separating"``.
    between : tuple of two values, optional
        Ends of the interval; text may have a unit. By default those between which the configuration sweeps the path.
    tolerance : float or str, optional
        Largest error, in the unit of the path; by default a millionth of the greatest value.
    scan : int, optional
        Number of runs between the ends, both included; 128 by default. Two changes between two of them are missed.
    jobs : int, optional
        Number of threads; all cores by default.

    Returns
    -------
    xarray.Dataset
        Along the dimension ``vertex``: the values as a coordinate, ``error`` (the threshold lies within ± this),
        ``begins`` (1 where the regime begins as the number grows, 0 where it ends) and ``beyond`` (the regime on the
        other side).

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
    return locate(config, path, regime, between or (None, None), tolerance, scan=scan, jobs=jobs)


def locate(
    config: str | os.PathLike[str] | Mapping[str, Any],
    path: str,
    regime: str,
    between: tuple[Any, Any],
    tolerance: Any,
    *,
    scan: int | None = None,
    settings: Iterable[str] = (),
    jobs: int | None = None,
) -> xr.Dataset:
    """Thresholds of a configuration in which some values are changed; see :func:`threshold`.

    Parameters
    ----------
    between : tuple
        An end that is None is that of the sweep.
    settings : iterable of str
        As for :func:`ringsweep.config.with_values`.
    """
    one, low, high = _interval(config, path, between, list(settings))
    parameter = swept_parameter(sweepable(one.scene), path, "path")
    assert isinstance(parameter, Parameter)
    error = Parameter(parameter.unit, "tolerance of a threshold", lower=0.0, open_lower=True)
    allowed = quantity(_TOLERANCE * max(abs(low), abs(high)) if tolerance is None else tolerance, error, "tolerance")
    count = SCAN if scan is None else int(quantity(scan, Parameter("1", "number of runs", lower=2, whole=True), "scan"))
    spaced = np.geomspace if low > 0.0 and high >= _WIDE * low else np.linspace
    values = spaced(low, high, count)
    values[[0, -1]] = low, high
    scanned = load(dict(one.source) | {"sweep": {"grid": {path: values.tolist()}}})
    runs = compute(scanned, Execution(jobs, progress=False))
    name = dimension(path)
    if getattr(scanned.solver, "certify", True):
        sure = runs.isel({name: np.flatnonzero(runs["certified"].values == 1)})
    else:
        sure = runs
    found = located(sure, regime, scanned, allowed, jobs=jobs)
    above = np.searchsorted(sure[name].values, found[name].values)
    begins = (words(sure["regime"]).values[above] == regime).astype(np.int8)
    flags = {"flag_values": np.arange(2, dtype=np.int8), "flag_meanings": "ends begins"}
    return (
        found.drop_vars(["line", "axis"])
        .assign(begins=("vertex", begins, {"long_name": "whether the regime begins as the number grows"} | flags))
        .assign_attrs(threshold_path=path, scan=_scanned(runs, name))
    )


def _interval(config: Any, path: str, between: tuple[Any, Any], settings: list[str]) -> tuple[Config, float, float]:
    """Configuration of a single run, and the ends of the interval in SI units."""
    whole = load(config, settings)
    parameter = swept_parameter(sweepable(whole.scene), path, "path")
    if isinstance(parameter, Choice) or parameter.whole:
        raise InputError("path", f"{path} is no number that varies continuously: there is nothing to halve")
    swept = whole.axes.columns
    own: NDArray[Any] | None = swept[path][1] if path in swept else None
    first = between[0] if between[0] is not None else between[1] if own is None else own.flat[0].item()
    if first is None:
        raise InputError(
            "from",
            f"the configuration does not sweep {path}: say where to look, by --from and --to (in Python: between)",
        )
    one = with_values(config, [*settings, f"{path}={first}"])
    if one.axes.sizes:
        raise InputError("sweep", "several friction laws, but a threshold is that of one: --set friction.law=...")
    ends = []
    for where, given, of_sweep in (("from", between[0], np.min), ("to", between[1], np.max)):
        if given is None and own is None:
            raise InputError(
                where,
                f"the configuration does not sweep {path}: say where to look, by --from and --to (in Python: between)",
            )
        ends.append(float(of_sweep(np.asarray(own))) if given is None else quantity(given, parameter, where))
    if not ends[0] < ends[1]:
        raise InputError("to", f"{ends[1]:g} is not greater than {ends[0]:g}, where the interval begins")
    return one, ends[0], ends[1]


def _scanned(runs: xr.Dataset, name: str) -> str:
    """What a scan found, in words."""
    axis, regimes = runs[name], words(runs["regime"]).values
    seen = ", ".join(f"{count} {regime}" for regime, count in zip(*np.unique(regimes, return_counts=True), strict=True))
    text = f"{len(regimes)} runs from {_number(axis[0].item(), axis)} to {_number(axis[-1].item(), axis)}: {seen}"
    unsure = int((runs["certified"] != 1).sum())
    return text + (f"; {unsure} not certified" if unsure else "")


def _number(value: float, axis: xr.DataArray, digits: str = ".6g") -> str:
    unit = axis.attrs.get("units", "1")
    return f"{value:{digits}}{'' if unit == '1' else f' {unit}'}"


def in_words(found: xr.Dataset) -> str:
    """What :func:`threshold` found, a line for each threshold."""
    path, regime = found.attrs["threshold_path"], found.attrs["boundary_of"]
    axis = found[dimension(path)]
    lines = []
    for value, error, begins, beyond in zip(
        axis.values, found["error"].values, found["begins"].values, words(found["beyond"]).values, strict=True
    ):
        digits = max(1 - floor(log10(error)), 0) if error > 0.0 else 15
        turned = f" ({degrees(value):.{max(digits - 2, 1)}f} deg)" if axis.attrs.get("units") == "rad" else ""
        does, side = ("begins", "below") if begins else ("ends", "above")
        at = f"{path} = {_number(value, axis, f'.{digits}f')} ± {error:.1e}{turned}"
        lines.append(f"{regime} {does} at {at}; {side}: {beyond}")
    if not lines:
        lines.append(f"{regime} neither begins nor ends there")
    return "\n".join([*lines, f"scan: {found.attrs['scan']}; two changes between two of these runs are missed"])
