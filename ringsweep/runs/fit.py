"""Fit of numbers of a scene to a measured history, by lmfit."""

from __future__ import annotations

import json
import logging
import os
from collections.abc import Mapping, Sequence
from functools import lru_cache, partial
from typing import TYPE_CHECKING, Any

import numpy as np
import xarray as xr

from ringsweep.compile import readable_compile_errors
from ringsweep.config import Config, as_named, load, sweepable, with_values
from ringsweep.config.axes import dimension
from ringsweep.config.reading import Document, name_and_unit, one_of, read_values
from ringsweep.errors import InputError
from ringsweep.models import batch, model_of
from ringsweep.quantities.parameters import Parameter
from ringsweep.quantities.units import quantity, show
from ringsweep.quantities.variables import HISTORY, configuration_of
from ringsweep.runs.boundaries import run_points
from ringsweep.runs.executors import interruptible
from ringsweep.runs.thresholds import interval
from ringsweep.statistics import Floats, unit_points
from ringsweep.storage.provenance import attributes

if TYPE_CHECKING:
    from lmfit.model import ModelResult

logger = logging.getLogger("ringsweep")

# Points at which the misfit is tried, for each start that is chosen among them.
_TRIED = 64

# Instants of a history: between them cubics err by 1e-9 where the angle varies by 1.
_INSTANTS = 2000

# Correlation of neighbouring residuals, in its standard deviations, from which they are not independent.
_NEIGHBOURS = 4.0

# Quantities whose rate of change the history holds too.
_RATES = {"phi": "omega", "omega": "epsilon", "x": "velocity"}


def fit(
    config: str | os.PathLike[str] | Mapping[str, Any] | xr.Dataset,
    data: Any,
    vary: str | Sequence[str] | Mapping[str, Any],
    *,
    start: int = 8,
    noise: Any = None,
) -> ModelResult:
    """Fit numbers of a scene to a measured history, by `lmfit <https://lmfit.github.io/lmfit-py/>`_.

    Starts of the least squares are the best of many points of the ranges. A run that ends before the last measurement,
    because a contact is lost or the body jams, holds its last state from then on.

    Parameters
    ----------
    config : path, mapping or Dataset
        A configuration, the mapping under ``scene`` in one, or the result of a sweep.
    data : path, mapping or DataFrame
        Measured history: a column ``t`` (s), and one of a quantity of the history, such as ``phi`` or ``x``. A file is
        a CSV file with these names in its first line, with units in brackets: ``phi (deg)``.
    vary : str, sequence of str, or mapping
        Paths of the numbers to fit, separated by commas. ``path=low..high`` is where starts are looked for; by default
        where the configuration sweeps the path, else from half to twice the value of the scene. In a mapping, pairs of
        values, or None. A fit may leave this range, but not the values that the scene allows.
    start : int, optional
        Number of minimisations, each from its own start.
    noise : float or str, optional
        Standard deviation of a measurement, in the unit of the quantity; by default estimated from the residuals.

    Returns
    -------
    lmfit.model.ModelResult
        ``fit_report()``, ``conf_interval()``, ``params`` (by paths with ``_`` for each dot, in SI units), ``best_fit``,
        ``plot()``, ``dumps()`` and whatever else lmfit has.

    Raises
    ------
    InputError
        If lmfit is not installed, or the configuration, the data, a path or a range is wrong.

    Warns
    -----
    Through the logger ``"ringsweep"``: residuals that are like their neighbours, a fitted run that ends early or is not
    certified.

    Examples
    --------
    >>> import numpy as np
    >>> import ringsweep
    >>> scene = {
    ...     "model": "belt",
    ...     "body": {"mass": 1.0},
    ...     "spring": {"stiffness": 2.0},
    ...     "belt": {"velocity": 0.1},
    ...     "friction": {"law": "stiction", "mu_s": 0.15, "mu_k": 0.1},
    ...     "time": {"span": 20.0},
    ... }
    >>> run = ringsweep.simulate(scene)
    >>> t = np.linspace(0.0, 20.0, 101)
    >>> x = run.ringsweep.at(t).x.values + 1e-3 * np.random.default_rng(1).standard_normal(101)
    >>> found = ringsweep.fit(scene, {"t": t, "x": x}, "friction.mu_k, friction.mu_s=0.1..0.3")
    >>> [round(param.value, 2) for param in found.params.values()]
    [0.1, 0.15]
    """
    if isinstance(config, xr.Dataset):
        config = configuration_of(config)
    elif isinstance(config, Mapping) and "scene" not in config:
        config = {"scene": config}
    return interruptible(partial(fitted, load(config), data, vary, start, noise))


