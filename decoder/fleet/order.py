"""The order: what all flights of a fleet are decoded with.

A panel and a camera lie in the output, where every worker finds them, as they were when the fleet was begun.
"""

from __future__ import annotations

from dataclasses import dataclass
from hashlib import sha256
from pathlib import Path, PurePosixPath

from decoder.camera import parse_camera
from decoder.errors import CameraError, PanelError
from decoder.fleet.addresses import join, leaf, normal, parent
from decoder.fleet.staging import working_folder
from decoder.fleet.stores import store_of
from decoder.fleet.versions import Versions, installed
from decoder.panel import parse_panel
from decoder.panel_pictures import panel_from_file

INPUTS = ".inputs"
DIGITS = 16  # of a digest in a folder's name


@dataclass(frozen=True, slots=True)
class Input:
    """A panel or a camera that all flights are read with: its files as addresses, its own first.

    Attributes
    ----------
    sha256
        Of all of them, the panel's pictures too.
    """

    addresses: tuple[str, ...]
    sha256: str

    def fetched(self, folder: Path) -> Path:
        """Its own file as a path of this machine, the others beside it; what has to be copied goes into `folder`."""
        base = parent(self.addresses[0])
        paths = []
        for address in self.addresses:
            below = (folder / address.removeprefix(base).lstrip("/")).parent
            below.mkdir(parents=True, exist_ok=True)
            paths += store_of(address).fetch([address], below)
        return paths[0]


@dataclass(frozen=True, slots=True)
class Order:
    """What all flights of a fleet are decoded with, and where their results go; small: it goes with each flight."""

    output: str
    method: str
    formats: tuple[str, ...]
    with_images: bool
    panel: Input | None
    camera: Input | None
    versions: Versions

    @property
    def key(self) -> dict[str, object]:
        """What results must agree in to be those of this order."""
        return {
            "software": self.versions.software,
            "libraries": list(self.versions.libraries),
            "method": self.method,
            "formats": sorted(self.formats),
            "with_images": self.with_images,
            "panel": self.panel and self.panel.sha256,
            "camera": self.camera and self.camera.sha256,
        }


def make_order(
    output: str, *, method: str, formats: tuple[str, ...], with_images: bool, panel: str | None, camera: str | None
) -> Order:
    """The order for an output, with panel and camera checked and put there.

    Raises
    ------
    DecoderError
        If panel or camera cannot be read or are wrong, or the output cannot be written.
    """
    output = normal(output)
    return Order(
        output=output,
        method=method,
        formats=formats,
        with_images=with_images,
        panel=None if panel is None else _put(_panel(normal(panel)), output),
        camera=None if camera is None else _put(_camera(normal(camera)), output),
        versions=installed(formats),
    )


def _panel(address: str) -> dict[str, bytes]:
    """A panel's file and its pictures, by name, in that order."""
    text = _content(address, PanelError)
    pictures = parse_panel(text, source=address).pictures
    for name in pictures:
        if PurePosixPath(name).is_absolute() or ".." in PurePosixPath(name).parts:
            raise PanelError("picture", f"{name} lies outside the panel's folder; put it beside it", source=address)
    files = {leaf(address): text, **{name: _content(join(parent(address), name), PanelError) for name in pictures}}
    with working_folder() as folder:
        panel_from_file(_written(files, folder)[0])
    return files


def _camera(address: str) -> dict[str, bytes]:
    text = _content(address, CameraError)
    parse_camera(text, source=address)
    return {leaf(address): text}


def _content(address: str, error: type[PanelError | CameraError]) -> bytes:
    content = store_of(address).read(address)
    if content is None:
        raise error("", "cannot be read: there is no such file", source=address)
    return content


def _put(files: dict[str, bytes], output: str) -> Input:
    digest = sha256()
    for name, content in files.items():
        digest.update(f"{name}\0{len(content)}\0".encode() + content)
    folder = join(output, INPUTS, digest.hexdigest()[:DIGITS])
    with working_folder() as working:
        for file in _written(files, working):
            store_of(output).put(file, join(folder, str(file.relative_to(working))))
    return Input(tuple(join(folder, name) for name in files), digest.hexdigest())


def _written(files: dict[str, bytes], folder: Path) -> list[Path]:
    paths = []
    for name, content in files.items():
        path = folder / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_bytes(content)
        paths.append(path)
    return paths
