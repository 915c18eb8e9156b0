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

They are equations for the angular acceleration and both reactions. Where their determinant falls to 0, a body that
slides on both contacts jams (Painleve): with ``q = R - xi cos(beta)`` the accelerations of the gaps are ``A N + b``,

.. math::

    A_{11} = \\frac1M + \\frac{\\xi \\sin\\beta\\,(\\xi \\sin\\beta - K_1 q)}{J}, \\qquad
    A_{12} = \\frac{\\cos 2\\beta + K_2 \\sin 2\\beta}{M} - \\frac{\\xi \\sin\\beta\\,(\\xi \\sin\\beta + K_2 q)}{J},

``A_22`` and ``A_21`` follow with ``-K_2`` in place of ``K_1`` and ``-K_1`` in place of ``K_2``. ``M^2 J det A`` is the
determinant of the balances times ``sin(2 beta)``.

A body is declared by :func:`body`. All that the solvers need of it follows from its balances; see
:mod:`ringsweep.physics.bodies`.
"""

from __future__ import annotations

import inspect
import sys
from collections.abc import Callable, Collection, Sequence
from functools import cache, partial
from itertools import combinations
from typing import Any, NamedTuple

from ringsweep.compile import absorbed, function_from_lines, hook, inlined
from ringsweep.physics import drives
from ringsweep.physics.bodies import ANGLE, Coordinate, Equations
from ringsweep.physics.zones import PER_TURN, roughness
from ringsweep.quantities.parameters import Leaf


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
    forcing_period : float
        Period of the drive, s; infinite without a period. An empty tuple unless something is asked for.
    long_run : NamedTuple
        That the record tells what the motion settles to; an empty tuple if it does not.
    asked, section : NamedTuple
        As in :class:`ringsweep.physics.belt.Belt`.
    """

    body: Any
    surface: Any
    law: Any
    drive: Any
    initial_phi: Leaf
    initial_omega: Leaf
    span: Leaf
    epsilon_omega: Leaf
    forcing_period: Any = ()
    long_run: Any = ()
    asked: Any = ()
    section: Any = ()


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


@hook
def contact_offset(body):
    """Half the angle between the contacts, rad. Contact 1 is at ``phi - offset``, contact 2 at ``phi + offset``."""


@hook
def radius(body):
    """Velocity of the body at its contacts per unit of the rate of its coordinate: the radius of the race, m."""


@hook
def free_determinant(body):
    """Determinant of the balances without friction, kg m^2. 1 for bodies that cannot jam."""


@hook(absorb=True)
def acceleration(body, K1, K2, motion):
    """Angular acceleration of the body in slip, and the determinant that tells whether the body jams.

    Parameters
    ----------
    body : NamedTuple
    K1, K2 : float or Lanes
        Friction per unit of the normal reaction at each contact, 1; positive in the direction of growing phi.
    motion : tuple of float or Lanes
        Sine and cosine of the angle of the body, and its angular velocity, rad/s.

    Returns
    -------
    tuple of float or Lanes
        ``(phi_dd, determinant)``: angular acceleration, rad/s^2; determinant of the balances, kg m^2. The body jams if
        it is not positive. A body that cannot jam returns 1.
    """


@hook
def contact_count(body):
    """Number of contacts of a body, 1 or 2."""


@hook(absorb=True)
def acceleration_slope(body, K1, K2, slope_1, slope_2, motion):
    """Derivative of the angular acceleration by way of friction: d phi_dd/dK1 slope_1 + d phi_dd/dK2 slope_2.

    Parameters
    ----------
    slope_1, slope_2 : float or Lanes
        Derivatives of K1 and K2, for example by the angular velocity, s.
    body, K1, K2, motion
        As for :func:`acceleration`.

    Returns
    -------
    float or Lanes
        In rad/s^2 times the unit of the slopes.
    """


