"""Drives: prescribed motions of the ring or of the belt. ``docs/extending.md`` shows how to add one.

A drive is a formula of the time. All else is derived from it: angular velocity and acceleration, power series, knots,
the period. Only what is no formula, or singular at t = 0, has functions of its own.

Every drive is an amplitude times a shape, :math:`\\theta(t) = A\\, s(t)`. The shape does not depend on the amplitude.
So cells that differ only in amplitude share one table of the shape. On the belt theta is a displacement: m in place of
rad.
"""

from __future__ import annotations

from collections.abc import Mapping
from math import atan, cos, exp, floor, inf, log, log1p, nan, sin, sqrt, tanh
from typing import Annotated, Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ringsweep.compile import function_from_lines, hook, inlined, lacking, take
from ringsweep.numerics import clock, writer
from ringsweep.numerics.expressions import ZERO, Node, derivative, evaluate, held, multiply, symbol, symbols_of
from ringsweep.numerics.functions import raised
from ringsweep.numerics.rows import distinct_rows
from ringsweep.numerics.series import INVERSE
from ringsweep.physics.definitions import Definitions
from ringsweep.physics.friction.formula import FormulaError, Threshold
from ringsweep.physics.functions_of_time import (
    Function,
    check,
    extremes,
    held_at,
    knots_of,
    period_of,
    read_function,
    read_rate,
    size_at_start,
    table_of_knots,
)
from ringsweep.quantities.parameters import Leaf, Parameter

#: Unit of the amplitude of a power law, by that of the drive.
PER_SECOND_P = {unit: f"{unit}/s^p with the exponent p, so write 2 for 2 {unit}/s^p" for unit in ("rad", "m")}


class Power(NamedTuple):
    """Power law: :math:`s = t^n`. For 1 < n < 2 the acceleration is infinite at t = 0."""

    amplitude: Annotated[float, Parameter("", "angle of the ring after one second", unit_in_words=PER_SECOND_P["rad"])]
    exponent: Annotated[float, Parameter("1", "exponent of the power law", lower=1.0)]


class Table(NamedTuple):
    """Measured course: a cubic between each two rows of a table of times and angles, or forces.

    ``knots``, of shape ``(n,)``, are the times, s. Row j of ``coefficients``, of shape ``(n - 1, 4)``, belongs to the
    piece from knot j: the cubic in t - knots[j], highest power first.
    """

    amplitude: Annotated[Leaf, Parameter("1", "factor on the measured course", default=1.0)]
    knots: Any
    coefficients: Any


#: Formulas of the drives that have one, by their type.
FORMULAS: dict[type, Function] = {}


class WithoutShape(NamedTuple):
    """Drive whose shape is read from a table, see :func:`lookup`."""

    amplitude: Any


def without_shape(drive: Any) -> Any:
    """Drive without its shape, and without those of the drives in it; :func:`lookup` needs nothing else."""
    function = FORMULAS.get(type(drive))
    if function is not None and function.value is not ZERO:
        cells = len(drive[0]) if len(drive) else 1
        return WithoutShape(np.broadcast_to(evaluate(function.factors[0], 0.0, drive._asdict()), (cells,)).copy())
    if hasattr(drive, "amplitude"):
        return WithoutShape(drive.amplitude)
    return type(drive)(*(without_shape(part) if isinstance(part, tuple) else part for part in drive))


def shape_numbers(drive: Any) -> list[Any]:
    """Numbers of a drive, and of the drives in it, on which :func:`table_row` depends: arrays of shape ``(cells,)``."""
    found = []
    function = FORMULAS.get(type(drive))
    if function is not None:
        needed = symbols_of(function.factors[1], function.shape_rate)
        knots = getattr(drive, "knots", None)
        # Knots that all cells share tell none from another.
        own_knots = [] if knots is None or knots.strides[0] == 0 else list(knots.reshape(len(knots), -1).T)
        return [getattr(drive, name) for name in needed] + own_knots
    for name, part in zip(drive._fields, drive, strict=True):
        if isinstance(part, tuple):
            found += shape_numbers(part)
        elif hasattr(drive, "amplitude") and name != "amplitude" and part.ndim == 1:
            found.append(part)
    return found


