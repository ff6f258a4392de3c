"""What decides which bytes come out of a decode: our own code and what it computes with. All workers have the same."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache
from hashlib import sha256
from importlib.metadata import version
from pathlib import Path

import decoder
import flight_file
from decoder.errors import VersionMismatch

LIBRARIES = ("numpy", "opencv-python-headless", "simplejpeg")


@dataclass(frozen=True, slots=True)
class Versions:
    """What is installed; `software` holds a digest of the code, so that two checkouts of one version are told apart."""

    software: str
    libraries: tuple[str, ...]


@cache
def installed() -> Versions:
    """The versions in this process."""
    code = sha256()
    for package in (decoder, flight_file):
        (folder,) = map(Path, package.__path__)
        for file in sorted(folder.rglob("*.py")):
            code.update(str(file.relative_to(folder)).encode() + b"\0" + file.read_bytes())
    return Versions(
        software=f"image-flight-recorder {version('image-flight-recorder')} ({code.hexdigest()[:12]})",
        libraries=tuple(f"{name} {version(name)}" for name in LIBRARIES),
    )


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
