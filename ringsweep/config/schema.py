"""JSON Schema of the configuration, from what models, laws, drives and methods declare."""

from __future__ import annotations

import dataclasses
import math
import re
from collections.abc import Mapping
from itertools import product
from typing import Any

from ringsweep.config import axes, own, uncertain
from ringsweep.config.options import Follow, Refinement
from ringsweep.config.reading import Keys, keys_of
from ringsweep.config.scene import RECORD, STEADY, structures_of
from ringsweep.models import MODELS, parameters
from ringsweep.models.scene import ELSEWHERE, FRAMES, LAW, WAYS, Section
from ringsweep.physics.drives import DRIVES
from ringsweep.physics.friction import LAWS
from ringsweep.physics.friction.formula import COEFFICIENTS
from ringsweep.physics.friction.laws import Table
from ringsweep.physics.friction.registry import SURFACE
from ringsweep.quantities.parameters import Key, Parameter
from ringsweep.solvers import METHODS
from ringsweep.statistics import DISTRIBUTIONS


def schema() -> dict[str, Any]:
    """JSON Schema (2020-12) that every valid configuration satisfies.

    Editors complete and explain keys from it. It checks no units and no contradictions between values, as
    :func:`ringsweep.config.configuration.load` does.
    """
    known: dict[str, dict[Parameter, None]] = {}
    for model, name in product(MODELS, ELSEWHERE):
        laws = *MODELS[model].laws, own.TABLE_LAW
        for structure in structures_of(model, laws, {own.TABLE_LAW: Table}, ("zones.0",), DRIVES, elsewhere=name):
            for path, parameter in parameters(structure).items():
                # All zones of a list have one description.
                parameter = dataclasses.replace(parameter, long_name=parameter.long_name.replace("zone 1", "the zone"))
                known.setdefault(path, {})[parameter] = None
    leaves = {path: _any(*map(_number, meanings)) for path, meanings in known.items()}
    for path in (path for path in leaves if path.rpartition(".")[2] in SURFACE):
        leaves[path] = _any(leaves[path], _section(dict.fromkeys(WAYS, leaves[path])))
    tables = {f"{of}.{name}": _list(_number(p)) for of, columns in own.TABLES.items() for name, p in columns.items()}
    for of, columns in own.TABLES.items():
        header = ", ".join(f"{name} ({p.unit})".removesuffix(" (1)") for name, p in columns.items())
        tables[f"{of}.file"] = _text(f"CSV file with columns {header.replace('time', 't')}")
    by_formula = _keys(own.LAW_KEYS, mu=_TEXT, at_rest={"enum": [*COEFFICIENTS]})
    drives = _meanings(DRIVES) | {own.FORMULA: "A formula of the time, under theta or velocity"}
    scene = _nest(
        {
            "model": _word("what moves", _meanings(MODELS)),
            LAW: _laws("friction law; may be missing where sweep goes through laws"),
            "friction.laws": _open("friction laws by formula: name -> mu, at_rest", _section(by_formula, "mu")),
            "friction.at_rest": by_formula["at_rest"],
            "drive.law": _word("how the ring is driven", drives),
            "initial.from": _text("result file of the run on the belt that goes on"),
            "friction.frame": _word("where the zones of a belt lie (default: belt)", FRAMES),
            "initial.steady": _word("a motion to start from, in place of x and velocity", STEADY),
            "force.formula": _text("force on the body, N, as a formula of the time t, s"),
            "body.load.formula": _text("normal load beside the weight, N, as a formula of the time t, s"),
            **tables,
            **{f"{of}.interpolate": _word("what joins the rows", joins) for of, joins in own.INTERPOLATIONS.items()},
            "friction.mu": _any(by_formula["mu"], tables["friction.mu"]),
            "drive.velocity": _text("velocity or angular velocity as a formula of the time t, in place of theta"),
            "drive.theta": _any(_text("angle or displacement as a formula of the time t, s"), tables["drive.theta"]),
            **leaves,
        }
    )
    parts = scene["properties"] | scene["properties"]["body"]["properties"]
    scene["required"], parts["drive"]["required"] = ["model"], ["law"]
    for section, what in {"friction": "friction law", "drive": "drive", "force": "force", "load": "load"}.items():
        parts[section]["additionalProperties"] = _number(Parameter("", f"parameter of a {what} by formula"))
    points = _section(_keys(keys_of(Section)), "at")
    record = _any(_section(_keys(RECORD, section=points)), description="what a run records")
    sections = {"scene": scene, "solver": _solver(), "record": record, "sweep": _sweep(list(known))}
    head = {"$schema": "https://json-schema.org/draft/2020-12/schema", "title": "ringsweep configuration"}
    return head | _section(sections, "scene")


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


