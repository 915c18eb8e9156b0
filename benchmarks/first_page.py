"""What the first page of the documents says of Runge-Kutta 4, and of impacts, from runs.

    python -m benchmarks.first_page            # a minute
    python -m benchmarks.first_page --quick    # a coarse map

Computes the map of `configs/regime_map.yaml` by `auto` and by `rk4` with the 5000 steps of the paper: the share of each
regime, and of certified cells. Then takes the single run of this file by `rk4` at ever smaller steps: does it lose the
contact that `auto` loses? Then computes the map with a coefficient of restitution of 0.5: the share of each word, and
CPU seconds over those without.

Writes `first_page.md`.
"""

from __future__ import annotations

import logging
import time
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr

import ringsweep
from benchmarks._common import PAPER_STEPS, SPAN, command, family, machine, publish, shown
from ringsweep import config

MAP = Path(__file__).parents[1] / "configs" / "regime_map.yaml"
PAPER = f"`rk4`, the paper's {PAPER_STEPS} steps"
#: Steps that `rk4` tries, s.
STEPS = (2e-3, 1e-4, 1e-5, 5e-6, 2e-6, 1e-6)


def shares(ds: xr.Dataset, name: str) -> dict[str, float]:
    """Share of each word of a variable."""
    words, counts = np.unique(ringsweep.words(ds[name]), return_counts=True)
    return dict(zip(map(str, words), counts / counts.sum(), strict=True))


def percent(share: float) -> str:
    """A share in per cent."""
    return f"{100.0 * share:.1f} %"


def main() -> None:
    """Run, print, write."""
    given = command(__doc__).parse_args()
    print(where := machine())
    logging.getLogger("ringsweep").setLevel(logging.ERROR)
    scene: Any = config.load(MAP).source["scene"]
    side, rounds = (16, 1) if given.quick else (64, 3)
    amplitudes, half_angles = map(list, zip(*family(side), strict=True))
    points = {name: xr.DataArray(values, dims="run") for name, values in
              (("drive.amplitude", amplitudes), ("zone.half_angle", half_angles))}  # fmt: skip

    def run(scene: Any, solver: Any = "auto") -> xr.Dataset:
        return ringsweep.sweep(scene, points, solver=solver, progress=False)

    header, rows = [f"{side}² cells", "oscillatory", "separating", "certified"], []
    for title, solver in ((PAPER, {"method": "rk4", "steps": PAPER_STEPS}), ("`auto`, the default", "auto")):
        ds = run(scene, solver)
        share = shares(ds, "regime")
        rows.append([title, *(percent(share.get(n, 0.0)) for n in header[1:3]), percent(float(ds.certified.mean()))])
    shares_of_map = shown("The map", header, rows)

    found = []
    for step in STEPS:
        solver = {"method": "rk4", "steps": round(SPAN / step)}
        ds = ringsweep.sweep(scene, {"drive.amplitude": ["2 rad/s"]}, solver=solver, progress=False)
        found.append([f"{step:g} s".replace("e-0", "e-"), str(ringsweep.words(ds.regime).values[0])])
    by_step = shown("The run, by rk4", ["step", "regime"], found)
    finds = [regime == "separating" for _, regime in found]
    missing, least = found[finds.index(True) - 1][0], found[finds.index(True)][0]

    bouncing = scene | {"impact": {"restitution": 0.5}}
    ratios = []
    for _ in range(rounds + 1):
        begin = time.process_time()
        run(scene)
        between = time.process_time()
        after = run(bouncing)
        ratios.append((time.process_time() - between) / (between - begin))
    # The first round compiles.
    ratio, word = float(np.median(ratios[1:])), shares(after, "aftermath")
    aftermath = [[name, percent(word.get(name, 0.0))] for name in ("held", "recovered", "open", "tumbled")]
    words = shown(f"With a restitution of 0.5: {ratio:.2f} times the CPU seconds", ["`aftermath`", "share"], aftermath)

    body = f"""
{shares_of_map}
By `rk4`, the single run ends so; by `auto` contact 2 separates:

{by_step}
With a coefficient of restitution of 0.5 the map takes {ratio:.2f} times the CPU seconds, and
{percent(float(after.certified.mean()))} of the cells are certified:

{words}"""
    figures = {"map": shares_of_map, "misses": missing, "finds": least}
    publish(given, "first_page", "The map of the first page", where, body, figures)


if __name__ == "__main__":
    main()