# Series of a power law begin at this time, s: there is none about t = 0. The motion until then is below rounding.
_POWER_BEGINNING = 1e-14


@hook
def shape(drive, t):
    """Shape of the drive and its first two derivatives.

    Parameters
    ----------
    drive : NamedTuple
    t : float
        Time, s.

    Returns
    -------
    tuple of float
        ``(s, ds/dt, d^2s/dt^2)``; the angle is ``theta = amplitude * s``, rad.
    """


@shape.implements(Power)
def _shape_of_power(drive, t):
    """Implement :func:`shape` for t to the power of the exponent; at t = 0 the acceleration may be infinite."""
    n = drive.exponent
    if t == 0.0:
        return 0.0, 1.0 if n == 1.0 else 0.0, (2.0 if n == 2.0 else 0.0 if n > 2.0 or n == 1.0 else inf)
    return t**n, n * t ** (n - 1.0), n * (n - 1.0) * t ** (n - 2.0)


@inlined
def _piece(knots, t):
    """Index of the spline's piece at time `t`, s; the first and the last piece extend to infinity."""
    low, high = 0, len(knots) - 1
    while high - low > 1:
        middle = (low + high) // 2
        if t < knots[middle]:
            high = middle
        else:
            low = middle
    return low


@inlined
def _cubic(drive, t):
    """Coefficients of the powers 0 to 3 of the shape about the time `t`, s: the cubic of the piece that holds it."""
    now, rest = clock.parts(t)
    j = _piece(drive.knots, now)
    x = (now - drive.knots[j]) + rest
    c3, c2, c1, c0 = drive.coefficients[j]
    return c0 + x * (c1 + x * (c2 + x * c3)), c1 + x * (2.0 * c2 + 3.0 * x * c3), c2 + 3.0 * x * c3, c3


@shape.implements(Table)
def _shape_of_table(drive, t):
    """Implement :func:`shape`: the cubic of the interval that holds t."""
    s, rate, half, _ = _cubic(drive, t)
    return s, rate, 2.0 * half


@hook(absorb=True, optional=True)
def amplitude(drive):
    """Factor on :func:`shape`: by default the field of this name."""
    return drive.amplitude


@hook(absorb=True, optional=True)
def time_for(drive, t):
    """Time as the other functions of a drive take it, s: a number, or an :class:`Instant` for a table or a formula.

    By default a number, where `t` may be an :class:`ringsweep.numerics.clock.Instant`; a table and a formula take both.
    """
    return clock.parts(t)[0]


@hook(optional=True)
def turn(drive, t):
    """Angle of the ring and its first two derivatives.

    By default the amplitude times :func:`shape`.

    Parameters
    ----------
    drive : NamedTuple
    t : float or Instant
        Time, s.

    Returns
    -------
    tuple of float
        ``(theta, omega, epsilon)``, rad, rad/s, rad/s^2; on the belt m, m/s, m/s^2.
    """
    theta, omega, epsilon = shape(drive, time_for(drive, t))
    a = amplitude(drive)
    # With an amplitude of zero the ring rests, even if the shape has an infinite acceleration.
    return a * theta, a * omega, a * epsilon if a != 0.0 else 0.0


@hook(optional=True)
def table_row(drive, t):
    """Row of the table from which :func:`lookup` reads: by default the first two numbers of :func:`shape`.

    Parameters
    ----------
    drive, t
        As for :func:`shape`.

    Returns
    -------
    tuple of float
    """
    s, rate, _ = shape(drive, t)
    return s, rate


