"""Configuration text to validated scene, axes and solver in SI units.

Every message about wrong input starts here, from what physics and solvers declare about their
parameters; :mod:`ringsweep.document` knows the lines, :mod:`ringsweep.quantities.units` the units.
"""

from __future__ import annotations

import dataclasses
import difflib
import logging
import math
import os
from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cache
from itertools import product
from typing import TYPE_CHECKING, Any, get_type_hints

import numpy as np
from numpy.typing import NDArray

from ringsweep import document
from ringsweep.document import Document, scalar
from ringsweep.errors import InputError
from ringsweep.models import batch, parameters
from ringsweep.models.scene import LAW, Scene, Structure
from ringsweep.quantities.parameters import Choice, Parameter, declared
from ringsweep.quantities.units import quantity, show
from ringsweep.quantities.variables import OUTCOMES

if TYPE_CHECKING:
    import xarray as xr

logger = logging.getLogger("ringsweep")

TABLE = {"time": Parameter("s", "time in the table of the drive"), "theta": Parameter("rad", "angle of the drive")}
COUNT = Parameter("1", "number of values", lower=1, upper=1_000_000)

#: Cells of a sweep at most: what 24 variables of them take on a disk is some ten gigabytes.
MOST_CELLS = 100_000_000

# Cells whose consistency is checked at once: many arcs over many points must not fill the memory.
_CHUNK = 4096


@dataclass(frozen=True)
class Axes:
    """What a sweep varies.

    Attributes
    ----------
    sizes : dict of str to int
        Length of each dimension, in order.
    columns : dict of str to tuple
        For each swept path its dimensions, and its values with a shape to match: numbers in SI units,
        or names of friction laws.
    """

    sizes: dict[str, int] = field(default_factory=dict)
    columns: dict[str, tuple[tuple[str, ...], NDArray[Any]]] = field(default_factory=dict)


@dataclass(frozen=True)
class Config:
    """A validated configuration.

    Attributes
    ----------
    scene : Scene
        A value that is only swept may be missing from it.
    solver : Method
        A method with its options.
    axes : Axes
        Without dimensions if nothing is swept.
    source : dict
        The configuration as plain values, units as typed, files inlined: enough to run it again.
    name : str
        Stem of the file that it came from.
    """

    scene: Scene
    solver: Any
    axes: Axes
    source: dict[str, Any]
    name: str


def load(config: str | os.PathLike[str] | Mapping[str, Any]) -> Config:
    """Read and validate a configuration.

    Parameters
    ----------
    config : path-like or mapping
        A YAML file, what one would hold, or a result file, whose sweep it is.

    Raises
    ------
    InputError
        With what is wrong, where, and what is allowed.
    """
    doc = document.read(config)
    with doc.placing():
        found = _config(doc)
    if doc.swept is None:
        return found
    # The very axes that were run, by dimensions that a configuration cannot name.
    given = ((path, path, dims, values) for path, (dims, values) in doc.swept.items())
    return dataclasses.replace(found, axes=_axes(given))


def with_values(config: str | os.PathLike[str] | Mapping[str, Any], settings: Iterable[str] = ()) -> Config:
    """The configuration of a single run: axes left out, some values changed.

    If the grid goes through friction laws, and none is set, it is that of a run under each of them.

    Parameters
    ----------
    config : path-like or mapping
        As in :func:`load`; what else it sweeps is ignored.
    settings : iterable of str
        ``"PATH=VALUE"`` with a path in the scene (``drive.amplitude=3``) or ``solver.steps=...``.
    """
    doc = document.read(config)
    with doc.placing():
        settled = {_set(doc, setting) for setting in settings}
        sweep = _sweep(doc)
        doc.tree.pop("sweep", None)
        if LAW in sweep.get("grid", {}) and f"scene.{LAW}" not in settled:
            doc.tree["sweep"] = {"grid": {LAW: sweep["grid"][LAW]}}
        try:
            return _config(doc)
        except InputError as error:
            path = error.path.removeprefix("scene.")
            if path in _swept(sweep) and error.problem.startswith("missing"):
                error.problem = f"missing: it is swept here, and one run needs one value: --set {path}=VALUE"
            raise


