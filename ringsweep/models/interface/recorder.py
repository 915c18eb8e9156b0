"""What is remembered of a run while a solver advances it, and the outcome that it becomes.

What a solver shows of a state is a tuple of the model's own choice, called ``seen``: for the ring angle, angular
velocity and both normal reactions, for the belt displacement, velocity and friction force.
"""

from __future__ import annotations

from ringsweep.compile import hook


@hook
def begin(scene, t, seen):
    """Record of a run that begins.

    Parameters
    ----------
    scene : NamedTuple
    t : float
        Time, s.
    seen : tuple of float
        The initial state as a solver shows it.

    Returns
    -------
    NamedTuple
    """


@hook(absorb=True)
def observe(scene, record, t, duration, stuck, seen):
    """Record after a further part of a run.

    Parameters
    ----------
    scene, record : NamedTuple
    t : float
        Time at the end of that part, s.
    duration : float
        Length of that part, s; 0 where a value has jumped.
    stuck : bool
        Whether the body stuck all the while.
    seen : tuple of float
        The state at `t` as a solver shows it.
    """


@hook
def conclude(scene, record, status, t, place, velocity):
    """Outcome of a run.

    Parameters
    ----------
    scene, record : NamedTuple
    status : int
        How the run ended; see :mod:`ringsweep.models.interface.status`.
    t : float
        Time at the end, s.
    place, velocity : float
        Angle (rad) or displacement (m) of the body in space, and its rate.

    Returns
    -------
    tuple of float
        One number for each of the model's outcomes.
    """


MEMBERS = (begin, observe, conclude)
