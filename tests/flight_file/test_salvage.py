"""What a power cut leaves behind becomes a finished flight: every frame that is whole, and never a wrong byte."""

from __future__ import annotations

import hashlib
import os
import shutil
import struct
import zlib
from pathlib import Path

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from flight_file import scan
from flight_file.errors import FindingKind, FlightNotWrittenError, LossKind, NotAFlightError, NothingToRecoverError
from flight_file.files import DurableFile
from flight_file.frame import CameraStatus, ClockReading, Frame
from flight_file.reader import open_flight
from flight_file.records import RECORD_HEADER, FileSource, Opcode
from flight_file.salvage import Outcome, Recovery, recover_segment
from flight_file.scan import scan_file
from flight_file.session import EndRecord, Session
from flight_file.signature import Signer, read_signature, write_signature
from flight_file.thresholds import MAX_RECORD_BYTES, MAX_RECORDS
from flight_file.verification import Verdict, verify
from flight_file.writer import SegmentWriter
from tests.flight_file.flights import MAGIC_BYTES, after, chunks, flipped, make_frame, telling_places, write_flight
from tests.flight_file.forging import Taken, flip

AT = ClockReading(1_800_000_000_000_000_000, 7)
PLACES = st.integers(MAGIC_BYTES, 20_000)
JUNK = st.binary(min_size=1, max_size=700) | st.just(bytes(5000))  # zeros: as a power cut leaves a tail


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


@pytest.mark.untraced
def test_cut_anywhere_gives_the_whole_chunks_before_the_cut(tmp_path: Path) -> None:
    """However early a file ends: a finished flight with exactly the frames whose chunks are whole, or nothing."""
    frames = [make_frame(sequence, 20) for sequence in range(3)]
    (written,) = write_flight(tmp_path, frames)
    flight = tmp_path / "work" / written.name
    data = written.read_bytes()
    ends = [place.offset + place.length for place in chunks(written)]
    near_ends = [end + beside for end in ends for beside in (-1, 0)]
    for length in (*range(MAGIC_BYTES), *telling_places(data)[::7], *near_ends, len(data)):
        recovery, found, end = recovered(as_left_behind(flight, data[:length]))

        assert found == frames[: sum(end <= length for end in ends[1:])]
        assert (recovery is not None) == (length >= ends[0])
        if recovery is not None and length < len(data):
            assert end is not None
            assert end.recovered
            assert end.reason.startswith("recovered: ")
            assert end.frames == len(found)


def test_copy_of_a_file_with_bad_sectors_keeps_all_frames_around_them(tmp_path: Path) -> None:
    """As ddrescue copies it, with zeros for what the disk does not give: only the chunks around them are lost."""
    frames = [make_frame(sequence, 40_000) for sequence in range(12)]
    (written,) = write_flight(tmp_path, frames)
    data, work = written.read_bytes(), tmp_path / "work" / written.name
    for offset in range(8192, len(data), 65_536):
        _, found, _ = recovered(as_left_behind(work, data[:offset] + bytes(4096) + data[offset + 4096 :]))

        assert 0 <= len(frames) - len(found) <= 2
        assert {frame.sha256 for frame in found} <= {frame.sha256 for frame in frames}


def test_hole_in_a_file_is_not_searched(flight: Path, frames: list[Frame]) -> None:
    """A file in work that somebody made terabytes long, without a byte more: its frames come, and not after days."""
    part = as_left_behind(flight.parent / "work" / flight.name, flight.read_bytes()[:-100])
    os.truncate(part, 2**42)
    read = 0

    class Counting(FileSource):
        def read_at(self, offset: int, length: int) -> bytes:
            nonlocal read
            read += length
            return super().read_at(offset, length)

    with part.open("rb") as file:
        scan_file(part, Counting(file.fileno()))
    assert read < 2**24

    _, found, _ = recovered(part)
    assert found == frames


