"""Executors of the tasks of a sweep: threads of this machine, or the workers of a Dask scheduler."""

from __future__ import annotations

import io
import logging
import signal
import sys
import threading
from collections.abc import Callable, Generator, Iterator
from contextlib import AbstractContextManager, contextmanager, nullcontext
from dataclasses import dataclass
from itertools import islice
from multiprocessing import resource_tracker
from queue import SimpleQueue
from typing import TYPE_CHECKING, Any, TypeVar

import joblib
import numpy as np
from joblib.parallel import get_active_backend
from numpy.typing import NDArray
from tqdm import tqdm
from tqdm.auto import tqdm as bar

from ringsweep.errors import InputError
from ringsweep.runs.needs import duration

if TYPE_CHECKING:
    from ringsweep.runs.dask import Workers

logger = logging.getLogger("ringsweep")

#: Seconds until the first line on the progress where there is no terminal.
FIRST_LINE = 60.0

Result = TypeVar("Result")
Positions = NDArray[np.integer[Any]]


class Local:
    """Workers of this machine by joblib: threads, or those that the user names with :func:`joblib.parallel_config`.

    The workers of a Dask scheduler have the same methods.

    Parameters
    ----------
    jobs : int, optional
        Number of workers; by default that of the user's configuration of joblib, or else all cores.
    """

    def __init__(self, jobs: int | None):
        # If threads are only preferred, joblib forgets the number that the user has set.
        self._jobs = jobs or get_active_backend()[1] or -1
        backend, _ = get_active_backend(prefer="threads")
        self._workers: int = backend.effective_n_jobs(self._jobs)
        self._shared = self._workers == 1 or getattr(backend, "supports_sharedmem", False)
        self._alone = 0 if self._shared else 1
        if not self._shared and not backend.supports_return_generator:
            problem = f"{type(backend).__name__} returns results only at the end: name another, as loky"
            raise InputError("joblib.parallel_config", problem)

    def concurrency(self) -> int:
        """Number of tasks that are computed at once, at this moment."""
        return self._workers

    def results(
        self,
        compute: Callable[[Positions], Result],
        tasks: Iterator[Positions],
        learn: Callable[[Result], Result],
        stopped: threading.Event,
    ) -> Generator[Result]:
        """Results in the order in which they are finished. The next task is taken when a worker is free for it.

        The calling thread only waits: compilation and kernels would hold up its reaction to Ctrl-C. A task that fails
        stops the sweep after the tasks under way; its error is raised when their results are handed over. If Ctrl-C
        ends the wait, or is thrown into the generator, what is finished is still handed over.

        Parameters
        ----------
        compute : callable
            Computes one task.
        tasks : iterator of ndarray
            Positions of the cells of each task.
        learn : callable
            Called with each result at once, before the next task is taken; returns the result.
        stopped : Event
            Once it is set, no more tasks are taken.
        """
        found: SimpleQueue[Result | BaseException | None] = SimpleQueue()
        lock, threads = threading.Lock(), self._workers if self._shared else 1
        parallel: Any = nullcontext()
        if not self._shared:
            parallel = joblib.Parallel(self._jobs, return_as="generator_unordered", batch_size=1)

        def outcomes() -> Iterator[Result | BaseException]:
            if not self._shared:
                _shield_from_interrupts()
                # The first task runs alone: the other processes find its kernels compiled.
                for some in (islice(tasks, self._alone), tasks):
                    yield from parallel(joblib.delayed(_attempt)(compute, task) for task in some)
                self._alone = 0
                return
            # A call of joblib for each task would cost a millisecond.
            while not stopped.is_set():
                with lock:
                    task = next(tasks, None)
                if task is None:
                    return
                yield _attempt(compute, task)

        def work() -> None:
            try:
                for outcome in outcomes():
                    if isinstance(outcome, BaseException):
                        stopped.set()
                    else:
                        with lock:
                            learn(outcome)
                    found.put(outcome)
            except BaseException as error:
                # Once the sweep is to stop, it is no news that workers ended with their tasks.
                if not stopped.is_set():
                    found.put(error)
            found.put(None)

        failure = None
        # Its exit kills processes that still have tasks.
        with parallel:
            try:
                for _ in range(threads):
                    # Daemons, so that a second Ctrl-C need not wait for their tasks.
                    threading.Thread(target=work, daemon=True).start()
                while threads:
                    if isinstance(item := found.get(), BaseException):
                        failure = failure or item
                    elif item is None:
                        threads -= 1
                    else:
                        yield item
            except KeyboardInterrupt:
                while not found.empty():
                    if (item := found.get()) is not None and not isinstance(item, BaseException):
                        yield item
                raise
        if failure is not None:
            raise failure


