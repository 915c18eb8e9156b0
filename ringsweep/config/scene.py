"""The section ``scene`` of a configuration: read, validated, in SI units."""

from __future__ import annotations

import re
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping
from dataclasses import replace
from functools import lru_cache, partial
from itertools import product
from math import pi
from typing import Any

from ringsweep.config import own
from ringsweep.config.reading import Document, choose, missing, one_of, read_keys, section_of, suggestion, warn_once
from ringsweep.errors import InputError
from ringsweep.models import MODELS, WITH_IMPACT, model_of, parameters
from ringsweep.models.scene import ELSEWHERE, FRAMES, LAW, WAYS, Scene, Section, Structure
from ringsweep.physics.drives import DRIVES
from ringsweep.physics.friction import LAWS, Dynamic, family_of
from ringsweep.physics.friction.formula import NAMES
from ringsweep.physics.friction.registry import SURFACE
from ringsweep.quantities.parameters import Key, Parameter
from ringsweep.quantities.units import is_plain, quantity, show
from ringsweep.quantities.variables import written

#: Values of ``initial.steady``.
STEADY = {"slip": "the body rests in space, where spring, friction and constant forces balance"}

#: Keys by section; a value has no keys below it.
Tree = Mapping[str, Any]

# Ratio of lengths of one scene above which a unit may be wrong: 1 m in place of 1 mm.
_LARGEST_RATIO = 1000.0

# Angle in rad above which a plain number may have been meant in degrees: two turns.
_LARGEST_ANGLE = 4.0 * pi


#: Keys of the section ``record``.
RECORD = {
    "exponent": Key("whether a run tells its Lyapunov exponent and its Floquet multipliers", default=False),
    "section": Key("points of the motion that a run keeps"),
}


def read_record(given: Any, model: str) -> tuple[bool, Section | None]:
    """Whether the mapping under ``record`` asks for the exponent, and the section that it asks for.

    Raises
    ------
    InputError
        If it is no mapping, has an unknown key or a wrong value, or if the model has no exponent or no section.
    """
    record = read_keys(given, RECORD, "record")
    for key, known in (("exponent", "has_exponent"), ("section", "sections")):
        if record[key] not in (None, False) and not getattr(MODELS[model], known):
            others = ", ".join(name for name, other in MODELS.items() if getattr(other, known))
            raise InputError(f"record.{key}", f"model {model} has none: it is known of model {others}; leave it out")
    if record["section"] is None:
        return record["exponent"], None
    section = read_keys(record["section"], Section, "record.section")
    one_of(section["at"], MODELS[model].sections, "record.section.at", "is no instant of a section")
    if section["period"] is not None and section["at"] != "period":
        problem = f"belongs to `at: period`, not to `at: {section['at']}`: leave it out"
        raise InputError("record.section.period", problem)
    return record["exponent"], Section(deflections=False, **section)


def sweepable(scene: Scene) -> dict[str, Parameter | Key]:
    """Every path of a scene that a sweep can vary, with its parameter."""
    return {**numbers_of(scene.structures), LAW: own.law_choice(scene.structure.model, scene.structures)}


def outcome_numbers(scene: Scene) -> list[str]:
    """Outcomes of the scene's model that are numbers."""
    model = model_of(scene.structure)
    variables = model.variables
    return [name for name in model.outcomes if name not in model.absent and variables[name].dtype == "float64"]


