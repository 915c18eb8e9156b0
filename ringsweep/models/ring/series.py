"""The ring as a piecewise-smooth system: modes, guards and their power series.

A mode names the sign of the sliding velocity, the region of the friction law, and the segment under each contact. The
state is ``(phi, v)``: angle in space and sliding velocity. The difference of two large angular velocities would not
resolve a stiction band of 1e-9 m/s.

In slip with constant K the acceleration is linear in sine and cosine of phi, in omega and in its square. In stick the
body accelerates like the ring, and the balances of :mod:`ringsweep.physics.ring` give the reactions: no differential
equation is left.

Read :mod:`ringsweep.models.interface.series` first. `c` is the table of series: ``c[ROW, k]`` is coefficient k, with
the rows named below. A *place* is the segment under a contact and the turn of the ring; `rho` is the angle of the
body in the ring's frame; K is friction per unit of a reaction. Functions that return a status return a constant of
:mod:`ringsweep.models.interface.status`.
"""

from __future__ import annotations

from math import cos, inf, isfinite, isnan, sin
from typing import Any, NamedTuple

from ringsweep.compile import absorbed, feature, generated, hook, inlined, replacing
from ringsweep.models.interface import modes, recorder, series
from ringsweep.models.interface.shock import Located
from ringsweep.models.interface.status import BROKEN, JAM, RUNNING, SEPARATED_1, SEPARATED_2
from ringsweep.models.ring import long_run
from ringsweep.models.ring.contacts import (
    coefficients_in_slip,
    coefficients_under,
    edges_ahead,
    friction_under,
    places_after_edge,
    places_at,
    places_beyond,
    zones_of,
)
from ringsweep.models.ring.record import with_reactions
from ringsweep.models.sliding import ENDS, REACTION_TOLERANCE, expand_bounds, rate_at_rest, speed_in
from ringsweep.numerics.clock import Instant, parts
from ringsweep.numerics.series import (
    INVERSE,
    ORDER,
    bounds_within,
    crossings,
    differentiate,
    step_within,
    value,
)
from ringsweep.numerics.swing import swing
from ringsweep.numerics.terms import (
    FACTOR_ROWS,
    MOST_GROUPS,
    NUMBERS,
    inner_products,
    joined,
    no_factors,
    numbers_from,
    part_from,
    set_factors,
    set_terms,
    terms,
)
from ringsweep.physics import contact, drives, ring
from ringsweep.physics.friction.velocity import (
    KINETIC,
    begin_series,
    friction_in,
    is_varying,
    no_products,
    region_at,
    region_bounds,
    series_term,
    shorten_for_decay,
    stiction_band,
    varies,
)
from ringsweep.physics.friction.ways import TwoWay, along, facing

# Rows of the table of series. Those from KIND on belong to a body that may leave the race. KIND holds the code of the
# state; GAP_1 and GAP_2 are ``(rho^2 - |c|^2)/(2 rho)``, a measure of the gap that has a series; ETA belongs to a
# pivot; X and Y are the centre of mass in a flight, and u and w of a pivot.
PHI, V, OMEGA, EPSILON, SIN, COS, SQUARE, THETA, SPARE, OTHER, KIND, GAP_1, GAP_2, ETA, X, Y = range(16)
# Factors of the products that grow side by side, in several rows: those of a pivot need a group more.
FACTORS = 16
_GUARDS = FACTORS + (MOST_GROUPS + 1) * FACTOR_ROWS
# The guards are last. DETERMINANT is the first guard: the others mean nothing after a jam.
DETERMINANT, SLOW, NORMAL_1, NORMAL_2, EDGE, FAST = range(_GUARDS, _GUARDS + 6)

# Numbers behind those of the powers of a series, and zeros.
_SECOND, _NONE = NUMBERS + 1.0, 0.0 * NUMBERS

# If one reaction vanishes and the other is smaller than this share of the load, both contacts separate.
_AT_ONCE = 1e-9

# The body is about to jam if the determinant of the balances is smaller than the first share of its value without
# friction. If friction varies with the speed, the body jams at the second share.
NEARLY_JAMMED, LEAST_DETERMINANT = 1e-2, 1e-6

# Where both roots of the equation of stick meet, a reaction may fall to zero at an infinite rate. If it is smaller
# than this share of the load there, the contact opens.
_LEAST_AT_FOLD = 1e-5

# Near the instant at which both roots of the equation of stick meet, its series converge ever more slowly. A
# discriminant below this share of its terms is zero.
_LEAST_DISCRIMINANT = 1e-12

# Regions of stick, by the pull on the body, where friction depends on the direction; else the region is KINETIC.
FORWARD, BACKWARD = KINETIC + 1, KINETIC + 2

