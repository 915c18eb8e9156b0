"""Methods that locate every switching point: `event` for set-valued laws, `implicit` for smooth ones."""

from __future__ import annotations

from abc import abstractmethod
from dataclasses import dataclass, replace
from typing import Annotated, Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from ringsweep.errors import InputError
from ringsweep.jit import take
from ringsweep.parameters import Parameter
from ringsweep.physics.friction import DYNAMIC, LAWS, SET_VALUED, SMOOTH
from ringsweep.scene import Structure
from ringsweep.solvers.common import Method, Result, agree
from ringsweep.solvers.piecewise import integrate

LIMIT = Parameter("1", "steps after which a run is given up as failed", lower=1, upper=1e10)

# The witness of a certificate runs at a tolerance looser by this factor; where it disagrees the cell
# is run again, tighter by it, so often at most.
_FACTOR = 30.0
_TRIES = 3


@dataclass(frozen=True)
class _Piecewise(Method):
    """What both methods share: integration of the piecewise-smooth system, and its certificate."""

    laws: ClassVar[tuple[type, ...]]

    rtol: float
    max_steps: int = 1_000_000
    certify: bool = True

    def check(self, structure: Structure) -> None:
        """Refuse a friction law that the method cannot take."""
        if LAWS[structure.law] not in self.laws:
            able = ", ".join(name for name, law in LAWS.items() if law in self.laws)
            raise InputError(
                "solver.method",
                f"{self.name} does not take friction law {structure.law}: it takes {able}; auto takes all",
            )

    @abstractmethod
    def tolerances(self) -> tuple[float, float]:
        """Tolerance of the series and of the implicit steps."""

    def run(self, batch: Any, outcomes: tuple[str, ...]) -> Result:
        """Outcomes of every cell; see :class:`ringsweep.solvers.common.Method`.

        A cell is certified if a run at a looser tolerance agrees with it; where it does not, both
        tolerances are tightened.
        """
        rows, steps = self._integrate(batch, len(outcomes))
        certified = np.zeros(len(rows), dtype=bool)
        if self.certify:
            witness, more = replace(self, rtol=self.rtol * _FACTOR)._integrate(batch, len(outcomes))
            steps = steps + more
            certified = agree(rows, witness, outcomes)
            finer = self
            for _ in range(_TRIES):
                doubtful = np.flatnonzero(~certified)
                finer = replace(finer, rtol=finer.rtol / _FACTOR)
                if not len(doubtful) or finer.tolerances()[0] < 1e-15:
                    break
                again, more = finer._integrate(take(batch, doubtful), len(outcomes))
                steps[doubtful] += more
                certified[doubtful] = agree(again, rows[doubtful], outcomes)
                rows[doubtful] = again
        return Result(rows, steps=steps, certified=certified)

    def _integrate(self, batch: Any, width: int) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        rows = np.empty((len(batch.span), width))
        steps = np.empty(len(rows))
        integrate(batch, self.tolerances(), self.max_steps, rows, steps, np.inf, np.empty(0), np.empty((0, 0)))
        return rows, steps

    def history(self, batch: Any, samples: int, width: int) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Times and rows of the history of cell 0; see :class:`ringsweep.solvers.common.Method`."""
        spacing = float(batch.span[0]) / samples
        size = 4 * samples
        while True:
            times, table = np.empty(size), np.empty((size, width))
            none, steps = np.empty((1, 0)), np.empty(1)
            count = integrate(batch, self.tolerances(), self.max_steps, none, steps, spacing, times, table)
            if count < size or size >= self.max_steps:
                return times[:count], table[:count]
            size *= 4


@dataclass(frozen=True)
class Event(_Piecewise):
    """Stick and slip of set-valued laws, every switching point located."""

    name: ClassVar[str] = "event"
    laws: ClassVar[tuple[type, ...]] = SET_VALUED

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
    laws: ClassVar[tuple[type, ...]] = (*SMOOTH, *DYNAMIC)

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
        """Outcomes of every cell; see :class:`ringsweep.solvers.common.Method`."""
        return self._method(type(batch.law)).run(batch, outcomes)

    def history(self, batch: Any, samples: int, width: int) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Times and rows of the history of cell 0; see :class:`ringsweep.solvers.common.Method`."""
        return self._method(type(batch.law)).history(batch, samples, width)

    def resolved(self, structure: Structure) -> Method:
        """The method that a scene is run by."""
        return self._method(LAWS[structure.law])

    def _method(self, law: type) -> Method:
        method = Event if law in SET_VALUED else Implicit
        return method(max_steps=self.max_steps, certify=self.certify)
