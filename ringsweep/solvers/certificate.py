"""Comparison of two runs of a cell at different resolutions: whether they agree, and bounds on their errors.

`one`, `rows` are the runs that a dataset shows, `other`, `second_rows` the runs at the other resolution. All arrays
have the cells as first dimension. Nothing here runs in kernels.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache, cached_property
from types import SimpleNamespace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ringsweep.models import tangent
from ringsweep.models.interface.audit import least_scales, of_events, same_statistics, undecided
from ringsweep.quantities.flags import (
    ANSWERS_DIFFER,
    CERTIFIED,
    CHAOTIC,
    CLOSE_CALL,
    DIVERGES,
    FAILED,
    LAW_NOT_OBEYED,
    NO_RESULT,
    NOT_FINITE,
)
from ringsweep.quantities.variables import MASSES, OUTCOMES

#: Outcomes on which two resolutions must agree for a certificate.
_CERTIFIED = ("regime", "motion", "motion_1", "motion_2", "separating_contact", "aftermath", "word")

# Outcomes that may be NaN in a certified run; those of one body have a number behind them where there are several.
_OF_A_BODY = "first_slip", "period", "stops_per_cycle", "swing", "jump_max", "t_jump_max"
_MAY_LACK = (
    *("t_separation", "t_recovered", "normal_max_1", "normal_max_2"),
    *_OF_A_BODY,
    *(f"{name}_{i}" for i in MASSES for name in _OF_A_BODY),
    *tangent.OUTCOMES,
    *(name for name, variable in OUTCOMES.items() if "section" in variable.dims),
)

# Forces, and jumps of the acceleration: they follow from the motion, and friction may magnify its errors.
_FORCES = tuple(name for name, variable in OUTCOMES.items() if variable.units in ("N", "rad s-2"))

# Difference of two final states that rounding explains, as a share of the scale of a number.
_SAME = 1e-14

# Two runs have diverged if they differ by more than this share of the scale of a number, or by more than so many
# tolerances of the looser run: then rounding alone may have grown to a share of the first.
_MOST_APART, _MOST_GROWTH = 1e-3, 1e6

# Differences shrink if the difference from a run at a tighter tolerance is at most this share of the difference before.
_SHRUNK = 0.2

# Rounding of a step. The rounding of a run grows with the root of the number of steps.
_ROUNDING = 1e-15


@dataclass(frozen=True, eq=False)
class TwoRuns:
    """Two runs of each cell, at different resolutions.

    Attributes
    ----------
    batch : NamedTuple
        Cells.
    rows, second_rows : ndarray of shape ``(cells, outcomes)``
        Outcomes of the runs, and of the second runs.
    outcomes : tuple of str
        Names of the columns.
    """

    batch: Any
    rows: NDArray[np.float64]
    second_rows: NDArray[np.float64]
    outcomes: tuple[str, ...]

    @cached_property
    def named(self) -> tuple[SimpleNamespace, SimpleNamespace]:
        """Outcomes by name, of the runs and of the second runs."""
        one, other = (dict(zip(self.outcomes, rows.T, strict=True)) for rows in (self.rows, self.second_rows))
        return SimpleNamespace(**one), SimpleNamespace(**other)

    @cached_property
    def differences(self) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Differences between both runs in the numbers that have a bound on their error, and the scale of each."""
        names = with_errors(self.outcomes)
        columns = [self.outcomes.index(name) for name in names]
        a = self.rows[:, columns]
        with np.errstate(invalid="ignore", over="ignore"):
            difference = np.abs(a - self.second_rows[:, columns])
        # A reaction that is infinite before a jam is no scale of the others.
        sizes = np.where(np.isinf(a), np.nan, np.abs(a))
        units = [OUTCOMES[name].units for name in names]
        own_scales = {"s": self.batch.span} | least_scales(self.batch)
        largest: dict[str, NDArray[np.float64]] = {}
        # A number may be small beside those of the motion, which its error follows: a velocity at a turn, a small jump.
        # In this order a place comes before its velocity, and a velocity before an acceleration.
        for unit in sorted(set(units)):
            least = own_scales.get(unit, 0.0 if unit[0] in "mNJ" or unit == "rad s-2" else 1.0)
            if unit == "m s-1":
                least = least + largest["m"] / own_scales["s"]
            if unit == "rad s-2":
                with np.errstate(over="ignore"):
                    by_motion = largest["rad s-1"] ** 2 if "rad" in units else largest["m s-1"] / own_scales["s"]
                least = least + by_motion
            of_unit = [k for k, other in enumerate(units) if other == unit]
            largest[unit] = np.fmax.reduce(sizes[:, of_unit], axis=1, initial=0.0) + least
        return difference, np.stack([largest[unit] for unit in units], axis=1)


