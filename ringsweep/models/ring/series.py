"""The ring as a piecewise-smooth system: modes, guards and their power series.

A mode names the sign of the sliding velocity, the region of the friction law, and the segment under each contact. The
state is ``(phi, v)``: angle in space and sliding velocity. The difference of two large angular velocities would not
resolve a stiction band of 1e-9 m/s.

In slip with constant K the acceleration is ``p omega^2 + q cos phi + r sin phi``. In stick the body accelerates like
the ring, and the balances of :mod:`ringsweep.physics.ring` give the reactions: no differential equation is left.
"""

from __future__ import annotations

from math import cos, inf, isnan, sin, sqrt
from typing import NamedTuple

from ringsweep.compile import hook, inlined
from ringsweep.models.interface import modes, series
from ringsweep.models.interface.status import BROKEN, JAM, RUNNING
from ringsweep.models.ring.contacts import (
    coefficients_under,
    edges_ahead,
    friction_under,
    places_after_edge,
    places_at,
    places_beyond,
    zones_under,
)
from ringsweep.models.ring.record import ENDS
from ringsweep.numerics.series import (
    FACTOR_ROWS,
    INVERSE,
    ORDER,
    crossings,
    may_fall_below,
    slope,
    step_size,
    value,
    variation,
)
from ringsweep.numerics.terms import inner_products, set_factors, set_terms, terms
from ringsweep.physics import contact, drives, ring
from ringsweep.physics.friction.velocity import (
    BAND,
    KINETIC,
    constant_weights,
    expand_weights,
    faster,
    region_at,
    region_bounds,
    shorten_for_decay,
    slower,
    stiction_band,
    weight_factors,
    weights_in,
)

# Rows of the table of series. The guards are last. INERTIA is the first guard: the others mean nothing after a jam.
PHI, V, OMEGA, EPSILON, SIN, COS, SQUARE, THETA, EXCESS, BASIS, STATIC_WEIGHT, KINETIC_WEIGHT = range(12)
FRICTION_1, FRICTION_2, SPARE = range(12, 15)
# Factors of the products that grow side by side. They take several rows each.
LEFT = 15
RIGHT = LEFT + FACTOR_ROWS
INERTIA, SLOW, NORMAL_1, NORMAL_2, EDGE, FAST = range(RIGHT + FACTOR_ROWS, RIGHT + FACTOR_ROWS + 6)

# If one reaction vanishes and the other is smaller than this share of the load, both contacts separate.
AT_ONCE = 1e-9

# If the effective inertia is smaller than this share of the moment of inertia about the axis, the body is about to jam.
NEARLY_JAMMED = 1e-4

#: Error allowed to the reactions as a share of the load, in units of the tolerance of the series.
REACTION_TOLERANCE = 1e3


class Mode(NamedTuple):
    """Mode of the ring.

    Attributes
    ----------
    sign : int
        Sign of the sliding velocity; 0 in stick.
    region : int
        Region of the friction law.
    entry_guard : int
        Row of the guard that is zero on entry, or -1.
    place_1, place_2 : tuple of int
        Segment and turn of each contact.
    """

    sign: int
    region: int
    entry_guard: int
    place_1: tuple[int, int]
    place_2: tuple[int, int]


@modes.initial_state.implements(ring.Ring)
def _initial_state(scene):
    v = drives.velocity_at_beginning(scene.drive, ring.launch_velocity(scene)) * scene.body.radius
    return drives.beginning(scene.drive), (scene.initial_phi, v)


@series.table_shape.implements(ring.Ring)
def _table_shape(scene):
    return FAST + 1, INERTIA


