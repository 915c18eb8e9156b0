"""The limit of a jam of a body that may leave the race, see :mod:`ringsweep.models.ring.jam`.

Called once, after a run has ended with JAM.
"""

from __future__ import annotations

from ringsweep.models.interface import modes, recorder
from ringsweep.models.ring.impact.mode import BOTH, FIRST, NONE, frame, ring_of
from ringsweep.models.ring.impact.pivot import friction
from ringsweep.models.ring.impact.record import with_base
from ringsweep.models.ring.jam import balance, limit
from ringsweep.physics import drives, pivot
from ringsweep.physics.impact import ImpactRing


@balance.implements(ImpactRing)
def _balance_of_pivot(scene, mode, t, y, v):
    """Implement :func:`balance`."""
    _, ring_omega, ring_epsilon = drives.turn(scene.drive, t)
    f = frame(scene, (y[0], v, *y[2:]), ring_omega)
    K, _ = friction(scene, mode, v)
    found = pivot.in_slip(f, K)
    psi_dd, alpha_dd, normal, _ = found
    sliding = pivot.sliding_acceleration(f, found, scene.closed.body.radius * ring_epsilon)
    load = normal / (f.mass * pivot.size(f))
    loads = (0.0, load) if mode.contacts.open == FIRST else (load, 0.0)
    return pivot.determinant(f, K) / f.inertia, sliding, psi_dd - alpha_dd, *loads


@modes.limit_of_jam.implements(ImpactRing)
def _limit_of_jam_with_impact(scene, mode, t, y):
    """Implement :func:`modes.limit_of_jam`."""
    contacts = mode.contacts
    if contacts.open == NONE:
        s, (_, v), normals = modes.limit_of_jam(ring_of(scene, contacts.turned), mode, t, (y[0], y[1]))
        return s, (y[0], v, *y[2:]), normals
    if mode.sign == 0 or contacts.open == BOTH:
        return 0.0, y, (0.0, 0.0)
    s, change, tilt, normals = limit(scene, mode, t, y)
    return s, (y[0], y[1] + change, y[2], y[3] + tilt, *y[4:]), normals


@recorder.at_jam.implements(ImpactRing)
def _at_jam_with_impact(scene, record, normals, velocity):
    """Implement :func:`recorder.at_jam`."""
    return with_base(record, recorder.at_jam(scene.closed, record.base, normals, velocity))
