"""What a camera reports, in the journal and among the drops."""

from __future__ import annotations

from flight_file.reports import CameraStatus
from recorder.capture import Drops
from recorder.journal import Journal


class JournalReporter:
    """Hears a camera; see `camera_drivers.reporter`."""

    def __init__(self, journal: Journal, drops: Drops) -> None:
        self._journal = journal
        self._drops = drops

    def report(self, status: CameraStatus) -> None:
        """A line in the journal."""
        self._journal.log.warning("camera_reported", state=status.state, reason=status.reason)

    def lost(self, reason: str) -> None:
        """A drop."""
        self._drops.add(reason)

    def waiting(self, reason: str) -> None:
        """No news."""
