"""Anchors proposed: unique places on the panel that stay where they are in all frames and are well spread."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from decoder.panel.arrays import Floats
from decoder.registration.thresholds import SCORE_THRESHOLD

Grey = NDArray[np.uint8]

# The size of a box, as a part of the picture's width, and how far around its place it is searched for.
BOX_PART, SEARCH_PART = 0.03, 0.08
# The picture is divided into this many cells per side; and the number of boxes proposed.
CELLS = 7
MOST = 10


@dataclass(frozen=True, slots=True)
class ProposedAnchor:
    """A box: left, top, width, height, px; how well frames showed it again, and the best match elsewhere."""

    box: tuple[int, int, int, int]
    seen: float
    alike: float


def anchors_on(picture: Grey, frames: Sequence[Grey]) -> list[ProposedAnchor]:
    """Propose anchors, well spread; without frames only by their looks.

    Parameters
    ----------
    picture : (H, W)
    frames : others of the same size
    """
    candidates = [each for each in _sharp(picture) if _alike(picture, each) < SCORE_THRESHOLD]
    if not candidates:
        return []
    seen = np.ones(len(candidates))
    if frames:
        found = np.array([[_found(picture, frame, box) for box in candidates] for frame in frames])
        moved, score = found[..., :2], found[..., 2]
        # The panel moved as most boxes did; a box that moved otherwise was something else.
        together = np.median(moved, axis=1, keepdims=True)
        apart = np.hypot(*np.moveaxis(moved - together, -1, 0))
        score = np.where(apart <= 0.02 * picture.shape[1], score, 0.0)
        seen = np.median(score, axis=0) * np.mean(score >= SCORE_THRESHOLD, axis=0)
    still = [index for index in np.argsort(-seen) if seen[index] >= SCORE_THRESHOLD]
    return [
        ProposedAnchor(candidates[index], round(float(seen[index]), 3), round(_alike(picture, candidates[index]), 3))
        for index in _spread(candidates, still)
    ]


def _sharp(picture: Grey) -> list[tuple[int, int, int, int]]:
    """Find the boxes with most corners, one for each cell of the picture."""
    side = 2 * round(BOX_PART * picture.shape[1] / 2)
    if not 0 < 3 * side < min(picture.shape):
        return []
    corners = cv2.cornerMinEigenVal(cv2.GaussianBlur(picture, (0, 0), 1.0), 5)
    much: Floats = np.asarray(cv2.boxFilter(np.sqrt(np.maximum(corners, 0)), -1, (side, side)), np.float32)
    height, width = picture.shape
    found = []
    for top in np.linspace(side, height - 2 * side, CELLS + 1).astype(int)[:-1]:
        for left in np.linspace(side, width - 2 * side, CELLS + 1).astype(int)[:-1]:
            cell = much[top : top + (height - 3 * side) // CELLS, left : left + (width - 3 * side) // CELLS]
            if not cell.size:
                continue
            row, column = np.unravel_index(int(cell.argmax()), cell.shape)
            found.append((int(left + column) - side // 2, int(top + row) - side // 2, side, side))
    return [box for box in found if _patch(picture, box).std() > 2 * 4.0]


def _patch(picture: Grey, box: tuple[int, int, int, int]) -> Grey:
    left, top, width, height = box
    return picture[top : top + height, left : left + width]


def _alike(picture: Grey, box: tuple[int, int, int, int]) -> float:
    """Return the best match elsewhere, at half the size."""
    half = cv2.pyrDown(picture)
    left, top, width, height = (side // 2 for side in box)
    own = half[top : top + height, left : left + width]
    scores = cv2.matchTemplate(half, own, cv2.TM_CCOEFF_NORMED)
    scores[max(top - height // 2, 0) : top + height // 2, max(left - width // 2, 0) : left + width // 2] = -1.0
    return float(scores.max())


def _found(picture: Grey, frame: Grey, box: tuple[int, int, int, int]) -> tuple[float, float, float]:
    """Return how far a box moved in a frame, px, and how well it matches there."""
    left, top, width, height = box
    reach = round(SEARCH_PART * picture.shape[1])
    x, y = max(left - reach, 0), max(top - reach, 0)
    scores = cv2.matchTemplate(
        frame[y : top + height + reach, x : left + width + reach], _patch(picture, box), cv2.TM_CCOEFF_NORMED
    )
    row, column = np.unravel_index(int(scores.argmax()), scores.shape)
    return float(column + x - left), float(row + y - top), float(scores[row, column])


def _spread(boxes: Sequence[tuple[int, int, int, int]], left: list[int]) -> list[int]:
    """Choose from the boxes that are left one by one, each as far as possible from those before it."""
    chosen: list[int] = []
    for _ in range(MOST):
        if not left:
            break
        best = max(
            left,
            key=lambda index: min((math.dist(boxes[index][:2], boxes[other][:2]) for other in chosen), default=0.0),
        )
        chosen.append(best)
        left.remove(best)
    return chosen
