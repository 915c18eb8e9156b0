"""The key ``initial.from``: a run that starts from the state in which the run of a file ended."""

from __future__ import annotations

from collections.abc import Collection
from typing import Any

import numpy as np

from ringsweep.config.neighbours import check_continues
from ringsweep.config.yaml_text import Document, is_result
from ringsweep.errors import InputError
from ringsweep.models import model_of
from ringsweep.models.model import Continues
from ringsweep.models.scene import LAW, Scene
from ringsweep.quantities import trailer
from ringsweep.quantities.flags import FAILED, JAMMED, REGIMES, SEPARATING
from ringsweep.quantities.units import show
from ringsweep.quantities.variables import written

#: Path of the key.
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
    if not is_result(file := doc.folder / name):
        problem = "is no result file" if file.exists() else "does not exist"
        raise InputError(FROM, f"{file} {problem}: `ringsweep run` or `simulate` writes one")
    return str(file)


def put_state(doc: Document, scene: Scene, file: str, before: Any, swept: Collection[str]) -> None:
    """Put the state at the end of the run in a file into the tree, as initial values.

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
    ended = {path: np.full(1, value) for path, value in before.scene.values.items()} | {"deflection_end": np.zeros(1)}
    ended |= {path: column.ravel()[:1] for path, (_, column) in before.axes.columns.items() if path != LAW}
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
    _move_zones(doc, scene, ended, swept)
    values = {path: np.full(1, scene.values.get(path, np.nan)) for path in {**scene.values, **dict.fromkeys(swept)}}
    found = model.continued(scene.structure, values, ended)
    # What is too long for the bristles of this scene is an error in its place.
    found |= {path: ended["deflection_end"] for path in found if path == "initial.deflection"}
    for path, (value,) in found.items():
        section, _, name = path.partition(".")
        given = doc.tree["scene"].setdefault(section, {})
        if path in swept or name in given:
            raise InputError(f"scene.{path}", _BESIDE)
        given[name] = float(value)


def _move_zones(doc: Document, scene: Scene, ended: dict[str, Any], swept: Collection[str]) -> None:
    """Put zones that ring or belt has carried along at constant speed where they are at the end of the run in a file.

    The run that goes on counts the way of ring or belt from 0 again.
    """
    structure = scene.structure
    speed = ended.get("belt.velocity", ended.get("drive.amplitude", 0.0) if structure.drive == "constant" else 0.0)
    way = float(np.ravel(speed * ended["t_end"])[0])
    for arc in structure.arcs if structure.frame == "belt" and way != 0.0 else ():
        if f"{arc}.center" in swept:
            raise InputError(f"scene.{arc}.center", _BESIDE)
        name, _, number = arc.partition(".")
        zone = doc.tree["scene"][name]
        center = scene.values[f"{arc}.center"] + way
        zone = zone[int(number)] if number else zone
        zone["center"] = center if structure.model == "belt" else center % (2.0 * np.pi)
