"""Cycles of a motion, and evidence that it returns each time or has the same statistics in two parts of its record.

A *cycle* is a period of the forcing; without forcing, it lasts from one turn of the motion to the next of its kind. At
the end of each cycle the state is compared with that one cycle before, and with a reference, which is replaced after
ever more cycles (Brent's cycle detection). The first state that equals one of them closes a *lap*: the time since then
is the period of the motion if each later lap returns too. After a lap that does not return, states must be closer to
count as equal: a motion that only comes near its past is not taken for a periodic one.

The place x of the body is a displacement, or an angle on a ring; lengths in m are then angles in rad.
"""

from __future__ import annotations

from math import floor, inf, isnan, nan, sqrt
from typing import Any, NamedTuple

from ringsweep.compile import absorbed, hook, inlined
from ringsweep.numerics.functions import negated, select
from ringsweep.numerics.memory import select_all
from ringsweep.quantities.flags import CHAOTIC, QUASI_PERIODIC, TRANSIENT


class Mark(NamedTuple):
    """State at the end of a cycle: time, displacement, velocity, and `total` and `slips` of the stops until then."""

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
    older, newer : Corner
        States after so many laps, the last two powers of two: `older` is at least half of the laps ago.
    """

    number: Any
    gap: Any
    first_gap: Any
    near: Any
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


class Cycles(NamedTuple):
    """Cycles up to now.

    Attributes
    ----------
    count, next : float
        Number of the last cycle, and time at which the forcing ends its next period, s.
    low, high : float
        Least and greatest displacement at turns since its end, m.
    swing, swing_before, drift : float
        Distance between the extremes of the last cycle, and of the cycle before, and displacement in it, m.
    last, reference : Mark
        End of the last cycle, and the state with which later states are compared.
    since, most : float
        Cycles since the reference, and cycles after which it is replaced.
    lap, half : float
        Cycles in a lap, 0 if the motion did not return; and displacement after half of the last one, m, NaN if its
        cycles are odd in number.
    laps : Laps
    sum, squares : float
        Sums of the swings of all cycles, m, and of their squares.
    before, middle : Part
        After the last two powers of two of cycles: at least half of the record comes after `before`.
    period, share, stops : float
        Duration of the last lap, s, NaN if the motion did not return. Share of stick and stops in a cycle, of the last
        lap or of the cycles since the reference.
    """

    count: Any
    next: Any
    low: Any
    high: Any
    swing: Any
    swing_before: Any
    drift: Any
    last: Mark
    reference: Mark
    since: Any
    most: Any
    lap: Any
    half: Any
    laps: Laps
    sum: Any
    squares: Any
    before: Part
    middle: Part
    period: Any
    share: Any
    stops: Any


#: The motion has returned if displacement and velocity differ by less than this share of their swing in a cycle.
RETURN = 1e-3

# After a lap that did not return this share is a tenth of what it was, but not less than this one.
_NEAREST = 1e-5

# Under a force one return within this share is evidence: no motion comes so close to its past by chance. Else so many
# laps must return. A free motion has no other way to return than to repeat itself.
_EXACT, _LAPS, _LAPS_IF_FREE = 1e-7, 4.0, 1.0

# A change that would add up to less than this share of the swing in ten spans is no trend.
_TREND = 0.1

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

# Stops in a cycle are the same if they differ by less.
_SAME_STOPS = 1e-9

# An exponent is positive if it exceeds so many standard errors. It is zero if with so many it changes a disturbance by
# less than the second share in a cycle.
_POSITIVE, _ZERO = 3.0, 0.02

# A multiplier above this one is that of an unstable motion, which does not last.
_UNSTABLE = 1.01

# Laps of more cycles are not looked for.
_MOST_CYCLES = 64.0


@hook(absorb=True, optional=True)
def difference(scene, x, other):
    """Difference of two places of the body, m or rad; on a ring without full turns."""
    return x - other


@absorbed
def gap(scene, mark, x, velocity, swing, fast):
    """Distance of a state from a mark, as a share of the swing of place and velocity."""
    far_x, far_v = abs(difference(scene, x, mark.x)), abs(velocity - mark.velocity)
    return max(far_x / max(swing, 1e-300), far_v / max(fast, 1e-300))


@inlined
def begin(period, start):
    """Cycles at the beginning of a run, which is the mark `start`; `period` is that of the forcing, s."""
    corner, part = Corner(0.0, start), Part(0.0, start, 0.0, 0.0, 0.0)
    laps = Laps(0.0, 0.0, 0.0, RETURN, corner, corner)
    sums = 0.0, 0.0, part, part, nan, nan, nan
    return Cycles(0.0, period, start.x, start.x, 0.0, 0.0, 0.0, start, start, 0.0, 1.0, 0.0, nan, laps, *sums)


@absorbed
def _with_corners(laps, first, again, start, mark):
    """Laps with their corners, after a lap from `start` to `mark` that is the first of its length, or one more."""
    older, newer = laps.older, laps.newer
    begun, here = Corner(0.0, start), Corner(laps.number, mark)
    doubled = again & (laps.number >= 2.0 * max(newer.number, 1.0))
    older = select_all(first, begun, select_all(doubled, newer, older))
    newer = select_all(first, begun, select_all(doubled, here, newer))
    return Laps(laps.number, laps.gap, laps.first_gap, laps.near, older, newer)


@absorbed
def closed(scene, c, mark, count, known, swing, fast):
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
        c.laps.older,
        c.laps.newer,
    )
    laps = _with_corners(laps, returns & negated(again), again, start, mark)
    sum_now, squares = c.sum + swing, c.squares + swing * swing
    halves = count >= 2.0 * c.middle.count
    here = Part(count, mark, swing, sum_now, squares)
    return Cycles(
        count,
        (count + 1.0) * scene.forcing_period,
        mark.x,
        mark.x,
        swing,
        c.swing,
        (mark.x - c.last.x) / (count - c.count),
        mark,
        select_all(renew, mark, c.reference),
        select(renew, 0.0, since),
        most,
        lap,
        select(lap == c.lap, select(since + since == lap, mark.x, c.half), nan),
        laps,
        sum_now,
        squares,
        select_all(halves, c.middle, c.before),
        select_all(halves, here, c.middle),
        select(returns, (mark.t - t_from) * lap / cycles, select(keeps, c.period, nan)),
        select(keeps, c.share, (mark.total - total_from) / (mark.t - t_from)),
        select(keeps, c.stops, (mark.slips - slips_from) / cycles),
    )


@inlined
def returns_each_time(scene, c, fast, largest_multiplier, growth):
    """Whether the motion returns each time, and no trend of its states would change it in ten spans.

    `fast` is that of the last cycle, see :func:`closed`; `largest_multiplier` is 0 if it is not known, `growth` is that
    of :func:`without_return`.
    """
    exponent, error = growth
    laps = c.laps
    if isnan(c.period) or largest_multiplier > _UNSTABLE:
        return False
    forced = scene.forcing_period < inf
    if laps.number < (_LAPS if forced else _LAPS_IF_FREE) and laps.gap > _EXACT:
        return False
    if forced and exponent > _POSITIVE * error:
        # It returns within the tolerance only, or stays beside a periodic motion for a while.
        return False
    # The corners are states at the ends of laps, and so is the reference.
    changed = gap(scene, laps.older.mark, c.reference.x, c.reference.velocity, c.swing, fast)
    change = changed / (laps.number - laps.older.number)
    # Laps of many cycles are few: there as many must come as there are cycles.
    to_come = change * (10.0 * scene.span * max(c.lap, 1.0) / c.period)
    if laps.gap < _SHRUNK * laps.first_gap:
        # Gaps that shrink add up to a geometric series. On a torus they vary, but little in a few laps.
        ratio = (laps.gap / laps.first_gap) ** (1.0 / (laps.number - 1.0))
        to_come = min(to_come, laps.gap * ratio / (1.0 - ratio)) if ratio < 1.0 else to_come
    # Where disturbances change their sign in each lap, two of these laps return before one does.
    merging = forced and abs(difference(scene, c.half, c.reference.x)) <= _MERGING * to_come * c.swing
    return to_come <= _TREND and not merging


@inlined
def stops_of_laps(c, period):
    """Share of stick and stops in a cycle of a forced motion that returns.

    They are those of the last lap, unless earlier ones have other stops: then those of the later half of the laps.
    """
    first = c.laps.older.mark
    t = c.reference.t - first.t
    stops = (c.reference.slips - first.slips) / floor(t / period + 0.5)
    return (c.share, c.stops) if abs(stops - c.stops) < _SAME_STOPS else ((c.reference.total - first.total) / t, stops)


@inlined
def part_sizes(c):
    """Numbers of cycles in the two parts of the record that are compared."""
    return c.middle.count - c.before.count, c.count - c.middle.count


@inlined
def without_return(c, period, growth):
    """What a forced motion that does not return settles to, as far as its record and its exponent tell.

    Parameters
    ----------
    c : Cycles
        With at least one cycle in each part of the record.
    period : float
        Period of the forcing, s.
    growth : tuple of float
        Largest exponent and its standard error, 1/s; NaN if they are not known.
    """
    (exponent, error), (first, second) = growth, part_sizes(c)
    mean_1, mean_2 = (c.middle.sum - c.before.sum) / first, (c.sum - c.middle.sum) / second
    scatter_1 = max((c.middle.squares - c.before.squares) / first - mean_1 * mean_1, 0.0)
    scatter_2 = max((c.squares - c.middle.squares) / second - mean_2 * mean_2, 0.0)
    allowed = _ERRORS * sqrt(scatter_1 * (1.0 / first + 1.0 / second)) + _SAME_SWING * mean_1
    time_1, time_2 = c.middle.mark.t - c.before.mark.t, c.last.t - c.middle.mark.t
    stick_1 = (c.middle.mark.total - c.before.mark.total) / time_1
    stick_2 = (c.last.total - c.middle.mark.total) / time_2
    same_stick = abs(stick_1 - stick_2) <= _SAME_STICK + 1.0 / sqrt(second)
    if isnan(exponent) or first < _FEWEST or abs(mean_1 - mean_2) > allowed or not same_stick:
        return TRANSIENT
    least, most = min(scatter_1, scatter_2), max(scatter_1, scatter_2)
    if exponent > _POSITIVE * error:
        grown = exponent * (time_1 + time_2) > _GROWN and least > (_SCATTERED * mean_1) ** 2
        # A few cycles tell no scatter.
        return CHAOTIC if grown and (second < _FEWEST or most <= _SAME_SCATTER * least) else TRANSIENT
    torus = c.lap == 0.0 and second >= _FEWEST and most <= _SAME_ON_TORUS * least
    if torus and (abs(exponent) + _POSITIVE * error) * period <= _ZERO:
        return QUASI_PERIODIC
    return TRANSIENT
