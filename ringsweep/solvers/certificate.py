"""What two runs of a cell at different resolutions tell: whether they agree, and bounds on their errors."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from ringsweep.models.interface.audit import undecided
from ringsweep.quantities.variables import FAILED, OUTCOMES

#: What two resolutions must agree on for a certificate.
_WITNESSED = ("regime", "motion", "separating_contact")


# Outcomes that a run may lack.
_MAY_LACK = ("t_separation", "first_slip", "period")


# Share by which ends may differ that are the same but for rounding.
_SAME = 1e-14


# Least error stated: a share of the tolerance of a step, what rounding leaves of a step, and a share of the difference,
# relative to its scale, of the number in which two resolutions differ most. Found by trial, see docs/accuracy.md.
_FLOOR, _ROUNDING, _TOGETHER = 0.05, 1e-15, 0.04


def agree(rows: NDArray[np.float64], witness: NDArray[np.float64], outcomes: tuple[str, ...]) -> NDArray[np.bool_]:
    """Where two resolutions agree on what is certified, and have not both failed."""
    columns = [outcomes.index(name) for name in _WITNESSED if name in outcomes]
    same: NDArray[np.bool_] = (rows[:, columns] == witness[:, columns]).all(axis=1)
    return same & (rows[:, outcomes.index("regime")] != FAILED)


def vouched(
    batch: Any, rows: NDArray[np.float64], witness: NDArray[np.float64], fall: Any, outcomes: tuple[str, ...]
) -> NDArray[np.bool_]:
    """Where two resolutions agree, all numbers are numbers, and the verdict does not hang by less than they differ.

    Parameters
    ----------
    batch : NamedTuple
    rows, witness : ndarray of shape ``(cells, outcomes)``
        What a run and a run at another resolution came to.
    fall : ndarray of shape ``(cells,)``
        How fast the guard fell by which each run ended.
    outcomes : tuple of str
        Names of the columns.

    Returns
    -------
    ndarray of bool, shape ``(cells,)``
    """
    needed = [column for column, name in enumerate(outcomes) if name not in _MAY_LACK]
    certain: NDArray[np.bool_] = agree(rows, witness, outcomes) & ~undecided(batch, rows, witness, fall)
    return certain & np.isfinite(rows[:, needed]).all(axis=1)


def repeated(rows: NDArray[np.float64], witness: NDArray[np.float64], outcomes: tuple[str, ...]) -> NDArray[np.bool_]:
    """Where two resolutions took the same steps, by their ends: they tell nothing of their error.

    A body that sticks all the time is where the drive takes it, whatever the steps.
    """
    ends = [column for column, name in enumerate(outcomes) if name.endswith("_end")]
    stuck = rows[:, outcomes.index("stick_time")] == rows[:, outcomes.index("t_end")]
    a, b = rows[:, ends], witness[:, ends]
    with np.errstate(invalid="ignore"):
        same = (np.abs(a - b) <= _SAME * (1.0 + np.abs(a))).all(axis=1)
    return np.asarray(same & ~stuck)


def with_errors(outcomes: tuple[str, ...]) -> tuple[str, ...]:
    """Names of the outcomes whose errors are stated."""
    return tuple(name for name in outcomes if f"{name}_error" in OUTCOMES)


def errors(
    rows: NDArray[np.float64],
    witness: NDArray[np.float64],
    outcomes: tuple[str, ...],
    *,
    safety: float,
    tolerance: float = 0.0,
    steps: Any = 0.0,
) -> NDArray[np.float64]:
    """Bounds on the errors of runs, from runs at another resolution.

    Two runs may come close to each other in one number by chance, but hardly in all numbers at once.

    Parameters
    ----------
    rows, witness : ndarray of shape ``(cells, outcomes)``
    outcomes : tuple of str
        Names of the columns.
    safety : float
        Error of a run in units of its difference from the other one, at most.
    tolerance : float
        Relative error allowed to a step.
    steps : ndarray of shape ``(cells,)``
        Number of steps, whose rounding adds up.

    Returns
    -------
    ndarray of shape ``(cells, numbers)``
        For the numbers that :func:`with_errors` names; NaN where the two runs do not agree in kind.
    """
    names = with_errors(outcomes)
    columns = [outcomes.index(name) for name in names]
    a = rows[:, columns]
    with np.errstate(invalid="ignore", over="ignore"):
        apart = np.abs(a - witness[:, columns])
    units = np.array([OUTCOMES[name].units for name in names])
    scale = np.empty_like(a)
    for unit in set(units.tolist()):
        own = units == unit
        largest = np.nanmax(np.abs(a[:, own]), axis=1, initial=0.0)
        scale[:, own] = (largest + (0.0 if unit.startswith("m") else 1.0))[:, None]
    least = _FLOOR * tolerance + _ROUNDING * np.sqrt(1.0 + np.asarray(steps))[..., None]
    with np.errstate(invalid="ignore", divide="ignore", over="ignore"):
        all_apart = np.nanmax(np.where(scale > 0.0, apart / scale, 0.0), axis=1, initial=0.0)[:, None]
        bound: NDArray[np.float64] = safety * np.maximum(apart, _TOGETHER * all_apart * scale) + least * scale
    # The end of the span is exact, where a run reaches it.
    reached = rows[:, outcomes.index("regime")] == rows[:, outcomes.index("motion")]
    bound[reached & (apart[:, names.index("t_end")] == 0.0), names.index("t_end")] = 0.0
    bound[~agree(rows, witness, outcomes)] = np.nan
    return bound
