"""The plain flight at other sizes and with more needles: enlarged, with the noise of a sensor of that size.

A panel of more needles lists its gauges several times under other names: for the work it takes, that is as many dials.
"""

from __future__ import annotations

import io
import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import yaml

from benchmarks.programs import FIXTURES, RENDERED
from flight_file.frame import Frame
from flight_file.reader import Flight, open_flight
from recorder.config import parse_config
from recorder.host import SimulatedClock, fixed_host
from recorder.journal import Journal
from recorder.run import record

WIDTH_PX, HEIGHT_PX = 1024, 768
PICTURES = 25
NOISE_LEVELS = 2.0
QUALITY = 90
FRAME_NS = 250_000_000


@dataclass(frozen=True, slots=True)
class Size:
    """Pictures of so many pixels, and how often what is measured on them.

    `slow_frames` are for ways that take a hundred times as long: a few tell enough.
    """

    width_px: int
    height_px: int
    frames: int
    slow_frames: int
    rounds: int

    @property
    def name(self) -> str:
        """As people write it."""
        return f"{self.width_px}x{self.height_px}"


SIZES = (Size(1024, 768, 400, 6, 9), Size(1616, 1212, 400, 4, 5), Size(4896, 3672, 400, 2, 3))


class Repeated(Flight):
    """A flight that goes on with the same frames again, so many in all, each with a number and a time of its own."""

    def __init__(self, flight: Flight, frames: int) -> None:
        super().__init__(flight.segments, flight.attachments)
        self._frames = frames

    def frames(self, part: range | None = None) -> Iterator[Frame]:
        """All of them, read from the file each time."""
        began_ns, number = self.captured_ns(0) or 0, 0
        while number < self._frames:
            for frame in super().frames(part):
                if number == self._frames:
                    return
                yield replace(frame, sequence=number, captured_ns=began_ns + number * FRAME_NS)
                number += 1


def sized_flight(folder: Path, size: Size, needles: int) -> Flight:
    """A flight of pictures of that size with a panel of so many needles, recorded into the folder."""
    name = f"{size.name}_{needles}"
    camera = folder / f"camera_{size.name}"
    if not camera.exists():
        camera.mkdir()
        paths = sorted((RENDERED / "plain").glob("*.jpg"))
        for number, path in enumerate(paths[:: len(paths) // PICTURES][:PICTURES]):
            (camera / f"{number:05d}.jpg").write_bytes(_enlarged(path.read_bytes(), size, number))
    panel = folder / f"panel_{name}"
    panel.mkdir()
    (panel / "panel.jpg").write_bytes(_enlarged((FIXTURES / "panel.jpg").read_bytes(), size, PICTURES))
    (panel / "panel.yaml").write_text(yaml.safe_dump(panel_of(size.width_px / WIDTH_PX, needles)), encoding="utf-8")
    config = {
        "camera": {"driver": "replay", "path": str(camera), "rate_hz": 4, "pace": "fastest"},
        "storage": {"directory": str(folder / name), "segment_s": 3600, "segment_mib": 4096, "keep_free_gib": 0},
        "attach": {"panel": str(panel / "panel.yaml")},
    }
    host = fixed_host(SimulatedClock(0))
    outcome = record(parse_config(config), host=host, journal=Journal(io.StringIO()), name=name)
    return Repeated(open_flight(outcome.paths), size.frames)


def _enlarged(jpeg: bytes, size: Size, seed: int) -> bytes:
    if size.width_px == WIDTH_PX:
        return jpeg
    picture = np.asarray(cv2.imdecode(np.frombuffer(jpeg, np.uint8), cv2.IMREAD_COLOR), np.uint8)
    large = cv2.resize(picture, (size.width_px, size.height_px), interpolation=cv2.INTER_CUBIC).astype(np.float32)
    large += np.random.default_rng(seed).normal(0.0, NOISE_LEVELS, large.shape[:2]).astype(np.float32)[..., None]
    _, encoded = cv2.imencode(".jpg", np.clip(large, 0, 255).astype(np.uint8), [cv2.IMWRITE_JPEG_QUALITY, QUALITY])
    return encoded.tobytes()


def panel_of(factor: float, needles: int) -> dict[str, Any]:
    """The animation's panel in pictures that are so much larger, with so many needles."""
    panel: dict[str, Any] = yaml.safe_load((FIXTURES / "panel.yaml").read_text(encoding="utf-8"))
    panel["level"] = [_place(point, factor) for point in panel["level"]]
    for anchor in panel["anchors"]:
        left, top, width, height = anchor["box"]
        anchor["box"] = [round(number) for number in (left * factor, top * factor, width * factor, height * factor)]
    gauges, have, copy = [], 0, 0
    while have < needles:
        for gauge in panel["gauges"]:
            if have + len(gauge["needles"]) <= needles:
                gauges.append(_copied(gauge, factor, copy))
                have += len(gauge["needles"])
        copy += 1
    return {**panel, "gauges": gauges}


def _copied(gauge: dict[str, Any], factor: float, copy: int) -> dict[str, Any]:
    own = {**gauge, "centre": _place(gauge["centre"], factor), "radius": [r * factor for r in gauge["radius"]]}
    if copy == 0:
        return own
    text = yaml.safe_dump(own)
    names = [gauge["name"], *(needle["name"] for needle in gauge["needles"])]
    for name in names:
        text = re.sub(rf"\b{name}\b", _numbered(name, copy), text)
    numbered: dict[str, Any] = yaml.safe_load(text)
    return numbered


def _numbered(name: str, copy: int) -> str:
    stem, underscore, rest = name.partition("_")
    return f"{stem}{'abcdefg'[copy - 1]}{underscore}{rest}"


def _place(point: Sequence[float], factor: float) -> list[float]:
    """Pixels' centres are on whole numbers, so the first pixel's corner stays where it is."""
    return [(number + 0.5) * factor - 0.5 for number in point]
