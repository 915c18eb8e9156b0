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
    a, b = _SPLIT * frequency, _SPLIT * t
    a, b = a - (a - frequency), b - (b - t)
    c, d = frequency - a, t - b
    # What rounding has taken from the product.
    error = ((a * b - turns) + a * d + c * b) + c * d
    # A sum with many turns in `start` would be rounded to what they resolve, differently at each time.
    start -= 2.0 * pi * nearest(start / (2.0 * pi))
    return 2.0 * pi * ((turns - nearest(turns)) + (error + frequency * rest)) + start


@absorbed
def shifted_phase(frequency, t, rest, shift, start):
    """What :func:`phase` returns, but the time is that of :func:`phase` and `shift`, s."""
    now = later(Instant(t, rest), shift)
    return phase(frequency, now.t, now.rest, start)
