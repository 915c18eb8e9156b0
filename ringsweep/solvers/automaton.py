"""Piecewise-smooth integration: a run passes from mode to mode, each ended by the first guard that vanishes.

Within a mode a step is one of a power series (:mod:`taylor`) or an implicit one (:mod:`creep`). The family of the
friction law decides which of both a kernel contains: a set-valued law takes series alone, a law with bristles implicit
steps alone, a smooth law takes implicit steps where a mode relaxes much faster than it moves.
"""

from __future__ import annotations

from math import isfinite

import numpy as np

from ringsweep.compile import borrowed, hook, inlined, kernel, take
from ringsweep.models.interface import implicit, modes, recorder, series
from ringsweep.models.interface.status import BROKEN, COMPLETE, RUNNING
from ringsweep.numerics.series import ORDER, STACK
from ringsweep.physics.drives import next_knot
from ringsweep.physics.friction import Dynamic, SetValued, Smooth, family
from ringsweep.solvers import rosenbrock
from ringsweep.solvers.audit import Audit, audit_step, fall_rate, is_checked
from ringsweep.solvers.creep import INSTANTS, MOST_GUARDS, Trial, implicit_step
from ringsweep.solvers.taylor import series_step

# Steps and events in a row at one instant after which a run is given up.
_STALLED = 400


@hook
def _stride(family, scene, record, mode, t, y, trial, horizon, tolerances, c, guards, work, stages, seen):
    """One step in the way that the family of the law wants.

    Returns
    -------
    tuple
        Whether the step was is_implicit, guard or -1, length of the step, state, record, next implicit step to try.
    """


@_stride.implements(SetValued)
def _series_stride(family, scene, record, mode, t, y, trial, horizon, tolerances, c, guards, work, stages, seen):
    guard, s, y, record = series_step(scene, record, mode, t, y, horizon, tolerances[0], c, guards, work)
    return False, guard, s, y, record, trial


@_stride.implements(Smooth)
def _either_stride(family, scene, record, mode, t, y, trial, horizon, tolerances, c, guards, work, stages, seen):
    if implicit.may_creep(scene, mode):
        x = implicit.to_implicit(scene, implicit.forcing(scene, t), y)
        line = implicit.linearise(scene, mode, t, x)
        if implicit.is_stiff(scene, mode, y, line):
            if trial.last == 0.0:
                # What is left of the way in ends at the rate of the decay.
                trial = Trial(min(trial.h, -1.0 / line[1][3]), 0.0, 0.0)
            guard, s, y, record, trial = implicit_step(
                scene, record, mode, t, y, x, line, trial, horizon, tolerances[1], guards, stages, seen, work
            )
            return True, guard, s, y, record, trial
    guard, s, y, record = series_step(scene, record, mode, t, y, horizon, tolerances[0], c, guards, work)
    return False, guard, s, y, record, Trial(1e-6 * scene.span, 0.0, 0.0)


@_stride.implements(Dynamic)
def _implicit_stride(family, scene, record, mode, t, y, trial, horizon, tolerances, c, guards, work, stages, seen):
    x = implicit.to_implicit(scene, implicit.forcing(scene, t), y)
    line = implicit.linearise(scene, mode, t, x)
    guard, s, y, record, trial = implicit_step(
        scene, record, mode, t, y, x, line, trial, horizon, tolerances[1], guards, stages, seen, work
    )
    return True, guard, s, y, record, trial


@hook
def _outset(family, scene, mode, t, y, tolerances, c):
    """Record of a run that begins."""


@_outset.implements(SetValued, Smooth)
def _series_outset(family, scene, mode, t, y, tolerances, c):
    series.expand(scene, mode, t, y, tolerances[0], c)
    return recorder.begin(scene, t, series.seen_at(scene, c, 0.0, 0.0))


@_outset.implements(Dynamic)
def _implicit_outset(family, scene, mode, t, y, tolerances, c):
    return recorder.begin(scene, t, implicit.seen(scene, implicit.guards_and_motion(scene, mode, t, y)))


@hook
def _row(family, scene, mode, is_implicit, c, t, s, y):
    """One row of a time history, after the part `s` of a step that began in the state `y` if it was a series."""


@_row.implements(SetValued)
def _series_row(family, scene, mode, is_implicit, c, t, s, y):
    return series.row(scene, mode, c, t, s)


@_row.implements(Smooth)
def _either_row(family, scene, mode, is_implicit, c, t, s, y):
    if is_implicit:
        return implicit.row(scene, mode, t, implicit.to_implicit(scene, implicit.forcing(scene, t), y))
    return series.row(scene, mode, c, t, s)


@_row.implements(Dynamic)
def _implicit_row(family, scene, mode, is_implicit, c, t, s, y):
    return implicit.row(scene, mode, t, implicit.to_implicit(scene, implicit.forcing(scene, t), y))


