"""Friction laws, drives and forces of the user: by a formula, by a table of measurements, or in Python files.

A table has two columns, in lists or in a CSV file.
"""

from __future__ import annotations

import importlib.util
import sys
from collections.abc import Callable, Iterable, Mapping
from pathlib import Path
from typing import Any

import numpy as np

from ringsweep.config.reading import Document, Keys, choose, one_of, read_keys, read_values, section_of, warn_once
from ringsweep.errors import InputError, nearest_name, shortened
from ringsweep.models import MODELS
from ringsweep.models.scene import LAW
from ringsweep.physics import drives
from ringsweep.physics.friction import LAWS, TRAITS, add_law, laws
from ringsweep.physics.friction.formula import FRICTION, FormulaError
from ringsweep.quantities.parameters import Key, Parameter, declared
from ringsweep.quantities.units import show
from ringsweep.statistics import Floats

#: Name of the law that the section ``friction`` defines by ``mu`` and ``at_rest``, and of the drive by ``theta``.
FORMULA = "formula"

#: Name of the law that is a table of measured friction.
TABLE_LAW = "table"

#: Keys of a law by formula.
LAW_KEYS: Keys = {
    "mu": Key("friction coefficient as a formula of the sliding speed v and its direction", example=FRICTION.example),
    "at_rest": Key("coefficient up to which friction holds at rest; without it the law is smooth"),
}

# Laws that a Python session has defined, as sections.
_REGISTERED: dict[str, dict[str, str]] = {}


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
        Friction coefficient as a formula of the sliding speed ``v`` (m/s) and of its ``direction`` (1 or -1), of the
        coefficients ``mu_s`` and ``mu_k`` of the surface, and of parameters, which the scene gives; see
        ``docs/laws.md``.
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
    _check_name(name, "friction_law")
    law = _law("friction_law", mu, at_rest)
    LAWS.pop(name, None)
    add_law(name, law, TRAITS[law])
    _REGISTERED[name] = {"mu": mu} | ({} if at_rest is None else {"at_rest": at_rest})


def _check_name(name: object, path: str) -> None:
    """Refuse a name that a law of a user cannot have."""
    if not isinstance(name, str) or name in ("", FORMULA, TABLE_LAW) or (name in LAWS and name not in _REGISTERED):
        raise InputError(path, f"{show(name)} cannot be the name of a law: choose another name")


def own_laws(friction: Mapping[str, Any]) -> dict[str, type]:
    """Types of the laws that a section ``friction`` defines, by name.

    Raises
    ------
    InputError
        If a definition is wrong.
    """
    found = {}
    for name, section in section_of({"laws": {}, **friction}, "laws", "scene.friction.").items():
        path = f"scene.friction.laws.{name}"
        _check_name(name, path)
        found[name] = _law(path, **read_keys(section, LAW_KEYS, path))
    # Beside another law a text may be the formula for a sweep over laws; a number is a misnamed coefficient.
    of_formula = friction.get("law", FORMULA) == FORMULA or isinstance(friction.get("mu"), str)
    if "mu" in friction and friction.get("law") != TABLE_LAW and of_formula:
        found[FORMULA] = _law("scene.friction", friction["mu"], friction.get("at_rest"))
    return found


def law_choice(model: str, own: Iterable[str]) -> Key:
    """Friction laws that a model takes, and those that the configuration defines."""
    return Key("friction law", dict.fromkeys([*MODELS[model].laws, *own, FORMULA, TABLE_LAW], ""))


def read_laws(
    doc: Document, scene: dict[str, Any], model: str, swept: tuple[str, Any] | None
) -> tuple[list[str], dict[str, type], Any]:
    """Laws that are used, types of those that the configuration or the process defines, and a measured curve.

    Parameters
    ----------
    doc : Document
    scene : dict
    model : str
    swept : tuple of str and sequence, optional
        Laws that the sweep gives: their place in the configuration, and their names.

    Raises
    ------
    InputError
        If a law is unknown, or its definition is wrong.
    """
    section = section_of(scene, "friction", "scene.") if "friction" in scene else {}
    own = own_laws(section)
    known, names, curve = law_choice(model, own), list[str](), None
    if "law" in section:
        # Name a wrong law, rather than the parameters that only this law has.
        names = [choose(known.names, section, f"scene.{LAW}", f"friction law of model {model}")]
    if swept is not None:
        names = read_values(swept[1], known, swept[0]).tolist()
    if FORMULA in names and FORMULA not in own:
        raise InputError("scene.friction.mu", "missing: the formula of the friction coefficient")
    if TABLE_LAW in names:
        curve = read_table(doc, section, "friction", 2)
        if not curve[1].any():
            raise InputError("scene.friction.mu", "all coefficients are 0")
        # Set-valued at rest, if friction does not vanish there.
        own[TABLE_LAW] = laws.Table if curve[1][0] > 0.0 else laws.SmoothTable
    for name in names:
        # A file contains the formulas of laws that this process has defined: other processes know only these.
        if name in _REGISTERED and name not in section.get("laws", {}):
            section.setdefault("laws", {})[name] = dict(_REGISTERED[name])
    return names, own | own_laws(section), curve


