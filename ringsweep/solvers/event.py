"""Methods that locate every event: `event` for set-valued laws, `implicit` for smooth and dynamic laws.

Nothing here runs in kernels: :mod:`automaton` does. A batch is run at two tolerances, and :mod:`certificate` compares
the runs.
"""

from __future__ import annotations

from abc import abstractmethod
from dataclasses import dataclass, replace
from typing import Annotated, Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from ringsweep.compile import take
from ringsweep.errors import InputError
from ringsweep.models.interface import audit, implicit, modes, recorder, series
from ringsweep.models.scene import Structure
from ringsweep.models.sliding import REACTION_TOLERANCE
from ringsweep.numerics.series import ORDER
from ringsweep.physics.friction import LAWS, Dynamic, SetValued, Smooth, family_of
from ringsweep.physics.friction.velocity import varies
from ringsweep.quantities.flags import CERTIFIED, FAILED, LAW_NOT_OBEYED, NO_RESULT, NOT_ASKED, SAME_STEPS
from ringsweep.quantities.parameters import Parameter
from ringsweep.solvers.automaton import AUDITED, PATIENCE, History, LocalErrors, Results, integrate
from ringsweep.solvers.certificate import TwoRuns, apart, diverging, judged, took_same_steps, with_errors
from ringsweep.solvers.method import Method, Result
from ringsweep.solvers.steps import FACTOR

LIMIT = Parameter("1", "steps after which a run is given up as failed", lower=1, upper=1e10)
_MOST_STEPS = 100_000_000

# A cell without a certificate is run again with a tolerance that is tighter by FACTOR, at most so many times.
_MOST_RETRIES = 3

# Errors of a run that the difference from the second run does not show, found by experiment, see docs/accuracy.md. In
# units of the remainder of a series, for each shared step; of forces, in units of the remainder that their tolerance
# allows, since within a step they come from the series: once in a run, and under friction that varies for the shared
# steps. In units of the tolerance of an implicit step: once in a run with bristles, as all runs damp their vibrations.
_SHARED, _SHARE_OF_REACTIONS, _SHARED_REACTIONS, _ONCE_IMPLICIT = 3.0, 0.05, 0.35, 0.05

# Largest error of a run, in units of its difference from the run at the looser tolerance; shares of the largest
# relative difference that count in every number, and in forces; and what a run errs by in any case, in units of the
# remainder. Where friction varies with the speed, the errors of both runs are as good as independent: the ends of steps
# decide their signs and sizes. Forces magnify them. And all numbers may agree by chance, so that a share of the errors
# of all steps counts too: of series, in units of the tolerance; under smooth laws also of the place in implicit steps.
_CONSTANT, _VARYING = (0.8, 0.04, 0.04, 0.2, 0.0), (1.5, 0.05, 0.2, 0.2, 0.1)
_SMOOTH, _BRISTLES = (1.5, 0.08, 0.2, 0.4, 0.03), (2.0, 0.2, 1.0, 0.2, 0.0)
_PLACES = 0.5

# Some rounding errors.
_ROUNDED = 1e-14

# Impacts magnify the errors before them: a small difference of two runs is then less certain by this factor.
_MAGNIFIED = 3.0

# Largest violation of the friction law in a certified run, in units of the violation that the tolerance would explain;
# and largest share of the energy turnover that is not work of friction.
_MOST_VIOLATION, _MOST_UNEXPLAINED = 1e3, 5e-3

# What a friction law of each family is, for messages.
_WORDS: dict[type, str] = {SetValued: "is set-valued", Smooth: "is smooth", Dynamic: "has a memory"}


def _select(batch: Any, cells: NDArray[np.intp]) -> Any:
    """The given cells of a batch; the batch itself, without a copy, if these are all cells."""
    return batch if len(cells) == len(batch.span) else take(batch, cells)


def _shared(method: _Piecewise, runs: Results) -> NDArray[np.float64]:
    """Mean relative error of a step that runs by a method share with runs at a looser tolerance, and its rounding."""
    of_steps = method.tolerances()[0] * LocalErrors(*runs.audits[:, 3:].T).series
    return np.asarray(_ROUNDED + of_steps / np.maximum(runs.steps, 1.0))


