"""Motions: maps between planes, from a plain shift to a change of perspective, and their fit to points.

A motion is a plane-to-plane transformation near the identity. Its parameters are all in pixels: the shift, and what
roll, scale and the rest move at a lever's length from the middle of the points.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from enum import IntEnum

import numpy as np
from numpy.typing import NDArray

from decoder.imaging.thresholds import LEAST_CONDITION
from decoder.panel.arrays import Floats

Matrix = NDArray[np.float64]

POLISHING_PASSES = 6


class Model(IntEnum):
    """Which motions are solved for; the value is the number of parameters."""

    SHIFT = 2
    RIGID = 3
    SIMILARITY = 4
    AFFINE = 6
    PERSPECTIVE = 8

    @property
    def words(self) -> str:
        """Its name in messages."""
        return {
            Model.SHIFT: "shift",
            Model.RIGID: "shift and roll",
            Model.SIMILARITY: "shift, roll and scale",
            Model.AFFINE: "shift, roll, scale and shear",
            Model.PERSPECTIVE: "perspective",
        }[self]


@dataclass(frozen=True, slots=True)
class Frame2D:
    """The axes of a motion's parameters: their middle, and the length of the lever."""

    middle_px: tuple[float, float]
    lever_px: float

    @classmethod
    def around(cls, points: Floats) -> Frame2D:
        """Make axes for (2, N) points: their mean, and the distance of the furthest."""
        points = points.astype(np.float64)
        middle = points.mean(axis=1)
        lever_px = float(np.hypot(*(points - middle[:, None])).max())
        return cls((float(middle[0]), float(middle[1])), max(lever_px, 1.0))

    def jacobian(self, points: Floats, model: Model) -> Floats:
        """(2, N, parameters): the derivatives of (2, N) points by the parameters."""
        x, y = ((row.astype(np.float64) - at) / self.lever_px for row, at in zip(points, self.middle_px, strict=True))
        zero, one = np.zeros_like(x), np.ones_like(x)
        right = [one, zero, -y, x, x, y, -x * x, -x * y]
        down = [zero, one, x, y, -y, x, -x * y, -y * y]
        return np.stack([np.stack(right[:model], axis=-1), np.stack(down[:model], axis=-1)])

    def matrix(self, parameters: Sequence[float], model: Model) -> Floats:
        """(3, 3): the motion with these parameters, in pixels."""
        matrix: Floats = self.matrices(np.array([parameters]), model)[0]
        return matrix

    def matrices(self, parameters: Floats, model: Model) -> Floats:
        """(F, 3, 3): the motions with parameters (F, parameters), in pixels."""
        part = np.zeros((len(parameters), Model.PERSPECTIVE))
        part[:, :model] = parameters / self.lever_px
        right, down, roll, scale, stretch, shear, tilt_x, tilt_y = part.T
        own = np.zeros((len(part), 3, 3))
        own[:, 2, 2] = 1.0
        own[:, 0, 2], own[:, 1, 2] = right, down
        if model >= Model.AFFINE:
            own[:, 0, 0], own[:, 0, 1] = 1 + scale + stretch, shear - roll
            own[:, 1, 0], own[:, 1, 1] = shear + roll, 1 + scale - stretch
            own[:, 2, 0], own[:, 2, 1] = tilt_x, tilt_y
        else:
            size = np.exp(scale)
            own[:, 0, 0] = own[:, 1, 1] = size * np.cos(roll)
            own[:, 1, 0] = size * np.sin(roll)
            own[:, 0, 1] = -own[:, 1, 0]
        x, y = self.middle_px
        there = np.array([[self.lever_px, 0.0, x], [0.0, self.lever_px, y], [0.0, 0.0, 1.0]])
        back = np.array([[1.0, 0.0, -x], [0.0, 1.0, -y], [0.0, 0.0, self.lever_px]]) / self.lever_px
        return np.asarray(there @ own @ back)


@dataclass(frozen=True, slots=True, eq=False)
class MotionCovariance:
    """The uncertainty of a motion: (k, k) in px^2 of the parameters of `model` on `axes`."""

    axes: Frame2D
    model: Model
    covariance: Floats

    def at(self, points: Floats) -> Floats:
        """(N, 2, 2) px^2: the covariance of where (2, N) points lie."""
        jacobian = self.axes.jacobian(points, self.model)
        covariance: Floats = np.einsum("inp,pq,jnq->nij", jacobian, self.covariance, jacobian)
        return covariance

    def sigma_px(self, points: Floats) -> Floats:
        """(N,): the root mean square of the uncertainty along x and y for each of (2, N) points."""
        return self.sigma_by(self.axes.jacobian(points, self.model))

    def sigma_by(self, jacobian: Floats) -> Floats:
        """Estimate `sigma_px` of points with these derivatives by the parameters, (2, N, k)."""
        variance = ((jacobian @ self.covariance) * jacobian).sum(axis=(0, 2)) / 2
        sigma: Floats = np.sqrt(np.maximum(variance, 0.0))
        return sigma


class Undetermined(ValueError):
    """More than one transformation fits the points: too many of them lie on one line."""


def homography(points: Matrix, there: Matrix) -> Matrix:
    """(3, 3): the map from (2, N) points to (2, N) others, N >= 4, with the least squared distances there.

    Raises
    ------
    Undetermined
        If the points do not determine it.
    """
    own, other = _normaliser(points), _normaliser(there)
    (x, y), (u, v) = _carried(own, points), _carried(other, there)
    zero, one = np.zeros_like(x), np.ones_like(x)
    rows = np.concatenate([
        np.stack([x, y, one, zero, zero, zero, -u * x, -u * y, -u], axis=1),
        np.stack([zero, zero, zero, x, y, one, -v * x, -v * y, -v], axis=1),
    ])  # fmt: skip
    _, spreads, directions = np.linalg.svd(rows)
    if spreads[7] < LEAST_CONDITION * spreads[0]:
        raise Undetermined
    matrix = np.linalg.inv(other) @ directions[8].reshape(3, 3) @ own
    axes = Frame2D.around(there)
    for _ in range(POLISHING_PASSES):
        seen = _carried(matrix, points)
        rows = axes.jacobian(seen, Model.PERSPECTIVE).reshape(-1, Model.PERSPECTIVE)
        step = np.linalg.lstsq(rows, (there - seen).ravel(), rcond=None)[0]
        matrix = axes.matrix(step.tolist(), Model.PERSPECTIVE) @ matrix
    return np.asarray(matrix / matrix[2, 2], np.float64)


def carried(matrix: Matrix, points: Matrix) -> Matrix:
    """Carry (2, N) points through a (3, 3) transformation."""
    return _carried(matrix, points)


def jacobian(matrix: Matrix, point: tuple[float, float]) -> Matrix:
    """(2, 2): the Jacobian of a (3, 3) transformation at a point."""
    place = matrix @ np.array([*point, 1.0])
    return np.asarray((matrix[:2, :2] - np.outer(place[:2] / place[2], matrix[2, :2])) / place[2])


def _carried(matrix: Matrix, points: Matrix) -> Matrix:
    there = matrix @ np.vstack([points, np.ones(points.shape[1])])
    return np.asarray(there[:2] / there[2])


def _normaliser(points: Matrix) -> Matrix:
    middle = points.mean(axis=1)
    scale = np.sqrt(2.0) / max(float(np.hypot(*(points - middle[:, None])).mean()), 1e-12)
    return np.array([[scale, 0.0, -scale * middle[0]], [0.0, scale, -scale * middle[1]], [0.0, 0.0, 1.0]])
