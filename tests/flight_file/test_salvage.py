"""What a power cut leaves behind becomes a finished flight: every frame that is whole, and never a wrong byte."""

from __future__ import annotations

import os
import shutil
import zlib
from collections.abc import Callable
from pathlib import Path

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from flight_file.chunks import ChunkPlace
from flight_file.durable_file import DurableFile
from flight_file.errors import FlightNotWrittenError, NotAFlightError, NothingToRecoverError
from flight_file.frame import ClockReading, Frame
from flight_file.keys import load_signer, make_key_files
from flight_file.losses import LossKind
from flight_file.reader import open_flight
from flight_file.reports import CameraStatus
from flight_file.salvage import Outcome, Recovery, recover_segment
from flight_file.scan import scan_file
from flight_file.segment import opened
from flight_file.session import EndRecord, Session
from flight_file.verification import Verdict, verify
from flight_file.writer import SegmentWriter

AT = ClockReading(1_800_000_000_000_000_000, 7)
MAGIC_BYTES = 8

WriteFlight = Callable[..., list[Path]]
TellingPlaces = Callable[[bytes], list[int]]


def chunks(path: Path) -> list[ChunkPlace]:
    """Where the chunks of a sound file are; the first has no frame."""
    with opened(path) as source:
        return scan_file(path, source).chunks


def as_left_behind(path: Path, content: bytes) -> Path:
    """A file in work with this content, as the only thing in its directory."""
    shutil.rmtree(path.parent, ignore_errors=True)
    path.parent.mkdir()
    part = path.with_name(path.name + ".part")
    part.write_bytes(content)
    return part


def recovered(part: Path) -> tuple[Recovery | None, list[Frame], EndRecord | None]:
    """What recovering gives: all frames and the end record of the new file; None if there was nothing to recover."""
    try:
        recovery = recover_segment(part, at=AT)
    except (NotAFlightError, NothingToRecoverError):
        assert list(part.parent.iterdir()) == [part]
        return None, [], None
    assert list(part.parent.iterdir()) == [recovery.path]
    flight = open_flight([recovery.path])
    frames = list(flight.frames())
    assert recovery.frames == len(frames)
    assert {loss.kind for loss in flight.losses} <= {LossKind.GAP, LossKind.DAMAGED}
    return recovery, frames, flight.segments[0].end


@pytest.mark.slow
def test_cut_anywhere_gives_the_whole_chunks_before_the_cut(
    tmp_path: Path, make_frame: Callable[..., Frame], write_flight: WriteFlight, telling_places: TellingPlaces
) -> None:
    """However early a file ends: a finished flight with exactly the frames whose chunks are whole, or nothing."""
    frames = [make_frame(sequence, 20) for sequence in range(3)]
    (written,) = write_flight(tmp_path, frames)
    flight = tmp_path / "work" / written.name
    data, places = written.read_bytes(), chunks(written)
    ends = [place.offset + place.length for place in places]
    for length in (*range(MAGIC_BYTES), *telling_places(data), len(data)):
        recovery, found, end = recovered(as_left_behind(flight, data[:length]))

        assert found == frames[: sum(end <= length for end in ends[1:])]
        assert (recovery is not None) == (length >= ends[0])
        if recovery is not None and length < len(data):
            assert end is not None
            assert end.recovered
            assert end.reason.startswith("recovered: ")
            assert end.frames == len(found)


@pytest.mark.slow
def test_tail_of_zeros_costs_the_frames_in_it(flight: Path, frames: list[Frame], telling_places: TellingPlaces) -> None:
    """What a power cut leaves of a file whose length was written before its bytes."""
    data, places = flight.read_bytes(), chunks(flight)
    for start in telling_places(data)[::3]:
        _, found, _ = recovered(as_left_behind(flight, data[:start] + bytes(len(data) - start)))

        assert found == frames[: len(found)]
        assert len(found) >= sum(place.offset + place.length <= start for place in places[1:])


