"""Friction on the body on the belt under laws of the velocity alone, and the scales of its motion.

In this file `x` is the displacement in space, m, and `v` the sliding velocity, m/s. `forcing` is what
:func:`ringsweep.physics.drives.turn` returns: place, velocity and acceleration of the belt, then rate and value of
the external force if there is one.
"""

from __future__ import annotations

from ringsweep.compile import absorbed, feature, inlined, replacing
from ringsweep.models.interface import shock
from ringsweep.models.slip import Slip
from ringsweep.numerics.functions import opposing, select
from ringsweep.physics import belt, drives, ring, zones
from ringsweep.physics.belt import OnBelt
from ringsweep.physics.forces import force_in, force_rate, largest_force, load_rate
from ringsweep.physics.friction.registry import dead_band
from ringsweep.physics.friction.velocity import friction_at
from ringsweep.physics.friction.ways import TwoWay, along, towards


@feature("no", of=ring.having(OnBelt, "force"), absorb=True)
def if_force(body, yes, no):
    """`yes` if a given force acts on the body, an external or a viscous one, else `no`."""
    return yes


@absorbed
def moving(scene, velocity, v, belt_velocity):
    """Velocity in space, m/s: `velocity`, or in a dead band that of the belt, with which the body moves.

    Karnopp's sliding velocity is zero in the band, where `v` is the momentum by the mass.
    """
    # The edge belongs to the band. Without a band the compiler sees that nothing is below 0.
    return select(abs(v) < dead_band(scene.law) * (1.0 + 1e-15), belt_velocity, velocity)


@absorbed
def slip_from(scene, x, velocity, v, forcing):
    """The :class:`Slip` of a body on the belt under a law of the velocity.

    Parameters
    ----------
    scene : NamedTuple
    x, velocity : float or Lanes
        Displacement, m, and velocity in space, m/s.
    v : float or Lanes
        Sliding velocity, m/s.
    forcing : tuple of float
        What :func:`ringsweep.physics.drives.turn` or :func:`ringsweep.physics.drives.lookup` returned.

    Returns
    -------
    Slip
        Friction balances the other forces in a dead band, as far as it can.
    """
    scene = belt.laden(scene.drive, scene, forcing)
    mu, slope = friction_at(scene.law, abs(v), coefficients(scene, v))
    push, viscous = force_in(scene.drive, forcing), if_force(scene.body, scene.viscous, 0.0)
    held = abs(v) < dead_band(scene.law)
    load, _, friction = ring.held(scene.body, 1.0, (x, push, velocity), x * x * x, 0.0, 0.0)
    most = along(scene.mu_s, -friction)
    needed = max(-most, min(most, friction / (load + 1e-300)))
    K, slope = select(held, needed, opposing(mu, v)), select(held, 0.0, -slope)
    viscous = select(held, 0.0, viscous)
    return Slip((x, push - viscous * v, velocity), v, (K, K), (slope, slope), viscous / scene.body.mass, ())


_with_coefficients = replacing("mu_s", "mu_k")


@feature("scene")
def in_segment(surface, scene, place):
    """The scene with the friction coefficients of a place: a segment of the `surface` and the turn of the belt."""
    mu_s, mu_k, _ = zones.coefficients(surface, place[0])
    return _with_coefficients(scene, mu_s, mu_k)


@feature("scene", absorb=True)
def at_place(surface, scene, x, shift):
    """The scene with the friction coefficients at `x` on a belt that has moved by `shift`, m; for floats and Lanes."""
    mu_s, mu_k = zones.roughness_along(surface, zones.place_in(surface.frame, x, shift))
    return _with_coefficients(scene, mu_s, mu_k)


@absorbed
def coefficients(scene, way):
    """Static and kinetic friction coefficient in a direction; see :func:`ringsweep.physics.friction.ways.towards`."""
    return towards(scene.law, (scene.mu_s, scene.mu_k), way)


@absorbed
def breakaway_force(scene, way, x):
    """Largest friction force of a stuck contact that is pulled in the direction `way`, N; 0 for the larger of both."""
    return along(scene.mu_s, way) * ring.reactions(scene.body, 0.0, 0.0, (x, 0.0, 0.0))[0]


@inlined
def located(scene, x, acceleration):
    """Acceleration of the body at the displacement `x`, and the size of its terms, for the recorder."""
    forces = abs(breakaway_force(scene, 0.0, x)) + ring.size(scene.body, (x, 0.0, 0.0))
    return shock.Located(acceleration, forces / scene.body.mass + abs(acceleration))


@inlined
def stuck_pull(scene, x, v, forcing):
    """Force that friction must balance to keep the sliding velocity `v` (m/s) constant, N; positive forwards."""
    push = force_in(scene.drive, forcing)
    return -ring.held(scene.body, 1.0, (x, push, v + forcing[1]), x * x * x, forcing[2], 0.0)[2]


