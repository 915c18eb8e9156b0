"""Record and outcome of runs on the belt: extremes, stops, cycles, and the word for what the motion settles to.

A *stop* is an interval in which the body sticks to the belt, and stays longer than a motion that only passes or grazes
the speed of the belt. A *cycle* is a period of the forcing, and a natural period if the forcing has none; in a free
motion it lasts from one turn of the displacement to the next of its kind. See :mod:`ringsweep.models.cycles`.

`r` is the record before an observation; `now` is the interval that ends with the observation. Numbers may be vector
lanes, so conditions are written with `select`; where no lane needs it, an ``if any_of(...)`` skips the work.
"""

from __future__ import annotations

from math import inf, isfinite, isnan, nan, pi, sqrt
from typing import Any, NamedTuple

from ringsweep.compile import absorbed, feature, inlined, replacing
from ringsweep.models import cycles, section, tangent
from ringsweep.models.belt.force import at_place, breakaway_force
from ringsweep.models.belt.stops import no_impact
from ringsweep.models.cycles import RETURN, Cycles, Mark
from ringsweep.models.interface import modes, recorder, shock
from ringsweep.models.interface.status import BROKEN, COMPLETE, SEPARATED_1
from ringsweep.models.turn import Interval, between, turn_within
from ringsweep.numerics.functions import any_of, lanes_body, negated, select, square_root
from ringsweep.numerics.memory import select_all
from ringsweep.numerics.terms import joined
from ringsweep.physics import ring
from ringsweep.physics.belt import Belt, BristleBelt
from ringsweep.physics.forces import largest_force
from ringsweep.physics.friction import family
from ringsweep.physics.friction.registry import holds_in_band
from ringsweep.physics.friction.velocity import stiction_band
from ringsweep.quantities.flags import (
    FAILED,
    OSCILLATORY,
    PERIODIC,
    REST,
    RIDING,
    SEPARATING,
    SLIDING,
    STEADY,
    STICK_SLIP,
    STICKING,
    TRANSIENT,
    UNBOUNDED,
)


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
    drift: float
    settled: float
    long_run: float
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
    shocks : Shocks
        Jumps of the acceleration; an empty tuple if the method does not locate events.
    tangent : Tangent
        Growth of small disturbances; an empty tuple if no exponent is asked for.
    section : Points
        Points of the section; an empty tuple if none is asked for.
    at_stop : AtStop
        An empty tuple without end stops.
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
    at_stop: Any


#: Record with another tangent.
with_tangent = replacing("tangent")
_entered, _with_section, _with_shocks = replacing("force_max", "shocks"), replacing("section"), replacing("shocks")
_with_extremes, _with_half = replacing("low", "high"), replacing("next", "half_t", "half_x")
_with_stop, _with_since = replacing("at_stop", "stops"), replacing("since")

# A swing has no bound if it is so many times the scales of the scene, and its growth in a cycle falls by less than the
# second share between two parts of the record.
_BEYOND, _SLOWER = 100.0, 0.01

# A free oscillation has settled if its swing, at the rate of its last cycle, changes by less than this share in a span.
_DECAY = 1e-2

# A stop that counts lasts longer than this factor times the time in which the body would lose its sliding velocity. A
# motion that grazes the speed of the belt stays in the stiction band for four times this time, one that passes for two.
_PASSAGE = 8.0

# Largest such time, in natural periods or periods of the forcing.
_LONGEST_PASSAGE = 0.1

# The sliding velocity is zero within this share of its scale.
_AT_REST = 1e-8

# A body has rested if it has moved by less than this share of the way of its belt.
_AT_ONE_PLACE = 1e-9

# A turn counts if the body has moved farther than this share of the range of its displacement.
_ROUNDING = 1e-6

# A body slides steadily if it moves by less than this share of its displacement: errors of a run are as large.
_UNRESOLVED = 1e-8


