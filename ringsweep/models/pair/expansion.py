"""Power series of two masses on a belt, and the guards of their modes.

`c` is the table of series. Each mass has OF_EACH rows in it, those of a belt, counted from its first row.
"""

from __future__ import annotations

from math import inf, nan

from ringsweep.compile import generated, inlined
from ringsweep.models.belt.force import located
from ringsweep.models.belt.mode import ACCELERATION, FACTORS, FORCE, LOAD, SHIFT, VELOCITY, V, X
from ringsweep.models.belt.series import look_for_extremes
from ringsweep.models.interface import modes, series
from ringsweep.models.pair.contact_modes import (
    HIGH,
    LOW,
    after_guard,
    forces_of,
    friction_of,
    kind_of,
    motion_of,
    scales_of,
)
from ringsweep.numerics.series import INVERSE, ORDER, divide_by_time, slope, step_within, value, variation
from ringsweep.numerics.terms import FACTOR_ROWS, MOST_GROUPS, set_terms, terms
from ringsweep.physics import drives, pair

# The load on each mass is its reaction.
NORMAL, OF_EACH = LOAD, FACTORS
# Rows that the drive needs.
WORK = 2 * OF_EACH
GUARDS = WORK + MOST_GROUPS * FACTOR_ROWS

# A guard may begin level if its rate is this share of the forces: but for rounding it is zero.
_LEVEL = 1e-12


@series.table_shape.implements(pair.BeltPair)
def _table_shape_of_pair(scene):
    """Implement :func:`series.table_shape`."""
    return GUARDS + 4, GUARDS


@generated
def _expand(body, kind, friction, c):
    """Fill the series of both masses in a kind of mode; the state and the motion of the belt are there."""
    scope = {f"expand_{kind}": _expansion(pair.solution(kind)) for kind in range(4)}
    lines = [f"if kind == {kind}:\n        expand_{kind}(body, friction, c)" for kind in range(4)]
    return [*lines, "return None"], scope


def _expansion(solved):
    """Function that fills the series in one kind of mode, from the solution of its balances."""

    @inlined
    def expand(body, friction, c):
        x_1, v_1, x_2, v_2 = c[X, 0], c[V, 0], c[OF_EACH + X, 0], c[OF_EACH + V, 0]
        for k in range(ORDER + 1):
            belt_velocity, a = (k + 1.0) * c[SHIFT, k + 1], (k + 1.0) * (k + 2.0) * c[SHIFT, k + 2]
            u_1, u_2, one = v_1 + belt_velocity, v_2 + belt_velocity, 1.0 if k == 0 else 0.0
            w, N, F = solved(body, one, friction, (x_1, u_1, x_2, u_2, a))
            c[X, k], c[V, k], c[VELOCITY, k] = x_1, v_1, u_1
            c[ACCELERATION, k], c[FORCE, k], c[NORMAL, k] = w[0] + a, 0.0 - F[0], N[0]
            c[OF_EACH + SHIFT, k] = c[SHIFT, k]
            c[OF_EACH + X, k], c[OF_EACH + V, k], c[OF_EACH + VELOCITY, k] = x_2, v_2, u_2
            c[OF_EACH + ACCELERATION, k], c[OF_EACH + FORCE, k], c[OF_EACH + NORMAL, k] = w[1] + a, 0.0 - F[1], N[1]
            rest = INVERSE[k + 1]
            x_1, v_1, x_2, v_2 = u_1 * rest, w[0] * rest, u_2 * rest, w[1] * rest

    return expand


@inlined
def _fill_guards(c, i, sign, mu_s, size, mass):
    """Fill the guards of contact `i`; `size` is that of the forces on its mass, N."""
    first, low, high = i * OF_EACH, c[GUARDS + 2 * i + LOW], c[GUARDS + 2 * i + HIGH]
    if sign == 0:
        # A pull that reaches the breakaway force but for rounding only touches it.
        least = 2.0**-50 * size
        set_terms(low, mu_s * terms(c[first + NORMAL]) - terms(c[first + FORCE]))
        set_terms(high, mu_s * terms(c[first + NORMAL]) + terms(c[first + FORCE]))
        low[0] = mu_s * c[first + NORMAL, 0] - c[first + FORCE, 0] + least
        high[0] = mu_s * c[first + NORMAL, 0] + c[first + FORCE, 0] + least
        return
    high[0] = inf
    set_terms(low, terms(c[first + V]) * float(sign))
    low[0] = sign * c[first + V, 0]
    # As it begins to slip: if friction does not drop at breakaway, the rate is zero there too.
    least = 2 if abs(low[1]) * mass <= _LEVEL * size else 1
    if low[0] == 0.0 and divide_by_time(low, least) > ORDER:
        low[0] = inf


