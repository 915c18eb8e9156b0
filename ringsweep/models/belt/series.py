"""The belt as a piecewise-smooth system: modes, guards and their power series.

The state is ``(x, v)`` with the displacement in space and the sliding velocity. The difference of two large velocities
would lose all its digits.

Read :mod:`ringsweep.models.interface.series` first. `c` is the table of series; ``c[ROW, k]`` is coefficient k, with
the rows that are named below. In a kernel the order of statements counts: each coefficient needs those before it.
"""

from __future__ import annotations

from math import nan

from ringsweep.compile import feature, inlined
from ringsweep.models.belt.force import (
    breakaway_force,
    coefficients,
    if_force,
    in_segment,
    length_scale,
    located,
    rounding_of_load,
    rounding_of_reserve,
    speed_scale,
)
from ringsweep.models.belt.mode import (
    ACCELERATION,
    CUBE,
    EDGE_ABOVE,
    EDGE_BELOW,
    FACTORS,
    FAST,
    FORCE,
    LOAD,
    NORMAL,
    PUSH,
    RATIO,
    SHIFT,
    SLOW,
    SQUARE,
    VELOCITY,
    V,
    X,
    low_stop,
    rows_with_stops,
    yields,
)
from ringsweep.models.belt.stops import expand_stops, rests_at
from ringsweep.models.interface import series
from ringsweep.models.sliding import expand_bounds, speed_in
from ringsweep.numerics.series import (
    INVERSE,
    ORDER,
    crossings,
    differentiate,
    divide_by_time,
    slope,
    step_within,
    value,
    variation,
)
from ringsweep.numerics.terms import (
    inner_products,
    no_factors,
    part_from,
    set_factors,
)
from ringsweep.physics import belt, drives, ring, zones
from ringsweep.physics.forces import Laden, expand_force, expand_load, largest_force
from ringsweep.physics.friction.registry import holds_in_band
from ringsweep.physics.friction.velocity import (
    begin_series,
    friction_in,
    no_products,
    region_bounds,
    series_term,
    shorten_for_decay,
    stiction_band,
)
from ringsweep.physics.friction.ways import along


@series.table_shape.implements(belt.Belt, belt.BristleBelt)
def _table_shape_on_belt(scene):
    """Implement :func:`series.table_shape`; the reaction is a guard if it varies, edges and stops if there are any."""
    return rows_with_stops(scene.stops, low_stop(scene.surface)), ring.if_load_varies(scene.body, NORMAL, SLOW)


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
    least_load = rounding_of_load(scene, y[0])
    scene = _laden_after(scene.drive, in_segment(scene.surface, scene, mode.place), c, 0.0)
    body = scene.body
    if if_force(body, True, False):
        expand_force(scene.drive, t, ORDER, c[PUSH], c[FACTORS:])
    held = rests_at(mode.stop)
    c[X, 0], c[V, 0] = y[0], -c[SHIFT, 1] if held else y[1]
    c[VELOCITY, 0] = c[V, 0] + c[SHIFT, 1]
    sharpness, yielding = 0.0, yields(scene, mode)
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
        sharpness = _expand_slip(scene, mode, if_force(body, scene.viscous, 0.0), c, held)
        expand_bounds(c, (V, SLOW, FAST), mode, region_bounds(scene.law, mode.region), 0.0)
        if _has_dead_band(scene) and mode.entry_guard == SLOW:
            # A body whose momentum is that of the edge leaves the band as the pull reaches the breakaway force.
            size = (abs(c[FORCE, 0]) + ring.size(body, (c[X, 0], c[PUSH, 0], c[VELOCITY, 0]))) / body.mass
            if abs(c[V, 1]) <= 1e-12 * size:
                c[SLOW, 1] = 0.0
    if ring.if_load_varies(body, True, False):
        _guard_load(c, least_load, mode.sign == 0)
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
    h = expand_stops(scene.stops, scene, mode, tolerance, c, h)
    return (h if mode.sign == 0 else shorten_for_decay(sharpness, c[V], h)), h


