"""Record and outcome of runs on the belt: extremes, stops, cycles, and the word for what the motion settles to.

A *stop* is an interval in which the body sticks to the belt, and stays longer than a motion that only passes or grazes
the speed of the belt. A *cycle* is a period of the forcing; without forcing, it lasts from one turn of the displacement
to the next of its kind. At the end of each cycle the state is compared with that one cycle before, and with a
reference, which is replaced after ever more cycles (Brent's cycle detection). The first state that equals one of them
closes a *lap*: the time since then is the period of the motion.
"""

from __future__ import annotations

from math import inf, isfinite, isnan, nan, pi, sqrt
from typing import Any, NamedTuple

from ringsweep.compile import absorbed, hook, inlined
from ringsweep.models.belt import section, tangent
from ringsweep.models.belt.force import breakaway_force
from ringsweep.models.belt.turn import between, turn_within
from ringsweep.models.interface import recorder, shock
from ringsweep.models.interface.status import BROKEN, SEPARATED_1
from ringsweep.numerics.functions import any_of, floor, lanes_body, select, square_root
from ringsweep.numerics.memory import select_all
from ringsweep.physics import ring
from ringsweep.physics.belt import Belt, BristleBelt
from ringsweep.physics.friction.velocity import stiction_band
from ringsweep.quantities.flags import FAILED, OSCILLATORY, RIDING, SEPARATING, SLIDING, STICK_SLIP, STICKING


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
    stick_share: float
    stops_per_cycle: float
    swing: float
    settled: float
    force_max: float
    jump_max: float
    t_jump_max: float


class Last(NamedTuple):
    """The last observation.

    Attributes
    ----------
    t, x, velocity : float
        Time, s, displacement, m, and velocity in space, m/s.
    place, v, v_rate : float
        Displacement relative to the belt, m, sliding velocity, m/s, and its rate, m/s^2 (0 if unknown).
    pull : float
        Force that would keep the body at rest on the belt, N.
    """

    t: Any
    x: Any
    velocity: Any
    place: Any
    v: Any
    v_rate: Any
    pull: Any


class Stops(NamedTuple):
    """Stops up to now.

    Attributes
    ----------
    side : float
        1 if the contact counts as stuck, -1 if it slips.
    since : float
        Time at which that began, s.
    stick_time : float
        Time for which it counted as stuck before, s.
    start, least : float
        Time at which the present stop began, NaN in slip; and how long it must be to count, s: negative if it began
        with the run.
    slip_from, slip_start : float
        Place on the belt, m, and time, s, at which the contact last counted as stuck. The place is NaN in stick, and
        once the slip is longer than the play of the bristles.
    total, slips : float
        Duration, s, and number of the stops that count and that a slip has ended.
    first_slip : float
        Time at which the first of these slips began, s.
    """

    side: Any
    since: Any
    stick_time: Any
    start: Any
    least: Any
    slip_from: Any
    slip_start: Any
    total: Any
    slips: Any
    first_slip: Any


class Mark(NamedTuple):
    """State at the end of a cycle: time, displacement, velocity, and `total` and `slips` of the stops until then."""

    t: Any
    x: Any
    velocity: Any
    total: Any
    slips: Any


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
    lap : float
        Cycles in a lap; 0 if the motion did not return.
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
    period: Any
    share: Any
    stops: Any


class Record(NamedTuple):
    """Record of a run on the belt; lengths in m, velocities in m/s, times in s, forces in N.

    Attributes
    ----------
    band : float
        Sliding speed below which a contact counts as stuck; 0 for set-valued laws.
    play : float
        Distance that a body on bristles can move without slipping; negative for other laws.
    last : Last
    x_min, x_max, velocity_max, force_max : float
        As in :class:`Outcome`, but the displacement only at turns.
    stops : Stops
    cycles : Cycles
    shocks : Shocks or NoShocks
        Jumps of the acceleration.
    tangent : Tangent
        Growth of small disturbances; an empty tuple if no exponent is asked for.
    section : Points
        Points of the section; an empty tuple if none is asked for.
    """

    band: Any
    play: Any
    last: Last
    x_min: Any
    x_max: Any
    velocity_max: Any
    force_max: Any
    stops: Stops
    cycles: Cycles
    shocks: Any
    tangent: Any
    section: Any


