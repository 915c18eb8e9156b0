"""The section ``record`` of a configuration: what a run records beside its outcomes."""

from __future__ import annotations

from typing import Any

from ringsweep.config.sections import section_of, suggestion
from ringsweep.errors import InputError
from ringsweep.models import WITH_EXPONENT
from ringsweep.quantities.units import show


def read_record(given: Any, model: str) -> bool:
    """Whether the mapping under ``record`` asks for the exponent.

    Raises
    ------
    InputError
        If it is no mapping, has an unknown key or a wrong value, or if the model has no exponent.
    """
    section = section_of({"record": given}, "record", "")
    for key in section:
        if key != "exponent":
            raise InputError(f"record.{key}", "unknown key" + suggestion(key, ("exponent",)))
    found = section.get("exponent", False)
    if not isinstance(found, bool):
        raise InputError("record.exponent", f"true or false is expected, got {show(found)}")
    if found and model not in WITH_EXPONENT:
        able = ", ".join(WITH_EXPONENT)
        raise InputError("record.exponent", f"model {model} has none: it is known of model {able}; leave it out")
    return found
