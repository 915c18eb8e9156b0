"""What follows a lost contact: the body pivots on one contact, flies, hits the race, and closes its contacts again.

As long as both contacts hold, :func:`benchmarks.reference.run.advance` runs the body. On one contact the motion is
integrated by the same method, with four states; in flight it is a parabola with a constant spin. After each impact, and
wherever friction jumps, the contact problem is solved for the contacts that touch and neither open nor close.

Rebounds that shrink geometrically end at a speed `rest`, below which an impact is plastic. The impulse that is left is
the same, so what the truncation costs is of second order in that speed. A contact that such an impact lifts more slowly
than that stays closed.
"""

import math

import numpy as np
from numba import njit

from benchmarks.reference import free
from benchmarks.reference.physics import (
    BACKWARD,
    CLOSED,
    FORWARD,
    JAMMED,
    LEAST_DETERMINANT,
    ONLY_1,
    ONLY_2,
    OPEN_1,
    OPEN_2,
    OPEN_BOTH,
    STICK,
    bound,
    corners,
    drive,
    friction,
    is_set_valued,
    lower_segments,
    on_one,
    piece_of,
    rates,
    resting_problem,
    segment,
    sliding_problem,
)
from benchmarks.reference.problem import JUMP, POWER, SINGLE, SINUSOIDAL, TABLE
from benchmarks.reference.radau import NODES, attempt, interpolate, jacobian
from benchmarks.reference.run import EARLIEST, HELD, SAMPLES, UNRESOLVED, advance, run

#: Return values of :func:`follow`, in this order. `tumbles` counts changes of order between instants at which both
#: contacts touch; `passages` counts how often the rod passes over the axis.
AFTERMATH = (
    "end", "t_end", "position", "speed", "open_time", "flight_time", "gap_max", "separations", "impacts",
    "impact_speed_max", "impulse_max", "impact_loss", "passages", "tumbles", "t_recovered", "closed", "steps", "events",
)  # fmt: skip
#: Kinds of events in a log, whose rows are (time, kind, contact, speed, impulse).
LOSS, HIT = 1, 2
#: Results of a pivot, beside the ends of a run: the other contact closes, or the closed contact opens.
MEETS, LOSES = 11, 12
#: A gap below this share of the radius, times angles, has closed: rounding leaves less.
TOUCH = 1e-14
MOST_EVENTS = 5_000
#: A (times the mass) of a contact that jams while its reaction grows. The reaction slows the slip down. Where friction
#: is constant, slip falls with the logarithm of A: it ends at a small A, but before A vanishes. Where friction falls
#: with the speed, A vanishes. Where it rises, A stays near gravity over the acceleration of the ring.
LEAST_A = 1e-13
#: Reaction, in weights, that grows while A vanishes. The reaction is the load over A: at LEAST_DETERMINANT, 1e-6, more
#: than GROWN weights mean a load of more than a thousandth of the weight. Of 400 random scenes with impacts (222 lose a
#: contact) none has another word at 10, 1e5 or 1e8.
GROWN = 1e3
#: Rebounds of both contacts in turn shrink together. Once one contact has come to rest in this way, the other one does
#: so at this multiple of the speed: what its impact does while the first one rests is no part of the row. From one hit
#: to the next the speed falls by some factor, so 10 covers rows in which a hit has at least a tenth of the speed of the
#: one before. Of 1000 random scenes with impacts (540 lose a contact) none has another word at 1, 2, 5 or 30, and the
#: angle at the end moves by at most 2.2e-6 rad.
ROW = 10.0
_N, _A, _GAP, _SLOWER, _FASTER, _LOW, _HIGH, _STICK, _COUNT = range(9)


@njit(cache=True, error_model="numpy")
def order(p, q):
    """Sine of the angle from ball 1 to ball 2 seen from the axis; it changes its sign in a tumble."""
    _, ux, uy, _, _ = free.ball(p, q, 1)
    _, wx, wy, _, _ = free.ball(p, q, 2)
    return ux * wy - uy * wx