#: Friction coefficients that differ by less than this share are equal.
EQUAL = 1e-14


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
        Segment and turn of each contact. An open contact keeps its last place.
    contacts : Contacts
        Which contacts are open, of a body that may leave the race; an empty tuple if it may not.
    """

    sign: int
    region: int
    entry_guard: int
    place_1: tuple[int, int]
    place_2: tuple[int, int]
    contacts: Any


#: Mode with another slip, at other places, and with other contacts.
with_slip, with_places = replacing("sign", "region", "entry_guard"), replacing("place_1", "place_2")
with_contacts = replacing("contacts")


@modes.begin.implements(ring.Ring)
def _begin_on_ring(scene):
    """Implement :func:`modes.begin`; the state is ``(phi, v)``."""
    t, phi, launch = drives.beginning(scene.drive), scene.initial_phi, ring.launch_velocity(scene)
    v = drives.velocity_at_beginning(scene.drive, launch) * scene.body.radius
    status, mode, v = mode_at(scene, Instant(t, 0.0), phi, v)
    return t, (phi, v), status, mode


@modes.after_jump.implements(ring.Ring)
def _after_jump_on_ring(scene, mode, t, y, jump):
    """Implement :func:`modes.after_jump`."""
    status, mode, v = mode_at(scene, t, y[0], y[1] - jump * scene.body.radius)
    return status, mode, (y[0], v)


@feature("False", of=drives.Power)
def _is_jerked(drive, scene, t, v):
    """Whether `v` comes only from an infinite acceleration of the ring at t = 0, before which the body was at rest."""
    if v == 0.0 or parts(t)[0] != drives.beginning(drive) or ring.launch_velocity(scene) != 0.0:
        return False
    return v == drives.velocity_at_beginning(drive, 0.0) * scene.body.radius


@inlined
def leaves_behind(scene, t, v):
    """Whether the ring has left a body behind at once, which was at rest under a set-valued law."""
    return stiction_band(scene.law) == 0.0 and _is_jerked(scene.drive, scene, t, v)


@series.table_shape.implements(ring.Ring, ring.BristleRing)
def _table_shape_on_ring(scene):
    """Implement :func:`series.table_shape`."""
    return FAST + 1, DETERMINANT


@inlined
def mode_at(scene, t, phi, v):
    """Status, mode and sliding velocity (m/s) of a body on closed contacts; `phi` in rad, `v` in m/s."""
    theta, ring_omega, ring_epsilon = drives.turn(scene.drive, t)
    held = held_at(scene, phi - theta)
    if stiction_band(scene.law) == 0.0 and (v == 0.0 or leaves_behind(scene, t, v)):
        # A ring that leaves a body behind may push it off a contact, jam it, or wedge it and take it along.
        status, mode = _mode_at_rest(scene, held, t, phi, 0)
        if v == 0.0 or status != RUNNING:
            return status, mode, v
        if mode.sign == 0:
            return status, mode, 0.0
    sign = 1 if v > 0.0 else -1
    region, entry_guard = region_at(scene.law, abs(v)), -1
    if v == 0.0:
        # Friction is zero here, so that the body slides in the direction in which the other forces accelerate it.
        epsilon, _ = ring.acceleration(scene.body, 0.0, 0.0, (sin(phi), cos(phi), ring_omega))
        sign, entry_guard = (1 if epsilon >= ring_epsilon else -1), SLOW
    mode = slipping(scene, held, phi - theta, (sign, region, entry_guard))
    return _status_at_start(scene.drive, scene, mode, t, (phi, v)), mode, v


@inlined
def held_at(scene, rho):
    """Mode of a body that sticks at the angle `rho` in the ring's frame, rad."""
    place_1, place_2 = places_at(scene, rho)
    return Mode(0, KINETIC, -1, place_1, place_2, ())


@inlined
def slipping(scene, mode, rho, slip):
    """Mode of a body that begins to slip; `slip` is the sign, the region of the law, and the entry guard."""
    return with_slip(with_places(mode, *places_beyond(scene, mode.place_1, mode.place_2, rho, slip[0])), *slip)


@inlined
def _at_breakaway(scene, mode):
    """Friction coefficients under contacts 1 and 2 as slip begins; static if the law does not drop there."""
    surfaces = coefficients_in_slip(scene, mode)
    mu_s1, mu_s2 = surfaces[0], surfaces[2]
    mu_1, mu_2, _, _ = friction_in(scene.law, mode.region, 0.0, surfaces)
    # Friction that does not drop at breakaway is static friction, without the rounding of the formula.
    return (
        mu_s1 if abs(mu_1 - mu_s1) <= EQUAL * mu_s1 else mu_1,
        mu_s2 if abs(mu_2 - mu_s2) <= EQUAL * mu_s2 else mu_2,
    )


@inlined
def _problem_at_rest(scene, mode, t, phi):
    """The modes of slip from rest; static coefficients under the contacts; what else :func:`contact.at_rest` takes."""
    theta, ring_omega, ring_epsilon = drives.turn(scene.drive, t)
    region = region_at(scene.law, 0.0)
    mu_s1, _, mu_s2, _ = coefficients_under(scene, mode)
    forward = slipping(scene, mode, phi - theta, (1, region, SLOW))
    backward = slipping(scene, mode, phi - theta, (-1, region, SLOW))
    breakaway = _at_breakaway(scene, forward), _at_breakaway(scene, backward)
    return (forward, backward), (mu_s1, mu_s2), (*breakaway, (sin(phi), cos(phi), ring_omega), ring_epsilon)


