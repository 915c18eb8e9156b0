"""The belt with bristles, for all solvers.

The state is ``(x, velocity, z)`` for steps of constant length, with the velocity in space, and ``(x, v, z)`` for
implicit steps, with the sliding velocity. z is the deflection of the bristles.
"""

from __future__ import annotations

from math import sqrt
from typing import NamedTuple

from ringsweep.compile import inlined
from ringsweep.models.belt.record import conclude, observe
from ringsweep.models.interface import constant_step, implicit, modes, recorder
from ringsweep.models.interface.status import RUNNING
from ringsweep.models.parts import largest_eigenvalue
from ringsweep.physics import drives
from ringsweep.physics.belt import BristleBelt
from ringsweep.physics.friction.bristles import after_yield, bristle, initial_deflection, region_guard, stick_speed
from ringsweep.physics.friction.velocity import BAND, KINETIC


@inlined
def contact_force(scene, v, z, sign, region):
    """Rate of the deflection (m/s) and its derivatives by v and z; friction force (N) and its derivatives."""
    rate, rate_v, rate_z, traction, by_v, by_z = bristle(scene.law, scene.mu_s, scene.mu_k, v, z, sign, region)
    load = scene.mass * scene.gravity
    return rate, rate_v, rate_z, load * traction, load * by_v, load * by_z


@inlined
def _region(scene, v, z, sign):
    """BAND if the contact counts as stuck, KINETIC if it slips."""
    return BAND if region_guard(scene.law, scene.mu_s, scene.mu_k, v, z, sign, BAND) > 0.0 else KINETIC


@inlined
def _recoil_speed(scene):
    """Speed of a body that bristles drive back from their largest deflection, m/s."""
    return scene.mu_s * sqrt(scene.gravity / scene.law.sigma0)


@inlined
def _play(scene):
    """Distance that the body moves while its bristles go from one largest deflection to the other, m."""
    return 2.0 * scene.mu_s / scene.law.sigma0


class Inspection(NamedTuple):
    """Inspection of a state of the belt.

    Attributes
    ----------
    rates : tuple of float
        Time derivative of the state.
    force : float
        Friction force, N.
    eigenvalue : float
        Largest magnitude of an eigenvalue of the contact, 1/s.
    stuck : bool
        Whether the contact counts as stuck.
    """

    rates: tuple[float, float, float]
    force: float
    eigenvalue: float
    stuck: bool


@constant_step.initial_state.implements(BristleBelt)
def _initial_state_in_space(scene):
    velocity = scene.initial_v + drives.turn(scene.drive, 0.0)[1]
    return scene.initial_x, velocity, initial_deflection(scene.law, scene.mu_s, scene.mu_k)


@constant_step.rates.implements(BristleBelt)
def _rates(scene, now, y, drive_at, drive_rate):
    v = y[1] - drive_rate
    sign = 1.0 if v >= 0.0 else -1.0
    rate, _, _, force, _, _ = contact_force(scene, v, y[2], sign, _region(scene, v, y[2], sign))
    return y[1], -(scene.stiffness * y[0] + force) / scene.mass, rate


@constant_step.inspect.implements(BristleBelt)
def _inspect(scene, y, drive_at, drive_rate):
    v = y[1] - drive_rate
    sign = 1.0 if v >= 0.0 else -1.0
    region = _region(scene, v, y[2], sign)
    rate, rate_v, rate_z, force, by_v, by_z = contact_force(scene, v, y[2], sign, region)
    determinant = (scene.stiffness + by_z * rate_v - by_v * rate_z) / scene.mass
    eigenvalue = largest_eigenvalue(rate_z - by_v / scene.mass, determinant)
    rates = y[1], -(scene.stiffness * y[0] + force) / scene.mass, rate
    return Inspection(rates, force, eigenvalue, region == BAND)


@constant_step.stiffness.implements(BristleBelt)
def _stiffness(scene, before, now, h):
    return max(before.eigenvalue, now.eigenvalue) * h


@constant_step.sticks.implements(BristleBelt)
def _sticks(scene, before, now):
    return before.stuck


@recorder.observe.implements(BristleBelt)
def _observe(scene, record, t, duration, stuck, seen):
    x, velocity, force = seen
    return observe(record, scene, t, duration, x, velocity, force, stuck, _play(scene))


