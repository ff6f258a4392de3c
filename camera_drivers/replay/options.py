"""What the replay can be told."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Literal

from pydantic import Field

from camera_drivers.settings import AnchoredPath, Settings


class ReplaySettings(Settings):
    """A folder of pictures, flight files, or video files, as the camera."""

    driver: Literal["replay"]
    """Pictures that are there already."""
    path: AnchoredPath | list[AnchoredPath]
    """A folder of pictures, taken in the order of their names, or a list of flight files or of video files."""
    rate_hz: Annotated[float, Field(ge=1e-6, le=1000)] | None = None
    """Pictures a second, for folders; flight files and videos have their own times."""
    start: str | None = None
    """When a video's first picture was taken, such as 2026-05-04T09:30:00Z; for video files."""
    clock: Literal["creation", "timecode", "gps"] | None = None
    """Which of a video's clocks is believed, in place of start; without either nobody knows its time of day."""
    utc_offset: str | None = None
    """By how much start or clock is ahead of UTC, such as +02:00."""
    keep_sound: bool = False
    """Whether a video's sound is stored as it is, voices too; without it only its strongest tones are."""
    pace: Literal["realtime", "fastest"] = "realtime"
    """As the pictures were taken, or without waiting, on a clock that jumps from picture to picture."""

    @property
    def paths(self) -> list[Path]:
        """The path or paths as a list."""
        return self.path if isinstance(self.path, list) else [self.path]
