"""Dynamic laws: friction of bristles, whose mean deflection z is a state variable.

Stiffness and damping are per unit of the normal load: 1/m and s/m. :mod:`ringsweep.physics.friction.presliding`
describes the functions of a law.

All functions take vector lanes too. `sign` is the direction of the slip, 1.0 or -1.0; `region` is BAND in presliding
and KINETIC in slip.
"""

from __future__ import annotations

from math import pi
from typing import Annotated, Any, NamedTuple

import numpy as np

from ringsweep.compile import absorbed, inlined
from ringsweep.numerics.functions import any_of, decay, select, sine_cosine
from ringsweep.physics.friction.presliding import (
    NEARLY,
    SIGMA_0,
    SIGMA_1,
    SIGMA_2,
    V_S,
    after_yield,
    bristle,
    initial_deflection,
    part_before_bend,
    region_guard,
    steady_deflection,
    stick_speed,
)
from ringsweep.physics.friction.registry import Dynamic, Traits
from ringsweep.physics.friction.velocity import BAND, KINETIC
from ringsweep.quantities.parameters import Leaf, Parameter


class Dahl(NamedTuple):
    """Dahl's bristles: :math:`\\dot z = v - \\sigma_0 |v| z/\\mu_k` and the traction :math:`\\sigma_0 z` (Dahl 1968).

    Coulomb friction with presliding. The contact counts as slipping if the traction exceeds :math:`0.999 \\mu_k`.
    """

    sigma0: Annotated[Leaf, SIGMA_0]


@bristle.implements(Dahl)
def _dahl_bristle(law, mu_s, mu_k, v, z, sign, region):
    """Implement :func:`bristle`."""
    pull = law.sigma0 / mu_k * sign
    rate_v = 1.0 - pull * z
    rate_z = -pull * v
    return v * rate_v, rate_v, rate_z, law.sigma0 * z, 0.0, law.sigma0


@region_guard.implements(Dahl)
def _dahl_region_guard(law, mu_s, mu_k, v, z, sign, region):
    """Implement :func:`region_guard`: the load of the bristles nears, or leaves, that of steady sliding."""
    slack = NEARLY - law.sigma0 / mu_k * sign * z
    return slack if region == BAND else -slack


@steady_deflection.implements(Dahl)
def _dahl_steady_deflection(law, mu_s, mu_k, v):
    """Implement :func:`steady_deflection`."""
    return (1.0 if v > 0.0 else -1.0 if v < 0.0 else 0.0) * mu_k / law.sigma0


@absorbed
def stribeck(law, mu_s, mu_k, v):
    """LuGre's g(v), the friction coefficient of steady sliding without its viscous part; 1.

    Returns
    -------
    tuple of float
        g, 1, and its slope dg/dv, s/m.
    """
    x = v * (1.0 / law.v_s)
    square = x * x
    tail = select(square < 700.0, decay(min(square, 700.0)), 0.0)
    return mu_k + (mu_s - mu_k) * tail, -2.0 * x * (1.0 / law.v_s) * (mu_s - mu_k) * tail


@absorbed
def viscoelastic(law, v, z, rate, rate_v, rate_z):
    """Result of :func:`bristle` for bristles with damping and viscous friction.

    Parameters
    ----------
    law : NamedTuple
        Law with the fields ``sigma0``, ``sigma1``, ``sigma2``.
    v, z : float
        Sliding velocity, m/s, and deflection, m.
    rate, rate_v, rate_z : float
        dz/dt, m/s, and its derivatives by `v`, 1, and by `z`, 1/s.
    """
    return (
        rate,
        rate_v,
        rate_z,
        law.sigma0 * z + law.sigma1 * rate + law.sigma2 * v,
        law.sigma1 * rate_v + law.sigma2,
        law.sigma0 + law.sigma1 * rate_z,
    )


class LuGre(NamedTuple):
    """LuGre bristles with a Stribeck curve (Canudas de Wit et al., IEEE Trans. Autom. Control 40, 1995).

    The paper's Eqs. 11-13:

    .. math::

        \\dot z = v - \\frac{\\sigma_0 |v|}{g(v)} z, \\qquad g = \\mu_k + (\\mu_s - \\mu_k) e^{-(v/v_s)^2}, \\qquad
        \\mu = \\sigma_0 z + \\sigma_1 \\dot z + \\sigma_2 v

    The contact counts as stuck while it is slower than the Stribeck velocity and its deflection is less than 0.999 of
    the deflection :math:`g/\\sigma_0` of steady sliding.
    """

    sigma0: Annotated[Leaf, SIGMA_0]
    v_s: Annotated[Leaf, V_S]
    sigma1: Annotated[Leaf, SIGMA_1]
    sigma2: Annotated[Leaf, SIGMA_2]


