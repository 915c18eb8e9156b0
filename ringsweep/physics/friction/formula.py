"""Formulas of friction laws: from text to expressions, and the units of their parameters.

The text is read with Python's grammar, but it is never run. Names are the sliding speed ``v``, its ``direction``, the
coefficients ``mu_s`` and ``mu_k`` of the surface, ``pi``, and parameters of the law.

`within` lists the switches within which a part of the formula stands: pairs of an index of a threshold, and whether
the part holds below it. Nothing here runs in kernels.
"""

from __future__ import annotations

import ast
import math
import re
import sys
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from fractions import Fraction
from typing import Any

from ringsweep.numerics import expressions
from ringsweep.numerics.expressions import SPEED, Node, number, symbol

#: Fields of a law that follow from its parameters.
HIDDEN = ("slope_at_rest", "slope_beyond", "edges", "thresholds", "thresholds_back", "pieces", "band", "in_band")

#: Names that no parameter can have: those of the formula, keys of the section ``friction``, and what a law has besides.
RESERVED = frozenset(
    {"v", "pi", "mu", "law", "laws", "at_rest", "rough", "elsewhere", "rest", "file", "viscous", "count", "index"}
    | {*HIDDEN}
)

#: Coefficients of the surface.
COEFFICIENTS = ("mu_s", "mu_k")

#: Direction of sliding: 1 forwards, -1 backwards.
DIRECTION = symbol("direction")

# Longest text, in characters, and deepest nesting.
_LONGEST, _DEEPEST = 2000, 60

# Greatest number.
_GREATEST = sys.float_info.max


@dataclass(frozen=True)
class Language:
    """What formulas of one variable may contain.

    Attributes
    ----------
    variable : Node
    name : str
        Name of the variable in formulas.
    functions : tuple of str
        Functions of one argument.
    reserved : frozenset of str
        Names that no parameter can have.
    units : dict of str to str
        Units of the names that are no parameters.
    example : str
    """

    variable: Node
    name: str
    functions: tuple[str, ...]
    reserved: frozenset[str]
    units: Mapping[str, str]
    example: str

    @property
    def signed(self) -> bool:
        """Whether formulas may have the direction of sliding."""
        return DIRECTION.value in self.units

    @property
    def grammar(self) -> str:
        """What is allowed, in words."""
        x, functions = self.name, " ".join([*self.functions, "min", "max"])
        names = f"{x}, {'direction, ' * self.signed}names of parameters"
        return f"numbers, {names}, + - * / **, {functions}, piecewise({x} < {x}1, a, b)"


#: The language of friction laws.
FRICTION = Language(
    variable=SPEED,
    name="v",
    functions=("exp", "log", "sqrt", "tanh", "atan", "abs"),
    reserved=RESERVED,
    units={"v": "m/s", "pi": "1", "mu_s": "1", "mu_k": "1", DIRECTION.value: "1"},
    example="mu_k + (mu_s - mu_k)*exp(-v/v_s)",
)


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
        """`problem` is the message; `key` is the key of the configuration that is wrong."""
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
    signed : bool
        Whether it has the direction of sliding.
    """

    mu: Node
    thresholds: list[Threshold] = field(default_factory=list)
    units: dict[str, str] = field(default_factory=dict)
    signed: bool = False


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
    tree = parsed(text)
    reader = Reader()
    mu = reader.visit(tree, ())
    units = Units()
    units.equal(units.visit(tree), _NONE, "the friction coefficient")
    signed = any(isinstance(node, ast.Name) and node.id == DIRECTION.value for node in ast.walk(tree))
    return Formula(mu, reader.thresholds, units.solved(), signed)


def read_expression(text: str) -> Node:
    """Read an expression of parameters, without the speed and without switches."""
    found = Reader().visit(parsed(text), ())
    if found.varies:
        raise FormulaError(f"{text} depends on v")
    return found


def parsed(text: Any, language: Language = FRICTION) -> ast.expr:
    """Syntax tree of a formula."""
    if not isinstance(text, str):
        raise FormulaError(f"a formula is a text such as {language.example}, got {type(text).__name__}")
    if len(text) > _LONGEST:
        raise FormulaError(f"{len(text)} characters are too many: at most {_LONGEST}")
    plain = text.strip().replace("\N{MINUS SIGN}", "-").replace("\N{MULTIPLICATION SIGN}", "*")
    if "^" in plain:
        raise FormulaError("powers are written ** here, not ^")
    try:
        tree = ast.parse(plain.replace("\n", " "), mode="eval").body
    except (SyntaxError, ValueError, MemoryError, RecursionError):
        raise FormulaError(f"this is no formula (allowed: {language.grammar})") from None
    if _depth(tree) > _DEEPEST:
        raise FormulaError(f"it is nested too deeply: at most {_DEEPEST} levels")
    return tree


def _depth(tree: ast.AST) -> int:
    """Depth of a tree of Python's grammar."""
    deepest, level = 0, [tree]
    while level:
        deepest += 1
        level = [child for node in level for child in ast.iter_child_nodes(node)]
    return deepest


