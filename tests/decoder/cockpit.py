"""A cockpit drawn from formulas, and flights made of readings: what the decoder's tests hold it against.

Every picture is a smooth function of the panel's own coordinates, sampled at the pixels of a camera that may be
shifted, rolled, brighter or noisier. Nothing of the decoder's geometry is used to draw it.
"""

from __future__ import annotations

import copy
import functools
import math
from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np
import yaml
from numpy.typing import NDArray

from decoder.imaging.alignment import IDENTITY
from decoder.imaging.panel_pictures import PanelPictures
from decoder.imaging.pictures import GreyPicture
from decoder.instruments.panel_reader import PanelReader
from decoder.instruments.reading import FrameReadings, Reading, Status
from decoder.learning.fit import reader_from_panel
from decoder.panel.panel import Panel, parse_panel
from decoder.panel.vocabulary import Method
from decoder.timeseries.flight_data import FlightData, FlightDataBuilder

Field = NDArray[np.float64]

WIDTH_PX, HEIGHT_PX = 360, 220
SPEED_CENTRE, FUEL_CENTRE = (85.4, 110.7), (235.6, 108.3)
DIAL_RADIUS_PX = 56.0
KNOB_CENTRE, KNOB_RADIUS_PX = (160.0, 32.0), 19.0
SOFTNESS_PX = 0.45
REACH_PX = 25.0  # beyond it an edge's hyperbolic tangent is 1 to the last bit
START_NS = 1_525_435_200_000_000_000  # 2018-05-04T12:00:00Z
FRAME_NS = 500_000_000

# Name: centre, tip and half width of root and tip in pixels, grey level.
HANDS = {
    "speed_kt": (SPEED_CENTRE, 48.0, 2.6, 1.0, 225.0),
    "al_lb": (FUEL_CENTRE, 49.0, 2.6, 1.0, 225.0),
    "fr_lb": (FUEL_CENTRE, 49.0, 3.2, 2.2, 225.0),
}
PANEL_ANGLES_DEG = {"speed_kt": 214.0, "al_lb": 200.0, "fr_lb": 330.0}
BETWEEN_MARKS_DEG = {"speed_kt": 225.0, "al_lb": 195.0, "fr_lb": 345.0}

DOCUMENT: dict[str, Any] = {
    "name": "formulas",
    "picture": "panel.png",
    "focal_length_mm": 4.45,
    "level": [[330, 20], [330, 200]],
    "anchors": [{"name": "knob", "box": [140, 12, 40, 40]}],
    "gauges": [
        {
            "name": "speed",
            "centre": list(SPEED_CENTRE),
            "radius": [20, 52],
            "sweep": [120, 420],
            "unit": "kt",
            "scale": [[120, 0], [270, 400], [420, 1000]],
            "needles": [{"name": "speed_kt", "template": {"at": 214.0, "span": 18}}],
        },
        {
            "name": "fuel",
            "centre": list(FUEL_CENTRE),
            "radius": [20, 52],
            "sweep": [120, 420],
            "unit": "lb",
            "scale": [[120, 0], [420, 3000]],
            "needles": [
                {"name": "al_lb", "template": {"at": 200.0, "span": 18}, "covered_by": "fr_lb"},
                {"name": "fr_lb", "template": {"at": 330.0, "span": 18}},
            ],
        },
    ],
}


def _inside(distance_px: Field) -> Field:
    """1 well inside an outline, 0 well outside, a smooth step across it."""
    return 0.5 * (1.0 - np.tanh(distance_px / (2 * SOFTNESS_PX)))


def texture(x: Field, y: Field) -> Field:
    """A smooth pattern with detail in both directions and no period."""
    return 30.0 * (np.sin(0.31 * x + 0.12 * y) + np.sin(0.23 * y - 0.09 * x + 1.0) + np.sin(0.002 * x * y))


def _hand(name: str, angle_deg: float, x: Field, y: Field) -> Field:
    """How much of each point about its pivot a needle covers."""
    _, tip, root_half, tip_half, _ = HANDS[name]
    cos, sin = math.cos(math.radians(angle_deg)), math.sin(math.radians(angle_deg))
    along = x * cos + y * sin
    across = y * cos - x * sin
    half = root_half + (tip_half - root_half) * np.clip(along / tip, 0.0, 1.0)
    return _inside(np.abs(across) - half) * _inside(-along) * _inside(along - tip)


def _ticks(x: Field, y: Field) -> Field:
    """How much of each point of a dial about the origin tick marks cover: one every thirty degrees, at the rim."""
    away = (np.degrees(np.arctan2(y, x)) + 15.0) % 30.0 - 15.0
    radius = np.hypot(x, y)
    return _inside(np.abs(np.radians(away) * radius) - 1.2) * _inside(43.0 - radius) * _inside(radius - 53.0)


