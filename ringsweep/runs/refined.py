"""Refined sweeps: the cells that decisions ask for are run, and the others get what was inferred."""

from __future__ import annotations

import json
import math
from collections.abc import Callable, Iterable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ringsweep.config import Config
from ringsweep.config.refine import Refinement
from ringsweep.quantities.units import percent_at_most
from ringsweep.quantities.variables import INFERRED, LABELS, MISSING, OUTCOMES
from ringsweep.runs.refinement import Answer, Findings, Refined, refine
from ringsweep.storage.chunks import Layout

#: Seed of the audit: a sweep that is repeated audits the same cells.
SEED = 18

# No classification has as many flags.
_FLAGS = 13

Columns = dict[str, NDArray[Any]]


class KnownLabels:
    """Labels of the cells that are known, by position in the layout.

    Attributes
    ----------
    known : ndarray of bool, shape ``(cells,)``
    """

    def __init__(self, config: Config, total: int):
        assert config.refine is not None
        self.also = config.refine.also
        # Without certificates no cell is certified, and that says nothing.
        self.asks_certificate = config.certifies
        self.known = np.zeros(total, dtype=bool)
        self._labels = np.zeros(total, dtype=np.int16)
        self._certain = np.zeros(total, dtype=bool)
        self._values = None if self.also is None else np.full(total, np.nan)

    @property
    def names(self) -> list[str]:
        """Columns that are needed."""
        return [*LABELS, "certified", *([] if self.also is None else [self.also])]

    def put(self, positions: NDArray[np.integer], columns: Columns) -> None:
        """Add cells that have been run."""
        labels = np.zeros(len(positions), dtype=np.int16)
        for k, name in enumerate(LABELS):
            if name in columns:
                labels += columns[name].astype(np.int16) * np.int16(_FLAGS**k)
        self._labels[positions] = labels
        self._certain[positions] = (columns["certified"] == 1) if self.asks_certificate else True
        if self._values is not None:
            self._values[positions] = columns[str(self.also)]
        self.known[positions] = True

    def at(self, positions: NDArray[np.integer]) -> Answer:
        """Labels of known cells."""
        values = None if self._values is None else self._values[positions]
        return Answer(self._labels[positions], self._certain[positions], values)


def decide(config: Config, layout: Layout, labels: KnownLabels, run: Callable[[NDArray[np.intp]], None]) -> Refined:
    """Run the cells of a refined sweep, round after round.

    Decisions follow from labels alone, so a sweep that was stopped takes the same decisions again.

    Parameters
    ----------
    config : Config
    layout : Layout
        Order of the cells.
    labels : KnownLabels
        What is known; `run` adds to it.
    run : callable
        Runs the cells at these positions, which ascend.

    Returns
    -------
    Refined
        Arrays in the shape of the grid.
    """
    assert config.refine is not None
    sizes = config.axes.sizes
    dims = [*(dim for dim in sizes if dim not in config.refine.dims), *config.refine.dims]
    grid = tuple(sizes[dim] for dim in dims)
    rows, columns = [*(sizes[dim] for dim in config.refine.dims), 1][:2]
    layers = math.prod(grid[: len(grid) - len(config.refine.dims)])
    asked = config.refine.stride, config.refine.audit
    decisions = refine((layers, rows, columns), *asked, within=config.refine.within, seed=SEED)
    order = [dims.index(dim) for dim in sizes]
    answer = None
    while True:
        try:
            cells = next(decisions) if answer is None else decisions.send(answer)
        except StopIteration as end:
            found = end.value
            break
        indices = np.unravel_index(cells, grid)
        positions = layout.positions([indices[k] for k in order])
        missing = np.sort(positions[~labels.known[positions]])
        if len(missing):
            run(missing)
        answer = labels.at(positions)

    labels_of_grid, origin, level = (
        array.reshape(grid).transpose(order) for array in (found.labels, found.origin, found.level)
    )
    values = None if found.values is None else found.values.reshape(grid).transpose(order)
    return Refined(labels_of_grid, origin, level, values, found.audit)


def complete(config: Refinement, refined: Refined, region: tuple[slice, ...], columns: Columns) -> None:
    """Fill the inferred cells of a part of the grid, and add what the refinement says of its cells.

    Numbers are missing where a cell is inferred: NaN, or `MISSING` among whole numbers.

    Parameters
    ----------
    config : Refinement
    refined : Refined
    region : tuple of slice
        The part of the grid.
    columns : dict of str to ndarray
        Columns in the shape of the part.
    """
    inferred = refined.origin[region] == INFERRED
    labels = refined.labels[region][inferred]
    for name, column in columns.items():
        if name in LABELS:
            column[inferred] = labels // _FLAGS ** LABELS.index(name) % _FLAGS
        elif name == config.also and refined.values is not None:
            column[inferred] = refined.values[region][inferred]
        else:
            column[inferred] = np.nan if column.dtype.kind == "f" else MISSING
    columns["origin"], columns["level"] = refined.origin[region], refined.level[region]


def gaps(names: Iterable[str]) -> list[str]:
    """Columns of whole numbers that are missing where a cell is inferred."""
    return [
        name for name in names if OUTCOMES[name].dtype.startswith("int") and name not in (*LABELS, "origin", "level")
    ]


def with_nan(column: NDArray[Any]) -> NDArray[Any]:
    """A column of whole numbers as floats with NaN for `MISSING`, in the type in which xarray reads it from a file."""
    floats = column.astype(np.float32 if column.dtype.itemsize <= 2 else np.float64)
    floats[column == MISSING] = np.nan
    return floats


def attributes(config: Refinement, refined: Refined) -> dict[str, Any]:
    """Attributes of a refined dataset: what was run, and what the audit says."""
    audit, total = refined.audit, refined.origin.size
    computed = total - int(np.count_nonzero(refined.origin == INFERRED))
    found = {
        "cells_computed": computed,
        "audit_cells": audit.cells,
        "audit_wrong_before": audit.wrong,
        "audit_corrected": audit.corrected,
        "audit_bound": audit.bound,
        "audit_seed": SEED,
        "audit": f"{computed} of {total} cells are run ({100 * computed / total:.3g} %), the others are inferred; "
        + _in_words(audit, config),
        "refined_dimensions": json.dumps(config.dims),
    }
    if audit.far is not None:
        found |= {"audit_far_before": audit.far, "audit_far_bound": audit.far_bound}
    return found


def _in_words(audit: Findings, config: Refinement) -> str:
    if not audit.cells:
        return "none of them is audited"
    words = f"{audit.cells} of the inferred cells are audited: {audit.wrong} had been inferred wrongly"
    if audit.wrong or audit.corrected:
        words += f", {audit.corrected} were corrected in following these"
    words += f"; of the cells still inferred at most {percent_at_most(audit.bound)} are wrong"
    if audit.far is not None and audit.far_bound is not None:
        words += (
            f"; {audit.far} audited cells had lacked {config.also}, or were off by more than {config.within:g}, "
            f"and of those still inferred at most {percent_at_most(audit.far_bound)} do or are"
        )
    return f"{words} (at 95 % confidence)"
