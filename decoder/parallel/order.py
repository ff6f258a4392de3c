"""The order for a fleet: the panel, camera and options that all flights are decoded with, and the versions to do it.

Panel and camera are copied into the output when the fleet is begun, where every worker finds them.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cache
from hashlib import sha256
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path

import decoder
import flight_file
from decoder.imaging.panel_pictures import panel_from_file
from decoder.panel.camera import parse_camera
from decoder.panel.errors import CameraError, PanelError, VersionMismatch
from decoder.panel.panel import parse_panel
from decoder.parallel.store import is_url, join, leaf, normal, parent, working_folder
from decoder.parallel.stores import store_of
from flight_file.untrusted import read_named_in

LIBRARIES = ("numpy", "opencv-python-headless", "simplejpeg", "av")
LIBRARIES_OF_FORMATS = {
    "mcap": ("mcap", "mcap-protobuf-support", "protobuf", "foxglove-schemas-protobuf", "zstandard"),
    "html": ("jinja2", "pillow"),
    "parquet": ("pyarrow",),
}

INPUTS = ".inputs"
DIGITS = 16  # of a digest in a folder's name


@dataclass(frozen=True, slots=True)
class Versions:
    """What is installed; `software` contains a digest of the code, to distinguish two checkouts of one version."""

    software: str
    libraries: tuple[str, ...]


def installed(formats: Sequence[str] = ()) -> Versions:
    """Look up the versions in this process, with those of the libraries that write these formats."""
    wanted = dict.fromkeys(LIBRARIES)
    for name in sorted(formats):
        wanted.update(dict.fromkeys(LIBRARIES_OF_FORMATS.get(name, ())))
    return Versions(
        software=f"image-flight-recorder {version('image-flight-recorder')} ({_digest_of_code()[:12]})",
        libraries=tuple(map(_library, wanted)),
    )


def _library(name: str) -> str:
    try:
        return f"{name} {version(name)}"
    except PackageNotFoundError:
        return f"no {name}"


@cache
def _digest_of_code() -> str:
    code = sha256()
    for package in (decoder, flight_file):
        for folder in map(Path, package.__path__):
            for file in _files_of_code(folder):
                code.update(str(file.relative_to(folder)).encode() + b"\0" + file.read_bytes())
    return code.hexdigest()


def _files_of_code(folder: Path) -> Iterator[Path]:
    """List all files except what Python makes of them; a report's page is code too."""
    for file in sorted(folder.rglob("*")):
        if file.is_file() and "__pycache__" not in file.parts:
            yield file


def refuse_mismatch(ours: Versions, theirs: Versions, worker: str) -> None:
    """Compare a worker's versions with those of the machine that asks.

    Raises
    ------
    VersionMismatch
        Naming the worker and the first difference.
    """
    for mine, other in zip([ours.software, *ours.libraries], [theirs.software, *theirs.libraries], strict=True):
        if mine != other:
            raise VersionMismatch(f"{worker} has {other}, this machine {mine}; install the same on both")


@dataclass(frozen=True, slots=True)
class Input:
    """A panel or a camera that all flights are read with: the addresses of its files, its own first.

    Attributes
    ----------
    sha256
        Of all of them, including the panel's pictures.
    """

    addresses: tuple[str, ...]
    sha256: str

    def fetched(self, folder: Path) -> Path:
        """Return its own file as a local path, with the others beside it; what has to be copied goes into `folder`."""
        base = parent(self.addresses[0])
        paths = []
        for address in self.addresses:
            below = (folder / address.removeprefix(base).lstrip("/")).parent
            below.mkdir(parents=True, exist_ok=True)
            paths += store_of(address).fetch([address], below)
        return paths[0]


@dataclass(frozen=True, slots=True)
class Order:
    """What all flights of a fleet are decoded with, and where their results go; small, as it goes with each flight."""

    output: str
    method: str
    formats: tuple[str, ...]
    with_images: bool
    panel: Input | None
    camera: Input | None
    versions: Versions

    @property
    def key(self) -> dict[str, object]:
        """The values in which results must agree to be results of this order."""
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
    """Make the order for an output, checking panel and camera and copying them there.

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


def _picture(panel: str, name: str) -> bytes:
    """Read a picture that a panel names, beside it; locally not through a link that leads elsewhere, nor from pipes."""
    address = join(parent(panel), name)
    if is_url(panel):
        return _content(address, PanelError)
    try:
        return read_named_in(Path(panel), name)
    except FileNotFoundError:
        return _content(address, PanelError)
    except OSError as error:
        raise PanelError("picture", f"{name} cannot be read: {error.strerror}", source=panel) from error


def _panel(address: str) -> dict[str, bytes]:
    """Read a panel's file and its pictures, by name, in that order."""
    text = _content(address, PanelError)
    pictures = parse_panel(text, source=address).pictures
    files = {leaf(address): text, **{name: _picture(address, name) for name in pictures}}
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
