"""What decides which bytes come out of a decode: our own code, numpy and OpenCV. All workers must have the same."""

from __future__ import annotations

from dataclasses import asdict, dataclass
from functools import cache
from hashlib import sha256
from importlib.metadata import version
from pathlib import Path

import cv2
import numpy as np

import decoder
import flight_file
from decoder.errors import VersionMismatch


@dataclass(frozen=True, slots=True)
class Versions:
    """What is installed; `software` holds a digest of the code, so that two checkouts of one version are told apart."""

    software: str
    numpy: str
    opencv: str


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
        numpy=f"numpy {np.__version__}",
        opencv=f"opencv {cv2.__version__}",
    )


def refuse_mismatch(ours: Versions, theirs: Versions, worker: str) -> None:
    """Holds a worker's versions against those of the machine that asks.

    Raises
    ------
    VersionMismatch
        Naming the worker and the first difference.
    """
    for mine, other in zip(asdict(ours).values(), asdict(theirs).values(), strict=True):
        if mine != other:
            raise VersionMismatch(f"{worker} has {other}, this machine {mine}; install the same on both")
