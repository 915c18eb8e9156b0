"""While both contacts hold, a body that may leave the race takes the steps of the closed ring."""

from __future__ import annotations

from ringsweep.models.interface import simpler
from ringsweep.models.ring.impact.mode import NONE, ring_of, state_when_closed
from ringsweep.models.ring.impact.record import with_base
from ringsweep.models.ring.series import KIND
from ringsweep.physics.impact import ImpactRing


@simpler.kind.implements(ImpactRing)
def _kind(scene):
    return simpler.Parted()


@simpler.is_simpler.implements(ImpactRing)
def _is_simpler(scene, mode):
    return mode.contacts.open == NONE


@simpler.part.implements(ImpactRing)
def _part(scene, record, mode, y):
    return ring_of(scene, mode.contacts.turned), record.base, (y[0], y[1])


@simpler.rejoined.implements(ImpactRing)
def _rejoined(scene, record, mode, part_record, y, c):
    state = state_when_closed(y[0], y[1], mode.contacts.turned)
    c[KIND, 0] = state[-1]
    return with_base(record, part_record), state
