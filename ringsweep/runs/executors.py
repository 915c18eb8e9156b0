"""Executors of the tasks of a sweep: threads of this machine, or the workers of a Dask scheduler."""

from __future__ import annotations

import logging
import signal
import sys
import threading
from collections.abc import Callable, Generator, Iterator
from contextlib import AbstractContextManager, contextmanager, nullcontext
from queue import SimpleQueue
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
    """Computes tasks; each task is given by the positions of its cells."""

    def concurrency(self) -> int:
        """Number of tasks that are computed at once, at this moment."""

    def results(
        self,
        compute: Callable[[Positions], Result],
        tasks: Iterator[Positions],
        learn: Callable[[Result], Result],
        stopped: threading.Event,
    ) -> Generator[Result]:
        """Results in the order in which they are finished. The next task is taken when a thread is free for it.

        Parameters
        ----------
        compute : callable
            Computes one task.
        tasks : iterator of ndarray
            Positions of the cells of each task.
        learn : callable
            Called with each result at once, before the next task is taken; returns the result.
        stopped : Event
            Once it is set, waiting for workers ends.
        """


class Threads:
    """Threads of this machine.

    Parameters
    ----------
    jobs : int, optional
        Number of threads; all cores by default.
    """

    def __init__(self, jobs: int | None):
        self._jobs: int = jobs or joblib.cpu_count()

    def concurrency(self) -> int:
        """Number of threads."""
        return self._jobs

    def results(
        self,
        compute: Callable[[Positions], Result],
        tasks: Iterator[Positions],
        learn: Callable[[Result], Result],
        stopped: threading.Event,
    ) -> Generator[Result]:
        """Results in the order in which they are finished; see :class:`Executor`.

        The calling thread only waits: compilation and kernels would hold up its reaction to Ctrl-C. A thread that
        fails stops the others after their tasks; its error is raised when their results are handed over. If Ctrl-C
        ends the wait, or is thrown into the generator, what is finished is still handed over.
        """
        found: SimpleQueue[Result | BaseException | None] = SimpleQueue()
        lock = threading.Lock()

        def work() -> None:
            try:
                while True:
                    with lock:
                        task = next(tasks, None)
                    if task is None:
                        break
                    result = compute(task)
                    with lock:
                        learn(result)
                    found.put(result)
            except BaseException as error:
                stopped.set()
                found.put(error)
            found.put(None)

        # Daemons, so that a second Ctrl-C need not wait for their tasks.
        threads = [threading.Thread(target=work, daemon=True) for _ in range(self._jobs)]
        working, failure = len(threads), None
        try:
            # The first thread may have finished tasks before the last one has started.
            for thread in threads:
                thread.start()
            while working:
                item = found.get()
                if item is None:
                    working -= 1
                elif isinstance(item, BaseException):
                    failure = failure or item
                else:
                    yield item
        except KeyboardInterrupt:
            while not found.empty():
                if (item := found.get()) is not None and not isinstance(item, BaseException):
                    yield item
            raise
        if failure is not None:
            raise failure


def executor(jobs: int | None, scheduler: str | None) -> AbstractContextManager[Executor]:
    """Threads of this machine, or the workers of the Dask scheduler at an address.

    Raises
    ------
    InputError
        If the number of threads is not positive, if both are given, or if no scheduler answers.
    """
    if jobs is not None and jobs < 1:
        raise InputError("jobs", f"{jobs} threads cannot compute anything: give at least 1")
    if scheduler is None:
        return nullcontext(Threads(jobs))
    if jobs is not None:
        raise InputError("--jobs", "is for threads of this machine: Dask's workers have their own number of threads")
    try:
        from ringsweep.runs import dask
    except ImportError:
        raise InputError("--scheduler", "Dask is not installed: pip install distributed") from None
    return dask.workers(scheduler)


def interruptible(function: Callable[[], Result]) -> Result:
    """Result of a function that runs in another thread, so that Ctrl-C ends the wait for it at once."""
    tasks = iter([np.empty(0, dtype=np.intp)])
    (result,) = Threads(1).results(lambda _: function(), tasks, lambda result: result, threading.Event())
    return result


@contextmanager
def stop_on_interrupt(under_way: Callable[[], str]) -> Iterator[threading.Event]:
    """Event that the first Ctrl-C or SIGTERM within the block sets. The second one acts as it does elsewhere.

    Parameters
    ----------
    under_way : callable
        Returns what the sweep waits for after the first one.
    """
    stopped = threading.Event()
    if threading.current_thread() is not threading.main_thread():
        # Only the main thread can handle signals.
        yield stopped
        return
    before = {number: signal.getsignal(number) for number in (signal.SIGINT, signal.SIGTERM)}

    def restore() -> None:
        for number, handler in before.items():
            signal.signal(number, handler)

    def interrupt(number: int, frame: Any) -> None:
        # A second one that comes before the message is out would end the process without it.
        logger.info("stopping when %s (Ctrl-C again: stop now and lose that)", under_way())
        restore()
        stopped.set()

    for number in before:
        signal.signal(number, interrupt)
    try:
        yield stopped
    finally:
        restore()


def progress_bar(total: int | None, progress: bool, done: int = 0, unit: str = "run") -> Any:
    """Progress bar over `total` runs or other units, or a count of them if their number is not known.

    It is shown only in a terminal or a notebook, and only if `progress` is true.
    """
    # tqdm would hide the bar in a notebook, whose output is no terminal.
    shell = sys.modules["IPython"].get_ipython() if "IPython" in sys.modules else None
    notebook = hasattr(shell, "kernel")
    return tqdm(total=total, initial=done, unit=unit, disable=(False if notebook else None) if progress else True)
