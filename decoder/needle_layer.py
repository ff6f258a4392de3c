"""The needle as a layer over the dial's face: what it adds, and how much of the face shows through.

Each pixel of the needle is a line `light + transparency * face`, fitted over the frames. On the needle the transparency is 0, beside
it 1, at its blurred edges in between; where the face never changes behind a pixel the fit leans on what the contrast suggests.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from decoder.needle_template import NeedleTemplate

Floats = NDArray[np.float32]

# Spread of a pixel over the frames that is plain sensor and JPEG noise, grey levels.
NOISE_LEVELS = 4.0
PRIOR_SPREAD = 0.2
OUTLIER_SPREADS = 3.5
MAD_TO_SIGMA = 1.4826
MIN_GAIN = 0.2


def layered(cuts: Floats, faces: Floats, prior: NeedleTemplate) -> NeedleTemplate:
    """The needle that best explains many cuts of it.

    Parameters
    ----------
    cuts
        (K, H, C) float32: the gauge around the needle in K frames, its axis in the middle row, in one light.
    faces
        (K, H, C) float32: the dial's face behind each cut.
    prior
        (H, C): what was thought of the needle before.
    """
    plain = np.broadcast_to(np.median(faces, axis=(0, 1)), prior.pixels.shape)
    expected = _expected_transparency(prior.pixels, plain)
    weights = np.ones_like(cuts)
    for _ in range(2):
        light, transparency = _lines(cuts, faces, weights, expected)
        unexplained = cuts - (light + transparency * faces)
        spread = MAD_TO_SIGMA * np.median(np.abs(unexplained), axis=0)
        weights = (np.abs(unexplained) <= OUTLIER_SPREADS * np.maximum(spread, NOISE_LEVELS / 2)).astype(np.float32)
    pixels = np.median(cuts, axis=0).astype(np.float32)
    clutter = MAD_TO_SIGMA * np.median(np.abs(cuts - pixels), axis=0)
    return NeedleTemplate(pixels, _trust(clutter), light, transparency, _trust(spread), prior.step_deg)


def in_local_light(cut: Floats, template: NeedleTemplate, behind: Floats) -> Floats:
    """A cut brought to the light of what the template expects there; all (H, C). Light falls unevenly on a dial."""
    expected = template.light + template.transparency * behind
    weights = template.trust
    total = float(weights.sum())
    seen_mean, expected_mean = float((weights * cut).sum()) / total, float((weights * expected).sum()) / total
    seen, wanted = cut - seen_mean, expected - expected_mean
    gain = float((weights * seen * wanted).sum()) / max(float((weights * wanted * wanted).sum()), 1e-6)
    like: Floats = (seen / max(gain, MIN_GAIN) + expected_mean).astype(np.float32)
    return like


def _lines(cuts: Floats, faces: Floats, weights: Floats, expected: Floats) -> tuple[Floats, Floats]:
    """Weighted ridge regression of each pixel's cuts on its faces: light and transparency, (H, C) each."""
    total = np.maximum(weights.sum(axis=0), 1e-6)
    mean_face, mean_cut = (weights * faces).sum(axis=0) / total, (weights * cuts).sum(axis=0) / total
    face = faces - mean_face
    hold = NOISE_LEVELS**2 / PRIOR_SPREAD**2
    slope = ((weights * face * (cuts - mean_cut)).sum(axis=0) + hold * expected) / (
        (weights * face * face).sum(axis=0) + hold
    )
    transparency = np.clip(slope, 0.0, 1.0).astype(np.float32)
    return (mean_cut - transparency * mean_face).astype(np.float32), transparency


def _expected_transparency(pixels: Floats, plain: Floats) -> Floats:
    """1 where the needle's picture is like the plain dial, 0 where it has its full contrast."""
    difference = np.abs(pixels - plain)
    contrast = np.maximum(difference.max(axis=0), NOISE_LEVELS)
    expected: Floats = (1.0 - difference / contrast).astype(np.float32)
    return expected


def _trust(spread: Floats) -> Floats:
    trust: Floats = (NOISE_LEVELS**2 / (NOISE_LEVELS**2 + spread**2)).astype(np.float32)
    return trust
