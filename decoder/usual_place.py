"""The first look at frames, many at once: those whose features all match well where the panel usually lies.

The same least squares as `registration`, with all frames in the same arrays. A frame that is less than plain is left to
the search of its own. Nothing that is found in a frame depends on the frames beside it.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from decoder.alignment import Alignment, Matrix, carried_by
from decoder.arrays import Floats, Indices, Mask
from decoder.motion import MotionCovariance
from decoder.pictures import GreyPicture
from decoder.registration import (
    EXPECTED_SHRINKAGE,
    FULL_STEPS,
    ITERATIONS,
    MAX_SHRINKAGE,
    MAX_STEP_PX,
    PATCH_MARGIN_PX,
    SETTLED_PX,
    Registration,
    Start,
)
from decoder.resampling import put_levels


class UsualPlace:
    """Finds the panel near where it usually lies.

    Parameters
    ----------
    registration
        On all of the panel's features.
    start
        Where it looks first.
    usual
        (3, 3): the panel picture to where the registration's features are.
    least_score
        What all features must match at least.
    """

    def __init__(self, registration: Registration, start: Alignment, usual: Matrix, least_score: float) -> None:
        self._registration = registration
        self._start, self._usual, self._least_score = start, usual, least_score
        self._points = [points.folded.reshape(-1, 2).T.astype(np.float64) for points in registration.maps]
        self._upright = [np.vstack([points, np.ones(points.shape[1])]) for points in self._points]

    def find(self, frames: Sequence[GreyPicture]) -> list[Alignment | None]:
        """Where the panel picture lies in frames of one size; None where that takes more than a look."""
        found: list[Alignment | None] = [None] * len(frames)
        starts = self._registration.started(frames[0], self._start)
        if None in starts:
            return found
        patches = [_cut(frames, own) for own in starts if own]
        origins = [(own.columns.start, own.rows.start) for own in starts if own]
        first = [own.places for own in starts if own]
        open_ = np.arange(len(frames))
        matrices = np.broadcast_to(self._start.matrix, (len(frames), 3, 3))
        shrinkage, before_px = np.full(len(frames), EXPECTED_SHRINKAGE), np.zeros(len(frames))
        margin_px = np.full(len(frames), float(PATCH_MARGIN_PX))
        for iteration in range(ITERATIONS):
            sums, energies = [], []
            for index, (own, origin) in enumerate(zip(patches, origins, strict=True)):
                places = [first[index]] * len(open_) if iteration == 0 else self._places(index, matrices, origin)
                values = np.empty((len(open_), *places[0].shape[:2]), np.float32)
                for levels, frame, at in zip(values, open_.tolist(), places, strict=True):
                    put_levels(levels, own[frame], at)
                of_feature = self._registration.summed(index, values.reshape(len(open_), -1))
                sums.append(of_feature[0])
                energies.append(of_feature[1])
            step, scores = self._registration.steps(sums, energies)
            if iteration >= FULL_STEPS:
                step *= 0.5  # as in `registration`
            reach_px = np.hypot(step[:, 0], step[:, 1]) + np.abs(step[:, 2:]).sum(axis=1)
            axes, model = self._registration.axes, self._registration.model
            matrices = matrices @ axes.matrices(-step, model)
            matrices = matrices / matrices[:, 2:, 2:]
            margin_px = margin_px - reach_px
            known = before_px > 0
            ratio = np.minimum(np.divide(reach_px, before_px, out=np.ones_like(reach_px), where=known), MAX_SHRINKAGE)
            shrinkage = np.where(known, ratio, shrinkage)
            plain = (scores > 0).all(axis=1) & (reach_px <= MAX_STEP_PX) & (margin_px > 0)
            done = plain & (reach_px * shrinkage / (1.0 - shrinkage) < SETTLED_PX)
            good = done & (scores.min(axis=1) >= self._least_score)
            self._put(found, open_, matrices, scores, good)
            further = plain & ~done
            if not further.any():
                break
            open_, matrices, margin_px = open_[further], matrices[further], margin_px[further]
            shrinkage, before_px = shrinkage[further], reach_px[further]
        return found

    def _put(
        self, found: list[Alignment | None], frames: Indices, matrices: Floats, scores: Floats, good: Mask
    ) -> None:
        if not good.any():
            return
        whole = matrices[good] @ self._usual
        elements = (whole / whole[:, 2:, 2:]).reshape(-1, 9).tolist()
        covariances = self._registration.covariances(scores[good])
        axes, model, lens = self._registration.axes, self._registration.model, self._start.lens
        lowest = scores[good].min(axis=1).tolist()
        for frame, own, score, covariance in zip(frames[good].tolist(), elements, lowest, covariances, strict=True):
            found[frame] = Alignment(tuple(own), score, (), lens, MotionCovariance(axes, model, covariance))

    def _places(self, index: int, matrices: Floats, origin: tuple[int, int]) -> list[Floats]:
        """F of (rows, columns, 2) float32: where a feature's points lie in patches whose first pixel is `origin`."""
        shape = self._registration.maps[index].folded.shape
        carried = carried_by(matrices, self._upright[index], self._start.lens) - np.array(origin)[:, None]
        return list(np.ascontiguousarray(carried.transpose(0, 2, 1), np.float32).reshape(-1, *shape))


def _cut(frames: Sequence[GreyPicture], place: Start) -> Floats:
    """(F, H, W) float32: the part of each frame that is around a feature."""
    height, width = frames[0][place.rows, place.columns].shape
    cut = np.empty((len(frames), height, width), np.float32)
    for own, frame in zip(cut, frames, strict=True):
        own[...] = frame[place.rows, place.columns]
    return cut