@hook(absorb=True)
def acceleration_gradient(body, K1, K2, motion):
    """Derivatives of the angular acceleration by angle and by angular velocity, at constant K1 and K2.

    Parameters
    ----------
    body, K1, K2, motion
        As for :func:`acceleration`.

    Returns
    -------
    tuple of float or Lanes
        ``(d phi_dd/dphi, d phi_dd/domega)``, 1/s^2 and 1/s; and on a belt the derivative by the force, 1/kg.
    """


@hook(absorb=True)
def friction_gain(body, motion):
    """Derivative of the angular acceleration by K, with the same K at all contacts, at K = 0.

    Parameters
    ----------
    body, motion
        As for :func:`acceleration`.

    Returns
    -------
    float or Lanes
        Derivative, rad/s^2.
    """


@hook
def reaction_determinant(body):
    """Determinant D of the reactions without friction, 1. Errors of friction grow in the reactions by 1/D.

    It is that of all balances but the last, as equations for the reactions.
    """


@hook(absorb=True)
def reactions(body, K1, K2, motion):
    """Normal reactions in slip: the paper's Eq. 17 with the angular acceleration eliminated.

    Eq. 17 divides by D. Where D vanishes and the determinant of the balances does not, the reactions are finite.

    Parameters
    ----------
    body, K1, K2, motion
        As for :func:`acceleration`.

    Returns
    -------
    tuple of float or Lanes
        ``(N1, N2)``, N, positive in compression. With one contact N2 repeats N1.
    """


@hook
def slip_balance(body, K1, K2):
    """Solution of the balances in slip, where friction is K_i N_i plus a given force.

    Angular acceleration and reactions are linear in sine and cosine of the angle, in the angular velocity and its
    square, and in the given forces. The series need it because coefficient k of the product of two series K_i and N_i
    is ``K_i[0] N_i[k]`` plus terms that are known.

    Parameters
    ----------
    body, K1, K2
        As for :func:`acceleration`.

    Returns
    -------
    tuple of tuple of float
        Three rows: for the angular acceleration, rad/s^2, and for N_1 and N_2, N. Each row has seven numbers: the
        constant term, and the factors of sine, cosine, angular velocity, its square, and force at contact 1 and 2.
    """


@hook
def determinant_terms(body, one, K1, K2, both):
    """Determinant of the balances as a linear function of 1, K_1, K_2 and K_1 K_2.

    Parameters
    ----------
    body : NamedTuple
    one, K1, K2, both : float
        1, K_1, K_2 and K_1 K_2, or coefficients of their series.

    Returns
    -------
    float
        In the unit of the second result of :func:`acceleration`. It is `one` for bodies that cannot jam.
    """


@hook
def held(body, one, motion, square, epsilon, F2):
    """Forces at the contacts from the balances and not from a friction law: so in stick too.

    They are linear in the arguments after `body`, so that coefficients of series can take their place.

    Parameters
    ----------
    body : NamedTuple
    one : float
        1.
    motion : tuple of float
        As for :func:`acceleration`.
    square : float
        Square of the angular velocity.
    epsilon : float
        Angular acceleration of the body, rad/s^2.
    F2 : float
        Friction at contact 2, N, which the balances do not determine; not used if there is one contact.

    Returns
    -------
    tuple of float
        ``(N1, N2, F1)``: normal reactions, and friction along the race at contact 1, positive in the direction of
        growing phi, N. With one contact N2 repeats N1.
    """


@hook
def driven(body, one, motion, square, F1, F2):
    """Acceleration of the body under given friction forces, rad/s^2, linear in the arguments after `body`.

    Parameters
    ----------
    body, one, motion, square
        As for :func:`held`.
    F1, F2 : float
        Friction along the race, positive in the direction of growing phi, N; on a belt with the force given there.
    """


@hook(absorb=True)
def if_load_varies(body, yes, no):
    """`yes` if a reaction depends on motion or friction, else `no`: then no contact can open."""


@hook
def energy(body, motion):
    """Kinetic and potential energy of the body, J. Its rate is :func:`power`.

    Parameters
    ----------
    body, motion
        As for :func:`acceleration`.
    """


