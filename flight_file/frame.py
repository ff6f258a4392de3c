"""Recorded data with their times: frames as the camera sent them, and reports.

Time is integer nanoseconds. `realtime` is UTC since the Unix epoch and may jump; `monotonic` never goes back but is
meaningless outside one boot of the box.

Log times follow the monotonic clock and never go back. Each segment is anchored to the wall clock when it begins, so
setting the clock during a recording takes effect in the next segment. Only a clock that is set back is not followed.
Every message contains the clocks' own readings.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from enum import Enum

from flight_file.thresholds import FOCAL_LENGTHS_MM, MAX_READ_BYTES

NS_PER_S = 1_000_000_000
JPEG = "jpeg"
VIDEO_FORMATS = frozenset({"h264", "h265"})
"""What Foxglove calls the codecs that pictures are built on each other with."""
MAX_TIME_NS = 2**63 - 1  # in the year 2262: times in files and arrays are signed 64-bit nanoseconds
MAX_LOG_TIME_NS = 2**64 - 1  # MCAP stores unsigned 64-bit nanoseconds
NO_FIX, FIX_2D, FIX_3D = 0, 2, 3
MOST_OF_A_FIX = (100_000.0, 10_000.0, 100.0)
"""Altitude in m, speed in m/s and dilution of precision that a receiver may tell; none on an aircraft comes near."""
CONNECTION_STATES = frozenset({"connecting", "connected", "capturing", "lost", "finished"})
"""What is true of the camera until it says the next of these; any other state is something that happened meanwhile."""


def is_focal_length_mm(value: float) -> bool:
    """Whether a lens can have this focal length, in mm."""
    least, most = FOCAL_LENGTHS_MM
    return least <= value <= most


@dataclass(frozen=True, slots=True)
class ClockReading:
    """The host's two clocks, read together."""

    realtime_ns: int
    monotonic_ns: int


@dataclass(frozen=True, slots=True)
class HostTimes:
    """Readings of the host's clocks while it fetched one picture."""

    before_request: ClockReading
    after_answer: ClockReading
    downloaded: ClockReading


@dataclass(frozen=True, slots=True)
class Exif:
    """The EXIF tags in use; each is None if missing in the picture.

    `datetime` is ISO 8601 with as many fractions of a second as the picture gives, and an offset only if the picture
    gives one.
    """

    focal_length_mm: float | None = None
    exposure_s: float | None = None
    f_number: float | None = None
    iso: int | None = None
    datetime: str | None = None

    @property
    def lens_mm(self) -> float | None:
        """The focal length, mm, if it is one that a lens can have."""
        known = self.focal_length_mm is not None and is_focal_length_mm(self.focal_length_mm)
        return self.focal_length_mm if known else None


@dataclass(frozen=True, slots=True)
class Origin:
    """Position of a picture in its video file.

    Attributes
    ----------
    file
        Index of the session's originals, from 0.
    time_ns
        Its presentation time in that file.
    sha256
        Hexadecimal digest of the packet as it came from the file.
    """

    file: int
    time_ns: int
    sha256: str


@dataclass(frozen=True, slots=True)
class GpsFix:
    """Position of a GPS receiver beside the camera, or none; None for values not reported.

    Attributes
    ----------
    captured_ns
        When, by the frames' clock.
    origin_file, origin_ns
        Index of the session's originals, from 0, and the time in that file.
    fix
        NO_FIX, FIX_2D (no altitude) or FIX_3D.
    latitude_deg, longitude_deg
        WGS 84.
    altitude_m
        As the receiver reports it: above the ellipsoid or above sea level.
    speed_mps, speed_3d_mps
        Over ground, and in space.
    dop
        Dilution of precision: below 5 is good.
    gps_ns
        The receiver's own time, UTC since the Unix epoch; it may differ from the frames' clock.
    """

    captured_ns: int
    origin_file: int = 0
    origin_ns: int = 0
    fix: int = NO_FIX
    latitude_deg: float | None = None
    longitude_deg: float | None = None
    altitude_m: float | None = None
    speed_mps: float | None = None
    speed_3d_mps: float | None = None
    dop: float | None = None
    gps_ns: int | None = None