def _attempt(compute: Callable[[Positions], Result], task: Positions) -> Result | BaseException:
    """Result of a task, or its error: if a task raised it, joblib would drop what other tasks have finished."""
    try:
        return compute(task)
    except BaseException as error:
        return error


def _shield_from_interrupts() -> None:
    """Keep Ctrl-C from processes that this thread starts: a terminal sends it to them too, but tasks are to end."""
    if hasattr(signal, "pthread_sigmask"):
        # Its start would undo this before Python 3.12.
        resource_tracker.ensure_running()
        signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})


@dataclass(frozen=True)
class Execution:
    """How the tasks of a sweep are run.

    Attributes
    ----------
    jobs : int, optional
        Number of workers of this machine; see :class:`Local`.
    scheduler : str, optional
        Address of a Dask scheduler whose workers compute the cells.
    progress : bool
        Whether to show a progress bar, if there is a terminal or a notebook.
    """

    jobs: int | None = None
    scheduler: str | None = None
    progress: bool = True

    def open(self) -> AbstractContextManager[Local | Workers]:
        """Workers of this machine, or those of the Dask scheduler.

        Raises
        ------
        InputError
            If the number of workers is not positive, if a scheduler is given too, or if no scheduler answers.
        """
        if self.jobs is not None and self.jobs < 1:
            raise InputError("jobs", f"{self.jobs} threads cannot compute anything: give at least 1")
        if self.scheduler is None:
            return nullcontext(Local(self.jobs))
        if self.jobs is not None:
            raise InputError("--jobs", "is for threads of this machine: Dask's workers have numbers of their own")
        try:
            from ringsweep.runs import dask
        except ImportError:
            raise InputError("--scheduler", "Dask is not installed: pip install distributed") from None
        return dask.workers(self.scheduler)


def interruptible(function: Callable[[], Result]) -> Result:
    """Result of a function that runs in another thread, so that Ctrl-C ends the wait for it at once."""
    tasks = iter([np.empty(0, dtype=np.intp)])
    (result,) = Local(1).results(lambda _: function(), tasks, lambda result: result, threading.Event())
    return result


@contextmanager
def stop_on_interrupt() -> Iterator[threading.Event]:
    """Event that the first Ctrl-C or SIGTERM within the block sets. The second one acts as it does elsewhere.

    The interrupt that ends the block has the number of the first signal.
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
        logger.info("stopping when what is compiled and run now is done (Ctrl-C again: stop now and lose that)")
        restore()
        received.append(number)
        stopped.set()

    received: list[int] = []
    for number in before:
        signal.signal(number, interrupt)
    try:
        yield stopped
    except KeyboardInterrupt as error:
        error.args = error.args or tuple(received)
        raise
    finally:
        restore()


def progress_bar(total: int | None, progress: bool, done: int = 0, unit: str = "run") -> Any:
    """Progress bar over `total` runs or other units, or a count of them if their number is not known.

    It is shown only in a terminal or a notebook, and only if `progress` is true. Elsewhere, as in the log of a batch
    job, a line tells how far it is after a minute, and then each time that the time since the start has doubled.
    """
    # tqdm would hide the bar in a notebook, whose output is no terminal.
    shell = sys.modules["IPython"].get_ipython() if "IPython" in sys.modules else None
    notebook = hasattr(shell, "kernel")
    if progress and not notebook and not sys.stderr.isatty():
        seldom: dict[str, Any] = {"delay": FIRST_LINE, "mininterval": FIRST_LINE, "miniters": 1, "leave": False}
        return _ProgressLines(total=total, initial=done, unit=unit, file=io.StringIO(), **seldom)
    return bar(total=total, initial=done, unit=unit, disable=not progress)


class _ProgressLines(tqdm):
    """Progress as lines of a log."""

    def display(self, msg: str | None = None, pos: int | None = None) -> None:
        """Tell how far it is, and again when the time since the start has doubled; the end has the message ''."""
        since = self.format_dict["elapsed"]
        if since < FIRST_LINE or self.n == self.total or msg == "":
            return
        self.mininterval, left = since, ""
        if self.total is not None:
            rest = since * (self.total - self.n) / max(self.n - self.initial, 1)
            left = f" of {self.total}: about {duration(rest)} left"
        logger.info("%d %ss%s", self.n, self.unit, left)
