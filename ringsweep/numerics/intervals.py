"""Interval arithmetic on expressions: bounds on a function, and on its derivatives, over whole intervals of the speed.

The bounds are rigorous: every operation rounds outwards. They are wider than the range of the function, because an
interval does not know that it stands in two places; narrow intervals of the speed have narrow bounds. See R. E. Moore,
R. B. Kearfott, M. J. Cloud, Introduction to Interval Analysis (SIAM, 2009).

Bounds on a derivative are those of its expression, in a form in which as little as possible cancels. `partial` marks
intervals on a part of which the function is not defined. :mod:`isolation` calls :class:`Enclosure`; nothing here runs
in kernels.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from functools import cache, partial
from itertools import zip_longest
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ringsweep.numerics.expressions import (
    ONE,
    SPEED,
    ZERO,
    Node,
    derivative,
    divide,
    function,
    negative,
    nodes_of,
    number,
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


def _bounded_exp(a: Interval, beyond: float) -> Interval:
    """Exponential, which is `beyond` where it would be greater than a finite number."""
    low, high, partial = _monotone(np.exp, 0.0)(a)
    overflows = a.low > _LARGEST_EXPONENT
    return Interval(np.where(overflows, beyond, low), np.where(overflows, beyond, high), partial)


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


def _wave(function: Any, peak: float, a: Interval) -> Interval:
    """Sine or cosine, which is greatest at a share `peak` of a turn."""
    turns = [end / (2.0 * np.pi) - peak for end in (a.low, a.high)]
    slack = 4.0 * _LIBRARY * (1.0 + np.maximum(*map(abs, turns)))
    # An interval with no bound reaches all.
    tops, bottoms = (~(np.floor(turns[1] - shift + slack) < np.ceil(turns[0] - shift - slack)) for shift in (0.0, 0.5))
    ends = function(a.low), function(a.high)
    low, high, partial = _outward(np.minimum(*ends), np.maximum(*ends), a.partial)
    low, high = low - _LIBRARY * abs(low), high + _LIBRARY * abs(high)
    return Interval(np.where(bottoms, -1.0, np.maximum(low, -1.0)), np.where(tops, 1.0, np.minimum(high, 1.0)), partial)


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


#: Values on intervals, by the kind of a node. Beyond the rates of :data:`FUNCTIONS`, ``decay`` is that of tanh, and
#: ``growth`` that of exp.
_VALUES: dict[str, Callable[..., Interval]] = {
    "add": add,
    "multiply": multiply,
    "divide": lambda a, b: multiply(a, inverse(b)),
    "power": _power,
    "exp": partial(_bounded_exp, beyond=_HUGE),
    "growth": partial(_bounded_exp, beyond=0.0),
    "tanh": _monotone(np.tanh, -1.0, 1.0),
    "decay": _decay,
    "atan": _monotone(np.arctan),
    "sqrt": _sqrt,
    "log": _log,
    "log1p": lambda a: _log(add(a, exact(1.0))),
    "sin": partial(_wave, np.sin, 0.25),
    "cos": partial(_wave, np.cos, 0.0),
    "minimum": partial(_extreme, np.minimum),
    "maximum": partial(_extreme, np.maximum),
}


# ---- derivatives ------------------------------------------------------------------------------


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


def _quotient_rate(node: Node) -> Node | None:
    """Derivative of a quotient of two polynomials a and b, ``(a' b - a b') / b^2``; None of anything else.

    Multiplied out, as here, most terms of the dividend cancel each other; from intervals of a and b they would not.
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
    dividend = ZERO
    for coefficient in reversed(found):
        dividend = plus(times(dividend, SPEED), coefficient)
    return divide(dividend, times(node.parts[1], node.parts[1]))


@cache
def _narrow(node: Node) -> Node | None:
    """Derivative in a form with narrower bounds than those of the usual one, if there is one."""
    if node.kind == "divide":
        return _quotient_rate(node)
    inner = node.parts[0]
    factors = {
        "exp": lambda: function("growth", inner),
        "growth": lambda: node,
        "tanh": lambda: function("decay", inner),
        "decay": lambda: times(number(-2.0), times(function("tanh", inner), node)),
    }
    return times(factors[node.kind](), derivative(inner, _narrow)) if node.kind in factors else None


