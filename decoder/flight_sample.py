"""The sample of a flight that its reader is fitted to: looked at several times, read once if there is room."""

from __future__ import annotations

from collections.abc import Iterator

from decoder.errors import PictureError
from decoder.pictures import FramePicture, grey_picture
from flight_file.frame import Frame
from flight_file.reader import Flight
from flight_file.sampling import spread

# Eight pictures of 18 megapixels, or all that are looked at of smaller ones.
KEPT_BYTES = 144 * 2**20


class FlightSample:
    """Gives so many frames, spread over the flight; pictures are kept as long as there is room for them."""

    def __init__(self, flight: Flight) -> None:
        self._flight = flight
        self._kept: dict[int, FramePicture] = {}
        self._by_rank: dict[int, FramePicture] = {}
        self._room = KEPT_BYTES

    def __call__(self, frames: int) -> Iterator[FramePicture]:
        """The same ones each time for the same number; those that cannot be opened are left out."""
        ranks = sorted(spread(self._flight.count(), frames))
        if all(rank in self._by_rank for rank in ranks):
            return (self._by_rank[rank] for rank in ranks)
        return self._read(frames, ranks)

    def given_up(self, frame: Frame) -> FramePicture | None:
        """The picture of a frame, if it is kept, which it is no more."""
        self._by_rank.clear()
        return self._kept.pop(frame.sequence, None)

    def _read(self, frames: int, ranks: list[int]) -> Iterator[FramePicture]:
        """From the file, but for pictures that are kept."""
        given = []
        for frame in self._flight.sample_frames(frames):
            taken = self._kept.get(frame.sequence)
            if taken is None:
                try:
                    taken = FramePicture(grey_picture(frame.jpeg), frame.exif.focal_length_mm)
                except PictureError:
                    continue  # reported when the flight is read
                if taken.pixels.nbytes <= self._room:
                    self._room -= taken.pixels.nbytes
                    self._kept[frame.sequence] = taken
            given.append(frame.sequence)
            yield taken
        if len(given) == len(ranks) and all(sequence in self._kept for sequence in given):  # none was left out
            self._by_rank |= {rank: self._kept[sequence] for rank, sequence in zip(ranks, given, strict=True)}
