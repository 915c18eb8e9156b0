"""Growth of small disturbances of a motion: Floquet multipliers of a lap, and the Lyapunov exponent.

A *lap* is one period of the motion, see :mod:`ringsweep.models.cycles`; a *block* is a stretch of time over which
growth is averaged, so that the scatter of the blocks gives the error. A matrix is a tuple, row by row; `vector` in
the helpers gives only the length of a row. Records of models call :func:`undisturbed`, :func:`enter`,
:func:`advance`, :func:`switched` and :func:`observed` in this order.
"""

from __future__ import annotations

from math import acos, atan2, cos, exp, inf, isnan, log, nan, pi, sqrt
from typing import Any, NamedTuple

from ringsweep.compile import feature, inlined, replacing, unrolled
from ringsweep.numerics.collocation import stored, transition
from ringsweep.numerics.terms import joined

#: Outcomes of a run whose exponent is asked for, after the others.
OUTCOMES = (
    *("lyapunov", "lyapunov_error", "multiplier_1", "multiplier_2"),
    *("multiplier_angle_1", "multiplier_angle_2"),
)

#: Share of the span after which the exponent is measured, and number of blocks of the rest.
_SKIPPED, _BLOCKS = 0.25, 24

# Eigenvalues of a flow that contracts or expands by more than this share are not known.
_LEAST = 1e-100

# Relative error of an exponent of a body that rests.
_COLLOCATION = 1e-6

# Rounding of the logarithm of the growth between two observations.
_ROUNDING = 2.0**-52


class Flow(NamedTuple):
    """Derivative of a state by an earlier one: the matrix, row by row, and the logarithm of its determinant.

    The logarithm is summed up on its own, since a matrix that contracts much in one direction does not show how much.
    """

    matrix: Any
    log_determinant: float


class Blocks(NamedTuple):
    """Rates of growth of the blocks up to now.

    Attributes
    ----------
    number, mean, squares : float
        Number, mean (1/s) and sum of the squared deviations from the mean (1/s^2).
    first_t, first_growth, t, growth : float
        Time, s, and growth of the disturbance at the beginning of the first block and of the present one.
    until : float
        Time from which the present block may end, s.
    """

    number: float
    mean: float
    squares: float
    first_t: float
    first_growth: float
    t: float
    growth: float
    until: float


class Multipliers(NamedTuple):
    """Floquet multipliers of the last lap that returned; NaN before.

    Attributes
    ----------
    first, second : float
        The two largest magnitudes.
    angle_1, angle_2 : float
        Their arguments, rad; of a pair the positive one is the first.
    rate_1, rate_2 : float
        Logarithms of the magnitudes over the period, 1/s.
    change_1, change_2 : float
        How much the rates differ from those of the lap before, or half of what this was for the lap before, 1/s: among
        changes that are but rounding, one may be small by chance.
    """

    first: float
    second: float
    angle_1: float
    angle_2: float
    rate_1: float
    rate_2: float
    change_1: float
    change_2: float


class Tangent(NamedTuple):
    """Disturbances of a run.

    Attributes
    ----------
    lap : Flow
        From the beginning of the present lap to the last observation.
    step : Flow
        Since the last observation.
    vector : tuple of float
        A disturbance at the last observation, of length 1.
    growth : float
        Logarithm of its growth.
    observations : float
        Number of the observations of which it is the sum.
    blocks : Blocks
    rates, entry : tuple of float
        Rates of the state at the end of the last interval, and at the beginning of the present step.
    gradient : tuple of float
        Gradient of the guard that has vanished since the last interval over its rate, s per unit of the state; 0
        without an event. Of several events at one instant the first one counts, since no mode lasts between them.
    keeps : tuple of float
        1 if the mode keeps disturbances of the place, else 0; and those of the sliding velocity.
    multipliers : Multipliers
    """

    lap: Flow
    step: Flow
    vector: Any
    growth: float
    observations: float
    blocks: Blocks
    rates: Any
    entry: Any
    gradient: Any
    keeps: tuple[float, float]
    multipliers: Multipliers


_entered, _advanced = replacing("entry", "keeps"), replacing("step", "rates", "gradient")
_with_gradient, _with_blocks = replacing("gradient"), replacing("blocks")


# ---- matrices -----------------------------------------------------------------------------------


@unrolled
def _product(length, vector, a, b):
    """Product of two square matrices; `vector` has as many numbers as they have rows."""
    n = range(length)
    entries = (" + ".join(f"a[{i * length + k}] * b[{k * length + j}]" for k in n) for i in n for j in n)
    return ["return " + ", ".join(entries)]


