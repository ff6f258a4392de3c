"""Read a flight: one or several segments of a recording, finished, unfinished or damaged.

A frame is delivered only if its chunk fits its CRC and its JPEG fits its SHA-256; anything else is a `Loss`. Memory
holds one chunk at a time. Selected frames are read from only the chunks they are in.
"""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Callable, Container, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property, partial
from itertools import accumulate, chain, pairwise
from pathlib import Path
from types import MappingProxyType
from typing import TypeVar

from flight_file.errors import FlightFileError, Loss, LossKind, MixedFlightsError
from flight_file.frame import VIDEO_FORMATS, Frame, GpsFix, Sound
from flight_file.messages import CHANNEL_TOPICS, FIX_TOPIC, PICTURE_TOPICS, SOUND_TOPICS, VIDEO_TOPIC, Image
from flight_file.records import ByteSource, ChunkPlace
from flight_file.segment import Segment, digest_of, open_segment, opened
from flight_file.session import Session
from flight_file.video.groups import begins_group, in_groups
from flight_file.video.positions import decode_fix
from flight_file.video.sound import decode_sound
from flight_file.walk import UNREADABLE, Records, beside, items_of, walk

_Found = tuple[ChunkPlace, Frame] | Loss
_Beside = TypeVar("_Beside")


def spread(total: int, count: int) -> set[int]:
    """Spread at most `count` integers evenly over 0 to total - 1; with two or more, both ends are included."""
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
    """Count images by the message indexes; chunks without one, and those up to the first whole image, are read.

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
    """Read the wanted frames of a segment, by image rank, each with its chunk, or the loss instead.

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
    """Read the wanted frames and leave out the losses.

    Raises
    ------
    FlightNotReadableError
        If the disk fails.
    """
    for found in picked(segment, counts, wanted):
        if not isinstance(found, Loss):
            yield found[1]


class CaptureTimes:
    """Capture times of a segment's images, with those of the last chunk read cached."""

    def __init__(self, segment: Segment, counts: ImageCounts) -> None:
        self._segment = segment
        self._counts = counts
        self._ends = list(accumulate(counts.per_chunk))
        self._chunk = -1
        self._times_ns: list[int] = []

    def captured_ns(self, rank: int) -> int | None:
        """Return the capture time of the image of this rank in the segment; None if its chunk is damaged.

        Raises
        ------
        FlightNotReadableError
            If the disk fails.
        """
        index = bisect_right(self._ends, rank)
        if index == len(self._ends):
            return None
        if index != self._chunk:
            segment = self._segment
            with opened(segment.path) as source:
                items, _ = _readable(segment, source, segment.chunks[index], dict(self._counts.channels))
            self._chunk, self._times_ns = index, [item.captured_ns for item in items if isinstance(item, Image)]
        place = rank - (self._ends[index] - self._counts.per_chunk[index])
        return self._times_ns[place] if place < len(self._times_ns) else None


def _indexed(place: ChunkPlace, channels: dict[int, str]) -> int:
    return sum(count for channel, count in place.messages.items() if channels.get(channel) in PICTURE_TOPICS)


def _readable(
    segment: Segment, source: ByteSource, place: ChunkPlace, channels: dict[int, str]
) -> tuple[list[Frame | Image], str]:
    """Read a chunk's items; none, and the reason, if it is damaged."""
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
    known = Records(records)
    for image in (images[rank] for rank in ranks if rank < len(images)):
        found = known.paired(image)
        if isinstance(found, Frame):
            yield place, found
        else:
            yield Loss(segment.path, place.offset, place.length, found, LossKind.DAMAGED)


@dataclass(frozen=True, slots=True)
class _From:
    """A container of ranks, shifted by the rank of a segment's first frame."""

    wanted: Container[int]
    first: int

    def __contains__(self, rank: object) -> bool:
        return isinstance(rank, int) and rank + self.first in self.wanted


