"""Implicit steps on the belt, in the stiction band of a smooth law, where the body creeps relative to the belt."""

from __future__ import annotations

from ringsweep.models.belt.force import (
    friction_force,
    length_scale,
    located,
    net_force,
    pull,
    with_load_derivatives,
    with_loads,
)
from ringsweep.models.interface import implicit
from ringsweep.physics import belt, drives
from ringsweep.physics.forces import force_in
from ringsweep.physics.friction.velocity import region_bounds, stiction_band


# The place is relative to the drive, so that no large numbers cancel in slow creep.
@implicit.to_implicit.implements(belt.Belt)
def _to_implicit(scene, forcing, y):
    return y[0] - forcing[0], y[1]


@implicit.from_implicit.implements(belt.Belt)
def _from_implicit(scene, forcing, x):
    return x[0] + forcing[0], x[1]


@implicit.is_stiff.implements(belt.Belt)
def _is_stiff(scene, mode, y, linear):
    (_, acceleration), (_, _, _, decay), _, _ = linear
    natural_frequency = (scene.stiffness / scene.mass) ** 0.5
    return -decay > 50.0 * natural_frequency and abs(acceleration) < 0.01 * -decay * stiction_band(scene.law)


@implicit.error_scales.implements(belt.Belt)
def _error_scales(scene, tolerance, x):
    length = length_scale(scene, abs(drives.turn(scene.drive, scene.span)[1]))
    return tolerance * length, tolerance * stiction_band(scene.law)


@implicit.rates.implements(belt.Belt)
def _rates(scene, mode, common, forcing, x):
    place, velocity = x[0] + forcing[0], x[1] + forcing[1]
    friction, _ = friction_force(scene, pull(scene, place, velocity, forcing), x[1])
    return x[1], net_force(scene, place, velocity, forcing, friction) / scene.mass - forcing[2]


@implicit.linearise.implements(belt.Belt)
def _linearise(scene, mode, common, t, forcing, x):
    place, velocity, belt_velocity = x[0] + forcing[0], x[1] + forcing[1], forcing[1]
    friction, slope = friction_force(scene, pull(scene, place, velocity, forcing), x[1])
    stiffness_per_mass = scene.stiffness / scene.mass
    acceleration = -stiffness_per_mass * place - friction / scene.mass
    cube, push = place * place * place, force_in(scene.drive, forcing)
    acceleration = with_loads(scene, acceleration, 1.0 / scene.mass, velocity, cube, push) - forcing[2]
    by_time = -stiffness_per_mass * belt_velocity - drives.jerk(scene.drive, t)
    derivatives = -stiffness_per_mass, -slope / scene.mass, by_time
    by_place, by_v, by_time = with_load_derivatives(scene, derivatives, place, belt_velocity, forcing)
    return (x[1], acceleration), (0.0, 1.0, by_place, by_v), (), (0.0, by_time)


@implicit.guards_and_motion.implements(belt.Belt)
def _guards_and_motion(scene, mode, common, forcing, x):
    place, velocity = x[0] + forcing[0], x[1] + forcing[1]
    friction, _ = friction_force(scene, pull(scene, place, velocity, forcing), x[1])
    acceleration = net_force(scene, place, velocity, forcing, friction) / scene.mass
    low, high = region_bounds(scene.law, mode.region)
    speed = mode.sign * x[1]
    # The order is that of the rows of the series: SLOW, FAST.
    guards = speed - low, high - speed
    return guards, (place, velocity, acceleration, friction, x[0], x[1], forcing[2])


@implicit.motion.implements(belt.Belt, belt.BristleBelt)
def _motion(scene, forcing, x, linear):
    return x[1] + forcing[1], linear[0][1] + forcing[2]


@implicit.seen.implements(belt.Belt, belt.BristleBelt)
def _seen(scene, view):
    _, (x, velocity, acceleration, friction, place, v, belt_acceleration) = view
    return x, velocity, friction, place, v, acceleration - belt_acceleration, located(scene, x, acceleration)


@implicit.near_zero.implements(belt.Belt, belt.BristleBelt)
def _near_zero(scene, motion):
    return 0.0, 0.0


@implicit.row.implements(belt.Belt)
def _row(scene, mode, forcing, x):
    _, (position, velocity, _, friction, _, _, _) = implicit.guards_and_motion(scene, mode, (), forcing, x)
    return position, velocity, friction, 0.0, 0.0
