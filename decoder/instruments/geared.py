"""Geared hands: an altimeter's or a clock's hands tell one value, and the value is what is looked for.

Every turn of the finest hand is a value that the frame may show; the gearing then says where the other hands are. So
for each direction in which the finest hand seems to point, and each number of its turns, the whole dial is drawn, and
what explains the frame best is it. A hand that is short, dim, hidden or like another one helps as far as it shows; one
that should show and does not speaks against the value. What explains the dial nearly as well with another value, or
much better with hands that do not go together, makes the value doubtful.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import product

import numpy as np

from decoder.imaging.unwrapping import PolarGrid
from decoder.instruments.found import EDGE, HIDDEN, MISSING, READ, Found, Needle
from decoder.instruments.reading import Reading, Status
from decoder.instruments.stack import all_above, without_dial
from decoder.instruments.thresholds import (
    CLEARLY_WORSE,
    SURE_SCORE,
)
from decoder.matching.correlation import partial_normxcorr
from decoder.matching.fitting import Fits, WindowFitter, settle
from decoder.matching.layered_dial import LayeredDial, lit_as, times_worse, unexplained
from decoder.matching.needle_template import NeedleTemplate
from decoder.matching.searching import COARSE_STEP, thinned
from decoder.matching.thresholds import HALF, MAX_PEAK_ROWS, MIN_VISIBLE, SCORE_THRESHOLD, WHOLE_VISIBLE
from decoder.panel.arrays import Floats, Indices, Mask
from decoder.panel.gauge import Gauge
from decoder.panel.scale import FULL_CIRCLE_DEG, Scale, in_turn, shortest

# So many directions of the finest hand are tried, each with so many numbers of turns, and with the others anywhere.
DIRECTIONS, TURNS, ANYWHERE = 6, 8, 2
ROUNDS = 2
# What a hand at the end of its tolerance must score more than one where the gearing has it.
STRAY_COST = 0.15
# A coarse hand must tell the turns apart even if it is off by so many of its sigmas.
SURE_SIGMAS = 2.0


@dataclass(frozen=True, slots=True)
class Together:
    """What hands that are geared to each other tell in F frames: each by itself, (F, K), and their value, by frame."""

    hands: Found
    values: list[Reading]


class Gearing:
    """How the hands of one dial follow from its value, the finest first.

    Attributes
    ----------
    turns
        What a turn of each hand is worth.
    """

    def __init__(self, gauge: Gauge) -> None:
        combination = gauge.combination
        assert combination is not None  # noqa: S101 - the kind owns no other gauges
        quantities = {quantity.name: quantity for quantity in gauge.quantities}
        parts = [quantities[name] for name in combination.parts]
        self._scales = [Scale.of(part.marks, part.wraps) for part in parts]
        self.turns = [part.wraps or 0.0 for part in parts]
        self.names, self.name = combination.parts, combination.quantity.name
        self._tolerance, self._quantity = combination.tolerance, combination.quantity

    @property
    def turn(self) -> float:
        """What a turn of the coarsest hand is worth."""
        return self.turns[-1]

    def values(self, finest_deg: Floats) -> Floats:
        """(D, T): all values at which the finest hand points in some directions, (D,)."""
        within = self.within(0, finest_deg)[:, None] + self.turns[0] * np.arange(round(self.turn / self.turns[0]))
        return in_turn(within, self.turn, self._quantity.lowest)

    def within(self, hand: int, angles_deg: Floats) -> Floats:
        """What a hand says by itself, within one turn of it."""
        return self._scales[hand].values_at(angles_deg)

    def angles_deg(self, hand: int, values: Floats) -> Floats:
        """Where a hand points at values."""
        return self._scales[hand].angles_of(in_turn(values, self.turns[hand]))

    def tolerance_deg(self, hand: int) -> float:
        """How far a hand may be from where the next finer one puts it."""
        return self._tolerance * FULL_CIRCLE_DEG * self.turns[max(hand - 1, 0)] / self.turns[hand]

    def counted(self, angles_deg: Floats) -> float:
        """Return the value that all hands tell, (K,): the coarsest roughly and in full, each finer one better."""
        value = float(self.within(len(angles_deg) - 1, angles_deg[-1:])[0])
        for hand in range(len(angles_deg) - 2, -1, -1):
            value = self.measured(hand, angles_deg, value)
        return value

    def measured(self, hand: int, angles_deg: Floats, value: float) -> float:
        """Return the value nearest to one at which a hand points where it does."""
        off = float(shortest(self.within(hand, angles_deg[[hand]])[0] - value, self.turns[hand]))
        return float(in_turn(np.array(value + off), self.turn, self._quantity.lowest))

    def agrees(self, value: float, angles_deg: Floats, sigmas_deg: Floats, seen: Mask) -> bool:
        """Tell whether all hands that are seen, (K,), point where the value has them, and tell turns apart."""
        for hand in range(1, len(seen)):
            finer = self.turns[hand - 1]
            off = abs(float(shortest(self.within(hand, angles_deg[[hand]])[0] - value, self.turns[hand])))
            doubt = off + SURE_SIGMAS * self.sigma(hand, angles_deg, sigmas_deg)
            if seen[hand] and (off > self._tolerance * finer or doubt > finer / 2):
                return False
        return True

    def sigma(self, hand: int, angles_deg: Floats, sigmas_deg: Floats) -> float:
        """How uncertain what a hand says by itself is."""
        return float(np.abs(self._scales[hand].slopes_at(angles_deg[[hand]])[0]) * sigmas_deg[hand])

    def reading(self, status: Status, value: float, sigma: float, score: float) -> Reading:
        """Return a value as the angle that the combination's own scale has for it."""
        slope = FULL_CIRCLE_DEG / self.turn
        return Reading(status, (value - self._quantity.lowest) * slope, sigma * slope, score)


