"""Friction as a function of the sliding velocity alone: what every such law offers, from one formula.

A law gives the magnitude of the friction coefficient as a blend of the static and the kinetic
coefficient of the surface under the contact,

.. math:: \\mu(|v|) = w_s(|v|)\\, \\mu_s + w_k(|v|)\\, \\mu_k ,

so that one evaluation of the weights serves every contact, whatever surface it stands on. The weights
are analytic within each of at most three regions of the sliding speed; :func:`piece` gives them there,
and values, slopes, power series and regions all follow from it.
"""

from __future__ import annotations

from math import exp, inf, sqrt
from typing import Any, NamedTuple

import numpy as np

from ringsweep.compile import hook, inlined
from ringsweep.numerics.functions import decay, either, select
from ringsweep.quantities.parameters import Parameter

MU_S = Parameter("1", "static friction coefficient", lower=0.0)
MU_K = Parameter("1", "kinetic friction coefficient", lower=0.0)

#: Regions of the sliding speed, from the fastest to the slowest. In the last a contact counts as stuck.
KINETIC, STRIBECK, BAND = 0, 1, 2


class Piece(NamedTuple):
    """Weights between the sliding speeds ``low`` and ``high``, m/s; where both are zero the law lacks the region.

    With ``x = speed - low`` and ``q = exp(-decay x)``, or ``q = x**2`` where ``decay`` is zero, a weight with the
    coefficients ``(a0, a1, a2, a3)`` is ``a0 + a1 x + a2 q + a3 x q``.
    """

    low: float
    high: float
    decay: float
    static: tuple[float, float, float, float]
    kinetic: tuple[float, float, float, float]


#: Coefficients of weights that are constant.
ZERO = (0.0, 0.0, 0.0, 0.0)
ONE = (1.0, 0.0, 0.0, 0.0)


@hook
def piece(law, region):
    """Weights of both coefficients in a region of the sliding speed, a :class:`Piece`."""


@hook(absorb=True)
def stiction_band(law):
    """Speed below which a contact counts as stuck, m/s: where BAND ends; 0 for laws that stick exactly or never."""


@inlined
def region_bounds(law, region):
    """Speeds between which a region lies, m/s."""
    p = piece(law, region)
    return p.low, p.high


@inlined
def region_at(law, speed):
    """Region that holds a sliding speed, m/s; a boundary belongs to the region above it."""
    if speed >= piece(law, KINETIC).low:
        return KINETIC
    tail = piece(law, STRIBECK)
    return STRIBECK if tail.low < tail.high and speed >= tail.low else BAND


@inlined
def faster(law, region):
    """Region beyond the upper bound of one."""
    return STRIBECK if region == BAND and piece(law, STRIBECK).low < piece(law, STRIBECK).high else KINETIC


@inlined
def slower(law, region):
    """Region below the lower bound of one."""
    return STRIBECK if region == KINETIC and piece(law, STRIBECK).low < piece(law, STRIBECK).high else BAND


@inlined
def constant_weights(law, region):
    """Whether the friction coefficients are constant in a region."""
    p = piece(law, region)
    (_, s1, s2, s3), (_, k1, k2, k3) = p.static, p.kinetic
    return s1 == 0.0 and s2 == 0.0 and s3 == 0.0 and k1 == 0.0 and k2 == 0.0 and k3 == 0.0


@hook(absorb=True)
def blend(law, speed):
    """:func:`weights` where the speed is :mod:`ringsweep.numerics.lanes`, each in a region of its own: hence without
    ``if``."""


@hook(absorb=True)
def steepest(law):
    """Slopes of both weights at rest, and where the band ends, on its far side: there friction is steepest, s/m."""


def weights(law, speed):
    """Weights of the static and the kinetic coefficient, and their slopes.

    Parameters
    ----------
    law : NamedTuple
        A law of this kind.
    speed : float
        Magnitude of the sliding velocity, m/s.

    Returns
    -------
    tuple of float
        ``(w_s, w_k, dw_s/dspeed, dw_k/dspeed)``; weights in 1, slopes in s/m.
    """
    return weights_in(law, region_at(law, speed), speed)


@either(weights)
def _lanes_weights(law, speed):
    return blend(law, speed)


