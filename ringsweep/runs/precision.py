"""Error against run time of methods and settings for a scene, and the cheapest setting that meets a target."""

from __future__ import annotations

import math
import os
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from functools import partial
from statistics import median
from typing import Any

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from ringsweep.compile import readable_compile_errors, take
from ringsweep.config import Config, load
from ringsweep.config.axes import COUNT
from ringsweep.errors import InputError
from ringsweep.models import Model, batch, model_of
from ringsweep.models.scene import LAW
from ringsweep.quantities.flags import FAILED
from ringsweep.quantities.parameters import Parameter
from ringsweep.quantities.units import quantity
from ringsweep.quantities.variables import OUTCOMES, PRECISION, Variable
from ringsweep.runs.cells import coordinates, values_of_cells
from ringsweep.runs.contenders import TimedMethod, contenders_for, setting_of, solver_yaml, time_methods
from ringsweep.runs.executors import interruptible, progress_bar
from ringsweep.solvers.certificate import agree
from ringsweep.solvers.event import Event, Implicit
from ringsweep.solvers.method import Result
from ringsweep.storage.provenance import attributes

#: Default of the largest error allowed: rad or m at the end, s at separation.
TARGET = 1e-6

CELLS = 16

ROUNDS = 3

# Tolerances of the reference, and of the run from which its uncertainty follows.
_TIGHTEST: dict[type, tuple[float, float]] = {Event: (1e-15, 1e-14), Implicit: (1e-11, 1e-10)}

_TARGET = Parameter("1", "target", lower=0.0, open_lower=True)


def precision(
    config: str | os.PathLike[str] | Mapping[str, Any],
    *,
    target: float = TARGET,
    cells: int = CELLS,
    rounds: int = ROUNDS,
    progress: bool = True,
) -> xr.Dataset:
    """Measure error against run time of the methods that take the friction law of a scene, and recommend a setting.

    The method that `auto` uses for the law, `event` or `implicit`, runs with a range of `rtol`, and `rk4` with five
    decades of `steps`. Settings that would take longer than 10 s a round are left out and named. A setting meets the
    target if regime, motion and separating contact are right in every sampled cell, and if the errors of the state at
    the end and of the time of separation, plus the uncertainty of the reference, are at most `target`. The fastest of
    these settings is recommended.

    Parameters
    ----------
    config : path or mapping
        A YAML file, or the mapping that it would hold.
    target : float
        Largest error allowed: of the angle (rad) or displacement (m) at the end, and of the time of separation (s).
    cells : int
        Largest number of cells to measure. They are drawn from the sweep at random, the same cells at every call. A
        scene without a sweep is one cell.
    rounds : int
        How often each setting is timed; the median counts.
    progress : bool
        Whether to show a progress bar, if there is a terminal or a notebook.

    Returns
    -------
    xarray.Dataset
        Dimensions ``contender`` (a method with its setting) and ``cell``. Variables are those of
        :data:`ringsweep.quantities.variables.PRECISION`. Coordinates are ``method``, ``setting`` and ``solver`` (the
        text under ``solver`` in a configuration) of each contender, and the swept values of each cell. Run times are
        processor times of one thread, without certificates and compilation. The error of a failed run is infinite.
        Attributes: ``target``; ``recommended``, a value of ``solver``, or ``closest`` if no setting meets the target;
        ``configured``, the value of ``solver`` that the configuration has or that is its default, if it was measured;
        ``certificate_cost``, the factor by which certificates lengthen runs with this setting; ``reference``,
        ``sampled`` and ``left_out`` in words.

    Raises
    ------
    InputError
        If the configuration is wrong, sweeps over several friction laws, or has no cell in which the two tightest runs
        agree on the regime; or if another argument is out of range.

    Examples
    --------
    >>> import ringsweep
    >>> scene = {
    ...     "model": "belt",
    ...     "body": {"mass": 1.0},
    ...     "spring": {"stiffness": 2.0},
    ...     "belt": {"velocity": 0.1},
    ...     "friction": {"law": "stiction", "mu_s": 0.15, "mu_k": 0.1},
    ...     "time": {"span": 20.0},
    ... }
    >>> found = ringsweep.precision({"scene": scene, "solver": "event"}, target=1e-3, cells=1, rounds=1)
    >>> found.attrs["recommended"].startswith("method: ")
    True
    """
    return interruptible(partial(_measure, load(config), target, cells, rounds, progress))


