"""A body of two balls, or a particle, that may leave the race of the ring and fall back on it.

Symbols: (x, y) is the centre of mass, psi the angle of the body, which is phi while both contacts hold. The centre of
ball i is ``c_i = rho e_r(alpha_i)`` with ``e_r(alpha) = (sin alpha, -cos alpha)`` outwards and
``e_t(alpha) = (cos alpha, sin alpha)`` along the race. Its gap is ``(R - r) - |c_i|``; its slip is the velocity of its
material point next to the race, along the race, relative to the race.

The impact law is Newton's with Moreau's complementarity (Moreau 1988; Glocker 2001). At all contacts without a gap

.. math::

    0 \\le \\Lambda_N \\perp \\gamma_N^+ + e\\,\\gamma_N^- \\ge 0, \\qquad
    -\\Lambda_T \\in \\mu_k \\Lambda_N \\operatorname{Sgn}(\\gamma_T^+),

where the velocities follow from the impulses by momentum and moment of momentum. The modes of the contacts (open, slip
in each direction, stick: at most 16) are tried one by one.

`opening` of a contact is the rate of its gap, m/s. A *row* has the changes of one velocity by unit impulses: inwards
and along the race at contact 1, then at contact 2. :mod:`ringsweep.models.ring.impact.switch` calls :func:`impulses`.
"""

from __future__ import annotations

from math import atan2, cos, hypot, sin
from typing import Any, NamedTuple

from ringsweep.compile import add_scaled, feature, inlined, replacing
from ringsweep.physics import ring
from ringsweep.quantities.parameters import Leaf


class Balls(NamedTuple):
    """Shape of the body; lengths in m.

    Attributes
    ----------
    reach : float
        Distance rho = R - r of the centre of a ball from the axis while it touches the race.
    radius : float
        Radius r of the balls.
    half_distance : float
        Half the distance 2a between the centres of the balls; 0 for a particle.
    offset : float
        Distance of the centre of mass from the line of the balls, positive away from the axis at psi = 0.
    """

    reach: Leaf
    radius: Leaf
    half_distance: Leaf
    offset: Leaf


class ImpactRing(NamedTuple):
    """Ring whose body may lose its contacts, and what follows.

    Attributes
    ----------
    closed, turned : Ring
        The ring while all contacts hold: contact 1 behind contact 2, and after the contacts have changed their order.
    law, drive, span
        As in :class:`ringsweep.physics.ring.Ring`.
    balls : Balls
    restitution : float
        Coefficient of restitution e, 1.
    has_kinetic : float
        1 if the friction law has a kinetic coefficient, which holds in an impact; 0 if its value at the slip before
        holds.
    """

    closed: Any
    turned: Any
    law: Any
    drive: Any
    span: Leaf
    balls: Balls
    restitution: Leaf
    has_kinetic: Leaf


class Motion(NamedTuple):
    """Motion of a free body: angle, rad; centre of mass, m; and their rates.

    For a particle psi is the angle of its place, from the downward vertical.
    """

    psi: float
    psi_dot: float
    x: float
    x_dot: float
    y: float
    y_dot: float


class Contact(NamedTuple):
    """A ball and the point of the race next to it.

    Attributes
    ----------
    alpha, sine, cosine : float
        Angle of the ball's centre from the downward vertical, from -pi to pi, rad; its sine and cosine.
    gap : float
        Gap, m.
    opening : float
        Rate of the gap, m/s.
    slip : float
        Velocity along the race, relative to it, m/s.
    lever_n, lever_t : float
        Moment about the centre of mass of a unit force inwards, and of one along the race, m.
    """

    alpha: float
    sine: float
    cosine: float
    gap: float
    opening: float
    slip: float
    lever_n: float
    lever_t: float


@feature("1.0", of=ring.TwoContacts)
def inertia(body):
    """Moment of inertia about the centre of mass, kg m^2. 1 for a particle, on which no force has a moment."""
    return body.inertia


@inlined
def side_of(contact):
    """+1 for contact 1 and -1 for contact 2: the side of the ball on which the centre of mass is."""
    return 1.0 if contact == 1 else -1.0


_with_rates = replacing("psi_dot", "x_dot", "y_dot")


@inlined
def relative_to_race(motion, ring_omega):
    """Motion as an observer sees it who turns with the race, m/s and rad/s."""
    x_dot, y_dot = motion.x_dot + ring_omega * motion.y, motion.y_dot - ring_omega * motion.x
    return _with_rates(motion, motion.psi_dot - ring_omega, x_dot, y_dot)


@inlined
def _center_of_ball(balls, contact, motion):
    """Place of a ball's centre from the centre of mass, and from the axis, m; and its velocity, m/s."""
    side, s, c = side_of(contact), sin(motion.psi), cos(motion.psi)
    a, h = side * balls.half_distance, balls.offset
    across, up = -h * s - a * c, h * c - a * s
    velocity = motion.x_dot - motion.psi_dot * up, motion.y_dot + motion.psi_dot * across
    return (across, up), (motion.x + across, motion.y + up), velocity


