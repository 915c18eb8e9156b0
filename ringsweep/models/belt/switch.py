"""Launch on the belt, and which mode follows an event.

The state is ``(x, v)`` with the displacement in space and the sliding velocity, and the deflection of bristles. The
difference of two large velocities would lose all its digits.
"""

from __future__ import annotations

from ringsweep.compile import feature, inlined
from ringsweep.models.belt.force import (
    breakaway_force,
    coefficients,
    direction,
    in_segment,
    load_is_left,
    moving,
    rounding_of_reserve,
    stuck_pull,
    stuck_rates,
)
from ringsweep.models.belt.mode import EDGE_ABOVE, FAST, NORMAL, SLOW, Mode, after_guard, mode_at, yields
from ringsweep.models.belt.stops import no_impact, settled, switched
from ringsweep.models.interface import modes
from ringsweep.models.interface.status import RUNNING, SEPARATED_1
from ringsweep.numerics.clock import Instant
from ringsweep.numerics.terms import joined
from ringsweep.physics import belt, drives, ring, zones
from ringsweep.physics.forces import force_in
from ringsweep.physics.friction.presliding import initial_deflection
from ringsweep.physics.friction.registry import holds_in_band
from ringsweep.physics.friction.velocity import KINETIC, region_at, region_bounds, stiction_band
from ringsweep.physics.friction.ways import along


@modes.in_space.implements(belt.Belt)
def _in_space_on_belt(scene, t, y):
    """Implement :func:`modes.in_space`."""
    forcing = drives.turn(scene.drive, t)
    return y[0], moving(scene, y[1] + forcing[1], y[1], forcing[1])


@feature("()")
def deflection_at_start(initial_z, scene):
    """Deflection of the bristles at t = 0, m. It also resets the memory that the law may have."""
    return (initial_deflection(scene.law, *coefficients(scene, 0.0)) + initial_z,)


@feature("()")
def place_at(surface, x, shift):
    """Segment and turn of the surface under a body at `x`, on a belt that has moved by `shift`, m."""
    return zones.locate(surface, zones.place_in(surface.frame, x, shift))


@modes.begin.implements(belt.Belt, belt.BristleBelt)
def _begin_on_belt(scene):
    """Implement :func:`modes.begin`; the state is ``(x, v)``, or ``(x, v, z)`` with bristles."""
    t, v = drives.beginning(scene.drive), drives.velocity_at_beginning(scene.drive, scene.initial_v)
    now, x = Instant(t, 0.0), scene.initial_x
    place = place_at(scene.surface, x, drives.turn(scene.drive, now)[0])
    y = joined((x, v), deflection_at_start(scene.initial_z, in_segment(scene.surface, scene, place)))
    status, mode = mode_at(scene, place, now, y)
    status, mode, y = settled(scene.stops, scene, no_impact(scene.stops), now, y, status, mode)
    return t, y, status, mode


@modes.switch.implements(belt.Belt, belt.BristleBelt)
def _switch_on_belt(scene, mode, guard, t, y):
    """Implement :func:`modes.switch`; `guard` is NORMAL, SLOW or FAST, an edge or a stop."""
    return switched(scene.stops, scene, mode, guard, t, y)


@modes.after_jump.implements(belt.Belt)
def _after_jump_on_belt(scene, mode, t, y, jump):
    """Implement :func:`modes.after_jump`."""
    stop, y = mode.stop, (y[0], y[1] - jump)
    status, mode = mode_at(scene, mode.place, t, y)
    return settled(scene.stops, scene, stop, t, y, status, mode)


@mode_at.implements(belt.Belt)
def _mode_at_on_belt(scene, place, t, y):
    """Implement :func:`mode_at`."""
    (x, v), scene = y, in_segment(scene.surface, scene, place)
    status, mode = RUNNING, Mode(1 if v > 0.0 else -1, region_at(scene.law, abs(v)), -1, place, ())
    if ring.if_load_varies(scene.body, True, False) and not load_is_left(scene, t, x):
        status, mode = SEPARATED_1, Mode(0, KINETIC, -1, place, ())
    elif holds_in_band(scene.law) and abs(v) <= stiction_band(scene.law):
        mode = mode_at_rest(scene, place, t, x)
    elif v == 0.0:
        pull = stuck_pull(scene, x, v, drives.turn(scene.drive, t))
        mode = Mode(1 if pull >= 0.0 else -1, region_at(scene.law, 0.0), SLOW, place, ())
    return status, mode


