"""Single runs with their history, under one friction law or several."""

from __future__ import annotations

import os
from collections.abc import Mapping
from functools import partial
from typing import Any

import numpy as np
import xarray as xr

from ringsweep.compile import readable_compile_errors, take
from ringsweep.config import Config, with_values
from ringsweep.errors import InputError
from ringsweep.models import batch, model_of
from ringsweep.models.scene import Structure
from ringsweep.physics.drives import turn
from ringsweep.physics.forces import Forced, Laden
from ringsweep.quantities.flags import AFTERMATHS, REGIMES
from ringsweep.quantities.variables import EVENTS, HISTORY, IMPACTS
from ringsweep.runs.events import Events, events, history_at, side_by_side
from ringsweep.runs.executors import Execution, interruptible
from ringsweep.runs.sweep import compute
from ringsweep.solvers.steps import tabulate_motion
from ringsweep.storage.provenance import attributes

#: Approximate number of instants of a history.
SAMPLES = 20_000

# Variables of impacts, and what the method calls them.
_IMPACTS = {"impact_time": "time", "impact_contact": "contact", "impact_speed": "speed", "impulse": "impulse"}


def simulate(
    scene: str | os.PathLike[str] | Mapping[str, Any],
    *,
    set: Mapping[str, Any] | None = None,  # noqa: A002  as --set
    solver: str | Mapping[str, Any] | None = None,
    samples: int = SAMPLES,
) -> xr.Dataset:
    """Run one scene and keep its history. If a configuration sweeps over friction laws, run it under each law.

    Parameters
    ----------
    scene : mapping or path
        The mapping under ``scene`` in a configuration, or a whole configuration, or the path of one. Axes other than
        a grid axis of friction laws are ignored.
    set : mapping of str to number or str, optional
        Values that replace those of the scene, by path, such as ``{"drive.amplitude": 4}``.
    solver : str or mapping, optional
        Name of a method, or the mapping under ``solver`` in a configuration; by default the solver of the
        configuration.
    samples : int
        Approximate number of instants to keep.

    Returns
    -------
    xarray.Dataset
        The history along the dimension ``time``, with variables of :data:`ringsweep.quantities.variables.HISTORY`,
        the events of the run along the dimension ``event`` (``ringsweep.runs.events.VARIABLES``), and the outcomes
        of the run as scalars. For several laws all also have the dimension ``friction_law``, and ``time`` holds the
        instants of all runs. After the end of a run numbers are NaN, and classifications keep their last value.

    Raises
    ------
    InputError
        If scene or solver are wrong.

    Warns
    -----
    Through the logger ``"ringsweep"``, as :func:`ringsweep.run` does.

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
    'stick-slip, t = 60 s, period 7.52342 s'
    >>> run.x.max().round(6).item()
    0.74574
    """
    if isinstance(scene, xr.Dataset):
        cure = "ds.ringsweep.simulate(drive_amplitude=2) runs a cell of it, ringsweep.plots.cell names the cell"
        raise InputError("scene", f"a configuration is expected, got a dataset: {cure}")
    if isinstance(scene, Mapping) and "scene" not in scene:
        scene = {"scene": scene}
    method = {"method": solver} if isinstance(solver, str) else solver
    return history(with_values(scene, (set or {}).items(), method), samples=samples)


def history(config: Config, *, samples: int = SAMPLES) -> xr.Dataset:
    """Run a configuration with no axis but friction laws and keep the history; see :func:`simulate`."""
    return interruptible(partial(_history, config, samples))


def _history(config: Config, samples: int) -> xr.Dataset:
    outcome = compute(config, Execution(1, progress=False))
    runs, tables = {}, {}
    for law, structure in config.scene.structures.items():
        own = outcome.sel(friction_law=law) if config.axes.sizes else outcome
        run, told = _trace(config, structure, samples)
        runs[law] = _open_contact_at_end(run, own)
        tables[law] = events(runs[law], own, told)
    if not config.axes.sizes:
        (joined,), (table,) = runs.values(), tables.values()
        words = _describe(outcome)
    else:
        times = np.unique(np.concatenate([run["time"] for run in runs.values()]))
        # Each law has impacts of its own.
        alone = [run.drop_dims("impact", errors="ignore") for run in runs.values()]
        joined = xr.concat([history_at(run, times) for run in alone], "friction_law")
        table = side_by_side(tables)
        words = "\n".join(f"{law}: {_describe(outcome.sel(friction_law=law))}" for law in runs)
    return joined.merge(outcome).merge(table).assign_attrs(attributes(config) | {"outcome": words})