@inlined
def _mode_at_rest(scene, mode, t, phi, stick_end):
    """Status and mode of a set-valued law at zero sliding velocity; see :func:`contact.at_rest` for `stick_end`."""
    (forward, backward), (mu_s1, mu_s2), problem = _problem_at_rest(scene, mode, t, phi)
    _, _, motion, ring_epsilon = problem
    stick = with_slip(mode, 0, _region_of_stick(mu_s1, mu_s2, scene.body, motion, ring_epsilon), -1)
    found = contact.at_rest(scene.body, (mu_s1, mu_s2), *problem, stick_end)
    if found == contact.IMPOSSIBLE:
        # A contact on an edge may belong to either side.
        for slip in (forward, backward):
            mu_s1, _, mu_s2, _ = coefficients_under(scene, slip)
            on_edge = slip.place_1 != mode.place_1 or slip.place_2 != mode.place_2
            if on_edge and contact.at_rest(scene.body, (mu_s1, mu_s2), *problem, 0) == contact.STICK:
                region = _region_of_stick(mu_s1, mu_s2, scene.body, motion, ring_epsilon)
                return RUNNING, with_slip(slip, 0, region, -1)
    if found == contact.FORWARD:
        return RUNNING, forward
    if found == contact.BACKWARD:
        return RUNNING, backward
    if isnan(phi + ring_epsilon):
        return BROKEN, stick
    return ENDS[found], stick


@hook
def friction_and_motion(scene, mode, t, y):
    """``((K1, K2), motion)`` in the slip of a mode, as :func:`ring.acceleration` takes them."""


@friction_and_motion.implements(ring.Ring)
def _friction_and_motion_on_ring(scene, mode, t, y):
    """Implement :func:`friction_and_motion`."""
    omega = ring.angular_velocity(scene.body, y[1], drives.turn(scene.drive, t)[1])
    return friction_under(scene, mode, abs(y[1])), (sin(y[0]), cos(y[0]), omega)


@inlined
def after_jump(scene, mode, t, y):
    """Status in slip after friction may have jumped."""
    K, motion = friction_and_motion(scene, mode, t, y)
    if isnan(K[0] + K[1] + motion[0] + motion[2]):
        return BROKEN
    return ENDS[contact.sliding(scene.body, *K, motion)]


# Speeds at which an end is looked for in the band of a smooth law.
_SPEEDS = 400


@feature("after_jump(scene, mode, t, y)", of=drives.Power)
def _status_at_start(drive, scene, mode, t, y):
    """Status of a run that begins in slip."""
    phi, v = y
    status = after_jump(scene, mode, t, y)
    if status == RUNNING or stiction_band(scene.law) == 0.0 or not _is_jerked(drive, scene, t, v):
        return status
    # The sliding velocity has grown from 0 to v in no time, and friction with it: a contact may have been lost before
    # the body would jam.
    for i in range(1, _SPEEDS):
        slower = v * i / _SPEEDS
        there = with_slip(mode, mode.sign, region_at(scene.law, abs(slower)), -1)
        earlier = after_jump(scene, there, t, (phi, slower))
        if earlier != RUNNING:
            return earlier
    return status


@inlined
def _loads_in_slip(scene, mode, t, y):
    """``(determinant, N1, N2, scale of the load)`` in slip, from the balances and not from a series; N."""
    body, (K, motion) = scene.body, friction_and_motion(scene, mode, t, y)
    epsilon, determinant = ring.acceleration(body, *K, motion)
    normal_1, normal_2 = ring.reactions(body, *K, motion)
    scale = body.mass * (body.gravity + body.radius * (motion[2] * motion[2] + abs(epsilon)))
    return determinant, normal_1, normal_2, scale


@inlined
def is_jamming(scene, mode, t, y):
    """Whether slip is so near to a jam, where reactions grow without bound, that their signs mean nothing."""
    determinant, _, _, _ = _loads_in_slip(scene, mode, t, y)
    return not determinant > NEARLY_JAMMED * ring.free_determinant(scene.body)


@inlined
def lost_in_slip(scene, mode, first, t, y):
    """Status after the reaction of contact 1 (`first`) or of contact 2 has vanished in slip."""
    determinant, normal_1, normal_2, scale = _loads_in_slip(scene, mode, t, y)
    # Near a jam the series of a reaction is inaccurate, and may vanish where the reaction does not.
    if (normal_1 if first else normal_2) > 1e-2 * scale:
        return BROKEN if determinant > NEARLY_JAMMED * ring.free_determinant(scene.body) else JAM
    return _separated(scene.body, (normal_1, normal_2), scale, first)


@inlined
def _separated(body, normals, scale, first):
    """Status after contact 1 (`first`) or 2 is lost, or both if the other reaction is nearly zero; `scale` in N."""
    least = _AT_ONCE * scale
    return ENDS[contact.lost(body, first or normals[0] <= least, not first or normals[1] <= least)]


@inlined
def _problem_of_stick(scene, mode, t, y):
    """Static coefficients that face the pull, motion, and acceleration of the ring, as :func:`contact.stick` takes."""
    _, ring_omega, ring_epsilon = drives.turn(scene.drive, t)
    mu_s1, _, mu_s2, _ = coefficients_under(scene, mode)
    static = facing((mu_s1, mu_s2), _pull_of(mu_s1, mode))
    return *static, (sin(y[0]), cos(y[0]), ring_omega), ring_epsilon


