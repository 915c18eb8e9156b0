"""Two masses on one belt, coupled by a spring and a damper; each has a spring, a damper and a contact of its own.

Symbols: x_i is the displacement of mass i in space, u_i its velocity, w_i its acceleration relative to the belt, which
has the acceleration a. N_i presses mass i on the belt, and F_i is the friction on it, positive in the direction of
growing x:

.. math::

    m_1 (w_1 + a) = -k_1 x_1 - d_1 u_1 + k_c (x_2 - x_1) + d_c (u_2 - u_1) + F_1, \\qquad N_1 = m_1 g

and the same with 1 and 2 exchanged.
"""

from __future__ import annotations

from typing import Any, NamedTuple

from ringsweep.compile import function_from_lines, generated, inlined
from ringsweep.numerics.systems import System
from ringsweep.quantities.parameters import Leaf


class Pair(NamedTuple):
    """Two masses, their springs and dampers to the wall, and those between them; SI units."""

    mass_1: Leaf
    mass_2: Leaf
    stiffness_1: Leaf
    stiffness_2: Leaf
    damping_1: Leaf
    damping_2: Leaf
    coupling: Leaf
    coupling_damping: Leaf
    gravity: Leaf


class BeltPair(NamedTuple):
    """Two masses on a belt, friction law and drive of a cell.

    Attributes
    ----------
    body : Pair
    first, second : Belt
        Each mass on the belt if the other one followed it on its spring: for the scales of its motion, and its record.
    law, drive : NamedTuple
        Friction law, and drive of the belt.
    span : float
        Span of time, s.
    """

    body: Pair
    first: Any
    second: Any
    law: Any
    drive: Any
    span: Leaf


def _balances(i: int, j: int) -> tuple[str, str]:
    """Balances of mass `i`, along the belt and across it; `j` is the other one."""
    along = (
        f"mass_{i}*(w_{i} + a) = -stiffness_{i}*x_{i} - damping_{i}*u_{i}"
        f" + coupling*(x_{j} - x_{i}) + coupling_damping*(u_{j} - u_{i}) + F_{i}"
    )
    return along, f"N_{i} = mass_{i}*gravity"


#: What the balances have of the motion. `motion` is a tuple in this order.
MOTION = "x_1", "u_1", "x_2", "u_2", "a"

_SYSTEM = System(Pair._fields, MOTION, (*_balances(1, 2), *_balances(2, 1)))

#: For each kind of mode, whether the first and the second mass stick.
KINDS = (False, False), (True, False), (False, True), (True, True)


def solution(kind: int) -> Any:
    """Function ``(body, one, friction, motion)`` that solves the balances in a kind of mode, see :class:`System`."""
    return inlined(function_from_lines("body, one, friction, motion", _SYSTEM.solution(KINDS[kind]), {}))


@generated
def solved(body, kind, friction, motion):
    """Accelerations relative to the belt, m/s^2, reactions and friction, N: three tuples, one number for each mass.

    Parameters
    ----------
    body : Pair
    kind : int
        Index in KINDS.
    friction : tuple of float
        K of each mass: the friction on it per unit of its reaction, if it slips.
    motion : tuple of float
    """
    scope = {f"solved_{kind}": solution(kind) for kind in range(len(KINDS))}
    lines = [f"if kind == {kind}:\n        return solved_{kind}(body, 1.0, friction, motion)" for kind in range(1, 4)]
    return [*lines, "return solved_0(body, 1.0, friction, motion)"], scope


@generated
def imbalance(body, motion, w, N, F):
    """Largest error of the balances as they are written down, as a share of the sizes of their terms."""
    return _SYSTEM.imbalance(), {}


@inlined
def energy(body, motion):
    """Kinetic and potential energy, J."""
    x_1, u_1, x_2, u_2, _ = motion
    kinetic = body.mass_1 * u_1 * u_1 + body.mass_2 * u_2 * u_2
    potential = body.stiffness_1 * x_1 * x_1 + body.stiffness_2 * x_2 * x_2
    return 0.5 * (kinetic + potential + body.coupling * (x_1 - x_2) * (x_1 - x_2))


@inlined
def power(body, motion, F):
    """Power of friction and dampers, W."""
    _, u_1, _, u_2, _ = motion
    damped = body.damping_1 * u_1 * u_1 + body.damping_2 * u_2 * u_2 + body.coupling_damping * (u_1 - u_2) * (u_1 - u_2)
    return F[0] * u_1 + F[1] * u_2 - damped