@hook
def power(body, K1, K2, N1, N2, motion):
    """Power of friction, and of other forces that are not in the energy, W: from the last balance.

    Parameters
    ----------
    body, K1, K2, motion
        As for :func:`acceleration`.
    N1, N2 : float
        Normal reactions, N.
    """


@hook
def imbalance(body, K1, K2, N1, N2, phi_dd, motion):
    """Error of the balances as they are written down: sum of its squares, each as a share of those of the terms.

    Parameters
    ----------
    body, K1, K2, motion
        As for :func:`acceleration`.
    N1, N2 : float
        Normal reactions, N.
    phi_dd : float
        Angular acceleration of the body, rad/s^2.
    """


@hook(absorb=True)
def size(body, motion):
    """Sum of the magnitudes of the terms of the last balance without friction and inertia, N m, or N on a belt."""


#: Functions of a body that follow from its declaration: all hooks of this file. `Equations` writes them.
DERIVED = [found for found in vars().values() if hasattr(found, "implements")]

# What makes the equations of each type that :func:`body` declares, once they are needed.
_EQUATIONS: dict[type, Callable[[], Equations]] = {}

_VARIANTS: dict[tuple[type, frozenset[str]], type] = {}


def body(
    *,
    balances: Sequence[str],
    energy: str,
    offset: str = "",
    coordinate: Coordinate = ANGLE,
    optional: tuple[str, ...] = (),
    varying: tuple[str, ...] = (),
) -> Callable[[type], type]:
    """Declare a body: decorator of the ``NamedTuple`` of its parameters.

    The fields ``mass``, ``radius`` and ``gravity`` are needed for scales, and ``constants`` for :func:`completed`.

    Parameters
    ----------
    balances : sequence of str
        Two equations for a body with one contact, three for a body with two; see :mod:`ringsweep.physics.bodies`.
    energy : str
        Kinetic and potential energy, J.
    offset : str
        Field with half the angle between the contacts, rad. By default 0.
    coordinate : Coordinate
        By default the angle of the body. The functions in :data:`DERIVED` are documented for it. With another
        coordinate they take its numbers as `motion`, and its acceleration in place of `phi_dd`.
    optional : tuple of str
        Symbols of parts that a body may lack, see :func:`variant`. Without them their terms cost nothing.
    varying : tuple of str
        Fields that change during a run.

    Raises
    ------
    TypeError
        If the body cannot be declared so; the message says why.
    """

    def declare(cls: Any) -> Any:
        needed = ("mass", "gravity", *({"radius"} if coordinate is ANGLE else ()), "constants")
        if missing := [field for field in needed if field not in getattr(cls, "_fields", ())]:
            raise TypeError(f"{cls.__name__}: a NamedTuple with the field {', '.join(missing)} is needed")
        if isinstance(balances, str):
            raise TypeError(f"{cls.__name__}: balances is one text: give several, with commas between them")
        if offset and offset not in cls._fields:
            raise TypeError(f"{cls.__name__}: offset names the field {offset}, which does not exist")
        try:
            # A mistake is told where it is made.
            whole = Equations(cls._fields, balances, energy, coordinate, offset, (), varying)
        except ValueError as error:
            raise TypeError(f"{cls.__name__}: {error}") from None
        for count in range(len(optional) + 1):
            for absent in combinations(optional, count):
                variant = _VARIANTS[cls, frozenset(absent)] = _without(cls, absent)
                make = partial(Equations, variant._fields, balances, energy, coordinate, offset, absent, varying)
                _EQUATIONS[variant] = cache(make) if absent else lambda: whole
                _complete.pop(variant, None)
        return cls

    return declare


def _without(cls: Any, absent: tuple[str, ...]) -> Any:
    """Type of a body without some fields, under a name of its own in the module of the body."""
    if not absent:
        return cls
    name, fields = "_without_".join((cls.__name__, *absent)), [field for field in cls._fields if field not in absent]
    found: Any = NamedTuple(name, [(field, Any) for field in fields])  # type: ignore[misc]
    found.__doc__, found.__module__ = cls.__doc__, cls.__module__
    setattr(sys.modules[cls.__module__], name, found)
    return found