@inlined
def _loads_as_stick_ends(scene, mode, t, y, first):
    """``((N1, N2), scale)`` where the reaction of contact 1 (`first`) or 2 has vanished in stick; N."""
    body, problem = scene.body, _problem_of_stick(scene, mode, t, y)
    ring_omega = problem[2][2]
    normals = contact.loads_as_stick_ends(body, *problem, first)
    return normals, body.mass * (body.gravity + body.radius * ring_omega * ring_omega)


@recorder.at_once.implements(ring.Ring)
def _at_once_on_ring(scene, status, mode, t, y, seen):
    """Implement :func:`recorder.at_once`: a body at rest is in the mode of stick."""
    if mode.sign != 0:
        return seen_in_slip_at_once(scene, status, friction_and_motion(scene, mode, t, y), seen)
    _, static, (forward, backward, motion, epsilon) = _problem_at_rest(scene, mode, t, y[0])
    problem = contact.at_breakaway(static, forward, backward), static, 0, motion, epsilon
    return _seen_opened(scene, status, problem, seen)


@inlined
def seen_in_slip_at_once(scene, status, slip, seen):
    """Implement :func:`recorder.at_once` in slip; `slip` is what :func:`friction_and_motion` returns."""
    K, motion = slip
    return _seen_opened(scene, status, (K, (0.0, 0.0), 1, motion, 0.0), seen)


@inlined
def _seen_opened(scene, status, problem, seen):
    """What the recorder is shown of a body that ends at launch; `problem` is the rest of :func:`contact.opened`."""
    if not isfinite(seen[2] + seen[3]):
        # The numbers of the launch are too large, or none.
        return seen
    opens = contact.OPEN_1 if status == SEPARATED_1 else contact.OPEN_2 if status == SEPARATED_2 else contact.OPEN_BOTH
    closed = seen[2], seen[3], seen[4].acceleration
    normal_1, normal_2, epsilon = contact.opened(scene.body, opens, closed, *problem)
    return joined((seen[0], seen[1], normal_1, normal_2, Located(epsilon, seen[4].size)), seen[5:])


@recorder.as_mode_ends.implements(ring.Ring)
def _as_mode_ends_on_ring(scene, record, mode, guard, t, y):
    """Implement :func:`recorder.as_mode_ends`: extremes of the reactions where both roots of stick meet.

    Reactions go with the root of the discriminant. A discriminant that is nearly zero leaves a part of them out.
    """
    if mode.sign != 0 or guard != EDGE:
        return record
    problem = _problem_of_stick(scene, mode, t, y)
    if not contact.folds(scene.body, problem[0], problem[1]):
        return record
    normal_1, normal_2 = contact.loads_at_fold(scene.body, *problem)
    return with_reactions(
        record,
        min(record.normal_min_1, normal_1),
        min(record.normal_min_2, normal_2),
        max(record.normal_max_1, normal_1),
        max(record.normal_max_2, normal_2),
    )


@modes.status_when_stalled.implements(ring.Ring)
def _status_when_stalled_on_ring(scene, mode, t, y):
    """Implement :func:`modes.status_when_stalled`: steps also shrink as the body nears a jam."""
    if mode.sign == 0:
        return BROKEN
    # Where friction changes fast with the speed, the determinant does not show the jam: test with static coefficients.
    surfaces = coefficients_in_slip(scene, mode)
    K1, K2 = -mode.sign * surfaces[0], -mode.sign * surfaces[2]
    _, determinant = ring.acceleration(scene.body, K1, K2, (0.0, 1.0, 0.0))
    return JAM if is_jamming(scene, mode, t, y) or not determinant > 0.0 else BROKEN


@modes.switch.implements(ring.Ring)
def _switch_on_ring(scene, mode, guard, t, y):
    """Implement :func:`modes.switch`.

    In slip SLOW and FAST are the bounds of the region of the law, EDGE is the edge of a zone. In stick SLOW begins
    forward slip and FAST backward slip; at EDGE no friction holds the body.
    """
    phi, v = y
    if guard in (NORMAL_1, NORMAL_2):
        if mode.sign != 0:
            return lost_in_slip(scene, mode, guard == NORMAL_1, t, y), mode, y
        # The contact opens, even if slip with both contacts closed were admissible: laws with a narrow stiction band
        # still hold the body at this instant.
        normals, scale = _loads_as_stick_ends(scene, mode, t, y, guard == NORMAL_1)
        return _separated(scene.body, normals, scale, guard == NORMAL_1), mode, y
    if guard == DETERMINANT:
        return JAM, mode, y
    mu_s1, _, mu_s2, _ = coefficients_under(scene, mode)
    if _pull_turns(mu_s1, mode, guard):
        return RUNNING, with_slip(mode, 0, FORWARD + BACKWARD - mode.region, SLOW + FAST - guard), y
    stick_end = 0
    if mode.sign == 0:
        if guard == EDGE and contact.folds(scene.body, *facing((mu_s1, mu_s2), _pull_of(mu_s1, mode))):
            (normal_1, normal_2), scale = _loads_as_stick_ends(scene, mode, t, y, True)
            if min(normal_1, normal_2) <= _LEAST_AT_FOLD * scale:
                return _separated(scene.body, (normal_1, normal_2), scale, normal_1 <= normal_2), mode, y
        stick_end = 1 if guard == SLOW else -1 if guard == FAST else 2
    else:
        if guard == EDGE:
            mode = with_places(mode, *places_after_edge(scene, mode, phi - drives.turn(scene.drive, t)[0]))
        mode, v = slip_after(scene.law, mode, guard, v, along(mu_s1, 0.0) + along(mu_s2, 0.0))
    if mode.sign == 0:
        status, mode = _mode_at_rest(scene, mode, t, phi, stick_end)
        return status, mode, (phi, 0.0)
    return after_jump(scene, mode, t, (phi, v)), mode, (phi, v)


