"""The driver of USB cameras, before a double of what the kernel shows of one."""

from __future__ import annotations

import errno
import math
import threading
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path

import pytest

from camera_drivers.errors import CameraError, CameraNotFoundError, CameraUnusableError
from camera_drivers.live.camera import LiveCamera
from camera_drivers.uvc import v4l2
from camera_drivers.uvc.options import UvcSettings
from camera_drivers.uvc.stream import DAMAGED, NO_JPEG, NOT_DELIVERED, uvc_camera
from camera_drivers.uvc.v4l2 import Control
from flight_file.frame import NS_PER_S, Frame
from tests.camera_drivers.conftest import MakeJpeg
from tests.camera_drivers.listening import Listener, taken_by_and_by
from tests.camera_drivers.uvc.webcam import PATH, START_NS, Webcam

Options = partial(UvcSettings, driver="uvc")
HELD = {
    Control.EXPOSURE_AUTO: 1,
    Control.EXPOSURE_ABSOLUTE: 80,
    Control.FOCUS_AUTO: 0,
    Control.FOCUS_ABSOLUTE: 30,
    Control.GAIN: 10,
    Control.POWER_LINE_FREQUENCY: 1,
}
WANTED = {"exposure_s": 0.008, "focus": 30, "gain": 10, "power_line_hz": 50}


@dataclass
class Bench:
    """A camera, its driver, and who listens."""

    webcam: Webcam
    listener: Listener = field(default_factory=Listener)
    failures: list[str] = field(default_factory=list)

    def camera(self, **options: object) -> LiveCamera:
        """The driver."""
        return uvc_camera(Options(device=PATH, **options), self.webcam.clock, self.listener, self.webcam.open)

    def take(self, number: int, **options: object) -> list[Frame]:
        """So many frames, connecting again as the recorder does."""
        return taken_by_and_by(self.camera(**options), number, self.failures)


@pytest.fixture
def bench() -> Bench:
    """A camera that takes nothing yet."""
    return Bench(Webcam())


@pytest.fixture
def jpegs(make_jpeg: MakeJpeg) -> list[bytes]:
    """Pictures that differ."""
    return [make_jpeg(shade=20 * number) for number in range(12)]


def without_tables(jpeg: bytes) -> bytes:
    """Leave the Huffman tables out, as cameras do whose MJPEG has the usual ones."""
    at = 2
    kept = jpeg[:2]
    while jpeg[at + 1] != 0xDA:
        end = at + 2 + int.from_bytes(jpeg[at + 2 : at + 4], "big")
        kept += b"" if jpeg[at + 1] == 0xC4 else jpeg[at:end]
        at = end
    return kept + jpeg[at:]


def test_pictures_are_stored_as_they_come_at_the_kernels_time(bench: Bench, jpegs: list[bytes]) -> None:
    """Byte for byte, without Huffman tables too; the stamp becomes UTC, uniform within a frame's time either way."""
    sent = [without_tables(jpeg) for jpeg in jpegs[:4]]
    bench.webcam.shoots(*sent, late_ns=5_000_000)
    frames = bench.take(4, rate_hz=10)
    step_ns = NS_PER_S // 10 + 5_000_000

    assert len(sent[0]) < len(jpegs[0])
    assert [frame.encoded for frame in frames] == sent
    assert [(frame.width_px, frame.height_px, frame.sequence) for frame in frames] == [(64, 48, n) for n in range(4)]
    assert [frame.captured_ns for frame in frames] == [START_NS + n * step_ns - 5_000_000 for n in range(1, 5)]
    assert {frame.captured_sigma_ns for frame in frames} == {round(NS_PER_S / 5 / math.sqrt(12))}
    assert bench.listener.losses == []


def test_settings_are_made_at_each_connection(bench: Bench, jpegs: list[bytes]) -> None:
    """Exposure and focus are held, what is automatic is switched off first; a camera that forgot is told again."""
    defaults = {number: list(held) for number, held in bench.webcam.controls.items()}

    def plug(camera: Webcam) -> None:
        camera.unplug()
        camera.controls = {number: list(held) for number, held in defaults.items()}

    bench.webcam.shoots(jpegs[0])
    bench.webcam.steps.append(plug)
    camera = bench.camera(size_px=(1280, 720), rate_hz=10, **WANTED)
    with camera:
        camera.next_frame(threading.Event())
        with pytest.raises(CameraError):
            camera.next_frame(threading.Event())
    with pytest.raises(CameraNotFoundError, match="no camera is there; plug it in"):
        camera.__enter__()
    bench.webcam.plugged = True
    bench.webcam.shoots(jpegs[1])
    with camera:
        second = camera.next_frame(threading.Event())

    assert {number: held[2] for number, held in bench.webcam.controls.items()} == HELD
    assert [(each.size, each.code, each.closed, each.mapped) for each in bench.webcam.opened] == [
        ((1280, 720), "MJPG", True, 0)
    ] * 2
    assert second is not None
    assert second.sequence == 1
    assert camera.identity.model == "Double \N{TRADE MARK SIGN} Cam"
    assert camera.identity.note == f"{PATH}, 1280 x 720 at 10 Hz"
    assert bench.listener.reasons("setting") == []


