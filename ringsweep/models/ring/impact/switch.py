"""Which mode follows another while contacts open and close.

Solvers call :func:`ringsweep.models.interface.modes.begin` and ``switch`` once for each event; nothing here runs
within a step. Read :mod:`mode` first: the state `y` of nine numbers, and the :class:`mode.Contacts` of a mode.
`zeros` are the leading coefficients of a gap that are zero when it opens; `event` is the :class:`mode.Event` that the
new mode remembers. Rebounds that are *summed* are taken at their limit: the contact closes.
"""

from __future__ import annotations

from math import cos, isnan, pi, sin
from typing import NamedTuple

from ringsweep.compile import inlined, replacing
from ringsweep.models.interface import modes
from ringsweep.models.interface.status import (
    BROKEN,
    JAM,
    RUNNING,
    SEPARATED_1,
    SEPARATED_2,
    SEPARATED_BOTH,
)
from ringsweep.models.ring.impact import pivot
from ringsweep.models.ring.impact.mode import (
    BOTH,
    CLOSES,
    FIRST,
    NO_EVENT,
    NONE,
    REBOUNDS,
    SECOND,
    TURNED,
    Contacts,
    Event,
    angle_at_gap,
    coefficients_there,
    delta_when_closed,
    distances_to_edges,
    frame,
    gap_measure,
    holding,
    in_flight,
    opens,
    place_of,
    ring_of,
    state_when_closed,
    with_lasts,
    with_passed,
    with_place,
    with_zeros,
)
from ringsweep.models.ring.series import (
    DETERMINANT,
    EDGE,
    NEARLY_JAMMED,
    NORMAL_1,
    NORMAL_2,
    SLOW,
    Mode,
    leaves_behind,
    mode_at,
    slip_after,
    with_contacts,
    with_slip,
)
from ringsweep.numerics.clock import Instant, parts
from ringsweep.physics import drives, ring
from ringsweep.physics.friction.velocity import KINETIC, friction_at
from ringsweep.physics.impact import (
    Contact,
    ImpactRing,
    Impulses,
    Motion,
    after_impact,
    contact_of,
    free_gap_acceleration,
    impulses,
    inertia,
    relative_to_race,
    side_of,
)
from ringsweep.physics.pivot import determinant, in_stick, load
from ringsweep.physics.zones import cross_edge, locate

#: Rebounds that end so soon that the gap could not grow to this share of rho are summed: the contact closes. The place
#: is then wrong by about as much.
SUMMED = 1e-12

# A body that rocks from one contact to the other comes to rest in a row of impacts, too. What is left of the sliding
# velocity is as slow as they are: the row is summed where its hops could not grow to this share of rho.
_ROCKING = 1e-20

# Where rebounds are summed, slow velocities are left. An impact that friction forbids then closes the contact.
_FORBIDDEN = 1e-10

# A reaction that reaches zero leaves a gap that does not close, but for this share of the accelerations. One that
# passes through infinity, in the instant of a jam, leaves one that does.
_NO_LOAD = 1e-6

# A contact that would close after this share of the time since the last event closes together with the one that does.
# By the second share it may be late by rounding.
_TOGETHER, _ROUNDING = 1e-12, 1e-15


@inlined
def motion_of(scene, y, ring_omega):
    """Motion in space, from the state `y` of nine numbers; with ``ring_omega = 0`` relative to the race."""
    code = int(y[-1] + 0.5)
    contacts, turned = code % TURNED, code // TURNED
    if contacts == NONE:
        closed = ring_of(scene, turned).body
        omega = ring.angular_velocity(closed, y[1], ring_omega)
        distance = scene.balls.reach * cos(ring.contact_offset(closed)) + scene.balls.offset
        s, c = distance * sin(y[0]), distance * cos(y[0])
        return Motion(y[0], omega, s, omega * c, -c, omega * s)
    if contacts == BOTH:
        return Motion(y[0], y[1], y[2], y[3], y[4], y[5])
    f = frame(scene, y, ring_omega)
    out, along = f.reach + f.u, f.reach * f.alpha_dot + f.u * f.psi_dot
    inwards = f.w * f.psi_dot
    return Motion(
        y[0],
        f.psi_dot,
        out * f.sin_alpha + f.w * f.cos_alpha,
        along * f.cos_alpha - inwards * f.sin_alpha,
        f.w * f.sin_alpha - out * f.cos_alpha,
        along * f.sin_alpha + inwards * f.cos_alpha,
    )


