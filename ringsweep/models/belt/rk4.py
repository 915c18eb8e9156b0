"""The belt for steps of constant length. The state is ``(x, velocity)``, in space, and the deflection of bristles."""

from __future__ import annotations

from math import nan

from ringsweep.models.belt.creep import deflection
from ringsweep.models.belt.force import moving, sliding
from ringsweep.models.inspection import inspection, rates, slip_in_space, word_of_mode
from ringsweep.models.interface import constant_step
from ringsweep.physics import drives
from ringsweep.physics.belt import Belt, BristleBelt


@constant_step.initial_state.implements(Belt)
def _initial_state(scene):
    return scene.initial_x, scene.initial_v + drives.turn(scene.drive, 0.0)[1]


@slip_in_space.implements(Belt)
def _slip_in_space(scene, y, v, forcing, angle):
    return sliding(scene, y[0], moving(scene, y[1], v, forcing[1]), v, forcing), ()


@constant_step.rates.implements(Belt, BristleBelt)
def _rates(scene, now, y, forcing):
    return rates(scene, y, forcing, ())


@constant_step.inspect.implements(Belt, BristleBelt)
def _inspect(scene, y, forcing):
    return inspection(scene, y, y[0] - forcing[0], forcing, ())


@constant_step.seen.implements(Belt, BristleBelt)
def _seen(scene, y, now):
    # The record takes the rate of the sliding velocity from the differences of short steps.
    return y[0], now.motion[2], now.friction, now.place, moving(scene, now.v, now.v, 0.0), 0.0, (), nan


@constant_step.row.implements(Belt, BristleBelt)
def _row(scene, y, forcing):
    now = constant_step.inspect(scene, y, forcing)
    return y[0], now.motion[2], now.friction, deflection(y, 0.0), word_of_mode(scene, now)
