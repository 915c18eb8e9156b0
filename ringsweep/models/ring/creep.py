"""Implicit steps on the ring, in the stiction band of a smooth law, where the body creeps on a slow manifold.

The state is ``(rho, v)``: angle in the ring's frame and sliding velocity. So no state is the difference of two large
numbers, however slow the creep.

Read :mod:`ringsweep.models.interface.implicit` and :mod:`ringsweep.models.slip` first.
"""

from __future__ import annotations

from math import cos, inf, sin, sqrt
from typing import NamedTuple

from ringsweep.compile import inlined
from ringsweep.models.interface import implicit
from ringsweep.models.interface.shock import Located
from ringsweep.models.ring.contacts import coefficients_in_slip, edges_ahead
from ringsweep.models.ring.record import extremes_of
from ringsweep.models.slip import Slip, region_guards, relaxes, slip
from ringsweep.numerics.functions import ROTATED, rotated, sine_cosine_from
from ringsweep.numerics.terms import joined
from ringsweep.physics import ring
from ringsweep.physics.friction.velocity import friction_in, stiction_band

#: Indices of the guards, in the order of the rows of the series.
DETERMINANT, SLOW, NORMAL_1, NORMAL_2, EDGE, FAST = range(6)


class Common(NamedTuple):
    """What the equations have in common within a step.

    Attributes
    ----------
    rho, phi, sin_phi, cos_phi : float
        Angle of the body at the beginning, in the ring's frame and in space, rad; sine and cosine of the latter.
    per_radius : float
        Reciprocal of the radius of the ring, 1/m.
    surfaces : tuple of float
        What the law takes of the surfaces under contacts 1 and 2.
    """

    rho: float
    phi: float
    sin_phi: float
    cos_phi: float
    per_radius: float
    surfaces: tuple[float, ...]


@implicit.common.implements(ring.Ring, ring.BristleRing)
def _common_on_ring(scene, mode, forcing, x):
    """Implement :func:`implicit.common`."""
    phi = x[0] + forcing[0]
    return Common(x[0], phi, sin(phi), cos(phi), 1.0 / scene.body.radius, coefficients_in_slip(scene, mode))


@slip.implements(ring.Ring)
def _slip_of_ring(scene, mode, common, forcing, x):
    """Implement :func:`slip`; `x` is ``(rho, v)``, rad and m/s."""
    sign, place_rate = 1.0 if x[1] >= 0.0 else -1.0, x[1] * common.per_radius
    mu_1, mu_2, slope_1, slope_2 = friction_in(scene.law, mode.region, abs(x[1]), common.surfaces)
    sin_phi, cos_phi = _sine_cosine(common, forcing, x)
    motion = sin_phi, cos_phi, place_rate + forcing[1]
    return Slip(motion, place_rate, (-sign * mu_1, -sign * mu_2), (-slope_1, -slope_2), 0.0, ())


@inlined
def _sine_cosine(common, forcing, x):
    """Sine and cosine of the angle of the body in space."""
    # The drive turns the body by more than it creeps. A stage depends on the stage before by the creep alone, so the
    # processor can compute this turn ahead.
    sin_phi, cos_phi = sine_cosine_from(common.rho + forcing[0], common.phi, common.sin_phi, common.cos_phi)
    crept = x[0] - common.rho
    if not abs(crept) < ROTATED:
        return sin(x[0] + forcing[0]), cos(x[0] + forcing[0])
    return rotated(sin_phi, cos_phi, crept)


@implicit.is_stiff.implements(ring.Ring)
def _is_stiff_on_ring(scene, mode, y, linear):
    """Implement :func:`implicit.is_stiff`: friction relaxes faster than the body swings and turns."""
    frequency = sqrt(scene.body.gravity / scene.body.radius) + abs(y[1]) / scene.body.radius
    return relaxes(scene, linear, frequency)


@implicit.error_scales.implements(ring.Ring)
def _error_scales_on_ring(scene, tolerance, x):
    """Implement :func:`implicit.error_scales`: 1 rad, and the width of the stiction band."""
    return tolerance, tolerance * stiction_band(scene.law) * ring.reaction_determinant(scene.body), inf


@implicit.guards_and_motion.implements(ring.Ring, ring.BristleRing)
def _guards_and_motion_on_ring(scene, mode, common, forcing, x):
    """Implement :func:`implicit.guards_and_motion`.

    The motion is phi, omega, the angular acceleration, the angular velocity of the ring, and deflections of bristles.
    """
    now = slip(scene, mode, common, forcing, x)
    epsilon, determinant = ring.acceleration(scene.body, *now.K, now.motion)
    normal_1, normal_2 = ring.reactions(scene.body, *now.K, now.motion)
    slow, fast = region_guards(scene, mode, common, x)
    ahead = min(edges_ahead(scene, mode, x[0]))
    motion = x[0] + forcing[0], now.motion[2], epsilon, forcing[1]
    return (determinant, slow, normal_1, normal_2, ahead, fast), (*motion, *x[2:])


@implicit.near_zero.implements(ring.Ring, ring.BristleRing)
def _near_zero_on_ring(scene, motion):
    """Implement :func:`implicit.near_zero`: a fiftieth of the determinant, a twentieth of the load."""
    b = scene.body
    omega = motion[1]
    load = 0.05 * b.mass * (b.gravity + b.radius * omega * omega)
    return 0.02 * ring.free_determinant(b), 0.0, load, load, 0.0, 0.0


@implicit.seen.implements(ring.Ring, ring.BristleRing)
def _seen_in_implicit_step_on_ring(scene, view):
    """Implement :func:`implicit.seen`: what ``_observe_on_ring`` in :mod:`record` takes."""
    guards, motion = view
    phi, omega, epsilon = motion[:3]
    size = scene.body.gravity / scene.body.radius + omega * omega + abs(epsilon)
    return joined((phi, omega, guards[NORMAL_1], guards[NORMAL_2], Located(epsilon, size)), motion[4:])


@implicit.sought.implements(ring.Ring, ring.BristleRing)
def _sought_on_ring(scene, record, view):
    """Implement :func:`implicit.sought`: phi, omega, both reactions."""
    guards, motion = view
    return extremes_of(record, motion[0], motion[1], guards[NORMAL_1], guards[NORMAL_2])
