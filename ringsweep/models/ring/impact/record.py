"""Record and outcome of runs that go on after a contact is lost.

`r` is the record before, with the record of the closed ring as ``r.base``. Read
:class:`ringsweep.models.ring.impact.mode.Event` first.
"""

from __future__ import annotations

from math import nan
from typing import Any, NamedTuple

from ringsweep.compile import inlined, replacing
from ringsweep.models.interface import recorder
from ringsweep.models.interface.status import COMPLETE, JAM
from ringsweep.models.ring import record as of_ring
from ringsweep.models.ring.impact.mode import BOTH, CLOSES, NONE, REBOUNDS, ring_of
from ringsweep.models.ring.impact.series import true_gap
from ringsweep.numerics.terms import joined
from ringsweep.physics import ring
from ringsweep.physics.impact import ImpactRing
from ringsweep.quantities.flags import FAILED, HELD, OPEN, RECOVERED, SEPARATING, TUMBLED

# The word of events is a polynomial of their codes modulo this prime: a double holds every product exactly.
_PRIME, _BASE = 67108859.0, 33554393.0


class Lost(NamedTuple):
    """What events have done to the contacts up to now.

    Attributes
    ----------
    open, turned : float
        Contacts that are open, and whether the order in which all contacts last touched is another than at first.
    t_first, first, motion : float
        Time of the first loss, s, NaN if there was none, its contacts, and the motion up to it.
    number : float
        Number of events.
    word : float
        The sequence of the events, their contacts and what is open after each, as one number.
    violation : float
        Largest violation of the impact law.
    separations, impacts, impact_speed_max, impulse_max, impact_loss, tumbles, t_recovered
        As in :class:`Outcome`.
    """

    open: float
    turned: float
    t_first: float
    first: float
    motion: float
    number: float
    word: float
    violation: float
    separations: float
    impacts: float
    impact_speed_max: float
    impulse_max: float
    impact_loss: float
    tumbles: float
    t_recovered: float


class Record(NamedTuple):
    """Record of a run that goes on after a contact is lost.

    Attributes
    ----------
    base : ringsweep.models.ring.record.Record
        Record of the motion.
    gap_max : float
        Greatest measure ``(rho^2 - |c|^2)/(2 rho)`` of a gap, m.
    open_time, flight_time : float
        Time for which some contact, and all contacts, have been open, s.
    lost : Lost
    """

    base: Any
    gap_max: float
    open_time: float
    flight_time: float
    lost: Lost


_COUNTS = Lost._fields.index("separations")

#: Outcomes behind those of the ring without impact. The last two are for certificates only.
OUTCOMES = ("open_time", "flight_time", "gap_max", *Lost._fields[_COUNTS:], "aftermath", "word", "impact_violation")


#: Record with another record of the motion.
with_base = replacing("base")
_with_lost = replacing("lost")


@recorder.begin.implements(ImpactRing)
def _begin_record_with_impact(scene, t, seen):
    """Implement :func:`recorder.begin`: both contacts hold."""
    nothing = Lost(0.0, 0.0, nan, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, nan)
    return Record(recorder.begin(scene.closed, t, seen[:5]), 0.0, 0.0, 0.0, nothing)


@recorder.at_once.implements(ImpactRing)
def _at_once_with_impact(scene, status, mode, t, y, seen):
    """Implement :func:`recorder.at_once`: a body that jams has no reactions."""
    return joined((seen[0], seen[1], 0.0, 0.0), seen[4:])


@recorder.observe.implements(ImpactRing)
def _observe_with_impact(scene, record, t, duration, stuck, seen):
    """Implement :func:`recorder.observe`.

    `seen` is what ``_observe_on_ring`` takes, then the measures of both gaps (m) and the number of the open contacts.
    """
    r, contacts = record, seen[7]
    base = recorder.observe(scene.closed, r.base, t, duration, stuck, seen[:5])
    gap_max, open_for = max(r.gap_max, max(seen[5], seen[6])), (duration if contacts > 0.0 else 0.0)
    flies_for = duration if contacts == BOTH else 0.0
    return Record(base, gap_max, r.open_time + open_for, r.flight_time + flies_for, r.lost)