@inlined
def slip_after(law, mode, guard, v, mu_s):
    """Mode and sliding velocity after slip has crossed an edge, or has come to an end of its region of the law.

    The mode is stick if the body is at rest and friction may hold it: then the contact problem decides.
    """
    sign, region = mode.sign, mode.region
    low, high = region_bounds(law, region)
    # A formula may jump at the bound of a region.
    if guard == FAST:
        return with_slip(mode, sign, region + 1, SLOW), sign * high
    if guard == SLOW and low > 0.0:
        return with_slip(mode, sign, region - 1, FAST), sign * low
    if guard != SLOW:
        return with_slip(mode, sign, region, SLOW if v == 0.0 else -1), v
    # A body that nothing holds passes through rest.
    if region < 0 or mu_s == 0.0:
        return with_slip(mode, -sign, region, SLOW), 0.0
    return with_slip(mode, 0, KINETIC, -1), 0.0


@series.fill_table.implements(ring.Ring)
def _fill_table_on_ring(scene, mode, t, y, tolerance, c):
    """Implement :func:`series.fill_table`: fill all rows of the table, in stick or in slip."""
    drives.expand_at(scene.drive, t, ORDER + 2, c[THETA], c[FACTORS:])
    c[PHI, 0] = y[0]
    c[V, 0] = y[1]
    if mode.sign == 0:
        return _expand_stick(scene, mode, tolerance, c)
    c[OMEGA, 0] = ring.angular_velocity(scene.body, y[1], c[THETA, 1])
    # These divisions wait for nothing, and need not be waited for if they come first.
    per_angle = 1.0 / tolerance
    per_velocity = per_angle / speed_in(scene, mode, scene.body.radius * (rate_at_rest(scene) + abs(c[OMEGA, 0])))
    sharpness = _expand_slip(scene.law, scene, mode, c)
    _expand_slip_guards(scene, mode, c)
    # An error of the reactions could add or hide a separation. A bound on the acceleration is not enough: varying
    # friction changes the reactions even of a body that is too inert to be accelerated.
    per_load = 1.0 / REACTION_TOLERANCE * per_angle
    if varies(scene.law, mode.region):
        # Even at a loose tolerance a root of a reaction must not be a root of its error.
        per_load = max(per_load, 1e3)
    per_epsilon = per_load / (scene.body.gravity / scene.body.radius + c[SQUARE, 0] + abs(c[EPSILON, 0]))
    per_reaction = per_epsilon / (scene.body.mass * scene.body.radius)
    reactions = (NORMAL_1, per_reaction), (NORMAL_2, per_reaction)
    h = step_within(c, ((PHI, per_angle), (V, per_velocity), (EPSILON, per_epsilon), *reactions))
    return shorten_for_decay(sharpness, c[V], h), h


@generated
def _expand_slip(law, scene, mode, c):
    """Fill the series of slip and return the sharpness of the friction law."""
    return _expand_slip_of_varying_friction if is_varying(law) else _expand_slip_of_constant_friction