@dataclass(frozen=True)
class _Piecewise(Method):
    """Integration of a piecewise-smooth system, and its certificate."""

    families: ClassVar[tuple[type, ...]]

    rtol: float
    max_steps: Annotated[int, LIMIT] = _MOST_STEPS
    certify: bool = True

    def needs(self, structure: Structure) -> tuple[Any, ...]:
        """Functions for modes and audit, and for series, implicit steps or both, as the law's family needs."""
        family = family_of(structure.law_type)
        found = recorder.MEMBERS + recorder.EVENT_MEMBERS + modes.MEMBERS + audit.MEMBERS
        found += () if family is Dynamic else series.MEMBERS
        found += () if family is SetValued else implicit.MEMBERS
        return (*found, implicit.is_stiff) if family is Smooth else found

    def check(self, structure: Structure) -> None:
        """Refuse friction laws of other families.

        Raises
        ------
        InputError
            If the method does not take the friction law; and as in :meth:`Method.check`.
        """
        family = family_of(structure.law_type)
        if family not in self.families:
            able = ", ".join(name for name, law in LAWS.items() if family_of(law) in self.families)
            law = f"friction law {structure.law}, which {_WORDS[family]}"
            raise InputError("solver.method", f"{self.name} does not take {law}: it takes {able}; auto takes all")
        super().check(structure)

    @abstractmethod
    def tolerances(self) -> tuple[float, float]:
        """Relative errors allowed to a step of the series and to an implicit step."""

    def run(self, batch: Any, outcomes: tuple[str, ...]) -> Result:
        """Outcomes of every cell; see :meth:`ringsweep.solvers.method.Method.run`.

        A cell is certified if it obeys its friction law, and if a second run at a looser tolerance agrees with it. If
        not, or if both runs took the same steps, the cell is run again at tighter tolerances.
        """
        rows, steps, audits = self.integrate(batch, len(outcomes), audit=self.certify)
        because = np.full(len(rows), NO_RESULT if self.certify else NOT_ASKED, dtype=np.int8)
        if not self.certify:
            return Result(rows, steps=steps, certified=because == CERTIFIED, because=because)
        bounds = np.full((len(rows), len(with_errors(outcomes))), np.nan)
        open_cells = np.flatnonzero(~self._given_up(rows, steps, outcomes))
        if not len(open_cells):
            return Result(rows, steps=steps, certified=because == CERTIFIED, because=because, errors=bounds)
        finer, distance = self, np.full(len(rows), np.inf)
        looser = self.looser()
        new = Results(rows[open_cells], steps[open_cells], audits[open_cells])
        cells = audit.disturbed(_select(batch, open_cells), _shared(self, new))
        second_rows, more_steps, _ = self.integrate(cells, len(outcomes), audit=False, tolerances=looser)
        for retry in range(_MOST_RETRIES + 1):
            runs = TwoRuns(_select(batch, open_cells), new.rows, second_rows, outcomes)
            because[open_cells], found, distance[open_cells], may_converge = finer._compare(
                runs, new.steps, new.audits, distance[open_cells], looser
            )
            # Two runs may be close by chance: errors shrink no faster than the tolerance, so the bound does not either.
            bounds[open_cells] = np.maximum(found, np.nan_to_num(bounds[open_cells]) / FACTOR)
            if retry == 0:
                same = open_cells[took_same_steps(runs)]
                because[same] = np.where(because[same] == CERTIFIED, SAME_STEPS, because[same])
            steps[open_cells] += more_steps
            finished = ~self._given_up(new.rows, new.steps, outcomes)
            rows[open_cells[finished]] = new.rows[finished]
            is_open = finished & ((because[open_cells] != CERTIFIED) | may_converge)
            open_cells, share = open_cells[is_open], _shared(finer, new)[is_open]
            looser, finer = finer.tolerances(), replace(finer, rtol=finer.rtol / FACTOR)
            if retry == _MOST_RETRIES or not len(open_cells) or not 1e-15 <= finer.tolerances()[0] < looser[0]:
                break
            second_rows = rows[open_cells]
            cells = _select(batch, open_cells)
            # Each run is compared with a disturbed one, or a disturbed run with one that is not.
            cells = cells if retry % 2 else audit.disturbed(cells, share)
            new = finer.integrate(cells, len(outcomes), audit=True)
            more_steps = new.steps
        return Result(rows, steps=steps, certified=because == CERTIFIED, because=because, errors=bounds)

    def _given_up(
        self, rows: NDArray[np.float64], steps: NDArray[np.float64], outcomes: tuple[str, ...]
    ) -> NDArray[np.bool_]:
        """Whether each run was given up because of its many steps. Such a run is not repeated."""
        failed: NDArray[np.bool_] = rows[:, outcomes.index("regime")] == FAILED
        return failed & (steps >= min(self.max_steps, PATIENCE))

    def _compare(
        self,
        runs: TwoRuns,
        steps: NDArray[Any],
        audits: NDArray[np.float64],
        distance_before: NDArray[np.float64],
        looser: tuple[float, float],
    ) -> tuple[NDArray[np.int8], NDArray[np.float64], NDArray[np.float64], NDArray[np.bool_]]:
        """Why runs have no certificate, and bounds on their errors, from second runs at a looser tolerance.

        Returns
        -------
        tuple of ndarray
            Reasons against each certificate; bounds, NaN where nearby runs diverge; distance of the runs where they
            diverge, infinite elsewhere; whether they diverge, but a tighter tolerance may show that they converge.
        """
        batch = runs.batch
        family = family_of(type(batch.law))
        of_bristles = family is Dynamic
        distance = apart(runs)
        diverge = diverging(distance, looser[of_bristles], distance_before)
        obeys_law: NDArray[np.bool_] = (audits[:, 0] <= _MOST_VIOLATION) & (audits[:, 1] <= _MOST_UNEXPLAINED)
        tolerance, implicit_tolerance = self.tolerances()
        local = LocalErrors(*audits[:, 3:].T)
        # Ratio of successive terms of a series at the end of a step; a geometric series is the remainder.
        ratio = tolerance ** (1.0 / ORDER)
        remainder = tolerance * ratio / (1.0 - ratio)
        # In the stiction band the error of the velocity, as a share of the band, is that of friction, of breakaway.
        friction_floor = np.where(local.implicit + local.place > 0.0, implicit_tolerance, 0.0)
        # Errors average out along a smooth motion, not if an event magnifies those of the few steps before it.
        _, magnified, left_out = audit.of_events(batch, runs.named[0])
        is_constant = family is SetValued and not varies(take(batch, 0).law, 0)
        of_slip = _CONSTANT if is_constant else _VARYING if family is SetValued else _SMOOTH
        safety, share, force_share, once, share_of_steps = _BRISTLES if of_bristles else of_slip
        floor = remainder * (once + _SHARED * local.series)
        floor += implicit_tolerance * (local.implicit + (_ONCE_IMPLICIT if of_bristles else 0.0))
        # The largest reaction is that of one step, and a reaction that vanishes is that of the last.
        shared, last = (0.0, 0.0) if is_constant else (_SHARED_REACTIONS * np.minimum(local.series, 1.0), local.last)
        with np.errstate(divide="ignore"):
            per_fall = np.where(audits[:, 2] > 0.0, 1.0 / audits[:, 2], 0.0)
        because, bounds = judged(
            runs,
            audits[:, 2],
            diverge,
            (~obeys_law, LAW_NOT_OBEYED),
            safety=np.where(magnified, _MAGNIFIED, 1.0) * safety,
            share=share,
            motion_floor=tolerance * share_of_steps * local.all_series + implicit_tolerance * _PLACES * local.place,
            force_share=force_share,
            steps=steps,
            floor=floor + left_out,
            rate_floor=self.tolerances()[of_bristles] * local.rate,
            force_floor=REACTION_TOLERANCE * remainder * (_SHARE_OF_REACTIONS + shared),
            friction_floor=friction_floor,
            instant_floor=REACTION_TOLERANCE * remainder * last * per_fall,
        )
        may_converge = diverge & ~diverging(distance / FACTOR, self.tolerances()[of_bristles])
        return because, bounds, np.where(diverge, distance, np.inf), may_converge

    def looser(self) -> tuple[float, float]:
        """Tolerances of the second run of a certificate, as :meth:`tolerances` returns them."""
        tolerance, implicit_tolerance = self.tolerances()
        return tolerance * FACTOR, implicit_tolerance * FACTOR

    def integrate(
        self, batch: Any, width: int, *, audit: bool, tolerances: tuple[float, float] | None = None
    ) -> Results:
        """Run every cell once.

        Parameters
        ----------
        batch : NamedTuple
            Cells.
        width : int
            Number of outcomes.
        audit : bool
            Whether the runs are audited.
        tolerances : tuple of float, optional
            In place of :meth:`tolerances`.

        Returns
        -------
        Results
        """
        cells = len(batch.span)
        results = Results(np.empty((cells, width)), np.empty(cells), np.empty((cells if audit else 0, AUDITED)))
        no_history = History(np.inf, np.empty(0), np.empty((0, 0)))
        integrate(batch, tolerances or self.tolerances(), self.max_steps, results, no_history)
        return results

    def history(self, batch: Any, samples: int, width: int) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Times and rows of the history of cell 0; see :meth:`ringsweep.solvers.method.Method.history`."""
        spacing = float(batch.span[0]) / samples
        size = 4 * samples
        while True:
            history = History(spacing, np.empty(size), np.empty((size, width)))
            no_results = Results(np.empty((1, 0)), np.empty(1), np.empty((0, AUDITED)))
            count = integrate(batch, self.tolerances(), self.max_steps, no_results, history)
            if count < size or size >= self.max_steps:
                return history.times[:count], history.table[:count]
            size *= 4


@dataclass(frozen=True)
class Event(_Piecewise):
    """Power series for set-valued laws; every event is located."""

    name: ClassVar[str] = "event"
    families: ClassVar[tuple[type, ...]] = (SetValued,)

    rtol: Annotated[float, Parameter("1", "error allowed to a step", lower=1e-15, upper=1e-3)] = 1e-10

    def tolerances(self) -> tuple[float, float]:
        """Relative error allowed to a step of the series, twice: there are no implicit steps."""
        return self.rtol, self.rtol


@dataclass(frozen=True)
class Implicit(_Piecewise):
    """Power series for smooth and dynamic laws; L-stable implicit steps where these laws are stiff."""

    name: ClassVar[str] = "implicit"
    families: ClassVar[tuple[type, ...]] = (Smooth, Dynamic)

    rtol: Annotated[float, Parameter("1", "error allowed to a step", lower=1e-13, upper=1e-3)] = 3e-6

    def tolerances(self) -> tuple[float, float]:
        """Relative errors allowed to a step of the series and to an implicit step."""
        # One more digit of a series costs little, of an implicit step much. On the way out of the stiction band earlier
        # errors grow.
        return max(1.0 / implicit.IMPLICIT_TOLERANCE * self.rtol, 1e-15), self.rtol


@dataclass(frozen=True)
class Auto(Method):
    """The method that takes the friction law: event for set-valued laws, implicit for all others."""

    name: ClassVar[str] = "auto"

    max_steps: Annotated[int, LIMIT] = _MOST_STEPS
    certify: bool = True

    def run(self, batch: Any, outcomes: tuple[str, ...]) -> Result:
        """Outcomes of every cell; see :meth:`ringsweep.solvers.method.Method.run`."""
        return self._method(type(batch.law)).run(batch, outcomes)

    def history(self, batch: Any, samples: int, width: int) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Times and rows of the history of cell 0; see :meth:`ringsweep.solvers.method.Method.history`."""
        return self._method(type(batch.law)).history(batch, samples, width)

    def needs(self, structure: Structure) -> tuple[Any, ...]:
        """Functions that the method for the friction law needs."""
        return self.resolved(structure).needs(structure)

    def check(self, structure: Structure) -> None:
        """Refuse what the method for the friction law refuses."""
        self.resolved(structure).check(structure)

    def resolved(self, structure: Structure) -> Method:
        """The method for the friction law."""
        return self._method(structure.law_type)

    def _method(self, law: type) -> Method:
        """Method for a law."""
        method = Event if family_of(law) is SetValued else Implicit
        return method(max_steps=self.max_steps, certify=self.certify)
