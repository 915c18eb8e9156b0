"""The belt as a piecewise-smooth system: modes, guards and their power series.

The state is ``(x, v)`` with the displacement in space and the sliding velocity. The difference of two large velocities
would lose all its digits.

Read :mod:`ringsweep.models.interface.series` first. `c` is the table of series; ``c[ROW, k]`` is coefficient k, with
the rows that are named below. In a kernel the order of statements counts: each coefficient needs those before it.
"""

from __future__ import annotations

from math import nan
from typing import Any, NamedTuple

from ringsweep.compile import feature, inlined
from ringsweep.models.belt.force import (
    breakaway_force,
    coefficients,
    direction,
    if_force,
    in_segment,
    length_scale,
    located,
    moving,
    rounding_of_reserve,
    speed_scale,
    stuck_pull,
    stuck_rates,
)
from ringsweep.models.interface import modes, series
from ringsweep.models.interface.status import RUNNING, SEPARATED_1
from ringsweep.models.sliding import expand_bounds, speed_in
from ringsweep.numerics.clock import Instant
from ringsweep.numerics.series import INVERSE, ORDER, crossings, differentiate, slope, step_within, value, variation
from ringsweep.numerics.terms import (
    FACTOR_ROWS,
    MOST_GROUPS,
    inner_products,
    no_factors,
    part_from,
    set_factors,
)
from ringsweep.physics import belt, drives, ring, zones
from ringsweep.physics.forces import Laden, expand_force, expand_load, force_in, largest_force
from ringsweep.physics.friction.registry import holds_in_band
from ringsweep.physics.friction.velocity import (
    KINETIC,
    begin_series,
    friction_in,
    no_products,
    region_at,
    region_bounds,
    series_term,
    shorten_for_decay,
    stiction_band,
)
from ringsweep.physics.friction.ways import along