class Flight:
    """A recording, ready to be read; made by `open_flight`.

    Attributes
    ----------
    recording
        Name of the recording.
    paths
        Its files in the order of their segments.
    session
        Of the first segment; the others' are in `segments`.
    attachments
        Content by name; from the first segment with an undamaged copy.
    """

    def __init__(self, segments: Sequence[Segment], attachments: Mapping[str, bytes]) -> None:
        self.segments = tuple(segments)
        self.recording: str = segments[0].session.recording
        self.paths: tuple[Path, ...] = tuple(segment.path for segment in segments)
        self.session: Session = segments[0].session
        self.attachments: Mapping[str, bytes] = MappingProxyType(dict(attachments))
        self._losses: dict[Loss, None] = {}
        self._held: tuple[int, list[Frame]] = (0, [])
        for loss in (*(loss for segment in segments for loss in segment.losses), *_missing_segments(segments)):
            self._note(loss)

    @property
    def losses(self) -> list[Loss]:
        """Losses found so far; complete after `frames` has been read to its end."""
        return list(self._losses)

    def why_lost(self, attachment: str) -> str:
        """Say in words why an attachment is not there; empty if the flight never carried it, or does."""
        lacking = [segment for segment in self.segments if attachment in segment.lost_attachments]
        if attachment in self.attachments or not lacking:
            return ""
        kinds = {loss.kind for segment in lacking for loss in segment.losses}
        what = "is cut off before it is complete" if LossKind.TRUNCATED in kinds else "is damaged where it was"
        return f"the flight file {what}; give the whole file, or another panel"

    def frames(self, part: range | None = None) -> Iterator[Frame]:
        """Iterate over the whole frames in the order they were recorded, or over those of a part.

        Parameters
        ----------
        part
            Of `range(count())`. Only the chunks with these frames are read, and only their losses noted.

        Raises
        ------
        FlightNotReadableError
            If the disk fails or a file vanishes meanwhile.
        """
        expected: int | None = None
        for path, found in self._walk() if part is None else self._picked(part):
            if isinstance(found, Loss):
                self._note(found)
                continue
            place, frame = found
            if expected is not None and frame.sequence > expected and (part is None or part.step == 1):
                self._note(_gap(path, place.offset, expected, frame.sequence))
            expected = frame.sequence + 1
            yield frame

    def shown(self, part: range | None = None) -> Iterator[Frame]:
        """Iterate as `frames`, but in order of time, each picture of a video with the group needed to decode it.

        They are also numbered in order of time: a video's pictures exchange their stored numbers.

        Parameters
        ----------
        part
            Of `range(count())`, in order of time. A video is read from a key frame before it.

        Raises
        ------
        FlightNotReadableError
            If the disk fails or a file vanishes meanwhile.
        """
        if part is None:
            return chain.from_iterable(in_groups(self.frames()))
        return self._shown(part) if self._is_video else self.frames(part)

    def _shown(self, part: range) -> Iterator[Frame]:
        for first, group in self._groups_from(part.start if part else self.count()):
            if first >= part.stop:
                return
            yield from (frame for rank, frame in enumerate(group, start=first) if rank in part)

    def _groups_from(self, rank: int) -> Iterator[tuple[int, list[Frame]]]:
        """Iterate over a video's groups, starting at the picture of this rank, each with its first rank.

        Ranks are in order of time: pictures that follow a key frame but belong to the earlier group count with that.
        """
        total, key = self.count(), rank
        while True:
            key = self._key_before(key)
            groups = in_groups(self.frames(range(key, total)))
            first = key
            if key:
                orphans = next(groups, [])
                if orphans and orphans[0].group is not None and orphans[0].group.trouble:
                    first += len(orphans)
                else:
                    groups = chain([orphans], groups)
            if first <= rank or not key:
                break
            key -= 1
        for group in groups:
            if first + len(group) > rank:
                yield first, group
            first += len(group)

    def _key_before(self, rank: int) -> int:
        """Find the last key frame that is stored at or before this rank; 0 if there is none."""
        end = self.count()
        for segment, counts in zip(reversed(self.segments), reversed(self._counts), strict=True):
            with opened(segment.path) as source:
                for index in reversed(range(len(counts.per_chunk))):
                    images = counts.per_chunk[index]
                    end -= images
                    if end > rank or not images:
                        continue
                    found = list(_frames_in_chunk(segment, source, index, range(images), counts.channels))
                    for place in reversed(range(min(images, rank + 1 - end)) if len(found) == images else ()):
                        item = found[place]
                        if not isinstance(item, Loss) and begins_group(item[1]):
                            return end + place
        return 0

    @cached_property
    def _is_video(self) -> bool:
        topics = {
            counts.channels.get(channel)
            for segment, counts in zip(self.segments, self._counts, strict=True)
            for place in segment.chunks
            for channel in place.messages
        }
        if topics & PICTURE_TOPICS:
            return VIDEO_TOPIC in topics
        first = next(self.frames(range(self.count())), None)
        return first is not None and first.format in VIDEO_FORMATS

    def _walk(self) -> Iterator[tuple[Path, _Found]]:
        for segment in self.segments:
            for found in walk(segment):
                yield segment.path, found

    def _picked(self, wanted: Container[int]) -> Iterator[tuple[Path, _Found]]:
        first = 0
        for segment, counts in zip(self.segments, self._counts, strict=True):
            for found in picked(segment, counts, _From(wanted, first)):
                yield segment.path, found
            first += counts.total

    def fixes(self) -> Iterator[GpsFix]:
        """Iterate over the positions in the order they were recorded; those that cannot be read are losses.

        Only the chunks that contain any are read, by their indexes.

        Raises
        ------
        FlightNotReadableError
            If the disk fails or a file vanishes meanwhile.
        """
        return self._beside({FIX_TOPIC: decode_fix})

    def heard(self) -> Iterator[Sound]:
        """Iterate over the recorded sound: its strongest tones, and its packets if they were kept.

        Raises
        ------
        FlightNotReadableError
            If the disk fails or a file vanishes meanwhile.
        """
        return self._beside({topic: partial(decode_sound, topic=topic) for topic in SOUND_TOPICS})

    def _beside(self, decoders: Mapping[str, Callable[[memoryview], _Beside]]) -> Iterator[_Beside]:
        for segment in self.segments:
            channels = dict(CHANNEL_TOPICS)
            with opened(segment.path) as source:
                for place in segment.chunks:
                    if place.messages and not any(channels.get(each) in decoders for each in place.messages):
                        continue
                    try:
                        yield from beside(segment, source, place, channels, decoders)
                    except UNREADABLE as error:
                        self._note(Loss(segment.path, place.offset, place.length, str(error), LossKind.DAMAGED))

    def count(self) -> int:
        """Count the frames in the files' own indexes, damaged ones included.

        Raises
        ------
        FlightNotReadableError
            If the disk fails.
        """
        return sum(counts.total for counts in self._counts)

    def sample_frames(self, count: int) -> Iterator[Frame]:
        """Iterate over at most `count` frames spread evenly from first to last; always the same ones.

        Only their chunks are read and, of a video, their groups: the key frame takes the place of a chosen frame in its
        group, unless another frame of that group was chosen before. Damaged frames are left out; `frames` reports them.

        Raises
        ------
        FlightNotReadableError
            If the disk fails or a file vanishes meanwhile.
        """
        ranks = spread(self.count(), count)
        if self._is_video:
            yield from self._sampled(sorted(ranks))
            return
        for _, found in self._picked(ranks):
            if not isinstance(found, Loss):
                yield found[1]

    def sample_frame(self, rank: int) -> Frame | None:
        """Return the frame of this rank; None if it is damaged. A video's has to be decoded from its key frame on.

        Raises
        ------
        FlightNotReadableError
            If the disk fails or a file vanishes meanwhile.
        """
        if self._is_video:
            first, group = self._group_of(rank)
            return group[rank - first] if group else None
        return next((found[1] for _, found in self._picked({rank}) if not isinstance(found, Loss)), None)

    def _sampled(self, ranks: Sequence[int]) -> Iterator[Frame]:
        before = -1
        for rank in ranks:
            first, group = self._group_of(rank)
            if group:
                yield group[0] if first > before else group[rank - first]
            before = rank

    def _group_of(self, rank: int) -> tuple[int, list[Frame]]:
        """Read the group with the picture of this rank; the last one read is cached."""
        first, group = self._held
        if not first <= rank < first + len(group):
            self._held = next(self._groups_from(rank), (rank, []))
        return self._held

    def captured_ns(self, rank: int) -> int | None:
        """Return the capture time of a frame by its rank in order of time; None if it is damaged.

        Raises
        ------
        FlightNotReadableError
            If the disk fails.
        """
        if self._is_video:
            first, group = self._group_of(rank)
            return group[rank - first].captured_ns if group else None
        for counts, times in zip(self._counts, self._capture_times, strict=True):
            if rank < counts.total:
                return times.captured_ns(rank)
            rank -= counts.total
        return None

    @cached_property
    def _capture_times(self) -> list[CaptureTimes]:
        return [CaptureTimes(segment, counts) for segment, counts in zip(self.segments, self._counts, strict=True)]

    @cached_property
    def _counts(self) -> list[ImageCounts]:
        return [count_images(segment) for segment in self.segments]

    def sha256_of_files(self) -> dict[Path, str]:
        """Return the SHA-256 of each file's bytes as of the first call, hexadecimal.

        Raises
        ------
        FlightNotReadableError
            If a file cannot be read.
        """
        return dict(self._digests)

    @cached_property
    def _digests(self) -> dict[Path, str]:
        digests = {}
        for path in self.paths:
            with opened(path) as source:
                digests[path] = digest_of(source)
        return digests

    def _note(self, loss: Loss) -> None:
        self._losses[loss] = None


