"""What a body on a ring and a body on a belt have in common. A belt is kinematically a ring of radius 1.

`motion` is what :func:`ringsweep.physics.ring.acceleration` takes: sine and cosine of the angle and angular velocity
on a ring; displacement, force and velocity on a belt. `forcing` begins with place, velocity and acceleration of the
drive.
"""

from __future__ import annotations

from math import inf

import numpy as np

from ringsweep.compile import hook, inlined
from ringsweep.models.interface import audit, implicit, modes, series
from ringsweep.models.interface.status import JAM, RUNNING, SEPARATED_1, SEPARATED_2, SEPARATED_BOTH
from ringsweep.models.slip import acceleration_slopes, by_deflections
from ringsweep.numerics.series import slope, value
from ringsweep.numerics.terms import set_terms, terms
from ringsweep.physics import contact, drives, ring
from ringsweep.physics.belt import Belt, BristleBelt, laden
from ringsweep.physics.friction.velocity import stiction_band
from ringsweep.physics.ring import BristleRing, Ring

#: Status of a run for each mode of :mod:`ringsweep.physics.contact`.
ENDS = np.full(8, RUNNING)
ENDS[[contact.OPEN_1, contact.OPEN_2, contact.OPEN_BOTH]] = SEPARATED_1, SEPARATED_2, SEPARATED_BOTH
ENDS[contact.IMPOSSIBLE] = JAM

#: Error allowed to the reactions as a share of the load, in units of the tolerance of the series.
REACTION_TOLERANCE = 1e3

# Rounding of an acceleration, as a share of its largest terms.
_ROUNDING = 1e-12

# Square of an error of the balances, as a share of their terms, that is more than rounding.
_UNBALANCED = 1e-9 * 1e-9


# ---- states -----------------------------------------------------------------------------------

# Place and sliding velocity are the first rows of a table of series.


@series.state_at.implements(Ring, Belt)
def _state_at_without_bristles(scene, c, s):
    """Implement :func:`series.state_at`."""
    return value(c[0], s), value(c[1], s)


@series.rates_at.implements(Ring, Belt)
def _rates_at_without_bristles(scene, c, s):
    """Implement :func:`series.rates_at`."""
    return slope(c[0], s), slope(c[1], s)


@modes.in_space.implements(Ring, BristleBelt)
def _in_space_by_drive(scene, t, y):
    """Implement :func:`modes.in_space`: the velocity in space is that of the drive plus the sliding velocity."""
    return y[0], y[1] / ring.radius(scene.body) + drives.turn(scene.drive, t)[1]


# The place of an implicit step is relative to the drive, so that no large numbers cancel in slow creep.
@implicit.to_implicit.implements(Ring, Belt, BristleBelt)
def _place_from_drive(scene, forcing, y):
    """Implement :func:`implicit.to_implicit`."""
    return y[0] - forcing[0], *y[1:]


@implicit.from_implicit.implements(Ring, Belt, BristleBelt)
def _place_from_space(scene, forcing, x):
    """Implement :func:`implicit.from_implicit`."""
    return x[0] + forcing[0], *x[1:]


# ---- series ----------------------------------------------------------------------------------


@inlined
def expand_bounds(c, rows, mode, bounds, size):
    """Fill the guards of slip for both bounds of the region of the friction law, m/s.

    The lower guard begins level if it begins at rest and its rate is but rounding: if friction does not drop at
    breakaway the rate is zero there.

    Parameters
    ----------
    c : ndarray of shape ``(rows, columns)``
        Table of series.
    rows : tuple of int
        Rows of the sliding velocity, and of the guards of the lower and of the upper bound.
    mode : NamedTuple
    bounds : tuple of float
        The bounds, m/s.
    size : float
        Size of the terms of the sliding acceleration, m/s^2; 0 if the rate counts whatever it is.
    """
    (v, slow, fast), (low, high), sign = rows, bounds, float(mode.sign)
    set_terms(c[slow], terms(c[v]) * sign)
    set_terms(c[fast], terms(c[v]) * -sign)
    c[slow, 0] = 0.0 if mode.entry_guard == slow else sign * c[v, 0] - low
    c[fast, 0] = 0.0 if mode.entry_guard == fast else high - sign * c[v, 0]
    if mode.entry_guard == slow and low == 0.0 and abs(c[slow, 1]) <= 1e-12 * size:
        c[slow, 1] = 0.0


