"""What every model declares: its parameters, its outcomes, and the types of its scenes."""

from __future__ import annotations

from abc import ABC, abstractmethod
from typing import Any, ClassVar

from ringsweep.models.interface import recorder
from ringsweep.models.scene import Structure, Values
from ringsweep.physics import friction
from ringsweep.quantities.parameters import Parameter


class Model(ABC):
    """A kind of system.

    Attributes
    ----------
    name : str
        Name in configurations.
    doc : str
        What it is, in a few words.
    outcomes : tuple of str
        Outcomes of a run, in the order in which its recorder concludes them; each is a key of
        :data:`ringsweep.quantities.variables.OUTCOMES`.
    place : str
        The history variable that says where the body is; its outcome at the end is that name with ``_end``.
    rotates : bool
        Whether the body moves round an axis, so that it can be drawn in a ring.
    absent : frozenset of str
        Outcomes and history variables that mean nothing for this model; datasets leave them out.
    """

    name: ClassVar[str]
    doc: ClassVar[str]
    outcomes: ClassVar[tuple[str, ...]]
    place: ClassVar[str]
    rotates: ClassVar[bool] = False
    absent: ClassVar[frozenset[str]] = frozenset()

    @property
    def laws(self) -> dict[str, type]:
        """Friction laws that the model takes, by name."""
        return {name: law for name, law in friction.LAWS.items() if self.takes(law)}

    def takes(self, law: type) -> bool:
        """Whether the model takes a friction law; unless a model says otherwise it takes all."""
        return True

    @abstractmethod
    def scene_type(self, structure: Structure) -> type:
        """Type of the cells that kernels take: a ``NamedTuple`` for which families of functions have bodies."""

    def required(self, structure: Structure) -> dict[type, tuple[Any, ...]]:
        """Functions that must have bodies for the types of such a scene: the recorder's, and what a model adds."""
        return {self.scene_type(structure): recorder.MEMBERS}

    @abstractmethod
    def history(self, structure: Structure) -> tuple[str, ...]:
        """Variables of a time history, in the order of their columns."""

    @abstractmethod
    def parameters(self, structure: Structure) -> dict[str, Parameter]:
        """Every numeric path of a scene of this structure, with what it is."""

    @abstractmethod
    def build(self, structure: Structure, values: Values) -> Any:
        """Cells as a kernel takes them: a nested ``NamedTuple`` of arrays of shape ``(cells, ...)``.

        Parameters
        ----------
        structure : Structure
        values : mapping of str to ndarray of shape ``(cells,)``
            One array for each path that is given, in SI units.

        Raises
        ------
        InputError
            If values contradict each other, as a ring too small for its body.
        """
