"""The driver of a Raspberry Pi's camera, with a double of its program as a real process."""

from __future__ import annotations

import math
import os
import signal
import sys
import threading
from collections.abc import Callable
from contextlib import suppress
from functools import partial
from pathlib import Path

import av
import pytest
from hypothesis import given
from hypothesis import strategies as st

from benchmarks.recorders import eventually
from camera_drivers.errors import CameraError, CameraUnusableError
from camera_drivers.live.camera import LiveCamera
from camera_drivers.picamera.cutting import AccessUnitCutter, JpegCutter, RecordCutter
from camera_drivers.picamera.options import PicameraSettings, arguments
from camera_drivers.picamera.process import SKIPPED, picamera
from flight_file.frame import Frame
from flight_file.video.groups import begins_group
from recorder.host import SystemClock
from tests.camera_drivers.conftest import MakeJpeg
from tests.camera_drivers.listening import Listener, no_more_files
from tests.camera_drivers.picamera import rpicam_vid
from tests.videos import film, packets

Program = Callable[..., str]
FRAME_NS, EXPOSURE_NS = rpicam_vid.FRAME_US * 1000, rpicam_vid.EXPOSURE_US * 1000


@pytest.fixture
def program(tmp_path: Path) -> Program:
    """Makes the double a program of its own; gives its path."""
    return partial(rpicam_vid.installed, tmp_path)


@pytest.fixture
def jpegs(make_jpeg: MakeJpeg) -> list[bytes]:
    """Pictures that differ."""
    return [make_jpeg(shade=30 * number) for number in range(8)]


def taken(camera: LiveCamera, number: int) -> list[Frame]:
    """So many frames of one connection."""
    with camera:
        return [frame for _ in range(number) if (frame := camera.next_frame(threading.Event())) is not None]


def middles_ns(tmp_path: Path, frames: list[Frame]) -> list[int]:
    """Mid-exposure of the middle row, realtime, by the sensor's times that the double wrote down."""
    sensor_ns = map(int, (tmp_path / "ledger").read_text().split())
    received = (frame.times.downloaded for frame in frames)
    return [
        at.realtime_ns - at.monotonic_ns + read_ns - EXPOSURE_NS // 2 + FRAME_NS // 4
        for at, read_ns in zip(received, sensor_ns, strict=False)
    ]


def test_jpegs_have_the_sensors_time(tmp_path: Path, program: Program, jpegs: list[bytes]) -> None:
    """Byte for byte, in the middle of the exposure of the middle row, in UTC; a skipped one is counted."""
    listener = Listener()
    options = Options(program=program(jpegs, skip=[5]), rate_hz=50)
    frames = taken(picamera(options, SystemClock(), listener), len(jpegs))

    assert [frame.encoded for frame in frames] == jpegs
    assert [frame.captured_ns for frame in frames] == middles_ns(tmp_path, frames)
    assert {frame.captured_sigma_ns for frame in frames} == {round(FRAME_NS / 2 / math.sqrt(12))}
    assert {frame.exif.exposure_s for frame in frames} == {0.008}
    assert [frame.sequence for frame in frames] == [0, 1, 2, 3, 4, 6, 7, 8]
    assert listener.losses == [SKIPPED]
    assert listener.reasons("clock") == []


