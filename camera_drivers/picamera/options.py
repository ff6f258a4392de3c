"""What the driver can be told, and the command line of rpicam-vid that it makes of that.

Source: rpicam-apps, core/options.cpp and core/video_options.hpp. Its predecessor libcamera-vid takes the same, but for
`--flicker-period`, which is younger.
"""

from __future__ import annotations

from typing import Annotated, Literal, Self

from pydantic import Field, model_validator

from camera_drivers.settings import Interval, LiveSettings, Rate, Size, Words

_US_PER_S = 1_000_000
_FLICKER_US = {0: 0, 50: 10_000, 60: 8_333}


class PicameraSettings(LiveSettings):
    """A Raspberry Pi's own camera, by `rpicam-vid`; what is left out and has no value here is up to that."""

    driver: Literal["picamera"]
    """A Raspberry Pi's own camera."""
    program: Words = "rpicam-vid"
    """The program, or its path; `libcamera-vid` on older systems."""
    index: Annotated[int, Field(ge=0, le=15)] = 0
    """Which camera, as `rpicam-hello --list-cameras` counts them."""
    codec: Literal["mjpeg", "h264"] = "mjpeg"
    """JPEGs, each by itself, or H.264, which takes less room."""
    size_px: Size | None = None
    """Width and height."""
    rate_hz: Rate | None = None
    """Pictures a second that the camera makes."""
    interval_s: Interval = 0.0
    """Seconds from one picture that is kept to the next; 0 keeps all, as H.264 needs it."""
    quality: Annotated[int, Field(ge=1, le=100)] = 90
    """Of the JPEGs."""
    bitrate_mbit: Annotated[float, Field(gt=0, le=1000)] | None = None
    """Of H.264, megabits a second."""
    key_frame_every: Annotated[int, Field(ge=1, le=1000)] = 30
    """Of H.264: one frame in so many can be read without those before it."""
    exposure_s: Annotated[float, Field(gt=0, le=200)] | None = None
    """Held at so many seconds."""
    gain: Annotated[float, Field(ge=1, le=1000)] | None = None
    """Held at this factor."""
    awb_gains: tuple[Annotated[float, Field(gt=0, le=100)], Annotated[float, Field(gt=0, le=100)]] | None = None
    """Factors of red and blue, held."""
    focus: Literal["auto"] | Annotated[float, Field(ge=0, le=100)] | None = None
    """Held at so many dioptres, 1 / distance in metres; or `auto`."""
    power_line_hz: Literal[0, 50, 60] | None = None
    """Of the lamps whose flicker is to be avoided; 0 for none."""
    rotation_deg: Literal[0, 180] = 0
    """180 for a camera that is mounted upside down."""

    @model_validator(mode="after")
    def _keeps_all(self) -> Self:
        if self.codec == "h264" and self.interval_s:
            raise ValueError("interval_s is for mjpeg: pictures of h264 are built on each other")
        return self


def arguments(options: PicameraSettings, metadata: str) -> list[str]:
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


def _of_size(options: PicameraSettings) -> dict[str, object]:
    return {} if options.size_px is None else dict(zip(("--width", "--height"), options.size_px, strict=True))


def _of_focus(options: PicameraSettings) -> dict[str, object]:
    if options.focus is None:
        return {}
    if options.focus == "auto":
        return {"--autofocus-mode": "continuous"}
    return {"--autofocus-mode": "manual", "--lens-position": f"{options.focus:g}"}


def _of_codec(options: PicameraSettings) -> dict[str, object]:
    if options.codec == "mjpeg":
        return {"--quality": options.quality}
    bits = None if options.bitrate_mbit is None else round(options.bitrate_mbit * 1_000_000)
    return {"--intra": options.key_frame_every, "--bitrate": bits}
