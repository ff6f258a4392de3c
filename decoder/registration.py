"""Registration: brings a first guess of the alignment to sub-pixel by least squares on the features' own pixels.

Inverse compositional least-squares matching (Baker and Matthews 2004): each feature has its own gain, offset and slope
of light, so light may change; the motion is common.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from decoder.alignment import Alignment
from decoder.arrays import Floats
from decoder.feature_solver import FeatureSolver, SeenFeature, inverse_normal
from decoder.features import Feature
from decoder.motion import Frame2D, Model, MotionCovariance
from decoder.pictures import GreyPicture
from decoder.resampling import Patch, PointMap, levels_at

ITERATIONS = 12
FAR_ITERATIONS = 24
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
class Start:
    """Where one feature is looked for first: the part of the frame around it, and its places in that."""

    rows: slice
    columns: slice
    places: Floats


class Registration:
    """Least-squares alignment on a set of features: their own points are moved by a motion of `model`."""

    def __init__(self, features: Sequence[Feature], model: Model) -> None:
        self._features = tuple(features)
        self.model = model
        self.maps = [PointMap.of([feature.points]) for feature in features]
        self._starts: tuple[Alignment, tuple[int, ...], list[Start | None]] | None = None
        self.axes = Frame2D.around(np.concatenate([feature.points for feature in features], axis=1))
        self._solvers = [FeatureSolver.of(feature, self.axes, model) for feature in features]
        self._inverse = inverse_normal(self._solvers, model)

    def summed(self, values: Iterable[Floats]) -> tuple[list[Floats], list[Floats]]:
        """What is seen of the features in F frames.

        `values` are by feature its pixels in the frames, (F, N) float32 or a few more. By feature come the sums by its
        solver's rows, (F, parameters + 1), and the energies (F,).
        """
        both = [solver.seen_in_each(levels) for solver, levels in zip(self._solvers, values, strict=True)]
        return [sums for sums, _ in both], [energy for _, energy in both]

    def steps(self, sums: Sequence[Floats], energies: Sequence[Floats]) -> tuple[Floats, Floats]:
        """Of F frames the steps that bring all features nearer, (F, parameters), and the scores of each, (F, features).

        `sums` and `energies` are by the features, as `summed` has them. A feature that is flat, or inverted, in a frame
        scores 0 there, and the step means nothing.
        """
        right, scores = np.zeros((len(sums[0]), len(self._inverse))), np.zeros((len(sums[0]), len(sums)))
        for index, (own, energy, solver) in enumerate(zip(sums, energies, self._solvers, strict=True)):
            gain = own[:, -1] / solver.energy
            flat = np.minimum(energy, solver.energy) <= solver.flat_energy
            usable = (gain > 0) & ~flat
            right += own[:, :-1] / np.where(usable, gain, np.inf)[:, None]
            scores[usable, index] = own[usable, -1] / np.sqrt(energy[usable] * solver.energy)
        return np.einsum("pq,fq->fp", self._inverse, right), scores

    def covariances(self, scores: Floats) -> Floats:
        """(F, parameters, parameters): as of `Registered`, of F frames in which features match so, (F, features)."""
        believed = np.maximum(scores, MIN_BELIEVED_SCORE)
        energies, each = self._spreads
        unexplained = energies * (1.0 / believed**2 - 1.0) * NOISE_CORRELATION**2
        covariances: Floats = np.einsum("fk,kpq->fpq", unexplained, each)
        return covariances

    @cached_property
    def _spreads(self) -> tuple[Floats, Floats]:
        """By feature: its energy for each pixel, and how what is left unexplained of it spreads over the motion."""
        energies = np.array([solver.energy / solver.rows.shape[1] for solver in self._solvers])
        return energies, np.stack([self._inverse @ solver.normal @ self._inverse for solver in self._solvers])

    def predicted(self, noise_levels: float) -> MotionCovariance:
        """How uncertain the motion will be if frames differ from the panel picture by so many grey levels."""
        variance = (noise_levels * NOISE_CORRELATION) ** 2
        return MotionCovariance(self.axes, self.model, self._inverse * variance)

    def refine(self, frame: GreyPicture, alignment: Alignment, *, is_far: bool = False) -> Registered | None:
        """The alignment at which the features match best in least squares, starting within some pixels of it.

        From a start that may be further off, `is_far`, long steps are taken in part; else they say that it is lost.

        None where it does not settle. A noisy panel picture makes each step fall short, the more so the noisier it is:
        it has settled when what all further steps will add, by how these shrink, is less than `SETTLED_PX`.
        """
        margin_px, shrinkage = 0.0, EXPECTED_SHRINKAGE
        before_px = 0.0
        patches: list[Patch | None] = []
        for iteration in range(FAR_ITERATIONS if is_far else ITERATIONS):
            if iteration == 0:
                patches, seen = self._first_seen(frame, alignment)
                margin_px = PATCH_MARGIN_PX
            else:
                if margin_px <= 0:
                    patches = [points.patch(frame, alignment, PATCH_MARGIN_PX) for points in self.maps]
                    margin_px = PATCH_MARGIN_PX
                seen = self._seen(frame, alignment, patches)
            # Full steps may go to and fro between two places for ever.
            part = 1.0 if iteration < FULL_STEPS else 0.5
            step = [part * value for value in self._step(seen)]
            reach_px = math.hypot(step[0], step[1]) + sum(map(abs, step[2:]))
            if reach_px > MAX_STEP_PX:
                if not is_far:
                    return None
                step = [value * MAX_STEP_PX / reach_px for value in step]
                reach_px = MAX_STEP_PX
            # Where the alignment expected panel point p the frame shows p moved by the step: move back.
            alignment = alignment.after(self.axes.matrix([-value for value in step], self.model))
            margin_px -= reach_px
            if before_px > 0:
                shrinkage = min(reach_px / before_px, MAX_SHRINKAGE)
            if reach_px * shrinkage / (1.0 - shrinkage) < SETTLED_PX:
                break
            before_px = reach_px
        else:
            if reach_px >= NEARLY_SETTLED_PX:
                return None
        scores = self._scores(frame, alignment, seen, patches)
        return Registered(alignment.with_covariance(self._covariance(scores)), scores)

    def _covariance(self, scores: Mapping[str, float]) -> MotionCovariance:
        """Of the motion, from what the features' pixels leave unexplained in the frame."""
        (own,) = self.covariances(np.array([[scores[feature.name] for feature in self._features]]))
        return MotionCovariance(self.axes, self.model, own)

    def _first_seen(self, frame: GreyPicture, alignment: Alignment) -> tuple[list[Patch | None], list[SeenFeature]]:
        """The parts of the frame around the features where they are looked for first, and what is seen there."""
        patches: list[Patch | None] = []
        seen = []
        parts = zip(self.started(frame, alignment), self._solvers, self._features, strict=True)
        for start, solver, feature in parts:
            if start is None:
                patches.append(None)
                seen.append(solver.seen(_extended(feature, frame, alignment)))
            else:
                pixels = frame[start.rows, start.columns].astype(np.float32)
                patches.append(Patch(pixels, start.columns.start, start.rows.start))
                seen.append(solver.seen(levels_at(pixels, start.places)[: feature.pixels.size]))
        return patches, seen

    def started(self, frame: GreyPicture, alignment: Alignment) -> list[Start | None]:
        """Worked out once for all frames that are first looked at where the panel usually lies."""
        if self._starts is None or self._starts[0] is not alignment or self._starts[1] != frame.shape:
            starts: list[Start | None] = []
            for points in self.maps:
                patch = points.patch(frame, alignment, PATCH_MARGIN_PX)
                if patch is None:
                    starts.append(None)
                    continue
                rows, columns = patch.pixels.shape
                places = points.places(alignment, (patch.left, patch.top))
                starts.append(
                    Start(slice(patch.top, patch.top + rows), slice(patch.left, patch.left + columns), places)
                )
            self._starts = (alignment, frame.shape, starts)
        return self._starts[2]

    def _seen(self, frame: GreyPicture, alignment: Alignment, patches: Sequence[Patch | None]) -> list[SeenFeature]:
        """Each feature's pixels in the frame; where they are not in it, as the others make one expect them."""
        return [
            solver.seen(
                _extended(feature, frame, alignment) if patch is None else points.sample_patch(patch, alignment)
            )
            for solver, feature, points, patch in zip(self._solvers, self._features, self.maps, patches, strict=True)
        ]

    def _scores(
        self, frame: GreyPicture, alignment: Alignment, seen: Sequence[SeenFeature], patches: Sequence[Patch | None]
    ) -> dict[str, float]:
        """By feature; those that are not wholly in the frame have no patch."""
        beside = {index for index, patch in enumerate(patches) if patch is None}
        return {
            feature.name: feature.score(frame, alignment) if index in beside else solver.score(own)
            for index, (feature, own, solver) in enumerate(zip(self._features, seen, self._solvers, strict=True))
        }

    def _step(self, seen: Sequence[SeenFeature]) -> list[float]:
        right = np.zeros(len(self._inverse))
        used = []
        for own, solver in zip(seen, self._solvers, strict=True):
            gain = float(own.sums[-1]) / solver.energy
            if gain > 0 and not solver.is_flat(own):
                right += own.sums[:-1] / gain
                used.append(solver)
        inverse = self._inverse if len(used) == len(self._solvers) else inverse_normal(used, len(right))
        step: list[float] = (inverse @ right).tolist()
        return step


def _extended(feature: Feature, frame: GreyPicture, alignment: Alignment) -> Floats:
    samples, within = feature.sample(frame, alignment), feature.within(frame, alignment)
    if within.all() or not within.any() or float(feature.pixels[within].std()) < 1.0:
        return samples
    gain, offset = np.polyfit(feature.pixels[within], samples[within], 1)
    return np.where(within, samples, gain * feature.pixels + offset).astype(np.float32)
