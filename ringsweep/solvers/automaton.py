"""Piecewise-smooth integration: a run passes from mode to mode, and the first guard that vanishes ends a mode.

Within a mode a step uses a power series (:mod:`taylor`) or is implicit (:mod:`creep`). The family of the friction law
decides which of them a kernel contains. Set-valued laws take series only. Laws with bristles take implicit steps only.
Smooth laws take implicit steps where a mode relaxes much faster than it moves, and series elsewhere.
"""

from __future__ import annotations

from math import isfinite
from typing import Any, NamedTuple

import numpy as np

from ringsweep.compile import Cells, borrowed, hook, inlined, kernel, take
from ringsweep.models.interface import implicit, modes, recorder, series
from ringsweep.models.interface.status import BROKEN, COMPLETE, RUNNING
from ringsweep.numerics.series import ORDER, STACK
from ringsweep.numerics.terms import COLUMNS
from ringsweep.physics import drives
from ringsweep.physics.friction import Dynamic, SetValued, Smooth, family
from ringsweep.solvers.audit import Audit, audit_step, fall_rate, is_checked
from ringsweep.solvers.creep import INSTANTS, MOST_GUARDS, StepControl, implicit_step
from ringsweep.solvers.taylor import series_step

# A run ends after this many consecutive steps and events at one instant.
_MOST_STALLED = 400

#: The second run of a certificate has a tolerance that is looser by this factor.
FACTOR = 30.0

# By kind of cells: number of series in the table, and of components of a state.
_SHAPES: dict[Any, tuple[int, int]] = {}

#: A run is given up if, at the pace of so many steps, it would exceed its largest number of steps.
PATIENCE = 1_000_000


class LocalErrors(NamedTuple):
    """Errors of the steps that a run and a run at a tolerance :data:`FACTOR` times looser share.

    An event, a knot of the drive or the span limits the length of these steps, and not the tolerance. So the difference
    between the runs does not show their errors.

    Attributes
    ----------
    series : float
        Sum over the steps of series, in units of the tolerance.
    rate : float
        The same for the velocity in stick, 1/s: the tolerance applies to the place alone.
    implicit : float
        Sum over the implicit steps, in units of the tolerance.
    creep : float
        Number of all implicit steps.
    """

    series: float
    rate: float
    implicit: float
    creep: float


@inlined
def _shared(s, reach):
    """Error of a step of length `s` of a series that meets the tolerance over a length `reach`, if it is shared."""
    share = s / reach if s > 0.0 else 0.0
    error = share**ORDER
    return error if error * FACTOR < 1.0 else 0.0


@inlined
def _after_creep(local, error):
    """Local errors after one more implicit step."""
    return LocalErrors(local.series, local.rate, local.implicit + error, local.creep + 1.0)


@hook
def _step(family, scene, record, mode, t, y, control, local, h_max, tolerances, c, first, work, course, bends, samples):
    """One step of the kind that the family of the friction law needs.

    Parameters
    ----------
    family : SetValued, Smooth or Dynamic
        Family of the friction law.
    scene, record, mode : NamedTuple
    t : float
        Time, s.
    y : tuple of float
        State at time `t`.
    control : StepControl
        Length of the next implicit step.
    local : LocalErrors
        Up to the step.
    h_max : float
        Greatest length of the step, s.
    tolerances : tuple of float
        As in :func:`integrate`.
    c : ndarray of shape ``(rows, columns)``
        Table of the series, which is filled.
    first : int
        Row of the first guard in the table.
    work, samples : ndarray
        Scratch.
    course : ndarray of shape ``COURSE_SHAPE``
        Series of the drive, see :func:`ringsweep.physics.drives.follow`.
    bends : ndarray of shape ``(2, 3, components)``
        As in :func:`ringsweep.solvers.creep.implicit_step`.

    Returns
    -------
    tuple
        Whether the step was implicit; the guard that ended it, or -1; its length, s; state, record, control and local
        errors after it.
    """


