"""Newton-Euler equations of the body in the ring and on the belt, and the contact problem wherever friction jumps.

The state is y = (rho, v, z1, z2): position in the frame of the ring or belt, sliding velocity, deflections of the
bristles. K is the friction force at a contact over its reaction, positive in the direction of the angle. A `piece` is
an interval of sliding velocities on which the law is one smooth formula. Its sign is the direction of sliding, its
magnitude counts the intervals from rest outwards.
"""

import math

import numpy as np
from numba import njit

from benchmarks.reference.problem import (
    ARCTAN,
    BELT,
    BENGISU,
    CONSTANT,
    CUBIC,
    DAHL,
    ELASTO,
    KARNOPP,
    LINEAR,
    NONE,
    POWER,
    RESET,
    RING,
    SINGLE,
    SINUSOIDAL,
    STICTION,
    THRELFALL,
    TURN,
    TUSTIN,
)

#: Solutions of a contact problem: stick, slip backward or forward, contacts that separate, no solution, several.
STICK, BACKWARD, FORWARD, OPEN_1, OPEN_2, OPEN_BOTH, JAMMED, SEVERAL = 0, -1, 1, 2, 3, 4, 5, 6
#: An effective inertia below this share of the moment of inertia counts as zero.
LEAST_INERTIA = 1e-6


@njit(cache=True, error_model="numpy")
def drive(p, t):
    """Angle (or displacement) of the ring (or belt) and its first two derivatives."""
    a, n = p.amplitude, p.exponent
    if p.drive == NONE:
        return 0.0, 0.0, 0.0
    if p.drive == CONSTANT:
        return a * t, a, 0.0
    if p.drive == ARCTAN:
        return a * (t * math.atan(t) - 0.5 * math.log1p(t * t)), a * math.atan(t), a / (1.0 + t * t)
    if p.drive == POWER:
        if t <= 0.0 and n < 2.0:
            return 0.0, 0.0, math.copysign(1e12, a)
        return a * t**n, a * n * t ** (n - 1.0), a * n * (n - 1.0) * t ** (n - 2.0)
    if p.drive == SINUSOIDAL:
        w = TURN * p.frequency
        x = w * t + p.phase
        return a * math.sin(x), a * w * math.cos(x), -a * w * w * math.sin(x)
    k = min(max(np.searchsorted(p.knots, t, side="right") - 1, 0), p.pieces.shape[1] - 1)
    s = t - p.knots[k]
    c3, c2, c1, c0 = p.pieces[0, k], p.pieces[1, k], p.pieces[2, k], p.pieces[3, k]
    return (
        a * (((c3 * s + c2) * s + c1) * s + c0),
        a * ((3.0 * c3 * s + 2.0 * c2) * s + c1),
        a * (6.0 * c3 * s + 2.0 * c2),
    )


@njit(cache=True, error_model="numpy")
def coefficient(p, piece, speed, mu_s, mu_k):
    """Friction coefficient of a law without bristles at a sliding speed, by the formula of a piece."""
    size = abs(piece)
    if p.law == TUSTIN:
        return mu_k + (mu_s - mu_k) * math.exp(-max(p.alpha * speed, -50.0))
    if p.law == THRELFALL and size == 1:
        return mu_k * (1.0 - math.exp(-3.0 * max(speed / p.v0, -20.0))) / (1.0 - math.exp(-3.0))
    if p.law == LINEAR and size < 3:
        if size == 1:
            return mu_s * speed / p.v0
        return mu_s + (mu_k - mu_s) * (speed - p.v0) / (p.v1 - p.v0)
    if p.law == CUBIC and size < 3:
        if size == 1:
            x = speed / p.v0
            return 0.5 * mu_s * x * (3.0 - x * x)
        x = (speed - p.v0) / (p.v1 - p.v0)
        return mu_s + (mu_k - mu_s) * x * x * (3.0 - 2.0 * x)
    if p.law == BENGISU:
        if size == 1:
            x = 1.0 - speed / p.v0
            return mu_s * (1.0 - x * x)
        return mu_k + (mu_s - mu_k) * math.exp(-max(p.alpha * (speed - p.v0), -50.0))
    return mu_k


@njit(cache=True, error_model="numpy")
def steady(p, v, mu_s, mu_k):
    """Traction of bristles in steady sliding, without its viscous part."""
    if p.law == DAHL or p.law == RESET:
        return mu_k
    x = v / p.v_s
    return mu_k + (mu_s - mu_k) * math.exp(-x * x)


