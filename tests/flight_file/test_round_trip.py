"""What is written is what is read; and what is on the disk, and when."""

from __future__ import annotations

import fcntl
import hashlib
import json
import os
import tempfile
from dataclasses import replace
from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from flight_file.errors import FlightNotWrittenError
from flight_file.files import DurableFile
from flight_file.flight_writer import FlightWriter, Plan
from flight_file.frame import CameraStatus, ClockReading, Exif, Frame, HostTimes, LogLevel, LogLine
from flight_file.messages import MAX_TIME_S, STATUS_TOPIC, TOPICS, encode_log, encode_status, json_bytes
from flight_file.reader import open_flight
from flight_file.session import EndRecord, Session, end_to_metadata, first_value
from flight_file.thresholds import MAX_READ_BYTES
from flight_file.writer import SegmentWriter
from tests.flight_file.flights import after, make_frame

AT = ClockReading(5, 6)
SCHEMA = json.loads(next(topic.schema for topic in TOPICS if topic.name == STATUS_TOPIC))
TIMES = st.integers(0, 2**62)
READINGS = st.builds(ClockReading, TIMES, TIMES)
REALS = st.none() | st.floats(allow_nan=False, allow_infinity=False)
EXIFS = st.builds(
    Exif,
    focal_length_mm=REALS,
    exposure_s=REALS,
    f_number=REALS,
    iso=st.none() | st.integers(1, 2**40),
    datetime=st.none() | st.text(st.characters(codec="utf-8"), max_size=40),
)
SIZES = st.none() | st.integers(1, 65535)


def test_offset_of_the_cameras_clock_is_in_the_status() -> None:
    """An offset that is negative keeps a positive rest; what is not known is absent; the schema names every field."""
    status = CameraStatus("clock", "set", camera_clock_offset_ns=-1, camera_clock_sigma_ns=3_000_000_001)
    document = json.loads(encode_status(status, AT))

    assert document["camera_clock_offset"] == {"sec": -1, "nsec": 999_999_999}
    assert document["camera_clock_sigma"] == {"sec": 3, "nsec": 1}
    assert set(document) <= set(SCHEMA["properties"])
    assert set(json.loads(encode_status(CameraStatus("connected"), AT))) == {"clocks", "state", "reason", "dropped"}


def test_text_without_bytes_is_written_all_the_same() -> None:
    """The other bytes of a file's name in a reason, whether of a status, a log line or the end, cost no record."""
    words = "the disk \udcff fails"
    end = EndRecord(words, frames=0, dropped=0, ended=AT, chain="")

    assert json.loads(encode_status(CameraStatus("lost", words), AT))["reason"] == "the disk \\udcff fails"
    assert b"the disk \\udcff fails" in encode_log(LogLine(LogLevel.ERROR, words), AT)
    assert end_to_metadata(end)["reason"] == "the disk \\udcff fails"
    assert json_bytes({words: words}) == b'{"the disk ? fails":"the disk ? fails"}'


@st.composite
def frame_lists(draw: st.DrawFn) -> list[Frame]:
    """Frames with any content and any times, in the order of their sequence numbers."""
    result = []
    for sequence in sorted(draw(st.sets(st.integers(0, 2**40), max_size=6))):
        jpeg = draw(st.binary(max_size=300)) * draw(st.sampled_from((1, 1, 400)))
        times = HostTimes(draw(READINGS), draw(READINGS), draw(READINGS))
        digest = hashlib.sha256(jpeg).hexdigest()
        sizes = (draw(SIZES), draw(SIZES))
        result.append(
            Frame(
                *(sequence, draw(TIMES), jpeg, digest, times, draw(EXIFS), *sizes),
                zoom_position=draw(REALS),
                captured_sigma_ns=draw(st.none() | TIMES),
            )
        )
    return result


@settings(max_examples=30)
@given(frames=frame_lists(), data=st.data())
def test_every_field_of_every_frame_comes_back(frames: list[Frame], data: st.DataObject) -> None:
    """Whatever a frame holds and however its times jump, reading a flight gives it back unchanged."""
    with tempfile.TemporaryDirectory() as name:
        plan = Plan(Path(name), Session("flight"), {}, segment_ns=10**9)
        at = ClockReading(data.draw(TIMES), 0)
        writer = FlightWriter(plan, status=CameraStatus("connected"), at=at)
        for frame in frames:
            at = ClockReading(data.draw(TIMES), at.monotonic_ns + data.draw(st.integers(0, 2 * 10**9)))
            writer.write_frame(frame, at)
        flight = open_flight(writer.finish("stopped", at))

        assert list(flight.frames()) == frames
        assert {loss.kind.value for loss in flight.losses} <= {"gap"}


@pytest.mark.parametrize("time_ns", [-1, -(2**63), 2**63 - 1, 2**64])
def test_time_that_no_reader_takes_costs_no_frame(tmp_path: Path, time_ns: int) -> None:
    """A wall clock at the beginning of 1970 or after 2262 gives the nearest time that a flight file has."""
    at = ClockReading(time_ns, time_ns)
    wrong = replace(make_frame(1), captured_ns=time_ns, captured_sigma_ns=abs(time_ns), times=HostTimes(at, at, at))
    writer = FlightWriter(Plan(tmp_path, Session("flight"), {}), status=CameraStatus("connected"), at=after(0))
    writer.write_frame(make_frame(0), after(0))
    writer.write_frame(wrong, after(1))
    flight = open_flight(writer.finish("stopped", after(2)))
    frame = list(flight.frames())[1]

    assert flight.losses == []
    assert frame.encoded == wrong.encoded
    assert frame.captured_ns == (0 if time_ns < 0 else MAX_TIME_S * 10**9)


