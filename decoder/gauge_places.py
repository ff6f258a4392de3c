"""Gauge places: each dial found by its own marks, where the panel is no plane.

Dials and anchors stand at different depths behind the panel. While the camera keeps its place that does no harm; when
it moves, they move against each other, by pixels for millimetres. Then every dial is looked for near where the anchors
have it: first as a whole by NCC, then by robust least squares of its own pixels, in which the needle, wherever it is,
counts as an outlier.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import cv2
import numpy as np

from decoder.alignment import Alignment, Matrix, Point
from decoder.arrays import Floats, Mask
from decoder.dial_plane import DialPlane
from decoder.dial_points import dial_points, without_needles
from decoder.gauge import Gauge
from decoder.motion import Frame2D, Model
from decoder.pictures import GreyPicture
from decoder.resampling import PointMap
from decoder.sorting import middle_of

SEARCH_PX = 24
MIN_FIRST_SCORE = 0.45
MIN_SCORE = 0.8
# On a dark dial most pixels are alike wherever it lies; marks that are not yet in place must not count as outliers.
SPREADS_LEVELS = (25.0, 15.0, 10.0, 8.0, 6.0, 6.0)
SETTLED_PX = 0.005
# Tukey's biweight: 95 % as efficient as least squares where there are no outliers.
TUKEY_SPREADS = 4.685
MAD_TO_SIGMA = 1.4826
# Of what holds the dial in place, measured by its gradients, so much must be seen.
MIN_EXPLAINED = 0.5
# What another perspective may do at a dial's rim beyond a shift.
MAX_BEND_PART = 0.06
# By how much perspective stretches or shears a dial as a rule, where its marks hardly tell; and their usual noise.
BEND_PART = 0.01
NOISE_LEVELS = 4.0


@dataclass(frozen=True, slots=True)
class GaugePlace:
    """Where one dial lies in a frame.

    Attributes
    ----------
    alignment
        Of the panel picture's points around the dial.
    motion
        (3, 3): what that is beyond the alignment by the anchors.
    shift_px
        How far its centre lies from where the anchors have it, (x, y) in the panel picture's pixels.
    sigma_px
        How uncertain that is.
    score
        NCC of its marks, the needle left out.
    """

    alignment: Alignment
    motion: Matrix
    shift_px: Point
    sigma_px: float
    score: float

    def held(self, centre_px: Point, usual_px: Point, part: float) -> GaugePlace:
        """The same with so much of what its own marks say beyond the usual shift of its centre."""
        own = self.motion / self.motion[2, 2]
        x, y = (usual + part * (shift - usual) for usual, shift in zip(usual_px, self.shift_px, strict=True))
        motion = np.eye(3)
        motion[:2, :2] += part * (own[:2, :2] - np.eye(2))
        motion[:2, 2] = np.add(centre_px, (x, y)) - motion[:2, :2] @ centre_px
        alignment = self.alignment.after(np.linalg.inv(self.motion) @ motion)
        return GaugePlace(alignment, motion, (float(x), float(y)), math.sqrt(part) * self.sigma_px, self.score)

    def motion_of(self, point_px: Point) -> Point:
        """Where a point near the dial lies if the anchors' alignment is taken for granted, (x, y) panel pixels."""
        return _carried(self.motion, point_px)


