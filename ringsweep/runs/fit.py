"""Fit of numbers of a scene to a measured history."""

from __future__ import annotations

import logging
import math
import os
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from ringsweep.compile import readable_compile_errors
from ringsweep.config import Config, as_written, load, sweepable, tell_unit, with_values
from ringsweep.config.axes import swept_parameter
from ringsweep.config.sections import read_values, suggestion
from ringsweep.config.yaml_text import Document, name_and_unit
from ringsweep.errors import InputError
from ringsweep.models import batch, model_of
from ringsweep.quantities.parameters import Choice, Parameter
from ringsweep.quantities.quantity import after_number
from ringsweep.quantities.units import quantity, show
from ringsweep.quantities.variables import HISTORY, Variable
from ringsweep.runs.boundaries import run_points
from ringsweep.runs.executors import interruptible
from ringsweep.statistics import CONFIDENCE, unit_points
from ringsweep.storage.provenance import attributes

logger = logging.getLogger("ringsweep")

Floats = NDArray[np.float64]

#: Number of minimisations, each from another start.
STARTS = 8

# Points at which the misfit is tried, for each start that is chosen among them.
_TRIED = 64

# Instants of a history: between them cubics err by 1e-9 where the angle varies by 1.
_INSTANTS = 2000

# Steps of the differences, relative to the ranges: above the errors of a run, below the curvature of the model.
_STEP = 1e-4

# Points of each profile, and how far it reaches in standard errors.
_PROFILE, _REACH = 13, 3.5

# Correlation of neighbouring residuals, in its standard deviations, from which they are not independent.
_NEIGHBOURS = 4.0

# From this correlation on, or below this share of the greatest singular value, two parameters are not told apart.
_ALIKE, _SINGULAR = 0.95, 1e-6

# Quantities whose rate of change the history holds too.
_RATES = {"phi": "omega", "omega": "epsilon", "x": "velocity"}


def fit(
    config: str | os.PathLike[str] | Mapping[str, Any],
    data: Any,
    vary: str | Iterable[str] | Mapping[str, Any],
    *,
    start: int | None = None,
    noise: Any = None,
) -> xr.Dataset:
    """Numbers of a scene with which its history is nearest to a measured one, with 95 % intervals.

    Least squares by ``scipy.optimize.least_squares``, from the best of many points of a scrambled Sobol sequence. A run
    that ends before the last measurement, because a contact is lost or the body jams, holds its last state from then
    on.

    Parameters
    ----------
    config : path or mapping
        A configuration, the mapping under ``scene`` in one, or a result file. What it sweeps is ignored.
    data : path, mapping or DataFrame
        Measured history: a column ``t`` (s), and one of a quantity of the history, such as ``phi`` or ``x``. A file is
        a CSV file with these names in its first line, with units in brackets: ``phi (deg)``.
    vary : str, sequence of str, or mapping
        Paths of the numbers to fit, separated by commas. ``path=low..high`` is where starts are looked for, by default
        from half to twice the value of the scene; in a mapping, pairs of values, or None. A fit may leave this range,
        but not the values that the scene allows.
    start : int, optional
        Number of minimisations; 8 by default.
    noise : float or str, optional
        Standard deviation of a measurement, in the unit of the quantity; by default estimated from the residuals.

    Returns
    -------
    xarray.Dataset
        Along ``parameter``: ``value``, ``standard_error``, ``low`` and ``high`` (95 %), ``profile_low`` and
        ``profile_high`` (95 % of the profile likelihood), and ``unit``; ``covariance`` and ``correlation``; the
        profiles ``profile_value`` and ``profile_misfit``. Along ``measurement``: ``t``, ``measured``, ``fitted`` and
        ``residual``. Along ``start``: the values and the misfit that each minimisation found. A misfit is a sum of
        squared residuals.

    Raises
    ------
    InputError
        If the configuration, the data, a path or a range is wrong.

    Warns
    -----
    Through the logger ``"ringsweep"``: parameters that the data do not tell apart, another minimum that is as good, a
    fitted run that ends early, a value at the end of what is allowed, runs that are not certified.

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
    >>> found.value.round(2).values
    array([0.1 , 0.15])
    """
    if isinstance(config, Mapping) and "scene" not in config:
        config = {"scene": config}
    return fitted(config, data, ranges_of(vary), start=start, noise=noise)