# Rows of the table of series; the guards are last.
X, V, VELOCITY, ACCELERATION, FORCE, SHIFT, PUSH, LOAD, SQUARE, CUBE, RATIO, FACTORS = range(12)
_GUARDS = FACTORS + MOST_GROUPS * FACTOR_ROWS
# The normal reaction is a guard only if it varies.
NORMAL, SLOW, FAST, EDGE_ABOVE, EDGE_BELOW = range(_GUARDS, _GUARDS + 5)


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
    place : tuple of int
        Segment and turn of the surface; an empty tuple without zones.
    """

    sign: int
    region: int
    entry_guard: int
    place: Any


@modes.in_space.implements(belt.Belt)
def _in_space_on_belt(scene, t, y):
    """Implement :func:`modes.in_space`."""
    forcing = drives.turn(scene.drive, t)
    return y[0], moving(scene, y[1] + forcing[1], y[1], forcing[1])


@series.table_shape.implements(belt.Belt)
def _table_shape_on_belt(scene):
    """Implement :func:`series.table_shape`; the reaction is a guard if it varies, edges if there are zones."""
    return _rows(scene.surface), ring.if_load_varies(scene.body, NORMAL, SLOW)


@feature("FAST + 1")
def _rows(surface):
    """Number of rows of the table."""
    return EDGE_BELOW + 1


@feature("()")
def _place_at(surface, x, shift):
    """Segment and turn of the surface under a body at `x`, on a belt that has moved by `shift`, m."""
    return zones.locate(surface, zones.place_in(surface.frame, x, shift))


@modes.begin.implements(belt.Belt)
def _begin_on_belt(scene):
    """Implement :func:`modes.begin`; the state is ``(x, v)``."""
    t, x = drives.beginning(scene.drive), scene.initial_x
    v = drives.velocity_at_beginning(scene.drive, scene.initial_v)
    place = _place_at(scene.surface, x, drives.turn(scene.drive, Instant(t, 0.0))[0])
    status, mode = _mode_at(in_segment(scene.surface, scene, place), place, Instant(t, 0.0), x, v)
    return t, (x, v), status, mode


@modes.after_jump.implements(belt.Belt)
def _after_jump_on_belt(scene, mode, t, y, jump):
    """Implement :func:`modes.after_jump`."""
    x, v = y[0], y[1] - jump
    status, mode = _mode_at(in_segment(scene.surface, scene, mode.place), mode.place, t, x, v)
    return status, mode, (x, v)


@inlined
def _mode_at(scene, place, t, x, v):
    """Status and mode of a body at `x`, m, with a sliding velocity, m/s; `scene` has the friction of the `place`."""
    laden = belt.laden_at(scene.drive, scene, t)
    status, mode = RUNNING, Mode(1 if v > 0.0 else -1, region_at(scene.law, abs(v)), -1, place)
    if ring.if_load_varies(scene.body, True, False) and ring.reactions(laden.body, 0.0, 0.0, (x, 0.0, 0.0))[0] < 0.0:
        status, mode = SEPARATED_1, Mode(0, KINETIC, -1, place)
    elif holds_in_band(scene.law) and abs(v) <= stiction_band(scene.law):
        mode = mode_at_rest(scene, place, t, x)
    elif v == 0.0:
        pull = stuck_pull(scene, x, v, drives.turn(scene.drive, t))
        mode = Mode(1 if pull >= 0.0 else -1, region_at(scene.law, 0.0), SLOW, place)
    return status, mode


@inlined
def mode_at_rest(scene, place, t, x):
    """Mode of a set-valued law at a sliding velocity of zero or within the dead band; `place` as in a mode."""
    forcing = drives.turn(scene.drive, t)
    scene, pull = belt.laden(scene.drive, scene, forcing), stuck_pull(scene, x, 0.0, forcing)
    bound = breakaway_force(scene, direction(scene.mu_s, pull, scene, t, x, forcing), x)
    least = rounding_of_reserve(scene, (x, force_in(scene.drive, forcing), forcing[1]), forcing[2])
    if bound == 0.0 and pull == 0.0:
        # Rates decide: a load that only begins to grow holds a pull that grows more slowly.
        (pull, load), least = stuck_rates(scene, t, x, forcing), 0.0
        bound = along(scene.mu_s, pull) * load
    if bound > 0.0 and abs(pull) <= bound + least:
        return Mode(0, KINETIC, -1, place)
    return _loose(scene, place, 1 if pull >= 0.0 else -1)


@inlined
def _loose(scene, place, sign):
    """Mode of a body that has just broken loose."""
    # Without a dead band the sliding velocity, which is zero here, is a guard.
    return Mode(sign, region_at(scene.law, 0.0), SLOW if stiction_band(scene.law) == 0.0 else -1, place)


@modes.switch.implements(belt.Belt)
def _switch_on_belt(scene, mode, guard, t, y):
    """Implement :func:`modes.switch`; `guard` is NORMAL, SLOW or FAST, or an edge."""
    x, _ = y
    if guard == NORMAL:
        return SEPARATED_1, mode, y
    sign, region, place = mode.sign, mode.region, mode.place
    if guard > FAST:
        place = _beyond(scene.surface, place, 1 if guard == EDGE_ABOVE else -1)
        scene = in_segment(scene.surface, scene, place)
        if holds_in_band(scene.law) and y[1] == 0.0:
            return RUNNING, mode_at_rest(scene, place, t, x), y
        return RUNNING, Mode(sign, region, SLOW if y[1] == 0.0 else -1, place), y
    scene = in_segment(scene.surface, scene, place)
    if sign == 0:
        # A long series may reach the breakaway force by its own error alone: one more, short step decides.
        forcing = drives.turn(scene.drive, t)
        pull, laden = stuck_pull(scene, x, 0.0, forcing), belt.laden(scene.drive, scene, forcing)
        if mode.entry_guard != guard and abs(pull) <= breakaway_force(laden, pull, x):
            return RUNNING, Mode(0, KINETIC, guard, place), y
        return RUNNING, _loose(scene, place, 1 if guard == SLOW else -1), y
    low, high = region_bounds(scene.law, region)
    if guard == FAST:
        return RUNNING, Mode(sign, region + 1, SLOW, place), (x, sign * high)
    if low > 0.0:
        if holds_in_band(scene.law) and region - 1 < 0:
            return RUNNING, mode_at_rest(scene, place, t, x), (x, sign * low)
        return RUNNING, Mode(sign, region - 1, FAST, place), (x, sign * low)
    if holds_in_band(scene.law) and region < 0:
        # The pull has fallen to the breakaway force.
        return RUNNING, Mode(0, KINETIC, -1, place), y
    if region < 0:
        return RUNNING, Mode(-sign, region, SLOW, place), (x, 0.0)
    return RUNNING, mode_at_rest(scene, place, t, x), (x, 0.0)


@feature("place")
def _beyond(surface, place, direction):
    """Place of a body that has crossed the edge of its segment."""
    return zones.cross_edge(surface, place, direction)


@feature("0.0", of=ring.having(belt.OnBelt, "cubic"))
def _cube_term(body, c, k):
    """Coefficient `k` of the third power of the displacement, from those up to `k` of the displacement.

    It is stored, with that of the square; the coefficients before must have been. 0 for a linear spring.
    """
    square = cube = 0.0
    for j in range(k + 1):
        square += c[X, j] * c[X, k - j]
    c[SQUARE, k] = square
    for j in range(k + 1):
        cube += c[X, j] * c[SQUARE, k - j]
    c[CUBE, k] = cube
    return cube


@feature("normal", of=ring.having(belt.OnBelt, "load"))
def _with_load_term(body, c, k, normal):
    """Coefficient `k` of the reaction, from that without the varying part of the load; `body` carries its value."""
    return normal if k == 0 else normal + c[LOAD, k]


@feature("scene", of=Laden)
def _laden_after(drive, scene, c, s):
    """Scene whose body carries the load a time `s` after the beginning of the series."""
    return belt.with_load(scene, value(c[LOAD], s))


@feature("K * load", of={*ring.having(belt.OnBelt, "normal_stiffness"), *ring.having(belt.OnBelt, "load")})
def _friction_term(body, c, k, K, load):
    """Coefficient `k` of friction, N, from K, that of the friction per load; `load` is the reaction if it is constant.

    It fills the rows RATIO and NORMAL, so it is called for each `k` in order.
    """
    c[RATIO, k] = K
    normal = ring.held(body, 1.0 if k == 0 else 0.0, (c[X, k], 0.0, 0.0), 0.0, 0.0, 0.0)[0]
    c[NORMAL, k] = _with_load_term(body, c, k, normal)
    friction = 0.0
    for j in range(k + 1):
        friction += c[RATIO, j] * c[NORMAL, k - j]
    return friction


@series.fill_table.implements(belt.Belt)
def _fill_table_on_belt(scene, mode, t, y, tolerance, c):
    """Implement :func:`series.fill_table`: fill all rows of the table, in stick, in a dead band, or in slip."""
    drives.expand_at(scene.drive, t, ORDER + 2, c[SHIFT], c[FACTORS:])
    expand_load(scene.drive, t, ORDER, c[LOAD], c[FACTORS:])
    scene = _laden_after(scene.drive, in_segment(scene.surface, scene, mode.place), c, 0.0)
    body = scene.body
    if if_force(body, True, False):
        expand_force(scene.drive, t, ORDER, c[PUSH], c[FACTORS:])
    c[X, 0], c[V, 0] = y
    c[VELOCITY, 0] = y[1] + c[SHIFT, 1]
    sharpness, yielding = 0.0, holds_in_band(scene.law) and mode.region < 0
    if mode.sign == 0 or yielding:
        for k in range(ORDER + 1):
            # The body moves as the belt does. In a dead band V is the momentum that is left, or builds up, by mass.
            one = 1.0 if k == 0 else 0.0
            c[VELOCITY, k] = (k + 1.0) * c[SHIFT, k + 1]
            c[ACCELERATION, k] = (k + 1.0) * (k + 2.0) * c[SHIFT, k + 2]
            if k > 0:
                c[X, k] = c[SHIFT, k]
            motion, cube = (c[X, k], c[PUSH, k], c[VELOCITY, k]), _cube_term(body, c, k)
            normal, _, friction = ring.held(body, one, motion, cube, c[ACCELERATION, k], 0.0)
            c[NORMAL, k] = _with_load_term(body, c, k, normal)
            pull, ahead, back = -friction, along(scene.mu_s, 1.0) * c[NORMAL, k], along(scene.mu_s, -1.0) * c[NORMAL, k]
            if mode.sign == 0:
                c[V, k], c[FORCE, k], c[SLOW, k], c[FAST, k] = y[1] * one, pull, ahead - pull, back + pull
            else:
                bound = ahead if mode.sign > 0 else back
                c[FORCE, k], c[SLOW, k] = mode.sign * bound, mode.sign * pull - bound
                c[FAST, k] = region_bounds(scene.law, mode.region)[1] * one - mode.sign * c[V, k]
                if k < ORDER:
                    c[V, k + 1] = (pull - mode.sign * bound) * INVERSE[k + 1] / body.mass
        if mode.sign == 0:
            # A pull that reaches the breakaway force but for rounding only touches it. One that exceeds it by more
            # accelerates the body, whatever friction is in slip: no event follows another one at the same time.
            least = rounding_of_reserve(scene, (c[X, 0], c[PUSH, 0], c[VELOCITY, 0]), c[ACCELERATION, 0])
            c[SLOW, 0] += least
            c[FAST, 0] += least
    else:
        sharpness = expand_slip(scene, mode, if_force(body, scene.viscous, 0.0), c, False)
        expand_bounds(c, (V, SLOW, FAST), mode, region_bounds(scene.law, mode.region), 0.0)
        if _has_dead_band(scene) and mode.entry_guard == SLOW:
            # A body whose momentum is that of the edge leaves the band as the pull reaches the breakaway force.
            size = (abs(c[FORCE, 0]) + ring.size(body, (c[X, 0], c[PUSH, 0], c[VELOCITY, 0]))) / body.mass
            if abs(c[V, 1]) <= 1e-12 * size:
                c[SLOW, 1] = 0.0
    if ring.if_load_varies(body, c[NORMAL, 0] == 0.0, False):
        _from_no_load(c, mode.sign == 0)
    _expand_edges(scene.surface, mode, c)
    # The unit of length is the distance that belt, body or load could move within a natural period of the spring.
    velocity = abs(c[VELOCITY, 0]) + abs(c[SHIFT, 1])
    length = abs(c[X, 0]) + length_scale(scene, velocity)
    speed = speed_scale(scene, length, velocity)
    speed = speed if holds_in_band(scene.law) else speed_in(scene, mode, speed)
    per_force = 0.0
    if mode.sign == 0 or yielding:
        # The guards are forces, whose series may converge more slowly than that of the motion.
        motion = length, largest_force(scene.drive), c[VELOCITY, 0]
        scale = abs(breakaway_force(scene, 0.0, c[X, 0])) + ring.size(body, motion) + 1e-300
        per_force = 1.0 / (scale * tolerance)
    units = (X, 1.0 / (length * tolerance)), (V, 1.0 / (speed * tolerance)), (SLOW, per_force)
    h = step_within(c, units)
    return (h if mode.sign == 0 else shorten_for_decay(sharpness, c[V], h)), h


@feature("None")
def _expand_edges(surface, mode, c):
    """Fill the guards of both edges of a segment.

    The body may be on an edge. It leaves it to the side to which it moves: there the zero at the beginning is no event.
    """
    for row, side in ((EDGE_ABOVE, 1), (EDGE_BELOW, -1)):
        c[row, 0] = zones.distance_to_edge(surface, mode.place, side, c[X, 0], c[SHIFT, 0])
        zeros = 0 if c[row, 0] != 0.0 else 1
        for k in range(1, ORDER + 1):
            c[row, k] = -side * zones.place_in(surface.frame, c[X, k], c[SHIFT, k])
            if zeros == k and c[row, k] == 0.0:
                zeros += 1
        if zeros > ORDER or (mode.sign == 0 and not zones.carries(surface.frame)):
            # Where the body rests among the zones there is no crossing.
            c[row, 0], zeros = 1.0, 0
        for k in range(ORDER + 1 if zeros > 0 else 0):
            c[row, k] = c[row, k + zeros] if k + zeros <= ORDER else 0.0


@inlined
def _has_dead_band(scene):
    """Whether a set-valued law holds the body at all sliding speeds below a positive bound, as Karnopp's does."""
    return holds_in_band(scene.law) and stiction_band(scene.law) > 0.0


