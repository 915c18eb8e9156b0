"""Set-valued laws: at rest friction takes any value up to a bound."""

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
    end_of_tail,
    exponential_tail,
    exponential_weights,
    piece,
    steepest,
    stiction_band,
)
from ringsweep.quantities.parameters import Leaf, Parameter


class Coulomb(NamedTuple):
    """Amontons-Coulomb friction: :math:`\\mu_k` against the motion (the paper's Eqs. 25-26)."""


class Stiction(NamedTuple):
    """Coulomb friction with stiction: up to :math:`\\mu_s` at rest, :math:`\\mu_k` in motion."""


@piece.implements(Coulomb, Stiction)
def _constant_piece(law, region):
    return Piece(0.0, inf, 0.0, ZERO, ONE) if region == KINETIC else absent()


@blend.implements(Coulomb, Stiction)
def _constant_blend(law, speed):
    # At rest a set-valued law has no single value: zero is taken.
    return 0.0, select(speed > 0.0, 1.0, 0.0), 0.0, 0.0


class Tustin(NamedTuple):
    """Friction that decays with the speed (Tustin 1947): Bengisu-Akay friction with a vanishing band.

    Up to :math:`\\mu_s` at rest; in motion :math:`\\mu = \\mu_k + (\\mu_s - \\mu_k) e^{-\\alpha |v|}`. ``end`` is the
    speed at which the tail ends, m/s.
    """

    alpha: Annotated[Leaf, ALPHA]
    end: Any = inf

    @classmethod
    def of(cls, alpha: Any) -> Tustin:
        """Law with the end of its tail computed."""
        return cls(alpha, end_of_tail(alpha, 0.0))


@piece.implements(Tustin)
def _tustin_piece(law, region):
    return exponential_tail(region, 0.0, law.end, law.alpha) if region != BAND else absent()


@steepest.implements(Coulomb, Stiction, Tustin)
def _jump_at_rest(law):
    # At rest friction jumps by the static coefficient.
    return (inf, 0.0), (inf, 0.0)


@stiction_band.implements(Coulomb, Stiction, Tustin)
def _no_band(law):
    return 0.0


@blend.implements(Tustin)
def _tustin_blend(law, speed):
    w_s, w_k, dw_s, dw_k = exponential_weights(law.alpha, speed, speed < law.end)
    slips = select(speed > 0.0, 1.0, 0.0)
    return slips * w_s, slips * w_k, dw_s, dw_k


class Karnopp(NamedTuple):
    """Stiction with a dead band: a contact slower than :math:`D_v` counts as stuck (the paper's Fig. 4).

    .. math::

        F = \\operatorname{sgn}(F_e)\\, \\min(|F_e|, \\mu_s F_N) \\quad (|v| \\le D_v), \\qquad
        F = \\mu_k F_N \\operatorname{sgn} v \\quad (|v| > D_v)

    with :math:`F_e` the force that friction must balance (Karnopp, J. Dyn. Syst. Meas. Control 107, 1985). While
    friction balances :math:`F_e`, the contact keeps the speed at which it entered the band.
    """

    dead_band: Annotated[Leaf, Parameter("m/s", "half-width of the dead band D_v", lower=0.0, open_lower=True)]


@piece.implements(Karnopp)
def _karnopp_piece(law, region):
    if region == STRIBECK:
        return absent()
    if region == KINETIC:
        return Piece(law.dead_band, inf, 0.0, ZERO, ONE)
    return Piece(0.0, law.dead_band, 0.0, ONE, ZERO)


@blend.implements(Karnopp)
def _karnopp_blend(law, speed):
    stuck = speed < law.dead_band
    return select(stuck, 1.0, 0.0), select(stuck, 0.0, 1.0), 0.0, 0.0


@steepest.implements(Karnopp)
def _level(law):
    # The jump at the edge of the band is no slope: a step that jumps over the whole band has infinite stiffness.
    return (0.0, 0.0), (0.0, 0.0)


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
