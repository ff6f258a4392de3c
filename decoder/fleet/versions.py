"""What decides which bytes come out of a decode: our own code and what it computes with. All workers have the same."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cache
from hashlib import sha256
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path

import decoder
import flight_file
from decoder.errors import VersionMismatch

LIBRARIES = ("numpy", "opencv-python-headless", "simplejpeg")
LIBRARIES_OF_FORMATS = {
    "mcap": ("mcap", "mcap-protobuf-support", "protobuf", "foxglove-schemas-protobuf", "zstandard"),
    "html": ("jinja2", "pillow"),
    "parquet": ("pyarrow",),
}


@dataclass(frozen=True, slots=True)
class Versions:
    """What is installed; `software` holds a digest of the code, so that two checkouts of one version are told apart."""

    software: str
    libraries: tuple[str, ...]


def installed(formats: Sequence[str] = ()) -> Versions:
    """The versions in this process, with those of the libraries that write these formats."""
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
    """All but what Python makes of them; a report's page is code too."""
    for file in sorted(folder.rglob("*")):
        if file.is_file() and "__pycache__" not in file.parts:
            yield file


def refuse_mismatch(ours: Versions, theirs: Versions, worker: str) -> None:
    """Holds a worker's versions against those of the machine that asks.

    Raises
    ------
    VersionMismatch
        Naming the worker and the first difference.
    """
    for mine, other in zip([ours.software, *ours.libraries], [theirs.software, *theirs.libraries], strict=True):
        if mine != other:
            raise VersionMismatch(f"{worker} has {other}, this machine {mine}; install the same on both")
