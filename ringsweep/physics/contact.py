"""The contact problem at an instant: which contacts stick, slip or open.

If the sliding velocity is zero, or if friction jumps, the state does not determine the mode of the motion. So every
mode is tested for its equations and inequalities:

- stick: friction ``K_i = -kappa mu_s,i`` with one saturation ``kappa`` in [-1, 1] gives the acceleration of the ring,
  and both normal reactions are positive;
- slip forwards or backwards: the relative acceleration has the sign of the slip, and both normal reactions are
  positive;
- a contact opens: its reaction is zero and its gap grows; the other contact sticks or slips with a positive reaction,
  or opens too.

Stick has priority over slip, and closed contacts over open ones. If both slips but not stick are admissible, or no mode
is, the state has no unique motion of rigid bodies (jamming). The same holds for slip in which the determinant of the
balances is not positive.

A reaction that is smaller than the rounding of the load is zero.

If a contact may open, the body has three degrees of freedom. Let only one contact act, with the reaction ``N`` and the
friction ``F``; ``s = -1`` for contact 1 and ``+1`` for contact 2. The accelerations of its gap g and of its place x
along the race are

.. math::

    \\ddot g = \\ddot g_0 + \\Bigl(\\frac1M + \\frac{\\xi^2 \\sin^2\\beta}{J}\\Bigr) N + s c F, \\qquad
    \\ddot x = \\ddot x_0 + s c N + \\Bigl(\\frac1M + \\frac{\\lambda^2}{J}\\Bigr) F, \\qquad
    c = \\frac{\\xi \\lambda \\sin\\beta}{J},\\ \\lambda = R - \\xi \\cos\\beta .

m1 and m2 are static coefficients, ``at_zero`` are N1, N2 and F1 at F_2 = 0, ``by_F2`` their derivatives by F_2.
Models call :func:`at_rest` and :func:`sliding` at events.
"""

from __future__ import annotations

from math import inf, sqrt

from ringsweep.compile import feature, hook, inlined
from ringsweep.physics import pivot, ring
from ringsweep.physics.friction.ways import TwoWay, along, facing

#: Modes of the contacts. CLOSED: slip goes on with both closed. OPEN_1, OPEN_2, OPEN_BOTH: these contacts open. STICK,
#: FORWARD, BACKWARD: motion from rest with both closed. IMPOSSIBLE: no unique motion of rigid bodies.
CLOSED, OPEN_1, OPEN_2, OPEN_BOTH, STICK, FORWARD, BACKWARD, IMPOSSIBLE = range(8)

# Rounding of forces and accelerations, as a share of their largest terms. A value this close to a bound meets it.
_ROUNDING = 1e-13


@inlined
def stick(body, m1, m2, motion, epsilon):
    """Saturation of friction, and normal reactions, of a body that sticks to the ring.

    Friction is ``K_i = -kappa mu_s,i`` at both contacts, with the saturation ``kappa`` at which the angular
    acceleration of the body equals that of the ring. The balances leave ``F_2`` open if there are two contacts. With
    friction in proportion to ``mu_s,i N_i`` it solves a quadratic equation.

    Parameters
    ----------
    body : NamedTuple
    m1, m2 : float or TwoWay
        Static friction coefficients under the contacts, 1.
    motion : tuple of float
        Sine and cosine of the angle of the body, and its angular velocity, rad/s.
    epsilon : float
        Angular acceleration of the ring, rad/s^2.

    Returns
    -------
    tuple of float
        ``(kappa, reserve, N1, N2)``: saturation, 1; distance from breakaway, m1 N1 + m2 N2 less the friction needed,
        N; normal reactions, N. With one contact N2 repeats N1. The reserve is minus infinity if no saturation gives
        this acceleration.
    """
    N1, N2, F1 = ring.held(body, 1.0, motion, motion[2] * motion[2], epsilon, 0.0)
    m1, m2 = facing((m1, m2), -F1)
    friction, capacity = F1, m1 * N1
    if ring.contact_count(body) == 2:
        at_zero, by_F2 = (N1, N2, F1), by_friction(body)
        square, linear, constant = sharing(m1, m2, at_zero, by_F2)
        if not linear * linear - 4.0 * square * constant >= 0.0:
            return 0.0, -inf, 0.0, 0.0
        F2 = shared_friction(m1, m2, at_zero, by_F2)
        N1, N2, friction = at(F2, at_zero, by_F2)
        capacity = m1 * N1 + m2 * N2
    return -friction / capacity if capacity != 0.0 else 0.0, capacity - abs(friction), N1, N2


