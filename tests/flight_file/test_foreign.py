"""A flight in the contract's format is read whoever wrote it, and however it was packed."""

from __future__ import annotations

from pathlib import Path

import pytest
from mcap.reader import make_reader
from mcap.writer import CompressionType, IndexType, Writer

from flight_file import codec
from flight_file.frame import Frame
from flight_file.reader import open_flight
from flight_file.scan import scan_file
from flight_file.segment import opened
from flight_file.topics import FRAME_TOPIC, IMAGE_TOPIC, TOPICS


def write_foreign(path: Path, frames: list[Frame], *, image_first: bool = False, **options: object) -> None:
    """A file as another program would write it with the same topics."""
    with path.open("wb") as file:
        writer = Writer(file, **options)  # type: ignore[arg-type]
        writer.start(profile="", library="somebody else")
        writer.register_channel("/other", "json", 0)
        ids = {
            topic.name: writer.register_channel(
                topic.name,
                topic.message_encoding,
                writer.register_schema(topic.schema_name, topic.schema_encoding, topic.schema),
            )
            for topic in reversed(TOPICS)
        }
        for frame in frames:
            messages = [(FRAME_TOPIC, codec.encode_frame(frame)), (IMAGE_TOPIC, codec.encode_image(frame))]
            for topic, data in reversed(messages) if image_first else messages:
                writer.add_message(ids[topic], frame.captured_ns, data, frame.captured_ns)
        writer.finish()  # type: ignore[no-untyped-call]


@pytest.mark.parametrize("compression", list(CompressionType))
@pytest.mark.parametrize("chunk_size", [1, 1000, 1 << 20])
@pytest.mark.parametrize("image_first", [False, True])
def test_any_packing_is_read(
    tmp_path: Path, frames: list[Frame], *, compression: CompressionType, chunk_size: int, image_first: bool
) -> None:
    """Compression, chunk size and the order of a frame's two messages make no difference, nor do channel ids."""
    path = tmp_path / "foreign.mcap"
    write_foreign(path, frames, image_first=image_first, compression=compression, chunk_size=chunk_size)
    flight = open_flight([path])

    assert list(flight.frames()) == frames
    assert flight.losses == []
    assert list(flight.sample_frames(3)) == [frames[0], frames[2], frames[5]]
    assert flight.recording == "foreign"


def test_no_indexes_and_no_crcs_are_needed_in_a_finished_file(tmp_path: Path, frames: list[Frame]) -> None:
    """A finished file without message indexes and without CRCs is still protected by the frames' digests."""
    path = tmp_path / "bare.mcap"
    write_foreign(path, frames, index_types=IndexType.NONE, enable_crcs=False, use_statistics=False)

    assert list(open_flight([path]).frames()) == frames
    assert list(open_flight([path]).sample_frames(2)) == [frames[0], frames[-1]]


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


def test_our_files_pass_the_mcap_package_with_crcs_on(flight: Path, frames: list[Frame]) -> None:
    """The package's own reader finds all topics, schemas and messages, and every CRC fits."""
    with flight.open("rb") as file:
        reader = make_reader(file, validate_crcs=True)
        summary = reader.get_summary()
        messages = list(reader.iter_messages())
        header = reader.get_header()
        attachments = {attachment.name: attachment.data for attachment in reader.iter_attachments()}

    assert summary is not None
    assert header.profile == "flight"
    assert {channel.topic for channel in summary.channels.values()} == {topic.name for topic in TOPICS}
    assert {schema.name for schema in summary.schemas.values()} >= {"foxglove.CompressedImage", "foxglove.Log"}
    assert sum(channel.topic == IMAGE_TOPIC for _, channel, _ in messages) == len(frames)
    assert set(attachments) == {"panel.yaml", "panel.jpg"}


@pytest.mark.parametrize("compression", [CompressionType.LZ4, CompressionType.ZSTD])
def test_flipped_byte_in_a_compressed_chunk_costs_that_chunk(
    tmp_path: Path, frames: list[Frame], compression: CompressionType
) -> None:
    """Whether the decompressor or the CRC notices it, the damage is a loss, and the other chunks are delivered."""
    path = tmp_path / "packed.mcap"
    write_foreign(path, frames, compression=compression, chunk_size=1000)
    data = path.read_bytes()
    with opened(path) as source:
        places = scan_file(path, source).chunks
    for offset in range(places[2].offset, places[2].offset + places[2].length):
        path.write_bytes(data[:offset] + bytes([data[offset] ^ 0x10]) + data[offset + 1 :])
        flight = open_flight([path])
        found = list(flight.frames())

        assert all(frame == frames[frame.sequence] for frame in found)
        assert len(found) >= len(frames) - 2
        assert len(found) == len(frames) or flight.losses


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
                writer.add_message(image, 0, codec.encode_image(frame), 0)
            if frame.sequence != 3:
                writer.add_message(record, 0, codec.encode_frame(frame), 0)
        writer.finish()  # type: ignore[no-untyped-call]
    flight = open_flight([path])

    assert [frame.sequence for frame in flight.frames()] == [0, 2, 4, 5]
    assert any("the picture of frame 1 is lost" in loss.reason for loss in flight.losses)
    assert any("the record of the picture" in loss.reason for loss in flight.losses)
