"""Power series of a body that may leave the race: those of a pivot, and of a flight.

The rows of the table are those of :mod:`ringsweep.models.ring.series`. The guard of a contact is its normal reaction
while it holds, and its gap while it is open. A gap that has just opened begins with coefficients that are zero; its
guard is the series divided by that power of the time.

`c` is the table of series, ``c[ROW, k]`` coefficient k. `f` is the :class:`ringsweep.physics.pivot.Frame` of a pivot.
`fresh` is how many coefficients of its gap are zero because the contact has just opened, see :class:`mode.Contacts`.
"""

from __future__ import annotations

from math import atan2, cos, inf, pi, sin, sqrt

from ringsweep.compile import inlined, replacing
from ringsweep.models.interface import series, simpler
from ringsweep.models.interface.shock import Located
from ringsweep.models.ring.impact.mode import (
    BOTH,
    FIRST,
    NONE,
    TURNED,
    coefficients_there,
    distances_to_edges,
    frame,
    gap_measure,
    holding,
    place_of,
    ring_of,
    state_when_closed,
)
from ringsweep.models.ring.series import (
    DETERMINANT,
    EDGE,
    EPSILON,
    ETA,
    FACTORS,
    FAST,
    GAP_1,
    GAP_2,
    KIND,
    LEAST_DETERMINANT,
    NORMAL_1,
    NORMAL_2,
    OMEGA,
    OTHER,
    PHI,
    SLOW,
    SPARE,
    SQUARE,
    THETA,
    V,
    X,
    Y,
)
from ringsweep.models.sliding import REACTION_TOLERANCE, expand_bounds, rate_at_rest, speed_in
from ringsweep.numerics.series import (
    INVERSE,
    ORDER,
    crossings,
    differentiate,
    slope,
    step_within,
    value,
    variation,
)
from ringsweep.numerics.terms import inner_products, joined, no_factors, part_from, set_factors, set_terms, terms
from ringsweep.physics import drives, pivot, ring
from ringsweep.physics.friction.velocity import (
    begin_series,
    no_products,
    region_bounds,
    series_term,
    shorten_for_decay,
    varies,
)
from ringsweep.physics.impact import ImpactRing, side_of

# Rate of a gap below which it may be rounding, as a share of the speed of the body.
_NOISE = 1e-13

# A contact this close to an edge is on the edge, rad: the instant of the crossing is known to rounding.
_ON_EDGE = 1e-12


@series.table_shape.implements(ImpactRing)
def _table_shape_with_impact(scene):
    """Implement :func:`series.table_shape`."""
    return series.table_shape(scene.closed)


@series.fill_table.implements(ImpactRing)
def _fill_table_with_impact(scene, mode, t, y, tolerance, c):
    """Implement :func:`series.fill_table`: as the closed ring, as a pivot, or as a flight."""
    c[KIND, 0] = y[-1]
    if mode.contacts.open == NONE:
        return series.fill_table(ring_of(scene, mode.contacts.turned), mode, t, (y[0], y[1]), tolerance, c)
    drives.expand_at(scene.drive, t, ORDER + 2, c[THETA], c[FACTORS:])
    if mode.contacts.open == BOTH:
        return _expand_flight(scene, mode, y, tolerance, c)
    # Guards of what ends slip or stick, unless they are filled below.
    for g in (DETERMINANT, SLOW, EDGE, FAST):
        _fill_constant(c[g], inf)
    return _expand_pivot(scene, mode, t, y, tolerance, c)


# ---- both contacts hold: the closed ring takes the steps --------------------------------------

_with_base = replacing("base")


@simpler.is_simpler.implements(ImpactRing)
def _is_closed(scene, mode):
    """Implement :func:`simpler.is_simpler`: both contacts hold."""
    return mode.contacts.open == NONE


