"""Seven segments: where those of a display lie, fitted to pictures of it whose digits are known.

A display is a row of cells of one shape, drawn by a formula: seven strokes with soft edges, slanted, and the same in
each cell. So few numbers tell where all segments are that one picture with known digits is enough, and all ten digits
are known at once. A cell may stand a little beside its place, and a segment may be brighter than another.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import product
from typing import NamedTuple

import cv2
import numpy as np

from decoder.imaging.sorting import MAD_TO_SIGMA
from decoder.panel.arrays import Floats, limited
from decoder.panel.thresholds import LEAST_VALUE

NAMES = "abcdefg"
SHAPES: Mapping[str, tuple[str, ...]] = {
    "0": ("abcdef",),
    "1": ("bc", "ef"),
    "2": ("abdeg",),
    "3": ("abcdg",),
    "4": ("bcfg",),
    "5": ("acdfg",),
    "6": ("acdefg", "cdefg"),
    "7": ("abc", "abcf"),
    "8": ("abcdefg",),
    "9": ("abcdfg", "abcfg"),
    " ": ("",),
}
"""The segments of each digit, clockwise from the top, the middle last; some displays draw some digits otherwise."""

# Rounds of a fit, each with other weights, and steps of each.
ROUNDS = 3
FIRST_ROUNDS = 2
STEPS = 4
STARTS = 6
LAST = 2
BLUR = 0.1  # of the height, in which it is first looked for
SHARP = 0.8
TRIES = 6
AROUND = 1.5
# What a display may look like before it is fitted: slant, width over pitch, a separator's width over the pitch.
FIRST_SLANTS = (0.0, 0.1, 0.2)
FIRST_WIDTHS = (0.35, 0.5, 0.65)
FIRST_SEPARATORS = (0.0, 0.25, 0.5, 1.0)
FIRST_SHIFTS = (-2.0, 0.0, 2.0)
FORGIVEN = 3.0  # spreads: beyond, a pixel counts less and less
BELIEF = 2.0  # how many pixels a first guess is worth
DIFFERENCE = 1e-3


class Shape(NamedTuple):
    """A display's numbers, in samples of its strip, all but the ratios.

    Attributes
    ----------
    left, middle
        The middle of the first cell.
    pitch
        From cell to cell.
    separator
        How much further it is across a point or a colon, in pitches.
    width, height
        Between the middles of opposite strokes.
    slant, tilt, taper
        How far strokes lean to the right for each sample upwards; how far the row falls for each sample to the right;
        what part of their height digits lose for each sample to the right.
    across, upright
        How thick lying and standing strokes are.
    corner
        How much shorter a stroke is at each end.
    softness
        Of all edges.
    """

    left: float
    middle: float
    pitch: float
    separator: float
    width: float
    height: float
    slant: float
    tilt: float
    taper: float
    across: float
    upright: float
    corner: float
    softness: float


@dataclass(frozen=True, slots=True)
class Segments:
    """The segments of a display.

    Attributes
    ----------
    shape
        What all cells share.
    cells
        (N, 2): of each cell how many cells and how many separators stand before it.
    points
        After which cells there is a decimal point.
    shifts
        (N,): how far to the right of its place each cell stands.
    strengths
        (7,): how bright each segment is, of a usual one.
    """

    shape: Shape
    cells: Floats
    points: tuple[int, ...]
    shifts: Floats
    strengths: Floats

    def places(self, size: tuple[int, int]) -> tuple[Floats, Floats, Floats]:
        """Of each pixel of a strip (R, C) its x and y without slant and tilt, and the x of each cell's middle."""
        own = self.shape
        rows, columns = np.mgrid[: size[0], : size[1]].astype(np.float64)
        y = (rows - own.middle - own.tilt * (columns - own.left)) * np.exp(own.taper * (columns - own.left))
        x = columns - own.left + own.slant * y
        return x, y, own.pitch * (self.cells @ np.array([1.0, own.separator])) + self.shifts

    def strokes(self, x: Floats, y: Floats) -> Floats:
        """(7, ...): how much each segment covers of pixels around the middle of its cell."""
        own = self.shape
        half, long, wide = own.height / 2, own.height / 2 - 2 * own.corner, own.width - 2 * own.corner
        left, right = (_bar(x + side * own.width / 2, own.upright, own.softness) for side in (1, -1))
        upper, lower = (_bar(y + side * half / 2, long, own.softness) for side in (1, -1))
        lying = _bar(x, wide, own.softness)
        top, middle, bottom = (_bar(y + side * half, own.across, own.softness) for side in (1, 0, -1))
        strokes = np.stack(
            [lying * top, right * upper, right * lower, lying * bottom, left * lower, left * upper, lying * middle]
        )
        scaled: Floats = strokes * self.strengths.reshape(7, *[1] * x.ndim)
        return scaled

    def dots(self, x: Floats, y: Floats, middles: Floats) -> Floats:
        """How much decimal points cover of pixels."""
        own, covered = self.shape, np.zeros_like(x)
        for cell in self.points:
            between = (middles[cell] + middles[cell + 1]) / 2
            covered += _bar(x - between, own.upright, own.softness) * _bar(y - own.height / 2, own.across, own.softness)
        return covered

    def vector(self) -> Floats:
        """(12 + N + 7,): all numbers that are fitted."""
        return np.concatenate([self.shape, self.shifts, self.strengths])

    def at(self, vector: Floats) -> Segments:
        """Return the display of other numbers."""
        count = len(Shape._fields)
        lowest = np.array([-np.inf, -np.inf, 1.0, 0.0, 1.0, 2.0, -1.0, -1.0, -0.02, 0.5, 0.5, 0.0, 0.3])
        shape = np.maximum(vector[:count], lowest)
        shape[11] = min(shape[11], 0.2 * min(shape[4], shape[5]))
        shifts, strengths = vector[count : count + len(self.cells)], vector[count + len(self.cells) :]
        return replace(self, shape=Shape(*shape.tolist()), shifts=shifts, strengths=limited(strengths, 0.3, 3.0))