@njit(cache=True, error_model="numpy")
def touch(p, t, q):
    """Gap that counts as closed: rounding leaves less."""
    return TOUCH * p.radius * (1.0 + abs(q[2]) + abs(drive(p, t)[0]))


@njit(cache=True, error_model="numpy")
def place_of(p, closed, t, y):
    """Segment of the closed contact; on an edge the one that it moves into."""
    x, ring_omega = y[0], drive(p, t)[1]
    k = segment(p, x + 2e-14)
    onward = y[2] - p.ball_radius * (y[3] - ring_omega)
    return k - 1 if onward < 0.0 and x - bound(p, k) < 2e-14 else k


@njit(cache=True, error_model="numpy")
def other_gap(p, closed, t, q, N, T):
    """Acceleration of the gap of the open contact."""
    epsilon = drive(p, t)[2]
    fx, fy, moment = free.load(p, q, closed, N, T)
    return free.acceleration(p, q, epsilon, fx, fy, moment, 3 - closed)[0]


@njit(cache=True, error_model="numpy")
def pivot_problem(p, closed, k, piece, t, y, opens, breaks=False):
    """Contact problem of a body on one contact: the piece of slip, STICK, LOSES or JAMMED (above 5).

    With `opens` the other contact has just been lost: its gap must open by its acceleration, which is zero where a
    reaction has reached zero. With `breaks` friction has reached its limit, and the body does not stick.
    """
    q, shut = np.empty(6), -1e-6 * p.gravity
    if not (is_set_valued(p) and y[2] == 0.0):
        N, _, _, _, _, A = on_one(p, closed, k, piece, t, y, q)
        if not A > LEAST_A:
            return JAMMED
        return LOSES if N <= 0.0 else STICK
    N, T, _, _, _, _ = on_one(p, closed, k, STICK, t, y, q)
    limit = p.mu_s[k % p.edges.size] * N
    if not breaks and N > 0.0 and abs(T) <= limit and not (opens and other_gap(p, closed, t, q, N, T) < shut):
        return STICK
    found = JAMMED
    for sense in (FORWARD, BACKWARD):
        N, T, slide, _, _, A = on_one(p, closed, k, sense, t, y, q)
        if N > 0.0 and sense * slide > 0.0 and not (opens and other_gap(p, closed, t, q, N, T) < shut):
            if not A > LEAST_A:
                # In such a slip a reaction of any other size would run away from this one: the contact opens.
                continue
            if found != JAMMED:
                return JAMMED
            found = sense
    if found == JAMMED and free.acceleration(p, q, drive(p, t)[2], 0.0, 0.0, 0.0, closed)[0] > 0.0:
        return LOSES
    return found


@njit(cache=True, error_model="numpy")
def rises(p, k, piece, v):
    """Whether friction rises with the speed of sliding. Then no contact jams, however small A may become."""
    return abs(friction(p, k, piece, 1.000001 * v, 0.0)[0]) > abs(friction(p, k, piece, v, 0.0)[0])


@njit(cache=True, error_model="numpy")
def pivot_guard(p, closed, k, piece, t, y, g, q):
    """Write to g the guards of a body on one contact, which must stay positive."""
    N, T, _, _, _, A = on_one(p, closed, k, piece, t, y, q)
    weight = p.mass * p.gravity
    g[:] = 1.0
    # Where the load vanishes with A, the reaction does not grow, and rounding soon decides its sign.
    g[_N], g[_A] = N / weight, A - (LEAST_A if GROWN * weight < N else LEAST_DETERMINANT)
    gap, opens, _ = free.contact(p, q, 0.0, 3 - closed)
    g[_GAP] = gap + touch(p, t, q)
    if opens >= 0.0:
        g[_GAP] = max(g[_GAP], 1e-300)
    g[_LOW], g[_HIGH] = y[0] - bound(p, k) + 1e-14, bound(p, k + 1) - y[0] + 1e-14
    if piece == STICK:
        g[_STICK] = (p.mu_s[k % p.edges.size] * N - abs(T)) / weight
        return
    speed = y[2] if piece > 0 else -y[2]
    low, high = corners(p, piece)
    slack = 0.0 if is_set_valued(p) else 1e-12 * (abs(low) if low != 0.0 else (high if high < math.inf else 1e-6))
    g[_SLOWER] = speed - low + slack
    if high < math.inf:
        g[_FASTER] = high - speed + 1e-12 * high


