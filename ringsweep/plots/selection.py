"""Cells of a sweep: coordinates held at a value, and the configuration of one cell."""

from __future__ import annotations

import logging
from collections.abc import Iterator, Mapping
from typing import Any

import numpy as np
import xarray as xr

from ringsweep.errors import InputError
from ringsweep.plots.datasets import is_numeric, resolve
from ringsweep.plots.labels import amount_text, long_name, plain_text, value_text
from ringsweep.quantities.parameters import Parameter
from ringsweep.quantities.units import quantity
from ringsweep.quantities.variables import configuration_of, swept

logger = logging.getLogger("ringsweep")


def cell(ds: xr.Dataset, sel: Mapping[str, float | str] | None = None) -> dict[str, Any]:
    """The configuration of one cell of a sweep, as :func:`ringsweep.simulate` takes it.

    Parameters
    ----------
    ds : xarray.Dataset
        Result of a sweep, or a part of it. Coordinates that ``ds.isel(...)`` has fixed stay fixed.
    sel : mapping of str to float or str, optional
        Coordinates held at the value nearest to the one given, which must lie within the axis: a plain number is SI,
        text may have a unit. A warning states the value taken if it is another.

    Returns
    -------
    dict
        The configuration of the sweep with the values of the cell, and nothing swept. A cell of a sweep that follows
        an axis has the state in which it started as initial values.

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
    from ringsweep.config import load, with_values

    whole, given = ds.drop_dims("section", errors="ignore"), configuration_of(ds)
    numbered = whole.assign({f"index of {dim}": (dim, np.arange(size)) for dim, size in whole.sizes.items()})
    one, _ = select(numbered, sel or {})
    if one.sizes:
        left = ", ".join(f"{dim} ({size})" for dim, size in one.sizes.items())
        raise InputError("sel", f"one cell is wanted, but {left} is left: hold it too")
    settings = {coordinate.attrs["path"]: coordinate.item() for coordinate in swept(one)}
    if given.get("sweep", {}).get("follow"):
        from ringsweep.runs.cells import start_of

        config = load(given)
        if any(whole.sizes.get(dim) != size for dim, size in config.axes.sizes.items()):
            raise InputError("ds", "is a part of a sweep that follows an axis, but a cell starts from those before it")
        settings |= start_of(whole, config, {dim: int(one[f"index of {dim}"]) for dim in config.axes.sizes})
    return with_values(given, settings.items()).source


def select(ds: xr.Dataset, sel: Mapping[str, float | str]) -> tuple[xr.Dataset, list[str]]:
    """Hold coordinates at the nearest value, and warn where that is not the value given.

    Returns
    -------
    xarray.Dataset
        Without the dimensions that are held.
    list of str
        Names and values of the coordinates held, for a title.
    """
    texts = []
    for wanted, coordinate, index, asked in _places(ds, sel):
        ds = ds.isel({coordinate.dims[0]: index})
        text = value_text(coordinate[index])
        if asked is not None:
            taken, given = _told_apart(coordinate[index], asked)
            told = "%s: %s is not in the dataset: the nearest value is taken, %s"
            logger.warning(told, wanted, plain_text(given), plain_text(taken))
            text = f"{long_name(coordinate)} = {taken} (nearest to {given})"
        texts.append(text)
    return ds, texts


def select_grid(ds: xr.Dataset, sel: Mapping[str, float | str]) -> tuple[xr.Dataset, dict[str, float]]:
    """Hold axes of a grid, and find the values given that it lacks.

    Returns
    -------
    xarray.Dataset
        Without the dimensions that are held, at the nearest values.
    dict of str to float
        The values given of those coordinates whose nearest value is another.

    Raises
    ------
    InputError
        If a name is unknown, a value lies outside its axis, or a value that is missing is not that of an axis of one
        number: a run could not have it alone.
    """
    missing = {}
    for wanted, coordinate, index, asked in _places(ds, sel):
        dim = str(coordinate.dims[0])
        if asked is not None:
            taken, given = map(plain_text, _told_apart(coordinate[index], asked))
            if [one.name for one in swept(ds) if dim in one.dims] != [dim]:
                problem = f"{given} is not in the dataset, and {dim} is no axis of one number: give {taken}"
                raise InputError(f"sel.{wanted}", problem)
            logger.info("%s: %s is not in the dataset: the cells there are run", wanted, given)
            missing[dim] = asked
        ds = ds.isel({dim: index})
    return ds, missing


def _places(ds: xr.Dataset, sel: Mapping[str, float | str]) -> Iterator[tuple[str, xr.DataArray, int, float | None]]:
    """Where coordinates are held.

    Yields
    ------
    str
        Name as given.
    xarray.DataArray
        The coordinate.
    int
        Index of its nearest value.
    float or None
        The value given, in SI units, if it differs from the nearest by more than rounding.
    """
    for wanted, value in sel.items():
        name = resolve("sel", wanted, [n for n in {**ds.sizes, **ds.coords} if n in ds.dims or ds[n].ndim == 1])
        coordinate = ds[name]
        asked = None
        if is_numeric(coordinate):
            number = quantity(value, _range_of(coordinate), f"sel.{wanted}")
            index = int(np.nanargmin(np.abs(coordinate.values - number)))
            # A value between others is rounded as they are: 0 of linspace(-1, 1, 21) may be 1e-16.
            rounding = 4.0 * np.finfo(float).eps * np.nanmax(np.abs(coordinate.values))
            if not np.isclose(coordinate.values[index], number, rtol=1e-12, atol=rounding):
                asked = number
        else:
            names = [str(one) for one in coordinate.values]
            index = names.index(resolve("sel", str(value), names))
        yield wanted, coordinate, index, asked
        ds = ds.isel({coordinate.dims[0]: index})


def _told_apart(taken: xr.DataArray, asked: float) -> tuple[str, str]:
    """Texts of the value taken and of the value asked for, with as many digits as they need to differ."""
    one = taken.astype(float)
    pairs = ((amount_text(one, digits), amount_text(one.copy(data=asked), digits)) for digits in (4, 8, 17))
    return next(pair for pair in pairs if pair[0] != pair[1])


def _range_of(coordinate: xr.DataArray) -> Parameter:
    """Unit and range of the values at which a coordinate can be held."""
    values = coordinate.values[np.isfinite(coordinate.values)]
    low, high = float(values.min()), float(values.max())
    # A user who types an end of the axis in degrees types few digits.
    slack = 1e-4 * ((high - low) or abs(high))
    return Parameter(str(coordinate.attrs.get("units", "1")), long_name(coordinate), low - slack, high + slack)
