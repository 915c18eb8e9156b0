"""Models by name, the parameters of their scenes, and the cells that kernels run over."""

from collections.abc import Iterator
from dataclasses import replace
from importlib import import_module
from pkgutil import iter_modules
from typing import Any

import numpy as np

from ringsweep.compile import lacking
from ringsweep.models.belt import Belt, StopBelt
from ringsweep.models.model import Model
from ringsweep.models.pair import BeltPair
from ringsweep.models.ring import Ring, RingImpact, SingleContactImpact, SingleContactRing
from ringsweep.models.scene import WAYS, Structure, Values
from ringsweep.quantities.parameters import Parameter

__all__ = ["MODELS", "WITH_IMPACT", "Model", "Structure", "Values", "add_model", "batch", "model_of", "parameters"]

#: Models, by their names in configurations.
MODELS: dict[str, Model] = {}

#: Models of scenes with the section ``impact``, or ``stops`` on a belt, by the same names.
WITH_IMPACT: dict[str, Model] = {
    "ring": RingImpact(),
    "ring-single-contact": SingleContactImpact(),
    "belt": StopBelt(),
}


def add_model(model: Model) -> None:
    """Register a model under its name.

    Raises
    ------
    TypeError
        If the name is taken, or if a function that the model needs has no body for one of its types.
    """
    if model.name in MODELS:
        raise TypeError(f"there is a model {model.name} already: choose another name")
    for law in model.laws:
        for cls, members in model.required(Structure(model.name, law)).items():
            if missing := lacking(cls, members):
                raise TypeError(f"model {model.name}: {cls.__name__} has no {', '.join(missing)}")
    MODELS[model.name] = model


for _model in (Ring(), SingleContactRing(), Belt(), BeltPair()):
    add_model(_model)


def model_of(structure: Structure) -> Model:
    """The model of a scene of this structure."""
    return (WITH_IMPACT if structure.impact else MODELS)[structure.model]


def parameters(structure: Structure) -> dict[str, Parameter]:
    """Parameters of a scene of this structure by path, in the order of the documentation."""
    found = model_of(structure).parameters(structure)
    return {way: p for path, own in found.items() for way, p in _each_way(structure, path, own)}


def _each_way(structure: Structure, path: str, p: Parameter) -> Iterator[tuple[str, Parameter]]:
    """A parameter by path; if it is given for both directions of sliding, both of them."""
    if path not in structure.two_way:
        yield path, p
        return
    for way in WAYS:
        yield f"{path}.{way}", replace(p, long_name=f"{p.long_name}, sliding {way}")


def batch(structure: Structure, values: Values) -> Any:
    """Cells that kernels run over, of shape ``(cells, ...)``; ``ringsweep/runs`` calls it. See :meth:`Model.build`."""
    # Products of values that a double can hold may overflow. Runs of such cells fail.
    with np.errstate(over="ignore", invalid="ignore"):
        return model_of(structure).build(structure, values)


# A file that is put into this folder registers what it holds.
for _module in iter_modules(__path__):
    import_module(f"{__name__}.{_module.name}")
