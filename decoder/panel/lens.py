"""The lens at one zoom, in the pixels of one picture size: where a straight line of sight arrives in the picture.

The model is OpenCV's: a pinhole with square pixels, and a distortion in normalised coordinates, that is in tangents of
the angles to the optical axis. `BrownConrady` is for ordinary lenses, with its rational form for wide ones; `Fisheye`
is for lenses as wide as an action camera's or wider, equidistant up to four coefficients. Sources: OpenCV, `calib3d`
and `calib3d::fisheye`; Kannala and Brandt, IEEE PAMI 28 (2006) 1335.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from enum import StrEnum
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

Points = NDArray[np.float64]
"""(2, N): a row of x, a row of y."""
Floats = NDArray[np.floating]

_MAX_STEPS = 50
_ENOUGH = 1e-13  # normalised coordinates; a tenth of a millionth of a pixel is far below anything visible
_FINE = 2000  # radii or angles at which a distortion is tested for folding over


class DistortionModel(StrEnum):
    """The models of distortion, as `camera.yaml` names them."""

    BROWN_CONRADY = "brown_conrady"
    RATIONAL = "rational"
    FISHEYE = "fisheye"


class Distortion(Protocol):
    """Moves points in normalised coordinates."""

    @property
    def model(self) -> DistortionModel:
        """The model."""

    @property
    def coefficients(self) -> tuple[float, ...]:
        """In the order of OpenCV and Foxglove."""

    @property
    def is_none(self) -> bool:
        """Whether the picture is a pinhole's."""

    def shift(self, at: Floats) -> Floats:
        """(2, ...): how far it moves points (2, ...) of a pinhole's picture, in their precision."""

    def undone(self, bent: Points) -> Points:
        """(2, N) normalised coordinates without distortion; NaN where no line of sight arrives."""

    def reaches(self, radius: float) -> bool:
        """Whether the distortion is one-to-one up to this radius of the picture."""


@dataclass(frozen=True, slots=True)
class BrownConrady:
    """Brown-Conrady's polynomial of the squared radius, or with a divisor the ratio of two.

    Attributes
    ----------
    radial
        k1, k2, k3.
    tangential
        p1, p2.
    divisor
        k4, k5, k6 of the rational model.
    """

    radial: tuple[float, float, float] = (0.0, 0.0, 0.0)
    tangential: tuple[float, float] = (0.0, 0.0)
    divisor: tuple[float, float, float] = (0.0, 0.0, 0.0)

    @property
    def model(self) -> DistortionModel:
        """Rational if there is a divisor."""
        return DistortionModel.RATIONAL if any(self.divisor) else DistortionModel.BROWN_CONRADY

    @property
    def coefficients(self) -> tuple[float, ...]:
        """k1, k2, p1, p2, k3, and of the rational model k4, k5, k6."""
        k1, k2, k3 = self.radial
        return (k1, k2, *self.tangential, k3, *(self.divisor if any(self.divisor) else ()))

    @property
    def is_none(self) -> bool:
        """Whether all coefficients are nought."""
        return not any(self.coefficients)

    def shift(self, at: Floats) -> Floats:
        """Move outwards by the polynomial, and tangentially."""
        x, y = at
        square = x * x + y * y
        moved = at * self._excess(square)
        if any(self.tangential):
            p1, p2 = self.tangential
            across = 2 * x * y
            moved[0] += p1 * across + p2 * (square + 2 * x * x)
            moved[1] += p1 * (square + 2 * y * y) + p2 * across
        return moved

    def undone(self, bent: Points) -> Points:
        """Invert by Newton's method."""
        at = bent.copy()
        with np.errstate(all="ignore"):  # what diverges becomes NaN below
            for _ in range(_MAX_STEPS):
                miss = self._bent(at) - bent
                if np.allclose(miss, 0.0, rtol=0.0, atol=_ENOUGH):
                    break
                at -= self._solved(at, miss)
            found = np.abs(self._bent(at) - bent).max(axis=0, initial=0.0) < 1e-9  # noqa: PLR2004 - far below a pixel
            upright = self._slope(np.hypot(*at)) > 0  # beyond the fold the model shows the picture mirrored
        return np.where(found & upright, at, np.nan)

    def reaches(self, radius: float) -> bool:
        """Test where the model folds over; with sound coefficients not before the radius."""
        radii = np.linspace(0, 2 * radius + 0.01, _FINE)
        with np.errstate(all="ignore"):  # a divisor may be zero somewhere
            folds = np.flatnonzero(~(self._slope(radii) > 0))
            upright = radii[: folds[0]] if folds.size else radii
            return bool(upright.size and (upright * (1 + self._excess(upright**2))).max() >= radius)

    def _bent(self, at: Points) -> Points:
        return np.asarray(at + self.shift(at), np.float64)

    def _excess(self, square: Floats) -> Floats:
        """Return by how much more than 1 the radius is multiplied."""
        above = _polynomial(self.radial, square)
        if not any(self.divisor):
            return above
        below = _polynomial(self.divisor, square)
        return np.asarray((above - below) / (1 + below))

    def _solved(self, at: Points, miss: Points) -> Points:
        """Solve the 2x2 Jacobian of `_bent` at each point for the miss: a Newton step."""
        (x, y), (p1, p2) = at, self.tangential
        square = x * x + y * y
        gain, twice = 1 + self._excess(square), 2 * self._excess_slope(square)
        xx = gain + twice * x * x + 2 * p1 * y + 6 * p2 * x
        yy = gain + twice * y * y + 6 * p1 * y + 2 * p2 * x
        xy = twice * x * y + 2 * p1 * x + 2 * p2 * y  # symmetric
        determinant = xx * yy - xy * xy
        return np.asarray(np.stack([yy * miss[0] - xy * miss[1], xx * miss[1] - xy * miss[0]]) / determinant)

    def _excess_slope(self, square: Points) -> Points:
        """Compute the derivative of `excess` by the squared radius."""
        above, below = 1 + _polynomial(self.radial, square), 1 + _polynomial(self.divisor, square)
        rising, falling = _slope(self.radial, square), _slope(self.divisor, square)
        return np.asarray((rising * below - above * falling) / below**2)

    def _slope(self, radius: Points) -> Points:
        """Return how fast a point's radius in the picture grows with its angle's tangent; negative beyond the fold."""
        square = radius * radius
        return np.asarray(1 + self._excess(square) + 2 * square * self._excess_slope(square))