def agree(rows: NDArray[np.float64], second_rows: NDArray[np.float64], outcomes: tuple[str, ...]) -> NDArray[np.bool_]:
    """Whether two runs of each cell agree on regime, motion and separating contact, and have not failed.

    Parameters
    ----------
    rows, second_rows : ndarray of shape ``(cells, outcomes)``
        Outcomes of the runs, and of second runs at another resolution.
    outcomes : tuple of str
        Names of the columns.

    Returns
    -------
    ndarray of bool, shape ``(cells,)``
    """
    columns = [outcomes.index(name) for name in _CERTIFIED if name in outcomes]
    same: NDArray[np.bool_] = (rows[:, columns] == second_rows[:, columns]).all(axis=1)
    return same & (rows[:, outcomes.index("regime")] != FAILED)


def judged(
    runs: TwoRuns, fall_rates: Any, diverge: NDArray[np.bool_], doubt: tuple[NDArray[np.bool_], int], **bounds: Any
) -> tuple[NDArray[np.int8], NDArray[np.float64]]:
    """What speaks against the certificate of each cell, and bounds on its errors; widens that of an exponent.

    Parameters
    ----------
    runs : TwoRuns
    fall_rates : ndarray of shape ``(cells,)``
        As for :func:`ringsweep.models.interface.audit.undecided`.
    diverge : ndarray of bool, shape ``(cells,)``
        Whether nearby runs diverge.
    doubt : tuple
        Where the method itself has a doubt, of shape ``(cells,)``, and which.
    **bounds
        Arguments of :func:`errors`.

    Returns
    -------
    tuple of ndarray
        Values of :data:`ringsweep.quantities.variables.DOUBTS`, ``CERTIFIED`` where nothing speaks against the
        certificate; and what :func:`errors` returns, NaN where runs diverge.
    """
    batch, rows, outcomes, (one, other) = runs.batch, runs.rows, runs.outcomes, runs.named
    needed = [column for column, name in enumerate(outcomes) if name not in _MAY_LACK]
    chaotic = diverge & ~same_statistics(batch, one, other) if diverge.any() else diverge
    reasons = {
        NO_RESULT: one.regime == FAILED,
        ANSWERS_DIFFER: ~agree(rows, runs.second_rows, outcomes),
        LAW_NOT_OBEYED: of_events(batch, one)[0] | of_events(batch, other)[0],
        CLOSE_CALL: undecided(batch, one, other, fall_rates),
        NOT_FINITE: ~np.isfinite(rows[:, needed]).all(axis=1),
    }
    cases = [*reasons.items(), doubt[::-1], (DIVERGES, chaotic)]
    because = np.select([holds for _, holds in cases], [reason for reason, _ in cases], CERTIFIED).astype(np.int8)
    found = errors(runs, **bounds)
    found[diverge] = np.nan
    if "lyapunov" in outcomes:
        # What a run tells of the error of its exponent is the scatter of the growth, without the errors of its steps.
        # Two runs of a chaotic motion differ by that scatter.
        column = outcomes.index("lyapunov_error")
        with np.errstate(invalid="ignore"):
            of_steps = bounds["safety"] * abs(one.lyapunov - other.lyapunov)
        of_steps[diverge | (one.long_run == CHAOTIC)] = 0.0
        rows[:, column] += np.nan_to_num(of_steps, posinf=0.0)
    return because, found


