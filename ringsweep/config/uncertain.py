"""The key ``sweep.sample``: uncertain parameters, and the points at which they are drawn."""

from __future__ import annotations

import math
import re
from collections.abc import Mapping
from dataclasses import dataclass
from functools import lru_cache
from typing import Annotated, Any

import numpy as np
from numpy.typing import NDArray

from ringsweep.config.axes import Axes, check_consistency, paths_of, read_axis, swept_parameter
from ringsweep.config.reading import Keys, check_keys, keys_of, one_of, read_keys, read_values
from ringsweep.config.scene import outcome_numbers, sweepable
from ringsweep.errors import InputError
from ringsweep.models import MODELS
from ringsweep.models.scene import Scene
from ringsweep.quantities.parameters import Key, Parameter
from ringsweep.quantities.quantity import after_number
from ringsweep.quantities.trailer import MAX_CELLS
from ringsweep.quantities.units import NUMBER, is_plain, quantity, show
from ringsweep.statistics import DISTRIBUTIONS, METHODS, distribution, saltelli, unit_points

# Mean and tolerance of a uniform distribution, as engineers write them.
_TOLERANCE = re.compile(r"\s*(.+?)\s*(?:±|\+/?-)\s*(.+?)\s*")

_LEVEL = Parameter("1", "level of a quantile", lower=0, upper=1, open_lower=True, open_upper=True)

#: Numbers that tell when something happens, and that are missing where it does not.
CENSORED = ("t_separation", "first_slip")


@dataclass(frozen=True)
class Factor:
    """One uncertain quantity: a number of the scene, a ratio of two, or several that are drawn together.

    Attributes
    ----------
    paths : tuple of str
        Several only for rows of a table.
    kind : str
        Name of a distribution, or ``values``.
    numbers : tuple of float
        Those of the distribution, in SI units.
    table : tuple of tuple of float
        Values of each path, all of one length, each row as probable as the others.
    over : str, optional
        Path that the draw is multiplied by.
    """

    paths: tuple[str, ...]
    kind: str
    numbers: tuple[float, ...] = ()
    table: tuple[tuple[float, ...], ...] = ()
    over: str | None = None

    @property
    def name(self) -> str:
        """The paths as a configuration has them."""
        return ", ".join(self.paths)

    def __str__(self) -> str:
        inside = f"{len(self.table[0])} rows" if self.table else ", ".join(f"{number:g}" for number in self.numbers)
        return f"{self.kind}({inside})" + (f" times {self.over}" if self.over else "")

    def draw(self, u: NDArray[np.float64]) -> dict[str, NDArray[np.float64]]:
        """Values of each path, or the ratio, at shares between 0 and 1."""
        if self.table:
            row = (u * len(self.table[0])).astype(int)
            return {path: np.array(column)[row] for path, column in zip(self.paths, self.table, strict=True)}
        return {self.paths[0]: distribution(self.kind, *self.numbers).ppf(u)}


@dataclass(frozen=True)
class Sample:
    """Uncertain parameters, and what is asked of them.

    Attributes
    ----------
    factors : tuple of Factor
        Those that are multiplied by others come after them.
    n : int
        Points for each cell.
    method : str
    seed, replicates : int
        The points come in independent replicates of the same length.
    quantiles : dict of str to tuple of float
        Levels by variable.
    survival : tuple of float
        Times at which it is asked whether the contacts still hold, s.
    sensitivity : bool
        Whether Sobol indices are asked for.
    sensitive : tuple of str
        Variables whose own indices are asked for, beside those of the regimes; for a time that some runs do not have,
        those of whether it has come at the times of `survival`.
    keep : bool
        Whether the result holds the runs too.
    """

    factors: tuple[Factor, ...]
    n: Annotated[int, Parameter("1", "points of each cell", 2, 1_000_000)]
    quantiles: Annotated[Mapping[str, tuple[float, ...]], Key("variable -> levels")]
    survival: Annotated[tuple[float, ...], Key("times at which it is asked whether the contacts still hold")]
    sensitivity: Annotated[bool, Key("Sobol indices, and of which variables beside the regimes")]
    sensitive: tuple[str, ...]
    method: Annotated[str, Key("method of drawing points", dict.fromkeys(METHODS, ""))] = METHODS[0]
    seed: Annotated[int, Parameter("1", "seed of the sample", 0, 2**53)] = 0
    replicates: Annotated[int, Parameter("1", "independent parts of the sample", 4, 64)] = 8
    keep: Annotated[bool, Key("whether the result holds the runs too")] = False

    @property
    def size(self) -> int:
        """Points of each replicate."""
        return self.n // self.replicates

    @property
    def rows(self) -> int:
        """Runs for each point."""
        return len(self.factors) + 2 if self.sensitivity else 1

    @property
    def own(self) -> list[int]:
        """Which of the runs for each point are points of the sample itself."""
        return [0, -1] if self.sensitivity else [0]

    @property
    def independent(self) -> bool:
        """Whether all points are independent of each other."""
        return self.method == "random"

    @property
    def shares(self) -> NDArray[np.float64]:
        """Shares of all runs, shape ``(n * rows, factors)``; those of a replicate, and of one point, stand together."""
        return _shares(self.method, self.size, len(self.factors), self.seed, self.replicates, self.sensitivity)

    def axes(self, scene: Scene, axes: Axes, shares: NDArray[np.float64]) -> Axes:
        """The axes of a grid with one more dimension, ``sample``, along which the uncertain parameters vary."""
        columns = dict(axes.columns)
        for factor, u in zip(self.factors, shares.T, strict=True):
            for path, drawn in factor.draw(u).items():
                # What is no ratio is one to 1.
                over = factor.over or ""
                dims, base = columns.get(over, ((), np.array(scene.values.get(over, 1.0))))
                if "sample" not in dims:
                    dims, base = (*dims, "sample"), base[..., None]
                columns[path] = dims, base * drawn
        return Axes({**axes.sizes, "sample": len(shares)}, columns)


