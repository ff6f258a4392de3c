"""The search for needles that others cover in part, in many frames at once: as `occlusion` and `over_face` have it.

Only rows near the covering needle are searched, every third of them, with the pixels that this needle leaves.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, fields

import numpy as np

from decoder.arrays import Floats, Indices, Mask, limited
from decoder.correlation import MIN_SPREAD_LEVELS
from decoder.fitting import MAX_FRACTION_ROWS
from decoder.gauge_reader import SCORE_THRESHOLD
from decoder.matching import MAX_PEAK_ROWS, MAX_STEPS
from decoder.needle_template import NeedleTemplate
from decoder.occlusion import MIN_VISIBLE
from decoder.over_face import FACE_NOISE_LEVELS, face_moments
from decoder.quick_fit import QuickFitter
from decoder.searching import COARSE_STEP, thinned
from decoder.strips import Strips
from decoder.uncovered_pixels import UncoveredPixels

NOTHING = -2.0


@dataclass(frozen=True, slots=True)
class Uncovered:
    """What is found of a covered needle in M frames, (M,) each.

    Attributes
    ----------
    row, sigma_rows, score
        As of a `matching.Match`; a score of 0 where there is nothing.
    visible
        How much of the needle's contrast shows there.
    is_settled
        Whether the least squares came to an end beyond doubt.
    """

    row: Floats
    sigma_rows: Floats
    score: Floats
    visible: Floats
    is_settled: Mask


@dataclass(frozen=True, slots=True)
class Sought:
    """Where a covered needle is to be looked at closely in M frames; (M,) but for the last one.

    Attributes
    ----------
    above_row
        Of the covering needle.
    top_row, place
        The searched row with the best score, and the peak between searched rows.
    score
        On that row.
    is_there
        Whether that is a place for the needle at all.
    first_row
        The first of the searched rows.
    visible
        (M, J): how much of the needle's contrast shows on each of these.
    """

    above_row: Floats
    top_row: Indices
    place: Floats
    score: Floats
    is_there: Mask
    first_row: Indices
    visible: Floats

    def part(self, which: Indices) -> Sought:
        """In some of the frames."""
        return Sought(*(getattr(self, field.name)[which] for field in fields(self)))


class UncoveredSearch:
    """Looks for a needle near one that lies over it.

    Parameters
    ----------
    upper, lower
        Their templates.
    face
        (R, C) float32.
    allowed
        (R,): the rows on which the lower needle's axis may lie.
    pixels_per_sample
        As of the gauge's grid.
    """

    def __init__(
        self, upper: NeedleTemplate, lower: NeedleTemplate, face: Floats, allowed: Mask, pixels_per_sample: float
    ) -> None:
        self._axis = (lower.rows - 1) // 2
        self._upper_axis = (upper.rows - 1) // 2
        # as far as one reaches into the other's window, and a searched row more to see a peak there
        self.reach_rows = self._upper_axis + self._axis + 1 + COARSE_STEP
        self._face_rows = len(face)
        self._allowed = allowed
        self._fitter = QuickFitter(lower, pixels_per_sample)
        coarse = thinned(lower)
        self._height = coarse.rows
        self._kernels = _kernels(coarse)
        self._whole = self._whole_contrast(face, coarse)
        self._steps = COARSE_STEP * np.arange(math.ceil(2 * self.reach_rows / COARSE_STEP) + 1) - self.reach_rows
        self._searched = COARSE_STEP * np.arange(len(self._steps) + self._height - 1)
        self._left = UncoveredPixels(upper.touched, lower.rows)
        self._left_searched = UncoveredPixels(upper.touched, len(self._searched), COARSE_STEP)

    def look(self, strips: Strips, above_rows: Floats) -> Sought:
        """Where the needle matches best near the rows (M,) of the covering one's axis."""
        rows = np.rint(above_rows).astype(np.intp)[:, None] + self._steps
        scores, visible = self._scores(strips, rows, above_rows)
        inside = (rows >= self._axis) & (rows < self._face_rows - self._axis)
        visible = np.where(inside, visible, 0.0)
        may_be = inside & self._allowed[limited(rows, 0, self._face_rows - 1)] & (visible >= MIN_VISIBLE)
        scores = np.where(inside, scores, NOTHING)
        peaks = np.zeros(scores.shape, bool)
        peaks[:, 1:-1] = (scores[:, 1:-1] >= scores[:, :-2]) & (scores[:, 1:-1] >= scores[:, 2:])
        peaks &= may_be
        every = np.arange(len(rows))
        top = limited(np.where(peaks, scores, NOTHING).argmax(axis=1), 1, rows.shape[1] - 2)
        before, here, after = (scores[every, top + step].astype(np.float64) for step in (-1, 0, 1))
        bend = before - 2 * here + after
        off = np.divide(0.5 * (before - after), bend, out=np.zeros_like(bend), where=bend < 0)
        top_row = rows[every, top]
        place = top_row + COARSE_STEP * limited(off, -0.5, 0.5)
        return Sought(above_rows, top_row, place, here, peaks[every, top], rows[:, 0], visible)

    def settled(self, strips: Strips, sought: Sought) -> Uncovered:
        """The needle near where it was seen."""
        row, sigma_rows, score, is_settled = self._settled(strips, sought.above_row, sought.top_row, sought.place)
        row = np.where(np.isfinite(row) & sought.is_there, row, sought.above_row)
        score = np.where(sought.is_there, np.where(np.isfinite(score), score, sought.score), 0.0)
        every, last = np.arange(len(row)), sought.visible.shape[1] - 1
        at = limited((row - sought.first_row) / COARSE_STEP, 0.0, last - 0.001)
        first = at.astype(np.intp)
        shows = sought.visible[every, first] * (1 - at + first) + sought.visible[every, first + 1] * (at - first)
        # What no least squares settle on is hidden if it did not even match, and else for others to look at.
        return Uncovered(row, sigma_rows, score, shows, is_settled | (score < SCORE_THRESHOLD))

    def _settled(
        self, strips: Strips, above_rows: Floats, top_rows: Indices, place: Floats
    ) -> tuple[Floats, Floats, Floats, Mask]:
        """Least squares of the uncovered pixels, started at the fractional rows `place`: row, sigma and score.

        NaN where they went astray; also whether they came to an end, all (M,).
        """
        rows = limited(np.rint(place).astype(np.intp), self._axis, self._face_rows - self._axis - 1)
        guess_rows = limited(place - rows, -0.5, 0.5)
        row, sigma_rows, score = np.full((3, len(rows)), np.nan)
        open_ = np.arange(len(rows))
        for _ in range(MAX_STEPS):
            part = strips.part(open_)
            seen, face = part.windows(rows[open_], self._axis)
            masks = self._left.at(rows[open_] - self._axis, above_rows[open_] - self._upper_axis)
            fits = self._fitter.fit(seen, face, guess_rows[open_], masks=masks.reshape(seen.shape))
            place = rows[open_] + fits.fraction
            within = np.abs(place - top_rows[open_]) <= MAX_PEAK_ROWS
            done = within & (np.abs(fits.fraction) <= MAX_FRACTION_ROWS)
            for known, values in ((row, place), (sigma_rows, fits.sigma_rows), (score, fits.score)):
                known[open_[done]] = values[done]
            further = within & ~done
            open_, moved = open_[further], np.rint(fits.fraction[further]).astype(np.intp)
            if not open_.size:
                break
            rows[open_] = limited(rows[open_] + moved, self._axis, self._face_rows - self._axis - 1)
            guess_rows[open_] = 0.0
        return row, sigma_rows, score, np.isfinite(row)

    def _scores(self, strips: Strips, rows: Indices, above_rows: Floats) -> tuple[Floats, Floats]:
        """Scores and how much shows, on rows (M, J)."""
        first = rows[:, 0] - self._axis + self._axis % COARSE_STEP
        seen, face = strips.rows(first[:, None] + self._searched, COARSE_STEP)
        mask = self._left_searched.at(first, above_rows - self._upper_axis)
        masked, masked_face = seen * mask, face * mask
        images = np.concatenate([mask, masked_face, masked_face * face, masked, masked * face, masked * seen], axis=2)
        sums = _diagonals(images @ self._kernels, self._height)
        total = np.maximum(sums[0], np.float32(1e-6))
        face_mean, face_square, needle_mean, needle_face, needle_square, mean, square, with_face, with_needle = (
            each / total for each in sums[1:]
        )
        face_variance = np.maximum(face_square - face_mean**2, 0.0) + np.float32(FACE_NOISE_LEVELS**2)
        per_face = (needle_face - needle_mean * face_mean) / face_variance
        needle_left = np.maximum(np.maximum(needle_square - needle_mean**2, 0.0) - per_face**2 * face_variance, 0.0)
        with_face = with_face - mean * face_mean
        left = np.maximum(square - mean * mean - with_face**2 / face_variance, 0.0)
        shared = with_needle - mean * needle_mean - with_face * per_face
        usable = (left > MIN_SPREAD_LEVELS**2) & (needle_left > MIN_SPREAD_LEVELS**2)
        spread = np.sqrt(left * needle_left)
        scores = np.divide(shared, spread, out=np.zeros_like(spread), where=usable)
        whole = self._whole[limited(rows, 0, self._face_rows - 1)]
        return limited(scores, -1.0, 1.0), limited(needle_left * total / np.maximum(whole, 1e-6), 0.0, 1.0)

    def _whole_contrast(self, face: Floats, coarse: NeedleTemplate) -> Floats:
        """(R,): the needle's contrast with nothing over it, by the row of its axis."""
        whole = np.zeros(len(face), np.float32)
        for phase in range(COARSE_STEP):
            contrast = face_moments(
                np.ascontiguousarray(face[phase::COARSE_STEP, ::COARSE_STEP]), coarse
            ).needle_contrast
            first = phase + self._axis - self._axis % COARSE_STEP
            rows = first + COARSE_STEP * np.arange(len(contrast))
            whole[rows[rows < len(face)]] = contrast[rows < len(face)]
        return whole