@inlined
def contact_of(balls, contact, motion):
    """A ball and the point of the race next to it; its slip is right if `motion` is relative to the race."""
    (across, up), (x, y), (x_dot, y_dot) = _center_of_ball(balls, contact, motion)
    distance = hypot(x, y)
    sine, cosine = x / distance, -y / distance
    return Contact(
        atan2(x, -y),
        sine,
        cosine,
        balls.reach - distance,
        y_dot * cosine - x_dot * sine,
        x_dot * cosine + y_dot * sine + balls.radius * motion.psi_dot,
        across * cosine + up * sine,
        balls.radius + across * sine - up * cosine,
    )


@inlined
def free_gap_acceleration(balls, contact, motion, gravity):
    """Second derivative of a gap of a body without contacts, m/s^2."""
    (across, up), (x, y), (x_dot, y_dot) = _center_of_ball(balls, contact, motion)
    square, distance = motion.psi_dot * motion.psi_dot, hypot(x, y)
    around = (x * y_dot - y * x_dot) / distance
    return (x * square * across + y * (square * up + gravity) - around * around) / distance


class Impulses(NamedTuple):
    """What an impact does.

    Attributes
    ----------
    solutions : int
        Number of different solutions of the impact law.
    normal_1, along_1, normal_2, along_2 : float
        Impulses at the contacts, N s: inwards, and along the race.
    opening_1, slip_1, opening_2, slip_2 : float
        Velocities of the contacts afterwards, m/s; exactly zero where the law says so.
    loss : float
        Energy that the body loses relative to the moving race, J.
    violation : float
        Largest violation of the law, recomputed from impulses and velocities, as a share of their scale. Energy that
        the body gains is a violation too: Newton's law may yield it where friction is strong.
    """

    solutions: int
    normal_1: float
    along_1: float
    normal_2: float
    along_2: float
    opening_1: float
    slip_1: float
    opening_2: float
    slip_2: float
    loss: float
    violation: float


# Modes of a contact in an impact. FORWARD and BACKWARD are the directions of its slip afterwards.
_OPEN, _FORWARD, _BACKWARD, _STICK = range(4)

# Velocities that differ by less than this share of their scale are equal.
_ROUNDING = 1e-11

# Where friction wedges a body, impulses of both contacts cancel: velocities are rounded by this share of their terms.
_CANCELLED = 1e-15


@inlined
def _couplings(mass, moment, a, b):
    """Changes of opening and slip at contact `a` by unit impulses, inwards and along the race, at contact `b`, 1/kg."""
    cosine = a.cosine * b.cosine + a.sine * b.sine
    sine = a.sine * b.cosine - a.cosine * b.sine
    m, j = 1.0 / mass, 1.0 / moment
    by_opening = m * cosine + j * a.lever_n * b.lever_n, -m * sine + j * a.lever_n * b.lever_t
    return by_opening, (m * sine + j * a.lever_t * b.lever_n, m * cosine + j * a.lever_t * b.lever_t)


@inlined
def _change(row, impulses):
    """Change of a velocity, m/s, by the impulses (N1, T1, N2, T2), N s, from its row."""
    return row[0] * impulses[0] + row[1] * impulses[1] + row[2] * impulses[2] + row[3] * impulses[3]


@inlined
def _largest(row):
    """Largest change of a velocity by one of four unit impulses; since couplings are mutual, also by this impulse."""
    return max(max(abs(row[0]), abs(row[1])), max(abs(row[2]), abs(row[3])))


@inlined
def _by_unknowns(row, k_1, k_2, sticks_1):
    """Changes of a velocity by N1, N2, and the impulse along the race of the contact that sticks.

    `k_1` and `k_2` are friction per normal impulse of a contact that slips, 0 of one that sticks.
    """
    return row[0] + k_1 * row[1], row[2] + k_2 * row[3], row[1] if sticks_1 else row[3]


@inlined
def _product(m, x):
    """Product of three rows with a column of three numbers."""
    a, b, c = m
    return (
        a[0] * x[0] + a[1] * x[1] + a[2] * x[2],
        b[0] * x[0] + b[1] * x[1] + b[2] * x[2],
        c[0] * x[0] + c[1] * x[1] + c[2] * x[2],
    )


