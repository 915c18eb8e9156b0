"""The belt with bristles, for all solvers.

The state is ``(x, velocity, z)`` for steps of constant length, with the velocity in space. Otherwise it is
``(x, v, z)``, with the sliding velocity. z is the deflection of the bristles.
"""

from __future__ import annotations

from math import sqrt

from ringsweep.compile import absorbed, inlined
from ringsweep.models.belt.force import length_scale
from ringsweep.models.belt.record import begin
from ringsweep.models.belt.series import Mode
from ringsweep.models.inspection import slip_in_space
from ringsweep.models.interface import constant_step, implicit, modes, recorder
from ringsweep.models.interface.status import RUNNING, SEPARATED_1
from ringsweep.models.slip import Bundle, Slip, region_guards, slip
from ringsweep.numerics.functions import select
from ringsweep.numerics.memory import select_all
from ringsweep.physics import drives, ring
from ringsweep.physics.belt import BristleBelt
from ringsweep.physics.forces import force_in
from ringsweep.physics.friction.bristles import after_yield, bristle, initial_deflection, region_guard, stick_speed
from ringsweep.physics.friction.velocity import BAND, KINETIC


@absorbed
def contact(scene, v, z, sign, region):
    """Rate of the deflection (m/s) and its derivatives by v and z; friction K and its derivatives (s/m, 1/m)."""
    rate, rate_v, rate_z, traction, by_v, by_z = bristle(scene.law, scene.mu_s, scene.mu_k, v, z, sign, region)
    return rate, rate_v, rate_z, -traction, -by_v, -by_z


@absorbed
def _in_band(scene, v, z, sign):
    """Whether the contact counts as stuck."""
    return region_guard(scene.law, scene.mu_s, scene.mu_k, v, z, sign, BAND) > 0.0


@inlined
def recoil_speed(scene):
    """Speed of a body that bristles drive back from their largest deflection, m/s."""
    return scene.mu_s * sqrt(scene.body.gravity / scene.law.sigma0)


@inlined
def _play(scene):
    """Distance that the body moves while its bristles go from one largest deflection to the other, m."""
    return 2.0 * scene.mu_s / scene.law.sigma0


@inlined
def _deflection_at_start(scene):
    """Deflection of the bristles at t = 0, m. It also resets the memory that the law may have."""
    return initial_deflection(scene.law, scene.mu_s, scene.mu_k) + scene.initial_z


@constant_step.initial_state.implements(BristleBelt)
def _initial_state_in_space(scene):
    velocity = scene.initial_v + drives.turn(scene.drive, 0.0)[1]
    return scene.initial_x, velocity, _deflection_at_start(scene)


@slip_in_space.implements(BristleBelt)
def _slip_in_space(scene, y, v, forcing, angle):
    sign = select(v >= 0.0, 1.0, -1.0)
    stuck = _in_band(scene, v, y[2], sign)
    a, b = contact(scene, v, y[2], sign, BAND), contact(scene, v, y[2], sign, KINETIC)
    rate, rate_v, rate_z, K, slope_v, slope_z = select_all(stuck, a, b)
    motion, bundle = (y[0], force_in(scene.drive, forcing), y[1]), Bundle(rate, rate_v, rate_z, slope_z)
    return Slip(motion, v, (K, K), (slope_v, slope_v), 0.0, (bundle,)), select(stuck, 1.0, 0.0)


@recorder.begin.implements(BristleBelt)
def _begin(scene, t, seen):
    return begin(scene, t, seen, stick_speed(scene.law, recoil_speed(scene)), _play(scene))


@recorder.keep_memory.implements(BristleBelt)
def _keep_deflection(scene, row, column, y):
    if column < len(row):
        row[column] = y[2]


@modes.begin.implements(BristleBelt)
def _begin_modes(scene):
    t, x, z = drives.beginning(scene.drive), scene.initial_x, _deflection_at_start(scene)
    v = drives.velocity_at_beginning(scene.drive, scene.initial_v)
    sign = 1 if v > 0.0 else -1
    _, _, _, K, _, _ = contact(scene, v, z, 1.0, BAND)
    forcing = drives.turn(scene.drive, t)
    motion = x, force_in(scene.drive, forcing), v + forcing[1]
    if v == 0.0:
        # The body begins to slide in the direction of the net force; without a net force the belt leaves it behind.
        sign = 1 if ring.acceleration(scene.body, K, K, motion)[0] > forcing[2] else -1
    mode = Mode(sign, BAND if _in_band(scene, v, z, float(sign)) else KINETIC, -1)
    load = ring.reactions(scene.body, K, K, motion)[0]
    if load == 0.0:
        # The contact holds if the load begins to grow.
        ahead = motion[2] if motion[2] != 0.0 else ring.acceleration(scene.body, K, K, motion)[0]
        load = ring.held(scene.body, 0.0, (ahead, 0.0, 0.0), 0.0, 0.0, 0.0)[0]
        opens = load <= 0.0
    else:
        opens = load < 0.0
    return t, (x, v, z), (SEPARATED_1 if ring.if_load_varies(scene.body, opens, False) else RUNNING), mode


@modes.switch.implements(BristleBelt)
def _switch(scene, mode, guard, t, y):
    x, v, z = y
    # The order is that of `all_guards`.
    after_normal = ring.if_load_varies(scene.body, guard - 1, guard)
    if after_normal < 0:
        return SEPARATED_1, mode, y
    if after_normal == 0:
        return RUNNING, Mode(-mode.sign, BAND, -1), (x, 0.0, z)
    z, region = after_yield(scene.law, scene.mu_s, scene.mu_k, z, float(mode.sign), mode.region)
    return RUNNING, Mode(mode.sign, region, -1), (x, v, z)


@implicit.to_implicit.implements(BristleBelt)
def _to_implicit(scene, forcing, y):
    return y[0] - forcing[0], y[1], y[2]


@implicit.from_implicit.implements(BristleBelt)
def _from_implicit(scene, forcing, x):
    return x[0] + forcing[0], x[1], x[2]


@slip.implements(BristleBelt)
def _slip(scene, mode, common, forcing, x):
    _, v, z = x
    motion = x[0] + forcing[0], force_in(scene.drive, forcing), v + forcing[1]
    rate, rate_v, rate_z, K, slope_v, slope_z = contact(scene, v, z, float(mode.sign), mode.region)
    return Slip(motion, v, (K, K), (slope_v, slope_v), 0.0, (Bundle(rate, rate_v, rate_z, slope_z),))


@region_guards.implements(BristleBelt)
def _region_guards(scene, mode, common, x):
    _, v, z = x
    sign = float(mode.sign)
    return sign * v, region_guard(scene.law, scene.mu_s, scene.mu_k, v, z, sign, mode.region)


@implicit.error_scales.implements(BristleBelt)
def _error_scales(scene, tolerance, x):
    deflection = scene.mu_s / scene.law.sigma0
    return (
        tolerance * (length_scale(scene, abs(x[1])) + deflection),
        tolerance * (abs(x[1]) + recoil_speed(scene)),
        tolerance * deflection,
        tolerance * scene.mu_s * scene.body.gravity,
    )
