"""The files that travel inside every segment: panel.yaml and its pictures, camera.yaml, recorder.yaml.

The panel is not understood here, only searched for the pictures it names: every value of a key `picture`, at any depth.
"""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path, PurePosixPath
from typing import Any

from recorder.config import parse_yaml
from recorder.errors import ConfigurationError
from recorder.settings import AttachSettings

PANEL = "panel.yaml"
CAMERA = "camera.yaml"
CONFIGURATION = "recorder.yaml"

MAX_ATTACHMENT_BYTES = 64 * 2**20  # every segment carries them all; no panel picture comes near


def gather_attachments(settings: AttachSettings, configuration: bytes) -> dict[str, bytes]:
    """Content by name.

    Parameters
    ----------
    settings
        The files to attach.
    configuration
        Bytes of recorder.yaml; empty for a recording that has none.

    Raises
    ------
    ConfigurationError
        A file cannot be read, is too large, or a panel names a picture outside of its own folder.
    """
    attachments = {}
    if settings.panel is not None:
        panel = _read(settings.panel, "attach.panel")
        attachments[PANEL] = panel
        for name in sorted(set(_pictures(parse_yaml(panel, settings.panel)))):
            attachments[name] = _read(settings.panel.parent / _inside(name, settings.panel), "attach.panel")
    if settings.camera is not None:
        attachments[CAMERA] = _read(settings.camera, "attach.camera")
    if configuration:
        attachments[CONFIGURATION] = configuration
    return attachments


def _pictures(node: Any) -> Iterator[str]:  # noqa: ANN401 - a YAML document
    if isinstance(node, dict):
        for key, value in node.items():
            if key == "picture" and isinstance(value, str):
                yield value
            else:
                yield from _pictures(value)
    elif isinstance(node, list):
        for value in node:
            yield from _pictures(value)


def _inside(name: str, panel: Path) -> str:
    # The name is the attachment's name too: it has to mean the same wherever the flight is unpacked.
    parts = PurePosixPath(name).parts
    if PurePosixPath(name).is_absolute() or ".." in parts or name in (PANEL, CAMERA, CONFIGURATION):
        raise ConfigurationError(f"{panel}: picture {name!r} must lie in the panel's folder or below; move it there.")
    return name


def _read(path: Path, setting: str) -> bytes:
    try:
        size = path.stat().st_size
        if size > MAX_ATTACHMENT_BYTES:
            raise ConfigurationError(f"{setting}: {path} is larger than 64 MiB; attach a smaller file.")
        return path.read_bytes()
    except OSError as error:
        raise ConfigurationError(f"{setting}: {path} cannot be read ({error.strerror}); check its name.") from error
