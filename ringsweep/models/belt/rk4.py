"""The belt for steps of constant length. The state is ``(x, velocity)``, in space."""

from __future__ import annotations

from math import inf
from typing import NamedTuple

from ringsweep.models.belt.force import (
    acceleration,
    bend,
    damping,
    friction_force,
    holds_in_band,
    pull,
    steepest_spring,
)
from ringsweep.models.interface import constant_step
from ringsweep.models.interface.shock import Unlocated
from ringsweep.models.parts import exceeds, larger_eigenvalue
from ringsweep.numerics.functions import any_of, select
from ringsweep.physics import belt, drives
from ringsweep.physics.friction.velocity import passes_band, steepest, stiction_band


class Inspection(NamedTuple):
    """Inspection of a state of the belt.

    Attributes
    ----------
    rates : tuple of float
        Time derivative of the state.
    v : float
        Sliding velocity, m/s.
    force : float
        Friction force, N.
    slope : float
        Derivative of the forces of friction and damper by the velocity, N s/m.
    place : float
        Displacement relative to the belt, m.
    bend : tuple of float
        Displacement in space, m, if the spring has a cubic part; else empty.
    """

    rates: tuple[float, float]
    v: float
    force: float
    slope: float
    place: float
    bend: tuple[float, ...]


@constant_step.initial_state.implements(belt.Belt)
def _initial_state(scene):
    return scene.initial_x, scene.initial_v + drives.turn(scene.drive, 0.0)[1]


@constant_step.rates.implements(belt.Belt)
def _rates(scene, now, y, forcing):
    force, _ = friction_force(scene, pull(scene, y[0], y[1], forcing), y[1] - forcing[1])
    return y[1], acceleration(scene, y[0], y[1], forcing, force)


@constant_step.inspect.implements(belt.Belt)
def _inspect(scene, y, forcing):
    v = y[1] - forcing[1]
    force, slope = friction_force(scene, pull(scene, y[0], y[1], forcing), v)
    rates = y[1], acceleration(scene, y[0], y[1], forcing, force)
    return Inspection(rates, v, force, damping(scene, slope), y[0] - forcing[0], bend(scene.cubic, y[0]))


@constant_step.eigenvalue.implements(belt.Belt)
def _eigenvalue(scene, before, now, h, most):
    slope, load = max(abs(before.slope), abs(now.slope)), scene.mass * scene.gravity
    at_rest, at_edge = steepest(scene.law)
    viscous = damping(scene, scene.viscous)
    at_rest, at_edge = load * at_rest + viscous, load * at_edge + viscous
    per_mass = 1.0 / scene.mass
    swing = steepest_spring(scene.cubic, scene.stiffness, before.bend, now.bend) * per_mass
    if holds_in_band(scene.law) or any_of(exceeds(most, max(at_rest, at_edge) * per_mass, swing)):
        # The stages of the step reach about as far as the acceleration at its beginning takes the body.
        belt_gains = (now.rates[0] - now.v) - (before.rates[0] - before.v)
        ahead = before.v + h * before.rates[1] - belt_gains
        rest, edge, jumped = passes_band(scene.law, before.v, now.v, ahead)
        if holds_in_band(scene.law):
            # A step over a discontinuity has infinite stiffness; but a step may end in the dead band.
            slope = select(jumped, inf, slope)
        else:
            # A step that jumps over the band, or over its edge, does not sample the slope there; the slope counts all
            # the same.
            slope = max(slope, select(rest, at_rest, 0.0))
            slope = max(slope, select(edge, at_edge, 0.0))
    return larger_eigenvalue(most, slope * per_mass, swing)


@constant_step.seen.implements(belt.Belt, belt.BristleBelt)
def _seen(scene, y, now):
    # The record takes the rate of the sliding velocity from the differences of short steps.
    return y[0], y[1], now.force, now.place, now.v, 0.0, Unlocated()


@constant_step.sticks.implements(belt.Belt)
def _sticks(scene, before, now):
    return (abs(before.v) < stiction_band(scene.law)) | (before.v * now.v < 0.0)


@constant_step.row.implements(belt.Belt)
def _row(scene, y, forcing):
    v = y[1] - forcing[1]
    mode = 0.0 if abs(v) < stiction_band(scene.law) or v == 0.0 else 1.0 if v > 0.0 else -1.0
    return y[0], y[1], friction_force(scene, pull(scene, y[0], y[1], forcing), v)[0], 0.0, mode
