"""Whether the values of a scene contradict each other, in any cell of a sweep."""

from __future__ import annotations

import math

import numpy as np

from ringsweep.config.axes import Axes
from ringsweep.errors import InputError
from ringsweep.models import batch
from ringsweep.models.scene import LAW, Scene, Structure

# Cells whose consistency is checked at once: many arcs over many points must not fill the memory.
_BLOCK = 4096


def check_consistency(scene: Scene, axes: Axes) -> None:
    """Let the model find values that contradict each other, in any cell of a sweep."""
    # Each condition is monotone in each value: of a grid axis the two extremes decide for all of it.
    picks = []
    for dim, size in axes.sizes.items():
        along = [values for dims, values in axes.columns.values() if dim in dims]
        alone = len(along) == 1 and along[0].ndim == 1 and along[0].dtype.kind == "f"
        picks.append(np.unique([along[0].argmin(), along[0].argmax()]) if alone else np.arange(size))
    shape = (1, *map(len, picks))
    total = math.prod(shape)
    for start in range(0, total, _BLOCK):
        flat = np.arange(start, min(start + _BLOCK, total))
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
