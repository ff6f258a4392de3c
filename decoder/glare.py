"""Reading through a glare: a soft reflection adds light that changes slowly over the dial, and takes contrast away.

Where a needle does not match as it should, it is searched for once more with everything left out that a smooth light
can explain: the gauge, the face and the needle lose their projection on the low polynomials of the window (thesis 3.3
names reflections as what loses readings). A needle that the glare wholly covers leaves nothing to match, and is not
found here either.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from decoder.arrays import Floats, Mask
from decoder.needle_template import NeedleTemplate
from decoder.over_face import FACE_NOISE_LEVELS
from decoder.searching import COARSE_STEP, thinned
from decoder.unwrapping import rows_at

# Powers of row and column that a light may follow within one template.
LIGHT_POWERS = ((0, 0), (1, 0), (0, 1), (2, 0), (1, 1), (0, 2))
FREEDOM = len(LIGHT_POWERS) + 2  # the light, the face, the needle
# What keeps the lights' normal matrix from being singular, a part of its trace.
LIGHT_HOLD = 1e-12
MIN_LEFT_LEVELS = 1.0
MIN_GAIN = 0.2
# With less of its contrast in sight than this a needle is not looked for; the score itself allows for few pixels.
MIN_VISIBLE = 0.05
# Pixels that a glare drives to white say nothing of what lies below.
SATURATED_LEVEL = 245.0
STEPS = 6
SETTLED_ROWS = 0.01
MIN_DETERMINANT = 1e-6
MAX_STEP_ROWS = 3.0


@dataclass(frozen=True, slots=True)
class SeenThrough:
    """Where a needle was found through a glare: the row of its axis, the spread of that, and its score.

    `visible` is the part of its contrast that is not drowned in white.
    """

    row: float
    sigma_rows: float
    score: float
    visible: float


NOT_SEEN = SeenThrough(0.0, math.inf, 0.0, 0.0)


class ThroughGlare:
    """Finds one needle under uneven light; `face` (R, C) is the dial without needles."""

    def __init__(self, template: NeedleTemplate, pixels_per_sample: float, face: Floats) -> None:
        self._template = template
        self._face = face
        self._pixels_per_sample = pixels_per_sample
        self._coarse = thinned(template)
        self._axis = (template.rows - 1) // 2

    def find(self, gauge: Floats, allowed: Mask) -> SeenThrough:
        """The needle's place on an allowed row; `gauge` (R, C) and `allowed` (R,)."""
        scores = self._coarse_scores(gauge)
        rows = COARSE_STEP * ((self._coarse.rows - 1) // 2 + np.arange(len(scores)))
        scores = np.where(allowed[rows], scores, -1.0)
        best = int(scores.argmax())
        return self._settled(gauge, float(rows[best])) if scores[best] > 0 else NOT_SEEN

    @cached_property
    def _powers(self) -> Floats:
        return np.ascontiguousarray(_light_powers(*self._template.trust.shape).T)

    @cached_property
    def _coarse_light(self) -> _Light:
        return _Light(self._coarse.trust, _light_powers(*self._coarse.trust.shape))

    @cached_property
    def _over_face(self) -> _OverFace:
        """The needle on each row, coarse."""
        face = self._windows(self._face)
        needle = self._coarse.light.ravel() + (self._coarse.transparency.ravel() - 1) * face
        return _OverFace(self._coarse_light.without(needle), self._coarse_light.without(face))

    def _windows(self, image: Floats) -> Floats:
        height, thin = self._coarse.rows, np.ascontiguousarray(image[::COARSE_STEP, ::COARSE_STEP])
        rows, columns = thin.shape
        shape, strides = (rows - height + 1, height * columns), thin.strides
        return np.ndarray(shape, thin.dtype, thin, strides=strides)

    def _coarse_scores(self, gauge: Floats) -> Floats:
        return self._over_face.correlation(self._coarse_light.without(self._windows(gauge)))

    def _settled(self, gauge: Floats, row: float) -> SeenThrough:
        """Least squares for gain and shift, all that light explains left out."""
        start, found = row, NOT_SEEN
        for _ in range(STEPS):
            middle = round(row)
            if not self._axis <= middle < len(gauge) - self._axis or abs(row - start) > MAX_STEP_ROWS:
                return NOT_SEEN
            window = slice(middle - self._axis, middle + self._axis + 1)
            found, step_rows = self._step(gauge[window], self._face[window], row - middle)
            found = replace(found, row=row + step_rows)
            row += step_rows
            if found.score <= 0 or abs(step_rows) < SETTLED_ROWS:
                break
        return found if found.visible >= MIN_VISIBLE else NOT_SEEN

    def _step(self, seen: Floats, face: Floats, fraction: float) -> tuple[SeenThrough, float]:
        """What one step of least squares finds in a window (H, C), and how many rows further the needle lies."""
        trust, drowned = self._template.trust, seen >= SATURATED_LEVEL
        clear = trust * ~drowned if drowned.any() else trust
        total = float(clear.sum())
        pixels = total * self._pixels_per_sample
        if pixels <= FREEDOM + 1:
            return NOT_SEEN, 0.0
        needle, slope = self._layers(face, fraction)
        rows = np.concatenate([self._powers, np.stack([needle, slope, face, seen]).reshape(4, -1)])
        moments = (rows * clear.ravel()) @ rows.T
        without_light = _without(moments, len(LIGHT_POWERS))
        (nn, nd, nf, ns), (_, dd, _, ds), (_, _, ff, fs), (_, _, _, ss) = without_light.tolist()
        determinant = nn * dd - nd * nd
        if determinant <= MIN_DETERMINANT * nn * dd:
            return NOT_SEEN, 0.0
        gain, shift = (dd * ns - nd * ds) / determinant, (nn * ds - nd * ns) / determinant
        if gain < MIN_GAIN:
            return NOT_SEEN, 0.0
        noise = max(ss - gain * ns - shift * ds, 0.0) / total
        sigma_rows = math.sqrt(noise * nn / determinant / self._pixels_per_sample) / gain
        apart = [[nn - 2 * nf + ff, nf - ff, ns - fs], [nf - ff, ff, fs], [ns - fs, fs, ss]]
        score = _adjusted(_partial_correlation(apart, trust.size), pixels)
        contrast = (needle - face) ** 2
        visible = float((contrast * clear).sum() / max(float((contrast * trust).sum()), 1e-9))
        return SeenThrough(0.0, sigma_rows, score, visible), shift / gain

    def _layers(self, face: Floats, fraction: float) -> tuple[Floats, Floats]:
        """The needle over the face, its axis a fraction of a row below the middle, and how that changes downwards."""
        rows = np.arange(self._template.rows) - fraction
        layers = rows_at(self._template.both_layers, rows)
        slopes, columns = _slopes(layers), face.shape[1]
        needle = layers[:, columns:] * face
        needle += layers[:, :columns]
        slope = slopes[:, columns:] * -face
        slope -= slopes[:, :columns]
        return needle, slope


def _without(moments: Floats, count: int) -> Floats:
    """(K, K): the moments of all but the first so many layers, without what these explain; (count + K, ...) float64."""
    of_light, shared = moments[:count, :count], moments[:count, count:]
    held = of_light + LIGHT_HOLD * np.trace(of_light) * np.eye(count)  # where few pixels are left, lights are alike
    left: Floats = moments[count:, count:] - shared.T @ np.linalg.solve(held, shared)
    return left


def _partial_correlation(moments: Sequence[Sequence[float]], pixels: int) -> float:
    """As `_OverFace.correlation`, from the moments of needle, face and gauge, in this order."""
    (nn, nf, ns), (_, ff, fs), (_, _, ss) = moments
    of_face = ff + pixels * FACE_NOISE_LEVELS**2
    part = (2.0 - ff / of_face) / of_face
    needle_left, seen_left, both = nn - nf * nf * part, ss - fs * fs * part, ns - nf * fs * part
    shown = min(needle_left, seen_left) > pixels * MIN_LEFT_LEVELS**2
    return both / math.sqrt(needle_left * seen_left) if shown else 0.0


def _slopes(layers: Floats) -> Floats:
    """(H, C): how layers change down the rows, as `np.gradient` has it, at a fifth of its cost."""
    slopes = np.empty_like(layers)
    np.subtract(layers[2:], layers[:-2], out=slopes[1:-1])
    slopes[1:-1] /= 2
    slopes[0], slopes[-1] = layers[1] - layers[0], layers[-1] - layers[-2]
    return slopes


def _adjusted(score: float, pixels: float) -> float:
    """A correlation as it would be without the freedom that few pixels give (Ezekiel's adjusted R squared)."""
    if score <= 0 or pixels <= FREEDOM + 1:
        return 0.0
    return math.sqrt(max(1.0 - (1.0 - score**2) * (pixels - 1) / (pixels - FREEDOM - 1), 0.0))


def _light_powers(height: int, width: int) -> Floats:
    """(H * C, 6): the powers that a light may follow."""
    row, column = np.meshgrid(np.linspace(-1, 1, height), np.linspace(-1, 1, width), indexing="ij")
    return np.stack([(row**i * column**j).ravel() for i, j in LIGHT_POWERS], axis=1)


class _Light:
    """Takes out of windows what a smooth light explains; `trust` (H, C) weighs the pixels."""

    def __init__(self, trust: Floats, powers: Floats) -> None:
        self._root = np.sqrt(trust.ravel().astype(np.float64))
        self._basis, _ = np.linalg.qr(powers * self._root[:, None])

    def without(self, windows: Floats) -> Floats:
        """(..., H * C), times the root of the weights, without the light."""
        weighted = windows * self._root
        left: Floats = weighted - (weighted @ self._basis) @ self._basis.T
        return left


class _OverFace:
    """A needle over a face, (N, M) each, without what light explains: what gauges are held against."""

    def __init__(self, needle: Floats, face: Floats) -> None:
        self._face = face
        self._of_face = (face * face).sum(axis=1) + face.shape[1] * FACE_NOISE_LEVELS**2
        self._needle = self._without_face(needle)
        self._needle_left = (self._needle * self._needle).sum(axis=1)

    def correlation(self, seen: Floats) -> Floats:
        """Of needle and gauge (N, M) given the face: (N,) in [-1, 1]; 0 where too little is left."""
        seen = self._without_face(seen)
        seen_left, both = (seen * seen).sum(axis=1), (self._needle * seen).sum(axis=1)
        usable = np.minimum(self._needle_left, seen_left) > seen.shape[1] * MIN_LEFT_LEVELS**2
        spread = np.sqrt(self._needle_left * seen_left)
        scores: Floats = np.divide(both, spread, out=np.zeros_like(both), where=usable)
        return scores

    def _without_face(self, windows: Floats) -> Floats:
        left: Floats = windows - ((windows * self._face).sum(axis=1) / self._of_face)[:, None] * self._face
        return left