@dataclass(frozen=True, slots=True)
class Fisheye:
    """The picture's radius is the angle to the axis, times 1 + k1 angle^2 + k2 angle^4 + k3 angle^6 + k4 angle^8.

    A line of sight perpendicular to the axis or from behind has no place in a pinhole's picture, and none here.
    """

    radial: tuple[float, float, float, float] = (0.0, 0.0, 0.0, 0.0)

    @property
    def model(self) -> DistortionModel:
        """Always the fisheye's."""
        return DistortionModel.FISHEYE

    @property
    def coefficients(self) -> tuple[float, ...]:
        """k1, k2, k3, k4."""
        return self.radial

    @property
    def is_none(self) -> bool:
        """Never, as an angle is not a tangent."""
        return False

    def shift(self, at: Floats) -> Floats:
        """Replace the tangent of the angle by its polynomial."""
        x, y = at
        tangent = np.sqrt(x * x + y * y)
        angle = np.arctan(tangent)
        with np.errstate(invalid="ignore", divide="ignore"):  # on the axis
            excess = angle * (1 + _polynomial(self.radial, angle * angle)) / tangent - 1
        return np.asarray(at * np.where(tangent > 0, excess, np.zeros_like(excess)))

    def undone(self, bent: Points) -> Points:
        """Invert by Newton's method on the angle."""
        radius = np.hypot(*bent)
        angle = np.minimum(radius, math.pi / 2)
        with np.errstate(all="ignore"):  # what diverges becomes NaN below
            for _ in range(_MAX_STEPS):
                miss = self._radius(angle) - radius
                if np.allclose(miss, 0.0, rtol=0.0, atol=_ENOUGH):
                    break
                angle = np.clip(angle - miss / self._slope(angle), 0.0, math.pi / 2)
            found = (np.abs(self._radius(angle) - radius) < 1e-9) & (angle < math.pi / 2) & (self._slope(angle) > 0)  # noqa: PLR2004 - as above
            gain = np.where(radius > 0, np.tan(angle) / radius, 1.0)
        return np.where(found, bent * gain, np.nan)

    def reaches(self, radius: float) -> bool:
        """Test where the model folds over; a picture's corners may well be beyond."""
        angles = np.linspace(0, math.pi / 2, _FINE)
        beyond = np.flatnonzero(self._radius(angles) >= radius)
        return bool((self._slope(angles[: beyond[0] + 1] if beyond.size else angles) > 0).all())

    def _radius(self, angle: Points) -> Points:
        return np.asarray(angle * (1 + _polynomial(self.radial, angle * angle)))

    def _slope(self, angle: Points) -> Points:
        square = angle * angle
        return np.asarray(1 + _polynomial(self.radial, square) + 2 * square * _slope(self.radial, square))