@_step.implements(SetValued)
def _step_series(
    family, scene, record, mode, t, y, control, local, h_max, tolerances, c, first, work, course, bends, samples
):
    guard, s, y, record, reach = series_step(scene, record, mode, t, y, h_max, tolerances[0], c, first, work)
    shared = _shared(s, reach)
    rate = shared * ORDER / s if shared > 0.0 and modes.sticks(scene, mode) else 0.0
    return False, guard, s, y, record, control, LocalErrors(local.series + shared, local.rate + rate, 0.0, 0.0)


@_step.implements(Smooth)
def _step_either(
    family, scene, record, mode, t, y, control, local, h_max, tolerances, c, first, work, course, bends, samples
):
    if implicit.may_creep(scene, mode):
        forcing = implicit.forcing(scene, course, t)
        x = implicit.to_implicit(scene, forcing, y)
        common = implicit.common(scene, mode, forcing, x)
        linear = implicit.linearise(scene, mode, common, t, forcing, x)
        if implicit.is_stiff(scene, mode, y, linear):
            if control.last_h == 0.0:
                # The transient into creep decays at this rate.
                control = StepControl(min(control.h, -1.0 / linear[1][3]), 0.0, 0.0)
            guard, s, y, record, control, error = implicit_step(
                scene,
                record,
                mode,
                t,
                y,
                x,
                forcing,
                common,
                course,
                linear,
                control,
                h_max,
                tolerances[1],
                first,
                bends,
                samples,
                work,
            )
            return True, guard, s, y, record, control, _after_creep(local, error)
    guard, s, y, record, reach = series_step(scene, record, mode, t, y, h_max, tolerances[0], c, first, work)
    control = StepControl(1e-6 * scene.span, 0.0, 0.0)
    local = LocalErrors(local.series + _shared(s, reach), local.rate, local.implicit, local.creep)
    return False, guard, s, y, record, control, local


@_step.implements(Dynamic)
def _step_implicit(
    family, scene, record, mode, t, y, control, local, h_max, tolerances, c, first, work, course, bends, samples
):
    forcing = implicit.forcing(scene, course, t)
    x = implicit.to_implicit(scene, forcing, y)
    common = implicit.common(scene, mode, forcing, x)
    linear = implicit.linearise(scene, mode, common, t, forcing, x)
    guard, s, y, record, control, error = implicit_step(
        scene,
        record,
        mode,
        t,
        y,
        x,
        forcing,
        common,
        course,
        linear,
        control,
        h_max,
        tolerances[1],
        first,
        bends,
        samples,
        work,
    )
    return True, guard, s, y, record, control, _after_creep(local, error)


@hook
def _begin(family, scene, mode, t, y, tolerances, c):
    """Record at the beginning of a run."""


@_begin.implements(SetValued, Smooth)
def _begin_series(family, scene, mode, t, y, tolerances, c):
    series.expand(scene, mode, t, y, tolerances[0], c)
    return recorder.begin(scene, t, series.seen_at_start(scene, c))


@_begin.implements(Dynamic)
def _begin_implicit(family, scene, mode, t, y, tolerances, c):
    forcing = drives.turn(scene.drive, t)
    x = implicit.to_implicit(scene, forcing, y)
    view = implicit.guards_and_motion(scene, mode, implicit.common(scene, mode, forcing, x), forcing, x)
    return recorder.begin(scene, t, implicit.seen(scene, view))


@hook
def _history_row(family, scene, mode, is_implicit, c, t, s, y):
    """Row of a time history.

    After a series `t` is the time of the row and `s` the time since the step began. After an implicit step `y` is the
    state of the row.
    """


@_history_row.implements(SetValued)
def _row_series(family, scene, mode, is_implicit, c, t, s, y):
    return series.row(scene, mode, c, t, s)


@_history_row.implements(Smooth)
def _row_either(family, scene, mode, is_implicit, c, t, s, y):
    if is_implicit:
        forcing = drives.turn(scene.drive, t)
        return implicit.row(scene, mode, forcing, implicit.to_implicit(scene, forcing, y))
    return series.row(scene, mode, c, t, s)


@_history_row.implements(Dynamic)
def _row_implicit(family, scene, mode, is_implicit, c, t, s, y):
    forcing = drives.turn(scene.drive, t)
    return implicit.row(scene, mode, forcing, implicit.to_implicit(scene, forcing, y))