@inlined
def by_friction(body):
    """Derivatives of N1, N2 and F1 by the friction F_2, which the balances leave open; see :func:`ring.held`."""
    return ring.held(body, 0.0, (0.0, 0.0, 0.0), 0.0, 0.0, 1.0)


@inlined
def sharing(m1, m2, at_zero, by_F2):
    """Coefficients of the quadratic equation for F_2 that makes friction proportional to m_i N_i at both contacts.

    It is ``F1 m2 N2 = F2 m1 N1``, where N1, N2 and F1 are linear in F_2.

    Parameters
    ----------
    m1, m2 : float
        Static friction coefficients under the contacts, 1.
    at_zero, by_F2 : tuple of float
        N1, N2 and F1 at F_2 = 0, N, and their derivatives by F_2; see :func:`ringsweep.physics.ring.held`.

    Returns
    -------
    tuple of float
        Coefficients of F_2^2, 1, and of F_2, N, and constant term, N^2.
    """
    (N1, N2, F1), (by_N1, by_N2, by_F1) = at_zero, by_F2
    plus, minus = m2 * by_F1 * by_N2, m1 * by_N1
    square = plus - minus if abs(plus - minus) > _ROUNDING * (abs(plus) + abs(minus)) else 0.0
    return square, m2 * (by_F1 * N2 + F1 * by_N2) - m1 * N1, m2 * F1 * N2


@inlined
def roots(m1, m2, at_zero, by_F2):
    """Both solutions F_2 of the equation of :func:`sharing`, N: first the stable one, then the other one.

    At the stable one a larger saturation slows the body down more: there the left side of the equation less the right
    side falls with F_2. Without friction at rest the contacts share the friction force equally.
    """
    if m1 + m2 == 0.0:
        half = at_zero[2] / (1.0 - by_F2[2])
        return half, half
    square, linear, constant = sharing(m1, m2, at_zero, by_F2)
    root = sqrt(max(linear * linear - 4.0 * square * constant, 0.0))
    total = root + abs(linear)
    one = 2.0 * constant / total if total != 0.0 else 0.0
    # With a smaller factor the other root is infinite.
    other = 0.5 * total / square if abs(square) > 1e-200 else one
    return (one, other) if linear <= 0.0 else (-other, -one)


@inlined
def shared_friction(m1, m2, at_zero, by_F2):
    """Friction F_2 of a body that sticks, N: the stable one of :func:`roots`, unless only the other one is admissible.

    On a ring the stable one is admissible if the other one is.
    """
    stable, other = roots(m1, m2, at_zero, by_F2)
    if _holds(m1, m2, stable, at_zero, by_F2) or not _holds(m1, m2, other, at_zero, by_F2):
        return stable
    return other


@inlined
def folds(body, m1, m2):
    """Whether two states of stick can meet: whether the equation of :func:`sharing` is quadratic."""
    if ring.contact_count(body) == 1:
        return False
    square, _, _ = sharing(m1, m2, (0.0, 0.0, 0.0), by_friction(body))
    return square != 0.0


@inlined
def loads_as_stick_ends(body, m1, m2, motion, epsilon, first):
    """Normal reactions of a body that sticks, N, where that of contact 1 has vanished, or of contact 2 if not `first`.

    Of both :func:`roots` it is the one at which this reaction is closer to zero. The other arguments are those of
    :func:`stick`.
    """
    N1, N2, F1 = ring.held(body, 1.0, motion, motion[2] * motion[2], epsilon, 0.0)
    if ring.contact_count(body) == 2:
        at_zero, by_F2 = (N1, N2, F1), by_friction(body)
        stable, other = roots(m1, m2, at_zero, by_F2)
        N1, N2, _ = at(stable, at_zero, by_F2)
        other_1, other_2, _ = at(other, at_zero, by_F2)
        if abs(other_1 if first else other_2) < abs(N1 if first else N2):
            N1, N2 = other_1, other_2
    return N1, N2


