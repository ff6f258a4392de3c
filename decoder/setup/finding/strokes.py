"""Strokes: the short straight edges of a picture, and the points that many of them aim at from all around.

Tick marks point at the pivot of their dial, however obliquely it is seen, and so does the needle. No other place of a
panel is aimed at from so many directions: letters aim at themselves, frames in two directions.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from decoder.panel.arrays import Floats
from decoder.setup.finding.thresholds import FROM_LENGTHS, LEAST_PX, MOST_PX, TO_LENGTHS

# Strokes of a small dial are two pixels wide, so edges are found in the picture at this scale.
ENLARGED = 2.0
# How far a stroke's aim is followed, as a part of the picture.
REACH_PART = 0.42
# The size of a cell of places; directions within this width count once.
CELL_PX = 2.0
DIRECTIONS = 18
BLUR_CELLS = 0.8
ENOUGH_IN_ONE = 0.6


@dataclass(frozen=True, slots=True)
class Strokes:
    """Straight edges: (N, 2) px the middle of each, (N, 2) its direction, a unit vector, (N,) its length."""

    at: Floats
    along: Floats
    length_px: Floats

    def __len__(self) -> int:
        return len(self.length_px)

    def where(self, chosen: NDArray[np.bool_]) -> Strokes:
        """Select some."""
        return Strokes(self.at[chosen], self.along[chosen], self.length_px[chosen])

    def seen_from(self, point: tuple[float, float]) -> tuple[Floats, Floats]:
        """(N,) each: how far strokes are from a point, and how far beside it their lines pass."""
        away = self.at - np.array(point)
        return np.hypot(*away.T), np.abs(away[:, 0] * self.along[:, 1] - away[:, 1] * self.along[:, 0])


def strokes_in(picture: NDArray[np.uint8]) -> Strokes:
    """Find the straight edges of a grey picture, (H, W)."""
    large = cv2.resize(picture, None, fx=ENLARGED, fy=ENLARGED, interpolation=cv2.INTER_CUBIC)
    found = cv2.createLineSegmentDetector(cv2.LSD_REFINE_STD, 1.0).detect(large)[0]
    if found is None:
        return Strokes(np.zeros((0, 2)), np.zeros((0, 2)), np.zeros(0))
    ends = (found.reshape(-1, 4).astype(np.float64) + 0.5) / ENLARGED - 0.5
    across = ends[:, 2:] - ends[:, :2]
    length = np.hypot(across[:, 0], across[:, 1])
    fit = (length > LEAST_PX) & (length < MOST_PX)
    return Strokes((ends[fit, :2] + ends[fit, 2:]) / 2, across[fit] / length[fit, None], length[fit])


def aimed_at(strokes: Strokes, size_px: tuple[int, int]) -> Floats:
    """(H / CELL_PX, W / CELL_PX): the number of directions from which some stroke aims at each place."""
    height, width = (int(side / CELL_PX) + 1 for side in size_px)
    total = np.zeros((DIRECTIONS, height, width), np.float32)
    for sign in (1.0, -1.0):
        aim = sign * strokes.along
        sector = (np.degrees(np.arctan2(-aim[:, 1], -aim[:, 0])) % 360.0 // (360.0 / DIRECTIONS)).astype(np.int64)
        for away in np.arange(3 * CELL_PX, REACH_PART * min(size_px), 0.7 * CELL_PX):
            near = (away > FROM_LENGTHS * strokes.length_px) & (away < TO_LENGTHS * strokes.length_px)
            column, row = np.rint((strokes.at[near] + aim[near] * away) / CELL_PX).astype(np.int64).T
            inside = (column >= 0) & (column < width) & (row >= 0) & (row < height)
            np.add.at(total, (sector[near][inside], row[inside], column[inside]), 1.0)
    smooth = np.stack([cv2.GaussianBlur(each, (0, 0), BLUR_CELLS) for each in total])
    told: Floats = np.asarray(smooth / ENOUGH_IN_ONE, np.float32)
    aimed: Floats = np.asarray(np.minimum(told, 1.0).sum(axis=0), np.float32)
    return aimed


def peaks(aimed: Floats, count: int, apart_px: float) -> Iterator[tuple[tuple[float, float], float]]:
    """Yield the places that are aimed at most, px, with the number of directions, at a minimum distance."""
    left = aimed.astype(np.float32)
    cells = 1 + round(apart_px / CELL_PX)
    for _ in range(count):
        row, column = np.unravel_index(int(left.argmax()), left.shape)
        yield (float(column) * CELL_PX, float(row) * CELL_PX), float(left[row, column])
        cv2.circle(left, (int(column), int(row)), cells, 0.0, -1)
