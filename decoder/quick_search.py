"""The search of the quick reader: where each needle is to be looked at closely, and how clear that is."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from decoder.arrays import Floats, Indices, Mask, limited
from decoder.gauge import Gauge
from decoder.gauge_grid import rows_in_sweep, turn_rows
from decoder.gauge_reader import RIVAL_REACH_DEG
from decoder.needle_template import NeedleTemplate
from decoder.quick_pixels import Pixels, QuickGrids
from decoder.searching import COARSE_STEP, Search, Sought
from decoder.unwrapping import PolarGrid, UnwrappedGauge

NOTHING = -2.0
# The covering needle is not yet settled when the one below is chosen: it may lie elsewhere by so much.
SLACK_ROWS = 1.5


@dataclass(frozen=True, slots=True)
class QuickNeedle:
    """A needle as the quick reader needs it; `gauge_index` is its gauge's place in the panel."""

    name: str
    gauge_index: int
    gauge: Gauge
    grid: PolarGrid
    face: UnwrappedGauge
    template: NeedleTemplate

    @property
    def axis(self) -> int:
        """The template's middle row."""
        return (self.template.rows - 1) // 2

    @property
    def half_width_rows(self) -> float:
        """Half of the needle's width."""
        return self.template.half_width_deg / self.template.step_deg

    @property
    def turn_rows(self) -> float | None:
        """How many rows a full turn has where the dial is read all the way round."""
        return turn_rows(self.gauge, self.grid)

    @property
    def covered_by(self) -> str | None:
        """The needle above it."""
        return next(needle.covered_by for needle in self.gauge.needles if needle.name == self.name)

    @property
    def is_plain(self) -> bool:
        """Whether it can be read by the quick reader at all, if it matches well: alone, or one of a simple pair."""
        needles = self.gauge.needles
        if len(needles) == 1:
            return True
        spans = {needle.template.span for needle in needles}
        simple = len(spans) == 1 and not self.gauge.is_round and not self.grid.tail_columns
        return simple and len(needles) == 2 and any(needle.covered_by for needle in needles)  # noqa: PLR2004


def pairs_of(needles: Sequence[QuickNeedle]) -> list[tuple[int, int]]:
    """Those that lie above another one and can be read with it: (above, below) by index."""
    index = {needle.name: number for number, needle in enumerate(needles)}
    return [
        (index[needle.covered_by], number)
        for number, needle in enumerate(needles)
        if needle.is_plain and needle.covered_by is not None
    ]


@dataclass(frozen=True, slots=True)
class Peaks:
    """Where K needles match best in F frames.

    Attributes
    ----------
    scores
        (F, K, N): the search's, on `rows`, (K, N).
    top_row
        (F, K): the searched row with the highest score that may be the needle's.
    place
        (F, K): the peak between searched rows.
    row
        (F, K): the whole row nearest to it.
    clear
        (F, K): whether it is surely the one that the gauge reader would look at.
    open
        (F, K, N): the rows at which the needle may be, and some beside them.
    """

    scores: Floats
    rows: Indices
    top_row: Indices
    place: Floats
    row: Indices
    clear: Mask
    open: Mask


