"""Faults of the disk: each system call that a command makes on its files fails once."""

from __future__ import annotations

import ctypes
import errno
import os
import shutil
import signal
import subprocess
import sys
import tempfile
from pathlib import Path

from benchmarks.hostile.attack import Report, command, configuration, end, here, same_bits, start

#: Faults: error, and whether all later calls that need space fail as well.
FAULTS = {"EIO once": (errno.EIO, 0), "full disk from here on": (errno.ENOSPC, 1)}

_SOURCE = Path(__file__).with_name("fault.c")


def faults(folder: Path, count: int, seed: int) -> Report:
    """Let every system call of `run` and `simulate` fail; after each fault the same command runs again.

    There are a few hundred such calls. If `count` is smaller than their number, evenly spaced ones fail.
    """
    if "HOSTILE_FAULTS" not in os.environ:
        return _with_library(folder, count, seed)
    from ringsweep.cli import main
    from ringsweep.runs.task_sizes import TaskSizes

    library = ctypes.CDLL(os.environ["HOSTILE_FAULTS"])
    report = Report()
    config = configuration(folder / "sweep.yaml", 6, 5)
    # Three tasks of the same cells in every run.
    TaskSizes.next = lambda self, left: 10  # type: ignore[method-assign]
    work = folder / "work"
    target = work / "out.nc"
    prefix = str(work).encode()
    verbs = {"run": [str(config), "--jobs", "1"], "simulate": [str(config)]}
    for verb, given in verbs.items():
        arguments = [verb, *given, "-o", str(target)]
        reference = folder / f"{verb}.nc"
        here(verb, *given, "-o", reference)

        def armed(at: int, code: int, onwards: int, arguments: list[str] = arguments) -> int:
            library.arm(prefix, at, code, onwards)
            status = main(arguments)
            library.arm(b"", 0, 0, 0)
            failed = ctypes.c_char * 256
            print("counted", library.counted(), failed.in_dll(library, "failed").value.decode())
            return status

        def dry(arguments: list[str] = arguments) -> int:
            library.arm(prefix, 0, 0, 0)
            main(arguments)
            print("counted", library.counted())
            return 0

        work.mkdir()
        calls = int(end(start(dry)).last.split()[1])
        shutil.rmtree(work)
        share = max(count // (len(verbs) * len(FAULTS)), 1)
        for fault, (code, onwards) in FAULTS.items():
            for at in range(1, calls + 1, max(calls // share, 1)):
                work.mkdir()
                ended = end(start(lambda at=at, code=code, onwards=onwards: armed(at, code, onwards)))
                # When closing a file fails at its last write, or in close itself, the NetCDF library crashes.
                crash = ended.status == -signal.SIGSEGV and "HDF5 objects open" in ended.text
                told = "" if crash else ended.complaint((0, 1, 2))
                what = ended.last.partition("counted ")[2].partition(" ")[2]
                if not told and ended.status == 0 and not same_bits(target, reference):
                    told = "exit status 0, but other numbers"
                again = command(*arguments)
                left = sorted(path.name for path in work.iterdir())
                told = told or (again.complaint((0,)) and f"the next run: {again.complaint((0,))}")
                if not told and not same_bits(target, reference):
                    told = "the next run gives other numbers"
                if not told and left != ["out.nc", "out.png"]:
                    told = f"left behind: {', '.join(left)}"
                outcome = "told, and continued" if ended.status else "passed over"
                if crash:
                    outcome = "the NetCDF library crashed in closing the file; continued"
                problem = f"faults, {verb}, {fault}, call {at} of {calls} ({what}): {told}" if told else ""
                report.add(f"{verb}, {fault}: {outcome}", problem)
                shutil.rmtree(work)
    return report


def _with_library(folder: Path, count: int, seed: int) -> Report:
    """The same in a process with the library that lets calls fail, which is compiled here."""
    compiler = shutil.which("cc") or shutil.which("gcc")
    if compiler is None or sys.platform != "linux":
        return Report({"left out: no C compiler, or not Linux": 1})  # type: ignore[arg-type]
    with tempfile.TemporaryDirectory() as name:
        library = Path(name) / "fault.so"
        subprocess.run([compiler, "-shared", "-fPIC", "-O1", "-o", library, _SOURCE, "-ldl"], check=True)
        environment = os.environ | {"HOSTILE_FAULTS": str(library), "LD_PRELOAD": str(library)}
        program = "from benchmarks.hostile.faults import child; child()"
        arguments = [sys.executable, "-c", program, str(folder), str(count), str(seed)]
        found = subprocess.run(arguments, env=environment, capture_output=True, text=True, check=False)
    return _read(found)


def child() -> None:
    """Run the attack in this process, which has the library, and print the report."""
    folder, count, seed = sys.argv[1:]
    report = faults(Path(folder), int(count), int(seed))
    print(END, repr((dict(report.counts), report.broken)), sep="")


END = "report of the faults: "


def _read(found: subprocess.CompletedProcess[str]) -> Report:
    from ast import literal_eval
    from collections import Counter

    *_, last = found.stdout.splitlines() or [""]
    if not last.startswith(END):
        return Report(broken=[f"faults: the process ended with {found.returncode}: {found.stderr[-2000:]}"])
    counts, broken = literal_eval(last.removeprefix(END))
    return Report(Counter(counts), broken)
