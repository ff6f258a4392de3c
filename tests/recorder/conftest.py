"""Folders of pictures to record, configurations to record them with, recorders of a puppet camera, and a disk."""

from __future__ import annotations

import shutil
from collections.abc import Iterator
from pathlib import Path
from queue import SimpleQueue
from typing import Any

import pytest
from PIL import Image

from benchmarks.harm import Disk, mounted_disk
from benchmarks.recorders import PATIENCE_S
from camera_drivers.reporter import Reporter
from recorder import run as run_module
from recorder.capture import Wiring
from recorder.config import RecorderConfig, parse_config
from recorder.frame_queue import FrameQueue
from recorder.host import Host
from tests.jpegs import encoded
from tests.programs import write_yaml
from tests.recorder.helpers import Configure, Daemon, ManualClock, PuppetCamera, StartDaemon, WriteConfig

START_NS = 1_525_435_200_000_000_000  # 2018-05-04T12:00:00Z


@pytest.fixture(scope="session")
def forty_pictures(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Forty small pictures; the first was taken at noon."""
    folder = tmp_path_factory.mktemp("pictures")
    for index in range(40):
        exif = Image.Exif()
        exif.get_ifd(0x8769).update({0x9003: "2018:05:04 12:00:00", 0x920A: 4.45 + index})
        picture = Image.new("RGB", (64, 48), (index, 20, 40))
        (folder / f"{index:03d}.jpg").write_bytes(encoded(picture, exif=exif))
    return folder


@pytest.fixture
def pictures(tmp_path: Path, forty_pictures: Path) -> Path:
    """The same in a folder that may be changed."""
    return Path(shutil.copytree(forty_pictures, tmp_path / "pictures"))


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
        write_yaml(path, changed)
        return path

    return write


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


@pytest.fixture
def disk(tmp_path: Path) -> Iterator[Disk]:
    """A disk of 8 MiB; skips where nobody may mount one."""
    try:
        with mounted_disk(tmp_path) as disk:
            yield disk
    except PermissionError as error:
        pytest.skip(str(error))
