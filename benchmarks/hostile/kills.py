"""Kills: a sweep is killed in every phase, compilation included, and continued until it ends.

`ringsweep run` is killed (SIGKILL: no handler, no clean-up) at a random time of a process that has to compile its
kernels, or at a random pass of one of these points: it flushes a file, is about to rename one, has just renamed one,
writes a chunk of the final file, reads the final file back, or cleans up. After each kill the same command runs again.
When it ends, its file is compared, bit for bit, with the file of a run that was never stopped. Then the sweep starts
again, until there have been enough kills.
"""

from __future__ import annotations

import os
import random
import shutil
import signal
import subprocess
import sys
import threading
from collections import Counter
from collections.abc import Callable
from pathlib import Path
from typing import Any

from benchmarks.hostile.attack import Report, command, configuration, end, here, same_bits, start


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
    from ringsweep.storage import netcdf
    from ringsweep.storage.checkpoint import Checkpoint

    return {
        "flush": lambda die: _before(os, "fsync", die),
        "before a rename": lambda die: _before(Path, "replace", die),
        "after a rename": lambda die: _after(Path, "replace", die),
        "merge": lambda die: _before(netcdf, "_add_values", die),
        "read back": lambda die: _before(netcdf, "_seal", die),
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
    given = [sys.executable, "-m", "benchmarks.hostile.kills", point, str(count), *arguments]
    return subprocess.run(given, capture_output=True, text=True, check=False, **options)


def _killed_after(seconds: float, arguments: list[str], cache: Path) -> tuple[int, str]:
    """Run the command line in a new process, kill it after some seconds; exit status and what it printed."""
    process = subprocess.Popen(
        [sys.executable, "-m", "ringsweep", *arguments],
        env=os.environ | {"NUMBA_CACHE_DIR": str(cache)},
        stdout=subprocess.DEVNULL,
        stderr=subprocess.PIPE,
        text=True,
    )
    try:
        return process.wait(seconds), process.stderr.read() if process.stderr else ""
    except subprocess.TimeoutExpired:
        process.kill()
        return process.wait(), ""
    finally:
        process.communicate()


#: Share of the kills that come at a random time of a process that compiles, and the longest time until one, s.
_COMPILING, _LONGEST = 0.2, 8.0


def kills(folder: Path, count: int, seed: int) -> Report:
    """Kill, continue, compare."""
    draw, report = random.Random(seed), Report()
    config, reference, target = configuration(folder / "sweep.yaml", 80, 60), folder / "reference.nc", folder / "out.nc"
    here("run", config, "-o", reference)
    arguments = ["run", str(config), "-o", str(target)]
    # Tasks of a few cells, so that there are many.
    small: Callable[[Any, int], int] = lambda self, left: 400  # noqa: E731
    done: Counter[str] = Counter()
    since = 0
    while done.total() < count or since:
        phase = draw.choice(list(POINTS)) if draw.random() > _COMPILING else "at a time, compilation included"
        if done.total() >= count:
            phase = "never"
        if phase == "never":
            ended = command(*arguments)
            status, text = ended.status, ended.text
        elif phase in POINTS:

            def dying(phase: str = phase, passes: int = draw.randint(1, POINTS[phase])) -> int:
                from ringsweep.runs.task_sizes import TaskSizes

                TaskSizes.next = small  # type: ignore[method-assign, assignment]
                return child(phase, passes, arguments)

            ended = end(start(dying))
            status, text = ended.status, ended.text
        else:
            status, text = _killed_after(draw.uniform(0.0, _LONGEST), arguments, folder / "cache")
            if status == 0:
                # Compiled: the next process compiles again.
                shutil.rmtree(folder / "cache", ignore_errors=True)
        if status == -signal.SIGKILL:
            done[phase] += 1
            since += 1
            report.add(f"killed: {phase}")
        elif status != 0 or "Traceback" in text:
            report.add(
                "", f"kills, seed {seed}, after {done.total()} kills ({phase}): exit status {status}: {text[-500:]}"
            )
            return report
        if status == 0:
            left = sorted(path.name for path in folder.iterdir() if path.name.startswith("out"))
            problem = "" if same_bits(reference, target) else "other numbers"
            if left != ["out.nc", "out.png"]:
                problem = f"left behind: {', '.join(left)}"
            problem = problem and f"kills, seed {seed}, after {done.total()} kills: {problem}"
            report.add("ended with the same bits", problem)
            since = 0
            target.unlink()
            target.with_suffix(".png").unlink(missing_ok=True)
    return report


if __name__ == "__main__":
    _, name, passes, *rest = sys.argv
    sys.exit(child(name, int(passes), rest))
