"""Cycles of a motion, and evidence that it returns each time or has the same statistics in two parts of its record.

A *cycle* is a period of the forcing; in a free motion it lasts from one turn of the motion to the next of its kind. At
the end of each cycle the state is compared with that one cycle before, and with a reference, which is replaced after
ever more cycles (Brent's cycle detection). The first state that equals one of them closes a *lap*: the time since then
is the period of the motion if each later lap returns too. After a lap that does not return, states must be closer to
count as equal: a motion that only comes near its past is not taken for a periodic one.

The place x of the body is a displacement, or an angle on a ring; lengths in m are then angles in rad.

Throughout, `c` is a :class:`Cycles`, `swing` the distance between the extremes of a cycle, and `fast` the velocity
that belongs to it: ``2 pi`` times the swing over the natural period or that of the forcing, whichever is shorter,
m/s. `forced` says that something excites the motion, `growth` is the largest exponent and its error, 1/s. The records
of the belt and of the ring call these functions at each observation, and at the end of a run.
"""

from __future__ import annotations

from math import inf, isnan, log2, nan, pi, sqrt
from typing import Any, NamedTuple

from ringsweep.compile import absorbed, feature, inlined
from ringsweep.numerics.functions import floor, negated, select
from ringsweep.numerics.memory import select_all
from ringsweep.physics.belt import Belt, BristleBelt
from ringsweep.physics.ring import BristleRing, Ring
from ringsweep.quantities.flags import CHAOTIC, QUASI_PERIODIC, TRANSIENT


class Mark(NamedTuple):
    """State at the end of a cycle.

    Attributes
    ----------
    t, x, velocity : float
        Time, s; place, m or rad; its rate.
    total, slips : float
        Duration, s, and number of the stops until then.
    """

    t: Any
    x: Any
    velocity: Any
    total: Any
    slips: Any


class Corner(NamedTuple):
    """State after so many laps, their `number`."""

    number: Any
    mark: Mark


class Laps(NamedTuple):
    """Laps of one length that returned one after the other.

    Attributes
    ----------
    number : float
    gap, first_gap : float
        Distances between the ends of the last and of the first of them, as a share of the swing.
    near : float
        Greatest distance, as a share of the swing, at which a state has returned.
    within, closest : float
        Least distance, as a share of the swing, from the beginning of the present lap to the ends of its cycles up to
        now, and of the last lap that returned to those of its cycles but the last; infinite if there are none.
    older, newer : Corner
        States after so many laps, the last two powers of two: `older` is at least half of the laps ago.
    """

    number: Any
    gap: Any
    first_gap: Any
    near: Any
    within: Any
    closest: Any
    older: Corner
    newer: Corner


class Part(NamedTuple):
    """Beginning of a part of the record.

    Attributes
    ----------
    count : float
        Cycles before it.
    mark : Mark
        State there.
    swing, sum, squares : float
        Swing of the cycle before, m; sums of the swings until then, and of their squares.
    """

    count: Any
    mark: Mark
    swing: Any
    sum: Any
    squares: Any


class Parts(NamedTuple):
    """Parts of the record of a motion that something excites.

    Attributes
    ----------
    sum, squares : float
        Sums of the swings of all cycles, m, and of their squares.
    earlier, before, middle : Part
        After the last three powers of two of cycles: at least half of the record comes after `before`.
    """

    sum: Any
    squares: Any
    earlier: Part
    before: Part
    middle: Part


class Cycles(NamedTuple):
    """Cycles up to now.

    Attributes
    ----------
    count, next : float
        Number of the last cycle, and time that the record waits for, s: the end of the next period of the forcing.
    low, high : float
        Least and greatest displacement at turns since its end, m.
    half_t, half_x : float
        Time, s, and displacement, m, at the middle of the span, if it comes before the end of a cycle of the forcing;
        else at the start.
    swing, swing_before : float
        Distance between the extremes of the last cycle, and of the cycle before, m.
    last, reference : Mark
        End of the last cycle, and the state with which later states are compared.
    since, most : float
        Cycles since the reference, and cycles after which it is replaced.
    lap : float
        Cycles in a lap, 0 if the motion did not return.
    laps : Laps
    parts : Parts
        An empty tuple if nothing excites the motion.
    period, share, stops, drift : float
        Duration of the last lap, s, NaN if the motion did not return. Share of stick, stops in a cycle, and mean
        velocity, m/s, of the last lap or of the cycles since the reference.
    """

    count: Any
    next: Any
    low: Any
    high: Any
    half_t: Any
    half_x: Any
    swing: Any
    swing_before: Any
    last: Mark
    reference: Mark
    since: Any
    most: Any
    lap: Any
    laps: Laps
    parts: Any
    period: Any
    share: Any
    stops: Any
    drift: Any


