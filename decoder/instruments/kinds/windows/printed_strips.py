"""Print: what printed digits look like as far as pictures show them, and how similar a frame is to that.

Each cell of a row has a strip with all digits below each other, as on a drum: a drum shows any part of it, a display
only whole digits. The known rows of a strip are those shown in a picture whose digits were given. Cells share their
digits unless they are known to be printed differently.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, fields, replace
from functools import cached_property
from itertools import combinations, pairwise, product

import cv2
import numpy as np

from decoder.imaging.thresholds import HALF
from decoder.matching.thresholds import MIN_VISIBLE
from decoder.panel.arrays import Floats, Mask, limited
from decoder.panel.thresholds import LEAST_VALUE
from decoder.registration.thresholds import CLEAR_SCORE, MIN_SPREAD_LEVELS

DIGITS = 10
# Offsets at which a digit may be seen, in pixels: frames are aligned, and windows drawn, to fractions of a pixel only.
ACROSS_PX, DOWN_PX = (-1.5, -1.0, -0.5, 0.0, 0.5, 1.0, 1.5), (-1.0, -0.5, 0.0, 0.5, 1.0)
# For drums, whose vertical position is searched anyway.
ASIDE_PX = (-0.7, 0.0, 0.7)
# Offsets between cells that are printed alike.
APART_PX = (-2.0, -1.5, -1.0, -0.5, 0.0, 0.5, 1.0, 1.5, 2.0)
# Quantiles of a cell's grey levels that stand for its ground and its ink.
GROUND, INK = 0.1, 0.98
# Quantile of the gradients that stands for the steepness of edges.
STEEP = 0.98
# Anything finer than a stroke, as a part of the window's height, is noise.
STROKE_PART = 1 / 7
# How wide the line between two drums may be in a cell, as a part of its width.
LINE_PART = 1 / 16


@dataclass(frozen=True, slots=True)
class Cells:
    """Where a row's cells lie in its window: from columns `left` (D,) on, each `size` rows and columns large.

    `is_turned` if the drums roll so that the next digit comes from above; cells are then seen upside down.
    """

    left: Floats
    size: tuple[int, int]
    is_turned: bool

    @classmethod
    def within(cls, window: Floats, before: Sequence[tuple[int, int]], gap: float, *, is_turned: bool) -> Cells:
        """Lay them out in a window (R, C); a sign between digits takes `gap` of a cell's width."""
        columns, cells = window.shape[1], np.array(before, np.float64)
        width = columns / (len(cells) + gap * cells[-1, 1])
        wide = max(int(width), 1)
        left = (cells @ np.array([1.0, gap])) * width + (width - wide) / 2
        return cls(limited(left, 0.0, float(columns - wide)), (window.shape[0], wide), is_turned)

    def of(self, windows: Floats) -> Floats:
        """(F, D, R, W) float32: the cells of windows (F, R, C)."""
        at = self.left[:, None] + np.arange(self.size[1])
        first = np.floor(at).astype(np.intp)
        part = (at - first).astype(np.float32)
        after = np.minimum(first + 1, windows.shape[2] - 1)
        own = (1 - part) * windows[:, :, first] + part * windows[:, :, after]
        return np.ascontiguousarray(np.moveaxis(own, 1, 2)[:, :, :: -1 if self.is_turned else 1], np.float32)


