"""A body that slides: the equations of its implicit steps, derived from its balances and from its friction.

They are the same on the ring and on the belt, with bristles and without. The place in an implicit step is relative to
the drive, so that no large numbers cancel in slow creep.

Read :mod:`ringsweep.models.interface.implicit` first: `x`, `common` and `forcing` are described there. A model gives
:func:`slip` and :func:`region_guards`; all else follows from the :class:`Slip` that they return, which is called
`now`.
"""

from __future__ import annotations

from typing import Any, NamedTuple

from ringsweep.compile import absorbed, feature, hook, inlined, unrolled
from ringsweep.models.interface import implicit, variation
from ringsweep.numerics.terms import joined
from ringsweep.physics import drives, ring
from ringsweep.physics.belt import Belt, laden, laden_at
from ringsweep.physics.forces import Laden, force_rate, load_rate
from ringsweep.physics.friction.presliding import bristle
from ringsweep.physics.friction.registry import holds_in_band
from ringsweep.physics.friction.velocity import region_bounds, stiction_band
from ringsweep.physics.ring import BristleRing, Ring


class Bundle(NamedTuple):
    """Bristles at a contact.

    Attributes
    ----------
    rate, rate_v, rate_z : float
        Rate of their deflection, m/s, and its derivatives by the sliding velocity, 1, and by the deflection, 1/s.
    by_z : float
        Derivative of K by the deflection, 1/m.
    """

    rate: float
    rate_v: float
    rate_z: float
    by_z: float


class Slip(NamedTuple):
    """A body that slides, at an instant.

    Attributes
    ----------
    motion : tuple of float
        As for :func:`ringsweep.physics.ring.acceleration`.
    place_rate : float
        Rate of the place relative to the drive, rad/s or m/s.
    K, slopes : tuple of float
        Friction K at both contacts, 1, and its derivatives by the sliding velocity, s/m.
    damping : float
        Decay of the sliding velocity by viscous friction, 1/s.
    bristles : tuple of Bundle
    """

    motion: Any
    place_rate: float
    K: tuple[float, float]
    slopes: tuple[float, float]
    damping: float
    bristles: Any


@absorbed
def bundled(law, coefficients, v, z, sign, region):
    """``(K, dK/dv, Bundle)`` of the bristles at one contact; K in 1, its derivative in s/m.

    `coefficients` are the static and the kinetic one; see :func:`ringsweep.physics.friction.presliding.bristle`.
    """
    rate, rate_v, rate_z, traction, by_v, by_z = bristle(law, *coefficients, v, z, sign, region)
    return -traction, -by_v, Bundle(rate, rate_v, rate_z, -by_z)


@hook(absorb=True)
def slip(scene, mode, common, forcing, x):
    """The :class:`Slip` of the state of an implicit step; see :func:`implicit.rates` for the arguments."""


@inlined
def slip_at(scene, mode, t, y):
    """The :class:`Slip` of the state of a mode at a time."""
    forcing = drives.turn(scene.drive, t)
    x = implicit.to_implicit(scene, forcing, y)
    return slip(scene, mode, implicit.common(scene, mode, forcing, x), forcing, x)


@hook(absorb=True)
def region_guards(scene, mode, common, x):
    """Guards of the lower and of the upper bound of the region of a mode: of the speed, or of the bristles."""


@absorbed
def acceleration_slopes(scene, now):
    """Derivatives of the sliding acceleration by the place, by the sliding velocity, and by the velocity of the drive.

    Parameters
    ----------
    scene : NamedTuple
    now : Slip
    """
    body, radius = scene.body, ring.radius(scene.body)
    gradient = ring.acceleration_gradient(body, *now.K, now.motion)
    by_friction = radius * ring.acceleration_slope(body, *now.K, *now.slopes, now.motion)
    return radius * gradient[0], gradient[1] + by_friction - now.damping, radius * gradient[1]


@unrolled
def deflection_rates(count, bristles):
    """Rates of the deflections of the bristles, m/s."""
    return ["return (" + "".join(f"bristles[{i}].rate, " for i in range(count)) + ")"]


@unrolled
def zeros(count, numbers):
    """As many zeros as there are numbers."""
    return [f"return ({'0.0, ' * count})"]


