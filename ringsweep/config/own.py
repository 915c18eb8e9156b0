"""Friction laws, drives and forces that a configuration defines, by a formula or by a table of measured friction."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ringsweep.config.sections import Key, Keys, read_keys
from ringsweep.config.tables import TABLES, read_table
from ringsweep.config.yaml_text import Document
from ringsweep.errors import InputError
from ringsweep.models import MODELS
from ringsweep.physics import drives
from ringsweep.physics.friction import LAWS, TRAITS, add_law, laws
from ringsweep.physics.friction.formula import FRICTION, FormulaError
from ringsweep.physics.friction.laws import Definition, define
from ringsweep.quantities.parameters import declared
from ringsweep.quantities.units import show

#: Name of the law that the section ``friction`` defines by ``mu`` and ``at_rest``, and of the drive by ``theta``.
FORMULA = "formula"

#: Name of the law that is a table of measured friction.
TABLE_LAW = "table"

#: Keys of a law by formula.
LAW_KEYS: Keys = {
    "mu": Key("friction coefficient as a formula of the sliding speed v", example=FRICTION.example),
    "at_rest": Key("coefficient up to which friction holds at rest; without it the law is smooth"),
}

# Laws that a Python session has defined.
_REGISTERED: dict[str, Definition] = {}


def laws_with(path: object) -> str:
    """Part of a message about a number that the scene's friction law lacks: the laws that have it, if any has."""
    section, _, name = str(path).rpartition(".")
    having = [law for law, kind in LAWS.items() if name in declared(kind)] if section == "friction" else []
    return f": law {' or '.join(having)} has it" if having else ""


def friction_law(name: str, mu: str, at_rest: str | None = None) -> None:
    """Define a friction law by a formula, for all scenes of this process.

    Every file that is written with the law contains its formula, so the file alone repeats the run elsewhere.

    Parameters
    ----------
    name : str
        Name of the law in scenes: ``friction: {law: NAME}``. A law of your own with this name is replaced.
    mu : str
        Friction coefficient as a formula of the sliding speed ``v`` (m/s), of the coefficients ``mu_s`` and ``mu_k`` of
        the surface, and of parameters, which the scene gives; see ``docs/laws.md``.
    at_rest : str, optional
        ``"mu_s"`` or ``"mu_k"``: at rest friction holds up to this coefficient. Without it the law is smooth, and
        friction vanishes at v = 0.

    Raises
    ------
    InputError
        If the formula is wrong, or if the name belongs to a law of the package.

    Examples
    --------
    >>> import ringsweep
    >>> ringsweep.friction_law("leine", mu="mu_s/(1 + delta*v)", at_rest="mu_s")
    >>> scene = {
    ...     "model": "belt", "body": {"mass": 1}, "spring": {"stiffness": 1}, "belt": {"velocity": 0.2},
    ...     "friction": {"law": "leine", "mu_s": 1, "delta": "3 s/m"}, "gravity": 1, "time": {"span": 100},
    ... }
    >>> run = ringsweep.sweep(scene, {})
    """
    if not _may_name(name):
        raise InputError("friction_law", f"{show(name)} cannot be the name of a law: choose another name")
    definition = Definition(mu, at_rest)
    law = _law(definition, "friction_law")
    LAWS.pop(name, None)
    add_law(name, law, TRAITS[law])
    _REGISTERED[name] = definition


def _may_name(name: object) -> bool:
    """Whether a law of a user may have a name."""
    free = name not in LAWS or name in _REGISTERED
    return isinstance(name, str) and name not in ("", FORMULA, TABLE_LAW) and free


def own_laws(friction: Mapping[str, Any]) -> dict[str, type]:
    """Types of the laws that a section ``friction`` defines, by name.

    Raises
    ------
    InputError
        If a definition is wrong.
    """
    where, found, given = "scene.friction.laws", {}, friction.get("laws", {})
    if not isinstance(given, Mapping):
        raise InputError(where, f"a section with a name and a formula of each law is expected, got {show(given)}")
    for name, section in given.items():
        path = f"{where}.{name}"
        definition = Definition(**read_keys(section, LAW_KEYS, path))
        if not _may_name(name):
            raise InputError(path, f"{show(name)} cannot be the name of a law: choose another name")
        found[name] = _law(definition, path)
    # Beside another law a text may be the formula for a sweep over laws; a number is a misnamed coefficient.
    of_formula = friction.get("law", FORMULA) == FORMULA or isinstance(friction.get("mu"), str)
    if "mu" in friction and friction.get("law") != TABLE_LAW and of_formula:
        found[FORMULA] = _law(Definition(friction["mu"], friction.get("at_rest")), "scene.friction")
    return found


def read_curve(doc: Document, friction: dict[str, Any]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Speeds and friction coefficients of a table; see :func:`ringsweep.config.tables.read_table`.

    Raises
    ------
    InputError
        If the table is missing, or cannot be a friction law.
    """
    speeds, mu = read_table(doc, friction, "friction", 2)
    if not mu.any():
        raise InputError("scene.friction.mu", "all coefficients are 0")
    return speeds, mu


def law_of_curve(curve: tuple[NDArray[np.float64], NDArray[np.float64]]) -> type:
    """Type of the law: set-valued at rest if friction does not vanish there."""
    return laws.Table if curve[1][0] > 0.0 else laws.SmoothTable


def keep_definitions(friction: dict[str, Any], names: list[str]) -> None:
    """Put the formulas of laws that this process has defined into the section, so that a file contains them."""
    for name in names:
        if name in _REGISTERED and name not in friction.get("laws", {}):
            definition = dataclasses.asdict(_REGISTERED[name])
            kept = {key: value for key, value in definition.items() if value is not None}
            friction["laws"] = {**friction.get("laws", {}), name: kept}


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
    texts = {"mu": ("scene.drive.theta", drive["theta"])}
    return _defined(lambda: drives.define(drive["theta"], MODELS[model].drive_unit), texts)


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
    return _defined(lambda: drives.define(force["formula"], "N"), {"mu": ("scene.force.formula", force["formula"])})


def _law(definition: Definition, path: str) -> type:
    if not isinstance(definition.mu, str):
        raise InputError(f"{path}.mu", f"a formula such as {FRICTION.example} is expected, got {show(definition.mu)}")
    texts = {"mu": (f"{path}.mu", definition.mu), "at_rest": (f"{path}.at_rest", definition.at_rest)}
    return _defined(lambda: define(definition), texts)


def _defined(make: Callable[[], type], texts: Mapping[str, tuple[str, Any]]) -> type:
    """What a definition makes; an error is located by path and text of the key that is wrong."""
    try:
        return make()
    except FormulaError as error:
        path, text = texts[error.key]
        raise InputError(path, f"{show(text)}: {error}") from None
