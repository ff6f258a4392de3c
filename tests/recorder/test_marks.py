"""A mark keeps the segment that was just recorded, and the one before, while the recorder runs."""

from __future__ import annotations

import os
from pathlib import Path

import pytest

from flight_file.frame import ClockReading
from flight_file.reports import CameraStatus
from flight_file.segments import FlightWriter, Plan
from flight_file.session import Session
from recorder.errors import NothingToMarkError, NotMarkedError
from recorder.marks import is_marked, mark

NOON_NS = 1_525_435_200_000_000_000


def at(seconds: int) -> ClockReading:
    """So long after noon."""
    return ClockReading(NOON_NS + seconds * 10**9, seconds * 10**9)


@pytest.fixture
def writer(tmp_path: Path) -> FlightWriter:
    """A recording in its third segment."""
    writer = FlightWriter(
        Plan(tmp_path, Session("R"), {}, segment_ns=10**9), status=CameraStatus("connected"), at=at(0)
    )
    writer.make_room(at(1))
    writer.make_room(at(2))
    return writer


def marked(directory: Path) -> list[str]:
    """The segments that are marked."""
    return sorted(path.name for path in directory.iterdir() if path.suffix != ".keep" and is_marked(path))


def test_segment_in_work_and_the_one_before_are_kept(tmp_path: Path, writer: FlightWriter) -> None:
    """Although another file is newer: what is being written is what happens now. The mark outlives the renaming."""
    (tmp_path / "Z_0000.mcap").touch()
    found = mark(tmp_path, note="bird  strike\n", realtime_ns=NOON_NS)

    assert [path.name for path in found] == ["R_0001.mcap", "R_0002.mcap.part"]
    assert marked(tmp_path) == ["R_0001.mcap", "R_0002.mcap.part"]
    assert (tmp_path / "R_0002.mcap.keep").read_text() == "2018-05-04T12:00:00Z bird strike\n"
    writer.finish("stopped", at(3))
    assert marked(tmp_path) == ["R_0001.mcap", "R_0002.mcap"]


def test_without_a_recorder_the_newest_is_kept(tmp_path: Path, writer: FlightWriter) -> None:
    """After the landing: the segment written last, and the one before."""
    writer.finish("stopped", at(3))
    for number in range(3):
        os.utime(tmp_path / f"R_000{number}.mcap", ns=(NOON_NS, NOON_NS + number))

    assert [path.name for path in mark(tmp_path, note="", realtime_ns=NOON_NS)] == ["R_0001.mcap", "R_0002.mcap"]


def test_first_segment_takes_the_recording_before_along(tmp_path: Path, writer: FlightWriter) -> None:
    """The power failed between: the segment before is the last of the recording before."""
    writer.finish("stopped", at(3))
    for number in range(3):
        os.utime(tmp_path / f"R_000{number}.mcap", ns=(NOON_NS, NOON_NS + number))
    second = FlightWriter(Plan(tmp_path, Session("A"), {}), status=CameraStatus("connected"), at=at(4))

    assert [path.name for path in mark(tmp_path, note="", realtime_ns=NOON_NS)] == ["R_0002.mcap", "A_0000.mcap.part"]
    second.abandon()


def test_marking_again_adds_a_line(tmp_path: Path, writer: FlightWriter) -> None:
    """Both notes are kept."""
    for note in ("one", "two"):
        mark(tmp_path, note=note, realtime_ns=NOON_NS)

    assert (tmp_path / "R_0002.mcap.keep").read_text().split() == [
        "2018-05-04T12:00:00Z", "one", "2018-05-04T12:00:00Z", "two",
    ]  # fmt: skip
    writer.abandon()


def test_only_segment_is_marked_alone(tmp_path: Path) -> None:
    """There is none before it."""
    writer = FlightWriter(Plan(tmp_path, Session("R"), {}), status=CameraStatus("connected"), at=at(0))

    assert [path.name for path in mark(tmp_path, note="", realtime_ns=NOON_NS)] == ["R_0000.mcap.part"]
    writer.abandon()


def test_nothing_to_mark_is_one_sentence(tmp_path: Path) -> None:
    """An empty directory, and none at all."""
    (tmp_path / "notes.txt").touch()
    with pytest.raises(NothingToMarkError, match=r"no recording in it.*\.$"):
        mark(tmp_path, note="", realtime_ns=NOON_NS)
    with pytest.raises(NotMarkedError, match=r"\.$"):
        mark(tmp_path / "none", note="", realtime_ns=NOON_NS)
