"""recorder.yaml: read once, checked once, with the full path of a wrong value in the message.

Paths in it are relative to the file they stand in.
"""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any, Literal, Self

import yaml
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
from recorder.errors import ConfigurationError

_SHOWN_ERRORS = 3  # more than these do not fit a sentence


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
    """A folder of JPEGs, or flight files, as the camera.

    `path` is a folder or a list of flight files; `rate_hz` pictures per second, for folders; `pace` realtime, or
    fastest on a clock that jumps from picture to picture.
    """

    driver: Literal["replay"]
    path: AnchoredPath | list[AnchoredPath]
    rate_hz: Annotated[float, Field(gt=0, le=1000)] | None = None
    pace: Literal["realtime", "fastest"] = "realtime"

    @property
    def paths(self) -> list[Path]:
        """The path or paths."""
        return self.path if isinstance(self.path, list) else [self.path]


_Seconds = Annotated[float, Field(gt=0, le=3600)]


class Qx10Limits(_Model):
    """How long each thing may take on a QX10, seconds; for a camera that turns out to be slower than expected.

    What each is for stands with `camera_drivers.qx10.options.Limits`.
    """

    search_s: _Seconds = 20.0
    connect_s: _Seconds = 5.0
    call_s: _Seconds = 10.0
    shot_s: _Seconds = 90.0
    exposure_s: _Seconds = 180.0
    download_s: _Seconds = 60.0
    event_s: _Seconds = 90.0
    ready_s: _Seconds = 60.0
    settle_s: _Seconds = 5.0
    zoom_s: _Seconds = 15.0
    stall_s: _Seconds = 10.0
    picture_mib: Annotated[int, Field(gt=0, le=256)] = 32


class Qx10Settings(_Model):
    """A Sony DSC-QX10; `interval_s` seconds between stills, 0 for as fast as it can.

    What is None stays as the camera has it. `exposure_compensation` counts the camera's steps of a third of an EV.
    """

    driver: Literal["qx10"]
    url: Annotated[str, AfterValidator(_http_url)] | None = None
    interface: str | None = None
    mode: Literal["stills", "liveview"] = "stills"
    interval_s: Annotated[float, Field(ge=0, le=3600)] = 2.0
    picture: Literal["Original", "2M"] = "Original"
    zoom: Literal["wide", "tele", "leave"] | Annotated[float, Field(gt=0)] = "leave"
    exposure_compensation: Annotated[int, Field(ge=-6, le=6)] | None = None
    exposure_mode: str | None = None
    iso_speed_rate: Annotated[str, BeforeValidator(_number_as_text)] | None = None
    white_balance: str | None = None
    still_size: tuple[str, str] | None = None
    beep_mode: str | None = None
    set_clock: bool = True
    long_poll: bool = True
    limits: Qx10Limits = Qx10Limits()


class StorageSettings(_Model):
    """Where recordings go, and how long they stay.

    A segment ends after `segment_s` seconds or `segment_mib` MiB. When less than `keep_free_gib` GiB are free, or there
    are more than `max_hours` hours of recording, the oldest segments are deleted, but never the newest `keep_hours`.
    """

    directory: AnchoredPath
    segment_s: Annotated[float, Field(gt=0, le=86400)] = 60.0
    segment_mib: Annotated[float, Field(gt=0)] = 256.0
    keep_free_gib: Annotated[float, Field(ge=0)] = 2.0
    keep_hours: Annotated[float, Field(ge=0)] = 5.0
    max_hours: Annotated[float, Field(gt=0)] | None = None

    @model_validator(mode="after")
    def _hours_fit(self) -> Self:
        if self.max_hours is not None and self.max_hours < self.keep_hours:
            raise ValueError("max_hours must not be less than keep_hours")
        return self


class AttachSettings(_Model):
    """Files that are carried inside every segment."""

    panel: AnchoredPath | None = None
    camera: AnchoredPath | None = None


class EvidenceSettings(_Model):
    """The private key that signs each finished segment, made by `recorder keygen`; without one nothing is signed."""

    key: AnchoredPath | None = None


class RecorderConfig(_Model):
    """All of recorder.yaml."""

    camera: Annotated[ReplaySettings | Qx10Settings, Field(discriminator="driver")]
    storage: StorageSettings
    attach: AttachSettings = AttachSettings()
    evidence: EvidenceSettings = EvidenceSettings()


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
    """Read recorder.yaml; gives the configuration and the file's own bytes, which are attached to the flight.

    Raises
    ------
    ConfigurationError
        If the file cannot be read, is no YAML, or a value is wrong.
    """
    try:
        content = path.read_bytes()
    except OSError as error:
        raise ConfigurationError(
            f"{path}: cannot be read ({error.strerror}); check its name and permissions."
        ) from error
    return parse_config(parse_yaml(content, path), base=path.parent, name=str(path)), content


def parse_yaml(content: bytes, path: Path) -> Any:  # noqa: ANN401 - it is whatever the file says
    """The document in a YAML file; raises ConfigurationError."""
    try:
        return yaml.safe_load(content)
    except (yaml.YAMLError, UnicodeDecodeError) as error:
        mark = getattr(error, "problem_mark", None)
        where = f"line {mark.line + 1}" if mark else "the file"
        problem = getattr(error, "problem", None) or "it is not UTF-8 text"
        raise ConfigurationError(f"{path}: {where} is not YAML ({problem}); correct it.") from error


def _sentence(error: ValidationError) -> str:
    found = error.errors(include_url=False)
    parts = [f"{_where(item['loc'])}: {_what(item)}" for item in found[:_SHOWN_ERRORS]]
    more = len(found) - _SHOWN_ERRORS
    return "; ".join(parts) + (f"; and {more} more" if more > 0 else "")


def _where(location: tuple[int | str, ...]) -> str:
    # The union's tag is pydantic's, not the file's: camera.replay.rate_hz is camera.rate_hz there.
    keys = [
        key for index, key in enumerate(location) if not (index == 1 and location[0] == "camera" and key in _DRIVERS)
    ]
    return ".".join(map(str, keys)) or "the whole file"


_DRIVERS = ("replay", "qx10")


def _what(item: Any) -> str:  # noqa: ANN401 - pydantic's ErrorDetails
    if item["type"] == "extra_forbidden":
        return "there is no such setting"
    if item["type"] == "missing":
        return "is missing"
    message = item["msg"][0].lower() + item["msg"][1:]
    shown = item["input"]
    return f"{message}, got {shown!r}" if isinstance(shown, str | int | float | bool | None) else message
