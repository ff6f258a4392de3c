"""Dial points: where a dial is looked at to be found by its own marks, and what it looks like without its needles."""

from __future__ import annotations

import cv2
import numpy as np

from decoder.arrays import Floats, Mask
from decoder.dial_plane import DialPlane
from decoder.gauge import Gauge
from decoder.pictures import GreyPicture

# Around a dial its rim and its case hold it in place, too; around a tiny one, what is beside it.
REACH = 1.25
BESIDE_PX = 20.0
# What is under the panel picture's needles is filled in from so far around.
FILLED_FROM_PX = 3.0
# A needle's template is this much wider than the needle at least.
BESIDE_SWEEP_DEG = 6.0
POINTS_ACROSS = 48


def dial_points(gauge: Gauge, plane: DialPlane | None) -> Floats:
    """(2, N) float32: a grid of points on the dial and around it, without those under the panel picture's needles."""
    inner, outer = gauge.radius[0], max(gauge.radius[1] * REACH, gauge.radius[1] + BESIDE_PX)
    stride = max(1.0, 2 * outer / POINTS_ACROSS)
    steps = np.arange(-outer, outer + stride, stride)
    across, down = (grid.ravel() for grid in np.meshgrid(steps, steps))
    radius, angle = np.hypot(across, down), np.degrees(np.arctan2(down, across))
    start, end = gauge.sweep
    within = (angle - (start - BESIDE_SWEEP_DEG)) % 360.0 <= end - start + 2 * BESIDE_SWEEP_DEG
    keep = (radius >= inner) & (radius <= outer) & within & ~_under_needles(across, down, gauge)
    points = np.stack([across[keep], down[keep]])
    if plane is not None:
        return plane.to_panel(points).astype(np.float32)
    around: Floats = (points + np.array(gauge.centre)[:, None]).astype(np.float32)
    return around


def without_needles(
    patch: GreyPicture, gauge: Gauge, plane: DialPlane | None, box: tuple[int, int, int, int]
) -> GreyPicture:
    """A dial's picture with what is around its needles instead of them, or a frame's needle is taken for them.

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
    covered = _under_needles(across, down, gauge).reshape(patch.shape)
    return np.asarray(cv2.inpaint(patch, covered.astype(np.uint8), FILLED_FROM_PX, cv2.INPAINT_TELEA), np.uint8)


def _around_pivot(points: Floats, gauge: Gauge, plane: DialPlane | None) -> Floats:
    """(2, N): points of the panel picture from the pivot, on the dial seen square on."""
    if plane is None:
        from_pivot: Floats = points - np.array(gauge.centre)[:, None]
        return from_pivot
    there = np.linalg.inv(plane.matrix) @ np.vstack([points, np.ones(points.shape[1])])
    square_on: Floats = there[:2] / there[2]
    return square_on


def _under_needles(across: Floats, down: Floats, gauge: Gauge) -> Mask:
    """(N,): which points from the pivot lie where the panel picture shows a needle."""
    angle = np.degrees(np.arctan2(down, across))
    under = np.zeros(angle.shape, bool)
    for needle in gauge.needles:
        template = needle.template
        if template.at is not None and template.span is not None and template.picture is None:
            under |= np.abs((angle - template.at + 180.0) % 360.0 - 180.0) <= template.span / 2
    return under
