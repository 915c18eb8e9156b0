"""Methods that locate every switching point: `event` for set-valued laws, `implicit` for smooth ones."""

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
from ringsweep.physics import drives
from ringsweep.physics.friction import LAWS, Dynamic, SetValued, Smooth, family_of, presliding, velocity
from ringsweep.quantities.parameters import Parameter
from ringsweep.solvers.automaton import integrate
from ringsweep.solvers.certificate import errors, repeated, vouched, with_errors
from ringsweep.solvers.method import Method, Needs, Result

LIMIT = Parameter("1", "steps after which a run is given up as failed", lower=1, upper=1e10)

#: The witness of a certificate runs at a tolerance looser by this factor; where it disagrees the cell
#: is run again, tighter by it, so often at most.
FACTOR = 30.0
_TRIES = 3

# A run obeys its law if no violation exceeds so many times what the tolerance of a step makes of it, and all but this
# share of the energy that is turned over is work of friction.
_BREACH, _ENERGY = 1e3, 5e-3


def _some(batch: Any, cells: NDArray[np.intp]) -> Any:
    """Some cells of a batch; all of them are the batch itself."""
    return batch if len(cells) == len(batch.span) else take(batch, cells)


@dataclass(frozen=True)
class _Piecewise(Method):
    """What both methods share: integration of the piecewise-smooth system, and its certificate."""

    families: ClassVar[tuple[type, ...]]
    safety: ClassVar[float]
    """Error of a run in units of its difference from one at the looser tolerance, at most; half of runs: a fiftieth."""

    rtol: float
    max_steps: int = 1_000_000
    certify: bool = True

    def needs(self, structure: Structure) -> Needs:
        """What modes need, with series, implicit steps or both, whichever the law's family takes."""
        family = family_of(LAWS[structure.law])
        of_model = recorder.MEMBERS + modes.MEMBERS + audit.MEMBERS
        of_model += () if family is Dynamic else series.MEMBERS
        of_model += () if family is SetValued else implicit.MEMBERS
        of_model += (implicit.is_stiff,) if family is Smooth else ()
        of_law = presliding.MEMBERS if family is Dynamic else velocity.MEMBERS
        return Needs(of_law, drives.MEMBERS, of_model)

    def check(self, structure: Structure) -> None:
        """Refuse a friction law of a family that the method does not take; see :meth:`Method.check` too."""
        if family_of(LAWS[structure.law]) not in self.families:
            able = ", ".join(name for name, law in LAWS.items() if family_of(law) in self.families)
            raise InputError(
                "solver.method",
                f"{self.name} does not take friction law {structure.law}: it takes {able}; auto takes all",
            )
        super().check(structure)

    @abstractmethod
    def tolerances(self) -> tuple[float, float]:
        """Tolerance of the series and of the implicit steps."""

    def run(self, batch: Any, outcomes: tuple[str, ...]) -> Result:
        """Outcomes of every cell; see :class:`ringsweep.solvers.method.Method`.

        A cell is certified if a run at a looser tolerance agrees with it and it obeys its law. Where it does not, or
        where the two are one run, whose steps no tolerance has shortened, both tolerances are tightened.
        """
        rows, steps, shown = self.integrate(batch, len(outcomes), audit=self.certify)
        certified = np.zeros(len(rows), dtype=bool)
        if not self.certify:
            return Result(rows, steps=steps, certified=certified)
        bounds = np.full((len(rows), len(with_errors(outcomes))), np.nan)
        # What met the limit of work is not worked on any more.
        live = np.flatnonzero(steps < self.max_steps)
        if not len(live):
            return Result(rows, steps=steps, certified=certified, errors=bounds)
        witness, more, _ = replace(self, rtol=self.rtol * FACTOR).integrate(
            _some(batch, live), len(outcomes), audit=False
        )
        certified[live] = self._vouched(_some(batch, live), rows[live], witness, shown[live], outcomes)
        certified[live] &= ~repeated(rows[live], witness, outcomes)
        bounds[live] = self._errors(batch, rows[live], witness, steps[live], outcomes)
        steps[live] += more
        finer = self
        for _ in range(_TRIES):
            live = live[~certified[live]]
            finer = replace(finer, rtol=finer.rtol / FACTOR)
            if not len(live) or finer.tolerances()[0] < 1e-15:
                break
            part = _some(batch, live)
            again, more, shown = finer.integrate(part, len(outcomes), audit=True)
            certified[live] = self._vouched(part, again, rows[live], shown, outcomes)
            bounds[live] = finer._errors(batch, again, rows[live], more, outcomes)
            steps[live] += more
            done = more < self.max_steps
            rows[live[done]] = again[done]
            live = live[done]
        return Result(rows, steps=steps, certified=certified, errors=bounds)

    @staticmethod
    def _vouched(
        batch: Any,
        rows: NDArray[np.float64],
        witness: NDArray[np.float64],
        shown: NDArray[np.float64],
        outcomes: tuple[str, ...],
    ) -> NDArray[np.bool_]:
        """Which runs are certified, given what a run at another tolerance came to and what they have shown."""
        lawful: NDArray[np.bool_] = (shown[:, 0] <= _BREACH) & (shown[:, 1] <= _ENERGY)
        return lawful & vouched(batch, rows, witness, shown[:, 2], outcomes)

    def _errors(
        self,
        batch: Any,
        rows: NDArray[np.float64],
        witness: NDArray[np.float64],
        steps: NDArray[Any],
        outcomes: tuple[str, ...],
    ) -> NDArray[np.float64]:
        """Bounds on the errors of runs at this tolerance, given runs at a looser one."""
        tolerance = self.tolerances()[family_of(type(batch.law)) is Dynamic]
        return errors(rows, witness, outcomes, safety=self.safety, tolerance=tolerance, steps=steps)

    def integrate(
        self, batch: Any, width: int, *, audit: bool
    ) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
        """One run of every cell at the tolerance: outcomes, steps, and under `audit` what each has shown of its law.

        See :func:`ringsweep.solvers.automaton.integrate`.
        """
        rows = np.empty((len(batch.span), width))
        steps, shown = np.empty(len(rows)), np.empty((len(rows) if audit else 0, 3))
        integrate(batch, self.tolerances(), self.max_steps, rows, steps, shown, np.inf, np.empty(0), np.empty((0, 0)))
        return rows, steps, shown

    def history(self, batch: Any, samples: int, width: int) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Times and rows of the history of cell 0; see :class:`ringsweep.solvers.method.Method`."""
        spacing = float(batch.span[0]) / samples
        size = 4 * samples
        while True:
            times, table = np.empty(size), np.empty((size, width))
            none, steps = np.empty((1, 0)), np.empty(1)
            count = integrate(
                batch, self.tolerances(), self.max_steps, none, steps, np.empty((0, 3)), spacing, times, table
            )
            if count < size or size >= self.max_steps:
                return times[:count], table[:count]
            size *= 4


@dataclass(frozen=True)
class Event(_Piecewise):
    """Stick and slip of set-valued laws, every switching point located."""

    name: ClassVar[str] = "event"
    families: ClassVar[tuple[type, ...]] = (SetValued,)
    safety: ClassVar[float] = 0.7

    rtol: Annotated[float, Parameter("1", "error allowed to a step", lower=1e-15, upper=1e-3)] = 1e-10
    max_steps: Annotated[int, LIMIT] = 1_000_000
    certify: bool = True

    def tolerances(self) -> tuple[float, float]:
        """Tolerance of the series; there are no implicit steps."""
        return self.rtol, self.rtol


@dataclass(frozen=True)
class Implicit(_Piecewise):
    """Smooth and dynamic laws as they are written: power series where they are not stiff, else L-stable steps."""

    name: ClassVar[str] = "implicit"
    families: ClassVar[tuple[type, ...]] = (Smooth, Dynamic)
    safety: ClassVar[float] = 1.5

    rtol: Annotated[float, Parameter("1", "error allowed to a step", lower=1e-13, upper=1e-3)] = 3e-6
    max_steps: Annotated[int, LIMIT] = 1_000_000
    certify: bool = True

    def tolerances(self) -> tuple[float, float]:
        """Tolerance of the series and of the implicit steps."""
        # A digit of a series is almost free, one of an implicit step is not; and the way out of the
        # band amplifies what went before.
        return max(1e-3 * self.rtol, 1e-15), self.rtol


@dataclass(frozen=True)
class Auto(Method):
    """The cheapest method that is right for the law as given; never another law."""

    name: ClassVar[str] = "auto"

    max_steps: Annotated[int, LIMIT] = 1_000_000
    certify: bool = True

    def run(self, batch: Any, outcomes: tuple[str, ...]) -> Result:
        """Outcomes of every cell; see :class:`ringsweep.solvers.method.Method`."""
        return self._method(type(batch.law)).run(batch, outcomes)

    def history(self, batch: Any, samples: int, width: int) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Times and rows of the history of cell 0; see :class:`ringsweep.solvers.method.Method`."""
        return self._method(type(batch.law)).history(batch, samples, width)

    def needs(self, structure: Structure) -> Needs:
        """What the method that takes the law needs."""
        return self.resolved(structure).needs(structure)

    def check(self, structure: Structure) -> None:
        """Errors as for the method that takes the law."""
        self.resolved(structure).check(structure)

    def resolved(self, structure: Structure) -> Method:
        """The method that a scene is run by."""
        return self._method(LAWS[structure.law])

    def _method(self, law: type) -> Method:
        method = Event if family_of(law) is SetValued else Implicit
        return method(max_steps=self.max_steps, certify=self.certify)
