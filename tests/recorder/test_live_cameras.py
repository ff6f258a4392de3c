"""The whole box with live cameras beside the QX10: lost and found again, stopped, killed; and what the flight says."""

from __future__ import annotations

import io
import signal
import subprocess
import threading
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import av
import pytest
from PIL import Image

from camera_drivers.uvc import stream
from flight_file.reader import open_flight
from recorder.config import parse_config
from recorder.host import SystemClock, this_host
from recorder.journal import Journal
from recorder.run import Outcome, record
from recorder.supervision import Stop
from tests.camera_drivers.picamera import rpicam_vid
from tests.camera_drivers.rtsp.server import Server, Show, nal_units
from tests.camera_drivers.uvc.webcam import PATH, Webcam
from tests.jpegs import encoded
from tests.programs import PATIENCE_S, begun, until, write_yaml
from tests.recorder.helpers import messages, recorder
from tests.videos import film, packets

PASSWORD = "s3cret"  # noqa: S105 - the test's own


@pytest.fixture(scope="module")
def jpegs() -> list[bytes]:
    """Two hundred pictures that differ."""
    return [jpeg(number) for number in range(200)]


def jpeg(number: int) -> bytes:
    """A picture that differs from any other."""
    return encoded(Image.new("RGB", (64, 48), (number, 20, 40)), comment=str(number))


def write_config(folder: Path, camera: dict[str, Any]) -> Path:
    """A configuration of a box with this camera."""
    document = {"camera": camera, "storage": {"directory": "flights", "keep_free_gib": 0, "segment_s": 2}}
    path = folder / "recorder.yaml"
    write_yaml(path, document)
    return path


def stopped(box: subprocess.Popen[str]) -> tuple[list[Path], str]:
    """End it as systemd does; its segments and its log."""
    box.send_signal(signal.SIGTERM)
    printed, log = box.communicate(timeout=60)
    assert box.returncode == 0, log
    return [Path(line) for line in printed.splitlines()], log


def statuses(paths: list[Path]) -> list[str]:
    """The camera's states, in order."""
    return [entry["state"] for entry in messages("/camera/status", *paths)]


@pytest.mark.slow
def test_usb_camera_that_is_unplugged_is_recorded_on_when_it_is_back(
    tmp_path: Path, jpegs: list[bytes], monkeypatch: pytest.MonkeyPatch
) -> None:
    """By itself; each picture is there once, and the flight says when the camera was away and what was lost."""
    webcam = Webcam(clock=SystemClock())
    make = stream.uvc_camera
    monkeypatch.setattr(stream, "uvc_camera", lambda *wanted: make(*wanted, webcam.open))
    config = parse_config(
        {
            "camera": {"driver": "uvc", "device": PATH, "exposure_s": 0.01},
            "storage": {"directory": str(tmp_path / "flights"), "keep_free_gib": 0},
        }
    )

    def away(camera: Webcam) -> None:
        camera.unplug()
        threading.Timer(0.5, lambda: setattr(camera, "plugged", True)).start()

    webcam.shoots(*jpegs[:20])
    webcam.shoots(jpegs[20], skipping=2)
    webcam.steps.append(away)
    webcam.shoots(*jpegs[21:40])
    stop, outcomes = Stop(), list[Outcome]()
    log = io.StringIO()
    box = threading.Thread(
        target=lambda: outcomes.append(record(config, host=this_host(), stop=stop, journal=Journal(log)))
    )
    box.start()
    limit = time.monotonic() + PATIENCE_S
    while (webcam.steps or webcam.opened[-1]._filled) and time.monotonic() < limit:
        time.sleep(0.05)
    stop.request("the flight is over")
    box.join(PATIENCE_S)
    paths = list(outcomes[0].paths)
    frames = list(open_flight(paths).frames())

    assert [frame.encoded for frame in frames] == jpegs[:40]
    assert [frame.sequence for frame in frames] == [*range(20), *range(22, 42)]
    assert outcomes[0].dropped == 2
    assert stream.NOT_DELIVERED in log.getvalue()
    assert statuses(paths).count("connected") == 2
    assert [*dict.fromkeys(statuses(paths))] == ["connecting", "connected", "capturing", "lost", "finished"]


@pytest.mark.slow
def test_raspberry_pis_camera_is_started_again_when_its_program_dies(tmp_path: Path, jpegs: list[bytes]) -> None:
    """A process of its own for the box; what each run of the program delivered is in the flight, byte for byte."""
    program = rpicam_vid.installed(tmp_path, jpegs[:30], then="exit")
    with begun(
        "recorder", "run", "--config", write_config(tmp_path, {"driver": "picamera", "program": program})
    ) as box:
        until(lambda: delivered(tmp_path) >= 40 or box.poll() is not None)
        paths, log = stopped(box)
    encoded = [frame.encoded for frame in open_flight(paths).frames()]

    assert encoded[:30] == jpegs[:30]
    assert encoded[30:] == jpegs[: len(encoded) - 30]
    assert len(encoded) > 30  # it may be stopped while some are on their way
    assert "failed to acquire camera imx708@1a" in log
    assert recorder("verify", *paths).returncode == 0