@simpler.simplify.implements(ImpactRing)
def _simplify_closed(scene, record, mode, y):
    """Implement :func:`simpler.simplify`: the closed ring, its record, and ``(phi, v)``."""
    return ring_of(scene, mode.contacts.turned), record.base, (y[0], y[1])


@simpler.rejoined.implements(ImpactRing)
def _rejoined_with_impact(scene, record, mode, part_record, y, c):
    """Implement :func:`simpler.rejoined`."""
    state = state_when_closed(y[0], y[1], mode.contacts.turned)
    c[KIND, 0] = state[-1]
    return _with_base(record, part_record), state


# ---- pivot ------------------------------------------------------------------------------------


@inlined
def _fill_constant(row, number):
    """Make a row of the table the series of a constant."""
    row[0] = number
    for k in range(1, ORDER + 1):
        row[k] = 0.0


@inlined
def _expand_pivot(scene, mode, t, y, tolerance, c):
    """Fill the series of a pivot and return what :func:`series.fill_table` does."""
    body, balls = scene.closed.body, scene.balls
    fresh = (mode.contacts.zeros_1 if mode.contacts.open == FIRST else mode.contacts.zeros_2) if y[2] == 0.0 else 0
    c[PHI, 0], c[V, 0], c[ETA, 0] = y[0], y[1], y[2]
    f = frame(scene, (y[0], y[1], y[2], 0.0 if fresh > 1 else y[3], *y[4:]), c[THETA, 1])
    sharpness = _expand_pivot_motion(scene, mode, f, fresh, c)
    _expand_pivot_guards(scene, mode, f, y[2], fresh, c)
    per_angle = 1.0 / tolerance
    speed = speed_in(scene, mode, body.radius * (rate_at_rest(scene.closed) + abs(f.psi_dot) + abs(f.alpha_dot)))
    per_load = 1.0 / REACTION_TOLERANCE * per_angle
    if varies(scene.law, mode.region):
        per_load = max(per_load, 1e3)
    load = pivot.size(f) + balls.reach * abs(c[EPSILON, 0])
    own = NORMAL_2 if mode.contacts.open == FIRST else NORMAL_1
    motion = (PHI, per_angle), (ETA, per_angle), (V, per_angle / speed)
    loads = (EPSILON, per_load * balls.reach / load), (own, per_load / (body.mass * load))
    h = step_within(c, (*motion, *loads))
    return shorten_for_decay(sharpness, c[V], h), h


