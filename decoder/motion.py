"""Motions: how a frame may differ from what is expected, from a mere shift up to a change of perspective.

A motion is a plane-to-plane transformation near the identity. Its parameters are all in pixels: of shift, and of what
roll, scale and the rest do at a lever's length from the middle of what is looked at.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from enum import IntEnum

import numpy as np

from decoder.arrays import Floats


class Model(IntEnum):
    """Which motions are solved for; the value is how many parameters there are."""

    SHIFT = 2
    RIGID = 3
    SIMILARITY = 4
    AFFINE = 6
    PERSPECTIVE = 8

    @property
    def words(self) -> str:
        """For messages."""
        return {
            Model.SHIFT: "shift",
            Model.RIGID: "shift and roll",
            Model.SIMILARITY: "shift, roll and scale",
            Model.AFFINE: "shift, roll, scale and shear",
            Model.PERSPECTIVE: "perspective",
        }[self]


@dataclass(frozen=True, slots=True)
class Frame2D:
    """The axes of a motion's parameters: their middle, and the length that counts as one."""

    middle_px: tuple[float, float]
    lever_px: float

    @classmethod
    def around(cls, points: Floats) -> Frame2D:
        """Axes for (2, N) points: their mean, and the distance of the furthest."""
        points = points.astype(np.float64)
        middle = points.mean(axis=1)
        lever_px = float(np.hypot(*(points - middle[:, None])).max())
        return cls((float(middle[0]), float(middle[1])), max(lever_px, 1.0))

    def jacobian(self, points: Floats, model: Model) -> Floats:
        """(2, N, parameters): how (2, N) points move with each parameter."""
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
    """How uncertain a motion is: (k, k) in px^2 of the parameters of `model` on `axes`."""

    axes: Frame2D
    model: Model
    covariance: Floats

    def at(self, points: Floats) -> Floats:
        """(N, 2, 2) px^2: the covariance of where (2, N) points lie."""
        jacobian = self.axes.jacobian(points, self.model)
        covariance: Floats = np.einsum("inp,pq,jnq->nij", jacobian, self.covariance, jacobian)
        return covariance

    def sigma_px(self, points: Floats) -> Floats:
        """(N,): one number for each of (2, N) points, the root mean square of the uncertainty along x and y."""
        return self.sigma_by(self.axes.jacobian(points, self.model))

    def sigma_by(self, jacobian: Floats) -> Floats:
        """The same of points that move so with each parameter, (2, N, k)."""
        variance = ((jacobian @ self.covariance) * jacobian).sum(axis=(0, 2)) / 2
        sigma: Floats = np.sqrt(np.maximum(variance, 0.0))
        return sigma
