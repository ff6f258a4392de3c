"""Seven segments: the geometry of a display's segments, fitted to pictures whose digits are known.

A display is a row of cells of one shape, drawn by a formula: seven strokes with soft edges, slanted, the same in each
cell. It has so few parameters that one picture with known digits determines them, and with them the look of all ten
digits. A cell may stand slightly off its place, and a segment may be brighter than another.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from itertools import product
from typing import NamedTuple

import cv2
import numpy as np

from decoder.imaging.sorting import MAD_TO_SIGMA
from decoder.panel.arrays import Floats, Indices, limited
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

# Rounds of a fit, each with new weights, and steps per round.
ROUNDS = 3
FIRST_ROUNDS = 2
STEPS = 4
STARTS = 6
LAST = 2
BLUR = 0.1  # of the height, for the first search
SHARP = 0.8
TRIES = 6
AROUND = 1.5
# Initial values: slant, width over pitch, a separator's width over the pitch.
FIRST_SLANTS = (0.0, 0.1, 0.2)
FIRST_WIDTHS = (0.35, 0.5, 0.65)
FIRST_SEPARATORS = (0.0, 0.25, 0.5, 1.0)
FIRST_SHIFTS = (-2.0, 0.0, 2.0)
FORGIVEN = 3.0  # sigma; pixels further off count less and less
BELIEF = 2.0  # the weight of a first guess, in pixels
DIFFERENCE = 1e-3
# How many displays are remembered as they were found in a picture.
KEPT = 64


class Shape(NamedTuple):
    """A display's parameters, in samples of its strip except for ratios.

    Attributes
    ----------
    left, middle
        The middle of the first cell.
    pitch
        From cell to cell.
    separator
        The extra distance across a point or a colon, in pitches.
    width, height
        Between the middles of opposite strokes.
    slant, tilt, taper
        How far strokes lean to the right per sample upwards; how far the row falls per sample to the right; the part of
        their height that digits lose per sample to the right.
    across, upright
        The thickness of horizontal and vertical strokes.
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
        (N, 2): for each cell, how many cells and how many separators precede it.
    points
        The cells that are followed by a decimal point.
    shifts
        (N,): how far to the right of its place each cell stands.
    strengths
        (7,): the brightness of each segment relative to the usual.
    """

    shape: Shape
    cells: Floats
    points: tuple[int, ...]
    shifts: Floats
    strengths: Floats

    def places(self, size: tuple[int, int]) -> tuple[Floats, Floats, Floats]:
        """Return x and y of each pixel of a strip (R, C) with slant and tilt removed, and x of each cell's middle."""
        own = self.shape
        rows, columns = np.arange(float(size[0]))[:, None], np.arange(float(size[1]))
        y = (rows - own.middle - own.tilt * (columns - own.left)) * np.exp(own.taper * (columns - own.left))
        x = columns - own.left + own.slant * y
        return x, y, own.pitch * (self.cells @ np.array([1.0, own.separator])) + self.shifts

    def strokes(self, x: Floats, y: Floats) -> Floats:
        """(7, ...): how much each segment covers of pixels at x, y from the middle of its cell."""
        own = self.shape
        half, long, wide = own.height / 2, own.height / 2 - 2 * own.corner, own.width - 2 * own.corner
        left, right = (_bar(x + side * own.width / 2, own.upright, own.softness) for side in (1, -1))
        upper, lower = (_bar(y + side * half / 2, long, own.softness) for side in (1, -1))
        lying = _bar(x, wide, own.softness)
        top, middle, bottom = (_bar(y + side * half, own.across, own.softness) for side in (1, 0, -1))
        strokes = np.stack(
            [lying * top, right * upper, right * lower, lying * bottom, left * lower, left * upper, lying * middle]
        )
        strokes *= self.strengths.reshape(7, *[1] * x.ndim)
        return strokes

    def dot(self, x: Floats, y: Floats, left: float, right: float) -> Floats:
        """Return how much a decimal point between two cells covers of pixels."""
        own = self.shape
        across = _bar(x - (left + right) / 2, own.upright, own.softness)
        return across * _bar(y - own.height / 2, own.across, own.softness)

    def dots(self, x: Floats, y: Floats, middles: Floats) -> Floats:
        """Return how much decimal points cover of pixels."""
        return sum((self.dot(x, y, *middles[cell : cell + 2]) for cell in self.points), np.zeros_like(x))

    def vector(self) -> Floats:
        """(12 + N + 7,): all fitted parameters."""
        return np.concatenate([self.shape, self.shifts, self.strengths])

    def at(self, vector: Floats) -> Segments:
        """Return the display with other parameters, clipped to what is possible."""
        count = len(Shape._fields)
        lowest = np.array([-np.inf, -np.inf, 1.0, 0.0, 1.0, 2.0, -1.0, -1.0, -0.02, 0.5, 0.5, 0.0, 0.3])
        shape = np.maximum(vector[:count], lowest)
        shape[11] = min(shape[11], 0.2 * min(shape[4], shape[5]))
        shifts, strengths = vector[count : count + len(self.cells)], vector[count + len(self.cells) :]
        return replace(self, shape=Shape(*shape.tolist()), shifts=shifts, strengths=limited(strengths, 0.3, 3.0))


