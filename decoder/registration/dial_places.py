"""Dial places: each dial located by its own marks, for panels that are not a plane.

Dials and anchors are at different depths behind the panel. While the camera stays in place that does no harm; when it
moves, they shift relative to each other, by pixels for millimetres. Then every dial is searched for near where the
anchors put it: first as a whole by NCC, then by robust least squares on its own pixels, in which the needle is an
outlier wherever it points.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import cv2
import numpy as np

from decoder.imaging.alignment import Alignment, Matrix, Point
from decoder.imaging.motion import Frame2D, Model
from decoder.imaging.pictures import GreyPicture
from decoder.imaging.planes import DialPlane
from decoder.imaging.resampling import PointMap, levels_at
from decoder.imaging.sorting import MAD_TO_SIGMA, median
from decoder.imaging.thresholds import HALF
from decoder.panel.arrays import Floats, Mask
from decoder.panel.gauge import Gauge
from decoder.registration.thresholds import (
    BESIDE_PX,
    BESIDE_SWEEP_DEG,
    DIAL_POINTS_ACROSS,
    MAX_BEND_PART,
    MIN_FIRST_SCORE,
    REACH,
    SCORE_THRESHOLD,
    SEARCH_PX,
    SETTLED_PX,
    SPREADS_LEVELS,
    TUKEY_SPREADS,
)

# Radius from which the pixels under the panel picture's needles are inpainted.
FILLED_FROM_PX = 3.0

# Lower limit of the uncertainty of a dial's place when dials are weighted against each other.
SURE_PX = 0.01
# Regularises stretch and shear of a dial whose marks hardly determine them, by how much perspective usually causes and
# by the usual noise.
BEND_LEVELS = 400.0


def dial_points(gauge: Gauge, plane: DialPlane | None) -> Floats:
    """(2, N) float32: a grid of points on the dial and around it, without those under the panel picture's needles."""
    inner, outer = gauge.radius[0], max(gauge.radius[1] * REACH, gauge.radius[1] + BESIDE_PX)
    stride = max(1.0, 2 * outer / DIAL_POINTS_ACROSS)
    steps = np.arange(-outer, outer + stride, stride)
    across, down = (grid.ravel() for grid in np.meshgrid(steps, steps))
    radius, angle = np.hypot(across, down), np.degrees(np.arctan2(down, across))
    start, end = gauge.sweep
    within = (angle - (start - BESIDE_SWEEP_DEG)) % 360.0 <= end - start + 2 * BESIDE_SWEEP_DEG
    keep = (radius >= inner) & (radius <= outer) & within & ~_under_pointers(across, down, gauge)
    points = np.stack([across[keep], down[keep]])
    if plane is not None:
        return plane.to_panel(points).astype(np.float32)
    around: Floats = (points + np.array(gauge.centre)[:, None]).astype(np.float32)
    return around


def without_needles(
    patch: GreyPicture, gauge: Gauge, plane: DialPlane | None, box: tuple[int, int, int, int]
) -> GreyPicture:
    """Return a dial's picture with its needles inpainted, so that no frame's needle can match them.

    Parameters
    ----------
    patch
        Of the panel picture, (H, W) uint8.
    box
        Its first column and row in the panel picture, and the first ones beyond it.
    """
    left, top, end, bottom = box
    x, y = np.meshgrid(np.arange(left, end, dtype=np.float64), np.arange(top, bottom, dtype=np.float64))
    across, down = _around_pivot(np.stack([x.ravel(), y.ravel()]), gauge, plane)
    covered = _under_pointers(across, down, gauge).reshape(patch.shape)
    return np.asarray(cv2.inpaint(patch, covered.astype(np.uint8), FILLED_FROM_PX, cv2.INPAINT_TELEA), np.uint8)


def _around_pivot(points: Floats, gauge: Gauge, plane: DialPlane | None) -> Floats:
    """(2, N): points of the panel picture relative to the pivot, on the dial seen square on."""
    if plane is None:
        from_pivot: Floats = points - np.array(gauge.centre)[:, None]
        return from_pivot
    there = np.linalg.inv(plane.matrix) @ np.vstack([points, np.ones(points.shape[1])])
    square_on: Floats = there[:2] / there[2]
    return square_on


def _under_pointers(across: Floats, down: Floats, gauge: Gauge) -> Mask:
    """(N,): which points, relative to the pivot, lie where the panel picture shows a needle."""
    angle = np.degrees(np.arctan2(down, across))
    under = np.zeros(angle.shape, bool)
    for pointer in gauge.turning:
        if pointer.at_deg is not None and pointer.hides_deg is not None:
            under |= np.abs((angle - pointer.at_deg + 180.0) % 360.0 - 180.0) <= pointer.hides_deg / 2
    return under


