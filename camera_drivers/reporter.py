"""A camera driver's reports beside the pictures: changes of state, lost pictures, waiting."""

from __future__ import annotations

from typing import Protocol

from flight_file.frame import CameraStatus


class Reporter(Protocol):
    """Takes a driver's reports; called from the driver's thread, it never blocks or raises.

    A driver calls it at least every few seconds as long as it makes progress or has reason to wait. Silence means that
    it hangs.
    """

    def report(self, status: CameraStatus) -> None:
        """Record a change of the camera's state or an event in the flight; `dropped` is ignored."""
        ...

    def lost(self, reason: str) -> None:
        """Count a picture, perhaps taken, that cannot be fetched; `reason` is short, without numbers."""
        ...

    def waiting(self, reason: str) -> None:
        """Report a wait that is in order: the next picture is not due yet, or a call runs within its limit."""
        ...
