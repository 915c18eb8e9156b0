"""A run of the reference: it watches every inequality at twenty instants of each step and locates every event."""

import math

import numpy as np

from benchmarks.reference.compiled import copy, inner, kernel
from benchmarks.reference.physics import (
    BACKWARD,
    CLOSED,
    FORWARD,
    JAMMED,
    LEAST_DETERMINANT,
    OPEN_1,
    OPEN_2,
    OPEN_BOTH,
    STICK,
    bound,
    corners,
    drive,
    falls_at_rest,
    is_set_valued,
    load_on_band,
    lower_segments,
    piece_of,
    rates,
    resting_problem,
    segment,
    sliding_problem,
    state,
    steady,
    stick_reserve,
    stick_reserves,
)
from benchmarks.reference.problem import BELT, DAHL, JUMP, KARNOPP, POWER, RESET, RING, SINUSOIDAL, TABLE, TURN
from benchmarks.reference.radau import NODES, attempt, interpolate, jacobian

#: Ends of a run, in addition to the solutions of the contact problem.
HELD, UNRESOLVED = 0, 7
SAMPLES = 20
#: Earliest time at which something happens on a ring whose acceleration is infinite at 0, s. Only the variation with
#: positive slack follows what happens before.
EARLIEST = 1e-14
#: Return values of :func:`advance`, in this order.
RESULT = (
    "end", "t_end", "position", "speed", "reversals", "turned", "least_1", "least_2", "steps", "events", "t_least",
    "mode", "piece", "rho", "v", "z1", "z2",
)  # fmt: skip
# Guards: reactions, determinant, ends of the piece, edges of both segments, bristles.
_N1, _N2, _DET, _SLOWER, _FASTER, _EDGE_1, _EDGE_2, _BRISTLE, _COUNT = range(9)
#: Any of the guards.
ANY = np.int64(-1)


@inner
def observe(p, track, phi, omega, slack):
    """Track direction, reversals, and the angle turned since the last reversal; `slack` shifts the thresholds."""
    before, last = track[4], track[5]
    peak = omega
    bend = before - 2.0 * last + omega
    if (last - before) * (last - omega) > 0.0 and bend != 0.0:
        peak = last - 0.125 * (omega - before) ** 2 / bend
    track[4], track[5] = last, omega
    epsilon = p.epsilon * (1.0 + 1e3 * slack)
    track[2], track[3] = min(track[2], phi), max(track[3], phi)
    for w in (peak, omega):
        if w > epsilon and track[0] <= 0.0:
            if track[0] < 0.0:
                track[1] += 1.0
                track[3] = phi
            track[0] = 1.0
        elif w < -epsilon and track[0] >= 0.0:
            if track[0] > 0.0:
                track[1] += 1.0
                track[2] = phi
            track[0] = -1.0


@inner
def guard(p, k1, k2, piece, t, y, least, g):
    """Write to g the guards, which must stay positive within a mode."""
    _, _, _, N1, N2, det, _, _, _ = state(p, k1, k2, piece, t, y)
    weight = p.mass * p.gravity
    g[:] = 1.0
    if p.model != BELT:
        g[_N1], g[_N2], g[_DET] = N1 / weight - least, N2 / weight - least, det - LEAST_DETERMINANT
        if piece > 0:
            g[_EDGE_1] = bound(p, k1 + 1) - (y[0] - p.beta)
            g[_EDGE_2] = bound(p, k2 + 1) - (y[0] + p.beta)
        else:
            g[_EDGE_1] = y[0] - p.beta - bound(p, k1)
            g[_EDGE_2] = y[0] + p.beta - bound(p, k2)
        if p.model != RING:
            g[_N2] = g[_EDGE_2] = 1.0
    speed = y[1] if piece > 0 else -y[1]
    low, high = corners(p, piece)
    # Where a law is continuous at a corner, the guard may pass the corner by the size of rounding.
    slack = 0.0 if is_set_valued(p) else 1e-12 * (abs(low) if low != 0.0 else (high if high < math.inf else 1e-6))
    g[_SLOWER] = speed - low + slack
    if high < math.inf:
        g[_FASTER] = high - speed + 1e-12 * high
    if p.law == RESET and abs(piece) == 1:
        z = y[2] if piece > 0 else -y[2]
        g[_BRISTLE] = p.mu_s[0] / p.sigma0 - z
    if p.law == KARNOPP and abs(piece) != 2:
        load = load_on_band(p, t, y)
        g[_BRISTLE] = p.mu_s[0] - abs(load) if abs(piece) == 1 else load * piece / 3.0 - p.mu_s[0]
        g[_BRISTLE] += 1e-12 * p.mu_s[0]


