"""Stills from a camera that does what it should: their faults, their times, and what is known of its clock."""

from __future__ import annotations

import hashlib
import struct
import threading
from collections.abc import Callable
from types import SimpleNamespace
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st
from PIL import Image

from camera_drivers.errors import CameraError
from camera_drivers.qx10.camera import Qx10Camera
from camera_drivers.qx10.camera_clock import CameraClock
from camera_drivers.qx10.options import Qx10Settings
from camera_drivers.qx10.picture import FrameMaker, fault_of, middle_of_exposure
from camera_drivers.qx10.simulator.pictures import drawn_picture
from camera_drivers.reporter import Reporter
from flight_file.frame import ClockReading, Exif, HostTimes
from recorder.host import SimulatedClock, SystemClock
from tests.jpegs import encoded

S = 1_000_000_000
JPEG = drawn_picture(1)
MakeBench = Callable[..., Any]
NOW = 1_800_000_000 * S
SHOTS = st.lists(st.tuples(st.integers(1, 10**4 * S), st.integers(0, 3 * S), st.floats(0, 1)), min_size=1, max_size=20)


def with_header_of(size_px: tuple[int, int]) -> bytes:
    """A picture whose header is followed by one of another size."""
    start = JPEG.index(b"\xff\xc0")
    end = start + 2 + int.from_bytes(JPEG[start + 2 : start + 4], "big")
    width_px, height_px = size_px
    return JPEG[:end] + JPEG[start : start + 5] + struct.pack(">HH", height_px, width_px) + JPEG[start + 9 :]


def in_scans(*, more: int = 0, size_px: tuple[int, int] = (64, 48)) -> bytes:
    """A progressive picture of nothing, with its last scan repeated."""
    picture = encoded(Image.new("RGB", size_px, (90, 91, 92)), progressive=True, subsampling=0)
    return picture[:-2] + picture[picture.rindex(b"\xff\xda") : -2] * more + picture[-2:]


