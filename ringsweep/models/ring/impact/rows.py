"""Rows of the history of a run that goes on after a contact is lost.

Called for histories only, once for each row.
"""

from __future__ import annotations

from ringsweep.models.interface import modes
from ringsweep.models.ring.impact.mode import BOTH
from ringsweep.models.ring.impact.switch import motion_of
from ringsweep.models.ring.series import HISTORY as OF_RING
from ringsweep.models.ring.series import with_places
from ringsweep.numerics.terms import joined
from ringsweep.physics import ring
from ringsweep.physics.impact import ImpactRing, contact_of
from ringsweep.physics.zones import locate

#: History variables, in the order of their columns.
HISTORY = *OF_RING, "x", "y", "gap_1", "gap_2"
#: Columns behind them: the last event, see :class:`ringsweep.models.ring.impact.mode.Event`.
EVENT = ("number", "time", "event", "contact", "speed", "impulse")


@modes.row.implements(ImpactRing)
def _row_with_impact(scene, mode, forcing, y, seen):
    """Implement :func:`modes.row`: the columns :data:`HISTORY`, then :data:`EVENT`."""
    contacts, event, theta = mode.contacts, mode.contacts.event, forcing[0]
    motion = motion_of(scene, y, forcing[1])
    first = contact_of(scene.balls, 1, motion)
    second = contact_of(scene.balls, 2, motion) if ring.contact_count(scene.closed.body) == 2 else first
    # On an edge the mode knows on which side of it a contact rubs.
    surface = scene.closed.surface
    place_1 = locate(surface, first.alpha - theta) if contacts.open % 2 == 1 else mode.place_1
    place_2 = locate(surface, second.alpha - theta) if contacts.open >= 2 else mode.place_2
    of_ring = modes.row(scene.closed, with_places(mode, place_1, place_2), forcing, y[:2], seen)
    own = (
        0.0 if contacts.open == BOTH else of_ring[-1],
        motion.x,
        motion.y,
        first.gap if contacts.open % 2 == 1 else 0.0,
        second.gap if contacts.open >= 2 else 0.0,
        float(event.number),
        event.time,
        float(event.kind),
        float(event.contact),
        event.speed,
        event.impulse,
    )
    return joined(of_ring[:-1], own)
