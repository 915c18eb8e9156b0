"""Turns of the displacement of a body on the belt, between two observations."""

from __future__ import annotations

from typing import Any, NamedTuple

from ringsweep.compile import absorbed
from ringsweep.numerics.functions import select


class Turn(NamedTuple):
    """Time, s, and displacement, m, of a turn."""

    t: Any
    x: Any


@absorbed
def turn_within(last, t, duration, x, velocity):
    """Turn within an interval in which the velocity changes its sign. There it is nearly linear in time."""
    change = last.velocity - velocity
    changes = abs(change) > 0.0
    share = select(changes, last.velocity / select(changes, change, 1.0), 0.0)
    return Turn(t - (1.0 - share) * duration, between(last, duration, x, velocity, share))


@absorbed
def between(last, duration, x, velocity, share):
    """Displacement at a share of an interval: the cubic through displacements and velocities at both ends."""
    rest = 1.0 - share
    ends = (1.0 + 2.0 * share) * rest * rest * last.x + share * share * (3.0 - 2.0 * share) * x
    return ends + share * rest * duration * (rest * last.velocity - share * velocity)
