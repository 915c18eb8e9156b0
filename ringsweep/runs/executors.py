"""Who computes the tasks of a sweep: threads of this machine, or the workers of a Dask scheduler."""

from __future__ import annotations

import logging
import signal
import sys
import threading
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, contextmanager, nullcontext
from typing import Any, Protocol, TypeVar

import joblib
import numpy as np
from numpy.typing import NDArray
from tqdm.auto import tqdm

from ringsweep.errors import InputError

logger = logging.getLogger("ringsweep")

Result = TypeVar("Result")
Positions = NDArray[np.integer[Any]]


class Executor(Protocol):
    """Who computes tasks, each of them the cells at some positions."""

    def threads(self) -> int:
        """How many tasks are computed at once, at this moment."""

    def results(
        self,
        compute: Callable[[Positions], Result],
        tasks: Iterator[Positions],
        learn: Callable[[Result], Result],
        stopped: threading.Event,
    ) -> Iterator[Result]:
        """Results as they come. A task is asked for when there is a thread for it.

        Parameters
        ----------
        compute : callable
            Computes one task.
        tasks : iterator of ndarray
            Positions of the cells of each task.
        learn : callable
            Called with each result as soon as it is there; returns it.
        stopped : Event
            Once it is set no more results are waited for than those under way.
        """


class Threads:
    """Threads of this machine.

    Parameters
    ----------
    jobs : int, optional
        How many; all cores unless given.
    """

    def __init__(self, jobs: int | None):
        self._jobs: int = jobs or joblib.cpu_count()

    def threads(self) -> int:
        """How many there are."""
        return self._jobs

    def results(
        self,
        compute: Callable[[Positions], Result],
        tasks: Iterator[Positions],
        learn: Callable[[Result], Result],
        stopped: threading.Event,
    ) -> Iterator[Result]:
        """Results as they come; see :class:`Executor`."""
        parallel = joblib.Parallel(n_jobs=self._jobs, prefer="threads", return_as="generator_unordered")

        # joblib hands results over in ticks: the next task is sized before that.
        def compute_and_learn(task: Positions) -> Result:
            return learn(compute(task))

        found: Iterator[Result] = parallel(joblib.delayed(compute_and_learn)(task) for task in tasks)
        return found


def executor(jobs: int | None, scheduler: str | None) -> AbstractContextManager[Executor]:
    """Threads of this machine, or the workers of the Dask scheduler at an address.

    Raises
    ------
    InputError
        If the number of threads is not positive, if both are given, or if no scheduler answers.
    """
    if jobs is not None and jobs < 1:
        raise InputError("jobs", f"{jobs} threads compute nothing: give at least 1")
    if scheduler is None:
        return nullcontext(Threads(jobs))
    if jobs is not None:
        raise InputError("--jobs", "is for threads of this machine: Dask's workers have their own number of threads")
    try:
        from ringsweep.runs import dask
    except ImportError:
        raise InputError("--scheduler", "Dask is not installed: pip install distributed") from None
    return dask.workers(scheduler)


@contextmanager
def stop_on_interrupt() -> Iterator[threading.Event]:
    """An event that the first Ctrl-C within the block sets; the second raises `KeyboardInterrupt` as ever."""
    stopped = threading.Event()
    if threading.current_thread() is not threading.main_thread():
        # Signals are a matter of the main thread.
        yield stopped
        return
    before = signal.getsignal(signal.SIGINT)

    def interrupt(number: int, frame: Any) -> None:
        signal.signal(signal.SIGINT, before)
        stopped.set()
        logger.info("stopping when the tasks under way are done (Ctrl-C again: at once, without them)")

    signal.signal(signal.SIGINT, interrupt)
    try:
        yield stopped
    finally:
        signal.signal(signal.SIGINT, before)


def progress_bar(total: int, progress: bool, done: int = 0) -> Any:
    """A bar of so many runs, some of them done, where there is a terminal or a notebook to show it."""
    # tqdm takes a notebook's stream for a pipe and would stay silent there.
    shell = sys.modules["IPython"].get_ipython() if "IPython" in sys.modules else None
    notebook = hasattr(shell, "kernel")
    return tqdm(total=total, initial=done, unit="run", disable=(False if notebook else None) if progress else True)
