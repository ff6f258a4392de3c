"""Who hears what a driver says beside its pictures."""

from __future__ import annotations

from dataclasses import dataclass, field

from flight_file.frame import CameraStatus


@dataclass
class Listener:
    """A reporter that remembers."""

    reports: list[CameraStatus] = field(default_factory=list)
    losses: list[str] = field(default_factory=list)
    waits: list[str] = field(default_factory=list)

    def report(self, status: CameraStatus) -> None:
        """Remember it."""
        self.reports.append(status)

    def lost(self, reason: str) -> None:
        """Remember it."""
        self.losses.append(reason)

    def waiting(self, reason: str) -> None:
        """Remember it."""
        self.waits.append(reason)

    def reasons(self, state: str) -> list[str]:
        """What was reported under a state."""
        return [status.reason for status in self.reports if status.state == state]