def lit(symbols: Sequence[str], shapes: Mapping[str, str]) -> Floats:
    """(N, 7): which segments are lit; `shapes` where a digit is drawn otherwise than usual."""
    return np.array([[name in shapes.get(symbol, SHAPES[symbol][0]) for name in NAMES] for symbol in symbols], float)


@dataclass(frozen=True, slots=True)
class Known:
    """A picture of a display whose digits are known: (R, C), and (N, 7) which segments are lit."""

    strip: Floats
    lit: Floats


@dataclass(frozen=True, slots=True)
class Fitted:
    """Segments fitted to pictures.

    Attributes
    ----------
    segments
        Them.
    left
        What part of the pictures is unexplained.
    gain
        By how many grey levels lit segments are brighter; less than none where digits are dark.
    """

    segments: Segments
    left: float
    gain: float


@dataclass(frozen=True, slots=True)
class _Left:
    """What is left of a picture: (P,), also weighted; how much of what was `shown` (L, P) it holds, and its light."""

    error: Floats
    weighted: Floats
    shares: Floats
    shown: Floats
    normal: Floats
    weights: Floats


def fitted(start: Segments, known: Sequence[Known], *, rounds: int = ROUNDS, each: bool = True) -> Fitted:
    """Fit a display's numbers to pictures of it; with `each` the shift of each cell and segments' strengths too."""
    fit = _Fit(start, known, each=each)
    own, damping = start, 1e-3
    for _ in range(rounds):
        fit.weigh(own)
        for _ in range(STEPS):
            errors, slopes, cost = fit.slopes(own)
            normal = slopes.T @ slopes + np.diag(fit.belief)
            gradient = slopes.T @ errors + fit.belief * (own.vector() - fit.first)
            for _ in range(TRIES):
                change = np.linalg.solve(normal + damping * np.diag(np.diag(normal)), gradient)
                tried = start.at(own.vector() - change)
                if fit.cost(tried) < cost:
                    own, damping = tried, damping / 5
                    break
                damping *= 4
    return Fitted(own, *fit.unexplained(own))


