"""Times as sums of two numbers, so that a late step is as exact as the first one.

A number near 1e6 resolves 1e-10. A clock that is rounded so at each event would misplace the events of a late period,
and a force would not have the value at which its event was located.

Solvers pass an :class:`Instant` as time; `now` and `t` with `rest` are its parts.
"""

from __future__ import annotations

from math import pi
from typing import NamedTuple

from ringsweep.compile import absorbed, feature
from ringsweep.numerics.functions import nearest


class Instant(NamedTuple):
    """A time, s: the sum of `t` and `rest`, of which `rest` is less than the rounding of `t`."""

    t: float
    rest: float


@feature("t, 0.0", of=Instant, absorb=True)
def parts(t):
    """Both parts of a time, s: of an :class:`Instant`, or of a number, which has no rest."""
    return t.t, t.rest


@absorbed
def later(now, s):
    """The :class:`Instant` that is the time `s`, s, after another time."""
    before, rest = parts(now)
    t = before + s
    added = t - before
    # What rounding has taken from the sum.
    rest += (before - (t - added)) + (s - added)
    rounded = t + rest
    return Instant(rounded, rest - (rounded - t))


# Factor that splits a number into two halves of 26 bits, whose products are exact.
_SPLIT = 134217729.0


@absorbed
def _lost(a, b, product):
    """What rounding has taken from the product of two numbers."""
    high_a, high_b = _SPLIT * a, _SPLIT * b
    high_a, high_b = high_a - (high_a - a), high_b - (high_b - b)
    low_a, low_b = a - high_a, b - high_b
    return ((high_a * high_b - product) + high_a * low_b + low_a * high_b) + low_a * low_b


@absorbed
def turned(frequency, turns, share):
    """The :class:`Instant` after a whole number of turns and a share of one, at a frequency in Hz."""
    t = (turns + share) / frequency
    product = frequency * t
    rest = (((turns - product) + share) - _lost(frequency, t, product)) / frequency
    rounded = t + rest
    return Instant(rounded, rest - (rounded - t))


@absorbed
def is_after(a, b):
    """Whether the :class:`Instant` `a` is after `b`."""
    return a.t > b.t or (a.t == b.t and a.rest > b.rest)


@absorbed
def phase(frequency, t, rest, start):
    """Phase of an oscillation without its whole turns, rad; as exact in the millionth turn as in the first.

    Parameters
    ----------
    frequency : float
        Turns per second, Hz.
    t, rest : float
        Both :func:`parts` of the time, s.
    start : float
        Phase at t = 0, rad.
    """
    turns = frequency * t
    error = _lost(frequency, t, turns)
    # A sum with many turns in `start` would be rounded to what they resolve, differently at each time.
    start -= 2.0 * pi * nearest(start / (2.0 * pi))
    return 2.0 * pi * ((turns - nearest(turns)) + (error + frequency * rest)) + start


@absorbed
def shifted_phase(frequency, t, rest, shift, start):
    """What :func:`phase` returns, but the time is that of :func:`phase` and `shift`, s."""
    now = later(Instant(t, rest), shift)
    return phase(frequency, now.t, now.rest, start)
