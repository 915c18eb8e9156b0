"""What follows from the balances of a body that moves round an axis on one contact or on two.

The balances are equations between these symbols, besides the fields of the body: ``sin_phi``, ``cos_phi``, ``omega``
and ``phi_dd`` (angle of the body, its first and its second derivative), the normal reactions ``N1`` and ``N2``, and the
friction ``K1`` and ``K2`` per unit of each reaction. They are linear in ``phi_dd``, ``N1`` and ``N2``; K occurs only in
``K1*N1`` and ``K2*N2``. The last one is the balance along the motion: it has ``phi_dd``.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from ringsweep.numerics.balances import (
    Polynomial,
    Source,
    determinant,
    evaluate,
    linear,
    number,
    read_equation,
    read_polynomial,
    solve,
    symbol,
)

#: Field of a body with the numbers that depend on its other fields only.
CONSTANTS = "constants"

_INNER = ("K1", "K2", "slope_1", "slope_2", "one", "both")
_MOTION = ("sin_phi", "cos_phi", "omega")
_BY_PHI = {"sin_phi": symbol("cos_phi"), "cos_phi": -symbol("sin_phi")}
_BY_OMEGA = {"omega": number(1.0)}
_BY_K = {"K1": symbol("slope_1"), "K2": symbol("slope_2")}
_NO_FRICTION = {"K1": Polynomial(), "K2": Polynomial(), "slope_1": number(1.0), "slope_2": number(1.0)}
#: Products of the state to which the solution is proportional: 1, sine, cosine, velocity, its square; forces F1, F2.
_BASIS = tuple(read_polynomial(text) for text in ("1", "sin_phi", "cos_phi", "omega", "omega**2", "F1", "F2"))


class Equations:
    """The balances of a body. Each method without argument writes the lines of the function of this name.

    Parameters
    ----------
    fields : sequence of str
        Fields of the body.
    balances : sequence of str
        Equations, two for a body with one contact and three for a body with two.
    energy : str
        Kinetic and potential energy, J.

    Raises
    ------
    ValueError
        If a balance cannot be used; the message names it and says why.
    """

    def __init__(self, fields: Sequence[str], balances: Sequence[str], energy: str):
        if len(balances) not in (2, 3):
            raise ValueError(f"{len(balances)} balances: give two for one contact, or three for two contacts")
        self.texts, self.contacts = tuple(balances), len(balances) - 1
        self.normals = ["N1", "N2"][: self.contacts]
        self.balances = [self._read(text, fields) for text in balances]
        self.energy_of = self._checked(read_polynomial, energy, {*fields, *_MOTION})
        self.numerators, self.whole = solve(self.balances, ["phi_dd", *self.normals])
        free = self.whole.substitute(_NO_FRICTION)
        if not free:
            raise ValueError("the balances do not determine phi_dd and the reactions")
        if sum(free.values()) < 0.0:
            self.numerators, self.whole = [-numerator for numerator in self.numerators], -self.whole
        self.source = Source([name for name in fields if name != CONSTANTS], _INNER)

    @staticmethod
    def _checked(read: Any, text: str, known: set[str]) -> Polynomial:
        try:
            found: Polynomial = read(text)
        except ValueError as error:
            raise ValueError(f"{text!r}: {error}") from None
        unknown = sorted(found.symbols - known)
        if unknown:
            raise ValueError(f"{text!r}: {unknown[0]!r} is neither a field of the body nor one of {', '.join(_MOTION)}")
        return found

    def _read(self, text: str, fields: Sequence[str]) -> Polynomial:
        allowed = {*fields, *_MOTION, "phi_dd", *self.normals, *(f"K{name[1]}" for name in self.normals)}
        found = self._checked(read_equation, text, allowed)
        parts = found.part(("phi_dd", "N1", "N2", "K1", "K2", *_MOTION))
        wanted = {tuple(sorted(((f"K{i}", 1), (f"N{i}", 1)))) for i in (1, 2)}
        wanted |= {((name, 1),) for name in ("phi_dd", "N1", "N2")}
        wanted |= {monomial for product in _BASIS for monomial in product}
        if not set(parts) <= wanted:
            raise ValueError(
                f"{text!r}: a balance is a sum of multiples of phi_dd, N1, N2, K1*N1, K2*N2, sin_phi, cos_phi, omega, "
                "omega**2, and 1"
            )
        return found

    def constants(self, body: Any) -> tuple[Any, ...]:
        """Numbers of a body that depend on its fields only."""
        return tuple(evaluate(p, body) for p in self.source.constants.values())

    def contact_count(self) -> list[str]:
        return [f"return {self.contacts}"]

    # ---- slip ---------------------------------------------------------------------------------

    @property
    def _jams(self) -> bool:
        return bool(self.whole.symbols & {"K1", "K2"})

    def _over(self, whole: Polynomial, *numerators: Polynomial) -> list[str]:
        """Quotients by a determinant."""
        value, name = self.source.value, self.source.name
        if whole == number(1.0):
            return [value(numerator) for numerator in numerators]
        inverse = name(f"1.0 / {value(whole)}")
        return [name(f"{value(numerator)} * {inverse}") if numerator else "0.0" for numerator in numerators]

    def acceleration(self) -> list[str]:
        source = self.source.begin()
        (found,) = self._over(self.whole, self.numerators[0])
        return source.end(found, source.value(self.whole) if self._jams else "1.0")

    def reactions(self) -> list[str]:
        source = self.source.begin()
        found = self._over(self.whole, *self.numerators[1:])
        return source.end(found[0], found[-1])

    def _slope(self, source: Source, values: dict[str, Polynomial]) -> list[str]:
        numerator, whole = self.numerators[0], self.whole
        change, whole_change = (p.rate(_BY_K).substitute(values) for p in (numerator, whole))
        numerator, whole = numerator.substitute(values), whole.substitute(values)
        if not whole_change:
            return source.end(*self._over(whole, change))
        (ratio,) = self._over(whole, numerator)
        inverse = source.name(f"1.0 / {source.value(whole)}")
        return source.end(f"({source.value(change)} - {ratio} * {source.value(whole_change)}) * {inverse}")

    def acceleration_slope(self) -> list[str]:
        return self._slope(self.source.begin(), {})

    def friction_gain(self) -> list[str]:
        return self._slope(self.source.begin(), _NO_FRICTION)

    def acceleration_gradient(self) -> list[str]:
        source = self.source.begin()
        return source.end(*self._over(self.whole, *(self.numerators[0].rate(by) for by in (_BY_PHI, _BY_OMEGA))))

    def free_determinant(self) -> list[str]:
        source = self.source.begin()
        return source.end(source.value(self.whole.substitute(_NO_FRICTION)) if self._jams else "1.0")

    def reaction_determinant(self) -> list[str]:
        source = self.source.begin(plain=True)
        rows = [linear(balance, ["phi_dd", *self.normals])[1:-1] for balance in self.balances[:-1]]
        return source.end(f"abs({source.value(determinant(rows).substitute(_NO_FRICTION))})")

    # ---- series -------------------------------------------------------------------------------

    def determinant_terms(self) -> list[str]:
        source = self.source.begin()
        if not self._jams:
            return source.end("one")
        found = Polynomial()
        for product, factor in self.whole.part(("K1", "K2")).items():
            name = "one" if not product else "both" if len(product) == 2 else product[0][0]
            found += symbol(name) * factor
        return source.end(source.value(found))

    def slip_balance(self) -> list[str]:
        source = self.source.begin()
        equations = [balance + self._forces(balance) for balance in self.balances]
        numerators, whole = solve(equations, ["phi_dd", *self.normals])
        if whole != self.whole:
            numerators = [-numerator for numerator in numerators]
        rows = []
        for numerator in numerators:
            found = source.factors(numerator)
            rows.append([found.get(monomial, "0.0") for product in _BASIS for monomial in product])
        if self.whole != number(1.0):
            inverse = source.name(f"1.0 / {source.value(self.whole)}")
            rows = [[text if text == "0.0" else source.name(f"{text} * {inverse}") for text in row] for row in rows]
        texts = [f"({', '.join(row)})" for row in rows]
        return source.end(texts[0], texts[1], texts[-1])

    def _forces(self, balance: Polynomial) -> Polynomial:
        """Forces F1 and F2 in the places of K1*N1 and K2*N2."""
        parts = balance.part(("K1", "K2", "N1", "N2"))
        found = Polynomial()
        for i in range(1, self.contacts + 1):
            found += symbol(f"F{i}") * parts.get(((f"K{i}", 1), (f"N{i}", 1)), Polynomial())
        return found

    # ---- stick --------------------------------------------------------------------------------

    def held(self) -> list[str]:
        source = self.source.begin()
        equations = [balance.substitute(_NO_FRICTION) + self._forces(balance) for balance in self.balances]
        unknowns = [*self.normals[1:], "F1", "F2"] if self.contacts == 2 else ["N1", "F1"]
        numerators, whole = solve(equations, unknowns)
        known = {"phi_dd": symbol("epsilon"), "N1": symbol("normal")}
        found = []
        for numerator in numerators:
            parts = numerator.part((*_MOTION, "phi_dd", "N1"))
            constant = parts.pop((), Polynomial()) * symbol("one")
            square = parts.pop((("omega", 2),), Polynomial()) * symbol("square")
            rest = sum((Polynomial([(key, 1.0)]) * factor for key, factor in parts.items()), constant + square)
            found.append(rest.substitute(known))
        values = self._over(whole, *found)
        return source.end(
            *(["normal", *values] if self.contacts == 2 else [values[0], values[0], values[1], values[1]])
        )

    # ---- energy and residuals -----------------------------------------------------------------

    def energy(self) -> list[str]:
        source = self.source.begin(plain=True)
        return source.end(source.value(self.energy_of))

    def power(self) -> list[str]:
        source = self.source.begin(plain=True)
        along, rest = linear(self.balances[-1], ["phi_dd"])
        by_phi, by_omega = self.energy_of.rate(_BY_PHI), self.energy_of.rate(_BY_OMEGA)
        (ratio,) = self._over(along, -rest)
        return source.end(f"{source.value(by_phi)} * omega + {source.value(by_omega)} * {ratio}")

    def imbalance(self) -> list[str]:
        source = self.source.begin(plain=True)
        shares = []
        for balance in self.balances:
            parts = balance.part((*_MOTION, "phi_dd", "N1", "N2", "K1", "K2"))
            terms = [source.value(Polynomial([(key, 1.0)]) * factor) for key, factor in parts.items()]
            error = source.name(" + ".join(terms))
            size = source.name(" + ".join(f"{term} * {term}" for term in terms))
            shares.append(f"{error} * {error} / ({size} + 1e-300)")
        return source.end(" + ".join(shares))
