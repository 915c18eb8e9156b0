"""Methods and settings that :func:`ringsweep.precision` compares, and their timing."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from time import get_clock_info, perf_counter, thread_time
from typing import Any

from ringsweep.config import Config
from ringsweep.errors import InputError
from ringsweep.solvers.event import Auto, Event, Implicit
from ringsweep.solvers.method import Result
from ringsweep.solvers.rk4 import RK4

# The tightest is two digits above the tolerance of the reference.
_TOLERANCES: dict[type, tuple[float, ...]] = {
    Event: (1e-4, 1e-5, 1e-6, 1e-7, 1e-8, 1e-9, 1e-10, 1e-11, 1e-12),
    Implicit: (1e-3, 1e-4, 1e-5, 1e-6, 1e-7, 1e-8, 1e-9),
}

_STEPS = tuple(10**k for k in range(2, 8))

# Seconds that one setting may take in a round.
_BUDGET = 10.0

# Shorter calls are repeated until they take this many seconds: the clock is too coarse for them.
_MIN_SECONDS = 0.01

# The time of the thread does not count other processes, but some systems measure it too coarsely.
_clock = thread_time if get_clock_info("thread_time").resolution < 1e-4 else perf_counter


def contenders_for(config: Config) -> tuple[list[Any], list[str]]:
    """Methods with settings, from cheap to expensive, without certificates; and why others are left out, in words."""
    structure, configured = config.scene.structure, config.solver
    best: Any = type(Auto().resolved(structure))
    tolerances = {*_TOLERANCES[best], best.rtol} | ({configured.rtol} if isinstance(configured, best) else set())
    limit = getattr(configured, "max_steps", best.max_steps)
    found = [best(rtol=rtol, max_steps=limit, certify=False) for rtol in sorted(tolerances, reverse=True)]
    steps = {*_STEPS} | ({configured.steps} if isinstance(configured, RK4) else set())
    fixed = [RK4(steps=n, certify=False) for n in sorted(steps)]
    try:
        fixed[0].check(structure)
    except InputError as error:
        return found, [error.problem]
    return found + fixed, []


def setting_of(method: Any) -> str:
    """The tolerance or the number of steps of a method, as text."""
    return f"{method.steps} steps" if isinstance(method, RK4) else f"rtol {method.rtol!r}"


def solver_yaml(method: Any) -> str:
    """Text under ``solver`` in a configuration for this method: its setting, and options that are not defaults."""
    options = {"steps": method.steps} if isinstance(method, RK4) else {"rtol": method.rtol}
    options |= {
        option.name: getattr(method, option.name)
        for option in dataclasses.fields(method)
        if option.name not in (*options, "certify") and getattr(method, option.name) != option.default
    }
    return ", ".join([f"method: {method.name}", *(f"{name}: {value!r}" for name, value in options.items())])


@dataclass
class TimedMethod:
    """A method and its measured run times.

    Attributes
    ----------
    method : Method
    seconds : list of float
        Run time in each round.
    result : Result
        Result of the last run.
    repeats : int
        Runs per round.
    """

    method: Any
    seconds: list[float] = field(default_factory=list)
    result: Any = None
    repeats: int = 1

    def measure(self, run: Callable[[Any], Result]) -> None:
        """Measure one round. The first round finds the number of repeats."""
        elapsed = self._time_repeats(run)
        while not self.seconds and elapsed < _MIN_SECONDS:
            self.repeats *= 4
            elapsed = self._time_repeats(run)
        self.seconds.append(elapsed / self.repeats)

    def _time_repeats(self, run: Callable[[Any], Result]) -> float:
        start = _clock()
        for _ in range(self.repeats):
            self.result = run(self.method)
        return _clock() - start


def time_methods(
    methods: Sequence[Any], run: Callable[[Any], Result], rounds: int, bar: Any
) -> tuple[list[TimedMethod], list[str]]:
    """Time methods alternately, forwards and backwards, so that other load on the machine affects all alike.

    Returns
    -------
    timed : list of TimedMethod
    left_out : list of str
        Settings that would take too long, by the time of the setting before, in words.
    """
    timed: list[TimedMethod] = []
    left_out = []
    latest: dict[type, TimedMethod] = {}
    for method in methods:
        before = latest.get(type(method))
        if before is None:
            # The first run may compile.
            run(method)
        else:
            more = method.steps / before.method.steps if isinstance(method, RK4) else 1.0
            expected = more * before.seconds[0]
            if expected > _BUDGET:
                left_out.append(
                    f"{method.name}, {setting_of(method)} (about {expected:.0f} s a round; {_BUDGET:g} s are allowed)"
                )
                bar.update(rounds + 1)
                continue
        latest[type(method)] = TimedMethod(method)
        latest[type(method)].measure(run)
        bar.update()
        timed.append(latest[type(method)])
    for k in range(1, rounds):
        for one in timed[:: 1 if k % 2 == 0 else -1]:
            one.measure(run)
            bar.update()
    return timed, left_out
