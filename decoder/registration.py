"""Registration: brings a first guess of the alignment to sub-pixel by least squares on the features' own pixels.

Inverse compositional least-squares matching (Baker and Matthews 2004): each feature has its own gain, offset and slope
of light, so light may change; the motion is common. All that depends on the panel picture alone is solved once, a
frame costs two small products.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from decoder.alignment import Alignment
from decoder.arrays import Floats
from decoder.features import FLAT_LEVELS, Feature
from decoder.motion import Frame2D, Model, MotionCovariance
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
# What differs between two pictures of a feature differs over some pixels together: so many times as uncertain as if
# each pixel had its own noise. By trial on rendered flights with blur, noise and JPEG.
NOISE_CORRELATION = 2.0
MIN_BELIEVED_SCORE = 0.1


@dataclass(frozen=True, slots=True)
class Registered:
    """Where the features match best, and the NCC of each of them there, by its name."""

    alignment: Alignment
    scores: Mapping[str, float]


@dataclass(frozen=True, slots=True)
class _Solver:
    """What the panel picture alone says of one feature.

    `columns` (parameters, N) are how its pixels change with the motion, what light can do to them projected out;
    `normal` is the matrix they make; `centred` (N,) are its pixels without their mean, `energy` the sum of their
    squares.
    """

    columns: Floats
    normal: Floats
    centred: Floats
    energy: float


class Registration:
    """Least-squares alignment on a set of features: their own points are moved by a motion of `model`."""

    def __init__(self, features: Sequence[Feature], model: Model) -> None:
        self._features = tuple(features)
        self._model = model
        self._maps = [PointMap.of([feature.points]) for feature in features]
        self._axes = Frame2D.around(np.concatenate([feature.points for feature in features], axis=1))
        self._solvers = [self._solver(feature) for feature in features]
        self._inverse = _inverse_normal(self._solvers, model)

    def predicted(self, noise_levels: float) -> MotionCovariance:
        """How uncertain the motion will be if frames differ from the panel picture by so many grey levels."""
        variance = (noise_levels * NOISE_CORRELATION) ** 2
        return MotionCovariance(self._axes, self._model, self._inverse * variance)

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
            step = [part * value for value in self._step(samples)]
            reach_px = math.hypot(step[0], step[1]) + sum(map(abs, step[2:]))
            if reach_px > MAX_STEP_PX:
                return None
            # Where the alignment expected panel point p the frame shows p moved by the step: move back.
            alignment = alignment.after(self._axes.matrix([-value for value in step], self._model))
            margin_px -= reach_px
            if before_px > 0:
                shrinkage = min(reach_px / before_px, MAX_SHRINKAGE)
            if reach_px * shrinkage / (1.0 - shrinkage) < SETTLED_PX:
                break
            before_px = reach_px
        else:
            if reach_px >= NEARLY_SETTLED_PX:
                return None
        scores = self._scores(frame, alignment, samples, patches)
        return Registered(replace(alignment, covariance=self._covariance(scores)), scores)

    def _covariance(self, scores: Mapping[str, float]) -> MotionCovariance:
        """Of the motion, from what the features' pixels leave unexplained in the frame."""
        middle = np.zeros_like(self._inverse)
        for feature, solver in zip(self._features, self._solvers, strict=True):
            score = max(scores[feature.name], MIN_BELIEVED_SCORE)
            unexplained = solver.energy * (1.0 / score**2 - 1.0) / solver.centred.size
            middle += solver.normal * (unexplained * NOISE_CORRELATION**2)
        return MotionCovariance(self._axes, self._model, self._inverse @ middle @ self._inverse)

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
        jacobian = self._axes.jacobian(feature.points, self._model)
        columns = np.einsum("in,inp->np", feature.gradient.astype(np.float64), jacobian)
        x, y = feature.points.astype(np.float64) - feature.points.mean(axis=1, dtype=np.float64)[:, None]
        light = np.stack([feature.pixels.astype(np.float64), np.ones(feature.pixels.size), x, y], axis=1)
        basis, _ = np.linalg.qr(light)
        columns -= basis @ (basis.T @ columns)
        centred = feature.pixels - feature.pixels.mean()
        energy = max(float(centred @ centred), 1e-9)
        return _Solver(columns.T.astype(np.float32).copy(), columns.T @ columns, centred, energy)

    def _step(self, samples: Sequence[Floats]) -> list[float]:
        right = np.zeros(len(self._inverse))
        used = []
        for values, solver in zip(samples, self._solvers, strict=True):
            gain = float(solver.centred @ values) / solver.energy
            if gain > 0:
                right += solver.columns @ values / gain
                used.append(solver)
        inverse = self._inverse if len(used) == len(self._solvers) else _inverse_normal(used, len(right))
        step: list[float] = (inverse @ right).tolist()
        return step


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