@dataclass(frozen=True)
class Print:
    """What is known of a row's digits.

    Attributes
    ----------
    cells
        Where they are.
    levels, known
        (D, S, W) and (D, S): each cell's strip as ink, from 0 to 1, and which of its rows pictures showed.
    contrast
        (D,): how many grey levels ink is brighter than its ground; negative where it is darker.
    rolls
        Whether any part of a strip may be shown, or whole digits only.
    is_complete
        (D,): whether everything a cell may show is known for certain.
    """

    cells: Cells
    levels: Floats
    known: Mask
    contrast: Floats
    rolls: bool
    is_complete: Mask

    def __getstate__(self) -> dict[str, object]:
        """Leave out what is computed from the rest: it is a hundred times as large, and is sent to each worker."""
        return {each.name: getattr(self, each.name) for each in fields(self)}

    @property
    def pitch(self) -> float:
        """How many rows a digit takes."""
        return float(self.levels.shape[1]) / DIGITS

    def compared(self, windows: Floats) -> Compared:
        """Compare windows (F, R, C) with all that its cells may show."""
        return self.looks.compared(self.cells.of(windows) * np.sign(self.contrast)[:, None, None])

    @cached_property
    def whole(self) -> Mask:
        """(D, 10): which digits are known."""
        return self._seen(np.arange(DIGITS, dtype=np.float64))[1]

    def _seen(self, places: Floats) -> tuple[Floats, Mask]:
        """(D, N, R, W) and (D, N): what is seen of strips at places, in digits, and whether it is known."""
        rows, size = self.cells.size[0], self.levels.shape[1]
        at = places[:, None] * self.pitch + np.arange(rows)
        first = np.floor(at).astype(np.intp)
        part = (at - first)[..., None].astype(np.float32)
        one, other = self.levels[:, first % size], self.levels[:, (first + 1) % size]
        is_known = self.known[:, first % size] & (self.known[:, (first + 1) % size] | (part[..., 0] < LEAST_VALUE))
        seen: Floats = (1 - part) * one + part * other
        return seen.astype(np.float32), is_known.mean(axis=2) >= 1 - MIN_VISIBLE

    def lent(self) -> Print:
        """Return the print with each cell's missing digits filled in from other cells that are printed alike."""
        looks, has = self._seen(np.arange(DIGITS, dtype=np.float64))
        levels, known, whole = self.levels.copy(), self.known.copy(), has.copy()
        every = range(len(levels))
        is_sure = has.copy()
        ways = _shifts_between(looks, has)
        for own, are_sure in product(every, (True, False)):
            for other in sorted(every, key=lambda cell: abs(cell - own)):
                way = ways[own][other]
                if way is None or way.is_sure != are_sure:
                    continue
                for digit in np.flatnonzero(has[other] & ~whole[own]).tolist():
                    first = round(digit * self.pitch)
                    rows = (first + np.arange(self.cells.size[0])) % levels.shape[1]
                    free = ~known[own, rows]
                    down = way.down + digit * self.pitch - first
                    levels[own, rows[free]] = shifted(looks[other, digit], way.right, down)[free]
                    known[own, rows[free]] = True
                    whole[own, digit], is_sure[own, digit] = True, are_sure
        for strip, rows in zip(levels, known, strict=True):
            _fill(strip, rows, HALF * HALF * self.pitch)
        return replace(self, levels=levels, known=known, is_complete=np.asarray(is_sure.all(axis=1)))

    @cached_property
    def looks(self) -> Looks:
        """All that its cells may show."""
        step = 1.0 if not self.rolls else 1.0 / round(2 * self.pitch)
        places = np.arange(0.0, DIGITS - step / 2, step)
        seen, is_known = self._seen(places)
        shifts = [(x, 0.0) for x in ASIDE_PX] if self.rolls else list(product(ACROSS_PX, DOWN_PX))
        return Looks.of(seen, is_known, places, shifts, _light(self.cells.size, by_row=self.rolls))

    @cached_property
    def steepness(self) -> float:
        """The relative change of what a cell shows when it moves by a row."""
        looks, has = self._seen(np.arange(DIGITS, dtype=np.float64))
        changes = [np.gradient(look, axis=0).std() / max(look.std(), LEAST_VALUE) for look in looks[has]]
        return float(np.median(changes)) if changes else LEAST_VALUE

    @cached_property
    def sharpness(self) -> float:
        """The median height of the digits that pictures showed, in units of their edges' blur."""
        looks, has = self._seen(np.arange(DIGITS, dtype=np.float64))
        return float(np.median([_sharpness(look) for look in looks[has]])) if has.any() else 0.0


