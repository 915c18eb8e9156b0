"""PhaseMap (Gresch, https://github.com/greschd/PhaseMap) on a map of labels that is known."""

from __future__ import annotations

import asyncio
from typing import Any

import numpy as np
from numpy.typing import NDArray


def evaluations(labels: NDArray[Any], stride: int, halvings: int, *, all_corners: bool) -> tuple[int, int]:
    """Evaluations of PhaseMap on a map of labels, and how many cells have no evaluated or wrongly known label.

    Parameters
    ----------
    labels : ndarray of int, shape ``(n, n)``
        What a run of each cell gives.
    stride : int
        Cells between two points of its first mesh.
    halvings : int
        How often it may split a box.
    all_corners : bool
        Whether it evaluates all corners of the parts of a box; by default it evaluates only some.
    """
    import phasemap

    asyncio.set_event_loop(asyncio.new_event_loop())
    size = len(labels) - 1
    seen: set[tuple[int, int]] = set()

    def phase(at: Any) -> int:
        i, j = (min(round(float(one) * size), size) for one in at)
        seen.add((i, j))
        return int(labels[i, j])

    mesh = -(-size // stride) + 1
    found = phasemap.run(phase, [(0, 1), (0, 1)], mesh=mesh, num_steps=halvings, all_corners=all_corners)
    told = np.full(labels.shape, -1)
    for box in found.boxes:
        if isinstance(box.phase, int):
            low = [int(np.ceil(float(one) * size - 1e-9)) for one in box.corner]
            high = [
                int(np.floor(float(one + side) * size + 1e-9)) for one, side in zip(box.corner, box.size, strict=True)
            ]
            told[low[0] : high[0] + 1, low[1] : high[1] + 1] = box.phase
    for i, j in seen:
        told[i, j] = labels[i, j]
    return len(seen), int((told != labels).sum())
