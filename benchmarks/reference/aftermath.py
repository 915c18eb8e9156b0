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

from benchmarks.reference import free
from benchmarks.reference.compiled import copy, inner, kernel
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
from benchmarks.reference.run import ANY, EARLIEST, HELD, RESULT, SAMPLES, UNRESOLVED, advance, run

#: What a run carries along. `closed` are the contacts that hold, `v` is the sliding velocity of the slower one of them,
#: `order` the sign of :func:`order`, `order_closed` the same when both contacts touched last. `passages` counts how
#: often the rod passes over the axis, `tumbles` changes of order between instants at which both contacts touch, `turns`
#: those of the last impact. `event` is what the next contact problem comes after, `first` when a contact is first lost.
#: A contact `lifts` from the loss of the first one up to the next impact. A body has `settled` if its last impact was
#: plastic.
STATE = np.dtype(
    [(name, float) for name in (
        "t_end", "v", "open_time", "flight_time", "gap_max", "impact_speed_max", "impulse_max", "impact_loss",
        "t_recovered", "first", "order", "order_closed",
    )]
    + [(name, int) for name in (
        "end", "closed", "separations", "impacts", "passages", "tumbles", "turns", "steps", "events", "event", "lifts",
        "settled",
    )]
)  # fmt: skip
#: Kinds of events in a log, whose rows are (time, kind, contact, speed, impulse).
LOSS, HIT = np.array([1, 2])
#: What else a contact problem may come after.
NOTHING, BREAKAWAY = np.array([0, 3])
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


@inner
def order(p, q):
    """Sine of the angle from ball 1 to ball 2 seen from the axis; it changes its sign in a tumble."""
    _, ux, uy, _, _ = free.ball(p, q, ONLY_1)
    _, wx, wy, _, _ = free.ball(p, q, ONLY_2)
    return ux * wy - uy * wx


@inner
def touch(p, t, q):
    """Gap that counts as closed: rounding leaves less."""
    return TOUCH * p.radius * (1.0 + abs(q[2]) + abs(drive(p, t)[0]))


@inner
def place_of(p, closed, t, y):
    """Segment of the closed contact; on an edge the one that it moves into."""
    x, ring_omega = y[0], drive(p, t)[1]
    k = segment(p, x + 2e-14)
    onward = y[2] - p.ball_radius * (y[3] - ring_omega)
    return k - 1 if onward < 0.0 and x - bound(p, k) < 2e-14 else k


@inner
def other_gap(p, closed, t, q, N, T):
    """Acceleration of the gap of the open contact."""
    epsilon = drive(p, t)[2]
    fx, fy, moment = free.load(p, q, closed, N, T)
    return free.acceleration(p, q, epsilon, fx, fy, moment, 3 - closed)[0]


@inner
def pivot_problem(p, closed, k, piece, t, y, event):
    """Contact problem of a body on one contact: the piece of slip, STICK, LOSES or JAMMED (above 5).

    The `event` is what has just happened. After a LOSS the gap of the other contact must open by its acceleration,
    which is zero where a reaction has reached zero. After BREAKAWAY the body does not stick.
    """
    q, shut, opens = np.empty(6), -1e-6 * p.gravity, event == LOSS
    if not (is_set_valued(p) and y[2] == 0.0):
        N, _, _, _, _, A = on_one(p, closed, k, piece, t, y, q)
        if not A > LEAST_A:
            return JAMMED
        return LOSES if N <= 0.0 else STICK
    N, T, _, _, _, _ = on_one(p, closed, k, STICK, t, y, q)
    limit = p.mu_s[k % p.edges.size] * N
    if event != BREAKAWAY and N > 0.0 and abs(T) <= limit and not (opens and other_gap(p, closed, t, q, N, T) < shut):
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


@inner
def rises(p, k, piece, v):
    """Whether friction rises with the speed of sliding. Then no contact jams, however small A may become."""
    return abs(friction(p, k, piece, 1.000001 * v, 0.0)[0]) > abs(friction(p, k, piece, v, 0.0)[0])


@inner
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


