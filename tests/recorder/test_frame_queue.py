"""What waits between threads: frames for the writer, and lines of the log for the flight."""

from __future__ import annotations

import fcntl
import io
import json
import os
import threading
from pathlib import Path

from flight_file.frame import CameraStatus, ClockReading, Frame, HostTimes, LogLevel, LogLine
from recorder.frame_queue import Arrival, Ended, FrameQueue, Notice
from recorder.journal import Journal
from recorder.thresholds import WAITING_LINES
from tests.recorder.helpers import stuck_pipe

AT = ClockReading(0, 0)


def notice(state: str) -> Notice:
    """News."""
    return Notice(CameraStatus(state), AT)


def arrival(sequence: int, jpeg: bytes = b"") -> Arrival:
    """A frame."""
    return Arrival(Frame(sequence, 0, jpeg, "", HostTimes(AT, AT, AT)), AT)


def test_full_queue_keeps_the_newest() -> None:
    """The oldest makes room, and the producer hears of it; it is full of bytes, too, but one picture always fits."""
    queue = FrameQueue(capacity=2)

    assert [queue.push(arrival(number)) for number in range(4)] == [0, 0, 1, 1]
    assert [queue.take(0), queue.take(0), queue.take(0)] == [arrival(2), arrival(3), None]
    by_bytes = FrameQueue(capacity=10, capacity_bytes=100)
    assert [by_bytes.push(arrival(size, bytes(size))) for size in (500, 1, 50, 50, 50)] == [0, 1, 0, 1, 1]


def test_notices_keep_their_place_among_the_frames() -> None:
    """A frame that makes room takes no notice with it; the end comes last, even when the queue is full."""
    queue = FrameQueue(capacity=1)
    for number in range(3):
        queue.notify(notice(str(number)))
        queue.push(arrival(number))

    queue.end(Ended("over", AT))

    assert len(queue) == 1
    assert [queue.take(0) for _ in range(5)] == [*map(notice, "012"), arrival(2), Ended("over", AT)]


def test_notices_do_not_fill_the_memory() -> None:
    """The oldest ones go, and are counted."""
    queue = FrameQueue()
    for number in range(WAITING_LINES + 3):
        queue.notify(notice(str(number)))

    assert queue.take(0) == notice("3")
    assert (queue.take_lost_notices(), queue.take_lost_notices()) == (3, 0)


def test_patient_producer_waits_for_room() -> None:
    """`put` comes back when the consumer has made room; told to stop, it says that the frame was not taken."""
    queue = FrameQueue(capacity=1)
    queue.push(arrival(0))
    results, stop = list[bool](), threading.Event()
    producer = threading.Thread(target=lambda: results.append(queue.put(arrival(1), stop)))
    producer.start()
    first = queue.take(5)
    producer.join(5)
    stop.set()

    assert first == arrival(0)
    assert results == [True]
    assert queue.put(arrival(2), stop) is False
    assert queue.take(5) == arrival(1)


def test_warnings_and_up_are_kept_for_the_flight() -> None:
    """All lines go to the stream as JSON, warnings and up wait for the flight, once; a flood of them is counted."""
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
    for _ in range(WAITING_LINES + 5):
        journal.log.warning("again")
    assert [line.message for line in journal.drain()] == ["again"] * WAITING_LINES + ["log_lines_lost 5"]


def test_lines_that_a_full_disk_refuses_are_counted_in_the_flight() -> None:
    """They cost their writer nothing, and the next look at the log tells once how many there were."""
    with Path("/dev/full").open("wb", buffering=0) as full:
        journal = Journal(descriptor=full.fileno())
        for _ in range(3):
            journal.log.info("recording_started")
        journal.settle()

    assert journal.drain() == [LogLine(LogLevel.WARNING, "log_lines_unwritten 3")]
    assert journal.drain() == []


def test_log_that_nobody_reads_holds_up_nobody() -> None:
    """A stuck pipe takes none of many lines: what waits is limited, the rest is counted, and it goes on when read."""
    reading, writing = stuck_pipe()
    journal = Journal(descriptor=writing)
    for number in range(WAITING_LINES + 5):
        journal.log.info("again", number=number)
    counted = journal.drain()
    with os.fdopen(reading, encoding="utf-8") as reader:
        first = next(line for line in reader if "again" in line)

    assert counted == [LogLine(LogLevel.WARNING, "log_lines_unwritten 5")]
    assert '"number": 0' in first


def test_line_after_a_torn_one_begins_anew() -> None:
    """What a full pipe took of a line has no end: the next line is not glued to it."""
    reading, writing = os.pipe()
    os.set_blocking(writing, False)
    journal = Journal(descriptor=writing)
    journal.log.info("torn", text="x" * fcntl.fcntl(writing, fcntl.F_GETPIPE_SZ))
    journal.settle()
    os.set_blocking(writing, True)
    with os.fdopen(reading, encoding="utf-8") as reader:
        os.read(reading, 4096)
        journal.log.info("whole")
        journal.log.info("last")
        lines = [next(reader) for _ in range(3)]

    assert [json.loads(line)["event"] for line in lines[1:]] == ["whole", "last"]
    assert journal.drain() == [LogLine(LogLevel.WARNING, "log_lines_unwritten 1")]
