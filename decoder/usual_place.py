"""The first look at frames, many at once: those whose features all match well where the panel usually lies.

The same least squares as `registration`, with all frames in the same arrays. A frame that is less than plain is left to
the search of its own. Nothing that is found in a frame depends on the frames beside it.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from decoder.alignment import Alignment, Matrix, carried_by, upright
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
)
from decoder.resampling import Patch, levels_at, put_levels


@dataclass(frozen=True, slots=True, eq=False)
class Look:
    """What a first look takes from a frame for one feature.

    `levels` (N,) float32 are those where the feature's points are looked for first, `patch` is what lies around them.
    """

    patch: Patch
    levels: Floats


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
        self._points = [upright(points.folded.reshape(-1, 2)) for points in registration.maps]

    def look_at(self, frame: GreyPicture) -> list[Look] | None:
        """What `find` wants of a frame, by feature; None where a feature may leave the frame.

        Taken while the frame is in the processor's cache it costs half.
        """
        looks = []
        for start in self._registration.started(frame, self._start):
            if start is None:
                return None
            pixels = frame[start.rows, start.columns].astype(np.float32)
            patch = Patch(pixels, start.columns.start, start.rows.start)
            looks.append(Look(patch, levels_at(pixels, start.places)))
        return looks

    def find(self, frames: Sequence[Sequence[Look]]) -> list[Alignment | None]:
        """Where the panel picture lies in frames that were looked at; None where that takes more than a look."""
        found: list[Alignment | None] = [None] * len(frames)
        open_ = np.arange(len(frames))
        matrices = np.broadcast_to(self._start.matrix, (len(frames), 3, 3))
        shrinkage, before_px = np.full(len(frames), EXPECTED_SHRINKAGE), np.zeros(len(frames))
        margin_px = np.full(len(frames), float(PATCH_MARGIN_PX))
        for iteration in range(ITERATIONS):
            looks = [frames[number] for number in open_.tolist()]
            levels = self._levels(looks, matrices) if iteration else _first_levels(looks)
            step, scores = self._registration.steps(*self._registration.summed(levels))
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

    def _levels(self, frames: Sequence[Sequence[Look]], matrices: Floats) -> Iterator[Floats]:
        """By feature (F, N) float32: the levels of its points where the matrices (F, 3, 3) carry them."""
        for index, points in enumerate(self._points):
            patches = [looks[index].patch for looks in frames]
            origin = (patches[0].left, patches[0].top)
            places = carried_by(matrices, points, self._start.lens, origin).reshape(
                len(frames), *self._registration.maps[index].folded.shape
            )
            levels = np.empty(places.shape[:3], np.float32)
            for own, patch, at in zip(levels, patches, places, strict=True):
                put_levels(own, patch.pixels, at)
            yield levels.reshape(len(frames), -1)


def _first_levels(frames: Sequence[Sequence[Look]]) -> Iterator[Floats]:
    """By feature (F, N) float32: the levels of its points where they are looked for first."""
    for looks in zip(*frames, strict=True):
        yield np.array([look.levels for look in looks])
