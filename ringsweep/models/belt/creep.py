"""The belt within the stiction band of a smooth law, where the body creeps along with the belt."""

from __future__ import annotations

from ringsweep.models.belt.force import friction_force, length_scale
from ringsweep.models.interface import implicit
from ringsweep.physics import belt, drives
from ringsweep.physics.friction.velocity import (
    stiction_band,
)


# The place relative to the drive, so that nothing large cancels in a creep.
@implicit.to_implicit.implements(belt.Belt)
def _to_implicit(scene, force, y):
    return y[0] - force[0], y[1]


@implicit.from_implicit.implements(belt.Belt)
def _from_implicit(scene, force, x):
    return x[0] + force[0], x[1]


@implicit.is_stiff.implements(belt.Belt)
def _is_stiff(scene, mode, y, line):
    (_, push), (_, _, _, decay), _, _ = line
    own = (scene.stiffness / scene.mass) ** 0.5
    return -decay > 50.0 * own and abs(push) < 0.01 * -decay * stiction_band(scene.law)


@implicit.error_scales.implements(belt.Belt)
def _error_scales(scene, tolerance, x):
    length = length_scale(scene, abs(drives.turn(scene.drive, scene.span)[1]))
    return tolerance * length, tolerance * stiction_band(scene.law)


@implicit.rates.implements(belt.Belt)
def _rates(scene, mode, force, x):
    shift, _, belt_acceleration = force
    drag, _ = friction_force(scene, x[0] + shift, x[1])
    return x[1], -(scene.stiffness * (x[0] + shift) + drag) / scene.mass - belt_acceleration


@implicit.linearise.implements(belt.Belt)
def _linearise(scene, mode, t, x):
    shift, belt_velocity, belt_acceleration = drives.turn(scene.drive, t)
    drag, slope = friction_force(scene, x[0] + shift, x[1])
    rate = scene.stiffness / scene.mass
    push = -rate * (x[0] + shift) - drag / scene.mass - belt_acceleration
    return (
        (x[1], push),
        (0.0, 1.0, -rate, -slope / scene.mass),
        (),
        (0.0, -rate * belt_velocity - drives.jerk(scene.drive, t)),
    )


@implicit.guards_and_motion.implements(belt.Belt)
def _guards_and_motion(scene, mode, t, x):
    shift, belt_velocity, _ = drives.turn(scene.drive, t)
    place = x[0] + shift
    force, _ = friction_force(scene, place, x[1])
    acceleration = -(scene.stiffness * place + force) / scene.mass
    speed = mode.sign * x[1]
    # In the order of the rows of the series: SLOW, FAST.
    return (speed, stiction_band(scene.law) - speed), (place, x[1] + belt_velocity, acceleration, force)


@implicit.motion.implements(belt.Belt, belt.BristleBelt)
def _motion(scene, t, x, line):
    _, belt_velocity, belt_acceleration = drives.turn(scene.drive, t)
    return x[1] + belt_velocity, line[0][1] + belt_acceleration


@implicit.seen.implements(belt.Belt, belt.BristleBelt)
def _seen(scene, view):
    _, (x, velocity, _, force) = view
    return x, velocity, force


@implicit.near_zero.implements(belt.Belt, belt.BristleBelt)
def _near_zero(scene, motion):
    return 0.0, 0.0


@implicit.row.implements(belt.Belt)
def _row(scene, mode, t, x):
    _, (position, velocity, _, force) = implicit.guards_and_motion(scene, mode, t, x)
    return position, velocity, force, 0.0, 0.0
