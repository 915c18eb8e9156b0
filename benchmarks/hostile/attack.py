"""Shared by the attacks: reports, commands in processes of their own, comparison of files."""

from __future__ import annotations

import os
import signal
import sys
import tempfile
import time
import traceback
import warnings
from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import netCDF4
import numpy as np
import yaml

from benchmarks._common import ring


@dataclass
class Report:
    """What an attack found.

    Attributes
    ----------
    counts : Counter
        How often each outcome came; together they are all that was tried.
    broken : list of str
        What did not hold, with all that is needed to repeat it. A report without such lines is good.
    """

    counts: Counter[str] = field(default_factory=Counter)
    broken: list[str] = field(default_factory=list)

    def add(self, outcome: str, problem: str = "") -> None:
        """Count one attempt; a problem says that it broke what must hold."""
        self.counts[outcome if not problem else "BROKEN"] += 1
        if problem:
            self.broken.append(problem)
            print("BROKEN:", problem, flush=True)


@dataclass(frozen=True)
class Ended:
    """A process that has ended: its exit status, negative for a signal, and what it printed."""

    status: int
    text: str

    @property
    def last(self) -> str:
        """Its last line."""
        return self.text.strip().rpartition("\n")[2]

    def complaint(self, allowed: Sequence[int]) -> str:
        """Why this is no proper end of a command; empty if it is."""
        if "Traceback" in self.text:
            return "traceback: " + self.text[-800:]
        return "" if self.status in allowed else f"exit status {self.status}: {self.last}"


def start(function: Callable[[], int]) -> tuple[int, Any]:
    """Run a function in a copy of this process, which has compiled code already; to be ended by :func:`end`."""
    output = tempfile.TemporaryFile()  # noqa: SIM115
    sys.stdout.flush()
    sys.stderr.flush()
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", DeprecationWarning)
        pid = os.fork()
    if pid:
        return pid, output
    status = 1
    try:
        os.dup2(output.fileno(), 1)
        os.dup2(output.fileno(), 2)
        sys.stdout, sys.stderr = open(1, "w", closefd=False), open(2, "w", closefd=False)  # noqa: SIM115
        status = function()
    except BaseException:
        traceback.print_exc()
    finally:
        sys.stdout.flush()
        sys.stderr.flush()
        os._exit(status)


def end(process: tuple[int, Any], seconds: float = 120.0) -> Ended:
    """Wait for a process, at most for some seconds; then it is killed."""
    pid, output = process
    limit = time.monotonic() + seconds
    while not (found := os.waitpid(pid, os.WNOHANG))[0]:
        if time.monotonic() > limit:
            os.kill(pid, signal.SIGKILL)
        time.sleep(0.002)
    output.seek(0)
    text = output.read().decode(errors="replace")
    output.close()
    return Ended(os.waitstatus_to_exitcode(found[1]), text)


def command(*arguments: object) -> Ended:
    """Run the command line in a copy of this process."""
    from ringsweep.cli import main

    return end(start(lambda: main([str(argument) for argument in arguments])))


def here(*arguments: object) -> None:
    """Run the command line in this process, so that its copies have loaded and compiled all that it needs."""
    from ringsweep.cli import main

    if main([*(str(argument) for argument in arguments), "--quiet"]):
        raise RuntimeError(f"{arguments} failed")


def configuration(path: Path, *sizes: int) -> Path:
    """Write the configuration of a sweep of the ring over amplitudes and half-angles."""
    grid = {
        "drive.amplitude": {"geomspace": [0.1, 10.0, sizes[0]]},
        "zone.half_angle": {"linspace": [*np.radians([2.0, 60.0]).tolist(), sizes[1]]},
    }
    scene = ring({"law": "stiction"}) | {"time": {"span": 4.0}}
    path.write_text(yaml.safe_dump({"scene": scene, "sweep": {"grid": grid}}))
    return path


def contents(path: Path) -> dict[str, tuple[Any, ...]]:
    """All variables of a file as they are stored: dimensions, type, bits and units."""
    with netCDF4.Dataset(path) as file:
        file.set_auto_maskandscale(False)
        return {
            name: (
                variable.dimensions,
                str(variable.dtype),
                variable[...].tobytes() if variable.dtype is not str else tuple(np.atleast_1d(variable[...]).flat),
                getattr(variable, "units", ""),
                str(getattr(variable, "flag_meanings", "")),
            )
            for name, variable in file.variables.items()
        }


def same_bits(one: Path, other: Path) -> bool:
    """Whether all variables of two files are equal, bit for bit."""
    return contents(one) == contents(other)
