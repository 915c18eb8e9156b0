"""The belt: a mass on a spring, dragged by a moving belt through dry friction (the paper's Fig. 1).

.. math:: m \\ddot x = -k x - F(v), \\qquad v = \\dot x - v_b , \\qquad F_N = m g
"""

from __future__ import annotations

from typing import Any, NamedTuple

from ringsweep.parameters import Leaf


class Belt(NamedTuple):
    """A belt with mass, spring, friction law and drive: all that a kernel needs of a cell.

    The drive's angle and its rate are here the belt's displacement (m) and velocity (m/s).
    """

    mass: Leaf
    stiffness: Leaf
    gravity: Leaf
    mu_s: Leaf
    mu_k: Leaf
    law: Any
    drive: Any
    initial_x: Leaf
    initial_velocity: Leaf
    span: Leaf
