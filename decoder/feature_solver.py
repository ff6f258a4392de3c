"""What least squares make of one feature: all that the panel picture alone says is worked out once.

A frame then costs two small products.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Self

import numpy as np

from decoder.arrays import Floats
from decoder.features import FLAT_LEVELS, Feature
from decoder.motion import Frame2D, Model

MIDDLE_GREY = 128.0  # keeps the sums of squares small enough for float32


@dataclass(frozen=True, slots=True)
class SeenFeature:
    """A feature's pixels in a frame, summed up: `sums` (parameters + 1,) by the solver's rows, and their energy."""

    sums: Floats
    energy: float


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
        return float(FLAT_LEVELS**2 * self.rows.shape[1])

    def seen(self, values: Floats) -> SeenFeature:
        """The feature's pixels in a frame, (N,) float32, summed up."""
        values = values - np.float32(MIDDLE_GREY)
        total = float(values.sum())
        return SeenFeature(self.rows @ values, float(values @ values) - total * total / values.size)

    def seen_in_each(self, values: Floats) -> tuple[Floats, Floats]:
        """In F frames, (F, N) float32 or a few more: the sums (F, parameters + 1) and the energies (F,)."""
        size = self.rows.shape[1]
        own = values[:, None, :size] - np.float32(MIDDLE_GREY)
        total = own.sum(axis=2, dtype=np.float64)[:, 0]
        energy = (own @ own.transpose(0, 2, 1))[:, 0, 0] - total * total / size
        return (own @ self.rows.T)[:, 0].astype(np.float64), energy

    def is_flat(self, seen: SeenFeature) -> bool:
        """Whether the panel picture or the frame shows next to nothing of it."""
        return bool(min(seen.energy, self.energy) <= self.flat_energy)

    def score(self, seen: SeenFeature) -> float:
        """The NCC of a frame's pixels with the panel picture's."""
        if self.is_flat(seen):
            return 0.0
        return float(seen.sums[-1]) / math.sqrt(seen.energy * self.energy)


def inverse_normal(solvers: Sequence[FeatureSolver], size: int) -> Floats:
    """Of the normal matrix of some features together; of next to nothing where they say nothing."""
    normal = sum((solver.normal for solver in solvers), start=np.zeros((size, size)))
    inverse: Floats = np.linalg.inv(normal + np.eye(size) * (1e-9 * normal.trace() + 1e-9))
    return inverse
