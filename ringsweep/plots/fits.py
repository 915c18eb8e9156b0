"""Picture of a fit: measurements, the fitted history, residuals."""

from __future__ import annotations

import textwrap

import xarray as xr
from matplotlib.figure import Figure

from ringsweep.errors import InputError
from ringsweep.plots import look
from ringsweep.plots.labels import displayed, long_name, unit_text


def fit(ds: xr.Dataset) -> Figure:
    """Draw a fit: measured and fitted history, and residuals.

    Parameters
    ----------
    ds : xarray.Dataset
        Content of a file that ``ringsweep fit`` wrote. What :func:`ringsweep.fit` returns has a method ``plot``.

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
    >>> about = {"units": "m", "long_name": "displacement"}
    >>> names = ("measured", "fitted", "residual")
    >>> ds = xr.Dataset({name: ("measurement", np.zeros(3), about) for name in names})
    >>> len(fit(ds.assign_coords(t=("measurement", [0.0, 1.0, 2.0]))).axes)
    2
    """
    if not {"measured", "fitted"} <= set(ds):
        raise InputError("ds", "is no fit: ringsweep fit makes one")
    figure = look.picture(look.figure_width(), 0.7 * look.figure_width())
    data, rest = figure.subplots(2, 1, sharex=True, height_ratios=[3, 2])
    one, two = look.pair(0), look.pair(1)
    time, unit = ds["t"].values, unit_text(ds["measured"])
    measured, fitted, residual = (displayed(ds[name]).values for name in ("measured", "fitted", "residual"))
    data.plot(time, measured, ".", color=two, markersize=3, label="measured")
    data.plot(time, fitted, color=one, label="fitted")
    data.set_ylabel(f"{textwrap.fill(long_name(ds['measured']), 18)} ({unit})", fontsize=look.SMALL)
    look.legend_above(data)
    rest.axhline(0.0, color=one, linewidth=1.0)
    rest.plot(time, residual, ".", color=two, markersize=3)
    rest.set_xlabel("time (s)", fontsize=look.SMALL)
    rest.set_ylabel(f"residual ({unit})", fontsize=look.SMALL)
    look.small_ticks(data, rest)
    return figure
