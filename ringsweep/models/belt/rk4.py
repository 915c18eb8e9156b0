"""The belt for steps of constant length. The state is ``(x, velocity)``, in space."""

from __future__ import annotations

from math import nan
from typing import NamedTuple

from ringsweep.models.belt.force import if_force, sliding
from ringsweep.models.interface import constant_step
from ringsweep.models.interface.shock import Unlocated
from ringsweep.physics import belt, drives, ring
from ringsweep.physics.friction.velocity import stiction_band


class Inspection(NamedTuple):
    """Inspection of a state of the belt.

    Attributes
    ----------
    rates : tuple of float
        Time derivative of the state.
    v : float
        Sliding velocity, m/s.
    normal_1, normal_2 : float
        Normal reaction, N.
    determinant : float
        1: the body cannot jam.
    slope : float
        Derivative of the acceleration by the velocity through the friction coefficient, 1/s.
    by_place, by_velocity : float
        Derivatives of the acceleration by displacement and velocity at a constant friction coefficient.
    motion : tuple of float
        Displacement, m, given force, N, and velocity, m/s.
    force : float
        Friction force, N.
    place : float
        Displacement relative to the belt, m.
    """

    rates: tuple[float, float]
    v: float
    normal_1: float
    normal_2: float
    determinant: float
    slope: float
    by_place: float
    by_velocity: float
    motion: tuple[float, float, float]
    force: float
    place: float


@constant_step.initial_state.implements(belt.Belt)
def _initial_state(scene):
    return scene.initial_x, scene.initial_v + drives.turn(scene.drive, 0.0)[1]


@constant_step.rates.implements(belt.Belt)
def _rates(scene, now, y, forcing):
    K, _, _, motion = sliding(scene, y[0], y[1], y[1] - forcing[1], forcing)
    return y[1], ring.acceleration(scene.body, K, K, motion)[0]


@constant_step.inspect.implements(belt.Belt)
def _inspect(scene, y, forcing):
    body, v = scene.body, y[1] - forcing[1]
    K, slope, viscous, motion = sliding(scene, y[0], y[1], v, forcing)
    acceleration, determinant = ring.acceleration(body, K, K, motion)
    normal, _ = ring.reactions(body, K, K, motion)
    slope = ring.acceleration_slope(body, K, K, slope, slope, motion)
    by_place, by_velocity, by_force = ring.acceleration_gradient(body, K, K, motion)
    by_velocity = by_velocity - viscous * by_force
    friction = if_force(body, viscous * v - K * normal, -K * normal)
    place, rates = y[0] - forcing[0], (y[1], acceleration)
    return Inspection(rates, v, normal, normal, determinant, slope, by_place, by_velocity, motion, friction, place)


@constant_step.seen.implements(belt.Belt, belt.BristleBelt)
def _seen(scene, y, now):
    # The record takes the rate of the sliding velocity from the differences of short steps.
    return y[0], y[1], now.force, now.place, now.v, 0.0, Unlocated(), nan


@constant_step.row.implements(belt.Belt)
def _row(scene, y, forcing):
    now = constant_step.inspect(scene, y, forcing)
    mode = 0.0 if abs(now.v) < stiction_band(scene.law) or now.v == 0.0 else 1.0 if now.v > 0.0 else -1.0
    return y[0], y[1], now.force, 0.0, mode
