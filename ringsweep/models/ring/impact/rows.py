"""Rows of the history of a run that goes on after a contact is lost.

Called for histories only, once for each row.
"""

from __future__ import annotations

from ringsweep.models.interface import modes
from ringsweep.models.ring.impact.mode import BOTH
from ringsweep.models.ring.impact.switch import motion_of
from ringsweep.physics import ring
from ringsweep.physics.impact import ImpactRing, contact_of
from ringsweep.physics.zones import coefficients, locate

#: History variables, in the order of their columns.
HISTORY = (
    *("phi", "omega", "epsilon", "normal_1", "normal_2", "ring_omega", "zone_1", "zone_2", "mode"),
    *("x", "y", "gap_1", "gap_2"),
)
#: Columns behind them: the last event, see :class:`ringsweep.models.ring.impact.mode.Event`.
EVENT = ("number", "time", "event", "contact", "speed", "impulse")


@modes.row.implements(ImpactRing)
def _row_with_impact(scene, mode, forcing, y, seen):
    """Implement :func:`modes.row`: the columns :data:`HISTORY`, then :data:`EVENT`."""
    psi, rate, normal_1, normal_2, located = seen[0], seen[1], seen[2], seen[3], seen[4]
    contacts, (theta, ring_omega, _) = mode.contacts, forcing
    event = contacts.event
    motion = motion_of(scene, y, ring_omega)
    first = contact_of(scene.balls, 1, motion)
    second = contact_of(scene.balls, 2, motion) if ring.contact_count(scene.closed.body) == 2 else first
    # On an edge the mode knows on which side of it a contact rubs.
    surface = scene.closed.surface
    segment_1 = locate(surface, first.alpha - theta)[0] if contacts.open % 2 == 1 else mode.place_1[0]
    segment_2 = locate(surface, second.alpha - theta)[0] if contacts.open >= 2 else mode.place_2[0]
    _, _, zone_1 = coefficients(surface, segment_1)
    _, _, zone_2 = coefficients(surface, segment_2)
    return (
        psi,
        rate,
        located.acceleration,
        normal_1,
        normal_2,
        ring_omega,
        zone_1,
        zone_2,
        0.0 if contacts.open == BOTH or mode.region < 0 else float(mode.sign),
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
