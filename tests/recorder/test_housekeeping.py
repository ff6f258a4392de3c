"""Which segments go and which never do, and what an earlier life left in work is finished."""

from __future__ import annotations

import errno
import io
import json
import os
import resource
import sys
import threading
from collections.abc import Callable, Iterator
from contextlib import ExitStack, suppress
from itertools import chain, repeat
from pathlib import Path
from subprocess import run
from typing import Any

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from benchmarks.recorders import eventually
from camera_drivers.qx10.options import Qx10Settings
from fixtures.recordings import record_flight
from flight_file.errors import FlightNotReadableError, FlightNotWrittenError, NothingToRecoverError
from flight_file.files import DurableFile, claimed
from flight_file.reader import open_flight
from flight_file.records import DamagedRecordError
from flight_file.salvage import recover_segment
from flight_file.session import UNKNOWN_TIME
from flight_file.signature import make_key_files, signature_path
from flight_file.summary import Recorded, recorded
from recorder import housekeeping, marks
from recorder import run as run_module
from recorder.capture import CameraReports, wire
from recorder.config import RecorderConfig
from recorder.frame_queue import Drops, FrameQueue
from recorder.host import SimulatedClock, fixed_host
from recorder.housekeeping import Retention, Rules, Salvager, older_than
from recorder.journal import Journal
from recorder.run import Assembly
from recorder.supervision import Heartbeats
from recorder.thresholds import LOOKS, NAMED_AT_ONCE, READS_AT_ONCE
from tests.programs import write_yaml
from tests.recorder.helpers import Configure, StartDaemon

MIB = 2**20
HOUR_NS = 3600 * 10**9
HOUR = Recorded(HOUR_NS, 3600)


class SmallDisk:
    """A directory of segments of one hour and one MiB each, on a disk of ten MiB."""

    def __init__(self, directory: Path, segments: int, **rules: int | None) -> None:
        self.directory = directory
        self.log = io.StringIO()
        for number in range(segments):
            self.path(number).write_bytes(bytes(MIB))
        wanted = Rules(**{"reserve_bytes": 0, "keep_ns": 0, "longest_ns": HOUR_NS, **rules})  # type: ignore[arg-type]
        self.retention = Retention(directory, wanted, free_bytes=self.free, journal=Journal(self.log), read=self.read)

    def path(self, number: int) -> Path:
        """Of a segment."""
        return self.directory / f"20180504T120000Z_{number:04d}.mcap"

    def free(self, _path: Path) -> int:
        """Room left, bytes."""
        return 10 * MIB - sum(path.stat().st_size for path in self.directory.iterdir())

    def read(self, path: Path) -> Recorded:
        """One hour, of a file."""
        if not path.is_file():
            raise IsADirectoryError(path)
        return HOUR

    def left(self) -> list[int]:
        """Numbers of the segments that are there."""
        return [number for number in range(20) if self.path(number).exists()]


def rules_of(config: RecorderConfig) -> Rules:
    """The rules that a configuration makes."""
    host, drops, nobody = fixed_host(SimulatedClock(0)), Drops(), Journal(io.StringIO())
    queue = FrameQueue()
    reports = CameraReports(queue=queue, drops=drops, heartbeats=Heartbeats(host.clock), clock=host.clock)
    wiring = wire(config, host, reports)
    assembly = Assembly(config=config, host=host, wiring=wiring, journal=nobody, drops=drops, queue=queue, signer=None)
    return assembly.rules()


def test_oldest_go_until_the_reserve_is_free(tmp_path: Path) -> None:
    """No more than needed, and a second time nothing."""
    disk = SmallDisk(tmp_path, 8, reserve_bytes=5 * MIB)

    assert disk.retention.make_room()
    assert disk.left() == [3, 4, 5, 6, 7]
    assert not disk.retention.make_room()
    assert [json.loads(line)["event"] for line in disk.log.getvalue().splitlines()] == ["segment_deleted"] * 3


@pytest.mark.parametrize(
    ("rules", "left", "again"),
    [
        ({"reserve_bytes": 100 * MIB, "keep_ns": 5 * HOUR_NS}, [3, 4, 5, 6, 7], False),
        ({}, [1, 2, 3, 4, 5, 6, 7], True),
        ({"max_ns": 3 * HOUR_NS}, [5, 6, 7], True),
    ],
    ids=["hours that are kept stay", "one goes whatever seems free", "old ones go though there is room"],
)
def test_full_disk_costs_what_the_rules_allow(
    tmp_path: Path, rules: dict[str, int], left: list[int], *, again: bool
) -> None:
    """The system's figure of what is free includes room that we may not use."""
    disk = SmallDisk(tmp_path, 8, **rules)

    assert disk.retention.make_room(disk_is_full=True)
    assert disk.left() == left
    assert disk.retention.make_room(disk_is_full=True) == again


