"""How cells are computed: the section ``solver``, and runs that depend on others.

A run is inferred from neighbours (``refine``), or starts where another one ended. That is the cell before in a sweep
(``follow``), or the run of a file (``initial.from``).
"""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass
from typing import Annotated, Any

import numpy as np
from numpy.typing import NDArray

from ringsweep.config.axes import Axes, dimension, values_at
from ringsweep.config.reading import Document, choose, is_result, read_keys, section_of, suggestion
from ringsweep.errors import InputError
from ringsweep.models import MODELS, model_of
from ringsweep.models.model import Continues
from ringsweep.models.scene import LAW, Scene, Structure
from ringsweep.physics.friction import TRAITS
from ringsweep.quantities import trailer
from ringsweep.quantities.flags import FAILED, JAMMED, REGIMES, SEPARATING
from ringsweep.quantities.parameters import Key, Parameter
from ringsweep.quantities.units import show
from ringsweep.quantities.variables import written
from ringsweep.solvers import METHODS


def read_solver(solver: Any, scene: Scene) -> Any:
    """A method with its options, from its name or from the mapping under ``solver`` in a configuration.

    Parameters
    ----------
    solver : str or mapping
    scene : Scene
        What the method must be able to take.

    Raises
    ------
    InputError
        If the method or an option is wrong, or if the method cannot run the scene.
    """
    section = {"method": solver} if isinstance(solver, str) else section_of({"solver": solver}, "solver", "")
    method: Any = METHODS[choose(METHODS, section, "solver.method", "method")]
    given = {key: value for key, value in section.items() if key != "method"}
    found = method(**read_keys(given, method, "solver"))
    for structure in scene.structures.values():
        found.check(structure)
    return found


@dataclass(frozen=True)
class Refinement:
    """How a grid is refined.

    Attributes
    ----------
    axes : tuple of str
        Dimensions that are refined, one or two; along the others the map is a stack.
    stride : int
        Cells from one cell of the first round to the next.
    audit : float
        Share of the inferred cells that is computed after all.
    """

    axes: tuple[str, ...]
    stride: Annotated[int, Parameter("1", "cells from one cell of the first round to the next", 1, 1024)] = 32
    audit: Annotated[float, Parameter("1", "share of the inferred cells that is computed after all", 0, 1)] = 0.02


def read_refinement(given: Any, axes: Axes) -> Refinement | None:
    """Read and validate the value under ``sweep.refine``, or under ``refine`` in Python.

    The dimensions that are refined are the two longest, in the order of the grid.

    Parameters
    ----------
    given : mapping or bool or None
        True stands for the defaults.
    axes : Axes

    Raises
    ------
    InputError
        If a key or value is wrong, or the sweep is no grid.
    """
    if given is None or given is False:
        return None
    section = read_keys({} if given is True else given, Refinement, "sweep.refine")
    for path, (dims, _) in axes.columns.items():
        if dims != (dimension(path),):
            problem = f"varies along {' x '.join(dims)}, but only a grid can be refined: a point has no neighbours"
            raise InputError("sweep.refine", f"{path} {problem}")
    known = {path: values for path, (_, values) in axes.columns.items() if values.dtype.kind == "f" and len(values) > 1}
    if not known:
        raise InputError("sweep.refine", "the sweep has no grid axis of two or more numbers: nothing can be refined")
    longest = sorted(known, key=lambda path: -len(known[path]))[:2]
    for path in longest:
        steps = np.diff(known[path])
        if not ((steps > 0).all() or (steps < 0).all()):
            problem = "values go up and down: along an axis that is refined they must ascend or descend"
            raise InputError(f"sweep.grid.{path}", problem)
    return Refinement(tuple(dimension(path) for path in known if path in longest), **section)


#: Dimension of a sweep that follows its axis in both directions, and its values.
DIRECTION, BOTH = "direction", ("up", "down")

