"""Base class of all models: parameters, outcomes, and types of scenes.

Nothing here runs in kernels. `structure` says which parts a scene has, `values` are its numbers in SI units by path,
of shape ``(cells,)``. ``ringsweep/config`` reads parameters and checks; ``ringsweep/runs`` builds cells.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Collection
from dataclasses import replace
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from ringsweep.errors import InputError
from ringsweep.models.interface import recorder
from ringsweep.models.scene import Structure, Values
from ringsweep.physics import friction
from ringsweep.quantities.flags import REGIMES
from ringsweep.quantities.parameters import Parameter
from ringsweep.quantities.variables import OUTCOMES, Variable


def period_of(structure: Structure, period: NDArray[np.float64]) -> NDArray[np.float64]:
    """Periods of the forcing, s: those given, or the one that the section states.

    Raises
    ------
    InputError
        If the section states a period where force or drive have one.
    """
    asked = structure.section
    if asked is None or asked.period is None:
        return period
    if np.isfinite(period).any():
        raise InputError("record.section.period", f"force or drive have the period {period.min():.6g} s: leave it out")
    return np.full(period.shape, asked.period)


class Continues(ABC):
    """A model of which a run can start from the state in which another one ended.

    Attributes
    ----------
    ends : tuple of str
        Outcomes that are the state at the end; under a law with bristles ``deflection_end`` besides.
    """

    ends: ClassVar[tuple[str, ...]]

    def obstacle(self, structure: Structure) -> str | None:
        """Why runs of this structure cannot go on, for an error message; None if they can."""
        return None

    @abstractmethod
    def forcing_period(self, structure: Structure, values: Values) -> NDArray[np.float64]:
        """Period of drive and force, s, shape ``(cells,)``; infinite if there is none."""

    @abstractmethod
    def continued(self, structure: Structure, values: Values, ended: Values) -> dict[str, NDArray[np.float64]]:
        """Initial values that continue other runs of this model.

        Parameters
        ----------
        structure : Structure
        values : mapping of str to ndarray of shape ``(cells,)``
            Values of the runs that start.
        ended : mapping of str to ndarray of shape ``(cells,)``
            Values of the runs that have ended, by path, and their outcomes, by name.

        Returns
        -------
        dict of str to ndarray of shape ``(cells,)``
            By path; values that differ from these are replaced.
        """


def phases(parts: Collection[str], values: Values, ended: Values) -> dict[str, NDArray[np.float64]]:
    """Phases of the `parts` with a frequency at the end of other runs; see :meth:`Continues.continued`."""
    found = {}
    for part in parts:
        if f"{part}.frequency" in values and f"{part}.frequency" in ended:
            turns = ended[f"{part}.frequency"] * ended["t_end"]
            # But for rounding, a whole number of turns changes no phase.
            turns = np.where(abs(turns - np.round(turns)) < 1e-9, 0.0, turns % 1.0)
            phase = ended.get(f"{part}.phase", np.zeros(len(turns))) + 2.0 * np.pi * turns
            found[f"{part}.phase"] = np.where(turns == 0.0, phase, phase % (2.0 * np.pi))
    return found


class Model(ABC):
    """A model of a mechanical system.

    Attributes
    ----------
    name : str
        Name in configurations.
    doc : str
        Short description, for the titles of datasets.
    reference : str
        What a paper that uses a result can cite for the model.
    outcomes : tuple of str
        Names of the outcomes, in the order in which ``recorder.conclude`` returns them. Each is a key of
        :data:`ringsweep.quantities.variables.OUTCOMES`.
    place : str
        History variable for the place of the body. The outcome for the place at the end is :attr:`place_end`.
    driven : tuple of str
        History variables for the place and the velocity of the ring or belt that the drive moves, if the methods do not
        give them. Without any there is no film of the model.
    drive_unit : str
        Unit of the motion of the drive.
    own_variables : dict of str to Variable
        Outcomes whose unit or meaning differs from that of :data:`ringsweep.quantities.variables.OUTCOMES`.
    absent : frozenset of str
        Outcomes and history variables that have no meaning for this model. Datasets leave them out.
    has_exponent : bool
        Whether the model takes ``record.exponent``.
    sections : tuple of str
        Values of ``record.section.at`` that the model takes.
    """

    name: ClassVar[str]
    doc: ClassVar[str]
    reference: ClassVar[str] = ""
    outcomes: ClassVar[tuple[str, ...]]
    place: ClassVar[str]
    driven: ClassVar[tuple[str, ...]] = ()
    drive_unit: ClassVar[str] = "rad"
    own_variables: ClassVar[dict[str, Variable]] = {}
    absent: ClassVar[frozenset[str]] = frozenset()
    has_exponent: ClassVar[bool] = False
    sections: ClassVar[tuple[str, ...]] = ()

    @property
    def place_end(self) -> str:
        """Outcome for the place at the end: the name of the place with ``_end``."""
        return f"{self.place}_end"

    @property
    def variables(self) -> dict[str, Variable]:
        """All variables of datasets of this model; a bound on an error has the unit of its number."""
        bounds = {
            bound: replace(OUTCOMES[bound], unit=own.unit, long_name=f"bound on the error: {own.long_name}")
            for name, own in self.own_variables.items()
            if (bound := f"{name}_error") in OUTCOMES
        }
        return OUTCOMES | self.own_variables | bounds

    def columns(self, structure: Structure) -> tuple[str, ...]:
        """Names of the columns of a run; a variable with a dimension of its own has several, side by side."""
        return self.outcomes

    @property
    def laws(self) -> dict[str, type]:
        """Friction laws that the model accepts, by name."""
        return {name: law for name, law in friction.LAWS.items() if self.takes(law)}

    def regimes(self, paths: Collection[str]) -> tuple[str, ...]:
        """Regimes that runs can have; by default all of :data:`ringsweep.quantities.flags.REGIMES`.

        Parameters
        ----------
        paths : collection of str
            Paths of the numbers that the scenes give.
        """
        return REGIMES

    def takes(self, law: type) -> bool:
        """Whether the model accepts a friction law; by default it accepts all."""
        return True

    @abstractmethod
    def scene_type(self, structure: Structure) -> type:
        """Type of the cells: a ``NamedTuple`` for which functions of :mod:`ringsweep.models.interface` have bodies."""

    def required(self, structure: Structure) -> dict[type, tuple[Any, ...]]:
        """Functions that must have bodies, by type; by default those of the recorder, for the type of the scene."""
        return {self.scene_type(structure): recorder.MEMBERS}

    @abstractmethod
    def history(self, structure: Structure) -> tuple[str, ...]:
        """Names of the history variables, in the order of their columns."""

    @abstractmethod
    def parameters(self, structure: Structure) -> dict[str, Parameter]:
        """Parameters of a scene of this structure, by path."""

    @abstractmethod
    def build(self, structure: Structure, values: Values) -> Any:
        """Cells that kernels run over.

        Parameters
        ----------
        structure : Structure
        values : mapping of str to ndarray of shape ``(cells,)``
            Values in SI units, by path. Optional parameters may be absent.

        Returns
        -------
        NamedTuple
            Of the type :meth:`scene_type`, nested, with arrays of shape ``(cells, ...)``.

        Raises
        ------
        InputError
            If values contradict each other, for instance if the ring is too small for the body.
        """
