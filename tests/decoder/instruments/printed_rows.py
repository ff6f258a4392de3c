"""Rows of printed digits drawn from a formula: drums that roll and carry, wheels that step, dots; in several fonts."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from functools import cache

import cv2
import numpy as np
from PIL import Image, ImageDraw, ImageFont

from decoder.imaging.unwrapping import WindowGrid
from decoder.panel.arrays import Floats
from decoder.panel.kinds.printed import drums_at

FINE = 6
PAD_PX = 8


@cache
def grotesque(digit: int, height_px: float) -> Floats:
    """A digit of this height in a font that comes with Pillow: fine pixels, ink 1."""
    font = ImageFont.load_default(height_px * FINE / 0.72)
    picture = Image.new("L", (round(height_px * FINE), round(1.4 * height_px * FINE)))
    middle = picture.width / 2, picture.height / 2
    ImageDraw.Draw(picture).text(middle, str(digit), fill=255, font=font, anchor="mm")
    return np.asarray(picture, np.float32) / 255


@cache
def plotted(digit: int, height_px: float) -> Floats:
    """The same drawn with a pen, as OpenCV does."""
    size = round(height_px * FINE), round(1.4 * height_px * FINE)
    canvas = np.zeros(size[::-1], np.uint8)
    scale, thick = height_px * FINE / 22, max(round(height_px * FINE / 8), 1)
    (wide, high), _ = cv2.getTextSize(str(digit), cv2.FONT_HERSHEY_DUPLEX, scale, thick)
    at = (size[0] - wide) // 2, (size[1] + high) // 2
    cv2.putText(canvas, str(digit), at, cv2.FONT_HERSHEY_DUPLEX, scale, 255, thick, cv2.LINE_AA)
    return canvas.astype(np.float32) / 255


@cache
def dotted(digit: int, height_px: float) -> Floats:
    """The same of dots, five by seven."""
    rows = {
        0: "01110 10001 10011 10101 11001 10001 01110",
        1: "00100 01100 00100 00100 00100 00100 01110",
        2: "01110 10001 00001 00110 01000 10000 11111",
        3: "01110 10001 00001 00110 00001 10001 01110",
        4: "00010 00110 01010 10010 11111 00010 00010",
        5: "11111 10000 11110 00001 00001 10001 01110",
        6: "00110 01000 10000 11110 10001 10001 01110",
        7: "11111 00001 00010 00100 01000 01000 01000",
        8: "01110 10001 10001 01110 10001 10001 01110",
        9: "01110 10001 10001 01111 00001 00010 01100",
    }[digit].split()
    size = round(height_px * FINE), round(1.4 * height_px * FINE)
    canvas = np.zeros(size[::-1], np.float32)
    dot = height_px * FINE / 7
    for row, signs in enumerate(rows):
        for column, sign in enumerate(signs):
            at = round(size[0] / 2 + (column - 2) * dot), round(size[1] / 2 + (row - 3) * dot)
            cv2.circle(canvas, at, round(0.4 * dot), float(sign), -1)
    return canvas


Font = Callable[[int, float], Floats]


@dataclass(frozen=True)
class DrawnRow:
    """A row of drums as it is built, in pixels; digits `height` high, `pitch` apart on each drum, seen `slot` high."""

    drums: int = 4
    font: Font = grotesque
    height: float = 16.0
    pitch: float = 22.0
    slot: float = 24.0
    light: float = 110.0
    ground: float = 40.0
    goes_down: bool = False
    blur: float = 0.7
    noise: float = 2.5
    off_px: float = 0.25
    """How far frames are placed beside where they are."""
    seed: int = 0
    rng: np.random.Generator = field(default_factory=lambda: np.random.default_rng(0))

    @property
    def width(self) -> int:
        """Of a drum."""
        return round(0.85 * self.height)

    def grid(self, hand_px: float = 0.0) -> WindowGrid:
        """The window, its corners drawn by a hand that is off by up to so much."""
        left, top, right, bottom = PAD_PX, PAD_PX, PAD_PX + self.drums * self.width - 1, PAD_PX + self.slot - 1
        ideal = np.array([(left, top + 1), (right, top + 1), (right, bottom - 1), (left, bottom - 1)])
        one, two, three, four = (ideal + self.rng.uniform(-hand_px, hand_px, (4, 2))).tolist()
        return WindowGrid.of((tuple(one), tuple(two), tuple(three), tuple(four)))

    def picture(self, count: float) -> Floats:
        """(R, C) float32 grey levels of the panel where it counts so many."""
        columns = [self._drum(place) for place in drums_at(np.array(count), self.drums).tolist()]
        row = np.pad(np.concatenate(columns, axis=1), PAD_PX * FINE, constant_values=0.25)
        move = np.eye(2, 3)
        move[:, 2] = self.rng.uniform(-self.off_px, self.off_px, 2) * FINE
        row = cv2.warpAffine(row, move, row.shape[::-1], borderMode=cv2.BORDER_REPLICATE)
        row = cv2.GaussianBlur(row, (0, 0), self.blur * FINE)
        small = cv2.resize(row, (row.shape[1] // FINE, row.shape[0] // FINE), interpolation=cv2.INTER_AREA)
        levels = self.ground + self.light * small + self.rng.normal(0.0, self.noise, small.shape)
        return np.clip(np.round(levels), 0, 255).astype(np.float32)

    def _drum(self, place: float) -> Floats:
        """View of a drum at a position, in digits."""
        rows, columns = round(self.slot * FINE), self.width * FINE
        seen = np.zeros((3 * rows, columns), np.float32)
        side = -1 if self.goes_down else 1
        for number in (-1, 0, 1, 2):
            digit = self.font((int(place) + number) % 10, self.height)
            off = round(side * (number - place % 1) * self.pitch * FINE)
            top = (3 * rows - digit.shape[0]) // 2 + off
            left = (digit.shape[1] - columns) // 2
            part = (
                digit[:, left : left + columns] if left >= 0 else np.pad(digit, ((0, 0), (-left, columns)))[:, :columns]
            )
            first, last = max(top, 0), min(top + len(part), len(seen))
            if first < last:
                seen[first:last] = np.maximum(seen[first:last], part[first - top : last - top])
        return seen[rows : 2 * rows]


def texts_of(counts: Sequence[float], drums: int) -> list[str]:
    """What is written in `shows` for counts: a digit more where the last drum is between two."""
    return [f"{int(count):0{drums}d}" + (f"{count % 1:.1f}"[2:] if count % 1 else "") for count in counts]
