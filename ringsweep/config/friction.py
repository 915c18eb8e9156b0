"""Friction laws that a configuration defines: by a formula, or by a table of a measured curve."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping
from typing import Any

from ringsweep.config.sections import suggestion
from ringsweep.errors import InputError
from ringsweep.physics.friction import LAWS, TRAITS, add_law
from ringsweep.physics.friction.formula import FormulaError
from ringsweep.physics.friction.laws import Definition, define
from ringsweep.quantities.units import show

#: Name of the law that the section ``friction`` itself defines by the keys ``mu`` and ``at_rest``.
FORMULA = "formula"

#: Keys of the section ``friction`` that define laws.
KEYS = ("mu", "at_rest", "laws")

# Laws that a Python session has defined.
_REGISTERED: dict[str, Definition] = {}


def friction_law(name: str, mu: str, at_rest: str | None = None) -> None:
    """Define a friction law by a formula, for all scenes of this process.

    Every file that is written with the law contains its formula, so the file alone repeats the run elsewhere.

    Parameters
    ----------
    name : str
        Name of the law in scenes: ``friction: {law: NAME}``. A law of your own with this name is replaced.
    mu : str
        Friction coefficient as a formula of the sliding speed ``v`` (m/s), of the coefficients ``mu_s`` and ``mu_k`` of
        the surface, and of parameters, which the scene gives; see ``docs/friction.md``.
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
    if not isinstance(name, str) or not name or (name in LAWS and name not in _REGISTERED) or name == FORMULA:
        raise InputError("friction_law", f"{show(name)} cannot be the name of a law: choose another name")
    definition = Definition(mu, at_rest)
    law = _defined(definition, "friction_law")
    LAWS.pop(name, None)
    add_law(name, law, TRAITS[law])
    _REGISTERED[name] = definition


def own_laws(friction: Mapping[str, Any]) -> dict[str, type]:
    """Types of the laws that a section ``friction`` defines, by name.

    Raises
    ------
    InputError
        If a definition is wrong.
    """
    found = {}
    given = friction.get("laws", {})
    if not isinstance(given, Mapping):
        raise InputError(
            "scene.friction.laws", f"a section with a name and a formula of each law is expected, got {show(given)}"
        )
    for name, section in given.items():
        path = f"scene.friction.laws.{name}"
        if not isinstance(section, Mapping) or "mu" not in section:
            raise InputError(path, "a section with the key mu is expected, and at_rest for a law that holds at rest")
        for key in section:
            if key not in ("mu", "at_rest"):
                raise InputError(f"{path}.{key}", "unknown key" + suggestion(key, ("mu", "at_rest")))
        if not isinstance(name, str) or name == FORMULA or (name in LAWS and name not in _REGISTERED):
            raise InputError(path, f"{show(name)} cannot be the name of a law: choose another name")
        found[name] = _defined(Definition(section["mu"], section.get("at_rest")), path)
    if "mu" in friction:
        found[FORMULA] = _defined(Definition(friction["mu"], friction.get("at_rest")), "scene.friction")
    return found


def _defined(definition: Definition, path: str) -> type:
    if not isinstance(definition.mu, str):
        raise InputError(
            f"{path}.mu", f"a formula such as mu_k + (mu_s - mu_k)*exp(-v/v_s) is expected, got {show(definition.mu)}"
        )
    try:
        return define(definition)
    except FormulaError as error:
        where = "at_rest" if str(error).startswith("at_rest") else "mu"
        raise InputError(f"{path}.{where}", f"{show(definition.mu)}: {error}") from None


def keep_definitions(friction: dict[str, Any], names: list[str]) -> None:
    """Put the formulas of laws that this process has defined into the section, so that a file contains them."""
    for name in names:
        if name in _REGISTERED and name not in friction.get("laws", {}):
            definition = dataclasses.asdict(_REGISTERED[name])
            kept = {key: value for key, value in definition.items() if value is not None}
            friction["laws"] = {**friction.get("laws", {}), name: kept}
