"""Whether a run obeys its friction law at instants that the solver did not choose."""

from __future__ import annotations

from math import inf, isfinite, sqrt
from typing import NamedTuple

from ringsweep.compile import hook, inlined
from ringsweep.models.interface import audit as audit_of_model
from ringsweep.models.interface import implicit, series
from ringsweep.numerics.clock import later
from ringsweep.numerics.series import slope
from ringsweep.physics import drives
from ringsweep.physics.friction import Dynamic, SetValued, Smooth
from ringsweep.solvers import rosenbrock


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

# Share of the energy itself that counts as turnover in a step. Without friction the energy changes by rounding alone.
_ENERGY_SHARE = 1e-5

# The law is checked in each of the first steps, then in this share of the steps. The golden ratio selects them, so that
# no period of the motion can avoid the checks.
_ALL_CHECKED, _CHECKED_SHARE = 8, 0.25


@inlined
def is_checked(n):
    """Whether the law is checked in step `n`."""
    return n <= _ALL_CHECKED or (n * 0.6180339887498949) % 1.0 < _CHECKED_SHARE


@inlined
def _audit_after(audit, first, second, energy_before, energy_after, s):
    """Audit after a step of length `s`.

    `first` and `second` are violation and power of friction at the two instants; the energies are those at both ends.
    """
    (violation_1, power_1), (violation_2, power_2) = first, second
    violation = max(audit.violation, max(violation_1, violation_2))
    work, change = 0.5 * s * (power_1 + power_2), energy_after - energy_before
    return Audit(
        violation if isfinite(work) else inf,
        audit.unexplained + (change - work),
        audit.turnover
        + 0.5 * s * (abs(power_1) + abs(power_2))
        + abs(change)
        + _ENERGY_SHARE * (abs(energy_before) + abs(energy_after)),
    )


@inlined
def _audit_series_step(scene, step, c, tolerance, audit):
    """Audit after a step along the series `c`."""
    first = _violation_in_series_step(scene, step, c, tolerance, EARLY * step.s)
    second = _violation_in_series_step(scene, step, c, tolerance, LATE * step.s)
    energy_before, energy_after = (
        audit_of_model.energy(scene, drives.turn(scene.drive, step.now), step.y),
        audit_of_model.energy(scene, drives.turn(scene.drive, later(step.now, step.s)), step.y_next),
    )
    return _audit_after(audit, first, second, energy_before, energy_after, step.s)


@inlined
def _violation_in_series_step(scene, step, c, tolerance, s):
    state, rates, forcing = (
        series.state_at(scene, c, s),
        series.rates_at(scene, c, s),
        drives.turn(scene.drive, later(step.now, s)),
    )
    return audit_of_model.violation(scene, step.mode, forcing, state, rates, step.s, tolerance)


@inlined
def _ends(scene, step, course):
    """Forcing and state for implicit steps at both ends of a step."""
    before, after = implicit.forcing(scene, course, step.now, 0.0), implicit.forcing(scene, course, step.now, step.s)
    x, x_next = implicit.to_implicit(scene, before, step.y), implicit.to_implicit(scene, after, step.y_next)
    return (before, x), (after, x_next)


@inlined
def _audit_implicit_step(scene, step, scratch, tolerance, audit):
    """Audit after an implicit step."""
    (before, x), (after, x_next) = _ends(scene, step, scratch.course)
    first = _violation_in_implicit_step(scene, step, scratch, (x, x_next), tolerance, EARLY)
    second = _violation_in_implicit_step(scene, step, scratch, (x, x_next), tolerance, LATE)
    energy_before, energy_after = (
        audit_of_model.energy(scene, before, step.y),
        audit_of_model.energy(scene, after, step.y_next),
    )
    return _audit_after(audit, first, second, energy_before, energy_after, step.s)


@inlined
def _violation_in_implicit_step(scene, step, scratch, ends, tolerance, fraction):
    (x, x_next), bends = ends, scratch.bends[0]
    forcing = implicit.forcing(scene, scratch.course, step.now, fraction * step.s)
    state = implicit.from_implicit(scene, forcing, rosenbrock.dense(x, x_next, bends, fraction))
    rates = rosenbrock.dense_rates(x, x_next, bends, fraction, step.s)
    return audit_of_model.violation(scene, step.mode, forcing, state, rates, step.s, tolerance)


@inlined
def _fall_rate_in_implicit_step(scene, step, scratch, guard):
    (before, x), (_, x_next) = _ends(scene, step, scratch.course)
    late = implicit.forcing(scene, scratch.course, step.now, 0.9 * step.s)
    state = rosenbrock.dense(x, x_next, scratch.bends[0], 0.9)
    view = implicit.guards_and_motion(scene, step.mode, implicit.common(scene, step.mode, before, x), late, state)
    return view[0][guard - scratch.first_guard] / (0.1 * step.s)


@hook
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


@audit_step.implements(SetValued)
def _audit_by_series(family, scene, step, scratch, tolerance, audit):
    return _audit_series_step(scene, step, scratch.c, tolerance, audit)


@audit_step.implements(Smooth)
def _audit_by_either(family, scene, step, scratch, tolerance, audit):
    if step.is_implicit:
        return _audit_implicit_step(scene, step, scratch, tolerance, audit)
    return _audit_series_step(scene, step, scratch.c, tolerance, audit)


@audit_step.implements(Dynamic)
def _audit_by_implicit(family, scene, step, scratch, tolerance, audit):
    return _audit_implicit_step(scene, step, scratch, tolerance, audit)


@hook
def fall_rate(family, scene, step, scratch, guard):
    """Rate at which a guard falls at the end of a step that it ended, in its unit per second.

    `guard` is the row of the guard. Other arguments are as in :func:`audit_step`.
    """


@fall_rate.implements(SetValued)
def _fall_rate_by_series(family, scene, step, scratch, guard):
    return -slope(scratch.c[guard], step.s)


@fall_rate.implements(Smooth)
def _fall_rate_by_either(family, scene, step, scratch, guard):
    if step.is_implicit:
        return _fall_rate_in_implicit_step(scene, step, scratch, guard)
    return -slope(scratch.c[guard], step.s)


@fall_rate.implements(Dynamic)
def _fall_rate_by_implicit(family, scene, step, scratch, guard):
    return _fall_rate_in_implicit_step(scene, step, scratch, guard)
