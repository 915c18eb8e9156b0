"""Rate-and-state laws: static friction that ages. The state variable is the age of the contacts, as a logarithm.

The friction coefficient of both laws is

.. math:: \\mu = a \\operatorname{arsinh}\\left(\\frac{v}{2 V_0} \\exp\\frac{\\mu_0 + b \\psi}{a}\\right), \\qquad
    \\psi = \\ln\\frac{V_0 \\theta}{D_c},

which is :math:`\\mu_0 + a \\ln(v/V_0) + b \\psi` but for the regularisation at rest (Rice and Ben-Zion 1996). Ages
:math:`\\theta` span twenty decades; :math:`\\psi` takes the place of the deflection z of bristles. In steady sliding
:math:`\\theta = D_c/|v|`.
"""

from __future__ import annotations

from math import exp
from typing import Annotated, NamedTuple

from ringsweep.compile import absorbed
from ringsweep.numerics.functions import exponential, logarithm, select, square_root
from ringsweep.physics.friction.presliding import (
    bristle,
    region_guard,
    scales,
    shown,
    steady_deflection,
    stick_speed,
)
from ringsweep.physics.friction.registry import Dynamic, Traits
from ringsweep.physics.friction.velocity import BAND
from ringsweep.quantities.parameters import Leaf, Parameter

_A = Annotated[Leaf, Parameter("1", "direct effect: growth of friction with ln(v)", lower=0.0, open_lower=True)]
_B = Annotated[Leaf, Parameter("1", "growth of friction with the logarithm of the age of the contacts", lower=0.0)]
_D_C = Annotated[Leaf, Parameter("m", "slip that renews the contacts, D_c", lower=0.0, open_lower=True)]
_V_0 = Annotated[Leaf, Parameter("m/s", "speed of steady sliding with mu0, V_0", lower=0.0, open_lower=True)]

# Speeds below this share of the reference velocity count as this share in logarithms.
_LEAST = 1e-290


class Dieterich(NamedTuple):
    """Contacts that age at rest too: :math:`\\dot\\theta = 1 - |v| \\theta/D_c` (Dieterich 1979, Ruina 1983)."""

    a: _A
    b: _B
    critical_distance: _D_C
    reference_velocity: _V_0


class Ruina(Dieterich):
    """Contacts that age in slip: :math:`\\dot\\theta = -(|v|\\theta/D_c) \\ln(|v|\\theta/D_c)` (Ruina 1983).

    The parameters are those of :class:`Dieterich`.
    """


@absorbed
def _speed(law, v):
    """Sliding speed in units of the reference velocity, not zero."""
    return max(abs(v) / law.reference_velocity, _LEAST)


@absorbed
def _traction(law, mu_0, v, z):
    """Friction coefficient, 1, and its derivatives by the velocity, s/m, and by the state, 1."""
    sign, speed = select(v >= 0.0, 1.0, -1.0), _speed(law, v)
    # The argument of arsinh is e^x, which may be too large for a number: arsinh(e^x) = x + arsinh(e^-x), roughly.
    x = logarithm(0.5 * speed) + (mu_0 + law.b * z) / law.a
    small = exponential(-abs(x))
    root, top = square_root(1.0 + small * small), select(x > 0.0, 1.0, small)
    direct = law.a * top / root
    by_v = direct / (speed * law.reference_velocity)
    return sign * law.a * (max(x, 0.0) + logarithm(top + root)), by_v, sign * law.b * top / root


@bristle.implements(Dieterich)
def _dieterich_bristle(law, mu_s, mu_k, v, z, sign, region):
    """Implement :func:`bristle`."""
    per_length = 1.0 / law.critical_distance
    ages = law.reference_velocity * per_length * exponential(-z)
    return ages - sign * v * per_length, -sign * per_length, -ages, *_traction(law, mu_s, v, z)


@bristle.implements(Ruina)
def _ruina_bristle(law, mu_s, mu_k, v, z, sign, region):
    """Implement :func:`bristle`."""
    per_length = 1.0 / law.critical_distance
    renewal, excess = sign * v * per_length, logarithm(_speed(law, v)) + z
    return -renewal * excess, -sign * per_length * (excess + 1.0), -renewal, *_traction(law, mu_s, v, z)


@region_guard.implements(Dieterich, Ruina)
def _rate_and_state_region_guard(law, mu_s, mu_k, v, z, sign, region):
    """Implement :func:`region_guard`: the contact is stuck at less than half the speed of steady sliding, D_c/theta."""
    share = 2.0 * max(sign * v, 0.0) / law.reference_velocity * exponential(z)
    slack = (1.0 - share) / (1.0 + share)
    return slack if region == BAND else -slack


@steady_deflection.implements(Dieterich, Ruina)
def _steady_state(law, mu_s, mu_k, v):
    """Implement :func:`steady_deflection`."""
    return -logarithm(_speed(law, v))


@scales.implements(Dieterich, Ruina)
def _rate_and_state_scales(law, mu_s, gravity, z):
    """Implement :func:`scales`: D_c, a factor of e in the age, the speed that keeps this age, and the direct effect.

    An error of friction that is not small beside `a` would be a factor of the speed.
    """
    return law.critical_distance, 1.0, law.reference_velocity * exp(-z), law.a


@shown.implements(Dieterich, Ruina)
def _age(law, z):
    """Implement :func:`shown`: age of the contacts, s."""
    return law.critical_distance / law.reference_velocity * exponential(z)


@stick_speed.implements(Dieterich, Ruina)
def _rate_and_state_stick_speed(law, recoil):
    """Implement :func:`stick_speed`: there is no speed below which a contact is stuck at any age."""
    return 0.0


_RUINA = "A. Ruina, Journal of Geophysical Research 88, 10359-10370 (1983), doi:10.1029/JB088iB12p10359"

_DIETERICH = "J. H. Dieterich, Journal of Geophysical Research 84, 2161-2168 (1979), doi:10.1029/JB084iB05p02161"

#: Laws by the name that the configuration gives them.
LAWS = {
    "dieterich": (Dieterich, Traits(Dynamic, coefficients=("mu0",), state="contact_age", source=_DIETERICH)),
    "ruina": (Ruina, Traits(Dynamic, coefficients=("mu0",), state="contact_age", source=_RUINA)),
}