class QuickSearch:
    """Searches K needles, those of one gauge side by side."""

    def __init__(self, needles: Sequence[QuickNeedle], grids: QuickGrids) -> None:
        self.search = Search(
            [Sought(each.template, each.face, grids.gauges.index(each.gauge_index)) for each in needles]
        )
        self._grids = grids
        self._pairs = pairs_of(needles)
        self._far_rows = [needles[upper].axis + needles[lower].axis + 1 for upper, lower in self._pairs]
        self._rival_steps = [
            round(RIVAL_REACH_DEG / needles[upper].grid.step_deg) // COARSE_STEP for upper, _ in self._pairs
        ]
        places = self.search.places
        self._rows = np.stack(
            [place.start + COARSE_STEP * np.arange(self.search.count, dtype=np.intp) for place in places]
        )
        self._allowed = np.zeros(self._rows.shape, bool)
        self._open = np.zeros(self._rows.shape, bool)
        for index, (needle, place) in enumerate(zip(needles, places, strict=True)):
            own = rows_in_sweep(needle.gauge, needle.grid)
            beside = np.convolve(own, np.ones(2 * COARSE_STEP - 1), "same") > 0
            rows = self._rows[index, : place.count]
            inner = slice(2, place.count - 2)
            self._allowed[index, inner] = own[rows[inner]] & (rows[inner] <= place.last_row)
            self._open[index, : place.count] = beside[np.minimum(rows, place.size - 1)]

    def allowed(self, needle: int) -> Mask:
        """(N,): the searched rows on which a needle's axis may lie."""
        allowed: Mask = self._allowed[needle]
        return allowed

    def scores(self, frames: Sequence[Pixels]) -> Floats:
        """(F, K, N) float32: as `searching.Search.coarse`, in F frames."""
        samples = np.stack([frame.searched for frame in frames])
        gauges: list[Floats] = [
            samples[:, part].reshape(-1, *shape)
            for part, shape in zip(self._grids.searched_parts, self._grids.searched_shapes, strict=True)
        ]
        return self.search.coarse(gauges)

    def peaks(self, scores: Floats) -> Peaks:
        """The best places for each needle, by their scores (F, K, N)."""
        inner = scores[..., 1:-1]
        is_peak = np.zeros(scores.shape, bool)
        is_peak[..., 1:-1] = (inner >= scores[..., :-2]) & (inner >= scores[..., 2:])
        is_peak &= self._allowed
        clear = np.ones(scores.shape[:2], bool)
        are_open = np.broadcast_to(self._open, scores.shape).copy()
        for (upper, lower), steps in zip(self._pairs, self._rival_steps, strict=True):
            # On rows between the searched ones a narrower reach leaves out nothing that may be the upper needle's.
            may_be = scores[:, upper] >= _nearby_best(scores[:, lower], steps - 1)
            is_peak[:, upper] &= may_be
            are_open[:, upper] &= may_be
        top, place = _highest(scores, is_peak)
        for (upper, lower), steps, far in zip(self._pairs, self._rival_steps, self._far_rows, strict=True):
            at = np.arange(len(scores)), top[:, upper]
            clear[:, upper] &= scores[:, upper][at] >= _nearby_best(scores[:, lower], steps)[at]
            upper_row = place[:, upper] * COARSE_STEP + self._rows[upper, 0]
            apart = np.abs(self._rows[lower] - upper_row[:, None])
            is_peak[:, lower] &= apart > far - SLACK_ROWS
            are_open[:, lower] &= apart > far - SLACK_ROWS - COARSE_STEP
            own_top, own_place = _highest(scores[:, lower : lower + 1], is_peak[:, lower : lower + 1])
            top[:, lower], place[:, lower] = own_top[:, 0], own_place[:, 0]
        place = place * COARSE_STEP + self._rows[:, 0]
        top_row = np.take_along_axis(self._rows[None], top[..., None], axis=2)[..., 0]
        clear &= np.take_along_axis(is_peak, top[..., None], axis=2)[..., 0]
        return Peaks(scores, self._rows, top_row, place, np.rint(place).astype(np.intp), clear, are_open)


def _highest(scores: Floats, where: Mask) -> tuple[Indices, Floats]:
    """The index of the highest score among some, and that of the parabola's peak there: (..., N) to (...)."""
    top = np.where(where, scores, NOTHING).argmax(axis=-1)
    around = limited(top[..., None] + np.array([-1, 0, 1]), 0, scores.shape[-1] - 1)
    before, here, after = np.moveaxis(np.take_along_axis(scores, around, axis=-1).astype(np.float64), -1, 0)
    bend = before - 2 * here + after
    off = np.divide(0.5 * (before - after), bend, out=np.zeros_like(bend), where=bend < 0)
    return top, top + limited(off, -0.5, 0.5)


def _nearby_best(scores: Floats, steps: int) -> Floats:
    """The highest of each of (F, N) scores and so many to either side."""
    best = scores.copy()
    for step in range(1, steps + 1):
        np.maximum(best[:, step:], scores[:, :-step], out=best[:, step:])
        np.maximum(best[:, :-step], scores[:, step:], out=best[:, :-step])
    return best