@inlined
def _expand_slip_of_varying_friction(law, scene, mode, c):
    """As :func:`_expand_slip`, if friction depends on the sliding velocity.

    Each coefficient is computed from numbers that are still in registers; the table only keeps it.
    """
    body = scene.body
    sign = float(mode.sign)
    speed = sign * body.radius
    surfaces = coefficients_in_slip(scene, mode)
    omega_0 = c[OMEGA, 0]
    sin_0, cos_0, square_0 = sin(c[PHI, 0]), cos(c[PHI, 0]), omega_0 * omega_0
    (mu_1, mu_2), begun, sharpness = begin_series(scene.law, mode.region, sign * c[V, 0], surfaces)
    K1_0, K2_0 = -sign * mu_1, -sign * mu_2
    acceleration, reaction_1, reaction_2 = ring.slip_balance(body, K1_0, K2_0)
    epsilon = _constant_term(acceleration, sin_0, cos_0, omega_0, square_0)
    N1_0 = _constant_term(reaction_1, sin_0, cos_0, omega_0, square_0)
    N2_0 = _constant_term(reaction_2, sin_0, cos_0, omega_0, square_0)
    c[SIN, 0], c[COS, 0], c[SQUARE, 0], c[EPSILON, 0] = sin_0, cos_0, square_0, epsilon
    c[NORMAL_1, 0], c[NORMAL_2, 0] = N1_0, N2_0
    before = omega_0
    own, of_law = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0), no_products(scene.law, surfaces)
    first = newest = no_factors(joined(own, of_law))
    for k in range(1, ORDER + 1):
        omega = epsilon * INVERSE[k]
        x = speed * omega - speed * ((k + 1.0) * c[THETA, k + 1])
        inner = inner_products(c, FACTORS, k, first, newest)
        sine, cosine, square, loaded_1, loaded_2, both = part_from(inner, own, ())
        (mu_1, mu_2), law_left, law_right = series_term(
            scene.law, mode.region, k, x, part_from(inner, of_law, own), begun, surfaces
        )
        K1, K2 = -sign * mu_1, -sign * mu_2
        sine, cosine = (sine + before * cos_0) * INVERSE[k], -(cosine + before * sin_0) * INVERSE[k]
        square += 2.0 * omega_0 * omega
        loaded_1, loaded_2 = loaded_1 + K1 * N1_0, loaded_2 + K2 * N2_0
        epsilon = _term(acceleration, sine, cosine, omega, square, loaded_1, loaded_2)
        N1 = _term(reaction_1, sine, cosine, omega, square, loaded_1, loaded_2)
        N2 = _term(reaction_2, sine, cosine, omega, square, loaded_1, loaded_2)
        left, right = (before, before, omega, K1, K2, K1), (cosine, sine, omega, N1, N2, K2)
        newest = set_factors(c, FACTORS, k, joined(left, law_left), joined(right, law_right))
        first = newest if k == 1 else first
        c[PHI, k], c[OMEGA, k], c[V, k] = before * INVERSE[k], omega, sign * x
        c[SIN, k], c[COS, k], c[SQUARE, k], c[EPSILON, k] = sine, cosine, square, epsilon
        c[NORMAL_1, k], c[NORMAL_2, k] = N1, N2
        c[DETERMINANT, k] = ring.determinant_terms(body, 0.0, K1, K2, both + K1_0 * K2 + K1 * K2_0)
        before = omega
    # Before a jam the accelerations grow without bound, so that a small determinant counts as a jam.
    least = LEAST_DETERMINANT * ring.free_determinant(body) if varies(scene.law, mode.region) else 0.0
    c[DETERMINANT, 0] = ring.determinant_terms(body, 1.0, K1_0, K2_0, K1_0 * K2_0) - least
    return sharpness


@inlined
def _expand_slip_of_constant_friction(law, scene, mode, c):
    """As :func:`_expand_slip`, if friction does not depend on the sliding velocity."""
    body, sign = scene.body, float(mode.sign)
    mu_1, mu_2, _, _ = friction_in(law, mode.region, sign * c[V, 0], coefficients_in_slip(scene, mode))
    K1, K2 = -sign * mu_1, -sign * mu_2
    acceleration, reaction_1, reaction_2 = ring.slip_balance(body, K1, K2)
    c[SIN, 0], c[COS, 0] = sin(c[PHI, 0]), cos(c[PHI, 0])
    swing(c[OMEGA], c[SIN], c[COS], c[SQUARE], acceleration[:5])
    motion = c[SIN, 0], c[COS, 0], c[OMEGA, 0], c[SQUARE, 0]
    sine, cosine, omega, square = terms(c[SIN]), terms(c[COS]), terms(c[OMEGA]), terms(c[SQUARE])
    for row, balance in ((EPSILON, acceleration), (NORMAL_1, reaction_1), (NORMAL_2, reaction_2)):
        c[row, 0] = _constant_term(balance, *motion)
        set_terms(c[row], sine * balance[1] + cosine * balance[2] + omega * balance[3] + square * balance[4])
    set_terms(c[PHI], numbers_from(c[OMEGA], 0) * numbers_from(INVERSE, 1))
    set_terms(c[V], (omega - numbers_from(c[THETA], 2) * numbers_from(_SECOND, 0)) * body.radius)
    c[DETERMINANT, 0] = ring.determinant_terms(body, 1.0, K1, K2, K1 * K2)
    set_terms(c[DETERMINANT], numbers_from(_NONE, 0))
    return 0.0


@inlined
def _constant_term(balance, sine, cosine, omega, square):
    """Coefficient 0 of an acceleration or a reaction, from its row in :func:`ring.slip_balance`."""
    return balance[0] + balance[1] * sine + balance[2] * cosine + balance[3] * omega + balance[4] * square


@absorbed
def _term(balance, sine, cosine, omega, square, loaded_1, loaded_2):
    """Coefficient 1 or higher, else as :func:`_constant_term`; `loaded` are friction forces, which come last."""
    of_motion = balance[1] * sine + balance[2] * cosine + balance[3] * omega + balance[4] * square
    return (of_motion + balance[5] * loaded_1) + balance[6] * loaded_2


@inlined
def _expand_slip_guards(scene, mode, c):
    """Fill the guards of slip for both ends of the region of the friction law, and for the nearer edge."""
    body = scene.body
    size = body.gravity + body.radius * (c[SQUARE, 0] + abs(c[EPSILON, 0]) + 2.0 * abs(c[THETA, 2]))
    expand_bounds(c, (V, SLOW, FAST), mode, region_bounds(scene.law, mode.region), size)
    set_terms(c[EDGE], (terms(c[THETA]) - terms(c[PHI])) * float(mode.sign))
    c[EDGE, 0] = min(edges_ahead(scene, mode, c[PHI, 0] - c[THETA, 0]))


