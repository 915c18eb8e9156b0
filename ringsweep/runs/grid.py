"""Plans of sweeps whose cells are all run: which cells, in which order, and what is kept of them."""

from __future__ import annotations

import os
from collections.abc import Callable, Collection, Iterator, Mapping
from dataclasses import replace
from functools import partial
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from ringsweep.config import Config
from ringsweep.config.options import BOTH, DIRECTION
from ringsweep.errors import InputError
from ringsweep.models import model_of
from ringsweep.quantities.variables import OUTCOMES, Variable
from ringsweep.runs.cells import TaskResult, compute_task, coordinates
from ringsweep.runs.reuse import EarlierSweep
from ringsweep.runs.warnings import warn_of_results
from ringsweep.solvers.certificate import with_errors
from ringsweep.storage.checkpoint import Checkpoint
from ringsweep.storage.chunks import Layout
from ringsweep.storage.provenance import attributes

if TYPE_CHECKING:
    from ringsweep.runs.sweep import Work

Columns = dict[str, NDArray[Any]]
Chunk = tuple[tuple[slice, ...], Columns]


class Grid:
    """Plan of a sweep that runs each cell of a grid once.

    Parameters
    ----------
    config : Config
    asked : object
        What the configuration says of this kind of sweep, such as ``config.sample``.
    reuse : path-like, optional
        File of an earlier sweep whose cells are taken.
    whole : bool
        Whether all cells are one chunk, as in memory.

    Attributes
    ----------
    config : Config
    earlier : EarlierSweep, optional
    grid, layout : Layout
        Order of the cells, and of what tasks compute: the cells, or parts of them.
    side_by_side : int
        Number of parts that the solver runs at once.
    parts_of_cell, runs_of_cell : int
    """

    #: Dimension or variable by which a file of this kind is known, and its content in words.
    kind: ClassVar[tuple[str, str]] = ("regime", "sweep")
    #: What tasks compute, in words.
    parts: ClassVar[str] = "cells"
    #: Whether it is not known before how many of the cells are run.
    at_most: ClassVar[bool] = False
    #: Columns of whole numbers in which a value may be missing.
    gaps: ClassVar[Collection[str]] = ()
    #: Why no cells of an earlier sweep can be taken, if they cannot.
    takes_none: ClassVar[str] = ""
    parts_of_cell = runs_of_cell = 1

    def __init__(self, config: Config, asked: Any, reuse: str | os.PathLike[str] | None, whole: bool):
        if reuse is not None and self.takes_none:
            raise InputError("--reuse", self.takes_none)
        self.config, self.asked, self.side_by_side = config, asked, config.solver.side_by_side
        self.earlier = None if reuse is None else EarlierSweep(reuse, config)
        sizes, section = tuple(config.axes.sizes.values()), config.scene.structure.section
        self.grid = self.layout = Layout(sizes, sizes if whole else None, 1 if section is None else section.keep)

    def bytes_of_cell(self) -> int:
        """Size of the columns of a cell; variables that some solvers leave out are counted."""
        structure = self.config.scene.structure
        model = model_of(structure)
        names = [name for name in model.columns(structure) if name not in model.absent]
        bounded = with_errors(model.outcomes) if self.config.certifies else ()
        names += ["steps", "certified", "uncertified_because", "stiffness", *(f"{name}_error" for name in bounded)]
        return sum(np.dtype(OUTCOMES[name].dtype).itemsize for name in names)

    def variables(self) -> Mapping[str, Variable]:
        """Declarations of the variables."""
        return model_of(self.config.scene.structure).variables

    def task(self) -> Callable[[NDArray[np.integer]], TaskResult]:
        """Function that computes the parts at some positions of the layout."""
        # Other processes get it with every task: points as they were written are long.
        return partial(compute_task, replace(self.config, source={}), self.layout)

    def together(self) -> NDArray[np.integer] | None:
        """Positions of parts that stay in one task, a row for each group; None if each is alone."""
        return None

    def compute(self, work: Work) -> None:
        """Compute the parts that the store lacks."""
        work.take_shared(work.store.done)
        if not work.store.done.all():
            with work.begun(self.layout.total):
                work.run(self.together())
                if not work.store.done.all():
                    raise KeyboardInterrupt

    def columns(self, columns: Columns) -> Columns:
        """Columns of the dataset, from those of the parts of the whole grid."""
        return columns

    def chunks(self, checkpoint: Checkpoint) -> Iterator[Chunk]:
        """Slices of each chunk in the grid, and the columns of the file there."""
        return checkpoint.chunks()

    def coordinates(self) -> dict[str, Any]:
        """Coordinates of the dataset."""
        return coordinates(self.config.scene, self.config.axes.columns)

    def attributes(self) -> dict[str, Any]:
        """Attributes of the dataset, once all cells are known."""
        return attributes(self.config)

    def warn(self, results: xr.Dataset) -> None:
        """Warn of what the results show."""
        warn_of_results(results, self.config)


class Chains(Grid):
    """Plan of a sweep in which each cell along an axis starts where the one before ended."""

    takes_none = "cells of sweep.follow start from the cells before them: leave one of them out"

    def together(self) -> NDArray[np.integer]:
        """Positions of the cells of each chain."""
        dim, _ = self.asked.chains(self.config.axes)
        sizes = self.layout.sizes
        positions = self.layout.positions(list(np.indices(sizes).reshape(len(sizes), -1))).reshape(sizes)
        along = list(self.config.axes.sizes).index(dim)
        return np.moveaxis(positions, along, -1).reshape(-1, sizes[along])

    def coordinates(self) -> dict[str, Any]:
        """Coordinates of the dataset."""
        found = super().coordinates()
        if DIRECTION in self.config.axes.sizes:
            about = {"long_name": f"direction in which {self.asked.axis} is followed"}
            found[DIRECTION] = DIRECTION, list(BOTH), about
        return found
