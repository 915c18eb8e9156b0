"""Maps of probabilities and of Sobol indices, by `sweep.sample` and by hand with scipy, SALib and a plain sweep.

    python -m benchmarks.probabilities            # a million runs each way for the probabilities
    python -m benchmarks.probabilities --quick    # fewer cells

The grid has amplitudes of the drive and half-angles of the zone, and two coefficients of friction are uncertain. By
hand means a plain sweep with one more dimension, over points that scipy or SALib drew; numpy counts the regimes, and
`SALib.analyze.sobol` makes the indices of `separating` cell by cell. Each way has a process of its own, one job, and
the same number of runs, none certified. Compilation is not counted.

Writes `probabilities.md`.
"""

from __future__ import annotations

import json
import logging
import resource
import subprocess
import sys
from collections.abc import Callable
from time import perf_counter
from typing import Any

import numpy as np

import ringsweep
from benchmarks._common import command, machine, publish, ring, shown
from ringsweep.quantities.flags import REGIMES

N, SPREAD = 256, 0.05
MEANS = {"friction.rest.mu_k": 0.1, "friction.rough.mu_k": 0.3}
SEPARATING = REGIMES.index("separating")


def grid(side: int) -> dict[str, list[float]]:
    """Axes of the map (rad/s, rad)."""
    return {
        "drive.amplitude": np.geomspace(0.5, 5.0, side).tolist(),
        "zone.half_angle": np.radians(np.linspace(5.0, 45.0, side)).tolist(),
    }


def sampled(side: int, sensitivity: bool) -> Any:
    """Dataset of a sampled sweep."""
    of = {path: {"normal": [mean, SPREAD * mean]} for path, mean in MEANS.items()}
    given = {
        "scene": ring({"law": "stiction"}),
        "solver": {"method": "auto", "certify": False},
        "sweep": {"grid": grid(side), "sample": {"n": N, "seed": 1, "of": of, "sensitivity": sensitivity}},
    }
    return ringsweep.run(given, jobs=1, progress=False)


def by_hand(side: int, points: np.ndarray) -> np.ndarray:
    """Regimes of a sweep with one more dimension, whose runs are all kept until they are counted."""
    import xarray as xr

    columns = {path: xr.DataArray(column, dims="point") for path, column in zip(MEANS, points.T, strict=True)}
    solver = {"method": "auto", "certify": False}
    ds = ringsweep.sweep(ring({"law": "stiction"}), {**grid(side), **columns}, solver=solver, jobs=1, progress=False)
    return ds["regime"].transpose(..., "point").values


def probabilities(side: int) -> np.ndarray:
    """Probability of each regime, by the package."""
    return sampled(side, False)["probability"].values


def probabilities_by_hand(side: int) -> np.ndarray:
    """The same with the points of scipy."""
    from scipy.stats import norm, qmc

    means = np.array(list(MEANS.values()))
    regimes = by_hand(side, norm.ppf(qmc.Sobol(len(MEANS), seed=1).random(N), means, SPREAD * means))
    return np.stack([(regimes == k).mean(axis=-1) for k in range(len(REGIMES))], axis=-1)


def indices(side: int) -> np.ndarray:
    """Total indices of `separating`, by the package."""
    return sampled(side, True)["sobol_total"].sel(word="separating").values


def indices_by_hand(side: int) -> np.ndarray:
    """The same with SALib; NaN where nearly all runs of a cell are alike, so that their indices say little."""
    from SALib.analyze import sobol as analyse
    from SALib.sample import sobol as draw

    bounds = [[mean, SPREAD * mean] for mean in MEANS.values()]
    problem = {"num_vars": len(MEANS), "names": list(MEANS), "bounds": bounds, "dists": ["norm"] * len(MEANS)}
    lost = by_hand(side, draw.sample(problem, N, calc_second_order=False, seed=1)) == SEPARATING
    found = np.full((side, side, len(MEANS)), np.nan)
    for cell in np.ndindex(side, side):
        if 0.0 < (share := lost[cell].mean()) < 1.0:
            told = analyse.analyze(problem, lost[cell].astype(float), calc_second_order=False, seed=1)["ST"]
            if 0.1 < share < 0.9:
                found[cell] = told
    return found


#: What is measured: the number, the way, the function, cells along an axis in full and quick.
MEASURED: dict[str, tuple[str, str, Callable[[int], np.ndarray], int, int]] = {
    "sampled": ("probabilities", "sweep.sample", probabilities, 64, 16),
    "by-hand": ("probabilities", "by hand", probabilities_by_hand, 64, 16),
    "sampled-indices": ("Sobol indices", "sweep.sample", indices, 24, 8),
    "salib": ("Sobol indices", "by hand, with SALib", indices_by_hand, 24, 8),
}


def main() -> None:
    """Measure, print, write."""
    parser = command(__doc__)
    parser.add_argument("--way", choices=MEASURED, help="measure this one only, in this process")
    given = parser.parse_args()
    logging.getLogger("ringsweep").setLevel(logging.ERROR)
    if given.way:
        _, _, measured, full, quick = MEASURED[given.way]
        measured(2)
        begin = perf_counter()
        result = measured(quick if given.quick else full)
        seconds = perf_counter() - begin
        memory = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024.0
        print(json.dumps({"seconds": seconds, "memory": memory, "found": result.tolist()}))
        return
    print(where := machine())
    rows: list[list[str]] = []
    maps: dict[str, list[np.ndarray]] = {}
    for key, (number, way, _, full, quick) in MEASURED.items():
        line = [sys.executable, "-m", "benchmarks.probabilities", "--way", key, *["--quick"] * given.quick]
        told = json.loads(subprocess.run(line, check=True, capture_output=True, text=True).stdout.splitlines()[-1])
        maps.setdefault(number, []).append(np.array(told["found"]))
        side = quick if given.quick else full
        runs = side * side * N * (len(MEANS) + 2 if number == "Sobol indices" else 1)
        rows.append(
            [number, way, f"{side} x {side}", f"{runs}", f"{told['seconds']:.0f} s", f"{told['memory']:.0f} MB"]
        )
    header = ["number", "way", "cells", "runs", "time, one job", "greatest memory"]
    title = "Maps of probabilities and of Sobol indices"
    found = shown(title, header, rows)
    apart = " ".join(
        f"The {number} of both ways differ by {np.nanmedian(np.abs(a - b)):.3f} in the median and by"
        f" {np.nanmax(np.abs(a - b)):.3f} at most."
        for number, (a, b) in maps.items()
    )
    apart = f"n = {N} in each cell; both ways have points of their own. {apart} Indices are compared in"
    apart += " cells where 10 to 90 % of the runs separate."
    print(apart)
    publish(given, "probabilities", title, where, f"{found}\n{apart}")


if __name__ == "__main__":
    main()
