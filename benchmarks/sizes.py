"""The cost of large sweeps: cells per second, memory and disk from 8e3 to 1e6 cells.

    python -m benchmarks.sizes            # three minutes
    python -m benchmarks.sizes --quick    # the smallest sweep

Runs `ringsweep run` on a grid over five axes (drive, width of the zone, two coefficients of friction, initial angular
velocity) of the ring of the paper's Fig. 29, under stiction, for 2 s, with certificates. Each size runs in a new
process, measured as a whole: start, tasks, merge and verification. Memory is the greatest resident set of that
process. Then one map is drawn from each file.

Writes `sizes.md`.
"""

from __future__ import annotations

import os
import subprocess
import sys
import tempfile
import time
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import yaml

from benchmarks._common import command, machine, publish, ring, shown

#: Values along each of the five axes.
SIDES = (6, 10, 16)


@dataclass(frozen=True)
class Cost:
    """Cost of a process: wall time (s), CPU time (s), greatest resident memory (bytes)."""

    wall: float
    cpu: float
    memory: float


def configuration(side: int) -> str:
    """YAML of a sweep with `side` values along each of five axes."""
    spans = {
        "drive.amplitude": (0.5, 10.0),
        "zone.half_angle": (0.05, 1.0),
        "friction.rough.mu_k": (0.2, 0.4),
        "friction.rest.mu_s": (0.11, 0.25),
        "initial.omega": (0.0, 5.0),
    }
    # Middles of equal intervals: with the ends, a coarse grid would have a larger share of extreme cells.
    shares = (np.arange(side) + 0.5) / side
    grid = {path: (low + (high - low) * shares).tolist() for path, (low, high) in spans.items()}
    scene = ring({"law": "stiction"}) | {"time": {"span": 2.0}}
    return yaml.safe_dump({"scene": scene, "sweep": {"grid": grid}}, sort_keys=False)


def cost(*arguments: str) -> Cost:
    """Run the command line and measure its cost."""
    begin = time.perf_counter()
    process = subprocess.Popen([sys.executable, "-m", "ringsweep", *arguments], stdout=subprocess.DEVNULL)
    _, status, usage = os.wait4(process.pid, 0)
    process.returncode = os.waitstatus_to_exitcode(status)
    if process.returncode:
        sys.exit(f"ringsweep {' '.join(arguments)} ended with status {process.returncode}")
    # Linux counts in KiB, macOS in bytes.
    unit = 1 if sys.platform == "darwin" else 1024
    return Cost(time.perf_counter() - begin, usage.ru_utime + usage.ru_stime, unit * usage.ru_maxrss)


def main() -> None:
    """Measure, print, write."""
    given = command(__doc__).parse_args()
    where = machine()
    print(where)
    rows = []
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        config, target = folder / "sweep.yaml", folder / "sweep.nc"
        config.write_text(configuration(3))
        # The first run compiles: the cost of the second is the cost of the start.
        start = [cost("run", str(config), "-o", str(folder / name)) for name in ("first.nc", "second.nc")][1]
        for side in SIDES[: 1 if given.quick else 3]:
            cells = side**5
            config.write_text(configuration(side))
            target.unlink(missing_ok=True)
            took = cost("run", str(config), "-o", str(target))
            held = [f"{axis}={value}" for axis, value in
                    (("friction_rough_mu_k", 0.3), ("friction_rest_mu_s", 0.2), ("initial_omega", 2.5))]  # fmt: skip
            picture = cost("map", str(target), "-o", str(folder / "map.png"),
                           *(word for one in held for word in ("--sel", one)))  # fmt: skip
            rows.append([
                f"{cells}", f"{took.wall:.0f}", f"{cells / (took.wall - start.wall):.0f}",
                f"{1e6 * (took.cpu - start.cpu) / cells:.1f}",
                f"{took.memory / 2**20:.0f}", f"{target.stat().st_size / cells:.0f}",
                f"{picture.wall:.1f}", f"{picture.memory / 2**20:.0f}",
            ])  # fmt: skip
            print(*rows[-1], flush=True)
    header = ["cells", "s", "cells/s", "CPU µs per cell", "memory, MiB", "bytes per cell"]
    header += ["one map, s", "its memory, MiB"]
    found = shown("Size of a sweep over five axes", header, rows)
    about = f"""
A grid over five axes, 2 s under stiction for each cell, with certificates, from start to finished file. A sweep of
{3**5} cells takes {start.wall:.1f} s and {start.memory / 2**20:.0f} MiB; rates count only the time beyond that.

"""
    publish(given, "sizes", "Size of a sweep", where, about + found)


if __name__ == "__main__":
    main()
