"""Going through a fleet: so many flights in work as there is room for, failures told apart from workers that die."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from concurrent.futures import FIRST_COMPLETED, CancelledError, Future, wait
from dataclasses import dataclass, replace

from decoder.errors import ClusterLost, VersionMismatch
from decoder.fleet.flights import FleetFlight
from decoder.fleet.order import Order
from decoder.fleet.outcome import Outcome, failed
from decoder.fleet.workers import Workers

MAX_KILLED = 2  # one death may be an accident, or another flight's doing
LOOK_S = 5.0  # between looks at who is there, while nothing comes
LOST = "the scheduler was lost; start it and run the same command again: finished flights are kept"


@dataclass(frozen=True, slots=True)
class _InWork:
    flight: FleetFlight
    killed: int = 0


def run_fleet(flights: Iterable[FleetFlight], order: Order, workers: Workers) -> Iterator[Outcome]:
    """What becomes of each flight, as it comes; no more flights are in work than there is room for.

    Raises
    ------
    ClusterLost
        If nobody is left to decode.
    VersionMismatch
        If a worker that joined later would decode otherwise.
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
            if workers.killed(error) and item.killed < MAX_KILLED:
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
