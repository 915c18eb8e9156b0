"""Settings of methods that are measured against each other, and how they are timed."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from time import get_clock_info, perf_counter, thread_time
from typing import Any

from ringsweep.config import Config
from ringsweep.errors import InputError
from ringsweep.physics.friction import LAWS, SET_VALUED
from ringsweep.solvers.event import Event, Implicit
from ringsweep.solvers.method import Result
from ringsweep.solvers.rk4 import RK4

# Down to two digits above the tolerances of the reference.
TOLERANCES: dict[type, tuple[float, ...]] = {
    Event: (1e-4, 1e-5, 1e-6, 1e-7, 1e-8, 1e-9, 1e-10, 1e-11, 1e-12),
    Implicit: (1e-3, 1e-4, 1e-5, 1e-6, 1e-7, 1e-8, 1e-9),
}

_STEPS = tuple(10**k for k in range(2, 8))


# Seconds in a round that one setting may take.
_BUDGET = 10.0


# Seconds below which a clock measures itself: shorter calls are repeated.
_LEAST = 0.01


# A thread's own time leaves out what a busy machine does meanwhile; some systems count it in ticks too coarse for that.
_clock = thread_time if get_clock_info("thread_time").resolution < 1e-4 else perf_counter


# ---- contenders ----------------------------------------------------------------------------


def contenders_of(config: Config) -> tuple[list[Any], list[str]]:
    """Methods with settings, each from cheap to dear, without certificates; and in words what does not compete."""
    structure, own = config.scene.structure, config.solver
    best: Any = Event if LAWS[structure.law] in SET_VALUED else Implicit
    tolerances = {*TOLERANCES[best], best.rtol} | ({own.rtol} if isinstance(own, best) else set())
    limit = getattr(own, "max_steps", best.max_steps)
    found = [best(rtol=rtol, max_steps=limit, certify=False) for rtol in sorted(tolerances, reverse=True)]
    steps = {*_STEPS} | ({own.steps} if isinstance(own, RK4) else set())
    fixed = [RK4(steps=n, certify=False) for n in sorted(steps)]
    try:
        fixed[0].check(structure)
    except InputError as error:
        return found, [error.problem]
    return found + fixed, []


def setting(method: Any) -> str:
    return f"{method.steps} steps" if isinstance(method, RK4) else f"rtol {method.rtol!r}"


def yaml(method: Any) -> str:
    """What stands under ``solver`` in a configuration, defaults left out but for the setting."""
    options = {"steps": method.steps} if isinstance(method, RK4) else {"rtol": method.rtol}
    options |= {
        option.name: getattr(method, option.name)
        for option in dataclasses.fields(method)
        if option.name not in (*options, "certify") and getattr(method, option.name) != option.default
    }
    return ", ".join([f"method: {method.name}", *(f"{name}: {value!r}" for name, value in options.items())])


@dataclass
class Timed:
    """A contender: its method, seconds of each turn, and what it returned last."""

    method: Any
    seconds: list[float] = field(default_factory=list)
    result: Any = None
    repeats: int = 1

    def turn(self, run: Callable[[Any], Result]) -> None:
        """Run and time once; the first turn finds how often that must be for the clock to tell."""
        elapsed = self._lap(run)
        while not self.seconds and elapsed < _LEAST:
            self.repeats *= 4
            elapsed = self._lap(run)
        self.seconds.append(elapsed / self.repeats)

    def _lap(self, run: Callable[[Any], Result]) -> float:
        begin = _clock()
        for _ in range(self.repeats):
            self.result = run(self.method)
        return _clock() - begin


def race(methods: Sequence[Any], run: Callable[[Any], Result], rounds: int, bar: Any) -> tuple[list[Timed], list[str]]:
    """Time methods in turn, forwards and backwards, so that a noisy neighbour troubles all of them alike.

    Also tells in words which were left out, by the time of the one before.
    """
    raced: list[Timed] = []
    left_out = []
    latest: dict[type, Timed] = {}
    for method in methods:
        before = latest.get(type(method))
        if before is None:
            # Compiles.
            run(method)
        else:
            more = method.steps / before.method.steps if isinstance(method, RK4) else 1.0
            expected = more * before.seconds[0]
            if expected > _BUDGET:
                left_out.append(
                    f"{method.name}, {setting(method)} (some {expected:.0f} s a round; {_BUDGET:g} are allowed)"
                )
                bar.update(rounds + 1)
                continue
        latest[type(method)] = Timed(method)
        latest[type(method)].turn(run)
        bar.update()
        raced.append(latest[type(method)])
    for k in range(1, rounds):
        for one in raced[:: 1 if k % 2 == 0 else -1]:
            one.turn(run)
            bar.update()
    return raced, left_out