# Share of the terms of a difference that is more than its rounding: four units in the last place.
_ROUNDING = 2.0**-50


@feature("pull", of=TwoWay)
def direction(mu_s, pull, scene, t, x, forcing):
    """Number with the sign of a pull, or of its rate where there is none: one direction may lack friction."""
    return pull if pull != 0.0 else stuck_rates(scene, t, x, forcing)[0]


@inlined
def rounding_of_reserve(scene, motion, acceleration):
    """More than the rounding of the difference of :func:`breakaway_force` and :func:`stuck_pull`, N.

    Parameters
    ----------
    scene : NamedTuple
    motion : tuple of float
        Displacement, m, external force, N, and velocity in space, m/s.
    acceleration : float
        Acceleration of the belt, m/s^2.
    """
    body = scene.body
    friction = along(scene.mu_s, 0.0) * body.mass * body.gravity + abs(breakaway_force(scene, 0.0, motion[0]))
    return _ROUNDING * (friction + ring.size(body, motion) + body.mass * abs(acceleration))


@inlined
def rounding_of_load(scene, x):
    """More than the rounding of the load at the displacement `x`, N: a load that falls so far only touches zero."""
    # The terms of the load may cancel at one of both places.
    there = ring.reactions(scene.body, 0.0, 0.0, (x, 0.0, 0.0))[0]
    return _ROUNDING * (abs(there) + abs(ring.reactions(scene.body, 0.0, 0.0, (-x, 0.0, 0.0))[0]))


@inlined
def load_is_left(scene, t, x):
    """Whether the normal reaction of a body at the displacement `x` is positive, or zero but for rounding."""
    load = ring.reactions(belt.laden_at(scene.drive, scene, t).body, 0.0, 0.0, (x, 0.0, 0.0))[0]
    return load >= -0.5 * rounding_of_load(scene, x)


@inlined
def stuck_rates(scene, t, x, forcing):
    """Time derivatives of :func:`stuck_pull` and of the load of a body at rest on the belt, N/s."""
    _, velocity, acceleration = forcing[:3]
    push_rate, jerk = force_rate(scene.drive, forcing), drives.jerk_at(scene.drive, t)
    rates, cube_rate = (velocity, push_rate, acceleration), 3.0 * x * x * velocity
    load, _, friction = ring.held(scene.body, 0.0, rates, cube_rate, jerk, 0.0)
    return -friction, load_rate(scene.drive, load, forcing)


@inlined
def stuck_gradient(scene, x):
    """Derivatives of :func:`stuck_pull` and of the load of a body at rest on the belt by place, N/m."""
    load, _, friction = ring.held(scene.body, 0.0, (1.0, 0.0, 0.0), 3.0 * x * x, 0.0, 0.0)
    return -friction, load


@feature("0.0", of=ring.having(OnBelt, "cubic"))
def _cubic_stiffness(body):
    """Coefficient of the cubic spring, N/m^3; 0 if the scene has none."""
    return body.cubic


@inlined
def _without_spring(scene, velocity):
    """Time in which a body without a spring stops, at most a period or the span, s; and its acceleration, m/s^2."""
    acceleration = along(scene.mu_s, 0.0) * scene.body.gravity + largest_force(scene.drive) / scene.body.mass
    longest, enough = min(scene.forcing_period, scene.span), acceleration > 0.0 and velocity > 0.0
    return min(longest, velocity / acceleration) if enough else longest, acceleration


@inlined
def length_scale(scene, velocity):
    """Length in units of which errors are measured, m, for a body with this velocity (m/s)."""
    body, cubic = scene.body, _cubic_stiffness(scene.body)
    time, acceleration = _without_spring(scene, velocity)
    by_velocity, by_load, load = velocity * time, acceleration * time * time, acceleration * body.mass
    if body.stiffness > 0.0:
        by_velocity, by_load = velocity * (body.mass / body.stiffness) ** 0.5, load / body.stiffness
    if cubic > 0.0:
        # A hardening spring alone turns the body where its energy, cubic x^4/4, is that of the motion.
        by_velocity = min(by_velocity, (2.0 * body.mass * velocity * velocity / cubic) ** 0.25)
        by_load = min(by_load, (load / cubic) ** (1.0 / 3.0))
    return by_velocity + by_load + 1e-300


@inlined
def speed_scale(scene, length, velocity):
    """Speed in units of which errors are measured, m/s, for a motion over this length (m) with this velocity (m/s)."""
    body = scene.body
    stiffness_per_mass = (body.stiffness + max(_cubic_stiffness(body), 0.0) * length * length) / body.mass
    if stiffness_per_mass > 0.0:
        return length * stiffness_per_mass**0.5
    # Without a spring the place does not matter.
    time, acceleration = _without_spring(scene, velocity)
    return velocity + acceleration * time + 1e-290
