"""One implicit step of a mode that relaxes much faster than it moves, up to the first guard that vanishes."""

from __future__ import annotations

from math import inf, isfinite
from typing import NamedTuple

import numpy as np

from ringsweep.compile import inlined
from ringsweep.models.interface import implicit, modes, recorder
from ringsweep.numerics.series import ORDER, ascending, first_root, value
from ringsweep.solvers import rosenbrock

# Parts of an implicit step at whose ends guards are looked at where one of them may vanish.
INSTANTS = 4


# Coefficients of the polynomial through the values at these instants.
_THROUGH = np.ascontiguousarray(np.linalg.inv(np.vander(np.linspace(0.0, 1.0, INSTANTS + 1), increasing=True)))


# Guards of an implicit step, at most.
MOST_GUARDS = 6


# How much larger the relative error of a step may be in the friction of bristles than in the state.
_PUSH = 100.0


@inlined
def _guard_after(scene, mode, t, x, line, h, g, stages):
    """Guard `g` after a step `h`."""
    x_next, _ = rosenbrock.step(scene, mode, t, x, line, h, stages)
    return implicit.guards_and_motion(scene, mode, t + h, x_next)[0][g]


@inlined
def _locate(scene, mode, t, x, line, h, f_high, g, stages):
    """Step at which guard `g` reaches zero, which after a step `h` is `f_high`, not positive; by steps of that length.

    The method itself, not an interpolant of it, is solved for the event.
    """
    low, high = 0.0, h
    f_low = implicit.guards_and_motion(scene, mode, t, x)[0][g]
    if f_low <= 0.0:
        # Zero as the mode was entered: find a step before the event, if there is one.
        s = h
        for _ in range(80):
            s *= 0.5
            f_low = _guard_after(scene, mode, t, x, line, s, g, stages)
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
        f = _guard_after(scene, mode, t, x, line, s, g, stages)
        if f > 0.0:
            # Illinois: an end that stays is made to count for less.
            low, f_low = s, f
            f_high *= 0.5
        else:
            high, f_high = s, f
            f_low *= 0.5
        if high - low <= 1e-14 * h or high - low <= 2e-16 * t:
            break
    return high


@inlined
def _size(error, scales, line):
    """Largest component of an error, or of that of the friction of bristles, measured by what is allowed.

    Infinite if one is not a number.
    """
    _, core, bristles, _ = line
    # Stiff bristles turn a small error of the velocity into a large one of the force.
    size = rosenbrock.push(bristles, core, error, scales) / _PUSH
    if not size >= 0.0:
        size = inf
    for k in range(len(error)):
        part = abs(error[k]) / scales[k]
        if not part <= size:
            size = part if part >= 0.0 else inf
    return size


@inlined
def _may_vanish(nearness, first, middle, last):
    """Whether a guard may vanish within a step of which it is known at both ends and in the middle."""
    # A parabola through the three dips by less than an eighth of its second difference below the lowest of them.
    return not min(first, min(middle, last)) >= nearness + 0.5 * abs(first - 2.0 * middle + last)


@inlined
def _first_creep_event(scene, mode, t, x, x_next, line, s, before, within, after, stages, seen, work):
    """First guard to fall below zero within an implicit step, and when; -1 and `s` if none does.

    A guard is a polynomial through five instants of the dense output, which is of that degree itself. Its first root
    is isolated as that of a series is, so that no dip between two instants is missed. `before`, `within` and `after`
    are the views of the step's beginning, middle and end; `seen` is filled with the guards at the five instants.
    """
    early = implicit.guards_and_motion(scene, mode, t + 0.25 * s, rosenbrock.dense(x, x_next, stages, 0.25))
    late = implicit.guards_and_motion(scene, mode, t + 0.75 * s, rosenbrock.dense(x, x_next, stages, 0.75))
    nearness = implicit.near_zero(scene, within[1])
    for g in range(len(nearness)):
        seen[g, 0], seen[g, 1], seen[g, 2] = before[0][g], early[0][g], within[0][g]
        seen[g, 3], seen[g, 4] = late[0][g], after[0][g]
    event, end = -1, s
    for g in range(len(nearness)):
        if not _may_vanish(nearness[g], before[0][g], within[0][g], after[0][g]):
            continue
        until = min(end, s * _below(seen[g], work))
        if until == 0.0:
            continue
        last = _guard_after(scene, mode, t, x, line, until, g, stages)
        # The guard may vanish after another one has, or graze zero where the dense output is beyond it by its error.
        if last > 0.0:
            continue
        found = _locate(scene, mode, t, x, line, until, last, g, stages)
        if event < 0 or found < end * (1.0 - 1e-12):
            event, end = g, found
    return event, end