#: The motion has returned if displacement and velocity differ by less than this share of their swing in a cycle.
RETURN = 1e-3

# A free oscillation has settled if its swing, at the rate of its last cycle, changes by less than this share in a span.
_DECAY = 1e-2

# Laps of more cycles are not looked for.
_MOST_CYCLES = 64.0

# A stop that counts lasts longer than this factor times the time in which the body would lose its sliding velocity. A
# motion that grazes the speed of the belt stays in the stiction band for four times this time, one that passes for two.
_PASSAGE = 8.0

# Largest such time, in natural periods or periods of the forcing.
_LONGEST_PASSAGE = 0.1

# The sliding velocity is zero within this share of its scale.
_AT_REST = 1e-8

# A turn counts if the body has moved farther than this share of the range of its displacement.
_ROUNDING = 1e-6


@inlined
def begin(scene, t, seen, band, play):
    """Record at the beginning of a run."""
    x, velocity, force, place, v, v_rate, acceleration, _ = seen
    start = Mark(t, x, velocity, 0.0, 0.0)
    # The body counts as stuck until it slips: the first stop begins with the run. If the pull exceeds breakaway, it may
    # pass the stiction band at once.
    pull = max(abs(scene.body.mass * v_rate + force), abs(scene.body.stiffness * x))
    passes = band > 0.0 and pull > (1.0 + 1e-9) * breakaway_force(scene, x)
    least = min(_LONGEST_PASSAGE * _pace(scene), _PASSAGE * band * scene.body.mass / pull) if passes else 0.0
    return Record(
        band,
        play,
        Last(t, x, velocity, place, v, v_rate, scene.body.mass * v_rate + force),
        x,
        x,
        velocity,
        abs(force),
        Stops(1.0, t, 0.0, t, -max(least, 1e-300), nan, t, 0.0, 0.0, nan),
        Cycles(0.0, scene.forcing_period, x, x, 0.0, 0.0, 0.0, start, start, 0.0, 1.0, 0.0, nan, nan, nan),
        shock.begin(acceleration),
        tangent.begin(scene.asked, scene, t),
        (),
    )


@recorder.lend.implements(Belt, BristleBelt)
def _lend(scene, record, row):
    return changed(record, record.tangent, section.lent(scene.section, record, row))


@inlined
def changed(r, new_tangent, new_section):
    """Record with another tangent and other points."""
    return Record(
        r.band,
        r.play,
        r.last,
        r.x_min,
        r.x_max,
        r.velocity_max,
        r.force_max,
        r.stops,
        r.cycles,
        r.shocks,
        new_tangent,
        new_section,
    )


@recorder.observe.implements(Belt, BristleBelt)
def _observe(scene, record, t, duration, stuck, seen):
    # In most steps nothing turns, begins or ends.
    r = record
    x, velocity, force, place, v, v_rate, acceleration, deflection = seen
    stops, cycles, x_min, x_max = r.stops, r.cycles, r.x_min, r.x_max
    place = _place(scene, r, place)
    side = select(stuck, 1.0, -1.0)
    if any_of((side * stops.side < 0.0) | _leaves(scene, r, place)):
        span = max(x_max, x) - min(x_min, x)
        stops = _stops(scene, r, t, duration, stuck, side, place, v, force, span)
    if any_of((r.last.velocity * velocity <= 0.0) | (t >= cycles.next)):
        up, down = (r.last.velocity <= 0.0) & (velocity > 0.0), (r.last.velocity > 0.0) & (velocity <= 0.0)
        turn = turn_within(r.last, t, duration, x, velocity)
        x_min, x_max = select(up, min(x_min, turn.x), x_min), select(down, max(x_max, turn.x), x_max)
        span = max(x_max, x) - min(x_min, x)
        cycles = _cycles(scene, r, stops, t, duration, x, velocity, v, up, down, turn, span)
    return Record(
        r.band,
        r.play,
        Last(
            _located(r.last.t, t),
            x,
            velocity,
            place,
            v,
            _located(r.last.v_rate, v_rate),
            _located(r.last.pull, scene.body.mass * v_rate + force),
        ),
        x_min,
        x_max,
        max(r.velocity_max, velocity),
        max(r.force_max, abs(force)),
        stops,
        cycles,
        shock.observe(r.shocks, acceleration),
        tangent.observe(r.tangent, scene, r.cycles, cycles, t, duration),
        section.observe(scene.section, scene, r, cycles, t, duration, x, velocity, deflection),
    )


