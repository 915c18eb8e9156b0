"""Runge-Kutta 4 with a constant step, the method of the paper, over a batch of cells.

The method does not locate events. It steps across the edge of a zone, a reversal or the stiction band as if the
equations were smooth. ``stiffness`` shows which runs exceed the limit of stability.

Read :mod:`ringsweep.models.interface.constant_step` first. `now` is the inspection at the beginning of a step. WIDTH
runs of a block advance side by side in vector lanes; `k` counts the steps of a stretch.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from math import inf
from typing import Annotated, Any, ClassVar, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ringsweep.compile import Cells, absorbed, add_scaled, feature, inlined, kernel, put, take
from ringsweep.errors import InputError
from ringsweep.models.interface import constant_step, recorder
from ringsweep.models.interface.status import COMPLETE, RUNNING
from ringsweep.models.scene import Structure
from ringsweep.numerics.functions import any_of, select
from ringsweep.numerics.lanes import WIDTH
from ringsweep.numerics.memory import align_stack, conform, read, read_lanes, side_by_side, size_of, write
from ringsweep.numerics.rows import distinct_rows
from ringsweep.numerics.terms import joined
from ringsweep.physics.drives import lookup, pass_knot, shape_numbers, table_row, turn, without_shape
from ringsweep.physics.friction import TRAITS
from ringsweep.quantities.flags import CERTIFIED, COARSE, FAILED, NO_RESULT, NOT_ASKED, SEPARATING
from ringsweep.quantities.parameters import Parameter
from ringsweep.solvers.certificate import TwoRuns, apart, judged, with_errors
from ringsweep.solvers.method import Method, Result

#: Radius of the largest half disc in the left half plane in which the method is stable (more exactly 2.616). On the
#: real axis the method is stable up to 2.785.
STABILITY_LIMIT = 2.61

# Largest error of a run, in units of its difference from the run at half the step; and share of the largest relative
# difference that counts in every number. Where friction jumps, the order is one at best, and errors of both runs are
# erratic.
_SAFETY, _SHARE_OF_LARGEST = 20.0, 0.7

# Runs that differ by more than this share of the scale of a number have diverged.
_MOST_APART = 1e-2

# Largest share of the narrowest segment of the surface that a step of a certified run slides across.
_MOST_ARC_SHARE = 0.5

# Number of steps that a run takes before the next run continues. The table of the drive for these steps fits the cache.
_BLOCK = 512

# Largest number of columns of the table of a drive.
_MOST_COLUMNS = 3

# Number of steps after which an inspection takes nothing over from the one before.
_CARRIED = 64


@dataclass(frozen=True)
class RK4(Method):
    """Constant-step Runge-Kutta 4."""

    name: ClassVar[str] = "rk4"
    side_by_side: ClassVar[int] = WIDTH

    steps: Annotated[int, Parameter("1", "steps over the span of time", lower=1, upper=1e10)]
    certify: bool = True
    """Whether to run the cells within the limit of stability again at half the step, for their certificates."""
    diagnose: bool = True
    """Whether to record the stiffness of each run; without it no run is certified."""

    def needs(self, structure: Structure) -> tuple[Any, ...]:
        """Functions for steps of constant length, in vector lanes."""
        return recorder.MEMBERS + constant_step.MEMBERS

    def check(self, structure: Structure) -> None:
        """Refuse laws whose bonds snap, since a constant step does not locate the instants.

        Raises
        ------
        InputError
            If the method does not take the friction law; and as in :meth:`Method.check`.
        """
        for refused, problem in (
            (
                TRAITS[structure.law_type].snaps,
                f"does not take friction law {structure.law}: its bonds snap; auto takes it",
            ),
            (
                structure.impact,
                "does not rebound from stops: auto does; or leave scene.stops out"
                if structure.model == "belt"
                else "does not go on after a contact is lost: auto does; or leave scene.impact out",
            ),
            (structure.exponent, "locates no events, at which disturbances jump: auto gives record.exponent"),
            (structure.section, "locates no instants for record.section: auto does"),
        ):
            if refused:
                raise InputError("solver.method", f"rk4 {problem}")
        super().check(structure)

    def run(self, batch: Any, outcomes: tuple[str, ...]) -> Result:
        """Outcomes of every cell, and steps of the first run; see :meth:`ringsweep.solvers.method.Method.run`."""
        cells = len(batch.span)
        rows, report = self._integrate(batch, np.arange(cells), self.steps, len(outcomes))
        because, bounds = np.full(cells, NOT_ASKED, dtype=np.int8), None
        if not self.diagnose:
            return Result(rows, steps=report[:, 0], certified=because == CERTIFIED, because=because)
        if self.certify:
            bounds = np.full((cells, len(with_errors(outcomes))), np.nan)
            failed = rows[:, outcomes.index("regime")] == FAILED
            because = np.where(failed, NO_RESULT, COARSE).astype(np.int8)
            # Beyond the limit of stability both runs may agree although both are wrong. A run that ends at t = 0 has no
            # step to check.
            stable = np.flatnonzero((report[:, 1] <= STABILITY_LIMIT) & (report[:, 0] > 0.0))
            if len(stable):
                half_rows, half_report = self._integrate(batch, stable, 2 * self.steps, len(outcomes))
                whole = len(stable) == cells
                stable_batch, stable_rows = (batch, rows) if whole else (take(batch, stable), rows[stable])
                runs = TwoRuns(stable_batch, stable_rows, half_rows, outcomes)
                # A reaction may vanish between two steps.
                contacts_held = (half_report[:, 2] > 0.0) | (half_rows[:, outcomes.index("regime")] == SEPARATING)
                # A narrow zone may lie between two steps.
                trusted = (
                    contacts_held & (half_report[:, 1] <= STABILITY_LIMIT) & (half_report[:, 4] <= _MOST_ARC_SHARE)
                )
                because[stable], bounds[stable] = judged(
                    runs,
                    half_report[:, 3],
                    apart(runs) > _MOST_APART,
                    (~trusted, COARSE),
                    safety=_SAFETY,
                    share=_SHARE_OF_LARGEST,
                    steps=report[stable, 0],
                )
        return Result(
            rows,
            steps=report[:, 0],
            certified=because == CERTIFIED,
            because=because,
            stiffness=report[:, 1],
            errors=bounds,
        )

    def _integrate(
        self, batch: Any, cells: NDArray[np.intp], steps: int, width: int
    ) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Rows of outcomes and reports of these cells with so many steps; see :class:`Results` for the columns."""
        results = Results(np.empty((len(batch.span), width)), np.empty((len(batch.span), 5)))
        diagnosed = Diagnosed() if self.diagnose else ()
        scenes, launches = prepare(batch)
        for group in _groups_by_drive(batch, cells):
            integrate(diagnosed, scenes, launches, take(batch.drive, group[0]), group, steps, results)
        return results.rows[cells], results.report[cells]

    def history(self, batch: Any, samples: int, width: int) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Times and rows of the history of cell 0; see :meth:`ringsweep.solvers.method.Method.history`."""
        interval = max(1, self.steps // samples)
        rows = np.empty((self.steps // interval + 2, width))
        times = np.empty(len(rows))
        count = _history(Cells(batch), self.steps, interval, times, rows)
        return times[:count], rows[:count]


def _groups_by_drive(batch: Any, cells: NDArray[np.intp]) -> Iterator[NDArray[np.intp]]:
    """Groups of `cells` with the same span and the same drive but for its amplitude."""
    _, group = distinct_rows(column[cells] for column in (batch.span, *shape_numbers(batch.drive)))
    order = np.argsort(group, kind="stable")
    yield from np.split(cells[order], np.flatnonzero(np.diff(group[order])) + 1)


# State of a run: it goes on; it is finished; it ends in the next step; floats have shown that it does not end there.
LIVE, FINISHED, ENDING, CHECKED = 1.0, 0.0, 2.0, -1.0


class Diagnosed(NamedTuple):
    """Marks that a :class:`Diagnosis` of each run is made; an empty tuple in its place says that none is."""


class Diagnosis(NamedTuple):
    """Largest eigenvalue, 1/s, least margin of the guards, and largest share of a zone in a step, over a run."""

    eigenvalue: Any
    margin: Any
    arc_share: Any


@feature("diagnosis", absorb=True)
def _diagnose(diagnosed, scene, diagnosis, before, now, h):
    """Diagnosis of a run after one more step."""
    return Diagnosis(
        constant_step.eigenvalue(scene, before, now, h, diagnosis.eigenvalue),
        min(diagnosis.margin, constant_step.margin(scene, before, now)),
        max(diagnosis.arc_share, constant_step.arc_share(scene, now, h)),
    )


class Results(NamedTuple):
    """Arrays that the runs of a batch fill.

    Attributes
    ----------
    rows : ndarray of shape ``(cells, outcomes)``
        Outcomes.
    report : ndarray of shape ``(cells, 5)``
        Number of steps, largest stiffness, least margin, rate at which the guard that ended the run fell, and largest
        share of a zone.
    """

    rows: Any
    report: Any


class _Buffers(NamedTuple):
    """What kernels work in.

    Attributes
    ----------
    table : ndarray
        Shape of the drive and its rate, at whole and half steps; see :func:`_fill_table`.
    memory : ndarray of shape ``(blocks of runs, numbers of a scene and a run, WIDTH)``
        Runs side by side.
    occupants : ndarray of int
        Cells whose runs are stored there, in order.
    """

    table: Any
    memory: Any
    occupants: Any


class _Stretch(NamedTuple):
    """Steps for which the table of the drive is filled.

    Index of the first one, their number, their length, s, and whether the span ends with them.
    """

    first: int
    steps: int
    h: float
    is_last: bool


class _Block(NamedTuple):
    """Runs side by side: the memory, flat, and where they begin there; their cells; and an example of a run."""

    memory: Any
    at: int
    cells: Any
    sample: Any


class _Run(NamedTuple):
    """A run, or several runs side by side: state, inspection, record, diagnosis, and whether the run goes on."""

    y: Any
    now: Any
    record: Any
    diagnosis: Any
    live: Any


class _End(NamedTuple):
    """End of a run: status, time, s, steps taken, and rate at which the guard that ended it fell."""

    status: int
    t: float
    steps: float
    fall_rate: float


@inlined
def _fill_table(table, drive, first, steps, h):
    """Fill `table` with the shape of the drive and its rate, at whole and half steps from step `first` on."""
    for k in range(2 * steps + 1):
        pass_knot(drive, (first + 0.5 * k) * h)
        row = table_row(drive, (first + 0.5 * k) * h)
        for column in range(len(row)):
            table[k, column] = row[column]


@kernel
def _tabulate(table, drive, stretch):
    """Fill `table` for all runs; see :func:`_fill_table`."""
    _fill_table(table, drive, stretch.first, stretch.steps, stretch.h)


@absorbed
def _step_by_rk4(scene, y, now, table, k, h):
    """State at the end of a step, by Runge-Kutta 4; row `k` of `table` is the drive at the beginning."""
    k1 = now.rates
    forcing = lookup(scene.drive, table, k + 1)
    k2 = constant_step.rates(scene, now, add_scaled(y, 0.5 * h, k1), forcing)
    k3 = constant_step.rates(scene, now, add_scaled(y, 0.5 * h, k2), forcing)
    k4 = constant_step.rates(scene, now, add_scaled(y, h, k3), lookup(scene.drive, table, k + 2))
    total = add_scaled(add_scaled(add_scaled(k1, 2.0, k2), 2.0, k3), 1.0, k4)
    return add_scaled(y, h / 6.0, total)


@inlined
def _hermite(y, rate, y_next, rate_next, h, x):
    """State at the fraction `x` of a step, by the cubic through states and rates at both ends."""
    a = (1.0 + 2.0 * x) * (1.0 - x) * (1.0 - x)
    b = x * x * (3.0 - 2.0 * x)
    c = x * (1.0 - x) * (1.0 - x) * h
    d = x * x * (x - 1.0) * h
    zero = add_scaled(y, -1.0, y)
    return add_scaled(add_scaled(add_scaled(add_scaled(zero, a, y), b, y_next), c, rate), d, rate_next)


@inlined
def _step_to_end(scene, y, now, table, k, h):
    """``(status, fraction, y, inspection)`` after a step, or after the fraction of it in which the run ends.

    The inspection is that at the end of the whole step.
    """
    y_next = _step_by_rk4(scene, y, now, table, k, h)
    after = constant_step.inspect(scene, y_next, lookup(scene.drive, table, k + 2))
    status, fraction = constant_step.verdict(scene, now, after)
    if status != RUNNING:
        y_next = _hermite(y, now.rates, y_next, after.rates, h, fraction)
    return status, fraction, y_next, after


@inlined
def _advance_lanes(diagnosed, batch, block, table, stretch, k):
    """Advance runs side by side from step `k` to the end of a stretch, or to a step in which a run ends.

    Returns the index of the first step that was not taken.
    """
    align_stack()
    one, (first, steps, h, _) = take(batch, block.cells[0]), stretch
    runs_at = block.at + WIDTH * size_of(one)
    scene = read_lanes(block.memory, block.at, one)
    y, now, record, diagnosis, live = read_lanes(block.memory, runs_at, block.sample)
    while k < steps:
        y_next = _step_by_rk4(scene, y, now, table, 2 * k, h)
        forcing = lookup(scene.drive, table, 2 * k + 2)
        afresh = (first + k + 1) % _CARRIED == 0
        after = conform(constant_step.inspect_next(scene, now, y_next, forcing, afresh), now)
        ended = live > select(constant_step.holds(scene, after), 1.0, 0.0)
        if any_of(ended):
            live = select(ended, ENDING, live)
            break
        diagnosis = conform(_diagnose(diagnosed, scene, diagnosis, now, after, h), diagnosis)
        stuck, seen = constant_step.sticks(scene, now, after), constant_step.seen(scene, y_next, after, 0.0)
        record = conform(recorder.observe(scene, record, (first + k + 1) * h, h, stuck, seen), record)
        y, now, live = y_next, after, abs(live)
        k += 1
    write(block.memory, runs_at, WIDTH, _Run(y, now, record, diagnosis, live))
    return k


@inlined
def _finish_ended(diagnosed, batch, block, table, stretch, k, results):
    """Finish the runs that end in step `k`, one by one with floats; return the number of runs that go on."""
    first, _, h, _ = stretch
    running = 0
    for lane in range(len(block.cells)):
        scene = take(batch, block.cells[lane])
        start = block.at + WIDTH * size_of(scene) + lane
        run = read(block.memory, start, WIDTH, block.sample)
        live = run.live
        if live == ENDING:
            status, fraction, y_end, after = _step_to_end(scene, run.y, run.now, table, 2 * k, h)
            # Vector lanes and floats differ in the last bit, so that with floats the run may not end in this step.
            live = CHECKED
            if status != RUNNING:
                live = FINISHED
                diagnosis = _diagnose(diagnosed, scene, run.diagnosis, run.now, after, h)
                t = (first + k + fraction) * h
                stuck, seen = constant_step.sticks(scene, run.now, after), constant_step.seen(scene, y_end, after, 0.0)
                record = recorder.observe(scene, run.record, t, fraction * h, stuck, seen)
                # The margin does not cover the contact that separates in this step.
                diagnosis = Diagnosis(diagnosis.eigenvalue, run.diagnosis.margin, diagnosis.arc_share)
                end = _End(status, t, first + k + 1.0, constant_step.fall_rate(scene, run.now, after, h))
                _store_outcome(scene, _Run(y_end, after, record, diagnosis, live), end, h, block.cells[lane], results)
            write(block.memory, start, WIDTH, _Run(run.y, run.now, run.record, run.diagnosis, live))
        running += int(live != FINISHED)
    return running


@inlined
def _store_outcome(scene, run, end, h, cell, results):
    """Store outcome and report of a run."""
    outcome = recorder.conclude(scene, run.record, end.status, end.t, run.y[0], run.y[1])
    rows, report, diagnosis = results.rows, results.report, run.diagnosis
    for column in range(len(outcome)):
        rows[cell, column] = outcome[column]
    recorder.keep_memory(scene, rows[cell], len(outcome), run.y)
    report[cell, 0], report[cell, 1], report[cell, 2] = end.steps, diagnosis.eigenvalue * h, diagnosis.margin
    report[cell, 3], report[cell, 4] = end.fall_rate, diagnosis.arc_share


def prepare(batch: Any) -> tuple[Any, Any]:
    """Cells as :func:`integrate` takes them.

    Returns
    -------
    tuple
        The cells, each number in an array of its own, with drives from which the shape is removed: so the kernels are
        compiled once for all drives. And the launches: a tuple with an array of shape ``(cells,)`` for the acceleration
        of the drive, and for each component of the initial states.
    """
    components = len(constant_step.initial_state(take(batch, 0)))
    launches = tuple(np.empty(len(batch.span)) for _ in range(1 + components))
    _launch(Cells(batch), launches)
    return Cells(side_by_side(batch._replace(drive=without_shape(batch.drive)))), launches


@kernel
def _launch(batch, launches):
    """Fill `launches`; see :func:`prepare`."""
    for cell in range(len(launches[0])):
        scene = take(batch, cell)
        # A run before this one has left its last piece.
        pass_knot(scene.drive, 0.0)
        put(launches, cell, joined((turn(scene.drive, 0.0)[2],), constant_step.initial_state(scene)))


def integrate(
    diagnosed: Any, batch: Any, launches: Any, drive: Any, cells: NDArray[np.intp], steps: int, results: Results
) -> None:
    """Run the given cells of a batch, which have the same span and the same drive but for its amplitude.

    Parameters
    ----------
    diagnosed : Diagnosed or tuple
        Whether the diagnosis of each run is recorded; an empty tuple if not.
    batch, launches : nested tuple of ndarray
        Cells and their launches, from :func:`prepare`.
    drive : NamedTuple
        Drive of one of the cells.
    cells : ndarray of int
        Indices of the cells.
    steps : int
        Number of steps over the span.
    results : Results
        Filled for these cells.
    """
    h = float(batch.batch.span[cells[0]]) / steps
    table = np.empty((2 * min(_BLOCK, steps) + 1, len(table_row(drive, 0.0))))
    _tabulate(table, drive, _Stretch(0, 0, h, False))
    memory, occupants, live = _start(batch, launches, cells, table, results)
    buffers = _Buffers(table, memory, occupants)
    for first in range(0, steps, _BLOCK):
        if live == 0:
            return
        stretch = _Stretch(first, min(_BLOCK, steps - first), h, first + _BLOCK >= steps)
        _tabulate(table, drive, stretch)
        live = _advance_block(diagnosed, batch, launches, buffers, live, stretch, results)


@kernel
def _start(batch, launches, cells, table, results):
    """Store runs in memory, side by side in blocks, and finish the runs that end at t = 0.

    Returns
    -------
    tuple
        Memory and occupants, as in :class:`_Buffers`; the number of runs that go on.
    """
    sample = _initial_run(batch, launches, cells[0], table)
    in_scene = size_of(take(batch, cells[0]))
    numbers = in_scene + size_of(sample)
    blocks = (len(cells) + WIDTH - 1) // WIDTH
    memory = np.zeros((blocks, numbers, WIDTH))
    flat_memory = memory.reshape(memory.size)
    occupants = np.full(blocks * WIDTH, cells[0])
    live = 0
    for i in cells:
        scene, run = take(batch, i), _initial_run(batch, launches, i, table)
        status, _ = constant_step.verdict(scene, run.now, run.now)
        if status != RUNNING:
            _store_outcome(scene, run, _End(status, 0.0, 0.0, 0.0), 0.0, i, results)
            continue
        at = live // WIDTH * numbers * WIDTH + live % WIDTH
        write(flat_memory, at, WIDTH, scene)
        write(flat_memory, at + WIDTH * in_scene, WIDTH, run)
        occupants[live] = i
        live += 1
    return memory, occupants, live


@kernel
def _advance_block(diagnosed, batch, launches, buffers, live, stretch, results):
    """Advance all runs by a stretch of steps and close the gaps of finished runs; return the number of other runs.

    The last stretch finishes all.
    """
    table, memory, occupants = buffers
    numbers = memory.shape[1]
    flat_memory = memory.reshape(memory.size)
    sample = _initial_run(batch, launches, occupants[0], table)
    for start in range(0, live, WIDTH):
        block = _Block(flat_memory, start * numbers, occupants[start : start + WIDTH], sample)
        k, running = 0, WIDTH
        while running > 0:
            k = _advance_lanes(diagnosed, batch, block, table, stretch, k)
            if k == stretch.steps:
                break
            running = _finish_ended(diagnosed, batch, block, table, stretch, k, results)
    remaining = 0
    for slot in range(live):
        if memory[slot // WIDTH, numbers - 1, slot % WIDTH] == FINISHED:
            continue
        if stretch.is_last:
            scene = take(batch, occupants[slot])
            at = (slot // WIDTH * numbers + size_of(scene)) * WIDTH + slot % WIDTH
            # The sum of the steps would miss the end of the span by rounding.
            end = _End(COMPLETE, scene.span, float(stretch.first + stretch.steps), 0.0)
            _store_outcome(scene, read(flat_memory, at, WIDTH, sample), end, stretch.h, occupants[slot], results)
        else:
            # A slice would add the code for errors about shapes, which takes a second to compile.
            for number in range(numbers):
                memory[remaining // WIDTH, number, remaining % WIDTH] = memory[slot // WIDTH, number, slot % WIDTH]
            occupants[remaining] = occupants[slot]
            remaining += 1
    # Empty places of the last block are computed too, but not read.
    for slot in range(remaining, live):
        memory[slot // WIDTH, numbers - 1, slot % WIDTH] = FINISHED
    return remaining


@inlined
def _inspection_at_launch(scene, y, table):
    """Inspection of the state at t = 0; a run may end there."""
    forcing = lookup(scene.drive, table, 0)
    return constant_step.at_once(scene, y, forcing, constant_step.inspect(scene, y, forcing))


@inlined
def _initial_run(batch, launches, cell, table):
    """Run of a cell at t = 0. With any table it also serves as an example of the type."""
    scene, launch = take(batch, cell), take(launches, cell)
    y = launch[1:]
    now = _inspection_at_launch(scene, y, table)
    record = recorder.begin(scene, 0.0, constant_step.seen(scene, y, now, launch[0]))
    return _Run(y, now, record, Diagnosis(0.0, inf, 0.0), LIVE)


@kernel
def _history(batch, steps, interval, times, rows):
    """Fill `times` and `rows` with every `interval`-th step of cell 0, and its end; return the number of rows."""
    scene = take(batch, 0)
    h = scene.span / steps
    table = np.empty((3, _MOST_COLUMNS))
    y = constant_step.initial_state(scene)
    _fill_table(table, scene.drive, 0, 1, h)
    now = _inspection_at_launch(scene, y, table)
    status, _ = constant_step.verdict(scene, now, now)
    k, count, t = 0, 0, 0.0
    while True:
        # The history ends with the run, within a step.
        ends = k == steps or status != RUNNING
        if ends or k % interval == 0:
            times[count] = t
            row = constant_step.row(scene, y, turn(scene.drive, t))
            for column in range(len(row)):
                rows[count, column] = row[column]
            count += 1
        if ends:
            return count
        _fill_table(table, scene.drive, k, 1, h)
        status, fraction, y, now = _step_to_end(scene, y, now, table, 0, h)
        t = (k + fraction) * h
        k += 1
        if k == steps and status == RUNNING:
            t = scene.span