@inlined
def _after_step(scene, mode, guard, t, s, h_max, y):
    """Time, status, mode and state after a step of length `s` that `guard` ended (-1: none)."""
    # The sum of steps must not miss the end of the span, or a knot of the drive, by rounding.
    if s >= 0.0:
        t = t + s if s < h_max else t + h_max
    if not (isfinite(y[0]) and isfinite(y[1])):
        return t, BROKEN, mode, y
    if not s >= 0.0:
        return t, modes.status_when_stalled(scene, mode, t, y), mode, y
    if guard >= 0:
        status, mode, y = modes.switch(scene, mode, guard, t, y)
        return t, status, mode, y
    if t >= scene.span:
        return t, COMPLETE, mode, y
    return t, RUNNING, series.after_first_step(mode) if s > 0.0 else mode, y


@inlined
def _fill(row, values):
    for k in range(len(values)):
        row[k] = values[k]


@inlined
def _store_row(scene, mode, is_implicit, c, t, s, y, times, table, count):
    """Store a row of the history, the time `s` after `t`, and return the new number of rows; a full history stays."""
    if count == len(times):
        return count
    _fill(table[count], _history_row(family(scene.law), scene, mode, is_implicit, c, t + s, s, y))
    # Rounding must not make times decrease.
    times[count] = max(t + s, times[count - 1]) if count > 0 else t
    return count + 1


def integrate(batch, tolerances, max_steps, rows, steps, audits, spacing, times, table):
    """Run every cell of a batch to its end, or to `max_steps` steps.

    One kernel serves sweeps and histories, so that each type of scene is compiled once.

    Parameters
    ----------
    batch : NamedTuple
        Cells, as :func:`ringsweep.models.batch` makes them.
    tolerances : tuple of float
        Relative error allowed to a step of the series, and to an implicit step. It applies to 1 rad, and to the
        velocity at 1 rad/s + \\|omega\\| or at the width of the stiction band.
    max_steps : int
        Steps after which a run is given up as failed. It is given up before if :data:`PATIENCE` steps gain so little
        time that it would not end within `max_steps`.
    rows : ndarray of shape ``(cells, outcomes)``
        Filled with outcomes. It may have no columns.
    steps : ndarray of shape ``(cells,)``
        Filled with the number of steps.
    audits : ndarray of shape ``(cells, 7)`` or ``(0, 7)``
        Unless empty, filled with the audit of each run: the largest violation of the friction law, in units of the
        violation that the tolerance would explain; the share of the energy turnover that is not work of friction; the
        rate at which the guard that ended the run fell, in its unit per second; :class:`LocalErrors`.
    spacing : float
        Greatest time between two rows of the history, s.
    times, table : ndarray of shape ``(samples,)`` and ``(samples, variables)``
        Filled with the history of the only cell: the end of every step, and instants at most `spacing` apart within a
        step. A run that fills them stops there. If they are empty, no history is stored.

    Returns
    -------
    int
        Number of rows of the history.
    """
    cells = Cells(batch)
    if cells.layout not in _SHAPES:
        sample = take(batch, 0)
        _SHAPES[cells.layout] = series.table_shape(sample)[0], len(modes.initial_state(sample)[1])
    size, components = _SHAPES[cells.layout]
    # NumPy's functions that make arrays would have to be compiled into each kernel.
    scratch = (
        np.zeros((size, COLUMNS)),
        np.empty((STACK, COLUMNS)),
        np.empty(drives.COURSE_SHAPE),
        np.empty((2, 3, components)),
        np.empty((MOST_GUARDS, INSTANTS + 1)),
    )
    count: int = _integrate(cells, tolerances, max_steps, rows, steps, audits, spacing, times, table, *scratch)
    return count


