"""What follows from the balances of a body that moves round an axis on one contact or on two.

The balances are equations between these symbols, besides the fields of the body: ``sin_phi``, ``cos_phi``, ``omega``
and ``phi_dd`` (angle of the body, its first and its second derivative), the normal reactions ``N1`` and ``N2``, and the
friction ``K1`` and ``K2`` per unit of each reaction. They are linear in ``phi_dd``, ``N1`` and ``N2``; K occurs only in
``K1*N1`` and ``K2*N2``. The last one is the balance along the motion: it has ``phi_dd``.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from ringsweep.numerics.balances import ONE, Polynomial, Source, determinant, evaluate, read, solve, symbol

_MOTION = ("sin_phi", "cos_phi", "omega")
_UNKNOWNS = ("phi_dd", "N1", "N2", "K1", "K2")
_BY_PHI = {"sin_phi": symbol("cos_phi"), "cos_phi": -symbol("sin_phi")}
_BY_K = {"K1": symbol("slope_1"), "K2": symbol("slope_2")}
_FREE = {"K1": 0.0, "K2": 0.0, "slope_1": 1.0, "slope_2": 1.0}

#: Products of the state and of the forces F1 and F2 to which the solution is proportional.
_BASIS = tuple(
    next(iter(read(text, (*_MOTION, "F1", "F2"))))
    for text in ("1", "sin_phi", "cos_phi", "omega", "omega**2", "F1", "F2")
)


class Equations:
    """The balances of a body.

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
        If a balance cannot be used; the message says why.
    """

    def __init__(self, fields: Sequence[str], balances: Sequence[str], energy: str):
        self.texts, self.contacts = tuple(balances), len(balances) - 1
        if self.contacts not in (1, 2):
            raise ValueError(f"{len(balances)} balances: give two for one contact, or three for two contacts")
        self.unknowns = _UNKNOWNS[: 1 + self.contacts]
        names = {*fields, *_MOTION, *self.unknowns, *(f"K{i + 1}" for i in range(self.contacts))}
        self.balances = [read(text, names) for text in balances]
        self.energy = read(energy, {*fields, *_MOTION})
        taken = {(("K1", 1), ("N1", 1)), (("K2", 1), ("N2", 1)), *(((name, 1),) for name in _UNKNOWNS[:3]), *_BASIS}
        for text, balance in zip(balances, self.balances, strict=True):
            if not set(balance.parts(_MOTION + _UNKNOWNS)) <= taken:
                raise ValueError(
                    f"{text!r}: a balance is a sum of multiples of phi_dd, N1, N2, K1*N1, K2*N2, sin_phi, cos_phi, "
                    "omega, omega**2 and 1"
                )
        self.numerators, self.whole = solve(self.balances, self.unknowns)
        free = sum(self.whole.substitute(_FREE).values())
        if free == 0.0:
            raise ValueError("the balances do not determine phi_dd and the reactions")
        # Without friction the determinant is positive.
        self.sign = 1.0 if free > 0.0 else -1.0
        self.numerators, self.whole = [p * self.sign for p in self.numerators], self.whole * self.sign
        self.source = Source(fields, ("K1", "K2", "slope_1", "slope_2", "one", "both"))

    def constants(self, body: Any) -> tuple[Any, ...]:
        """Numbers of a body that depend on its fields only."""
        return tuple(evaluate(p, body) for p in self.source.constants.values())

    def lines(self, name: str) -> list[str]:
        """Body of the function of this name of :mod:`ringsweep.physics.ring`."""
        source, (moment, *normals), whole = self.source, self.numerators, self.whole
        # Such functions are seldom called, or must not use what is computed from the balances.
        source.begin(plain=name in ("reaction_determinant", "energy", "power", "imbalance"))
        jams = whole != ONE
        values: dict[str, Any] = {
            "contact_count": lambda: [str(self.contacts)],
            "acceleration": lambda: [source.quotient(moment, whole), source.value(whole)],
            "reactions": lambda: [source.quotient(p, whole) for p in (normals[0], normals[-1])],
            "acceleration_slope": lambda: [self._slope(moment, whole, {})],
            "friction_gain": lambda: [self._slope(moment, whole, _FREE)],
            "acceleration_gradient": lambda: [
                source.quotient(moment.rate(by), whole) for by in (_BY_PHI, {"omega": 1.0})
            ],
            "free_determinant": lambda: [source.value(whole.substitute(_FREE))],
            "reaction_determinant": lambda: [f"abs({source.value(self._of_reactions())})"],
            "determinant_terms": lambda: [source.value(_in_terms(whole)) if jams else "one"],
            "slip_balance": self._slip_balance,
            "held": self._held,
            "energy": lambda: [source.value(self.energy)],
            "power": lambda: [self._power()],
            "imbalance": lambda: [" + ".join(map(self._error, self.balances))],
        }
        found = values[name]()
        return [*source.lines, "return " + (found[0] if len(found) == 1 else f"({', '.join(found)})")]

    def _slope(self, moment: Polynomial, whole: Polynomial, values: dict[str, float]) -> str:
        source = self.source
        change, whole_change = (p.rate(_BY_K).substitute(values) for p in (moment, whole))
        moment, whole = moment.substitute(values), whole.substitute(values)
        if not whole_change:
            return source.quotient(change, whole)
        taken = source.name(f"{source.quotient(moment, whole)} * {source.value(whole_change)}")
        return f"({source.value(change)} - {taken}) * {source.name(f'1.0 / {source.value(whole)}')}"

    def _of_reactions(self) -> Polynomial:
        """Determinant of all balances but the last, as equations for the reactions without friction."""
        rows = [[p.rate({name: 1.0}).substitute(_FREE) for name in self.unknowns[1:]] for p in self.balances[:-1]]
        return determinant(rows)

    def _forced(self) -> list[Polynomial]:
        """Balances with the forces F1 and F2 on top of friction."""
        by = [(f"K{i}", f"N{i}", symbol(f"F{i}")) for i in (1, 2)]
        return [sum((p.rate({K: 1.0}).rate({N: 1.0}) * F for K, N, F in by), p) for p in self.balances]

    def _slip_balance(self) -> list[str]:
        rows = []
        for numerator in solve(self._forced(), self.unknowns)[0]:
            parts = (numerator * self.sign).parts((*_MOTION, "F1", "F2"))
            factors = [self.source.quotient(parts.get(key, Polynomial()), self.whole) for key in _BASIS]
            rows.append(f"({', '.join(factors)})")
        return [rows[0], rows[1], rows[-1]]

    def _held(self) -> list[str]:
        unknowns = [self.unknowns[-1], "F1", "F2"][: 1 + self.contacts]
        numerators, whole = solve([p.substitute(_FREE) for p in self._forced()], unknowns)
        found = []
        for p in numerators:
            p = p.substitute({"phi_dd": symbol("epsilon"), "N1": symbol("normal")})
            parts = p.parts((*_MOTION, "epsilon", "normal"))
            changed = {_BASIS[0]: symbol("one"), _BASIS[4]: symbol("square")}
            terms = (changed.get(key, Polynomial([(key, 1.0)])) * factor for key, factor in parts.items())
            found.append(self.source.quotient(sum(terms, Polynomial()), whole))
        return ["normal", *found] if self.contacts == 2 else [found[0], found[0], found[1], found[1]]

    def _power(self) -> str:
        source, last = self.source, self.balances[-1]
        rest, along = last.substitute({"phi_dd": 0.0}), last.rate({"phi_dd": 1.0})
        by_phi, by_omega = (source.value(self.energy.rate(by)) for by in (_BY_PHI, {"omega": 1.0}))
        return f"{by_phi} * omega + {by_omega} * {source.quotient(-rest, along)}"

    def _error(self, balance: Polynomial) -> str:
        """Square of the error of a balance, as a share of the squares of its terms."""
        source, parts = self.source, balance.parts(_MOTION + _UNKNOWNS)
        terms = [source.value(Polynomial([(key, 1.0)]) * factor) for key, factor in parts.items()]
        error, size = source.name(" + ".join(terms)), source.name(" + ".join(f"{term} * {term}" for term in terms))
        return f"{error} * {error} / ({size} + 1e-300)"


def _in_terms(whole: Polynomial) -> Polynomial:
    """The determinant with symbols in place of 1 and of K1*K2."""
    found = Polynomial()
    for product, factor in whole.parts(("K1", "K2")).items():
        found += symbol(("one", product[0][0] if product else "", "both")[len(product)]) * factor
    return found
