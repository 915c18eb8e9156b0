"""Laws whose friction at rest is whatever holds the contact, up to a bound: a formula each, :func:`piece`."""

from __future__ import annotations

from math import inf
from typing import Annotated, Any, NamedTuple

from ringsweep.numerics.functions import select
from ringsweep.physics.friction.registry import SetValued, Traits
from ringsweep.physics.friction.velocity import (
    ALPHA,
    BAND,
    KINETIC,
    ONE,
    STRIBECK,
    ZERO,
    Piece,
    absent,
    blend,
    decaying,
    end_of_tail,
    piece,
    steepest,
    stiction_band,
    tail,
)
from ringsweep.quantities.parameters import Leaf, Parameter


class Coulomb(NamedTuple):
    """Amontons-Coulomb friction: :math:`\\mu_k` against the motion (the paper's Eqs. 25-26)."""


@piece.implements(Coulomb)
def _coulomb(law, region):
    return Piece(0.0, inf, 0.0, ZERO, ONE) if region == KINETIC else absent()


class Stiction(NamedTuple):
    """Coulomb friction with stiction: up to :math:`\\mu_s` at rest, :math:`\\mu_k` in motion."""


@blend.implements(Coulomb, Stiction)
def _kinetic(law, speed):
    # At rest a law that jumps has no value of its own.
    return 0.0, select(speed > 0.0, 1.0, 0.0), 0.0, 0.0


@piece.implements(Stiction)
def _stiction(law, region):
    return Piece(0.0, inf, 0.0, ZERO, ONE) if region == KINETIC else absent()


class Tustin(NamedTuple):
    """Stiction that decays with speed: the tail of Bengisu and Akay in the limit of a vanishing band.

    Up to :math:`\\mu_s` at rest and, in motion,
    :math:`\\mu = \\mu_k + (\\mu_s - \\mu_k) e^{-\\alpha |v|}` (Tustin 1947).
    """

    alpha: Annotated[Leaf, ALPHA]
    end: Any = inf

    @classmethod
    def of(cls, alpha: Any) -> Tustin:
        """The law with the end of its tail worked out."""
        return cls(alpha, end_of_tail(alpha, 0.0))


@piece.implements(Tustin)
def _tustin(law, region):
    return tail(region, 0.0, law.end, law.alpha) if region != BAND else absent()


@steepest.implements(Coulomb, Stiction, Tustin)
def _infinite(law):
    # No step could follow a jump; its size is that of the static coefficient.
    return (inf, 0.0), (inf, 0.0)


@stiction_band.implements(Coulomb, Stiction, Tustin)
def _none(law):
    return 0.0


@blend.implements(Tustin)
def _tustin_everywhere(law, speed):
    w_s, w_k, dw_s, dw_k = decaying(law.alpha, speed, speed < law.end)
    moves = select(speed > 0.0, 1.0, 0.0)
    return moves * w_s, moves * w_k, dw_s, dw_k


class Karnopp(NamedTuple):
    """Stiction with a dead band: slower than D_v a contact counts as stuck (the paper's Fig. 4).

    .. math::

        F = \\operatorname{sgn}(F_e)\\, \\min(|F_e|, \\mu_s F_N) \\quad (|v| \\le D_v), \\qquad
        F = \\mu_k F_N \\operatorname{sgn} v \\quad (|v| > D_v)

    with :math:`F_e` the force that friction must balance (Karnopp, J. Dyn. Syst. Meas. Control 107, 1985). Where it
    does balance it the contact keeps the speed, at most D_v, at which it entered the band.
    """

    dead_band: Annotated[Leaf, Parameter("m/s", "half-width of the dead band D_v", lower=0.0, open_lower=True)]


@piece.implements(Karnopp)
def _karnopp(law, region):
    if region == STRIBECK:
        return absent()
    if region == KINETIC:
        return Piece(law.dead_band, inf, 0.0, ZERO, ONE)
    return Piece(0.0, law.dead_band, 0.0, ONE, ZERO)


@stiction_band.implements(Karnopp)
def _dead_band(law):
    return law.dead_band


#: Laws by the name that the configuration gives them.
LAWS = {
    "coulomb": (Coulomb, Traits(SetValued, static=False)),
    "stiction": (Stiction, Traits(SetValued)),
    "tustin": (Tustin, Traits(SetValued)),
    "karnopp": (Karnopp, Traits(SetValued, dead_band=True)),
}
