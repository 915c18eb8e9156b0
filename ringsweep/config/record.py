"""The section ``record`` of a configuration: what a run records beside its outcomes."""

from __future__ import annotations

from typing import Any

from ringsweep.config.sections import boolean, check_keys, one_of, section_of
from ringsweep.errors import InputError
from ringsweep.models import MODELS
from ringsweep.models.scene import Section
from ringsweep.quantities.parameters import Parameter
from ringsweep.quantities.units import quantity

#: Number of points of a section.
KEEP = Parameter("1", "number of points, the last of a run", lower=1, upper=16384, default=64, whole=True)

#: Time between two points.
PERIOD = Parameter("s", "time between two points, where force and drive have no period", lower=0.0, open_lower=True)

#: Instants of the points of a section, and what they are.
INSTANTS = {
    "period": "the end of each period of force or drive",
    "turn": "each maximum of x, on the belt",
}


def read_record(given: Any, model: str) -> tuple[bool, Section | None]:
    """Whether the mapping under ``record`` asks for the exponent, and the section that it asks for.

    Raises
    ------
    InputError
        If it is no mapping, has an unknown key or a wrong value, or if the model has no exponent or no section.
    """
    record = section_of({"record": given}, "record", "")
    check_keys(record, ("exponent", "section"), "record")
    exponent = boolean(record.get("exponent", False), "record.exponent")
    if exponent and not MODELS[model].has_exponent:
        able = ", ".join(name for name, other in MODELS.items() if other.has_exponent)
        raise InputError("record.exponent", f"model {model} has none: it is known of model {able}; leave it out")
    return exponent, _section(record, model) if "section" in record else None


def _section(record: dict[str, Any], model: str) -> Section:
    section = section_of(record, "section", "record.")
    check_keys(section, ("at", "keep", "period"), "record.section")
    able = MODELS[model].sections
    if not able:
        others = ", ".join(name for name, other in MODELS.items() if other.sections)
        raise InputError("record.section", f"model {model} has none: it is known of model {others}; leave it out")
    if "at" not in section:
        raise InputError("record.section.at", f"missing: give {' or '.join(able)}")
    at = one_of(section["at"], able, "record.section.at", "is no instant of a section")
    period = None
    if "period" in section:
        if at != "period":
            raise InputError("record.section.period", f"belongs to `at: period`, not to `at: {at}`: leave it out")
        period = float(quantity(section["period"], PERIOD, "record.section.period"))
    keep = int(quantity(section.get("keep", KEEP.default), KEEP, "record.section.keep"))
    return Section(at, keep, period=period)
