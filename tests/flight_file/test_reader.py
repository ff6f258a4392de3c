"""A flight is read whoever wrote it: whole chunks are delivered, a wrong byte never is, and what is lost is said."""

from __future__ import annotations

import errno
import os
import random
from collections.abc import Callable
from pathlib import Path

import pytest
from mcap.writer import CompressionType, IndexType, Writer

from flight_file.errors import FlightFileError, FlightNotReadableError, LossKind, MixedFlightsError, NotAFlightError
from flight_file.frame import Frame
from flight_file.messages import FRAME_TOPIC, IMAGE_TOPIC, TOPICS, encode_frame, encode_image
from flight_file.reader import open_flight, spread
from flight_file.records import FileSource
from flight_file.scan import scan_file
from tests.flight_file.flights import chunks, flipped, make_frame, telling_places, write_flight
from tests.flight_file.forging import flip


def test_segments_are_one_flight_in_any_order(tmp_path: Path, frames: list[Frame]) -> None:
    """Files are sorted by their segment number, and frames go on from one to the next."""
    paths = write_flight(tmp_path, frames, frames_per_segment=2)
    flight = open_flight(list(reversed(paths)))

    assert [path.name for path in paths] == ["flight_0000.mcap", "flight_0001.mcap", "flight_0002.mcap"]
    assert flight.paths == tuple(paths)
    assert list(flight.frames()) == frames
    assert flight.losses == []


def test_missing_segment_and_its_frames_are_losses(tmp_path: Path, frames: list[Frame]) -> None:
    """A segment that was not given is named, and so are the frames that were in it; reading again adds no loss."""
    first, _, last = write_flight(tmp_path, frames, frames_per_segment=2)
    flight = open_flight([first, last])
    for _ in range(2):
        assert [frame.sequence for frame in flight.frames()] == [0, 1, 4, 5]
        assert [loss.kind for loss in flight.losses] == [LossKind.MISSING_SEGMENT, LossKind.GAP]
        assert flight.losses[1].reason == "frames 2 to 3 are missing"


def test_files_that_are_no_single_flight_are_refused(tmp_path: Path, frames: list[Frame]) -> None:
    """Two recordings, one segment twice, none at all: each is a mistake that is named."""
    one, two = (write_flight(tmp_path, frames, recording=name) for name in ("one", "two"))

    with pytest.raises(MixedFlightsError, match=r"one and two.*give the segments of one recording\.$"):
        open_flight(one + two)
    with pytest.raises(MixedFlightsError, match=r"both segment 0; give each segment once\.$"):
        open_flight(one + one)
    with pytest.raises(FlightFileError, match="name at least one"):
        open_flight([])


@pytest.mark.parametrize(
    ("make", "error", "sentence"),
    [
        (lambda _path: None, FlightNotReadableError, "no such file"),
        (lambda path: path.mkdir(), FlightNotReadableError, "is a directory"),
        (lambda path: path.write_bytes(b""), NotAFlightError, "is empty"),
        (lambda path: path.write_bytes(b"\x89MCAP0\r"), NotAFlightError, "not an MCAP file"),
        (lambda path: path.write_bytes(b"\xff\xd8 a JPEG"), NotAFlightError, "not an MCAP file"),
    ],
)
def test_what_is_no_flight_is_one_sentence(
    tmp_path: Path, make: Callable[[Path], object], error: type[FlightFileError], sentence: str
) -> None:
    """Each says which file, what is wrong, and ends as a sentence."""
    path = tmp_path / "x.mcap"
    make(path)

    with pytest.raises(error, match=sentence) as caught:
        open_flight([path])
    assert str(caught.value).startswith(str(path))
    assert str(caught.value).endswith(".")
    assert "\n" not in str(caught.value)


def test_file_on_a_failing_disk_is_to_be_copied(
    tmp_path: Path, frames: list[Frame], monkeypatch: pytest.MonkeyPatch
) -> None:
    """What its disk does not give cannot be read again and again; the sentence says how to get all the rest."""

    def fail(*_: int) -> bytes:
        raise OSError(errno.EIO, os.strerror(errno.EIO))

    paths = write_flight(tmp_path, frames)
    monkeypatch.setattr(os, "pread", fail)
    with pytest.raises(FlightNotReadableError, match=r"\(Input/output error\): its disk fails; copy it with ddrescue"):
        open_flight(paths)


@pytest.mark.parametrize("frames_per_segment", [2, 1000])
def test_sample_is_spread_from_the_first_frame_to_the_last(
    tmp_path: Path, frames: list[Frame], frames_per_segment: int
) -> None:
    """At most so many frames, in order, the same each time, with both ends from two frames on."""
    flight = open_flight(write_flight(tmp_path, frames, frames_per_segment=frames_per_segment))
    for count in (0, 1, 2, 3, 5, 6, 100):
        sample = list(flight.sample_frames(count))

        assert sample == [frames[index] for index in sorted(spread(len(frames), count))]
        assert len(sample) == min(count, len(frames))
        assert count < 2 or (sample[0], sample[-1]) == (frames[0], frames[-1])
        assert list(flight.sample_frames(count)) == sample
    assert [flight.sample_frame(rank) for rank in range(len(frames))] == frames


