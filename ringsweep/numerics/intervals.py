"""Interval arithmetic on expressions: bounds on a function, and on its derivatives, over whole intervals of the speed.

The bounds are rigorous: every operation rounds outwards. They are wider than the range of the function, because an
interval does not know that it stands in two places; narrow intervals of the speed have narrow bounds. See R. E. Moore,
R. B. Kearfott, M. J. Cloud, Introduction to Interval Analysis (SIAM, 2009).

Derivatives are those of the power series in the speed: coefficient `k` of a function on an interval bounds its `k`-th
derivative divided by k!.

None in place of an interval is zero, exactly. `partial` marks intervals on a part of which the function is not
defined. A series is a list of intervals, from the value up. :mod:`isolation` calls :class:`Enclosure`; nothing here
runs in kernels.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import cache
from itertools import chain, zip_longest
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ringsweep.numerics.expressions import (
    ONE,
    SPEED,
    ZERO,
    Node,
    negative,
    nodes_of,
    number,
    quotient_of,
    rebuilt,
    symbol,
)
from ringsweep.numerics.expressions import add as plus
from ringsweep.numerics.expressions import multiply as times

#: Numbers that are closer to zero count as zero where only a sign matters: rounding outwards leaves them behind.
VANISHING = 1e-250

# A greater exponential counts as constant: a number that is finite can only contain its reciprocal.
_LARGEST_EXPONENT, _HUGE = 690.0, 1e300

# Functions of the library of mathematics are right to this share.
_LIBRARY = 1e-15


class Interval(NamedTuple):
    """Intervals, one for each cell.

    Attributes
    ----------
    low, high : ndarray of shape ``(cells,)`` or ``()``
        Bounds; NaN where the function is defined nowhere. They are the same array if the number is exact.
    partial : ndarray of bool, optional
        Where the function may be undefined somewhere in the cell; None for nowhere.
    """

    low: Any
    high: Any
    partial: Any = None


#: Power series: a coefficient that is None is exactly zero.
Series = list[Interval | None]


def exact(value: Any) -> Interval:
    """Interval of one number."""
    value = np.asarray(value, dtype=np.float64)
    return Interval(value, value)


def _outward(low: Any, high: Any, partial: Any = None) -> Interval:
    """Interval between the next smaller and the next larger double."""
    return Interval(np.nextafter(low, -np.inf), np.nextafter(high, np.inf), partial)


def _either(a: Any, b: Any) -> Any:
    """Where one of two marks `partial` is set; None stands for nowhere."""
    return b if a is None else a if b is None else a | b


def add(a: Interval, b: Interval) -> Interval:
    """Sum."""
    return _outward(a.low + b.low, a.high + b.high, _either(a.partial, b.partial))


def multiply(a: Interval, b: Interval) -> Interval:
    """Product."""
    if a.low is a.high:
        a, b = b, a
    ends = (b.low,) if b.low is b.high else (b.low, b.high)
    products = [x * y for x in (a.low, a.high) for y in ends]
    low, high = products[0], products[0]
    for product in products[1:]:
        low, high = np.minimum(low, product), np.maximum(high, product)
    if np.isnan(low).any():
        # Zero times infinity is zero: a bound is infinite only where the number is finite and large.
        nowhere = np.isnan(a.low) | np.isnan(b.low)
        finite = [np.where(np.isnan(product), 0.0, product) for product in products]
        low, high = (np.where(nowhere, np.nan, choose.reduce(finite)) for choose in (np.minimum, np.maximum))
    return _outward(low, high, _either(a.partial, b.partial))


def square(a: Interval) -> Interval:
    """Square, never negative."""
    ends = abs(a.low), abs(a.high)
    least = np.where((a.low <= 0.0) & (a.high >= 0.0), 0.0, np.minimum(*ends))
    most = np.maximum(*ends)
    low, high, partial = _outward(least * least, most * most, a.partial)
    return Interval(np.maximum(low, 0.0), high, partial)


def inverse(a: Interval) -> Interval:
    """Reciprocal; unbounded where the interval contains zero."""
    low = np.where((a.low < 0.0) & (a.high >= 0.0), -np.inf, 1.0 / np.where(a.high == 0.0, 1.0, a.high))
    high = np.where((a.high > 0.0) & (a.low <= 0.0), np.inf, 1.0 / np.where(a.low == 0.0, 1.0, a.low))
    meets = (a.low <= 0.0) & (a.high >= 0.0)
    nowhere = (a.low == 0.0) & (a.high == 0.0)
    if nowhere.any():
        low, high = np.where(nowhere, np.nan, low), np.where(nowhere, np.nan, high)
    return _outward(low, high, _either(a.partial, meets if meets.any() else None))


def scaled(a: Interval, factor: float) -> Interval:
    """Product with a number."""
    return multiply(a, exact(factor))


def _monotone(function: Any, least: float = -np.inf, most: float = np.inf) -> Any:
    """Extension of an increasing function of the library of mathematics with values between two numbers."""

    def apply(a: Interval) -> Interval:
        # An overflow is no bound from below.
        low, high = np.minimum(function(a.low), np.finfo(np.float64).max), function(a.high)
        low, high, partial = _outward(
            low * (1.0 - np.sign(low) * _LIBRARY), high * (1.0 + np.sign(high) * _LIBRARY), a.partial
        )
        return Interval(np.clip(low, least, most), np.clip(high, least, most), partial)

    return apply


_exp, _tanh, _atan = _monotone(np.exp, 0.0), _monotone(np.tanh, -1.0, 1.0), _monotone(np.arctan)


def _on_domain(a: Interval) -> tuple[Any, Any, Any]:
    """Both bounds of the part of an interval that is not negative, and its mark `partial`."""
    cut = a.low < 0.0
    low = np.where(a.high < 0.0, np.nan, np.maximum(a.low, 0.0))
    return low, np.where(a.high < 0.0, np.nan, a.high), _either(a.partial, cut if cut.any() else None)


def _sqrt(a: Interval) -> Interval:
    """Square root of the part of an interval that is not negative."""
    low, high, partial = _on_domain(a)
    found = _outward(np.sqrt(low), np.sqrt(high), partial)
    return Interval(np.maximum(found.low, 0.0), found.high, partial)


def _log(a: Interval) -> Interval:
    """Logarithm of the part of an interval that is not negative."""
    low, high, partial = _on_domain(a)
    found = _monotone(np.log)(Interval(low, high, partial))
    at_zero = low == 0.0
    return Interval(found.low, found.high, _either(partial, at_zero if at_zero.any() else None))


def _power(a: Interval, exponent: Interval) -> Interval:
    """Power of the part of an interval that is not negative; of all of it if the exponent is whole."""
    low, high, partial = _on_domain(a)
    corners = [np.power(x, y) for x in (low, high) for y in (exponent.low, exponent.high)]
    least, most = np.minimum.reduce(corners), np.maximum.reduce(corners)
    whole = (exponent.low == exponent.high) & (exponent.low == np.floor(exponent.low))
    crosses = (a.low < 0.0) & whole
    if crosses.any():
        # Of a negative number only a whole power is defined.
        size = np.maximum.reduce([np.power(abs(x), exponent.low) for x in (a.low, a.high)])
        size = np.where((a.high >= 0.0) & (exponent.low < 0.0), np.inf, size)
        least, most = np.where(crosses, -size, least), np.where(crosses, size, most)
        partial = _either(a.partial, (a.low < 0.0) & (~whole | ((a.high >= 0.0) & (exponent.low < 0.0))))
    pole = (low == 0.0) & (exponent.low < 0.0)
    partial = _either(partial, pole if pole.any() else None)
    return _outward(least - 4.0 * _LIBRARY * abs(least), most + 4.0 * _LIBRARY * abs(most), partial)


def _extreme(choose: Any, a: Interval, b: Interval) -> Interval:
    """Minimum or maximum of two intervals; `choose` is ``np.minimum`` or ``np.maximum``."""
    return Interval(choose(a.low, b.low), choose(a.high, b.high), _either(a.partial, b.partial))


def _decay(a: Interval) -> Interval:
    """``1 - tanh(x)**2``, without cancellation."""
    sizes = abs(a.low), abs(a.high)
    near = np.where((a.low <= 0.0) & (a.high >= 0.0), 0.0, np.minimum(*sizes))
    ends = []
    for size in (np.maximum(*sizes), near):
        decayed = np.exp(-2.0 * size)
        ends.append(4.0 * decayed / (1.0 + decayed) ** 2)
    low, high, partial = _outward(ends[0] * (1.0 - 8.0 * _LIBRARY), ends[1] * (1.0 + 8.0 * _LIBRARY), a.partial)
    return Interval(np.maximum(low, 0.0), high, partial)


# ---- power series -----------------------------------------------------------------------------


def _sum(terms: list[Interval | None]) -> Interval | None:
    """Sum of intervals; None stands for zero."""
    found = None
    for term in terms:
        found = term if found is None else found if term is None else add(found, term)
    return found


def _product(a: Interval | None, b: Interval | None, factor: float = 1.0) -> Interval | None:
    """Product of two intervals and a number; None stands for zero."""
    if a is None or b is None:
        return None
    found = multiply(a, b)
    return found if factor == 1.0 else scaled(found, factor)


def _product_series(a: Series, b: Series) -> Series:
    """Power series of a product."""
    if a is not b:
        return [_sum([_product(a[j], b[k - j]) for j in range(k + 1)]) for k in range(len(a))]
    found = []
    for k in range(len(a)):
        terms = [_product(a[j], a[k - j], 2.0) for j in range((k + 1) // 2)]
        middle = a[k // 2] if k % 2 == 0 else None
        found.append(_sum([*terms, None if middle is None else square(middle)]))
    return found


def _minus(a: Interval | None) -> Interval | None:
    """Negative of an interval; None stands for zero."""
    return None if a is None else Interval(-a.high, -a.low, a.partial) if a.low is not a.high else exact(-a.low)


def _quotient_series(a: Series, b: Series) -> Series:
    """Power series of a quotient; that of the divisor begins with a number."""
    assert b[0] is not None
    per = inverse(b[0])
    found: Series = []
    for k in range(len(a)):
        rest = _sum([_product(b[j], found[k - j]) for j in range(1, k + 1)])
        found.append(_product(_sum([a[k], _minus(rest)]), per))
    return found


def _replaced(a: Interval | None, where: Any, value: float) -> Interval | None:
    """Interval with another value for both bounds where the condition holds."""
    return a if a is None else Interval(np.where(where, value, a.low), np.where(where, value, a.high), a.partial)


def _scaled_or_zero(a: Interval | None, k: float) -> Interval | None:
    """Interval times a number; None stands for zero."""
    return a if a is None or k == 1.0 else scaled(a, k)


def _series_of(node: Node, parts: list[Series], order: int) -> Series:
    """Power series of a node from those of its parts, with `order` + 1 coefficients."""
    a = parts[0]
    if node.kind == "add":
        return [_sum([x, y]) for x, y in zip(*parts, strict=True)]
    if node.kind == "multiply":
        return _product_series(a, a if node.parts[0] is node.parts[1] else parts[1])
    if node.kind == "divide":
        return _quotient_series(a, parts[1])
    inner = a[0] if a[0] is not None else exact(0.0)
    found: Series = [_VALUES[node.kind](inner, *(part[0] or exact(0.0) for part in parts[1:]))]
    function = rebuilt(node, list(_ARGUMENTS[: len(parts)]))
    above, below = quotient_of(function)
    known = {function: found, **dict(zip(_ARGUMENTS, parts, strict=False))}
    for k in range(1, order + 1):
        n, q = _among(above, known, k - 1), _among(below, known, k - 1)
        if node.kind == "tanh":
            n[0] = _decay(inner)
        assert q[0] is not None
        rate = _sum([_product(_scaled_or_zero(a[j], j), n[k - j]) for j in range(1, k + 1)])
        rest = _sum([_product(_scaled_or_zero(found[j], j), q[k - j]) for j in range(1, k)])
        term = _over(_sum([rate, _minus(rest)]), k)
        found.append(term if below is ONE else _product(term, inverse(q[0])))
    if node.kind == "exp" and (overflows := inner.low > _LARGEST_EXPONENT).any():
        return [_replaced(c, overflows, 0.0 if k else _HUGE) for k, c in enumerate(found)]
    return found


# What stands for the argument of a function, and for the exponent of a power.
_ARGUMENTS = SPEED, symbol("exponent")

#: Values of functions on an interval.
_VALUES = {"exp": _exp, "tanh": _tanh, "atan": _atan, "sqrt": _sqrt, "log": _log, "power": _power}


def _among(node: Node, known: Mapping[Node, Series], order: int) -> Series:
    """Power series of an expression whose nodes `known` have series, up to the power `order`."""
    if node in known:
        return known[node][: order + 1]
    if node.kind == "number":
        return [exact(node.value), *[None] * order]
    return _series_of(node, [_among(part, known, order) for part in node.parts], order)


def _over(a: Interval | None, k: int) -> Interval | None:
    """Interval divided by a positive whole number; None stands for zero."""
    return a if a is None or k == 1 else _outward(a.low / k, a.high / k, a.partial)


# Polynomials with more coefficients are not multiplied out.
_MOST_COEFFICIENTS = 9


@cache
def _polynomial(node: Node) -> list[Node] | None:
    """Coefficients of a polynomial of the speed, from the lowest power up; None if it is none."""
    if not node.varies:
        return [node]
    if node.kind == "variable":
        return [ZERO, ONE]
    if node.kind not in ("add", "multiply"):
        return None
    a, b = (_polynomial(part) for part in node.parts)
    if a is None or b is None or len(a) + len(b) > _MOST_COEFFICIENTS:
        return None
    if node.kind == "add":
        return [plus(*pair) for pair in zip_longest(a, b, fillvalue=ZERO)]
    found = [ZERO] * (len(a) + len(b) - 1)
    for i, x in enumerate(a):
        for j, y in enumerate(b):
            found[i + j] = plus(found[i + j], times(x, y))
    return found


@cache
def _numerator(node: Node) -> list[Node] | None:
    """Coefficients of ``a' b - a b'`` of a quotient of two polynomials a and b.

    Multiplied out, as here, most terms cancel each other; computed from intervals of a and b they would not.
    """
    a, b = (_polynomial(part) for part in node.parts)
    if a is None or b is None or len(a) == 1:
        return None
    width = max(len(a), len(b))
    a, b = ([*c, *[ZERO] * (width - len(c))] for c in (a, b))
    found = [ZERO] * max(2 * width - 3, 1)
    for i in range(width):
        for j in range(i):
            cross = plus(times(a[i], b[j]), negative(times(a[j], b[i])))
            found[i + j - 1] = plus(found[i + j - 1], times(number(i - j), cross))
    return found


class Enclosure:
    """Bounds on an expression and on its derivatives, for several sets of parameters.

    Parameters
    ----------
    output : Node
    values : mapping of str to ndarray of shape ``(rows,)``
        Values of the parameters.
    thresholds : sequence of ndarray of shape ``(rows,)``
        Speed of each threshold.
    """

    def __init__(
        self,
        output: Node,
        values: Mapping[str, NDArray[np.float64]],
        thresholds: Sequence[NDArray[np.float64]] = (),
    ) -> None:
        """Find the constant nodes once, and the quotients of polynomials: their slopes have bounds of their own."""
        self.output, self.thresholds = output, thresholds
        self.rows = len(next(iter(values.values()))) if values else 1
        found: dict[Node, Interval] = {}
        nodes = nodes_of(output)
        self.numerators = {
            node: coefficients
            for node in nodes
            if node.kind == "divide" and node.varies and (coefficients := _numerator(node)) is not None
        }
        nodes = nodes_of(output, *chain.from_iterable(self.numerators.values()))
        with np.errstate(all="ignore"):
            for node in nodes:
                if not node.varies:
                    found[node] = self._constant(node, found, values)
        self.nodes = [node for node in nodes if node.varies]
        needed = {part for node in self.nodes for part in node.parts if not part.varies} | {output}
        needed.update(chain.from_iterable(self.numerators.values()))
        self.constants = {node: found[node] for node in needed if not node.varies}

    @staticmethod
    def _constant(node: Node, found: Mapping[Node, Interval], values: Mapping[str, NDArray[np.float64]]) -> Interval:
        """Interval of a node that does not depend on the speed."""
        if node.kind == "number":
            return exact(node.value)
        if node.kind == "symbol":
            return exact(values[node.value])
        parts = [found[part] for part in node.parts]
        if node.kind in ("minimum", "maximum"):
            return _extreme(np.minimum if node.kind == "minimum" else np.maximum, *parts)
        series = _series_of(node, [[part] for part in parts], 0)[0]
        assert series is not None
        return series

    def size(self, row: NDArray[np.intp], speed: NDArray[np.float64], side: Any) -> NDArray[np.float64]:
        """Magnitude of the terms of a sum at a speed for each row, or else of the expression."""
        found = self._found(row, speed, speed, side, 0)
        terms = self.output.parts if self.output.kind == "add" else (self.output,)
        values = [found[term][0] or exact(0.0) for term in terms]
        sizes = [np.maximum(abs(value.low), abs(value.high)) for value in values]
        return np.broadcast_to(np.maximum.reduce(np.broadcast_arrays(*sizes)), len(row))

    def __call__(
        self, row: NDArray[np.intp], low: NDArray[np.float64], high: NDArray[np.float64], side: Any, order: int
    ) -> Series:
        """Power series of the expression on intervals of the speed.

        Parameters
        ----------
        row : ndarray of shape ``(cells,)``
            Set of parameters of each cell.
        low, high : ndarray of shape ``(cells,)``
            Bounds of the speed, m/s.
        side : ndarray of shape ``(cells,)``
            A speed, m/s: switches whose threshold is greater are on their lower side.
        order : int
            Highest power.
        """
        found = self._found(row, low, high, side, order)[self.output]
        return [None if c is None else _for_each_cell(c, len(row)) for c in found]

    def _found(self, row: Any, low: Any, high: Any, side: Any, order: int) -> dict[Node, Series]:
        """Power series of all nodes, with `order` + 1 coefficients; the arguments are those of a call."""
        found: dict[Node, Series] = {}
        empty: list[Interval | None] = [None] * order
        with np.errstate(all="ignore"):
            for node, constant in self.constants.items():
                found[node] = [_taken(constant, row), *empty]
            for node in self.nodes:
                if node.kind == "variable":
                    found[node] = [Interval(low, high), *[exact(1.0), *empty][:order]]
                    continue
                parts = [found[part] for part in node.parts]
                if node.kind == "switch":
                    below = side < self.thresholds[node.value][row]
                    found[node] = [_chosen(below, *pair) for pair in zip(*parts, strict=True)]
                else:
                    found[node] = _series_of(node, parts, order)
                if order and node in self.numerators:
                    coefficients = [found[c][0] for c in self.numerators[node]]
                    rate = _horner(coefficients, Interval(low, high), order - 1)
                    slope = _quotient_series(rate, _product_series(parts[1], parts[1])[:order])
                    found[node] = [found[node][0], *(_over(c, k + 1) for k, c in enumerate(slope))]
        return found


def _horner(coefficients: list[Interval | None], speed: Interval, order: int) -> Series:
    """Power series of a polynomial of the speed, of order `order`, by Horner's rule; None is a coefficient 0."""
    x = ([speed, exact(1.0)] + [None] * order)[: order + 1]
    found: Series = [None] * (order + 1)
    for coefficient in reversed(coefficients):
        found = _product_series(found, x)
        found[0] = _sum([found[0], coefficient])
    return found


def _taken(a: Interval, row: NDArray[np.intp]) -> Interval:
    """Bounds in the rows `row`; a constant without rows is the same in all."""
    if a.low.ndim == 0:
        return a
    low = a.low[row]
    high = low if a.low is a.high else a.high[row]
    return Interval(low, high, None if a.partial is None else np.broadcast_to(a.partial, a.low.shape)[row])


def _chosen(below: Any, a: Interval | None, b: Interval | None) -> Interval | None:
    """Interval `a` where `below` is true, else `b`; None stands for zero."""
    if a is None and b is None:
        return None
    a, b = (exact(0.0) if x is None else x for x in (a, b))
    partial = None
    if a.partial is not None or b.partial is not None:
        partial = np.where(below, *(False if x.partial is None else x.partial for x in (a, b)))
    return Interval(np.where(below, a.low, b.low), np.where(below, a.high, b.high), partial)


def _for_each_cell(a: Interval, cells: int) -> Interval:
    """Interval with bounds for each of so many cells."""
    partial = None if a.partial is None else np.broadcast_to(a.partial, cells)
    return Interval(np.broadcast_to(a.low, cells), np.broadcast_to(a.high, cells), partial)
