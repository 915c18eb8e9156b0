"""Warnings about the results of a sweep or of a single run."""

from __future__ import annotations

import logging

import numpy as np
import xarray as xr

from ringsweep.config import Config
from ringsweep.quantities.variables import INFERRED
from ringsweep.solvers.rk4 import STABILITY_LIMIT
from ringsweep.storage.chunks import Layout

logger = logging.getLogger("ringsweep")


def warn_of_results(results: xr.Dataset, config: Config) -> None:
    """Warn if steps of rk4 exceed its limit of stability, and if most runs end at t = 0.

    Parameters
    ----------
    results : xarray.Dataset
        Outcomes of all cells, in memory or on disk. They are read chunk by chunk.
    config : Config
        Configuration of the runs.
    """
    ended = results["t_end"].variable
    stiffness = results["stiffness"].variable if "stiffness" in results else None
    ended_at_start = unstable = 0
    count = ended.size
    largest = 0.0
    origin = results["origin"].variable if "origin" in results else None
    for _, _, region in Layout(ended.shape).chunks():
        inferred = np.zeros((), dtype=bool) if origin is None else origin[region].values == INFERRED
        count -= int(np.count_nonzero(inferred))
        ended_at_start += int(np.count_nonzero(ended[region].values == 0.0))
        if stiffness is not None:
            values = stiffness[region].values
            # NaN is not within the limit either.
            beyond = values[~((values <= STABILITY_LIMIT) | inferred)]
            unstable += beyond.size
            # Unlike max(), this keeps NaN.
            largest = float(np.maximum(largest, beyond.max(initial=0.0)))
    if unstable:
        if np.isfinite(largest):
            remedy = f"about {config.solver.steps * largest / STABILITY_LIMIT:.2g} steps are needed"
        else:
            remedy = "no step is small enough for a friction law that jumps"
        logger.warning(
            "%.1f %% of the cells exceed the limit of stability of rk4 (stiffness above %.4g), "
            "and their regimes may be wrong: %s; solver auto has no such limit",
            100.0 * unstable / count,
            STABILITY_LIMIT,
            remedy,
        )
    if ended_at_start > 0.5 * count:
        runs = "the run ends" if count == 1 else f"{ended_at_start / count:.0%} of the runs end"
        logger.warning("%s at t = 0: is a unit or the initial state wrong?", runs)
