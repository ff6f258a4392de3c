"""Faces: what an unwrapped dial shows where no needle is, learned from frames with the needles in many places."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

import numpy as np

from decoder.imaging.sorting import median, median_of, middle_views
from decoder.imaging.unwrapping import PolarGrid, row_of_angle
from decoder.matching.strips import rows_at
from decoder.matching.thresholds import MIN_LIGHT_GAIN, MIN_VIEWS
from decoder.panel.arrays import Floats, Indices, Mask
from decoder.registration.thresholds import NOISE_LEVELS

LIGHT_STRIDE = 3
LIGHT_PASSES = 2
MIDDLE_GREY = 128.0


LitViews = Sequence[Sequence[Floats | None]]
"""By gauge and frame the unwrapped gauge in the panel picture's light; None where it cannot be had."""


def in_light_of(reference: Floats, strips: Iterable[Floats]) -> list[Floats | None]:
    """Bring unwrapped gauges into the light of a reference picture; None for those that have nothing in common with it.

    Gain and offset are fitted by least squares over every third pixel, without pixels where needles or glare make them
    differ.
    """
    wanted = _thinned(reference)
    return [_lit(wanted, strip) for strip in strips]


def _thinned(strip: Floats) -> Floats:
    """(N,): a subset of a gauge's pixels, relative to middle grey to keep sums small enough for float32."""
    thinned: Floats = strip.ravel()[::LIGHT_STRIDE] - np.float32(MIDDLE_GREY)
    return thinned


def _lit(wanted: Floats, strip: Floats) -> Floats | None:
    """Bring one gauge into the light of a reference's thinned pixels."""
    seen = _thinned(strip)
    off = wanted - seen
    gain, offset = 1.0, float(median(off))
    off -= np.float32(offset)
    for step in range(LIGHT_PASSES):
        if step:
            np.multiply(seen, np.float32(gain), out=off)
            off += np.float32(offset)
            off -= wanted
        is_near = np.abs(off, out=off) < 5 * NOISE_LEVELS
        near = is_near.astype(np.float32)
        here = seen * near
        # separate dot products: for so few rows a matrix product takes three times as long
        count, sum_x, sum_y = np.count_nonzero(is_near), float(seen @ near), float(wanted @ near)
        spread = float(here @ seen) / count - (sum_x / count) ** 2 if count else 0.0
        if spread < 1.0:
            return None
        gain = (float(here @ wanted) / count - sum_x * sum_y / count**2) / spread
        offset = (sum_y - gain * sum_x) / count
    if gain < MIN_LIGHT_GAIN or gain > 1 / MIN_LIGHT_GAIN:
        return None
    lit: Floats = strip * np.float32(gain)
    lit += np.float32(offset + MIDDLE_GREY * (1.0 - gain))
    return lit


def learn_face(strips: Sequence[Floats], without: Sequence[Indices], fallback: Floats) -> Floats:
    """Return the dial's face: the median of each pixel over the frames in which no needle covers it.

    Parameters
    ----------
    strips
        (R, C) each, in one light.
    without
        For each, the flat indices of the pixels that a needle covers; they may repeat.
    fallback
        (R, C): used where fewer than three frames show a pixel without a needle, or only two that differ.

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
