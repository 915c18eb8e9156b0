"""Runge-Kutta 4 with a constant step: what the paper used, as a kernel over a batch of cells.

It knows no events: a step across an arc edge, a reversal or the stiction band is taken as if the
right-hand side were smooth. ``stiffness`` tells where that is beyond the limit of stability.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, Any, ClassVar, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ringsweep.errors import InputError
from ringsweep.hooks import begin, conclude, describe, inspect, launch, observe, rates, stiffness, verdict
from ringsweep.jit import add_scaled, inlined, kernel, take
from ringsweep.parameters import Parameter
from ringsweep.physics.drives import lookup, shape, turn
from ringsweep.physics.friction import LAWS, WITH_SNAPS
from ringsweep.regimes import COMPLETE, RUNNING
from ringsweep.scene import Structure
from ringsweep.solvers.common import Method, Result, agree, same_drive

#: End of the interval of stability on the negative real axis.
STABILITY_LIMIT = 2.785

# Steps between two visits of a cell: the drive's table of so many steps stays in the cache.
_BLOCK = 1024


@dataclass(frozen=True)
class RK4(Method):
    """Constant-step Runge-Kutta 4."""

    name: ClassVar[str] = "rk4"

    steps: Annotated[int, Parameter("1", "steps over the span of time", lower=1, upper=1e10)]
    certify: bool = True
    """Whether cells within the limit of stability are run again at half the step."""

    def check(self, structure: Structure) -> None:
        """Refuse a law that changes at instants which no constant step meets."""
        if LAWS[structure.law] in WITH_SNAPS:
            raise InputError(
                "solver.method", f"rk4 does not take friction law {structure.law}, whose bonds snap: auto takes it"
            )

    def run(self, batch: Any, outcomes: tuple[str, ...]) -> Result:
        """Outcomes of every cell; see :class:`ringsweep.solvers.common.Method`."""
        cells = len(batch.span)
        rows, report = self._integrate(batch, np.arange(cells), self.steps, len(outcomes))
        certified = np.zeros(cells, dtype=bool)
        if self.certify:
            # Beyond the limit of stability a second run agrees with the first for the wrong reason.
            stable = np.flatnonzero(report[:, 1] <= STABILITY_LIMIT)
            if len(stable):
                half, finer = self._integrate(batch, stable, 2 * self.steps, len(outcomes))
                certified[stable] = agree(rows[stable], half, outcomes) & (finer[:, 1] <= STABILITY_LIMIT)
        return Result(rows, steps=report[:, 0], stiffness=report[:, 1], certified=certified)

    def _integrate(
        self, batch: Any, cells: NDArray[np.intp], steps: int, width: int
    ) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        rows = np.empty((len(batch.span), width))
        report = np.empty((len(batch.span), 2))
        for group in same_drive(batch, cells):
            _integrate(batch, group, steps, rows, report)
        return rows[cells], report[cells]

    def history(self, batch: Any, samples: int, width: int) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Times and rows of the history of cell 0; see :class:`ringsweep.solvers.common.Method`."""
        stride = max(1, self.steps // samples)
        rows = np.empty((self.steps // stride + 2, width))
        times = np.empty(len(rows))
        count = _history(batch, self.steps, stride, times, rows)
        return times[:count], rows[:count]


class _Run(NamedTuple):
    """A cell between two blocks of steps."""

    status: int
    t: float
    y: Any
    now: Any
    record: Any
    steps: float
    stiffness: float


@inlined
def _tabulate(table, drive, first, steps, h):
    """Fill `table` with the drive's shape at whole and half steps from step `first` on."""
    for k in range(2 * steps + 1):
        table[k, 0], table[k, 1], _ = shape(drive, (first + 0.5 * k) * h)


@inlined
def _step(scene, y, k1, table, k, h):
    """State one step after `y`; row `k` of `table` holds the drive at its beginning."""
    theta, ring_omega = lookup(scene.drive, table, k + 1)
    k2 = rates(scene, add_scaled(y, 0.5 * h, k1), theta, ring_omega)
    k3 = rates(scene, add_scaled(y, 0.5 * h, k2), theta, ring_omega)
    theta, ring_omega = lookup(scene.drive, table, k + 2)
    k4 = rates(scene, add_scaled(y, h, k3), theta, ring_omega)
    total = add_scaled(add_scaled(add_scaled(k1, 2.0, k2), 2.0, k3), 1.0, k4)
    return add_scaled(y, h / 6.0, total)


@inlined
def _hermite(y, rate, y_next, rate_next, h, x):
    """Cubic through both ends of a step, at the fraction `x` of it."""
    a = (1.0 + 2.0 * x) * (1.0 - x) * (1.0 - x)
    b = x * x * (3.0 - 2.0 * x)
    c = x * (1.0 - x) * (1.0 - x) * h
    d = x * x * (x - 1.0) * h
    zero = add_scaled(y, -1.0, y)
    return add_scaled(add_scaled(add_scaled(add_scaled(zero, a, y), b, y_next), c, rate), d, rate_next)


@inlined
def _advance(scene, run, table, first, steps, h):
    """Take a run through `steps` steps from step number `first` on, or to its end."""
    y, now, record, worst = run.y, run.now, run.record, run.stiffness
    for k in range(steps):
        y_next = _step(scene, y, now.rates, table, 2 * k, h)
        theta, ring_omega = lookup(scene.drive, table, 2 * k + 2)
        after = inspect(scene, y_next, theta, ring_omega)
        status, fraction = verdict(scene, now, after)
        worst = max(worst, stiffness(scene, now, after, h))
        if status != RUNNING:
            y_end = _hermite(y, now.rates, y_next, after.rates, h, fraction)
            t = (first + k + fraction) * h
            record = observe(scene, record, y_end, now, after, t, fraction * h)
            return _Run(status, t, y_end, after, record, first + k + 1.0, worst)
        record = observe(scene, record, y_next, now, after, (first + k + 1) * h, h)
        y, now = y_next, after
    return _Run(RUNNING, (first + steps) * h, y, now, record, float(first + steps), worst)


@kernel
def _integrate(batch, cells, steps, rows, report):
    """Run `cells` of a batch, all with the same shape of drive and span, for `steps` steps."""
    first = take(batch, cells[0])
    h = first.span / steps
    table = np.empty((2 * min(_BLOCK, steps) + 1, 2))
    _tabulate(table, first.drive, 0, 0, h)
    runs = []
    for i in cells:
        scene = take(batch, i)
        y = launch(scene)
        theta, ring_omega = lookup(scene.drive, table, 0)
        now = inspect(scene, y, theta, ring_omega)
        status, _ = verdict(scene, now, now)
        runs.append(_Run(status, 0.0, y, now, begin(scene, y, now), 0.0, 0.0))
    for start in range(0, steps, _BLOCK):
        size = min(_BLOCK, steps - start)
        _tabulate(table, first.drive, start, size, h)
        for j in range(len(cells)):
            if runs[j].status == RUNNING:
                runs[j] = _advance(take(batch, cells[j]), runs[j], table, start, size, h)
    for j in range(len(cells)):
        run = runs[j]
        scene = take(batch, cells[j])
        status = COMPLETE if run.status == RUNNING else run.status
        # Not the rounding of a sum of steps.
        t = scene.span if status == COMPLETE else run.t
        outcome = conclude(scene, run.record, status, t, run.y)
        for column in range(len(outcome)):
            rows[cells[j], column] = outcome[column]
        report[cells[j], 0] = run.steps
        report[cells[j], 1] = run.stiffness


@kernel
def _history(batch, steps, stride, times, rows):
    """Rows of every `stride`-th step of cell 0 up to its end; returns their number."""
    scene = take(batch, 0)
    h = scene.span / steps
    table = np.empty((3, 2))
    y = launch(scene)
    _tabulate(table, scene.drive, 0, 1, h)
    theta, ring_omega = lookup(scene.drive, table, 0)
    now = inspect(scene, y, theta, ring_omega)
    status, _ = verdict(scene, now, now)
    count = 0
    for k in range(steps + 1):
        if k % stride == 0 or k == steps or status != RUNNING:
            times[count] = k * h if k < steps else scene.span
            row = describe(scene, y, theta, ring_omega)
            for column in range(len(row)):
                rows[count, column] = row[column]
            count += 1
        if k == steps or status != RUNNING:
            break
        _tabulate(table, scene.drive, k, 1, h)
        y_next = _step(scene, y, now.rates, table, 0, h)
        theta, ring_omega = lookup(scene.drive, table, 2)
        after = inspect(scene, y_next, theta, ring_omega)
        status, fraction = verdict(scene, now, after)
        if status != RUNNING:
            # The history ends where the run does, within the step.
            times[count] = (k + fraction) * h
            theta, ring_omega, _ = turn(scene.drive, times[count])
            row = describe(scene, _hermite(y, now.rates, y_next, after.rates, h, fraction), theta, ring_omega)
            for column in range(len(row)):
                rows[count, column] = row[column]
            return count + 1
        y, now = y_next, after
    return count