@inlined
def _below(samples, work):
    """A fraction of a step at which a guard is below zero, soon after it first falls to it; 0 if it never does.

    Zero is no violation: a body at rest in equilibrium stays there.
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
                row[k] += _THROUGH[k, i] * samples[i]
    root, found = first_root(row, 1.0, work[1:])
    if not found or (end > 0.0 and root > end - 1.0 / INSTANTS):
        return end
    # A dip between two instants: its bottom.
    lowest, bottom = 0.0, 0.0
    for i in range(1, 33):
        at = root + (1.0 / INSTANTS) * i / 32.0
        depth = value(row, min(at, 1.0))
        if depth < lowest:
            lowest, bottom = depth, min(at, 1.0)
    return bottom if bottom > 0.0 else root


class Trial(NamedTuple):
    """Implicit step to try, and the last one that was accepted with the size of its error; 0 if there is none."""

    h: float
    last: float
    size: float


@inlined
def _next_trial(trial, s, size, cut, rejected):
    """What to try after a step `s` whose error was `size`; `cut` if it was shortened to end somewhere."""
    size = max(size, 1e-8)
    # A step that would have been too long a moment ago will hardly be short enough now.
    h = s * min(1.0 if rejected else 6.0, 0.9 * size**-0.2)
    # Towards the end of a creep steps shorten at a steady rate, which the step before tells (Gustafsson).
    if trial.last > 0.0:
        h = min(h, s * 0.9 * s / trial.last * (trial.size / (size * size)) ** 0.2)
    # A step cut short by the horizon says little about the next one.
    return Trial(max(trial.h, h), trial.last, trial.size) if cut else Trial(h, s, size)


@inlined
def implicit_step(scene, record, mode, t, y, x, line, trial, horizon, tolerance, guards, stages, seen, work):
    """One accepted implicit step from the state `y`, which is `x` in its own coordinates, cut at the first event.

    Returns
    -------
    tuple
        Guard or -1, length of the step (negative if none was found), state, record, next :class:`Trial`.
    """
    scales = implicit.error_scales(scene, tolerance, x)
    s = min(trial.h, horizon)
    event, end, near = -1, s, False
    before = implicit.guards_and_motion(scene, mode, t, x)
    within, after = before, before
    for _ in range(200):
        x_next, error = rosenbrock.step(scene, mode, t, x, line, s, stages)
        size = _size(error, scales, line)
        if size <= 1.0:
            within = implicit.guards_and_motion(scene, mode, t + 0.5 * s, rosenbrock.dense(x, x_next, stages, 0.5))
            after = implicit.guards_and_motion(scene, mode, t + s, x_next)
            event, end = -1, s
            near, nearness = False, implicit.near_zero(scene, within[1])
            for g in range(len(nearness)):
                near = near or _may_vanish(nearness[g], before[0][g], within[0][g], after[0][g])
            if near:
                event, end = _first_creep_event(
                    scene, mode, t, x, x_next, line, s, before, within, after, stages, seen, work
                )
                if event < 0:
                    rosenbrock.step(scene, mode, t, x, line, s, stages)
            if event < 0 or end == 0.0:
                break
            near = False
            # The step up to the event is another one, which may see what the stages of the longer one passed over.
            x_next, error = rosenbrock.step(scene, mode, t, x, line, end, stages)
            short = _size(error, scales, line)
            if short <= 1.0:
                break
            s, size = end, short
        s *= max(0.2, 0.9 * size**-0.2) if isfinite(size) else 0.1
    else:
        return -1, -1.0, y, record, trial
    trial = _next_trial(trial, s, size, s == horizon, s < min(trial.h, horizon))
    if event >= 0:
        if end == 0.0:
            return guards + event, 0.0, y, record, trial
        event += guards
        within = implicit.guards_and_motion(scene, mode, t + 0.5 * end, rosenbrock.dense(x, x_next, stages, 0.5))
        after = implicit.guards_and_motion(scene, mode, t + end, x_next)
    moments, count = work[0], 0
    velocity, acceleration = implicit.motion(scene, t, x, line)
    for half, right in ((0.0, within), (0.5, after)):
        # Where the motion or its acceleration turns within this half there is an extreme: a moment of its own.
        if velocity * right[1][1] < 0.0:
            moments[count] = _turning(scene, mode, t, x, x_next, end, stages, half, 1, velocity)
            count += 1
        if acceleration * right[1][2] < 0.0:
            moments[count] = _turning(scene, mode, t, x, x_next, end, stages, half, 2, acceleration)
            count += 1
        velocity, acceleration = right[1][1], right[1][2]
    if near:
        for i in range(1, INSTANTS):
            moments[count] = i / INSTANTS
            count += 1
    else:
        moments[count] = 0.5
        count += 1
    ascending(moments, count)
    done, stuck = 0.0, modes.sticks(scene, mode)
    for j in range(count):
        view = within
        if moments[j] != 0.5:
            view = implicit.guards_and_motion(
                scene, mode, t + moments[j] * end, rosenbrock.dense(x, x_next, stages, moments[j])
            )
        duration = (moments[j] - done) * end
        record = recorder.observe(scene, record, t + moments[j] * end, duration, stuck, implicit.seen(scene, view))
        done = moments[j]
    record = recorder.observe(scene, record, t + end, (1.0 - done) * end, stuck, implicit.seen(scene, after))
    return event, end, implicit.from_implicit(scene, implicit.forcing(scene, t + end), x_next), record, trial


@inlined
def _turning(scene, mode, t, x, x_next, h, stages, half, which, start):
    """Where in the half step from the fraction `half` on velocity (1) or acceleration (2), there `start`, turns."""
    low, high = half, half + 0.5
    for _ in range(40):
        middle = 0.5 * (low + high)
        view = implicit.guards_and_motion(scene, mode, t + middle * h, rosenbrock.dense(x, x_next, stages, middle))
        if view[1][which] * start > 0.0:
            low = middle
        else:
            high = middle
    return 0.5 * (low + high)
