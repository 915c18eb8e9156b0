"""Partial on the workers of a Dask scheduler."""

from __future__ import annotations

import logging
import math
import secrets
import socket
from collections.abc import Callable, Generator, Iterator
from concurrent.futures import CancelledError
from contextlib import contextmanager, suppress
from itertools import islice
from threading import Event
from time import monotonic
from typing import Any, TypeVar

import numpy as np
from distributed import Client, as_completed
from distributed.comm.addressing import parse_address, parse_host_port
from distributed.diagnostics.plugin import WorkerPlugin
from numpy.typing import NDArray

from ringsweep.errors import InputError

logger = logging.getLogger("ringsweep")

Result = TypeVar("Result")
Positions = NDArray[np.integer[Any]]

# Seconds to wait for a scheduler.
_PATIENCE = 10.0

# Seconds between counts of the workers.
_TICK = 0.5

# In a worker: tasks by their key.
_tasks: dict[str, Callable[[Positions], Any]] = {}


class _Shared(WorkerPlugin):
    """Hands a task to every worker once, and to those that come later."""

    def __init__(self, key: str, task: Callable[[Positions], Any]):
        self.name = f"ringsweep-{key}"
        self.key = key
        self.task = task

    def setup(self, worker: Any) -> None:
        _tasks[self.key] = self.task

    def teardown(self, worker: Any) -> None:
        _tasks.pop(self.key, None)


def _run(key: str, task: Positions) -> Any:
    return _tasks[key](task)


def connect(address: str) -> Client:
    """A client of the scheduler at this address.

    Raises
    ------
    InputError
        If nothing answers there.
    """
    try:
        # A client that finds nobody goes on trying in the background, and complains there.
        protocol, place = parse_address(address)
        if protocol in ("tcp", "tls"):
            socket.create_connection(parse_host_port(place, 8786), timeout=_PATIENCE).close()
        return Client(address, timeout=_PATIENCE, set_as_default=False, name="ringsweep")
    except (OSError, ValueError, TypeError) as error:
        raise InputError("--scheduler", f"no Dask scheduler answers at {address!r}: {error}") from error


@contextmanager
def workers(address: str) -> Iterator[Workers]:
    """The workers of the scheduler at this address, until the end of the block; errors as for :func:`connect`."""
    with connect(address) as client:
        yield Workers(client)


class Workers:
    """The workers of a scheduler: an :class:`ringsweep.runs.executors.Executor`."""

    def __init__(self, client: Client):
        self.client = client
        self._count, self._counted = 0, -math.inf

    def threads(self) -> int:
        """Threads that the workers have; the scheduler, which is far away, is asked now and then."""
        if monotonic() - self._counted > _TICK:
            self._count, self._counted = sum(self.client.nthreads().values()), monotonic()
        return self._count

    def results(
        self,
        compute: Callable[[Positions], Result],
        tasks: Iterator[Positions],
        learn: Callable[[Result], Result],
        stopped: Event,
    ) -> Generator[Result]:
        """Results as they come.

        A task whose worker dies goes to another worker; a task that takes several workers with it raises
        `distributed.KilledWorker`. (joblib's backend for Dask waits for ever then, and counts workers at the start
        only.)
        """
        key = secrets.token_hex(8)
        plugin = _Shared(key, compute)
        self.client.register_plugin(plugin)
        try:
            futures = as_completed(loop=self.client.loop, with_results=True)

            def fill() -> None:
                # One more than each thread computes, so that none waits for the next.
                for task in islice(tasks, max(0, max(2, 2 * self.threads()) - futures.count())):
                    futures.add(self.client.submit(_run, key, task, pure=False))

            fill()
            if not self.threads():
                logger.warning("the scheduler has no worker yet: waiting for one")
                while not self.threads():
                    if stopped.wait(_TICK):
                        return
            for _, result in futures:
                yield learn(result)
                fill()
        except (OSError, CancelledError) as error:
            raise ConnectionError(f"the Dask scheduler is gone ({error})") from error
        finally:
            with suppress(OSError):
                self.client.unregister_worker_plugin(plugin.name)
