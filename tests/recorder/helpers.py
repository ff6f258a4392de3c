"""What tests of the recorder share: a clock and a camera worked by hand, a recorder of these, and the commands."""

from __future__ import annotations

import hashlib
import io
import json
import os
import queue
import threading
from collections.abc import Callable
from concurrent.futures import Future
from contextlib import suppress
from pathlib import Path
from types import TracebackType
from typing import Any, Self

from mcap.reader import make_reader

from benchmarks.recorders import PATIENCE_S, eventually
from camera_drivers.camera import CameraIdentity
from camera_drivers.clock import Clock
from camera_drivers.reporter import Reporter
from flight_file.frame import Frame, HostTimes
from flight_file.reader import open_flight
from recorder.config import RecorderConfig
from recorder.frame_queue import FrameQueue
from recorder.host import Host, SimulatedClock, this_host
from recorder.journal import Journal
from recorder.run import Outcome, record
from recorder.supervision import ServiceManager, Stop
from tests.programs import Done, ran

Configure = Callable[..., RecorderConfig]
WriteConfig = Callable[..., Path]
StartDaemon = Callable[..., "Daemon"]


class ManualClock(SimulatedClock):
    """A clock that moves only when it is told to, or when somebody waits for it."""

    def advance(self, duration_ns: int) -> None:
        """Turn both sides forward."""
        with self._lock:
            self._elapsed_ns += duration_ns

    def set_realtime(self, realtime_ns: int) -> None:
        """Set the wall clock, as an operator or NTP would; the monotonic side does not notice."""
        with self._lock:
            self._start_ns = realtime_ns - self._elapsed_ns


class PuppetCamera:
    """A live camera that gives the pictures and the failures that it is given, in order, and waits in between.

    Attributes
    ----------
    shown, connections
        Pictures given so far that the recorder has in its queue: it has asked for the next; how often it was connected.
    """

    identity = CameraIdentity(driver="puppet", model="P-1", serial="7")

    def __init__(self, clock: Clock) -> None:
        self._clock = clock
        self._script: queue.SimpleQueue[bytes | Exception | Callable[[], object]] = queue.SimpleQueue()
        self.shown = 0
        self._sequence = 0
        self.connections = 0

    def show(self, *jpegs: bytes) -> None:
        """Pictures to give."""
        for jpeg in jpegs:
            self._script.put(jpeg)

    def fail(self, failure: Exception | Callable[[], object]) -> None:
        """A failure to raise from the next call, or what it is to hang in."""
        self._script.put(failure)

    def __enter__(self) -> Self:
        """Connect."""
        self.connections += 1
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, traceback: TracebackType | None, /
    ) -> None:
        """Disconnect."""

    def next_frame(self, stop: threading.Event) -> Frame | None:
        """What comes next."""
        self.shown = self._sequence
        while not stop.is_set():
            try:
                given = self._script.get(timeout=0.02)
            except queue.Empty:
                continue
            if isinstance(given, Exception):
                raise given
            if callable(given):
                given()
                continue
            return self._frame(given)
        return None

    def _frame(self, jpeg: bytes) -> Frame:
        at = self._clock.read()
        sequence, self._sequence = self._sequence, self._sequence + 1
        return Frame(sequence, at.realtime_ns, jpeg, hashlib.sha256(jpeg).hexdigest(), HostTimes(at, at, at))


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
        """The JSON messages of a topic in all finished segments, in the order written."""
        return messages(topic, *sorted(self.directory.glob("*.mcap")))


def messages(topic: str, *paths: Path) -> list[dict[str, Any]]:
    """The JSON messages of a topic, with their log time, by an independent reader, in the order written."""
    found = []
    for path in paths:
        with path.open("rb") as file:
            read = make_reader(file, validate_crcs=True).iter_messages(topics=[topic], log_time_order=False)
            found += [{**json.loads(message.data), "log_ns": message.log_time} for _, _, message in read]
    return found


def recorder(*arguments: str | Path) -> Done:
    """Run a command to its end."""
    return ran("recorder", *arguments)


def stuck_pipe() -> tuple[int, int]:
    """Open a pipe with no room left: its reading and its writing end, of which the latter waits for ever."""
    reading, writing = os.pipe()
    os.set_blocking(writing, False)
    with suppress(BlockingIOError):
        while True:
            os.write(writing, bytes(4096))
    os.set_blocking(writing, True)
    return reading, writing