def _trace(config: Config, structure: Structure, samples: int) -> tuple[xr.Dataset, list[Events]]:
    """History under one friction law, and events of open contacts."""
    model = model_of(structure)
    cell = batch(structure, {path: np.array([value]) for path, value in config.scene.values.items()})
    names = model.history(structure)
    with readable_compile_errors():
        times, rows = config.solver.history(cell, samples, len(names))
    columns = dict(zip(names, rows.T, strict=True))
    of_rows = {name.removeprefix("event_"): columns.pop(name) for name in names if name.startswith("event_")}
    told, impacts = list[Events](), dict[str, Any]()
    if of_rows:
        # An event stands in all rows until the next one; number 0 is none.
        numbers, first = np.unique(of_rows["number"], return_index=True)
        found = {name: column[first[numbers > 0]] for name, column in of_rows.items()}
        hits = found["event"] > 1
        for name, column in _IMPACTS.items():
            about = IMPACTS[name]
            impacts[name] = "impact", found[column][hits].astype(about.dtype), about.attributes
        for number, kind in EVENTS.items():
            own = found["event"] == number
            told.append(Events(kind, found["time"][own], found["contact"][own].astype(np.int8)))
    for name in columns:
        if name.startswith("normal_"):
            # Where friction jumps, a normal reaction may jump below zero. There the contact opens and the run ends.
            columns[name][-1:] = np.maximum(columns[name][-1:], 0.0)
    if model.driven:
        drive = take(cell.drive, 0)
        motion = np.empty((len(times), len(turn(drive, 0.0))))
        tabulate_motion(drive, times, motion)
        columns |= dict(zip(model.driven, motion.T, strict=False))
        if isinstance(drive, Forced | Laden):
            columns["force"] = motion[:, -1]
        if isinstance(drive, Laden):
            columns["load"] = motion[:, -2]
    variables = HISTORY | model.own_variables
    run = xr.Dataset(
        {
            name: ("time", column.astype(variables[name].dtype), variables[name].attributes)
            for name, column in columns.items()
            if name not in model.absent
        }
        | impacts,
        coords={"time": ("time", times, {"long_name": "time", "units": "s", "axis": "T"})},
    )
    return run, told


# A last normal reaction above this share of the largest of the run means that the reaction jumped to zero.
_JUMP = 1e-6


def _open_contact_at_end(run: xr.Dataset, outcome: xr.Dataset) -> xr.Dataset:
    """A history whose last instant stands twice if a jump of friction opened a contact: before and after the jump."""
    if "gap_1" in run:
        # The run goes on after the contact has opened.
        return run
    separating = int(outcome.get("separating_contact", 0))
    names = [name for k, name in ((1, "normal_1"), (2, "normal_2")) if separating & k and name in run]
    largest = max((float(run[name].max()) for name in ("normal_1", "normal_2") if name in run), default=0.0)
    if not any(run[name][-1] > max(_JUMP * largest, 1e-15) for name in names):
        return run
    after = run.isel(time=[-1]).assign({name: 0.0 * run[name][-1:] for name in names})
    return xr.concat([run, after], "time", data_vars="all", combine_attrs="override")


def _describe(outcome: xr.Dataset) -> str:
    """Outcome of a run in words."""
    happened = [name for name in ("t_separation", "period") if name in outcome and np.isfinite(outcome[name])]
    told = [REGIMES[int(outcome["regime"])]]
    if "t_separation" in happened:
        told[0] += f" ({REGIMES[int(outcome['motion'])]})"
        told.append(("no contact", "contact 1", "contact 2", "both contacts")[int(outcome["separating_contact"])])
        told.append(f"t = {float(outcome['t_separation']):.6g} s")
        if "aftermath" in outcome:
            lost, hits = int(outcome["separations"]), int(outcome["impacts"])
            told.append(f"then {AFTERMATHS[int(outcome['aftermath'])]}")
            told.append(f"with {lost} loss{'es' * (lost != 1)} of contact and {hits} impact{'s' * (hits != 1)}")
    else:
        told.append(f"t = {float(outcome['t_end']):.6g} s")
        told += [f"period {float(outcome['period']):.6g} s"] if happened else []
    return ", ".join(told + ["not certified"] * (outcome["certified"].item() != 1))