def write_foreign(path: Path, frames: list[Frame], *, image_first: bool = False, **options: object) -> None:
    """A file as another program would write it with the same topics."""
    with path.open("wb") as file:
        writer = Writer(file, **options)  # type: ignore[arg-type]
        writer.start(profile="", library="somebody else")
        writer.register_channel("/other", "json", 0)
        ids = {}
        for topic in reversed(TOPICS):
            schema = writer.register_schema(topic.schema_name, topic.schema_encoding, topic.schema)
            ids[topic.name] = writer.register_channel(topic.name, topic.message_encoding, schema)
        for frame in frames:
            messages = [(FRAME_TOPIC, encode_frame(frame)), (IMAGE_TOPIC, encode_image(frame))]
            for name, data in reversed(messages) if image_first else messages:
                writer.add_message(ids[name], frame.captured_ns, data, frame.captured_ns)
        writer.finish()  # type: ignore[no-untyped-call]


BARE = {"index_types": IndexType.NONE, "enable_crcs": False, "use_statistics": False}


@pytest.mark.parametrize("options", [*({"compression": each} for each in CompressionType), BARE], ids=str)
@pytest.mark.parametrize(("chunk_size", "image_first"), [(1, False), (1, True), (1000, True), (1 << 20, False)])
def test_any_packing_is_read(
    tmp_path: Path, frames: list[Frame], *, options: dict[str, object], chunk_size: int, image_first: bool
) -> None:
    """Compression, chunk size, ids, the order of a frame's two messages, indexes and CRCs make no difference."""
    path = tmp_path / "foreign.mcap"
    write_foreign(path, frames, image_first=image_first, chunk_size=chunk_size, **options)
    flight = open_flight([path])

    assert list(flight.frames()) == frames
    assert flight.losses == []
    assert list(flight.sample_frames(3)) == [frames[0], frames[2], frames[5]]
    assert flight.recording == "foreign"


def test_file_without_chunks_delivers_nothing_and_says_why(tmp_path: Path, frames: list[Frame]) -> None:
    """Messages outside of chunks have no CRC: they are reported, not believed."""
    path = tmp_path / "flat.mcap"
    write_foreign(path, frames, use_chunking=False)
    flight = open_flight([path])

    assert list(flight.frames()) == []
    assert any("CRC" in loss.reason for loss in flight.losses)


def test_jpeg_that_does_not_fit_its_digest_is_a_loss(tmp_path: Path, frames: list[Frame]) -> None:
    """The recorder's own digest decides, even if the chunk is whole."""
    path = tmp_path / "forged.mcap"
    forged = Frame(1, frames[1].captured_ns, b"another picture", frames[1].sha256, frames[1].times)
    write_foreign(path, [frames[0], forged, frames[2]])
    flight = open_flight([path])

    assert [frame.sequence for frame in flight.frames()] == [0, 2]
    assert any("frame 1 does not fit" in loss.reason for loss in flight.losses)


@pytest.mark.parametrize("topic", [FRAME_TOPIC, IMAGE_TOPIC])
@pytest.mark.parametrize("data", [b"\xff\xff\xff", b"[]", b"{}", b'{"sequence": "x"}', b"[" * 100_000])
def test_message_that_is_not_what_its_topic_promises_is_a_loss(tmp_path: Path, topic: str, data: bytes) -> None:
    """Whole bytes of the wrong sort are reported, nothing is raised."""
    path = tmp_path / "odd.mcap"
    with path.open("wb") as file:
        writer = Writer(file)
        writer.start()
        writer.add_message(writer.register_channel(topic, "json", 0), 0, data, 0)
        writer.finish()  # type: ignore[no-untyped-call]
    flight = open_flight([path])

    assert list(flight.frames()) == []
    assert list(flight.sample_frames(1)) == []
    assert flight.sample_frame(0) is None
    assert [loss.kind.value for loss in flight.losses] == ["damaged"]


def test_record_without_its_picture_is_a_loss(tmp_path: Path, frames: list[Frame]) -> None:
    """One half of a frame is no frame: which half is there is said, and the whole frames are delivered."""
    path = tmp_path / "halves.mcap"
    with path.open("wb") as file:
        writer = Writer(file, chunk_size=1)
        writer.start()
        image, record = (writer.register_channel(topic, "any", 0) for topic in (IMAGE_TOPIC, FRAME_TOPIC))
        for frame in frames:
            if frame.sequence != 1:
                writer.add_message(image, 0, encode_image(frame), 0)
            if frame.sequence != 3:
                writer.add_message(record, 0, encode_frame(frame), 0)
        writer.finish()  # type: ignore[no-untyped-call]
    flight = open_flight([path])

    assert [frame.sequence for frame in flight.frames()] == [0, 2, 4, 5]
    assert any("the picture of frame 1 is lost" in loss.reason for loss in flight.losses)
    assert any("the record of the picture" in loss.reason for loss in flight.losses)


