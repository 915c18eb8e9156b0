"""The ring: a body that slides on the inner race of a rotating ring, on two contacts or on one.

Symbols: phi angle of the centre of mass from the downward vertical, omega its rate, theta angle
of the ring, beta half the angle that the contacts subtend, xi distance of the centre of mass from
the axis, K_i the friction along the race at contact i per unit of its normal reaction N_i:
``K_i = -mu_i(|v|) sgn v`` with ``v = (omega - dtheta/dt) R`` at both contacts.

Balance of momentum, radial and tangential, and of moment of momentum about the axis:

.. math::

    -M \\xi \\omega^2 &= M g \\cos\\varphi - (N_1 + N_2) \\cos\\beta + (K_1 N_1 - K_2 N_2) \\sin\\beta \\\\
    M \\xi \\ddot\\varphi &= -M g \\sin\\varphi + (N_1 - N_2) \\sin\\beta + (K_1 N_1 + K_2 N_2) \\cos\\beta \\\\
    (J + M \\xi^2) \\ddot\\varphi &= -M g \\xi \\sin\\varphi + R (K_1 N_1 + K_2 N_2)

With ``S = K1 + K2``, ``T = (K1 - K2) cos beta + 2 K1 K2 sin beta`` and
``D = (K1 - K2) cos 2 beta + (1 + K1 K2) sin 2 beta`` the first two give the paper's Eq. 17 and all
three give

.. math::

    \\ddot\\varphi = \\frac{-M g \\xi \\sin\\varphi\\, D
        + R M [g \\sin\\varphi\\, T + (g \\cos\\varphi + \\xi \\omega^2) \\sin\\beta\\, S]}
        {(J + M \\xi^2) D - R M \\xi T} .

The denominator is D times the effective inertia; where D or it is not positive no motion of a
rigid body exists or it is not unique (jamming, Painleve).
"""

from __future__ import annotations

from typing import Any, NamedTuple

from ringsweep.jit import hook, inlined
from ringsweep.parameters import Leaf
from ringsweep.physics.friction.static import weights
from ringsweep.physics.zones import coefficients, segment


class TwoContacts(NamedTuple):
    """Two balls joined by a rod (the paper's Fig. 22)."""

    mass: Leaf
    inertia: Leaf
    radius: Leaf
    xi: Leaf
    beta: Leaf
    sin_beta: Leaf
    cos_beta: Leaf
    gravity: Leaf


class OneContact(NamedTuple):
    """A small body on one contact (the paper's Fig. 13)."""

    mass: Leaf
    radius: Leaf
    gravity: Leaf


class Ring(NamedTuple):
    """A ring with body, surface, friction law and drive: all that a kernel needs of a cell."""

    body: Any
    surface: Any
    law: Any
    drive: Any
    initial_phi: Leaf
    initial_omega: Leaf
    span: Leaf
    epsilon_omega: Leaf


class BristleRing(Ring):
    """The same with a friction law that has bristles: their deflections are states, one at each contact."""


@hook
def contact_offset(body):
    """Half the angle between the contacts, rad; contact 1 is at ``phi - offset``, 2 at ``phi + offset``."""


@contact_offset.implements(TwoContacts)
def _two_offset(body):
    return body.beta


@contact_offset.implements(OneContact)
def _one_offset(body):
    return 0.0


@hook
def about_axis(body):
    """What the effective inertia is measured by: the moment of inertia about the axis, kg m^2."""


@about_axis.implements(TwoContacts)
def _two_about_axis(body):
    return body.inertia + body.mass * body.xi * body.xi


@about_axis.implements(OneContact)
def _one_about_axis(body):
    return 1.0


@hook
def acceleration(body, K1, K2, sin_phi, cos_phi, omega):
    """Angular acceleration, and what tells whether it exists.

    Returns
    -------
    tuple of float
        ``(phi_dd, D, inertia)``: rad/s^2; the determinant of the reactions; D times the effective
        inertia, kg m^2. The motion is jammed where either of the last two is not positive.
    """


@acceleration.implements(TwoContacts)
def _two_acceleration(body, K1, K2, sin_phi, cos_phi, omega):
    b = body
    P = K1 * K2
    sin_2beta = 2.0 * b.sin_beta * b.cos_beta
    cos_2beta = b.cos_beta * b.cos_beta - b.sin_beta * b.sin_beta
    D = (K1 - K2) * cos_2beta + (1.0 + P) * sin_2beta
    T = (K1 - K2) * b.cos_beta + 2.0 * P * b.sin_beta
    lift = (b.gravity * cos_phi + b.xi * omega * omega) * b.sin_beta
    RM = b.radius * b.mass
    inertia = (b.inertia + b.mass * b.xi * b.xi) * D - RM * b.xi * T
    moment = b.gravity * sin_phi * (RM * T - b.mass * b.xi * D) + RM * lift * (K1 + K2)
    return moment / inertia, D, inertia


@acceleration.implements(OneContact)
def _one_acceleration(body, K1, K2, sin_phi, cos_phi, omega):
    b = body
    phi_dd = -b.gravity / b.radius * sin_phi + K1 * (b.gravity / b.radius * cos_phi + omega * omega)
    return phi_dd, 1.0, 1.0


@hook
def acceleration_slope(body, K1, K2, slope_1, slope_2, sin_phi, cos_phi, omega):
    """Derivative of the angular acceleration along ``(dK1, dK2) = (slope_1, slope_2)``."""