@inner
def pivot_root(p, closed, k, piece, t, h, y, Z, low, high, which, g, y_, q):
    """Share of a step, between two shares, at which a guard (or `ANY`) reaches zero."""
    copy(y, y_)
    for _ in range(60):
        middle = 0.5 * (low + high)
        if not low < middle < high:
            break
        interpolate(y, Z, middle, 4, y_)
        pivot_guard(p, closed, k, piece, t + middle * h, y_, g, q)
        if (g.min() if which == ANY else g[which]) <= 0.0:
            high = middle
        else:
            low = middle
    return high


@inner
def watch(p, i, q, seen, s):
    """Track the greatest gap of contact i (`seen` holds its last two values) and the passages of the rod."""
    gap = free.contact(p, q, 0.0, i)[0]
    older, last = seen[2 * i - 2], seen[2 * i - 1]
    s.gap_max = max(s.gap_max, gap)
    bend = older - 2.0 * last + gap
    if last > older and last > gap and bend < 0.0:
        s.gap_max = max(s.gap_max, last - 0.125 * (gap - older) ** 2 / bend)
    seen[2 * i - 2], seen[2 * i - 1] = last, gap
    if p.model != SINGLE:
        side = order(p, q)
        if side * s.order < 0.0:
            s.passages += 1
        if side != 0.0:
            s.order = math.copysign(1.0, side)


@inner
def arrive(p, s, q, since, greatest):
    """Count the time for which a contact was open, and what its end means for the impact before."""
    s.open_time += s.t_end - since
    if s.end == MEETS and s.lifts and s.gap_max <= touch(p, s.t_end, q):
        # A contact that is lost, and hits before its gap is resolved, hits with another speed than it seems.
        s.end = UNRESOLVED
    if s.end == JAMMED and s.t_end == since:
        # A body that jams as soon as it hits has not got through its impact.
        s.tumbles -= s.turns
    s.event, s.gap_max = NOTHING, max(s.gap_max, greatest)


@inner
def mount(p, s, q):
    """State of a body that pivots on one contact, from its motion."""
    t = s.t_end
    theta, ring_omega, ring_epsilon = drive(p, t)
    _, ux, uy, _, _ = free.ball(p, q, s.closed)
    y = np.array([math.atan2(ux, -uy) - theta, q[2], s.v, q[5]])
    at_launch = p.drive == POWER and p.exponent < 2.0 and t == s.first and (p.at_rest or p.speed == 0.0)
    if at_launch and (t <= EARLIEST or (s.v == 0.0 and t <= 1e-10)):
        # A ring with infinite acceleration takes along what is wedged on one contact: stick goes before slip.
        y[2] = 0.0
        k = place_of(p, s.closed, t, y)
        if pivot_problem(p, s.closed, k, STICK, t, y, LOSS) == STICK:
            # From rest, velocities are in proportion to the accelerations.
            epsilon = on_one(p, s.closed, k, STICK, t, y, np.empty(6))[3]
            y[3] = epsilon / ring_epsilon * ring_omega
        else:
            y[2] = s.v
    return y


