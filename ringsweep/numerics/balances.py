"""Equations that are linear in their unknowns: from texts to the source code of their solution.

An equation is a text such as ``mass*radius*phi_dd = -mass*gravity*sin_phi + K1*N1``. Both sides are polynomials. The
unknowns are found by Cramer's rule, whose determinants are polynomials again, so that derivatives and power series of
the solution follow. In the source code a factor that depends on parameters only is a constant of the body: it is
computed once.
"""

from __future__ import annotations

import ast
from collections.abc import Iterable, Mapping, Sequence
from typing import Any

#: Symbols of a product with their powers, in alphabetical order.
Monomial = tuple[tuple[str, int], ...]

_Row = dict[Monomial, "Polynomial"]


class Polynomial(dict[Monomial, float]):
    """Polynomial in any number of symbols: the factor of each product of symbols. Factors that vanish are left out."""

    def __init__(self, terms: Iterable[tuple[Monomial, float]] = ()):
        super().__init__()
        for monomial, factor in terms:
            self[monomial] = self.get(monomial, 0.0) + factor
            if self[monomial] == 0.0:
                del self[monomial]

    def __add__(self, other: Polynomial) -> Polynomial:
        return Polynomial([*self.items(), *other.items()])

    def __neg__(self) -> Polynomial:
        return number(-1.0) * self

    def __sub__(self, other: Polynomial) -> Polynomial:
        return self + -other

    def __mul__(self, other: Polynomial) -> Polynomial:
        return Polynomial((_product(a, b), p * q) for a, p in self.items() for b, q in other.items())

    def substitute(self, values: Mapping[str, Polynomial]) -> Polynomial:
        """Polynomial in which symbols are replaced by polynomials."""
        found = Polynomial()
        for monomial, factor in self.items():
            term = number(factor)
            for name, power in monomial:
                term *= raised(values[name], power) if name in values else Polynomial([(((name, power),), 1.0)])
            found += term
        return found

    def rate(self, rates: Mapping[str, Polynomial]) -> Polynomial:
        """Derivative, from the derivatives of the symbols."""
        found = Polynomial()
        for monomial, factor in self.items():
            for name, power in monomial:
                if name in rates:
                    rest = Polynomial([(_product(monomial, ((name, -1),)), factor * power)])
                    found += rest * rates[name]
        return found

    def part(self, names: Iterable[str]) -> dict[Monomial, Polynomial]:
        """The factor of each product of `names`; the factors have the other symbols."""
        kept, found = set(names), dict[Monomial, Polynomial]()
        for monomial, factor in self.items():
            key = tuple(item for item in monomial if item[0] in kept)
            rest = tuple(item for item in monomial if item[0] not in kept)
            found[key] = found.get(key, Polynomial()) + Polynomial([(rest, factor)])
        return found

    def without(self, names: Iterable[str]) -> Polynomial:
        """The terms in which none of `names` occurs."""
        return self.part(names).get((), Polynomial())

    @property
    def symbols(self) -> set[str]:
        """Names of the symbols."""
        return {name for monomial in self for name, _ in monomial}


def _product(a: Monomial, b: Monomial) -> Monomial:
    powers = dict(a)
    for name, power in b:
        powers[name] = powers.get(name, 0) + power
    return tuple(sorted((name, power) for name, power in powers.items() if power))


def number(value: float) -> Polynomial:
    """A constant."""
    return Polynomial([((), value)])


def symbol(name: str) -> Polynomial:
    """A symbol."""
    return Polynomial([(((name, 1),), 1.0)])


def raised(p: Polynomial, power: int) -> Polynomial:
    """Whole power, at least 0."""
    return number(1.0) if power == 0 else p * raised(p, power - 1)


def read_polynomial(text: str) -> Polynomial:
    """Polynomial from a text: numbers, names, ``+ - *``, and ``**`` with a whole number.

    Raises
    ------
    ValueError
        If the text is anything else.
    """

    def read(node: ast.AST) -> Polynomial:
        if isinstance(node, ast.Constant) and isinstance(node.value, (int, float)):
            return number(float(node.value))
        if isinstance(node, ast.Name):
            return symbol(node.id)
        if isinstance(node, ast.UnaryOp) and isinstance(node.op, ast.USub):
            return -read(node.operand)
        if isinstance(node, ast.BinOp):
            left, right = read(node.left), read(node.right)
            if isinstance(node.op, ast.Add):
                return left + right
            if isinstance(node.op, ast.Sub):
                return left - right
            if isinstance(node.op, ast.Mult):
                return left * right
            if isinstance(node.op, ast.Pow) and not right.symbols and right.get((), 0.0) in range(10):
                return raised(left, int(right.get((), 0.0)))
        raise ValueError(f"{ast.unparse(node)!r}: write numbers, names, + - *, and ** with a whole number")

    try:
        return read(ast.parse(text.strip(), mode="eval").body)
    except SyntaxError:
        raise ValueError(f"{text!r} is not an expression") from None


