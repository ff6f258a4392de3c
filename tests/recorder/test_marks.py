"""A mark keeps the segment that was just recorded, and the one before, while the recorder runs."""

from __future__ import annotations

import errno
import os
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path

import pytest

from benchmarks.harm import Disk
from flight_file.flight_writer import FlightWriter, Plan
from flight_file.frame import CameraStatus, ClockReading
from flight_file.session import Session
from flight_file.untrusted import regular_names
from recorder.errors import NothingToMarkError, NotMarkedError
from recorder.marks import Marks, Tidied, is_marked, make_marks_folder, mark_newest, tidy_marks

NOON_NS = 1_525_435_200_000_000_000


def at(seconds: int) -> ClockReading:
    """So long after noon."""
    return ClockReading(NOON_NS + seconds * 10**9, seconds * 10**9)


@pytest.fixture
def writer(tmp_path: Path) -> Iterator[FlightWriter]:
    """A recording in its third segment."""
    writer = FlightWriter(
        Plan(tmp_path, Session("R"), {}, segment_ns=10**9), status=CameraStatus("connected"), at=at(0)
    )
    assert mark(tmp_path) == ["R_0000.mcap.part"]  # there is none before it
    (tmp_path / "marks" / "R_0000.mcap.keep").unlink()
    writer.make_room(at(1))
    writer.make_room(at(2))
    yield writer
    writer.abandon()


def mark(directory: Path, note: str = "") -> list[str]:
    """The names of the segments that are marked now."""
    return [path.name for path in mark_newest(directory, note=note, realtime_ns=NOON_NS)]


def marked(directory: Path) -> list[str]:
    """The segments that are marked."""
    return sorted(path.name for path in directory.glob("*.mcap*") if path.suffix != ".keep" and is_marked(path))


def kept(directory: Path) -> set[str]:
    """Which of some names the retention takes for marked."""
    with Marks(directory, {path.name for path in directory.iterdir()}) as marks:
        return {name for letter in "RZ" for number in range(4) if marks.keep(name := f"{letter}_000{number}.mcap")}


def test_segment_in_work_and_the_one_before_are_kept(tmp_path: Path, writer: FlightWriter) -> None:
    """Although another file is newer: what is being written is what happens now. The mark outlives the renaming."""
    (tmp_path / "Z_0000.mcap").touch()
    found = mark(tmp_path, "bird  strike\n")

    assert found == ["R_0001.mcap", "R_0002.mcap.part"]
    assert marked(tmp_path) == ["R_0001.mcap", "R_0002.mcap.part"]
    mark(tmp_path, "again")
    assert (tmp_path / "marks" / "R_0002.mcap.keep").read_text() == (
        "2018-05-04T12:00:00Z bird strike\n2018-05-04T12:00:00Z again\n"
    )
    writer.finish("stopped", at(3))
    (tmp_path / "R_0002.mcap.unproven").touch()
    assert marked(tmp_path) == ["R_0001.mcap", "R_0002.mcap", "R_0002.mcap.unproven"]


def test_without_a_recorder_the_newest_is_kept(tmp_path: Path, writer: FlightWriter) -> None:
    """The segment written last, and the one before; for the first segment of another recording that is the last."""
    writer.finish("stopped", at(3))
    for number in range(3):
        os.utime(tmp_path / f"R_000{number}.mcap", ns=(NOON_NS, NOON_NS + number))

    assert mark(tmp_path) == ["R_0001.mcap", "R_0002.mcap"]
    second = FlightWriter(Plan(tmp_path, Session("A"), {}), status=CameraStatus("connected"), at=at(4))
    assert mark(tmp_path) == ["R_0002.mcap", "A_0000.mcap.part"]
    second.abandon()


def test_nothing_to_mark_is_one_sentence(tmp_path: Path) -> None:
    """An empty directory, and none at all."""
    (tmp_path / "notes.txt").touch()
    with pytest.raises(NothingToMarkError, match=r"no recording in it.*\.$"):
        mark(tmp_path)
    with pytest.raises(
        NotMarkedError, match=r"/none: cannot be listed \(No such file.*give the recorder's directory.*\.$"
    ):
        mark(tmp_path / "none")


