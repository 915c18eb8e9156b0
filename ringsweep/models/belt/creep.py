"""Implicit steps on the belt, in the stiction band of a smooth law, where the body creeps relative to the belt."""

from __future__ import annotations

from ringsweep.models.belt.force import friction_force, length_scale
from ringsweep.models.interface import implicit
from ringsweep.physics import belt, drives
from ringsweep.physics.friction.velocity import stiction_band


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
    shift, _, belt_acceleration = forcing
    friction, _ = friction_force(scene, x[0] + shift, x[1])
    return x[1], -(scene.stiffness * (x[0] + shift) + friction) / scene.mass - belt_acceleration


@implicit.linearise.implements(belt.Belt)
def _linearise(scene, mode, common, t, forcing, x):
    shift, belt_velocity, belt_acceleration = forcing
    friction, slope = friction_force(scene, x[0] + shift, x[1])
    stiffness_per_mass = scene.stiffness / scene.mass
    acceleration = -stiffness_per_mass * (x[0] + shift) - friction / scene.mass - belt_acceleration
    return (
        (x[1], acceleration),
        (0.0, 1.0, -stiffness_per_mass, -slope / scene.mass),
        (),
        (0.0, -stiffness_per_mass * belt_velocity - drives.jerk(scene.drive, t)),
    )


@implicit.guards_and_motion.implements(belt.Belt)
def _guards_and_motion(scene, mode, common, forcing, x):
    shift, belt_velocity, belt_acceleration = forcing
    place = x[0] + shift
    friction, _ = friction_force(scene, place, x[1])
    acceleration = -(scene.stiffness * place + friction) / scene.mass
    speed = mode.sign * x[1]
    # The order is that of the rows of the series: SLOW, FAST.
    guards = speed, stiction_band(scene.law) - speed
    return guards, (place, x[1] + belt_velocity, acceleration, friction, x[0], x[1], belt_acceleration)


@implicit.motion.implements(belt.Belt, belt.BristleBelt)
def _motion(scene, forcing, x, linear):
    _, belt_velocity, belt_acceleration = forcing
    return x[1] + belt_velocity, linear[0][1] + belt_acceleration


@implicit.seen.implements(belt.Belt, belt.BristleBelt)
def _seen(scene, view):
    _, (x, velocity, acceleration, friction, place, v, belt_acceleration) = view
    return x, velocity, friction, place, v, acceleration - belt_acceleration


@implicit.near_zero.implements(belt.Belt, belt.BristleBelt)
def _near_zero(scene, motion):
    return 0.0, 0.0


@implicit.row.implements(belt.Belt)
def _row(scene, mode, forcing, x):
    _, (position, velocity, _, friction, _, _, _) = implicit.guards_and_motion(scene, mode, (), forcing, x)
    return position, velocity, friction, 0.0, 0.0
