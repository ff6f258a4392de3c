"""Photographs that are no JPEGs, and some that are called otherwise than they are."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from PIL import Image

from camera_drivers.errors import ReplayError
from camera_drivers.photographs import picture_facts, picture_format
from decoder.imaging.pictures import grey_picture
from flight_file.documents import is_heif, picture_header
from flight_file.reader import open_flight
from tests.jpegs import encoded
from tests.programs import ran
from tests.videos import played

DRAWN = np.random.default_rng(3).integers(0, 255, (30, 40, 3), np.uint8)
WAYS = {
    "JPEG": ("JPEG", {}, "jpeg"),
    "PNG": ("PNG", {}, "png"),
    "WebP": ("WEBP", {"quality": 80}, "webp"),
    "lossless WebP": ("WEBP", {"lossless": True}, "webp"),
}


def photograph(kind: str, second: int = 0, *, with_exif: bool = True, **options: object) -> bytes:
    """A picture as a file, with the time and zoom at which it was taken."""
    exif = Image.Exif()
    exif.get_ifd(0x8769).update({0x9003: f"2018:05:04 12:00:0{second}", 0x920A: 4.45})
    return encoded(Image.fromarray(DRAWN), kind, **({"exif": exif.tobytes()} if with_exif else {}), **options)


@pytest.mark.parametrize("way", WAYS)
def test_format_size_and_exif_are_read_of_each_kind(way: str) -> None:
    """By its bytes, not by its name; and the desk reads it."""
    kind, options, stored_as = WAYS[way]
    for with_exif in (True, False):
        data = photograph(kind, with_exif=with_exif, **options)
        facts = picture_facts(data)

        assert picture_format(data) == stored_as
        assert (facts.width_px, facts.height_px) == (40, 30)
        assert bool(facts.exif) == with_exif
        assert grey_picture(data).shape == (30, 40)


def test_pictures_of_all_kinds_become_a_flight_as_they_are(tmp_path: Path) -> None:
    """Byte for byte, with their formats, in the flight file too; a JPEG called .png is a JPEG."""
    folder = tmp_path / "pictures"
    folder.mkdir()
    files = {
        "a.png": photograph("PNG", 0),
        "b.webp": photograph("WEBP", 1),
        "c.png": photograph("JPEG", 2),
        "d.heic": photograph("JPEG", 3),
    }
    for name, data in files.items():
        (folder / name).write_bytes(data)
    done = ran("recorder", "replay", folder, "-o", tmp_path / "flight.mcap")
    stored = list(open_flight([tmp_path / "flight.mcap"]).frames())

    assert done.returncode == 0, done.stderr
    for frames in (played(folder), stored):
        assert [frame.encoded for frame in frames] == list(files.values())
        assert [frame.format for frame in frames] == ["png", "webp", "jpeg", "jpeg"]
        assert {frame.exif.focal_length_mm for frame in frames} == {4.45}
    assert ran("recorder", "extract", tmp_path / "flight.mcap", "-o", tmp_path / "out").returncode == 0
    names = ["000000.png", "000001.webp", "000002.jpg", "000003.jpg"]
    assert sorted(path.name for path in (tmp_path / "out").iterdir()) == names
    assert ran("recorder", "verify", tmp_path / "flight.mcap").returncode == 0


@pytest.mark.parametrize("name", ["a.heic", "a.HEIF", "a.jpg"])
def test_heif_is_refused_with_the_command_that_converts_it(tmp_path: Path, name: str) -> None:
    """Whatever it is called."""
    (tmp_path / name).write_bytes(b"\0\0\0\x18ftypheic" + bytes(100))

    with pytest.raises(ReplayError, match="convert all of them first: magick mogrify -format jpg"):
        played(tmp_path)


def test_heif_is_refused_on_the_set_up_page_too(tmp_path: Path) -> None:
    """It begins as a video does, and is none."""
    path = tmp_path / "panel.heic"
    path.write_bytes(b"\0\0\0\x18ftypheic" + bytes(100))
    done = ran("decode", "setup", path)

    assert done.returncode == 1
    assert "convert it to a JPEG" in done.stderr


@given(data=st.binary(max_size=80), start=st.sampled_from([b"\x89PNG\r\n\x1a\n", b"RIFF\0\0\0\0WEBP", b""]))
def test_any_bytes_may_be_looked_at(data: bytes, start: bytes) -> None:
    """Nothing is raised."""
    picture_facts(start + data)
    picture_header(start + data)
    is_heif(start + data)


@pytest.mark.parametrize(
    "head",
    [
        b"VP8X" + b"\x0a\0\0\0" + bytes(4) + b"\xff\xff\xff" * 2,
        b"VP8L" + b"\x0a\0\0\0" + b"\x2f\xff\xff\xff\xff" + bytes(5),
    ],
)
def test_a_webp_that_claims_more_than_it_can_hold_is_refused(head: bytes) -> None:
    """Before memory is taken."""
    header = picture_header(b"RIFF\0\0\0\0WEBP" + head)

    assert header is not None
    assert header.objection(30)
