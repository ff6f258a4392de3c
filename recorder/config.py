"""recorder.yaml: read once, checked once, with the full path of a wrong value in the message.

Paths in it are relative to the file they stand in.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import yaml
from pydantic import ValidationError

from recorder.errors import ConfigurationError
from recorder.settings import RecorderConfig

_SHOWN_ERRORS = 3  # more than these do not fit a sentence


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
