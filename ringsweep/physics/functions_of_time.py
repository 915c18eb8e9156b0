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
    number,
    substitute,
    symbol,
    symbols_of,
)
from ringsweep.numerics.intervals import Enclosure
from ringsweep.numerics.isolation import UndecidedError, cells_between, refined, sign_changes
from ringsweep.numerics.rows import distinct_rows, places_of
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
            if not _is_line(inner):
                raise FormulaError("floor takes a straight line in t, such as floor(t/T)")
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
            "products of a polynomial and one exp, sin or cos, and sums and piecewise(t < t1, ...) of these; give "
            "theta; the place of a square wave is a triangle wave, such as theta: V*T*abs(t/T - floor(t/T + 1/2))"
        ) from None
    return replace(rate, value=value, rate=rate.value, unit=unit.removesuffix("/s"), by_rate=True)


# ---- knots ------------------------------------------------------------------------------------


def table_of_knots(frequency: Any, gain: Any, shares: Any, after: Any) -> NDArray[np.float64]:
    """Knots of a threshold, of shape ``(cells, 2, knots + 1)``: frequency and shares, gain and held numbers.

    Knots are `shares` of a turn at a frequency, Hz; or times, s, the first one not after 0, if the frequency is 0. From
    a knot on the held number is that in `after`, and in each turn greater by `gain`. Of a switch it is infinite on the
    lower side, and minus infinite on the upper one. `shares` and `after` have the shape ``(cells, knots)``.
    """
    order = np.argsort(shares, axis=1, kind="stable")
    rows = [
        np.column_stack([number, np.take_along_axis(several, order, axis=1)])
        for number, several in ((frequency, shares), (gain, after))
    ]
    return np.stack(rows, axis=1)


def knots_of(function: Function, values: Values, spans: NDArray[np.float64]) -> NDArray[np.float64]:
    """Knots of a function, of shape ``(cells, thresholds, 2, knots + 1)``; see :func:`table_of_knots`.

    Raises
    ------
    FormulaError
        If the knots of a threshold cannot be located.
    """
    differences = [knot.difference for knot in function.knots if knot.difference is not None]
    names = symbols_of(*differences)
    some, rows = distinct_rows([*(values[name] for name in names), spans])
    known = {name: values[name][some] for name in names}
    knots = np.empty((len(some), 0, 2, 2))
    for knot, difference in zip(function.knots, differences, strict=True):
        find = _of_floor if knot.kind == "floor" else _of_switch
        found = find(difference, known | {"knots": knots}, spans[some])[:, None]
        most = max(knots.shape[-1], found.shape[-1])
        # A knot that is there twice is one.
        knots = np.concatenate([_widened(table, most) for table in (knots, found)], axis=1)
    return knots[rows]


def _widened(knots: NDArray[np.float64], width: int) -> NDArray[np.float64]:
    """Knots of which the last one is repeated."""
    return np.pad(knots, [*[(0, 0)] * (knots.ndim - 1), (0, width - knots.shape[-1])], mode="edge")


def _is_line(difference: Node) -> bool:
    """Whether an expression is a straight line in t."""
    return not derivative(difference).varies and all(
        node.kind not in ("switch", "held") for node in nodes_of(difference)
    )


def _line(difference: Node, values: Values) -> tuple[Any, Any]:
    """Value at t = 0 and slope of a straight line in t."""
    cells = len(values["knots"])
    start, slope = (np.broadcast_to(evaluate(n, 0.0, values), cells) for n in (difference, derivative(difference)))
    return start, slope


def _of_floor(inner: Node, values: Values, spans: NDArray[np.float64]) -> NDArray[np.float64]:
    """Knots of a whole part."""
    start, slope = _line(inner, values)
    # The line passes a whole number once in each turn.
    first = np.where(slope > 0.0, np.ceil(start), np.floor(start) - (slope < 0.0))
    shares = np.where(slope == 0.0, -inf, np.where(slope > 0.0, -start, start) % 1.0 % 1.0)
    return table_of_knots(abs(slope), np.sign(slope), shares[:, None], first[:, None])


def _side(is_above: Any) -> Any:
    """What a switch holds on its upper or lower side."""
    return np.where(is_above, -inf, inf)