#: The motion has returned if displacement and velocity differ by less than this share of their swing in a cycle.
RETURN = 1e-3

# After a lap that did not return this share is a tenth of what it was, but not less than this one.
_NEAREST = 1e-5

# Under a force one return within this share is evidence: no motion comes so close to its past by chance. Else so many
# laps must return. A free motion has no other way to return than to repeat itself.
_EXACT, _LAPS, _LAPS_IF_FREE = 1e-7, 4.0, 1.0

# A change that would add up to less than this share of the swing in so many spans is no trend.
_TREND, _SPANS = 0.1, 10.0

# So many times the time up to now doubles until then.
_DOUBLINGS = log2(1.0 + _SPANS)

# Gaps of laps shrink if the last one is less than this share of the first one.
_SHRUNK = 0.3

# Two parts of the record have the same mean if it differs by less than so many standard errors and this share; shares
# of stick may differ by the second share. Each part must have so many cycles in the mean.
_ERRORS, _SAME_SWING, _SAME_STICK, _FEWEST = 3.0, 0.05, 0.1, 16.0

# Swings scatter alike in two parts of the record if their variances differ by less than the first factor, on a torus by
# less than the second. A motion that leaves an unstable one, or nears another, changes its scatter: by far more than
# this, if its disturbances grow by the exponential of the third number in both parts. Less scatter than the last share
# of the swing is rounding.
_SAME_SCATTER, _SAME_ON_TORUS, _GROWN, _SCATTERED = 4.0, 1.5, 4.0, 1e-6

# Two states that are apart by less than so many times the change to come may become one.
_MERGING = 4.0

# Share of a place that is rounding: a few units in the last place.
_UNRESOLVED = 2.0**-50

# Stops in a cycle are the same if they differ by less.
_SAME_STOPS = 1e-9

# Share of a time by which rounding may change it.
_SAME = 1e-13

#: An exponent is positive if it exceeds so many standard errors. It is zero if with so many it changes a disturbance by
#: less than the second share in a cycle.
POSITIVE, ZERO = 3.0, 0.02

# A multiplier above this one is that of an unstable motion, which does not last.
_UNSTABLE = 1.01

# Laps of more cycles are not looked for.
_MOST_CYCLES = 64.0


@feature("x - other", of=(Ring, BristleRing), absorb=True)
def difference(scene, x, other):
    """Difference of two places of the body, m or rad; on a ring less whole turns, so from -pi to pi."""
    apart = x - other
    return apart - 2.0 * pi * floor(apart / (2.0 * pi) + 0.5)


@feature("1.0", of=(Belt, BristleBelt), absorb=True)
def place_counts(scene):
    """1 if states at different places differ; 0 if the same motion is possible everywhere."""
    return scene.place_counts


@absorbed
def gap(scene, mark, x, velocity, swing, fast):
    """Distance of a state from a mark, as a share of the swing of place and velocity."""
    far_x, far_v = place_counts(scene) * abs(difference(scene, x, mark.x)), abs(velocity - mark.velocity)
    # The swing of a body at rest is rounding too.
    far_x = select(far_x <= _UNRESOLVED * abs(x), 0.0, far_x)
    return max(far_x / max(swing, 1e-300), far_v / max(fast, 1e-300))


@inlined
def none_yet(excited, first, start):
    """Cycles at the beginning of a run, which is the mark `start`; the record waits for the time `first`, s.

    `excited` is an empty tuple if nothing excites the motion.
    """
    corner, unknown = Corner(0.0, start), (nan, nan, nan, nan)
    laps, parts = Laps(0.0, 0.0, 0.0, RETURN, inf, inf, corner, corner), _no_parts(excited, start)
    x, t = start.x, start.t
    return Cycles(0.0, first, x, x, t, x, 0.0, 0.0, start, start, 0.0, 1.0, 0.0, laps, parts, *unknown)


@feature("()")
def _no_parts(excited, start):
    """Parts of a record in which no cycle has ended; `start` is the :class:`Mark` at its beginning."""
    part = Part(0.0, start, 0.0, 0.0, 0.0)
    return Parts(0.0, 0.0, part, part, part)


@feature("()", absorb=True)
def _with_cycle(parts, count, mark, swing):
    """Parts after the end of a cycle."""
    sum_now, squares = parts.sum + swing, parts.squares + swing * swing
    halves, here = count >= 2.0 * parts.middle.count, Part(count, mark, swing, sum_now, squares)
    return Parts(
        sum_now,
        squares,
        select_all(halves, parts.before, parts.earlier),
        select_all(halves, parts.middle, parts.before),
        select_all(halves, here, parts.middle),
    )


@absorbed
def end_of(scene, cycle, count):
    """Time at which a cycle of the duration `cycle` ends, s: the end of the span if only rounding separates them."""
    end = count * cycle
    return select(abs(end - scene.span) <= _SAME * scene.span, scene.span, end)