@unrolled
def _applied(length, vector, a):
    """Product of the matrix `a` and a vector."""
    n = range(length)
    return ["return " + ", ".join(" + ".join(f"a[{i * length + k}] * vector[{k}]" for k in n) for i in n)]


@unrolled
def _unit(length, vector):
    """Unit matrix with as many rows as `vector` has numbers."""
    return ["return " + ", ".join(f"{float(i == j)}" for i in range(length) for j in range(length))]


@unrolled
def _scaled(length, vector, factor):
    """Vector times a number."""
    return ["return " + ", ".join(f"factor * vector[{i}]" for i in range(length))]


@unrolled
def _length(length, vector, frequency):
    """Length of a disturbance, m/s; see :class:`ringsweep.models.interface.variation.Exponent`."""
    squares = ("vector[1] * vector[1]" if i == 1 else f"(frequency * vector[{i}]) ** 2" for i in range(length))
    return ["return sqrt(" + " + ".join(squares) + ")"]


@unrolled
def _saltation(length, gradient, before, after, keeps):
    """Saltation matrix from the rates before and after an event, and the logarithm of its determinant.

    `keeps` are the factors on its first two rows.
    """
    lines = [f"jump{i} = after[{i}] - before[{i}]" for i in range(length)]
    entries = (
        f"{f'keeps[{i}] * ' if i < 2 else ''}({float(i == j)} + jump{i} * gradient[{j}])"
        for i in range(length)
        for j in range(length)
    )
    determinant = " + ".join(f"jump{i} * gradient[{i}]" for i in range(length))
    return [
        *lines,
        f"size = keeps[0] * keeps[1] * abs(1.0 + {determinant})",
        "return (" + ", ".join(entries) + "), log_size(size)",
    ]


@inlined
def log_size(x):
    """Natural logarithm of the size of a disturbance; that of 0 is minus infinity."""
    return log(x) if x > 0.0 else -inf


@unrolled
def _eigenvalues(length, vector, matrix, log_determinant):
    """``(first, second, log_1, log_2, angle_1, angle_2)`` of the two largest eigenvalues, by magnitude."""
    return [f"return {'_eigenvalues_of_two' if length == 2 else '_eigenvalues_of_three'}(matrix, log_determinant)"]


@inlined
def _eigenvalues_of_two(matrix, log_determinant):
    """What :func:`_eigenvalues` returns, for a matrix of 2 rows."""
    # No mode of a motion turns the plane of its states over: real eigenvalues have one sign.
    a, b, c, d = matrix
    half, root = 0.5 * (a + d), 0.25 * (a - d) ** 2 + b * c
    if root < 0.0:
        size, angle = exp(0.5 * log_determinant), atan2(sqrt(-root), half)
        return size, size, 0.5 * log_determinant, 0.5 * log_determinant, angle, -angle
    first = abs(half) + sqrt(root)
    log_1 = log_size(first)
    log_2 = log_determinant - log_1 if first > 0.0 else -inf
    angle, second = _angle(half), exp(log_2)
    return first, second, log_1, log_2, angle, angle if second > 0.0 else 0.0


@inlined
def _angle(x):
    """Argument of a real number; 0 of zero."""
    return pi if x < 0.0 else 0.0


@inlined
def _eigenvalues_of_three(matrix, log_determinant):
    """What :func:`_eigenvalues` returns, for a matrix of 3 rows, whose least eigenvalue is left out."""
    a, b, c, d, e, f, g, h, i = matrix
    minors = a * e - b * d + a * i - c * g + e * i - f * h
    determinant = a * (e * i - f * h) - b * (d * i - f * g) + c * (d * h - e * g)
    first, second, angle_1, angle_2 = _of_cubic(a + e + i, minors, determinant)
    return first, second, log_size(first), log_size(second), angle_1, angle_2


@inlined
def _of_cubic(trace, minors, determinant):
    """``(first, second, angle_1, angle_2)`` of the largest roots of ``x^3 - trace x^2 + minors x - determinant``."""
    third = trace / 3.0
    p, q = minors - trace * third, (minors - 2.0 * third * third) * third - determinant
    discriminant = 0.25 * q * q + p * p * p / 27.0
    if discriminant > 0.0:
        u = sqrt(discriminant) + 0.5 * abs(q)
        u = u ** (1.0 / 3.0)
        real = third + (p / (3.0 * u) - u if q > 0.0 else u - p / (3.0 * u))
        pair = sqrt(abs(minors - real * (trace - real)))
        half = 0.5 * (trace - real)
        angle = atan2(sqrt(max(pair * pair - half * half, 0.0)), half)
        if pair > abs(real):
            return pair, pair, angle, -angle
        return abs(real), pair, _angle(real), angle
    radius = 2.0 * sqrt(max(-p / 3.0, 0.0))
    turn = acos(min(max(-4.0 * q / radius**3, -1.0), 1.0)) / 3.0 if radius > 0.0 else 0.0
    x = third + radius * cos(turn)
    y = third + radius * cos(turn - 2.0 * pi / 3.0)
    z = third + radius * cos(turn + 2.0 * pi / 3.0)
    # x is the largest of the three, y the next, z the least.
    first, other = (x, z) if abs(x) >= abs(z) else (z, x)
    second = y if abs(y) > abs(other) else other
    return abs(first), abs(second), _angle(first), _angle(second)