def _of_switch(difference: Node, values: Values, spans: NDArray[np.float64]) -> NDArray[np.float64]:
    """Knots of a switch, which are where a difference changes its sign."""
    zero = np.zeros(len(spans))
    if _is_line(difference):
        start, slope = _line(difference, values)
        with np.errstate(divide="ignore", invalid="ignore"):
            root = np.where(slope == 0.0, inf, -start / slope)
        before = np.where(slope == 0.0, start >= 0.0, slope < 0.0)
        times = np.stack([np.full_like(root, -inf), root], axis=-1)
        return table_of_knots(zero, zero, times, np.stack([_side(before), _side(~before)], axis=-1))
    turns = _frequency_of(difference, values, spans)
    with np.errstate(divide="ignore"):
        cell, times, signs = _signs_of(difference, values, np.where(turns > 0.0, 1.0 / turns, spans))
    begins = places_of(cell) == 0
    # In a periodic function the first sign comes after the last one.
    before = np.roll(signs, 1)
    before[begins] = signs[np.append(begins[1:], True)]
    turns = np.where(np.bincount(cell, signs != before) > 0.0, turns, 0.0)
    begins &= turns[cell] == 0.0
    shares = np.where(begins, -inf, np.where(turns[cell] > 0.0, times * turns[cell] % 1.0 % 1.0, times))
    chosen = (signs != before) | begins
    cell, shares, after = cell[chosen], shares[chosen], _side(signs[chosen] > 0)
    place = places_of(cell)
    last = np.append(cell[1:] != cell[:-1], True)
    table = [np.repeat(column[last][:, None], place.max() + 1, axis=1) for column in (shares, after)]
    for column, found in zip(table, (shares, after), strict=True):
        column[cell, place] = found
    return table_of_knots(turns, zero, *table)


def _frequency_of(difference: Node, values: Values, spans: NDArray[np.float64]) -> NDArray[np.float64]:
    """Frequency of an expression, Hz, that is exactly that of its parts; 0 if it does not repeat."""
    period = np.broadcast_to(period_of(difference, values), spans.shape)
    repeats = (period > 0.0) & (period < inf)
    found, least = np.zeros(len(spans)), np.full(len(spans), inf)
    for node in nodes_of(difference):
        turns = np.broadcast_to(_turns_of(node, values), spans.shape)
        with np.errstate(invalid="ignore"):
            count = np.round(turns * period)
            # Else the parts would part from each other.
            repeats &= (turns == 0.0) | (abs(turns * period - count) <= 1e-14 * count)
        better = repeats & (turns > 0.0) & (count < least)
        found, least = np.where(better, turns / np.where(better, count, 1.0), found), np.where(better, count, least)
    return np.where(repeats, found, 0.0)


# A period or a span is looked at in so many pieces at least.
_PIECES = 16

# Beginning and length of such a piece, s. No parameter has a space in its name.
_BEGIN, _LENGTH = symbol("begin of piece"), symbol("length of piece")


def _signs_of(difference: Node, values: Values, lengths: NDArray[np.float64]) -> tuple[Any, Any, Any]:
    """Signs of an expression from the time 0 to `lengths`, s: cell, time, s, and the sign from there on, in order."""
    knots, cells = values["knots"], len(lengths)
    marks = [np.linspace(0.0, 1.0, _PIECES + 1) * lengths[:, None]]
    for node in nodes_of(difference):
        if node.kind in ("switch", "held"):
            one = knots[:, node.value]
            times = times_of(one, 1 + int(np.max(one[:, 0, 0] * lengths)))
            marks.append(np.clip(times.reshape(-1, cells).T, 0.0, lengths[:, None]))
    ends = np.sort(np.concatenate(marks, axis=1), axis=1)
    # Marks that differ by rounding are one.
    cell, place = np.nonzero(np.diff(ends) > 1e-14 * lengths[:, None])
    begin, length = ends[cell, place], np.diff(ends)[cell, place]
    held = held_at(knots[cell], begin + 0.5 * length)
    parameters = {name: np.broadcast_to(values[name], cells)[cell] for name in symbols_of(difference)}
    # From 1 to 2 all numbers have the same rounding.
    moved = substitute(difference, {TIME: add(_BEGIN, multiply(_LENGTH, add(TIME, number(-1.0))))})
    enclosure = Enclosure(moved, parameters | {_BEGIN.value: begin, _LENGTH.value: length}, held)
    one = np.ones(len(cell))
    try:
        changes = sign_changes(enclosure, cells_between(one, 2.0 * one, []))
    except UndecidedError:
        raise FormulaError(
            "the times of its switches are not found: within the span the two sides of a condition, or what is in min, "
            "max, abs or sign, cross too often, or are equal to rounding for a while"
        ) from None
    row = changes.row
    times = np.append(begin, begin[row] + length[row] * (refined(changes, enclosure) - 1.0))
    cell, signs = np.append(cell, cell[row]), np.append(changes.first, changes.after)
    # Zero everywhere is no negative number.
    zero = np.setdiff1d(np.arange(cells), cell[signs != 0])
    cell, times, signs = (np.append(a, b) for a, b in ((cell, zero), (times, 0.0 * zero), (signs, 1 + 0 * zero)))
    cell, times, signs = (column[signs != 0] for column in (cell, times, signs))
    order = np.lexsort((times, cell))
    return cell[order], times[order], signs[order]


