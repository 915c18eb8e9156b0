"""The belt between end stops: impacts, rebounds that are summed, and rest at a stop while the belt slides.

A body that reaches a stop rebounds with the velocity in space times minus the coefficient of restitution; the belt
exerts no impulse on it. Rebounds that end soon are *summed*: the body rests at the stop as long as the other forces
press it there. Between the stops the modes are those of the belt without stops, ``scene.stops.free``, with both stops
as two more guards. While the body rests at a stop, the guard of this stop is the acceleration towards it that the stop
prevents; the sign of the mode is that of the slip, or 0 on a belt at rest.

`side` is 1 at the upper stop and -1 at the lower one; `forcing` begins with place, velocity and acceleration of the
belt.
"""

from __future__ import annotations

from math import nan
from typing import Any, NamedTuple

from ringsweep.compile import inlined
from ringsweep.models.belt.force import (
    breakaway_force,
    coefficients,
    if_force,
    length_scale,
    located,
    speed_scale,
    stuck_pull,
)
from ringsweep.models.belt.record import AtStop, with_since, with_stop
from ringsweep.models.belt.series import (
    ACCELERATION,
    FACTORS,
    FAST,
    FORCE,
    NORMAL,
    PUSH,
    SHIFT,
    SLOW,
    VELOCITY,
    V,
    X,
    expand_slip,
    mode_at_rest,
)
from ringsweep.models.belt.series import Mode as FreeMode
from ringsweep.models.interface import audit, implicit, modes, recorder, series, shock
from ringsweep.models.interface.status import RUNNING
from ringsweep.models.sliding import REACTION_TOLERANCE, expand_bounds, larger
from ringsweep.models.slip import region_guards, slip
from ringsweep.numerics.clock import Instant
from ringsweep.numerics.series import ORDER, step_within
from ringsweep.numerics.terms import joined, set_terms, terms
from ringsweep.physics import belt, drives, ring
from ringsweep.physics.belt import StopBelt
from ringsweep.physics.forces import expand_force, force_in
from ringsweep.physics.friction.registry import holds_in_band
from ringsweep.physics.friction.velocity import KINETIC, friction_in, region_at, region_bounds

#: Rows of the guards of both stops.
LOW, HIGH = FAST + 1, FAST + 2

#: Rebounds are summed that are shorter than this share of the length of the motion.
SUMMED = 1e-13

# Shares of their terms below which the velocity in space and the acceleration of a body at a stop are rounding.
_AT_REST, _BALANCED = 1e-14, 1e-12


class Mode(NamedTuple):
    """Mode of a belt between stops.

    Attributes
    ----------
    sign, region, entry_guard : int
        As in :class:`ringsweep.models.belt.series.Mode`.
    stop : AtStop
    place : tuple
        Empty: there are no zones between stops.
    """

    sign: int
    region: int
    entry_guard: int
    stop: AtStop
    place: Any


# What does not know of the stops is that of the belt without them.
for _hook in (
    *(modes.in_space, modes.row, series.state_at, series.rates_at, series.seen_at_start, series.seen_at),
    *(series.extremes, audit.least_scales, audit.energy_of, audit.same_statistics, recorder.lend),
    *(recorder.observe, recorder.enter, implicit.to_implicit, implicit.from_implicit),
    *(implicit.error_scales, implicit.rates, implicit.linearise, implicit.seen, implicit.sought),
    *(slip, region_guards),
):
    _hook.implements(StopBelt)(_hook.body_of(belt.Belt))


@series.table_shape.implements(StopBelt)
def _table_shape_between_stops(scene):
    """Implement :func:`series.table_shape`."""
    return HIGH + 1, ring.if_load_varies(scene.body, NORMAL, SLOW)


@inlined
def _place_of(scene, side):
    """Place of a stop, m."""
    return scene.stops.high if side > 0 else scene.stops.low


@inlined
def _side_at(scene, x):
    """Side on which a body at the place `x` touches a stop; 0 if it does not."""
    return 1 if x == scene.stops.high else -1 if x == scene.stops.low else 0


@inlined
def _is_still(v, forcing):
    """Whether a sliding velocity is that of a body at rest in space, but for rounding."""
    return abs(v + forcing[1]) <= _AT_REST * (abs(v) + abs(forcing[1]))


@inlined
def _acceleration(scene, x, sign, v, forcing):
    """Acceleration that friction of this direction and the other forces give a body, m/s^2."""
    mu, _ = friction_in(scene.law, region_at(scene.law, abs(v)), abs(v), coefficients(scene, sign))
    push = force_in(scene.drive, forcing) - if_force(scene.body, scene.viscous, 0.0) * v
    return ring.acceleration(scene.body, -sign * mu, -sign * mu, (x, push, v + forcing[1]))[0]


