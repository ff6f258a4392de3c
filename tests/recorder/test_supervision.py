"""What systemd hears, on a real socket."""

from __future__ import annotations

import errno
import re
import socket
from collections.abc import Iterator
from pathlib import Path

import pytest

from benchmarks.harm import FailingDisk
from benchmarks.recorders import eventually
from camera_drivers.errors import CameraError
from recorder import supervision
from recorder.supervision import ServiceManager
from recorder.thresholds import SILENCE_S
from tests.programs import ROOT
from tests.recorder.helpers import StartDaemon

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

    def statuses(self) -> list[str]:
        """What people were told."""
        return [line.removeprefix("STATUS=") for line in self.heard if line.startswith("STATUS=")]

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


@pytest.mark.parametrize(
    "text",
    ["x\nMAINPID=1\nWATCHDOG=trigger", "\udcff", "L" * 600_000, "ü" * 600_000],
    ids=["lines", "no UTF-8", "long", "long and wide"],
)
def test_no_text_is_taken_for_another_assignment_or_takes_one_along(tmp_path: Path, text: str) -> None:
    """With line ends, with the other bytes of a file's name, or longer than a datagram: it is one line, perhaps cut."""
    listener = Listener(str(tmp_path / "notify"))
    ServiceManager(listener.address).say("WATCHDOG=1", f"STATUS={text}")
    listener.hears("")
    listener.close()

    assert len(listener.heard) == 2
    assert listener.heard[0] == "WATCHDOG=1"
    assert listener.heard[1].startswith("STATUS=")


def test_status_that_cannot_be_sent_does_not_starve_the_watchdog(start_daemon: StartDaemon, listener: Listener) -> None:
    """A camera that says half a megabyte, and what systemd would obey: it is fed, and nothing else is told."""
    daemon = start_daemon(address=listener.address)
    daemon.camera.fail(CameraError("\udcff\nMAINPID=1\n" + "L" * 600_000))
    daemon.feed(b"1")
    listener.forget()
    eventually(lambda: listener.hears("WATCHDOG=1"))
    daemon.finish()
    (lost,) = [entry for entry in daemon.messages("/camera/status") if entry["state"] == "lost"]

    assert lost["reason"].startswith("\\udcff\\x0aMAINPID=1\\x0aLLL")
    assert len(lost["reason"]) < 2000
    assert {line.partition("=")[0] for line in listener.heard} <= {"READY", "WATCHDOG", "STATUS", "STOPPING"}


def test_disk_whose_path_is_no_text_fails_and_comes_back(
    start_daemon: StartDaemon, listener: Listener, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Its name has bytes that are no UTF-8, and stands in the status, the log and the flight."""
    monkeypatch.setattr(supervision, "SILENCE_S", 1e9)  # this clock runs ahead while the writer tries again
    failing = FailingDisk(monkeypatch.setattr)
    daemon = start_daemon(address=listener.address, storage={"directory": str(tmp_path / "\udcff")})
    daemon.feed(b"1")
    failing.error = errno.EIO
    daemon.clock.advance(2 * 10**9)
    daemon.flood(b"2")
    eventually(lambda: listener.hears("STATUS=The disk fails"))
    failing.error = 0
    eventually(lambda: daemon.events("disk_back"))
    daemon.finish()

    assert [frame.encoded for frame in daemon.frames()] == [b"1", b"2"]


def test_ready_at_once_fed_while_it_records_and_stopping(start_daemon: StartDaemon, listener: Listener) -> None:
    """READY does not wait for the camera; the status is a sentence for people, the one that docs/box.md shows."""
    (shown,) = re.findall(r'^Status: "(.*; camera capturing) ', (ROOT / "docs" / "box.md").read_text(), re.MULTILINE)
    counted = re.compile(re.sub(r"[\d.]+", r"[\\d.]+", shown))
    daemon = start_daemon(address=listener.address)
    eventually(lambda: listener.hears("READY=1"))
    daemon.feed(b"1")
    daemon.reporter.lost("the download broke off")
    daemon.feed(b"2")
    eventually(lambda: listener.hears("") and any(map(counted.match, listener.statuses())))
    daemon.finish()

    assert listener.heard[0] == "READY=1"
    assert listener.hears("WATCHDOG=1")
    assert listener.hears("STOPPING=1")


@pytest.mark.parametrize("who", ["camera", "disk"])
def test_what_hangs_starves_the_watchdog(
    start_daemon: StartDaemon, listener: Listener, monkeypatch: pytest.MonkeyPatch, who: str
) -> None:
    """A driver that neither gives pictures nor says that it waits; a disk, also while the camera goes on."""
    failing = FailingDisk(monkeypatch.setattr)
    daemon = start_daemon(address=listener.address)
    daemon.feed(b"1")
    if who == "disk":
        failing.released.clear()
        daemon.clock.advance(2 * 10**9)
        daemon.flood(b"2")
        eventually(lambda: not len(daemon.queue))
    daemon.clock.advance(LONG_NS)
    if who == "disk":
        daemon.reporter.waiting("the next picture is not due yet")
    eventually(lambda: listener.hears(f"STATUS=Nothing heard from the {who}:"))
    listener.forget()
    eventually(lambda: listener.hears("STATUS=Nothing heard"))
    starved = not listener.hears("WATCHDOG=1")
    failing.released.set()
    daemon.reporter.waiting("the next picture is not due yet")
    eventually(lambda: listener.hears("WATCHDOG=1"))

    assert starved
    assert who in {event["who"] for event in daemon.events("silent")}


def test_disk_that_answers_with_errors_is_alive(
    start_daemon: StartDaemon, listener: Listener, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Starting again would not help; the status says what is wrong."""
    monkeypatch.setattr(supervision, "SILENCE_S", 1e9)  # this clock runs ahead while the writer tries again
    (tmp_path / "link").symlink_to("missing")
    start_daemon(address=listener.address, storage={"directory": str(tmp_path / "link" / "flights")})
    eventually(lambda: listener.hears("STATUS=The disk fails"))
    listener.forget()
    eventually(lambda: listener.hears("WATCHDOG=1"))
