"""Formulas of friction laws: from text to expressions, and the units of their parameters.

The text is read with Python's grammar, but it is never run. Names are the sliding speed ``v``, the coefficients
``mu_s`` and ``mu_k`` of the surface, ``pi``, and parameters of the law.
"""

from __future__ import annotations

import ast
import math
import re
from dataclasses import dataclass, field
from fractions import Fraction
from typing import Any

from ringsweep.numerics import expressions
from ringsweep.numerics.expressions import SPEED, Node, number, symbol

#: Fields of a law that follow from its parameters.
HIDDEN = ("slope_at_rest", "slope_beyond", "edges", "thresholds", "pieces", "band", "in_band")

#: Names that no parameter can have: those of the formula, keys of the section ``friction``, and what a law has besides.
RESERVED = frozenset(
    {"v", "pi", "mu", "law", "laws", "at_rest", "rough", "rest", "file", "viscous", "count", "index", *HIDDEN}
)

#: Coefficients of the surface.
COEFFICIENTS = ("mu_s", "mu_k")

# Longest text, in characters, and deepest nesting.
_LONGEST, _DEEPEST = 2000, 60

_ONE_ARGUMENT = ("exp", "log", "sqrt", "tanh", "atan", "abs")

_GRAMMAR = "numbers, v, names of parameters, + - * / **, exp log sqrt tanh atan abs min max, piecewise(v < v1, a, b)"


#: What a name with a meaning of its own stands for in a formula.
NAMES = {"v": "the sliding speed", "mu_s": "static friction", "mu_k": "kinetic friction", "pi": "3.14159"}


class FormulaError(ValueError):
    """Something in the definition of a law is wrong; the message says what, and what is allowed.

    Parameters
    ----------
    problem : str
        The message.
    key : str
        ``mu`` if the formula is wrong, or ``at_rest``.
    """

    def __init__(self, problem: str, key: str = "mu"):
        self.key = key
        super().__init__(problem)


@dataclass(frozen=True)
class Threshold:
    """A speed at which a formula switches between two expressions.

    Attributes
    ----------
    at : Node, optional
        The speed, m/s.
    difference : Node, optional
        If there is no `at`: the expression from which the speed is found.
    order : int
        Of a root, which one; number 0 is the speed zero if `difference` is positive at first. Of a head or tail, the
        factor of `difference` in the exponent. Of a bound of validity, which one.
    kind : str
        ``given``; ``root``, where `difference` changes its sign; ``head`` and ``tail``, below and beyond which an
        exponential is negligible; ``valid``, where `difference` becomes negative or is no number, or ceases to be so.
    within : tuple
        Switches that contain this one: (index of the threshold, whether it is on the lower side).
    """

    at: Node | None = None
    difference: Node | None = None
    order: int = 0
    kind: str = "given"
    within: tuple[tuple[int, bool], ...] = ()


@dataclass
class Formula:
    """Expression of a formula.

    Attributes
    ----------
    mu : Node
        Friction coefficient.
    thresholds : list of Threshold
        Speeds at which its switches switch.
    units : dict of str to str
        Units of the parameters; ``""`` where the unit does not follow from the formula.
    """

    mu: Node
    thresholds: list[Threshold] = field(default_factory=list)
    units: dict[str, str] = field(default_factory=dict)


def read_formula(text: Any) -> Formula:
    """Read the formula of a friction coefficient.

    Parameters
    ----------
    text : str
        For example ``"mu_k + (mu_s - mu_k)/(1 + delta*v)"``.

    Raises
    ------
    FormulaError
        If the text is no such formula, or its units contradict each other.
    """
    tree = _parsed(text)
    reader = _Reader(text)
    mu = reader.visit(tree, ())
    units = _Units()
    units.equal(units.visit(tree), _NONE, "the friction coefficient")
    return Formula(mu, reader.thresholds, units.solved())


def read_expression(text: str) -> Node:
    """Read an expression of parameters, without the speed and without switches."""
    reader = _Reader(text)
    found = reader.visit(_parsed(text), ())
    if found.varies:
        raise FormulaError(f"{text} depends on v")
    return found


def _parsed(text: Any) -> ast.expr:
    if not isinstance(text, str):
        raise FormulaError(f"a formula is a text such as mu_k + (mu_s - mu_k)*exp(-v/v_s), got {type(text).__name__}")
    if len(text) > _LONGEST:
        raise FormulaError(f"{len(text)} characters are too many: at most {_LONGEST}")
    plain = text.strip().replace("\N{MINUS SIGN}", "-").replace("\N{MULTIPLICATION SIGN}", "*")
    if "^" in plain:
        raise FormulaError("powers are written ** here, not ^")
    try:
        tree = ast.parse(plain.replace("\n", " "), mode="eval").body
    except (SyntaxError, ValueError, MemoryError, RecursionError):
        raise FormulaError(f"this is no formula (allowed: {_GRAMMAR})") from None
    if _depth(tree) > _DEEPEST:
        raise FormulaError(f"it is nested too deeply: at most {_DEEPEST} levels")
    return tree


