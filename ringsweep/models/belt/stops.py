"""End stops of a belt: impacts, rebounds that are summed, and rest at a stop while the belt slides.

A body that reaches a stop rebounds with the velocity in space times minus the coefficient of restitution; the belt
exerts no impulse on it, and bristles keep their deflection. Rebounds that end soon are *summed*: the body rests at the
stop as long as the other forces press it there. Between the stops both are two more guards. While the body rests at a
stop, the guard of this stop is the acceleration towards it that the stop prevents; the sign of the mode is that of the
slip, or 0 on a belt at rest.

`stops` is the field of the scene, without which nothing of this file is compiled. `side` is 1 at the upper stop and -1
at the lower one; `forcing` begins with place, velocity and acceleration of the belt.
"""

from __future__ import annotations

from ringsweep.compile import feature, inlined
from ringsweep.models.belt.force import breakaway_force, in_segment, length_scale, located, moving, stuck_pull
from ringsweep.models.belt.mode import (
    ACCELERATION,
    FAST,
    FORCE,
    NORMAL,
    SHIFT,
    SLOW,
    VELOCITY,
    AtStop,
    Mode,
    V,
    X,
    after_guard,
    low_stop,
    mode_at,
    with_stop,
    yields,
)
from ringsweep.models.interface import implicit
from ringsweep.models.interface.status import RUNNING
from ringsweep.models.sliding import REACTION_TOLERANCE, larger
from ringsweep.models.slip import slip, zeros
from ringsweep.numerics.series import ORDER, divide_by_time, step_within
from ringsweep.numerics.terms import joined, set_terms, terms
from ringsweep.physics import belt, drives, ring
from ringsweep.physics.friction.registry import holds_in_band
from ringsweep.physics.friction.velocity import KINETIC

#: Rebounds are summed that are shorter than this share of the length of the motion.
SUMMED = 1e-13

# Shares of their terms below which the velocity in space and the acceleration of a body at a stop are rounding.
_AT_REST, _BALANCED = 1e-14, 1e-12


@inlined
def _side_at(stops, x):
    """Side on which a body at the place `x` touches a stop; 0 if it does not."""
    return 1 if x == stops.high else -1 if x == stops.low else 0


@inlined
def _is_still(v, velocity):
    """Whether the velocity in space of a body that slides is zero but for rounding."""
    return abs(velocity) <= _AT_REST * (abs(v) + abs(v - velocity))


@inlined
def _pressing(scene, mode, side, forcing, y):
    """Acceleration towards a stop that the forces on a body would give it, m/s^2."""
    x = y[0]
    if mode.sign == 0:
        here = belt.laden(scene.drive, in_segment(scene.surface, scene, mode.place), forcing)
        return (side * stuck_pull(here, x, y[1], forcing) - breakaway_force(here, float(side), x)) / scene.body.mass
    # At rest on the belt friction is that against the slip that begins.
    at = implicit.to_implicit(scene, forcing, (x, mode.sign * max(mode.sign * y[1], 1e-300), *y[2:]))
    now = slip(scene, mode, (), forcing, at)
    return side * ring.acceleration(belt.laden(scene.drive, scene, forcing).body, *now.K, now.motion)[0]


@feature("()")
def no_impact(stops):
    """A body that has hit no stop."""
    return AtStop(0, 0.0, 0.0, 0.0, 0.0)


@feature("status, mode, y")
def settled(stops, scene, stop, t, y, status, mode):
    """Status, mode and state of a body whose mode would be this one without stops; it may rest at one."""
    side, forcing = _side_at(stops, y[0]), drives.turn(scene.drive, t)
    # Rounding does not lift a body that has rested at a stop before the velocity of the belt jumped.
    still = stop.rests != 0 or _is_still(y[1], moving(scene, y[1] + forcing[1], y[1], forcing[1]))
    if status == RUNNING and side != 0 and still:
        if y[1] != -forcing[1]:
            # A velocity that is zero but for rounding has decided the mode.
            _, mode = mode_at(scene, mode.place, t, (y[0], -forcing[1], *y[2:]))
        mode, y = _at_rest(scene, mode, side, stop, t, y)
        return status, mode, y
    return status, with_stop(mode, stop), y


@inlined
def _at_rest(scene, mode, side, stop, t, y):
    """Mode and state of a body at rest in space at a stop: held there, stuck to the belt, or about to leave.

    `mode` is that of a body without stops.
    """
    forcing, place = drives.turn(scene.drive, t), mode.place
    y = scene.stops.high if side > 0 else scene.stops.low, -forcing[1], *y[2:]
    if y[1] == 0.0:
        # The belt begins to move, or stays at rest.
        turns = forcing[2] if forcing[2] != 0.0 else drives.jerk_at(scene.drive, t)
        sign = 1 if turns < 0.0 else -1
        if holds_in_band(scene.law) and side * turns <= 0.0:
            here = belt.laden(scene.drive, in_segment(scene.surface, scene, place), forcing)
            sign = mode.sign
            if sign == 0 or (turns == 0.0 and sign == side and breakaway_force(here, float(side), y[0]) > 0.0):
                # On a belt at rest the stop bears what exceeds the breakaway force.
                rests = AtStop(side * abs(sign), stop.impacts, stop.speed_max, 0.0, stop.lasts)
                return Mode(0, KINETIC, -1, place, rests), y
        if sign != mode.sign:
            mode = Mode(sign, mode.region, SLOW, place, ())
    least = -_BALANCED * located(scene, y[0], 0.0).size
    pressed = not yields(scene, mode) and _pressing(scene, mode, side, forcing, y) >= least
    rests = AtStop(side if pressed else 0, stop.impacts, stop.speed_max, 0.0, stop.lasts)
    return with_stop(mode, rests), y