def parse_scene(doc: Document, swept: Collection[str], laws: tuple[str, Any] | None) -> Scene:
    """The scene of a configuration.

    Parameters
    ----------
    doc : Document
    swept : collection of str
        Paths that the sweep gives, and that the scene may lack.
    laws : tuple of str and sequence, optional
        Friction laws that the sweep gives: their place in the configuration, and their names.

    Raises
    ------
    InputError
        If something in the scene is wrong. Contradictions between values are not looked for.
    """
    scene = section_of(doc.tree, "scene", "")
    model = choose(MODELS, scene, "scene.model", "model")
    exponent, section = read_record(doc.tree.get("record", {}), model)
    elsewhere = _name_elsewhere(scene, swept)
    given = scene.get("zones", [])
    if not isinstance(given, list) or ("zones" in scene and not given):
        raise InputError("scene.zones", f"a list of zones is expected, got {show(given)}")
    zones = tuple(f"zones.{i}" for i in range(len(given)))
    names, defined, curve = own.read_laws(doc, scene, model, laws)
    moved = replace(_read_motion(scene, model, swept), elsewhere=elsewhere)
    # Name a misspelt key, rather than the key that is missing because of it.
    known, types = tuple(own.law_choice(model, defined).names), tuple(defined.items())
    registered = MODELS[model], WITH_IMPACT.get(model), *map(LAWS.get, known), *DRIVES.values()
    keys = _keys(moved, known, types, zones or ("zones.0",), (*DRIVES, own.FORMULA), *registered)
    near = _keys(moved, tuple(names or MODELS[model].laws), types, zones[:1], (moved.drive,), *registered)
    leaves = dict(_leaves(scene, keys, partial(_hint, moved, keys, near)))
    if not names:
        section_of(scene, "friction", "scene.")
        raise InputError(f"scene.{LAW}", f"missing: name a friction law: {', '.join(known)}")
    if section is not None:
        section = replace(section, deflections=any(family_of({**LAWS, **defined}[law]) is Dynamic for law in names))
    moved = replace(moved, exponent=exponent, section=section, arcs=_arcs(scene, zones, leaves))
    tabled = {"drive": moved.drive == "table", "body.load": moved.load is not None}
    tabled["force"] = any(f"force.{name}" in leaves for name in own.TABLE_KEYS["force"])
    table, load, force = (own.read_samples(doc, written(doc.tree, of), of) if tabled[of] else None for of in tabled)
    moved = replace(moved, table=table, load=load, force=force)
    structures = {
        law: replace(moved, law=law, own_law=defined.get(law), curve=curve if law == own.TABLE_LAW else None)
        for law in names
    }
    values = _read_numbers(structures, leaves, swept)
    _warn_of_unused_numbers(structures, leaves)
    lengths = (path for path, parameter in numbers_of(structures).items() if parameter.unit == "m" and path in values)
    _warn_of_lengths({path: values[path] for path in lengths})
    return Scene(structures, values, scene)


def _name_elsewhere(scene: dict[str, Any], swept: Collection[str]) -> str:
    """Key of the friction outside the zones: that of the axes. The scene's own is renamed if it is the other one."""
    friction = section_of(scene, "friction", "scene.") if "friction" in scene else {}
    given = [name for name in ELSEWHERE if name in friction]
    typed = [name for name in ELSEWHERE if any(str(path).startswith(f"friction.{name}.") for path in swept)]
    if len(given) > 1 or len(typed) > 1:
        raise InputError("scene.friction.rest", "is another name of friction.elsewhere: keep one of them")
    name = (typed or given or ELSEWHERE)[0]
    if given and given != [name]:
        friction[name] = friction.pop(given[0])
    return name


def as_named(path: str, name: str) -> str:
    """The path with this name of ``friction.elsewhere`` in the place of its other one."""
    return re.sub(rf"^((scene\.)?friction)\.({'|'.join(ELSEWHERE)})(?=\.|$)", rf"\1.{name}", path)


def _arcs(scene: dict[str, Any], zones: tuple[str, ...], leaves: Collection[str]) -> tuple[str, ...]:
    """Paths of the zones: of the list, or of the only one."""
    rough = [path for path in leaves if path.startswith("friction.rough.")]
    if not zones and rough and "zone" not in scene:
        raise InputError(f"scene.{rough[0]}", "there is no zone: give zone, or leave friction.rough out")
    for other in ("zone", *rough) if zones else ():
        if other in scene or other in leaves:
            raise InputError(f"scene.{other}", "cannot stand beside zones, each of which has its own values")
    return zones or ("zone",) * ("zone" in scene)


