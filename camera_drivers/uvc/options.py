"""What the driver can be told of a USB camera."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import AfterValidator, Field

from camera_drivers.settings import Interval, LiveSettings, Rate, Size, one_line


class UvcSettings(LiveSettings):
    """A USB camera, or another Video4Linux device that sends JPEGs; what is left out stays as the camera has it."""

    driver: Literal["uvc"]
    """A USB camera."""
    device: Annotated[str, Field(pattern=r"^/dev/", max_length=300), AfterValidator(one_line)]
    """The device file. Those in `/dev/v4l/by-id` keep their names when other cameras are plugged in."""
    size_px: Size | None = None
    """Width and height; without it the largest that the camera has."""
    rate_hz: Rate | None = None
    """Pictures a second that the camera makes."""
    interval_s: Interval = 0.0
    """Seconds from one picture that is kept to the next; 0 keeps all."""
    exposure_s: Literal["auto"] | Annotated[float, Field(gt=0, le=60)] | None = None
    """Held at so many seconds, or `auto`."""
    focus: Literal["auto"] | Annotated[int, Field(ge=0, le=100_000)] | None = None
    """Held at this step of the camera's own, or `auto`."""
    white_balance_k: Literal["auto"] | Annotated[int, Field(gt=0, le=100_000)] | None = None
    """Held at so many kelvin, or `auto`."""
    gain: Annotated[int, Field(ge=0, le=100_000)] | None = None
    """In the camera's own steps."""
    power_line_hz: Literal[0, 50, 60] | None = None
    """Of the lamps whose flicker is to be avoided; 0 for none."""
