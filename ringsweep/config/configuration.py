"""Whole configurations: from text to a validated scene, axes and solver in SI units.

Physics and solvers declare their parameters; error messages are made from these declarations.
:mod:`ringsweep.config.yaml_text` knows the lines, :mod:`ringsweep.quantities.units` the units.
"""

from __future__ import annotations

import dataclasses
import os
from collections.abc import Collection, Iterable, Iterator, Mapping
from dataclasses import dataclass
from typing import Any

from ringsweep.config import yaml_text
from ringsweep.config.axes import (
    Axes,
    Column,
    build_axes,
    dimension,
    paths_of,
    read_data_array,
    sweep_axes,
    sweep_section,
    swept_parameter,
    swept_paths,
)
from ringsweep.config.consistency import check_consistency
from ringsweep.config.follow import Follow, put_state, read_follow, run_to_continue, with_direction
from ringsweep.config.refine import Refinement, read_refinement
from ringsweep.config.scene import as_named, parse_scene, sweepable, warn_of_plain_angle
from ringsweep.config.sections import read_values, suggestion, warn_once
from ringsweep.config.solver import read_solver
from ringsweep.config.uncertain import Sample, read_sample
from ringsweep.config.yaml_text import Document, scalar
from ringsweep.errors import InputError
from ringsweep.models.scene import ELSEWHERE, LAW, Scene
from ringsweep.quantities.parameters import Choice, Parameter
from ringsweep.quantities.units import is_plain, other_unit, show
from ringsweep.quantities.variables import written

#: A value to change: ``"PATH=VALUE"`` as a user types it, or path and value as a program gives them.
Setting = str | tuple[str, Any]

_SECTIONS = "scene", "solver", "record", "sweep"

_NOT_FOLLOWED = "cannot stand beside sweep.follow, by which each cell needs the one before: leave one of them out"

_NO_SECTION = "cannot stand beside record.section: {}; leave one of them out"

_NOT_REFINED = "cannot stand beside sweep.sample: a probability has no boundary, and each cell needs its own runs"


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
    refine: Refinement | None = None
    sample: Sample | None = None
    follow: Follow | None = None
    begins_from: str | None = None

    @property
    def certifies(self) -> bool:
        """Whether the solver looks for certificates; one without this option does."""
        return bool(getattr(self.solver, "certify", True))


def load(config: str | os.PathLike[str] | Mapping[str, Any], settings: Iterable[Setting] = ()) -> Config:
    """Read and validate a configuration.

    Parameters
    ----------
    config : path-like or mapping
        A YAML file, the mapping that it would hold, or a result file, which holds its configuration.
    settings : iterable of str or tuple
        Values to change, as for :func:`with_values`; none that is swept.

    Raises
    ------
    InputError
        If something in it is wrong. The message names the place, the value and what is allowed.
    """
    doc = yaml_text.read(config)
    with doc.locating_errors():
        swept = swept_paths(sweep_section(doc)) if settings else {}
        changed = _apply_settings(doc, settings)
        for path in changed:
            if path.removeprefix("scene.") in swept:
                raise InputError(path, "is swept here: --set changes values that all cells share")
        found = _validate(doc)
        if doc.result_axes is not None and doc.result_axes.keys() != found.axes.columns.keys():
            raise InputError(
                "", "is damaged, or a part of a result: its coordinates are not the axes that it was run with"
            )
    _tell_units(changed, found.scene)
    if doc.result_axes is None:
        return found
    # A configuration cannot name the dimensions that axes share; the coordinates of a result file can.
    columns = ((path, path, dims, values) for path, (dims, values) in doc.result_axes.items())
    return dataclasses.replace(found, axes=with_direction(build_axes(columns), found.follow))


def with_refine(config: Config, refine: Mapping[str, Any] | bool | None) -> Config:
    """A configuration with `refine` in the place of its ``sweep.refine``; None and True keep one that it has.

    Raises
    ------
    InputError
        If `refine` is wrong, or the sweep is no grid.
    """
    if refine is None or (refine is True and config.refine is not None):
        return config
    given = yaml_text.read({"refine": refine}).tree["refine"]
    found = read_refinement(given, config.scene, config.axes)
    sweep = {key: value for key, value in config.source.get("sweep", {}).items() if key != "refine"}
    if found is not None:
        sweep["refine"] = given
    source = config.source | ({"sweep": sweep} if sweep else {})
    return _checked(dataclasses.replace(config, refine=found, source=source))