def fitted(
    config: str | os.PathLike[str] | Mapping[str, Any],
    data: Any,
    vary: Mapping[str, Any],
    *,
    start: int | None = None,
    noise: Any = None,
    settings: Iterable[str] = (),
) -> xr.Dataset:
    """Fit of a configuration in which some values are changed; see :func:`fit`."""
    settings = list(settings)
    whole = load(config, settings)
    factors = _factors(whole, vary)
    doc = Document({}, Path())
    with doc.locating_errors():
        problem, column = _problem(config, settings, factors, _columns(doc, data))
        span = whole.scene.values.get("time.span", math.inf)
        if problem.times[0] > span:
            raise InputError(
                "data.t",
                f"begins at {problem.times[0]:g} s, after time.span, {span:g} s: times count from the launch; subtract "
                "its time stamp from each, or raise time.span",
            )
    # Its square is computed with.
    scatter = Parameter(column.unit, "noise of a measurement", lower=1e-150, upper=1e150)
    deviation = None if noise is None else quantity(noise, scatter, "noise")
    whole_number = Parameter("1", "number of starts", lower=1, upper=1000, whole=True)
    starts = int(quantity(STARTS if start is None else start, whole_number, "start"))
    return interruptible(partial(_fit, problem, deviation, starts, column))


def _problem(
    config: Any, settings: list[str], factors: list[_Factor], columns: Mapping[str, Any]
) -> tuple[_Problem, Variable]:
    """The problem, and the declaration of the measured quantity."""
    name, times = _times(columns)
    values = [(factor.path, factor.first) for factor in factors]
    try:
        one = with_values(config, [*settings, *values, ("time.span", float(times[-1]))])
    except InputError as error:
        if error.problem.startswith("missing") or error.path == "scene.time.span":
            raise
        # Nobody gave these settings: the ranges did.
        started = ", ".join(f"{path}={value!r}" for path, value in values)
        raise InputError("vary", f"starts at {started}: {error.path}: {error.problem}") from None
    if one.axes.sizes:
        raise InputError("sweep", "several friction laws, but a fit has one: --set friction.law=...")
    model = model_of(one.scene.structure)
    known = [n for n in model.history(one.scene.structure) if n in HISTORY and HISTORY[n].dtype == "float64"]
    known = [n for n in known if n not in model.absent]
    if name not in known:
        raise InputError(f"data.{name}", "is no quantity of the history" + suggestion(name, known))
    column = HISTORY[name]
    where = Parameter(column.unit, f"measured {column.long_name}")
    numbers = read_values(columns[name], where, f"data.{name}")
    if len(numbers) != len(times):
        raise InputError(f"data.{name}", f"{len(numbers)} values for {len(times)} times")
    if len(numbers) <= len(factors):
        raise InputError("data", f"{len(numbers)} measurements are too few for {len(factors)} numbers: give more")
    return _Problem(one, factors, name, times, numbers), column


# What is given


@dataclass(frozen=True)
class _Factor:
    """A number to fit: where starts are looked for, and what is allowed."""

    path: str
    parameter: Parameter
    low: float
    high: float
    first: float


def ranges_of(vary: Any) -> dict[str, Any]:
    """Ranges of numbers to fit by their paths, from a text such as ``a, b=1..2``, several of them, or a mapping."""
    if isinstance(vary, Mapping):
        return dict(vary)
    texts = [vary] if isinstance(vary, str) else list(vary) if isinstance(vary, Iterable) else [vary]
    found: dict[str, Any] = {}
    for text in texts:
        if not isinstance(text, str):
            raise InputError("vary", f"paths are expected, such as friction.rough.mu_k, got {show(text)}")
        for part in text.split(","):
            path, equals, ends = (piece.strip() for piece in part.partition("="))
            low, dots, high = (piece.strip() for piece in ends.partition(".."))
            if not path or (equals and not (low and dots and high)):
                raise InputError("vary", f"{show(part)} is not of the form PATH or PATH=LOW..HIGH")
            if path in found:
                raise InputError("vary", f"{path} stands twice")
            found[path] = (low, high) if equals else None
    return found


