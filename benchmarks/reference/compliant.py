"""A second opinion on the end of a run: the same body on compliant contacts, which needs no criterion for an end.

The body has three degrees of freedom: the centre of mass (x, y) and the rotation psi. Each contact is a spring and a
damper that only push: N = max(0, k d + c d'), with the penetration d of the ball into the race. Friction is mu(|v|) N
at the sliding velocity of the contact's own material point. Near rest it rises linearly to mu_s at a speed `v_rest`.
Nothing here asks for a determinant, an admissible mode, or a reaction that reaches zero: what the springs do, happens.

A run begins shortly before the end under judgement, from the state of the rigid reference, with springs compressed by
its reactions. It is repeated with stiffer springs, with more damping, and with unequal springs:

- a separation is confirmed if the contact opens, for longer than the springs ring, at times that converge to its time,
  while the other contact stays closed;
- a jam is confirmed if no motion of a rigid body is the limit: the greatest reaction grows with the stiffness, or the
  outcome depends on damping or on the ratio of the stiffnesses;
- a run that keeps both contacts ("held") is confirmed if no contact is lost around the instant of the least reaction.

If all runs agree on another outcome, the end is contradicted. Otherwise it is undecided.
"""

import math
from dataclasses import dataclass, field

import numpy as np

from benchmarks.reference.compiled import copy, inner, kernel
from benchmarks.reference.physics import (
    FORWARD,
    STICK,
    bristle,
    coefficient,
    drive,
    is_set_valued,
    lower_segments,
    piece_of,
    segment,
    state,
    steady,
    stick_reactions,
)
from benchmarks.reference.problem import CUBIC, DAHL, LINEAR, POWER
from benchmarks.reference.run import HELD, run

#: Penetration under the load, in radii of the race, from soft to stiff.
SOFT = 1e-5
#: Ratio of the stiffnesses of one level and the next, and the number of levels.
STEP, LEVELS = 10.0, 3
#: Factors of the penetration. An end that is not confirmed is looked at again with stiffer springs and a shorter run.
ZOOMS = (1.0, 1e-2, 1e-4)
#: Damping in units of sqrt(stiffness times mass).
DAMPINGS = (0.3, 1.0)
#: Ratios of the stiffnesses of both contacts, beside 1, at the middle level with the greatest damping.
RATIOS = (4.0, 0.25)
#: Preloads of both springs at a launch, in reactions of slip.
PRELOADS = (0.9, 1.1)
#: Duration of a run before the end, and of the loss of a contact that counts, in 1/rad of the springs.
LEAD, LASTING = 80.0, 30.0
#: Least power of the stiffness by which the greatest reaction grows in a jam: 1/2 in an impact; 1/4 where det A falls
#: to 0, since the reactions of the rigid body grow like the time that is left to the power -1/2. Without a jam it is 0.
GROWTH = 0.15
#: Tolerance of a step, in units of the penetration.
RTOL = 1e-4
#: Reaction in units of the load at which a run ends: the law, under which the body gains energy, lets it grow for ever.
UNBOUNDED = 1e9
#: Ratio of the greatest reactions of runs with other springs at which their outcomes differ.
VIOLENT = 10.0
MOST_STEPS = 400_000

# Dormand and Prince (1980), order 5 with an estimate of order 4.
_C = np.array([0.0, 0.2, 0.3, 0.8, 8.0 / 9.0, 1.0, 1.0])
_A = np.array(
    [
        [0.0, 0.0, 0.0, 0.0, 0.0, 0.0],
        [1.0 / 5.0, 0.0, 0.0, 0.0, 0.0, 0.0],
        [3.0 / 40.0, 9.0 / 40.0, 0.0, 0.0, 0.0, 0.0],
        [44.0 / 45.0, -56.0 / 15.0, 32.0 / 9.0, 0.0, 0.0, 0.0],
        [19372.0 / 6561.0, -25360.0 / 2187.0, 64448.0 / 6561.0, -212.0 / 729.0, 0.0, 0.0],
        [9017.0 / 3168.0, -355.0 / 33.0, 46732.0 / 5247.0, 49.0 / 176.0, -5103.0 / 18656.0, 0.0],
        [35.0 / 384.0, 0.0, 500.0 / 1113.0, 125.0 / 192.0, -2187.0 / 6784.0, 11.0 / 84.0],
    ]
)
_E = np.array([71.0 / 57600.0, 0.0, -71.0 / 16695.0, 71.0 / 1920.0, -17253.0 / 339200.0, 22.0 / 525.0, -1.0 / 40.0])


