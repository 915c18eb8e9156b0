"""The section ``record`` of a configuration: what a run records beside its outcomes."""

from __future__ import annotations

from typing import Any

from ringsweep.config.sections import section_of, suggestion
from ringsweep.errors import InputError
from ringsweep.models import MODELS
from ringsweep.models.scene import Section
from ringsweep.quantities.parameters import Parameter
from ringsweep.quantities.units import quantity, show

#: Number of points of a section.
KEEP = Parameter("1", "number of points, the last of a run", lower=1, upper=16384, default=64, whole=True)

#: Instants of the points of a section, and what they are.
INSTANTS = {"period": "the end of each period of force or drive", "turn": "each maximum of the displacement"}


def read_record(given: Any, model: str) -> tuple[bool, Section | None]:
    """Whether the mapping under ``record`` asks for the exponent, and the section that it asks for.

    Raises
    ------
    InputError
        If it is no mapping, has an unknown key or a wrong value, or if the model has no exponent or no section.
    """
    record = section_of({"record": given}, "record", "")
    for key in record:
        if key not in ("exponent", "section"):
            raise InputError(f"record.{key}", "unknown key" + suggestion(key, ("exponent", "section")))
    exponent = record.get("exponent", False)
    if not isinstance(exponent, bool):
        raise InputError("record.exponent", f"true or false is expected, got {show(exponent)}")
    if exponent and not MODELS[model].has_exponent:
        able = ", ".join(name for name, other in MODELS.items() if other.has_exponent)
        raise InputError("record.exponent", f"model {model} has none: it is known of model {able}; leave it out")
    return exponent, _section(record, model) if "section" in record else None


def _section(record: dict[str, Any], model: str) -> Section:
    section = section_of(record, "section", "record.")
    for key in section:
        if key not in ("at", "keep"):
            raise InputError(f"record.section.{key}", "unknown key" + suggestion(key, ("at", "keep")))
    able = MODELS[model].sections
    if not able:
        others = ", ".join(name for name, other in MODELS.items() if other.sections)
        raise InputError("record.section", f"model {model} has none: it is known of model {others}; leave it out")
    if "at" not in section:
        raise InputError("record.section.at", f"missing: give {' or '.join(able)}")
    at = section["at"]
    if at not in able:
        raise InputError("record.section.at", f"{show(at)} is no instant of a section" + suggestion(at, able))
    return Section(at, int(quantity(section.get("keep", KEEP.default), KEEP, "record.section.keep")))
