"""Stills from a camera that does what it should."""

from __future__ import annotations

import hashlib
import threading
import time
from collections.abc import Callable
from typing import Any

import pytest

from camera_drivers.camera import Camera
from camera_drivers.errors import CameraError, CameraUnusableError
from camera_drivers.qx10.camera import Qx10Camera
from camera_drivers.qx10.options import Options
from camera_drivers.reporter import Reporter
from recorder.clock import SystemClock

MakeBench = Callable[..., Any]


def test_frame_is_the_picture_byte_for_byte(make_bench: MakeBench) -> None:
    """Bytes, digest, size, EXIF and zoom position are the camera's."""
    bench = make_bench()
    frames = bench.take(2)

    assert [frame.sha256 for frame in frames] == bench.simulated.ledger.delivered()
    for frame in frames:
        assert hashlib.sha256(frame.jpeg).hexdigest() == frame.sha256
        assert (frame.width_px, frame.height_px, frame.zoom_position) == (640, 480, 0.0)
        assert (frame.exif.focal_length_mm, frame.exif.iso) == (4.45, 200)


def test_times_are_in_order_and_enclose_the_exposure(make_bench: MakeBench) -> None:
    """Asked, answered, downloaded; mid-exposure lies between the first two, as uncertain as these are apart."""
    (frame,) = make_bench(behaviour={"shot_s": 0.2}).take(1)
    times = frame.times

    assert times.before_request.monotonic_ns < times.after_answer.monotonic_ns < times.downloaded.monotonic_ns
    assert times.before_request.realtime_ns < frame.captured_ns < times.after_answer.realtime_ns
    took_ns = times.after_answer.monotonic_ns - times.before_request.monotonic_ns
    assert frame.captured_sigma_ns == pytest.approx((took_ns - 10**7) / 12**0.5, abs=2)


def test_camera_says_who_it_is(make_bench: MakeBench) -> None:
    """Name and serial from the description, software from the camera."""
    bench = make_bench()
    camera: Camera = bench.camera
    with camera:
        identity = camera.identity

    assert (identity.driver, identity.model, identity.serial) == ("qx10", "DSC-QX10", "020000000010")
    assert "Smart Remote Control 2.1.1" in identity.note


def test_clock_is_set_and_its_offset_reported(make_bench: MakeBench) -> None:
    """The camera's clock shows whole seconds, so that it is behind by up to one."""
    bench = make_bench(behaviour={"clock_offset_s": -1e6})
    bench.take(1)
    (status,) = [status for status in bench.listener.reports if status.camera_clock_offset_ns is not None]

    assert -1.5e9 < status.camera_clock_offset_ns < 0.1e9
    assert status.camera_clock_sigma_ns is not None


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


def test_long_call_says_that_it_waits(make_bench: MakeBench) -> None:
    """A shot of some seconds is no silence."""
    bench = make_bench(behaviour={"shot_s": 1.4})
    bench.take(1)

    assert "actTakePicture" in bench.listener.waits


def test_camera_that_never_gets_ready_is_connected_again(make_quick_bench: MakeBench) -> None:
    """An error that stays ends the connection, not the driver."""
    bench = make_quick_bench()
    bench.simulated.model.fail(failed=True)
    with pytest.raises(CameraError, match=r"not ready but Error; it will be connected again\."), bench.camera:
        pass

    assert len(bench.listener.reasons("error")) == 1


def test_camera_works_without_the_call_that_waits_for_news(make_bench: MakeBench) -> None:
    """It only keeps the connection awake."""
    assert len(make_bench(long_poll=False).take(2)) == 2


def test_camera_that_is_not_there_is_one_sentence(listener: Reporter) -> None:
    """A port where nobody listens."""
    camera = Qx10Camera(Options(url="http://127.0.0.1:9/DmsRmtDesc.xml"), SystemClock(), listener)
    with pytest.raises(CameraError, match=r"cannot be reached; check that the camera is on and in reach\.$"), camera:
        pass


def test_url_that_is_none_needs_a_person(listener: Reporter) -> None:
    """Trying again does not help."""
    camera = Qx10Camera(Options(url="ftp://10.0.0.1/x"), SystemClock(), listener)
    with pytest.raises(CameraUnusableError, match=r"camera\.url"), camera:
        pass


def test_camera_that_was_not_entered_gives_no_frame(make_bench: MakeBench) -> None:
    """A mistake in use is told, not hung upon."""
    with pytest.raises(CameraError, match="not connected"):
        make_bench().camera.next_frame(threading.Event())


def test_frames_are_counted_on_over_a_new_connection(make_bench: MakeBench) -> None:
    """Sequence numbers never begin anew."""
    bench = make_bench()
    sequences = [frame.sequence for _ in range(2) for frame in bench.take(2)]

    assert sequences == [0, 1, 2, 3]


def test_pictures_come_at_the_wanted_interval(make_bench: MakeBench) -> None:
    """Measured by their own times: no two are closer than the interval, save for what a call takes."""
    frames = make_bench(interval_s=0.4).take(3)
    asked = [frame.times.before_request.monotonic_ns for frame in frames]

    assert asked[1] - asked[0] > 0.3e9
    assert asked[2] - asked[1] > 0.3e9
    assert time.monotonic_ns() > asked[2]