@inner
def traction(p, v_rest, k, v, z):
    """Friction over reaction at a sliding velocity on segment k, and the rate of the bristles."""
    j = k % p.edges.size
    mu_s, mu_k = p.mu_s[j], p.mu_k[j]
    if p.law >= DAHL:
        rate, pull = bristle(p, 1 if v >= 0.0 else -1, v, z, mu_s, mu_k)
        return -pull, rate
    speed = abs(v)
    if not is_set_valued(p):
        mu = coefficient(p, piece_of(p, speed), speed, mu_s, mu_k)
    elif speed < v_rest:
        mu = mu_s * speed / v_rest
    else:
        mu = coefficient(p, piece_of(p, speed), speed, mu_s, mu_k)
        # Friction falls from mu_s to the law within another v_rest.
        mu += (mu_s - mu) * max(0.0, 2.0 - speed / v_rest)
    return -math.copysign(mu, v), 0.0


@inner
def motion(p, springs, v_rest, t, y, f, found):
    """Write the rates of (x, y, psi, their rates, z1, z2) to f; gaps, reactions and sliding velocities to `found`."""
    theta, ring_omega, _ = drive(p, t)
    f[0], f[1], f[2] = y[3], y[4], y[5]
    f[3], f[4], f[5] = 0.0, -p.gravity, 0.0
    along_x, along_y = math.cos(y[2]), math.sin(y[2])
    for i in range(2):
        arm = p.half_distance * (2.0 * i - 1.0)
        bx, by = arm * along_x - p.offset * along_y, arm * along_y + p.offset * along_x
        cx, cy = y[0] + bx, y[1] + by
        ux, uy = y[3] - y[5] * by, y[4] + y[5] * bx
        distance = math.hypot(cx, cy)
        cx, cy = cx / distance, cy / distance
        gap, opens = p.radius - p.ball_radius - distance, -(cx * ux + cy * uy)
        N = max(0.0, -springs[i] * gap - (springs[2 + i] - springs[4 + i] * gap) * opens) if gap < 0.0 else 0.0
        v = cx * uy - cy * ux + p.ball_radius * y[5] - p.radius * ring_omega
        K, f[6 + i] = traction(p, v_rest, segment(p, math.atan2(cx, -cy) - theta), v, y[6 + i])
        fx, fy = -cx * N - cy * K * N, -cy * N + cx * K * N
        rx, ry = bx + p.ball_radius * cx, by + p.ball_radius * cy
        f[3] += fx / p.mass
        f[4] += fy / p.mass
        f[5] += (rx * fy - ry * fx) / p.inertia
        found[i], found[2 + i], found[4 + i] = gap, N, v


@inner
def trial(p, springs, v_rest, t, h, y, y_, K, found, scale, rtol):
    """Write a step from y, whose rates are K[0], to y_; returns the error in units of the tolerance."""
    n = y.size
    for s in range(1, 7):
        for j in range(n):
            total = 0.0
            for r in range(s):
                total += _A[s, r] * K[r, j]
            y_[j] = y[j] + h * total
        motion(p, springs, v_rest, t + _C[s] * h, y_, K[s], found)
    error = 0.0
    for j in range(n):
        total = 0.0
        for r in range(7):
            total += _E[r] * K[r, j]
        error = max(error, abs(h * total) / (rtol * scale[j]))
    return error