@inlined
def state_in_flight(motion, turned, gaps):
    """State of nine numbers of a body without contacts; `gaps` are the measures of both gaps, m."""
    code = float(BOTH + TURNED * turned)
    return motion.psi, motion.psi_dot, motion.x, motion.x_dot, motion.y, motion.y_dot, *gaps, code


@inlined
def _presses(scene, contact, motion):
    """Whether the gap of a contact that touches would close, if the body were free."""
    gravity = scene.closed.body.gravity
    least = -_NO_LOAD * (gravity + scene.balls.reach * motion.psi_dot * motion.psi_dot)
    return free_gap_acceleration(scene.balls, contact, motion, gravity) < least


@inlined
def _opened(scene, t, y, before, which, zeros, event):
    """Status, mode and state after contacts of a closed ring have opened.

    `y` and `before` are its state and mode; `which` is FIRST, SECOND or BOTH.
    """
    _, ring_omega, _ = drives.turn(scene.drive, t)
    turned = before.contacts.turned
    if which != BOTH:
        state = y[0], y[1], 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, float(which + TURNED * turned)
        zeros_1, zeros_2 = (zeros, 0) if which == FIRST else (0, zeros)
        opened = with_contacts(before, Contacts(which, turned, zeros_1, zeros_2, event))
        if load(frame(scene, state, ring_omega)) > 0.0:
            status, mode = pivot.begun(scene, t, state, with_slip(opened, 0, KINETIC, -1), 0)
            return status, mode, state
        if _presses(scene, which, motion_of(scene, state, ring_omega)):
            # Neither contact can carry the body alone, and without both the one that is lost would close again.
            return JAM, opened, state
    motion = motion_of(scene, y, ring_omega)
    state = state_in_flight(motion, turned, (0.0, 0.0))
    flight = in_flight((before.place_1, before.place_2), turned, (zeros, zeros), event)
    several = which == BOTH and ring.contact_count(scene.closed.body) == 2
    if several and (_presses(scene, 1, motion) or _presses(scene, 2, motion)):
        # Each contact can carry the body alone, and without both one of them would close again.
        return JAM, flight, state
    return RUNNING, flight, state


@inlined
def _after_closed(scene, t, found, zeros, is_new):
    """Status, mode and state from `found`, those of the closed ring: a contact that it has lost is opened.

    `is_new` is whether the last event is the impact that has just closed the contacts.
    """
    status, mode, y = found
    if status not in (SEPARATED_1, SEPARATED_2, SEPARATED_BOTH):
        return found
    which, event = status - SEPARATED_1 + 1, mode.contacts.event
    if ring.contact_count(scene.closed.body) == 1:
        which = BOTH
    lost = with_passed(event, 1) if is_new else opens(which, event.number, t)
    return _opened(scene, t, y, mode, which, zeros, lost)


@inlined
def _taken_along(scene, t, wedged):
    """Status, mode and state of a body that was at rest and is wedged on one contact as the ring jerks.

    All accelerations are in proportion to that of the ring, and so are the velocities that they leave.
    """
    status, mode, y = wedged
    contacts = mode.contacts
    if contacts.open == NONE:
        return wedged
    _, ring_omega, ring_epsilon = drives.turn(scene.drive, t)
    carried = scene.closed.body.radius * ring_epsilon
    psi_dd, alpha_dd, _, _ = in_stick(frame(scene, y, ring_omega), carried)
    state = y[0], y[1], y[2], (psi_dd - alpha_dd) / ring_epsilon * ring_omega, *y[4:]
    return status, with_zeros(mode, (min(contacts.zeros_1, 1), min(contacts.zeros_2, 1))), state


@modes.begin.implements(ImpactRing)
def _begin_with_impact(scene):
    """Implement :func:`modes.begin`: as on the closed ring; a contact may be lost at once."""
    t, (phi, v), status, mode = modes.begin(scene.closed)
    now = Instant(t, 0.0)
    event = Event(NO_EVENT, 0, 0.0, 0.0, 0.0, 0.0, 0.0, 0, parts(now)[0], 0)
    mode = with_contacts(mode, Contacts(NONE, 0, 0, 0, event))
    found = status, mode, state_when_closed(phi, v, 0)
    if leaves_behind(scene.closed, now, v):
        wedged = _after_closed(scene, now, (status, mode, state_when_closed(phi, 0.0, 0)), 2, False)
        # A body that is wedged on one contact is taken along.
        found = _taken_along(scene, now, wedged) if wedged[0] == RUNNING and wedged[1].sign == 0 else found
    status, mode, y = _after_closed(scene, now, found, 2, False)
    return t, y, status, mode


