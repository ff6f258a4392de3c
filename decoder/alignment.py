"""The alignment: where the panel picture's points lie in one frame."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Self

import numpy as np

from decoder.arrays import Floats


@dataclass(frozen=True, slots=True)
class Alignment:
    """A shift and a roll that carry points of the panel picture into a frame.

    `frame = rotation(roll) @ panel + offset`, points (x, y) in pixels, roll in degrees, positive clockwise on the
    screen. `score` is the lowest NCC score of what it rests on.
    """

    roll_deg: float
    offset_px: tuple[float, float]
    score: float

    @classmethod
    def pinned(
        cls, panel_px: tuple[float, float], frame_px: tuple[float, float], roll_deg: float, score: float
    ) -> Self:
        """The alignment with `roll_deg` that carries `panel_px` to `frame_px`."""
        cos, sin = math.cos(math.radians(roll_deg)), math.sin(math.radians(roll_deg))
        x, y = panel_px
        return cls(roll_deg, (frame_px[0] - (cos * x - sin * y), frame_px[1] - (sin * x + cos * y)), score)

    @property
    def matrix(self) -> Floats:
        """(2, 3) float32: panel picture to frame, as OpenCV's warps take it."""
        cos, sin = math.cos(math.radians(self.roll_deg)), math.sin(math.radians(self.roll_deg))
        return np.array([[cos, -sin, self.offset_px[0]], [sin, cos, self.offset_px[1]]], np.float32)

    def to_frame(self, point_px: tuple[float, float]) -> tuple[float, float]:
        """Where a point of the panel picture lies in the frame, (x, y) px."""
        x, y = self.matrix.astype(np.float64) @ (point_px[0], point_px[1], 1.0)
        return float(x), float(y)


IDENTITY = Alignment(0.0, (0.0, 0.0), 1.0)