@njit(cache=True, error_model="numpy")
def pivot_root(p, closed, k, piece, t, h, y, Z, low, high, which, g, y_, q):
    """Share of a step, between two shares, at which a guard (any guard if `which` is negative) reaches zero."""
    y_[:] = y
    for _ in range(60):
        middle = 0.5 * (low + high)
        if not low < middle < high:
            break
        interpolate(y, Z, middle, 4, y_)
        pivot_guard(p, closed, k, piece, t + middle * h, y_, g, q)
        if (g[which] if which >= 0 else g.min()) <= 0.0:
            high = middle
        else:
            low = middle
    return high


@njit(cache=True, error_model="numpy")
def watch(p, i, q, seen, found):
    """Track the greatest gap of contact i (`seen` holds its last two values) and the passages of the rod."""
    gap = free.contact(p, q, 0.0, i)[0]
    older, last = seen[2 * i - 2], seen[2 * i - 1]
    found[0] = max(found[0], gap)
    bend = older - 2.0 * last + gap
    if last > older and last > gap and bend < 0.0:
        found[0] = max(found[0], last - 0.125 * (gap - older) ** 2 / bend)
    seen[2 * i - 2], seen[2 * i - 1] = last, gap
    if p.model != SINGLE:
        side = order(p, q)
        if side * found[2] < 0.0:
            found[1] += 1.0
        if side != 0.0:
            found[2] = side


