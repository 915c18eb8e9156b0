"""The variational equation on the belt: Jacobians of the modes, and gradients of the guards at events.

The record carries a :class:`ringsweep.models.tangent.Tangent`, which these functions replace; they run only if the
scene asks for an exponent.
"""

from __future__ import annotations

from ringsweep.compile import feature, hook
from ringsweep.models import section, tangent
from ringsweep.models.belt.force import coefficients, in_segment, stuck_gradient, stuck_rates
from ringsweep.models.belt.mode import FAST, SLOW, yields
from ringsweep.models.belt.record import with_tangent
from ringsweep.models.interface import variation
from ringsweep.physics import drives, zones
from ringsweep.physics.belt import Belt, BristleBelt
from ringsweep.physics.friction.presliding import region_guard, scales
from ringsweep.physics.friction.velocity import stiction_band
from ringsweep.physics.friction.ways import along

# Differences for the gradient of a guard of bristles, as a share of their speed and deflection.
_SMALL = 1e-4


@variation.due.implements(Belt, BristleBelt)
def _due_on_belt(scene, record):
    """Implement :func:`variation.due`: the end of the cycle, or the next point of the section."""
    return min(_end_of_cycle(scene.asked, record), section.next_point(scene.section, record))


@feature("inf")
def _end_of_cycle(asked, record):
    """Time at which the cycle ends, s; infinite if no exponent is asked for."""
    return record.cycles.next


@variation.enter_mode.implements(Belt)
def _enter_tangent_on_belt(scene, record, mode, rates):
    """Implement :func:`variation.enter_mode`; stick keeps no disturbance of the sliding velocity."""
    # A body stays in a dead band at any velocity in it; only one that comes from outside has that of the edge.
    arrives = stiction_band(scene.law) == 0.0 or record.tangent.gradient[1] != 0.0
    return with_tangent(record, tangent.enter(record.tangent, 0.0 if mode.sign == 0 and arrives else 1.0, rates))


@variation.enter_mode.implements(BristleBelt)
def _enter_tangent_on_bristle_belt(scene, record, mode, rates):
    """Implement :func:`variation.enter_mode`; bristles keep all disturbances."""
    return with_tangent(record, tangent.enter(record.tangent, 1.0, rates))


@variation.propagate.implements(Belt, BristleBelt)
def _advance_tangent_on_belt(scene, record, h, rates, weights, work):
    """Implement :func:`variation.propagate`."""
    return with_tangent(record, tangent.advance(record.tangent, h, rates, weights, work))


@variation.apply_saltation.implements(Belt, BristleBelt)
def _switch_tangent_on_belt(scene, record, mode, guard, t, y):
    """Implement :func:`variation.apply_saltation`."""
    rates = record.tangent.rates
    return with_tangent(record, tangent.switched(record.tangent, _gradient(scene, mode, guard, t, y, rates)))


@hook
def _gradient(scene, mode, guard, t, y, rates):
    """Gradient of a guard by the state, divided by its rate, in the mode that ends; `rates` of the state."""


@_gradient.implements(Belt)
def _gradient_on_belt(scene, mode, guard, t, y, rates):
    """Implement :func:`_gradient`, by the formulas of breakaway, of the bounds of a region and of edges."""
    if guard > FAST:
        return _gradient_of_edge(scene.surface, y[1], drives.turn(scene.drive, t)[1]), 0.0
    scene = in_segment(scene.surface, scene, mode.place)
    if mode.sign != 0 and not (yields(scene, mode) and guard == SLOW):
        return 0.0, 1.0 / rates[1] if rates[1] != 0.0 else 0.0
    x = y[0]
    # The guard is the breakaway force less the pull in one direction.
    way = (1.0 if guard == SLOW else -1.0) if mode.sign == 0 else float(mode.sign)
    forcing = drives.turn(scene.drive, t)
    pull, load = stuck_gradient(scene, x)
    pull_rate, load_rate = stuck_rates(scene, t, x, forcing)
    mu_s = along(scene.mu_s, way)
    by_x = mu_s * load - way * pull
    rate = mu_s * load_rate - way * pull_rate
    return by_x / rate if rate != 0.0 else 0.0, 0.0


@feature("0.0")
def _gradient_of_edge(surface, v, belt_velocity):
    """Derivative of the distance to an edge by the displacement, divided by its rate, s/m; `v` is that of sliding."""
    rate = zones.place_in(surface.frame, v + belt_velocity, belt_velocity)
    return 1.0 / rate if rate != 0.0 else 0.0


@_gradient.implements(BristleBelt)
def _gradient_on_bristle_belt(scene, mode, guard, t, y, rates):
    """Implement :func:`_gradient`, by differences for the guard of the bristles."""
    if guard > FAST:
        return _gradient_of_edge(scene.surface, y[1], drives.turn(scene.drive, t)[1]), 0.0, 0.0
    (_, v, z), scene = y, in_segment(scene.surface, scene, mode.place)
    by_v, by_z = 1.0, 0.0
    if guard == FAST:
        law, sign, region = scene.law, float(mode.sign), mode.region
        mu_s, mu_k = coefficients(scene, sign)
        _, state, speed, _ = scales(law, mu_s, scene.body.gravity, z)
        dv, dz = _SMALL * speed, _SMALL * state
        above = region_guard(law, mu_s, mu_k, v + dv, z, sign, region)
        by_v = (above - region_guard(law, mu_s, mu_k, v - dv, z, sign, region)) / (2.0 * dv)
        above = region_guard(law, mu_s, mu_k, v, z + dz, sign, region)
        by_z = (above - region_guard(law, mu_s, mu_k, v, z - dz, sign, region)) / (2.0 * dz)
    rate = by_v * rates[1] + by_z * rates[2]
    return (0.0, by_v / rate, by_z / rate) if rate != 0.0 else (0.0, 0.0, 0.0)
