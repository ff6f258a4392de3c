"""A panel with its pictures, brought from wherever they are: a folder, or the attachments of a flight file."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from hashlib import sha256
from pathlib import Path, PurePosixPath

from decoder.errors import PanelError, PictureError
from decoder.panel import Panel, parse_panel
from decoder.pictures import GreyPicture, grey_picture

PANEL_FILE = "panel.yaml"


@dataclass(frozen=True, slots=True)
class PanelPictures:
    """A panel and all pictures it names, grey, by name; `sha256` is of `panel.yaml` itself."""

    panel: Panel
    pictures: Mapping[str, GreyPicture]
    sha256: str

    @property
    def picture(self) -> GreyPicture:
        """The panel picture, (H, W) uint8."""
        return self.pictures[self.panel.picture]


def panel_from_file(path: Path) -> PanelPictures:
    """The panel in a file, its pictures beside it.

    Raises
    ------
    PanelError
        If a file cannot be read or is wrong, naming it and the path of the wrong value.
    """

    def read(name: str) -> bytes:
        return (path.parent / name).read_bytes()

    try:
        text = path.read_bytes()
    except OSError as error:
        raise PanelError("", f"cannot be read: {error.strerror}", source=str(path)) from error
    return _load(text, read, str(path))


def panel_from_attachments(attachments: Mapping[str, bytes], *, flight: str) -> PanelPictures:
    """The panel that a flight file carries.

    Raises
    ------
    PanelError
        If it or one of its pictures is wrong.
    """

    def read(name: str) -> bytes:
        plain = str(PurePosixPath(name))
        if plain not in attachments:
            raise FileNotFoundError(0, "the flight file does not carry it")
        return attachments[plain]

    return _load(attachments[PANEL_FILE], read, f"{PANEL_FILE} in {flight}")


def _load(text: bytes, read: Callable[[str], bytes], source: str) -> PanelPictures:
    panel = parse_panel(text, source=source)
    pictures: dict[str, GreyPicture] = {}
    for name in panel.pictures:
        key = "picture" if name == panel.picture else "template.picture"
        try:
            pictures[name] = grey_picture(read(name))
        except OSError as error:
            raise PanelError(key, f"{name} cannot be read: {error.strerror}", source=source) from error
        except PictureError as error:
            raise PanelError(key, f"{name}: {error}", source=source) from error
    return PanelPictures(panel, pictures, sha256(text).hexdigest())