# ---- the run ------------------------------------------------------------------------------------


@feature("()")
def undisturbed(asked, scene, t):
    """Tangent at the beginning of a run; an empty tuple if no exponent is asked for."""
    vector = asked.disturbance
    vector = _scaled(vector, 1.0 / _length(vector, asked.frequency))
    zero, unit = _scaled(vector, 0.0), Flow(_unit(vector), 0.0)
    blocks = Blocks(-1.0, 0.0, 0.0, t, 0.0, t, 0.0, _SKIPPED * scene.span)
    multipliers = Multipliers(nan, nan, nan, nan, nan, nan, inf, inf)
    return Tangent(unit, unit, vector, 0.0, 0.0, blocks, zero, zero, zero, (1.0, 1.0), multipliers)


@inlined
def enter(tangent, keeps, rates):
    """Tangent at the beginning of a step, where the rates of the state are `rates`; `keeps` as in :class:`Tangent`."""
    return _entered(tangent, rates, keeps)


@inlined
def advance(tangent, h, rates, weights, work):
    """Tangent after an interval; see :func:`ringsweep.models.interface.variation.propagate`."""
    r = tangent
    step = r.step
    if r.keeps[0] * r.keeps[1] == 0.0 or _is_pending(r.gradient):
        salt, log_determinant = _saltation(r.gradient, r.rates, r.entry, r.keeps)
        step = Flow(_product(r.vector, salt, step.matrix), step.log_determinant + log_determinant)
    log_determinant = step.log_determinant + transition(len(r.vector), h, weights, work)
    step = Flow(_product(r.vector, stored(step.matrix, work), step.matrix), log_determinant)
    return _advanced(r, step, rates, _scaled(r.gradient, 0.0))


@inlined
def switched(tangent, gradient):
    """Tangent after an event, with the gradient of the guard over its rate."""
    return tangent if _is_pending(tangent.gradient) else _with_gradient(tangent, gradient)


@inlined
def rebounded(tangent, factor, gradient, rates):
    """Tangent after an event that multiplies the sliding velocity of a state by a factor.

    `rates` are those before the event, of the state that the event makes of it.
    """
    step = tangent.step
    step = Flow(_with_row_scaled(gradient, step.matrix, factor), step.log_determinant + log_size(abs(factor)))
    return _advanced(tangent, step, rates, gradient)


