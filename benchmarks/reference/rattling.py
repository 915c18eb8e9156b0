"""A second opinion on what follows a lost contact: the same body on springs, with dampers matched to a restitution.

A contact that closes at a speed v carries N = k d (1 + s d'/v) until it opens, with the penetration d. Its motion obeys
m' d'' = -N for whatever effective mass m' the body has there, friction and the other contact included, so that
d' dd'/(1 + s d'/v) = -(k/m') d dd: from d = 0 back to d = 0 the left side integrates to 0, whatever k and m' are. With
x = d'/v from 1 to -e this is [x/s - log(1 + s x)/s^2] = 0 between both ends, the equation that :func:`damping` solves.
The impact needs no effective mass, and its law is Newton's.

A contact that has settled, or closes so slowly that its load keeps it closed, is overdamped: Moreau's law lets a closed
contact give way in the impact of the other, but not rebound. Nothing here knows modes, a complementarity or Zeno's sum.

Springs cannot tell a contact that holds from rebounds that are shorter than they ring. Each run has therefore two
words: one counts contacts that touch for an instant, the other those that stay closed for a while.
"""

import math
from itertools import pairwise

import numpy as np
from scipy.optimize import brentq

from benchmarks.reference.aftermath import HIT, order
from benchmarks.reference.compiled import copy, kernel
from benchmarks.reference.compliant import Opinion, before, motion, place, rest_speed, smoothed, trial
from benchmarks.reference.problem import SINGLE

#: Penetrations under the weight, in radii of the race.
DEPTHS = (1e-6, 1e-7)
#: Damping of settled contacts, in units of sqrt(stiffness times mass).
SETTLED = 6.0
#: A contact that closes more slowly than the load changes its speed in this angle of the springs (rad) stays closed.
SLOW = 3.0
#: Duration of an impact, in rad of the springs, after which its contact has settled.
LONGEST = 12.0
#: Speed below which friction rises linearly, at most, in units of that which the load gives in an angle of 1 rad of the
#: springs. A contact at rest creeps nearly as fast, for the whole run; a lower speed than this costs steps.
CREEPING = 0.3
#: Pauses between impacts in which a run of the springs is compared with one of the rigid body, and difference of their
#: angular velocities, as a share of the greatest one up to then, at which they have parted. A body that has hardly
#: moved yet counts as if it moved at this share of the speed of a fall.
LOOKED_AT, PARTED, HARDLY = 60, 0.05, 0.01
#: Time for which both contacts hold if they certainly do, in rad of the springs.
LASTING = 100.0
RTOL = 1e-4
MOST_STEPS = 1_000_000
_OPEN, _HIT, _CLOSED = range(3)
SHARED = "shared impact"


def damping(e):
    """Factor s of the damping of a contact with a coefficient of restitution 0 < e <= 1."""
    if e >= 1.0:
        return 0.0

    # With u = -log(1 - e s); u = 0 is no solution.
    def residual(u):
        s = -math.expm1(-u) / e
        return s * (1.0 + e) - u - math.log1p(s)

    return -math.expm1(-brentq(residual, 0.1 * (1.0 - e), 10.0 + 2.0 / e)) / e