def lit(symbols: Sequence[str], shapes: Mapping[str, str]) -> Floats:
    """(N, 7): which segments are lit; `shapes` says which digits are drawn differently from usual."""
    return np.array([[name in shapes.get(symbol, SHAPES[symbol][0]) for name in NAMES] for symbol in symbols], float)


@dataclass(frozen=True, slots=True)
class Known:
    """A picture (R, C) of a display whose digits are known, and (N, 7) which segments are lit."""

    strip: Floats
    lit: Floats


@dataclass(frozen=True, slots=True)
class Fitted:
    """Segments fitted to pictures.

    Attributes
    ----------
    segments
        The segments.
    left
        The part of the pictures' variance left unexplained.
    gain
        How many grey levels brighter lit segments are; negative where digits are dark.
    """

    segments: Segments
    left: float
    gain: float


@dataclass(frozen=True, slots=True)
class _Left:
    """A picture's residual (P,), plain and weighted, the coefficients of what was `shown` (L, P), and its light."""

    error: Floats
    weighted: Floats
    shares: Floats
    shown: Floats
    normal: Floats
    weights: Floats


def fitted(start: Segments, known: Sequence[Known], *, rounds: int = ROUNDS, each: bool = True) -> Fitted:
    """Fit a display's parameters to pictures; with `each`, also each cell's shift and the segments' strengths."""
    fit = _Fit(start, known, each=each)
    own, damping = start, 1e-3
    for _ in range(rounds):
        fit.weigh(own)
        here: Segments | None = None
        for _ in range(STEPS):
            if here is not own:
                errors, slopes, cost = fit.slopes(own)
                normal = slopes.T @ slopes + np.diag(fit.belief)
                gradient = slopes.T @ errors + fit.belief * (own.vector() - fit.first)
                here = own
            for _ in range(TRIES):
                change = np.linalg.solve(normal + damping * np.diag(np.diag(normal)), gradient)
                tried = start.at(own.vector() - change)
                if fit.cost(tried) < cost:
                    own, damping = tried, damping / 5
                    break
                damping *= 4
    return Fitted(own, *fit.unexplained(own))


class _Fit:
    """Least squares for a display's parameters; light and brightness of each picture are solved for within it."""

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
        """Reduce the weight of pixels with large residuals."""
        around = self._near(own)
        left = [self._left(own, one, around).error for one in self._known]
        noise = MAD_TO_SIGMA * float(np.median(np.abs(np.concatenate([one[around > 0] for one in left])))) + DIFFERENCE
        self._weights = [around / np.sqrt(1 + (one / (FORGIVEN * noise)) ** 2) for one in left]
        errors = np.concatenate([one.weighted for one in self._all(own)])
        self.belief = BELIEF * float(errors @ errors) / len(errors) / self._spreads**2

    def cost(self, own: Segments) -> float:
        """Return the squared residuals plus the penalty for leaving the first guess."""
        off = own.vector() - self.first
        return float(sum(one.weighted @ one.weighted for one in self._all(own)) + off @ (self.belief * off))

    def slopes(self, own: Segments) -> tuple[Floats, Floats, float]:
        """Return the residuals (E,), their derivatives by each parameter (E, K), and the cost."""
        parts = self._all(own)
        errors = np.concatenate([one.weighted for one in parts])
        slopes = np.concatenate([self._slopes_of(own, *both) for both in zip(self._known, parts, strict=True)])
        off = own.vector() - self.first
        return errors, slopes, float(errors @ errors + off @ (self.belief * off))

    def unexplained(self, own: Segments) -> tuple[float, float]:
        """Return the part left unexplained, and how much brighter lit segments are, averaged over all pictures."""
        left = total = gain = 0.0
        for one, seen in zip(self._known, self._all(own), strict=True):
            squares = seen.weights**2
            spread = one.strip.ravel() - np.average(one.strip.ravel(), weights=squares)
            left, total = left + float(seen.weighted @ seen.weighted), total + float(squares @ spread**2)
            gain += float(seen.shares[0]) / len(self._known)
        return left / max(total, LEAST_VALUE), gain

    def left_over(self, own: Segments) -> Floats:
        """(R, C): the mean residual."""
        left: Floats = np.mean([one.error for one in self._all(own)], axis=0).reshape(self._size)
        return left

    def _all(self, own: Segments) -> list[_Left]:
        return [self._left(own, one, weights) for one, weights in zip(self._known, self._weights, strict=True)]

    def _drawn(self, own: Segments, one: Known) -> tuple[Indices, Floats]:
        """Return the nearest cell of each pixel (P,), and the coverage of each lit segment (7, P)."""
        x, y, middles = own.places(self._size)
        x, y = x.ravel(), y.ravel()
        near = np.abs(x - middles[:, None]).argmin(0)
        strokes = own.strokes(x - middles[near], y)
        strokes *= one.lit.T[:, near]
        return near, strokes

    def _left(self, own: Segments, one: Known, weights: Floats) -> _Left:
        """Compare a picture with the display drawn in its light."""
        _, strokes = self._drawn(own, one)
        shown = np.stack([strokes.sum(axis=0), *self._light, own.dots(*own.places(self._size)).ravel()])
        weighted = shown * weights
        normal = weighted @ weighted.T + DIFFERENCE * np.eye(len(shown))
        shares = np.linalg.solve(normal, weighted @ (one.strip.ravel() * weights))
        error = one.strip.ravel() - shares @ shown
        return _Left(error, error * weights, shares, weighted, normal, weights)

    def _slopes_of(self, own: Segments, one: Known, seen: _Left) -> Floats:
        """(P, K): the derivatives of one picture's residual, with light and brightness solved for."""
        near, strokes = self._drawn(own, one)
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
    """(R, C): what all pictures share besides the display: nearby print, its edges, the glow of dark segments."""
    fit = _Fit(own, known)
    fit.weigh(own)
    return fit.left_over(own)