@unrolled
def by_deflections(count, bristles, scene, now):
    """Derivatives of the sliding acceleration by the deflection of each bundle of bristles, 1/s^2."""
    slopes = [", ".join(f"bristles[{i}].by_z" if i == k else "0.0" for k in (0, 1)) for i in range(count)]
    found = (f"radius * ring.acceleration_slope(scene.body, *now.K, {pair}, now.motion), " for pair in slopes)
    return ["radius = ring.radius(scene.body)", f"return ({''.join(found)})"]


@unrolled
def _rows_of_deflections(count, bristles):
    """Rows of the Jacobian for the rates of the deflections."""
    rows = []
    for i in range(count):
        by_z = "".join(f"bristles[{i}].rate_z, " if k == i else "0.0, " for k in range(count))
        rows.append(f"(0.0, bristles[{i}].rate_v, {by_z}), ")
    return [f"return ({''.join(rows)})"]


@implicit.rates.implements(Ring, BristleRing)
@inlined
def rates_in_slip(scene, mode, common, forcing, x):
    """Implement :func:`implicit.rates`: of the place, of the sliding velocity, and of the deflections."""
    now, scene = slip(scene, mode, common, forcing, x), laden(scene.drive, scene, forcing)
    acceleration, _ = ring.acceleration(scene.body, *now.K, now.motion)
    sliding = ring.radius(scene.body) * (acceleration - forcing[2])
    return joined((now.place_rate, sliding), deflection_rates(now.bristles))


@feature("force_rate(drive, forcing)", of=Laden)
def pulled(drive, now, forcing):
    """Rate of the force and of friction under a load that varies in time, N/s."""
    return force_rate(drive, forcing) + now.K[0] * load_rate(drive, 0.0, forcing)


@implicit.linearise.implements(Ring, BristleRing)
@inlined
def linear_slip(scene, mode, common, t, forcing, x):
    """Implement :func:`implicit.linearise`."""
    now, scene = slip(scene, mode, common, forcing, x), laden(scene.drive, scene, forcing)
    radius = ring.radius(scene.body)
    acceleration, _ = ring.acceleration(scene.body, *now.K, now.motion)
    by_place, by_v, by_drive = acceleration_slopes(scene, now)
    by_force = pulled(scene.drive, now, forcing) / scene.body.mass
    by_time = by_place * forcing[1] + by_drive * forcing[2] + by_force - radius * drives.jerk_at(scene.drive, t)
    nothing = zeros(now.bristles)
    first = joined((0.0, 1.0 / radius), nothing)
    second = joined((by_place, by_v), by_deflections(now.bristles, scene, now))
    return (
        joined((now.place_rate, radius * (acceleration - forcing[2])), deflection_rates(now.bristles)),
        joined((first, second), _rows_of_deflections(now.bristles)),
        joined((0.0, by_time), nothing),
    )


@inlined
def relaxes(scene, linear, frequency):
    """Whether slip relaxes fast compared with the motion of the body, whose frequency is given, rad/s.

    An implicit step is as long as the motion allows, a step of a series about seven times as long as slip takes to
    relax. And the transient must be over: transients into the stiction band, and out of it at its top, are as fast as
    the decay itself.
    """
    acceleration, decay = linear[0][1], -linear[1][1][1]
    return decay > 20.0 * frequency and abs(acceleration) < 0.01 * decay * stiction_band(scene.law)


@region_guards.implements(Ring, Belt)
def _region_guards_by_speed(scene, mode, common, x):
    """Implement :func:`region_guards`: distances of the speed from both bounds, m/s."""
    low, high = region_bounds(scene.law, mode.region)
    speed = mode.sign * x[1]
    return speed - low, high - speed


@variation.jacobian.implements(Ring, Belt)
def _jacobian_without_bristles(scene, mode, t, y):
    """Implement :func:`variation.jacobian`; in a dead band the place does not follow the velocity."""
    has_dead_band = holds_in_band(scene.law) and stiction_band(scene.law) > 0.0
    in_dead_band = has_dead_band and (mode.sign == 0 or mode.region < 0)
    per_radius = 0.0 if in_dead_band else 1.0 / ring.radius(scene.body)
    if mode.sign == 0:
        return 0.0, per_radius, 0.0, 0.0
    # At the end of slip the velocity is zero but for rounding, which must not turn friction round.
    v = mode.sign * max(mode.sign * y[1], 1e-300)
    now = slip_at(scene, mode, t, (y[0], v))
    by_place, by_v, _ = acceleration_slopes(laden_at(scene.drive, scene, t), now)
    return 0.0, per_radius, by_place, 0.0 if in_dead_band else by_v