@hook(absorb=True, optional=True)
def lookup(drive, table, k):
    """Angle and angular velocity of the ring from a table of the shape.

    By default the amplitude times row `k`.

    Parameters
    ----------
    drive : NamedTuple
    table : ndarray of shape ``(instants, 2)``
        Columns s and ds/dt of the shape; see :func:`table_row`.
    k : int
        Row.

    Returns
    -------
    tuple of float
        ``(theta, omega)``, rad, rad/s; on the belt m, m/s.
    """
    a = amplitude(drive)
    return a * table[k, 0], a * table[k, 1]


@hook
def expand(drive, t, order, theta, work):
    """Taylor series of the angle of the ring about time `t`: theta[0] + theta[1] s + theta[2] s^2 + ...

    Parameters
    ----------
    drive, t
        As for :func:`shape`.
    order : int
        Highest power.
    theta : ndarray of shape ``(order + 1,)``
        Filled with the coefficients, rad/s^k; on the belt m/s^k.
    work : ndarray of shape ``(SERIES_ROWS, order + 1)``
        Scratch.
    """


@expand.implements(Power)
def _expand_power(drive, t, order, theta, work):
    """Implement :func:`expand`: the binomial series; just after 0 instead of at 0, where the power is singular."""
    t = max(t, _POWER_BEGINNING)
    n = drive.exponent
    theta[0] = drive.amplitude * t**n
    for k in range(1, order + 1):
        theta[k] = theta[k - 1] * (n - k + 1.0) / (k * t)


@time_for.implements(Table)
def _instant_itself(drive, t):
    """Implement :func:`time_for`: the place in a table or a period is found from the whole, exact time."""
    return t


@expand.implements(Table)
def _expand_table(drive, t, order, theta, work):
    """Implement :func:`expand`: the cubic of the interval."""
    terms = _cubic(drive, t)
    for k in range(order + 1):
        theta[k] = drive.amplitude * terms[k] if k < 4 else 0.0


@inlined
def expand_at(drive, t, order, theta, work):
    """What :func:`expand` does, about a time `t` that is a number or an :class:`ringsweep.numerics.clock.Instant`."""
    expand(drive, time_for(drive, t), order, theta, work)


@hook(optional=True)
def next_knot(drive, t):
    """Time up to which a series about `t` may be used, s. There the drive is not smooth, or the series converges badly.

    By default infinite.

    Parameters
    ----------
    drive, t
        As for :func:`shape`.

    Returns
    -------
    float
        Time after `t`, s.
    """
    return inf


@next_knot.implements(Power)
def _next_knot_of_power(drive, t):
    """Implement :func:`next_knot`: a time well within the radius of convergence of the series."""
    # The radius of convergence about t is t, the distance from the singularity at 0. Steps limited by this bound do not
    # depend on the tolerance. At a fifth of the radius the error is 1e-12.
    return inf if drive.exponent % 1.0 == 0.0 else 1.2 * max(t, _POWER_BEGINNING)


@next_knot.implements(Table)
def _next_knot_of_table(drive, t):
    """Implement :func:`next_knot`: the end of the interval of the table."""
    j = _piece(drive.knots, t)
    return drive.knots[j + 1] if j + 2 < len(drive.knots) else inf


@hook(absorb=True, optional=True)
def knot_after(drive, t):
    """What :func:`next_knot` returns, as an :class:`ringsweep.numerics.clock.Instant` after the instant `t`."""
    return clock.Instant(next_knot(drive, t.t), 0.0)


@hook(absorb=True, optional=True)
def held_of(drive):
    """Arrays of the numbers that are constant between knots; an empty tuple if the drive has none."""
    return ()


@hook(optional=True)
def pass_knot(drive, t):
    """Give what is constant between knots its values from the time `t`, s, on; return whether any of them changes."""
    return False


@hook(optional=True)
def least_jump(drive):
    """Jumps of the speed below this are rounding, in the units of :func:`turn`."""
    return 0.0


@inlined
def _knot(knots, n):
    """Instant of a knot; `knots` are those of a threshold, counted from the first one of the turn that begins at 0.

    See :func:`ringsweep.physics.functions_of_time.table_of_knots`.
    """
    frequency, count = knots[0, 0], knots.shape[1] - 1
    turn = n // count
    if frequency > 0.0:
        return clock.turned(frequency, float(turn), knots[0, 1 + n - turn * count])
    return clock.Instant(knots[0, 1 + n] if n < count else inf, 0.0)