def drive_type(model: str, drive: Mapping[str, Any]) -> type | None:
    """Type of the drive if the section ``drive`` has the formula ``theta``, or that of its rate, ``velocity``.

    Raises
    ------
    InputError
        If the formula is missing or wrong.
    """
    if drive.get("law") != FORMULA:
        return None
    key = "velocity" if "theta" not in drive and "velocity" in drive else "theta"
    if key not in drive:
        problem = "missing: the formula of the motion, such as A*sin(2*pi*f*t), or of its rate under velocity"
        raise InputError("scene.drive.theta", problem)
    unit = MODELS[model].drive_unit + "/s" * (key == "velocity")
    found = _defined(lambda: drives.define(drive[key], unit), {"mu": (f"scene.drive.{key}", drive[key])})
    if "velocity" in drive and ("velocity" in declared(found)) == (key == "velocity"):
        problem = "cannot stand beside theta" if key == "theta" else "is the formula: give its parameter another name"
        raise InputError("scene.drive.velocity", problem)
    return found


def force_type(force: Any, section: str = "force") -> type | None:
    """Type of the force on the body, or of its load, if their `section` has a ``formula``.

    Raises
    ------
    InputError
        If the formula is wrong, or if a table stands beside it.
    """
    if not isinstance(force, Mapping) or "formula" not in force:
        return None
    for key in TABLE_KEYS[section]:
        if key in force:
            raise InputError(f"scene.{section}.{key}", "cannot stand beside a formula: give one of them")
    formula = force["formula"]
    return _defined(lambda: drives.define(formula, "N"), {"mu": (f"scene.{section}.formula", formula)})


def _law(path: str, mu: Any, at_rest: Any) -> type:
    if not isinstance(mu, str):
        raise InputError(f"{path}.mu", f"a formula such as {FRICTION.example} is expected, got {show(mu)}")
    texts = {"mu": (f"{path}.mu", mu), "at_rest": (f"{path}.at_rest", at_rest)}
    return _defined(lambda: laws.define(laws.Definition(mu, at_rest)), texts)


def _defined(make: Callable[[], type], texts: Mapping[str, tuple[str, Any]]) -> type:
    """What a definition makes; an error is located by path and text of the key that is wrong."""
    try:
        return make()
    except FormulaError as error:
        path, text = texts[error.key]
        raise InputError(path, f"{show(text)}: {error}") from None


#: Columns of the tables of a measured drive, force and friction curve, by section. The first column ascends.
TABLES = {
    "drive": {
        "time": Parameter("s", "time in the table of the drive"),
        "theta": Parameter("rad", "angle of the drive"),
    },
    "force": {"time": Parameter("s", "time in the table of the force"), "force": Parameter("N", "force on the body")},
    "body.load": {"time": Parameter("s", "time in the table of the load"), "load": Parameter("N", "normal load")},
    "friction": {
        "v": Parameter("m/s", "sliding speed in the table of friction", lower=0.0),
        "mu": Parameter("1", "friction coefficient", lower=0.0),
    },
}

#: What joins the rows of a table of the time, by section; the first name is the default.
INTERPOLATIONS = {
    # A stuck body feels the acceleration of the drive, and a jump of its velocity would be an impact.
    "drive": {
        "spline": "a cubic spline: its acceleration is continuous",
        "monotone": "a cubic between each two rows that stays between them: its acceleration may jump at a row",
    },
    "force": {
        "monotone": "a cubic between each two rows that stays between them: its rate is continuous",
        "linear": "straight lines",
        "step": "each row holds until the next one",
    },
}
INTERPOLATIONS["body.load"] = INTERPOLATIONS["force"]

#: Keys of a section that stand for a table, by section.
TABLE_KEYS = {of: (*columns, "file", *["interpolate"] * (of in INTERPOLATIONS)) for of, columns in TABLES.items()}

_NO_JUMP = ": its place must not jump; for steps of its velocity give `law: formula` with velocity: piecewise(...)"


# Factor by which numbers of a table may grow before they overflow.
_ROOM = 1e100


