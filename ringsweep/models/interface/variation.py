"""The variational equation along a run, for scenes that ask for an exponent.

A small disturbance w of the state of a mode obeys ``dw/dt = J w``. At an event the modes before and after it have
different rates f, and the disturbed run reaches the guard at another time. There w is multiplied by the saltation
matrix (Leine and Nijmeijer, Dynamics and Bifurcations of Non-Smooth Mechanical Systems, 2004, section 7.3)

.. math:: S = I + \\frac{(f^+ - f^-)\\, n^T}{n^T f^- + \\partial_t h},

where n is the gradient of the guard h. In stick w keeps no component along the sliding velocity.

Only ``ringsweep/solvers/variation.py`` calls these functions, and only if the scene asks for an exponent.
"""

from __future__ import annotations

from math import inf
from typing import Any, NamedTuple

import numpy as np

from ringsweep.compile import feature, hook
from ringsweep.physics.belt import Belt, BristleBelt
from ringsweep.physics.ring import Ring
from ringsweep.quantities.parameters import Leaf


class Exponent(NamedTuple):
    """What a scene asks for: the exponent of its motion.

    Attributes
    ----------
    frequency : float
        Velocity, m/s, that counts as much in a disturbance as a unit of the place, m or rad.
    disturbance : tuple of float
        A disturbance of the state whose components count alike.
    """

    frequency: Leaf
    disturbance: tuple[Leaf, ...]

    @classmethod
    def of(cls, frequency: Any, bristles: int = 0) -> Exponent:
        """Field ``asked`` of the cells of a batch, whose state holds place, velocity and so many deflections."""
        return cls(frequency, (1.0 / frequency, np.ones(len(frequency)), *[1.0 / frequency] * bristles))


@feature("()", of=(Belt, BristleBelt, Ring))
def asked(scene):
    """Field ``asked`` of a scene: an :class:`Exponent`, or an empty tuple if no exponent is asked for."""
    return scene.asked


@hook(optional=True)
def due(scene, record):
    """Time that a step must show the record, s; by default infinite. Series show it among the extremes."""
    return inf


@hook
def jacobian(scene, mode, t, y):
    """Jacobian of the rates of a mode by its state, row by row, by the formulas of the mode.

    Parameters
    ----------
    scene, mode : NamedTuple
        One cell, and its mode.
    t : Instant
        Time, s.
    y : tuple of float
        State at time `t`.

    Returns
    -------
    tuple of float
    """


@hook
def enter_mode(scene, record, mode, rates):
    """Record at the beginning of a step in a mode, where the rates of the state are `rates`."""


@hook
def propagate(scene, record, h, rates, weights, work):
    """Record after an interval of length `h` within a step.

    Parameters
    ----------
    scene, record : NamedTuple
    h : float
        Length of the interval, s.
    rates : tuple of float
        Rates of the state at its end.
    weights, work : ndarray
        Arguments of :func:`ringsweep.numerics.collocation.transition`; `work` holds the Jacobians.
    """


@hook
def apply_saltation(scene, record, mode, guard, t, y):
    """Record after a guard of a mode has vanished.

    Parameters
    ----------
    scene, record : NamedTuple
    mode : NamedTuple
        Mode that ends.
    guard : int
        Index of the guard, as for :func:`ringsweep.models.interface.modes.switch`.
    t : Instant
        Time of the event, s.
    y : tuple of float
        State before the event.
    """
