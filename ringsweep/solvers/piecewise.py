"""Piecewise-smooth integration: power series within a mode, guards whose roots end it.

The series of a mode is exact to the tolerance on its step, and every guard is a series on the same
step, so that its first root is located to rounding and none is stepped over. A mode of a smooth law
that relaxes much faster than it moves is taken by implicit steps instead (:mod:`rosenbrock`), and
so is every mode of a law with bristles. The family of the law decides which of both methods a kernel contains.
"""

from __future__ import annotations

from math import inf, isfinite, isnan, nan, sqrt
from typing import NamedTuple

import numpy as np

from ringsweep.compile import borrowed, hook, inlined, kernel, take
from ringsweep.hooks import (
    breach,
    creeps,
    drift,
    embark,
    energy,
    enter,
    expand,
    finish,
    forcing,
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
    stiff_near,
    stiff_sample,
    stiff_scales,
    stiff_start,
    stiff_view,
    stiff_watch,
    switch,
    to_stiff,
    watch,
)
from ringsweep.models.interface.status import BROKEN, COMPLETE, RUNNING
from ringsweep.numerics.series import ORDER, STACK, ascending, first_root, slope, value
from ringsweep.physics.drives import next_knot
from ringsweep.physics.friction import DYNAMIC, SET_VALUED, SMOOTH
from ringsweep.solvers import rosenbrock

# Steps and events in a row at one instant after which a run is given up.
_STALLED = 400

# Parts of an implicit step at whose ends guards are looked at where one of them may vanish.
_INSTANTS = 4

# Coefficients of the polynomial through the values at these instants.
_THROUGH = np.ascontiguousarray(np.linalg.inv(np.vander(np.linspace(0.0, 1.0, _INSTANTS + 1), increasing=True)))

# Guards of an implicit step, at most.
_MOST_GUARDS = 6

# How much larger the relative error of a step may be in the friction of bristles than in the state.
_PUSH = 100.0


class Audit(NamedTuple):
    """What a run has shown of its law at instants that the solver did not choose.

    ``breach`` is the largest violation, measured by what the tolerance of a step makes of it; ``unexplained`` what of
    the changes of the mechanical energy is not work of friction, J; ``turnover`` the sum of the magnitudes of both.
    """

    breach: float
    unexplained: float
    turnover: float


# Fractions of a step at which the law is checked: Gauss's, which make a quadrature of the work of friction as well.
_EARLY, _LATE = 0.5 - 0.5 / sqrt(3.0), 0.5 + 0.5 / sqrt(3.0)

# Share of the energy itself that counts as turned over in a step: without friction what it loses is rounding.
_STORED = 1e-5

# The law is checked in so many steps at first, then in this share of them, which no period of the motion can evade.
_ALL_CHECKED, _CHECKED = 8, 0.25


@inlined
def _is_checked(n):
    """Whether the law is checked in step `n`."""
    return n <= _ALL_CHECKED or (n * 0.6180339887498949) % 1.0 < _CHECKED


@inlined
def _entered(audit, first, second, begins, ends, s):
    """Audit after a step of length `s`, checked at two instants; `begins` and `ends` are energies."""
    (breach_1, power_1), (breach_2, power_2) = first, second
    worst = max(audit.breach, max(breach_1, breach_2))
    work, change = 0.5 * s * (power_1 + power_2), ends - begins
    return Audit(
        worst if isfinite(work) else inf,
        audit.unexplained + (change - work),
        audit.turnover + 0.5 * s * (abs(power_1) + abs(power_2)) + abs(change) + _STORED * (abs(begins) + abs(ends)),
    )


@inlined
def _audit_series(scene, mode, c, t, s, y, y_next, tolerance, audit):
    """Audit after a step of length `s` along the series `c`, from the state `y` at time `t` to the state `y_next`."""
    first = _breach_along(scene, mode, c, t, s, tolerance, _EARLY * s)
    second = _breach_along(scene, mode, c, t, s, tolerance, _LATE * s)
    begins, ends = energy(scene, forcing(scene, t), y), energy(scene, forcing(scene, t + s), y_next)
    return _entered(audit, first, second, begins, ends, s)


