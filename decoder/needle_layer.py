"""The needle as a layer over the dial's face: what it adds, and how much of the face shows through.

Each pixel of the needle is a line `light + transparency * face`, fitted over the frames. On the needle the
transparency is 0, beside it 1, at its blurred edges in between; where the face never changes behind a pixel the fit
leans on what the contrast suggests.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from decoder.arrays import Floats
from decoder.needle_template import NeedleTemplate
from decoder.unwrapping import rows_at

# Spread of a pixel over the frames that is plain sensor and JPEG noise, grey levels.
NOISE_LEVELS = 4.0
PRIOR_SPREAD = 0.2
# A needle's darker half is no less opaque than its lighter one.
OPAQUE_PART = 0.8
OUTLIER_SPREADS = 3.5
MAD_TO_SIGMA = 1.4826
MIN_GAIN = 0.2
MIN_COVER = 0.05
MIN_CLEAR_EDGE = 0.5


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
        spread = MAD_TO_SIGMA * median_of(np.abs(unexplained))
        weights = (np.abs(unexplained) <= OUTLIER_SPREADS * np.maximum(spread, NOISE_LEVELS / 2)).astype(np.float32)
    pixels = median_of(cuts).astype(np.float32)
    clutter = MAD_TO_SIGMA * median_of(np.abs(cuts - pixels))
    shown = _columns_with_edges(expected)
    learned = NeedleTemplate(
        pixels, shown * _trust(clutter), light, transparency, shown * _trust(spread), prior.step_deg
    )
    return beside_transparent(learned)


def beside_transparent(template: NeedleTemplate) -> NeedleTemplate:
    """The template with nothing but the face beside the needle, where a fit can only pick up accidents."""
    touched = template.touched
    light = np.where(touched, template.light, 0.0).astype(np.float32)
    return replace(template, light=light, transparency=np.where(touched, template.transparency, 1.0).astype(np.float32))


def first_layer(pixels: Floats, behind: Floats, plain: Floats, step_deg: float) -> NeedleTemplate:
    """A needle of which one picture is known.

    Parameters
    ----------
    pixels
        (H, C) float32: the picture, the needle's axis in the middle row.
    behind
        (H, C) float32: the dial's face there, as far as it is known.
    plain
        (C,) float32: what the dial mostly shows at each radius.
    step_deg
        Degrees from row to row.
    """
    transparency = _expected_transparency(pixels, np.broadcast_to(plain, pixels.shape))
    trust = np.broadcast_to(_columns_with_edges(transparency), pixels.shape).copy()
    return NeedleTemplate(pixels, trust, pixels - transparency * behind, transparency, trust, step_deg)


def layer_over(pixels: Floats, behind: Floats, step_deg: float) -> NeedleTemplate:
    """A needle of which one picture is known, and what lies behind it there; (H, C) float32 each."""
    transparency = _expected_transparency(pixels, behind)
    trust = np.broadcast_to(_columns_with_edges(transparency), pixels.shape).copy()
    light = (pixels - transparency * behind).astype(np.float32)
    return NeedleTemplate(pixels, trust, light, transparency, trust, step_deg)


def shown_below(upper: NeedleTemplate, lower: NeedleTemplate, lower_row: float) -> tuple[Floats, Floats]:
    """How much of each pixel a needle shows beside one that lies over it, and the light that adds.

    Where the edges of two needles run along each other, coverage does not multiply: on the far side of the lower
    needle's axis the upper's edge lies within the lower's body, so what shows of the lower is the difference of both
    coverages; on the near side they lie side by side, and both show as long as there is room.

    Parameters
    ----------
    upper
        (H, C), its axis in the window's middle row.
    lower
        (H', C).
    lower_row
        Fractional row of the lower needle's axis in the window.

    Returns
    -------
    (H, C) in [0, 1], and (H, C) in grey levels
    """
    rows = np.arange(upper.rows) - lower_row + (lower.rows - 1) / 2
    inside = ((rows >= 0) & (rows <= lower.rows - 1))[:, None]
    layers = rows_at(np.concatenate([lower.light, lower.transparency], axis=1), rows)
    light_there, transparency = layers[:, : layers.shape[1] // 2], layers[:, layers.shape[1] // 2 :]
    cover = (1.0 - transparency) * inside
    far = ((np.arange(upper.rows) - lower_row) * np.sign(lower_row - (upper.rows - 1) / 2) >= 0)[:, None]
    nested = np.maximum(cover - (1.0 - upper.transparency), 0.0)
    shown = np.where(far, nested, np.minimum(cover, upper.transparency)).astype(np.float32)
    light: Floats = (light_there / np.maximum(cover, MIN_COVER) * shown).astype(np.float32)
    return shown, light


def through_upper(upper: NeedleTemplate, lower: NeedleTemplate, lower_row: float) -> tuple[Floats, Floats]:
    """What lies behind an upper needle when a lower needle lies on the face: `light + part * face`, (H, C) each.

    The rest as for `shown_below`.
    """
    shown, light = shown_below(upper, lower, lower_row)
    through = upper.transparency > MIN_COVER
    transparency = np.maximum(upper.transparency, MIN_COVER)
    part = np.where(through, np.maximum(upper.transparency - shown, 0.0) / transparency, 1.0)
    return np.where(through, light / transparency, 0.0).astype(np.float32), part.astype(np.float32)


def in_local_light(cuts: Floats, template: NeedleTemplate, behind: Floats) -> Floats:
    """Cuts brought to the light of what the template expects there; (K, H, C). Light falls unevenly on a dial."""
    expected = template.light + template.transparency * behind
    weights, inner = template.trust, (1, 2)
    total = weights.sum()
    seen = cuts - ((weights * cuts).sum(axis=inner, keepdims=True) / total)
    expected_mean = (weights * expected).sum(axis=inner, keepdims=True) / total
    wanted = weights * (expected - expected_mean)
    energy = (wanted * (expected - expected_mean)).sum(axis=inner, keepdims=True)
    gain = (seen * wanted).sum(axis=inner, keepdims=True) / np.maximum(energy, 1e-6)
    like: Floats = (seen / np.maximum(gain, MIN_GAIN) + expected_mean).astype(np.float32)
    return like


def median_of(views: Floats) -> Floats:
    """The median of each pixel over K views, (K, H, C): as `np.median` along the first axis, at a third of its cost."""
    values = np.sort(views.reshape(len(views), -1).T.copy(), axis=1)
    low, high = values[:, (len(views) - 1) // 2], values[:, len(views) // 2]
    median: Floats = ((low + high) / 2).reshape(views.shape[1:])
    return median


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
    """1 where the needle's picture is like the plain dial, 0 where it has its contrast but for some shading."""
    difference = np.abs(pixels - plain)
    contrast = np.maximum(difference.max(axis=0), NOISE_LEVELS)
    expected: Floats = np.clip(1.0 - difference / (OPAQUE_PART * contrast), 0.0, 1.0).astype(np.float32)
    return expected


def _columns_with_edges(transparency: Floats) -> Floats:
    """(C,): 1, but 0 where a needle fills the whole of its template: there it has no edge to be found by."""
    rows = max(1, len(transparency) // 10)
    first, last = transparency[:rows].mean(axis=0), transparency[-rows:].mean(axis=0)
    shown: Floats = ((first >= MIN_CLEAR_EDGE) | (last >= MIN_CLEAR_EDGE)).astype(np.float32)
    return shown if shown.any() else np.ones_like(shown)


def _trust(spread: Floats) -> Floats:
    trust: Floats = (NOISE_LEVELS**2 / (NOISE_LEVELS**2 + spread**2)).astype(np.float32)
    return trust
