"""Models by name: which parameters a scene of each kind has, and how they become what kernels take."""

import importlib.util
import sys
from typing import Any

from ringsweep.compile import lacking
from ringsweep.compile.cache import OWN_LAWS
from ringsweep.errors import InputError
from ringsweep.models.belt import Belt
from ringsweep.models.interface import recorder
from ringsweep.models.model import Model
from ringsweep.models.ring import Ring, SingleContactRing
from ringsweep.models.scene import Structure, Values
from ringsweep.quantities.parameters import Parameter

__all__ = ["MODELS", "Model", "Structure", "Values", "add_model", "batch", "parameters"]

#: Models by the name that the configuration gives them.
MODELS: dict[str, Model] = {}


def add_model(model: Model) -> None:
    """Make a model known under its name.

    Raises
    ------
    TypeError
        If the name is taken, or if the recorder has no body for a type of its scenes.
    """
    if model.name in MODELS:
        raise TypeError(f"there is a model {model.name} already: choose another name")
    for law in model.laws:
        scene = model.scene_type(Structure(model.name, law))
        if missing := lacking(scene, recorder.MEMBERS):
            raise TypeError(f"model {model.name} has no {missing[0]}: {scene.__name__} needs a recorder")
    MODELS[model.name] = model


for _model in (Ring(), SingleContactRing(), Belt()):
    add_model(_model)


def parameters(structure: Structure) -> dict[str, Parameter]:
    """Every numeric path that a scene of this structure has, in the order of the documentation."""
    return MODELS[structure.model].parameters(structure)


def batch(structure: Structure, values: Values) -> Any:
    """Cells as a kernel takes them; see :meth:`Model.build`."""
    return MODELS[structure.model].build(structure, values)


# Once all that they may build on is known: files of the user's own laws, drives and models.
for _path in OWN_LAWS:
    # Compiled code that is loaded from disk finds its types by the name of their module.
    _spec = importlib.util.spec_from_file_location(_path.stem, _path)
    if _spec is None or _spec.loader is None or _path.stem in sys.modules:
        raise InputError("RINGSWEEP_LAWS", f"{_path} must be a Python file whose name no module has")
    sys.modules[_path.stem] = _module = importlib.util.module_from_spec(_spec)
    try:
        _spec.loader.exec_module(_module)
    except InputError:
        raise
    except Exception as _error:
        raise InputError("RINGSWEEP_LAWS", f"{_path}: {type(_error).__name__}: {_error}") from _error