@inlined
def _solved(m, right):
    """``(found, x, y, z)``: whether three linear equations have a solution, and the solution.

    The inverse is applied once more to what it leaves: of a body with little inertia it leaves more than rounding.
    """
    (a, b, c), (d, e, f), (g, h, i) = m
    minors = (
        (e * i - f * h, c * h - b * i, b * f - c * e),
        (f * g - d * i, a * i - c * g, c * d - a * f),
        (d * h - e * g, b * g - a * h, a * e - b * d),
    )
    whole = a * minors[0][0] + b * minors[1][0] + c * minors[2][0]
    if whole == 0.0:
        return False, 0.0, 0.0, 0.0
    share = 1.0 / whole
    x = add_scaled((0.0, 0.0, 0.0), share, _product(minors, right))
    x = add_scaled(x, share, _product(minors, add_scaled(right, -1.0, _product(m, x))))
    return abs(x[0]) + abs(x[1]) + abs(x[2]) < 1e300, x[0], x[1], x[2]


@inlined
def _shared_stick(mu, couplings, wanted, scale):
    """Impulses that stop both contacts: ``(found, N1, T1, N2, T2)``, inwards and along the race, N s.

    `wanted` are the changes of opening and slip at contact 1 and of opening at contact 2. The impulses that give them
    form a line. The cones of friction leave an interval of it, whose middle is taken, or nothing.
    """
    opening_1, slip_1, opening_2, _ = couplings
    d_1, s_1, d_2 = wanted
    matrix = opening_1[:3], slip_1[:3], opening_2[:3]
    found, n_1, t_1, n_2 = _solved(matrix, (d_1, s_1, d_2))
    also, by_1, by_t, by_2 = _solved(matrix, (-opening_1[3], -slip_1[3], -opening_2[3]))
    if not (found and also):
        return False, 0.0, 0.0, 0.0, 0.0
    # Four conditions p + q z >= 0 on the impulse z along the race at contact 2.
    low, high = -1e300, 1e300
    for p, q in (
        (mu[0] * n_1 - t_1, mu[0] * by_1 - by_t),
        (mu[0] * n_1 + t_1, mu[0] * by_1 + by_t),
        (mu[1] * n_2, mu[1] * by_2 - 1.0),
        (mu[1] * n_2, mu[1] * by_2 + 1.0),
    ):
        if q > 0.0:
            low = max(low, -p / q)
        elif q < 0.0:
            high = min(high, -p / q)
        elif p < 0.0:
            return False, 0.0, 0.0, 0.0, 0.0
    least = _ROUNDING * (abs(d_1) + abs(s_1) + abs(d_2)) * scale
    if low > high + least:
        return False, 0.0, 0.0, 0.0, 0.0
    z = 0.5 * (low + high) if low > -1e299 and high < 1e299 else low if low > -1e299 else high
    n_1, t_1, n_2 = n_1 + by_1 * z, t_1 + by_t * z, n_2 + by_2 * z
    return min(n_1, n_2) >= -least, n_1, t_1, n_2, z


