"""The store on a disk that fails at any moment, and half-way through a write: each frame is there once, in order."""

from __future__ import annotations

import errno
import hashlib
import io
import random
from dataclasses import dataclass, field
from pathlib import Path

import pytest

from flight_file import durable_file
from flight_file.durable_file import DurableFile
from flight_file.errors import FlightNotWrittenError
from flight_file.frame import ClockReading, Frame, HostTimes
from flight_file.reader import open_flight
from flight_file.reports import CameraStatus
from flight_file.salvage import recover_segment
from flight_file.segments import Plan
from flight_file.session import Session
from flight_file.verification import Verdict, verify
from recorder.drops import Drops
from recorder.journal import Journal
from recorder.retention import Retention, Rules
from recorder.store import Store

FRAMES = 120
STEP_NS = 300_000_000
ERRORS = (errno.ENOSPC, errno.EIO, errno.EROFS)


def at(number: int) -> ClockReading:
    """When a frame comes."""
    return ClockReading(1_525_435_200_000_000_000 + number * STEP_NS, number * STEP_NS)


def frame(number: int, size: int) -> Frame:
    """One of this size."""
    jpeg = number.to_bytes(4, "big") + bytes(size)
    times = HostTimes(at(number), at(number), at(number))
    return Frame(number, at(number).realtime_ns, jpeg, hashlib.sha256(jpeg).hexdigest(), times)


@dataclass
class Moody:
    """A disk that fails now and then; a write that fails may have reached the disk in part."""

    monkeypatch: pytest.MonkeyPatch
    chance: random.Random
    part: float
    failures: int = 0
    operations: list[str] = field(default_factory=list)

    def __post_init__(self) -> None:
        write, sync, rename = DurableFile.write, DurableFile.sync, durable_file.rename_durably

        def moody_write(file: DurableFile, data: bytes) -> int:
            if self.fails():
                write(file, bytes(data)[: self.chance.randrange(len(data) + 1)])
                raise self.error(file.path)
            return write(file, data)

        def moody_sync(file: DurableFile) -> None:
            if self.fails():
                raise self.error(file.path)
            sync(file)

        def moody_rename(source: Path, target: Path) -> None:
            if self.fails():
                raise self.error(target)
            rename(source, target)

        self.monkeypatch.setattr(DurableFile, "write", moody_write)
        self.monkeypatch.setattr(DurableFile, "sync", moody_sync)
        self.monkeypatch.setattr("flight_file.writer.rename_durably", moody_rename)

    def fails(self) -> bool:
        """Whether it does now."""
        failing = self.chance.random() < self.part
        self.failures += failing
        return failing

    def error(self, path: Path) -> FlightNotWrittenError:
        """As `durable_file` makes it."""
        number = self.chance.choice(ERRORS)
        error = FlightNotWrittenError(path, reason="cannot be written")
        error.__cause__ = OSError(number, errno.errorcode[number])
        return error


def make_store(directory: Path, left: list[Path], *, endures: bool = True) -> Store:
    """A store of short segments; what it leaves in work is noted."""
    journal = Journal(io.StringIO())
    return Store(
        lambda: Plan(directory, Session("20180504T120000Z"), {}, segment_ns=5 * STEP_NS),
        status=CameraStatus("capturing"),
        retention=Retention(directory, Rules(0, 10**18), free_bytes=lambda _path: None, journal=journal),
        endures=endures,
        drops=Drops(),
        journal=journal,
        left_behind=left.append,
    )


@pytest.mark.parametrize("seed", range(12))
@pytest.mark.parametrize("size", [100, 100_000])
def test_each_frame_is_there_once(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, seed: int, size: int) -> None:
    """Whatever fails when; the chain goes on over all segments."""
    left: list[Path] = []
    with monkeypatch.context() as patched:
        moody = Moody(patched, random.Random(seed), part=0.05)  # noqa: S311 - no secrets
        store = make_store(tmp_path, left)
        for number in range(FRAMES):
            while not store.try_now(at(number)):
                pass
            store.put(frame(number, size), at(number))
        moody.part = 0.0
        while not store.try_now(at(FRAMES)):
            pass
        store.finish("stopped", at(FRAMES))
    for path in left:
        if path.exists():
            recover_segment(path, at=at(FRAMES))
    paths = sorted(tmp_path.iterdir())
    (check,) = verify(paths)

    assert moody.failures > 3
    assert [path.suffix for path in paths] == [".mcap"] * len(paths)
    assert list(open_flight(paths).frames()) == [frame(number, size) for number in range(FRAMES)]
    assert check.verdict is not Verdict.FAULT


def test_store_that_does_not_endure_raises(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """And what it wrote so far stays as it is."""
    store = make_store(tmp_path, [], endures=False)
    store.open(at(0))
    store.put(frame(0, 100_000), at(0))
    Moody(monkeypatch, random.Random(0), part=1.0)  # noqa: S311 - no secrets

    with pytest.raises(FlightNotWrittenError):
        store.put(frame(1, 100_000), at(1))
    store.abandon()
    assert list(open_flight([tmp_path / "20180504T120000Z_0000.mcap.part"]).frames()) == [frame(0, 100_000)]
