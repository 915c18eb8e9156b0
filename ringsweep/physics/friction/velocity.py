"""Friction laws that are functions of the sliding velocity alone: values, slopes, power series and regions.

A law gives the friction coefficient as a weighted sum of the static and the kinetic coefficient of the surface,

.. math:: \\mu(|v|) = w_s(|v|)\\, \\mu_s + w_k(|v|)\\, \\mu_k .

Both contacts of a body have the same weights, even on different surfaces. The weights are analytic within each of up to
three regions of the sliding speed. :func:`piece` gives them there; all else is derived from it.
"""

from __future__ import annotations

from math import exp, inf, sqrt
from typing import Any, NamedTuple

import numpy as np

from ringsweep.compile import hook, inlined
from ringsweep.numerics.functions import any_of, decay, lanes_body, select
from ringsweep.numerics.series import INVERSE
from ringsweep.quantities.parameters import Parameter

MU_S = Parameter("1", "static friction coefficient", lower=0.0)
MU_K = Parameter("1", "kinetic friction coefficient", lower=0.0)

#: Regions of the sliding speed, from the fastest to the slowest. In BAND a contact counts as stuck.
KINETIC, STRIBECK, BAND = 0, 1, 2


class Piece(NamedTuple):
    """Weights of both friction coefficients in a region of the sliding speed.

    With ``x = speed - low`` and ``q = exp(-decay x)``, or ``q = x**2`` if ``decay`` is zero, a weight with the
    coefficients ``(a0, a1, a2, a3)`` is ``a0 + a1 x + a2 q + a3 x q``.

    Attributes
    ----------
    low, high : float
        Bounds of the region, m/s. Both are zero if the law lacks the region.
    decay : float
        Decay of q, s/m.
    static, kinetic : tuple of float
        Coefficients of the weights of the static and of the kinetic coefficient: a0 in 1, a1 in s/m; a2 in 1 and a3 in
        s/m, or a2 in s^2/m^2 and a3 in s^3/m^3 if ``decay`` is zero.
    """

    low: float
    high: float
    decay: float
    static: tuple[float, float, float, float]
    kinetic: tuple[float, float, float, float]


#: Coefficients of constant weights.
ZERO = (0.0, 0.0, 0.0, 0.0)
ONE = (1.0, 0.0, 0.0, 0.0)


@hook
def piece(law, region):
    """Weights of both friction coefficients in a region of the sliding speed.

    Parameters
    ----------
    law : NamedTuple
    region : int
        KINETIC, STRIBECK or BAND.

    Returns
    -------
    Piece
        :func:`absent` if the law lacks the region.
    """


@hook(absorb=True)
def stiction_band(law):
    """Sliding speed below which a contact counts as stuck, m/s: the upper bound of BAND; 0 for laws without BAND."""


@inlined
def region_bounds(law, region):
    """Lower and upper bound of a region, m/s."""
    p = piece(law, region)
    return p.low, p.high


@inlined
def region_at(law, speed):
    """Region of a sliding speed, m/s; a bound belongs to the region above it."""
    if speed >= piece(law, KINETIC).low:
        return KINETIC
    p = piece(law, STRIBECK)
    return STRIBECK if p.low < p.high and speed >= p.low else BAND


@inlined
def faster(law, region):
    """Region above the upper bound of `region`."""
    return STRIBECK if region == BAND and piece(law, STRIBECK).low < piece(law, STRIBECK).high else KINETIC


@inlined
def slower(law, region):
    """Region below the lower bound of `region`."""
    return STRIBECK if region == KINETIC and piece(law, STRIBECK).low < piece(law, STRIBECK).high else BAND


@inlined
def constant_weights(law, region):
    """Whether both weights are constant in a region."""
    p = piece(law, region)
    (_, s1, s2, s3), (_, k1, k2, k3) = p.static, p.kinetic
    return s1 == 0.0 and s2 == 0.0 and s3 == 0.0 and k1 == 0.0 and k2 == 0.0 and k3 == 0.0


