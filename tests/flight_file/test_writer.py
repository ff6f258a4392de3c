"""What is on the disk, and when."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path

import pytest
from mcap.reader import make_reader

from flight_file.errors import FlightNotWrittenError
from flight_file.frame import ClockReading, Frame
from flight_file.reader import open_flight
from flight_file.reports import CameraStatus
from flight_file.segments import FlightWriter, Plan
from flight_file.session import Session
from flight_file.topics import TOPICS
from flight_file.writer import SegmentWriter

START = ClockReading(1_525_435_200_000_000_000, 50)
MakeFrame = Callable[..., Frame]


def start(path: Path) -> SegmentWriter:
    """A segment with nothing in it yet."""
    return SegmentWriter(path, session=Session("R", started=START), status=CameraStatus("connected"), attachments={})


def later(seconds: float) -> ClockReading:
    """So long after the start."""
    return ClockReading(START.realtime_ns + int(seconds * 1e9), START.monotonic_ns + int(seconds * 1e9))


def test_file_in_work_is_named_so_until_it_is_finished(tmp_path: Path) -> None:
    """Copy tools can tell by the name: `.part` while in work, the plain name afterwards."""
    path = tmp_path / "R_0000.mcap"
    writer = start(path)

    assert [found.name for found in tmp_path.iterdir()] == ["R_0000.mcap.part"]
    assert writer.finish("stopped", dropped=0, at=START) == path
    assert [found.name for found in tmp_path.iterdir()] == ["R_0000.mcap"]


def test_frame_is_on_the_disk_a_second_later(tmp_path: Path, make_frame: MakeFrame) -> None:
    """Small frames wait for company at most a second, then they can be read from the unfinished file."""
    writer = start(tmp_path / "R_0000.mcap")
    part = tmp_path / "R_0000.mcap.part"
    writer.write_frame(make_frame(0), later(0.1))
    waiting = list(open_flight([part]).frames())
    writer.tick(later(1.1))

    assert waiting == []
    assert list(open_flight([part]).frames()) == [make_frame(0)]
    writer.abandon()


def test_large_frame_closes_its_chunk_at_once(tmp_path: Path, make_frame: MakeFrame) -> None:
    """A picture of a chunk's size is handed to the system without waiting for the clock."""
    writer = start(tmp_path / "R_0000.mcap")
    writer.write_frame(make_frame(0, 100_000), later(0.1))

    assert len(list(open_flight([tmp_path / "R_0000.mcap.part"]).frames())) == 1
    writer.abandon()


def test_log_time_follows_the_monotonic_clock(tmp_path: Path, make_frame: MakeFrame) -> None:
    """Setting the wall clock back by years moves no log time: it never runs backwards."""
    writer = start(tmp_path / "R_0000.mcap")
    writer.write_frame(make_frame(0), later(1))
    writer.write_frame(make_frame(1), ClockReading(realtime_ns=5, monotonic_ns=later(2).monotonic_ns))
    path = writer.finish("stopped", dropped=0, at=later(3))
    with path.open("rb") as file:
        times = [message.log_time for _, _, message in make_reader(file).iter_messages(log_time_order=False)]

    assert times == sorted(times)
    assert times[-1] == START.realtime_ns + 2 * 10**9


def test_finished_name_is_never_overwritten(tmp_path: Path) -> None:
    """A file that appeared under the final name meanwhile is left alone."""
    path = tmp_path / "R_0000.mcap"
    writer = start(path)
    path.write_bytes(b"somebody else's")

    with pytest.raises(FlightNotWrittenError, match="another name"):
        writer.finish("stopped", dropped=0, at=START)
    assert path.read_bytes() == b"somebody else's"


def test_missing_directory_is_one_sentence(tmp_path: Path) -> None:
    """Writing where nothing is says what to do."""
    with pytest.raises(FlightNotWrittenError, match=r"create the directory first\.$"):
        start(tmp_path / "no" / "R_0000.mcap")


def test_existing_segment_is_one_sentence(tmp_path: Path) -> None:
    """A recording does not begin over another one."""
    plan = Plan(tmp_path, Session("R"), {})
    FlightWriter(plan, status=CameraStatus("connected"), at=START).finish("stopped", START)

    with pytest.raises(FlightNotWrittenError, match="another name"):
        FlightWriter(plan, status=CameraStatus("connected"), at=START)


def test_every_json_schema_describes_its_fields() -> None:
    """Each JSON topic has a schema whose every field has a description, so that a viewer can show its unit."""
    for topic in TOPICS:
        if topic.schema_encoding == "jsonschema":
            schema = json.loads(topic.schema)

            assert set(schema["required"]) <= set(schema["properties"])
            assert all(field["description"] for field in schema["properties"].values())