@modes.initial_mode.implements(ring.Ring)
def _initial_mode(scene, t, y):
    phi, v = y
    theta, ring_omega, ring_epsilon = drives.turn(scene.drive, t)
    place_1, place_2 = places_at(scene, phi - theta)
    if v == 0.0 and stiction_band(scene.law) == 0.0:
        return _mode_at_rest(scene, t, phi, place_1, place_2, 0)
    sign = 1 if v > 0.0 else -1
    region, entry_guard = region_at(scene.law, abs(v)), -1
    if v == 0.0:
        # Friction is zero here, so that the body slides in the direction in which the other forces accelerate it.
        epsilon, _, _ = ring.acceleration(scene.body, 0.0, 0.0, sin(phi), cos(phi), ring_omega)
        sign, entry_guard = (1 if epsilon >= ring_epsilon else -1), SLOW
    mode = Mode(sign, region, entry_guard, *places_beyond(scene, place_1, place_2, phi - theta, sign))
    return _after_jump(scene, mode, t, y), mode


@inlined
def _at_breakaway(scene, mode):
    """Friction coefficient under each contact at the beginning of slip."""
    mu_s1, mu_k1, mu_s2, mu_k2 = coefficients_under(scene, mode)
    w_s, w_k, _, _ = weights_in(scene.law, mode.region, 0.0)
    return w_s * mu_s1 + w_k * mu_k1, w_s * mu_s2 + w_k * mu_k2


@inlined
def _mode_at_rest(scene, t, phi, place_1, place_2, stick_end):
    """Status and mode of a set-valued law at zero sliding velocity; see :func:`contact.at_rest` for `stick_end`."""
    theta, ring_omega, ring_epsilon = drives.turn(scene.drive, t)
    region = region_at(scene.law, 0.0)
    stick = Mode(0, KINETIC, -1, place_1, place_2)
    forward = Mode(1, region, SLOW, *places_beyond(scene, place_1, place_2, phi - theta, 1))
    backward = Mode(-1, region, SLOW, *places_beyond(scene, place_1, place_2, phi - theta, -1))
    mu_s1, _, mu_s2, _ = coefficients_under(scene, stick)
    breakaway = _at_breakaway(scene, forward), _at_breakaway(scene, backward)
    motion = sin(phi), cos(phi), ring_omega, ring_epsilon
    found = contact.at_rest(scene.body, (mu_s1, mu_s2), *breakaway, *motion, stick_end)
    if found == contact.IMPOSSIBLE:
        # A contact on an edge may belong to either side.
        for slip in (forward, backward):
            mu_s1, _, mu_s2, _ = coefficients_under(scene, slip)
            on_edge = slip.place_1 != place_1 or slip.place_2 != place_2
            if on_edge and contact.at_rest(scene.body, (mu_s1, mu_s2), *breakaway, *motion, 0) == contact.STICK:
                return RUNNING, Mode(0, KINETIC, -1, slip.place_1, slip.place_2)
    if found == contact.FORWARD:
        return RUNNING, forward
    if found == contact.BACKWARD:
        return RUNNING, backward
    if isnan(phi + ring_epsilon):
        return BROKEN, stick
    return ENDS[found], stick


@inlined
def _after_jump(scene, mode, t, y):
    """Status in slip after friction may have jumped."""
    phi, v = y
    K1, K2, omega = _friction_at(scene, mode, t, v)
    if isnan(phi + omega):
        return BROKEN
    return ENDS[contact.sliding(scene.body, K1, K2, sin(phi), cos(phi), omega)]


@inlined
def _friction_at(scene, mode, t, v):
    """K at each contact, and angular velocity of the body, at the sliding velocity `v`."""
    K1, K2 = friction_under(scene, mode, abs(v))
    return K1, K2, v / scene.body.radius + drives.turn(scene.drive, t)[1]


@inlined
def _sliding_at(scene, mode, t, y):
    """D, effective inertia, both reactions and their scale in slip, from the balances and not from a series."""
    phi, v = y
    body = scene.body
    K1, K2, omega = _friction_at(scene, mode, t, v)
    epsilon, determinant, inertia = ring.acceleration(body, K1, K2, sin(phi), cos(phi), omega)
    normal_1, normal_2 = ring.reactions(body, K1, K2, sin(phi), cos(phi), omega, epsilon)
    scale = body.mass * (body.gravity + body.radius * (omega * omega + abs(epsilon)))
    return determinant, inertia, normal_1, normal_2, scale


