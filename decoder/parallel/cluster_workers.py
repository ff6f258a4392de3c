"""A dask.distributed cluster as workers; needs the extra `cluster`.

The scheduler itself gives a flight whose worker died to another worker, as often as its `allowed-failures` says.
"""

from __future__ import annotations

import asyncio
import logging
import socket
import time
import warnings
from concurrent.futures import Future
from types import TracebackType
from typing import Self
from urllib.parse import urlsplit

from distributed import Client, KilledWorker
from distributed.cfexecutor import ClientExecutor
from distributed.versions import VersionMismatchWarning

from decoder.panel.errors import ClusterLost, VersionMismatch
from decoder.parallel.flights import FleetFlight
from decoder.parallel.index import Outcome
from decoder.parallel.order import Order, installed, refuse_mismatch
from decoder.parallel.running import LOST, DecodeOne

CONNECT_S = 10.0
WORKERLESS_S = 60.0  # with no worker at all, before giving up


class ClusterWorkers:
    """The workers of a scheduler; see `Workers`.

    Raises
    ------
    ClusterLost
        From `with`, if the scheduler cannot be reached or has no workers.
    VersionMismatch
        From `with`, if a worker has other versions than this machine.
    """

    def __init__(self, scheduler: str, decode: DecodeOne) -> None:
        self._scheduler, self._decode = scheduler, decode

    def room(self) -> int:
        """Return one flight for each thread of the workers present now."""
        until = time.monotonic() + WORKERLESS_S
        while not (threads := self._threads()):
            if time.monotonic() > until:
                raise ClusterLost(
                    f"{self._scheduler}: has had no workers for {WORKERLESS_S:.0f} s; start some and run the same "
                    "command again: finished flights are kept"
                )
            time.sleep(1.0)
        return threads

    def _threads(self) -> int:
        try:
            return sum(map(int, self._client.nthreads().values()))
        except OSError as error:
            raise ClusterLost(LOST) from error

    def submit(self, flight: FleetFlight, order: Order) -> Future[Outcome]:
        """Have a flight decoded by one of the workers."""
        future: Future[Outcome] = self._executor.submit(self._decode, flight, order)
        return future

    def killed(self, error: BaseException) -> int:
        """Count as many deaths as the scheduler allowed."""
        return error.allowed_failures + 1 if isinstance(error, KilledWorker) else 0

    def __enter__(self) -> Self:
        _refuse_unreachable(self._scheduler)
        for name in ("distributed", "distributed.client", "tornado.application"):
            logging.getLogger(name).setLevel(logging.CRITICAL)  # losses are reported in our words
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", VersionMismatchWarning)  # our own check is stricter where it matters
            try:
                self._client = Client(self._scheduler, timeout=CONNECT_S, set_as_default=False)
            except (OSError, ValueError) as error:
                raise _no_scheduler(self._scheduler) from error
        self._client.sync(_drop_words_of_dropped_futures)
        self._executor = ClientExecutor(self._client, pure=False)
        try:
            self._check()
        except BaseException:
            self._client.close()
            raise
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._executor.shutdown(wait=False)
        self._client.close()

    def _check(self) -> None:
        """Refuse a cluster in which any worker would decode differently."""
        try:
            self._client.wait_for_workers(1, timeout=CONNECT_S)
        except TimeoutError as error:
            raise ClusterLost(
                f"{self._scheduler}: has no workers; start some with `dask worker {self._scheduler} --nthreads 1`"
            ) from error
        try:
            answers = self._client.run(installed)
        except ImportError as error:
            raise VersionMismatch(
                f"a worker of {self._scheduler} lacks {error.name}; install the same version of this package there"
            ) from error
        for worker, theirs in answers.items():
            refuse_mismatch(installed(), theirs, f"the worker {worker}")


async def _drop_words_of_dropped_futures() -> None:
    """Keep the client's event loop from telling what nobody waits for any more.

    The loop stops at a moment when the client's own sender may just have timed out, and would say so at the end of the
    process, although every flight is done. What does fail reaches us through the futures of flights.
    """
    asyncio.get_running_loop().set_exception_handler(lambda _loop, _context: None)


def _refuse_unreachable(scheduler: str) -> None:
    """Try a plain connection first, since a client that was never connected does not close cleanly."""
    try:
        where = urlsplit(scheduler)
        if where.hostname is None or where.port is None:
            raise _no_scheduler(scheduler)
        socket.create_connection((where.hostname, where.port), CONNECT_S).close()
    except (OSError, ValueError) as error:
        raise _no_scheduler(scheduler) from error


def _no_scheduler(scheduler: str) -> ClusterLost:
    return ClusterLost(
        f"{scheduler}: there is no scheduler; start one with `dask scheduler` and give its address, tcp://HOST:PORT"
    )