@kernel
def rattle(p, s, k, settled, slow, settling, lasting, v_rest, t, y, until, scale, longest, rtol, most_steps, out):
    """Run from t to `until`; y is overwritten.

    Writes to `out`: the time of the end, steps, time with an open contact, greatest gap, greatest closing speed, number
    of impacts, changes of order between instants at which both contacts touch, the same between instants at
    which they have held for `lasting`, whether a contact is open at the end, and whether one was within `lasting`.
    """
    K, y_, found = np.zeros((7, 8)), np.zeros(8), np.zeros(6)
    springs = np.array([k, k, settled, settled, 0.0, 0.0])
    if p.model == SINGLE:
        springs[1] = springs[3] = 0.0
    mode, since = np.full(2, _CLOSED), np.zeros(2)
    n = 1 if p.model == SINGLE else 2
    h, steps, out[:] = 0.1 * longest, 0, 0.0
    closing, sides, apart_at = np.zeros(2), np.ones(2), -math.inf
    while t < until and steps < most_steps:
        motion(p, springs, v_rest, t, y, K[0], found)
        free = mode[0] == _OPEN and (n == 1 or mode[1] == _OPEN)
        limit = 50.0 * longest if free else longest
        for i in range(n):
            if found[i] > 0.0:
                # Not past the start of an impact.
                limit = min(limit, max(0.02 * longest, 0.5 * found[i] / max(closing[i], 1e-12)))
        h = min(h, limit, until - t)
        error = trial(p, springs, v_rest, t, h, y, y_, K, found, scale, rtol)
        steps += 1
        if not error <= 1.0 and h > 1e-9 * longest:
            h *= max(0.1, 0.9 * error**-0.2) if error < 1e30 else 0.1
            continue
        t += h
        copy(y_, y)
        apart = False
        for i in range(n):
            arm = p.half_distance * (2.0 * i - 1.0)
            bx = arm * math.cos(y[2]) - p.offset * math.sin(y[2])
            by = arm * math.sin(y[2]) + p.offset * math.cos(y[2])
            cx, cy = y[0] + bx, y[1] + by
            speed = (cx * (y[3] - y[5] * by) + cy * (y[4] + y[5] * bx)) / math.hypot(cx, cy)
            closing[i] = speed
            gap = found[i]
            if mode[i] == _OPEN:
                apart = True
                out[3] = max(out[3], gap)
                if gap < 0.0:
                    out[4] = max(out[4], speed)
                    out[5] += 1.0
                    since[i] = t
                    mode[i] = _HIT if speed > slow and s < math.inf else _CLOSED
                    springs[2 + i] = 0.0 if mode[i] == _HIT else settled
                    springs[4 + i] = k * s / speed if mode[i] == _HIT else 0.0
            elif gap > 0.0:
                mode[i] = _OPEN
                springs[2 + i], springs[4 + i] = 0.0, 0.0
            elif mode[i] == _HIT and t - since[i] > settling:
                mode[i] = _CLOSED
                springs[2 + i], springs[4 + i] = settled, 0.0
        if apart:
            out[2] += h
        if mode[0] != _CLOSED or mode[1] != _CLOSED:
            apart_at = t
        if n == 2 and not apart:
            now = order(p, y)
            for i in range(2):
                if i == 0 or t - apart_at > lasting:
                    if now * sides[i] < 0.0:
                        out[6 + i] += 1.0
                    sides[i] = now
        h *= min(4.0, 0.9 * max(error, 1e-9) ** -0.2)
    out[0], out[1] = t, steps
    for i in range(n):
        # A contact that still rings is closed.
        if mode[i] == _OPEN and max(found[i] / scale[0], abs(closing[i]) / slow) > 10.0:
            out[8] = 1.0
    out[9] = 1.0 if t - apart_at <= lasting else 0.0


def follow(p, t, depth):
    """Run of the springs on from an instant at which both contacts hold; None if the rigid reference ends before."""
    start = before(p, t)
    if start is None:
        return None
    load = max(p.mass * p.gravity, start[5], start[6])
    k = load / (depth * p.radius)
    frequency = math.sqrt(k / p.mass)
    until = p.span
    slow = load / p.mass / frequency
    v_rest = min(CREEPING * slow, rest_speed(p, start, min(until, t + 0.1), load, frequency))
    if p.model == SINGLE:
        p = p._replace(inertia=1.0)
        outward = np.array([math.sin(start[1]), -math.cos(start[1])])
        turned = np.array([-outward[1], outward[0]])
        y = np.array([*(p.radius + start[5] / k) * outward, 0.0, *start[2] * p.radius * turned, 0.0, 0.0, 0.0])
    else:
        y = place(p, start, k, k, v_rest)
    scale = depth * p.radius * np.array([1.0, 1.0, 1.0 / p.radius, *(frequency * np.array([1, 1, 1 / p.radius])), 1, 1])
    scale[6:] = 1.0
    s = damping(p.restitution) if p.restitution > 0.0 else math.inf
    out = np.zeros(10)
    rattle(smoothed(p, v_rest), s, k, SETTLED * math.sqrt(k * p.mass), SLOW * slow, LONGEST / frequency,
           LASTING / frequency, v_rest, start[0], y, until, scale, 0.4 / frequency, RTOL, MOST_STEPS, out)  # fmt: skip
    names = ("t", "steps", "open_time", "gap_max", "impact_speed_max", "impacts", "tumbles", "lasting_tumbles", "open",
             "lately_open")  # fmt: skip
    phi, omega = y[2], y[5]
    if p.model == SINGLE:
        # The angle of a particle is that of its place.
        phi, omega = math.atan2(y[0], -y[1]), (y[0] * y[4] - y[1] * y[3]) / (y[0] ** 2 + y[1] ** 2)
    return dict(zip(names, out, strict=True)) | {"phi_end": phi, "omega_end": omega, "k": k}