@kernel
def _integrate(
    batch, tolerances, max_steps, rows, steps, audits, spacing, times, table, c, work, course, bends, samples
):
    """Run every cell; see :func:`integrate`. The last arguments are scratch."""
    _, first = series.table_shape(take(batch, 0))
    c, work, course, bends, samples = (
        borrowed(c),
        borrowed(work),
        borrowed(course),
        borrowed(bends),
        borrowed(samples),
    )
    rows, steps, audits, times, table = (
        borrowed(rows),
        borrowed(steps),
        borrowed(audits),
        borrowed(times),
        borrowed(table),
    )
    audited = len(audits) > 0
    count = 0
    for i in range(len(steps)):
        scene = take(batch, i)
        drives.new_course(course)
        t, y = modes.initial_state(scene)
        status, mode = modes.initial_mode(scene, t, y)
        record = _begin(family(scene.law), scene, mode, t, y, tolerances, c)
        control = StepControl(1e-6 * scene.span, 0.0, 0.0)
        audit, guard_fall_rate, local = Audit(0.0, 0.0, 0.0), 0.0, LocalErrors(0.0, 0.0, 0.0, 0.0)
        n = stalled = 0
        t_before = -1.0
        t_judged, least_gain = t, scene.span * (PATIENCE / max_steps)
        just_switched = True
        is_implicit = False
        while status == RUNNING:
            # Near a jam, steps shorter than the rounding of time still move the state, but not for ever.
            stalled = stalled + 1 if t == t_before else 0
            if n == max_steps or stalled == _MOST_STALLED:
                status = modes.status_when_stalled(scene, mode, t, y) if stalled == _MOST_STALLED else BROKEN
                break
            if n > 0 and n % PATIENCE == 0:
                # NaN is no gain either.
                if not t - t_judged >= least_gain:
                    status = BROKEN
                    break
                t_judged = t
            t_before = t
            n += 1
            h_max = min(scene.span, drives.next_knot(scene.drive, t)) - t
            control = StepControl(min(control.h, spacing), control.last_h, control.last_factor)
            is_implicit, guard, s, y_next, record, control, local = _step(
                family(scene.law),
                scene,
                record,
                mode,
                t,
                y,
                control,
                local,
                h_max,
                tolerances,
                c,
                first,
                work,
                course,
                bends,
                samples,
            )
            if len(times) > 0:
                if count == len(times):
                    return count
                if s > 0.0:
                    parts = 1 if is_implicit else int(s / spacing) + 1
                    for part in range(0 if just_switched else 1, parts + 1):
                        state = y if part == 0 else y_next
                        # Rounded otherwise, the end of a mode would not be the instant at which the next one begins.
                        at = s if part == parts else s * part / parts
                        count = _store_row(scene, mode, is_implicit, c, t, at, state, times, table, count)
                just_switched = guard >= 0 or (just_switched and s == 0.0)
            if audited and s > 0.0 and is_checked(n):
                audit = audit_step(
                    family(scene.law), scene, mode, is_implicit, c, t, s, y, y_next, course, bends, tolerances[0], audit
                )
            mode_before, y_before = mode, y
            t, status, mode, y = _after_step(scene, mode, guard, t, s, h_max, y_next)
            if audited and status != RUNNING and guard >= 0 and s > 0.0:
                guard_fall_rate = fall_rate(
                    family(scene.law),
                    scene,
                    mode_before,
                    is_implicit,
                    c,
                    t_before,
                    s,
                    y_before,
                    y_next,
                    course,
                    bends,
                    guard,
                    first,
                )
            if s == 0.0 and status != RUNNING:
                # The history must show the end of a mode that lasts no time.
                count = _store_row(scene, mode_before, is_implicit, c, t, 0.0, y, times, table, count)
        if count == 0:
            # A run that ends at launch has a history of one row.
            count = _store_row(scene, mode, is_implicit, c, t, 0.0, y, times, table, count)
        outcome = recorder.conclude(scene, record, status, t, *modes.in_space(scene, t, y))
        for k in range(min(len(outcome), rows.shape[1])):
            rows[i, k] = outcome[k]
        steps[i] = n
        if audited:
            audits[i, 0] = audit.violation
            audits[i, 1] = abs(audit.unexplained) / audit.turnover if audit.turnover > 0.0 else 0.0
            audits[i, 2] = guard_fall_rate
            _fill(audits[i, 3:], local)
    return count
