"""The variational equation on the belt: Jacobians of the modes, and gradients of the guards at events.

The record carries a :class:`ringsweep.models.tangent.Tangent`, which these functions replace; they run only if the
scene asks for an exponent.
"""

from __future__ import annotations

from ringsweep.compile import feature, hook
from ringsweep.models import section, tangent
from ringsweep.models.belt.force import coefficients, in_segment, moving, stuck_gradient, stuck_rates
from ringsweep.models.belt.mode import FAST, SLOW, low_stop, yields
from ringsweep.models.belt.record import with_tangent
from ringsweep.models.interface import variation
from ringsweep.models.slip import acceleration_slopes, by_deflections, slip_at, zeros
from ringsweep.numerics.terms import joined
from ringsweep.physics import drives, zones
from ringsweep.physics.belt import Belt, BristleBelt, laden_at
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
    keeps = _kept(mode.stop, (1.0, 0.0 if mode.sign == 0 and arrives else 1.0))
    return with_tangent(record, tangent.enter(record.tangent, keeps, rates))


@variation.enter_mode.implements(BristleBelt)
def _enter_tangent_on_bristle_belt(scene, record, mode, rates):
    """Implement :func:`variation.enter_mode`; bristles keep all disturbances, except of a body at rest at a stop."""
    return with_tangent(record, tangent.enter(record.tangent, _kept(mode.stop, (1.0, 1.0)), rates))


@feature("keeps")
def _kept(stop, keeps):
    """Factors on disturbances of place and sliding velocity as a mode begins: a body at rest at a stop has none."""
    return keeps if stop.rests == 0 else (0.0, 0.0)


@variation.jacobian.implements(BristleBelt)
def _jacobian_with_bristles(scene, mode, t, y):
    """Implement :func:`variation.jacobian`."""
    now, scene = slip_at(scene, mode, t, y), laden_at(scene.drive, scene, t)
    by_place, by_v, _ = acceleration_slopes(scene, now)
    (by_z,), (bundle,) = by_deflections(now.bristles, scene, now), now.bristles
    first = _of_held(mode.stop, (0.0, 1.0, 0.0, by_place, by_v, by_z))
    return *first, 0.0, bundle.rate_v, bundle.rate_z


@feature("rows")
def _of_held(stop, rows):
    """Rows of a Jacobian for place and sliding velocity, which a body at rest at a stop does not change."""
    return rows if stop.rests == 0 else (0.0, 0.0, 0.0, 0.0, 0.0, 0.0)


@variation.propagate.implements(Belt, BristleBelt)
def _advance_tangent_on_belt(scene, record, h, rates, weights, work):
    """Implement :func:`variation.propagate`."""
    return with_tangent(record, tangent.advance(record.tangent, h, rates, weights, work))


@variation.apply_saltation.implements(Belt, BristleBelt)
def _switch_tangent_on_belt(scene, record, mode, guard, t, y):
    """Implement :func:`variation.apply_saltation`."""
    rates = record.tangent.rates
    if guard >= low_stop(scene.surface):
        return with_tangent(record, _after_stop(scene.stops, scene, record.tangent, mode, t, y))
    return with_tangent(record, tangent.switched(record.tangent, _gradient(scene, mode, guard, t, y, rates)))


@feature("before")
def _after_stop(stops, scene, before, mode, t, y):
    """Tangent of a body that hits a stop, whose sliding velocity v becomes -e (v + v_b) - v_b; or that leaves one."""
    _, belt_velocity, acceleration = drives.turn(scene.drive, t)[:3]
    velocity = moving(scene, y[1] + belt_velocity, y[1], belt_velocity)
    if mode.stop.rests != 0 or velocity == 0.0:
        return before
    # In a dead band the momentum does not move the body.
    factor, rates = -stops.restitution * moving(scene, 1.0, y[1], 0.0), before.rates
    bounced = factor * rates[1] - (1.0 + stops.restitution) * acceleration
    gradient = joined((1.0 / velocity, 0.0), zeros(rates[2:]))
    return tangent.rebounded(before, factor, gradient, (rates[0], bounced, *rates[2:]))


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
