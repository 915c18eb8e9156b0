"""JSON Schema of the configuration, from what models, laws, drives and methods declare."""

from __future__ import annotations

import dataclasses
import math
import re
from collections.abc import Mapping
from itertools import product
from typing import Any

from ringsweep.config.axes import COUNT
from ringsweep.config.follow import DIRECTIONS
from ringsweep.config.friction import FORMULA
from ringsweep.config.friction import TABLE as TABLE_LAW
from ringsweep.config.motion import FORMULA as FORMULA_DRIVE
from ringsweep.config.record import INSTANTS, KEEP, PERIOD
from ringsweep.config.refinement import NUMBERS
from ringsweep.config.sampling import NUMBERS as SAMPLE_NUMBERS
from ringsweep.config.sampling import SENSITIVITIES
from ringsweep.config.tables import TABLES
from ringsweep.models import MODELS, WITH_IMPACT, parameters
from ringsweep.models.scene import LAW, Structure
from ringsweep.physics.drives import DRIVES
from ringsweep.physics.friction import LAWS
from ringsweep.physics.friction.formula import COEFFICIENTS
from ringsweep.physics.friction.laws import Table
from ringsweep.quantities.parameters import Parameter, declared
from ringsweep.solvers import METHODS
from ringsweep.statistics import DISTRIBUTIONS
from ringsweep.statistics import METHODS as DESIGNS


def schema() -> dict[str, Any]:
    """JSON Schema (2020-12) that every valid configuration satisfies.

    Editors complete and explain keys from it. It checks no units and no contradictions between values, as
    :func:`ringsweep.config.configuration.load` does.
    """
    known: dict[str, list[Parameter]] = {}
    for model, drive, arcs in product(MODELS, DRIVES, ((), ("zone",), ("zones.0",))):
        for law in (*MODELS[model].laws, TABLE_LAW):
            own = Table if law == TABLE_LAW else None
            structure = Structure(model, law, drive, arcs, own_law=own, impact=model in WITH_IMPACT)
            for path, parameter in parameters(structure).items():
                # All zones of a list have one description.
                parameter = dataclasses.replace(parameter, long_name=parameter.long_name.replace("zone 1", "the zone"))
                meanings = known.setdefault(path, [])
                if parameter not in meanings:
                    meanings.append(parameter)
    leaves = {path: _any_of([_number(parameter) for parameter in meanings]) for path, meanings in known.items()}
    scene = _nest(
        {
            "model": _names(MODELS, "what moves"),
            LAW: _laws("friction law; may be missing where sweep goes through laws"),
            "friction.laws": {
                "description": "friction laws by formula: name -> mu, at_rest",
                "type": "object",
                "additionalProperties": {**_section({"mu": _formula(), "at_rest": _at_rest()}), "required": ["mu"]},
            },
            "friction.mu": _any_of([_formula(), _list(_number(TABLES["friction"]["mu"]))]),
            "friction.at_rest": _at_rest(),
            "friction.v": _list(_number(TABLES["friction"]["v"])),
            "friction.file": {"type": "string", "description": "CSV file with columns v (m/s), mu"},
            "drive.law": _drives(),
            "initial.from": {"type": "string", "description": "result file of the run on the belt that goes on"},
            "drive.file": {"type": "string", "description": "CSV file with columns t (s), theta (rad)"},
            "force.file": {"type": "string", "description": "CSV file with columns t (s), force (N)"},
            **{
                f"{section}.{name}": _list(_number(parameter))
                for section in ("drive", "force")
                for name, parameter in TABLES[section].items()
            },
            "drive.theta": _any_of([_formula("angle or displacement", TIME), _list(_number(TABLES["drive"]["theta"]))]),
            "force.formula": _formula("force on the body, N,", TIME),
            **leaves,
        }
    )
    scene["required"] = ["model"]
    scene["properties"]["drive"]["required"] = ["law"]
    for section, what in {"friction": "friction law", "drive": "drive", "force": "force"}.items():
        scene["properties"][section]["additionalProperties"] = _number(
            Parameter("", f"parameter of a {what} by formula")
        )
    return {
        "$schema": "https://json-schema.org/draft/2020-12/schema",
        "title": "ringsweep configuration",
        **_section({"scene": scene, "solver": _solver(), "record": _record(), "sweep": _sweep(list(known))}),
        "required": ["scene"],
    }