def _factors(config: Config, vary: Mapping[str, Any]) -> list[_Factor]:
    if not vary:
        raise InputError("vary", "empty: name at least one number to fit, such as friction.rough.mu_k")
    known, found = sweepable(config.scene), []
    for path, ends in vary.items():
        parameter = swept_parameter(known, path, f"vary.{path}")
        if isinstance(parameter, Choice) or parameter.whole:
            raise InputError("vary", f"{path} is no number that varies continuously: its misfit has no slope")
        if path == "time.span":
            raise InputError("vary", "time.span has no influence on a measured history: it ends with the last time")
        own = config.scene.values.get(path)
        if ends is None:
            if not own:
                what = "has no value in the scene" if own is None else "is 0 in the scene"
                raise InputError("vary", f"{path} {what}, so no range follows from it: {path}=LOW..HIGH")
            low, high = sorted((0.5 * own, 2.0 * own))
            # The ends of what is allowed may be excluded themselves.
            low, high = max(low, parameter.lower), min(high, parameter.upper)
        else:
            if not isinstance(ends, list | tuple) or len(ends) != 2:
                raise InputError(f"vary.{path}", f"a pair of values is expected, got {show(ends)}")
            for form, end in zip(("{}..HIGH", "LOW..{}"), ends, strict=True):
                if isinstance(end, str):
                    tell_unit("--vary", f"{path}={form}", end, as_written(config, path), parameter)
            low, high = (quantity(end, parameter, f"vary.{path}") for end in ends)
            if not low < high:
                raise InputError(f"vary.{path}", f"{high:g} is not greater than {low:g}, where the range begins")
        inside = own is not None and low <= own <= high
        found.append(_Factor(path, parameter, low, high, float(own or 0.0) if inside else 0.5 * (low + high)))
    return found


def _columns(doc: Document, data: Any) -> Mapping[str, Any]:
    """Columns of the data by their names, with ``t`` for the times."""
    if isinstance(data, str | os.PathLike):
        if Path(data).suffix.lower() in (".yaml", ".yml", ".nc"):
            what = "a result" if Path(data).suffix.lower() == ".nc" else "a configuration"
            raise InputError(
                "data", f"{data} is {what} by its name; did you mean a table such as run.csv, with t, and phi or x?"
            )
        columns: Mapping[str, Any] = doc.inline_csv(str(data), "data", "data")
    elif isinstance(data, Mapping):
        columns = data
    elif hasattr(data, "columns"):
        columns = {str(name): data[name].tolist() for name in data.columns}
    else:
        raise InputError("data", f"a CSV file, a mapping or a DataFrame is expected, got {show(data)}")
    found = {}
    for header, column in columns.items():
        name, unit = name_and_unit(str(header))
        found["t" if name == "time" else name or header] = [f"{value} {unit}" for value in column] if unit else column
    return found


def _times(columns: Mapping[str, Any]) -> tuple[str, Floats]:
    """Name of the measured quantity, and the times (s)."""
    if "t" not in columns:
        raise InputError("data", f"no column t with the times; got {', '.join(map(str, columns)) or 'no column'}")
    others = [name for name in columns if name != "t"]
    if len(others) != 1:
        got = ", ".join(map(str, others)) or "none"
        raise InputError("data", f"one column beside t is expected, such as phi or x, got {got}: a fit takes one")
    times = read_values(columns["t"], Parameter("s", "time of a measurement", lower=0.0), "data.t")
    backward = np.flatnonzero(np.diff(times) <= 0.0)
    if len(backward):
        i = int(backward[0]) + 1
        raise InputError(f"data.t.{i}", f"{times[i]:g} s does not come after {times[i - 1]:g} s")
    if times[-1] == 0.0:
        raise InputError("data.t", "the only time is 0 s, at which nothing has happened yet")
    return others[0], times


# Residuals


