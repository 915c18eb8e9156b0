"""What every method offers to a sweep."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from ringsweep.models.scene import Structure


@dataclass(frozen=True)
class Result:
    """Outcomes of a batch.

    Attributes
    ----------
    rows : ndarray of shape ``(cells, outcomes)``
        The model's outcomes, in the order of its columns.
    steps, certified : ndarray of shape ``(cells,)``
    stiffness : ndarray of shape ``(cells,)``, optional
        Only from methods of fixed step.
    errors : ndarray of shape ``(cells, numbers)``, optional
        Bounds on the errors of the numbers that :func:`with_errors` names, NaN where there is none; only where
        certificates are sought.
    """

    rows: NDArray[np.float64]
    steps: NDArray[Any]
    certified: NDArray[np.bool_]
    stiffness: NDArray[np.float64] | None = None
    errors: NDArray[np.float64] | None = None


class Method(ABC):
    """A way to advance time. Its options are the fields of the dataclass that derives from it."""

    name: ClassVar[str]
    side_by_side: ClassVar[int] = 1
    """Cells that it runs at once: fewer take as long."""

    def check(self, structure: Structure) -> None:  # noqa: B027  most methods take every scene
        """Raise an `InputError` if the method cannot take such a scene."""

    def resolved(self, structure: Structure) -> Method:
        """The method, with its tolerances, that such a scene is run by."""
        return self

    @abstractmethod
    def run(self, batch: Any, outcomes: tuple[str, ...]) -> Result:
        """Run every cell of `batch`; `outcomes` names the model's columns."""

    @abstractmethod
    def history(self, batch: Any, samples: int, width: int) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Time history of cell 0 in about `samples` rows of `width` columns."""


def same_drive(batch: Any, cells: NDArray[np.intp]) -> Iterator[NDArray[np.intp]]:
    """Groups of `cells` that share span and shape of the drive, whatever its amplitude."""
    shape = [
        leaf
        for name, leaf in zip(batch.drive._fields, batch.drive, strict=True)
        if name != "amplitude" and leaf.ndim == 1
    ]
    keys = np.stack([batch.span, *shape], axis=1)[cells]
    _, group = np.unique(keys, axis=0, return_inverse=True)
    order = np.argsort(group, kind="stable")
    yield from np.split(cells[order], np.flatnonzero(np.diff(group[order])) + 1)
