"""Power series within a step: evaluation, size of the step, roots.

A series is an array of coefficients: ``c[0] + c[1] s + c[2] s^2 + ...`` with s the time since the step began.

`h` is the length of a step, s. ORDER is the highest power. `work` is an array of shape ``(STACK, columns)`` whose
contents may be lost; instants are stored in ``work[0]``.
"""

from __future__ import annotations

from math import comb, exp, inf, log, sqrt

import numpy as np

from ringsweep.compile import absorbed, inlined
from ringsweep.numerics.terms import (
    NUMBERS,
    ORDER,
    least,
    numbers_from,
    powers,
    set_terms,
    sign_changes,
    terms,
    total,
)

#: ``INVERSE[k]`` is 1/k: multiplication is many times cheaper than division.
INVERSE = np.array([np.inf, *(1.0 / k for k in range(1, ORDER + 3))])

# Weights of the terms in the second derivative.
_IN_BEND = NUMBERS * (NUMBERS - 1.0)

# Weights of the terms in bounds on the terms above the second power: of a series, and of its derivative.
_ABOVE = np.where(NUMBERS > 2.0, 1.0, 0.0)
_ABOVE_IN_SLOPE = NUMBERS * _ABOVE

# Binomial coefficients, which are exact: of ORDER and k; row k - 1 of the second has those of j and k.
_CHOOSE = np.array([float(comb(ORDER, k)) for k in range(1, ORDER + 1)])
_CHOOSE_ALL = np.array([float(comb(j, k)) for k in range(1, ORDER + 1) for j in range(1, ORDER + 1)])

# Weights of coefficient j in the Bernstein basis in coefficients 1 ... ORDER of the left and of the right half, row by
# row for j = 0 ... ORDER; exact.
_LEFT_HALF = np.array([comb(k, j) / 2.0**k for j in range(ORDER + 1) for k in range(1, ORDER + 1)])
_RIGHT_HALF = np.array(
    [comb(ORDER - k, ORDER - j) / 2.0 ** (ORDER - k) for j in range(ORDER + 1) for k in range(1, ORDER + 1)]
)

#: Rows of the scratch array for :func:`crossings` and :func:`first_root`.
STACK = 54

# Largest number of instants in a step; a convergent series has far fewer.
_MAX_INSTANTS = ORDER


@absorbed
def value(c, s):
    """Value of the series at `s`."""
    return c[0] + s * total(terms(c) * powers(s))


@absorbed
def slope(c, s):
    """Derivative of the series at `s`."""
    return total(terms(c) * powers(s) * numbers_from(NUMBERS, 0))


@inlined
def differentiate(row, derivative):
    """Fill the row `derivative` with the derivative of a series."""
    for k in range(ORDER):
        derivative[k] = (k + 1.0) * row[k + 1]
    derivative[ORDER] = 0.0


@inlined
def divide_by_time(c, least):
    """Divide a series in place by the power of the time up to which it is zero, and return this power.

    A guard that is zero as a mode begins vanishes again where the quotient does. The first `least` coefficients count
    as zero. The power of a series that stays zero exceeds ORDER.
    """
    power = least
    while power <= ORDER and c[power] == 0.0:
        power += 1
    for k in range(ORDER + 1 if power > 0 else 0):
        c[k] = c[k + power] if k + power <= ORDER else 0.0
    return power


@inlined
def step_size(last, previous):
    """Longest step within which the last two terms of a series stay within the tolerance, s.

    Parameters
    ----------
    last, previous : float
        Magnitudes of the coefficients of the powers ORDER and ORDER - 1, each divided by the tolerance.
    """
    steepness = -inf
    if last > 0.0:
        steepness = log(last) / ORDER
    if previous > 0.0:
        steepness = max(steepness, log(previous) / (ORDER - 1))
    return exp(-steepness)


@inlined
def step_within(c, units):
    """Longest step within which the last two terms of several series stay within their tolerances, s.

    Parameters
    ----------
    c : ndarray of shape ``(rows, columns)``
        Table of series.
    units : tuple of tuple
        Row, and reciprocal of its tolerance, for each series.
    """
    last = previous = 0.0
    for row, unit in units:
        last = max(last, abs(c[row, ORDER]) * unit)
        previous = max(previous, abs(c[row, ORDER - 1]) * unit)
    return step_size(last, previous)


