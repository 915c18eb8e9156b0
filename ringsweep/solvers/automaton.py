"""Piecewise-smooth integration: a run passes from mode to mode, and the first guard that vanishes ends a mode.

Within a mode a step uses a power series (:mod:`taylor`) or is implicit (:mod:`creep`). The family of the friction law
decides which of them a kernel contains. Set-valued laws take series only. Laws with bristles take implicit steps only.
Smooth laws take implicit steps where a mode relaxes much faster than it moves, and series elsewhere.

Read :mod:`ringsweep.models.interface.modes` first. :func:`integrate` is what methods call; its loop takes one step
with :func:`_step_in`, then :func:`_after_step` says which mode follows. `tolerances` are the relative errors allowed
to a step of a series and to an implicit step; `guard` is the index of the guard that ended a step, or -1.
"""

from __future__ import annotations

from math import inf, isfinite
from typing import Any, NamedTuple

from ringsweep.compile import Cells, borrowed, feature, hook, inlined, kernel, replacing, take
from ringsweep.models.interface import audit as audit_of_model
from ringsweep.models.interface import implicit, modes, recorder, series, simpler, variation
from ringsweep.models.interface.status import BROKEN, COMPLETE, JAM, RUNNING
from ringsweep.numerics.clock import Instant, later
from ringsweep.physics import drives, ring
from ringsweep.physics.friction import Dynamic, SetValued, Smooth, family
from ringsweep.physics.friction.velocity import stiction_band
from ringsweep.solvers.audit import Audit, audit_step, fall_rate, is_checked
from ringsweep.solvers.creep import StepControl, implicit_step, start_at, start_control
from ringsweep.solvers.steps import Step, either, scratch_for, without_counts
from ringsweep.solvers.taylor import series_step
from ringsweep.solvers.variation import at_event, within_turn

# A run ends after this many consecutive steps and events at one instant.
_MOST_STALLED = 400

# Share of the error of the velocity that the place keeps after an implicit step, found by experiment.
_DAMPED = 0.03

# By kind of cells: number of series in the table, and row of the first guard.
_SHAPES: dict[Any, tuple[int, int]] = {}

#: A run is given up if, at the pace of so many steps, it would exceed its largest number of steps.
PATIENCE = 1_000_000


_with_length, _with_entry_guard = replacing("h"), replacing("entry_guard")


class LocalErrors(NamedTuple):
    """Errors of the steps of a run, for what the difference from a run at a looser tolerance does not show.

    Both runs share a step if something else than the tolerance limits its length: an event, a knot of the drive, the
    span, the growth of steps after a start, or the steepness of a friction law. And the sums of the errors of all steps
    may agree by chance.

    Attributes
    ----------
    series, last : float
        Sum over the shared steps of series, in units of the tolerance, and the last of them; 0 after an implicit step.
    rate : float
        The same for the rate of the place, rad/s, or on a belt m/s: in stick, where the tolerance applies to the place
        alone and the error is the difference from the velocity of the drive at the end of the step; and on bristles,
        where the tolerance of the velocity is relative to the sliding velocity.
    implicit : float
        Sum over the shared implicit steps, in units of the tolerance; without bristles of the error of the place, or of
        a share of that of the velocity, which friction damps.
    all_series : float
        Sum over all steps of series, in units of the tolerance.
    place : float
        Sum over all implicit steps under a smooth law, in units of the tolerance: of the distance that the body would
        go within the step at the difference of its velocity, in the middle of the step, from the rate of its place.
    """

    series: float
    last: float
    rate: float
    implicit: float
    all_series: float
    place: float


#: Numbers of the audit of a run; see :class:`Results`.
AUDITED = 3 + len(LocalErrors._fields)


class Run(NamedTuple):
    """A run between two steps.

    Attributes
    ----------
    record, mode : NamedTuple
        As the model makes them.
    now : Instant
        Time, s.
    y : tuple of float
        State of the mode.
    control : StepControl
        Control of the next implicit step.
    local : LocalErrors
    has_switched : bool
        Whether the mode has just begun.
    """

    record: Any
    mode: Any
    now: Instant
    y: Any
    control: StepControl
    local: LocalErrors
    has_switched: bool


