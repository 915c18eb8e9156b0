"""A map of probabilities, by `sweep.sample` and by hand: a plain sweep over points that scipy drew, counted by numpy.

    python -m benchmarks.probabilities            # a million runs each way
    python -m benchmarks.probabilities --quick    # 16 x 16 cells

The grid has amplitudes of the drive and half-angles of the zone, and two coefficients of friction are uncertain. Each
way has a process of its own, one job, and the same number of runs, none certified. Compilation is not counted.

Writes `probabilities.md`.
"""

from __future__ import annotations

import json
import logging
import resource
import subprocess
import sys
from time import perf_counter

import numpy as np

import ringsweep
from benchmarks._common import command, heading, machine, markdown, publish, ring, table
from ringsweep.quantities.flags import REGIMES

N, SPREAD = 256, 0.05
MEANS = {"friction.rest.mu_k": 0.1, "friction.rough.mu_k": 0.3}
WAYS = ("sweep.sample", "by hand")


def grid(side: int) -> dict[str, list[float]]:
    """Axes of the map (rad/s, rad)."""
    return {
        "drive.amplitude": np.geomspace(0.5, 5.0, side).tolist(),
        "zone.half_angle": np.radians(np.linspace(5.0, 45.0, side)).tolist(),
    }


def sampled(side: int) -> np.ndarray:
    """Probability of each regime, by the package."""
    of = {path: {"normal": [mean, SPREAD * mean]} for path, mean in MEANS.items()}
    given = {
        "scene": ring({"law": "stiction"}),
        "solver": {"method": "auto", "certify": False},
        "sweep": {"grid": grid(side), "sample": {"n": N, "seed": 1, "of": of}},
    }
    return ringsweep.run(given, jobs=1, progress=False)["probability"].values


def by_hand(side: int) -> np.ndarray:
    """The same by a sweep with one more dimension, whose runs are all kept until they are counted."""
    import xarray as xr
    from scipy.stats import norm, qmc

    points = qmc.Sobol(len(MEANS), seed=1).random(N)
    columns = {
        path: xr.DataArray(norm.ppf(u, mean, SPREAD * mean), dims="point")
        for (path, mean), u in zip(MEANS.items(), points.T, strict=True)
    }
    solver = {"method": "auto", "certify": False}
    ds = ringsweep.sweep(ring({"law": "stiction"}), {**grid(side), **columns}, solver=solver, jobs=1, progress=False)
    regimes = ds["regime"].transpose(..., "point").values
    return np.stack([(regimes == k).mean(axis=-1) for k in range(len(REGIMES))], axis=-1)


def main() -> None:
    """Measure, print, write."""
    parser = command(__doc__)
    parser.add_argument("--way", choices=WAYS, help="measure this one only, in this process")
    given = parser.parse_args()
    side = 16 if given.quick else 64
    logging.getLogger("ringsweep").setLevel(logging.ERROR)
    if given.way:
        measured = sampled if given.way == WAYS[0] else by_hand
        measured(2)
        begin = perf_counter()
        found = measured(side)
        seconds = perf_counter() - begin
        memory = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024.0
        print(json.dumps({"seconds": seconds, "memory": memory, "found": found.tolist()}))
        return
    print(where := machine())
    rows: list[list[str]] = []
    maps: list[np.ndarray] = []
    for way in WAYS:
        line = [sys.executable, "-m", "benchmarks.probabilities", "--way", way, *["--quick"] * given.quick]
        told = json.loads(subprocess.run(line, check=True, capture_output=True, text=True).stdout.splitlines()[-1])
        maps.append(np.array(told["found"]))
        rows.append([way, f"{side * side * N}", f"{told['seconds']:.0f} s", f"{told['memory']:.0f} MB"])
    header = ["way", "runs", "time, one job", "greatest memory"]
    heading("A map of probabilities")
    table(header, rows)
    apart = (
        f"{side} x {side} cells, n = {N}. Greatest difference of a probability: {np.abs(maps[0] - maps[1]).max():.3f}."
    )
    print(apart)
    publish(given, "probabilities", "A map of probabilities", where, f"{markdown(header, rows)}\n{apart}")


if __name__ == "__main__":
    main()
