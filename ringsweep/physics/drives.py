"""Drives: prescribed motions of the ring or of the belt. ``docs/extending.md`` shows how to add one.

Every drive is an amplitude times a shape, :math:`\\theta(t) = A\\, s(t)`. The shape does not depend on the amplitude.
So cells that differ only in amplitude share one table of the shape. On the belt theta is a displacement: m in place of
rad.
"""

from __future__ import annotations

from math import atan, cos, exp, inf, log, log1p, pi, sin
from typing import Annotated, Any, NamedTuple

import numpy as np

from ringsweep.compile import hook, inlined, lacking
from ringsweep.quantities.parameters import Leaf, Parameter


class Still(NamedTuple):
    """No drive: the ring is at rest."""


class Constant(NamedTuple):
    """Constant angular velocity: :math:`s = t`."""

    amplitude: Annotated[Leaf, Parameter("rad/s", "angular velocity of the ring")]


class Arctan(NamedTuple):
    """Smooth run-up, the paper's h(t): :math:`s = t \\arctan t - \\tfrac12 \\ln(1 + t^2)`."""

    amplitude: Annotated[float, Parameter("rad/s", "amplitude of the ring's angular velocity")]


class Power(NamedTuple):
    """Power law: :math:`s = t^n`. For 1 < n < 2 the acceleration is infinite at t = 0."""

    amplitude: Annotated[float, Parameter("", "angle of the ring after one second")]
    exponent: Annotated[float, Parameter("1", "exponent of the power law", lower=1.0)]


class Sinusoidal(NamedTuple):
    """Rocking ring: :math:`s = \\sin(2 \\pi f t + \\psi)`."""

    amplitude: Annotated[Leaf, Parameter("rad", "amplitude of the rocking angle")]
    frequency: Annotated[Leaf, Parameter("Hz", "frequency of rocking", lower=0.0)]
    phase: Annotated[Leaf, Parameter("rad", "phase of rocking at t = 0", default=0.0)]


class Table(NamedTuple):
    """Measured angle: a cubic spline through a table of times and angles; its second derivative is continuous.

    ``knots``, of shape ``(n,)``, are the times, s. Row j of ``coefficients``, of shape ``(n - 1, 4)``, belongs to the
    piece from knot j: the cubic in t - knots[j], highest power first.
    """

    amplitude: Annotated[Leaf, Parameter("1", "factor on the measured course", default=1.0)]
    knots: Any
    coefficients: Any


class WithoutShape(NamedTuple):
    """Drive whose shape is read from a table, see :func:`lookup`."""

    amplitude: Any


def without_shape(drive: Any) -> Any:
    """Drive without its shape, and without those of the drives in it; :func:`lookup` needs nothing else."""
    if hasattr(drive, "amplitude"):
        return WithoutShape(drive.amplitude)
    return type(drive)(*(without_shape(part) if isinstance(part, tuple) else part for part in drive))


def shape_numbers(drive: Any) -> list[Any]:
    """Numbers of a drive, and of the drives in it, on which :func:`table_row` depends: arrays of shape ``(cells,)``."""
    found = []
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


@shape.implements(Still)
def _still(drive, t):
    return 0.0, 0.0, 0.0


@shape.implements(Constant)
def _constant(drive, t):
    return t, 1.0, 0.0


@shape.implements(Arctan)
def _arctan(drive, t):
    rate = atan(t)
    return t * rate - 0.5 * log1p(t * t), rate, 1.0 / (1.0 + t * t)


@shape.implements(Power)
def _power(drive, t):
    n = drive.exponent
    if t == 0.0:
        return 0.0, 1.0 if n == 1.0 else 0.0, (2.0 if n == 2.0 else 0.0 if n > 2.0 or n == 1.0 else inf)
    return t**n, n * t ** (n - 1.0), n * (n - 1.0) * t ** (n - 2.0)


@shape.implements(Sinusoidal)
def _sinusoidal(drive, t):
    rate = 2.0 * pi * drive.frequency
    s = sin(rate * t + drive.phase)
    return s, rate * cos(rate * t + drive.phase), -rate * rate * s


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


@shape.implements(Table)
def _table(drive, t):
    j = _piece(drive.knots, t)
    x = t - drive.knots[j]
    c3, c2, c1, c0 = drive.coefficients[j]
    return c0 + x * (c1 + x * (c2 + x * c3)), c1 + x * (2.0 * c2 + 3.0 * x * c3), 2.0 * c2 + 6.0 * x * c3


@hook(optional=True)
def turn(drive, t):
    """Angle of the ring and its first two derivatives.

    By default the amplitude times :func:`shape`.

    Parameters
    ----------
    drive, t
        As for :func:`shape`.

    Returns
    -------
    tuple of float
        ``(theta, omega, epsilon)``, rad, rad/s, rad/s^2; on the belt m, m/s, m/s^2.
    """
    theta, omega, epsilon = shape(drive, t)
    a = drive.amplitude
    # With an amplitude of zero the ring rests, even if the shape has an infinite acceleration.
    return a * theta, a * omega, a * epsilon if a != 0.0 else 0.0


