"""Dials of every kind, drawn from formulas at four times the size and averaged down: the truth for readings.

Angles are the panel's, degrees, 0 = right, clockwise positive. Nothing of the decoder's geometry is used to draw.
"""

from __future__ import annotations

import copy
import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import cv2
import numpy as np
import yaml
from numpy.typing import NDArray

from decoder.imaging.panel_pictures import PanelPictures
from decoder.imaging.pictures import GreyPicture
from decoder.instruments.panel_reader import PanelReader
from decoder.learning.fit import reader_from_panel, tune
from decoder.panel.panel import parse_panel
from decoder.panel.scale import shortest
from decoder.panel.vocabulary import Method

WIDTH_PX, HEIGHT_PX = 240, 190
CENTRE = (104.4, 94.7)
DIAL_RADIUS_PX = 76.0
SCALE = 4
SHIFT_BITS = 8
FACE_LEVEL, MARK_LEVEL = 35.0, 190.0


@dataclass(frozen=True)
class Hand:
    """A needle's form: lengths and half widths in pixels, from the end of its tail to its tip."""

    tip: float = 64.0
    root_half: float = 2.6
    tip_half: float = 1.2
    tail: float = 0.0
    tail_half: float = 2.6
    level: float = 230.0
    centre: tuple[float, float] = CENTRE


@dataclass
class Canvas:
    """A picture in the making."""

    picture: NDArray[np.uint8] = field(
        default_factory=lambda: np.full((HEIGHT_PX * SCALE, WIDTH_PX * SCALE), 70, np.uint8)
    )

    def polygon(self, points: Sequence[tuple[float, float]], level: float) -> None:
        """Fills an outline given in the panel's pixels."""
        fine = ((np.array(points) + 0.5) * SCALE - 0.5) * 2**SHIFT_BITS
        cv2.fillPoly(self.picture, [np.rint(fine).astype(np.int32)], level, cv2.LINE_AA, SHIFT_BITS)

    def disc(self, centre: tuple[float, float], radius_px: float, level: float) -> None:
        """Fills a circle."""
        turn = np.radians(np.arange(0, 360, 2))
        self.polygon([(centre[0] + radius_px * math.cos(a), centre[1] + radius_px * math.sin(a)) for a in turn], level)

    def bar(
        self,
        angle_deg: float,
        radii: tuple[float, float],
        halves: tuple[float, float],
        level: float,
        centre: tuple[float, float] = CENTRE,
    ) -> None:
        """Fills a bar along a ray, from one radius to another, with a half width at each end."""
        cos, sin = math.cos(math.radians(angle_deg)), math.sin(math.radians(angle_deg))
        corners = [(radii[0], -halves[0]), (radii[1], -halves[1]), (radii[1], halves[1]), (radii[0], halves[0])]
        self.polygon([(centre[0] + r * cos - w * sin, centre[1] + r * sin + w * cos) for r, w in corners], level)

    def hand(self, hand: Hand, angle_deg: float) -> None:
        """Draws a needle, its tail with it."""
        if hand.tail:
            self.bar(angle_deg, (-hand.tail, 0.0), (hand.tail_half, hand.tail_half), hand.level, hand.centre)
        self.bar(angle_deg, (0.0, hand.tip), (hand.root_half, hand.tip_half), hand.level, hand.centre)

    def dial(self, ticks_deg: Sequence[float], centre: tuple[float, float] = CENTRE, radius_px: float = 76.0) -> None:
        """Draws a dial with tick marks at its rim."""
        self.disc(centre, radius_px, FACE_LEVEL)
        for angle_deg in ticks_deg:
            self.bar(angle_deg, (radius_px - 12.0, radius_px - 3.0), (1.2, 1.2), MARK_LEVEL, centre)


def apart(one: float, other: float, turn: float = 360.0) -> float:
    """Distance of two angles, or two values that repeat after a turn, the short way round."""
    return float(abs(shortest(np.array(one - other), turn)))


def finished(canvas: Canvas, *, noise: float, blur: float, quality: int, seed: int) -> GreyPicture:
    """The picture as a camera has it: with an anchor, averaged down, blurred, noisy, and through a JPEG."""
    rng = np.random.default_rng(7)
    texture = cv2.resize(rng.integers(30, 220, (9, 9)).astype(np.uint8), (40, 40), interpolation=cv2.INTER_CUBIC)
    picture = cv2.resize(canvas.picture, (WIDTH_PX, HEIGHT_PX), interpolation=cv2.INTER_AREA)
    picture[20:60, 194:234] = texture
    light = cv2.GaussianBlur(picture, (0, 0), blur) if blur else picture
    noisy = light + np.random.default_rng(seed).normal(0.0, noise, light.shape)
    levels = np.clip(np.rint(noisy), 0, 255).astype(np.uint8)
    _, jpeg = cv2.imencode(".jpg", levels, [cv2.IMWRITE_JPEG_QUALITY, quality])
    return np.asarray(cv2.imdecode(jpeg, cv2.IMREAD_GRAYSCALE), np.uint8)


def paint(
    what: Callable[[Canvas], object], *, noise: float = 3.0, blur: float = 0.7, quality: int = 90, seed: int = 0
) -> GreyPicture:
    """A frame of what a function paints."""
    canvas = Canvas()
    what(canvas)
    return finished(canvas, noise=noise, blur=blur, quality=quality, seed=seed)


def reader_for(
    gauges: Sequence[Mapping[str, Any]], picture: GreyPicture, frames: Sequence[GreyPicture] = ()
) -> PanelReader:
    """A reader of a panel with the given gauges and panel picture, tuned to frames where these are given."""
    content = {
        "name": "dials",
        "picture": "panel.png",
        "anchors": [{"name": "texture", "box": [196, 22, 36, 36]}],
        "gauges": [
            copy.deepcopy({**({} if "window" in gauge else {"centre": list(CENTRE)}), **gauge}) for gauge in gauges
        ],
    }
    source = PanelPictures(parse_panel(yaml.safe_dump(content)), {"panel.png": picture}, "0" * 64)
    reader = reader_from_panel(source, Method.NORMXCORR)
    return tune(reader, frames) if frames else reader
