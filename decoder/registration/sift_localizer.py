"""Locating a camera that is not where the panel picture was taken, by SIFT features.

The aligner searches for the panel at about the panel picture's scale. Frames of a flight for which the box was mounted
elsewhere, or that zoomed without saying so, are instead matched with the panel picture as a whole, by features that are
invariant to scale and roll (SIFT, Lowe 2004) and the perspective that most of them agree on. It is done for a few
frames of a flight, and for those that would otherwise be lost; the aligner then starts from the result.
"""

from __future__ import annotations

import math
from collections import OrderedDict
from collections.abc import Iterable
from hashlib import sha256

import cv2
import numpy as np
from numpy.typing import NDArray

from decoder.imaging.alignment import Alignment, Matrix
from decoder.imaging.motion import Frame2D, Model, MotionCovariance, carried
from decoder.imaging.pictures import GreyPicture
from decoder.imaging.thresholds import MAX_ENLARGEMENT
from decoder.registration.thresholds import KEPT, MAX_SIDE_PX, MIN_AGREEING, RATIO

FEATURES = 3000
FAST_LEVELS = 8
NEAR_PX = 4.0
TRIALS = 5000
CORNERS = 4


class SiftLocalizer:
    """Finds one panel picture in frames taken from elsewhere, or in such light that its anchors do not match."""

    def __init__(self, picture: GreyPicture) -> None:
        self._picture = picture
        self._known: tuple[NDArray[np.float32], NDArray[np.float32]] | None = None
        self._found: OrderedDict[bytes, Alignment | None] = OrderedDict()

    def find(self, frame: GreyPicture) -> Matrix | None:
        """(3, 3): from the panel picture to the frame, to a few pixels; None if too little of it is visible."""
        found = self.alignment(frame)
        return None if found is None else found.matrix

    def alignment(self, frame: GreyPicture) -> Alignment | None:
        """Find the panel picture in a frame, and how surely; None if too little of it is visible.

        Results are cached, since a frame of a sample is looked at more than once, for half a second each time.
        """
        key = sha256(frame.tobytes()).digest()
        if key not in self._found:
            self._found[key] = self._sought(frame)
            if len(self._found) > KEPT**2:  # of all frames that a flight is learned from
                self._found.popitem(last=False)
        return self._found[key]

    def _sought(self, frame: GreyPicture) -> Alignment | None:
        if self._known is None:
            self._known = _features(self._picture)
        points, described = self._known
        there, also_described = _features(frame)
        if min(len(points), len(there)) < MIN_AGREEING:
            return None
        pairs = _matches(described, also_described)
        if len(pairs) < MIN_AGREEING:
            return None
        one, other = np.array(pairs).T
        motion, agreeing = cv2.findHomography(
            points[one], there[other], cv2.USAC_MAGSAC, NEAR_PX, maxIters=TRIALS, confidence=0.999
        )
        if motion is None or int(agreeing.sum()) < MIN_AGREEING or not _is_plausible(motion, self._picture.shape):
            return None
        kept = agreeing[:, 0].astype(bool)
        here, seen = (each[kept].T.astype(np.float64) for each in (points[one], there[other]))
        covariance = _covariance(np.asarray(motion, np.float64), here, seen)
        return Alignment.of(motion, float(kept.mean())).with_covariance(covariance)


def _covariance(motion: Matrix, points: Matrix, there: Matrix) -> MotionCovariance:
    """Estimate the uncertainty of where a motion carries (2, N) points, by how far beside others they come.

    A lens that bends and parts that are raised move whole neighbourhoods, so many tell no more than the fewest would.
    """
    axes = Frame2D.around(there)
    rows = axes.jacobian(there, Model.PERSPECTIVE).reshape(-1, Model.PERSPECTIVE)
    off_px2 = np.square(carried(motion, points) - there).sum() / Model.SHIFT / MIN_AGREEING
    normal = rows.T @ rows  # nearly singular if they lie on a line
    inverse = np.linalg.inv(normal + np.eye(len(normal)) * np.finfo(np.float64).eps * normal.trace())
    return MotionCovariance(axes, Model.PERSPECTIVE, inverse * off_px2)


def _features(picture: GreyPicture) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    """(N, 2) places in the picture's pixels, and (N, 128) descriptors."""
    part = min(1.0, MAX_SIDE_PX / max(picture.shape))
    small = cv2.resize(picture, None, fx=part, fy=part, interpolation=cv2.INTER_AREA) if part < 1.0 else picture
    described = None
    corners = cv2.FastFeatureDetector.create(FAST_LEVELS).detect(small)  # takes a hundredth of what SIFT does
    if len(corners) >= MIN_AGREEING:
        points, described = cv2.SIFT.create(nfeatures=FEATURES).detectAndCompute(small, None)
    if described is None:
        return np.empty((0, 2), np.float32), np.empty((0, 128), np.float32)
    places = (np.array([point.pt for point in points]) + 0.5) / part - 0.5
    return places.astype(np.float32), described.astype(np.float32)


def _matches(described: NDArray[np.float32], also_described: NDArray[np.float32]) -> list[tuple[int, int]]:
    """Match the pairs that are clearly each other's best."""
    near = cv2.BFMatcher(cv2.NORM_L2).knnMatch(described, also_described, k=2)
    pairs: Iterable[tuple[int, int]] = (
        (best.queryIdx, best.trainIdx)
        for best, *second in near
        if second and best.distance < RATIO * second[0].distance
    )
    taken: dict[int, int] = {}
    for one, other in pairs:
        taken.setdefault(other, one)
    return [(one, other) for other, one in taken.items()]


def _is_plausible(motion: Matrix, shape: tuple[int, ...]) -> bool:
    """Whether the panel picture stays a picture: not folded over, not mirrored, neither tiny nor huge."""
    height, width = shape
    corners = np.array([[0, width, width, 0], [0, 0, height, height], [1, 1, 1, 1]], np.float64)
    there = motion @ corners
    if (there[2] * there[2, 0] <= 0).any():
        return False
    x, y = there[:2] / there[2]
    area = 0.5 * float(np.sum(x * np.roll(y, -1) - y * np.roll(x, -1)))
    return area > 0 and 1 / MAX_ENLARGEMENT < math.sqrt(area / (width * height)) < MAX_ENLARGEMENT
