"""Names, units and values of quantities as text for a picture."""

from __future__ import annotations

import re
from collections.abc import Mapping
from contextlib import suppress
from typing import Any

import xarray as xr
from matplotlib.axis import Axis

from ringsweep.errors import InputError
from ringsweep.plots import look
from ringsweep.plots.datasets import is_numeric, resolve
from ringsweep.quantities.parameters import Parameter
from ringsweep.quantities.units import quantity
from ringsweep.quantities.variables import common_unit, configuration_of, leaves, swept, written_unit

MINUS = "\N{MINUS SIGN}"
TIMES = "\N{MULTIPLICATION SIGN}"

# Limits above which an axis has the prefix, and the prefixes; a tenth of a unit needs none.
_PREFIXES = ((0.05, ""), (1e-3, "m"), (1e-6, "µ"), (1e-9, "n"))


_SUPERSCRIPTS = str.maketrans("0123456789-", "⁰¹²³⁴⁵⁶⁷⁸⁹⁻")


def number_text(value: float, form: str = ".3g") -> str:
    """A number with a true minus sign and a power of ten in place of ``e``, as ticks of axes have them.

    Examples
    --------
    >>> number_text(1e6), number_text(1e-6)
    ('10⁶', '10⁻⁶')
    """
    digits, _, power = format(value, form).partition("e")
    text = digits.replace("-", MINUS)
    if power:
        ten = "10" + str(int(power)).translate(_SUPERSCRIPTS)
        text = f"{text}{TIMES}{ten}" if digits.lstrip("-") != "1" else text[:-1] + ten
    return text


def label_axis(axis: Axis, name: str, unit: str) -> None:
    """Label an axis of numbers in SI units; small numbers are shown in thousandths, millionths or billionths.

    Parameters
    ----------
    axis : matplotlib.axis.Axis
        Axis with its limits.
    name, unit : str
        What the label says; the unit takes the prefix.
    """
    largest = max(map(abs, axis.get_view_interval()))
    factor, prefix = next((pair for pair in _PREFIXES if largest >= pair[0]), (1.0, ""))
    if prefix:
        axis.set_major_formatter(lambda value, _: number_text(value / factor, ".6g"))
    axis.set_label_text(f"{name} ({prefix}{unit})")


def in_units(ds: xr.Dataset, units: Mapping[str, str] | None = None) -> xr.Dataset:
    """A dataset whose quantities tell in which unit pictures show them; its numbers stay SI.

    A swept quantity has the unit in which its configuration wrote it, a length of the runs that of the lengths in the
    scene. Angles have the unit of the style.

    Parameters
    ----------
    ds : xarray.Dataset
        Result of a sweep.
    units : mapping of str to str, optional
        Units of some quantities, which the user wants.

    Raises
    ------
    InputError
        If a name is unknown, or the unit does not fit.
    """
    ds = ds.copy()
    if "configuration" in ds.attrs:
        source = configuration_of(ds)
        for coordinate in swept(ds):
            unit = written_unit(source, str(coordinate.attrs["path"]))
            if unit and is_numeric(coordinate) and coordinate.attrs.get("units") != "rad":
                # The user may have changed the unit of the coordinate since.
                with suppress(InputError):
                    _show_in(ds, str(coordinate.name), unit)
        length = common_unit(value for value in leaves(source.get("scene")) if _is_length(value))
        for name in ds.data_vars:
            if length and ds[name].attrs.get("units") == "m":
                _show_in(ds, str(name), length)
    for name, unit in (units or {}).items():
        if not isinstance(unit, str):
            raise InputError(f"units.{name}", f"{unit!r} is no unit: give its name, such as 'mm'")
        _show_in(ds, resolve("units", name, ds.variables), unit)
    return ds


def _is_length(value: Any) -> bool:
    try:
        return isinstance(value, str) and quantity(value, Parameter("m", "length"), "scene") is not None
    except InputError:
        return False


def _show_in(ds: xr.Dataset, name: str, unit: str) -> None:
    """Show a quantity in a unit from now on; InputError if the unit does not fit."""
    si = str(ds[name].attrs.get("units", "1"))
    one = quantity(f"1 {unit}", Parameter(si, f"unit of {name}"), f"units.{name}")
    if one != 1.0 or si == "rad":
        ds[name].attrs |= {"display_units": unit, "display_factor": 1.0 / one}


def display_factor(data: xr.DataArray) -> float:
    """Factor from the numbers of a quantity to those in a picture, in the unit of :func:`in_units` or of the style."""
    if "display_factor" in data.attrs:
        return float(data.attrs["display_factor"])
    return look.angle_unit()[0] if data.attrs.get("units") == "rad" else 1.0


def displayed(data: xr.DataArray) -> xr.DataArray:
    """A quantity in the unit that pictures show."""
    factor = display_factor(data)
    return data if factor == 1.0 else (data * factor).assign_attrs(data.attrs)


def long_name(data: xr.DataArray) -> str:
    """Name of a quantity for readers."""
    return str(data.attrs.get("long_name", data.name))


def axis_label(data: xr.DataArray, ds: xr.Dataset) -> str:
    """Name of a quantity with its unit."""
    name = long_name(data)
    # Coefficients of two zones, for example, have the same long name.
    if sum(long_name(other) == name for other in ds.coords.values()) > 1:
        name = f"{name}, {data.name}"
    unit = unit_text(data)
    return f"{name} ({unit})" if unit else name


def unit_text(data: xr.DataArray) -> str:
    """Unit of a quantity in a picture, empty if it has none."""
    units = str(data.attrs.get("units", "1"))
    if "display_units" in data.attrs:
        units = {"deg": "°", "degree": "°"}.get(data.attrs["display_units"], data.attrs["display_units"])
    else:
        units = look.angle_unit()[1] if units == "rad" else "" if units == "1" else units
    # Parameters have "m/s^2" where variables have "m s-2".
    units = re.sub(r"/([A-Za-z]+)\^?(\d*)", lambda unit: f" {unit[1]}-{unit[2] or 1}", units)
    return re.sub(r"(?<=[A-Za-z])\^?(-?\d+)", r"$^{\1}$", units)


def value_text(value: xr.DataArray) -> str:
    """One value of a coordinate with its name and unit; a word of a sampled sweep stands alone."""
    if value.name == "word":
        return str(value.item())
    return f"{long_name(value)} = {amount_text(value) if is_numeric(value) else value.item()}"


def amount_text(value: xr.DataArray, digits: int = 4) -> str:
    """One number with its unit."""
    unit = unit_text(value)
    number = number_text(value.item() * display_factor(value), f".{digits}g")
    return f"{number}{unit if unit == '°' else f' {unit}'.rstrip()}"


def plain_text(text: str) -> str:
    """Text with powers as characters, where nothing draws those of matplotlib."""
    return re.sub(r"\$\^\{(.*?)\}\$", lambda power: power[1].translate(_SUPERSCRIPTS), text)
