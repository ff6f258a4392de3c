"""Faces: what an unwrapped dial shows where no needle is, learned from many frames with the needles in different places."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from decoder.needle_template import NeedleTemplate
from decoder.unwrapping import rows_at

Floats = NDArray[np.float32]

MIN_VIEWS = 3
LIGHT_STRIDE = 3
LIGHT_PASSES = 2
OUTLIER_LEVELS = 20.0
MIN_GAIN = 0.2


def in_light_of(reference: Floats, strip: Floats) -> Floats | None:
    """An unwrapped gauge brought to the light of a reference picture of the same gauge; None if they have nothing in common.

    Gain and offset by least squares over every third pixel, without the pixels where needles or glares make them differ.
    """
    wanted, seen = reference.ravel()[::LIGHT_STRIDE], strip.ravel()[::LIGHT_STRIDE]
    gain, offset = 1.0, float(np.median(wanted - seen))
    for _ in range(LIGHT_PASSES):
        near = np.abs(seen * gain + offset - wanted) < OUTLIER_LEVELS
        x, y = seen[near], wanted[near]
        spread = float(x.var()) if x.size else 0.0
        if spread < 1.0:
            return None
        gain = float(((x - x.mean()) * (y - y.mean())).mean()) / spread
        offset = float(y.mean()) - gain * float(x.mean())
    return None if gain < MIN_GAIN or gain > 1 / MIN_GAIN else strip * np.float32(gain) + np.float32(offset)


def learn_face(strips: Sequence[Floats], without: Sequence[NDArray[np.bool_]]) -> Floats:
    """The dial's face: the median of each pixel over the frames in which no needle lies on it.

    Parameters
    ----------
    strips
        (R, C) each, in one light.
    without
        (R, C) each: where a needle lies.

    Returns
    -------
    (R, C) float32
        Pixels that fewer than three frames showed without a needle take their column's median.
    """
    views = np.stack(strips)
    views[np.stack(without)] = np.inf
    views.sort(axis=0)
    count = np.isfinite(views).sum(axis=0)
    middle = np.maximum(count - 1, 0)
    low = np.take_along_axis(views, middle[None] // 2, axis=0)[0]
    high = np.take_along_axis(views, (middle[None] + 1) // 2, axis=0)[0]
    known = count >= MIN_VIEWS
    face = np.where(known, (low + high) / 2, np.nan).astype(np.float32)
    return _filled(face, known)


def needle_place(shape: tuple[int, int], touched: NDArray[np.bool_], axis_row: float) -> NDArray[np.bool_]:
    """(R, C): all pixels that a needle with its axis on a row touches; `touched` (H, C) says which of its template those are."""
    place = np.zeros(shape, bool)
    rows = len(touched)
    top = axis_row - (rows - 1) / 2
    for start in {math.floor(top), math.ceil(top)}:
        first, last = max(start, 0), min(start + rows, shape[0])
        if first < last:
            place[first:last] |= touched[first - start : last - start]
    return place


def with_needle(face: Floats, template: NeedleTemplate, axis_row: float) -> Floats:
    """A face (R, C) with a needle drawn over it, its axis on a fractional row."""
    drawn = face.copy()
    axis = (template.rows - 1) / 2
    first, last = max(math.ceil(axis_row - axis), 0), min(math.floor(axis_row + axis) + 1, len(face))
    if first < last:
        rows = np.arange(first, last) - axis_row + axis
        drawn[first:last] = rows_at(template.light, rows) + rows_at(template.transparency, rows) * face[first:last]
    return drawn


def _filled(face: Floats, known: NDArray[np.bool_]) -> Floats:
    if known.all():
        return face
    overall = float(np.median(face[known])) if known.any() else 0.0
    for column in np.flatnonzero(~known.all(axis=0)):
        there = known[:, column]
        face[~there, column] = np.median(face[there, column]) if there.any() else overall
    return face
