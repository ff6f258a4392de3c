"""What is worth a line in the flight, each thing once however often the camera is connected again."""

from __future__ import annotations

from camera_drivers.reporter import Reporter
from flight_file.reports import CameraStatus


class Notes:
    """Reports, but not the same thing twice."""

    def __init__(self, reporter: Reporter) -> None:
        self._reporter = reporter
        self._said: set[tuple[str, str]] = set()

    def say(self, state: str, reason: str) -> None:
        """Report it."""
        self._reporter.report(CameraStatus(state, reason))

    def say_once(self, state: str, reason: str) -> None:
        """Report it unless that was done before; `reason` must come from a limited number of sentences."""
        if (state, reason) not in self._said:
            self._said.add((state, reason))
            self.say(state, reason)
