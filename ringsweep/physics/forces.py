"""A force on the body beside the motion of the belt.

The force has the laws of the drives: :math:`P(t) = P_0 + A\\, s(t)`, with a shape s of :mod:`ringsweep.physics.drives`
and an amplitude A in N.

A :class:`Forced` drive is a drive too: it takes each question about the motion to the drive that it holds. Only the
belt has one.
"""

from __future__ import annotations

from typing import Any, NamedTuple

from ringsweep.compile import feature, hook
from ringsweep.numerics.clock import is_after, later
from ringsweep.numerics.terms import joined
from ringsweep.physics import drives
from ringsweep.physics.functions_of_time import common_period
from ringsweep.quantities.parameters import Leaf, Parameter

CONSTANT = Parameter("N", "constant force on the body (default: 0)", optional=True)
AMPLITUDE = Parameter("N", "amplitude of the harmonic force on the body", optional=True)
FREQUENCY = Parameter("Hz", "frequency of the harmonic force", lower=0.0, optional=True)
PHASE = Parameter("rad", "phase of the harmonic force at t = 0 (default: 0, a sine)", optional=True)
FACTOR = Parameter("1", "factor on the force of the table", default=1.0)


class Forced(NamedTuple):
    """Drive with a force on the body.

    In place of the three numbers of a drive, :func:`ringsweep.physics.drives.turn` returns five: two more are the rate
    of the force, N/s, and the force, N. :func:`ringsweep.physics.drives.lookup` returns the force as a third number.

    Attributes
    ----------
    motion : NamedTuple
        Drive that moves the belt.
    added : NamedTuple
        Drive whose "angle" is the part of the force that varies, N.
    constant : float
        The constant part, N.
    largest : float
        Bound on the magnitude of the force, N.
    """

    motion: Any
    added: Any
    constant: Leaf
    largest: Leaf


class Laden(NamedTuple):
    """Drive with a force on the body and a normal load on it that varies in time.

    In what :func:`ringsweep.physics.drives.turn` returns the rate of the load, N/s, and the load, N, stand before the
    force; in what :func:`ringsweep.physics.drives.lookup` returns the load alone.

    Attributes
    ----------
    motion : Forced
        Drive and force.
    added : NamedTuple
        Drive whose "angle" is the load, N.
    largest : float
        Bound on the magnitude of the force, N.
    least_load : float
        Bound on the load from below, N.
    """

    motion: Any
    added: Any
    largest: Leaf
    least_load: Leaf


@feature("load", of=Laden)
def load_rate(drive, load, forcing):
    """Rate of the normal load, N/s: that of the motion, `load`, and that of the load that varies in time."""
    return load + forcing[4]


@feature("0.0", of=Laden)
def expand_load(drive, t, order, load, work):
    """Fill the Taylor series of the load about time `t`; see :func:`expand_force`. Nothing without such a load."""
    drives.expand_at(drive.added, t, order, load, work)
    return 0.0


@feature("0.0", of=(Forced, Laden), absorb=True)
def force_in(drive, forcing):
    """Force on the body, N.

    Parameters
    ----------
    drive : NamedTuple
    forcing : tuple of float
        What :func:`ringsweep.physics.drives.turn` or :func:`ringsweep.physics.drives.lookup` returned.

    Returns
    -------
    float
        0 for a drive without a force.
    """
    return forcing[-1]


@feature("0.0", of=(Forced, Laden))
def force_rate(drive, forcing):
    """Time derivative of the force, N/s; 0 without a force.

    Parameters
    ----------
    drive : NamedTuple
    forcing : tuple of float
        What :func:`ringsweep.physics.drives.turn` returned.
    """
    return forcing[3]


@feature("0.0", of=(Forced, Laden))
def largest_force(drive):
    """Bound on the magnitude of the force, N; 0 without a force."""
    return drive.largest


@hook(optional=True)
def expand_force(drive, t, order, force, work):
    """Taylor series of the force about time `t`; without a force it is 0.

    Parameters
    ----------
    drive, t
        As for :func:`ringsweep.physics.drives.expand`.
    order : int
        Highest power.
    force : ndarray of shape ``(order + 1,)``
        Filled with the coefficients, N/s^k.
    work : ndarray of shape ``(SERIES_ROWS, order + 1)``
        Scratch.
    """
    for k in range(order + 1):
        force[k] = 0.0


@expand_force.implements(Forced)
def _expand_force_of_forced(drive, t, order, force, work):
    """Implement :func:`expand_force`."""
    drives.expand_at(drive.added, t, order, force, work)
    force[0] += drive.constant


# ---- the functions of a drive -----------------------------------------------------------------


@drives.turn.implements(Forced)
def _turn_of_forced(drive, t):
    """Implement :func:`drives.turn`, and the rate of the force, N/s, and the force, N."""
    theta, omega, epsilon = drives.turn(drive.motion, t)
    force, rate, _ = drives.turn(drive.added, t)
    return theta, omega, epsilon, rate, force + drive.constant


