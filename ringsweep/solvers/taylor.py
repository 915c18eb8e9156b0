"""One step of a power series, up to the first guard that vanishes.

The guards are power series on the same step. The first root of each is located to rounding, and no root is missed.

Read :mod:`ringsweep.models.interface.series` first. ``run`` is the :class:`ringsweep.solvers.automaton.Run` before
the step.
"""

from __future__ import annotations

from math import isnan, nan

from ringsweep.compile import inlined, replacing
from ringsweep.models.interface import modes, recorder, series, variation
from ringsweep.numerics.clock import later
from ringsweep.numerics.series import ORDER, ascending, divide_by_time, first_root
from ringsweep.numerics.terms import powers, terms, total
from ringsweep.solvers.steps import FACTOR
from ringsweep.solvers.variation import along_series, enter_series

# Largest error, in units of the tolerance, of the step that leaves the stiction band. Where friction falls with the
# speed it grows more than that of any other step, and two runs may err alike by chance.
_MOST_AT_EXIT = 0.5

_with_record = replacing("record")


@inlined
def _first_event_of_series(c, first, entry_guard, h, work):
    """First guard to reach zero within the step `h`, and the time since the step began; -1 and `h` if none does.

    `entry_guard` is zero at the beginning; that root is divided out.
    """
    event, longest, scales = -1, h, powers(h)
    for g in range(first, c.shape[0]):
        row = c[g]
        if g == entry_guard and divide_by_time(row, 0) > ORDER:
            continue
        if row[0] <= 0.0:
            return g, 0.0
        if isnan(row[0]):
            return -1, nan
        # Most guards are farther from zero than the sum of their terms.
        if row[0] > longest * total(abs(terms(row)) * scales):
            continue
        s, found = first_root(row, h, work)
        # Of guards that vanish together the first one counts.
        if found and (event < 0 or s < h * (1.0 - 1e-14)):
            event, h = g, s
    return event, h


@inlined
def _observe_series(scene, run, s, scratch):
    """Record after a step of length `s` of the series, with the extremes within the step."""
    c, instants = scratch.c, scratch.work[0]
    record = recorder.enter(scene, run.record, run.now.t, series.seen_at_start(scene, c))
    count = series.extremes(scene, record, run.mode, c, s, scratch.work)
    ascending(instants, count)
    stuck = modes.sticks(scene, run.mode)
    before = 0.0
    for j in range(count + 1):
        now = instants[j] if j < count else s
        record = along_series(variation.asked(scene), scene, record, run, (before, now), scratch)
        t = later(run.now, now).t
        seen = series.seen_at(scene, run.mode, c, now, s)
        record = recorder.observe(scene, record, t, now - before, stuck, seen)
        before = now
    return record


@inlined
def series_step(scene, run, h_max, tolerance, scratch, band):
    """One step of the series, which the first event ends.

    Parameters
    ----------
    scene : NamedTuple
    run : Run
        The run before the step.
    h_max : float
        Greatest length of the step, s.
    tolerance : float
        Relative error allowed to the step.
    scratch : Scratch
        Its table of series is filled.
    band : float
        Speed, m/s, at whose half and above an event ends the mode in the stiction band; infinite in another mode.

    Returns
    -------
    tuple
        The guard that ended the step, or -1; length of the step, s; state and record after it; error of the step, in
        units of the tolerance; the same if a run at a looser tolerance takes the same step, 0 otherwise.
    """
    c = scratch.c
    longest, reach = series.fill_table(scene, run.mode, run.now, run.y, tolerance, c)
    run = _with_record(run, enter_series(variation.asked(scene), scene, run.record, run.mode, c))
    h = min(longest, h_max)
    guard, s = _first_event_of_series(c, scratch.first_guard, run.mode.entry_guard, h, scratch.work)
    is_rough = guard >= 0 and (s / reach) ** ORDER > _MOST_AT_EXIT
    if is_rough and abs(series.state_at(scene, c, s)[1]) > 0.5 * band:
        # In two steps the error is nearly none.
        guard, s = -1, 0.5 * s
    record = _observe_series(scene, run, s, scratch) if s > 0.0 else run.record
    error = (s / reach) ** ORDER if s > 0.0 else 0.0
    # The looser run needs no shorter step up to the event, or is limited to the same length. A mode that lasts for one
    # step is one step of the looser run too.
    same = error * FACTOR < 1.0 or s == h < reach or (run.has_switched and s < h)
    return guard, s, series.state_at(scene, c, s), record, error, error if same else 0.0