@inlined
def _at_rest(scene, t, side, stop):
    """Mode and state of a body at rest in space at a stop: held there, stuck to the belt, or about to leave."""
    forcing, x = drives.turn(scene.drive, t), _place_of(scene, side)
    v, entry = -forcing[1], -1
    sign = 1 if v > 0.0 else -1
    if v == 0.0:
        # The belt begins to move, or stays at rest.
        turns = forcing[2] if forcing[2] != 0.0 else drives.jerk_at(scene.drive, t)
        sign, entry = 1 if turns < 0.0 else -1, SLOW
        if holds_in_band(scene.law) and side * turns <= 0.0:
            found = mode_at_rest(scene, (), t, x)
            sign = found.sign
            if sign == 0 or (turns == 0.0 and sign == side and breakaway_force(scene, float(side), x) > 0.0):
                # On a belt at rest the stop bears what exceeds the breakaway force.
                rests = AtStop(side * abs(sign), stop.impacts, stop.speed_max, 0.0, stop.lasts)
                return Mode(0, KINETIC, -1, rests, ()), (x, 0.0)
    pressed = side * _acceleration(scene, x, float(sign), v, forcing) >= -_BALANCED * located(scene, x, 0.0).size
    at_stop = AtStop(side if pressed else 0, stop.impacts, stop.speed_max, 0.0, stop.lasts)
    return Mode(sign, region_at(scene.law, abs(v)), entry, at_stop, ()), (x, v)


@modes.begin.implements(StopBelt)
def _begin_between_stops(scene):
    """Implement :func:`modes.begin`."""
    t, y, status, mode = modes.begin(scene.stops.free)
    stop, side = AtStop(0, 0.0, 0.0, 0.0, 0.0), _side_at(scene, y[0])
    if status == RUNNING and side != 0 and _is_still(y[1], drives.turn(scene.drive, Instant(t, 0.0))):
        rests, y = _at_rest(scene, Instant(t, 0.0), side, stop)
        return t, y, RUNNING, rests
    return t, y, status, Mode(mode.sign, mode.region, mode.entry_guard, stop, ())


@modes.after_jump.implements(StopBelt)
def _after_jump_between_stops(scene, mode, t, y, jump):
    """Implement :func:`modes.after_jump`; a body at rest at a stop stays there if it is still pressed."""
    if mode.stop.rests != 0:
        after, state = _at_rest(scene, t, mode.stop.rests, mode.stop)
        return RUNNING, after, state
    old = FreeMode(mode.sign, mode.region, mode.entry_guard, ())
    status, new, state = modes.after_jump(scene.stops.free, old, t, y, jump)
    return status, Mode(new.sign, new.region, new.entry_guard, mode.stop, ()), state


@modes.switch.implements(StopBelt)
def _switch_between_stops(scene, mode, guard, t, y):
    """Implement :func:`modes.switch`."""
    stop, side = mode.stop, 1 if guard == HIGH else -1
    if guard in (LOW, HIGH):
        if stop.rests != 0:
            # Nothing presses the body any more.
            leaves, v = AtStop(0, stop.impacts, stop.speed_max, 0.0, stop.lasts), -drives.turn(scene.drive, t)[1]
            return RUNNING, Mode(mode.sign, mode.region, SLOW if v == 0.0 else -1, leaves, ()), (y[0], v)
        after, state = _impact(scene, mode, side, t, y)
        return RUNNING, after, state
    old = FreeMode(mode.sign, mode.region, mode.entry_guard, ())
    status, new, state = modes.switch(scene.stops.free, old, guard, t, y)
    if stop.rests != 0 and holds_in_band(scene.law) and state[1] == 0.0:
        # The belt comes to rest, and friction is that of a body at rest.
        after, state = _at_rest(scene, t, stop.rests, stop)
        return status, after, state
    if mode.sign == 0 and new.sign != 0 and new.sign == _side_at(scene, state[0]):
        forcing = drives.turn(scene.drive, t)
        if forcing[1] == 0.0 and forcing[2] == 0.0:
            presses = AtStop(new.sign, stop.impacts, stop.speed_max, 0.0, 0.0)
            return status, Mode(0, KINETIC, -1, presses, ()), state
    return status, Mode(new.sign, new.region, new.entry_guard, stop, ()), state


