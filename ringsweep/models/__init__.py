"""Models: which parameters a scene of each kind has, and how they become what kernels take."""

from typing import Any

from ringsweep.models.belt import Belt
from ringsweep.models.ring import Ring, SingleContactRing
from ringsweep.models.scene import Structure, Values
from ringsweep.quantities.parameters import Parameter

MODELS = {model.name: model for model in (Ring(), SingleContactRing(), Belt())}


def parameters(structure: Structure) -> dict[str, Parameter]:
    """Every numeric path that a scene of this structure has, in the order of the documentation."""
    return MODELS[structure.model].parameters(structure)


def batch(structure: Structure, values: Values) -> Any:
    """Cells as a kernel takes them: a nested ``NamedTuple`` of arrays of shape ``(cells, ...)``.

    Parameters
    ----------
    structure : Structure
    values : mapping of str to ndarray of shape ``(cells,)``
        One array for every path given.

    Raises
    ------
    InputError
        If values contradict each other, as a ring too small for its body.
    """
    return MODELS[structure.model].build(structure, values)
