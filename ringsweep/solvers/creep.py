"""One implicit step, up to the first guard that vanishes, in a mode that relaxes much faster than it moves.

Read :mod:`ringsweep.models.interface.implicit` first: `x`, `forcing`, and *views*, which are ``(guards, motion)``.
``scratch.bends[0]`` holds the dense output of the step that was taken; ``scratch.bends[1]`` may be overwritten. `g`
is the index of a guard, `s` and `h` are lengths of steps, s.
"""

from __future__ import annotations

from math import inf
from typing import Any, NamedTuple

import numpy as np

from ringsweep.compile import inlined
from ringsweep.models.interface import implicit, modes, recorder, variation
from ringsweep.numerics.clock import Instant, later
from ringsweep.numerics.series import ORDER, ascending, crossings, differentiate
from ringsweep.physics import drives
from ringsweep.solvers import rosenbrock
from ringsweep.solvers.steps import FACTOR
from ringsweep.solvers.variation import along_implicit, enter_implicit

# Parts into which a step is divided to look for roots of the guards, and for extremes.
INSTANTS = 4

# Matrix that turns the values at the ends of these parts into the coefficients of a polynomial.
_INTERPOLATION = np.ascontiguousarray(np.linalg.inv(np.vander(np.linspace(0.0, 1.0, INSTANTS + 1), increasing=True)))

# Factor by which the relative error of the acceleration on bristles may exceed the relative error of the state.
_ACCELERATION_FACTOR = 100.0


# A polynomial through five instants of a step is too coarse to find an extreme of a quantity if it errs there by this
# share of the change of the quantity. Then the extreme is found to this fraction of the step, by so many trials. And if
# the dense output itself errs by that share of the quantity: from values at this fraction of the step beside it.
_COARSE, _NEAR, _MOST_TRIALS, _BESIDE = 1e-4, 1e-6, 40, 0.02

# Error of the dense output at an extreme, as a share of what the extreme exceeds the ends of the step by.
_DENSE_ERROR = 0.01


class Start(NamedTuple):
    """The beginning of an implicit step.

    Attributes
    ----------
    mode : NamedTuple
    now : Instant
        Time, s.
    y, x : tuple of float
        State of the mode, and the same state for implicit steps.
    forcing, common, linear : tuple
        Forcing at this time; what :func:`ringsweep.models.interface.implicit.common` and
        :func:`ringsweep.models.interface.implicit.linearise` returned for this state.
    """

    mode: Any
    now: Instant
    y: Any
    x: Any
    forcing: Any
    common: Any
    linear: Any


class Taken(NamedTuple):
    """An implicit step from a start: its length, s, and the state at its end."""

    h: float
    x_next: Any


@inlined
def start_at(scene, course, mode, now, y):
    """Beginning of an implicit step in the state `y` of a mode at an instant."""
    forcing = drives.turn_near(scene.drive, course, now, 0.0)
    x = implicit.to_implicit(scene, forcing, y)
    common = implicit.common(scene, mode, forcing, x)
    return Start(mode, now, y, x, forcing, common, implicit.linearise(scene, mode, common, now, forcing, x))


@inlined
def _view_within(scene, start, scratch, taken, fraction):
    """View of the dense output at a fraction of a step."""
    x = rosenbrock.dense(start.x, taken.x_next, scratch.bends[0], fraction)
    forcing = drives.turn_near(scene.drive, scratch.course, start.now, fraction * taken.h)
    return implicit.guards_and_motion(scene, start.mode, start.common, forcing, x)


@inlined
def _step_of_method(scene, start, course, h, end, bends):
    """``(x, error)`` after a step of :func:`rosenbrock.step` of length `h`, s; `end` is the forcing at its end."""
    now = start.now
    first, second, third, fourth, _ = rosenbrock.STAGE_TIMES
    forcings = (
        drives.turn_near(scene.drive, course, now, first * h),
        drives.turn_near(scene.drive, course, now, second * h),
        drives.turn_near(scene.drive, course, now, third * h),
        drives.turn_near(scene.drive, course, now, fourth * h),
        end,
    )
    return rosenbrock.step(start.x, scene, start, h, forcings, bends)


@inlined
def _guard_after(scene, start, scratch, h, g):
    """Value of guard `g` after a step of the method of length `h`, s."""
    end = drives.turn_near(scene.drive, scratch.course, start.now, h)
    x_next, _ = _step_of_method(scene, start, scratch.course, h, end, scratch.bends[1])
    return implicit.guards_and_motion(scene, start.mode, start.common, end, x_next)[0][g]