def _measure(config: Config, target: float, cells: int, rounds: int, progress: bool) -> xr.Dataset:
    target = quantity(target, _TARGET, "target")
    cells, rounds = int(quantity(cells, COUNT, "cells")), int(quantity(rounds, COUNT, "rounds"))
    scene = config.scene
    if config.sample is not None:
        raise InputError("sweep.sample", "precision measures the cells of a grid: leave sample out")
    if len(scene.structures) > 1:
        kind = "points" if LAW in config.source["sweep"].get("points", {}) else "grid"
        raise InputError(
            f"sweep.{kind}.{LAW}",
            f"each of {', '.join(scene.structures)} needs methods and a reference of its own: give one law here",
        )
    structure = scene.structure
    names = model_of(structure).columns(structure)
    contenders, left_out = contenders_for(config)
    best = type(contenders[0])
    total = math.prod(config.axes.sizes.values())
    sample = np.arange(total)
    if cells < total:
        sample = np.sort(np.random.default_rng(0).choice(total, cells, replace=False))
    sampled = batch(structure, values_of_cells(scene, config.axes, sample))

    def run(method: Any) -> Result:
        with readable_compile_errors():
            return method.run(sampled, names)

    with progress_bar(2 + len(contenders) * (rounds + 1), progress) as bar:
        tight, looser = (_run_one(bar, best(rtol=rtol, certify=False), run).rows for rtol in _TIGHTEST[best])
        known = np.flatnonzero(agree(tight, looser, names))
        if not len(known):
            raise InputError(
                "scene",
                f"there is no reference to measure errors: in all of the {len(sample)} cells tried {best.name} fails, "
                "or its two tightest runs disagree on the regime",
            )
        sampled = take(sampled, known)
        timed, slow = time_methods(contenders, run, rounds, bar)
        certified = [_run_one(bar, replace(one.method, certify=True), run) for one in timed]

    dataset = _dataset(config, sample[known], timed, certified, tight[known], looser[known])
    words = {"reference": solver_yaml(best(rtol=_TIGHTEST[best][0])), "sampled": f"{len(known)} of {total} cells"}
    if dropped := len(sample) - len(known):
        words["sampled"] += (
            f"; {dropped} more were drawn, but have no reference: its two tightest runs disagree, or fail"
        )
    if left_out or slow:
        words["left_out"] = "; ".join([*left_out, *slow])
    dataset = dataset.assign_attrs({"target": target, **words})

    chosen, met = _choose(dataset)
    plain, with_certificate = (TimedMethod(replace(timed[chosen].method, certify=certify)) for certify in (False, True))
    for k in range(rounds):
        for one in (plain, with_certificate)[:: 1 if k % 2 == 0 else -1]:
            one.measure(run)
    cost = median(b / a for a, b in zip(plain.seconds, with_certificate.seconds, strict=True))
    names_of_solvers = dataset["solver"].values.tolist()
    found: dict[str, Any] = {"recommended" if met else "closest": names_of_solvers[chosen], "certificate_cost": cost}
    configured = solver_yaml(config.solver.resolved(structure))
    if configured in names_of_solvers:
        found["configured"] = configured
    return dataset.assign_attrs(found)


def _run_one(bar: Any, method: Any, run: Callable[[Any], Result]) -> Result:
    result = run(method)
    bar.update()
    return result


def _errors(rows: NDArray[np.float64], reference: NDArray[np.float64], model: Model) -> dict[str, NDArray[np.float64]]:
    """Errors in each cell, shape ``(cells,)``: infinite if the run failed, NaN if one of the two runs has no number."""
    names = model.outcomes
    failed = rows[:, names.index("regime")] == FAILED
    found = {}
    for name, outcome in {"error_end": f"{model.place}_end", "error_separation": "t_separation"}.items():
        if outcome in names:
            column = names.index(outcome)
            found[name] = np.abs(rows[:, column] - reference[:, column])
    found["error_end"] = np.where(failed, np.inf, found["error_end"])
    return found


