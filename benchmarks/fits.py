"""How often 95 % intervals of fits hold the true values: synthetic histories with noise, stick and edges of zones.

    python -m benchmarks.fits [--problems 100] [--seed 1]

Each problem has its own rough friction, zone and drive, and 200 angles in 5 s with normal noise of 0.01 rad. Problems
without stick, without motion over the edges, or with a lost contact are left out.
"""

from __future__ import annotations

import argparse
import logging
from time import perf_counter

import numpy as np

import ringsweep
from ringsweep.statistics import clopper_pearson

NOISE, SPAN, COUNT = 0.01, 5.0, 200


def problem(random: np.random.Generator) -> tuple[dict, dict, np.ndarray]:
    """A scene whose numbers are wrong, its measured history, and the true numbers."""
    while True:
        truth = np.array([random.uniform(0.15, 0.3), random.uniform(0.15, 0.4)])
        scene = {
            "model": "ring",
            "body": {"mass": 0.076, "inertia": 4.47e-5, "half_distance": 0.025, "ball_radius": 0.01},
            "ring": {"radius": 0.043378},
            "friction": {
                "law": "stiction",
                "rough": {"mu_s": 0.4, "mu_k": truth[0]},
                "rest": {"mu_s": 0.15, "mu_k": 0.1},
            },
            "zone": {"half_angle": truth[1]},
            "drive": {"law": "arctan", "amplitude": random.uniform(1.0, 3.0)},
            "initial": {"phi": 0.0, "omega": 0.0},
            "time": {"span": SPAN},
        }
        run = ringsweep.simulate(scene)
        edges = sum(int((np.diff(run[zone]) != 0).sum()) for zone in ("zone_1", "zone_2"))
        if np.isnan(run["t_separation"]) and run["stick_time"] > 0.05 and edges > 3 and run["certified"] == 1:
            break
    t = np.linspace(SPAN / COUNT, SPAN, COUNT)
    phi = np.interp(t, run["time"], run["phi"]) + NOISE * random.standard_normal(COUNT)
    scene["friction"]["rough"]["mu_k"] = 0.2
    scene["zone"]["half_angle"] = 0.25
    return scene, {"t": t, "phi": phi}, truth


def main() -> None:
    """Print the coverage of both kinds of intervals."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--problems", type=int, default=100)
    parser.add_argument("--seed", type=int, default=1)
    given = parser.parse_args()
    logging.getLogger("ringsweep").setLevel(logging.ERROR)
    random = np.random.default_rng(given.seed)
    held = {name: np.zeros(2, dtype=int) for name in ("", "profile_")}
    seconds, runs = 0.0, 0
    for _ in range(given.problems):
        scene, data, truth = problem(random)
        begin = perf_counter()
        found = ringsweep.fit(scene, data, "friction.rough.mu_k=0.1..0.39, zone.half_angle=0.1..0.5")
        seconds, runs = seconds + perf_counter() - begin, runs + found.attrs["runs"]
        for name, hits in held.items():
            hits += (found[f"{name}low"].values <= truth) & (truth <= found[f"{name}high"].values)
    paths = found["parameter"].values
    for name, hits in held.items():
        for path, k in zip(paths, hits, strict=True):
            low, high = clopper_pearson(k, given.problems)
            kind = "profile" if name else "covariance"
            print(f"{kind:10} {path:20} {k} of {given.problems} = {k / given.problems:.1%} ({low:.1%} to {high:.1%})")
    print(f"{seconds / given.problems:.2f} s and {runs / given.problems:.0f} runs a fit")


if __name__ == "__main__":
    main()
