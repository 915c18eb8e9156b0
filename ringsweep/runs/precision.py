"""Error against run time of methods and settings for a scene, and the cheapest setting that meets a target."""

from __future__ import annotations

import dataclasses
import math
import os
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from functools import partial
from time import get_clock_info, perf_counter, thread_time
from typing import Any

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from ringsweep.compile import readable_compile_errors, take
from ringsweep.config import Config, load
from ringsweep.config.axes import COUNT
from ringsweep.errors import InputError
from ringsweep.models import batch, model_of
from ringsweep.models.scene import LAW
from ringsweep.quantities.flags import FAILED
from ringsweep.quantities.parameters import Parameter
from ringsweep.quantities.units import quantity
from ringsweep.quantities.variables import PRECISION
from ringsweep.runs.cells import coordinates, values_of_cells
from ringsweep.runs.contenders import Answer, Contender, compete, described, errors, fastest, judge
from ringsweep.runs.executors import interruptible, progress_bar
from ringsweep.solvers.certificate import agree
from ringsweep.solvers.event import Auto, Event, Implicit
from ringsweep.solvers.method import Result
from ringsweep.solvers.rk4 import RK4
from ringsweep.storage.provenance import attributes

#: Default of the largest error allowed: rad or m at the end, s at separation.
TARGET = 1e-6

CELLS = 16

ROUNDS = 3

# Tolerances of the reference, and of the run from which its uncertainty follows.
_TIGHTEST: dict[type, tuple[float, float]] = {Event: (1e-15, 1e-14), Implicit: (1e-11, 1e-10)}

# The tightest is two digits above the tolerance of the reference.
_TOLERANCES: dict[type, tuple[float, ...]] = {
    Event: (1e-4, 1e-5, 1e-6, 1e-7, 1e-8, 1e-9, 1e-10, 1e-11, 1e-12),
    Implicit: (1e-3, 1e-4, 1e-5, 1e-6, 1e-7, 1e-8, 1e-9),
}

_STEPS = tuple(10**k for k in range(2, 8))

# Seconds that the runs of one setting may take with certificates.
_BUDGET = 20.0

# The time of the thread does not count other processes, but some systems measure it too coarsely.
_clock = thread_time if get_clock_info("thread_time").resolution < 1e-4 else perf_counter

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
    decades of `steps`. Settings that would take longer than 20 s are left out and named. A setting meets the
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
    scene, axes = config.scene, config.axes
    if config.sample is not None:
        raise InputError("sweep.sample", "precision measures the cells of a grid: leave sample out")
    if len(scene.structures) > 1:
        kind = "points" if LAW in config.source["sweep"].get("points", {}) else "grid"
        laws = ", ".join(scene.structures)
        raise InputError(f"sweep.{kind}.{LAW}", f"each of {laws} needs a reference of its own: give one law here")
    structure = scene.structure
    model = model_of(structure)
    names = model.columns(structure)
    methods, left_out = _methods(config)
    best = type(methods[0])
    total = math.prod(axes.sizes.values())
    sample = np.arange(total)
    if cells < total:
        sample = np.sort(np.random.default_rng(0).choice(total, cells, replace=False))
    sampled = batch(structure, values_of_cells(scene, axes, sample))

    def run(method: Any, certify: bool = False) -> Result:
        with readable_compile_errors():
            return replace(method, certify=certify).run(sampled, names)

    tight, looser = (run(best(rtol=rtol)).rows for rtol in _TIGHTEST[best])
    known = np.flatnonzero(agree(tight, looser, names))
    if not len(known):
        raise InputError(
            "scene",
            f"there is no reference to measure errors: in all of the {len(sample)} cells tried {best.name} fails, "
            "or its two tightest runs disagree on the regime",
        )
    sampled, tight, looser = take(sampled, known), tight[known], looser[known]

    def answer(rows: NDArray[np.float64], steps: float | None = None) -> Answer:
        number = dict(zip(names, rows.T, strict=True))
        # The state at which a failed run stopped is no answer.
        end = np.where(number["regime"] == FAILED, np.nan, number[model.place_end])
        separation = number.get("t_separation", np.full(len(rows), np.nan))
        return Answer(end, separation, agree(rows, tight, names)[:, np.newaxis], steps)

    with progress_bar(len(methods) * (rounds + 1), progress) as bar:
        certified, slow = _certified(methods, run, bar.update)
        methods = list(certified)
        dataset = compete(
            [Contender(method.name, _setting(method), partial(run, method), len(known)) for method in methods],
            answer(tight),
            model.place_end,
            rounds,
            lambda result: answer(result.rows, result.steps.mean()),
            clock=_clock,
            done=bar.update,
        )
    passed = np.array([one.certified for one, _ in certified.values()])
    # With certificates a method may replace an answer by that of a finer run: it does not certify the first.
    replaced = [agree(one.rows, tight, names) for one, _ in certified.values()] == dataset["regime_wrong"].values
    dataset["flagged"] = ("contender", "cell"), ~passed | replaced
    for name in ("error_end", "error_separation"):
        dataset[f"reference_{name}"] = "cell", errors(answer(looser), answer(tight))[name]
    if "t_separation" not in names:
        dataset = dataset.drop_vars(["error_separation", "reference_error_separation"])
    dataset = described(dataset.map(lambda data: data.astype(PRECISION[data.name].dtype)), model.place_end)

    solvers = [solver_yaml(method) for method in methods]
    values = values_of_cells(scene, axes, sample[known])
    law = [structure.law] * len(known)
    along = {path: ("cell", law if path == LAW else values[path]) for path in axes.columns}
    label = "number of the cell in the sweep, last dimension fastest"
    dataset = dataset.assign_coords(
        solver=("contender", solvers, {"long_name": "text under solver in a configuration"}),
        cell=("cell", sample[known], {"long_name": label}),
        **coordinates(scene, along),
    )
    wrong, worst, _ = judge(dataset, target)
    chosen = fastest(dataset, target)
    found = "closest" if chosen is None else "recommended"
    if chosen is None:
        chosen = int(np.lexsort([worst, wrong])[0])
    seconds = certified[methods[chosen]][1] / len(known)
    words = {
        "target": target,
        "reference": solver_yaml(best(rtol=_TIGHTEST[best][0])),
        "sampled": f"{len(known)} of {total} cells",
        found: solvers[chosen],
        "certificate_cost": seconds / dataset["time_per_run"].values[chosen],
    }
    if dropped := len(sample) - len(known):
        words["sampled"] += (
            f"; {dropped} more were drawn, but have no reference: its two tightest runs disagree, or fail"
        )
    if left_out or slow:
        words["left_out"] = "; ".join([*left_out, *slow])
    if (configured := solver_yaml(config.solver.resolved(structure))) in solvers:
        words["configured"] = configured
    return dataset.assign_attrs(attributes(config) | words)


