"""The plan of a sweep."""

from __future__ import annotations

import os

from ringsweep.config import Config
from ringsweep.runs.grid import Chains, Grid
from ringsweep.runs.probabilities import Sampled
from ringsweep.runs.refined import Refined


def plan_of(config: Config, reuse: str | os.PathLike[str] | None = None, *, whole: bool = False) -> Grid:
    """Plan of a sweep: which cells are run, in which order, and what is kept of them; see :class:`Grid`."""
    for kind, section in ((Sampled, config.sample), (Refined, config.refine), (Chains, config.follow)):
        if section is not None:
            return kind(config, section, reuse, whole)
    return Grid(config, None, reuse, whole)