@inlined
def rate_at_rest(scene):
    """Unit of the error of the angular velocity of a body at rest on a ring, rad/s: a 16th of the rate of a swing."""
    return (scene.body.gravity / scene.body.radius) ** 0.5 / 16.0 + 1.0 / (16.0 * scene.span)


@inlined
def speed_in(scene, mode, speed):
    """Unit of the error of the sliding velocity, m/s: `speed`, or less in the stiction band."""
    # An error as large as the band would keep the creep from becoming steady.
    return min(speed, 1e3 * stiction_band(scene.law)) if mode.region < 0 else speed


# ---- audit ------------------------------------------------------------------------------------


@inlined
def larger(a, b):
    """The larger of two violations; infinite if `b` is not a number."""
    return max(a, b) if b < inf else inf


@inlined
def imbalances(scene, friction, normals, motion, forcing, rate, scales):
    """``(violation, power)`` of a state: largest violation of balances and signs of reactions, 1; power, W.

    Parameters
    ----------
    scene : NamedTuple
    friction, normals : tuple of float
        K, and the reaction (N), at each contact.
    motion : tuple of float
        As for :func:`ringsweep.physics.ring.acceleration`.
    forcing : tuple of float
        What :func:`ringsweep.physics.drives.turn` returned.
    rate : float
        Rate of the sliding velocity from the dense output, m/s^2.
    scales : tuple of float
        Error allowed to this rate; size of the terms of the acceleration, m/s^2; tolerance of the run.
    """
    body, (allowed, terms, tolerance) = scene.body, scales
    acceleration, _ = ring.acceleration(body, *friction, motion)
    error = abs(ring.radius(body) * (acceleration - forcing[2]) - rate)
    violation = larger(0.0, error / (allowed + _ROUNDING * terms))
    least = ring.if_load_varies(body, min(normals[0], normals[1]), 0.0)
    violation = larger(violation, -least / (body.mass * terms * REACTION_TOLERANCE * tolerance))
    violation = larger(violation, ring.imbalance(body, *friction, *normals, acceleration, motion) / _UNBALANCED)
    return violation, ring.power(body, *friction, *normals, motion)


@hook
def audited(scene, mode, forcing, y):
    """Slip, size of the terms of the acceleration, and violation found so far, of a body on bristles.

    Returns
    -------
    tuple
        The :class:`ringsweep.models.slip.Slip` of the state `y`, the size of the terms of the acceleration, m/s^2, and
        a violation already found.
    """


@audit.violation.implements(BristleRing)
@inlined
def violation_on_bristles(scene, mode, forcing, y, rates, s, tolerance):
    """Implement :func:`audit.violation` for laws with bristles; the rate of each deflection is checked too."""
    now, terms, largest = audited(scene, mode, forcing, y)
    scene = laden(scene.drive, scene, forcing)
    body, v = scene.body, y[1]
    if not ring.acceleration(body, *now.K, now.motion)[1] > 0.0:
        largest = inf
    scales = implicit.error_scales(scene, implicit.IMPLICIT_TOLERANCE * tolerance, y)
    speed, deflection = scales[1], scales[2]
    allowed = (1.0 / s + abs(acceleration_slopes(scene, now)[1])) * speed
    by_z = by_deflections(now.bristles, scene, now)
    for i in range(len(by_z)):
        bundle = now.bristles[i]
        allowed += abs(by_z[i]) * deflection
        scale = (1.0 / s + abs(bundle.rate_z)) * deflection + abs(bundle.rate_v) * speed + _ROUNDING * abs(v)
        largest = larger(largest, abs(bundle.rate - rates[2 + i]) / scale)
    normals = ring.reactions(body, *now.K, now.motion)
    violation, power = imbalances(scene, now.K, normals, now.motion, forcing, rates[1], (allowed, terms, tolerance))
    return larger(larger(largest, -mode.sign * v / speed), violation), power