def distortion_of(model: DistortionModel, coefficients: Sequence[float]) -> Distortion:
    """Make a distortion from its coefficients, in their order there."""
    if model is DistortionModel.FISHEYE:
        k1, k2, k3, k4 = coefficients
        return Fisheye((k1, k2, k3, k4))
    k1, k2, p1, p2, k3, *divisor = coefficients
    k4, k5, k6 = divisor or (0.0, 0.0, 0.0)
    return BrownConrady((k1, k2, k3), (p1, p2), (k4, k5, k6))


def _polynomial(coefficients: tuple[float, ...], at: Floats) -> Floats:
    """Sum coefficients times x, x^2 and so on, in the precision of x."""
    total = np.zeros_like(at)
    for coefficient in reversed(coefficients):
        total = (total + coefficient) * at
    return total


def _slope(coefficients: tuple[float, ...], at: Points) -> Points:
    """Compute the derivative of `_polynomial`."""
    powers = tuple(power * coefficient for power, coefficient in enumerate(coefficients, 1))
    return np.asarray(np.polynomial.polynomial.polyval(at, powers))


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
    distortion
        From a pinhole's picture to this one.
    """

    size_px: tuple[int, int]
    principal_point_px: tuple[float, float]
    pixels_per_radian: float
    pixels_per_radian_sigma: float = 0.0
    distortion: Distortion = BrownConrady()

    @property
    def distorts(self) -> bool:
        """Whether the picture differs from a pinhole's at all."""
        return not self.distortion.is_none

    @property
    def matrix(self) -> NDArray[np.float64]:
        """(3, 3): the pinhole's matrix, from normalised coordinates to undistorted pixels; OpenCV's camera matrix."""
        (x, y), scale = self.principal_point_px, self.pixels_per_radian
        return np.array([[scale, 0, x], [0, scale, y], [0, 0, 1]], np.float64)

    def normalised(self, points_px: Points) -> Points:
        """Convert (2, N) pixels to normalised coordinates, leaving distortion as it is."""
        return np.asarray((points_px - np.reshape(self.principal_point_px, (2, 1))) / self.pixels_per_radian)

    def pixels(self, normalised: Points) -> Points:
        """Convert (2, N) normalised coordinates to pixels, leaving distortion as it is."""
        return np.asarray(normalised * self.pixels_per_radian + np.reshape(self.principal_point_px, (2, 1)))

    def distorted(self, points_px: Points) -> Points:
        """Return where the picture shows what a pinhole would show at these points.

        Parameters
        ----------
        points_px : (2, N) pixels of a pinhole's picture

        Returns
        -------
        (2, N) pixels of the picture as taken
        """
        points = np.asarray(points_px, np.float64)
        if not self.distorts:
            return points
        at = self.normalised(points)
        return self.pixels(np.asarray(at + self.distortion.shift(at), np.float64))

    def undistorted(self, points_px: Points) -> Points:
        """Return where a pinhole would show these points of the picture: inverts `distorted` by Newton's method.

        Parameters
        ----------
        points_px : (2, N) pixels of the picture as taken

        Returns
        -------
        (2, N) pixels of a pinhole's picture; NaN where no line of sight arrives (far outside the picture)
        """
        points = np.asarray(points_px, np.float64)
        return self.pixels(self.distortion.undone(self.normalised(points))) if self.distorts else points

    def reaches_corners(self) -> bool:
        """Whether the distortion is one-to-one up to the corners of the picture; absurd coefficients are not."""
        width, height = self.size_px
        x, y = self.principal_point_px
        corner = math.hypot(max(x, width - 1 - x), max(y, height - 1 - y)) / self.pixels_per_radian
        return self.distortion.reaches(corner)