@turn.implements(Still)
def _no_turn(drive, t):
    return 0.0, 0.0, 0.0


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
    return drive.amplitude * table[k, 0], drive.amplitude * table[k, 1]


@lookup.implements(Still)
def _no_lookup(drive, table, k):
    return 0.0, 0.0


@hook
def expand(drive, t, order, theta):
    """Taylor series of the angle of the ring about time `t`: theta[0] + theta[1] s + theta[2] s^2 + ...

    Parameters
    ----------
    drive, t
        As for :func:`shape`.
    order : int
        Highest power.
    theta : ndarray of shape ``(order + 1,)``
        Filled with the coefficients, rad/s^k; on the belt m/s^k.
    """


@expand.implements(Still)
def _expand_still(drive, t, order, theta):
    for k in range(order + 1):
        theta[k] = 0.0


@expand.implements(Constant)
def _expand_constant(drive, t, order, theta):
    for k in range(2, order + 1):
        theta[k] = 0.0
    theta[0], theta[1] = drive.amplitude * t, drive.amplitude


@expand.implements(Arctan)
def _expand_arctan(drive, t, order, theta):
    # g = 1/(1 + (t + s)^2) obeys (1 + t^2 + 2 t s + s^2) g = 1, and theta'' = A g.
    scale = 1.0 / (1.0 + t * t)
    before, g = 0.0, scale
    rate = atan(t)
    theta[0] = drive.amplitude * (t * rate - 0.5 * log1p(t * t))
    theta[1] = drive.amplitude * rate
    for k in range(2, order + 1):
        theta[k] = drive.amplitude * g / (k * (k - 1.0))
        before, g = g, -(2.0 * t * g + before) * scale


@expand.implements(Power)
def _expand_power(drive, t, order, theta):
    t = max(t, _POWER_BEGINNING)
    n = drive.exponent
    theta[0] = drive.amplitude * t**n
    for k in range(1, order + 1):
        theta[k] = theta[k - 1] * (n - k + 1.0) / (k * t)


@expand.implements(Sinusoidal)
def _expand_sinusoidal(drive, t, order, theta):
    rate = 2.0 * pi * drive.frequency
    a = drive.amplitude * sin(rate * t + drive.phase)
    b = drive.amplitude * cos(rate * t + drive.phase)
    for k in range(order + 1):
        theta[k] = a
        a, b = b * rate / (k + 1.0), -a * rate / (k + 1.0)


@expand.implements(Table)
def _expand_table(drive, t, order, theta):
    for k in range(4, order + 1):
        theta[k] = 0.0
    j = _piece(drive.knots, t)
    x = t - drive.knots[j]
    c3, c2, c1, c0 = drive.coefficients[j]
    theta[0] = drive.amplitude * (c0 + x * (c1 + x * (c2 + x * c3)))
    theta[1] = drive.amplitude * (c1 + x * (2.0 * c2 + 3.0 * x * c3))
    theta[2] = drive.amplitude * (c2 + 3.0 * x * c3)
    theta[3] = drive.amplitude * c3


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
def _within_convergence(drive, t):
    # The radius of convergence about t is t, the distance from the singularity at 0. Steps limited by this bound do not
    # depend on the tolerance. At a fifth of the radius the error is 1e-12.
    return inf if drive.exponent % 1.0 == 0.0 else 1.2 * max(t, _POWER_BEGINNING)


@next_knot.implements(Table)
def _next_knot(drive, t):
    j = _piece(drive.knots, t)
    return drive.knots[j + 1] if j + 2 < len(drive.knots) else inf


@hook
def jerk(drive, t):
    """Third derivative of the angle of the ring, rad/s^3; on the belt m/s^3.

    Parameters
    ----------
    drive, t
        As for :func:`shape`.
    """


@jerk.implements(Still, Constant)
def _no_jerk(drive, t):
    return 0.0


@jerk.implements(Arctan)
def _arctan_jerk(drive, t):
    g = 1.0 / (1.0 + t * t)
    return -2.0 * drive.amplitude * t * g * g


@jerk.implements(Power)
def _power_jerk(drive, t):
    n = drive.exponent
    return drive.amplitude * n * (n - 1.0) * (n - 2.0) * max(t, _POWER_BEGINNING) ** (n - 3.0)


@jerk.implements(Sinusoidal)
def _sinusoidal_jerk(drive, t):
    rate = 2.0 * pi * drive.frequency
    return -drive.amplitude * rate**3 * cos(rate * t + drive.phase)


@jerk.implements(Table)
def _table_jerk(drive, t):
    return 6.0 * drive.amplitude * drive.coefficients[_piece(drive.knots, t)][0]


#: Highest power of the series of a drive about a recent time.
COURSE_ORDER = 12

