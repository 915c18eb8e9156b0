"""Record and outcome of runs that go on after a contact is lost."""

from __future__ import annotations

from math import nan
from typing import Any, NamedTuple

from ringsweep.compile import inlined
from ringsweep.models.interface import recorder
from ringsweep.models.interface.status import COMPLETE, JAM
from ringsweep.models.ring import record as of_ring
from ringsweep.models.ring.impact.mode import BOTH, CLOSES, NONE, OPENS, REBOUNDS
from ringsweep.models.ring.impact.series import true_gap
from ringsweep.numerics.terms import joined
from ringsweep.physics import ring
from ringsweep.physics.impact import ImpactRing
from ringsweep.quantities.flags import FAILED, HELD, OPEN, RECOVERED, SEPARATING, TUMBLED

# The word of events is a polynomial of their codes modulo this prime: a double holds every product exactly.
_PRIME, _BASE = 67108859.0, 33554393.0


class Record(NamedTuple):
    """Record of a run that goes on after a contact is lost.

    Attributes
    ----------
    base : ringsweep.models.ring.record.Record
        Record of the motion.
    open, turned : float
        Contacts that are open, and whether the order of the contacts has changed.
    t_lost, first_lost : float
        Time of the first loss, s, NaN if there was none, and its contacts.
    ever_lost : float
        Contacts that have been open: 0 to 3.
    gap_max : float
        Greatest measure ``(rho^2 - |c|^2)/(2 rho)`` of a gap, m.
    number : float
        Number of events.
    word : float
        The sequence of the events, their contacts and what is open after each, as one number.
    violation : float
        Largest violation of the impact law.
    open_time, flight_time, separations, impacts, impact_speed_max, impulse_max, impact_loss, tumbles, t_recovered
        As in :class:`Outcome`.
    """

    base: Any
    open: float
    turned: float
    t_lost: float
    first_lost: float
    ever_lost: float
    gap_max: float
    number: float
    word: float
    violation: float
    open_time: float
    flight_time: float
    separations: float
    impacts: float
    impact_speed_max: float
    impulse_max: float
    impact_loss: float
    tumbles: float
    t_recovered: float


#: Outcomes behind those of the ring without impact. The last two are for certificates only.
OUTCOMES = (
    *("open_time", "flight_time", "gap_max", "separations", "impacts", "impact_speed_max", "impulse_max"),
    *("impact_loss", "tumbles", "t_recovered", "aftermath", "word", "impact_violation"),
)


@inlined
def _with_base(record, base, gap_max, open_time, flight_time):
    r = record
    return Record(
        base,
        r.open,
        r.turned,
        r.t_lost,
        r.first_lost,
        r.ever_lost,
        gap_max,
        r.number,
        r.word,
        r.violation,
        open_time,
        flight_time,
        r.separations,
        r.impacts,
        r.impact_speed_max,
        r.impulse_max,
        r.impact_loss,
        r.tumbles,
        r.t_recovered,
    )


@recorder.begin.implements(ImpactRing)
def _begin(scene, t, seen):
    base = recorder.begin(scene.closed, t, seen[:5])
    return Record(base, 0.0, 0.0, nan, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, nan)


@recorder.observe.implements(ImpactRing)
def _observe(scene, record, t, duration, stuck, seen):
    base = recorder.observe(scene.closed, record.base, t, duration, stuck, seen[:5])
    is_open, flies = (duration if seen[7] > 0.0 else 0.0), (duration if seen[7] == BOTH else 0.0)
    gap_max = max(record.gap_max, max(seen[5], seen[6]))
    return _with_base(record, base, gap_max, record.open_time + is_open, record.flight_time + flies)


@recorder.enter.implements(ImpactRing)
def _enter(scene, record, t, seen):
    base = recorder.enter(scene.closed, record.base, t, seen[:5])
    return _with_base(record, base, record.gap_max, record.open_time, record.flight_time)


@inlined
def _count(contacts):
    return float(contacts % 2 + contacts // 2)


@recorder.after_event.implements(ImpactRing)
def _after_event(scene, record, mode, t):
    r = record
    if mode.number == r.number:
        return r
    two = ring.contact_count(scene.closed.body) == 2
    # An impact may close all contacts, of which some open at once.
    passes = mode.passed > 0
    before = NONE if passes else int(r.open)
    hit = mode.contact if mode.event != OPENS else 0
    # Contacts that held and are open now.
    lost = float((1 if mode.open % 2 == 1 and before % 2 == 0 else 0) + (2 if mode.open >= 2 and before < 2 else 0))
    if not two:
        lost = min(lost, 1.0)
    ever = int(r.ever_lost)
    ever_lost = float((1 if ever % 2 == 1 or lost % 2.0 == 1.0 else 0) + (2 if ever >= 2 or lost >= 2.0 else 0))
    first_lost = r.first_lost if r.first_lost > 0.0 else lost
    is_impact = mode.event == REBOUNDS or mode.event == CLOSES
    recovers = mode.open == NONE and before != NONE
    turned = float(mode.passed - 1) if passes else float(mode.turned) if mode.open == NONE else r.turned
    code = float(1 + mode.event + 4 * (hit + 4 * (mode.open + 4 * (mode.turned + 2 * mode.passed))))
    return Record(
        r.base,
        float(mode.open),
        turned,
        t if r.first_lost == 0.0 and lost > 0.0 else r.t_lost,
        first_lost,
        ever_lost,
        r.gap_max,
        float(mode.number),
        (r.word * 512.0 + code * _BASE) % _PRIME,
        max(r.violation, mode.violation),
        r.open_time,
        r.flight_time,
        r.separations + _count(int(lost)),
        r.impacts + (_count(mode.contact) if is_impact else 0.0),
        max(r.impact_speed_max, mode.speed),
        max(r.impulse_max, mode.impulse),
        r.impact_loss + mode.loss,
        r.tumbles + (1.0 if turned != r.turned else 0.0),
        t + mode.lasts if recovers else nan if mode.open != NONE else r.t_recovered,
    )


@recorder.conclude.implements(ImpactRing)
def _conclude(scene, record, status, t, place, velocity):
    r = record
    # A jam after a loss ends the run, whose regime is that of the loss.
    ended = COMPLETE if status == JAM and r.first_lost > 0.0 else status
    o = recorder.conclude(scene.closed, r.base, ended, t, place, velocity)
    was_lost = r.first_lost > 0.0 and o.regime != FAILED
    aftermath = HELD
    if r.tumbles > 0.0:
        aftermath = TUMBLED
    elif r.open > 0.0:
        aftermath = OPEN
    elif r.first_lost > 0.0:
        aftermath = RECOVERED
    base = of_ring.Outcome(
        float(SEPARATING) if was_lost else o.regime,
        o.motion,
        r.first_lost if was_lost else 0.0,
        r.t_lost if was_lost else nan,
        *o[4:],
    )
    own = (
        r.open_time,
        r.flight_time,
        true_gap(scene, r.gap_max),
        r.separations,
        r.impacts,
        r.impact_speed_max,
        r.impulse_max,
        r.impact_loss,
        r.tumbles,
        r.t_recovered,
        float(aftermath),
        r.word,
        r.violation,
    )
    return joined(base, own)