def with_values(
    config: str | os.PathLike[str] | Mapping[str, Any],
    settings: Iterable[Setting] = (),
    solver: Mapping[str, Any] | None = None,
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
    solver : mapping, optional
        Section ``solver`` that takes the place of the configuration's.

    Raises
    ------
    InputError
        If configuration or settings are wrong, or a value is missing that only the sweep gives.
    """
    doc = yaml_text.read(config)
    if solver is not None:
        doc.tree["solver"] = yaml_text.read({"solver": solver}).tree["solver"]
        doc.locations = {path: line for path, line in doc.locations.items() if path.partition(".")[0] != "solver"}
    with doc.locating_errors():
        changed = _apply_settings(doc, settings)
        sweep = sweep_section(doc)
        doc.tree.pop("sweep", None)
        if LAW in sweep.get("grid", {}) and f"scene.{LAW}" not in changed:
            doc.tree["sweep"] = {"grid": {LAW: sweep["grid"][LAW]}}
        try:
            found = _validate(doc)
        except InputError as error:
            path = error.path.removeprefix("scene.")
            if path in swept_paths(sweep) and error.problem.startswith("missing"):
                error.problem = f"missing: it is swept here, and one run needs one value: --set {path}=VALUE"
            raise
    _tell_units(changed, found.scene)
    return found


def read_scene(scene: Mapping[str, Any], swept: Collection[str] = (), record: Mapping[str, Any] | None = None) -> Scene:
    """Read and validate the mappings under ``scene`` and ``record`` in a configuration.

    Parameters
    ----------
    scene : mapping
    swept : collection of str, or mapping of str to sequence
        Paths that a sweep will fill. Their values may be missing, and :func:`read_axes` looks for contradictions
        between values. If friction laws are swept, `swept` must be a mapping that names them.
    record : mapping, optional

    Raises
    ------
    InputError
        If something in it is wrong, or it is a whole configuration.
    """
    if isinstance(scene, Mapping) and "scene" in scene:
        raise InputError("scene", "this is a whole configuration: pass config['scene']")
    laws = (f"axes[{LAW!r}]", swept[LAW]) if isinstance(swept, Mapping) and LAW in swept else None
    given = {"scene": scene} | ({"record": record} if record is not None else {})
    found = parse_scene(Document(yaml_text.read(given).tree), swept, laws)
    if not swept:
        check_consistency(found, Axes())
    return found


def _validate(doc: Document) -> Config:
    tree = doc.tree
    for key in tree:
        if key not in _SECTIONS:
            # A scene alone has a model; a configuration has it within the scene.
            hint = ": it belongs under `scene`" if "model" in tree else suggestion(key, _SECTIONS)
            raise InputError(key, "unknown section" + hint)
    sweep = sweep_section(doc)
    swept = swept_paths(sweep)
    laws = next(((f"sweep.{kind}.{LAW}", columns[LAW]) for kind, columns in sweep.items() if LAW in columns), None)
    if (file := run_to_continue(doc)) is not None:
        try:
            before = load(file)
        except InputError as error:
            raise InputError("scene.initial.from", f"{file}: {error.problem}") from None
        put_state(doc, parse_scene(doc, swept, laws), file, before.scene, before.axes, swept)
    scene = parse_scene(doc, swept, laws)
    solver = read_solver(tree.get("solver", "auto"), scene)
    axes = sweep_axes(scene, sweep)
    if doc.result_axes is None and doc.locations:
        _warn_of_plain_angles(scene, {**sweep.get("points", {}), **sweep.get("grid", {})})
    for path, where in swept.items():
        if where in doc.locations:
            doc.locations[f"scene.{path}"] = doc.locations[where]
    if (sample := read_sample(sweep.get("sample"), scene, axes)) is None:
        check_consistency(scene, axes)
    return assembled(Config(scene, solver, axes, tree, doc.name, sample=sample, begins_from=file))


def assembled(config: Config) -> Config:
    """A configuration with what its source says under ``sweep.refine`` and ``sweep.follow``."""
    scene, axes, sweep = config.scene, config.axes, config.source.get("sweep", {})
    refine, follow = read_refinement(sweep.get("refine"), scene, axes), read_follow(sweep.get("follow"), scene, axes)
    return _checked(dataclasses.replace(config, axes=with_direction(axes, follow), refine=refine, follow=follow))


def _checked(config: Config) -> Config:
    """A configuration, unless two parts of its sweep, or a part and a section, exclude each other."""
    if config.refine is not None and config.sample is not None:
        raise InputError("sweep.refine", _NOT_REFINED)
    lacks = {"refine": "cells that are inferred have no points", "sample": "a probability has no points"}
    for key in [key for key in lacks if getattr(config, key) is not None]:
        if config.scene.structure.section is not None:
            raise InputError(f"sweep.{key}", _NO_SECTION.format(lacks[key]))
        if config.follow is not None:
            raise InputError(f"sweep.{key}", _NOT_FOLLOWED)
    return config


def _warn_of_plain_angles(scene: Scene, columns: Mapping[str, Any]) -> None:
    """Warn of angles of many turns among the axes that a file gives. Axes that a program gives are in SI units."""
    known = sweepable(scene)
    for key, given in columns.items():
        # Of linspace and geomspace, first and last.
        ends = next(iter(given.values()))[:2] if isinstance(given, dict) else given
        for path in paths_of(key):
            for value in ends:
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
        full, before = _apply_setting(doc, path, value)
        before, _ = changed.get(full, (before, None))
        changed[full] = before if isinstance(setting, str) else None, value
    return changed


def _tell_units(changed: Mapping[str, tuple[Any, Any]], scene: Scene) -> None:
    """Say in which unit a number is taken that a user has put in the place of one with another unit."""
    known = sweepable(scene)
    for full, (before, value) in changed.items():
        path = full.removeprefix("scene.")
        if path in known:
            tell_unit("--set", f"{path}={{}}", value, before, known[path])


def tell_unit(option: str, form: str, value: Any, before: Any, parameter: Parameter | Choice) -> None:
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
        given, cure = form.format(value), form.format(f"{value} {unit}")
        warn_once(
            '%s %s is taken as %s, where the configuration says %s; was `%s "%s"` meant?',
            *(option, given, taken, show(before), option, cure),
        )


def as_written(config: Config, path: str) -> Any:
    """A number as a configuration gives it, with its unit: in the scene, or else first on its axis; or None."""
    node, sweep = written(config.source, path), config.source.get("sweep", {})
    for columns in (sweep.get("grid", {}), sweep.get("points", {})):
        node = columns.get(path) if node is None else node
    while node and isinstance(node, dict | list):
        node = next(iter(node.values())) if isinstance(node, dict) else node[0]
    return node


def _apply_setting(doc: Document, path: str, value: Any) -> tuple[str, Any]:
    """Put a value into the tree; its full path and what stood there. The path is checked later, with the tree."""
    told = f"--set {path}={value}", None
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
        node = _child(node, key, full)
    if not isinstance(node, dict | list):
        raise InputError(full, f"cannot be set: {'.'.join(parents)} is {show(node)}")
    before = node.get(last) if isinstance(node, dict) else _child(node, last, full)
    place: Any = last if isinstance(node, dict) else int(last)
    node[place] = value
    doc.locations[full] = told
    return full, before


def _child(node: Any, key: str, full: str) -> Any:
    if isinstance(node, dict):
        return node[key]
    if isinstance(node, list) and key.isdecimal() and len(key) < 10 and int(key) < len(node):
        return node[int(key)]
    raise InputError(full, f"cannot be set: there is no `{key}` on this path")


def read_axes(scene: Scene, axes: Mapping[str, Any]) -> Axes:
    """Read and validate the axes of a sweep given in Python.

    Parameters
    ----------
    scene : Scene
    axes : mapping of str to sequence or DataArray
        A sequence of shape ``(n,)`` makes a dimension for its path. A DataArray brings its dimensions, which it shares
        with other DataArrays, and its ``units``.

    Raises
    ------
    InputError
        If a path or value is wrong, or values contradict each other in some cell.
    """
    # xarray is slow to import; an error in a configuration should not wait for it.
    import xarray as xr

    if not isinstance(axes, Mapping):
        raise InputError("axes", f"a mapping of paths to values is expected, got {show(axes)}")
    known = sweepable(scene)

    def columns() -> Iterator[Column]:
        for path, given in axes.items():
            where = f"axes[{path!r}]"
            parameter = swept_parameter(known, path, where)
            if isinstance(given, xr.DataArray):
                yield path, where, *read_data_array(given, parameter, where)
            else:
                yield path, where, (dimension(path),), read_values(given, parameter, where)

    found = build_axes(columns())
    check_consistency(scene, found)
    return found
