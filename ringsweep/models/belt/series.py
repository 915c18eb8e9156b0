"""The belt as a piecewise-smooth system: modes, guards and their power series.

The state is ``(x, v)`` with the displacement in space and the sliding velocity. The difference of two large velocities
would lose all its digits.
"""

from __future__ import annotations

from typing import NamedTuple

from ringsweep.compile import inlined
from ringsweep.models.belt.force import breakaway_force, holds_in_band, length_scale
from ringsweep.models.belt.record import due_within
from ringsweep.models.interface import modes, series
from ringsweep.models.interface.status import RUNNING
from ringsweep.numerics.series import FACTOR_ROWS, INVERSE, ORDER, crossings, slope, step_size, value, variation
from ringsweep.numerics.terms import inner_products, no_factors, set_factors, set_terms, terms
from ringsweep.physics import belt, drives
from ringsweep.physics.friction.velocity import (
    BAND,
    KINETIC,
    basis_at,
    basis_factor,
    basis_term,
    faster,
    friction_terms,
    piece,
    region_at,
    region_bounds,
    shorten_for_decay,
    slower,
    stiction_band,
)

# Rows of the table of series; the guards are last.
X, V, VELOCITY, FORCE, SHIFT, SPARE, FACTORS = range(7)
SLOW, FAST = FACTORS + FACTOR_ROWS, FACTORS + FACTOR_ROWS + 1


class Mode(NamedTuple):
    """Mode of the belt.

    Attributes
    ----------
    sign : int
        Sign of the sliding velocity; 0 if the contact is stuck. In a dead band after breakaway, the sign of the pull.
    region : int
        Region of the friction law.
    entry_guard : int
        Row of the guard that is zero on entry, or -1.
    """

    sign: int
    region: int
    entry_guard: int


@series.after_first_step.implements(Mode)
def _after_first_step(mode):
    return Mode(mode.sign, mode.region, -1)


@modes.initial_state.implements(belt.Belt)
def _initial_state(scene):
    return drives.beginning(scene.drive), (scene.initial_x, drives.velocity_at_beginning(scene.drive, scene.initial_v))


@series.table_shape.implements(belt.Belt)
def _table_shape(scene):
    return FAST + 1, SLOW


@inlined
def _pull(scene, t, x):
    """Force that friction must balance to keep the body at rest on the belt, N; positive forwards."""
    return -scene.stiffness * x - scene.mass * drives.turn(scene.drive, t)[2]


@modes.initial_mode.implements(belt.Belt)
def _initial_mode(scene, t, y):
    x, v = y
    if holds_in_band(scene.law) and abs(v) <= stiction_band(scene.law):
        return RUNNING, _mode_at_rest(scene, t, x)
    if v == 0.0:
        return RUNNING, Mode(1 if _pull(scene, t, x) >= 0.0 else -1, BAND, SLOW)
    return RUNNING, Mode(1 if v > 0.0 else -1, region_at(scene.law, abs(v)), -1)


@inlined
def _mode_at_rest(scene, t, x):
    """Mode of a set-valued law at a sliding velocity of zero or within the dead band."""
    pull = _pull(scene, t, x)
    bound = breakaway_force(scene)
    if abs(pull) <= bound and bound > 0.0:
        return Mode(0, KINETIC, -1)
    if pull == 0.0:
        # The rate of the pull decides, while the belt carries the body along.
        _, belt_velocity, _ = drives.turn(scene.drive, t)
        pull = -scene.stiffness * belt_velocity - scene.mass * drives.jerk(scene.drive, t)
    # Without a dead band the sliding velocity, which is zero here, is a guard.
    entry_guard = SLOW if stiction_band(scene.law) == 0.0 else -1
    return Mode(1 if pull >= 0.0 else -1, region_at(scene.law, 0.0), entry_guard)


