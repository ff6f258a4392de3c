"""Processes of this machine as workers.

Each has a pool of its own: a process that dies breaks its pool, and a pool that breaks gives up all it holds. So only
the flight that a process held is lost with it, and it is known which one that was.
"""

from __future__ import annotations

import multiprocessing
import os
import signal
import sys
import threading
import time
from concurrent.futures import Future, ProcessPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from dataclasses import dataclass, field
from multiprocessing.connection import wait
from types import FrameType, TracebackType
from typing import Self

from decoder import fork_server
from decoder.fleet.flights import FleetFlight
from decoder.fleet.one_flight import decode_one
from decoder.fleet.order import Order
from decoder.fleet.outcome import Outcome
from decoder.fleet.staging import remove_abandoned

PATIENCE_S = 20.0  # for a process that was told to stop, on a busy machine; one that does not is killed
ALONE_S = 3.0  # for a process whose parent is gone


def _new_pool() -> ProcessPoolExecutor:
    return ProcessPoolExecutor(1, fork_server.begin(), _begin)


@dataclass(slots=True)
class _Seat:
    """Room for one flight."""

    pool: ProcessPoolExecutor = field(default_factory=_new_pool)
    held: Future[Outcome] | None = None

    @property
    def is_free(self) -> bool:
        return self.held is None or self.held.done()

    def submit(self, flight: FleetFlight, order: Order) -> Future[Outcome]:
        try:
            self.held = self.pool.submit(decode_one, flight, order)
        except BrokenProcessPool:
            self.pool.shutdown(wait=False)
            self.pool = _new_pool()
            self.held = self.pool.submit(decode_one, flight, order)
        return self.held


class HomeWorkers:
    """So many processes; see `Workers`."""

    def __init__(self, processes: int) -> None:
        self._processes = processes
        self._seats: list[_Seat] = []

    def room(self) -> int:
        """One flight for each process."""
        return self._processes

    def submit(self, flight: FleetFlight, order: Order) -> Future[Outcome]:
        """Has a flight decoded by a process that has none; processes are started as they are needed."""
        free = next((seat for seat in self._seats if seat.is_free), None)
        if free is None:
            free = _Seat()
            self._seats.append(free)
        return free.submit(flight, order)

    def killed(self, error: BaseException) -> int:
        """A broken pool is one death: it had one process with one flight."""
        return int(isinstance(error, BrokenProcessPool))

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        for seat in self._seats:
            seat.pool.shutdown(wait=error is None, cancel_futures=True)
        if error is not None:
            _stop(multiprocessing.active_children())


def _stop(processes: list[multiprocessing.process.BaseProcess]) -> None:
    for process in processes:
        process.terminate()
    until = time.monotonic() + PATIENCE_S
    for process in processes:
        process.join(max(0.0, until - time.monotonic()))
        if process.is_alive():
            process.kill()
            process.join()
    remove_abandoned()


def _begin() -> None:
    """In a new process: it stops cleaning up when it is told to, or when its parent is gone; Ctrl-C is its parent's."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    signal.signal(signal.SIGTERM, _leave)
    parent = multiprocessing.parent_process()
    if parent is not None:
        threading.Thread(target=_follow, args=(parent.sentinel,), daemon=True).start()


def _leave(_number: int, _frame: FrameType | None) -> None:
    sys.exit(1)  # an exception: temporary folders are removed on its way


def _follow(parent: int) -> None:
    wait([parent])
    os.kill(os.getpid(), signal.SIGTERM)
    time.sleep(ALONE_S)  # for the flight to clean up; the pool's own loop would then wait for work that never comes
    os._exit(1)