@inlined
def loads_at_fold(body, m1, m2, motion, epsilon):
    """Normal reactions of a body that sticks, N, where both :func:`roots` meet; the arguments are those of `stick`."""
    at_zero, by_F2 = ring.held(body, 1.0, motion, motion[2] * motion[2], epsilon, 0.0), by_friction(body)
    square, linear, _ = sharing(m1, m2, at_zero, by_F2)
    N1, N2, _ = at(-0.5 * linear / square, at_zero, by_F2)
    return N1, N2


@inlined
def at(F2, at_zero, by_F2):
    """``(N_1, N_2, F)`` at the friction F_2, N; F is that of both contacts together."""
    (N1, N2, F1), (by_N1, by_N2, by_F1) = at_zero, by_F2
    return N1 + by_N1 * F2, N2 + by_N2 * F2, F1 + (1.0 + by_F1) * F2


@inlined
def _holds(m1, m2, F2, at_zero, by_F2):
    """Whether a state of stick is admissible: both reactions press, and friction does not exceed its bound."""
    N1, N2, friction = at(F2, at_zero, by_F2)
    return N1 > 0.0 and N2 > 0.0 and abs(friction) <= m1 * N1 + m2 * N2


@hook(optional=True)
def opening(body, friction, static, slides, motion, epsilon):
    """Contacts that open, of a body whose contacts cannot both stay closed.

    Parameters
    ----------
    body : NamedTuple
    friction : tuple of float
        Friction per unit of the normal reaction at both contacts, 1. If the body slides: with sign, positive in the
        direction of growing phi. If it is at rest: the magnitude just after breakaway.
    static : tuple of float
        Static friction coefficients under both contacts, 1; only used at rest.
    slides : int
        0 if the body is at rest on the ring, 1 if it slides.
    motion, epsilon
        As for :func:`stick`.

    Returns
    -------
    int
        OPEN_1, OPEN_2, OPEN_BOTH or IMPOSSIBLE. OPEN_BOTH also if each contact could open while the other one stays
        closed: a mirror image must give the mirrored result. By default that of a body with one contact: it opens
        unless the body presses on it without friction, for then friction has turned the sign of the reaction.
    """
    load, _ = ring.reactions(body, 0.0, 0.0, motion)
    if slides != 0:
        K1, K2 = along(friction[0], 0.0), along(friction[1], 0.0)
        _, determinant = ring.acceleration(body, K1, K2, motion)
        load = 0.0 if determinant > 0.0 else load
    return IMPOSSIBLE if load > _ROUNDING * body.mass * _size_per_mass(body, motion[2], epsilon) else OPEN_1


@inlined
def _alone(body, side, k, m, slides, motion, epsilon):
    """Reaction (N) and angular acceleration (rad/s^2) of a body on one contact while the other contact opens.

    Both are zero if this contact cannot carry the body. `side` is -1 for contact 1 and +1 for contact 2; `k` and `m`
    are friction and static friction at this contact, a TwoWay of a body at rest if they depend on the direction, and
    the rest is as for :func:`opening`.
    """
    b, (sin_phi, cos_phi, omega), (sb, cb) = body, motion, (side * body.sin_beta, body.cos_beta)
    # The moment of inertia may be zero; a lower bound avoids the division by zero.
    inertia, square = max(b.inertia, 1e-9 * b.mass * b.radius * b.radius), omega * omega
    # At this instant the contact moves along the race as a ball without a radius does.
    angle = 0.0, sin_phi * cb + cos_phi * sb, cos_phi * cb - sin_phi * sb
    place = *angle, b.xi * cb - b.radius, -b.xi * sb
    f = pivot.Frame(b.mass, inertia, b.gravity, 0.0, b.radius, *place, omega, omega, square, square)
    arm, carried = -2.0 * b.radius * sb * cb, b.radius * epsilon
    least = -_ROUNDING * (abs(b.gravity * cos_phi + b.xi * square) + abs(b.gravity * sin_phi) + abs(carried))
    if slides == 0:
        psi_dd, alpha_dd, load, pull = pivot.in_stick(f, carried)
        if load > 0.0 and abs(pull) <= along(m, -pull) * load and arm * (psi_dd - alpha_dd) > least:
            return load, psi_dd
    for sign in (-1.0, 1.0):
        mu = along(k, sign)
        K = mu if slides != 0 else -sign * mu
        found = pivot.in_slip(f, K)
        starts = slides != 0 or sign * pivot.sliding_acceleration(f, found, carried) > 0.0
        opens = arm * (found[0] - found[1]) > least
        if pivot.determinant(f, K) > 0.0 and found[2] > 0.0 and starts and opens:
            return found[2], found[0]
    return 0.0, 0.0