def found(
    strip: Floats, symbols: Sequence[str], cells: Floats, points: Sequence[int], margin: int
) -> tuple[Fitted, Mapping[str, str]]:
    """Find the segments in a picture (R, C) of the display, drawn around by hand, that shows `symbols`.

    The result is cached: it takes seconds, and is needed again whenever another part of the panel is redrawn.

    Returns
    -------
    The fit, and the segments of those digits that can be drawn in several ways.
    """
    picture, places = (strip.tobytes(), strip.dtype.str, strip.shape), tuple(map(tuple, cells.tolist()))
    return _found(picture, tuple(symbols), places, tuple(points), margin)


@lru_cache(maxsize=KEPT)
def _found(
    picture: tuple[bytes, str, tuple[int, ...]],
    symbols: tuple[str, ...],
    places: tuple[tuple[float, ...], ...],
    points: tuple[int, ...],
    margin: int,
) -> tuple[Fitted, Mapping[str, str]]:
    levels, kind, shape = picture
    strip, cells = np.frombuffer(levels, kind).reshape(shape), np.array(places)
    several = sorted({symbol for symbol in symbols if len(SHAPES[symbol]) > 1})
    drawings = [dict(zip(several, ways, strict=True)) for ways in product(*(SHAPES[symbol] for symbol in several))]
    high, long = strip.shape[0] - 2 * margin, strip.shape[1] - 2 * margin
    outer = margin - min(margin, 1)  # the margin further out is part of the strip but not used here
    inner = strip[outer : strip.shape[0] - outer, outer : strip.shape[1] - outer]
    known = [[Known(inner, lit(symbols, drawing))] for drawing in drawings]
    blur = cv2.GaussianBlur(inner, (0, 0), BLUR * high).astype(np.float32)
    blurred = [Known(blur, known[0][0].lit)]
    starts = sorted(
        _starts((high, long), cells, points, margin - outer),
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
    """Return a display found in a blurred picture with the sharpness it may have in the picture itself."""
    return replace(own, shape=own.shape._replace(softness=SHARP))


def _starts(size: tuple[int, int], cells: Floats, points: tuple[int, ...], margin: int) -> Iterator[Segments]:
    """Yield initial guesses of a display of this size, within a margin."""
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
    """(3, R * C): light modes: constant, and linear along rows and columns."""
    rows, columns = np.mgrid[: size[0], : size[1]].astype(np.float64)
    return np.stack([np.ones(rows.size), rows.ravel() / size[0] - 0.5, columns.ravel() / size[1] - 0.5])


def _bar(distance: Floats, length: float, softness: float) -> Floats:
    """Return how much a bar of this length covers of pixels at this distance from its middle."""
    half = length / 2
    covered: Floats = 0.5 * (np.tanh((distance + half) / softness) - np.tanh((distance - half) / softness))
    return covered
