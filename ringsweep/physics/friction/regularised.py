"""Smooth laws: continuous functions of the sliding velocity."""

from __future__ import annotations

from math import exp, inf
from typing import Annotated, Any, NamedTuple

from ringsweep.numerics.functions import decay, select
from ringsweep.physics.friction.registry import Smooth, Traits
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

V0 = Parameter("m/s", "half-width of the stiction band", lower=0.0, open_lower=True)
V1 = Parameter("m/s", "sliding speed from which friction is kinetic", lower=0.0, open_lower=True)


class Threlfall(NamedTuple):
    """Coulomb friction regularised by an exponential (Threlfall, Mech. Mach. Theory 13, 1978).

    .. math::

        \\mu = \\mu_k\\, \\frac{1 - e^{-3|v|/v_0}}{1 - e^{-3}} \\quad (|v| < v_0), \\qquad
        \\mu = \\mu_k \\quad (|v| \\ge v_0)

    The denominator, often rounded to 0.95, makes the law continuous.
    """

    v0: Annotated[Leaf, V0]


@piece.implements(Threlfall)
def _threlfall_piece(law, region):
    if region == STRIBECK:
        return absent()
    if region == KINETIC:
        return Piece(law.v0, inf, 0.0, ZERO, ONE)
    full = 1.0 / (1.0 - exp(-3.0))
    return Piece(0.0, law.v0, 3.0 / law.v0, ZERO, (full, 0.0, -full, 0.0))


@blend.implements(Threlfall)
def _threlfall_blend(law, speed):
    full, rate = 1.0 / (1.0 - exp(-3.0)), 3.0 / law.v0
    q = full * decay(rate * speed)
    within = speed < law.v0
    return 0.0, select(within, full - q, 1.0), 0.0, select(within, rate * q, 0.0)


@steepest.implements(Threlfall)
def _threlfall_steepest(law):
    return (0.0, 3.0 / (law.v0 * (1.0 - exp(-3.0)))), (0.0, 0.0)


class PiecewiseLinear(NamedTuple):
    """Stiction regularised by straight lines (the paper's Fig. 5).

    From 0 at rest to :math:`\\mu_s` at v0, then down to :math:`\\mu_k` at v1, constant above v1.
    """

    v0: Annotated[Leaf, V0]
    v1: Annotated[Leaf, V1]


@piece.implements(PiecewiseLinear)
def _piecewise_linear_piece(law, region):
    if region == KINETIC:
        return Piece(law.v1, inf, 0.0, ZERO, ONE)
    if region == BAND:
        return Piece(0.0, law.v0, 0.0, (0.0, 1.0 / law.v0, 0.0, 0.0), ZERO)
    rate = 1.0 / (law.v1 - law.v0)
    return Piece(law.v0, law.v1, 0.0, (1.0, -rate, 0.0, 0.0), (0.0, rate, 0.0, 0.0))


@blend.implements(PiecewiseLinear)
def _piecewise_linear_blend(law, speed):
    up, down = 1.0 / law.v0, 1.0 / (law.v1 - law.v0)
    x = min(max((speed - law.v0) * down, 0.0), 1.0)
    within = speed < law.v0
    fall = select(within | (speed >= law.v1), 0.0, down)
    return select(within, speed * up, 1.0 - x), x, select(within, up, -fall), fall


@steepest.implements(PiecewiseLinear)
def _piecewise_linear_steepest(law):
    rate = 1.0 / (law.v1 - law.v0)
    return (1.0 / law.v0, 0.0), (-rate, rate)


class PiecewiseCubic(NamedTuple):
    """Stiction regularised by cubics with a continuous slope (the paper's Fig. 6; STEP of multibody codes).

    .. math::

        \\mu = \\tfrac12 \\mu_s (3\\eta - \\eta^3),\\ \\eta = \\tfrac{|v|}{v_0} \\ (|v| < v_0), \\qquad
        \\mu = \\mu_s + (\\mu_k - \\mu_s)(3\\xi^2 - 2\\xi^3),\\ \\xi = \\tfrac{|v| - v_0}{v_1 - v_0} \\ (|v| < v_1)

    and :math:`\\mu_k` above v1.
    """

    v0: Annotated[Leaf, V0]
    v1: Annotated[Leaf, V1]