@inlined
def _is_jamming(scene, mode, t, y):
    """Whether slip is so near to a jam, where reactions grow without bound, that their signs mean nothing."""
    if mode.sign == 0:
        return False
    determinant, inertia, _, _, _ = _sliding_at(scene, mode, t, y)
    return not (determinant > 0.0 and inertia > NEARLY_JAMMED * ring.about_axis(scene.body) * determinant)


@inlined
def _after_zero_reaction(scene, mode, guard, t, y):
    """Status, mode and state after a reaction has vanished."""
    if mode.sign == 0:
        # Slip with both contacts closed may follow.
        status, slip = _mode_at_rest(scene, t, y[0], mode.place_1, mode.place_2, 2)
        if status == RUNNING:
            return status, slip, (y[0], 0.0)
        _, ring_omega, ring_epsilon = drives.turn(scene.drive, t)
        mu_s1, _, mu_s2, _ = coefficients_under(scene, mode)
        _, _, normal_1, normal_2 = contact.stick(
            scene.body, mu_s1, mu_s2, sin(y[0]), cos(y[0]), ring_omega, ring_epsilon
        )
        scale = scene.body.mass * (scene.body.gravity + scene.body.radius * ring_omega * ring_omega)
    else:
        _, _, normal_1, normal_2, scale = _sliding_at(scene, mode, t, y)
        # Near a jam the series of a reaction is inaccurate, and may vanish where the reaction does not.
        if _is_jamming(scene, mode, t, y) or (normal_1 if guard == NORMAL_1 else normal_2) > 1e-2 * scale:
            return JAM, mode, y
    least = AT_ONCE * scale
    opens_1, opens_2 = guard == NORMAL_1 or normal_1 <= least, guard == NORMAL_2 or normal_2 <= least
    return ENDS[contact.lost(scene.body, opens_1, opens_2)], mode, y


@modes.status_when_stalled.implements(ring.Ring)
def _status_when_stalled(scene, mode, t, y):
    if mode.sign == 0:
        return BROKEN
    # Where friction changes fast with the speed, the inertia does not show the jam: test with the static coefficients.
    mu_s1, _, mu_s2, _ = coefficients_under(scene, mode)
    _, determinant, inertia = ring.acceleration(scene.body, -mode.sign * mu_s1, -mode.sign * mu_s2, 0.0, 1.0, 0.0)
    return JAM if _is_jamming(scene, mode, t, y) or not (determinant > 0.0 and inertia > 0.0) else BROKEN


@modes.switch.implements(ring.Ring)
def _switch(scene, mode, guard, t, y):
    phi, v = y
    sign, region, place_1, place_2 = mode.sign, mode.region, mode.place_1, mode.place_2
    if guard in (NORMAL_1, NORMAL_2):
        return _after_zero_reaction(scene, mode, guard, t, y)
    if guard == INERTIA:
        return JAM, mode, y
    if sign == 0:
        stick_end = 1 if guard == SLOW else -1 if guard == FAST else 2
        status, mode = _mode_at_rest(scene, t, phi, place_1, place_2, stick_end)
        return status, mode, (phi, 0.0)
    if guard == EDGE:
        theta, _, _ = drives.turn(scene.drive, t)
        place_1, place_2 = places_after_edge(scene, mode, phi - theta)
        mode = Mode(sign, region, SLOW if v == 0.0 else -1, place_1, place_2)
        return _after_jump(scene, mode, t, y), mode, y
    low, high = region_bounds(scene.law, region)
    if guard == FAST:
        return RUNNING, Mode(sign, faster(scene.law, region), SLOW, place_1, place_2), (phi, sign * high)
    if low > 0.0:
        return RUNNING, Mode(sign, slower(scene.law, region), FAST, place_1, place_2), (phi, sign * low)
    if region == BAND:
        return RUNNING, Mode(-sign, BAND, SLOW, place_1, place_2), (phi, 0.0)
    status, next_mode = _mode_at_rest(scene, t, phi, place_1, place_2, 0)
    return status, next_mode, (phi, 0.0)


