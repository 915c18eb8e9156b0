"""Whether a run obeys its law at instants that the solver did not choose."""

from __future__ import annotations

from math import inf, isfinite, sqrt
from typing import NamedTuple

from ringsweep.compile import hook, inlined
from ringsweep.models.interface import audit as law
from ringsweep.models.interface import implicit, series
from ringsweep.numerics.series import slope
from ringsweep.physics.friction import Dynamic, SetValued, Smooth
from ringsweep.solvers import rosenbrock


class Audit(NamedTuple):
    """What a run has shown of its law at instants that the solver did not choose.

    ``violation`` is the largest violation, measured by what the tolerance of a step makes of it; ``unexplained`` what
    of
    the changes of the mechanical energy is not work of friction, J; ``turnover`` the sum of the magnitudes of both.
    """

    violation: float
    unexplained: float
    turnover: float


# Fractions of a step at which the law is checked: Gauss's, which make a quadrature of the work of friction as well.
_EARLY, _LATE = 0.5 - 0.5 / sqrt(3.0), 0.5 + 0.5 / sqrt(3.0)


# Share of the energy itself that counts as turned over in a step: without friction what it loses is rounding.
_STORED = 1e-5


# The law is checked in so many steps at first, then in this share of them, which no period of the motion can evade.
_ALL_CHECKED, _CHECKED = 8, 0.25


@inlined
def is_checked(n):
    """Whether the law is checked in step `n`."""
    return n <= _ALL_CHECKED or (n * 0.6180339887498949) % 1.0 < _CHECKED


@inlined
def _entered(audit, first, second, begins, ends, s):
    """Audit after a step of length `s`, checked at two instants; `begins` and `ends` are energies."""
    (violation_1, power_1), (violation_2, power_2) = first, second
    worst = max(audit.violation, max(violation_1, violation_2))
    work, change = 0.5 * s * (power_1 + power_2), ends - begins
    return Audit(
        worst if isfinite(work) else inf,
        audit.unexplained + (change - work),
        audit.turnover + 0.5 * s * (abs(power_1) + abs(power_2)) + abs(change) + _STORED * (abs(begins) + abs(ends)),
    )


@inlined
def _audit_series(scene, mode, c, t, s, y, y_next, tolerance, audit):
    """Audit after a step of length `s` along the series `c`, from the state `y` at time `t` to the state `y_next`."""
    first = _violation_along(scene, mode, c, t, s, tolerance, _EARLY * s)
    second = _violation_along(scene, mode, c, t, s, tolerance, _LATE * s)
    begins, ends = (
        law.energy(scene, implicit.forcing(scene, t), y),
        law.energy(scene, implicit.forcing(scene, t + s), y_next),
    )
    return _entered(audit, first, second, begins, ends, s)


@inlined
def _violation_along(scene, mode, c, t, s, tolerance, at):
    state, rates = series.state_at(scene, c, at), series.rates_at(scene, c, at)
    return law.violation(scene, mode, implicit.forcing(scene, t + at), state, rates, s, tolerance)


@inlined
def _audit_creep(scene, mode, t, s, y, y_next, stages, tolerance, audit):
    """The same of an implicit step from the state `y` to `y_next`."""
    begin, end = implicit.forcing(scene, t), implicit.forcing(scene, t + s)
    x, x_next = implicit.to_implicit(scene, begin, y), implicit.to_implicit(scene, end, y_next)
    first = _violation_within(scene, mode, t, s, x, x_next, stages, tolerance, _EARLY)
    second = _violation_within(scene, mode, t, s, x, x_next, stages, tolerance, _LATE)
    return _entered(audit, first, second, law.energy(scene, begin, y), law.energy(scene, end, y_next), s)


@inlined
def _violation_within(scene, mode, t, s, x, x_next, stages, tolerance, fraction):
    force = implicit.forcing(scene, t + fraction * s)
    state = implicit.from_implicit(scene, force, rosenbrock.dense(x, x_next, stages, fraction))
    return law.violation(
        scene, mode, force, state, rosenbrock.dense_rates(x, x_next, stages, fraction, s), s, tolerance
    )


@inlined
def _fall_of_creep(scene, mode, t, s, y, y_next, stages, guard):
    """How fast a guard falls as an implicit step ends by it, 1/s times its unit."""
    x, x_next = (
        implicit.to_implicit(scene, implicit.forcing(scene, t), y),
        implicit.to_implicit(scene, implicit.forcing(scene, t + s), y_next),
    )
    late = implicit.guards_and_motion(scene, mode, t + 0.9 * s, rosenbrock.dense(x, x_next, stages, 0.9))
    return late[0][guard] / (0.1 * s)


@hook
def audit_step(family, scene, mode, is_implicit, c, t, s, y, y_next, stages, tolerance, audit):
    """Audit after a step of length `s` from the state `y` at time `t`."""


@audit_step.implements(SetValued)
def _series_audited(family, scene, mode, is_implicit, c, t, s, y, y_next, stages, tolerance, audit):
    return _audit_series(scene, mode, c, t, s, y, y_next, tolerance, audit)


@audit_step.implements(Smooth)
def _either_audited(family, scene, mode, is_implicit, c, t, s, y, y_next, stages, tolerance, audit):
    if is_implicit:
        return _audit_creep(scene, mode, t, s, y, y_next, stages, tolerance, audit)
    return _audit_series(scene, mode, c, t, s, y, y_next, tolerance, audit)


@audit_step.implements(Dynamic)
def _implicit_audited(family, scene, mode, is_implicit, c, t, s, y, y_next, stages, tolerance, audit):
    return _audit_creep(scene, mode, t, s, y, y_next, stages, tolerance, audit)


@hook
def fall_rate(family, scene, mode, is_implicit, c, t, s, y, y_next, stages, guard, first):
    """How fast a guard falls as a step ends by it; `first` is the first guard."""


@fall_rate.implements(SetValued)
def _series_fall(family, scene, mode, is_implicit, c, t, s, y, y_next, stages, guard, first):
    return -slope(c[guard], s)


@fall_rate.implements(Smooth)
def _either_fall(family, scene, mode, is_implicit, c, t, s, y, y_next, stages, guard, first):
    if is_implicit:
        return _fall_of_creep(scene, mode, t, s, y, y_next, stages, guard - first)
    return -slope(c[guard], s)


@fall_rate.implements(Dynamic)
def _implicit_fall(family, scene, mode, is_implicit, c, t, s, y, y_next, stages, guard, first):
    return _fall_of_creep(scene, mode, t, s, y, y_next, stages, guard - first)
