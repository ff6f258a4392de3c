"""How a camera driver tells its user what happens beside the pictures: changes of state, lost pictures, waiting."""

from __future__ import annotations

from typing import Protocol

from flight_file.reports import CameraStatus


class Reporter(Protocol):
    """Takes a driver's reports; made to be called from the driver's thread, and never blocks or raises.

    A driver calls it at least every few seconds as long as it makes progress or waits with good reason. Silence means
    that it hangs.
    """

    def report(self, status: CameraStatus) -> None:
        """The camera's state has changed, or something is worth a line in the flight; `dropped` is ignored."""
        ...

    def lost(self, reason: str) -> None:
        """A picture was taken, or may have been, but cannot be had; `reason` is short and has no numbers in it."""
        ...

    def waiting(self, reason: str) -> None:
        """Nothing comes, and that is in order: the next picture is not due yet, or a call runs within its limit."""
        ...