@inlined
def mode_at_rest(scene, place, t, x):
    """Mode of a set-valued law at a sliding velocity of zero or within the dead band; `place` as in a mode."""
    forcing = drives.turn(scene.drive, t)
    scene, pull = belt.laden(scene.drive, scene, forcing), stuck_pull(scene, x, 0.0, forcing)
    bound = breakaway_force(scene, direction(scene.mu_s, pull, scene, t, x, forcing), x)
    least = rounding_of_reserve(scene, (x, force_in(scene.drive, forcing), forcing[1]), forcing[2])
    if bound == 0.0 and pull == 0.0:
        # Rates decide: a load that only begins to grow holds a pull that grows more slowly.
        (pull, load), least = stuck_rates(scene, t, x, forcing), 0.0
        bound = along(scene.mu_s, pull) * load
    if bound > 0.0 and abs(pull) <= bound + least:
        return Mode(0, KINETIC, -1, place, ())
    return _loose(scene, place, 1 if pull >= 0.0 else -1)


@inlined
def _loose(scene, place, sign):
    """Mode of a body that has just broken loose."""
    # Without a dead band the sliding velocity, which is zero here, is a guard.
    return Mode(sign, region_at(scene.law, 0.0), SLOW if stiction_band(scene.law) == 0.0 else -1, place, ())


@inlined
def after_load(scene, mode, t, y):
    """Status, mode and state after the normal reaction has reached zero, by the series or the step at least."""
    # As for the breakaway force, one more, short step decides.
    if mode.entry_guard != NORMAL and load_is_left(scene, t, y[0]):
        return RUNNING, Mode(mode.sign, mode.region, NORMAL, mode.place, ()), y
    return SEPARATED_1, mode, y


@after_guard.implements(belt.Belt)
def _after_guard_on_belt(scene, mode, guard, t, y):
    """Implement :func:`after_guard`; `guard` is NORMAL, SLOW or FAST, or an edge."""
    x, _ = y
    if guard == NORMAL:
        return after_load(scene, mode, t, y)
    sign, region, place = mode.sign, mode.region, mode.place
    if guard > FAST:
        place = beyond(scene.surface, place, guard)
        scene = in_segment(scene.surface, scene, place)
        if holds_in_band(scene.law) and y[1] == 0.0:
            return RUNNING, mode_at_rest(scene, place, t, x), y
        return RUNNING, Mode(sign, region, SLOW if y[1] == 0.0 else -1, place, ()), y
    scene = in_segment(scene.surface, scene, place)
    if sign == 0:
        # A long series may reach the breakaway force by its own error alone: one more, short step decides.
        forcing = drives.turn(scene.drive, t)
        pull, laden = stuck_pull(scene, x, 0.0, forcing), belt.laden(scene.drive, scene, forcing)
        if mode.entry_guard != guard and abs(pull) <= breakaway_force(laden, pull, x):
            return RUNNING, Mode(0, KINETIC, guard, place, ()), y
        return RUNNING, _loose(scene, place, 1 if guard == SLOW else -1), y
    low, high = region_bounds(scene.law, region)
    if guard == FAST:
        return RUNNING, Mode(sign, region + 1, SLOW, place, ()), (x, sign * high)
    if low > 0.0:
        if holds_in_band(scene.law) and region - 1 < 0:
            return RUNNING, mode_at_rest(scene, place, t, x), (x, sign * low)
        return RUNNING, Mode(sign, region - 1, FAST, place, ()), (x, sign * low)
    if yields(scene, mode):
        # The pull has fallen to the breakaway force.
        return RUNNING, Mode(0, KINETIC, -1, place, ()), y
    if region < 0:
        return RUNNING, Mode(-sign, region, SLOW, place, ()), (x, 0.0)
    return RUNNING, mode_at_rest(scene, place, t, x), (x, 0.0)


@feature("place")
def beyond(surface, place, guard):
    """Place of a body that has crossed the edge of its segment to which a guard belongs."""
    return zones.cross_edge(surface, place, 1 if guard == EDGE_ABOVE else -1)