@opening.implements(ring.TwoContacts)
def _opening_of_two(body, friction, static, slides, motion, epsilon):
    """Implement :func:`opening` for two contacts, by whether one contact alone could carry the body."""
    sin_phi, cos_phi, omega = motion
    across = body.gravity * cos_phi + body.xi * omega * omega
    along = body.gravity * sin_phi
    # Without a load both gaps open.
    if body.cos_beta * across + body.sin_beta * abs(along) <= 0.0:
        return OPEN_BOTH
    first, _ = _alone(body, 1.0, friction[1], static[1], slides, motion, epsilon)
    second, _ = _alone(body, -1.0, friction[0], static[0], slides, motion, epsilon)
    if first > 0.0:
        return OPEN_BOTH if second > 0.0 else OPEN_1
    return OPEN_2 if second > 0.0 else IMPOSSIBLE


@hook(optional=True)
def opened(body, opens, closed, friction, static, slides, motion, epsilon):
    """Reactions and angular acceleration of a body at the instant at which its contacts cannot stay closed.

    Parameters
    ----------
    opens : int
        OPEN_1 or OPEN_2; or OPEN_BOTH or IMPOSSIBLE, if no contact carries the body.
    closed : tuple of float
        Reactions N1 and N2, N, and angular acceleration, rad/s^2, that follow from closed contacts.
    body, friction, static, slides, motion, epsilon
        As for :func:`opening`.

    Returns
    -------
    tuple of float
        ``(N1, N2, phi_dd)``. By default those of closed contacts without a pull: of a body with one contact.
    """
    return max(closed[0], 0.0), max(closed[1], 0.0), closed[2]


@opened.implements(ring.TwoContacts)
def _opened_of_two(body, opens, closed, friction, static, slides, motion, epsilon):
    """Implement :func:`opened` for two contacts; a body without a contact does not change its spin."""
    if opens == OPEN_1:
        load, phi_dd = _alone(body, 1.0, friction[1], static[1], slides, motion, epsilon)
        return 0.0, load, phi_dd
    if opens == OPEN_2:
        load, phi_dd = _alone(body, -1.0, friction[0], static[0], slides, motion, epsilon)
        return load, 0.0, phi_dd
    return 0.0, 0.0, 0.0


@inlined
def lost(body, first, second):
    """Contacts that open, given whether the normal reaction of each has vanished.

    Parameters
    ----------
    body : NamedTuple
    first, second : bool
        Whether the reaction of contact 1 and of contact 2 has vanished; at least one has.

    Returns
    -------
    int
        OPEN_1, OPEN_2 or OPEN_BOTH.
    """
    if ring.contact_count(body) == 1:
        return OPEN_1
    return OPEN_BOTH if first and second else OPEN_1 if first else OPEN_2


@inlined
def _size_per_mass(body, omega, epsilon):
    """Size of the terms in the balances of momentum, per unit of mass, m/s^2; greater than zero even without a load."""
    return body.gravity + body.radius * (omega * omega + abs(epsilon)) + 1e-300


