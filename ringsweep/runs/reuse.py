"""Cells of an earlier sweep that are those of a new one."""

from __future__ import annotations

import os
from collections.abc import Mapping
from copy import deepcopy
from dataclasses import replace
from typing import Any, Protocol

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from ringsweep.config import Config, load
from ringsweep.errors import InputError
from ringsweep.models import parameters
from ringsweep.models.scene import LAW
from ringsweep.runs.cells import laws_at, values_at
from ringsweep.storage import netcdf
from ringsweep.storage.chunks import Layout
from ringsweep.storage.provenance import differences, fingerprint, identity

# Two ways of spacing an axis differ by so many units in the last place.
_ROUNDING = 8 * np.finfo(float).eps


class Keeper(Protocol):
    """What takes finished cells."""

    done: NDArray[np.bool_]

    def put(self, positions: NDArray[np.integer], columns: Mapping[str, NDArray[Any]], processor: str) -> None:
        """Keep the columns of the cells at these positions."""


class Earlier:
    """A file of an earlier sweep under the scene and solver of a new one, whatever either varies.

    Parameters
    ----------
    path : path-like
        The file.
    config : Config
        The new sweep.

    Raises
    ------
    InputError
        If the file is none of a sweep, or if what both hold fixed, the solver or the version are not the same.
    """

    def __init__(self, path: str | os.PathLike[str], config: Config):
        self.path = path
        with netcdf.open_dataset(path) as ds:
            if "regime" not in ds or "time" in ds.dims:
                raise InputError(str(path), "holds no sweep whose cells could be reused")
            self.attributes = dict(ds.attrs)
        self.config = load(path)
        self.axes = self.config.axes
        self._check(config)

    def _check(self, config: Config) -> None:
        """Refuse a file whose cells have no bits in common with those of a new sweep."""
        old, new = identity(self.config), identity(config)
        if self.attributes.get("fingerprint") != fingerprint(old):
            raise InputError(str(self.path), "was computed by another version: its cells cannot be reused")
        if any(len(dims) > 1 for dims, _ in self.axes.columns.values()):
            raise InputError(str(self.path), "has an axis of several dimensions: its cells cannot be reused")
        varied = {path for axes in (self.axes, config.axes) for path in axes.columns}
        # A parameter that only some laws have says nothing about the cells of the others.
        needed: list[set[str]] = [set(parameters(structure)) for structure in config.scene.structures.values()]
        apart = (
            varied
            | (set().union(*needed) - needed[0].intersection(*needed))
            | (set(config.scene.values) ^ set(self.config.scene.values))
        )
        ignored = {f"scene.{path}" for path in apart}
        fixed = [{k: v for k, v in one.items() if k not in ignored and not k.startswith("sweep")} for one in (old, new)]
        if changes := differences(*fixed):
            raise InputError(str(self.path), f"has no cell of this sweep: {changes}")

    def aligned(self, config: Config) -> Config:
        """The new sweep with the very values of the earlier one where its axes differ from them by rounding."""
        columns, sweep = dict(config.axes.columns), deepcopy(config.source.get("sweep", {}))
        for path, (dims, column) in columns.items():
            section = next((section for section in sweep.values() if path in section), None)
            if path == LAW or len(dims) > 1 or section is None:
                continue
            _, known = self.axes.columns.get(path, ((), np.array(self.config.scene.values.get(path, np.nan))))
            found = _aligned(column, np.unique(known))
            if (found != column).any():
                columns[path] = dims, found
                section[path] = found.tolist()
        source = config.source | {"sweep": sweep} if sweep else config.source
        return replace(config, axes=replace(config.axes, columns=columns), source=source)

    def give(self, config: Config, layout: Layout, keeper: Keeper) -> int:
        """Hand over all cells of the new sweep that the file holds and that are not there yet; returns how many."""
        count = 0
        with netcdf.open_dataset(self.path) as ds:
            for begin, end, _ in layout.chunks():
                positions = begin + np.flatnonzero(~keeper.done[begin:end])
                place = dict(zip(config.axes.sizes, layout.indices(positions), strict=True))
                shared, there = self._find(config, place, len(positions))
                if shared.any():
                    part = ds.isel({dim: slice(at.min(), at.max() + 1) for dim, at in there.items()}).load()
                    within = tuple(there[dim] - there[dim].min() for dim in there)
                    found = positions[shared]
                    columns = {
                        str(name): np.broadcast_to(data.transpose(*there).values[within], found.shape)
                        for name, data in part.data_vars.items()
                    }
                    keeper.put(found, columns, str(self.attributes["processors"]))
                    count += len(found)
        return count

    def _find(
        self, config: Config, place: Mapping[str, NDArray[np.intp]], count: int
    ) -> tuple[NDArray[np.bool_], dict[str, NDArray[np.intp]]]:
        """Which of the new cells the file holds, and where along its dimensions those lie."""
        values: dict[str, NDArray[Any]] = {**values_at(config.scene, config.axes, place, count)}
        values[LAW] = laws_at(config.scene, config.axes, place, count)
        shared = np.zeros(count, dtype=bool)
        there = {dim: np.zeros(count, dtype=np.intp) for dim in self.axes.sizes}
        for law, structure in config.scene.structures.items():
            own = np.flatnonzero(values[LAW] == law)
            # Of what other laws need, a cell is independent.
            needed = {path: values[path][own] for path in (LAW, *parameters(structure)) if path in values}
            shared[own] = self._find_alike(needed, {dim: (at, own) for dim, at in there.items()})
        return shared, {dim: at[shared] for dim, at in there.items()}

    def _find_alike(
        self, needed: Mapping[str, NDArray[Any]], there: Mapping[str, tuple[NDArray[np.intp], NDArray[np.intp]]]
    ) -> NDArray[np.bool_]:
        """Which cells under one law the file holds; enters where, into the places given of the arrays given."""
        shared = np.ones(len(needed[LAW]), dtype=bool)
        fixed = {**self.config.scene.values, LAW: self.config.scene.structure.law}
        for path, column in needed.items():
            if path not in self.axes.columns:
                shared &= column == fixed[path] if path in fixed else False
        for dim, (at, own) in there.items():
            paths = [path for path, (dims, _) in self.axes.columns.items() if dims == (dim,) and path in needed]
            if not paths:
                continue
            known = pd.MultiIndex.from_arrays([self.axes.columns[path][1] for path in paths])
            first = np.flatnonzero(~known.duplicated())
            found = known[first].get_indexer(pd.MultiIndex.from_arrays([needed[path] for path in paths]))
            shared &= found >= 0
            at[own] = first[found]
        return shared


def _aligned(column: NDArray[np.float64], known: NDArray[np.float64]) -> NDArray[np.float64]:
    """Values, each replaced by the known one that it equals but for rounding, if there is such."""
    after = np.clip(np.searchsorted(known, column), 1, max(len(known) - 1, 1))
    candidates = known[np.stack([after - 1, np.minimum(after, len(known) - 1)])]
    nearest = np.where(np.abs(candidates[0] - column) <= np.abs(candidates[1] - column), *candidates)
    return np.where(np.abs(nearest - column) <= _ROUNDING * np.abs(column), nearest, column)