class _Problem:
    """Residuals of a scene against measurements, in numbers that are 0 to 1 within the ranges.

    Parameters
    ----------
    config : Config
        Of a single run that ends with the last measurement.
    factors : list of _Factor
    name : str
        Quantity of the history.
    times, measured : ndarray of shape ``(measurements,)``
    """

    def __init__(self, config: Config, factors: list[_Factor], name: str, times: Floats, measured: Floats):
        self.config, self.factors, self.name, self.times, self.measured = config, factors, name, times, measured
        self.low = np.array([factor.low for factor in factors])
        self.width = np.array([factor.high - factor.low for factor in factors])
        ends = np.array([(f.parameter.lower, f.parameter.upper) for f in factors]).T
        self.bounds = (ends - self.low) / self.width
        structure = config.scene.structure
        self._names = model_of(structure).history(structure)
        self.runs = 0

    def values(self, u: Floats) -> Floats:
        """Values in SI units."""
        return np.asarray(self.low + self.width * u)

    def history(self, u: Floats) -> tuple[Floats, float]:
        """The quantity at the times of the measurements, and when the run ends; NaN where the scene allows no such run.

        After the end of a run the quantity keeps its last value.
        """
        structure = self.config.scene.structure
        own = dict(zip((factor.path for factor in self.factors), self.values(u).tolist(), strict=True))
        nothing = np.full(len(self.times), np.nan), np.nan
        if not all(factor.parameter.allows(own[factor.path]) for factor in self.factors):
            return nothing
        try:
            cell = batch(structure, {p: np.array([v]) for p, v in {**self.config.scene.values, **own}.items()})
        except InputError:
            return nothing
        with readable_compile_errors():
            times, rows = self.config.solver.history(cell, _INSTANTS, len(self._names))
        self.runs += 1
        values = rows[:, self._names.index(self.name)]
        rate = _RATES.get(self.name, "")
        slopes = rows[:, self._names.index(rate)] if rate in self._names else None
        return _interpolated(times, values, slopes, self.times), float(times[-1])

    def residuals(self, u: Floats) -> Floats:
        """Model minus measurement."""
        return self.history(u)[0] - self.measured

    def misfit(self, u: Floats) -> float:
        """Sum of the squared residuals; infinite where the scene allows no such run."""
        found = float(np.sum(self.residuals(u) ** 2))
        return found if math.isfinite(found) else math.inf

    def jacobian(self, u: Floats, free: NDArray[np.intp] | None = None) -> Floats:
        """Slopes of the residuals by central differences, or by one-sided ones beside what is not allowed."""
        free = np.arange(len(u)) if free is None else free
        found = np.empty((len(self.times), len(free)))
        for column, k in enumerate(free):
            sides, places = [], []
            for sign in (1.0, -1.0):
                v = u.copy()
                v[k] += sign * _STEP
                sides.append(self.residuals(v))
                places.append(v[k])
            for side in range(2):
                if not np.isfinite(sides[side]).all():
                    sides[side], places[side] = self.residuals(u), u[k]
            gap = places[0] - places[1]
            found[:, column] = (sides[0] - sides[1]) / gap if gap else 0.0
        return found

    def minimise(self, u: Floats, fixed: int | None = None) -> tuple[Floats, float]:
        """The nearest minimum of the misfit, with one number kept if it is fixed, and its misfit."""
        # It is slow to import, and only fits need it.
        from scipy.optimize import least_squares

        free = np.array([k for k in range(len(u)) if k != fixed], dtype=np.intp)
        if not len(free):
            return u, self.misfit(u)

        def whole(v: Floats) -> Floats:
            found = u.copy()
            found[free] = v
            return found

        low, high = self.bounds[:, free]
        start = np.clip(u[free], np.nextafter(low, high), np.nextafter(high, low))
        accuracy = {"x_scale": "jac", "xtol": 1e-9, "ftol": 1e-10, "max_nfev": 60}
        best = least_squares(
            lambda v: self.residuals(whole(v)), start, lambda v: self.jacobian(whole(v), free), (low, high), **accuracy
        )
        return whole(best.x), 2.0 * float(best.cost)


def _interpolated(times: Floats, values: Floats, slopes: Floats | None, at: Floats) -> Floats:
    """A history at other times: cubics where slopes are known, else lines. After its end it keeps its last value."""
    # An event stores the states before and after it at one instant: no interval may reach over both.
    k = np.clip(np.searchsorted(times, at, side="right") - 1, 0, max(len(times) - 2, 0))
    after = np.minimum(k + 1, len(times) - 1)
    gap = times[after] - times[k]
    share = np.clip((at - times[k]) / np.where(gap > 0.0, gap, 1.0), 0.0, 1.0)
    share = np.where(gap > 0.0, share, 1.0)
    if slopes is None:
        found = values[k] + share * (values[after] - values[k])
    else:
        rest = 1.0 - share
        found = rest**2 * ((1.0 + 2.0 * share) * values[k] + share * gap * slopes[k])
        found += share**2 * ((3.0 - 2.0 * share) * values[after] - rest * gap * slopes[after])
    return np.where(at >= times[-1], values[-1], found)


# The fit