def _read_motion(scene: dict[str, Any], model: str, swept: Collection[str]) -> Structure:
    """Structure without a friction law: the drive, what formulas move the drive and the body, and impact."""
    drive = "none"
    if "drive" in scene:
        names = dict.fromkeys([*DRIVES, own.FORMULA])
        drive = choose(names, section_of(scene, "drive", "scene."), "scene.drive.law", "drive law")
    section = "stops" if model == "belt" else "impact"
    impact = model in WITH_IMPACT and (section in scene or any(str(path).startswith(f"{section}.") for path in swept))
    found = Structure(model, "", drive, own_drive=own.drive_type(model, scene.get("drive", {})), impact=impact)
    found = replace(found, two_way=_two_way(scene, swept))
    if not _takes_force(model):
        return found
    # That they are sections is made sure of where their keys are read.
    friction, body = (one if isinstance(one := scene.get(key), dict) else {} for key in ("friction", "body"))
    own_load = own.force_type(load := body.get("load"), "body.load")
    # The table itself is read once its keys are known to be right.
    table: Any = () if isinstance(load, dict) and own_load is None else None
    return replace(
        found,
        own_force=own.force_type(scene.get("force")),
        own_load=own_load,
        load=table,
        steady=_starts_steadily(scene, swept),
        frame=one_of(friction.get("frame", "belt"), FRAMES, "scene.friction.frame", "is no frame of zones"),
    )


def _starts_steadily(scene: dict[str, Any], swept: Collection[str]) -> bool:
    """Whether the body is launched at steady slip, which leaves nothing of its state to choose."""
    if (steady := written({"scene": scene}, "initial.steady")) is None:
        return False
    one_of(steady, STEADY, "scene.initial.steady", "is no steady motion")
    for name in ("x", "velocity", "deflection", "contact_age"):
        if name in scene["initial"] or f"initial.{name}" in swept:
            raise InputError(f"scene.initial.{name}", "cannot stand beside initial.steady, which gives it")
    return True


def _two_way(scene: dict[str, Any], swept: Collection[str]) -> tuple[str, ...]:
    """Paths of the friction coefficients that the scene or the sweep gives for both directions of sliding.

    A number of which the sweep varies one direction becomes two, as ``--set`` makes them.
    """
    sections = dict(_sections(scene))
    split = *sections, *(path.rpartition(".")[0] for path in map(str, swept) if path.rpartition(".")[2] in WAYS)
    found = tuple(path for path in dict.fromkeys(split) if path.rpartition(".")[2] in SURFACE)
    for path in found:
        place, _, name = path.rpartition(".")
        if path not in sections and name in (section := sections.get(place, {})):
            section[name] = dict.fromkeys(WAYS, section[name])
    return found


def _sections(node: Any, prefix: str = "") -> Iterator[tuple[str, dict[str, Any]]]:
    """Paths of all sections below a path that ends with a dot, and the sections."""
    for key, child in node.items() if isinstance(node, dict) else enumerate(node):
        if isinstance(child, dict):
            yield f"{prefix}{key}", child
        if isinstance(child, dict | list):
            yield from _sections(child, f"{prefix}{key}.")


def _takes_force(model: str) -> bool:
    return "force.constant" in parameters(Structure(model, next(iter(MODELS[model].laws))))


def _read_numbers(
    structures: Mapping[str, Structure], leaves: Mapping[str, Any], swept: Collection[str]
) -> dict[str, float]:
    """Values by path: given, or by default. Those that the sweep gives may be missing."""
    values = {}
    for path, parameter in numbers_of(structures).items():
        if path in leaves:
            values[path] = quantity(leaves[path], parameter, f"scene.{path}")
            warn_of_plain_angle(path, leaves[path], parameter)
        elif parameter.default is not None:
            values[path] = parameter.default
        elif not parameter.optional and path not in swept:
            raise InputError(f"scene.{path}", missing(path, parameter) + _who_needs(path, structures))
    return values