@dataclass(frozen=True, slots=True)
class GaugePlace:
    """Where one dial lies in a frame.

    Attributes
    ----------
    alignment
        Of the panel picture's points around the dial.
    motion
        (3, 3): its difference from the alignment by the anchors.
    shift_px
        How far its centre lies from where the anchors put it, (x, y) in the panel picture's pixels.
    sigma_px
        The uncertainty of that.
    """

    alignment: Alignment
    motion: Matrix
    shift_px: Point
    sigma_px: float

    def held(self, centre_px: Point, usual_px: Point, part: float) -> GaugePlace:
        """Keep only a part of what its own marks say beyond the usual shift of its centre."""
        own = self.motion / self.motion[2, 2]
        x, y = (usual + part * (shift - usual) for usual, shift in zip(usual_px, self.shift_px, strict=True))
        motion = np.eye(3)
        motion[:2, :2] += part * (own[:2, :2] - np.eye(2))
        motion[:2, 2] = np.add(centre_px, (x, y)) - motion[:2, :2] @ centre_px
        alignment = self.alignment.after(np.linalg.inv(self.motion) @ motion)
        return GaugePlace(alignment, motion, (float(x), float(y)), math.sqrt(part) * self.sigma_px)


class GaugePlacer:
    """Finds one dial of the panel picture in frames that are roughly aligned.

    Parameters
    ----------
    gauge
        From the panel.
    plane
        Of the dial, if it is not seen square on.
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
        self._held[-2:] = (BEND_LEVELS / self._axes.lever_px) ** 2
        left, top = np.floor(points.min(axis=1)).astype(int).tolist()
        end, bottom = np.ceil(points.max(axis=1)).astype(int).tolist()
        self._box = (left, top, end + 1, bottom + 1)
        self._patch = without_needles(_patch(picture, own, self._box), gauge, plane, self._box)

    @property
    def centre(self) -> Point:
        """Where its needles turn, in the panel picture."""
        return self._centre

    def place(self, frame: GreyPicture, alignment: Alignment) -> GaugePlace | None:
        """Find the dial near where the alignment puts it; None if its marks are not found."""
        shift = self._by_correlation(frame, alignment)
        return None if shift is None else self._settled(frame, alignment, shift)

    def _by_correlation(self, frame: GreyPicture, alignment: Alignment) -> Matrix | None:
        """Find the best shift by NCC of the whole dial."""
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
            places = self._points.places(alignment.after(motion))
            seen = levels_at(frame, places)[: len(self._pixels)].astype(np.float64)
            shows = _within(frame, places.reshape(-1, 2)[: len(self._pixels)])
            if float(shows @ self._strength) < HALF:
                return None
            weights = self._weights(seen, shows, spread_levels)
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
            if spread_levels == SPREADS_LEVELS[-1] and float(np.abs(step).max()) < SETTLED_PX / 2:
                break
        return self._place(alignment, motion, seen, shows, normal)

    def _weights(self, seen: Floats, shows: Mask, spread_levels: float) -> Floats:
        """(N,): 0 for pixels that show something other than the dial, such as the needle, or lie outside the frame."""
        weights = shows.astype(np.float64)
        for _ in range(2):
            wanted = self._pixels
            total = weights.sum()
            mean, seen_mean = (weights * wanted).sum() / total, (weights * seen).sum() / total
            centred = weights * (wanted - mean)
            gain = float(centred @ (seen - seen_mean)) / max(float(centred @ (wanted - mean)), 1e-9)
            off = seen - seen_mean - gain * (wanted - mean)
            off -= median(off[shows])
            spread = max(MAD_TO_SIGMA * float(median(np.abs(off[shows]))), spread_levels)
            weights = shows * np.maximum(1.0 - (off / (TUKEY_SPREADS * spread)) ** 2, 0.0) ** 2
        return weights

    def _place(
        self, alignment: Alignment, motion: Matrix, seen: Floats, shows: Mask, normal: Floats
    ) -> GaugePlace | None:
        weights = self._weights(seen, shows, SPREADS_LEVELS[-1])
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
        if score < SCORE_THRESHOLD or float(weights @ self._strength) < HALF or math.hypot(*shift) > 2 * SEARCH_PX:
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
        return GaugePlace(alignment.after(motion), motion, shift, sigma_px)


def at_consensus(
    placers: Sequence[GaugePlacer | None],
    places: Sequence[GaugePlace | None],
    alignment: Alignment,
    apart_px: Sequence[float] = (),
) -> list[GaugePlace | None]:
    """Place each dial whose own marks are not found at the mean shift of the others; its sigma is their scatter.

    Marks around a needle may turn too, or lie in glare. The anchors count as one more dial, with no shift. The variance
    is that of one more sample beside so few, of Student's t with two degrees of freedom for each dial but the first.
    Where fewer than two are found it lies where the anchors put it, if it is known how far off each usually is.
    """
    found = [place.shift_px for placer, place in zip(placers, places, strict=True) if placer and place]
    spare = len(found) - 1
    if spare <= 0:
        anchored = [GaugePlace(alignment, np.eye(3), (0.0, 0.0), off_px) for off_px in apart_px] or places
        return [place or there for place, there in zip(places, anchored, strict=True)]
    shifts = np.array([(0.0, 0.0), *found])
    usual = shifts.mean(axis=0)
    apart_px2 = float(shifts.var(axis=0, ddof=1).mean()) * (1 + 1 / len(shifts)) * (1 + 1 / spare)
    motion = np.array([[1.0, 0.0, usual[0]], [0.0, 1.0, usual[1]], [0.0, 0.0, 1.0]])
    there = GaugePlace(alignment.after(motion), motion, (float(usual[0]), float(usual[1])), math.sqrt(apart_px2))
    return [place or there for place in places]


def _carried(motion: Matrix, point_px: Point) -> Point:
    x, y, depth = motion @ (*point_px, 1.0)
    return float(x / depth), float(y / depth)


def _patch(picture: GreyPicture, alignment: Alignment, box: tuple[int, int, int, int]) -> GreyPicture:
    """Sample the panel picture's pixels from left and top to end and bottom in another picture."""
    left, top, end, bottom = box
    x, y = np.meshgrid(np.arange(left, end), np.arange(top, bottom))
    samples = PointMap.of([np.stack([x.ravel(), y.ravel()]).astype(np.float32)]).sample(picture, alignment)
    return np.rint(samples).astype(np.uint8).reshape(x.shape)


