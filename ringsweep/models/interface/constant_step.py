"""What a solver of constant step needs: rates, what ends a run, and how far the step can be trusted.

The state holds place and velocity of the body in space, and the deflection of each bundle of bristles if there are any.
Units are rad and rad/s, or m and m/s; deflections are in m. An *inspection* is a ``NamedTuple`` with everything that
the model wants to know of a state. Its field ``rates`` is the time derivative of the state.

A *forcing* is what the equations need to know of a time, as :func:`ringsweep.physics.drives.lookup` or
:func:`ringsweep.physics.drives.turn` returns it. It begins with angle (rad) or displacement (m) of the drive, and its
time derivative.

A step advances several runs side by side: it gets vector lanes in place of floats. So the functions that it calls
(``rates``, ``inspect``, ``inspect_next``, ``holds``, ``eigenvalue``, ``margin``, ``arc_share``, ``seen``, ``sticks``
and the recorder's ``observe``) are written without ``if``, see :mod:`ringsweep.numerics.functions`, and all numbers of
an inspection and of a record are floats. A step in which a run ends is repeated for this run with floats.

Only ``ringsweep/solvers/rk4.py`` calls these functions: ``initial_state`` and ``at_once`` once, ``row`` for a history,
the others in each step.
"""

from __future__ import annotations

from math import inf

from ringsweep.compile import hook
from ringsweep.models.interface.status import BROKEN, RUNNING


@hook
def initial_state(scene):
    """State at t = 0.

    Parameters
    ----------
    scene : NamedTuple
        One cell.

    Returns
    -------
    tuple of float
    """


@hook(absorb=True)
def rates(scene, now, y, forcing):
    """Time derivative of a state within a step.

    Parameters
    ----------
    scene : NamedTuple
        One cell.
    now : NamedTuple
        Inspection of the state at the beginning of the step. A body may take from it what changes little in a step.
    y : tuple of float
        State.
    forcing : tuple of float
        Forcing at the time of the state.

    Returns
    -------
    tuple of float
        One number for each component of the state.
    """


@hook(absorb=True)
def inspect(scene, y, forcing):
    """Inspection of a state.

    Parameters
    ----------
    scene : NamedTuple
        One cell.
    y : tuple of float
        State.
    forcing : tuple of float
        Forcing at the time of the state.

    Returns
    -------
    NamedTuple
        With the field ``rates``, a tuple like `y`; the model chooses the other fields.
    """


@hook(optional=True)
def at_once(scene, y, forcing, now):
    """Inspection `now` of a state, as the contacts that can stay closed leave it if not all can.

    Parameters
    ----------
    scene, y, forcing
        As for :func:`inspect`.
    now : NamedTuple
        What :func:`inspect` returned.

    Returns
    -------
    NamedTuple
        By default `now`.
    """
    return now


@hook(absorb=True, optional=True)
def inspect_next(scene, before, y, forcing, afresh):
    """Inspection of the state at the end of a step, by default that of :func:`inspect`.

    Parameters
    ----------
    scene : NamedTuple
        One cell.
    before : NamedTuple
        Inspection of the state at the beginning of the step. A body may take from it what changes little in a step.
    y, forcing
        As for :func:`inspect`.
    afresh : bool
        Whether to compute all from `y`, true every so many steps: otherwise rounding errors would add up.

    Returns
    -------
    NamedTuple
        Of the type that :func:`inspect` returns.
    """
    return inspect(scene, y, forcing)


@hook(absorb=True, optional=True)
def holds(scene, now):
    """Whether the equations of the model hold in a state. If they do not, :func:`verdict` says how the run ended.

    Parameters
    ----------
    scene : NamedTuple
        One cell.
    now : NamedTuple
        Inspection of the state.

    Returns
    -------
    bool
        By default whether the first two rates are finite.
    """
    return (abs(now.rates[0]) < inf) & (abs(now.rates[1]) < inf)


