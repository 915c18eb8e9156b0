"""The belt with bristles, for all solvers.

The state is ``(x, velocity, z)`` for steps of constant length, with the velocity in space, and ``(x, v, z)`` for
implicit steps, with the sliding velocity. z is the deflection of the bristles.
"""

from __future__ import annotations

from math import sqrt
from typing import NamedTuple

from ringsweep.compile import absorbed, inlined
from ringsweep.models.belt.force import (
    acceleration,
    bend,
    damping,
    net_force,
    steepest_spring,
    with_load_derivatives,
    with_loads,
)
from ringsweep.models.belt.record import begin
from ringsweep.models.interface import constant_step, implicit, modes, recorder
from ringsweep.models.interface.status import RUNNING
from ringsweep.models.parts import larger_eigenvalue
from ringsweep.numerics.functions import any_of, select
from ringsweep.physics import drives
from ringsweep.physics.belt import BristleBelt
from ringsweep.physics.forces import force_in
from ringsweep.physics.friction.bristles import after_yield, bristle, initial_deflection, region_guard, stick_speed
from ringsweep.physics.friction.velocity import BAND, KINETIC


@absorbed
def contact_force(scene, v, z, sign, region):
    """Rate of the deflection (m/s) and its derivatives by v and z; friction force (N) and its derivatives."""
    rate, rate_v, rate_z, traction, by_v, by_z = bristle(scene.law, scene.mu_s, scene.mu_k, v, z, sign, region)
    load = scene.mass * scene.gravity
    return rate, rate_v, rate_z, load * traction, load * by_v, load * by_z


@inlined
def _region(scene, v, z, sign):
    """BAND if the contact counts as stuck, KINETIC if it slips."""
    return BAND if _in_band(scene, v, z, sign) else KINETIC


@absorbed
def _in_band(scene, v, z, sign):
    """Whether the contact counts as stuck."""
    return region_guard(scene.law, scene.mu_s, scene.mu_k, v, z, sign, BAND) > 0.0


@absorbed
def _force_in_region(scene, v, z):
    """Whether the contact counts as stuck, and :func:`contact_force` in its region, for floats and Lanes."""
    sign = select(v >= 0.0, 1.0, -1.0)
    stuck = _in_band(scene, v, z, sign)
    a = contact_force(scene, v, z, sign, BAND)
    b = contact_force(scene, v, z, sign, KINETIC)
    return stuck, (
        select(stuck, a[0], b[0]),
        select(stuck, a[1], b[1]),
        select(stuck, a[2], b[2]),
        select(stuck, a[3], b[3]),
        select(stuck, a[4], b[4]),
        select(stuck, a[5], b[5]),
    )


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
    trace, determinant : float
        Trace, 1/s, and determinant, 1/s^2, of the linearised contact.
    stuck : float
        1 if the contact counts as stuck, else 0.
    place, v : float
        Displacement relative to the belt, m, and sliding velocity, m/s.
    """

    rates: tuple[float, float, float]
    force: float
    trace: float
    determinant: float
    stuck: float
    place: float
    v: float


@constant_step.initial_state.implements(BristleBelt)
def _initial_state_in_space(scene):
    velocity = scene.initial_v + drives.turn(scene.drive, 0.0)[1]
    return scene.initial_x, velocity, initial_deflection(scene.law, scene.mu_s, scene.mu_k)


@constant_step.rates.implements(BristleBelt)
def _rates(scene, now, y, forcing):
    _, (rate, _, _, force, _, _) = _force_in_region(scene, y[1] - forcing[1], y[2])
    return y[1], acceleration(scene, y[0], y[1], forcing, force), rate


@constant_step.inspect.implements(BristleBelt)
def _inspect(scene, y, forcing):
    v = y[1] - forcing[1]
    stuck, (rate, rate_v, rate_z, force, by_v, by_z) = _force_in_region(scene, v, y[2])
    per_mass = 1.0 / scene.mass
    stiffness = steepest_spring(scene.cubic, scene.stiffness, bend(scene.cubic, y[0]), bend(scene.cubic, y[0]))
    by_v = damping(scene, by_v)
    determinant = (stiffness + by_z * rate_v - by_v * rate_z) * per_mass
    rates = y[1], acceleration(scene, y[0], y[1], forcing, force), rate
    place = y[0] - forcing[0]
    return Inspection(rates, force, rate_z - by_v * per_mass, determinant, select(stuck, 1.0, 0.0), place, v)


@constant_step.eigenvalue.implements(BristleBelt)
def _eigenvalue(scene, before, now, h, most):
    if any_of(most == 0.0):
        most = larger_eigenvalue(most, before.trace, before.determinant)
    return larger_eigenvalue(most, now.trace, now.determinant)


@constant_step.sticks.implements(BristleBelt)
def _sticks(scene, before, now):
    return before.stuck > 0.0


@recorder.begin.implements(BristleBelt)
def _begin(scene, t, seen):
    return begin(scene, t, seen, stick_speed(scene.law, _recoil_speed(scene)), _play(scene))


@constant_step.row.implements(BristleBelt)
def _row(scene, y, forcing):
    now = constant_step.inspect(scene, y, forcing)
    return y[0], y[1], now.force, y[2], 0.0 if now.stuck > 0.0 else 1.0 if y[1] > forcing[1] else -1.0


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
        forcing = drives.turn(scene.drive, t)
        total = -scene.stiffness * x - force - scene.mass * forcing[2]
        push = force_in(scene.drive, forcing)
        sign = 1 if with_loads(scene, total, 1.0, forcing[1], x * x * x, push) > 0.0 else -1
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
    rate, _, _, force, _, _ = contact_force(scene, x[1], x[2], float(mode.sign), mode.region)
    velocity = x[1] + forcing[1]
    return velocity, net_force(scene, x[0], velocity, forcing, force) / scene.mass - forcing[2], rate


@implicit.linearise.implements(BristleBelt)
def _linearise(scene, mode, common, t, forcing, x):
    rate, rate_v, rate_z, force, by_v, by_z = contact_force(scene, x[1], x[2], float(mode.sign), mode.region)
    velocity = x[1] + forcing[1]
    derivatives = -scene.stiffness / scene.mass, -by_v / scene.mass, -drives.jerk(scene.drive, t)
    by_place, by_velocity, by_time = with_load_derivatives(scene, derivatives, x[0], 0.0, forcing)
    return (
        (velocity, net_force(scene, x[0], velocity, forcing, force) / scene.mass - forcing[2], rate),
        (0.0, 1.0, by_place, by_velocity),
        ((-by_z / scene.mass, rate_v, rate_z),),
        (forcing[2], by_time, 0.0),
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
    sign, velocity = float(mode.sign), x[1] + forcing[1]
    _, _, _, force, _, _ = contact_force(scene, x[1], x[2], sign, mode.region)
    guards = sign * x[1], region_guard(scene.law, scene.mu_s, scene.mu_k, x[1], x[2], sign, mode.region)
    acceleration = net_force(scene, x[0], velocity, forcing, force) / scene.mass
    return guards, (x[0], velocity, acceleration, force, x[0] - forcing[0], x[1], forcing[2])


@implicit.row.implements(BristleBelt)
def _implicit_row(scene, mode, forcing, x):
    _, (place, velocity, _, force, _, _, _) = implicit.guards_and_motion(scene, mode, (), forcing, x)
    return place, velocity, force, x[2], 0.0 if mode.region == BAND else float(mode.sign)
