"""What is written is what is read."""

from __future__ import annotations

import hashlib
import tempfile
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

from hypothesis import given, settings
from hypothesis import strategies as st

from flight_file.chain import first_value
from flight_file.frame import ClockReading, Exif, Frame, HostTimes
from flight_file.reader import open_flight
from flight_file.reports import CameraStatus, Health, LogLevel, LogLine
from flight_file.segments import FlightWriter, Plan
from flight_file.session import Session

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


@settings(deadline=None, max_examples=60)
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


def test_reports_do_not_disturb_the_frames(tmp_path: Path, make_frame: Callable[[int], Frame]) -> None:
    """Status, health and log messages between the frames leave these as they are."""
    at = ClockReading(10**18, 0)
    writer = FlightWriter(Plan(tmp_path, Session("R"), {}), status=CameraStatus("connected"), at=at)
    health = Health(1, 4.0, 1, 0, 0, "system", -5, {"why": 1}, {"cpu": 40.0})
    for sequence in range(3):
        writer.write_status(CameraStatus("recording", "because", 1, sequence), at)
        writer.write_health(health, at)
        writer.write_log(LogLine(LogLevel.WARNING, "disk_slow"), at)
        writer.write_frame(make_frame(sequence), at)

    flight = open_flight(writer.finish("stopped", at))

    assert [frame.sequence for frame in flight.frames()] == [0, 1, 2]
    assert flight.losses == []


def test_digest_of_the_files_is_the_digest_of_their_bytes(flight: Path) -> None:
    """`sha256_of_files` gives what sha256sum gives."""
    assert open_flight([flight]).sha256_of_files() == {flight: hashlib.sha256(flight.read_bytes()).hexdigest()}
