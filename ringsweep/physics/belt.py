"""The belt: a mass on a spring, dragged by a moving belt through dry friction (the paper's Fig. 1).

.. math:: m \\ddot x = -k x - F, \\qquad v = \\dot x - v_b , \\qquad F_N = m g

F is the friction force at the sliding velocity v, or the traction of bristles times :math:`F_N`.
"""

from __future__ import annotations

from typing import Any, NamedTuple

from ringsweep.quantities.parameters import Leaf


class Belt(NamedTuple):
    """Belt, body, spring, friction law and drive of a cell.

    The angle and the angular velocity of the drive are here the displacement, m, and the velocity, m/s, of the belt.

    Attributes
    ----------
    mass : float
        Mass of the body, kg.
    stiffness : float
        Stiffness of the spring, N/m.
    gravity : float
        Acceleration of gravity, m/s^2.
    mu_s, mu_k : float
        Static and kinetic friction coefficient, 1.
    viscous : float
        Coefficient of viscous friction, N s/m.
    law, drive : NamedTuple
        Friction law and drive.
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
    gravity: Leaf
    mu_s: Leaf
    mu_k: Leaf
    law: Any
    drive: Any
    initial_x: Leaf
    initial_v: Leaf
    span: Leaf
    forcing_period: Leaf
