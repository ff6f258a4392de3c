"""Needles, alone or in pairs: where each lies in many frames, all gauges of all frames in the same arrays.

Only the pixels needed are sampled: every third row and column for the search, then a window around each needle. The
search gives the best row, least squares in the window the fraction. A needle that matches another place nearly as well
is not trusted. One that matches less well than it should is fitted again together with uneven light. A frame's results
do not depend on the other frames in the batch.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import permutations

import numpy as np

from decoder.instruments.found import EDGE, HIDDEN, MISSING, READ, Found, Needle
from decoder.instruments.kinds.dials.pairs import TouchingPair
from decoder.instruments.kinds.dials.stack import StackReader
from decoder.instruments.kinds.dials.tip_or_tail import View, facing
from decoder.instruments.sampling import GaugeSampler, Levels, Samples
from decoder.instruments.thresholds import APART_DEG, CLEARLY_WORSE, SATURATED_LEVEL
from decoder.matching.correlation import xcorr
from decoder.matching.needle_fit import Fits, Settled, WindowFitter, settle
from decoder.matching.needle_search import COARSE_STEP, Search, SearchTarget, collected, peaks_of, thinned
from decoder.matching.strips import blocks_of
from decoder.matching.thresholds import MAX_PEAK_ROWS, MIN_LIGHT_GAIN, MIN_VISIBLE, WHOLE_VISIBLE
from decoder.panel.arrays import Floats, Indices, Mask, limited
from decoder.panel.gauge import Gauge
from decoder.panel.vocabulary import Method
from decoder.registration.thresholds import LIKELY_SCORE, SCORE_THRESHOLD

# Powers of row and column by which light may vary within one template.
LIGHT_POWERS = ((0, 0), (1, 0), (0, 1), (2, 0), (1, 1), (0, 2))


@dataclass(frozen=True, slots=True)
class Peaks:
    """Where K needles match best in F frames.

    Attributes
    ----------
    scores
        (F, K, N): the search's.
    is_peak
        (F, K, N): the searched rows that are local maxima and on which the needle may lie.
    place
        (F, K): the peak interpolated between searched rows, as a row of the gauge.
    score
        (F, K): on the searched row there.
    is_clear
        (F, K): whether there is one, and it is certainly not another needle's.
    """

    scores: Floats
    is_peak: Mask
    place: Floats
    score: Floats
    is_clear: Mask


class NeedleReader:
    """Reads the needles of a panel; those of one gauge are adjacent.

    Parameters
    ----------
    needles
        Any; with plain cross-correlation each is read by itself.
    sampler
        Of the panel's gauges.
    evenly_lit_score
        See `Appearance`.
    """

    def __init__(
        self, needles: Sequence[Needle], sampler: GaugeSampler, method: Method, evenly_lit_score: float
    ) -> None:
        self._needles, self._sampler, self._method = list(needles), sampler, method
        self._search = Search(
            [SearchTarget(each.template, each.face, sampler.searched.index(each.gauge_index)) for each in needles]
        )
        self._windows = [
            _Windows(
                [index for index, each in enumerate(needles) if each.template.pixels.shape == shape], needles, sampler
            )
            for shape in dict.fromkeys(each.template.pixels.shape for each in needles)
        ]
        self._evenly_lit_score = evenly_lit_score
        is_plain = method is Method.XCORR
        self._pairs = [] if is_plain else _pairs_of(needles)
        # Pairs of needles: the first is not searched for where the second matches better nearby.
        self._rivals = [
            (one, other)
            for one, other in permutations(range(len(needles)), 2)
            if needles[one].gauge_index == needles[other].gauge_index and (is_plain or (one, other) in self._pairs)
        ]
        self._touching = [TouchingPair(needles[upper], needles[lower]) for upper, lower in self._pairs]
        self._stacks = [StackReader([needles[upper], needles[lower]]) for upper, lower in self._pairs]
        self._is_alone = np.array([method is Method.NORMXCORR and len(each.gauge.needles) == 1 for each in needles])
        self._rows, self._allowed = self._searched_rows()
        turns = np.array([np.inf if each.turn_rows is None else each.turn_rows for each in needles])
        self._turns = (0.0, -turns, turns) if np.isfinite(turns).any() else (0.0,)

    def _searched_rows(self) -> tuple[Indices, Mask]:
        """(K, N) each: the gauges' searched rows, and whether the needles' axes may lie on them."""
        places = self._search.places
        rows = np.stack([place.start + COARSE_STEP * np.arange(self._search.count, dtype=np.intp) for place in places])
        allowed = np.zeros(rows.shape, bool)
        for index, (needle, place) in enumerate(zip(self._needles, places, strict=True)):
            inner = slice(1, place.count - 1)
            own = rows[index, inner]
            allowed[index, inner] = needle.allowed[own] & (own <= place.last_row)
        return rows, allowed

    def read(self, frames: Sequence[Samples]) -> Found:
        """Find the needles in F frames: (F, K); results for gauges not wholly in a frame are meaningless."""
        gauges = self._searched(frames)
        scores = self._search.scores(gauges)
        peaks = self._peaks(scores, scores if self._method is Method.NORMXCORR else self._products(gauges))
        found = self._settled(frames, peaks)
        self._doubt_rivals(frames, peaks, found)
        self._doubt_directions(frames, found)
        self._look_through_light(frames, found)
        for pair in range(len(self._pairs)):
            self._read_pair(frames, pair, peaks, found)
            self._tell_apart(frames, pair, peaks, found)
        return found

    def _searched(self, frames: Sequence[Samples]) -> list[Levels]:
        samples = np.stack([frame.searched for frame in frames])
        parts = zip(self._sampler.searched_parts, self._sampler.searched_shapes, strict=True)
        return [samples[:, part].reshape(-1, *shape) for part, shape in parts]

    def _products(self, gauges: Sequence[Levels]) -> Floats:
        """Return the plain cross-correlation on the searched rows: (F, K, N)."""
        products = np.zeros((len(gauges[0]), *self._rows.shape), np.float32)
        for index, (needle, place) in enumerate(zip(self._needles, self._search.places, strict=True)):
            rows = np.stack([collected(own) for own in gauges[place.gauge]]).astype(np.float32)
            template = thinned(needle.template)
            products[:, index, : place.count] = xcorr(rows[:, : place.count + template.rows - 1], template.pixels)
        return products

    def _peaks(self, scores: Floats, curve: Floats) -> Peaks:
        """Find the highest peaks of the curve, those of a lower needle away from the one above it."""
        is_peak = np.zeros(curve.shape, bool)
        is_peak[..., 1:-1] = (curve[..., 1:-1] >= curve[..., :-2]) & (curve[..., 1:-1] >= curve[..., 2:])
        is_peak &= self._allowed
        nearby = {}
        for one, other in self._rivals:
            steps = round(APART_DEG / self._needles[one].grid.step_deg) // COARSE_STEP
            # A peak may lie between searched rows: with a narrower reach, the needle itself is not left out.
            is_peak[:, one] &= scores[:, one] >= _nearby_best(scores[:, other], steps - 1)
            nearby[one] = scores[:, one] >= _nearby_best(scores[:, other], steps)
        top, place = peaks_of(curve, is_peak)
        for upper, lower in self._pairs:
            far = self._far_rows(upper, lower) + 1 - COARSE_STEP / 2
            upper_row = (place[:, upper] * COARSE_STEP + self._rows[upper, 0])[:, None]
            is_lost = np.take_along_axis(scores[:, upper], top[:, upper, None], axis=1) < SCORE_THRESHOLD
            is_peak[:, lower] &= is_lost | (np.abs(self._rows[lower] - upper_row) > far)
            top[:, lower], place[:, lower] = peaks_of(curve[:, lower], is_peak[:, lower])
        is_clear = np.take_along_axis(is_peak, top[..., None], axis=2)[..., 0]
        if self._method is Method.NORMXCORR:
            for one, is_best in nearby.items():
                is_clear[:, one] &= np.take_along_axis(is_best, top[:, one, None], axis=1)[:, 0]
        score = np.take_along_axis(scores, top[..., None], axis=2)[..., 0]
        return Peaks(scores, is_peak, place * COARSE_STEP + self._rows[:, 0], score, is_clear)

    def _far_rows(self, upper: int, lower: int) -> int:
        """Return the distance beyond which two needles do not overlap."""
        return self._needles[upper].axis + self._needles[lower].axis

    def _settled(self, frames: Sequence[Samples], peaks: Peaks) -> Found:
        found = Found.missing(peaks.place.shape)
        found.row[:], found.score[:] = peaks.place, np.minimum(peaks.score, LIKELY_SCORE)
        for windows in self._windows:
            frame, needle = (
                each.ravel() for each in np.meshgrid(np.arange(len(frames)), windows.needles, indexing="ij")
            )
            own = windows.settle(frames, frame, needle, peaks.place[frame, needle])
            is_there = np.isfinite(own.row) & peaks.is_clear[frame, needle]
            is_read = is_there & (own.score >= SCORE_THRESHOLD) & own.is_settled
            values = Found(np.where(is_read, READ, MISSING), own.row, own.sigma_rows, own.score)
            found.put((frame[is_there], needle[is_there]), values.part(is_there))
        return found

    def _doubt_rivals(self, frames: Sequence[Samples], peaks: Peaks, found: Found) -> None:
        """Mark needles as missing that match another place of their dials nearly as well.

        A tail as long as the tip, a bug of the needle's shape, or a reflection may match as the needle does.
        """
        reach_rows = np.array([needle.half_width_rows + MAX_PEAK_ROWS for needle in self._needles])
        elsewhere = peaks.is_peak & (peaks.scores >= LIKELY_SCORE) & (found.status == READ)[..., None]
        for turn in self._turns:
            middle = (found.row + turn)[..., None]
            elsewhere &= ~(np.abs(self._rows - middle) <= reach_rows[:, None])
        frame, needle = np.nonzero(elsewhere.any(axis=2) & (found.status == READ))
        if not frame.size:
            return
        _, place = peaks_of(peaks.scores[frame, needle], elsewhere[frame, needle])
        rows = place * COARSE_STEP + self._rows[needle, 0]
        for windows in self._windows:
            own = np.flatnonzero(np.isin(needle, windows.needles))
            if not own.size:
                continue
            at = frame[own], needle[own]
            rival = windows.settle(frames, *at, rows[own])
            left = 1.0 - np.maximum(np.nan_to_num(rival.score), 0.0) ** 2
            is_as_good = left <= CLEARLY_WORSE * (1.0 - found.score[at] ** 2)
            found.status[at[0][is_as_good], at[1][is_as_good]] = MISSING

    def _doubt_directions(self, frames: Sequence[Samples], found: Found) -> None:
        """Mark needles with tails as missing whose tips are not clearly ahead, whichever side of the centre they pass.

        A frame that vibrates shows a dial some pixels aside, and a dial may be drawn beside its centre. Half a turn on,
        that is the other side: there a needle may match its reverse far better than itself. Nothing is learned from
        such a frame, so `row` becomes NaN.
        """
        for index, needle in enumerate(self._needles):
            if needle.turn_rows is None or not needle.gauge.tail:
                continue
            # Where frames vibrate little can be trusted, least of all the tip; here all of it counts.
            whole = replace(needle.template, trust=np.ones_like(needle.template.trust))
            for number in np.flatnonzero(found.status[:, index] == READ).tolist():
                (seen,) = self._sampler.strips([frames[number]], needle.gauge_index)
                view = View(seen, needle.face, np.ones_like(seen))
                towards = facing(view, whole, needle.grid, round(float(found.row[number, index])))
                if not towards.is_clear or towards.ahead < 0.0:
                    found.status[number, index], found.row[number, index] = MISSING, np.nan

    def _look_through_light(self, frames: Sequence[Samples], found: Found) -> None:
        """Fit again, together with uneven light, needles that stand alone but match less well than they should."""
        doubtful = self._is_alone & np.isfinite(found.row) & ~(found.score >= self._evenly_lit_score)
        doubtful &= (found.status == READ) | ~(found.score >= SCORE_THRESHOLD)
        for windows in self._windows:
            frame, number = np.nonzero(doubtful[:, windows.needles])
            if not frame.size:
                continue
            needle = windows.needles[number]
            before = found.part((frame, needle))
            seen, visible = windows.settle_lit(frames, frame, needle, before.row)
            usable = seen.is_settled & (seen.gain >= MIN_LIGHT_GAIN) & (visible >= MIN_VISIBLE)
            score = np.where(usable, seen.score, 0.0)
            drowned = usable & (np.abs(seen.row - before.row) <= MAX_PEAK_ROWS) & (visible < WHOLE_VISIBLE)
            better = usable & (score >= before.score)
            after = before.instead(better, Found(before.status, seen.row, seen.sigma_rows, score))
            status = np.where(after.score < SCORE_THRESHOLD, MISSING, np.where(drowned, EDGE, READ))
            found.put((frame, needle), Found(status, after.row, after.sigma_rows, after.score))

    def _read_pair(self, frames: Sequence[Samples], pair: int, peaks: Peaks, found: Found) -> None:
        """Read two needles together in those frames in which they are not both clearly seen far apart."""
        (upper, lower), touching = self._pairs[pair], self._touching[pair]
        far = self._far_rows(upper, lower)
        above, below = found.part((slice(None), upper)), found.part((slice(None), lower))
        is_above = above.status == READ
        apart = is_above & (below.status == READ) & (np.abs(above.row - below.row) > far)
        apart &= np.abs(above.row - peaks.place[:, upper]) <= COARSE_STEP / 2
        open_ = np.flatnonzero(~apart)
        if not open_.size:
            return
        near = touching.is_beside(self._rows[lower], peaks.scores[open_, lower], self._allowed[lower], above.row[open_])
        near &= is_above[open_]
        where, rest = open_[near], open_[~near]
        if where.size:
            needle = self._needles[upper]
            top_rows = touching.top_rows(above.row[where])
            columns, size = needle.grid.columns, touching.strip_rows * needle.grid.columns
            first = self._sampler.first[needle.gauge_index] + top_rows * columns
            runs = [frames[number].runs(own, size) for number, own in zip(where.tolist(), first[:, None], strict=True)]
            strips = np.concatenate(runs).reshape(-1, touching.strip_rows, columns).astype(np.float32)
            one, other, is_settled = touching.read(strips, top_rows, above.part(where))
            found.put((where, upper), one)
            found.put((where, lower), other)
            rest = np.concatenate([rest, where[~is_settled]])
        if rest.size:
            gauge_index = self._needles[upper].gauge_index
            both = self._stacks[pair].read(
                self._sampler.strips([frames[number] for number in rest.tolist()], gauge_index)
            )
            one, other = (both.part((slice(None), column)) for column in (0, 1))
            # If the lower needle matches better than the upper, the upper is not in that place.
            alone = ~is_above[rest] & (below.status[rest] == READ) & (below.score[rest] > one.score)
            alone &= ~(one.score >= LIKELY_SCORE)
            found.put((rest, upper), one.instead(alone, one.as_missing()))
            found.put((rest, lower), other.instead(alone, below.part(rest)))

    def _tell_apart(self, frames: Sequence[Samples], pair: int, peaks: Peaks, found: Found) -> None:
        """Tell two needles apart that each match where the other is; one found alone may be either of them."""
        stack, both = self._stacks[pair], np.array(self._pairs[pair])
        seen = np.isin(found.status[:, both], (READ, EDGE))
        is_missing, is_hidden = (np.isin(found.status[:, both[::-1]], (status,)) for status in (MISSING, HIDDEN))
        hides = (seen & is_hidden).any(axis=1) & stack.has_alike
        lone, alike = (seen & is_missing).T, seen.all(axis=1)
        for at, (one, other) in enumerate((both, both[::-1])):
            there = np.rint((np.nan_to_num(found.row[:, one]) - self._rows[one, 0]) / COARSE_STEP)
            there = limited(there, 0, peaks.scores.shape[2] - 1).astype(np.intp)[:, None]
            around = round(APART_DEG / self._needles[one].grid.step_deg) // COARSE_STEP  # it may be cut beside its axis
            own, its = (
                np.take_along_axis(_nearby_best(peaks.scores[:, each], around), there, axis=1)[:, 0]
                for each in (one, other)
            )
            alike &= its >= LIKELY_SCORE
            lone[at] &= 1.0 - np.maximum(its, 0.0) ** 2 <= CLEARLY_WORSE * (1.0 - np.maximum(own, 0.0) ** 2)
        index = self._needles[both[0]].gauge_index
        told_apart = (lone.any(axis=0), lambda strips, _: stack.read(strips)), (alike | hides, stack.tell_apart)
        for which, told in told_apart:
            where = np.flatnonzero(which)
            if where.size:
                strips = self._sampler.strips([frames[number] for number in where.tolist()], index)
                at_both = where[:, None], both
                found.put(at_both, told(strips, found.part(at_both)))


class _Windows:
    """The windows of needles whose templates have the same shape; `needles` are their indices."""

    def __init__(self, numbers: Sequence[int], needles: Sequence[Needle], sampler: GaugeSampler) -> None:
        own = [needles[number] for number in numbers]
        self.needles = np.array(numbers)
        self._index = np.zeros(len(needles), np.intp)
        self._index[self.needles] = np.arange(len(numbers))
        self._axis = own[0].axis
        self._height, self._columns = own[0].template.pixels.shape
        self._last = np.array([each.grid.rows for each in own]) - self._axis - 1
        self._first = np.array([sampler.first[each.gauge_index] for each in own])
        faces = np.concatenate([each.face for each in own]).astype(np.float32)
        self._faces = blocks_of(faces, self._height)
        self._first_face = np.cumsum([0, *(len(each.face) for each in own)])[:-1]
        self._templates = [each.template for each in own]
        pixels_per_sample = [each.grid.pixels_per_sample for each in own]
        self._pixels_per_sample = np.array(pixels_per_sample)
        self._fitter = WindowFitter(self._templates, pixels_per_sample)
        self._lit_fitter = WindowFitter(self._templates, pixels_per_sample, _lights(self._height, self._columns))

    def settle(self, frames: Sequence[Samples], frame: Indices, needle: Indices, places: Floats) -> Settled:
        """Fit needles (M,) in frames (M,) by least squares, starting from fractional rows (M,)."""
        index = self._index[needle]

        def fit(open_: Indices, rows: Indices, guess_rows: Floats) -> Fits:
            seen, faces = self._around(frames, frame[open_], index[open_], rows)
            return self._fitter.fit(seen, faces, guess_rows, needles=index[open_])

        return settle(fit, places, (self._axis, self._last[index]), MAX_PEAK_ROWS)

    def settle_lit(
        self, frames: Sequence[Samples], frame: Indices, needle: Indices, places: Floats
    ) -> tuple[Settled, Floats]:
        """Do as `settle` under uneven light; also return what part of each needle's contrast is not saturated."""
        index = self._index[needle]
        visible, pixels = np.zeros(len(frame)), np.zeros(len(frame))

        def fit(open_: Indices, rows: Indices, guess_rows: Floats) -> Fits:
            own = index[open_]
            seen, faces = self._around(frames, frame[open_], own, rows)
            clear = (seen < SATURATED_LEVEL).astype(np.float32)
            trust, light, transparency = (
                np.stack([getattr(each, name).ravel() for each in self._templates])[own]
                for name in ("trust", "light", "transparency")
            )
            contrast = trust * (light + (transparency - 1.0) * faces) ** 2
            visible[open_] = (contrast * clear).sum(axis=1) / np.maximum(contrast.sum(axis=1), 1e-9)
            pixels[open_] = (trust * clear).sum(axis=1) * self._pixels_per_sample[own]
            return self._lit_fitter.fit(seen, faces, guess_rows, needles=own, masks=clear)

        found = settle(fit, places, (self._axis, self._last[index]), MAX_PEAK_ROWS)
        score = _adjusted(found.score, pixels)
        return Settled(found.row, found.sigma_rows, score, found.correlation, found.gain, found.is_settled), visible

    def _around(
        self, frames: Sequence[Samples], frame: Indices, index: Indices, rows: Indices
    ) -> tuple[Floats, Floats]:
        """Return gauges and faces in windows around rows, (M, H * C) each; M is ordered by frame."""
        top_rows = rows - self._axis
        first = self._first[index] + top_rows * self._columns
        ends = np.flatnonzero(np.diff(frame, prepend=-1, append=-1))
        runs = [
            frames[frame[start]].runs(first[start:end], self._height * self._columns)
            for start, end in zip(ends[:-1].tolist(), ends[1:].tolist(), strict=True)
        ]
        return np.concatenate(runs).astype(np.float32), self._faces[self._first_face[index] + top_rows]


