"""The needle as a layer over the dial's face: what it adds, and how much of the face shows through.

Each pixel of the needle is a line `light + transparency * face`, fitted over the frames. On the needle the transparency
is 0, beside it 1, and in between at its blurred edges. Where the face behind a pixel never changes, the fit relies on
the transparency that the contrast suggests.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from decoder.imaging.sorting import MAD_TO_SIGMA, median_of
from decoder.imaging.thresholds import HALF
from decoder.matching.needle_template import NeedleTemplate
from decoder.matching.thresholds import (
    FADED_PART,
    MIN_CONTRAST_PART,
    MIN_HALF_PART,
    MIN_LIGHT_GAIN,
    OUTLIER_SPREADS,
    OUTLINE_PART,
)
from decoder.panel.arrays import Floats, Mask
from decoder.registration.thresholds import NOISE_LEVELS

PRIOR_SPREAD = 0.2
MAX_EDGE_ROWS = 6


def layered(cuts: Floats, faces: Floats, before: Floats, step_deg: float) -> NeedleTemplate:
    """Return the needle that best explains many cuts of it.

    Parameters
    ----------
    cuts
        (K, H, C) float32: the gauge around the needle in K frames, its axis in the middle row, in one light.
    faces
        (K, H, C) float32: the dial's face behind each cut.
    before
        (H, C): the needle as known before: its picture elsewhere on the dial.
    step_deg
        Degrees per row.
    """
    plain = median_of(faces.reshape(-1, faces.shape[2]))
    pixels = median_of(cuts).astype(np.float32)
    # A mark that is behind only one of the two is not part of the needle.
    expected = np.maximum(_expected_transparency(pixels, plain), _expected_transparency(before, plain))
    mean_cut, mean_face = cuts.mean(axis=0), faces.mean(axis=0)
    cut, face = cuts - mean_cut, faces - mean_face
    unexplained = np.abs(cut - _slopes(cut, face, face, expected) * face)
    spread = MAD_TO_SIGMA * median_of(unexplained)
    # once more, without outliers
    weights = (unexplained <= OUTLIER_SPREADS * np.maximum(spread, NOISE_LEVELS / 2)).astype(np.float32)
    total = np.maximum(weights.sum(axis=0), 1e-6)
    off_cut, off_face = (_summed(weights, own) / total for own in (cut, face))
    cut -= off_cut
    face -= off_face
    transparency = _slopes(cut, face, weights * face, expected)
    light = mean_cut + off_cut - transparency * (mean_face + off_face)
    spread = MAD_TO_SIGMA * median_of(np.abs(cut - transparency * face))
    shown = _columns_with_edges(expected)
    # Beside the needle there is nothing but the face, and a fit would only pick up noise.
    covered = _with_edges(expected)
    light = np.where(covered, light, np.float32(0.0))
    transparency = np.where(covered, transparency, np.float32(1.0))
    return NeedleTemplate(pixels, light, transparency, shown * _trust(spread), step_deg)


def without_others(layer: NeedleTemplate, others_rows: Sequence[float], plain: Floats) -> NeedleTemplate:
    """Return a first layer without the other needles beside it, assuming that its two halves are alike.

    Rows nearer to another needle's axis may be hidden by that needle: they are filled in from the other half, or with
    the plain dial where both halves are hidden, and are not trusted.

    Parameters
    ----------
    others_rows
        How many rows each other axis follows its own.
    plain
        (C,): the median of the dial at each radius.
    """
    rows = np.arange(layer.rows) - layer.rows // 2
    others = np.abs(rows - np.reshape(others_rows, (-1, 1)))
    hidden = (others < np.abs(rows)).any(axis=0)[:, None]
    pixels = np.where(hidden, np.where(hidden, plain, layer.pixels)[::-1], layer.pixels)
    alone = first_layer(pixels, plain, layer.step_deg)
    return NeedleTemplate(
        pixels, pixels, alone.transparency, np.where(hidden, np.float32(0.0), alone.trust), layer.step_deg
    )


def first_layer(pixels: Floats, plain: Floats, step_deg: float) -> NeedleTemplate:
    """Return a needle of which one picture is known, treating it all as light.

    Parameters
    ----------
    pixels
        (H, C) float32: the picture, the needle's axis in the middle row.
    plain
        (C,) float32: the median of the dial at each radius.
    step_deg
        Degrees per row.
    """
    transparency = _expected_transparency(pixels, plain)
    trust = np.broadcast_to(_columns_with_edges(transparency), pixels.shape).copy()
    return NeedleTemplate(pixels, pixels, transparency, trust, step_deg)


def cut_over(layer: NeedleTemplate, behind: Floats) -> NeedleTemplate:
    """Subtract from a first layer the dial's face that shines through it, (H, C) float32."""
    light = layer.pixels - layer.transparency * behind
    return NeedleTemplate(layer.pixels, light, layer.transparency, layer.trust, layer.step_deg)