@absorbed
def _not(condition):
    """Whether a condition does not hold, for floats and Lanes."""
    return select(condition, 0.0, 1.0) > 0.0


@hook(absorb=True)
def _place(scene, r, place):
    """Place to remember, m: without bristles none is needed."""


@_place.implements(Belt)
def _no_place(scene, r, place):
    return r.last.place


@_place.implements(BristleBelt)
def _same_place(scene, r, place):
    return place


@hook(absorb=True)
def _leaves(scene, r, place):
    """Whether the body leaves the play of the bristles, after stick has ended."""


@_leaves.implements(Belt)
def _leaves_at_once(scene, r, place):
    return False


@_leaves.implements(BristleBelt)
def _leaves_play(scene, r, place):
    return abs(place - r.stops.slip_from) > _least_slip(r)


@absorbed
def _least_slip(r):
    """Distance that a slip is longer than, m; negative without bristles, which creep a little before they hold."""
    return select(r.play < 0.0, r.play, max(r.play, RETURN * (r.x_max - r.x_min)))


def _located(before, now):
    """`now`, for methods that locate events; they run with floats."""
    return now


@lanes_body(_located)
def _not_located(before, now):
    return before


@absorbed
def _stops(scene, r, t, duration, stuck, side, place, v, force, span):
    """Stops after an interval in which stick began or ended, or a slip became longer than the play."""
    s, before = r.stops, t - duration
    begins, ends = stuck & (s.side < 0.0), (side < 0.0) & (s.side > 0.0)
    stick_time = s.stick_time + select(ends, before - s.since, 0.0)
    since = select(begins | ends, before, s.since)
    # Within the play of the bristles a stop goes on.
    resumed = s.slip_from == s.slip_from
    anew = begins & _not(resumed)
    scale = _AT_REST * square_root(scene.body.stiffness / scene.body.mass) * span
    rate = select(duration > 0.0, (v - r.last.v) / duration, 0.0)
    slowing = max(abs(r.last.v_rate), abs(rate))
    passage = _PASSAGE * max(max(r.band, scale), abs(r.last.v)) / slowing
    # Under a greater pull than that of breakaway a set-valued law would let the body pass, maybe slowly.
    pull = _located(scene.body.mass * rate + force, r.last.pull)
    passes = abs(pull) > (1.0 + 1e-9) * breakaway_force(scene, r.last.x)
    passage = max(passage, select(passes, square_root(r.band * _pace(scene) / slowing), 0.0))
    start = select(anew, before, s.start)
    least = select(anew, min(_LONGEST_PASSAGE * _pace(scene), passage), s.least)
    slip_from = select(begins, nan, select(ends, r.last.place, s.slip_from))
    slip_start = select(ends, before, s.slip_start)
    slipped = _not(stuck) & (abs(place - slip_from) > _least_slip(r))
    stop = slip_start - start
    counts = slipped & (stop > abs(least))
    return Stops(
        side,
        since,
        stick_time,
        select(slipped, nan, start),
        least,
        select(slipped, nan, slip_from),
        slip_start,
        s.total + select(counts, stop, 0.0),
        s.slips + select(counts, 1.0, 0.0),
        select(counts & (s.slips == 0.0), slip_start, s.first_slip),
    )


@absorbed
def _pace(scene):
    """Natural period or period of the forcing, whichever is shorter, s."""
    return min(2.0 * pi / square_root(scene.body.stiffness / scene.body.mass), scene.forcing_period)


