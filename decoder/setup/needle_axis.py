"""Where a needle's axis lies in one unwrapped picture of it, whatever its bevel and its light.

A needle's two halves are often lit differently, so the middle of its light is not its axis: on the rendered flights it
lies 0.3 degrees beside it. Its outline is symmetric, though. Each column is taken for a left half of one tone and a
right half of another, equally wide, blurred by the lens; the one axis that explains all columns best is the needle's.
On those flights it is right to 0.03 degrees.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from decoder.arrays import Floats
from decoder.unwrapping import PolarGrid

REACH_DEG = 7.0
AXIS_STEP_DEG = 0.1
AXIS_REACH_DEG = 1.2
BLURS_PX = (0.5, 0.65, 0.8, 0.95, 1.2)
HALF_WIDTHS_PX = np.concatenate([np.arange(0.4, 4.0, 0.2), np.arange(4.0, 16.0, 0.8)])
MIN_CONTRAST_LEVELS = 25.0
NOISE_LEVELS = 2.0
# A guess at the end of the range is moved on this often.
ROUNDS = 3
# A large dial has more columns than it takes; they are seen one by one, so some of them do.
MIN_COLUMNS, MOST_COLUMNS = 5, 20
MIN_TAPER_PX, OUTLIER_SPREADS = 0.25, 3.0


def axis_deg(light: Floats, grid: PolarGrid, guess_deg: float) -> float:
    """The angle of the needle's axis.

    Parameters
    ----------
    light
        (R, C): what the needle adds to the dial's face, on `grid`; bright or dark.
    guess_deg
        An angle on the needle, to about a degree.
    """
    light, radii = light[:, grid.tail_columns :], grid.radii_px[grid.tail_columns :]
    for _ in range(ROUNDS):
        middle = round((guess_deg - grid.start_deg) / grid.step_deg)
        reach = round(REACH_DEG / grid.step_deg)
        rows = np.arange(max(middle - reach, 0), min(middle + reach + 1, len(light)))
        used = np.flatnonzero(np.abs(light[rows]).max(axis=0) >= MIN_CONTRAST_LEVELS) if rows.size else rows
        if not used.size:
            return guess_deg
        used = used[np.unique(np.linspace(0, used.size - 1, MOST_COLUMNS).round().astype(int))]
        seen = _Seen(light[rows][:, used], grid.start_deg + rows * grid.step_deg, radii[used])
        place, found = _lowest(seen, guess_deg)
        if found:
            return place
        guess_deg = place
    return guess_deg


@dataclass(frozen=True, slots=True)
class _Seen:
    """The light of some columns, (R, C), at angles (R,) and radii (C,)."""

    light: Floats
    angles_deg: Floats
    radii_px: Floats


def _lowest(seen: _Seen, guess_deg: float) -> tuple[float, bool]:
    """The place that explains the columns best, and whether it lies within the range that was searched."""
    places = np.arange(-AXIS_REACH_DEG, AXIS_REACH_DEG + AXIS_STEP_DEG / 2, AXIS_STEP_DEG) + guess_deg
    left = [_unexplained(seen, places, blur) for blur in BLURS_PX]  # (C, places, widths) each
    curves = [np.log(each.min(axis=2)) for each in left]
    sharpest = min(range(len(curves)), key=lambda index: float(curves[index].sum(axis=0).min()))
    best = int(curves[sharpest].sum(axis=0).argmin())
    plain = _tapering(HALF_WIDTHS_PX[left[sharpest][:, best].argmin(axis=1)], seen.radii_px)
    curve = curves[sharpest][plain].sum(axis=0)
    best = int(curve.argmin())
    if not 0 < best < len(curve) - 1:
        return float(places[best]), False
    before, at, after = (float(value) for value in curve[best - 1 : best + 2])
    bend = before - 2 * at + after
    part = 0.5 * (before - after) / bend if bend > 0 else 0.0
    return float(places[best]) + part * AXIS_STEP_DEG, True


def _tapering(half_widths_px: Floats, radii_px: Floats) -> NDArray[np.bool_]:
    """(C,): the columns in which the needle is about as wide as between its neighbours.

    Where it runs into a numeral or a mark it looks wider, and to one side. The line is that of Theil and Sen.
    """
    one, other = np.triu_indices(len(radii_px), 1)
    if len(radii_px) < MIN_COLUMNS:
        return np.ones(len(radii_px), bool)
    slope = np.median((half_widths_px[other] - half_widths_px[one]) / (radii_px[other] - radii_px[one]))
    off = half_widths_px - slope * radii_px
    off = np.abs(off - np.median(off))
    plain: NDArray[np.bool_] = off <= max(MIN_TAPER_PX, OUTLIER_SPREADS * float(np.median(off)))
    return plain


def _unexplained(seen: _Seen, places: Floats, blur_px: float) -> Floats:
    """(C, places, widths): what two tones to either side of each place leave of each column, at each width.

    Each column has a noise of its own: one that shows something else besides the needle has little to say.
    """
    left = np.empty((len(seen.radii_px), len(places), len(HALF_WIDTHS_PX)))
    halves = HALF_WIDTHS_PX[None, :, None] / blur_px
    for number, radius_px in enumerate(seen.radii_px):
        light = seen.light[:, number].astype(np.float64)
        off = (seen.angles_deg[None, :] - places[:, None]) * math.radians(1.0) * radius_px / blur_px
        middle = _step(off)[:, None, :]
        one = _step(off[:, None, :] + halves) - middle
        other = middle - _step(off[:, None, :] - halves)
        aa, bb, ab = (one * one).sum(-1), (other * other).sum(-1), (one * other).sum(-1)
        ay, by = one @ light, other @ light
        explained = (bb * ay * ay - 2 * ab * ay * by + aa * by * by) / np.maximum(aa * bb - ab * ab, 1e-9)
        left[number] = np.maximum(float(light @ light) - explained, 0.0) + NOISE_LEVELS**2 * len(light)
    return left


_TABLE_REACH, _TABLE_STEPS = 6.0, 12000
_TABLE = np.array(
    [0.5 * (1 + math.erf(x / math.sqrt(2))) for x in np.linspace(-_TABLE_REACH, _TABLE_REACH, _TABLE_STEPS + 1)],
    np.float32,
)


def _step(x: Floats) -> Floats:
    """A blurred step from 0 to 1, from a table: erf itself would take seconds."""
    place = (np.clip(x, -_TABLE_REACH, _TABLE_REACH) + _TABLE_REACH) * (_TABLE_STEPS / (2 * _TABLE_REACH))
    steps: Floats = _TABLE[np.rint(place).astype(np.intp)]
    return steps
