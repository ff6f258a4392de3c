"""JPEGs with and without EXIF, and a folder of them."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import pytest
from PIL import Image

from tests.jpegs import encoded

EXIF_IFD = 0x8769

MakeJpeg = Callable[..., bytes]


@pytest.fixture
def make_jpeg() -> MakeJpeg:
    """A JPEG of 64x48 pixels with these EXIF tags, by number."""

    def make(tags: dict[int, object] | None = None, *, shade: int = 0) -> bytes:
        exif = Image.Exif()
        if tags:
            exif.get_ifd(EXIF_IFD).update(tags)
        return encoded(Image.new("RGB", (64, 48), (shade, 20, 40)), exif=exif)

    return make


@pytest.fixture
def folder(tmp_path: Path, make_jpeg: MakeJpeg) -> Path:
    """Three pictures a second apart, named in different ways, and two files that are no JPEGs."""
    pictures = tmp_path / "pictures"
    pictures.mkdir()
    for second, name in enumerate(("a1.jpg", "a2.JPG", "b.jpeg")):
        tags = {0x9003: f"2018:05:04 12:00:0{second}", 0x9291: "50", 0x920A: 4.45}
        (pictures / name).write_bytes(make_jpeg(tags, shade=second))
    (pictures / "notes.txt").write_text("not a picture")
    (pictures / "a3.gif").write_bytes(b"neither")
    return pictures
