"""Record and outcome of runs on the belt: motion, slips, period."""

from __future__ import annotations

from math import isfinite, nan, sqrt
from typing import NamedTuple

from ringsweep.compile import absorbed, inlined
from ringsweep.models.interface import recorder
from ringsweep.models.interface.status import BROKEN
from ringsweep.numerics.functions import any_of, select
from ringsweep.physics.belt import Belt, BristleBelt
from ringsweep.physics.friction.velocity import stiction_band
from ringsweep.quantities.variables import FAILED, OSCILLATORY, RESTING, STICK_SLIP


class Outcome(NamedTuple):
    """Outcomes of a run on the belt, in the order of their columns."""

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


class Record(NamedTuple):
    """Record of a run on the belt; lengths in m, velocities in m/s, times in s, forces in N.

    A slip counts if it is longer than the play of the bristles, since bristles vibrate while the body sticks. The
    extremes of the displacement that count are maxima or minima, like the first one.

    Attributes
    ----------
    velocity : float
        Velocity in space at the last observation.
    x_min, x_max, velocity_max, force_max, stick_time : float
        As in :class:`Outcome`.
    slip_from, slip_start : float
        Place on the belt and time at which the body began to slip, or stuck last. The place is NaN once the present
        slip counts.
    slipped_at : float
        Time of the last observation at which the body slipped.
    stick_before : float
        ``stick_time`` at the last slip.
    slips : float
        Number of slips that count.
    first_slip, last_slip : float
        Times at which the first and the last of these slips began.
    last_stick : float
        Time for which the body stuck before the last of these slips.
    extreme_sign : float
        1 if maxima count, -1 if minima count, 0 before the first extreme.
    extremes : float
        Number of extremes that count.
    first_extreme, last_extreme : float
        Times of the first and of the last of these extremes.
    opposite : float
        ``extreme_sign * x`` at the farthest place on the opposite side since the last of these extremes.
    first_swing, third_swing, fourth_swing, last_swing : float
        Distance from the opposite side to an extreme: for the first and for the last extreme, and the largest in the
        third and in the fourth quarter of the span.
    """

    velocity: float
    x_min: float
    x_max: float
    velocity_max: float
    force_max: float
    stick_time: float
    slip_from: float
    slip_start: float
    slipped_at: float
    stick_before: float
    slips: float
    first_slip: float
    last_slip: float
    last_stick: float
    extreme_sign: float
    extremes: float
    first_extreme: float
    last_extreme: float
    opposite: float
    first_swing: float
    third_swing: float
    fourth_swing: float
    last_swing: float


# A stick that is shorter than this fraction of the span does not count.
_SHORTEST_STICK = 1e-9

# In stick-slip, the stick lasts longer than this fraction of the cycle. The second value is for laws with a stiction
# band, under which the contact creeps.
_SHORT_STICK, _SHORT_STICK_IN_BAND = 1e-6, 1e-2

# An oscillation lasts if its swings keep this share of their length from one quarter of the run to the next, and if
# they exceed this share of the displacement; errors explain smaller swings.
_LASTING, _ROUNDING = 0.95, 1e-6

# A body that has not slipped for more cycles than this has stopped slipping.
_MOST_CYCLES_SINCE_SLIP = 2.0


@inlined
def begin(t, x, velocity, force, place):
    """Record at the beginning of a run."""
    return Record(
        velocity=velocity,
        x_min=x,
        x_max=x,
        velocity_max=velocity,
        force_max=abs(force),
        stick_time=0.0,
        slip_from=place,
        slip_start=t,
        slipped_at=t,
        stick_before=0.0,
        slips=0.0,
        first_slip=nan,
        last_slip=nan,
        last_stick=0.0,
        extreme_sign=0.0,
        extremes=0.0,
        first_extreme=nan,
        last_extreme=nan,
        opposite=0.0,
        first_swing=0.0,
        third_swing=0.0,
        fourth_swing=0.0,
        last_swing=0.0,
    )


