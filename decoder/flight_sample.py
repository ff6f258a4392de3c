"""The sample of a flight that its reader is fitted to: looked at several times, read once if there is room."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from functools import partial

from decoder.errors import PictureError
from decoder.flight_placing import LOOKED_AT
from decoder.picture_block import PictureBlock, TopOfFrame
from decoder.pictures import FramePicture, grey_picture
from flight_file.frame import Frame
from flight_file.reader import Flight
from flight_file.sampling import spread

# Eight pictures of 18 megapixels, or all that are looked at of smaller ones.
KEPT_BYTES = 144 * 2**20

# So many frames may need more than their first rows before all are decompressed whole.
FEW = 3

Taken = FramePicture | TopOfFrame


class FlightSample:
    """Gives so many frames, spread over the flight; pictures are kept as long as there is room for them.

    Of each frame so many first `rows` as show the panel are decompressed, until more is asked of too many; None if it
    is not known how many. Room is held back for those that are looked at once more in the end.
    """

    def __init__(self, flight: Flight, rows: int | None = None, *, kept_bytes: int = KEPT_BYTES) -> None:
        self._flight = flight
        self._rows = rows
        self._too_few = 0
        self._kept: dict[int, Taken] = {}
        self._by_rank: dict[int, int] = {}
        self._room = kept_bytes

    def __call__(self, frames: int) -> Iterator[Taken]:
        """The same ones each time for the same number; those that cannot be opened are left out."""
        ranks = sorted(spread(self._flight.count(), frames))
        if all(rank in self._by_rank for rank in ranks):
            return (self._kept[self._by_rank[rank]] for rank in ranks)
        return self._read(frames, ranks)

    def given_up(self, frame: Frame) -> Taken | None:
        """The picture of a frame, if it is kept, which it is no more."""
        self._by_rank.clear()
        return self._kept.pop(frame.sequence, None)

    def _read(self, frames: int, ranks: list[int]) -> Iterator[Taken]:
        """From the file, but for pictures that are kept."""
        given = []
        often = spread(self._flight.count(), LOOKED_AT)
        for rank, frame in zip(ranks, self._flight.sample_frames(frames), strict=False):
            taken = self._kept.get(frame.sequence)
            if taken is None:
                try:
                    taken = self._decompressed(frame)
                except PictureError:
                    continue  # reported when the flight is read
                self._keep(frame, taken, 0 if rank in often else sum(later > rank for later in often))
            given.append(frame.sequence)
            yield taken
        if len(given) == len(ranks) and all(sequence in self._kept for sequence in given):  # none was left out
            self._by_rank |= dict(zip(ranks, given, strict=True))

    def _decompressed(self, frame: Frame) -> Taken:
        focal_length_mm = frame.exif.focal_length_mm
        if self._rows is None:
            return FramePicture(grey_picture(frame.jpeg), focal_length_mm)
        taken = PictureBlock().frame(frame.jpeg, 0, focal_length_mm, self._rows)
        return replace(taken, whole=partial(self._whole, frame)) if isinstance(taken, TopOfFrame) else taken

    def _whole(self, frame: Frame) -> FramePicture:
        """All of a frame whose first rows did not do: if they often do not, no more of them are tried."""
        self._too_few += 1
        if self._too_few > FEW:
            self._rows = None
        picture = FramePicture(grey_picture(frame.jpeg), frame.exif.focal_length_mm)
        if frame.sequence in self._kept:
            self._room += _size(frame, self._kept[frame.sequence]) - _size(frame, picture)
            self._kept[frame.sequence] = picture
        return picture

    def _keep(self, frame: Frame, taken: Taken, held_back: int) -> None:
        """If there is room for it, and for as many more as it is `held_back` for."""
        size = _size(frame, taken)
        if (1 + held_back) * size <= self._room:
            self._room -= size
            self._kept[frame.sequence] = taken


def _size(frame: Frame, taken: Taken) -> int:
    """Bytes that a picture keeps in memory: if it is not whole, its JPEG too."""
    return taken.pixels.nbytes + (len(frame.jpeg) if isinstance(taken, TopOfFrame) else 0)
