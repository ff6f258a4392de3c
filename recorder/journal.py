"""The recorder's log: JSON lines on stderr, and warnings and up also in the flight.

Event names are snake_case, noun before verb; everything variable is in keys.
"""

from __future__ import annotations

import json
import os
import threading
from collections import deque
from collections.abc import MutableMapping
from contextlib import suppress
from typing import Any, TextIO, cast

import structlog
from structlog.typing import FilteringBoundLogger, Processor

from flight_file.frame import LogLevel, LogLine
from recorder.thresholds import TICK_S, WAITING_LINES

_STDERR = 2  # not `sys.stderr`, which keeps text that it could not write, and fails with it again
_LEVELS = {"warning": LogLevel.WARNING, "error": LogLevel.ERROR, "critical": LogLevel.FATAL}


class PatientStream:
    """A text stream onto a descriptor that may be full, broken or stuck: whoever writes to it neither waits nor fails.

    A separate thread writes, so a reader that stopped reading holds up nobody else. Text that finds no room, or that
    the system refuses, is counted.
    """

    def __init__(self, descriptor: int) -> None:
        self._descriptor = descriptor
        self._waiting: deque[bytes] = deque()  # the first is being written
        self._unwritten = 0
        self._changed = threading.Condition()
        self._thread: threading.Thread | None = None

    def write(self, text: str) -> None:
        """Queue a text, to be written as soon as the descriptor takes it."""
        with self._changed:
            if len(self._waiting) >= WAITING_LINES:
                self._unwritten += 1
                return
            self._waiting.append(text.encode(errors="backslashreplace"))
            self._changed.notify_all()
            if self._thread is None:
                self._thread = threading.Thread(target=self._write_for_ever, name="log", daemon=True)
                self._thread.start()

    def flush(self) -> None:
        """Do nothing: nobody waits."""

    def settle(self, limit_s: float) -> None:
        """Wait until all is written, at most so long; for the end."""
        with self._changed:
            self._changed.wait_for(lambda: not self._waiting, limit_s)

    def take_unwritten(self) -> int:
        """Return how many texts could not be written since the last call."""
        with self._changed:
            unwritten, self._unwritten = self._unwritten, 0
            return unwritten

    def _write_for_ever(self) -> None:
        is_torn = False  # the last line on the descriptor has no end
        while True:
            with self._changed:
                self._changed.wait_for(lambda: self._waiting)
                text = b"\n" * is_torn + self._waiting[0]
            written = _write_as_far_as_it_goes(self._descriptor, text)
            if written:
                is_torn = not text[:written].endswith(b"\n")
            with self._changed:
                self._unwritten += written < len(text)
                self._waiting.popleft()
                self._changed.notify_all()


def _write_as_far_as_it_goes(descriptor: int, text: bytes) -> int:
    written = 0
    with suppress(OSError):  # there is no other place to say so; it is counted, and the flight says it
        while written < len(text):
            written += os.write(descriptor, text[written:])
    return written


class Journal:
    """A logger, and the lines of it that wait to be stored in the flight. Each recording has its own.

    All threads may use it, and none waits for it.

    Parameters
    ----------
    stream
        Where the lines go, if not to stderr; it must take them at once.
    descriptor
        Used as stderr.
    """

    def __init__(self, stream: TextIO | None = None, *, descriptor: int = _STDERR) -> None:
        self._waiting: deque[LogLine] = deque()
        self._lost = 0
        self._lock = threading.Lock()
        self._stderr = PatientStream(descriptor)
        processors: list[Processor] = [
            structlog.processors.add_log_level,
            self._keep,
            structlog.processors.TimeStamper(fmt="iso", utc=True),
            structlog.processors.JSONRenderer(),
        ]
        self.log: FilteringBoundLogger = structlog.wrap_logger(
            structlog.WriteLogger(stream or cast("TextIO", self._stderr)),
            processors=processors,
            wrapper_class=structlog.make_filtering_bound_logger("info"),
        )

    def drain(self) -> list[LogLine]:
        """Return the lines since the last call, and lines on how many were left out or never reached stderr."""
        with self._lock:
            lines = list(self._waiting)
            self._waiting.clear()
            if self._lost:
                lines.append(LogLine(LogLevel.WARNING, f"log_lines_lost {self._lost}"))
                self._lost = 0
        if unwritten := self._stderr.take_unwritten():
            lines.append(LogLine(LogLevel.WARNING, f"log_lines_unwritten {unwritten}"))
        return lines

    def settle(self) -> None:
        """Give the last lines a moment to be written; for the end."""
        self._stderr.settle(TICK_S)

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
