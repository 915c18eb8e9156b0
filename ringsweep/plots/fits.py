"""Picture of a fit: measurements, residuals, and the profile of each parameter."""

from __future__ import annotations

import math
import textwrap
from typing import Any

import numpy as np
import xarray as xr
from matplotlib.figure import Figure

from ringsweep.errors import InputError
from ringsweep.plots.look import PAIR_COLOURS, SMALL, figure_width, legend_above, on_page, small_ticks
from ringsweep.quantities.quantity import after_number

# Least height of the picture, inches.
_LEAST_HEIGHT = 4.6


def fit(ds: xr.Dataset) -> Figure:
    """Draw a fit: measured and fitted history, residuals, and the misfit over each parameter.

    Parameters
    ----------
    ds : xarray.Dataset
        Result of :func:`ringsweep.fit`.

    Returns
    -------
    matplotlib.figure.Figure

    Raises
    ------
    InputError
        If the dataset is no fit.

    Examples
    --------
    >>> import numpy as np
    >>> import xarray as xr
    >>> history = {
    ...     name: ("measurement", np.zeros(3), {"units": "m", "long_name": name})
    ...     for name in ("measured", "fitted", "residual")
    ... }
    >>> profile = ("parameter", "profile"), np.array([[4.0, 0.0, 4.0]])
    >>> numbers = {"value": 0.15, "profile_low": 0.1, "profile_high": 0.2}
    >>> ends = {name: ("parameter", [number]) for name, number in numbers.items()}
    >>> ds = xr.Dataset(
    ...     history | ends | {"profile_value": profile, "profile_misfit": profile, "misfit": 0.0},
    ...     coords={"parameter": ["v"], "unit": ("parameter", ["m/s"]), "t": ("measurement", [0.0, 1.0, 2.0])},
    ...     attrs={"noise": 1.0},
    ... )
    >>> len(fit(ds).axes)
    3
    """
    if not {"measured", "fitted", "profile_misfit"} <= set(ds):
        raise InputError("ds", "is no fit: ringsweep fit makes one")
    width, count = figure_width(), ds.sizes["parameter"]
    figure = Figure(figsize=(width, max(0.95 * width, _LEAST_HEIGHT)), layout="constrained")
    parts: Any = figure.subfigures(2, 1, height_ratios=[3, 2])
    above, below = parts
    data, rest = above.subplots(2, 1, sharex=True, height_ratios=[3, 2])
    one, two = (on_page(colour) for colour in PAIR_COLOURS)
    time, unit = ds["t"].values, ds["measured"].attrs["units"]
    data.plot(time, ds["measured"].values, ".", color=two, markersize=3, label="measured")
    data.plot(time, ds["fitted"].values, color=one, label="fitted")
    name = textwrap.fill(str(ds["fitted"].attrs["long_name"]).removeprefix("fitted "), 18)
    data.set_ylabel(f"{name} ({unit})", fontsize=SMALL)
    legend_above(data)
    rest.axhline(0.0, color=one, linewidth=1.0)
    rest.plot(time, ds["residual"].values, ".", color=two, markersize=3)
    rest.set_xlabel("time (s)", fontsize=SMALL)
    rest.set_ylabel(f"residual ({unit})", fontsize=SMALL)
    panels = np.atleast_1d(below.subplots(1, count, sharey=True))
    for k, ax in enumerate(panels):
        own = ds.isel(parameter=k)
        growth = (own["profile_misfit"].values - float(ds["misfit"])) / ds.attrs["noise"] ** 2
        known = np.isfinite(growth)
        # Profiles are narrow: ticks of the values themselves would differ in their last digits only.
        fitted = float(own["value"])
        apart = own["profile_value"].values[known] - fitted
        power = math.floor(math.log10(float(np.abs(apart).max(initial=0.0)) or 1.0))
        scale = 10.0**power
        ax.plot(apart / scale, growth[known], ".-", color=one)
        for name in ("profile_low", "profile_high"):
            if np.isfinite(own[name]):
                ax.axvline((float(own[name]) - fitted) / scale, color=two, linestyle="--", linewidth=1.0)
        # Digits of the value that its profile does not tell would be rounding.
        label = f"{own['parameter'].item().rpartition('.')[2]} \N{MINUS SIGN}\n{fitted:.{max(2 - power, 0)}f}"
        unit = after_number(str(own["unit"].item()))
        ax.set_xlabel(f"{label}\n($10^{{{power}}}${unit})", fontsize=SMALL)
        ax.locator_params(axis="x", nbins=4)
    panels[0].set_ylabel("growth of the misfit\n(squares of the noise)", fontsize=SMALL)
    small_ticks(data, rest, *panels)
    return figure
