"""The body with three degrees of freedom in the plane of the race: centre of mass (x, y) and angle psi of the rod.

The state of motion is q = (x, y, psi, and their rates); y points upwards. Ball 1 is at -half_distance along the rod,
ball 2 at +half_distance, both `offset` beside the centre of mass, towards the axis at psi = phi.
A contact i (1 or 2) pushes with N along the inward normal and with T along the race, where its ball is nearest to it.
A single contact is ball 1 of a body without extent; its angle psi has no meaning.
"""

import math

import numpy as np

from benchmarks.reference.compiled import copy, inner, kernel
from benchmarks.reference.problem import SINGLE

#: Error of a velocity at a contact, in velocities that it is the difference of.
ROUNDING = 1e-15


@inner
def arm(p, i, psi):
    """Centre of ball i, from the centre of mass."""
    a = p.half_distance if i == 2 else -p.half_distance
    return a * math.cos(psi) - p.offset * math.sin(psi), a * math.sin(psi) + p.offset * math.cos(psi)


@kernel
def ball(p, q, i):
    """Distance of ball i from the axis, its unit vector outwards, and its velocity along both."""
    bx, by = arm(p, i, q[2])
    cx, cy = q[0] + bx, q[1] + by
    wx, wy = q[3] - q[5] * by, q[4] + q[5] * bx
    distance = math.hypot(cx, cy)
    ux, uy = cx / distance, cy / distance
    return distance, ux, uy, ux * wx + uy * wy, ux * wy - uy * wx


@kernel
def contact(p, q, ring_omega, i):
    """Gap of contact i, its rate, and the sliding velocity."""
    distance, _, _, out, along = ball(p, q, i)
    return p.radius - p.ball_radius - distance, -out, along + p.ball_radius * q[5] - p.radius * ring_omega


@inner
def load(p, q, i, N, T):
    """Force and moment about the centre of mass of contact i."""
    _, ux, uy, _, _ = ball(p, q, i)
    bx, by = arm(p, i, q[2])
    fx, fy = -N * ux - T * uy, -N * uy + T * ux
    rx, ry = bx + p.ball_radius * ux, by + p.ball_radius * uy
    return fx, fy, rx * fy - ry * fx


@inner
def inertia(p):
    """Moment of inertia; any number will do for a single contact."""
    return p.inertia if p.model != SINGLE else 1.0


@inner
def acceleration(p, q, ring_epsilon, fx, fy, moment, i):
    """Accelerations of gap i and of sliding at contact i, and of psi, under a load on the body."""
    ax, ay, epsilon = fx / p.mass, fy / p.mass - p.gravity, moment / inertia(p)
    bx, by = arm(p, i, q[2])
    # Acceleration of the centre of the ball.
    ax += -epsilon * by - q[5] * q[5] * bx
    ay += epsilon * bx - q[5] * q[5] * by
    distance, ux, uy, out, along = ball(p, q, i)
    gap = -(ux * ax + uy * ay + along * along / distance)
    slide = ux * ay - uy * ax - out * along / distance + p.ball_radius * epsilon - p.radius * ring_epsilon
    return gap, slide, epsilon


@inner
def response(p, q, ring_epsilon, i, K):
    """What a reaction with friction K does at contact i: b and A of its gap, and of its sliding."""
    gap, slide, _ = acceleration(p, q, ring_epsilon, 0.0, 0.0, 0.0, i)
    fx, fy, moment = load(p, q, i, p.mass, K * p.mass)
    gap1, slide1, _ = acceleration(p, q, ring_epsilon, fx, fy, moment, i)
    return gap, (gap1 - gap) / p.mass, slide, (slide1 - slide) / p.mass


@inner
def sliding_forces(p, q, ring_epsilon, i, K):
    """Only contact i is closed and slides with friction K: reaction, friction, and A (times the mass)."""
    b, a, _, _ = response(p, q, ring_epsilon, i, K)
    return -b / a, -K * b / a, a * p.mass


@inner
def sticking_forces(p, q, ring_epsilon, i):
    """Only contact i is closed and sticks: reaction and friction."""
    b, a, s, c = response(p, q, ring_epsilon, i, 0.0)
    # The second column is the response to friction alone.
    _, a1, _, c1 = response(p, q, ring_epsilon, i, 1.0)
    a_t, c_t = a1 - a, c1 - c
    det = a * c_t - a_t * c
    return (a_t * s - c_t * b) / det, (c * b - a * s) / det


@kernel
def pivot(p, i, theta, ring_omega, y, q):
    """Write to q the motion of a body on contact i alone.

    y = (angle of the contact in the frame of the ring, psi, sliding velocity, rate of psi).
    """
    angle, reach = y[0] + theta, p.radius - p.ball_radius
    along = y[2] - p.ball_radius * y[3] + p.radius * ring_omega
    bx, by = arm(p, i, y[1])
    ux, uy = math.sin(angle), -math.cos(angle)
    q[0], q[1], q[2] = reach * ux - bx, reach * uy - by, y[1]
    q[3], q[4], q[5] = -along * uy + y[3] * by, along * ux - y[3] * bx, y[3]