def read_equation(text: str) -> Polynomial:
    """Right side less left side of an equation; see :func:`read_polynomial`."""
    sides = text.split("=")
    if len(sides) != 2:
        raise ValueError(f"{text!r}: write one '=' between two sides")
    return read_polynomial(sides[1]) - read_polynomial(sides[0])


def linear(equation: Polynomial, unknowns: Sequence[str]) -> list[Polynomial]:
    """Factor of each unknown in an equation, and what is left.

    Raises
    ------
    ValueError
        If the equation is not linear in the unknowns.
    """
    parts = equation.part(unknowns)
    wanted: list[Monomial] = [((name, 1),) for name in unknowns]
    strange = [monomial for monomial in parts if monomial and monomial not in wanted]
    if strange:
        raise ValueError(f"it is not linear in {', '.join(unknowns)}")
    return [parts.get(monomial, Polynomial()) for monomial in [*wanted, ()]]


def determinant(matrix: Sequence[Sequence[Polynomial]]) -> Polynomial:
    """Determinant of a square matrix."""
    if not matrix:
        return number(1.0)
    found, sign = Polynomial(), 1.0
    for column, entry in enumerate(matrix[0]):
        if entry:
            minor = [[*row[:column], *row[column + 1 :]] for row in matrix[1:]]
            found += number(sign) * entry * determinant(minor)
        sign = -sign
    return found


def solve(equations: Sequence[Polynomial], unknowns: Sequence[str]) -> tuple[list[Polynomial], Polynomial]:
    """Numerators of the unknowns, and their common denominator, the determinant of the equations."""
    rows = [linear(equation, unknowns) for equation in equations]
    whole = determinant([row[:-1] for row in rows])
    numerators = []
    for column in range(len(unknowns)):
        replaced = [[*row[:column], -row[-1], *row[column + 1 : -1]] for row in rows]
        numerators.append(determinant(replaced))
    # A single product can be divided by: then no division is left.
    if len(whole) == 1:
        ((monomial, factor),) = whole.items()
        inverse = Polynomial([(tuple((name, -power) for name, power in monomial), 1.0 / factor)])
        return [numerator * inverse for numerator in numerators], number(1.0)
    return numerators, whole


