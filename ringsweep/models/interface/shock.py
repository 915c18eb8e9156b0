"""Shocks: jumps of the acceleration, which an accelerometer on the body sees.

The acceleration jumps at the edge of a zone, at breakaway, at a stop and at a reversal. A method that locates these
events shows the recorder the acceleration on both sides. A method of constant step does not: its runs have no shocks.

The records of the models call these functions. `shocks` is a :class:`Shocks`, `seen` a :class:`Located`; each is an
empty tuple for a method that does not locate events.
"""

from __future__ import annotations

from math import nan
from typing import NamedTuple

from ringsweep.compile import feature, inlined, replacing
from ringsweep.physics.friction import Smooth

# A change of the acceleration below this share of its size, or of a jump, is an error of the method.
_LEAST_SHARE = 1e-6


class Located(NamedTuple):
    """Acceleration of the body, and the size of its terms (rad/s^2 or m/s^2), of a method that locates events."""

    acceleration: float
    size: float


class Shocks(NamedTuple):
    """Acceleration at the last observation, and largest jump up to now.

    Attributes
    ----------
    acceleration : float
        In rad/s^2 or m/s^2; NaN after an event at which it does not jump.
    jump_max : float
        Magnitude of the largest jump.
    first, t_jump_max : float
        Magnitude of the first of the largest jumps, which differ from it by errors only, and its time, s; NaN if there
        was none.
    """

    acceleration: float
    jump_max: float
    first: float
    t_jump_max: float


_with_acceleration = replacing("acceleration")


@feature("()")
def at_launch(seen):
    """Shocks at the beginning of a run; an empty tuple unless the method locates events, as `seen` then tells."""
    return Shocks(seen.acceleration, 0.0, 0.0, nan)


@feature("shocks", absorb=True)
def without_event(shocks, seen):
    """Shocks after an observation within a mode, where the acceleration does not jump."""
    return _with_acceleration(shocks, seen.acceleration)


@inlined
def with_jump(shocks, t, seen):
    """Shocks at the beginning of a step at time `t`, where the acceleration may have jumped."""
    jump = abs(seen.acceleration - shocks.acceleration)
    if jump > shocks.jump_max and jump > _LEAST_SHARE * seen.size:
        if jump > (1.0 + _LEAST_SHARE) * shocks.first:
            return Shocks(seen.acceleration, jump, jump, t)
        return Shocks(seen.acceleration, jump, shocks.first, shocks.t_jump_max)
    return without_event(shocks, seen)


@feature("shocks", of=Smooth)
def without_jump(law_family, shocks):
    """Shocks after an event at which no coefficient of friction changes: under a smooth law nothing jumps there."""
    return _with_acceleration(shocks, nan)


@feature("(nan, nan)")
def largest_jump(shocks):
    """Largest jump and its time, s; NaN where it is not known."""
    return shocks.jump_max, shocks.t_jump_max