def _depth(tree: ast.AST) -> int:
    deepest, level = 0, [tree]
    while level:
        deepest += 1
        level = [child for node in level for child in ast.iter_child_nodes(node)]
    return deepest


def _shown(node: ast.AST) -> str:
    text = ast.unparse(node)
    return text if len(text) <= 60 else text[:57] + "..."


class _Reader:
    """Makes expressions from the syntax tree of a formula."""

    def __init__(self, text: str) -> None:
        self.text = text
        self.thresholds: list[Threshold] = []

    def visit(self, tree: ast.expr, within: tuple[tuple[int, bool], ...]) -> Node:
        """Expression of a part of the formula, within some switches."""
        if isinstance(tree, ast.Constant):
            if isinstance(tree.value, bool) or not isinstance(tree.value, int | float) or not _finite(tree.value):
                raise FormulaError(f"{_shown(tree)} is not a finite number")
            return number(tree.value)
        if isinstance(tree, ast.Name):
            return _named(tree.id)
        if isinstance(tree, ast.UnaryOp) and isinstance(tree.op, ast.UAdd | ast.USub):
            inner = self.visit(tree.operand, within)
            return expressions.negative(inner) if isinstance(tree.op, ast.USub) else inner
        if isinstance(tree, ast.BinOp):
            return self._binary(tree, within)
        if isinstance(tree, ast.Call) and isinstance(tree.func, ast.Name) and not tree.keywords:
            return self._call(tree, tree.func.id, within)
        raise FormulaError(f"{_shown(tree)} is not understood (allowed: {_GRAMMAR})")

    def _binary(self, tree: ast.BinOp, within: tuple[tuple[int, bool], ...]) -> Node:
        a, b = self.visit(tree.left, within), self.visit(tree.right, within)
        if isinstance(tree.op, ast.Sub):
            return expressions.add(a, expressions.negative(b))
        for kind, operation in (
            (ast.Add, expressions.add),
            (ast.Mult, expressions.multiply),
            (ast.Div, expressions.divide),
            (ast.Pow, expressions.power),
        ):
            if isinstance(tree.op, kind):
                return operation(a, b)
        raise FormulaError(f"{_shown(tree)} is not understood (allowed: {_GRAMMAR})")

    def _call(self, tree: ast.Call, name: str, within: tuple[tuple[int, bool], ...]) -> Node:
        if name == "piecewise":
            return self._piecewise(tree, within)
        if name in ("min", "max"):
            if len(tree.args) < 2:
                raise FormulaError(f"{_shown(tree)}: {name} takes two arguments or more")
            found = self.visit(tree.args[0], within)
            for argument in tree.args[1:]:
                found = self._extreme(name, found, self.visit(argument, within), within)
            return found
        if name not in _ONE_ARGUMENT:
            raise FormulaError(f"{name} is not a known function (allowed: {_GRAMMAR})")
        if len(tree.args) != 1:
            raise FormulaError(f"{_shown(tree)}: {name} takes one argument")
        inner = self.visit(tree.args[0], within)
        if name == "abs":
            return inner if inner is SPEED else self._extreme("max", inner, expressions.negative(inner), within)
        found = expressions.function(name, inner)
        if not found.varies or name not in ("exp", "tanh"):
            return found
        # Beyond some speed the function is constant but for rounding, and so it may be below some speed: there the law
        # has regions of its own, in which steps need not resolve what has long decayed.
        moved = expressions.substitute(inner, {SPEED: expressions.ZERO}) is not expressions.ZERO
        exponent = expressions.negative(inner)
        if name == "exp":
            tail = Threshold(None, exponent, 1, "tail", within)
            found = self._switch(tail, found, expressions.ZERO)
            if not (moved and expressions.derivative(inner).varies):
                return found
            return self._switch(Threshold(None, exponent, 1, "head", within), expressions.ZERO, found)
        found = self._switch(Threshold(None, inner, 2, "tail", within), found, expressions.ONE)
        if not moved:
            return found
        return self._switch(Threshold(None, exponent, 2, "head", within), number(-1.0), found)

    def _switch(self, threshold: Threshold, below: Node, above: Node) -> Node:
        if threshold not in self.thresholds:
            self.thresholds.append(threshold)
        return expressions.switch(self.thresholds.index(threshold), below, above)

    def _extreme(self, name: str, a: Node, b: Node, within: tuple[tuple[int, bool], ...]) -> Node:
        """Smaller or greater of two expressions."""
        kind = "minimum" if name == "min" else "maximum"
        difference = expressions.add(a, expressions.negative(b))
        if not difference.varies:
            if a.varies:
                raise FormulaError(f"{name} of two expressions that differ by a constant: write the {kind} itself")
            return expressions.extreme(kind, a, b)
        if name == "max":
            difference = expressions.negative(difference)
        # Where the difference is negative the first one is taken. It may change its sign three times.
        found = a
        for order in (2, 1, 0):
            below, above = (a, found) if order % 2 == 0 else (b, found)
            found = self._switch(Threshold(None, difference, order, "root", within), below, above if order < 2 else b)
        return found

    def _piecewise(self, tree: ast.Call, within: tuple[tuple[int, bool], ...]) -> Node:
        if len(tree.args) < 3 or len(tree.args) % 2 == 0:
            raise FormulaError(f"{_shown(tree)}: write piecewise(v < v1, a, b), with a below v1 and b from v1 on")
        condition, first, *rest = tree.args
        limit, lower = self._limit(condition)
        threshold = Threshold(limit, within=within)
        if threshold not in self.thresholds:
            self.thresholds.append(threshold)
        index = self.thresholds.index(threshold)
        one = self.visit(first, (*within, (index, lower)))
        last = (*within, (index, not lower))
        other = self.visit(rest[0], last) if len(rest) == 1 else self._rest(rest, last)
        return expressions.switch(index, one, other) if lower else expressions.switch(index, other, one)

    def _rest(self, rest: list[ast.expr], within: tuple[tuple[int, bool], ...]) -> Node:
        call = ast.Call(ast.Name("piecewise"), rest, [])
        return self._piecewise(call, within)

    def _limit(self, condition: ast.expr) -> tuple[Node, bool]:
        """Speed that a condition compares v with, and whether the condition holds below it."""
        if isinstance(condition, ast.Compare) and len(condition.ops) == 1:
            left, right = condition.left, condition.comparators[0]
            less = isinstance(condition.ops[0], ast.Lt | ast.LtE)
            if less or isinstance(condition.ops[0], ast.Gt | ast.GtE):
                a, b = self.visit(left, ()), self.visit(right, ())
                if a is SPEED and not b.varies:
                    return b, less
                if b is SPEED and not a.varies:
                    return a, not less
        raise FormulaError(f"{_shown(condition)}: a condition compares v with a parameter, such as v < v1")