@hook(absorb=True)
def _step_of_family(family, scene, run, h_max, tolerances, scratch):
    """One step of the kind that the family of the friction law needs.

    Parameters
    ----------
    family : SetValued, Smooth or Dynamic
        Family of the friction law.
    scene : NamedTuple
    run : Run
    h_max : float
        Greatest length of the step, s.
    tolerances : tuple of float
        As in :func:`integrate`.
    scratch : Scratch

    Returns
    -------
    tuple
        Whether the step was implicit; the guard that ended it, or -1; its length, s; state, record, control of the next
        implicit step and local errors after it.
    """


@inlined
def _step_if_stiff(scene, run, h_max, tolerance, scratch):
    """Whether a mode is stiff, and what :func:`implicit_step` returns if it is.

    The arguments are those of :func:`_step_of_family`; `tolerance` is that of implicit steps.
    """
    start, control = start_at(scene, scratch.course, run.mode, run.now, run.y), run.control
    if not implicit.is_stiff(scene, run.mode, run.y, start.linear):
        return False, -1, 0.0, run.y, run.record, control, (0.0, 0.0, 0.0, 0.0)
    if control.last_h == 0.0:
        # The transient into creep decays at this rate.
        control = start_control(min(control.h, -1.0 / start.linear[1][1][1]))
    guard, s, y, record, control, error = implicit_step(scene, run.record, start, control, h_max, tolerance, scratch)
    return True, guard, s, y, record, control, error


@_step_of_family.implements(SetValued)
def _step_by_series(family, scene, run, h_max, tolerances, scratch):
    """Implement :func:`_step_of_family`: by a series in each mode; the implicit control is passed through."""
    guard, s, y, record, error, shared = series_step(scene, run, h_max, tolerances[0], scratch, inf)
    rate = 0.0
    if shared > 0.0 and modes.sticks(scene, run.mode):
        # The body moves as the drive does. After an infinite acceleration of the drive steps are so short that a bound
        # that follows from the error of the place, divided by the length of the step, would say nothing.
        velocity = drives.turn(scene.drive, later(run.now, s))[1]
        rate = abs(series.rates_at(scene, scratch.c, s)[0] - velocity) / tolerances[0]
    before = run.local
    local = LocalErrors(before.series + shared, shared, before.rate + rate, 0.0, before.all_series + error, 0.0)
    return False, guard, s, y, record, run.control, local


@inlined
def _goes_on(scene, run, guard, record):
    """Record after a step under a smooth law that no event ended: the next step may be of the other kind."""
    return recorder.after_event(scene, record, run.mode, run.mode, run.now.t) if guard < 0 else record


@_step_of_family.implements(Smooth)
def _step_by_stiffness(family, scene, run, h_max, tolerances, scratch):
    """Implement :func:`_step_of_family`: implicit in a stiff stiction band, by a series elsewhere."""
    band, before = inf, run.local
    # A mode relaxes fast in the stiction band alone.
    if run.mode.region < 0:
        band = stiction_band(scene.law)
        is_stiff, guard, s, y, record, control, error = _step_if_stiff(scene, run, h_max, tolerances[1], scratch)
        if is_stiff:
            record = _goes_on(scene, run, guard, record)
            before_implicit, place = before.implicit + max(error[1], _DAMPED * error[0]), before.place + error[3]
            local = LocalErrors(before.series, 0.0, 0.0, before_implicit, before.all_series, place)
            return True, guard, s, y, record, control, local
    guard, s, y, record, error, shared = series_step(scene, run, h_max, tolerances[0], scratch, band)
    all_series = before.all_series + error
    local = LocalErrors(before.series + shared, shared, 0.0, before.implicit, all_series, before.place)
    return False, guard, s, y, _goes_on(scene, run, guard, record), start_control(scene.span), local


@_step_of_family.implements(Dynamic)
def _step_implicitly(family, scene, run, h_max, tolerances, scratch):
    """Implement :func:`_step_of_family`: always implicit."""
    start = start_at(scene, scratch.course, run.mode, run.now, run.y)
    guard, s, y, record, control, error = implicit_step(
        scene, run.record, start, run.control, h_max, tolerances[1], scratch
    )
    rate = run.local.rate + error[2] / (ring.radius(scene.body) * tolerances[1])
    local = LocalErrors(0.0, 0.0, rate, run.local.implicit + error[0], 0.0, 0.0)
    return True, guard, s, y, record, control, local


