"""Correlation of unwrapped gauges with a needle template along their rows: plain, normalized, and over a face.

`xcorr` is plain cross-correlation, `normxcorr` the normalized one (thesis eq. 1.3 and 1.4, after Lewis 1995), here
with a weight for each pixel of the template: equal weights give the thesis's NCC. The template spans all columns, so
the search is in angle only. A window or a template without variance scores 0, never 1 and never NaN.

Over a face F, the needle adds `n = light + (transparency - 1) F`. The score is the partial correlation of the gauge
with n given F and a constant: the NCC of gauge and needle after removing from both what the face explains. On a plain
dial it equals the thesis's NCC; marks and numerals do not disturb it, and where only the face is visible it is about 0.

All sums slide along the rows; results are indexed by the row on which the template starts.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from decoder.imaging.sorting import MAD_TO_SIGMA, median, median_of
from decoder.imaging.thresholds import HALF
from decoder.matching.needle_template import NeedleTemplate
from decoder.matching.thresholds import FACE_NOISE_LEVELS, MAX_CONDITION, OUTLIER_SPREADS
from decoder.panel.arrays import Floats, Mask, limited
from decoder.registration.thresholds import MIN_SPREAD_LEVELS, NOISE_LEVELS

Spectrum = NDArray[np.complexfloating[Any, Any]]

EVERY = 4  # pixels; this subset gives the median as well
ROUNDING = np.finfo(np.float32).eps  # keeps a division by a total weight of zero finite


def sliding_sums(images: Floats, kernels: Floats) -> Floats:
    """Sum `images[..., i + j, c] * kernels[k, j, c]` over j and c, for every k and i.

    Parameters
    ----------
    images : (..., R, C) float32
    kernels : (K, H <= R, C) float32

    Returns
    -------
    (K, ..., R - H + 1) float32
    """
    count, height, width = kernels.shape
    products = images @ kernels.reshape(count * height, width).T  # the wanted sums lie on its diagonals
    *outer, row, column = products.strides
    shape = (count, *images.shape[:-2], images.shape[-2] - height + 1, height)
    strides = (height * column, *outer, row, row + column)
    diagonals: Floats = np.ndarray(shape, products.dtype, products, strides=strides)
    sums: Floats = np.add.reduce(diagonals, axis=-1)
    return sums


def normxcorr(image: Floats, template: Floats, weights: Floats) -> Floats:
    """Weighted normalized cross-correlation along the rows.

    Parameters
    ----------
    image : (R, C) float32
        Unwrapped gauge.
    template : (H <= R, C) float32
    weights : (H, C) float32, >= 0
        How much each pixel of the template counts.

    Returns
    -------
    (R - H + 1,) float32, in [-1, 1]
        Score of the template with its first row on row i.
    """
    total = float(weights.sum())
    centred = template - float((weights * template).sum()) / total if total > 0 else template
    energy = float((weights * centred * centred).sum())
    if total <= 0 or energy <= total * MIN_SPREAD_LEVELS**2:
        return np.zeros(image.shape[0] - template.shape[0] + 1, np.float32)
    image = image - image.mean()  # keeps the sums of squares small enough for float32
    covariance, mean = sliding_sums(image, np.stack([weights * centred, weights]))
    mean = mean / total
    variance = np.maximum(sliding_sums(image * image, weights[None])[0] / total - mean * mean, 0.0)
    spread = np.sqrt(variance)
    scores = np.divide(
        covariance / np.sqrt(energy * total), spread, out=np.zeros_like(spread), where=spread > MIN_SPREAD_LEVELS
    )
    return limited(scores, -1.0, 1.0)


def xcorr(images: Floats, template: Floats) -> Floats:
    """Plain cross-correlation along the rows of images (..., R, C): (..., R - H + 1), in grey levels squared."""
    sums: Floats = sliding_sums(images, template[None])[0]
    return sums


@dataclass(frozen=True, slots=True)
class FaceMoments:
    """Weighted moments of face and needle under a template, arrays of one shape: all that is independent of the gauge.

    Attributes
    ----------
    total
        The total weight of the pixels.
    face_mean, face_variance, needle_mean
        Weighted, per unit of weight.
    needle_per_face
        The regression coefficient of the needle on the face.
    needle_left
        The needle's variance that the face does not explain.
    """

    total: Floats
    face_mean: Floats
    face_variance: Floats
    needle_mean: Floats
    needle_per_face: Floats
    needle_left: Floats

    @classmethod
    def of_means(cls, total: Floats, means: tuple[Floats, Floats, Floats, Floats, Floats]) -> FaceMoments:
        """Compute them from the means of the face, its square, the needle, needle times face, and needle squared."""
        face, face_square, needle, needle_face, needle_square = means
        face_variance = np.maximum(face_square - face**2, 0.0) + FACE_NOISE_LEVELS**2
        per_face = (needle_face - needle * face) / face_variance
        left = np.maximum(needle_square - needle**2, 0.0) - per_face**2 * face_variance
        return cls(total, face, face_variance, needle, per_face, np.maximum(left, 0.0))

    @property
    def needle_contrast(self) -> Floats:
        """The needle's variance that the face does not explain, times the total weight."""
        contrast: Floats = self.needle_left * self.total
        return contrast