@absorbed
def observe(r, span, t, duration, x, velocity, force, place, stuck, play):
    """Record after an interval of `duration` seconds that ends at time `t`, in which the body stuck or slipped.

    `place` is the displacement relative to the belt, m; `play` the distance that a body on bristles can move without
    slipping, m. Most steps change neither slips nor extremes.
    """
    stick_time, stick_before = r.stick_time + select(stuck, duration, 0.0), r.stick_before
    # The next slip begins here, unless the body sticks longer.
    slip_from, slip_start = select(stuck, place, r.slip_from), select(stuck, t, r.slip_start)
    slips, first_slip, last_slip, last_stick = r.slips, r.first_slip, r.last_slip, r.last_stick
    slipped = abs(place - slip_from) > play
    if any_of(slipped):
        stick = stick_time - stick_before
        counts = slipped & (stick > _SHORTEST_STICK * span)
        first_slip = select(counts & (slips == 0.0), slip_start, first_slip)
        last_slip, last_stick = select(counts, slip_start, last_slip), select(counts, stick, last_stick)
        slips = slips + select(counts, 1.0, 0.0)
        slip_from, stick_before = select(slipped, nan, slip_from), select(slipped, stick_time, stick_before)
    sign, extremes, first_extreme, last_extreme = r.extreme_sign, r.extremes, r.first_extreme, r.last_extreme
    first_swing, third_swing, fourth_swing, last_swing = r.first_swing, r.third_swing, r.fourth_swing, r.last_swing
    before, opposite = r.velocity, min(r.opposite, sign * x)
    if any_of(before * velocity <= 0.0):
        is_maximum, is_minimum = (before > 0.0) & (velocity <= 0.0), (before < 0.0) & (velocity >= 0.0)
        sign = select(sign == 0.0, select(is_maximum, 1.0, select(is_minimum, -1.0, 0.0)), sign)
        swing = sign * x - opposite
        is_swing = (extremes == 0.0) | (swing > _ROUNDING * max(abs(r.x_min), abs(r.x_max)))
        counts = ((is_maximum & (sign > 0.0)) | (is_minimum & (sign < 0.0))) & is_swing
        # Between two observations the velocity is nearly linear in time.
        last_extreme = select(counts, t - duration * velocity / (velocity - before), last_extreme)
        first, later = counts & (extremes == 0.0), counts & (extremes > 0.0)
        first_extreme = select(first, last_extreme, first_extreme)
        last_swing = select(later, swing, last_swing)
        first_swing = select(later & (extremes == 1.0), swing, first_swing)
        in_fourth = last_extreme > 0.75 * span
        fourth_swing = select(later & in_fourth, max(fourth_swing, swing), fourth_swing)
        in_third = (last_extreme > 0.5 * span) & (last_extreme <= 0.75 * span)
        third_swing = select(later & in_third, max(third_swing, swing), third_swing)
        extremes, opposite = extremes + select(counts, 1.0, 0.0), select(counts, sign * x, opposite)
    return Record(
        velocity,
        min(r.x_min, x),
        max(r.x_max, x),
        max(r.velocity_max, velocity),
        max(r.force_max, abs(force)),
        stick_time,
        slip_from,
        slip_start,
        select(stuck, r.slipped_at, t),
        stick_before,
        slips,
        first_slip,
        last_slip,
        last_stick,
        sign,
        extremes,
        first_extreme,
        last_extreme,
        opposite,
        first_swing,
        third_swing,
        fourth_swing,
        last_swing,
    )


@inlined
def conclude(r, scene, status, t, x, velocity, band):
    """Outcome of a run that ended with `status` at time `t` in the state `(x, velocity)`.

    `band` is the sliding speed below which a contact counts as stuck, m/s; 0 for set-valued laws.
    """
    cycle = (r.last_extreme - r.first_extreme) / (r.extremes - 1) if r.extremes >= 2 else nan
    if status == BROKEN or not (isfinite(x) and isfinite(velocity)):
        motion = FAILED
    elif _sticks_and_slips(r, scene, t, x, velocity, band):
        motion = STICK_SLIP
        cycle = (r.last_slip - r.first_slip) / (r.slips - 1) if r.slips >= 2 else nan
    elif t - r.slipped_at < cycle and _keeps_swinging(r):
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
        r.slips,
        r.first_slip,
        cycle,
        r.force_max,
    )


@inlined
def _sticks_and_slips(r, scene, t, x, velocity, band):
    """Whether stick and slip still alternate at the end of a run."""
    if r.slips == 0:
        return False
    # A harmonic oscillation that only touches the velocity of the belt stays in the band for this time without a stick.
    curvature = (scene.stiffness / scene.mass) ** 1.5 * (r.x_max - r.x_min)
    graze = sqrt(32.0 * band / curvature) if curvature > 0.0 else 0.0
    if r.slips >= 2:
        cycle = (r.last_slip - r.first_slip) / (r.slips - 1)
        shortest = max((_SHORT_STICK_IN_BAND if band > 0.0 else _SHORT_STICK) * cycle, graze)
        return r.last_stick > shortest and t - r.last_slip <= _MOST_CYCLES_SINCE_SLIP * cycle
    # The body has slipped once and stuck again. It slips again if the spring force one span later exceeds breakaway.
    pull = scene.stiffness * abs(x + velocity * scene.span)
    holds = pull <= scene.mu_s * scene.mass * scene.gravity
    return r.stick_time - r.stick_before > max(_SHORT_STICK * scene.span, graze) and not holds


@inlined
def _keeps_swinging(r):
    """Whether the body oscillates without decay."""
    # The largest swings of two quarters are compared; if there are too few swings, the first and the last.
    has_both = r.third_swing > 0.0 and r.fourth_swing > 0.0
    before, after = (r.third_swing, r.fourth_swing) if has_both else (r.first_swing, r.last_swing)
    return r.extremes >= 3 and after >= _LASTING * before and after > _ROUNDING * max(abs(r.x_min), abs(r.x_max))


@recorder.begin.implements(Belt, BristleBelt)
def _begin(scene, t, seen):
    x, velocity, force, place = seen
    return begin(t, x, velocity, force, place)


@recorder.observe.implements(Belt)
def _observe(scene, record, t, duration, stuck, seen):
    x, velocity, force, place = seen
    return observe(record, scene.span, t, duration, x, velocity, force, place, stuck, 0.0)


@recorder.conclude.implements(Belt)
def _conclude(scene, record, status, t, place, velocity):
    return conclude(record, scene, status, t, place, velocity, stiction_band(scene.law))
