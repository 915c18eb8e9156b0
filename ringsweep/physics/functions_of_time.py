"""Functions of the time by formula: from text to expressions, their knots, jumps and periods.

The text is that of friction laws (:mod:`ringsweep.physics.friction.formula`) with the time ``t``, s, in place of the
speed, and with ``sin``, ``cos`` and ``tan``. A *knot* is a time at which a formula switches between two expressions.

`values` are the parameters by name, of shape ``(cells,)``. Nothing here runs in kernels.
"""

from __future__ import annotations

import ast
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cache
from math import inf
from typing import Any, NamedTuple

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
    functions=("exp", "log", "log1p", "sqrt", "sin", "cos", "tan", "tanh", "atan", "abs", "sign", "floor"),
    reserved=frozenset(
        {"t", "pi", "law", "theta", "file", "time", "formula", "force", "constant", "knots", "held", "least"}
    ),
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
        if name not in self.language.functions or len(tree.args) != 1:
            return super()._call(tree, name, within)
        inner = self.visit(tree.args[0], within)
        if name == "tan":
            return expressions.divide(expressions.function("sin", inner), expressions.function("cos", inner))
        if name not in ("abs", "sign", "floor"):
            return expressions.function(name, inner)
        if not inner.varies:
            raise FormulaError(f"{name} of an expression without t: write the number itself")
        if name == "floor":
            return expressions.held(self._index(Threshold(None, inner, kind="floor")))
        one = inner if name == "abs" else ONE
        return self._first_where_negative(inner, negative(one), one, within)

    def _first_where_negative(self, difference: Node, a: Node, b: Node, within: tuple[tuple[int, bool], ...]) -> Node:
        """Expression `a` where a difference is negative, else `b`."""
        return self._switch(Threshold(None, difference, kind="root"), a, b)

    def _limit(self, condition: ast.expr) -> tuple[Threshold, bool]:
        """Threshold of a condition, which compares two expressions, and whether the condition holds below it."""
        if isinstance(condition, ast.Compare) and len(condition.ops) == 1:
            left, right = self.visit(condition.left, ()), self.visit(condition.comparators[0], ())
            difference = add(left, negative(right))
            at = right if left is TIME else left if right is TIME else None
            less = isinstance(condition.ops[0], ast.Lt | ast.LtE)
            if difference.varies and (less or isinstance(condition.ops[0], ast.Gt | ast.GtE)):
                return Threshold(None if at is None or at.varies else at, difference, kind="root"), less
        return super()._limit(condition)


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


class _Knots(NamedTuple):
    """Knots of a threshold: `shares` of a turn at a frequency, Hz, or times, s, if the frequency is 0.

    From a knot on the held number is that in `after`, and in each turn greater by `gain`. Of a switch it is infinite on
    the lower side, and minus infinite on the upper one. `shares` and `after` have the shape ``(cells, knots)``.
    """

    frequency: Any
    gain: Any
    shares: Any
    after: Any


def knots_of(function: Function, values: Values, spans: NDArray[np.float64]) -> NDArray[np.float64]:
    """Knots of a function, of shape ``(cells, thresholds, 2, knots + 1)``.

    The first row of a threshold holds frequency and shares of :class:`_Knots`, the second one gain and held numbers.

    Raises
    ------
    FormulaError
        If the knots of a threshold cannot be located.
    """
    found: list[_Knots] = [_knots_of_threshold(knot, values) for knot in function.knots]
    most = max((one.shares.shape[1] for one in found), default=0)
    table = np.full((len(spans), len(found), 2, most + 1), inf)
    for i, one in enumerate(found):
        table[:, i, 0, 0], table[:, i, 1, 0] = one.frequency, one.gain
        count = one.shares.shape[1]
        order = np.argsort(one.shares, axis=1, kind="stable")
        table[:, i, 0, 1 : count + 1] = np.take_along_axis(one.shares, order, axis=1)
        table[:, i, 1, 1 : count + 1] = np.take_along_axis(one.after, order, axis=1)
    return table


def _side(is_above: Any) -> Any:
    """What a switch holds on its upper or lower side."""
    return np.where(is_above, -inf, inf)


