"""The cells of a display: which digit each shows, by comparing it with what every digit looks like there.

A cell is compared with all digits at once, each also at small offsets, because frames are aligned to fractions of a
pixel only, and some fonts draw a digit off the middle of its cell. The best digit is right if no other segment shows in
the residual, and none of its own is missing.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import product

import numpy as np

from decoder.instruments.kinds.windows.segments import NAMES, Segments
from decoder.panel.arrays import Floats, Indices
from decoder.panel.thresholds import LEAST_VALUE

# How far off its place a digit may be, in pitches along the row, and in samples across it.
ALONG = 0.2
ACROSS = 1.0
STEP = 0.5
# Samples around the strokes that are compared too.
BESIDE = 1.5


@dataclass(frozen=True, slots=True)
class Seen:
    """What N cells show in F frames.

    Attributes
    ----------
    symbols, ways
        (F, N): the best digit, and the way to draw it.
    scores
        (F, N): its NCC.
    gains
        (F, N): its brightness, in grey levels.
    contents, lefts
        (F, N): how bright the faintest digit would have to be to account for everything in the cell, and for the
        residual of the best digit.
    worse
        (F, N): the ratio of what the second best digit leaves unexplained to what the best does.
    strays
        (F, N, 7): the excess of each segment, relative to that brightness; negative where it is missing.
    points
        (F, N - 1): how bright a decimal point between neighbours is, in grey levels.
    """

    symbols: Indices
    ways: Indices
    scores: Floats
    gains: Floats
    contents: Floats
    lefts: Floats
    worse: Floats
    strays: Floats
    points: Floats


@dataclass(frozen=True, slots=True)
class Cells:
    """All N cells of a display, of P pixels each (padded with zeros), with S ways to draw a digit at H offsets.

    Attributes
    ----------
    pixels
        (N, P): indices into the strip.
    still
        (N, P, L): the light modes and what stands still there, orthonormal.
    strokes
        (N, P, H * 7): the segments, with light projected out.
    which
        (7, S): the segments of each way to draw a digit.
    lengths
        (N, H * S): the norms of the digits without light.
    shared, besides
        (N, H * S, 7): the projection of each segment on a digit, and the square of the rest of the segment.
    alike
        (S,): the digit that each way draws.
    dots
        (N - 1, R * C): weights of pixels that add up to a point's brightness, whatever its neighbours show.
    sign
        -1 where digits are dark.
    """

    pixels: Indices
    still: Floats
    strokes: Floats
    which: Floats
    lengths: Floats
    shared: Floats
    besides: Floats
    alike: Indices
    dots: Floats
    sign: float

    @classmethod
    def of(cls, own: Segments, drawings: Sequence[tuple[str, str]], ground: Floats, sign: float) -> Cells:
        """Draw the cells of a display.

        Parameters
        ----------
        drawings : digits and their segments
        ground : (R, C) what else is seen there, in any light
        """
        x, y, middles = (part.ravel() for part in own.places((ground.shape[0], ground.shape[1])))
        shape, still = own.shape, ground.ravel()
        wide, high = (shape.width + shape.upright) / 2 + BESIDE, (shape.height + shape.across) / 2 + BESIDE
        wide = max(wide, shape.pitch / 2)  # so that print between cells makes none of them seem dark
        inside = [np.flatnonzero((np.abs(x - middle) <= wide) & (np.abs(y) <= high)) for middle in middles]
        count = max(map(len, inside), default=0)
        which = np.array([[name in way for name in NAMES] for _, way in drawings], float)
        parts = []
        for middle, pixels in zip(middles, inside, strict=True):
            around = x[pixels] - middle, y[pixels]
            seen = [np.ones(len(pixels)), *around, *([still[pixels]] if still[pixels].any() else [])]
            light = np.linalg.qr(np.stack(seen, axis=1))[0]
            strokes = np.stack(
                [own.strokes(around[0] - right, around[1] - down) for right, down in _shifts(shape.pitch)]
            )
            strokes -= (strokes @ light) @ light.T
            parts.append(
                (_padded(pixels, count), _padded(_padded(light.T, count).T, 4, axis=1), _padded(strokes, count))
            )
        pixels, light, strokes = (np.stack(part) for part in zip(*parts, strict=True))
        together = strokes @ np.swapaxes(strokes, 2, 3)
        shared = which @ together
        lengths = np.maximum(np.sqrt(np.vecdot(shared, which)), LEAST_VALUE)
        shared /= lengths[..., None]
        besides = np.maximum(np.diagonal(together, axis1=2, axis2=3)[:, :, None] - shared**2, LEAST_VALUE)
        return cls(
            pixels,
            light.astype(np.float32),
            np.ascontiguousarray(strokes.reshape(len(strokes), -1, count).swapaxes(1, 2), np.float32),
            np.ascontiguousarray(which.T, np.float32),
            lengths.reshape(len(strokes), -1).astype(np.float32),
            shared.reshape(len(strokes), -1, len(NAMES)).astype(np.float32),
            besides.reshape(len(strokes), -1, len(NAMES)).astype(np.float32),
            np.array([int(digit) for digit, _ in drawings]),
            _dots(own, x, y, middles),
            sign,
        )

    def seen(self, strips: Floats) -> Seen:
        """Compare each of F frames (F, R, C) with all digits, bit for bit independently of the other frames."""
        flat = strips.reshape(len(strips), -1)
        own = np.ascontiguousarray(flat[:, self.pixels], np.float32)  # sums depend on the memory layout
        own *= self.sign * self.still.any(axis=2)
        light = np.matmul(own[:, :, None, :], self.still)
        own -= np.matmul(light, self.still.transpose(0, 2, 1))[:, :, 0]
        lengths = np.maximum(np.sqrt(np.einsum("fnp,fnp->fn", own, own)), LEAST_VALUE)
        segments = np.matmul(own[:, :, None, :], self.strokes).reshape(*own.shape[:2], -1, len(self.which))
        scores = np.matmul(segments, self.which).reshape(*own.shape[:2], -1) / self.lengths / lengths[..., None]
        ways = scores.reshape(*scores.shape[:2], -1, len(self.alike)).max(axis=2)
        each = np.stack([ways[..., self.alike == number].max(axis=-1) for number in range(10)], axis=-1)
        symbols, best = each.argmax(axis=-1), scores.argmax(axis=-1)
        second, first = np.moveaxis(np.sort(each, axis=-1)[..., -2:], -1, 0)
        worse = (1 - np.maximum(second, 0.0) ** 2) / np.maximum(1 - first**2, LEAST_VALUE)
        cells = np.arange(len(self.pixels))
        gains = first * lengths / self.lengths[cells, best]
        theirs = np.take_along_axis(segments, best[..., None, None] // len(self.alike), axis=2)[:, :, 0]
        strays = (theirs - (first * lengths)[..., None] * self.shared[cells, best]) / self.besides[cells, best]
        strays /= np.maximum(gains, LEAST_VALUE)[..., None]
        contents = lengths / self.lengths.min(axis=1)
        lefts = contents * np.sqrt(np.maximum(1 - first**2, 0.0))
        points = np.vecdot(np.asarray(flat[:, None], np.float32), self.dots) * self.sign
        return Seen(symbols, best % len(self.alike), first, gains, contents, lefts, worse, strays, points)


def _dots(own: Segments, x: Floats, y: Floats, middles: Floats) -> Floats:
    """(N - 1, P): the weights of `dots`, for pixels at x, y."""
    dots = np.zeros((len(middles) - 1, len(x)), np.float32)
    for weights, left, right in zip(dots, middles, middles[1:], strict=False):
        high = own.shape.across + BESIDE
        near = np.flatnonzero((np.abs(y - own.shape.height / 2) <= high) & (x >= left) & (x <= right))
        across, down = x[near], y[near]
        others = [
            np.ones(len(near)),
            across,
            down,
            *own.strokes(across - left, down),
            *own.strokes(across - right, down),
        ]
        alone = own.dot(across, down, left, right)
        alone -= np.transpose(others) @ np.linalg.lstsq(np.transpose(others), alone)[0]
        weights[near] = alone / max(float(alone @ alone), LEAST_VALUE)
    return dots


def _shifts(pitch: float) -> list[tuple[float, float]]:
    """List the offsets at which a digit may be, to the right and downwards."""
    reaches = round(ALONG * pitch / STEP), round(ACROSS / STEP)
    along, across = (STEP * np.arange(-reach, reach + 1) for reach in reaches)
    return list(product(along.tolist(), across.tolist()))


def _padded(values: Floats | Indices, count: int, axis: int = -1) -> Floats:
    """Pad an axis with zeros."""
    lacking = [(0, 0)] * values.ndim
    lacking[axis] = (0, count - values.shape[axis])
    return np.pad(values, lacking)
