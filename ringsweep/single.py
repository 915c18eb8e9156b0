"""Single runs: one cell, with its history."""

from __future__ import annotations

import os
from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np
import xarray as xr

from ringsweep.config import Config, read_solver, with_values
from ringsweep.engine import compute, provenance
from ringsweep.models import MODELS, batch
from ringsweep.variables import HISTORY, REGIMES

#: Instants that a history keeps, about.
SAMPLES = 20_000


def simulate(
    scene: str | os.PathLike[str] | Mapping[str, Any],
    *,
    solver: str | Mapping[str, Any] | None = None,
    samples: int = SAMPLES,
) -> xr.Dataset:
    """Run one scene and keep its history.

    Parameters
    ----------
    scene : mapping or path
        The configuration's ``scene``, or a whole configuration, or the path of one; its sweep is ignored.
    solver : str or mapping, optional
        A method's name, or the configuration's ``solver``; by default the configuration's own.
    samples : int
        About how many instants to keep.

    Returns
    -------
    xarray.Dataset
        Dimension ``time``, variables as in :data:`ringsweep.variables.HISTORY`, and the outcomes of
        the run as scalars.

    Raises
    ------
    InputError
        If scene or solver are wrong.
    """
    return history(_alone(scene, solver), samples=samples)


def _alone(scene: str | os.PathLike[str] | Mapping[str, Any], solver: str | Mapping[str, Any] | None) -> Config:
    """Configuration of a single run from a scene or a whole configuration."""
    if isinstance(scene, Mapping) and "scene" not in scene:
        scene = {"scene": scene}
    config = with_values(scene)
    if solver is None:
        return config
    method = {"method": solver} if isinstance(solver, str) else dict(solver)
    chosen = read_solver(method)
    chosen.check(config.scene.structure)
    return replace(config, solver=chosen, source=config.source | {"solver": method})


def history(config: Config, *, samples: int = SAMPLES) -> xr.Dataset:
    """Run a configuration without axes and keep its history; see :func:`simulate`."""
    model = MODELS[config.scene.structure.model]
    cell = batch(config.scene.structure, {path: np.array([value]) for path, value in config.scene.values.items()})
    names = model.history(config.scene.structure)
    times, rows = config.solver.history(cell, samples, len(names))
    outcome = compute(config, jobs=1, progress=False)
    kept = xr.Dataset(
        {
            name: ("time", rows[:, k].astype(HISTORY[name].dtype), HISTORY[name].attributes)
            for k, name in enumerate(names)
            if name not in model.absent
        },
        coords={"time": ("time", times, {"long_name": "time", "units": "s", "axis": "T"})},
    )
    return kept.merge(outcome).assign_attrs(provenance(config) | {"outcome": describe(outcome)})


def describe(outcome: xr.Dataset) -> str:
    """A run's outcome in words."""
    regime = REGIMES[int(outcome["regime"])]
    if "t_separation" in outcome and np.isfinite(outcome["t_separation"]):
        return (
            f"{regime} ({REGIMES[int(outcome['motion'])]}), contact {int(outcome['separating_contact'])}, "
            f"t = {float(outcome['t_separation']):.6g} s"
        )
    return f"{regime}, t = {float(outcome['t_end']):.6g} s"
