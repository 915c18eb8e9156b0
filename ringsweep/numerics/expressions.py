"""Expressions of one variable, with parameters: friction laws are functions of the speed, drives of the time.

An expression is a graph in which equal parts are one node. So common parts are computed once, in whatever language the
expression is written out later.

Laws and drives are made of the functions here when they are defined; nothing here runs in kernels.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import cache, reduce
from typing import Any

import numpy as np
from numpy.typing import NDArray


@dataclass(frozen=True, eq=False)
class Node:
    """A node of an expression. Two equal expressions are the same object.

    Attributes
    ----------
    kind : str
        ``number``, ``symbol``, ``variable``, ``add``, ``multiply``, ``divide``, ``power``, a function (``exp``,
        ``log``, ``log1p``, ``sqrt``, ``tanh``, ``atan``, ``sin``, ``cos``), ``switch``; ``minimum`` or ``maximum`` of
        constant parts; ``held``, a number that is constant between the thresholds of its function.
    parts : tuple of Node
        What the node is computed from. Of a switch, the expression below its threshold and the one above.
    value : float, str or int, optional
        Value of a number, name of a symbol or of the variable, or index of the threshold of a switch, or of a
        held number.
    """

    kind: str
    parts: tuple[Node, ...] = ()
    value: Any = None

    @property
    def varies(self) -> bool:
        """Whether the node depends on the variable."""
        return _varies(self)


_NODES: dict[Any, Node] = {}


def _node(kind: str, *parts: Node, value: Any = None) -> Node:
    """The one node of this kind with these parts."""
    key = kind, parts, value
    if key not in _NODES:
        _NODES[key] = Node(kind, parts, value)
    return _NODES[key]


@cache
def _varies(node: Node) -> bool:
    """Whether a node depends on the variable."""
    return node.kind in ("variable", "switch", "held") or any(_varies(part) for part in node.parts)


#: The variable of friction laws and that of drives, both at least zero.
SPEED, TIME = _node("variable", value="speed"), _node("variable", value="t")


def number(value: float) -> Node:
    """A constant."""
    return _node("number", value=float(value))


def symbol(name: str) -> Node:
    """A parameter."""
    return _node("symbol", value=name)


ZERO, ONE = number(0.0), number(1.0)


def add(a: Node, b: Node) -> Node:
    """Sum."""
    if a is ZERO:
        return b
    if b is ZERO:
        return a
    if a.kind == b.kind == "number":
        return number(a.value + b.value)
    return _node("add", a, b)


def multiply(a: Node, b: Node) -> Node:
    """Product; a constant factor of a varying one stands first."""
    if a.varies and not b.varies:
        a, b = b, a
    if a is ZERO or b is ZERO:
        return ZERO
    if a is ONE:
        return b
    if b is ONE:
        return a
    if a.kind == b.kind == "number":
        return number(a.value * b.value)
    # Constant factors are multiplied once, not at each speed.
    for one, other in ((b, a), (a, b)):
        if one.kind == "multiply" and one.varies and not one.parts[0].varies:
            return (
                multiply(multiply(one.parts[0], other), one.parts[1])
                if not other.varies
                else multiply(one.parts[0], multiply(one.parts[1], other))
            )
    return _node("multiply", a, b)


def negative(a: Node) -> Node:
    """The expression with the other sign."""
    return multiply(number(-1.0), a)


def divide(a: Node, b: Node) -> Node:
    """Quotient; a varying dividend is multiplied by the reciprocal of a constant divisor."""
    if a is ZERO:
        return ZERO
    if b is ONE:
        return a
    if a.kind == b.kind == "number" and b.value != 0.0:
        return number(a.value / b.value)
    if a.varies and not b.varies:
        return multiply(divide(ONE, b), a)
    if b.varies and not a.varies and a is not ONE:
        return multiply(a, divide(ONE, b))
    if a.kind == "multiply" and a.varies and not a.parts[0].varies:
        return multiply(a.parts[0], divide(a.parts[1], b))
    return _node("divide", a, b)


def power(a: Node, exponent: Node) -> Node:
    """Power; a whole constant exponent becomes a product."""
    if exponent.kind == "number" and float(exponent.value).is_integer() and abs(exponent.value) <= 64:
        n = int(exponent.value)
        if n < 0:
            return divide(ONE, power(a, number(-n)))
        if n <= 1:
            return a if n else ONE
        half = power(a, number(n // 2))
        return multiply(multiply(half, half), a) if n % 2 else multiply(half, half)
    if exponent.varies:
        return function("exp", multiply(exponent, function("log", a)))
    return function("sqrt", a) if exponent.kind == "number" and exponent.value == 0.5 else _node("power", a, exponent)


def function(name: str, a: Node) -> Node:
    """Function of an expression: a key of the table above."""
    if a.kind == "number":
        try:
            return number(FUNCTIONS[name][0](a.value))
        except (ValueError, OverflowError):
            return number(math.nan)
    return _node(name, a)


#: Functions of one expression x: the value for a number, and the derivative from the function f and x, as a quotient.
#: All series follow from it: dividend and divisor n and q with ``q df = n dx``.
FUNCTIONS: dict[str, tuple[Callable[[float], float], Callable[[Node, Node], tuple[Node, Node]]]] = {
    "exp": (math.exp, lambda f, x: (f, ONE)),
    "log": (math.log, lambda f, x: (ONE, x)),
    "sqrt": (math.sqrt, lambda f, x: (number(0.5), f)),
    "tanh": (math.tanh, lambda f, x: (add(ONE, negative(multiply(f, f))), ONE)),
    "atan": (math.atan, lambda f, x: (ONE, add(ONE, multiply(x, x)))),
    "log1p": (math.log1p, lambda f, x: (ONE, add(ONE, x))),
    "sin": (math.sin, lambda f, x: (function("cos", x), ONE)),
    "cos": (math.cos, lambda f, x: (negative(function("sin", x)), ONE)),
}


@cache
def quotient_of(a: Node) -> tuple[Node, Node]:
    """Dividend and divisor of the derivative of a function, or of a power, by its argument."""
    return (multiply(a.parts[1], a), a.parts[0]) if a.kind == "power" else FUNCTIONS[a.kind][1](a, a.parts[0])


def extreme(kind: str, a: Node, b: Node) -> Node:
    """``minimum`` or ``maximum`` of two expressions that do not depend on the variable."""
    return a if a is b else _node(kind, a, b)


def switch(threshold: int, below: Node, above: Node) -> Node:
    """`below` where the variable is less than a threshold, `above` from the threshold on."""
    return below if below is above else _node("switch", below, above, value=threshold)


def held(index: int) -> Node:
    """A number that is constant between thresholds, such as a whole part."""
    return _node("held", value=index)


@cache
def derivative(a: Node, special: Callable[[Node], Node | None] = lambda a: None) -> Node:
    """Derivative by the variable; at a threshold the one from above. `special` gives that of some nodes."""
    if not a.varies or a.kind == "held":
        return ZERO
    if a.kind == "variable":
        return ONE
    if (found := special(a)) is not None:
        return found
    rates = [derivative(part, special) for part in a.parts]
    p = a.parts
    if a.kind == "add":
        return add(*rates)
    if a.kind == "multiply":
        return add(multiply(rates[0], p[1]), multiply(p[0], rates[1]))
    if a.kind == "divide":
        return divide(add(rates[0], negative(multiply(a, rates[1]))), p[1])
    if a.kind == "switch":
        return switch(a.value, *rates)
    dividend, divisor = quotient_of(a)
    return divide(multiply(dividend, rates[0]), divisor)


def substitute(a: Node, values: Mapping[Node, Node]) -> Node:
    """Expression in which nodes are replaced by others."""
    done: dict[Node, Node] = dict(values)

    def visit(node: Node) -> Node:
        if node not in done:
            done[node] = rebuilt(node, [visit(part) for part in node.parts])
        return done[node]

    return visit(a)


#: Antiderivatives of functions f of x, from f and x.
_ANTIDERIVATIVES: dict[str, Callable[[Node, Node], Node]] = {
    "exp": lambda f, x: f,
    "sin": lambda f, x: negative(function("cos", x)),
    "cos": lambda f, x: function("sin", x),
    "tanh": lambda f, x: add(x, function("log1p", function("exp", multiply(number(-2.0), x)))),
    "atan": lambda f, x: add(multiply(x, f), multiply(number(-0.5), function("log1p", multiply(x, x)))),
}

# Highest degree of a polynomial that is integrated.
_MOST_POWERS = 8


def integral(a: Node, thresholds: Mapping[int, Node]) -> Node:
    """Integral of an expression from the time 0 on.

    Integrated are polynomials, the functions above of straight lines, the first three also times a polynomial, and
    sums and pieces of all these.

    Parameters
    ----------
    a : Node
    thresholds : mapping of int to Node
        Times of the switches, by index. A switch within the later piece of another one comes later, else earlier.

    Raises
    ------
    ValueError
        If a part of the expression is none of these.
    """
    p = a.parts
    if slopes := _slopes_at_start(a):
        terms = (multiply(number(1.0 / math.factorial(k)), slope) for k, slope in enumerate(slopes, 1))
        powers = (power(TIME, number(k)) for k in range(1, len(slopes) + 1))
        return reduce(add, map(multiply, terms, powers))
    if a.kind == "add":
        return add(*(integral(part, thresholds) for part in p))
    if a.kind == "multiply" and not p[0].varies:
        return multiply(p[0], integral(p[1], thresholds))
    if a.kind == "switch" and a.value in thresholds:
        below, above = (integral(part, thresholds) for part in p)
        before, after = _on_side(below, thresholds[a.value], 1), _on_side(above, thresholds[a.value], 0)
        return switch(a.value, below, add(above, add(before, negative(after))))
    # By parts, until nothing is left of the polynomial.
    factor, f = (ONE, a) if a.kind != "multiply" else p if _slopes_at_start(p[0]) else p[::-1]
    known = _ANTIDERIVATIVES if factor is ONE else ("exp", "sin", "cos")
    if f.kind not in known or not _slopes_at_start(factor) or len(slopes := _slopes_at_start(f.parts[0])) != 2:
        raise ValueError
    whole = divide(_ANTIDERIVATIVES[f.kind](f, f.parts[0]), slopes[1])
    found = multiply(factor, whole)
    found = add(found, negative(substitute(found, {TIME: ZERO})))
    return add(found, negative(integral(multiply(derivative(factor), whole), thresholds)))


def _slopes_at_start(a: Node) -> list[Node]:
    """Value and derivatives of a polynomial at the time 0; empty for another expression."""
    found: list[Node] = []
    while a.varies and len(found) <= _MOST_POWERS and not any(node.kind == "switch" for node in nodes_of(a)):
        found.append(substitute(a, {TIME: ZERO}))
        a = derivative(a)
    return [] if a.varies else [*found, a]


def _on_side(a: Node, time: Node, side: int) -> Node:
    """Value of an expression at a time, before all its switches (0) or after them (1)."""
    values = {TIME: time}
    for node in nodes_of(a):
        if node.kind == "switch":
            values[node] = substitute(node.parts[side], values)
    return substitute(a, values)


def frequency(angle: Node) -> tuple[Node, Node, Node] | None:
    """An angle that grows uniformly, as turns per unit of the variable; None of another angle.

    Returns
    -------
    tuple of Node
        The turns; what the expression adds to the time itself, as the instant in ``t - t0``; and the angle where the
        time is zero with that added.
    """
    rate = derivative(angle)
    if rate.varies or any(node.kind in ("switch", "held") for node in nodes_of(angle)):
        return None
    shift, zeros = ZERO, {SPEED: ZERO, TIME: ZERO}
    shifted = [node for node in nodes_of(angle) if TIME in node.parts]
    if len(shifted) == 1 and shifted[0].kind == "add":
        shift = next(part for part in shifted[0].parts if part is not TIME)
        zeros[shifted[0]] = ZERO
    turn, start = number(2.0 * math.pi), substitute(angle, zeros)
    # 2 pi f gives f itself, not its rounding.
    if rate.kind == "multiply" and rate.parts[0].kind == "number":
        return multiply(divide(rate.parts[0], turn), rate.parts[1]), shift, start
    return divide(rate, turn), shift, start


def rebuilt(node: Node, parts: list[Node]) -> Node:
    """Node of the same kind from other parts."""
    simple: dict[str, Callable[..., Node]] = {"add": add, "multiply": multiply, "divide": divide, "power": power}
    if node.kind in simple:
        return simple[node.kind](*parts)
    if node.kind in ("minimum", "maximum"):
        return extreme(node.kind, *parts)
    if node.kind in FUNCTIONS:
        return function(node.kind, *parts)
    return switch(node.value, *parts) if node.kind == "switch" else node


def nodes_of(*expressions: Node) -> list[Node]:
    """All nodes, each after its parts."""
    found: dict[Node, None] = {}

    def visit(node: Node) -> None:
        if node not in found:
            for part in node.parts:
                visit(part)
            found[node] = None

    for expression in expressions:
        visit(expression)
    return list(found)


def symbols_of(*expressions: Node) -> list[str]:
    """Names of the parameters, in the order in which they occur."""
    return [node.value for node in nodes_of(*expressions) if node.kind == "symbol"]


def evaluate(a: Node, variable: Any, values: Mapping[str, Any], thresholds: Any = ()) -> NDArray[np.float64]:
    """Value of an expression in NumPy.

    Parameters
    ----------
    a : Node
    variable : array_like
        Value of the variable, at least zero; broadcasts with the values.
    values : mapping of str to array_like
        Values of the parameters.
    thresholds : sequence of array_like
        Value of the variable at each threshold, or the held number.

    Returns
    -------
    ndarray
        NaN or infinite where the expression has no finite value.
    """
    found: dict[Node, Any] = {}
    with np.errstate(all="ignore"):
        for node in nodes_of(a):
            found[node] = _value_of(node, [found[part] for part in node.parts], variable, values, thresholds)
    return np.asarray(found[a], dtype=np.float64)


def _value_of(node: Node, parts: list[Any], variable: Any, values: Mapping[str, Any], thresholds: Any) -> Any:
    """Value of a node from the values of its parts, for arrays."""
    if node.kind == "number":
        return np.float64(node.value)
    if node.kind == "symbol":
        return np.asarray(values[node.value], dtype=np.float64)
    if node.kind == "variable":
        return np.asarray(variable, dtype=np.float64)
    if node.kind == "held":
        return np.asarray(thresholds[node.value], dtype=np.float64)
    if node.kind == "switch":
        return np.where(np.asarray(variable) < thresholds[node.value], *parts)
    simple: dict[str, Any] = {"add": np.add, "multiply": np.multiply, "divide": np.divide, "power": np.power}
    return (simple[node.kind] if node.kind in simple else getattr(np, {"atan": "arctan"}.get(node.kind, node.kind)))(
        *parts
    )