@kernel
def turn(p, rtol, most_steps, s, q):
    """Run a body that pivots on one contact.

    The end is MEETS, LOSES, JAMMED, HELD at the end of the span, or UNRESOLVED.
    """
    closed, t, y, since, greatest, s.gap_max = s.closed, s.t_end, mount(p, s, q), s.t_end, s.gap_max, 0.0
    set_valued, span, n = is_set_valued(p), p.span, 4
    y_, f, q_, g = np.zeros(4), np.zeros(4), np.zeros(6), np.zeros(_COUNT)
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
    mode = pivot_problem(p, closed, k, piece, t, y, s.event)
    if set_valued and y[2] == 0.0:
        piece = mode
    if mode > FORWARD:
        s.end = mode
        arrive(p, s, q, since, greatest)
        return
    # A small hop is over soon.
    N, T, _, _, _, _ = on_one(p, closed, k, piece, t, y, q_)
    _, rate, _ = free.contact(p, q_, 0.0, 3 - closed)
    hop = 2.0 * max(rate, 0.0) / max(abs(other_gap(p, closed, t, q_, N, T)), 1e-300)
    h, before, begin, s.end = 1e-6 if rate <= 0.0 else max(min(1e-4, 0.3 * hop), 1e-12), 0.0, s.steps, HELD
    while t < span:
        if s.steps - begin > most_steps:
            s.end = UNRESOLVED
            break
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
        jacobian(p, closed, k, k, piece, t, y, f, scale, n, J, work)
        error = math.inf
        while True:
            h = min(h, longest)
            last = t + h >= limit - 1e-13 * span
            step = limit - t if last else h
            for i in range(3):
                Z_[i] = 0.0
                if before > 0.0:
                    interpolate(previous, Z, 1.0 + NODES[i] * step / before, n, Z_[i])
                    for j in range(n):
                        Z_[i, j] -= y[j]
            error = attempt(p, closed, k, k, piece, t, step, y, f, J, scale, rtol, n, Z_, A, order_, b, work)
            s.steps += 1
            if error <= 1.0 or step < 1e-17 or s.steps - begin > most_steps:
                break
            before = 0.0
            h = step * (0.1 if error == math.inf else max(0.1, 0.9 * error**-0.25))
        if not error <= 1.0:
            s.end = JAMMED if step < 1e-17 and not rises(p, k, piece, y[2]) else UNRESOLVED
            break
        hit, at = -1, 1.0
        for i in range(SAMPLES + 2):
            x = i / SAMPLES
            interpolate(y, Z_, x, n, y_)
            pivot_guard(p, closed, k, piece, t + x * step, y_, G[i], q_)
            if i >= 2:
                for c in (_N, _A, _GAP, _SLOWER, _STICK):
                    a0, a1, a2 = G[i - 2, c], G[i - 1, c], G[i, c]
                    if hit < 0 and a1 < a0 and a1 < a2 and a1 > 0.0 and a2 > 0.0 and (c != _SLOWER or set_valued):
                        bend = a0 - 2.0 * a1 + a2
                        if a1 - 0.125 * (a2 - a0) ** 2 / bend <= 0.0:
                            x0 = x + (-1.0 - 0.5 * (a2 - a0) / bend) / SAMPLES
                            interpolate(y, Z_, x0, n, y_)
                            pivot_guard(p, closed, k, piece, t + x0 * step, y_, g, q_)
                            if g[c] <= 0.0 and x0 <= 1.0:
                                at = pivot_root(
                                    p, closed, k, piece, t, step, y, Z_, x0 - 1.0 / SAMPLES, x0, c, g, y_, q_
                                )
                                hit = c
            if hit >= 0 or i > SAMPLES:
                break
            if i > 0 and G[i].min() <= 0.0:
                at = pivot_root(p, closed, k, piece, t, step, y, Z_, (i - 1) / SAMPLES, x, ANY, g, y_, q_)
                interpolate(y, Z_, at, n, y_)
                pivot_guard(p, closed, k, piece, t + at * step, y_, g, q_)
                hit = np.argmin(g > 0.0)
                break
            if i > 0:
                watch(p, 3 - closed, q_, seen, s)
        if hit < 0:
            copy(y, previous)
            interpolate(y, Z_, 1.0, n, y_)
            copy(y_, y)
            if piece == STICK:
                y[2] = 0.0
            Z, Z_, before = Z_, Z, step
            t = limit if last else t + step
            h = step * min(4.0, max(0.3, 0.9 * max(error, 1e-12) ** -0.25)) if not last else h
            continue
        # Repeat the step up to the event, so that its position has no interpolation error.
        part = at * step
        for _ in range(3):
            if part <= 1e-16 * t:
                break
            for i in range(3):
                interpolate(y, Z_, NODES[i] * part / step, n, Z[i])
                for j in range(n):
                    Z[i, j] -= y[j]
            if attempt(p, closed, k, k, piece, t, part, y, f, J, scale, rtol, n, Z, A, order_, b, work) == math.inf:
                break
            Z, Z_, step = Z_, Z, part
            interpolate(y, Z_, 1.1, n, y_)
            pivot_guard(p, closed, k, piece, t + 1.1 * step, y_, g, q_)
            beyond = g[hit]
            interpolate(y, Z_, 0.9, n, y_)
            pivot_guard(p, closed, k, piece, t + 0.9 * step, y_, g, q_)
            if not (beyond <= 0.0 < g[hit]):
                break
            at = pivot_root(p, closed, k, piece, t, step, y, Z_, 0.9, 1.1, hit, g, y_, q_)
            part = at * step
        interpolate(y, Z_, part / step, n, y_)
        copy(y_, y)
        t += part
        before, h = 0.0, max(min(h, part), 1e-9)
        if piece == STICK:
            y[2] = 0.0
        if hit == _GAP:
            s.end = MEETS
            break
        if hit == _N:
            s.end = LOSES
            break
        if hit == _A:
            s.end = UNRESOLVED if rises(p, k, piece, y[2]) else JAMMED
            break
        if hit in (_LOW, _HIGH):
            k += 1 if hit == _HIGH else -1
        elif hit == _STICK:
            # Friction at its limit: the contact slides against it.
            T = on_one(p, closed, k, STICK, t, y, q_)[1]
            piece = BACKWARD if T > 0.0 else FORWARD
            N, _, slide, _, _, A_ii = on_one(p, closed, k, piece, t, y, q_)
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
        mode = pivot_problem(p, closed, k, piece, t, y, BREAKAWAY if hit == _STICK else NOTHING)
        if mode > FORWARD:
            s.end = mode
            break
        if set_valued and y[2] == 0.0:
            piece = mode
    s.t_end = t
    theta, ring_omega, _ = drive(p, t)
    free.pivot(p, closed, theta, ring_omega, y, q)
    arrive(p, s, q, since, greatest)


