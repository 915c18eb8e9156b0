"""What follows from the balances of a body that slides on one contact or on two.

The balances are equations between these symbols, besides the fields of the body: three numbers of its motion and its
acceleration, which its :class:`Coordinate` names, the normal reactions ``N1`` and ``N2``, and the friction ``K1`` and
``K2`` per unit of each reaction. They are linear in acceleration, ``N1`` and ``N2``; K occurs only in ``K1*N1`` and
``K2*N2``. The last one is the balance along the motion: it has the acceleration.

`whole` is the determinant of the balances: each unknown is a polynomial over it. Methods that return a text or a list
of texts return source code, see :mod:`ringsweep.numerics.balances`; :func:`ringsweep.physics.ring.body` calls them
when a body is declared, never during a run.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np

from ringsweep.numerics.balances import (
    ONE,
    Polynomial,
    Source,
    coefficients,
    determinant,
    evaluate,
    read,
    solve,
    symbol,
)

# Rounding of a sum as a share of its terms.
_ROUNDING = 1e-9

_CONTACTS = ("N1", "N2", "K1", "K2")
# Symbols of what is derived from the balances, besides those of the balances themselves.
_DERIVED = ("F1", "F2", "slope_1", "slope_2", "one", "both", "square", "epsilon")
_BY_K = {"K1": symbol("slope_1"), "K2": symbol("slope_2")}
_SIGN = "sign of the determinant"
_FREE = {"K1": 0.0, "K2": 0.0, "slope_1": 1.0, "slope_2": 1.0}


class Coordinate(NamedTuple):
    """The coordinate of a body, and what its balances may have of the motion.

    Attributes
    ----------
    acceleration : str
        Symbol of its second derivative.
    motion : tuple of str
        Symbols of three numbers of the motion. The last one is the first derivative of the coordinate.
    by_place : mapping
        Derivatives of these numbers by the coordinate; those that are missing are 0.
    product : str
        One product of these numbers. Balances are linear in it and in them.
    lever : Polynomial or float
        Way along the contacts for each unit of the coordinate.
    """

    acceleration: str
    motion: tuple[str, str, str]
    by_place: Mapping[str, Any]
    product: str
    lever: Any


#: Angle of a body that moves round an axis.
ANGLE = Coordinate(
    "phi_dd",
    ("sin_phi", "cos_phi", "omega"),
    {"sin_phi": symbol("cos_phi"), "cos_phi": -symbol("sin_phi")},
    "omega**2",
    symbol("radius"),
)

#: Displacement of a body along a line, on which a given force acts.
LINE = Coordinate("x_dd", ("x", "force", "velocity"), {"x": 1.0}, "x**3", 1.0)


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
    coordinate : Coordinate
    offset : str
        Field with half the angle between the contacts; empty for an angle of 0.
    absent : collection of str
        Symbols that are 0 in balances and energy: fields of parts that the body lacks.
    varying : collection of str
        Fields that change during a run: no constant of the body contains them.

    Raises
    ------
    ValueError
        If a balance cannot be used; the message says why.
    """

    def __init__(
        self,
        fields: Sequence[str],
        balances: Sequence[str],
        energy: str,
        coordinate: Coordinate = ANGLE,
        offset: str = "",
        absent: Collection[str] = (),
        varying: Collection[str] = (),
    ):
        """Read the balances, and refuse what is not linear, not known, or has a name twice."""
        self.texts, self.contacts, self.offset = tuple(balances), len(balances) - 1, offset
        if self.contacts not in (1, 2):
            problem = "give two for one contact, or three for two contacts; is a comma missing?"
            raise ValueError(f"{len(balances)} in number: {problem}")
        self.coordinate, motion, acceleration = coordinate, coordinate.motion, coordinate.acceleration
        self.unknowns = (acceleration, "N1", "N2")[: 1 + self.contacts]
        products = "1", *motion, coordinate.product, "F1", "F2"
        #: Products of the motion and of the forces F1 and F2 to which the solution is proportional.
        self.basis = [next(iter(read(text, (*motion, "F1", "F2")))) for text in products]
        names, lacks = {*fields, *absent, *motion} - {"constants"}, dict.fromkeys(absent, 0.0)
        for text in balances:
            if text.count("=") != 1:
                raise ValueError(f"{text!r}: a balance is an equation, with one `=`")
        unknown = {*self.unknowns, *(f"K{i + 1}" for i in range(self.contacts))}
        symbols = {*motion, acceleration, *_CONTACTS, *_DERIVED}
        if doubled := symbols & set(fields):
            raise ValueError(f"the field {min(doubled)} needs another name: {', '.join(sorted(symbols))} are symbols")
        self.balances = [read(text, names | unknown).substitute(lacks) for text in balances]
        self.energy = read(energy, names).substitute(lacks)
        single = [((name, 1),) for name in (acceleration, "N1", "N2")]
        taken = {(("K1", 1), ("N1", 1)), (("K2", 1), ("N2", 1)), *single, *self.basis}
        for text, balance in zip(balances, self.balances, strict=True):
            if not set(balance.parts((*motion, acceleration, *_CONTACTS))) <= taken:
                raise ValueError(
                    f"{text!r}: a balance is a sum of multiples of {acceleration}, N1, N2, K1*N1, K2*N2, "
                    f"{', '.join(products[1:5])} and 1"
                )
        if not self.balances[-1].rate({acceleration: 1.0}):
            raise ValueError(f"{balances[-1]!r} has no {acceleration}: the last balance is the one along the motion")
        for i in range(1, len(balances)):
            if not any(p.rate({f"K{i}": 1.0}) for p in self.balances):
                raise ValueError(f"K{i}*N{i} is in no balance: each contact has friction")
        #: Determinant without friction.
        self.free = self._free_determinant(self.balances, self.unknowns)
        if not self.free:
            raise ValueError(f"the balances do not determine {acceleration} and the reactions")
        self.numerators, self.whole = solve(self.balances, self.unknowns)
        # For most bodies the determinant is positive then.
        self.sign = -1.0 if self.whole != ONE and sum(self.free.values()) < 0.0 else 1.0
        self.numerators, self.whole = [p * self.sign for p in self.numerators], self.whole * self.sign
        self.free *= self.sign
        self.varying = [name for name in varying if name in fields]
        self.source = Source(
            [name for name in fields if name not in varying], ("K1", "K2", "slope_1", "slope_2", "one", "both")
        )
        if self.whole != ONE:
            # Without friction the determinant is positive: the first constant of a body is its sign as it is computed.
            self.source.constants[_SIGN] = self.free

    def constants(self, body: Any) -> tuple[Any, ...]:
        """Numbers of a body that depend on its fields only."""
        found = [evaluate(p, body) for p in self.source.constants.values()]
        if self.whole != ONE:
            # One number for each body, also if no field is in the determinant.
            found[0] = np.sign(found[0]) * (body.mass > 0.0)
        return tuple(found)

    def contradiction(self, body: Any) -> str | None:
        """How energy and balances of a body contradict each other; None if they do not.

        The energy would only repeat the balances if it were never compared with anything else. Its rate must be the
        work of friction, besides that of forces that do not depend on the place.
        """
        for friction, factors in self._excess_work:
            if not _vanish(factors, body):
                return (
                    f"{self.texts[-1]!r}: {friction} does not do the work of friction on the energy: the kinetic "
                    "energy has another inertia, a sign is wrong, or the contacts do not slide at the field radius"
                )
        if not _vanish(self._unbalanced, body):
            return f"{self.texts[-1]!r}: the terms that depend on the place do not follow from the potential energy"
        if np.any(evaluate(self.free, body) == 0.0):
            return f"the balances do not determine {self.unknowns[0]} and the reactions for these numbers"
        return None

    @cached_property
    def _work(self) -> Polynomial:
        """Rate of the energy less the power of friction, times the determinant."""
        velocity, (moment, *normals) = symbol(self.coordinate.motion[-1]), self.numerators
        by_place, by_velocity = (self.energy.rate(by) for by in self._rates()[:2])
        along = [symbol(f"K{i}") * N * self.coordinate.lever * velocity for i, N in enumerate(normals, start=1)]
        return by_place * velocity * self.whole + by_velocity * moment - sum(along, Polynomial())

    @cached_property
    def _excess_work(self) -> list[tuple[str, list[Polynomial]]]:
        """Friction of a contact, or of both, and factors that vanish if it does no other work on the energy."""
        free, motion = self._work.substitute(_FREE), (*self.coordinate.motion, "K1", "K2")
        excess = self._work * self.whole.substitute(_FREE) - free * self.whole
        terms = {
            text: Polynomial(term for term in excess.items() if {"K1", "K2"} & set(dict(term[0])) == of)
            for of, text in (({"K1"}, "K1*N1"), ({"K2"}, "K2*N2"), ({"K1", "K2"}, "K1*N1 or K2*N2"))
        }
        return [(text, list(found.parts(motion).values())) for text, found in terms.items()]

    @cached_property
    def _unbalanced(self) -> list[Polynomial]:
        """Factors that vanish if the forces that depend on the place follow from the energy; others need not."""
        place, free = set(self.coordinate.by_place), self._work.substitute(_FREE).items()
        placed = Polynomial(term for term in free if set(dict(term[0])) & place)
        return list(placed.parts(self.coordinate.motion).values())

    def lines(self, name: str) -> list[str]:
        """Body of the function of this name of :mod:`ringsweep.physics.ring`."""
        source, (moment, *normals), whole = self.source, self.numerators, self.whole
        # Such functions are seldom called, or must not use what is computed from the balances.
        source.begin(plain=name in ("reaction_determinant", "energy", "power", "imbalance", "size"))
        jams, of_reactions = whole != ONE, self._free_determinant(self.balances[:-1], self.unknowns[1:])
        values: dict[str, Any] = {
            "contact_count": lambda: [str(self.contacts)],
            "contact_offset": lambda: [f"body.{self.offset}" if self.offset else "0.0"],
            "radius": lambda: [source.value(Polynomial() + self.coordinate.lever)],
            "acceleration": lambda: [source.quotient(moment, whole), self._positive(source.value(whole))],
            "reactions": lambda: [source.quotient(p, whole) for p in (normals[0], normals[-1])],
            "acceleration_slope": lambda: [self._slope(moment, whole, {})],
            "friction_gain": lambda: [self._slope(moment, whole, _FREE)],
            "acceleration_gradient": lambda: [source.quotient(moment.rate(by), whole) for by in self._rates()],
            "free_determinant": lambda: [self._positive(source.value(self.free)) if jams else "1.0"],
            "reaction_determinant": lambda: [f"abs({source.value(of_reactions)})"],
            "determinant_terms": lambda: [self._positive(source.value(_in_terms(whole))) if jams else "one"],
            "slip_balance": self._slip_balance,
            "held": self._held,
            "driven": self._driven,
            "if_load_varies": lambda: ["yes" if jams or any(p.symbols - source.fields for p in normals) else "no"],
            "energy": lambda: [source.value(self.energy)],
            "power": lambda: [self._power()],
            "imbalance": lambda: [" + ".join(map(self._error, self.balances))],
            "size": lambda: [" + ".join(f"abs({term})" for term in self._terms(self._forces()))],
        }
        found = values[name]()
        return [*source.lines, "return " + (found[0] if len(found) == 1 else f"({', '.join(found)})")]

    def _positive(self, determinant: str) -> str:
        """Determinant with the sign with which it is positive without friction."""
        return determinant if self.whole == ONE else f"body.constants[0] * {determinant}"

    def _rates(self) -> list[Mapping[str, Any]]:
        """Rates of the motion if the coordinate changes, its derivative, and then each number that is given."""
        by_place, *others, velocity = self.coordinate.by_place, *self.coordinate.motion
        return [by_place, {velocity: 1.0}, *({name: 1.0} for name in others if name not in by_place)]

    def _slope(self, moment: Polynomial, whole: Polynomial, values: dict[str, float]) -> str:
        """Code of the derivative of the acceleration ``moment/whole`` as K changes; `values` fixes some symbols."""
        source = self.source
        change, whole_change = (p.rate(_BY_K).substitute(values) for p in (moment, whole))
        moment, whole = moment.substitute(values), whole.substitute(values)
        if not whole_change:
            return source.quotient(change, whole)
        taken = source.name(f"{source.quotient(moment, whole)} * {source.value(whole_change)}")
        return f"({source.value(change)} - {taken}) * {source.name(f'1.0 / {source.value(whole)}')}"

    def _free_determinant(self, balances: Sequence[Polynomial], unknowns: Sequence[str]) -> Polynomial:
        """Determinant of some balances without friction."""
        return determinant(coefficients([p.substitute(_FREE) for p in balances], unknowns))

    def _forced(self) -> list[Polynomial]:
        """Balances with the forces F1 and F2 on top of friction."""
        by = [(f"K{i}", f"N{i}", symbol(f"F{i}")) for i in (1, 2)]
        return [sum((p.rate({K: 1.0}).rate({N: 1.0}) * F for K, N, F in by), p) for p in self.balances]

    def _slip_balance(self) -> list[str]:
        """Code of the factors of :attr:`basis` in acceleration and both reactions, times the determinant."""
        rows = []
        for numerator in solve(self._forced(), self.unknowns)[0]:
            parts = (numerator * self.sign).parts((*self.coordinate.motion, "F1", "F2"))
            factors = [self.source.quotient(parts.get(key, Polynomial()), self.whole) for key in self.basis]
            rows.append(f"({', '.join(factors)})")
        return [rows[0], rows[1], rows[-1]]

    def _at_rest(self) -> list[Polynomial]:
        """Balances with the forces F1 and F2 in place of friction."""
        return [p.substitute(_FREE) for p in self._forced()]

    def _held(self) -> list[str]:
        """Code of both reactions and friction of a body whose acceleration is given as ``epsilon``."""
        numerators, whole = solve(self._at_rest(), (*self.unknowns[1:], "F1"))
        given = {self.unknowns[0]: symbol("epsilon")}
        *normals, friction = [self._linear(p.substitute(given), whole) for p in numerators]
        return [normals[0], normals[-1], friction]

    def _driven(self) -> list[str]:
        """Code of the acceleration of a body under the friction forces ``F1`` and ``F2``."""
        numerators, whole = solve(self._at_rest(), self.unknowns)
        given = dict.fromkeys(("F1", "F2", *(name for by in self._rates()[2:] for name in by)), 0.0)
        forces = [(name, numerators[0].rate({name: 1.0})) for name in ("F1", "F2")]
        # Forces are known last.
        terms = [f"{self.source.quotient(factor, whole)} * {name}" for name, factor in forces if factor]
        return [" + ".join([self._linear(numerators[0].substitute(given), whole), *terms])]

    def _linear(self, p: Polynomial, whole: Polynomial) -> str:
        """Quotient with the symbols `one` and `square` in place of 1 and of the product of the motion."""
        parts = p.parts((*self.coordinate.motion, "epsilon", "F1", "F2"))
        changed = {self.basis[0]: symbol("one"), self.basis[4]: symbol("square")}
        terms = (changed.get(key, Polynomial([(key, 1.0)])) * factor for key, factor in parts.items())
        return self.source.quotient(sum(terms, Polynomial()), whole)

    def _forces(self) -> Polynomial:
        """The last balance without friction and inertia."""
        return self.balances[-1].substitute(dict.fromkeys((*_CONTACTS, self.unknowns[0]), 0.0))

    def _power(self) -> str:
        """Code of the power of the forces that change the energy, W, from the rates of the energy."""
        source, last = self.source, self.balances[-1]
        rest, along = last.substitute({self.unknowns[0]: 0.0}), last.rate({self.unknowns[0]: 1.0})
        by_place, by_velocity = (source.value(self.energy.rate(by)) for by in self._rates()[:2])
        return f"{by_place} * {self.coordinate.motion[-1]} + {by_velocity} * {source.quotient(-rest, along)}"

    def _error(self, balance: Polynomial) -> str:
        """Square of the error of a balance, as a share of the squares of its terms."""
        source, terms = self.source, self._terms(balance)
        error, size = source.name(" + ".join(terms)), source.name(" + ".join(f"{term} * {term}" for term in terms))
        return f"{error} * {error} / ({size} + 1e-300)"

    def _terms(self, balance: Polynomial) -> list[str]:
        """Code of the terms of a balance, one by one, for the size of its rounding."""
        parts = balance.parts((*self.coordinate.motion, self.unknowns[0], *_CONTACTS))
        return [self.source.value(Polynomial([(key, 1.0)]) * factor) for key, factor in parts.items()]


def _vanish(factors: Collection[Polynomial], body: Any) -> bool:
    """Whether polynomials in its fields are 0 for a body, or for an array of bodies, but for rounding."""
    for factor in factors:
        terms = [evaluate(dict([term]), body) for term in factor.items()]
        if not np.all(abs(sum(terms)) <= _ROUNDING * sum(map(abs, terms))):
            return False
    return True


def _in_terms(whole: Polynomial) -> Polynomial:
    """The determinant with symbols in place of 1 and of K1*K2."""
    found = Polynomial()
    for product, factor in whole.parts(("K1", "K2")).items():
        found += symbol(("one", product[0][0] if product else "", "both")[len(product)]) * factor
    return found