@inlined
def record_at_launch(scene, t, seen, band, play):
    """Record at the beginning of a run.

    `band` and `play` are fields of :class:`Record`; `seen` is described at :func:`_observe_on_belt`.
    """
    x, velocity, force, place, v, v_rate, acceleration, _ = seen
    start, end = Mark(t, x, velocity, 0.0, 0.0), cycles.end_of(scene, scene.cycle, 1.0)
    # The body counts as stuck until it slips: the first stop begins with the run. If the pull exceeds breakaway, it may
    # pass the stiction band at once.
    way, here = scene.body.mass * v_rate + force, at_place(scene.surface, scene, x, x - place)
    pull = max(abs(way), abs(scene.body.stiffness * x))
    passes = band > 0.0 and pull > (1.0 + 1e-9) * breakaway_force(here, way, x)
    least = min(_LONGEST_PASSAGE * _pace(scene), _PASSAGE * band * scene.body.mass / pull) if passes else 0.0
    return Record(
        band,
        play,
        Last(t, x, velocity, place, v, _if_known(acceleration, v_rate), way),
        x,
        x,
        velocity,
        abs(force),
        Stops(1.0, t, 0.0, t, -max(least, 1e-300), nan, t, 0.0, 0.0, nan),
        # The record waits for the end of a cycle, or for the middle of a span that is not as long.
        cycles.none_yet(scene.excited, end if end <= scene.span else 0.5 * scene.span, start),
        shock.at_launch(acceleration),
        tangent.undisturbed(scene.asked, scene, t),
        (),
        no_impact(scene.stops),
    )


@feature("0.0")
def _if_known(acceleration, v_rate):
    """Rate of the sliding velocity that holds until the next observation; methods of constant step tell none."""
    return v_rate


@feature("0.0", absorb=True)
def _turning(at_stop, now):
    """Velocity at a turn, m/s, that tells turns at one place apart: a stop is where the body rebounds."""
    return now.velocity if now.duration == 0.0 else 0.0


@feature("fast", absorb=True)
def _fastest(at_stop, fast, velocity):
    """Velocity, m/s, that counts as much as a swing: `fast`, or that of a rebound."""
    return max(fast, abs(velocity))


@feature("(False, False)", absorb=True)
def _at_stops(at_stop):
    """Whether a body cannot slide on for ever, since there are stops; and whether it rests at one."""
    return True, at_stop.rests != 0


@recorder.lend.implements(Belt, BristleBelt)
def _lend_on_belt(scene, record, row):
    """Implement :func:`recorder.lend`: points of the section are stored in the row of the run."""
    return _with_section(record, section.lent(scene.section, record, row, (nan,)))


@recorder.observe.implements(Belt, BristleBelt)
def _observe_on_belt(scene, record, t, duration, stuck, seen):
    """Implement :func:`recorder.observe`.

    `seen` is displacement (m), velocity in space (m/s), friction (N), displacement relative to the belt (m), sliding
    velocity (m/s) and its rate (m/s^2), ``shock.Located`` or an empty tuple, and deflection (m; NaN without bristles).
    """
    # In most steps nothing turns, begins or ends.
    r = record
    x, velocity, force, place, v, v_rate, acceleration, deflection = seen
    now = Interval(t, duration, x, velocity)
    stops, cycles_now, x_min, x_max = r.stops, r.cycles, r.x_min, r.x_max
    place = _place(scene, r, place)
    side = select(stuck, 1.0, -1.0)
    if any_of((side * stops.side < 0.0) | _leaves(scene, r, place)):
        stops = _stops(scene, r, now, stuck, place, (v, v_rate), force)
    if any_of((r.last.velocity * velocity <= 0.0) | cycles.is_due(cycles_now, t)):
        turn = turn_within(r.last, now)
        x_min = select(turn.is_least, min(x_min, turn.x), x_min)
        x_max = select(turn.is_greatest, max(x_max, turn.x), x_max)
        cycles_now = _cycles(scene, r, stops, now, v, turn, max(x_max, x) - min(x_min, x))
    return Record(
        r.band,
        r.play,
        Last(
            _if_located(r.last.t, t),
            x,
            velocity,
            place,
            v,
            _if_located(r.last.v_rate, v_rate),
            _if_located(r.last.pull, scene.body.mass * v_rate + force),
        ),
        x_min,
        x_max,
        max(r.velocity_max, velocity),
        max(r.force_max, abs(force)),
        stops,
        cycles_now,
        shock.without_event(r.shocks, acceleration),
        tangent.observed(r.tangent, scene, r.cycles, cycles_now, t, duration),
        section.with_point(scene.section, scene, r, cycles_now, now, (deflection,), _least_turn(r, r.x_max - r.x_min)),
        r.at_stop,
    )


@feature("r.last.place", of=BristleBelt, absorb=True)
def _place(scene, r, place):
    """Place to remember, m: without bristles none is needed."""
    return place


@feature("False", of=BristleBelt, absorb=True)
def _leaves(scene, r, place):
    """Whether the body leaves the play of the bristles, after stick has ended; never without bristles."""
    return abs(place - r.stops.slip_from) > _least_slip(r)