def _fit(problem: _Problem, noise: float | None, starts: int, column: Variable) -> xr.Dataset:
    count = len(problem.factors)
    tried = unit_points("sobol", 1 << (starts * _TRIED - 1).bit_length(), count, 0, 0)
    own = (np.array([factor.first for factor in problem.factors]) - problem.low) / problem.width
    tried = np.concatenate([own[None], tried])
    misfits = np.array([problem.misfit(u) for u in tried])
    if not np.isfinite(misfits).any():
        raise InputError("vary", "no point of these ranges makes a scene that is allowed: other ranges are needed")
    minima = sorted((problem.minimise(u) for u in _apart(tried, misfits, starts)), key=lambda minimum: minimum[1])
    best, misfit = minima[0]

    freedom = len(problem.times) - count
    variance = misfit / freedom if noise is None else noise**2
    limit = _limit(variance, freedom, noise is None)
    jacobian = problem.jacobian(best)
    covariance, alike = _covariance(jacobian, variance, [factor.path for factor in problem.factors])
    error = np.sqrt(np.diag(covariance))
    half = math.sqrt(limit / variance) * error if variance > 0.0 else 0.0 * error
    profiles = [_profile(problem, k, best, misfit, covariance[k], limit) for k in range(count)]

    for text in alike:
        logger.warning("%s", text)
    history, end = problem.history(best)
    held = int((problem.times > end).sum())
    if held:
        logger.warning(
            "the fitted run ends at %.6g s, when a contact is lost or the body jams: %d of %d residuals are those of "
            "its last state, and say little",
            end,
            held,
            len(problem.times),
        )
    for factor, u, ends in zip(problem.factors, best, problem.bounds.T, strict=True):
        if min(abs(u - ends)) < _STEP:
            logger.warning("%s is at the end of what is allowed: its interval is not to be trusted", factor.path)
    for u, other in minima[1:]:
        if other - misfit < limit and (np.abs(u - best) > 3.0 * half + 1e-6).any():
            numbers = zip(problem.factors, problem.values(u), strict=True)
            shown = ", ".join(f"{factor.path} = {value:.6g}" for factor, value in numbers)
            logger.warning("another minimum is as good: %s", shown)
            break
    residuals = history - problem.measured
    alike_neighbours = float(residuals[1:] @ residuals[:-1]) / misfit if misfit > 0.0 else 0.0
    if alike_neighbours > _NEIGHBOURS / math.sqrt(len(residuals)):
        logger.warning(
            "residuals are like their neighbours (correlation %.2f): the model, or this minimum, is not right, and the "
            "intervals are too short; look at the picture, or try wider ranges and --start %d",
            alike_neighbours,
            4 * starts,
        )
    unsure = _uncertified(problem, best)
    if unsure:
        logger.warning("%d of the %d runs at and beside the fitted values are not certified", unsure, 2 * count + 1)
    result = _dataset(problem, column, (best, covariance, half, profiles, minima), (history, misfit))
    return result.assign_attrs(
        attributes(problem.config)
        | {
            "noise": math.sqrt(variance),
            "noise_is": "estimated from the residuals" if noise is None else "given",
            "interval": f"{100 * CONFIDENCE:g} %",
            "runs": problem.runs,
            "held_measurements": held,
            "uncertified_runs": unsure,
            "not_told_apart": "; ".join(alike),
        }
    )


def _apart(tried: Floats, misfits: Floats, starts: int) -> list[Floats]:
    """Starts: the best points of those tried, each in a part of the ranges of its own while there are enough."""
    order = [k for k in np.argsort(misfits, kind="stable") if math.isfinite(misfits[k])]
    distance = 0.5 * starts ** (-1.0 / tried.shape[1])
    found: list[Floats] = []
    for k in order:
        if len(found) < starts and all(np.abs(tried[k] - other).max() >= distance for other in found):
            found.append(tried[k])
    return found


def _limit(variance: float, freedom: int, estimated: bool) -> float:
    """Growth of the misfit at the ends of a 95 % interval of one number."""
    from scipy.stats import chi2, f

    return variance * float(f.ppf(CONFIDENCE, 1, freedom) if estimated else chi2.ppf(CONFIDENCE, 1))