DAMAGES: dict[str, Callable[[bytes, int], bytes]] = {
    "cut off": lambda data, at: data[:at],
    "zeros to the end, as a power cut leaves them": lambda data, at: data[:at] + bytes(len(data) - at),
    "a flipped bit": lambda data, at: flipped(data, at * 8 + at % 8),
    "overwritten with junk": lambda data, at: data[:at] + junk(at)[: len(data) - at] + data[at + 300 :],
}


def junk(seed: int) -> bytes:
    """300 bytes that mean nothing."""
    return random.Random(seed).randbytes(300)  # noqa: S311 - content for a test


@pytest.mark.untraced
@pytest.mark.parametrize("damage", DAMAGES)
def test_damage_anywhere_costs_the_chunks_it_touches_and_is_said(tmp_path: Path, damage: str) -> None:
    """Each frame that is delivered is one that was recorded, in order; those whose chunks are as they were all are."""
    frames = [make_frame(number, 60) for number in range(3)]
    (path,) = write_flight(tmp_path, frames, attachments={"panel.yaml": b"name: F-16\n"})
    data = path.read_bytes()
    places = [slice(place.offset, place.offset + place.length) for place in chunks(path)[1:]]
    for at in telling_places(data)[::3]:
        damaged = DAMAGES[damage](data, at)
        path.write_bytes(damaged)
        flight = open_flight([path])
        found = list(flight.frames())
        kinds = {loss.kind for loss in flight.losses}
        untouched = [frame for frame, place in zip(frames, places, strict=True) if damaged[place] == data[place]]

        assert found == [frame for frame in frames if frame in found]
        assert [frame for frame in untouched if frame not in found] == []
        assert found == frames or kinds
        assert len(damaged) == len(data) or kinds & {LossKind.NO_END, LossKind.TRUNCATED}


@pytest.mark.parametrize("compression", [CompressionType.LZ4, CompressionType.ZSTD])
def test_flipped_byte_in_a_compressed_chunk_costs_that_chunk(
    tmp_path: Path, frames: list[Frame], compression: CompressionType
) -> None:
    """Whether the decompressor or the CRC notices it, the damage is a loss, and the other chunks are delivered."""
    path = tmp_path / "packed.mcap"
    write_foreign(path, frames, compression=compression, chunk_size=1000)
    data, place = path.read_bytes(), chunks(path)[2]
    for offset in range(place.offset, place.offset + place.length, 5):
        path.write_bytes(flipped(data, offset * 8 + 4))
        flight = open_flight([path])
        found = list(flight.frames())

        assert all(frame == frames[frame.sequence] for frame in found)
        assert len(found) >= len(frames) - 2
        assert len(found) == len(frames) or flight.losses


def test_lost_first_chunk_costs_no_frame(flight: Path, frames: list[Frame]) -> None:
    """The only chunk with schemas and channels is lost: the frames are still known by the fixed channel table."""
    first, data = chunks(flight)[0], flight.read_bytes()
    flight.write_bytes(data[: first.offset] + bytes(first.length) + data[first.offset + first.length :])
    again = open_flight([flight])

    assert list(again.frames()) == frames
    assert LossKind.DAMAGED in {loss.kind for loss in again.losses}


def test_damaged_attachment_is_not_delivered_and_is_taken_from_another_segment(
    tmp_path: Path, frames: list[Frame]
) -> None:
    """What does not fit its CRC is a loss; every segment carries it, so one damaged copy costs nothing."""
    attachments = {"panel.yaml": b"name: F-16\n", "panel.jpg": bytes(range(256))}
    paths = write_flight(tmp_path, frames, attachments=attachments, frames_per_segment=3)
    flip(paths[0], b"name: F-16\n")
    alone = open_flight(paths[:1])

    assert set(alone.attachments) == {"panel.jpg"}
    assert any("panel.yaml" in loss.reason for loss in alone.losses)
    assert open_flight(paths).attachments["panel.yaml"] == b"name: F-16\n"


def test_lost_attachment_is_told_from_one_that_never_was(flight: Path) -> None:
    """Cut off, damaged, or never carried."""
    whole = open_flight([flight])
    name, content = next(iter(whole.attachments.items()))
    data = flight.read_bytes()
    place = data.index(content)
    flight.write_bytes(data[:place] + bytes(len(content)) + data[place + len(content) :])
    damaged = open_flight([flight])
    flight.write_bytes(data[: place + len(content) // 2])
    cut = open_flight([flight])

    assert [each.why_lost(name).partition(";")[0] for each in (whole, damaged, cut)] == [
        "",
        "the flight file is damaged where it was",
        "the flight file is cut off before it is complete",
    ]
    assert cut.why_lost("another") == ""


def test_damaged_session_record_is_replaced_by_the_name(flight: Path) -> None:
    """A session record that does not fit its digest is not believed: the file's name says which recording it is."""
    flip(flight, b"camera_driver")
    again = open_flight([flight])

    assert again.recording == "flight"
    assert any("session" in loss.reason for loss in again.losses)


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