@inlined
def _expand_sine(c, k, sine, cosine, square):
    """Fill coefficient `k` of sine and cosine of phi and of the square of omega.

    `sine`, `cosine` and `square` are the inner products of dphi/dt and cosine, dphi/dt and sine, omega and omega, see
    :func:`ringsweep.numerics.terms.inner_products`.
    """
    if k == 0:
        c[SIN, 0], c[COS, 0] = sin(c[PHI, 0]), cos(c[PHI, 0])
        c[SQUARE, 0] = c[OMEGA, 0] * c[OMEGA, 0]
        return
    c[SIN, k] = (sine + c[OMEGA, k - 1] * c[COS, 0]) * INVERSE[k]
    c[COS, k] = -(cosine + c[OMEGA, k - 1] * c[SIN, 0]) * INVERSE[k]
    c[SQUARE, k] = square + 2.0 * c[OMEGA, 0] * c[OMEGA, k]


@inlined
def _next_state(scene, c, k):
    """Fill coefficient `k` + 1 of the state from coefficient `k` of its rate."""
    c[PHI, k + 1] = c[OMEGA, k] * INVERSE[k + 1]
    c[OMEGA, k + 1] = c[EPSILON, k] * INVERSE[k + 1]
    c[V, k + 1] = scene.body.radius * (c[OMEGA, k + 1] - (k + 2.0) * c[THETA, k + 2])


@series.expand.implements(ring.Ring)
def _expand(scene, mode, t, y, tolerance, c):
    drives.expand(scene.drive, t, ORDER + 2, c[THETA])
    c[PHI, 0] = y[0]
    c[V, 0] = y[1]
    if mode.sign == 0:
        return _expand_stick(scene, mode, tolerance, c)
    c[OMEGA, 0] = y[1] / scene.body.radius + c[THETA, 1]
    _expand_slip(scene, mode, c)
    _expand_slip_guards(scene, mode, c)
    per_angle = 1.0 / tolerance
    speed = scene.body.radius * (1.0 + abs(c[OMEGA, 0]))
    if mode.region == BAND:
        # An error as large as the stiction band would keep the creep from becoming steady.
        speed = min(speed, 1e3 * stiction_band(scene.law))
    per_velocity = per_angle / speed
    # An error of the reactions could add or hide a separation. A bound on the acceleration is not enough: varying
    # friction changes the reactions even of a body that is too inert to be accelerated.
    per_load = 1.0 / REACTION_TOLERANCE * per_angle
    if not constant_weights(scene.law, mode.region):
        # Even at a loose tolerance a root of a reaction must not be a root of its error.
        per_load = max(per_load, 1e3)
    per_epsilon = per_load / (scene.body.gravity / scene.body.radius + c[SQUARE, 0] + abs(c[EPSILON, 0]))
    per_reaction = per_epsilon / (scene.body.mass * scene.body.radius)
    last = previous = 0.0
    for row, unit in (
        (PHI, per_angle),
        (V, per_velocity),
        (EPSILON, per_epsilon),
        (NORMAL_1, per_reaction),
        (NORMAL_2, per_reaction),
    ):
        last = max(last, abs(c[row, ORDER]) * unit)
        previous = max(previous, abs(c[row, ORDER - 1]) * unit)
    return shorten_for_decay(scene.law, mode.region, c[V], step_size(last, previous))