@absorbed
def _least_slip(r):
    """Distance by which a body must move to have slipped, m; negative without bristles: any motion is slip."""
    return select(r.play < 0.0, r.play, max(r.play, RETURN * (r.x_max - r.x_min)))


@absorbed
def _least_turn(r, span):
    """Distance between turns that count, m; `span` is the range of the displacement."""
    return max(r.play, _ROUNDING * span)


def _if_located(before, now):
    """`now`, the form for floats: methods that locate events know the present value exactly."""
    return now


@lanes_body(_if_located)
def _if_located_in_lanes(before, now):
    """`before`, the form for vector lanes: methods of constant step need no time or pull, and keep the old one."""
    return before


def _rate(by_difference, v_rate):
    """Rate of the sliding velocity, m/s^2: `v_rate` if the method knows it, else the one by difference."""
    return v_rate if v_rate != 0.0 else by_difference


@lanes_body(_rate)
def _rate_in_lanes(by_difference, v_rate):
    """The rate by difference: methods of constant step know no other."""
    return by_difference


@absorbed
def _stops(scene, r, now, stuck, place, sliding, force):
    """Stops after an interval in which stick began or ended, or a slip became longer than the play.

    `sliding` are the sliding velocity and its rate.
    """
    v, v_rate = sliding
    s, before, side = r.stops, now.t - now.duration, select(stuck, 1.0, -1.0)
    begins, ends = stuck & (s.side < 0.0), (side < 0.0) & (s.side > 0.0)
    stick_time = s.stick_time + select(ends, before - s.since, 0.0)
    since = select(begins | ends, before, s.since)
    # Within the play of the bristles a stop goes on.
    resumed = s.slip_from == s.slip_from
    anew = begins & negated(resumed)
    span = max(r.x_max, now.x) - min(r.x_min, now.x)
    scale = _AT_REST * square_root(scene.body.stiffness / scene.body.mass) * span
    rate = select(now.duration > 0.0, (v - r.last.v) / now.duration, 0.0)
    slowing = max(abs(r.last.v_rate), abs(_rate(rate, v_rate)))
    passage = _PASSAGE * max(max(r.band, scale), abs(r.last.v)) / slowing
    # Under a greater pull than that of breakaway a set-valued law would let the body pass, maybe slowly.
    pull = _if_located(scene.body.mass * rate + force, r.last.pull)
    passes = abs(pull) > (1.0 + 1e-9) * breakaway_force(scene, pull, r.last.x)
    passage = max(passage, select(passes, square_root(r.band * _pace(scene) / slowing), 0.0))
    # An impact that stops the body, which takes no time, is no passage.
    passage = select(now.duration > 0.0, passage, 0.0)
    start = select(anew, before, s.start)
    least = select(anew, min(_LONGEST_PASSAGE * _pace(scene), passage), s.least)
    slip_from = select(begins, nan, select(ends, r.last.place, s.slip_from))
    slip_start = select(ends, before, s.slip_start)
    slipped = negated(stuck) & (abs(place - slip_from) > _least_slip(r))
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
def _cycles(scene, r, stops, now, v, turn, span):
    """Cycles after an interval in which the velocity changed its sign or a time came that the record waits for."""
    c, last, period = r.cycles, r.last, scene.cycle
    due = cycles.is_due(c, now.t)
    # Before a cycle has ended, this may be the middle of the span.
    halfway = due & (c.next < cycles.end_of(scene, period, 1.0))
    due = due & negated(halfway)
    if any_of(halfway):
        share = select(now.duration > 0.0, 1.0 - (now.t - c.next) / now.duration, 1.0)
        c = select_all(halfway, _with_half(c, period, c.next, between(last, now, share)), c)
    count = select(due, cycles.number_at(c, period, now.t), c.count)
    # A turn after the end of a cycle is of the next one.
    later = due & (turn.t > count * period)
    low = select(turn.is_least & negated(later), min(c.low, turn.x), c.low)
    high = select(turn.is_greatest & negated(later), max(c.high, turn.x), c.high)
    # Without forcing a cycle ends where the body is farthest against the motion of the belt: no vibration of bristles
    # in stick disturbs this turn.
    backward = v > now.velocity
    # At the other turn rounding may let the velocity change its sign twice: the body has not moved since then.
    moved = select(backward, turn.x - low, high - turn.x)
    turns = (moved > _least_turn(r, span)) & select(backward, turn.is_greatest, turn.is_least) & (period == inf)
    old = _with_extremes(c, low, high)
    count, ended = count + select(turns, 1.0, 0.0), due | turns
    if any_of(ended):
        share = select(now.duration > 0.0, 1.0 - (now.t - count * period) / now.duration, 1.0)
        share = select(due, min(max(share, 0.0), 1.0), 1.0)
        x_due = between(last, now, share)
        t_mark = select(due, count * period, turn.t)
        x_mark = select(due, x_due, turn.x)
        v_mark = select(due, (1.0 - share) * last.velocity + share * now.velocity, _turning(r.at_stop, now))
        low, high = select(ended, min(low, x_mark), low), select(ended, max(high, x_mark), high)
        swing = high - low
        stop = select(stops.slip_from == stops.slip_from, min(stops.slip_start, t_mark), t_mark) - stops.start
        total = stops.total + select(stop > abs(stops.least), stop, 0.0)
        fast = _fastest(r.at_stop, swing * (2.0 * pi) / _pace(scene), v_mark)
        mark = Mark(t_mark, x_mark, v_mark, total, stops.slips)
        # Without forcing the launch is not the end of a cycle.
        new = cycles.closed(scene, c, mark, count, due | (c.count > 0.0), swing, fast, period)
        low = select(later & turn.is_least, min(new.low, turn.x), new.low)
        high = select(later & turn.is_greatest, max(new.high, turn.x), new.high)
        return select_all(ended, _with_extremes(new, low, high), old)
    return old