@inlined
def _expand_stick(scene, mode, tolerance, c):
    """Fill the series of stick and return what :func:`series.fill_table` does; the body moves with the ring.

    The guards are the reactions; the reserves of friction, N, before forward slip (SLOW) and before backward slip
    (FAST), see :func:`contact.sharing`; and for two contacts EDGE, the discriminant of the quadratic equation, or the
    factor of a linear one. With one contact EDGE is infinite. If friction depends on the direction, the pull stands in
    place of the reserve against it.
    """
    body, (mu_s1, _, mu_s2, _) = scene.body, coefficients_under(scene, mode)
    m1, m2 = facing((mu_s1, mu_s2), _pull_of(mu_s1, mode))
    (ahead_1, ahead_2), (back_1, back_2) = facing((mu_s1, mu_s2), 1.0), facing((mu_s1, mu_s2), -1.0)
    by_F2, omega_0 = contact.by_friction(body), c[THETA, 1]
    sin_0, cos_0 = sin(c[PHI, 0]), cos(c[PHI, 0])
    before = first_N2 = first_F1 = first_linear = first_F2 = 0.0
    own = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
    first = newest = no_factors(own)
    c[EDGE, 0] = c[DETERMINANT, 0] = inf
    for k in range(ORDER + 1):
        one, omega, epsilon = 0.0, (k + 1.0) * c[THETA, k + 1], (k + 1.0) * (k + 2.0) * c[THETA, k + 2]
        inner = inner_products(c, FACTORS, k, first, newest)
        sine, cosine, square, rest, squared, mixed, both = part_from(inner, own, ())
        if k == 0:
            one, sine, cosine, square = 1.0, sin_0, cos_0, omega_0 * omega_0
        else:
            sine, cosine = (sine + before * cos_0) * INVERSE[k], -(cosine + before * sin_0) * INVERSE[k]
            square += 2.0 * omega_0 * omega
            c[PHI, k] = c[THETA, k]
        at_zero = ring.held(body, one, (sine, cosine, omega), square, epsilon, 0.0)
        N1, N2, F1 = at_zero
        F2, linear, normals, friction, ahead, back = 0.0, 0.0, (N1, N2), F1, ahead_1 * N1, back_1 * N1
        if ring.contact_count(body) == 2:
            quadratic, linear, _ = contact.sharing(m1, m2, at_zero, by_F2)
            # Where both roots meet, stick ends: no friction gives the acceleration of the ring.
            if k == 0:
                first_N2, first_F1, first_linear = N2, F1, linear
                first_term, last_term = linear * linear, 4.0 * quadratic * (m2 * F1 * N2)
                c[EDGE, 0] = first_term - last_term - _LEAST_DISCRIMINANT * (first_term + abs(last_term))
                F2 = first_F2 = contact.shared_friction(m1, m2, at_zero, by_F2)
            else:
                constant = m2 * (first_F1 * N2 + F1 * first_N2 + rest)
                c[EDGE, k] = 2.0 * first_linear * linear + squared - 4.0 * quadratic * constant
                F2 = -(quadratic * both + mixed + linear * first_F2 + constant)
                F2 = F2 / (2.0 * quadratic * first_F2 + first_linear) if m1 + m2 > 0.0 else F1 / (1.0 - by_F2[2])
            if quadratic == 0.0:
                # An equation that is linear leaves the share open where its factor vanishes.
                c[EDGE, k] = -linear
            normal_1, normal_2, friction = contact.at(F2, at_zero, by_F2)
            normals = normal_1, normal_2
            ahead, back = ahead_1 * normal_1 + ahead_2 * normal_2, back_1 * normal_1 + back_2 * normal_2
        if k > 0:
            left, right = (before, before, omega, F1, linear, linear, F2), (cosine, sine, omega, N2, linear, F2, F2)
            newest = set_factors(c, FACTORS, k, left, right)
            first = newest if k == 1 else first
        c[V, k], c[OMEGA, k], c[EPSILON, k] = 0.0, omega, epsilon
        c[SIN, k], c[COS, k], c[SQUARE, k] = sine, cosine, square
        c[NORMAL_1, k], c[NORMAL_2, k] = normals
        c[SLOW, k], c[FAST, k] = _reserves(mu_s1, mode, ahead, back, friction)
        before = omega
    _begin_pull(mu_s1, mode, c)
    per_angle = 1.0 / tolerance
    per_load = per_angle / (body.mass * (body.gravity + body.radius * c[SQUARE, 0]))
    units = (PHI, per_angle), (SIN, per_angle), (COS, per_angle), (SLOW, per_load), (FAST, per_load)
    h = step_within(c, units)
    return h, h


@feature("ahead + friction, back - friction", of=TwoWay)
def _reserves(mu_s, mode, ahead, back, friction):
    """Coefficients of the guards SLOW and FAST in stick; `ahead` and `back` are most friction against each slip, N."""
    slow = friction if mode.region == BACKWARD else ahead + friction
    return slow, -friction if mode.region == FORWARD else back - friction