def read_scene(scene: Mapping[str, Any], swept: Collection[str] = ()) -> Scene:
    """Read and validate the mapping that stands under ``scene`` in a configuration.

    Parameters
    ----------
    scene : mapping
    swept : collection of str, or mapping of str to sequence
        Paths that a sweep will fill; their values may be missing, and contradictions between
        values are left to :func:`read_axes`. Which friction laws these are only a mapping can tell.
    """
    laws = (f"axes[{LAW!r}]", swept[LAW]) if isinstance(swept, Mapping) and LAW in swept else None
    found = _scene(Document(document.read({"scene": scene}).tree), swept, laws)
    if not swept:
        _check(found, Axes())
    return found


def read_axes(scene: Scene, axes: Mapping[str, Any]) -> Axes:
    """Read and validate the axes of a sweep given in Python.

    Parameters
    ----------
    scene : Scene
    axes : mapping of str to sequence or DataArray
        For each path a sequence of shape ``(n,)``, which makes a dimension of its own, or a
        DataArray, whose dimensions it shares with others of the same name. A DataArray's ``units``
        are heeded.

    Raises
    ------
    InputError
        If a path or value is wrong, or values contradict each other in some cell.
    """
    # Reading a configuration does not need it, and should not wait for it.
    import xarray as xr

    if not isinstance(axes, Mapping):
        raise InputError("axes", f"a mapping of paths to values is expected, got {show(axes)}")
    known = sweepable(scene)

    def entries() -> Iterator[_Entry]:
        for path, given in axes.items():
            where = f"axes[{path!r}]"
            parameter = _axis(known, path, where)
            if isinstance(given, xr.DataArray):
                yield path, where, *_array(given, parameter, where)
            else:
                yield path, where, (_dimension(path),), _values(given, parameter, where)

    found = _axes(entries())
    _check(scene, found)
    return found


def read_solver(solver: str | Mapping[str, Any], scene: Scene | None = None) -> Any:
    """A method with its options, from its name or from the mapping under ``solver`` in a configuration.

    Parameters
    ----------
    solver : str or mapping
    scene : Scene, optional
        What the method must be able to take.
    """
    found = _solver(document.read({"solver": solver}).tree["solver"])
    for structure in scene.structures.values() if scene else ():
        found.check(structure)
    return found


def sweepable(scene: Scene) -> dict[str, Parameter | Choice]:
    """Every path of a scene that a sweep can vary, with what it is."""
    return {**_numbers(scene.structures), LAW: _law(scene.structure.model)}


def suggestion(word: object, known: Iterable[str]) -> str:
    """The end of a message about an unknown name: the nearest known one, and all of them."""
    names = list(dict.fromkeys(known))
    near = difflib.get_close_matches(str(word)[:100], names, n=1)
    rest = "" if len(names) <= 40 else f", ... ({len(names)} in all)"
    return (f"; did you mean `{near[0]}`?" if near else "") + f" (known: {', '.join(names[:40])}{rest})"


# ---- one configuration ---------------------------------------------------------------------


def _config(doc: Document) -> Config:
    tree = doc.tree
    for key in tree:
        if key not in ("scene", "solver", "sweep"):
            raise InputError(key, "unknown section" + suggestion(key, ("scene", "solver", "sweep")))
    sweep = _sweep(doc)
    laws = [(f"sweep.{part}.{LAW}", columns[LAW]) for part, columns in sweep.items() if LAW in columns]
    scene = _scene(doc, _swept(sweep), laws[0] if laws else None)
    solver = read_solver(tree.get("solver", "auto"), scene)
    axes = _sweep_axes(scene, sweep)
    for path in axes.columns:
        place = f"sweep.grid.{path}" if path in sweep.get("grid", {}) else f"sweep.points.{path}"
        if place in doc.marks:
            doc.marks[f"scene.{path}"] = doc.marks[place]
    _check(scene, axes)
    return Config(scene, solver, axes, tree, doc.name)