def took_same_steps(runs: TwoRuns) -> NDArray[np.bool_]:
    """Whether both runs of each cell took the same steps, since they end in the same state; of shape ``(cells,)``.

    The difference between such runs says nothing about the error. A body that sticks all the time is no such case: the
    drive alone decides its motion.
    """
    ends = [column for column, name in enumerate(with_errors(runs.outcomes)) if "_end" in name]
    # The time for which it sticks is a sum, which is rounded.
    one, _ = runs.named
    stuck = np.isclose([vars(one)[name] for name in _columns_of(runs, "stick_time")], one.t_end, rtol=1e-12, atol=0.0)
    stuck = stuck.all(axis=0)
    difference, scale = runs.differences
    with np.errstate(invalid="ignore"):
        same = (difference <= _SAME * scale)[:, ends].all(axis=1)
    return np.asarray(same & ~stuck)


def _columns_of(runs: TwoRuns, name: str) -> list[str]:
    """The outcome of this name, or those of several masses."""
    return [name] if name in runs.outcomes else [f"{name}_{i}" for i in MASSES]


def apart(runs: TwoRuns) -> NDArray[np.float64]:
    """Largest difference between both runs of each cell in any number, relative to the scale of the number."""
    difference, scale = runs.differences
    # Laps of other lengths, and forces at other events, are no measure of divergence.
    passing = (*_columns_of(runs, "period"), *_FORCES)
    lasting = [k for k, name in enumerate(with_errors(runs.outcomes)) if name not in passing]
    return _largest(difference[:, lasting], scale[:, lasting])


def diverging(
    distance: NDArray[np.float64], tolerance: float, distance_before: NDArray[np.float64] | None = None
) -> NDArray[np.bool_]:
    """Whether nearby runs diverge, so that their difference bounds no error.

    Parameters
    ----------
    distance : ndarray of shape ``(cells,)``
        What :func:`apart` returned for each run and the run at the looser tolerance.
    tolerance : float
        Relative error allowed to a step of the looser run.
    distance_before : ndarray of shape ``(cells,)``, optional
        The same for the looser run and the run before it; infinite where these did not diverge.

    Returns
    -------
    ndarray of bool, shape ``(cells,)``
    """
    found: NDArray[np.bool_] = distance > min(_MOST_APART, _MOST_GROWTH * tolerance)
    return found if distance_before is None else found | ~(distance <= _SHRUNK * distance_before)


@cache
def with_errors(outcomes: tuple[str, ...]) -> tuple[str, ...]:
    """Names of the outcomes that have a bound on their error; a run itself tells some of the errors."""
    errors = {name: f"{name}_error" for name in outcomes}
    return tuple(name for name in outcomes if errors[name] in OUTCOMES and errors[name] not in outcomes)


