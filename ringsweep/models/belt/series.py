"""The belt as a piecewise-smooth system: modes, guards and their power series.

The state is ``(x, v)``: the sliding velocity itself, not the difference of two large velocities.
"""

from __future__ import annotations

from typing import NamedTuple

from ringsweep.compile import inlined
from ringsweep.models.belt.force import _bound, holds_in_band, length_scale
from ringsweep.models.interface import modes, series
from ringsweep.models.interface.status import RUNNING
from ringsweep.numerics.series import INVERSE, ORDER, crossings, reach, slope, value, variation
from ringsweep.physics import belt, drives
from ringsweep.physics.friction.velocity import (
    BAND,
    KINETIC,
    expand_weights,
    faster,
    region_at,
    region_bounds,
    slower,
    stiction_band,
    tail_reach,
)

# Rows of the series; the guards last.
X, V, VELOCITY, EXCESS, BASIS, STATIC_WEIGHT, KINETIC_WEIGHT, FORCE, SHIFT = range(9)


SLOW, FAST = range(9, 11)


class Mode(NamedTuple):
    """Sign of the sliding velocity (0: held), region of the law, guard that is zero on entry or -1.

    In a dead band that does not hold any more, the sign is that of the pull.
    """

    sign: int
    region: int
    fresh: int


@series.after_first_step.implements(Mode)
def _after_first_step(mode):
    return Mode(mode.sign, mode.region, -1)


@modes.initial_state.implements(belt.Belt)
def _initial_state(scene):
    return drives.beginning(scene.drive), (scene.initial_x, drives.launched(scene.drive, scene.initial_v))


@series.table_shape.implements(belt.Belt)
def _table_shape(scene):
    return FAST + 1, SLOW


@inlined
def _pull(scene, t, x):
    """Force that friction must overcome to hold the body to the belt, N; positive forwards."""
    return -scene.stiffness * x - scene.mass * drives.turn(scene.drive, t)[2]


@modes.initial_mode.implements(belt.Belt)
def _initial_mode(scene, t, y):
    x, v = y
    if holds_in_band(scene.law) and abs(v) <= stiction_band(scene.law):
        return RUNNING, _settle(scene, t, x)
    if v == 0.0:
        return RUNNING, Mode(1 if _pull(scene, t, x) >= 0.0 else -1, BAND, SLOW)
    return RUNNING, Mode(1 if v > 0.0 else -1, region_at(scene.law, abs(v)), -1)


@inlined
def _settle(scene, t, x):
    """Mode of a set-valued law where the sliding velocity is zero, or within its dead band."""
    pull = _pull(scene, t, x)
    bound = _bound(scene)
    if abs(pull) <= bound and bound > 0.0:
        return Mode(0, KINETIC, -1)
    if pull == 0.0:
        # What the pull will be in a moment, as the belt takes the body along.
        _, belt_velocity, _ = drives.turn(scene.drive, t)
        pull = -scene.stiffness * belt_velocity - scene.mass * drives.jerk(scene.drive, t)
    # Without a band the sliding velocity is a guard, and zero here.
    fresh = SLOW if stiction_band(scene.law) == 0.0 else -1
    return Mode(1 if pull >= 0.0 else -1, region_at(scene.law, 0.0), fresh)


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
        entered = slower(scene.law, region)
        if holds_in_band(scene.law) and entered == BAND:
            return RUNNING, _settle(scene, t, x), (x, sign * low)
        return RUNNING, Mode(sign, entered, FAST), (x, sign * low)
    if holds_in_band(scene.law) and region == BAND:
        # The pull has fallen to what the contact holds.
        return RUNNING, Mode(0, KINETIC, SLOW if sign > 0 else FAST), y
    if region == BAND:
        return RUNNING, Mode(-sign, BAND, SLOW), (x, 0.0)
    return RUNNING, _settle(scene, t, x), (x, 0.0)