def _dataset(
    config: Config,
    sample: NDArray[np.intp],
    timed: Sequence[TimedMethod],
    certified: Sequence[Result],
    tight: NDArray[np.float64],
    looser: NDArray[np.float64],
) -> xr.Dataset:
    """Run times, errors and flags of the contenders in the cells with these numbers, labelled."""
    scene, axes = config.scene, config.axes
    model = model_of(scene.structure)
    names = model.outcomes
    columns: dict[str, tuple[tuple[str, ...], Any]] = {
        "time_per_run": (("contender",), [median(one.seconds) / len(sample) for one in timed]),
        "steps": (("contender",), [one.result.steps.mean() for one in timed]),
    }
    each = [_errors(one.result.rows, tight, model) for one in timed]
    for name in each[0]:
        columns[name] = ("contender", "cell"), [errors[name] for errors in each]
    # With certificates a method may replace an answer by that of a finer run: it does not certify the first.
    passed = [
        certificate.certified & agree(one.result.rows, certificate.rows, names)
        for one, certificate in zip(timed, certified, strict=True)
    ]
    right = [agree(one.result.rows, tight, names) for one in timed]
    columns["regime_wrong"] = ("contender", "cell"), ~np.array(right)
    columns["flagged"] = ("contender", "cell"), ~np.array(passed)
    columns |= {f"reference_{name}": (("cell",), error) for name, error in _errors(looser, tight, model).items()}

    values = values_of_cells(scene, axes, sample)
    law = [scene.structure.law] * len(sample)
    along = {path: ("cell", law if path == LAW else values[path]) for path in axes.columns}
    return xr.Dataset(
        {
            name: (dims, np.asarray(column, dtype=PRECISION[name].dtype), _described(name, model).attributes)
            for name, (dims, column) in columns.items()
        },
        coords={
            "method": ("contender", [one.method.name for one in timed], {"long_name": "method"}),
            "setting": ("contender", [setting_of(one.method) for one in timed], {"long_name": "its setting"}),
            "solver": (
                "contender",
                [solver_yaml(one.method) for one in timed],
                {"long_name": "text under solver in a configuration"},
            ),
            "cell": ("cell", sample, {"long_name": "number of the cell in the sweep, last dimension fastest"}),
            **coordinates(scene, along),
        },
    ).assign_attrs(attributes(config))


def _described(name: str, model: Model) -> Variable:
    """Variable of the dataset; where it is about the end, in the words and the unit of the model's place."""
    variable, place = PRECISION[name], OUTCOMES[f"{model.place}_end"]
    if not name.endswith("error_end"):
        return variable
    words = variable.long_name.replace(OUTCOMES["phi_end"].long_name, place.long_name)
    return replace(variable, long_name=words, unit=place.unit)


def error_bounds(ds: xr.Dataset) -> NDArray[np.float64]:
    """Errors plus the uncertainty of the reference, shape ``(contender, cell)``."""
    bounds = (ds["error_end"] + ds["reference_error_end"]).values
    if "error_separation" in ds:
        bounds = np.fmax(bounds, (ds["error_separation"] + ds["reference_error_separation"]).values)
    return np.asarray(bounds)


def wrong_and_worst(ds: xr.Dataset) -> tuple[NDArray[np.intp], NDArray[np.float64], NDArray[np.bool_]]:
    """Of each contender the number of wrong regimes, the largest error, and whether it meets the target."""
    wrong, worst = (ds["regime_wrong"] == 1).sum("cell").values, error_bounds(ds).max(axis=1)
    return wrong, worst, (wrong == 0) & (worst <= ds.attrs["target"])


def _choose(ds: xr.Dataset) -> tuple[int, bool]:
    """The fastest contender that meets the target, or else the one that comes closest; and whether it meets it."""
    wrong, worst, meets = wrong_and_worst(ds)
    met = np.flatnonzero(meets)
    if len(met):
        return int(met[np.argmin(ds["time_per_run"].values[met])]), True
    return int(np.lexsort([worst, wrong])[0]), False
