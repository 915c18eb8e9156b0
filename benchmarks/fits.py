"""How often 95 % intervals of fits hold the true values: synthetic histories with noise, stick and edges of zones.

    python -m benchmarks.fits            # four minutes
    python -m benchmarks.fits --quick    # fewer problems

Each problem has its own rough friction, zone and drive, and 200 angles in 5 s with normal noise of 0.01 rad. Problems
without stick, without motion over the edges, or with a lost contact are left out.

Writes `fits.md`.
"""

from __future__ import annotations

import logging
from time import perf_counter

import numpy as np

import ringsweep
from benchmarks._common import command, heading, machine, markdown, publish, table
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
    """Measure, print, write."""
    parser = command(__doc__)
    parser.add_argument("--problems", type=int, help="number of fits (default 100; 10 with --quick)")
    parser.add_argument("--seed", type=int, default=1)
    given = parser.parse_args()
    problems = given.problems or (10 if given.quick else 100)
    print(where := machine())
    logging.getLogger("ringsweep").setLevel(logging.ERROR)
    random = np.random.default_rng(given.seed)
    held = {name: np.zeros(2, dtype=int) for name in ("", "profile_")}
    seconds, runs = 0.0, 0
    for _ in range(problems):
        scene, data, truth = problem(random)
        begin = perf_counter()
        found = ringsweep.fit(scene, data, "friction.rough.mu_k=0.1..0.39, zone.half_angle=0.1..0.5")
        seconds, runs = seconds + perf_counter() - begin, runs + found.attrs["runs"]
        for name, hits in held.items():
            hits += (found[f"{name}low"].values <= truth) & (truth <= found[f"{name}high"].values)
    rows = []
    for name, hits in held.items():
        for path, k in zip(found["parameter"].values, hits, strict=True):
            low, high = clopper_pearson(k, problems)
            kind = "profile" if name else "covariance"
            rows.append([kind, str(path), f"{k} of {problems}", f"{k / problems:.1%}", f"{low:.1%} to {high:.1%}"])
    header = ["interval from", "number", "holds the true value", "share", "95 % interval of the share"]
    heading("Coverage of the intervals of fits")
    table(header, rows)
    cost = f"{seconds / problems:.2f} s and {runs / problems:.0f} runs a fit; seed {given.seed}."
    publish(given, "fits", "Coverage of the intervals of fits", where, f"{markdown(header, rows)}\n{cost}")


if __name__ == "__main__":
    main()
