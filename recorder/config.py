"""The keys of recorder.yaml with types, ranges and defaults, checked once; errors name the full path of a value.

Paths are relative to the file that contains them. The string below a key says what it is for;
docs/reference/recorder.yaml.md is made of these strings.
"""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any, Self

from pydantic import Field, ValidationError, model_validator

from camera_drivers.picamera.options import PicameraSettings
from camera_drivers.qx10.options import Qx10Settings
from camera_drivers.replay.options import ReplaySettings
from camera_drivers.rtsp.options import RtspSettings
from camera_drivers.settings import AnchoredPath, Settings, WithheldError
from camera_drivers.uvc.options import UvcSettings
from flight_file.documents import parse_yaml
from flight_file.errors import NotYamlError
from flight_file.untrusted import read_yaml_file
from recorder.errors import ConfigurationError
from recorder.thresholds import SHOWN_CHARACTERS, SHOWN_ERRORS

CameraSettings = ReplaySettings | Qx10Settings | UvcSettings | PicameraSettings | RtspSettings


class StorageSettings(Settings):
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


class AttachSettings(Settings):
    """Files that are carried inside every segment."""

    panel: AnchoredPath | None = None
    """The panel; it brings the pictures that it names."""
    camera: AnchoredPath | None = None
    """The camera's calibration, `camera.yaml`."""


class EvidenceSettings(Settings):
    """What signs each segment, at each chunk and when it is finished; without a key nothing is signed."""

    key: AnchoredPath | None = None
    """The private key, made by `recorder keygen`, which only its owner may read; its public half is for whoever
    verifies."""


class RecorderConfig(Settings):
    """All of recorder.yaml."""

    camera: Annotated[CameraSettings, Field(discriminator="driver")]
    """Where the pictures come from; `driver` says which of these it is."""
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
        Prefix of the message.

    Raises
    ------
    ConfigurationError
        With the full path of each wrong value.
    """
    try:
        return RecorderConfig.model_validate(document, context={"base": base})
    except ValidationError as error:
        raise ConfigurationError(f"{name}: {_sentence(error, document)}.") from error


def load_config(path: Path) -> tuple[RecorderConfig, bytes]:
    """Read recorder.yaml; return the configuration and the file's bytes, which are attached to the flight.

    Raises
    ------
    ConfigurationError
        If the file cannot be read, is not YAML, or a value is wrong.
    """
    try:
        content = read_yaml_file(path)
    except OSError as error:
        reason = f"cannot be read ({error.strerror}); check its name and permissions, and that its disk is there"
        raise ConfigurationError(f"{path}: {reason}.") from error
    return parse_config(checked_yaml(content, path), base=path.parent, name=str(path)), content


def checked_yaml(content: bytes, path: Path) -> Any:  # noqa: ANN401 - it is whatever the file says
    """Parse a YAML file; raises ConfigurationError."""
    try:
        return parse_yaml(content)
    except NotYamlError as error:
        raise ConfigurationError(f"{path}: {error}.") from error


def _sentence(error: ValidationError, document: object) -> str:
    found = error.errors(include_url=False)
    parts = [f"{_where(item, document)}: {_what(item)}" for item in found[:SHOWN_ERRORS]]
    more = len(found) - SHOWN_ERRORS
    return "; ".join(parts) + (f"; and {more} more" if more > 0 else "")


def _where(item: Any, document: Any) -> str:  # noqa: ANN401 - pydantic's ErrorDetails, and whatever the file says
    """Name the place as the file does, without the kinds of value that pydantic tried there."""
    *above, last = item["loc"] or ("",)
    keys, node = [], document
    for key in above:
        if _has(node, key):
            keys.append(key)
            node = node[key]
    if _has(node, last) or item["type"] == "missing":
        keys.append(last)
    return ".".join(map(_key, keys)) or "the whole file"


def _has(node: object, key: int | str) -> bool:
    return key in node if isinstance(node, dict) else isinstance(node, list) and isinstance(key, int)


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
    if item["type"] == "path_type":
        item["msg"] = "it is no path"
    message = " ".join(item["msg"].split())[:SHOWN_CHARACTERS]
    message = message[0].lower() + message[1:]
    if isinstance(item.get("ctx", {}).get("error"), WithheldError):
        return message
    found = item["input"]
    return f"{message}, got {_shown(found)}" if isinstance(found, str | int | float | bool | None) else message