@inlined
def _from_no_load(c, sticks):
    """Divide guards that are zero at launch by a power of the time: the load has yet to grow, or never does."""
    for row, begins in ((NORMAL, True), (SLOW, sticks), (FAST, sticks)):
        zeros = 0
        while begins and zeros < ORDER and c[row, zeros] == 0.0:
            zeros += 1
        if zeros < ORDER:
            for k in range(ORDER + 1):
                c[row, k] = c[row, k + zeros] if k + zeros <= ORDER else 0.0


@inlined
def expand_slip(scene, mode, viscous, c, held):
    """Fill the series of slip and return the sharpness of the friction law.

    If the body is `held` at rest, the acceleration is that which the hold prevents.

    Each coefficient is computed from numbers that are still in registers; the table only keeps it.
    """
    body, sign = scene.body, float(mode.sign)
    surfaces = coefficients(scene, sign)
    x, velocity, v = c[X, 0], c[VELOCITY, 0], c[V, 0]
    (mu,), begun, sharpness = begin_series(scene.law, mode.region, sign * v, surfaces)
    load, _ = ring.reactions(body, 0.0, 0.0, (x, 0.0, velocity))
    friction = _friction_term(body, c, 0, -sign * mu, load)
    force = if_force(body, friction + c[PUSH, 0] - viscous * v, friction)
    acceleration = ring.driven(body, 1.0, (x, 0.0, velocity), _cube_term(body, c, 0), force, force)
    c[FORCE, 0], c[ACCELERATION, 0] = if_force(body, viscous * v - friction, -friction), acceleration
    of_law = no_products(scene.law, surfaces)
    first = newest = no_factors(of_law)
    for k in range(1, ORDER + 1):
        x, velocity = velocity * INVERSE[k], 0.0 if held else acceleration * INVERSE[k]
        v = velocity - (k + 1.0) * c[SHIFT, k + 1]
        c[X, k] = x
        inner = part_from(inner_products(c, FACTORS, k, first, newest), of_law, ())
        (mu,), left, right = series_term(scene.law, mode.region, k, sign * v, inner, begun, surfaces)
        newest = set_factors(c, FACTORS, k, left, right)
        first = newest if k == 1 else first
        friction = _friction_term(body, c, k, -sign * mu, load)
        force = if_force(body, friction + c[PUSH, k] - viscous * v, friction)
        acceleration = ring.driven(body, 0.0, (x, 0.0, velocity), _cube_term(body, c, k), force, force)
        c[VELOCITY, k], c[V, k] = velocity, v
        c[FORCE, k], c[ACCELERATION, k] = if_force(body, viscous * v - friction, -friction), acceleration
    return sharpness