@kernel
def integrate(p, springs, v_rest, t, y, until, about, scale, longest, lasting, rtol, most_steps, most, out):
    """Run from t to `until`, or until a reaction exceeds `most`; y is overwritten.

    Writes to `out`: instants of the first lasting loss of both contacts (infinite if none), greatest reactions after
    `about`, shares of the time after `about` in which each contact is open, reactions and sliding velocities at the
    end, number of steps, instant of the end.
    """
    n = 8
    K, y_, found = np.zeros((7, n)), np.zeros(n), np.zeros(6)
    since, peak, open_time = np.full(2, math.inf), np.zeros(2), np.zeros(2)
    lost = np.full(2, math.inf)
    h, steps = 0.1 * longest, 0
    motion(p, springs, v_rest, t, y, K[0], found)
    for i in range(2):
        if found[2 + i] <= 0.0:
            since[i] = t
    begin, carried = t, max(found[2], found[3])
    while t < until and steps < most_steps and carried < most:
        h = min(h, longest, until - t)
        error = trial(p, springs, v_rest, t, h, y, y_, K, found, scale, rtol)
        steps += 1
        if not error <= 1.0 and h > 1e-9 * longest:
            h *= max(0.1, 0.9 * error**-0.2) if error < 1e30 else 0.1
            continue
        # A trial that fails may leave any reaction in `found`.
        last, t, carried = t, t + h, max(found[2], found[3])
        copy(y_, y)
        copy(K[6], K[0])
        h *= min(4.0, 0.9 * max(error, 1e-9) ** -0.2)
        for i in range(2):
            if found[2 + i] > 0.0:
                since[i] = math.inf
            elif since[i] == math.inf:
                since[i] = 0.5 * (last + t)
            if since[i] < math.inf and t - since[i] >= lasting and lost[i] == math.inf:
                lost[i] = since[i]
            if t > about:
                peak[i] = max(peak[i], found[2 + i])
                if found[2 + i] <= 0.0:
                    open_time[i] += min(t - last, t - about)
    for i in range(2):
        out[i], out[2 + i], out[4 + i] = lost[i], peak[i], open_time[i] / max(t - max(about, begin), 1e-300)
        out[6 + i], out[8 + i] = found[2 + i], found[4 + i]
    out[10], out[11] = steps, t


@kernel
def rigid_reactions(p, mode, piece, t, y):
    """Reactions of the rigid body at a state of the reference, and the saturation of its friction if it sticks."""
    k1, k2 = segment(p, y[0] - p.beta), segment(p, y[0] + p.beta)
    if mode == STICK:
        kappa, N1, N2 = stick_reactions(p, k1, k2, t, y[0])
        return N1, N2, kappa
    if piece < 0:
        k1, k2 = lower_segments(p, k1, k2, y[0])
    _, _, _, N1, N2, _, _, _, _ = state(p, k1, k2, piece, t, y)
    return N1, N2, 0.0


@dataclass(frozen=True)
class Opinion:
    """What the compliant body says of an end.

    Attributes
    ----------
    word : str
        ``confirmed``, ``contradicted`` or ``undecided``.
    why : str
        Explanation for a reader.
    runs : list of dict
        What the springs did, for each choice of them.

    """

    word: str
    why: str
    runs: list = field(repr=False, default_factory=list)


def smoothed(p, v_rest):
    """Problem whose law is not steeper at rest than v_rest."""
    if p.v0 <= 0.0 or p.v0 >= v_rest:
        return p
    v1 = max(p.v1, 2.0 * v_rest) if p.law in (LINEAR, CUBIC) else p.v1
    return p._replace(v0=v_rest, v1=v1)


def before(p, t, rtol=1e-9):
    """State of the rigid reference at t: (t, angle, angular velocity, z1, z2, N1, N2, saturation).

    None if its run ends before.
    """
    found = None
    if t > 0.0 or not (p.drive == POWER and p.exponent < 2.0):
        found = run(p._replace(span=max(t, 1e-12)), rtol, 0.0, 0.0, 60_000)
    if found is not None and found["end"] != HELD and found["t_end"] > 1e-9:
        return None
    if found is None or found["end"] != HELD:
        # The body has no rigid motion even at its launch: it is laid onto springs that carry nothing.
        z = np.zeros(2)
        omega = drive(p, 0.0)[1] if p.at_rest else p.speed
        v = (omega - drive(p, 0.0)[1]) * p.radius
        if p.law >= DAHL and v != 0.0:
            for i, side in enumerate((-1.0, 1.0)):
                j = segment(p, p.position - drive(p, 0.0)[0] + side * p.beta) % p.edges.size
                z[i] = math.copysign(steady(p, v, p.mu_s[j], p.mu_k[j]) / p.sigma0, v)
        return 0.0, p.position, omega, z[0], z[1], 0.0, 0.0, 0.0
    y = np.array([found["rho"], found["v"], found["z1"], found["z2"]])
    N1, N2, kappa = rigid_reactions(p, int(found["mode"]), int(found["piece"]), found["t_end"], y)
    return found["t_end"], found["position"], found["speed"], y[2], y[3], max(N1, 0.0), max(N2, 0.0), kappa