def _finite(value: float) -> bool:
    try:
        return math.isfinite(value)
    except OverflowError:
        return False


def _named(name: str) -> Node:
    if name == "v":
        return SPEED
    if name == "pi":
        return number(math.pi)
    if name in RESERVED or not re.fullmatch(r"[A-Za-z][A-Za-z0-9_]*", name):
        raise FormulaError(f"{name} cannot be the name of a parameter: take letters, digits and _, and another name")
    return symbol(name)


# ---- units ------------------------------------------------------------------------------------


@dataclass(frozen=True)
class _Dimension:
    """Exponents of metre and second, plus multiples of the unknown exponents of parameters."""

    known: tuple[Fraction, Fraction]
    unknown: tuple[tuple[str, Fraction], ...] = ()

    def plus(self, other: _Dimension, factor: Fraction) -> _Dimension:
        unknown = dict(self.unknown)
        for name, share in other.unknown:
            unknown[name] = unknown.get(name, Fraction(0)) + factor * share
        a, b = (x + factor * y for x, y in zip(self.known, other.known, strict=True))
        return _Dimension((a, b), tuple(item for item in unknown.items() if item[1]))


_ZERO = Fraction(0)
_NONE = _Dimension((_ZERO, _ZERO))
_SPEED = _Dimension((Fraction(1), Fraction(-1)))


