"""Kill a sweep many times, continue it each time, and compare its file with the file of a sweep that never stopped.

    python -m benchmarks.kills            # two minutes
    python -m benchmarks.kills --quick    # fewer kills

`ringsweep run` is killed (SIGKILL: no handler, no clean-up) at a random time, or at a random pass of one of these
points: it flushes a task file, is about to rename a task file, has just renamed one, writes a chunk of the final
file, reads the final file back, or cleans up. After each kill the same command runs again. When it ends, its file is
compared, bit for bit in all variables, with the file of a run that was never stopped. Then the sweep starts again,
until there have been enough kills.
"""

from __future__ import annotations

import argparse
import os
import random
import shutil
import signal
import subprocess
import sys
import tempfile
import threading
from collections import Counter
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr
import yaml

from benchmarks._common import heading, machine, ring, table

SEED = 20241121


def _before(owner: Any, name: str, die: Callable[[], None]) -> None:
    """Call `die` whenever a function of a module or class is called."""
    function = getattr(owner, name)

    def dying(*args: Any, **kwargs: Any) -> Any:
        die()
        return function(*args, **kwargs)

    setattr(owner, name, dying)


def _after(owner: Any, name: str, die: Callable[[], None]) -> None:
    """Call `die` whenever a function of a module or class has returned."""
    function = getattr(owner, name)

    def dying(*args: Any, **kwargs: Any) -> Any:
        result = function(*args, **kwargs)
        die()
        return result

    setattr(owner, name, dying)


def _points() -> dict[str, Callable[[Callable[[], None]], None]]:
    """Points at which a run can be killed, by name; each value installs the kill."""
    from ringsweep.quantities import digest
    from ringsweep.storage import netcdf
    from ringsweep.storage.checkpoint import Checkpoint

    return {
        "flush": lambda die: _before(os, "fsync", die),
        "before a rename": lambda die: _before(Path, "replace", die),
        "after a rename": lambda die: _after(Path, "replace", die),
        "merge": lambda die: _before(digest, "add", die),
        "read back": lambda die: _before(netcdf, "_read_back", die),
        "clean-up": lambda die: _before(Checkpoint, "clear", die),
    }


#: Largest number of passes of each point before the run is killed there.
POINTS = {"flush": 12, "before a rename": 12, "after a rename": 12, "merge": 60, "read back": 1, "clean-up": 1}


def child(point: str, count: int, arguments: list[str]) -> int:
    """Run the command line in this process and kill it at the `count`-th pass of a point."""
    from ringsweep.cli import main

    left = count
    own = threading.get_ident()

    def die() -> None:
        nonlocal left
        # Numba writes its cache in other threads, which pass the same points.
        if threading.get_ident() == own:
            left -= 1
            if not left:
                os.kill(os.getpid(), signal.SIGKILL)

    _points()[point](die)
    return main(arguments)


def killed_at(point: str, count: int, arguments: list[str], **options: Any) -> subprocess.CompletedProcess[str]:
    """Run the command line in a new process, which is killed at the `count`-th pass of a point."""
    command = [sys.executable, "-m", "benchmarks.kills", "--child", point, str(count), *arguments]
    return subprocess.run(command, capture_output=True, text=True, check=False, **options)


def killed_after(seconds: float, arguments: list[str]) -> int:
    """Run the command line in a new process, kill it after some seconds, and return its exit status."""
    process = subprocess.Popen(
        [sys.executable, "-m", "ringsweep", *arguments], stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL
    )
    try:
        return process.wait(seconds)
    except subprocess.TimeoutExpired:
        process.kill()
        return process.wait()


def same_bits(one: Path, other: Path) -> bool:
    """Whether all variables of two files are equal, bit for bit."""
    with xr.open_dataset(one, decode_times=False) as a, xr.open_dataset(other, decode_times=False) as b:
        return list(a.variables) == list(b.variables) and all(
            a[name].dtype == b[name].dtype and a[name].values.tobytes() == b[name].values.tobytes()
            for name in a.variables
        )


def main() -> None:
    """Kill, continue, compare, print."""
    if "--child" in sys.argv:
        point, count, *arguments = sys.argv[sys.argv.index("--child") + 1 :]
        sys.exit(child(point, int(count), arguments))
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--quick", action="store_true", help="fewer kills")
    wanted = 8 if parser.parse_args().quick else 25
    print(machine())
    draw = random.Random(SEED)
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        config, reference, target = folder / "sweep.yaml", folder / "reference.nc", folder / "out.nc"
        grid = {
            "drive.amplitude": {"geomspace": [0.1, 10.0, 300]},
            "zone.half_angle": {"linspace": [*np.radians([2.0, 60.0]).tolist(), 300]},
        }
        config.write_text(yaml.safe_dump({"scene": ring({"law": "stiction"}), "sweep": {"grid": grid}}))
        never = ["run", str(config), "-o", str(reference)]
        command = ["run", str(config), "-o", str(target)]
        killed_after(600.0, never)
        kills: Counter[str] = Counter()
        ends = {"the same": 0, "different": 0}
        while kills.total() < wanted or target.with_name("out.nc.partial").exists():
            point = draw.choice(["time", *POINTS]) if kills.total() < wanted else "never"
            if point == "time":
                status = killed_after(draw.uniform(0.0, 6.0), command)
            elif point == "never":
                status = killed_after(600.0, command)
            else:
                status = killed_at(point, draw.randint(1, POINTS[point]), command).returncode
            if status == -signal.SIGKILL:
                kills[point] += 1
            elif status != 0:
                sys.exit(f"a run failed with exit status {status} (to be killed at: {point})")
            if target.exists():
                ends["the same" if same_bits(reference, target) else "different"] += 1
                left = sorted(path.name for path in folder.iterdir() if path.name.startswith("out"))
                print(
                    f"{kills.total():3d} kills, last: {point}; the file is complete; in the folder: {', '.join(left)}"
                )
                if status == 0:
                    target.unlink()
                    shutil.rmtree(folder / "out.nc.partial", ignore_errors=True)
        heading(f"{kills.total()} kills of a sweep of 300 x 300 cells")
        table(["killed", "times"], [[point, str(count)] for point, count in sorted(kills.items())])
        print(f"\nfiles equal to the file of a run never stopped: {ends['the same']}, different: {ends['different']}")


if __name__ == "__main__":
    main()
