"""Whole configurations: from text to a validated scene, axes and solver in SI units.

Physics and solvers declare their parameters; error messages are made from these declarations.
:mod:`ringsweep.config.reading` knows the lines, :mod:`ringsweep.quantities.units` the units.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import Any

from ringsweep.config import options
from ringsweep.config.axes import Axes, Given, build_axes, check_consistency, columns_of, sweep_section, swept_paths
from ringsweep.config.reading import Document, Source, read, scalar, suggestion, warn_once
from ringsweep.config.scene import as_named, parse_scene, sweepable, warn_of_plain_angle
from ringsweep.config.uncertain import Sample, read_sample
from ringsweep.errors import InputError
from ringsweep.models.scene import ELSEWHERE, LAW, WAYS, Scene
from ringsweep.physics.friction.registry import SURFACE
from ringsweep.quantities.parameters import Key, Parameter
from ringsweep.quantities.units import is_plain, other_unit, show
from ringsweep.quantities.variables import written

#: A value to change: ``"PATH=VALUE"`` as a user types it, or path and value as a program gives them.
Setting = str | tuple[str, Any]

# What keeps parts of a configuration from standing beside others.
_NEEDS = {
    "sweep.sample": "which needs runs of its own for each cell",
    "sweep.follow": "which needs the cell before for each cell",
    "record.section": "which needs a run for each cell",
}

_SECTIONS = "scene", "solver", "record", "sweep"


@dataclass(frozen=True)
class Config:
    """A validated configuration.

    Attributes
    ----------
    scene : Scene
        It may lack values that the sweep gives.
    solver : Method
        A method with its options.
    axes : Axes
        Without dimensions if nothing is swept.
    source : dict
        The configuration as plain values, with units as typed and the contents of its CSV files. It is enough to run
        the configuration again.
    name : str
        Name of its file without suffix.
    refine : Refinement, optional
        How the grid is refined; None if every cell is computed.
    sample : Sample, optional
        Uncertain parameters, which vary within each cell of the axes; None if there are none.
    follow : Follow, optional
        Axis along which each cell starts from the end of the one before; None if all start from ``initial``.
    begins_from : str, optional
        File that ``initial.from`` names.
    """

    scene: Scene
    solver: Any
    axes: Axes
    source: dict[str, Any]
    name: str
    refine: options.Refinement | None = None
    sample: Sample | None = None
    follow: options.Follow | None = None
    begins_from: str | None = None

    @property
    def certifies(self) -> bool:
        """Whether the solver looks for certificates; one without this option does."""
        return bool(getattr(self.solver, "certify", True))


def load(
    config: Source, settings: Iterable[Setting] = (), *, axes: Mapping[str, Any] | None = None, **parts: Any
) -> Config:
    """Read and validate a configuration.

    Parameters
    ----------
    config : path-like or mapping
        A YAML file, the mapping that it would hold, or a result file, which holds its configuration.
    settings : iterable of str or tuple
        Values to change, as for :func:`with_values`; none that is swept.
    axes : mapping of str to sequence or DataArray, optional
        Axes that take the place of the section ``sweep``. A sequence of shape ``(n,)`` makes a dimension for its path.
        A DataArray brings its dimensions, which it shares with other DataArrays, and its ``units``.
    **parts
        What takes the place of ``solver``, ``record``, ``sweep.refine`` or ``sweep.follow``. None keeps what is there,
        and so does True.

    Raises
    ------
    InputError
        If something in it is wrong. The message names the place, the value and what is allowed.
    """
    doc = _document(config, parts, axes)
    with doc.locating_errors():
        return _validate(doc, _apply_settings(doc, settings))


def with_values(
    config: Source, settings: Iterable[Setting] = (), solver: str | Mapping[str, Any] | None = None
) -> Config:
    """Configuration of a single run: without axes, and with some values changed.

    If the grid has an axis of friction laws and no setting names a law, that axis stays: there is a run under each law.

    Parameters
    ----------
    config : path-like or mapping
        As for :func:`load`. Its other axes are ignored.
    settings : iterable of str or tuple
        ``"PATH=VALUE"`` with a path in the scene (``drive.amplitude=3``) or in the solver (``solver.steps=100``), as a
        user types it: a number without unit in the place of ``60 deg`` is taken in SI units, with a warning. A program
        gives path and value as a tuple, without a warning.
    solver : str or mapping, optional
        Section ``solver`` that takes the place of the configuration's.

    Raises
    ------
    InputError
        If configuration or settings are wrong, or a value is missing that only the sweep gives.
    """
    doc = _document(config, {"solver": solver})
    with doc.locating_errors():
        changed = _apply_settings(doc, settings)
        sweep = sweep_section(doc)
        doc.tree.pop("sweep", None)
        doc.columns = None
        if LAW in sweep.get("grid", {}) and f"scene.{LAW}" not in changed:
            doc.tree["sweep"] = {"grid": {LAW: sweep["grid"][LAW]}}
        try:
            return _validate(doc, changed)
        except InputError as error:
            path = error.path.removeprefix("scene.")
            if path in swept_paths(sweep) and error.problem.startswith("missing"):
                error.problem = f"missing: it is swept here, and one run needs one value: --set {path}=VALUE"
            raise


def _document(config: Source, parts: Mapping[str, Any], axes: Mapping[str, Any] | None = None) -> Document:
    """A configuration in which a program has put axes and other parts in the place of its own; see :func:`load`."""
    doc = read(config)
    if axes is not None:
        if not isinstance(axes, Mapping):
            raise InputError("axes", f"a mapping of paths to values is expected, got {show(axes)}")
        doc.tree["sweep"], doc.is_result = {}, False
        doc.columns = [(path, f"axes[{path!r}]", path, given) for path, given in axes.items()]
        doc.locations |= dict.fromkeys((where for _, where, *_ in doc.columns), (None, None))
    for key, given in parts.items():
        place, section = (key, doc.tree) if key in _SECTIONS else (f"sweep.{key}", doc.tree.get("sweep", {}))
        if given is None or not isinstance(section, dict) or (given is True and section.get(key)):
            continue
        if section is not doc.tree:
            doc.tree["sweep"] = section
        section[key] = doc.plain(given, place)
        doc.locations = {path: line for path, line in doc.locations.items() if not f"{path}.".startswith(f"{place}.")}
        # No line of the file is at fault for what a program gives.
        doc.locations[place] = None, None
    return doc


def _validate(doc: Document, changed: Mapping[str, tuple[Any, Any]]) -> Config:
    """The configuration of a document, in which a user has changed some values."""
    tree = doc.tree
    for key in tree:
        if key not in _SECTIONS:
            # A scene alone has a model; a configuration has it within the scene.
            hint = ": it belongs under `scene`" if "model" in tree else suggestion(key, _SECTIONS)
            raise InputError(key, "unknown section" + hint)
    sweep = sweep_section(doc)
    listed = columns_of(sweep)
    columns = listed if doc.columns is None else doc.columns
    if doc.is_result and {path for path, *_ in listed} != {path for path, *_ in columns}:
        raise InputError("", "is damaged, or a part of a result: its coordinates are not the axes that it was run with")
    swept = swept_paths(sweep, columns)
    for path in changed:
        if path.removeprefix("scene.") in swept:
            raise InputError(path, "is swept here: --set changes values that all cells share")
    laws = next(((where, given) for path, where, _, given in columns if path == LAW), None)
    if (file := options.run_to_continue(doc)) is not None:
        try:
            state = options.state_after(doc, parse_scene(doc, swept, laws), file, load(file), swept)
        except InputError as error:
            if file not in (error.file, error.path):
                raise
            raise InputError(options.FROM, f"{file}: {error.problem}") from None
        for path, number in state.items():
            _put(doc, f"scene.{path}", number, doc.locations.get(options.FROM, (None, None)))
    scene = parse_scene(doc, swept, laws)
    solver = options.read_solver(tree.get("solver", "auto"), scene)
    axes = build_axes(scene, columns)
    for path, where in swept.items():
        if where in doc.locations:
            doc.locations[f"scene.{path}"] = doc.locations[where]
    if (sample := read_sample(sweep.get("sample"), scene, axes)) is None:
        check_consistency(scene, axes)
    given = tree.get("sweep", {})
    refine = options.read_refinement(given.get("refine"), axes)
    follow = options.read_follow(given.get("follow"), scene, axes)
    # A section stands beside all but cells that are inferred, and probabilities.
    section = None if refine is None and sample is None else scene.structure.section
    parts = {"sweep.refine": refine, "sweep.sample": sample, "sweep.follow": follow, "record.section": section}
    excluding = [path for path, part in parts.items() if part is not None]
    if len(excluding) > 1:
        problem = f"cannot stand beside {excluding[1]}, {_NEEDS[excluding[1]]}; leave one of them out"
        raise InputError(excluding[0], problem)
    # Axes that a program gives are in SI units.
    _warn_of_units(scene, changed, columns if doc.columns is None and doc.locations else ())
    if follow is not None and follow.direction == "both":
        axes = Axes({**axes.sizes, options.DIRECTION: len(options.BOTH)}, axes.columns)
    return Config(scene, solver, axes, tree, doc.file.stem, refine, sample, follow, begins_from=file)


def _warn_of_units(scene: Scene, changed: Mapping[str, tuple[Any, Any]], columns: Iterable[Given]) -> None:
    """Say where a unit may be missing: in what a user has changed, and in angles of many turns on an axis."""
    known = sweepable(scene)
    for full, (before, value) in changed.items():
        if (path := full.removeprefix("scene.")) in known:
            tell_unit("--set", f"{path}={{}}", value, before, known[path])
    for path, _, _, given in columns:
        # Of linspace and geomspace, first and last.
        for value in next(iter(given.values()))[:2] if isinstance(given, dict) else given:
            warn_of_plain_angle(path, value, known[path])


def _apply_settings(doc: Document, settings: Iterable[Setting]) -> dict[str, tuple[Any, Any]]:
    """Put settings into the tree; what each has replaced and put there by its full path.

    What a program has put there replaces nothing that a user should be told of.
    """
    changed: dict[str, tuple[Any, Any]] = {}
    for setting in settings:
        if isinstance(setting, str):
            path, equals, text = (part.strip() for part in setting.partition("="))
            if not equals or not path:
                raise InputError("--set", f"{show(setting)} is not of the form PATH=VALUE")
            value = scalar(text)
        else:
            path, value = setting
        full, before = _put(doc, path, value, (f"--set {path}={value}", None))
        before, _ = changed.get(full, (before, None))
        changed[full] = before if isinstance(setting, str) else None, value
    return changed


def tell_unit(option: str, form: str, value: Any, before: Any, parameter: Parameter | Key) -> None:
    """Say in which unit a number without unit is taken, if the configuration writes this number in another unit.

    Parameters
    ----------
    option, form : str
        Option of the command line, and the form of what follows it, such as ``"drive.amplitude={}"``.
    value, before : object
        The number as it was typed, and what the configuration says.
    parameter : Parameter
    """
    # Zero is zero in every unit.
    if not isinstance(parameter, Parameter) or not is_plain(value) or float(value) == 0.0:
        return
    if unit := other_unit(before, parameter):
        taken = f"{value} {parameter.unit}" if parameter.unit != "1" else f"{value}, without unit"
        cure = f'{option} "{form.format(f"{value} {unit}")}"'
        said = f"is taken as {taken}, where the configuration says {show(before)}; was `{cure}` meant?"
        warn_once(f"{option} {form.format(value)} {said}")


def _put(doc: Document, path: str, value: Any, told: tuple[str | None, int | None]) -> tuple[str, Any]:
    """Put a value into the tree; its full path and what stood there. The path is checked later, with the tree.

    `told` is what errors name as its place.
    """
    full = path if path.split(".")[0] in ("scene", "solver", "record") else f"scene.{path}"
    for name in ELSEWHERE:
        if name in (written(doc.tree, "friction") or ()):
            full = as_named(full, name)
    *parents, last = full.split(".")
    node: Any = doc.tree
    for depth, key in enumerate(parents, start=1):
        if isinstance(node, dict) and key not in node:
            node[key] = {}
            doc.locations[".".join(parents[:depth])] = told
        section, node = node, node[_place(node, key, full)]
    if last in WAYS and parents[-1] in SURFACE and not isinstance(node, dict):
        # A number that stands for both directions of sliding.
        node = section[parents[-1]] = dict.fromkeys(WAYS, node)
    place = _place(node, last, full)
    before = node.get(last) if isinstance(node, dict) else node[place]
    node[place] = value
    doc.locations[full] = told
    return full, before


def _place(node: Any, key: str, full: str) -> Any:
    """What a key of a path stands for in a section or a list."""
    if isinstance(node, dict):
        return key
    if isinstance(node, list) and key.isdecimal() and len(key) < 10 and int(key) < len(node):
        return int(key)
    stands = "" if isinstance(node, list) else f": {show(node)} stands in place of a section: write one there"
    raise InputError(full, f"cannot be set: there is no `{key}` on this path{stands}")