def _number(parameter: Parameter) -> dict[str, Any]:
    about = parameter.long_name
    if parameter.unit not in ("", "1"):
        about += f", {parameter.unit}"
    if parameter.default is not None:
        about += f" (default {parameter.default:g})"
    bounds: dict[str, Any] = {"type": "integer" if parameter.whole else "number"}
    if math.isfinite(parameter.lower):
        bounds["exclusiveMinimum" if parameter.open_lower else "minimum"] = parameter.lower
    if math.isfinite(parameter.upper):
        bounds["exclusiveMaximum" if parameter.open_upper else "maximum"] = parameter.upper
    return {"description": about, "anyOf": [bounds, {"type": "string"}]}


def _names(registry: Mapping[str, Any], about: str) -> dict[str, Any]:
    choices = [{"const": name, "description": _first_line(entry)} for name, entry in registry.items()]
    return {"description": about, "type": "string", "oneOf": choices}


def _laws(about: str) -> dict[str, Any]:
    """Names of friction laws: those of the package, `formula`, `table`, and names that a user gives."""
    known = _names(LAWS, about)
    known["oneOf"] += [
        {"const": FORMULA, "description": "A formula of the sliding speed, under mu"},
        {"const": TABLE_LAW, "description": "Measured friction: a file, or lists v and mu"},
    ]
    own = {"description": "a law of the section laws, or of the Python session", "minLength": 1}
    return {"description": about, "type": "string", "anyOf": [*known["oneOf"], own]}


def _drives() -> dict[str, Any]:
    found = _names(DRIVES, "how the ring is driven")
    found["oneOf"].append({"const": FORMULA_DRIVE, "description": "A formula of the time, under theta"})
    return found


# Variables of formulas.
SPEED, TIME = "the sliding speed v", "the time t, s"


def _formula(what: str = "friction coefficient", of: str = SPEED) -> dict[str, Any]:
    return {"description": f"{what} as a formula of {of}", "type": "string"}


def _at_rest() -> dict[str, Any]:
    about = "coefficient up to which friction holds at rest; without it the law is smooth"
    return {"description": about, "enum": [*COEFFICIENTS]}


def _first_line(documented: Any) -> str:
    """First line of a docstring, without markup, for editors to show."""
    line: str = (documented.__doc__ or "").split("\n")[0]
    return re.sub(r":math:`([^`]*)`", lambda formula: formula[1].replace("\\", ""), line)


def _nest(leaves: Mapping[str, dict[str, Any]]) -> dict[str, Any]:
    """Schema of nested sections from schemas by dotted path; the key ``0`` stands for items of a list."""
    groups: dict[str, dict[str, dict[str, Any]]] = {}
    for path, leaf in leaves.items():
        key, _, rest = path.partition(".")
        groups.setdefault(key, {})[rest] = leaf
    children = {key: group[""] if "" in group else _nest(group) for key, group in groups.items()}
    return _list(children["0"]) if "0" in children else _section(children)


def _section(properties: Mapping[str, Any]) -> dict[str, Any]:
    return {"type": "object", "properties": dict(properties), "additionalProperties": False}


def _list(items: dict[str, Any]) -> dict[str, Any]:
    return {"type": "array", "items": items, "minItems": 1}


def _any_of(options: list[dict[str, Any]]) -> dict[str, Any]:
    return options[0] if len(options) == 1 else {"anyOf": options}


def _constants(meanings: Mapping[str, str]) -> list[dict[str, str]]:
    return [{"const": name, "description": meaning} for name, meaning in meanings.items()]


def _record() -> dict[str, Any]:
    about = "whether a run tells its Lyapunov exponent and its Floquet multipliers"
    at = {"description": "instants of the points", "oneOf": _constants(INSTANTS)}
    section = _section({"at": at, "keep": _number(KEEP), "period": _number(PERIOD)})
    kept = {"description": "points of the motion that a run keeps", **section, "required": ["at"]}
    exponent = {"description": about, "type": "boolean"}
    return {"description": "what a run records", **_section({"exponent": exponent, "section": kept})}


def _solver() -> dict[str, Any]:
    methods: list[dict[str, Any]] = [{"type": "string", "enum": list(METHODS)}]
    method: Any
    for name, method in METHODS.items():
        numbers = declared(method)
        options: dict[str, Any] = {"method": {"const": name, "description": _first_line(method)}}
        for option in dataclasses.fields(method):
            if option.name in numbers:
                options[option.name] = _number(numbers[option.name])
            else:
                options[option.name] = {"type": "boolean"}
        methods.append({**_section(options), "required": ["method"]})
    return {"description": "how time advances", "anyOf": methods}