@inner
def root(p, k1, k2, piece, t, h, y, Z, n, least, low, high, which, g, y_):
    """Share of a step, between two shares, at which a guard (or `ANY`) reaches zero."""
    copy(y, y_)
    for _ in range(60):
        middle = 0.5 * (low + high)
        if not low < middle < high:
            break
        interpolate(y, Z, middle, n, y_)
        guard(p, k1, k2, piece, t + middle * h, y_, least, g)
        if (g.min() if which == ANY else g[which]) <= 0.0:
            high = middle
        else:
            low = middle
    return high


@inner
def passage(p, k1, k2, t, y, least):
    """Contact problem while the sliding velocity jumps at launch, because the drive's acceleration is infinite at 0.

    The velocity passes from its value at launch to its value at `t` in no time, and friction changes with it.
    """
    y_, last = y.copy(), y[1]
    y_[1] = 0.0
    first = drive(p, 0.0)[1] - drive(p, t)[1]
    begin = last - p.radius * first
    for i in range(401):
        x = (i / 400.0) ** 6
        y_[1] = begin + (last - begin) * x
        piece = piece_of(p, y_[1])
        found = sliding_problem(p, k1, k2, piece, 0.0, y_, least)
        if found != FORWARD and found != BACKWARD:
            return found
    return STICK


@inner
def after_stick(p, k1, k2, t, rho, least):
    """Mode after the end of stick, and the instant at which the contact problem has a solution.

    A reaction that reaches 0 in stick is a separation: so it is under smooth laws, whose limit stick is.
    """
    slide, first, second = stick_reserves(p, k1, k2, t, rho, least)
    if p.model == RING and slide > 1e-9 and min(first, second) > -1e-3:
        if abs(first - second) < 1e-9:
            return OPEN_BOTH, t
        return (OPEN_1 if first < second else OPEN_2), t
    if falls_at_rest(p):
        found = resting_problem(p, k1, k2, t, rho, least)
        if found != STICK and found != JAMMED:
            return found, t
    found = JAMMED
    for delay in (1e-10, 1e-8, 1e-6):
        found = resting_problem(p, k1, k2, t + delay, rho, least)
        if found != JAMMED:
            return found, t + delay
    return found, t


