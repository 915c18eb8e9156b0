"""Laws with a memory: friction carried by bristles, whose mean deflection z is a state of its own.

Stiffness and damping are per unit of the normal load here: 1/m and s/m, so that the traction, the force per unit of
the load, is :math:`\\sigma_0 z + \\sigma_1 \\dot z + \\sigma_2 v`. To add a law: a class with its parameters, its
formula, :func:`bristle`, and what tells stick from slip, :func:`region_guard`.
"""

from __future__ import annotations

from math import cos, exp, pi, sin
from typing import Annotated, Any, NamedTuple

import numpy as np

from ringsweep.compile import inlined
from ringsweep.physics.friction.presliding import (
    NEARLY,
    SIGMA_0,
    SIGMA_1,
    SIGMA_2,
    V_S,
    after_yield,
    bristle,
    initial_deflection,
    region_guard,
    steady_deflection,
    stick_speed,
)
from ringsweep.physics.friction.registry import Dynamic, Traits
from ringsweep.physics.friction.velocity import BAND, KINETIC
from ringsweep.quantities.parameters import Leaf, Parameter


class Dahl(NamedTuple):
    """Dahl's bristles: :math:`\\dot z = v - \\sigma_0 |v| z/\\mu_k` and the traction :math:`\\sigma_0 z` (Dahl 1968).

    Coulomb friction with presliding. The contact counts as slipping where the bristles have come within a thousandth
    of their greatest traction.
    """

    sigma0: Annotated[Leaf, SIGMA_0]


@bristle.implements(Dahl)
def _dahl(law, mu_s, mu_k, v, z, sign, region):
    rate_v = 1.0 - law.sigma0 * sign * z / mu_k
    rate_z = -law.sigma0 * sign * v / mu_k
    return v * rate_v, rate_v, rate_z, law.sigma0 * z, 0.0, law.sigma0


@region_guard.implements(Dahl)
def _dahl_lasts(law, mu_s, mu_k, v, z, sign, region):
    slack = NEARLY - law.sigma0 * sign * z / mu_k
    return slack if region == BAND else -slack


@steady_deflection.implements(Dahl)
def _dahl_steady(law, mu_s, mu_k, v):
    return (1.0 if v > 0.0 else -1.0 if v < 0.0 else 0.0) * mu_k / law.sigma0


@inlined
def stribeck(law, mu_s, mu_k, v):
    """Friction coefficient of steady sliding without its viscous part, and its slope: the g(v) of LuGre."""
    x = v / law.v_s
    tail = exp(-x * x) if x * x < 700.0 else 0.0
    return mu_k + (mu_s - mu_k) * tail, -2.0 * x / law.v_s * (mu_s - mu_k) * tail


@inlined
def viscoelastic(law, v, z, rate, rate_v, rate_z):
    """What :func:`bristle` returns, of bristles with damping and viscous friction."""
    return (
        rate,
        rate_v,
        rate_z,
        law.sigma0 * z + law.sigma1 * rate + law.sigma2 * v,
        law.sigma1 * rate_v + law.sigma2,
        law.sigma0 + law.sigma1 * rate_z,
    )


class LuGre(NamedTuple):
    """Bristles with Stribeck's curve (Canudas de Wit et al., IEEE Trans. Autom. Control 40, 1995; paper, Eqs. 11-13).

    .. math::

        \\dot z = v - \\frac{\\sigma_0 |v|}{g(v)} z, \\qquad g = \\mu_k + (\\mu_s - \\mu_k) e^{-(v/v_s)^2}, \\qquad
        \\mu = \\sigma_0 z + \\sigma_1 \\dot z + \\sigma_2 v

    The contact counts as stuck while it is slower than the Stribeck velocity and its bristles have not yet come within
    a thousandth of the deflection :math:`g/\\sigma_0` of steady sliding.
    """

    sigma0: Annotated[Leaf, SIGMA_0]
    v_s: Annotated[Leaf, V_S]
    sigma1: Annotated[Leaf, SIGMA_1]
    sigma2: Annotated[Leaf, SIGMA_2]


@bristle.implements(LuGre)
def _lugre(law, mu_s, mu_k, v, z, sign, region):
    g, slope = stribeck(law, mu_s, mu_k, v)
    share = law.sigma0 * sign * z / g
    return viscoelastic(law, v, z, v * (1.0 - share), 1.0 - share + v * share * slope / g, -law.sigma0 * sign * v / g)