@inlined
def _breach_along(scene, mode, c, t, s, tolerance, at):
    state, rates = land(scene, mode, c, t + at, at), drift(scene, mode, c, at)
    return breach(scene, mode, forcing(scene, t + at), state, rates, s, tolerance)


@inlined
def _audit_creep(scene, mode, t, s, y, y_next, stages, tolerance, audit):
    """The same of an implicit step from the state `y` to `y_next`."""
    begin, end = forcing(scene, t), forcing(scene, t + s)
    x, x_next = to_stiff(scene, begin, y), to_stiff(scene, end, y_next)
    first = _breach_within(scene, mode, t, s, x, x_next, stages, tolerance, _EARLY)
    second = _breach_within(scene, mode, t, s, x, x_next, stages, tolerance, _LATE)
    return _entered(audit, first, second, energy(scene, begin, y), energy(scene, end, y_next), s)


@inlined
def _breach_within(scene, mode, t, s, x, x_next, stages, tolerance, fraction):
    force = forcing(scene, t + fraction * s)
    state = from_stiff(scene, force, rosenbrock.dense(x, x_next, stages, fraction))
    return breach(scene, mode, force, state, rosenbrock.dense_rates(x, x_next, stages, fraction, s), s, tolerance)


@inlined
def _fall_of_creep(scene, mode, t, s, y, y_next, stages, guard):
    """How fast a guard falls as an implicit step ends by it, 1/s times its unit."""
    x, x_next = to_stiff(scene, forcing(scene, t), y), to_stiff(scene, forcing(scene, t + s), y_next)
    late = stiff_view(scene, mode, t + 0.9 * s, rosenbrock.dense(x, x_next, stages, 0.9))
    return late[0][guard] / (0.1 * s)


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
def _locate(scene, mode, t, x, line, h, f_high, g, stages):
    """Step at which guard `g` reaches zero, which after a step `h` is `f_high`, not positive; by steps of that length.

    The method itself, not an interpolant of it, is solved for the event.
    """
    low, high = 0.0, h
    f_low = stiff_view(scene, mode, t, x)[0][g]
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
    early = stiff_view(scene, mode, t + 0.25 * s, rosenbrock.dense(x, x_next, stages, 0.25))
    late = stiff_view(scene, mode, t + 0.75 * s, rosenbrock.dense(x, x_next, stages, 0.75))
    nearness = stiff_near(scene, within[1])
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
    while first <= _INSTANTS and samples[first] >= 0.0:
        first += 1
    end = first / _INSTANTS if first <= _INSTANTS else 0.0
    if samples[0] <= 0.0:
        return end
    row = work[0]
    for k in range(ORDER + 1):
        row[k] = 0.0
        if k <= _INSTANTS:
            for i in range(_INSTANTS + 1):
                row[k] += _THROUGH[k, i] * samples[i]
    root, found = first_root(row, 1.0, work[1:])
    if not found or (end > 0.0 and root > end - 1.0 / _INSTANTS):
        return end
    # A dip between two instants: its bottom.
    lowest, bottom = 0.0, 0.0
    for i in range(1, 33):
        at = root + (1.0 / _INSTANTS) * i / 32.0
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
def _creep(scene, record, mode, t, y, x, line, trial, horizon, tolerance, guards, stages, seen, work):
    """One accepted implicit step from the state `y`, which is `x` in its own coordinates, cut at the first event.

    Returns
    -------
    tuple
        Guard or -1, length of the step (negative if none was found), state, record, next :class:`Trial`.
    """
    scales = stiff_scales(scene, tolerance, x)
    s = min(trial.h, horizon)
    event, end, near = -1, s, False
    before = stiff_view(scene, mode, t, x)
    within, after = before, before
    for _ in range(200):
        x_next, error = rosenbrock.step(scene, mode, t, x, line, s, stages)
        size = _size(error, scales, line)
        if size <= 1.0:
            within = stiff_view(scene, mode, t + 0.5 * s, rosenbrock.dense(x, x_next, stages, 0.5))
            after = stiff_view(scene, mode, t + s, x_next)
            event, end = -1, s
            near, nearness = False, stiff_near(scene, within[1])
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
        within = stiff_view(scene, mode, t + 0.5 * end, rosenbrock.dense(x, x_next, stages, 0.5))
        after = stiff_view(scene, mode, t + end, x_next)
    moments, count = work[0], 0
    velocity, acceleration = stiff_motion(scene, t, x, line)
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
        for i in range(1, _INSTANTS):
            moments[count] = i / _INSTANTS
            count += 1
    else:
        moments[count] = 0.5
        count += 1
    ascending(moments, count)
    done = 0.0
    for j in range(count):
        view = within
        if moments[j] != 0.5:
            view = stiff_view(scene, mode, t + moments[j] * end, rosenbrock.dense(x, x_next, stages, moments[j]))
        record = stiff_watch(scene, record, mode, view, t + moments[j] * end, (moments[j] - done) * end)
        done = moments[j]
    record = stiff_watch(scene, record, mode, after, t + end, (1.0 - done) * end)
    return event, end, from_stiff(scene, forcing(scene, t + end), x_next), record, trial


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
def _stride(law, scene, record, mode, t, y, trial, horizon, tolerances, c, guards, work, stages, seen):
    """One step in the way that the family of the law wants.

    Returns
    -------
    tuple
        Whether the step was implicit, guard or -1, length of the step, state, record, next implicit step to try.
    """


