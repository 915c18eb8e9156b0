"""The belt as a piecewise-smooth system: modes, guards and their power series.

The state is ``(x, v)`` with the displacement in space and the sliding velocity. The difference of two large velocities
would lose all its digits.
"""

from __future__ import annotations

from typing import NamedTuple

from ringsweep.compile import hook, inlined
from ringsweep.models.belt.force import (
    breakaway_force,
    has_loads,
    holds_in_band,
    length_scale,
    located,
    speed_scale,
    stuck_pull,
    stuck_pull_rate,
    with_loads,
    with_sizes,
)
from ringsweep.models.belt.record import due_within
from ringsweep.models.interface import modes, series
from ringsweep.models.interface.status import RUNNING
from ringsweep.numerics.series import INVERSE, ORDER, crossings, slope, step_size, value, variation
from ringsweep.numerics.terms import (
    FACTOR_ROWS,
    MOST_GROUPS,
    inner_products,
    no_factors,
    part_from,
    set_factors,
    set_terms,
    terms,
)
from ringsweep.physics import belt, drives
from ringsweep.physics.forces import expand_force, largest_force
from ringsweep.physics.friction.velocity import (
    KINETIC,
    begin_series,
    no_products,
    region_at,
    region_bounds,
    series_term,
    shorten_for_decay,
    stiction_band,
)

# Rows of the table of series; the guards are last.
X, V, VELOCITY, FORCE, SHIFT, SPARE, PUSH, SQUARE, CUBE, FACTORS = range(10)
SLOW = FACTORS + MOST_GROUPS * FACTOR_ROWS
FAST = SLOW + 1


# A pull that differs by less than this share from the breakaway force is equal to it.
_ON_BOUND = 1e-12

# A pull whose rate is less than this share of the breakaway force times the frequency is at its extreme: until then it
# grows by less than the share above.
_LEVEL = 1e-6


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


@modes.initial_mode.implements(belt.Belt)
def _initial_mode(scene, t, y):
    x, v = y
    if holds_in_band(scene.law) and abs(v) <= stiction_band(scene.law):
        return RUNNING, _mode_at_rest(scene, t, x, v)
    if v == 0.0:
        pull = stuck_pull(scene, x, v, drives.turn(scene.drive, t))
        return RUNNING, Mode(1 if pull >= 0.0 else -1, region_at(scene.law, 0.0), SLOW)
    return RUNNING, Mode(1 if v > 0.0 else -1, region_at(scene.law, abs(v)), -1)


@inlined
def _mode_at_rest(scene, t, x, v):
    """Mode of a set-valued law at a sliding velocity of zero or within the dead band."""
    forcing = drives.turn(scene.drive, t)
    pull = stuck_pull(scene, x, v, forcing)
    bound = breakaway_force(scene)
    if bound > 0.0:
        if abs(pull) <= bound * (1.0 - _ON_BOUND):
            return Mode(0, KINETIC, -1)
        if abs(pull) <= bound * (1.0 + _ON_BOUND):
            # The pull only touches the breakaway force unless it still grows.
            forward = pull > 0.0
            rate = stuck_pull_rate(scene, t, x, forcing)
            per_period = max(1.0 / scene.forcing_period, (scene.stiffness / scene.mass) ** 0.5)
            if (rate if forward else -rate) <= _LEVEL * bound * per_period:
                return Mode(0, KINETIC, SLOW if forward else FAST)
    if pull == 0.0:
        # The rate of the pull decides, while the belt carries the body along.
        pull = stuck_pull_rate(scene, t, x, forcing)
    # Without a dead band the sliding velocity, which is zero here, is a guard.
    entry_guard = SLOW if stiction_band(scene.law) == 0.0 else -1
    return Mode(1 if pull >= 0.0 else -1, region_at(scene.law, 0.0), entry_guard)


@modes.switch.implements(belt.Belt)
def _switch(scene, mode, guard, t, y):
    x, _ = y
    sign, region = mode.sign, mode.region
    if sign == 0:
        held = _mode_at_rest(scene, t, x, y[1])
        # A pull that does not only touch the breakaway force reaches it twice at the same time.
        if held.sign == 0 and mode.entry_guard != guard:
            return RUNNING, held, y
        return RUNNING, Mode(1 if guard == SLOW else -1, region_at(scene.law, 0.0), SLOW), y
    low, high = region_bounds(scene.law, region)
    if guard == FAST:
        return RUNNING, Mode(sign, region + 1, SLOW), (x, sign * high)
    if low > 0.0:
        if holds_in_band(scene.law) and region - 1 < 0:
            return RUNNING, _mode_at_rest(scene, t, x, sign * low), (x, sign * low)
        return RUNNING, Mode(sign, region - 1, FAST), (x, sign * low)
    if holds_in_band(scene.law) and region < 0:
        # The pull has fallen to the breakaway force.
        return RUNNING, Mode(0, KINETIC, SLOW if sign > 0 else FAST), y
    if region < 0:
        return RUNNING, Mode(-sign, region, SLOW), (x, 0.0)
    return RUNNING, _mode_at_rest(scene, t, x, 0.0), (x, 0.0)


