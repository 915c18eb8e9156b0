"""The variational equation along the steps of a run; without anything asked for, nothing of it is compiled.

`asked` is :class:`ringsweep.models.interface.variation.Exponent`, or an empty tuple. The steps of ``taylor.py`` and
``creep.py`` call these functions.
"""

from __future__ import annotations

from ringsweep.compile import feature, inlined
from ringsweep.models.interface import implicit, series, variation
from ringsweep.numerics.clock import later
from ringsweep.numerics.collocation import FEW, MANY, WEIGHTS_OF_FEW, WEIGHTS_OF_MANY, largest_trace, store
from ringsweep.physics import drives
from ringsweep.solvers import rosenbrock

# Longest piece of a step of series, in times in which a disturbance grows by a factor of e: where friction falls
# steeply, a step holds many, and collocation follows decay of any rate, but not growth.
_MOST_GROWTH = 1.0

# Longest step, in units of the time in which the spring turns a disturbance by a radian: a body that rests would be
# integrated in a few steps, of which collocation follows no oscillation.
_LONGEST = 2.0


@feature("limit", absorb=True)
def within_turn(asked, t, limit):
    """Time up to which a step that begins at the time `t` may reach, at most `limit`, s."""
    return min(limit, t + _LONGEST / asked.frequency)


@feature("record")
def enter_series(asked, scene, record, mode, c):
    """Record at the beginning of a step of series."""
    return variation.enter_mode(scene, record, mode, series.rates_at(scene, c, 0.0))


@feature("record")
def enter_implicit(asked, scene, record, start):
    """Record at the beginning of an implicit step."""
    return variation.enter_mode(scene, record, start.mode, _rates_of_state(scene, start.forcing, start.linear[0]))


@inlined
def _rates_of_state(scene, forcing, rates):
    """Rates of the state of a mode, from those of an implicit step: the place moves with the drive besides."""
    return implicit.from_implicit(scene, forcing[1:], rates)


@feature("record")
def along_series(asked, scene, record, run, ends, scratch):
    """Record after an interval of a step of series from `run`; `ends` are times since the step began, s."""
    c, work, (low, high) = scratch.c, scratch.work[1:], ends
    width = high - low
    while low < high:
        end = low + width if low + 1.5 * width < high else high
        for i in range(len(MANY)):
            s = low + (end - low) * MANY[i]
            store(variation.jacobian(scene, run.mode, later(run.now, s), series.state_at(scene, c, s)), i, work)
        rates = series.rates_at(scene, c, end)
        if (end - low) * largest_trace(len(rates), len(MANY), work) > _MOST_GROWTH:
            width = 0.5 * (end - low)
            continue
        record = variation.propagate(scene, record, end - low, rates, WEIGHTS_OF_MANY, work)
        low = end
    return record


@feature("record")
def along_implicit(asked, scene, record, start, taken, ends, scratch):
    """Record after an interval of the implicit step `taken`; `ends` are its first and last fraction."""
    (low, high), work = ends, scratch.work[1:]
    if not high > low:
        return record
    forcing, x = start.forcing, start.x
    # Few nodes follow a turn of no more than a radian.
    pieces = 1 + int((high - low) * taken.h * asked.frequency)
    width = (high - low) / pieces
    for piece in range(pieces):
        for i in range(len(FEW)):
            fraction = low + width * (piece + FEW[i])
            t = later(start.now, fraction * taken.h)
            forcing = drives.turn_near(scene.drive, scratch.course, start.now, fraction * taken.h)
            x = rosenbrock.dense(start.x, taken.x_next, scratch.bends[0], fraction)
            store(variation.jacobian(scene, start.mode, t, implicit.from_implicit(scene, forcing, x)), i, work)
        # The last node is the end.
        rates = _rates_of_state(scene, forcing, implicit.rates(scene, start.mode, start.common, forcing, x))
        record = variation.propagate(scene, record, width * taken.h, rates, WEIGHTS_OF_FEW, work)
    return record


@feature("record")
def at_event(asked, scene, record, mode, guard, t, y):
    """Record after a guard of a mode has vanished."""
    return variation.apply_saltation(scene, record, mode, guard, t, y)
