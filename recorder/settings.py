"""What may stand in recorder.yaml: every key with its kind, its range and its default.

The string below a key says what it is for; docs/reference/recorder.yaml.md is made of them.
"""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Literal, Self

from pydantic import AfterValidator, BaseModel, BeforeValidator, ConfigDict, Field, ValidationInfo, model_validator

from camera_drivers.qx10.addresses import BadUrlError, host_of


def _anchored(path: Path, info: ValidationInfo) -> Path:
    base = (info.context or {}).get("base")
    return path if base is None else base / path


def _number_as_text(value: object) -> object:
    # The camera wants "400" where YAML reads a number; a person must not need to know.
    return str(value) if isinstance(value, int) and not isinstance(value, bool) else value


def _http_url(url: str) -> str:
    try:
        host_of(url)
    except BadUrlError as error:
        raise ValueError("it is no http URL") from error
    return url


AnchoredPath = Annotated[Path, AfterValidator(_anchored)]


class _Model(BaseModel):
    model_config = ConfigDict(extra="forbid", frozen=True)


class ReplaySettings(_Model):
    """A folder of JPEGs, or flight files, as the camera."""

    driver: Literal["replay"]
    """Pictures that are there already."""
    path: AnchoredPath | list[AnchoredPath]
    """A folder of JPEGs, taken in the order of their names, or a list of flight files."""
    rate_hz: Annotated[float, Field(gt=0, le=1000)] | None = None
    """Pictures a second, for folders; flight files have their own times."""
    pace: Literal["realtime", "fastest"] = "realtime"
    """As the pictures were taken, or without waiting, on a clock that jumps from picture to picture."""

    @property
    def paths(self) -> list[Path]:
        """The path or paths."""
        return self.path if isinstance(self.path, list) else [self.path]


_Seconds = Annotated[float, Field(gt=0, le=3600)]


class Qx10Limits(_Model):
    """How long each thing may take on a QX10, seconds; for a camera that turns out to be slower than expected."""

    search_s: _Seconds = 20.0
    """Looking for the camera on the network."""
    connect_s: _Seconds = 5.0
    """Until a connection stands."""
    call_s: _Seconds = 10.0
    """An ordinary call."""
    shot_s: _Seconds = 90.0
    """Taking a picture: focus, exposure and processing."""
    exposure_s: _Seconds = 180.0
    """Until a picture that was not finished in the first answer has an address."""
    download_s: _Seconds = 60.0
    """Fetching a picture."""
    event_s: _Seconds = 90.0
    """A call that waits for news."""
    ready_s: _Seconds = 60.0
    """Until the camera is idle."""
    settle_s: _Seconds = 5.0
    """Until a setting can be read back."""
    zoom_s: _Seconds = 15.0
    """From one end of the zoom to the other."""
    stall_s: _Seconds = 10.0
    """Without a liveview picture."""
    picture_mib: Annotated[int, Field(gt=0, le=256)] = 32
    """The largest picture that is taken for one, MiB."""


class Qx10Settings(_Model):
    """A Sony DSC-QX10; what is left out and has no value here stays as the camera has it."""

    driver: Literal["qx10"]
    """A Sony DSC-QX10."""
    url: Annotated[str, AfterValidator(_http_url)] | None = None
    """Of the camera's description; without it the camera is looked for by SSDP."""
    interface: str | None = None
    """The network interface on which it is looked for, such as `wlan0`; without it the system chooses."""
    mode: Literal["stills", "liveview"] = "stills"
    """Stills, or liveview: 640 x 480 pixels, about 14 a second."""
    interval_s: Annotated[float, Field(ge=0, le=3600)] = 2.0
    """Seconds from one still to the next; 0 is as fast as the camera can."""
    picture: Literal["Original", "2M"] = "Original"
    """All pixels, or about two megapixels, which is faster."""
    zoom: Literal["wide", "tele", "leave"] | Annotated[float, Field(gt=0)] = "leave"
    """An end of the zoom, `leave` it as it is, or a focal length in mm (4.45 to 44.5)."""
    exposure_compensation: Annotated[int, Field(ge=-6, le=6)] | None = None
    """In the camera's steps of a third of an EV; in Program Auto only."""
    exposure_mode: str | None = None
    """As the camera names it: `Program Auto`, `Intelligent Auto` or `Superior Auto`."""
    iso_speed_rate: Annotated[str, BeforeValidator(_number_as_text)] | None = None
    """`AUTO`, or 100 to 3200; in Program Auto only."""
    white_balance: str | None = None
    """As the camera names it, such as `Daylight`; in Program Auto only."""
    still_size: tuple[str, str] | None = None
    """Aspect and size, such as `["4:3", "18M"]`."""
    beep_mode: str | None = None
    """`On`, `Off` or `Shutter Only`."""
    set_clock: bool = True
    """Whether the camera's clock is set to UTC at each connection."""
    long_poll: bool = True
    """Whether a call that waits for news is kept open, so that the Wi-Fi is never idle."""
    limits: Qx10Limits = Qx10Limits()
    """How long each thing may take."""


class StorageSettings(_Model):
    """Where recordings go, and how long they stay; hours are hours of recording, whatever a clock says."""

    directory: AnchoredPath
    """Where the recordings go."""
    segment_s: Annotated[float, Field(gt=0, le=86400)] = 60.0
    """A file ends after so many seconds."""
    segment_mib: Annotated[float, Field(gt=0)] = 256.0
    """A file ends before it becomes larger than this, MiB."""
    keep_free_gib: Annotated[float, Field(ge=0)] = 2.0
    """When less is free, GiB, the oldest finished segments are deleted."""
    keep_hours: Annotated[float, Field(ge=0)] = 5.0
    """The newest so many hours of recording are never deleted, even if the disk runs full."""
    max_hours: Annotated[float, Field(gt=0)] | None = None
    """Segments with more than so many hours of recording after them are deleted even if there is room; not less than
    `keep_hours`. Without it there is no limit."""

    @model_validator(mode="after")
    def _hours_fit(self) -> Self:
        if self.max_hours is not None and self.max_hours < self.keep_hours:
            raise ValueError("max_hours must not be less than keep_hours")
        return self


class AttachSettings(_Model):
    """Files that are carried inside every segment."""

    panel: AnchoredPath | None = None
    """The panel; it brings the pictures that it names."""
    camera: AnchoredPath | None = None
    """The camera's calibration, `camera.yaml`."""


class EvidenceSettings(_Model):
    """What signs each finished segment; without a key nothing is signed."""

    key: AnchoredPath | None = None
    """The private key, made by `recorder keygen`; its public half is for whoever verifies."""


class RecorderConfig(_Model):
    """All of recorder.yaml."""

    camera: Annotated[ReplaySettings | Qx10Settings, Field(discriminator="driver")]
    """Where the pictures come from; `driver` says which of the two it is."""
    storage: StorageSettings
    """Where they go."""
    attach: AttachSettings = AttachSettings()
    """What travels with them."""
    evidence: EvidenceSettings = EvidenceSettings()
    """What signs them."""
