"""Scenes some of whose modes are those of a simpler scene, with fewer components of the state and fewer series.

Only the body with impact in the ring uses it, and only ``ringsweep/solvers/automaton.py`` calls it, in each step.
"""

from __future__ import annotations

from ringsweep.compile import hook
from ringsweep.physics.impact import ImpactRing

#: Types of these scenes.
PARTED = (ImpactRing,)


@hook
def is_simpler(scene, mode):
    """Whether a mode is one of the simpler scene."""


@hook
def simplify(scene, record, mode, y):
    """``(scene, record, y)`` of the simpler scene, before a step of it."""


@hook
def rejoined(scene, record, mode, part_record, y, c):
    """Record and state after a step of the simpler scene.

    Parameters
    ----------
    scene, record, mode : NamedTuple
        The scene, its record before the step, and its mode.
    part_record : NamedTuple
        Record of the simpler scene after the step.
    y : tuple of float
        State of the simpler scene after the step.
    c : ndarray
        Table of series. What the step has left there is made that of the scene.
    """