@_stride.implements(*SET_VALUED)
def _series_stride(law, scene, record, mode, t, y, trial, horizon, tolerances, c, guards, work, stages, seen):
    guard, s, y, record = _along(scene, record, mode, t, y, horizon, tolerances[0], c, guards, work)
    return False, guard, s, y, record, trial


@_stride.implements(*SMOOTH)
def _either_stride(law, scene, record, mode, t, y, trial, horizon, tolerances, c, guards, work, stages, seen):
    if creeps(scene, mode):
        x = to_stiff(scene, forcing(scene, t), y)
        line = linearise(scene, mode, t, x)
        if is_stiff(scene, mode, y, line):
            if trial.last == 0.0:
                # What is left of the way in ends at the rate of the decay.
                trial = Trial(min(trial.h, -1.0 / line[1][3]), 0.0, 0.0)
            guard, s, y, record, trial = _creep(
                scene, record, mode, t, y, x, line, trial, horizon, tolerances[1], guards, stages, seen, work
            )
            return True, guard, s, y, record, trial
    guard, s, y, record = _along(scene, record, mode, t, y, horizon, tolerances[0], c, guards, work)
    return False, guard, s, y, record, Trial(1e-6 * scene.span, 0.0, 0.0)


@_stride.implements(*DYNAMIC)
def _implicit_stride(law, scene, record, mode, t, y, trial, horizon, tolerances, c, guards, work, stages, seen):
    x = to_stiff(scene, forcing(scene, t), y)
    line = linearise(scene, mode, t, x)
    guard, s, y, record, trial = _creep(
        scene, record, mode, t, y, x, line, trial, horizon, tolerances[1], guards, stages, seen, work
    )
    return True, guard, s, y, record, trial


@hook
def _audited(law, scene, mode, implicit, c, t, s, y, y_next, stages, tolerance, audit):
    """Audit after a step of length `s` from the state `y` at time `t`."""


@_audited.implements(*SET_VALUED)
def _series_audited(law, scene, mode, implicit, c, t, s, y, y_next, stages, tolerance, audit):
    return _audit_series(scene, mode, c, t, s, y, y_next, tolerance, audit)