@inlined
def _expand_slip(scene, mode, c):
    """Fill the series of slip."""
    body = scene.body
    mu_s1, mu_k1, mu_s2, mu_k2 = coefficients_under(scene, mode)
    low, _ = region_bounds(scene.law, mode.region)
    k1, k2 = friction_under(scene, mode, max(abs(c[V, 0]), low))
    start = slip_start(body, k1, k2)
    for k in range(ORDER + 1):
        sine, cosine, square, weights, cube, loaded_1, loaded_2, both = inner_products(c, LEFT, RIGHT, k)
        _expand_sine(c, k, sine, cosine, square)
        c[EXCESS, k] = mode.sign * c[V, k] - (low if k == 0 else 0.0)
        expand_weights(
            scene.law, mode.region, c[EXCESS], k, (weights, cube), c[BASIS], c[STATIC_WEIGHT], c[KINETIC_WEIGHT]
        )
        c[FRICTION_1, k] = -mode.sign * (c[STATIC_WEIGHT, k] * mu_s1 + c[KINETIC_WEIGHT, k] * mu_k1)
        c[FRICTION_2, k] = -mode.sign * (c[STATIC_WEIGHT, k] * mu_s2 + c[KINETIC_WEIGHT, k] * mu_k2)
        both += c[FRICTION_1, 0] * c[FRICTION_2, k]
        if k > 0:
            loaded_1 += c[FRICTION_1, k] * c[NORMAL_1, 0]
            loaded_2 += c[FRICTION_2, k] * c[NORMAL_2, 0]
            both += c[FRICTION_1, k] * c[FRICTION_2, 0]
        slip_term(body, start, c, k, loaded_1, loaded_2, both)
        if k < ORDER:
            _next_state(scene, c, k)
        if k > 0:
            (weight_1, weight_2), (weight_3, weight_4) = weight_factors(
                scene.law, mode.region, c[EXCESS], k, c[BASIS]
            )
            before, omega, K1, K2 = c[OMEGA, k - 1], c[OMEGA, k], c[FRICTION_1, k], c[FRICTION_2, k]
            set_factors(c, LEFT, k, (before, before, omega, weight_1, weight_2, K1, K2, K1))
            set_factors(
                c, RIGHT, k, (c[COS, k], c[SIN, k], omega, weight_3, weight_4, c[NORMAL_1, k], c[NORMAL_2, k], K2)
            )
    # Before a jam the accelerations grow without bound, so that a small effective inertia counts as a jam.
    _, determinant, inertia = ring.acceleration(body, k1, k2, 0.0, 0.0, 0.0)
    least = 0.0 if constant_weights(scene.law, mode.region) else 1e-6 * ring.about_axis(body) * determinant
    if not (determinant > 0.0 and inertia > least):
        c[INERTIA, 0] = -1.0


@hook(optional=True)
def slip_start(body, k1, k2):
    """Numbers that :func:`slip_term` needs, computed once for each step.

    Parameters
    ----------
    body : NamedTuple
    k1, k2 : float
        K at each contact at the beginning of the step.

    Returns
    -------
    object
        Passed on to :func:`slip_term`. By default 0, for bodies that need no such numbers.
    """
    return 0.0


@slip_start.implements(ring.TwoContacts)
def _two_slip_start(body, k1, k2):
    # With the angular acceleration eliminated the balances are, for K_i = k_i,
    #     (cb - k1 sb) N1 + (cb + k2 sb) N2 = A,   (sb + k1 lever) N1 - (sb - k2 lever) N2 = B.
    b = body
    sb, cb = b.sin_beta, b.cos_beta
    lever = cb - b.mass * b.xi * b.radius / ring.about_axis(b)
    a1, a2 = cb - k1 * sb, cb + k2 * sb
    b1, b2 = sb + k1 * lever, sb - k2 * lever
    scale = 1.0 / (a2 * b1 + a1 * b2)
    return lever, k1, k2, a1 * scale, a2 * scale, b1 * scale, b2 * scale


@hook
def slip_term(body, start, c, k, loaded_1, loaded_2, both):
    """Fill coefficient `k` of acceleration, reactions and effective inertia in slip, where friction is a series.

    Parameters
    ----------
    body : NamedTuple
    start : object
        What :func:`slip_start` returned.
    c : ndarray of shape ``(rows, columns)``
        Table of the series. Known up to coefficient `k`: SIN, COS, SQUARE (of omega), FRICTION_1 and FRICTION_2 (K at
        each contact). To be filled: EPSILON, NORMAL_1, NORMAL_2 and INERTIA.
    k : int
        Index of the coefficient.
    loaded_1, loaded_2 : float
        Coefficient `k` of the friction K_i N_i at each contact, but for the term with coefficient `k` of N_i.
    both : float
        Coefficient `k` of K_1 K_2.
    """


