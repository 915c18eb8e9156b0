"""One step of a power series, up to the first guard that vanishes.

The series of a mode is exact to the tolerance on its step, and every guard is a series on the same step: its first
root is located to rounding, and none is stepped over.
"""

from __future__ import annotations

from math import isnan, nan

from ringsweep.compile import inlined
from ringsweep.models.interface import modes, recorder, series
from ringsweep.numerics.series import ORDER, ascending, first_root


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
def _observe(scene, record, mode, c, t, s, work):
    """Record after a step of length `s` along the series `c`, the extremes within it included."""
    count = series.extremes(scene, record, mode, c, s, work)
    instants = work[0]
    ascending(instants, count)
    stuck = modes.sticks(scene, mode)
    before = 0.0
    for j in range(count + 1):
        now = instants[j] if j < count else s
        record = recorder.observe(scene, record, t + now, now - before, stuck, series.seen_at(scene, c, now, s))
        before = now
    return record


@inlined
def series_step(scene, record, mode, t, y, horizon, tolerance, c, guards, work):
    """One step of the series, cut at the first event: guard or -1, length, state, record."""
    h = min(series.expand(scene, mode, t, y, tolerance, c), horizon)
    guard, s = _first_event(c, guards, mode.fresh, h, work)
    if s > 0.0:
        record = _observe(scene, record, mode, c, t, s, work)
    return guard, s, series.state_at(scene, c, s), record
