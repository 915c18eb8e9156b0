"""Power series within a mode.

A step fills a table of shape ``(rows, columns)``. Each row is a power series in the time since the beginning of the
step: coefficient k is in column k, for k up to :data:`ringsweep.numerics.series.ORDER`. The model chooses the rows; the
last ones are the guards of the mode. States are those of :mod:`modes`.

Who calls: ``ringsweep/solvers/taylor.py`` in each step: first ``fill_table``, then the others, which read the table.
The audit and the history of a run read it too, after the step.
"""

from __future__ import annotations

from ringsweep.compile import hook


@hook(optional=True)
def table_shape(scene):
    """Number of rows of the table, and index of the first guard.

    Parameters
    ----------
    scene : NamedTuple
        One cell.

    Returns
    -------
    tuple of int
        ``(rows, first_guard)``. By default ``(0, 0)``: the model has no series.
    """
    return 0, 0


@hook
def fill_table(scene, mode, t, y, tolerance, c):
    """Fill the table with the power series about a state.

    Parameters
    ----------
    scene, mode : NamedTuple
        One cell, and its mode.
    t : Instant
        Time, s.
    y : tuple of float
        State at time `t`.
    tolerance : float
        Relative error allowed to a step. On a ring it applies to 1 rad, and to the velocity at \\|omega\\| and the rate
        of :func:`ringsweep.models.sliding.rate_at_rest`; on a belt to the lengths and velocities of its motion; in a
        stiction band to a velocity of at most its width.
    c : ndarray of shape ``(rows, columns)``
        Table, which is filled. The guards are positive while the mode holds. The guard in row ``mode.entry_guard`` is
        exactly zero at the beginning; with ``mode.entry_guard = -1`` there is none.

    Returns
    -------
    tuple of float
        Greatest length of the step, and length over which the series meets the tolerance, s.
    """


@hook
def state_at(scene, c, s):
    """State within a step.

    Parameters
    ----------
    scene : NamedTuple
        One cell.
    c : ndarray of shape ``(rows, columns)``
        Table of the step.
    s : float
        Time since the beginning of the step, s.

    Returns
    -------
    tuple of float
    """


@hook
def rates_at(scene, c, s):
    """Time derivative of the state within a step.

    Parameters
    ----------
    scene : NamedTuple
        One cell.
    c : ndarray of shape ``(rows, columns)``
        Table of the step.
    s : float
        Time since the beginning of the step, s.

    Returns
    -------
    tuple of float
        One number for each component of the state.
    """


@hook
def seen_at_start(scene, c):
    """What the recorder is shown as a step begins, from the first coefficients alone.

    Parameters
    ----------
    scene : NamedTuple
    c : ndarray of shape ``(rows, columns)``
        Table of the step. Its other coefficients need not be finite, as those of a body without a load are not.

    Returns
    -------
    tuple of float
        See :mod:`ringsweep.models.interface.recorder`.
    """


@hook
def seen_at(scene, mode, c, s, h):
    """State within a step as the recorder takes it, see :mod:`ringsweep.models.interface.recorder`.

    Forces follow from the law and the state: where the law bends, their own series are less exact.

    Parameters
    ----------
    scene, mode : NamedTuple
        One cell, and its mode.
    c : ndarray of shape ``(rows, columns)``
        Table of the step.
    s : float
        Time since the beginning of the step, s.
    h : float
        Length of the step, s.

    Returns
    -------
    tuple of float
    """


@hook
def extremes(scene, record, mode, c, h, work):
    """Find the instants within a step at which the recorder must look, because a quantity may have an extreme there.

    Parameters
    ----------
    scene, record, mode : NamedTuple
        One cell, its record and its mode.
    c : ndarray of shape ``(rows, columns)``
        Table of the step. Rows that neither :func:`state_at`, :func:`rates_at`, :func:`seen_at` nor the
        guards need may be overwritten.
    h : float
        Length of the step, s.
    work : ndarray of shape ``(STACK, columns)``
        Scratch of :func:`ringsweep.numerics.series.crossings`. The instants, in s since the beginning of the step, are
        stored in ``work[0]`` in any order.

    Returns
    -------
    int
        Number of instants. The end of the step is not among them.
    """


#: Functions without a default.
MEMBERS = (fill_table, state_at, rates_at, seen_at_start, seen_at, extremes)