@_audited.implements(*SMOOTH)
def _either_audited(law, scene, mode, implicit, c, t, s, y, y_next, stages, tolerance, audit):
    if implicit:
        return _audit_creep(scene, mode, t, s, y, y_next, stages, tolerance, audit)
    return _audit_series(scene, mode, c, t, s, y, y_next, tolerance, audit)


@_audited.implements(*DYNAMIC)
def _implicit_audited(law, scene, mode, implicit, c, t, s, y, y_next, stages, tolerance, audit):
    return _audit_creep(scene, mode, t, s, y, y_next, stages, tolerance, audit)


@hook
def _fall(law, scene, mode, implicit, c, t, s, y, y_next, stages, guard, first):
    """How fast a guard falls as a step ends by it; `first` is the first guard."""


@_fall.implements(*SET_VALUED)
def _series_fall(law, scene, mode, implicit, c, t, s, y, y_next, stages, guard, first):
    return -slope(c[guard], s)


@_fall.implements(*SMOOTH)
def _either_fall(law, scene, mode, implicit, c, t, s, y, y_next, stages, guard, first):
    if implicit:
        return _fall_of_creep(scene, mode, t, s, y, y_next, stages, guard - first)
    return -slope(c[guard], s)


@_fall.implements(*DYNAMIC)
def _implicit_fall(law, scene, mode, implicit, c, t, s, y, y_next, stages, guard, first):
    return _fall_of_creep(scene, mode, t, s, y, y_next, stages, guard - first)


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
        return stiff_sample(scene, mode, t, to_stiff(scene, forcing(scene, t), y))
    return sample(scene, mode, c, t, s)


@_row.implements(*DYNAMIC)
def _implicit_row(law, scene, mode, implicit, c, t, s, y):
    return stiff_sample(scene, mode, t, to_stiff(scene, forcing(scene, t), y))


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
def integrate(batch, tolerances, limit, out, steps, shown, spacing, times, table):
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
    shown : ndarray of shape ``(cells, 3)`` or ``(0, 3)``
        Filled, unless it is empty, with what each run has shown of its law: the largest violation, measured by what the
        tolerance of a step makes of it; the share of the energy turned over that is not work of friction; how fast the
        guard fell by which the run ended.
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
    seen = np.empty((_MOST_GUARDS, _INSTANTS + 1))
    return _integrate(batch, tolerances, limit, out, steps, shown, spacing, times, table, guards, c, work, stages, seen)


@inlined
def _integrate(batch, tolerances, limit, out, steps, shown, spacing, times, table, guards, c, work, stages, seen):
    c, work, stages, seen = borrowed(c), borrowed(work), borrowed(stages), borrowed(seen)
    out, steps, shown, times, table = borrowed(out), borrowed(steps), borrowed(shown), borrowed(times), borrowed(table)
    audited = len(shown) > 0
    kept = 0
    for i in range(len(steps)):
        scene = take(batch, i)
        t, y = embark(scene)
        status, mode = enter(scene, t, y)
        record = _outset(scene.law, scene, mode, t, y, tolerances, c)
        trial = Trial(1e-6 * scene.span, 0.0, 0.0)
        audit, fall = Audit(0.0, 0.0, 0.0), 0.0
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
                scene.law, scene, record, mode, t, y, trial, horizon, tolerances, c, guards, work, stages, seen
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
            if audited and s > 0.0 and _is_checked(n):
                audit = _audited(scene.law, scene, mode, implicit, c, t, s, y, y_next, stages, tolerances[0], audit)
            last, begun = mode, y
            t, status, mode, y = _arrive(scene, mode, guard, t, s, horizon, y_next)
            if audited and status != RUNNING and guard >= 0 and s > 0.0:
                fall = _fall(scene.law, scene, last, implicit, c, before, s, begun, y_next, stages, guard, guards)
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
        if audited:
            shown[i, 0] = audit.breach
            shown[i, 1] = abs(audit.unexplained) / audit.turnover if audit.turnover > 0.0 else 0.0
            shown[i, 2] = fall
    return kept
