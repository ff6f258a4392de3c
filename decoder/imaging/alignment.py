"""The alignment: where the panel picture's points lie in one frame."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import Any, Self

import cv2
import numpy as np
from numpy.typing import NDArray

from decoder.imaging.motion import MotionCovariance
from decoder.panel.arrays import Floats
from decoder.panel.lens import Lens
from decoder.panel.thresholds import LEAST_VALUE

Point = tuple[float, float]
Matrix = NDArray[np.float64]
"""(3, 3): a plane-to-plane transformation in homogeneous coordinates."""


@dataclass(frozen=True, slots=True)
class Motion:
    """The local effect of an alignment at a point: shift (px), turn (degrees, clockwise) and scale."""

    shift_px: Point
    roll_deg: float
    scale: float


@dataclass(frozen=True, slots=True)
class Alignment:
    """The plane-to-plane transformation that carries points of the panel picture into a frame.

    Points are (x, y) pixels, free of the lens's distortion; if the lens distorts, the frame shows them where `lens`
    moves them.

    Attributes
    ----------
    elements
        The nine elements of the matrix, row by row, the last of them 1.
    score
        The lowest NCC score of the features it rests on.
    failed
        Names of the features that it does not rest on, because they did not match.
    lens
        The frame's, if known.
    covariance
        Its uncertainty, if known.
    """

    elements: tuple[float, ...]
    score: float
    failed: tuple[str, ...] = ()
    lens: Lens | None = None
    covariance: MotionCovariance | None = field(default=None, compare=False)

    @classmethod
    def of(cls, matrix: Floats, score: float, *, lens: Lens | None = None) -> Self:
        """Make the alignment with this (3, 3) matrix."""
        scaled = matrix / matrix[2, 2]
        return cls(tuple(scaled.ravel().tolist()), score, lens=lens)

    @classmethod
    def rigid(cls, roll_deg: float, offset_px: Point, score: float) -> Self:
        """Return a shift and a roll: `frame = rotation(roll) @ panel + offset`, positive clockwise on the screen."""
        cos, sin = math.cos(math.radians(roll_deg)), math.sin(math.radians(roll_deg))
        return cls((cos, -sin, offset_px[0], sin, cos, offset_px[1], 0.0, 0.0, 1.0), score)

    @classmethod
    def pinned(cls, panel_px: Point, frame_px: Point, roll_deg: float, score: float) -> Self:
        """Make the shift and roll that carry `panel_px` to `frame_px`."""
        cos, sin = math.cos(math.radians(roll_deg)), math.sin(math.radians(roll_deg))
        x, y = panel_px
        return cls.rigid(roll_deg, (frame_px[0] - (cos * x - sin * y), frame_px[1] - (sin * x + cos * y)), score)

    @property
    def matrix(self) -> Matrix:
        """(3, 3): panel picture to frame, both without distortion."""
        return np.array(self.elements).reshape(3, 3)

    @property
    def roll_deg(self) -> float:
        """The turn at the panel picture's first pixel; for a shift and a roll, it is the same everywhere."""
        return self.motion_at((0.0, 0.0)).roll_deg

    def after(self, matrix: Floats) -> Alignment:
        """Align points that this (3, 3) matrix carries to the panel picture."""
        combined = self.matrix @ matrix
        elements = tuple((combined / combined[2, 2]).ravel().tolist())
        return Alignment(
            elements, self.score, self.failed, self.lens, self.covariance
        )  # `replace` costs five times that

    def with_covariance(self, covariance: MotionCovariance) -> Alignment:
        """Attach its uncertainty."""
        return Alignment(self.elements, self.score, self.failed, self.lens, covariance)

    def motion_at(self, point_px: Point) -> Motion:
        """Return its effect on the surroundings of a point of the panel picture, without distortion."""
        x, y, depth = self.matrix @ (*point_px, 1.0)
        place = np.array([[x / depth], [y / depth]])
        (xx, xy), (yx, yy) = (self.matrix[:2, :2] - place * self.matrix[2, :2]) / depth
        shift = (float(place[0, 0]) - point_px[0], float(place[1, 0]) - point_px[1])
        return Motion(shift, math.degrees(math.atan2(yx - xy, xx + yy)), math.sqrt(abs(xx * yy - xy * yx)))

    def to_frame(self, point_px: Point) -> Point:
        """Return where a point of the panel picture lies in the frame, (x, y) px."""
        x, y, depth = self.matrix @ (*point_px, 1.0)
        place = np.array([[x / depth], [y / depth]])
        if self.lens is not None and self.lens.distorts:
            place = self.lens.distorted(place)
        return float(place[0, 0]), float(place[1, 0])

    def places(self, points: Floats, origin: Point = (0.0, 0.0)) -> NDArray[Any]:
        """Carry points into the frame.

        Parameters
        ----------
        points : (R, C, 2) float32, in the panel picture
        origin : the frame's pixel that counts as (0, 0)

        Returns
        -------
        (R, C, 2) float32
        """
        if self.lens is not None and self.lens.distorts:
            places = bent(self._carried(points, (0.0, 0.0)), self.lens)
            places -= np.array(origin, np.float32)
            return places
        return self._carried(points, origin)

    def _carried(self, points: Floats, origin: Point) -> NDArray[Any]:
        """Do `places` without distortion."""
        xx, xy, x, yx, yy, y, across, down, one = self.elements
        (left, top) = origin
        rows = (
            (xx - left * across, xy - left * down, x - left * one),
            (yx - top * across, yy - top * down, y - top * one),
        )
        if across == 0.0 and down == 0.0:
            return cv2.transform(points, np.array(rows, np.float32))
        return cv2.perspectiveTransform(points, np.array((*rows, (across, down, one))))


