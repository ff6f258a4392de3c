"""Folders of pictures to record, and configurations to record them with."""

from __future__ import annotations

import io
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
import yaml
from PIL import Image

from recorder.config import RecorderConfig, parse_config

START_NS = 1_525_435_200_000_000_000  # 2018-05-04T12:00:00Z

Configure = Callable[..., RecorderConfig]
WriteConfig = Callable[..., Path]


@pytest.fixture
def pictures(tmp_path: Path) -> Path:
    """Forty small pictures; the first was taken at noon."""
    folder = tmp_path / "pictures"
    folder.mkdir()
    for index in range(40):
        exif = Image.Exif()
        exif.get_ifd(0x8769).update({0x9003: "2018:05:04 12:00:00", 0x920A: 4.45 + index})
        buffer = io.BytesIO()
        Image.new("RGB", (64, 48), (index, 20, 40)).save(buffer, "JPEG", exif=exif)
        (folder / f"{index:03d}.jpg").write_bytes(buffer.getvalue())
    return folder


@pytest.fixture
def document(tmp_path: Path, pictures: Path) -> dict[str, Any]:
    """A configuration that replays the pictures as fast as possible, at 4 Hz of their own time."""
    return {
        "camera": {"driver": "replay", "path": str(pictures), "rate_hz": 4, "pace": "fastest"},
        "storage": {"directory": str(tmp_path / "flights")},
    }


@pytest.fixture
def configure(document: dict[str, Any]) -> Configure:
    """The configuration with some settings changed, by block."""

    def make(**blocks: dict[str, Any]) -> RecorderConfig:
        return parse_config(
            {**document, **{name: {**document.get(name, {}), **block} for name, block in blocks.items()}}
        )

    return make


@pytest.fixture
def write_config(tmp_path: Path, document: dict[str, Any]) -> WriteConfig:
    """The same as a file; gives its path."""

    def write(**blocks: dict[str, Any]) -> Path:
        changed = {**document, **{name: {**document.get(name, {}), **block} for name, block in blocks.items()}}
        path = tmp_path / "recorder.yaml"
        path.write_text(yaml.safe_dump(changed))
        return path

    return write