class _Units:
    """Infers the units of parameters: sums need equal units, functions take plain numbers."""

    def __init__(self) -> None:
        self.names: list[str] = []
        self.equations: list[_Dimension] = []
        self.wildcards = 0

    def visit(self, tree: ast.expr) -> _Dimension:
        """Dimension of a part of the formula."""
        if isinstance(tree, ast.Constant):
            return self._any() if tree.value == 0 else _NONE
        if isinstance(tree, ast.Name):
            return self._of_name(tree.id)
        if isinstance(tree, ast.UnaryOp):
            return self.visit(tree.operand)
        if isinstance(tree, ast.BinOp):
            return self._binary(tree)
        if isinstance(tree, ast.Compare):
            first = self.visit(tree.left)
            self.equal(first, self.visit(tree.comparators[0]), _shown(tree))
            return first
        assert isinstance(tree, ast.Call)
        assert isinstance(tree.func, ast.Name)
        if tree.func.id == "piecewise":
            for condition in tree.args[:-1:2]:
                self.visit(condition)
            return self._alike([*tree.args[1::2], tree.args[-1]], tree)
        if tree.func.id in ("min", "max", "abs"):
            return self._alike(tree.args, tree)
        inner = self.visit(tree.args[0])
        if tree.func.id == "sqrt":
            return _NONE.plus(inner, Fraction(1, 2))
        self.equal(inner, _NONE, _shown(tree.args[0]))
        return _NONE

    def _any(self) -> _Dimension:
        # Zero has any unit.
        self.wildcards += 1
        return _Dimension((_ZERO, _ZERO), ((f"0_{self.wildcards}", Fraction(1)),))

    def _of_name(self, name: str) -> _Dimension:
        if name == "v":
            return _SPEED
        if name == "pi" or name in COEFFICIENTS:
            return _NONE
        if name not in self.names:
            self.names.append(name)
        return _Dimension((_ZERO, _ZERO), ((name, Fraction(1)),))

    def _binary(self, tree: ast.BinOp) -> _Dimension:
        a, b = self.visit(tree.left), self.visit(tree.right)
        if isinstance(tree.op, ast.Mult):
            return a.plus(b, Fraction(1))
        if isinstance(tree.op, ast.Div):
            return a.plus(b, Fraction(-1))
        if isinstance(tree.op, ast.Pow):
            exponent = read_expression(ast.unparse(tree.right)) if not _uses_speed(tree.right) else SPEED
            self.equal(b, _NONE, _shown(tree.right))
            if exponent.kind == "number":
                return _NONE.plus(a, Fraction(exponent.value).limit_denominator(1000))
            self.equal(a, _NONE, _shown(tree.left))
            return _NONE
        self.equal(a, b, _shown(tree))
        return a

    def _alike(self, trees: list[ast.expr], whole: ast.expr) -> _Dimension:
        found = [self.visit(tree) for tree in trees]
        for other in found[1:]:
            self.equal(found[0], other, _shown(whole))
        return found[0]

    def equal(self, a: _Dimension, b: _Dimension, where: str) -> None:
        """Demand equal dimensions of two parts."""
        equation = self._reduced(a.plus(b, Fraction(-1)))
        if not equation.unknown:
            if any(equation.known):
                raise FormulaError(f"units do not fit in {where}: {self._text(a)} and {self._text(b)} (v is in m/s)")
            return
        name, share = equation.unknown[0]
        scaled = _NONE.plus(equation, 1 / share)
        self.equations = [self._without(other, name, scaled) for other in self.equations] + [scaled]

    @staticmethod
    def _without(dimension: _Dimension, name: str, equation: _Dimension) -> _Dimension:
        share = dict(dimension.unknown).get(name)
        return dimension.plus(equation, -share) if share else dimension

    def _reduced(self, dimension: _Dimension) -> _Dimension:
        for equation in self.equations:
            dimension = self._without(dimension, equation.unknown[0][0], equation)
        return dimension

    def _text(self, dimension: _Dimension) -> str:
        found = self._reduced(dimension)
        return "another unit" if found.unknown else (unit_text(found.known) or "a fractional unit")

    def solved(self) -> dict[str, str]:
        """Unit of each parameter; ``""`` where it is not determined."""
        found = {}
        for name in self.names:
            dimension = self._reduced(self._of_name(name))
            found[name] = "" if dimension.unknown else unit_text(dimension.known)
        return found


def _uses_speed(tree: ast.expr) -> bool:
    return any(isinstance(node, ast.Name) and node.id == "v" for node in ast.walk(tree))


def unit_text(exponents: tuple[Fraction, Fraction]) -> str:
    """Unit with these exponents of metre and second, such as ``"s/m"``; ``""`` if an exponent is not whole."""
    if any(exponent.denominator != 1 for exponent in exponents):
        return ""

    def factors(sign: int) -> list[str]:
        powers = [(name, sign * int(exponent)) for name, exponent in zip("ms", exponents, strict=True)]
        return [name if power == 1 else f"{name}^{power}" for name, power in powers if power > 0]

    return "/".join([" ".join(factors(1)) or "1", *factors(-1)])
