"""What is remembered of a run on the belt, and what it makes of it: motion, slips, period."""

from __future__ import annotations

from math import isfinite, nan, sqrt
from typing import NamedTuple

from ringsweep.compile import inlined
from ringsweep.models.interface import recorder
from ringsweep.models.interface.status import BROKEN
from ringsweep.physics import drives
from ringsweep.physics.belt import Belt, BristleBelt
from ringsweep.physics.friction.velocity import stiction_band
from ringsweep.quantities.variables import FAILED, OSCILLATORY, RESTING, STICK_SLIP


class Outcome(NamedTuple):
    """A run on the belt in the numbers that a dataset holds, in the order of their columns."""

    regime: float
    motion: float
    t_end: float
    x_end: float
    velocity_end: float
    x_min: float
    x_max: float
    velocity_max: float
    stick_time: float
    slips: float
    first_slip: float
    period: float
    force_max: float


# ---- what is remembered of a run -------------------------------------------------------------


class Record(NamedTuple):
    """What is remembered of a run on the belt; lengths in m, times in s, forces in N.

    A slip counts once it is longer than the play of the bristles, which ring as the body sticks. ``place`` is where the
    body is on the belt, ``slip_from`` and ``slip_start`` where and when it began to slip, ``counted`` whether that is a
    slip already; ``stuck_for`` is how long it has stuck since the last slip that counts, ``held_for`` how long without
    any, ``last_stick`` how long before the last one that counts, which began at ``last_slip``.

    A cycle of a swing runs from one extreme of the displacement to the next of its ``kind``, maxima (+1) or minima (-1)
    as the first was (0: none yet), and a swing is the way from ``low``, the farthest place between, to that extreme:
    the first, the last, and the greatest in the third and in the fourth quarter of the span.
    """

    velocity: float
    x_min: float
    x_max: float
    velocity_max: float
    force_max: float
    stick_time: float
    place: float
    slip_from: float
    slip_start: float
    counted: bool
    stuck_for: float
    held_for: float
    slips: int
    first_slip: float
    last_slip: float
    last_stick: float
    kind: int
    extremes: int
    first_extreme: float
    last_extreme: float
    low: float
    first_swing: float
    third_swing: float
    fourth_swing: float
    last_swing: float


# A stick shorter than this fraction of the span is a touch.
_TOUCH = 1e-9


# A stick shorter than this fraction of the cycle does not make it a cycle of stick and slip; the second is for laws
# under which a contact is only nearly stuck.
_SHORT, _SHORT_CREEP = 1e-6, 1e-2


# Swings must keep this much of themselves from one quarter of a run to the next for their amplitude to count as
# lasting, and be more than the tolerance makes of the displacement.
_LASTING, _ROUNDING = 0.95, 1e-6


# A body whose last slip lies so many cycles back slips no more.
_CYCLES = 2.0


@inlined
def begin(scene, t, x, velocity, force):
    """Record of a run at its launch."""
    return Record(
        velocity=velocity,
        x_min=x,
        x_max=x,
        velocity_max=velocity,
        force_max=abs(force),
        stick_time=0.0,
        place=x - drives.turn(scene.drive, t)[0],
        slip_from=x - drives.turn(scene.drive, t)[0],
        slip_start=t,
        counted=False,
        stuck_for=0.0,
        held_for=0.0,
        slips=0,
        first_slip=nan,
        last_slip=nan,
        last_stick=0.0,
        kind=0,
        extremes=0,
        first_extreme=nan,
        last_extreme=nan,
        low=0.0,
        first_swing=0.0,
        third_swing=0.0,
        fourth_swing=0.0,
        last_swing=0.0,
    )


