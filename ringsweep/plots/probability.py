"""Pictures of one cell of a sampled sweep: probabilities, survival, Sobol indices."""

from __future__ import annotations

import numpy as np
import xarray as xr
from matplotlib import rcParams
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.patches import Patch
from matplotlib.ticker import PercentFormatter

from ringsweep.errors import InputError
from ringsweep.plots.datasets import require_sample
from ringsweep.plots.style import (
    NO_VALUE,
    PAIR_COLOURS,
    REGIME_COLOURS,
    axes_or_current,
    folded,
    label_axes,
    make_room,
    on_page,
    place_legend,
    width_of,
)


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
    ax = axes_or_current(ax, 0.5)
    ds = ds.isel(word=ds["probability"].values > 0.0)
    words = list(map(str, ds["word"].values))
    place = np.arange(len(words))
    share = ds["probability"].values
    ends = np.abs(np.stack([share - ds["probability_low"].values, ds["probability_high"].values - share]))
    colours = [on_page(REGIME_COLOURS.get(word, NO_VALUE)) for word in words]
    ax.barh(place, share, xerr=ends, color=colours, ecolor=rcParams["text.color"], capsize=3)
    ax.set_yticks(place, words)
    ax.invert_yaxis()
    ax.set_xlim(0.0, 1.0)
    ax.xaxis.set_major_formatter(PercentFormatter(1.0))
    ax.set_xlabel("probability (95 % interval)")
    return ax


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
    ax = axes_or_current(ax, 0.5)
    time, colour = ds["survival_time"].values, on_page(PAIR_COLOURS[0])
    ax.fill_between(
        time, ds["survival_low"].values, ds["survival_high"].values, color=colour, alpha=0.3, linewidth=0, step="post"
    )
    ax.step(time, ds["survival"].values, color=colour, where="post")
    ax.set_ylim(0.0, 1.02)
    ax.yaxis.set_major_formatter(PercentFormatter(1.0))
    what = "rides" if ds.attrs.get("survival_of") == "first_slip" else "holds its contacts"
    label_axes(ax, "time (s)", f"body still {what}")
    make_room(ax)
    return ax


def sensitivity_panel(ds: xr.Dataset, ax: Axes | None = None, word: str | None = None) -> Axes:
    """Draw Sobol indices, or Morris's effects, of the indicator of a regime as bars with 95 % intervals.

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
    ...     coords={"word": ["separating"], "parameter": ["friction.rest.mu_k", "zone.half_angle"]},
    ... ).assign(probability=("word", [0.4]))
    >>> [label.get_text() for label in sensitivity_panel(ds).get_yticklabels()]
    ['friction.rest.mu_k', 'zone.half_angle']
    """
    screened = "morris_mu_star" in ds
    names = ("morris_mu_star", "morris_sigma") if screened else ("sobol_first", "sobol_total")
    labels = ("mean magnitude", "standard deviation") if screened else ("first: alone", "total: with the others")
    ds = require_sample(ds, names[0])
    if word is None:
        word = str(ds["word"].values[int(np.argmin(np.abs(ds["probability"].values - 0.5)))])
    if word not in ds["word"].values:
        raise InputError("word", f"{word!r} is no regime: {', '.join(map(str, ds['word'].values))}")
    ax = axes_or_current(ax, 0.5)
    ds = ds.sel(word=word)
    place = np.arange(ds.sizes["parameter"])
    for k, name in enumerate(names):
        index = ds[name].values
        # The standard deviation of effects has no interval.
        ends = [np.abs(ds.get(f"{name}{end}", ds[name]).values - index) for end in ("_low", "_high")]
        style = {"color": on_page(PAIR_COLOURS[k]), "ecolor": rcParams["text.color"], "capsize": 3}
        ax.barh(place + 0.4 * k - 0.2, index, 0.36, xerr=None if name == "morris_sigma" else ends, **style)
    ax.set_yticks(place, list(map(str, ds["parameter"].values)))
    ax.invert_yaxis()
    ax.set_xlim(0.0, 2.0 if screened else 1.0)
    share = float(ds["probability"])
    ax.set_xlabel(("elementary effect" if screened else "Sobol index") + " (95 % interval)")
    ax.set_title(folded([f"what {word} depends on", f"probability {share:.1%}"], width_of(ax)), fontsize="medium")
    handles: list[Artist] = [
        Patch(color=on_page(colour), label=label) for colour, label in zip(PAIR_COLOURS, labels, strict=True)
    ]
    place_legend(ax, handles, "below")
    return ax