def _set(doc: Document, setting: str) -> str:
    """Put one ``PATH=VALUE`` into the tree, and tell where; whether it means anything shows when it is read."""
    path, equals, text = (part.strip() for part in setting.partition("="))
    if not equals or not path:
        raise InputError("--set", f"{show(setting)} is not of the form PATH=VALUE")
    full = path if path.split(".")[0] in ("scene", "solver") else f"scene.{path}"
    *parents, last = full.split(".")
    node: Any = doc.tree
    for key in parents:
        if isinstance(node, dict) and key not in node:
            node[key] = {}
        node = _child(node, key, full)
    if isinstance(node, list):
        _child(node, last, full)
        node[int(last)] = scalar(text)
    elif isinstance(node, dict):
        node[last] = scalar(text)
    else:
        raise InputError(full, f"cannot be set: {'.'.join(parents)} is {show(node)}")
    doc.marks[full] = f"--set {setting}", None
    return full


def _child(node: Any, key: str, full: str) -> Any:
    if isinstance(node, dict):
        return node[key]
    if isinstance(node, list) and key.isdecimal() and int(key) < len(node):
        return node[int(key)]
    raise InputError(full, f"cannot be set: there is no `{key}` to go through")


# ---- scene ---------------------------------------------------------------------------------


def _scene(doc: Document, swept: Collection[str], laws: tuple[str, Any] | None) -> Scene:
    """The scene, under its own friction law or those that a sweep gives: their place, and what stands there."""
    from ringsweep.models import MODELS
    from ringsweep.physics.drives import DRIVES

    scene = _section(doc.tree, "scene", "")
    model = _choose(MODELS, scene, "scene.model", "model")
    arcs = scene.get("zones", [])
    if not isinstance(arcs, list) or ("zones" in scene and not arcs):
        raise InputError("scene.zones", f"a list of arcs is expected, got {show(arcs)}")
    zones = tuple(f"zones.{i}" for i in range(len(arcs)))
    named = scene.get("friction")
    if isinstance(named, dict) and "law" in named:
        # A law that the model does not take is found before the parameters that only it has.
        _choose(MODELS[model].laws, named, f"scene.{LAW}", f"friction law of model {model}")
    # A misspelt key is found before the key that it leaves missing.
    leaves = dict(_leaves(scene, "", _Names(_all_paths(model, zones or ("zones.0",)))))
    names = []
    if laws is None or LAW in leaves:
        names = [_choose(MODELS[model].laws, _section(scene, "friction", "scene."), f"scene.{LAW}", "friction law")]
    if laws is not None:
        names = _values(laws[1], _law(model), laws[0]).tolist()
    drive = "none"
    if "drive" in scene:
        drive = _choose(DRIVES, _section(scene, "drive", "scene."), "scene.drive.law", "drive law")
    rough = [path for path in leaves if path.startswith("friction.rough.")]
    if "zones" in scene:
        for other in ("zone", *rough):
            if other in scene or other in leaves:
                raise InputError(f"scene.{other}", "given beside zones: each of the zones has its own values")
    elif "zone" in scene:
        zones = ("zone",)
    elif rough:
        raise InputError(f"scene.{rough[0]}", "there is no rough zone: give zone, or leave friction.rough out")
    table = _table(doc, scene["drive"]) if drive == "table" else None
    structures = {law: Structure(model, law, drive, zones, table) for law in names}
    known = _numbers(structures)
    values = {}
    for path, parameter in known.items():
        if path in leaves:
            values[path] = quantity(leaves[path], parameter, f"scene.{path}")
        elif parameter.default is not None:
            values[path] = parameter.default
        elif not parameter.optional and path not in swept:
            needing = [law for law, structure in structures.items() if path in parameters(structure)]
            who = f"; law {needing[0]} needs it" if len(structures) > len(needing) else ""
            raise InputError(f"scene.{path}", _missing(path, parameter) + who)
    for path in leaves:
        if path not in known and path not in _structural(drive):
            where, name = ("drive", drive) if path.startswith("drive.") else ("friction", " or ".join(structures))
            _tell_of_unused(path, where, name)
    return Scene(structures, values, scene)


