"""The panel picture rectified, as if the camera had looked at the panel square on (thesis, orthogonalization)."""

from __future__ import annotations

import math
from dataclasses import dataclass

import cv2
import numpy as np

from decoder.imaging.camera_pose import Matrix, Pose
from decoder.imaging.pictures import GreyPicture
from decoder.panel.errors import CalibrationError
from decoder.panel.lens import Lens
from flight_file.thresholds import MAX_PIXELS

LARGEST_GROWTH = 4.0  # of the picture's sides; the far end of a very oblique picture would grow without bound


@dataclass(frozen=True, slots=True, eq=False)
class Square:
    """Where a rectified picture's pixels come from.

    Attributes
    ----------
    to_inches
        (3, 3) from (x, y, 1) of the rectified picture to inches on the panel, as written.
    size_px
        Its width and height.
    """

    to_inches: Matrix
    size_px: tuple[int, int]


def square_of(pose: Pose, lens: Lens, points_inches: Matrix) -> Square:
    """Plan a rectified picture, as fine as the picture is at the centre of the reference points.

    Parameters
    ----------
    points_inches : (N, 2) or (N, 3), the reference points
    """
    to_pixels = pose.homography(lens)
    width, height = lens.size_px
    edge = np.array([[0, 0], [width - 1, 0], [width - 1, height - 1], [0, height - 1]], np.float64)
    straight = lens.undistorted(edge.T)
    seen = np.linalg.inv(to_pixels) @ np.vstack([straight, np.ones(4)])
    front = seen[2] * np.linalg.det(to_pixels) * (-1 if pose.y_up else 1)
    middle = np.asarray(points_inches, np.float64)[:, :2].mean(axis=0)
    per_inch = _pixels_per_inch(to_pixels, middle)
    reach = np.array([[width, height]]) * LARGEST_GROWTH / 2 / per_inch
    inches = np.where(front > 0, seen[:2] / seen[2], np.nan).T
    if not np.isfinite(inches).all():
        raise CalibrationError("the picture looks past the panel's horizon; it is too oblique to be squared up")
    low = np.maximum(inches.min(axis=0), middle - reach[0])
    high = np.minimum(inches.max(axis=0), middle + reach[0])
    per_inch = min(per_inch, math.sqrt(MAX_PIXELS) / float((high - low).max()))
    size = np.ceil((high - low) * per_inch).astype(int)
    flip = -1.0 if pose.y_up else 1.0
    top = high[1] if pose.y_up else low[1]
    to_inches = np.array([[1 / per_inch, 0, low[0]], [0, flip / per_inch, top], [0, 0, 1]])
    return Square(to_inches, (int(size[0]), int(size[1])))


def squared_up(picture: GreyPicture, pose: Pose, lens: Lens, square: Square) -> GreyPicture:
    """(H, W) uint8: the picture as seen square on, in one resampling; black where it shows nothing."""
    width, height = square.size_px
    x, y = np.meshgrid(np.arange(width, dtype=np.float64), np.arange(height, dtype=np.float64))
    seen = pose.homography(lens) @ square.to_inches @ np.stack([x.ravel(), y.ravel(), np.ones(x.size)])
    pixels = lens.distorted(seen[:2] / seen[2]).astype(np.float32)
    return np.asarray(
        cv2.remap(picture, pixels[0].reshape(x.shape), pixels[1].reshape(x.shape), cv2.INTER_CUBIC), np.uint8
    )


def off_axes_deg(points: Matrix, first: int, second: int) -> float:
    """Measure the angle of a line between two of (N, 2) points to the nearer axis, -45 to 45 degrees."""
    across, down = points[second] - points[first]
    angle = float(np.degrees(np.arctan2(down, across)))
    return (angle + 45) % 90 - 45


def _pixels_per_inch(to_pixels: Matrix, at_inches: Matrix) -> float:
    """Return the picture's resolution at a place, in the direction in which it is best."""
    x, y, w = to_pixels @ [*at_inches, 1.0]
    slopes = (to_pixels[:2, :2] - np.outer([x / w, y / w], to_pixels[2, :2])) / w
    return float(np.linalg.svd(slopes, compute_uv=False)[0])
