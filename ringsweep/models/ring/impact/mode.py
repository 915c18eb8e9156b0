"""Modes and states of a body that may leave the race.

A state has nine numbers. The last one is a code of the contacts that are open and of the order of the contacts; it
tells what the others are:

- both contacts hold: ``(psi, v, 0, 0, 0, 0, 0, 0)``, with the sliding velocity v, m/s;
- pivot on one contact: ``(psi, v, eta, eta_dot, 0, 0, 0, 0)``. The angle from the ball that touches to the body is
  ``delta = psi - alpha``; eta is its difference from the value at which the other contact closes. So a gap of any size
  has all its digits, and the angular velocity ``d psi/dt = (v + rho eta_dot)/R + d theta/dt`` is that of both contacts
  while eta_dot is zero;
- flight: ``(psi, d psi/dt, x, dx/dt, y, dy/dt, gap_1, gap_2)``, with the place of the centre of mass. It tells the
  measures of both gaps, see :data:`ringsweep.models.ring.series.GAP_1`, too, but not with all digits of small ones.

A *pivot* is a body on one contact, a *flight* has none. `turned` is 1 once the contacts have changed their order
along the race, `contact` is 1 or 2, `places` are segment and turn of each contact.
"""

from __future__ import annotations

from math import cos, sin
from typing import NamedTuple

from ringsweep.compile import inlined, replacing
from ringsweep.models.ring.series import Mode, with_contacts
from ringsweep.numerics.clock import parts
from ringsweep.physics import ring
from ringsweep.physics.impact import inertia, side_of
from ringsweep.physics.pivot import Frame
from ringsweep.physics.zones import coefficients, edge_ahead

#: Contacts that are open: none, contact 1, contact 2, both. A particle has contact 1 only.
NONE, FIRST, SECOND, BOTH = range(4)
#: Added to the code of a state if the contacts have changed their order.
TURNED = 4

#: Kinds of events: a contact opens; it rebounds in an impact; it closes in an impact, or in the limit of its rebounds.
NO_EVENT, OPENS, REBOUNDS, CLOSES = range(4)


class Event(NamedTuple):
    """An event that opens or closes contacts.

    Attributes
    ----------
    kind, contact : int
        What happens, and to which contacts: 1, 2, or 3 for both.
    speed, impulse, loss, violation : float
        In an impact: largest closing speed, m/s; largest normal impulse, N s; lost energy, J; violation of the law.
    lasts : float
        Time from the event until a contact that closes by rebounds has come to rest, s.
    number : int
        Number of events up to now.
    time : float
        Time of the event, s.
    passed : int
        1 if an impact closed all contacts, of which some opened at once; else 0.
    """

    kind: int
    contact: int
    speed: float
    impulse: float
    loss: float
    violation: float
    lasts: float
    number: int
    time: float
    passed: int


class Contacts(NamedTuple):
    """Contacts of a body that may leave the race.

    Attributes
    ----------
    open : int
        NONE, FIRST, SECOND or BOTH. In a pivot the slip of the mode is that of the contact that holds.
    turned : int
        1 if the contacts have changed their order along the race, else 0.
    zeros_1, zeros_2 : int
        Number of leading coefficients of the gap that were zero when the mode began: 3 after a smooth loss of the
        contact, 2 after friction has jumped, 1 after an impact, 0 if the contact had been open before.
    event : Event
        The last event.
    """

    open: int
    turned: int
    zeros_1: int
    zeros_2: int
    event: Event


#: Event after which a contact comes to rest at another time.
with_lasts = replacing("lasts")
#: Event with another value of `passed`.
with_passed = replacing("passed")


@inlined
def opens(contact, number, t):
    """Event: contacts open (`contact`: 1, 2 or 3) after `number` events before."""
    return Event(OPENS, contact, 0.0, 0.0, 0.0, 0.0, 0.0, number + 1, parts(t)[0], 0)


@inlined
def in_flight(places, turned, zeros, event):
    """Mode of a body without contacts."""
    return Mode(1, 0, -1, places[0], places[1], Contacts(BOTH, turned, zeros[0], zeros[1], event))