def place(p, start, k1, k2, v_rest):
    """State of the compliant body whose contacts carry the reactions and the friction of the rigid body."""
    _, phi, omega, z1, z2, N1, N2, kappa = start
    # A contact at rest creeps, and so does one that is slower than a band which has been widened.
    v = sliding_speed(p, start)
    if kappa != 0.0:
        omega += kappa * v_rest / p.radius
    elif abs(v) < p.v0 < v_rest:
        omega += v * (v_rest / p.v0 - 1.0) / p.radius
    outward, along = np.array([math.sin(phi), -math.cos(phi)]), np.array([math.cos(phi), math.sin(phi)])
    centre = p.xi * outward
    for _ in range(3):
        normals, residual = np.zeros((2, 2)), np.zeros(2)
        for i, (side, N, k) in enumerate(((-1.0, N1, k1), (1.0, N2, k2))):
            ball = centre + side * p.half_distance * along - p.offset * outward
            distance = math.hypot(*ball)
            normals[i], residual[i] = -ball / distance, -N / k - (p.radius - p.ball_radius - distance)
        centre = centre + np.linalg.solve(normals, residual)
    velocity = omega * np.array([-centre[1], centre[0]])
    return np.array([*centre, phi, *velocity, omega, z1, z2])


def steepness(p):
    """Smallest range of sliding speeds over which a law changes, m/s; infinite if it only jumps at rest."""
    scales = [p.w] if p.w > 0.0 else []
    if p.alpha > 0.0 and (p.mu_s > p.mu_k).any():
        scales.append(1.0 / p.alpha)
    if p.v0 > 0.0:
        scales += [p.v0, p.v1 - p.v0] if p.law in (LINEAR, CUBIC) else [p.v0]
    return min(scales, default=math.inf)


def sliding_speed(p, start):
    """Sliding velocity of the rigid body."""
    return (start[2] - drive(p, start[0])[1]) * p.radius


def rest_speed(p, start, until, load, frequency):
    """Speed below which friction rises linearly. A contact at rest creeps more slowly than this."""
    usual = min(1e-3, 10.0 * load / (p.mass * frequency))
    # Contacts that slide must be faster: at the start, or because the ring leaves the body behind.
    slip = max(abs(sliding_speed(p, start)), p.radius * abs(drive(p, until)[1] - drive(p, start[0])[1]))
    wanted = min(usual, 0.1 * steepness(p), 0.02 * slip if slip > 0.0 else usual)
    return max(wanted, 0.03 * usual)


def resolved(p, t, runs):
    """Whether the stiffest springs ring faster than the slip of the rigid body changes at t.

    Friction of a steep law changes within a short time, and a drive of infinite acceleration makes a body slide against
    its weight for a nanosecond. Where friction is so steep that a run needs too many steps, it does not show the end.
    """
    if any(r["steps"] >= MOST_STEPS for r in runs):
        return False
    stiffest = max(plain(runs), key=lambda r: r["k"])
    now = before(p, t)
    if now is not None and sliding_speed(p, now) * (stiffest["slip_1"] + stiffest["slip_2"]) < 0.0:
        return False
    span = LASTING * math.sqrt(p.mass / stiffest["k"])
    late, early = before(p, max(0.0, t - span)), before(p, max(0.0, t - 2.0 * span))
    if late is None or early is None:
        return False
    v = sliding_speed(p, late)
    scale = steepness(p)
    after = 0.5 * (stiffest["slip_1"] + stiffest["slip_2"])
    change = max(abs(v - sliding_speed(p, early)), abs(after - v) * span / (stiffest["t"] - late[0]))
    if t == 0.0:
        change = max(change, p.gravity * span)
    if p.law >= DAHL:
        # Bristles turn within a distance of about mu / sigma0, and their damping grows with speed.
        return p.mu_k.min() > 10.0 * (p.sigma0 * abs(v) * span + (p.sigma1 + p.sigma2) * change)
    return abs(v) > 30.0 * max(scale, change) or (change < 0.3 * scale and stiffest["v_rest"] < 0.3 * scale)


