"""Stacks: several needles on one dial, each read given all the others, in many frames at once.

Altimeters and clocks have such needles; so is a pair whose needles cannot be read one after the other. Each needle is
searched for with the needles below it drawn on the face, and without the pixels of those above it. As better places of
one improve those of the others, this is repeated a few times, from the uppermost needle down. A needle that takes
another's place on the way would keep it, since the other then fits nowhere else. So if a needle is left over, each is
tried in each other's place, and a change is kept if the dial drawn with it fits clearly better.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, fields, replace
from itertools import combinations, permutations

import numpy as np

from decoder.imaging.thresholds import HALF
from decoder.imaging.unwrapping import PolarGrid, needle_places, opposite_rows, same_rows
from decoder.instruments.found import EDGE, HIDDEN, MISSING, READ, Found, Needle, all_above
from decoder.instruments.thresholds import CLEARLY_WORSE, SURE_SCORE
from decoder.matching.correlation import face_moments, partial_normxcorr
from decoder.matching.layered_dial import DialComparison
from decoder.matching.needle_fit import Fits, WindowFitter, settle
from decoder.matching.needle_search import COARSE_STEP, thinned
from decoder.matching.needle_template import NeedleTemplate
from decoder.matching.strips import blocks_of, rows_at
from decoder.matching.thresholds import MAX_PEAK_ROWS, MIN_VISIBLE, WHOLE_VISIBLE
from decoder.panel.arrays import Floats, Indices, Mask, limited
from decoder.panel.scale import shortest
from decoder.registration.thresholds import CLEAR_SCORE, LIKELY_SCORE, SCORE_THRESHOLD

ROUNDS = 3
SEEN = READ, EDGE


@dataclass(frozen=True, slots=True)
class _Places:
    """Where one needle seems to be in F frames, its certainty, and the visible part of its contrast; (F,) each.

    `rival` is its next best score. `under` is the index of the needle that could hide it completely, or -1 if there are
    none or several such places; `reach_rows` is how far from that needle it would still be hidden.
    """

    row: Floats
    sigma_rows: Floats
    score: Floats
    visible: Floats
    rival: Floats
    under: Indices
    reach_rows: Floats

    @property
    def is_sure(self) -> Mask:
        """Whether the visible part of the needle matches well enough, and nowhere else."""
        needed = np.where(self.visible >= HALF, SCORE_THRESHOLD, SURE_SCORE)
        alone = 1.0 - np.maximum(self.rival, 0.0) ** 2 > CLEARLY_WORSE * (1.0 - np.minimum(self.score, 1.0) ** 2)
        sure: Mask = (self.visible >= MIN_VISIBLE) & (self.score >= needed) & alone
        return sure

    @property
    def is_likely(self) -> Mask:
        """Whether it is taken into account when the others are read."""
        likely: Mask = self.score >= LIKELY_SCORE
        return likely


class StackReader:
    """Reads the needles of one gauge, in their order in the panel."""

    def __init__(self, needles: Sequence[Needle]) -> None:
        first = needles[0]
        self._grid, self._face, self._turn_rows = first.grid, first.face, first.turn_rows
        self._allowed = first.allowed
        names = [needle.name for needle in needles]
        self._above = [all_above(needles, names, index) for index in range(len(needles))]
        self._order = sorted(range(len(needles)), key=lambda index: len(self._above[index]))
        self._templates = [without_dial(needle.template, first.grid) for needle in needles]
        self._comparison = DialComparison(first.face, first.grid.radii_px, self._templates)
        self._coarse = [thinned(template) for template in self._templates]
        self._fitters = [WindowFitter([template], [first.grid.pixels_per_sample]) for template in self._templates]
        self._axes = [needle.axis for needle in needles]
        self._half_widths_rows = [needle.half_width_rows for needle in needles]
        self._pairs = list(combinations(range(len(needles)), 2))
        # Pairs so similar that each may match where the other is. More than two needles are all reconsidered anyway.
        least = LIKELY_SCORE if len(self._pairs) == 1 else SCORE_THRESHOLD
        likeness = [_likeness(*(self._templates[own] for own in both)) for both in self._pairs]
        self._alike = [both for both, like in zip(self._pairs, likeness, strict=True) if like >= least]
        # Pairs alike of which most frames do not show which is which: where one seems to, that is chance.
        self._untold = [both for both in self._alike if all(needles[index].is_doubted for index in both)]

    @property
    def has_alike(self) -> bool:
        """Whether some of its needles have about the same shape."""
        return bool(self._alike)

    def read(self, strips: Floats) -> Found:
        """Find the needles on a gauge in F frames, (F, R, C) float32: (F, K)."""
        places: dict[int, _Places] = {}
        for _ in range(ROUNDS):
            for index in self._order:
                places[index] = self._placed(strips, index, places)
        doubtful = np.zeros((len(strips), len(self._templates)), bool)
        if len(self._pairs) > 1 or self._alike:  # two that differ were looked at before wherever they match
            places, doubtful = self._reconsidered(strips, places)
        drawn = self._drawn(strips, self._order[::-1], places)
        found = Found.missing((len(strips), len(self._templates)))
        for index in self._order:
            found.put((slice(None), index), self._found(strips, index, places, drawn))
        found.status[doubtful] = MISSING
        pairs = self._alike if len(self._pairs) > 1 else self._pairs
        places, unsure = self._in_order(strips, pairs, places, found)
        for index in self._order:
            found.status[self._is_better_without(strips, index, places, found), index] = MISSING
        self._doubt_all(strips, pairs, unsure, places, found)
        return found

    def tell_apart(self, strips: Floats, found: Found) -> Found:
        """Check two needles found in F frames by other means, (F, 2): they may be exchanged, or one be the other."""
        found = found.part(np.arange(len(strips)))
        none, there = np.full(len(strips), -1), (~np.isin(found.status, (MISSING,))).astype(np.float64)
        places = {
            index: _Places(
                np.nan_to_num(found.row[:, index]),
                found.sigma_rows[:, index],
                there[:, index],
                np.ones(len(strips)),
                np.zeros(len(strips)),
                none,
                np.zeros(len(strips)),
            )
            for index in self._order
        }
        places, unsure = self._in_order(strips, [(0, 1)], places, found)
        self._doubt_all(strips, [(0, 1)], unsure, places, found)
        return found

    def _in_order(
        self, strips: Floats, pairs: Sequence[tuple[int, int]], places: dict[int, _Places], found: Found
    ) -> tuple[dict[int, _Places], Mask]:
        """Exchange the needles of all pairs that must be; return the places then, and which pairs are unclear.

        Nothing is left out for being unclear before that, (pairs, F): beside a needle that is in another's place, both
        orders of that other and a third explain the dial badly, and the first would stay alone where it is not.
        """
        open_, places = np.arange(len(strips)), dict(places)
        unsure = np.zeros((len(pairs), len(strips)), bool)
        for _ in range(ROUNDS):
            is_changed = np.zeros(len(strips), bool)
            for number, both in enumerate(pairs):
                changed, unsure[number, open_] = self._exchanged(strips, both, places, found, open_)
                is_changed[changed] = True
            open_ = np.flatnonzero(is_changed)
            if not open_.size:
                break
        found.status[open_] = MISSING  # exchanged once more in each round
        return places, unsure

    def _doubt_all(
        self,
        strips: Floats,
        pairs: Sequence[tuple[int, int]],
        unsure: Mask,
        places: dict[int, _Places],
        found: Found,
    ) -> None:
        """Leave out of all pairs what may be the other needle, and both where their order is unclear, (pairs, F)."""
        before = found.status.copy()
        for both, doubted in zip(pairs, unsure, strict=True):
            self._doubt_lone(strips, both, places, found, before)
            self._doubt(both, np.flatnonzero(doubted), found)

    def _exchanged(
        self, strips: Floats, both: tuple[int, int], places: dict[int, _Places], found: Found, among: Indices
    ) -> tuple[Indices, Mask]:
        """Exchange two needles in some frames where that explains the dial clearly better, in `places` and `found`.

        A single needle matches in any light; only both together show which is the brighter. Return in which frames they
        were exchanged, and for each of `among` whether their order is unclear.
        """
        one, other = both
        unclear = np.zeros(len(among), bool)
        shows = np.flatnonzero(np.isin(found.status[among[:, None], both], SEEN).all(axis=1))
        open_ = among[shows]
        if not open_.size:
            return open_, unclear
        seen, rows = strips[open_], found.row[open_[:, None], both]
        as_found = {index: _part(place, open_) for index, place in places.items()}
        for at, index in enumerate(both):
            as_found[index] = replace(as_found[index], row=rows[:, at], sigma_rows=found.sigma_rows[open_, index])
        exchanged = {
            **as_found,
            one: replace(as_found[one], row=rows[:, 1]),
            other: replace(as_found[other], row=rows[:, 0]),
        }
        for index in sorted(both, key=self._order.index):  # each matches slightly off where the other does
            exchanged[index] = self._placed(seen, index, exchanged, near=exchanged[index].row)
        here, there = (self._drawn_by_both(seen, as_found, own, exchanged, its) for own, its in (both, both[::-1]))
        near = here | there
        left, left_exchanged = (self._left_on(seen, near, each) for each in (as_found, exchanged))
        worse = CLEARLY_WORSE**2  # for each of them
        is_untold = both in self._untold
        may_be = np.all([exchanged[index].is_likely for index in both], axis=0)
        is_swapped = may_be & (worse * left_exchanged < left) & (not is_untold)
        unclear[shows] = may_be & ~is_swapped & ((left_exchanged <= worse * left) | is_untold)
        swapped = np.flatnonzero(is_swapped)
        for index in both:
            own = _part(exchanged[index], swapped)
            matches = (own.score >= SCORE_THRESHOLD) & np.isfinite(own.sigma_rows)
            status = np.where(matches, np.where(own.visible >= WHOLE_VISIBLE, READ, EDGE), MISSING)
            found.put((open_[swapped], index), Found(status, own.row, own.sigma_rows, own.score))
            places[index] = _put(places[index], open_[swapped], own)
        return open_[swapped], unclear

    def _doubt(self, both: tuple[int, int], unsure: Indices, found: Found) -> None:
        """Read neither of two needles whose order is unclear; if they touch, both, with their distance in sigma."""
        apart_rows = np.abs(shortest(found.row[unsure, both[0]] - found.row[unsure, both[1]], self._turn_rows))
        apart = apart_rows > max(self._half_widths_rows[index] for index in both)
        found.status[unsure[apart, None], both] = MISSING
        touching = unsure[~apart, None]
        found.sigma_rows[touching, both] = np.hypot(found.sigma_rows[touching, both], apart_rows[~apart, None])

    def _doubt_lone(
        self, strips: Floats, both: tuple[int, int], places: dict[int, _Places], found: Found, before: Indices
    ) -> None:
        """Mark both needles as missing where only one is found, and that one may be the other.

        It may be the other if the other explains the dial there about as well; or clearly better, if it is thought to
        be hidden. If two look alike, it may also be the other if the dial has a residual as large as the other needle.
        """
        for own, other in (both, both[::-1]):
            lone = np.flatnonzero(np.isin(before[:, own], SEEN) & ~np.isin(before[:, other], SEEN))
            if not lone.size:
                continue
            seen, row, absent = strips[lone], found.row[lone, own], np.zeros(len(lone))
            as_found = {index: _part(place, lone) for index, place in places.items()}
            as_found[own] = replace(as_found[own], row=row, score=absent + 1.0)
            as_found[other] = replace(as_found[other], row=row, score=absent)
            instead = {**as_found, own: replace(as_found[own], score=absent)}
            instead[other] = self._placed(seen, other, instead, near=row)
            near = self._drawn_by_both(seen, as_found, own, instead, other)
            left, left_instead = (self._left_on(seen, near, each) for each in (as_found, instead))
            worse = np.where(np.isin(before[lone, other], (MISSING,)), CLEARLY_WORSE**2, CLEARLY_WORSE**-2)
            doubtful = instead[other].is_likely & (left_instead <= worse * left)
            if both in self._alike:
                doubtful |= self._leaves_much(seen, other, row, as_found)
            found.status[lone[doubtful][:, None], both] = MISSING

    def _leaves_much(self, strips: Floats, index: int, row: Floats, places: dict[int, _Places]) -> Mask:
        """(F,): whether the dial without a needle has a residual as large as what that needle would add on a row."""
        own = places[index]
        absent, there = (replace(own, row=row, score=np.full(len(strips), score)) for score in (0.0, 1.0))
        drawn = self._drawn(strips, self._order[::-1], {**places, index: absent})
        adds = self._drawn(strips, [index], {index: there}) - self._face
        much: Mask = self._comparison.times_left(strips, drawn, adds) >= HALF
        return much

    def _drawn_by_both(
        self, strips: Floats, places: dict[int, _Places], own: int, others: dict[int, _Places], its: int
    ) -> Mask:
        """(F, R): the rows that one needle's template covers as placed, and another one's in its place.

        A template may end where its needle goes on, at its hub: where only one ends, only that one seems to fit badly.
        """
        every = np.arange(strips.shape[1])
        one, other = (
            np.abs(every - placed[index].row[:, None]) <= self._axes[index]
            for placed, index in ((places, own), (others, its))
        )
        both: Mask = one & other
        return both

    def _is_better_without(self, strips: Floats, index: int, places: dict[int, _Places], found: Found) -> Mask:
        """(F,): whether the dial is explained clearly better without a needle that was found.

        Then it was found in the pixels of another: it matches these in its own light, but not in that of the dial.
        """
        shows, is_better = np.flatnonzero(np.isin(found.status[:, index], SEEN)), np.zeros(len(strips), bool)
        if not shows.size:
            return is_better
        own = {other: _part(place, shows) for other, place in places.items()}
        absent = {**own, index: replace(own[index], score=np.zeros(len(shows)))}
        is_better[shows] = self._times_worse(strips[shows], own, absent) * CLEARLY_WORSE <= 1.0
        return is_better

    def _left_on(self, strips: Floats, rows: Mask, places: dict[int, _Places]) -> Floats:
        """(F,): the part of the variance on some rows (F, R) of the dial that the needles leave unexplained."""
        drawn = self._drawn(strips, self._order[::-1], places)
        pictures = zip(drawn, strips, rows, strict=True)
        return np.array([1.0 - max(_correlation(one[own], other[own]), 0.0) ** 2 for one, other, own in pictures])

    def _reconsidered(self, strips: Floats, places: dict[int, _Places]) -> tuple[dict[int, _Places], Mask]:
        """If a needle is left over, put needles in each other's places where that explains the dial clearly better.

        Also return (F, K) which needles' places are in doubt because others explain the dial about as well.
        """
        doubtful = np.zeros((len(strips), len(self._templates)), bool)
        fits = [each.is_sure & (each.score >= SURE_SCORE) & (each.visible >= HALF) for each in places.values()]
        open_ = np.flatnonzero(~np.all(fits, axis=0))
        if not open_.size:
            return places, doubtful
        best = {index: _part(place, open_) for index, place in places.items()}
        tried = [(np.arange(len(open_)), best)]
        improved, _ = tried[0]
        for _ in self._order[1:]:  # as many exchanges put any order right
            best, improved, moved = self._improved(strips[open_], best, improved)
            tried += moved
        for which, other in tried:
            own = {index: _part(place, which) for index, place in best.items()}
            as_good = self._times_worse(strips[open_[which]], own, other) < CLEARLY_WORSE
            for index, reach_rows in enumerate(self._half_widths_rows):
                apart_rows = np.abs(shortest(own[index].row - other[index].row, self._turn_rows))
                may_be = as_good & (apart_rows > reach_rows) & (own[index].is_likely | other[index].is_likely)
                doubtful[open_[which], index] |= may_be
        every = {index: _put(place, open_, best[index]) for index, place in places.items()}
        return every, doubtful

    def _improved(
        self, strips: Floats, best: dict[int, _Places], among: Indices
    ) -> tuple[dict[int, _Places], Indices, list[tuple[Indices, dict[int, _Places]]]]:
        """Move each needle of some frames, or two of them, from their best places so far.

        Return the best places then, in which frames they are others, and all that were tried with their frames.
        """
        if not among.size:
            return best, among, []
        seen, start = strips[among], {index: _part(place, among) for index, place in best.items()}
        found, tried, is_better = start, [], np.zeros(len(among), bool)
        for move in (*((index,) for index in self._order), *permutations(self._order, 2)):
            other = self._moved(seen, start, *move)
            tried.append((among, other))
            better = self._times_worse(seen, found, other) * CLEARLY_WORSE <= 1.0
            found = {index: _merged(better, other[index], found[index]) for index in found}
            is_better |= better
        best = {index: _put(place, among, found[index]) for index, place in best.items()}
        return best, among[is_better], tried

    def _moved(
        self, strips: Floats, places: dict[int, _Places], mover: int, owner: int | None = None
    ) -> dict[int, _Places]:
        """Move one needle to its best match elsewhere; or to the place of an `owner`, and search a new one for that."""
        if owner is None:
            return {**places, mover: self._placed(strips, mover, places, beyond=places[mover].row)}
        there = replace(places[mover], row=places[owner].row, score=np.ones(len(strips)))
        moved = {**places, mover: there}
        moved[owner] = self._placed(strips, owner, moved)
        moved[mover] = self._placed(strips, mover, moved, near=there.row)
        return moved

    def _times_worse(self, strips: Floats, best: dict[int, _Places], other: dict[int, _Places]) -> Floats:
        """(F,): the residual of `other` places relative to that of the best ones, where the two drawings differ."""
        drawn = np.stack([self._drawn(strips, self._order[::-1], each) for each in (best, other)], axis=1)
        return self._comparison.times_worse(strips, drawn)[:, 0]

    def _placed(
        self,
        strips: Floats,
        index: int,
        places: dict[int, _Places],
        *,
        near: Floats | None = None,
        beyond: Floats | None = None,
    ) -> _Places:
        """Find the best places for one needle, given the others'; only `near` rows (F,), or only `beyond`, if given."""
        others = {other: place for other, place in places.items() if other != index}
        behind = self._drawn(
            strips, [o for o in reversed(self._order) if o in others and o not in self._above[index]], others
        )
        masks = np.ones(strips.shape, np.float32)
        for other in self._above[index]:
            if other in others:
                touched = self._templates[other].touched
                for frame in np.flatnonzero(others[other].is_likely).tolist():
                    row = float(others[other].row[frame])
                    masks[frame, needle_places(self._grid, touched, row, self._turn_rows)] = 0.0
        rows, scores, visible = self._searched(strips, behind, masks, index)
        under, reach_rows = self._hiding_places(rows, visible, index, others)
        allowed = self._allowed[rows]
        scores = np.where(allowed & (visible >= MIN_VISIBLE), scores, 0.0)
        half_width = self._half_widths_rows[index]
        open_ = np.ones(scores.shape, bool)
        if near is not None:
            open_ = np.abs(shortest(rows - near[:, None], self._turn_rows)) <= max(half_width, COARSE_STEP / 2)
        if beyond is not None:
            open_ = np.abs(shortest(rows - beyond[:, None], self._turn_rows)) > half_width + MAX_PEAK_ROWS
        every, best = np.arange(len(strips)), np.where(open_, scores, -1.0).argmax(axis=1)
        axis, height, windows = (
            self._axes[index],
            2 * self._axes[index] + 1,
            blocks_of(strips, 2 * self._axes[index] + 1),
        )

        def fit(open_: Indices, at: Indices, guess_rows: Floats) -> Fits:
            top = at - axis
            masked, faces = blocks_of(masks, height)[open_, top], blocks_of(behind, height)[open_, top]
            return self._fitters[index].fit(windows[open_, top], faces, guess_rows, masks=masked)

        start, top_score = rows[best].astype(np.float64), scores[every, best]
        found = settle(fit, start, (axis, strips.shape[1] - axis - 1), half_width)
        # A sliver beside another needle matches nearly anything: it is no rival of a place where more is visible.
        as_visible = np.where(visible >= np.minimum(visible[every, best], HALF)[:, None], scores, 0.0)
        rival = self._elsewhere(rows, as_visible, start, half_width + MAX_PEAK_ROWS)
        return _Places(
            row=np.where(found.is_settled, found.row, start),
            sigma_rows=np.where(found.is_settled, found.sigma_rows, np.inf),
            score=np.where(found.is_settled, found.score, np.minimum(top_score, LIKELY_SCORE)),
            visible=visible[every, best],
            rival=rival,
            under=under,
            reach_rows=reach_rows,
        )

    def _searched(self, strips: Floats, behind: Floats, masks: Floats, index: int) -> tuple[Indices, Floats, Floats]:
        """Return the searched rows (N,), and the NCC there with the visible part of the needle: (F, N) each."""
        template = self._coarse[index]
        seen, face, mask = (each[:, ::COARSE_STEP, ::COARSE_STEP] for each in (strips, behind, masks))
        scores, moments = partial_normxcorr(seen, face, template, mask)
        whole = face_moments(face, template)
        visible = moments.needle_contrast / np.maximum(whole.needle_contrast, 1e-6)
        rows = COARSE_STEP * ((template.rows - 1) // 2 + np.arange(scores.shape[1]))
        return rows, scores, visible

    def _hiding_places(
        self, rows: Indices, visible: Floats, index: int, others: dict[int, _Places]
    ) -> tuple[Indices, Floats]:
        """Return which needle above can hide this one completely, and how far apart their axes can be then."""
        under, reach_rows = np.full(len(visible), -1), np.zeros(len(visible))
        first = np.zeros(len(visible))
        shows = np.where(self._allowed[rows] & (visible >= MIN_VISIBLE), rows, np.inf)
        clash = np.zeros(len(visible), bool)
        for other in self._above[index]:
            if other not in others:
                continue
            row = others[other].row
            at = limited(np.rint((row - rows[0]) / COARSE_STEP), 0, len(rows) - 1).astype(np.intp)
            hides = others[other].is_likely & (visible[np.arange(len(visible)), at] < MIN_VISIBLE)
            reach = np.abs(shows - row[:, None]).min(axis=1)
            reach = np.where(hides, np.where(np.isfinite(reach), reach, len(self._allowed)), 0.0)
            reach_rows = np.maximum(reach_rows, reach)
            clash |= hides & (under >= 0) & (np.abs(shortest(row - first, self._turn_rows)) > reach_rows)
            first = np.where(hides & (under < 0), row, first)
            under = np.where(hides & (under < 0), other, under)
        return np.where(clash, -1, under), reach_rows

    def _elsewhere(self, rows: Indices, scores: Floats, best: Floats, reach_rows: float) -> Floats:
        """Return the highest peak of the scores (F, N) outside the best one's reach."""
        peaks = np.zeros(scores.shape, bool)
        peaks[:, 1:-1] = (scores[:, 1:-1] >= scores[:, :-2]) & (scores[:, 1:-1] >= scores[:, 2:])
        for turn in same_rows(0.0, self._turn_rows):
            peaks &= np.abs(rows - (best + turn)[:, None]) > reach_rows
        highest: Floats = scores.max(axis=1, where=peaks, initial=0.0)
        return highest

    def _drawn(self, strips: Floats, order: Sequence[int], places: dict[int, _Places]) -> Floats:
        """(F, R, C): the face with the likely needles drawn on it, the lowest first."""
        pictures = np.repeat(self._face[None], len(strips), axis=0)
        for index in order:
            template = self._templates[index]
            light, transparency = template.light, template.transparency
            for frame in np.flatnonzero(places[index].is_likely).tolist():
                row = float(places[index].row[frame])
                for same in same_rows(row, self._turn_rows):
                    _draw(pictures[frame], light, transparency, same)
                for opposite in opposite_rows(row, self._grid):
                    _draw(pictures[frame], light[:, ::-1], transparency[:, ::-1], opposite)
        return pictures

    def _found(self, strips: Floats, index: int, places: dict[int, _Places], drawn: Floats) -> Found:
        """Judge one needle's places: with all the others, it must explain the picture around it.

        Without a hidden one, the others must explain the whole dial: else it may be what they leave unexplained.
        """
        own = places[index]
        sure, covered = own.is_sure, own.under >= 0
        above = [places[other] for other in range(len(self._templates))]
        cover = [
            np.stack([getattr(each, name) for each in above]) for name in ("row", "sigma_rows", "score", "is_sure")
        ]
        row, sigma_rows, score, cover_sure = (each[own.under, np.arange(len(strips))] for each in cover)
        looked_at = np.where(sure | ~covered, own.row, row)
        explained = _explained(strips, drawn, looked_at, self._axes[index])
        read, hidden = sure & explained, ~sure & explained & covered & cover_sure & (score >= CLEAR_SCORE)
        frames = np.flatnonzero(hidden)
        if frames.size:
            others = {other: _part(place, frames) for other, place in places.items()}
            hidden[frames] = ~self._leaves_much(strips[frames], index, row[frames], others)
        status = np.where(read, np.where(own.visible >= WHOLE_VISIBLE, READ, EDGE), np.where(hidden, HIDDEN, MISSING))
        return Found(
            status,
            np.where(hidden, row, own.row),
            np.where(hidden, np.hypot(sigma_rows, own.reach_rows / math.sqrt(3.0)), own.sigma_rows),
            np.where(hidden, score, own.score),
        )


def _part(places: _Places, frames: Indices) -> _Places:
    """Return the places of some frames."""
    return _Places(*(getattr(places, each.name)[frames] for each in fields(places)))


def _put(places: _Places, frames: Indices, others: _Places) -> _Places:
    """Return places with those of some frames replaced."""
    values = {each.name: getattr(places, each.name).copy() for each in fields(places)}
    for name, own in values.items():
        own[frames] = getattr(others, name)
    return _Places(**values)


def _merged(which: Mask, these: _Places, those: _Places) -> _Places:
    """Return these places in some frames (F,), and those in the others."""
    return _Places(*(np.where(which, getattr(these, each.name), getattr(those, each.name)) for each in fields(these)))


def _likeness(one: NeedleTemplate, other: NeedleTemplate) -> float:
    """Correlate the shapes of two needles where they match best, whatever their brightness."""
    forms = [1.0 - each.transparency for each in sorted((one, other), key=lambda each: each.rows)]
    half = len(forms[0]) // 4
    middle = forms[0][half : len(forms[0]) - half]
    shifts = range(len(forms[1]) - len(middle) + 1)
    return max(_correlation(middle, forms[1][first : first + len(middle)]) for first in shifts)


def _explained(strips: Floats, drawn: Floats, rows: Floats, axis: int) -> Mask:
    """(F,): whether all needles, as placed, explain the picture around these rows."""
    windows = [slice(max(row - axis, 0), row + axis + 1) for row in np.rint(rows).astype(int).tolist()]
    parts = zip(drawn, strips, windows, strict=True)
    correlations = [_correlation(one[window], other[window]) for one, other, window in parts]
    explained: Mask = np.array(correlations) >= CLEAR_SCORE
    return explained


def _correlation(one: Floats, other: Floats) -> float:
    """Correlate two pictures; 0 if either is flat, or if there is nothing to compare."""
    if not one.size:
        return 0.0
    one, other = one - one.mean(), other - other.mean()
    spread = math.sqrt(float((one * one).sum()) * float((other * other).sum()))
    return float((one * other).sum()) / spread if spread > 0 else 0.0


def without_dial(template: NeedleTemplate, grid: PolarGrid) -> NeedleTemplate:
    """Return a template without what is beyond the needle's tip, where a first picture may include numerals."""
    covered = covers_axis(template)
    beside = ~needle_columns(grid.tail_columns, covered, covered)
    light = np.where(beside, 0.0, template.light).astype(np.float32)
    return replace(template, light=light, transparency=np.where(beside, 1.0, template.transparency).astype(np.float32))


def covers_axis(template: NeedleTemplate) -> Mask:
    """(C,): where what a template shows covers its axis."""
    axis = (template.rows - 1) // 2
    covers: Mask = 1.0 - template.transparency[axis - 1 : axis + 2].mean(axis=0) > HALF
    return covers


def needle_columns(tail_columns: int, covered: Mask, own: Mask) -> Mask:
    """(C,): which columns may be a needle's, given where its axis is `covered`, and where certainly by its `own` body.

    From the centre outwards, its columns begin after the last gap before the first own ones, and end at the next gap. A
    tail begins at the centre.
    """
    front, tail = covered[tail_columns:], covered[:tail_columns][::-1]
    return np.concatenate([_between_gaps(tail, tail)[::-1], _between_gaps(front, own[tail_columns:])])


def _between_gaps(covered: Mask, own: Mask) -> Mask:
    gaps, columns, owned = _three_in_a_row(~covered), np.arange(len(covered)), _three_in_a_row(own)
    first = int((owned if owned.size else np.append(np.flatnonzero(covered), len(covered)))[0])
    before, after = gaps[gaps < first], gaps[gaps > first]
    start = int(before[-1]) + 2 if before.size and covered[:first].any() else 0
    end = int(after[0]) + 1 if after.size else len(covered)  # the tip's own blurred edge belongs to the needle
    within: Mask = (columns >= start) & (columns < end)
    return within


def _three_in_a_row(columns: Mask) -> Indices:
    """Return where three columns follow each other; fewer are a blurred edge."""
    first: Indices = np.flatnonzero(columns[:-2] & columns[1:-1] & columns[2:])
    return first


def _draw(picture: Floats, light: Floats, transparency: Floats, row: float) -> None:
    """Draw a needle (H, C) with its axis on a row of a picture (R, C)."""
    rows = len(light)
    first = math.floor(row) - (rows - 1) // 2
    start, end = max(first, 0), min(first + rows, len(picture))
    if start < end:
        own = np.arange(start, end) - first - (row - math.floor(row))
        picture[start:end] = rows_at(transparency, own) * picture[start:end] + rows_at(light, own)