@dataclass(frozen=True, slots=True)
class Looks:
    """All that D cells may show: N places, each at H small offsets too, as P pixels.

    Attributes
    ----------
    places
        (N,): in digits.
    pixels
        (D, P, N * H): what a cell shows there, with light projected out, of unit length; zero where nothing is known.
    lengths
        (D, N * H): its length before that.
    light
        (P, L): the light modes, orthonormal.
    size
        Rows and columns of a cell.
    """

    places: Floats
    pixels: Floats
    lengths: Floats
    light: Floats
    size: tuple[int, int]

    @classmethod
    def of(
        cls, seen: Floats, is_known: Mask, places: Floats, shifts: Sequence[tuple[float, float]], light: Floats
    ) -> Looks:
        """Build them from what is seen at places, (D, N, R, W)."""
        count, size = len(seen), (seen.shape[2], seen.shape[3])
        moved = np.zeros((*seen.shape[:2], len(shifts), *size), np.float32)
        for cell, place in np.argwhere(is_known).tolist():
            moved[cell, place] = [shifted(seen[cell, place], *shift) for shift in shifts]
        flat = moved.reshape(count, len(places) * len(shifts), -1)
        flat = flat - (flat @ light) @ light.T
        lengths = np.linalg.norm(flat, axis=2)
        pixels = flat / np.where(lengths > MIN_SPREAD_LEVELS, lengths, np.inf)[..., None]
        return cls(places, np.ascontiguousarray(pixels.swapaxes(1, 2), np.float32), lengths, light, size)

    def compared(self, cells: Floats) -> Compared:
        """Compare each cell of (F, D, R, W) with all of them, bit for bit independently of the other cells."""
        own = cells.reshape(*cells.shape[:2], 1, -1)
        own = own - np.matmul(np.matmul(own, self.light), self.light.T)
        lengths = np.maximum(np.sqrt((own[:, :, 0] ** 2).sum(axis=2)), LEAST_VALUE)
        every = np.matmul(own, self.pixels)[:, :, 0] / lengths[..., None]
        ways = every.reshape(*every.shape[:2], len(self.places), -1)
        scores = ways.max(axis=3)
        best = every.argmax(axis=2)
        drums = np.arange(cells.shape[1])
        shown = self.pixels.swapaxes(1, 2)[drums, best]
        gains = every.max(axis=2) * lengths
        left = own[:, :, 0] - gains[..., None] * shown
        return Compared(
            scores,
            gains / np.maximum(self.lengths[drums, best], LEAST_VALUE),
            np.abs(_coarse(left, self.size)).max(axis=2)
            / np.maximum(np.ptp(_coarse(gains[..., None] * shown, self.size), axis=2), LEAST_VALUE),
        )


@dataclass(frozen=True, slots=True)
class Compared:
    """What F frames' D cells show.

    Attributes
    ----------
    scores
        (F, D, N): the NCC with what is seen at each place.
    gains
        (F, D): how many grey levels ink differs from its ground in the best match.
    strays
        (F, D): the largest local excess or lack of ink, relative to the ink of the best match.
    """

    scores: Floats
    gains: Floats
    strays: Floats


