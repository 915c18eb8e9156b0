"""The surface under the contacts of a body in the ring: coefficients, friction, zones and edges.

`rho` is the angle of the body in the ring's frame, rad. A *place* is a pair of whole numbers: segment of the surface,
and turn of the ring. Which place a contact on an edge has depends on where it moves: the mode keeps it.
"""

from __future__ import annotations

from ringsweep.compile import inlined
from ringsweep.physics import ring
from ringsweep.physics.friction.velocity import friction_in
from ringsweep.physics.friction.ways import towards
from ringsweep.physics.zones import coefficients, cross_edge, edge_ahead, leave_edge, locate


@inlined
def places_at(scene, rho):
    """Segment and turn of each contact, at the angle `rho` of the body in the ring's frame, rad."""
    offset = ring.contact_offset(scene.body)
    return locate(scene.surface, rho - offset), locate(scene.surface, rho + offset)


@inlined
def places_beyond(scene, place_1, place_2, rho, sign):
    """Segment and turn of each contact; a contact on an edge is put on the side to which `sign` (1 or -1) moves it."""
    offset = ring.contact_offset(scene.body)
    first = leave_edge(scene.surface, place_1, rho - offset, sign)
    return first, leave_edge(scene.surface, place_2, rho + offset, sign)


@inlined
def edges_ahead(scene, mode, rho):
    """Angle from each contact to the edge towards which it slides, rad."""
    offset = ring.contact_offset(scene.body)
    ahead_1 = mode.sign * (edge_ahead(scene.surface, mode.place_1, mode.sign) - (rho - offset))
    ahead_2 = mode.sign * (edge_ahead(scene.surface, mode.place_2, mode.sign) - (rho + offset))
    return ahead_1, ahead_2


@inlined
def places_after_edge(scene, mode, rho):
    """Segment and turn of each contact after the nearer edge was crossed."""
    ahead_1, ahead_2 = edges_ahead(scene, mode, rho)
    if ahead_1 <= ahead_2:
        return cross_edge(scene.surface, mode.place_1, mode.sign), mode.place_2
    return mode.place_1, cross_edge(scene.surface, mode.place_2, mode.sign)


@inlined
def coefficients_under(scene, mode):
    """``(mu_s1, mu_k1, mu_s2, mu_k2)`` in the segments that a mode names, in both directions if these differ."""
    mu_s1, mu_k1, _ = coefficients(scene.surface, mode.place_1[0])
    mu_s2, mu_k2, _ = coefficients(scene.surface, mode.place_2[0])
    return mu_s1, mu_k1, mu_s2, mu_k2


@inlined
def coefficients_in_slip(scene, mode):
    """What the law takes of the segments that a mode names; see :func:`ringsweep.physics.friction.ways.towards`."""
    return towards(scene.law, coefficients_under(scene, mode), float(mode.sign))


@inlined
def zones_of(scene, place_1, place_2):
    """Number of the zone under each contact (0: none), in these segments."""
    return coefficients(scene.surface, place_1[0])[2], coefficients(scene.surface, place_2[0])[2]


@inlined
def friction_under(scene, mode, speed):
    """Friction ``(K1, K2)`` per unit of each reaction in slip, at the sliding speed `speed`, m/s."""
    mu_1, mu_2, _, _ = friction_in(scene.law, mode.region, speed, coefficients_in_slip(scene, mode))
    return -mode.sign * mu_1, -mode.sign * mu_2
