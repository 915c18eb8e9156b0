"""The key ``initial.from``: a run that starts from the state in which the run of a file ended."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from ringsweep.config.axes import Axes
from ringsweep.config.neighbours import check_continues
from ringsweep.config.yaml_text import Document, is_result
from ringsweep.errors import InputError
from ringsweep.models import model_of
from ringsweep.models.model import Continues
from ringsweep.models.scene import LAW, Scene
from ringsweep.quantities import trailer
from ringsweep.quantities.flags import FAILED, JAMMED, REGIMES, SEPARATING
from ringsweep.quantities.units import show


def run_to_continue(doc: Document) -> str | None:
    """Path of the result file that ``initial.from`` names, which is taken out of the tree.

    Raises
    ------
    InputError
        If it is not the name of a result file, or values stand beside it that the file gives.
    """
    scene = doc.tree.get("scene")
    initial = scene.get("initial") if isinstance(scene, dict) else None
    if not isinstance(initial, dict) or "from" not in initial:
        return None
    name = initial.pop("from")
    if not isinstance(name, str):
        raise InputError("scene.initial.from", f"the name of a result file is expected, got {show(name)}")
    for key in initial:
        raise InputError(f"scene.initial.{key}", "cannot stand beside initial.from, which gives it: leave one out")
    # A configuration could name another file in turn, without end. A result holds the values.
    if not is_result(file := doc.folder / name):
        raise InputError("scene.initial.from", f"{file} is no result file: `ringsweep run` or `simulate` writes one")
    return str(file)


def put_state(doc: Document, scene: Scene, file: str, before: Scene, axes: Axes, swept: Any) -> None:
    """Put the state at the end of the run in a file into the tree, as initial values.

    Parameters
    ----------
    doc : Document
    scene : Scene
        Its scene without these values.
    file : str
        Path of the file.
    before, axes : Scene and Axes
        Those of the file.
    swept : collection of str
        Paths that the sweep varies.

    Raises
    ------
    InputError
        If the file does not hold one run of the same model that reached its end, or gives a value that is swept.
    """
    where = "scene.initial.from"
    if before.structure.model != scene.structure.model:
        raise InputError(where, f"{file} holds a run of model {before.structure.model}")
    for structure in (*scene.structures.values(), *before.structures.values()):
        check_continues(structure, where)
    model = model_of(scene.structure)
    assert isinstance(model, Continues)
    ended = {path: np.full(1, value) for path, value in before.values.items()} | _end_of(file, model)
    ended |= {path: column.ravel()[:1] for path, (_, column) in axes.columns.items() if path != LAW}
    values = {path: np.full(1, scene.values.get(path, np.nan)) for path in {**scene.values, **dict.fromkeys(swept)}}
    found = model.continued(scene.structure, values, ended)
    # What is too long for the bristles of this scene is an error in its place.
    found |= {path: ended["deflection_end"] for path in found if path == "initial.deflection"}
    for path, (value,) in found.items():
        section, _, name = path.partition(".")
        given = doc.tree["scene"].get(section, {})
        if path in swept or name in given:
            raise InputError(f"scene.{path}", "cannot stand beside initial.from, which gives it: leave one out")
        doc.tree["scene"].setdefault(section, {})[name] = float(value)


# Regimes of runs that ended before their span, or at a motion that is none.
_ENDED_EARLY = {REGIMES[flag] for flag in (FAILED, SEPARATING, JAMMED)}


def _end_of(file: str, model: Continues) -> dict[str, NDArray[np.float64]]:
    """Numbers at the end of the run of a model that a file holds.

    Raises
    ------
    InputError
        If the file is damaged, or does not hold one run that reached the end of its span.
    """
    try:
        with trailer.opened(file, whole=True, what="the result of a run that can go on") as content:
            regime = content["regime"]
            flags = np.ravel(regime[:])
            if len(flags) != 1:
                raise InputError("", f"holds {len(flags)} runs: name a file of one run")
            meanings = dict(zip(regime.flag_values, regime.flag_meanings.split(), strict=True))
            if (ended := meanings.get(flags[0])) in _ENDED_EARLY:
                raise InputError("", f"its run is {ended}: it has no state that could go on")
            names = [name for name in ("t_end", *model.ends, "deflection_end") if name in content.variables]
            found = {name: np.ma.filled(content[name][:], np.nan).astype(float).ravel() for name in names}
            found.setdefault("deflection_end", np.zeros(1))
            if not all(np.isfinite(found[name]).all() for name in ("t_end", *model.ends, "deflection_end")):
                raise ValueError("a state has finite numbers")
    except InputError as error:
        raise InputError("scene.initial.from", f"{file}: {error.problem}") from None
    return found