def _shown(node: ast.AST) -> str:
    """Text of a part of a formula in an error message, at most 60 letters."""
    text = ast.unparse(node)
    return text if len(text) <= 60 else text[:57] + "..."


_OPERATIONS: Mapping[type, Callable[[Node, Node], Node]] = {
    ast.Add: expressions.add,
    ast.Sub: lambda a, b: expressions.add(a, expressions.negative(b)),
    ast.Mult: expressions.multiply,
    ast.Div: expressions.divide,
    ast.Pow: expressions.power,
}


class Reader:
    """Makes expressions from the syntax tree of a formula."""

    def __init__(self, language: Language = FRICTION) -> None:
        """Read formulas of a language; no threshold is known yet."""
        self.language = language
        self.thresholds: list[Threshold] = []

    def visit(self, tree: ast.expr, within: tuple[tuple[int, bool], ...]) -> Node:
        """Expression of a part of the formula, within some switches."""
        match tree:
            case ast.Constant(value=value):
                if isinstance(value, bool) or not isinstance(value, int | float) or abs(value) > _GREATEST:
                    raise FormulaError(f"{_shown(tree)} is not a finite number")
                return number(value)
            case ast.Name(id=name):
                return self._named(name)
            case ast.UnaryOp(op=ast.UAdd(), operand=inner):
                return self.visit(inner, within)
            case ast.UnaryOp(op=ast.USub(), operand=inner):
                return expressions.negative(self.visit(inner, within))
            case ast.BinOp(left=left, op=operation, right=right) if type(operation) in _OPERATIONS:
                return _OPERATIONS[type(operation)](self.visit(left, within), self.visit(right, within))
            case ast.Compare():
                # A condition is 1 where it holds, else 0.
                return self._piecewise(ast.Call(ast.Name("piecewise"), [tree, *map(ast.Constant, (1, 0))], []), within)
            case ast.Call(func=ast.Name(id=name), keywords=[]):
                return self._call(tree, name, within)
        raise FormulaError(f"{_shown(tree)} is not understood (allowed: {self.language.grammar})")

    def _call(self, tree: ast.Call, name: str, within: tuple[tuple[int, bool], ...]) -> Node:
        """Expression of a call; `within` are the switches, and the sides, within which it stands."""
        if name == "piecewise":
            return self._piecewise(tree, within)
        if name in ("min", "max"):
            if len(tree.args) < 2:
                raise FormulaError(f"{_shown(tree)}: {name} takes two arguments or more")
            found = self.visit(tree.args[0], within)
            for argument in tree.args[1:]:
                found = self._extreme(name, found, self.visit(argument, within), within)
            return found
        if name not in self.language.functions:
            raise FormulaError(f"{name} is not a known function (allowed: {self.language.grammar})")
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
        falling, is_exp = expressions.negative(inner), name == "exp"
        low, high = (expressions.ZERO, expressions.ZERO) if is_exp else (number(-1.0), expressions.ONE)
        order = 1 if is_exp else 2
        found = self._switch(Threshold(None, falling if is_exp else inner, order, "tail", within), found, high)
        moved = expressions.substitute(inner, {SPEED: expressions.ZERO}) is not expressions.ZERO
        if moved and not (is_exp and not expressions.derivative(inner).varies):
            found = self._switch(Threshold(None, falling, order, "head", within), low, found)
        return found

    def _index(self, threshold: Threshold) -> int:
        """Index of a threshold, which is added if it is new."""
        if threshold not in self.thresholds:
            self.thresholds.append(threshold)
        return self.thresholds.index(threshold)

    def _switch(self, threshold: Threshold, below: Node, above: Node) -> Node:
        """Expression that is `below` at speeds below a threshold, and `above` from it on."""
        return expressions.switch(self._index(threshold), below, above)

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
        return self._first_where_negative(difference, a, b, within)

    def _first_where_negative(self, difference: Node, a: Node, b: Node, within: tuple[tuple[int, bool], ...]) -> Node:
        """The first of two expressions where a difference is negative, the second elsewhere."""
        # The difference may change its sign three times.
        found = a
        for order in (2, 1, 0):
            below, above = (a, found) if order % 2 == 0 else (b, found)
            found = self._switch(Threshold(None, difference, order, "root", within), below, above if order < 2 else b)
        return found

    def _piecewise(self, tree: ast.Call, within: tuple[tuple[int, bool], ...]) -> Node:
        """Expression of ``piecewise(condition, a, b)``; more conditions are nested."""
        if len(tree.args) < 3 or len(tree.args) % 2 == 0:
            x = self.language.name
            example = f"piecewise({x} < {x}1, a, b), with a below {x}1 and b from {x}1 on"
            raise FormulaError(f"{_shown(tree)}: write {example}")
        condition, first, *rest = tree.args
        limit, lower = self._limit(condition)
        index = self._index(replace(limit, within=within))
        one = self.visit(first, (*within, (index, lower)))
        last = (*within, (index, not lower))
        other = self.visit(rest[0] if len(rest) == 1 else ast.Call(ast.Name("piecewise"), rest, []), last)
        return expressions.switch(index, one, other) if lower else expressions.switch(index, other, one)

    def _limit(self, condition: ast.expr) -> tuple[Threshold, bool]:
        """Threshold of a condition, and whether the condition holds below it."""
        if isinstance(condition, ast.Compare) and len(condition.ops) == 1:
            left, right = condition.left, condition.comparators[0]
            less = isinstance(condition.ops[0], ast.Lt | ast.LtE)
            if less or isinstance(condition.ops[0], ast.Gt | ast.GtE):
                a, b = self.visit(left, ()), self.visit(right, ())
                if a is self.language.variable and not b.varies:
                    return Threshold(b), less
                if b is self.language.variable and not a.varies:
                    return Threshold(a), not less
                # No speed is beyond an infinite one, and none is below a negative one.
                if self.language.signed and {a, b} == {DIRECTION, expressions.ZERO}:
                    return Threshold(expressions.multiply(number(math.inf), DIRECTION)), less is (a is expressions.ZERO)
        x = self.language.name
        or_direction = ", or is direction > 0" * self.language.signed
        problem = f"a condition compares {x} with a parameter, such as {x} < {x}1{or_direction}"
        raise FormulaError(f"{_shown(condition)}: {problem}")

    def _named(self, name: str) -> Node:
        """Expression of a name: the variable, ``pi``, or a parameter."""
        if name == self.language.name:
            return self.language.variable
        if name == "pi":
            return number(math.pi)
        if name in self.language.reserved or not re.fullmatch(r"[A-Za-z][A-Za-z0-9_]*", name):
            remedy = "take letters, digits and _, and another name"
            raise FormulaError(f"{name} cannot be the name of a parameter: {remedy}")
        return symbol(name)