def follow(p, start, about, until, k, damping, ratio=1.0, preload=1.0):
    """Run of a compliant body from a rigid state; see :func:`integrate`."""
    load = max(p.mass * p.gravity, start[5], start[6])
    k1, k2 = k * math.sqrt(ratio), k / math.sqrt(ratio)
    frequency = math.sqrt(k / p.mass)
    v_rest = rest_speed(p, start, until, load, frequency)
    springs = np.array([k1, k2, damping * math.sqrt(k1 * p.mass), damping * math.sqrt(k2 * p.mass), 0.0, 0.0])
    start = (*start[:5], preload * start[5], preload * start[6], start[7])
    y, out = place(p, start, k1, k2, v_rest), np.zeros(12)
    depth = load / k
    scale = np.array(
        [depth, depth, depth / p.radius, *(depth * frequency * np.array([1.0, 1.0, 1.0 / p.radius])), 1, 1]
    )
    if p.law >= DAHL:
        scale[6:] = p.mu_k.min() / p.sigma0
    integrate(smoothed(p, v_rest), springs, v_rest, start[0], y, until, about, scale, 0.5 / frequency,
              LASTING / frequency, RTOL, MOST_STEPS, UNBOUNDED * load, out)  # fmt: skip
    names = ("lost_1", "lost_2", "peak_1", "peak_2", "open_1", "open_2", "normal_1", "normal_2", "slip_1", "slip_2",
             "steps", "t")  # fmt: skip
    springs = {"k": k, "damping": damping, "ratio": ratio, "preload": preload, "v_rest": v_rest, "load": load}
    return springs | dict(zip(names, out, strict=True)) | {"psi": y[2], "omega": y[5]}