@absorbed
def variation(c, h):
    """Upper bound on the change of a series within a step of length `h`."""
    return h * total(abs(terms(c)) * powers(h))


@inlined
def bounds_within(c, h):
    """Lower and upper bound on a series within a step of length `h`, s.

    The extremes of the first three terms are exact; the others count with their magnitudes.
    """
    rest = h * total(abs(terms(c)) * powers(h) * numbers_from(_ABOVE, 0))
    linear, square = c[1] * h, c[2] * h * h
    turn = end = linear + square
    if linear * (end + square) < 0.0:
        turn = -0.25 * linear * linear / square
    return c[0] + min(0.0, min(end, turn)) - rest, c[0] + max(0.0, max(end, turn)) + rest


@inlined
def first_root(c, h, work):
    """First zero in (0, h] of a series that is positive at 0.

    Cheap bounds answer most calls. The others are answered in the Bernstein basis, where the number of sign changes
    bounds the number of roots: bisection isolates the first root, and misses none, however close two roots are.

    Parameters
    ----------
    c : ndarray of shape ``(ORDER + 1,)``
        Series; infinite ``c[0]`` stands for a quantity that has no zero.
    h : float
        Length of the step, s.
    work : ndarray of shape ``(rows, COLUMNS)``
        Scratch. With fifty rows an interval can shrink to rounding.

    Returns
    -------
    tuple
        ``(s, found)``: the zero and True, or `h` and False if there is none.
    """
    if c[0] == inf:
        return h, False
    sizes = abs(terms(c)) * powers(h)
    if c[0] > h * total(sizes):
        return h, False
    rest, rest_slope = h * total(sizes * numbers_from(_ABOVE, 0)), h * total(sizes * numbers_from(_ABOVE_IN_SLOPE, 0))
    linear, square = c[1] * h, c[2] * h * h
    # Minimum within the step of the parabola of the first three terms.
    least = c[0] + min(0.0, linear + square)
    if linear < 0.0 and -linear < 2.0 * square:
        least = c[0] - 0.25 * linear * linear / square
    if least > rest:
        return h, False
    steepness = linear + 2.0 * square
    if linear * steepness > 0.0 and min(abs(linear), abs(steepness)) > rest_slope:
        if value(c, h) > 0.0:
            return h, False
        return _root_in_bracket(c, 0.0, h), True
    # Often the series falls all the way to a little beyond the zero of the parabola. The share of the step up to there:
    end = 1.25 * _zero_of_parabola(c[0], linear, square)
    if end < 1.0 and max(linear, linear + 2.0 * square * end) < -rest_slope * end * end and value(c, end * h) <= 0.0:
        return _root_in_bracket(c, 0.0, end * h), True
    return _first_root_by_subdivision(c, h, work)


@absorbed
def _zero_of_parabola(constant, linear, square):
    """First positive zero of ``constant + linear s + square s^2``, of which `constant` is positive; or infinite."""
    discriminant = linear * linear - 4.0 * constant * square
    denominator = sqrt(max(discriminant, 0.0)) - linear
    return 2.0 * constant / denominator if discriminant >= 0.0 and denominator > 0.0 else inf


@inlined
def _root_in_bracket(c, low, high):
    """Only zero of a series that is positive at `low` and not at `high`: Halley's method with bisection."""
    s = _zero_of_parabola(c[0], c[1], c[2])
    if not (low < s < high):
        s = 0.5 * (low + high)
    before = inf
    for _ in range(80):
        parts = terms(c) * powers(s)
        f, rate, bend = (
            c[0] + s * total(parts),
            total(parts * numbers_from(NUMBERS, 0)),
            total(parts * numbers_from(_IN_BEND, 0)),
        )
        if f > 0.0:
            low = s
        else:
            high = s
        # `bend` is the second derivative times s.
        denominator = 2.0 * s * rate * rate - f * bend
        step = -2.0 * s * f * rate / denominator if denominator != 0.0 else inf
        # The error of a step shrinks like its third power. Small steps that shrink no more are rounding.
        size, rounding = abs(step), 1e-16 * high
        converges = before < inf and size * size * size * size <= rounding * before * before * before
        if converges or size <= 4.0 * rounding or (before < 1e-10 * high and size >= 0.5 * before):
            return min(max(s + step, low), high)
        new, before = s + step, size
        if not (low < new < high):
            # The next step tells nothing about how fast Halley's method converges.
            new, before = 0.5 * (low + high), inf
            if not (low < new < high):
                return new
        s = new
    return s


