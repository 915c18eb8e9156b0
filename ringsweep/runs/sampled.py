"""Sampled sweeps: runs at the points of a sample are reduced to sums, and sums to probabilities.

A part of a cell is what one replicate of the sample adds to it. A task runs some parts, and keeps sums of each, whose
size does not depend on the number of runs, and the numbers whose quantiles are asked for.
"""

from __future__ import annotations

import json
import math
from dataclasses import replace
from typing import Any

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from ringsweep.config import Config, Setting, load, sweepable
from ringsweep.config.axes import dimension
from ringsweep.config.sampling import CENSORED, Sample, censored
from ringsweep.errors import InputError
from ringsweep.models import model_of
from ringsweep.quantities.flags import REGIMES
from ringsweep.quantities.variables import QUANTILE_ENDS, SAMPLED, Variable
from ringsweep.runs.cells import TaskResult, compute_task
from ringsweep.statistics import CONFIDENCE, quantiles, share_interval, sobol_indices, sobol_sums
from ringsweep.storage.chunks import CHUNK, Layout, chunk_shape
from ringsweep.storage.provenance import environment, processor

Columns = dict[str, NDArray[Any]]

# Bytes of the sums of a chunk, and of a run that is kept.
_CHUNK_BYTES, _RUN_BYTES = 32e6, 200


def grid_layout(config: Config, whole: bool = False) -> Layout:
    """Order of the cells of a sampled sweep; in one chunk, or in chunks whose sums fit into the memory."""
    sizes = tuple(config.axes.sizes.values())
    if whole:
        return Layout(sizes, sizes)
    most = max(int(_CHUNK_BYTES / (bytes_of_part(config) * _sample(config).replicates)), 1)
    return Layout(sizes, chunk_shape(sizes, min(most, CHUNK)))


def part_layout(config: Config, grid: Layout) -> Layout:
    """Order of the parts of all cells: those of a cell stand together."""
    replicates = _sample(config).replicates
    return Layout((*grid.sizes, replicates), (*grid.chunk, replicates))


def bytes_of_part(config: Config) -> int:
    """Size of the sums of a part, and of its runs if they are kept."""
    sample = _sample(config)
    sums = sum(math.prod(shape) * np.dtype(dtype).itemsize for dtype, shape in _sums_of(sample).values())
    return sums + sample.keep * sample.size * sample.rows * _RUN_BYTES


def _sample(config: Config) -> Sample:
    assert config.sample is not None
    return config.sample


def _sums_of(sample: Sample) -> dict[str, tuple[str, tuple[int, ...]]]:
    """Type and shape of the sums of a part, by name."""
    found: dict[str, tuple[str, tuple[int, ...]]] = {"runs": ("int32", (len(REGIMES), 2))}
    if sample.survival:
        found["lost"] = "int32", (len(sample.survival), 2)
    for name in sample.quantiles:
        found[f"{name}_values"] = "float64", (sample.size * len(sample.own),)
    if sample.sensitivity:
        each = 3 * (len(sample.factors) + 1)
        found["sobol_sums"] = "float64", (len(REGIMES), each)
        for name in sample.sensitive:
            found[f"{name}_sobol_sums"] = "float64", (*([len(sample.survival)] if name in CENSORED else []), each)
    return found


