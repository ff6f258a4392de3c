"""Saving a panel: `panel.yaml` and its pictures, whole or not at all, and never over what somebody else has saved."""

from __future__ import annotations

import os
import tempfile
from collections.abc import Mapping
from hashlib import sha256
from pathlib import Path, PurePosixPath

from decoder.errors import OutputError, PanelError


def plain_name(name: str, path: str) -> str:
    """The name of a picture that lies beside its `panel.yaml`.

    Raises
    ------
    PanelError
        If it would lead anywhere else.
    """
    if not name or PurePosixPath(name).name != name or name.startswith(".") or "\\" in name or "\0" in name:
        raise PanelError(path, "must be the plain name of a file beside panel.yaml, such as panel.jpg")
    return name


def save_files(folder: Path, files: Mapping[str, bytes]) -> None:
    """Puts files into a folder, in their order; the last one, `panel.yaml`, when all it names are there.

    Raises
    ------
    OutputError
        If any cannot be written; then `panel.yaml` is as it was.
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


def digest(path: Path) -> str | None:
    """SHA-256 of a file; None if there is none."""
    try:
        return sha256(path.read_bytes()).hexdigest()
    except FileNotFoundError:
        return None
