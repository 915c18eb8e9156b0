"""Drives and forces that a configuration defines by a formula of the time."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from ringsweep.config.tables import TABLES
from ringsweep.errors import InputError
from ringsweep.models import MODELS
from ringsweep.physics.drives import define
from ringsweep.physics.friction.formula import FormulaError
from ringsweep.quantities.units import show

#: Name of the drive that a formula defines.
FORMULA = "formula"


def own_drive(model: str, drive: Mapping[str, Any]) -> type | None:
    """Type of the drive if the section ``drive`` has the formula ``theta``.

    Raises
    ------
    InputError
        If the formula is missing or wrong.
    """
    if drive.get("law") != FORMULA:
        return None
    if "theta" not in drive:
        raise InputError("scene.drive.theta", "missing: the formula of the motion, such as A*sin(2*pi*f*t)")
    return _defined(drive["theta"], MODELS[model].drive_unit, "scene.drive.theta")


def own_force(force: Any) -> type | None:
    """Type of the force on the body if the section ``force`` has a ``formula``.

    Raises
    ------
    InputError
        If the formula is wrong, or if a table stands beside it.
    """
    if not isinstance(force, Mapping) or "formula" not in force:
        return None
    for key in (*TABLES["force"], "file", "interpolate"):
        if key in force:
            raise InputError(f"scene.force.{key}", "cannot stand beside a formula: give one of them")
    return _defined(force["formula"], "N", "scene.force.formula")


def _defined(text: Any, unit: str, path: str) -> type:
    try:
        return define(text, unit)
    except FormulaError as error:
        raise InputError(path, f"{show(text)}: {error}") from None
