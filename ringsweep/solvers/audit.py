"""Whether a run obeys its friction law at instants that the solver did not choose."""

from __future__ import annotations

from math import inf, isfinite, sqrt
from typing import NamedTuple

from ringsweep.compile import hook, inlined
from ringsweep.models.interface import audit as audit_of_model
from ringsweep.models.interface import implicit, series
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
def _audit_series_step(scene, mode, c, t, s, y, y_next, tolerance, audit):
    """Audit after a step of length `s` along the series `c`, from the state `y` at time `t` to the state `y_next`."""
    first = _violation_in_series_step(scene, mode, c, t, s, tolerance, EARLY * s)
    second = _violation_in_series_step(scene, mode, c, t, s, tolerance, LATE * s)
    energy_before, energy_after = (
        audit_of_model.energy(scene, drives.turn(scene.drive, t), y),
        audit_of_model.energy(scene, drives.turn(scene.drive, t + s), y_next),
    )
    return _audit_after(audit, first, second, energy_before, energy_after, s)


@inlined
def _violation_in_series_step(scene, mode, c, t, s, tolerance, s_check):
    state, rates = series.state_at(scene, c, s_check), series.rates_at(scene, c, s_check)
    return audit_of_model.violation(scene, mode, drives.turn(scene.drive, t + s_check), state, rates, s, tolerance)


@inlined
def _audit_implicit_step(scene, mode, t, s, y, y_next, course, bends, tolerance, audit):
    """Audit after an implicit step of length `s` from the state `y` at time `t` to the state `y_next`."""
    before, after = implicit.forcing(scene, course, t), implicit.forcing(scene, course, t + s)
    x, x_next = implicit.to_implicit(scene, before, y), implicit.to_implicit(scene, after, y_next)
    first = _violation_in_implicit_step(scene, mode, t, s, x, x_next, course, bends, tolerance, EARLY)
    second = _violation_in_implicit_step(scene, mode, t, s, x, x_next, course, bends, tolerance, LATE)
    return _audit_after(
        audit, first, second, audit_of_model.energy(scene, before, y), audit_of_model.energy(scene, after, y_next), s
    )


@inlined
def _violation_in_implicit_step(scene, mode, t, s, x, x_next, course, bends, tolerance, fraction):
    forcing = implicit.forcing(scene, course, t + fraction * s)
    state = implicit.from_implicit(scene, forcing, rosenbrock.dense(x, x_next, bends[0], fraction))
    return audit_of_model.violation(
        scene, mode, forcing, state, rosenbrock.dense_rates(x, x_next, bends[0], fraction, s), s, tolerance
    )


@inlined
def _fall_rate_in_implicit_step(scene, mode, t, s, y, y_next, course, bends, guard):
    """Rate at which a guard falls at the end of an implicit step, in its unit per second."""
    before, late = implicit.forcing(scene, course, t), implicit.forcing(scene, course, t + 0.9 * s)
    x, x_next = (
        implicit.to_implicit(scene, before, y),
        implicit.to_implicit(scene, implicit.forcing(scene, course, t + s), y_next),
    )
    state = rosenbrock.dense(x, x_next, bends[0], 0.9)
    view = implicit.guards_and_motion(scene, mode, implicit.common(scene, mode, before, x), late, state)
    return view[0][guard] / (0.1 * s)


@hook
def audit_step(family, scene, mode, is_implicit, c, t, s, y, y_next, course, bends, tolerance, audit):
    """Audit after a step.

    Parameters
    ----------
    family : SetValued, Smooth or Dynamic
        Family of the friction law.
    scene, mode : NamedTuple
    is_implicit : bool
        Whether the step is implicit.
    c : ndarray of shape ``(rows, columns)``
        Table of the series, if the step is not implicit.
    t, s : float
        Time at the beginning of the step, and length of the step, s.
    y, y_next : tuple of float
        States at both ends of the step.
    course, bends : ndarray
        As in :func:`ringsweep.solvers.creep.implicit_step`, if the step is implicit.
    tolerance : float
        Tolerance of the series.
    audit : Audit
        Audit at the beginning of the step.

    Returns
    -------
    Audit
    """


@audit_step.implements(SetValued)
def _audit_by_series(family, scene, mode, is_implicit, c, t, s, y, y_next, course, bends, tolerance, audit):
    return _audit_series_step(scene, mode, c, t, s, y, y_next, tolerance, audit)


@audit_step.implements(Smooth)
def _audit_by_either(family, scene, mode, is_implicit, c, t, s, y, y_next, course, bends, tolerance, audit):
    if is_implicit:
        return _audit_implicit_step(scene, mode, t, s, y, y_next, course, bends, tolerance, audit)
    return _audit_series_step(scene, mode, c, t, s, y, y_next, tolerance, audit)


@audit_step.implements(Dynamic)
def _audit_by_implicit(family, scene, mode, is_implicit, c, t, s, y, y_next, course, bends, tolerance, audit):
    return _audit_implicit_step(scene, mode, t, s, y, y_next, course, bends, tolerance, audit)


@hook
def fall_rate(family, scene, mode, is_implicit, c, t, s, y, y_next, course, bends, guard, first_guard):
    """Rate at which a guard falls at the end of a step that it ended, in its unit per second.

    `guard` is the row of the guard, `first_guard` the row of the first guard. Other arguments are as in
    :func:`audit_step`.
    """


@fall_rate.implements(SetValued)
def _fall_rate_by_series(family, scene, mode, is_implicit, c, t, s, y, y_next, course, bends, guard, first_guard):
    return -slope(c[guard], s)


@fall_rate.implements(Smooth)
def _fall_rate_by_either(family, scene, mode, is_implicit, c, t, s, y, y_next, course, bends, guard, first_guard):
    if is_implicit:
        return _fall_rate_in_implicit_step(scene, mode, t, s, y, y_next, course, bends, guard - first_guard)
    return -slope(c[guard], s)


@fall_rate.implements(Dynamic)
def _fall_rate_by_implicit(family, scene, mode, is_implicit, c, t, s, y, y_next, course, bends, guard, first_guard):
    return _fall_rate_in_implicit_step(scene, mode, t, s, y, y_next, course, bends, guard - first_guard)