@inlined
def impulses(mass, moment, first, second, touching, mu, restitution):
    """Impulses of an impact.

    Parameters
    ----------
    mass, moment : float
        Mass, kg, and moment of inertia about the centre of mass, kg m^2.
    first, second : Contact
        Both contacts just before; the second one repeats the first if there is only one.
    touching : tuple of bool
        Whether each contact has no gap.
    mu : tuple of float
        Friction coefficients, 1.
    restitution : tuple of float
        Coefficient of restitution at each contact, 1.

    Returns
    -------
    Impulses
    """
    c_11, c_12 = _couplings(mass, moment, first, first), _couplings(mass, moment, first, second)
    c_21, c_22 = _couplings(mass, moment, second, first), _couplings(mass, moment, second, second)
    rows = c_11[0] + c_12[0], c_11[1] + c_12[1], c_21[0] + c_22[0], c_21[1] + c_22[1]
    unit_1, unit_2 = rows[0][0], rows[2][2]
    sizes = _largest(rows[0]), _largest(rows[1]), _largest(rows[2]), _largest(rows[3])
    before = first.opening, first.slip, second.opening, second.slip
    aims = (
        -restitution[0] * before[0] if before[0] < 0.0 else 0.0,
        -restitution[1] * before[2] if before[2] < 0.0 else 0.0,
    )
    speed = 1e-300
    if touching[0]:
        speed = max(speed, max(abs(before[0]), abs(before[1])))
    if touching[1]:
        speed = max(speed, max(abs(before[2]), abs(before[3])))
    least = _ROUNDING * speed
    least_impulse, unit_mass = least / min(unit_1, unit_2), max(unit_1, unit_2)
    solutions = 0
    best = Impulses(0, 0.0, 0.0, 0.0, 0.0, before[0], before[1], before[2], before[3], 0.0, 0.0)
    # Several modes may give the same velocities; the first is kept. Two sticking contacts come first: only their mode
    # knows the middle of the impulses that friction allows, the others are ends of their range.
    for mode_1 in range(_STICK if touching[0] else _OPEN, -1, -1):
        for mode_2 in range(_STICK if touching[1] else _OPEN, -1, -1):
            if mode_1 == _STICK and mode_2 == _STICK:
                wanted = aims[0] - before[0], -before[1], aims[1] - before[2]
                found, n_1, t_1, n_2, t_2 = _shared_stick(mu, rows, wanted, 1.0 / unit_1)
            else:
                k_1 = -mu[0] if mode_1 == _FORWARD else mu[0] if mode_1 == _BACKWARD else 0.0
                k_2 = -mu[1] if mode_2 == _FORWARD else mu[1] if mode_2 == _BACKWARD else 0.0
                sticks_1, sticks_2 = mode_1 == _STICK, mode_2 == _STICK
                one, two, three = (1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0)
                right_1 = right_2 = right_3 = 0.0
                if mode_1 != _OPEN:
                    one, right_1 = _by_unknowns(rows[0], k_1, k_2, sticks_1), aims[0] - before[0]
                if mode_2 != _OPEN:
                    two, right_2 = _by_unknowns(rows[2], k_1, k_2, sticks_1), aims[1] - before[2]
                if sticks_1:
                    three, right_3 = _by_unknowns(rows[1], k_1, k_2, True), -before[1]
                elif sticks_2:
                    three, right_3 = _by_unknowns(rows[3], k_1, k_2, False), -before[3]
                found, n_1, n_2, t = _solved((one, two, three), (right_1, right_2, right_3))
                t_1, t_2 = t if sticks_1 else k_1 * n_1, t if sticks_2 else k_2 * n_2
            impulse = n_1, t_1, n_2, t_2
            terms = sizes[0] * abs(n_1) + sizes[1] * abs(t_1) + sizes[2] * abs(n_2) + sizes[3] * abs(t_2)
            rough = least + _CANCELLED * terms
            # Most modes need an impulse that pulls, or more friction than there is.
            short = max(unit_1 * (abs(t_1) - mu[0] * n_1), unit_2 * (abs(t_2) - mu[1] * n_2))
            if not found or min(unit_1 * n_1, unit_2 * n_2) < -rough or short > rough:
                continue
            o_1, s_1 = before[0] + _change(rows[0], impulse), before[1] + _change(rows[1], impulse)
            o_2, s_2 = before[2] + _change(rows[2], impulse), before[3] + _change(rows[3], impulse)
            # The law once more, from the impulses and the velocities.
            wrong = 0.0
            for touches, n, along, opens, slides, aim, coefficient, unit in (
                (touching[0], n_1, t_1, o_1, s_1, aims[0], mu[0], unit_1),
                (touching[1], n_2, t_2, o_2, s_2, aims[1], mu[1], unit_2),
            ):
                if touches:
                    wrong = max(wrong, max(-unit * n, aim - opens))
                    wrong = max(wrong, min(unit * n, opens - aim))
                    wrong = max(wrong, unit * (abs(along) - coefficient * n))
                    # What slides feels all of its friction, against the slip.
                    short = unit * (coefficient * n + along * (1.0 if slides > 0.0 else -1.0))
                    wrong = max(wrong, min(abs(slides), abs(short)))
            if not wrong <= rough:
                continue
            o_1, o_2 = (0.0 if abs(o_1) <= rough else o_1), (0.0 if abs(o_2) <= rough else o_2)
            s_1, s_2 = (0.0 if abs(s_1) <= rough else s_1), (0.0 if abs(s_2) <= rough else s_2)
            apart = max(
                max(abs(o_1 - best.opening_1), abs(s_1 - best.slip_1)),
                max(abs(o_2 - best.opening_2), abs(s_2 - best.slip_2)),
            )
            if solutions > 0 and apart <= 1e3 * rough:
                continue
            solutions += 1
            loss = -0.5 * (
                n_1 * (o_1 + before[0]) + t_1 * (s_1 + before[1]) + n_2 * (o_2 + before[2]) + t_2 * (s_2 + before[3])
            )
            if max(abs(n_1), abs(n_2)) <= least_impulse:
                loss = 0.0
            violation = max(wrong / speed, -loss * unit_mass / speed / speed)
            best = Impulses(solutions, n_1, t_1, n_2, t_2, o_1, s_1, o_2, s_2, loss, violation)
    return best


@inlined
def after_impact(mass, moment, first, second, motion, found):
    """Motion after an impact with the impulses `found`."""
    turning = across = up = 0.0
    for ball, normal, along in ((first, found.normal_1, found.along_1), (second, found.normal_2, found.along_2)):
        turning += ball.lever_n * normal + ball.lever_t * along
        across += ball.cosine * along - ball.sine * normal
        up += ball.sine * along + ball.cosine * normal
    psi_dot = motion.psi_dot + turning / moment
    return _with_rates(motion, psi_dot, motion.x_dot + across / mass, motion.y_dot + up / mass)