@recorder.conclude.implements(Belt, BristleBelt)
def _conclude_on_belt(scene, record, status, t, place, velocity):
    """Implement :func:`recorder.conclude`: the numbers of :class:`Outcome`, and what the scene asks for besides."""
    r = record
    x, velocity = _held(r.at_stop, scene, place, velocity)
    if r.x_max - r.x_min <= _AT_ONE_PLACE * abs(r.last.velocity - r.last.v) * t:
        r = with_tangent(r, tangent.at_rest(r.tangent, t - r.cycles.reference.t))
    if holds_in_band(scene.law) and r.band > 0.0:
        # The state holds the momentum, which moves nothing in a dead band.
        velocity = r.last.velocity
    section.put_in_order(scene.section, r.section)
    motion, long_run, period, share, stops, drift = _settles_to(scene, r, t)
    if status == BROKEN or not (isfinite(x) and isfinite(velocity)):
        motion = FAILED
    if status != COMPLETE or motion == FAILED:
        long_run = TRANSIENT
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
        drift,
        0.0 if long_run in (TRANSIENT, UNBOUNDED) else 1.0,
        float(long_run),
        r.force_max,
        *shock.largest_jump(r.shocks),
    )
    return tangent.with_exponent(r.tangent, _with_impacts(r.at_stop, outcome), period, scene)


@feature("x, velocity")
def _held(at_stop, scene, x, velocity):
    """Displacement, m, and velocity, m/s, of a body that may rest at a stop: exactly there, and exactly zero."""
    if at_stop.rests == 0:
        return x, velocity
    return scene.stops.high if at_stop.rests > 0 else scene.stops.low, 0.0


@feature("outcome")
def _with_impacts(at_stop, outcome):
    """Outcome, and behind it the number of impacts and the largest speed before one, m/s."""
    return joined(outcome, (at_stop.impacts, at_stop.speed_max))


@inlined
def _settles_to(scene, r, t):
    """Words for the motion and for what it settles to, period, share of stick and stops in a cycle, mean velocity."""
    c, forced, repeats = r.cycles, scene.cycle < inf, scene.forcing_period < inf
    fast = _fastest(r.at_stop, c.swing * (2.0 * pi) / _pace(scene), c.reference.velocity)
    growth = tangent.exponent(r.tangent)
    returns = (repeats or not forced) and cycles.returns_each_time(
        scene, c, forced, fast, tangent.largest_multiplier(r.tangent), growth
    )
    period, share, stops_per_cycle, swing = c.period if returns else nan, c.share, c.stops, c.swing
    drift = (r.last.x - c.half_x) / (t - c.half_t) if t > c.half_t else r.last.velocity
    if returns:
        drift = c.drift
    elif forced:
        means = share, stops_per_cycle, swing, drift
        share, stops_per_cycle, swing, drift = _of_last_cycles(c.parts, c, repeats, means)
    words = _words(scene, r, t, (returns, period, share, stops_per_cycle, swing, drift))
    return *words, drift