@feature("_step_of_family(family(scene.law), scene, run, h_max, tolerances, scratch)", of=simpler.PARTED, absorb=True)
def _step_in(scene, run, h_max, tolerances, scratch):
    """One step of a scene, or of the simpler scene whose mode it is in; see :func:`_step_of_family`."""
    if not simpler.is_simpler(scene, run.mode):
        return _step_of_family(family(scene.law), scene, run, h_max, tolerances, scratch)
    part, record, y = simpler.simplify(scene, run.record, run.mode, run.y)
    run_of_part = Run(record, run.mode, run.now, y, run.control, run.local, run.has_switched)
    is_implicit, guard, s, y, record, control, local = _step_of_family(
        family(scene.law), part, run_of_part, h_max, tolerances, scratch
    )
    record, y = simpler.rejoined(scene, run.record, run.mode, record, y, scratch.c)
    return is_implicit, guard, s, y, record, control, local


@hook
def _seen_at_launch(family, scene, mode, now, y, tolerances, c):
    """What the recorder is shown at `now` in the state `y` of a mode; fills the table `c` for series."""


@_seen_at_launch.implements(SetValued, Smooth)
def _seen_by_series(family, scene, mode, now, y, tolerances, c):
    """Implement :func:`_seen_at_launch`."""
    series.fill_table(scene, mode, now, y, tolerances[0], c)
    return series.seen_at_start(scene, c)


@_seen_at_launch.implements(Dynamic)
def _seen_implicitly(family, scene, mode, now, y, tolerances, c):
    """Implement :func:`_seen_at_launch`."""
    return _seen_in(scene, mode, drives.turn(scene.drive, now), y)


@inlined
def _seen_in(scene, mode, forcing, y):
    """What the recorder is shown of a state, by the equations of implicit steps."""
    x = implicit.to_implicit(scene, forcing, y)
    common = implicit.common(scene, mode, forcing, x)
    return implicit.seen(scene, implicit.guards_and_motion(scene, mode, common, forcing, x))


def _row_of_series(family, scene, step, c, s, y):
    """Row of a time history, the time `s` after the beginning of a step, where the state is `y`."""
    forcing, seen = drives.turn(scene.drive, later(step.now, s)), series.seen_at(scene, step.mode, c, s, s)
    return modes.row(scene, step.mode, forcing, series.state_at(scene, c, s), seen)


def _row_in_implicit_step(family, scene, step, c, s, y):
    """Row of a history at the state `y` of a mode, `s` after the beginning of an implicit step."""
    forcing = drives.turn(scene.drive, later(step.now, s))
    return modes.row(scene, step.mode, forcing, y, _seen_in(scene, step.mode, forcing, y))


_history_row = either(_row_of_series, _row_in_implicit_step)


@inlined
def _until(limit, now):
    """Time from the instant `now` to the instant `limit`, s."""
    return (limit.t - now.t) + (limit.rest - now.rest)


@inlined
def _after_step(scene, mode, guard, now, s, limit, y):
    """``(now, status, mode, y)`` after a step of length `s`, at most up to `limit`, that `guard` ended (-1: none)."""
    # The sum of steps must not miss the end of the span, or a knot of the drive, by rounding.
    if s >= 0.0:
        now = later(now, s) if s < _until(limit, now) else limit
    if not (isfinite(y[0]) and isfinite(y[1])):
        return now, BROKEN, mode, y
    if not s >= 0.0:
        return now, modes.status_when_stalled(scene, mode, now, y), mode, y
    if guard >= 0:
        status, mode, y = modes.switch(scene, mode, guard, now, y)
        return now, status, mode, y
    if now.t >= scene.span:
        return now, COMPLETE, mode, y
    return now, RUNNING, _with_entry_guard(mode, -1) if s > 0.0 else mode, y


@inlined
def _copy_into(row, values):
    """Copy a tuple of numbers into the first columns of a row."""
    for k in range(len(values)):
        row[k] = values[k]


@feature("(False, RUNNING, mode, y)")
def _pass_knot(held, scene, course, mode, now, y):
    """Whether force or drive switch at an instant; status, mode and state from then on.

    `held` is what :func:`ringsweep.physics.drives.held_of` returns. The velocity of the drive may jump; the body keeps
    its velocity in space.
    """
    before = drives.turn(scene.drive, now)[1]
    if not drives.pass_knot(scene.drive, now):
        return False, RUNNING, mode, y
    drives.new_course(course)
    jump = drives.turn(scene.drive, now)[1] - before
    if abs(jump) <= drives.least_jump(scene.drive):
        return True, RUNNING, mode, y
    status, mode, y = modes.after_jump(scene, mode, now, y, jump)
    return True, status, mode, y