def test_marked_ones_and_strangers_stay_and_signatures_go_along(tmp_path: Path) -> None:
    """A mark lies beside its segment; what has another name than the recorder gives is not the recorder's."""
    disk = SmallDisk(tmp_path, 6, reserve_bytes=100 * MIB)
    (tmp_path / "20180504T120000Z_0001.mcap.keep").touch()
    (tmp_path / "20180504T120000Z_0001.mcap.sig").touch()
    (tmp_path / "20180504T120000Z_0002.mcap.sig").touch()
    (tmp_path / "20180504T120000Z_0003.mcap").unlink()
    (tmp_path / "20180504T120000Z_0003.mcap").mkdir()
    strangers = ["flight_0000.mcap", "20180504T120000Z_0009.mcap.part", "20180504.mcap", "notes.txt"]
    for name in strangers:
        (tmp_path / name).touch()
    disk.retention.make_room()

    assert sorted(path.name for path in tmp_path.iterdir()) == sorted(
        [
            "20180504T120000Z_0001.mcap",
            "20180504T120000Z_0001.mcap.keep",
            "20180504T120000Z_0001.mcap.sig",
            "20180504T120000Z_0003.mcap",
            *strangers,
        ]
    )


def test_what_a_recovery_made_of_a_marked_segment_stays(tmp_path: Path) -> None:
    """The last frames before the power cut are what was marked; a recovered file can have a mark of its own."""
    disk = SmallDisk(tmp_path, 3, reserve_bytes=100 * MIB)
    made = [disk.path(1).name + ".unproven", "20180504T120000Z_0001.recovered.mcap"]
    others = [disk.path(2).name + ".unproven", "20180504T120000Z_0002.recovered.mcap"]
    for name in (*made, *others):
        (tmp_path / name).write_bytes(bytes(MIB))
    marks = [f"{name}.keep" for name in (disk.path(1).name, others[1])]
    for name in marks:
        (tmp_path / name).touch()
    disk.retention.make_room()

    assert {path.name for path in tmp_path.iterdir()} == {disk.path(1).name, *made, others[1], *marks}


def test_newest_hours_of_a_recording_in_work_stay_however_old_its_name(tmp_path: Path) -> None:
    """Of two recorders in one directory the names of the first one's are older than all of the second one's."""
    disk = SmallDisk(tmp_path, 6, reserve_bytes=2**60, keep_ns=2 * HOUR_NS)
    for number in range(4):
        (tmp_path / f"20180504T110000Z_{number:04d}.mcap").touch()
    file = DurableFile(tmp_path / "20180504T110000Z_0004.mcap.part")
    disk.retention.make_room()
    file.close()
    file.path.unlink()
    disk.retention.make_room()
    first = sorted(path.name for path in tmp_path.glob("*T11*.mcap"))
    for _ in range(LOOKS):
        disk.retention.make_room()

    assert first == ["20180504T110000Z_0002.mcap", "20180504T110000Z_0003.mcap"]
    assert disk.left() == [4, 5]
    assert list(tmp_path.glob("*T11*.mcap")) == []


def test_picture_counts_for_the_interval_of_the_camera(tmp_path: Path, configure: Configure) -> None:
    """One a minute is sixty an hour: a camera that was told to be slow has its hours kept, and deleted after them."""
    disk = SmallDisk(tmp_path, 6)
    config = configure(storage={"max_hours": 6, "keep_hours": 1})
    slow = config.model_copy(update={"camera": Qx10Settings(driver="qx10", interval_s=60.0)})
    assert [rules_of(each).picture_ns for each in (config, slow)] == [20 * 10**9, 60 * 10**9]

    rules = Rules(reserve_bytes=0, keep_ns=0, longest_ns=HOUR_NS, max_ns=3 * HOUR_NS, picture_ns=60 * 10**9)
    minutes = Recorded(HOUR_NS, 60)
    Retention(tmp_path, rules, free_bytes=disk.free, journal=Journal(disk.log), read=lambda _: minutes).make_room()

    assert disk.left() == [3, 4, 5]


def test_marks_folder_full_of_strange_things_keeps_nobody_waiting(tmp_path: Path) -> None:
    """Only some are looked at, each time; a mark among them counts all the same."""
    disk, folder = SmallDisk(tmp_path, 3), tmp_path / "marks"
    folder.mkdir()
    for number in range(READS_AT_ONCE + 500):
        (folder / f"{number}").touch()
    (folder / "20180504T120000Z_0000.mcap.keep").touch()
    disk.retention.make_room(disk_is_full=True)
    said = [json.loads(line) for line in disk.log.getvalue().splitlines()]

    assert disk.left() == [0, 2]
    assert said[0]["event"] == "marks_strange"
    assert READS_AT_ONCE - 1 <= said[0]["count"] <= READS_AT_ONCE