def series(p, start, t, zoom):
    """Runs about an instant t: all levels with all dampings, and the ratios of the stiffnesses at the middle level."""
    load = max(p.mass * p.gravity, start[5], start[6])
    soft = load / (SOFT * zoom * p.radius)
    frequency = math.sqrt(soft / p.mass)
    about, until = t - 10.0 / frequency, t + LEAD / frequency
    runs = [
        follow(p, start, about, until, soft * STEP**level, damping) | {"level": level}
        for level in range(LEVELS)
        for damping in DAMPINGS
    ]
    middle, most = soft * STEP ** (LEVELS // 2), DAMPINGS[-1]
    runs += [follow(p, start, about, until, middle, most, ratio) | {"level": LEVELS // 2} for ratio in RATIOS]
    if t == 0.0:
        # At a launch nothing says how much the springs carry: also as much as both contacts would in slip, or more.
        y = np.array([start[1] - drive(p, 0.0)[0], sliding_speed(p, start), start[3], start[4]])
        loaded = (*start[:5], *rigid_reactions(p, FORWARD, piece_of(p, y[1]), 0.0, y))
        if min(loaded[5:7]) > 0.0:
            runs += [
                follow(p, loaded, about, until, middle, most, preload=x) | {"level": LEVELS // 2} for x in PRELOADS
            ]
    return runs


def growths(runs):
    """Powers of the stiffness by which the greatest reaction grows, for each damping."""
    found = []
    for damping in DAMPINGS:
        same = [r for r in plain(runs) if r["damping"] == damping]
        first, last = (max(r["peak_1"], r["peak_2"], 1e-300) for r in (same[0], same[-1]))
        found.append(math.log(last / first) / math.log(same[-1]["k"] / same[0]["k"]))
    return found


def plain(runs):
    """Runs with equal springs and the reactions of the rigid body."""
    return [r for r in runs if r["ratio"] == r["preload"] == 1.0]


def fate(r):
    """Contacts that a run loses."""
    return tuple(i for i in (1, 2) if math.isfinite(r[f"lost_{i}"]))


def separation(p, runs, contact, t):
    """Opinion on the separation of a contact (3: both) at t. Only equal springs count.

    Where friction falls as slip stops, springs with little damping throw the other contact off as well.
    """
    equal = plain(runs)
    firm, otherwise, errors = [], [], {}
    for r in equal:
        lost = [r[f"lost_{i}"] for i in (1, 2) if contact in (i, 3)]
        thrown = contact == 3 or r["damping"] < DAMPINGS[-1]
        other = math.inf if thrown else r[f"lost_{3 - contact}"]
        error = errors[r["damping"], r["level"]] = max(abs(x - t) for x in lost)
        allowed = LASTING * math.sqrt(p.mass / r["k"])
        # The stiffest springs need not be as close if they are much closer than those before.
        converged = r["level"] == LEVELS - 1 and error < min(10.0 * allowed, 0.5 * errors[r["damping"], LEVELS - 2])
        firm.append((error <= allowed or converged) and other > max(lost))
        if r["level"] == LEVELS - 1:
            otherwise.append(not error <= 10.0 * allowed)
    worst = max(errors[damping, LEVELS - 1] for damping in DAMPINGS)
    if all(f for f, r in zip(firm, equal, strict=True) if r["level"] == LEVELS - 1):
        return Opinion("confirmed", f"lost {worst:.2g} s from {t:.9g} s", runs)
    fates = sorted({fate(r) for r in runs})
    if all(otherwise):
        return Opinion("contradicted", f"contacts lost: {fates}", runs)
    return Opinion("undecided", f"{sum(firm)} of {len(equal)} runs agree, contacts lost: {fates}", runs)


def jam(p, runs):
    """Opinion on a jam."""
    growth, fates = growths(runs), sorted({fate(r) for r in runs if r["level"] > 0})
    why = f"reactions grow like stiffness to the power {min(growth):.2f} to {max(growth):.2f}; contacts lost: {fates}"
    unbounded = min(max(r["peak_1"], r["peak_2"]) / r["load"] for r in plain(runs)) > 0.1 * UNBOUNDED
    if min(growth) > GROWTH or unbounded:
        return Opinion("confirmed", why, runs)
    peaks = [max(r["peak_1"], r["peak_2"]) for r in runs if r["level"] == LEVELS // 2]
    if len(fates) > 1 or max(peaks) > VIOLENT * min(peaks):
        return Opinion("divided", why, runs)
    return Opinion("contradicted" if max(growth) < 0.4 * GROWTH else "undecided", why, runs)


def holding(p, runs):
    """Opinion on an instant at which both contacts hold. Only equal springs count."""
    growth, fates = growths(runs), sorted({fate(r) for r in plain(runs)})
    why = f"reactions grow like stiffness to the power {min(growth):.2f} to {max(growth):.2f}; contacts lost: {fates}"
    if fates == [()] and max(growth) < GROWTH:
        return Opinion("confirmed", why, runs)
    stiff = {fate(r) for r in plain(runs) if r["level"] > 0}
    return Opinion("contradicted" if () not in stiff else "undecided", why, runs)


def opinion(p, word, contact, t):
    """Opinion on an end of a run.

    Parameters
    ----------
    p : Problem
    word : str
        ``separating``, ``jammed`` or ``held``.
    contact : int
        Contact that separates (3: both).
    t : float
        Time of the end; if both contacts hold, an instant to look at, s.

    """
    found, words = Opinion("undecided", "the rigid reference ends before"), []
    for zoom in ZOOMS:
        start = before(p, max(0.0, t - LEAD * math.sqrt(SOFT * zoom * p.radius / p.gravity)))
        if start is None:
            continue
        runs = series(p, start, t, zoom)
        if word == "separating":
            found = separation(p, runs, contact, t)
        else:
            found = (jam if word == "jammed" else holding)(p, runs)
        if found.word == "confirmed":
            return found
        words.append(found.word)
    # The two shortest runs must agree on a contradiction, or on that the outcome depends on the springs.
    if words[-2:] == ["divided"] * 2:
        return Opinion("confirmed", found.why, found.runs)
    if words and not resolved(p, t, found.runs):
        return Opinion("undecided", f"friction changes faster than the springs ring; {found.why}", found.runs)
    return found if words[-2:] == ["contradicted"] * 2 else Opinion("undecided", found.why, found.runs)