@hook(optional=True)
def cube_term(cubic, c, k):
    """Coefficient `k` of the third power of the displacement, from those up to `k` of the displacement.

    It is stored, with that of the square; the coefficients before must have been. 0 for a linear spring.
    """
    return 0.0


@cube_term.implements(belt.Cubic)
def _cube_term(cubic, c, k):
    square = cube = 0.0
    for j in range(k + 1):
        square += c[X, j] * c[X, k - j]
    c[SQUARE, k] = square
    for j in range(k + 1):
        cube += c[X, j] * c[SQUARE, k - j]
    c[CUBE, k] = cube
    return cube


@series.expand.implements(belt.Belt)
def _expand(scene, mode, t, y, tolerance, c):
    drives.expand(scene.drive, t, ORDER + 2, c[SHIFT], c[FACTORS:])
    expand_force(scene.drive, t, ORDER, c[PUSH], c[FACTORS:])
    load = scene.mass * scene.gravity
    stiffness_per_mass = scene.stiffness / scene.mass
    c[X, 0], c[V, 0] = y
    c[VELOCITY, 0] = y[1] + c[SHIFT, 1]
    sharpness = 0.0
    if mode.sign == 0:
        bound = breakaway_force(scene)
        for k in range(ORDER + 1):
            # The sliding velocity is constant: zero, or that on entry into the dead band.
            v_k = y[1] if k == 0 else 0.0
            c[V, k] = v_k
            c[VELOCITY, k] = (k + 1.0) * c[SHIFT, k + 1] + v_k
            if k > 0:
                c[X, k] = c[SHIFT, k] + (y[1] if k == 1 else 0.0)
            cube = cube_term(scene.cubic, c, k)
            pull = -scene.stiffness * c[X, k] - scene.mass * (k + 1.0) * (k + 2.0) * c[SHIFT, k + 2]
            c[FORCE, k] = with_loads(scene, pull, 1.0, c[VELOCITY, k], cube, c[PUSH, k])
            c[SLOW, k], c[FAST, k] = -c[FORCE, k], c[FORCE, k]
        c[SLOW, 0] = 0.0 if mode.entry_guard == SLOW else c[SLOW, 0] + bound
        c[FAST, 0] = 0.0 if mode.entry_guard == FAST else c[FAST, 0] + bound
        # A pull that only touches the breakaway force is at its extreme.
        level = _LEVEL * bound * max(1.0 / scene.forcing_period, stiffness_per_mass**0.5)
        if mode.entry_guard in (SLOW, FAST) and abs(c[mode.entry_guard, 1]) <= level:
            c[mode.entry_guard, 1] = 0.0
    else:
        sign, surfaces = float(mode.sign), (scene.mu_s, scene.mu_k)
        low, high = region_bounds(scene.law, mode.region)
        yielding = holds_in_band(scene.law) and mode.region < 0
        viscous = 0.0 if yielding else scene.viscous
        (mu,), begun, sharpness = begin_series(scene.law, mode.region, sign * c[V, 0], surfaces)
        force = sign * load * mu + viscous * c[V, 0]
        c[FORCE, 0], place, velocity = force, c[X, 0], c[VELOCITY, 0]
        of_law = no_products(scene.law, surfaces)
        first = newest = no_factors(of_law)
        for k in range(1, ORDER + 1):
            cube, per_mass = cube_term(scene.cubic, c, k - 1), 1.0 / scene.mass
            acceleration = -(stiffness_per_mass * place + force * per_mass)
            acceleration = with_loads(scene, acceleration, per_mass, velocity, cube, c[PUSH, k - 1])
            place, velocity = velocity * INVERSE[k], acceleration * INVERSE[k]
            v = velocity - (k + 1.0) * c[SHIFT, k + 1]
            x = sign * v
            inner = part_from(inner_products(c, FACTORS, k, first, newest), of_law, ())
            (mu,), left, right = series_term(scene.law, mode.region, k, x, inner, begun, surfaces)
            force = sign * load * mu + viscous * v
            newest = set_factors(c, FACTORS, k, left, right)
            first = newest if k == 1 else first
            c[X, k], c[VELOCITY, k], c[V, k], c[FORCE, k] = place, velocity, v, force
        set_terms(c[SLOW], terms(c[V]) * sign)
        set_terms(c[FAST], terms(c[V]) * -sign)
        excess = sign * c[V, 0] - low
        if yielding:
            # With a dead band the velocity of the belt is constant.
            cube_term(scene.cubic, c, ORDER)
            pull = terms(c[X]) * (-sign * scene.stiffness)
            pull = with_loads(scene, pull, sign, terms(c[VELOCITY]), terms(c[CUBE]), terms(c[PUSH]))
            set_terms(c[SLOW], pull)
            excess = -sign * scene.stiffness * c[X, 0] - breakaway_force(scene)
            excess = with_loads(scene, excess, sign, c[VELOCITY, 0], c[CUBE, 0], c[PUSH, 0])
        c[SLOW, 0] = 0.0 if mode.entry_guard == SLOW else excess
        c[FAST, 0] = 0.0 if mode.entry_guard == FAST else high - mode.sign * c[V, 0]
        # If friction does not drop at breakaway, the slope is zero there: what is computed is rounding.
        size = stiffness_per_mass * abs(c[X, 0]) + abs(c[FORCE, 0]) / scene.mass
        size = with_sizes(scene, size, 1.0 / scene.mass, c[VELOCITY, 0], c[CUBE, 0], c[PUSH, 0])
        if mode.entry_guard == SLOW and low == 0.0 and not yielding and abs(c[V, 1]) <= 1e-12 * size:
            c[SLOW, 1] = 0.0
    # The unit of length is the distance that belt, body or load could move within a natural period of the spring.
    length = abs(c[X, 0]) + length_scale(scene, abs(c[VELOCITY, 0]) + abs(c[SHIFT, 1]))
    speed = speed_scale(scene, length)
    if mode.region < 0 and not holds_in_band(scene.law):
        # An error as large as the stiction band would keep the creep from becoming steady.
        speed = min(speed, 1e3 * stiction_band(scene.law))
    last = max(abs(c[X, ORDER]) / length, abs(c[V, ORDER]) / speed)
    previous = max(abs(c[X, ORDER - 1]) / length, abs(c[V, ORDER - 1]) / speed)
    if has_loads(scene) and (mode.sign == 0 or (holds_in_band(scene.law) and mode.region < 0)):
        # The guards are forces, whose series may converge more slowly than that of the motion.
        scale = breakaway_force(scene) + scene.stiffness * length + 1e-300
        cube, push = length * length * length, largest_force(scene.drive)
        scale = with_sizes(scene, scale, 1.0, c[VELOCITY, 0], cube, push)
        last = max(last, abs(c[SLOW, ORDER]) / scale)
        previous = max(previous, abs(c[SLOW, ORDER - 1]) / scale)
    h = step_size(last / tolerance, previous / tolerance)
    return h if mode.sign == 0 else shorten_for_decay(sharpness, c[V], h)