@inlined
def _slip_margin(body, sign, friction, tangential, motion, epsilon):
    """Least margin of the inequalities of a slip that begins at rest, as a share of the terms; negative if one fails.

    Parameters
    ----------
    body : NamedTuple
    sign : float
        Direction of the slip, +1 or -1.
    friction : tuple of float
        Friction coefficients under both contacts just after breakaway, 1.
    tangential : bool
        Whether stick has just ended by this breakaway, and friction does not drop at breakaway. Then the relative
        acceleration is still zero.
    motion, epsilon
        As for :func:`stick`.
    """
    K1, K2 = -sign * friction[0], -sign * friction[1]
    phi_dd, determinant = ring.acceleration(body, K1, K2, motion)
    n1, n2 = ring.reactions(body, K1, K2, motion)
    terms = _size_per_mass(body, motion[2], epsilon)
    push = sign * body.radius * (phi_dd - epsilon) / terms
    if tangential:
        # The body starts to slide if even more friction than the limit would be needed to hold it.
        gain = sign * ring.acceleration_slope(body, K1, K2, K1, K2, motion)
        push = -body.radius * gain / terms if determinant > 0.0 else -1.0
    margin = min(push, min(n1, n2) / (body.mass * terms))
    # NaN if the acceleration does not exist.
    return margin if margin >= -1.0 else -1.0


@feature("max(forward, backward)", of=TwoWay)
def _either(static, forward, backward):
    """Friction coefficient of a contact just after breakaway: the larger one, or both if they depend on the way."""
    return TwoWay(forward, backward)


@inlined
def at_breakaway(static, forward, backward):
    """Friction of a body at rest, as for :func:`opening`; the arguments are those of :func:`at_rest`."""
    return _either(static[0], forward[0], backward[0]), _either(static[1], forward[1], backward[1])


@inlined
def at_rest(body, static, forward, backward, motion, epsilon, released):
    """Mode of a body that is at rest on the ring.

    Parameters
    ----------
    body : NamedTuple
    static : tuple of float or TwoWay
        Static friction coefficients under both contacts, 1.
    forward, backward : tuple of float
        Friction coefficients under both contacts just after breakaway forwards and backwards, 1.
    motion, epsilon
        As for :func:`stick`.
    released : int
        0 if the body may stick. Otherwise stick has just ended: +1 or -1 by breakaway in this direction, 2 because a
        reaction vanished.

    Returns
    -------
    int
        STICK, FORWARD, BACKWARD, OPEN_1, OPEN_2, OPEN_BOTH or IMPOSSIBLE.
    """
    limit = facing(static, float(released))
    held = -1.0
    if released == 0:
        _, reserve, n1, n2 = stick(body, *static, motion, epsilon)
        load = body.mass * _size_per_mass(body, motion[2], epsilon)
        # Without friction or without a load the body cannot stick.
        if limit[0] + limit[1] > 0.0 and min(n1, n2) > _ROUNDING * load:
            held = min(reserve, min(n1, n2)) / load
        if held >= 0.0:
            return STICK
    ahead = _slip_margin(body, 1.0, forward, released == 1 and forward == limit, motion, epsilon)
    back = _slip_margin(body, -1.0, backward, released == -1 and backward == limit, motion, epsilon)
    if ahead > 0.0 or back > 0.0:
        if min(ahead, back) > 0.0:
            return IMPOSSIBLE
        return FORWARD if ahead > 0.0 else BACKWARD
    # A tie: for example a body without friction in equilibrium.
    loaded = body.gravity > 0.0 or motion[2] != 0.0
    if loaded and max(held, max(ahead, back)) >= -_ROUNDING:
        return FORWARD if ahead >= max(held, back) else BACKWARD if back >= held else STICK
    return opening(body, at_breakaway(static, forward, backward), static, 0, motion, epsilon)


@inlined
def sliding(body, K1, K2, motion):
    """Mode of a body that slides.

    Parameters
    ----------
    body : NamedTuple
    K1, K2 : float
        Friction per unit of the normal reaction at each contact, 1; positive in the direction of growing phi.
    motion : tuple of float
        As for :func:`stick`.

    Returns
    -------
    int
        CLOSED, OPEN_1, OPEN_2, OPEN_BOTH or IMPOSSIBLE.
    """
    _, determinant = ring.acceleration(body, K1, K2, motion)
    n1, n2 = ring.reactions(body, K1, K2, motion)
    if min(n1, n2) > _ROUNDING * body.mass * _size_per_mass(body, motion[2], 0.0):
        return CLOSED if determinant > 0.0 else IMPOSSIBLE
    return opening(body, (K1, K2), (0.0, 0.0), 1, motion, 0.0)
