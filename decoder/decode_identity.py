"""What the readings of a decode depend on, each under the name that people know it by."""

from __future__ import annotations

from collections.abc import Mapping
from hashlib import sha256
from importlib.metadata import version

from decoder.flight_part import FlightPart
from decoder.panel_reader import PanelReader
from decoder.pictures import GreyPicture
from flight_file.reader import Flight

DISTRIBUTIONS = ("image-flight-recorder", "numpy", "opencv-python-headless", "simplejpeg")


def identity_of(flight: Flight, part: FlightPart | None, reader: PanelReader) -> dict[str, object]:
    """Of a decode with this reader; reads the flight file through.

    Raises
    ------
    FlightNotReadableError
        If a file cannot be read.
    """
    source = reader.source
    return {
        "flight file": list(flight.sha256_of_files().values()),
        "panel": [source.sha256, _digest(source.pictures)],
        "camera": sha256(repr(source.camera).encode()).hexdigest(),
        "method": reader.method.value,
        "part": None if part is None else [part.ranks.start, part.ranks.stop, part.ranks.step],
        "software": [f"{name} {version(name)}" for name in DISTRIBUTIONS],
    }


def _digest(pictures: Mapping[str, GreyPicture]) -> str:
    digest = sha256()
    for name, picture in sorted(pictures.items()):
        digest.update(f"{name} {picture.shape} ".encode())
        digest.update(picture.tobytes())
    return digest.hexdigest()