@inlined
def observe(r, scene, t, duration, x, velocity, force, stuck, play):
    """Record after `duration` seconds to the state at time `t`, in all of which the body stuck or slipped.

    `play` is the way that a body on bristles can move without slipping, m.
    """
    slips, first_slip, last_slip, last_stick = r.slips, r.first_slip, r.last_slip, r.last_stick
    slip_from, slip_start, counted, stuck_for = r.slip_from, r.slip_start, r.counted, r.stuck_for
    place = x - drives.turn(scene.drive, t)[0]
    if stuck:
        stuck_for += duration
        # Where and when the next slip will have begun.
        slip_from, slip_start, counted = place, t, False
    elif not counted and abs(place - slip_from) > play:
        counted = True
        if stuck_for > _TOUCH * scene.span:
            slips += 1
            last_slip, last_stick = slip_start, stuck_for
            if slips == 1:
                first_slip = last_slip
        stuck_for = 0.0
    kind, extremes, first_extreme, last_extreme = r.kind, r.extremes, r.first_extreme, r.last_extreme
    first_swing, third_swing, fourth_swing, last_swing = r.first_swing, r.third_swing, r.fourth_swing, r.last_swing
    before = r.velocity
    if kind == 0:
        kind = 1 if before > 0.0 and velocity <= 0.0 else -1 if before < 0.0 and velocity >= 0.0 else 0
    low = min(r.low, kind * x)
    seen = extremes == 0 or kind * x - low > _ROUNDING * max(abs(r.x_min), abs(r.x_max))
    if kind * before > 0.0 and kind * velocity <= 0.0 and seen:
        # Between two states the velocity is all but linear.
        extreme = t - duration * velocity / (velocity - before)
        extremes += 1
        if extremes == 1:
            first_extreme = extreme
        else:
            last_swing = kind * x - low
            if extremes == 2:
                first_swing = last_swing
            if extreme > 0.75 * scene.span:
                fourth_swing = max(fourth_swing, last_swing)
            elif extreme > 0.5 * scene.span:
                third_swing = max(third_swing, last_swing)
        last_extreme = extreme
        low = kind * x
    return Record(
        velocity,
        min(r.x_min, x),
        max(r.x_max, x),
        max(r.velocity_max, velocity),
        max(r.force_max, abs(force)),
        r.stick_time + (duration if stuck else 0.0),
        place,
        slip_from,
        slip_start,
        counted,
        stuck_for,
        r.held_for + duration if stuck else 0.0,
        slips,
        first_slip,
        last_slip,
        last_stick,
        kind,
        extremes,
        first_extreme,
        last_extreme,
        low,
        first_swing,
        third_swing,
        fourth_swing,
        last_swing,
    )


@inlined
def conclude(r, scene, status, t, x, velocity, band):
    """Outcome of a run that ended with `status` at time `t` in the state `(x, velocity)`.

    `band` is the sliding speed below which a contact counts as stuck, or zero.
    """
    cycle = (r.last_extreme - r.first_extreme) / (r.extremes - 1) if r.extremes >= 2 else nan
    if status == BROKEN or not (isfinite(x) and isfinite(velocity)):
        motion = FAILED
    elif _sticks_and_slips(r, scene, t, x, velocity, band):
        motion = STICK_SLIP
        cycle = (r.last_slip - r.first_slip) / (r.slips - 1) if r.slips >= 2 else nan
    elif r.held_for < cycle and _swings_on(r):
        motion = OSCILLATORY
    else:
        motion = RESTING
    return Outcome(
        float(motion),
        float(motion),
        t,
        x,
        velocity,
        r.x_min,
        r.x_max,
        r.velocity_max,
        r.stick_time,
        float(r.slips),
        r.first_slip,
        cycle,
        r.force_max,
    )


@inlined
def _sticks_and_slips(r, scene, t, x, velocity, band):
    """Whether stick and slip go on following each other."""
    if r.slips == 0:
        return False
    # A harmonic that grazes the velocity of the belt is slower than the band for so long, and does not stick.
    curvature = (scene.stiffness / scene.mass) ** 1.5 * (r.x_max - r.x_min)
    graze = sqrt(32.0 * band / curvature) if curvature > 0.0 else 0.0
    if r.slips >= 2:
        cycle = (r.last_slip - r.first_slip) / (r.slips - 1)
        shortest = max((_SHORT_CREEP if band > 0.0 else _SHORT) * cycle, graze)
        return r.last_stick > shortest and t - r.last_slip <= _CYCLES * cycle
    # It has slipped once and stuck again: what the spring will be after as long again tells whether it will hold.
    pull = scene.stiffness * abs(x + velocity * scene.span)
    holds = pull <= scene.mu_s * scene.mass * scene.gravity
    return r.stuck_for > max(_SHORT * scene.span, graze) and not holds


@inlined
def _swings_on(r):
    """Whether the body swings at an amplitude that lasts."""
    # Irregular swings are judged by the greatest of a quarter, few ones by the first and the last.
    seen = r.third_swing > 0.0 and r.fourth_swing > 0.0
    before, after = (r.third_swing, r.fourth_swing) if seen else (r.first_swing, r.last_swing)
    return r.extremes >= 3 and after >= _LASTING * before and after > _ROUNDING * max(abs(r.x_min), abs(r.x_max))


@recorder.begin.implements(Belt, BristleBelt)
def _begin(scene, t, seen):
    x, velocity, force = seen
    return begin(scene, t, x, velocity, force)


@recorder.observe.implements(Belt)
def _observe(scene, record, t, duration, stuck, seen):
    x, velocity, force = seen
    return observe(record, scene, t, duration, x, velocity, force, stuck, 0.0)


@recorder.conclude.implements(Belt)
def _conclude(scene, record, status, t, place, velocity):
    return conclude(record, scene, status, t, place, velocity, stiction_band(scene.law))