def read_samples(doc: Document, given: dict[str, Any], section: str) -> tuple[Floats, Floats, str]:
    """Times, samples and interpolation of a drive or a force from a table; see :func:`read_table`."""
    known, where = INTERPOLATIONS[section], f"scene.{section}.interpolate"
    problem = f"is no interpolation of a {section}" + _NO_JUMP * (section == "drive")
    interpolate = one_of(given.get("interpolate", next(iter(known))), known, where, problem)
    times, samples = read_table(doc, given, section, 4 if interpolate == "spline" else 2)
    if interpolate == "spline":
        # It is slow to import, and only splines need it.
        from scipy.interpolate import CubicSpline

        between = CubicSpline(times, samples)(times[:-1] + np.diff(times) * np.linspace(0.0, 1.0, 9)[:, None])
        beyond = max(np.max(between) - np.max(samples), np.min(samples) - np.min(between))
        # A sine with six rows a period leaves less.
        if beyond > 0.1 * np.ptp(samples):
            cure = "`interpolate: monotone` stays between rows"
            warn_once(f"scene.%s: the spline leaves the range of its table by %.3g; {cure}", section, beyond)
    return times, samples, interpolate


def read_table(doc: Document, given: dict[str, Any], section: str, least: int) -> tuple[Floats, Floats]:
    """Both columns of a table. If they come from a file, they replace its name in the configuration.

    Parameters
    ----------
    doc : Document
    given : dict
        The section.
    section : str
        Its name, a key of :data:`TABLES`.
    least : int
        Least number of rows.

    Raises
    ------
    InputError
        If the table is missing, is too short, begins after 0, or its first column does not ascend; or if a row is so
        far from the one before that numbers overflow.
    """
    where, columns = f"scene.{section}", TABLES[section]
    first, second = columns
    if "file" in given:
        if any(name in given for name in columns):
            raise InputError(f"{where}.file", f"give a file, or {first} and {second}, not both")
        found = doc.inline_csv(given["file"], f"{where}.file", where, t="time")
        if set(found) != set(columns):
            names = ["t" if name == "time" else name for name in columns]
            wrong = next((name for name in found if name not in columns), "")
            near = nearest_name(wrong, [name for name in columns if name not in found])
            hint = f"; did you mean `{near}` by {shortened(wrong, 40)}?" if near else ""
            raise InputError(f"{where}.file", f"columns {', '.join(names)} are expected; got {', '.join(found)}{hint}")
        del given["file"]
        given |= found
    for name in columns:
        if name not in given:
            raise InputError(f"{where}.{name}", f"missing: a table needs a file, or the lists {first} and {second}")
    x, y = (read_values(given[name], parameter, f"{where}.{name}") for name, parameter in columns.items())
    if len(x) != len(y):
        raise InputError(f"{where}.{second}", f"{len(y)} values, but {first} has {len(x)}")
    if len(x) < least:
        raise InputError(f"{where}.{first}", f"{len(x)} rows are too few: a table needs at least {least}")
    unit = columns[first].unit
    for i in 1 + np.flatnonzero(np.diff(x) <= 0.0)[:1]:
        raise InputError(f"{where}.{first}.{i}", f"{x[i]:g} {unit} does not come after {x[i - 1]:g} {unit}")
    if x[0] > 0.0:
        raise InputError(f"{where}.{first}.0", f"the table begins at {x[0]:g} {unit}: it must begin at 0 {unit}")
    # The coefficients of the cubics between rows, and what is computed from them, must not overflow.
    with np.errstate(all="ignore"):
        cube = np.diff(x) ** 3
        steep = ~np.isfinite(_ROOM * np.diff(y) / cube) | ~np.isfinite(_ROOM * np.diff(y) + cube)
    for i in 1 + np.flatnonzero(steep)[:1]:
        problem = f"from {y[i - 1]:g} to {y[i]:g} over {x[i] - x[i - 1]:g} {unit} is too steep or too far"
        raise InputError(f"{where}.{second}.{i}", problem)
    return x, y


def load_own_files(paths: Iterable[Path]) -> None:
    """Run files that register laws, drives, models or methods.

    Raises
    ------
    InputError
        If a file has the name of a module, or raises an error.
    """
    for path in paths:
        # Compiled code that is loaded from disk finds its types by the name of their module.
        spec = importlib.util.spec_from_file_location(path.stem, path)
        if spec is None or spec.loader is None or path.stem in sys.modules:
            raise InputError("RINGSWEEP_LAWS", f"{path} must be a Python file with a name that no module has")
        sys.modules[path.stem] = module = importlib.util.module_from_spec(spec)
        try:
            spec.loader.exec_module(module)
        except Exception as error:
            del sys.modules[path.stem]
            raise InputError("RINGSWEEP_LAWS", f"{path}: {type(error).__name__}: {error}") from error