@dataclass(frozen=True, slots=True)
class SoundPeaks:
    """The strongest tones of a short window of sound, without phases and without the rest.

    Attributes
    ----------
    time_ns
        The window's middle, by the frames' clock.
    window_s
        How long it is.
    frequencies_hz
        Of the peaks of its spectrum, rising.
    levels_db
        Of each peak: as a tone, relative to a full-scale sine.
    above_db
        Of each peak: how far it stands above the spectrum around it.
    """

    time_ns: int
    window_s: float
    frequencies_hz: tuple[float, ...]
    levels_db: tuple[float, ...]
    above_db: tuple[float, ...]


@dataclass(frozen=True, slots=True)
class SoundPacket:
    """A packet of a film's sound, byte for byte; only on request.

    Attributes
    ----------
    time_ns
        When it begins, by the frames' clock.
    codec
        Its name in FFmpeg, such as `aac`.
    header
        What a decoder needs before the first packet; empty for many codecs.
    """

    time_ns: int
    codec: str
    sample_rate_hz: int
    channels: int
    header: bytes
    encoded: bytes


Sound = SoundPeaks | SoundPacket


@dataclass(frozen=True, slots=True)
class Group:
    """A group of pictures of a video: all packets needed to decode them, in decoding order.

    Attributes
    ----------
    format
        `h264` or `h265`.
    packets
        Each with its place among the group's pictures in order of time, from 0; None for a picture of another group
        that one of this group's depends on.
    rotation_deg
        Clockwise rotation to be applied to its pictures: 0, 90, 180 or 270.
    trouble
        Why its pictures cannot be decoded, in words; empty if they can.
    """

    format: str
    packets: tuple[tuple[int | None, bytes], ...]
    rotation_deg: int = 0
    trouble: str = ""


@dataclass(frozen=True, slots=True)
class Frame:
    """One picture of the panel.

    Attributes
    ----------
    sequence
        Number of the frame in its recording, from 0; a gap is a frame that was taken but not stored.
    captured_ns
        Best estimate of mid-exposure, realtime.
    captured_sigma_ns
        Its standard deviation; None if unknown.
    encoded
        The picture, byte for byte as the camera sent it; of a video its packet, as an access unit in Annex B.
    sha256
        Hexadecimal digest of `encoded`, made when the picture arrived.
    width_px, height_px
        Size that the picture's header states, before any EXIF orientation or rotation; None where no header could be
        read.
    zoom_position
        The camera's own zoom position, 0 (wide) to 100 (tele) percent, if it says.
    format
        Format of `encoded`: `jpeg`, `png`, `webp`, `h264` or `h265`.
    rotation_deg
        Clockwise rotation of its pictures that a video asks for: 0, 90, 180 or 270.
    origin
        Where a video's picture came from; None for other pictures.
    readout_s
        Read-out time of the camera's sensor, from the first row to the last; None if unknown.
    fixes
        Positions that came with it; empty in a reader, which has them in `Flight.fixes`.
    sound
        Sound that came with it; empty in a reader, which has it in `Flight.heard`.
    group, place
        The group of pictures that a video's picture is decoded with, and its place there in order of time; None and 0
        if a flight is not read for its pictures.
    """

    sequence: int
    captured_ns: int
    encoded: bytes
    sha256: str
    times: HostTimes
    exif: Exif = Exif()
    width_px: int | None = None
    height_px: int | None = None
    zoom_position: float | None = None
    captured_sigma_ns: int | None = None
    format: str = JPEG
    rotation_deg: int = 0
    origin: Origin | None = None
    readout_s: float | None = None
    fixes: tuple[GpsFix, ...] = field(default=(), compare=False, repr=False)
    sound: tuple[Sound, ...] = field(default=(), compare=False, repr=False)
    group: Group | None = field(default=None, compare=False, repr=False)
    place: int = field(default=0, compare=False)

    @property
    def objection(self) -> str:
        """Why no reader would find it in a flight file, in words; empty if it can be stored."""
        too_large = len(self.encoded) > MAX_READ_BYTES
        return f"the picture is larger than {MAX_READ_BYTES >> 20} MiB" if too_large else ""

    def with_encoded(self, encoded: bytes) -> Frame:
        """Copy the frame with this picture."""
        return Frame(  # `replace` takes four times as long, for each frame that is read
            self.sequence,
            self.captured_ns,
            encoded,
            self.sha256,
            self.times,
            self.exif,
            self.width_px,
            self.height_px,
            self.zoom_position,
            self.captured_sigma_ns,
            self.format,
            self.rotation_deg,
            self.origin,
            self.readout_s,
        )