@recorder.enter.implements(ImpactRing)
def _enter_record_with_impact(scene, record, t, seen):
    """Implement :func:`recorder.enter`."""
    return with_base(record, recorder.enter(scene.closed, record.base, t, seen[:5]))


@recorder.as_mode_ends.implements(ImpactRing)
def _as_mode_ends_with_impact(scene, record, mode, guard, t, y):
    """Implement :func:`recorder.as_mode_ends`: as without impact while both contacts hold."""
    if mode.contacts.open != NONE:
        return record
    closed = ring_of(scene, mode.contacts.turned)
    return with_base(record, recorder.as_mode_ends(closed, record.base, mode, guard, t, (y[0], y[1])))


@inlined
def _count_of(contacts):
    """How many contacts NONE, FIRST, SECOND or BOTH are."""
    return float(contacts % 2 + contacts // 2)


@recorder.after_event.implements(ImpactRing)
def _after_event_with_impact(scene, record, before, mode, t):
    """Implement :func:`recorder.after_event`: losses, impacts, tumbles, recovery, and the word of events."""
    r, contacts = record.lost, mode.contacts
    event = contacts.event
    if event.number == r.number:
        return record
    # An impact may close all contacts, of which some open at once.
    passes = event.passed > 0
    opened = NONE if passes else int(r.open)
    # Contacts that held and are open now.
    lost = float(contacts.open & ~opened)
    if ring.contact_count(scene.closed.body) == 1:
        lost = min(lost, 1.0)
    is_impact = event.kind in (REBOUNDS, CLOSES)
    recovers = contacts.open == NONE and opened != NONE
    hit = event.contact if is_impact else 0
    # All contacts touch when those that were open hit, whatever they do afterwards.
    turned = float(contacts.turned) if is_impact and hit == r.open else r.turned
    code = float(1 + event.kind + 4 * (hit + 4 * (contacts.open + 4 * (contacts.turned + 2 * event.passed))))
    is_first = r.first == 0.0 and lost > 0.0
    found = Lost(
        float(contacts.open),
        turned,
        t if is_first else r.t_first,
        lost if is_first else r.first,
        float(of_ring.word_of_motion(record.base)) if is_first else r.motion,
        float(event.number),
        (r.word * 512.0 + code * _BASE) % _PRIME,
        max(r.violation, event.violation),
        r.separations + _count_of(int(lost)),
        r.impacts + _count_of(hit),
        max(r.impact_speed_max, event.speed),
        max(r.impulse_max, event.impulse),
        r.impact_loss + event.loss,
        r.tumbles + (1.0 if turned != r.turned else 0.0),
        t + event.lasts if recovers else nan if contacts.open != NONE else r.t_recovered,
    )
    return _with_lost(record, found)


@recorder.conclude.implements(ImpactRing)
def _conclude_with_impact(scene, record, status, t, place, velocity):
    """Implement :func:`recorder.conclude`: the outcome of the ring at the first loss, then what followed."""
    r = record.lost
    # A jam after a loss ends the run, whose regime is that of the loss.
    ended = COMPLETE if status == JAM and r.first > 0.0 else status
    o = recorder.conclude(scene.closed, record.base, ended, t, place, velocity)
    was_lost = r.first > 0.0 and o.regime != FAILED
    aftermath = HELD
    if r.tumbles > 0.0:
        aftermath = TUMBLED
    elif r.open > 0.0:
        aftermath = OPEN
    elif r.first > 0.0:
        aftermath = RECOVERED
    base = of_ring.Outcome(
        float(SEPARATING) if was_lost else o.regime,
        r.motion if was_lost else o.motion,
        r.first if was_lost else 0.0,
        r.t_first if was_lost else nan,
        *o[4:],
    )
    gap_max = true_gap(scene, record.gap_max)
    own = record.open_time, record.flight_time, gap_max, *r[_COUNTS:], float(aftermath), r.word, r.violation
    return joined(base, own)
