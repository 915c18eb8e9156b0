"""The section ``solver`` of a configuration."""

from __future__ import annotations

import dataclasses
from dataclasses import replace
from typing import Any

from ringsweep.config.sections import Key, Keys, choose, read_keys, section_of
from ringsweep.models.scene import Scene
from ringsweep.quantities.parameters import Parameter, declared
from ringsweep.solvers import METHODS


def read_solver(solver: Any, scene: Scene) -> Any:
    """A method with its options, from its name or from the mapping under ``solver`` in a configuration.

    Parameters
    ----------
    solver : str or mapping
    scene : Scene
        What the method must be able to take.

    Raises
    ------
    InputError
        If the method or an option is wrong, or if the method cannot run the scene.
    """
    section = {"method": solver} if isinstance(solver, str) else section_of({"solver": solver}, "solver", "")
    method: Any = METHODS[choose(METHODS, section, "solver.method", "method")]
    given = {key: value for key, value in section.items() if key != "method"}
    found = method(**read_keys(given, options_of(method), "solver"))
    for structure in scene.structures.values():
        found.check(structure)
    return found


def options_of(method: Any) -> Keys:
    """Keys of the section ``solver`` beside ``method``: the options of a method."""
    numbers, found = declared(method), dict[str, Parameter | Key]()
    for option in dataclasses.fields(method):
        default: Any = None if option.default is dataclasses.MISSING else option.default
        if option.init:
            flag = Key("whether the answer is checked", default=bool(default))
            found[option.name] = replace(numbers[option.name], default=default) if option.name in numbers else flag
    return found
