"""Piecewise-smooth integration: power series within a mode, guards whose roots end it.

The series of a mode is exact to the tolerance on its step, and every guard is a series on the same
step, so that its first root is located to rounding and none is stepped over. A mode of a smooth law
that relaxes much faster than it moves is taken by implicit steps instead (:mod:`rosenbrock`), and
so is every mode of a law with bristles. The family of the law decides which of both methods a kernel contains.
"""

from __future__ import annotations

from math import inf, isfinite, isnan, nan
from typing import NamedTuple

import numpy as np

from ringsweep.hooks import (
    creeps,
    embark,
    enter,
    expand,
    finish,
    from_stiff,
    impasse,
    is_stiff,
    land,
    linearise,
    onward,
    rows,
    sample,
    start,
    stiff_motion,
    stiff_sample,
    stiff_scales,
    stiff_start,
    stiff_view,
    stiff_watch,
    switch,
    to_stiff,
    watch,
)
from ringsweep.jit import borrowed, hook, inlined, kernel, take
from ringsweep.physics.drives import next_knot
from ringsweep.physics.friction import DYNAMIC, SET_VALUED, SMOOTH
from ringsweep.regimes import BROKEN, COMPLETE, RUNNING
from ringsweep.series import ORDER, STACK, first_root
from ringsweep.solvers import rosenbrock

# Steps and events in a row at one instant after which a run is given up.
_STALLED = 400

# How much larger the relative error of a step may be in the friction of bristles than in the state.
_PUSH = 100.0


@inlined
def _first_event(c, guards, fresh, h, work):
    """First guard to reach zero within the step `h`, and when; -1 and `h` if none does.

    A guard that is zero as its mode is entered has that root divided out.
    """
    event = -1
    for g in range(guards, c.shape[0]):
        row = c[g]
        if g == fresh:
            low = 0
            while low < ORDER and row[low] == 0.0:
                low += 1
            if row[low] == 0.0:
                continue
            for k in range(ORDER + 1):
                row[k] = row[k + low] if k + low <= ORDER else 0.0
        if row[0] <= 0.0:
            return g, 0.0
        if isnan(row[0]):
            return -1, nan
        s, found = first_root(row, h, work)
        # Guards that vanish together, as those of one contact seen twice, go to the first of them.
        if found and (event < 0 or s < h * (1.0 - 1e-14)):
            event, h = g, s
    return event, h


@inlined
def _guard_after(scene, mode, t, x, line, h, g, stages):
    """Guard `g` after a step `h`."""
    x_next, _ = rosenbrock.step(scene, mode, t, x, line, h, stages)
    return stiff_view(scene, mode, t + h, x_next)[0][g]


@inlined
def _locate(scene, mode, t, x, line, h, g, stages):
    """Step at which guard `g`, not positive after a step `h`, reaches zero, by steps of that very length.

    The method itself, not an interpolant of it, is solved for the event.
    """
    low, high = 0.0, h
    f_low = stiff_view(scene, mode, t, x)[0][g]
    f_high = _guard_after(scene, mode, t, x, line, h, g, stages)
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
def _first_creep_event(scene, mode, t, x, line, s, within, after, stages):
    """First guard to fall below zero within an implicit step, of which `within` and `after` are the guards."""
    event, end = -1, s
    for g in range(len(after)):
        # Zero is no violation: a body at rest in equilibrium stays there.
        if after[g] < 0.0 or within[g] < 0.0:
            until = min(end, s if after[g] < 0.0 else 0.5 * s)
            if event >= 0 and _guard_after(scene, mode, t, x, line, until, g, stages) > 0.0:
                continue
            found = _locate(scene, mode, t, x, line, until, g, stages)
            if event < 0 or found < end * (1.0 - 1e-12):
                event, end = g, found
    return event, end


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
def _creep(scene, record, mode, t, y, x, line, trial, horizon, tolerance, guards, stages):
    """One accepted implicit step from the state `y`, which is `x` in its own coordinates, cut at the first event.

    Returns
    -------
    tuple
        Guard or -1, length of the step (negative if none was found), state, record, next :class:`Trial`.
    """
    scales = stiff_scales(scene, tolerance, x)
    s = min(trial.h, horizon)
    event, end = -1, s
    for _ in range(200):
        x_next, error = rosenbrock.step(scene, mode, t, x, line, s, stages)
        size = _size(error, scales, line)
        if size <= 1.0:
            within = stiff_view(scene, mode, t + 0.5 * s, rosenbrock.dense(x, x_next, stages, 0.5))
            after = stiff_view(scene, mode, t + s, x_next)
            event, end = _first_creep_event(scene, mode, t, x, line, s, within[0], after[0], stages)
            if event < 0 or end == 0.0:
                break
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
        within = stiff_view(scene, mode, t + 0.5 * end, rosenbrock.dense(x, x_next, stages, 0.5))
        after = stiff_view(scene, mode, t + end, x_next)
    velocity, acceleration = stiff_motion(scene, t, x, line)
    done = 0.0
    for half, right in ((0.0, within), (0.5, after)):
        # Where the motion or its acceleration turns within this half there is an extreme: a moment of its own.
        turns, rises = velocity * right[1][1] < 0.0, acceleration * right[1][2] < 0.0
        first = _turning(scene, mode, t, x, x_next, end, stages, half, 1, velocity) if turns else 2.0
        second = _turning(scene, mode, t, x, x_next, end, stages, half, 2, acceleration) if rises else 2.0
        for moment in (min(first, second), max(first, second)):
            if moment < 1.0:
                view = stiff_view(scene, mode, t + moment * end, rosenbrock.dense(x, x_next, stages, moment))
                record = stiff_watch(scene, record, mode, view, t + moment * end, (moment - done) * end)
                done = moment
        record = stiff_watch(scene, record, mode, right, t + (half + 0.5) * end, (half + 0.5 - done) * end)
        done = half + 0.5
        velocity, acceleration = right[1][1], right[1][2]
    return event, end, from_stiff(scene, t + end, x_next), record, trial


