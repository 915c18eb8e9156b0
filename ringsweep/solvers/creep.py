"""One implicit step, up to the first guard that vanishes, in a mode that relaxes much faster than it moves."""

from __future__ import annotations

from math import inf, isfinite
from typing import NamedTuple

import numpy as np

from ringsweep.compile import inlined
from ringsweep.models.interface import implicit, modes, recorder
from ringsweep.numerics.series import ORDER, ascending, first_root, value
from ringsweep.solvers import rosenbrock

# Parts into which a step is divided to look for roots of the guards.
INSTANTS = 4

# Matrix that turns the values at the ends of these parts into the coefficients of a polynomial.
_INTERPOLATION = np.ascontiguousarray(np.linalg.inv(np.vander(np.linspace(0.0, 1.0, INSTANTS + 1), increasing=True)))

# Largest number of guards of an implicit step.
MOST_GUARDS = 6

# Factor by which the relative error of the acceleration on bristles may exceed the relative error of the state.
_ACCELERATION_FACTOR = 100.0


@inlined
def _guard_after(scene, mode, t, x, linear, h, g, stages):
    """Value of guard `g` after a step of length `h`."""
    x_next, _ = rosenbrock.step(scene, mode, t, x, linear, h, stages)
    return implicit.guards_and_motion(scene, mode, t + h, x_next)[0][g]


@inlined
def _locate(scene, mode, t, x, linear, h, f_high, g, stages):
    """Length of the step after which guard `g` is zero.

    After a step of length `h` the guard is `f_high`, which is not positive. Each value of the guard comes from a step
    of the method, not from dense output.
    """
    low, high = 0.0, h
    f_low = implicit.guards_and_motion(scene, mode, t, x)[0][g]
    if f_low <= 0.0:
        # The guard is zero at the beginning: find a step after which it is positive, if there is one.
        s = h
        for _ in range(80):
            s *= 0.5
            f_low = _guard_after(scene, mode, t, x, linear, s, g, stages)
            if f_low > 0.0:
                low = s
                break
            high, f_high = s, f_low
        if low == 0.0:
            return 0.0
    for _ in range(60):
        s = (low * f_high - high * f_low) / (f_high - f_low)
        if not (low < s < high):
            s = 0.5 * (low + high)
        f = _guard_after(scene, mode, t, x, linear, s, g, stages)
        if f > 0.0:
            # Illinois algorithm: halve the value at the end of the bracket that does not move.
            low, f_low = s, f
            f_high *= 0.5
        else:
            high, f_high = s, f
            f_low *= 0.5
        if high - low <= 1e-14 * h or high - low <= 2e-16 * t:
            break
    return high


@inlined
def _error_norm(error, scales, linear):
    """Norm of an error: largest component of the state or of the acceleration on bristles, in units of its scale.

    Infinite if a component is not a number.
    """
    _, core, bristles, _ = linear
    # Stiff bristles turn a small error of the velocity into a large error of the force.
    norm = rosenbrock.acceleration_error(bristles, core, error, scales) / _ACCELERATION_FACTOR
    if not norm >= 0.0:
        norm = inf
    for k in range(len(error)):
        component = abs(error[k]) / scales[k]
        if not component <= norm:
            norm = component if component >= 0.0 else inf
    return norm


@inlined
def _may_vanish(near_zero, first, middle, last):
    """Whether a guard may vanish within a step, from its values at the beginning, in the middle and at the end."""
    # The parabola through the three values dips below the lowest by less than an eighth of their second difference.
    return not min(first, min(middle, last)) >= near_zero + 0.5 * abs(first - 2.0 * middle + last)


