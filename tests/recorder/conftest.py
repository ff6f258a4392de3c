"""Folders of pictures to record, configurations to record them with, and a recorder with a camera worked by hand."""

from __future__ import annotations

import io
import json
import os
import subprocess
import threading
import time
from collections.abc import Callable, Iterator
from concurrent.futures import Future
from pathlib import Path
from queue import SimpleQueue
from typing import Any

import pytest
import yaml
from mcap.reader import make_reader
from PIL import Image

from camera_drivers.reporter import Reporter
from flight_file.frame import Frame
from flight_file.reader import open_flight
from recorder import run as run_module
from recorder.config import parse_config
from recorder.drivers import Wiring
from recorder.frame_queue import FrameQueue
from recorder.host import Host, this_host
from recorder.journal import Journal
from recorder.run import Outcome, record
from recorder.service_manager import ServiceManager
from recorder.settings import RecorderConfig
from recorder.stop import Stop
from recorder.testing import ManualClock, PuppetCamera

START_NS = 1_525_435_200_000_000_000  # 2018-05-04T12:00:00Z

Configure = Callable[..., RecorderConfig]
WriteConfig = Callable[..., Path]
StartDaemon = Callable[..., "Daemon"]
PATIENCE_S = 60.0  # far more than anything here takes


@pytest.fixture
def pictures(tmp_path: Path) -> Path:
    """Forty small pictures; the first was taken at noon."""
    folder = tmp_path / "pictures"
    folder.mkdir()
    for index in range(40):
        exif = Image.Exif()
        exif.get_ifd(0x8769).update({0x9003: "2018:05:04 12:00:00", 0x920A: 4.45 + index})
        buffer = io.BytesIO()
        Image.new("RGB", (64, 48), (index, 20, 40)).save(buffer, "JPEG", exif=exif)
        (folder / f"{index:03d}.jpg").write_bytes(buffer.getvalue())
    return folder


@pytest.fixture
def document(tmp_path: Path, pictures: Path) -> dict[str, Any]:
    """A configuration that replays the pictures as fast as possible, at 4 Hz of their own time."""
    return {
        "camera": {"driver": "replay", "path": str(pictures), "rate_hz": 4, "pace": "fastest"},
        "storage": {"directory": str(tmp_path / "flights")},
    }


@pytest.fixture
def configure(document: dict[str, Any]) -> Configure:
    """The configuration with some settings changed, by block."""

    def make(**blocks: dict[str, Any]) -> RecorderConfig:
        return parse_config(
            {**document, **{name: {**document.get(name, {}), **block} for name, block in blocks.items()}}
        )

    return make


@pytest.fixture
def write_config(tmp_path: Path, document: dict[str, Any]) -> WriteConfig:
    """The same as a file; gives its path."""

    def write(**blocks: dict[str, Any]) -> Path:
        changed = {**document, **{name: {**document.get(name, {}), **block} for name, block in blocks.items()}}
        path = tmp_path / "recorder.yaml"
        path.write_text(yaml.safe_dump(changed))
        return path

    return write


class Daemon:
    """A recorder of a live camera, in a thread of this process, on a clock that jumps instead of waiting."""

    def __init__(
        self, config: RecorderConfig, *, clock: ManualClock, camera: PuppetCamera, queue: FrameQueue, address: str
    ) -> None:
        self.clock = clock
        self.camera = camera
        self.stop = Stop()
        self.log = io.StringIO()
        self.directory = config.storage.directory
        self.queue = queue
        self.reporter: Reporter
        self.over: Future[Outcome] = Future()
        machine = this_host()
        host = Host(clock, machine.name, machine.boot_id, {}, machine.free_bytes, machine.temperatures_c)
        arguments = {"host": host, "stop": self.stop, "journal": Journal(self.log), "service": ServiceManager(address)}
        threading.Thread(target=self._run, args=(config, arguments), daemon=True).start()

    def _run(self, config: RecorderConfig, arguments: dict[str, Any]) -> None:
        try:
            self.over.set_result(record(config, **arguments))
        except Exception as error:  # noqa: BLE001 - the test is to see it
            self.over.set_exception(error)

    def feed(self, *jpegs: bytes) -> None:
        """Pictures, each 0.4 s after the one before, and none before the disk has had that."""
        for jpeg in jpegs:
            self.clock.advance(400_000_000)
            wanted = self.camera.shown + 1
            self.camera.show(jpeg)
            eventually(lambda wanted=wanted: self.over.done() or (self.camera.shown == wanted and not len(self.queue)))

    def flood(self, *jpegs: bytes) -> None:
        """Pictures, as fast as the camera can."""
        wanted = self.camera.shown + len(jpegs)
        self.camera.show(*jpegs)
        eventually(lambda: self.camera.shown == wanted)

    def finish(self) -> Outcome:
        """Stop it; gives its outcome or raises its error."""
        self.stop.request("stopped by the test")
        return self.over.result(PATIENCE_S)

    def events(self, name: str) -> list[dict[str, Any]]:
        """The lines of the log with this event."""
        lines = [json.loads(line) for line in self.log.getvalue().splitlines()]
        return [line for line in lines if line["event"] == name]

    def frames(self) -> list[Frame]:
        """All frames in all files, finished or in work, in the order of the segments."""
        paths = [path for path in self.directory.glob("*_*.mcap*") if path.suffix in {".mcap", ".part"}]
        return list(open_flight(sorted(paths)).frames()) if paths else []

    def messages(self, topic: str) -> list[dict[str, Any]]:
        """The JSON messages of a topic in all finished segments, by an independent reader, in the order written."""
        found = []
        for path in sorted(self.directory.glob("*.mcap")):
            with path.open("rb") as file:
                read = make_reader(file, validate_crcs=True).iter_messages(topics=[topic], log_time_order=False)
                found += [{**json.loads(message.data), "log_ns": message.log_time} for _, _, message in read]
        return found


