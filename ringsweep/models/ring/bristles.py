"""The ring with bristles, one bundle at each contact, for all solvers.

Friction per unit of the normal reaction is ``K_i = -(sigma0 z_i + sigma1 dz_i/dt + sigma2 v)``. The coefficients are
those of the surface under the contact. The state is ``(phi, omega, z_1, z_2)`` for steps of constant length, and
``(rho, v, z_1, z_2)``, with the angle in the ring's frame and the sliding velocity, for implicit steps. At launch the
bristles are deflected as in steady sliding at the launch velocity.

Read :mod:`ringsweep.physics.friction.presliding` first. `under` is the static and kinetic coefficient under contact 1
and contact 2; `sign` is the direction of the slip that the bristles resist; `region` is BAND while the body counts as
stuck, else KINETIC.
"""

from __future__ import annotations

from math import sqrt

from ringsweep.compile import absorbed, inlined
from ringsweep.models.inspection import slip_in_space
from ringsweep.models.interface import constant_step, implicit, modes, recorder
from ringsweep.models.interface.status import BROKEN, JAM, RUNNING
from ringsweep.models.ring.contacts import coefficients_in_slip, places_after_edge
from ringsweep.models.ring.series import (
    DETERMINANT,
    FAST,
    NORMAL_1,
    NORMAL_2,
    SLOW,
    after_jump,
    friction_and_motion,
    held_at,
    is_jamming,
    lost_in_slip,
    seen_in_slip_at_once,
    slipping,
    with_places,
    with_slip,
)
from ringsweep.models.sliding import rate_at_rest
from ringsweep.models.slip import Slip, bundled, region_guards, slip, slip_at
from ringsweep.numerics.functions import select, sine_cosine_from
from ringsweep.physics import drives, ring
from ringsweep.physics.friction.presliding import part_before_bend, region_guard, steady_deflection
from ringsweep.physics.friction.velocity import BAND, KINETIC
from ringsweep.physics.friction.ways import along, towards
from ringsweep.physics.ring import BristleRing
from ringsweep.physics.zones import roughest


@absorbed
def slip_of(scene, under, motion, x, sign, region):
    """The :class:`Slip` of a state of implicit steps, for floats and Lanes.

    Parameters
    ----------
    scene : BristleRing
    under : tuple of float
        Coefficients under the contacts, as ``coefficients_in_slip`` returns them.
    motion : tuple of float
        As for :func:`ringsweep.physics.ring.acceleration`.
    x : tuple of float
        The state; the place does not matter.
    sign, region
        As for :func:`ringsweep.physics.friction.presliding.bristle`.
    """
    _, v, z_1, z_2 = x
    K1, slope_1, first = bundled(scene.law, under[:2], v, z_1, sign, region)
    K2, slope_2, second = bundled(scene.law, under[2:], v, z_2, sign, region)
    return Slip(motion, v / scene.body.radius, (K1, K2), (slope_1, slope_2), 0.0, (first, second))


@absorbed
def _region_guard(scene, under, v, z_1, z_2, sign, region):
    """Guard of a region, positive while the region lasts. The body counts as stuck while both contacts do."""
    first = region_guard(scene.law, *under[:2], v, z_1, sign, region)
    second = region_guard(scene.law, *under[2:], v, z_2, sign, region)
    return min(first, second) if region == BAND else max(first, second)


@inlined
def _initial_deflections(scene):
    """Deflections at launch, m."""
    v = ring.launch_velocity(scene) * scene.body.radius
    rho = scene.initial_phi - drives.turn(scene.drive, 0.0)[0]
    mu_s1, mu_k1, mu_s2, mu_k2 = towards(scene.law, ring.coefficients_at(scene, rho), v)
    return steady_deflection(scene.law, mu_s1, mu_k1, v), steady_deflection(scene.law, mu_s2, mu_k2, v)


@constant_step.initial_state.implements(BristleRing)
def _initial_state_on_bristle_ring(scene):
    """Implement :func:`constant_step.initial_state`: ``(phi, omega, z_1, z_2)``; rad, rad/s, m."""
    z_1, z_2 = _initial_deflections(scene)
    return scene.initial_phi, scene.initial_omega, z_1, z_2


@slip_in_space.implements(BristleRing)
def _slip_in_space_on_bristle_ring(scene, y, v, forcing, angle):
    """Implement :func:`slip_in_space`; what it adds to the slip is 1 if the body counts as stuck, else 0."""
    rho, _, z_1, z_2 = y[0] - forcing[0], y[1], y[2], y[3]
    sign = select(v >= 0.0, 1.0, -1.0)
    under = towards(scene.law, ring.coefficients_at(scene, rho), sign)
    stuck = select(_region_guard(scene, under, v, z_1, z_2, sign, BAND) > 0.0, 1.0, 0.0)
    return slip_of(scene, under, (*angle, y[1]), (rho, v, z_1, z_2), sign, BAND), stuck