@inlined
def _turning(scene, mode, t, x, x_next, h, stages, half, which, start):
    """Where in the half step from the fraction `half` on velocity (1) or acceleration (2), there `start`, turns."""
    low, high = half, half + 0.5
    for _ in range(40):
        middle = 0.5 * (low + high)
        view = stiff_view(scene, mode, t + middle * h, rosenbrock.dense(x, x_next, stages, middle))
        if view[1][which] * start > 0.0:
            low = middle
        else:
            high = middle
    return 0.5 * (low + high)


@inlined
def _along(scene, record, mode, t, y, horizon, tolerance, c, guards, work):
    """One step of the series, cut at the first event: guard or -1, length, state, record."""
    h = min(expand(scene, mode, t, y, tolerance, c), horizon)
    guard, s = _first_event(c, guards, mode.fresh, h, work)
    if s > 0.0:
        record = watch(scene, record, mode, c, t, s, work)
    return guard, s, land(scene, mode, c, t, s), record


@hook
def _stride(law, scene, record, mode, t, y, trial, horizon, tolerances, c, guards, work, stages):
    """One step in the way that the family of the law wants.

    Returns
    -------
    tuple
        Whether the step was implicit, guard or -1, length of the step, state, record, next implicit step to try.
    """


@_stride.implements(*SET_VALUED)
def _series_stride(law, scene, record, mode, t, y, trial, horizon, tolerances, c, guards, work, stages):
    guard, s, y, record = _along(scene, record, mode, t, y, horizon, tolerances[0], c, guards, work)
    return False, guard, s, y, record, trial


@_stride.implements(*SMOOTH)
def _either_stride(law, scene, record, mode, t, y, trial, horizon, tolerances, c, guards, work, stages):
    if creeps(scene, mode):
        x = to_stiff(scene, t, y)
        line = linearise(scene, mode, t, x)
        if is_stiff(scene, mode, y, line):
            if trial.last == 0.0:
                # What is left of the way in ends at the rate of the decay.
                trial = Trial(min(trial.h, -1.0 / line[1][3]), 0.0, 0.0)
            guard, s, y, record, trial = _creep(
                scene, record, mode, t, y, x, line, trial, horizon, tolerances[1], guards, stages
            )
            return True, guard, s, y, record, trial
    guard, s, y, record = _along(scene, record, mode, t, y, horizon, tolerances[0], c, guards, work)
    return False, guard, s, y, record, Trial(1e-6 * scene.span, 0.0, 0.0)


@_stride.implements(*DYNAMIC)
def _implicit_stride(law, scene, record, mode, t, y, trial, horizon, tolerances, c, guards, work, stages):
    x = to_stiff(scene, t, y)
    line = linearise(scene, mode, t, x)
    guard, s, y, record, trial = _creep(
        scene, record, mode, t, y, x, line, trial, horizon, tolerances[1], guards, stages
    )
    return True, guard, s, y, record, trial


@hook
def _outset(law, scene, mode, t, y, tolerances, c):
    """Record of a run that begins."""


@_outset.implements(*SET_VALUED, *SMOOTH)
def _series_outset(law, scene, mode, t, y, tolerances, c):
    expand(scene, mode, t, y, tolerances[0], c)
    return start(scene, c)


@_outset.implements(*DYNAMIC)
def _implicit_outset(law, scene, mode, t, y, tolerances, c):
    return stiff_start(scene, mode, t, y)


@hook
def _row(law, scene, mode, implicit, c, t, s, y):
    """One row of a time history, after the part `s` of a step that began in the state `y` if it was a series."""


@_row.implements(*SET_VALUED)
def _series_row(law, scene, mode, implicit, c, t, s, y):
    return sample(scene, mode, c, t, s)


@_row.implements(*SMOOTH)
def _either_row(law, scene, mode, implicit, c, t, s, y):
    if implicit:
        return stiff_sample(scene, mode, t, to_stiff(scene, t, y))
    return sample(scene, mode, c, t, s)


@_row.implements(*DYNAMIC)
def _implicit_row(law, scene, mode, implicit, c, t, s, y):
    return stiff_sample(scene, mode, t, to_stiff(scene, t, y))


