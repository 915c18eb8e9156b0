"""A method: Heun's with a constant step, of order 2."""

from dataclasses import dataclass
from typing import Annotated, ClassVar

import numpy as np

from ringsweep.compile import add_scaled, inlined, kernel, take
from ringsweep.models.interface import constant_step, recorder
from ringsweep.models.interface.status import COMPLETE, RUNNING
from ringsweep.physics import drives
from ringsweep.quantities.parameters import Parameter
from ringsweep.solvers import Method, Result, add_method


@inlined
def _step(scene, y, now, t, h):
    """State one step after `y` at time `t`, and its inspection."""
    forcing = drives.turn(scene.drive, t + h)
    guess = constant_step.inspect(scene, add_scaled(y, h, now.rates), forcing)
    after = add_scaled(add_scaled(y, 0.5 * h, now.rates), 0.5 * h, guess.rates)
    return after, constant_step.inspect(scene, after, forcing)


@kernel
def _run(batch, steps, outcomes, times, rows):
    """Outcomes of every cell; and the history of cell 0, as far as `times` reaches."""
    for i in range(len(outcomes)):
        scene = take(batch, i)
        h = scene.span / steps
        y = constant_step.initial_state(scene)
        forcing = drives.turn(scene.drive, 0.0)
        now = constant_step.inspect(scene, y, forcing)
        record = recorder.begin(scene, 0.0, constant_step.seen(scene, y, now, forcing[2]))
        status, k = RUNNING, 0
        while True:
            t = k * h if k < steps else scene.span
            if i == 0 and k < len(times):
                times[k] = t
                row = constant_step.row(scene, y, drives.turn(scene.drive, t))
                for column in range(len(row)):
                    rows[k, column] = row[column]
            if status != RUNNING or k == steps:
                break
            y_next, after = _step(scene, y, now, t, h)
            status, _ = constant_step.verdict(scene, now, after)
            stuck, seen = constant_step.sticks(scene, now, after), constant_step.seen(scene, y_next, after, 0.0)
            record = recorder.observe(scene, record, t + h, h, stuck, seen)
            y, now, k = y_next, after, k + 1
        outcome = recorder.conclude(scene, record, COMPLETE if status == RUNNING else status, t, y[0], y[1])
        for column in range(min(len(outcome), outcomes.shape[1])):
            outcomes[i, column] = outcome[column]


@dataclass(frozen=True)
class Heun(Method):
    """Heun's method with a constant step."""

    name: ClassVar[str] = "heun"

    steps: Annotated[int, Parameter("1", "steps over the span of time", lower=1, upper=1e8)]

    def needs(self, structure):
        return recorder.MEMBERS + constant_step.MEMBERS

    def run(self, batch, outcomes):
        cells = len(batch.span)
        found = np.empty((cells, len(outcomes)))
        _run(batch, self.steps, found, np.empty(0), np.empty((0, 0)))
        return Result(found, steps=np.full(cells, self.steps), certified=np.zeros(cells, dtype=bool))

    def history(self, batch, samples, width):
        times, rows = np.full(self.steps + 1, np.nan), np.empty((self.steps + 1, width))
        _run(take(batch, slice(0, 1)), self.steps, np.empty((1, 0)), times, rows)
        kept = np.isfinite(times)
        return times[kept], rows[kept]


add_method(Heun)