#: Length of an array that holds such a series: its centre and its reach, s, then the coefficients of :func:`expand`.
COURSE_LENGTH = COURSE_ORDER + 3


@inlined
def new_course(course):
    """Empty a course, so that a run depends on no other run."""
    course[0] = course[1] = inf


@inlined
def follow(drive, course, t, h):
    """Prepare a course for a step: :func:`turn_near` then takes the series at most times of the step, if it converges.

    Parameters
    ----------
    drive : NamedTuple
    course : ndarray of shape ``(COURSE_LENGTH,)``
        Series of the drive about a recent time; see :func:`new_course`.
    t, h : float
        Time at the beginning of the step, and length of the step, s.
    """
    centre, reach = course[0], course[1]
    if t >= centre and t + h <= centre + reach:
        return
    # A series that serves a small part of a long step is not worth its coefficients. The reach may have grown since.
    if h <= 2.0 * reach or t > 2.0 * centre:
        expand(drive, t, COURSE_ORDER, course[2:])
        course[0], course[1] = t, min(_reach(course), next_knot(drive, t) - t)


@inlined
def _reach(course):
    """Time within which the truncation error of the acceleration is below its rounding, s."""
    # Coefficients of the acceleration: the first two, and the last two.
    n = COURSE_ORDER
    first, second = 2.0 * abs(course[4]), 6.0 * abs(course[5])
    reach = inf
    for k in (n - 1, n):
        last = k * (k - 1.0) * abs(course[k + 2])
        if last != 0.0:
            by_first, by_second = 2.0**-54 * first / last, 2.0**-54 * second / last
            # The acceleration itself may pass through zero; then its rate gives the scale.
            found = exp(log(by_first) / (k - 2.0)) if by_first > 0.0 else 0.0
            reach = min(reach, max(found, exp(log(by_second) / (k - 3.0)) if by_second > 0.0 else 0.0))
    return reach


@hook(optional=True)
def turn_near(drive, course, t):
    """What :func:`turn` returns, but faster where the series of a course reaches.

    Parameters
    ----------
    drive : NamedTuple
    course : ndarray of shape ``(COURSE_LENGTH,)``
        See :func:`follow`.
    t : float
        Time, s.

    Returns
    -------
    tuple of float
        As for :func:`turn`; equal to it but for rounding.
    """
    s = t - course[0]
    if not 0.0 <= s <= course[1]:
        return turn(drive, t)
    theta, omega, half_epsilon = course[COURSE_ORDER + 2], 0.0, 0.0
    for k in range(COURSE_ORDER + 1, 1, -1):
        half_epsilon = half_epsilon * s + omega
        omega = omega * s + theta
        theta = theta * s + course[k]
    return theta, omega, 2.0 * half_epsilon


@turn_near.implements(Still, Constant, Table)
def _turn_itself(drive, course, t):
    # These drives are as fast as a series.
    return turn(drive, t)


@hook(optional=True)
def beginning(drive):
    """First time at which the drive has a Taylor series, s. By default 0; later if the drive is singular at 0."""
    return 0.0


@beginning.implements(Power)
def _after_zero(drive):
    return _POWER_BEGINNING


@hook(optional=True)
def top_speed(drive):
    """Size of the terms in the speed of the drive at t = 0, in the units of :func:`turn`: its rounding scales with it.

    By default the speed at t = 0.
    """
    return abs(turn(drive, 0.0)[1])


@top_speed.implements(Sinusoidal)
def _greatest_speed(drive):
    # At an extreme of the angle the computed speed is the rounding of a cosine, not zero.
    return abs(2.0 * pi * drive.frequency * drive.amplitude)


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
        By default infinite: the drive does not repeat.
    """
    return inf


@period.implements(Sinusoidal)
def _rocking_period(drive):
    rocks = (drive.frequency > 0.0) & (drive.amplitude != 0.0)
    return np.where(rocks, 1.0 / np.where(rocks, drive.frequency, 1.0), inf)


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
    difference = velocity - turn(drive, 0.0)[1]
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
    before, acceleration = turn(drive, 0.0)[1:3]
    if velocity == 0.0 and abs(acceleration) < inf:
        return 0.0
    return velocity - (turn(drive, beginning(drive))[1] - before)


#: Functions of a drive that methods with a constant step need, and those that the other methods need.
CONSTANT_STEP_MEMBERS = (shape, turn, lookup)
MEMBERS = (turn, expand, jerk, next_knot, turn_near, beginning, top_speed)

#: Drives by the name that the configuration gives them.
DRIVES: dict[str, type] = {
    "none": Still,
    "constant": Constant,
    "arctan": Arctan,
    "power": Power,
    "sinusoidal": Sinusoidal,
    "table": Table,
}


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
    if missing := lacking(drive, (shape, *MEMBERS)):
        raise TypeError(f"drive {name} has no {', '.join(missing)}: every drive needs it, before add_drive is called")
    if DRIVES.setdefault(name, drive) is not drive:
        raise TypeError(f"there is a drive {name} already: choose another name")