@kernel
def advance(p, rtol, least, slack, most_steps, track, t, y, k1, k2, piece, mode):
    """Run on from an instant t at which the contact problem has been solved; `y` and `track` are overwritten."""
    set_valued, span, end = is_set_valued(p), p.span, HELD
    n = 2 if p.law < DAHL else (4 if p.model == RING else 3)
    y_, f = np.zeros(4), np.zeros(4)
    Z, Z_, previous = np.zeros((3, 4)), np.zeros((3, 4)), np.zeros(4)
    J, A, order, b, work = np.zeros((4, 4)), np.zeros((12, 12)), np.zeros(12, np.int64), np.zeros(12), np.zeros((4, 4))
    G, g, scale = np.zeros((SAMPLES + 2, _COUNT)), np.zeros(_COUNT), np.ones(4)
    least_1 = least_2 = math.inf
    t_least = 0.0

    # Scales of the tolerance: position (rad or m), sliding velocity, bristles.
    slow = 1e-2 * p.radius
    if p.v0 > 0.0:
        slow = min(slow, p.v0)
    if p.v_s > 0.0:
        slow = min(slow, p.v_s)
    if p.law >= DAHL:
        scale[2] = scale[3] = p.mu_k.min() / p.sigma0
        if p.model != BELT:
            slow = min(slow, 1.0 / (p.sigma1 + p.sigma2 + 1e-9))
    longest = span / 20.0
    if p.drive == SINUSOIDAL:
        longest = min(longest, 0.05 / p.frequency)
    if p.force != 0.0:
        longest = min(longest, 0.05 / p.force_frequency)
    h, before, steps, events, stalled = min(1e-4, longest), 0.0, 0, 0, 0

    while t < span:
        if mode > FORWARD:
            end = mode
            break
        if steps > most_steps or events > 20000:
            end = UNRESOLVED
            break
        if mode == STICK:
            # The body moves with the ring: only the end of stick is unknown.
            y[1] = 0.0
            dt, low, broke = longest / SAMPLES, t, False
            older, old = math.inf, stick_reserve(p, k1, k2, t, y[0], least)
            while t < span and not broke:
                high = min(t + dt, span)
                new = stick_reserve(p, k1, k2, high, y[0], least)
                if new <= 0.0:
                    low, broke = t, True
                elif old < older and old < new:
                    # A minimum between two samples may lie below zero: find it by golden section.
                    a_, b_ = max(t - dt, low), high
                    for _ in range(40):
                        c_, d_ = b_ - 0.6180339887 * (b_ - a_), a_ + 0.6180339887 * (b_ - a_)
                        if stick_reserve(p, k1, k2, c_, y[0], least) < stick_reserve(p, k1, k2, d_, y[0], least):
                            b_ = d_
                        else:
                            a_ = c_
                    if stick_reserve(p, k1, k2, a_, y[0], least) <= 0.0:
                        low, high, broke = max(t - dt, low), a_, True
                if broke:
                    for _ in range(80):
                        middle = 0.5 * (low + high)
                        if not low < middle < high:
                            break
                        if stick_reserve(p, k1, k2, middle, y[0], least) <= 0.0:
                            high = middle
                        else:
                            low = middle
                theta, ring_omega, _ = drive(p, high)
                observe(p, track, y[0] + theta, ring_omega, slack)
                steps += 1
                t, older, old = high, old, new
            if broke:
                events += 1
                track[5] = math.nan
                mode, t = after_stick(p, k1, k2, t, y[0], least)
                if mode == STICK:
                    stalled += 1
                    if stalled > 1000:
                        end = UNRESOLVED
                        break
                    t = t + 1e-9
                elif mode in (FORWARD, BACKWARD):
                    piece = mode
                    if mode == BACKWARD and p.model != BELT:
                        k1, k2 = lower_segments(p, k1, k2, y[0])
            before = 0.0
            h = min(1e-4, longest)
            continue

        # A step of sliding.
        scale[1] = abs(y[1]) + slow
        rates(p, CLOSED, k1, k2, piece, t, y, f)
        jacobian(p, CLOSED, k1, k2, piece, t, y, f, scale, n, J, work)
        limit = span
        if p.drive == TABLE:
            for knot in p.knots:
                if knot > t + 1e-12:
                    limit = min(limit, knot)
                    break
        error = math.inf
        while True:
            h = min(h, longest)
            last = t + h >= limit - 1e-13 * span
            step = limit - t if last else h
            if before > 0.0:
                for i in range(3):
                    interpolate(previous, Z, 1.0 + NODES[i] * step / before, n, y_)
                    for j in range(n):
                        Z_[i, j] = y_[j] - y[j]
            else:
                for i in range(3):
                    for j in range(n):
                        Z_[i, j] = 0.0
            error = attempt(p, CLOSED, k1, k2, piece, t, step, y, f, J, scale, rtol, n, Z_, A, order, b, work)
            steps += 1
            if error <= 1.0 or step < 1e-17 or steps > most_steps:
                break
            before = 0.0
            h = step * (0.1 if error == math.inf else max(0.1, 0.9 * error**-0.25))
        if not error <= 1.0:
            # The acceleration grows without bound near a jam, and the step falls below rounding.
            det = state(p, k1, k2, piece, t, y)[5]
            end = JAMMED if step < 1e-17 and det < 1e-2 else UNRESOLVED
            break
        # Watch the inequalities. The last sample lies beyond the end of the step, to see a minimum at the end.
        hit, at = -1, 1.0
        copy(y, y_)
        for i in range(SAMPLES + 2):
            x = i / SAMPLES
            interpolate(y, Z_, x, n, y_)
            guard(p, k1, k2, piece, t + x * step, y_, least, G[i])
            if i >= 2:
                for c in (_N1, _N2, _DET, _SLOWER):
                    a0, a1, a2 = G[i - 2, c], G[i - 1, c], G[i, c]
                    if a1 < a0 and a1 < a2 and a1 > 0.0 and a2 > 0.0 and (c != _SLOWER or set_valued):
                        bend = a0 - 2.0 * a1 + a2
                        if a1 - 0.125 * (a2 - a0) ** 2 / bend <= 0.0 and hit < 0:
                            x0 = x + (-1.0 - 0.5 * (a2 - a0) / bend) / SAMPLES
                            interpolate(y, Z_, x0, n, y_)
                            guard(p, k1, k2, piece, t + x0 * step, y_, least, g)
                            if g[c] <= 0.0 and x0 <= 1.0:
                                at = root(p, k1, k2, piece, t, step, y, Z_, n, least, x0 - 1.0 / SAMPLES, x0, c, g, y_)
                                hit = c
            if hit >= 0 or i > SAMPLES:
                break
            if i > 0 and G[i].min() <= 0.0:
                at = root(p, k1, k2, piece, t, step, y, Z_, n, least, (i - 1) / SAMPLES, x, ANY, g, y_)
                interpolate(y, Z_, at, n, y_)
                guard(p, k1, k2, piece, t + at * step, y_, least, g)
                hit = np.argmin(g > 0.0)
                break
            if i > 0:
                theta, ring_omega, _ = drive(p, t + x * step)
                if min(G[i, _N1], G[i, _N2]) < min(least_1, least_2):
                    t_least = t + x * step
                least_1, least_2 = min(least_1, G[i, _N1]), min(least_2, G[i, _N2])
                observe(p, track, y_[0] + theta, y_[1] / p.radius + ring_omega, slack)
        if hit < 0:
            copy(y, previous)
            interpolate(y, Z_, 1.0, n, y_)
            copy(y_, y)
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
                interpolate(y, Z_, NODES[i] * part / step, n, y_)
                for j in range(n):
                    Z[i, j] = y_[j] - y[j]
            if attempt(p, CLOSED, k1, k2, piece, t, part, y, f, J, scale, rtol, n, Z, A, order, b, work) == math.inf:
                break
            Z, Z_, step = Z_, Z, part
            interpolate(y, Z_, 1.1, n, y_)
            guard(p, k1, k2, piece, t + 1.1 * step, y_, least, g)
            beyond = g[hit]
            interpolate(y, Z_, 0.9, n, y_)
            guard(p, k1, k2, piece, t + 0.9 * step, y_, least, g)
            if not (beyond <= 0.0 < g[hit]):
                break
            at = root(p, k1, k2, piece, t, step, y, Z_, n, least, 0.9, 1.1, hit, g, y_)
            part = at * step
        interpolate(y, Z_, part / step, n, y_)
        copy(y_, y)
        t += part
        events += 1
        before = 0.0
        h = max(min(h, part), 1e-9)
        if hit in (_N1, _N2):
            guard(p, k1, k2, piece, t, y, least, g)
            end = OPEN_1 if hit == _N1 else OPEN_2
            if abs(g[_N1]) < 1e-9 and abs(g[_N2]) < 1e-9 and p.model == RING:
                end = OPEN_BOTH
            break
        if hit == _DET:
            end = JAMMED
            break
        theta, ring_omega, _ = drive(p, t)
        observe(p, track, y[0] + theta, y[1] / p.radius + ring_omega, slack)
        track[5] = math.nan  # the acceleration may jump here, so no peak is fitted across it
        if hit in (_EDGE_1, _EDGE_2):
            way = 1 if piece > 0 else -1
            guard(p, k1, k2, piece, t, y, least, g)
            if hit == _EDGE_1 or g[_EDGE_1] < 1e-13:
                k1 += way
            if hit == _EDGE_2 or g[_EDGE_2] < 1e-13:
                k2 += way
            mode = sliding_problem(p, k1, k2, piece, t, y, least)
        elif p.law == KARNOPP:
            if hit == _BRISTLE:
                piece = (3 if load_on_band(p, t, y) > 0.0 else -3) if abs(piece) == 1 else piece // 3
            elif abs(piece) == 2:
                piece //= 2
            else:
                piece = 2 if y[1] > 0.0 else -2
        elif hit == _BRISTLE:
            piece *= 2
        elif hit == _FASTER:
            piece += 1 if piece > 0 else -1
            if p.law == JUMP:
                mode = sliding_problem(p, k1, k2, piece, t, y, least)
        elif abs(piece) > 1 and p.law != RESET:
            piece -= 1 if piece > 0 else -1
            if p.law == JUMP:
                mode = sliding_problem(p, k1, k2, piece, t, y, least)
        elif set_valued:
            y[1] = 0.0
            mode = resting_problem(p, k1, k2, t, y[0], least)
            if mode in (FORWARD, BACKWARD):
                piece = mode
                if mode == BACKWARD and p.model != BELT:
                    k1, k2 = lower_segments(p, k1, k2, y[0])
        else:
            piece = -1 if piece > 0 else 1
            if piece < 0 and p.model != BELT:
                k1, k2 = lower_segments(p, k1, k2, y[0])

    theta, ring_omega, _ = drive(p, t)
    turned = 1.0 if track[3] - track[2] >= TURN * (1.0 + slack) else 0.0
    return (
        end, t, y[0] + theta, y[1] / p.radius + ring_omega, track[1], turned, least_1 + least, least_2 + least,
        steps, events, t_least, mode, piece, y[0], y[1], y[2], y[3],
    )  # fmt: skip