def test_segment_that_ends_while_it_is_looked_for_is_marked(
    tmp_path: Path, writer: FlightWriter, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Among many files the look takes seconds: the segment in work has another name by then, and a next one follows."""
    seconds = iter((3, 4))

    def listed(directory: Path) -> list[str]:
        names = regular_names(directory)
        for second in seconds:
            writer.make_room(at(second))
        return names

    monkeypatch.setattr("recorder.marks.regular_names", listed)
    assert mark(tmp_path, "bird strike") == ["R_0003.mcap", "R_0004.mcap.part"]


@pytest.mark.usefixtures("writer")
def test_mark_of_an_older_recorder_counts(tmp_path: Path) -> None:
    """It lies beside the segment."""
    (tmp_path / "R_0000.mcap.keep").touch()

    assert marked(tmp_path) == ["R_0000.mcap"]
    assert kept(tmp_path) == {"R_0000.mcap"}


@pytest.mark.usefixtures("writer")
def test_marks_folder_lets_the_group_add_and_nobody_take_away(tmp_path: Path) -> None:
    """Sticky, and writable for the group whatever the umask; so is each mark."""
    mark(tmp_path)

    assert (tmp_path / "marks").stat().st_mode & 0o7777 == 0o1770
    assert (tmp_path / "marks" / "R_0002.mcap.keep").stat().st_mode & 0o777 == 0o660


@pytest.mark.usefixtures("writer")
def test_whatever_lies_among_the_marks_keeps_a_segment_and_does_no_more(tmp_path: Path) -> None:
    """A link to a file of somebody's, a pipe, a folder, a file as large as the disk: nothing is followed or read."""
    make_marks_folder(tmp_path)
    victim = tmp_path / "victim"
    victim.write_text("mine")
    (tmp_path / "marks" / "R_0000.mcap.keep").symlink_to(victim)
    (tmp_path / "marks" / "R_0001.mcap.keep").mkdir()
    os.mkfifo(tmp_path / "marks" / "R_0002.mcap.keep")
    with (tmp_path / "marks" / "Z_0000.mcap.keep").open("wb") as huge:
        huge.truncate(2**40)
    with pytest.raises(NotMarkedError, match=r"\.$"):
        mark(tmp_path, "x")

    assert kept(tmp_path) == {"R_0000.mcap", "R_0001.mcap", "R_0002.mcap", "Z_0000.mcap"}
    with Marks(tmp_path, set()) as marks:
        assert not marks.keep("Y_" + "0" * 248 + ".mcap")  # no mark can have a name as long
    assert [path.name for path in tidy_marks(tmp_path).emptied] == ["Z_0000.mcap.keep"]
    assert (tmp_path / "marks" / "Z_0000.mcap.keep").stat().st_size == 0
    assert victim.read_text() == "mine"
    assert tidy_marks(tmp_path) == Tidied()


@pytest.mark.parametrize("target", [".", "elsewhere"])
@pytest.mark.usefixtures("writer")
def test_link_in_place_of_the_folder_leads_nowhere(tmp_path: Path, target: str) -> None:
    """To the recordings or to somebody's folder: nothing there is emptied, marked or counted."""
    (tmp_path / "marks").rmdir()
    (tmp_path / "marks").symlink_to(target)
    (tmp_path / "elsewhere").mkdir()
    large = [tmp_path / "R_0000.mcap", tmp_path / "elsewhere" / "film.tif", tmp_path / "elsewhere" / "R_0001.mcap.keep"]
    for path in large:
        path.write_bytes(bytes(100_000))
    with pytest.raises(NotMarkedError, match=r"or remove `marks` if it is no folder\.$"):
        mark(tmp_path)

    assert tidy_marks(tmp_path) == Tidied(unusable="Not a directory")
    assert [path.stat().st_size for path in large] == [100_000] * 3
    assert marked(tmp_path) == []
    assert kept(tmp_path) == set()


def test_what_is_no_mark_is_left_as_it_is_and_named(tmp_path: Path) -> None:
    """A folder of this name may have been somebody's: only a segment's mark is ever emptied."""
    strange = ["film.tif", "notes.keep", "sub"]
    (tmp_path / "marks" / "sub").mkdir(parents=True)
    for name in ("film.tif", "notes.keep", "sub/R_0000.mcap.keep", "R_0000.mcap.keep"):
        (tmp_path / "marks" / name).write_bytes(bytes(100_000))
    tidied = tidy_marks(tmp_path)

    assert [path.name for path in tidied.emptied] == ["R_0000.mcap.keep"]
    assert sorted(tidied.strange) == strange
    assert [path.stat().st_size for path in sorted(tmp_path.rglob("*")) if path.is_file()] == [0, *[100_000] * 3]


def test_mark_on_a_full_disk_keeps_without_its_note(disk: Disk) -> None:
    """The segment in work, too: a name finds room where no byte does. It is said, and later the note can be added."""
    names = ["R_0000.mcap", "R_0001.mcap"]
    for number, name in enumerate(names):
        (disk.path / name).touch()
        os.utime(disk.path / name, ns=(NOON_NS, NOON_NS + number))
    make_marks_folder(disk.path)
    with suppress(OSError), (disk.path / "ballast").open("wb", buffering=0) as ballast:
        while ballast.write(bytes(2**16)):
            continue
    with pytest.raises(
        NotMarkedError, match=r"0000\.mcap and R_0001\.mcap will be kept, but without the note \(No space"
    ):
        mark(disk.path, "bird strike")
    assert marked(disk.path) == names
    (disk.path / "ballast").unlink()
    mark(disk.path, "bird strike")

    assert (disk.path / "marks" / "R_0001.mcap.keep").read_text() == "2018-05-04T12:00:00Z bird strike\n"


@pytest.mark.usefixtures("writer")
def test_mark_is_set_where_the_disk_knows_no_permissions(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A memory stick refuses to give a file its rights: both segments are marked at once, with the note."""

    def refuse(_descriptor: int, _mode: int) -> None:
        raise PermissionError(errno.EPERM, os.strerror(errno.EPERM))

    (tmp_path / "marks").rmdir()
    monkeypatch.setattr(os, "fchmod", refuse)
    found = mark(tmp_path, "bird strike")
    assert found == marked(tmp_path) == ["R_0001.mcap", "R_0002.mcap.part"]
    assert all("bird strike" in path.read_text("utf-8") for path in (tmp_path / "marks").iterdir())