@modes.switch.implements(ImpactRing)
def _switch_with_impact(scene, mode, guard, t, y):
    """Implement :func:`modes.switch`.

    While both contacts hold, the closed ring decides. The guard of a contact is its reaction while it holds, and its
    gap while it is open.
    """
    contacts = mode.contacts
    if contacts.open == NONE:
        status, after, (_, v) = modes.switch(ring_of(scene, contacts.turned), mode, guard, t, (y[0], y[1]))
        zeros = 3 if guard in (NORMAL_1, NORMAL_2) else 2
        return _after_closed(scene, t, (status, after, (y[0], v, *y[2:])), zeros, False)
    if guard == DETERMINANT:
        return _jammed(scene, mode, y[1]), mode, y
    if contacts.open != BOTH and guard not in (NORMAL_1, NORMAL_2):
        return _on_one_contact(scene, mode, guard, t, y)
    contact = 1 if guard == NORMAL_1 else 2
    if contacts.open == BOTH or contact != holding(mode):
        return _lands(scene, mode, contact, t, y)
    if _presses(scene, contact, motion_of(scene, y, drives.turn(scene.drive, t)[1])):
        return JAM, mode, y
    return _takes_off(scene, mode, t, y, 3)


@inlined
def _takes_off(scene, mode, t, y, zeros):
    """Status, mode and state after the contact that holds in a pivot has opened: a flight."""
    contacts, contact = mode.contacts, holding(mode)
    both = (zeros, contacts.zeros_2) if contact == 1 else (contacts.zeros_1, zeros)
    event = opens(contact, contacts.event.number, t)
    flight = in_flight((mode.place_1, mode.place_2), contacts.turned, _remaining(mode, y, both), event)
    motion, gap = motion_of(scene, y, drives.turn(scene.drive, t)[1]), gap_measure(scene, mode, y[2])
    gaps = (gap, 0.0) if contacts.open == FIRST else (0.0, gap)
    return RUNNING, flight, state_in_flight(motion, contacts.turned, gaps)


@inlined
def _jammed(scene, mode, v):
    """Status of a pivot in slip whose determinant nearly vanishes: BROKEN if friction rises with speed, else JAM.

    The reaction that grows meanwhile slows the slip down. Where friction rises with the speed, this keeps the contact
    from jamming, but only under an almost infinite acceleration of the ring does it come so near.
    """
    _, slope = pivot.friction(scene, mode, v)
    return BROKEN if slope < 0.0 else JAM


@inlined
def _remaining(mode, y, zeros):
    """Leading zeros of both gaps after an event in a pivot: none for the gap that has grown since it opened."""
    if y[2] == 0.0:
        return zeros
    return (0, zeros[1]) if mode.contacts.open == FIRST else (zeros[0], 0)


@inlined
def _on_one_contact(scene, mode, guard, t, y):
    """Status, mode and state after a guard of slip or stick in a pivot: an edge, a bound, rest, or breakaway."""
    v, stick_end, (mu_s, _, _) = y[1], 0, coefficients_there(scene, place_of(mode))
    theta, ring_omega, _ = drives.turn(scene.drive, t)
    if guard == EDGE:
        above, below = distances_to_edges(scene, mode, frame(scene, y, ring_omega).alpha - theta)
        mode = with_place(mode, cross_edge(scene.closed.surface, place_of(mode), 1 if above <= below else -1))
    mode = with_zeros(mode, _remaining(mode, y, (mode.contacts.zeros_1, mode.contacts.zeros_2)))
    if mode.sign == 0:
        stick_end = 0 if guard == EDGE else 1 if guard == SLOW else -1
    else:
        mode, v = slip_after(scene.law, mode, guard, v, mu_s)
    if mode.sign == 0:
        return _begun(scene, t, (y[0], 0.0, *y[2:]), mode, stick_end)
    state = y[0], v, *y[2:]
    K, _ = pivot.friction(scene, mode, v)
    denominator = determinant(frame(scene, state, ring_omega), K)
    return (RUNNING if denominator > 0.0 else BROKEN if isnan(denominator) else JAM), mode, state


