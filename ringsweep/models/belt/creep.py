"""Implicit steps on the belt, in the stiction band of a smooth law, where the body creeps relative to the belt.

Read :mod:`ringsweep.models.interface.implicit` first. `x` is displacement relative to the belt (m), sliding velocity
(m/s), and deflection (m) of bristles; `forcing` begins with place, velocity and acceleration of the belt.
"""

from __future__ import annotations

from math import inf, nan

from ringsweep.compile import feature, inlined, unrolled
from ringsweep.models.belt.force import coefficients, if_force, in_segment, length_scale, located, rounding_of_load
from ringsweep.models.belt.mode import yields
from ringsweep.models.belt.stops import guarded, held_linear, held_place, held_rates, is_away, pressed
from ringsweep.models.interface import implicit, modes
from ringsweep.models.slip import Slip, linear_slip, rates_in_slip, region_guards, relaxes, slip
from ringsweep.numerics.terms import joined
from ringsweep.physics import belt, drives, ring, zones
from ringsweep.physics.belt import BristleBelt, laden
from ringsweep.physics.forces import force_in
from ringsweep.physics.friction.presliding import shown  # noqa: F401
from ringsweep.physics.friction.velocity import friction_in, stiction_band


@implicit.is_stiff.implements(belt.Belt)
def _is_stiff_on_belt(scene, mode, y, linear):
    """Implement :func:`implicit.is_stiff`: friction relaxes faster than the spring swings."""
    is_stiff = relaxes(scene, linear, (scene.body.stiffness / scene.body.mass) ** 0.5)
    return is_stiff and is_away(scene.stops, mode, y)


@implicit.error_scales.implements(belt.Belt)
def _error_scales_on_belt(scene, tolerance, x):
    """Implement :func:`implicit.error_scales`: length of the motion; width of the stiction band."""
    # A load that varies may come from the displacement alone, whose size the launch tells.
    launch_x, launch_v = ring.if_load_varies(scene.body, (abs(scene.initial_x), abs(scene.initial_v)), (0.0, 0.0))
    band, belt = stiction_band(scene.law), abs(drives.turn(scene.drive, scene.span)[1])
    length = launch_x + length_scale(scene, belt + launch_v)
    # A body that creeps may go much less far than friction can hold it.
    return tolerance * min(length, abs(x[0]) + (belt + launch_v + band) * scene.span), tolerance * band, inf


@slip.implements(belt.Belt)
def _slip_of_belt(scene, mode, common, forcing, x):
    """Implement :func:`slip`; `x` is the displacement relative to the belt, m, and the sliding velocity, m/s."""
    v, sign, scene = x[1], 1.0 if x[1] >= 0.0 else -1.0, in_segment(scene.surface, scene, mode.place)
    mu, slope = friction_in(scene.law, mode.region, abs(v), coefficients(scene, float(mode.sign)))
    # In a dead band friction balances all other forces.
    in_band = yields(scene, mode)
    viscous = 0.0 if in_band else if_force(scene.body, scene.viscous, 0.0)
    velocity = forcing[1] if in_band else v + forcing[1]
    motion = x[0] + forcing[0], force_in(scene.drive, forcing) - viscous * v, velocity
    return Slip(motion, v, (-sign * mu, -sign * mu), (-slope, -slope), viscous / scene.body.mass, ())


@implicit.rates.implements(belt.Belt, belt.BristleBelt)
def _rates_on_belt(scene, mode, common, forcing, x):
    """Implement :func:`implicit.rates`."""
    return held_rates(mode.stop, rates_in_slip(scene, mode, common, forcing, x), forcing)


@implicit.linearise.implements(belt.Belt, belt.BristleBelt)
def _linearise_on_belt(scene, mode, common, t, forcing, x):
    """Implement :func:`implicit.linearise`."""
    return held_linear(mode.stop, linear_slip(scene, mode, common, t, forcing, x), scene, t, forcing)


@inlined
def all_guards(body, normal, slow, fast):
    """The guards of a mode: the normal reaction is one of them only if it varies."""
    return ring.if_load_varies(body, (normal, slow, fast), (slow, fast))