class ElastoPlastic(NamedTuple):
    """LuGre with a range in which bristles only deflect (Dupont et al., IEEE Trans. Autom. Control 47, 2002).

    .. math:: \\dot z = v \\left(1 - a(z, v)\\, \\frac{\\sigma_0 \\operatorname{sgn}(v)\\, z}{g(v)}\\right)

    with a = 0 while the bristles are relieved or deflected by less than ``elastic_fraction``
    times :math:`\\mu_k/\\sigma_0`, a = 1 from their steady deflection :math:`g/\\sigma_0` on, half a sine between.
    Below that deflection a contact under an oscillating load does not drift.
    """

    sigma0: Annotated[Leaf, SIGMA_0]
    v_s: Annotated[Leaf, V_S]
    sigma1: Annotated[Leaf, SIGMA_1]
    sigma2: Annotated[Leaf, SIGMA_2]
    elastic_fraction: Annotated[
        Leaf,
        Parameter("1", "purely elastic share of the kinetic deflection", 0.0, 1.0, True, True, default=0.7),
    ]


@bristle.implements(ElastoPlastic)
def _elasto_plastic(law, mu_s, mu_k, v, z, sign, region):
    g, slope = stribeck(law, mu_s, mu_k, v)
    load = law.sigma0 * sign * z
    elastic = law.elastic_fraction * mu_k
    if load <= elastic:
        return viscoelastic(law, v, z, v, 1.0, 0.0)
    if load >= g:
        plastic, by_load, by_g = 1.0, 0.0, 0.0
    else:
        width = g - elastic
        angle = pi * ((load - elastic) / width - 0.5)
        plastic = 0.5 + 0.5 * sin(angle)
        by_load = 0.5 * pi * cos(angle) / width
        by_g = -by_load * (load - elastic) / width
    rate_v = 1.0 - plastic * load / g - v * slope * (by_g - plastic / g) * load / g
    rate_z = -law.sigma0 * sign * v * (plastic + by_load * load) / g
    return viscoelastic(law, v, z, v * (1.0 - plastic * load / g), rate_v, rate_z)


@region_guard.implements(LuGre, ElastoPlastic)
def _loading(law, mu_s, mu_k, v, z, sign, region):
    g, _ = stribeck(law, mu_s, mu_k, v)
    slack = min(NEARLY - law.sigma0 * sign * z / g, 1.0 - sign * v / law.v_s)
    return slack if region == BAND else -slack


@steady_deflection.implements(LuGre, ElastoPlastic)
def _stribeck_steady(law, mu_s, mu_k, v):
    g, _ = stribeck(law, mu_s, mu_k, v)
    return (1.0 if v > 0.0 else -1.0 if v < 0.0 else 0.0) * g / law.sigma0


@after_yield.implements(Dahl, LuGre, ElastoPlastic)
def _passes(law, mu_s, mu_k, z, sign, region):
    return z, KINETIC if region == BAND else BAND


@stick_speed.implements(LuGre, ElastoPlastic)
def _stribeck_or_recoil(law, recoil):
    return min(law.v_s, recoil)


@initial_deflection.implements(Dahl, LuGre, ElastoPlastic)
def _undeflected(law, mu_s, mu_k):
    return 0.0


class ResetIntegrator(NamedTuple):
    """A spring that gives way (Haessig and Friedland, J. Dyn. Syst. Meas. Control 113, 1991).

    The bristles follow the body, :math:`\\dot z = v` with the traction :math:`\\sigma_0 z + \\sigma_1 v`, up to
    :math:`|z| = \\mu_s/\\sigma_0`; there they stay, with the traction :math:`\\mu_k`, until the body turns back.
    """

    sigma0: Annotated[Leaf, SIGMA_0]
    sigma1: Annotated[Leaf, SIGMA_1]


@bristle.implements(ResetIntegrator)
def _reset_integrator(law, mu_s, mu_k, v, z, sign, region):
    if region == BAND:
        return v, 1.0, 0.0, law.sigma0 * z + law.sigma1 * v, law.sigma1, law.sigma0
    return 0.0, 0.0, 0.0, sign * mu_k, 0.0, 0.0


@region_guard.implements(ResetIntegrator)
def _until_saturated(law, mu_s, mu_k, v, z, sign, region):
    return mu_s - law.sigma0 * sign * z if region == BAND else 1.0


@after_yield.implements(ResetIntegrator)
def _saturates(law, mu_s, mu_k, z, sign, region):
    return sign * mu_s / law.sigma0, KINETIC


