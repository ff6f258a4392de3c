"""Alignment noise: how uncertain a flight's alignments are beside what they claim, as their own residuals tell.

A registration claims what it would be uncertain by if each pixel had noise of its own, some of it shared. How much of
it neighbours really share differs: what JPEG leaves of a sharp picture is finer than its edges, and says less of the
motion than such noise would; glare and blur cover whole parts of a feature, and say more. Summed over blocks of pixels
as large as JPEG's, the pulls of what is left unexplained tell how far they scatter (the cluster-robust covariance of
Liang and Zeger 1986).
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence

import numpy as np

from decoder.alignment import Alignment
from decoder.arrays import Floats, Indices
from decoder.features import Feature
from decoder.motion import Frame2D, Model, MotionCovariance
from decoder.pictures import GreyPicture

BLOCK_PX = 8
# Blocks must outnumber what they are to tell by this.
BLOCKS_FOR_EACH = 4


class BlockPulls:
    """What some features' pixels pull at a motion, block by block.

    Parameters
    ----------
    features
        Where frames usually have them.
    claimed
        What a registration on them claims: its axes and its model are taken over.
    """

    def __init__(self, features: Sequence[Feature], claimed: MotionCovariance) -> None:
        self._features = features
        self._axes, self._model = claimed.axes, claimed.model
        parts = [self._of(feature) for feature in features]
        self._light = [light for light, _, _ in parts]
        self._of_light = [of_light for _, of_light, _ in parts]
        self._columns = [columns for _, _, columns in parts]
        self._blocks = [_blocks(feature.points) for feature in features]
        self._count = sum(int(blocks.max()) + 1 for blocks in self._blocks)
        self._inverse = np.linalg.pinv(sum(columns.T @ columns for columns in self._columns))

    @property
    def tell(self) -> bool:
        """Whether there are blocks enough."""
        return self._count >= BLOCKS_FOR_EACH * int(self._model)

    def found(self, frame: GreyPicture, alignment: Alignment) -> MotionCovariance:
        """Of the motion with which the features match best in a frame, as the blocks tell."""
        middle = np.zeros_like(self._inverse)
        parts = zip(self._features, self._light, self._of_light, self._columns, self._blocks, strict=True)
        for feature, light, of_light, columns, blocks in parts:
            seen = feature.sample(frame, alignment).astype(np.float64)
            lit = of_light @ seen
            pulls = columns * ((seen - light @ lit) / lit[0])[:, None]
            summed = np.stack([np.bincount(blocks, weights=pull) for pull in pulls.T])
            middle += summed @ summed.T
        own = self._count / (self._count - int(self._model))  # what is left is the less, the more was fitted
        return MotionCovariance(self._axes, self._model, self._inverse @ middle @ self._inverse * own)

    def _of(self, feature: Feature) -> tuple[Floats, Floats, Floats]:
        """What light can do to a feature's pixels (N, 4), its inverse, and what motion does beyond (N, parameters)."""
        jacobian = self._axes.jacobian(feature.points, self._model)
        columns = np.einsum("in,inp->np", feature.gradient.astype(np.float64), jacobian)
        x, y = feature.points.astype(np.float64) - feature.points.mean(axis=1, dtype=np.float64)[:, None]
        light = np.stack([feature.pixels.astype(np.float64), np.ones(x.size), x, y], axis=1)
        of_light = np.linalg.pinv(light)
        return light, of_light, columns - light @ (of_light @ columns)


def noise_beside_claim(pairs: Iterable[tuple[MotionCovariance, MotionCovariance]], places: Floats) -> float:
    """How many times as uncertain as they claim (2, N) places are, from (claimed, found) pairs of some frames."""
    claimed_px2 = found_px2 = 0.0
    jacobians: dict[tuple[Frame2D, Model], Floats] = {}  # mostly all have the same

    def summed_px2(one: MotionCovariance) -> float:
        key = (one.axes, one.model)
        if key not in jacobians:
            jacobians[key] = one.axes.jacobian(places, one.model)
        return float(np.square(one.sigma_by(jacobians[key])).sum())

    for claimed, found in pairs:
        claimed_px2 += summed_px2(claimed)
        found_px2 += summed_px2(found)
    return math.sqrt(found_px2 / claimed_px2) if claimed_px2 > 0.0 else 1.0


def _blocks(points: Floats) -> Indices:
    """(N,) whole numbers from 0: the block in which each of (2, N) points lies."""
    across, down = np.floor(points / BLOCK_PX).astype(np.int64)
    place = across * (int(np.abs(down).max()) * 2 + 1) + down
    place -= place.min()
    there = np.zeros(int(place.max()) + 1, bool)
    there[place] = True
    numbers: Indices = np.cumsum(there)[place] - 1
    return numbers
