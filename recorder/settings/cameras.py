"""The block `camera` of recorder.yaml, one model for each driver; the string below a key says what it is for."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Literal, Self, get_args

from pydantic import AfterValidator, BeforeValidator, Field, model_validator

from camera_drivers.qx10.addresses import BadUrlError, host_of
from camera_drivers.rtsp.options import BadAddressError, checked_address
from recorder.settings.values import AnchoredPath, Seconds, Settings, WithheldError, Words, one_line

_MAX_URL_CHARACTERS = 2000


def _number_as_text(value: object) -> object:
    # The camera wants "400" where YAML reads a number; a person must not need to know.
    return str(value) if isinstance(value, int) and not isinstance(value, bool) else value


def _http_url(url: str) -> str:
    try:
        host = host_of(url)
        host.encode("idna")  # a name with a part of no letter or of too many could be looked up nowhere
    except (BadUrlError, UnicodeError) as error:
        raise ValueError("it is no http URL") from error
    return url


_HttpUrl = Annotated[str, Field(max_length=_MAX_URL_CHARACTERS), AfterValidator(one_line), AfterValidator(_http_url)]


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


class Qx10Limits(Settings):
    """How long each thing may take on a QX10, seconds; for a camera that turns out to be slower than expected."""

    search_s: Seconds = 20.0
    """Looking for the camera on the network."""
    connect_s: Seconds = 5.0
    """Until a connection stands."""
    call_s: Seconds = 10.0
    """An ordinary call."""
    shot_s: Seconds = 90.0
    """Taking a picture: focus, exposure and processing."""
    exposure_s: Seconds = 180.0
    """Until a picture that was not finished in the first answer has an address."""
    download_s: Seconds = 60.0
    """Fetching a picture."""
    event_s: Seconds = 90.0
    """A call that waits for news."""
    ready_s: Seconds = 60.0
    """Until the camera is idle."""
    settle_s: Seconds = 5.0
    """Until a setting can be read back."""
    zoom_s: Seconds = 15.0
    """From one end of the zoom to the other."""
    stall_s: Seconds = 10.0
    """Without a liveview picture."""
    picture_mib: Annotated[int, Field(gt=0, le=256)] = 32
    """The largest picture that is taken for one, MiB."""


class Qx10Settings(Settings):
    """A Sony DSC-QX10; what is left out and has no value here stays as the camera has it."""

    driver: Literal["qx10"]
    """A Sony DSC-QX10."""
    url: (
        Annotated[str, Field(max_length=_MAX_URL_CHARACTERS), AfterValidator(one_line), AfterValidator(_http_url)]
        | None
    ) = None
    """Of the camera's description; without it the camera is looked for by SSDP."""
    interface: Words | None = None
    """The network interface on which it is looked for, such as `wlan0`; without it the system chooses."""
    mode: Literal["stills", "liveview"] = "stills"
    """Stills, or liveview: 640 x 480 pixels, about 14 a second."""
    interval_s: Annotated[float, Field(ge=0, le=3600)] = 2.0
    """Seconds from one still to the next; 0 is as fast as the camera can."""
    picture: Literal["Original", "2M"] = "Original"
    """All pixels, or about two megapixels, which is faster."""
    zoom: Literal["wide", "tele", "leave"] | Annotated[float, Field(gt=0, le=1000)] = "leave"
    """An end of the zoom, `leave` it as it is, or a focal length in mm (4.45 to 44.5)."""
    exposure_compensation: Annotated[int, Field(ge=-6, le=6)] | None = None
    """In the camera's steps of a third of an EV; in Program Auto only."""
    exposure_mode: Words | None = None
    """As the camera names it: `Program Auto`, `Intelligent Auto` or `Superior Auto`."""
    iso_speed_rate: Annotated[Words, BeforeValidator(_number_as_text)] | None = None
    """`AUTO`, or 100 to 3200; in Program Auto only."""
    white_balance: Words | None = None
    """As the camera names it, such as `Daylight`; in Program Auto only."""
    still_size: tuple[Words, Words] | None = None
    """Aspect and size, such as `["4:3", "18M"]`."""
    beep_mode: Words | None = None
    """`On`, `Off` or `Shutter Only`."""
    set_clock: bool = True
    """Whether the camera's clock is set to UTC at each connection."""
    long_poll: bool = True
    """Whether a call that waits for news is kept open, so that the Wi-Fi is never idle."""
    limits: Qx10Limits = Qx10Limits()
    """How long each thing may take."""