@feature("guards")
def _with_edges(surface, guards, place, x, shift):
    """Guards, and behind them the distances to both edges of the segment of a place, m."""
    above = zones.distance_to_edge(surface, place, 1, x, shift)
    return joined(guards, (above, zones.distance_to_edge(surface, place, -1, x, shift)))


@implicit.guards_and_motion.implements(belt.Belt, belt.BristleBelt)
def _guards_and_motion_on_belt(scene, mode, common, forcing, x):
    """Implement :func:`implicit.guards_and_motion`.

    The motion is displacement, velocity and acceleration in space, friction (N), displacement relative to the belt,
    sliding velocity, acceleration of the belt, and deflection of the bristles (NaN without bristles).
    """
    x = held_place(scene.stops, x, mode, forcing)
    now, body = slip(scene, mode, common, forcing, x), laden(scene.drive, scene, forcing).body
    acceleration, _ = ring.acceleration(body, *now.K, now.motion)
    normal, _ = ring.reactions(body, *now.K, now.motion)
    friction = now.damping * body.mass * x[1] - now.K[0] * normal
    place, _, velocity = now.motion
    guards = all_guards(body, normal + rounding_of_load(scene, place), *region_guards(scene, mode, common, x))
    guards = _with_edges(scene.surface, guards, mode.place, place, forcing[0])
    guards, acceleration = guarded(scene.stops, guards, mode, place, acceleration)
    return guards, (place, velocity, acceleration, friction, x[0], x[1], forcing[2], deflection(x, scene.law, nan))


@implicit.held_guard.implements(BristleBelt)
def _held_guard_on_bristle_belt(scene, mode, tolerance, motion):
    """Implement :func:`implicit.held_guard`."""
    return pressed(scene.stops, scene, mode, tolerance, motion[0])


@unrolled
def deflection(length, x, law, missing):
    """Deflection of the bristles, m, or their age, s; `missing` without bristles."""
    return ["return shown(law, x[2])" if length > 2 else "return missing"]


@implicit.seen.implements(belt.Belt, belt.BristleBelt)
def _seen_in_implicit_step_on_belt(scene, view):
    """Implement :func:`implicit.seen`: what ``_observe_on_belt`` in :mod:`record` takes."""
    _, (x, velocity, acceleration, friction, place, v, belt_acceleration, deflection) = view
    jumps = located(scene, x, acceleration)
    return x, velocity, friction, place, v, acceleration - belt_acceleration, jumps, deflection


@implicit.sought.implements(belt.Belt, belt.BristleBelt)
def _sought_on_belt(scene, record, view):
    """Implement :func:`implicit.sought`: displacement, velocity, friction."""
    r, motion = record, view[1]
    place, velocity = (motion[0], r.x_min, r.x_max), (motion[1], -inf, r.velocity_max)
    return place, velocity, (motion[3], -r.force_max, r.force_max)


@implicit.near_zero.implements(belt.Belt, belt.BristleBelt)
def _near_zero_on_belt(scene, motion):
    """Implement :func:`implicit.near_zero`: a twentieth of the weight for the reaction, nothing for the others."""
    least = all_guards(scene.body, 0.05 * scene.body.mass * scene.body.gravity, 0.0, 0.0)
    return with_nothing(scene.stops, with_nothing(scene.surface, least))


@feature("guards")
def with_nothing(part, guards):
    """Numbers for guards, and behind them 0 for both edges or stops of a part of the scene."""
    return joined(guards, (0.0, 0.0))


@modes.row.implements(belt.Belt, belt.BristleBelt)
def _row_on_belt(scene, mode, forcing, y, seen):
    """Implement :func:`modes.row`: displacement, velocity, friction, deflection, and -1, 0 or 1 for the mode; zone."""
    x, velocity, friction = seen[:3]
    state = 0.0 if mode.region < 0 else float(mode.sign)
    return x, velocity, friction, deflection(y, scene.law, 0.0), state, *zone_of(scene.surface, mode.place)


@feature("()")
def zone_of(surface, place):
    """Number of the zone of a place, as a mode has it, 0 for none; an empty tuple if there are no zones."""
    return (zones.coefficients(surface, place[0])[2],)