#: Keys of ``sweep.sample``.
KEYS: Keys = {**keys_of(Sample), "of": Key("distributions by path", example="{body.mass: {normal: [76 g, 1 %]}}")}


@lru_cache(maxsize=2)
def _shares(method: str, size: int, factors: int, seed: int, replicates: int, sensitivity: bool) -> NDArray[np.float64]:
    drawn = factors * (2 if sensitivity else 1)
    points = np.concatenate([unit_points(method, size, drawn, seed, replicate) for replicate in range(replicates)])
    return saltelli(points).reshape(-1, factors) if sensitivity else points


def censored(scene: Scene) -> str:
    """The number that tells when a contact is lost, or when a body that rides on its belt first slips."""
    return next(name for name in CENSORED if name in MODELS[scene.structure.model].outcomes)


def read_sample(given: Any, scene: Scene, axes: Axes) -> Sample | None:
    """Read and validate the section ``sweep.sample``.

    Raises
    ------
    InputError
        If a key or value is wrong, or a point of the sample is not allowed.
    """
    if given is None:
        return None
    where = "sweep.sample"
    section = read_keys(given, KEYS, where)
    n, replicates, sobol = section["n"], section["replicates"], section["method"] == "sobol"
    size, rest = divmod(n, replicates)
    if rest or size < 1 or (sobol and size & (size - 1)):
        near = max(n / replicates, 1.0)
        fitting = replicates * (2 ** round(math.log2(near)) if sobol else round(near))
        parts = "of a power of two, as Sobol points are" if sobol else "of one length"
        raise InputError(f"{where}.n", f"{n} is not {replicates} replicates {parts}: give {fitting}")
    asked, time = section["survival"], Parameter("s", f"time at which {censored(scene)} is asked for", lower=0)
    section["sensitivity"], section["sensitive"] = _sensitivity(section["sensitivity"], scene, bool(asked))
    section["factors"] = _factors(section.pop("of"), scene, axes)
    section["quantiles"] = _quantiles(section["quantiles"], scene)
    section["survival"] = () if asked is None else _ascending(asked, time, f"{where}.survival")
    found = Sample(**section)
    cells = math.prod(axes.sizes.values())
    for path, total in (("", cells * found.replicates), (".keep", cells * found.n * found.rows * found.keep)):
        if total > MAX_CELLS:
            raise InputError(where + path, f"{total:.3g} parts or runs: at most {MAX_CELLS:.3g} fit")
    _check_points(found, scene, axes)
    return found


