"""What the steps of a run share: arrays to work in, and the step that was taken.

A *step* is a power series or implicit; the solvers of events, their audit and the history read it.
"""

from __future__ import annotations

import inspect
from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np

from ringsweep.compile import borrowed, function_from_lines, hook, inlined, kernel
from ringsweep.numerics.clock import Instant
from ringsweep.numerics.series import STACK
from ringsweep.numerics.terms import COLUMNS
from ringsweep.physics import drives
from ringsweep.physics.friction import Dynamic, SetValued, Smooth

#: The second run of a certificate has a tolerance that is looser by this factor.
FACTOR = 30.0

# Largest number of components of a state.
MOST_COMPONENTS = 8


def either(of_series: Callable[..., Any], of_implicit: Callable[..., Any]) -> Any:
    """Make a function ``(family, scene, step, ...)`` that is `of_series` or `of_implicit`, as the step is.

    The family of the friction law decides which of them a kernel contains: set-valued laws take series only, laws with
    bristles implicit steps only. Both have the same arguments.
    """
    found, names = hook(inlined(of_series)), ", ".join(inspect.signature(of_series).parameters)
    found.implements(SetValued)(of_series)
    found.implements(Dynamic)(inlined(of_implicit))
    line = f"return of_implicit({names}) if step.is_implicit else of_series({names})"
    scope = {"of_series": of_series, "of_implicit": of_implicit}
    found.implements(Smooth)(function_from_lines(names, [line], scope))
    return found


class Scratch(NamedTuple):
    """Arrays that the steps of a run fill, and use again.

    Attributes
    ----------
    c : ndarray of shape ``(rows, columns)``
        Table of the series of a step.
    work : ndarray of shape ``(STACK, columns)``
        For the isolation of roots.
    course : ndarray of shape ``COURSE_SHAPE``
        Series of the drive, see :func:`ringsweep.physics.drives.follow`.
    bends : ndarray of shape ``(2, 3, MOST_COMPONENTS)``
        ``bends[0]`` holds what :func:`ringsweep.solvers.rosenbrock.dense` needs of the last implicit step.
    first_guard : int
        Row of the first guard in the table of series.
    """

    c: Any
    work: Any
    course: Any
    bends: Any
    first_guard: int


class Step(NamedTuple):
    """A step that was taken.

    Attributes
    ----------
    mode : NamedTuple
    is_implicit : bool
        Whether the step is implicit. If not, the table of series describes it.
    now : Instant
        Time at its beginning, s.
    s : float
        Its length, s.
    y, y_next : tuple of float
        States at both ends.
    """

    mode: Any
    is_implicit: Any
    now: Instant
    s: float
    y: Any
    y_next: Any


@inlined
def without_counts(scratch):
    """Scratch whose arrays have no reference counts, see :func:`ringsweep.compile.borrowed`."""
    c, work, course, bends, first_guard = scratch
    return Scratch(borrowed(c), borrowed(work), borrowed(course), borrowed(bends), first_guard)


def scratch_for(rows: int, first_guard: int) -> Scratch:
    """Scratch for a table of so many series."""
    # NumPy's functions that make arrays would have to be compiled into each kernel.
    return Scratch(
        np.zeros((rows, COLUMNS)),
        np.empty((STACK, COLUMNS)),
        np.empty(drives.COURSE_SHAPE),
        # A component that no step has changed must not be read as if one had.
        np.zeros((2, 3, MOST_COMPONENTS)),
        first_guard,
    )


@kernel
def tabulate_motion(drive, times, table):
    """Fill a table of shape ``(times, numbers)`` with what :func:`ringsweep.physics.drives.turn` returns.

    Of several rows at one time the first one is before a jump at that time, and the others after it.
    """
    for i in range(len(times)):
        rounding = -4e-16 if i == 0 or times[i] > times[i - 1] else 4e-16
        drives.pass_knot(drive, times[i] * (1.0 + rounding))
        motion = drives.turn(drive, times[i])
        for k in range(len(motion)):
            table[i, k] = motion[k]