#: Values of ``sweep.follow.direction``.
DIRECTIONS = {
    "up": "from the least value to the greatest",
    "down": "from the greatest value to the least",
    "both": "up and down, along the dimension direction",
}


@dataclass(frozen=True)
class Follow:
    """Axis along which each cell starts from the state in which the one before ended.

    Attributes
    ----------
    axis : str
        Its path.
    direction : str
        ``up``, ``down`` or ``both``.
    """

    axis: Annotated[str, Key("a path that the sweep varies", example="force.frequency")]
    direction: Annotated[str, Key("direction", DIRECTIONS)] = "up"

    def chains(self, axes: Axes) -> tuple[str, NDArray[np.intp]]:
        """Dimension that is followed, and indices along it in their order, shape ``(directions, cells of a chain)``."""
        (dim,), values = axes.columns[self.axis]
        up = np.argsort(values, kind="stable")
        ways = BOTH if self.direction == "both" else (self.direction,)
        return dim, np.stack([up if way == "up" else up[::-1] for way in ways])


def read_follow(given: Any, scene: Scene, axes: Axes) -> Follow | None:
    """Read and validate the value under ``sweep.follow``.

    Raises
    ------
    InputError
        If it names no axis of the sweep, has an unknown key or a wrong value, or if runs of the scene cannot go on.
    """
    if given is None:
        return None
    section = read_keys(given if isinstance(given, dict) else {"axis": given}, Follow, "sweep.follow")
    where = "sweep.follow.axis" if isinstance(given, dict) else "sweep.follow"
    path = section["axis"]
    numeric = [name for name in axes.columns if name != LAW]
    if not isinstance(path, str) or path not in numeric:
        raise InputError(where, f"the sweep varies no number {show(path)}" + suggestion(path, numeric))
    dims, _ = axes.columns[path]
    if len(dims) > 1:
        raise InputError(where, f"{path} varies along {' and '.join(dims)}: follow a path with one dimension")
    replaced = [f"initial.{name}" for name in ("x", "velocity", "deflection", "contact_age", "phi", "omega")]
    for other, (along, _) in axes.columns.items():
        if dims[0] in along and other in (LAW, *replaced, "force.phase", "drive.phase"):
            what = "a chain has one law" if other == LAW else "the cell before gives it"
            raise InputError(where, f"{other} varies along {dims[0]} too, but {what}")
    if DIRECTION in axes.sizes:
        raise InputError(where, f"the dimension {DIRECTION} of the sweep has the name of that of a followed one")
    for structure in scene.structures.values():
        check_continues(structure, where)
    return Follow(**section)


def check_continues(structure: Structure, where: str) -> None:
    """Raise an error, located at `where`, unless runs of a scene can start from the end of another one."""
    model = model_of(structure)
    if not isinstance(model, Continues):
        able = ", ".join(name for name, model in MODELS.items() if isinstance(model, Continues))
        raise InputError(where, f"a run of model {structure.model} cannot go on from another one: model {able} can")
    if (problem := model.obstacle(structure)) is not None:
        raise InputError(where, problem)
    if TRAITS[structure.law_type].snaps:
        problem = f"the state of friction law {structure.law} is more than a deflection: choose another law"
        raise InputError(where, problem)
    # Other drives are not the same at all times, nor can a scene have their phase.
    if structure.own_drive is not None or structure.drive not in ("none", "constant", "sinusoidal"):
        raise InputError(where, f"drive law {structure.drive} has no phase to go on from: sinusoidal has one")
    if structure.own_force is not None or structure.force is not None:
        raise InputError(where, "a force by a table or a formula has no phase to go on from: one with a frequency has")
    if structure.own_load is not None or structure.load is not None:
        raise InputError(where, "a load that varies in time has no phase to go on from: leave body.load out")


#: Path of the key ``initial.from``.
FROM = "scene.initial.from"

_BESIDE = "cannot stand beside initial.from, which gives it: leave one out"