@njit(cache=True, error_model="numpy")
def turn(p, closed, rtol, most_steps, t, y, opens, found):
    """Run a body that pivots on one contact; y is overwritten.

    Returns the end (MEETS, LOSES, JAMMED, HELD at the end of the span, UNRESOLVED), its time, and the steps.
    """
    set_valued, span = is_set_valued(p), p.span
    y_, f, q, g = np.zeros(4), np.zeros(4), np.zeros(6), np.zeros(_COUNT)
    Z, Z_, previous = np.zeros((3, 4)), np.zeros((3, 4)), np.zeros(4)
    J, A, order_, b, work = np.zeros((4, 4)), np.zeros((12, 12)), np.zeros(12, np.int64), np.zeros(12), np.zeros((4, 4))
    G, scale, seen = np.zeros((SAMPLES + 2, _COUNT)), np.ones(4), np.full(4, math.nan)
    scale[3] = 0.1 * math.sqrt(p.gravity / p.radius)
    slow = 1e-2 * p.radius
    for v in (p.v0, p.v_s):
        if v > 0.0:
            slow = min(slow, v)
    k = place_of(p, closed, t, y)
    piece = piece_of(p, y[2])
    mode = pivot_problem(p, closed, k, piece, t, y, opens)
    if set_valued and y[2] == 0.0:
        piece = mode
    if mode > FORWARD:
        return mode, t, 0
    # A small hop is over soon.
    N, T, _, _, _, _ = on_one(p, closed, k, piece, t, y, q)
    _, rate, _ = free.contact(p, q, 0.0, 3 - closed)
    hop = 2.0 * max(rate, 0.0) / max(abs(other_gap(p, closed, t, q, N, T)), 1e-300)
    h, before, steps = 1e-6 if rate <= 0.0 else max(min(1e-4, 0.3 * hop), 1e-12), 0.0, 0
    while t < span:
        if steps > most_steps:
            return UNRESOLVED, t, steps
        longest = min(span / 20.0, 0.1 * min(math.sqrt(p.radius / p.gravity), 1.0 / max(abs(y[3]), 1e-3)))
        if p.drive == SINUSOIDAL:
            longest = min(longest, 0.05 / p.frequency)
        limit = span
        if p.drive == TABLE:
            for knot in p.knots:
                if knot > t + 1e-12:
                    limit = min(limit, knot)
                    break
        scale[2] = abs(y[2]) + slow
        scale[3] = abs(y[3]) + 0.1 * math.sqrt(p.gravity / p.radius)
        rates(p, closed, k, k, piece, t, y, f)
        jacobian(p, closed, k, k, piece, t, y, f, scale, 4, J, work)
        error = math.inf
        while True:
            h = min(h, longest)
            last = t + h >= limit - 1e-13 * span
            step = limit - t if last else h
            for i in range(3):
                Z_[i] = 0.0
                if before > 0.0:
                    interpolate(previous, Z, 1.0 + NODES[i] * step / before, 4, y_)
                    Z_[i] = y_ - y
            error = attempt(p, closed, k, k, piece, t, step, y, f, J, scale, rtol, 4, Z_, A, order_, b, work)
            steps += 1
            if error <= 1.0 or step < 1e-17 or steps > most_steps:
                break
            before = 0.0
            h = step * (0.1 if error == math.inf else max(0.1, 0.9 * error**-0.25))
        if not error <= 1.0:
            return (JAMMED if step < 1e-17 and not rises(p, k, piece, y[2]) else UNRESOLVED), t, steps
        hit, at = -1, 1.0
        for i in range(SAMPLES + 2):
            x = i / SAMPLES
            interpolate(y, Z_, x, 4, y_)
            pivot_guard(p, closed, k, piece, t + x * step, y_, G[i], q)
            if i >= 2:
                for c in (_N, _A, _GAP, _SLOWER, _STICK):
                    a0, a1, a2 = G[i - 2, c], G[i - 1, c], G[i, c]
                    if hit < 0 and a1 < a0 and a1 < a2 and a1 > 0.0 and a2 > 0.0 and (c != _SLOWER or set_valued):
                        bend = a0 - 2.0 * a1 + a2
                        if a1 - 0.125 * (a2 - a0) ** 2 / bend <= 0.0:
                            x0 = x + (-1.0 - 0.5 * (a2 - a0) / bend) / SAMPLES
                            interpolate(y, Z_, x0, 4, y_)
                            pivot_guard(p, closed, k, piece, t + x0 * step, y_, g, q)
                            if g[c] <= 0.0 and x0 <= 1.0:
                                at = pivot_root(
                                    p, closed, k, piece, t, step, y, Z_, x0 - 1.0 / SAMPLES, x0, c, g, y_, q
                                )
                                hit = c
            if hit >= 0 or i > SAMPLES:
                break
            if i > 0 and G[i].min() <= 0.0:
                at = pivot_root(p, closed, k, piece, t, step, y, Z_, (i - 1) / SAMPLES, x, -1, g, y_, q)
                interpolate(y, Z_, at, 4, y_)
                pivot_guard(p, closed, k, piece, t + at * step, y_, g, q)
                hit = np.argmin(g > 0.0)
                break
            if i > 0:
                watch(p, 3 - closed, q, seen, found)
        if hit < 0:
            previous[:] = y
            interpolate(y, Z_, 1.0, 4, y_)
            y[:] = y_
            if piece == STICK:
                y[2] = 0.0
            Z[:], before = Z_, step
            t = limit if last else t + step
            h = step * min(4.0, max(0.3, 0.9 * max(error, 1e-12) ** -0.25)) if not last else h
            continue
        # Repeat the step up to the event, so that its position has no interpolation error.
        part = at * step
        for _ in range(3):
            if part <= 1e-16 * t:
                break
            for i in range(3):
                interpolate(y, Z_, NODES[i] * part / step, 4, y_)
                Z[i] = y_ - y
            if attempt(p, closed, k, k, piece, t, part, y, f, J, scale, rtol, 4, Z, A, order_, b, work) == math.inf:
                break
            Z_[:], step = Z, part
            interpolate(y, Z_, 1.1, 4, y_)
            pivot_guard(p, closed, k, piece, t + 1.1 * step, y_, g, q)
            beyond = g[hit]
            interpolate(y, Z_, 0.9, 4, y_)
            pivot_guard(p, closed, k, piece, t + 0.9 * step, y_, g, q)
            if not (beyond <= 0.0 < g[hit]):
                break
            at = pivot_root(p, closed, k, piece, t, step, y, Z_, 0.9, 1.1, hit, g, y_, q)
            part = at * step
        interpolate(y, Z_, part / step, 4, y_)
        y[:] = y_
        t += part
        before, h = 0.0, max(min(h, part), 1e-9)
        if piece == STICK:
            y[2] = 0.0
        if hit == _GAP:
            return MEETS, t, steps
        if hit == _N:
            return LOSES, t, steps
        if hit == _A:
            return (UNRESOLVED if rises(p, k, piece, y[2]) else JAMMED), t, steps
        if hit in (_LOW, _HIGH):
            k += 1 if hit == _HIGH else -1
        elif hit == _STICK:
            # Friction at its limit: the contact slides against it.
            T = on_one(p, closed, k, STICK, t, y, q)[1]
            piece = BACKWARD if T > 0.0 else FORWARD
            N, _, slide, _, _, A_ii = on_one(p, closed, k, piece, t, y, q)
            if N > 0.0 and piece * slide > -1e-6 * p.gravity and A_ii > LEAST_A:
                continue
        elif hit == _FASTER:
            piece += 1 if piece > 0 else -1
            if p.law != JUMP:
                continue
        elif abs(piece) > 1:
            piece -= 1 if piece > 0 else -1
            if p.law != JUMP:
                continue
        elif set_valued:
            y[2] = 0.0
        else:
            piece = -1 if piece > 0 else 1
            continue
        mode = pivot_problem(p, closed, k, piece, t, y, False, hit == _STICK)
        if mode > FORWARD:
            return mode, t, steps
        if set_valued and y[2] == 0.0:
            piece = mode
    return HELD, t, steps


