"""Registration: brings first guesses of alignments to sub-pixel by least squares on the features' own pixels.

All frames lie in the same arrays, one frame is a batch of one, and each costs two small products a step.

Inverse compositional least-squares matching (Baker and Matthews 2004): each feature has its own gain, offset and slope
of light, so light may change; the motion is common.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Self

import numpy as np

from decoder.imaging.alignment import Alignment, carried_by, upright
from decoder.imaging.motion import Frame2D, Model, MotionCovariance
from decoder.imaging.pictures import GreyPicture
from decoder.imaging.resampling import Patch, PointMap, levels_at, put_levels
from decoder.panel.arrays import Floats, Indices, Mask
from decoder.registration.features import Feature
from decoder.registration.thresholds import (
    FULL_STEPS,
    MAX_SHRINKAGE,
    MAX_STEP_PX,
    MIN_GUESS_SCORE,
    MIN_SPREAD_LEVELS,
    SETTLED_PX,
)

MIDDLE_GREY = 128.0  # keeps the sums of squares small enough for float32

ITERATIONS = 12
FAR_ITERATIONS = 24
PATCH_MARGIN_PX = 8
# What a first step leaves with a rather noisy panel picture.
EXPECTED_SHRINKAGE = 0.3
# What differs between two pictures of a feature differs over some pixels together: so many times as uncertain as if
# each pixel had its own noise. By trial on rendered flights with blur, noise and JPEG.
NOISE_CORRELATION = 2.0


@dataclass(frozen=True, slots=True)
class FeatureSolver:
    """What the panel picture alone says of one feature.

    `rows` (parameters + 1, N) are how its pixels change with the motion, what light can do to them projected out, and
    last its pixels without their mean; `normal` is the matrix that the first make; `energy` is the sum of the squares
    of the last.
    """

    rows: Floats
    normal: Floats
    energy: float

    @classmethod
    def of(cls, feature: Feature, axes: Frame2D, model: Model) -> Self:
        """For motions of a model on some axes."""
        jacobian = axes.jacobian(feature.points, model)
        columns = np.einsum("in,inp->np", feature.gradient.astype(np.float64), jacobian)
        x, y = feature.points.astype(np.float64) - feature.points.mean(axis=1, dtype=np.float64)[:, None]
        light = np.stack([feature.pixels.astype(np.float64), np.ones(feature.pixels.size), x, y], axis=1)
        basis, _ = np.linalg.qr(light)
        columns -= basis @ (basis.T @ columns)
        centred = feature.pixels - feature.pixels.mean()
        energy = max(float(centred @ centred), 1e-9)
        rows = np.concatenate([columns.T.astype(np.float32), centred[None]])
        return cls(rows, columns.T @ columns, energy)

    @property
    def flat_energy(self) -> float:
        """What pixels have at most that show next to nothing."""
        return float(MIN_SPREAD_LEVELS**2 * self.rows.shape[1])

    def seen_in_each(self, values: Floats) -> tuple[Floats, Floats]:
        """In F frames, (F, N) float32 or a few more: the sums (F, parameters + 1) and the energies (F,)."""
        size = self.rows.shape[1]
        own = values[:, None, :size] - np.float32(MIDDLE_GREY)
        total = own.sum(axis=2, dtype=np.float64)[:, 0]
        energy = (own @ own.transpose(0, 2, 1))[:, 0, 0] - total * total / size
        return (own @ self.rows.T)[:, 0].astype(np.float64), energy


def inverse_normal(solvers: Sequence[FeatureSolver], size: int) -> Floats:
    """Of the normal matrix of some features together; of next to nothing where they say nothing."""
    normal = sum((solver.normal for solver in solvers), start=np.zeros((size, size)))
    inverse: Floats = np.linalg.inv(normal + np.eye(size) * (1e-9 * normal.trace() + 1e-9))
    return inverse


@dataclass(frozen=True, slots=True)
class Registered:
    """Where the features match best, and the NCC of each of them there, by its name."""

    alignment: Alignment
    scores: Mapping[str, float]


@dataclass(frozen=True, slots=True, eq=False)
class Look:
    """What a registration takes from a frame at first; taken while the frame is in the processor's cache it costs half.

    Attributes
    ----------
    frame
        All of its rows, or the first where it is not `is_whole`.
    start
        Where the features are looked for first.
    patches
        By feature what lies around it; None where that leaves the frame.
    levels
        By feature (N,) float32, or a few more: the levels of its points.
    """

    frame: GreyPicture
    start: Alignment
    patches: Sequence[Patch | None]
    levels: Sequence[Floats]
    is_whole: bool = True


@dataclass(slots=True)
class _Running:
    """The frames that have not settled yet.

    Attributes
    ----------
    numbers
        (F,): which frames they are.
    looks, patches
        By frame.
    matrices
        (F, 3, 3): where the features are expected.
    margin_px
        (F,): how far features may still move in their patches.
    before_px, shrinkage
        (F,): how far the last step went, and what part of a step the next one is.
    """

    numbers: Indices
    looks: list[Look]
    patches: list[Sequence[Patch | None]]
    matrices: Floats
    margin_px: Floats
    before_px: Floats
    shrinkage: Floats

    @classmethod
    def of(cls, looks: Sequence[Look]) -> Self:
        """Start with frames where they were looked at."""
        count = len(looks)
        return cls(
            np.arange(count),
            list(looks),
            [look.patches for look in looks],
            np.array([look.start.elements for look in looks]).reshape(-1, 3, 3),
            np.full(count, float(PATCH_MARGIN_PX)),
            np.zeros(count),
            np.full(count, EXPECTED_SHRINKAGE),
        )

    def moved(self, motions: Floats, reach_px: Floats) -> Floats:
        """Move all frames, by so far; (F,): how far all further steps will go, as these shrink."""
        matrices = self.matrices @ motions
        self.matrices = matrices / matrices[:, 2:, 2:]
        self.margin_px = self.margin_px - reach_px
        known = self.before_px > 0
        ratio = np.divide(reach_px, self.before_px, out=np.ones_like(reach_px), where=known)
        self.shrinkage = np.where(known, np.minimum(ratio, MAX_SHRINKAGE), self.shrinkage)
        self.before_px = reach_px
        left_px: Floats = reach_px * self.shrinkage / (1.0 - self.shrinkage)
        return left_px

    def only(self, rows: Mask) -> _Running:
        """Return some of them."""
        return _Running(
            self.numbers[rows],
            [self.looks[row] for row in np.flatnonzero(rows).tolist()],
            [self.patches[row] for row in np.flatnonzero(rows).tolist()],
            self.matrices[rows],
            self.margin_px[rows],
            self.before_px[rows],
            self.shrinkage[rows],
        )


@dataclass(frozen=True, slots=True)
class _Start:
    """Where one feature is looked for first: the part of the frame around it, and its places in that."""

    rows: slice
    columns: slice
    places: Floats


class Registration:
    """Least-squares alignment on a set of features: their own points are moved by a motion of `model`."""

    def __init__(self, features: Sequence[Feature], model: Model) -> None:
        self._features = tuple(features)
        self.model = model
        self._maps = [PointMap.of([feature.points]) for feature in features]
        self._points = [upright(points.folded.reshape(-1, 2)) for points in self._maps]
        self._starts: tuple[Alignment, tuple[int, ...], list[_Start | None]] | None = None
        self.axes = Frame2D.around(np.concatenate([feature.points for feature in features], axis=1))
        self._solvers = [FeatureSolver.of(feature, self.axes, model) for feature in features]
        self._inverse = inverse_normal(self._solvers, model)

    def predicted(self, noise_levels: float) -> MotionCovariance:
        """How uncertain the motion will be if frames differ from the panel picture by so many grey levels."""
        variance = (noise_levels * NOISE_CORRELATION) ** 2
        return MotionCovariance(self.axes, self.model, self._inverse * variance)

    def look_at(self, frame: GreyPicture, start: Alignment, *, is_whole: bool = True) -> Look:
        """Take from a frame what `refine` wants of it."""
        patches: list[Patch | None] = []
        levels = []
        for place, feature in zip(self._started(frame, start), self._features, strict=True):
            if place is None:
                patches.append(None)
                levels.append(_extended(feature, frame, start))
            else:
                pixels = frame[place.rows, place.columns].astype(np.float32)
                patches.append(Patch(pixels, place.columns.start, place.rows.start))
                levels.append(levels_at(pixels, place.places)[: feature.pixels.size])
        return Look(frame, start, patches, levels, is_whole)

    def refine(self, looks: Sequence[Look], *, is_far: bool = False) -> list[Registered | None]:
        """Bring the alignments at which F frames were looked at to where the features match best in least squares.

        From starts that may be more than some pixels off, `is_far`, long steps are taken in part; else they say that a
        frame is lost. None for a frame that does not settle. A noisy panel picture makes each step fall short, the more
        so the noisier it is: a frame has settled when what all further steps will add, by how these shrink, is less
        than `SETTLED_PX`. Nothing that is found in a frame depends on the frames beside it.
        """
        found: list[Registered | None] = [None] * len(looks)
        running = _Running.of(looks)
        iterations = FAR_ITERATIONS if is_far else ITERATIONS
        for iteration in range(iterations):
            if not running.numbers.size:
                break
            levels = self._levels(running) if iteration else _first_levels(running.looks)
            step, scores = self._steps(levels)
            if iteration >= FULL_STEPS:  # full steps may go to and fro between two places for ever
                step *= 0.5
            reach_px = np.hypot(step[:, 0], step[:, 1]) + np.abs(step[:, 2:]).sum(axis=1)
            lost = reach_px > MAX_STEP_PX
            if is_far:
                step *= np.where(lost, MAX_STEP_PX / np.maximum(reach_px, MAX_STEP_PX), 1.0)[:, None]
                reach_px, lost = np.minimum(reach_px, MAX_STEP_PX), np.zeros_like(lost)
            # Where a matrix expected panel point p the frame shows p moved by the step: move back.
            left_px = running.moved(self.axes.matrices(-step, self.model), reach_px)
            done = ~lost & ((left_px < SETTLED_PX) | ((iteration == iterations - 1) & (reach_px < 10 * SETTLED_PX)))
            if done.any():
                ended = running.only(done)
                for number, one in zip(ended.numbers.tolist(), self._registered(ended, scores[done]), strict=True):
                    found[number] = one
            running = self._with_room(running.only(~done & ~lost))
        return found

    def _with_room(self, running: _Running) -> _Running:
        """Cut new patches where features have moved out of theirs; what is not in a frame's first rows is given up."""
        for row in np.flatnonzero(running.margin_px <= 0).tolist():
            there = _at(running.looks[row], running.matrices[row])
            cut = [points.patch(running.looks[row].frame, there, PATCH_MARGIN_PX) for points in self._maps]
            running.patches[row], running.margin_px[row] = cut, PATCH_MARGIN_PX
        parts = zip(running.looks, running.patches, strict=True)
        kept = np.array([look.is_whole or None not in patches for look, patches in parts], bool)
        return running if kept.all() else running.only(kept)

    def _started(self, frame: GreyPicture, alignment: Alignment) -> list[_Start | None]:
        """Places in frames of this shape, worked out once for all that are first looked at there."""
        if self._starts is None or self._starts[0] is not alignment or self._starts[1] != frame.shape:
            starts: list[_Start | None] = []
            for points in self._maps:
                patch = points.patch(frame, alignment, PATCH_MARGIN_PX)
                if patch is None:
                    starts.append(None)
                    continue
                (rows, columns), left, top = patch.pixels.shape, patch.left, patch.top
                places = points.places(alignment, (left, top))
                starts.append(_Start(slice(top, top + rows), slice(left, left + columns), places))
            self._starts = (alignment, frame.shape, starts)
        return self._starts[2]

    def _levels(self, running: _Running) -> Iterator[Floats]:
        """By feature (F, N) float32: the levels of its points where the frames' matrices carry them.

        Where a feature is not wholly in a frame, these are as the rest of it makes one expect.
        """
        lens = running.looks[0].start.lens
        for index, (feature, points) in enumerate(zip(self._features, self._maps, strict=True)):
            own = [patches[index] for patches in running.patches]
            origins = [(0, 0) if patch is None else (patch.left, patch.top) for patch in own]
            levels = np.empty((len(own), *points.folded.shape[:2]), np.float32)
            for origin in dict.fromkeys(origins):
                rows = [row for row, its in enumerate(origins) if its == origin]
                places = carried_by(running.matrices[rows], self._points[index], lens, origin)
                for row, at in zip(rows, places, strict=True):
                    patch = own[row]
                    if patch is None:
                        look = running.looks[row]
                        seen = _extended(feature, look.frame, _at(look, running.matrices[row]))
                        levels[row].reshape(-1)[: seen.size] = seen
                    else:
                        put_levels(levels[row], patch.pixels, at.reshape(points.folded.shape))
            yield levels.reshape(len(own), -1)

    def _steps(self, levels: Iterable[Floats]) -> tuple[Floats, Floats]:
        """Of F frames the steps that bring the features nearer, (F, parameters), and their scores, (F, features).

        `levels` are by feature its pixels in the frames, (F, N) float32 or a few more. A feature that is flat, or
        inverted, in a frame scores 0 there and is left out of the step.
        """
        both = [solver.seen_in_each(own) for solver, own in zip(self._solvers, levels, strict=True)]
        frames = len(both[0][1])
        right, scores = np.zeros((frames, len(self._inverse))), np.zeros((frames, len(both)))
        for index, ((sums, energy), solver) in enumerate(zip(both, self._solvers, strict=True)):
            gain = sums[:, -1] / solver.energy
            flat = np.minimum(energy, solver.energy) <= solver.flat_energy
            usable = (gain > 0) & ~flat
            right += sums[:, :-1] / np.where(usable, gain, np.inf)[:, None]
            scores[usable, index] = sums[usable, -1] / np.sqrt(energy[usable] * solver.energy)
        steps = np.einsum("pq,fq->fp", self._inverse, right)
        for frame in np.flatnonzero((scores <= 0).any(axis=1)).tolist():
            used = [solver for solver, score in zip(self._solvers, scores[frame], strict=True) if score > 0]
            steps[frame] = inverse_normal(used, len(self._inverse)) @ right[frame]
        return steps, scores

    def _registered(self, ended: _Running, scores: Floats) -> list[Registered]:
        """Of frames that have settled, with the scores of features that are not wholly in them looked up."""
        parts = list(zip(ended.looks, ended.patches, ended.matrices, strict=True))
        alignments = [_at(look, matrix) for look, _, matrix in parts]
        for row, (look, patches, _) in enumerate(parts):
            for index in (index for index, patch in enumerate(patches) if patch is None):
                scores[row, index] = self._features[index].score(look.frame, alignments[row])
        names = [feature.name for feature in self._features]
        return [
            Registered(
                alignment.with_covariance(MotionCovariance(self.axes, self.model, covariance)),
                dict(zip(names, own, strict=True)),
            )
            for alignment, covariance, own in zip(alignments, self._covariances(scores), scores.tolist(), strict=True)
        ]

    def _covariances(self, scores: Floats) -> Floats:
        """(F, parameters, parameters): of the motions, from what features that match so leave unexplained."""
        believed = np.maximum(scores, MIN_GUESS_SCORE)
        energies, each = self._spreads
        unexplained = energies * (1.0 / believed**2 - 1.0) * NOISE_CORRELATION**2
        covariances: Floats = np.einsum("fk,kpq->fpq", unexplained, each)
        return covariances

    @cached_property
    def _spreads(self) -> tuple[Floats, Floats]:
        """By feature: its energy for each pixel, and how what is left unexplained of it spreads over the motion."""
        energies = np.array([solver.energy / solver.rows.shape[1] for solver in self._solvers])
        return energies, np.stack([self._inverse @ solver.normal @ self._inverse for solver in self._solvers])


def _first_levels(looks: Sequence[Look]) -> Iterator[Floats]:
    """By feature (F, N) float32: the levels of its points where they are looked for first."""
    for levels in zip(*(look.levels for look in looks), strict=True):
        yield np.array(levels)


def _at(look: Look, matrix: Floats) -> Alignment:
    """Make a frame's alignment of a (3, 3) matrix, whose last element is 1."""
    return Alignment(tuple(matrix.ravel().tolist()), look.start.score, look.start.failed, look.start.lens)


def _extended(feature: Feature, frame: GreyPicture, alignment: Alignment) -> Floats:
    """Sample a feature in a frame that shows a part of it, the rest as that part makes one expect."""
    samples, within = feature.sample(frame, alignment), feature.within(frame, alignment)
    if within.all() or not within.any() or float(feature.pixels[within].std()) < 1.0:
        return samples
    gain, offset = np.polyfit(feature.pixels[within], samples[within], 1)
    return np.where(within, samples, gain * feature.pixels + offset).astype(np.float32)
