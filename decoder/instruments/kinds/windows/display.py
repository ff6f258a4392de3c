"""Displays: how a row of cells is read, and how its look is learned from a flight."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view

from decoder.imaging.thresholds import HALF
from decoder.instruments.kinds.windows.cells import Cells, Seen
from decoder.instruments.kinds.windows.segments import NAMES, SHAPES, Known, Segments, fitted, found, left_over, lit
from decoder.instruments.thresholds import CLEARLY_WORSE, FRAMES_TO_LEARN, HALF_LIT
from decoder.matching.thresholds import MIN_LIGHT_GAIN, MIN_VIEWS
from decoder.panel.arrays import Floats, Indices, Mask
from decoder.registration.thresholds import LIKELY_SCORE, SCORE_THRESHOLD

DIGITS = "0123456789"
LEARNING_ROUNDS = 2
# The number of texts from a flight that teach its display; they contain nearly all digits.
MOST_TEXTS = 4

BLANK = -1


@dataclass(frozen=True)
class Display:
    """A display of segments.

    Attributes
    ----------
    segments
        Where they are.
    drawings
        The segments of each digit that can be drawn in several ways.
    gain
        How many grey levels a lit segment usually adds; negative where digits are dark.
    ground
        (R, C): what else is seen there, in any light; zero where that is not known.
    may_be_blank
        (N,): the cells that may be blank.
    broken
        (N, 7): segments that were dark where a digit needs them.
    drawn, shown
        (R, C) and (N,): the panel picture, and the digits known to be on it.
    flickers
        Whether frames of the flight showed digits dark that were lit: one after the other, and too fast to see. A cell
        that seems blank may then not be.
    """

    segments: Segments
    drawings: Mapping[str, str]
    gain: float
    ground: Floats
    may_be_blank: Mask
    broken: Mask
    drawn: Floats
    shown: Indices
    flickers: bool = False

    @cached_property
    def _drawings(self) -> list[tuple[str, str]]:
        return [
            (digit, way)
            for digit in DIGITS
            for way in ((self.drawings[digit],) if digit in self.drawings else SHAPES[digit])
        ]

    @cached_property
    def _cells(self) -> Cells:
        return Cells.of(self.segments, self._drawings, self.ground, float(np.sign(self.gain)))

    @cached_property
    def _doubtful(self) -> Mask:
        """(N, 10): digits that may be another digit with a broken segment."""
        ways = {frozenset(way): digit for digit, way in self._drawings}
        doubtful = np.zeros((len(self.broken), len(DIGITS)), bool)
        for cell, place in np.argwhere(self.broken).tolist():
            for digit, way in self._drawings:
                if ways.get(frozenset([*way, NAMES[place]]), digit) != digit:
                    doubtful[cell, int(digit)] = True
        return doubtful

    def seen(self, strips: Floats) -> Seen:
        """Compare F frames (F, R, C) with all digits."""
        return self._cells.seen(strips)

    def read(self, strips: Floats) -> tuple[Indices, Floats, Mask]:
        """Read F frames, (F, R, C).

        Returns
        -------
        (F, N) each cell's digit, `BLANK` where there is none; (F,) the lowest score; (F,) whether all is certain.
        """
        cells = self.seen(strips)
        is_digit, is_blank = self._told(cells)
        blank_first = np.cumprod(is_blank & self.may_be_blank, axis=1).astype(bool)
        first = is_digit & (np.cumsum(~blank_first, axis=1) == 1)
        superfluous = (first & self.may_be_blank & (cells.symbols == 0)).any(axis=1)  # a leading zero would be dark
        sure = (is_digit | blank_first).all(axis=1) & is_digit.any(axis=1) & ~superfluous
        fades = (
            first & self.may_be_blank & (cells.gains < _in_half_light(cells.gains.max(axis=1, keepdims=True)))
        ).any(1)
        sure &= ~(fades | (self.flickers & blank_first.any(axis=1)))
        scores = np.where(blank_first, 1.0, cells.scores).min(axis=1) * ~blank_first.all(axis=1)
        return np.where(blank_first, BLANK, cells.symbols), scores, sure

    def _told(self, cells: Seen) -> tuple[Mask, Mask]:
        """(F, N) each: whether a cell certainly shows a digit, and whether it is blank."""
        likely, usual = self._usual(cells)
        whole = cells.gains > HALF * usual
        alone = (cells.worse >= CLEARLY_WORSE) & (np.abs(cells.strays).max(axis=2) <= HALF_LIT)
        doubtful = np.take_along_axis(self._doubtful, cells.symbols.T, axis=1).T
        alone &= self._is_one_digit(cells)
        certain = likely & whole & alone & ~doubtful & self._as_described(cells.points / usual)[:, None]
        return certain, self._nothing(cells, likely, usual)

    @cached_property
    def _parts(self) -> tuple[Floats, Floats]:
        """(S, T, 7) each: weights of the segments that a way to draw a digit has in common with another, and has alone.

        Their sum is 1; ways with fewer such parts are padded with the whole digit.
        """
        ways = [frozenset(way) for _, way in self._drawings]
        digits = [digit for digit, _ in self._drawings]
        both = [
            {own & other for other, its in zip(ways, digits, strict=True) if its != digit and own & other} - {own}
            for own, digit in zip(ways, digits, strict=True)
        ]
        count = max(map(len, both))
        pairs = [
            [(part, own - part) for part in sorted(parts, key=sorted)] + [(own, own)] * (count - len(parts))
            for own, parts in zip(ways, both, strict=True)
        ]
        weights = np.array(
            [[[[name in its for name in NAMES] for its in pair] for pair in row] for row in pairs], float
        )
        weights /= weights.sum(axis=3, keepdims=True)
        return weights[:, :, 0], weights[:, :, 1]

    def _is_one_digit(self, cells: Seen) -> Mask:
        """(F, N): whether the part of a digit that some other digit lacks is not as dim as in a part of the exposure.

        If a value changes during the exposure, the old and the new digit lie over each other, and may make a third.
        """
        levels = 1 + cells.strays[..., None, :]
        common, alone = (np.vecdot(levels, part[cells.ways]) for part in self._parts)
        is_one: Mask = (alone >= _in_half_light(common)).all(axis=2)
        return is_one

    def _usual(self, cells: Seen) -> tuple[Mask, Floats]:
        """(F, N) and (F, 1): which cells likely show digits, and their usual brightness; infinite if none does."""
        likely = (cells.scores >= SCORE_THRESHOLD) & (cells.gains >= MIN_LIGHT_GAIN * abs(self.gain))
        ordered = np.sort(np.where(likely, cells.gains, np.inf), axis=1)
        middle = np.maximum(likely.sum(axis=1, keepdims=True) - 1, 0) // 2
        return likely, np.take_along_axis(ordered, middle, axis=1)

    @cached_property
    def _points(self) -> Floats:
        """(N - 1,): how bright decimal points are in the panel picture, relative to its segments."""
        cells = self.seen(self.drawn[None])
        points: Floats = (cells.points / self._usual(cells)[1])[0]
        return points

    def _as_described(self, points: Floats) -> Mask:
        """(F,): whether every described decimal point is lit, and none between cells that have no separator."""
        described = np.isin(np.arange(points.shape[1]), self.segments.points)
        # A point is small, and its brightness in a single picture known to a half of it.
        out = described & (self._points >= MIN_LIGHT_GAIN) & (points < HALF * HALF * self._points)
        close = np.diff(self.segments.cells[:, 1]) == 0
        # No point is darker than none: what seems so in the panel picture is a digit beside it.
        dark = np.maximum(self._points, 0.0)
        other: Mask = (out | (close & (points > dark + MIN_LIGHT_GAIN))).any(axis=1)
        return ~other

    def taught(self, strips: Floats) -> Display:
        """Learn from a sample's frames (F, R, C) what the digits look like, and which segments are broken."""
        if len(strips) < FRAMES_TO_LEARN:
            return self
        own = self._fitted(strips)
        seen = own.seen(np.concatenate([self.drawn[None], strips]))
        return replace(own, broken=self.mistaken[:, None] | own.dark(seen), flickers=own.has_gaps(seen))

    def _fitted(self, strips: Floats) -> Display:
        """Fit it to frames that clearly show digits; unchanged if there are none, or if they contradict the picture."""
        cells = self.seen(strips)
        shown = self._shown(cells)
        texts = Counter(map(tuple, shown[(shown >= 0).any(axis=1)].tolist()))
        if not texts:
            return self
        known, drawings = [], {**self._forms(cells.ways[shown >= 0]), **self.drawings}
        for text in _most_telling(texts):
            own = (shown == text).all(axis=1)
            symbols = [DIGITS[number] if number >= 0 else " " for number in text]
            known.append(Known(strips[own].mean(axis=0), lit(symbols, drawings)))
        fit = fitted(self.segments, known, rounds=LEARNING_ROUNDS)
        if not fit.gain * self.gain > 0:
            return self
        better = replace(self, segments=fit.segments, gain=fit.gain, ground=left_over(fit.segments, known))
        return self if (better.mistaken & ~self.mistaken).any() else better

    def _forms(self, ways: Indices) -> dict[str, str]:
        """Return the segments of each digit in its most frequent form: a display has one form of each."""
        return dict(self._drawings[way] for way, _ in reversed(Counter(ways.tolist()).most_common()))

    @property
    def mistaken(self) -> Mask:
        """(N,): the cells in which the panel picture seems to show another digit than the known one."""
        cells = self.seen(self.drawn[None])
        wrong: Mask = (cells.symbols[0] != self.shown) & (self.shown >= 0)
        return wrong

    def _shown(self, cells: Seen) -> Indices:
        """(F, N): what is likely shown; the whole row is blank if some cell is neither a digit nor empty."""
        likely, _ = self._usual(cells)
        brightest = cells.gains.max(axis=1, keepdims=True)
        nothing = self._nothing(cells, likely, brightest) & self.may_be_blank
        likely &= np.abs(cells.strays).max(axis=2) <= HALF_LIT
        likely &= cells.gains >= _in_half_light(brightest)  # what is dimmer may be the shadow of an unlit digit
        whole = (likely | nothing).all(axis=1, keepdims=True)
        return np.where(likely & whole, cells.symbols, BLANK)

    def _nothing(self, cells: Seen, likely: Mask, usual: Floats) -> Mask:
        """(F, N): whether a cell contains less than half of a usual digit in excess of the residuals of digits."""
        noise = np.where(likely, cells.lefts, 0.0).max(axis=1, keepdims=True)
        beyond = np.sqrt(np.maximum(cells.contents**2 - noise**2, 0.0))
        nothing: Mask = beyond < HALF * usual
        return nothing

    def has_gaps(self, cells: Seen) -> bool:
        """Whether some frame shows nothing in a cell behind a digit, which no value does."""
        likely, _ = self._usual(cells)
        is_digit = likely & (np.abs(cells.strays).max(axis=2) <= HALF_LIT)
        brightest = np.where(is_digit, cells.gains, 0.0).max(axis=1, keepdims=True)
        nothing = self._nothing(cells, likely, brightest) & ~is_digit
        gap = nothing & (np.cumsum(is_digit, axis=1) > 0)
        return bool((gap.any(axis=1) & (is_digit | nothing).all(axis=1)).any())

    def dark(self, cells: Seen) -> Mask:
        """(N, 7): segments that stay dark in successive frames in which all others make a digit that needs them."""
        missing, rest = cells.strays < HALF_LIT - 1, np.abs(cells.strays) <= HALF_LIT
        fits = (missing.sum(axis=2) <= 1) & (missing | rest).all(axis=2) & (cells.scores >= LIKELY_SCORE)
        ways = np.array([[name in way for name in NAMES] for _, way in self._drawings])
        needed = ways[cells.ways] & fits[..., None]
        dark = np.zeros(needed.shape[1:], bool)
        for cell, place in np.argwhere(needed.any(axis=0)).tolist():
            own = missing[needed[:, cell, place], cell, place]
            dark[cell, place] = sliding_window_view(own, min(len(own), MIN_VIEWS)).all(axis=1).any()
        return dark


