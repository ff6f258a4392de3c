"""A disk that is full, read-only, pulled out, failing or hanging: the recorder goes on, and says what was lost."""

from __future__ import annotations

import errno
import threading
from collections.abc import Callable
from typing import Any

import pytest

from flight_file.durable_file import DurableFile
from flight_file.errors import FlightNotWrittenError
from flight_file.verification import Verdict, verify
from recorder import supervision
from recorder.errors import RecorderError
from recorder.frame_queue import QUEUE_BYTES

Daemon = Any  # of the conftest
StartDaemon = Callable[..., Daemon]
Eventually = Callable[[Callable[[], object]], None]

SIZE = 500_000
WAITING = QUEUE_BYTES // SIZE  # pictures that have room in the queue
HUGE_HOURS = 1000


def pictures(count: int, first: int = 0) -> list[bytes]:
    """Different ones."""
    return [number.to_bytes(4, "big") + bytes(SIZE - 4) for number in range(first, first + count)]


def reasons(daemon: Daemon) -> str:
    """Everything that the flight says about its camera and disk."""
    return "\n".join(entry["reason"] for entry in daemon.messages("/camera/status"))


def assert_all_accounted_for(daemon: Daemon, given: list[bytes], *, dropped: int) -> None:
    """Each picture is in the files once and whole, or counted as dropped."""
    frames = daemon.frames()
    sequences = [frame.sequence for frame in frames]

    assert sequences == sorted(set(sequences))
    assert [frame.jpeg for frame in frames] == [given[sequence] for sequence in sequences]
    assert len(given) - len(frames) == dropped


def test_full_disk_makes_room_and_loses_nothing(start_daemon: StartDaemon, disk: Any) -> None:  # noqa: ANN401
    """Three times what the disk holds: the oldest segments go, the marked one stays, the newest are there."""
    given = pictures(50)
    mark = disk.path / "20180504T120000Z_0000.mcap.keep"
    mark.touch()
    stranger = disk.path / "holiday_0000.mcap"
    stranger.touch()
    storage = {"directory": str(disk.path), "segment_mib": 1, "keep_hours": 0, "keep_free_gib": 0}
    daemon = start_daemon(storage=storage)
    daemon.feed(*given)
    outcome = daemon.finish()
    stranger.unlink()
    kept = sorted(path.name for path in disk.path.glob("*.mcap"))
    sequences = [frame.sequence for frame in daemon.frames()]

    assert (outcome.stored, outcome.dropped) == (50, 0)
    assert kept[0] == "20180504T120000Z_0000.mcap"
    assert kept[1] > "20180504T120000Z_0010.mcap"
    assert sequences[2:] == list(range(sequences[2], 50))
    assert "No space left" in reasons(daemon)


def test_full_disk_with_nothing_to_delete(start_daemon: StartDaemon, disk: Any, eventually: Eventually) -> None:  # noqa: ANN401
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


def test_read_only_disk(start_daemon: StartDaemon, disk: Any, eventually: Eventually) -> None:  # noqa: ANN401
    """From the start: the recorder runs, says so, and records as soon as it can."""
    disk.remount("ro")
    given = pictures(3)
    daemon = start_daemon(storage={"directory": str(disk.path)})
    daemon.flood(*given)
    eventually(lambda: daemon.events("disk_failed"))
    disk.remount("rw")
    eventually(lambda: daemon.events("disk_back") and not len(daemon.queue))
    outcome = daemon.finish()

    assert "Read-only file system" in daemon.events("disk_failed")[0]["reason"]
    assert_all_accounted_for(daemon, given, dropped=outcome.dropped)
    assert outcome.dropped == 0


def test_disk_that_is_pulled_out_and_comes_back(start_daemon: StartDaemon, disk: Any, eventually: Eventually) -> None:  # noqa: ANN401
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


class FailingDisk:
    """What the kernel answers to a write or sync of a large file, while it fails."""

    def __init__(self, monkeypatch: pytest.MonkeyPatch) -> None:
        self.error = 0
        self.released = threading.Event()
        self.released.set()
        write, sync = DurableFile.write, DurableFile.sync

        def failing_write(file: DurableFile, data: bytes) -> int:
            self._fail(file)
            return write(file, data)

        def failing_sync(file: DurableFile) -> None:
            self._fail(file)
            sync(file)

        monkeypatch.setattr(DurableFile, "write", failing_write)
        monkeypatch.setattr(DurableFile, "sync", failing_sync)

    def _fail(self, file: DurableFile) -> None:
        self.released.wait(120)
        if self.error:
            cause = OSError(self.error, errno.errorcode[self.error])
            raise FlightNotWrittenError(file.path, reason="cannot be written") from cause


@pytest.mark.parametrize("number", [errno.EIO, errno.EROFS, errno.ENOSPC, errno.ENODEV])
def test_disk_that_fails_for_a_while(
    start_daemon: StartDaemon, monkeypatch: pytest.MonkeyPatch, eventually: Eventually, number: int
) -> None:
    """In the middle of a segment, with frames on their way: each is stored once, in order, and the chain goes on."""
    failing = FailingDisk(monkeypatch)
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

    (check,) = verify(sorted(daemon.directory.iterdir()))

    assert outcome.dropped == 0
    assert_all_accounted_for(daemon, given, dropped=0)
    assert [path.suffix for path in sorted(daemon.directory.iterdir())] == [".mcap", ".mcap"]
    assert check.verdict is not Verdict.FAULT


def test_stop_while_the_disk_fails_is_an_error(
    start_daemon: StartDaemon, monkeypatch: pytest.MonkeyPatch, eventually: Eventually
) -> None:
    """It is tried once more; then the run ends with a sentence, and the log counts what was not written."""
    failing = FailingDisk(monkeypatch)
    daemon = start_daemon()
    daemon.feed(*pictures(2))
    failing.error = errno.EIO
    daemon.flood(*pictures(3))
    eventually(lambda: daemon.events("disk_failed"))

    with pytest.raises(FlightNotWrittenError, match="cannot be written"):
        daemon.finish()
    assert daemon.events("recording_failed")[0]["unwritten_frames"] >= 3


def test_disk_that_hangs_does_not_hold_up_the_end(
    start_daemon: StartDaemon, monkeypatch: pytest.MonkeyPatch, eventually: Eventually
) -> None:
    """When told to stop, the process ends in time, whatever the disk does."""
    monkeypatch.setattr(supervision, "END_S", 1.0)
    failing = FailingDisk(monkeypatch)
    daemon = start_daemon()
    daemon.feed(*pictures(1))
    failing.released.clear()
    daemon.flood(*pictures(3))
    eventually(lambda: len(daemon.queue) > 0)

    with pytest.raises(RecorderError, match="did not answer in time"):
        daemon.finish()
    failing.released.set()
