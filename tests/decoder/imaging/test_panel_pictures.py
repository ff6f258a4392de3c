"""A panel and its pictures, from a folder or from a flight file."""

from __future__ import annotations

from collections.abc import Callable
from hashlib import sha256
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest
import yaml

from decoder.imaging.panel_pictures import PanelPictures, panel_from_attachments, panel_from_file
from decoder.imaging.pictures import GreyPicture
from decoder.panel.errors import PanelError
from tests.decoder.cockpit import draw

Files = dict[str, bytes]
Load = Callable[[Files], PanelPictures]


def png(picture: GreyPicture) -> bytes:
    """A picture without loss."""
    return cv2.imencode(".png", picture)[1].tobytes()


@pytest.fixture
def files(document: dict[str, Any]) -> Files:
    """A panel and its two pictures, by name."""
    document["gauges"][0]["needles"][0]["template"] = {"picture": "cut/needle.png"}
    picture = draw({"speed_kt": 214.0, "al_lb": 200.0, "fr_lb": 330.0})
    needle = np.full((9, 33), 30, np.uint8)
    return {"panel.yaml": yaml.safe_dump(document).encode(), "panel.png": png(picture), "cut/needle.png": png(needle)}


@pytest.fixture(params=["folder", "flight file"])
def load(request: pytest.FixtureRequest, tmp_path: Path) -> Load:
    """Loads a panel from files in a folder, or from the same files as attachments."""

    def from_folder(files: Files) -> PanelPictures:
        for name, content in files.items():
            (tmp_path / name).parent.mkdir(exist_ok=True)
            (tmp_path / name).write_bytes(content)
        return panel_from_file(tmp_path / "panel.yaml")

    def from_attachments(files: Files) -> PanelPictures:
        return panel_from_attachments(files, flight="flight.mcap")

    return from_folder if request.param == "folder" else from_attachments


def test_panel_comes_with_its_pictures(load: Load, files: Files) -> None:
    """All pictures are there by name and grey, and the digest is that of the description."""
    source = load(files)

    assert source.panel.name == "formulas"
    assert {name: picture.shape for name, picture in source.pictures.items()} == {
        "panel.png": (220, 360),
        "cut/needle.png": (9, 33),
    }
    assert source.picture is source.pictures["panel.png"]
    assert source.sha256 == sha256(files["panel.yaml"]).hexdigest()


@pytest.mark.parametrize("content", [None, b"", b"\x89PNG\r\n\x1a\n cut short"], ids=str)
@pytest.mark.parametrize(("name", "path"), [("panel.png", "picture"), ("cut/needle.png", "template.picture")])
def test_missing_or_damaged_picture_is_named(
    load: Load, files: Files, name: str, path: str, content: bytes | None
) -> None:
    """The message names a missing picture, or a file that is not one, and the key that refers to it."""
    del files[name]
    says = "cannot be read: (?!None)" if content is None else "the picture "
    with pytest.raises(PanelError, match=f"{path}: {name}:? {says}"):
        load(files if content is None else files | {name: content})


def test_wrong_panel_is_named_with_where_it_lies(load: Load, files: Files) -> None:
    """The message names the file, or the flight file that carries it."""
    with pytest.raises(PanelError, match=r"(/panel\.yaml|panel\.yaml in flight\.mcap): holds no panel"):
        load(files | {"panel.yaml": b"[]"})


def test_attachment_may_be_written_with_a_leading_dot(files: Files) -> None:
    """`./panel.png` in the panel is the attachment `panel.png`."""
    files["panel.yaml"] = files["panel.yaml"].replace(b"picture: panel.png", b"picture: ./panel.png")

    assert panel_from_attachments(files, flight="flight.mcap").picture.shape == (220, 360)


@pytest.mark.parametrize(
    ("name", "says"),
    [
        ("panel.yaml", r"panel\.yaml: cannot be read: No such file or directory"),
        (".", "cannot be read: Is a directory"),
    ],
)
def test_panel_that_is_no_file_is_named(tmp_path: Path, name: str, says: str) -> None:
    """A panel that is not there, or a folder in its place, is an error of one sentence."""
    with pytest.raises(PanelError, match=says):
        panel_from_file(tmp_path / name)