@hook(optional=True)
def verdict(scene, before, now):
    """Status of a run after a step.

    Parameters
    ----------
    scene : NamedTuple
        One cell.
    before, now : NamedTuple
        Inspections at the beginning and at the end of the step. At launch they are the same.

    Returns
    -------
    tuple
        ``(status, fraction)``: a constant of :mod:`ringsweep.models.interface.status`, and the fraction of the step
        after which the run ended (1 if it goes on). By default the run is BROKEN unless :func:`holds`.
    """
    return (RUNNING if holds(scene, now) else BROKEN), 1.0


@hook(absorb=True)
def eigenvalue(scene, before, now, h, most):
    """Largest magnitude of an eigenvalue of the linearised equations in a run, after one more step.

    Parameters
    ----------
    scene : NamedTuple
        One cell.
    before, now : NamedTuple
        Inspections at the beginning and at the end of the step.
    h : float
        Length of the step, s.
    most : float
        Largest magnitude in the steps before, 1/s. A body may return it as soon as a bound shows that this step does
        not exceed it.

    Returns
    -------
    float
        In 1/s. A run in which it exceeds ``ringsweep.solvers.rk4.STABILITY_LIMIT`` divided by `h` has no certificate.
    """


@hook(absorb=True, optional=True)
def margin(scene, before, now):
    """Lower bound on the guards that end a run, such as the normal reactions, within a step.

    A guard may dip below zero and recover within a step. In the step before or after, it then changes by more than four
    times the depth of the dip. So a body subtracts a quarter of the change in the step from the smaller end value.

    Parameters
    ----------
    scene : NamedTuple
        One cell.
    before, now : NamedTuple
        Inspections at the beginning and at the end of the step.

    Returns
    -------
    float
        In the unit of the guards. A run whose margin is not positive has no certificate. By default infinite: only the
        end of the span ends a run.
    """
    return inf


@hook(absorb=True, optional=True)
def arc_share(scene, now, h):
    """Distance that the body slides in a step, as a share of the narrowest segment of the surface.

    Parameters
    ----------
    scene : NamedTuple
        One cell.
    now : NamedTuple
        Inspection at the end of the step.
    h : float
        Length of the step, s.

    Returns
    -------
    float
        Dimensionless. A run in which it exceeds one half may miss a segment and has no certificate. By default 0: the
        surface is uniform.
    """
    return 0.0


@hook(optional=True)
def fall_rate(scene, before, now, h):
    """Rate at which the guard that ended a run fell.

    Parameters
    ----------
    scene : NamedTuple
        One cell.
    before, now : NamedTuple
        Inspections at the beginning and at the end of the step in which the run ended.
    h : float
        Length of the step, s.

    Returns
    -------
    float
        Positive, in the unit of the guard per second. By default 0.
    """
    return 0.0


@hook(absorb=True)
def seen(scene, y, now, epsilon):
    """A state as the recorder takes it, see :mod:`ringsweep.models.interface.recorder`.

    Parameters
    ----------
    scene : NamedTuple
        One cell.
    y : tuple of float
        State.
    now : NamedTuple
        Inspection of the state. At the end of a run, which lies within a step, it is the inspection at the end of the
        step.
    epsilon : float
        Acceleration of the drive at launch, rad/s^2; on the belt m/s^2. 0 later, where the recorder takes differences.

    Returns
    -------
    tuple of float
    """


@hook(absorb=True)
def sticks(scene, before, now):
    """Whether the body counts as stuck during a step.

    Parameters
    ----------
    scene : NamedTuple
        One cell.
    before, now : NamedTuple
        Inspections at the beginning and at the end of the step.

    Returns
    -------
    bool
    """


@hook
def row(scene, y, forcing):
    """Row of a time history.

    Parameters
    ----------
    scene : NamedTuple
        One cell.
    y : tuple of float
        State.
    forcing : tuple of float
        Forcing at the time of the state.

    Returns
    -------
    tuple of float
        One number for each history variable, in the order of ``Model.history``.
    """


#: Functions without a default.
MEMBERS = (initial_state, rates, inspect, eigenvalue, seen, sticks, row)
