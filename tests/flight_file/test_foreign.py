"""A flight in the contract's format is read whoever wrote it, and however it was packed."""

from __future__ import annotations

from pathlib import Path

import pytest
from mcap.reader import make_reader
from mcap.writer import CompressionType, IndexType, Writer

from flight_file import codec
from flight_file.frame import Frame
from flight_file.reader import open_flight
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
