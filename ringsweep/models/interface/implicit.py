"""The equations of a mode for implicit steps, which a solver takes where a mode relaxes much faster than it moves.

The state of an implicit step is called ``x``, the state of the mode (see :mod:`modes`) is called ``y``. Both hold the
place, the sliding velocity in m/s, and the deflection (m) of each bundle of bristles if there are any. The place in
``x`` may be relative to the drive while the place in ``y`` is in space, so that no large numbers cancel in slow creep.

A *forcing* is what the equations need to know of a time: angle (rad) or displacement (m) of the drive, and its first
two time derivatives. A *view* is what a solver needs to know of a state: the guards and the motion.

Who calls: ``ringsweep/solvers/creep.py``, once or several times in each step; ``rates`` and ``linearise`` by the
method in ``rosenbrock.py``. Nothing may be remembered between calls, since steps are rejected and repeated.
"""

from __future__ import annotations

from ringsweep.compile import hook

#: Tolerance of an implicit step, in units of the tolerance of the series.
IMPLICIT_TOLERANCE = 1e3


@hook
def is_stiff(scene, mode, y, linear):
    """Whether a mode relaxes so fast, compared with its own motion, that an implicit step is better than a series.

    Parameters
    ----------
    scene, mode : NamedTuple
        One cell, and its mode.
    y : tuple of float
        State of the mode.
    linear : tuple
        What :func:`linearise` returned for this state.

    Returns
    -------
    bool
    """


@hook(optional=True)
def to_implicit(scene, forcing, y):
    """State of an implicit step from the state of the mode.

    Parameters
    ----------
    scene : NamedTuple
        One cell.
    forcing : tuple of float
        Forcing at the time of the state.
    y : tuple of float
        State of the mode.

    Returns
    -------
    tuple of float
        By default `y`.
    """
    return y


@hook(optional=True)
def from_implicit(scene, forcing, x):
    """State of the mode from the state of an implicit step.

    Parameters
    ----------
    scene : NamedTuple
        One cell.
    forcing : tuple of float
        Forcing at the time of the state.
    x : tuple of float
        State of an implicit step.

    Returns
    -------
    tuple of float
        By default `x`.
    """
    return x


@hook(optional=True)
def common(scene, mode, forcing, x):
    """What the equations have in common within a step, found once, at its beginning.

    Parameters
    ----------
    scene, mode : NamedTuple
        One cell, and its mode.
    forcing : tuple of float
        Forcing at the time of the state.
    x : tuple of float
        State of an implicit step.

    Returns
    -------
    tuple
        The model chooses what it holds: for example friction coefficients. By default it is empty.
    """
    return ()


@hook(absorb=True)
def rates(scene, mode, common, forcing, x):
    """Time derivative of the state of an implicit step.

    Parameters
    ----------
    scene, mode : NamedTuple
        One cell, and its mode.
    common : tuple
        What :func:`common` returned for the state at the beginning of the step.
    forcing : tuple of float
        Forcing at the time of the state.
    x : tuple of float
        State of an implicit step.

    Returns
    -------
    tuple of float
        One number for each component of the state.
    """


@hook
def linearise(scene, mode, common, t, forcing, x):
    """Equations of an implicit step, linearised about a state and a time.

    Parameters
    ----------
    scene, mode : NamedTuple
        One cell, and its mode.
    common : tuple
        What :func:`common` returned for the state at the beginning of the step.
    t : Instant
        Time, s.
    forcing : tuple of float
        Forcing at the time of the state.
    x : tuple of float
        State of an implicit step.

    Returns
    -------
    tuple
        ``(rates, jacobian, by_time)``. ``rates`` is what :func:`rates` returns, ``jacobian`` has its derivatives by
        the state: one tuple for each rate. ``by_time`` is the partial derivative of the rates with respect to time.
    """


@hook
def error_scales(scene, tolerance, x):
    """Error allowed to each component of a state.

    Parameters
    ----------
    scene : NamedTuple
        One cell.
    tolerance : float
        Relative error allowed to an implicit step.
    x : tuple of float
        State of an implicit step.

    Returns
    -------
    tuple of float
        One positive number for each component of the state, in the unit of the component; and the error allowed to the
        sliding acceleration, m/s^2, infinite where stiff bristles do not magnify it.
    """


@hook
def guards_and_motion(scene, mode, common, forcing, x):
    """The view of a state: guards of the mode, and motion.

    Parameters
    ----------
    scene, mode : NamedTuple
        One cell, and its mode.
    common : tuple
        What :func:`common` returned for the state at the beginning of the step.
    forcing : tuple of float
        Forcing at the time of the state.
    x : tuple of float
        State of an implicit step.

    Returns
    -------
    tuple
        ``(guards, motion)``. ``guards`` are floats, positive while the mode holds. If the model has series,
        they are in the order of the guards' rows. ``motion`` begins with place, velocity and acceleration of the body
        in space; then comes whatever else :func:`seen` and :func:`near_zero` need.
    """


@hook(optional=True)
def held_guard(scene, mode, tolerance, motion):
    """The guard that tells when a body is held no longer, which may vary while the state rests.

    The error of the state does not tell whether a step is too long for it.

    Parameters
    ----------
    scene, mode : NamedTuple
        One cell, and its mode.
    tolerance : float
        Relative error allowed to an implicit step.
    motion : tuple of float
        Second part of the view at the end of the step.

    Returns
    -------
    tuple
        ``(guard, error)``: row of the guard in a series, by default -1 for none; error allowed to it, in its unit.
    """
    return -1, 1.0


@hook(optional=True)
def part_before_bend(scene, mode, common, x, x_next):
    """Part of a step at which it should end: by default 1, less if it would not see that friction bends.

    Parameters
    ----------
    scene, mode, common
        As for :func:`rates`.
    x, x_next : tuple of float
        States of an implicit step, at its beginning and at its end.

    Returns
    -------
    float
    """
    return 1.0


@hook
def near_zero(scene, motion):
    """How near to zero each guard may come before the solver looks for a root within the step.

    Parameters
    ----------
    scene : NamedTuple
        One cell.
    motion : tuple of float
        Second part of the view in the middle of the step.

    Returns
    -------
    tuple of float
        One number for each guard, in the unit of the guard; not negative.
    """


@hook
def seen(scene, view):
    """A state as the recorder takes it, see :mod:`ringsweep.models.interface.recorder`.

    Parameters
    ----------
    scene : NamedTuple
        One cell.
    view : tuple
        What :func:`guards_and_motion` returned for the state.

    Returns
    -------
    tuple of float
    """


@hook
def sought(scene, record, view):
    """Quantities whose extremes the record keeps: place, velocity, and others.

    Parameters
    ----------
    scene, record : NamedTuple
        One cell, and its record.
    view : tuple
        What :func:`guards_and_motion` returned for a state.

    Returns
    -------
    tuple of tuple of float
        For each quantity its value in the state, and the least and the greatest value recorded; infinite if the record
        does not keep it.
    """


#: Functions without a default, but for :func:`is_stiff`, which only smooth laws need.
MEMBERS = (rates, linearise, error_scales, guards_and_motion, near_zero, seen, sought)