@slip_term.implements(ring.TwoContacts)
def _two_slip_term(body, start, c, k, loaded_1, loaded_2, both):
    b = body
    sb, cb = b.sin_beta, b.cos_beta
    lever, k1, k2, a1, a2, b1, b2 = start
    about_axis = ring.about_axis(b)
    radial = b.mass * (b.gravity * c[COS, k] + b.xi * c[SQUARE, k]) + (loaded_1 - loaded_2) * sb
    tangential = b.mass * b.gravity * (1.0 - b.mass * b.xi * b.xi / about_axis) * c[SIN, k]
    tangential -= (loaded_1 + loaded_2) * lever
    c[NORMAL_1, k] = b2 * radial + a2 * tangential
    c[NORMAL_2, k] = b1 * radial - a1 * tangential
    friction = (loaded_1 + k1 * c[NORMAL_1, k]) + (loaded_2 + k2 * c[NORMAL_2, k])
    c[EPSILON, k] = (b.radius * friction - b.mass * b.gravity * b.xi * c[SIN, k]) / about_axis
    one = 1.0 if k == 0 else 0.0
    difference = (cb * lever - sb * sb) * (c[FRICTION_1, k] - c[FRICTION_2, k])
    c[INERTIA, k] = about_axis * (2.0 * sb * (one * cb + both * lever) + difference)


@slip_term.implements(ring.OneContact)
def _one_slip_term(body, start, c, k, loaded_1, loaded_2, both):
    c[INERTIA, k] = 1.0 if k == 0 else 0.0
    load = body.mass * (body.gravity * c[COS, k] + body.radius * c[SQUARE, k])
    c[NORMAL_1, k] = c[NORMAL_2, k] = load
    friction = loaded_1 + c[FRICTION_1, 0] * load
    c[EPSILON, k] = (friction / body.mass - body.gravity * c[SIN, k]) / body.radius


@inlined
def _expand_slip_guards(scene, mode, c):
    """Fill the guards of slip for both ends of the region of the friction law, and for the nearer edge."""
    low, high = region_bounds(scene.law, mode.region)
    ahead_1, ahead_2 = edges_ahead(scene, mode, c[PHI, 0] - c[THETA, 0])
    forward = float(mode.sign)
    set_terms(c[SLOW], terms(c[V]) * forward)
    set_terms(c[FAST], terms(c[V]) * -forward)
    set_terms(c[EDGE], (terms(c[THETA]) - terms(c[PHI])) * forward)
    c[SLOW, 0] = 0.0 if mode.entry_guard == SLOW else mode.sign * c[V, 0] - low
    c[FAST, 0] = 0.0 if mode.entry_guard == FAST else high - mode.sign * c[V, 0]
    c[EDGE, 0] = min(ahead_1, ahead_2)
    # If friction does not drop at breakaway, the slope is zero there: what is computed is rounding.
    if mode.entry_guard == SLOW and low == 0.0:
        body = scene.body
        size = body.gravity + body.radius * (c[SQUARE, 0] + abs(c[EPSILON, 0]) + 2.0 * abs(c[THETA, 2]))
        if abs(c[V, 1]) <= 1e-12 * size:
            c[SLOW, 1] = 0.0