def layer_over(pixels: Floats, behind: Floats, step_deg: float) -> NeedleTemplate:
    """Return a needle from one picture of it and of what lies behind it there, (H, C) float32 each."""
    transparency = _expected_transparency(pixels, behind)
    trust = np.broadcast_to(_columns_with_edges(transparency), pixels.shape).copy()
    light = (pixels - transparency * behind).astype(np.float32)
    return NeedleTemplate(pixels, light, transparency, trust, step_deg)


def in_local_light(cuts: Floats, template: NeedleTemplate, behind: Floats) -> Floats:
    """Bring cuts (K, H, C) into the light that the template expects there, since light falls unevenly on a dial."""
    flat = cuts.reshape(len(cuts), -1)
    weights = template.trust.ravel()
    total = weights.sum()
    expected = (template.light + template.transparency * behind).reshape(flat.shape)
    mean, expected_mean = ((image @ weights / total)[:, None] for image in (flat, expected))
    wanted = np.subtract(expected, expected_mean, out=expected)
    weighted = wanted * weights
    energy = np.einsum("kx,kx->k", weighted, wanted)[:, None]
    gain = np.einsum("kx,kx->k", flat - mean, weighted)[:, None] / np.maximum(energy, 1e-6)
    like: Floats = ((flat - mean) / np.maximum(gain, MIN_LIGHT_GAIN) + expected_mean).astype(np.float32)
    return like.reshape(cuts.shape)


def _slopes(cut: Floats, face: Floats, weighted: Floats, expected: Floats) -> Floats:
    """(H, C) float32: the transparency of each pixel by ridge regression of its cuts on its faces, (K, H, C) each.

    Both are relative to their means; `weighted` are the faces times their weights.
    """
    hold = NOISE_LEVELS**2 / PRIOR_SPREAD**2
    slopes = (_summed(weighted, cut) + hold * expected) / (_summed(weighted, face) + hold)
    within: Floats = np.clip(slopes, 0.0, 1.0).astype(np.float32)
    return within


def _summed(one: Floats, other: Floats) -> Floats:
    """(H, C): the sums of products over K views."""
    summed: Floats = np.einsum("khc,khc->hc", one, other)
    return summed


def _expected_transparency(pixels: Floats, plain: Floats) -> Floats:
    """(H, C): 1 where the needle's picture equals the plain dial, 0 where it has the full contrast of that half.

    The dial is given per pixel, or per column, (C,).
    """
    difference = np.abs(pixels - plain)
    axis = len(difference) // 2
    halves = [difference[: axis + 1].max(axis=0), difference[axis:].max(axis=0)]
    least = np.maximum(MIN_HALF_PART * np.maximum(*halves), NOISE_LEVELS)
    first, last = (np.maximum((1.0 - MIN_CONTRAST_PART) * half, least) for half in halves)
    contrast = np.where((np.arange(len(difference)) < axis)[:, None], first, last)
    expected: Floats = np.clip(1.0 - difference / contrast, 0.0, 1.0).astype(np.float32)
    return expected


def _with_edges(transparency: Floats) -> Mask:
    """(H, C): where a needle covers anything of the dial, including its blurred edges."""
    covered = transparency < 1.0 - OUTLINE_PART
    fading = transparency < 1.0 - FADED_PART
    for _ in range(MAX_EDGE_ROWS):
        grown = covered.copy()
        grown[1:] |= covered[:-1]
        grown[:-1] |= covered[1:]
        grown &= fading
        covered = grown
    return covered


def _columns_with_edges(transparency: Floats) -> Floats:
    """(C,): 1, but 0 where a needle fills the whole height of its template, and has no edge to be located by."""
    rows = max(1, len(transparency) // 10)
    first, last = transparency[:rows].mean(axis=0), transparency[-rows:].mean(axis=0)
    shown: Floats = ((first >= HALF) | (last >= HALF)).astype(np.float32)
    return shown if shown.any() else np.ones_like(shown)


def _trust(spread: Floats) -> Floats:
    trust: Floats = (NOISE_LEVELS**2 / (NOISE_LEVELS**2 + spread**2)).astype(np.float32)
    return trust
