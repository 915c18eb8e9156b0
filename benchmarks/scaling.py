"""The gain of a second core: throughput of a sweep with one job and with two.

    python -m benchmarks.scaling            # about three minutes
    python -m benchmarks.scaling --quick    # fewer cells and rounds

The grids are over the ring of the paper's Fig. 29, under a law that the method handles. On the *even* grid all cells
are nearly alike. On the *uneven* grid some cells separate early and some run to the end, and the most expensive cells
come last, where an idle core would have to wait for the other.

One job and two jobs run in turn within each round, forwards and backwards. A ratio is the median of the ratios within
the rounds. The same method measures what the machine itself gives: two processes of plain arithmetic against one.

CPU seconds do not grow with other load on the machine. They tell what two free cores would give: the tasks, in their
order, are assigned to two cores, and everything outside the tasks is done by one core.

Writes `scaling.md`.
"""

from __future__ import annotations

import multiprocessing
import time
from collections.abc import Iterator
from contextlib import contextmanager
from functools import partial
from statistics import median
from typing import Any
from unittest import mock

import numpy as np

from benchmarks._common import (
    PAPER_STEPS,
    alternate,
    bare,
    command,
    configure,
    family,
    heading,
    machine,
    markdown,
    publish,
    ring,
    table,
)
from ringsweep.runs import sweep
from ringsweep.runs.cells import compute_task
from ringsweep.runs.executors import Execution

#: Least ratio of plain arithmetic on a machine that was free for the sweep.
FREE = 1.97

SMOOTH, STIFF = ({"law": "bengisu-akay", "alpha": alpha, "v0": v0} for alpha, v0 in ((100.0, 0.2), (1e5, 2e-6)))
#: Friction law and options by method.
METHODS: dict[str, tuple[dict[str, Any], dict[str, Any]]] = {
    "rk4": (SMOOTH, {"steps": PAPER_STEPS}),
    "event": ({"law": "stiction"}, {}),
    "implicit": (STIFF, {}),
}
#: Cells by method, for sweeps of some seconds.
CELLS = {"rk4": 181**2, "event": 181**2, "implicit": 90**2}


def even(method: str, cells: int) -> Any:
    """Configuration of a grid on which all cells are nearly alike."""
    law, options = METHODS[method]
    side = round(cells**0.5)
    grid = {
        "drive.amplitude": np.linspace(2.0, 2.001, side).tolist(),
        "zone.half_angle": np.linspace(0.26, 0.2601, side).tolist(),
    }
    return configure(ring(law), grid, method, kind="grid", **options)


def uneven(method: str, cells: int) -> Any:
    """Configuration of the whole family of cells, the most expensive cells last."""
    law, options = METHODS[method]
    amplitudes, half_angles = map(np.array, zip(*family(round(cells**0.5)), strict=True))
    points = {"drive.amplitude": amplitudes.tolist(), "zone.half_angle": half_angles.tolist()}
    steps = bare(configure(ring(law), points, method, **options))().steps
    order = np.argsort(steps, kind="stable")
    points = {path: np.array(values)[order].tolist() for path, values in points.items()}
    return configure(ring(law), points, method, **options)


def spin(count: int) -> float:
    """Do `count` steps of plain arithmetic."""
    total = 0.0
    for k in range(count):
        total += k * 0.5
    return total


def what_the_machine_gives(rounds: int, count: int = 5_000_000) -> float:
    """Speed of two processes that share nothing over the speed of one."""
    with multiprocessing.get_context("spawn").Pool(2) as pool:
        pool.map(spin, [1000] * 4)
        runs = {jobs: partial(pool.map, spin, [count * 2 // jobs] * jobs, 1) for jobs in (1, 2)}
        times, _ = alternate(runs, rounds)
    return times[1].ratio(times[2])


@contextmanager
def timed_tasks() -> Iterator[list[float]]:
    """List that collects the CPU seconds of every task of a sweep, in the order in which tasks end."""
    seconds: list[float] = []

    def timed(*args: Any) -> Any:
        begin = time.thread_time()
        result = compute_task(*args)
        seconds.append(time.thread_time() - begin)
        return result

    with mock.patch.object(sweep, "compute_task", timed):
        yield seconds


def on_free_cores(configuration: Any) -> float:
    """Speed of two free cores over the speed of one, from the CPU seconds of one run with two jobs."""
    with timed_tasks() as tasks:
        begin = time.process_time()
        sweep.compute(configuration, Execution(2, progress=False))
        serial = time.process_time() - begin - sum(tasks)
    busy = [0.0, 0.0]
    for seconds in tasks:
        busy[busy.index(min(busy))] += seconds
    return (sum(tasks) + serial) / (max(busy) + serial)


def main() -> None:
    """Measure, print, write."""
    given = command(__doc__).parse_args()
    quick = given.quick
    rounds = 3 if quick else 5
    begin = time.perf_counter()
    where = machine()
    print(where)
    rows = []
    for method in METHODS:
        cells = CELLS[method] // (9 if quick else 1)
        for grid in (even, uneven):
            configuration = grid(method, cells)
            runs = {jobs: partial(sweep.compute, configuration, Execution(jobs, progress=False)) for jobs in (1, 2)}
            runs[2]()
            plain = what_the_machine_gives(3)
            times, results = alternate(runs, rounds)
            plain = 0.5 * (plain + what_the_machine_gives(3))
            ratio = times[1].ratio(times[2])
            free = median(on_free_cores(configuration) for _ in range(rounds))
            steps = results[1].steps.values
            rows.append([
                f"`{method}`, {grid.__name__}", str(steps.size),
                f"{np.quantile(steps, 0.05):.0f} to {np.quantile(steps, 0.95):.0f}",
                *(f"{steps.size / times[jobs].median:.0f}" for jobs in (1, 2)),
                *(f"{one:.2f}x" for one in (ratio, plain, free)),
            ])  # fmt: skip
            print(*rows[-1], f"{time.perf_counter() - begin:.0f} s", flush=True)
    header = ["grid", "cells", "steps, 90 % of cells", "runs/s, 1 job", "2 jobs", "ratio", "plain arithmetic"]
    header += ["by CPU seconds"]
    heading("One core and two")
    table(header, rows)
    about = f"""
Sweeps without certificates; medians over {rounds} rounds, in which one job and two jobs alternate.
*Plain arithmetic* is the speed of two processes that share nothing over the speed of one, measured right before and
after. If it is less than {FREE}, the machine was busy with something else, and the ratio says little about the sweep.
*By CPU seconds* is the ratio that two free cores would give: the tasks assigned to both cores in their order, and
everything else done by one core.

"""
    publish(given, "scaling", "One core and two", where, about + markdown(header, rows))


if __name__ == "__main__":
    main()
