"""Grey levels along a line of a picture."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from decoder.calibration.thresholds import PER_PX
from decoder.imaging.pictures import GreyPicture

Array = NDArray[np.float64]

_BESIDE_PX = (-1.0, 0.0, 1.0)  # averaged across the line: ticks are longer than that


@dataclass(frozen=True, slots=True)
class Line:
    """A line in a picture, from one pixel (x, y) to another."""

    start_px: tuple[float, float]
    end_px: tuple[float, float]

    @property
    def length_px(self) -> float:
        """Its length."""
        return float(np.hypot(*self._vector))

    @property
    def _vector(self) -> Array:
        return np.asarray(np.subtract(self.end_px, self.start_px), np.float64)

    @property
    def direction(self) -> Array:
        """(2,) of length one."""
        return np.asarray(self._vector / self.length_px)

    @property
    def normal(self) -> Array:
        """(2,) of length one, to the right of the line's direction."""
        x, y = self.direction
        return np.array([-y, x])

    def points(self, along_px: Array) -> Array:
        """(N, 2) pixels at (N,) distances from the start."""
        return np.asarray(np.add(self.start_px, along_px[:, None] * self.direction))

    def foot(self, point_px: tuple[float, float]) -> tuple[float, float]:
        """Return a point's distance along the line and, signed, beside it, in pixels."""
        away = np.subtract(point_px, self.start_px)
        return float(away @ self.direction), float(away @ self.normal)


def profile(picture: GreyPicture, line: Line) -> Array:
    """(length * PER_PX + 1,) grey levels along a line, `PER_PX` samples to a pixel, three pixels broad."""
    along = np.arange(int(line.length_px * PER_PX) + 1) / PER_PX
    middle = line.points(along)
    rows = [sampled(picture, middle + beside * line.normal) for beside in _BESIDE_PX]
    return np.asarray(np.mean(rows, axis=0))


def sampled(picture: GreyPicture, points_px: Array) -> Array:
    """(N,) grey levels at (N, 2) pixels, bilinear; outside the picture its edge repeats."""
    height, width = picture.shape
    x = np.clip(points_px[:, 0], 0, width - 1)
    y = np.clip(points_px[:, 1], 0, height - 1)
    left, top = np.minimum(x.astype(int), width - 2), np.minimum(y.astype(int), height - 2)
    right_part, low_part = x - left, y - top
    above = picture[top, left] * (1 - right_part) + picture[top, left + 1] * right_part
    below = picture[top + 1, left] * (1 - right_part) + picture[top + 1, left + 1] * right_part
    return np.asarray(above * (1 - low_part) + below * low_part)
