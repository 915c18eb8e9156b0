"""The variational equation on the ring: Jacobians of the modes, and gradients of the guards at events.

These functions run only if the scene asks for an exponent.
"""

from __future__ import annotations

from math import cos, sin

from ringsweep.compile import add_scaled, inlined
from ringsweep.models import tangent
from ringsweep.models.interface import variation
from ringsweep.models.ring.contacts import coefficients_under
from ringsweep.models.ring.long_run import with_tangent
from ringsweep.models.ring.record import with_long_run
from ringsweep.models.ring.series import EDGE
from ringsweep.physics import contact, drives
from ringsweep.physics.friction.velocity import stiction_band
from ringsweep.physics.ring import Ring

# Differences for the gradient of the reserve of friction: of the angle, rad, and of the time as a share of its scale.
_SMALL = 1e-5


@inlined
def _with(record, new):
    """Record with the tangent `new`."""
    return with_long_run(record, with_tangent(record.long_run, new))


@variation.enter_mode.implements(Ring)
def _enter_tangent_on_ring(scene, record, mode, rates):
    """Implement :func:`variation.enter_mode`; stick keeps no disturbance of the sliding velocity."""
    # A body that comes to rest on the ring keeps no disturbance of the sliding velocity.
    keeps = 0.0 if mode.sign == 0 and stiction_band(scene.law) == 0.0 else 1.0
    return _with(record, tangent.enter(record.long_run.tangent, (1.0, keeps), rates))


@variation.propagate.implements(Ring)
def _advance_tangent_on_ring(scene, record, h, rates, weights, work):
    """Implement :func:`variation.propagate`."""
    return _with(record, tangent.advance(record.long_run.tangent, h, rates, weights, work))


@variation.apply_saltation.implements(Ring)
def _switch_tangent_on_ring(scene, record, mode, guard, t, y):
    """Implement :func:`variation.apply_saltation`."""
    before = record.long_run.tangent
    return _with(record, tangent.switched(before, _gradient(scene, mode, guard, t, y, before.rates)))


@inlined
def _gradient(scene, mode, guard, t, y, rates):
    """Gradient of a guard by the state, divided by its rate, in the mode that ends; `rates` of the state."""
    if mode.sign == 0:
        return _gradient_of_reserve(scene, mode, t, y[0])
    if guard == EDGE:
        # The edge moves with the ring: the contact nears it at the sliding velocity.
        return scene.body.radius / y[1] if y[1] != 0.0 else 0.0, 0.0
    return 0.0, 1.0 / rates[1] if rates[1] != 0.0 else 0.0


@inlined
def _gradient_of_reserve(scene, mode, t, phi):
    """Gradient of the reserve of friction, whose zero ends stick, over its rate."""
    _, omega, epsilon = drives.turn(scene.drive, t)
    at, rates = (phi, omega, epsilon), (omega, epsilon, drives.jerk_at(scene.drive, t))
    fast = (scene.body.gravity / scene.body.radius) ** 0.5 + abs(omega) + abs(epsilon) ** 0.5
    by_phi = _reserve_rate(scene, mode, at, (1.0, 0.0, 0.0), _SMALL)
    rate = _reserve_rate(scene, mode, at, rates, _SMALL / fast if fast > 0.0 else _SMALL)
    return by_phi / rate if rate != 0.0 else 0.0, 0.0


@inlined
def _reserve_rate(scene, mode, at, rates, step):
    """Rate of the reserve of friction, by differences, if angle, angular velocity and acceleration have these rates."""
    mu_s1, _, mu_s2, _ = coefficients_under(scene, mode)
    phi, omega, epsilon = add_scaled(at, step, rates)
    _, above, _, _ = contact.stick(scene.body, mu_s1, mu_s2, (sin(phi), cos(phi), omega), epsilon)
    phi, omega, epsilon = add_scaled(at, -step, rates)
    _, below, _, _ = contact.stick(scene.body, mu_s1, mu_s2, (sin(phi), cos(phi), omega), epsilon)
    return (above - below) / (2.0 * step)
