"""Geared hands: an altimeter's or a clock's hands tell one value, and the value is what is looked for.

Every turn of the finest hand is a value that the frame may show; the gearing then says where the other hands are. So
for each direction in which the finest hand seems to point, and each number of its turns, the whole dial is drawn, and
what explains the frame best is it. A hand that is short, dim, hidden or like another one helps as far as it shows; one
that should show and does not speaks against the value. What explains the dial nearly as well with another value, or
much better with hands that do not go together, makes the value doubtful.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields
from itertools import product

import numpy as np

from decoder.imaging.thresholds import HALF
from decoder.imaging.unwrapping import PolarGrid
from decoder.instruments.found import EDGE, HIDDEN, MISSING, READ, STATUSES, Found, Needle
from decoder.instruments.kinds.dials.stack import all_above, without_dial
from decoder.instruments.reading import Reading, Status
from decoder.instruments.thresholds import CLEARLY_WORSE, SURE_SCORE
from decoder.matching.correlation import partial_normxcorr
from decoder.matching.fitting import Fits, WindowFitter, settle
from decoder.matching.layered_dial import LayeredDial, lit_as, times_worse, unexplained
from decoder.matching.needle_template import NeedleTemplate
from decoder.matching.searching import COARSE_STEP, thinned
from decoder.matching.thresholds import MAX_PEAK_ROWS, MIN_VISIBLE, WHOLE_VISIBLE
from decoder.panel.arrays import Floats, Indices, Mask
from decoder.panel.gauge import Gauge
from decoder.panel.scale import FULL_CIRCLE_DEG, Gearing, shortest
from decoder.registration.thresholds import LIKELY_SCORE, SCORE_THRESHOLD

# So many directions of the finest hand are tried, each with so many numbers of turns, and with the others anywhere.
DIRECTIONS, TURNS, ANYWHERE = 6, 8, 2
# Of these so many are judged that go together, and so many that do not.
LIKELY = 8
ROUNDS = 2
# What a hand at the end of its tolerance must score more than one where the gearing has it.
STRAY_COST = 0.15


@dataclass(frozen=True, slots=True)
class Together:
    """What hands that are geared to each other tell in F frames: each by itself, (F, K), and their value, by frame."""

    hands: Found
    values: list[Reading]


def gearing_of(gauge: Gauge) -> Gearing:
    """Return how the hands of a gauge go together whose panel combines them."""
    assert gauge.combination is not None  # noqa: S101 - nobody asks for others
    return Gearing(gauge.quantities, gauge.combination)


def told_together(gauge: Gauge, readings: Mapping[str, Reading]) -> Reading:
    """Return the value that hands tell which were read one by one, if they go together."""
    gearing = gearing_of(gauge)
    hands = [readings[name] for name in gearing.names]
    score = min(hand.score for hand in hands)
    unread = Reading(Status.MISSING, np.nan, np.inf, score)
    if any(hand.status is Status.MISSING for hand in hands):
        return unread
    angles_deg, sigmas_deg = (np.array([getattr(hand, name) for hand in hands]) for name in ("angle_deg", "sigma_deg"))
    value = gearing.counted(angles_deg)
    if not gearing.agrees(value, angles_deg, sigmas_deg, np.ones(len(hands), bool)):
        return unread
    return _reading(gearing, hands[0].status, value, gearing.sigma(0, angles_deg, sigmas_deg), score)


def _reading(gearing: Gearing, status: Status, value: float, sigma: float, score: float) -> Reading:
    """Return a value as an angle on the circle that is one turn of the coarsest hand."""
    return Reading(status, gearing.circle_deg(value), sigma * FULL_CIRCLE_DEG / gearing.turn, score)


@dataclass(frozen=True, slots=True)
class _Guesses:
    """M ways to explain one frame: the hands' rows, (M, K), and values, (M,), NaN where these do not go together."""

    rows: Floats
    values: Floats

    @property
    def is_geared(self) -> Mask:
        """(M,): whether they go together."""
        return np.isfinite(self.values)

    def part(self, which: Indices) -> _Guesses:
        """Return some of them."""
        return _Guesses(self.rows[which], self.values[which])