@inlined
def _first_root_by_subdivision(c, h, work):
    """First zero by bisection in the Bernstein basis; see :func:`first_root`."""
    b = work[0]
    b[0] = c[0]
    # A coefficient within rounding of zero may belong to a double root, which is at least 1e-7 steps wide.
    rounding = 1e-15 * (c[0] + variation(c, h))
    set_terms(b, terms(c) * powers(h) * h / numbers_from(_CHOOSE, 0))
    bernstein = b[1] * numbers_from(_CHOOSE_ALL, 0) + c[0]
    for k in range(2, ORDER + 1):
        bernstein = bernstein + b[k] * numbers_from(_CHOOSE_ALL, (k - 1) * ORDER)
    set_terms(b, bernstein)
    work[0, ORDER + 1], work[0, ORDER + 2] = 0.0, h
    top = 0
    # A stack of intervals; the leftmost one is on top.
    while top >= 0:
        b = work[top]
        start, width = b[ORDER + 1], b[ORDER + 2]
        changes = sign_changes(terms(b))
        if changes == 0 and least(terms(b)) > rounding:
            top -= 1
        elif changes == 1:
            return _root_in_bracket(c, start, start + width), True
        elif top + 1 >= len(work) or width <= (1e-15 if changes > 0 else 1e-7) * h:
            # Two roots closer than rounding: a graze. It counts as a zero if the series really reaches zero.
            if value(c, start + width) <= 0.0:
                return start + width, True
            top -= 1
        else:
            left, right = b[0] * numbers_from(_LEFT_HALF, 0), b[0] * numbers_from(_RIGHT_HALF, 0)
            for j in range(1, ORDER + 1):
                left = left + b[j] * numbers_from(_LEFT_HALF, j * ORDER)
                right = right + b[j] * numbers_from(_RIGHT_HALF, j * ORDER)
            top += 1
            half = work[top]
            half[0] = b[0]
            set_terms(half, left)
            set_terms(b, right)
            b[0] = half[ORDER]
            width *= 0.5
            half[ORDER + 1], half[ORDER + 2] = start, width
            b[ORDER + 1], b[ORDER + 2] = start + width, width
    return h, False


@inlined
def crossings(c, h, work, count):
    """Append to ``work[0]`` every sign change of a series in (0, h).

    Each root found is divided out of the series, so that the next root becomes the first.

    Parameters
    ----------
    c : ndarray of shape ``(ORDER + 1,)``
    h : float
        Length of the step, s.
    work : ndarray of shape ``(STACK, COLUMNS)``
        Row 0 holds instants, s; the other rows are scratch.
    count : int
        Number of instants already in row 0.

    Returns
    -------
    int
        New number of instants in row 0. They are not sorted.
    """
    bound = variation(c, h)
    if abs(c[0]) > bound or bound == 0.0:
        return count
    rest = work[1]
    low = 0
    while low < ORDER and c[low] == 0.0:
        low += 1
    sign = 1.0 if c[low] > 0.0 else -1.0
    for k in range(ORDER + 1):
        rest[k] = sign * c[k + low] if k + low <= ORDER else 0.0
    while count < _MAX_INSTANTS:
        root, found = first_root(rest, h, work[2:])
        if not found or root >= h:
            return count
        work[0, count] = root
        count += 1
        # Division by (root - s) from the highest power down, which is stable for a root within the step.
        carry = rest[ORDER]
        rest[ORDER] = 0.0
        for k in range(ORDER - 1, -1, -1):
            carry, rest[k] = rest[k] + root * carry, -carry
    return count


@inlined
def ascending(instants, count):
    """Sort the first `count` instants in place."""
    for i in range(1, count):
        x = instants[i]
        j = i
        while j > 0 and instants[j - 1] > x:
            instants[j] = instants[j - 1]
            j -= 1
        instants[j] = x
