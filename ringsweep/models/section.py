"""Sections of a motion: its last states at each period of the forcing, or at each turn of the displacement.

The points of a run lie in the last columns of its row of outcomes, which are a ring buffer until the run ends.

Records of models call these functions. `asked` is the field ``section`` of the scene, an empty tuple if none is asked
for; then nothing of this file is compiled. `r` is the record before an observation, `p` its :class:`Points`.
"""

from __future__ import annotations

from math import inf, nan
from typing import Any, NamedTuple

import numpy as np

from ringsweep.compile import feature, inlined, unrolled
from ringsweep.models import cycles
from ringsweep.models.scene import Section
from ringsweep.models.turn import turn_within
from ringsweep.quantities.parameters import Leaf


class Asked(NamedTuple):
    """Field ``section`` of a scene that asks for points of its motion.

    Attributes
    ----------
    at_turn : bool
        Whether points lie at each maximum of the displacement, or at the end of each period of the forcing.
    keep : int
        Number of points that are kept.
    columns : int
        Number of columns that hold them: `keep` for the place, for the velocity, and for each deflection that is kept.
    """

    at_turn: Leaf
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
    deflections : tuple of float
        Deflections at the last observation, m; NaN without bristles.
    low : float
        Least displacement since the last maximum, m.
    pending : float
        1 if the body is at rest after a rise: only a fall makes this a maximum. Else 0.
    x_turn : float
        Displacement there, m.
    deflections_turn : tuple of float
        Deflections there, m.
    """

    row: Any
    number: float
    deflections: Any
    low: float
    pending: float
    x_turn: float
    deflections_turn: Any


def columns(asked: Section | None, variables: tuple[str, ...]) -> tuple[str, ...]:
    """Names of the columns of the points: that of each variable as often as points are kept; none without a section.

    Parameters
    ----------
    asked : Section or None
        The section of a scene.
    variables : tuple of str
        Place, velocity and deflections of a point; the deflections count only if the section keeps them.
    """
    if asked is None:
        return ()
    return tuple(name for name in (variables if asked.deflections else variables[:2]) for _ in range(asked.keep))


def field(asked: Section, variables: tuple[str, ...], cells: int) -> Asked:
    """Field ``section`` of so many cells; arguments as in :func:`columns`."""
    values = asked.at == "turn", asked.keep, len(columns(asked, variables))
    return Asked(*(np.full(cells, value) for value in values))


@feature("()")
def lent(asked, record, row, deflections):
    """Points at the beginning of a run; an empty tuple if no section is asked for.

    Parameters
    ----------
    asked : Asked
    record : NamedTuple
        With the last observation, ``last``, and with ``cycles``.
    row : ndarray
        Row of outcomes of the run.
    deflections : tuple of float
        NaN for each deflection that is observed.
    """
    for k in range(max(len(row) - asked.columns, 0), len(row)):
        row[k] = nan
    return Points(row, 0.0, deflections, record.last.x, 0.0, nan, deflections)


@feature("inf")
def next_point(asked, record):
    """Time at which a step must show the record a point, s; infinite for points at turns, or without a section."""
    return inf if asked.at_turn else record.cycles.next


@feature("()", absorb=True)
def with_point(asked, scene, r, cycles_now, now, deflections, least_rise):
    """Points after an observation.

    Parameters
    ----------
    asked : Asked
    scene, r : NamedTuple
        One cell, and its record before the observation, as in :func:`lent`.
    cycles_now : Cycles
        Cycles after it.
    now : Interval
        The interval that ends with it.
    deflections : tuple of float
        Those at its end, m.
    least_rise : float
        Rise of the displacement before a maximum that counts, m.
    """
    if asked.at_turn:
        return _with_turn(asked, r, now, deflections, least_rise)
    p, mark = r.section, cycles_now.last
    count = p.number
    if scene.forcing_period < inf and cycles_now.count != r.cycles.count:
        late = (now.t - mark.t) / now.duration if now.duration > 0.0 else 0.0
        x = cycles.difference(scene, mark.x, 0.0)
        _store(_earlier(deflections, p.deflections, late), asked, p, x, mark.velocity)
        count += 1.0
    return Points(p.row, count, deflections, p.low, 0.0, nan, p.deflections_turn)


@inlined
def _with_turn(asked, r, now, deflections, least_rise):
    """Points after an observation; a turn is a greatest displacement after a rise of more than `least_rise`, m."""
    p = r.section
    count, pending, x_turn, deflections_turn = p.number, p.pending, p.x_turn, p.deflections_turn
    low = min(p.low, r.last.x)
    if r.last.velocity > 0.0 and now.velocity <= 0.0:
        turn = turn_within(r.last, now)
        late = (now.t - turn.t) / now.duration if now.duration > 0.0 else 0.0
        pending, x_turn, deflections_turn = 1.0, turn.x, _earlier(deflections, p.deflections, late)
    if now.velocity > 0.0:
        pending = 0.0
    elif now.velocity < 0.0 and pending > 0.0:
        pending = 0.0
        if x_turn - low > least_rise:
            _store(deflections_turn, asked, p, x_turn, 0.0)
            count, low = count + 1.0, x_turn
    return Points(p.row, count, deflections, low, pending, x_turn, deflections_turn)


@unrolled
def _earlier(length, deflections, before, share):
    """Deflections a share of an interval before its end, and not before its beginning, where they are `before`."""
    mixed = "".join(f"deflections[{k}] + part * (before[{k}] - deflections[{k}]), " for k in range(length))
    return ["if share <= 0.0:", "    return deflections", "part = min(share, 1.0)", f"return {mixed}"]


@unrolled
def _store(length, deflections, asked, p, x, velocity):
    """Store a point as the one of the number ``p.number``."""
    lines = [
        "first, keep = len(p.row) - asked.columns, asked.keep",
        "if first < 0:",
        "    return",
        "k = first + int(p.number) % keep",
        "p.row[k] = x",
        "p.row[k + keep] = velocity",
    ]
    for j in range(2, 2 + length):
        lines += [f"if asked.columns > {j} * keep:", f"    p.row[k + {j} * keep] = deflections[{j - 2}]"]
    return lines


@feature("None")
def put_in_order(asked, section):
    """Put the points into their order in time."""
    row, keep = section.row, asked.keep
    if len(row) < asked.columns or section.number <= keep:
        return
    oldest = int(section.number) % keep
    for first in range(len(row) - asked.columns, len(row), keep):
        # Both parts reversed, and then the whole, is the second part before the first.
        _reverse(row, first, first + oldest)
        _reverse(row, first + oldest, first + keep)
        _reverse(row, first, first + keep)


@inlined
def _reverse(row, start, stop):
    """Reverse the order of the numbers ``row[start:stop]``."""
    for k in range((stop - start) // 2):
        row[start + k], row[stop - 1 - k] = row[stop - 1 - k], row[start + k]
