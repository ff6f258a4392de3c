"""Processing a fleet: as many flights at a time as there is room for; failures are told from workers that die."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import FIRST_COMPLETED, CancelledError, Future, wait
from concurrent.futures.process import BrokenProcessPool
from contextlib import AbstractContextManager
from dataclasses import dataclass, replace
from types import TracebackType
from typing import Protocol, Self

from decoder.panel.errors import ClusterLost, VersionMismatch
from decoder.parallel.flights import FleetFlight
from decoder.parallel.fork_server import WorkerProcess, stop
from decoder.parallel.index import Outcome, failed
from decoder.parallel.order import Order
from decoder.parallel.store import remove_abandoned
from decoder.parallel.thresholds import DEATHS

DecodeOne = Callable[[FleetFlight, Order], Outcome]
"""Decodes one flight as the order says."""

LOOK_S = 5.0  # between checks for workers, while nothing arrives
LOST = "the scheduler was lost; start it and run the same command again: finished flights are kept"


class Workers(AbstractContextManager["Workers"], Protocol):
    """Whatever decodes flights; used in a `with` block, at whose end none of them still works for us.

    An error that leaves the block, including Ctrl-C, stops what is in work.
    """

    def room(self) -> int:
        """Return how many flights may be in work at once.

        Raises
        ------
        ClusterLost
            If no worker is left.
        """
        ...

    def submit(self, flight: FleetFlight, order: Order) -> Future[Outcome]:
        """Have a flight decoded; called only if fewer are in work than there is room for."""
        ...

    def killed(self, error: BaseException) -> int:
        """Return how many workers died of a flight that ended with this error; 0 if it was not a death."""
        ...


class HomeWorkers:
    """A number of processes on this machine; see `Workers`."""

    def __init__(self, processes: int, decode: DecodeOne) -> None:
        self._processes, self._decode = processes, decode
        self._workers: dict[WorkerProcess, Future[Outcome]] = {}

    def room(self) -> int:
        """Return one flight for each process."""
        return self._processes

    def submit(self, flight: FleetFlight, order: Order) -> Future[Outcome]:
        """Have a flight decoded by an idle process; processes are started as needed."""
        worker = next((each for each, held in self._workers.items() if held.done()), None) or WorkerProcess()
        try:
            future = worker.submit(self._decode, flight, order)
        except BrokenProcessPool:
            worker.dismiss()
            del self._workers[worker]
            return self.submit(flight, order)
        self._workers[worker] = future
        return future

    def killed(self, error: BaseException) -> int:
        """Count a broken pool as one death: it had one process with one flight."""
        return int(isinstance(error, BrokenProcessPool))

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        if error is None:
            for worker in self._workers:
                worker.dismiss()
        else:
            stop(self._workers)
            remove_abandoned()


@dataclass(frozen=True, slots=True)
class _InWork:
    flight: FleetFlight
    killed: int = 0


def run_fleet(flights: Iterable[FleetFlight], order: Order, workers: Workers) -> Iterator[Outcome]:
    """Decode flights, yielding each outcome as it comes; no more are in work than there is room for.

    Raises
    ------
    ClusterLost
        If no worker is left.
    VersionMismatch
        If a worker that joined later would decode differently.
    """
    coming = map(_InWork, flights)
    held: dict[Future[Outcome], _InWork] = {}
    again: list[_InWork] = []
    while True:
        for item in _next(again, coming, workers.room() - len(held)):
            held[workers.submit(item.flight, order)] = item
        if not held:
            return
        for future in wait(held, timeout=LOOK_S, return_when=FIRST_COMPLETED).done:
            item = held.pop(future)
            error = _error(future)
            if error is None:
                yield future.result()
                continue
            item = replace(item, killed=item.killed + workers.killed(error))
            if workers.killed(error) and item.killed < DEATHS:
                again.append(item)
            else:
                yield failed(item.flight, _reason(item, error))


def _next(again: list[_InWork], coming: Iterator[_InWork], room: int) -> Iterator[_InWork]:
    for _ in range(room):
        if again:
            yield again.pop()
        elif (item := next(coming, None)) is not None:
            yield item


def _error(future: Future[Outcome]) -> BaseException | None:
    try:
        error = future.exception()
    except CancelledError as lost:
        raise ClusterLost(LOST) from lost
    if isinstance(error, ImportError):
        raise VersionMismatch(f"a worker lacks {error.name}; install the same version of this package there") from error
    if isinstance(error, VersionMismatch):
        raise error
    return error


def _reason(item: _InWork, error: BaseException) -> str:
    if item.killed:
        return (
            f"its worker was killed {item.killed} times over it (too little memory?); "
            "decode it by itself, with `decode flight`"
        )
    kind = type(error).__name__
    return f"unexpected {kind}: {error}; decode it by itself, with `decode flight`, and report what it says"