def told_together(gauge: Gauge, readings: Mapping[str, Reading]) -> Reading:
    """Return the value that hands tell which were read one by one; its score is not a number where they contradict."""
    gearing = Gearing(gauge)
    hands = [readings[name] for name in gearing.names]
    score = min(hand.score for hand in hands)
    if any(hand.status is Status.MISSING for hand in hands):
        return Reading(Status.MISSING, np.nan, np.inf, score)
    angles_deg, sigmas_deg = (np.array([getattr(hand, name) for hand in hands]) for name in ("angle_deg", "sigma_deg"))
    value = gearing.counted(angles_deg)
    if not gearing.agrees(value, angles_deg, sigmas_deg, np.ones(len(hands), bool)):
        return Reading(Status.MISSING, np.nan, np.inf, np.nan)
    return gearing.reading(hands[0].status, value, gearing.sigma(0, angles_deg, sigmas_deg), score)


def as_finest(gauge: Gauge, readings: Mapping[str, Reading]) -> dict[str, Reading]:
    """Return the value that a gauge's hands tell, if they do, no surer than the finest of them was read."""
    if gauge.combination is None:
        return {}
    name, finest = gauge.combination.quantity.name, readings[gauge.combination.parts[0]]
    value, gearing = readings[name], Gearing(gauge)
    if value.status is not Status.READ or finest.status is not Status.EDGE:
        return {}
    sigma_deg = max(value.sigma_deg, finest.sigma_deg * gearing.turns[0] / gearing.turn)
    return {name: replace(value, status=Status.EDGE, sigma_deg=sigma_deg)}


@dataclass(frozen=True, slots=True)
class _Guesses:
    """M ways to explain one frame: the hands' rows, (M, K), and their values, (M,), NaN where they do not go together."""

    rows: Floats
    values: Floats

    @property
    def is_geared(self) -> Mask:
        """(M,): whether they go together."""
        return np.isfinite(self.values)


@dataclass(frozen=True, slots=True)
class _Placed:
    """One hand in F frames as least squares have it, given the others, and how much of its contrast shows: (F,) each."""

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