@hook(absorb=True)
def blend(law, speed):
    """Body of :func:`weights` for vector lanes. Each lane may be in another region, so it is written without ``if``.

    Parameters
    ----------
    law : NamedTuple
        Its fields are Lanes.
    speed : Lanes
        Magnitude of the sliding velocity, m/s.

    Returns
    -------
    tuple of Lanes
        ``(w_s, w_k, dw_s/dspeed, dw_k/dspeed)``; weights in 1, slopes in s/m.
    """


@hook(absorb=True)
def steepest(law):
    """Slopes of the weights where friction is steepest: at rest, and outside the stiction band.

    ``rk4`` takes the stiffness of a step that meets one of these speeds from them.

    Parameters
    ----------
    law : NamedTuple

    Returns
    -------
    tuple of tuple of float
        ``((dw_s/dspeed, dw_k/dspeed) at rest, (dw_s/dspeed, dw_k/dspeed) outside the band)``, s/m. The latter are the
        steepest ones, usually at the upper bound of the band.
    """


def weights(law, speed):
    """Weights of the static and the kinetic coefficient, and their slopes.

    Parameters
    ----------
    law : NamedTuple
    speed : float
        Magnitude of the sliding velocity, m/s.

    Returns
    -------
    tuple of float
        ``(w_s, w_k, dw_s/dspeed, dw_k/dspeed)``; weights in 1, slopes in s/m.
    """
    return weights_in(law, region_at(law, speed), speed)


@lanes_body(weights)
def _lanes_weights(law, speed):
    return blend(law, speed)


@inlined
def weights_in(law, region, speed):
    """:func:`weights` by the formula of a region, even if the speed lies outside the region."""
    p = piece(law, region)
    if constant_weights(law, region):
        return p.static[0], p.kinetic[0], 0.0, 0.0
    x = speed - p.low
    if p.decay > 0.0:
        # exp(-40) is less than the rounding of the sum.
        q = exp(-p.decay * x) if p.decay * x < 40.0 else 0.0
        q_x = -p.decay * q
    else:
        q, q_x = x * x, 2.0 * x
    (s0, s1, s2, s3), (k0, k1, k2, k3) = p.static, p.kinetic
    return (
        s0 + s1 * x + (s2 + s3 * x) * q,
        k0 + k1 * x + (k2 + k3 * x) * q,
        s1 + s3 * q + (s2 + s3 * x) * q_x,
        k1 + k3 * q + (k2 + k3 * x) * q_x,
    )


@inlined
def passes_band(law, before, after, ahead):
    """Whether a step meets rest, or the upper bound of the stiction band.

    Parameters
    ----------
    law : NamedTuple
    before, after, ahead : float or Lanes
        Sliding velocity at the beginning of the step, at its end, and in its stages, m/s.

    Returns
    -------
    tuple of bool
        Whether the step meets rest; whether it meets rest or the bound of the band; whether it jumps across the whole
        band.
    """
    band = stiction_band(law)
    slow = min(min(abs(before), abs(after)), abs(ahead))
    fast = max(max(abs(before), abs(after)), abs(ahead))
    rest = (before * after < 0.0) | (before * ahead < 0.0)
    # A law without a band is set-valued at rest.
    rest = rest | ((band == 0.0) & (before * after == 0.0))
    return rest, rest | ((slow < band) & (band <= fast)), rest & (slow >= band)


@inlined
def basis_at(p, x):
    """q at the speed `x` (m/s) above the lower bound of a region, and its factor in q'; see :func:`basis_term`."""
    q = exp(-p.decay * max(x, 0.0)) if p.decay > 0.0 else x * x
    return q, basis_factor(p, x, q)


@inlined
def basis_factor(p, x, q):
    """Coefficient of the factor of x' in q': that of q for an exponential, that of x for a square."""
    return q if p.decay > 0.0 else x


@inlined
def basis_term(p, k, factor_0, x, inner):
    """Coefficient `k`, 1 or more, of the power series of q, from ``q' = -decay x' q`` or ``q' = 2 x' x``.

    Parameters
    ----------
    p : Piece
    k : int
    factor_0 : float
        Coefficient 0 of the factor, see :func:`basis_factor`.
    x : float
        Coefficient `k` of x.
    inner : float
        Inner product of x' and the factor, see :func:`ringsweep.numerics.terms.inner_products`.
    """
    return (-p.decay if p.decay > 0.0 else 2.0) * (x * factor_0 + INVERSE[k] * inner)


