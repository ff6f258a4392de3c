"""What systemd hears, on a real socket."""

from __future__ import annotations

import socket
import threading
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest

from flight_file.durable_file import DurableFile
from recorder import signs_of_life, supervision
from recorder.service_manager import ServiceManager
from recorder.signs_of_life import SILENCE_S, SignsOfLife
from recorder.testing import ManualClock

Daemon = Any  # of the conftest
StartDaemon = Callable[..., Daemon]
Eventually = Callable[[Callable[[], object]], None]

LONG_NS = round(2 * SILENCE_S * 1e9)


class Listener:
    """A service manager's end of the socket."""

    def __init__(self, address: str) -> None:
        self._socket = socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM)
        self._socket.bind("\0" + address[1:] if address.startswith("@") else address)
        self._socket.setblocking(False)
        self.address = address
        self.heard: list[str] = []

    def hears(self, text: str) -> bool:
        """Whether it has been said since the last `forget`."""
        while True:
            try:
                self.heard += self._socket.recv(4096).decode().splitlines()
            except BlockingIOError:
                return any(line.startswith(text) for line in self.heard)

    def forget(self) -> None:
        """All that was said so far."""
        self.hears("")
        self.heard.clear()

    def close(self) -> None:
        """Hang up."""
        self._socket.close()


@pytest.fixture
def listener(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Listener]:
    """On a path; the recorder looks around more often than usual."""
    monkeypatch.setattr(supervision, "LOOK_S", 0.02)
    listener = Listener(str(tmp_path / "notify"))
    yield listener
    listener.close()


@pytest.mark.parametrize("name", ["{}/socket", "@recorder-test-{}"])
def test_protocol(tmp_path: Path, name: str) -> None:
    """One datagram, to a path or to the abstract namespace; without a manager, or when it is gone, nothing happens."""
    listener = Listener(name.format(tmp_path))
    service = ServiceManager.from_environment({"NOTIFY_SOCKET": listener.address})
    service.say("READY=1", "STATUS=fine")
    heard = listener.hears("STATUS=fine")
    listener.close()
    service.say("READY=1")
    ServiceManager.from_environment({}).say("READY=1")

    assert heard
    assert listener.heard == ["READY=1", "STATUS=fine"]


def test_ready_at_once_fed_while_it_records_and_stopping(
    start_daemon: StartDaemon, listener: Listener, eventually: Eventually
) -> None:
    """READY does not wait for the camera; the status is a sentence for people."""
    daemon = start_daemon(address=listener.address)
    eventually(lambda: listener.hears("READY=1"))
    daemon.feed(b"1")
    eventually(lambda: listener.hears("STATUS=1 pictures stored"))
    daemon.finish()

    assert listener.heard[0] == "READY=1"
    assert listener.hears("WATCHDOG=1")
    assert listener.hears("STOPPING=1")


def test_camera_that_hangs_starves_the_watchdog(
    start_daemon: StartDaemon, listener: Listener, eventually: Eventually
) -> None:
    """A driver that neither gives pictures nor says that it waits; a word of it feeds the watchdog again."""
    daemon = start_daemon(address=listener.address)
    daemon.feed(b"1")
    daemon.clock.advance(LONG_NS)
    eventually(lambda: listener.hears("STATUS=Nothing heard from the camera:"))
    listener.forget()
    eventually(lambda: listener.hears("STATUS=Nothing heard"))
    starved = not listener.hears("WATCHDOG=1")
    daemon.reporter.waiting("the next picture is not due yet")
    eventually(lambda: listener.hears("WATCHDOG=1"))

    assert starved
    assert daemon.events("silent")[-1]["who"] == "camera"


def test_disk_that_hangs_starves_the_watchdog(
    start_daemon: StartDaemon, listener: Listener, eventually: Eventually, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Also while the camera goes on."""
    released = threading.Event()
    released.set()
    sync = DurableFile.sync

    def hanging_sync(file: DurableFile) -> None:
        released.wait(120)
        sync(file)

    monkeypatch.setattr(DurableFile, "sync", hanging_sync)
    daemon = start_daemon(address=listener.address)
    daemon.feed(b"1")
    released.clear()
    daemon.clock.advance(2 * 10**9)
    daemon.flood(b"2")
    eventually(lambda: not len(daemon.queue))
    daemon.clock.advance(LONG_NS)
    daemon.reporter.waiting("the next picture is not due yet")
    eventually(lambda: listener.hears("STATUS=Nothing heard from the disk"))
    listener.forget()
    eventually(lambda: listener.hears("STATUS=Nothing heard"))
    starved = not listener.hears("WATCHDOG=1")
    released.set()

    assert starved


def test_disk_that_answers_with_errors_is_alive(
    start_daemon: StartDaemon,
    listener: Listener,
    eventually: Eventually,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Starting again would not help; the status says what is wrong."""
    monkeypatch.setattr(signs_of_life, "SILENCE_S", 1e9)  # this clock runs ahead while the writer tries again
    (tmp_path / "file").touch()
    start_daemon(address=listener.address, storage={"directory": str(tmp_path / "file" / "flights")})
    eventually(lambda: listener.hears("STATUS=The disk fails"))
    listener.forget()
    eventually(lambda: listener.hears("WATCHDOG=1"))


def test_signs_of_life_go_stale() -> None:
    """Each thread for itself."""
    clock = ManualClock(0)
    signs = SignsOfLife(clock)
    fresh = signs.silent()
    clock.advance(LONG_NS)
    both = signs.silent()
    signs.camera()
    disk = signs.silent()
    signs.disk()

    assert (fresh, both, disk, signs.silent()) == ("", "camera and disk", "disk", "")
