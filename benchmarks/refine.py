"""Refined maps against full ones: cost, wrong cells, the bound of the audit; cost against resolution.

    python -m benchmarks.refine                # ten minutes: full maps of 512 and 1024 cells a side
    python -m benchmarks.refine --part scaling # or full
    python -m benchmarks.refine --quick        # smaller maps

The scene is the map of the README. A full and a refined map are computed one after the other in one run. CPU seconds
do not grow with other load on the machine; they contain everything: runs, decisions, files.
"""

from __future__ import annotations

import tempfile
import time
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr

import ringsweep
from benchmarks._common import ALPHA, V0, command, machine, publish, ring, shown
from ringsweep.quantities.variables import INFERRED, LABELS

SCENE = ring({"law": "bengisu-akay", "alpha": ALPHA, "v0": V0})


def grid(side: int) -> dict[str, Any]:
    """The axes of the map of the README, with `side` cells along each."""
    return {
        "drive.amplitude": np.geomspace(0.1, 10.0, side).tolist(),
        "zone.half_angle": np.radians(np.linspace(2.0, 60.0, side)).tolist(),
    }


def timed(axes: dict[str, Any], folder: str, **options: Any) -> tuple[xr.Dataset, float, float]:
    """The dataset of a sweep, its wall-clock time and its CPU time."""
    begin, cpu = time.perf_counter(), time.process_time()
    path = Path(folder) / f"{time.time_ns()}.nc"
    ringsweep.sweep(SCENE, axes, path, progress=False, **options).close()
    wall, cpu = time.perf_counter() - begin, time.process_time() - cpu
    return xr.open_dataset(path, decode_times=False), wall, cpu


def labels_of(ds: xr.Dataset) -> Any:
    """One number for regime, motion and separating contact, and with impacts for what follows."""
    return sum(ds[name].values.astype(int) * 32**k for k, name in enumerate(LABELS) if name in ds)


def against_full(sides: list[int], folder: str) -> str:
    """Refined and full maps of some sizes."""
    rows = []
    for side in sides:
        refined, wall, cpu = timed(grid(side), folder, refine=True)
        whole, full_wall, full_cpu = timed(grid(side), folder)
        wrong = labels_of(refined) != labels_of(whole)
        inferred = int((refined.origin == INFERRED).sum())
        run = (refined.origin != INFERRED).values
        same = all(np.array_equal(refined[n].values[run], whole[n].values[run], equal_nan=True) for n in whole)
        rows.append([
            f"{side}²", f"{wall:.0f} s, {full_wall:.0f} s", f"{100 * run.mean():.2f} %", f"{full_wall / wall:.1f}x",
            f"{full_cpu / cpu:.1f}x", f"{wrong.sum()} ({100 * wrong.mean():.3f} %)",
            f"{100 * wrong.sum() / inferred:.3f} %", f"{100 * refined.attrs['audit_bound']:.3f} %", str(same),
        ])  # fmt: skip
        print(*rows[-1], flush=True)
    header = ["map", "refined, full", "cells run", "wall clock", "CPU", "cells wrong", "of those inferred",
              "bound on these", "the others equal bit for bit"]  # fmt: skip
    return "## Refined against full\n\n" + shown("Refined against full", header, rows)


def scaling(sides: list[int], folder: str) -> str:
    """Cost against resolution."""
    rows = []
    cells = []
    for side in sides:
        found, wall, cpu = timed(grid(side), folder, refine={"audit": 0.0})
        count = int((found.origin != INFERRED).sum())
        rows.append([str(side), f"{wall:.1f}", f"{cpu:.1f}", str(count), f"{count / side:.1f}",
                     f"{100 * count / side**2:.2f} %", f"{0.02 * (side**2 - count):.0f}"])  # fmt: skip
        cells.append(count)
        found.close()
        print(*rows[-1], flush=True)
    header = ["side", "wall, s", "CPU, s", "cells run", "per cell of the side", "share", "an audit of 2 % adds"]
    title = "Cost against resolution, without an audit"
    found = shown(title, header, rows)
    slope = np.polyfit(np.log(sides), np.log(cells), 1)[0]
    return f"## {title}\n\n{found}\nCells run grow like side^{slope:.2f}.\n"


def main() -> None:
    """Measure, print, write."""
    parser = command(__doc__)
    parser.add_argument("--part", choices=["full", "scaling"], help="only this part, which is only printed")
    parser.add_argument("--sides", type=int, nargs="+", help="cells along a side of the maps of this part")
    given = parser.parse_args()
    where = machine()
    print(where)
    ringsweep.sweep(SCENE, grid(2), progress=False)
    full, resolutions = ([128], [64, 128]) if given.quick else ([512, 1024], [2**k for k in range(6, 12)])
    with tempfile.TemporaryDirectory() as folder:
        parts = {
            "full": lambda: against_full(given.sides or full, folder),
            "scaling": lambda: scaling(given.sides or resolutions, folder),
        }
        texts = [part() for name, part in parts.items() if given.part in (None, name)]
    if given.part is None:
        publish(given, "refine", "Refined maps", where, "\n".join(texts))


if __name__ == "__main__":
    main()