@inner
def slip_at_once(p, k1, k2, mode, rho, begin, instant, v, epsilon):
    """Slip from `begin`, at the velocity v, to `instant` on a ring whose acceleration is infinite at 0.

    The ring alone changes the velocity much. It may pass speeds at which friction takes a contact off the ring.
    Returns mode, time and sliding velocity.
    """
    y, n = np.array([rho, v, 0.0, 0.0]), p.exponent
    slow, before = (begin / instant) ** (n - 1.0), begin
    for i in range(1, 1001):
        # Steps of equal change of the velocity of the ring.
        low, t = before, instant * (slow + (1.0 - slow) * i / 1000.0) ** (1.0 / (n - 1.0))
        y[1] = v + p.radius * (epsilon * (t - begin) - drive(p, t)[1] + drive(p, begin)[1])
        found = mode if y[1] * mode <= 0.0 else sliding_problem(p, k1, k2, piece_of(p, y[1]), t, y, 0.0)
        if found == mode:
            before = t
            continue
        for _ in range(80):
            middle = math.sqrt(low) * math.sqrt(t)
            if not low < middle < t:
                break
            y[1] = v + p.radius * (epsilon * (middle - begin) - drive(p, middle)[1] + drive(p, begin)[1])
            if sliding_problem(p, k1, k2, piece_of(p, y[1]), middle, y, 0.0) == mode:
                low = middle
            else:
                t = middle
        y[1] = v + p.radius * (epsilon * (t - begin) - drive(p, t)[1] + drive(p, begin)[1])
        return found, t, y[1]
    return mode, instant, v + p.radius * (epsilon * (instant - begin) - drive(p, instant)[1] + drive(p, begin)[1])