@inner
def fall(p, t, q, s, out):
    """Write to `out` the motion of a body that has flown for a time s."""
    out[0], out[1] = q[0] + q[3] * s, q[1] + (q[4] - 0.5 * p.gravity * s) * s
    out[2] = q[2] + q[5] * s
    out[3], out[4], out[5] = q[3], q[4] - p.gravity * s, q[5]


@inner
def least_gap(p, q):
    """Lesser gap of both contacts."""
    gap = free.contact(p, q, 0.0, ONLY_1)[0]
    return gap if p.model == SINGLE else min(gap, free.contact(p, q, 0.0, ONLY_2)[0])


@kernel
def fly(p, s, q):
    """Fly up to an impact, or to the end of the span."""
    t, greatest, s.gap_max = s.t_end, s.gap_max, 0.0
    now, seen, closed = np.empty(6), np.full(4, math.nan), touch(p, t, q)
    # A gap that opens by its acceleration alone is open only after a while; a hop of a body is over soon.
    flown, older, last, ds = 0.0, 0.0, 0.0, 1e-9
    angle = math.atan2(q[0], -q[1])
    while True:
        fall(p, t, q, flown, now)
        speed = math.hypot(now[3], now[4]) + abs(now[5]) * (p.half_distance + p.offset)
        longest = 0.005 * min(math.sqrt(p.radius / p.gravity), p.radius / max(speed, 1e-9))
        # From a contact on, samples are dense at first.
        ds = min(longest, 0.05 * flown + 1e-9)
        ahead = min(flown + ds, p.span - t)
        fall(p, t, q, ahead, now)
        gap = least_gap(p, now) + closed
        low, high, hits = flown, ahead, gap <= 0.0
        if not hits and last < older and last < gap and last > 0.0:
            a, b = max(flown - ds, 0.0), ahead
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
                low, high, hits = max(flown - ds, 0.0), a, True
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
                watch(p, i, now, seen, s)
        if p.model == SINGLE:
            # The angle of a single contact is that of its place.
            polar = math.atan2(now[0], -now[1])
            q[2] += polar - angle - 2.0 * math.pi * round((polar - angle) / (2.0 * math.pi))
            angle = polar
        older, last, flown = last, gap, ahead
        if hits or flown >= p.span - t:
            position = q[2]
            copy(now, q)
            if p.model == SINGLE:
                q[2] = position
            s.end, s.t_end = (MEETS, t + flown) if hits else (HELD, p.span)
            s.flight_time += s.t_end - t
            arrive(p, s, q, t, greatest)
            return


def stand(p, phi, omega, q):
    """Write to q the motion of a body on both contacts at an angle of its centre of mass, psi excepted."""
    reach = p.xi if p.model != SINGLE else p.radius
    q[0], q[1] = reach * math.sin(phi), -reach * math.cos(phi)
    q[3], q[4], q[5] = -omega * q[1], omega * q[0], omega


@kernel
def note(s, log, kind, contact, speed, impulse):
    """Count an event, and write it to the log as long as there is room."""
    if s.events < log.shape[0]:
        row = log[s.events]
        row[0], row[1], row[2], row[3], row[4] = s.t_end, kind, contact, speed, impulse
    s.events += 1