def first_print(cells: Cells, windows: Floats, places: Floats, pitch_rows: float | None) -> Print:
    """Build the print from pictures (F, R, C) whose drums stand at places (F, D)."""
    own = cells.of(windows)
    # A digit has ground on either side, within the line that may be seen where a drum ends.
    columns, line = own.mean(axis=2), int(LINE_PART * own.shape[3])
    beside = (columns[..., line] + columns[..., -1 - line]) / 2
    is_dark = (columns.mean(axis=2) - beside).sum(axis=0) < 0
    light = np.where(is_dark, -1.0, 1.0)[:, None, None].astype(np.float32)
    ground, other = (light * np.quantile(light * own, part, axis=(2, 3))[..., None, None] for part in (GROUND, INK))
    contrast = np.where(np.abs(other - ground) > MIN_SPREAD_LEVELS, other - ground, np.inf)
    views = _together(((own - ground) / contrast).astype(np.float32), places)
    rows, columns = cells.size
    size = DIGITS * rows if pitch_rows is None else round(DIGITS * pitch_rows)
    count = len(cells.left)
    total, weights = np.zeros((count, size, columns)), np.zeros((count, size))
    for view, at in zip(views, places, strict=True):
        for cell in range(count):
            _lay(total[cell], weights[cell], view[cell], at[cell] * size / DIGITS)
    known = weights >= HALF
    levels = np.where(known[..., None], total / np.maximum(weights, LEAST_VALUE)[..., None], 0.0)
    typical = np.median(np.where(np.isfinite(contrast), contrast, 0.0), axis=0)[:, 0, 0].astype(np.float32)
    return Print(cells, levels.astype(np.float32), known, typical, pitch_rows is not None, np.zeros(count, bool)).lent()


def _together(views: Floats, places: Floats) -> Floats:
    """Align views (F, D, R, W), so that the same place shown in two of them coincides.

    Their windows were drawn by hand.
    """
    laid = list(views[:1])
    for number in range(1, len(views)):
        same = [
            (views[number][cell], before[cell])
            for before, at in zip(laid, places, strict=False)
            for cell in np.flatnonzero(at == places[number])
        ]
        ones, others = ([pair[side] for pair in same] for side in (0, 1))
        way = _way_between(np.array(ones), np.array(others)) if same else None
        view = views[number]
        laid.append(view if way is None else np.stack([shifted(cell, way.right, way.down) for cell in view]))
    return np.stack(laid)


def _lay(total: Floats, weights: Floats, view: Floats, row: float) -> None:
    """Add a view (R, W) to a strip's sums, starting at a fractional row."""
    first = int(np.floor(row))
    part, size = row - first, len(total)
    for offset, share in ((0, 1 - part), (1, part)):
        rows = (first + offset + np.arange(len(view))) % size
        total[rows] += share * view
        weights[rows] += share


def _fill(strip: Floats, known: Mask, most: float) -> None:
    """Interpolate gaps between two digits: a few rows that no picture showed have no ink of their own."""
    size, seen = len(known), np.flatnonzero(known)
    for before, after in pairwise([*seen.tolist(), *(seen[:1] + size).tolist()]):
        gap = after - before - 1
        if 0 < gap <= most:
            part = (np.arange(1, gap + 1) / (gap + 1))[:, None]
            rows = np.arange(before + 1, after) % size
            strip[rows] = (1 - part) * strip[before] + part * strip[after % size]
            known[rows] = True


def shifted(look: Floats, right: float, down: float) -> Floats:
    """Return a look moved by fractions of a pixel; pixels from outside repeat its edge."""
    if not right and not down:
        return look
    move = np.array([[1.0, 0.0, right], [0.0, 1.0, down]])
    return np.asarray(cv2.warpAffine(look, move, look.shape[::-1], borderMode=cv2.BORDER_REPLICATE), np.float32)


@dataclass(frozen=True, slots=True)
class Way:
    """How far one cell's digits must be moved to appear as in another, pixels; sure if a common digit confirms it."""

    right: float
    down: float
    is_sure: bool = True