def _sweep(paths: list[str]) -> dict[str, Any]:
    value = {"type": ["number", "string"]}
    arcs = "|".join(path.removeprefix("zones.0.") for path in paths if path.startswith("zones.0."))
    laws = {LAW: _list(_laws("friction law"))}
    own = r"^(friction|drive|force)\.[A-Za-z][A-Za-z0-9_]*$"
    names = {"anyOf": [{"enum": [*laws, *paths]}, {"pattern": rf"^zones\.[0-9]+\.({arcs})$"}, {"pattern": own}]}
    together = {"anyOf": [*names["anyOf"], {"pattern": r"^[^,\s]+(\s*,\s*[^,\s]+)+$"}]}
    bounds = {"type": "array", "prefixItems": [value, value, _number(COUNT)], "minItems": 3, "maxItems": 3}
    axis = {"anyOf": [_list(value), *(_section({kind: bounds}) for kind in ("linspace", "geomspace"))]}
    return _section(
        {
            "grid": {
                "description": "path -> values; every combination is run; paths with commas between them vary together",
                "type": "object",
                "propertyNames": together,
                "properties": {LAW: {**laws[LAW], "uniqueItems": True}},
                "additionalProperties": axis,
            },
            "refine": {
                "description": "compute only the boundaries of the map: every 32nd cell, then where neighbours differ",
                "anyOf": [
                    {"type": "boolean"},
                    _section(
                        {
                            **{key: _number(parameter) for key, parameter in NUMBERS.items()},
                            "also": {"description": "number that is interpolated where not run", "type": "string"},
                            "within": {"description": "largest error of that", **value},
                            "axes": {
                                "description": "one or two paths that are refined (default: the longest two)",
                                "type": "array",
                                "items": names,
                                "minItems": 1,
                                "maxItems": 2,
                            },
                        }
                    ),
                ],
            },
            "follow": {
                "description": "axis along which each cell starts from the state in which the one before ended",
                "anyOf": [
                    {"type": "string"},
                    {
                        **_section({"axis": {"type": "string"}, "direction": {"oneOf": _constants(DIRECTIONS)}}),
                        "required": ["axis"],
                    },
                ],
            },
            "sample": _sample(names),
            "points": {
                "description": "CSV file whose columns are paths and whose rows are runs, or its columns",
                "anyOf": [
                    {"type": "string"},
                    {
                        "type": "object",
                        "propertyNames": names,
                        "properties": laws,
                        "additionalProperties": _list(value),
                    },
                ],
            },
        }
    )


def _sample(names: dict[str, Any]) -> dict[str, Any]:
    value = {"type": ["number", "string"]}
    values = {"anyOf": [_list(value), {"type": "object", "additionalProperties": _list(value)}]}
    kinds: dict[str, Any] = {}
    for name, distribution in DISTRIBUTIONS.items():
        count = len(distribution.arguments)
        about = f"[{', '.join(distribution.arguments)}]"
        kinds[name] = {"description": about, "type": "array", "items": value, "minItems": count, "maxItems": count}
    kinds["values"] = {"description": "values, each as probable as the others", **values}
    kinds["file"] = {"description": "CSV file with a column for each path; a row is a draw", "type": "string"}
    kinds["over"] = {"description": "path that the draw is multiplied by", "type": "string"}
    levels = _list({"type": ["number", "string"]})
    measure = {"enum": [*SENSITIVITIES]}
    asked = _section({"of": _list({"type": "string"}), "method": measure})
    times = {"anyOf": [_list(value), *(_section({kind: _list(value)}) for kind in ("linspace", "geomspace"))]}
    found = _section(
        {
            **{key: _number(parameter) for key, parameter in SAMPLE_NUMBERS.items()},
            "method": {"description": "how points are drawn", "enum": [*DESIGNS]},
            "of": {
                "description": "path -> distribution; paths with commas between them are drawn together",
                "type": "object",
                "propertyNames": {"anyOf": [*names["anyOf"], {"pattern": r"^[^,\s]+(\s*,\s*[^,\s]+)+$"}]},
                "additionalProperties": _section(kinds),
                "minProperties": 1,
            },
            "quantiles": {"description": "variable -> levels", "type": "object", "additionalProperties": levels},
            "survival": {"description": "times at which it is asked whether the contacts still hold", **times},
            "sensitivity": {
                "description": "Sobol indices (true) or Morris's effects, and of which variables beside the regimes",
                "anyOf": [{"type": "boolean"}, measure, {**asked, "required": ["of"]}],
            },
            "keep": {"description": "whether the result holds the runs too", "type": "boolean"},
        }
    )
    return {"description": "uncertain parameters: each cell of the grid is sampled", **found, "required": ["n", "of"]}
