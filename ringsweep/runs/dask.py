"""Execution of tasks by the workers of a Dask scheduler."""

from __future__ import annotations

import asyncio
import logging
import math
import secrets
import socket
from collections.abc import Callable, Generator, Iterator
from concurrent.futures import CancelledError
from contextlib import contextmanager, suppress
from itertools import islice
from threading import Event, Thread
from time import monotonic
from typing import Any, TypeVar

import numpy as np
from distributed import Client, KilledWorker, as_completed
from distributed.comm.addressing import parse_address, parse_host_port
from distributed.diagnostics.plugin import WorkerPlugin
from numpy.typing import NDArray

from ringsweep.errors import InputError

logger = logging.getLogger("ringsweep")

Result = TypeVar("Result")
Positions = NDArray[np.integer[Any]]

# Seconds to wait for an answer of the scheduler, and for it to take leave.
_TIMEOUT, _LEAVE = 10.0, 2.0

# What other addresses mean, a Client finds out after many seconds, and then its own clean-up fails.
_PROTOCOLS = ("tcp", "tls", "ucx", "ws", "wss")

_CURE = "a limit of memory below 1 GB is too small for a worker: dask worker ADDRESS --memory-limit 2GB"

# Seconds between two counts of the workers.
_COUNT_INTERVAL = 0.5

# In a worker: functions that compute tasks, by key of their sweep.
_compute: dict[str, Callable[[Positions], Any]] = {}


class _SendCompute(WorkerPlugin):
    """Sends the function that computes tasks to every worker once, also to workers that come later."""

    def __init__(self, key: str, compute: Callable[[Positions], Any]):
        self.name = f"ringsweep-{key}"
        self.key = key
        self.compute = compute

    def setup(self, worker: Any) -> None:
        _compute[self.key] = self.compute

    def teardown(self, worker: Any) -> None:
        _compute.pop(self.key, None)


def _run_task(key: str, task: Positions) -> Any:
    return _compute[key](task)


@contextmanager
def workers(address: str) -> Iterator[Workers]:
    """The workers of the scheduler at this address; the connection is closed at the end of the block.

    Raises
    ------
    InputError
        If no scheduler answers at the address.
    """
    try:
        # A Client would go on trying in the background, and log errors there.
        protocol, location = parse_address(address)
        if protocol not in _PROTOCOLS:
            raise ValueError(f"give tcp://HOST:PORT or tls://HOST:PORT, as the scheduler prints it, not {protocol}://")
        if protocol in ("tcp", "tls"):
            socket.create_connection(parse_host_port(location, 8786), timeout=_TIMEOUT).close()
        client = Client(address, timeout=_TIMEOUT, set_as_default=False, name="ringsweep")
    except (OSError, ValueError, TypeError) as error:
        raise InputError("--scheduler", f"no Dask scheduler answers at {address!r}: {error}") from error
    workers = Workers(client)
    try:
        yield workers
    finally:
        # To close a client that has lost its scheduler, Dask would use an event loop that it has closed.
        if workers.is_connected():
            _leave(client.close)


def _leave(farewell: Callable[[], Any]) -> None:
    """Call a function, and wait a little for it: a scheduler that is frozen does not answer."""

    def say() -> None:
        with suppress(Exception, asyncio.CancelledError):
            farewell()

    thread = Thread(target=say, daemon=True)
    thread.start()
    thread.join(_LEAVE)


class Workers:
    """The workers of a scheduler: they take tasks as :class:`ringsweep.runs.executors.Local` does."""

    def __init__(self, client: Client):
        self.client = client
        self._threads, self._counted = 0, -math.inf

    def concurrency(self) -> int:
        """Number of threads of all workers, counted again from time to time."""
        if monotonic() - self._counted > _COUNT_INTERVAL:
            self._threads, self._counted = sum(self.client.nthreads().values()), monotonic()
        return self._threads

    def results(
        self,
        compute: Callable[[Positions], Result],
        tasks: Iterator[Positions],
        learn: Callable[[Result], Result],
        stopped: Event,
    ) -> Generator[Result]:
        """Results in the order in which they are finished; see :class:`ringsweep.runs.executors.Local`.

        If a worker dies, its task goes to another worker. A task that kills several workers raises
        `distributed.KilledWorker`. (joblib's Dask backend would then wait for ever, and counts the workers only once.)
        """
        key = secrets.token_hex(8)
        plugin = _SendCompute(key, compute)
        self.client.register_plugin(plugin)
        try:
            futures = as_completed(loop=self.client.loop, with_results=True)

            def submit() -> None:
                # Two tasks per thread, so that no thread waits for its next task.
                for task in islice(tasks, max(0, max(2, 2 * self.concurrency()) - futures.count())):
                    futures.add(self.client.submit(_run_task, key, task, pure=False))

            submit()
            if not self.concurrency():
                logger.warning("the scheduler has no worker yet: waiting for one (%s)", _CURE)
                while not self.concurrency():
                    if stopped.wait(_COUNT_INTERVAL):
                        return
            for _, result in futures:
                # Tasks that the client gives up have an error in place of a result.
                if isinstance(result, BaseException):
                    raise result
                yield learn(result)
                submit()
        except KilledWorker as error:
            raise InputError("--scheduler", f"several workers died with the same cells: {_CURE}") from error
        except (Exception, asyncio.CancelledError) as error:
            # Dask raises errors of many kinds once its connection is lost.
            if isinstance(error, OSError | CancelledError | asyncio.CancelledError) or not self.is_connected():
                raise ConnectionError("the connection to the Dask scheduler is lost") from error
            raise
        finally:
            if self.is_connected():
                _leave(lambda: self.client.unregister_worker_plugin(plugin.name))

    def is_connected(self) -> bool:
        """Whether the client has not lost its scheduler."""
        return self.client.status == "running"
