"""Read a flight: one or several segments of a recording, finished, unfinished or damaged.

A frame is delivered only if its chunk fits its CRC and its JPEG fits its SHA-256; whatever else is in the files is a
`Loss`. Memory holds one chunk at a time.
"""

from __future__ import annotations

from collections.abc import Container, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise
from pathlib import Path
from types import MappingProxyType

from flight_file.chunks import ChunkPlace
from flight_file.errors import FlightFileError, MixedFlightsError
from flight_file.frame import Frame
from flight_file.losses import Loss, LossKind
from flight_file.sampling import ImageCounts, captured_ns, count_images, picked, spread
from flight_file.segment import Segment, digest_of, open_segment, opened
from flight_file.session import Session
from flight_file.walk import walk

_Found = tuple[ChunkPlace, Frame] | Loss


@dataclass(frozen=True, slots=True)
class _From:
    """What a container holds, counted from some number on."""

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
        Of the first segment; see `segments` for the others.
    attachments
        Content by name; from the first segment that has it whole.
    """

    def __init__(self, segments: Sequence[Segment], attachments: Mapping[str, bytes]) -> None:
        self.segments = tuple(segments)
        self.recording: str = segments[0].session.recording
        self.paths: tuple[Path, ...] = tuple(segment.path for segment in segments)
        self.session: Session = segments[0].session
        self.attachments: Mapping[str, bytes] = MappingProxyType(dict(attachments))
        self._losses: dict[Loss, None] = {}
        for loss in (*(loss for segment in segments for loss in segment.losses), *_missing_segments(segments)):
            self._note(loss)

    @property
    def losses(self) -> list[Loss]:
        """What could not be delivered so far; complete after `frames` has been read to its end."""
        return list(self._losses)

    def frames(self, part: range | None = None) -> Iterator[Frame]:
        """Every whole frame, in the order it was recorded; of a part only these.

        Parameters
        ----------
        part
            Of `range(count())`. Only the chunks are read that such frames are in, and only their losses are noted.

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

    def count(self) -> int:
        """How many frames the file's own index names; those that are damaged are among them.

        Raises
        ------
        FlightNotReadableError
            If the disk fails.
        """
        return sum(counts.total for counts in self._counts)

    def sample_frames(self, count: int) -> Iterator[Frame]:
        """At most `count` frames spread evenly from the first to the last, in order; always the same ones.

        Reads only the chunks they are in. A chosen frame that is damaged is left out; `frames` is what reports it.

        Raises
        ------
        FlightNotReadableError
            If the disk fails or a file vanishes meanwhile.
        """
        for _, found in self._picked(spread(self.count(), count)):
            if not isinstance(found, Loss):
                yield found[1]

    def captured_ns(self, rank: int) -> int | None:
        """When the frame of that rank in `range(count())` was taken; None if it is damaged.

        Raises
        ------
        FlightNotReadableError
            If the disk fails.
        """
        for segment, counts in zip(self.segments, self._counts, strict=True):
            if rank < counts.total:
                return captured_ns(segment, counts, rank)
            rank -= counts.total
        return None

    @cached_property
    def _counts(self) -> list[ImageCounts]:
        return [count_images(segment) for segment in self.segments]

    def sha256_of_files(self) -> dict[Path, str]:
        """SHA-256 of each file's bytes when it was first asked for, hexadecimal.

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
        A file is empty or no MCAP.
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