def compute_parts(config: Config, layout: Layout, positions: NDArray[np.integer]) -> TaskResult:
    """Run the parts at some positions of the layout of parts, and reduce each to its sums."""
    sample = _sample(config)
    cells, replicates = np.divmod(positions, sample.replicates)
    sums = {name: np.zeros((len(positions), *shape), dtype=dtype) for name, (dtype, shape) in _sums_of(sample).items()}
    seconds: float | None = 0.0
    grid = Layout(layout.sizes[:-1], layout.chunk[:-1])
    for replicate in np.unique(replicates).tolist():
        shares = sample.shares(replicate)
        runs = len(shares)
        axes = sample.axes(config.scene, config.axes, shares)
        one = replace(config, axes=axes, sample=None)
        # A cell and its runs stand together, so a run has the position of its cell times their number.
        of_runs = Layout((*grid.sizes, runs), (*grid.chunk, runs))
        own = np.flatnonzero(replicates == replicate)
        together = max(CHUNK // runs, 1)
        for some in (own[start : start + together] for start in range(0, len(own), together)):
            numbers = (cells[some, None] * runs + np.arange(runs)).ravel()
            found: list[TaskResult] = []
            for start in range(0, len(numbers), CHUNK):
                result = compute_task(one, of_runs, numbers[start : start + CHUNK])
                seconds = None if result.seconds is None or seconds is None else seconds + result.seconds
                needed = list(result.columns) if sample.keep else _needed(config)
                found.append(replace(result, columns={name: result.columns[name] for name in needed}))
            columns = {
                name: np.concatenate([result.columns[name] for result in found]).reshape(len(some), runs)
                for name in needed
            }
            if sample.keep:
                for name, column in columns.items():
                    sums.setdefault(name, np.empty((len(positions), runs), dtype=column.dtype))[some] = column
            for k, part in enumerate(some.tolist()):
                of_run = {name: column[k] for name, column in columns.items()}
                of_part = _reduce(sample, censored(config.scene), of_run)
                for name, value in of_part.items():
                    sums[name][part] = value
    return TaskResult(positions, sums, seconds, environment(), processor())


def _needed(config: Config) -> list[str]:
    """Outcomes that are reduced."""
    sample = _sample(config)
    times = [censored(config.scene)] if sample.survival else []
    return list(dict.fromkeys(["regime", "certified", *times, *sample.quantiles, *sample.sensitive]))


def _reduce(sample: Sample, time: str, columns: Columns) -> Columns:
    """The sums of one part, from the outcomes of its runs; `time` is the variable of survival."""
    # A row for each point.
    rows = {name: column.reshape(-1, sample.rows) for name, column in columns.items()}
    points = {name: column[:, sample.own].ravel() for name, column in rows.items()}
    sure = points["certified"] == 1
    found: Columns = {"runs": np.zeros((len(REGIMES), 2), dtype=np.int32)}
    np.add.at(found["runs"], (points["regime"], sure.astype(int)), 1)
    if sample.survival:
        lost = points[time][:, None] <= np.array(sample.survival)
        found["lost"] = np.stack([lost[~sure].sum(axis=0), lost[sure].sum(axis=0)], axis=-1)
    for name in sample.quantiles:
        # What did not happen within the span happens later, if ever; without a certificate nothing is known.
        happened = np.where(np.isnan(points[name]), np.inf, points[name])
        found[f"{name}_values"] = np.where(sure, happened, np.nan)
    if sample.sensitivity:
        each = [sobol_sums((rows["regime"] == flag).astype(float)) for flag in range(len(REGIMES))]
        found["sobol_sums"] = np.stack(each)
        for name in sample.sensitive:
            # A time that has not come is not a number, and compares as later.
            functions = [rows[name] <= t for t in sample.survival] if name in CENSORED else [rows[name]]
            each = [sobol_sums(function.astype(float)) for function in functions]
            found[f"{name}_sobol_sums"] = np.stack(each) if name in CENSORED else each[0]
    return found


def statistics(config: Config, sums: Columns) -> Columns:
    """Probabilities, quantiles and indices of cells, from the sums of their parts.

    Parameters
    ----------
    config : Config
    sums : dict of str to ndarray of shape ``(..., replicates, ...)``
        As tasks return them; the first dimensions are those of the grid.
    """
    sample = _sample(config)
    shape = sums["runs"].shape[:-3]
    flat = {name: column.reshape(-1, *column.shape[len(shape) :]) for name, column in sums.items()}
    size = sample.size * len(sample.own)
    total = float(size * sample.replicates)
    found: Columns = {"runs": flat["runs"]}
    # Replicates last, certified runs and all runs of a word.
    counts = np.moveaxis(flat["runs"], 1, -1)
    sure, reported = counts[:, :, 1], counts.sum(axis=2)
    unsure = counts[:, :, 0].sum(axis=1)
    found["probability"] = reported.sum(axis=-1) / total
    low, high = _both_ways(found, "probability", sure, unsure[:, None], size, sample)
    without = np.subtract(*share_interval(reported, size, sample.independent)[::-1])
    found["probability_numerics"] = np.maximum(high - low - without, 0.0)
    if sample.survival:
        lost = np.moveaxis(flat["lost"], 1, -1)
        held, certain = size - lost.sum(axis=2), size - unsure[:, None] - lost[:, :, 1]
        found["survival"] = held.sum(axis=-1) / total
        _both_ways(found, "survival", certain, unsure[:, None], size, sample)
    for name, levels in sample.quantiles.items():
        rows = [quantiles(values, levels, sample.independent) for values in flat[f"{name}_values"]]
        place = np.searchsorted(_levels(sample), levels)
        for k, end in enumerate(("", "_low", "_high")):
            column = found[f"{name}_quantile{end}"] = np.full((len(rows), len(_levels(sample))), np.nan)
            column[:, place] = [row[k] for row in rows]
    if sample.sensitivity:
        for prefix in ("", *(f"{name}_" for name in sample.sensitive)):
            together = np.moveaxis(flat[f"{prefix}sobol_sums"], 1, -2)
            for name, index in zip(("sobol_first", "sobol_total"), sobol_indices(together, sample.size), strict=True):
                found |= {f"{prefix}{name}{end}": part for end, part in zip(("", "_low", "_high"), index, strict=True)}
    found |= {name: column for name, column in flat.items() if name not in _sums_of(sample)}
    return {name: column.reshape((*shape, *column.shape[1:])) for name, column in found.items()}


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


def coordinates(config: Config) -> dict[str, Any]:
    """Coordinates of the statistics of a cell, and of its runs if they are kept."""
    sample = _sample(config)
    found: dict[str, Any] = {
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
        each = [sample.axes(config.scene, config.axes, sample.shares(r)).columns for r in range(sample.replicates)]
        known = sweepable(config.scene)
        for path in (path for factor in sample.factors for path in factor.paths):
            dims = each[0][path][0]
            column = np.stack([columns[path][1] for columns in each], axis=-2)
            found[dimension(path)] = (*dims[:-1], "replicate", "sample"), column, known[path].attributes
    return found


def variables(config: Config) -> dict[str, Variable]:
    """Declarations of the statistics; their dimensions are those within a cell."""
    sample = _sample(config)
    found = {"runs": replace(SAMPLED["runs"], dims=("replicate", "word", "certificate"))}
    found |= _beginning_with("probability", ("word",))
    if sample.survival:
        found |= _beginning_with("survival", ("survival_time",))
    known = model_of(config.scene.structure).variables
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
        found |= {name: replace(one, dims=("replicate", "sample")) for name, one in known.items() if name not in found}
    return found


def _beginning_with(start: str, dims: tuple[str, ...]) -> dict[str, Variable]:
    """Statistics whose names begin alike, with their dimensions within a cell."""
    return {name: replace(one, dims=dims) for name, one in SAMPLED.items() if name.startswith(start)}


def attributes(config: Config) -> dict[str, Any]:
    """Attributes that say what was sampled, and how the intervals follow from it."""
    sample = _sample(config)
    way = "Clopper and Pearson" if sample.independent else "scatter of the replicates (Korn and Graubard)"
    points = f"{sample.n * len(sample.own)} runs"
    rest = f", and {sample.n * len(sample.factors)} more for the indices" if sample.sensitivity else ""
    return {
        "sample": f"{points} in each cell{rest}: {sample.method}, seed {sample.seed}, {sample.replicates} replicates; "
        + "; ".join(f"{factor.name} {factor}" for factor in sample.factors),
        "sample_interval": f"{100 * CONFIDENCE:g} %: {way}; a run that is not certified counts both ways",
        **({"survival_of": censored(config.scene)} if sample.survival else {}),
    }


def nominal(ds: xr.Dataset) -> Config:
    """The sweep of a sampled one without its sample: every uncertain parameter has its median.

    Raises
    ------
    InputError
        If an uncertain parameter is a ratio to one that the grid varies.
    """
    source = json.loads(ds.attrs["configuration"])
    config = load(source)
    sample = _sample(config)
    axes = sample.axes(config.scene, config.axes, np.full((1, len(sample.factors)), 0.5))
    settings: list[Setting] = []
    for path in (path for factor in sample.factors for path in factor.paths):
        dims, column = axes.columns[path]
        if len(dims) > 1:
            raise InputError("boundaries", f"{path} is a ratio to an axis: no sweep at the medians is a grid")
        settings.append((path, column.item()))
    sweep = {key: value for key, value in source["sweep"].items() if key != "sample"}
    return load(source | {"sweep": sweep}, settings)