@inlined
def friction_terms(p, mu_s, mu_k, x_0):
    """Friction coefficient in a region as a power series, given those of x and q.

    Parameters
    ----------
    p : Piece
    mu_s, mu_k : float
        Static and kinetic friction coefficient of the surface, 1.
    x_0 : float
        Coefficient 0 of x, m/s.

    Returns
    -------
    tuple of float
        Coefficient 0 of the friction coefficient, and its derivatives by the coefficient k of x, by that of q, and by
        the inner product of x and q in that of x q.
    """
    s0, s1, s2, s3 = p.static
    k0, k1, k2, k3 = p.kinetic
    a0, a1, a2, a3 = s0 * mu_s + k0 * mu_k, s1 * mu_s + k1 * mu_k, s2 * mu_s + k2 * mu_k, s3 * mu_s + k3 * mu_k
    q_0, _ = basis_at(p, x_0)
    by_q = a2 + a3 * x_0
    return a0 + a1 * x_0 + by_q * q_0, a1 + a3 * q_0, by_q, a3


# Largest change of the exponent of an exponential within a step. For a larger change the terms still grow at the end of
# the series, so the last terms give no estimate of the error.
_MAX_EXPONENT = 8.0


@inlined
def shorten_for_decay(law, region, v, h):
    """Step shortened from `h`, s, so that the series of the weights converges within it.

    Parameters
    ----------
    law : NamedTuple
    region : int
    v : ndarray of shape ``(3 or more,)``
        Series of the sliding velocity, m/s^(k + 1).
    h : float
        Step, s.
    """
    decay = piece(law, region).decay
    return min(h, min(0.5 * _MAX_EXPONENT / (decay * abs(v[1])), sqrt(0.5 * _MAX_EXPONENT / (decay * abs(v[2])))))


# ---- exponential tails ------------------------------------------------------------------------

ALPHA = Parameter("s/m", "decay of friction with sliding speed", lower=0.0)


@inlined
def absent():
    """Piece for a region that a law lacks."""
    return Piece(0.0, 0.0, 0.0, ONE, ZERO)


@inlined
def exponential_tail(region, low, high, alpha):
    """Piece of an exponential tail: from static to kinetic friction as ``exp(-alpha (speed - low))``.

    Parameters
    ----------
    region : int
        STRIBECK for the tail, KINETIC for the region above it.
    low, high : float
        Bounds of the tail, m/s.
    alpha : float
        Decay, s/m; with 0 friction stays static.
    """
    if region == KINETIC:
        return Piece(high, inf, 0.0, ZERO, ONE)
    if alpha == 0.0:
        return Piece(low, high, 0.0, ONE, ZERO)
    return Piece(low, high, alpha, (0.0, 0.0, 1.0, 0.0), (1.0, 0.0, -1.0, 0.0))


@inlined
def exponential_weights(alpha, x, lasts):
    """:func:`weights` of an exponential tail, for floats and Lanes. Below the tail the result has no meaning.

    Parameters
    ----------
    alpha : float or Lanes
        Decay, s/m.
    x : float or Lanes
        Speed minus the lower bound of the tail, m/s.
    lasts : bool or Mask
        Whether the speed is below the upper bound of the tail.
    """
    q, decays = 0.0 * x, lasts & (x >= 0.0)
    # Often no run is in the tail.
    if any_of(decays):
        q = select(decays, decay(alpha * x), q)
    return q, 1.0 - q, -alpha * q, alpha * q


def end_of_tail(alpha: Any, low: Any) -> Any:
    """Upper bound of an exponential tail, m/s: the rest of it changes the sliding velocity by less than 1e-17 m/s.

    Parameters
    ----------
    alpha : float or ndarray
        Decay, s/m. With 0 the tail does not end.
    low : float or ndarray
        Lower bound of the tail, m/s.
    """
    with np.errstate(divide="ignore"):
        length = np.clip(39.1 - np.log(alpha), 10.0, 40.0) / alpha
    return np.where(np.asarray(alpha) > 0.0, low + length, inf)


#: Functions that every law of the sliding velocity must have.
MEMBERS = (piece, stiction_band)

#: Functions that ``rk4`` needs besides.
LANES_MEMBERS = (blend, steepest)
