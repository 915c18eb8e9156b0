"""Intervals between two observations, and turns of the displacement within them.

`last` and `now` have the fields ``t``, ``x`` and ``velocity``; both may hold vector lanes.
"""

from __future__ import annotations

from typing import Any, NamedTuple

from ringsweep.compile import absorbed
from ringsweep.numerics.functions import select


class Interval(NamedTuple):
    """An interval that ends with an observation: time, s, and duration, s; place and velocity at its end."""

    t: Any
    duration: Any
    x: Any
    velocity: Any


class Turn(NamedTuple):
    """Time, s, and displacement, m, of a turn, and whether the displacement is least or greatest there."""

    t: Any
    x: Any
    is_least: Any
    is_greatest: Any


@absorbed
def turn_within(last, now):
    """Turn within the interval `now`, in which the velocity changes its sign. There it is nearly linear in time.

    A body that rests at both ends and has moved in between, from one stop to the next in one step, turned where it
    began. One that leaves rest and turns in one step turned at the end: its velocity there is rounding.
    """
    change = last.velocity - now.velocity
    changes = abs(change) > 0.0
    share = select(changes, last.velocity / select(changes, change, 1.0), 0.0)
    hops = (last.velocity == 0.0) & (now.velocity * (now.x - last.x) < 0.0)
    share = select(hops, 1.0, share)
    rests = (last.velocity == 0.0) & (now.velocity == 0.0)
    up = (last.velocity <= 0.0) & (now.velocity > 0.0) | rests & (now.x > last.x)
    down = (last.velocity > 0.0) & (now.velocity <= 0.0) | rests & (now.x < last.x)
    down = down | (last.velocity == 0.0) & (now.velocity < 0.0)
    return Turn(now.t - (1.0 - share) * now.duration, between(last, now, share), up, down)


@absorbed
def between(last, now, share):
    """Place at the share of an interval, from 0 to 1: the cubic through places and velocities at both ends."""
    rest = 1.0 - share
    ends = (1.0 + 2.0 * share) * rest * rest * last.x + share * share * (3.0 - 2.0 * share) * now.x
    return ends + share * rest * now.duration * (rest * last.velocity - share * now.velocity)
