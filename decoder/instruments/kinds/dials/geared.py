"""Geared hands: the hands of an altimeter or a clock show one value, so the search is for that value.

Each direction in which the finest hand may point, with each number of its turns, gives a candidate value, and the
gearing says where the other hands are at that value. The whole dial is drawn for each candidate, and the one that
explains the frame best is read. A hand that is short, dim, hidden or like another one contributes as much as it shows;
one that should show and does not counts against the value. If another value explains the dial nearly as well, or hands
that contradict the gearing explain it much better, the value is doubtful.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields

import numpy as np

from decoder.imaging.thresholds import HALF
from decoder.imaging.unwrapping import PolarGrid
from decoder.instruments.found import EDGE, HIDDEN, MISSING, READ, STATUSES, Found, Needle, all_above
from decoder.instruments.reading import Reading, Status
from decoder.instruments.thresholds import CLEARLY_WORSE, SURE_SCORE
from decoder.matching.correlation import partial_normxcorr
from decoder.matching.layered_dial import DialComparison, LayeredDial, axis_of
from decoder.matching.needle_fit import Fits, WindowFitter, settle
from decoder.matching.needle_search import COARSE_STEP, thinned
from decoder.matching.needle_template import NeedleTemplate
from decoder.matching.thresholds import MAX_PEAK_ROWS, MIN_VISIBLE, WHOLE_VISIBLE
from decoder.panel.arrays import Floats, Indices, Mask
from decoder.panel.gauge import Gauge
from decoder.panel.scale import FULL_CIRCLE_DEG, Gearing, shortest
from decoder.registration.thresholds import LIKELY_SCORE, SCORE_THRESHOLD

# The number of directions of the finest hand that are tried, of turns for each, and of free peaks of each hand.
DIRECTIONS, TURNS, ANYWHERE = 6, 8, 2
# How many guesses that obey the gearing are judged, and how many that do not.
LIKELY = 8
ROUNDS = 2
# Score penalty for a hand at the end of its tolerance.
STRAY_COST = 0.15


@dataclass(frozen=True, slots=True)
class Together:
    """Geared hands as read in F frames: each hand by itself, (F, K), and their common value for each frame."""

    hands: Found
    values: list[Reading]


def gearing_of(gauge: Gauge) -> Gearing:
    """Return the gearing of a gauge whose panel combines its hands."""
    assert gauge.gearing is not None  # noqa: S101 - only called for gauges with a combination
    return gauge.gearing


def told_together(gauge: Gauge, readings: Mapping[str, Reading]) -> Reading:
    """Return the value of hands that were read one by one; missing if they contradict the gearing."""
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
    return _reading(gearing, hands[0].status, float(value), float(gearing.sigma(0, angles_deg, sigmas_deg)), score)


def _reading(gearing: Gearing, status: Status, value: float, sigma: float, score: float) -> Reading:
    """Return a value as an angle on a circle that is one turn of the coarsest hand."""
    return Reading(status, gearing.circle_deg(value), sigma * FULL_CIRCLE_DEG / gearing.turn, score)


@dataclass(frozen=True, slots=True)
class Guesses:
    """M ways to explain each frame: the hands' rows (..., M, K), and values (..., M), NaN where hands disagree."""

    rows: Floats
    values: Floats

    def part(self, which: Indices | int) -> Guesses:
        """Return some of them."""
        return Guesses(self.rows[which], self.values[which])


@dataclass(frozen=True, slots=True)
class Placed:
    """Hands as fitted, each given the others, and how much of their contrast is visible: (F, K) each."""

    row: Floats
    sigma_rows: Floats
    score: Floats
    visible: Floats
    is_settled: Mask

    @property
    def shows(self) -> Mask:
        """Whether the visible part matches well enough."""
        needed = np.where(self.visible >= HALF, SCORE_THRESHOLD, SURE_SCORE)
        shows: Mask = self.is_settled & (self.visible >= MIN_VISIBLE) & (self.score >= needed)
        return shows

    @property
    def may_show(self) -> Mask:
        """Whether it matches as well as can be expected over another hand that looks much like it."""
        may: Mask = self.is_settled & (self.visible >= HALF) & (self.score >= HALF)
        return may