@unrolled
def _with_row_scaled(length, vector, matrix, factor):
    """Matrix with its second row multiplied by a factor; `vector` as in :func:`_product`."""
    n = range(length * length)
    return ["return " + ", ".join(f"factor * matrix[{k}]" if k // length == 1 else f"matrix[{k}]" for k in n)]


@unrolled
def _is_pending(length, gradient):
    """Whether an event awaits its saltation: the gradient of its guard is not zero."""
    return ["return " + " or ".join(f"gradient[{i}] != 0.0" for i in range(length))]


@feature("tangent", absorb=True)
def observed(tangent, scene, before, cycles, t, duration):
    """Tangent after an observation, from the cycles before and after it."""
    r = tangent
    lap = Flow(_product(r.vector, r.step.matrix, r.lap.matrix), r.lap.log_determinant + r.step.log_determinant)
    vector = _applied(r.vector, r.step.matrix)
    length = _length(vector, scene.asked.frequency)
    growth = r.growth + log_size(length)
    vector = _scaled(vector, 1.0 / length) if length > 0.0 else r.vector
    unit = Flow(_unit(vector), 0.0)
    multipliers = r.multipliers
    at_end = t - cycles.last.t <= 0.5 * duration
    if cycles.reference.t != before.reference.t:
        # The lap ends at the end of this interval, or at its beginning.
        whole = lap if at_end else r.lap
        lap = unit if at_end else r.step
        if not isnan(cycles.period):
            share = cycles.lap / (before.since + (cycles.count - before.count))
            multipliers = _multipliers(vector, whole, share, cycles.period, r.multipliers)
    forced = scene.forcing_period < inf
    ends = not forced or (at_end and cycles.count != before.count)
    blocks = _blocks(r.blocks, scene.span, t, growth, ends)
    return Tangent(
        lap, unit, vector, growth, r.observations + 1.0, blocks, r.rates, r.entry, r.gradient, r.keeps, multipliers
    )


@inlined
def _change(rate, earlier, change):
    """A ``change`` of :class:`Multipliers`, 1/s, from the rates of two laps and the `change` before."""
    now = abs(rate - earlier) if rate != earlier else 0.0
    return max(now, 0.5 * change) if change < inf else now


@inlined
def _multipliers(vector, flow, share, period, earlier):
    """Multipliers of a motion of this period, s.

    `flow` covers ``1/share`` laps; `earlier` are the multipliers of the lap before.
    """
    first, second, log_1, log_2, angle_1, angle_2 = _eigenvalues(vector, flow.matrix, flow.log_determinant)
    rate_1, rate_2 = share * log_1 / period, share * log_2 / period
    if share != 1.0:
        # The argument of a root is not unique.
        angle_1, angle_2 = nan if first > 0.0 else 0.0, nan if second > 0.0 else 0.0
    change_1 = _change(rate_1, earlier.rate_1, earlier.change_1)
    change_2 = _change(rate_2, earlier.rate_2, earlier.change_2)
    return Multipliers(first**share, second**share, angle_1, angle_2, rate_1, rate_2, change_1, change_2)


@inlined
def _blocks(b, span, t, growth, ends):
    """Blocks up to now. In a forced motion they end with a period of the forcing (`ends`), unless it is long."""
    width = (1.0 - _SKIPPED) * span / _BLOCKS
    # Where blocks end with periods of the forcing, rounding does not decide with which one.
    if t < b.until * (1.0 - 1e-12) or not (ends or t >= b.until + width):
        return b
    until = _SKIPPED * span + width * (b.number + 2.0)
    if b.number < 0.0:
        return Blocks(0.0, 0.0, 0.0, t, growth, t, growth, until)
    rate, number = (growth - b.growth) / (t - b.t), b.number + 1.0
    mean = b.mean + (rate - b.mean) / number
    return Blocks(
        number, mean, b.squares + (rate - b.mean) * (rate - mean), b.first_t, b.first_growth, t, growth, until
    )


@feature("0.0")
def largest_multiplier(tangent):
    """Largest multiplier of the last lap that returned; 0 if it is not known."""
    return 0.0 if isnan(tangent.multipliers.first) else tangent.multipliers.first


@feature("(nan, nan)")
def exponent(tangent):
    """Largest exponent up to now and its standard error, 1/s; NaN if it is not known."""
    b = tangent.blocks
    if b.number <= 1.0:
        return nan, nan
    duration = b.t - b.first_t
    error = sqrt(b.squares / (b.number * (b.number - 1.0))) + _ROUNDING * tangent.observations / duration
    return (b.growth - b.first_growth) / duration, error


@feature("tangent")
def at_rest(tangent, duration):
    """Tangent with one block: the present lap, of this duration (s), if the body has rested all the time."""
    first, _, log_1, _, _, _ = _eigenvalues(tangent.vector, tangent.lap.matrix, tangent.lap.log_determinant)
    if duration > 0.0 and _LEAST < first < 1.0 / _LEAST:
        # The flow of one Jacobian has its exponents, however a disturbance swings.
        rate = log_1 / duration
        squares = 2.0 * (_COLLOCATION * rate) ** 2
        return _with_blocks(tangent, Blocks(2.0, rate, squares, 0.0, 0.0, duration, log_1, inf))
    return tangent


@feature("outcome")
def with_exponent(tangent, outcome, period, scene):
    """Outcome of a run of this period, s, with exponent, its error and multipliers."""
    m = tangent.multipliers
    rate, error = exponent(tangent)
    rounding = _ROUNDING * tangent.observations / scene.span
    if isnan(period) or isnan(m.first):
        return joined(outcome, (rate, error, nan, nan, nan, nan))
    if scene.forcing_period == inf:
        # A shift in time neither grows nor decays, and says nothing.
        rate, error = m.rate_2, m.change_2 + rounding
    elif m.first > 0.0 or isnan(rate):
        # The mean of the blocks still holds the approach to the periodic motion. What is left of it shrinks by the
        # multiplier in each lap, and so do the changes.
        rate, error = m.rate_1, (m.change_1 / (1.0 - m.first) if m.first < 1.0 else m.change_1) + rounding
    return joined(outcome, (rate, error, m.first, m.second, m.angle_1, m.angle_2))
