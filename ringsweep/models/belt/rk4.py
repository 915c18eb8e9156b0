"""The belt for steps of constant length; the state is ``(x, velocity)``."""

from __future__ import annotations

from math import inf, isfinite
from typing import NamedTuple

from ringsweep import hooks
from ringsweep.models.belt.force import friction_force, holds_in_band
from ringsweep.models.belt.record import begin, conclude, observe
from ringsweep.models.interface.status import BROKEN, RUNNING
from ringsweep.models.parts import largest_eigenvalue
from ringsweep.physics import belt, drives
from ringsweep.physics.friction.velocity import (
    met,
    stiction_band,
)

# ---- constant step ---------------------------------------------------------------------------


class Inspection(NamedTuple):
    """A state of the belt seen from within."""

    rates: tuple[float, float]
    v: float
    force: float
    slope: float


@hooks.launch.implements(belt.Belt)
def _launch(scene):
    return scene.initial_x, scene.initial_v + drives.turn(scene.drive, 0.0)[1]


@hooks.rates.implements(belt.Belt)
def _rates(scene, now, y, drive_at, drive_rate):
    force, _ = friction_force(scene, y[0], y[1] - drive_rate)
    return y[1], -(scene.stiffness * y[0] + force) / scene.mass


@hooks.inspect.implements(belt.Belt)
def _inspect(scene, y, drive_at, drive_rate):
    v = y[1] - drive_rate
    force, slope = friction_force(scene, y[0], v)
    return Inspection((y[1], -(scene.stiffness * y[0] + force) / scene.mass), v, force, slope)


@hooks.verdict.implements(belt.Belt)
def _verdict(scene, before, now):
    return (RUNNING if isfinite(now.rates[1]) and isfinite(now.rates[0]) else BROKEN), 1.0


@hooks.stiffness.implements(belt.Belt)
def _stiffness(scene, before, now, h):
    # The stages reach about as far as the acceleration at the beginning takes the body in one step.
    belt_gains = (now.rates[0] - now.v) - (before.rates[0] - before.v)
    ahead = before.v + h * before.rates[1] - belt_gains
    rest, edge, jumped = met(scene.law, before.v, now.v, ahead)
    steepest = max(abs(before.slope), abs(now.slope))
    swing = scene.stiffness / scene.mass
    if holds_in_band(scene.law):
        # A discontinuous law has no slope that any step could follow; but one may land in a dead band.
        return inf if jumped else largest_eigenvalue(steepest / scene.mass, swing) * h
    # A step that jumps the band, or its edge, never samples the slope there, but has met it.
    if rest:
        steepest = max(steepest, abs(friction_force(scene, 0.0, 0.0)[1]))
    if edge:
        steepest = max(steepest, abs(friction_force(scene, 0.0, stiction_band(scene.law))[1]))
    return largest_eigenvalue(steepest / scene.mass, swing) * h


@hooks.begin.implements(belt.Belt)
def _begin(scene, y, now):
    return begin(scene, 0.0, y[0], y[1], now.force)


@hooks.observe.implements(belt.Belt)
def _observe(scene, record, y, before, now, t, h):
    stuck = abs(before.v) < stiction_band(scene.law) or before.v * now.v < 0.0
    return observe(record, scene, t, h, y[0], y[1], now.force, stuck, 0.0)


@hooks.conclude.implements(belt.Belt)
def _conclude(scene, record, status, t, y):
    return conclude(record, scene, status, t, y[0], y[1], stiction_band(scene.law))


@hooks.describe.implements(belt.Belt)
def _describe(scene, y, drive_at, drive_rate):
    v = y[1] - drive_rate
    mode = 0.0 if abs(v) < stiction_band(scene.law) or v == 0.0 else 1.0 if v > 0.0 else -1.0
    return y[0], y[1], friction_force(scene, y[0], v)[0], 0.0, mode