def _meanings(registry: Mapping[str, Any]) -> dict[str, str]:
    """Names of a registry with the first lines of their docstrings, without markup, for editors to show."""
    lines = {name: (entry.__doc__ or "").split("\n")[0] for name, entry in registry.items()}
    return {name: re.sub(r":math:`([^`]*)`", lambda m: m[1].replace("\\", ""), line) for name, line in lines.items()}


def _laws(about: str) -> dict[str, Any]:
    """Names of friction laws: those of the package, `formula`, `table`, and names that a user gives."""
    formula, table = "A formula of the sliding speed, under mu", "Measured friction: a file, or lists v and mu"
    known = _constants(_meanings(LAWS) | {own.FORMULA: formula, own.TABLE_LAW: table})
    other = {"description": "a law of the section laws, or of the Python session", "minLength": 1}
    return {"description": about, "type": "string", "anyOf": [*known, other]}


_VALUE, _TEXT, _FLAG = {"type": ["number", "string"]}, {"type": "string"}, {"type": "boolean"}


def _nest(leaves: Mapping[str, dict[str, Any]]) -> dict[str, Any]:
    """Schema of nested sections from schemas by dotted path; the key ``0`` stands for items of a list."""
    groups: dict[str, dict[str, dict[str, Any]]] = {}
    for path, leaf in leaves.items():
        key, _, rest = path.partition(".")
        groups.setdefault(key, {})[rest] = leaf
    children = {key: group[""] if "" in group else _nest(group) for key, group in groups.items()}
    return _list(children["0"]) if "0" in children else _section(children)


def _section(properties: Mapping[str, Any], *required: str) -> dict[str, Any]:
    found = {"type": "object", "properties": dict(properties), "additionalProperties": False}
    return found | ({"required": list(required)} if required else {})


def _open(about: str, values: dict[str, Any], **rest: Any) -> dict[str, Any]:
    """Section whose keys are the user's."""
    return {"description": about, "type": "object", **rest, "additionalProperties": values}


def _list(items: dict[str, Any], **rest: Any) -> dict[str, Any]:
    return {"type": "array", "items": items, "minItems": 1, **rest}


def _text(about: str) -> dict[str, Any]:
    return {"description": about, **_TEXT}


def _any(*options: Mapping[str, Any], **about: str) -> dict[str, Any]:
    return {**about, **(options[0] if len(options) == 1 else {"anyOf": list(options)})}


def _word(about: str, meanings: Mapping[str, str]) -> dict[str, Any]:
    return {"description": about, "oneOf": _constants(meanings)}


def _constants(meanings: Mapping[str, str]) -> list[dict[str, str]]:
    return [{"const": name} | ({"description": text} if text else {}) for name, text in meanings.items()]


def _keys(keys: Keys, **others: dict[str, Any]) -> dict[str, dict[str, Any]]:
    """Schemas of the values under the keys of a section; `others` are those that a function of their own reads."""
    return {name: _key(key, others.get(name, _FLAG)) for name, key in keys.items()}


def _key(key: Parameter | Key, form: dict[str, Any]) -> dict[str, Any]:
    """Schema of a value; `form` is that of one which is neither a number nor a name."""
    if isinstance(key, Parameter):
        return _number(key)
    return _word(key.long_name, key.names) if key.names else {"description": key.long_name, **form}