@inlined
def _arrive(scene, mode, guard, t, s, horizon, y):
    """Time, status, mode and state after a step `s` that ended at `guard`, or at none (-1)."""
    # To the very end of the span or of a piece of the drive, not to the rounding of a sum.
    if s >= 0.0:
        t = t + s if s < horizon else t + horizon
    if not (isfinite(y[0]) and isfinite(y[1])):
        return t, BROKEN, mode, y
    if not s >= 0.0:
        return t, modes.status_without_way_on(scene, mode, t, y), mode, y
    if guard >= 0:
        status, mode, y = modes.switch(scene, mode, guard, t, y)
        return t, status, mode, y
    if t >= scene.span:
        return t, COMPLETE, mode, y
    return t, RUNNING, series.after_first_step(mode) if s > 0.0 else mode, y


@inlined
def _store(row, values):
    for k in range(len(values)):
        row[k] = values[k]


@inlined
def _keep(scene, mode, is_implicit, c, t, s, y, times, table, kept):
    """Store the state after the part `s` of a step as row `kept` of a history that has room; the number of rows."""
    if kept == len(times):
        return kept
    _store(table[kept], _row(family(scene.law), scene, mode, is_implicit, c, t + s, s, y))
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
    count, guards = series.table_shape(first)
    c = np.zeros((count, ORDER + 3))
    work = np.empty((STACK, ORDER + 3))
    stages = np.empty((rosenbrock.STAGES, len(modes.initial_state(first)[1])))
    seen = np.empty((MOST_GUARDS, INSTANTS + 1))
    return _integrate(batch, tolerances, limit, out, steps, shown, spacing, times, table, guards, c, work, stages, seen)


@inlined
def _integrate(batch, tolerances, limit, out, steps, shown, spacing, times, table, guards, c, work, stages, seen):
    c, work, stages, seen = borrowed(c), borrowed(work), borrowed(stages), borrowed(seen)
    out, steps, shown, times, table = borrowed(out), borrowed(steps), borrowed(shown), borrowed(times), borrowed(table)
    audited = len(shown) > 0
    kept = 0
    for i in range(len(steps)):
        scene = take(batch, i)
        t, y = modes.initial_state(scene)
        status, mode = modes.initial_mode(scene, t, y)
        record = _outset(family(scene.law), scene, mode, t, y, tolerances, c)
        trial = Trial(1e-6 * scene.span, 0.0, 0.0)
        audit, fall = Audit(0.0, 0.0, 0.0), 0.0
        n = stalled = 0
        before = -1.0
        entered = True
        is_implicit = False
        while status == RUNNING:
            # Steps below the rounding of time do move the state, on the way into a jam, but not for ever.
            stalled = stalled + 1 if t == before else 0
            if n == limit or stalled == _STALLED:
                status = modes.status_without_way_on(scene, mode, t, y) if stalled == _STALLED else BROKEN
                break
            before = t
            n += 1
            horizon = min(scene.span, next_knot(scene.drive, t)) - t
            trial = Trial(min(trial.h, spacing), trial.last, trial.size)
            is_implicit, guard, s, y_next, record, trial = _stride(
                family(scene.law), scene, record, mode, t, y, trial, horizon, tolerances, c, guards, work, stages, seen
            )
            if len(times) > 0:
                if kept == len(times):
                    return kept
                if s > 0.0:
                    parts = 1 if is_implicit else int(s / spacing) + 1
                    for part in range(0 if entered else 1, parts + 1):
                        state = y if part == 0 else y_next
                        kept = _keep(scene, mode, is_implicit, c, t, s * part / parts, state, times, table, kept)
                entered = guard >= 0 or (entered and s == 0.0)
            if audited and s > 0.0 and is_checked(n):
                audit = audit_step(
                    family(scene.law), scene, mode, is_implicit, c, t, s, y, y_next, stages, tolerances[0], audit
                )
            last, begun = mode, y
            t, status, mode, y = _arrive(scene, mode, guard, t, s, horizon, y_next)
            if audited and status != RUNNING and guard >= 0 and s > 0.0:
                fall = fall_rate(
                    family(scene.law), scene, last, is_implicit, c, before, s, begun, y_next, stages, guard, guards
                )
            if s == 0.0 and status != RUNNING:
                # What a mode ends by that is over as it is entered is to be seen.
                kept = _keep(scene, last, is_implicit, c, t, 0.0, y, times, table, kept)
        if kept == 0:
            # A run that ends as it begins was somewhere all the same.
            kept = _keep(scene, mode, is_implicit, c, t, 0.0, y, times, table, kept)
        outcome = recorder.conclude(scene, record, status, t, *modes.in_space(scene, t, y))
        for k in range(min(len(outcome), out.shape[1])):
            out[i, k] = outcome[k]
        steps[i] = n
        if audited:
            shown[i, 0] = audit.violation
            shown[i, 1] = abs(audit.unexplained) / audit.turnover if audit.turnover > 0.0 else 0.0
            shown[i, 2] = fall
    return kept
