"""What a motion on a ring with a periodic drive settles to: its cycles, its section, and its small disturbances.

A *cycle* is a period of the drive. States that differ by full turns of the body are the same.

Only the record of the ring calls it. `long_run` is a :class:`LongRun`, an empty tuple if the scene does not ask for
it; then nothing of this file is compiled.
"""

from __future__ import annotations

from math import inf, nan, pi
from typing import Any, NamedTuple

from ringsweep.compile import feature, generated, replacing
from ringsweep.models import cycles, section, tangent
from ringsweep.models.cycles import Cycles, Mark
from ringsweep.models.interface import variation
from ringsweep.models.interface.status import COMPLETE
from ringsweep.models.turn import Interval, between
from ringsweep.numerics.terms import joined
from ringsweep.physics.ring import BristleRing, Ring
from ringsweep.quantities.flags import PERIODIC, TRANSIENT, UNBOUNDED
from ringsweep.quantities.parameters import Leaf

#: Outcomes of a run whose long run is asked for, after the others.
OUTCOMES = "period", "settled", "long_run"


class Asked(NamedTuple):
    """Field ``long_run`` of a scene that asks for what its motion settles to.

    Attributes
    ----------
    pace : float
        Period of a small swing without friction or period of the drive, whichever is shorter, s.
    """

    pace: Leaf


class LongRun(NamedTuple):
    """Record of a long run: cycles up to now, growth of disturbances, and points of the section.

    Attributes
    ----------
    last : Interval
        The interval that ends with the last observation.
    low, high : float
        Least and greatest angle since the end of the last cycle, rad.
    cycles : Cycles
    tangent : Tangent
        Growth of small disturbances; an empty tuple if no exponent is asked for.
    section : Points
        Points of the section; an empty tuple if none is asked for.
    """

    last: Interval
    low: float
    high: float
    cycles: Cycles
    tangent: Any
    section: Any


#: Long run with another tangent, and with another section.
with_tangent, _with_section = replacing("tangent"), replacing("section")


@feature("()")
def launched(asked, scene, t, seen):
    """Record of a long run at its beginning; an empty tuple if the scene does not ask for it."""
    phi, omega = seen[0], seen[1]
    first, start = cycles.end_of(scene, scene.forcing_period, 1.0), Mark(t, phi, omega, 0.0, 0.0)
    started = cycles.none_yet(asked, first, start)
    return LongRun(Interval(t, 0.0, phi, omega), phi, phi, started, tangent.undisturbed(scene.asked, scene, t), ())


@feature("long_run")
def with_room(long_run, scene, row):
    """Record of a long run whose points of the section are stored in the row of outcomes of the run."""
    return _with_section(long_run, section.lent(scene.section, long_run, row, (nan, nan)))


@feature("inf")
def next_cycle_end(long_run):
    """Time of the end of the present cycle, s, at which a step must end; infinite if nothing is recorded."""
    return long_run.cycles.next


@feature("inf")
def rest(long_run):
    """Time from the last observation to :func:`next_cycle_end`, s; infinite if there is none."""
    return long_run.cycles.next - long_run.last.t


@generated
def _deflections(seen):
    """Deflections of the bristles as the recorder takes them, m; NaN without bristles."""
    return ["return seen[5], seen[6]" if len(seen) > 5 else "return nan, nan"], {"nan": nan}


@feature("long_run", absorb=True)
def continued(long_run, scene, stick_time, t, duration, seen):
    """Long run after an observation; `stick_time` is the time for which the body has stuck up to `t`, s."""
    r, c = long_run, long_run.cycles
    phi, omega = seen[0], seen[1]
    now, cycles_now = Interval(t, duration, phi, omega), c
    low, high = min(r.low, phi), max(r.high, phi)
    if cycles.is_due(c, t):
        period = scene.forcing_period
        count = cycles.number_at(c, period, t)
        share = 1.0 - (t - count * period) / duration if duration > 0.0 else 1.0
        share = min(max(share, 0.0), 1.0)
        velocity = (1.0 - share) * r.last.velocity + share * omega
        mark = Mark(count * period, between(r.last, now, share), velocity, stick_time, 0.0)
        fast = (high - low) * (2.0 * pi) / scene.long_run.pace
        cycles_now = cycles.closed(scene, c, mark, count, True, high - low, fast, period)
        low = high = mark.x
    return LongRun(
        now,
        low,
        high,
        cycles_now,
        tangent.observed(r.tangent, scene, c, cycles_now, t, duration),
        section.with_point(scene.section, scene, r, cycles_now, now, _deflections(seen), inf),
    )


@feature("outcome")
def followed(long_run, outcome, scene, status):
    """Outcome of a run that ended with `status`, and what its motion settles to."""
    r, c = long_run, long_run.cycles
    section.put_in_order(scene.section, r.section)
    fast = c.swing * (2.0 * pi) / scene.long_run.pace
    word, period = TRANSIENT, nan
    if status == COMPLETE:
        largest, growth = tangent.largest_multiplier(r.tangent), tangent.exponent(r.tangent)
        if cycles.returns_each_time(scene, c, True, fast, largest, growth):
            word, period = PERIODIC, c.period
        else:
            word = cycles.without_return(c, True, scene.forcing_period, growth)
    settled = 0.0 if word in (TRANSIENT, UNBOUNDED) else 1.0
    return tangent.with_exponent(r.tangent, joined(outcome, (period, settled, float(word))), period, scene)


@variation.due.implements(Ring, BristleRing)
def _due_on_ring(scene, record):
    """Implement :func:`variation.due`: the end of the cycle of the drive."""
    return next_cycle_end(record.long_run)