@inlined
def _expand_pivot_motion(scene, mode, f, fresh, c):
    """Fill the series of a pivot, and the guards of its friction in stick; return the sharpness of the friction law.

    Coefficient k of a product of two series is the sum of their coefficients 0 and k, crosswise, and of what is known
    before. So the coefficients of accelerations and forces solve the balances with other right sides, see
    :mod:`ringsweep.physics.pivot`.
    """
    law, race, slips, sign = scene.law, scene.closed.body.radius, mode.sign != 0, float(mode.sign)
    own_row = NORMAL_2 if mode.contacts.open == FIRST else NORMAL_1
    mu_s, mu_k, _ = coefficients_there(scene, place_of(mode))
    surfaces = mu_s, mu_k
    (mu,), begun, sharpness = begin_series(law, mode.region, sign * c[V, 0], surfaces)
    K_0 = -sign * mu if slips else 0.0
    solution = pivot.in_slip(f, K_0) if slips else pivot.in_stick(f, race * (2.0 * c[THETA, 2]))
    psi_dd, alpha_dd, N_0, F_0 = solution
    # The lever of the force at the contact about the centre of mass, in slip.
    q_0 = f.radius - f.u
    lever_0 = f.w - K_0 * q_0
    if fresh == 3:
        alpha_dd = psi_dd
    c[OMEGA, 0], c[EPSILON, 0], c[SQUARE, 0] = f.psi_dot, psi_dd, f.psi_square
    c[own_row, 0] = N_0
    if slips:
        least = LEAST_DETERMINANT * f.inertia if varies(law, mode.region) else 0.0
        c[DETERMINANT, 0] = pivot.determinant(f, K_0) - least
    else:
        # Forward slip begins where friction against it no longer suffices.
        c[SLOW, 0], c[FAST, 0] = mu_s * N_0 + F_0, mu_s * N_0 - F_0
    om_before, ad_before = f.psi_dot, f.alpha_dot
    own = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
    before_law, of_law = joined(own, pivot.NO_PRODUCTS), no_products(law, surfaces)
    law_left = law_right = of_law
    first = newest = no_factors(joined(before_law, of_law))
    for k in range(1, ORDER + 1):
        om, ad, K, v = psi_dd * INVERSE[k], alpha_dd * INVERSE[k], 0.0, 0.0
        inner = inner_products(c, FACTORS, k, first, newest)
        i_sa, i_ca, i_u, i_w, i_om, i_ad, i_KN, i_Ku, i_wl = part_from(inner, own, ())
        if slips:
            v = f.reach * ad + f.radius * om - race * ((k + 1.0) * c[THETA, k + 1])
            (mu,), law_left, law_right = series_term(
                law, mode.region, k, sign * v, part_from(inner, of_law, before_law), begun, surfaces
            )
            K = -sign * mu
        dd_before = om_before - ad_before
        s_a, c_a = (i_sa + ad_before * f.cos_alpha) * INVERSE[k], -(i_ca + ad_before * f.sin_alpha) * INVERSE[k]
        u, w = -(i_u + dd_before * f.w) * INVERSE[k], (i_w + dd_before * f.u) * INVERSE[k]
        change = s_a, c_a, u, w, i_om + 2.0 * f.psi_dot * om, i_ad + 2.0 * f.alpha_dot * ad
        rest = pivot.imbalance_of_change(f, solution, change, part_from(inner, pivot.NO_PRODUCTS, own))
        lever = w - K * q_0 + K_0 * u + i_Ku
        if slips:
            found = pivot.solved_in_slip(f, K_0, (*rest, i_KN + K * N_0))
            c[DETERMINANT, k] = f.mass * (i_wl + w * lever_0 + f.w * lever)
        else:
            found = pivot.solved_in_stick(f, (*rest, -race * ((k + 1.0) * (k + 2.0) * c[THETA, k + 2])))
            c[SLOW, k], c[FAST, k] = mu_s * found[2] + found[3], mu_s * found[2] - found[3]
        psi_dd, alpha_dd, N, _ = found
        left, right = pivot.left_factors(f, change, found), pivot.right_factors(f, change, found)
        left = joined((ad_before, ad_before, dd_before, dd_before, om, ad, K, K, w), left)
        right = joined((c_a, s_a, w, u, om, ad, N, u, lever), right)
        newest = set_factors(c, FACTORS, k, joined(left, law_left), joined(right, law_right))
        first = newest if k == 1 else first
        c[PHI, k], c[OMEGA, k], c[V, k] = om_before * INVERSE[k], om, v
        c[EPSILON, k], c[SQUARE, k], c[own_row, k] = psi_dd, change[4], N
        c[ETA, k], c[X, k], c[Y, k] = dd_before * INVERSE[k], u, w
        om_before, ad_before = om, ad
    return sharpness if slips else 0.0


@inlined
def _expand_pivot_guards(scene, mode, f, eta, fresh, c):
    """Fill the gap of the open contact and its guard; in slip also the bounds of the region and of the zone.

    The rows X and Y hold u and w of the pivot; `eta` is its angle, rad.
    """
    a, h = side_of(holding(mode)) * scene.balls.half_distance, scene.balls.offset
    gap, guard = (GAP_1, NORMAL_1) if mode.contacts.open == FIRST else (GAP_2, NORMAL_2)
    set_terms(c[gap], (terms(c[Y]) * h - terms(c[X]) * a) * (2.0 * a / (a * a + h * h)))
    c[gap, 0] = gap_measure(scene, mode, eta)
    _divide(c, gap, guard, fresh)
    _expand_edges(scene, mode, f.alpha - c[THETA, 0], c)
    if mode.sign == 0:
        return
    body = scene.closed.body
    size = pivot.size(f) + body.radius * (abs(c[EPSILON, 0]) + 2.0 * abs(c[THETA, 2]))
    expand_bounds(c, (V, SLOW, FAST), mode, region_bounds(scene.law, mode.region), size)