@inlined
def _last_knot(knots, now):
    """Number of the last :func:`_knot` that is not after an instant."""
    count = knots.shape[1] - 1
    low, high = 0, count
    if knots[0, 0] > 0.0:
        # But for rounding this turn may be the one before or after.
        turn = floor(knots[0, 0] * now.t)
        low, high = (turn - 2) * count, (turn + 2) * count
    while high - low > 1:
        middle = (low + high) // 2
        if clock.is_after(_knot(knots, middle), now):
            high = middle
        else:
            low = middle
    return low


@inlined
def _next_of(knots, now):
    """Instant of the next knot of all thresholds."""
    found = clock.Instant(inf, 0.0)
    for i in range(len(knots)):
        knot = _knot(knots[i], _last_knot(knots[i], now) + 1)
        if clock.is_after(found, knot):
            found = knot
    return found


@inlined
def _hold(held, knots, now):
    """Fill the numbers that are held from an instant on, and return whether any of them changes."""
    changed = False
    for i in range(len(held)):
        before, count = held[i], knots.shape[2] - 1
        n = _last_knot(knots[i], now)
        held[i] = knots[i, 1, 1 + n % count] + knots[i, 1, 0] * (n // count)
        changed = changed or held[i] != before
    return changed


def angle_at_start(drive):
    """Angle of the ring at t = 0, rad; outside kernels, for arrays of shape ``(cells,)``."""
    if (function := FORMULAS.get(type(drive))) is not None:
        return evaluate(function.value, 0.0, drive._asdict(), getattr(drive, "held", np.empty((0, 0))).T)
    return np.array([turn(take(drive, i), 0.0)[0] for i in range(len(drive[0]))])


@hook
def jerk(drive, t):
    """Third derivative of the angle of the ring, rad/s^3; on the belt m/s^3.

    Parameters
    ----------
    drive, t
        As for :func:`shape`.
    """


@inlined
def jerk_at(drive, t):
    """What :func:`jerk` returns, at a time `t` that is a number or an :class:`ringsweep.numerics.clock.Instant`."""
    return jerk(drive, time_for(drive, t))


@jerk.implements(Power)
def _jerk_of_power(drive, t):
    """Implement :func:`jerk`."""
    n = drive.exponent
    return drive.amplitude * n * (n - 1.0) * (n - 2.0) * max(t, _POWER_BEGINNING) ** (n - 3.0)


@jerk.implements(Table)
def _jerk_of_table(drive, t):
    """Implement :func:`jerk`; at a knot that of the interval after it."""
    return 6.0 * drive.amplitude * _cubic(drive, t)[3]


#: Highest power of the series of a drive about a recent time.
COURSE_ORDER = 12

#: Shape of a course: its first row holds the centre and the reach of such a series, s, then the coefficients of
#: :func:`expand`, and what rounding takes from the centre; the others are scratch.
COURSE_SHAPE = 1 + writer.SERIES_ROWS, COURSE_ORDER + 4


@inlined
def new_course(course):
    """Empty a course, so that a run depends on no other run."""
    course[0, 0] = course[0, 1] = inf
    course[0, COURSE_ORDER + 3] = 0.0


@inlined
def follow(drive, course, now, h):
    """Prepare a course for a step: :func:`turn_near` then takes the series at most times of the step, if it converges.

    Parameters
    ----------
    drive : NamedTuple
    course : ndarray of shape ``COURSE_SHAPE``
        Series of the drive about a recent time; see :func:`new_course`.
    now : float or Instant
        Time at the beginning of the step, s.
    h : float
        Length of the step, s.
    """
    since, reach = _since(course, now), course[0, 1]
    if since >= 0.0 and since + h <= reach:
        return
    t, rest = clock.parts(now)
    # A series that serves a small part of a long step is not worth its coefficients. The reach may have grown since.
    if h <= 2.0 * reach or t > 2.0 * course[0, 0]:
        expand_at(drive, now, COURSE_ORDER, course[0, 2:], course[1:])
        course[0, 0], course[0, COURSE_ORDER + 3] = t, rest
        course[0, 1] = min(_reach(course), (next_knot(drive, t) - t) - rest)


@inlined
def _since(course, now):
    """Time from the centre of a course to another time, s; minus infinity in an empty course."""
    t, rest = clock.parts(now)
    return (t - course[0, 0]) + (rest - course[0, COURSE_ORDER + 3])


@inlined
def _reach(course):
    """Time within which the truncation error of the acceleration is below its rounding, s."""
    # Coefficients of the acceleration: the first two, and the last two.
    n = COURSE_ORDER
    first, second = 2.0 * abs(course[0, 4]), 6.0 * abs(course[0, 5])
    reach = inf
    for k in (n - 1, n):
        last = k * (k - 1.0) * abs(course[0, k + 2])
        if last != 0.0:
            by_first, by_second = 2.0**-54 * first / last, 2.0**-54 * second / last
            # The acceleration itself may pass through zero; then its rate gives the scale.
            found = exp(log(by_first) / (k - 2.0)) if by_first > 0.0 else 0.0
            reach = min(reach, max(found, exp(log(by_second) / (k - 3.0)) if by_second > 0.0 else 0.0))
    return reach


@hook(absorb=True, optional=True)
def turn_near(drive, course, now, s):
    """What :func:`turn` returns the time `s` after another time, but faster where the series of a course reaches.

    Parameters
    ----------
    drive : NamedTuple
    course : ndarray of shape ``COURSE_SHAPE``
        See :func:`follow`.
    now : float or Instant
        The other time, s.
    s : float
        Time since then, s.

    Returns
    -------
    tuple of float
        As for :func:`turn`; equal to it but for rounding.
    """
    since = _since(course, now) + s
    if not 0.0 <= since <= course[0, 1]:
        return turn(drive, clock.later(now, s))
    theta, omega, half_epsilon = course[0, COURSE_ORDER + 2], 0.0, 0.0
    for k in range(COURSE_ORDER + 1, 1, -1):
        half_epsilon = half_epsilon * since + omega
        omega = omega * since + theta
        theta = theta * since + course[0, k]
    return theta, omega, 2.0 * half_epsilon


@turn_near.implements(Table)
def _turn_near_of_table(drive, course, now, s):
    """Implement :func:`turn_near`."""
    # A polynomial is as fast as a series.
    return turn(drive, clock.later(now, s))


@hook(optional=True)
def beginning(drive):
    """First time at which the drive has a Taylor series, s. By default 0; later if the drive is singular at 0."""
    return 0.0


@beginning.implements(Power)
def _beginning_of_power(drive):
    """Implement :func:`beginning`: its velocity or acceleration may be infinite at t = 0."""
    return _POWER_BEGINNING


@hook(optional=True)
def top_speed(drive):
    """Size of the terms in the speed of the drive at t = 0, in the units of :func:`turn`: its rounding scales with it.

    By default the speed at t = 0.
    """
    return abs(turn(drive, 0.0)[1])


@hook(optional=True)
def period(drive):
    """Period of the drive, s.

    Outside kernels.

    Parameters
    ----------
    drive : NamedTuple
        Its fields may be arrays, with a number for each cell.

    Returns
    -------
    float or ndarray
        By default infinite: the drive does not repeat. 0 if its velocity does not vary.
    """
    return inf


def force_period(drive):
    """Period of a force with the formula of a drive; see :func:`period`, which is that of its rate."""
    function = FORMULAS.get(type(drive))
    return period(drive) if function is None else period_of(function.value, drive._asdict())


# The time 0, of the kind that kernels have: so functions of it are compiled for one kind only.
_START = clock.Instant(0.0, 0.0)

# Velocities that differ by less than this share of their size are equal but for rounding.
_ROUNDING = 1e-15


@inlined
def relative_velocity(drive, velocity):
    """Velocity of a body relative to the drive at t = 0; exactly 0 if the two differ only by rounding.

    Parameters
    ----------
    drive : NamedTuple
    velocity : float
        Velocity of the body in space, in the units of :func:`turn`.

    Returns
    -------
    float
        Relative velocity, in the units of :func:`turn`.
    """
    difference = velocity - turn(drive, _START)[1]
    return 0.0 if abs(difference) < _ROUNDING * (abs(velocity) + top_speed(drive)) else difference


@inlined
def velocity_at_beginning(drive, velocity):
    """Velocity of a body relative to the drive at the time :func:`beginning`, given that at t = 0.

    Between the two times the body moves uniformly in space, unless it is at rest on the drive and the acceleration of
    the drive is finite at t = 0: then it stays at rest on the drive.

    Parameters
    ----------
    drive : NamedTuple
    velocity : float
        Velocity of the body relative to the drive at t = 0, in the units of :func:`turn`.

    Returns
    -------
    float
        Relative velocity at the time :func:`beginning`, in the units of :func:`turn`.
    """
    before, acceleration = turn(drive, _START)[1:3]
    if velocity == 0.0 and abs(acceleration) < inf:
        return 0.0
    return velocity - (turn(drive, clock.Instant(beginning(drive), 0.0))[1] - before)


#: Drives by the name that the configuration gives them.
DRIVES: dict[str, type] = {}


def add_drive(name: str, drive: type) -> None:
    """Register a drive.

    Parameters
    ----------
    name : str
        Name in configurations.
    drive : type
        ``NamedTuple`` of the drive's parameters. The hooks of this module must have bodies for it.

    Raises
    ------
    TypeError
        If a hook has no body for the drive, or if the name is taken.
    """
    if missing := lacking(drive, (shape, expand, jerk)):
        raise TypeError(f"drive {name} has no {', '.join(missing)}: every drive needs it, before add_drive is called")
    if DRIVES.setdefault(name, drive) is not drive:
        raise TypeError(f"there is a drive {name} already: choose another name")


# ---- drives by formula ------------------------------------------------------------------------


@inlined
def _time_of(distance, first, second):
    """Time, s, in which a function with the derivatives `first` and `second` changes by `distance`."""
    rate = abs(first) + sqrt(first * first + 2.0 * abs(second) * distance)
    return 2.0 * distance / rate if rate > 0.0 else inf


_SCOPE = {
    "abs": abs,
    "amplitude": amplitude,
    "atan_of": atan,
    "cos_of": cos,
    "exp_of": exp,
    "hold": _hold,
    "inf": inf,
    "Instant": clock.Instant,
    "INVERSE": INVERSE,
    "log1p_of": log1p,
    "log_of": log,
    "nan": nan,
    "next_of": _next_of,
    "parts": clock.parts,
    "phase": clock.phase,
    "shifted_phase": clock.shifted_phase,
    "power_of": raised,
    "sin_of": sin,
    "sqrt_of": sqrt,
    "tanh_of": tanh,
    "time_of": _time_of,
}

_SIDE = "drive.held[{}] > 0.0"

# Lines that give a time the two names that expressions have for it.
_TIME = ["now, rest = parts(t)"]


def _make(name: str, doc: str, function: Function, parameters: Mapping[str, Parameter], qualified: str = "") -> type:
    """Type of the drive with a formula: a ``NamedTuple`` of its parameters, and of its knots if it has any."""
    fields: list[Any] = [(field, Annotated[Leaf, p]) for field, p in parameters.items()]
    fields += [("knots", Any), ("held", Any), ("least", Any)] * bool(function.knots)
    drive: Any = NamedTuple(name, fields)  # type: ignore[misc]
    drive.__doc__, drive.__module__, drive.__qualname__ = doc, __name__, qualified or name
    FORMULAS[drive] = function
    names = {field: f"drive.{field}" for field in parameters}
    factor, s = function.factors
    rate = function.shape_rate
    second = derivative(rate)

    def implement(function: Any, arguments: str, lines: list[str]) -> None:
        function.implements(drive)(function_from_lines(arguments, lines, _SCOPE))

    def number(node: Node, before: str = "") -> list[str]:
        lines = writer.float_lines(names, [node], _SIDE)
        return [*lines[:-1], lines[-1].replace("return", f"return {before}") + "[0]"]

    implement(amplitude, "drive", number(factor))
    implement(shape, "drive, t", [*_TIME, *writer.float_lines(names, [s, rate, second], _SIDE)])
    implement(jerk, "drive, t", [*_TIME, *number(derivative(second), "amplitude(drive) * ")])
    series = writer.taylor_lines(names, s, rate, _SIDE, "amplitude(drive)")
    implement(expand, "drive, t, order, theta, work", [*_TIME, *series])
    time_for.implements(drive)(_instant_itself)
    implement(top_speed, "drive", ["now = rest = 0.0", *number(size_at_start(function.rate))])
    # The drives of the package have no narrow features.
    reach = writer.reach_lines(names, rate if function.by_rate else s, _SIDE) if qualified else []
    if function.knots:
        implement(held_of, "drive", ["return (drive.held,)"])
        implement(pass_knot, "drive, t", [*_TIME, "return hold(drive.held, drive.knots, Instant(now, rest))"])
        implement(least_jump, "drive", ["return drive.least"])
        lines = [*_TIME, "h = inf", *reach, "knot = next_of(drive.knots, Instant(now, rest))"]
        implement(knot_after, "drive, t", [*lines, "return knot if knot.t <= t.t + h else Instant(t.t + h, 0.0)"])
        implement(next_knot, "drive, t", [*lines, "return min(t + h, knot.t)"])
    elif reach:
        implement(next_knot, "drive, t", [*_TIME, "h = inf", *reach, "return t + h"])
    elif writer.is_polynomial(rate):
        turn_near.implements(drive)(_turn_near_of_table)
    period.implements(drive)(lambda drive: period_of(function.rate, drive._asdict()))
    found: type = drive
    return found


# ---- the drives of the package ----------------------------------------------------------------


def _drive(name: str, doc: str, theta: str, rate: str | None = None, **parameters: Parameter) -> Any:
    """Define a drive by its formula, and register it under its name."""
    function = read_function(theta, "rad", rate, infer_units=False)
    drive = _make({"none": "Still"}.get(name, name.title()), doc, function, parameters)
    add_drive(name, drive)
    return drive


Still = _drive("none", "No drive: the ring is at rest.", "0")

Constant = _drive(
    "constant",
    "Constant angular velocity: :math:`s = t`.",
    "amplitude*t",
    amplitude=Parameter("rad/s", "angular velocity of the ring"),
)

Arctan = _drive(
    "arctan",
    "Smooth run-up, the paper's h(t): :math:`s = t \\arctan t - \\tfrac12 \\ln(1 + t^2)`.",
    "amplitude*(t*atan(t) - log1p(t**2)/2)",
    rate="amplitude*atan(t)",
    amplitude=Parameter("rad/s", "2/π of the ring's final angular velocity"),
)

add_drive("power", Power)

Sinusoidal = _drive(
    "sinusoidal",
    "Rocking ring: :math:`s = \\sin(2 \\pi f t + \\psi)`.",
    "amplitude*sin(2*pi*frequency*t + phase)",
    amplitude=Parameter("rad", "amplitude of the rocking angle"),
    frequency=Parameter("Hz", "frequency of rocking", lower=0.0),
    phase=Parameter("rad", "phase of rocking at t = 0", default=0.0),
)

add_drive("table", Table)

#: Force or load by a table whose numbers each hold until the next row.
Steps: Any = _make(
    "Steps",
    "Steps: between knots a held number, times an amplitude.",
    Function("a table", multiply(symbol("amplitude"), held(0)), ZERO, "N", (Threshold(),), {}),
    {"amplitude": Parameter("1", "factor on the table")},
)


def steps(amplitude: NDArray[np.float64], times: NDArray[np.float64], samples: NDArray[np.float64]) -> Any:
    """Force or load of the shape ``(cells,)`` that has a sample from its time (s) on; the first time is not after 0."""
    knots = np.broadcast_to(
        table_of_knots([0.0], [0.0], times[None], samples[None]), (len(amplitude), 1, 2, len(times) + 1)
    )
    return Steps(amplitude, knots, np.stack(held_at(knots, 0.0 * amplitude), axis=1), 0.0 * amplitude)


# ---- drives of users --------------------------------------------------------------------------

#: What must be continuous, by the unit of the formula; the second one only if the velocity must not jump.
_CONTINUOUS = {
    "rad": (("the angle", "rad"), ("the angular velocity", "rad/s")),
    "m": (("the displacement", "m"), ("the velocity", "m/s")),
    "N": (),
}


def define(text: str, unit: str) -> type:
    """Type of the drive, or of the force, that a formula defines.

    Parameters
    ----------
    text : str
    unit : str
        ``rad`` for the angle of a ring, ``m`` for the displacement of a belt, ``N`` for a force; ``rad/s`` and ``m/s``
        for their rates.

    Raises
    ------
    FormulaError
        If something in the formula is wrong.
    """
    return _DEFINITIONS.type_of(text, unit)


def _defined(name: str, qualified: str, text: str, unit: str) -> type:
    """Type of a drive (``unit`` rad or m, or these per s) or force (N) by formula; `qualified` is its name in kernels.

    Raises
    ------
    FormulaError
        If the formula does not depend on t and on a parameter with the unit, or is too long.
    """
    function = read_rate(text, unit) if unit.endswith("/s") else read_function(text, unit)
    if not function.value.varies or not function.units:
        raise FormulaError("it must depend on t, and on a parameter, which has the unit")
    what = "force" if unit == "N" else "drive"
    unknown = "not known from the formula"
    parameters = {
        name: Parameter(of, f"parameter {name} of the {what}", unit_in_words="" if of else unknown)
        for name, of in function.units.items()
    }
    try:
        return _make(name, f"{text}, {unit}", function, parameters, qualified)
    except OverflowError:
        raise FormulaError("it is too long: its power series have too many parts") from None


_DEFINITIONS = Definitions(__name__, _defined)

__getattr__ = _DEFINITIONS.find


def made(drive: type, columns: dict[str, NDArray[np.float64]], spans: NDArray[np.float64], *, smooth: bool) -> Any:
    """Drives by formula, of shape ``(cells,)``, with their knots; `columns` are parameters by name, `spans` in s.

    If the motion must be `smooth`, the velocity of the drive must not jump.

    Raises
    ------
    FormulaError
        If a formula has a jump, or is no number, within the spans of time of the cells, s.
    """
    if drive.__qualname__ not in _DEFINITIONS.known:
        return drive(**columns)
    function = FORMULAS[drive]
    knots = knots_of(function, columns, spans)
    some, _ = distinct_rows([*columns.values(), spans])
    values = {name: column[some] for name, column in columns.items()}
    check(function, values, knots[some], spans[some], _CONTINUOUS[function.unit][: 2 if smooth else 1])
    if not function.knots:
        return drive(**columns)
    held = np.ascontiguousarray(np.stack(held_at(knots, np.zeros(len(spans))), axis=1))
    least = 1e-9 * abs(extremes(function.rate, columns, knots, spans)).max(axis=0)
    return drive(**columns, knots=knots, held=held, least=least)


def extremes_of(force: Any, spans: NDArray[np.float64]) -> Any:
    """About the least and the greatest value of forces by formula within spans of time (s), N, shape ``(2, cells)``."""
    knots = getattr(force, "knots", np.empty((len(spans), 0, 2, 1)))
    return extremes(FORMULAS[type(force)].value, force._asdict(), knots, spans)
