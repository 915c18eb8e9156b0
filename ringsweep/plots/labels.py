"""Names, units and values of quantities as text for a picture."""

from __future__ import annotations

import re

import xarray as xr
from matplotlib.axis import Axis

from ringsweep.plots.datasets import is_numeric
from ringsweep.plots.style import angle_unit

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


def display_factor(data: xr.DataArray) -> float:
    """Factor from the numbers of a quantity to the numbers in a picture, which has the unit of angles of the style."""
    return angle_unit()[0] if data.attrs.get("units") == "rad" else 1.0


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
    units = angle_unit()[1] if units == "rad" else "" if units == "1" else units
    # Parameters have "m/s^2" where variables have "m s-2".
    units = re.sub(r"/([A-Za-z]+)\^?(\d*)", lambda unit: f" {unit[1]}-{unit[2] or 1}", units)
    return re.sub(r"(?<=[A-Za-z])\^?(-?\d+)", r"$^{\1}$", units)


def value_text(value: xr.DataArray) -> str:
    """One value of a coordinate with its name and unit."""
    return f"{long_name(value)} = {amount_text(value) if is_numeric(value) else value.item()}"


def amount_text(value: xr.DataArray, digits: int = 4) -> str:
    """One number with its unit."""
    unit = unit_text(value)
    number = number_text(value.item() * display_factor(value), f".{digits}g")
    return f"{number}{unit if unit == '°' else f' {unit}'.rstrip()}"


def plain_text(text: str) -> str:
    """Text with powers as characters, where nothing draws those of matplotlib."""
    return re.sub(r"\$\^\{(.*?)\}\$", lambda power: power[1].translate(_SUPERSCRIPTS), text)
