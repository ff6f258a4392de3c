"""What the recorder says about itself and its camera, beside the pictures."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from enum import Enum


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
        What the camera does now, e.g. `connected`, `lost`, `finished`.
    reason
        Why it changed, in words; empty where the state says it all.
    dropped
        Frames that were taken but not stored since the recording began.
    sequence
        The frame this is about, if it is about one.
    camera_clock_offset_ns, camera_clock_sigma_ns
        By how much the camera's clock, as it stands in EXIF, is ahead of UTC, and its standard deviation; None where
        this is not about the clock.
    """

    state: str
    reason: str = ""
    dropped: int = 0
    sequence: int | None = None
    camera_clock_offset_ns: int | None = None
    camera_clock_sigma_ns: int | None = None


@dataclass(frozen=True, slots=True)
class Health:
    """How the recorder is.

    Attributes
    ----------
    free_bytes
        Room left where the recordings lie; None if the system does not say.
    frame_rate_hz
        Frames stored per second since the health message before.
    stored, dropped
        Frames since the recording began.
    queued
        Frames that wait to be written; None where that means nothing (a replay that waits for the disk).
    drops_by_reason
        `dropped`, split by reason.
    temperatures_c
        By sensor, degrees Celsius, where the kernel shows them.
    clock
        `system` or `simulated`.
    clock_offset_ns
        Realtime minus monotonic clock: it is constant unless somebody sets the clock.
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
