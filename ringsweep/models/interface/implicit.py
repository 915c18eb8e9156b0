"""The equations of a mode for implicit steps, which are taken where a mode relaxes much faster than it moves.

The state of an implicit step, called ``x``, has the components of the mode's state ``y``: place, sliding velocity, and
the deflection of each bundle of bristles if there are any. Its place is relative to the drive where ``y`` has it in
space, so that nothing large cancels however slow the creep. A *forcing* is what the equations need of a time, and a
*view* is the model's account of a state: its guards, and its motion.
"""

from __future__ import annotations

from ringsweep.compile import hook
from ringsweep.physics import drives
from ringsweep.physics.friction.velocity import BAND


@hook(optional=True)
def may_creep(scene, mode):
    """Whether the mode is one that may want implicit steps: by default, in the stiction band of a smooth law."""
    return mode.region == BAND


@hook
def is_stiff(scene, mode, y, line):
    """Whether a mode, linearised as `line`, relaxes so fast, compared with its own motion, that it wants such a
    step."""


@hook(optional=True)
def forcing(scene, t):
    """What the equations need of the time `t`: by default, the drive and its first two derivatives."""
    return drives.turn(scene.drive, t)


@hook(optional=True)
def to_implicit(scene, force, y):
    """State of an implicit step from the state of the mode, under a :func:`forcing`; by default the same."""
    return y


@hook(optional=True)
def from_implicit(scene, force, x):
    """State of the mode from the state of an implicit step, under a :func:`forcing`; by default the same."""
    return x


@hook
def rates(scene, mode, force, x):
    """Time derivative of the state of an implicit step, under a :func:`forcing`."""


@hook
def linearise(scene, mode, t, x):
    """Linearised equations at a state and a time.

    Returns
    -------
    tuple
        ``(rates, core, bristles, drift)``: the time derivative; the Jacobian of place and velocity, row by row; for
        each bundle of bristles the derivative of the acceleration by its deflection, and of its rate by the velocity
        and by its deflection; the partial derivative of the rates by time.
    """


@hook
def error_scales(scene, tolerance, x):
    """Error allowed to each component of the state `x`.

    With bristles one number more: the error allowed to the acceleration.
    """


@hook
def guards_and_motion(scene, mode, t, x):
    """Guards of the mode, positive while it holds, and motion.

    Returns
    -------
    tuple
        ``(guards, motion)``: the guards in the order of their indices; place, velocity and acceleration of the body
        in space, and what :func:`seen` needs.
    """


@hook
def near_zero(scene, motion):
    """Value of each guard below which it is watched closely in a step; `motion` is the second part of a view."""


@hook
def motion(scene, t, x, line):
    """Velocity and acceleration of the body in space where it is linearised as `line`."""


@hook
def seen(scene, view):
    """What the recorder is shown; `view` is what :func:`guards_and_motion` returned."""


@hook
def row(scene, mode, t, x):
    """Row of a time history."""


MEMBERS = (
    may_creep,
    forcing,
    to_implicit,
    from_implicit,
    rates,
    linearise,
    error_scales,
    guards_and_motion,
    near_zero,
    motion,
    seen,
    row,
)