@inner
def leave_at_once(p, k1, k2, rho, earliest, instant, least):
    """Mode, time and sliding velocity after a launch at rest on a ring whose acceleration is infinite at 0.

    Up to `instant` nothing moves so far that weight and friction change. A body that is left behind has a constant
    acceleration a, and the ring A n (n - 1) t^(n - 2). It is caught up at (A n / a)^(1 / (2 - n)), and may stick from
    then on until its friction or a reaction ends that, all of it before `instant`. What happens before `earliest` is
    taken to happen then.
    """
    y, n, t = np.array([rho, 0.0, 0.0, 0.0]), p.exponent, earliest
    mode, behind = resting_problem(p, k1, k2, t, rho, least), True
    if mode > FORWARD:
        return mode, t, -p.radius * drive(p, t)[1]
    while mode == STICK or behind:
        if mode == STICK:
            first = low = high = t
            behind, ends = False, False
            for i in range(1, 601):
                low, high = high, first * (instant / first) ** (i / 600.0)
                if stick_reserve(p, k1, k2, high, rho, least) <= 0.0:
                    ends = True
                    break
            if not ends:
                return STICK, instant, 0.0
            for _ in range(80):
                middle = math.sqrt(low) * math.sqrt(high)
                if not low < middle < high:
                    break
                if stick_reserve(p, k1, k2, middle, rho, least) <= 0.0:
                    high = middle
                else:
                    low = middle
            mode, t = after_stick(p, k1, k2, high, rho, least)
            if mode == STICK:
                return UNRESOLVED, t, 0.0
        else:
            j1, j2 = lower_segments(p, k1, k2, rho) if mode == BACKWARD and p.model != BELT else (k1, k2)
            epsilon = state(p, j1, j2, mode, t, y)[2]
            meets = (p.amplitude * n / epsilon) ** (1.0 / (2.0 - n)) if epsilon * p.amplitude > 0.0 else math.inf
            if meets >= instant:
                v = p.radius * (epsilon * t - drive(p, t)[1])
                return slip_at_once(p, j1, j2, mode, rho, t, instant, v, epsilon)
            behind, t = False, max(meets, earliest)
            mode = resting_problem(p, k1, k2, t, rho, least)
    if mode > FORWARD:
        return mode, t, 0.0
    j1, j2 = lower_segments(p, k1, k2, rho) if mode == BACKWARD and p.model != BELT else (k1, k2)
    return slip_at_once(p, j1, j2, mode, rho, t, instant, 0.0, state(p, j1, j2, mode, t, y)[2])