def _factors(given: Any, scene: Scene, axes: Axes) -> tuple[Factor, ...]:
    """Factors, those that are multiplied by others behind them."""
    if not isinstance(given, dict) or not given:
        raise InputError("sweep.sample.of", f"a section of paths and distributions is expected, got {show(given)}")
    known, drawn, found = sweepable(scene), set[str](), list[Factor]()
    for key, spec in given.items():
        where = f"sweep.sample.of.{key}"
        parameters = {path: swept_parameter(known, path, where) for path in paths_of(key)}
        for path, parameter in parameters.items():
            if isinstance(parameter, Key):
                raise InputError(where, f"a {parameter.long_name} has no distribution: make it an axis of sweep.grid")
            if path in axes.columns or path in drawn:
                raise InputError(where, f"{path} varies elsewhere too: a path can vary in one place only")
            drawn.add(path)
        found.append(_factor(spec, parameters, where, known))
    ratios = {factor.name: factor.over for factor in found if factor.over is not None}
    for name, over in ratios.items():
        where = f"sweep.sample.of.{name}.over"
        if over in ratios:
            raise InputError(where, f"{over} is itself drawn over {ratios[over]}: draw both as rows of a file")
        if over not in {*scene.values, *axes.columns, *drawn}:
            raise InputError(where, f"{over} has no value in the scene, and no distribution")
    return tuple(sorted(found, key=lambda factor: factor.over is not None))


def _factor(spec: Any, parameters: Mapping[str, Any], where: str, known: Mapping[str, Parameter | Key]) -> Factor:
    kinds = (*DISTRIBUTIONS, "values", "file")
    if not isinstance(spec, dict):
        example = "such as `{uniform: 0.3 ± 10 %}`, or `{normal: [0.3, 10 %]}` if 10 % is a standard deviation"
        example += f", got {show(spec)} ({', '.join(kinds)})"
        raise InputError(where, f"a distribution is expected, {example}")
    check_keys(spec, (*kinds, "over"), where, "is no distribution")
    named = [key for key in spec if key != "over"]
    if len(named) != 1:
        raise InputError(where, f"one distribution is expected, got {' and '.join(named) or 'none'}")
    (kind,), paths, over = named, tuple(parameters), None
    if len(paths) > 1 and (kind != "values" or "over" in spec):
        raise InputError(where, "paths that are drawn together need rows, and have no ratio: {file: samples.csv}")
    parameter = parameters[paths[0]]
    if "over" in spec:
        over = _reference(spec["over"], paths[0], parameter, known, f"{where}.over")
        parameter = Parameter("1", f"ratio of {paths[0]} to {over}")
        parameters = {paths[0]: parameter}
    if kind == "values":
        return Factor(paths, kind, (), _table(spec["values"], parameters, f"{where}.values"), over)
    if parameter.whole:
        raise InputError(where, f"{parameter.long_name} must be a whole number: list them as {{values: [...]}}")
    return Factor(paths, kind, _numbers(spec[kind], kind, parameter, f"{where}.{kind}"), (), over)


def _reference(given: Any, path: str, parameter: Any, known: Mapping[str, Parameter | Key], where: str) -> str:
    """The path that a ratio is over; the section may be left out."""
    beside = f"{path.rpartition('.')[0]}.{given}"
    full = given if isinstance(given, str) and given in known else beside
    if full == path:
        raise InputError(where, f"{full} is the path itself")
    if getattr(swept_parameter(known, full, where), "unit", None) != parameter.unit:
        raise InputError(where, f"{full} is no number in the unit of {path}: their ratio has no meaning")
    return full


def _table(given: Any, parameters: Mapping[str, Any], where: str) -> tuple[tuple[float, ...], ...]:
    if not isinstance(given, dict) and len(parameters) == 1:
        given = dict.fromkeys(parameters, given)
    if not isinstance(given, dict) or set(given) != set(parameters):
        raise InputError(where, f"a list for each of {', '.join(parameters)} is expected, got {show(given)}")
    columns = {path: read_values(given[path], parameters[path], f"{where}.{path}") for path in parameters}
    lengths = {path: len(column) for path, column in columns.items()}
    if len(set(lengths.values())) > 1:
        raise InputError(where, f"columns of different lengths: {lengths}")
    return tuple(tuple(column.tolist()) for column in columns.values())


