"""The section ``record`` of a configuration: what a run records beside its outcomes."""

from __future__ import annotations

from typing import Any

from ringsweep.config.sections import Key, Keys, read_keys
from ringsweep.errors import InputError
from ringsweep.models import MODELS
from ringsweep.models.scene import Section
from ringsweep.quantities.parameters import Parameter

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
