"""The recorder's log: JSON lines on stderr, and warnings and up also in the flight.

Event names are snake_case, noun before verb; everything variable is in keys.
"""

from __future__ import annotations

import json
import sys
import threading
from collections import deque
from collections.abc import MutableMapping
from typing import Any, TextIO

import structlog
from structlog.typing import FilteringBoundLogger, Processor

from flight_file.frame import LogLevel, LogLine
from recorder.thresholds import WAITING_LINES

_LEVELS = {"warning": LogLevel.WARNING, "error": LogLevel.ERROR, "critical": LogLevel.FATAL}


class Journal:
    """A logger, and the lines of it that wait to be stored in the flight. Each recording has its own.

    All threads may use it.
    """

    def __init__(self, stream: TextIO | None = None) -> None:
        self._waiting: deque[LogLine] = deque()
        self._lost = 0
        self._lock = threading.Lock()
        processors: list[Processor] = [
            structlog.processors.add_log_level,
            self._keep,
            structlog.processors.TimeStamper(fmt="iso", utc=True),
            structlog.processors.JSONRenderer(),
        ]
        self.log: FilteringBoundLogger = structlog.wrap_logger(
            structlog.PrintLogger(stream or sys.stderr),
            processors=processors,
            wrapper_class=structlog.make_filtering_bound_logger("info"),
        )

    def drain(self) -> list[LogLine]:
        """Return the lines since the last call."""
        with self._lock:
            lines = list(self._waiting)
            self._waiting.clear()
            if self._lost:
                lines.append(LogLine(LogLevel.WARNING, f"log_lines_lost {self._lost}"))
                self._lost = 0
            return lines

    def _keep(self, _logger: object, level: str, event: MutableMapping[str, Any]) -> MutableMapping[str, Any]:
        if level in _LEVELS:
            with self._lock:
                if len(self._waiting) < WAITING_LINES:
                    self._waiting.append(LogLine(_LEVELS[level], _text(event)))
                else:
                    self._lost += 1
        return event


def _text(event: MutableMapping[str, Any]) -> str:
    details = {key: value for key, value in event.items() if key not in ("event", "level")}
    return f"{event['event']} {json.dumps(details, default=str)}" if details else str(event["event"])
