"""The ring: a body that slides on the inner race of a rotating ring, on two contacts or on one.

Symbols: phi is the angle of the centre of mass from the downward vertical, omega its rate, theta the angle of the ring,
beta half the angle between the contacts, xi the distance of the centre of mass from the axis. K_i is the friction along
the race at contact i per unit of its normal reaction N_i: ``K_i = -mu_i(|v|) sgn v`` with
``v = (omega - dtheta/dt) R`` at both contacts.

Balance of momentum, radial and tangential, and of moment of momentum about the axis (the paper's Eqs. 14-32):

.. math::

    -M \\xi \\omega^2 &= M g \\cos\\varphi - (N_1 + N_2) \\cos\\beta + (K_1 N_1 - K_2 N_2) \\sin\\beta \\\\
    M \\xi \\ddot\\varphi &= -M g \\sin\\varphi + (N_1 - N_2) \\sin\\beta + (K_1 N_1 + K_2 N_2) \\cos\\beta \\\\
    (J + M \\xi^2) \\ddot\\varphi &= -M g \\xi \\sin\\varphi + R (K_1 N_1 + K_2 N_2)

With ``S = K1 + K2``, ``Delta = K1 - K2`` and ``P = K1 K2`` the first two give the paper's Eq. 17 with the
determinant :math:`D = D_0 + D_1 \\Delta + D_2 P`, and all three give

.. math::

    \\ddot\\varphi = \\frac{(m_0 + m_1 \\Delta + m_2 P) \\sin\\varphi + (l_0 \\cos\\varphi + l_1 \\omega^2) S}
        {i_0 + i_1 \\Delta + i_2 P} ,

with the coefficients of :class:`TwoContacts`. The denominator is the determinant of the three balances as equations for
the angular acceleration and both reactions. A body that slides on both contacts jams where it falls to 0 (Painleve):
with ``q = R - xi cos(beta)`` the accelerations of the gaps are ``A N + b``,

.. math::

    A_{11} = \\frac1M + \\frac{\\xi \\sin\\beta\\,(\\xi \\sin\\beta - K_1 q)}{J}, \\qquad
    A_{12} = \\frac{\\cos 2\\beta + K_2 \\sin 2\\beta}{M} - \\frac{\\xi \\sin\\beta\\,(\\xi \\sin\\beta + K_2 q)}{J},

``A_22`` and ``A_21`` follow with ``-K_2`` in place of ``K_1`` and ``-K_1`` in place of ``K_2``. ``M^2 J det A`` is the
determinant of the balances times ``sin(2 beta)``.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from ringsweep.compile import absorbed, hook, inlined
from ringsweep.numerics.functions import opposing
from ringsweep.physics import drives
from ringsweep.physics.friction.velocity import friction_at
from ringsweep.physics.zones import PER_TURN, roughness
from ringsweep.quantities.parameters import Leaf


class TwoContacts(NamedTuple):
    """Two balls joined by a rod (the paper's Fig. 22).

    Attributes
    ----------
    mass, inertia : float
        Mass M, kg, and moment of inertia J about the centre of mass, kg m^2.
    radius, xi : float
        Radius R of the race, and distance of the centre of mass from the axis, m.
    beta, sin_beta, cos_beta : float
        Half the angle between the contacts, rad; its sine and cosine.
    gravity : float
        Acceleration of gravity, m/s^2.
    determinant, weight, lift : tuple of float
        Coefficients of the acceleration, see the head of this module: (i_0, i_1, i_2), kg m^2; (m_0, m_1, m_2), N m;
        (l_0, l_1), N m and kg m^2.
    reaction : tuple of float
        Coefficients of the reactions, see :func:`reactions`: kg^2 m^2, 1, m/s^2.
    """

    mass: Leaf
    inertia: Leaf
    radius: Leaf
    xi: Leaf
    beta: Leaf
    sin_beta: Leaf
    cos_beta: Leaf
    gravity: Leaf
    determinant: tuple[Leaf, Leaf, Leaf]
    weight: tuple[Leaf, Leaf, Leaf]
    lift: tuple[Leaf, Leaf]
    reaction: tuple[Leaf, Leaf, Leaf]

    @classmethod
    def of(
        cls, mass: Any, inertia: Any, radius: Any, xi: Any, sin_beta: Any, cos_beta: Any, gravity: Any
    ) -> TwoContacts:
        """Body with the coefficients of its acceleration and reactions computed."""
        # Coefficients of the determinant of the radial and the tangential balance, which the paper calls D.
        D = 2.0 * sin_beta * cos_beta, cos_beta * cos_beta - sin_beta * sin_beta, 2.0 * sin_beta * cos_beta
        # Coefficients of the tangential balance after the moment about the axis is eliminated.
        T = 0.0, cos_beta, 2.0 * sin_beta
        about_axis = inertia + mass * xi * xi
        lever, arm = radius * mass, mass * xi
        determinant = [about_axis * d - lever * xi * t for d, t in zip(D, T, strict=True)]
        weight = [gravity * (lever * t - arm * d) for d, t in zip(D, T, strict=True)]
        return cls(
            mass,
            inertia,
            radius,
            xi,
            np.arcsin(sin_beta),
            sin_beta,
            cos_beta,
            gravity,
            (determinant[0], determinant[1], determinant[2]),
            (weight[0], weight[1], weight[2]),
            (lever * gravity * sin_beta, lever * xi * sin_beta),
            (mass * about_axis, cos_beta - lever * xi / about_axis, gravity * inertia / about_axis),
        )


class OneContact(NamedTuple):
    """A small body on one contact (the paper's Fig. 13): mass, kg; radius of the race, m; gravity, m/s^2."""

    mass: Leaf
    radius: Leaf
    gravity: Leaf


class Ring(NamedTuple):
    """Ring, body, surface, friction law and drive of a cell.

    Attributes
    ----------
    body : NamedTuple
        :class:`TwoContacts`, :class:`OneContact`, or a type with bodies for the hooks of this module.
    surface : Uniform or Segments
        Friction coefficients along the race, see :mod:`ringsweep.physics.zones`.
    law, drive : NamedTuple
        Friction law and drive.
    initial_phi, initial_omega : float
        Angle, rad, and angular velocity, rad/s, of the body in space at t = 0.
    span : float
        Span of time, s.
    epsilon_omega : float
        Angular velocity beyond which a change of its sign counts as a reversal, rad/s.
    """

    body: Any
    surface: Any
    law: Any
    drive: Any
    initial_phi: Leaf
    initial_omega: Leaf
    span: Leaf
    epsilon_omega: Leaf


class BristleRing(Ring):
    """Ring with a friction law of bristles: their deflections, one at each contact, are state variables."""


@inlined
def launch_velocity(scene):
    """Angular velocity of the body relative to the ring at t = 0, rad/s."""
    return drives.relative_velocity(scene.drive, scene.initial_omega)


# An angular velocity that is smaller than this share of its terms is zero but for rounding.
_ROUNDING = 1e-15


@inlined
def angular_velocity(body, v, ring_omega):
    """Angular velocity of the body in space, rad/s; exactly 0 if it is only rounding: then the race carries no load.

    Parameters
    ----------
    body : NamedTuple
    v : float
        Sliding velocity, m/s.
    ring_omega : float
        Angular velocity of the ring, rad/s.
    """
    relative = v / body.radius
    omega = relative + ring_omega
    return 0.0 if abs(omega) < _ROUNDING * (abs(relative) + abs(ring_omega)) else omega


@hook(optional=True)
def contact_offset(body):
    """Half the angle between the contacts, rad. Contact 1 is at ``phi - offset``, contact 2 at ``phi + offset``.

    By default 0, for bodies with one contact.
    """
    return 0.0


@contact_offset.implements(TwoContacts)
def _two_offset(body):
    return body.beta


@hook(optional=True)
def free_determinant(body):
    """Determinant of the balances without friction, kg m^2. By default 1, for bodies that cannot jam."""
    return 1.0


@free_determinant.implements(TwoContacts)
def _two_free_determinant(body):
    return body.determinant[0]


@hook(absorb=True)
def acceleration(body, K1, K2, sin_phi, cos_phi, omega):
    """Angular acceleration of the body in slip, and the determinant that tells whether the body jams.

    Bodies get vector lanes, so they are written without ``if``. Apart from :func:`constant_terms`, the acceleration is
    linear in ``sin_phi``, ``cos_phi`` and ``omega**2``.

    Parameters
    ----------
    body : NamedTuple
    K1, K2 : float or Lanes
        Friction per unit of the normal reaction at each contact, 1; positive in the direction of growing phi.
    sin_phi, cos_phi : float or Lanes
        Sine and cosine of the angle of the body.
    omega : float or Lanes
        Angular velocity of the body, rad/s.

    Returns
    -------
    tuple of float or Lanes
        ``(phi_dd, determinant)``: angular acceleration, rad/s^2; determinant of the balances, kg m^2. The body jams if
        it is not positive. A body that cannot jam returns 1.
    """


@inlined
def _combine(coefficients, delta, P):
    """Value of ``c_0 + c_1 Delta + c_2 P``."""
    c_0, c_1, c_2 = coefficients
    return c_0 + c_1 * delta + c_2 * P


@acceleration.implements(TwoContacts)
def _two_acceleration(body, K1, K2, sin_phi, cos_phi, omega):
    delta, P = K1 - K2, K1 * K2
    l_0, l_1 = body.lift
    determinant = _combine(body.determinant, delta, P)
    moment = _combine(body.weight, delta, P) * sin_phi + (l_0 * cos_phi + l_1 * (omega * omega)) * (K1 + K2)
    return moment * (1.0 / determinant), determinant


@acceleration.implements(OneContact)
def _one_acceleration(body, K1, K2, sin_phi, cos_phi, omega):
    b = body
    phi_dd = -b.gravity / b.radius * sin_phi + K1 * (b.gravity / b.radius * cos_phi + omega * omega)
    return phi_dd, 1.0


@hook(optional=True)
def constant_terms(body, K1, K2):
    """Terms of the angular acceleration and of the reactions that do not depend on the state.

    The other terms are proportional to ``sin_phi``, ``cos_phi`` or ``omega**2``. By default they are found as what is
    left
    where these three are 0.

    Parameters
    ----------
    body, K1, K2
        As for :func:`acceleration`.

    Returns
    -------
    tuple of float
        Constant terms of the angular acceleration, rad/s^2, and of both normal reactions, N.
    """
    phi_dd, _ = acceleration(body, K1, K2, 0.0, 0.0, 0.0)
    normal_1, normal_2 = reactions(body, K1, K2, 0.0, 0.0, 0.0)
    return phi_dd, normal_1, normal_2


@constant_terms.implements(TwoContacts, OneContact)
def _no_constant_terms(body, K1, K2):
    return 0.0, 0.0, 0.0


@hook(optional=True)
def contact_count(body):
    """Number of contacts of a body; by default 1."""
    return 1


@contact_count.implements(TwoContacts)
def _two_contacts(body):
    return 2


@hook(absorb=True)
def acceleration_slope(body, K1, K2, slope_1, slope_2, sin_phi, cos_phi, omega):
    """Derivative of the angular acceleration by way of friction: d phi_dd/dK1 slope_1 + d phi_dd/dK2 slope_2.

    Parameters
    ----------
    slope_1, slope_2 : float or Lanes
        Derivatives of K1 and K2, for example by the angular velocity, s.
    body, K1, K2, sin_phi, cos_phi, omega
        As for :func:`acceleration`.

    Returns
    -------
    float or Lanes
        In rad/s^2 times the unit of the slopes.
    """


@acceleration_slope.implements(TwoContacts)
def _two_slope(body, K1, K2, slope_1, slope_2, sin_phi, cos_phi, omega):
    delta, P = K1 - K2, K1 * K2
    d_delta, d_P = slope_1 - slope_2, slope_1 * K2 + K1 * slope_2
    _, i_1, i_2 = body.determinant
    _, m_1, m_2 = body.weight
    l_0, l_1 = body.lift
    lift = l_0 * cos_phi + l_1 * (omega * omega)
    determinant = _combine(body.determinant, delta, P)
    moment = _combine(body.weight, delta, P) * sin_phi + lift * (K1 + K2)
    d_moment = (m_1 * d_delta + m_2 * d_P) * sin_phi + lift * (slope_1 + slope_2)
    per_determinant = 1.0 / determinant
    return (d_moment - moment * per_determinant * (i_1 * d_delta + i_2 * d_P)) * per_determinant


@acceleration_slope.implements(OneContact)
def _one_slope(body, K1, K2, slope_1, slope_2, sin_phi, cos_phi, omega):
    return slope_1 * (body.gravity / body.radius * cos_phi + omega * omega)


@hook(absorb=True)
def acceleration_gradient(body, K1, K2, sin_phi, cos_phi, omega):
    """Derivatives of the angular acceleration by angle and by angular velocity, at constant K1 and K2.

    Parameters
    ----------
    body, K1, K2, sin_phi, cos_phi, omega
        As for :func:`acceleration`.

    Returns
    -------
    tuple of float or Lanes
        ``(d phi_dd/dphi, d phi_dd/domega)``, 1/s^2 and 1/s.
    """


@acceleration_gradient.implements(TwoContacts)
def _two_gradient(body, K1, K2, sin_phi, cos_phi, omega):
    delta, P = K1 - K2, K1 * K2
    l_0, l_1 = body.lift
    per_determinant = 1.0 / _combine(body.determinant, delta, P)
    by_phi = _combine(body.weight, delta, P) * cos_phi - l_0 * sin_phi * (K1 + K2)
    return by_phi * per_determinant, 2.0 * omega * l_1 * (K1 + K2) * per_determinant


@acceleration_gradient.implements(OneContact)
def _one_gradient(body, K1, K2, sin_phi, cos_phi, omega):
    return -body.gravity / body.radius * (cos_phi + K1 * sin_phi), 2.0 * omega * K1


@hook(absorb=True)
def friction_gain(body, cos_phi, omega):
    """Derivative of the angular acceleration by K, with the same K at all contacts, at K = 0.

    Parameters
    ----------
    body, cos_phi, omega
        As for :func:`acceleration`.

    Returns
    -------
    float or Lanes
        Derivative, rad/s^2.
    """


@friction_gain.implements(TwoContacts)
def _two_friction_gain(body, cos_phi, omega):
    l_0, l_1 = body.lift
    return (l_0 * cos_phi + l_1 * (omega * omega)) * (2.0 / body.determinant[0])


@friction_gain.implements(OneContact)
def _one_friction_gain(body, cos_phi, omega):
    return body.gravity / body.radius * cos_phi + omega * omega


@hook(optional=True)
def reaction_determinant(body):
    """Determinant D of the reactions without friction, 1. Errors of friction grow in the reactions by 1/D.

    By default 1.
    """
    return 1.0


@reaction_determinant.implements(TwoContacts)
def _two_reaction_determinant(body):
    return 2.0 * body.sin_beta * body.cos_beta


@hook(absorb=True)
def reactions(body, K1, K2, sin_phi, cos_phi, omega):
    """Normal reactions in slip: the paper's Eq. 17 with the angular acceleration eliminated.

    Eq. 17 divides by D. Where D vanishes and the determinant of the balances does not, the reactions are finite.

    Parameters
    ----------
    body, K1, K2, sin_phi, cos_phi, omega
        As for :func:`acceleration`.

    Returns
    -------
    tuple of float or Lanes
        ``(N1, N2)``, N, positive in compression. With one contact N2 repeats N1.
    """


@reactions.implements(TwoContacts)
def _two_reactions(body, K1, K2, sin_phi, cos_phi, omega):
    b = body
    scale, lever, pull = b.reaction
    # Weight and inertia per unit of mass, along the race and across it; the moment about the axis is eliminated.
    along = pull * sin_phi
    across = b.gravity * cos_phi + b.xi * (omega * omega)
    load = scale * (1.0 / _combine(b.determinant, K1 - K2, K1 * K2))
    N1 = across * (b.sin_beta - K2 * lever) + along * (b.cos_beta + K2 * b.sin_beta)
    N2 = across * (b.sin_beta + K1 * lever) - along * (b.cos_beta - K1 * b.sin_beta)
    return load * N1, load * N2


@reactions.implements(OneContact)
def _one_reactions(body, K1, K2, sin_phi, cos_phi, omega):
    N = body.mass * (body.gravity * cos_phi + body.radius * omega * omega)
    return N, N


@hook
def energy(body, cos_phi, omega):
    """Kinetic and potential energy of the body, J. Its rate is :func:`friction_power`.

    Parameters
    ----------
    body : NamedTuple
    cos_phi : float
        Cosine of the angle of the body.
    omega : float
        Angular velocity of the body, rad/s.
    """


@energy.implements(TwoContacts)
def _two_energy(body, cos_phi, omega):
    b = body
    return 0.5 * (b.inertia + b.mass * b.xi * b.xi) * omega * omega - b.mass * b.gravity * b.xi * cos_phi


@energy.implements(OneContact)
def _one_energy(body, cos_phi, omega):
    b = body
    return b.mass * b.radius * (0.5 * b.radius * omega * omega - b.gravity * cos_phi)


@hook(optional=True)
def friction_power(body, K1, K2, normal_1, normal_2, omega):
    """Power of friction on the body, W. By default the power of one contact, R omega K1 N1.

    Parameters
    ----------
    body, K1, K2, omega
        As for :func:`acceleration`.
    normal_1, normal_2 : float
        Normal reactions, N.
    """
    return body.radius * omega * K1 * normal_1


@friction_power.implements(TwoContacts)
def _two_power(body, K1, K2, normal_1, normal_2, omega):
    return body.radius * omega * (K1 * normal_1 + K2 * normal_2)


@absorbed
def friction(scene, phi, omega, theta, ring_omega):
    """Sliding velocity, and friction K at each contact with its slope.

    Parameters
    ----------
    scene : Ring
        One cell, or several in vector lanes.
    phi, omega : float or Lanes
        Angle, rad, and angular velocity, rad/s, of the body.
    theta, ring_omega : float
        Angle, rad, and angular velocity, rad/s, of the ring.

    Returns
    -------
    tuple of float or Lanes
        ``(v, K1, K2, dK1/domega, dK2/domega)``; m/s, 1, 1, s, s.
    """
    radius = scene.body.radius
    v = (omega - ring_omega) * radius
    turns, offset = (phi - theta) * PER_TURN, contact_offset(scene.body) * PER_TURN
    mu_s1, mu_k1 = roughness(scene.surface, turns, -offset)
    mu_s2, mu_k2 = roughness(scene.surface, turns, offset)
    mu_1, mu_2, slope_1, slope_2 = friction_at(scene.law, abs(v), (mu_s1, mu_k1, mu_s2, mu_k2))
    return v, opposing(mu_1, v), opposing(mu_2, v), -slope_1 * radius, -slope_2 * radius


@hook
def tractions(body, sin_phi, cos_phi, omega, phi_dd, normal_1, normal_2):
    """Friction at the contacts, from the balances and not from a friction law: so in stick too.

    Parameters
    ----------
    body : NamedTuple
    sin_phi, cos_phi : float
        Sine and cosine of the angle of the body.
    omega, phi_dd : float
        Angular velocity, rad/s, and angular acceleration, rad/s^2, of the body.
    normal_1, normal_2 : float
        Normal reactions, N.

    Returns
    -------
    tuple of float
        ``(F1, F2)`` along the race, N, positive in the direction of growing phi. With one contact F2 repeats F1.
    """


@tractions.implements(TwoContacts)
def _two_tractions(body, sin_phi, cos_phi, omega, phi_dd, normal_1, normal_2):
    b = body
    both = ((b.inertia + b.mass * b.xi * b.xi) * phi_dd + b.mass * b.gravity * b.xi * sin_phi) / b.radius
    load = b.mass * (b.gravity * cos_phi + b.xi * omega * omega)
    difference = ((normal_1 + normal_2) * b.cos_beta - load) / b.sin_beta
    return 0.5 * (both + difference), 0.5 * (both - difference)


@tractions.implements(OneContact)
def _one_tractions(body, sin_phi, cos_phi, omega, phi_dd, normal_1, normal_2):
    friction = body.mass * (body.radius * phi_dd + body.gravity * sin_phi)
    return friction, friction


#: Functions of a body that the model of the ring needs, besides those of :mod:`ringsweep.physics.contact`.
BODY_MEMBERS = (
    contact_count,
    contact_offset,
    free_determinant,
    acceleration,
    constant_terms,
    acceleration_slope,
    acceleration_gradient,
    friction_gain,
    reaction_determinant,
    reactions,
    energy,
    friction_power,
    tractions,
)