# ---- units ------------------------------------------------------------------------------------

#: Exponents of base units, and of the units of parameters: their names with a dot. No entry: no unit.
Unit = Mapping[str, Fraction]

# Base units. The radian is no more than a mark: it tells rad/s from Hz, and never makes units contradict each other.
_BASE = ("N", "m", "rad", "s")
_NONE: Unit = {}


def unit_of(text: str) -> Unit:
    """Unit from a quotient of base units, such as ``"m/s"``."""
    above, _, below = text.partition("/")
    return {name: Fraction(power) for name, power in ((above, 1), (below, -1)) if name in _BASE}


def _times(a: Unit, b: Unit, power: Fraction | int = 1) -> Unit:
    """Product of a unit and a power of another one."""
    product = {name: a.get(name, Fraction(0)) + power * b.get(name, Fraction(0)) for name in {**a, **b}}
    return {name: exponent for name, exponent in product.items() if exponent}


def _unknown(unit: Unit) -> list[str]:
    """Parameters whose units a unit contains."""
    return [name for name in unit if name.startswith(".")]


class Units:
    """Infers the units of parameters: sums need equal units, functions take plain numbers, or angles."""

    def __init__(self, language: Language = FRICTION) -> None:
        """Infer units in formulas of a language; no unit is known yet."""
        self.language = language
        self.names: dict[str, None] = {}
        # Units of parameters as far as they are known: none contains another of these parameters.
        self.found: dict[str, Unit] = {}

    def visit(self, tree: ast.expr) -> Unit:
        """Unit of a part of the formula."""
        match tree:
            case ast.Constant(value=value):
                # Zero has any unit.
                return {f".{id(tree)}": Fraction(1)} if value == 0 else _NONE
            case ast.Name(id=name):
                if name in self.language.units:
                    return unit_of(self.language.units[name])
                self.names[name] = None
                return {f".{name}": Fraction(1)}
            case ast.UnaryOp(operand=inner):
                return self.visit(inner)
            case ast.BinOp(left=left, op=ast.Mult() | ast.Div() as operation, right=right):
                return _times(self.visit(left), self.visit(right), 1 if isinstance(operation, ast.Mult) else -1)
            case ast.BinOp(left=left, op=ast.Pow(), right=right):
                return self._power(left, right)
            case ast.BinOp(left=left, right=right):
                return self._alike([left, right], tree)
            case ast.Compare(left=left, comparators=[right]):
                self._alike([left, right], tree)
                return _NONE
            case ast.Call(func=ast.Name(id="piecewise"), args=[*arguments]):
                for condition in arguments[:-1:2]:
                    self.visit(condition)
                return self._alike([*arguments[1::2], arguments[-1]], tree)
            case ast.Call(func=ast.Name(id="min" | "max" | "abs"), args=[*arguments]):
                return self._alike(arguments, tree)
            case ast.Call(func=ast.Name(id="sign"), args=[inner]):
                self.visit(inner)
                return _NONE
            case ast.Call(func=ast.Name(id="sqrt"), args=[inner]):
                return _times(_NONE, self.visit(inner), Fraction(1, 2))
            case ast.Call(func=ast.Name(id=name), args=[inner]):
                takes = "rad" if name in ("sin", "cos", "tan") else "1"
                self.equal(self.visit(inner), unit_of(takes), _shown(inner))
        return _NONE

    def _power(self, base: ast.expr, exponent: ast.expr) -> Unit:
        """Unit of a power; only a constant exponent is allowed if the base has a unit."""
        unit, of_exponent = self.visit(base), self.visit(exponent)
        varies = any(isinstance(node, ast.Name) and node.id == self.language.name for node in ast.walk(exponent))
        value = SPEED if varies else Reader(self.language).visit(exponent, ())
        self.equal(of_exponent, _NONE, _shown(exponent))
        if value.kind == "number":
            return _times(_NONE, unit, Fraction(value.value).limit_denominator(1000))
        self.equal(unit, _NONE, _shown(base))
        return _NONE

    def _alike(self, trees: list[ast.expr], whole: ast.expr) -> Unit:
        """Unit that some parts of a formula share."""
        first, *others = [self.visit(tree) for tree in trees]
        for other in others:
            self.equal(first, other, _shown(whole))
        return first

    def equal(self, a: Unit, b: Unit, where: str) -> None:
        """Demand equal units of two parts."""
        ratio = self._reduced(_times(a, b, -1))
        if unknown := _unknown(ratio):
            name = unknown[0]
            self.found[name] = _times({name: Fraction(1)}, ratio, -1 / ratio[name])
            self.found = {other: self._reduced(unit) for other, unit in self.found.items()}
        elif ratio.keys() - {"rad"}:
            known = f"{self.language.name} is in {self.language.units[self.language.name]}"
            raise FormulaError(f"units do not fit in {where}: {self._text(a)} and {self._text(b)} ({known})")

    def _reduced(self, unit: Unit) -> Unit:
        """The same unit, without those of parameters that are known."""
        for name, power in unit.items():
            if name in self.found:
                unit = _times(_times(unit, {name: power}, -1), self.found[name], power)
        return unit

    def _text(self, unit: Unit) -> str:
        """Text of a unit in an error message."""
        found = self._reduced(unit)
        return "another unit" if _unknown(found) else (unit_text(found) or "a fractional unit")

    def solved(self) -> dict[str, str]:
        """Unit of each parameter; ``""`` where it is not determined."""
        units = {name: self._reduced({f".{name}": Fraction(1)}) for name in self.names}
        return {name: "" if _unknown(unit) else unit_text(unit) for name, unit in units.items()}


def unit_text(unit: Unit) -> str:
    """Unit in words, such as ``"s/m"``; ``""`` if an exponent is not whole."""
    # An amplitude over an angular frequency is no square of an angle.
    shown = {name: min(max(e, Fraction(0)), Fraction(1)) if name == "rad" else e for name, e in unit.items()}
    if any(exponent.denominator != 1 for exponent in shown.values()):
        return ""

    def factors(sign: int) -> list[str]:
        powers = [(name, sign * shown.get(name, Fraction(0))) for name in _BASE]
        return [name if power == 1 else f"{name}^{power}" for name, power in powers if power > 0]

    return "/".join([" ".join(factors(1)) or "1", *factors(-1)])