def times_of(knots: NDArray[np.float64], turns: int) -> NDArray[np.float64]:
    """Times of the knots of a threshold in its first turns, s, of shape ``(turns, knots, cells)``."""
    frequency, shares = knots[:, 0, 0], knots[:, 0, 1:].T
    count = np.arange(turns)[:, None, None]
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.where(frequency > 0.0, (count + shares) / frequency, shares)


def held_at(knots: NDArray[np.float64], times: Any) -> list[NDArray[np.float64]]:
    """Held number of each threshold at times (s) whose last dimension is that of the cells."""
    found = []
    for i in range(knots.shape[1]):
        (turns, shares), (gain, after) = ((row[:, 0], row[:, 1:]) for row in (knots[:, i, 0], knots[:, i, 1]))
        turn = np.floor(turns * times)
        at = np.where(turns > 0.0, turns * times - turn, times)
        # Before the first knot of a turn, the last one of the turn before holds.
        last = (shares <= at[..., None]).sum(axis=-1) - 1
        found.append(after[np.arange(len(knots)), last] + gain * (turn - (last < 0)))
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
    for i in range(knots.shape[1] if continuous else 0):
        t = times_of(knots[:, i], _TURNS)
        with np.errstate(divide="ignore"):
            near = 1e-9 * np.where(knots[:, i, 0, 0] > 0.0, 1.0 / knots[:, i, 0, 0], spans)
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


def _turns_of(node: Node, values: Values) -> Any:
    """Frequency of a sine or cosine of a straight line in t, or of a switch or whole part, Hz; 0 of another node."""
    if node.kind in ("switch", "held"):
        return values["knots"][..., node.value, 0, 0]
    turning = frequency(node.parts[0]) if node.kind in ("sin", "cos") else None
    return np.zeros(()) if turning is None else abs(evaluate(turning[0], 0.0, values))


def period_of(node: Node, values: Values) -> Any:
    """Period of an expression, s; 0 for a constant, infinite if it does not repeat.

    It repeats if the time stands only in sines and cosines of straight lines in t, in switches and whole parts of
    them, whose periods have a common multiple, and in straight lines that together do not grow.
    """
    found: dict[Node, Any] = {}
    # How fast an expression grows, 1/s, beside what repeats.
    growths: dict[Node, Any] = {}
    for one in nodes_of(node):
        turns, parts = _turns_of(one, values), one.parts
        with np.errstate(divide="ignore"):
            period = np.where(turns > 0.0, 1.0 / turns, 0.0)
        growth: Any = 1.0 if one.kind == "variable" else 0.0
        if one.kind in ("switch", "held"):
            shares, gain = (values["knots"][..., one.value, i, k] for i, k in ((0, slice(1, None)), (1, 0)))
            once = ((shares > 0.0) & (shares < inf)).any(axis=-1)
            period, growth = np.where((turns == 0.0) & once, inf, period), gain * turns
        is_wave = one.kind in ("sin", "cos") and frequency(parts[0]) is not None
        for part in () if is_wave else parts:
            period = common_period(period, found[part])
        if one.kind == "add":
            growth = sum(growths[part] for part in parts)
            terms = sum(abs(growths[part]) for part in parts)
            growth = np.where(abs(growth) <= 1e-14 * terms, 0.0, growth)
        elif one.kind == "multiply" and not parts[0].varies:
            factor = evaluate(parts[0], 0.0, values)
            period, growth = np.where(factor == 0.0, 0.0, period), factor * growths[parts[1]]
        elif not is_wave:
            for part in parts:
                period = np.where(growths[part] == 0.0, period, inf)
        found[one], growths[one] = period, growth
    return np.where(growths[node] == 0.0, found[node], inf)


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
