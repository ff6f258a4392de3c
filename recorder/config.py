"""recorder.yaml: every key with its kind, range and default; checked once, naming the full path of a wrong value.

Paths in it are relative to the file they stand in. The string below a key says what it is for;
docs/reference/recorder.yaml.md is made of these strings.
"""

from __future__ import annotations

import re
from pathlib import Path
from typing import Annotated, Any, Literal, Self

from pydantic import (
    AfterValidator,
    BaseModel,
    BeforeValidator,
    ConfigDict,
    Field,
    ValidationError,
    ValidationInfo,
    model_validator,
)

from camera_drivers.qx10.addresses import BadUrlError, host_of
from flight_file.documents import parse_yaml
from flight_file.errors import NotYamlError
from flight_file.untrusted import read_yaml_file
from recorder.errors import ConfigurationError
from recorder.thresholds import SHOWN_CHARACTERS, SHOWN_ERRORS

_CONTROL = re.compile(r"[\x00-\x1f\x7f-\x9f\u2028\u2029]")  # no name and no sentence of the log is to hold one
_Seconds = Annotated[float, Field(gt=0, le=3600)]
_DRIVERS = ("replay", "qx10")


def _one_line(text: str) -> str:
    if _CONTROL.search(text):
        raise ValueError("it holds a control character")
    return text


def _anchored(path: Path, info: ValidationInfo) -> Path:
    if info.context is None:
        return path  # of a command line, not of a file
    _one_line(str(path))
    base = info.context["base"]
    return path if base is None else base / path


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


AnchoredPath = Annotated[Path, AfterValidator(_anchored)]


_Words = Annotated[str, Field(min_length=1, max_length=100), AfterValidator(_one_line)]


class _Model(BaseModel):
    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False)


class ReplaySettings(_Model):
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
    pace: Literal["realtime", "fastest"] = "realtime"
    """As the pictures were taken, or without waiting, on a clock that jumps from picture to picture."""

    @property
    def paths(self) -> list[Path]:
        """The path or paths as a list."""
        return self.path if isinstance(self.path, list) else [self.path]


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
    url: Annotated[str, Field(max_length=2000), AfterValidator(_one_line), AfterValidator(_http_url)] | None = None
    """Of the camera's description; without it the camera is looked for by SSDP."""
    interface: _Words | None = None
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
    exposure_mode: _Words | None = None
    """As the camera names it: `Program Auto`, `Intelligent Auto` or `Superior Auto`."""
    iso_speed_rate: Annotated[_Words, BeforeValidator(_number_as_text)] | None = None
    """`AUTO`, or 100 to 3200; in Program Auto only."""
    white_balance: _Words | None = None
    """As the camera names it, such as `Daylight`; in Program Auto only."""
    still_size: tuple[_Words, _Words] | None = None
    """Aspect and size, such as `["4:3", "18M"]`."""
    beep_mode: _Words | None = None
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
    segment_mib: Annotated[float, Field(gt=0, le=1_000_000)] = 256.0
    """A file ends before it becomes larger than this, MiB."""
    segment_frames: Annotated[int, Field(gt=0, le=1_000_000)] = 1000
    """A file ends after so many pictures; its index is in memory until then, less than 1 KiB a picture."""
    keep_free_gib: Annotated[float, Field(ge=0, le=1_000_000)] = 2.0
    """When less is free, GiB, the oldest finished segments are deleted."""
    keep_hours: Annotated[float, Field(ge=0, le=1_000_000)] = 5.0
    """The newest so many hours of recording are never deleted, even if the disk runs full."""
    max_hours: Annotated[float, Field(gt=0, le=1_000_000)] | None = None
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
    """What signs each segment, at each chunk and when it is finished; without a key nothing is signed."""

    key: AnchoredPath | None = None
    """The private key, made by `recorder keygen`, which only its owner may read; its public half is for whoever
    verifies."""


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


def parse_config(document: Any, *, base: Path | None = None, name: str = "configuration") -> RecorderConfig:  # noqa: ANN401
    """Check a configuration.

    Parameters
    ----------
    document
        What the YAML says.
    base
        Directory that relative paths are relative to; None leaves them as they are.
    name
        Stands in front of the message.

    Raises
    ------
    ConfigurationError
        With the full path of each wrong value.
    """
    try:
        return RecorderConfig.model_validate(document, context={"base": base})
    except ValidationError as error:
        raise ConfigurationError(f"{name}: {_sentence(error)}.") from error


def load_config(path: Path) -> tuple[RecorderConfig, bytes]:
    """Read recorder.yaml; return the configuration and the file's bytes, which are attached to the flight.

    Raises
    ------
    ConfigurationError
        If the file cannot be read, is no YAML, or a value is wrong.
    """
    try:
        content = read_yaml_file(path)
    except OSError as error:
        raise ConfigurationError(
            f"{path}: cannot be read ({error.strerror}); check its name and permissions."
        ) from error
    return parse_config(checked_yaml(content, path), base=path.parent, name=str(path)), content


def checked_yaml(content: bytes, path: Path) -> Any:  # noqa: ANN401 - it is whatever the file says
    """Parse a YAML file; raises ConfigurationError."""
    try:
        return parse_yaml(content)
    except NotYamlError as error:
        raise ConfigurationError(f"{path}: {error}.") from error


def _sentence(error: ValidationError) -> str:
    found = error.errors(include_url=False)
    parts = [f"{_where(item['loc'])}: {_what(item)}" for item in found[:SHOWN_ERRORS]]
    more = len(found) - SHOWN_ERRORS
    return "; ".join(parts) + (f"; and {more} more" if more > 0 else "")


def _where(location: tuple[int | str, ...]) -> str:
    # The union's tag is pydantic's, not the file's: camera.replay.rate_hz is camera.rate_hz there.
    keys = [
        key for index, key in enumerate(location) if not (index == 1 and location[0] == "camera" and key in _DRIVERS)
    ]
    return ".".join(map(_key, keys)) or "the whole file"


def _key(key: int | str) -> str:
    text = str(key)
    return text if text.replace("_", "").isalnum() and len(text) <= SHOWN_CHARACTERS else _shown(text)


def _shown(value: object) -> str:
    text = repr(value)
    return text if len(text) <= SHOWN_CHARACTERS else text[:SHOWN_CHARACTERS] + "..."


def _what(item: Any) -> str:  # noqa: ANN401 - pydantic's ErrorDetails
    if item["type"] == "extra_forbidden":
        return "there is no such setting"
    if item["type"] == "missing":
        return "is missing"
    message = " ".join(item["msg"].split())[:SHOWN_CHARACTERS]
    message = message[0].lower() + message[1:]
    found = item["input"]
    return f"{message}, got {_shown(found)}" if isinstance(found, str | int | float | bool | None) else message