@inlined
def _locate(scene, start, scratch, h, ends, g, guess):
    """Length of the step after which guard `g` is zero.

    `ends` are the values of the guard before the step and after a step of length `h`; the second one is not positive.
    `guess` is the length of the step by the dense output, or zero if it does not tell. Each value of the guard comes
    from a step of the method, not from dense output.
    """
    (f_low, f_high), low, high = ends, 0.0, h
    if f_low <= 0.0:
        # The guard is zero at the beginning: find a step after which it is positive, or still zero, if there is one. A
        # body at rest may stay there before it begins to move.
        s = h
        for _ in range(80):
            s *= 0.5
            f_low = _guard_after(scene, start, scratch, s, g)
            if f_low >= 0.0:
                low = s
                break
            high, f_high = s, f_low
        if low == 0.0:
            return 0.0
    # Chandrupatla's method: a parabola through the last three points where it is safe, else bisection.
    near, f_near, far, f_far, before, f_before = high, f_high, low, f_low, high, f_high
    share = (near - guess) / (near - far) if far < guess < near else f_near / (f_near - f_far)
    for _ in range(100):
        s = near + share * (far - near)
        f = _guard_after(scene, start, scratch, s, g)
        if (f > 0.0) == (f_near > 0.0):
            before, f_before = near, f_near
        else:
            before, f_before, far, f_far = far, f_far, near, f_near
        near, f_near = s, f
        width = abs(far - near)
        least = 0.5e-14 * h
        if width <= 2.0 * least:
            break
        place, height = (near - far) / (before - far), (f_near - f_far) / (f_before - f_far)
        share = 0.5
        if height * height < place and (1.0 - height) * (1.0 - height) < 1.0 - place:
            share = f_near / (f_far - f_near) * f_before / (f_far - f_before) + (
                (before - near) / (far - near) * f_near / (f_before - f_near) * f_far / (f_before - f_far)
            )
        share = min(max(share, least / width), 1.0 - least / width)
    return far if f_near > 0.0 else near


@inlined
def _error_norm(error, scales, linear):
    """Norm of an error: largest component of the state or of the acceleration on bristles, in units of its scale.

    Infinite if a component is not a number.
    """
    # Stiff bristles turn a small error of the velocity into a large error of the force.
    norm = rosenbrock.acceleration_error(error, linear[1]) / (_ACCELERATION_FACTOR * scales[len(error)])
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
def _first_event_by_samples(scene, start, scratch, taken, views):
    """First guard to fall below zero within an implicit step, and the length of the step up to it.

    If none does: -1, and the length of the whole step.

    A guard is taken as the polynomial through its values at five instants of the dense output, whose degree is four as
    well. Its first root is isolated like the root of a series, so that no dip between two instants is missed.

    `views` are those at the beginning, in the middle and at the end of the step.
    """
    (before, within, after), s = views, taken.h
    near_zero = implicit.near_zero(scene, within[1])
    early = _view_within(scene, start, scratch, taken, 0.25)
    late = _view_within(scene, start, scratch, taken, 0.75)
    event, h_event = -1, s
    for g in range(len(near_zero)):
        if not _may_vanish(near_zero[g], before[0][g], within[0][g], after[0][g]):
            continue
        samples = before[0][g], early[0][g], within[0][g], late[0][g], after[0][g]
        root, below = _root_and_below(samples, scratch.work)
        h_below = min(h_event, s * below)
        if h_below == 0.0:
            continue
        value_below = after[0][g] if h_below == s else _guard_after(scene, start, scratch, h_below, g)
        if value_below > 0.0 > after[0][g]:
            # The polynomial has cut a corner of the guard, which vanishes later.
            h_below, value_below = s, after[0][g]
        # Another guard may vanish first, or the dense output may be below zero by its error alone. A body at rest stays
        # at zero.
        if value_below > 0.0 or value_below == before[0][g] == 0.0:
            continue
        ends = before[0][g], value_below
        found = _locate(scene, start, scratch, h_below, ends, g, s * root)
        if event < 0 or found < h_event * (1.0 - 1e-12):
            event, h_event = g, found
    return event, h_event


