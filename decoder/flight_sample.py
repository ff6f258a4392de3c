"""The sample of a flight that its reader is fitted to: looked at several times, decompressed once if there is room."""

from __future__ import annotations

from collections.abc import Iterator

from decoder.errors import PictureError
from decoder.pictures import FramePicture, grey_picture
from flight_file.reader import Flight

# Eight pictures of 18 megapixels, or all that are looked at of smaller ones.
KEPT_BYTES = 144 * 2**20


class FlightSample:
    """Gives so many frames, spread over the flight; pictures are kept as long as there is room for them."""

    def __init__(self, flight: Flight) -> None:
        self._flight = flight
        self._kept: dict[int, FramePicture] = {}
        self._room = KEPT_BYTES

    def __call__(self, frames: int) -> Iterator[FramePicture]:
        """The same ones each time for the same number; those that cannot be opened are left out."""
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
            yield taken
