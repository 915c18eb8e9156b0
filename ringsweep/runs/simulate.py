"""Single runs: one cell, with its history, under one friction law or several."""

from __future__ import annotations

import os
from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from ringsweep.compile import take
from ringsweep.config import Config, with_values
from ringsweep.config.solver import read_solver
from ringsweep.models import MODELS, batch
from ringsweep.models.scene import Structure
from ringsweep.physics.drives import turn
from ringsweep.quantities.variables import HISTORY, REGIMES
from ringsweep.runs.sweep import compute
from ringsweep.storage.provenance import attributes

#: Instants that a history keeps, about.
SAMPLES = 20_000


def simulate(
    scene: str | os.PathLike[str] | Mapping[str, Any],
    *,
    solver: str | Mapping[str, Any] | None = None,
    samples: int = SAMPLES,
) -> xr.Dataset:
    """Run one scene and keep its history; a sweep over friction laws makes it a run under each.

    Parameters
    ----------
    scene : mapping or path
        The configuration's ``scene``, or a whole configuration, or the path of one; what it sweeps,
        other than a grid of friction laws, is ignored.
    solver : str or mapping, optional
        A method's name, or the configuration's ``solver``; by default the configuration's own.
    samples : int
        About how many instants to keep of a run.

    Returns
    -------
    xarray.Dataset
        Dimension ``time``, variables as in :data:`ringsweep.quantities.variables.HISTORY`, and the outcomes of
        the run as scalars. If laws are compared these have the dimension ``friction_law``, and the
        histories both: at the instants of all runs, NaN after the end of a run that ends early (where a
        classification stays as it was).

    Raises
    ------
    InputError
        If scene or solver are wrong.

    Examples
    --------
    >>> import ringsweep
    >>> scene = {
    ...     "model": "belt",
    ...     "body": {"mass": 1.0},
    ...     "spring": {"stiffness": 2.0},
    ...     "belt": {"velocity": 0.1},
    ...     "friction": {"law": "stiction", "mu_s": 0.15, "mu_k": 0.1},
    ...     "time": {"span": 60.0},
    ... }
    >>> run = ringsweep.simulate(scene)
    >>> run.attrs["outcome"]
    'stick-slip, t = 60 s'
    >>> run.x.max().round(6).item()
    0.74574
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
    return replace(config, solver=read_solver(method, config.scene), source=config.source | {"solver": method})


def history(config: Config, *, samples: int = SAMPLES) -> xr.Dataset:
    """Run a configuration with no axis but friction laws and keep the history; see :func:`simulate`."""
    outcome = compute(config, jobs=1, progress=False)
    runs = {}
    for law, structure in config.scene.structures.items():
        own = outcome.sel(friction_law=law) if config.axes.sizes else outcome
        runs[law] = _with_jump(_trace(config, structure, samples), own)
    if not config.axes.sizes:
        (kept,) = runs.values()
        words = describe(outcome)
    else:
        times = np.unique(np.concatenate([run["time"] for run in runs.values()]))
        kept = xr.concat([_resampled(run, times) for run in runs.values()], "friction_law")
        words = "\n".join(f"{law}: {describe(outcome.sel(friction_law=law))}" for law in runs)
    return kept.merge(outcome).assign_attrs(attributes(config) | {"outcome": words})


def _trace(config: Config, structure: Structure, samples: int) -> xr.Dataset:
    """History under one friction law, as the method stores it."""
    model = MODELS[structure.model]
    cell = batch(structure, {path: np.array([value]) for path, value in config.scene.values.items()})
    names = model.history(structure)
    times, rows = config.solver.history(cell, samples, len(names))
    columns = dict(zip(names, rows.T, strict=True))
    for name in columns:
        if name.startswith("normal_"):
            # Where friction jumps a contact may be asked to pull: there it lets go, and the run ends.
            columns[name][-1:] = np.maximum(columns[name][-1:], 0.0)
    if "ring_omega" in columns:
        drive = take(cell.drive, 0)
        columns["theta"] = np.array([turn(drive, t)[0] for t in times.tolist()])
    return xr.Dataset(
        {
            name: ("time", column.astype(HISTORY[name].dtype), HISTORY[name].attributes)
            for name, column in columns.items()
            if name not in model.absent
        },
        coords={"time": ("time", times, {"long_name": "time", "units": "s", "axis": "T"})},
    )


# Share of the largest reaction of the run from which on a contact has not been lost gradually.
_AT_ONCE = 1e-6


def _with_jump(run: xr.Dataset, outcome: xr.Dataset) -> xr.Dataset:
    """A history that ends with the contact open, where a jump of friction opened it: that instant stands twice."""
    lost = int(outcome.get("separating_contact", 0))
    names = [name for k, name in ((1, "normal_1"), (2, "normal_2")) if lost & k and name in run]
    largest = max((float(run[name].max()) for name in ("normal_1", "normal_2") if name in run), default=0.0)
    if not any(run[name][-1] > max(_AT_ONCE * largest, 1e-15) for name in names):
        return run
    after = run.isel(time=[-1]).assign({name: 0.0 * run[name][-1:] for name in names})
    return xr.concat([run, after], "time", data_vars="all", combine_attrs="override")


def _resampled(run: xr.Dataset, times: NDArray[np.float64]) -> xr.Dataset:
    """A history at other times: numbers from the line between two samples, classifications from the one before."""
    # Where an event stores two states of one instant, the second is the one that goes on.
    run = run.isel(time=np.append(np.diff(run["time"]) > 0.0, True))
    own = run["time"].values
    before = np.maximum(np.searchsorted(own, times, side="right") - 1, 0)
    found = run.isel(time=before).assign_coords(time=("time", times, run["time"].attrs))
    for name, data in run.items():
        if data.dtype.kind == "f":
            found[name] = found[name].copy(data=np.interp(times, own, data, right=np.nan))
    return found


def describe(outcome: xr.Dataset) -> str:
    """A run's outcome in words."""
    regime = REGIMES[int(outcome["regime"])]
    doubt = "" if outcome["certified"] == 1 else ", not certified"
    if "t_separation" in outcome and np.isfinite(outcome["t_separation"]):
        contact = ("no contact", "contact 1", "contact 2", "both contacts")[int(outcome["separating_contact"])]
        return (
            f"{regime} ({REGIMES[int(outcome['motion'])]}), {contact}, "
            f"t = {float(outcome['t_separation']):.6g} s{doubt}"
        )
    return f"{regime}, t = {float(outcome['t_end']):.6g} s{doubt}"
