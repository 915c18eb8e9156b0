"""Whether a run obeys its friction law, checked with formulas that the solver did not use.

Who calls: in kernels ``ringsweep/solvers/audit.py`` calls ``violation`` and ``energy_of`` after steps, and
``automaton.py`` calls ``is_reaction`` at the end of a run. In Python ``event.py`` and ``certificate.py`` call the
others, after all runs of a batch.
"""

from __future__ import annotations

import numpy as np

from ringsweep.compile import hook


@hook
def violation(scene, mode, forcing, y, rates, s, tolerance):
    """How far a state and its rates violate the equations of the scene.

    Parameters
    ----------
    scene, mode : NamedTuple
        One cell, and its mode.
    forcing : tuple of float
        What :func:`ringsweep.physics.drives.turn` returned for the time of the state.
    y, rates : tuple of float
        State of the mode within a step, and its time derivative, both from the solver's dense output.
    s : float
        Length of the step, s.
    tolerance : float
        Relative error allowed to a step of the series; implicit steps have
        :data:`ringsweep.models.interface.implicit.IMPLICIT_TOLERANCE` times as much.

    Returns
    -------
    tuple of float
        ``(violation, power)``. ``violation`` is the largest violation of the friction law, of the balances of momentum
        and of the signs of the reactions. Each is divided by the violation that the tolerance would explain; infinite
        if a number is not finite. ``power`` is the power, W, of friction and of all forces on the body that
        :func:`energy_of` leaves out.
    """


@hook
def energy_of(scene, forcing, y):
    """Mechanical energy of the body, and of the spring if there is one.

    Parameters
    ----------
    scene : NamedTuple
        One cell.
    forcing : tuple of float
        What :func:`ringsweep.physics.drives.turn` returned for the time of the state.
    y : tuple of float
        State of the mode.

    Returns
    -------
    float
        Energy in space, J.
    """


@hook(optional=True)
def is_reaction(scene, guard):
    """Whether a guard that may end a run is a reaction, N. By default true: that of a belt."""
    return True


@hook(optional=True)
def undecided(batch, one, other, fall_rates):
    """Which runs of a batch are so close to another regime that their error could change the regime.

    It runs outside kernels and may use NumPy.

    Parameters
    ----------
    batch : NamedTuple
        Cells. The type of the batch decides which body runs.
    one, other : SimpleNamespace
        Outcomes of the runs, and of second runs at another resolution: arrays of shape ``(cells,)``, by name. Their
        difference estimates the error.
    fall_rates : ndarray of shape ``(cells,)``
        Rate at which the reaction that ended each run fell, N/s; infinite if something else ended it.

    Returns
    -------
    ndarray of bool, shape ``(cells,)``
        By default false for all cells.
    """
    return np.zeros(len(batch.span), dtype=bool)


@hook(optional=True)
def same_statistics(batch, one, other):
    """Which runs of a batch have the same statistics as other runs of the same cells, within sampling error.

    Nearby runs of a chaotic motion diverge. Their numbers at the end say nothing, but their regime may be certain. It
    runs outside kernels and may use NumPy.

    Parameters
    ----------
    batch : NamedTuple
        Cells. The type of the batch decides which body runs.
    one, other : SimpleNamespace
        Outcomes of the runs, and of second runs at another resolution: arrays of shape ``(cells,)``, by name.

    Returns
    -------
    ndarray of bool, shape ``(cells,)``
        By default false for all cells: the runs have no statistics.
    """
    return np.zeros(len(batch.span), dtype=bool)


@hook(optional=True)
def disturbed(batch, share):
    """Cells of which a number differs a little, for the second run of a certificate.

    Where a motion is in closed form, two resolutions agree to the last bit, and do not show how its rounding grows; nor
    do they show how the errors of steps grow that both take. It runs outside kernels.

    Parameters
    ----------
    batch : NamedTuple
        Cells. The type of the batch decides which body runs.
    share : ndarray of shape ``(cells,)``
        Relative error that both runs share: rounding, and that of steps.

    Returns
    -------
    NamedTuple
        By default `batch` itself.
    """
    return batch


@hook(optional=True)
def least_scales(batch):
    """Least scales of numbers that follow from the place of a body, to which their errors are compared, by their units.

    A gap may be small, but its error is that of the place. It runs outside kernels.

    Parameters
    ----------
    batch : NamedTuple
        Cells. The type of the batch decides which body runs.

    Returns
    -------
    dict of ndarray
        Of shape ``(cells,)``. By default there are none: the largest number of each unit is its scale, and the span is
        added to that of times. With the key "friction": of friction, N, in a creep.
    """
    return {}


@hook(optional=True)
def of_events(batch, one):
    """What the events of the runs of a batch, such as impacts, say of the runs.

    It runs outside kernels.

    Parameters
    ----------
    batch : NamedTuple
        Cells. The type of the batch decides which body runs.
    one : SimpleNamespace
        Outcomes of the runs: arrays of shape ``(cells,)``, by name.

    Returns
    -------
    tuple of ndarray
        Whether an event disobeys its law; whether events magnify the errors of what was before; and what their model
        leaves out: relative errors that no tolerance of the steps shows. Of shape ``(cells,)``, by default false and 0.
    """
    none = np.zeros(len(batch.span), dtype=bool)
    return none, none, np.zeros(len(batch.span))


#: Functions without a default.
MEMBERS = (violation, energy_of)