def open_flight(paths: Sequence[Path]) -> Flight:
    """Open the segments of one recording, in any order.

    Parameters
    ----------
    paths
        Flight files, finished (`.mcap`) or not (`.mcap.part`).

    Raises
    ------
    FlightNotReadableError
        A file does not exist, is a directory, or may not be read.
    NotAFlightError
        A file is empty or not MCAP.
    MixedFlightsError
        The files belong to different recordings, or a segment is given twice.
    """
    if not paths:
        raise FlightFileError("No flight file was given; name at least one.")
    attachments: dict[str, bytes] = {}
    segments = []
    for path in sorted(paths):
        segment, carried = open_segment(path)
        segments.append(segment)
        for name, content in carried.items():
            attachments.setdefault(name, content)
    segments.sort(key=lambda segment: segment.session.segment)
    _refuse_mixtures(segments)
    return Flight(segments, attachments)


def _refuse_mixtures(segments: Sequence[Segment]) -> None:
    first = segments[0]
    seen: dict[int, Path] = {}
    for segment in segments:
        session = segment.session
        if session.recording != first.session.recording:
            raise MixedFlightsError(
                f"{first.path} and {segment.path} belong to different recordings "
                f"({first.session.recording} and {session.recording}); give the segments of one recording."
            )
        if session.segment in seen:
            raise MixedFlightsError(
                f"{seen[session.segment]} and {segment.path} are both segment {session.segment}; "
                "give each segment once."
            )
        seen[session.segment] = segment.path


def _missing_segments(segments: Sequence[Segment]) -> Iterator[Loss]:
    for before, after in pairwise(segments):
        missing = after.session.segment - before.session.segment - 1
        if missing:
            reason = f"{missing} segment(s) between this file and the one before were not given"
            yield Loss(after.path, 0, 0, reason, LossKind.MISSING_SEGMENT)


def _gap(path: Path, offset: int, expected: int, found: int) -> Loss:
    last = found - 1
    which = f"frame {expected} is" if last == expected else f"frames {expected} to {last} are"
    return Loss(path, offset, 0, f"{which} missing", LossKind.GAP)