@pytest.mark.parametrize("ending", [".part", ".begun"])
def test_link_in_a_circle_that_is_named_like_a_file_in_work_blocks_no_deletion(tmp_path: Path, ending: str) -> None:
    """A recorder's file in work is a file: what a link leads to is not asked for, however it fails."""
    disk, rules = SmallDisk(tmp_path, 4), Rules(reserve_bytes=0, keep_ns=0, longest_ns=HOUR_NS)
    retention = Retention(tmp_path, rules, free_bytes=lambda _path: MIB, journal=Journal(disk.log), read=disk.read)
    loop = tmp_path / f"20180504T120000Z_0009.mcap{ending}"
    loop.symlink_to(loop.name)

    assert retention.make_room(disk_is_full=True)
    assert disk.left() == [1, 2, 3]
    assert loop.is_symlink()


def test_directory_that_is_gone_needs_no_room(tmp_path: Path) -> None:
    """The writer notices it."""
    disk = SmallDisk(tmp_path / "gone", 0)

    assert not disk.retention.make_room(disk_is_full=True)


@pytest.fixture
def undeletable() -> Iterator[Callable[[Path], None]]:
    """Makes a file undeletable, for root too, until the test ends; skips where the file system has no such files."""
    done: list[Path] = []

    def make(path: Path) -> None:
        if run(["chattr", "+i", path], check=False, capture_output=True).returncode:
            pytest.skip("making a file undeletable needs root and a file system that knows it")
        done.append(path)

    yield make
    for path in done:
        run(["chattr", "-i", path], check=True)


@pytest.mark.parametrize("slow", ["unlink", "read"])
def test_slow_disk_is_tidied_bit_by_bit(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, slow: str) -> None:
    """The writer's thread comes back after two seconds, however many segments there are to look at and to delete."""
    disk, clock, unlink = SmallDisk(tmp_path, 8, reserve_bytes=100 * MIB, keep_ns=HOUR_NS), [0.0], Path.unlink
    monkeypatch.setattr(housekeeping, "monotonic", lambda: clock[0])

    def take_a_second(what: str) -> None:
        clock[0] += 1.0 if what == slow else 0.0

    def slowly_unlink(path: Path, *, missing_ok: bool = False) -> None:
        take_a_second("unlink")
        unlink(path, missing_ok=missing_ok)

    def slowly_read(_path: Path) -> Recorded:
        take_a_second("read")
        return HOUR

    monkeypatch.setattr(Path, "unlink", slowly_unlink)
    rules = Rules(reserve_bytes=100 * MIB, keep_ns=HOUR_NS, longest_ns=HOUR_NS)
    retention = Retention(tmp_path, rules, free_bytes=disk.free, journal=Journal(disk.log), read=slowly_read)
    took = list[float]()
    while disk.left() != [7]:
        began = clock[0]
        assert len(took) < 10
        retention.make_room()
        took.append(clock[0] - began)

    assert max(took) <= 3.0
    assert len(took) > 2


def test_segment_that_cannot_be_deleted_is_passed_over(tmp_path: Path, undeletable: Callable[[Path], None]) -> None:
    """The next ones go instead, the log names it once, and it goes as soon as the system lets it go."""
    disk = SmallDisk(tmp_path, 4)
    undeletable(disk.path(0))

    assert [disk.retention.make_room(disk_is_full=True) for _ in range(2)] == [True, True]
    assert disk.left() == [0, 3]
    assert not disk.retention.make_room()
    events = [json.loads(line) for line in disk.log.getvalue().splitlines()]
    assert [line["names"] for line in events if line["event"] == "segments_not_deleted"] == [[disk.path(0).name]]


def test_signature_that_cannot_be_deleted_costs_no_other_segment(tmp_path: Path) -> None:
    """A folder has its name: the segment is gone, which is what was wanted, and the log says what is left."""
    disk = SmallDisk(tmp_path, 4)
    for number in range(4):
        signature_path(disk.path(number)).mkdir()
    assert disk.retention.make_room(disk_is_full=True)

    assert disk.left() == [1, 2, 3]
    events = [json.loads(line) for line in disk.log.getvalue().splitlines()]
    assert [line["event"] for line in events] == ["segment_deleted", "signature_not_deleted"]


