"""Writing camera.yaml: new measurements replace old ones in what is already known, atomically."""

from __future__ import annotations

from pathlib import Path
from typing import IO, Any

import yaml

from decoder.outputs.outputs import as_text, write_all
from decoder.panel.camera import Camera, camera_from_file, parse_camera
from decoder.panel.errors import CameraError

HEADER = "# The camera, written by `decode calibrate`; docs/calibration.md describes it.\n"
DIGITS = 10


def known_camera(path: Path) -> Camera | None:
    """Read a camera's file, None if there is no file.

    Raises
    ------
    CameraError
        If the file is not a camera.
    """
    return camera_from_file(path) if path.exists() else None


def merged(known: Camera | None, **new: Any) -> Camera:  # noqa: ANN401 - any part of a camera
    """Replace some parts of a camera; `distortion` replaces the entries for its own focal lengths only.

    Raises
    ------
    CameraError
        If the parts contradict each other.
    """
    parts = {} if known is None else known.model_dump()
    if known is not None and new.get("picture_size", known.picture_size) != known.picture_size:
        raise CameraError(
            "picture_size",
            f"what is there was made from pictures of {known.picture_size[0]} x {known.picture_size[1]}, this is not;"
            " write to another file with -o",
        )
    if "distortion" in new:
        replaced = {entry["focal_length_mm"] for entry in new["distortion"]}
        kept = [entry for entry in parts.get("distortion", ()) if entry["focal_length_mm"] not in replaced]
        new["distortion"] = [*kept, *new["distortion"]]
    return parse_camera(yaml.safe_dump(_rounded(parts | new)), source="what was measured")


def camera_text(camera: Camera) -> str:
    """Write a camera as YAML."""
    content = camera.model_dump(mode="json", exclude_defaults=True)
    return HEADER + yaml.safe_dump(_rounded(content), sort_keys=False, default_flow_style=None, width=120)


def write_camera(path: Path, camera: Camera) -> None:
    """Write camera.yaml.

    Raises
    ------
    OutputError
        If it cannot be written; an older one is then unchanged.
    """

    def write(stream: IO[str]) -> None:
        stream.write(camera_text(camera))

    write_all(path.parent, {path.name: as_text(write)})


def _rounded(content: Any) -> Any:  # noqa: ANN401 - whatever YAML holds
    if isinstance(content, dict):
        return {key: _rounded(value) for key, value in content.items()}
    if isinstance(content, list | tuple):
        return [_rounded(value) for value in content]
    return float(f"{content:.{DIGITS}g}") if isinstance(content, float) else content
