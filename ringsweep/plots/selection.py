"""Cells of a sweep: coordinates held at a value, and the configuration of one cell."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
import xarray as xr

from ringsweep.errors import InputError
from ringsweep.plots.datasets import configuration, is_numeric, resolve, swept
from ringsweep.plots.labels import long_name, value_text
from ringsweep.quantities.parameters import Parameter
from ringsweep.quantities.units import quantity


def cell(ds: xr.Dataset, sel: Mapping[str, float | str] | None = None) -> dict[str, Any]:
    """The configuration of one cell of a sweep, as :func:`ringsweep.simulate` takes it.

    Parameters
    ----------
    ds : xarray.Dataset
        Result of a sweep, or a part of it. Coordinates that ``ds.isel(...)`` has fixed stay fixed.
    sel : mapping of str to float or str, optional
        Coordinates held at the value nearest to the one given, which must lie within the axis: a plain number is SI,
        text may have a unit.

    Returns
    -------
    dict
        The configuration of the sweep with the values of the cell, and nothing swept.

    Raises
    ------
    InputError
        If a name is unknown, more than one cell is left, or the dataset has no attribute ``configuration``.

    Examples
    --------
    >>> import ringsweep
    >>> from ringsweep.config import load
    >>> scene = load("my-sweep.yaml").source["scene"]
    >>> maps = ringsweep.sweep(scene, {"drive.amplitude": [1.0, 2.0], "zone.half_angle": ["10 deg", "20 deg"]})
    >>> cell(maps, {"drive.amplitude": 1.9, "zone.half_angle": 0.2})["scene"]["drive"]
    {'law': 'arctan', 'amplitude': 2.0}
    """
    # Models are slow to import, and a map, which uses `select`, needs none.
    from ringsweep.config import with_values

    ds, _ = select(ds, sel or {})
    if ds.sizes:
        left = ", ".join(f"{dim} ({size})" for dim, size in ds.sizes.items())
        raise InputError("sel", f"one cell is wanted, but {left} is left: hold it too")
    # A number as text keeps all its digits.
    settings = [f"{coordinate.attrs['path']}={coordinate.item()}" for coordinate in swept(ds)]
    return with_values(configuration(ds), settings).source


def select(ds: xr.Dataset, sel: Mapping[str, float | str]) -> tuple[xr.Dataset, list[str]]:
    """Hold coordinates at the nearest value.

    Returns
    -------
    xarray.Dataset
        Without the dimensions that are held.
    list of str
        Names and values of the coordinates held, for a title.
    """
    held = []
    for wanted, value in sel.items():
        name = resolve("sel", wanted, [n for n in {**ds.sizes, **ds.coords} if n in ds.dims or ds[n].ndim == 1])
        coordinate = ds[name]
        if is_numeric(coordinate):
            number = quantity(value, _range_of(coordinate), f"sel.{wanted}")
            index = int(np.nanargmin(np.abs(coordinate.values - number)))
        else:
            names = [str(one) for one in coordinate.values]
            index = names.index(resolve("sel", str(value), names))
        ds = ds.isel({coordinate.dims[0]: index})
        held.append(value_text(coordinate[index]))
    return ds, held


def _range_of(coordinate: xr.DataArray) -> Parameter:
    """Unit and range of the values at which a coordinate can be held."""
    values = coordinate.values[np.isfinite(coordinate.values)]
    low, high = float(values.min()), float(values.max())
    # A user who types an end of the axis in degrees types few digits.
    slack = 1e-4 * ((high - low) or abs(high))
    return Parameter(str(coordinate.attrs.get("units", "1")), long_name(coordinate), low - slack, high + slack)
