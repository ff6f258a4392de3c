"""Recorders in processes of their own, and what they say is stored held against what is there."""

from __future__ import annotations

import io
import json
import os
import re
import signal
import socket
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import yaml
from PIL import Image

from flight_file.errors import FlightFileError, LossKind
from flight_file.frame import ClockReading, Frame
from flight_file.reader import open_flight
from flight_file.salvage import recover_segment
from flight_file.signature import Signer
from flight_file.verification import Verdict, verify
from recorder.supervision import SOCKET_VARIABLE

RECORDER = (sys.executable, "-c", "from recorder.cli import main; main()")
PATIENCE_S = 120.0  # far more than anything here takes
STARTED = 5  # pictures that are on the disk when a file in work counts as one

_LOOK_S = 0.02
_SMALLEST_SEGMENT = 2**14  # one that was killed before its first bytes were there has nothing in it
_SAID = re.compile(r"^STATUS=(\d+) pictures stored", re.MULTILINE)


def eventually(condition: Callable[[], object]) -> None:
    """Come back when the condition holds; raises TimeoutError if it never does."""
    deadline = time.monotonic() + PATIENCE_S
    while not condition():
        if time.monotonic() > deadline:
            raise TimeoutError("it never came true")
        time.sleep(_LOOK_S)


def make_pictures(folder: Path, count: int) -> list[bytes]:
    """So many small pictures, each another, in a folder; gives their bytes in order."""
    folder.mkdir()
    contents = []
    for index in range(count):
        buffer = io.BytesIO()
        Image.new("RGB", (64, 48), (index % 256, index // 256, 7)).save(buffer, "JPEG", comment=str(index).encode())
        (folder / f"{index:04d}.jpg").write_bytes(buffer.getvalue())
        contents.append(buffer.getvalue())
    return contents


class _Listener(threading.Thread):
    """Hears what a recorder tells systemd."""

    def __init__(self) -> None:
        super().__init__(daemon=True)
        self._socket = socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM)
        self._socket.bind("")  # any free name of the abstract namespace
        self.address = "@" + self._socket.getsockname()[1:].decode()
        self.heard: list[tuple[int, int]] = []

    def run(self) -> None:
        while message := self._socket.recv(65536).decode():
            if match := _SAID.search(message):
                self.heard.append((time.monotonic_ns(), int(match[1])))
        self._socket.close()

    def end(self) -> None:
        with socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as sender:
            sender.sendto(b"", "\0" + self.address[1:])
        self.join()


class Box:
    """A recorder in a process of its own; its log lies beside its configuration.

    Parameters
    ----------
    program
        What is called with `run --config`.
    """

    def __init__(self, config: Path, program: Sequence[str] = RECORDER) -> None:
        document = yaml.safe_load(config.read_text(encoding="utf-8"))
        self.directory = config.parent / Path(document["storage"]["directory"])
        self._log = config.parent / "log"
        self._listener = _Listener()
        self._listener.start()
        pipe, environment = subprocess.PIPE, {**os.environ, SOCKET_VARIABLE: self._listener.address}
        command = [*program, "run", "--config", str(config)]
        with self._log.open("w", encoding="utf-8") as log:
            self.process = subprocess.Popen(command, stdin=pipe, stdout=pipe, stderr=log, text=True, env=environment)

    def events(self, name: str) -> list[dict[str, Any]]:
        """The lines of the log with this event."""
        lines = [json.loads(line) for line in self._log.read_text("utf-8").splitlines() if line.endswith("}")]
        return [line for line in lines if line["event"] == name]

    def order(self, what: str, value: int) -> None:
        """Write a line that a program which can be harmed obeys (see `benchmarks.harm`)."""
        if self.process.stdin is not None:
            self.process.stdin.write(f"{what} {value}\n")
            self.process.stdin.flush()

    def said_stored(self, before_ns: int | None = None) -> int:
        """How many pictures are stored, as it told systemd last, or last before a moment of the monotonic clock."""
        return max((count for at, count in self._listener.heard if before_ns is None or at <= before_ns), default=0)

    def _own(self, suffix: str) -> list[Path]:
        """Files of its recording in their order; all files there are while it has not said how that is called."""
        name = next((event["recording"] for event in self.events("recording_started")), "*")
        return sorted(self.directory.glob(f"{name}_*{suffix}"))

    def in_work(self) -> Path | None:
        """The newest file in work, once a few pictures in it are on the disk."""
        for part in reversed(self._own(".part")):
            with suppress(FlightFileError):
                if len(list(open_flight([part]).frames())) >= STARTED:
                    return part
        return None

    def in_work_soon(self) -> Path:
        """The same, when there is one; raises TimeoutError."""
        eventually(self.in_work)
        part = self.in_work()
        return self.in_work_soon() if part is None else part

    def finished(self) -> list[Path]:
        """The finished segments of its own."""
        return self._own(".mcap")

    def frames(self) -> list[Frame]:
        """All frames in these."""
        return [frame for path in self.finished() for frame in open_flight([path]).frames()]

    def stop(self) -> list[Path]:
        """End it as systemd does; gives what it says that it recorded.

        Raises
        ------
        ChildProcessError
            It failed; with its log.
        """
        self.process.send_signal(signal.SIGTERM)
        printed, _ = self.process.communicate(timeout=PATIENCE_S)
        self._listener.end()
        if self.process.returncode != 0:
            raise ChildProcessError(self._log.read_text("utf-8"))
        return [Path(line) for line in printed.splitlines()]

    def kill(self) -> None:
        """End it as a power cut does, if it still runs."""
        self.process.kill()
        self.process.communicate(timeout=PATIENCE_S)
        if self._listener.is_alive():
            self._listener.end()

    def recover(self, signer: Signer) -> Iterator[str]:
        """Finish what it left in work; gives what may not be, in words."""
        at = ClockReading(time.time_ns(), time.monotonic_ns())
        for part in self._own(".part"):
            try:
                recovery = recover_segment(part, at=at, signer=signer)
            except FlightFileError as error:
                if part.stat().st_size > _SMALLEST_SEGMENT:
                    yield str(error)
                continue
            if any(loss.kind is LossKind.DAMAGED for loss in recovery.losses):
                yield f"{part.name} is damaged inside"


@dataclass(frozen=True, slots=True)
class Kept:
    """What a recorder had said is stored, held against what is there.

    Attributes
    ----------
    said, found
        Frames that were said to be stored, and frames that are there.
    lost
        Frames that were said to be stored and are not there, byte for byte.
    dropped
        Frames that it said it could not store.
    verdict
        Of `verify` with the recorder's public key; None if there is no segment.
    newest_ns
        When the last frame that is there had been downloaded, by the wall clock; None if there is none.
    faults
        What is not as it must be, in words; empty if all is.
    """

    said: int
    found: int
    lost: int
    dropped: int
    verdict: Verdict | None
    newest_ns: int | None
    faults: tuple[str, ...]


def kept(box: Box, pictures: Sequence[bytes], signer: Signer, *, said: int | None = None) -> Kept:
    """Recover what a box of a replay left, and look whether all of it is there.

    Parameters
    ----------
    pictures
        What was replayed, in order.
    said
        How many pictures, the first, must be there. None: as many as the log's last line says.
    """
    faults = list(box.recover(signer))
    frames = box.frames()
    numbers = [frame.sequence for frame in frames]
    right = {frame.sequence for frame in frames if frame.encoded == pictures[frame.sequence]}
    if numbers != sorted(right):
        faults.append("a frame is not the picture it was, byte for byte and in order")
    ended = box.events("recording_finished")
    dropped = ended[-1]["dropped"] if ended else 0
    if said is None:
        said = ended[-1]["stored"] if ended else 0
        lost = max(0, said - len(right))
    else:
        lost = len(set(range(said)) - right)
    return judged(box, frames, signer, said=said, lost=lost, dropped=dropped, faults=faults)


def judged(
    box: Box, frames: Sequence[Frame], signer: Signer, *, said: int, lost: int, dropped: int, faults: Sequence[str]
) -> Kept:
    """The same, of frames that have been looked at; a loss and a verdict that does not fit are faults."""
    segments, found = box.finished(), list(faults)
    checks = verify(segments, public_key=signer.public_key) if segments else []
    verdict = max((check.verdict for check in checks), key=list(Verdict).index, default=None)
    if verdict is Verdict.FAULT:
        found.append(f"verify: {[check.first_fault for check in checks if check.first_fault is not None]}")
    if lost:
        found.append(f"{lost} frames of {said} that were said to be stored are not there")
    newest_ns = frames[-1].times.downloaded.realtime_ns if frames else None
    return Kept(said, len(frames), lost, dropped, verdict, newest_ns, tuple(found))
