"""The interface of a live camera's driver: an open source of pictures. `LiveCamera` does the rest."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Protocol

from camera_drivers.camera import CameraIdentity
from flight_file.frame import JPEG, ClockReading, Exif


@dataclass(frozen=True, slots=True)
class Picture:
    """A picture as it came from a source.

    Attributes
    ----------
    encoded
        Byte for byte as the camera sent it; of a video an access unit in Annex B, parameter sets before a key frame.
    received
        The box's clocks when all of it had arrived.
    taken_ns, sigma_ns
        Best estimate of mid-exposure, realtime, and its standard deviation.
    number
        The source's number or timestamp of the picture; it differs from picture to picture if the camera works.
    format, size_px
        As in `Frame`; the size is None if the picture's own header contains it.
    exposure_s
        If the source states it, seconds.
    """

    encoded: bytes
    received: ClockReading
    taken_ns: int
    sigma_ns: int
    number: int
    format: str = JPEG
    size_px: tuple[int, int] | None = None
    exposure_s: float | None = None

    def exif(self, own: Exif) -> Exif:
        """Complete the picture's own EXIF with what the source states."""
        if own.exposure_s is not None or self.exposure_s is None:
            return own
        return Exif(own.focal_length_mm, self.exposure_s, own.f_number, own.iso, own.datetime)


class Missed:
    """Counts the pictures that a source lost, until its camera asks."""

    def __init__(self) -> None:
        self._counts = Counter[str]()
        self._alive = False

    def add(self, reason: str, count: int = 1, *, alive: bool = False) -> None:
        """Add to a count.

        Parameters
        ----------
        reason
            Short, without numbers.
        alive
            Whether they show that the camera works, though they cannot be kept.
        """
        self._counts[reason] += count
        self._alive = self._alive or alive

    def take(self) -> tuple[Mapping[str, int], bool]:
        """Return the counts by reason and whether the camera is alive, and reset them."""
        counts, alive = self._counts, self._alive
        self._counts, self._alive = Counter[str](), False
        return counts, alive


class Source(Protocol):
    """A connected camera that sends pictures.

    Attributes
    ----------
    identity
        Which camera it is.
    """

    identity: CameraIdentity

    def next_picture(self, wait_s: float) -> Picture | None:
        """Wait this long for the next picture, seconds; None if none came.

        Raises
        ------
        CameraError
            The camera is gone, or must be connected again.
        """
        ...

    def close(self) -> None:
        """Release the camera, within about a second; raises nothing, and may be called again."""
        ...
