"""Displays drawn from a formula: seven pointed bars a digit, with what goes wrong in cockpits."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import cv2
import numpy as np

from decoder.imaging.unwrapping import WindowGrid
from decoder.panel.arrays import Floats
from decoder.panel.kinds.digits import Digits
from decoder.panel.kinds.pattern import CELLS

FINE = 8
BARS = {
    "a": ((0, 0), (1, 0)),
    "b": ((1, 0), (1, 1)),
    "c": ((1, 1), (1, 2)),
    "d": ((0, 2), (1, 2)),
    "e": ((0, 1), (0, 2)),
    "f": ((0, 0), (0, 1)),
    "g": ((0, 1), (1, 1)),
}
LIT = {
    "0": "abcdef",
    "1": "bc",
    "2": "abged",
    "3": "abgcd",
    "4": "fgbc",
    "5": "afgcd",
    "6": "afgecd",
    "7": "abc",
    "8": "abcdefg",
    "9": "abcfgd",
    " ": "",
}


@dataclass(frozen=True)
class Drawn:
    """A display as it is built: sizes in pixels, `slant` to the right for each pixel upwards, `at` its top left."""

    pattern: str = "000.00"
    width: float = 6.0
    height: float = 13.0
    pitch: float = 10.5
    stroke: float = 1.9
    slant: float = 0.1
    at: tuple[float, float] = (12.0, 8.0)
    dead: tuple[tuple[int, str], ...] = ()
    """Cells and their segments that never light."""
    forms: tuple[tuple[str, str], ...] = ()
    """Digits that are drawn otherwise than usual, and their segments."""
    points: tuple[int, ...] = ()
    """Cells behind which a point is lit though the pattern has none."""

    def picture(self, text: str) -> Floats:
        """(R, C) float32 in [0, 1]: a picture of the panel that shows a text, sign by sign as the pattern has them.

        A blank in place of a point leaves it dark.
        """
        rows, columns = round(self.height + 21), round(24 + self.pitch * len(self.pattern))
        canvas = np.zeros((rows * FINE, columns * FINE), np.uint8)
        x, cell = self.at[0], 0
        for own, sign in zip(text, self.pattern, strict=True):
            if sign not in CELLS:
                if own == ".":
                    self._dot(canvas, x - 0.3 * self.pitch)
                x += 0.4 * self.pitch
                continue
            for name in {**LIT, **dict(self.forms)}[own]:
                if (cell, name) not in self.dead:
                    self._bar(canvas, x, BARS[name])
            if cell in self.points:
                self._dot(canvas, x + 0.6 * self.pitch)
            x, cell = x + self.pitch, cell + 1
        fine = cv2.GaussianBlur(canvas.astype(np.float32) / 255.0, (0, 0), 0.5 * FINE)
        return cv2.resize(fine, (columns, rows), interpolation=cv2.INTER_AREA).astype(np.float32)

    def corners(self, off_px: Sequence[float] = (0.0,) * 8) -> tuple[tuple[float, float], ...]:
        """Return the window around the digits, drawn by a hand that is off by so much, in x and y of each corner."""
        cells = sum(sign in CELLS for sign in self.pattern)
        others = len(self.pattern) - cells
        half = self.stroke / 2
        left, right = self.at[0] - half, self.at[0] + (cells - 1 + 0.4 * others) * self.pitch + self.width + half
        top, bottom, lean = self.at[1] - half, self.at[1] + self.height + half, self.slant * self.height
        ideal = (left, top), (right + lean, top), (right + lean, bottom), (left, bottom)
        return tuple((x + off_px[2 * i], y + off_px[2 * i + 1]) for i, (x, y) in enumerate(ideal))

    def grid(self, off_px: Sequence[float] = (0.0,) * 8) -> WindowGrid:
        """Return the samples of that window."""
        one, two, three, four = self.corners(off_px)
        return WindowGrid.of((one, two, three, four), Digits.margin_part)

    def _at(self, x: float, u: float, v: float) -> tuple[float, float]:
        """Place in the picture of a point of a cell, u across and v down in half heights."""
        y = v * self.height / 2
        return x + u * self.width + self.slant * (self.height - y), self.at[1] + y

    def _bar(self, canvas: Floats, x: float, ends: tuple[tuple[int, int], tuple[int, int]]) -> None:
        one, other = (np.array(self._at(x, *end)) for end in ends)
        along = (other - one) / np.linalg.norm(other - one)
        across = np.array([-along[1], along[0]]) * self.stroke / 2
        one, other = one + 0.4 * along, other - 0.4 * along
        inner = along * self.stroke / 2
        points = [
            one,
            one + inner + across,
            other - inner + across,
            other,
            other - inner - across,
            one + inner - across,
        ]
        cv2.fillPoly(canvas, [np.round((np.array(points) + 0.5) * FINE).astype(np.int32)], 255)

    def _dot(self, canvas: Floats, x: float) -> None:
        place = (np.array([x + self.width / 3, self.at[1] + self.height]) + 0.5) * FINE
        cv2.circle(canvas, tuple(place.astype(int).tolist()), round(0.9 * FINE), 150, -1)


def sampled(grid: WindowGrid, picture: Floats) -> Floats:
    """(R, C) float32: a picture on a window's grid."""
    x, y = grid.points()
    return cv2.remap(picture, x, y, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE).astype(np.float32)


def exposed(shown: Floats, *, light: float = 1.0, ground: float = 20.0, noise: float = 2.0, seed: int = 0) -> Floats:
    """Grey levels of a display on dark ground, or with a `light` below zero of a dark one on light ground."""
    levels = ground + 90.0 * light * shown + np.random.default_rng(seed).normal(0.0, noise, shown.shape)
    return np.clip(np.round(levels), 0.0, 255.0).astype(np.float32)