def eventually(condition: Callable[[], object]) -> None:
    """Come back when the condition holds; fails if it never does."""
    deadline = time.monotonic() + PATIENCE_S
    while not condition():
        assert time.monotonic() < deadline, "it never came true"
        time.sleep(0.01)


@pytest.fixture(name="eventually")
def eventually_fixture() -> Callable[[Callable[[], object]], None]:
    """Waits for a condition."""
    return eventually


@pytest.fixture
def start_daemon(configure: Configure, monkeypatch: pytest.MonkeyPatch) -> Iterator[StartDaemon]:
    """Starts recorders of a puppet camera; those still running are stopped in the end."""
    running: list[Daemon] = []

    def start(*, address: str = "", realtime_ns: int = START_NS, **blocks: dict[str, Any]) -> Daemon:
        clock = ManualClock(realtime_ns)
        camera = PuppetCamera(clock)
        queue = FrameQueue()
        reporters: SimpleQueue[Reporter] = SimpleQueue()

        def wire(_config: RecorderConfig, _host: Host, reporter: Reporter) -> Wiring:
            reporters.put(reporter)
            return Wiring(camera, clock, live=True)

        monkeypatch.setattr(run_module, "wire", wire)
        monkeypatch.setattr(run_module, "FrameQueue", lambda: queue)
        running.append(Daemon(configure(**blocks), clock=clock, camera=camera, queue=queue, address=address))
        running[-1].reporter = reporters.get(timeout=PATIENCE_S)
        return running[-1]

    yield start
    for daemon in running:
        daemon.stop.request("the test is over")


class Disk:
    """A small file system of its own at `path`, mounted from `source`."""

    def __init__(self, path: Path, source: Path) -> None:
        self.path = path
        self._source = source

    def pull(self) -> None:
        """Take it away, whoever uses it."""
        subprocess.run(["umount", "--lazy", self.path], check=True)

    def plug(self) -> None:
        """Bring it back with what was on it."""
        subprocess.run(["mount", "--bind", self._source, self.path], check=True)

    def grow(self) -> None:
        """Give it more room than any test needs."""
        subprocess.run(["mount", "-o", "remount,size=64m", self._source], check=True)

    def remount(self, how: str) -> None:
        """Mount it again, `ro` or `rw`."""
        subprocess.run(["mount", "-o", f"remount,bind,{how}", self.path], check=True)


@pytest.fixture
def disk(tmp_path: Path) -> Iterator[Disk]:
    """A disk of 8 MiB; skips where nobody may mount one."""
    source, path = tmp_path / "device", tmp_path / "disk"
    source.mkdir()
    path.mkdir()
    mount = ["mount", "-t", "tmpfs", "-o", "size=8m", "none", source]
    if os.geteuid() != 0 or subprocess.run(mount, check=False, capture_output=True).returncode != 0:
        pytest.skip("mounting a disk needs the right to mount")
    disk = Disk(path, source)
    disk.plug()
    yield disk
    subprocess.run(["umount", "--lazy", path], check=False, capture_output=True)
    subprocess.run(["umount", "--lazy", source], check=True)