@feature("after_guard(scene, mode, guard, t, y)")
def switched(stops, scene, mode, guard, t, y):
    """Status, mode and state after a guard has reached zero; see :func:`modes.switch`."""
    stop, low = mode.stop, low_stop(scene.surface)
    if guard >= low:
        side = 1 if guard > low else -1
        after, y = _leave(scene, mode, side, t, y) if stop.rests != 0 else _impact(scene, mode, side, t, y)
        return RUNNING, after, y
    was_stuck = mode.sign == 0
    status, mode, y = after_guard(scene, with_stop(mode, ()), guard, t, y)
    if holds_in_band(scene.law) and y[1] == 0.0 and (stop.rests != 0 or (was_stuck and mode.sign != 0)):
        # The belt comes to rest, and friction is that of a body at rest; or a body at rest breaks loose.
        return settled(stops, scene, stop, t, y, status, mode)
    return status, with_stop(mode, stop), y


@inlined
def _leave(scene, mode, side, t, y):
    """Mode and state of a body that nothing presses to a stop any more."""
    v, entry = -drives.turn(scene.drive, t)[1], -1
    if v == 0.0:
        entry = FAST if mode.sign == 0 and side < 0 else SLOW
    stop = AtStop(0, mode.stop.impacts, mode.stop.speed_max, 0.0, mode.stop.lasts)
    x = scene.stops.high if side > 0 else scene.stops.low
    return Mode(mode.sign, mode.region, entry, mode.place, stop), (x, v, *y[2:])


@inlined
def _impact(scene, mode, side, t, y):
    """Mode and state after a body has reached a stop."""
    forcing, e, before = drives.turn(scene.drive, t), scene.stops.restitution, mode.stop
    velocity = moving(scene, y[1] + forcing[1], y[1], forcing[1])
    closing = side * velocity
    # A body that has just rebounded may seem to lie beyond the stop by rounding of its place: it flies on.
    rebound, hits = (e * closing, 1.0) if closing > 0.0 else (-closing, 0.0)
    x, v = scene.stops.high if side > 0 else scene.stops.low, -side * rebound - forcing[1]
    _, at_rest = mode_at(scene, mode.place, t, (x, -forcing[1], *y[2:]))
    if _is_still(y[1], velocity):
        return _at_rest(scene, at_rest, side, before, t, y)
    impacts, speed_max, lasts, short = before.impacts + hits, max(before.speed_max, closing), 0.0, rebound == 0.0
    # On a belt at rest friction turns round with the body, else the slip of the last rebounds is that at rest.
    rises, falls = (x, v, *y[2:]), (x, y[1] if forcing[1] == 0.0 else -forcing[1], *y[2:])
    _, after = mode_at(scene, mode.place, t, rises)
    _, last = mode_at(scene, mode.place, t, falls)
    away, back = _pressing(scene, after, side, forcing, rises), _pressing(scene, last, side, forcing, falls)
    if away > 0.0 and back > 0.0 and e * e * back < away:
        # A rebound of speed u takes u/away + ratio u/back, and returns with the speed ratio u.
        ratio, length = (back / away) ** 0.5, abs(x) + length_scale(scene, abs(forcing[1]) + speed_max)
        short = rebound * rebound <= 2.0 * away * SUMMED * length
        lasts = rebound * (1.0 / away + ratio / back) / (1.0 - e * ratio)
    if short:
        return _at_rest(scene, at_rest, side, AtStop(0, impacts, speed_max, 0.0, lasts), t, y)
    return with_stop(after, AtStop(0, impacts, speed_max, -side * rebound, 0.0)), rises


# ---- series ----------------------------------------------------------------------------------


@feature("False")
def rests_at(stop):
    """Whether a body rests at a stop."""
    return stop.rests != 0


@feature("h")
def expand_stops(stops, scene, mode, tolerance, c, h):
    """Fill the guards of both stops behind all other series; the step `h`, s, or less while a body rests at a stop."""
    low = low_stop(scene.surface)
    if mode.stop.rests != 0:
        return _expand_rest(scene, mode, tolerance, c, h)
    for row, side, place in ((low, -1, stops.low), (low + 1, 1, stops.high)):
        set_terms(c[row], terms(c[X]) * float(-side))
        c[row, 0] = side * (place - c[X, 0])
    side = _side_at(stops, c[X, 0])
    if side != 0:
        row, entry = low + 1 if side > 0 else low, mode.entry_guard
        if mode.sign == 0 and entry > NORMAL:
            # The stop bore what exceeded the breakaway force: rounding does not break the body loose again.
            c[entry, 0] = max(c[entry, 0], 0.0)
        if _is_still(c[V, 0], c[VELOCITY, 0]):
            c[row, 1] = 0.0
            if abs(c[ACCELERATION, 0]) <= _BALANCED * located(scene, c[X, 0], 0.0).size:
                c[row, 2] = 0.0
        if divide_by_time(c[row], 0) > ORDER:
            # A guard that stays zero is none.
            c[row, 0] = 1.0
    return h