class Source:
    """Source code of polynomials in the fields of a body and in other symbols.

    Parameters
    ----------
    fields : sequence of str
        Fields of the body, which the code calls ``body``. Products and sums of them are numbers of ``body.constants``.
    inner : sequence of str
        Symbols, like friction, in which the factors of the other, outer symbols are collected.

    Attributes
    ----------
    constants : dict
        Polynomials whose values are ``body.constants``, in this order.
    """

    def __init__(self, fields: Sequence[str], inner: Sequence[str]):
        self.fields, self.inner, self.plain = frozenset(fields), frozenset(inner), False
        self.constants: dict[tuple[tuple[Monomial, float], ...], Polynomial] = {}
        self.lines: list[str] = []
        self._names: dict[str, str] = {}

    def begin(self, *, plain: bool = False) -> Source:
        """Begin the body of a new function. A `plain` one uses no constants: it is written in the fields alone."""
        self.lines, self._names, self.plain = [], {}, plain
        return self

    def end(self, *results: str) -> list[str]:
        """Lines of the function that returns `results`."""
        return [*self.lines, f"return {results[0] if len(results) == 1 else '(' + ', '.join(results) + ')'}"]

    def name(self, text: str) -> str:
        """Name of the value of an expression, which is computed once."""
        if not any(sign in text for sign in "+-*/ "):
            return text
        if text not in self._names:
            self._names[text] = f"n{len(self._names)}"
            self.lines.append(f"{self._names[text]} = {text}")
        return self._names[text]

    def value(self, p: Polynomial) -> str:
        """Name of the value of a polynomial."""
        terms = []
        for rows, primitive in self._proportional(p):
            if len(rows) == 1:
                ((monomial, row),) = rows.items()
                terms += self._products(monomial, row)
            else:
                loads = [(*self._constant(_content(row)), _power_text(monomial)) for monomial, row in rows.items()]
                terms.append((1.0, self._sum(loads), self._row(primitive)))
        return self._sum(terms)

    def factors(self, p: Polynomial) -> dict[Monomial, str]:
        """Names of the factors of the outer symbols in a polynomial, by product of these symbols."""
        found = {}
        for rows, primitive in self._proportional(p):
            for monomial, row in rows.items():
                if len(rows) == 1:
                    found[monomial] = self._row(row)
                else:
                    found[monomial] = self._sum([(*self._constant(_content(row)), self._row(primitive))])
        return found

    def _proportional(self, p: Polynomial) -> list[tuple[dict[Monomial, _Row], _Row]]:
        """Factors of the outer symbols, in groups that differ by parameters only; and what they have in common."""
        groups: dict[Any, tuple[dict[Monomial, _Row], _Row]] = {}
        outer = {name for name in p.symbols if name not in self.fields and name not in self.inner}
        for monomial, rest in sorted(p.part(outer).items()):
            row = rest.part(self.inner)
            primitive = {key: entry * _inverse(_content(row)) for key, entry in row.items()}
            key = frozenset((key, tuple(sorted(entry.items()))) for key, entry in primitive.items())
            groups.setdefault(key, ({}, primitive))[0][monomial] = row
        return list(groups.values())

    def _products(self, monomial: Monomial, row: _Row) -> list[tuple[float, str, str]]:
        if len(row) == 1:
            ((key, entry),) = row.items()
            sign, constant = self._constant(entry)
            return [(sign, constant, self.name(_power_text(_product(key, monomial))))]
        return [(1.0, _power_text(monomial), self._row(row))]

    def _row(self, row: _Row) -> str:
        """Polynomial in the inner symbols; terms with the same factor are added first."""
        groups: dict[str, list[tuple[float, Monomial]]] = {}
        for key, entry in sorted(row.items()):
            sign, constant = self._constant(entry)
            groups.setdefault(constant, []).append((sign, key))
        terms = []
        for constant, parts in groups.items():
            first = parts[0][0]
            added = self._sum([(first * sign, "1.0", self.name(_power_text(key))) for sign, key in parts])
            terms.append((first, constant, added))
        return self._sum(terms)

    def _sum(self, terms: Sequence[tuple[float, str, str]]) -> str:
        """Name of a sum of products with signs."""
        text = ""
        for sign, *pair in sorted(terms, key=lambda term: term[0] < 0.0):
            factors = [factor for factor in pair if factor != "1.0"]
            product = " * ".join(map(self.name, factors)) or "1.0"
            text += f" {'-' if sign < 0.0 else '+'} {product}" if text else f"-{product}" if sign < 0.0 else product
        return self.name(text or "0.0")

    def _constant(self, p: Polynomial) -> tuple[float, str]:
        """Sign and text of a polynomial in the parameters."""
        sign = -1.0 if min(p.items())[1] < 0.0 else 1.0
        p = number(sign) * p
        ((monomial, factor), *others) = p.items()
        if not others and not monomial:
            return sign, repr(factor)
        if not others and factor == 1.0 and len(monomial) == 1 and monomial[0][1] == 1:
            return sign, f"body.{monomial[0][0]}"
        if self.plain:
            products = [(value, _power_text(monomial, "body.")) for monomial, value in p.items()]
            return sign, self._sum([(value, repr(abs(value)), self.name(text)) for value, text in products])
        key = tuple(sorted(p.items()))
        self.constants.setdefault(key, p)
        place = list(self.constants).index(key)
        return sign, f"body.constants[{place}]"


def _content(row: Mapping[Monomial, Polynomial]) -> Polynomial:
    """Product that divides all entries; with it the first factor becomes 1."""
    monomials = [dict(monomial) for entry in row.values() for monomial in entry]
    names = sorted({name for monomial in monomials for name in monomial})
    common = [(name, min(monomial.get(name, 0) for monomial in monomials)) for name in names]
    first = min(min(row.items())[1].items())[1]
    return Polynomial([(tuple((name, power) for name, power in common if power), first)])


def _inverse(product: Polynomial) -> Polynomial:
    ((monomial, factor),) = product.items()
    return Polynomial([(tuple((name, -power) for name, power in monomial), 1.0 / factor)])


def _power_text(monomial: Monomial, prefix: str = "") -> str:
    return " * ".join(prefix + name for name, power in monomial for _ in range(power)) or "1.0"


def evaluate(p: Polynomial, values: Any) -> Any:
    """Value of a polynomial whose symbols are attributes of `values`."""
    found: Any = 0.0
    for monomial, factor in p.items():
        term: Any = factor
        for name, power in monomial:
            term = term * getattr(values, name) ** power
        found = found + term
    return found
