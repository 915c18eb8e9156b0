"""Equations that are linear in their unknowns: from texts to the source code of their solution.

An equation is a text such as ``mass*radius*phi_dd = -mass*gravity*sin_phi + K1*N1``. Both sides are polynomials. The
unknowns are found by Cramer's rule, whose determinants are polynomials again, so that derivatives and power series of
the solution follow. In the source code a factor that depends on parameters only is a constant of the body: it is
computed once.

A *monomial* is a tuple of names with their powers; a :class:`Polynomial` maps monomials to numbers.
:mod:`ringsweep.physics.bodies` and :mod:`ringsweep.physics.pivot` call this file when a body is declared, never
during a run.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from difflib import get_close_matches
from typing import Any

#: Symbols of a product with their powers, in alphabetical order.
Monomial = tuple[tuple[str, int], ...]


class Polynomial(dict[Monomial, float]):
    """Polynomial in any number of symbols: the factor of each product of symbols. Factors that vanish are left out."""

    def __init__(self, terms: Iterable[tuple[Monomial, float]] = ()):
        """Sum of terms, each a monomial and its factor; terms that cancel are left out."""
        super().__init__()
        for monomial, factor in terms:
            self[monomial] = self.get(monomial, 0.0) + factor
            if self[monomial] == 0.0:
                del self[monomial]

    def __add__(self, other: Any) -> Polynomial:
        """Sum with a polynomial or a number."""
        return Polynomial([*self.items(), *_as_polynomial(other).items()])

    def __neg__(self) -> Polynomial:
        """Negative."""
        return self * -1.0

    def __sub__(self, other: Any) -> Polynomial:
        """Difference from a polynomial or a number."""
        return self + _as_polynomial(other) * -1.0

    def __rsub__(self, other: Any) -> Polynomial:
        """A number less this polynomial."""
        return other + -self

    def __mul__(self, other: Any) -> Polynomial:
        """Product with a polynomial or a number."""
        pairs = ((a, p, b, q) for a, p in self.items() for b, q in _as_polynomial(other).items())
        return Polynomial((_product(a, b), p * q) for a, p, b, q in pairs)

    def __pow__(self, power: int) -> Polynomial:
        """Power with a whole exponent, 0 or more."""
        return self * self ** (power - 1) if power else ONE

    __radd__, __rmul__ = __add__, __mul__

    def substitute(self, values: Mapping[str, Any]) -> Polynomial:
        """Polynomial in which symbols are replaced by polynomials or numbers."""
        found = Polynomial()
        for monomial, term in self.parts(values).items():
            for name, power in monomial:
                term *= _as_polynomial(values[name]) ** power
            found += term
        return found

    def rate(self, rates: Mapping[str, Any]) -> Polynomial:
        """Derivative, from the derivatives of the symbols."""
        found = Polynomial()
        for monomial, factor in self.items():
            for name, power in monomial:
                if name in rates:
                    found += Polynomial([(_product(monomial, ((name, -1),)), factor * power)]) * rates[name]
        return found

    def parts(self, names: Iterable[str]) -> dict[Monomial, Polynomial]:
        """The factor of each product of `names`; the factors have the other symbols."""
        kept, found = set(names), dict[Monomial, Polynomial]()
        for monomial, factor in self.items():
            key = tuple(item for item in monomial if item[0] in kept)
            rest = tuple(item for item in monomial if item[0] not in kept)
            found[key] = found.get(key, Polynomial()) + Polynomial([(rest, factor)])
        return found

    def over(self, product: Polynomial) -> Polynomial:
        """Quotient by a polynomial of one term."""
        ((monomial, factor),) = product.items()
        return self * Polynomial([(tuple((name, -power) for name, power in monomial), 1.0 / factor)])

    @property
    def symbols(self) -> set[str]:
        """Names of the symbols."""
        return {name for monomial in self for name, _ in monomial}


def _as_polynomial(value: Any) -> Polynomial:
    """A number as a polynomial; a polynomial itself."""
    return value if isinstance(value, Polynomial) else Polynomial([((), float(value))])


def _product(a: Monomial, b: Monomial) -> Monomial:
    """Product of two monomials: the powers are added."""
    powers = dict(a)
    for name, power in b:
        powers[name] = powers.get(name, 0) + power
    return tuple(sorted((name, power) for name, power in powers.items() if power))


ONE = _as_polynomial(1.0)


def symbol(name: str) -> Polynomial:
    """A symbol."""
    return Polynomial([(((name, 1),), 1.0)])


def read(text: str, names: Iterable[str]) -> Polynomial:
    """Polynomial from a text as Python writes it; of an equation, the right side less the left side.

    Raises
    ------
    ValueError
        If the text is not a polynomial in these names.
    """
    left, _, right = text.rpartition("=")
    symbols = {name: symbol(name) for name in names}
    try:
        # Texts are part of Python files.
        return _as_polynomial(eval(f"({right}) - ({left or 0})", {"__builtins__": {}}, symbols))
    except NameError as error:
        near = get_close_matches(str(error.name), symbols, 1)
        hint = f"; did you mean {near[0]}?" if near else ""
        raise ValueError(f"{text!r}: {error.name} is not known{hint} (known: {', '.join(sorted(symbols))})") from None
    except (TypeError, RecursionError):
        raise ValueError(
            f"{text!r}: only sums, differences, products and whole powers (**) are taken; a field of the body holds "
            "anything else, such as a quotient or a sine"
        ) from None
    except Exception as error:
        raise ValueError(f"{text!r}: {error}") from None


def determinant(matrix: Sequence[Sequence[Polynomial]]) -> Polynomial:
    """Determinant of a square matrix."""
    found = Polynomial() if matrix else ONE
    for column, entry in enumerate(matrix[0] if matrix else ()):
        minor = [[*row[:column], *row[column + 1 :]] for row in matrix[1:]]
        found += entry * (-1.0) ** column * determinant(minor)
    return found


def coefficients(equations: Sequence[Polynomial], unknowns: Sequence[str]) -> list[list[Polynomial]]:
    """Matrix of equations that are linear in their unknowns."""
    return [[p.rate({name: 1.0}) for name in unknowns] for p in equations]


def solve(equations: Sequence[Polynomial], unknowns: Sequence[str]) -> tuple[list[Polynomial], Polynomial]:
    """Numerators of the unknowns, and their common denominator: the determinant, or 1 if that is a single product."""
    rows = coefficients(equations, unknowns)
    rest = [-p.substitute(dict.fromkeys(unknowns, 0.0)) for p in equations]
    whole = determinant(rows)
    numerators = [
        determinant([[*row[:i], known, *row[i + 1 :]] for row, known in zip(rows, rest, strict=True)])
        for i in range(len(unknowns))
    ]
    return ([numerator.over(whole) for numerator in numerators], ONE) if len(whole) == 1 else (numerators, whole)


class Source:
    """Source code of polynomials in the fields of a body and in other symbols.

    Parameters
    ----------
    fields : sequence of str
        Fields of the body, which the code calls ``body``.
    inner : sequence of str
        Symbols, like friction, in which the factors of the other symbols are collected.

    Attributes
    ----------
    constants : dict
        Products and sums of fields whose values are ``body.constants``, in this order.
    """

    def __init__(self, fields: Sequence[str], inner: Sequence[str]):
        """Begin a source without lines; `fields` are constant during a run, `inner` are factors kept apart."""
        self.fields, self.inner = frozenset(fields), frozenset(inner)
        self.constants: dict[Any, Polynomial] = {}
        self.begin()

    def begin(self, *, plain: bool = False) -> None:
        """Begin the body of a new function. A `plain` one uses no constants: it is written in the fields alone."""
        self.lines: list[str] = []
        self._names: dict[str, str] = {}
        self._plain = plain

    def name(self, text: str) -> str:
        """Name of the value of an expression, which is computed once."""
        if not set("+-*/ ") & set(text):
            return text
        if text not in self._names:
            self._names[text] = f"n{len(self._names)}"
            self.lines.append(f"{self._names[text]} = {text}")
        return self._names[text]

    def quotient(self, p: Polynomial, whole: Polynomial) -> str:
        """Name of the value of a quotient."""
        if not p or whole == ONE:
            return self.value(p)
        inverse = self.name(f"1.0 / {self.value(whole)}")
        return self.name(f"{self.value(p)} * {inverse}")

    def value(self, p: Polynomial) -> str:
        """Name of the value of a polynomial, which is computed once."""
        groups: dict[Any, list[tuple[str, dict[Monomial, Polynomial], Polynomial]]] = {}
        for monomial, rest in sorted(p.parts(p.symbols - self.fields - self.inner).items()):
            row = rest.parts(self.inner)
            content = _content(row)
            key = frozenset((key, tuple(sorted(entry.over(content).items()))) for key, entry in row.items())
            groups.setdefault(key, []).append((_text_of(monomial), row, content))
        terms = []
        for group in groups.values():
            load, row, content = group[0]
            if len(group) > 1:
                # The factors of several products differ by parameters only.
                load = self._sum([(*self._constant(part), text) for text, _, part in group])
                row = {key: entry.over(content) for key, entry in row.items()}
            terms.append((1.0, load, self._row(row)))
        return self._sum(terms)

    def _row(self, row: dict[Monomial, Polynomial]) -> str:
        """Polynomial in the inner symbols; terms with the same factor are added first."""
        groups: dict[str, list[tuple[float, Monomial]]] = {}
        for key, entry in sorted(row.items()):
            sign, constant = self._constant(entry)
            groups.setdefault(constant, []).append((sign, key))
        terms = []
        for constant, parts in groups.items():
            first = parts[0][0]
            terms.append((first, constant, self._sum([(first * sign, "1.0", _text_of(key)) for sign, key in parts])))
        return self._sum(terms)

    def _sum(self, terms: Sequence[tuple[float, str, str]]) -> str:
        """Name of a sum of products with signs."""
        text = ""
        for sign, *pair in sorted(terms, key=lambda term: term[0] < 0.0):
            product = " * ".join(self.name(factor) for factor in pair if factor != "1.0") or "1.0"
            text += f" {'-' if sign < 0.0 else '+'} {product}" if text else f"-{product}" if sign < 0.0 else product
        return self.name(text or "0.0")

    def _constant(self, p: Polynomial) -> tuple[float, str]:
        """Sign and text of a polynomial in the fields."""
        sign = -1.0 if min(p.items())[1] < 0.0 else 1.0
        p = p * sign
        if not p.symbols:
            return sign, repr(p[()])
        if self._plain or list(p.items()) == list(symbol(min(p.symbols)).items()):
            terms = [(factor, repr(abs(factor)), _text_of(monomial, "body.")) for monomial, factor in p.items()]
            return sign, self._sum(terms)
        key = tuple(sorted(p.items()))
        self.constants.setdefault(key, p)
        return sign, f"body.constants[{list(self.constants).index(key)}]"


def _content(row: Mapping[Monomial, Polynomial]) -> Polynomial:
    """Product that divides all entries; with it the first factor becomes 1."""
    powers = [dict(monomial) for entry in row.values() for monomial in entry]
    common = {name: min(power.get(name, 0) for power in powers) for power in powers for name in power}
    first = min(min(row.items())[1].items())[1]
    return Polynomial([(tuple(sorted((name, power) for name, power in common.items() if power)), first)])


def _text_of(monomial: Monomial, prefix: str = "") -> str:
    """Source text of a monomial; `prefix` stands before each name."""
    dividend = " * ".join(prefix + name for name, power in monomial for _ in range(power)) or "1.0"
    return dividend + "".join(f" / {prefix}{name}" for name, power in monomial for _ in range(-power))


def evaluate(p: Mapping[Monomial, float], values: Any) -> Any:
    """Value of a polynomial whose symbols are attributes of `values`."""
    found: Any = 0.0
    for monomial, factor in p.items():
        for name, power in monomial:
            value = getattr(values, name)
            factor = factor * (value if power == 1 else value**power)
        found = found + factor
    return found