class GaugePlacer:
    """Finds one dial of the panel picture in frames that are aligned roughly.

    Parameters
    ----------
    gauge
        From the panel.
    plane
        Of the dial, where it is not seen square on.
    picture
        The panel picture.
    own
        The alignment of the panel picture with itself, as taken.
    """

    def __init__(self, gauge: Gauge, plane: DialPlane | None, picture: GreyPicture, own: Alignment) -> None:
        points = dial_points(gauge, plane)
        points = points[:, _on(picture, points, own)]
        self._points = PointMap.of([points])
        self._centre = gauge.centre if plane is None else _carried(plane.matrix, (0.0, 0.0))
        self._pixels = self._points.sample(picture, own).astype(np.float64)
        right, down = np.array([[0.5], [0]], np.float32), np.array([[0], [0.5]], np.float32)
        gradient_x, gradient_y = (
            PointMap.of([points + half]).sample(picture, own) - PointMap.of([points - half]).sample(picture, own)
            for half in (right, down)
        )
        strength = (gradient_x**2 + gradient_y**2).astype(np.float64)
        self._strength = strength / max(float(strength.sum()), 1e-9)
        self._axes = Frame2D.around(points)
        jacobian = self._axes.jacobian(points, Model.AFFINE)
        motion = gradient_x[:, None] * jacobian[0] + gradient_y[:, None] * jacobian[1]
        self._columns = np.column_stack([self._pixels, np.ones(len(motion)), motion])
        self._held = np.zeros(self._columns.shape[1])
        self._held[-2:] = (NOISE_LEVELS / (BEND_PART * self._axes.lever_px)) ** 2
        left, top = np.floor(points.min(axis=1)).astype(int).tolist()
        end, bottom = np.ceil(points.max(axis=1)).astype(int).tolist()
        self._box = (left, top, end + 1, bottom + 1)
        self._patch = without_needles(_patch(picture, own, self._box), gauge, plane, self._box)

    @property
    def centre(self) -> Point:
        """Where its needles turn, in the panel picture."""
        return self._centre

    @property
    def middle(self) -> Point:
        """The middle of what is looked at, in the panel picture."""
        return self._axes.middle_px

    def place(self, frame: GreyPicture, alignment: Alignment, anchored: Alignment | None = None) -> GaugePlace | None:
        """Where the dial lies, near where the alignment has it; None where its marks are not found.

        The shift is told from `anchored`, where the anchors have the dial, if that is another alignment.
        """
        shift = self._by_correlation(frame, alignment)
        place = None if shift is None else self._settled(frame, alignment, shift)
        if place is None or anchored is None:
            return place
        motion = np.linalg.inv(anchored.matrix) @ place.alignment.matrix
        x, y = _carried(motion, self._centre)
        return replace(place, motion=motion, shift_px=(x - self._centre[0], y - self._centre[1]))

    def _by_correlation(self, frame: GreyPicture, alignment: Alignment) -> Matrix | None:
        """The best shift by NCC of the whole dial."""
        left, top, end, bottom = self._box
        region = _patch(frame, alignment, (left - SEARCH_PX, top - SEARCH_PX, end + SEARCH_PX, bottom + SEARCH_PX))
        scores = cv2.matchTemplate(region, self._patch, cv2.TM_CCOEFF_NORMED)
        _, best, _, (right, down) = cv2.minMaxLoc(scores)
        if best < MIN_FIRST_SCORE:
            return None
        return np.array([[1.0, 0.0, right - SEARCH_PX], [0.0, 1.0, down - SEARCH_PX], [0.0, 0.0, 1.0]])

    def _settled(self, frame: GreyPicture, alignment: Alignment, motion: Matrix) -> GaugePlace | None:
        held = np.zeros(len(self._held))
        for spread_levels in SPREADS_LEVELS:
            seen = self._points.sample(frame, alignment.after(motion)).astype(np.float64)
            weights = self._weights(seen, spread_levels)
            weighted = self._columns * weights[:, None]
            normal = weighted.T @ self._columns
            normal[np.diag_indices(len(normal))] += 1e-9 * normal.trace() + self._held
            solution = np.linalg.solve(normal, weighted.T @ seen - self._held * held)
            held += solution
            gain = float(solution[0])
            if gain <= 0:
                return None
            step = -solution[2:] / gain
            motion = motion @ self._axes.matrix(step.tolist(), Model.AFFINE)
            if spread_levels == SPREADS_LEVELS[-1] and float(np.abs(step).max()) < SETTLED_PX:
                break
        return self._place(alignment, motion, seen, normal)

    def _weights(self, seen: Floats, spread_levels: float) -> Floats:
        """(N,): 0 for pixels that show something else than the dial, such as the needle."""
        weights = np.ones_like(seen)
        for _ in range(2):
            wanted = self._pixels
            total = weights.sum()
            mean, seen_mean = (weights * wanted).sum() / total, (weights * seen).sum() / total
            centred = weights * (wanted - mean)
            gain = float(centred @ (seen - seen_mean)) / max(float(centred @ (wanted - mean)), 1e-9)
            off = seen - seen_mean - gain * (wanted - mean)
            off -= middle_of(off)
            spread = max(MAD_TO_SIGMA * float(middle_of(np.abs(off))), spread_levels)
            weights = np.maximum(1.0 - (off / (TUKEY_SPREADS * spread)) ** 2, 0.0) ** 2
        return weights

    def _place(self, alignment: Alignment, motion: Matrix, seen: Floats, normal: Floats) -> GaugePlace | None:
        weights = self._weights(seen, SPREADS_LEVELS[-1])
        total = float(weights.sum())
        wanted = self._pixels
        one = wanted - (weights * wanted).sum() / total
        other = seen - (weights * seen).sum() / total
        norm = math.sqrt(float((weights * one * one).sum() * (weights * other * other).sum()))
        score = float((weights * one * other).sum()) / max(norm, 1e-9)
        x, y = self._centre
        there = motion @ (x, y, 1.0)
        shift = (float(there[0] / there[2]) - x, float(there[1] / there[2]) - y)
        bend = np.abs(motion[:2, :2] - np.eye(2)).max()
        if score < MIN_SCORE or float(weights @ self._strength) < MIN_EXPLAINED or math.hypot(*shift) > 2 * SEARCH_PX:
            return None
        if bend > MAX_BEND_PART:
            return None
        noise = float(
            (weights * (other - (score * norm / max(float((weights * one * one).sum()), 1e-9)) * one) ** 2).sum()
        )
        gain = score * norm / max(float((weights * one * one).sum()), 1e-9)
        covariance = np.linalg.inv(normal)[2:, 2:] * (noise / total) / gain**2
        jacobian = self._axes.jacobian(np.array([[x], [y]]), Model.AFFINE)[:, 0]
        sigma_px = math.sqrt(max(float(np.trace(jacobian @ covariance @ jacobian.T)) / 2, 0.0))
        return GaugePlace(alignment.after(motion), motion, shift, sigma_px, score)


def _carried(motion: Matrix, point_px: Point) -> Point:
    x, y, depth = motion @ (*point_px, 1.0)
    return float(x / depth), float(y / depth)


def _patch(picture: GreyPicture, alignment: Alignment, box: tuple[int, int, int, int]) -> GreyPicture:
    """The panel picture's pixels from left and top to end and bottom, as another picture has them."""
    left, top, end, bottom = box
    x, y = np.meshgrid(np.arange(left, end), np.arange(top, bottom))
    samples = PointMap.of([np.stack([x.ravel(), y.ravel()]).astype(np.float32)]).sample(picture, alignment)
    return np.rint(samples).astype(np.uint8).reshape(x.shape)


def _on(picture: GreyPicture, points: Floats, own: Alignment) -> Mask:
    """(N,): which points lie on the panel picture, with a pixel to spare."""
    x, y = own.places(np.ascontiguousarray(points.T[None], np.float32))[0].T
    height, width = picture.shape
    on: Mask = (x >= 1) & (y >= 1) & (x <= width - 2) & (y <= height - 2)
    return on
