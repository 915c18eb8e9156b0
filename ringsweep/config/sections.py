"""Sections, names and lists of values of a configuration, and the error messages about them."""

from __future__ import annotations

import dataclasses
import logging
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from functools import cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ringsweep.errors import InputError, nearest_name
from ringsweep.quantities.parameters import Key, Parameter, declared
from ringsweep.quantities.units import check_unit, quantity, show, spelled
from ringsweep.quantities.variables import common_unit

#: Largest number of values on an axis or in a table.
MAX_LENGTH = 1_000_000

logger = logging.getLogger("ringsweep")


@cache
def warn_once(message: str, *arguments: Any) -> None:
    """Warn once per process: one command reads its configuration several times."""
    logger.warning(message, *arguments)


def suggestion(word: object, known: Iterable[str]) -> str:
    """End of a message about an unknown name: the nearest known name, and all known names."""
    names = list(dict.fromkeys(known))
    near = nearest_name(word, names)
    rest = "" if len(names) <= 40 else f", ... ({len(names)} in all)"
    return (f"; did you mean `{near}`?" if near else "") + f" (known: {', '.join(names[:40])}{rest})"


def check_keys(section: Iterable[Any], known: Iterable[str], path: str, problem: str = "unknown key") -> None:
    """Refuse keys of a section that are not known; `path` is that of the section."""
    for key in section:
        if key not in known:
            raise InputError(f"{path}.{key}", problem + suggestion(key, known))


def one_of(given: Any, known: Iterable[str], path: str, problem: str) -> str:
    """The name given, which must be a known one; else it has this problem, such as ``"is not a method"``."""
    if not isinstance(given, str) or given not in known:
        raise InputError(path, f"{show(given)} {problem}" + suggestion(given, known))
    return given


def missing_text(path: str, parameter: Parameter) -> str:
    """Message about a missing value: what it means, its unit and an example."""
    examples = {"rad": "15 deg", "m": "10 mm", "1": "0.2", "": "1"}
    unit = f", in {parameter.unit}" if parameter.unit not in ("", "1") else ""
    example = "5000" if parameter.whole else examples.get(parameter.unit, f"1 {parameter.unit}")
    return f"missing: {parameter.long_name}{unit} (for example `{path.rpartition('.')[2]}: {example}`)"


def read_values(given: Any, parameter: Parameter | Key, where: str, most: int = MAX_LENGTH) -> NDArray[Any]:
    """Quantities or names from a sequence, shape ``(n,)``.

    Raises
    ------
    InputError
        If `given` is no such sequence, has more than `most` values, or one of its values is wrong.
    """
    given = spelled(given)
    if hasattr(given, "__array__"):
        given = np.asarray(given)
        if given.ndim != 1 or given.dtype.kind not in "iufOU":
            what = "names" if isinstance(parameter, Key) else "numbers"
            raise InputError(where, f"a list of {what} is expected, got shape {given.shape} of {given.dtype}")
    elif not isinstance(given, Sequence) or isinstance(given, str | bytes):
        raise InputError(where, f"a list of values is expected, got {show(given)}")
    # Of a part, since the length of a range may overflow.
    if (count := len(given[: most + 1])) > most or not count:
        raise InputError(where, f"more than {most} values are too many" if count else "empty: give at least one value")
    if isinstance(given, np.ndarray):
        ends = (given.min(), given.max()) if given.dtype.kind == "f" else (np.nan,)
        if isinstance(parameter, Parameter) and not parameter.whole and all(map(parameter.allows, ends)):
            return given.astype(float)
        given = given.tolist()
    if isinstance(parameter, Key):
        names, what = parameter.names, parameter.long_name
        return np.array([_registered(name, names, f"{where}.{i}", what) for i, name in enumerate(given)])
    try:
        return np.array([quantity(value, parameter, f"{where}.{i}") for i, value in enumerate(given)])
    except InputError:
        # A column has its unit in its header.
        if len(given) > 1 and (unit := common_unit(given)):
            check_unit(unit, parameter, where)
        raise


def _registered(given: object, known: Iterable[str], path: str, what: str) -> str:
    """The name of a part of the package, or of one that a user's own file defines."""
    own = ", and no file that the environment variable RINGSWEEP_LAWS names defines it"
    return one_of(given, known, path, f"is not a {what}" + (own if nearest_name(given, known) is None else ""))


#: What a section may hold under each of its keys. Reader and schema follow from it.
Keys = Mapping[str, Parameter | Key]


def keys_of(cls: Any) -> dict[str, Parameter | Key]:
    """Keys of a section from the fields of a dataclass: what their annotations declare, and flags of a method."""
    found, notes = dict[str, Parameter | Key](), declared(cls)
    for one in dataclasses.fields(cls):
        default: Any = None if one.default is dataclasses.MISSING else one.default
        if one.init and (one.name in notes or isinstance(default, bool)):
            found[one.name] = replace(notes.get(one.name, Key("whether the answer is checked")), default=default)
    return found


def read_keys(given: Any, keys: Keys | type, where: str) -> dict[str, Any]:
    """Values of a section by key, or by field of a dataclass; None where one is left out that has no default.

    Raises
    ------
    InputError
        If `given` is no section, has an unknown key or a wrong value, or lacks a key that must be given.
    """
    section, keys = section_of({where: given}, where, ""), keys_of(keys) if isinstance(keys, type) else keys
    check_keys(section, keys, where)
    found: dict[str, Any] = {}
    for name, key in keys.items():
        path, value = f"{where}.{name}", section.get(name, key.default)
        if name not in section and value is None:
            if isinstance(key, Parameter) and not key.optional:
                raise InputError(path, missing_text(name, key))
            if isinstance(key, Key) and key.example:
                raise InputError(path, f"missing: {key.long_name} (for example `{name}: {key.example}`)")
        elif isinstance(key, Parameter):
            number = quantity(value, key, path)
            value = int(number) if key.whole else number
        elif key.names:
            value = one_of(value, key.names, path, f"is no {key.long_name}")
        elif isinstance(key.default, bool) and not isinstance(value, bool):
            raise InputError(path, f"true or false is expected, got {show(value)}")
        found[name] = value
    return found


def section_of(parent: dict[str, Any], key: str, prefix: str) -> dict[str, Any]:
    """The section under `key`; `prefix` is the path of `parent` with a dot, for messages."""
    if key not in parent:
        raise InputError(f"{prefix}{key}", "missing")
    if not isinstance(parent[key], dict):
        raise InputError(f"{prefix}{key}", f"a section with keys is expected, got {show(parent[key])}")
    return parent[key]


def choose(registry: Mapping[str, Any], section: dict[str, Any], path: str, what: str) -> str:
    """The name under the last key of `path`, which must be a name of the registry."""
    key = path.rpartition(".")[2]
    if key not in section:
        raise InputError(path, f"missing: name a {what}: {', '.join(registry)}")
    return _registered(section[key], registry, path, what)