@inlined
def _expand_edges(scene, mode, rho, c):
    """Fill the guard of the edges of the segment under the contact; `rho` is its angle in the ring's frame.

    A ball that pivots moves over the ring either way, whatever the sense of its slip, and even if it rolls. So the
    guard is the product of the distances from both edges. A distance that is zero is divided by the time.
    """
    above, below = distances_to_edges(scene, mode, rho)
    if not above < inf:
        return
    near, far, sense = (above, below, -1.0) if above <= below else (below, above, 1.0)
    c[SPARE, 0], shift = near, 0
    for k in range(1, ORDER + 1):
        c[SPARE, k] = sense * (c[PHI, k] - c[ETA, k] - c[THETA, k])
    if near <= _ON_EDGE:
        shift = 1
        while shift < ORDER and c[SPARE, shift] == 0.0:
            shift += 1
    _divide(c, SPARE, OTHER, shift)
    for k in range(ORDER + 1):
        total = c[OTHER, k] * far
        for j in range(k):
            total -= c[OTHER, j] * c[SPARE, k - j]
        c[EDGE, k] = total


@inlined
def _divide(c, row, quotient, zeros):
    """Fill `quotient` with a series whose first coefficients are zero, divided by that power of the time."""
    for k in range(zeros):
        c[row, k] = 0.0
    for k in range(ORDER + 1):
        c[quotient, k] = c[row, k + zeros] if k + zeros <= ORDER else 0.0


# ---- flight -----------------------------------------------------------------------------------


@inlined
def _expand_flight(scene, mode, y, tolerance, c):
    """Fill the series of a parabola with constant spin, and of the gaps; return what :func:`series.fill_table` does."""
    body, balls = scene.closed.body, scene.balls
    psi, spin, x, x_dot, y_0, y_dot, _, _, _ = y
    for row in (X, Y):
        _fill_constant(c[row], 0.0)
    for row in (PHI, V, OMEGA, EPSILON, SQUARE, DETERMINANT, SLOW, NORMAL_2, EDGE, FAST):
        _fill_constant(c[row], inf if row >= DETERMINANT else 0.0)
    c[X, 0], c[X, 1] = x, x_dot
    c[Y, 0], c[Y, 1], c[Y, 2] = y_0, y_dot, -0.5 * body.gravity
    c[PHI, 0], c[PHI, 1], c[OMEGA, 0] = psi, spin, spin
    c[SQUARE, 0] = spin * spin
    two = ring.contact_count(body) == 2
    speed = sqrt(x_dot * x_dot + y_dot * y_dot) + sqrt(body.gravity * balls.reach)
    h = 4.0 * balls.reach / speed if speed > 0.0 else inf
    noise = _NOISE * (speed + abs(spin) * balls.reach)
    if not two:
        # The angle of the place must not turn by half a turn within a step.
        distance = sqrt(x * x + y_0 * y_0)
        h = 0.1 * h * max(distance / balls.reach, 0.05)
    for contact, gap, guard, zeros, now in (
        (1, GAP_1, NORMAL_1, mode.contacts.zeros_1, y[6]),
        (2, GAP_2, NORMAL_2, mode.contacts.zeros_2, y[7]),
    ):
        if contact == 1 or two:
            _expand_gap(scene, contact, psi, spin, c, gap)
            c[gap, 0] = now
            _divide(c, gap, guard, _leading_zeros(c[gap], zeros, noise))
    per_gap = 1.0 / (balls.reach * tolerance)
    reach = step_within(c, ((GAP_1, per_gap), (GAP_2, per_gap if two else 0.0)))
    return min(h, reach), reach


