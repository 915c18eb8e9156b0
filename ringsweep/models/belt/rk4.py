"""The belt for steps of constant length. The state is ``(x, velocity)``, in space, and the deflection of bristles.

Solver ``rk4`` calls what this file implements, through :mod:`ringsweep.models.interface.constant_step`. All numbers
may be vector lanes. :mod:`ringsweep.models.inspection` makes the inspections, for the ring too.
"""

from __future__ import annotations

from math import nan

from ringsweep.compile import feature
from ringsweep.models.belt.creep import deflection, zone_of
from ringsweep.models.belt.force import at_place, moving, slip_from
from ringsweep.models.belt.switch import place_at
from ringsweep.models.inspection import inspection, rates_in_space, slip_in_space, word_of_mode
from ringsweep.models.interface import constant_step
from ringsweep.physics import drives, zones
from ringsweep.physics.belt import Belt, BristleBelt


@constant_step.initial_state.implements(Belt)
def _initial_state_on_belt(scene):
    """Implement :func:`constant_step.initial_state`: ``(x, velocity)``, m and m/s in space."""
    return scene.initial_x, scene.initial_v + drives.turn(scene.drive, 0.0)[1]


@slip_in_space.implements(Belt)
def _slip_in_space_on_belt(scene, y, v, forcing, angle):
    """Implement :func:`slip_in_space`; nothing is added to the slip."""
    scene = at_place(scene.surface, scene, y[0], forcing[0])
    return slip_from(scene, y[0], moving(scene, y[1], v, forcing[1]), v, forcing), ()


@constant_step.rates.implements(Belt, BristleBelt)
def _rates_in_constant_step_on_belt(scene, now, y, forcing):
    """Implement :func:`constant_step.rates`."""
    return rates_in_space(scene, y, forcing, ())


@constant_step.inspect.implements(Belt, BristleBelt)
def _inspect_on_belt(scene, y, forcing):
    """Implement :func:`constant_step.inspect`; the place is relative to the belt."""
    return inspection(scene, y, y[0] - forcing[0], forcing, ())


@constant_step.seen.implements(Belt, BristleBelt)
def _seen_in_constant_step_on_belt(scene, y, now, epsilon):
    """Implement :func:`constant_step.seen`: what ``_observe_on_belt`` in :mod:`record` takes."""
    # The rate of the sliding velocity counts at launch alone.
    v, v_rate = moving(scene, now.v, now.v, 0.0), now.rates[1] - epsilon
    return y[0], now.motion[2], now.friction, now.place, v, v_rate, (), nan


@constant_step.row.implements(Belt, BristleBelt)
def _row_of_constant_step_on_belt(scene, y, forcing):
    """Implement :func:`constant_step.row`: the same columns as :func:`modes.row` on the belt."""
    now = constant_step.inspect(scene, y, forcing)
    zone = zone_of(scene.surface, place_at(scene.surface, y[0], forcing[0]))
    return y[0], now.motion[2], now.friction, deflection(y, scene.law, 0.0), word_of_mode(scene, now), *zone


@constant_step.arc_share.implements(Belt, BristleBelt)
def _arc_share_on_belt(scene, now, h):
    """Implement :func:`constant_step.arc_share`."""
    return _share_of_narrowest(scene.surface, now, h)


@feature("0.0", absorb=True)
def _share_of_narrowest(surface, now, h):
    """Way among the zones in a step, as a share of the narrowest segment."""
    return abs(zones.place_in(surface.frame, now.motion[2], now.motion[2] - now.v)) * (h / surface.narrowest)