@inlined
def _coarseness(scene, start, scratch, taken, views, g):
    """Error of the polynomial through five instants of a step that :func:`_first_event_by_samples` takes for guard `g`.

    `views` are those at the beginning, in the middle and at the end of the step.
    """
    before, middle, after = views
    early = _view_within(scene, start, scratch, taken, 0.25)
    late = _view_within(scene, start, scratch, taken, 0.75)
    row, fraction, value = scratch.work[-1], 0.5 / INSTANTS, 0.0
    _interpolate((before[0][g], early[0][g], middle[0][g], late[0][g], after[0][g]), row)
    for k in range(INSTANTS, -1, -1):
        value = row[k] + fraction * value
    return abs(value - _view_within(scene, start, scratch, taken, fraction)[0][g])


@inlined
def _interpolate(samples, row):
    """Fill `row` with the polynomial, in fractions of the step, through `samples` at its equidistant instants."""
    for k in range(ORDER + 1):
        row[k] = 0.0
        if k <= INSTANTS:
            for i in range(INSTANTS + 1):
                row[k] += _INTERPOLATION[k, i] * samples[i]


@inlined
def _root_and_below(samples, work):
    """Fractions of a step at the first root of a guard, and after it where the guard is below zero; zeros if none.

    `samples` are the values of the guard. A guard may stay at zero: a body at rest in equilibrium does not move. If it
    is zero at the beginning, the first fraction is zero.
    """
    if samples[0] <= 0.0:
        for i in range(1, INSTANTS + 1):
            if samples[i] < 0.0:
                return 0.0, i / INSTANTS
        return 0.0, 0.0
    row, roots = work[-1], work[0]
    _interpolate(samples, row)
    count = crossings(row, 1.0, work[:-1], 0)
    if count == 0:
        return 0.0, 0.0
    ascending(roots, count)
    # Between two roots the guard dips below zero.
    return roots[0], 1.0 if count == 1 else 0.5 * (roots[0] + roots[1])


# Largest factor by which the length of a step grows, and least one by which it shrinks at once; and factor by which a
# run at the looser tolerance of a certificate may take longer steps.
_MOST_GROWTH, _MOST_DECREASE, _LONGER = 30.0, 0.2, FACTOR**0.2


class StepControl(NamedTuple):
    """Control of the length of implicit steps.

    Attributes
    ----------
    h : float
        Length of the next step, s.
    last_h : float
        Length of the last accepted step, s; 0 if there is none.
    last_factor : float
        Factor by which the last accepted step could have been longer.
    shared : bool
        Whether a run at a looser tolerance tries the same length: since the start its growth alone limited its steps.
    """

    h: float
    last_h: float
    last_factor: float
    shared: bool


@inlined
def start_control(h):
    """Control of a first implicit step, of which the length is at most `h`."""
    return StepControl(h, 0.0, 0.0, True)


@inlined
def _next_control(control, s, error, shortened, rejected):
    """Control after a step of length `s` with the norm `error` of its error.

    `shortened` is whether the span or a knot of the drive shortened the step, `rejected` whether a longer step was
    rejected before.
    """
    factor = max(error, 1e-8) ** -0.2
    # After a rejected step the length does not grow.
    h = s * min(1.0 if rejected else _MOST_GROWTH, 0.9 * factor)
    # Towards the end of a creep, steps shorten at a steady rate, which the last step shows (Gustafsson).
    if control.last_h > 0.0:
        # A length that an event has made shorter by decades is no rate.
        rate = s / control.last_h * (factor * factor / control.last_factor)
        h = min(h, s * max(_MOST_DECREASE, 0.9 * rate))
    shared = control.shared and 0.9 * factor * _LONGER >= _MOST_GROWTH
    # A shortened step says little about the next one.
    if shortened:
        return StepControl(max(control.h, h), control.last_h, control.last_factor, shared)
    return StepControl(h, s, factor, shared)