def storable(time_ns: int) -> int:
    """Clip a time to what an MCAP record can hold: 0 to 2**64 - 1 ns."""
    return min(max(time_ns, 0), MAX_LOG_TIME_NS)


class LogLevel(Enum):
    """The levels that are mirrored into a flight; the numbers are Foxglove's."""

    WARNING = 3
    ERROR = 4
    FATAL = 5


@dataclass(frozen=True, slots=True)
class CameraStatus:
    """A change in the camera's state, or something that happened to its pictures.

    Attributes
    ----------
    state
        The camera's present state, e.g. `connected`, `lost`, `finished`.
    reason
        Why it changed, in words; empty if the state is explanation enough.
    dropped
        Frames that were taken but not stored since the recording began.
    sequence
        The frame this is about, if it is about one.
    camera_clock_offset_ns, camera_clock_sigma_ns
        How far the camera's clock, as in EXIF, is ahead of UTC, and its standard deviation; None if this is not about
        the clock.
    """

    state: str
    reason: str = ""
    dropped: int = 0
    sequence: int | None = None
    camera_clock_offset_ns: int | None = None
    camera_clock_sigma_ns: int | None = None


@dataclass(frozen=True, slots=True)
class Health:
    """The recorder's health.

    Attributes
    ----------
    free_bytes
        Free space for the recordings; None if the system does not say.
    frame_rate_hz
        Frames stored per second since the health message before.
    stored, dropped
        Frames since the recording began.
    queued
        Frames waiting to be written; None where that is meaningless (a replay that waits for the disk).
    drops_by_reason
        `dropped`, split by reason.
    temperatures_c
        By sensor, degrees Celsius, where the kernel shows them.
    clock
        `system` or `simulated`.
    clock_offset_ns
        Realtime minus monotonic clock: constant unless the clock is set.
    """

    free_bytes: int | None
    frame_rate_hz: float
    stored: int
    dropped: int
    queued: int | None
    clock: str
    clock_offset_ns: int
    drops_by_reason: Mapping[str, int] = field(default_factory=dict)
    temperatures_c: Mapping[str, float] = field(default_factory=dict)


@dataclass(frozen=True, slots=True)
class LogLine:
    """A line of the recorder's log that is worth keeping with the flight."""

    level: LogLevel
    message: str
    name: str = "recorder"


class LogClock:
    """The log times of one recording, over all its segments."""

    def __init__(self) -> None:
        self._anchor: ClockReading | None = None
        self._last_ns = 0

    def begin_segment(self, at: ClockReading) -> None:
        """Follow the wall clock from here on, unless it has been set back."""
        ahead_ns = at.realtime_ns if self._anchor is None else max(at.realtime_ns, self._unbounded(self._anchor, at))
        self._anchor = ClockReading(realtime_ns=ahead_ns, monotonic_ns=at.monotonic_ns)

    def time_ns(self, at: ClockReading) -> int:
        """Return the log time of this reading; never less than the one before."""
        anchor = self._anchor or at
        self._last_ns = max(self._last_ns, storable(self._unbounded(anchor, at)))
        return self._last_ns

    @staticmethod
    def _unbounded(anchor: ClockReading, at: ClockReading) -> int:
        return anchor.realtime_ns + at.monotonic_ns - anchor.monotonic_ns