def _scene(
    x: Field, y: Field, hands: Sequence[tuple[str, float]], levels: Mapping[str, float], *, ticks: bool
) -> Field:
    """Grey levels of the panel at points, the hands drawn one over the other, some of them in levels of their own."""
    light = 60.0 + _inside(x - 330.0) * 70.0
    for centre in (SPEED_CENTRE, FUEL_CENTRE):
        near, along, across = near_points(x, y, centre, DIAL_RADIUS_PX)
        light[near] += (40.0 - light[near]) * _inside(np.hypot(along, across) - DIAL_RADIUS_PX)
        if ticks:
            light[near] += (180.0 - light[near]) * _ticks(along, across)
    near, along, across = near_points(x, y, KNOB_CENTRE, KNOB_RADIUS_PX)
    knob = _inside(np.hypot(along, across) - KNOB_RADIUS_PX)
    light[near] += (110.0 + texture(x[near], y[near]) - light[near]) * knob
    for name, angle_deg in hands:
        centre, tip, *_, level = HANDS[name]
        near, along, across = near_points(x, y, centre, tip)
        light[near] += (levels.get(name, level) - light[near]) * _hand(name, angle_deg, along, across)
    return light


def near_points(
    x: Field, y: Field, centre: tuple[float, float], radius: float
) -> tuple[NDArray[np.bool_], Field, Field]:
    """Which points a round thing may reach, soft edge and all, and where these are, seen from its centre."""
    along, across = x - centre[0], y - centre[1]
    near = along**2 + across**2 < (radius + REACH_PX) ** 2
    return near, along[near], across[near]


def draw(
    hands: Mapping[str, float],
    *,
    shift_px: tuple[float, float] = (0.0, 0.0),
    roll_deg: float = 0.0,
    gain: float = 1.0,
    offset: float = 0.0,
    noise: float = 0.0,
    seed: int = 0,
    levels: Mapping[str, float] | None = None,
    ticks: bool = False,
) -> GreyPicture:
    """A frame: the panel rolled about its corner, then shifted; `hands` from the lowest to the uppermost."""
    y, x = np.mgrid[0:HEIGHT_PX, 0:WIDTH_PX].astype(np.float64)
    x, y = x - shift_px[0], y - shift_px[1]
    cos, sin = math.cos(math.radians(roll_deg)), math.sin(math.radians(roll_deg))
    light = (
        gain * _scene(cos * x + sin * y, cos * y - sin * x, tuple(hands.items()), levels or {}, ticks=ticks) + offset
    )
    if noise:
        light = light + np.random.default_rng(seed).normal(0.0, noise, light.shape)
    return np.clip(np.rint(light), 0, 255).astype(np.uint8)


def parse(content: object) -> Panel:
    """Parses the content of a `panel.yaml` by way of its text."""
    return parse_panel(yaml.safe_dump(content))


def between_marks(content: dict[str, Any]) -> None:
    """Makes a panel that of a picture whose needles lie midway between tick marks."""
    for gauge in content["gauges"]:
        for needle in gauge["needles"]:
            needle["template"]["at"] = BETWEEN_MARKS_DEG[needle["name"]]


def angles_of(seed: int) -> dict[str, float]:
    """Needles in random places, those of the fuel gauge well apart."""
    rng = np.random.default_rng(seed)
    return {"speed_kt": rng.uniform(125, 415), "al_lb": rng.uniform(125, 240), "fr_lb": rng.uniform(290, 415)}


def source_of(content: dict[str, Any], **pictures: GreyPicture) -> PanelPictures:
    """A panel with pictures given by name, the panel picture drawn unless it is given."""
    own = {"panel.png": draw(PANEL_ANGLES_DEG)} | {f"{name}.png": picture for name, picture in pictures.items()}
    return PanelPictures(parse(content), own, "0" * 64)


def reader_of(
    change: Callable[[dict[str, Any]], object] | None = None,
    method: Method = Method.NORMXCORR,
    **pictures: GreyPicture,
) -> PanelReader:
    """A reader of the drawn cockpit, its panel changed by a function."""
    content = copy.deepcopy(DOCUMENT)
    if change is not None:
        change(content)
    return reader_from_panel(source_of(content, **pictures), method)


def reading(angle_deg: float, status: Status = Status.READ, score: float = 0.99, sigma_deg: float = 0.02) -> Reading:
    """A reading, certain and good unless said otherwise."""
    return Reading(status, angle_deg, sigma_deg, score)


@functools.cache
def _own_panel() -> Panel:
    return parse(DOCUMENT)


def fly(
    frames: Sequence[Mapping[str, Reading] | str],
    *,
    content: dict[str, Any] | None = None,
    times_s: Sequence[float] | None = None,
    panel_sigma_deg: float = 0.0,
) -> FlightData:
    """Flight data of a row of frames, half a second apart unless times are given; a text stands for a missing frame."""
    panel = _own_panel() if content is None else parse(content)
    builder = FlightDataBuilder(panel)
    still = {needle.name: reading(200.0) for needle in panel.needles}
    for index, frame in enumerate(frames):
        time_ns = START_NS + (round(times_s[index] * 1e9) if times_s else index * FRAME_NS)
        if isinstance(frame, str):
            builder.add_missing(index, time_ns, frame)
        else:
            builder.add(index, time_ns, FrameReadings(IDENTITY, {**still, **frame}))
    return builder.build(lambda _, angles_deg: np.full_like(angles_deg, panel_sigma_deg))
