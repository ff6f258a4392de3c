"""A disk that fails at any moment, and a directory changed by others: every loss of the recorder is reported."""

from __future__ import annotations

import errno
import hashlib
import io
import os
import random
import shutil
import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import pytest

from benchmarks.harm import HARMED, TAKEN, Disk, FailingDisk, take_away
from benchmarks.recorders import PATIENCE_S, Box, eventually
from flight_file import files, writer
from flight_file.errors import FlightNotWrittenError
from flight_file.files import DurableFile
from flight_file.flight_writer import Plan
from flight_file.frame import CameraStatus, ClockReading, Frame, HostTimes
from flight_file.reader import open_flight
from flight_file.salvage import recover_segment
from flight_file.session import Session
from flight_file.verification import Verdict, verify
from recorder import supervision
from recorder.errors import RecorderError
from recorder.frame_queue import DELETED, Drops, Ended
from recorder.host import SimulatedClock, fixed_host
from recorder.housekeeping import Retention, Rules
from recorder.journal import Journal
from recorder.run import record
from recorder.segment_store import SegmentStore
from recorder.thresholds import QUEUE_BYTES
from tests.recorder.helpers import Configure, Daemon, StartDaemon, WriteConfig

FRAMES = 60
STEP_NS = 300_000_000
ERRORS = (errno.ENOSPC, errno.EIO, errno.EROFS)
SIZE = 500_000
WAITING = QUEUE_BYTES // SIZE  # pictures that have room in the queue
HUGE_HOURS = 1000


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
        write, sync, rename, sync_directory = (
            DurableFile.write, DurableFile.sync, DurableFile.rename, files.sync_directory,
        )  # fmt: skip

        def moody_write(file: DurableFile, data: bytes) -> int:
            if self.fails():
                write(file, bytes(data)[: self.chance.randrange(len(data) + 1)])
                raise self.error(file.path)
            return write(file, data)

        def moody_sync(file: DurableFile) -> None:
            if self.fails():
                raise self.error(file.path)
            sync(file)

        def moody_rename(file: DurableFile, path: Path) -> None:
            if self.fails():
                raise self.error(path)
            rename(file, path)

        def moody_sync_directory(directory: Path) -> None:
            if self.fails():
                raise self.error(directory)
            sync_directory(directory)

        self.monkeypatch.setattr(DurableFile, "write", moody_write)
        self.monkeypatch.setattr(DurableFile, "sync", moody_sync)
        self.monkeypatch.setattr(DurableFile, "rename", moody_rename)
        self.monkeypatch.setattr(files, "sync_directory", moody_sync_directory)

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


def make_store(
    directory: Path, left: list[Path], *, retries_forever: bool = True, drops: Drops | None = None
) -> SegmentStore:
    """A store of short segments; what it leaves in work is noted."""
    journal = Journal(io.StringIO())
    return SegmentStore(
        lambda: Plan(directory, Session("20180504T120000Z"), {}, segment_ns=5 * STEP_NS),
        status=CameraStatus("capturing"),
        retention=Retention(directory, Rules(0, 10**18, 10**18), free_bytes=lambda _path: None, journal=journal),
        retries_forever=retries_forever,
        drops=drops or Drops(),
        journal=journal,
        left_behind=left.append,
    )


def finished(store: SegmentStore) -> None:
    """Ends a store whose disk works again."""
    while not store.try_now(at(FRAMES)):
        pass
    store.finish("stopped", at(FRAMES))


def recovered(directory: Path, left: Sequence[Path]) -> list[Path]:
    """Recovers what a store left in work; gives all segments."""
    for path in left:
        if path.exists():
            recover_segment(path, at=at(FRAMES))
    return sorted(directory.iterdir())