@inlined
def _begun(scene, t, y, stick, stick_end):
    """Status, mode and state of a pivot at rest on its contact, by :func:`pivot.begun`; it may turn into a flight."""
    status, found = pivot.begun(scene, t, y, stick, stick_end)
    # Friction in stick may have pressed the ball against the race: when it drops, the contact opens.
    if status == JAM and not load(frame(scene, y, drives.turn(scene.drive, t)[1])) > 0.0:
        return _takes_off(scene, stick, t, y, 2)
    return status, found, y


@inlined
def _impact_friction(scene, contact, theta):
    """Friction coefficient of an impact at a :class:`Contact`, 1; `theta` is the angle of the ring."""
    mu_s, mu_k, _ = coefficients_there(scene, locate(scene.closed.surface, contact.alpha - theta))
    if scene.has_kinetic > 0.0:
        return mu_k
    return friction_at(scene.law, abs(contact.slip), (mu_s, mu_k))[0]


# A contact that holds: its gap does not change, and its sliding velocity is a state.
_held = replacing("gap", "opening", "slip")
_with_gap = replacing("gap")


class _Landing(NamedTuple):
    """A body when the gap of a contact has reached zero.

    Attributes
    ----------
    motion : Motion
        Motion in space.
    contacts : tuple of Contact
        Both contacts.
    held : tuple of bool
        Whether each contact has held up to now.
    mu : tuple of float
        Friction coefficients of an impact, 1.
    """

    motion: Motion
    contacts: tuple[Contact, Contact]
    held: tuple[bool, bool]
    mu: tuple[float, float]


class _Impact(NamedTuple):
    """An impact.

    Attributes
    ----------
    before : tuple of Contact
        Both contacts before it.
    touch, are_open : tuple of bool
        Whether each contact has no gap, and whether it is open afterwards.
    found : Impulses
    """

    before: tuple[Contact, Contact]
    touch: tuple[bool, bool]
    are_open: tuple[bool, bool]
    found: Impulses


class _Tried(NamedTuple):
    """What an impact with some restitution would lead to.

    Attributes
    ----------
    allowed : bool
        Whether friction allows it.
    solutions : int
        Number of solutions of the impact law.
    status, mode, state : int, Mode, tuple of float
        What follows; without a unique solution what was before.
    motion : Motion
        Motion afterwards.
    rebounds : tuple of bool
        Whether each contact has hit and is open again.
    openings : tuple of float
        Rates of the gaps afterwards, m/s.
    """

    allowed: bool
    solutions: int
    status: int
    mode: Mode
    state: tuple[float, float, float, float, float, float, float, float, float]
    motion: Motion
    rebounds: tuple[bool, bool]
    openings: tuple[float, float]


@inlined
def _lands(scene, mode, hit, t, y):
    """Status, mode and state after the gap of a contact has reached zero."""
    e, lasts = scene.restitution, 0.0
    landing, hits = _landing(scene, mode, hit, t, y)
    tried = _try(scene, mode, t, y, landing, hits, (e, e), lasts)
    first, second = landing.contacts
    together = _closes_within(_ROUNDING, mode, t, second if hit == 1 else first)
    if tried.solutions != 1 and hits[0] and hits[1] and not together:
        # What has no solution for both at once may have one for each in turn.
        hits = hit == 1, hit == 2
        tried = _try(scene, mode, t, y, landing, hits, (e, e), lasts)
    restitution = 0.0, 0.0
    if tried.allowed:
        ends_1, ends_2 = _rebounds_end(scene, tried, t, 1), _rebounds_end(scene, tried, t, 2)
        lasts = max(ends_1, ends_2)
        # The rebounds of a contact are over so soon that it stays closed: the same impact without restitution.
        restitution = 0.0 if ends_1 > 0.0 else e, 0.0 if ends_2 > 0.0 else e
    else:
        # Friction may forbid that a contact rebounds while the other one holds: among the last rebounds it closes.
        lasts = _last_rebounds_end(scene, mode, t, y, landing.motion, hit, _closing(landing, hits))
        if lasts == 0.0:
            return JAM, mode, y
    if lasts > 0.0:
        tried = _try(scene, mode, t, y, landing, hits, restitution, lasts)
        if not tried.allowed and restitution != (0.0, 0.0):
            tried = _try(scene, mode, t, y, landing, hits, (0.0, 0.0), lasts)
    if not tried.allowed:
        # So slow an impact may be an error of the step.
        return BROKEN if tried.solutions != 1 else JAM, mode, y
    lasts = _rocking_ends(scene, mode, t, tried)
    if lasts > 0.0:
        contacts = tried.mode.contacts
        rests = _close(scene, t, tried.state[0], tried.state[1], contacts.turned, with_lasts(contacts.event, lasts))
        if rests[0] == RUNNING and rests[1].contacts.open == NONE:
            return rests
    return tried.status, tried.mode, tried.state