def _covariance(jacobian: Floats, variance: float, paths: list[str]) -> tuple[Floats, list[str]]:
    """Covariance in scaled numbers, infinite where the data say nothing; and what the data do not tell, in words."""
    norms = np.linalg.norm(jacobian, axis=0)
    blind = ~(norms > _SINGULAR * norms.max())
    covariance = np.diag(np.where(blind, np.inf, 0.0))
    told = [f"the data do not depend on {path}: it is not known" for path, no in zip(paths, blind, strict=True) if no]
    seen = np.flatnonzero(~blind)
    if len(seen):
        _, singular, directions = np.linalg.svd(jacobian[:, seen] / norms[seen], full_matrices=False)
        weak = singular < _SINGULAR * singular[0]
        inverse = (directions.T / np.where(weak, np.inf, singular) ** 2) @ directions
        covariance[np.ix_(seen, seen)] = variance * inverse / np.outer(norms[seen], norms[seen])
        for direction in directions[weak]:
            mixed = np.abs(direction) > 0.1
            covariance[seen[mixed], seen[mixed]] = np.inf
            told.append(f"the data know only a combination of {', '.join(paths[k] for k in seen[mixed])}")
        if not weak.any():
            deviations = np.sqrt(np.diag(inverse))
            alike = inverse / np.outer(deviations, deviations)
            for i, j in np.argwhere(np.tril(np.abs(alike) >= _ALIKE, -1)):
                pair = f"{paths[seen[j]]} and {paths[seen[i]]}"
                told.append(f"the data hardly tell {pair} apart: their correlation is {alike[i, j]:.4f}")
    return covariance, told


def _profile(
    problem: _Problem, k: int, best: Floats, misfit: float, covariance: Floats, limit: float
) -> tuple[Floats, Floats, float, float]:
    """Profile of one number: values, misfits, and the ends of its 95 % interval, in scaled numbers."""
    known = 0.0 < covariance[k] < math.inf
    reach = _REACH * math.sqrt(covariance[k]) if known else 1.0
    along = np.where(np.isfinite(covariance), covariance, 0.0) / covariance[k] if known else np.zeros(len(best))
    offsets = np.linspace(-reach, reach, _PROFILE)
    low, high = problem.bounds[:, k]
    values = np.clip(best[k] + offsets, low, high)
    misfits = np.full(_PROFILE, math.inf)
    middle = _PROFILE // 2
    misfits[middle] = misfit

    def least(near: Floats, value: float) -> tuple[Floats, float]:
        """Least misfit with this value, from a point near it and from where the others are on average then."""
        found = near, math.inf
        for start in (near, np.clip(best + (value - best[k]) * along, *problem.bounds)):
            v = start.copy()
            v[k] = value
            if math.isfinite(problem.misfit(v)):
                found = min(found, problem.minimise(v, fixed=k), key=lambda minimum: minimum[1])
        return found

    def growth_beside(near: Floats) -> Callable[[float], float]:
        return lambda value: least(near, value)[1] - misfit

    ends = []
    for side in (range(middle - 1, -1, -1), range(middle + 1, _PROFILE)):
        u, before = best, (values[middle], 0.0)
        end = math.inf if side.step > 0 else -math.inf
        for place in side:
            v, misfits[place] = least(u, values[place])
            growth = misfits[place] - misfit
            # What the scene does not allow tells nothing of the data: there the interval stays open.
            if math.isinf(end) and math.inf > growth >= limit > 0.0:
                end = _end(growth_beside(u), before, (values[place], growth), limit)
            u, before = v, (values[place], max(growth, 0.0))
        ends.append(float(end))
    return values, misfits, ends[0], ends[1]


def _end(growth: Callable[[float], float], low: tuple[float, float], high: tuple[float, float], limit: float) -> float:
    """Where the growth of the misfit reaches the limit, between two values with their growths."""
    # Roots of misfits are nearly straight, but where an event comes or goes they jump: there the interval is halved.
    for _ in range(6):
        if math.sqrt(high[1]) - math.sqrt(low[1]) < math.sqrt(limit):
            break
        value = 0.5 * (low[0] + high[0])
        here = max(growth(value), 0.0)
        low, high = ((value, here), high) if here < limit else (low, (value, here))
    if not math.isfinite(high[1]):
        return high[0]
    one, two = math.sqrt(low[1]), math.sqrt(high[1])
    # The interval must not be too short.
    if two - one > 2.0 * math.sqrt(limit):
        return high[0]
    return low[0] + (math.sqrt(limit) - one) / (two - one) * (high[0] - low[0])


