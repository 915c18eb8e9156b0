"""What every method offers to a sweep."""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass
from typing import Any, ClassVar, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ringsweep.compile import lacking
from ringsweep.errors import InputError
from ringsweep.models import MODELS
from ringsweep.models.scene import Structure
from ringsweep.physics.drives import DRIVES
from ringsweep.physics.friction import LAWS


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


class Needs(NamedTuple):
    """Functions that a method needs of a friction law, of a drive, and of a model's type of scene."""

    law: tuple[Any, ...]
    drive: tuple[Any, ...]
    model: tuple[Any, ...]


class Method(ABC):
    """A way to advance time. Its options are the fields of the dataclass that derives from it."""

    name: ClassVar[str]
    side_by_side: ClassVar[int] = 1
    """Cells that it runs at once: fewer take as long."""

    @abstractmethod
    def needs(self, structure: Structure) -> Needs:
        """Functions that the method needs of law, drive and model of such a scene."""

    def check(self, structure: Structure) -> None:
        """Make sure that the method can take such a scene.

        Raises
        ------
        InputError
            If the method does not take the law, or if law, drive or model lack a function that it needs.
        """
        needs = self.needs(structure)
        scene = MODELS[structure.model].scene_type(structure)
        for key, name, cls, members in (
            ("friction.law", structure.law, LAWS[structure.law], needs.law),
            ("drive.law", structure.drive, DRIVES[structure.drive], needs.drive),
            ("model", structure.model, scene, needs.model),
        ):
            if missing := lacking(cls, members):
                kind = key.split(".")[0]
                raise InputError(
                    f"scene.{key}", f"{kind} {name} has no function `{missing[0]}`, which solver {self.name} needs"
                )

    def resolved(self, structure: Structure) -> Method:
        """The method, with its tolerances, that such a scene is run by."""
        return self

    @abstractmethod
    def run(self, batch: Any, outcomes: tuple[str, ...]) -> Result:
        """Run every cell of `batch`; `outcomes` names the model's columns."""

    @abstractmethod
    def history(self, batch: Any, samples: int, width: int) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Time history of cell 0 in about `samples` rows of `width` columns."""