@inlined
def _landing(scene, mode, hit, t, y):
    """The body when the gap of a contact has reached zero, and whether each contact hits."""
    balls = scene.balls
    theta, ring_omega, _ = drives.turn(scene.drive, t)
    motion = motion_of(scene, y, ring_omega)
    # Velocities relative to the race keep their digits in the slowest impacts: the contacts move as one body.
    relative = relative_to_race(motion, ring_omega) if mode.contacts.open == BOTH else motion_of(scene, y, 0.0)
    two = ring.contact_count(scene.closed.body) == 2
    first = contact_of(balls, 1, relative)
    second = contact_of(balls, 2, relative) if two else first
    hits_1, hits_2 = hit == 1, hit == 2
    holds_1 = holds_2 = False
    if mode.contacts.open == BOTH:
        first, second = _with_gap(first, y[6]), _with_gap(second, y[7])
        if two:
            hits_1 = hits_1 or _closes_within(_TOGETHER, mode, t, first)
            hits_2 = hits_2 or _closes_within(_TOGETHER, mode, t, second)
    elif hit == 2:
        first, holds_1 = _held(first, 0.0, 0.0, y[1]), True
    else:
        second, holds_2 = _held(second, 0.0, 0.0, y[1]), True
    mu = _impact_friction(scene, first, theta), _impact_friction(scene, second, theta)
    return _Landing(motion, (first, second), (holds_1, holds_2), mu), (hits_1, hits_2)


@inlined
def _closes_within(share, mode, t, contact):
    """Whether a contact closes within this share of the time since the last event."""
    return contact.opening < 0.0 and contact.gap <= -share * contact.opening * (parts(t)[0] - mode.contacts.event.time)


@inlined
def _closing(landing, hits):
    """Largest closing speed of the contacts that hit, m/s."""
    first, second = landing.contacts
    return max(-first.opening if hits[0] else 0.0, -second.opening if hits[1] else 0.0)


@inlined
def _try(scene, mode, t, y, landing, hits, restitution, lasts):
    """What an impact leads to, in which the contacts `hits` hit.

    `restitution` is that of each contact, if it hits; `lasts` is the time until rebounds end that are summed, s.
    """
    body = scene.closed.body
    first, second = landing.contacts
    touch = landing.held[0] or hits[0], landing.held[1] or hits[1]
    each = restitution[0] if hits[0] else 0.0, restitution[1] if hits[1] else 0.0
    found = impulses(body.mass, inertia(body), first, second, touch, landing.mu, each)
    openings = found.opening_1, found.opening_2
    if found.solutions != 1:
        return _Tried(False, found.solutions, JAM, mode, y, landing.motion, (False, False), openings)
    after = after_impact(body.mass, inertia(body), first, second, landing.motion, found)
    are_open = not touch[0] or found.opening_1 > 0.0, not touch[1] or found.opening_2 > 0.0
    again = (not hits[0] or are_open[0]) and (not hits[1] or are_open[1])
    event = Event(
        REBOUNDS if again else CLOSES,
        (1 if hits[0] else 0) + (2 if hits[1] else 0),
        _closing(landing, hits),
        max(found.normal_1, found.normal_2),
        found.loss,
        found.violation,
        lasts,
        mode.contacts.event.number + 1,
        parts(t)[0],
        0,
    )
    impact = _Impact((first, second), touch, are_open, found)
    status, after_mode, state = _next(scene, t, after, mode, impact, event)
    rebounds = hits[0] and are_open[0], hits[1] and are_open[1]
    # A rebound may leave the contact that holds in a slip that jams: friction forbids it too.
    allowed = status != JAM or not (rebounds[0] or rebounds[1])
    return _Tried(allowed, 1, status, after_mode, state, after, rebounds, openings)


