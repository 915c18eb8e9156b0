"""The functions that take a dataset, as ``ds.ringsweep`` of xarray: there once ringsweep and xarray are imported."""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
import xarray as xr
from numpy.typing import ArrayLike

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.figure import Figure


@xr.register_dataset_accessor("ringsweep")
class Accessor:
    """What ringsweep does with a dataset of a sweep.

    Examples
    --------
    >>> import ringsweep
    >>> from ringsweep.config import load
    >>> scene = load("my-sweep.yaml").source["scene"]
    >>> maps = ringsweep.sweep(scene, {"drive.amplitude": [0.1, 2.0]})
    >>> maps.ringsweep.words().values.tolist()
    ['oscillatory', 'separating']
    >>> maps.ringsweep.simulate(drive_amplitude=2).attrs["outcome"].split(",")[0]
    'separating (oscillatory)'
    """

    def __init__(self, ds: xr.Dataset):
        self._ds = ds

    def words(self, var: str = "regime") -> xr.DataArray:
        """Names in place of the flags of a classification; see :func:`ringsweep.words`."""
        from ringsweep.quantities.variables import words

        return words(self._ds[var])

    def where(self, **classes: str | Sequence[str]) -> xr.Dataset:
        """The cells of some classes, such as ``regime="separating"``; the others are NaN, as with `where` of xarray.

        Several words, such as ``regime=["sliding", "riding"]``, keep the cells of any of them.

        Raises
        ------
        InputError
            If the dataset has no such classification, or the classification no such word.
        """
        from ringsweep.plots.datasets import resolve
        from ringsweep.quantities.variables import meanings_of

        found = self._ds
        for name, given in classes.items():
            known = self.words(resolve("where", name, self._ds))
            among = meanings_of(self._ds[name]).values()
            found = found.where(known.isin([resolve(name, str(word), among) for word in np.ravel(given)]))
        return found

    def to_frame(self, along: str | None = None) -> pd.DataFrame:
        """Table with a row for each cell: coordinates, then variables, with classifications as categories of words.

        Of a sampled sweep it has a row for each cell and regime, with the probabilities. The points of a section are
        left out. Of a history it has a row for each sample of the time.

        Parameters
        ----------
        along : str, optional
            A dimension: the rows are its values, and the variables are those that have it. ``"event"`` gives the events
            of a history, ``"section"`` the points of a section.

        Raises
        ------
        InputError
            If the dataset has no such dimension.
        """
        import pandas as pd

        from ringsweep.plots.datasets import resolve
        from ringsweep.quantities.variables import is_classification, meanings_of

        ds = self._ds
        if along is None and "time" in ds.dims:
            along = "time"
        if along is not None:
            along = resolve("along", along, ds.dims)
            ds = ds[[name for name, variable in ds.data_vars.items() if along in variable.dims]]
        elif "probability" in ds:
            # A table of all variables would have a row for each combination of their dimensions.
            ds = ds[[name for name in ds.data_vars if str(name).startswith("probability")]]
        else:
            ds = ds.drop_dims("section", errors="ignore")
        frame = ds.to_dataframe().reset_index()
        for name, variable in ds.variables.items():
            if is_classification(variable) and name in frame:
                known = meanings_of(variable)
                frame[name] = pd.Categorical(frame[name].map(known), categories=list(known.values()))
        return frame

    def at(self, times: ArrayLike) -> xr.Dataset:
        """A history at other times.

        A history has two rows at the instant of an event, its states before and after it, so `interp` of xarray does
        not take it. Here numbers are interpolated linearly between rows; up to an event from the row before it, from
        the event on from the row after it. At an event itself they are those after it. Classifications have the value
        of the row before. Outside the history numbers are NaN, and classifications have the value of its end.

        Parameters
        ----------
        times : array-like of float
            Times, s: a number, or several in any order.

        Raises
        ------
        InputError
            If the dataset is no history, or the times are no such numbers.

        Examples
        --------
        A body stops at 1 s, and its acceleration jumps:

        >>> import xarray as xr
        >>> run = xr.Dataset({"epsilon": ("time", [2.0, 4.0, 0.0, 0.0])}, {"time": [0.0, 1.0, 1.0, 2.0]})
        >>> run.ringsweep.at([0.5, 1.0, 1.5]).epsilon.values
        array([3., 0., 0.])
        """
        from ringsweep.errors import InputError
        from ringsweep.runs.events import history_at

        if "time" not in self._ds.dims:
            raise InputError("ds", "is no time history: ringsweep.simulate returns one")
        try:
            wanted = np.asarray(times, dtype=np.float64)
        except (TypeError, ValueError) as error:
            raise InputError("times", "numbers of seconds are expected") from error
        if wanted.ndim > 1:
            raise InputError("times", f"one dimension is expected, got {wanted.ndim}")
        found = history_at(self._ds, np.atleast_1d(wanted))
        return found if wanted.ndim else found.isel(time=0)

    def map(self, var: str | None = None, **options: Any) -> Figure:
        """The picture that suits a variable, or the dataset; arguments as for :func:`ringsweep.plots.regime_map`."""
        from ringsweep.plots.maps import regime_map

        return regime_map(self._ds, var=var, **options)

    def report(self, path: str | os.PathLike[str]) -> None:
        """Write one page with pictures, thresholds and certificates, ``*.html``, as ``ringsweep report`` does."""
        from ringsweep.report.page import report

        report(self._ds, path)

    def boundary(self, regime: str, tolerance: float = 1e-6) -> xr.Dataset:
        """Curves around the cells of a regime; see :func:`ringsweep.boundary`."""
        from ringsweep.runs.boundaries import boundary

        return boundary(self._ds, regime, tolerance)

    def simulate(self, sel: Mapping[str, float | str] | None = None, /, **cell: float | str) -> xr.Dataset:
        """Time history of the cell nearest to some values of the coordinates; see :func:`ringsweep.plots.cell`.

        The values are a mapping, such as ``{"drive.amplitude": 2}``, or keywords, such as ``drive_amplitude=2``. A
        warning states the value taken if it is another.
        """
        from ringsweep.plots.selection import cell as configuration_of
        from ringsweep.runs.simulate import simulate

        return simulate(configuration_of(self._ds, {**(sel or {}), **cell}))