@recorder.conclude.implements(BristleBelt)
def _conclude(scene, record, status, t, place, velocity):
    return conclude(record, scene, status, t, place, velocity, stick_speed(scene.law, _recoil_speed(scene)))


@constant_step.row.implements(BristleBelt)
def _row(scene, y, drive_at, drive_rate):
    now = constant_step.inspect(scene, y, drive_at, drive_rate)
    return y[0], y[1], now.force, y[2], 0.0 if now.stuck else 1.0 if y[1] > drive_rate else -1.0


# Indices of the guards.
SLOW, FAST = range(2)


class Mode(NamedTuple):
    """Mode: sign of the sliding velocity, and whether the contact counts as stuck (BAND) or slips (KINETIC)."""

    sign: int
    region: int


@modes.initial_state.implements(BristleBelt)
def _initial_state(scene):
    z = initial_deflection(scene.law, scene.mu_s, scene.mu_k)
    v = drives.velocity_at_beginning(scene.drive, scene.initial_v)
    return drives.beginning(scene.drive), (scene.initial_x, v, z)


@modes.initial_mode.implements(BristleBelt)
def _initial_mode(scene, t, y):
    x, v, z = y
    sign = 1 if v > 0.0 else -1
    if v == 0.0:
        # The body begins to slide in the direction of the net force; without a net force the belt leaves it behind.
        _, _, _, force, _, _ = contact_force(scene, v, z, 1.0, BAND)
        net_force = -scene.stiffness * x - force - scene.mass * drives.turn(scene.drive, t)[2]
        sign = 1 if net_force > 0.0 else -1
    return RUNNING, Mode(sign, _region(scene, v, z, float(sign)))


@modes.switch.implements(BristleBelt)
def _switch(scene, mode, guard, t, y):
    x, v, z = y
    if guard == SLOW:
        return RUNNING, Mode(-mode.sign, BAND), (x, 0.0, z)
    z, region = after_yield(scene.law, scene.mu_s, scene.mu_k, z, float(mode.sign), mode.region)
    return RUNNING, Mode(mode.sign, region), (x, v, z)


@implicit.rates.implements(BristleBelt)
def _implicit_rates(scene, mode, common, forcing, x):
    _, belt_velocity, belt_acceleration = forcing
    rate, _, _, force, _, _ = contact_force(scene, x[1], x[2], float(mode.sign), mode.region)
    return x[1] + belt_velocity, -(scene.stiffness * x[0] + force) / scene.mass - belt_acceleration, rate


@implicit.linearise.implements(BristleBelt)
def _linearise(scene, mode, common, t, forcing, x):
    _, belt_velocity, belt_acceleration = forcing
    rate, rate_v, rate_z, force, by_v, by_z = contact_force(scene, x[1], x[2], float(mode.sign), mode.region)
    return (
        (x[1] + belt_velocity, -(scene.stiffness * x[0] + force) / scene.mass - belt_acceleration, rate),
        (0.0, 1.0, -scene.stiffness / scene.mass, -by_v / scene.mass),
        ((-by_z / scene.mass, rate_v, rate_z),),
        (belt_acceleration, -drives.jerk(scene.drive, t), 0.0),
    )


@implicit.error_scales.implements(BristleBelt)
def _error_scales(scene, tolerance, x):
    deflection = scene.mu_s / scene.law.sigma0
    return (
        tolerance * (abs(x[0]) + deflection),
        tolerance * (abs(x[1]) + _recoil_speed(scene)),
        tolerance * deflection,
        tolerance * scene.mu_s * scene.gravity,
    )


@implicit.guards_and_motion.implements(BristleBelt)
def _guards_and_motion(scene, mode, common, forcing, x):
    _, belt_velocity, _ = forcing
    sign = float(mode.sign)
    _, _, _, force, _, _ = contact_force(scene, x[1], x[2], sign, mode.region)
    guards = sign * x[1], region_guard(scene.law, scene.mu_s, scene.mu_k, x[1], x[2], sign, mode.region)
    return guards, (x[0], x[1] + belt_velocity, -(scene.stiffness * x[0] + force) / scene.mass, force)


@implicit.row.implements(BristleBelt)
def _implicit_row(scene, mode, forcing, x):
    _, (place, velocity, _, force) = implicit.guards_and_motion(scene, mode, (), forcing, x)
    return place, velocity, force, x[2], 0.0 if mode.region == BAND else float(mode.sign)