def fitted(config: Config, data: Any, vary: Any, start: Any = 8, noise: Any = None) -> ModelResult:
    """Fit of a configuration; see :func:`fit`."""
    try:
        from lmfit import Model, Parameters
    except ImportError:
        raise InputError("fit", "lmfit is not installed: pip install 'ringsweep[fit]'") from None
    doc = Document()
    with doc.locating_errors():
        name, t, measured = _measurements(config, doc, data)
    ranges = _ranges(config, vary)
    if len(t) <= len(ranges):
        raise InputError("data", f"{len(t)} measurements are too few for {len(ranges)} numbers: give more")
    starts = int(quantity(start, Parameter("1", "number of starts", lower=1, upper=1000, whole=True), "start"))
    # Its square is computed with.
    scatter = Parameter(HISTORY[name].unit, "noise of a measurement", lower=1e-150, upper=1e150)
    weights = None if noise is None else np.full(len(t), 1.0 / quantity(noise, scatter, "noise"))
    low, high = np.transpose(list(ranges.values()))
    own = np.array([config.scene.values.get(path, np.nan) for path in ranges])
    first = np.where((low <= own) & (own <= high), own, 0.5 * (low + high))
    numbers = dict(zip(ranges, first.tolist(), strict=True))
    try:
        one = with_values(config.source, [*numbers.items(), ("time.span", float(t[-1]))])
    except InputError as error:
        raise InputError("vary", f"starts at {numbers}: {error.path}: {error.problem}") from None
    if one.axes.sizes:
        raise InputError("sweep", "several friction laws, but a fit has one: leave the others out")
    given = {"quantity": name, "configuration": _Configuration(json.dumps(one.source))}
    model = Model(history_with, ["t"], nan_policy="propagate", **given)

    shares = unit_points("sobol", 1 << (starts * _TRIED - 1).bit_length(), len(low), 0, 0)
    points = np.concatenate([first[None], low + (high - low) * shares])
    names = list(map(dimension, ranges))
    tried = np.array([model.eval(t=t, **dict(zip(names, point, strict=True))) for point in points])
    nearest = apart((points - low) / (high - low), np.sum((tried - measured) ** 2, axis=1), starts)
    if not nearest:
        raise InputError("vary", "no point of these ranges makes a scene that is allowed: other ranges are needed")
    fits = []
    for k in nearest:
        params, known = Parameters(), sweepable(config.scene)
        for path, value in zip(ranges, points[k], strict=True):
            parameter: Any = known[path]
            params.add(dimension(path), value, min=parameter.lower, max=parameter.upper)
        # Steps of differences are above the errors of a run, and below the curvature of the model.
        steps = {"epsfcn": 1e-8}
        fits.append(model.fit(measured, params, weights, t=t, scale_covar=noise is None, fit_kws=steps))
    best = min(fits, key=lambda found: found.chisqr)

    residuals = measured - best.best_fit
    alike = float(residuals[1:] @ residuals[:-1]) / (float(residuals @ residuals) or 1.0)
    if alike > _NEIGHBOURS / np.sqrt(len(t)):
        logger.warning(
            "residuals are like their neighbours (correlation %.2f): the model, or this minimum, is not right, and the "
            "intervals are too short; look at the picture, or try wider ranges and more starts",
            alike,
        )
    for path, width in zip(ranges, high - low, strict=True):
        if (best.params[dimension(path)].stderr or 0.0) > width:
            logger.warning("%s: the data say little of it: its standard error is greater than its range", path)
    run = run_points(one, {path: np.array([best.best_values[dimension(path)]]) for path in ranges}, 1).isel(point=0)
    if held := int((t > float(run["t_end"])).sum()):
        early = "the fitted run ends at %.6g s: %d of %d residuals are those of its last state, and say little"
        logger.warning(early, run["t_end"], held, len(t))
    if one.certifies and run["certified"] != 1:
        logger.warning("the fitted run is not certified")
    return best


def _measurements(config: Config, doc: Document, data: Any) -> tuple[str, Floats, Floats]:
    """Name of what is measured, times and values, in SI units."""
    if isinstance(data, str | os.PathLike):
        data = doc.inline_csv(os.fspath(data), "data", "data")
    if not isinstance(data, Mapping) and not hasattr(data, "columns"):
        raise InputError("data", f"a CSV file, a mapping or a DataFrame is expected, got {show(data)}")
    columns = {}
    for header, column in data.items():
        name, unit = name_and_unit(str(header))
        columns[name or str(header)] = [f"{value} {unit}" for value in column] if unit else np.asarray(column)
    if "t" not in columns or len(columns) != 2:
        got = ", ".join(columns) or "none"
        raise InputError("data", f"two columns are expected, t and a quantity such as phi or x, got {got}")
    t = read_values(columns.pop("t"), Parameter("s", "time of a measurement", lower=0.0), "data.t")
    for i in np.flatnonzero(np.diff(t) <= 0.0)[:1]:
        raise InputError(f"data.t.{i + 1}", f"{t[i + 1]:g} s does not come after {t[i]:g} s")
    if t[0] > (span := config.scene.values.get("time.span", np.inf)):
        cure = "times count from the launch; subtract its time stamp from each, or raise time.span"
        raise InputError("data.t", f"begins at {t[0]:g} s, after time.span, {span:g} s: {cure}")
    ((given, column),) = columns.items()
    model = model_of(config.scene.structure)
    known = [name for name in model.history(config.scene.structure) if name in HISTORY and name not in model.absent]
    name = one_of(given, known, f"data.{given}", "is no quantity of the history")
    measured = read_values(column, Parameter(HISTORY[name].unit, HISTORY[name].long_name), f"data.{name}")
    if len(measured) != len(t):
        raise InputError(f"data.{name}", f"{len(measured)} values for {len(t)} times")
    return name, t, measured