@inlined
def _arrive(scene, mode, guard, t, s, horizon, y):
    """Time, status, mode and state after a step `s` that ended at `guard`, or at none (-1)."""
    # To the very end of the span or of a piece of the drive, not to the rounding of a sum.
    if s >= 0.0:
        t = t + s if s < horizon else t + horizon
    if not (isfinite(y[0]) and isfinite(y[1])):
        return t, BROKEN, mode, y
    if not s >= 0.0:
        return t, impasse(scene, mode, t, y), mode, y
    if guard >= 0:
        status, mode, y = switch(scene, mode, guard, t, y)
        return t, status, mode, y
    if t >= scene.span:
        return t, COMPLETE, mode, y
    return t, RUNNING, onward(mode) if s > 0.0 else mode, y


@inlined
def _store(row, values):
    for k in range(len(values)):
        row[k] = values[k]


@inlined
def _keep(scene, mode, implicit, c, t, s, y, times, table, kept):
    """Store the state after the part `s` of a step as row `kept` of a history that has room; the number of rows."""
    if kept == len(times):
        return kept
    _store(table[kept], _row(scene.law, scene, mode, implicit, c, t + s, s, y))
    # Sums that should be equal differ by rounding.
    times[kept] = max(t + s, times[kept - 1]) if kept > 0 else t
    return kept + 1


@kernel
def integrate(batch, tolerances, limit, out, steps, spacing, times, table):
    """Run every cell of a batch to its end, or to `limit` steps.

    One kernel serves sweeps and histories: a user of both compiles a kind of scene once.

    Parameters
    ----------
    batch : NamedTuple
        Cells, as :func:`ringsweep.models.batch` makes them.
    tolerances : tuple of float
        Error allowed to a step of the series and to an implicit step: rad, and rad/s relative to
        1 rad/s + \\|omega\\| or m/s relative to the width of the stiction band.
    limit : int
        Steps after which a run is given up.
    out : ndarray of shape ``(cells, outcomes)``
        Or without columns, if outcomes are not wanted.
    steps : ndarray of shape ``(cells,)``
    spacing : float
        Greatest distance between rows of a history, s.
    times, table : ndarray of shapes ``(rows,)`` and ``(rows, variables)``
        Filled, as far as they reach, with the history of the only cell: every end of a step, and within longer ones
        instants `spacing` apart. A run that fills them ends there. Without rows no history is kept.

    Returns
    -------
    int
        Number of rows.
    """
    first = take(batch, 0)
    count, guards = rows(first)
    c = np.zeros((count, ORDER + 3))
    work = np.empty((STACK, ORDER + 3))
    stages = np.empty((rosenbrock.STAGES, len(embark(first)[1])))
    return _integrate(batch, tolerances, limit, out, steps, spacing, times, table, guards, c, work, stages)


@inlined
def _integrate(batch, tolerances, limit, out, steps, spacing, times, table, guards, c, work, stages):
    c, work, stages = borrowed(c), borrowed(work), borrowed(stages)
    out, steps, times, table = borrowed(out), borrowed(steps), borrowed(times), borrowed(table)
    kept = 0
    for i in range(len(steps)):
        scene = take(batch, i)
        t, y = embark(scene)
        status, mode = enter(scene, t, y)
        record = _outset(scene.law, scene, mode, t, y, tolerances, c)
        trial = Trial(1e-6 * scene.span, 0.0, 0.0)
        n = stalled = 0
        before = -1.0
        entered = True
        implicit = False
        while status == RUNNING:
            # Steps below the rounding of time do move the state, on the way into a jam, but not for ever.
            stalled = stalled + 1 if t == before else 0
            if n == limit or stalled == _STALLED:
                status = impasse(scene, mode, t, y) if stalled == _STALLED else BROKEN
                break
            before = t
            n += 1
            horizon = min(scene.span, next_knot(scene.drive, t)) - t
            trial = Trial(min(trial.h, spacing), trial.last, trial.size)
            implicit, guard, s, y_next, record, trial = _stride(
                scene.law, scene, record, mode, t, y, trial, horizon, tolerances, c, guards, work, stages
            )
            if len(times) > 0:
                if kept == len(times):
                    return kept
                if s > 0.0:
                    parts = 1 if implicit else int(s / spacing) + 1
                    for part in range(0 if entered else 1, parts + 1):
                        state = y if part == 0 else y_next
                        kept = _keep(scene, mode, implicit, c, t, s * part / parts, state, times, table, kept)
                entered = guard >= 0 or (entered and s == 0.0)
            last = mode
            t, status, mode, y = _arrive(scene, mode, guard, t, s, horizon, y_next)
            if s == 0.0 and status != RUNNING:
                # What a mode ends by that is over as it is entered is to be seen.
                kept = _keep(scene, last, implicit, c, t, 0.0, y, times, table, kept)
        if kept == 0:
            # A run that ends as it begins was somewhere all the same.
            kept = _keep(scene, mode, implicit, c, t, 0.0, y, times, table, kept)
        outcome = finish(scene, record, status, t, y)
        for k in range(min(len(outcome), out.shape[1])):
            out[i, k] = outcome[k]
        steps[i] = n
    return kept
