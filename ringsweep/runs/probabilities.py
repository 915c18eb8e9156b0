"""Plan of a sampled sweep: runs at the points of a sample are reduced to sums, and sums to probabilities.

A part of a cell is what one replicate of the sample adds to it. A task runs some parts, and keeps sums of each, whose
size does not depend on the number of runs, and the numbers whose quantiles are asked for.
"""

from __future__ import annotations

import json
import logging
import os
from collections.abc import Callable, Iterator
from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from ringsweep.config import Config, Setting, load, sweepable
from ringsweep.config.axes import dimension
from ringsweep.config.uncertain import CENSORED, Sample, censored
from ringsweep.errors import InputError
from ringsweep.models import model_of
from ringsweep.quantities.flags import FAILED, REGIMES
from ringsweep.quantities.variables import OUTCOMES, QUANTILE_ENDS, SAMPLED, Variable
from ringsweep.runs.cells import TaskResult, compute_task
from ringsweep.runs.grid import Chunk, Columns, Grid
from ringsweep.statistics import CONFIDENCE, quantiles, share_interval, sobol_indices, sobol_sums
from ringsweep.storage.checkpoint import Checkpoint
from ringsweep.storage.chunks import CHUNK, Layout, chunk_shape
from ringsweep.storage.provenance import environment, processor

logger = logging.getLogger("ringsweep")

# Share of runs without certificate that is worth a warning.
_MANY_UNSURE = 0.01

# Bytes of the sums of a chunk, and of a run that is kept.
_CHUNK_BYTES, _RUN_BYTES = 32e6, 200


def compute_parts(config: Config, layout: Layout, positions: NDArray[np.integer]) -> TaskResult:
    """Run the parts at some positions of the layout of parts, and reduce each to its sums."""
    sample = config.sample
    assert sample is not None
    runs, each = sample.size * sample.rows, sample.n * sample.rows
    one = replace(config, axes=sample.axes(config.scene, config.axes, sample.shares), sample=None)
    # A cell and its runs stand together, so a run has the position of its part times their number.
    of_runs = Layout((*layout.sizes[:-1], each), (*layout.chunk[:-1], each))
    numbers = (positions[:, None] * runs + np.arange(runs)).ravel()
    times = [censored(config.scene)] if sample.survival else []
    needed = list(dict.fromkeys(["regime", "certified", *times, *sample.quantiles, *sample.sensitive]))
    found, seconds = [], []
    for start in range(0, len(numbers), CHUNK):
        result = compute_task(one, of_runs, numbers[start : start + CHUNK])
        found.append({name: result.columns[name] for name in (result.columns if sample.keep else needed)})
        seconds.append(result.seconds)
    columns = {name: np.concatenate([part[name] for part in found]).reshape(len(positions), runs) for name in found[0]}
    sums = _reduce(sample, censored(config.scene), columns) | (columns if sample.keep else {})
    total = None if None in seconds else sum(filter(None, seconds))
    return TaskResult(positions, sums, total, environment(), processor())


def _reduce(sample: Sample, time: str, columns: Columns) -> Columns:
    """The sums of some parts, from the outcomes of their runs; `time` is the variable of survival."""
    # A row for each point.
    rows = {name: column.reshape(len(column), -1, sample.rows) for name, column in columns.items()}
    points = {name: column[..., sample.own].reshape(len(column), -1) for name, column in rows.items()}
    sure = points["certified"] == 1

    def counted(events: NDArray[np.bool_]) -> NDArray[np.int32]:
        """Points without and with certificate at which something happens."""
        both = [(events & one[..., None]).sum(axis=1) for one in (~sure, sure)]
        return np.stack(both, axis=-1).astype(np.int32)

    words = np.arange(len(REGIMES))
    found: Columns = {"runs": counted(points["regime"][..., None] == words)}
    if sample.survival:
        found["lost"] = counted(points[time][..., None] <= np.array(sample.survival))
    for name in sample.quantiles:
        # What did not happen within the span happens later, if ever; without a certificate nothing is known.
        happened = np.where(np.isnan(points[name]), np.inf, points[name])
        found[f"{name}_values"] = np.where(sure, happened, np.nan)
    if sample.sensitivity:
        found["sobol_sums"] = sobol_sums(1.0 * (rows["regime"][:, None] == words[:, None, None]))
        for name in sample.sensitive:
            values = rows[name]
            if name in CENSORED:
                # A time that has not come is not a number, and compares as later.
                values = 1.0 * (values[:, None] <= np.array(sample.survival)[:, None, None])
            found[f"{name}_sobol_sums"] = sobol_sums(values)
    return found


