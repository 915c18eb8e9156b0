"""What a dataset holds. Only this module tells kinds of datasets and of bodies apart.

A dataset made by hand has no attributes. So names of dimensions and variables decide.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from contextlib import suppress
from itertools import chain
from typing import Any

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from ringsweep.errors import InputError, nearest_name
from ringsweep.plots.look import angle_unit
from ringsweep.quantities.quantity import after_number
from ringsweep.quantities.variables import HISTORY, MODES, configuration_of, swept, written

#: Panels of a history by the variable that says where the body is: ``phi`` in a ring, ``x`` on a belt, ``x_1`` of two.
#: Variables of one tuple share a panel.
PANELS: dict[str, tuple[tuple[str, ...], ...]] = {
    "phi": (
        *(("phi",), ("omega", "ring_omega"), ("epsilon",), ("normal_1", "normal_2")),
        *(("gap_1", "gap_2"), ("impact_speed",)),
    ),
    "x": (("x",), ("velocity", "belt_velocity"), ("friction_force",)),
    "x_1": (("x_1", "x_2"), ("velocity_1", "velocity_2"), ("friction_force_1", "friction_force_2")),
}

#: What pictures show in place of the mode of friction while one of two contacts is open, and while none holds.
PIVOT, FLIGHT = 2, 3


# What a picture says of a scene: path, and the words before its value.
_TOLD = {
    "friction.law": "",
    "drive.law": "drive ",
    "drive.amplitude": "amplitude ",
    "zone.half_angle": "zone \N{PLUS-MINUS SIGN}",
    "belt.velocity": "belt ",
    "time.span": "span ",
}


_NO_SWEEPS = (
    ("time", "the time history of one run", "history"),
    ("contender", "error against run time", "work_precision"),
)


def require_sweep(ds: xr.Dataset) -> None:
    """Refuse a dataset that is no sweep.

    Raises
    ------
    InputError
        If it holds the history of a run, or error against run time, or if it is one variable only.
    """
    if not hasattr(ds, "data_vars"):
        call = f"regime_map(ds, var={str(ds.name)!r})"
        raise InputError("ds", f"a dataset is expected, got one variable: {call} draws it")
    for dim, what, draws in _NO_SWEEPS:
        if dim in ds.dims:
            raise InputError("ds", f"is {what}, not a sweep; ringsweep plot draws it, or plots.{draws}")


#: Dimensions that a sampled sweep has within a cell.
WITHIN = ("word", "parameter", "quantile", "survival_time", "replicate", "certificate", "sum", "sample")


def is_sampled(ds: xr.Dataset) -> bool:
    """Whether a dataset holds probabilities, and no runs."""
    return "word" in ds.coords and "probability" in ds


def mapped(ds: xr.Dataset, var: str, sel: Mapping[str, Any]) -> tuple[xr.Dataset, str]:
    """What a map shows, and its variable: of a sampled sweep the probability, of the regimes that occur."""
    if is_sampled(ds):
        var = "probability" if var == "regime" else var
        if "word" not in sel and "word" in ds.dims:
            occurs = ds["probability"] > 0.0
            ds = ds.isel(word=occurs.any([dim for dim in occurs.dims if dim != "word"]).values)
    return ds, resolve("var", var, numeric_names(ds))


def require_sample(ds: xr.Dataset, name: str) -> xr.Dataset:
    """One cell of a sampled sweep that has a variable.

    Raises
    ------
    InputError
        If the dataset is no sampled sweep, lacks the variable, or has several cells.
    """
    if not is_sampled(ds):
        raise InputError("ds", "is no sampled sweep: sweep.sample in a configuration makes one")
    if name not in ds:
        key = {"sobol_first": "sensitivity: true", "survival": "survival: [times]"}.get(name, name)
        raise InputError("ds", f"has no {name}: run it with `{key}` in sweep.sample")
    grid = [str(dim) for dim in ds[name].dims if dim not in WITHIN]
    single = ds.isel({dim: 0 for dim in grid if ds.sizes[dim] == 1})
    if left := [f"{dim} ({ds.sizes[dim]})" for dim in grid if ds.sizes[dim] > 1]:
        raise InputError("ds", f"has several cells: hold {', '.join(left)}, by --sel or ds.isel(...)")
    return single


def require_history(ds: xr.Dataset) -> xr.Dataset:
    """The history of a run, or of one run under each of several friction laws.

    Returns
    -------
    xarray.Dataset
        `ds`; without the dimension ``friction_law`` if that has one value.

    Raises
    ------
    InputError
        If the dataset has no dimension ``time``, or no instant.
    """
    if not ds.sizes.get("time"):
        draws = "ringsweep map draws a sweep, or plots.regime_map"
        raise InputError("ds", f"has no dimension time: it is not the history of a run; {draws}")
    return ds.isel(friction_law=0) if ds.sizes.get("friction_law") == 1 else ds


def outcome(ds: xr.Dataset) -> str:
    """Outcome of a run in words; empty if the dataset does not have it."""
    lines = str(ds.attrs.get("outcome", "")).splitlines()
    if "friction_law" in ds.coords and ds["friction_law"].ndim == 0:
        # The run under one of several laws.
        lines = [line for line in lines if line.startswith(f"{ds['friction_law'].item()}: ")]
    return "\n".join(lines)


def require_one_run(ds: xr.Dataset, names: tuple[str, ...]) -> xr.Dataset:
    """The history of one run up to its end, with the variables that a picture needs.

    Parameters
    ----------
    ds : xarray.Dataset
        Any dataset.
    names : tuple of str
        Variables that must be there. The first is the place of the body.

    Raises
    ------
    InputError
        If the dataset is not the history of one run, or a variable is missing.
    """
    ds = require_history(ds)
    if compares_laws(ds):
        laws = ", ".join(map(str, ds["friction_law"].values))
        raise InputError("ds", f"holds a run under each of {laws}: choose one, by --law or ds.sel(friction_law=...)")
    for name in names:
        if name not in ds:
            what = HISTORY[name].long_name
            raise InputError("ds", f"has no {name}, {what}: if an earlier version wrote it, run it again")
    return ds.isel(time=np.isfinite(ds[names[0]].values))


def compares_laws(ds: xr.Dataset) -> bool:
    """Whether a history has a run under each of several friction laws."""
    return "friction_law" in ds.dims


def on_ring(ds: xr.Dataset) -> bool:
    """Whether a history is that of a body in a ring; else the body is on a belt."""
    return "phi" in ds


def panels_of(ds: xr.Dataset) -> list[tuple[str, ...]]:
    """Variables of each panel of a history; panels of which the dataset has no variable are left out.

    Raises
    ------
    InputError
        If the dataset has no variable of any panel.
    """
    panels = [panel for panel in PANELS[next((name for name in PANELS if name in ds), "x")] if present(ds, panel)]
    if not panels:
        raise InputError("ds", f"has no variable that a history shows: {', '.join(chain(*chain(*PANELS.values())))}")
    if not compares_laws(ds):
        return panels
    # Ring and belt move alike under all laws.
    return [(name,) for name in present(ds, chain(*panels)) if name not in ("ring_omega", "belt_velocity")]


def zones(ds: xr.Dataset) -> list[str]:
    """Variables that say which zone lies under each contact; a history of several laws has no such strip."""
    return [] if compares_laws(ds) else present(ds, ("zone_1", "zone_2"))


def phases(ds: xr.Dataset) -> NDArray[Any]:
    """Mode of friction from each instant of a run to the next, or ``PIVOT`` or ``FLIGHT``."""
    mode, is_open = ds["mode"].values, open_contacts(ds)
    if not is_open:
        return np.asarray(mode)
    return np.select([np.all(is_open, axis=0), np.any(is_open, axis=0)], [FLIGHT, PIVOT], mode)


def open_contacts(ds: xr.Dataset) -> list[NDArray[np.bool_]]:
    """Whether each contact is open from each instant of a run to the next; empty if the run has no gaps."""
    gaps = [ds[name].values for name in present(ds, ("gap_1", "gap_2"))]
    # A contact that rebounds is open before and after an instant without a gap.
    return [np.maximum(gap, np.append(gap[1:], 0.0)) > 0.0 for gap in gaps]


def mode_name(mode: float) -> str:
    """Name of a mode of friction, or of what takes its place, for readers."""
    return (MODES | {PIVOT: "one_contact_open", FLIGHT: "flight"})[int(mode)].replace("_", " ")


def present(ds: xr.Dataset, names: Iterable[str]) -> list[str]:
    """Those of the names that are in the dataset."""
    return [name for name in names if name in ds]


def is_numeric(data: xr.DataArray) -> bool:
    """Whether the values are numbers; names of friction laws are not."""
    return data.dtype.kind in "iuf"


def numeric_names(ds: xr.Dataset) -> list[str]:
    """Names of the variables that are numbers."""
    return [str(name) for name, data in ds.data_vars.items() if is_numeric(data)]


def scene_text(ds: xr.Dataset) -> list[str]:
    """What a picture says of the scene, as the user wrote it: law, drive, zone, belt, span, if they were not swept."""
    if "configuration" not in ds.attrs:
        return []
    source = configuration_of(ds)
    swept_here = {str(c.attrs["path"]) for c in swept(ds)}
    values = {path: written(source, path) for path in _TOLD if path not in swept_here}
    plain = {path: value for path, value in values.items() if isinstance(value, int | float)}
    units = dict.fromkeys(plain, "1")
    if plain:
        # Only plain numbers need the models, which are slow to import.
        from ringsweep.config import load, sweepable

        with suppress(InputError):
            known = sweepable(load(source).scene)
            units |= {path: getattr(known[path], "unit", "1") for path in plain}
    for path, value in plain.items():
        factor, unit = angle_unit() if units[path] == "rad" else (1.0, after_number(units[path]))
        values[path] = f"{factor * value:.4g}{unit}"
    return [f"{_TOLD[path]}{value}" for path, value in values.items() if value is not None]


def resolve(argument: str, name: str, available: Iterable[Any]) -> str:
    """The name in the dataset that the user means; the user may write dots for underscores.

    Raises
    ------
    InputError
        If there is no such name. The message suggests the most similar one.
    """
    wanted, names = name.replace(".", "_"), [str(one) for one in available]
    if wanted in names:
        return wanted
    near = nearest_name(wanted, names)
    hint = f"; did you mean {near}?" if near else ""
    raise InputError(argument, f"{name!r} is not in the dataset, which has {', '.join(names) or 'none'}{hint}")
