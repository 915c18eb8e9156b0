"""Functions of the time by formula: from text to expressions, their knots, jumps and periods.

The text is that of friction laws (:mod:`ringsweep.physics.friction.formula`) with the time ``t``, s, in place of the
speed, and with ``sin``, ``cos`` and ``tan``. A *knot* is a time at which a formula switches between two expressions.

`values` are the parameters by name, of shape ``(cells,)``. Nothing here runs in kernels.
"""

from __future__ import annotations

import ast
from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cache
from math import inf
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ringsweep.numerics import expressions
from ringsweep.numerics.expressions import (
    ONE,
    TIME,
    ZERO,
    Node,
    add,
    derivative,
    evaluate,
    frequency,
    integral,
    multiply,
    negative,
    nodes_of,
)
from ringsweep.physics.friction.formula import FormulaError, Language, Reader, Threshold, Units, parsed, unit_of

#: The language of drives and forces.
LANGUAGE = Language(
    variable=TIME,
    name="t",
    functions=("exp", "log", "log1p", "sqrt", "sin", "cos", "tan", "tanh", "atan", "abs"),
    reserved=frozenset({"t", "pi", "law", "theta", "file", "time", "formula", "force", "constant", "knots"}),
    units={"t": "s", "pi": "rad"},
    example="A*sin(w*t)",
)

Values = Mapping[str, Any]


@dataclass(frozen=True, eq=False)
class Function:
    """A function of the time.

    Attributes
    ----------
    text : str
    value : Node
    rate : Node
        Its derivative.
    unit : str
        Its unit.
    knots : tuple of Threshold
    units : dict of str to str
        Units of the parameters; ``""`` where the unit does not follow from the formula.
    by_rate : bool
        Whether `text` is the formula of the rate.
    """

    text: str
    value: Node
    rate: Node
    unit: str
    knots: tuple[Threshold, ...]
    units: Mapping[str, str]
    by_rate: bool = False

    @property
    def factors(self) -> tuple[Node, Node]:
        """The function as a product: a constant, its *amplitude*, and its *shape*."""
        product = self.value.kind == "multiply" and not self.value.parts[0].varies
        if product and (self.rate is derivative(self.value) or self.rate.parts[:1] == self.value.parts[:1]):
            return self.value.parts[0], self.value.parts[1]
        return ONE, self.value

    @property
    def shape_rate(self) -> Node:
        """Derivative of the shape."""
        amplitude, shape = self.factors
        if amplitude is ONE:
            return self.rate
        return derivative(shape) if self.rate is derivative(self.value) else self.rate.parts[1]


class _Reader(Reader):
    """Makes expressions of the time."""

    def _call(self, tree: ast.Call, name: str, within: tuple[tuple[int, bool], ...]) -> Node:
        """Expression of a call; of the functions only some are allowed, as for friction."""
        if name in self.language.functions and name != "abs" and len(tree.args) == 1:
            inner = self.visit(tree.args[0], within)
            if name == "tan":
                return expressions.divide(expressions.function("sin", inner), expressions.function("cos", inner))
            return expressions.function(name, inner)
        return super()._call(tree, name, within)

    def _first_where_negative(self, difference: Node, a: Node, b: Node, within: tuple[tuple[int, bool], ...]) -> Node:
        """Expression `a` where a straight line in t is negative, else `b`: the line changes its sign once."""
        if derivative(difference).varies:
            raise FormulaError(
                "min, max and abs find the time of their switch only where two expressions differ by a straight line "
                "in t: write piecewise(t < t1, a, b)"
            )
        # Of a difference that grows a comes first, of one that falls b.
        falls = self._switch(Threshold(None, difference, 1, "root", within), b, a)
        return self._switch(Threshold(None, difference, 0, "root", within), a, falls)