@pytest.mark.parametrize(("number", "tries"), [(errno.EROFS, 1), (errno.EIO, 1), (errno.EPERM, 4)])
def test_disk_that_refuses_all_deletions_is_asked_once(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, number: int, tries: int
) -> None:
    """A read-only or failing disk; a refusal that may be of one file is no reason to stop."""
    disk, asked = SmallDisk(tmp_path, 4), list[Path]()

    def refuse(path: Path, *, missing_ok: bool = False) -> None:
        asked.append(path)
        raise OSError(number, os.strerror(number), missing_ok)

    with monkeypatch.context() as patched:
        patched.setattr(Path, "unlink", refuse)
        assert not disk.retention.make_room(disk_is_full=True)
    assert len(asked) == tries


def test_marks_that_are_no_folder_are_said_once(tmp_path: Path) -> None:
    """Also what lies among the marks and is none: whoever reads the log can clear it away."""
    disk = SmallDisk(tmp_path, 1)
    (tmp_path / "marks").symlink_to(".")
    for _ in range(2):
        disk.retention.make_room()
    (tmp_path / "marks").unlink()
    (tmp_path / "marks" / "sub").mkdir(parents=True)
    for _ in range(2):
        disk.retention.make_room()
    said = [json.loads(line) for line in disk.log.getvalue().splitlines()]

    assert [line["event"] for line in said] == ["marks_unusable", "marks_strange"]
    assert (said[0]["reason"], said[1]["names"]) == ("Not a directory", ["sub"])