class _Fit:
    """Least squares for a display's numbers; what light and brightness do is solved for in each picture."""

    def __init__(self, start: Segments, known: Sequence[Known], *, each: bool = True) -> None:
        self._known = known
        self._size = known[0].strip.shape
        self._light = _light(self._size)
        self._weights = [np.ones(one.strip.size) for one in known]
        self.first = start.vector()
        own = start.shape
        shape = Shape(
            left=2.0,
            middle=2.0,
            pitch=0.1 * own.pitch,
            separator=0.5,
            width=0.15 * own.height,
            height=0.15 * own.height,
            slant=0.1,
            tilt=0.03,
            taper=0.3 / self._size[1],
            across=0.4,
            upright=0.4,
            corner=0.4,
            softness=0.3,
        )
        free = 1.0 if each else DIFFERENCE
        self._spreads = np.concatenate(
            [shape, np.full(len(start.cells), free * 0.1 * own.pitch), np.full(len(NAMES), free * 0.3)]
        )
        self.belief = np.zeros(len(self.first))

    def _near(self, own: Segments) -> Floats:
        """(P,): 1 on the display and close around it, 0 further out."""
        x, y, middles = own.places(self._size)
        high = (own.shape.height + own.shape.across) / 2 + AROUND
        wide = (own.shape.width + own.shape.upright) / 2 + AROUND
        near: Floats = ((np.abs(y) <= high) & (x >= middles[0] - wide) & (x <= middles[-1] + wide)).astype(np.float64)
        return near.ravel()

    def weigh(self, own: Segments) -> None:
        """Let pixels that are far off count less."""
        around = self._near(own)
        left = [self._left(own, one, around).error for one in self._known]
        noise = MAD_TO_SIGMA * float(np.median(np.abs(np.concatenate([one[around > 0] for one in left])))) + DIFFERENCE
        self._weights = [around / np.sqrt(1 + (one / (FORGIVEN * noise)) ** 2) for one in left]
        errors = np.concatenate([one.weighted for one in self._all(own)])
        self.belief = BELIEF * float(errors @ errors) / len(errors) / self._spreads**2

    def cost(self, own: Segments) -> float:
        """Return what is unexplained, and how far the numbers are from their first guess."""
        off = own.vector() - self.first
        return float(sum(one.weighted @ one.weighted for one in self._all(own)) + off @ (self.belief * off))

    def slopes(self, own: Segments) -> tuple[Floats, Floats, float]:
        """Return errors (E,), by how much each number changes them (E, K), and the cost."""
        parts = self._all(own)
        errors = np.concatenate([one.weighted for one in parts])
        slopes = np.concatenate([self._slopes_of(own, *both) for both in zip(self._known, parts, strict=True)])
        off = own.vector() - self.first
        return errors, slopes, float(errors @ errors + off @ (self.belief * off))

    def unexplained(self, own: Segments) -> tuple[float, float]:
        """Return what part is left, and by how much lit segments are brighter, at the mean of all pictures."""
        left = total = gain = 0.0
        for one, seen in zip(self._known, self._all(own), strict=True):
            squares = seen.weights**2
            spread = one.strip.ravel() - np.average(one.strip.ravel(), weights=squares)
            left, total = left + float(seen.weighted @ seen.weighted), total + float(squares @ spread**2)
            gain += float(seen.shares[0]) / len(self._known)
        return left / max(total, LEAST_VALUE), gain

    def left_over(self, own: Segments) -> Floats:
        """(R, C): the mean of what is left."""
        left: Floats = np.mean([one.error for one in self._all(own)], axis=0).reshape(self._size)
        return left

    def _all(self, own: Segments) -> list[_Left]:
        return [self._left(own, one, weights) for one, weights in zip(self._known, self._weights, strict=True)]

    def _drawn(self, own: Segments, one: Known) -> tuple[Floats, Floats, Floats]:
        """Return the nearest cell of each pixel (P,), what each lit segment covers (7, P), and decimal points (P,)."""
        x, y, middles = own.places(self._size)
        x, y = x.ravel(), y.ravel()
        near = np.abs(x[:, None] - middles).argmin(1)
        strokes = own.strokes(x - middles[near], y) * one.lit[near].T
        return near, strokes, own.dots(x, y, middles)

    def _left(self, own: Segments, one: Known, weights: Floats) -> _Left:
        """Compare a picture with the display drawn in its light."""
        _, strokes, dots = self._drawn(own, one)
        shown = np.stack([strokes.sum(axis=0), *self._light, dots])
        weighted = shown * weights
        normal = weighted @ weighted.T + DIFFERENCE * np.eye(len(shown))
        shares = np.linalg.solve(normal, weighted @ (one.strip.ravel() * weights))
        error = one.strip.ravel() - shares @ shown
        return _Left(error, error * weights, shares, weighted, normal, weights)

    def _slopes_of(self, own: Segments, one: Known, seen: _Left) -> Floats:
        """(P, K): by how much each number changes what is left of one picture, light and brightness solved for."""
        near, strokes, _ = self._drawn(own, one)
        drawn, count, vector = strokes.sum(axis=0), len(Shape._fields), own.vector()
        changes = np.empty((len(vector), len(drawn)))
        for place in range(count):
            step = DIFFERENCE * self._spreads[place]
            moved = vector.copy()
            moved[place] += step
            changes[place] = (self._drawn(own.at(moved), one)[1].sum(axis=0) - drawn) / step
        cells = np.arange(len(own.cells))[:, None]
        changes[count : count + len(cells)] = np.where(near == cells, changes[0], 0.0)
        changes[count + len(cells) :] = strokes / own.strengths[:, None]
        changes *= -seen.shares[0] * seen.weights
        solved: Floats = changes - (changes @ seen.shown.T) @ np.linalg.solve(seen.normal, seen.shown)
        return solved.T