@inlined
def _expand_stick(scene, mode, tolerance, c):
    """Fill the series of stick and return the length of the step; the body moves with the ring."""
    for k in range(ORDER + 1):
        c[V, k] = 0.0
        c[OMEGA, k] = (k + 1.0) * c[THETA, k + 1]
        c[EPSILON, k] = (k + 1.0) * (k + 2.0) * c[THETA, k + 2]
        if k > 0:
            c[PHI, k] = c[THETA, k]
        sine, cosine, square, _, _, _, _, _ = inner_products(c, LEFT, RIGHT, k)
        _expand_sine(c, k, sine, cosine, square)
        if k > 0:
            before, omega = c[OMEGA, k - 1], c[OMEGA, k]
            set_factors(c, LEFT, k, (before, before, omega, 0.0, 0.0, 0.0, 0.0, 0.0))
            set_factors(c, RIGHT, k, (c[COS, k], c[SIN, k], omega, 0.0, 0.0, 0.0, 0.0, 0.0))
    mu_s1, _, mu_s2, _ = coefficients_under(scene, mode)
    c[EDGE, 0] = inf
    stick_series(scene.body, mu_s1, mu_s2, c)
    c[INERTIA, 0] = inf
    per_load = 1.0 / (scene.body.mass * (scene.body.gravity + scene.body.radius * c[SQUARE, 0]))
    last, previous = 0.0, 0.0
    for row, unit in ((PHI, 1.0), (SIN, 1.0), (COS, 1.0), (SLOW, per_load), (FAST, per_load)):
        last = max(last, abs(c[row, ORDER]) * unit)
        previous = max(previous, abs(c[row, ORDER - 1]) * unit)
    return step_size(last / tolerance, previous / tolerance)


@hook
def stick_series(body, m1, m2, c):
    """Fill the reactions and the guards of stick.

    For two contacts the moment about the axis gives the sum of the friction forces, and the tangential balance gives
    the difference of the reactions. The radial balance gives a quadratic equation for the sum of the reactions, with
    friction shared in proportion to ``m_i N_i``.

    Parameters
    ----------
    body : NamedTuple
    m1, m2 : float
        Static friction coefficients under the contacts.
    c : ndarray of shape ``(rows, columns)``
        Table of the series. Known: PHI, OMEGA, EPSILON, SIN, COS and SQUARE (of omega). To be filled: NORMAL_1,
        NORMAL_2, and the reserves of friction (N) before forward slip (SLOW) and before backward slip (FAST). For two
        contacts also EDGE, the discriminant of the quadratic equation; with one contact it stays infinite.
    """


@stick_series.implements(ring.TwoContacts)
def _two_stick_series(body, m1, m2, c):
    b = body
    sb, cb = b.sin_beta, b.cos_beta
    mean, half = 0.5 * (m1 + m2), 0.5 * (m1 - m2)
    moment = b.inertia + b.mass * b.xi * b.xi
    first_difference = first_share = first_linear = first_total = 0.0
    for k in range(ORDER + 1):
        friction = (moment * c[EPSILON, k] + b.mass * b.gravity * b.xi * c[SIN, k]) / b.radius
        difference = (b.mass * (b.xi * c[EPSILON, k] + b.gravity * c[SIN, k]) - friction * cb) / sb
        load = b.mass * (b.xi * c[SQUARE, k] + b.gravity * c[COS, k])
        # mean cb total^2 - linear total - constant = 0
        linear = mean * load - cb * half * difference + sb * half * friction
        share = half * load + mean * sb * friction
        constant, square, mixed, total, _, _, _, _ = inner_products(c, LEFT, RIGHT, k)
        # Where both roots meet, stick ends: no friction gives the acceleration of the ring.
        if k == 0:
            first_difference, first_share, first_linear = difference, share, linear
            c[EDGE, 0] = linear * linear + 4.0 * mean * cb * difference * share
            total = first_total = (linear + sqrt(max(c[EDGE, 0], 0.0))) / (2.0 * mean * cb)
        else:
            constant += first_difference * share + difference * first_share
            c[EDGE, k] = square + 2.0 * first_linear * linear + 4.0 * mean * cb * constant
            rest = constant + mixed + linear * first_total - mean * cb * total
            total = rest / (2.0 * mean * cb * first_total - first_linear)
            set_factors(c, LEFT, k, (difference, linear, linear, total, 0.0, 0.0, 0.0, 0.0))
            set_factors(c, RIGHT, k, (share, linear, total, total, 0.0, 0.0, 0.0, 0.0))
        c[NORMAL_1, k] = 0.5 * (total + difference)
        c[NORMAL_2, k] = 0.5 * (total - difference)
        reserve = m1 * c[NORMAL_1, k] + m2 * c[NORMAL_2, k]
        c[SLOW, k], c[FAST, k] = reserve + friction, reserve - friction