@series.expand.implements(belt.Belt)
def _expand(scene, mode, t, y, tolerance, c):
    drives.expand(scene.drive, t, ORDER + 2, c[SHIFT])
    load = scene.mass * scene.gravity
    rate = scene.stiffness / scene.mass
    c[X, 0], c[V, 0] = y
    c[VELOCITY, 0] = y[1] + c[SHIFT, 1]
    if mode.sign == 0:
        bound = _bound(scene)
        for k in range(ORDER + 1):
            # The sliding velocity that the body had in a dead band stays, or is zero.
            slide = y[1] if k == 0 else 0.0
            c[V, k] = slide
            c[VELOCITY, k] = (k + 1.0) * c[SHIFT, k + 1] + slide
            if k > 0:
                c[X, k] = c[SHIFT, k] + (y[1] if k == 1 else 0.0)
            c[FORCE, k] = -scene.stiffness * c[X, k] - scene.mass * (k + 1.0) * (k + 2.0) * c[SHIFT, k + 2]
            c[SLOW, k], c[FAST, k] = -c[FORCE, k], c[FORCE, k]
        c[SLOW, 0] = 0.0 if mode.fresh == SLOW else c[SLOW, 0] + bound
        c[FAST, 0] = 0.0 if mode.fresh == FAST else c[FAST, 0] + bound
    else:
        low, high = region_bounds(scene.law, mode.region)
        yielding = holds_in_band(scene.law) and mode.region == BAND
        viscous = 0.0 if yielding else scene.viscous
        for k in range(ORDER + 1):
            c[EXCESS, k] = mode.sign * c[V, k] - (low if k == 0 else 0.0)
            expand_weights(scene.law, mode.region, c[EXCESS], k, c[BASIS], c[STATIC_WEIGHT], c[KINETIC_WEIGHT])
            c[FORCE, k] = mode.sign * load * (c[STATIC_WEIGHT, k] * scene.mu_s + c[KINETIC_WEIGHT, k] * scene.mu_k)
            c[FORCE, k] += viscous * c[V, k]
            if k < ORDER:
                c[X, k + 1] = c[VELOCITY, k] * INVERSE[k + 1]
                c[VELOCITY, k + 1] = -(rate * c[X, k] + c[FORCE, k] / scene.mass) * INVERSE[k + 1]
                c[V, k + 1] = c[VELOCITY, k + 1] - (k + 2.0) * c[SHIFT, k + 2]
        for k in range(1, ORDER + 1):
            c[SLOW, k], c[FAST, k] = c[EXCESS, k], -c[EXCESS, k]
        if yielding:
            for k in range(ORDER + 1):
                # A belt under a dead band has constant velocity.
                c[SLOW, k] = -mode.sign * scene.stiffness * c[X, k]
            c[EXCESS, 0] = c[SLOW, 0] - _bound(scene)
        c[SLOW, 0] = 0.0 if mode.fresh == SLOW else c[EXCESS, 0]
        c[FAST, 0] = 0.0 if mode.fresh == FAST else high - mode.sign * c[V, 0]
        # Breakaway of a law without a drop of friction is tangential: what is left of the slope is rounding.
        terms = rate * abs(c[X, 0]) + abs(c[FORCE, 0]) / scene.mass
        if mode.fresh == SLOW and low == 0.0 and not yielding and abs(c[V, 1]) <= 1e-12 * terms:
            c[SLOW, 1] = 0.0
    # Lengths are measured by the way that the belt, the body or the load could go in the spring's own time.
    length = abs(c[X, 0]) + length_scale(scene, abs(c[VELOCITY, 0]) + abs(c[SHIFT, 1]))
    speed = length * (rate**0.5 if rate > 0.0 else 1.0)
    if mode.region == BAND and not holds_in_band(scene.law):
        # Noise that is large for the band would keep the creep from ever settling.
        speed = min(speed, 1e3 * stiction_band(scene.law))
    last = max(abs(c[X, ORDER]) / length, abs(c[V, ORDER]) / speed)
    previous = max(abs(c[X, ORDER - 1]) / length, abs(c[V, ORDER - 1]) / speed)
    h = reach(last / tolerance, previous / tolerance)
    return h if mode.sign == 0 else tail_reach(scene.law, mode.region, c[V], h)


@series.state_at.implements(belt.Belt)
def _state_at(scene, c, s):
    return value(c[X], s), value(c[V], s)


@series.rates_at.implements(belt.Belt)
def _rates_at(scene, c, s):
    return slope(c[X], s), slope(c[V], s)


@series.seen_at.implements(belt.Belt)
def _seen_at(scene, c, s, h):
    velocity = value(c[VELOCITY], s)
    if abs(velocity) <= 1e-15 * (abs(c[VELOCITY, 0]) + variation(c[VELOCITY], h)):
        # A maximum is met where the velocity vanishes, not where its rounding changes sign.
        velocity = 0.0
    return value(c[X], s), velocity, value(c[FORCE], s)


@series.extremes.implements(belt.Belt)
def _extremes(scene, record, mode, c, h, work):
    count = 0
    if abs(c[VELOCITY, 0]) <= variation(c[VELOCITY], h):
        count = crossings(c[VELOCITY], h, work, count)
    if mode.sign != 0:
        # Extremes of the velocity are zeros of the net force.
        for k in range(ORDER + 1):
            c[SHIFT, k] = scene.stiffness * c[X, k] + c[FORCE, k]
        count = crossings(c[SHIFT], h, work, count)
    return count


@series.row.implements(belt.Belt)
def _row(scene, mode, c, t, s):
    mode_now = 0.0 if mode.region == BAND else float(mode.sign)
    return value(c[X], s), value(c[VELOCITY], s), value(c[FORCE], s), 0.0, mode_now


@modes.in_space.implements(belt.Belt, belt.BristleBelt)
def _in_space(scene, t, y):
    return y[0], y[1] + drives.turn(scene.drive, t)[1]