@inlined
def _expand_gap(scene, contact, psi, spin, c, row):
    """Fill the series of (rho^2 - x^2 - y^2)/(2 rho) of a ball in flight, but for its first coefficient."""
    balls = scene.balls
    a, h = side_of(contact) * balls.half_distance, balls.offset
    s, k_s = sin(psi), cos(psi)
    power = 1.0
    for k in range(ORDER + 1):
        c[SPARE, k], c[OTHER, k] = c[X, k] - power * (h * s + a * k_s), c[Y, k] + power * (h * k_s - a * s)
        # The next derivatives of sine and cosine.
        s, k_s = k_s, -s
        power *= spin * INVERSE[k + 1]
    for k in range(1, ORDER + 1):
        total = 0.0
        for j in range(k + 1):
            total += c[SPARE, j] * c[SPARE, k - j] + c[OTHER, j] * c[OTHER, k - j]
        c[row, k] = -0.5 * total / balls.reach


@inlined
def _leading_zeros(gap, zeros, least_rate):
    """Number of leading coefficients of a gap that are rounding: at most as many as were zero when the flight began."""
    if zeros == 0 or gap[0] != 0.0:
        return 0
    if gap[1] > least_rate:
        return 1
    return 0 if gap[1] < -least_rate else zeros


# ---- what solvers and recorders see -----------------------------------------------------------


@inlined
def _is_particle_in_flight(scene, contacts):
    """Whether a body of one contact is in flight: its angle psi is that of its place."""
    return contacts == BOTH and ring.contact_count(scene.closed.body) == 1


@inlined
def _polar(scene, c, s):
    """Angle (rad) of a particle in flight, its rate and its acceleration; without jumps of a whole turn in a step."""
    x, y, x_dot, y_dot = value(c[X], s), value(c[Y], s), slope(c[X], s), slope(c[Y], s)
    square = x * x + y * y
    angle = atan2(x, -y)
    angle += 2.0 * pi * round((c[PHI, 0] - angle) / (2.0 * pi))
    rate = (x * y_dot - y * x_dot) / square
    return angle, rate, -(scene.closed.body.gravity * x + 2.0 * (x * x_dot + y * y_dot) * rate) / square


@series.state_at.implements(ImpactRing)
def _state_at_with_impact(scene, c, s):
    """Implement :func:`series.state_at`; :mod:`mode` says what the nine numbers are."""
    contacts, code = int(c[KIND, 0]) % TURNED, c[KIND, 0]
    psi = value(c[PHI], s)
    if contacts == NONE:
        return psi, value(c[V], s), 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, code
    if contacts == BOTH:
        rate = c[OMEGA, 0]
        if _is_particle_in_flight(scene, contacts):
            psi, rate, _ = _polar(scene, c, s)
        gap_2 = value(c[GAP_2], s) if ring.contact_count(scene.closed.body) == 2 else 0.0
        place = value(c[X], s), slope(c[X], s), value(c[Y], s), slope(c[Y], s)
        return psi, rate, *place, value(c[GAP_1], s), gap_2, code
    return psi, value(c[V], s), value(c[ETA], s), slope(c[ETA], s), 0.0, 0.0, 0.0, 0.0, code


@series.rates_at.implements(ImpactRing)
def _rates_at_with_impact(scene, c, s):
    """Implement :func:`series.rates_at`."""
    contacts = int(c[KIND, 0]) % TURNED
    psi_dot = slope(c[PHI], s)
    if contacts == BOTH:
        return psi_dot, 0.0, slope(c[X], s), 0.0, slope(c[Y], s), -scene.closed.body.gravity, 0.0, 0.0, 0.0
    eta_dot = eta_dd = 0.0
    if contacts != NONE:
        eta_dot = slope(c[ETA], s)
        differentiate(c[ETA], c[SPARE])
        eta_dd = slope(c[SPARE], s)
    return psi_dot, slope(c[V], s), eta_dot, eta_dd, 0.0, 0.0, 0.0, 0.0, 0.0


