"""The sections ``solver`` and ``record`` of a configuration: how a run is computed, and what it records."""

from __future__ import annotations

import dataclasses
from dataclasses import replace
from typing import Any

from ringsweep.config.sections import Key, Keys, choose, read_keys, section_of
from ringsweep.errors import InputError
from ringsweep.models import MODELS
from ringsweep.models.scene import Scene, Section
from ringsweep.quantities.parameters import Parameter, declared
from ringsweep.solvers import METHODS

#: Keys of the section ``record``.
RECORD: Keys = {
    "exponent": Key("whether a run tells its Lyapunov exponent and its Floquet multipliers", default=False),
    "section": Key("points of the motion that a run keeps"),
}

#: Keys of ``record.section``.
SECTION: Keys = {
    "at": Key(
        "instant of a section",
        {"period": "the end of each period of force or drive", "turn": "each maximum of x, on the belt"},
    ),
    "keep": Parameter("1", "number of points, the last of a run", lower=1, upper=16384, default=64, whole=True),
    "period": Parameter(
        "s", "time between two points, where force and drive have no period", lower=0.0, open_lower=True, optional=True
    ),
}


def read_record(given: Any, model: str) -> tuple[bool, Section | None]:
    """Whether the mapping under ``record`` asks for the exponent, and the section that it asks for.

    Raises
    ------
    InputError
        If it is no mapping, has an unknown key or a wrong value, or if the model has no exponent or no section.
    """
    record = read_keys(given, RECORD, "record")
    for key, known in (("exponent", "has_exponent"), ("section", "sections")):
        if record[key] not in (None, False) and not getattr(MODELS[model], known):
            others = ", ".join(name for name, other in MODELS.items() if getattr(other, known))
            raise InputError(f"record.{key}", f"model {model} has none: it is known of model {others}; leave it out")
    if record["section"] is None:
        return record["exponent"], None
    able = MODELS[model].sections
    at = Key("instant of a section", dict.fromkeys(able, ""), example=able[0])
    section = read_keys(record["section"], {**SECTION, "at": at}, "record.section")
    if section["period"] is not None and section["at"] != "period":
        problem = f"belongs to `at: period`, not to `at: {section['at']}`: leave it out"
        raise InputError("record.section.period", problem)
    return record["exponent"], Section(**section)


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