@inlined
def _first_event(scene, mode, t, x, x_next, linear, s, before, within, after, stages, samples, work):
    """First guard to fall below zero within an implicit step, and the length of the step up to it; -1 and `s` if none.

    A guard is taken as the polynomial through its values at five instants of the dense output, whose degree is four as
    well. Its first root is isolated like the root of a series, so that no dip between two instants is missed. `before`,
    `within` and `after` are the views at the beginning, in the middle and at the end of the step. `samples` is filled
    with the guards at the five instants.
    """
    early = implicit.guards_and_motion(scene, mode, t + 0.25 * s, rosenbrock.dense(x, x_next, stages, 0.25))
    late = implicit.guards_and_motion(scene, mode, t + 0.75 * s, rosenbrock.dense(x, x_next, stages, 0.75))
    near_zero = implicit.near_zero(scene, within[1])
    for g in range(len(near_zero)):
        samples[g, 0], samples[g, 1], samples[g, 2] = before[0][g], early[0][g], within[0][g]
        samples[g, 3], samples[g, 4] = late[0][g], after[0][g]
    event, h_event = -1, s
    for g in range(len(near_zero)):
        if not _may_vanish(near_zero[g], before[0][g], within[0][g], after[0][g]):
            continue
        h_below = min(h_event, s * _fraction_below_zero(samples[g], work))
        if h_below == 0.0:
            continue
        value_below = _guard_after(scene, mode, t, x, linear, h_below, g, stages)
        # Another guard may vanish first, or the dense output may be below zero by its error alone.
        if value_below > 0.0:
            continue
        found = _locate(scene, mode, t, x, linear, h_below, value_below, g, stages)
        if event < 0 or found < h_event * (1.0 - 1e-12):
            event, h_event = g, found
    return event, h_event


@inlined
def _fraction_below_zero(samples, work):
    """Fraction of a step, soon after the first root of a guard, at which the guard is below zero; 0 if there is none.

    `samples` are the values of the guard. A guard may stay at zero: a body at rest in equilibrium does not move.
    """
    first = 1
    while first <= INSTANTS and samples[first] >= 0.0:
        first += 1
    end = first / INSTANTS if first <= INSTANTS else 0.0
    if samples[0] <= 0.0:
        return end
    row = work[0]
    for k in range(ORDER + 1):
        row[k] = 0.0
        if k <= INSTANTS:
            for i in range(INSTANTS + 1):
                row[k] += _INTERPOLATION[k, i] * samples[i]
    root, found = first_root(row, 1.0, work[1:])
    if not found or (end > 0.0 and root > end - 1.0 / INSTANTS):
        return end
    # The guard dips below zero between two instants: take the bottom of the dip.
    lowest, bottom = 0.0, 0.0
    for i in range(1, 33):
        fraction = root + (1.0 / INSTANTS) * i / 32.0
        value_there = value(row, min(fraction, 1.0))
        if value_there < lowest:
            lowest, bottom = value_there, min(fraction, 1.0)
    return bottom if bottom > 0.0 else root


class StepControl(NamedTuple):
    """Control of the length of implicit steps.

    Attributes
    ----------
    h : float
        Length of the next step, s.
    last_h : float
        Length of the last accepted step, s; 0 if there is none.
    last_error : float
        Norm of the error of the last accepted step.
    """

    h: float
    last_h: float
    last_error: float


@inlined
def _next_control(control, s, error, shortened, rejected):
    """Control after a step of length `s` with the norm `error` of its error.

    `shortened` is whether the span or a knot of the drive shortened the step, `rejected` whether a longer step was
    rejected before.
    """
    error = max(error, 1e-8)
    # After a rejected step the length does not grow.
    h = s * min(1.0 if rejected else 6.0, 0.9 * error**-0.2)
    # Towards the end of a creep, steps shorten at a steady rate, which the last step shows (Gustafsson).
    if control.last_h > 0.0:
        h = min(h, s * 0.9 * s / control.last_h * (control.last_error / (error * error)) ** 0.2)
    # A shortened step says little about the next one.
    return StepControl(max(control.h, h), control.last_h, control.last_error) if shortened else StepControl(h, s, error)


