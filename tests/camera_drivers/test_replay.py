"""The replay driver, on folders and on flights."""

from __future__ import annotations

import hashlib
import os
import threading
from collections.abc import Callable, Sequence
from pathlib import Path

import pytest

from camera_drivers.errors import ReplayError
from camera_drivers.replay.camera import ReplayCamera, open_source
from flight_file.flight_writer import FlightWriter, Plan
from flight_file.frame import CameraStatus, ClockReading, Exif, Frame, HostTimes
from flight_file.session import Session
from flight_file.thresholds import MAX_READ_BYTES
from recorder.host import SimulatedClock
from tests.videos import played

NOON_NS = 1_525_435_200_500_000_000  # the first picture's EXIF time
NOW_NS = 1_800_000_000_000_000_000

MakeJpeg = Callable[..., bytes]


@pytest.fixture
def clock() -> SimulatedClock:
    """A clock years after the pictures."""
    return SimulatedClock(NOW_NS)


def write_flight(directory: Path, sequences: Sequence[int], attachments: dict[str, bytes] | None = None) -> list[Path]:
    """A recorded flight of two segments."""
    session = Session("R", camera_model="DSC-QX10", camera_serial="7")
    plan = Plan(directory, session, attachments or {}, segment_ns=2 * 10**9)
    writer = FlightWriter(plan, status=CameraStatus("connected"), at=ClockReading(NOON_NS, 0))
    reading = ClockReading(NOON_NS, 0)
    for sequence in sequences:
        jpeg = b"picture %d" % sequence
        reading = ClockReading(NOON_NS + sequence * 10**9, sequence * 10**9)
        digest = hashlib.sha256(jpeg).hexdigest()
        times = HostTimes(reading, reading, reading)
        writer.write_frame(Frame(sequence, reading.realtime_ns - 7, jpeg, digest, times, Exif(4.45)), reading)
    return writer.finish("stopped", reading)


def test_pictures_come_in_the_order_of_their_names(folder: Path, clock: SimulatedClock) -> None:
    """Every name of a JPEG counts, other files are counted, the bytes are the file's, and EXIF says when it was."""
    frames = played(folder, clock=clock)

    assert [frame.encoded for frame in frames] == [
        (folder / name).read_bytes() for name in ("a1.jpg", "a2.JPG", "b.jpeg")
    ]
    assert [frame.sequence for frame in frames] == [0, 1, 2]
    assert all(frame.sha256 == hashlib.sha256(frame.encoded).hexdigest() for frame in frames)
    assert (frames[0].width_px, frames[0].height_px, frames[0].exif.focal_length_mm) == (64, 48, 4.45)
    assert "2 other files" in open_source([folder], rate_hz=None, clock=clock).identity.note
    assert [frame.captured_ns - NOON_NS for frame in frames] == [0, 10**9, 2 * 10**9]
    assert [frame.times.downloaded.realtime_ns - NOW_NS for frame in frames] == [0, 10**9, 2 * 10**9]


def test_with_a_rate_pictures_follow_the_first(
    folder: Path, tmp_path: Path, clock: SimulatedClock, make_jpeg: MakeJpeg
) -> None:
    """Its EXIF time, or now, and i / rate after it; numbers in names count: IMG_9 comes before IMG_10."""
    numbered = tmp_path / "numbered"
    numbered.mkdir()
    for number in (10, 9, 100):
        (numbered / f"IMG_{number}.jpg").write_bytes(make_jpeg({0x920A: float(number)}))
    frames = played(numbered, clock=clock, rate_hz=4.0)

    assert [frame.captured_ns - NOON_NS for frame in played(folder, clock=clock, rate_hz=4.0)] == [
        0,
        250_000_000,
        500_000_000,
    ]
    assert [frame.captured_ns - NOW_NS for frame in frames] == [0, 250_000_000, 500_000_000]
    assert [frame.exif.focal_length_mm for frame in frames] == [9, 10, 100]


@pytest.mark.parametrize("second", ["2018:05:04 12:00:00", "2018:05:04 11:00:00", "1950:05:04 11:00:00", None])
def test_times_that_do_not_increase_ask_for_a_rate(
    tmp_path: Path, clock: SimulatedClock, make_jpeg: MakeJpeg, second: str | None
) -> None:
    """Equal, falling or missing EXIF times: one sentence says to give rate_hz."""
    (tmp_path / "1.jpg").write_bytes(make_jpeg({0x9003: "2018:05:04 12:00:00"}))
    (tmp_path / "2.jpg").write_bytes(make_jpeg({0x9003: second} if second else {}))

    with pytest.raises(ReplayError, match=r"2\.jpg: .*; give rate_hz \(--rate\), the pictures per second\.$"):
        played(tmp_path, clock=clock)


