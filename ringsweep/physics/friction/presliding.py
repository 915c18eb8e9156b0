"""What friction laws with bristles offer: rate and traction of the bristles, and what tells stick from slip.

Stiffness and damping are per unit of the normal load: 1/m and s/m. The traction, the force per unit of the load, is
:math:`\\sigma_0 z + \\sigma_1 \\dot z + \\sigma_2 v`, where z is the mean deflection of the bristles.
"""

from __future__ import annotations

from ringsweep.compile import hook
from ringsweep.quantities.parameters import Parameter

MU_K = Parameter("1", "kinetic friction coefficient", lower=0.0, open_lower=True)

#: Share of the deflection of steady sliding from which on a contact counts as slipping.
NEARLY = 0.999

SIGMA_0 = Parameter("1/m", "stiffness of the bristles", lower=0.0, open_lower=True)
SIGMA_1 = Parameter("s/m", "damping of the bristles", lower=0.0, default=0.0)
SIGMA_2 = Parameter("s/m", "viscous friction", lower=0.0, default=0.0)
V_S = Parameter("m/s", "Stribeck velocity", lower=0.0, open_lower=True)


@hook
def bristle(law, mu_s, mu_k, v, z, sign, region):
    """Rate of the deflection and traction, each with its partial derivatives.

    Parameters
    ----------
    law : NamedTuple
        A law of this kind.
    mu_s, mu_k : float
        Static and kinetic coefficient of the surface under the contact.
    v, z : float
        Sliding velocity, m/s, and deflection, m.
    sign : float
        Sign of the sliding velocity, +1 or -1; a formula in \\|v\\| is continued smoothly through zero by it.
    region : int
        BAND where the contact counts as stuck, KINETIC where it slips.

    Returns
    -------
    tuple of float
        ``(rate, by v, by z, traction, by v, by z)``; m/s, 1, 1/s, 1, s/m, 1/m.
    """


@hook
def region_guard(law, mu_s, mu_k, v, z, sign, region):
    """A guard: positive while the region lasts, for the arguments of :func:`bristle`."""


@hook
def after_yield(law, mu_s, mu_k, z, sign, region):
    """Deflection and region after that guard has reached zero, while sliding in the direction `sign`."""


@hook
def stick_speed(law, recoil):
    """Speed by which to tell stick from a graze, m/s, where `recoil` is that of a body let go by its bristles."""


@hook
def initial_deflection(law, mu_s, mu_k):
    """Deflection of a contact that has just been made, m."""


@hook
def steady_deflection(law, mu_s, mu_k, v):
    """Deflection of bristles that have slid at the velocity `v` for long, m; zero at rest."""


MEMBERS = (bristle, region_guard, after_yield, stick_speed, initial_deflection)
