"""Correlation of an unwrapped gauge with a needle template, along its rows.

`xcorr` is plain cross-correlation, `normxcorr` the normalized one (thesis eq. 1.3 and 1.4, after Lewis 1995), here
with a weight for each pixel of the template: equal weights give the thesis's NCC. The template spans all columns, so
the search is in angle only. A window or a template without variance scores 0, never 1 and never NaN.
"""

from __future__ import annotations

import math

import numpy as np

from decoder.arrays import Floats

# Below a fifth of a grey level of spread there is nothing but rounding to correlate with.
MIN_SPREAD_LEVELS = 0.2


def sliding_sums(image: Floats, kernel: Floats) -> Floats:
    """Sum of `image[i + j, c] * kernel[j, c]` over j and c, for every i.

    Parameters
    ----------
    image : (R, C) float32
    kernel : (H <= R, C) float32

    Returns
    -------
    (R - H + 1,) float32
    """
    products = image @ kernel.T  # one matrix product; the sums that are wanted lie on its diagonals
    row, column = products.strides
    shape = (image.shape[0] - kernel.shape[0] + 1, kernel.shape[0])
    diagonals: Floats = np.ndarray(shape, products.dtype, products, strides=(row, row + column))
    sums: Floats = np.add.reduce(diagonals, axis=1)
    return sums


def sliding_sums_of(image: Floats, kernels: Floats) -> Floats:
    """`sliding_sums` of one image with K kernels, (K, H, C), at once: (K, R - H + 1)."""
    count, height, width = kernels.shape
    products = image @ kernels.reshape(count * height, width).T
    row, column = products.strides
    shape = (image.shape[0] - height + 1, count, height)
    strides = (row, height * column, row + column)
    diagonals: Floats = np.ndarray(shape, products.dtype, products, strides=strides)
    sums: Floats = np.add.reduce(diagonals, axis=2).T
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
    covariance = sliding_sums(image, weights * centred)
    mean = sliding_sums(image, weights) / total
    variance = np.maximum(sliding_sums(image * image, weights) / total - mean * mean, 0.0)
    spread = np.sqrt(variance)
    scores = np.divide(
        covariance / np.sqrt(energy * total), spread, out=np.zeros_like(spread), where=spread > MIN_SPREAD_LEVELS
    )
    clipped: Floats = np.clip(scores, -1.0, 1.0)
    return clipped


def xcorr(image: Floats, template: Floats) -> Floats:
    """Plain cross-correlation along the rows: (R - H + 1,) float32, in grey levels squared."""
    return sliding_sums(image, template)


def parabola_peak(scores: Floats, index: int) -> float:
    """The fractional index of the peak at `index`, by the parabola through it and its two neighbours.

    At either end, or beside a row that was ruled out, the index itself.
    """
    if not 0 < index < len(scores) - 1:
        return float(index)
    before, here, after = scores[index - 1 : index + 2].tolist()
    bend = before - 2 * here + after
    return index + 0.5 * (before - after) / bend if math.isfinite(bend) and bend < 0 else float(index)
