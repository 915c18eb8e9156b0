"""What a solver of constant step needs: rates, what ends a run, and how far the step can be trusted.

The state is that of the body in space: place, velocity, and the deflection of bristles if there are any. An inspection
is the model's own account of a state, a ``NamedTuple`` whose field ``rates`` is the time derivative of the state.

Where ``side_by_side`` is ``Several``, the bodies of the functions that a step calls get vector lanes in place of
floats; they are written without ``if`` then, see :mod:`ringsweep.numerics.functions`.
"""

from __future__ import annotations

from math import inf, isfinite

from ringsweep.compile import hook
from ringsweep.models.interface.status import BROKEN, RUNNING
from ringsweep.numerics.memory import Single


@hook(optional=True)
def side_by_side(scene):
    """Whether several runs stand side by side in vector lanes (`Several`) or not (`Single`, the default)."""
    return Single()


@hook
def initial_state(scene):
    """State at t = 0."""


@hook(absorb=True)
def rates(scene, now, y, drive_at, drive_rate):
    """Time derivative of a state.

    Parameters
    ----------
    scene : NamedTuple
    now : NamedTuple
        Inspection of the state in which the step began.
    y : tuple of float
        State.
    drive_at, drive_rate : float
        Angle (rad) or displacement (m) of the drive, and its rate.
    """


@hook(absorb=True)
def inspect(scene, y, drive_at, drive_rate):
    """Inspection of the state `y`; the drive is at `drive_at` and moves at `drive_rate`."""


@hook(absorb=True, optional=True)
def holds(scene, now):
    """Whether the model still holds in an inspected state; by default, whether its rates are finite."""
    return isfinite(now.rates[0]) and isfinite(now.rates[1])


@hook(optional=True)
def verdict(scene, before, now):
    """How a run stands after a step between two inspections.

    Returns
    -------
    tuple
        ``(status, fraction)``: a status of :mod:`ringsweep.models.interface.status`, and the fraction of the step
        after which it was reached. By default a run goes on while the rates are finite.
    """
    return (RUNNING if holds(scene, now) else BROKEN), 1.0


@hook(absorb=True)
def stiffness(scene, before, now, h):
    """Largest magnitude of an eigenvalue of the linearised equations in a step, times its length `h` (s)."""


@hook(absorb=True, optional=True)
def margin(scene, before, now):
    """Least margin of the guards within a step, bounded from below; a run that separates ends where it is 0.

    A guard that turns between two instants has changed by more than four times its dip in the step before or after.
    By default infinite: nothing but the end of the span ends a run.
    """
    return inf


@hook(absorb=True, optional=True)
def arc_share(scene, now, h):
    """Share of the narrowest segment of the surface that the body slides across in a step of `h` s; by default 0."""
    return 0.0


@hook(optional=True)
def fall_rate(scene, before, now, h):
    """Rate at which the guard fell that ended a run in a step of `h` s, its unit times 1/s; by default 0."""
    return 0.0


@hook(absorb=True)
def seen(scene, y, now):
    """What the recorder is shown of a state `y` and an inspection, see :mod:`ringsweep.models.interface.recorder`."""


@hook(absorb=True)
def sticks(scene, before, now):
    """Whether the body counts as stuck in the step between two inspections."""


@hook
def row(scene, y, drive_at, drive_rate):
    """Row of a time history: one number for each of the model's history variables."""


MEMBERS = (
    side_by_side,
    initial_state,
    rates,
    inspect,
    holds,
    verdict,
    stiffness,
    margin,
    arc_share,
    fall_rate,
    seen,
    sticks,
    row,
)