class Enclosure:
    """Bounds on an expression and on its derivatives, for several sets of parameters.

    Parameters
    ----------
    output : Node
    values : mapping of str to ndarray of shape ``(rows,)``
        Values of the parameters.
    thresholds : sequence of ndarray of shape ``(rows,)``
        Speed of each threshold, or the held number.
    """

    def __init__(
        self,
        output: Node,
        values: Mapping[str, NDArray[np.float64]],
        thresholds: Sequence[NDArray[np.float64]] = (),
    ) -> None:
        """Bounds on constants and derivatives are found once they are needed."""
        self.output, self.values, self.thresholds = output, values, thresholds
        self.rows = len(next(iter(values.values()))) if values else 1
        self._constants: dict[Node, Interval] = {}
        self._rates = [output]

    def size(self, row: NDArray[np.intp], speed: NDArray[np.float64], side: Any) -> NDArray[np.float64]:
        """Magnitude of the terms of a sum at a speed for each row, or else of the expression."""
        terms = self.output.parts if self.output.kind == "add" else (self.output,)
        values = self._found(row, speed, speed, side, terms)
        return np.maximum.reduce([np.maximum(abs(value.low), abs(value.high)) for value in values])

    def __call__(
        self, row: NDArray[np.intp], low: NDArray[np.float64], high: NDArray[np.float64], side: Any, order: int
    ) -> list[Interval]:
        """Bounds on the expression and on its derivatives on intervals of the speed.

        Parameters
        ----------
        row : ndarray of shape ``(cells,)``
            Set of parameters of each cell.
        low, high : ndarray of shape ``(cells,)``
            Bounds of the speed, m/s.
        side : ndarray of shape ``(cells,)``
            A speed, m/s: switches whose threshold is greater are on their lower side.
        order : int
            Order of the last derivative.
        """
        while len(self._rates) <= order:
            self._rates.append(derivative(self._rates[-1], _narrow))
        return self._found(row, low, high, side, self._rates[: order + 1])

    def _found(self, row: Any, low: Any, high: Any, side: Any, outputs: Sequence[Node]) -> list[Interval]:
        """Intervals of some nodes; the other arguments are those of a call."""
        found: dict[Node, Interval] = {}
        with np.errstate(all="ignore"):
            for node in _order(tuple(outputs)):
                parts = [found[part] for part in node.parts if part in found]
                if not node.varies:
                    found[node] = _taken(self._constant(node), row)
                elif node.kind == "variable":
                    found[node] = Interval(low, high)
                elif node.kind == "held":
                    found[node] = exact(self.thresholds[node.value][row])
                elif node.kind == "switch":
                    found[node] = _chosen(side < self.thresholds[node.value][row], *parts)
                else:
                    found[node] = _value(node, parts)
        return [Interval(*(None if x is None else np.broadcast_to(x, len(row)) for x in found[o])) for o in outputs]

    def _constant(self, node: Node) -> Interval:
        """Interval of a node that does not vary, for all sets of parameters."""
        if node not in self._constants:
            given = (
                node.value if node.kind == "number" else self.values.get(node.value) if node.kind == "symbol" else None
            )
            parts = [self._constant(part) for part in node.parts]
            self._constants[node] = _value(node, parts) if given is None else exact(given)
        return self._constants[node]


@cache
def _order(outputs: tuple[Node, ...]) -> list[Node]:
    """Nodes in the order in which they are computed; of those that do not vary, only what others need."""
    nodes = nodes_of(*outputs)
    needed = {part for node in nodes if node.varies for part in node.parts}.union(outputs)
    return [node for node in nodes if node.varies or node in needed]


def _value(node: Node, parts: list[Interval]) -> Interval:
    """Interval of a node from those of its parts."""
    if node.kind == "multiply" and node.parts[0] is node.parts[1]:
        return square(parts[0])
    return _VALUES[node.kind](*parts)


def _taken(a: Interval, row: NDArray[np.intp]) -> Interval:
    """Bounds in the rows `row`; a constant without rows is the same in all."""
    if a.low.ndim == 0:
        return a
    low = a.low[row]
    high = low if a.low is a.high else a.high[row]
    return Interval(low, high, None if a.partial is None else np.broadcast_to(a.partial, a.low.shape)[row])


def _chosen(below: Any, a: Interval, b: Interval) -> Interval:
    """Interval `a` where `below` is true, else `b`."""
    partial = None
    if a.partial is not None or b.partial is not None:
        partial = np.where(below, *(False if x.partial is None else x.partial for x in (a, b)))
    return Interval(np.where(below, a.low, b.low), np.where(below, a.high, b.high), partial)