@inner
def meet(p, rest, s, q, touching, e, mu):
    """Find the contacts that touch, and their restitution and friction.

    Returns those that hit, and the greatest closing speed above `rest` (0 if there is none).
    """
    theta, ring_omega, _ = drive(p, s.t_end)
    hitting, near, fastest, n = 0, 3.0 * touch(p, s.t_end, q), 0.0, 1 if p.model == SINGLE else 2
    # A contact that is as near, but opens, has just hit itself: such contacts hit in turn, not at once.
    for i in range(1, n + 1):
        gap, rate, _ = free.contact(p, q, ring_omega, i)
        if not s.closed & i and gap < near and rate < 0.0:
            hitting += i
    for i in range(1, n + 1):
        gap, rate, _ = free.contact(p, q, ring_omega, i)
        if (s.closed | hitting) & i or (hitting == 0 and gap < near):
            touching[i - 1] = True
            _, ux, uy, _, _ = free.ball(p, q, i)
            mu[i - 1] = p.mu_k[segment(p, math.atan2(ux, -uy) - theta) % p.edges.size]
            if hitting & i and -rate > rest:
                fastest = max(fastest, -rate)
                e[i - 1] = p.restitution
    return hitting, fastest


@inner
def push(p, ring_omega, hitting, touching, impulse, after, s, q, log):
    """Change the motion by the impulses of an impact, and count it."""
    vx = vy = spin = 0.0
    for i in range(1, 3):
        if touching[i - 1]:
            _, rate, slide = free.contact(p, q, ring_omega, i)
            N, T = impulse[2 * i - 2], impulse[2 * i - 1]
            if hitting & i:
                s.impact_speed_max = max(s.impact_speed_max, -rate)
                s.impacts += 1
            s.impact_loss -= 0.5 * (N * (rate + after[2 * i - 2]) + T * (slide + after[2 * i - 1]))
            s.impulse_max = max(s.impulse_max, N)
            fx, fy, moment = free.load(p, q, i, N, T)
            vx += fx / p.mass
            vy += fy / p.mass
            spin += moment / free.inertia(p)
    i = ONLY_2 if hitting == ONLY_2 else ONLY_1
    note(s, log, HIT, hitting, -free.contact(p, q, ring_omega, i)[1], impulse[2 * i - 2])
    q[3] += vx
    q[4] += vy
    q[5] += spin


@inner
def let_go(p, slow, touching, after, s, q, log):
    """Find the contacts that hold after an impact; if it was `slow`, those that touch."""
    before, s.closed = s.closed, 0
    for i in range(2, 0, -1):
        if touching[i - 1]:
            if after[2 * i - 2] <= 1e-13 or slow:
                # Both slide alike, or nearly so after a slow impact, in which one may stick.
                if s.closed == 0 or abs(after[2 * i - 1]) < abs(s.v):
                    s.v = after[2 * i - 1]
                s.closed += i
            elif before & i:
                s.separations += 1
                note(s, log, LOSS, i, 0.0, 0.0)
    one = s.closed in (ONLY_1, ONLY_2) and p.model != SINGLE
    if one and free.acceleration(p, q, drive(p, s.t_end)[2], 0.0, 0.0, 0.0, s.closed)[0] > 0.0:
        # Friction could press the contact against the race, but nothing presses it yet.
        s.separations += 1 if before & s.closed else 0
        s.closed = 0


@kernel
def bounce(p, rest, s, q, log):
    """Impact of all contacts that touch; `s.end` changes if the run ends in it."""
    ring_omega = drive(p, s.t_end)[1]
    touching, e, mu = np.zeros(2, np.bool_), np.zeros(2), np.zeros(2)
    hitting, fastest = meet(p, rest, s, q, touching, e, mu)
    rests = hitting > 0 and fastest == 0.0
    count, impulse, after = free.shock(p, q, ring_omega, touching, e, mu)
    if s.settled and rest < fastest <= ROW * rest:
        if count != 1:
            # Whether the body jams depends on where the row of rebounds is cut off.
            s.end = UNRESOLVED
            return
        e[:], rests = 0.0, True
        count, impulse, after = free.shock(p, q, ring_omega, touching, e, mu)
    # At the end of a row of rebounds from both contacts the body rests, if it may.
    if count == 0 or (count > 1 and not (rests and s.settled)):
        s.end = JAMMED
        return
    push(p, ring_omega, hitting, touching, impulse, after, s, q, log)
    let_go(p, e.max() == 0.0 and max(after[0], after[2]) < rest, touching, after, s, q, log)
    s.lifts, s.settled, s.turns = False, rests, 0
    if touching[0] and touching[1]:
        turned = 1.0 if order(p, q) > 0.0 else -1.0
        s.turns = 1 if turned != s.order_closed else 0
        s.tumbles += s.turns
        s.order_closed = turned
    if p.model == SINGLE:
        q[5] = s.v / p.radius + ring_omega