@pytest.mark.parametrize("size_bytes", [MAX_READ_BYTES + 1, 2**42])
def test_picture_larger_than_a_flight_takes_is_one_sentence(
    folder: Path, clock: SimulatedClock, size_bytes: int
) -> None:
    """Before it takes memory; a sparse file says that it has terabytes."""
    os.truncate(folder / "a2.JPG", size_bytes)

    with pytest.raises(ReplayError, match=r"a2\.JPG: the picture cannot be read \(it is larger than 60 MiB\)"):
        played(folder, clock=clock)


def test_replay_for_which_no_memory_is_left_is_one_sentence(
    folder: Path, clock: SimulatedClock, monkeypatch: pytest.MonkeyPatch
) -> None:
    """It does not begin again with the first picture, as a camera would."""

    def wait(*_arguments: object) -> None:
        raise MemoryError

    monkeypatch.setattr(clock, "wait_until", wait)
    with pytest.raises(ReplayError, match="No memory is left for the next picture; end other programs"):
        played(folder, rate_hz=4.0, clock=clock)


def test_damaged_picture_is_passed_on_and_a_vanished_one_is_one_sentence(folder: Path, clock: SimulatedClock) -> None:
    """A recorder records: what is no picture is stored all the same, without a size. When stopped it gives no more."""
    stop = threading.Event()
    (folder / "a1.jpg").write_bytes(b"no picture")
    with ReplayCamera(open_source([folder], rate_hz=4.0, clock=clock), clock) as camera:
        (folder / "a2.JPG").unlink()
        frame = camera.next_frame(stop)
        assert frame is not None
        assert (frame.encoded, frame.width_px, frame.height_px, frame.exif) == (b"no picture", None, None, Exif())
        with pytest.raises(ReplayError, match=r"a2\.JPG: .*cannot be read"):
            camera.next_frame(stop)
        stop.set()
        assert camera.next_frame(stop) is None


@pytest.mark.parametrize("as_folder", [True, False])
def test_flight_comes_again_as_it_was(tmp_path: Path, clock: SimulatedClock, *, as_folder: bool) -> None:
    """Times, EXIF, sequence numbers and gaps stay; so do camera and attachments, all but recorder.yaml."""
    paths = write_flight(tmp_path, [0, 1, 4, 5], {"panel.yaml": b"p", "recorder.yaml": b"r"})
    given = [tmp_path] if as_folder else paths
    frames = played(*given, clock=clock)
    source = open_source(given, rate_hz=None, clock=clock)

    assert [frame.sequence for frame in frames] == [0, 1, 4, 5]
    assert [frame.captured_ns - NOON_NS + 7 for frame in frames] == [0, 10**9, 4 * 10**9, 5 * 10**9]
    assert frames[2].times.downloaded == ClockReading(NOON_NS + 4 * 10**9, 4 * 10**9)
    assert frames[2].exif == Exif(4.45)
    assert (source.identity.model, source.identity.serial) == ("DSC-QX10", "7")
    assert dict(source.attachments) == {"panel.yaml": b"p"}


def test_what_cannot_be_replayed_is_one_sentence(tmp_path: Path, folder: Path, clock: SimulatedClock) -> None:
    """Nothing there, nothing in it, no whole frame, folders mixed with files, a rate for a flight."""
    empty = tmp_path / "empty"
    empty.mkdir()
    flights = tmp_path / "flights"
    flights.mkdir()
    without_frames = write_flight(flights, [])
    cases: list[tuple[list[Path], float | None, str]] = [
        ([tmp_path / "nothing"], None, "no such file"),
        ([empty], None, "there is no picture in it"),
        (without_frames, None, "no picture in it is whole"),
        ([folder, *without_frames], None, "a folder is replayed alone"),
        (without_frames, 4.0, "leave rate_hz out"),
    ]
    for paths, rate_hz, sentence in cases:
        with pytest.raises(ReplayError, match=sentence) as caught:
            played(*paths, clock=clock, rate_hz=rate_hz)
        assert str(caught.value).endswith(".")