@absorbed
def is_due(c, t):
    """Whether the time comes that the record waits for: a sum of steps that end there may round to less."""
    return t >= c.next * (1.0 - 4e-16)


@absorbed
def number_at(c, cycle, t):
    """Number of the last cycle of the duration `cycle` that has ended at the time `t`, when one is due."""
    count = floor(t / cycle)
    return max(c.count + 1.0, select(count * cycle > t, count - 1.0, count))


@absorbed
def _with_corners(laps, first, again, start, mark):
    """Laps with their corners, after a lap from `start` to `mark` that is the first of its length, or one more."""
    older, newer = laps.older, laps.newer
    begun, here = Corner(0.0, start), Corner(laps.number, mark)
    doubled = again & (laps.number >= 2.0 * max(newer.number, 1.0))
    older = select_all(first, begun, select_all(doubled, newer, older))
    newer = select_all(first, begun, select_all(doubled, here, newer))
    return Laps(laps.number, laps.gap, laps.first_gap, laps.near, laps.within, laps.closest, older, newer)


@absorbed
def closed(scene, c, mark, count, known, swing, fast, cycle):
    """Cycles after the end of a cycle.

    Parameters
    ----------
    scene : NamedTuple
    c : Cycles
        Cycles before.
    mark : Mark
        State at the end of the cycle.
    count : float or Lanes
        Number of the cycle.
    known : bool or Lanes
        Whether the state may be compared with earlier ones.
    swing, fast : float or Lanes
        Distance between the extremes of the place in the cycle, and the velocity that counts as much.
    cycle : float or Lanes
        Duration of a cycle, s; infinite if turns end it.

    Returns
    -------
    Cycles
    """
    since = c.since + (count - c.count)
    near = c.laps.near
    gap_last = gap(scene, c.last, mark.x, mark.velocity, swing, fast)
    gap_reference = gap(scene, c.reference, mark.x, mark.velocity, swing, fast)
    repeats = known & (gap_last <= near)
    returns = repeats | (known & (gap_reference <= near))
    # A lap of several cycles need not be closed before its end.
    open_lap = negated(returns) & (since < c.lap)
    lap = select(repeats, 1.0, select(returns, since, select(open_lap, c.lap, 0.0)))
    t_from = select(repeats, c.last.t, c.reference.t)
    x_from = select(repeats, c.last.x, c.reference.x)
    total_from = select(repeats, c.last.total, c.reference.total)
    slips_from = select(repeats, c.last.slips, c.reference.slips)
    cycles = select(repeats, count - c.count, since)
    keeps = open_lap | negated(known)
    lost = negated(returns | keeps)
    late = lost & (since >= c.most)
    renew = returns | late | negated(known)
    most = select(late, min(2.0 * c.most, _MOST_CYCLES), c.most)
    again = returns & (lap == c.lap)
    start = select_all(repeats, c.last, c.reference)
    distance = select(repeats, gap_last, gap_reference)
    laps = Laps(
        select(again, c.laps.number + 1.0, select(returns, 1.0, select(lap > 0.0, c.laps.number, 0.0))),
        select(returns, distance, c.laps.gap),
        select(returns & negated(again), distance, c.laps.first_gap),
        select((c.lap > 0.0) & (lap == 0.0), max(0.1 * near, _NEAREST), near),
        select(renew, inf, min(c.laps.within, gap_reference)),
        select(repeats, inf, select(returns, c.laps.within, c.laps.closest)),
        c.laps.older,
        c.laps.newer,
    )
    laps = _with_corners(laps, returns & negated(again), again, start, mark)
    return Cycles(
        count,
        select(cycle < inf, end_of(scene, cycle, count + 1.0), c.next),
        mark.x,
        mark.x,
        c.half_t,
        c.half_x,
        swing,
        c.swing,
        mark,
        select_all(renew, mark, c.reference),
        select(renew, 0.0, since),
        most,
        lap,
        laps,
        _with_cycle(c.parts, count, mark, swing),
        select(returns, (mark.t - t_from) * lap / cycles, select(keeps, c.period, nan)),
        select(keeps, c.share, (mark.total - total_from) / (mark.t - t_from)),
        select(keeps, c.stops, (mark.slips - slips_from) / cycles),
        select(keeps, c.drift, (mark.x - x_from) / (mark.t - t_from)),
    )