def delivered(folder: Path) -> int:
    """How many pictures the double has shown."""
    ledger = folder / "ledger"
    return ledger.read_text().count("\n") if ledger.exists() else 0


@pytest.mark.slow
@pytest.mark.untraced
def test_killed_box_keeps_what_was_synced_and_its_cameras_program_ends(tmp_path: Path, jpegs: list[bytes]) -> None:
    """As after a power cut; nobody is left who holds the camera."""
    program = rpicam_vid.installed(tmp_path, jpegs)
    flights = tmp_path / "flights"
    with begun(
        "recorder", "run", "--config", write_config(tmp_path, {"driver": "picamera", "program": program})
    ) as box:
        until(lambda: list(flights.glob("*_0001.mcap.part")) or box.poll() is not None)
        (child,) = children(box.pid)
        box.kill()
        box.communicate(timeout=60)
    until(lambda: not Path(f"/proc/{child}").exists())
    (part,) = flights.glob("*.part")
    recovered = recorder("recover", part)
    encoded = [frame.encoded for frame in open_flight(sorted(flights.glob("*.mcap"))).frames()]

    assert recovered.returncode in {0, 3}, recovered.stderr
    assert encoded == jpegs[: len(encoded)]
    assert len(encoded) > 40


def children(pid: int) -> list[int]:
    """The processes that a process has started."""
    found = []
    for folder in Path("/proc").glob("[0-9]*"):
        try:
            parent = int((folder / "stat").read_text().rpartition(")")[2].split()[1])
        except (OSError, ValueError):
            continue
        if parent == pid:
            found.append(int(folder.name))
    return found


@pytest.fixture(scope="module")
def units(tmp_path_factory: pytest.TempPathFactory) -> list[bytes]:
    """Forty access units of H.264."""
    return packets(film(tmp_path_factory.mktemp("film") / "film.h264"))


@pytest.fixture
def server(units: list[bytes]) -> Iterator[Server]:
    """An IP camera that asks for a password and closes the connection after each film."""
    with Server(Show(units, user=f"crew:{PASSWORD}", after="close", step_s=0.03)) as server:
        yield server


@pytest.mark.slow
def test_ip_camera_is_recorded_over_lost_connections_and_its_password_is_nowhere(
    tmp_path: Path, server: Server, units: list[bytes]
) -> None:
    """Neither in the log, nor in the status, nor in a flight; each film is there by its access units, and is shown."""
    (tmp_path / "password").write_text(f"crew:{PASSWORD}\n")
    camera = {"driver": "rtsp", "url": server.url, "credentials": "password"}
    with begun("recorder", "run", "--config", write_config(tmp_path, camera)) as box:
        until(lambda: server.show.requests.count("PLAY") >= 3 or box.poll() is not None)
        paths, log = stopped(box)
    flight = open_flight(paths)
    stored = [nal_units(frame.encoded) for frame in flight.frames()]
    decoder = av.CodecContext.create("h264", "r")
    shown = [each for frame in flight.frames() for each in decoder.decode(av.Packet(frame.encoded))]

    assert [frame for frame in flight.shown() if frame.group is None or frame.group.trouble] == []
    assert stored[:80] == [nal_units(unit) for unit in units] * 2
    assert len([*shown, *decoder.decode(None)]) == len(stored)
    assert [frame.sequence for frame in flight.frames()] == list(range(len(stored)))
    assert statuses(paths).count("lost") >= 2
    assert "the stream ended" in log
    assert PASSWORD not in log
    assert [path for path in paths if PASSWORD.encode() in path.read_bytes()] == []
    assert recorder("verify", *paths).returncode == 0


def test_refused_password_is_news_without_it(tmp_path: Path, server: Server) -> None:
    """The sentence says what to do; the box goes on trying."""
    (tmp_path / "password").write_text("crew:wr0ng\n")
    camera = {"driver": "rtsp", "url": server.url, "credentials": "password"}
    with begun("recorder", "run", "--config", write_config(tmp_path, camera), bufsize=0) as box:
        until(lambda: server.show.requests.count("DESCRIBE") >= 2 or box.poll() is not None)
        _, log = stopped(box)

    assert "does not take user and password; see camera.credentials" in log
    assert "wr0ng" not in log