@initial_deflection.implements(ResetIntegrator)
def _reset_made(law, mu_s, mu_k):
    return 0.0


#: Bonds of a contact of :class:`Bristles`; twenty to twenty-five are what its authors advise.
BONDS = 20

# Park and Miller's generator: its numbers are exact in double precision.
_MULTIPLIER, _MODULUS = 16807.0, 2147483647.0


class Bristles(NamedTuple):
    """Twenty bonds that snap and form anew at random (Haessig and Friedland 1991).

    Each bond is a spring; at the deflection :math:`\\delta` it snaps, and a new one forms whose deflection lies between
    :math:`-\\delta/2` and :math:`\\delta/2`, anywhere with equal chance. The traction is :math:`\\sigma_0` times the
    mean deflection. In steady sliding its mean is :math:`\\tfrac{11}{24} \\sigma_0 \\delta`, which is set to
    :math:`\\mu_k`. The contact counts as slipping once as many bonds have snapped in one direction as there are.

    ``bonds`` is memory that belongs to the cell: the deflection of each bond beyond the mean, the state of the random
    generator, and the number of bonds that have snapped in one direction, negative for backwards.
    """

    sigma0: Annotated[Leaf, SIGMA_0]
    seed: Annotated[Leaf, Parameter("1", "seed of the random bonds", lower=0.0, upper=2.0**31 - 4.0, default=0.0)]
    bonds: Any = None

    @classmethod
    def of(cls, sigma0: Any, seed: Any) -> Bristles:
        """The law with memory for the bonds of every cell."""
        return cls(sigma0, seed, bonds=np.zeros((*np.shape(sigma0), BONDS + 2)))


@inlined
def _snapping(law, mu_k):
    """Deflection at which a bond snaps, m."""
    return 24.0 / 11.0 * mu_k / law.sigma0


@inlined
def _new_bond(law, mu_k):
    """Deflection of a new bond, m; moves the random generator on."""
    law.bonds[BONDS] = (_MULTIPLIER * law.bonds[BONDS]) % _MODULUS
    return (law.bonds[BONDS] / _MODULUS - 0.5) * _snapping(law, mu_k)


@bristle.implements(Bristles)
def _bristles(law, mu_s, mu_k, v, z, sign, region):
    return v, 1.0, 0.0, law.sigma0 * z, 0.0, law.sigma0


@region_guard.implements(Bristles)
def _until_snap(law, mu_s, mu_k, v, z, sign, region):
    longest = sign * law.bonds[0]
    for i in range(1, BONDS):
        longest = max(longest, sign * law.bonds[i])
    return 1.0 - (sign * z + longest) / _snapping(law, mu_k)


@after_yield.implements(Bristles)
def _snap(law, mu_s, mu_k, z, sign, region):
    bonds = law.bonds
    longest = 0
    for i in range(1, BONDS):
        if sign * bonds[i] > sign * bonds[longest]:
            longest = i
    # Bonds are kept beyond their mean, which is the state.
    bonds[longest] = _new_bond(law, mu_k) - z
    mean = 0.0
    for i in range(BONDS):
        mean += bonds[i] / BONDS
    for i in range(BONDS):
        bonds[i] -= mean
    bonds[BONDS + 1] = sign + (bonds[BONDS + 1] if sign * bonds[BONDS + 1] > 0.0 else 0.0)
    return z + mean, KINETIC if region == KINETIC or abs(bonds[BONDS + 1]) >= BONDS else BAND


@initial_deflection.implements(Bristles)
def _random_bonds(law, mu_s, mu_k):
    law.bonds[BONDS] = 1.0 + (48271.0 * (law.seed + 1.0)) % (_MODULUS - 1.0)
    law.bonds[BONDS + 1] = 0.0
    mean = 0.0
    for i in range(BONDS):
        law.bonds[i] = _new_bond(law, mu_k)
        mean += law.bonds[i] / BONDS
    for i in range(BONDS):
        law.bonds[i] -= mean
    return 0.0


@stick_speed.implements(Dahl, ResetIntegrator, Bristles)
def _recoil(law, recoil):
    return recoil


#: Laws by the name that the configuration gives them.
LAWS = {
    "dahl": (Dahl, Traits(Dynamic, static=False)),
    "lugre": (LuGre, Traits(Dynamic)),
    "elasto-plastic": (ElastoPlastic, Traits(Dynamic)),
    "reset-integrator": (ResetIntegrator, Traits(Dynamic)),
    "bristle": (Bristles, Traits(Dynamic, static=False, snaps=True)),
}