def _in_half_light(levels: Floats) -> Floats:
    """Return how bright what is lit for half of the exposure, or less, is at most: levels have a gamma of 2.2."""
    half = float(HALF ** (1 / 2.2))
    return half * levels


def _most_telling(texts: Counter[tuple[int, ...]]) -> list[tuple[int, ...]]:
    """Choose a few texts that together show as many digits in as many cells as possible, preferring common ones."""
    chosen: list[tuple[int, ...]] = []
    known: set[tuple[int, int]] = set()
    for _ in range(MOST_TEXTS):
        left = [text for text in texts if text not in chosen]
        if not left:
            break
        best = max(left, key=lambda text: (len(set(enumerate(text)) - known), texts[text], text))
        chosen.append(best)
        known |= set(enumerate(best))
    return chosen


@dataclass(frozen=True, slots=True)
class Row:
    """The cells of a display as they are described.

    Attributes
    ----------
    symbols
        What the panel picture shows in each: a digit or a blank.
    cells
        (N, 2): how many cells and how many separators precede each.
    points
        The cells that are followed by a decimal point.
    may_be_blank
        (N,): which cells may be blank.
    """

    symbols: tuple[str, ...]
    cells: Floats
    points: tuple[int, ...]
    may_be_blank: Mask


def in_picture(strip: Floats, row: Row, margin: int) -> Display | None:
    """Find a display in a picture of it (R, C), with a margin; None if its digits are not visible.

    If a cell seems to show another digit than the known one, its segments are marked as broken.
    """
    fit, drawings = found(strip, row.symbols, row.cells, row.points, margin)
    if fit.left > 1 - LIKELY_SCORE**2:
        return None
    count = len(row.cells)
    own = Display(
        segments=fit.segments,
        drawings=drawings,
        gain=fit.gain,
        ground=np.zeros_like(strip),
        may_be_blank=row.may_be_blank,
        broken=np.zeros((count, len(NAMES)), bool),
        drawn=strip,
        shown=np.array([BLANK if symbol == " " else DIGITS.index(symbol) for symbol in row.symbols]),
    )
    own = replace(own, broken=own.mistaken[:, None] | own.dark(own.seen(strip[None])))
    return own if own.mistaken.sum() <= (count - 1) // 2 else None