@njit(cache=True, error_model="numpy")
def bristle(p, piece, v, z, mu_s, mu_k):
    """Rate of the deflection z of bristles, and their traction."""
    sign = 1.0 if piece > 0 else -1.0
    if p.law == RESET:
        if abs(piece) == 2:
            return 0.0, mu_k * sign
        return v, p.sigma0 * z + p.sigma1 * v
    ratio = sign * p.sigma0 * z / steady(p, v, mu_s, mu_k)
    if p.law == DAHL:
        return v * (1.0 - ratio), p.sigma0 * z
    if p.law == ELASTO:
        low = p.elastic * mu_k / p.sigma0
        high = steady(p, v, mu_s, mu_k) / p.sigma0
        if abs(z) <= low or sign * z < 0.0:
            ratio = 0.0
        elif abs(z) < high:
            ratio *= 0.5 * (1.0 + math.sin(math.pi * (abs(z) - 0.5 * (high + low)) / (high - low)))
    rate = v * (1.0 - ratio)
    return rate, p.sigma0 * z + p.sigma1 * rate + p.sigma2 * v


@njit(cache=True, error_model="numpy")
def corners(p, piece):
    """Least and greatest sliding speed of a piece."""
    size = abs(piece)
    if p.law == THRELFALL or p.law == BENGISU:
        return (0.0, p.v0) if size == 1 else (p.v0, math.inf)
    if p.law == LINEAR or p.law == CUBIC:
        if size == 1:
            return 0.0, p.v0
        return (p.v0, p.v1) if size == 2 else (p.v1, math.inf)
    if p.law == KARNOPP:
        # The dead band has two pieces: 1 while friction holds the load, 3 while the load exceeds mu_s.
        return (p.dead_band, math.inf) if size == 2 else (-p.dead_band, p.dead_band)
    return 0.0, math.inf


@njit(cache=True, error_model="numpy")
def piece_of(p, v):
    """Piece of a sliding velocity."""
    size = 1
    while abs(v) >= corners(p, size)[1]:
        size += 1
    return size if v >= 0.0 else -size