@pytest.mark.parametrize(
    ("jpeg", "fault"),
    [
        (JPEG, ""),
        (JPEG + bytes(1000), ""),
        (JPEG + drawn_picture(2), ""),
        (JPEG[: len(JPEG) // 2], "the picture is cut short"),
        (JPEG[:-1], "the picture is cut short"),
        (b"", "the picture is not a JPEG"),
        (b"<html>", "the picture is not a JPEG"),
        (JPEG.replace(struct.pack(">HH", 480, 640), struct.pack(">HH", 60000, 60000)), "larger than any"),
        (JPEG.replace(b"\xff\xdb", b"\xff\xee"), "the picture is damaged"),
        (with_header_of((65000, 65000)), "the picture is damaged"),
        (in_scans(), ""),
        (in_scans() + in_scans(), ""),
        (in_scans(more=900), "coded in another way"),
        (in_scans(size_px=(8000, 8000)), "larger than any"),
    ],
    ids=[
        *("whole", "padded", "two", "half", "last byte", "empty", "page", "bomb", "no tables", "bomb behind a header"),
        *("progressive", "two progressive", "scans without end", "too large for the memory"),
    ],
)
def test_fault_is_named(jpeg: bytes, fault: str) -> None:
    """What can be shown has none; what is cut, damaged, huge or something else has."""
    assert fault in fault_of(jpeg)
    assert bool(fault) == bool(fault_of(jpeg))


def times(before_s: float, answered_s: float, *, jump_s: float = 0.0) -> HostTimes:
    """The box's clocks; its wall clock is set while the camera works."""

    def at(seconds: float, ahead: float = 0.0) -> ClockReading:
        return ClockReading(round((100 + seconds + ahead) * S), round(seconds * S))

    return HostTimes(at(before_s), at(answered_s, jump_s), at(answered_s + 1, jump_s))


def test_exposure_is_in_the_middle_as_uncertain_as_the_rest_is_long() -> None:
    """Two seconds of which one is the exposure: half a second to either side of the middle."""
    assert middle_of_exposure(times(1, 3), Exif()) == (2 * S, round(2 * S / 12**0.5))
    assert middle_of_exposure(times(1, 3), Exif(exposure_s=1.0)) == (2 * S, round(1 * S / 12**0.5))
    assert middle_of_exposure(times(1, 3), Exif(exposure_s=30.0)) == (2 * S, 0)
    assert middle_of_exposure(times(1, 3), Exif(exposure_s=1e300)) == (2 * S, 0)


def test_wall_clock_that_jumps_does_not_stretch_the_exposure() -> None:
    """The monotonic clock carries the interval; the wall clock is that of the answer."""
    frame = FrameMaker().frame(JPEG, times(1, 3, jump_s=1e6), zoom_position=None)

    assert frame.captured_ns == 102 * S + 10**6 * S
    assert frame.captured_sigma_ns == round(2 * S / 12**0.5)


def test_frame_is_the_picture_byte_for_byte(make_bench: MakeBench) -> None:
    """Bytes, digest, size, EXIF and zoom are the camera's; mid-exposure lies between question and answer."""
    bench = make_bench(behaviour={"shot_s": 0.2, "clock_offset_s": -1e6})
    frames = bench.take(2)

    assert [frame.sha256 for frame in frames] == bench.simulated.ledger.delivered()
    for frame in frames:
        assert hashlib.sha256(frame.encoded).hexdigest() == frame.sha256
        assert (frame.width_px, frame.height_px, frame.zoom_position) == (640, 480, 0.0)
        assert (frame.exif.focal_length_mm, frame.exif.iso) == (4.45, 200)
        times = frame.times
        took_ns = times.after_answer.monotonic_ns - times.before_request.monotonic_ns
        assert 0 < took_ns < times.downloaded.monotonic_ns - times.before_request.monotonic_ns
        assert times.before_request.realtime_ns < frame.captured_ns < times.after_answer.realtime_ns
        assert frame.captured_sigma_ns == pytest.approx((took_ns - 10**7) / 12**0.5, abs=2)


def test_camera_says_who_it_is_and_its_clock_is_set(make_bench: MakeBench) -> None:
    """Name and serial from the description, software from the camera; its clock is behind by up to a second then."""
    bench = make_bench(behaviour={"clock_offset_s": -1e6})
    bench.take(1)
    (clock,) = [status for status in bench.listener.reports if status.camera_clock_offset_ns is not None]
    with bench.camera as camera:
        identity = camera.identity

    assert (identity.driver, identity.model, identity.serial) == ("qx10", "DSC-QX10", "020000000010")
    assert "Smart Remote Control 2.1.1" in identity.note
    assert -1.5e9 < clock.camera_clock_offset_ns < 0.1e9
    assert clock.camera_clock_sigma_ns is not None


def test_stop_ends_the_wait_for_the_next_picture(make_bench: MakeBench) -> None:
    """Whatever the interval, None comes soon after stopping was asked for."""
    bench = make_bench(interval_s=3600.0)
    stop = threading.Event()
    with bench.camera as camera:
        assert camera.next_frame(stop) is not None
        threading.Timer(0.2, stop.set).start()
        assert camera.next_frame(stop) is None

    assert "the next picture is not due yet" in bench.listener.waits


def test_stop_ends_a_shot_and_the_picture_is_accounted_for(make_bench: MakeBench) -> None:
    """A picture that was on its way is lost with its reason."""
    bench = make_bench(behaviour={"shot_s": 1.5})
    stop = threading.Event()
    with bench.camera as camera:
        threading.Timer(0.3, stop.set).start()
        assert camera.next_frame(stop) is None

    assert bench.listener.losses == ["stopped before the picture was there"]


def test_camera_that_never_gets_ready_is_connected_again(make_quick_bench: MakeBench) -> None:
    """An error that stays ends the connection, not the driver."""
    bench = make_quick_bench()
    bench.simulated.model.fail()
    with pytest.raises(CameraError, match=r"not ready but Error; it will be connected again\."), bench.camera:
        pass

    assert len(bench.listener.reasons("error")) == 1


def test_camera_that_is_not_there_is_one_sentence(listener: Reporter) -> None:
    """A port where nobody listens."""
    settings = Qx10Settings(driver="qx10", url="http://127.0.0.1:9/DmsRmtDesc.xml")
    with (
        pytest.raises(CameraError, match=r"cannot be reached; check that the camera is on and in"),
        Qx10Camera(settings, SystemClock(), listener),
    ):
        pass


def test_pictures_come_at_the_wanted_interval(make_bench: MakeBench) -> None:
    """By their own times, whose numbers go on over a new connection; a long shot is no silence."""
    bench = make_bench(interval_s=0.4, behaviour={"shot_s": 1.1})
    first, second, third = [frame for number in (2, 1) for frame in bench.take(number)]
    asked = [frame.times.before_request.monotonic_ns for frame in (first, second)]

    assert asked[1] - asked[0] > 0.3e9
    assert [frame.sequence for frame in (first, second, third)] == [0, 1, 2]
    assert "actTakePicture" in bench.listener.waits


@given(offset=st.integers(-(10**18), 10**18), shots=SHOTS)
def test_interval_always_holds_the_true_offset(offset: int, shots: list[tuple[int, int, float]]) -> None:
    """Whole seconds, written at any moment of the shot: the truth is never excluded, and the interval never grows."""
    reasons: list[str] = []
    clock = CameraClock(SimulatedClock(NOW), SimpleNamespace(report=lambda status: reasons.append(status.reason)))
    width = None
    for at, took, share in shots:
        earliest, latest = NOW + at, NOW + at + took
        written = earliest + round(took * share)
        clock.compare((written + offset) // S * S, earliest, latest)
        assert clock.offset is not None
        assert clock.offset.low_ns <= offset <= clock.offset.high_ns
        new = clock.offset.high_ns - clock.offset.low_ns
        assert width is None or new <= width
        width = new

    assert reasons == ["the camera's clock shows in its pictures"]