@absorbed
def _cycles(scene, r, stops, t, duration, x, velocity, v, up, down, turn, span):
    """Cycles after an interval in which the velocity changed its sign or a period of the forcing ended."""
    c, last, period = r.cycles, r.last, scene.forcing_period
    due = t >= c.next
    low, high = select(up, min(c.low, turn.x), c.low), select(down, max(c.high, turn.x), c.high)
    # Without forcing a cycle ends where the body is farthest against the motion of the belt: no vibration of bristles
    # in stick disturbs this turn.
    frequency = square_root(scene.body.stiffness / scene.body.mass)
    backward = v - velocity > 1e-6 * frequency * (high - low)
    far = high - low > max(r.play, _ROUNDING * span)
    turns = far & select(backward, down, up) & (period == inf)
    old = Cycles(
        c.count,
        c.next,
        low,
        high,
        c.swing,
        c.swing_before,
        c.drift,
        c.last,
        c.reference,
        c.since,
        c.most,
        c.lap,
        c.period,
        c.share,
        c.stops,
    )
    count = select(due, max(c.count + 1.0, floor(t / period)), c.count + select(turns, 1.0, 0.0))
    ended = due | turns
    if any_of(ended):
        share = select(duration > 0.0, 1.0 - (t - count * period) / duration, 1.0)
        share = select(due, min(max(share, 0.0), 1.0), 1.0)
        x_due = between(last, duration, x, velocity, share)
        t_mark = select(due, count * period, turn.t)
        x_mark = select(due, x_due, turn.x)
        v_mark = select(due, (1.0 - share) * last.velocity + share * velocity, 0.0)
        low, high = select(ended, min(low, x_mark), low), select(ended, max(high, x_mark), high)
        swing = high - low
        stop = select(stops.slip_from == stops.slip_from, min(stops.slip_start, t_mark), t_mark) - stops.start
        total = stops.total + select(stop > abs(stops.least), stop, 0.0)
        near, fast = RETURN * swing, RETURN * swing * (2.0 * pi) / _pace(scene)
        # Without forcing the launch is not the end of a cycle.
        known = due | (c.count > 0.0)
        repeats = known & (abs(x_mark - c.last.x) <= near) & (abs(v_mark - c.last.velocity) <= fast)
        since = c.since + (count - c.count)
        returns = known & (abs(x_mark - c.reference.x) <= near) & (abs(v_mark - c.reference.velocity) <= fast)
        returns = returns | repeats
        # A lap of several cycles need not be closed before its end.
        open_lap = _not(returns) & (since < c.lap)
        lap = select(repeats, 1.0, select(returns, since, select(open_lap, c.lap, 0.0)))
        t_from = select(repeats, c.last.t, c.reference.t)
        total_from = select(repeats, c.last.total, c.reference.total)
        slips_from = select(repeats, c.last.slips, c.reference.slips)
        cycles = select(repeats, count - c.count, since)
        keeps = open_lap | _not(known)
        lost = _not(returns | keeps)
        late = lost & (since >= c.most)
        renew = returns | late | _not(known)
        most = select(late, min(2.0 * c.most, _MOST_CYCLES), c.most)
        mark = Mark(t_mark, x_mark, v_mark, total, stops.slips)
        new = Cycles(
            count,
            (count + 1.0) * period,
            x_mark,
            x_mark,
            swing,
            c.swing,
            (x_mark - c.last.x) / (count - c.count),
            mark,
            select_all(renew, mark, c.reference),
            select(renew, 0.0, since),
            most,
            lap,
            select(returns, (t_mark - t_from) * lap / cycles, select(keeps, c.period, nan)),
            select(keeps, c.share, (total - total_from) / (t_mark - t_from)),
            select(keeps, c.stops, (stops.slips - slips_from) / cycles),
        )
        return select_all(ended, new, old)
    return old


@recorder.conclude.implements(Belt, BristleBelt)
def _conclude(scene, record, status, t, place, velocity):
    r, x = record, place
    section.finish(scene.section, scene, r)
    motion, period, share, stops, settled = _settles_to(scene, r, t)
    if status == BROKEN or not (isfinite(x) and isfinite(velocity)):
        motion = FAILED
    outcome = Outcome(
        float(SEPARATING if status == SEPARATED_1 and motion != FAILED else motion),
        float(motion),
        t,
        x,
        velocity,
        min(r.x_min, x),
        max(r.x_max, x),
        r.velocity_max,
        r.stops.stick_time + (t - r.stops.since if r.stops.side > 0.0 else 0.0),
        r.stops.slips,
        r.stops.first_slip,
        period,
        share,
        stops,
        r.cycles.swing if stops == stops else nan,
        1.0 if settled else 0.0,
        r.force_max,
        *shock.largest(r.shocks),
    )
    return tangent.with_exponent(r.tangent, outcome, scene)


