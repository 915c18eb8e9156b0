"""What a command tells of a result."""

from __future__ import annotations

import logging
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    import xarray as xr

    from ringsweep.config import Config


def summarise(result: xr.Dataset) -> None:
    """Print how many cells there are, and the share of each regime."""
    import numpy as np

    regime = result["regime"]
    print("cells:", regime.size)
    meanings = str(regime.attrs["flag_meanings"]).split()
    for flag, meaning in zip(np.atleast_1d(regime.attrs["flag_values"]), meanings, strict=True):
        count = int((regime == flag).sum())
        if count:
            print(f"  {meaning}: {count} ({count / regime.size:.1%})")
    if "certified" in result:
        share = float((result["certified"] == 1).mean())
        # All is said only of all.
        print(f"certified: {share if share == 1.0 else min(share, 0.999):.1%}")
    stated = [str(name).removesuffix("_error") for name in result.data_vars if str(name).endswith("_error")]
    if stated:
        print("bounds on errors (median, largest):")
    for name in stated:
        bounds = result[f"{name}_error"].values
        bounds = bounds[np.isfinite(bounds)]
        unit = result[name].attrs.get("units", "")
        if bounds.size:
            print(f"  {name}: {np.median(bounds):.1e}, {bounds.max():.1e} {unit}")


def warn_of_stiffness(result: xr.Dataset, config: Config) -> None:
    """Say which share of the cells a fixed step cannot follow, and which step could."""
    import numpy as np

    if "stiffness" not in result:
        return
    from ringsweep.solvers.rk4 import STABILITY_LIMIT

    stiffness = result["stiffness"].values
    beyond = ~(stiffness <= STABILITY_LIMIT)
    if not beyond.any():
        return
    if np.isfinite(stiffness[beyond]).all():
        remedy = f"about {config.solver.steps * stiffness[beyond].max() / STABILITY_LIMIT:.2g} steps would be needed"
    else:
        remedy = "no step is small enough for a friction law that jumps"
    logging.getLogger("ringsweep").warning(
        "%.1f %% of the cells went beyond the limit of stability of rk4 (stiffness above %.4g) "
        "and may be wrong in kind: %s; solver auto needs none",
        100.0 * beyond.mean(),
        STABILITY_LIMIT,
        remedy,
    )


def warn_of_launch(result: xr.Dataset) -> None:
    """Say if most runs are over as they begin, which a forgotten unit can do."""
    share = float((result["t_end"] == 0.0).mean())
    if share > 0.5:
        logging.getLogger("ringsweep").warning(
            "%s at t = 0: is a unit or the launch other than meant?",
            "the run ends" if result["t_end"].size == 1 else f"{share:.0%} of the runs end",
        )