@njit(cache=True, error_model="numpy")
def fall(p, t, q, s, out):
    """Write to `out` the motion of a body that has flown for a time s."""
    out[0], out[1] = q[0] + q[3] * s, q[1] + (q[4] - 0.5 * p.gravity * s) * s
    out[2] = q[2] + q[5] * s
    out[3], out[4], out[5] = q[3], q[4] - p.gravity * s, q[5]


@njit(cache=True, error_model="numpy")
def least_gap(p, q):
    """Lesser gap of both contacts."""
    gap = free.contact(p, q, 0.0, 1)[0]
    return gap if p.model == SINGLE else min(gap, free.contact(p, q, 0.0, 2)[0])


@njit(cache=True, error_model="numpy")
def fly(p, t, q, found):
    """Fly up to an impact or to the end of the span; q is overwritten. Returns whether it hits, and the time."""
    now, seen, closed = np.empty(6), np.full(4, math.nan), touch(p, t, q)
    # A gap that opens by its acceleration alone is open only after a while; a hop of a body is over soon.
    s, older, last, ds = 0.0, 0.0, 0.0, 1e-9
    angle = math.atan2(q[0], -q[1])
    while True:
        fall(p, t, q, s, now)
        speed = math.hypot(now[3], now[4]) + abs(now[5]) * (p.half_distance + p.offset)
        longest = 0.005 * min(math.sqrt(p.radius / p.gravity), p.radius / max(speed, 1e-9))
        # From a contact on, samples are dense at first.
        ds = min(longest, 0.05 * s + 1e-9)
        ahead = min(s + ds, p.span - t)
        fall(p, t, q, ahead, now)
        gap = least_gap(p, now) + closed
        low, high, hits = s, ahead, gap <= 0.0
        if not hits and last < older and last < gap and last > 0.0:
            a, b = max(s - ds, 0.0), ahead
            for _ in range(50):
                c, d = b - 0.6180339887 * (b - a), a + 0.6180339887 * (b - a)
                fall(p, t, q, c, now)
                left = least_gap(p, now)
                fall(p, t, q, d, now)
                if left < least_gap(p, now):
                    b = d
                else:
                    a = c
            fall(p, t, q, a, now)
            if least_gap(p, now) + closed <= 0.0:
                low, high, hits = max(s - ds, 0.0), a, True
        if hits:
            for _ in range(80):
                middle = 0.5 * (low + high)
                if not low < middle < high:
                    break
                fall(p, t, q, middle, now)
                if least_gap(p, now) + closed <= 0.0:
                    high = middle
                else:
                    low = middle
            ahead = high
        fall(p, t, q, ahead, now)
        for i in (1, 2):
            if i == 1 or p.model != SINGLE:
                watch(p, i, now, seen, found)
        if p.model == SINGLE:
            # The angle of a single contact is that of its place.
            polar = math.atan2(now[0], -now[1])
            q[2] += polar - angle - 2.0 * math.pi * round((polar - angle) / (2.0 * math.pi))
            angle = polar
        older, last, s = last, gap, ahead
        if hits or s >= p.span - t:
            position = q[2]
            q[:] = now
            if p.model == SINGLE:
                q[2] = position
            return hits, t + s if hits else p.span


