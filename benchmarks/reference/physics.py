"""Newton-Euler equations of the body in the ring and on the belt, and the contact problem wherever friction jumps.

The state is y = (rho, v, z1, z2): position in the frame of the ring or belt, sliding velocity, deflections of the
bristles. K is the friction force at a contact over its reaction, positive in the direction of the angle. A `piece` is
an interval of sliding velocities on which the law is one smooth formula. Its sign is the direction of sliding, its
magnitude counts the intervals from rest outwards.
"""

import math

import numpy as np

from benchmarks.reference import free
from benchmarks.reference.compiled import inner, kernel
from benchmarks.reference.problem import (
    ARCTAN,
    BELT,
    BENGISU,
    BUMP,
    CONSTANT,
    CUBIC,
    DAHL,
    ELASTO,
    HUMP,
    JUMP,
    KARNOPP,
    LINEAR,
    NONE,
    POWER,
    RESET,
    RING,
    SINGLE,
    SINUSOIDAL,
    STICTION,
    TENT,
    THRELFALL,
    TURN,
    TUSTIN,
)

#: Where steps must end about a narrow bump of a law, in widths.
BUMP_CORNERS = np.array([-6.0, -3.0, -1.5, 0.0, 1.5, 3.0, 6.0])
#: Solutions of a contact problem: stick, slip backward or forward, contacts that separate, no solution, several.
STICK, BACKWARD, FORWARD, OPEN_1, OPEN_2, OPEN_BOTH, JAMMED, SEVERAL = np.array([0, -1, 1, 2, 3, 4, 5, 6])
#: Which contacts are closed: only one of them, or both.
ONLY_1, ONLY_2, CLOSED = np.array([1, 2, 3])
#: A determinant below this share of its value without friction counts as zero.
LEAST_DETERMINANT = 1e-6


@kernel
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


@inner
def coefficient(p, piece, speed, mu_s, mu_k):
    """Friction coefficient of a law without bristles at a sliding speed, by the formula of a piece."""
    size = abs(piece)
    if p.law == TUSTIN:
        return mu_k + (mu_s - mu_k) * math.exp(-max(p.alpha * speed, -50.0))
    if p.law == BUMP:
        x = (speed - p.vb) / p.w
        return mu_k + p.h * math.exp(-x * x)
    if p.law == TENT and 1 < size < 4:
        return mu_k + p.h * (1.0 + (speed - p.vb) / p.w * (1.0 if size == 2 else -1.0))
    if p.law == HUMP and size == 2:
        x = (speed - p.vb) / p.w
        return mu_s - p.unit * x * x
    if p.law == JUMP:
        return mu_s if size == 1 else mu_k
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


@kernel
def steady(p, v, mu_s, mu_k):
    """Traction of bristles in steady sliding, without its viscous part."""
    if p.law == DAHL or p.law == RESET:
        return mu_k
    x = v / p.v_s
    return mu_k + (mu_s - mu_k) * math.exp(-x * x)


@inner
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


@inner
def corners(p, piece):
    """Least and greatest sliding speed of a piece."""
    size = abs(piece)
    if p.law == THRELFALL or p.law == BENGISU:
        return (0.0, p.v0) if size == 1 else (p.v0, math.inf)
    if p.law == LINEAR or p.law == CUBIC:
        if size == 1:
            return 0.0, p.v0
        return (p.v0, p.v1) if size == 2 else (p.v1, math.inf)
    if p.law == BUMP or p.law == TENT or p.law == HUMP or p.law == JUMP:
        if p.law == BUMP:
            places = p.vb + p.w * BUMP_CORNERS
        elif p.law == TENT:
            places = p.vb + p.w * np.array([-1.0, 0.0, 1.0])
        elif p.law == HUMP:
            # Only for a surface that is the same everywhere.
            places = p.vb + p.w * math.sqrt((p.mu_s[0] - p.mu_k[0]) / p.unit) * np.array([-1.0, 1.0])
        else:
            places = np.array([p.vb])
        low = places[size - 2] if size > 1 else 0.0
        return low, places[size - 1] if size <= places.size else math.inf
    if p.law == KARNOPP:
        # The dead band has two pieces: 1 while friction holds the load, 3 while the load exceeds mu_s.
        return (p.dead_band, math.inf) if size == 2 else (-p.dead_band, p.dead_band)
    return 0.0, math.inf


