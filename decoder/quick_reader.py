"""The quick reader: what is plain in a frame, in many frames at once.

Most needles match unmistakably, nowhere else nearly as well, and far from any other. They are read here, with all
gauges of all frames in the same arrays, and only the pixels that this takes are sampled: every third row and column
for the search, then a window around each needle. Whatever is less than plain is left to the gauge readers.
Nothing that is found in a frame depends on the frames beside it.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from decoder.arrays import Floats, Indices, Mask
from decoder.fitting import MAX_FRACTION_ROWS
from decoder.gauge_reader import SCORE_THRESHOLD
from decoder.matching import MAX_PEAK_ROWS
from decoder.needle_pair import NeedlePair
from decoder.quick_pixels import Pixels, QuickGrids
from decoder.quick_search import Peaks, QuickNeedle, QuickSearch, pairs_of
from decoder.quick_windows import WindowFits, Windows
from decoder.rivals import MIN_RIVAL
from decoder.touching_pairs import READ, Needle, TouchingPair

# How far a covering needle may lie from where the search had it: the search for the one below allows for that.
MAX_OFF_ROWS = 1.0


@dataclass(frozen=True, slots=True)
class Plain:
    """What was found in F frames for K needles.

    Attributes
    ----------
    status
        (F, K): index into `touching_pairs.STATUSES`.
    row, sigma_rows, score
        (F, K), as of a `matching.Match`, where it is settled.
    settled
        (F, K): whether that is beyond doubt.
    coarse
        (F, K, N): the scores of the search.
    """

    status: Indices
    row: Floats
    sigma_rows: Floats
    score: Floats
    settled: Mask
    coarse: Floats


class QuickReader:
    """Reads some needles of one panel, those of one gauge side by side; `evenly_lit_score` as in `Tuning`.

    `grids` are those of the needles' gauges, `pairs` what is known of needles with others above them, by name.
    """

    def __init__(
        self,
        needles: Sequence[QuickNeedle],
        grids: QuickGrids,
        evenly_lit_score: float,
        pairs: Mapping[str, NeedlePair],
    ) -> None:
        self.needles = tuple(needles)
        self.grids = grids
        self.search = QuickSearch(needles, self.grids)
        self._windows = Windows(needles, self.grids)
        self._pairs = pairs_of(needles)
        self._touching = [
            TouchingPair(needles[upper], needles[lower], pairs[needles[lower].name]) for upper, lower in self._pairs
        ]
        self._plain = np.array([needle.is_plain for needle in needles])
        paired = {index for pair in self._pairs for index in pair}
        self._needed = np.array(
            [
                SCORE_THRESHOLD if index in paired else max(SCORE_THRESHOLD, evenly_lit_score)
                for index in range(len(needles))
            ]
        )
        self._reach_rows = np.array([needle.half_width_rows + MAX_PEAK_ROWS for needle in needles])
        turn_rows = np.array([np.inf if needle.turn_rows is None else needle.turn_rows for needle in needles])
        # By how many rows apart a needle shows again; on a dial that is not read all the way round, beyond its ends.
        self._turns = (0.0, -turn_rows, turn_rows) if np.isfinite(turn_rows).any() else (0.0,)

    def read(self, frames: Sequence[Pixels]) -> Plain:
        """The needles in F frames; those whose gauges do not lie wholly in a frame are not to be believed."""
        coarse = self.search.scores(frames)
        peaks = self.search.peaks(coarse)
        fits = self._fits(frames, peaks)
        alone = self._alone(peaks, fits)
        settled = self._apart(peaks, fits.row, alone)
        plain = Plain(np.full(settled.shape, READ), fits.row, fits.sigma_rows, fits.score, settled, coarse)
        for pair in range(len(self._pairs)):
            self._read_touching(frames, pair, peaks, alone, plain)
        return plain

    def _read_touching(self, frames: Sequence[Pixels], pair: int, peaks: Peaks, alone: Mask, plain: Plain) -> None:
        """Fills in what is found of two needles in those frames in which the upper one stands, the lower near it."""
        (upper, lower), touching = self._pairs[pair], self._touching[pair]
        where = np.flatnonzero(alone[:, upper] & ~plain.settled[:, lower])
        is_beside = touching.is_beside(
            peaks.rows[lower], peaks.scores[where, lower], self.search.allowed(lower), plain.row[where, upper]
        )
        where = where[is_beside]
        if not where.size:
            return
        columns = (plain.status, plain.row, plain.sigma_rows, plain.score)
        above = Needle(*(column[where, upper] for column in columns))
        needle = self.needles[upper]
        top_rows = touching.top_rows(above.row)
        columns_px, size = needle.grid.columns, touching.strip_rows * needle.grid.columns
        first = self.grids.first[needle.gauge_index] + top_rows * columns_px
        pixels = np.concatenate(
            [frames[number].runs(own, size) for number, own in zip(where.tolist(), first[:, None], strict=True)]
        )
        strips = pixels.reshape(-1, touching.strip_rows, columns_px).astype(np.float32)
        *found, is_settled = touching.read(strips, top_rows, above)
        for name, own in zip((upper, lower), found, strict=True):
            for column, values in zip(columns, (own.status, own.row, own.sigma_rows, own.score), strict=True):
                column[where, name] = values
            plain.settled[where, name] = is_settled

    def _fits(self, frames: Sequence[Pixels], peaks: Peaks) -> WindowFits:
        """The least squares around the peaks; where those point into another window, once more there."""
        fits = self._windows.fits(frames, peaks.row, peaks.place)
        further = self._plain & peaks.clear & (fits.score >= SCORE_THRESHOLD)
        further &= (np.abs(fits.fraction) > MAX_FRACTION_ROWS) & (np.abs(fits.row - peaks.top_row) <= MAX_PEAK_ROWS)
        where = np.flatnonzero(further.any(axis=1))
        if where.size:
            moved = further[where]
            rows = np.rint(np.where(moved, fits.row[where], peaks.row[where])).astype(np.intp)
            places = np.where(moved, rows, peaks.place[where])
            fits.put(where, self._windows.fits([frames[number] for number in where.tolist()], rows, places))
        return fits

    def _alone(self, peaks: Peaks, fits: WindowFits) -> Mask:
        """(F, K): the least squares agree with the search, the needle matches well, and nowhere else nearly as well."""
        settled = self._plain & peaks.clear & (fits.score >= self._needed)
        settled &= (np.abs(fits.fraction) <= MAX_FRACTION_ROWS) & (np.abs(fits.row - peaks.top_row) <= MAX_PEAK_ROWS)
        # Between two searched rows scores lie on the line: what lies beyond the reach is bounded by one just within.
        reach_rows = self._reach_rows - 2.5
        elsewhere, rows = peaks.open, peaks.rows.astype(np.float32)
        for turn in self._turns:
            first = (fits.row + turn - reach_rows).astype(np.float32)[..., None]
            last = (fits.row + turn + reach_rows).astype(np.float32)[..., None]
            elsewhere = elsewhere & ((rows < first) | (rows > last))
        settled &= peaks.scores.max(axis=2, where=elsewhere, initial=0.0) < MIN_RIVAL
        return settled

    def _apart(self, peaks: Peaks, row: Floats, alone: Mask) -> Mask:
        """(F, K): those of a pair only together, and so far apart that neither changes what is seen of the other."""
        settled = alone.copy()
        for cover, lower in self._pairs:
            far = self.needles[cover].axis + self.needles[lower].axis
            both = settled[:, cover] & settled[:, lower] & (np.abs(row[:, cover] - row[:, lower]) > far)
            both &= np.abs(row[:, cover] - peaks.place[:, cover]) <= MAX_OFF_ROWS
            both &= np.abs(row[:, cover] - peaks.top_row[:, lower]) > far + 1
            settled[:, cover] = settled[:, lower] = both
        return settled