@inlined
def _falls(scene, mode, t, y, motion, contact):
    """Acceleration with which the gap of an open contact closes, m/s^2; 0 for a contact that holds."""
    balls = scene.balls
    if mode.contacts.open == BOTH:
        return -free_gap_acceleration(balls, contact, motion, scene.closed.body.gravity)
    if mode.contacts.open != contact:
        return 0.0
    psi_dd, alpha_dd, _, _ = pivot.solution(scene, mode, t, y)
    # The measure of this gap is arm*sin(delta) plus a constant. At a gap of zero both have the same rate.
    delta = delta_when_closed(scene, holding(mode), mode.contacts.turned)
    arm = 2.0 * side_of(holding(mode)) * balls.half_distance
    rate = arm * cos(delta) * y[3]
    return arm * (sin(delta) * y[3] * y[3] - cos(delta) * (psi_dd - alpha_dd)) - rate * rate / balls.reach


@inlined
def _rebounds_end(scene, tried, t, contact):
    """Time, s, until the rebounds of a contact end, if they are to be summed; else 0."""
    if tried.status != RUNNING or not tried.rebounds[contact - 1]:
        return 0.0
    falls = _falls(scene, tried.mode, t, tried.state, tried.motion, contact)
    return _time_of_rebounds(falls, tried.openings[contact - 1], scene.restitution, SUMMED * scene.balls.reach)


@inlined
def _time_of_rebounds(falls, speed, e, most):
    """Time, s, until rebounds end; 0 if the gap could grow to `most`, m, before.

    `falls` is the acceleration of the gap, m/s^2, `speed` that of the first rebound, m/s, `e` the restitution.
    """
    if not falls > 0.0 or e >= 1.0:
        return 0.0
    time = 2.0 * speed / (falls * (1.0 - e))
    return time if time * time * falls <= most else 0.0


@inlined
def _rocking_ends(scene, mode, t, tried):
    """Time until a body stops rocking that an impact has just tipped from one contact to the other; 0 if it goes on.

    The contact that had held opens with a speed, and hits with the same speed again. The ratio of it to the speed of
    its last hit is that of one rock to the one before. Hops last as long as they are fast.
    """
    last, before = mode.contacts.event, mode.contacts.open
    if before + tried.mode.contacts.open != BOTH or before in (NONE, BOTH) or tried.status != RUNNING:
        return 0.0
    contact = holding(mode)
    if last.kind != CLOSES or last.contact != contact or tried.rebounds[2 - contact]:
        return 0.0
    speed = tried.openings[contact - 1]
    falls = _falls(scene, tried.mode, t, tried.state, tried.motion, contact)
    if not (falls > 0.0 and speed < last.speed):
        return 0.0
    ratio = speed / last.speed
    time = (2.0 * speed / falls + ratio * (parts(t)[0] - last.time)) / (1.0 - ratio)
    return time if time * time * falls <= _ROCKING * scene.balls.reach else 0.0


@inlined
def _last_rebounds_end(scene, mode, t, y, motion, contact, speed):
    """Time, s, until rebounds end that friction forbids, if they are to be summed; else 0.

    `speed` is that of the hit, m/s.
    """
    # Where the rebounds of both contacts shrink together, those of one are summed while the other one is still open,
    # which hits before they would be over.
    event = mode.contacts.event
    still = event.time + event.lasts - parts(t)[0] if event.kind == CLOSES else 0.0
    falls = _falls(scene, mode, t, y, motion, contact)
    return max(still, _time_of_rebounds(falls, speed, 0.0, _FORBIDDEN * scene.balls.reach))