def _solver() -> dict[str, Any]:
    methods: list[dict[str, Any]] = [{"type": "string", "enum": list(METHODS)}]
    for name, about in _meanings(METHODS).items():
        keys = {"method": {"const": name, "description": about}, **_keys(keys_of(METHODS[name]))}
        methods.append(_section(keys, "method"))
    return _any(*methods, description="how time advances")


def _sweep(paths: list[str]) -> dict[str, Any]:
    arcs = "|".join(path.removeprefix("zones.0.") for path in paths if path.startswith("zones.0."))
    laws = _list(_laws("friction law"))
    parameter = r"^(friction|drive|force|body\.load)\.[A-Za-z][A-Za-z0-9_]*$"
    places = "|".join(("friction", *(rf"friction\.{name}" for name in ("rough", *ELSEWHERE)), r"zones\.[0-9]+"))
    of_way = rf"^({places})\.[A-Za-z][A-Za-z0-9_]*\.({'|'.join(WAYS)})$"
    patterns = rf"^zones\.[0-9]+\.({arcs})$", parameter, of_way
    names = {"anyOf": [{"enum": [LAW, *paths]}, *({"pattern": pattern} for pattern in patterns)]}
    together = {"anyOf": [*names["anyOf"], {"pattern": r"^[^,\s]+(\s*,\s*[^,\s]+)+$"}]}
    bounds = {"type": "array", "prefixItems": [_VALUE, _VALUE, _number(axes.COUNT)], "minItems": 3, "maxItems": 3}
    axis = {"anyOf": [_list(_VALUE), *(_section({kind: bounds}) for kind in ("linspace", "geomspace"))]}
    grid = "path -> values; every combination is run; paths with commas between them vary together"
    of_laws = {LAW: laws | {"uniqueItems": True}}
    points = "CSV file whose columns are paths and whose rows are runs, or its columns"
    columns = _open("path -> values", _list(_VALUE), propertyNames=names, properties={LAW: laws})
    which = "axis along which each cell starts from the state in which the one before ended"
    followed = _section(_keys(keys_of(Follow), axis=_TEXT), "axis")
    boundaries = "compute only the boundaries of the map: every 32nd cell, then where neighbours differ"
    return _section(
        {
            "grid": _open(grid, axis, propertyNames=together, properties=of_laws),
            "refine": _any(_FLAG, _section(_keys(keys_of(Refinement))), description=boundaries),
            "follow": _any(_TEXT, followed, description=which),
            "sample": _sample(together, axis),
            "points": _any(_TEXT, columns, description=points),
        }
    )


def _sample(names: dict[str, Any], axis: dict[str, Any]) -> dict[str, Any]:
    kinds: dict[str, Any] = {}
    for name, arguments in DISTRIBUTIONS.items():
        count, about = len(arguments), f"[{', '.join(arguments)}]"
        kinds[name] = {"description": about, "type": "array", "items": _VALUE, "minItems": count, "maxItems": count}
    about = "[least value, greatest value], or mean ± tolerance, which may be in per cent"
    kinds["uniform"] = {"description": about, "anyOf": [kinds["uniform"], _TEXT]}
    columns = {"type": "object", "additionalProperties": _list(_VALUE)}
    kinds["values"] = _any(_list(_VALUE), columns, description="values, each as probable as the others")
    kinds["file"] = _text("CSV file with a column for each path; a row is a draw")
    kinds["over"] = _text("path that the draw is multiplied by")
    drawn = "path -> distribution; paths with commas between them are drawn together"
    others = {
        "of": _open(drawn, _section(kinds), propertyNames=names, minProperties=1),
        "quantiles": {"type": "object", "additionalProperties": _list(_VALUE)},
        "survival": axis,
        "sensitivity": {"anyOf": [_FLAG, _section({"of": _list(_TEXT)}, "of")]},
    }
    about = "uncertain parameters: each cell of the grid is sampled"
    return _any(_section(_keys(uncertain.KEYS, **others), "n", "of"), description=about)
