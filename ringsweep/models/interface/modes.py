"""The modes of a piecewise-smooth system, and which mode follows another.

In a mode the equations are smooth. A mode is a ``NamedTuple`` that names the sign of the sliding velocity (0 in stick),
the region of the friction law, and, on a ring, the segment of the surface under each contact. It has the fields
``sign``, ``region`` and ``entry_guard``: the row of the guard in :mod:`series` that is zero as the mode begins, or -1.
A mode lasts while its guards, which are functions of the state, are positive.

The state holds the place, the sliding velocity in m/s, and the deflection (m) of each bundle of bristles if there are
any. The place is an angle (rad) or a displacement (m). The state holds the sliding velocity, not the velocity in space,
because the difference of two large velocities would lose all its digits.

Who calls: ``ringsweep/solvers/automaton.py``. ``begin`` once at launch, ``switch`` and ``first_loss`` at each event,
``in_space`` and ``limit_of_jam`` at the end, ``row`` for a history only; ``taylor.py`` and ``creep.py`` call
``sticks`` in each step.
"""

from __future__ import annotations

from ringsweep.compile import hook
from ringsweep.models.interface.status import BROKEN


@hook
def begin(scene):
    """How a run begins.

    Parameters
    ----------
    scene : NamedTuple
        One cell.

    Returns
    -------
    tuple
        ``(t, state, status, mode)``: time, s, :func:`ringsweep.physics.drives.beginning`, which is just after 0 where
        the drive is singular at 0; a tuple of floats; a constant of :mod:`ringsweep.models.interface.status`, since a
        run may end at its launch; and the mode.
    """


@hook
def switch(scene, mode, guard, t, y):
    """What follows after a guard has reached zero.

    Parameters
    ----------
    scene, mode : NamedTuple
        One cell, and the mode that ends.
    guard : int
        Index of the guard: its row in the table of :mod:`series`, or its index among the guards of :mod:`implicit` if
        the model has no series.
    t : Instant
        Time, s.
    y : tuple of float
        State at time `t`.

    Returns
    -------
    tuple
        ``(status, mode, state)``: a constant of :mod:`ringsweep.models.interface.status`, the next mode, and the state
        `y` with its exact values put in, such as a sliding velocity of 0.
    """


@hook(optional=True)
def after_jump(scene, mode, t, y, jump):
    """What follows after the velocity of the drive has jumped.

    Parameters
    ----------
    scene, mode, t, y : NamedTuple, NamedTuple, Instant, tuple of float
        As for :func:`switch`.
    jump : float
        Jump of the velocity of the drive, rad/s or m/s.

    Returns
    -------
    tuple
        As for :func:`switch`. By default the run fails: other scenes take no such drive.
    """
    return BROKEN, mode, y


@hook(optional=True)
def is_lost(scene, t, s):
    """Whether a step of length `s` from the time `t`, both in s, counts as none; a run ends after hundreds of them.

    By default one that rounding takes from the time: near a jam such steps still move the state, but not for ever.
    """
    return t + s == t


@hook(optional=True)
def status_when_stalled(scene, mode, t, y):
    """Status of a run whose steps shrink to nothing.

    Parameters
    ----------
    scene, mode : NamedTuple
        One cell, and its mode.
    t : Instant
        Time, s.
    y : tuple of float
        State at time `t`.

    Returns
    -------
    int
        JAM if the body is about to jam, BROKEN otherwise. By default BROKEN.
    """
    return BROKEN


@hook(optional=True)
def limit_of_jam(scene, mode, t, y):
    """The limit of a jam, which a run nears but does not reach.

    Parameters
    ----------
    scene, mode : NamedTuple
        One cell, and its mode.
    t : Instant
        Time at which the run has ended, s.
    y : tuple of float
        State at time `t`.

    Returns
    -------
    tuple
        ``(s, y, normals)``: time from `t` to the limit, s; state there; reactions at contacts 1 and 2, infinite if they
        grow without bound, else 0. By default the state itself.
    """
    return 0.0, y, (0.0, 0.0)


@hook(optional=True)
def sticks(scene, mode):
    """Whether the body counts as stuck in a mode.

    Parameters
    ----------
    scene, mode : NamedTuple
        One cell, and its mode.

    Returns
    -------
    bool
        By default true in stick, and in the stiction band of a smooth law.
    """
    return mode.sign == 0 or mode.region < 0


@hook(optional=True)
def first_loss(scene, before, after):
    """Whether an event between two modes is the first loss of a contact of a run that goes on.

    Parameters
    ----------
    scene : NamedTuple
        One cell.
    before, after : NamedTuple
        Modes before and after the event.

    Returns
    -------
    bool
        By default false.
    """
    return False


@hook
def in_space(scene, t, y):
    """Place and velocity of the body in space.

    Parameters
    ----------
    scene : NamedTuple
        One cell.
    t : Instant
        Time, s.
    y : tuple of float
        State at time `t`.

    Returns
    -------
    tuple of float
        ``(place, velocity)``: angle (rad) or displacement (m), and its time derivative (rad/s or m/s).
    """


@hook
def row(scene, mode, forcing, y, seen):
    """Row of a time history.

    Parameters
    ----------
    scene, mode : NamedTuple
        One cell, and its mode.
    forcing : tuple of float
        What :func:`ringsweep.physics.drives.turn` returned.
    y : tuple of float
        State.
    seen : tuple of float
        The state as the recorder takes it, see :mod:`ringsweep.models.interface.recorder`.

    Returns
    -------
    tuple of float
        One number for each history variable, in the order of ``Model.history``.
    """


#: Functions without a default.
MEMBERS = (begin, switch, in_space, row)