def errors(
    runs: TwoRuns,
    *,
    safety: Any,
    share: float,
    force_share: float = 0.0,
    steps: Any,
    floor: Any = 0.0,
    motion_floor: Any = 0.0,
    rate_floor: Any = 0.0,
    force_floor: Any = 0.0,
    friction_floor: Any = 0.0,
    instant_floor: Any = 0.0,
) -> NDArray[np.float64]:
    """Bounds on the errors of runs, from second runs at another resolution.

    Two runs may be close in one outcome by chance, but hardly in all outcomes. So a share of the largest relative
    difference counts in every outcome.

    Parameters
    ----------
    runs : TwoRuns
    safety : float or ndarray of shape ``(cells,)``
        Largest error of a run, in units of its difference from the second run.
    share : float
        Share of the largest relative difference that counts in every outcome.
    force_share : float
        The same in forces and jumps, if it is larger.
    steps : ndarray of shape ``(cells,)``
        Number of steps. Their rounding accumulates.
    floor, motion_floor, rate_floor : float or ndarray of shape ``(cells,)``
        Errors that the difference does not show: relative errors; relative errors that all but forces and jumps have
        in addition; and errors of the rate of the place, rad/s or on a belt m/s, which velocities have in addition.
    force_floor, friction_floor : float or ndarray of shape ``(cells,)``
        Relative errors that forces and jumps, and that friction itself, have in addition.
    instant_floor : float or ndarray of shape ``(cells,)``
        Error of the instant at which a reaction vanishes, in units of the scale of forces, s/N.

    Returns
    -------
    ndarray of shape ``(cells, len(with_errors(outcomes)))``
        Each in the unit of its outcome; NaN where :func:`agree` is false.
    """
    names = with_errors(runs.outcomes)
    difference, scale = runs.differences
    with np.errstate(invalid="ignore", over="ignore"):
        of_motion = [k for k, name in enumerate(names) if name not in _FORCES]
        shares = [share if k in of_motion else max(share, force_share) for k in range(len(names))]
        least = shares * _largest(difference[:, of_motion], scale[:, of_motion])[:, None] * scale
        bound: NDArray[np.float64] = np.atleast_1d(safety)[:, None] * np.maximum(difference, least)
        bound += np.atleast_1d(floor + _ROUNDING * np.sqrt(1.0 + np.asarray(steps)))[:, None] * scale
        bound[:, of_motion] += np.reshape(motion_floor, (-1, 1)) * scale[:, of_motion]
        units = [OUTCOMES[name].units for name in names]
        for k, unit in enumerate(units):
            if unit.endswith(" s-1"):
                place = units.index(unit.removesuffix(" s-1"))
                bound[:, k] += rate_floor * (scale[:, place] if "rad" in units else 1.0)
            if names[k] in _FORCES:
                bound[:, k] += force_floor * scale[:, k]
            if names[k].startswith("force_max"):
                bound[:, k] += friction_floor * np.fmax(scale[:, k], least_scales(runs.batch).get("friction", 0.0))
    # A run that reaches the end of the span has an exact time of its end, and without an event nothing jumps.
    one, _ = runs.named
    end, jumps = names.index("t_end"), _columns_of(runs, "jump_max")
    bound[(one.regime == one.motion) & (difference[:, end] == 0.0), end] = 0.0
    late = np.where(one.t_end < runs.batch.span, instant_floor * scale[:, units.index("N")], 0.0)
    for k in (k for k, name in enumerate(names) if name in ("t_end", "t_separation")):
        bound[:, k] += late
    # If two runs end at nearly the same event by chance, their last velocities are close by the same chance.
    at_end = ("phi_end", "omega_end") if "omega_end" in names else ("x_end", "velocity_end")
    for jump_max, *ends in zip(jumps, *(_columns_of(runs, name) for name in at_end), strict=True):
        jump, last = names.index(jump_max), names.index(ends[1])
        bound[(vars(one)[jump_max] == 0.0) & (difference[:, jump] == 0.0), jump] = 0.0
        with np.errstate(invalid="ignore", divide="ignore", over="ignore"):
            acceleration = np.minimum(difference[:, last] / difference[:, end], scale[:, jump])
            of_velocity = np.fmax(bound[:, end] * acceleration, late * scale[:, jump])
            of_place = late * np.abs(vars(one)[ends[1]])
            for k, name in enumerate(names):
                for value, by in zip(ends, (of_place, of_velocity), strict=True):
                    # An extreme may be the value at the end.
                    if units[k] == OUTCOMES[value].units:
                        is_last = np.abs(vars(one)[name] - vars(one)[value]) <= by
                        bound[:, k] = np.where(is_last, np.fmax(bound[:, k], by), bound[:, k])
    bound[~agree(runs.rows, runs.second_rows, runs.outcomes)] = np.nan
    return bound


def _largest(difference: NDArray[np.float64], scale: NDArray[np.float64]) -> NDArray[np.float64]:
    """Largest relative difference of each cell."""
    with np.errstate(invalid="ignore", divide="ignore", over="ignore"):
        relative = np.where(scale > 0.0, difference / scale, 0.0)
        found: NDArray[np.float64] = np.fmax.reduce(relative, axis=1, initial=0.0)
    return found
