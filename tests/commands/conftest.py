"""The programs as their users run them, and flights to run them on."""

from __future__ import annotations

import io
import json
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pytest
from PIL import Image, ImageDraw

from fixtures.recordings import record_flight
from flight_file.reader import open_flight
from tests.jpegs import encoded
from tests.programs import A1, A2, FIXTURES, Done, MakeFlight, ran, rows_of, yaml_of


@dataclass(frozen=True, slots=True)
class Decoded:
    """What `decode` left in a folder, and what it said."""

    folder: Path
    done: Done

    @property
    def csv_file(self) -> Path:
        """Its only flight data."""
        (path,) = (path for path in self.folder.glob("*.csv") if not path.stem.endswith("_alignment"))
        return path

    @property
    def rows(self) -> list[dict[str, str]]:
        """The rows of the flight data."""
        return rows_of(self.csv_file)

    @property
    def described(self) -> dict[str, Any]:
        """The JSON beside them."""
        content: dict[str, Any] = json.loads(self.csv_file.with_suffix(".json").read_text(encoding="utf-8"))
        return content


@pytest.fixture
def decode(tmp_path: Path) -> Callable[..., Decoded]:
    """Decodes into a folder of the test."""

    def make(*words: object, into: str = "out") -> Decoded:
        return Decoded(tmp_path / into, ran("decode", *words, "-o", tmp_path / into))

    return make


@pytest.fixture(scope="session")
def decoded_a1(tmp_path_factory: pytest.TempPathFactory) -> Decoded:
    """The committed flight of twenty frames, decoded as it is; nobody changes it."""
    folder = tmp_path_factory.mktemp("a1") / "out"
    return Decoded(folder, ran("decode", A1, "-o", folder))


@pytest.fixture(scope="session")
def decoded_a2(tmp_path_factory: pytest.TempPathFactory) -> Decoded:
    """The committed flight with reflections as CSV, JSON and Parquet; nobody changes it."""
    folder = tmp_path_factory.mktemp("a2") / "out"
    return Decoded(folder, ran("decode", A2, "-o", folder, "--format", "csv,parquet"))


@pytest.fixture(scope="session")
def pictures() -> list[bytes]:
    """The JPEGs of a committed flight."""
    return [frame.encoded for frame in open_flight([FIXTURES / "thesis_a1.mcap"]).frames()]


@pytest.fixture
def make_flight(tmp_path: Path) -> MakeFlight:
    """Records JPEGs into a flight file, by default with the animation's panel."""

    def make(jpegs: Iterable[bytes], *, panel: Path | None = FIXTURES / "panel.yaml", name: str = "flight") -> Path:
        camera = tmp_path / f"{name}_camera"
        camera.mkdir()
        for number, jpeg in enumerate(jpegs):
            (camera / f"{number:05d}.jpg").write_bytes(jpeg)
        target = tmp_path / f"{name}.mcap"
        record_flight(sorted(camera.iterdir()), panel, target)
        return target

    return make


def without_knob(jpeg: bytes) -> bytes:
    """A frame of the animation with its only anchor painted over."""
    left, top, width, height = yaml_of(FIXTURES / "panel.yaml")["anchors"][0]["box"]
    picture = Image.open(io.BytesIO(jpeg))
    ImageDraw.Draw(picture).rectangle([left - 30, top - 30, left + width + 30, top + height + 30], fill=(60, 60, 60))
    return encoded(picture, quality=90)


@pytest.fixture(scope="session")
def cover_knob() -> Callable[[bytes], bytes]:
    """Paints the anchor over in a frame of the animation."""
    return without_knob