def test_what_the_camera_has_not_is_said_once(bench: Bench, jpegs: list[bytes]) -> None:
    """Size, rate and controls; pictures are taken all the same."""
    del bench.webcam.controls[Control.FOCUS_AUTO]
    bench.webcam.refusing = {Control.GAIN}
    bench.webcam.opening += [errno.EBUSY]
    bench.webcam.shoots(jpegs[0])
    bench.take(1, size_px=(800, 600), rate_hz=24, exposure_s=1.0, focus=5, gain=1)
    said = bench.listener.reasons("setting")

    assert said == [
        "size is not as wanted: the camera has 640 x 480, not 800 x 600",
        "rate_hz is not as wanted: the camera has 30 Hz, not 24 Hz",
        "exposure_s is not as wanted: exposure_absolute takes 3 to 2047 and is 2047, not 10000",
        "focus is not as wanted: the camera has no focus_auto",
        "gain is not as wanted: the camera refuses it (Permission denied)",
    ]
    assert bench.failures == [f"{PATH}: another program uses the camera; end that program."]


def test_what_was_lost_is_counted_with_its_reason(bench: Bench, jpegs: list[bytes]) -> None:
    """By the kernel's numbers, by its mark, and by the first bytes; each leaves a gap in the count."""
    bench.webcam.shoots(jpegs[0])
    bench.webcam.shoots(jpegs[1], skipping=2)
    bench.webcam.shoots(jpegs[2], flags=v4l2.TIMESTAMP_MONOTONIC | v4l2.BUFFER_ERROR)
    bench.webcam.shoots(b"", b"junk", jpegs[3])
    frames = bench.take(3)

    assert [frame.encoded for frame in frames] == [jpegs[0], jpegs[1], jpegs[3]]
    assert [frame.sequence for frame in frames] == [0, 3, 7]
    assert bench.listener.losses == [NOT_DELIVERED] * 2 + [DAMAGED] + [NO_JPEG] * 2


def test_what_was_lost_last_is_counted_when_the_camera_is_left(bench: Bench, jpegs: list[bytes]) -> None:
    """Damaged pictures are no sign of life: the camera is connected again, and they count all the same."""
    bench.webcam.shoots(*jpegs, flags=v4l2.TIMESTAMP_MONOTONIC | v4l2.BUFFER_ERROR)
    camera = bench.camera(rate_hz=5, stall_s=2.0)
    with camera, pytest.raises(CameraError, match="no picture for 2 s"):
        camera.next_frame(threading.Event())

    assert len(bench.webcam.steps) == len(jpegs) - len(bench.listener.losses) > 0
    assert set(bench.listener.losses) == {DAMAGED}


def test_numbers_that_begin_anew_or_run_wild_are_no_losses(bench: Bench, jpegs: list[bytes]) -> None:
    """No more can be lost than there was time for."""
    bench.webcam.shoots(jpegs[0])
    bench.webcam.steps.append(lambda camera: setattr(camera, "sequence", 2**31 - 5))
    bench.webcam.shoots(jpegs[1])
    bench.webcam.steps.append(lambda camera: setattr(camera, "sequence", 3))
    bench.webcam.shoots(jpegs[2])

    assert [frame.sequence for frame in bench.take(3)] == [0, 2, 3]
    assert bench.listener.losses == [NOT_DELIVERED]


def test_pictures_between_two_that_are_due_are_neither_kept_nor_lost(bench: Bench, jpegs: list[bytes]) -> None:
    """One each interval, of whatever the camera sends; what is lost between them is not missed."""
    bench.webcam.shoots(*jpegs[:6], late_ns=0)
    bench.webcam.shoots(*jpegs[6:8], skipping=1, late_ns=0)
    bench.webcam.shoots(*jpegs[8:], late_ns=0)
    frames = bench.take(4, rate_hz=10, interval_s=0.3)

    assert [frame.encoded for frame in frames] == [jpegs[0], jpegs[3], jpegs[6], jpegs[7]]
    assert [frame.sequence for frame in frames] == [0, 1, 2, 3]
    assert bench.listener.losses == []


def test_stall_is_an_error_and_a_wait_is_reported(bench: Bench, jpegs: list[bytes]) -> None:
    """So that the recorder connects again, and the watchdog hears that somebody waits."""
    bench.webcam.shoots(jpegs[0])
    camera = bench.camera(stall_s=4.0)
    with camera:
        camera.next_frame(threading.Event())
        with pytest.raises(CameraError, match="uvc: no picture for 4 s; check that the camera is on"):
            camera.next_frame(threading.Event())

    assert len(bench.listener.waits) >= 3


