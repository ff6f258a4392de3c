"""What the driver can be told, and the command line of rpicam-vid that it makes of that.

Source: rpicam-apps, core/options.cpp and core/video_options.hpp. Its predecessor libcamera-vid takes the same, but for
`--flicker-period`, which is younger.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Literal

from camera_drivers.live.camera import Pace

_US_PER_S = 1_000_000
_FLICKER_US = {0: 0, 50: 10_000, 60: 8_333}


@dataclass(frozen=True, slots=True)
class Options:
    """Wanted settings; None leaves one to rpicam-vid.

    Attributes
    ----------
    program
        Its name or path.
    index
        Which camera, as `rpicam-hello --list-cameras` counts them.
    size_px
        Width and height.
    rate_hz
        Pictures a second.
    quality
        Of the JPEGs, 1 to 100.
    bitrate_mbit
        Of H.264, megabits a second.
    key_frame_every
        Of H.264: a key frame, and one in so many frames.
    exposure_s, gain, awb_gains
        Held at these values: seconds; a factor; factors of red and blue.
    focus
        Held at so many dioptres (1 / distance in m), or `auto`.
    power_line_hz
        Of the lamps whose flicker automatic exposure is to avoid, 0 for none.
    rotation_deg
        By how much the sensor turns its pictures.
    """

    program: str = "rpicam-vid"
    index: int = 0
    codec: Literal["mjpeg", "h264"] = "mjpeg"
    size_px: tuple[int, int] | None = None
    rate_hz: float | None = None
    quality: int = 90
    bitrate_mbit: float | None = None
    key_frame_every: int = 30
    exposure_s: float | None = None
    gain: float | None = None
    awb_gains: tuple[float, float] | None = None
    focus: float | Literal["auto"] | None = None
    power_line_hz: Literal[0, 50, 60] | None = None
    rotation_deg: Literal[0, 180] = 0
    pace: Pace = field(default_factory=Pace)


def arguments(options: Options, metadata: str) -> list[str]:
    """Write the command line, without the program; pictures go to its standard output, metadata to that path."""
    wanted: dict[str, object] = {
        "--camera": options.index,
        "--codec": options.codec,
        "--output": "-",
        "--timeout": 0,
        "--metadata": metadata,
        "--metadata-format": "txt",  # a record ends with an empty line; in JSON only the next one tells
        "--rotation": options.rotation_deg,
        "--framerate": None if options.rate_hz is None else f"{options.rate_hz:g}",
        "--shutter": None if options.exposure_s is None else round(options.exposure_s * _US_PER_S),
        "--gain": None if options.gain is None else f"{options.gain:g}",
        "--awbgains": None if options.awb_gains is None else "{:g},{:g}".format(*options.awb_gains),
        "--flicker-period": None if options.power_line_hz is None else f"{_FLICKER_US[options.power_line_hz]}us",
        **_of_size(options),
        **_of_focus(options),
        **_of_codec(options),
    }
    pairs = [(name, str(value)) for name, value in wanted.items() if value is not None]
    switches = ["--nopreview", "--flush", *(["--inline"] if options.codec == "h264" else [])]
    return [*switches, *(word for pair in pairs for word in pair)]


def _of_size(options: Options) -> dict[str, object]:
    return {} if options.size_px is None else dict(zip(("--width", "--height"), options.size_px, strict=True))


def _of_focus(options: Options) -> dict[str, object]:
    if options.focus is None:
        return {}
    if options.focus == "auto":
        return {"--autofocus-mode": "continuous"}
    return {"--autofocus-mode": "manual", "--lens-position": f"{options.focus:g}"}


def _of_codec(options: Options) -> dict[str, object]:
    if options.codec == "mjpeg":
        return {"--quality": options.quality}
    bits = None if options.bitrate_mbit is None else round(options.bitrate_mbit * 1_000_000)
    return {"--intra": options.key_frame_every, "--bitrate": bits}