@inlined
def implicit_step(scene, record, start, control, h_max, tolerance, scratch):
    """One accepted implicit step, which the first event ends.

    Parameters
    ----------
    scene, record : NamedTuple
    start : Start
    control : StepControl
        Length of the step to try first.
    h_max : float
        Greatest length of the step, s.
    tolerance : float
        Relative error allowed to the step.
    scratch : Scratch
        ``bends[0]`` is filled with what :func:`rosenbrock.dense` needs.

    Returns
    -------
    tuple
        The guard that ended the step, or -1; length of the step, s, negative if no step was accepted; state, record and
        control after it; norm of its error, and the error of the place, in units of the tolerance, and the error of the
        velocity, in m/s, if something else than the tolerance limited its length, zeros otherwise; and what
        :func:`_error_of_place` returns, in units of the tolerance.
    """
    mode, now, y, x, forcing, common, linear = start
    course, bends = scratch.course, scratch.bends[0]
    record = enter_implicit(variation.asked(scene), scene, record, start)
    scales = implicit.error_scales(scene, tolerance, x)
    s = min(control.h, h_max)
    drives.follow(scene.drive, course, now, s)
    # `h` is the length of the next attempt: `s`, or less up to the `event` that a step of length `s` has shown.
    event, h, near, divided = -1, s, False, False
    before = implicit.guards_and_motion(scene, mode, common, forcing, x)
    for _ in range(400):
        end = drives.turn_near(scene.drive, course, now, h)
        x_next, error = _step_of_method(scene, start, course, h, end, bends)
        h_norm = _error_norm(error, scales, linear)
        if not h_norm <= 1.0:
            # The step up to an event has stages of its own and may have a larger error.
            s = h = h * max(_MOST_DECREASE, 0.9 * h_norm**-0.2)
            event = -1
            continue
        part = implicit.part_before_bend(scene, mode, common, x, x_next)
        if part < 1.0:
            s = h = h * part
            event, divided = -1, True
            continue
        taken = Taken(h, x_next)
        middle = _view_within(scene, start, scratch, taken, 0.5)
        after = implicit.guards_and_motion(scene, mode, common, end, x_next)
        if event >= 0:
            break
        held, allowed = implicit.held_guard(scene, mode, tolerance, after[1])
        if held >= 0:
            g = held - scratch.first_guard
            h_norm = max(h_norm, _coarseness(scene, start, scratch, taken, (before, middle, after), g) / allowed)
            if not h_norm <= 1.0:
                s = h = h * max(_MOST_DECREASE, 0.9 * h_norm**-0.2)
                continue
        error_norm, near, near_zero = h_norm, False, implicit.near_zero(scene, middle[1])
        for g in range(len(near_zero)):
            near = near or _may_vanish(near_zero[g], before[0][g], middle[0][g], after[0][g])
        if not near:
            break
        event, h = _first_event_by_samples(scene, start, scratch, taken, (before, middle, after))
        if event < 0 or h == 0.0:
            break
        near = False
    else:
        return -1, -1.0, y, record, control, (0.0, 0.0, 0.0, 0.0)
    shared = h < s or s == h_max or divided or control.shared
    control = _next_control(control, s, error_norm, s == h_max or divided, s < min(control.h, h_max))
    if event >= 0:
        event += scratch.first_guard
        if h == 0.0:
            return event, 0.0, y, record, control, (0.0, 0.0, 0.0, 0.0)
    fractions = scratch.work[0]
    record = recorder.enter(scene, record, now.t, implicit.seen(scene, before))
    count, looks = _add_extremes(scene, record, start, scratch, taken, (before, middle, after))
    if looks or near:
        for i in range(1 if near else 2, INSTANTS, 1 if near else INSTANTS):
            fractions[count] = i / INSTANTS
            count += 1
    due = (variation.due(scene, record) - now.t) - now.rest
    if 0.0 < due < h:
        fractions[count] = due / h
        count += 1
    ascending(fractions, count)
    fraction_before, stuck = 0.0, modes.sticks(scene, mode)
    fractions[count] = 1.0
    for j in range(count + 1):
        fraction = fractions[j]
        view = after if fraction == 1.0 else middle
        if fraction != 0.5 and fraction != 1.0:
            view = _view_within(scene, start, scratch, taken, fraction)
        q = _setting_record(scene, record, (before, view, after)) if looks and fraction != 1.0 else -1
        if q >= 0:
            last = fractions[j + 1] if j < count else 1.0
            fraction, view = _extreme_by_method(
                scene, record, start, scratch, taken, q, view, (fraction_before, fraction, last)
            )
        duration = (fraction - fraction_before) * h
        ends = fraction_before, fraction
        record = along_implicit(variation.asked(scene), scene, record, start, taken, ends, scratch)
        record = recorder.observe(
            scene, record, later(now, fraction * h).t, duration, stuck, implicit.seen(scene, view)
        )
        fraction_before = fraction
    shares = (h_norm, abs(error[0]) / scales[0], abs(error[1])) if shared else (0.0, 0.0, 0.0)
    errors = *shares, _error_of_place(scene, start, scratch, taken) / scales[0]
    return event, h, implicit.from_implicit(scene, end, x_next), record, control, errors