def test_frozen_camera_is_connected_again_once(bench: Bench, jpegs: list[bytes]) -> None:
    """With the same picture after that it is recorded on, and the flight says from where to where it stood still."""
    bench.webcam.shoots(*[jpegs[0]] * 30, jpegs[1], jpegs[2])
    frames = bench.take(32, rate_hz=10, frozen_s=1.0)

    assert bench.failures == ["The picture has not changed for 1 s, since frame 0; the camera is connected again."]
    assert len(bench.webcam.opened) == 2
    assert [frame.encoded for frame in frames] == [*[jpegs[0]] * 30, jpegs[1], jpegs[2]]
    said = [(each.sequence, each.reason.partition(":")[0]) for each in bench.listener.reports if each.state == "frozen"]
    assert said == [(0, "the picture is the same after connecting again"), (30, "the picture changes again")]


def test_numbers_that_begin_anew_with_a_connection_are_not_frozen(bench: Bench, jpegs: list[bytes]) -> None:
    """However long the camera was away."""
    camera = bench.camera(stall_s=4.0, frozen_s=2.0)
    sequences = []
    for jpeg in jpegs[:3]:
        bench.webcam.shoots(jpeg)
        with camera:
            sequences.append(camera.next_frame(threading.Event()).sequence)
            with pytest.raises(CameraError, match="no picture for 4 s"):
                camera.next_frame(threading.Event())

    assert sequences == [0, 1, 2]


def test_picture_that_came_just_before_the_plug_was_pulled_is_there(bench: Bench, jpegs: list[bytes]) -> None:
    """Its buffer cannot be given back; that is an error of the next picture."""
    bench.webcam.steps.append(lambda camera: camera.refused_requests.add(v4l2.Request.QBUF))
    with bench.camera() as camera:
        bench.webcam.shoots(jpegs[0])
        frame = camera.next_frame(threading.Event())
        with pytest.raises(CameraNotFoundError, match="plug it in"):
            camera.next_frame(threading.Event())

    assert frame.encoded == jpegs[0]


@pytest.mark.parametrize(("flags", "late_ns"), [(0x4000, 5_000_000), (0, -5_000_000), (0, 60 * NS_PER_S)])
def test_stamp_that_is_no_time_of_this_clock_is_not_believed(
    bench: Bench, jpegs: list[bytes], flags: int, late_ns: int
) -> None:
    """Of another clock, in the future, or long ago: the arrival is taken, and that is said."""
    bench.webcam.shoots(jpegs[0], flags=flags, late_ns=late_ns)
    (frame,) = bench.take(1, rate_hz=10)

    assert frame.captured_ns == frame.times.downloaded.realtime_ns - NS_PER_S // 10
    assert bench.listener.reasons("clock") == ["the kernel's times of the pictures are unusable; their arrival is used"]


def test_camera_is_let_go_of_if_no_memory_is_left_to_say_that_it_is_connected(
    bench: Bench, jpegs: list[bytes], monkeypatch: pytest.MonkeyPatch
) -> None:
    """Held open, it would be busy for the next connection, and so for ever."""

    def report(_status: object) -> None:
        raise MemoryError

    camera = bench.camera()
    with monkeypatch.context() as patched:
        patched.setattr(bench.listener, "report", report)
        with pytest.raises(MemoryError):
            camera.__enter__()
    (first,) = bench.webcam.opened
    bench.webcam.shoots(jpegs[0])

    assert first.closed
    with camera:
        assert camera.next_frame(threading.Event()) is not None


def test_stop_is_noticed_while_no_picture_comes(bench: Bench) -> None:
    """None comes back, not an error."""
    stop = threading.Event()
    stop.set()
    with bench.camera() as camera:
        assert camera.next_frame(stop) is None


@pytest.mark.parametrize(
    ("changes", "sentence"),
    [
        ({"opening": [errno.EACCES]}, "group video"),
        ({"capabilities": 0x00A00000}, "video-index0"),
        ({"formats": ("YUYV", "NV12")}, r"sends no JPEGs \(YUYV, NV12\)"),
    ],
)
def test_what_only_a_person_can_mend_is_said_so(bench: Bench, changes: dict[str, object], sentence: str) -> None:
    """In one sentence that names the device; whatever was opened is closed."""
    for name, value in changes.items():
        setattr(bench.webcam, name, value)
    with pytest.raises(CameraUnusableError, match=rf"{PATH}: .*{sentence}"):
        bench.camera().__enter__()

    assert all(each.closed for each in bench.webcam.opened)


@pytest.mark.parametrize(
    ("path", "kind"),
    [
        ("/dev/null", CameraUnusableError),
        (f"/dev/..{__file__}", CameraUnusableError),
        ("/dev/no-such", CameraNotFoundError),
    ],
)
def test_files_that_are_no_cameras_are_refused_by_the_kernel(path: str, kind: type[CameraError]) -> None:
    """By the real one, through a real request."""
    webcam = Webcam()
    camera = uvc_camera(Options(device=path), webcam.clock, Listener())
    with pytest.raises(kind, match=Path(path).name):
        camera.__enter__()
