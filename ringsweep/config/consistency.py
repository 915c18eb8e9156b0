"""Check that the values of a scene do not contradict each other in any cell of a sweep."""

from __future__ import annotations

import math

import numpy as np

from ringsweep.config.axes import Axes, by_law
from ringsweep.errors import InputError
from ringsweep.models import MODELS, batch
from ringsweep.models.scene import LAW, Scene, Structure

# Cells that are checked at once: many zones over many points must not fill the memory.
_CELLS_AT_ONCE = 4096


def check_consistency(scene: Scene, axes: Axes) -> None:
    """Let the model look for contradictions between values, in all cells of a sweep.

    Raises
    ------
    InputError
        If values contradict each other, such as a ring too small for its body; or if a section is asked for at each
        period, and no cell has one.
    """
    # Each condition is monotone in each value, so the two extremes of a grid axis decide for the whole axis.
    checked = []
    for dim, size in axes.sizes.items():
        along = [values for dims, values in axes.columns.values() if dim in dims]
        monotone = len(along) == 1 and along[0].ndim == 1 and along[0].dtype.kind == "f"
        checked.append(np.unique([along[0].argmin(), along[0].argmax()]) if monotone else np.arange(size))
    shape = (1, *map(len, checked))
    total = math.prod(shape)
    section, periodic, able = scene.structure.section, False, MODELS[scene.structure.model].sections
    # Without a section at turns, a motion without a period has no cycles.
    needed = section.at == "period" if section is not None else scene.structure.exponent and "turn" not in able
    for start in range(0, total, _CELLS_AT_ONCE):
        flat = np.arange(start, min(start + _CELLS_AT_ONCE, total))
        numbers = np.unravel_index(flat, shape)[1:]
        indices = {dim: along[number] for dim, along, number in zip(axes.sizes, checked, numbers, strict=True)}
        for structure, _, values in by_law(scene, axes, indices, len(flat)):
            try:
                made = batch(structure, values)
            except InputError as error:
                if _comes_from_sweep(structure, scene, axes, error):
                    error.problem += " (in a cell of the sweep)"
                raise
            if needed and not periodic:
                periodic = bool(np.isfinite(made.forcing_period).any())
    if needed and not periodic:
        others = "give one, or state it by `period`" + (", or take `turn`" if "turn" in able else "")
        where = "record.section.at" if section is not None else "record.exponent"
        raise InputError(where, f"neither force nor drive has a period: {others}")


def _comes_from_sweep(structure: Structure, scene: Scene, axes: Axes, error: InputError) -> bool:
    """Whether a contradiction comes from swept values.

    It does not if the scene alone has the same contradiction. Values that only the sweep gives are tried at their least
    and at their greatest.
    """
    if error.path.removeprefix("scene.") in axes.columns:
        return True
    for extreme in (np.min, np.max):
        swept = {path: extreme(column) for path, (_, column) in axes.columns.items() if path != LAW}
        try:
            batch(structure, {path: np.array([value]) for path, value in {**swept, **scene.values}.items()})
        except InputError as without_sweep:
            if str(without_sweep) == str(error):
                continue
        return True
    return False
