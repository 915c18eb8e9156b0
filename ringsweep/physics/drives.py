"""Laws by which the ring (or the belt) is driven.

Every law is an amplitude times a shape, :math:`\\theta(t) = A\\, s(t)`. Shapes do not depend on the
amplitude, so cells that differ only in it share one table of the drive.

To add a drive: a ``NamedTuple`` with its shape's parameters, a body for each hook below, a line
in ``DRIVES``.
"""

from __future__ import annotations

from math import atan, cos, inf, log1p, pi, sin
from typing import Annotated, Any, NamedTuple

from ringsweep.compile import hook, inlined, lacking
from ringsweep.quantities.parameters import Leaf, Parameter


class Still(NamedTuple):
    """No drive: the ring is at rest."""


class Constant(NamedTuple):
    """Constant angular velocity: :math:`s = t`."""

    amplitude: Annotated[Leaf, Parameter("rad/s", "angular velocity of the ring")]


class Arctan(NamedTuple):
    """Smooth run-up (the paper's h): :math:`s = t \\arctan t - \\tfrac12 \\ln(1 + t^2)`."""

    amplitude: Annotated[float, Parameter("rad/s", "amplitude of the ring's angular velocity")]


class Power(NamedTuple):
    """Power law: :math:`s = t^n`; for n < 2 the acceleration is infinite at t = 0."""

    amplitude: Annotated[float, Parameter("", "angle of the ring after one second")]
    exponent: Annotated[float, Parameter("1", "exponent of the power law", lower=1.0)]


class Sinusoidal(NamedTuple):
    """Rocking ring: :math:`s = \\sin(2 \\pi f t + \\psi)`."""

    amplitude: Annotated[float, Parameter("rad", "amplitude of the rocking angle")]
    frequency: Annotated[float, Parameter("Hz", "frequency of rocking", lower=0.0)]
    phase: Annotated[float, Parameter("rad", "phase of rocking at t = 0", default=0.0)]


class Table(NamedTuple):
    """Measured angle: a cubic spline through (time, angle), hence smooth to second order."""

    amplitude: Annotated[float, Parameter("1", "factor on the measured angle", default=1.0)]
    knots: Any
    coefficients: Any


class Scaled(NamedTuple):
    """What is left of a drive where its shape is tabulated."""

    amplitude: Any


def scaled(drive: Any) -> Any:
    """A drive without its shape: all that :func:`lookup` needs."""
    return Scaled(drive.amplitude) if hasattr(drive, "amplitude") else drive


# A power law has no series at t = 0. What happens before this time is below rounding.
_BEGINNING = 1e-14


@hook
def shape(drive, t):
    """Shape of the drive and its first two derivatives at time `t` (s)."""


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
    """Index of the spline piece that holds `t`; the outer pieces extend to infinity."""
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
    """Angle of the ring and its first two derivatives at time `t` (s); rad, rad/s, rad/s^2."""
    theta, omega, epsilon = shape(drive, t)
    a = drive.amplitude
    # An amplitude of zero stills a drive whose acceleration is infinite.
    return a * theta, a * omega, a * epsilon if a != 0.0 else 0.0


@turn.implements(Still)
def _no_turn(drive, t):
    return 0.0, 0.0, 0.0


@hook(absorb=True, optional=True)
def lookup(drive, table, k):
    """Angle (rad) and angular velocity (rad/s) of the drive from row `k` of a table of its shape."""
    return drive.amplitude * table[k, 0], drive.amplitude * table[k, 1]


@lookup.implements(Still)
def _no_lookup(drive, table, k):
    return 0.0, 0.0


@hook
def expand(drive, t, order, theta):
    """Taylor series of the drive's angle about time `t`.

    Parameters
    ----------
    drive : NamedTuple
        One of ``DRIVES``.
    t : float
        Time, s.
    order : int
        Highest power.
    theta : ndarray of shape ``(order + 1,)``
        Filled with the coefficients, rad/s^k.
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
    t = max(t, _BEGINNING)
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
    """Time after `t` (s) beyond which no series about `t` holds, as where the drive is not smooth; infinite if none."""
    return inf


@next_knot.implements(Power)
def _within_convergence(drive, t):
    # About t a series reaches back to the singularity at 0, and as far ahead. Steps that this bounds are the same at
    # all tolerances, which tell nothing of their error then: a fifth of the way leaves 1e-12.
    return inf if drive.exponent % 1.0 == 0.0 else 1.2 * max(t, _BEGINNING)


@next_knot.implements(Table)
def _next_knot(drive, t):
    j = _piece(drive.knots, t)
    return drive.knots[j + 1] if j + 2 < len(drive.knots) else inf


@hook
def jerk(drive, t):
    """Third derivative of the ring's angle at time `t` (s), rad/s^3."""


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
    return drive.amplitude * n * (n - 1.0) * (n - 2.0) * max(t, _BEGINNING) ** (n - 3.0)


@jerk.implements(Sinusoidal)
def _sinusoidal_jerk(drive, t):
    rate = 2.0 * pi * drive.frequency
    return -drive.amplitude * rate**3 * cos(rate * t + drive.phase)


@jerk.implements(Table)
def _table_jerk(drive, t):
    return 6.0 * drive.amplitude * drive.coefficients[_piece(drive.knots, t)][0]


@hook(optional=True)
def beginning(drive):
    """Time at which the drive's series can begin, s: 0 unless it is singular there."""
    return 0.0


@beginning.implements(Power)
def _after_zero(drive):
    return _BEGINNING


@hook(optional=True)
def top_speed(drive):
    """Speed by which the rounding of the drive's speed at t = 0 is measured: by default that speed itself."""
    return abs(turn(drive, 0.0)[1])


@top_speed.implements(Sinusoidal)
def _greatest_speed(drive):
    # Where a rocking ring turns back its speed is the rounding of a cosine.
    return abs(2.0 * pi * drive.frequency * drive.amplitude)


# Speeds that differ by less than this share of them are the same but for rounding.
_SAME = 1e-15


@inlined
def relative(drive, speed):
    """Speed relative to the drive at t = 0, where that is not rounding; all in units of :func:`turn`."""
    difference = speed - turn(drive, 0.0)[1]
    return 0.0 if abs(difference) < _SAME * (abs(speed) + top_speed(drive)) else difference


@inlined
def launched(drive, velocity):
    """Velocity relative to the drive, of a body launched with `velocity` relative to it, where its series can begin.

    Both in units of :func:`turn`. At rest on a drive whose acceleration is finite at first, it stays there until then.
    """
    _, before, acceleration = turn(drive, 0.0)
    if velocity == 0.0 and abs(acceleration) < inf:
        return 0.0
    return velocity - (turn(drive, beginning(drive))[1] - before)


#: Functions that a solver of constant step needs of a drive, and those that the others need.
CONSTANT_STEP_MEMBERS = (shape, turn, lookup)
MEMBERS = (turn, expand, jerk, next_knot, beginning, top_speed)

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
    """Make a drive known under a name.

    Raises
    ------
    TypeError
        If a function that a drive needs has no body for it, or if the name is taken.
    """
    if missing := lacking(drive, (shape, *MEMBERS)):
        raise TypeError(f"drive {name} has no {', '.join(missing)}: every drive needs one")
    if DRIVES.setdefault(name, drive) is not drive:
        raise TypeError(f"there is a drive {name} already: choose another name")