@inlined
def implicit_step(scene, record, mode, t, y, x, linear, control, h_max, tolerance, first, stages, samples, work):
    """One accepted implicit step, which the first event ends.

    Parameters
    ----------
    scene, record, mode : NamedTuple
    t : float
        Time, s.
    y, x : tuple of float
        State of the mode at time `t`, and the same state for implicit steps.
    linear : tuple
        What :func:`ringsweep.models.interface.implicit.linearise` returned for this state.
    control : StepControl
        Length of the step to try first.
    h_max : float
        Greatest length of the step, s.
    tolerance : float
        Relative error allowed to the step.
    first : int
        Index of the first guard.
    stages : ndarray of shape ``(STAGES, components)``
        Filled with the stages of the step.
    samples : ndarray of shape ``(MOST_GUARDS, INSTANTS + 1)``
        Scratch.
    work : ndarray of shape ``(STACK, columns)``
        Scratch.

    Returns
    -------
    tuple
        The guard that ended the step, or -1; length of the step, s, negative if no step was accepted; state, record and
        control after it.
    """
    scales = implicit.error_scales(scene, tolerance, x)
    s = min(control.h, h_max)
    event, h_taken, near = -1, s, False
    before = implicit.guards_and_motion(scene, mode, t, x)
    middle, after = before, before
    for _ in range(200):
        x_next, error = rosenbrock.step(scene, mode, t, x, linear, s, stages)
        error_norm = _error_norm(error, scales, linear)
        if error_norm <= 1.0:
            middle = implicit.guards_and_motion(scene, mode, t + 0.5 * s, rosenbrock.dense(x, x_next, stages, 0.5))
            after = implicit.guards_and_motion(scene, mode, t + s, x_next)
            event, h_taken = -1, s
            near, near_zero = False, implicit.near_zero(scene, middle[1])
            for g in range(len(near_zero)):
                near = near or _may_vanish(near_zero[g], before[0][g], middle[0][g], after[0][g])
            if near:
                event, h_taken = _first_event(
                    scene, mode, t, x, x_next, linear, s, before, middle, after, stages, samples, work
                )
                if event < 0:
                    rosenbrock.step(scene, mode, t, x, linear, s, stages)
            if event < 0 or h_taken == 0.0:
                break
            near = False
            # The shorter step, up to the event, has stages of its own and may have a larger error.
            x_next, error = rosenbrock.step(scene, mode, t, x, linear, h_taken, stages)
            event_error_norm = _error_norm(error, scales, linear)
            if event_error_norm <= 1.0:
                break
            s, error_norm = h_taken, event_error_norm
        s *= max(0.2, 0.9 * error_norm**-0.2) if isfinite(error_norm) else 0.1
    else:
        return -1, -1.0, y, record, control
    control = _next_control(control, s, error_norm, s == h_max, s < min(control.h, h_max))
    if event >= 0:
        if h_taken == 0.0:
            return first + event, 0.0, y, record, control
        event += first
        middle = implicit.guards_and_motion(scene, mode, t + 0.5 * h_taken, rosenbrock.dense(x, x_next, stages, 0.5))
        after = implicit.guards_and_motion(scene, mode, t + h_taken, x_next)
    fractions, count = work[0], 0
    velocity, acceleration = implicit.motion(scene, t, x, linear)
    for start, view_after in ((0.0, middle), (0.5, after)):
        # Where velocity or acceleration change sign, place or velocity have an extreme: the recorder must look there.
        if velocity * view_after[1][1] < 0.0:
            fractions[count] = _sign_change(scene, mode, t, x, x_next, h_taken, stages, start, 1, velocity)
            count += 1
        if acceleration * view_after[1][2] < 0.0:
            fractions[count] = _sign_change(scene, mode, t, x, x_next, h_taken, stages, start, 2, acceleration)
            count += 1
        velocity, acceleration = view_after[1][1], view_after[1][2]
    if near:
        for i in range(1, INSTANTS):
            fractions[count] = i / INSTANTS
            count += 1
    else:
        fractions[count] = 0.5
        count += 1
    ascending(fractions, count)
    fraction_before, stuck = 0.0, modes.sticks(scene, mode)
    for j in range(count):
        view = middle
        if fractions[j] != 0.5:
            view = implicit.guards_and_motion(
                scene, mode, t + fractions[j] * h_taken, rosenbrock.dense(x, x_next, stages, fractions[j])
            )
        duration = (fractions[j] - fraction_before) * h_taken
        record = recorder.observe(
            scene, record, t + fractions[j] * h_taken, duration, stuck, implicit.seen(scene, view)
        )
        fraction_before = fractions[j]
    record = recorder.observe(
        scene, record, t + h_taken, (1.0 - fraction_before) * h_taken, stuck, implicit.seen(scene, after)
    )
    return event, h_taken, implicit.from_implicit(scene, implicit.forcing(scene, t + h_taken), x_next), record, control


@inlined
def _sign_change(scene, mode, t, x, x_next, h, stages, start, component, start_value):
    """Fraction of a step at which velocity (component 1) or acceleration (component 2) of the body change sign.

    The sign changes in the half step that begins at the fraction `start`, where the component is `start_value`.
    """
    low, high = start, start + 0.5
    for _ in range(40):
        middle = 0.5 * (low + high)
        view = implicit.guards_and_motion(scene, mode, t + middle * h, rosenbrock.dense(x, x_next, stages, middle))
        if view[1][component] * start_value > 0.0:
            low = middle
        else:
            high = middle
    return 0.5 * (low + high)