@modes.begin.implements(BristleRing)
def _begin_on_bristle_ring(scene):
    """Implement :func:`modes.begin`; the state is ``(rho, v, z_1, z_2)``."""
    t = drives.beginning(scene.drive)
    rho = scene.initial_phi - drives.turn(scene.drive, t)[0]
    v = drives.velocity_at_beginning(scene.drive, ring.launch_velocity(scene)) * scene.body.radius
    z_1, z_2 = _initial_deflections(scene)
    y = rho, v, z_1, z_2
    mode = with_slip(held_at(scene, rho), 1 if v > 0.0 else -1, BAND, -1)
    if v == 0.0:
        K, motion = friction_and_motion(scene, mode, t, y)
        epsilon, _ = ring.acceleration(scene.body, *K, motion)
        mode = with_slip(mode, 1 if epsilon > drives.turn(scene.drive, t)[2] else -1, BAND, -1)
    mode = slipping(scene, mode, rho, (mode.sign, BAND, -1))
    if not _region_guard(scene, coefficients_in_slip(scene, mode), v, z_1, z_2, float(mode.sign), BAND) > 0.0:
        mode = with_slip(mode, mode.sign, KINETIC, -1)
    return t, y, after_jump(scene, mode, t, y), mode


@recorder.at_once.implements(BristleRing)
def _at_once_on_bristle_ring(scene, status, mode, t, y, seen):
    """Implement :func:`recorder.at_once`."""
    return seen_in_slip_at_once(scene, status, friction_and_motion(scene, mode, t, y), seen)


@friction_and_motion.implements(BristleRing)
def _friction_and_motion_on_bristle_ring(scene, mode, t, y):
    """Implement :func:`friction_and_motion`."""
    now = slip_at(scene, mode, t, y)
    return now.K, now.motion


@modes.status_when_stalled.implements(BristleRing)
def _status_when_stalled_on_bristle_ring(scene, mode, t, y):
    """Implement :func:`modes.status_when_stalled`."""
    return JAM if is_jamming(scene, mode, t, y) else BROKEN


@modes.switch.implements(BristleRing)
def _switch_on_bristle_ring(scene, mode, guard, t, y):
    """Implement :func:`modes.switch`; SLOW: v changes its sign; FAST: the bristles yield or hold again."""
    if guard == DETERMINANT:
        return JAM, mode, y
    if guard in (NORMAL_1, NORMAL_2):
        return lost_in_slip(scene, mode, guard == NORMAL_1, t, y), mode, y
    if guard == SLOW:
        return RUNNING, with_slip(mode, -mode.sign, BAND, -1), (y[0], 0.0, y[2], y[3])
    if guard == FAST:
        return RUNNING, with_slip(mode, mode.sign, KINETIC if mode.region == BAND else BAND, -1), y
    mode = with_places(mode, *places_after_edge(scene, mode, y[0]))
    return after_jump(scene, mode, t, y), mode, y


@slip.implements(BristleRing)
def _slip_of_bristle_ring(scene, mode, common, forcing, x):
    """Implement :func:`slip`; `x` is ``(rho, v, z_1, z_2)``, `common` is :class:`creep.Common`."""
    sine_cosine = sine_cosine_from(x[0] + forcing[0], common.phi, common.sin_phi, common.cos_phi)
    motion = *sine_cosine, x[1] * common.per_radius + forcing[1]
    return slip_of(scene, common.surfaces, motion, x, float(mode.sign), mode.region)


@region_guards.implements(BristleRing)
def _region_guards_on_bristle_ring(scene, mode, common, x):
    """Implement :func:`region_guards`: the sliding speed, m/s, and the guard of the bristles."""
    _, v, z_1, z_2 = x
    sign = float(mode.sign)
    return sign * v, _region_guard(scene, common.surfaces, v, z_1, z_2, sign, mode.region)


@implicit.part_before_bend.implements(BristleRing)
def _part_before_bend_on_bristle_ring(scene, mode, common, x, x_next):
    """Implement :func:`implicit.part_before_bend`: the smaller part of both contacts."""
    (_, v, z_1, z_2), (_, v_next, z_1_next, z_2_next), sign = x, x_next, float(mode.sign)
    first = part_before_bend(scene.law, *common.surfaces[:2], v, z_1, sign, v_next, z_1_next)
    return min(first, part_before_bend(scene.law, *common.surfaces[2:], v, z_2, sign, v_next, z_2_next))


@implicit.error_scales.implements(BristleRing)
def _error_scales_on_bristle_ring(scene, tolerance, x):
    """Implement :func:`implicit.error_scales`, from the largest deflection that friction can hold."""
    mu = along(roughest(scene.surface)[0], 0.0)
    deflection = mu / scene.law.sigma0
    # Without gravity the load is that of a slow rotation.
    load = scene.body.gravity + scene.body.radius * rate_at_rest(scene) ** 2
    speed = mu * sqrt(load / scene.law.sigma0) + abs(x[1])
    return tolerance, tolerance * speed, tolerance * deflection, tolerance * deflection, tolerance * mu * load


@modes.in_space.implements(BristleRing)
def _in_space_on_bristle_ring(scene, t, y):
    """Implement :func:`modes.in_space`: phi and omega."""
    theta, ring_omega, _ = drives.turn(scene.drive, t)
    return y[0] + theta, y[1] / scene.body.radius + ring_omega
