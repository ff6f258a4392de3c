"""What a driver of a live camera provides: an open source of pictures. `LiveCamera` does the rest."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Protocol

from camera_drivers.camera import CameraIdentity
from flight_file.frame import JPEG, ClockReading, Exif


@dataclass(frozen=True, slots=True)
class Picture:
    """A picture as a source gave it.

    Attributes
    ----------
    encoded
        Byte for byte as the camera sent it; of a video an access unit in Annex B, parameter sets before a key frame.
    received
        The box's clocks when all of it was there.
    taken_ns, sigma_ns
        Best estimate of mid-exposure, realtime, and its standard deviation.
    number
        What the source counts or dates its pictures by; it differs from picture to picture of a camera that works.
    format, size_px
        As in `Frame`; the size is None where the picture's own header says it.
    exposure_s
        If the source states it, seconds.
    missed
        Pictures that were lost between the one before and this one, by reason (short, without numbers).
    """

    encoded: bytes
    received: ClockReading
    taken_ns: int
    sigma_ns: int
    number: int
    format: str = JPEG
    size_px: tuple[int, int] | None = None
    exposure_s: float | None = None
    missed: Mapping[str, int] = field(default_factory=dict)

    def exif(self, own: Exif) -> Exif:
        """Complete the picture's own EXIF with what the source states."""
        if own.exposure_s is not None or self.exposure_s is None:
            return own
        return Exif(own.focal_length_mm, self.exposure_s, own.f_number, own.iso, own.datetime)


class Source(Protocol):
    """A camera that is connected and sends pictures.

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
            The camera is gone, or has to be connected again.
        """
        ...

    def close(self) -> None:
        """Let go of the camera, within about a second; raises nothing, and may be called again."""
        ...