@dataclass(frozen=True, slots=True)
class _Placed:
    """Hands as least squares have them, each given the others, and how much of their contrast shows: (F, K) each."""

    row: Floats
    sigma_rows: Floats
    score: Floats
    visible: Floats
    is_settled: Mask

    @property
    def shows(self) -> Mask:
        """Whether what shows of it matches well enough."""
        needed = np.where(self.visible >= HALF, SCORE_THRESHOLD, SURE_SCORE)
        shows: Mask = self.is_settled & (self.visible >= MIN_VISIBLE) & (self.score >= needed)
        return shows

    @property
    def may_show(self) -> Mask:
        """Whether it matches as well as it can over another hand that is much like it."""
        may: Mask = self.is_settled & (self.visible >= HALF) & (self.score >= HALF)
        return may

    def part(self, which: Indices | int) -> _Placed:
        """Return those of some frames."""
        return _Placed(*(getattr(self, each.name)[which] for each in fields(self)))


class GearedReader:
    """Reads the hands of one gauge, all of which tell one value."""

    def __init__(self, needles: Sequence[Needle]) -> None:
        grid, names = needles[0].grid, [needle.name for needle in needles]
        self.gearing = gearing_of(needles[0].gauge)
        self._grid: PolarGrid = grid
        self._turn = round(FULL_CIRCLE_DEG / grid.step_deg)
        self._first = (grid.rows - self._turn) // 2
        self._columns = [names.index(name) for name in self.gearing.names]
        own = [needles[column] for column in self._columns]
        self._half_widths_rows = np.array([each.half_width_rows for each in own])
        self._reach_rows = self._half_widths_rows + MAX_PEAK_ROWS
        self._templates = [without_dial(each.template, grid) for each in own]
        self._coarse = [thinned(template) for template in self._templates]
        self._fitters = [WindowFitter([template], [grid.pixels_per_sample]) for template in self._templates]
        depth = [len(all_above(needles, names, column)) for column in self._columns]
        self._order = sorted(range(len(own)), key=lambda hand: -depth[hand])  # the lowest first
        self._whole_face, face = needles[0].face, self._once_around(needles[0].face)
        layers = [self._templates[hand] for hand in self._order]
        self._axes = [_axis(template, face)[::COARSE_STEP] for template in self._templates]
        self._thin, self._dial = LayeredDial(face, layers, COARSE_STEP), LayeredDial(face, layers)

    @property
    def name(self) -> str:
        """Of the value."""
        return self.gearing.name

    @property
    def share(self) -> float:
        """What part of the value's circle one of the finest hand's is."""
        return self.gearing.share

    def read(self, strips: Floats) -> Together:
        """Find the hands on a gauge in F frames, (F, R, C) float32, in the panel's order, and their value."""
        scores = [self._scores(strips, template) for template in self._coarse]
        dials = self._once_around(strips)
        tried = [self._tried([own[frame] for own in scores]) for frame in range(len(strips))]
        likely = [self._likely(dial, guesses) for dial, guesses in zip(dials, tried, strict=True)]
        guessed = np.array([guesses.rows[0] for guesses in likely])
        placed = self._settled(dials, guessed)
        hands = Found.missing((len(strips), len(self._columns)))
        values = []
        for frame, own in enumerate(zip(dials, likely, strict=True)):
            found, value = self._judged(*own, placed.part(frame))
            for which, column in enumerate(self._columns):
                hands.put((np.array([frame]), column), found.part(np.array([which])))
            values.append(value)
        return Together(hands, values)

    def _once_around(self, strips: Floats) -> Floats:
        """(..., N, C'): gauges (..., R, C) once around, from the centre outwards."""
        around: Floats = strips[..., self._first : self._first + self._turn, self._grid.tail_columns :]
        return around

    def _angles_deg(self, rows: Floats) -> Floats:
        angles: Floats = self._grid.start_deg + (self._first + rows) * self._grid.step_deg
        return angles

    def _rows(self, angles_deg: Floats) -> Floats:
        rows: Floats = ((angles_deg - self._grid.start_deg) / self._grid.step_deg - self._first) % self._turn
        return rows

    def _scores(self, strips: Floats, template: NeedleTemplate) -> Floats:
        """(F, N'): how well a hand matches on every third row."""
        axis = (template.rows - 1) // 2
        rows = COARSE_STEP * np.arange(-axis, self._turn // COARSE_STEP + axis) % self._turn + self._first
        seen, face = strips[:, rows, ::COARSE_STEP], self._whole_face[rows, ::COARSE_STEP]
        scores, _ = partial_normxcorr(np.ascontiguousarray(seen), np.ascontiguousarray(face), template)
        return scores

    def _tried(self, scores: Sequence[Floats]) -> _Guesses:
        """Return the ways to explain one frame that the hands' scores, (N',) each, suggest."""
        finest, *others = scores
        directions = _refined(finest, _peaks(finest)[:DIRECTIONS])
        values = self.gearing.values(self._angles_deg(directions))
        places, total = [np.repeat(directions[:, None], values.shape[1], axis=1)], np.zeros(values.shape)
        for hand, own in enumerate(others, 1):
            place, score = self._near(own, self._rows(self.gearing.angles_deg(hand, values.ravel())), hand)
            places.append(place.reshape(values.shape))
            total += np.maximum(score, 0.0).reshape(values.shape) ** 2
        top = np.argsort(-total, axis=1, kind="stable")[:, :TURNS]
        geared = np.stack([np.take_along_axis(place, top, axis=1).ravel() for place in places], axis=1)
        anywhere = [_refined(own, _peaks(own)[:ANYWHERE]) for own in others]
        free = np.array(list(product(directions, *anywhere)))
        told = np.take_along_axis(values, top, axis=1).ravel()
        return _Guesses(np.concatenate([geared, free]), np.concatenate([told, np.full(len(free), np.nan)]))

    def _near(self, scores: Floats, rows: Floats, hand: int) -> tuple[Floats, Floats]:
        """Where a hand matches best near rows (T,), and how well, less what it strays; (T,) each."""
        slack = self.gearing.tolerance_deg(hand) / self._grid.step_deg / COARSE_STEP
        off = np.arange(-np.ceil(slack), np.ceil(slack) + 1).astype(np.intp)
        middle = rows / COARSE_STEP
        around = np.rint(middle).astype(np.intp)[:, None] + off
        there = scores[around % len(scores)] - STRAY_COST * np.minimum((around - middle[:, None]) / slack, 1.0) ** 2
        best = there.argmax(axis=1)
        every = np.arange(len(rows))
        place = _refined(scores, _climbed(scores, around[every, best] % len(scores))) / COARSE_STEP
        stray = np.clip(shortest(place - middle, len(scores)), -slack, slack)
        return COARSE_STEP * (middle + stray), there[every, best]

    def _likely(self, dial: Floats, guesses: _Guesses) -> _Guesses:
        """Return the guesses that explain a frame best, first the best, and of those that go together and not.

        Hands that do not go together must explain it clearly better to be the best.
        """
        seen = self._thin.thinned(dial)
        pictures = self._thin.drawn(guesses.rows[:, self._order])
        left = unexplained(seen, pictures)
        geared = int(np.where(guesses.is_geared, left, np.inf).argmin())
        free = int(np.where(guesses.is_geared, np.inf, left).argmin())
        best, *rest = lit_as(seen, pictures[[free, geared]])
        worse = float(times_worse(seen, best, np.array(rest))[0])
        apart = np.abs(shortest(guesses.rows[free] - guesses.rows[geared], self._turn)) > self._reach_rows
        best = free if apart.any() and worse > CLEARLY_WORSE else geared
        left[best] = -1.0
        order = np.argsort(left, kind="stable")
        is_geared = guesses.is_geared[order]
        return guesses.part(
            np.concatenate([order[is_geared == first][:LIKELY] for first in (is_geared[0], not is_geared[0])])
        )

    def _settled(self, dials: Floats, rows: Floats) -> _Placed:
        """Fit all hands in F frames, from rows (F, K) on, each given the others, from the uppermost down."""
        rows = rows.copy()
        placed: dict[int, _Placed] = {}
        for _ in range(ROUNDS):
            for layer in range(len(self._order) - 1, -1, -1):
                hand = self._order[layer]
                placed[hand] = self._fitted(dials, rows, layer)
                rows[:, hand] = placed[hand].row
        by_hand = [placed[hand] for hand in range(len(placed))]
        return _Placed(*(np.stack([getattr(own, each.name) for own in by_hand], axis=1) for each in fields(_Placed)))

    def _fitted(self, dials: Floats, rows: Floats, layer: int) -> _Placed:
        """Fit one hand, given those below and above it: (F,) each."""
        hand = self._order[layer]
        template, drawn_rows = self._templates[hand], rows[:, self._order]
        behind = self._dial.drawn(drawn_rows, range(layer))
        clear = self._dial.left_bare(drawn_rows, range(layer + 1, len(self._order))) >= WHOLE_VISIBLE
        masks, axis = clear.astype(np.float32), (template.rows - 1) // 2

        def fit(open_: Indices, at: Indices, guess_rows: Floats) -> Fits:
            seen, back, mask = (self._windows(each, open_, at - axis, template) for each in (dials, behind, masks))
            return self._fitters[hand].fit(seen, back, guess_rows, masks=mask)

        found = settle(fit, rows[:, hand], (-self._turn, 2 * self._turn), self._reach_rows[hand])
        row = np.where(found.is_settled, found.row, rows[:, hand])
        every, top = np.arange(len(rows)), np.rint(row).astype(np.intp) - axis
        back, mask = (self._windows(each, every, top, template) for each in (behind, masks))
        own = template.light.ravel() + (template.transparency.ravel() - 1.0) * back
        contrast = template.trust.ravel() * own**2
        visible = (contrast * mask).sum(axis=1) / np.maximum(contrast.sum(axis=1), 1e-6)
        return _Placed(row, found.sigma_rows, np.nan_to_num(found.score), visible, found.is_settled)

    def _windows(self, dials: Floats, which: Indices, top_rows: Indices, template: NeedleTemplate) -> Floats:
        """(M, H * C): some of the dials, (F, N, C'), around rows of their own."""
        rows = (top_rows[:, None] + np.arange(template.rows)) % self._turn
        seen = dials[which[:, None], rows]
        if self._grid.tail_columns:
            across = dials[which[:, None], (rows + self._turn // 2) % self._turn, ::-1]
            seen = np.concatenate([across, seen], axis=2)
        windows: Floats = seen.reshape(len(which), -1)
        return windows

    def _judged(self, dial: Floats, guesses: _Guesses, placed: _Placed) -> tuple[Found, Reading]:
        """Judge one frame's hands, the first guess, and their value, by what else would explain the dial."""
        guessed, value = guesses.rows[0], float(guesses.values[0])
        off_rows = np.abs(shortest(guesses.rows - guessed, self._turn))
        others = np.where(off_rows <= MAX_PEAK_ROWS, placed.row, guesses.rows)
        seen_dial = self._thin.thinned(dial)
        is_rival = self._rivals(seen_dial, placed.row, others)
        shows = placed.shows & ~(is_rival[:, None] & (off_rows > self._reach_rows)).any(axis=0)
        # The finest hand over another that is much like it: it is there, but not to the fraction of a row.
        merged = not shows[0] and bool(placed.may_show[0]) and self._is_beside_others(placed.row)
        sigma_rows = placed.sigma_rows.copy()
        sigma_rows[0] = np.hypot(sigma_rows[0], self._half_widths_rows[0] * merged)
        angles_deg, sigmas_deg = self._angles_deg(placed.row), sigma_rows * self._grid.step_deg
        reach = self._reach_rows[0] / self._turn * self.gearing.turns[0]
        other = is_rival & (np.abs(shortest(guesses.values - value, self.gearing.turn)) > reach)
        is_sure = bool(np.isfinite(value)) and bool(shows[0] or merged) and not other.any()
        if is_sure:
            value = self.gearing.measured(0, angles_deg, value)
            is_sure = self.gearing.agrees(value, angles_deg, sigmas_deg, shows)
        status = np.where(shows, np.where(placed.visible >= WHOLE_VISIBLE, READ, EDGE), MISSING)
        status[0], seen = EDGE if merged else status[0], shows | np.array([merged, *shows[1:]])
        found = Found(status, placed.row % self._turn + self._first, sigma_rows, placed.score)
        if is_sure:
            found = found.instead(~seen, self._hidden(value, placed.score))
            if self._adds_up(seen_dial, found.row - self._first):
                sigma, score = (
                    self.gearing.sigma(0, angles_deg, sigmas_deg),
                    float(placed.score[seen].min()),
                )
                return found, _reading(self.gearing, STATUSES[status[0]], value, sigma, score)
        return found, Reading(Status.MISSING, np.nan, np.inf, float(placed.score.min()))

    def _rivals(self, seen: Floats, rows: Floats, others: Floats) -> Mask:
        """(M,): which other rows, (M, K), explain a thinned dial nearly as well as its own, (K,)."""
        best, *rest = lit_as(seen, self._thin.drawn(np.vstack([rows, others])[:, self._order]))
        return times_worse(seen, best, np.array(rest)) <= CLEARLY_WORSE

    def _adds_up(self, seen: Floats, rows: Floats) -> bool:
        """Whether no hand on these rows, (K,), is clearly better left out, and nothing like a hand is left."""
        every = rows[self._order]
        drawn = self._thin.drawn(np.vstack([every, np.where(np.eye(len(every), dtype=bool), np.nan, every)]))
        best, *rest = lit_as(seen, drawn)
        if times_worse(seen, best, np.array(rest)).min() < MIN_VISIBLE:
            return False
        gain = float(best.std()) / max(float(drawn[0].std()), 1e-6)
        return self._left_over((seen - best) / max(gain, 1e-6), rows) < LIKELY_SCORE

    def _left_over(self, left: Floats, rows: Floats) -> float:
        """How much of a hand's contrast is left of a dial, (N', C'), where none of the hands is."""
        there = COARSE_STEP * np.arange(len(left))
        away = (np.abs(shortest(there[:, None] - rows, self._turn)) > self._reach_rows).all(axis=1)
        spread = np.maximum(np.sqrt((left * left).sum(axis=1)), 1e-6)
        most = 0.0
        for axis, half_width in zip(self._axes, self._half_widths_rows, strict=True):
            size = max(float(np.sqrt(axis @ axis)), 1e-6)
            part, like = left @ axis / size**2, left @ axis / size / spread
            wide = max(1, round(half_width / COARSE_STEP))
            part = np.convolve(np.pad(part, wide, mode="wrap"), np.ones(wide) / wide, "same")[wide:-wide]
            most = max(most, float(part.max(where=away & (like >= LIKELY_SCORE), initial=0.0)))
        return most

    def _is_beside_others(self, rows: Floats) -> bool:
        """Whether the finest hand lies over, under or right beside another one."""
        apart = np.abs(shortest(rows[1:] - rows[0], self._turn))
        return bool((apart <= self._half_widths_rows[0] + self._reach_rows[1:]).any())

    def _hidden(self, value: float, score: Floats) -> Found:
        """Return the hands where the value has them, give or take what the panel allows."""
        hands = range(len(score))
        rows = [float(self._rows(self.gearing.angles_deg(hand, np.array([value])))[0]) for hand in hands]
        slack_rows = np.array([self.gearing.tolerance_deg(hand) for hand in hands]) / self._grid.step_deg
        return Found(np.full(len(score), HIDDEN), np.array(rows) + self._first, slack_rows / np.sqrt(3.0), score)


def _axis(template: NeedleTemplate, face: Floats) -> Floats:
    """(C,): what a hand adds along its axis to what a dial (N, C) mostly shows."""
    own = slice(-face.shape[1], None)
    middle = (template.rows - 1) // 2
    added: Floats = template.light[middle, own] + (template.transparency[middle, own] - 1.0) * np.median(face, axis=0)
    return added


def _peaks(scores: Floats) -> Indices:
    """Where scores around a dial, (N,), are higher than beside it, the highest first; at least one."""
    peaks = np.flatnonzero((scores >= np.roll(scores, 1)) & (scores > np.roll(scores, -1)))
    peaks = peaks if peaks.size else np.zeros(1, np.intp)
    ordered: Indices = peaks[np.argsort(-scores[peaks], kind="stable")]
    return ordered


def _climbed(scores: Floats, at: Indices) -> Indices:
    """Go from some rows to the highest of their own scores and those beside them."""
    around = (at[:, None] + np.array([0, -1, 1])) % len(scores)
    climbed: Indices = around[np.arange(len(at)), scores[around].argmax(axis=1)]
    return climbed


def _refined(scores: Floats, at: Indices) -> Floats:
    """Rows of the dial at which parabolas through scores around some have their peaks."""
    before, here, after = (scores[(at + step) % len(scores)].astype(np.float64) for step in (-1, 0, 1))
    bend = before - 2 * here + after
    off = np.divide(0.5 * (before - after), bend, out=np.zeros_like(bend), where=bend < 0)
    rows: Floats = COARSE_STEP * (at + np.clip(off, -0.5, 0.5))
    return rows
