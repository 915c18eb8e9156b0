"""Pictures of one cell of a sampled sweep: probabilities, survival, Sobol indices."""

from __future__ import annotations

from typing import Any

import numpy as np
import xarray as xr
from matplotlib import patches, rcParams, ticker
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from numpy.typing import NDArray

from ringsweep.errors import InputError
from ringsweep.plots import look
from ringsweep.plots.datasets import require_sample


def probability_panel(ds: xr.Dataset, ax: Axes | None = None) -> Axes:
    """Draw the probability of each regime that occurs, with its 95 % interval.

    Parameters
    ----------
    ds : xarray.Dataset
        One cell of a sampled sweep.
    ax : matplotlib.axes.Axes, optional
        Axes to draw in, by default pyplot's current ones.

    Returns
    -------
    matplotlib.axes.Axes

    Raises
    ------
    InputError
        If the dataset is no sampled sweep, or has several cells.

    Examples
    --------
    >>> import xarray as xr
    >>> share = xr.DataArray([0.7, 0.3], dims="word")
    >>> ds = xr.Dataset(
    ...     {"probability": share, "probability_low": share - 0.02, "probability_high": share + 0.02},
    ...     coords={"word": ["oscillatory", "separating"]},
    ... )
    >>> [label.get_text() for label in probability_panel(ds).get_yticklabels()]
    ['oscillatory', 'separating']
    """
    ds = require_sample(ds, "probability")
    ax = look.axes_or_current(ax, 0.5)
    ds = ds.isel(word=ds["probability"].values > 0.0)
    words = list(map(str, ds["word"].values))
    colours = [look.on_page(look.REGIME_COLOURS.get(word, look.NO_VALUE)) for word in words]
    _draw_bars(ax, ds, "probability", np.arange(len(words)), color=colours)
    _name_bars(ax, words)
    ax.xaxis.set_major_formatter(ticker.PercentFormatter(1.0))
    ax.set_xlabel("probability (95 % interval)")
    return ax


def _draw_bars(ax: Axes, ds: xr.Dataset, name: str, place: NDArray[Any], **style: Any) -> None:
    """Draw a variable and its 95 % interval as horizontal bars."""
    value = ds[name].values
    ends = [np.abs(ds[f"{name}{end}"].values - value) for end in ("_low", "_high")]
    ax.barh(place, value, xerr=ends, ecolor=rcParams["text.color"], capsize=3, **style)


def _name_bars(ax: Axes, names: list[str]) -> None:
    """Write a name beside each bar, the first at the top; a bar ends at 1."""
    ax.set_yticks(np.arange(len(names)), names)
    ax.invert_yaxis()
    ax.set_xlim(0.0, 1.0)


def survival_panel(ds: xr.Dataset, ax: Axes | None = None) -> Axes:
    """Draw the probability that a contact still holds, or that a body still rides, over time, with its 95 % band.

    Parameters
    ----------
    ds : xarray.Dataset
        One cell of a sampled sweep with ``survival``.
    ax : matplotlib.axes.Axes, optional
        Axes to draw in, by default pyplot's current ones.

    Returns
    -------
    matplotlib.axes.Axes

    Raises
    ------
    InputError
        If the dataset is no sampled sweep with ``survival``, or has several cells.

    Examples
    --------
    >>> import xarray as xr
    >>> share = xr.DataArray([1.0, 0.8, 0.6], dims="survival_time")
    >>> ds = xr.Dataset(
    ...     {"probability": ("word", [1.0]), "survival": share, "survival_low": share - 0.1, "survival_high": share},
    ...     coords={"word": ["separating"], "survival_time": [0.0, 1.0, 2.0]},
    ... )
    >>> survival_panel(ds).get_ylabel()
    'body still holds its contacts'
    """
    ds = require_sample(ds, "survival")
    ax = look.axes_or_current(ax, 0.5)
    time, colour = ds["survival_time"].values, look.pair(0)
    look.band(ax, time, ds["survival_low"].values, ds["survival_high"].values, colour, step="post")
    ax.step(time, ds["survival"].values, color=colour, where="post")
    ax.set_ylim(0.0, 1.02)
    ax.yaxis.set_major_formatter(ticker.PercentFormatter(1.0))
    what = "rides" if ds.attrs.get("survival_of") == "first_slip" else "holds its contacts"
    look.label_axes(ax, "time (s)", f"body still {what}")
    look.make_room(ax)
    return ax


def sensitivity_panel(ds: xr.Dataset, ax: Axes | None = None, word: str | None = None) -> Axes:
    """Draw Sobol indices of the indicator of a regime as bars with 95 % intervals.

    Parameters
    ----------
    ds : xarray.Dataset
        One cell of a sampled sweep with ``sensitivity``.
    ax : matplotlib.axes.Axes, optional
        Axes to draw in, by default pyplot's current ones.
    word : str, optional
        The regime; by default the one whose probability is nearest to a half.

    Returns
    -------
    matplotlib.axes.Axes

    Raises
    ------
    InputError
        If the dataset is no sampled sweep with ``sensitivity``, has several cells, or the regime is unknown.

    Examples
    --------
    >>> import xarray as xr
    >>> index = xr.DataArray([[0.8, 0.2]], dims=("word", "parameter"))
    >>> ds = xr.Dataset(
    ...     {f"sobol_{which}{end}": index for which in ("first", "total") for end in ("", "_low", "_high")},
    ...     coords={"word": ["separating"], "parameter": ["friction.elsewhere.mu_k", "zone.half_angle"]},
    ... ).assign(probability=("word", [0.4]))
    >>> [label.get_text() for label in sensitivity_panel(ds).get_yticklabels()]
    ['friction.elsewhere.mu_k', 'zone.half_angle']
    """
    ds = require_sample(ds, "sobol_first")
    if word is None:
        word = str(ds["word"].values[int(np.argmin(np.abs(ds["probability"].values - 0.5)))])
    if word not in ds["word"].values:
        raise InputError("word", f"{word!r} is no regime: {', '.join(map(str, ds['word'].values))}")
    ax = look.axes_or_current(ax, 0.5)
    ds = ds.sel(word=word)
    handles: list[Artist] = []
    for k, (name, text) in enumerate((("first", "first: alone"), ("total", "total: with the others"))):
        colour, place = look.pair(k), np.arange(ds.sizes["parameter"]) + 0.4 * k - 0.2
        _draw_bars(ax, ds, f"sobol_{name}", place, height=0.36, color=colour)
        handles.append(patches.Patch(color=colour, label=text))
    _name_bars(ax, list(map(str, ds["parameter"].values)))
    ax.set_xlabel("Sobol index (95 % interval)")
    title = [f"what {word} depends on", f"probability {float(ds['probability']):.1%}"]
    ax.set_title(look.folded(title, look.width_of(ax)), fontsize="medium")
    look.place_legend(ax, handles, "below")
    return ax
