"""The belt within the stiction band of a smooth law, where the body creeps along with the belt."""

from __future__ import annotations

from ringsweep import hooks
from ringsweep.models.belt.force import friction_force, length_scale
from ringsweep.models.belt.record import observe
from ringsweep.physics import belt, drives
from ringsweep.physics.friction.velocity import (
    stiction_band,
)

# ---- creep in the stiction band --------------------------------------------------------------


@hooks.is_stiff.implements(belt.Belt)
def _is_stiff(scene, mode, y, line):
    (_, push), (_, _, _, decay), _, _ = line
    own = (scene.stiffness / scene.mass) ** 0.5
    return -decay > 50.0 * own and abs(push) < 0.01 * -decay * stiction_band(scene.law)


@hooks.stiff_scales.implements(belt.Belt)
def _stiff_scales(scene, tolerance, x):
    length = length_scale(scene, abs(drives.turn(scene.drive, scene.span)[1]))
    return tolerance * length, tolerance * stiction_band(scene.law)


@hooks.stiff_rates.implements(belt.Belt)
def _stiff_rates(scene, mode, force, x):
    shift, _, belt_acceleration = force
    drag, _ = friction_force(scene, x[0] + shift, x[1])
    return x[1], -(scene.stiffness * (x[0] + shift) + drag) / scene.mass - belt_acceleration


@hooks.linearise.implements(belt.Belt)
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


@hooks.stiff_view.implements(belt.Belt)
def _stiff_view(scene, mode, t, x):
    shift, belt_velocity, _ = drives.turn(scene.drive, t)
    place = x[0] + shift
    force, _ = friction_force(scene, place, x[1])
    acceleration = -(scene.stiffness * place + force) / scene.mass
    speed = mode.sign * x[1]
    # In the order of the rows of the series: SLOW, FAST.
    return (speed, stiction_band(scene.law) - speed), (place, x[1] + belt_velocity, acceleration, force)


@hooks.stiff_motion.implements(belt.Belt, belt.BristleBelt)
def _stiff_motion(scene, t, x, line):
    _, belt_velocity, belt_acceleration = drives.turn(scene.drive, t)
    return x[1] + belt_velocity, line[0][1] + belt_acceleration


@hooks.stiff_watch.implements(belt.Belt)
def _stiff_watch(scene, record, mode, view, t, duration):
    _, (x, velocity, _, force) = view
    return observe(record, scene, t, duration, x, velocity, force, True, 0.0)


@hooks.stiff_sample.implements(belt.Belt)
def _stiff_sample(scene, mode, t, x):
    _, (position, velocity, _, force) = hooks.stiff_view(scene, mode, t, x)
    return position, velocity, force, 0.0, 0.0
