"""Friction laws whose force is proportional to the normal load.

A law gives the magnitude of the friction coefficient as a blend of the static and the kinetic
coefficient of the surface under the contact,

.. math:: \\mu(|v|) = w_s(|v|)\\, \\mu_s + w_k(|v|)\\, \\mu_k ,

so that one evaluation of the weights serves every contact, whatever surface it stands on.

To add a law: a ``NamedTuple`` with its parameters, one body for :func:`weights`, a line in ``LAWS``.
"""

from __future__ import annotations

from math import exp, inf, log
from typing import Annotated, NamedTuple

from ringsweep.jit import hook, inlined
from ringsweep.parameters import Parameter

MU_S = Parameter("1", "static friction coefficient", lower=0.0)
MU_K = Parameter("1", "kinetic friction coefficient", lower=0.0)


class Coulomb(NamedTuple):
    """Amontons-Coulomb friction: :math:`\\mu_k` against the motion (the paper's Eqs. 25-26)."""


class Stiction(NamedTuple):
    """Coulomb friction with stiction: up to :math:`\\mu_s` at rest, :math:`\\mu_k` in motion."""


class Tustin(NamedTuple):
    """Stiction that decays with speed: the tail of Bengisu and Akay in the limit of a vanishing band.

    Up to :math:`\\mu_s` at rest and, in motion,
    :math:`\\mu = \\mu_k + (\\mu_s - \\mu_k) e^{-\\alpha |v|}` (Tustin 1947).
    """

    alpha: Annotated[float, Parameter("s/m", "decay of friction with sliding speed", lower=0.0)]


class BengisuAkay(NamedTuple):
    """Bengisu-Akay friction: a parabola up to v0, an exponential tail beyond (the paper's Eqs. 23-24).

    .. math::

        \\mu = \\mu_s [1 - (1 - |v|/v_0)^2] \\quad (|v| < v_0), \\qquad
        \\mu = \\mu_k [1 + (\\mu_s/\\mu_k - 1) e^{-\\alpha(|v| - v_0)}] \\quad (|v| \\ge v_0)
    """

    alpha: Annotated[float, Parameter("s/m", "decay of friction with sliding speed", lower=0.0)]
    v0: Annotated[float, Parameter("m/s", "half-width of the stiction band", lower=0.0, open_lower=True)]


#: Laws by the name that the configuration gives them.
LAWS: dict[str, type] = {
    "coulomb": Coulomb,
    "stiction": Stiction,
    "tustin": Tustin,
    "bengisu-akay": BengisuAkay,
}


#: Laws whose friction at rest is whatever holds the contact, up to a bound.
SET_VALUED = (Coulomb, Stiction, Tustin)

#: Laws whose friction is a continuous function of the sliding velocity.
SMOOTH = (BengisuAkay,)

#: Laws that know no static friction.
WITHOUT_STATIC = {Coulomb}


def coefficients_of(law: type) -> dict[str, Parameter]:
    """Coefficients that a law needs of each surface."""
    return {"mu_k": MU_K} if law in WITHOUT_STATIC else {"mu_s": MU_S, "mu_k": MU_K}


@hook
def weights(law, speed):
    """Weights of the static and the kinetic coefficient, and their slopes.

    Parameters
    ----------
    law : NamedTuple
        One of ``LAWS``.
    speed : float
        Magnitude of the sliding velocity, m/s.

    Returns
    -------
    tuple of float
        ``(w_s, w_k, dw_s/dspeed, dw_k/dspeed)``; weights in 1, slopes in s/m.
    """


@weights.implements(Coulomb, Stiction)
def _coulomb(law, speed):
    return 0.0, 1.0, 0.0, 0.0


@weights.implements(Tustin)
def _tustin(law, speed):
    excess = law.alpha * speed
    tail = exp(-excess) if excess < 40.0 else 0.0
    return tail, 1.0 - tail, -law.alpha * tail, law.alpha * tail


