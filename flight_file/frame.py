"""A frame: one picture as the camera sent it, with everything known about when and how it was taken.

Time is integer nanoseconds. `realtime` is UTC since the Unix epoch and may jump; `monotonic` never runs back but means
nothing outside one boot of the box.
"""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class ClockReading:
    """The host's two clocks, read together."""

    realtime_ns: int
    monotonic_ns: int


@dataclass(frozen=True, slots=True)
class HostTimes:
    """What the host's clocks said while it got one picture."""

    before_request: ClockReading
    after_answer: ClockReading
    downloaded: ClockReading


@dataclass(frozen=True, slots=True)
class Exif:
    """The EXIF tags that matter; each is None where the picture does not say.

    `datetime` is ISO 8601 with as many fractions of a second as the picture gives, and an offset only if the picture
    gives one.
    """

    focal_length_mm: float | None = None
    exposure_s: float | None = None
    f_number: float | None = None
    iso: int | None = None
    datetime: str | None = None


@dataclass(frozen=True, slots=True)
class Frame:
    """One picture of the panel.

    Attributes
    ----------
    sequence
        Counts the frames of one recording from 0; a gap is a frame that was taken but not stored.
    captured_ns
        Best estimate of mid-exposure, realtime.
    captured_sigma_ns
        Its standard deviation; None where nobody can say.
    jpeg
        The picture, byte for byte as the camera sent it.
    sha256
        Hexadecimal digest of `jpeg`, made when the picture arrived.
    width_px, height_px
        Size that the JPEG's header states, before any EXIF orientation; None where no header could be read.
    zoom_position
        The camera's own zoom position, 0 (wide) to 100 (tele) percent, if it says.
    """

    sequence: int
    captured_ns: int
    jpeg: bytes
    sha256: str
    times: HostTimes
    exif: Exif = Exif()
    width_px: int | None = None
    height_px: int | None = None
    zoom_position: float | None = None
    captured_sigma_ns: int | None = None

    def with_jpeg(self, jpeg: bytes) -> Frame:
        """The same with its picture."""
        return Frame(  # `replace` costs four times that, for each frame that is read
            self.sequence,
            self.captured_ns,
            jpeg,
            self.sha256,
            self.times,
            self.exif,
            self.width_px,
            self.height_px,
            self.zoom_position,
            self.captured_sigma_ns,
        )
