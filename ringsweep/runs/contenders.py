"""Methods at settings that compete: their run times, taken in turn, and their errors beside a reference."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from math import ceil
from statistics import median
from typing import Any, NamedTuple

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from ringsweep.quantities.variables import OUTCOMES, PRECISION


class Answer(NamedTuple):
    """What a contender says of some cells, the first ones of all.

    Attributes
    ----------
    end : ndarray of shape ``(cells,)``
        Angle (rad) or displacement (m) at the end; not finite if the run failed.
    separation : ndarray of shape ``(cells,)``
        Time of separation, s, or NaN.
    regime : ndarray of shape ``(cells, words)``, optional
        Flags of the classification. Without them only whether the body separates is compared.
    steps : float, optional
        Steps of the integration, mean over the cells.
    """

    end: NDArray[np.float64]
    separation: NDArray[np.float64]
    regime: NDArray[Any] | None = None
    steps: float | None = None


@dataclass(frozen=True)
class Contender:
    """A method at a setting, compiled before.

    Attributes
    ----------
    method, setting : str
    run : callable
        Returns an :class:`Answer`, or what :func:`compete` is told to read as one.
    lanes : int
        Runs in one call.
    """

    method: str
    setting: str
    run: Callable[[], Any]
    lanes: int


def alternate(
    calls: Mapping[Any, Callable[[], Any]],
    rounds: int,
    shortest: float = 0.05,
    patience: float = 5.0,
    clock: Callable[[], float] = time.perf_counter,
    done: Callable[[], Any] = lambda: None,
) -> tuple[dict[Any, list[float]], dict[Any, Any]]:
    """Time functions in turn, forwards and backwards, so that other load on the machine slows all of them alike.

    Parameters
    ----------
    calls : mapping
        Functions by name, compiled before.
    rounds : int
    shortest : float
        Least time of a measurement, s: a call that is shorter is repeated.
    patience : float
        A call that is longer than this (s) is timed only in the first round.
    clock : callable
    done : callable
        Called after each measurement.

    Returns
    -------
    times : dict of list of float
        Seconds in each round, by name.
    results : dict
        The last return value of each function by name.
    """
    times: dict[Any, list[float]] = {name: [] for name in calls}
    repeats: dict[Any, int] = {}
    results: dict[Any, Any] = {}

    def seconds(name: Any, count: int) -> float:
        begin = clock()
        for _ in range(count):
            results[name] = calls[name]()
        return (clock() - begin) / count

    for k in range(rounds):
        for name in list(calls)[:: 1 if k % 2 == 0 else -1]:
            if not times[name]:
                once = seconds(name, 1)
                repeats[name] = ceil(shortest / max(once, 1e-6))
                times[name].append(once if repeats[name] == 1 else seconds(name, repeats[name]))
            elif times[name][0] <= patience:
                times[name].append(seconds(name, repeats[name]))
            done()
    return times, results


def compete(
    contenders: Sequence[Contender],
    exact: Answer,
    place_end: str,
    rounds: int,
    read: Callable[[Any], Answer] = lambda result: Answer(*result),
    **options: Any,
) -> xr.Dataset:
    """Times and errors of contenders.

    Parameters
    ----------
    contenders : sequence of Contender
    exact : Answer
        That of the reference, in all cells.
    place_end : str
        Outcome of which :attr:`Answer.end` is the value, such as ``"phi_end"``.
    rounds : int
    read : callable
        Gives the :class:`Answer` in what a contender returns.
    **options
        As for :func:`alternate`.

    Returns
    -------
    xarray.Dataset
        Dimensions ``contender`` and ``cell``, coordinates ``method`` and ``setting``, variables of
        :data:`ringsweep.quantities.variables.PRECISION`. Cells that a contender does not run have NaN.
    """
    times, results = alternate({k: contender.run for k, contender in enumerate(contenders)}, rounds, **options)
    per_run = [median(times[k]) / contender.lanes for k, contender in enumerate(contenders)]
    found = xr.Dataset(
        {"time_per_run": ("contender", per_run)},
        coords={
            "method": ("contender", [contender.method for contender in contenders], {"long_name": "method"}),
            "setting": ("contender", [contender.setting for contender in contenders], {"long_name": "its setting"}),
        },
    )
    answers = [read(results[k]) for k in range(len(contenders))]
    if all(answer.steps is not None for answer in answers):
        found["steps"] = "contender", [answer.steps for answer in answers]
    each = [errors(answer, exact) for answer in answers]
    for name in each[0]:
        column = np.full((len(contenders), len(exact.end)), np.nan)
        for row, one in zip(column, each, strict=True):
            row[: len(one[name])] = one[name]
        found[name] = ("contender", "cell"), column
    return described(found, place_end)


def errors(answer: Answer, exact: Answer) -> dict[str, NDArray[Any]]:
    """Errors of an answer in each of its cells: infinite if the run failed, NaN if one of the two has no number."""
    count = len(answer.end)
    error, separation = abs(answer.end - exact.end[:count]), exact.separation[:count]
    if answer.regime is not None and exact.regime is not None:
        wrong = (answer.regime != exact.regime[:count]).any(axis=1)
    elif np.isfinite(exact.separation).any():
        wrong = (np.isfinite(answer.separation) != np.isfinite(separation)) | ~np.isfinite(answer.end)
    else:
        wrong = np.full(count, np.nan)
    return {
        "error_end": np.where(np.isfinite(error), error, np.inf),
        "error_separation": abs(answer.separation - separation),
        "regime_wrong": wrong,
    }


def described(ds: xr.Dataset, place_end: str) -> xr.Dataset:
    """The dataset with attributes; of what is about the end in the words and the unit of the model's place."""
    end = OUTCOMES[place_end]
    for name, data in ds.items():
        variable = PRECISION[str(name)]
        if str(name).endswith("error_end"):
            words = variable.long_name.replace(OUTCOMES["phi_end"].long_name, end.long_name)
            variable = replace(variable, long_name=words, unit=end.unit)
        data.attrs = variable.attributes
    return ds


def judge(ds: xr.Dataset, target: float) -> tuple[NDArray[np.intp], NDArray[np.float64], NDArray[np.bool_]]:
    """Of each contender the number of wrong regimes, the largest error, and whether it meets the target.

    Errors are those at the end and of the separation, plus the uncertainty of the reference if the dataset has it.
    """
    names = [name for name in ("error_end", "error_separation") if name in ds]
    worst = np.fmax.reduce([(ds[name] + ds.get(f"reference_{name}", 0.0)).max("cell").values for name in names])
    wrong = (ds["regime_wrong"] == 1).sum("cell").values
    return wrong, worst, (wrong == 0) & (worst <= target)


def fastest(ds: xr.Dataset, target: float, *methods: str) -> int | None:
    """Number of the fastest contender, or of the fastest of these methods, that meets a target; None if none does."""
    met = np.flatnonzero(judge(ds, target)[2] & (ds["method"].isin(methods).values if methods else True))
    return int(met[np.argmin(ds["time_per_run"].values[met])]) if len(met) else None
