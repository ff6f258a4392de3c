"""Saving a panel: `panel.yaml` as a person would write it, and its pictures, atomically."""

from __future__ import annotations

import json
import os
import tempfile
from collections.abc import Mapping
from contextlib import suppress
from dataclasses import dataclass
from hashlib import sha256
from itertools import chain, count
from pathlib import Path
from typing import Any

import yaml

from decoder.panel.errors import OutputError, PanelError
from decoder.panel.gauge import KINDS
from flight_file.thresholds import MAX_YAML_BYTES
from flight_file.untrusted import file_name, name_key, read_beside, read_regular

PLACES = 4
HEAD = (
    "# Drawn with `decode setup`; docs/panel.md says what each key means.\n"
    "# Pixels are (x, y) in the panel picture, angles degrees clockwise from the right.\n"
)
BLOCKS = ("reference_points", "anchors", "gauges")
ORDER = ("name", "picture", "focal_length_mm", "reference_points", "level", "anchors", "gauges", "columns")
WHERE = ("name", "window", "centre", "radius", "rim", "needle_height_inches", "sweep", "stops")
DIAL_ORDER = (*WHERE, "unit", "scale", "wraps", "tail", "combined")
GAUGE_ORDER = (*DIAL_ORDER, *(kind.form.key for kind in KINDS))

OTHERS = ("panel.yaml", "camera.yaml", "recorder.yaml")


def panel_text(document: Mapping[str, Any]) -> str:
    """Write a `panel.yaml`."""
    lines = [HEAD.rstrip("\n")]
    for key in _ordered(document, ORDER):
        value = document[key]
        if key in BLOCKS and isinstance(value, list) and value:
            lines.append(f"{key}:")
            for item in value:
                lines += _gauge(item) if key == "gauges" else [f"  - {_flow(item)}"]
        else:
            lines.append(f"{_flow(key)}: {_flow(value)}")
    return "\n".join(lines) + "\n"


def _gauge(gauge: Mapping[str, Any]) -> list[str]:
    lines = []
    for key in _ordered(gauge, GAUGE_ORDER):
        value = gauge[key]
        if isinstance(value, list) and any(isinstance(each, Mapping) for each in value):
            lines += [f"    {_flow(key)}:", *(f"      - {_flow(each)}" for each in value)]
        else:
            lines.append(f"    {_flow(key)}: {_flow(value)}")
    return ["  - " + lines[0].lstrip(), *lines[1:]]


def _ordered(content: Mapping[str, Any], order: tuple[str, ...]) -> list[str]:
    return [key for key in order if key in content] + [key for key in content if key not in order]


def _flow(value: object) -> str:
    """Write a value on one line."""
    text: str = yaml.safe_dump(_plain(value), default_flow_style=True, width=10**9, allow_unicode=True, sort_keys=False)
    return text.strip().removesuffix("...").strip()


def _plain(value: object) -> object:
    if isinstance(value, float):
        return int(value) if value == int(value) else round(value, PLACES)
    if isinstance(value, Mapping):
        return {key: _plain(each) for key, each in value.items()}
    if isinstance(value, list | tuple):
        return [_plain(each) for each in value]
    return value


def plain_name(name: str, path: str, *, target: str = OTHERS[0]) -> str:
    """Check the name of a picture beside its `panel.yaml`, which is called `target`.

    Raises
    ------
    PanelError
        If it would lead anywhere else, or is the name of another file there.
    """
    if not name or file_name(name) != name:
        raise PanelError(path, "must be the plain name of a file beside panel.yaml, such as panel.jpg")
    if name_key(name) in {*OTHERS, name_key(target)}:
        raise PanelError(path, f"cannot be {name}: that file holds no picture; call it panel.jpg, say")
    return name


def free_picture(folder: Path, usual: str) -> str:
    """Name a picture that nothing in the folder is called yet: `usual`, or that with a number."""
    plain = Path(usual)
    numbered = (f"{plain.stem}_{number}{plain.suffix}" for number in count(2))
    return next(name for name in chain((usual,), numbered) if not os.path.lexists(folder / name))


def save_files(folder: Path, files: Mapping[str, bytes]) -> None:
    """Write files into a folder, in order; the last one, `panel.yaml`, once all it names are there.

    Raises
    ------
    OutputError
        If any cannot be written; then `panel.yaml` is unchanged.
    """
    parts: list[tuple[Path, Path]] = []
    try:
        folder.mkdir(parents=True, exist_ok=True)
        for name, content in files.items():
            with tempfile.NamedTemporaryFile(dir=folder, prefix=f".{name}.", suffix=".part", delete=False) as stream:
                parts.append((Path(stream.name), folder / name))
                stream.write(content)
                stream.flush()
                os.fsync(stream.fileno())
        for part, final in parts:
            part.chmod(0o644)
            part.replace(final)
    except OSError as error:
        raise OutputError(
            f"{folder}: the panel cannot be saved: {error.strerror}; make room or choose --panel"
        ) from error
    finally:
        for part, _ in parts:
            part.unlink(missing_ok=True)


@dataclass(frozen=True, slots=True)
class Draft:
    """What was drawn but not saved yet: a document, and the key of the picture it is drawn on."""

    document: dict[str, Any]
    picture: str


class DraftFile:
    """Keeps a draft beside where it will be saved, so that nothing is lost when the program ends.

    Parameters
    ----------
    target
        Where the panel is saved.
    flight
        What it is drawn on; drafts of other flights are ignored.
    """

    def __init__(self, target: Path, flight: str) -> None:
        self._path, self._flight = target.with_name(f".{target.name}.draft"), flight

    def read(self) -> Draft | None:
        """Return the stored draft; None if there is none, or none that can be continued."""
        try:
            kept = json.loads(read_regular(self._path, limit_bytes=MAX_YAML_BYTES, through_links=False))
            document, picture = kept["document"], kept["picture"]
        except (OSError, ValueError, KeyError, TypeError, RecursionError):
            return None
        is_one = kept["flight"] == self._flight and isinstance(document, dict) and isinstance(picture, str)
        return Draft(document, picture) if is_one else None

    def keep(self, draft: Draft) -> None:
        """Write it; if the folder is not writable nothing is stored, and saving will report it."""
        kept = {"flight": self._flight, "document": draft.document, "picture": draft.picture}
        with suppress(OutputError):
            save_files(self._path.parent, {self._path.name: json.dumps(kept).encode()})

    def drop(self) -> None:
        """Remove it."""
        with suppress(OSError):
            self._path.unlink(missing_ok=True)


def digest(path: Path) -> str | None:
    """Return the SHA-256 of a file; None if there is nothing, "" if it is nothing that a panel's file could be."""
    if not path.exists() and not path.is_symlink():
        return None
    try:
        return sha256(read_beside(path.parent, path.name)).hexdigest()
    except OSError:
        return ""