@modes.switch.implements(belt.Belt)
def _switch(scene, mode, guard, t, y):
    x, _ = y
    sign, region = mode.sign, mode.region
    if sign == 0:
        return RUNNING, Mode(1 if guard == SLOW else -1, region_at(scene.law, 0.0), SLOW), y
    low, high = region_bounds(scene.law, region)
    if guard == FAST:
        return RUNNING, Mode(sign, faster(scene.law, region), SLOW), (x, sign * high)
    if low > 0.0:
        new_region = slower(scene.law, region)
        if holds_in_band(scene.law) and new_region == BAND:
            return RUNNING, _mode_at_rest(scene, t, x), (x, sign * low)
        return RUNNING, Mode(sign, new_region, FAST), (x, sign * low)
    if holds_in_band(scene.law) and region == BAND:
        # The pull has fallen to the breakaway force.
        return RUNNING, Mode(0, KINETIC, SLOW if sign > 0 else FAST), y
    if region == BAND:
        return RUNNING, Mode(-sign, BAND, SLOW), (x, 0.0)
    return RUNNING, _mode_at_rest(scene, t, x), (x, 0.0)


@series.expand.implements(belt.Belt)
def _expand(scene, mode, t, y, tolerance, c):
    drives.expand(scene.drive, t, ORDER + 2, c[SHIFT])
    load = scene.mass * scene.gravity
    stiffness_per_mass = scene.stiffness / scene.mass
    c[X, 0], c[V, 0] = y
    c[VELOCITY, 0] = y[1] + c[SHIFT, 1]
    if mode.sign == 0:
        bound = breakaway_force(scene)
        for k in range(ORDER + 1):
            # The sliding velocity is constant: zero, or that on entry into the dead band.
            v_k = y[1] if k == 0 else 0.0
            c[V, k] = v_k
            c[VELOCITY, k] = (k + 1.0) * c[SHIFT, k + 1] + v_k
            if k > 0:
                c[X, k] = c[SHIFT, k] + (y[1] if k == 1 else 0.0)
            c[FORCE, k] = -scene.stiffness * c[X, k] - scene.mass * (k + 1.0) * (k + 2.0) * c[SHIFT, k + 2]
            c[SLOW, k], c[FAST, k] = -c[FORCE, k], c[FORCE, k]
        c[SLOW, 0] = 0.0 if mode.entry_guard == SLOW else c[SLOW, 0] + bound
        c[FAST, 0] = 0.0 if mode.entry_guard == FAST else c[FAST, 0] + bound
    else:
        p, sign = piece(scene.law, mode.region), float(mode.sign)
        low, high = p.low, p.high
        yielding = holds_in_band(scene.law) and mode.region == BAND
        viscous = 0.0 if yielding else scene.viscous
        x_0 = sign * c[V, 0] - low
        _, factor_0 = basis_at(p, x_0)
        force, by_x, by_q, by_cube = friction_terms(p, sign * load * scene.mu_s, sign * load * scene.mu_k, x_0)
        force += viscous * c[V, 0]
        c[FORCE, 0], place, velocity = force, c[X, 0], c[VELOCITY, 0]
        first = newest = no_factors()
        for k in range(1, ORDER + 1):
            place, velocity = (
                velocity * INVERSE[k],
                -(stiffness_per_mass * place + force * (1.0 / scene.mass)) * INVERSE[k],
            )
            v = velocity - (k + 1.0) * c[SHIFT, k + 1]
            x = sign * v
            inner, inner_cube, _, _, _, _, _, _ = inner_products(c, FACTORS, k, first, newest)
            q = basis_term(p, k, factor_0, x, inner)
            force = by_x * x + by_q * q + by_cube * inner_cube + viscous * v
            right = basis_factor(p, x, q), q, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
            newest = set_factors(c, FACTORS, k, (k * x, x, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0), right)
            first = newest if k == 1 else first
            c[X, k], c[VELOCITY, k], c[V, k], c[FORCE, k] = place, velocity, v, force
        set_terms(c[SLOW], terms(c[V]) * sign)
        set_terms(c[FAST], terms(c[V]) * -sign)
        excess = x_0
        if yielding:
            # With a dead band the velocity of the belt is constant.
            set_terms(c[SLOW], terms(c[X]) * (-sign * scene.stiffness))
            excess = -sign * scene.stiffness * c[X, 0] - breakaway_force(scene)
        c[SLOW, 0] = 0.0 if mode.entry_guard == SLOW else excess
        c[FAST, 0] = 0.0 if mode.entry_guard == FAST else high - mode.sign * c[V, 0]
        # If friction does not drop at breakaway, the slope is zero there: what is computed is rounding.
        size = stiffness_per_mass * abs(c[X, 0]) + abs(c[FORCE, 0]) / scene.mass
        if mode.entry_guard == SLOW and low == 0.0 and not yielding and abs(c[V, 1]) <= 1e-12 * size:
            c[SLOW, 1] = 0.0
    # The unit of length is the distance that belt, body or load could move within a natural period of the spring.
    length = abs(c[X, 0]) + length_scale(scene, abs(c[VELOCITY, 0]) + abs(c[SHIFT, 1]))
    speed = length * (stiffness_per_mass**0.5 if stiffness_per_mass > 0.0 else 1.0)
    if mode.region == BAND and not holds_in_band(scene.law):
        # An error as large as the stiction band would keep the creep from becoming steady.
        speed = min(speed, 1e3 * stiction_band(scene.law))
    last = max(abs(c[X, ORDER]) / length, abs(c[V, ORDER]) / speed)
    previous = max(abs(c[X, ORDER - 1]) / length, abs(c[V, ORDER - 1]) / speed)
    h = step_size(last / tolerance, previous / tolerance)
    return h if mode.sign == 0 else shorten_for_decay(scene.law, mode.region, c[V], h)