def read_function(text: Any, unit: str, rate: str | None = None, *, infer_units: bool = True) -> Function:
    """Read a function of the time.

    Parameters
    ----------
    text : str
        For example ``"A*(t - tau*(1 - exp(-t/tau)))"``.
    unit : str
        Unit of the function: a base unit of :mod:`ringsweep.physics.friction.formula`.
    rate : str, optional
        Its derivative, where a shorter formula is known than what follows from `text`.
    infer_units : bool
        Whether to infer the units of the parameters.

    Raises
    ------
    FormulaError
        If the text is no such formula, or its units contradict each other.
    """
    tree, reader = parsed(text, LANGUAGE), _Reader(LANGUAGE)
    value = reader.visit(tree, ())
    slope = derivative(value) if rate is None else reader.visit(parsed(rate, LANGUAGE), ())
    units = Units(LANGUAGE)
    if infer_units:
        units.equal(units.visit(tree), unit_of(unit), f"the formula, which is in {unit}")
    return Function(text, value, slope, unit, tuple(reader.thresholds), units.solved())


def read_rate(text: Any, unit: str) -> Function:
    """Read a function of the time, zero at t = 0, from its rate in `unit`, such as rad/s; see :func:`read_function`.

    Raises
    ------
    FormulaError
        If the text is no such formula, or has an integral that is not known.
    """
    rate = read_function(text, unit)
    try:
        value = integral(rate.value, {i: knot.at for i, knot in enumerate(rate.knots) if knot.at is not None})
    except ValueError:
        raise FormulaError(
            "its integral is not known: known are polynomials, exp, sin, cos, tanh and atan of straight lines in t, "
            "products of a polynomial and one exp, sin or cos, and sums and piecewise(t < t1, ...) of these; give theta"
        ) from None
    return replace(rate, value=value, rate=rate.value, unit=unit.removesuffix("/s"), by_rate=True)


# ---- knots ------------------------------------------------------------------------------------


def knots_of(function: Function, values: Values, cells: int) -> NDArray[np.float64]:
    """Times of the knots, s, of shape ``(cells, knots)``; infinite where a switch never happens."""
    found = np.empty((cells, len(function.knots)))
    for i, knot in enumerate(function.knots):
        found[:, i] = _time_of_knot(knot, values, found.T)
    return found


def _time_of_knot(knot: Threshold, values: Values, known: Any) -> Any:
    """Time, s, at which a formula switches; infinite with a sign if it never does or always has.

    Parameters
    ----------
    knot : Threshold
        A time that is given, or the root of a difference that is a straight line.
    values : mapping
        Values of the parameters by name.
    known : Any
        Times of the knots within which this one lies.
    """
    if knot.at is not None:
        return evaluate(knot.at, 0.0, values)
    assert knot.difference is not None
    # A straight line, on the present sides of switches within it.
    start, rate = (evaluate(node, 0.0, values, known) for node in (knot.difference, derivative(knot.difference)))
    with np.errstate(divide="ignore", invalid="ignore"):
        root, grows = -start / rate, rate > 0.0
    if knot.order == 0:
        return np.where(rate == 0.0, np.where(start < 0.0, inf, -inf), np.where(grows, root, -inf))
    return np.where((rate == 0.0) | grows, inf, root)


# Jumps below this share of the largest value are rounding.
_ROUNDING = 1e-9

# Shares of a span at which a function is looked at: spread without a period.
_SHARES = np.concatenate([[0.0, 1.0], np.arange(1, 64) * 0.6180339887498949 % 1.0])


def check(
    function: Function,
    values: Values,
    knots: NDArray[np.float64],
    spans: NDArray[np.float64],
    continuous: tuple[tuple[str, str], ...],
) -> None:
    """Refuse a function that is not finite or not smooth enough.

    Parameters
    ----------
    function : Function
    values : mapping of str to ndarray of shape ``(cells,)``
    knots : ndarray of shape ``(cells, knots)``
        From :func:`knots_of`.
    spans : ndarray of shape ``(cells,)``
        Spans of time, s.
    continuous : tuple of tuple of str
        Name and unit of the function, and of its derivatives that must be continuous too.

    Raises
    ------
    FormulaError
        If the function, or one of these derivatives, jumps at a knot; or if the function or its first three derivatives
        are no finite numbers.
    """
    times = _SHARES[:, None] * spans
    nodes = [function.value, function.rate]
    nodes += [derivative(nodes[-1]), derivative(derivative(nodes[-1]))]
    thresholds = list(knots.T)
    for order, node in enumerate(nodes):
        sampled = np.broadcast_to(evaluate(node, times, values, thresholds), times.shape)
        if not np.isfinite(sampled).all():
            at = times[~np.isfinite(sampled)][0]
            what = ("the formula", "its first derivative", "its second derivative", "its third derivative")[order]
            raise FormulaError(f"{what} is no finite number at t = {at:.6g} s")
        if order >= len(continuous):
            continue
        largest = abs(sampled).max(axis=0)
        for at in thresholds:
            within = (at > 0.0) & (at <= spans)
            t = np.where(within, at, 0.0)
            after = evaluate(node, t, values, thresholds)
            before = evaluate(node, np.nextafter(t, -inf), values, thresholds)
            jumps = within & ~(abs(after - before) <= _ROUNDING * largest)
            if jumps.any():
                i = int(np.flatnonzero(jumps)[0])
                a, b = (np.broadcast_to(x, jumps.shape)[i] for x in (before, after))
                name, unit = continuous[order]
                raise FormulaError(
                    f"{name} jumps from {a:.6g} {unit} to {b:.6g} {unit} at t = {t[i]:.6g} s: let it rise within a "
                    "short time w, for example by the factor (1 + tanh((t - t1)/w))/2"
                )