@feature("None")
def _expand_edges(surface, mode, c):
    """Fill the guards of both edges of a segment.

    The body may be on an edge. It leaves it to the side to which it moves: there the zero at the beginning is no event.
    """
    for row, side in ((EDGE_ABOVE, 1), (EDGE_BELOW, -1)):
        c[row, 0] = zones.distance_to_edge(surface, mode.place, side, c[X, 0], c[SHIFT, 0])
        for k in range(1, ORDER + 1):
            c[row, k] = -side * zones.place_in(surface.frame, c[X, k], c[SHIFT, k])
        if divide_by_time(c[row], 0) > ORDER or (mode.sign == 0 and not zones.carries(surface.frame)):
            # Where the body rests among the zones there is no crossing.
            c[row, 0] = 1.0


@inlined
def _has_dead_band(scene):
    """Whether a set-valued law holds the body at all sliding speeds below a positive bound, as Karnopp's does."""
    return holds_in_band(scene.law) and stiction_band(scene.law) > 0.0


@inlined
def _guard_load(c, least, sticks):
    """Make the normal reaction a guard: it may touch zero, but not stay there. It may have yet to grow, at launch."""
    if c[NORMAL, 0] == 0.0:
        for row in (NORMAL, SLOW, FAST):
            if (row == NORMAL and least == 0.0) or (row != NORMAL and sticks):
                divide_by_time(c[row], 0)
    stays = c[NORMAL, 0] <= least
    for k in range(1, ORDER + 1):
        stays = stays and c[NORMAL, k] == 0.0
    c[NORMAL, 0] = -1.0 if stays else c[NORMAL, 0] + least


@inlined
def _expand_slip(scene, mode, viscous, c, held):
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
    yielding = yields(scene, mode)
    if mode.sign != 0 and not yielding:
        # Where the law bends, the series of friction is less exact than that of the motion.
        sign, body = float(mode.sign), _laden_after(scene.drive, scene, c, s).body
        mu, _ = friction_in(scene.law, mode.region, sign * v, coefficients(scene, sign))
        load, _ = ring.reactions(body, 0.0, 0.0, (x, 0.0, velocity))
        before, force = force, sign * mu * load + if_force(body, scene.viscous, 0.0) * v
        acceleration += (before - force) / body.mass
    v = _seen_sliding(scene, v, value(c[VELOCITY], s) - slope(c[SHIFT], s))
    return x, velocity, force, x - value(c[SHIFT], s), v, slope(c[V], s), located(scene, x, acceleration), nan


@inlined
def look_for_extremes(scene, record, c, h, work, count):
    """Append the instants at which the record of a body on a belt must look; see :func:`series.extremes`.

    They are the extremes of displacement, velocity and friction, and the ends of cycles.
    """
    # Look for an extreme only if it could exceed the recorded one.
    velocity, force, change = c[VELOCITY], c[FORCE], variation(c[VELOCITY], h)
    if abs(velocity[0]) <= change:
        count = crossings(velocity, h, work, count)
    if velocity[0] + change > record.velocity_max:
        count = crossings(c[ACCELERATION], h, work, count)
    if abs(force[0]) + variation(force, h) > record.force_max:
        differentiate(force, c[RATIO])
        count = crossings(c[RATIO], h, work, count)
    # The forcing may end its next period; after the middle of the span it may end its first.
    due, t = record.cycles.next, record.last.t
    for rest in (due - t, scene.cycle - t if due < scene.cycle else 0.0):
        if 0.0 < rest < h:
            work[0][count] = rest
            count += 1
    return count


@series.extremes.implements(belt.Belt)
def _extremes_on_belt(scene, record, mode, c, h, work):
    """Implement :func:`series.extremes`."""
    return look_for_extremes(scene, record, c, h, work, 0)