@cache
def _tell_of_unused(path: str, where: str, name: str) -> None:
    """Once: a run, its picture and its file read one configuration several times."""
    logger.warning("scene.%s is not used: %s law %s has no such parameter", path, where, name)


def _numbers(structures: Mapping[str, Structure]) -> dict[str, Parameter]:
    """Every numeric path that a scene has under any of its laws."""
    found: dict[str, Parameter] = {}
    for structure in structures.values():
        found |= parameters(structure)
    return found


def _law(model: str) -> Choice:
    from ringsweep.models import MODELS

    return Choice("friction law", tuple(MODELS[model].laws))


def _structural(drive: str) -> tuple[str, ...]:
    """Paths that choose the structure and carry no number."""
    return ("model", LAW, "drive.law", *(f"drive.{name}" for name in (*TABLE, "file") if drive == "table"))


def _all_paths(model: str, zones: tuple[str, ...]) -> list[str]:
    """Every path that some scene of this model has, whatever its laws."""
    from ringsweep.models import MODELS
    from ringsweep.physics.drives import DRIVES

    paths = dict.fromkeys(_structural("table"))
    for law, drive, arcs in product(MODELS[model].laws, DRIVES, {(), ("zone",), zones}):
        paths |= dict.fromkeys(parameters(Structure(model, law, drive, arcs)))
    return list(paths)


class _Names:
    """Dotted paths, and the sections on the way to them."""

    def __init__(self, paths: list[str]):
        self.paths = set(paths)
        self.children: dict[str, dict[str, None]] = {}
        for path in paths:
            while path:
                parent, _, key = path.rpartition(".")
                self.children.setdefault(parent, {})[key] = None
                path = parent


def _leaves(node: Any, path: str, names: _Names) -> Iterator[tuple[str, Any]]:
    """Every path below `node` that stands for a value, with that value."""
    where = f"scene.{path}".rstrip(".")
    items = node.items() if isinstance(node, dict) else enumerate(node) if isinstance(node, list) else None
    children = names.children[path.rstrip(".")]
    if items is None:
        raise InputError(where, f"a section is expected, got {show(node)} (known keys: {', '.join(children)})")
    for key, value in items:
        here = f"{path}{key}"
        # The key itself, not the path: `body.mass: 1` in one key would pass for `mass` under `body`.
        if str(key) not in children:
            raise InputError(f"scene.{here}", "unknown key" + suggestion(key, children))
        if here in names.paths:
            yield here, value
        else:
            yield from _leaves(value, f"{here}.", names)


def _missing(path: str, parameter: Parameter) -> str:
    examples = {"rad": "15 deg", "m": "10 mm", "1": "0.2", "": "1"}
    unit = f", in {parameter.unit}" if parameter.unit not in ("", "1") else ""
    example = "5000" if path.endswith(("steps", ".max_steps")) else examples.get(parameter.unit, f"1 {parameter.unit}")
    return f"missing: {parameter.long_name}{unit} (for example `{path.rpartition('.')[2]}: {example}`)"


