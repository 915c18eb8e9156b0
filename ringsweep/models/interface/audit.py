"""Whether a run obeys its law, told by formulas that the solver did not use."""

from __future__ import annotations

import numpy as np

from ringsweep.compile import hook


@hook
def violation(scene, mode, force, y, rates, s, tolerance):
    """How far a state, and the rate at which it changes, break the law of the scene.

    Parameters
    ----------
    scene, mode : NamedTuple
    force : tuple of float
        The forcing there; see :mod:`ringsweep.models.interface.implicit`.
    y, rates : tuple of float
        State within a step, and its time derivative.
    s : float
        Length of the step, s.
    tolerance : float
        Error allowed to a step of the series.

    Returns
    -------
    tuple of float
        ``(violation, power)``: the largest violation of the friction law, of the balances and of the signs of the
        reactions, as a multiple of what the error allowed to a step makes of each; and the power of friction on the
        body, W.
    """


@hook
def energy(scene, force, y):
    """Mechanical energy of a state under a forcing, J."""


@hook(optional=True)
def undecided(batch, rows, witness, fall):
    """Which runs of a batch have a verdict that hangs by less than two resolutions differ; outside kernels.

    Parameters
    ----------
    batch : NamedTuple
        Scenes, whose type decides.
    rows, witness : ndarray of shape ``(cells, outcomes)``
        Outcomes at both resolutions.
    fall : ndarray of shape ``(cells,)``
        Rate at which the guard fell that ended each run, its unit times 1/s.

    Returns
    -------
    ndarray of bool, shape ``(cells,)``
        By default none.
    """
    return np.zeros(len(rows), dtype=bool)


MEMBERS = (violation, energy, undecided)
