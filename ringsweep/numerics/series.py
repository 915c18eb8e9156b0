"""Power series on a step: evaluation, size of the step, first root.

A series is a row of coefficients ``c[0], c[1], ...`` in the time since the step began.
"""

from __future__ import annotations

from math import exp, inf, log

import numpy as np

from ringsweep.compile import inlined

#: Highest power of every series.
ORDER = 16

#: 1/k: a product is many times cheaper than a quotient.
INVERSE = np.array([np.inf, *(1.0 / k for k in range(1, ORDER + 3))])

#: Rows of scratch for noting instants and isolating roots.
STACK = 54

# Instants that a step may note at most: far above what a convergent series can have.
_INSTANTS = ORDER


@inlined
def value(c, s):
    """Value of the series at `s`."""
    total = c[ORDER]
    for k in range(ORDER - 1, -1, -1):
        total = total * s + c[k]
    return total


@inlined
def slope(c, s):
    """Derivative of the series at `s`."""
    total = ORDER * c[ORDER]
    for k in range(ORDER - 1, 0, -1):
        total = total * s + k * c[k]
    return total


@inlined
def reach(last, previous):
    """Step at which the last two terms of a series, scaled by their tolerance, fall to one."""
    h = inf
    if last > 0.0:
        h = exp(-log(last) / ORDER)
    if previous > 0.0:
        h = min(h, exp(-log(previous) / (ORDER - 1)))
    return h


@inlined
def product(a, b, k):
    """Coefficient `k` of the product of two series."""
    total = 0.0
    for j in range(k + 1):
        total += a[j] * b[k - j]
    return total


@inlined
def variation(c, h):
    """Bound on how far the series strays from its first term within the step."""
    power = h
    total = 0.0
    for k in range(1, ORDER + 1):
        total += abs(c[k]) * power
        power *= h
    return total


@inlined
def _tails(c, h):
    """Bounds on what the terms beyond the second power add to the series, and to its derivative times `h`."""
    power = h * h
    value = slope = 0.0
    for k in range(3, ORDER + 1):
        power *= h
        term = abs(c[k]) * power
        value += term
        slope += k * term
    return value, slope


@inlined
def first_root(c, h, work):
    """First zero in (0, h] of a series that is positive at 0; `h` is returned with False if there is none.

    Cheap bounds settle most calls. What they leave open is settled in the Bernstein basis, where
    the number of changes of sign bounds the number of roots: halving the interval isolates the
    first one, and none can hide, however close two of them lie.

    Parameters
    ----------
    c : ndarray of shape ``(ORDER + 1,)``
    h : float
        Length of the step.
    work : ndarray of shape ``(rows, ORDER + 3)``
        Scratch; fifty rows let an interval shrink to rounding.

    Returns
    -------
    tuple
        ``(s, found)``
    """
    if c[0] == inf:
        return h, False
    rest, rest_slope = _tails(c, h)
    linear, square = c[1] * h, c[2] * h * h
    # Least value of the parabola that the first three terms make.
    least = c[0] + min(0.0, linear + square)
    if linear < 0.0 and -linear < 2.0 * square:
        least = c[0] - 0.25 * linear * linear / square
    if least > rest:
        return h, False
    steepness = linear + 2.0 * square
    if linear * steepness > 0.0 and min(abs(linear), abs(steepness)) > rest_slope:
        if value(c, h) > 0.0:
            return h, False
        return _bracketed(c, 0.0, h), True
    return _isolated(c, h, work)


@inlined
def _bracketed(c, low, high):
    """The one zero of a series that is positive at `low` and not at `high`: Newton, kept in the bracket."""
    s = 0.5 * (low + high)
    for _ in range(80):
        f = value(c, s)
        if f > 0.0:
            low = s
        else:
            high = s
        rate = slope(c, s)
        step = -f / rate if rate != 0.0 else inf
        new = s + step
        if not (low < new < high):
            new = 0.5 * (low + high)
        if abs(new - s) <= 4e-16 * high or not (low < new < high):
            return new
        s = new
    return s


@inlined
def _isolated(c, h, work):
    """First zero by subdivision in the Bernstein basis; see :func:`first_root`."""
    b = work[0]
    power, choose = 1.0, 1.0
    for k in range(ORDER + 1):
        b[k] = c[k] * power / choose
        power *= h
        choose = choose * (ORDER - k) / (k + 1.0)
    for level in range(1, ORDER + 1):
        for k in range(ORDER, level - 1, -1):
            b[k] += b[k - 1]
    work[0, ORDER + 1], work[0, ORDER + 2] = 0.0, h
    top = 0
    # A stack of intervals, the leftmost on top.
    while top >= 0:
        b = work[top]
        start, width = b[ORDER + 1], b[ORDER + 2]
        changes = 0
        positive = True
        for k in range(1, ORDER + 1):
            if (b[k] > 0.0) != positive:
                positive = not positive
                changes += 1
        if changes == 0:
            top -= 1
        elif changes == 1:
            return _bracketed(c, start, start + width), True
        elif top + 1 >= len(work) or width <= 1e-15 * h:
            # Two roots closer than rounding: a graze. Where it truly reaches zero it is taken.
            if value(c, start + width) <= 0.0:
                return start + width, True
            top -= 1
        else:
            left = work[top + 1]
            for k in range(ORDER + 1):
                left[k] = b[0]
                for m in range(ORDER - k):
                    b[m] = 0.5 * (b[m] + b[m + 1])
            # What is left in b is the right half.
            width *= 0.5
            left[ORDER + 1], left[ORDER + 2] = start, width
            b[ORDER + 1], b[ORDER + 2] = start + width, width
            top += 1
    return h, False


@inlined
def may_fall_below(c, h, level):
    """Whether a bound leaves room for the series to fall below `level` within the step."""
    return c[0] - variation(c, h) < level


@inlined
def crossings(c, h, work, count):
    """Note in ``work[0]`` every change of sign of a series in (0, h), behind `count` instants noted before.

    A root found is divided out, so that the next one becomes the first. Returns the new count.
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
    while count < _INSTANTS:
        root, found = first_root(rest, h, work[2:])
        if not found or root >= h:
            return count
        work[0, count] = root
        count += 1
        # Division by (root - s), from the highest power down: stable for a root within the step.
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
