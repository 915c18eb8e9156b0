"""Power series within a mode.

A table of shape ``(rows, columns)`` holds one series in the time since the step began in each row: coefficient k in
column k, up to :data:`ringsweep.numerics.series.ORDER`. The last rows are the guards of the mode.
"""

from __future__ import annotations

from ringsweep.compile import hook


@hook(optional=True)
def table_shape(scene):
    """Number of rows of the table, and the first row that is a guard; by default there are no series."""
    return 0, 0


@hook
def expand(scene, mode, t, y, tolerance, c):
    """Power series about a state within a mode.

    Parameters
    ----------
    scene, mode : NamedTuple
    t : float
        Time, s.
    y : tuple of float
        State.
    tolerance : float
        Error allowed to a step: rad, and rad/s relative to 1 rad/s + \\|omega\\|, or relative to the scales of a belt.
    c : ndarray of shape ``(rows, columns)``
        Filled with the series. A guard is positive while the mode holds; the guard ``mode.fresh`` is exactly zero
        at first.

    Returns
    -------
    float
        Step over which the series meets the tolerance, s.
    """


@hook
def state_at(scene, c, s):
    """State after the time `s` (s) since the series `c` began."""


@hook
def rates_at(scene, c, s):
    """Time derivative of that state."""


@hook
def seen_at(scene, c, s, h):
    """What the recorder is shown after the time `s` within a step `h` along the series `c`, both in s."""


@hook
def extremes(scene, record, mode, c, h, work):
    """Instants within a step `h` at which the recorder must look, since a quantity may have an extreme there.

    Parameters
    ----------
    scene, record, mode : NamedTuple
    c : ndarray of shape ``(rows, columns)``
        Series of the step.
    h : float
        Length of the step, s.
    work : ndarray of shape ``(STACK, columns)``
        Scratch; the instants are noted in ``work[0]`` (see :func:`ringsweep.numerics.series.crossings`).

    Returns
    -------
    int
        Number of instants. The end of the step is not among them.
    """


@hook
def row(scene, mode, c, t, s):
    """Row of a time history at time `t`, which is the time `s` after the series `c` began."""


@hook(optional=True)
def after_first_step(mode):
    """The mode after its first step, when no guard is zero any more for its having been entered."""
    return mode


MEMBERS = (table_shape, expand, state_at, rates_at, seen_at, extremes, row)