@drives.turn_near.implements(Forced)
def _turn_near_of_forced(drive, course, now, s):
    """Implement :func:`drives.turn_near`, and the rate of the force, N/s, and the force, N."""
    # The course is that of the motion.
    theta, omega, epsilon = drives.turn_near(drive.motion, course, now, s)
    force, rate, _ = drives.turn(drive.added, later(now, s))
    return theta, omega, epsilon, rate, force + drive.constant


@drives.table_row.implements(Forced)
def _table_row_of_forced(drive, t):
    """Implement :func:`drives.table_row`: the row of the motion, and the shape of the force."""
    s, rate = drives.table_row(drive.motion, t)
    return s, rate, drives.shape(drive.added, t)[0]


@drives.lookup.implements(Forced)
def _lookup_of_forced(drive, table, k):
    """Implement :func:`drives.lookup`, and the force, N."""
    theta, omega = drives.lookup(drive.motion, table, k)
    return theta, omega, drives.amplitude(drive.added) * table[k, 2] + drive.constant


@drives.expand.implements(Forced, Laden)
def _expand_motion_of_forced(drive, t, order, theta, work):
    """Implement :func:`drives.expand`: of the motion."""
    drives.expand_at(drive.motion, t, order, theta, work)


@drives.time_for.implements(Forced, Laden)
def _time_for_forced(drive, t):
    """Implement :func:`drives.time_for`: each of the two converts the time for itself."""
    # Of the motion and of the force each may take another kind of time.
    return t


@drives.jerk.implements(Forced, Laden)
def _jerk_of_forced(drive, t):
    """Implement :func:`drives.jerk`: of the motion."""
    return drives.jerk_at(drive.motion, t)


@drives.next_knot.implements(Forced, Laden)
def _next_knot_of_forced(drive, t):
    """Implement :func:`drives.next_knot`: of the motion or of what is added, whichever is first."""
    return min(drives.next_knot(drive.motion, t), drives.next_knot(drive.added, t))


@drives.knot_after.implements(Forced, Laden)
def _knot_after_of_forced(drive, t):
    """Implement :func:`drives.knot_after`."""
    of_motion, of_added = drives.knot_after(drive.motion, t), drives.knot_after(drive.added, t)
    return of_added if is_after(of_motion, of_added) else of_motion


@drives.held_of.implements(Forced, Laden)
def _held_of_forced(drive):
    """Implement :func:`drives.held_of`: of both."""
    return joined(drives.held_of(drive.motion), drives.held_of(drive.added))


@drives.pass_knot.implements(Forced, Laden)
def _pass_knot_of_forced(drive, t):
    """Implement :func:`drives.pass_knot`: of both."""
    of_motion = drives.pass_knot(drive.motion, t)
    return drives.pass_knot(drive.added, t) or of_motion


@drives.least_jump.implements(Forced, Laden)
def _least_jump_of_forced(drive):
    """Implement :func:`drives.least_jump`: of the motion."""
    return drives.least_jump(drive.motion)


@drives.beginning.implements(Forced, Laden)
def _beginning_of_forced(drive):
    """Implement :func:`drives.beginning`: of the motion."""
    return drives.beginning(drive.motion)


@drives.period.implements(Forced, Laden)
def _period_of_forced(drive):
    """Implement :func:`drives.period`: the common one; infinite if there is none."""
    return common_period(drives.period(drive.motion), drives.force_period(drive.added))


@expand_force.implements(Laden)
def _expand_force_of_laden(drive, t, order, force, work):
    """Implement :func:`expand_force`."""
    expand_force(drive.motion, t, order, force, work)


@drives.turn.implements(Laden)
def _turn_of_laden(drive, t):
    """Implement :func:`drives.turn`, and the rates, N/s, and values, N, of load and force."""
    theta, omega, epsilon, rate, force = drives.turn(drive.motion, t)
    load, rate_of_load, _ = drives.turn(drive.added, t)
    return theta, omega, epsilon, rate, rate_of_load, load, force


@drives.turn_near.implements(Laden)
def _turn_near_of_laden(drive, course, now, s):
    """Implement :func:`drives.turn_near`, and the rates, N/s, and values, N, of load and force."""
    theta, omega, epsilon, rate, force = drives.turn_near(drive.motion, course, now, s)
    load, rate_of_load, _ = drives.turn(drive.added, later(now, s))
    return theta, omega, epsilon, rate, rate_of_load, load, force


@drives.table_row.implements(Laden)
def _table_row_of_laden(drive, t):
    """Implement :func:`drives.table_row`: the row of motion and force, and the shape of the load."""
    s, rate, force = drives.table_row(drive.motion, t)
    return s, rate, force, drives.shape(drive.added, t)[0]


@drives.lookup.implements(Laden)
def _lookup_of_laden(drive, table, k):
    """Implement :func:`drives.lookup`, and load and force, N."""
    theta, omega, force = drives.lookup(drive.motion, table, k)
    return theta, omega, drives.amplitude(drive.added) * table[k, 3], force
