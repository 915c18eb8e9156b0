"""Forces on the body on the belt: spring, damper and external force, and friction under laws of the velocity alone."""

from __future__ import annotations

from ringsweep.compile import absorbed, hook, inlined
from ringsweep.models.interface import shock
from ringsweep.numerics.functions import opposing, select
from ringsweep.physics import drives
from ringsweep.physics.belt import Cubic, Damper
from ringsweep.physics.forces import Forced, force_in, force_rate, largest_force
from ringsweep.physics.friction.registry import SetValued, family
from ringsweep.physics.friction.velocity import friction_at, stiction_band

# A part that a belt may lack adds its term in this function. Without the part the function returns what it is given, so
# that the code is as if the part did not exist. Arguments are floats, Lanes or terms of a series.


@hook(absorb=True, optional=True)
def _with(part, total, factor, by):
    """`total` with `factor` times the force of a part.

    `by` is what the force depends on: the velocity for a damper, the cube of the displacement for the cubic part of the
    spring, and the force itself for an external force.
    """
    return total


@_with.implements(Damper)
def _with_damper(part, total, factor, by):
    return total - by * (factor * part.coefficient)


@_with.implements(Cubic)
def _with_cubic(part, total, factor, by):
    return total - by * (factor * part.stiffness)


@_with.implements(Forced)
def _with_push(part, total, factor, by):
    return total + by * factor


@absorbed
def with_loads(scene, total, factor, velocity, cube, push):
    """`total` with `factor` times the forces of damper, cubic part of the spring and external force.

    Parameters
    ----------
    scene : NamedTuple
    total : float, Lanes or terms of a series
    factor : float
    velocity : like `total`
        Velocity in space, m/s.
    cube : like `total`
        Third power of the displacement, m^3.
    push : like `total`
        External force, N.

    Returns
    -------
    like `total`
        ``total + factor (push - c velocity - k3 cube)``, as far as the scene has these parts. The forces are linear in
        the last three arguments, so that their derivatives in place of them give that of the sum.
    """
    total = _with(scene.damper, total, factor, velocity)
    total = _with(scene.cubic, total, factor, cube)
    return _with(scene.drive, total, factor, push)


@hook(optional=True)
def _is_present(part):
    return False


@_is_present.implements(Cubic, Damper, Forced)
def _present(part):
    return True


@inlined
def has_loads(scene):
    """Whether the scene has a damper, a cubic part of the spring or an external force."""
    return _is_present(scene.cubic) or _is_present(scene.damper) or _is_present(scene.drive)


@absorbed
def pull(scene, x, velocity, forcing):
    """Sum of all forces on the body but friction, N.

    Parameters
    ----------
    scene : NamedTuple
    x, velocity : float
        Displacement, m, and velocity in space, m/s.
    forcing : tuple of float
        What :func:`ringsweep.physics.drives.turn` or :func:`ringsweep.physics.drives.lookup` returned.
    """
    return with_loads(scene, -scene.stiffness * x, 1.0, velocity, x * x * x, force_in(scene.drive, forcing))


@inlined
def net_force(scene, x, velocity, forcing, friction):
    """Sum of all forces on the body, N, with the friction force `friction`; other arguments are as for :func:`pull`."""
    total = -(scene.stiffness * x + friction)
    return with_loads(scene, total, 1.0, velocity, x * x * x, force_in(scene.drive, forcing))


@inlined
def with_load_derivatives(scene, derivatives, x, drift, forcing):
    """Derivatives of the acceleration by place, velocity and time, with those of the forces in :func:`with_loads`.

    `derivatives` are those without these forces. `drift` is the velocity in space, m/s, of a body whose state is
    constant.
    """
    by_place, by_velocity, by_time = derivatives
    per_mass, square, rate = 1.0 / scene.mass, 3.0 * x * x, force_rate(scene.drive, forcing)
    return (
        with_loads(scene, by_place, per_mass, 0.0, square, 0.0),
        with_loads(scene, by_velocity, per_mass, 1.0, 0.0, 0.0),
        with_loads(scene, by_time, per_mass, forcing[2], square * drift, rate),
    )


@inlined
def stuck_pull(scene, x, v, forcing):
    """Force that friction must balance to keep the sliding velocity `v` (m/s) constant, N; positive forwards."""
    total = -scene.stiffness * x - scene.mass * forcing[2]
    return with_loads(scene, total, 1.0, v + forcing[1], x * x * x, force_in(scene.drive, forcing))


@inlined
def stuck_pull_rate(scene, t, x, forcing):
    """Time derivative of :func:`stuck_pull` of a body at rest on the belt, N/s."""
    total = -scene.stiffness * forcing[1] - scene.mass * drives.jerk(scene.drive, t)
    rate = force_rate(scene.drive, forcing)
    return with_loads(scene, total, 1.0, forcing[2], 3.0 * x * x * forcing[1], rate)


@absorbed
def damping(scene, slope):
    """`slope`, the derivative of the friction force by the velocity, and the coefficient of the damper, N s/m."""
    return _with(scene.damper, slope, -1.0, 1.0)


@hook(absorb=True, optional=True)
def bend(cubic, x):
    """What :func:`steepest_spring` needs of the displacement `x`, m: nothing for a linear spring."""
    return ()