def left_over(own: Segments, known: Sequence[Known]) -> Floats:
    """(R, C): what all pictures share besides the display: print beside it, its edges, what glows when it is dark."""
    fit = _Fit(own, known)
    fit.weigh(own)
    return fit.left_over(own)


def found(
    strip: Floats, symbols: Sequence[str], cells: Floats, points: Sequence[int], margin: int
) -> tuple[Fitted, Mapping[str, str]]:
    """Find the segments in a picture of the display, (R, C), that shows `symbols`, drawn around by hand.

    Returns
    -------
    Them, and how the digits are drawn that can be drawn in several ways.
    """
    several = sorted({symbol for symbol in symbols if len(SHAPES[symbol]) > 1})
    drawings = [dict(zip(several, ways, strict=True)) for ways in product(*(SHAPES[symbol] for symbol in several))]
    high, long = strip.shape[0] - 2 * margin, strip.shape[1] - 2 * margin
    outer = margin - min(margin, 1)  # of what lies further out the margin was seen, but not asked for
    inner = strip[outer : strip.shape[0] - outer, outer : strip.shape[1] - outer]
    known = [[Known(inner, lit(symbols, drawing))] for drawing in drawings]
    blur = cv2.GaussianBlur(inner, (0, 0), BLUR * high).astype(np.float32)
    blurred = [Known(blur, known[0][0].lit)]
    starts = sorted(
        _starts((high, long), cells, tuple(points), margin - outer),
        key=lambda start: _Fit(start, blurred).unexplained(start),
    )
    tries = [fitted(start, blurred, rounds=FIRST_ROUNDS, each=False).segments for start in starts[:STARTS]]
    tries = [fitted(_sharp(own), known[0], rounds=FIRST_ROUNDS, each=False).segments for own in tries]
    ways = [(_Fit(own, seen).unexplained(own), number, own) for own in tries for number, seen in enumerate(known)]
    fits = [(fitted(own, known[number]), number) for _, number, own in sorted(ways, key=lambda way: way[0])[:LAST]]
    best, number = min(fits, key=lambda fit: fit[0].left)
    own = best.segments
    moved = own.shape._replace(left=own.shape.left + outer, middle=own.shape.middle + outer)
    return fitted(replace(own, shape=moved), [Known(strip, known[number][0].lit)]), drawings[number]


def _sharp(own: Segments) -> Segments:
    """Return a display that was found in a blurred picture as it may look in the picture itself."""
    return replace(own, shape=own.shape._replace(softness=SHARP))


def _starts(size: tuple[int, int], cells: Floats, points: tuple[int, ...], margin: int) -> Iterator[Segments]:
    """List what a display of this size may be, within a margin."""
    high, long = size
    stroke = max(high / 8, 1.0)
    count, separators = cells[-1]
    for slant, part, separator, off in product(
        FIRST_SLANTS, FIRST_WIDTHS, FIRST_SEPARATORS if separators else (0.0,), FIRST_SHIFTS
    ):
        height = high - stroke
        pitch = (long - stroke - slant * height) / (count + separator * separators + part)
        width = part * pitch
        left = margin + (width + stroke + slant * height - 1) / 2 + off
        shape = Shape(
            left,
            margin + (high - 1) / 2,
            pitch,
            separator,
            width,
            height,
            slant,
            0.0,
            0.0,
            stroke,
            stroke,
            0.5,
            SHARP + BLUR * high,
        )
        yield Segments(shape, cells, points, np.zeros(len(cells)), np.ones(7))


def _light(size: tuple[int, ...]) -> Floats:
    """(3, R * C): light that is even, and that changes along the rows or the columns."""
    rows, columns = np.mgrid[: size[0], : size[1]].astype(np.float64)
    return np.stack([np.ones(rows.size), rows.ravel() / size[0] - 0.5, columns.ravel() / size[1] - 0.5])


def _bar(distance: Floats, length: float, softness: float) -> Floats:
    """How much a bar of this length covers of pixels so far from its middle."""
    half = length / 2
    covered: Floats = 0.5 * (np.tanh((distance + half) / softness) - np.tanh((distance - half) / softness))
    return covered