def _on(picture: GreyPicture, points: Floats, own: Alignment) -> Mask:
    """(N,): which points lie on the panel picture, with a pixel to spare."""
    return _within(picture, own.places(np.ascontiguousarray(points.T[None], np.float32))[0])


def _within(picture: GreyPicture, places: Floats) -> Mask:
    """(N,): which places (N, 2) lie in a picture, with a pixel to spare."""
    x, y = places.T
    height, width = picture.shape
    on: Mask = (x >= 1) & (y >= 1) & (x <= width - 2) & (y <= height - 2)
    return on


def place_all(
    placers: Sequence[GaugePlacer | None], frame: GreyPicture, alignment: Alignment
) -> list[GaugePlace | None]:
    """Find all dials of a frame near where the anchors put them; None for those whose marks are not found there.

    A dial without a placer stays where the anchors put it: nothing on it could be told from what moves on it.
    """
    places = [
        GaugePlace(alignment, np.eye(3), (0.0, 0.0), 0.0) if placer is None else placer.place(frame, alignment)
        for placer in placers
    ]
    return shrink_to_consensus(placers, places)


def shrink_to_consensus(
    placers: Sequence[GaugePlacer | None], places: Sequence[GaugePlace | None]
) -> list[GaugePlace | None]:
    """Shrink each dial's place towards the consensus of the others, depending on how far these scatter.

    A short scale hardly determines its pivot. If the other dials lie where the anchors put them, or are all shifted
    alike, this one is likely shifted alike too; if they scatter, only its own marks count.
    """
    known = [
        (index, np.array(place.shift_px), 1.0 / (place.sigma_px**2 + SURE_PX**2))
        for index, (placer, place) in enumerate(zip(placers, places, strict=True))
        if placer is not None and place is not None
    ]
    held = list(places)
    for index, _, weight in known:
        placer, place = placers[index], places[index]
        others = [(shift, own) for at, shift, own in known if at != index]
        if placer is None or place is None or len(others) < Model.AFFINE // 2:
            continue
        shifts, weights = np.array([shift for shift, _ in others]), np.array([own for _, own in others])
        usual = weights @ shifts / weights.sum()
        apart_px2 = float(weights @ np.square(shifts - usual).sum(axis=1)) / 2 / float(weights.sum())
        part = apart_px2 / (apart_px2 + 1.0 / weight)
        held[index] = place.held(placer.centre, (float(usual[0]), float(usual[1])), part)
    return held