def partial_ncc(known: FaceMoments, mean: Floats, square: Floats, with_face: Floats, with_needle: Floats) -> Floats:
    """Return the partial correlation of gauge and needle, given the face.

    Parameters
    ----------
    known
        Of face and needle.
    mean, square, with_face, with_needle
        The means of the gauge, of its square, and of its products with the face and the needle: arrays of one shape.

    Returns
    -------
    In [-1, 1]; 0 where face and gauge, or face and needle, leave nothing to correlate.
    """
    of_face = with_face - mean * known.face_mean
    left = square - mean * mean - of_face * of_face / known.face_variance
    shared = with_needle - mean * known.needle_mean - of_face * known.needle_per_face
    usable = (left > MIN_SPREAD_LEVELS**2) & (known.needle_left > MIN_SPREAD_LEVELS**2)
    spread = np.sqrt(np.where(usable, left * known.needle_left, 1.0))
    return limited(np.where(usable, shared / spread, np.zeros_like(shared)), -1.0, 1.0)


def face_moments(faces: Floats, template: NeedleTemplate, masks: Floats | None = None) -> FaceMoments:
    """Return the moments of a template on each row of faces, over the pixels that the masks keep.

    Parameters
    ----------
    faces : (..., R, C) float32
    masks : (..., R, C) float32
        0 where pixels are left out.

    Returns
    -------
    (..., R - H + 1) each
    """
    one, light, cover = template.trust, template.light, template.transparency - 1
    none = np.zeros_like(one)
    kernels: list[list[Floats]] = [
        [one, none, none],
        [none, one, none],
        [none, none, one],
        [one * light, one * cover, none],
        [none, one * light, one * cover],
        [one * light**2, 2 * one * light * cover, one * cover**2],
    ]
    seen = np.ones_like(faces) if masks is None else masks
    sums = _sums_over(kernels, seen, seen * faces, seen * faces * faces)
    total = np.maximum(sums[0], ROUNDING)
    face, face_square, needle, needle_face, needle_square = (each / total for each in sums[1:])
    return FaceMoments.of_means(total, (face, face_square, needle, needle_face, needle_square))


def partial_normxcorr(
    gauges: Floats,
    faces: Floats,
    template: NeedleTemplate,
    masks: Floats | None = None,
    moments: FaceMoments | None = None,
) -> tuple[Floats, FaceMoments]:
    """Return the partial correlation of gauges with a needle, given their faces, and the moments used.

    Parameters
    ----------
    gauges, faces : (..., R, C) float32
    masks : (..., R, C) float32
        0 where pixels are left out.
    moments
        Of faces and masks, if already known.

    Returns
    -------
    (..., R - H + 1) float32, in [-1, 1]
    """
    one, light, cover = template.trust, template.light, template.transparency - 1
    none = np.zeros_like(one)
    kernels: list[list[Floats]] = [
        [one, none, none],
        [none, none, one],
        [none, one, none],
        [one * light, one * cover, none],
    ]
    known = moments or face_moments(faces, template, masks)
    seen = gauges if masks is None else masks * gauges
    mean, square, with_face, with_needle = _sums_over(kernels, seen, seen * faces, seen * gauges) / known.total
    return partial_ncc(known, mean, square, with_face, with_needle), known


def _sums_over(kernels: list[list[Floats]], *images: Floats) -> Floats:
    """Slide several kernels, each of one part per image, along the images side by side."""
    blocks = np.stack([np.concatenate(parts, axis=1) for parts in kernels]).astype(np.float32)
    return sliding_sums(np.concatenate(images, axis=-1), blocks)


def products(left: Floats, right: Floats) -> Floats:
    """(..., K, L): the inner products of a few long rows (..., K, N) with a few others (..., L, N).

    None of them depends on how many rows there are, and each is summed more exactly than in a matrix product.
    """
    inner: Floats = np.vecdot(left[..., :, None, :], right[..., None, :, :])
    return inner


