"""Pixels per radian over focal length: the quadratic of thesis 3.1.2, with its residuals and covariance."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from decoder.calibration.profile import Array
from decoder.calibration.thresholds import MIN_PHOTOGRAPHS
from decoder.panel.errors import CalibrationError


@dataclass(frozen=True, slots=True, eq=False)
class FocalFit:
    """c0 + c1 f + c2 f^2, f in mm.

    Attributes
    ----------
    coefficients, covariance
        (3,) and (3, 3).
    residuals
        (N,) measured minus fitted pixels per radian, one for each photograph.
    """

    coefficients: Array
    covariance: Array
    residuals: Array


def fit_focal(focal_lengths_mm: Array, pixels_per_radian: Array, sigmas: Array, *, scale_sigma: float) -> FocalFit:
    """Fit a quadratic to (N,) measurements.

    Parameters
    ----------
    focal_lengths_mm, pixels_per_radian, sigmas : (N,)
    scale_sigma : the relative uncertainty that they all share, that of the distance to the ruler

    Raises
    ------
    CalibrationError
        If there are fewer than three focal lengths.
    """
    zooms = len(set(np.round(focal_lengths_mm, 3).tolist()))
    if zooms < MIN_PHOTOGRAPHS:
        count = "one zoom" if zooms == 1 else f"{zooms} zooms"
        raise CalibrationError(
            f"a quadratic needs photographs at three zooms or more, here {'is' if zooms == 1 else 'are'} {count};"
            " photograph the ruler at others too"
        )
    unit = float(focal_lengths_mm.max())
    powers = np.vander(focal_lengths_mm / unit, 3, increasing=True)
    weights = 1 / np.maximum(sigmas, 1e-5 * pixels_per_radian)
    solved = np.linalg.lstsq(powers * weights[:, None], pixels_per_radian * weights, rcond=None)[0]
    residuals = pixels_per_radian - powers @ solved
    freedom = len(residuals) - powers.shape[1]
    excess = float(np.sum((residuals * weights) ** 2) / freedom) if freedom > 0 else 1.0  # lenses are not quadratic
    covariance = np.linalg.inv((powers * weights[:, None]).T @ (powers * weights[:, None])) * max(1.0, excess)
    covariance += scale_sigma**2 * np.outer(solved, solved)
    units = unit ** -np.arange(powers.shape[1], dtype=float)
    return FocalFit(solved * units, covariance * np.outer(units, units), residuals)