@bend.implements(Cubic)
def _bend(cubic, x):
    return (x,)


@hook(absorb=True, optional=True)
def steepest_spring(cubic, stiffness, before, now):
    """Greatest stiffness of the spring in a step, in magnitude, N/m. `before` and `now` are from :func:`bend`."""
    return stiffness


@steepest_spring.implements(Cubic)
def _steepest_cubic(cubic, stiffness, before, now):
    first = stiffness + 3.0 * cubic.stiffness * before[0] * before[0]
    last = stiffness + 3.0 * cubic.stiffness * now[0] * now[0]
    return select(abs(last) > abs(first), last, first)


@hook(optional=True)
def _is_set_valued(family):
    return False


@_is_set_valued.implements(SetValued)
def _set_valued(family):
    return True


@inlined
def holds_in_band(law):
    """Whether friction in the band of the law takes any value up to the breakaway force, as in a dead band."""
    return _is_set_valued(family(law))


@inlined
def breakaway_force(scene):
    """Largest friction force of a stuck contact, N."""
    return scene.mu_s * scene.mass * scene.gravity


@inlined
def located(scene, x, acceleration):
    """Acceleration of the body at the displacement `x`, and the size of its terms, for the recorder."""
    size = (breakaway_force(scene) + abs(scene.stiffness * x)) / scene.mass + abs(acceleration)
    return shock.Located(acceleration, size)


@absorbed
def friction_force(scene, pulled, v):
    """Friction force (N) at the sliding velocity `v` (m/s), and its derivative by `v` (N s/m).

    `pulled` is the sum of the other forces, N, see :func:`pull`. Friction balances it in a dead band.
    """
    mu, mu_slope = friction_at(scene.law, abs(v), (scene.mu_s, scene.mu_k))
    load = scene.mass * scene.gravity
    force = scene.viscous * v - opposing(load * mu, v)
    slope = load * mu_slope + scene.viscous
    if holds_in_band(scene.law):
        held, bound = abs(v) < stiction_band(scene.law), breakaway_force(scene)
        force = select(held, max(-bound, min(bound, pulled)), force)
        slope = select(held, 0.0, slope)
    return force, slope


@absorbed
def acceleration(scene, x, velocity, forcing, force):
    """Acceleration of the body in space under a friction force, m/s^2. Other arguments are as for :func:`pull`."""
    per_mass = 1.0 / scene.mass
    total = -(scene.stiffness * per_mass) * x - force * per_mass
    return with_loads(scene, total, per_mass, velocity, x * x * x, force_in(scene.drive, forcing))


@inlined
def with_cubic_energy(scene, energy, x):
    """`energy` with that of the cubic part of the spring, J, at the displacement `x`, m."""
    return _with(scene.cubic, energy, -1.0, 0.25 * (x * x) * (x * x))


@inlined
def with_sizes(scene, total, factor, velocity, cube, push):
    """`total` with the magnitudes of the terms of :func:`with_loads`, for floats."""
    if has_loads(scene):
        total += abs(with_loads(scene, 0.0, factor, velocity, 0.0, 0.0))
        total += abs(with_loads(scene, 0.0, factor, 0.0, cube, 0.0))
        total += abs(with_loads(scene, 0.0, factor, 0.0, 0.0, push))
    return total


@hook(optional=True)
def _reach(cubic, mass, velocity, load, by_velocity, by_load):
    """Sum of the lengths that a velocity and a load reach; by a linear spring they are `by_velocity` and `by_load`."""
    return by_velocity + by_load


@_reach.implements(Cubic)
def _reach_of_cubic(cubic, mass, velocity, load, by_velocity, by_load):
    # A hardening spring alone turns the body where its energy, cubic x^4/4, is that of the motion.
    if cubic.stiffness > 0.0:
        by_velocity = min(by_velocity, (2.0 * mass * velocity * velocity / cubic.stiffness) ** 0.25)
        by_load = min(by_load, (load / cubic.stiffness) ** (1.0 / 3.0))
    return by_velocity + by_load


@inlined
def length_scale(scene, velocity):
    """Length in units of which errors are measured, m, for a body with this velocity (m/s)."""
    load = scene.mu_s * scene.gravity * scene.mass + largest_force(scene.drive)
    if scene.stiffness > 0.0:
        by_velocity, by_load = velocity * (scene.mass / scene.stiffness) ** 0.5, load / scene.stiffness
    else:
        by_velocity, by_load = velocity, load / scene.mass
    return _reach(scene.cubic, scene.mass, velocity, load, by_velocity, by_load) + 1e-300


@hook(optional=True)
def _stiffness_over(cubic, stiffness, length):
    """Stiffness of the spring over a length, N/m."""
    return stiffness


@_stiffness_over.implements(Cubic)
def _stiffness_of_cubic(cubic, stiffness, length):
    return stiffness + max(cubic.stiffness, 0.0) * length * length


@inlined
def speed_scale(scene, length):
    """Speed in units of which errors are measured, m/s, for a motion over this length (m)."""
    stiffness_per_mass = _stiffness_over(scene.cubic, scene.stiffness, length) / scene.mass
    return length * (stiffness_per_mass**0.5 if stiffness_per_mass > 0.0 else 1.0)