def _table(doc: Document, drive: dict[str, Any]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Samples of a tabulated drive; those of a file move into the configuration."""
    if "file" in drive:
        if "time" in drive or "theta" in drive:
            raise InputError("scene.drive.file", "give a file, or time and theta, not both")
        columns = doc.inline_csv(drive["file"], "scene.drive.file", "scene.drive")
        renamed = {"time" if name == "t" else name: cells for name, cells in columns.items()}
        if set(renamed) != {"time", "theta"} or len(columns) != 2:
            hint = ": parted by commas" if len(columns) == 1 else ""
            raise InputError("scene.drive.file", f"columns t, theta are expected{hint}, got {', '.join(columns)}")
        doc.marks |= {k.replace("drive.t.", "drive.time."): v for k, v in doc.marks.items()}
        del drive["file"]
        drive |= renamed
    for name in TABLE:
        if name not in drive:
            raise InputError(f"scene.drive.{name}", "missing: a table needs a file, or lists time and theta")
    times, angles = (_values(drive[name], parameter, f"scene.drive.{name}") for name, parameter in TABLE.items())
    if len(times) != len(angles):
        raise InputError("scene.drive.theta", f"{len(angles)} angles for {len(times)} times")
    if len(times) < 4:
        raise InputError("scene.drive.time", f"{len(times)} samples are too few: a table needs at least 4")
    backward = np.flatnonzero(np.diff(times) <= 0.0)
    if len(backward):
        i = int(backward[0]) + 1
        raise InputError(f"scene.drive.time.{i}", f"{times[i]:g} s does not come after {times[i - 1]:g} s")
    if times[0] > 0.0:
        raise InputError("scene.drive.time.0", f"the table begins at {times[0]:g} s, but the run at 0 s")
    return times, angles


# ---- solver --------------------------------------------------------------------------------


def _solver(given: Any) -> Any:
    from ringsweep.solvers import METHODS

    section = {"method": given} if isinstance(given, str) else _section({"solver": given}, "solver", "")
    method: Any = METHODS[_choose(METHODS, section, "solver.method", "method")]
    options = {f.name: f for f in dataclasses.fields(method) if f.init}
    numbers, hints = declared(method), get_type_hints(method)
    for key in section:
        if key != "method" and key not in options:
            problem = f"no option of {section['method']}" + suggestion(key, ("method", *options))
            raise InputError(f"solver.{key}", problem)
    values: dict[str, Any] = {}
    for name, option in options.items():
        path = f"solver.{name}"
        if name not in section:
            if option.default is dataclasses.MISSING and option.default_factory is dataclasses.MISSING:
                raise InputError(path, _missing(name, numbers[name]) + f"; method {section['method']} needs it")
        elif name in numbers:
            values[name] = _number(section[name], numbers[name], hints[name], path)
        elif isinstance(section[name], bool):
            values[name] = section[name]
        else:
            raise InputError(path, f"true or false is expected, got {show(section[name])}")
    return method(**values)


def _number(given: Any, parameter: Parameter, kind: type, path: str) -> float | int:
    value = quantity(given, parameter, path)
    if kind is not int:
        return value
    if not value.is_integer():
        raise InputError(path, f"{show(given)} is not a whole number: {parameter.long_name} must be one")
    return int(value)


# ---- axes ----------------------------------------------------------------------------------

_Entry = tuple[str, str, tuple[str, ...], NDArray[Any]]


def _sweep(doc: Document) -> dict[str, Any]:
    """The section ``sweep``, its files inlined; empty if there is none."""
    if "sweep" not in doc.tree:
        return {}
    sweep = _section(doc.tree, "sweep", "")
    for key in sweep:
        if key not in ("grid", "points"):
            raise InputError(f"sweep.{key}", "unknown key" + suggestion(key, ("grid", "points")))
    if not sweep:
        raise InputError("sweep", "empty: give grid or points, or leave sweep out")
    if isinstance(sweep.get("points"), str):
        sweep["points"] = doc.inline_csv(sweep["points"], "sweep.points", "sweep.points")
    for key in sweep:
        if not _section(sweep, key, "sweep."):
            raise InputError(f"sweep.{key}", "empty: name at least one path, or leave it out")
    return sweep


def _swept(sweep: dict[str, Any]) -> set[str]:
    return set(sweep.get("grid", ())) | set(sweep.get("points", ()))


def _sweep_axes(scene: Scene, sweep: dict[str, Any]) -> Axes:
    known = sweepable(scene)
    points = sweep.get("points", {})

    def entries() -> Iterator[_Entry]:
        for path, given in points.items():
            where = f"sweep.points.{path}"
            yield path, where, ("point",), _values(given, _axis(known, path, where), where)
        for path, given in sweep.get("grid", {}).items():
            where = f"sweep.grid.{path}"
            parameter = _axis(known, path, where)
            if path in points:
                raise InputError(where, "also a column of sweep.points: a path can vary in one place only")
            spaced = isinstance(given, dict)
            yield path, where, (_dimension(path),), (_spaced if spaced else _values)(given, parameter, where)

    return _axes(entries())


def _axis(known: Mapping[str, Parameter | Choice], path: object, where: str) -> Parameter | Choice:
    if not isinstance(path, str) or path not in known:
        raise InputError(where, "the scene has no such number to vary" + suggestion(path, known))
    return known[path]


def _dimension(path: str) -> str:
    return path.replace(".", "_")


def _values(given: Any, parameter: Parameter | Choice, where: str) -> NDArray[Any]:
    """A sequence of quantities, or of names, shape ``(n,)``."""
    if hasattr(given, "__array__"):
        array = np.asarray(given)
        if array.ndim != 1 or array.dtype.kind not in "iufOU":
            what = "names" if isinstance(parameter, Choice) else "numbers"
            raise InputError(where, f"a list of {what} is expected, got shape {array.shape} of {array.dtype}")
        given = array.tolist()
    if not isinstance(given, Sequence) or isinstance(given, str | bytes):
        raise InputError(where, f"a list of values is expected, got {show(given)}")
    if not given:
        raise InputError(where, "empty: give at least one value")
    read: Any = _name if isinstance(parameter, Choice) else quantity
    return np.array([read(value, parameter, f"{where}.{i}") for i, value in enumerate(given)])


def _name(given: object, choice: Choice, path: str) -> str:
    """One of the names that there are to choose from."""
    if not isinstance(given, str) or given not in choice.names:
        raise InputError(path, f"{show(given)} is not a {choice.long_name}" + suggestion(given, choice.names))
    return given


def _array(given: xr.DataArray, parameter: Parameter | Choice, where: str) -> tuple[tuple[str, ...], NDArray[Any]]:
    """Dimensions and values of a DataArray."""
    dims = tuple(map(str, given.dims))
    if not dims:
        raise InputError(where, "a DataArray without dimensions varies nothing")
    unit = str(given.attrs.get("units", "1"))
    flat: Any = given.values.ravel()
    if unit != "1" and given.dtype.kind in "iuf":
        flat = [f"{value!r} {unit}" for value in flat.tolist()]
    return dims, _values(flat, parameter, where).reshape(given.shape)


def _spaced(given: dict[str, Any], parameter: Parameter | Choice, where: str) -> NDArray[np.float64]:
    """Values from ``{linspace: [first, last, count]}`` or ``geomspace``."""
    if isinstance(parameter, Choice):
        raise InputError(where, f"a list of names is expected, got {show(given)}")
    if len(given) != 1 or next(iter(given)) not in ("linspace", "geomspace"):
        raise InputError(where, f"a list of values, linspace or geomspace is expected, got {show(given)}")
    ((kind, bounds),) = given.items()
    where = f"{where}.{kind}"
    if not isinstance(bounds, list) or len(bounds) != 3:
        raise InputError(where, f"[first, last, count] is expected, got {show(bounds)}")
    first, last = (quantity(bound, parameter, f"{where}.{i}") for i, bound in enumerate(bounds[:2]))
    count = int(_number(bounds[2], COUNT, int, f"{where}.2"))
    if kind == "geomspace" and min(first, last) <= 0.0:
        raise InputError(where, f"both ends of geomspace must be greater than 0, got {first:g} and {last:g}")
    return np.linspace(first, last, count) if kind == "linspace" else np.geomspace(first, last, count)


def _axes(entries: Iterable[_Entry]) -> Axes:
    """Axes from columns, in their order."""
    found = Axes()
    for path, where, dims, values in entries:
        for dim, size in zip(dims, values.shape, strict=True):
            if dim in OUTCOMES:
                raise InputError(where, f"the dimension {dim} has the name of a variable of the result")
            if found.sizes.setdefault(dim, size) != size:
                raise InputError(where, f"{size} values along {dim}, where others have {found.sizes[dim]}")
        found.columns[path] = dims, values
        if dims == (_dimension(path),):
            _, first = np.unique(values, return_index=True)
            again = np.setdiff1d(np.arange(len(values)), first)
            if len(again):
                raise InputError(f"{where}.{again[0]}", f"{show(values[again[0]].item())} stands twice on this axis")
    total = math.prod(found.sizes.values())
    if total > MOST_CELLS:
        sizes = " x ".join(map(str, found.sizes.values()))
        raise InputError("sweep", f"{sizes} makes {total:.3g} cells: at most {MOST_CELLS:.3g} fit into one sweep")
    for path, (dims, _) in found.columns.items():
        name = _dimension(path)
        if name in found.sizes and dims != (name,):
            raise InputError(path, f"the dimension {name} has the name of this path, but does not index it alone")
    return found


def _check(scene: Scene, axes: Axes) -> None:
    """Let the model find values that contradict each other, in any cell of a sweep."""
    # Each condition is monotone in each value: of a grid axis the two extremes decide for all of it.
    picks = []
    for dim, size in axes.sizes.items():
        along = [values for dims, values in axes.columns.values() if dim in dims]
        alone = len(along) == 1 and along[0].ndim == 1 and along[0].dtype.kind == "f"
        picks.append(np.unique([along[0].argmin(), along[0].argmax()]) if alone else np.arange(size))
    shape = (1, *map(len, picks))
    total = math.prod(shape)
    for start in range(0, total, _CHUNK):
        flat = np.arange(start, min(start + _CHUNK, total))
        cells = np.unravel_index(flat, shape)[1:]
        place = {dim: pick[cell] for dim, pick, cell in zip(axes.sizes, picks, cells, strict=True)}
        values = {path: np.full(len(flat), value) for path, value in scene.values.items()}
        values |= {path: column[tuple(place[dim] for dim in dims)] for path, (dims, column) in axes.columns.items()}
        laws = values.pop(LAW, np.full(len(flat), scene.structure.law))
        for law, structure in scene.structures.items():
            own = laws == law
            if not own.any():
                continue
            try:
                batch(structure, {path: column[own] for path, column in values.items()})
            except InputError as error:
                if _is_swept(structure, scene, axes, error):
                    error.problem += " (in a cell of the sweep)"
                raise


def _is_swept(structure: Structure, scene: Scene, axes: Axes, error: InputError) -> bool:
    """Whether a contradiction comes from values of a sweep.

    It does not if the scene by itself says the same, with the least as with the greatest of the
    values that only the sweep gives.
    """
    if error.path.removeprefix("scene.") in axes.columns:
        return True
    for end in (np.min, np.max):
        swept = {path: end(column) for path, (_, column) in axes.columns.items() if path != LAW}
        try:
            batch(structure, {path: np.array([value]) for path, value in {**swept, **scene.values}.items()})
        except InputError as alone:
            if str(alone) == str(error):
                continue
        return True
    return False


# ---- sections ------------------------------------------------------------------------------


def _section(parent: dict[str, Any], key: str, prefix: str) -> dict[str, Any]:
    if key not in parent:
        raise InputError(f"{prefix}{key}", "missing")
    if not isinstance(parent[key], dict):
        raise InputError(f"{prefix}{key}", f"a section with keys is expected, got {show(parent[key])}")
    return parent[key]


def _choose(registry: Mapping[str, Any], section: dict[str, Any], path: str, what: str) -> str:
    """The name under the last key of `path`, which must be one of a registry."""
    key = path.rpartition(".")[2]
    if key not in section:
        raise InputError(path, f"missing: name a {what}: {', '.join(registry)}")
    name = section[key]
    if not isinstance(name, str) or name not in registry:
        raise InputError(path, f"{show(name)} is not a {what}" + suggestion(name, registry))
    return name
