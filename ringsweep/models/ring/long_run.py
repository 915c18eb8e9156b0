"""What a motion on a ring with a periodic drive settles to: its cycles, its section, and its small disturbances.

A *cycle* is a period of the drive. States that differ by full turns of the body are the same.
"""

from __future__ import annotations

from math import floor, inf, nan, pi, sqrt
from typing import Any, NamedTuple

from ringsweep.compile import absorbed, hook, replacing
from ringsweep.models import cycles, section, tangent
from ringsweep.models.cycles import Cycles, Mark
from ringsweep.models.interface import variation
from ringsweep.models.interface.status import COMPLETE
from ringsweep.models.turn import Interval, between
from ringsweep.numerics.terms import joined
from ringsweep.physics.ring import BristleRing, Ring
from ringsweep.quantities.flags import PERIODIC, TRANSIENT, UNBOUNDED

#: Outcomes of a run whose long run is asked for, after the others.
OUTCOMES = "period", "settled", "long_run"


class Asked(NamedTuple):
    """What a scene asks for: what its motion settles to."""


class Last(NamedTuple):
    """The last observation: time, s, angle of the body, rad, and angular velocity, rad/s."""

    t: float
    x: float
    velocity: float


class LongRun(NamedTuple):
    """Cycles up to now, and what is asked for beside them.

    Attributes
    ----------
    last : Last
    low, high : float
        Least and greatest angle since the end of the last cycle, rad.
    cycles : Cycles
    tangent : Tangent
        Growth of small disturbances; an empty tuple if no exponent is asked for.
    section : Points
        Points of the section; an empty tuple if none is asked for.
    """

    last: Last
    low: float
    high: float
    cycles: Cycles
    tangent: Any
    section: Any


#: Long run with another tangent, and with another section.
with_tangent, _with_section = replacing("tangent"), replacing("section")


@cycles.difference.implements(Ring, BristleRing)
def _without_full_turns(scene, x, other):
    apart = x - other
    return apart - 2.0 * pi * floor(apart / (2.0 * pi) + 0.5)


@hook(optional=True)
def begin(asked, scene, t, seen):
    """Long run at the beginning of a run; an empty tuple if it is not asked for."""
    return ()


@begin.implements(Asked)
def _begin(asked, scene, t, seen):
    phi, omega = seen[0], seen[1]
    started = cycles.begin(cycles.end_of(scene, scene.forcing_period, 1.0), Mark(t, phi, omega, 0.0, 0.0))
    return LongRun(Last(t, phi, omega), phi, phi, started, tangent.begin(scene.asked, scene, t), ())


@hook(optional=True)
def lent(long_run, scene, row):
    """Long run whose points lie in a row of outcomes."""
    return long_run


@lent.implements(LongRun)
def _lent(long_run, scene, row):
    return _with_section(long_run, section.lent(scene.section, long_run, row, _no_deflections(scene)))


@hook(optional=True)
def _no_deflections(scene):
    """NaN for each deflection of bristles; one NaN without bristles."""
    return (nan,)


@_no_deflections.implements(BristleRing)
def _none_of_two(scene):
    return nan, nan


@hook(optional=True)
def _deflections(scene, seen):
    """Deflections of the bristles as the recorder takes them, m; one NaN without bristles."""
    return (nan,)


@_deflections.implements(BristleRing)
def _of_both_contacts(scene, seen):
    return seen[5], seen[6]


@hook(optional=True)
def due(long_run):
    """Time that a step must show the record, s; infinite if there is none."""
    return inf


@due.implements(LongRun)
def _end_of_cycle(long_run):
    return long_run.cycles.next


@hook(optional=True)
def rest(long_run):
    """Time from the last observation to :func:`due`, s; infinite if there is none."""
    return inf


@rest.implements(LongRun)
def _rest_of_cycle(long_run):
    return long_run.cycles.next - long_run.last.t


@hook(absorb=True, optional=True)
def observe(long_run, scene, stick_time, t, duration, seen):
    """Long run after an observation; `stick_time` is the time for which the body has stuck up to `t`, s."""
    return long_run


@observe.implements(LongRun)
def _observe(long_run, scene, stick_time, t, duration, seen):
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
        fast = (high - low) * (2.0 * pi) / _pace(scene)
        cycles_now = cycles.closed(scene, c, mark, count, True, high - low, fast, period)
        low = high = mark.x
    return LongRun(
        Last(t, phi, omega),
        low,
        high,
        cycles_now,
        tangent.observe(r.tangent, scene, c, cycles_now, t, duration),
        section.observe(scene.section, scene, r, cycles_now, now, _deflections(scene, seen)),
    )


@absorbed
def _pace(scene):
    """Period of a small swing without friction or period of the drive, whichever is shorter, s."""
    natural = 2.0 * pi * sqrt(scene.body.radius / scene.body.gravity) if scene.body.gravity > 0.0 else inf
    return min(natural, scene.forcing_period)


@hook(optional=True)
def followed(long_run, outcome, scene, status):
    """Outcome of a run that ended with `status`, with what its motion settles to if this is asked for."""
    return outcome


@followed.implements(LongRun)
def _followed(long_run, outcome, scene, status):
    r, c = long_run, long_run.cycles
    section.finish(scene.section, scene, r)
    fast = c.swing * (2.0 * pi) / _pace(scene)
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
def _due(scene, record):
    return due(record.long_run)