@inlined
def weights_in(law, region, speed):
    """:func:`weights` by the formula of a region, beyond its bounds too."""
    p = piece(law, region)
    if constant_weights(law, region):
        return p.static[0], p.kinetic[0], 0.0, 0.0
    x = speed - p.low
    if p.decay > 0.0:
        # exp(-40) is below the rounding of the sum: spare the call.
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
    """What a step meets whose sliding velocity is `before` at its beginning, `after` at its end, `ahead` in its stages.

    Returns
    -------
    tuple of bool
        Whether it meets rest, whether the edge of the band, and whether it jumps across the whole band.
    """
    band = stiction_band(law)
    slow = min(min(abs(before), abs(after)), abs(ahead))
    fast = max(max(abs(before), abs(after)), abs(ahead))
    rest = (before * after < 0.0) | (before * ahead < 0.0)
    # At rest a law without a band has every value at once.
    rest = rest | ((band == 0.0) & (before * after == 0.0))
    return rest, rest | ((slow < band) & (band <= fast)), rest & (slow >= band)


@inlined
def expand_weights(law, region, x, k, basis, static, kinetic):
    """Coefficient `k` of the series of both weights, given those of the speed up to `k`.

    Parameters
    ----------
    law : NamedTuple
    region : int
    x : ndarray
        Series of the speed in excess of the lower bound of the region, m/s.
    k : int
    basis, static, kinetic : ndarray
        Series of what :class:`Piece` calls q, and of the weights; coefficient `k` is filled.
    """
    p = piece(law, region)
    (s0, s1, s2, s3), (k0, k1, k2, k3) = p.static, p.kinetic
    if k == 0:
        basis[0] = exp(-p.decay * max(x[0], 0.0)) if p.decay > 0.0 else x[0] * x[0]
    else:
        total = 0.0
        if p.decay > 0.0:
            # q' = -decay x' q
            for j in range(1, k + 1):
                total += j * x[j] * basis[k - j]
            total *= -p.decay / k
        else:
            for j in range(k + 1):
                total += x[j] * x[k - j]
        basis[k] = total
    static[k] = s1 * x[k] + s2 * basis[k]
    kinetic[k] = k1 * x[k] + k2 * basis[k]
    if s3 != 0.0 or k3 != 0.0:
        cube = 0.0
        for j in range(k + 1):
            cube += x[j] * basis[k - j]
        static[k] += s3 * cube
        kinetic[k] += k3 * cube
    if k == 0:
        static[0] += s0
        kinetic[0] += k0


# Powers of e by which an exponential may change within a step of its series: of more the terms still grow where the
# series ends, and say nothing of what is left out.
_POWERS = 8.0


@inlined
def tail_reach(law, region, v, h):
    """A step not above `h`, short enough for the series of the weights; `v` is the series of the sliding velocity."""
    decay = piece(law, region).decay
    return min(h, min(0.5 * _POWERS / (decay * abs(v[1])), sqrt(0.5 * _POWERS / (decay * abs(v[2])))))


# ---- what several laws share: an exponential tail ----------------------------------------------

ALPHA = Parameter("s/m", "decay of friction with sliding speed", lower=0.0)


@inlined
def absent():
    """A region that a law lacks."""
    return Piece(0.0, 0.0, 0.0, ONE, ZERO)


@inlined
def tail(region, low, high, alpha):
    """Weights that pass from static to kinetic friction as ``exp(-alpha (speed - low))``, and beyond."""
    if region == KINETIC:
        return Piece(high, inf, 0.0, ZERO, ONE)
    if alpha == 0.0:
        return Piece(low, high, 0.0, ONE, ZERO)
    return Piece(low, high, alpha, (0.0, 0.0, 1.0, 0.0), (1.0, 0.0, -1.0, 0.0))


@inlined
def decaying(alpha, x, lasts):
    """:func:`weights` in a tail, at a speed `x` beyond its beginning, while it lasts."""
    q = select(lasts, decay(alpha * x), 0.0)
    return q, 1.0 - q, -alpha * q, alpha * q


def end_of_tail(alpha: Any, low: Any) -> Any:
    """Speed beyond which an exponential tail changes the sliding velocity by less than 1e-17 m/s, m/s."""
    with np.errstate(divide="ignore"):
        length = np.clip(39.1 - np.log(alpha), 10.0, 40.0) / alpha
    return np.where(np.asarray(alpha) > 0.0, low + length, inf)


#: Functions without which no solver takes a law.
MEMBERS = (piece, stiction_band)

#: Functions that runs side by side in vector lanes need besides.
LANES_MEMBERS = (blend, steepest)
