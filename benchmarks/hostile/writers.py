"""Two writers of one file, and readers meanwhile."""

from __future__ import annotations

import os
import random
import shutil
import time
from pathlib import Path

from benchmarks.hostile.attack import Report, command, configuration, end, here, same_bits, start


def writers(folder: Path, count: int, seed: int) -> Report:
    """Start two processes on the same output, a moment apart, and read the file until both have ended."""
    from ringsweep import InputError, verify
    from ringsweep.cli import main

    draw, report = random.Random(seed), Report()
    config = configuration(folder / "sweep.yaml", 40, 30)
    work = folder / "work"
    target = work / "out.nc"
    for verb in ("run", "simulate"):
        here(verb, config, "-o", folder / f"{verb}.nc")
    span = {}
    for verb in ("run", "simulate"):
        work.mkdir()
        begin = time.monotonic()
        command(verb, config, "-o", target)
        span[verb] = time.monotonic() - begin
        shutil.rmtree(work)
    for number in range(count):
        verb = draw.choice(["run", "run", "simulate"])
        arguments = [verb, str(config), "-o", str(target)]
        work.mkdir()
        processes = [start(lambda arguments=arguments: main(arguments))]
        time.sleep(draw.uniform(0.0, 1.2 * span[verb]))
        processes.append(start(lambda arguments=arguments: main(arguments)))
        problems, reads = [], 0
        while not all(_has_ended(pid) for pid, _ in processes):
            if target.exists():
                reads += 1
                try:
                    verify(target)
                except InputError as error:
                    problems.append(f"a reader found {error}")
            time.sleep(0.005)
        ends = [end(process) for process in processes]
        problems += [complaint for ended in ends if (complaint := ended.complaint((0, 2)))]
        refused = [ended for ended in ends if ended.status == 2]
        problems += [ended.last for ended in refused if "another ringsweep" not in ended.text]
        if len(refused) == 2:
            problems.append("both are refused")
        elif not problems and not same_bits(target, folder / f"{verb}.nc"):
            problems.append("other numbers")
        left = sorted(path.name for path in work.iterdir())
        if left != ["out.nc", "out.png"]:
            problems.append(f"left behind: {', '.join(left)}")
        report.counts["reads of a complete file meanwhile"] += reads
        outcome = "the second is refused" if refused else "both succeed"
        report.add(f"{verb}: {outcome}", f"writers, seed {seed}, number {number}: {problems}" if problems else "")
        shutil.rmtree(work)
    return report


def _has_ended(pid: int) -> bool:
    """Whether a child has ended; it can still be waited for."""
    return os.waitid(os.P_PID, pid, os.WEXITED | os.WNOHANG | os.WNOWAIT) is not None