@njit(cache=True, error_model="numpy")
def stand(p, phi, omega, q):
    """Write to q the motion of a body on both contacts at an angle of its centre of mass, psi excepted."""
    reach = p.xi if p.model != SINGLE else p.radius
    q[0], q[1] = reach * math.sin(phi), -reach * math.cos(phi)
    q[3], q[4], q[5] = -omega * q[1], omega * q[0], omega


@njit(cache=True, error_model="numpy")
def follow(p, exchanged, rtol, rest, most_steps, log):
    """Run a scene with impacts.

    Parameters
    ----------
    p, exchanged : Problem
        The scene, and the same with contacts that have changed places.
    rtol : float
        Tolerance of a step.
    rest : float
        Closing speed below which an impact is plastic, m/s.
    most_steps : int
    log : array, (m, 5)
        The first m events are written to it.

    Returns
    -------
    tuple
        See ``AFTERMATH``.

    """
    if p.restitution >= 1.0:
        # Rebounds without loss do not shrink.
        rest = 0.0
    begin = run(p, rtol, 0.0, 0.0, most_steps)
    end, t, position, speed, steps = begin[0], begin[1], begin[2], begin[3], begin[8]
    v, piece = begin[14], begin[12]
    set_valued, single = is_set_valued(p), p.model == SINGLE
    both = ONLY_1 if single else CLOSED
    found = np.array([0.0, 0.0, 1.0])  # greatest gap, passages of the rod, order
    open_time = flight_time = speed_max = impulse_max = loss = 0.0
    separations, impacts, tumbles, events, t_recovered, sense = 0, 0, 0, 0, math.nan, 1.0
    q, y, now, closed = np.zeros(6), np.zeros(4), np.zeros(6), both
    touching, e, mu, track = np.zeros(2, np.bool_), np.zeros(2), np.zeros(2), np.zeros(6)
    q[2] = position
    stand(p, position, speed, q)
    opens, lifts, fresh, settled, turns = False, False, True, False, 0
    while True:
        if closed == both:
            # Both contacts hold until one is lost. At first this has been run already.
            here = p if sense > 0.0 else exchanged
            shift = 0.0 if sense > 0.0 else math.pi
            if not fresh:
                theta, ring_omega, _ = drive(p, t)
                y[:] = 0.0
                y[0], y[1] = q[2] + shift - theta, v
                k1, k2 = segment(p, y[0] - p.beta), segment(p, y[0] + p.beta)
                if v < 0.0:
                    k1, k2 = lower_segments(p, k1, k2, y[0])
                piece = piece_of(p, v)
                if set_valued and v == 0.0:
                    mode = resting_problem(here, k1, k2, t, y[0], 0.0)
                    piece = mode
                    if mode == BACKWARD:
                        k1, k2 = lower_segments(p, k1, k2, y[0])
                else:
                    mode = sliding_problem(here, k1, k2, piece, t, y, 0.0)
                track[:] = math.nan
                done = advance(here, rtol, 0.0, 0.0, most_steps, track, t, y, k1, k2, piece, mode)
                end, t, steps, v = done[0], done[1], steps + done[8], done[14]
                q[2] = done[2] - shift
                stand(here, done[2], done[3], q)
            fresh = False
            if end not in (OPEN_1, OPEN_2, OPEN_BOTH):
                break
            if single:
                closed, lost = 0, ONLY_1
            elif end == OPEN_BOTH:
                closed, lost = 0, CLOSED
            else:
                lost = ONLY_1 if (end == OPEN_1) == (sense > 0.0) else ONLY_2
                closed = CLOSED - lost
            opens, lifts, turns, t_recovered = True, True, 0, math.nan
            separations += 2 if lost == CLOSED else 1
            if events < log.shape[0]:
                log[events] = np.array([t, LOSS, lost, 0.0, 0.0])
            events += 1
        if steps > most_steps or events > MOST_EVENTS:
            end = UNRESOLVED
            break
        since, greatest, found[0] = t, found[0], 0.0
        if closed == 0:
            hits, t = fly(p, t, q, found)
            flight_time += t - since
            open_time += t - since
            end = MEETS if hits else HELD
        else:
            theta, ring_omega, _ = drive(p, t)
            _, ux, uy, _, _ = free.ball(p, q, closed)
            y[0], y[1], y[2], y[3] = math.atan2(ux, -uy) - theta, q[2], v, q[5]
            at_launch = p.drive == POWER and p.exponent < 2.0 and t == begin[1] and (p.at_rest or p.speed == 0.0)
            if at_launch and (t <= EARLIEST or (v == 0.0 and t <= 1e-10)):
                # A ring with infinite acceleration takes along what is wedged on one contact: stick goes before slip.
                y[2] = 0.0
                k = place_of(p, closed, t, y)
                if pivot_problem(p, closed, k, STICK, t, y, True) == STICK:
                    # From rest, velocities are in proportion to the accelerations.
                    epsilon = on_one(p, closed, k, STICK, t, y, now)[3]
                    y[3] = epsilon / drive(p, t)[2] * ring_omega
                else:
                    y[2] = v
            end, t, more = turn(p, closed, rtol, most_steps, t, y, opens, found)
            steps += more
            open_time += t - since
            theta, ring_omega, _ = drive(p, t)
            free.pivot(p, closed, theta, ring_omega, y, q)
        # A contact that is lost, and hits before its gap is resolved, hits with another speed than it seems.
        blurred = lifts and found[0] <= touch(p, t, q)
        opens, found[0] = False, max(found[0], greatest)
        if end == LOSES:
            separations += 1
            if events < log.shape[0]:
                log[events] = np.array([t, LOSS, closed, 0.0, 0.0])
            events += 1
            closed = 0
            continue
        if end != MEETS:
            # A body that jams as soon as it hits has not got through its impact.
            tumbles -= turns if end == JAMMED and t == since else 0
            break
        if blurred:
            end = UNRESOLVED
            break
        # Impact. A contact that is as near, but opens, has just hit itself: such contacts hit in turn, not at once.
        theta, ring_omega, _ = drive(p, t)
        hitting, near, fastest = 0, 3.0 * touch(p, t, q), 0.0
        for i in (1, 2):
            gap, rate, _ = free.contact(p, q, ring_omega, i)
            if not (i == 2 and single) and not closed & i and gap < near and rate < 0.0:
                hitting += i
        rests = hitting > 0
        for i in (1, 2):
            gap, rate, _ = free.contact(p, q, ring_omega, i)
            touching[i - 1], e[i - 1], mu[i - 1] = False, 0.0, 0.0
            if i == 2 and single:
                break
            if (closed | hitting) & i or (hitting == 0 and gap < near):
                touching[i - 1] = True
                _, ux, uy, _, _ = free.ball(p, q, i)
                mu[i - 1] = p.mu_k[segment(p, math.atan2(ux, -uy) - theta) % p.edges.size]
                if hitting & i and -rate > rest:
                    fastest = max(fastest, -rate)
                    e[i - 1], rests = p.restitution, False
        count, impulse, after = free.shock(p, q, ring_omega, touching, e, mu)
        if settled and rest < fastest <= ROW * rest:
            if count != 1:
                # Whether the body jams depends on where the row of rebounds is cut off.
                end = UNRESOLVED
                break
            e[:], rests = 0.0, True
            count, impulse, after = free.shock(p, q, ring_omega, touching, e, mu)
        # At the end of a row of rebounds from both contacts the body rests, if it may.
        if count == 0 or (count > 1 and not (rests and settled)):
            end = JAMMED
            break
        for i in (1, 2):
            if touching[i - 1]:
                _, rate, slide = free.contact(p, q, ring_omega, i)
                if hitting & i:
                    speed_max = max(speed_max, -rate)
                    impacts += 1
                N, T = impulse[2 * i - 2], impulse[2 * i - 1]
                loss -= 0.5 * (N * (rate + after[2 * i - 2]) + T * (slide + after[2 * i - 1]))
                impulse_max = max(impulse_max, N)
        if events < log.shape[0]:
            i = 1 if hitting != 2 else 2
            log[events] = np.array([t, HIT, hitting, -free.contact(p, q, ring_omega, i)[1], impulse[2 * i - 2]])
        events += 1
        now[:] = 0.0
        for i in (1, 2):
            if touching[i - 1]:
                fx, fy, moment = free.load(p, q, i, impulse[2 * i - 2], impulse[2 * i - 1])
                now[3] += fx / p.mass
                now[4] += fy / p.mass
                now[5] += moment / free.inertia(p)
        q += now
        before, closed, lifts, turns = closed, 0, False, 0
        slow = e.max() == 0.0 and max(after[0], after[2]) < rest
        settled = rests
        for i in (2, 1):
            if touching[i - 1]:
                if after[2 * i - 2] <= 1e-13 or slow:
                    # Both slide alike, or nearly so after a slow impact, in which one may stick.
                    if closed == 0 or abs(after[2 * i - 1]) < abs(v):
                        v = after[2 * i - 1]
                    closed += i
                elif before & i:
                    separations += 1
                    if events < log.shape[0]:
                        log[events] = np.array([t, LOSS, i, 0.0, 0.0])
                    events += 1
        if closed not in (0, both) and free.acceleration(p, q, drive(p, t)[2], 0.0, 0.0, 0.0, closed)[0] > 0.0:
            # Friction could press the contact against the race, but nothing presses it yet.
            separations += 1 if before & closed else 0
            closed = 0
        if closed == both:
            t_recovered = t
        if touching[0] and touching[1]:
            turned = 1.0 if order(p, q) > 0.0 else -1.0
            turns = 1 if turned != sense else 0
            tumbles += turns
            sense = turned
        if single:
            q[5] = v / p.radius + ring_omega
    if single and closed == 0:
        _, _, _, _, along = free.ball(p, q, 1)
        q[5] = along / math.hypot(q[0], q[1])
    return (
        end, t, q[2], q[5], open_time, flight_time, found[0], separations, impacts, speed_max, impulse_max, loss,
        found[1], tumbles, t_recovered, closed, steps, events,
    )  # fmt: skip