@kernel
def piece_of(p, v):
    """Piece of a sliding velocity."""
    size = abs(FORWARD)
    while abs(v) >= corners(p, size)[1]:
        size += 1
    return size if v >= 0.0 else -size


@inner
def bound(p, k):
    """Lower edge of segment k; k counts segments over all turns."""
    m = p.edges.size
    return p.edges[k % m] + TURN * (k // m)


@kernel
def segment(p, x):
    """Segment of an angle in the frame of the ring; an edge belongs to the segment above it."""
    turns = math.floor(x / TURN)
    k = np.searchsorted(p.edges, x - TURN * turns, side="right") - 1 + int(turns) * p.edges.size
    while bound(p, k) > x:
        k -= 1
    while bound(p, k + 1) <= x:
        k += 1
    return k


@inner
def accelerations(p, phi, omega, ring_epsilon, N1, T1, N2, T2):
    """Newton-Euler equations of the body with three degrees of freedom, both of whose balls touch the race.

    Linear momentum along the radius and the tangent of the centre of mass, and angular momentum about it. The forces N
    (inwards) and T (along the race) act on the balls where they touch the race.

    Returns
    -------
    tuple of float
        Accelerations of both gaps, and of both contacts along the race relative to it, m/s^2; angular acceleration of
        the body, rad/s^2.

    """
    sb, cb, g, w2 = math.sin(p.beta), math.cos(p.beta), p.gravity, omega * omega
    a, d, r, reach = p.half_distance, p.offset, p.ball_radius, p.radius - p.ball_radius
    radial = g * math.cos(phi) + (sb * (T1 - T2) - cb * (N1 + N2)) / p.mass
    tangential = -g * math.sin(phi) + (sb * (N1 - N2) + cb * (T1 + T2)) / p.mass
    angular = (
        a * cb * (N2 - N1) + (a * sb + r) * (T1 + T2) - d * p.mass * (tangential + g * math.sin(phi))
    ) / p.inertia
    # The centres of the balls are at -a and +a along the tangent, and at -d along the radius.
    out1, on1 = radial + a * angular + d * w2, tangential - d * angular + a * w2
    out2, on2 = radial - a * angular + d * w2, tangential - d * angular - a * w2
    gap1, gap2 = -(cb * out1 - sb * on1 + w2 * reach), -(cb * out2 + sb * on2 + w2 * reach)
    spin = r * angular - p.radius * ring_epsilon
    return gap1, gap2, sb * out1 + cb * on1 + spin, cb * on2 - sb * out2 + spin, angular


@inner
def response(p, phi, omega, K1, K2):
    """Accelerations A N + b of both gaps under the reactions N of contacts with friction K1 N1 and K2 N2."""
    b1, b2, _, _, _ = accelerations(p, phi, omega, 0.0, 0.0, 0.0, 0.0, 0.0)
    a11, a21, _, _, _ = accelerations(p, phi, omega, 0.0, 1.0, K1, 0.0, 0.0)
    a12, a22, _, _, _ = accelerations(p, phi, omega, 0.0, 0.0, 0.0, 1.0, K2)
    return a11 - b1, a12 - b1, a21 - b2, a22 - b2, b1, b2


@inner
def closed(p, phi, omega, K1, K2):
    """Both contacts closed and sliding: angular acceleration, reactions, and det A over its value without friction."""
    if p.model == SINGLE:
        N = p.mass * (p.gravity * math.cos(phi) + p.radius * omega * omega)
        return (K1 * N / p.mass - p.gravity * math.sin(phi)) / p.radius, N, N, 1.0
    # The reactions keep both gaps closed.
    a11, a12, a21, a22, b1, b2 = response(p, phi, omega, K1, K2)
    det = a11 * a22 - a12 * a21
    N1, N2 = (a12 * b2 - a22 * b1) / det, (a21 * b1 - a11 * b2) / det
    f11, f12, f21, f22, _, _ = response(p, phi, omega, 0.0, 0.0)
    epsilon = accelerations(p, phi, omega, 0.0, N1, K1 * N1, N2, K2 * N2)[4]
    return epsilon, N1, N2, det / (f11 * f22 - f12 * f21)


@inner
def friction(p, k, piece, v, z):
    """Friction K of a contact on segment k, and the rate of its bristles."""
    j = k % p.edges.size
    if p.law >= DAHL:
        rate, traction = bristle(p, piece, v, z, p.mu_s[j], p.mu_k[j])
        return -traction, rate
    sign = 1.0 if piece > 0 else -1.0
    return -sign * coefficient(p, piece, sign * v, p.mu_s[j], p.mu_k[j]), 0.0


@inner
def pull(p, t, x):
    """Force of the spring and of the drive on a body on the belt."""
    return p.force * math.sin(TURN * p.force_frequency * t + p.force_phase) - (p.stiffness + p.cubic * x * x) * x


@inner
def load_on_band(p, t, y):
    """Friction force with which a body on the belt keeps its sliding velocity."""
    theta, _, ring_epsilon = drive(p, t)
    return pull(p, t, y[0] + theta) - p.mass * ring_epsilon


@inner
def state(p, k1, k2, piece, t, y):
    """Kinematics, reactions and rates of the bristles.

    Returns angle, angular velocity and angular acceleration of the body, both reactions, determinant (see
    :func:`closed`), angular acceleration of the ring, and both rates of the bristles.
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
        epsilon = (K1 + pull(p, t, phi)) / p.mass
        return phi, omega, epsilon, 1.0, 1.0, 1.0, ring_epsilon, rate1, 0.0
    K2, rate2 = friction(p, k2, piece, y[1], y[3]) if p.model == RING else (0.0, 0.0)
    epsilon, N1, N2, det = closed(p, phi, omega, K1, K2)
    return phi, omega, epsilon, N1, N2, det, ring_epsilon, rate1, rate2


@inner
def on_one(p, closed, k, piece, t, y, q):
    """Body on one closed contact (see :func:`free.pivot`), which sticks if `piece` is 0; its motion is written to q.

    Returns reaction, friction force, accelerations of sliding and of psi, velocity of
    the contact in the frame of the ring, and A (1 in stick).
    """
    theta, ring_omega, ring_epsilon = drive(p, t)
    free.pivot(p, closed, theta, ring_omega, y, q)
    if piece == STICK:
        N, T = free.sticking_forces(p, q, ring_epsilon, closed)
        A = 1.0
    else:
        K = friction(p, k, piece, y[2], 0.0)[0]
        N, T, A = free.sliding_forces(p, q, ring_epsilon, closed, K)
    fx, fy, moment = free.load(p, q, closed, N, T)
    _, slide, epsilon = free.acceleration(p, q, ring_epsilon, fx, fy, moment, closed)
    onward = (y[2] - p.ball_radius * (y[3] - ring_omega)) / (p.radius - p.ball_radius)
    return N, T, (0.0 if piece == STICK else slide), epsilon, onward, A


@inner
def rates(p, closed, k1, k2, piece, t, y, f):
    """Write the rates of the state to f."""
    if closed != CLOSED:
        _, _, f[2], f[3], f[0], _ = on_one(p, closed, k1, piece, t, y, np.empty(6))
        f[1] = y[3]
        return
    _, _, epsilon, _, _, _, ring_epsilon, f[2], f[3] = state(p, k1, k2, piece, t, y)
    # In Karnopp's dead band the sliding velocity is zero; what the state holds is the momentum.
    f[0] = 0.0 if p.law == KARNOPP and abs(piece) != 2 else y[1] / p.radius
    f[1] = p.radius * (epsilon - ring_epsilon)


@inner
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


@inner
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


@inner
def alone(p, phi, omega, ring_epsilon, held, N, T):
    """Accelerations of gap and sliding of contact `held` (1 or 2), which alone acts, and of the other gap."""
    if held == 1:
        gap, other, slide, _, _ = accelerations(p, phi, omega, ring_epsilon, N, T, 0.0, 0.0)
    else:
        other, gap, _, slide, _ = accelerations(p, phi, omega, ring_epsilon, 0.0, 0.0, N, T)
    return gap, slide, other


@inner
def one_open(p, phi, omega, ring_epsilon, held, K, stuck):
    """Only contact `held` (1 or 2) is closed; it sticks, or slides with friction K.

    Returns reaction, friction, sliding acceleration of this contact, and acceleration of the other gap. The reaction is
    NaN if more reaction would not open the closed contact.
    """
    gap0, slide0, _ = alone(p, phi, omega, ring_epsilon, held, 0.0, 0.0)
    if stuck:
        gap_n, slide_n, _ = alone(p, phi, omega, ring_epsilon, held, 1.0, 0.0)
        gap_t, slide_t, _ = alone(p, phi, omega, ring_epsilon, held, 0.0, 1.0)
        gap_n, gap_t, slide_n, slide_t = gap_n - gap0, gap_t - gap0, slide_n - slide0, slide_t - slide0
        det = gap_n * slide_t - gap_t * slide_n
        N, T = (gap_t * slide0 - slide_t * gap0) / det, (slide_n * gap0 - gap_n * slide0) / det
    else:
        stiffness = alone(p, phi, omega, ring_epsilon, held, 1.0, K)[0] - gap0
        N = -gap0 / stiffness if stiffness > 0.0 else math.nan
        T = K * N
    _, slide, other = alone(p, phi, omega, ring_epsilon, held, N, T)
    return N, T, slide, other


@inner
def opening(p, phi, omega, ring_epsilon, K1, K2, least, at_rest, s1, s2):
    """Which contact can separate while the other holds, or whether both can at once.

    With `at_rest` the contact that holds may stick (up to s1, s2) or slide in either direction (K1, K2 are magnitudes
    then). Otherwise it slides with friction K1 or K2.
    """
    weight = p.mass * p.gravity
    # With `least` > 0 a contact is lost early, at a gap that does not open yet.
    yet = -20.0 * max(least, 0.0) * p.gravity
    found, several = JAMMED, 0
    for held in (2, 1):
        K, limit = (K2, s2) if held == 2 else (K1, s1)
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
            found, several = (OPEN_1 if held == 2 else OPEN_2), several + 1
    # Free flight of both contacts.
    gap1, gap2, _, _, _ = accelerations(p, phi, omega, ring_epsilon, 0.0, 0.0, 0.0, 0.0)
    if gap1 > 0.0 and gap2 > 0.0:
        found, several = OPEN_BOTH, several + 1
    return SEVERAL if several > 1 else found


@inner
def sliding_problem(p, k1, k2, piece, t, y, least):
    """Contact problem at a sliding velocity that is not zero: the direction of slip, or how slip ends."""
    phi, omega, _, N1, N2, det, ring_epsilon, _, _ = state(p, k1, k2, piece, t, y)
    sense = FORWARD if piece > 0 else BACKWARD
    if p.model == BELT:
        return sense
    floor = least * p.mass * p.gravity
    if p.model == SINGLE:
        return sense if floor < N1 else OPEN_1
    if floor < N1 and floor < N2:
        return sense if det > LEAST_DETERMINANT else JAMMED
    K1, K2 = friction(p, k1, piece, y[1], y[2])[0], friction(p, k2, piece, y[1], y[3])[0]
    return opening(p, phi, omega, ring_epsilon, K1, K2, least, False, 0.0, 0.0)


@inner
def stick_reactions(p, k1, k2, t, rho):
    """Saturation of friction, and reactions, of a body that sticks to the ring; NaN if it cannot.

    Of two solutions this is the one that is farther from breakaway and from separation.
    """
    theta, ring_omega, ring_epsilon = drive(p, t)
    phi, M, g = rho + theta, p.mass, p.gravity
    m1, m2 = p.mu_s[k1 % p.edges.size], p.mu_s[k2 % p.edges.size]
    if p.model == SINGLE:
        N = M * (g * math.cos(phi) + p.radius * ring_omega * ring_omega)
        return -M * (p.radius * ring_epsilon + g * math.sin(phi)) / (m1 * N), N, N
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
        return math.nan, math.nan, math.nan
    big = -0.5 * (b + math.copysign(math.sqrt(disc), b))
    best, saturation, first, second = -math.inf, math.nan, math.nan, math.nan
    for root in (big / a, c / big if big != 0.0 else 0.0):
        N1, N2, capacity = 0.5 * (root + d), 0.5 * (root - d), m * root + n * d
        kappa = q / capacity if capacity != 0.0 else (0.0 if q == 0.0 else math.inf)
        reserve = min(1.0 - abs(kappa), N1 / (M * g), N2 / (M * g))
        if reserve > best:
            best, saturation, first, second = reserve, kappa, N1, N2
    return saturation, first, second


@inner
def stick_reserves(p, k1, k2, t, rho, least):
    """Distances of a body in stick from breakaway and from the separation of each contact; positive if it can stick."""
    if p.model == BELT:
        theta, _, ring_epsilon = drive(p, t)
        load = pull(p, t, rho + theta) - p.mass * ring_epsilon
        return 1.0 - abs(load) / p.mu_s[k1 % p.edges.size], 1.0, 1.0
    kappa, N1, N2 = stick_reactions(p, k1, k2, t, rho)
    if not abs(kappa) < math.inf:
        return -1.0, -1.0, -1.0
    weight = p.mass * p.gravity
    return 1.0 - abs(kappa), N1 / weight - least, N2 / weight - least


@inner
def stick_reserve(p, k1, k2, t, rho, least):
    """Least distance of a body in stick from breakaway and from separation; positive if it can stick."""
    slide, first, second = stick_reserves(p, k1, k2, t, rho, least)
    return min(slide, first, second)


@inner
def lower_segments(p, k1, k2, rho):
    """Segments of both contacts in slip backward: a contact on an edge belongs to the segment below it."""
    if rho - p.beta - bound(p, k1) <= 1e-14 * max(1.0, abs(rho)):
        k1 -= 1
    if rho + p.beta - bound(p, k2) <= 1e-14 * max(1.0, abs(rho)):
        k2 -= 1
    return k1, k2


@inner
def resting_problem(p, k1, k2, t, rho, least):
    """Contact problem at rest on the ring under a set-valued law: the mode that follows."""
    if stick_reserve(p, k1, k2, t, rho, least) >= 0.0:
        return STICK
    y = np.array([rho, 0.0, 0.0, 0.0])
    found = JAMMED
    for sense in (1, -1):
        j1, j2 = (k1, k2) if sense == 1 or p.model == BELT else lower_segments(p, k1, k2, rho)
        _, _, epsilon, N1, N2, det, ring_epsilon, _, _ = state(p, j1, j2, sense, t, y)
        if min(N1, N2) > least * p.mass * p.gravity and sense * (epsilon - ring_epsilon) > 0.0:
            if found != JAMMED or not det > LEAST_DETERMINANT:
                return JAMMED
            found = sense
    if p.model != RING:
        return found if found != JAMMED or p.model == BELT else OPEN_1
    if found == JAMMED:
        phi, ring_omega, ring_epsilon = rho + drive(p, t)[0], drive(p, t)[1], drive(p, t)[2]
        m = p.edges.size
        K1, K2 = -friction(p, k1, FORWARD, 0.0, 0.0)[0], -friction(p, k2, FORWARD, 0.0, 0.0)[0]
        found = opening(p, phi, ring_omega, ring_epsilon, K1, K2, least, True, p.mu_s[k1 % m], p.mu_s[k2 % m])
    return found


@inner
def is_set_valued(p):
    """Whether the law is set-valued at rest."""
    return p.law <= JUMP


@inner
def falls_at_rest(p):
    """Whether friction falls at once at breakaway."""
    return p.law == STICTION or p.law == BUMP or p.law == TENT or p.law == HUMP
