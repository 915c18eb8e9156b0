"""The section ``solver`` of a configuration."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping
from typing import Any

from ringsweep.config import yaml_text
from ringsweep.config.sections import boolean, choose, missing_text, section_of, suggestion
from ringsweep.errors import InputError
from ringsweep.models.scene import Scene
from ringsweep.quantities.parameters import declared
from ringsweep.quantities.units import quantity
from ringsweep.solvers import METHODS


def read_solver(solver: str | Mapping[str, Any], scene: Scene | None = None) -> Any:
    """A method with its options, from its name or from the mapping under ``solver`` in a configuration.

    Parameters
    ----------
    solver : str or mapping
    scene : Scene, optional
        What the method must be able to take.

    Raises
    ------
    InputError
        If the method or an option is wrong, or if the method cannot run the scene.
    """
    given = yaml_text.read({"solver": solver}).tree["solver"]
    section = {"method": given} if isinstance(given, str) else section_of({"solver": given}, "solver", "")
    method: Any = METHODS[choose(METHODS, section, "solver.method", "method")]
    options = {f.name: f for f in dataclasses.fields(method) if f.init}
    numbers = declared(method)
    for key in section:
        if key != "method" and key not in options:
            problem = f"no option of {section['method']}" + suggestion(key, ("method", *options))
            raise InputError(f"solver.{key}", problem)
    values: dict[str, Any] = {}
    for name, option in options.items():
        path = f"solver.{name}"
        if name not in section:
            if option.default is dataclasses.MISSING and option.default_factory is dataclasses.MISSING:
                raise InputError(path, missing_text(name, numbers[name]) + f"; method {section['method']} needs it")
        elif name in numbers:
            number = quantity(section[name], numbers[name], path)
            values[name] = int(number) if numbers[name].whole else number
        else:
            values[name] = boolean(section[name], path)
    found = method(**values)
    for structure in scene.structures.values() if scene else ():
        found.check(structure)
    return found