def _who_needs(path: str, structures: Mapping[str, Structure]) -> str:
    """End of the message about a missing number: the law that needs it, and what a formula may have meant."""
    needing = [law for law, structure in structures.items() if path in parameters(structure)]
    who = f"; law {needing[0]} needs it" if len(structures) > len(needing) else ""
    name = path.rpartition(".")[2]
    if path.startswith("friction.") and name != name.lower() and name.lower() in NAMES:
        who += f"; or did you mean `{name.lower()}` in the formula, {NAMES[name.lower()]}?"
    return who


def _warn_of_unused_numbers(structures: Mapping[str, Structure], leaves: Collection[str]) -> None:
    """Warn of numbers that the scene's laws do not have.

    Raises
    ------
    InputError
        If it is a number beside a table or a formula of the force.
    """
    first = next(iter(structures.values()))
    used = {*numbers_of(structures), *_structural(first.model, first.drive, structures)}
    for path in leaves:
        if path not in used:
            section = path.partition(".")[0]
            if section == "force":
                problem = "cannot stand beside a table or a formula, which gives all of the force"
                raise InputError(f"scene.{path}", problem)
            law = f"drive law {first.drive}" if section == "drive" else f"friction law {' or '.join(structures)}"
            warn_once("scene.%s is not used: %s has no such parameter%s", path, law, own.laws_with(path))


def _warn_of_lengths(lengths: Mapping[str, float]) -> None:
    """Warn of lengths so different that a unit may be wrong."""
    # Those of a friction law are lengths of asperities.
    given = sorted((abs(value), path) for path, value in lengths.items() if value and not path.startswith("friction."))
    if given and given[-1][0] > _LARGEST_RATIO * given[0][0]:
        (short, small), (long, large) = given[0], given[-1]
        message = "scene.%s is %g m and scene.%s is %g m: is a unit missing? A plain number is in metres"
        warn_once(message, large, long, small, short)


def warn_of_plain_angle(path: str, given: Any, parameter: Parameter | Key) -> None:
    """Warn of an angle of many turns that has no unit: it may have been meant in degrees."""
    # Other than angles without limits are refused if they are this large.
    is_angle = isinstance(parameter, Parameter) and parameter.unit == "rad" and is_plain(given)
    if is_angle and abs(angle := float(given)) > _LARGEST_ANGLE:
        message = "scene.%s is %g rad, %.3g turns: is a unit missing? A plain number is in radians; write `%g deg` for "
        warn_once(message + "degrees", path, angle, abs(angle) / (2.0 * pi), angle)


def numbers_of(structures: Mapping[str, Structure]) -> dict[str, Parameter]:
    """Every numeric path that a scene has under at least one of its laws."""
    return {path: parameter for one in structures.values() for path, parameter in parameters(one).items()}


def _structural(model: str, drive: str, laws: Collection[str]) -> Iterator[str]:
    """Paths of a scene that are no numeric parameters."""
    yield from ("model", LAW, "drive.law", "friction.laws")
    takes_force = _takes_force(model)
    by_formula = {"friction.mu": own.FORMULA in laws, "friction.at_rest": own.FORMULA in laws}
    by_formula |= dict.fromkeys(("drive.theta", "drive.velocity"), drive == own.FORMULA)
    by_formula |= dict.fromkeys(("force.formula", "body.load.formula", "initial.steady", "friction.frame"), takes_force)
    yield from (path for path, is_used in by_formula.items() if is_used)
    by_table = {"drive": drive == "table", "force": takes_force, "friction": own.TABLE_LAW in laws}
    by_table["body.load"] = takes_force
    yield from (f"{of}.{key}" for of, keys in own.TABLE_KEYS.items() if by_table[of] for key in keys)


def structures_of(
    model: str,
    laws: Collection[str],
    defined: Mapping[str, type],
    zones: tuple[str, ...],
    drives: Iterable[str],
    **rest: Any,
) -> Iterator[Structure]:
    """Structures that together have every number that a scene of a model can have, under some laws and some drives."""
    # Laws bring parameters of each arc, drives do not: a thousand arcs under every law and drive would take long.
    taken = {*MODELS[model].laws, *defined}
    known = [law for law in laws if law in taken]
    all_arcs = product(known, ("none",), ((), ("zone",), zones))
    for law, drive, arcs in (*all_arcs, *((known[0], drive, ()) for drive in drives if drive in DRIVES)):
        yield Structure(model, law, drive, arcs, own_law=defined.get(law), impact=model in WITH_IMPACT, **rest)


