"""Sections of the motion on the belt: the last states at each period of the forcing, or at each turn.

The points of a run lie in the last columns of its row of outcomes, which are a ring buffer until the run ends.
"""

from __future__ import annotations

from math import inf, nan
from typing import Any, NamedTuple

from ringsweep.compile import hook, inlined
from ringsweep.models.belt.turn import turn_within
from ringsweep.quantities.parameters import Leaf

#: Variables of a point: displacement and velocity, and under a law with bristles their deflection.
VARIABLES = "x_section", "velocity_section", "deflection_section"

# A maximum counts if the body has moved farther towards it than this share of the range of its displacement.
_ROUNDING = 1e-6

# Share of a time by which rounding may change it.
_SAME = 1e-13


class AtPeriod(NamedTuple):
    """What a scene asks for: points at the end of each period of the forcing.

    Attributes
    ----------
    keep : int
        Number of points that are kept.
    columns : int
        Number of columns that hold them: `keep` for each variable.
    """

    keep: Leaf
    columns: Leaf


class AtTurn(NamedTuple):
    """What a scene asks for: points at each maximum of the displacement; fields as in :class:`AtPeriod`."""

    keep: Leaf
    columns: Leaf


class Points(NamedTuple):
    """Points up to now.

    Attributes
    ----------
    row : ndarray
        Row of outcomes of the run, whose last columns hold the points. A run that stores no outcomes has no room.
    number : float
        Number of points.
    deflection : float
        Deflection at the last observation, m; NaN without bristles.
    low : float
        Least displacement since the last maximum, m.
    pending : float
        1 if the body is at rest after a rise: only a fall makes this a maximum. Else 0.
    x_turn, deflection_turn : float
        State there, m.
    """

    row: Any
    number: float
    deflection: float
    low: float
    pending: float
    x_turn: float
    deflection_turn: float


@hook(optional=True)
def lent(asked, record, row):
    """Points at the beginning of a run; an empty tuple if no section is asked for."""
    return ()


@lent.implements(AtPeriod, AtTurn)
def _lent(asked, record, row):
    for k in range(max(len(row) - asked.columns, 0), len(row)):
        row[k] = nan
    return Points(row, 0.0, nan, record.last.x, 0.0, nan, nan)


@hook(optional=True)
def due(asked, record):
    """Time that a step must show the record, s; infinite if there is none."""
    return inf


@due.implements(AtPeriod)
def _end_of_period(asked, record):
    return record.cycles.next


@hook(absorb=True, optional=True)
def observe(asked, scene, r, cycles, t, duration, x, velocity, deflection):
    """Points after an observation.

    Parameters
    ----------
    asked : AtPeriod or AtTurn
    scene, r : NamedTuple
        One cell, and its record before the observation.
    cycles : Cycles
        Cycles after it.
    t, duration : float
        Time, and length of the interval, s.
    x, velocity, deflection : float
        State at `t`, m and m/s.
    """
    return ()


@observe.implements(AtPeriod)
def _at_period(asked, scene, r, cycles, t, duration, x, velocity, deflection):
    p, mark = r.section, cycles.last
    count = p.number
    if scene.forcing_period < inf and cycles.count != r.cycles.count:
        late = (t - mark.t) / duration if duration > 0.0 else 0.0
        _store(asked, p, mark.x, mark.velocity, _earlier(p, deflection, late))
        count += 1.0
    return Points(p.row, count, deflection, p.low, 0.0, nan, nan)


@observe.implements(AtTurn)
def _at_turn(asked, scene, r, cycles, t, duration, x, velocity, deflection):
    p, before = r.section, r.last.velocity
    count, pending, x_turn, deflection_turn = p.number, p.pending, p.x_turn, p.deflection_turn
    low = min(p.low, r.last.x)
    if before > 0.0 and velocity <= 0.0:
        turn = turn_within(r.last, t, duration, x, velocity)
        late = (t - turn.t) / duration if duration > 0.0 else 0.0
        pending, x_turn, deflection_turn = 1.0, turn.x, _earlier(p, deflection, late)
    if velocity > 0.0:
        pending = 0.0
    elif velocity < 0.0 and pending > 0.0:
        pending = 0.0
        if x_turn - low > max(r.play, _ROUNDING * (r.x_max - r.x_min)):
            _store(asked, p, x_turn, 0.0, deflection_turn)
            count, low = count + 1.0, x_turn
    return Points(p.row, count, deflection, low, pending, x_turn, deflection_turn)


@inlined
def _earlier(p, deflection, share):
    """Deflection a share of the interval before its end, and not before its beginning."""
    return deflection if share <= 0.0 else deflection + min(share, 1.0) * (p.deflection - deflection)


@inlined
def _store(asked, p, x, velocity, deflection):
    first = len(p.row) - asked.columns
    if first >= 0:
        k = first + int(p.number) % asked.keep
        p.row[k] = x
        p.row[k + asked.keep] = velocity
        if asked.columns > 2 * asked.keep:
            p.row[k + 2 * asked.keep] = deflection


@hook(optional=True)
def finish(asked, scene, record):
    """Put the points into their order in time."""


@finish.implements(AtPeriod)
def _finish_at_period(asked, scene, record):
    p, last = record.section, record.last
    count = p.number
    if record.cycles.next < inf and record.cycles.next - last.t <= _SAME * last.t:
        # But for rounding, the run ends with a period.
        _store(asked, p, last.x, last.velocity, p.deflection)
        count += 1.0
    _order(asked, p.row, count)


@finish.implements(AtTurn)
def _finish_at_turn(asked, scene, record):
    _order(asked, record.section.row, record.section.number)


@inlined
def _order(asked, row, count):
    keep = asked.keep
    if len(row) < asked.columns or count <= keep:
        return
    oldest = int(count) % keep
    for first in range(len(row) - asked.columns, len(row), keep):
        # Both parts reversed, and then the whole, is the second part before the first.
        _reverse(row, first, first + oldest)
        _reverse(row, first + oldest, first + keep)
        _reverse(row, first, first + keep)


@inlined
def _reverse(row, start, stop):
    for k in range((stop - start) // 2):
        row[start + k], row[stop - 1 - k] = row[stop - 1 - k], row[start + k]
