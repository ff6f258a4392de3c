"""Whatever happens to a file: whole chunks are delivered, a wrong byte never is, and what is lost is said."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from flight_file.chunks import FileSource
from flight_file.errors import NotAFlightError
from flight_file.frame import Frame
from flight_file.losses import LossKind
from flight_file.reader import open_flight
from flight_file.scan import scan_file
from flight_file.segment import opened

MAGIC_BYTES = 8

TellingPlaces = Callable[[bytes], list[int]]


def read_all(path: Path) -> tuple[list[Frame], set[LossKind]]:
    """All frames, and the kinds of losses; None at all if it is no MCAP any more."""
    flight = open_flight([path])
    return list(flight.frames()), {loss.kind for loss in flight.losses}


def chunk_ends(path: Path) -> list[int]:
    """Where each chunk of a sound file ends."""
    with opened(path) as source:
        return [place.offset + place.length for place in scan_file(path, source).chunks]


@contextmanager
def patched(path: Path, offset: int, data: bytes) -> Iterator[None]:
    """Some bytes of a file are others for a while."""
    descriptor = os.open(path, os.O_RDWR)
    try:
        before = os.pread(descriptor, len(data), offset)
        os.pwrite(descriptor, data, offset)
        yield
        os.pwrite(descriptor, before, offset)
    finally:
        os.close(descriptor)


@pytest.mark.untraced
def test_cut_anywhere_gives_the_whole_chunks_before_the_cut(
    flight: Path, frames: list[Frame], telling_places: TellingPlaces
) -> None:
    """A file that ends early delivers exactly the frames whose chunks are whole, and says that it ends early."""
    ends = chunk_ends(flight)[1:]  # the first chunk has no frame
    for length in reversed(telling_places(flight.read_bytes())):
        os.truncate(flight, length)
        found, kinds = read_all(flight)

        assert found == frames[: sum(end <= length for end in ends)]
        assert kinds & {LossKind.NO_END, LossKind.TRUNCATED}


def test_cut_inside_the_magic_is_no_flight(flight: Path) -> None:
    """Of seven bytes or none, nobody can say that they were a flight: one sentence tells so."""
    for length in (7, 1, 0):
        os.truncate(flight, length)
        with pytest.raises(NotAFlightError, match=r"\.$"):
            open_flight([flight])


@pytest.mark.untraced
def test_zeroed_tail_never_gives_a_wrong_byte(flight: Path, frames: list[Frame], telling_places: TellingPlaces) -> None:
    """A tail of zeros, as a power cut leaves it, costs the frames in it and none before it."""
    size, ends = flight.stat().st_size, chunk_ends(flight)[1:]
    data = flight.read_bytes()
    for start in telling_places(data)[:-1:2]:
        with patched(flight, start, bytes(size - start)):
            found, kinds = read_all(flight)

            assert found == frames[: len(found)]
            # A chunk that ended in zeros anyway has lost nothing.
            assert len(found) >= sum(end <= start for end in ends)
            assert kinds or data[start:] == bytes(size - start)


@pytest.mark.untraced
def test_flipped_bit_costs_at_most_its_own_chunk(
    flight: Path, frames: list[Frame], telling_places: TellingPlaces
) -> None:
    """One bad bit anywhere loses at most the one frame it lies in, and never changes one."""
    data = flight.read_bytes()
    for number, offset in enumerate(telling_places(data)):
        with patched(flight, offset, bytes([data[offset] ^ (1 << number % 8)])):
            found, kinds = read_all(flight)

            assert all(frame == frames[frame.sequence] for frame in found)
            assert len(found) >= len(frames) - 1
            assert len(found) == len(frames) or kinds & {LossKind.DAMAGED}


@settings(deadline=None, max_examples=150, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(offset=st.integers(MAGIC_BYTES, 20_000), junk=st.binary(min_size=1, max_size=3000))
def test_junk_anywhere_never_gives_a_wrong_byte(flight: Path, frames: list[Frame], offset: int, junk: bytes) -> None:
    """Whatever overwrites a part of the file, each frame delivered is one that was recorded, in order."""
    data = flight.read_bytes()
    room = data[offset : offset + len(junk)]
    with patched(flight, offset, junk[: len(room)]) if room else patched(flight, MAGIC_BYTES, data[8:9]):
        found, _ = read_all(flight)

        assert all(frame == frames[frame.sequence] for frame in found)
        assert [frame.sequence for frame in found] == sorted({frame.sequence for frame in found})


def test_lost_first_chunk_costs_no_frame(flight: Path, frames: list[Frame]) -> None:
    """The only chunk with schemas and channels is lost: the frames are still known by the fixed channel table."""
    with opened(flight) as source:
        first = scan_file(flight, source).chunks[0]
    with patched(flight, first.offset, bytes(first.length)):
        found, kinds = read_all(flight)

    assert found == frames
    assert LossKind.DAMAGED in kinds


def test_unfinished_file_delivers_everything_synced(tmp_path: Path, flight: Path, frames: list[Frame]) -> None:
    """A file in work, as a killed recorder leaves it, is read under its own name."""
    part = tmp_path / "flight_0000.mcap.part"
    part.write_bytes(flight.read_bytes()[: chunk_ends(flight)[-1]])
    found, kinds = read_all(part)

    assert found == frames
    assert kinds == {LossKind.NO_END}


@pytest.mark.parametrize("name", ["panel.yaml", "panel.jpg"])
def test_damaged_attachment_is_not_delivered(flight: Path, name: str) -> None:
    """An attachment that does not fit its CRC is a loss, and the others are still there."""
    content = {"panel.yaml": b"name: F-16\n", "panel.jpg": bytes(range(256))}
    with patched(flight, flight.read_bytes().index(content[name]) + 5, b"\xff"):
        opened_flight = open_flight([flight])

    assert name not in opened_flight.attachments
    assert len(opened_flight.attachments) == 1
    assert any(name in loss.reason for loss in opened_flight.losses)


def test_attachment_lost_in_one_segment_is_taken_from_another(
    tmp_path: Path, frames: list[Frame], write_flight: Callable[..., list[Path]]
) -> None:
    """Every segment carries the attachments, so one damaged copy costs nothing."""
    paths = write_flight(tmp_path, frames, attachments={"panel.yaml": b"name: F-16\n"}, frames_per_segment=3)
    with patched(paths[0], paths[0].read_bytes().index(b"name: F-16\n"), b"X"):
        assert open_flight(paths).attachments["panel.yaml"] == b"name: F-16\n"


def test_damaged_session_record_is_replaced_by_the_name(flight: Path) -> None:
    """A session record that does not fit its digest is not believed: the file's name says which recording it is."""
    with patched(flight, flight.read_bytes().index(b"camera_driver"), b"C"):
        opened_flight = open_flight([flight])

    assert opened_flight.recording == "flight"
    assert any("session" in loss.reason for loss in opened_flight.losses)


def test_reading_keeps_one_chunk_in_memory(flight: Path) -> None:
    """Frames are streamed: the file is read chunk by chunk as they are asked for."""
    reads: list[int] = []

    class Counting(FileSource):
        def read_at(self, offset: int, length: int) -> bytes:
            reads.append(length)
            return super().read_at(offset, length)

    with flight.open("rb") as file:
        scan_file(flight, Counting(file.fileno()))

    assert max(reads) < flight.stat().st_size / 4