class LiveSettings(Settings):
    """What all cameras have that send pictures by themselves."""

    stall_s: Seconds = 10.0
    """Without a picture for so long, the camera is connected again."""
    frozen_s: Seconds = 30.0
    """With the very same picture for so long, the camera is connected again."""


_Size = tuple[Annotated[int, Field(gt=0, le=32_766)], Annotated[int, Field(gt=0, le=32_766)]]
_Rate = Annotated[float, Field(ge=0.1, le=240)]
_Interval = Annotated[float, Field(ge=0, le=3600)]
_Exposure = Literal["auto"] | Annotated[float, Field(gt=0, le=60)]


class UvcSettings(LiveSettings):
    """A USB camera, or another Video4Linux device that sends JPEGs; what is left out stays as the camera has it."""

    driver: Literal["uvc"]
    """A USB camera."""
    device: Annotated[str, Field(pattern=r"^/dev/", max_length=300), AfterValidator(one_line)]
    """The device file. Those in `/dev/v4l/by-id` keep their names when other cameras are plugged in."""
    size_px: _Size | None = None
    """Width and height; without it the largest that the camera has."""
    rate_hz: _Rate | None = None
    """Pictures a second that the camera makes."""
    interval_s: _Interval = 0.0
    """Seconds from one picture that is kept to the next; 0 keeps all."""
    exposure_s: _Exposure | None = None
    """Held at so many seconds, or `auto`."""
    focus: Literal["auto"] | Annotated[int, Field(ge=0, le=100_000)] | None = None
    """Held at this step of the camera's own, or `auto`."""
    white_balance_k: Literal["auto"] | Annotated[int, Field(gt=0, le=100_000)] | None = None
    """Held at so many kelvin, or `auto`."""
    gain: Annotated[int, Field(ge=0, le=100_000)] | None = None
    """In the camera's own steps."""
    power_line_hz: Literal[0, 50, 60] | None = None
    """Of the lamps whose flicker is to be avoided; 0 for none."""


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
    size_px: _Size | None = None
    """Width and height."""
    rate_hz: _Rate | None = None
    """Pictures a second that the camera makes."""
    interval_s: _Interval = 0.0
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


def _rtsp_url(url: object) -> str:
    """Refuse what is no address, or holds a password, without ever repeating it."""
    try:
        if isinstance(url, str) and len(url) <= _MAX_URL_CHARACTERS:
            return checked_address(url)
        why = "it is no rtsp URL"
    except BadAddressError as error:
        why = str(error)
    raise WithheldError(why)


class RtspSettings(LiveSettings):
    """An IP camera that sends H.264 or H.265 over RTSP; needs the extra `video`."""

    driver: Literal["rtsp"]
    """An IP camera."""
    url: Annotated[str, BeforeValidator(_rtsp_url)]
    """Of its stream, such as `rtsp://192.168.1.20:554/stream1`, without user and password."""
    credentials: AnchoredPath | None = None
    """A file with one line, `user:password`, that the recorder can read; it is never attached."""
    latency_s: Annotated[float, Field(gt=0, le=10)] = 0.5
    """How long the camera may take from exposure to sending. Its own clock is believed if it is behind the box's by no
    more than this, and not ahead."""
    open_s: Seconds = 15.0
    """How long connecting may take."""


CameraSettings = ReplaySettings | Qx10Settings | UvcSettings | PicameraSettings | RtspSettings
DRIVERS = tuple(get_args(model.model_fields["driver"].annotation)[0] for model in get_args(CameraSettings))
"""Their names, as `camera.driver` has them."""
