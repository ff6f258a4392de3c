"""Faces: what an unwrapped dial shows where no needle is, learned from frames with the needles in many places."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence

import numpy as np

from decoder.imaging.sorting import median, median_of, middle_views
from decoder.imaging.unwrapping import PolarGrid, row_of_angle
from decoder.matching.strips import rows_at
from decoder.matching.thresholds import FACE_NOISE_LEVELS, MIN_LIGHT_GAIN, MIN_VIEWS, OUTLIER_SPREADS
from decoder.panel.arrays import Floats, Indices, Mask
from decoder.registration.thresholds import NOISE_LEVELS

LIGHT_STRIDE = 3
LIGHT_PASSES = 2
MIDDLE_GREY = 128.0


LitViews = Sequence[Sequence[Floats | None]]
"""By gauge and frame the unwrapped gauge in the panel picture's light; None where it cannot be had."""


def in_light_of(reference: Floats, strips: Iterable[Floats]) -> list[Floats | None]:
    """Bring unwrapped gauges into the light of a reference; None for those too dim, or too bright, to learn from.

    The gain is the ratio of contrasts, and the offset follows from the means. Both are taken over every third pixel,
    without those where needles or glare make a gauge differ from the reference. A regression would treat differences as
    noise, and so mistake a card that has turned, or a dial out of focus, for one in dimmer light. The brighter half of
    the gauges is never too dim, unless it is black.
    """
    wanted = _thinned(reference)
    strips = list(strips)
    seen = [_thinned(strip) for strip in strips]
    contrasts = np.array([each.std() for each in seen])
    usable = min(MIN_LIGHT_GAIN * float(wanted.std()), float(np.median(contrasts))) if strips else 0.0
    least = max(usable, OUTLIER_SPREADS * FACE_NOISE_LEVELS)
    return [
        _lit(wanted, thinned, strip) if contrast >= least else None
        for thinned, strip, contrast in zip(seen, strips, contrasts.tolist(), strict=True)
    ]


def _thinned(strip: Floats) -> Floats:
    """(N,): a subset of a gauge's pixels, relative to middle grey to keep sums small enough for float32."""
    thinned: Floats = strip.ravel()[::LIGHT_STRIDE] - np.float32(MIDDLE_GREY)
    return thinned


def _lit(wanted: Floats, seen: Floats, strip: Floats) -> Floats | None:
    """Bring one gauge into the light of a reference, given the thinned pixels of both; its own are not flat."""
    starts = [(1.0, float(median(wanted - seen))), _equal_contrast(wanted, seen), _usual_ratio(wanted, seen)]
    gain, offset = _fit(wanted, seen, *max(starts, key=lambda start: _near(wanted, seen, *start)))
    if gain < MIN_LIGHT_GAIN:
        return None
    lit: Floats = strip * np.float32(gain)
    lit += np.float32(offset + MIDDLE_GREY * (1.0 - gain))
    return lit


def _equal_contrast(wanted: Floats, seen: Floats) -> tuple[float, float]:
    """Return the gain and offset of equal mean and contrast: right wherever a card has turned, but not under glare."""
    gain = float(wanted.std() / seen.std())
    return gain, float(wanted.mean()) - gain * float(seen.mean())


def _usual_ratio(wanted: Floats, seen: Floats) -> tuple[float, float]:
    """Return the gain and offset of most marks: right under glare, but not where a card has turned."""
    own, usual = float(median(seen)), float(median(wanted))
    is_mark = np.abs(wanted - usual) > wanted.std()
    ratio = float(np.median((seen[is_mark] - own) / (wanted[is_mark] - usual))) if is_mark.any() else 1.0
    gain = 1.0 / ratio if ratio > 0.0 else 1.0
    return gain, usual - gain * own