@kernel
def resume(p, t, phi, v):
    """Start of a run with both contacts closed, as :func:`benchmarks.reference.run.advance` takes it."""
    y = np.array([phi - drive(p, t)[0], v, 0.0, 0.0])
    k1, k2 = segment(p, y[0] - p.beta), segment(p, y[0] + p.beta)
    if v < 0.0:
        k1, k2 = lower_segments(p, k1, k2, y[0])
    piece = piece_of(p, v)
    if is_set_valued(p) and v == 0.0:
        piece = mode = resting_problem(p, k1, k2, t, y[0], 0.0)
        if mode == BACKWARD:
            k1, k2 = lower_segments(p, k1, k2, y[0])
    else:
        mode = sliding_problem(p, k1, k2, piece, t, y, 0.0)
    return np.full(6, math.nan), t, y, k1, k2, piece, mode


def part(p, rtol, rest, most_steps, both, s, q, log):
    """Run a body that has lost a contact until both hold again, or the run ends."""
    while s["closed"] != both:
        if s["steps"] > most_steps or s["events"] > MOST_EVENTS:
            s["end"] = UNRESOLVED
            return
        if s["closed"] == 0:
            fly(p, s, q)
        else:
            turn(p, rtol, most_steps, s, q)
        if s["end"] == LOSES:
            lose(s, log, s["closed"])
            continue
        if s["end"] == MEETS:
            bounce(p, rest, s, q, log)
        if s["end"] != MEETS:
            return
    s["t_recovered"] = s["t_end"]


def lose(s, log, contact):
    """Count the loss of a contact, or of both."""
    s["separations"] += 2 if contact == CLOSED else 1
    s["closed"] -= contact
    note(s, log, LOSS, contact, 0.0, 0.0)


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
    dict
        Position and speed at the end, and the numbers of ``STATE``, by name.

    """
    if p.restitution >= 1.0:
        # Rebounds without loss do not shrink.
        rest = 0.0
    single = p.model == SINGLE
    both = ONLY_1 if single else CLOSED
    s, q = np.zeros(1, STATE)[0], np.zeros(6)
    s["t_recovered"], s["order"], s["order_closed"] = math.nan, 1.0, 1.0
    done, here, shift = run(p, rtol, 0.0, 0.0, most_steps), p, 0.0
    s["first"] = done["t_end"]
    while True:
        # Both contacts hold until one is lost.
        s["end"], s["closed"], s["t_end"], s["v"] = done["end"], both, done["t_end"], done["v"]
        s["steps"] += done["steps"]
        q[2] = done["position"] - shift
        stand(here, done["position"], done["speed"], q)
        if s["end"] not in (OPEN_1, OPEN_2, OPEN_BOTH):
            break
        if single or s["end"] == OPEN_BOTH:
            lost = both
        else:
            lost = ONLY_1 if (s["end"] == OPEN_1) == (s["order_closed"] > 0.0) else ONLY_2
        s["event"], s["lifts"], s["turns"], s["t_recovered"] = LOSS, True, 0, math.nan
        lose(s, log, lost)
        part(p, rtol, rest, most_steps, both, s, q, log)
        if s["closed"] != both:
            break
        here, shift = (p, 0.0) if s["order_closed"] > 0.0 else (exchanged, math.pi)
        start = resume(here, s["t_end"], q[2] + shift, s["v"])
        done = dict(zip(RESULT, advance(here, rtol, 0.0, 0.0, most_steps, *start), strict=True))
    if single and s["closed"] == 0:
        q[5] = free.ball(p, q, ONLY_1)[4] / math.hypot(q[0], q[1])
    return dict(zip(STATE.names, s.item(), strict=True)) | {"position": q[2], "speed": q[5]}
