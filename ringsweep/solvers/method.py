"""Base class of all methods, and the results that they return to a sweep.

``ringsweep/runs`` calls a method for each batch of cells; `structure` is a :class:`ringsweep.models.scene.Structure`.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from ringsweep.compile import has_known_source, lacking
from ringsweep.errors import InputError
from ringsweep.models import model_of
from ringsweep.models.scene import Structure
from ringsweep.physics.friction import TRAITS, Dynamic, family_of


@dataclass(frozen=True)
class Result:
    """Results of a batch.

    Attributes
    ----------
    rows : ndarray of shape ``(cells, outcomes)``
        Outcomes, in the order of the model's columns.
    steps : ndarray of shape ``(cells,)``
        Numbers of steps, those of second runs for a certificate included, unless the method says otherwise.
    certified : ndarray of bool, shape ``(cells,)``
        Whether each cell has a certificate.
    because : ndarray of int8, shape ``(cells,)``, optional
        Why each cell has none, a value of :data:`ringsweep.quantities.variables.DOUBTS`; 0 where it has one.
    stiffness : ndarray of shape ``(cells,)``, optional
        Largest stiffness of each run; only from methods of constant step.
    errors : ndarray of shape ``(cells, numbers)``, optional
        Bounds on the errors of the outcomes that :func:`ringsweep.solvers.certificate.with_errors` names; NaN where
        there is no bound. Only if certificates are asked for.
    """

    rows: NDArray[np.float64]
    steps: NDArray[Any]
    certified: NDArray[np.bool_]
    because: NDArray[np.int8] | None = None
    stiffness: NDArray[np.float64] | None = None
    errors: NDArray[np.float64] | None = None


class Method(ABC):
    """A method of integration. The fields of a derived dataclass are its options in a configuration."""

    name: ClassVar[str]
    side_by_side: ClassVar[int] = 1
    """Number of cells that it runs at once; fewer cells take as long."""

    @abstractmethod
    def needs(self, structure: Structure) -> tuple[Any, ...]:
        """Functions that the method needs of the model of a scene of this structure; laws and drives have all."""

    def check(self, structure: Structure) -> None:
        """Make sure that the method can run scenes of this structure.

        Raises
        ------
        InputError
            If the method does not take the law; if the model lacks a function that it needs; or if the file of law,
            drive, model or method is not known to the cache of compiled code.
        """
        if structure.impact and structure.model != "belt" and family_of(structure.law_type) is Dynamic:
            raise InputError(
                "scene.impact",
                f"friction law {structure.law} has bristles, which have no state in an impact: "
                "choose a law without bristles, or leave impact out",
            )
        asked = [name for name in ("exponent", "section") if getattr(structure, name)]
        if asked and TRAITS[structure.law_type].snaps:
            raise InputError(
                f"record.{asked[0]}",
                f"friction law {structure.law} has none: its bonds form anew at random; choose another law, or leave "
                f"record.{asked[0]} out",
            )
        if asked and structure.impact and structure.model != "belt":
            raise InputError(
                f"record.{asked[0]}",
                "cannot stand beside scene.impact: the number of state variables changes from mode to mode; leave one "
                "of them out",
            )
        model = model_of(structure)
        for path, kind, name, source in (
            ("scene.friction.law", "friction law", structure.law, structure.law_type),
            ("scene.drive.law", "drive", structure.drive, structure.drive_type),
            ("scene.model", "model", structure.model, type(model)),
            ("solver.method", "method", self.name, type(self)),
        ):
            if not has_known_source(source):
                raise InputError(
                    path,
                    f"{kind} {name} comes from the module {source.__module__}, "
                    "whose file RINGSWEEP_LAWS does not name: edits of it would go unnoticed",
                )
        if missing := lacking(model.scene_type(structure), self.needs(structure)):
            problem = f"model {structure.model} has no {', '.join(missing)}, which solver {self.name} needs"
            raise InputError("scene.model", problem)

    def resolved(self, structure: Structure) -> Method:
        """The method that runs scenes of this structure: another one if this method chooses among methods."""
        return self

    @abstractmethod
    def run(self, batch: Any, outcomes: tuple[str, ...]) -> Result:
        """Run every cell.

        Parameters
        ----------
        batch : NamedTuple
            Cells, as :func:`ringsweep.models.batch` makes them.
        outcomes : tuple of str
            Names of the model's outcomes.

        Returns
        -------
        Result
        """

    @abstractmethod
    def history(self, batch: Any, samples: int, width: int) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Time history of cell 0.

        Parameters
        ----------
        batch : NamedTuple
            Cells, as :func:`ringsweep.models.batch` makes them.
        samples : int
            Approximate number of rows.
        width : int
            Number of columns: the model's history variables.

        Returns
        -------
        tuple of ndarray
            Times (s) of shape ``(rows,)``, and rows of shape ``(rows, width)``.
        """
