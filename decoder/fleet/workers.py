"""The seam between a fleet and who decodes it: processes of this machine, or a cluster."""

from __future__ import annotations

from concurrent.futures import Future
from types import TracebackType
from typing import Protocol, Self

from decoder.fleet.flights import FleetFlight
from decoder.fleet.order import Order
from decoder.fleet.outcome import Outcome


class Workers(Protocol):
    """Those who decode flights; used in a `with` block, at whose end none of them works on for us.

    An error that leaves the block, Ctrl-C too, stops what is in work.
    """

    def room(self) -> int:
        """How many flights may be in work at once.

        Raises
        ------
        ClusterLost
            If there is nobody left to work.
        """
        ...

    def submit(self, flight: FleetFlight, order: Order) -> Future[Outcome]:
        """Has a flight decoded; called only where fewer are in work than there is room for."""
        ...

    def killed(self, error: BaseException) -> int:
        """How many workers died of a flight that ended with this error; 0 if it was no death."""
        ...

    def __enter__(self) -> Self: ...

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None: ...