@lru_cache(maxsize=16)
def _keys(
    moved: Structure,
    laws: Collection[str],
    defined: tuple[tuple[str, type], ...] = (),
    zones: tuple[str, ...] = ("zones.0",),
    drives: Collection[str] = (*DRIVES, own.FORMULA),
    *_registered: Any,
) -> Tree:
    """Keys that a scene of a model can have, under some laws and some drives.

    They are found once for as long as the same types are registered under their names.
    """
    rest = {"elsewhere": moved.elsewhere, "two_way": moved.two_way, "frame": moved.frame}
    structures = [*structures_of(moved.model, laws, dict(defined), zones, drives, **rest)]
    structures.append(replace(moved, law=structures[0].law, own_law=structures[0].own_law))
    paths = dict.fromkeys(path for drive in drives for path in _structural(moved.model, drive, laws))
    found: dict[str, Any] = {}
    for path in paths | dict.fromkeys(path for structure in structures for path in parameters(structure)):
        section = found
        for key in path.split("."):
            section = section.setdefault(key, {})
    return found


def _leaves(node: Any, keys: Tree, hint: Callable[[str, str, Tree], str], path: str = "") -> Iterator[tuple[str, Any]]:
    """Path and value of every leaf of a scene that has these keys, below a path that ends with a dot.

    `hint` makes the end of the message about a key that is not among those of its section.
    """
    where = f"scene.{path}".rstrip(".")
    items = node.items() if isinstance(node, dict) else enumerate(node) if isinstance(node, list) else None
    if items is None:
        raise InputError(where, f"a section is expected, got {show(node)} (known keys: {', '.join(keys)})")
    for key, value in items:
        # Check the key, not the path: the single key "body.mass" would pass for `mass` under `body`.
        if (below := keys.get(str(key))) is None:
            raise InputError(f"{where}.{key}", f"unknown key{hint(path.rstrip('.'), str(key), keys)}")
        if below:
            yield from _leaves(value, below, hint, f"{path}{key}.")
        else:
            yield f"{path}{key}", value


def _hint(moved: Structure, keys: Tree, near: Tree, section: str, key: str, here: Tree) -> str:
    """End of the message about an unknown key: a comma has made it, it belongs elsewhere, or is misspelt.

    `keys` are those of the scene, `near` those under the laws that are given, and `here` those of the section.
    """
    if key[:1].isdigit():
        return ": a comma ends a value in YAML, write a decimal point"
    if section.startswith("zone") and key in ("from", "to", "start", "end", "width"):
        return ": a zone has a center, (from + to)/2, and a half_angle or on a belt a half_length, (to - from)/2"
    if not section and key in ("solver", "sweep", "record"):
        return f": the section `{key}` stands beside `scene`, not in it: take away its indentation"
    if len(key) < 2 or not any(known.startswith(key) for known in here):
        if places := _places(keys, key):
            return f"; did you mean {' or '.join(sorted(places))}?"
        for other in MODELS:
            others = _keys.__wrapped__(Structure(other, "", elsewhere=moved.elsewhere), tuple(MODELS[other].laws))
            if places := _places(others, key):
                return f": model {other} has {' or '.join(sorted(places))}, this is model {moved.model}"
    known = (written({"scene": near}, section) if section else near) or here
    numbers = [name for name in known if name != "law"]
    # The only number of a section is the one that is meant, whatever it is called.
    return suggestion(numbers[0] if len(numbers) == 1 else key, known)


def _places(keys: Tree, key: str, path: str = "") -> list[str]:
    """Paths whose last key is `key`, as text; those of a list of zones are left out."""
    found = [f"`{path}{key}`"] if key in keys else []
    return found + [place for k, below in keys.items() if k != "zones" for place in _places(below, key, f"{path}{k}.")]
