"""Cells of an earlier sweep that a new sweep shares."""

from __future__ import annotations

import os
from collections.abc import Collection, Iterator, Mapping
from typing import Any

import numpy as np
import pandas as pd
import xarray as xr
from numpy.typing import NDArray

from ringsweep.config import Config, load
from ringsweep.config.axes import Indices, by_law
from ringsweep.errors import InputError
from ringsweep.models import parameters
from ringsweep.models.scene import LAW
from ringsweep.quantities.variables import INFERRED, OUTCOMES
from ringsweep.storage import netcdf
from ringsweep.storage.chunks import Layout
from ringsweep.storage.provenance import differences, fingerprint, identity


class EarlierSweep:
    """File of an earlier sweep with the same scene and solver as a new one, except for what either varies.

    Parameters
    ----------
    path : path-like
        The file.
    config : Config
        The new sweep.

    Raises
    ------
    InputError
        If the file holds no sweep, or was computed by another version, or another solver or scene.

    Attributes
    ----------
    processors : str
        Names of the processors that computed the file.
    """

    def __init__(self, path: str | os.PathLike[str], config: Config):
        self.path = path
        netcdf.check(path)
        with netcdf.reading(path) as ds:
            if "regime" not in ds or "time" in ds.dims:
                raise InputError(str(path), "holds no sweep whose cells could be reused")
            self.processors = str(ds.attrs.get("processors"))
            stored_fingerprint = ds.attrs.get("fingerprint")
        self.config = load(path)
        self.axes = self.config.axes
        if stored_fingerprint != fingerprint(identity(self.config)):
            raise InputError(str(path), "was computed by another version: its cells cannot be reused")
        if self.config.follow is not None:
            raise InputError(str(path), "follows an axis: its cells start from other states than those of this sweep")
        if any(len(dims) > 1 for dims, _ in self.axes.columns.values()):
            raise InputError(str(path), "has an axis of several dimensions: its cells cannot be reused")
        if changes := self._changes(config):
            raise InputError(str(path), f"has no cell of this sweep: {changes}")

    def _changes(self, config: Config) -> str:
        """Differences between what both sweeps hold fixed, in words."""
        swept = {path for axes in (self.axes, config.axes) for path in axes.columns}
        # Cells of a law do not depend on parameters that only other laws have.
        needed = [set(parameters(structure)) for structure in config.scene.structures.values()]
        of_some_laws = set[str]().union(*needed) - needed[0].intersection(*needed)
        not_in_both = set(config.scene.values) ^ set(self.config.scene.values)
        ignored = {f"scene.{path}" for path in swept | of_some_laws | not_in_both}

        def fixed(of: Config) -> dict[str, str]:
            known = identity(of).items()
            return {name: text for name, text in known if name not in ignored and not name.startswith("sweep")}

        return differences(fixed(self.config), fixed(config))

    def shared_cells(
        self, config: Config, layout: Layout, done: NDArray[np.bool_], names: Collection[str] | None = None
    ) -> Iterator[tuple[NDArray[np.intp], dict[str, NDArray[Any]]]]:
        """Positions and columns of the cells that both sweeps have, chunk by chunk of the new sweep.

        Parameters
        ----------
        config : Config
            The new sweep.
        layout : Layout
            Order of its cells.
        done : ndarray of bool, shape ``(cells,)``
            Cells that are not looked for.
        names : collection of str, optional
            Variables to read; all by default.
        """
        with netcdf.reading(self.path) as ds:
            known = [str(name) for name in ds.data_vars if name not in ("origin", "level")]
            wanted = [name for name in known if names is None or name in names]
            for start, stop, _ in layout.chunks():
                positions = start + np.flatnonzero(~done[start:stop])
                if not len(positions):
                    continue
                indices = dict(zip(config.axes.sizes, layout.indices(positions), strict=True))
                shared, in_file = self._locate(config, indices, len(positions))
                if not shared.any():
                    continue
                part = ds.isel({dim: slice(along.min(), along.max() + 1) for dim, along in in_file.items()})
                within = {dim: along - along.min() for dim, along in in_file.items()}
                positions = positions[shared]
                # What an earlier refined sweep has inferred is no cell of it.
                if "origin" in ds:
                    run = _in_cells(part["origin"], within, len(positions)) != INFERRED
                    positions, within = positions[run], {dim: along[run] for dim, along in within.items()}
                if len(positions):
                    columns = {name: _in_cells(part[name], within, len(positions)) for name in wanted}
                    yield positions, {name: column.astype(OUTCOMES[name].dtype) for name, column in columns.items()}

    def _locate(self, config: Config, indices: Indices, count: int) -> tuple[NDArray[np.bool_], Indices]:
        """Which of `count` cells of the new sweep the file holds, and the indices of these in the file."""
        shared = np.zeros(count, dtype=bool)
        in_file = {dim: np.zeros(count, dtype=np.intp) for dim in self.axes.sizes}
        for structure, own, values in by_law(config.scene, config.axes, indices, count):
            needed = {path: values[path] for path in parameters(structure) if path in values}
            shared[own], found = self._locate_under_law({**needed, LAW: np.full(len(own), structure.law)})
            for dim, along in found.items():
                in_file[dim][own] = along
        return shared, {dim: along[shared] for dim, along in in_file.items()}

    def _locate_under_law(self, needed: Mapping[str, NDArray[Any]]) -> tuple[NDArray[np.bool_], Indices]:
        """Which cells of one law the file holds, and their indices there; `needed` holds all that determines them."""
        shared = np.ones(len(needed[LAW]), dtype=bool)
        in_file: dict[str, NDArray[np.intp]] = {}
        fixed = {**self.config.scene.values, LAW: self.config.scene.structure.law}
        for path, column in needed.items():
            if path not in self.axes.columns:
                shared &= column == fixed[path] if path in fixed else False
        for dim in self.axes.sizes:
            paths = [path for path, (dims, _) in self.axes.columns.items() if dims == (dim,) and path in needed]
            # Without such a path the cells do not depend on this dimension.
            if paths:
                known = pd.MultiIndex.from_arrays([self.axes.columns[path][1] for path in paths])
                first = np.flatnonzero(~known.duplicated())
                number = known[first].get_indexer(pd.MultiIndex.from_arrays([needed[path] for path in paths]))
                shared &= number >= 0
                in_file[dim] = first[number]
        return shared, in_file


def _in_cells(data: xr.DataArray, indices: Indices, count: int) -> NDArray[Any]:
    """Values of a variable in cells; it may have further dimensions. Without indices all cells have one value."""
    found = data.transpose(*indices, ...).values[tuple(indices.values())]
    return np.broadcast_to(found, (count, *found.shape[bool(indices) :]))