@series.fill_table.implements(pair.BeltPair)
def _fill_table_of_pair(scene, mode, t, y, tolerance, c):
    """Implement :func:`series.fill_table`."""
    drives.expand_at(scene.drive, t, ORDER + 2, c[SHIFT], c[WORK:])
    c[X, 0], c[V, 0], c[OF_EACH + X, 0], c[OF_EACH + V, 0] = y
    _expand(scene.body, kind_of(mode.signs), friction_of(scene, mode.signs), c)
    forcing = c[SHIFT, 0], c[SHIFT, 1], 2.0 * c[SHIFT, 2]
    size_1, size_2 = forces_of(scene, y, forcing)
    _fill_guards(c, 0, mode.signs[0], scene.first.mu_s, size_1, scene.body.mass_1)
    _fill_guards(c, 1, mode.signs[1], scene.second.mu_s, size_2, scene.body.mass_2)
    x_1, u_1, x_2, u_2, _ = motion_of(y, forcing)
    length_1, speed_1, _ = scales_of(scene.first, x_1, u_1, forcing)
    length_2, speed_2, _ = scales_of(scene.second, x_2, u_2, forcing)
    # In stick the guards are forces, whose series may converge more slowly than that of the motion.
    units = (
        (X, 1.0 / (length_1 * tolerance)),
        (V, 1.0 / (speed_1 * tolerance)),
        (FORCE, 1.0 / (size_1 * tolerance)),
        (OF_EACH + X, 1.0 / (length_2 * tolerance)),
        (OF_EACH + V, 1.0 / (speed_2 * tolerance)),
        (OF_EACH + FORCE, 1.0 / (size_2 * tolerance)),
    )
    h = step_within(c, units)
    return h, h


@modes.switch.implements(pair.BeltPair)
def _switch_of_pair(scene, mode, guard, t, y):
    """Implement :func:`modes.switch`."""
    return after_guard(scene, mode, (guard - GUARDS) // 2, (guard - GUARDS) % 2, t, y)


@series.state_at.implements(pair.BeltPair)
def _state_at_of_pair(scene, c, s):
    """Implement :func:`series.state_at`."""
    return value(c[X], s), value(c[V], s), value(c[OF_EACH + X], s), value(c[OF_EACH + V], s)


@series.rates_at.implements(pair.BeltPair)
def _rates_at_of_pair(scene, c, s):
    """Implement :func:`series.rates_at`."""
    return slope(c[X], s), slope(c[V], s), slope(c[OF_EACH + X], s), slope(c[OF_EACH + V], s)


@series.seen_at_start.implements(pair.BeltPair)
def _seen_at_start_of_pair(scene, c):
    """Implement :func:`series.seen_at_start`: what both records of belts are shown, and that neither mass sticks."""
    return series.seen_at_start(scene.first, c), series.seen_at_start(scene.second, c[OF_EACH:]), (False, False)


@inlined
def _seen(mass, c, s, h):
    """What the record of a belt is shown of the mass whose rows are `c`, within a step."""
    x, v, velocity = value(c[X], s), value(c[V], s), value(c[VELOCITY], s)
    if abs(velocity) <= 1e-15 * (abs(c[VELOCITY, 0]) + variation(c[VELOCITY], h)):
        # A velocity within rounding is zero, so that an extreme of the displacement is recognised.
        velocity = 0.0
    force, acceleration = value(c[FORCE], s), located(mass, x, value(c[ACCELERATION], s))
    return x, velocity, force, x - value(c[SHIFT], s), v, slope(c[V], s), acceleration, nan


@series.seen_at.implements(pair.BeltPair)
def _seen_at_of_pair(scene, mode, c, s, h):
    """Implement :func:`series.seen_at`: what both records of belts are shown, and which mass sticks."""
    stuck = mode.signs[0] == 0, mode.signs[1] == 0
    return _seen(scene.first, c, s, h), _seen(scene.second, c[OF_EACH:], s, h), stuck


@series.extremes.implements(pair.BeltPair)
def _extremes_of_pair(scene, record, mode, c, h, work):
    """Implement :func:`series.extremes`: those of both masses."""
    count = look_for_extremes(scene.first, record.first, c, h, work, 0)
    return look_for_extremes(scene.second, record.second, c[OF_EACH:], h, work, count)