class History(NamedTuple):
    """The history of a run.

    Attributes
    ----------
    spacing : float
        Greatest time between two rows, s.
    times, table : ndarray of shape ``(samples,)`` and ``(samples, variables)``
        Filled with the end of every step, and instants at most `spacing` apart within a step. A run that fills them
        stops there. If they are empty, no history is stored.
    """

    spacing: float
    times: Any
    table: Any


@inlined
def _store_row(scene, step, c, s, y, history, count):
    """Store the row of :func:`_history_row`, and return the new number of rows; a full history stays."""
    times = history.times
    if count == len(times):
        return count
    _copy_into(history.table[count], _history_row(family(scene.law), scene, step, c, s, y))
    # Rounding must not make times decrease.
    t = later(step.now, s).t
    times[count] = max(t, times[count - 1]) if count > 0 else t
    return count + 1


@inlined
def _store_step(scene, step, c, just_switched, history, count):
    """Store the rows of a step, the first of them only if its mode has just begun, and return the number of rows."""
    if step.s > 0.0:
        parts = 1 if step.is_implicit else int(step.s / history.spacing) + 1
        for part in range(0 if just_switched else 1, parts + 1):
            state = step.y if part == 0 else step.y_next
            # Rounded otherwise, the end of a mode would not be the instant at which the next one begins.
            at = step.s if part == parts else step.s * part / parts
            count = _store_row(scene, step, c, at, state, history, count)
    return count


class Results(NamedTuple):
    """Arrays that the runs of a batch fill.

    Attributes
    ----------
    rows : ndarray of shape ``(cells, outcomes)``
        Outcomes. It may have no columns.
    steps : ndarray of shape ``(cells,)``
        Numbers of steps.
    audits : ndarray of shape ``(cells, AUDITED)`` or ``(0, AUDITED)``
        Unless empty, the audit of each run: the largest violation of the friction law, in units of the violation that
        the tolerance would explain; the share of the energy turnover that is not work of friction; the rate at which
        the reaction that ended the run fell, N/s, infinite if something else did; :class:`LocalErrors`.
    """

    rows: Any
    steps: Any
    audits: Any


def integrate(batch, tolerances, max_steps, results, history):
    """Run every cell of a batch to its end, or to `max_steps` steps.

    One kernel serves sweeps and histories, so that each type of scene is compiled once.

    Parameters
    ----------
    batch : NamedTuple
        Cells, as :func:`ringsweep.models.batch` makes them.
    tolerances : tuple of float
        Relative error allowed to a step of the series, and to an implicit step; see
        :func:`ringsweep.models.interface.series.fill_table`.
    max_steps : int
        Steps after which a run is given up as failed. It is given up before if :data:`PATIENCE` steps gain so little
        time that it would not end within `max_steps`.
    results : Results
        Filled.
    history : History
        Filled with the history of the only cell.

    Returns
    -------
    int
        Number of rows of the history.
    """
    cells = Cells(batch)
    if cells.kind not in _SHAPES:
        _SHAPES[cells.kind] = series.table_shape(take(batch, 0))
    count: int = _integrate(cells, tolerances, max_steps, results, history, scratch_for(*_SHAPES[cells.kind]))
    return count


