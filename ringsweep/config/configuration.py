"""Configuration text to validated scene, axes and solver in SI units.

Every message about wrong input starts here, from what physics and solvers declare about their
parameters; :mod:`ringsweep.config.yaml_text` knows the lines, :mod:`ringsweep.quantities.units` the units.
"""

from __future__ import annotations

import dataclasses
import os
from collections.abc import Collection, Iterable, Iterator, Mapping
from dataclasses import dataclass
from typing import Any

from ringsweep.config import yaml_text
from ringsweep.config.axes import Axes, Entry, array, axes_of, axis, dimension, sweep_axes, sweep_section, swept_paths
from ringsweep.config.consistency import check_consistency
from ringsweep.config.scene import scene_of, sweepable
from ringsweep.config.sections import suggestion, values_of
from ringsweep.config.solver import read_solver
from ringsweep.config.yaml_text import Document, scalar
from ringsweep.errors import InputError
from ringsweep.models.scene import LAW, Scene
from ringsweep.quantities.units import show


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
    doc = yaml_text.read(config)
    with doc.placing():
        found = _config(doc)
    if doc.swept is None:
        return found
    # The very axes that were run, by dimensions that a configuration cannot name.
    given = ((path, path, dims, values) for path, (dims, values) in doc.swept.items())
    return dataclasses.replace(found, axes=axes_of(given))


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
    doc = yaml_text.read(config)
    with doc.placing():
        settled = {_set(doc, setting) for setting in settings}
        sweep = sweep_section(doc)
        doc.tree.pop("sweep", None)
        if LAW in sweep.get("grid", {}) and f"scene.{LAW}" not in settled:
            doc.tree["sweep"] = {"grid": {LAW: sweep["grid"][LAW]}}
        try:
            return _config(doc)
        except InputError as error:
            path = error.path.removeprefix("scene.")
            if path in swept_paths(sweep) and error.problem.startswith("missing"):
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
    found = scene_of(Document(yaml_text.read({"scene": scene}).tree), swept, laws)
    if not swept:
        check_consistency(found, Axes())
    return found


def _config(doc: Document) -> Config:
    tree = doc.tree
    for key in tree:
        if key not in ("scene", "solver", "sweep"):
            raise InputError(key, "unknown section" + suggestion(key, ("scene", "solver", "sweep")))
    sweep = sweep_section(doc)
    laws = [(f"sweep.{part}.{LAW}", columns[LAW]) for part, columns in sweep.items() if LAW in columns]
    scene = scene_of(doc, swept_paths(sweep), laws[0] if laws else None)
    solver = read_solver(tree.get("solver", "auto"), scene)
    axes = sweep_axes(scene, sweep)
    for path in axes.columns:
        place = f"sweep.grid.{path}" if path in sweep.get("grid", {}) else f"sweep.points.{path}"
        if place in doc.marks:
            doc.marks[f"scene.{path}"] = doc.marks[place]
    check_consistency(scene, axes)
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

    def entries() -> Iterator[Entry]:
        for path, given in axes.items():
            where = f"axes[{path!r}]"
            parameter = axis(known, path, where)
            if isinstance(given, xr.DataArray):
                yield path, where, *array(given, parameter, where)
            else:
                yield path, where, (dimension(path),), values_of(given, parameter, where)

    found = axes_of(entries())
    check_consistency(scene, found)
    return found
