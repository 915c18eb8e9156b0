"""While both contacts hold, a body that may leave the race takes the steps of the closed ring."""

from __future__ import annotations

from math import pi

from ringsweep.models.interface import simpler
from ringsweep.models.ring.impact.mode import KIND, NONE, RING, angle_when_closed, closed_mode, code_of, ring_of
from ringsweep.models.ring.impact.record import begin, renamed, with_base
from ringsweep.models.ring.series import NORMAL_1, NORMAL_2, PHI
from ringsweep.numerics.series import ORDER
from ringsweep.physics.impact import ImpactRing


@simpler.kind.implements(ImpactRing)
def _kind(scene):
    return simpler.Parted()


@simpler.is_simpler.implements(ImpactRing)
def _is_simpler(scene, mode):
    return mode.open == NONE


@simpler.first_row.implements(ImpactRing)
def _first_row(scene):
    return RING


@simpler.part.implements(ImpactRing)
def _part(scene, mode, y):
    return ring_of(scene, mode.turned), closed_mode(mode), (angle_when_closed(y[0], mode.turned), y[1])


@simpler.part_of_record.implements(ImpactRing)
def _part_of_record(scene, record, mode):
    return renamed(record.base, -pi) if mode.turned == 1 else record.base


@simpler.begun.implements(ImpactRing)
def _begun(scene, part_record):
    return begin(part_record)


@simpler.rejoined.implements(ImpactRing)
def _rejoined(scene, record, mode, guard, part_record, y, c):
    psi, base = y[0], part_record
    c[KIND, 0] = code_of(mode)
    if mode.turned == 1:
        psi, base = y[0] + pi, renamed(part_record, pi)
        guard = RING + NORMAL_2 if guard == RING + NORMAL_1 else RING + NORMAL_1 if guard == RING + NORMAL_2 else guard
        # Rows bear the names of the contacts, not their order.
        c[RING + PHI, 0] += pi
        for k in range(ORDER + 1):
            c[RING + NORMAL_1, k], c[RING + NORMAL_2, k] = c[RING + NORMAL_2, k], c[RING + NORMAL_1, k]
    return guard, with_base(record, base), (psi, y[1], 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, code_of(mode))