def is_rigid(matrix: Matrix) -> bool:
    """Whether a (3, 3) matrix is only a shift and roll, up to rounding."""
    turn = matrix[:2, :2] @ matrix[:2, :2].T
    return bool(np.abs(turn - np.eye(2)).max() < LEAST_VALUE and np.abs(matrix[2, :2]).max() == 0.0)


def upright(points: Floats) -> Floats:
    """(N, 3) float64: points (N, 2) as `carried_by` takes them, in homogeneous coordinates."""
    return np.hstack([points.astype(np.float64), np.ones((len(points), 1))])


def carried_by(matrices: Floats, points: Floats, lens: Lens | None, origin: Point = (0.0, 0.0)) -> Floats:
    """(F, N, 2) float32: where (F, 3, 3) matrices carry `upright` points, including the lens's distortion.

    The last element of each matrix is 1; `origin` is the frame's pixel that counts as (0, 0).
    """
    if lens is not None and lens.distorts:
        places = bent(_projected(matrices, points), lens)
        places -= np.array(origin, np.float32)
        return places
    moved = matrices.copy()
    moved[:, :2] -= np.array(origin)[:, None] * matrices[:, 2:]
    return _projected(moved, points).astype(np.float32)


def _projected(matrices: Floats, points: Floats) -> Floats:
    if not matrices[:, 2, :2].any():
        return np.asarray(points @ matrices[:, :2].transpose(0, 2, 1))
    there = points @ matrices.transpose(0, 2, 1)
    for axis in (0, 1):  # dividing pairs by one number takes several times as long
        there[..., axis] /= there[..., 2]
    return np.asarray(there[..., :2])


def bent(places: NDArray[Any], lens: Lens) -> NDArray[Any]:
    """Do `Lens.distorted` in single precision: to a thousandth of a pixel, at a tenth of the cost."""
    middle, focal = np.array(lens.principal_point_px, np.float32), np.float32(lens.pixels_per_radian)
    moved = lens.distortion.shift(np.moveaxis((places - middle) / focal, -1, 0))
    return np.asarray(places + focal * np.moveaxis(moved, 0, -1), np.float32)


IDENTITY = Alignment.rigid(0.0, (0.0, 0.0), 1.0)