def is_singular(normals: Floats) -> Mask:
    """(...): whether symmetric matrices (..., K, K) have no inverse in double precision."""
    spread = np.linalg.eigvalsh(normals)
    singular: Mask = ~(spread[..., 0] * MAX_CONDITION > spread[..., -1])
    return singular


def explained(left: Floats, weights: Floats) -> Floats:
    """Return 1 where residuals (P, C) are no larger than usual for pixels with weight, else 0."""
    off = np.abs(left)
    some, known = off.ravel()[::EVERY], weights.ravel()[::EVERY]
    some = some[known > 0]
    spread = MAD_TO_SIGMA * float(median(some)) if some.size else 0.0
    return (off <= OUTLIER_SPREADS * max(spread, NOISE_LEVELS)).astype(np.float32)


def shared_weights(apart: Floats, contrast: float) -> Floats:
    """Weigh pixels by how little frames differ there in what they are to share, float32.

    Shadows and reflections make frames differ everywhere. So weights drop only where frames differ by more than they
    usually do, or by more than half of the contrast: frames that share nothing differ by about that.

    Parameters
    ----------
    apart
        Any shape: the usual difference between frames.
    contrast
        Standard deviation of what they share.
    """
    usual = max(NOISE_LEVELS, min(float(np.median(apart)), HALF * contrast))
    weights: Floats = (usual**2 / (usual**2 + np.maximum(apart - usual, 0.0) ** 2)).astype(np.float32)
    return weights


def noise_between(pictures: Floats) -> float:
    """Return the noise between pictures of a dial (F, P, C) in grey levels; most of the dial must not change."""
    apart = pictures - median_of(pictures)
    return float(np.clip(MAD_TO_SIGMA * median(np.abs(apart).ravel()), FACE_NOISE_LEVELS, NOISE_LEVELS))


def changing(pictures: Floats, noise_levels: float) -> Floats:
    """(P, C): from 0 where pictures (F, P, C) are all alike to 1 where they differ by far more than noise."""
    apart = np.maximum(pictures.std(axis=0) - noise_levels, 0.0) ** 2
    parts: Floats = apart / (noise_levels**2 + apart)
    return parts


def turned_correlation(pictures: Floats, noise_levels: float, *, is_mutual: bool = True) -> Floats:
    """Correlate each of F pictures of a dial (F, P, C), turned by each number of rows, with each other picture.

    Only places that change between the pictures have weight, in both, since nothing else can turn. So fixed marks, a
    face without print, and regular marks that have turned onto each other do not count. The noise is added to the
    variances, so a picture that hardly changes matches nothing. It is added in full however few changing places overlap
    after the turn: a turn with next to no overlap matches nothing either.
    Unless it `is_mutual`, each picture is only matched with those after it; the other scores are 0.

    Returns
    -------
    (F, F, P) float32, in [-1, 1]
        For the first picture, the second, and the rows by which the first is turned clockwise.
    """
    rows, weights = pictures.shape[1], changing(pictures, noise_levels)
    total = max(float(weights.sum()), float(ROUNDING))
    levels = pictures - np.float32((weights * pictures.mean(axis=0)).sum() / total)  # small squares suit float32
    weighted = weights * levels
    moved, sums, squares = (np.fft.rfft(each, axis=-2) for each in (weights, weighted, weighted * levels))

    def along(spectra: Spectrum, others: Spectrum) -> Floats:
        turned: Floats = np.fft.irfft(np.vecdot(spectra, others), rows)
        return turned

    area = np.maximum(along(moved, moved), ROUNDING * rows)
    means, next_means = along(sums, moved) / area, along(moved, sums) / area
    noise = noise_levels**2 * area[0] / area  # no turn overlaps more than none at all
    spreads = np.sqrt(np.maximum(along(squares, moved) / area - means**2, 0.0) + noise)
    next_spreads = np.sqrt(np.maximum(along(moved, squares) / area - next_means**2, 0.0) + noise)
    scores = np.zeros((len(pictures), len(pictures), rows), np.float32)
    for one, spectrum in enumerate(sums):
        others = slice(0 if is_mutual else one + 1, None)
        shared = along(spectrum, sums[others]) / area - means[one] * next_means[others]
        scores[one, others] = shared / (spreads[one] * next_spreads[others])
    return limited(scores, -1.0, 1.0)


def weighted_correlation(seen: Floats, left: Floats, weights: Floats) -> float:
    """Return the NCC of pixels (P, C) with their fit, from the residuals `left`."""
    flat, levels = weights.ravel(), seen.ravel()
    variance = float(flat @ (levels - (flat @ levels) / flat.sum()) ** 2)
    return math.sqrt(max(1.0 - float(flat @ left.ravel() ** 2) / variance, 0.0)) if variance > 0 else 0.0