@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize("size", [100, 100_000])
def test_each_frame_is_there_once(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, seed: int, size: int) -> None:
    """Whatever fails when; the chain goes on over all segments."""
    left: list[Path] = []
    with monkeypatch.context() as patched:
        moody = Moody(patched, random.Random(seed), part=0.1)  # noqa: S311 - no secrets
        store = make_store(tmp_path, left)
        for number in range(FRAMES):
            while not store.try_now(at(number)):
                pass
            store.put(frame(number, size), at(number))
        moody.part = 0.0
        finished(store)
    paths = recovered(tmp_path, left)
    (check,) = verify(paths)

    assert moody.failures > 3
    assert [path.suffix for path in paths] == [".mcap"] * len(paths)
    assert list(open_flight(paths).frames()) == [frame(number, size) for number in range(FRAMES)]
    assert check.verdict is not Verdict.FAULT


def test_recorders_that_start_in_one_second_have_names_of_their_own(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Also if one begins while the disk still writes the head of the other's first segment."""
    slow, quick = make_store(tmp_path, []), make_store(tmp_path, [])
    sync = DurableFile.sync

    def slow_sync(file: DurableFile) -> None:
        if file.path.parent == tmp_path:  # not what another test's recorder still writes
            monkeypatch.setattr(DurableFile, "sync", sync)
            assert quick.open(at(0))
        sync(file)

    monkeypatch.setattr(DurableFile, "sync", slow_sync)
    assert slow.open(at(0))
    for store in (slow, quick):
        store.put(frame(0, 100), at(0))
        store.finish("stopped", at(1))

    assert (slow.recording, quick.recording) == ("20180504T120000Z", "20180504T120000Z-2")
    assert [path.name for path in sorted(tmp_path.iterdir())] == [
        "20180504T120000Z-2_0000.mcap",
        "20180504T120000Z_0000.mcap",
    ]
    assert [check.verdict for check in verify(sorted(tmp_path.iterdir()))] == [Verdict.FITS, Verdict.FITS]


@pytest.mark.parametrize("fails", ["to make the name durable", "to begin the next segment"])
def test_segment_that_has_its_final_name_is_finished(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, fails: str
) -> None:
    """Whatever fails after the renaming: none of its pictures is stored twice or counted lost, and it is left alone."""
    left: list[Path] = []
    store = make_store(tmp_path, left)
    store.open(at(0))
    store.put(frame(0, 100), at(0))
    with monkeypatch.context() as patched:

        def refuse(*_arguments: object, **_options: object) -> None:
            raise FlightNotWrittenError(tmp_path, reason="cannot be written (Input/output error)")

        if fails == "to make the name durable":
            patched.setattr(files, "sync_directory", refuse)
        else:
            patched.setattr(DurableFile, "__init__", refuse)
        store.put(frame(6, 100), at(6))
        assert store.trouble is not None
    store.try_now(at(7))
    store.finish("stopped", at(7))
    paths = sorted(tmp_path.iterdir())
    (check,) = verify(paths)

    assert [path.name for path in paths] == ["20180504T120000Z_0000.mcap", "20180504T120000Z_0001.mcap"]
    assert store.paths == paths
    assert left == []
    assert [found.sequence for found in open_flight(paths).frames()] == [0, 6]
    assert (store.stored, check.verdict) == (2, Verdict.FITS)


def refusing(call: Callable[..., Any], refused: Path, number: int) -> Callable[..., Any]:
    """A system call that refuses one path."""

    def answer(path: Any, *arguments: Any, **options: Any) -> Any:  # noqa: ANN401 - whatever the call takes and returns
        if path == refused:
            raise OSError(number, os.strerror(number))
        return call(path, *arguments, **options)

    return answer


def failed_file(store: SegmentStore, directory: Path, monkeypatch: pytest.MonkeyPatch) -> tuple[FailingDisk, Path]:
    """A file with one picture on the disk, which fails while the next one is written."""
    store.open(at(0))
    store.put(frame(0, 100), at(0))
    store.tick(at(4))
    failing = FailingDisk(monkeypatch.setattr)
    failing.error = errno.EIO
    store.put(frame(1, 100), at(8))
    (part,) = directory.glob("*.part")
    return failing, part


@pytest.mark.parametrize("taken_by", ["link", "fifo", "folder", "file", "another user's file", "nothing"])
def test_whatever_took_the_place_of_a_failed_file_is_left_as_it_is(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, taken_by: str
) -> None:
    """While nothing can be written the file is closed: its name may lead elsewhere by then, and its frames count."""
    left: list[Path] = []
    store, stranger = make_store(tmp_path / "store", left), tmp_path / "stranger"
    (tmp_path / "store").mkdir()
    stranger.write_bytes(bytes(100_000))
    failing, part = failed_file(store, tmp_path / "store", monkeypatch)
    part.unlink()
    if taken_by == "link":
        part.symlink_to(stranger)
    elif taken_by == "fifo":
        os.mkfifo(part)
    elif taken_by == "folder":
        part.mkdir()
    elif taken_by == "file":
        stranger.rename(part)
        stranger.symlink_to(part)
    elif taken_by == "another user's file":
        part.touch()
        monkeypatch.setattr(files.os, "open", refusing(os.open, part, errno.EACCES))
    elif taken_by == "nothing":  # and the disk does not say what the finished file's name leads to
        monkeypatch.setattr(os, "stat", refusing(os.stat, part.with_suffix(""), errno.EIO))
    failing.error = 0
    store.try_now(at(9))
    monkeypatch.undo()
    store.finish("stopped", at(9))

    assert stranger.read_bytes() == bytes(100_000)
    assert left == []
    assert [found.sequence for found in open_flight(store.paths).frames()] == [1]
    assert store.stored == 1


def test_file_that_can_neither_be_synced_nor_removed_gives_no_picture_twice(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """As where an error makes the disk read-only: its bytes may be there all the same, and are written once more."""
    left: list[Path] = []
    store = make_store(tmp_path, left)
    store.open(at(0))
    with monkeypatch.context() as patched:

        def refuse(file: DurableFile) -> None:
            raise FlightNotWrittenError(file.path, reason="cannot be written (Input/output error)")

        patched.setattr(DurableFile, "sync", refuse)
        patched.setattr(os, "unlink", refusing(os.unlink, next(tmp_path.glob("*.part")), errno.EROFS))
        store.put(frame(0, 100), at(0))
        store.tick(at(4))
        assert store.trouble is not None
    assert next(tmp_path.glob("*.part")).read_bytes().count(bytes(100))
    store.try_now(at(7))
    store.put(frame(1, 100), at(7))
    store.finish("stopped", at(7))
    for part in left:
        recover_segment(part, at=at(8))
    paths = sorted(tmp_path.iterdir())
    (check,) = verify(paths)

    assert [found.sequence for found in open_flight(paths).frames()] == [0, 1]
    assert [path.suffix for path in paths] == [".mcap", ".mcap"]
    assert (store.stored, check.verdict) == (2, Verdict.LOSS)


def test_finished_file_on_a_disk_that_does_not_say_what_is_there_is_not_lost(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Somebody else finished it while the disk failed: an error is no answer, and it is asked again."""
    left: list[Path] = []
    store = make_store(tmp_path, left)
    failing, part = failed_file(store, tmp_path, monkeypatch)
    failing.error = 0
    recover_segment(part, at=at(8))
    with monkeypatch.context() as patched:
        patched.setattr(os, "stat", refusing(os.stat, part.with_suffix(""), errno.EIO))
        assert not store.try_now(at(9))
    store.try_now(at(10))
    store.finish("stopped", at(10))

    assert [found.sequence for found in open_flight(sorted(tmp_path.glob("*.mcap"))).frames()] == [0, 1]
    assert store.stored == 2


def pictures(count: int) -> list[bytes]:
    """Different ones."""
    return [number.to_bytes(4, "big") + bytes(SIZE - 4) for number in range(count)]


def reasons(daemon: Daemon) -> str:
    """Everything that the flight says about its camera and disk."""
    return "\n".join(entry["reason"] for entry in daemon.messages("/camera/status"))


def assert_all_accounted_for(daemon: Daemon, given: list[bytes], *, dropped: int) -> None:
    """Each picture is in the files once and whole, or counted as dropped."""
    frames = daemon.frames()
    sequences = [frame.sequence for frame in frames]

    assert sequences == sorted(set(sequences))
    assert [frame.encoded for frame in frames] == [given[sequence] for sequence in sequences]
    assert len(given) - len(frames) == dropped


def test_full_disk_makes_room_and_loses_nothing(start_daemon: StartDaemon, disk: Disk) -> None:
    """Three times what the disk holds: the oldest segments go, the marked one stays, the newest are there."""
    (disk.path / "20180504T120000Z_0000.mcap.keep").touch()
    daemon = start_daemon(storage={"directory": str(disk.path), "segment_mib": 1, "keep_hours": 0, "keep_free_gib": 0})
    daemon.feed(*pictures(50))
    outcome = daemon.finish()
    kept = sorted(path.name for path in disk.path.glob("*.mcap"))
    sequences = [frame.sequence for frame in daemon.frames()]

    assert (outcome.stored, outcome.dropped) == (50, 0)
    assert kept[0] == "20180504T120000Z_0000.mcap"
    assert kept[1] > "20180504T120000Z_0010.mcap"
    assert sequences[2:] == list(range(sequences[2], 50))
    assert "No space left" in reasons(daemon)


def test_full_disk_with_nothing_to_delete(start_daemon: StartDaemon, disk: Disk) -> None:
    """The newest pictures wait in memory; when there is room again they are stored, and the others are counted."""
    given = pictures(80)
    ballast = disk.path / "ballast"
    ballast.write_bytes(bytes(6 * 2**20))
    daemon = start_daemon(storage={"directory": str(disk.path), "keep_hours": HUGE_HOURS, "keep_free_gib": 0})
    for jpeg in given[:10]:
        daemon.flood(jpeg)
        eventually(lambda: daemon.events("disk_failed") or not len(daemon.queue))
    daemon.flood(*given[10:])
    disk.grow()
    ballast.unlink()
    eventually(lambda: daemon.events("disk_back") and not len(daemon.queue))
    outcome = daemon.finish()

    assert_all_accounted_for(daemon, given, dropped=outcome.dropped)
    assert daemon.frames()[-1].sequence == 79
    assert 0 < outcome.dropped <= 80 - WAITING
    assert daemon.messages("/recorder/health")[-1]["drops_by_reason"] == {
        "the disk could not be written (No space left on device)": outcome.dropped
    }
    assert "No space left on device" in reasons(daemon)


def test_disk_that_is_pulled_out_and_comes_back(start_daemon: StartDaemon, disk: Disk) -> None:
    """What was synced is on it, what was not is written again: each picture is there once."""
    given = pictures(6)
    (disk.path / "flights").mkdir()
    daemon = start_daemon(storage={"directory": str(disk.path / "flights")})
    daemon.feed(*given[:4])
    disk.pull()
    daemon.clock.advance(2 * 10**9)
    daemon.camera.show(given[4])
    eventually(lambda: daemon.events("disk_failed"))
    disk.plug()
    eventually(lambda: daemon.events("disk_back") and not len(daemon.queue))
    daemon.feed(given[5])
    eventually(lambda: daemon.events("segment_salvaged"))
    outcome = daemon.finish()

    assert "bring the disk back" in daemon.events("disk_failed")[0]["reason"]
    assert_all_accounted_for(daemon, given, dropped=0)
    assert [path.name[-9:] for path in outcome.paths] == ["0001.mcap"]
    assert (disk.path / "flights" / "20180504T120000Z_0000.mcap").exists()
    assert "the disk can be written again" in reasons(daemon)


@pytest.mark.parametrize("number", [errno.EIO, errno.EROFS, errno.ENOSPC])
def test_disk_that_fails_for_a_while(start_daemon: StartDaemon, monkeypatch: pytest.MonkeyPatch, number: int) -> None:
    """In the middle of a segment, with frames on their way: each is stored once, in order, and the chain goes on."""
    failing = FailingDisk(monkeypatch.setattr)
    given = pictures(12)
    daemon = start_daemon()
    daemon.feed(*given[:5])
    failing.error = number
    daemon.flood(*given[5:9])
    eventually(lambda: daemon.events("disk_failed"))
    failing.error = 0
    eventually(lambda: daemon.events("disk_back") and not len(daemon.queue))
    daemon.feed(*given[9:])
    eventually(lambda: daemon.events("segment_salvaged"))
    outcome = daemon.finish()

    (check,) = verify(sorted(daemon.directory.glob("*.mcap")))

    assert outcome.dropped == 0
    assert_all_accounted_for(daemon, given, dropped=0)
    assert [path.suffix for path in sorted(daemon.directory.glob("*.mcap*"))] == [".mcap", ".mcap"]
    assert check.verdict is not Verdict.FAULT


def lacking_memory(monkeypatch: pytest.MonkeyPatch, lacks: Callable[[Any], bool], place: str = "encode_image") -> None:
    """Let no memory be left for some frames or reports, where they are made ready to be written."""
    encode = getattr(writer, place)

    def short_of_memory(what: object, *more: object) -> bytes:
        if lacks(what):
            raise MemoryError
        return bytes(encode(what, *more))

    monkeypatch.setattr(writer, place, short_of_memory)


@pytest.mark.parametrize("place", ["encode_frame", "encode_image"])
def test_memory_that_is_full_for_a_moment_costs_no_picture(
    start_daemon: StartDaemon, monkeypatch: pytest.MonkeyPatch, place: str
) -> None:
    """It is waited for as for a disk; each picture is stored once, in order, and the chain goes on."""
    lacking = [True]
    given = pictures(9)
    daemon = start_daemon()
    daemon.feed(*given[:5])
    lacking_memory(monkeypatch, lambda _frame: bool(lacking and lacking.pop()), place)
    daemon.flood(*given[5:7])
    eventually(lambda: daemon.events("disk_back") and not len(daemon.queue))
    daemon.feed(*given[7:])
    eventually(lambda: daemon.events("segment_salvaged"))
    outcome = daemon.finish()
    (check,) = verify(sorted(daemon.directory.glob("*.mcap")))

    assert (outcome.stored, outcome.dropped) == (9, 0)
    assert_all_accounted_for(daemon, given, dropped=0)
    assert check.verdict is not Verdict.FAULT
    assert "cannot be written (Cannot allocate memory); set smaller pictures" in reasons(daemon)


def test_replay_for_which_no_memory_is_left_is_one_error(configure: Configure, monkeypatch: pytest.MonkeyPatch) -> None:
    """Somebody started it, and sees what it says."""
    lacking_memory(monkeypatch, lambda frame: bool(frame.sequence == 20))
    with pytest.raises(FlightNotWrittenError, match="Cannot allocate memory"):
        record(configure(), host=fixed_host(SimulatedClock(0)), journal=Journal(io.StringIO()))


def test_picture_for_which_there_is_never_enough_memory_is_dropped_and_counted(
    start_daemon: StartDaemon, monkeypatch: pytest.MonkeyPatch
) -> None:
    """After it was tried again; the pictures around it are stored."""
    given = [*pictures(3), bytes(2 * SIZE), *pictures(3)]
    lacking_memory(monkeypatch, lambda frame: len(frame.encoded) > SIZE)
    daemon = start_daemon()
    daemon.flood(*given)
    eventually(lambda: daemon.events("disk_back") and not len(daemon.queue))
    outcome = daemon.finish()

    assert (outcome.stored, outcome.dropped) == (6, 1)
    assert_all_accounted_for(daemon, given, dropped=1)
    assert daemon.events("frames_dropped")[-1]["by_reason"] == {"no memory was left for it": 1}


def test_picture_that_the_writers_thread_has_no_memory_for_is_counted(
    start_daemon: StartDaemon, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Also before it is handed to the disk; the recording goes on."""
    put, given = SegmentStore.put, pictures(3)

    def short_of_memory(store: SegmentStore, what: object, at: ClockReading) -> None:
        if isinstance(what, Frame) and what.encoded == given[1]:
            raise MemoryError
        put(store, what, at)  # type: ignore[arg-type]  # what it gets

    monkeypatch.setattr(SegmentStore, "put", short_of_memory)
    daemon = start_daemon()
    daemon.feed(*given)
    outcome = daemon.finish()

    assert (outcome.stored, outcome.dropped) == (2, 1)
    assert_all_accounted_for(daemon, given, dropped=1)
    assert daemon.events("out_of_memory")


@pytest.mark.filterwarnings("ignore::pytest.PytestUnhandledThreadExceptionWarning")
def test_crash_of_the_writers_thread_says_how_many_pictures_it_cost(
    start_daemon: StartDaemon, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Those that it had begun to write, and those that waited for it."""

    def crash(_frame: Frame) -> bytes:
        raise ZeroDivisionError

    monkeypatch.setattr(writer, "encode_image", crash)
    daemon = start_daemon()
    daemon.camera.show(*pictures(1))
    with pytest.raises(RecorderError, match="writer's thread crashed"):
        daemon.over.result(PATIENCE_S)

    assert daemon.events("recording_failed")[0]["unwritten_frames"] == 1


@pytest.mark.parametrize("seed", range(3))
def test_each_frame_is_there_once_or_counted_whatever_the_memory_fails_for(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, seed: int
) -> None:
    """Beside a disk that fails now and then; only a second failure in a row costs a frame."""
    left: list[Path] = []
    chance = random.Random(seed)  # noqa: S311 - no secrets
    with monkeypatch.context() as patched:
        moody = Moody(patched, random.Random(seed), part=0.05)  # noqa: S311 - no secrets
        for place in ("encode_frame", "encode_image", "encode_status"):
            lacking_memory(patched, lambda _frame: chance.random() < moody.part, place)
        drops = Drops()
        store = make_store(tmp_path, left, drops=drops)
        for number in range(FRAMES):
            while not store.try_now(at(number)):
                pass
            store.put(frame(number, 100_000), at(number))
            store.put(CameraStatus("capturing", str(number)), at(number))
        moody.part = 0.0
        finished(store)
    paths = recovered(tmp_path, left)
    numbers = [frame.sequence for frame in open_flight(paths).frames()]

    assert numbers == sorted(set(numbers))
    assert len(numbers) == store.stored == FRAMES - drops.total
    assert verify(paths)[0].verdict is not Verdict.FAULT


def test_stop_while_the_disk_fails_is_an_error(start_daemon: StartDaemon, monkeypatch: pytest.MonkeyPatch) -> None:
    """It is tried once more; then the run ends with a sentence, and the log counts what was not written."""
    failing = FailingDisk(monkeypatch.setattr)
    daemon = start_daemon()
    daemon.feed(*pictures(2))
    failing.error = errno.EIO
    daemon.flood(*pictures(3))
    eventually(lambda: daemon.events("disk_failed"))

    with pytest.raises(FlightNotWrittenError, match="cannot be written"):
        daemon.finish()
    assert daemon.events("recording_failed")[0]["unwritten_frames"] >= 3


@pytest.mark.slow
def test_replay_that_ends_while_the_disk_fails_waits_for_it(write_config: WriteConfig) -> None:
    """Nobody asked it to stop: what it has read is stored when the disk is back, and that is its end."""
    box = Box(write_config(camera={"pace": "realtime", "rate_hz": 20}), HARMED)
    box.in_work_soon()
    box.order("disk", errno.ENOSPC)
    eventually(lambda: box.events("disk_failed"))
    time.sleep(3)
    assert box.process.poll() is None
    box.order("disk", 0)
    box.process.wait(PATIENCE_S)

    assert [event["stored"] for event in box.events("recording_finished")] == [40]
    box.stop()


def test_disk_that_fails_in_the_last_moment_of_a_replay_is_waited_for(
    start_daemon: StartDaemon, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The end was taken from the queue already; then the last sync fails, and the one after it, too."""
    failing = FailingDisk(monkeypatch.setattr)
    daemon = start_daemon()
    daemon.feed(*pictures(2))
    finish = SegmentStore.finish

    def fail(store: SegmentStore, reason: str, at: ClockReading) -> None:
        failing.error = errno.EIO
        try:
            finish(store, reason, at)
        finally:
            monkeypatch.setattr(SegmentStore, "finish", finish)

    monkeypatch.setattr(SegmentStore, "finish", fail)
    daemon.queue.end(Ended("no more pictures", daemon.clock.read()))
    eventually(lambda: daemon.events("disk_failed"))
    assert not daemon.over.done()
    failing.error = 0
    outcome = daemon.over.result(PATIENCE_S)

    assert (outcome.stored, outcome.reason) == (2, "no more pictures")
    assert [found.sequence for found in daemon.frames()] == [0, 1]


def test_disk_that_hangs_does_not_hold_up_the_end(start_daemon: StartDaemon, monkeypatch: pytest.MonkeyPatch) -> None:
    """When told to stop, the process ends in time, whatever the disk does."""
    monkeypatch.setattr(supervision, "END_S", 0.5)
    failing = FailingDisk(monkeypatch.setattr)
    daemon = start_daemon()
    daemon.feed(*pictures(1))
    failing.released.clear()
    daemon.flood(*pictures(3))
    eventually(lambda: len(daemon.queue) > 0)

    with pytest.raises(RecorderError, match="did not answer in time"):
        daemon.finish()
    failing.released.set()


@pytest.fixture
def start_box(write_config: WriteConfig, pictures: Path) -> Iterator[Callable[..., Box]]:
    """Starts recorders; those still running are killed in the end."""
    boxes: list[Box] = []
    for number in range(40, 2400):
        (pictures / f"{number:04d}.jpg").hardlink_to(pictures / "000.jpg")

    def start(**storage: Any) -> Box:  # noqa: ANN401 - values of recorder.yaml
        camera = {"pace": "realtime", "rate_hz": 20}
        boxes.append(Box(write_config(camera=camera, storage={"keep_free_gib": 0, **storage})))
        return boxes[-1]

    yield start
    for box in boxes:
        box.kill()


def test_directory_that_is_deleted_is_made_again(start_daemon: StartDaemon, tmp_path: Path) -> None:
    """As it was, with a folder for marks; what was in the open file is there, and no picture is lost."""
    given = pictures(6)
    (tmp_path / "flights").mkdir()
    (tmp_path / "flights").chmod(0o2750)
    daemon = start_daemon()
    daemon.feed(*given[:4])
    shutil.rmtree(daemon.directory)
    daemon.clock.advance(2 * 10**9)
    daemon.camera.show(given[4])
    eventually(lambda: daemon.events("disk_back") and not len(daemon.queue))
    daemon.feed(given[5])
    eventually(lambda: daemon.events("segment_salvaged"))
    outcome = daemon.finish()

    assert_all_accounted_for(daemon, given, dropped=0)
    assert outcome.dropped == 0
    assert daemon.directory.stat().st_mode & 0o7777 == 0o2750
    assert (daemon.directory / "marks").is_dir()


def test_directory_of_a_missing_disk_is_not_made(start_daemon: StartDaemon, disk: Disk) -> None:
    """What is recorded would be on another disk, where nobody looks for it, and would fill that."""
    (disk.path / "flights").mkdir()
    daemon = start_daemon(storage={"directory": str(disk.path / "flights")})
    daemon.feed(*pictures(2))
    disk.pull()
    daemon.clock.advance(2 * 10**9)
    daemon.flood(*pictures(1))
    eventually(lambda: daemon.events("disk_failed"))
    with pytest.raises(FlightNotWrittenError, match="bring the disk back"):
        daemon.finish()

    assert list(disk.path.iterdir()) == []


@pytest.mark.parametrize("below", ["", "flights"])
def test_directory_that_a_link_leads_to_is_waited_for(start_daemon: StartDaemon, tmp_path: Path, below: str) -> None:
    """The link may lead to a disk that is not mounted yet; the log says which link it is."""
    link, target = tmp_path / "link", tmp_path / "mounted" / "later"
    link.symlink_to(target)
    daemon = start_daemon(storage={"directory": str(link / below)})
    daemon.flood(*(given := pictures(2)))
    eventually(lambda: daemon.events("disk_failed"))
    target.mkdir(parents=True)
    daemon.clock.advance(60 * 10**9)
    eventually(lambda: daemon.events("disk_back"))
    outcome = daemon.finish()

    assert daemon.events("disk_failed")[0]["reason"].endswith(
        f"cannot be made: {link} leads to nothing that is there; bring the disk it leads to."
    )
    assert_all_accounted_for(daemon, given, dropped=0)
    assert outcome.paths[0].parent.samefile(target / below)


@pytest.mark.slow
@pytest.mark.parametrize("how", TAKEN)
def test_file_in_work_that_is_taken_away_is_brought_back(start_box: Callable[..., Box], how: str) -> None:
    """Within a second or two, under its own name or beside what took it; every picture is there once."""
    box = start_box()
    part = box.in_work_soon()
    take_away(part, how)
    eventually(lambda: box.events("segment_salvaged"))
    eventually(box.in_work)
    box.stop()
    numbers = [frame.sequence for frame in box.frames()]

    assert "was deleted, renamed or replaced" in box.events("disk_failed")[0]["reason"]
    assert box.events("segment_brought_back")[0]["frames"] >= 5
    assert numbers == list(range(len(numbers)))
    assert len(box.finished()) == 2
    assert box.events("recording_finished")[0]["dropped"] == 0
    assert part.exists() == (how == "replace")


@pytest.mark.slow
def test_file_that_is_taken_away_just_before_its_end_is_brought_back(start_box: Callable[..., Box]) -> None:
    """Every file in work, again and again, also within the second between checks; finished ones may disappear."""
    box = start_box(segment_s=1.5)
    deleted = {Path()}

    def delete_what_is_new() -> bool:
        part = box.in_work()
        if part is not None and part > max(deleted):
            part.unlink(missing_ok=True)
            deleted.add(part)
        return len(deleted) > 3

    eventually(delete_what_is_new)
    eventually(lambda: len(box.events("segment_salvaged")) >= 3)
    box.finished()[0].unlink()
    box.stop()
    numbers = [frame.sequence for frame in box.frames()]

    assert numbers == list(range(numbers[0], numbers[-1] + 1))
    assert box.events("recording_finished")[0]["dropped"] == 0


def test_file_that_cannot_be_brought_back_is_counted(
    start_daemon: StartDaemon, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Its pictures were stored, and are not any more: log, drops and health say so, and the recording goes on."""

    def refuse(_file: DurableFile, path: Path) -> None:
        raise FlightNotWrittenError(path, reason="cannot be written (No space left on device)")

    monkeypatch.setattr(DurableFile, "save_as", refuse)
    daemon = start_daemon()
    daemon.feed(*[bytes([number]) * 1000 for number in range(8)])
    (part,) = daemon.directory.glob("*.part")
    part.unlink()
    daemon.clock.advance(2 * 10**9)
    daemon.camera.show(b"9" * 1000)
    eventually(lambda: daemon.events("segment_lost") and not len(daemon.queue))
    outcome = daemon.finish()
    lost = daemon.events("segment_lost")[0]["frames"]
    health = daemon.messages("/recorder/health")[-1]

    assert 0 < lost <= 8
    assert (outcome.stored, outcome.dropped) == (9 - lost, lost)
    assert [frame.sequence for frame in daemon.frames()] == list(range(lost, 9))
    assert health["drops_by_reason"] == {DELETED: lost}
    assert health["stored"] == 9 - lost
