"""Pixels per radian in the centre of the field, from marks on a ruler at a known distance.

A ruler that is not quite square on is farther away at one end, so that its marks lie at (a + b s) / (1 + c s) along its
picture. At the foot of the optical axis b is the pixels per inch there, and c gives the ruler's tilt.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from decoder.calibration.profile import Array, Line
from decoder.calibration.thresholds import MIN_TICKS
from decoder.imaging.sorting import MAD_TO_SIGMA
from decoder.imaging.thresholds import HAND_PART
from decoder.panel.errors import CalibrationError

MARKED_PX = 0.3
"""The uncertainty of a mark that was set by hand."""


@dataclass(frozen=True, slots=True, eq=False)
class Marks:
    """Marks of a ruler in one picture.

    Attributes
    ----------
    points_px
        (N, 2) where they are in the picture.
    inches
        (N,) where they are on the ruler.
    """

    points_px: Array
    inches: Array


@dataclass(frozen=True, slots=True)
class RulerFit:
    """What a ruler tells of the lens.

    Attributes
    ----------
    pixels_per_radian, sigma
        In the centre of the field, corrected for tilt; its standard uncertainty from the marks alone.
    small_angle
        The thesis's: the marks' distance in pixels over their distance in inches times the distance to the ruler.
    arctangent
        The mean over the ruler: the marks' distance in pixels over the exact angle they subtend. A lens that keeps
        straight lines straight has more pixels per radian off its axis, so this is the larger one.
    tilt_deg
        By how much the ruler was off square.
    rms_px
        The root mean square residual of the marks.
    marks
        How many.
    """

    pixels_per_radian: float
    sigma: float
    small_angle: float
    arctangent: float
    tilt_deg: float
    rms_px: float
    marks: int


def fit_ruler(marks: Marks, *, distance_inches: float, size_px: tuple[int, int]) -> RulerFit:
    """Fit pixels per radian to marks of a ruler through the middle of the picture.

    Raises
    ------
    CalibrationError
        If the ruler misses the middle of the picture, or the marks do not fit a ruler.
    """
    order = np.argsort(marks.inches)
    points, inches = marks.points_px[order], marks.inches[order] - marks.inches.min()
    line = _line_through(points)
    refuse_off_centre(line, size_px)
    middle, beside = line.foot(((size_px[0] - 1) / 2, (size_px[1] - 1) / 2))
    along = (points - line.start_px) @ line.direction - middle
    unknowns, covariance, rms = _projective(inches, along)
    value = _at_the_axis(unknowns, distance_inches, beside)
    slopes = np.array([
        (_at_the_axis(unknowns + step, distance_inches, beside) - value) / np.abs(step).sum()
        for step in np.diag(1e-6 * np.maximum(np.abs(unknowns), 1e-3))[: len(covariance)]
    ])  # fmt: skip
    foot = -unknowns[0] / unknowns[1]
    angles = np.arctan((inches[[0, -1]] - foot) / distance_inches)
    length_px = float(np.linalg.norm(points[-1] - points[0]))
    return RulerFit(
        pixels_per_radian=value,
        sigma=float(np.sqrt(slopes @ covariance @ slopes)),
        small_angle=length_px / float(inches[-1] / distance_inches),
        arctangent=length_px / float(angles[1] - angles[0]),
        tilt_deg=float(np.degrees(np.arcsin(np.clip(_tilt(unknowns, distance_inches), -1, 1)))),
        rms_px=rms,
        marks=len(points),
    )


def _line_through(points: Array) -> Line:
    middle = points.mean(axis=0)
    direction = np.linalg.svd(points - middle)[2][0]
    direction = direction * np.sign(direction @ (points[-1] - points[0]))
    ends = [middle + direction * ((point - middle) @ direction) for point in (points[0], points[-1])]
    return Line((float(ends[0][0]), float(ends[0][1])), (float(ends[1][0]), float(ends[1][1])))


def refuse_off_centre(line: Line, size_px: tuple[int, int]) -> None:
    """Raise CalibrationError if a line along the ruler misses the middle of the picture."""
    width, height = size_px
    along, beside = line.foot(((width - 1) / 2, (height - 1) / 2))
    if abs(beside) > HAND_PART * height:
        raise CalibrationError(
            f"the ruler misses the middle of the picture by {abs(beside):.0f} pixels; let it run through the middle"
        )
    if not -HAND_PART * width < along < line.length_px + HAND_PART * width:
        raise CalibrationError("the marks lie all on one side of the picture's middle; measure across it")


def _projective(inches: Array, along: Array) -> tuple[Array, Array, float]:
    """(3,) a, b, c; the covariance of the fitted ones; rms. Outlying marks have little weight (Huber)."""
    free = 3 if len(inches) >= MIN_TICKS else 2
    unknowns = np.array([*np.polynomial.polynomial.polyfit(inches, along, 1), 0.0])
    weight = np.ones_like(along)
    for _ in range(20):
        below = 1 + unknowns[2] * inches
        model = (unknowns[0] + unknowns[1] * inches) / below
        miss = along - model
        rows = np.stack([1 / below, inches / below, -model * inches / below], axis=1)[:, :free]
        spread = max(MAD_TO_SIGMA * float(np.median(np.abs(miss))), 1e-6)
        if len(inches) > free + 1:
            weight = np.minimum(1.0, 2 * spread / np.maximum(np.abs(miss), 1e-12))
        change = np.linalg.lstsq(rows * np.sqrt(weight)[:, None], miss * np.sqrt(weight), rcond=None)[0]
        unknowns[:free] += change
    rms = float(np.sqrt(np.sum(weight * miss**2) / np.sum(weight)))
    freedom = np.sum(weight) - free
    variance = float(np.sum(weight * miss**2) / freedom) if freedom >= 1 else MARKED_PX**2
    return unknowns, np.linalg.inv((rows.T * weight) @ rows) * variance, rms


def _tilt(unknowns: Array, distance_inches: float) -> float:
    """Compute the sine of the angle between the ruler and the picture's plane."""
    a, b, c = unknowns
    return float(c / (1 - c * a / b) * distance_inches)


def _at_the_axis(unknowns: Array, distance_inches: float, beside: float) -> float:
    """Pixels per radian at the foot of the optical axis on the ruler's picture."""
    a, b, c = unknowns
    per_inch = b / (1 - c * a / b)
    flat = per_inch * distance_inches
    tilt = _tilt(unknowns, distance_inches)
    return float(flat / np.sqrt(max(1 - tilt**2 * (1 + (beside / flat) ** 2), 1e-6)))