@inlined
def _expand_rest(scene, mode, tolerance, c, h):
    """Make the series of a body that the stop does not hold those of one that it holds; see :func:`expand_stops`."""
    side, low = mode.stop.rests, low_stop(scene.surface)
    # A body that sticks is pressed by the part of the pull that friction does not bear.
    reserve, row, moves = SLOW if side > 0 else FAST, low + 1 if side > 0 else low, False
    for k in range(ORDER + 1):
        c[low, k] = c[low + 1, k] = 1.0 if k == 0 else 0.0
        c[row, k] = side * c[ACCELERATION, k] if mode.sign != 0 else -c[reserve, k] / scene.body.mass
        if mode.sign == 0:
            c[FORCE, k] += side * c[reserve, k]
        c[ACCELERATION, k] = 0.0
        moves = moves or (c[SHIFT, k] != 0.0 and k > 0)
    if mode.sign == 0 or not moves:
        # The slip changes as the belt begins to move, and not otherwise.
        for k in range(ORDER + 1):
            c[SLOW, k] = c[FAST, k] = 1.0 if k == 0 and not moves else 0.0
    size = located(scene, c[X, 0], c[row, 0]).size
    h = min(h, step_within(c, ((row, 1.0 / (size * tolerance)),)))
    if abs(c[row, 0]) <= _BALANCED * size:
        c[row, 0] = 0.0
        if divide_by_time(c[row], 0) > ORDER:
            c[row, 0] = 1.0
    return h


# ---- implicit steps --------------------------------------------------------------------------


@feature("guards, acceleration")
def guarded(stops, guards, mode, x, acceleration):
    """Guards, and behind them those of both stops; and the acceleration of the body, m/s^2."""
    side = mode.stop.rests
    if side == 0:
        return joined(guards, (x - stops.low, stops.high - x)), acceleration
    return joined(guards, (-acceleration if side < 0 else 1.0, acceleration if side > 0 else 1.0)), 0.0


@feature("x")
def held_place(stops, x, mode, forcing):
    """State of an implicit step of a body that rests at a stop, without the error of its place and velocity."""
    side = mode.stop.rests
    if side == 0:
        return x
    return (stops.high if side > 0 else stops.low) - forcing[0], -forcing[1], *x[2:]


@feature("(-1, 1.0)")
def pressed(stops, scene, mode, tolerance, x):
    """Guard of the stop that holds a body at the place `x`, -1 if none does; and the error allowed to it, m/s^2."""
    guard = low_stop(scene.surface) + max(mode.stop.rests, 0) if mode.stop.rests != 0 else -1
    return guard, tolerance * located(scene, x, 0.0).size


@feature("True")
def is_away(stops, mode, y):
    """Whether a body is not at a stop. At one, and as a body leaves it, steps of laws without memory are series."""
    return mode.stop.rests == 0 and _side_at(stops, y[0]) == 0


@feature("rates")
def held_rates(stop, rates, forcing):
    """Rates of the state of an implicit step; a stop holds the body against the forces."""
    if stop.rests == 0:
        return rates
    return rates[0], -forcing[2], *rates[2:]


@feature("linear")
def held_linear(stop, linear, scene, t, forcing):
    """Rates, Jacobian, and derivatives by time of an implicit step; a stop holds the body against the forces."""
    if stop.rests == 0:
        return linear
    rates, jacobian, by_time = linear
    nothing = joined((0.0, 0.0), zeros(rates[2:]))
    held = by_time[0], -drives.jerk_at(scene.drive, t), *by_time[2:]
    rows = jacobian[0], nothing, *jacobian[2:]
    return held_rates(stop, rates, forcing), rows, held


# ---- audit -----------------------------------------------------------------------------------


@feature("found")
def beside_stops(stops, scene, mode, forcing, y, s, tolerance, found):
    """Violation and power, of which `found` are those without stops: a stop is not passed, and only presses."""
    x, v, side = y[0], y[1], mode.stop.rests
    allowed = tolerance * (abs(x) + length_scale(scene, abs(v) + 2.0 * abs(forcing[1])))
    beyond = max(stops.low - x, x - stops.high) / allowed
    if side == 0:
        return larger(found[0], beyond), found[1]
    lifted = -_pressing(scene, mode, side, forcing, y) / (REACTION_TOLERANCE * tolerance * located(scene, x, 0.0).size)
    moves = (abs(x - (stops.high if side > 0 else stops.low)) + abs(v + forcing[1]) * s) / allowed
    return larger(larger(max(lifted, 0.0), beyond), moves), 0.0
