"""Hooks whose body is the same for several models."""

from __future__ import annotations

from math import inf, isfinite

import numpy as np

from ringsweep import hooks
from ringsweep.numerics.memory import Single
from ringsweep.physics import drives
from ringsweep.physics.belt import Belt, BristleBelt
from ringsweep.physics.friction.velocity import BAND
from ringsweep.physics.ring import BristleRing, Ring


@hooks.lanes.implements(Belt, BristleBelt, BristleRing)
def _lanes(scene):
    return Single()


@hooks.holds.implements(Belt, BristleBelt)
def _holds(scene, now):
    return isfinite(now.rates[0]) and isfinite(now.rates[1])


@hooks.forcing.implements(Belt, BristleBelt, Ring, BristleRing)
def _forcing(scene, t):
    return drives.turn(scene.drive, t)


# The place relative to the drive, so that nothing large cancels in a creep.
@hooks.to_stiff.implements(Belt, Ring)
def _to_stiff(scene, force, y):
    return y[0] - force[0], y[1]


@hooks.from_stiff.implements(Belt, Ring)
def _from_stiff(scene, force, x):
    return x[0] + force[0], x[1]


@hooks.creeps.implements(Belt, Ring)
def _creeps(scene, mode):
    return mode.region == BAND


# With bristles every step is an implicit one: there are no series, and no other coordinates.
@hooks.rows.implements(BristleBelt, BristleRing)
def _rows(scene):
    return 0, 0


@hooks.to_stiff.implements(BristleBelt, BristleRing)
def _bristles_to_stiff(scene, force, y):
    return y


@hooks.from_stiff.implements(BristleBelt, BristleRing)
def _bristles_from_stiff(scene, force, x):
    return x


@hooks.slack.implements(Belt, BristleBelt)
def _slack(scene, before, now):
    return inf


@hooks.stride.implements(Belt, BristleBelt)
def _stride(scene, now, h):
    return 0.0


@hooks.falls.implements(Belt, BristleBelt)
def _falls(scene, before, now, h):
    return 0.0


@hooks.stiff_near.implements(Belt, BristleBelt)
def _stiff_near(scene, motion):
    return 0.0, 0.0


@hooks.undecided.implements(Belt, BristleBelt)
def _undecided(batch, rows, witness, fall):
    return np.zeros(len(rows), dtype=bool)
