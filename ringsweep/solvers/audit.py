"""Whether a run obeys its friction law at instants that the solver did not choose.

Only the solvers that locate events call it, after each step. `fraction` is a place within the step, from 0 to 1.
Functions with the endings ``_in_series`` and ``_in_implicit_step`` are two forms of one, see
:func:`ringsweep.solvers.steps.either`.
"""

from __future__ import annotations

from math import inf, isfinite, sqrt
from typing import NamedTuple

from ringsweep.compile import inlined
from ringsweep.models.interface import audit as audit_of_model
from ringsweep.models.interface import implicit, series
from ringsweep.numerics.clock import later
from ringsweep.numerics.series import slope
from ringsweep.physics import drives
from ringsweep.solvers import rosenbrock
from ringsweep.solvers.steps import either


class Audit(NamedTuple):
    """Audit of a run at instants that the solver did not choose.

    Attributes
    ----------
    violation : float
        Largest violation of the friction law, in units of the violation that the tolerance would explain.
    unexplained : float
        Change of the mechanical energy that is not work of friction, J.
    turnover : float
        Sum of the magnitudes of the changes of the energy and of the work of friction, J.
    """

    violation: float
    unexplained: float
    turnover: float


# Fractions of a step at which the law is checked: the nodes of Gauss's rule, which integrates the work of friction too.
EARLY, LATE = 0.5 - 0.5 / sqrt(3.0), 0.5 + 0.5 / sqrt(3.0)

# Three more nodes and their weights, and that of the two, after Kronrod; for a step of which two nodes leave this share
# of the turnover unexplained, such as a short slip, from rest to rest in one step.
_FAR = 0.5 * sqrt(6.0 / 7.0)
_MORE = ((0.5 - _FAR, 49.0 / 495.0), (0.5, 14.0 / 45.0), (0.5 + _FAR, 49.0 / 495.0))
_WEIGHT, _NEARLY = 27.0 / 110.0, 1e-4

# Share of the energy itself that counts as turnover in a step. Without friction the energy changes by rounding alone.
_ENERGY_SHARE = 1e-5

# The law is checked in each of the first steps, then in this share of the steps. The golden ratio selects them, so that
# no period of the motion can avoid the checks.
_ALL_CHECKED, _CHECKED_SHARE = 8, 0.25


@inlined
def is_checked(n):
    """Whether the audit looks at step number `n` of a run: at all first steps, and at a share of the others."""
    return n <= _ALL_CHECKED or (n * 0.6180339887498949) % 1.0 < _CHECKED_SHARE


@inlined
def _ends(scene, step, scratch):
    """``((forcing, x), (forcing, x))`` at the beginning and at the end of an implicit step."""
    before = drives.turn_near(scene.drive, scratch.course, step.now, 0.0)
    after = drives.turn_near(scene.drive, scratch.course, step.now, step.s)
    return (before, implicit.to_implicit(scene, before, step.y)), (
        after,
        implicit.to_implicit(scene, after, step.y_next),
    )


def _violation_in_series(family, scene, step, scratch, tolerance, fraction):
    """Violation of the friction law and power of friction at a fraction of a step, from the dense output."""
    s = fraction * step.s
    forcing, state = drives.turn(scene.drive, later(step.now, s)), series.state_at(scene, scratch.c, s)
    rates = series.rates_at(scene, scratch.c, s)
    return audit_of_model.violation(scene, step.mode, forcing, state, rates, step.s, tolerance)


def _violation_in_implicit_step(family, scene, step, scratch, tolerance, fraction):
    """Violation and power at a fraction of an implicit step, from its dense output."""
    (_, x), (_, x_next) = _ends(scene, step, scratch)
    forcing, bends = drives.turn_near(scene.drive, scratch.course, step.now, fraction * step.s), scratch.bends[0]
    state = implicit.from_implicit(scene, forcing, rosenbrock.dense(x, x_next, bends, fraction))
    rates = rosenbrock.dense_rates(x, x_next, bends, fraction, step.s)
    return audit_of_model.violation(scene, step.mode, forcing, state, rates, step.s, tolerance)


_violation = either(_violation_in_series, _violation_in_implicit_step)


@inlined
def audit_step(family, scene, step, scratch, tolerance, audit):
    """Audit after a step.

    Parameters
    ----------
    family : SetValued, Smooth or Dynamic
        Family of the friction law.
    scene : NamedTuple
    step : Step
    scratch : Scratch
        As the step left it.
    tolerance : float
        Tolerance of the series.
    audit : Audit
        Audit at the beginning of the step.

    Returns
    -------
    Audit
    """
    violation_1, power_1 = _violation(family, scene, step, scratch, tolerance, EARLY)
    violation_2, power_2 = _violation(family, scene, step, scratch, tolerance, LATE)
    before = audit_of_model.energy_of(scene, drives.turn(scene.drive, step.now), step.y)
    after = audit_of_model.energy_of(scene, drives.turn(scene.drive, later(step.now, step.s)), step.y_next)
    work, change = 0.5 * step.s * (power_1 + power_2), after - before
    moved = 0.5 * step.s * (abs(power_1) + abs(power_2)) + abs(change)
    if abs(change - work) > _NEARLY * moved:
        power = 0.0
        for fraction, weight in _MORE:
            power += weight * _violation(family, scene, step, scratch, tolerance, fraction)[1]
        work = step.s * (power + _WEIGHT * (power_1 + power_2))
    violation = max(audit.violation, max(violation_1, violation_2))
    return Audit(
        violation if isfinite(work) else inf,
        audit.unexplained + (change - work),
        audit.turnover + moved + _ENERGY_SHARE * (abs(before) + abs(after)),
    )


def _fall_rate_in_series(family, scene, step, scratch, guard):
    """Rate at which a guard, a row of the table, falls at the end of a step that it ended, in its unit per second."""
    return -slope(scratch.c[guard], step.s)


def _fall_rate_in_implicit_step(family, scene, step, scratch, guard):
    """Mean rate at which a guard fell in the last tenth of an implicit step."""
    (before, x), (_, x_next) = _ends(scene, step, scratch)
    late = drives.turn_near(scene.drive, scratch.course, step.now, 0.9 * step.s)
    state = rosenbrock.dense(x, x_next, scratch.bends[0], 0.9)
    view = implicit.guards_and_motion(scene, step.mode, implicit.common(scene, step.mode, before, x), late, state)
    return view[0][guard - scratch.first_guard] / (0.1 * step.s)


fall_rate = either(_fall_rate_in_series, _fall_rate_in_implicit_step)
