"""Where the set-up page's pictures come from: a flight, or a single picture."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Protocol

from decoder.errors import PictureError
from decoder.pictures import grey_picture
from flight_file.reader import Flight, open_flight
from flight_file.sampling import count_images, sampled, spread

SAMPLE_FRAMES = 20
FLIGHT_ENDINGS = (".mcap", ".mcap.part")


class PictureSource(Protocol):
    """Pictures of one cockpit, counted from 0."""

    @property
    def name(self) -> str:
        """What a person would call it."""
        ...

    @property
    def count(self) -> int:
        """How many pictures there are."""
        ...

    @property
    def sample(self) -> tuple[int, ...]:
        """Some of them, spread evenly."""
        ...

    def encoded(self, index: int) -> bytes:
        """One picture as it was recorded; PictureError if it cannot be had."""
        ...

    def focal_length_mm(self, index: int) -> float | None:
        """The zoom of a picture that was read before, if it tells."""
        ...


class FlightSource:
    """The frames of a flight, each read when it is asked for."""

    def __init__(self, flight: Flight) -> None:
        self.flight = flight
        self.name = flight.recording
        self._counts = [count_images(segment) for segment in flight.segments]
        self.count = sum(counts.total for counts in self._counts)
        self.sample = tuple(sorted(spread(self.count, SAMPLE_FRAMES)))
        self._focal_lengths_mm: dict[int, float | None] = {}

    def encoded(self, index: int) -> bytes:
        """One frame's JPEG."""
        first = 0
        for segment, counts in zip(self.flight.segments, self._counts, strict=True):
            if first <= index < first + counts.total:
                for frame in sampled(segment, counts, {index - first}):
                    self._focal_lengths_mm[index] = frame.exif.focal_length_mm
                    return frame.jpeg
            first += counts.total
        raise PictureError(f"frame {index} cannot be read; choose another")

    def focal_length_mm(self, index: int) -> float | None:
        """A frame's zoom, as its EXIF tells it."""
        return self._focal_lengths_mm.get(index)


class SinglePicture:
    """One picture in a file."""

    count = 1
    sample = (0,)

    def __init__(self, path: Path) -> None:
        self.name = path.name
        try:
            self._encoded = path.read_bytes()
        except OSError as error:
            raise PictureError(f"{path} cannot be read: {error.strerror}") from error
        try:
            grey_picture(self._encoded)
        except PictureError as error:
            raise PictureError(f"{path}: neither a flight file nor a picture; name a flight or a JPEG") from error

    def encoded(self, index: int) -> bytes:
        """The picture; there is none but 0."""
        if index:
            raise PictureError("there is only one picture")
        return self._encoded

    def focal_length_mm(self, index: int) -> float | None:  # noqa: ARG002 - as of a flight
        """Unknown: the panel's own zoom is taken."""
        return None


def open_source(paths: Sequence[Path]) -> FlightSource | SinglePicture:
    """What lies at some paths: the segments of one recording, or one picture.

    Raises
    ------
    PictureError
        If it is neither a flight nor a picture.
    FlightFileError
        If it is a flight file that cannot be read.
    """
    if len(paths) == 1 and not paths[0].name.endswith(FLIGHT_ENDINGS):
        return SinglePicture(paths[0])
    source = FlightSource(open_flight(paths))
    if not source.count:
        raise PictureError(f"{paths[0]}: holds no pictures to draw a panel on")
    return source
