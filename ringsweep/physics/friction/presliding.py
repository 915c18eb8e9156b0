"""Hooks of friction laws with bristles: rate of the deflection, traction, and transitions between stick and slip.

Stiffness and damping are per unit of the normal load: 1/m and s/m. The traction is the force per unit of the load,
:math:`\\mu = \\sigma_0 z + \\sigma_1 \\dot z + \\sigma_2 v`, where z is the mean deflection of the bristles.

Models call :func:`bristle` in each stage of a step, :func:`region_guard` in each step, and the others at events or at
launch.
"""

from __future__ import annotations

from math import sqrt

from ringsweep.compile import hook
from ringsweep.physics.friction.velocity import BAND, KINETIC
from ringsweep.quantities.parameters import Parameter

MU_K = Parameter("1", "kinetic friction coefficient", lower=0.0, open_lower=True)

#: A contact counts as slipping if its deflection exceeds this share of the deflection of steady sliding.
NEARLY = 0.999

SIGMA_0 = Parameter("1/m", "stiffness of the bristles", lower=0.0, open_lower=True)
SIGMA_1 = Parameter("s/m", "damping of the bristles", lower=0.0, default=0.0)
SIGMA_2 = Parameter("s/m", "viscous friction", lower=0.0, default=0.0)
V_S = Parameter("m/s", "Stribeck velocity", lower=0.0, open_lower=True)


@hook(absorb=True)
def bristle(law, mu_s, mu_k, v, z, sign, region):
    """Rate of the deflection, and traction, with their partial derivatives by `v` and `z`.

    Under ``rk4`` the numbers are vector lanes, so bodies have no ``if`` that depends on them; `region` is an int.

    For LuGre bristles (the paper's Eqs. 11-13) with the steady friction g(v),

    .. math:: \\dot z = v - \\frac{\\sigma_0 |v|}{g(v)} z, \\quad \\mu = \\sigma_0 z + \\sigma_1 \\dot z + \\sigma_2 v .

    Parameters
    ----------
    law : NamedTuple
        Friction law with bristles.
    mu_s, mu_k : float
        Static and kinetic coefficient of the surface under the contact, 1; equal if the law has no static coefficient.
    v, z : float
        Sliding velocity, m/s, and deflection, m.
    sign : float
        Sign of the sliding velocity, +1 or -1. Write ``sign * v`` for \\|v\\|: then the formulas are smooth through
        zero.
    region : int
        BAND if the contact counts as stuck, KINETIC if it slips.

    Returns
    -------
    tuple of float
        Rate dz/dt, m/s; its derivatives by `v`, 1, and by `z`, 1/s; traction, 1; its derivatives by `v`, s/m, and by
        `z`, 1/m.
    """


@hook(absorb=True)
def region_guard(law, mu_s, mu_k, v, z, sign, region):
    """Guard of a region: positive while the contact stays in it, zero where it leaves it.

    Parameters
    ----------
    law, mu_s, mu_k, v, z, sign, region
        As for :func:`bristle`.

    Returns
    -------
    float
        Guard, 1.
    """


@hook(optional=True)
def after_yield(law, mu_s, mu_k, z, sign, region):
    """Deflection and region after :func:`region_guard` has reached zero.

    Parameters
    ----------
    law, mu_s, mu_k, z, sign, region
        As for :func:`bristle`; `z` and `region` are those before the change.

    Returns
    -------
    tuple
        ``(z, region)``: deflection, m; and BAND or KINETIC. By default the same deflection and the other region.
    """
    return z, KINETIC if region == BAND else BAND


@hook(optional=True)
def stick_speed(law, recoil):
    """Sliding speed below which a contact counts as stuck, m/s.

    The belt needs it to tell stick from a harmonic motion that touches zero sliding velocity without sticking.

    Parameters
    ----------
    law : NamedTuple
    recoil : float
        Speed that bristles at their largest deflection give to the body when they relax, m/s.

    Returns
    -------
    float
        A characteristic speed of the law that is smaller than `recoil`, m/s; by default `recoil`.
    """
    return recoil


@hook(optional=True)
def part_before_bend(law, mu_s, mu_k, v, z, sign, v_next, z_next):
    """Part of a step at which it should end: 1, or less if friction bends in a way that the step would not see.

    Parameters
    ----------
    law, mu_s, mu_k, v, z, sign
        As for :func:`bristle`, at the beginning of the step.
    v_next, z_next : float
        Sliding velocity, m/s, and deflection, m, at its end.
    """
    return 1.0


@hook(optional=True)
def initial_deflection(law, mu_s, mu_k):
    """Deflection at the launch, m; by default 0. A law with memory of its own sets it here.

    Parameters
    ----------
    law : NamedTuple
    mu_s, mu_k : float
        As for :func:`bristle`.
    """
    return 0.0


@hook(absorb=True, optional=True)
def scales(law, mu_s, gravity, z):
    """Units of errors: play of the contact, m; of the state z; speed, m/s; friction coefficient, 1.

    By default both lengths are the deflection that carries the static friction, and the speed is that of a body which
    these bristles drive back.

    Parameters
    ----------
    law : NamedTuple
    mu_s : float
        Static coefficient, 1.
    gravity : float
        Normal load per unit of the mass, m/s^2.
    z : float
        State.
    """
    deflection = mu_s / law.sigma0
    return deflection, deflection, mu_s * sqrt(gravity / law.sigma0), mu_s


@hook(optional=True)
def shown(law, z):
    """State as users see it, in the unit of the history variable that is named in the traits; by default z, m."""
    return z


@hook
def steady_deflection(law, mu_s, mu_k, v):
    """Deflection in steady sliding at the velocity `v`, m; zero at rest. Only the ring needs it.

    It solves dz/dt = 0: :math:`z = \\operatorname{sgn}(v)\\, g(v)/\\sigma_0` for LuGre bristles.

    Parameters
    ----------
    law : NamedTuple
    mu_s, mu_k : float
        As for :func:`bristle`.
    v : float
        Sliding velocity, m/s.
    """


#: Functions that every law with bristles must have.
MEMBERS = (bristle, region_guard)
