"""A friction law with bristles: Dahl's with exponent 2."""

from typing import Annotated, NamedTuple

from ringsweep.physics.friction import Dynamic, Traits, add_law
from ringsweep.physics.friction.presliding import (
    NEARLY,
    SIGMA_0,
    bristle,
    region_guard,
    steady_deflection,
)
from ringsweep.physics.friction.velocity import BAND
from ringsweep.quantities.parameters import Leaf


class Ductile(NamedTuple):
    """Dahl's bristles with exponent 2: dz/dt = v (1 - sigma0 z sgn(v)/mu_k)^2."""

    sigma0: Annotated[Leaf, SIGMA_0]


@bristle.implements(Ductile)
def _bristle(law, mu_s, mu_k, v, z, sign, region):
    share = law.sigma0 / mu_k * sign
    rest = 1.0 - share * z
    return v * rest * rest, rest * rest, -2.0 * share * v * rest, law.sigma0 * z, 0.0, law.sigma0


@region_guard.implements(Ductile)
def _region_guard(law, mu_s, mu_k, v, z, sign, region):
    slack = NEARLY - law.sigma0 / mu_k * sign * z
    return slack if region == BAND else -slack


@steady_deflection.implements(Ductile)
def _steady_deflection(law, mu_s, mu_k, v):
    return (1.0 if v > 0.0 else -1.0 if v < 0.0 else 0.0) * mu_k / law.sigma0


add_law("dahl-ductile", Ductile, Traits(Dynamic, coefficients=("mu_k",)))