@pytest.mark.parametrize(
    ("metadata", "frame_ns", "sentence"),
    [("none", 10**9 // 30, "gives no times"), ("wrong", FRAME_NS, "are unusable")],
)
def test_without_useful_metadata_the_arrival_is_taken(
    program: Program, jpegs: list[bytes], metadata: str, frame_ns: int, sentence: str
) -> None:
    """With a larger sigma, and that is said once."""
    listener = Listener()
    frames = taken(picamera(Options(program=program(jpegs, metadata=metadata)), SystemClock(), listener), len(jpegs))

    assert [frame.encoded for frame in frames] == jpegs
    assert {each.times.downloaded.realtime_ns - each.captured_ns for each in frames} == {frame_ns}
    assert {each.captured_sigma_ns for each in frames} == {round(2 * frame_ns / math.sqrt(12))}
    (said,) = listener.reasons("clock")
    assert sentence in said


def test_h264_is_stored_by_access_units(tmp_path: Path, program: Program) -> None:
    """Each with its parameter sets where it is a key frame, each with the time of its own metadata, all decodable."""
    sent = packets(film(tmp_path / "film.h264", ticks=range(0, 24 * 240, 240), group=8))
    options = Options(program=program(sent), codec="h264", size_px=(160, 120), stall_s=5.0)
    frames = taken(picamera(options, SystemClock(), Listener()), len(sent) - 1)
    decoder = av.CodecContext.create("h264", "r")
    shown = [picture for frame in frames for picture in decoder.decode(av.Packet(frame.encoded))]

    assert [frame.encoded for frame in frames] == sent[:-1]
    assert [begins_group(frame) for frame in frames] == [number % 8 == 0 for number in range(len(frames))]
    assert {(frame.format, frame.width_px, frame.height_px) for frame in frames} == {("h264", 160, 120)}
    assert len([*shown, *decoder.decode(None)]) == len(frames)
    assert [frame.captured_ns for frame in frames] == middles_ns(tmp_path, frames)


def test_program_that_ends_says_why_and_leaves_nothing_behind(program: Program, jpegs: list[bytes]) -> None:
    """Its last word on an error, its exit code; the next connection starts another one, counting on."""
    camera = picamera(Options(program=program(jpegs[:2], then="exit")), SystemClock(), Listener())
    open_before = len(os.listdir("/proc/self/fd"))  # noqa: PTH208 - the folder changes while it is read
    for connection in range(3):
        with camera:
            frames = [camera.next_frame(threading.Event()) for _ in range(2)]
            with pytest.raises(CameraError, match=r"ended \(exit code 1\): ERROR: \*\*\* failed to acquire camera"):
                camera.next_frame(threading.Event())
        assert [frame.sequence for frame in frames if frame] == [2 * connection, 2 * connection + 1]

    assert len(os.listdir("/proc/self/fd")) == open_before  # noqa: PTH208


def test_program_that_hangs_is_ended(program: Program, jpegs: list[bytes]) -> None:
    """After stall_s the camera is to be connected again, and the process is gone by then."""
    camera = picamera(Options(program=program(jpegs[:1]), stall_s=2.0), SystemClock(), Listener())
    with camera:
        process = camera._source._process
        camera.next_frame(threading.Event())
        with pytest.raises(CameraError, match=r"no picture for 2 s"):
            camera.next_frame(threading.Event())
        assert process.poll() is None

    assert process.poll() == -signal.SIGTERM


@pytest.mark.parametrize("ending", ["\nexit $?", "&"])
def test_program_in_a_script_is_ended_with_it(
    tmp_path: Path, program: Program, jpegs: list[bytes], ending: str
) -> None:
    """What the script started has the camera, and would keep it from the next connection, also without the script."""
    script = tmp_path / "script"
    script.write_text(f'#!/bin/sh\n{program(jpegs[:1])} "$@" {ending}\n', encoding="utf-8")
    script.chmod(0o755)
    with picamera(Options(program=str(script)), SystemClock(), Listener()) as camera:
        process = camera._source._process
        assert camera.next_frame(threading.Event()) is not None
        eventually(lambda: ending != "&" or process.poll() == 0)
        assert living(process.pid)

    eventually(lambda: not living(process.pid))


def living(group: int) -> list[str]:
    """The state of each process of a group that is left and has not ended."""
    states = []
    for path in Path("/proc").glob("[0-9]*/stat"):
        with suppress(OSError):  # it ended just now
            state, _, of_group, *_ = path.read_text("utf-8").rpartition(")")[2].split()
            states += [state] if int(of_group) == group and state != "Z" else []
    return states


def test_program_that_is_not_there_needs_a_person() -> None:
    """The sentence says how to install it."""
    with pytest.raises(CameraUnusableError, match="apt-get install rpicam-apps-lite"):
        picamera(Options(program="no-such-vid"), SystemClock(), Listener()).__enter__()


def test_machine_that_opens_no_more_files_does_not_end_the_recording(program: Program, jpegs: list[bytes]) -> None:
    """It is one sentence, and the program is started later."""
    camera = picamera(Options(program=program(jpegs)), SystemClock(), Listener())
    with no_more_files(), pytest.raises(CameraUnusableError, match=r"cannot be started .*Too many open files"):
        camera.__enter__()


def test_option_that_the_program_has_not_ends_it_with_its_own_words(program: Program, jpegs: list[bytes]) -> None:
    """As an old version refuses a younger option."""
    options = Options(program=program(jpegs, lacks="--flicker-period"), power_line_hz=50)
    with pytest.raises(CameraError, match=r"ended \(exit code 1\): ERROR: .* unrecognised option '--flicker-period'"):
        taken(picamera(options, SystemClock(), Listener()), 1)


def test_every_setting_is_an_option_of_the_program(monkeypatch: pytest.MonkeyPatch) -> None:
    """All that can be told becomes what rpicam-vid takes, in its units."""
    jpeg = Options(
        size_px=(2304, 1296),
        rate_hz=4,
        exposure_s=0.004,
        gain=2.5,
        awb_gains=(1.5, 2.0),
        focus=2.0,
        power_line_hz=60,
        rotation_deg=180,
    )
    video = Options(codec="h264", bitrate_mbit=8.0, focus="auto")
    told = []
    for options in (jpeg, video):
        monkeypatch.setattr(sys, "argv", ["rpicam-vid", *arguments(options, "/dev/fd/5")])
        told.append(rpicam_vid.asked())

    assert (told[0].shutter, told[0].framerate, told[0].gain, told[0].awbgains) == ("4000", "4", "2.5", "1.5,2")
    assert (told[0].width, told[0].height, told[0].quality) == ("2304", "1296", "90")
    assert (told[0].autofocus_mode, told[0].lens_position, told[0].flicker_period) == ("manual", "2", "8333us")
    assert (told[1].codec, told[1].inline, told[1].intra, told[1].bitrate) == ("h264", True, "30", "8000000")
    assert told[1].autofocus_mode == "continuous"


@given(st.lists(st.integers(1, 5_000), max_size=40), st.binary(max_size=30))
def test_pictures_are_cut_whatever_the_pieces(cuts: list[int], junk: bytes) -> None:
    """JPEGs with junk between that looks like none, access units, records: the same however the bytes arrive."""
    jpeg = JPEG_BYTES
    between = junk.replace(b"\xff", b"")
    units = [b"\0\0\0\1\x67\x42\0\0\0\1\x68\xce\0\0\0\1\x65\x88\x84" + bytes([3]) * 90, b"\0\0\0\1\x41\x9a\x22\x55" * 1]
    units = [
        *units,
        b"\0\0\0\1\x06\x05\x01\0\0\1\x41\x9a\x03" + bytes([9]) * 20,
        b"\0\0\1\x41\x9a\x22\x55\0\0\1\x41\x22",
    ]
    for cutter, content, wanted in (
        (JpegCutter(), between.join([b"", jpeg, jpeg, jpeg]), [jpeg] * 3),
        (AccessUnitCutter(), b"".join(units) + b"\0\0\0\1\x09\x10", units),
        (RecordCutter(), b"A=1\nB=[ 2, 3 ]\n\nA=2\n\nA=", [{"A": "1", "B": "[ 2, 3 ]"}, {"A": "2"}]),
    ):
        found: list[object] = []
        rest = content
        for cut in [*cuts, len(content)]:
            found += cutter.feed(rest[:cut])
            rest = rest[cut:]
        assert found == wanted


def test_metadata_without_an_end_cost_little() -> None:
    """A program that separates them in another way is left without, however long it runs: its pictures go on."""
    cutter = RecordCutter()
    for _ in range(5_000):  # three minutes of pictures; searched from the beginning each time, they take minutes too
        assert not cutter.feed(b"A=1\n" * 1_000)
    assert cutter.feed(b"\n\nA=2\n\n")[-1] == {"A": "2"}


Options = partial(PicameraSettings, driver="picamera")
JPEG_BYTES = (
    b"\xff\xd8\xff\xe1\x00\x08Exif\xff\xd9"  # an end within a segment is none
    b"\xff\xc0\x00\x0b\x08\x00\x01\x00\x01\x01\x01\x11\x00\xff\xda\x00\x08\x01\x01\x00\x00\x3f\x00\x12\xff\x00\x34\xff\xd9"
)
