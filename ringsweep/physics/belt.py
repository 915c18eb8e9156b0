"""The belt: a mass on a spring, dragged by a moving belt through dry friction (the paper's Fig. 1).

.. math:: m \\ddot x = -k x - k_3 x^3 - c \\dot x + P(t) - F, \\qquad v = \\dot x - v_b , \\qquad F_N = m g

F is the friction force at the sliding velocity v, or the traction of bristles times :math:`F_N`. A belt may lack the
cubic part :math:`k_3 x^3` of the spring, the damper c and the force P.
"""

from __future__ import annotations

from typing import Any, NamedTuple

from ringsweep.quantities.parameters import Leaf


class Absent(NamedTuple):
    """A part that a belt lacks."""


class Cubic(NamedTuple):
    """The cubic part of the spring: the restoring force is :math:`k x + k_3 x^3`."""

    stiffness: Leaf


class Damper(NamedTuple):
    """A damper between the body and the wall."""

    coefficient: Leaf


class Belt(NamedTuple):
    """Belt, body, spring, friction law and drive of a cell.

    The angle and the angular velocity of the drive are here the displacement, m, and the velocity, m/s, of the belt.

    Attributes
    ----------
    mass : float
        Mass of the body, kg.
    stiffness : float
        Stiffness of the spring, N/m.
    cubic : Cubic or Absent
        Cubic part of the spring; its stiffness is in N/m^3.
    damper : Damper or Absent
        Damper between the body and the wall; its coefficient is in N s/m.
    gravity : float
        Acceleration of gravity, m/s^2.
    mu_s, mu_k : float
        Static and kinetic friction coefficient, 1.
    viscous : float
        Coefficient of viscous friction, N s/m.
    law, drive : NamedTuple
        Friction law, and drive of the belt; :class:`ringsweep.physics.forces.Forced` if a force acts on the body too.
    initial_x : float
        Displacement of the body at t = 0, m.
    initial_v : float
        Velocity of the body relative to the belt at t = 0, m/s.
    span : float
        Span of time, s.
    forcing_period : float
        Period of the forcing, s; infinite without a period.
    """

    mass: Leaf
    stiffness: Leaf
    cubic: Any
    damper: Any
    gravity: Leaf
    mu_s: Leaf
    mu_k: Leaf
    viscous: Leaf
    law: Any
    drive: Any
    initial_x: Leaf
    initial_v: Leaf
    span: Leaf
    forcing_period: Leaf


class BristleBelt(NamedTuple):
    """Belt with a friction law of bristles: their deflection is a third state variable. Fields as for :class:`Belt`."""

    mass: Leaf
    stiffness: Leaf
    cubic: Any
    damper: Any
    gravity: Leaf
    mu_s: Leaf
    mu_k: Leaf
    law: Any
    drive: Any
    initial_x: Leaf
    initial_v: Leaf
    span: Leaf
    forcing_period: Leaf