@inlined
def _next(scene, t, motion, mode, impact, event):
    """Status, mode and state after an impact; `motion` is that after it, `mode` that before."""
    body, balls = scene.closed.body, scene.balls
    theta, ring_omega, _ = drives.turn(scene.drive, t)
    (first, second), touched, are_open, found = impact
    two = ring.contact_count(body) == 2
    places = mode.place_1, mode.place_2
    # A contact that has touched has a new place.
    if touched[0]:
        places = locate(scene.closed.surface, first.alpha - theta), places[1]
    if touched[1] and two:
        places = places[0], locate(scene.closed.surface, second.alpha - theta)
    turned = mode.contacts.turned
    if two and touched[0] and touched[1]:
        ahead = second.sine * first.cosine - second.cosine * first.sine
        turned = 1 if ahead < 0.0 else 0
    zeros = (1 if touched[0] and are_open[0] else 0), (1 if touched[1] and are_open[1] else 0)
    gaps = (0.0 if touched[0] else first.gap), (0.0 if touched[1] else second.gap)
    if are_open[0] and (are_open[1] or not two):
        return RUNNING, in_flight(places, turned, zeros, event), state_in_flight(motion, turned, gaps)
    if not two or not (are_open[0] or are_open[1]):
        v = found.slip_1
        if two and (found.slip_2 == 0.0 or abs(found.slip_2) < abs(v)):
            v = found.slip_2
        return _close(scene, t, motion.psi, v, turned, event)
    contact = 2 if are_open[0] else 1
    held, other_touched = (second, touched[0]) if contact == 2 else (first, touched[1])
    v = found.slip_2 if contact == 2 else found.slip_1
    opening = found.opening_1 if contact == 2 else found.opening_2
    side = side_of(contact)
    delta = motion.psi - held.alpha
    delta = delta - 2.0 * pi * round(delta / (2.0 * pi))
    turned = 1 if cos(delta) < 0.0 else 0
    away = delta - delta_when_closed(scene, contact, turned)
    away = away - 2.0 * pi * round(away / (2.0 * pi))
    along = (v + body.radius * ring_omega - balls.radius * motion.psi_dot) / balls.reach
    rate = motion.psi_dot - along
    away = 0.0 if other_touched else angle_at_gap(scene, contact, turned, gaps[2 - contact], away)
    if other_touched:
        rate = opening / (2.0 * balls.half_distance * side * cos(delta))
    which = FIRST if contact == 2 else SECOND
    state = motion.psi, v, away, rate, 0.0, 0.0, 0.0, 0.0, float(which + TURNED * turned)
    f = frame(scene, state, ring_omega)
    # A place counts the revolutions of the angle that the frame has.
    place = locate(scene.closed.surface, f.alpha - theta)
    places = (places[0], place) if contact == 2 else (place, places[1])
    if load(f) > 0.0:
        stick = Mode(0, KINETIC, -1, places[0], places[1], Contacts(which, turned, zeros[0], zeros[1], event))
        status, found_mode = pivot.begun(scene, t, state, stick, 0)
        return status, found_mode, state
    # The contact that has just closed opens again, without an impact.
    zeros = (zeros[0], 2) if contact == 2 else (2, zeros[1])
    return RUNNING, in_flight(places, turned, zeros, event), state_in_flight(motion, turned, gaps)


@inlined
def _close(scene, t, psi, v, turned, event):
    """Status, mode and state after all contacts have closed, at the angle psi (rad) and with the slip v (m/s)."""
    status, mode, v = mode_at(ring_of(scene, turned), t, psi, v)
    mode = with_contacts(mode, Contacts(NONE, turned, 0, 0, event))
    return _after_closed(scene, t, (status, mode, state_when_closed(psi, v, turned)), 2, True)


@modes.status_when_stalled.implements(ImpactRing)
def _status_when_stalled_with_impact(scene, mode, t, y):
    """Implement :func:`modes.status_when_stalled`."""
    if mode.contacts.open == NONE:
        return modes.status_when_stalled(ring_of(scene, mode.contacts.turned), mode, t, (y[0], y[1]))
    if mode.contacts.open == BOTH or mode.sign == 0:
        return BROKEN
    _, ring_omega, _ = drives.turn(scene.drive, t)
    K, _ = pivot.friction(scene, mode, y[1])
    f = frame(scene, y, ring_omega)
    nearly = NEARLY_JAMMED * inertia(scene.closed.body)
    return BROKEN if determinant(f, K) > nearly else _jammed(scene, mode, y[1])


@modes.sticks.implements(ImpactRing)
def _sticks_with_impact(scene, mode):
    """Implement :func:`modes.sticks`: never in a pivot, whose body turns."""
    return mode.contacts.open == NONE and (mode.sign == 0 or mode.region < 0)


@modes.first_loss.implements(ImpactRing)
def _is_first_loss(scene, before, after):
    """Implement :func:`modes.first_loss`."""
    return before.contacts.event.number == 0 and after.contacts.event.number > 0


@modes.in_space.implements(ImpactRing)
def _in_space_with_impact(scene, t, y):
    """Implement :func:`modes.in_space`: psi and its rate."""
    motion = motion_of(scene, y, drives.turn(scene.drive, t)[1])
    return motion.psi, motion.psi_dot