def _fit(wanted: Floats, seen: Floats, gain: float, offset: float) -> tuple[float, float]:
    """Return the gain and offset of equal mean and contrast of the pixels that a first gain and offset bring near."""
    for _ in range(LIGHT_PASSES):
        is_near = _is_near(wanted, seen, gain, offset)
        near = is_near.astype(np.float32)
        # separate dot products: for so few rows a matrix product takes three times as long
        count, sum_x, sum_y = max(int(np.count_nonzero(is_near)), 1), float(seen @ near), float(wanted @ near)
        own, usual = (
            float((each * near) @ each) - total**2 / count for each, total in ((seen, sum_x), (wanted, sum_y))
        )
        if min(own, usual) < count:
            break
        gain = math.sqrt(usual / own)
        offset = (sum_y - gain * sum_x) / count
    return gain, offset


def _near(wanted: Floats, seen: Floats, gain: float, offset: float) -> int:
    """Count, in a subset of pixels, those near the reference's at their own place or, for a turned card, anywhere."""
    some = wanted[::LIGHT_STRIDE], seen[::LIGHT_STRIDE]
    return max(
        int(np.count_nonzero(_is_near(*pair, gain, offset))) for pair in (some, (np.sort(some[0]), np.sort(some[1])))
    )


def _is_near(wanted: Floats, seen: Floats, gain: float, offset: float) -> Mask:
    """Whether each pixel differs by no more than a needle's edge from the reference's."""
    near: Mask = np.abs(seen * np.float32(gain) + np.float32(offset) - wanted) < 5 * NOISE_LEVELS
    return near


def learn_face(strips: Sequence[Floats], without: Sequence[Indices], fallback: Floats) -> Floats:
    """Return the dial's face: the median of each pixel over the frames in which no needle covers it.

    Parameters
    ----------
    strips
        (R, C) each, in one light.
    without
        For each, the flat indices of the pixels that a needle covers; they may repeat.
    fallback
        (R, C): used where fewer than two frames show a pixel without a needle, or only two, and these differ.

    Returns
    -------
    (R, C) float32
    """
    views = np.stack(strips)
    count = np.full(fallback.size, len(views), np.uint16)
    # Covered pixels become -inf and +inf in turn, so that the visible ones stay around the middle.
    far = np.full(fallback.size, -np.inf, np.float32)
    for view, covered in zip(views.reshape(len(views), -1), without, strict=True):
        view[covered] = far[covered]
        far[covered] *= -1
        count[covered] -= 1
    low, high = middle_views(views)
    counts = count.reshape(fallback.shape)
    alone = low if len(views) % 2 else high  # the middle of an odd number of values
    with np.errstate(invalid="ignore"):  # where no value is left
        middle = np.where(counts & 1, alone, (low + high) / 2)
    seen = (counts >= MIN_VIEWS) | ((counts == MIN_VIEWS - 1) & (high <= low + 2 * NOISE_LEVELS))
    face: Floats = np.where(seen, middle, fallback).astype(np.float32)
    return face


def bare_face(strip: Floats, place: Mask) -> Floats:
    """Return a dial's face from one picture (R, C): where needles cover it, the median of the rest of the column."""
    columns = np.where(place, np.inf, strip).T.copy()
    columns.sort(axis=1)
    count = len(place) - place.sum(axis=0)
    middle, every = np.maximum(count - 1, 0), np.arange(len(columns))
    low, high = columns[every, middle // 2], columns[every, (middle + 1) // 2]
    plain = (low + high) / 2 if count.all() else np.where(count > 0, (low + high) / 2, np.median(strip))
    face: Floats = np.where(place, plain, strip).astype(np.float32)
    return face


def face_behind(face: Floats, grid: PolarGrid, at_deg: float | None, rows: int) -> Floats:
    """(rows, C): the face where a needle's template was cut; for a cropped picture, the median of the dial."""
    if at_deg is None:
        return np.broadcast_to(median_of(face), (rows, face.shape[1])).astype(np.float32)
    return rows_at(face, row_of_angle(grid, at_deg) + np.arange(rows) - (rows - 1) / 2)