@weights.implements(BengisuAkay)
def _bengisu_akay(law, speed):
    if speed < law.v0:
        rest = 1.0 - speed / law.v0
        return 1.0 - rest * rest, 0.0, 2.0 * rest / law.v0, 0.0
    excess = law.alpha * (speed - law.v0)
    # exp(-40) is below the rounding of the sum: spare the call.
    tail = exp(-excess) if excess < 40.0 else 0.0
    return tail, 1.0 - tail, -law.alpha * tail, law.alpha * tail


@hook
def stiction_band(law):
    """Speed below which a contact counts as stuck, m/s; 0 for laws that stick exactly or never."""


@stiction_band.implements(Coulomb, Stiction, Tustin)
def _coulomb_band(law):
    return 0.0


@stiction_band.implements(BengisuAkay)
def _bengisu_akay_band(law):
    return law.v0


#: Regions of the sliding speed in which a law is analytic.
CLEAN, TAIL, BAND = 0, 1, 2


@hook
def region_bounds(law, region):
    """Speeds between which a region lies, m/s."""


@region_bounds.implements(Coulomb, Stiction)
def _one_region(law, region):
    return 0.0, inf


@region_bounds.implements(Tustin, BengisuAkay)
def _three_regions(law, region):
    band = stiction_band(law)
    # What is cut off changes the sliding velocity by less than 1e-17 m/s.
    end = band + min(40.0, max(10.0, 39.1 - log(law.alpha))) / law.alpha if law.alpha > 0.0 else inf
    if region == CLEAN:
        return end, inf
    return (band, end) if region == TAIL else (0.0, band)


@hook
def constant_weights(law, region):
    """Whether the friction coefficients are constant in a region."""


@constant_weights.implements(Coulomb, Stiction)
def _always_constant(law, region):
    return True


@constant_weights.implements(Tustin, BengisuAkay)
def _constant_when_clean(law, region):
    return region == CLEAN


@hook
def expand_weights(law, region, speed, k, static, kinetic):
    """Coefficient `k` of the series of both weights, given those of the speed up to `k`.

    Parameters
    ----------
    law : NamedTuple
    region : int
    speed, static, kinetic : ndarray
        Series of the speed (m/s) and of the weights; coefficient `k` of the weights is filled.
    k : int
    """


@expand_weights.implements(Coulomb, Stiction)
def _expand_constant(law, region, speed, k, static, kinetic):
    static[k], kinetic[k] = 0.0, 1.0 if k == 0 else 0.0


@expand_weights.implements(Tustin, BengisuAkay)
def _expand_tail(law, region, speed, k, static, kinetic):
    band = stiction_band(law)
    if region == BAND:
        total = 0.0
        for j in range(k + 1):
            total += speed[j] * speed[k - j]
        static[k] = (2.0 * speed[k] - total / band) / band
        kinetic[k] = 0.0
    elif region == TAIL:
        if k == 0:
            static[0] = exp(-law.alpha * max(speed[0] - band, 0.0))
        else:
            total = 0.0
            for j in range(1, k + 1):
                total += j * speed[j] * static[k - j]
            static[k] = -law.alpha * total / k
        kinetic[k] = (1.0 if k == 0 else 0.0) - static[k]
    else:
        static[k], kinetic[k] = 0.0, 1.0 if k == 0 else 0.0


@hook
def holding(law, mu_s, mu_k):
    """Coefficient up to which a contact at rest holds."""


@holding.implements(Coulomb)
def _hold_kinetic(law, mu_s, mu_k):
    return mu_k


@holding.implements(Stiction, Tustin, BengisuAkay)
def _hold_static(law, mu_s, mu_k):
    return mu_s


@inlined
def region_at(law, speed):
    """Region that holds a sliding speed, m/s; a boundary belongs to the region above it."""
    for region in (CLEAN, TAIL):
        if speed >= region_bounds(law, region)[0]:
            return region
    return BAND