def _uncertified(problem: _Problem, best: Floats) -> int:
    """How many of the runs at the fitted values, and of those that give their slopes, are not certified."""
    if not problem.config.certifies:
        return 0
    steps = np.concatenate([np.zeros((1, len(best))), _STEP * np.eye(len(best)), -_STEP * np.eye(len(best))])
    allowed = [u for u in best + steps if math.isfinite(problem.misfit(u))]
    columns = np.array([problem.values(u) for u in allowed]).T
    paths = (factor.path for factor in problem.factors)
    points = run_points(problem.config, dict(zip(paths, columns, strict=True)), 1)
    return int((points["certified"] != 1).sum())


def _dataset(problem: _Problem, column: Variable, found: Any, run: Any) -> xr.Dataset:
    best, covariance, half, profiles, minima = found
    history, misfit = run
    width, own = problem.width, {"units": column.units}
    covariance = covariance * np.outer(width, width)
    error = np.sqrt(np.diag(covariance))
    with np.errstate(invalid="ignore", divide="ignore"):
        correlation = covariance / np.outer(error, error)
    each = {"comment": "each in the unit of its parameter"}
    value, at = problem.values(best), ("parameter", "profile")
    values, misfits, lower, upper = (np.array(part) for part in zip(*profiles, strict=True))
    squares = {"units": f"({column.unit})^2" if column.unit != "1" else "1"}
    paths = [factor.path for factor in problem.factors]
    units = [factor.parameter.unit or "1" for factor in problem.factors]

    def variable(dims: Any, values: Any, name: str, about: dict[str, Any] = each) -> Any:
        return dims, values, {"long_name": name} | about

    return xr.Dataset(
        {
            "value": variable("parameter", value, "fitted value"),
            "standard_error": variable("parameter", error, "standard error"),
            "low": variable("parameter", value - half * width, "lower end of the 95 % interval"),
            "high": variable("parameter", value + half * width, "upper end of the 95 % interval"),
            "profile_low": variable("parameter", problem.values(lower), "lower end by the profile likelihood"),
            "profile_high": variable("parameter", problem.values(upper), "upper end by the profile likelihood"),
            "covariance": variable(("parameter", "other"), covariance, "covariance"),
            "correlation": variable(("parameter", "other"), correlation, "correlation", {"units": "1"}),
            "profile_value": variable(at, problem.values(values.T).T, "value at which the parameter is kept"),
            "profile_misfit": variable(at, misfits, "sum of squared residuals", squares),
            "start_value": variable(
                ("start", "parameter"), problem.values(np.array([u for u, _ in minima])), "value found from a start"
            ),
            "start_misfit": variable("start", [cost for _, cost in minima], "sum of squared residuals", squares),
            "misfit": variable((), misfit, "sum of squared residuals", squares),
            "measured": variable("measurement", problem.measured, f"measured {column.long_name}", own),
            "fitted": variable("measurement", history, f"fitted {column.long_name}", own),
            "residual": variable("measurement", problem.measured - history, "measurement minus fit", own),
        },
        coords={
            "parameter": ("parameter", paths, {"long_name": "fitted parameter"}),
            "other": ("other", paths, {"long_name": "fitted parameter"}),
            "unit": ("parameter", units, {"long_name": "unit of the parameter"}),
            "t": ("measurement", problem.times, {"long_name": "time", "units": "s"}),
        },
    )


def in_words(found: xr.Dataset) -> str:
    """What :func:`fit` found, a line for each parameter."""
    lines = []
    for path in map(str, found["parameter"].values):
        one = found.sel(parameter=path)
        value, error, low, high = (float(one[name]) for name in ("value", "standard_error", "low", "high"))
        digits = f".{max(1 - math.floor(math.log10(error)), 0)}f" if 0.0 < error < math.inf else ".6g"
        unit = after_number(str(one["unit"].item()))
        turned = f" ({math.degrees(value):.4g} ± {math.degrees(error):.2g} deg)" if unit == " rad" else ""
        profile = f"{float(one['profile_low']):{digits}} to {float(one['profile_high']):{digits}}"
        lines.append(
            f"{path} = {value:{digits}} ± {error:.1e}{unit}{turned}; 95 %: {low:{digits}} to {high:{digits}}"
            f", by the profile {profile}"
        )
    unit = after_number(found["residual"].attrs["units"])
    lines.append(
        f"noise {found.attrs['noise']:.3g}{unit} ({found.attrs['noise_is']}), "
        f"{found.sizes['measurement']} measurements, {found.attrs['runs']} runs"
    )
    return "\n".join(lines)