def equations_of(cls: type) -> Equations:
    """Equations of a type that :func:`body` declares.

    Raises
    ------
    KeyError
        If it declares no such type.
    """
    return _EQUATIONS[cls]()


# Equations of the types for which the functions in :data:`DERIVED` have bodies.
_complete: dict[type, Equations] = {}


def _derive(cls: type) -> Equations:
    """Give the functions in :data:`DERIVED` bodies for a type, once a scene has it: there are many types of bodies.

    The equations that it returns know all constants of the body.
    """
    if cls in _complete:
        return _complete[cls]
    equations = equations_of(cls)
    own = {"motion": ", ".join(equations.coordinate.motion), ANGLE.acceleration: equations.coordinate.acceleration}
    for function in DERIVED:
        names = list(inspect.signature(function).parameters)
        named = [f"{own[name]} = {name}" for name in names if name in own]
        named += [f"{name} = body.{name}" for name in equations.varying]
        lines = [*named, *equations.lines(function.__name__)]
        function.implements(cls)(function_from_lines(", ".join(names), lines, {}))
    _complete[cls] = equations
    return equations


def variant(cls: type, absent: Collection[str]) -> type:
    """Type of a body that lacks some of its optional parts."""
    return _VARIANTS[cls, frozenset(absent)]


def having(cls: type, part: str) -> list[type]:
    """Types of a body that do not lack an optional part."""
    return [found for (declared, absent), found in _VARIANTS.items() if declared is cls and part not in absent]


def completed(body: Any) -> Any:
    """The body with its constants: numbers that depend on its other fields only.

    Raises
    ------
    ValueError
        If energy and balances contradict each other; the message says where.
    """
    equations = _derive(type(body))
    if problem := equations.contradiction(body):
        raise ValueError(problem)
    return body._replace(constants=equations.constants(body))


@body(
    balances=(
        "-mass*xi*omega**2 = mass*gravity*cos_phi - (N1 + N2)*cos_beta + (K1*N1 - K2*N2)*sin_beta",
        "mass*xi*phi_dd = -mass*gravity*sin_phi + (N1 - N2)*sin_beta + (K1*N1 + K2*N2)*cos_beta",
        "(inertia + mass*xi**2)*phi_dd = -mass*gravity*xi*sin_phi + radius*(K1*N1 + K2*N2)",
    ),
    energy="0.5*(inertia + mass*xi**2)*omega**2 - mass*gravity*xi*cos_phi",
    offset="beta",
)
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
    constants : tuple of float
        See :func:`completed`.
    """

    mass: Leaf
    inertia: Leaf
    radius: Leaf
    xi: Leaf
    beta: Leaf
    sin_beta: Leaf
    cos_beta: Leaf
    gravity: Leaf
    constants: tuple[Leaf, ...] = ()


@body(
    balances=(
        "-mass*radius*omega**2 = mass*gravity*cos_phi - N1",
        "mass*radius*phi_dd = -mass*gravity*sin_phi + K1*N1",
    ),
    energy="mass*radius*(0.5*radius*omega**2 - gravity*cos_phi)",
)
class OneContact(NamedTuple):
    """A small body on one contact (the paper's Fig. 13): mass, kg; radius of the race, m; gravity, m/s^2."""

    mass: Leaf
    radius: Leaf
    gravity: Leaf
    constants: tuple[Leaf, ...] = ()


@absorbed
def coefficients_at(scene, rho):
    """Static and kinetic coefficient under each contact, ``(mu_s1, mu_k1, mu_s2, mu_k2)``.

    Parameters
    ----------
    scene : Ring or BristleRing
        One cell, or several in vector lanes.
    rho : float or Lanes
        Angle of the body in the ring's frame, rad.
    """
    turns, offset = rho * PER_TURN, contact_offset(scene.body) * PER_TURN
    mu_s1, mu_k1 = roughness(scene.surface, turns, -offset)
    mu_s2, mu_k2 = roughness(scene.surface, turns, offset)
    return mu_s1, mu_k1, mu_s2, mu_k2