def run_to_continue(doc: Document) -> str | None:
    """Path of the result file that ``initial.from`` names, which is taken out of the tree.

    Raises
    ------
    InputError
        If it is not the name of a result file, or values stand beside it that the file gives.
    """
    initial = written(doc.tree, "initial")
    if not isinstance(initial, dict) or "from" not in initial:
        return None
    name = initial.pop("from")
    if not isinstance(name, str):
        raise InputError(FROM, f"the name of a result file is expected, got {show(name)}")
    for key in initial:
        raise InputError(f"scene.initial.{key}", _BESIDE)
    # A configuration could name another file in turn, without end. A result holds the values.
    if not is_result(file := doc.file.parent / name):
        problem = "is no result file" if file.exists() else "does not exist"
        raise InputError(FROM, f"{file} {problem}: `ringsweep run` or `simulate` writes one")
    return str(file)


def state_after(doc: Document, scene: Scene, file: str, before: Any, swept: Collection[str]) -> dict[str, float]:
    """Values of a scene that starts from the end of the run in a file, by path.

    Parameters
    ----------
    doc : Document
    scene : Scene
        Its scene without these values.
    file : str
        Path of the file.
    before : Config
        That of the file.
    swept : collection of str
        Paths that the sweep varies.

    Raises
    ------
    InputError
        If the file is damaged, does not hold one run of the same model that reached its end, or gives a value that is
        swept.
    """
    model = model_of(scene.structure)
    if before.scene.structure.model != scene.structure.model:
        raise InputError(FROM, f"{file} holds a run of model {before.scene.structure.model}")
    for structure in (*scene.structures.values(), *before.scene.structures.values()):
        check_continues(structure, FROM)
    assert isinstance(model, Continues)
    first = dict.fromkeys(before.axes.sizes, np.zeros(1, np.intp))
    ended = values_at(before.scene, before.axes, first, 1) | {"deflection_end": np.zeros(1)}
    with trailer.opened(file, whole=True, what="the result of a run that can go on") as content:
        flag, *others = content["regime"][:].ravel().tolist()
        if others:
            raise InputError("", f"holds {1 + len(others)} runs: name a file of one run")
        # Runs that ended before their span, or at a motion that is none.
        if flag in (FAILED, SEPARATING, JAMMED):
            raise InputError("", f"its run is {REGIMES[flag]}: it has no state that could go on")
        names = ("t_end", *model.ends, *({"deflection_end", "contact_age_end"} & content.variables.keys()))
        ended |= {name: np.ma.filled(content[name][:], np.nan).astype(float).ravel() for name in names}
        if not all(np.isfinite(ended[name]).all() for name in names):
            raise ValueError("a state has finite numbers")
    values = {path: np.full(1, scene.values.get(path, np.nan)) for path in {**scene.values, **dict.fromkeys(swept)}}
    found = model.continued(scene.structure, values, ended)
    # What is too long for the bristles of this scene is an error in its place.
    found |= {path: ended["deflection_end"] for path in found if path == "initial.deflection"}
    given = {path for path in found if written(doc.tree, path) is not None}
    found |= _moved_zones(scene, ended)
    for path in found:
        if path in swept or path in given:
            raise InputError(f"scene.{path}", _BESIDE)
    return {path: float(value) for path, (value,) in found.items()}


def _moved_zones(scene: Scene, ended: dict[str, Any]) -> dict[str, Any]:
    """Centers of zones that ring or belt has carried along at constant speed, at the end of the run in a file.

    The run that goes on counts the way of ring or belt from 0 again.
    """
    structure = scene.structure
    speed = ended.get("belt.velocity", ended.get("drive.amplitude", 0.0) if structure.drive == "constant" else 0.0)
    way = np.ravel(speed * ended["t_end"])[:1]
    moved = structure.arcs if structure.frame == "belt" and way != 0.0 else ()
    centers = {f"{arc}.center": scene.values[f"{arc}.center"] + way for arc in moved}
    return centers if structure.model == "belt" else {path: center % (2.0 * np.pi) for path, center in centers.items()}
