"""The level edge: a line of the panel whose direction in a frame tells the camera's roll (thesis 3.4.1)."""

from __future__ import annotations

import math

import numpy as np

from decoder.alignment import bent
from decoder.features import Feature, correlation_of_rows, sample
from decoder.lens import Lens
from decoder.pictures import GreyPicture

MAX_ROLL_DEG = 8.0
NEAR_ROLL_DEG = 0.5
GOOD_SCORE = 0.8


class LevelFinder:
    """Finds the roll that carries the level edge into a frame, by trying rolls about a known point."""

    def __init__(self, feature: Feature, pivot_px: tuple[float, float], lens: Lens | None = None) -> None:
        self._feature = feature
        self._lens = lens if lens is not None and lens.distorts else None
        self._x, self._y = feature.points - np.array(pivot_px, np.float32)[:, None]
        lever_px = float(np.hypot(self._x, self._y).max())
        self._step_deg = math.degrees(1.0 / lever_px)  # one pixel at the edge's far end

    def find(self, frame: GreyPicture, pivot_px: tuple[float, float], usual_roll_deg: float) -> float:
        """The roll in degrees, to a pixel at the edge's far end; `pivot_px` is the known point in the frame."""
        score, roll_deg = self._best(frame, pivot_px, usual_roll_deg, NEAR_ROLL_DEG)
        if score < GOOD_SCORE or abs(roll_deg - usual_roll_deg) > NEAR_ROLL_DEG - self._step_deg:
            _, roll_deg = max((score, roll_deg), self._best(frame, pivot_px, usual_roll_deg, MAX_ROLL_DEG))
        return roll_deg

    def _best(
        self, frame: GreyPicture, pivot_px: tuple[float, float], middle_deg: float, reach_deg: float
    ) -> tuple[float, float]:
        count = math.ceil(reach_deg / self._step_deg)
        rolls_deg = middle_deg + self._step_deg * np.arange(-count, count + 1)
        cos, sin = (f(np.radians(rolls_deg)).astype(np.float32)[:, None] for f in (np.cos, np.sin))
        x = cos * self._x - sin * self._y + np.float32(pivot_px[0])
        y = sin * self._x + cos * self._y + np.float32(pivot_px[1])
        if self._lens is not None:
            x, y = np.moveaxis(bent(np.stack([x, y], axis=-1), self._lens), -1, 0)
        scores = correlation_of_rows(sample(frame, x, y), self._feature.pixels)
        best = int(scores.argmax())
        return float(scores[best]), float(rolls_deg[best])