class GearedReader:
    """Reads the hands of one gauge, all of which show one value."""

    def __init__(self, needles: Sequence[Needle], gearing: Gearing | None = None) -> None:
        grid, names = needles[0].grid, [needle.name for needle in needles]
        self.gearing = gearing or gearing_of(needles[0].gauge)
        self._grid: PolarGrid = grid
        self._turn = round(FULL_CIRCLE_DEG / grid.step_deg)
        self._first = (grid.rows - self._turn) // 2
        self._columns = [names.index(name) for name in self.gearing.names]
        own = [needles[column] for column in self._columns]
        self._half_widths_rows = np.array([each.half_width_rows for each in own])
        self._reach_rows = self._half_widths_rows + MAX_PEAK_ROWS
        self._templates = [each.template for each in own]
        self._coarse = [thinned(template) for template in self._templates]
        self._fitters = [WindowFitter([template], [grid.pixels_per_sample]) for template in self._templates]
        depth = [len(all_above(needles, names, column)) for column in self._columns]
        self._order = sorted(range(len(own)), key=lambda hand: -depth[hand])  # the lowest first
        self._whole_face, face = needles[0].face, self._once_around(needles[0].face)
        layers = [self._templates[hand] for hand in self._order]
        self._axes = [axis_of(template, face)[::COARSE_STEP] for template in self._templates]
        self._thin, self._dial = LayeredDial(face, layers, COARSE_STEP), LayeredDial(face, layers)
        radii_px = grid.radii_px[grid.tail_columns :]
        self._comparison = DialComparison(self._thin.face, radii_px[::COARSE_STEP], [thinned(each) for each in layers])

    @property
    def name(self) -> str:
        """The name of the value."""
        return self.gearing.name

    @property
    def share(self) -> float:
        """The ratio of one turn of the finest hand to the value's whole circle."""
        return self.gearing.share

    def read(self, strips: Floats) -> Together:
        """Find the hands on a gauge in F frames, (F, R, C) float32, in the panel's order, and their value."""
        tried = self._tried([self._scores(strips, template) for template in self._coarse])
        dials = self._once_around(strips)
        thin = self._thin.thinned(dials)
        likely = [self._likely(dial, tried.part(frame)) for frame, dial in enumerate(thin)]
        guesses = Guesses(*(np.stack([getattr(own, each.name) for own in likely]) for each in fields(Guesses)))
        return self._judged(thin, guesses, self._settled(dials, guesses.rows[:, 0]))

    def _once_around(self, strips: Floats) -> Floats:
        """(..., N, C'): one turn of gauges (..., R, C), from the centre outwards."""
        around: Floats = strips[..., self._first : self._first + self._turn, self._grid.tail_columns :]
        return around

    def _angles_deg(self, rows: Floats) -> Floats:
        angles: Floats = self._grid.start_deg + (self._first + rows) * self._grid.step_deg
        return angles

    def _rows(self, angles_deg: Floats) -> Floats:
        rows: Floats = (angles_deg - self._grid.start_deg) / self._grid.step_deg - self._first
        return rows

    def _scores(self, strips: Floats, template: NeedleTemplate) -> Floats:
        """(F, N'): the NCC of a hand on every third row."""
        axis = (template.rows - 1) // 2
        rows = COARSE_STEP * np.arange(-axis, self._turn // COARSE_STEP + axis) % self._turn + self._first
        seen, face = strips[:, rows, ::COARSE_STEP], self._whole_face[rows, ::COARSE_STEP]
        scores, _ = partial_normxcorr(np.ascontiguousarray(seen), np.ascontiguousarray(face), template)
        return scores

    def _tried(self, scores: Sequence[Floats]) -> Guesses:
        """Return guesses for F frames from the hands' scores, (F, N') each: first those that are geared, by score."""
        finest, *others = scores
        directions = _refined(finest, _peaks(finest, DIRECTIONS))
        values = self.gearing.values(self._angles_deg(directions))
        middles = [self._rows(self.gearing.angles_deg(hand, values)) / COARSE_STEP for hand in range(1, len(scores))]
        near = [self._near(own, hand) for hand, own in enumerate(others, 1)]
        total = np.zeros(values.shape) + np.maximum(_at(finest, directions / COARSE_STEP), 0.0)[..., None] ** 2
        for middle, (score, _) in zip(middles, near, strict=True):
            total += np.maximum(_at(score, middle), 0.0) ** 2
        top = np.argsort(-total, axis=-1, kind="stable")[..., :TURNS]
        values, total = (np.take_along_axis(each, top, axis=-1) for each in (values, total))
        middles = [np.take_along_axis(each, top, axis=-1) for each in middles]
        geared = [np.broadcast_to(directions[..., None], top.shape)]
        for hand, (middle, (_, place)) in enumerate(zip(middles, near, strict=True), 1):
            slack = self._slack(hand)
            stray = np.clip(shortest(_at(place, middle) - middle, place.shape[-1]), -slack, slack)
            geared.append(COARSE_STEP * (middle + stray) % self._turn)
        anywhere = [directions, *(_refined(own, _peaks(own, ANYWHERE)) for own in others)]
        frames = len(directions)
        free = np.stack([own.reshape(frames, -1) for own in np.broadcast_arrays(*_each_with_each(anywhere))], axis=-1)
        best = np.argsort(-total.reshape(frames, -1), axis=1, kind="stable")
        together = np.stack(geared, axis=-1).reshape(frames, -1, len(scores))
        rows = np.concatenate([np.take_along_axis(together, best[..., None], axis=1), free], axis=1)
        told = np.take_along_axis(values.reshape(frames, -1), best, axis=1)
        return Guesses(rows, np.concatenate([told, np.full(free.shape[:2], np.nan)], axis=1))

    def _slack(self, hand: int) -> float:
        """How many coarse rows a hand may be from where the next finer one puts it."""
        return self.gearing.tolerance_deg(hand) / self._grid.step_deg / COARSE_STEP

    def _near(self, scores: Floats, hand: int) -> tuple[Floats, Floats]:
        """(F, N') each: the best score of a hand near each coarse row, less its stray cost, and the row of it."""
        slack = self._slack(hand)
        off = np.arange(-np.ceil(slack), np.ceil(slack) + 1).astype(np.intp)
        around = (np.arange(scores.shape[1])[:, None] + off) % scores.shape[1]
        there = scores[:, around] - STRAY_COST * np.minimum(off / slack, 1.0) ** 2
        best = there.argmax(axis=-1)
        at = np.take_along_axis(around[None], best[..., None], axis=-1)[..., 0]
        return np.take_along_axis(there, best[..., None], axis=-1)[..., 0], _refined(
            scores, _climbed(scores, at)
        ) / COARSE_STEP

    def _likely(self, seen: Floats, guesses: Guesses) -> Guesses:
        """Return the guesses that explain a thinned dial best, best first, some that obey the gearing and some not.

        Hands that contradict the gearing must explain it clearly better to come first.
        """
        pictures = self._drawn(guesses.rows)
        left, is_geared = self._comparison.unexplained(seen, pictures), np.isfinite(guesses.values)
        geared = int(np.where(is_geared, left, np.inf).argmin())
        free = int(np.where(is_geared, np.inf, left).argmin())
        worse = float(self._comparison.times_worse(seen, pictures[[free, geared]])[0])
        apart = np.abs(shortest(guesses.rows[free] - guesses.rows[geared], self._turn)) > self._reach_rows
        best = free if apart.any() and worse > CLEARLY_WORSE else geared
        left[best] = -1.0
        order = np.argsort(left, kind="stable")
        is_geared = is_geared[order]
        return guesses.part(
            np.concatenate([order[is_geared == first][:LIKELY] for first in (is_geared[0], not is_geared[0])])
        )

    def _settled(self, dials: Floats, rows: Floats) -> Placed:
        """Fit all hands in F frames from starting rows (F, K), each given the others, from the uppermost down."""
        rows = rows.copy()
        placed: dict[int, Placed] = {}
        for _ in range(ROUNDS):
            for layer in range(len(self._order) - 1, -1, -1):
                hand = self._order[layer]
                placed[hand] = self._fitted(dials, rows, layer)
                rows[:, hand] = placed[hand].row
        by_hand = [placed[hand] for hand in range(len(placed))]
        return Placed(*(np.stack([getattr(own, each.name) for own in by_hand], axis=1) for each in fields(Placed)))

    def _fitted(self, dials: Floats, rows: Floats, layer: int) -> Placed:
        """Fit one hand given those below and above it: (F,) each."""
        hand = self._order[layer]
        template, drawn_rows = self._templates[hand], rows[:, self._order]
        behind, masks = self._around(drawn_rows, layer)
        axis = (template.rows - 1) // 2

        def fit(open_: Indices, at: Indices, guess_rows: Floats) -> Fits:
            seen, back, mask = (self._windows(each, open_, at - axis, template) for each in (dials, behind, masks))
            return self._fitters[hand].fit(seen, back, guess_rows, masks=mask)

        found = settle(fit, rows[:, hand], (-self._turn, 2 * self._turn), self._reach_rows[hand])
        row = np.where(found.is_settled, found.row, rows[:, hand])
        visible = self._visible_part(row, layer, behind, masks)
        return Placed(row, found.sigma_rows, np.nan_to_num(found.score), visible, found.is_settled)

    def _around(self, drawn_rows: Floats, layer: int) -> tuple[Floats, Floats]:
        """(F, N, C') each: what lies behind a hand, and where none lies over it; hands on rows (F, K), lowest first."""
        behind = self._dial.drawn(drawn_rows, range(layer))
        clear = self._dial.left_bare(drawn_rows, range(layer + 1, len(self._order))) >= WHOLE_VISIBLE
        return behind, clear.astype(np.float32)

    def _visible(self, rows: Floats, layer: int) -> Floats:
        """(F,): the visible part of a hand's contrast, with all hands on rows (F, K)."""
        return self._visible_part(rows[:, self._order[layer]], layer, *self._around(rows[:, self._order], layer))

    def _visible_part(self, row: Floats, layer: int, behind: Floats, masks: Floats) -> Floats:
        """(F,): the visible part of a hand's contrast on given rows, with what lies behind it and is not over it."""
        template, every = self._templates[self._order[layer]], np.arange(len(row))
        top = np.rint(row).astype(np.intp) - (template.rows - 1) // 2
        back, mask = (self._windows(each, every, top, template) for each in (behind, masks))
        own = template.light.ravel() + (template.transparency.ravel() - 1.0) * back
        contrast = template.trust.ravel() * own**2
        visible: Floats = (contrast * mask).sum(axis=1) / np.maximum(contrast.sum(axis=1), 1e-6)
        return visible

    def _windows(self, dials: Floats, which: Indices, top_rows: Indices, template: NeedleTemplate) -> Floats:
        """(M, H * C): windows of the chosen dials, (F, N, C'), each from its own top row."""
        rows = (top_rows[:, None] + np.arange(template.rows)) % self._turn
        seen = dials[which[:, None], rows]
        if self._grid.tail_columns:
            across = dials[which[:, None], (rows + self._turn // 2) % self._turn, ::-1]
            seen = np.concatenate([across, seen], axis=2)
        windows: Floats = seen.reshape(len(which), -1)
        return windows

    def _judged(self, seen: Floats, guesses: Guesses, placed: Placed) -> Together:
        """Judge the hands of F thinned dials (F, N', C') and their values by what else would explain the dials.

        The first guess of each frame is the one that was fitted.
        """
        off_rows = np.abs(shortest(guesses.rows - guesses.rows[:, :1], self._turn))
        others = np.where(off_rows <= MAX_PEAK_ROWS, placed.row[:, None], guesses.rows)
        is_rival = self._rivals(seen, placed.row, others)
        shows = placed.shows & ~(is_rival[..., None] & (off_rows > self._reach_rows)).any(axis=1)
        # The finest hand over another one much like it: it is there, but not located to a fraction of a row.
        merged = ~shows[:, 0] & placed.may_show[:, 0] & self._is_beside_others(placed.row)
        sigma_rows = placed.sigma_rows.copy()
        sigma_rows[merged, 0] = np.hypot(sigma_rows[merged, 0], self._half_widths_rows[0])
        status = np.where(shows, np.where(placed.visible >= WHOLE_VISIBLE, READ, EDGE), MISSING)
        status[merged, 0], shows[merged, 0] = EDGE, True
        angles_deg, sigmas_deg = self._angles_deg(placed.row), sigma_rows * self._grid.step_deg

        reach = self._reach_rows[0] / self._turn * self.gearing.turns[0]
        is_other = is_rival & (np.abs(shortest(guesses.values - guesses.values[:, :1], self.gearing.turn)) > reach)
        values = self.gearing.measured(0, angles_deg, guesses.values[:, 0])
        is_sure = np.isfinite(values) & shows[:, 0] & ~is_other.any(axis=1)
        is_sure &= self.gearing.agrees(values, angles_deg, sigmas_deg, shows)
        found = Found(status, placed.row % self._turn + self._first, sigma_rows, placed.score)
        found = found.instead(is_sure[:, None] & ~shows, self._hidden(values, placed.score))
        is_sure &= self._adds_up(seen, found.row - self._first)
        # No other hand counts the turns of the coarsest: where it does not show, something must lie over it.
        coarsest = self._order.index(len(self._order) - 1)
        is_sure &= shows[:, -1] | (self._visible(found.row - self._first, coarsest) < HALF)

        values = np.where(is_sure, values, np.nan)
        sigmas = np.where(is_sure, self.gearing.sigma(0, angles_deg, sigmas_deg), np.inf)
        scores = np.where(shows | ~is_sure[:, None], placed.score, np.inf).min(axis=1)
        told = zip(np.where(is_sure, status[:, 0], MISSING), *_lists(values, sigmas, scores), strict=True)
        hands = found.part((slice(None), np.argsort(self._columns)))
        return Together(hands, [_reading(self.gearing, STATUSES[own], *rest) for own, *rest in told])

    def _drawn(self, rows: Floats) -> Floats:
        """(..., N', C'): the thinned dial with its hands on rows (..., K); NaN leaves a hand out."""
        drawn = self._thin.drawn(rows.reshape(-1, rows.shape[-1])[:, self._order])
        return drawn.reshape(*rows.shape[:-1], *drawn.shape[1:])

    def _rivals(self, seen: Floats, rows: Floats, others: Floats) -> Mask:
        """(F, M): which other rows, (F, M, K), explain thinned dials nearly as well as the fitted ones, (F, K)."""
        every = np.concatenate([rows[:, None], others], axis=1)
        # drawings of all frames at once would not fit the cache
        worse = [self._comparison.times_worse(dial, self._drawn(own)) for dial, own in zip(seen, every, strict=True)]
        return np.stack(worse) <= CLEARLY_WORSE

    def _adds_up(self, seen: Floats, rows: Floats) -> Mask:
        """(F,): whether every hand on these rows (F, K) is needed, and nothing like a hand is left over."""
        without = np.where(np.eye(rows.shape[1], dtype=bool), np.nan, rows[:, None])
        drawn = self._drawn(np.concatenate([rows[:, None], without], axis=1))
        is_needed = self._comparison.times_worse(seen, drawn).min(axis=1) >= MIN_VISIBLE
        lit = self._comparison.lit(seen, drawn[:, :1])[:, 0]
        gain = lit.std(axis=(1, 2)) / np.maximum(drawn[:, 0].std(axis=(1, 2)), 1e-6)
        left = (seen - lit) / np.maximum(gain, 1e-6)[:, None, None]
        adds_up: Mask = is_needed & (self._left_over(left, rows) < LIKELY_SCORE)
        return adds_up

    def _left_over(self, left: Floats, rows: Floats) -> Floats:
        """(F,): the largest part of a hand's contrast that dials (F, N', C') show away from all hands (F, K)."""
        there = COARSE_STEP * np.arange(left.shape[1])
        away = (np.abs(shortest(there[:, None] - rows[:, None], self._turn)) > self._reach_rows).all(axis=-1)
        spread = np.maximum(np.sqrt(np.vecdot(left, left)), 1e-6)
        most = np.zeros(len(left))
        for axis, half_width in zip(self._axes, self._half_widths_rows, strict=True):
            size, own = max(float(np.sqrt(axis @ axis)), 1e-6), np.vecdot(left, axis)
            wide = max(1, round(half_width / COARSE_STEP))
            part = (
                np.mean([np.roll(own, step, axis=1) for step in range(-(wide // 2), (wide + 1) // 2)], axis=0) / size**2
            )
            like = own / size / spread
            most = np.maximum(most, part.max(axis=1, where=away & (like >= LIKELY_SCORE), initial=0.0))
        return most

    def _is_beside_others(self, rows: Floats) -> Mask:
        """(F,): whether the finest hand lies over, under or right beside another one."""
        apart = np.abs(shortest(rows[:, 1:] - rows[:, :1], self._turn))
        beside: Mask = (apart <= self._half_widths_rows[0] + self._reach_rows[1:]).any(axis=1)
        return beside

    def _hidden(self, values: Floats, scores: Floats) -> Found:
        """Return the hands where the gearing puts them for values (F,), within the panel's tolerance."""
        hands = range(scores.shape[1])
        rows = np.stack([self._rows(self.gearing.angles_deg(hand, values)) for hand in hands], axis=1) % self._turn
        slack_rows = np.array([self.gearing.tolerance_deg(hand) for hand in hands]) / self._grid.step_deg
        sigmas_rows = np.broadcast_to(slack_rows / np.sqrt(3.0), scores.shape)
        return Found(np.full(scores.shape, HIDDEN), rows + self._first, sigmas_rows, scores)


def _peaks(scores: Floats, count: int) -> Indices:
    """(F, count): the peaks of scores around dials (F, N), highest first; the highest is repeated if there are few."""
    is_peak = (scores >= np.roll(scores, 1, axis=1)) & (scores > np.roll(scores, -1, axis=1))
    ordered = np.argsort(np.where(is_peak, -scores, np.inf), axis=1, kind="stable")[:, :count]
    peaks: Indices = np.where(np.take_along_axis(is_peak, ordered, axis=1), ordered, ordered[:, :1])
    return peaks


def _climbed(scores: Floats, at: Indices) -> Indices:
    """Move each row (F, P) to the highest of its own score (F, N) and its two neighbours'."""
    around = (at[..., None] + np.array([0, -1, 1])) % scores.shape[1]
    there = _at(scores, around)
    climbed: Indices = np.take_along_axis(around, there.argmax(axis=-1)[..., None], axis=-1)[..., 0]
    return climbed


def _refined(scores: Floats, at: Indices) -> Floats:
    """(F, P): the peaks of parabolas through the scores (F, N) around given coarse rows, as rows of dials."""
    before, here, after = (
        np.take_along_axis(scores, (at + step) % scores.shape[1], axis=1).astype(np.float64) for step in (-1, 0, 1)
    )
    bend = before - 2 * here + after
    off = np.divide(0.5 * (before - after), bend, out=np.zeros_like(bend), where=bend < 0)
    rows: Floats = COARSE_STEP * (at + np.clip(off, -0.5, 0.5))
    return rows


def _at(every: Floats, rows: Floats) -> Floats:
    """(F, ...): the values of (F, N) on the rows nearest to given ones, (F, ...)."""
    nearest = np.rint(rows).astype(np.intp) % every.shape[1]
    there: Floats = np.take_along_axis(every, nearest.reshape(len(every), -1), axis=1).reshape(rows.shape)
    return there


def _each_with_each(parts: Sequence[Floats]) -> list[Floats]:
    """Give each of some arrays, (F, P) each, its own axis, so that they broadcast to all combinations."""
    axes = range(len(parts))
    return [np.expand_dims(part, tuple(1 + axis for axis in axes if axis != own)) for own, part in enumerate(parts)]


def _lists(*columns: Floats) -> list[list[float]]:
    return [column.tolist() for column in columns]