def _kernels(template: NeedleTemplate) -> Floats:
    """(6 C, 10 H): from mask, face, its square, gauge, gauge times face and the gauge's square to all sums.

    The sums are in the order of `over_face.FaceMoments`' sources: of weights; the face and its square; the needle, with
    the face, and its square; the gauge and its square, with the face, and with the needle.
    """
    one, light, cover = template.trust, template.trust * template.light, template.transparency - 1
    covered = one * cover
    none = np.zeros_like(one)
    sums = [
        [one, none, none, none, none, none],
        [none, one, none, none, none, none],
        [none, none, one, none, none, none],
        [light, covered, none, none, none, none],
        [none, light, covered, none, none, none],
        [light * template.light, 2 * light * cover, covered * cover, none, none, none],
        [none, none, none, one, none, none],
        [none, none, none, none, none, one],
        [none, none, none, none, one, none],
        [none, none, none, light, covered, none],
    ]
    blocks = np.stack([np.concatenate(parts, axis=1) for parts in sums])  # (10, H, 6 C)
    kernels: Floats = np.ascontiguousarray(blocks.reshape(-1, blocks.shape[2]).T)
    return kernels


def _diagonals(products: Floats, height: int) -> Floats:
    """(10, M, J) sums of products (M, J + H - 1, 10 H): those that lie on their diagonals."""
    frames, rows, width = products.shape
    frame, row, column = products.strides
    shape = (width // height, frames, rows - height + 1, height)
    strides = (height * column, frame, row, row + column)
    diagonals: Floats = np.ndarray(shape, products.dtype, products, strides=strides)
    sums: Floats = np.add.reduce(diagonals, axis=3)
    return sums