def extremes(function: Function, values: Values, knots: NDArray[np.float64], spans: NDArray[np.float64]) -> Any:
    """About the least and the greatest value of a function, of shape ``(2, cells)``; see :func:`check`."""
    times = _SHARES[:, None] * spans
    found = np.broadcast_to(evaluate(function.value, times, values, list(knots.T)), times.shape)
    return np.stack([found.min(axis=0), found.max(axis=0)])


# ---- periods ----------------------------------------------------------------------------------


def period_of(node: Node, values: Values) -> Any:
    """Period of an expression, s; 0 for a constant, infinite if it does not repeat.

    It repeats if the time stands only in sines and cosines of straight lines in t whose periods have a common multiple.
    """
    found: dict[Node, Any] = {}
    for one in nodes_of(node):
        if one.kind in ("sin", "cos") and (turning := frequency(one.parts[0])) is not None:
            turns = abs(evaluate(turning[0], 0.0, values))
            with np.errstate(divide="ignore"):
                found[one] = np.where(turns > 0.0, 1.0 / turns, 0.0)
            continue
        found[one] = inf if one.kind in ("variable", "switch") else 0.0
        for part in one.parts:
            found[one] = common_period(found[one], found[part])
        if one.kind == "multiply" and not one.parts[0].varies:
            found[one] = np.where(evaluate(one.parts[0], 0.0, values) == 0.0, 0.0, found[one])
    return found[node]


# Largest number of periods, of the slower of two oscillations, that make a common period.
_MOST_PERIODS = 20


def common_period(a: Any, b: Any) -> Any:
    """Least common multiple of two periods, if it is a few of the longer one; else infinite. A period of 0 is none."""
    a, b = np.broadcast_arrays(a, b)
    shorter, longer = np.minimum(a, b), np.maximum(a, b)
    found = np.where(shorter == 0.0, longer, inf)
    for n in range(_MOST_PERIODS, 0, -1):
        with np.errstate(invalid="ignore", divide="ignore"):
            ratio = n * longer / shorter
            repeats = (shorter > 0.0) & (longer < inf) & (abs(ratio - np.round(ratio)) <= 1e-9 * ratio)
        found = np.where(repeats, n * longer, found)
    return found


# ---- rounding ---------------------------------------------------------------------------------


@cache
def size_at_start(node: Node) -> Node:
    """Expression of a bound on the terms of `node` at t = 0; the rounding of its value scales with it."""
    if not node.varies:
        return _magnitude(node)
    if node.kind in ("sin", "cos"):
        return ONE
    if node.kind == "switch":
        return expressions.extreme("maximum", *(size_at_start(part) for part in node.parts))
    if node.kind in ("add", "multiply"):
        return {"add": add, "multiply": multiply}[node.kind](*(size_at_start(part) for part in node.parts))
    if node.kind == "divide":
        return expressions.divide(size_at_start(node.parts[0]), _magnitude(at_start(node.parts[1])))
    return _magnitude(at_start(node))


def _magnitude(node: Node) -> Node:
    """Expression of the magnitude of a constant expression."""
    return (
        expressions.number(abs(node.value))
        if node.kind == "number"
        else expressions.extreme("maximum", node, negative(node))
    )


def at_start(node: Node) -> Node:
    """Value of an expression at t = 0."""
    return expressions.substitute(node, {TIME: ZERO})