class Sampled(Grid):
    """Plan of a sweep whose cells are each run at the points of a sample."""

    kind = "probability", "sampled sweep"
    parts = "replicates of cells"
    takes_none = "a sampled sweep has no cells that another one could take: leave it out"

    def __init__(self, config: Config, asked: Any, reuse: str | os.PathLike[str] | None, whole: bool):
        super().__init__(config, asked, reuse, whole)
        self.side_by_side, self.parts_of_cell, self.runs_of_cell = 1, asked.replicates, asked.n * asked.rows
        if not whole:
            # The sums of a chunk fit into the memory.
            most = max(int(_CHUNK_BYTES / self.bytes_of_cell()), 1)
            self.grid = Layout(self.grid.sizes, chunk_shape(self.grid.sizes, min(most, CHUNK)))
        # The parts of a cell stand together.
        self.layout = Layout((*self.grid.sizes, asked.replicates), (*self.grid.chunk, asked.replicates))

    def bytes_of_cell(self) -> int:
        """Size of the sums of a cell, and of its runs if they are kept."""
        sample = self.asked
        events, own = len(REGIMES) + len(sample.survival), sample.size * len(sample.own)
        indices = len(REGIMES) + len(sample.sensitive) * max(len(sample.survival), 1)
        numbers = 2 * events + own * len(sample.quantiles)
        numbers += 3 * (len(sample.factors) + 1) * indices * sample.sensitivity
        return int(8 * numbers + sample.keep * sample.size * sample.rows * _RUN_BYTES) * int(sample.replicates)

    def task(self) -> Callable[[NDArray[np.integer]], TaskResult]:
        """Function that computes the parts at some positions of the layout."""
        return partial(compute_parts, replace(self.config, source={}), self.layout)

    def chunks(self, checkpoint: Checkpoint) -> Iterator[Chunk]:
        """Slices of each chunk in the grid, and the statistics there."""
        return ((region[:-1], self.columns(sums)) for region, sums in checkpoint.chunks())

    def warn(self, results: xr.Dataset) -> None:
        """Warn of runs that failed or have no certificate."""
        runs = results["runs"].sum([dim for dim in results["runs"].dims if dim not in ("word", "certificate")]).values
        share, failed = runs[:, 0].sum() / runs.sum(), int(runs[FAILED].sum())
        if share > _MANY_UNSURE:
            cure = "" if self.config.certifies else ": the solver does not certify"
            logger.warning("%.1f %% of the runs have no certificate, and widen the intervals%s", 100 * share, cure)
        if failed:
            logger.warning("%d runs failed", failed)

    def variables(self) -> dict[str, Variable]:
        """Declarations of the statistics; their dimensions are those within a cell."""
        sample = self.asked
        found = {"runs": replace(SAMPLED["runs"], dims=("replicate", "word", "certificate"))}
        found |= _beginning_with("probability", ("word",))
        if sample.survival:
            found |= _beginning_with("survival", ("survival_time",))
        known = model_of(self.config.scene.structure).variables
        for name in sample.quantiles:
            for end, of in QUANTILE_ENDS.items():
                about = f"{of}: {known[name].long_name}"
                found[f"{name}_quantile{end}"] = Variable(known[name].unit, about, dims=("quantile",))
        if sample.sensitivity:
            measures = _beginning_with("sobol_", ("word", "parameter"))
            found |= measures
            for number in sample.sensitive:
                about = known[number].long_name
                times = ("survival_time",) if number in CENSORED else ()
                for name, one in measures.items():
                    text = one.long_name.replace("the indicator of each regime", about)
                    found[f"{number}_{name}"] = Variable("1", text, dims=(*times, "parameter"))
        if sample.keep:
            found = {name: replace(one, dims=("replicate", "sample")) for name, one in known.items()} | found
        return found

    def coordinates(self) -> dict[str, Any]:
        """Coordinates of the statistics of a cell, and of its runs if they are kept."""
        sample = self.asked
        found = super().coordinates() | {
            "word": ("word", list(REGIMES), {"long_name": "regime"}),
            "replicate": ("replicate", np.arange(sample.replicates), {"long_name": "replicate of the sample"}),
        }
        if sample.survival:
            found["survival_time"] = "survival_time", list(sample.survival), {"units": "s", "long_name": "time"}
        if sample.quantiles:
            found["quantile"] = "quantile", _levels(sample), {"units": "1", "long_name": "level of the quantile"}
        if sample.sensitivity:
            names = [factor.name for factor in sample.factors]
            found["parameter"] = "parameter", names, {"long_name": "uncertain parameter"}
        if sample.keep:
            known = sweepable(self.config.scene)
            columns = sample.axes(self.config.scene, self.config.axes, sample.shares).columns
            for path in (path for factor in sample.factors for path in factor.paths):
                (*dims, _), column = columns[path]
                column = column.reshape(*column.shape[:-1], sample.replicates, -1)
                found[dimension(path)] = (*dims, "replicate", "sample"), column, known[path].attributes
        return found

    def attributes(self) -> dict[str, Any]:
        """Attributes that say what was sampled, and how the intervals follow from it."""
        sample = self.asked
        way = "Clopper and Pearson" if sample.independent else "scatter of the replicates (Korn and Graubard)"
        runs, own = sample.n * sample.rows, sample.n * len(sample.own)
        told = f"{sample.n} points of each cell"
        told += f": {runs} runs, {own} of them for the probabilities" * (runs > own)
        return super().attributes() | {
            "sample": f"{told}; {sample.method}, seed {sample.seed}, "
            f"{sample.replicates} replicates; " + "; ".join(f"{factor.name} {factor}" for factor in sample.factors),
            "sample_interval": f"{100 * CONFIDENCE:g} %: {way}; a run that is not certified counts both ways",
            **({"survival_of": censored(self.config.scene)} if sample.survival else {}),
        }

    def columns(self, columns: Columns) -> Columns:
        """Probabilities, quantiles and indices of cells, from the sums of their parts.

        Sums have the shape ``(..., replicates, ...)``, as tasks return them; the grid comes first.
        """
        sums = columns
        sample = self.asked
        of_parts = sums["runs"].ndim - 3
        size = sample.size * len(sample.own)
        total = float(size * sample.replicates)
        found: Columns = {"runs": sums["runs"]}
        # Replicates last, certified runs and all runs of a word.
        counts = np.moveaxis(sums["runs"], of_parts, -1)
        sure, reported = counts[..., 1, :], counts.sum(axis=-2)
        unsure = counts[..., 0, :].sum(axis=-2, keepdims=True)
        found["probability"] = reported.sum(axis=-1) / total
        low, high = _both_ways(found, "probability", sure, unsure, size, sample)
        without = np.subtract(*share_interval(reported, size, sample.independent)[::-1])
        found["probability_numerics"] = np.maximum(high - low - without, 0.0)
        if sample.survival:
            lost = np.moveaxis(sums["lost"], of_parts, -1)
            held = size - lost.sum(axis=-2)
            found["survival"] = held.sum(axis=-1) / total
            _both_ways(found, "survival", size - unsure - lost[..., 1, :], unsure, size, sample)
        for name in sample.quantiles:
            values, levels = sums[f"{name}_values"], _levels(sample)
            each = [quantiles(values[cell], levels, sample.independent) for cell in np.ndindex(values.shape[:-2])]
            in_cells = np.reshape(each, (*values.shape[:-2], 3, len(levels)))
            found |= {f"{name}_quantile{end}": in_cells[..., k, :] for k, end in enumerate(QUANTILE_ENDS)}
        for prefix in ("", *(f"{name}_" for name in sample.sensitive)) if sample.sensitivity else ():
            together = np.moveaxis(sums[f"{prefix}sobol_sums"], of_parts, -2)
            for name, index in zip(("sobol_first", "sobol_total"), sobol_indices(together, sample.size), strict=True):
                found |= {f"{prefix}{name}{end}": part for end, part in zip(QUANTILE_ENDS, index, strict=True)}
        return found | {name: column for name, column in sums.items() if name in OUTCOMES}


