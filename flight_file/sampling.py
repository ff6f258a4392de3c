"""Pick some frames of a flight, and read only the chunks they are in."""

from __future__ import annotations

from collections.abc import Container, Iterator, Mapping, Sequence
from dataclasses import dataclass

from flight_file.chunks import ByteSource, ChunkPlace
from flight_file.codec import Image
from flight_file.frame import Frame
from flight_file.losses import Loss, LossKind
from flight_file.pairing import paired
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
    """Count without reading much: by the message indexes; a chunk without one, or up to the first whole image, is read.

    Raises
    ------
    FlightNotReadableError
        If the disk fails.
    """
    channels = dict(CHANNEL_TOPICS)
    learnt = False
    read: dict[int, int] = {}
    with opened(segment.path) as source:
        for index, place in enumerate(segment.chunks):
            if learnt and place.messages:
                continue
            items, damage = _readable(segment, source, place, channels)
            if damage and place.messages:
                continue
            read[index] = sum(isinstance(item, Image) for item in items)
            learnt = learnt or read[index] > 0
    counts = (read.get(index, _indexed(place, channels)) for index, place in enumerate(segment.chunks))
    return ImageCounts(tuple(counts), channels)


def picked(segment: Segment, counts: ImageCounts, wanted: Container[int]) -> Iterator[tuple[ChunkPlace, Frame] | Loss]:
    """The wanted frames of a segment, by the rank of their images in it, each with its chunk, or why there is none.

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


def sampled(segment: Segment, counts: ImageCounts, wanted: Container[int]) -> Iterator[Frame]:
    """The same without the losses.

    Raises
    ------
    FlightNotReadableError
        If the disk fails.
    """
    for found in picked(segment, counts, wanted):
        if not isinstance(found, Loss):
            yield found[1]


def captured_ns(segment: Segment, counts: ImageCounts, rank: int) -> int | None:
    """When the image of that rank in a segment was taken; None if its chunk is damaged.

    Raises
    ------
    FlightNotReadableError
        If the disk fails.
    """
    for place, images in zip(segment.chunks, counts.per_chunk, strict=True):
        if rank < images:
            with opened(segment.path) as source:
                items, _ = _readable(segment, source, place, dict(counts.channels))
            times = [item.captured_ns for item in items if isinstance(item, Image)]
            return times[rank] if rank < len(times) else None
        rank -= images
    return None


def _indexed(place: ChunkPlace, channels: dict[int, str]) -> int:
    return sum(count for channel, count in place.messages.items() if channels.get(channel) == IMAGE_TOPIC)


def _readable(
    segment: Segment, source: ByteSource, place: ChunkPlace, channels: dict[int, str]
) -> tuple[list[Frame | Image], str]:
    """What is in a chunk; nothing, and the reason, if it is damaged."""
    try:
        return list(items_of(segment, source, place, channels)), ""
    except UNREADABLE as error:
        return [], str(error)


def _frames_in_chunk(
    segment: Segment, source: ByteSource, index: int, ranks: Sequence[int], channels: Mapping[int, str]
) -> Iterator[tuple[ChunkPlace, Frame] | Loss]:
    place = segment.chunks[index]
    own, damage = _readable(segment, source, place, dict(channels))
    if damage:
        yield Loss(segment.path, place.offset, place.length, damage, LossKind.DAMAGED)
    images = [item for item in own if isinstance(item, Image)]
    records = [item for item in own if isinstance(item, Frame)]
    if len(records) < len(images):
        # Another writer may have put a record into the chunk before or after its image.
        beside = [segment.chunks[other] for other in (index - 1, index + 1) if 0 <= other < len(segment.chunks)]
        around = [item for other in beside for item in _readable(segment, source, other, dict(channels))[0]]
        records += [item for item in around if isinstance(item, Frame)]
    for image in (images[rank] for rank in ranks if rank < len(images)):
        found = paired([record for record in records if record.captured_ns == image.captured_ns], image)
        if isinstance(found, Frame):
            yield place, found
        else:
            yield Loss(segment.path, place.offset, place.length, found, LossKind.DAMAGED)
