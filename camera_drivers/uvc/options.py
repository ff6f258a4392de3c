"""What the driver can be told of a USB camera."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Literal

from camera_drivers.live.camera import Pace


@dataclass(frozen=True, slots=True)
class Options:
    """Wanted settings; None leaves one as the camera has it.

    Attributes
    ----------
    device
        Path of the device file; those in /dev/v4l/by-id keep their names.
    size_px
        Width and height; the camera takes the nearest that it has.
    rate_hz
        Pictures a second that the camera makes; it takes the nearest that it has.
    exposure_s, focus, white_balance_k
        Held at this value, seconds, camera's own steps, kelvin; `auto` leaves it to the camera.
    gain
        In the camera's own steps.
    power_line_hz
        Of the lamps whose flicker the camera is to avoid, 0 for none.
    """

    device: str
    size_px: tuple[int, int] | None = None
    rate_hz: float | None = None
    exposure_s: float | Literal["auto"] | None = None
    focus: int | Literal["auto"] | None = None
    white_balance_k: int | Literal["auto"] | None = None
    gain: int | None = None
    power_line_hz: Literal[0, 50, 60] | None = None
    pace: Pace = field(default_factory=Pace)
