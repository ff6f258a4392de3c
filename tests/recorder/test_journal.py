"""The log, on stderr and in the flight."""

from __future__ import annotations

import io
import json

from flight_file.reports import LogLevel, LogLine
from recorder.journal import MAX_WAITING_LINES, Journal


def test_warnings_and_up_are_kept_for_the_flight() -> None:
    """All lines go to the stream as JSON, warnings and up wait for the flight as well, once."""
    stream = io.StringIO()
    journal = Journal(stream)
    journal.log.info("recording_started")
    journal.log.warning("frames_dropped", total=3)
    journal.log.error("disk_failed")

    assert [json.loads(line)["level"] for line in stream.getvalue().splitlines()] == ["info", "warning", "error"]
    assert journal.drain() == [
        LogLine(LogLevel.WARNING, 'frames_dropped {"total": 3}'),
        LogLine(LogLevel.ERROR, "disk_failed"),
    ]
    assert journal.drain() == []


def test_lines_that_find_no_room_are_counted() -> None:
    """A flood of warnings does not fill the memory, and says how many it swallowed."""
    journal = Journal(io.StringIO())
    for _ in range(MAX_WAITING_LINES + 5):
        journal.log.warning("again")
    lines = journal.drain()

    assert len(lines) == MAX_WAITING_LINES + 1
    assert lines[-1].message == "log_lines_lost 5"
    assert journal.drain() == []