@series.state_at.implements(belt.Belt)
def _state_at(scene, c, s):
    return value(c[X], s), value(c[V], s)


@series.rates_at.implements(belt.Belt)
def _rates_at(scene, c, s):
    return slope(c[X], s), slope(c[V], s)


@series.seen_at_start.implements(belt.Belt)
def _seen_at_start(scene, c):
    acceleration = located(scene, c[X, 0], c[VELOCITY, 1])
    return c[X, 0], c[VELOCITY, 0], c[FORCE, 0], c[X, 0] - c[SHIFT, 0], c[V, 0], c[V, 1], acceleration


@series.seen_at.implements(belt.Belt)
def _seen_at(scene, c, s, h):
    velocity = value(c[VELOCITY], s)
    if abs(velocity) <= 1e-15 * (abs(c[VELOCITY, 0]) + variation(c[VELOCITY], h)):
        # A velocity within rounding is zero, so that an extreme of the displacement is recognised.
        velocity = 0.0
    x = value(c[X], s)
    acceleration = located(scene, x, slope(c[VELOCITY], s))
    return x, velocity, value(c[FORCE], s), x - value(c[SHIFT], s), value(c[V], s), slope(c[V], s), acceleration


@series.extremes.implements(belt.Belt)
def _extremes(scene, record, mode, c, h, work):
    count = 0
    if abs(c[VELOCITY, 0]) <= variation(c[VELOCITY], h):
        count = crossings(c[VELOCITY], h, work, count)
    if mode.sign != 0:
        # The velocity has an extreme where the net force vanishes.
        cube_term(scene.cubic, c, ORDER)
        net = scene.stiffness * c[X, 0] + c[FORCE, 0]
        c[SPARE, 0] = with_loads(scene, net, -1.0, c[VELOCITY, 0], c[CUBE, 0], c[PUSH, 0])
        net = terms(c[X]) * scene.stiffness + terms(c[FORCE])
        set_terms(c[SPARE], with_loads(scene, net, -1.0, terms(c[VELOCITY]), terms(c[CUBE]), terms(c[PUSH])))
        count = crossings(c[SPARE], h, work, count)
    elif c[VELOCITY, 0] + variation(c[VELOCITY], h) > record.velocity_max:
        # In stick the belt decides where the velocity has an extreme.
        for k in range(ORDER):
            c[SPARE, k] = (k + 1.0) * c[VELOCITY, k + 1]
        c[SPARE, ORDER] = 0.0
        count = crossings(c[SPARE], h, work, count)
    rest = due_within(scene, record, h)
    if rest > 0.0:
        work[0][count] = rest
        count += 1
    return count


@series.row.implements(belt.Belt)
def _row(scene, mode, c, t, s):
    mode_now = 0.0 if mode.region < 0 else float(mode.sign)
    return value(c[X], s), value(c[VELOCITY], s), value(c[FORCE], s), 0.0, mode_now


@modes.in_space.implements(belt.Belt, belt.BristleBelt)
def _in_space(scene, t, y):
    return y[0], y[1] + drives.turn(scene.drive, t)[1]
