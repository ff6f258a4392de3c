"""Untrusted panels and cameras: replacing any one or two values gives a decode or one sentence, nothing else."""

from __future__ import annotations

import copy
import io
import os
from collections.abc import Callable
from datetime import date
from pathlib import Path
from typing import Any

import cv2
import pytest
from hypothesis import HealthCheck, example, given, settings

from decoder.outputs.outputs import planned_files
from decoder.panel.errors import DecoderError
from decoder.parallel.decoding import decoded_flight
from fixtures.recordings import record_flight
from flight_file.reader import open_flight
from tests.decoder.cockpit import DOCUMENT, draw
from tests.hostile import Change, changes, spoilt
from tests.programs import write_yaml

EXAMPLES = 30
LONGEST_SENTENCE = 500
FORMATS = ("csv", "mcap", "layout", "html")
Content = Any

changes_of_yaml = changes("/dev/zero", "fifo", "below", date(2018, 5, 4), b"\xff", {1: 2})


def _oblique(content: Content) -> None:
    """A panel whose camera is known, with needles above a face that has a rim."""
    content["reference_points"] = [
        {"at": [20, 20], "inches": [0, 0]}, {"at": [340, 22], "inches": [6.4, 0]},
        {"at": [338, 200], "inches": [6.4, 3.6]}, {"at": [22, 198], "inches": [0, 3.6]},
    ]  # fmt: skip
    x, y = content["gauges"][0]["centre"]
    content["gauges"][0]["rim"] = [[x + 52, y], [x, y + 51], [x - 52, y], [x, y - 51], [x + 36.8, y + 36]]
    content["gauges"][1]["needle_height_inches"] = 0.05


def _round(content: Content) -> None:
    """A panel with pointers that count for each other, a card, stops, and a template in a picture of its own."""
    speed, fuel = content["gauges"]
    speed |= {"stops": [110, 430], "tail": True}
    speed["needles"][0] |= {"max_rate": 50, "template": {"at": 214.0, "span": 18, "picture": "other.png"}}
    fuel |= {"sweep": [0, 360], "scale": [[0, 0], [180, 500]], "wraps": 1000}
    fuel["needles"][1] |= {"scale": [[0, 0], [180, 5000]], "wraps": 10000}
    fuel["combined"] = {"name": "fuel_lb", "needles": ["al_lb", "fr_lb"], "tolerance": 0.3, "lowest": 0, "max_rate": 9}
    card = {key: copy.deepcopy(fuel[key]) for key in ("centre", "radius", "sweep", "scale", "wraps")}
    content["gauges"].append({"name": "heading", "card": {"name": "heading_deg", "index": 270}, **card})


SOUND: dict[str, Callable[[Content], None]] = {"plain": lambda _: None, "oblique": _oblique, "round": _round}
CAMERA = {
    "model": "drawn",
    "picture_size": [720, 440],
    "principal_point": [359, 220],
    "focal": {"pixels_per_radian": [6, 120, 0.06], "covariance": [[1, 0, 0], [0, 1, 0], [0, 0, 1e-6]],
              "range_mm": [4, 44.5]},
    "distortion": [{"focal_length_mm": 4.0, "k1": 0.01, "k1_sigma": 0.001, "k2": 0.001, "p1": 0, "p2": 0, "k3": 0}],
}  # fmt: skip


@pytest.fixture
def decode(tmp_path: Path) -> Callable[[Content, Content | None], None]:
    """Decodes three small frames with a panel, and a camera perhaps, and makes every kind of file of them."""
    angles = {"speed_kt": 214.0, "al_lb": 200.0, "fr_lb": 330.0}
    folder = tmp_path / "panel"
    (folder / "below").mkdir(parents=True)
    for name in ("panel.png", "other.png"):
        cv2.imwrite(str(folder / name), draw(angles))
    os.mkfifo(folder / "fifo")
    write_yaml(folder / "panel.yaml", DOCUMENT)
    pictures, flight = [tmp_path / f"{step}.jpg" for step in range(3)], tmp_path / "tiny.mcap"
    for step, picture in enumerate(pictures):
        cv2.imwrite(str(picture), draw({**angles, "speed_kt": 214.0 + 9 * step}))
    record_flight(pictures, folder / "panel.yaml", flight)

    def run(panel: Content, camera: Content | None = None) -> None:
        write_yaml(folder / "panel.yaml", panel)
        if camera is not None:
            write_yaml(folder / "camera.yaml", camera)
        done = decoded_flight(
            open_flight([flight]),
            folder / "panel.yaml",
            "normxcorr",
            None if camera is None else folder / "camera.yaml",
            shown=iter,
        )
        for make in planned_files("flight", FORMATS).values():
            make(done)(io.BytesIO())

    return run


def sentence_of(act: Callable[[], None]) -> str:
    """What an expected failure says; empty where there is none."""
    try:
        act()
    except DecoderError as error:
        return str(error)
    return ""


@pytest.mark.slow
@pytest.mark.parametrize("kind", SOUND)
@settings(max_examples=EXAMPLES, derandomize=True, suppress_health_check=list(HealthCheck))
@given(replaced=changes_of_yaml)
@example(replaced=[])
def test_hostile_panel_gives_one_sentence(
    decode: Callable[..., None], document: Content, kind: str, replaced: list[Change]
) -> None:
    """A panel with one or two changed values is decoded, as it is without, or refused in one printable sentence."""
    whole = copy.deepcopy(document)
    SOUND[kind](whole)
    told = sentence_of(lambda: decode(spoilt(whole, replaced), CAMERA if kind == "oblique" else None))

    assert replaced or told == ""
    assert told.isprintable()
    assert len(told) < LONGEST_SENTENCE


@pytest.mark.slow
@settings(max_examples=EXAMPLES, derandomize=True, suppress_health_check=list(HealthCheck))
@given(replaced=changes_of_yaml)
def test_hostile_camera_gives_one_sentence(
    decode: Callable[..., None], document: Content, replaced: list[Change]
) -> None:
    """So is a camera."""
    whole = copy.deepcopy(document)
    _oblique(whole)
    told = sentence_of(lambda: decode(whole, spoilt(CAMERA, replaced)))

    assert told.isprintable()
    assert len(told) < LONGEST_SENTENCE