@acceleration_slope.implements(TwoContacts)
def _two_slope(body, K1, K2, slope_1, slope_2, sin_phi, cos_phi, omega):
    b = body
    P = K1 * K2
    dP = slope_1 * K2 + K1 * slope_2
    sin_2beta = 2.0 * b.sin_beta * b.cos_beta
    cos_2beta = b.cos_beta * b.cos_beta - b.sin_beta * b.sin_beta
    D = (K1 - K2) * cos_2beta + (1.0 + P) * sin_2beta
    dD = (slope_1 - slope_2) * cos_2beta + dP * sin_2beta
    T = (K1 - K2) * b.cos_beta + 2.0 * P * b.sin_beta
    dT = (slope_1 - slope_2) * b.cos_beta + 2.0 * dP * b.sin_beta
    lift = (b.gravity * cos_phi + b.xi * omega * omega) * b.sin_beta
    RM = b.radius * b.mass
    about_axis = b.inertia + b.mass * b.xi * b.xi
    weight = b.gravity * sin_phi
    inertia = about_axis * D - RM * b.xi * T
    d_inertia = about_axis * dD - RM * b.xi * dT
    moment = weight * (RM * T - b.mass * b.xi * D) + RM * lift * (K1 + K2)
    d_moment = weight * (RM * dT - b.mass * b.xi * dD) + RM * lift * (slope_1 + slope_2)
    return (d_moment - moment / inertia * d_inertia) / inertia


@acceleration_slope.implements(OneContact)
def _one_slope(body, K1, K2, slope_1, slope_2, sin_phi, cos_phi, omega):
    return slope_1 * (body.gravity / body.radius * cos_phi + omega * omega)


@hook
def acceleration_gradient(body, K1, K2, sin_phi, cos_phi, omega):
    """Derivatives of the angular acceleration by angle and by angular velocity, friction K held; 1/s^2 and 1/s."""


@acceleration_gradient.implements(TwoContacts)
def _two_gradient(body, K1, K2, sin_phi, cos_phi, omega):
    b = body
    P = K1 * K2
    D = (K1 - K2) * (b.cos_beta * b.cos_beta - b.sin_beta * b.sin_beta) + (1.0 + P) * 2.0 * b.sin_beta * b.cos_beta
    T = (K1 - K2) * b.cos_beta + 2.0 * P * b.sin_beta
    RM = b.radius * b.mass
    scale = 1.0 / ((b.inertia + b.mass * b.xi * b.xi) * D - RM * b.xi * T)
    lift = RM * b.sin_beta * (K1 + K2)
    by_phi = b.gravity * (cos_phi * (RM * T - b.mass * b.xi * D) - sin_phi * lift)
    return by_phi * scale, 2.0 * omega * b.xi * lift * scale


@acceleration_gradient.implements(OneContact)
def _one_gradient(body, K1, K2, sin_phi, cos_phi, omega):
    return -body.gravity / body.radius * (cos_phi + K1 * sin_phi), 2.0 * omega * K1


@hook
def reactions(body, K1, K2, sin_phi, cos_phi, omega, phi_dd):
    """Normal reactions ``(N1, N2)``, N (the paper's Eq. 17); with one contact N2 repeats N1."""


@reactions.implements(TwoContacts)
def _two_reactions(body, K1, K2, sin_phi, cos_phi, omega, phi_dd):
    b = body
    sb, cb = b.sin_beta, b.cos_beta
    sin_plus, cos_plus = sin_phi * cb + cos_phi * sb, cos_phi * cb - sin_phi * sb
    sin_minus, cos_minus = sin_phi * cb - cos_phi * sb, cos_phi * cb + sin_phi * sb
    D = (K1 - K2) * (cb * cb - sb * sb) + (1.0 + K1 * K2) * 2.0 * sb * cb
    centripetal = b.xi * omega * omega
    inertial = b.xi * phi_dd
    N1 = (
        b.gravity * sin_plus
        + centripetal * sb
        + inertial * cb
        - K2 * (b.gravity * cos_plus + centripetal * cb - inertial * sb)
    )
    N2 = (
        centripetal * sb
        - b.gravity * sin_minus
        - inertial * cb
        + K1 * (b.gravity * cos_minus + centripetal * cb + inertial * sb)
    )
    return b.mass * N1 / D, b.mass * N2 / D


@reactions.implements(OneContact)
def _one_reactions(body, K1, K2, sin_phi, cos_phi, omega, phi_dd):
    N = body.mass * (body.gravity * cos_phi + body.radius * omega * omega)
    return N, N


@inlined
def friction(scene, phi, omega, theta, ring_omega):
    """Sliding velocity, K at each contact and its slope.

    Parameters
    ----------
    scene : Ring
        One cell.
    phi, omega, theta, ring_omega : float
        Angle and angular velocity of the body and of the ring, rad and rad/s.

    Returns
    -------
    tuple of float
        ``(v, K1, K2, dK1/domega, dK2/domega)``; m/s, 1, 1, s, s.
    """
    radius = scene.body.radius
    v = (omega - ring_omega) * radius
    sign = 1.0 if v > 0.0 else -1.0 if v < 0.0 else 0.0
    offset = contact_offset(scene.body)
    w_s, w_k, dw_s, dw_k = weights(scene.law, abs(v))
    rho = phi - theta
    mu_s, mu_k, _ = coefficients(scene.surface, segment(scene.surface, rho - offset))
    K1, slope_1 = -(w_s * mu_s + w_k * mu_k) * sign, -(dw_s * mu_s + dw_k * mu_k) * radius
    mu_s, mu_k, _ = coefficients(scene.surface, segment(scene.surface, rho + offset))
    K2, slope_2 = -(w_s * mu_s + w_k * mu_k) * sign, -(dw_s * mu_s + dw_k * mu_k) * radius
    return v, K1, K2, slope_1, slope_2