@kernel
def launch(p, least, slack):
    """Start of a run, as :func:`advance` takes it: track, time, state, segments, piece and mode."""
    set_valued, y = is_set_valued(p), np.zeros(4)

    # If the acceleration of the drive is infinite at 0, the motion before `instant` is negligible.
    t, instant = 0.0, 0.0
    if p.drive == POWER and p.exponent < 2.0:
        instant = 1e-13 if p.exponent < 1.5 else 1e-10
    theta, ring_omega, _ = drive(p, t)
    y[0] = p.position - theta
    speed = ring_omega if p.at_rest else p.speed
    y[1] = (speed - ring_omega) * p.radius
    # Where a sinusoidal drive turns back, its velocity is the rounding error of a cosine.
    rocking = abs(p.amplitude) * TURN * p.frequency if p.drive == SINUSOIDAL else 0.0
    if abs(speed - ring_omega) <= 4e-16 * max(abs(speed), abs(ring_omega), rocking):
        y[1] = 0.0
    track = np.array([0.0, 0.0, p.position, p.position, speed, speed])
    observe(p, track, p.position, speed, slack)
    k1, k2 = segment(p, y[0] - p.beta), segment(p, y[0] + p.beta)
    if y[1] < 0.0:
        k1, k2 = lower_segments(p, k1, k2, y[0])
    if p.law >= DAHL and p.model != BELT and y[1] != 0.0:
        m = p.edges.size
        for i, k in ((2, k1), (3, k2)):
            y[i] = math.copysign(steady(p, y[1], p.mu_s[k % m], p.mu_k[k % m]) / p.sigma0, y[1])
    piece = piece_of(p, y[1])
    if set_valued and y[1] == 0.0 and instant > 0.0:
        mode, t, y[1] = leave_at_once(p, k1, k2, y[0], 1e-280 if slack > 0.0 else EARLIEST, instant, least)
        y[0] = p.position - drive(p, t)[0]
    elif set_valued and y[1] == 0.0:
        mode = resting_problem(p, k1, k2, 0.0, y[0], least)
    else:
        mode = sliding_problem(p, k1, k2, piece, t, y, least)
        t = instant
        if instant > 0.0:
            theta, ring_omega, _ = drive(p, t)
            y[0], y[1] = p.position + speed * t - theta, (speed - ring_omega) * p.radius
            if mode in (FORWARD, BACKWARD) and not set_valued:
                found = passage(p, k1, k2, t, y, least) if p.model != BELT else STICK
                if found != STICK:
                    mode = found
                piece = piece_of(p, y[1])
    if set_valued and mode in (FORWARD, BACKWARD):
        piece = mode if y[1] == 0.0 else piece_of(p, y[1])
    if mode == BACKWARD and p.model != BELT:
        k1, k2 = lower_segments(p, k1, k2, y[0])
    return track, t, y, k1, k2, piece, mode


def run(p, rtol, least, slack, most_steps):
    """Run a scene.

    Parameters
    ----------
    p : Problem
    rtol : float
        Tolerance of the error estimate of a step. The estimate is of lower order than the step.
    least : float
        Reaction at which a contact is lost, in weights of the body.
    slack : float
        Relative shift of the full turn, and a thousandth of the relative shift of the threshold of a reversal.
    most_steps : int

    Returns
    -------
    dict
        Numbers by the names in ``RESULT``.

    """
    done = advance(p, rtol, least, slack, most_steps, *launch(p, least, slack))
    return dict(zip(RESULT, done, strict=True))