def _ranges(config: Config, vary: Any) -> dict[str, tuple[float, float]]:
    """Where starts are looked for, by path."""
    if isinstance(vary, list | tuple):
        vary = ",".join(map(str, vary))
    if isinstance(vary, str):
        parts = ([piece.strip() for piece in part.partition("=")] for part in vary.split(","))
        vary = {path: ends.split("..") if equals else None for path, equals, ends in parts if path}
    if not isinstance(vary, Mapping) or not vary:
        raise InputError("vary", f"paths are expected, such as friction.rough.mu_k, got {show(vary)}")
    found: dict[str, tuple[float, float]] = {}
    known: Mapping[str, Any] = sweepable(config.scene)
    for given, ends in vary.items():
        path = as_named(given, config.scene.structure.elsewhere)
        if path == "time.span":
            raise InputError("vary", "time.span has no influence on a measured history: it ends with the last time")
        if ends is None and path not in config.axes.columns and (own := config.scene.values.get(path)):
            halved, doubled = sorted((0.5 * own, 2.0 * own))
            ends = max(halved, known[path].lower), min(doubled, known[path].upper)
        forms = (("--vary", f"{path}={form}") for form in ("{}..HIGH", "LOW..{}"))
        try:
            found[path] = interval(config, path, ends, *forms)
        except InputError as error:
            form = f" ({path}=LOW..HIGH)" if path in known and np.size(ends) != 2 else ""
            raise InputError(f"vary.{path}", error.problem + form) from None
    return found


class _Configuration(str):
    """A configuration that reports of lmfit do not print."""

    def __format__(self, spec: str) -> str:
        return "..."


def history_with(**given: Any) -> Floats:
    """A quantity of the history of a single run at some times (s), with some numbers of the scene changed.

    After the end of the run it keeps its last value. It is NaN where the scene does not allow the numbers.

    Parameters
    ----------
    t : ndarray
    quantity : str
        Such as ``"phi"``.
    configuration : str
        A configuration in JSON, as a result file has it.
    others : float
        Numbers by their paths with ``_`` for each dot, in SI units.
    """
    # It is slow to import, and only fits need it.
    from scipy.interpolate import CubicHermiteSpline

    t, quantity, (config, paths) = given["t"], given["quantity"], _single_run(given["configuration"])
    names = list(model_of(config.scene.structure).history(config.scene.structure))
    own = {paths[name]: float(number) for name, number in given.items() if name in paths}
    try:
        values = {path: np.array([value]) for path, value in {**config.scene.values, **own}.items()}
        cell = batch(config.scene.structure, values)
    except InputError:
        return np.full(len(t), np.nan)
    with readable_compile_errors():
        times, rows = config.solver.history(cell, _INSTANTS, len(names))
    # An event stores the states before and after it at one instant: here the second comes a rounding later.
    times = times + np.arange(len(times)) * 2.0 * np.spacing(times[-1])
    at, column, rate = np.minimum(t, times[-1]), rows[:, names.index(quantity)], _RATES.get(quantity)
    if rate in names and len(times) > 1:
        return np.asarray(CubicHermiteSpline(times, column, rows[:, names.index(rate)])(at))
    return np.interp(at, times, column)


@lru_cache(maxsize=8)
def _single_run(configuration: str) -> tuple[Config, dict[str, str]]:
    """A configuration, and the paths of its numbers by their names here."""
    config = load(json.loads(configuration))
    return config, {dimension(path): path for path in sweepable(config.scene)}


def apart(points: Floats, misfits: Floats, count: int) -> list[int]:
    """Which points are starts: the best ones, each in a part of the ranges of its own while there are enough."""
    distance, found = 0.5 * count ** (-1.0 / points.shape[1]), list[int]()
    for k in np.argsort(misfits, kind="stable").tolist():
        if np.isfinite(misfits[k]) and all(np.abs(points[k] - points[other]).max() >= distance for other in found):
            found.append(k)
    return found[:count]


def dataset(found: ModelResult) -> xr.Dataset:
    """A fit as the command stores it: history, residuals, the report of lmfit, and all that lmfit has of it."""
    config, paths = _single_run(found.model.opts["configuration"])
    numbers = [(paths[name], value) for name, value in found.params.valuesdict().items()]
    about = HISTORY[found.model.opts["quantity"]].attributes
    columns = {"measured": found.data, "fitted": found.best_fit, "residual": found.data - found.best_fit}
    return xr.Dataset(
        {name: ("measurement", column, about) for name, column in columns.items()} | {"lmfit": ((), found.dumps())},
        coords={"t": ("measurement", found.userkws["t"], {"long_name": "time", "units": "s"})},
        attrs=attributes(with_values(config.source, numbers)) | {"fit_report": found.fit_report()},
    )