def _methods(config: Config) -> tuple[list[Any], list[str]]:
    """Methods with settings, from cheap to expensive; and why others are left out, in words."""
    structure, configured = config.scene.structure, config.solver
    best: Any = type(Auto().resolved(structure))
    tolerances = {*_TOLERANCES[best], best.rtol} | ({configured.rtol} if isinstance(configured, best) else set())
    limit = getattr(configured, "max_steps", best.max_steps)
    found = [best(rtol=rtol, max_steps=limit) for rtol in sorted(tolerances, reverse=True)]
    steps = {*_STEPS} | ({configured.steps} if isinstance(configured, RK4) else set())
    fixed = [RK4(steps=n) for n in sorted(steps)]
    try:
        fixed[0].check(structure)
    except InputError as error:
        return found, [error.problem]
    return found + fixed, []


def _certified(
    methods: Sequence[Any], run: Callable[[Any, bool], Result], done: Callable[[], Any]
) -> tuple[dict[Any, tuple[Result, float]], list[str]]:
    """Results with certificates and their run times, s, by method; and the settings that would take too long."""
    found: dict[Any, tuple[Result, float]] = {}
    left_out = []
    latest: dict[type, float] = {}
    for method in methods:
        steps = getattr(method, "steps", 1)
        if type(method) not in latest:
            # The first run may compile.
            run(method, True)
        elif (expected := latest[type(method)] * steps) > _BUDGET:
            left_out.append(f"{method.name}, {_setting(method)} (about {expected:.0f} s; {_BUDGET:g} s are allowed)")
            continue
        begin = _clock()
        result = run(method, True)
        found[method] = result, _clock() - begin
        latest[type(method)] = found[method][1] / steps
        done()
    return found, left_out


def _setting(method: Any) -> str:
    """The tolerance or the number of steps of a method, as text."""
    return f"{method.steps} steps" if isinstance(method, RK4) else f"rtol {method.rtol!r}"


def solver_yaml(method: Any) -> str:
    """Text under ``solver`` in a configuration for this method: its setting, and options that are not defaults."""
    options = {"steps": method.steps} if isinstance(method, RK4) else {"rtol": method.rtol}
    options |= {
        option.name: getattr(method, option.name)
        for option in dataclasses.fields(method)
        if option.name not in (*options, "certify") and getattr(method, option.name) != option.default
    }
    return ", ".join([f"method: {method.name}", *(f"{name}: {value!r}" for name, value in options.items())])