@bristle.implements(LuGre)
def _lugre_bristle(law, mu_s, mu_k, v, z, sign, region):
    """Implement :func:`bristle`."""
    g, slope = stribeck(law, mu_s, mu_k, v)
    share, per_g = law.sigma0 * sign * z / g, 1.0 / g
    rate_v = 1.0 - share + v * share * slope * per_g
    return viscoelastic(law, v, z, v * (1.0 - share), rate_v, -law.sigma0 * sign * v * per_g)


class ElastoPlastic(NamedTuple):
    """LuGre bristles with an elastic range (Dupont et al., IEEE Trans. Autom. Control 47, 2002).

    .. math:: \\dot z = v \\left(1 - a(z, v)\\, \\frac{\\sigma_0 \\operatorname{sgn}(v)\\, z}{g(v)}\\right)

    Here a = 0 while the bristles are unloaded, or deflected by less than ``elastic_fraction`` times
    :math:`\\mu_k/\\sigma_0`; a = 1 from the steady deflection :math:`g/\\sigma_0` on; between these deflections a is
    half a period of a sine. In the elastic range a contact does not drift under an oscillating load.
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
def _elasto_plastic_bristle(law, mu_s, mu_k, v, z, sign, region):
    """Implement :func:`bristle`."""
    g, slope = stribeck(law, mu_s, mu_k, v)
    load, elastic, per_g = law.sigma0 * sign * z, law.elastic_fraction * mu_k, 1.0 / g
    # Shares of load and deflection, and their derivatives by the load and by g.
    plastic, by_load, by_g = select(load >= g, 1.0, 0.0), 0.0 * g, 0.0 * g
    partly = (load > elastic) & (load < g)
    if any_of(partly):
        per_width = 1.0 / (g - elastic)
        place = (load - elastic) * per_width
        # In the other lanes the angle may be large.
        sine, cosine = sine_cosine(pi * (min(max(place, 0.0), 1.0) - 0.5))
        plastic = select(partly, 0.5 + 0.5 * sine, plastic)
        by_load = select(partly, 0.5 * pi * cosine * per_width, by_load)
        by_g = -by_load * place
    share = plastic * load * per_g
    rate_v = 1.0 - share - v * slope * (by_g - plastic * per_g) * load * per_g
    rate_z = -law.sigma0 * sign * v * (plastic + by_load * load) * per_g
    return viscoelastic(law, v, z, v * (1.0 - share), rate_v, rate_z)


@region_guard.implements(LuGre, ElastoPlastic)
def _stribeck_region_guard(law, mu_s, mu_k, v, z, sign, region):
    """Implement :func:`region_guard`: load below that of steady sliding, and speed below v_s."""
    g, _ = stribeck(law, mu_s, mu_k, v)
    slack = min(NEARLY - law.sigma0 * sign * (1.0 / g) * z, 1.0 - sign * v * (1.0 / law.v_s))
    return slack if region == BAND else -slack


@steady_deflection.implements(LuGre, ElastoPlastic)
def _stribeck_steady_deflection(law, mu_s, mu_k, v):
    """Implement :func:`steady_deflection`."""
    g, _ = stribeck(law, mu_s, mu_k, v)
    return (1.0 if v > 0.0 else -1.0 if v < 0.0 else 0.0) * g / law.sigma0


@stick_speed.implements(LuGre, ElastoPlastic)
def _stribeck_stick_speed(law, recoil):
    """Implement :func:`stick_speed`: v_s, or the speed of the recoil if it is less."""
    return min(law.v_s, recoil)


# Sliding speeds, in units of the Stribeck velocity: where friction is level; and the least at the end of a step that
# begins there. The bend must not lie in the last part of a step, where few stages of the method see it.
_LEVEL, _LEAST_FROM_LEVEL = 3.0, 2.0


@part_before_bend.implements(LuGre)
@inlined
def _part_before_stribeck_speed(law, mu_s, mu_k, v, z, sign, v_next, z_next):
    """Implement :func:`part_before_bend`: friction rises towards the Stribeck velocity."""
    speed, speed_next, part = abs(v), abs(v_next), 1.0
    if speed > _LEVEL * law.v_s and speed_next < _LEAST_FROM_LEVEL * law.v_s:
        part = (speed - 0.5 * (_LEVEL + _LEAST_FROM_LEVEL) * law.v_s) / (speed - speed_next)
    return part


# How near to its elastic limit a step leaves a bristle, as a share of the distance to steady sliding.
_AT_LIMIT = 1e-3


@part_before_bend.implements(ElastoPlastic)
def _part_before_elastic_limit(law, mu_s, mu_k, v, z, sign, v_next, z_next):
    """Implement :func:`part_before_bend`: bristles that leave the elastic range begin to slide, and friction falls."""
    part = _part_before_stribeck_speed(law, mu_s, mu_k, v, z, sign, v_next, z_next)
    load, load_next, elastic = law.sigma0 * sign * z, law.sigma0 * sign * z_next, law.elastic_fraction * mu_k
    near = _AT_LIMIT * (mu_k - elastic)
    if load < elastic - near and load_next > elastic + near:
        part = min(part, (elastic - load) / (load_next - load))
    return part


class ResetIntegrator(NamedTuple):
    """Reset integrator (Haessig and Friedland, J. Dyn. Syst. Meas. Control 113, 1991).

    In stick :math:`\\dot z = v`, with the traction :math:`\\sigma_0 z + \\sigma_1 v`. Slip begins at
    :math:`|z| = \\mu_s/\\sigma_0`. Then z stays constant, with the traction :math:`\\mu_k`, until the sliding velocity
    reverses.
    """

    sigma0: Annotated[Leaf, SIGMA_0]
    sigma1: Annotated[Leaf, SIGMA_1]


@bristle.implements(ResetIntegrator)
def _reset_integrator_bristle(law, mu_s, mu_k, v, z, sign, region):
    """Implement :func:`bristle`: elastic in the band, constant friction mu_k beyond."""
    sticks = 1.0 if region == BAND else 0.0
    traction = sticks * (law.sigma0 * z + law.sigma1 * v) + (1.0 - sticks) * sign * mu_k
    return sticks * v, sticks, 0.0, traction, sticks * law.sigma1, sticks * law.sigma0


@region_guard.implements(ResetIntegrator)
def _reset_integrator_region_guard(law, mu_s, mu_k, v, z, sign, region):
    """Implement :func:`region_guard`: in BAND what friction lacks to mu_s; constant in KINETIC, which a rest ends."""
    sticks = 1.0 if region == BAND else 0.0
    return sticks * (mu_s - law.sigma0 * sign * z) + (1.0 - sticks)


@after_yield.implements(ResetIntegrator)
def _reset_integrator_after_yield(law, mu_s, mu_k, z, sign, region):
    """Implement :func:`after_yield`: the deflection keeps its largest value."""
    return sign * mu_s / law.sigma0, KINETIC


#: Number of bonds of a contact of :class:`Bristles`; its authors recommend 20 to 25.
BONDS = 20

# Park and Miller's random generator: its numbers are exact in double precision.
_MULTIPLIER, _MODULUS = 16807.0, 2147483647.0


class Bristles(NamedTuple):
    """Twenty bonds that snap and form anew at random (Haessig and Friedland 1991).

    Each bond is a spring that snaps at the deflection :math:`\\delta`. Then a new bond forms with a random deflection,
    uniformly distributed between :math:`-\\delta/2` and :math:`\\delta/2`. The traction is :math:`\\sigma_0` times the
    mean deflection. Its mean in steady sliding, :math:`\\tfrac{11}{24} \\sigma_0 \\delta`, is set equal to
    :math:`\\mu_k`. The contact counts as slipping once 20 bonds have snapped in one direction.

    ``bonds``, of shape ``(cells, 22)``, is the memory of each cell: the deflections of the bonds minus their mean; the
    state of the random generator; the number of bonds that have snapped in one direction, negative for backwards.
    """

    sigma0: Annotated[Leaf, SIGMA_0]
    seed: Annotated[
        Leaf, Parameter("1", "seed of the random bonds", lower=0.0, upper=2.0**31 - 4.0, default=0.0, whole=True)
    ]
    bonds: Any = None

    @classmethod
    def of(cls, sigma0: Any, seed: Any) -> Bristles:
        """Law with memory for the bonds of every cell."""
        return cls(sigma0, seed, bonds=np.zeros((*np.shape(sigma0), BONDS + 2)))


@inlined
def _snapping(law, mu_k):
    """Deflection at which a bond snaps, delta, m."""
    return 24.0 / 11.0 * mu_k / law.sigma0


@inlined
def _new_bond(law, mu_k):
    """Random deflection of a new bond, m; changes the state of the random generator."""
    law.bonds[BONDS] = (_MULTIPLIER * law.bonds[BONDS]) % _MODULUS
    return (law.bonds[BONDS] / _MODULUS - 0.5) * _snapping(law, mu_k)


@bristle.implements(Bristles)
def _bonds_bristle(law, mu_s, mu_k, v, z, sign, region):
    """Implement :func:`bristle`: all bonds stretch together."""
    return v, 1.0, 0.0, law.sigma0 * z, 0.0, law.sigma0


@region_guard.implements(Bristles)
def _bonds_region_guard(law, mu_s, mu_k, v, z, sign, region):
    """Implement :func:`region_guard`: what the longest bond lacks until it snaps, as a share of that length."""
    longest = sign * law.bonds[0]
    for i in range(1, BONDS):
        longest = max(longest, sign * law.bonds[i])
    return 1.0 - (sign * z + longest) / _snapping(law, mu_k)


@after_yield.implements(Bristles)
def _bonds_after_yield(law, mu_s, mu_k, z, sign, region):
    """Implement :func:`after_yield`: the longest bond forms anew; snaps in a row decide stick or slip."""
    bonds = law.bonds
    longest = 0
    for i in range(1, BONDS):
        if sign * bonds[i] > sign * bonds[longest]:
            longest = i
    # Deflections are stored minus their mean, which is the state z.
    bonds[longest] = _new_bond(law, mu_k) - z
    mean = 0.0
    for i in range(BONDS):
        mean += bonds[i] / BONDS
    for i in range(BONDS):
        bonds[i] -= mean
    bonds[BONDS + 1] = sign + (bonds[BONDS + 1] if sign * bonds[BONDS + 1] > 0.0 else 0.0)
    return z + mean, KINETIC if region == KINETIC or abs(bonds[BONDS + 1]) >= BONDS else BAND


@initial_deflection.implements(Bristles)
def _bonds_initial_deflection(law, mu_s, mu_k):
    """Implement :func:`initial_deflection`: seed the random numbers and form all bonds, with mean zero."""
    law.bonds[BONDS] = 1.0 + (48271.0 * (law.seed + 1.0)) % (_MODULUS - 1.0)
    law.bonds[BONDS + 1] = 0.0
    mean = 0.0
    for i in range(BONDS):
        law.bonds[i] = _new_bond(law, mu_k)
        mean += law.bonds[i] / BONDS
    for i in range(BONDS):
        law.bonds[i] -= mean
    return 0.0


_DAHL = "P. R. Dahl, AIAA Journal 14, 1675-1682 (1976), doi:10.2514/3.61511"
_DE_WIT = "C. Canudas de Wit et al., IEEE Transactions on Automatic Control 40, 419-425 (1995), doi:10.1109/9.376053"
_DUPONT = "P. Dupont et al., IEEE Transactions on Automatic Control 47, 787-792 (2002), doi:10.1109/TAC.2002.1000274"
_HAESSIG = "D. A. Haessig, B. Friedland, Journal of Dynamic Systems, Measurement, and Control 113, 354-362 (1991)"

#: Laws by the name that the configuration gives them.
LAWS = {
    "dahl": (Dahl, Traits(Dynamic, coefficients=("mu_k",), source=_DAHL)),
    "lugre": (LuGre, Traits(Dynamic, source=_DE_WIT)),
    "elasto-plastic": (ElastoPlastic, Traits(Dynamic, source=_DUPONT)),
    "reset-integrator": (ResetIntegrator, Traits(Dynamic, source=_HAESSIG)),
    "bristle": (Bristles, Traits(Dynamic, coefficients=("mu_k",), snaps=True, source=_HAESSIG)),
}