@settings(max_examples=200, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(cut=PLACES, damage=st.lists(st.tuples(PLACES, JUNK), max_size=4))
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
    _, found, _ = recovered(as_left_behind(flight.parent / "work" / "flight_0000.mcap", bytes(data)))

    assert found == [frame for frame in frames if frame in found]


def test_damaged_chunk_inside_costs_its_frame_and_is_declared(flight: Path, frames: list[Frame]) -> None:
    """The frames behind it are recovered, and the end record says before which of them something is missing."""
    flip(flight, frames[2].encoded)
    cut = flight.read_bytes()[: chunks(flight)[-1].offset + 50]
    recovery, found, end = recovered(as_left_behind(flight, cut))

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


def test_file_that_only_lacks_its_name_is_renamed(flight: Path, frames: list[Frame]) -> None:
    """Killed between the last byte and the renaming: not a byte is changed."""
    data = flight.read_bytes()
    recovery, found, _ = recovered(as_left_behind(flight, data))

    assert recovery is not None
    assert recovery.outcome is Outcome.FINISHED
    assert found == frames
    assert flight.read_bytes() == data


def test_file_in_work_is_left_alone_and_recovered_afterwards(tmp_path: Path) -> None:
    """Not from under a running recorder; then its end record knows of the drops that the recorder had reported."""
    path, session = tmp_path / "R_0000.mcap", Session("R", started=after(0))
    writer = SegmentWriter(path, session=session, status=CameraStatus("connected"), attachments={})
    writer.write_frame(make_frame(0), after(0))
    writer.write_status(CameraStatus("recording", "dropped", dropped=5), after(0))
    part = tmp_path / "R_0000.mcap.part"

    assert recover_segment(part, at=AT).outcome is Outcome.IN_WORK
    assert part.exists()
    writer.sync(after(0))
    writer.abandon()
    _, found, end = recovered(part)
    assert found == [make_frame(0)]
    assert end is not None
    assert end.dropped == 5


@pytest.mark.parametrize(
    ("name", "made"),
    [
        ("flight_0000.mcap", "flight_0000.recovered.mcap"),
        ("flight_0000.recovered.mcap", "flight_0000.recovered-2.mcap"),
    ],
)
def test_damaged_finished_file_is_kept_beside_the_new_one(
    flight: Path, frames: list[Frame], name: str, made: str
) -> None:
    """It is evidence, also if it came out of a recovery: it is never changed. Again, no second copy is made."""
    assert recover_segment(flight, at=AT).outcome is Outcome.NOTHING_TO_DO
    bad = flight.rename(flight.with_name(name))
    flip(bad, frames[4].encoded)
    data = bad.read_bytes()
    again = [recover_segment(bad, at=AT) for _ in range(2)]

    assert {recovery.path.name for recovery in again} == {made}
    assert again[0].frames == 5
    assert bad.read_bytes() == data
    assert {path.name for path in flight.parent.iterdir()} == {name, made}
    assert open_flight([again[0].path]).recording == "flight"


def test_frame_that_does_not_fit_its_digest_is_left_out(flight: Path, frames: list[Frame]) -> None:
    """A chunk may be whole and a frame in it not: its record and its picture stay behind, the other frames do not."""
    taken = Taken.of(flight)
    _, _, picture = taken.frame(2)
    picture.data = flipped(picture.data, 8 * picture.data.index(frames[2].encoded))
    taken.write()
    recovery = recover_segment(flight, at=AT)
    flight_again = open_flight([recovery.path])

    assert [frame.sequence for frame in flight_again.frames()] == [0, 1, 3, 4, 5]
    assert {loss.kind for loss in flight_again.losses} == {LossKind.GAP}
    assert [loss.reason for loss in recovery.losses] == ["1 frame(s) of a chunk are not whole"]


@pytest.fixture
def signed(tmp_path: Path, frames: list[Frame], signer: Signer) -> bytes:
    """The six frames as a box with a key writes them, finished."""
    (path,) = write_flight(tmp_path, frames, recording="signed", signer=signer)
    return path.read_bytes()


@pytest.fixture
def final(tmp_path: Path) -> Path:
    """Under which name they are recovered."""
    return tmp_path / "work" / "signed_0000.mcap"


def test_whole_file_in_work_with_its_signature_is_renamed(signed: bytes, signer: Signer, final: Path) -> None:
    """Killed between the signature and the renaming: not a byte is changed."""
    part = as_left_behind(final, signed)
    write_signature(final, hashlib.sha256(signed).hexdigest(), signer)
    recovery = recover_segment(part, at=AT, signer=signer)

    assert (recovery.outcome, recovery.signed) == (Outcome.FINISHED, True)
    assert final.read_bytes() == signed
    assert verify([final], public_key=signer.public_key)[0].verdict is Verdict.FITS


def test_whole_file_in_work_without_its_signature_is_signed_as_far_as_it_is_proven(
    signed: bytes, signer: Signer, frames: list[Frame], final: Path
) -> None:
    """Neither its end record nor its index is signed: anybody could have written them."""
    recovery = recover_segment(as_left_behind(final, signed), at=AT, signer=signer)
    (check,) = verify([final], public_key=signer.public_key)

    assert (recovery.outcome, recovery.signed, recovery.unproven) == (Outcome.RECOVERED, True, None)
    assert list(open_flight([final]).frames()) == frames
    assert [finding.kind for finding in check.findings] == [FindingKind.CUT]


def test_unsigned_file_in_work_is_never_signed(flight: Path, frames: list[Frame], signer: Signer) -> None:
    """Whole or cut, whoever put it there: a key signs only what its checkpoints prove."""
    content = flight.read_bytes()
    for end in (len(content), -200):
        part = as_left_behind(flight.parent / "work" / flight.name, content[:end])
        recovery = recover_segment(part, at=AT, signer=signer)

        assert not recovery.signed
        assert read_signature(recovery.path) is None
        assert list(open_flight([recovery.path]).frames()) == frames
        assert verify([recovery.path], public_key=signer.public_key)[0].verdict is Verdict.FAULT


def test_frames_behind_the_last_checkpoint_are_set_apart(
    signed: bytes, signer: Signer, frames: list[Frame], final: Path
) -> None:
    """Killed between a chunk and its checkpoint, or added by somebody: not thrown away, not signed, not made twice."""
    part = as_left_behind(final, signed)
    last = chunks(part)[-1]
    cut = signed[: last.offset + last.length]  # its index and its checkpoint stand behind it
    part.write_bytes(cut)
    recovery = recover_segment(part, at=AT, signer=signer)
    part.write_bytes(cut)  # as if it had been killed before this was removed
    again = recover_segment(part, at=AT, signer=signer)
    unproven = final.with_name(f"{final.name}.unproven")
    (check,) = verify([final, unproven], public_key=signer.public_key)
    end = open_flight([unproven]).segments[0].end

    assert (recovery.frames, recovery.unproven_frames, recovery.unproven) == (5, 1, unproven)
    assert again == recovery
    assert list(open_flight([final]).frames()) == frames[:5]
    assert list(open_flight([unproven]).frames()) == frames[5:]
    assert {path.name for path in final.parent.iterdir()} == {final.name, f"{final.name}.sig", unproven.name}
    assert [finding.kind for finding in check.findings] == [FindingKind.CUT, FindingKind.UNPROVEN]
    assert end is not None
    assert end.reason.endswith("it is not signed: it stood behind the last checkpoint, where nothing proves it")


def test_own_recording_under_another_name_is_not_signed(
    signed: bytes, signer: Signer, frames: list[Frame], final: Path
) -> None:
    """Its checkpoints are genuine, but the box never recorded it as this segment."""
    part = as_left_behind(final.with_name("signed_0001.mcap"), signed[:-300])
    recovery = recover_segment(part, at=AT, signer=signer)

    assert not recovery.signed
    assert list(open_flight([recovery.path]).frames()) == frames
    assert verify([recovery.path], public_key=signer.public_key)[0].verdict is Verdict.FAULT


def test_damaged_signed_file_is_signed_again_as_far_as_it_is_proven(
    signed: bytes, signer: Signer, frames: list[Frame], final: Path
) -> None:
    """Behind the damage no checkpoint fits any more: what is whole there is set apart."""
    as_left_behind(final, b"")
    final.write_bytes(flipped(signed, 8 * signed.index(frames[3].encoded)))
    recovery = recover_segment(final, at=AT, signer=signer)
    assert recovery.unproven is not None

    assert recovery.path.name == "signed_0000.recovered.mcap"
    assert recovery.unproven.name == "signed_0000.recovered.mcap.unproven"
    assert list(open_flight([recovery.path]).frames()) == frames[:3]
    assert list(open_flight([recovery.unproven]).frames()) == frames[4:]
    assert verify([recovery.path], public_key=signer.public_key)[0].verdict is Verdict.LOSS


@settings(max_examples=50, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(end=PLACES, bit=st.none() | st.integers(0, 20_000 * 8 - 1))
def test_nothing_is_signed_that_was_not_recorded(
    signed: bytes, signer: Signer, frames: list[Frame], final: Path, end: int, bit: int | None
) -> None:
    """Wherever it ends and whatever bit is flipped: signed are the frames before the first damage, in order."""
    content = signed[:end] if bit is None or bit // 8 >= len(signed[:end]) else flipped(signed[:end], bit)
    try:
        recovery = recover_segment(as_left_behind(final, content), at=AT, signer=signer)
    except (NotAFlightError, NothingToRecoverError):
        return
    found = list(open_flight([recovery.path]).frames())
    (check,) = verify([recovery.path], public_key=signer.public_key)

    assert check.verdict is (Verdict.LOSS if recovery.signed else Verdict.FAULT)
    if recovery.signed:
        assert found == frames[: len(found)]


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


def record(opcode: int, content: bytes) -> bytes:
    """An MCAP record."""
    return RECORD_HEADER.pack(opcode, len(content)) + content


def attachment(name: bytes, size: int) -> bytes:
    """An attachment of so many bytes that fits its CRC."""
    content = struct.pack("<QQI", 0, 0, len(name)) + name + struct.pack("<IQ", 0, size) + bytes(size)
    return record(Opcode.ATTACHMENT, content + struct.pack("<I", zlib.crc32(content)))


def chunk(records: bytes) -> bytes:
    """A chunk of these records that fits its CRC."""
    sizes = struct.pack("<IQ", 0, len(records))
    return record(Opcode.CHUNK, struct.pack("<QQQI", 0, 0, len(records), zlib.crc32(records)) + sizes + records)


BOMBS = {
    "more attachments than a box has": lambda: b"".join(attachment(b"%d" % number, 90_000) for number in range(3)),
    "an attachment that fills the memory": lambda: attachment(b"huge", 300_000),
    "a chunk of too many messages": lambda: chunk(record(Opcode.MESSAGE, bytes(22)) * (MAX_RECORDS + 1)),
    "too many records": lambda: record(Opcode.MESSAGE_INDEX, bytes(6)) * (MAX_RECORDS + 10_000),
}
SAID = {
    "more attachments than a box has": "of attachments and metadata",
    "an attachment that fills the memory": "a record of more than",
    "a chunk of too many messages": "a chunk holds more than 150000 records",
    "too many records": "more records than a flight of its size has",
}


@pytest.mark.slow
@pytest.mark.parametrize("name", BOMBS)
def test_what_was_made_to_fill_the_memory_is_a_loss(
    flight: Path, frames: list[Frame], monkeypatch: pytest.MonkeyPatch, name: str
) -> None:
    """It is refused before it is kept, and what can be told from it is recovered."""
    monkeypatch.setattr(scan, "MAX_RECORD_BYTES", 200_000 if "attachment" in name else MAX_RECORD_BYTES)
    content, place = flight.read_bytes(), chunks(flight)[3].offset
    recovery = recover_segment(as_left_behind(flight, content[:place] + BOMBS[name]() + content[place:-8]), at=AT)

    found = list(open_flight([recovery.path]).frames())
    assert found == (frames[:2] if name == "too many records" else frames)
    assert [loss.reason for loss in recovery.losses if SAID[name] in loss.reason]


def test_other_flight_under_the_name_is_never_replaced(flight: Path, frames: list[Frame]) -> None:
    """The recovered flight gets another name, if something else has its own."""
    content = flight.read_bytes()
    part = as_left_behind(flight, content[: chunks(flight)[3].offset])
    flight.write_bytes(content)
    recovery = recover_segment(part, at=AT)

    assert recovery.path.name == "flight_0000.recovered.mcap"
    assert flight.read_bytes() == content
    assert list(open_flight([recovery.path]).frames()) == frames[:2]


@pytest.mark.parametrize("suffix", ["", ".sig", ".sig.new", ".recovering", ".unproven"])
@pytest.mark.parametrize("kind", ["garbage", "empty", "folder", "fifo", "dangling link", "link"])
@pytest.mark.parametrize("has_key", [True, False])
def test_whatever_has_a_name_that_a_recovery_makes_stays_and_blocks_nothing(
    signed: bytes, signer: Signer, frames: list[Frame], final: Path, suffix: str, kind: str, *, has_key: bool
) -> None:
    """With a key or without: the next free name is taken. Files of its own helper names it may replace."""
    part = as_left_behind(final, signed[:-500])
    planted, elsewhere = final.with_name(final.name + suffix), final.parent / "elsewhere"
    elsewhere.write_bytes(b"mine")
    if kind == "folder":
        planted.mkdir()
    elif kind == "fifo":
        os.mkfifo(planted)
    elif kind.endswith("link"):
        planted.symlink_to("elsewhere" if kind == "link" else "nowhere")
    else:
        planted.write_bytes(b"garbage" if kind == "garbage" else b"")
    before = planted.lstat()
    recovery = recover_segment(part, at=AT, signer=signer if has_key else None)
    (check,) = verify([recovery.path], public_key=signer.public_key if has_key else None)

    assert list(open_flight([recovery.path]).frames()) == frames
    assert (recovery.signed, check.verdict) == (has_key, Verdict.LOSS)
    assert not part.exists()
    assert elsewhere.read_bytes() == b"mine"
    if suffix in ("", ".unproven") or kind not in ("garbage", "empty"):
        assert os.path.samestat(planted.lstat(), before)


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


def test_memory_does_not_grow_with_the_file(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The file is written in pieces of a chunk."""
    (path,) = write_flight(tmp_path, [make_frame(number, 100_000) for number in range(20)])
    part = as_left_behind(tmp_path / "work" / path.name, path.read_bytes()[:-100])
    write, written = DurableFile.write, list[int]()
    monkeypatch.setattr(DurableFile, "write", lambda file, data: written.append(len(data)) or write(file, data))
    recover_segment(part, at=AT)

    assert sum(written) > 2_000_000
    assert max(written) < 110_000
