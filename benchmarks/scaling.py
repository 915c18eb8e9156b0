"""What a second core is worth: throughput of the sweep engine with one job and with two.

    python -m benchmarks.scaling            # about three minutes
    python -m benchmarks.scaling --quick    # fewer cells and rounds

Grids of the ring of the paper's Fig. 29, under a law that the method takes. On the *even* one all cells are nearly
alike. On the *uneven* one cells that separate early stand beside cells that run to the end, and those that cost most
come last, where a core that has nothing left to do would wait for the other. Both counts of jobs run in turn within
rounds, forwards and backwards, and a ratio is the median of those within the rounds. What the machine itself gives is
measured in the same way: two processes of plain arithmetic against one. What the sweep engine would make of two cores
of its
own follows from CPU seconds, which other work on the machine does not lengthen: its tasks, as they are and in the order
that they are in, dealt to two cores, and all that is done outside of them by one.

Writes `scaling.md` to `benchmarks/results/`; `--quick`, to the current folder.
"""

from __future__ import annotations

import argparse
import multiprocessing
import time
from collections.abc import Iterator
from contextlib import contextmanager
from functools import partial
from pathlib import Path
from statistics import median
from typing import Any
from unittest import mock

import numpy as np

from benchmarks._common import PAPER_STEPS, alternate, bare, configure, family, heading, machine, markdown, ring, table
from ringsweep.runs import sweep
from ringsweep.runs.cells import ComputeCells

RESULTS = Path(__file__).parent / "results"
TARGET = 1.9
#: What the machine must give for the target to say something about the sweep engine.
FREE = 1.95

SMOOTH, STIFF = ({"law": "bengisu-akay", "alpha": alpha, "v0": v0} for alpha, v0 in ((100.0, 0.2), (1e5, 2e-6)))
#: Friction law and options by method.
METHODS: dict[str, tuple[dict[str, Any], dict[str, Any]]] = {
    "rk4": (SMOOTH, {"steps": PAPER_STEPS}),
    "event": ({"law": "stiction"}, {}),
    "implicit": (STIFF, {}),
}


def even(method: str, cells: int) -> Any:
    """Configuration of a grid on which all cells are nearly alike."""
    law, options = METHODS[method]
    points = {"drive.amplitude": np.linspace(2.0, 2.001, cells).tolist()}
    return configure(ring(law), points, method, **options)


def uneven(method: str, cells: int) -> Any:
    """Configuration of a grid of the whole family whose dearest cells come last."""
    law, options = METHODS[method]
    amplitudes, half_angles = map(np.array, zip(*family(round(cells**0.5)), strict=True))
    points = {"drive.amplitude": amplitudes.tolist(), "zone.half_angle": half_angles.tolist()}
    steps = bare(configure(ring(law), points, method, **options))().steps
    order = np.argsort(steps, kind="stable")
    points = {path: np.array(values)[order].tolist() for path, values in points.items()}
    return configure(ring(law), points, method, **options)


def spin(count: int) -> float:
    """Plain arithmetic, so much of it."""
    total = 0.0
    for k in range(count):
        total += k * 0.5
    return total


def what_the_machine_gives(rounds: int, count: int = 5_000_000) -> float:
    """How much more two processes do than one, of work that shares nothing."""
    with multiprocessing.get_context("spawn").Pool(2) as pool:
        pool.map(spin, [1000] * 4)
        runs = {jobs: partial(pool.map, spin, [count * 2 // jobs] * jobs, 1) for jobs in (1, 2)}
        times, _ = alternate(runs, rounds)
    return times[1].ratio(times[2])


@contextmanager
def timed_tasks() -> Iterator[list[float]]:
    """CPU seconds of every task of the sweep engine, in the order in which they end."""
    seconds: list[float] = []
    compute = ComputeCells.__call__

    def timed(*args: Any) -> Any:
        begin = time.thread_time()
        result = compute(*args)
        seconds.append(time.thread_time() - begin)
        return result

    with mock.patch.object(ComputeCells, "__call__", timed):
        yield seconds


def on_free_cores(configuration: Any) -> float:
    """How much faster two cores would be than one, from CPU seconds of one run with two jobs."""
    with timed_tasks() as tasks:
        begin = time.process_time()
        sweep.compute(configuration, jobs=2, progress=False)
        serial = time.process_time() - begin - sum(tasks)
    busy = [0.0, 0.0]
    for seconds in tasks:
        busy[busy.index(min(busy))] += seconds
    return (sum(tasks) + serial) / (max(busy) + serial)


def main() -> None:
    """Measure, print, write."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--quick", action="store_true", help="fewer cells and rounds")
    quick = parser.parse_args().quick
    cells, rounds = (1024, 3) if quick else (4096, 5)
    begin = time.perf_counter()
    where = machine()
    print(where)
    rows = []
    for method in METHODS:
        for grid in (even, uneven):
            configuration = grid(method, cells)
            runs = {jobs: partial(sweep.compute, configuration, jobs=jobs, progress=False) for jobs in (1, 2)}
            runs[2]()
            given = what_the_machine_gives(3)
            times, results = alternate(runs, rounds)
            given = 0.5 * (given + what_the_machine_gives(3))
            ratio = times[1].ratio(times[2])
            free = median(on_free_cores(configuration) for _ in range(rounds))
            steps = results[1].steps.values
            rows.append([
                f"`{method}`, {grid.__name__}", f"{np.quantile(steps, 0.05):.0f} to {np.quantile(steps, 0.95):.0f}",
                *(f"{cells / times[jobs].median:.0f}" for jobs in (1, 2)),
                *(f"{one:.2f}x" for one in (ratio, given, free)),
                "met" if ratio >= TARGET else "MISSED" if given >= FREE else "MISSED, machine not free",
            ])  # fmt: skip
            print(*rows[-1], f"{time.perf_counter() - begin:.0f} s", flush=True)
    header = ["grid", "steps, 90 % of cells", "runs/s, 1 job", "2 jobs", "ratio", "plain arithmetic", "by CPU seconds"]
    header.append(f"≥ {TARGET}")
    heading(f"One core and two, {cells} cells")
    table(header, rows)
    report = "# One core and two\n\n`python -m benchmarks.scaling` on\n\n"
    report += "".join(f"- {line}\n" for line in where.splitlines())
    report += f"""
{cells} cells through the sweep engine, without certificates; medians over {rounds} rounds in which both alternate.
*Plain
arithmetic* is what a second process adds to work that shares nothing, measured right before and after: a machine that
gives less than {FREE} is at work on something else, and says little about the sweep engine. *By CPU seconds* is what
two free
cores would give: the tasks dealt to both in their order, all else done by one.

"""
    folder = Path() if quick else RESULTS
    folder.mkdir(exist_ok=True)
    (folder / "scaling.md").write_text(report + markdown(header, rows))
    print(f"\nscaling.md is in {folder.resolve()}; {time.perf_counter() - begin:.0f} s in all")


if __name__ == "__main__":
    main()