@inlined
def returns_each_time(scene, c, forced, fast, largest_multiplier, growth):
    """Whether the motion returns each time, and no trend of its states and stops would change it in ten spans.

    `fast` is that of the last cycle, see :func:`closed`; `largest_multiplier` is 0 if it is not known, `growth` is that
    of :func:`without_return`.
    """
    exponent, error = growth
    laps = c.laps
    if isnan(c.period) or largest_multiplier > _UNSTABLE:
        return False
    if laps.number < (_LAPS if forced else _LAPS_IF_FREE) and laps.gap > _EXACT:
        return False
    soon = _SPANS * scene.span
    if forced and exponent > POSITIVE * error and exponent * soon > 1.0:
        # It returns within the tolerance only, or stays beside a periodic motion for a while.
        return False
    # The corners are states at the ends of laps, and so is the reference.
    changed = gap(scene, laps.older.mark, c.reference.x, c.reference.velocity, c.swing, fast)
    change = changed / (laps.number - laps.older.number)
    # Laps of many cycles are few: there as many must come as there are cycles.
    to_come = merge = change * (soon * max(c.lap, 1.0) / c.period)
    if laps.gap < _SHRUNK * laps.first_gap:
        # Near a bifurcation states that become one approach as a power of time, more slowly than a geometric series:
        # while the time doubles, the change is at most that of the later half of the laps.
        merge = min(merge, changed * _DOUBLINGS)
        # Gaps that shrink add up to a geometric series. On a torus they vary, but little in a few laps.
        ratio = (laps.gap / laps.first_gap) ** (1.0 / (laps.number - 1.0))
        to_come = min(to_come, laps.gap * ratio / (1.0 - ratio)) if ratio < 1.0 else to_come
    # Where disturbances change their sign in each lap, two of these laps return before one does.
    merging = forced and laps.closest <= _MERGING * merge
    if to_come > _TREND or merging:
        return False
    # Beside a continuum of motions stops may shrink for ever, and the states no longer change.
    # Those of the last third of the laps, or of up to two thirds.
    older, newer = laps.older, laps.newer
    first = newer.mark if laps.number >= 1.5 * newer.number > 0.0 else older.mark
    t = c.reference.t - first.t
    share, cycles = (c.reference.total - first.total) / t, floor(t * c.lap / c.period + 0.5)
    stops = (c.reference.slips - first.slips) / cycles
    same = abs(stops - c.stops) < _SAME_STOPS and abs(share - c.share) <= RETURN * c.share + _SAME_STOPS
    return same or not forced


@inlined
def compared(c):
    """Beginnings of the two parts of the record that are compared; the second is not shorter than the first."""
    earlier, before, middle = c.parts.earlier, c.parts.before, c.parts.middle
    if c.count - middle.count < middle.count - before.count:
        return earlier, before
    return before, middle


@inlined
def without_return(c, forced_by_period, cycle, growth):
    """What a forced motion that does not return settles to, as far as its record and its exponent tell.

    Parameters
    ----------
    c : Cycles
    forced_by_period : bool
        Whether the forcing has a period.
    cycle : float
        Duration of a cycle, s.
    growth : tuple of float
        Largest exponent and its standard error, 1/s; NaN if they are not known.
    """
    (exponent, error), (begin_1, begin_2), parts = growth, compared(c), c.parts
    first, second = begin_2.count - begin_1.count, c.count - begin_2.count
    if isnan(exponent) or first < _FEWEST:
        return TRANSIENT
    mean_1, mean_2 = (begin_2.sum - begin_1.sum) / first, (parts.sum - begin_2.sum) / second
    scatter_1 = max((begin_2.squares - begin_1.squares) / first - mean_1 * mean_1, 0.0)
    scatter_2 = max((parts.squares - begin_2.squares) / second - mean_2 * mean_2, 0.0)
    allowed = _ERRORS * sqrt(scatter_1 * (1.0 / first + 1.0 / second)) + _SAME_SWING * mean_1
    time_1, time_2 = begin_2.mark.t - begin_1.mark.t, c.last.t - begin_2.mark.t
    stick_1 = (begin_2.mark.total - begin_1.mark.total) / time_1
    stick_2 = (c.last.total - begin_2.mark.total) / time_2
    same_stick = abs(stick_1 - stick_2) <= _SAME_STICK + 1.0 / sqrt(second)
    if abs(mean_1 - mean_2) > allowed or not same_stick:
        return TRANSIENT
    least, most = min(scatter_1, scatter_2), max(scatter_1, scatter_2)
    grown, rounding = exponent * (time_1 + time_2), (_SCATTERED * mean_1) ** 2
    if exponent > POSITIVE * error:
        chaos = grown > _GROWN and rounding < least and most <= _SAME_SCATTER * least
        return CHAOTIC if chaos else TRANSIENT
    neutral = (abs(exponent) + POSITIVE * error) * cycle <= ZERO
    if forced_by_period:
        return QUASI_PERIODIC if neutral and c.lap == 0.0 and most <= _SAME_ON_TORUS * least else TRANSIENT
    # Under forcing that does not repeat, neither does a motion that has forgotten its start.
    alike = most <= _SAME_SCATTER * max(least, rounding)
    return QUASI_PERIODIC if alike and (neutral or grown < -_GROWN) else TRANSIENT
