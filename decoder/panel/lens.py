"""The lens at one zoom, in the pixels of one picture size: where a straight line of sight arrives in the picture.

The model is OpenCV's: a pinhole with square pixels, and Brown-Conrady distortion in normalised coordinates, that is
tangents of the angles to the optical axis.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Points = NDArray[np.float64]
"""(2, N): a row of x, a row of y."""

_MAX_STEPS = 50
_ENOUGH = 1e-13  # normalised coordinates; a tenth of a millionth of a pixel is far below anything seen


@dataclass(frozen=True, slots=True)
class Lens:
    """A camera's lens at one zoom.

    Attributes
    ----------
    size_px
        Width and height of the pictures that it describes.
    principal_point_px
        (x, y) where the optical axis meets the picture.
    pixels_per_radian
        Pixels per radian in the centre of the field, which is the pinhole's focal length in pixels.
    pixels_per_radian_sigma
        Its standard uncertainty from the calibration; 0 if the calibration does not say.
    radial
        k1, k2, k3 of Brown-Conrady.
    tangential
        p1, p2.
    """

    size_px: tuple[int, int]
    principal_point_px: tuple[float, float]
    pixels_per_radian: float
    pixels_per_radian_sigma: float = 0.0
    radial: tuple[float, float, float] = (0.0, 0.0, 0.0)
    tangential: tuple[float, float] = (0.0, 0.0)

    @property
    def distorts(self) -> bool:
        """Whether the picture differs from a pinhole's at all."""
        return any((*self.radial, *self.tangential))

    @property
    def matrix(self) -> NDArray[np.float64]:
        """(3, 3): the pinhole's matrix, from normalised coordinates to undistorted pixels; OpenCV's camera matrix."""
        (x, y), scale = self.principal_point_px, self.pixels_per_radian
        return np.array([[scale, 0, x], [0, scale, y], [0, 0, 1]], np.float64)

    @property
    def coefficients(self) -> NDArray[np.float64]:
        """(5,): k1, k2, p1, p2, k3, in OpenCV's order."""
        k1, k2, k3 = self.radial
        return np.array([k1, k2, *self.tangential, k3], np.float64)

    def normalised(self, points_px: Points) -> Points:
        """(2, N) pixels as (2, N) normalised coordinates, distortion untouched."""
        return np.asarray((points_px - np.reshape(self.principal_point_px, (2, 1))) / self.pixels_per_radian)

    def pixels(self, normalised: Points) -> Points:
        """(2, N) normalised coordinates as (2, N) pixels, distortion untouched."""
        return np.asarray(normalised * self.pixels_per_radian + np.reshape(self.principal_point_px, (2, 1)))

    def distorted(self, points_px: Points) -> Points:
        """Where the picture has what a pinhole would show.

        Parameters
        ----------
        points_px : (2, N) pixels of a pinhole's picture

        Returns
        -------
        (2, N) pixels of the picture as taken
        """
        points = np.asarray(points_px, np.float64)
        return self.pixels(self._bent(self.normalised(points))) if self.distorts else points

    def undistorted(self, points_px: Points) -> Points:
        """Where a pinhole would show what the picture has: the inverse of `distorted`, by Newton's method.

        Parameters
        ----------
        points_px : (2, N) pixels of the picture as taken

        Returns
        -------
        (2, N) pixels of a pinhole's picture; NaN where no line of sight arrives (far outside the picture)
        """
        points = np.asarray(points_px, np.float64)
        return self.pixels(self._straightened(self.normalised(points))) if self.distorts else points

    def _bent(self, at: Points) -> Points:
        (x, y), (p1, p2) = at, self.tangential
        square = x * x + y * y
        gain = self._gain(square)
        return np.stack([
            x * gain + 2 * p1 * x * y + p2 * (square + 2 * x * x),
            y * gain + p1 * (square + 2 * y * y) + 2 * p2 * x * y,
        ])  # fmt: skip

    def _straightened(self, bent: Points) -> Points:
        at = bent.copy()
        with np.errstate(all="ignore"):  # what diverges becomes NaN below
            for _ in range(_MAX_STEPS):
                miss = self._bent(at) - bent
                if np.allclose(miss, 0.0, rtol=0.0, atol=_ENOUGH):
                    break
                at -= self._solved(at, miss)
            found = np.abs(self._bent(at) - bent).max(axis=0, initial=0.0) < 1e-9  # noqa: PLR2004 - still no pixel
            upright = self._slope(np.hypot(*at)) > 0  # beyond the fold the model shows the picture mirrored
        return np.where(found & upright, at, np.nan)

    def _solved(self, at: Points, miss: Points) -> Points:
        """Solve the 2x2 Jacobian of `_bent` at each point for the miss: a Newton step."""
        (x, y), (p1, p2) = at, self.tangential
        square = x * x + y * y
        gain, twice = self._gain(square), 2 * self._gain_slope(square)
        xx = gain + twice * x * x + 2 * p1 * y + 6 * p2 * x
        yy = gain + twice * y * y + 6 * p1 * y + 2 * p2 * x
        xy = twice * x * y + 2 * p1 * x + 2 * p2 * y  # symmetric
        determinant = xx * yy - xy * xy
        return np.asarray(np.stack([yy * miss[0] - xy * miss[1], xx * miss[1] - xy * miss[0]]) / determinant)

    def _gain(self, square: Points) -> Points:
        k1, k2, k3 = self.radial
        return np.asarray(1 + square * (k1 + square * (k2 + square * k3)))

    def _gain_slope(self, square: Points) -> Points:
        """Compute the derivative of `_gain` by the squared radius."""
        k1, k2, k3 = self.radial
        return np.asarray(k1 + square * (2 * k2 + square * 3 * k3))

    def _slope(self, radius: Points) -> Points:
        """How fast a point's radius in the picture grows with its angle's tangent; negative beyond the fold."""
        square = radius * radius
        return np.asarray(self._gain(square) + 2 * square * self._gain_slope(square))

    def reaches_corners(self) -> bool:
        """Whether a line of sight arrives at every corner of the picture; not so with absurd coefficients."""
        width, height = self.size_px
        x, y = self.principal_point_px
        corner = math.hypot(max(x, width - 1 - x), max(y, height - 1 - y)) / self.pixels_per_radian
        radius = np.linspace(0, 2 * corner + 0.01, 1000)
        folds = np.flatnonzero(self._slope(radius) <= 0)
        upright = radius[: folds[0]] if folds.size else radius
        return bool(upright.size and (upright * self._gain(upright**2)).max() >= corner)