@kernel
def shock(p, q, ring_omega, touching, e, mu):
    """Impact at all contacts that touch, by Newton's law with Moreau's complementarity and Coulomb friction.

    Parameters
    ----------
    touching : array of bool
        Whether contact 1 and contact 2 touch.
    e, mu : array of float
        Coefficients of restitution and of friction of both contacts.

    Returns
    -------
    tuple
        Number of solutions; impulses (N1, T1, N2, T2); velocities after (gap 1, sliding 1, gap 2, sliding 2).

    """
    n = int(touching[0]) + int(touching[1])
    W, before = np.zeros((3, 2 * n)), np.zeros(2 * n)
    ee, mm, place = np.zeros(n), np.zeros(n), np.zeros(n, np.int64)
    m, misfit = 0, 0.0
    for i in (1, 2):
        if touching[i - 1]:
            W[0, 2 * m], W[1, 2 * m], W[2, 2 * m] = load(p, q, i, 1.0, 0.0)
            W[0, 2 * m + 1], W[1, 2 * m + 1], W[2, 2 * m + 1] = load(p, q, i, 0.0, 1.0)
            gap, before[2 * m], before[2 * m + 1] = contact(p, q, ring_omega, i)
            # Velocities relative to the race are differences, and rounding matters to slow ones. Where two contacts
            # stick, a gap that counts as closed does not fit them either.
            misfit += (abs(gap) + ROUNDING * p.radius) * (abs(q[5]) + abs(ring_omega))
            misfit += ROUNDING * (abs(q[3]) + abs(q[4]))
            ee[m], mm[m], place[m] = e[i - 1], mu[i - 1], i - 1
            m += 1
    M = np.array([p.mass, p.mass, inertia(p)])
    G = np.zeros((2 * n, 2 * n))
    for r in range(2 * n):
        for c in range(2 * n):
            for j in range(3):
                G[r, c] += W[j, r] * W[j, c] / M[j]
    count, impulse, after = impact(G, before, ee, mm, misfit)
    full, speeds = np.zeros(4), np.zeros(4)
    for m in range(n):
        for j in range(2):
            full[2 * place[m] + j], speeds[2 * place[m] + j] = impulse[2 * m + j], after[2 * m + j]
    return count, full, speeds


@kernel
def impact(G, before, e, mu, misfit=0.0):
    """Solutions of an impact of any body at n contacts, by trial of all 4^n modes.

    Impulses P and velocities after = before + G P satisfy, at each contact, with normal part N and tangential part T:
    P_N >= 0, after_N + e before_N >= 0, and their product is 0; |P_T| <= mu P_N, against the sliding after the impact.

    Parameters
    ----------
    G : array, (2n, 2n)
        Inverse mass at the contacts, in the order N, T of contact 1, N, T of contact 2, ...
    before : array, (2n,)
        Velocities before.
    e, mu : array, (n,)
    misfit : float
        How far `before` may be from the velocities of one rigid body, m/s.

    Returns
    -------
    tuple
        Number of different velocities after the impact, impulses, velocities after: of several, the slowest ones.
        Where several impulses give the same velocities, which are in stick at several contacts, these are in the middle
        of them.

    """
    n = e.size
    scale = np.max(np.abs(before)) + 1e-300
    small = 1e-10 * scale + misfit
    count, best, result = 0, np.zeros(2 * n), before.copy()
    for code in range(4**n):
        # Modes of a contact: 0 open, 1 stick, 2 slip forward, 3 slip backward.
        A, b = np.zeros((2 * n, 2 * n)), np.zeros(2 * n)
        mode, rest, stuck = np.zeros(n, np.int64), code, 0
        for i in range(n):
            mode[i] = rest % 4
            rest //= 4
            N, T = 2 * i, 2 * i + 1
            if mode[i] == 0:
                A[N, N] = A[T, T] = G[N, N]
                continue
            copy(G[N], A[N])
            b[N] = -(1.0 + e[i]) * before[N]
            if mode[i] == 1:
                copy(G[T], A[T])
                b[T] = -before[T]
                stuck += 1
            else:
                A[T, T], A[T, N] = G[N, N], G[N, N] * (mu[i] if mode[i] == 2 else -mu[i])
        U, s, V = np.linalg.svd(A)
        rank = np.sum(s > 1e-12 * s[0])
        if rank < 2 * n and stuck < 2:
            continue
        P, reached = np.zeros(2 * n), True
        for k in range(rank):
            P += V[k] * (np.dot(np.ascontiguousarray(U[:, k]), b) / s[k])
        if np.max(np.abs(np.dot(A, P) - b)) > small:
            continue
        if rank == 2 * n - 1:
            # Move along the impulses that change nothing to the middle of what the inequalities allow.
            low, high = -math.inf, math.inf
            for i in range(n):
                for side in (-1.0, 1.0):
                    value = mu[i] * P[2 * i] + side * P[2 * i + 1]
                    slope = mu[i] * V[-1, 2 * i] + side * V[-1, 2 * i + 1]
                    if slope > 0.0:
                        low = max(low, -value / slope)
                    elif slope < 0.0:
                        high = min(high, -value / slope)
            reached = low <= high
            if math.isfinite(low) and math.isfinite(high):
                P += V[-1] * (0.5 * (low + high))
        after = before + np.dot(G, P)
        tiny = small / np.max(np.diag(G))
        for i in range(n):
            N, T = 2 * i, 2 * i + 1
            if mode[i] == 0:
                reached &= after[N] + e[i] * before[N] >= -small
                P[N] = P[T] = 0.0
                continue
            reached &= P[N] >= -tiny
            after[N] = -e[i] * before[N] + 0.0
            if mode[i] == 1:
                reached &= abs(P[T]) <= mu[i] * P[N] + tiny
                after[T] = 0.0
            else:
                reached &= (after[T] if mode[i] == 2 else -after[T]) >= -small
        if not reached:
            continue
        if count > 0 and np.max(np.abs(after - result)) <= 100.0 * small:
            continue
        count += 1
        if count == 1 or np.max(np.abs(after)) < np.max(np.abs(result)):
            best, result = P, after
    return count, best, result
