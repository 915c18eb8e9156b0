"""The belt: a mass on a spring, dragged by a moving belt through dry friction (the paper's Fig. 1).

.. math:: m \\ddot x = -k x - F, \\qquad v = \\dot x - v_b , \\qquad F_N = m g

F is the friction force at the sliding velocity v, or the traction of bristles times :math:`F_N`.
"""

from __future__ import annotations

from typing import Any, NamedTuple

from ringsweep.quantities.parameters import Leaf


class Belt(NamedTuple):
    """A belt with mass, spring, friction law and drive: all that a kernel needs of a cell.

    The drive's angle and its rate are here the belt's displacement (m) and velocity (m/s).
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


class BristleBelt(NamedTuple):
    """The same with a friction law that has bristles: their deflection is a third state."""

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