@inlined
def _impact(scene, mode, side, t, y):
    """Mode and state after a body has reached a stop."""
    forcing, x, stop, e = drives.turn(scene.drive, t), _place_of(scene, side), mode.stop, scene.stops.restitution
    closing = y[1] + forcing[1]
    if side * closing <= 0.0 or _is_still(y[1], forcing):
        return _at_rest(scene, t, side, stop)
    v, speed_max = y[1] - (1.0 + e) * closing, max(stop.speed_max, side * closing)
    # On a belt at rest friction turns round with the body, else the slip of the last rebounds is that at rest.
    other = y[1] if forcing[1] == 0.0 else -forcing[1]
    away = side * _acceleration(scene, x, 1.0 if v > 0.0 else -1.0, v, forcing)
    back = side * _acceleration(scene, x, 1.0 if other > 0.0 else -1.0, other, forcing)
    rebound, lasts, short = e * side * closing, 0.0, e == 0.0
    if away > 0.0 and back > 0.0 and e * e * back < away:
        # A rebound of speed u takes u/away + ratio u/back, and returns with the speed ratio u.
        ratio, length = (back / away) ** 0.5, abs(x) + length_scale(scene, abs(forcing[1]) + speed_max)
        short = rebound * rebound <= 2.0 * away * SUMMED * length
        lasts = rebound * (1.0 / away + ratio / back) / (1.0 - e * ratio)
    if short:
        return _at_rest(scene, t, side, AtStop(0, stop.impacts + 1.0, speed_max, 0.0, lasts))
    after = FreeMode(1 if v > 0.0 else -1, region_at(scene.law, abs(v)), SLOW if v == 0.0 else -1, ())
    if holds_in_band(scene.law) and v == 0.0:
        after = mode_at_rest(scene, (), t, x)
    hit = AtStop(0, stop.impacts + 1.0, speed_max, -side * rebound, 0.0)
    return Mode(after.sign, after.region, after.entry_guard, hit, ()), (x, v)


@series.fill_table.implements(StopBelt)
def _fill_table_between_stops(scene, mode, t, y, tolerance, c):
    """Implement :func:`series.fill_table`; the guards of the stops, which may be zero at first, are divided by time."""
    if mode.stop.rests != 0:
        return _fill_at_rest(scene, mode, t, tolerance, c)
    longest, reach = series.fill_table(
        scene.stops.free, FreeMode(mode.sign, mode.region, mode.entry_guard, ()), t, y, tolerance, c
    )
    for row, side in ((LOW, -1), (HIGH, 1)):
        set_terms(c[row], terms(c[X]) * float(-side))
        c[row, 0] = side * (_place_of(scene, side) - c[X, 0])
    side = _side_at(scene, c[X, 0])
    if side != 0:
        row = HIGH if side > 0 else LOW
        if abs(c[VELOCITY, 0]) <= _AT_REST * (abs(c[V, 0]) + abs(c[SHIFT, 1])):
            c[row, 1] = 0.0
            if abs(c[ACCELERATION, 0]) <= _BALANCED * located(scene, c[X, 0], 0.0).size:
                c[row, 2] = 0.0
        _divide_by_time(c[row])
    return longest, reach


@inlined
def _divide_by_time(row):
    """Divide a guard that is zero at first by a power of the time; one that stays zero is no guard."""
    zeros = 0
    while zeros <= ORDER and row[zeros] == 0.0:
        zeros += 1
    for k in range(ORDER + 1):
        row[k] = row[k + zeros] if k + zeros <= ORDER else 0.0
    if zeros > ORDER:
        row[0] = 1.0


@inlined
def _fill_at_rest(scene, mode, t, tolerance, c):
    """Fill the table of a body at rest at a stop; result as of :func:`series.fill_table`."""
    body, side = scene.body, mode.stop.rests
    row, x = HIGH if side > 0 else LOW, _place_of(scene, side)
    drives.expand_at(scene.drive, t, ORDER + 2, c[SHIFT], c[FACTORS:])
    if if_force(body, True, False):
        expand_force(scene.drive, t, ORDER, c[PUSH], c[FACTORS:])
    c[X, 0], c[VELOCITY, 0], c[V, 0] = x, 0.0, -c[SHIFT, 1]
    expand_slip(scene, mode, if_force(body, scene.viscous, 0.0), c, True)
    if mode.sign == 0:
        # On a belt at rest.
        c[FORCE, 0] = side * breakaway_force(scene, float(side), x)
        c[ACCELERATION, 0] -= c[FORCE, 0] / body.mass
    moves = False
    for k in range(ORDER + 1):
        c[LOW, k] = c[HIGH, k] = 1.0 if k == 0 else 0.0
        c[row, k] = side * c[ACCELERATION, k]
        c[ACCELERATION, k] = 0.0
        moves = moves or c[V, k] != 0.0
    expand_bounds(c, (V, SLOW, FAST), mode, region_bounds(scene.law, mode.region), 0.0)
    if not moves:
        c[SLOW, 0] = c[FAST, 0] = 1.0
    size = located(scene, x, c[row, 0]).size
    speed = speed_scale(scene, abs(x) + length_scale(scene, abs(c[SHIFT, 1])), abs(c[SHIFT, 1]))
    h = step_within(c, ((V, 1.0 / (speed * tolerance)), (row, 1.0 / (size * tolerance))))
    if abs(c[row, 0]) <= _BALANCED * size:
        c[row, 0] = 0.0
        _divide_by_time(c[row])
    return h, h


