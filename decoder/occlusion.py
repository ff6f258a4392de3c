"""Occlusion: reading a needle that another one covers in part or wholly (thesis 3.2.3).

The cascade is the thesis's: the whole needle, else its top edge, else its bottom edge (in the unwrapped gauge, where
rows grow clockwise), else hidden. An edge is matched without the pixels that the covering needle, whose place is
known, lies on: what is left of the template must match what is left of the gauge. So the covering needle's own edges
are never taken for the covered one's.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from decoder.correlation import MIN_SPREAD_LEVELS, sliding_sums
from decoder.needle_template import NeedleTemplate

Floats = NDArray[np.float32]

WHOLE_VISIBLE = 0.97
# With less of its contrast in sight than this, a template matches too many things.
MIN_VISIBLE = 0.15


@dataclass(frozen=True, slots=True)
class Visibility:
    """NCC of a template's uncovered pixels, and how much of its contrast they hold; both (R,) by row of its axis."""

    scores: Floats
    visible: Floats


def covered_mask(rows: int, template: NeedleTemplate, axis_row: float, *, margin_rows: int) -> Floats:
    """(R, C) float32: 0 where a needle with its axis on `axis_row` lies, with a margin around it, 1 elsewhere."""
    outline = template.outline
    height, columns = outline.shape
    mask = np.ones((rows, columns), np.float32)
    top = round(axis_row) - (height - 1) // 2
    for shift in range(-margin_rows, margin_rows + 1):
        first, last = max(top + shift, 0), min(top + shift + height, rows)
        if first < last:
            mask[first:last][outline[first - top - shift : last - top - shift]] = 0.0
    return mask


def uncovered_scores(gauge: Floats, mask: Floats, template: NeedleTemplate) -> Visibility:
    """NCC along the rows with the pixels alone that `mask` leaves.

    Parameters
    ----------
    gauge, mask : (R, C) float32
    template
        (H, C), H <= R.

    Returns
    -------
    Visibility
        Both arrays (R,), 0 for rows too near an end.
    """
    weights, pixels = template.weights, template.pixels - template.pixels.mean()
    seen = (gauge - gauge.mean()) * mask
    total = np.maximum(sliding_sums(mask, weights), 1e-6)
    image_mean = sliding_sums(seen, weights) / total
    image_variance = sliding_sums(seen * seen, weights) / total - image_mean**2
    template_mean = sliding_sums(mask, weights * pixels) / total
    template_variance = np.maximum(sliding_sums(mask, weights * pixels * pixels) / total - template_mean**2, 0.0)
    covariance = sliding_sums(seen, weights * pixels) / total - image_mean * template_mean
    spread = np.sqrt(np.maximum(image_variance, 0.0) * template_variance)
    scores = np.divide(covariance, spread, out=np.zeros_like(spread), where=spread > MIN_SPREAD_LEVELS**2)
    whole = _variance(pixels, weights)
    visible = template_variance * total / max(whole * float(weights.sum()), 1e-6)
    return Visibility(
        _padded(np.clip(scores, -1, 1), gauge, template), _padded(np.minimum(visible, 1), gauge, template)
    )


def _variance(pixels: Floats, weights: Floats) -> float:
    total = float(weights.sum())
    mean = float((weights * pixels).sum()) / total
    return float((weights * pixels * pixels).sum()) / total - mean * mean


def _padded(inner: Floats, gauge: Floats, template: NeedleTemplate) -> Floats:
    padded = np.zeros(gauge.shape[0], np.float32)
    axis = (template.rows - 1) // 2
    padded[axis : axis + len(inner)] = inner
    return padded