@feature("means")
def _of_last_cycles(parts, c, repeats, means):
    """``(share, stops, swing, drift)`` of the last half of the cycles: share of stick; stops in a cycle; m; m/s.

    `means` are the same of all cycles, which are returned if there are no halves.
    """
    before = parts.before
    if c.count <= before.count:
        return means
    # The last cycles before the end differ from those before another end.
    cycles_since, first, last = c.count - before.count, before.mark, c.last
    swing = c.swing if repeats else (parts.sum - before.sum) / cycles_since
    share, stops = (last.total - first.total) / (last.t - first.t), (last.slips - first.slips) / cycles_since
    return share, stops, swing, (last.x - first.x) / (last.t - first.t)


@inlined
def _words(scene, r, t, of):
    """``(motion, long_run, period, share, stops)``: two words, s, share of stick, stops in a cycle.

    `of` are what the cycles tell: whether the motion returns, period, share, stops, swing and mean velocity.
    """
    c, stops = r.cycles, r.stops
    returns, period, share, stops_per_cycle, swing, drift = of
    forced, repeats = scene.cycle < inf, scene.forcing_period < inf
    stop = t - stops.start
    in_stop = stop > abs(stops.least)
    # On a belt at rest, or without a spring, the load on a stuck body does not grow.
    belt_velocity = r.last.velocity - r.last.v
    travel = abs(belt_velocity) * scene.span
    ahead = abs(r.last.x) + travel
    stiffness = scene.body.mass * abs(ring.acceleration_gradient(scene.body, 0.0, 0.0, (ahead, 0.0, 0.0))[0])
    loads = stiffness * travel > _ROUNDING * 1e-3 * breakaway_force(scene, 0.0, r.last.x)
    if forced:
        # In stick the body may creep, but the belt does not carry it to where the spring pulls it loose.
        stuck, carried = (c.share, c.drift) if repeats else (share, drift)
        carried = abs(carried) * scene.cycle * scene.place_counts
        # A slip may be ever so short beside its cycle.
        stays = stuck > 1.0 - 1e-9 and stops_per_cycle == 0.0
        for_good = stays and carried <= max(RETURN * swing, r.band * scene.cycle)
    else:
        for_good = not loads
    # A stuck body that moves goes with its belt.
    moves = forced and swing > max(r.play, r.band * scene.cycle)
    held = REST if not moves else PERIODIC if repeats else _without_return(r.cycles.parts, scene, r)
    growth, error = tangent.exponent(r.tangent)
    # A small disturbance of an unstable equilibrium grows: the body does not stay there.
    still = TRANSIENT if growth > cycles.POSITIVE * error else STEADY if belt_velocity != 0.0 else REST
    rests = max(abs(r.last.velocity), abs(r.last.v_rate) * _pace(scene)) <= RETURN * abs(belt_velocity)
    if not forced and in_stop and rests and belt_velocity != 0.0:
        # The belt slides along under a body at rest, below the speed at which its friction no longer grows.
        return SLIDING, still, nan, 0.0, 0.0
    between_stops, at_stop = _at_stops(r.at_stop)
    if not forced and at_stop and belt_velocity != 0.0:
        return SLIDING, still, nan, 0.0, 0.0
    if in_stop and (for_good or stops.least < 0.0):
        motion = RIDING if stops.least < 0.0 else STICKING
        # Whether states of a slow creep return within their tolerance does not matter.
        period = scene.forcing_period if for_good and repeats else nan
        return motion, held if for_good else TRANSIENT, period, 1.0, 0.0
    natural = 2.0 * pi / sqrt(scene.body.stiffness / scene.body.mass) if scene.body.stiffness > 0.0 else inf
    slips_since = t - stops.slip_start
    if isnan(c.share) or (not forced and not in_stop and min(slips_since, t - c.last.t) > 2.0 * natural):
        # There is no cycle, or none any more.
        if in_stop or (stops.slips > 0.0 and slips_since < natural):
            return STICK_SLIP, TRANSIENT, nan, (stops.total + (stop if in_stop else 0.0)) / t, nan
        if natural < inf or between_stops:
            far = max(r.x_max, r.last.x) - min(r.x_min, r.last.x)
            steady = abs(r.last.velocity) * min(natural, scene.span) <= max(RETURN * far, _UNRESOLVED * abs(r.last.x))
        else:
            steady = abs(r.last.v_rate) * scene.span <= RETURN * abs(r.last.v)
        return SLIDING, still if steady and not forced else TRANSIENT, nan, 0.0, 0.0
    long_run = PERIODIC if returns else _without_return(r.cycles.parts, scene, r)
    if stops_per_cycle > 0.0 or share > 0.0 or (in_stop and not forced):
        return STICK_SLIP, long_run, period, share, stops_per_cycle
    if scene.place_counts > 0.0 and swing <= max(_ROUNDING * (r.x_max - r.x_min), _UNRESOLVED * abs(r.last.x)):
        return SLIDING, still, nan, 0.0, 0.0
    # At a high frequency even a slow decay per cycle ends the motion within the span.
    decays = not forced and c.lap == 1.0 and abs(c.swing - c.swing_before) * c.count > _DECAY * c.swing
    stays = not isnan(c.period) and not decays
    if stays or forced or c.swing >= c.swing_before:
        lasts = (stays and returns) or long_run != PERIODIC
        return OSCILLATORY, long_run if lasts else TRANSIENT, period if stays else nan, 0.0, 0.0
    return SLIDING, still if c.swing <= RETURN * (r.x_max - r.x_min) else TRANSIENT, nan, 0.0, 0.0