def _both_ways(
    found: Columns, name: str, sure: NDArray[Any], unsure: NDArray[Any], size: int, sample: Sample
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Add the interval of a share in which each uncertified run counts once as a miss and once as a hit."""
    low, _ = share_interval(sure, size, sample.independent)
    _, high = share_interval(np.minimum(sure + unsure, size), size, sample.independent)
    found[f"{name}_low"], found[f"{name}_high"] = low, high
    return low, high


def _levels(sample: Sample) -> NDArray[np.float64]:
    return np.unique([level for levels in sample.quantiles.values() for level in levels])


def _beginning_with(start: str, dims: tuple[str, ...]) -> dict[str, Variable]:
    """Statistics whose names begin alike, with their dimensions within a cell."""
    return {name: replace(one, dims=dims) for name, one in SAMPLED.items() if name.startswith(start)}


def nominal(ds: xr.Dataset) -> Config:
    """The sweep of a sampled one without its sample: every uncertain parameter has its median.

    Raises
    ------
    InputError
        If an uncertain parameter is a ratio to one that the grid varies.
    """
    source = json.loads(ds.attrs["configuration"])
    config = load(source)
    sample = config.sample
    assert sample is not None
    axes = sample.axes(config.scene, config.axes, np.full((1, len(sample.factors)), 0.5))
    settings: list[Setting] = []
    for path in (path for factor in sample.factors for path in factor.paths):
        dims, column = axes.columns[path]
        if len(dims) > 1:
            raise InputError("boundaries", f"{path} is a ratio to an axis: no sweep at the medians is a grid")
        settings.append((path, column.item()))
    sweep = {key: value for key, value in source["sweep"].items() if key != "sample"}
    return load(source | {"sweep": sweep}, settings)