@inlined
def _settles_to(scene, r, t):
    """Word for what the motion settles to, period, share of stick and stops in a cycle, and whether it has settled."""
    c, stops = r.cycles, r.stops
    forced, returned = scene.forcing_period < inf, not isnan(c.period)
    stop = t - stops.start
    in_stop = stop > abs(stops.least)
    # On a belt at rest, or without a spring, the load on a stuck body does not grow.
    belt_velocity = r.last.velocity - r.last.v
    travel = abs(belt_velocity) * scene.span
    ahead = abs(r.last.x) + travel
    stiffness = scene.body.mass * abs(ring.acceleration_gradient(scene.body, 0.0, 0.0, ahead, 0.0, 0.0)[0])
    loads = stiffness * travel > _ROUNDING * 1e-3 * breakaway_force(scene, r.last.x)
    if forced:
        # In stick the body may creep, but the belt does not carry it away.
        for_good = c.share > 1.0 - 1e-9 and abs(c.drift) <= max(RETURN * c.swing, r.band * scene.forcing_period)
    else:
        for_good = not loads
    rests = max(abs(r.last.velocity), abs(r.last.v_rate) * _pace(scene)) <= RETURN * abs(belt_velocity)
    if not forced and in_stop and rests and belt_velocity != 0.0:
        # The belt slides along under a body at rest, below the speed at which its friction no longer grows.
        return SLIDING, nan, 0.0, 0.0, True
    if in_stop and stops.least < 0.0:
        return RIDING, c.period, 1.0, 0.0, for_good
    if in_stop and for_good:
        return STICKING, c.period if forced else nan, 1.0, 0.0, True
    natural = 2.0 * pi / sqrt(scene.body.stiffness / scene.body.mass) if scene.body.stiffness > 0.0 else inf
    slips_since = t - stops.slip_start
    if isnan(c.share) or (not forced and not in_stop and min(slips_since, t - c.last.t) > 2.0 * natural):
        # There is no cycle, or none any more.
        if in_stop or (stops.slips > 0.0 and slips_since < natural):
            return STICK_SLIP, nan, (stops.total + (stop if in_stop else 0.0)) / t, nan, False
        if natural < inf:
            swing = max(r.x_max, r.last.x) - min(r.x_min, r.last.x)
            steady = abs(r.last.velocity) * min(natural, scene.span) <= RETURN * swing
        else:
            steady = abs(r.last.v_rate) * scene.span <= RETURN * abs(r.last.v)
        return SLIDING, nan, 0.0, 0.0, steady
    if c.stops > 0.0 or c.share > 0.0 or (in_stop and not forced):
        return STICK_SLIP, c.period, c.share, c.stops, returned
    if c.swing <= _ROUNDING * (r.x_max - r.x_min):
        return SLIDING, nan, 0.0, 0.0, True
    # At a high frequency even a slow decay per cycle ends the motion within the span.
    decays = not forced and c.lap == 1.0 and abs(c.swing - c.swing_before) * c.count > _DECAY * c.swing
    stays = returned and not decays
    if stays or forced or c.swing >= c.swing_before:
        return OSCILLATORY, c.period if stays else nan, 0.0, 0.0, stays
    return SLIDING, nan, 0.0, 0.0, c.swing <= RETURN * (r.x_max - r.x_min)


@recorder.begin.implements(Belt)
def _begin(scene, t, seen):
    return begin(scene, t, seen, stiction_band(scene.law), -1.0)


@recorder.enter.implements(Belt, BristleBelt)
def _enter(scene, record, t, seen):
    r, shocks = record, shock.enter(record.shocks, t, seen[6])
    return Record(
        r.band,
        r.play,
        r.last,
        r.x_min,
        r.x_max,
        r.velocity_max,
        r.force_max,
        r.stops,
        r.cycles,
        shocks,
        r.tangent,
        r.section,
    )