class GearedReader:
    """Reads the hands of one gauge, all of which tell one value."""

    def __init__(self, needles: Sequence[Needle]) -> None:
        grid, names = needles[0].grid, [needle.name for needle in needles]
        self.gearing = Gearing(needles[0].gauge)
        self._grid: PolarGrid = grid
        self._turn = round(FULL_CIRCLE_DEG / grid.step_deg)
        self._first = (grid.rows - self._turn) // 2
        self._columns = [names.index(name) for name in self.gearing.names]
        own = [needles[column] for column in self._columns]
        self._reach_rows = np.array([each.half_width_rows + MAX_PEAK_ROWS for each in own])
        self._templates = [without_dial(each.template, grid) for each in own]
        self._coarse = [thinned(template) for template in self._templates]
        self._fitters = [WindowFitter([template], [grid.pixels_per_sample]) for template in self._templates]
        depth = [len(all_above(needles, names, column)) for column in self._columns]
        self._order = sorted(range(len(own)), key=lambda hand: -depth[hand])  # the lowest first
        self._whole_face, face = needles[0].face, self._once_around(needles[0].face)
        layers = [self._templates[hand] for hand in self._order]
        self._thin, self._dial = LayeredDial(face, layers, COARSE_STEP), LayeredDial(face, layers)

    @property
    def name(self) -> str:
        """Of the value."""
        return self.gearing.name

    @property
    def share(self) -> float:
        """What part of the value's circle one of the finest hand's is."""
        return self.gearing.turns[0] / self.gearing.turn

    def read(self, strips: Floats) -> Together:
        """Find the hands on a gauge in F frames, (F, R, C) float32, in the panel's order, and their value."""
        scores = [self._scores(strips, template) for template in self._coarse]
        dials = self._once_around(strips)
        tried = [self._tried([own[frame] for own in scores]) for frame in range(len(strips))]
        best = [self._best(dial, guesses) for dial, guesses in zip(dials, tried, strict=True)]
        guessed = np.array([guesses.rows[index] for guesses, index in zip(tried, best, strict=True)])
        placed = self._settled(dials, guessed)
        hands = Found.missing((len(strips), len(self._columns)))
        values = []
        for frame, (dial, guesses, index) in enumerate(zip(dials, tried, best, strict=True)):
            found, value = self._judged(dial, guesses, index, [_Placed(*(getattr(own, name)[frame] for name in own.__slots__)) for own in placed])
            hands.put((frame, np.array(self._columns)), found)
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

    def _best(self, dial: Floats, guesses: _Guesses) -> int:
        """Return which guess explains a frame best: hands that do not go together must do so clearly better."""
        seen = self._thin.thinned(dial)
        pictures = lit_as(seen, self._thin.drawn(guesses.rows[:, self._order]))
        left = unexplained(seen, pictures)
        geared = int(np.where(guesses.is_geared, left, np.inf).argmin())
        free = int(np.where(guesses.is_geared, np.inf, left).argmin())
        worse = float(times_worse(seen, pictures[free], pictures[[geared]])[0])
        apart = np.abs(shortest(guesses.rows[free] - guesses.rows[geared], self._turn)) > self._reach_rows
        return free if apart.any() and worse > CLEARLY_WORSE else geared

    def _settled(self, dials: Floats, rows: Floats) -> list[_Placed]:
        """Fit all hands in F frames, from rows (F, K) on, each given the others, from the uppermost down."""
        rows = rows.copy()
        placed: dict[int, _Placed] = {}
        for _ in range(ROUNDS):
            for layer in range(len(self._order) - 1, -1, -1):
                hand = self._order[layer]
                placed[hand] = self._fitted(dials, rows, layer)
                rows[:, hand] = placed[hand].row
        return [placed[hand] for hand in range(len(rows[0]))]

    def _fitted(self, dials: Floats, rows: Floats, layer: int) -> _Placed:
        """Fit one hand, given those below and above it."""
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

    def _judged(self, dial: Floats, guesses: _Guesses, best: int, placed: Sequence[_Placed]) -> tuple[Found, Reading]:
        """Judge one frame's hands, and their value, by what else would explain the dial."""
        row, sigma_rows, score, visible = (
            np.array([float(getattr(own, name)) for own in placed]) for name in ("row", "sigma_rows", "score", "visible")
        )
        shows = np.array([bool(own.shows) for own in placed])
        guessed, value = guesses.rows[best], float(guesses.values[best])
        off_rows = np.abs(shortest(guesses.rows - guessed, self._turn))
        is_there, is_near = off_rows <= self._reach_rows, off_rows <= MAX_PEAK_ROWS
        seen = self._thin.thinned(dial)
        others = self._thin.drawn(np.where(is_near, row, guesses.rows)[:, self._order])
        (own,) = lit_as(seen, self._thin.drawn(row[None, self._order]))
        is_rival = times_worse(seen, own, lit_as(seen, others)) <= CLEARLY_WORSE
        shows &= ~(is_rival[:, None] & ~is_there).any(axis=0)
        angles_deg, sigmas_deg = self._angles_deg(row), sigma_rows * self._grid.step_deg
        reach = self._reach_rows[0] / self._turn * self.gearing.turns[0]
        other = is_rival & (np.abs(shortest(guesses.values - value, self.gearing.turn)) > reach)
        is_sure = bool(shows[0]) and np.isfinite(value) and not other.any()
        contradicted = not np.isfinite(value)
        if is_sure:
            value = self.gearing.measured(0, angles_deg, value)
            contradicted = not self.gearing.agrees(value, angles_deg, sigmas_deg, shows)
            is_sure = not contradicted
        hidden = ~shows & is_sure
        geared = [float(self._rows(self.gearing.angles_deg(hand, np.array([value])))[0]) for hand in range(len(row))] if is_sure else row
        slack_rows = np.array([self.gearing.tolerance_deg(hand) for hand in range(len(row))]) / self._grid.step_deg
        found = Found(
            np.where(shows, np.where(visible >= WHOLE_VISIBLE, READ, EDGE), np.where(hidden, HIDDEN, MISSING)),
            np.where(hidden, geared, row) % self._turn + self._first,
            np.where(hidden, slack_rows / np.sqrt(3.0), sigma_rows),
            score,
        )
        if not is_sure:
            return found, Reading(Status.MISSING, np.nan, np.inf, np.nan if contradicted else float(score.min()))
        status = Status.READ if visible[0] >= WHOLE_VISIBLE else Status.EDGE
        told = self.gearing.sigma(0, angles_deg, sigmas_deg)
        return found, self.gearing.reading(status, value, told, float(score[shows].min()))


def _peaks(scores: Floats) -> Indices:
    """Where scores around a dial, (N,), are higher than beside it, the highest first."""
    peaks = np.flatnonzero((scores >= np.roll(scores, 1)) & (scores > np.roll(scores, -1)))
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
    return COARSE_STEP * (at + np.clip(off, -0.5, 0.5))