_with_zeros, _with_first, _with_second = replacing("zeros_1", "zeros_2"), replacing("place_1"), replacing("place_2")


@inlined
def with_zeros(mode, zeros):
    """Mode in which the gaps have these leading zeros, see :class:`Contacts`."""
    return with_contacts(mode, _with_zeros(mode.contacts, *zeros))


@inlined
def ring_of(scene, turned):
    """Scene of the closed ring, with the contacts in their first order, or `turned`."""
    return scene.turned if turned == 1 else scene.closed


@inlined
def state_when_closed(psi, v, turned):
    """State of nine numbers of a body whose contacts hold: ``(psi, v, 0, 0, 0, 0, 0, 0, code)``."""
    return psi, v, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, float(TURNED * turned)


@inlined
def delta_when_closed(scene, contact, turned):
    """Angle from the ball of a contact to the body, at which the other contact closes, rad."""
    return side_of(contact) * ring.contact_offset(ring_of(scene, turned).body)


@inlined
def holding(mode):
    """The contact that holds in a pivot: 1 or 2."""
    return 2 if mode.contacts.open == FIRST else 1


@inlined
def place_of(mode):
    """Segment and turn of the contact that holds in a pivot."""
    return mode.place_2 if mode.contacts.open == FIRST else mode.place_1


@inlined
def with_place(mode, place):
    """Mode of a pivot whose contact that holds is at another place."""
    return _with_second(mode, place) if mode.contacts.open == FIRST else _with_first(mode, place)


@inlined
def coefficients_there(scene, place):
    """Static and kinetic friction coefficient in a segment, and number of the zone."""
    return coefficients(scene.closed.surface, place[0])


@inlined
def frame(scene, y, ring_omega):
    """The :class:`ringsweep.physics.pivot.Frame` of a pivot in the state `y`."""
    body, balls, code = scene.closed.body, scene.balls, int(y[-1] + 0.5)
    contact = 2 if code % TURNED == FIRST else 1
    delta = delta_when_closed(scene, contact, code // TURNED) + y[2]
    alpha, psi_dot = y[0] - delta, (y[1] + balls.reach * y[3]) / body.radius + ring_omega
    a, h, s, c, alpha_dot = side_of(contact) * balls.half_distance, balls.offset, sin(delta), cos(delta), psi_dot - y[3]
    of_body = body.mass, inertia(body), body.gravity, balls.radius, balls.reach
    of_place = alpha, sin(alpha), cos(alpha), h * c - a * s, a * c + h * s
    return Frame(*of_body, *of_place, psi_dot, alpha_dot, psi_dot * psi_dot, alpha_dot * alpha_dot)


@inlined
def gap_measure(scene, mode, eta):
    """Measure ``(rho^2 - |c|^2)/(2 rho)`` of the gap in a pivot, m: the smallest gap has all its digits."""
    contact, side = holding(mode), side_of(holding(mode))
    beta, turn = side * delta_when_closed(scene, contact, mode.contacts.turned), 0.5 * side * eta
    return 4.0 * scene.balls.half_distance * cos(beta + turn) * sin(turn)


@inlined
def angle_at_gap(scene, contact, turned, gap, near):
    """Angle eta of a pivot on `contact` at which the other gap has the measure `gap`, m.

    `near` is this angle, but has lost digits. Where the gap hardly changes with the angle, it is as good as the gap.
    """
    side, full = side_of(contact), 4.0 * scene.balls.half_distance
    beta, turn = side * delta_when_closed(scene, contact, turned), 0.5 * side * near
    slope = full * cos(beta + 2.0 * turn)
    if abs(slope) > gap:
        turn -= (full * cos(beta + turn) * sin(turn) - gap) / slope
    return 2.0 * side * turn


@inlined
def distances_to_edges(scene, mode, rho):
    """Distances of the contact that holds in a pivot, at the angle `rho` in the ring's frame, from both edges, rad."""
    surface, place = scene.closed.surface, place_of(mode)
    return edge_ahead(surface, place, 1) - rho, rho - edge_ahead(surface, place, -1)
