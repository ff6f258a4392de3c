"""Pick frames spread evenly over a flight, and read only the chunks they are in."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import islice

from flight_file.chunks import ByteSource, ChunkPlace
from flight_file.codec import Image
from flight_file.frame import Frame
from flight_file.pairing import joined
from flight_file.segment import Segment, opened
from flight_file.topics import CHANNEL_TOPICS, IMAGE_TOPIC
from flight_file.walk import UNREADABLE, items_of


def spread(total: int, count: int) -> set[int]:
    """At most `count` whole numbers from 0 to total - 1, spread evenly; from 2 on, both ends are among them."""
    if count >= total:
        return set(range(total))
    if count == 1:
        return {total // 2}
    return {step * (total - 1) // (count - 1) for step in range(count)}


@dataclass(frozen=True, slots=True)
class ImageCounts:
    """Images in each chunk of a segment, and the segment's topics by channel id."""

    per_chunk: tuple[int, ...]
    channels: Mapping[int, str]

    @property
    def total(self) -> int:
        """Images in the segment."""
        return sum(self.per_chunk)


def count_images(segment: Segment) -> ImageCounts:
    """Count without reading much: by the message indexes; a chunk without one, or before the first image, is read.

    Raises
    ------
    FlightNotReadableError
        If the disk fails.
    """
    channels = dict(CHANNEL_TOPICS)
    learnt = False
    counts = []
    with opened(segment.path) as source:
        for place in segment.chunks:
            if learnt and place.messages:
                counts.append(_indexed(place, channels))
                continue
            images = [item for item in _readable(segment, source, place, channels) if isinstance(item, Image)]
            learnt = learnt or bool(images)
            counts.append(len(images))
    return ImageCounts(tuple(counts), channels)


def sampled(segment: Segment, counts: ImageCounts, wanted: set[int]) -> Iterator[Frame]:
    """The wanted frames of a segment, by the rank of their images in it; one that is damaged is left out.

    Raises
    ------
    FlightNotReadableError
        If the disk fails.
    """
    first = 0
    with opened(segment.path) as source:
        for index, images in enumerate(counts.per_chunk):
            ranks = [rank for rank in range(images) if first + rank in wanted]
            first += images
            if ranks:
                yield from _frames_in_chunk(segment, source, index, ranks, counts.channels)


def _indexed(place: ChunkPlace, channels: dict[int, str]) -> int:
    return sum(count for channel, count in place.messages.items() if channels.get(channel) == IMAGE_TOPIC)


def _readable(segment: Segment, source: ByteSource, place: ChunkPlace, channels: dict[int, str]) -> list[Frame | Image]:
    try:
        return list(items_of(segment, source, place, channels))
    except UNREADABLE:
        return []


def _frames_in_chunk(
    segment: Segment, source: ByteSource, index: int, ranks: Sequence[int], channels: Mapping[int, str]
) -> Iterator[Frame]:
    own = _readable(segment, source, segment.chunks[index], dict(channels))
    images = [item for item in own if isinstance(item, Image)]
    records = [item for item in own if isinstance(item, Frame)]
    if len(records) < len(images):
        # Another writer may have put a record into the chunk before or after its image.
        beside = [segment.chunks[place] for place in (index - 1, index + 1) if 0 <= place < len(segment.chunks)]
        around = [item for place in beside for item in _readable(segment, source, place, dict(channels))]
        records += [item for item in around if isinstance(item, Frame)]
    for image in (images[rank] for rank in ranks if rank < len(images)):
        fitting = (joined(record, image) for record in records if record.captured_ns == image.captured_ns)
        yield from islice((frame for frame in fitting if frame is not None), 1)