def _knots_of_threshold(knot: Threshold, values: Values) -> _Knots:
    """Knots of one threshold."""
    difference = knot.difference
    assert difference is not None
    factor, wave = difference.parts if difference.kind == "multiply" else (ONE, difference)
    rate: Node = derivative(difference)
    start: Any
    if wave.kind in ("sin", "cos") and not factor.varies and (turning := frequency(wave.parts[0])) is not None:
        turns, shift, start = (evaluate(node, 0.0, values) for node in turning)
        start = turns * shift + start / (2.0 * np.pi) + (0.25 if wave.kind == "cos" else 0.0)
        # A sine that turns backwards is the negative of one that turns forwards.
        size = evaluate(factor, 0.0, values) * np.where(turns < 0.0, -1.0, 1.0)
        turns, start, size = np.broadcast_arrays(abs(turns), np.where(turns < 0.0, -start, start), np.atleast_1d(size))
        turning_now = (turns > 0.0) & (size != 0.0)
        rises = np.where(turning_now, -start % 1.0 % 1.0, -inf)
        falls = np.where(turning_now, (0.5 - start) % 1.0 % 1.0, inf)
        first = np.where(turning_now, size > 0.0, size * np.sin(2.0 * np.pi * start) >= 0.0)
        zero = np.zeros_like(turns)
        sides = np.stack([_side(first), _side(~first)], axis=-1)
        return _Knots(np.where(turning_now, turns, 0.0), zero, np.stack([rises, falls], axis=-1), sides)
    if rate.varies or any(node.kind in ("switch", "held") for node in nodes_of(difference)):
        raise FormulaError(
            "the times of its switches are not found: min, max, abs, sign, floor and conditions take straight lines in "
            "t, or compare a sine or cosine of one with 0"
        )
    start, slope = np.broadcast_arrays(*(np.atleast_1d(evaluate(node, 0.0, values)) for node in (difference, rate)))
    zero = np.zeros_like(start)
    if knot.kind == "floor":
        # The line passes a whole number once in each turn.
        first = np.where(slope > 0.0, np.ceil(start), np.floor(start) - (slope < 0.0))
        shares = np.where(slope == 0.0, -inf, np.where(slope > 0.0, -start, start) % 1.0 % 1.0)
        return _Knots(abs(slope), np.sign(slope), shares[:, None], first[:, None])
    with np.errstate(divide="ignore", invalid="ignore"):
        root = np.where(slope == 0.0, inf, -start / slope)
    before = np.where(slope == 0.0, start >= 0.0, slope < 0.0)
    times = np.stack([np.full_like(root, -inf), root], axis=-1)
    return _Knots(zero, zero, times, np.stack([_side(before), _side(~before)], axis=-1))


def held_at(knots: NDArray[np.float64], times: Any) -> list[NDArray[np.float64]]:
    """Held number of each threshold at times (s) whose last dimension is that of the cells."""
    found = []
    for i in range(knots.shape[1]):
        (turns, shares), (gain, after) = ((row[:, 0], row[:, 1:]) for row in (knots[:, i, 0], knots[:, i, 1]))
        turn = np.floor(turns * times)
        at = np.where(turns > 0.0, turns * times - turn, times)
        last = (shares <= at[..., None]).sum(axis=-1) - 1
        before = last < 0
        last = np.where(before, (shares < inf).sum(axis=-1) - 1, last)
        found.append(after[np.arange(len(knots)), last] + gain * (turn - before))
    return found


# Jumps below this share of the largest value are rounding.
_ROUNDING = 1e-9

# Shares of a span at which a function is looked at: spread without a period.
_SHARES = np.concatenate([[0.0, 1.0], np.arange(1, 64) * 0.6180339887498949 % 1.0])

# Turns in which jumps are looked for.
_TURNS = 16