@feature("None", of=TwoWay)
def _begin_pull(mu_s, mode, c):
    """Make a pull that has just turned begin with zero, and one that never begins no guard."""
    row = FAST if mode.region == FORWARD else SLOW
    if mode.region != KINETIC and mode.entry_guard == row:
        c[row, 0] = 0.0
    elif mode.region != KINETIC and not c[row].any():
        c[row, 0] = 1.0


@feature("KINETIC", of=TwoWay)
def _region_of_stick(mu_s1, mu_s2, body, motion, epsilon):
    """Region of stick: FORWARD or BACKWARD if the direction of the pull changes how two contacts share it."""
    alike = mu_s1.forward * mu_s2.backward == mu_s1.backward * mu_s2.forward
    if alike or ring.contact_count(body) == 1:
        return KINETIC
    return FORWARD if ring.held(body, 1.0, motion, motion[2] * motion[2], epsilon, 0.0)[2] <= 0.0 else BACKWARD


@feature("0.0", of=TwoWay)
def _pull_of(mu_s, mode):
    """Direction in which a stuck body is pulled, 1 or -1, if that matters for its contacts; else 0."""
    return 1.0 if mode.region == FORWARD else -1.0 if mode.region == BACKWARD else 0.0


@feature("False", of=TwoWay)
def _pull_turns(mu_s, mode, guard):
    """Whether the event is that the pull on a stuck body changes its sign."""
    return mode.sign == 0 and guard == (FAST if mode.region == FORWARD else SLOW) and mode.region != KINETIC


@series.seen_at_start.implements(ring.Ring)
def _seen_at_start_on_ring(scene, c):
    """Implement :func:`series.seen_at_start`: what ``_observe_on_ring`` in :mod:`record` takes."""
    return c[PHI, 0], c[OMEGA, 0], c[NORMAL_1, 0], c[NORMAL_2, 0], _located(scene, c, c[EPSILON, 0])


@series.seen_at.implements(ring.Ring)
def _seen_at_on_ring(scene, mode, c, s, h):
    """Implement :func:`series.seen_at`: what ``_observe_on_ring`` in :mod:`record` takes."""
    phi, omega, epsilon = value(c[PHI], s), value(c[OMEGA], s), value(c[EPSILON], s)
    normal_1, normal_2 = value(c[NORMAL_1], s), value(c[NORMAL_2], s)
    if mode.sign != 0:
        # Where the law bends, the series of the reactions is less exact than that of the motion.
        K1, K2 = friction_under(scene, mode, abs(value(c[V], s)))
        motion = value(c[SIN], s), value(c[COS], s), omega
        epsilon, _ = ring.acceleration(scene.body, K1, K2, motion)
        normal_1, normal_2 = ring.reactions(scene.body, K1, K2, motion)
    return phi, omega, normal_1, normal_2, _located(scene, c, epsilon)


@inlined
def _located(scene, c, epsilon):
    """Angular acceleration `epsilon` and the size of its terms, rad/s^2, for the recorder."""
    return Located(epsilon, scene.body.gravity / scene.body.radius + c[SQUARE, 0] + abs(epsilon))


@series.extremes.implements(ring.Ring)
def _extremes_on_ring(scene, record, mode, c, h, work):
    """Implement :func:`series.extremes`: of phi, omega and both reactions; and the ends of cycles."""
    count, (slowest, fastest) = 0, bounds_within(c[OMEGA], h)
    may_reverse = slowest <= 0.0 <= fastest
    # Look for an extreme only if it could exceed the recorded ones, or if omega may change sign within the step.
    if may_reverse:
        least, greatest = bounds_within(c[PHI], h)
        if least < record.lowest or greatest > record.highest:
            count = crossings(c[OMEGA], h, work, count)
    if may_reverse or slowest < record.omega_min or fastest > record.omega_max:
        count = crossings(c[EPSILON], h, work, count)
    for row, lowest, highest in (
        (NORMAL_1, record.normal_min_1, record.normal_max_1),
        (NORMAL_2, record.normal_min_2, record.normal_max_2),
    ):
        least, greatest = bounds_within(c[row], h)
        if least < lowest or greatest > highest:
            differentiate(c[row], c[SPARE])
            count = crossings(c[SPARE], h, work, count)
    # The drive may end its next period.
    rest = long_run.rest(record.long_run)
    if 0.0 < rest < h:
        work[0][count] = rest
        count += 1
    return count


#: History variables, in the order of their columns; behind them stand the deflections of bristles.
HISTORY = "phi", "omega", "epsilon", "normal_1", "normal_2", "ring_omega", "zone_1", "zone_2", "mode"


@modes.row.implements(ring.Ring, ring.BristleRing)
def _row_on_ring(scene, mode, forcing, y, seen):
    """Implement :func:`modes.row`: the columns :data:`HISTORY`, and the deflections of bristles."""
    phi, omega, normal_1, normal_2, located = seen[:5]
    places, state = zones_of(scene, mode.place_1, mode.place_2), 0.0 if mode.region < 0 else float(mode.sign)
    return phi, omega, located.acceleration, normal_1, normal_2, forcing[1], *places, state, *y[2:]