@kernel
def _integrate(batch, tolerances, max_steps, results, history, scratch):
    """Run every cell; see :func:`integrate`."""
    scratch = without_counts(scratch)
    c = scratch.c
    rows, steps, audits = borrowed(results.rows), borrowed(results.steps), borrowed(results.audits)
    history = History(history.spacing, borrowed(history.times), borrowed(history.table))
    spacing = history.spacing
    audited = len(audits) > 0
    count = 0
    for i in range(len(steps)):
        scene = take(batch, i)
        drives.new_course(scratch.course)
        drives.pass_knot(scene.drive, Instant(0.0, 0.0))
        t, y, status, mode = modes.begin(scene)
        now = Instant(t, 0.0)
        seen = _seen_at_launch(family(scene.law), scene, mode, now, y, tolerances, c)
        if status != RUNNING:
            seen = recorder.at_once(scene, status, mode, now, y, seen)
        record = recorder.lend(scene, recorder.begin(scene, now.t, seen), take(rows, i))
        record = recorder.after_event(scene, record, mode, mode, t)
        control = start_control(1e-6 * scene.span)
        audit, guard_fall_rate, local = Audit(0.0, 0.0, 0.0), 0.0, LocalErrors(0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
        n = stalled = 0
        t_before, s = t, scene.span
        t_judged, least_gain = t, scene.span * (PATIENCE / max_steps)
        just_switched = True
        while status == RUNNING:
            # Near a jam, steps shorter than the rounding of time still move the state, but not for ever.
            t = now.t
            stalled = stalled + 1 if modes.is_lost(scene, t_before, s) else 0
            if n == max_steps or stalled == _MOST_STALLED:
                status = modes.status_when_stalled(scene, mode, now, y) if stalled == _MOST_STALLED else BROKEN
                break
            if n > 0 and n % PATIENCE == 0:
                # NaN is no gain either.
                if not t - t_judged >= least_gain:
                    status = BROKEN
                    break
                t_judged = t
            t_before = t
            n += 1
            limit, knot = within_turn(variation.asked(scene), t, scene.span), drives.knot_after(scene.drive, now)
            limit = knot if knot.t < limit else Instant(limit, 0.0)
            h_max = _until(limit, now)
            control = _with_length(control, min(control.h, spacing))
            run = Run(record, mode, now, y, control, local, just_switched)
            is_implicit, guard, s, y_next, record, control, local = _step_in(scene, run, h_max, tolerances, scratch)
            step = Step(mode, is_implicit, now, s, y, y_next)
            if len(history.times) > 0:
                if count == len(history.times):
                    return count
                count = _store_step(scene, step, c, just_switched, history, count)
            just_switched = guard >= 0 or (just_switched and s == 0.0)
            if audited and s > 0.0 and is_checked(n):
                audit = audit_step(family(scene.law), scene, step, scratch, tolerances[0], audit)
            now, status, mode, y = _after_step(scene, mode, guard, now, s, limit, y_next)
            if guard >= 0 and s > 0.0:
                record = recorder.as_mode_ends(scene, record, step.mode, guard, now, y_next)
            if status == RUNNING and _until(limit, now) == 0.0:
                is_knot, status, mode, y = _pass_knot(drives.held_of(scene.drive), scene, scratch.course, mode, now, y)
                just_switched = just_switched or is_knot
            if guard >= 0:
                record = at_event(variation.asked(scene), scene, record, step.mode, guard, now, y_next)
                record = recorder.after_event(scene, record, step.mode, mode, now.t)
            # The regime of a run that goes on after a loss is that loss: what ends the run later does not count.
            decides = status != RUNNING or modes.first_loss(scene, step.mode, mode)
            if audited and guard >= 0 and s > 0.0 and decides and guard_fall_rate == 0.0:
                # A reaction that jumps to zero at another event does not rise again before.
                falls = audit_of_model.is_reaction(scene, guard)
                guard_fall_rate = fall_rate(family(scene.law), scene, step, scratch, guard) if falls else inf
            if s == 0.0 and status != RUNNING:
                # The history must show the end of a mode that lasts no time.
                count = _store_row(scene, step, c, 0.0, y, history, count)
        if count < min(1, len(history.times)):
            # A run that ends at launch has a history of one row.
            history.times[0] = now.t
            _copy_into(history.table[0], modes.row(scene, mode, drives.turn(scene.drive, now), y, seen))
            count = 1
        if status == JAM:
            s, y, normals = modes.limit_of_jam(scene, mode, now, y)
            now = later(now, s)
            record = recorder.at_jam(scene, record, normals, modes.in_space(scene, now, y)[1])
        outcome = recorder.conclude(scene, record, status, now.t, *modes.in_space(scene, now, y))
        for k in range(min(len(outcome), rows.shape[1])):
            rows[i, k] = outcome[k]
        recorder.keep_memory(scene, rows[i], len(outcome), y)
        steps[i] = n
        if audited:
            unexplained = abs(audit.unexplained) / audit.turnover if audit.turnover > 0.0 else 0.0
            _copy_into(audits[i], (audit.violation, unexplained, guard_fall_rate))
            _copy_into(audits[i, 3:], local)
    return count