@series.seen_at_start.implements(belt.Belt)
def _seen_at_start_on_belt(scene, c):
    """Implement :func:`series.seen_at_start`: what ``_observe_on_belt`` in :mod:`record` takes."""
    acceleration = located(scene, c[X, 0], c[ACCELERATION, 0])
    v = _seen_sliding(scene, c[V, 0], c[VELOCITY, 0] - c[SHIFT, 1])
    return c[X, 0], c[VELOCITY, 0], c[FORCE, 0], c[X, 0] - c[SHIFT, 0], v, c[V, 1], acceleration, nan


@inlined
def _seen_sliding(scene, v, difference):
    """Sliding velocity for the recorder, m/s: in a law with a dead band v is a momentum, so `difference` counts."""
    return difference if _has_dead_band(scene) else v


@series.seen_at.implements(belt.Belt)
def _seen_at_on_belt(scene, mode, c, s, h):
    """Implement :func:`series.seen_at`: what ``_observe_on_belt`` in :mod:`record` takes."""
    scene, velocity = in_segment(scene.surface, scene, mode.place), value(c[VELOCITY], s)
    if abs(velocity) <= 1e-15 * (abs(c[VELOCITY, 0]) + variation(c[VELOCITY], h)):
        # A velocity within rounding is zero, so that an extreme of the displacement is recognised.
        velocity = 0.0
    x, v, force, acceleration = value(c[X], s), value(c[V], s), value(c[FORCE], s), value(c[ACCELERATION], s)
    yielding = holds_in_band(scene.law) and mode.region < 0
    if mode.sign != 0 and not yielding:
        # Where the law bends, the series of friction is less exact than that of the motion.
        sign, body = float(mode.sign), _laden_after(scene.drive, scene, c, s).body
        mu, _ = friction_in(scene.law, mode.region, sign * v, coefficients(scene, sign))
        load, _ = ring.reactions(body, 0.0, 0.0, (x, 0.0, velocity))
        before, force = force, sign * mu * load + if_force(body, scene.viscous, 0.0) * v
        acceleration += (before - force) / body.mass
    v = _seen_sliding(scene, v, value(c[VELOCITY], s) - slope(c[SHIFT], s))
    return x, velocity, force, x - value(c[SHIFT], s), v, slope(c[V], s), located(scene, x, acceleration), nan


@series.extremes.implements(belt.Belt)
def _extremes_on_belt(scene, record, mode, c, h, work):
    """Implement :func:`series.extremes`: of displacement, velocity and friction; and the ends of cycles."""
    # Look for an extreme only if it could exceed the recorded one.
    count, change = 0, variation(c[VELOCITY], h)
    if abs(c[VELOCITY, 0]) <= change:
        count = crossings(c[VELOCITY], h, work, count)
    if c[VELOCITY, 0] + change > record.velocity_max:
        count = crossings(c[ACCELERATION], h, work, count)
    if abs(c[FORCE, 0]) + variation(c[FORCE], h) > record.force_max:
        differentiate(c[FORCE], c[RATIO])
        count = crossings(c[RATIO], h, work, count)
    # The forcing may end its next period; after the middle of the span it may end its first.
    due, t = record.cycles.next, record.last.t
    for rest in (due - t, scene.cycle - t if due < scene.cycle else 0.0):
        if 0.0 < rest < h:
            work[0][count] = rest
            count += 1
    return count