@recorder.begin.implements(StopBelt)
def _begin_record_between_stops(scene, t, seen):
    """Implement :func:`recorder.begin`: there has been no impact."""
    r = recorder.begin(scene.stops.free, t, seen)
    return with_stop(r, AtStop(0, 0.0, 0.0, 0.0, 0.0), r.stops)


@recorder.conclude.implements(StopBelt)
def _conclude_between_stops(scene, record, status, t, place, velocity):
    """Implement :func:`recorder.conclude`; at a stop the velocity is exactly zero."""
    stop = record.at_stop
    found = recorder.conclude(scene.stops.free, record, status, t, place, 0.0 if stop.rests != 0 else velocity)
    return joined(found, (stop.impacts, stop.speed_max))


@recorder.after_event.implements(StopBelt)
def _after_event_between_stops(scene, record, before, mode, t):
    """Implement :func:`recorder.after_event`: an impact is an observation that lasts no time."""
    r = recorder.after_event(scene.stops.free, record, before, mode, t)
    if mode.stop.impacts == r.at_stop.impacts:
        return with_stop(r, mode.stop, r.stops)
    last, velocity = r.last, mode.stop.velocity
    low, high, v = scene.stops.low, scene.stops.high, last.v + (velocity - last.velocity)
    x = high if high - last.x < last.x - low else low
    force, rate = last.pull - scene.body.mass * last.v_rate, last.v_rate
    seen = x, velocity, force, last.place, v, rate, shock.Located(nan, 0.0), nan
    r = recorder.observe(scene, r, t, 0.0, modes.sticks(scene, mode), seen)
    # Stick on a belt at rest begins as the last rebounds end.
    return with_stop(r, mode.stop, with_since(r.stops, r.stops.since + mode.stop.lasts))


# ---- implicit steps --------------------------------------------------------------------------


@implicit.is_stiff.implements(StopBelt)
def _is_stiff_between_stops(scene, mode, y, linear):
    """Implement :func:`implicit.is_stiff`; at a stop, and as a body leaves it, steps are series."""
    return mode.stop.rests == 0 and _side_at(scene, y[0]) == 0 and implicit.is_stiff(scene.stops.free, mode, y, linear)


@implicit.guards_and_motion.implements(StopBelt)
def _guards_and_motion_between_stops(scene, mode, common, forcing, x):
    """Implement :func:`implicit.guards_and_motion`."""
    guards, motion = implicit.guards_and_motion(scene.stops.free, mode, common, forcing, x)
    return joined(guards, (motion[0] - scene.stops.low, scene.stops.high - motion[0])), motion


@implicit.near_zero.implements(StopBelt)
def _near_zero_between_stops(scene, motion):
    """Implement :func:`implicit.near_zero`."""
    return joined(implicit.near_zero(scene.stops.free, motion), (0.0, 0.0))


# ---- audit -----------------------------------------------------------------------------------


@audit.violation.implements(StopBelt)
def _violation_between_stops(scene, mode, forcing, y, rates, s, tolerance):
    """Implement :func:`audit.violation`: a stop is not passed, and only presses."""
    (x, v), side, stops = y, mode.stop.rests, scene.stops
    length = abs(x) + length_scale(scene, abs(v) + 2.0 * abs(forcing[1]))
    beyond = max(stops.low - x, x - stops.high) / (tolerance * length)
    if side == 0:
        free = FreeMode(mode.sign, mode.region, mode.entry_guard, ())
        violation, power = audit.violation(stops.free, free, forcing, y, rates, s, tolerance)
        return larger(violation, beyond), power
    pressing = side * _acceleration(scene, x, float(mode.sign), v, forcing)
    if mode.sign == 0:
        pressing = (side * stuck_pull(scene, x, v, forcing) - breakaway_force(scene, float(side), x)) / scene.body.mass
    lifted = -pressing / (REACTION_TOLERANCE * tolerance * located(scene, x, 0.0).size)
    speed = abs(v + forcing[1]) + abs(rates[0])
    moves = (abs(x - _place_of(scene, side)) + speed * s) / (tolerance * length)
    return larger(larger(max(lifted, 0.0), beyond), moves), 0.0


@audit.undecided.implements(StopBelt)
def _undecided_between_stops(batch, one, other, fall_rates):
    """Implement :func:`audit.undecided`; both runs must have as many impacts."""
    return audit.undecided(batch.stops.free, one, other, fall_rates) | (one.impacts != other.impacts)


@audit.of_events.implements(StopBelt)
def _of_impacts_at_stops(batch, one):
    """Implement :func:`audit.of_events`."""
    hit = one.impacts > 0.0
    return hit & False, hit, SUMMED * hit