def test_largest_picture_that_is_taken_comes_back(tmp_path: Path) -> None:
    """Also after others that wait for their chunk; one byte more is objected to."""
    small, large = make_frame(0, 60_000), replace(make_frame(1), encoded=bytes(MAX_READ_BYTES))
    large = replace(large, sha256=hashlib.sha256(large.encoded).hexdigest())
    writer = FlightWriter(Plan(tmp_path, Session("flight"), {}), status=CameraStatus("connected"), at=after(0))
    for frame in (small, large):
        writer.write_frame(frame, after(0))
    flight = open_flight(writer.finish("stopped", after(1)))

    assert [frame.sha256 for frame in flight.frames()] == [small.sha256, large.sha256]
    assert flight.losses == []
    assert large.objection == ""
    assert replace(large, encoded=bytes(MAX_READ_BYTES + 1)).objection == "the picture is larger than 60 MiB"


def test_session_and_attachments_come_back(tmp_path: Path) -> None:
    """Each segment carries the whole session and the attachments byte for byte."""
    session = Session(
        "R", 0, ClockReading(5, 6), "simulated", "boot", "box", "replay", "DSC-QX10", "0042", {"python": "3"}
    )
    attachments = {"panel.yaml": b"a: 1\n", "needles/fr.png": bytes(1000)}
    plan = Plan(tmp_path, session, attachments)
    writer = FlightWriter(plan, status=CameraStatus("connected"), at=session.started)

    flight = open_flight(writer.finish("stopped by SIGTERM", ClockReading(7, 8)))

    assert flight.session == replace(session, chain=first_value(session))
    assert dict(flight.attachments) == attachments
    assert flight.segments[0].end is not None
    assert flight.segments[0].end.reason == "stopped by SIGTERM"
    assert flight.losses == []


def start(path: Path) -> SegmentWriter:
    """A segment with nothing in it yet."""
    return SegmentWriter(path, session=Session("R", started=after(0)), status=CameraStatus("connected"), attachments={})


def test_frame_is_on_the_disk_a_second_after(tmp_path: Path) -> None:
    """Small frames wait for company at most a second, one of a chunk's size for nothing; then they can be read."""
    writer = start(tmp_path / "R_0000.mcap")
    part = tmp_path / "R_0000.mcap.part"
    writer.write_frame(make_frame(0), after(0.1))
    waiting = list(open_flight([part]).frames())
    writer.tick(after(1.1))
    synced = list(open_flight([part]).frames())
    writer.write_frame(make_frame(1, 100_000), after(1.2))

    assert waiting == []
    assert synced == [make_frame(0)]
    assert open_flight([part]).count() == 2
    writer.abandon()


def test_name_that_is_taken_is_never_overwritten(tmp_path: Path) -> None:
    """Neither by finishing a segment nor by beginning one; and where there is no folder a sentence says what to do."""
    path = tmp_path / "R_0000.mcap"
    writer = start(path)
    path.write_bytes(b"somebody else's")

    with pytest.raises(FlightNotWrittenError, match="another name"):
        writer.finish("stopped", dropped=0, at=after(0))
    with pytest.raises(FlightNotWrittenError, match="another name"):
        FlightWriter(Plan(tmp_path, Session("R"), {}), status=CameraStatus("connected"), at=after(0))
    assert path.read_bytes() == b"somebody else's"
    with pytest.raises(FlightNotWrittenError, match=r"create the directory first\.$"):
        start(tmp_path / "no" / "R_0000.mcap")


@pytest.mark.parametrize(("umask", "mode"), [(0o022, 0o640), (0o077, 0o600)])
def test_nobody_else_can_open_a_file_before_it_is_locked(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, umask: int, mode: int
) -> None:
    """Whoever may read it could keep its writer waiting; the group may read it afterwards, if the umask lets it."""
    modes, flock = list[int](), fcntl.flock

    def noting(descriptor: int, operation: int) -> None:
        modes.append(os.fstat(descriptor).st_mode & 0o777)
        flock(descriptor, operation)

    monkeypatch.setattr(fcntl, "flock", noting)
    before = os.umask(umask)
    try:
        file = DurableFile(tmp_path / "file")
    finally:
        os.umask(before)
    file.close()

    assert modes == [0o600]
    assert (tmp_path / "file").stat().st_mode & 0o777 == mode


def test_every_json_schema_describes_its_fields() -> None:
    """Each JSON topic has a schema whose every field has a description, so that a viewer can show its unit."""
    for topic in TOPICS:
        if topic.schema_encoding == "jsonschema":
            schema = json.loads(topic.schema)

            assert set(schema["required"]) <= set(schema["properties"])
            assert all(field["description"] for field in schema["properties"].values())