@inlined
def _error_of_place(scene, start, scratch, taken):
    """Distance that a body goes within a step at the difference of its velocity from the rate of its place.

    Both are those of the dense output in the middle of the step. In a creep, where friction alone decides the velocity,
    the error estimate of the step is small by symmetry if the body begins and ends at rest; this one is not.
    """
    bends, forcing = scratch.bends[0], drives.turn_near(scene.drive, scratch.course, start.now, 0.5 * taken.h)
    x = rosenbrock.dense(start.x, taken.x_next, bends, 0.5)
    rate = implicit.rates(scene, start.mode, start.common, forcing, x)[0]
    return taken.h * abs(rosenbrock.dense_rates(start.x, taken.x_next, bends, 0.5, taken.h)[0] - rate)


@inlined
def _may_turn(first, middle, last):
    """Whether a quantity may have an extreme within a step that sets a record.

    The arguments are what :func:`implicit.sought` returned for it at the beginning, in the middle and at the end.
    """
    (a, least, greatest), b, c = first, middle[0], last[0]
    bend = abs(a - 2.0 * b + c)
    # The parabola through the three values is monotonic if their difference is twice as large as its bend.
    turns = abs(c - a) < 4.0 * bend
    return turns and (max(a, max(b, c)) + 0.5 * bend > greatest or min(a, min(b, c)) - 0.5 * bend < least)


@inlined
def _add_extremes(scene, record, start, scratch, taken, views):
    """Store in ``work[0]`` the fractions of a step at which place, velocity or a force may set a record.

    A quantity is taken as the polynomial through its values at five instants. Its value at an extreme does not depend
    on small errors of the instant. The acceleration would tell the instant worse: where friction rises steeply, it
    magnifies the error of the dense output.

    `views` are those at the beginning, in the middle and at the end of the step. The number of fractions is returned,
    and whether any of these quantities may set a record within the step, or turn.
    """
    work, row, count = scratch.work[:-1], scratch.work[-1], 0
    before, within, after = views[0][1], views[1][1], views[2][1]
    # The recorder must look where the place turns. Velocities count beside their records: between two turns of the
    # velocity a body may reverse.
    reverses = before[1] * within[1] < 0.0 or within[1] * after[1] < 0.0
    turns = before[2] * within[2] < 0.0 or within[2] * after[2] < 0.0
    first, middle, last = (
        implicit.sought(scene, record, views[0]),
        implicit.sought(scene, record, views[1]),
        implicit.sought(scene, record, views[2]),
    )
    found = reverses or turns
    for q in range(1, len(first)):
        found = found or _may_turn(first[q], middle[q], last[q])
    if not found:
        return 0, False
    early = implicit.sought(scene, record, _view_within(scene, start, scratch, taken, 0.25))
    late = implicit.sought(scene, record, _view_within(scene, start, scratch, taken, 0.75))
    for q in range(1, len(first)):
        may_turn = _may_turn(first[q], early[q], middle[q]) or _may_turn(middle[q], late[q], last[q])
        if q == 1:
            may_turn = may_turn or turns
        if not (may_turn or (q == 1 and reverses)):
            continue
        _interpolate((first[q][0], early[q][0], middle[q][0], late[q][0], last[q][0]), row)
        if q == 1 and reverses:
            count = crossings(row, 1.0, work, count)
        if may_turn:
            differentiate(row, row)
            first_turn, count = count, crossings(row, 1.0, work, count)
            for i in range(first_turn, count):
                work[0][i] = _turn_near(scene, record, start, scratch, taken, q, first[q][0], work[0][i])
    return count, True


