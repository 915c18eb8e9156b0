"""The record of a run, which grows while a solver advances the run, and the outcome of the run.

A solver passes each state to the recorder as a tuple, ``seen``. The model chooses what the tuple holds. For the ring
these are angle, angular velocity and both normal reactions; for the belt displacement, velocity and friction force. The
functions ``constant_step.seen``, ``series.seen_at`` and ``implicit.seen`` make the tuples.

Who calls: ``automaton.py``, ``taylor.py``, ``creep.py`` and ``rk4.py`` of the solvers. ``begin`` once at launch,
``observe`` after each interval; ``conclude`` and ``keep_memory`` once at the end. Solvers that locate events call
``at_once`` before ``begin`` if a run ends at launch, ``lend`` after it, ``enter`` at the beginning of each step,
``as_mode_ends`` at each event, ``after_event`` after it, and ``at_jam`` after a jam.
"""

from __future__ import annotations

from ringsweep.compile import hook


@hook
def begin(scene, t, seen):
    """Record at the beginning of a run.

    Parameters
    ----------
    scene : NamedTuple
        One cell.
    t : float
        Time, s.
    seen : tuple of float
        The initial state as the recorder takes it.

    Returns
    -------
    NamedTuple
        The record. The model chooses its fields, which are numbers.
    """


@hook(absorb=True)
def observe(scene, record, t, duration, stuck, seen):
    """Record after one more interval of a run.

    Parameters
    ----------
    scene : NamedTuple
        One cell.
    record : NamedTuple
        Record at the beginning of the interval.
    t : float
        Time at the end of the interval, s.
    duration : float
        Length of the interval, s.
    stuck : bool
        Whether the body stuck during the whole interval.
    seen : tuple of float
        The state at `t` as the recorder takes it.

    Returns
    -------
    NamedTuple
        Record at the end of the interval, of the same type as `record`.
    """


@hook
def enter(scene, record, t, seen):
    """Record at the beginning of a step, where values may have jumped. Methods of constant step do not call it.

    Parameters
    ----------
    scene : NamedTuple
        One cell.
    record : NamedTuple
        Record at the end of the step before.
    t : float
        Time, s.
    seen : tuple of float
        The state at `t` as the recorder takes it.

    Returns
    -------
    NamedTuple
        Record of the same type as `record`.
    """


@hook
def conclude(scene, record, status, t, place, velocity):
    """Outcome of a run.

    Parameters
    ----------
    scene : NamedTuple
        One cell.
    record : NamedTuple
        Record at the end of the run.
    status : int
        How the run ended, a constant of :mod:`ringsweep.models.interface.status`.
    t : float
        Time at the end, s.
    place, velocity : float
        Angle (rad) or displacement (m) of the body in space at the end, and its time derivative (rad/s or m/s).

    Returns
    -------
    tuple of float
        One number for each of the model's outcomes, in the order of ``Model.outcomes``.
    """


@hook(optional=True)
def lend(scene, record, row):
    """Record of a run that may store what it records in its row of outcomes. Methods of constant step do not call it.

    Parameters
    ----------
    scene : NamedTuple
        One cell.
    record : NamedTuple
        Record at the beginning of the run.
    row : ndarray
        Row of the run. Its first columns are filled after the run.

    Returns
    -------
    NamedTuple
        By default `record`.
    """
    return record


@hook(optional=True)
def keep_memory(scene, row, column, y):
    """Store what the state at the end of a run has beside place and velocity, after the outcomes of the run.

    Parameters
    ----------
    scene : NamedTuple
        One cell.
    row : ndarray
        Row of the run.
    column : int
        Number of the outcomes, which are the first columns.
    y : tuple of float
        State at the end.
    """


@hook(optional=True)
def at_jam(scene, record, normals, velocity):
    """Record in the limit of a jam; see :func:`ringsweep.models.interface.modes.limit_of_jam`.

    Parameters
    ----------
    scene, record : NamedTuple
        One cell, and its record.
    normals : tuple of float
        Reactions there, N.
    velocity : float
        Velocity of the body in space there, rad/s or m/s.

    Returns
    -------
    NamedTuple
        By default `record`.
    """
    return record


@hook(optional=True)
def at_once(scene, status, mode, t, y, seen):
    """What :func:`begin` takes of a run that ends at launch: the mode in which it would begin does not exist.

    Parameters
    ----------
    scene, mode : NamedTuple
        One cell, and what :func:`ringsweep.models.interface.modes.begin` returned as its mode.
    status : int
        How the run ends, a constant of :mod:`ringsweep.models.interface.status`.
    t : Instant
        Time, s.
    y : tuple of float
        State.
    seen : tuple of float
        The state as the recorder takes it, by the equations of the mode.

    Returns
    -------
    tuple of float
        By default `seen`.
    """
    return seen


@hook(optional=True)
def as_mode_ends(scene, record, mode, guard, t, y):
    """Record at an event that ends a step, if the series of the step is inexact there.

    Parameters
    ----------
    scene, record, mode : NamedTuple
        One cell, its record after the step, and the mode of the step.
    guard : int
        The guard that has vanished.
    t : Instant
        Time of the event, s.
    y : tuple of float
        State at the event.

    Returns
    -------
    NamedTuple
        By default `record`.
    """
    return record


@hook(optional=True)
def after_event(scene, record, before, mode, t):
    """Record after an event, at which a mode begins. Methods of constant step do not call it.

    Parameters
    ----------
    scene : NamedTuple
        One cell.
    record : NamedTuple
        Record before the event.
    before, mode : NamedTuple
        The modes that end and begin; one mode twice as it begins a run, and between steps under a smooth law.
    t : float
        Time of the event, s.

    Returns
    -------
    NamedTuple
        By default `record`.
    """
    return record


MEMBERS = (begin, observe, conclude)
#: What methods that locate events need in addition.
EVENT_MEMBERS = (enter,)