def check(
    function: Function,
    values: Values,
    knots: NDArray[np.float64],
    spans: NDArray[np.float64],
    continuous: Sequence[tuple[str, str]],
) -> None:
    """Refuse a function that is not finite, or that jumps and must not.

    Parameters
    ----------
    function : Function
    values : mapping of str to ndarray of shape ``(cells,)``
    knots : ndarray
        From :func:`knots_of`.
    spans : ndarray of shape ``(cells,)``
        Spans of time, s.
    continuous : sequence of tuple of str
        Name and unit of the function, and of its derivative, if they must be continuous.

    Raises
    ------
    FormulaError
        If what must be continuous jumps at a knot; or if the function or its first three derivatives are no
        finite numbers.
    """
    times = _SHARES[:, None] * spans
    held = held_at(knots, times)
    nodes = [function.value, function.rate]
    nodes += [derivative(nodes[-1]), derivative(derivative(nodes[-1]))]
    for order, node in enumerate(nodes):
        sampled = np.broadcast_to(evaluate(node, times, values, held), times.shape)
        if not np.isfinite(sampled).all():
            at = times[~np.isfinite(sampled)][0]
            what = ("the formula", "its first derivative", "its second derivative", "its third derivative")[order]
            raise FormulaError(f"{what} is no finite number at t = {at:.6g} s")
    turns = np.arange(_TURNS)[:, None, None]
    for i in range(knots.shape[1]):
        frequency, shares = knots[:, i, 0, :1], knots[:, i, 0, 1:]
        with np.errstate(divide="ignore"):
            t = np.moveaxis(np.where(frequency > 0.0, (turns + shares) / frequency, shares), -1, 1)
            near = 1e-9 * np.where(frequency[:, 0] > 0.0, 1.0 / frequency[:, 0], spans)
        within = (t > 0.0) & (t <= spans)
        t = np.where(within, t, 0.0)
        sides = [held_at(knots, t + side) for side in (-near, near)]
        for node, (name, unit) in zip(nodes, continuous, strict=False):
            before, after = (np.broadcast_to(evaluate(node, t, values, held), t.shape) for held in sides)
            largest = abs(extremes(node, values, knots, spans)).max(axis=0)
            jumps = np.argwhere(within & ~(abs(after - before) <= _ROUNDING * largest))
            if len(jumps):
                at = tuple(jumps[0])
                raise FormulaError(
                    f"{name} jumps from {before[at]:.6g} {unit} to {after[at]:.6g} {unit} at t = {t[at]:.6g} s: let it "
                    "rise within a short time w, for example by the factor (1 + tanh((t - t1)/w))/2"
                )


def extremes(node: Node, values: Values, knots: NDArray[np.float64], spans: NDArray[np.float64]) -> Any:
    """About the least and the greatest value of an expression, of shape ``(2, cells)``; see :func:`check`."""
    times = _SHARES[:, None] * spans
    found = np.broadcast_to(evaluate(node, times, values, held_at(knots, times)), times.shape)
    return np.stack([found.min(axis=0), found.max(axis=0)])


# ---- periods ----------------------------------------------------------------------------------


def period_of(node: Node, values: Values) -> Any:
    """Period of an expression, s; 0 for a constant, infinite if it does not repeat.

    It repeats if the time stands only in sines and cosines of straight lines in t, and in switches and whole parts of
    them, whose periods have a common multiple.
    """
    found: dict[Node, Any] = {}
    knots: Any = values.get("knots")
    for one in nodes_of(node):
        if one.kind in ("sin", "cos") and (turning := frequency(one.parts[0])) is not None:
            turns = abs(evaluate(turning[0], 0.0, values))
            with np.errstate(divide="ignore"):
                found[one] = np.where(turns > 0.0, 1.0 / turns, 0.0)
            continue
        found[one] = inf if one.kind == "variable" else 0.0
        if one.kind in ("switch", "held"):
            turns, shares, gain = (knots[..., one.value, i, k] for i, k in ((0, 0), (0, slice(1, None)), (1, 0)))
            once = ((shares > 0.0) & (shares < inf)).any(axis=-1)
            with np.errstate(divide="ignore"):
                found[one] = np.where(gain != 0.0, inf, np.where(turns > 0.0, 1.0 / turns, np.where(once, inf, 0.0)))
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
