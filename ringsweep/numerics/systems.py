"""Bodies with contacts of their own: each kind of mode is one linear system, and its solution is generated.

Each contact has a sliding acceleration w, a normal reaction N and a friction force F on the body: ``w_1``, ``N_1``,
``F_1`` and so on. The balances are linear in them. In a *kind of mode* each contact sticks or slips: one that sticks
has no sliding acceleration, one that slips has the friction ``F = K N``. So there are as many unknowns as balances.

The solution is linear in `one` and in the motion. Put in numbers and 1, it gives accelerations and forces; put in
coefficients of power series, and 0 for those of positive powers, it gives the coefficients of theirs.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import cached_property
from typing import Any

from ringsweep.numerics.balances import Polynomial, Source, read, solve, symbol


class System:
    """Balances of a body, and what follows from them in each kind of mode.

    Parameters
    ----------
    fields : sequence of str
        Parameters of the body.
    motion : sequence of str
        Numbers of its motion.
    balances : sequence of str
        Two for each contact; see :func:`ringsweep.numerics.balances.read`.
    """

    def __init__(self, fields: Sequence[str], motion: Sequence[str], balances: Sequence[str]):
        """Read the balances, and name the unknowns of each contact."""
        self.motion, self._fields, self._texts = motion, fields, balances
        numbers = range(1, len(balances) // 2 + 1)
        self._w, self._N, self._F, self._K = ([f"{letter}_{i}" for i in numbers] for letter in "wNFK")

    @cached_property
    def _balances(self) -> list[Polynomial]:
        """The balances; ``one`` is a factor of the terms without motion and unknowns."""
        varying = {*self.motion, *self._w, *self._N, *self._F}
        found = []
        for text in self._texts:
            parts = read(text, (*self._fields, *varying)).parts(varying)
            products = (Polynomial([(monomial, 1.0)]) if monomial else symbol("one") for monomial in parts)
            found.append(sum(map(Polynomial.__mul__, products, parts.values()), Polynomial()))
        return found

    def solution(self, sticks: Sequence[bool]) -> list[str]:
        """Body of ``(body, one, friction, motion)`` that returns three tuples: w, N and F of all contacts.

        `sticks` says for each contact whether it sticks; `friction` has K of those that slip.
        """
        values: dict[str, Any] = {name: symbol(name) for p in self._balances for name in p.symbols}
        for w, N, F, K, stuck in zip(self._w, self._N, self._F, self._K, sticks, strict=True):
            values |= {w: 0.0} if stuck else {F: symbol(K) * symbol(N)}
        unknowns = [F if stuck else w for w, F, stuck in zip(self._w, self._F, sticks, strict=True)] + self._N
        found, whole = solve([p.substitute(values) for p in self._balances], unknowns)
        source = Source(self._fields, self._K)
        source.begin(plain=True)
        named = {name: source.quotient(p, whole) for name, p in zip(unknowns, found, strict=True)}
        for w, N, F, K, stuck in zip(self._w, self._N, self._F, self._K, sticks, strict=True):
            named |= {w: "0.0"} if stuck else {F: source.name(f"{K} * {named[N]}")}
        tuples = (f"({', '.join(named[name] for name in names)},)" for names in (self._w, self._N, self._F))
        given = f"{', '.join(self._K)}, = friction", f"{', '.join(self.motion)}, = motion"
        return [*given, *source.lines, f"return {', '.join(tuples)}"]

    def imbalance(self) -> list[str]:
        """Body of ``(body, motion, w, N, F)``: largest error of the balances as declared, as a share of their terms."""
        source, shares = Source(self._fields, ()), []
        source.begin(plain=True)
        for p in self._balances:
            terms = [source.value(Polynomial([term])) for term in p.items()]
            shares.append(f"abs({' + '.join(terms)}) / ({' + '.join(f'abs({term})' for term in terms)} + 1e-300)")
        unknown = (f"{', '.join(getattr(self, f'_{of}'))}, = {of}" for of in "wNF")
        given = "one = 1.0", f"{', '.join(self.motion)}, = motion", *unknown
        return [*given, *source.lines, f"return max({', '.join(shares)})"]
