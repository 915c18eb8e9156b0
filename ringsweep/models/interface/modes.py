"""The modes of a piecewise-smooth system, and how one follows another.

A mode is a ``NamedTuple`` that names a smooth piece of the equations: the sign of the sliding velocity (0 in stick), a
region of the friction law, the segment of the surface under each contact. It has the fields ``sign`` and ``region``,
and ``fresh`` where :mod:`series` are used. It lasts while its guards, functions of the state, are positive. The state
holds the sliding velocity, not the velocity in space: the difference of two large numbers would have no digits left.
"""

from __future__ import annotations

from ringsweep.compile import hook
from ringsweep.models.interface.status import BROKEN
from ringsweep.physics.friction.velocity import BAND


@hook
def initial_state(scene):
    """Time at which the run begins, s, and the state there.

    The time is that of :func:`ringsweep.physics.drives.beginning`: just after 0 where the drive is singular at 0.
    """


@hook
def initial_mode(scene, t, y):
    """Status and mode in the state `y` at time `t`."""


@hook
def switch(scene, mode, guard, t, y):
    """What follows after the guard of that index has reached zero in the state `y` at time `t`.

    Returns
    -------
    tuple
        ``(status, mode, state)``; the state is `y`, but for what is exact now (a sliding velocity that is 0).
    """


@hook(optional=True)
def status_without_way_on(scene, mode, t, y):
    """Status of a run whose steps shrink to nothing in the state `y`: jammed on the brink of a jam, else broken."""
    return BROKEN


@hook(optional=True)
def sticks(scene, mode):
    """Whether the body counts as stuck: in stick, and by default in the stiction band of a smooth law."""
    return mode.sign == 0 or mode.region == BAND


@hook
def in_space(scene, t, y):
    """Place and velocity of the body in space; angle (rad) or displacement (m), and its rate."""


MEMBERS = (initial_state, initial_mode, switch, status_without_way_on, sticks, in_space)