def test_nothing_is_deleted_while_marks_cannot_be_read(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Too many files are open: that does not mean that nothing is marked. It is said once each time it begins."""
    disk, mark = SmallDisk(tmp_path, 3), tmp_path / "marks" / "20180504T120000Z_0000.mcap.keep"
    mark.parent.mkdir()
    mark.touch()

    def refuse(_path: Path, _flags: int) -> int:
        raise OSError(errno.EMFILE, os.strerror(errno.EMFILE))

    for _ in range(2):
        with monkeypatch.context() as patched:
            patched.setattr(marks.os, "open", refuse)
            assert [disk.retention.make_room(disk_is_full=True) for _ in range(2)] == [False, False]
        assert disk.retention.make_room(disk_is_full=True)

    assert disk.left() == [0]
    said = [json.loads(line) for line in disk.log.getvalue().splitlines()]
    assert [line["event"] for line in said] == [
        "marks_unusable",
        "marks_unknown",
        "segment_deleted",
        "marks_unknown",
        "segment_deleted",
    ]


def test_waiting_without_a_camera_does_not_age_a_flight() -> None:
    """Segments without pictures have no length, so the hours that are kept are hours of flight."""
    spans_ns = dict(zip("abcdefghi", [HOUR_NS] * 3 + [0] * 6, strict=True))

    assert older_than(list(spans_ns), 2 * HOUR_NS, spans_ns.__getitem__) == ["a"]
    assert older_than(list(spans_ns), 3 * HOUR_NS, spans_ns.__getitem__) == ()


def test_small_files_that_claim_to_be_long_age_no_flight(tmp_path: Path) -> None:
    """Planted under the newest names, an hour each with one picture: the hours that are kept stay those of flight."""
    disk = SmallDisk(tmp_path, 3)
    planted = [f"20990101T0{number}0000Z_0000.mcap" for number in range(5)]
    for name in planted:
        (tmp_path / name).touch()

    def read(path: Path) -> Recorded:
        return Recorded(HOUR_NS, 1) if path.name in planted else HOUR

    rules = Rules(reserve_bytes=2**60, keep_ns=2 * HOUR_NS, longest_ns=HOUR_NS)
    retention = Retention(tmp_path, rules, free_bytes=disk.free, journal=Journal(disk.log), read=read)
    retention.make_room()

    assert disk.left() == [1, 2]


@pytest.fixture(scope="module")
def segment(tmp_path_factory: pytest.TempPathFactory, forty_pictures: Path) -> bytes:
    """A finished segment of forty pictures, 9.75 s long."""
    target = tmp_path_factory.mktemp("flights") / "flight.mcap"
    record_flight(sorted(forty_pictures.iterdir()), None, target)
    return target.read_bytes()


@pytest.mark.parametrize("cut", [0, 1, 8, 36, 37, 40, 300, 2000])
def test_length_is_read_from_the_statistics_of_a_whole_segment(segment: bytes, tmp_path: Path, cut: int) -> None:
    """Of log times, which no wall clock moves; wherever its end is missing, a segment has none."""
    (tmp_path / "x.mcap").write_bytes(segment[: len(segment) - cut])

    if cut:
        with pytest.raises(DamagedRecordError):
            recorded(tmp_path / "x.mcap")
    else:
        assert recorded(tmp_path / "x.mcap") == Recorded(9_750_000_000, 40)


@settings(max_examples=50, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(data=st.data())
def test_damaged_end_is_a_length_or_refused(data: st.DataObject, segment: bytes, tmp_path: Path) -> None:
    """Whatever the bytes of the summary are, nothing but a number or this error comes out of it."""
    path, content = tmp_path / "damaged.mcap", segment
    changed = bytearray(content)
    for _ in range(data.draw(st.integers(1, 4))):
        at = data.draw(st.integers(len(content) - 700, len(content) - 1))
        piece = data.draw(st.binary(min_size=1, max_size=9) | st.just(b"\xff" * 8))
        changed[at : at + len(piece)] = piece
    path.write_bytes(bytes(changed))
    with suppress(DamagedRecordError):
        assert recorded(path).span_ns >= 0


def odd_files(directory: Path, segment: bytes) -> list[str]:
    """Fills a directory with what has the name of a segment and is none; gives the names."""
    names = [f"20180504T110000Z_{number:04d}.mcap" for number in range(8)]
    fifo, folder, zero, loop, short, counts, long, backwards = (directory / name for name in names)
    os.mkfifo(fifo)
    folder.mkdir()
    zero.symlink_to("/dev/zero")
    loop.symlink_to(loop)
    short.write_bytes(segment[:-1])
    statistics_at = segment.rindex(b"\x0b" + (46 + 4 * 10).to_bytes(8, "little")) + 9
    times_at = statistics_at + 26
    counts.write_bytes(segment[: times_at + 16] + b"\xff" * 4 + segment[times_at + 20 :])
    long.write_bytes(segment[:times_at] + bytes(8) + b"\xff" * 7 + b"\x7f" + segment[times_at + 16 :])
    backwards.write_bytes(segment[: times_at + 8] + bytes(8) + segment[times_at + 16 :])
    return names


def test_what_cannot_be_read_is_kept_named_once_and_counts_no_hours(segment: bytes, tmp_path: Path) -> None:
    """FIFOs, folders, links, a cut file, a huge count, an enormous span, an end before the beginning."""
    odd = odd_files(tmp_path, segment)
    own = [f"20180504T12000{number}Z_0000.mcap" for number in range(5)]
    for name in own:
        (tmp_path / name).write_bytes(segment)
    # As a planted file it is the newest: its span would make all others look old.
    (tmp_path / odd[6]).rename(tmp_path / "99991231T235959Z_99999999999999999999999.mcap")
    odd[6] = "99991231T235959Z_99999999999999999999999.mcap"
    log = io.StringIO()
    rules = Rules(reserve_bytes=2**60, keep_ns=20 * 10**9, longest_ns=HOUR_NS)
    retention = Retention(tmp_path, rules, free_bytes=lambda _path: 0, journal=Journal(log))

    assert retention.make_room()
    assert not retention.make_room()
    (said,) = [line for line in map(json.loads, log.getvalue().splitlines()) if line["event"] == "segments_unreadable"]
    assert said["names"] == sorted(odd)
    assert (said["count"], retention.unreadable) == (8, 8)
    assert sorted(path.name for path in tmp_path.iterdir()) == sorted([*odd, *own[2:]])


def test_segments_that_are_very_many_are_looked_at_bit_by_bit(tmp_path: Path) -> None:
    """So that the writer's thread is never long away; the log names some and counts all."""
    names = [f"20180504T110000Z_{number:05d}.mcap" for number in range(READS_AT_ONCE + 500)]
    for name in names:
        (tmp_path / name).touch()
    (tmp_path / "20180504T100000Z_0000.mcap").touch()
    reads, log = list[Path](), io.StringIO()

    def read(path: Path) -> Recorded:
        reads.append(path)
        if path.name in names:
            raise DamagedRecordError("nothing")
        return HOUR

    rules = Rules(reserve_bytes=1, keep_ns=0, longest_ns=HOUR_NS)
    retention = Retention(tmp_path, rules, free_bytes=lambda _path: 0, journal=Journal(log), read=read)
    retention.make_room()
    first = len(reads)
    retention.make_room()
    said = [line for line in map(json.loads, log.getvalue().splitlines()) if line["event"] == "segments_unreadable"]

    assert (first, len(reads)) == (READS_AT_ONCE, len(names) + 1)
    assert sum(line["count"] for line in said) == retention.unreadable == len(names)
    assert max(len(line["names"]) for line in said) == NAMED_AT_ONCE
    assert not (tmp_path / "20180504T100000Z_0000.mcap").exists()


def leave_in_work(start_daemon: StartDaemon) -> tuple[Path, list[bytes]]:
    """A recording of which the power was cut: its last file lacks its end."""
    given = [bytes([number]) * 100_000 for number in range(5)]
    daemon = start_daemon()
    daemon.feed(*given)
    (finished,) = daemon.finish().paths
    part = finished.with_name(finished.name + ".part")
    part.write_bytes(finished.read_bytes()[:-3000])
    finished.unlink()
    return part, given


def test_segment_of_yesterday_is_finished(start_daemon: StartDaemon) -> None:
    """With all its pictures, beside the new recording, which has a name of its own."""
    part, given = leave_in_work(start_daemon)
    daemon = start_daemon()
    daemon.feed(b"new")
    eventually(lambda: daemon.events("segment_salvaged"))
    outcome = daemon.finish()

    assert not part.exists()
    assert [frame.encoded for frame in open_flight([part.with_suffix("")]).frames()] == given
    assert [frame.encoded for frame in open_flight(outcome.paths).frames()] == [b"new"]


def test_segment_that_had_only_been_begun_is_removed(start_daemon: StartDaemon) -> None:
    """It has no picture yet; one that another recorder is writing at this moment stays, and what is no segment's."""
    names = ["20180504T120000Z_0000.mcap.begun", "20180504T120000Z_0001.mcap.begun", "notes.begun"]
    with ExitStack() as stack:
        daemon = start_daemon()
        daemon.feed(b"old")
        daemon.finish()
        for name in names:
            (daemon.directory / name).write_bytes(b"")
        stack.enter_context(claimed(daemon.directory / names[1]))
        daemon = start_daemon()
        daemon.feed(b"new")
        daemon.finish()

    assert sorted(path.name for path in daemon.directory.glob("*.begun")) == names[1:]


def test_what_a_killed_recovery_left_takes_no_room_for_ever(start_daemon: StartDaemon) -> None:
    """Its file may have been deleted in its turn since; what is being recovered now stays, and a stranger's file."""
    names = [
        "20180504T120000Z_0000.mcap.recovering",
        "20180504T120000Z_0001.mcap.unproven.recovering-2",
        "20180504T120000Z_0002.recovered.mcap.recovering",
        "notes.recovering",
    ]
    daemon = start_daemon()
    daemon.feed(b"old")
    daemon.finish()
    for name in names:
        (daemon.directory / name).write_bytes(bytes(100))
    with claimed(daemon.directory / names[2]):
        daemon = start_daemon()
        daemon.feed(b"new")
        daemon.finish()

    assert sorted(path.name for path in daemon.directory.glob("*.recovering*")) == names[2:]


def test_signature_that_a_kill_cut_short_takes_no_room_for_ever(pictures: Path, tmp_path: Path) -> None:
    """The recorder was killed while it signed, and its file was renamed since; a file of a stranger stays."""
    flights = tmp_path / "flights"
    document = {
        "camera": {"driver": "replay", "path": str(pictures), "rate_hz": 4, "pace": "fastest"},
        "storage": {"directory": str(flights)},
        "evidence": {"key": "recorder.key"},
    }
    write_yaml(tmp_path / "recorder.yaml", document)
    make_key_files(tmp_path / "recorder.key")
    die = "import os, pathlib; pathlib.Path.replace = lambda *_: os.kill(os.getpid(), 9); "
    words = ["run", "--config", str(tmp_path / "recorder.yaml")]
    run([sys.executable, "-c", f"{die} from recorder.cli import main; main({words})"], check=False, capture_output=True)
    left = sorted(path.name for path in flights.iterdir())
    (flights / left[0]).rename(flights / "20180504T120000Z_0001.mcap")  # so that the next recording has another name
    (flights / "notes.sig.new").touch()
    again = run([sys.executable, "-c", f"from recorder.cli import main; main({words})"], check=True)

    assert left == ["20180504T120000Z_0000.mcap.part", "20180504T120000Z_0000.mcap.sig.new"]
    assert again.returncode == 0
    assert [path.name for path in flights.glob("*.sig.new*")] == ["notes.sig.new"]


def test_file_in_work_that_waits_for_room_goes_in_its_turn(tmp_path: Path, segment: bytes) -> None:
    """By its age and its hours like a finished one, but not if it is marked, in work, or does not wait."""
    disk, waiting = SmallDisk(tmp_path, 0), dict[str, Recorded]()
    names = [f"20180504T12000{number}Z_0000.mcap.part" for number in range(6)]
    for name in names:
        (tmp_path / name).write_bytes(segment[:-3000])
    (tmp_path / "20180504T120001Z_0000.mcap.keep").touch()
    log = io.StringIO()
    salvager = Salvager(str, free_bytes=lambda _path: 0, journal=Journal(log), waiting=waiting)
    salvager.start()
    for name in names[:3] + names[4:]:
        salvager.submit(tmp_path / name)
    eventually(lambda: len(waiting) == 5)
    assert set(waiting.values()) == {Recorded(9_250_000_000, 40)}  # up to the last chunk

    rules = Rules(reserve_bytes=2**60, keep_ns=15 * 10**9, longest_ns=HOUR_NS)
    retention = Retention(tmp_path, rules, free_bytes=disk.free, journal=Journal(log), waiting=waiting)
    with claimed(tmp_path / names[2]):
        retention.make_room()

    assert sorted(tmp_path.glob("*.part")) == [tmp_path / name for name in names[1:]]
    assert names[0] not in waiting
    (tmp_path / names[1].replace("part", "keep")).unlink()
    assert retention.make_room()
    assert sorted(tmp_path.glob("*.part")) == [tmp_path / name for name in names[3:]]


def test_recording_does_not_wait_for_the_salvage(start_daemon: StartDaemon, monkeypatch: pytest.MonkeyPatch) -> None:
    """The first frame is on the disk while an old segment is still being read."""
    leave_in_work(start_daemon)
    begun, released = threading.Event(), threading.Event()
    recover = run_module.recover_segment

    def slow_recover(path: Path, **arguments: Any) -> Any:  # noqa: ANN401 - as the real one
        begun.set()
        released.wait(120)
        return recover(path, **arguments)

    monkeypatch.setattr(run_module, "recover_segment", slow_recover)
    daemon = start_daemon()
    daemon.feed(b"1", b"2", b"3", b"4")
    eventually(begun.is_set)
    stored = [path for path in daemon.directory.glob("*.part") if b"frame" in path.read_bytes()]
    released.set()
    eventually(lambda: daemon.events("segment_salvaged"))

    assert len(stored) == 2
    daemon.finish()


def test_what_cannot_be_salvaged_is_said_and_tried_again_when_there_is_room(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """No room, nothing in it, or gone: one line each, and the next one is tried."""
    monkeypatch.setattr(housekeeping, "SALVAGE_AGAIN_S", 0.01)
    names = ["R_0000.mcap.part", "R_0001.mcap.part", "R_0002.mcap.part"]
    for name in names[:2]:
        (tmp_path / name).write_bytes(bytes(100))
    free = chain([150], repeat(10**9))
    log, recovered = io.StringIO(), list[Path]()

    def recover(path: Path) -> str:
        if path.name == names[0]:
            recovered.append(path)
            return "recovered"
        raise NothingToRecoverError(path, reason="nothing that was recorded is left in it; delete it")

    waiting: dict[str, Recorded] = {}
    salvager = Salvager(recover, free_bytes=lambda _path: next(free), journal=Journal(log), waiting=waiting)
    salvager.start()
    for name in names:
        salvager.submit(tmp_path / name)
    eventually(lambda: recovered and log.getvalue().count("\n") >= 3)
    lines = map(json.loads, log.getvalue().splitlines())
    reasons = [line["reason"] for line in lines if "reason" in line]

    assert reasons[0] == "there is no room for it now"
    assert "nothing that was recorded" in reasons[1]
    assert reasons[2] == "No such file or directory"


def test_file_that_fills_the_memory_is_named_when_it_takes_none_any_more(tmp_path: Path) -> None:
    """The log needs memory, too: while the failure is handled, what filled it is still held; the next one is tried."""
    handled, log = list[object](), io.StringIO()

    class Stream(io.StringIO):
        def write(self, text: str) -> int:
            handled.append(sys.exc_info()[0])
            return log.write(text)

    def recover(path: Path) -> str:
        if path.name == "R_0000.mcap.part":
            raise MemoryError
        return "recovered"

    salvager = Salvager(recover, free_bytes=lambda _path: None, journal=Journal(Stream()), waiting={})
    salvager.start()
    for number in range(2):
        salvager.submit(tmp_path / f"R_000{number}.mcap.part")
    eventually(lambda: "segment_salvaged" in log.getvalue())

    assert "larger than the memory" in log.getvalue()
    assert set(handled) == {None}


@pytest.mark.parametrize("number", [errno.EDQUOT, errno.ENOSPC])
def test_file_that_a_quota_leaves_no_room_for_is_salvaged_later(
    tmp_path: Path, segment: bytes, monkeypatch: pytest.MonkeyPatch, number: int
) -> None:
    """Though the disk says that it has room; until then it is known to wait, so that it ages like any other."""
    monkeypatch.setattr(housekeeping, "SALVAGE_AGAIN_S", 0.01)
    part = tmp_path / "20180504T120000Z_0000.mcap.part"
    part.write_bytes(segment[:-100])
    refused, waited = [1, 2], list[bool]()
    log, waiting = io.StringIO(), dict[str, Recorded]()

    def recover(path: Path) -> str:
        waited.append(path.name in waiting)
        if refused:
            refused.pop()
            reason = "cannot be written"
            raise FlightNotWrittenError(path, reason=reason) from OSError(number, os.strerror(number))
        return "recovered"

    salvager = Salvager(recover, free_bytes=lambda _path: 10**9, journal=Journal(log), waiting=waiting)
    salvager.start()
    salvager.submit(part)
    eventually(lambda: "segment_salvaged" in log.getvalue())

    assert waited == [False, True, True]
    assert log.getvalue().count("there is no room for it now") == 2
    assert waiting == {}


@pytest.mark.parametrize("number", [errno.EIO, errno.EROFS])
@pytest.mark.parametrize("kind", [FlightNotReadableError, FlightNotWrittenError])
def test_file_on_a_disk_that_fails_for_a_while_is_salvaged_later(
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    number: int,
    kind: type[FlightNotReadableError | FlightNotWrittenError],
) -> None:
    """Not only at the next start, which may be at the end of the flight."""
    monkeypatch.setattr(housekeeping, "SALVAGE_AGAIN_S", 0.01)
    part, failing, log = tmp_path / "R_0000.mcap.part", [1, 2], io.StringIO()
    part.write_bytes(bytes(100))

    def recover(path: Path) -> str:
        if failing:
            failing.pop()
            raise kind(path, reason=os.strerror(number)) from OSError(number, os.strerror(number))
        return "recovered"

    salvager = Salvager(recover, free_bytes=lambda _path: 10**9, journal=Journal(log), waiting={})
    salvager.start()
    salvager.submit(part)
    eventually(lambda: "segment_salvaged" in log.getvalue())

    assert log.getvalue().count(os.strerror(number)) == 2


def test_file_is_salvaged_when_the_system_can_open_files_again(
    tmp_path: Path, segment: bytes, monkeypatch: pytest.MonkeyPatch
) -> None:
    """None can be opened for a while; then it is recovered as if nothing had been."""
    monkeypatch.setattr(housekeeping, "SALVAGE_AGAIN_S", 0.01)
    part, log = tmp_path / "20180504T120000Z_0000.mcap.part", io.StringIO()
    part.write_bytes(segment[:-100])

    def recover(path: Path) -> str:
        return recover_segment(path, at=UNKNOWN_TIME).outcome.value

    salvager = Salvager(recover, free_bytes=lambda _path: 10**9, journal=Journal(log), waiting={})
    limits = resource.getrlimit(resource.RLIMIT_NOFILE)
    resource.setrlimit(resource.RLIMIT_NOFILE, (3, limits[1]))
    try:
        salvager.start()
        salvager.submit(part)
        eventually(lambda: "Too many open files" in log.getvalue())
    finally:
        resource.setrlimit(resource.RLIMIT_NOFILE, limits)
    eventually(lambda: "segment_salvaged" in log.getvalue())

    assert sorted(path.name for path in tmp_path.iterdir()) == ["20180504T120000Z_0000.mcap"]


def test_disk_that_does_not_say_what_is_there_ends_no_salvage(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A file that waits for room on a failing disk is named in the log, the next one is tried, and then it again."""
    monkeypatch.setattr(housekeeping, "SALVAGE_AGAIN_S", 0.01)
    log = io.StringIO()
    waits, next_one = tmp_path / "R_0000.mcap.part", tmp_path / "R_0001.mcap.part"
    for path in (waits, next_one):
        path.write_bytes(bytes(100))
    stat, free = Path.stat, [0]

    def fail(path: Path, **options: bool) -> os.stat_result:
        if path == waits and free != [0] and "_0001" not in log.getvalue():
            raise OSError(errno.EIO, os.strerror(errno.EIO))
        return stat(path, **options)

    monkeypatch.setattr(Path, "stat", fail)
    salvager = Salvager(lambda _path: "recovered", free_bytes=lambda _path: free[0], journal=Journal(log), waiting={})
    salvager.start()
    salvager.submit(waits)
    eventually(lambda: "there is no room" in log.getvalue())
    free[0] = 10**9
    eventually(lambda: "Input/output error" in log.getvalue())
    salvager.submit(next_one)
    eventually(lambda: log.getvalue().count("segment_salvaged") == 2)
