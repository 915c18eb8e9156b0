"""Modes of the belt, and the rows of its table of series.

A belt with end stops has the modes of one without, and each of them with the body at rest at a stop.
"""

from __future__ import annotations

from typing import Any, NamedTuple

from ringsweep.compile import feature, hook, inlined, replacing
from ringsweep.numerics.terms import FACTOR_ROWS, MOST_GROUPS
from ringsweep.physics.friction.registry import holds_in_band

# Rows of the table of series; the guards are last.
X, V, VELOCITY, ACCELERATION, FORCE, SHIFT, PUSH, LOAD, SQUARE, CUBE, RATIO, FACTORS = range(12)
_GUARDS = FACTORS + MOST_GROUPS * FACTOR_ROWS
# The normal reaction is a guard only if it varies. Guards of the stops come after those that the surface has.
NORMAL, SLOW, FAST, EDGE_ABOVE, EDGE_BELOW = range(_GUARDS, _GUARDS + 5)


class Mode(NamedTuple):
    """Mode of the belt.

    Attributes
    ----------
    sign : int
        Sign of the sliding velocity; 0 if the contact is stuck. In a dead band after breakaway, the sign of the pull.
    region : int
        Region of the friction law.
    entry_guard : int
        Row of the guard that is zero on entry, or -1.
    place : tuple of int
        Segment and turn of the surface; an empty tuple without zones.
    stop : AtStop
        An empty tuple without end stops.
    """

    sign: int
    region: int
    entry_guard: int
    place: Any
    stop: Any


class AtStop(NamedTuple):
    """A body between end stops.

    Attributes
    ----------
    rests : int
        1 or -1 while the body rests at the upper or lower stop, else 0.
    impacts, speed_max : float
        Number of impacts up to now, and largest speed before one, m/s.
    velocity : float
        Velocity in space after the last impact, m/s.
    lasts : float
        Time from that impact until rebounds that are summed end, s.
    """

    rests: int
    impacts: float
    speed_max: float
    velocity: float
    lasts: float


#: Mode with another state at the stops.
with_stop = replacing("stop")


@feature("FAST + 1")
def low_stop(surface):
    """Row of the guard of the lower stop; that of the upper one is next."""
    return EDGE_BELOW + 1


@feature("guards")
def rows_with_stops(stops, guards):
    """Number of rows of the table: `guards` if there are no stops."""
    return guards + 2


@inlined
def yields(scene, mode):
    """Whether the body is in the dead band of a set-valued law, after breakaway or before it comes to rest."""
    return holds_in_band(scene.law) and mode.region < 0


@hook
def mode_at(scene, place, t, y):
    """Status and mode of a body in a state that no guard has led to; no stop counts. `place` is as in a mode."""


@hook
def after_guard(scene, mode, guard, t, y):
    """Implement :func:`modes.switch` for guards that are none of a stop."""