def _shifts_between(looks: Floats, has: Mask) -> list[list[Way | None]]:
    """For each cell, how to move each other cell's digits to appear there, looks (D, 10, R, W).

    None if they are printed differently. Cells without a common digit are compared by way of a third.
    """
    every = range(len(looks))
    ways: list[list[Way | None]] = [[Way(0.0, 0.0) if one == other else None for other in every] for one in every]
    are_apart = np.zeros((len(looks), len(looks)), bool)
    for one, other in combinations(every, 2):
        both = has[one] & has[other]
        way = _way_between(looks[other, both], looks[one, both]) if both.any() else None
        if way is not None:
            ways[one][other], ways[other][one] = way, Way(-way.right, -way.down)
        are_apart[one, other] = are_apart[other, one] = both.any() and way is None
    for by, one, other in product(every, every, every):
        first, second = ways[one][by], ways[by][other]
        if ways[one][other] is None and first is not None and second is not None:
            ways[one][other] = Way(first.right + second.right, first.down + second.down)
    for one, other in product(every, every):
        if ways[one][other] is None and not are_apart[one, other]:
            ways[one][other] = Way(0.0, 0.0, is_sure=False)
    return ways


def _way_between(ones: Floats, others: Floats) -> Way | None:
    """Return how digits (K, R, W) have to be moved to match others; None if no offset matches.

    Most have to match: the more digits two cells share, the likelier is one that a picture shows in bad light.
    """
    tries = []
    for right, down in product(APART_PX, APART_PX):
        scores = _alike(np.stack([shifted(one, right, down) for one in ones]), others)
        tries.append((float(np.median(scores)), -abs(right) - abs(down), right, down))
    score, _, right, down = max(tries)
    return Way(right, down) if score >= CLEAR_SCORE else None


def _alike(ones: Floats, others: Floats) -> Floats:
    """(K,): how well each of some digits (K, R, W) correlates with its counterpart; a flat one is like no other."""
    pair = [each.reshape(len(each), -1).astype(np.float64) for each in (ones, others)]
    one, other = (each - each.mean(axis=1, keepdims=True) for each in pair)
    spread = np.sqrt(np.vecdot(one, one) * np.vecdot(other, other))
    scores: Floats = np.divide(np.vecdot(one, other), spread, out=np.zeros_like(spread), where=spread > 0)
    return scores


def _sharpness(look: Floats) -> float:
    """Return a digit's height in units of its edges' blur."""
    ink = look - np.median([look[:, 0], look[:, -1]])
    there = np.argwhere(ink >= HALF * HALF * ink.max())
    (top, left), (bottom, right) = there.min(axis=0), there.max(axis=0) + 1
    digit = ink[top:bottom, left:right]
    down, across = np.gradient(ink)
    steepest = float(np.quantile(np.hypot(down, across)[top:bottom, left:right], STEEP))
    contrast = float(np.quantile(digit, INK))
    return float(bottom - top) * steepest / max(contrast, LEAST_VALUE)


def _light(size: tuple[int, int], *, by_row: bool) -> Floats:
    """(P, L): light modes, constant and linear by rows and columns, orthonormal; for a drum, one constant per row."""
    rows, columns = np.mgrid[-1.0 : 1.0 : size[0] * 1j, -1.0 : 1.0 : size[1] * 1j]
    down = np.repeat(np.eye(size[0]), size[1], axis=1) if by_row else np.stack([np.ones(rows.size), rows.ravel()])
    light: Floats = np.linalg.qr(np.concatenate([down, columns.reshape(1, -1)]).T)[0]
    return light.astype(np.float32)


def _coarse(flat: Floats, size: tuple[int, int]) -> Floats:
    """(F, D, Q): means over patches as large as a stroke is wide, of cells (F, D, P)."""
    side = math.ceil(STROKE_PART * size[0])
    sums = flat.reshape(*flat.shape[:2], *size)
    for axis in (2, 3):
        sums = np.cumsum(np.insert(sums, 0, 0.0, axis=axis), axis=axis)
        sums = np.take(sums, np.arange(side, sums.shape[axis]), axis) - np.take(
            sums, np.arange(sums.shape[axis] - side), axis
        )
    coarse: Floats = sums.reshape(*flat.shape[:2], -1) / side**2
    return coarse