@inlined
def _value(row, s):
    """Value of a series at the time `s`; at 0 only the first coefficient is read, as the others may be infinite."""
    return row[0] if s == 0.0 else value(row, s)


@inlined
def _seen_in_series(scene, c, s):
    """What the recorder is shown: psi, its rate, both reactions, the acceleration, both gaps, and the open contacts."""
    body = scene.closed.body
    contacts = int(c[KIND, 0]) % TURNED
    psi, rate, acceleration = _value(c[PHI], s), _value(c[OMEGA], s), _value(c[EPSILON], s)
    if _is_particle_in_flight(scene, contacts):
        psi, rate, acceleration = _polar(scene, c, s)
    open_1, open_2 = contacts % 2 == 1, contacts >= 2
    normal_1 = 0.0 if open_1 else _value(c[NORMAL_1], s)
    normal_2 = 0.0 if open_2 else _value(c[NORMAL_2], s)
    gap_1, gap_2 = _value(c[GAP_1], s) if open_1 else 0.0, _value(c[GAP_2], s) if open_2 else 0.0
    if ring.contact_count(body) == 1:
        normal_2, gap_2 = normal_1, 0.0
    size = body.gravity / body.radius + rate * rate + abs(acceleration)
    return psi, rate, normal_1, normal_2, Located(acceleration, size), gap_1, gap_2, float(contacts)


@series.seen_at_start.implements(ImpactRing)
def _seen_at_start_with_impact(scene, c):
    """Implement :func:`series.seen_at_start`."""
    return _seen_in_series(scene, c, 0.0)


@series.seen_at.implements(ImpactRing)
def _seen_at_with_impact(scene, mode, c, s, h):
    """Implement :func:`series.seen_at`."""
    return _seen_in_series(scene, c, s)


@series.extremes.implements(ImpactRing)
def _extremes_with_impact(scene, record, mode, c, h, work):
    """Implement :func:`series.extremes`: of the gaps; in a pivot also of psi, its rate and the reaction."""
    base, count = record.base, 0
    for row, is_open in (
        (GAP_1, mode.contacts.open % 2 == 1),
        (GAP_2, mode.contacts.open >= 2 and ring.contact_count(scene.closed.body) == 2),
    ):
        if is_open and c[row, 0] + variation(c[row], h) > record.gap_max:
            differentiate(c[row], c[SPARE])
            count = crossings(c[SPARE], h, work, count)
    if mode.contacts.open == BOTH:
        return count
    omega, change = c[OMEGA, 0], variation(c[OMEGA], h)
    if abs(omega) <= change:
        count = crossings(c[OMEGA], h, work, count)
    if abs(omega) <= change or omega - change < base.omega_min or omega + change > base.omega_max:
        count = crossings(c[EPSILON], h, work, count)
    own, lowest, highest = NORMAL_1, base.normal_min_1, base.normal_max_1
    if mode.contacts.open == FIRST:
        own, lowest, highest = NORMAL_2, base.normal_min_2, base.normal_max_2
    change = variation(c[own], h)
    if c[own, 0] - change < lowest or c[own, 0] + change > highest:
        differentiate(c[own], c[SPARE])
        count = crossings(c[SPARE], h, work, count)
    return count


@inlined
def true_gap(scene, measure):
    """Gap, m, from its measure ``(rho^2 - |c|^2)/(2 rho)``."""
    rho = scene.balls.reach
    return 2.0 * rho * measure / (rho + sqrt(max(rho * (rho - 2.0 * measure), 0.0)))
