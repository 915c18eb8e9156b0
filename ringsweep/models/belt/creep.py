"""Implicit steps on the belt, in the stiction band of a smooth law, where the body creeps relative to the belt."""

from __future__ import annotations

from math import nan

from ringsweep.compile import absorbed, inlined, unrolled
from ringsweep.models.belt.force import length_scale, located, sliding, sliding_slopes
from ringsweep.models.interface import implicit
from ringsweep.physics import belt, drives, ring
from ringsweep.physics.forces import force_rate
from ringsweep.physics.friction.velocity import region_bounds, stiction_band


@implicit.is_stiff.implements(belt.Belt)
def _is_stiff(scene, mode, y, linear):
    (_, acceleration), (_, _, _, decay), _, _ = linear
    natural_frequency = (scene.body.stiffness / scene.body.mass) ** 0.5
    return -decay > 50.0 * natural_frequency and abs(acceleration) < 0.01 * -decay * stiction_band(scene.law)


@implicit.error_scales.implements(belt.Belt)
def _error_scales(scene, tolerance, x):
    length = length_scale(scene, abs(drives.turn(scene.drive, scene.span)[1]))
    return tolerance * length, tolerance * stiction_band(scene.law)


@absorbed
def _in_step(scene, forcing, x):
    """What :func:`sliding` returns for the state of an implicit step."""
    return sliding(scene, x[0] + forcing[0], x[1] + forcing[1], x[1], forcing)


@implicit.rates.implements(belt.Belt)
def _rates(scene, mode, common, forcing, x):
    K, _, _, motion = _in_step(scene, forcing, x)
    return x[1], ring.acceleration(scene.body, K, K, motion)[0] - forcing[2]


@implicit.linearise.implements(belt.Belt)
def _linearise(scene, mode, common, t, forcing, x):
    K, slope, viscous, motion = _in_step(scene, forcing, x)
    by_place, by_v, by_velocity, by_force = sliding_slopes(scene, K, slope, viscous, motion)
    rate = by_place * forcing[1] + by_velocity * forcing[2] + by_force * force_rate(scene.drive, forcing)
    acceleration = ring.acceleration(scene.body, K, K, motion)[0] - forcing[2]
    return (x[1], acceleration), (0.0, 1.0, by_place, by_v), (), (0.0, rate - drives.jerk(scene.drive, t))


@inlined
def all_guards(body, normal, slow, fast):
    """The guards of a mode: the normal reaction is one of them only if it varies."""
    return ring.if_load_varies(body, (normal, slow, fast), (slow, fast))


@inlined
def view(scene, forcing, x, place, friction, motion, guards):
    """View of a state in slip.

    `place` is that on the belt, m, and `friction` are K and the viscous friction, N. `x` has the sliding velocity.
    """
    K, viscous = friction
    acceleration, _ = ring.acceleration(scene.body, K, K, motion)
    normal, _ = ring.reactions(scene.body, K, K, motion)
    seen = motion[0], motion[2], acceleration, viscous - K * normal, place, x[1], forcing[2], _deflection(x, nan)
    return all_guards(scene.body, normal, *guards), seen


@unrolled
def _deflection(length, x, missing):
    """Deflection of the bristles; `missing` without bristles."""
    return ["return x[2]" if length > 2 else "return missing"]


@implicit.guards_and_motion.implements(belt.Belt)
def _guards_and_motion(scene, mode, common, forcing, x):
    K, _, viscous, motion = _in_step(scene, forcing, x)
    low, high = region_bounds(scene.law, mode.region)
    speed = mode.sign * x[1]
    return view(scene, forcing, x, x[0], (K, viscous * x[1]), motion, (speed - low, high - speed))


@implicit.seen.implements(belt.Belt, belt.BristleBelt)
def _seen(scene, view):
    _, (x, velocity, acceleration, friction, place, v, belt_acceleration, deflection) = view
    jumps = located(scene, x, acceleration)
    return x, velocity, friction, place, v, acceleration - belt_acceleration, jumps, deflection


@implicit.near_zero.implements(belt.Belt, belt.BristleBelt)
def _near_zero(scene, motion):
    return all_guards(scene.body, 0.05 * scene.body.mass * scene.body.gravity, 0.0, 0.0)


@implicit.row.implements(belt.Belt)
def _row(scene, mode, forcing, x):
    _, (position, velocity, _, friction, _, _, _, _) = implicit.guards_and_motion(scene, mode, (), forcing, x)
    return position, velocity, friction, 0.0, 0.0
