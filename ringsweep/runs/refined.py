"""Plan of a refined sweep: the cells that decisions ask for are run, and the others get what was inferred."""

from __future__ import annotations

import json
import math
from collections.abc import Iterator
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from ringsweep.quantities.units import percent_at_most
from ringsweep.quantities.variables import INFERRED, LABELS, MISSING, OUTCOMES
from ringsweep.runs.decisions import Decided, Run, refine
from ringsweep.runs.grid import Chunk, Columns, Grid
from ringsweep.storage.checkpoint import Checkpoint

if TYPE_CHECKING:
    from ringsweep.runs.sweep import Work

#: Seed of the audit: a sweep that is repeated audits the same cells.
SEED = 18

# No classification has as many flags.
_FLAGS = 13


class Refined(Grid):
    """Plan of a sweep of which only the boundaries of the map are run."""

    at_most = True
    gaps: ClassVar[list[str]] = [
        name
        for name, variable in OUTCOMES.items()
        if variable.dtype.startswith("int") and name not in (*LABELS, "origin", "level")
    ]

    def compute(self, work: Work) -> None:
        """Compute the cells that decisions ask for."""
        total = self.layout.total
        known, labels = np.zeros(total, dtype=bool), np.zeros(total, dtype=np.int16)

        def put(positions: NDArray[np.integer], columns: Columns) -> None:
            own = np.zeros(len(positions), dtype=np.int16)
            for k, name in enumerate(LABELS):
                if name in columns:
                    own += columns[name].astype(np.int16) * np.int16(_FLAGS**k)
            # Without certificates no cell is certified, and that says nothing.
            certain = (columns["certified"] == 1) | (not self.config.certifies)
            labels[positions], known[positions] = np.where(certain, own, ~own), True

        for positions, columns in work.store.finished():
            put(positions, dict(columns))
        # Which cells an earlier sweep must give is known at the end: until then its labels are enough.
        if self.earlier is not None:
            names = [*LABELS, "certified"]
            for positions, columns in self.earlier.shared_cells(self.config, self.layout, known, names):
                put(positions, columns)
        work.notice = put

        def run(positions: NDArray[np.intp]) -> NDArray[np.int16]:
            missing = np.sort(positions[~known[positions]])
            if len(missing):
                work.run(missing[:, None])
                if not known[missing].all():
                    raise KeyboardInterrupt
            return labels[positions]

        with work.begun(None):
            self._decided = self._decide(run)
        if self.earlier is not None:
            needed = np.zeros(total, dtype=bool)
            needed[self.layout.positions(np.nonzero(self._decided.origin != INFERRED))] = True
            work.take_shared(work.store.done | ~needed)

    def _decide(self, run: Run) -> Decided:
        """Run the cells of a refined sweep, round after round; arrays of the result have the shape of the grid.

        Decisions follow from labels alone, so a sweep that was stopped takes the same decisions again. `run` takes
        positions in the layout.
        """
        asked, sizes = self.asked, self.config.axes.sizes
        dims = [*(dim for dim in sizes if dim not in asked.axes), *asked.axes]
        grid = tuple(sizes[dim] for dim in dims)
        rows, columns = [*(sizes[dim] for dim in asked.axes), 1][:2]
        layers = math.prod(grid[: len(grid) - len(asked.axes)])
        order = [dims.index(dim) for dim in sizes]

        def run_cells(cells: NDArray[np.intp]) -> NDArray[np.int16]:
            indices = np.unravel_index(cells, grid)
            return run(self.layout.positions([indices[k] for k in order]))

        found = refine((layers, rows, columns), asked.stride, asked.audit, run_cells, seed=SEED)

        def in_grid(array: NDArray[Any]) -> NDArray[Any]:
            return array.reshape(grid).transpose(order)

        return Decided(in_grid(found.labels), in_grid(found.origin), in_grid(found.level), found.audit)

    def _complete(self, region: tuple[slice, ...], columns: Columns) -> None:
        """Fill the inferred cells of a part of the grid, and add what the refinement says of its cells.

        Numbers are missing where a cell is inferred: NaN, or `MISSING` among whole numbers.
        """
        decided = self._decided
        inferred = decided.origin[region] == INFERRED
        labels = decided.labels[region][inferred]
        for name, column in columns.items():
            if name in LABELS:
                column[inferred] = labels // _FLAGS ** LABELS.index(name) % _FLAGS
            else:
                column[inferred] = np.nan if column.dtype.kind == "f" else MISSING
        columns["origin"], columns["level"] = decided.origin[region], decided.level[region]

    def columns(self, columns: Columns) -> Columns:
        """Columns of the dataset, from those of the cells that were run."""
        self._complete(tuple(slice(None) for _ in self.layout.sizes), columns)
        for name in set(self.gaps) & set(columns):
            # Floats with NaN for `MISSING`, in the type in which xarray reads them from a file.
            floats = columns[name].astype(np.float32 if columns[name].dtype.itemsize <= 2 else np.float64)
            columns[name] = np.where(columns[name] == MISSING, np.array(np.nan, floats.dtype), floats)
        return columns

    def chunks(self, checkpoint: Checkpoint) -> Iterator[Chunk]:
        """Slices of each chunk in the grid, and the columns of the file there."""

        def fill(region: tuple[slice, ...], missing: NDArray[np.bool_], columns: Columns) -> bool:
            self._complete(region, columns)
            return not (missing & (self._decided.origin[region] != INFERRED)).any()

        return checkpoint.chunks(fill)

    def attributes(self) -> dict[str, Any]:
        """Attributes of the dataset: also what was run, and what the audit says."""
        audit, total = self._decided.audit, self._decided.origin.size
        computed = total - int(np.count_nonzero(self._decided.origin == INFERRED))
        words = f"{computed} of {total} cells are run ({100 * computed / total:.3g} %), the others are inferred; "
        if audit.cells:
            words += f"{audit.cells} of the inferred cells are audited: {audit.wrong} had been inferred wrongly"
            words += f", {audit.corrected} were corrected in following these" * bool(audit.wrong or audit.corrected)
            most = percent_at_most(audit.bound)
            words += f"; of the cells still inferred at most {most} are wrong (at 95 % confidence)"
        else:
            words += "none of them is audited"
        return super().attributes() | {
            "cells_computed": computed,
            "audit_cells": audit.cells,
            "audit_wrong_before": audit.wrong,
            "audit_corrected": audit.corrected,
            "audit_bound": audit.bound,
            "audit_seed": SEED,
            "audit": words,
            "refined_dimensions": json.dumps(self.asked.axes),
        }