@settings(deadline=None, max_examples=200, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(
    cut=st.integers(MAGIC_BYTES, 20_000),
    damage=st.lists(st.tuples(st.integers(MAGIC_BYTES, 20_000), st.binary(min_size=1, max_size=700)), max_size=4),
)
def test_damage_anywhere_never_gives_a_wrong_byte(
    flight: Path, frames: list[Frame], cut: int, damage: list[tuple[int, bytes]]
) -> None:
    """Whatever was overwritten and wherever the file ends, each frame recovered is one that was recorded, in order."""
    backup = flight.with_name("backup")
    if not backup.exists():
        shutil.copyfile(flight, backup)
    data = bytearray(backup.read_bytes()[:cut])
    for offset, junk in damage:
        data[offset : offset + len(junk)] = junk[: max(0, len(data) - offset)]
    part = flight.parent / "work" / "flight_0000.mcap"
    _, found, _ = recovered(as_left_behind(part, bytes(data)))

    assert all(frame == frames[frame.sequence] for frame in found)
    assert [frame.sequence for frame in found] == sorted({frame.sequence for frame in found})


def test_damaged_chunk_inside_costs_its_frame_and_is_declared(flight: Path, frames: list[Frame]) -> None:
    """The frames behind it are recovered, and the end record says before which of them something is missing."""
    data = bytearray(flight.read_bytes())
    data[data.index(frames[2].jpeg)] ^= 1
    recovery, found, end = recovered(as_left_behind(flight, bytes(data[: chunks(flight)[-1].offset + 50])))

    assert [frame.sequence for frame in found] == [0, 1, 3, 4]
    assert end is not None
    assert end.lost_before == (3,)
    assert recovery is not None
    assert [loss.kind for loss in recovery.losses] == [LossKind.TRUNCATED, LossKind.DAMAGED]


def test_attachments_and_session_are_recovered(flight: Path) -> None:
    """The new file says the same about itself as the old one."""
    before = open_flight([flight])
    recovery, _, _ = recovered(as_left_behind(flight, flight.read_bytes()[: chunks(flight)[2].offset]))

    assert recovery is not None
    after = open_flight([recovery.path])
    assert after.session == before.session
    assert dict(after.attachments) == dict(before.attachments)
    assert after.segments[0].start_of_chain == before.segments[0].start_of_chain


def test_reports_are_recovered_and_drops_counted(tmp_path: Path, make_frame: Callable[..., Frame]) -> None:
    """The end record of a recovered segment knows of the drops that the recorder had reported."""
    at = ClockReading(10**18, 0)
    writer = SegmentWriter(
        tmp_path / "R_0000.mcap", session=Session("R", started=at), status=CameraStatus("connected"), attachments={}
    )
    writer.write_frame(make_frame(0), at)
    writer.write_status(CameraStatus("recording", "dropped", dropped=5), at)
    writer.sync(at)
    writer.abandon()
    _, found, end = recovered(tmp_path / "R_0000.mcap.part")

    assert len(found) == 1
    assert end is not None
    assert end.dropped == 5


def test_file_that_only_lacks_its_name_is_renamed(flight: Path, frames: list[Frame]) -> None:
    """Killed between the last byte and the renaming: not a byte is changed."""
    data = flight.read_bytes()
    recovery, found, _ = recovered(as_left_behind(flight, data))

    assert recovery is not None
    assert recovery.outcome is Outcome.FINISHED
    assert found == frames
    assert flight.read_bytes() == data


def test_file_in_work_is_left_alone(tmp_path: Path, make_frame: Callable[..., Frame]) -> None:
    """A segment that a running recorder writes cannot be recovered from under it, but can afterwards."""
    at = ClockReading(10**18, 0)
    path = tmp_path / "R_0000.mcap"
    writer = SegmentWriter(path, session=Session("R", started=at), status=CameraStatus("connected"), attachments={})
    writer.write_frame(make_frame(0), at)
    part = tmp_path / "R_0000.mcap.part"

    assert recover_segment(part, at=AT).outcome is Outcome.IN_WORK
    assert part.exists()
    writer.sync(at)
    writer.abandon()
    assert recover_segment(part, at=AT).path == path


def test_damaged_finished_file_is_kept_beside_the_new_one(flight: Path, frames: list[Frame]) -> None:
    """A finished file is evidence: it is never changed. Recovering it again makes no second copy."""
    data = bytearray(flight.read_bytes())
    data[data.index(frames[4].jpeg)] ^= 1
    flight.write_bytes(data)
    again = [recover_segment(flight, at=AT) for _ in range(2)]

    assert {recovery.path.name for recovery in again} == {"flight_0000.recovered.mcap"}
    assert again[0].frames == 5
    assert flight.read_bytes() == data
    assert {path.name for path in flight.parent.iterdir()} == {"flight_0000.mcap", "flight_0000.recovered.mcap"}


def test_damaged_recovered_file_is_recovered_into_another(flight: Path, frames: list[Frame]) -> None:
    """A file that came out of a recovery can go bad too."""
    data = bytearray(flight.read_bytes())
    data[data.index(frames[4].jpeg)] ^= 1
    bad = flight.with_name("flight_0000.recovered.mcap")
    bad.write_bytes(data)
    recovery = recover_segment(bad, at=AT)

    assert recovery.path.name == "flight_0000.recovered-2.mcap"
    assert bad.read_bytes() == data
    assert open_flight([recovery.path]).recording == "flight"


def test_frame_that_does_not_fit_its_digest_is_left_out(flight: Path, frames: list[Frame]) -> None:
    """A chunk may be whole and a frame in it not: its record and its picture stay behind, the other frames do not."""
    data = bytearray(flight.read_bytes())
    place = chunks(flight)[3]
    head = place.offset + 9
    data[data.index(frames[2].jpeg)] ^= 1
    records = bytes(data[head + 40 : place.offset + place.length])
    data[head + 24 : head + 28] = zlib.crc32(records).to_bytes(4, "little")
    flight.write_bytes(data)
    recovery = recover_segment(flight, at=AT)
    flight_again = open_flight([recovery.path])

    assert [frame.sequence for frame in flight_again.frames()] == [0, 1, 3, 4, 5]
    assert {loss.kind for loss in flight_again.losses} == {LossKind.GAP}
    assert [loss.reason for loss in recovery.losses] == ["1 frame(s) of a chunk are not whole"]


def test_whole_file_in_work_is_signed_too(flight: Path, tmp_path: Path) -> None:
    """Killed before its signature was there: it gets one with its name."""
    make_key_files(tmp_path / "key")
    signer = load_signer(tmp_path / "key")
    part = flight.rename(flight.with_name(flight.name + ".part"))
    recover_segment(part, at=AT, signer=signer)

    assert verify([flight], public_key=signer.public_key)[0].verdict is Verdict.FITS


def test_whole_file_is_left_alone(flight: Path) -> None:
    """There is nothing to do."""
    assert recover_segment(flight, at=AT).outcome is Outcome.NOTHING_TO_DO
    assert list(flight.parent.iterdir()) == [flight]


def test_recovery_cut_off_before_the_part_was_removed_is_completed(flight: Path, frames: list[Frame]) -> None:
    """The new file was there already, the old one still: it is removed, nothing is made twice."""
    content = flight.read_bytes()[: chunks(flight)[3].offset]
    part = as_left_behind(flight, content)
    first = recover_segment(part, at=AT)
    part.write_bytes(content)
    (part.parent / "flight_0000.mcap.recovering").write_bytes(b"left from a recovery that was killed")
    second = recover_segment(part, at=AT)

    assert first.path == second.path == flight
    assert list(flight.parent.iterdir()) == [flight]
    assert list(open_flight([flight]).frames()) == frames[:2]


def test_other_flight_under_the_name_is_never_replaced(flight: Path, frames: list[Frame]) -> None:
    """The recovered flight gets another name, if something else has its own."""
    content = flight.read_bytes()
    part = as_left_behind(flight, content[: chunks(flight)[3].offset])
    flight.write_bytes(content)
    recovery = recover_segment(part, at=AT)

    assert recovery.path.name == "flight_0000.recovered.mcap"
    assert flight.read_bytes() == content
    assert list(open_flight([recovery.path]).frames()) == frames[:2]


def test_full_disk_leaves_everything_as_it_was(flight: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """No room for the new file: the old one is still there, and nothing half done."""
    part = as_left_behind(flight, flight.read_bytes()[:-100])
    before = part.read_bytes()

    def full(file: DurableFile, _data: bytes) -> int:
        raise FlightNotWrittenError(file.path, reason="cannot be written (No space left); make room on the disk")

    monkeypatch.setattr(DurableFile, "write", full)
    with pytest.raises(FlightNotWrittenError, match="make room"):
        recover_segment(part, at=AT)
    assert list(part.parent.iterdir()) == [part]
    assert part.read_bytes() == before


def test_memory_does_not_grow_with_the_file(
    tmp_path: Path, make_frame: Callable[..., Frame], write_flight: WriteFlight, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The file is read and written in pieces of a chunk."""
    (path,) = write_flight(tmp_path / "..", [make_frame(number, 100_000) for number in range(20)])
    part = as_left_behind(tmp_path / "work" / path.name, path.read_bytes()[:-100])
    written: list[int] = []
    write = DurableFile.write

    def noted(file: DurableFile, data: bytes) -> int:
        written.append(len(data))
        return write(file, data)

    monkeypatch.setattr(DurableFile, "write", noted)
    recover_segment(part, at=AT)

    assert sum(written) > 2_000_000
    assert max(written) < 110_000


@pytest.fixture(autouse=True)
def _quick_disk(monkeypatch: pytest.MonkeyPatch) -> None:
    """Thousands of files are recovered here; that the disk is waited for shows elsewhere."""
    monkeypatch.setattr(os, "fdatasync", lambda _descriptor: None)
    monkeypatch.setattr(os, "fsync", lambda _descriptor: None)
