"""Correlation of a needle that lies over a known face: NCC with what the face explains taken out.

Over a face F the needle shows as `n = light + (transparency - 1) F` on top of it. The score is the partial
correlation of the gauge with n, given F and a constant: the NCC of gauge and needle after both have lost what the
face can explain. On a plain dial it is the thesis's NCC; over marks and numerals it does not suffer from them, and
where only the face is to be seen it is about 0.

All sums slide along the rows, see `decoder.correlation`; arrays over rows are by the row on which the template starts.
"""

from __future__ import annotations

from dataclasses import dataclass, fields

import numpy as np

from decoder.arrays import Floats
from decoder.correlation import MIN_SPREAD_LEVELS, sliding_sums, sliding_sums_of
from decoder.needle_template import NeedleTemplate

# A face with less spread than this explains nothing but noise.
FACE_NOISE_LEVELS = 1.0


@dataclass(frozen=True, slots=True)
class FaceMoments:
    """Weighted moments of face and needle under the template, each (R - H + 1,): all that a frame does not change."""

    kernels: Floats
    """(3, H, C): the weights, and by them the needle's light and how it covers the face."""
    total: Floats
    face_mean: Floats
    face_variance: Floats
    needle_mean: Floats
    needle_per_face: Floats
    """How much of the needle goes along with the face."""
    needle_left: Floats
    """The needle's variance that the face does not explain."""

    def part(self, rows: slice) -> FaceMoments:
        """The moments of some of the rows."""
        own = {field.name: getattr(self, field.name) for field in fields(self)}
        return FaceMoments(**{name: array if name == "kernels" else array[rows] for name, array in own.items()})

    @property
    def needle_contrast(self) -> Floats:
        """The needle's variance that the face does not explain, times the weights it was seen with."""
        contrast: Floats = self.needle_left * self.total
        return contrast


def face_moments(face: Floats, template: NeedleTemplate, mask: Floats | None = None) -> FaceMoments:
    """The moments for a face (R, C), of the pixels that `mask` (R, C) leaves."""
    weights, light, cover = template.trust, template.light, template.transparency - 1
    by_light, by_cover = weights * light, weights * cover
    alone = np.stack([weights, by_light, by_light * light])
    with_face = np.stack([weights, by_light, by_cover, by_light * cover])
    with_square = np.stack([weights, by_cover, by_cover * cover])
    face_seen = face if mask is None else face * mask
    # Where all pixels are seen, what no face enters is the same on every row.
    seen_sums = alone.sum(axis=(1, 2))[:, None] if mask is None else sliding_sums_of(mask, alone)
    face_one, face_light, face_cover, face_both = sliding_sums_of(face_seen, with_face)
    square_one, square_cover, square_both = sliding_sums_of(face * face_seen, with_square)
    total = np.maximum(np.broadcast_to(seen_sums[0], face_one.shape), np.float32(1e-6))
    face_mean = face_one / total
    needle_mean = (seen_sums[1] + face_cover) / total
    needle_face = (face_light + square_cover) / total
    needle_square = (seen_sums[2] + 2 * face_both + square_both) / total
    face_variance = np.maximum(square_one / total - face_mean**2, 0.0) + FACE_NOISE_LEVELS**2
    needle_per_face = (needle_face - needle_mean * face_mean) / face_variance
    needle_variance = np.maximum(needle_square - needle_mean**2, 0.0)
    return FaceMoments(
        kernels=np.stack([weights, by_light, by_cover]),
        total=total,
        face_mean=face_mean,
        face_variance=face_variance,
        needle_mean=needle_mean,
        needle_per_face=needle_per_face,
        needle_left=np.maximum(needle_variance - needle_per_face**2 * face_variance, 0.0),
    )


def partial_normxcorr(gauge: Floats, face: Floats, moments: FaceMoments, mask: Floats | None = None) -> Floats:
    """The partial correlation of a gauge with a needle, given the face.

    Parameters
    ----------
    gauge, face : (R, C) float32
    moments
        Of this face, a template and this mask.
    mask : (R, C) float32
        0 where pixels are left out.

    Returns
    -------
    (R - H + 1,) float32, in [-1, 1]
        0 where face and gauge, or face and needle, leave nothing to correlate.
    """
    weights = moments.kernels[0]
    seen = gauge if mask is None else gauge * mask
    mean, with_light = sliding_sums_of(seen, moments.kernels[:2]) / moments.total
    with_face, with_cover = sliding_sums_of(seen * face, moments.kernels[::2]) / moments.total
    variance = sliding_sums(seen * gauge, weights) / moments.total - mean * mean
    with_face = with_face - mean * moments.face_mean
    with_needle = with_light + with_cover - mean * moments.needle_mean
    left = np.maximum(variance - with_face**2 / moments.face_variance, 0.0)
    shared = with_needle - with_face * moments.needle_per_face
    usable = (left > MIN_SPREAD_LEVELS**2) & (moments.needle_left > MIN_SPREAD_LEVELS**2)
    spread = np.sqrt(left * moments.needle_left)
    scores: Floats = np.divide(shared, spread, out=np.zeros_like(spread), where=usable)
    return np.minimum(np.maximum(scores, -1.0), 1.0)