@feature("TRANSIENT")
def _without_return(parts, scene, r):
    """What a motion that does not return settles to, as far as two parts of its record and its exponent tell."""
    c = r.cycles
    begin_1, begin_2 = cycles.compared(c)
    first, second = begin_2.count - begin_1.count, c.count - begin_2.count
    if scene.cycle == inf or first < 1.0:
        return TRANSIENT
    stiffness = scene.body.stiffness
    force = largest_force(scene.drive) + breakaway_force(scene, 0.0, 0.0)
    scale = force / stiffness + abs(r.last.velocity - r.last.v) * _pace(scene) if stiffness > 0.0 else inf
    growth = (begin_2.swing - begin_1.swing) / first
    if c.swing > _BEYOND * scale and growth > 0.0:
        slower = (c.swing - begin_2.swing) / second < (1.0 - _SLOWER) * growth
        return TRANSIENT if slower else UNBOUNDED
    repeats = scene.forcing_period < inf
    return cycles.without_return(c, repeats, scene.cycle, tangent.exponent(r.tangent))


@recorder.begin.implements(Belt)
def _begin_record_on_belt(scene, t, seen):
    """Implement :func:`recorder.begin`, for the stiction band of the law."""
    return record_at_launch(scene, t, seen, stiction_band(scene.law), -1.0)


@recorder.after_event.implements(Belt)
def _after_event_on_belt(scene, record, before, mode, t):
    """Implement :func:`recorder.after_event`: under a smooth law the acceleration jumps at the edge of a zone alone."""
    if before.place != mode.place:
        return record
    record = _with_shocks(record, shock.without_jump(family(scene.law), record.shocks))
    return _after_impact(mode.stop, scene, record, mode, t)


@recorder.after_event.implements(BristleBelt)
def _after_event_on_bristle_belt(scene, record, before, mode, t):
    """Implement :func:`recorder.after_event`."""
    return _after_impact(mode.stop, scene, record, mode, t)


@feature("record")
def _after_impact(stop, scene, record, mode, t):
    """Record of a body between stops after an event: an impact is an observation that lasts no time."""
    r, last = record, record.last
    if stop.impacts == r.at_stop.impacts:
        return _with_stop(r, stop, r.stops)
    low, high, rate = scene.stops.low, scene.stops.high, last.v_rate
    x = high if high - last.x < last.x - low else low
    v, force = last.v + (stop.velocity - last.velocity), last.pull - scene.body.mass * rate
    seen = x, stop.velocity, force, last.place, v, rate, shock.Located(nan, 0.0), _deflection(r.section)
    r = recorder.observe(scene, r, t, 0.0, modes.sticks(scene, mode), seen)
    # Stick on a belt at rest begins as the last rebounds end.
    return _with_stop(r, stop, _with_since(r.stops, r.stops.since + stop.lasts))


@feature("nan")
def _deflection(section):
    """Deflection at the last observation, m; NaN if it is not known, or without bristles."""
    return section.deflections[0]


@recorder.enter.implements(Belt, BristleBelt)
def _enter_record_on_belt(scene, record, t, seen):
    """Implement :func:`recorder.enter`: extremes of friction, and jumps of the acceleration."""
    # Friction may jump at an event, and both limits count.
    return _entered(record, max(record.force_max, abs(seen[2])), shock.with_jump(record.shocks, t, seen[6]))