@inlined
def _turn_near(scene, record, start, scratch, taken, q, value_before, turn):
    """Fraction of a step at which a quantity has an extreme, from the one at which a polynomial has it.

    In a long step the polynomial may be coarse, and where a law bends it cuts the corner. Brent's method then finds the
    extreme of the quantity itself, along the dense output.

    `q` is the quantity, `value_before` its value at the beginning of the step. ``work[-1]`` holds the derivative of the
    polynomial.
    """
    row = scratch.work[-1]
    upwards = 1.0 if row[1] + turn * (2.0 * row[2] + turn * 3.0 * row[3]) < 0.0 else -1.0
    rise = turn * (row[0] + turn * (row[1] / 2.0 + turn * (row[2] / 3.0 + turn * row[3] / 4.0)))
    low, high = max(turn - 1.0 / INSTANTS, 0.0), min(turn + 1.0 / INSTANTS, 1.0)
    best = second = third = fraction = turn
    f_best = f_second = f_third = -inf
    move = last_move = 0.0
    for i in range(_MOST_TRIALS):
        view = _view_within(scene, start, scratch, taken, fraction)
        f = upwards * (implicit.sought(scene, record, view)[q][0] - value_before)
        if i == 0:
            if abs(f - upwards * rise) <= _COARSE * abs(f):
                return turn
            best = second = third = turn
            f_best = f_second = f_third = f
        elif f >= f_best:
            low, high = (best, high) if fraction > best else (low, best)
            third, f_third, second, f_second, best, f_best = second, f_second, best, f_best, fraction, f
        else:
            low, high = (low, fraction) if fraction > best else (fraction, high)
            if f >= f_second or second == best:
                third, f_third, second, f_second = second, f_second, fraction, f
            elif f >= f_third or third in (best, second):
                third, f_third = fraction, f
        if high - low < 4.0 * _NEAR:
            break
        # A parabola through the three best points, if it moves less than half as far as the move before last.
        to_second, to_third = (best - second) * (f_best - f_third), (best - third) * (f_best - f_second)
        bend, before_last = 2.0 * (to_third - to_second), last_move
        last_move = move
        move = ((best - third) * to_third - (best - second) * to_second) / bend if bend != 0.0 else inf
        if not (abs(move) < 0.5 * abs(before_last) and low < best - move < high):
            last_move = (high if best < 0.5 * (low + high) else low) - best
            move = -0.381966 * last_move
        fraction = best - (move if abs(move) > _NEAR else _NEAR if move > 0.0 else -_NEAR)
    return best


@inlined
def _view_by_method(scene, start, scratch, h):
    """View after a step of the method of length `h`, s; more exact than the dense output of a longer step."""
    there = drives.turn_near(scene.drive, scratch.course, start.now, h)
    state, _ = _step_of_method(scene, start, scratch.course, h, there, scratch.bends[1])
    return implicit.guards_and_motion(scene, start.mode, start.common, there, state)


@inlined
def _extreme_by_method(scene, record, start, scratch, taken, q, view, fractions):
    """Fraction of a step at an extreme of quantity `q`, and the view there, from steps of the method.

    `view` is that of the dense output where it has the extreme: the second of the `fractions`, between two other
    instants. In a long step it errs so much that the extreme is elsewhere: at that of a parabola through three values.
    """
    first, fraction, last = fractions
    dense = implicit.sought(scene, record, view)[q][0]
    view = _view_by_method(scene, start, scratch, fraction * taken.h)
    value = implicit.sought(scene, record, view)[q][0]
    # No part of a step, and no step of the method, is without a length.
    width = min(_BESIDE, 0.5 * min(fraction - first, last - fraction))
    if abs(value - dense) <= _COARSE * abs(value) or width <= 0.0:
        return fraction, view
    low, high = (
        implicit.sought(scene, record, _view_by_method(scene, start, scratch, (fraction - width) * taken.h))[q][0],
        implicit.sought(scene, record, _view_by_method(scene, start, scratch, (fraction + width) * taken.h))[q][0],
    )
    bend = low - 2.0 * value + high
    move = 0.5 * width * (low - high) / bend if bend != 0.0 else 0.0
    fraction = min(max(fraction + move, 0.5 * (first + fraction)), 0.5 * (fraction + last))
    return fraction, _view_by_method(scene, start, scratch, fraction * taken.h)


@inlined
def _setting_record(scene, record, views):
    """A quantity that in a view within a step lies beyond both ends of the step and may set a record; -1 for none.

    `views` are those at the beginning, within the step and at its end.
    """
    first, within, last = (
        implicit.sought(scene, record, views[0]),
        implicit.sought(scene, record, views[1]),
        implicit.sought(scene, record, views[2]),
    )
    found = -1
    for q in range(len(within)):
        (value, least, greatest), a, b = within[q], first[q][0], last[q][0]
        above, below = value - max(a, b), min(a, b) - value
        if above > 0.0 and value + _DENSE_ERROR * above > greatest:
            found = q
        if below > 0.0 and value - _DENSE_ERROR * below < least:
            found = q
    return found