@series.state_at.implements(belt.Belt)
def _state_at(scene, c, s):
    return value(c[X], s), value(c[V], s)


@series.rates_at.implements(belt.Belt)
def _rates_at(scene, c, s):
    return slope(c[X], s), slope(c[V], s)


@series.seen_at_start.implements(belt.Belt)
def _seen_at_start(scene, c):
    return c[X, 0], c[VELOCITY, 0], c[FORCE, 0], c[X, 0] - c[SHIFT, 0], c[V, 0], c[V, 1]


@series.seen_at.implements(belt.Belt)
def _seen_at(scene, c, s, h):
    velocity = value(c[VELOCITY], s)
    if abs(velocity) <= 1e-15 * (abs(c[VELOCITY, 0]) + variation(c[VELOCITY], h)):
        # A velocity within rounding is zero, so that an extreme of the displacement is recognised.
        velocity = 0.0
    x = value(c[X], s)
    return x, velocity, value(c[FORCE], s), x - value(c[SHIFT], s), value(c[V], s), slope(c[V], s)


@series.extremes.implements(belt.Belt)
def _extremes(scene, record, mode, c, h, work):
    count = 0
    if abs(c[VELOCITY, 0]) <= variation(c[VELOCITY], h):
        count = crossings(c[VELOCITY], h, work, count)
    if mode.sign != 0:
        # The velocity has an extreme where the net force vanishes.
        c[SPARE, 0] = scene.stiffness * c[X, 0] + c[FORCE, 0]
        set_terms(c[SPARE], terms(c[X]) * scene.stiffness + terms(c[FORCE]))
        count = crossings(c[SPARE], h, work, count)
    rest = due_within(scene, record, h)
    if rest > 0.0:
        work[0][count] = rest
        count += 1
    return count


@series.row.implements(belt.Belt)
def _row(scene, mode, c, t, s):
    mode_now = 0.0 if mode.region == BAND else float(mode.sign)
    return value(c[X], s), value(c[VELOCITY], s), value(c[FORCE], s), 0.0, mode_now


@modes.in_space.implements(belt.Belt, belt.BristleBelt)
def _in_space(scene, t, y):
    return y[0], y[1] + drives.turn(scene.drive, t)[1]