def words(found):
    """Words for what the springs did: if a contact is closed once it has settled, and if it must stay so."""
    said = [("tumbles", "open"), ("lasting_tumbles", "lately_open")]
    return ["tumbled" if found[turns] else "open" if found[ends] else "recovered" for turns, ends in said]


def opinion(p, said, t):
    """Opinion on what follows a contact that is lost at t.

    Parameters
    ----------
    p : Problem
    said : str
        ``recovered``, ``open`` or ``tumbled``.
    t : float
        Time of the loss, s.

    """
    runs = [follow(p, max(0.0, t - 1e-4), depth) for depth in DEPTHS]
    if None in runs or any(run["t"] < p.span for run in runs):
        return Opinion("undecided", "the run did not end", [run for run in runs if run])
    told = [words(run) for run in runs]
    why = " / ".join(
        f"{' or '.join(sorted(set(both)))}, up to {run['gap_max']:.4g} m" for both, run in zip(told, runs, strict=True)
    )
    found = set(told[0]) | set(told[1])
    if found == {said}:
        return Opinion("confirmed", why, runs)
    return Opinion("undecided" if said in found else "contradicted", why, runs)


def why_apart(p, t, rigid, log):
    """Why springs have another word than the rigid body.

    ``shared impact`` if they part from it in an impact at one contact while the other one holds: there the impulse goes
    through both contacts, and rigid bodies do not say in which order they give way. ``undecided`` if stiffer springs
    part from softer ones as soon as from the rigid body: what depends on the stiffness says nothing about a rigid body.
    Else ``contradicted``.

    Parameters
    ----------
    p : Problem
    t : float
        Time of the loss, s.
    rigid : callable
        Outcomes of the rigid body, by name, at the end of a span, s.
    log : ndarray, (events, 5)
        Events of the rigid body.

    """
    instants = np.concatenate(([t], log[log[:, 1] == HIT, 0], [p.span]))
    # Hundreds of small rebounds may lie between the impacts that matter.
    pauses = [(earlier, now) for earlier, now in pairwise(instants) if now - earlier >= 1e-4]
    together, fastest = math.nan, HARDLY * math.sqrt(p.gravity / p.radius)
    for earlier, now in pauses[:LOOKED_AT]:
        # Impacts of springs last for a while, and come a little sooner or later than those of the rigid body. Just
        # before an impact one of both bodies may have hit already; midway between two of them neither has.
        between = 0.5 * (earlier + now)
        runs = [follow(p._replace(span=between), max(0.0, t - 1e-4), depth)["omega_end"] for depth in DEPTHS]
        found = rigid(between)["speed"]
        fastest = max(fastest, *map(abs, runs), abs(found))
        if abs(runs[-1] - found) > PARTED * fastest:
            if together > t and rigid(together)["closed"] > 0:
                return SHARED
            return "undecided" if np.ptp(runs) > PARTED * fastest else "contradicted"
        # Just before the impact in which they may part.
        together = now - 0.02 * (now - earlier)
    return "contradicted"