@piece.implements(PiecewiseCubic)
def _piecewise_cubic_piece(law, region):
    if region == KINETIC:
        return Piece(law.v1, inf, 0.0, ZERO, ONE)
    if region == BAND:
        rate = 1.0 / law.v0
        return Piece(0.0, law.v0, 0.0, (0.0, 1.5 * rate, 0.0, -0.5 * rate * rate * rate), ZERO)
    rate = 1.0 / (law.v1 - law.v0)
    square, cube = 3.0 * rate * rate, 2.0 * rate * rate * rate
    return Piece(law.v0, law.v1, 0.0, (1.0, 0.0, -square, cube), (0.0, 0.0, square, -cube))


@blend.implements(PiecewiseCubic)
def _piecewise_cubic_blend(law, speed):
    up, down = 1.0 / law.v0, 1.0 / (law.v1 - law.v0)
    eta, x = speed * up, min(max((speed - law.v0) * down, 0.0), 1.0)
    within = speed < law.v0
    kinetic, fall = x * x * (3.0 - 2.0 * x), 6.0 * down * x * (1.0 - x)
    rising, rise = 0.5 * eta * (3.0 - eta * eta), 1.5 * up * (1.0 - eta * eta)
    return select(within, rising, 1.0 - kinetic), kinetic, select(within, rise, -fall), fall


@steepest.implements(PiecewiseCubic)
def _piecewise_cubic_steepest(law):
    # Steepest in the middle of the fall; at v0 its slope is zero.
    rate = 1.5 / (law.v1 - law.v0)
    return (1.5 / law.v0, 0.0), (-rate, rate)


class BengisuAkay(NamedTuple):
    """Bengisu-Akay friction: a parabola up to v0, an exponential tail above (the paper's Eqs. 23-24).

    .. math::

        \\mu = \\mu_s [1 - (1 - |v|/v_0)^2] \\quad (|v| < v_0), \\qquad
        \\mu = \\mu_k [1 + (\\mu_s/\\mu_k - 1) e^{-\\alpha(|v| - v_0)}] \\quad (|v| \\ge v_0)

    ``end`` is the speed at which the tail ends, m/s.
    """

    alpha: Annotated[Leaf, ALPHA]
    v0: Annotated[Leaf, V0]
    end: Any = inf

    @classmethod
    def of(cls, alpha: Any, v0: Any) -> BengisuAkay:
        """Law with the end of its tail computed."""
        return cls(alpha, v0, end_of_tail(alpha, v0))


@piece.implements(BengisuAkay)
def _bengisu_akay_piece(law, region):
    if region != BAND:
        return exponential_tail(region, law.v0, law.end, law.alpha)
    rate = 1.0 / law.v0
    return Piece(0.0, law.v0, 0.0, (0.0, 2.0 * rate, -rate * rate, 0.0), ZERO)


@blend.implements(BengisuAkay)
def _bengisu_akay_blend(law, speed):
    w_s, w_k, dw_s, dw_k = exponential_weights(law.alpha, speed - law.v0, speed < law.end)
    rate = 1.0 / law.v0
    eta, within = speed * rate, speed < law.v0
    return (
        select(within, eta * (2.0 - eta), w_s),
        select(within, 0.0, w_k),
        select(within, 2.0 * rate * (1.0 - eta), dw_s),
        select(within, 0.0, dw_k),
    )


@steepest.implements(BengisuAkay)
def _bengisu_akay_steepest(law):
    return (2.0 / law.v0, 0.0), (-law.alpha, law.alpha)


@stiction_band.implements(Threlfall, PiecewiseLinear, PiecewiseCubic, BengisuAkay)
def _band(law):
    return law.v0


#: Laws by the name that the configuration gives them.
LAWS = {
    "threlfall": (Threlfall, Traits(Smooth, static=False)),
    "piecewise-linear": (PiecewiseLinear, Traits(Smooth, ascending=("v0", "v1"))),
    "piecewise-cubic": (PiecewiseCubic, Traits(Smooth, ascending=("v0", "v1"))),
    "bengisu-akay": (BengisuAkay, Traits(Smooth)),
}
