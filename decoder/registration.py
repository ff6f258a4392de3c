"""Registration: brings a first guess of the alignment to sub-pixel by least squares on the features' own pixels.

Inverse compositional least-squares matching (Baker and Matthews 2004): each feature has its own gain, offset and slope
of light, so light may change; shift and roll are common. All that depends on the panel picture alone is solved once, a
frame costs two small products.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from decoder.alignment import Alignment
from decoder.arrays import Floats
from decoder.features import FLAT_LEVELS, Feature
from decoder.pictures import GreyPicture
from decoder.resampling import Patch, PointMap

ITERATIONS = 12
FULL_STEPS = 4
SETTLED_PX = 0.01
NEARLY_SETTLED_PX = 0.1
MAX_STEP_PX = 6.0
PATCH_MARGIN_PX = 8
# What a first step leaves with a rather noisy panel picture.
EXPECTED_SHRINKAGE = 0.3
# Steps that shrink by less than this are no sign of more to come, but of noise.
MAX_SHRINKAGE = 0.9


@dataclass(frozen=True, slots=True)
class Registered:
    """Where the features match best, and the NCC of each of them there, by its name."""

    alignment: Alignment
    scores: Mapping[str, float]


@dataclass(frozen=True, slots=True)
class _Solver:
    """What the panel picture alone says of one feature.

    `columns` (2 or 3, N) are how its pixels change with shift and roll, what light can do to them projected out;
    `normal` is the matrix they make; `centred` (N,) are its pixels without their mean, `energy` the sum of their
    squares.
    """

    columns: Floats
    normal: Floats
    centred: Floats
    energy: float


class Registration:
    """Least-squares alignment on a set of features; with `rolls` the roll is solved for, otherwise kept."""

    def __init__(self, features: Sequence[Feature], *, rolls: bool) -> None:
        self._features = tuple(features)
        self._maps = [PointMap.of([feature.points]) for feature in features]
        points = np.concatenate([feature.points for feature in features], axis=1).astype(np.float64)
        self._middle = points.mean(axis=1)
        self._lever_px = float(np.hypot(*(points - self._middle[:, None])).max())
        self._rolls = rolls
        self._solvers = [self._solver(feature) for feature in features]
        self._inverse = _inverse_normal(self._solvers, 3 if rolls else 2)

    def refine(self, frame: GreyPicture, alignment: Alignment) -> Registered | None:
        """The alignment at which the features match best in least squares, starting within some pixels of it.

        None where it does not settle. A noisy panel picture makes each step fall short, the more so the noisier it is:
        it has settled when what all further steps will add, by how these shrink, is less than `SETTLED_PX`.
        """
        margin_px, shrinkage = 0.0, EXPECTED_SHRINKAGE
        before_px = 0.0
        patches: list[Patch | None] = []
        for iteration in range(ITERATIONS):
            if margin_px <= 0:
                patches = [points.patch(frame, alignment, PATCH_MARGIN_PX) for points in self._maps]
                margin_px = PATCH_MARGIN_PX
            samples = self._samples(frame, alignment, patches)
            # Full steps may go to and fro between two places for ever.
            part = 1.0 if iteration < FULL_STEPS else 0.5
            shift_x, shift_y, roll = (part * step for step in self._step(samples))
            reach_px = math.hypot(shift_x, shift_y) + abs(roll) * self._lever_px
            if reach_px > MAX_STEP_PX:
                return None
            alignment = self._moved(alignment, shift_x, shift_y, roll)
            margin_px -= reach_px
            if before_px > 0:
                shrinkage = min(reach_px / before_px, MAX_SHRINKAGE)
            if reach_px * shrinkage / (1.0 - shrinkage) < SETTLED_PX:
                break
            before_px = reach_px
        else:
            if reach_px >= NEARLY_SETTLED_PX:
                return None
        return Registered(alignment, self._scores(frame, alignment, samples, patches))

    def _samples(self, frame: GreyPicture, alignment: Alignment, patches: Sequence[Patch | None]) -> list[Floats]:
        """Each feature's pixels in the frame; where they are not in it, as the others make one expect them."""
        return [
            _extended(feature, frame, alignment) if patch is None else points.sample_patch(patch, alignment)
            for feature, points, patch in zip(self._features, self._maps, patches, strict=True)
        ]

    def _scores(
        self, frame: GreyPicture, alignment: Alignment, samples: Sequence[Floats], patches: Sequence[Patch | None]
    ) -> dict[str, float]:
        return {
            feature.name: feature.score(frame, alignment) if patch is None else _correlation(values, solver)
            for feature, values, solver, patch in zip(self._features, samples, self._solvers, patches, strict=True)
        }

    def _solver(self, feature: Feature) -> _Solver:
        gradient_x, gradient_y = feature.gradient.astype(np.float64)
        x, y = feature.points.astype(np.float64) - self._middle[:, None]
        motion = [gradient_x, gradient_y]
        if self._rolls:
            motion.append(gradient_y * x - gradient_x * y)
        light = np.stack([feature.pixels.astype(np.float64), np.ones(feature.pixels.size), x, y], axis=1)
        basis, _ = np.linalg.qr(light)
        columns = np.stack(motion, axis=1)
        columns -= basis @ (basis.T @ columns)
        centred = feature.pixels - feature.pixels.mean()
        energy = max(float(centred @ centred), 1e-9)
        return _Solver(columns.T.astype(np.float32).copy(), columns.T @ columns, centred, energy)

    def _step(self, samples: Sequence[Floats]) -> tuple[float, float, float]:
        right = np.zeros(len(self._inverse))
        used = []
        for values, solver in zip(samples, self._solvers, strict=True):
            gain = float(solver.centred @ values) / solver.energy
            if gain > 0:
                right += solver.columns @ values / gain
                used.append(solver)
        inverse = self._inverse if len(used) == len(self._solvers) else _inverse_normal(used, len(right))
        step = (inverse @ right).tolist()
        return step[0], step[1], step[2] if self._rolls else 0.0

    def _moved(self, alignment: Alignment, shift_x: float, shift_y: float, roll: float) -> Alignment:
        """Where the alignment expected panel point p the frame shows p + step: shift back, in the panel's axes."""
        x, y = float(self._middle[0]), float(self._middle[1])
        target = alignment.to_frame((x - shift_x, y - shift_y))
        return Alignment.pinned((x, y), target, alignment.roll_deg - math.degrees(roll), alignment.score)


def _inverse_normal(solvers: Sequence[_Solver], size: int) -> Floats:
    """Of the normal matrix of some features together; of next to nothing where they say nothing."""
    normal = sum((solver.normal for solver in solvers), start=np.zeros((size, size)))
    inverse: Floats = np.linalg.inv(normal + np.eye(size) * (1e-9 * normal.trace() + 1e-9))
    return inverse


def _extended(feature: Feature, frame: GreyPicture, alignment: Alignment) -> Floats:
    samples, within = feature.sample(frame, alignment), feature.within(frame, alignment)
    if within.all() or not within.any() or float(feature.pixels[within].std()) < 1.0:
        return samples
    gain, offset = np.polyfit(feature.pixels[within], samples[within], 1)
    return np.where(within, samples, gain * feature.pixels + offset).astype(np.float32)


def _correlation(values: Floats, solver: _Solver) -> float:
    centred = values - values.mean()
    energy = float(centred @ centred)
    if min(energy, solver.energy) <= FLAT_LEVELS**2 * len(values):
        return 0.0
    return float(solver.centred @ centred) / math.sqrt(energy * solver.energy)