@stick_series.implements(ring.OneContact)
def _one_stick_series(body, m1, m2, c):
    for k in range(ORDER + 1):
        friction = body.mass * (body.radius * c[EPSILON, k] + body.gravity * c[SIN, k])
        c[NORMAL_1, k] = body.mass * (body.gravity * c[COS, k] + body.radius * c[SQUARE, k])
        c[NORMAL_2, k] = c[NORMAL_1, k]
        c[SLOW, k], c[FAST, k] = m1 * c[NORMAL_1, k] + friction, m1 * c[NORMAL_1, k] - friction


@series.state_at.implements(ring.Ring)
def _state_at(scene, c, s):
    return value(c[PHI], s), value(c[V], s)


@series.rates_at.implements(ring.Ring)
def _rates_at(scene, c, s):
    return slope(c[PHI], s), slope(c[V], s)


@series.seen_at_start.implements(ring.Ring)
def _seen_at_start(scene, c):
    return c[PHI, 0], c[OMEGA, 0], c[NORMAL_1, 0], c[NORMAL_2, 0]


@series.seen_at.implements(ring.Ring)
def _seen_at(scene, c, s, h):
    return value(c[PHI], s), value(c[OMEGA], s), value(c[NORMAL_1], s), value(c[NORMAL_2], s)


@series.extremes.implements(ring.Ring)
def _extremes(scene, record, mode, c, h, work):
    count = 0
    omega, omega_variation, phi_variation = c[OMEGA, 0], variation(c[OMEGA], h), variation(c[PHI], h)
    may_reverse = abs(omega) <= omega_variation
    # Look for an extreme only if it could exceed the recorded ones, or if omega may change sign within the step.
    if may_reverse and not (c[PHI, 0] - phi_variation >= record.lowest and c[PHI, 0] + phi_variation <= record.highest):
        count = crossings(c[OMEGA], h, work, count)
    if may_reverse or omega - omega_variation < record.omega_min or omega + omega_variation > record.omega_max:
        count = crossings(c[EPSILON], h, work, count)
    for row, lowest in ((NORMAL_1, record.normal_min_1), (NORMAL_2, record.normal_min_2)):
        if may_fall_below(c[row], h, lowest):
            for k in range(ORDER):
                c[SPARE, k] = (k + 1.0) * c[row, k + 1]
            c[SPARE, ORDER] = 0.0
            count = crossings(c[SPARE], h, work, count)
    # The reactions may have jumped on entry into the mode.
    work[0, count] = 0.0
    return count + 1


@series.row.implements(ring.Ring)
def _row(scene, mode, c, t, s):
    zone_1, zone_2 = zones_under(scene, mode)
    return (
        value(c[PHI], s),
        value(c[OMEGA], s),
        value(c[EPSILON], s),
        value(c[NORMAL_1], s),
        value(c[NORMAL_2], s),
        drives.turn(scene.drive, t)[1],
        zone_1,
        zone_2,
        0.0 if mode.region == BAND else float(mode.sign),
    )


@modes.in_space.implements(ring.Ring)
def _in_space(scene, t, y):
    return y[0], y[1] / scene.body.radius + drives.turn(scene.drive, t)[1]


@series.after_first_step.implements(Mode)
def _after_first_step(mode):
    return Mode(mode.sign, mode.region, -1, mode.place_1, mode.place_2)


#: Hooks that the series need of a body.
BODY_MEMBERS = (slip_start, slip_term, stick_series)