def _numbers(given: Any, kind: str, parameter: Parameter, where: str) -> tuple[float, ...]:
    """The numbers of a distribution. A standard deviation or a tolerance in per cent is a share of the mean."""
    arguments = DISTRIBUTIONS[kind]
    wanted = ", ".join(arguments)
    written = given
    if tolerated := kind == "uniform" and isinstance(given, str):
        arguments, given = ("mean", "tolerance"), _mean_and_tolerance(given, where)
    if not isinstance(given, list) or len(given) != len(arguments):
        tolerance = " or 0.1 ± 10 %" if kind == "uniform" else ""
        raise InputError(where, f"[{wanted}]{tolerance} is expected, got {show(given)}")
    found: list[float] = []
    for k, (what, value) in enumerate(zip(arguments, given, strict=True)):
        at, scatter = where if tolerated else f"{where}.{k}", what in ("standard deviation", "tolerance")
        share = scatter and isinstance(value, str) and value.strip().endswith("%")
        least = 0.0 if scatter else -math.inf
        number = Parameter("1" if share else parameter.unit, f"{what} of {parameter.long_name}", least, open_lower=True)
        if share and found[0] == 0.0:
            raise InputError(at, f"{show(value)} of a mean of 0 is nothing: give the {what} itself")
        found.append(quantity(value, number, at) * (abs(found[0]) if share else 1.0))
    if tolerated:
        found = [found[0] - found[1], found[0] + found[1]]
    ends = found if kind in ("uniform", "triangular") else found[2:]
    if ends and not (ends[0] < ends[-1] and ends == sorted(ends)):
        problem = "the first end must be less than the last, a mode between them"
        raise InputError(where, f"{problem}, got {show(written)} ({wanted})")
    if kind == "lognormal" and found[0] <= 0.0:
        raise InputError(where, f"the mean must be greater than 0, got {show(given)} ({wanted})")
    return tuple(found)


def _mean_and_tolerance(given: str, where: str) -> list[str]:
    """Both parts of a text such as ``"0.1 ± 10 %"``. In ``"15 ± 1 deg"`` both have the unit."""
    match = _TOLERANCE.fullmatch(given)
    if match is None:
        raise InputError(where, f"[least value, greatest value] or 0.1 ± 10 % is expected, got {show(given)}")
    mean, tolerance = match.groups()
    if not tolerance.endswith("%") and is_plain(mean) != is_plain(tolerance):
        if is_plain(tolerance):
            raise InputError(where, f"{show(given)}: the tolerance has no unit")
        mean += NUMBER.sub("", tolerance, 1)
    return [mean, tolerance]


def _quantiles(given: Any, scene: Scene) -> dict[str, tuple[float, ...]]:
    if given is None:
        return {}
    where = "sweep.sample.quantiles"
    if not isinstance(given, dict) or not given:
        raise InputError(where, f"variables with lists of levels are expected, got {show(given)}")
    check_keys(given, outcome_numbers(scene), where, "is no number of this model")
    return {name: _ascending(levels, _LEVEL, f"{where}.{name}") for name, levels in given.items()}


def _sensitivity(given: Any, scene: Scene, timed: bool) -> tuple[bool, tuple[str, ...]]:
    """Whether Sobol indices are asked for, and of which variables beside the regimes."""
    if given is None or isinstance(given, bool):
        return bool(given), ()
    where = "sweep.sample.sensitivity"
    of = read_keys(given, {"of": Key("variables", example="[t_end]")}, where)["of"]
    if not isinstance(of, list) or not of:
        raise InputError(f"{where}.of", f"a list of variables is expected, got {show(of)}")
    time = censored(scene)
    names = [name for name in outcome_numbers(scene) if name not in CENSORED or name == time]
    for k, name in enumerate(of):
        if name == time and not timed:
            problem = f"{time} is missing in runs in which it does not happen: say at which times, by survival: [1 s]"
            raise InputError(f"{where}.of.{k}", problem)
        one_of(name, names, f"{where}.of.{k}", "is no number of this model")
    return True, tuple(dict.fromkeys(of))


def _ascending(given: Any, parameter: Parameter, where: str) -> tuple[float, ...]:
    return tuple(np.unique(read_axis(given, parameter, where)).tolist())


@np.errstate(all="ignore")
def _check_points(sample: Sample, scene: Scene, axes: Axes) -> None:
    """Make sure that every point of the sample is allowed, in every cell of the grid."""
    known = sweepable(scene)
    found = sample.axes(scene, axes, sample.shares)
    for factor in sample.factors:
        for path in factor.paths:
            values, parameter = found.columns[path][1], known[path]
            assert isinstance(parameter, Parameter)
            for wrong in (end for end in (values.min(), values.max()) if not parameter.allows(float(end))):
                unit, share = after_number(parameter.unit), "a ratio that draws it is not allowed"
                if factor.over is None:
                    drawn = distribution(factor.kind, *factor.numbers)
                    outside = drawn.cdf(parameter.lower) + drawn.sf(parameter.upper)
                    share = f"{factor} has probability {outside:.2g} of that"
                must = f"{parameter.long_name} must be {parameter.interval}{unit}"
                problem = f"draws {wrong:.3g}{unit}, but {must}: {share} (truncnormal and uniform have ends)"
                raise InputError(f"sweep.sample.of.{factor.name}", problem)
    try:
        check_consistency(scene, found)
    except InputError as error:
        error.problem += ": not all points of the sample are allowed (`over` ties one number to another)"
        raise
