"""The belt: a mass on a spring, dragged by a moving belt through dry friction (the paper's Fig. 1).

.. math:: m \\ddot x = -k x - k_3 x^3 - c \\dot x + P(t) - F, \\qquad v = \\dot x - v_b , \\qquad N = m g + k_n x + L(t)

F is the friction force at the sliding velocity v: the friction coefficient, or the traction of bristles, times N, and
viscous friction. A belt may lack the cubic part :math:`k_3 x^3` of the spring, the damper c, the normal stiffness
:math:`k_n`, the load L and the force P.

The body is kinematically one on a ring of radius 1 with one contact: the functions of :mod:`ringsweep.physics.ring`
are those of its balances, with x, the given force and the velocity in place of sine, cosine and angular velocity.
"""

from __future__ import annotations

from typing import Any, NamedTuple

from ringsweep.compile import absorbed, feature, replacing
from ringsweep.physics import drives
from ringsweep.physics.bodies import LINE
from ringsweep.physics.forces import Laden
from ringsweep.physics.ring import body
from ringsweep.quantities.parameters import Leaf

#: Symbols of the parts that a body may lack. The force is the sum of the external and of the viscous force.
OPTIONAL = "cubic", "damping", "normal_stiffness", "load", "force"


@body(
    balances=(
        "0 = N1 - mass*gravity - normal_stiffness*x - load",
        "mass*x_dd = -stiffness*x - cubic*x**3 - damping*velocity + force + K1*N1",
    ),
    energy="0.5*mass*velocity**2 + 0.5*stiffness*x**2 + 0.25*cubic*x**4",
    coordinate=LINE,
    optional=OPTIONAL,
    varying=("load",),
)
class OnBelt(NamedTuple):
    """Body, spring and damper.

    Attributes
    ----------
    mass : float
        Mass of the body, kg.
    gravity : float
        Acceleration of gravity, m/s^2.
    stiffness, cubic : float
        Stiffness of the spring, N/m, and its cubic stiffness, N/m^3.
    damping : float
        Coefficient of the damper between the body and the wall, N s/m.
    normal_stiffness : float
        Growth of the normal reaction with the displacement, N/m.
    load : float
        Load at an instant, N; see :func:`laden`. In a cell the largest magnitude.
    constants : tuple of float
        See :func:`ringsweep.physics.ring.completed`.
    """

    mass: Leaf
    gravity: Leaf
    stiffness: Leaf
    cubic: Leaf
    damping: Leaf
    normal_stiffness: Leaf
    load: Leaf
    constants: tuple[Leaf, ...] = ()


class Excited(NamedTuple):
    """Scenes in which drive or force may vary in time."""


class Belt(NamedTuple):
    """Belt, body, friction law and drive of a cell.

    The angle and the angular velocity of the drive are here the displacement, m, and the velocity, m/s, of the belt.

    Attributes
    ----------
    body : NamedTuple
        :class:`OnBelt`, or a type that lacks some of its parts.
    mu_s, mu_k : float or TwoWay
        Static and kinetic friction coefficient, 1; see :mod:`ringsweep.physics.friction.ways`. On a belt with zones
        the largest and the least one, or those of the place where a function says so.
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
        Period that drive and force have in common, s; infinite without one.
    cycle : float
        Duration of a cycle, s: that period; a natural period if drive or force vary without one. Infinite in a free
        motion, whose turns end its cycles.
    place_counts : float
        1 if a force depends on the displacement, else 0: without a spring all places are alike.
    excited : Excited
        An empty tuple if neither drive nor force can vary in time.
    asked : NamedTuple
        What the record is asked for beyond the outcomes; an empty tuple for nothing.
    section : NamedTuple
        Which states of the run are kept; an empty tuple for none.
    initial_z : float
        Deflection of the bristles at t = 0, m; an empty tuple without bristles.
    stops : Stops
        An empty tuple without stops.
    surface : Segments
        Zones of the belt, or in space; an empty tuple without zones.
    """

    body: Any
    mu_s: Any
    mu_k: Any
    viscous: Leaf
    law: Any
    drive: Any
    initial_x: Leaf
    initial_v: Leaf
    span: Leaf
    forcing_period: Leaf
    cycle: Leaf
    place_counts: Leaf
    excited: Any = ()
    asked: Any = ()
    section: Any = ()
    initial_z: Any = ()
    stops: Any = ()
    surface: Any = ()


_with_body, _with_load = replacing("body"), replacing("load")


@absorbed
def with_load(scene, load):
    """Scene whose body carries a load of so many N besides its weight."""
    return _with_body(scene, _with_load(scene.body, load))


@feature("scene", of=Laden, absorb=True)
def laden(drive, scene, forcing):
    """Scene whose body carries the load of an instant, if the scene has a load that varies in time.

    `forcing` is what :func:`ringsweep.physics.drives.turn` or :func:`ringsweep.physics.drives.lookup` returned for the
    `drive` of the scene.
    """
    return with_load(scene, forcing[-2])


@feature("scene", of=Laden)
def laden_at(drive, scene, t):
    """Scene whose body carries the load of a time; see :func:`laden`."""
    return with_load(scene, drives.turn(drive, t)[-2])


class BristleBelt(Belt):
    """Belt with a friction law of bristles: their deflection is a third state variable. It has no viscous friction."""


class Stops(NamedTuple):
    """End stops at rest in space.

    Attributes
    ----------
    low, high : float
        Places of the stops, m; beyond all places if there is none.
    restitution : float
        Coefficient of restitution, 1.
    """

    low: Leaf
    high: Leaf
    restitution: Leaf