def _lights(height: int, width: int) -> Floats:
    """(6, H * C) float32: the powers by which light may vary."""
    row, column = np.meshgrid(np.linspace(-1, 1, height), np.linspace(-1, 1, width), indexing="ij")
    return np.stack([(row**i * column**j).ravel() for i, j in LIGHT_POWERS]).astype(np.float32)


def _adjusted(scores: Floats, pixels: Floats) -> Floats:
    """Correct correlations for the freedom that few pixels leave (Ezekiel's adjusted R squared)."""
    freedom = len(LIGHT_POWERS) + 2  # the lights, the face, the needle
    usable = (scores > 0) & (pixels > freedom + 1)
    left = (1.0 - scores**2) * (pixels - 1) / np.where(usable, pixels - freedom - 1, 1.0)
    adjusted: Floats = np.where(usable, np.sqrt(np.maximum(1.0 - left, 0.0)), 0.0)
    return adjusted


def is_simple(gauge: Gauge) -> bool:
    """Whether a gauge has one needle, or a pair that can be read from the pixels around it."""
    if len(gauge.needles) == 1:
        return True
    spans = {needle.template.span for needle in gauge.needles}
    is_pair = len(gauge.needles) == 2 and any(needle.covered_by for needle in gauge.needles)  # noqa: PLR2004
    return is_pair and len(spans) == 1 and not gauge.is_round and not gauge.tail


def _pairs_of(needles: Sequence[Needle]) -> list[tuple[int, int]]:
    """List pairs of needles, one above the other: (above, below) by index."""
    index = {needle.name: number for number, needle in enumerate(needles)}
    return [(index[each.covered_by], number) for number, each in enumerate(needles) if each.covered_by is not None]


def _nearby_best(scores: Floats, steps: int) -> Floats:
    """Return for each of (F, N) scores the highest within `steps` to either side."""
    best = scores.copy()
    for step in range(1, steps + 1):
        np.maximum(best[:, step:], scores[:, :-step], out=best[:, step:])
        np.maximum(best[:, :-step], scores[:, step:], out=best[:, :-step])
    return best