@njit(cache=True, error_model="numpy")
def bound(p, k):
    """Lower edge of segment k; k counts segments over all turns."""
    m = p.edges.size
    return p.edges[k % m] + TURN * (k // m)


@njit(cache=True, error_model="numpy")
def segment(p, x):
    """Segment of an angle in the frame of the ring; an edge belongs to the segment above it."""
    turns = math.floor(x / TURN)
    k = np.searchsorted(p.edges, x - TURN * turns, side="right") - 1 + int(turns) * p.edges.size
    while bound(p, k) > x:
        k -= 1
    while bound(p, k + 1) <= x:
        k += 1
    return k


@njit(cache=True, error_model="numpy")
def closed(p, phi, omega, K1, K2):
    """Both contacts closed and sliding: acceleration, reactions, determinant of the reactions, effective inertia.

    Two balances of forces give the reactions as functions of the acceleration. The balance of moments about the axis
    gives the acceleration.
    """
    g, M, R = p.gravity, p.mass, p.radius
    if p.model == SINGLE:
        N = M * (g * math.cos(phi) + R * omega * omega)
        return (K1 * N / M - g * math.sin(phi)) / R, N, N, 1.0, 1.0
    sb, cb = math.sin(p.beta), math.cos(p.beta)
    radial = M * (g * math.cos(phi) + p.xi * omega * omega)
    tangential = M * g * math.sin(phi)
    a11, a12, a21, a22 = cb - K1 * sb, cb + K2 * sb, sb + K1 * cb, K2 * cb - sb
    D = a12 * a21 - a11 * a22
    N1, N2 = (a12 * tangential - a22 * radial) / D, (a21 * radial - a11 * tangential) / D
    slope1, slope2 = a12 * M * p.xi / D, -a11 * M * p.xi / D
    about = p.inertia + M * p.xi * p.xi
    effective = about - R * (K1 * slope1 + K2 * slope2)
    epsilon = (R * (K1 * N1 + K2 * N2) - p.xi * tangential) / effective
    return epsilon, N1 + slope1 * epsilon, N2 + slope2 * epsilon, D, effective / about


@njit(cache=True, error_model="numpy")
def friction(p, k, piece, v, z):
    """Friction K of a contact on segment k, and the rate of its bristles."""
    j = k % p.edges.size
    if p.law >= DAHL:
        rate, traction = bristle(p, piece, v, z, p.mu_s[j], p.mu_k[j])
        return -traction, rate
    sign = 1.0 if piece > 0 else -1.0
    return -sign * coefficient(p, piece, sign * v, p.mu_s[j], p.mu_k[j]), 0.0


@njit(cache=True, error_model="numpy")
def load_on_band(p, t, y):
    """Friction force with which a body on the belt keeps its sliding velocity."""
    theta, _, ring_epsilon = drive(p, t)
    return -p.stiffness * (y[0] + theta) - p.mass * ring_epsilon


@njit(cache=True, error_model="numpy")
def state(p, k1, k2, piece, t, y):
    """Kinematics, reactions and rates of the bristles.

    Returns angle, angular velocity and angular acceleration of the body, both reactions, determinant, effective
    inertia, angular acceleration of the ring, and both rates of the bristles.
    """
    theta, ring_omega, ring_epsilon = drive(p, t)
    phi, omega = y[0] + theta, y[1] / p.radius + ring_omega
    K1, rate1 = friction(p, k1, piece, y[1], y[2])
    if p.model == BELT:
        if p.law == KARNOPP and abs(piece) != 2:
            # In the dead band all friction, viscous friction too, balances the load up to mu_s.
            K1 = -load_on_band(p, t, y) if abs(piece) == 1 else -math.copysign(p.mu_s[0], piece)
        else:
            K1 -= p.viscous * y[1]
        epsilon = (K1 - p.stiffness * phi) / p.mass
        return phi, omega, epsilon, 1.0, 1.0, 1.0, 1.0, ring_epsilon, rate1, 0.0
    K2, rate2 = friction(p, k2, piece, y[1], y[3]) if p.model == RING else (0.0, 0.0)
    epsilon, N1, N2, D, effective = closed(p, phi, omega, K1, K2)
    return phi, omega, epsilon, N1, N2, D, effective, ring_epsilon, rate1, rate2


@njit(cache=True, error_model="numpy")
def rates(p, k1, k2, piece, t, y, f):
    """Write the rates of the state to f."""
    _, _, epsilon, _, _, _, _, ring_epsilon, f[2], f[3] = state(p, k1, k2, piece, t, y)
    f[0] = y[1] / p.radius
    f[1] = p.radius * (epsilon - ring_epsilon)


@njit(cache=True, error_model="numpy")
def factor(A, order, n):
    """LU factorisation of the leading n by n block of A, in place."""
    for i in range(n):
        pivot = i
        for r in range(i + 1, n):
            if abs(A[r, i]) > abs(A[pivot, i]):
                pivot = r
        order[i] = pivot
        if pivot != i:
            for c in range(n):
                A[i, c], A[pivot, c] = A[pivot, c], A[i, c]
        for r in range(i + 1, n):
            A[r, i] /= A[i, i]
            for c in range(i + 1, n):
                A[r, c] -= A[r, i] * A[i, c]


@njit(cache=True, error_model="numpy")
def substitute(A, order, b, n):
    """Solve for b with the LU factors, in place."""
    for i in range(n):
        b[i], b[order[i]] = b[order[i]], b[i]
    for i in range(n):
        for c in range(i):
            b[i] -= A[i, c] * b[c]
    for i in range(n - 1, -1, -1):
        for c in range(i + 1, n):
            b[i] -= A[i, c] * b[c]
        b[i] /= A[i, i]


@njit(cache=True, error_model="numpy")
def one_open(p, phi, omega, ring_epsilon, held, K, stuck):
    """Only contact `held` (-1: the first, 1: the second) is closed; it sticks, or slides with friction K.

    The unknowns are the radial, tangential and angular acceleration of the free body, and reaction and friction of the
    contact. Returns reaction, friction, sliding acceleration of this contact, and acceleration of the other gap.
    """
    sb, cb, M, g = math.sin(p.beta), math.cos(p.beta), p.mass, p.gravity
    a, w2, s = p.half_distance, omega * omega, float(held)
    A, b, order = np.zeros((5, 5)), np.zeros(5), np.zeros(5, np.int64)
    # Linear momentum along the radius and the tangent of the centre of mass, angular momentum about it.
    A[0, 0], A[0, 3], A[0, 4], b[0] = M, cb, s * sb, M * g * math.cos(phi)
    A[1, 1], A[1, 3], A[1, 4], b[1] = M, s * sb, -cb, -M * g * math.sin(phi)
    A[2, 2], A[2, 3], A[2, 4] = p.inertia, -p.xi * s * sb, p.xi * cb - p.radius
    # The ball of the closed contact stays on the race.
    reach = p.radius - p.ball_radius
    A[3, 0], A[3, 1], A[3, 2], b[3] = cb, s * sb, -s * a * cb, a * w2 * sb - w2 * reach
    slide = np.array([-s * sb, cb, a * sb + p.ball_radius])
    drift = -s * a * w2 * cb - p.radius * ring_epsilon
    if stuck:
        A[4, :3], b[4] = slide, -drift
    else:
        A[4, 3], A[4, 4] = -K, 1.0
    factor(A, order, 5)
    substitute(A, order, b, 5)
    radial, tangential = b[0] + s * a * b[2], b[1] + s * a * w2
    gap = -(cb * radial - s * sb * tangential + w2 * reach)
    return b[3], b[4], slide[0] * b[0] + slide[1] * b[1] + slide[2] * b[2] + drift, gap


@njit(cache=True, error_model="numpy")
def opening(p, phi, omega, ring_epsilon, K1, K2, least, at_rest, s1, s2):
    """Which contact can separate while the other holds, or whether both can at once.

    With `at_rest` the contact that holds may stick (up to s1, s2) or slide in either direction (K1, K2 are magnitudes
    then). Otherwise it slides with friction K1 or K2.
    """
    weight = p.mass * p.gravity
    # With `least` > 0 a contact is lost early, at a gap that does not open yet.
    yet = -20.0 * max(least, 0.0) * p.gravity
    found, several = JAMMED, 0
    for held in (1, -1):
        K, limit = (K2, s2) if held == 1 else (K1, s1)
        possible = False
        if at_rest:
            N, T, _, gap = one_open(p, phi, omega, ring_epsilon, held, 0.0, True)
            possible = least * weight < N and abs(T) <= limit * N and gap > yet
            for sign in (-1.0, 1.0):
                N, _, slide, gap = one_open(p, phi, omega, ring_epsilon, held, -sign * K, False)
                possible |= least * weight < N and gap > yet and sign * slide > 0.0
        else:
            N, _, _, gap = one_open(p, phi, omega, ring_epsilon, held, K, False)
            possible = least * weight < N and gap > yet
        if possible:
            found, several = (OPEN_1 if held == 1 else OPEN_2), several + 1
    # Free flight of both contacts.
    sb, cb, w2, g = math.sin(p.beta), math.cos(p.beta), omega * omega, p.gravity
    pull = cb * g * math.cos(phi) - w2 * p.half_distance * sb + w2 * (p.radius - p.ball_radius)
    if pull + sb * g * math.sin(phi) < 0.0 and pull - sb * g * math.sin(phi) < 0.0:
        found, several = OPEN_BOTH, several + 1
    return SEVERAL if several > 1 else found


@njit(cache=True, error_model="numpy")
def sliding_problem(p, k1, k2, piece, t, y, least):
    """Contact problem at a sliding velocity that is not zero: the direction of slip, or how slip ends."""
    phi, omega, _, N1, N2, D, effective, ring_epsilon, _, _ = state(p, k1, k2, piece, t, y)
    sense = FORWARD if piece > 0 else BACKWARD
    if p.model == BELT:
        return sense
    floor = least * p.mass * p.gravity
    if p.model == SINGLE:
        return sense if floor < N1 else OPEN_1
    if floor < N1 and floor < N2:
        return sense if D > 0.0 and effective > LEAST_INERTIA else JAMMED
    K1, K2 = friction(p, k1, piece, y[1], y[2])[0], friction(p, k2, piece, y[1], y[3])[0]
    return opening(p, phi, omega, ring_epsilon, K1, K2, least, False, 0.0, 0.0)


@njit(cache=True, error_model="numpy")
def stick_reserve(p, k1, k2, t, rho, least):
    """Distance of a body in stick from breakaway and from separation; positive if it can stick."""
    theta, ring_omega, ring_epsilon = drive(p, t)
    phi, M, g = rho + theta, p.mass, p.gravity
    weight, m1, m2 = M * g, p.mu_s[k1 % p.edges.size], p.mu_s[k2 % p.edges.size]
    if p.model == BELT:
        load = -p.stiffness * phi - M * ring_epsilon
        return 1.0 - abs(load) / m1
    if p.model == SINGLE:
        N = M * (g * math.cos(phi) + p.radius * ring_omega * ring_omega)
        need = abs(M * (p.radius * ring_epsilon + g * math.sin(phi)))
        return min((m1 * N - need) / weight, N / weight - least)
    # Friction forces are T = -kappa mu_s N. The moment about the axis gives their sum q, the tangential balance gives
    # the difference d of the reactions, and the radial balance gives a quadratic equation for the sum of the reactions.
    sb, cb = math.sin(p.beta), math.cos(p.beta)
    radial = M * (g * math.cos(phi) + p.xi * ring_omega * ring_omega)
    tangential = M * (p.xi * ring_epsilon + g * math.sin(phi))
    moment = (p.inertia + M * p.xi * p.xi) * ring_epsilon + M * g * p.xi * math.sin(phi)
    q = -moment / p.radius
    d = (tangential + cb * q) / sb
    m, n = 0.5 * (m1 + m2), 0.5 * (m1 - m2)
    a, b, c = cb * m, cb * n * d + sb * q * n - radial * m, sb * q * m * d - radial * n * d
    disc = b * b - 4.0 * a * c
    if not disc >= 0.0 or m <= 0.0:
        return -1.0
    big = -0.5 * (b + math.copysign(math.sqrt(disc), b))
    best = -math.inf
    for root in (big / a, c / big if big != 0.0 else 0.0):
        N1, N2, capacity = 0.5 * (root + d), 0.5 * (root - d), m * root + n * d
        kappa = q / capacity if capacity != 0.0 else (0.0 if q == 0.0 else math.inf)
        best = max(best, min(1.0 - abs(kappa), N1 / weight - least, N2 / weight - least))
    return best


@njit(cache=True, error_model="numpy")
def lower_segments(p, k1, k2, rho):
    """Segments of both contacts in slip backward: a contact on an edge belongs to the segment below it."""
    if rho - p.beta - bound(p, k1) <= 1e-14 * max(1.0, abs(rho)):
        k1 -= 1
    if rho + p.beta - bound(p, k2) <= 1e-14 * max(1.0, abs(rho)):
        k2 -= 1
    return k1, k2


@njit(cache=True, error_model="numpy")
def resting_problem(p, k1, k2, t, rho, least):
    """Contact problem at rest on the ring under a set-valued law: the mode that follows."""
    if stick_reserve(p, k1, k2, t, rho, least) >= 0.0:
        return STICK
    y = np.array([rho, 0.0, 0.0, 0.0])
    found = JAMMED
    for sense in (1, -1):
        j1, j2 = (k1, k2) if sense == 1 or p.model == BELT else lower_segments(p, k1, k2, rho)
        _, _, epsilon, N1, N2, D, effective, ring_epsilon, _, _ = state(p, j1, j2, sense, t, y)
        if min(N1, N2) > least * p.mass * p.gravity and sense * (epsilon - ring_epsilon) > 0.0:
            if found != JAMMED or not (D > 0.0 and effective > LEAST_INERTIA):
                return JAMMED
            found = sense
    if p.model != RING:
        return found if found != JAMMED or p.model == BELT else OPEN_1
    if found == JAMMED:
        phi, ring_omega, ring_epsilon = rho + drive(p, t)[0], drive(p, t)[1], drive(p, t)[2]
        m = p.edges.size
        K1, K2 = -friction(p, k1, 1, 0.0, 0.0)[0], -friction(p, k2, 1, 0.0, 0.0)[0]
        found = opening(p, phi, ring_omega, ring_epsilon, K1, K2, least, True, p.mu_s[k1 % m], p.mu_s[k2 % m])
    return found


@njit(cache=True, error_model="numpy")
def is_set_valued(p):
    """Whether the law is set-valued at rest."""
    return p.law <= TUSTIN


@njit(cache=True, error_model="numpy")
def falls_at_rest(p):
    """Whether friction falls at once at breakaway."""
    return p.law == STICTION
