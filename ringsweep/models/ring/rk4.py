"""The ring for steps of constant length. The state is ``(phi, omega)``, and the deflections of bristles.

Solver ``rk4`` calls what this file implements, through :mod:`ringsweep.models.interface.constant_step`. All numbers
may be vector lanes. :mod:`ringsweep.models.inspection` makes the inspections, for the belt too.
"""

from __future__ import annotations

from ringsweep.models.inspection import inspection, rates_in_space, slip_in_space, word_of_mode
from ringsweep.models.interface import constant_step
from ringsweep.models.ring.contacts import places_at, zones_of
from ringsweep.models.slip import Slip
from ringsweep.numerics.functions import opposing, sine_cosine, sine_cosine_carried
from ringsweep.physics import zones
from ringsweep.physics.friction.velocity import friction_at
from ringsweep.physics.friction.ways import towards
from ringsweep.physics.ring import BristleRing, Ring, coefficients_at


@constant_step.initial_state.implements(Ring)
def _initial_state_on_ring(scene):
    """Implement :func:`constant_step.initial_state`: ``(phi, omega)``, rad and rad/s."""
    return scene.initial_phi, scene.initial_omega


@slip_in_space.implements(Ring)
def _slip_in_space_on_ring(scene, y, v, forcing, angle):
    """Implement :func:`slip_in_space`; nothing is added to the slip."""
    under = towards(scene.law, coefficients_at(scene, y[0] - forcing[0]), v)
    mu_1, mu_2, slope_1, slope_2 = friction_at(scene.law, abs(v), under)
    friction, slopes = (opposing(mu_1, v), opposing(mu_2, v)), (-slope_1, -slope_2)
    return Slip((*angle, y[1]), y[1] - forcing[1], friction, slopes, 0.0, ()), ()


@constant_step.rates.implements(Ring, BristleRing)
def _rates_in_constant_step_on_ring(scene, now, y, forcing):
    """Implement :func:`constant_step.rates`; sine and cosine start from those at the beginning of the step."""
    return rates_in_space(scene, y, forcing, sine_cosine_carried(y[0], now.place, now.motion[0], now.motion[1], False))


@constant_step.inspect.implements(Ring, BristleRing)
def _inspect_on_ring(scene, y, forcing):
    """Implement :func:`constant_step.inspect`; sine and cosine of phi are computed anew."""
    return inspection(scene, y, y[0], forcing, sine_cosine(y[0]))


@constant_step.inspect_next.implements(Ring, BristleRing)
def _inspect_next_on_ring(scene, before, y, forcing, afresh):
    """Implement :func:`constant_step.inspect_next`; sine and cosine start from those of `before`."""
    carried = sine_cosine_carried(y[0], before.place, before.motion[0], before.motion[1], afresh)
    return inspection(scene, y, y[0], forcing, carried)


@constant_step.arc_share.implements(Ring, BristleRing)
def _arc_share_on_ring(scene, now, h):
    """Implement :func:`constant_step.arc_share`."""
    return abs(now.v) * (h / (scene.body.radius * zones.narrowest(scene.surface)))


@constant_step.seen.implements(Ring, BristleRing)
def _seen_in_constant_step_on_ring(scene, y, now, epsilon):
    """Implement :func:`constant_step.seen`: what ``_observe_on_ring`` in :mod:`record` takes."""
    return y[0], y[1], now.normal_1, now.normal_2, ()


@constant_step.row.implements(Ring, BristleRing)
def _row_of_constant_step_on_ring(scene, y, forcing):
    """Implement :func:`constant_step.row`: the same columns as :func:`modes.row` on the ring."""
    now = constant_step.at_once(scene, y, forcing, constant_step.inspect(scene, y, forcing))
    normals, places = (now.normal_1, now.normal_2), zones_of(scene, *places_at(scene, y[0] - forcing[0]))
    row = y[0], y[1], now.rates[1], *normals, forcing[1], *places, word_of_mode(scene, now)
    return *row, *y[2:]
