"""Reading through a glare: a soft reflection adds light that changes slowly over the dial, and takes contrast away.

Where a needle does not match as it should, it is searched for once more with everything left out that a smooth light
can explain: the gauge, the face and the needle lose their projection on the low polynomials of the window (thesis 3.3
names reflections as what loses readings). A needle that the glare wholly covers leaves nothing to match, and is not
found here either.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from decoder.arrays import Floats, Mask
from decoder.needle_template import NeedleTemplate
from decoder.over_face import FACE_NOISE_LEVELS
from decoder.searching import COARSE_STEP, thinned
from decoder.unwrapping import rows_at

# Powers of row and column that a light may follow within one template.
LIGHT_POWERS = ((0, 0), (1, 0), (0, 1), (2, 0), (1, 1), (0, 2))
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

    def _coarse_scores(self, gauge: Floats) -> Floats:
        height = self._coarse.rows
        step = COARSE_STEP
        seen, face = (
            np.lib.stride_tricks.sliding_window_view(image[::step, ::step], height, axis=0)
            .transpose(0, 2, 1)
            .reshape(-1, height * image[::step, ::step].shape[1])
            for image in (gauge, self._face)
        )
        needle = self._coarse.light.ravel() + (self._coarse.transparency.ravel() - 1) * face
        light = _Light(self._coarse.trust)
        return _partial_correlation(light.without(needle), light.without(seen), light.without(face))

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
        drowned = seen >= SATURATED_LEVEL
        light = _Light(self._template.trust * ~drowned)
        needle, slope = self._layers(face, fraction)
        columns = np.stack([light.without(layer.ravel()) for layer in (needle, slope)])
        values = light.without(seen.ravel())
        normal = columns @ columns.T
        if light.total <= 0 or np.linalg.det(normal) <= MIN_DETERMINANT * normal[0, 0] * normal[1, 1]:
            return NOT_SEEN, 0.0
        inverse = np.linalg.inv(normal)
        gain, shift = (inverse @ (columns @ values)).tolist()
        if gain < MIN_GAIN:
            return NOT_SEEN, 0.0
        left = values - gain * columns[0] - shift * columns[1]
        noise = float(left @ left) / light.total
        sigma_rows = math.sqrt(noise * float(inverse[1, 1]) / self._pixels_per_sample) / gain
        bare = light.without((needle - face).ravel())
        score = float(_partial_correlation(bare[None], values[None], light.without(face.ravel())[None])[0])
        score = _adjusted(score, light.total * self._pixels_per_sample)
        contrast = self._template.trust * (needle - face) ** 2
        visible = float(contrast[~drowned].sum() / max(float(contrast.sum()), 1e-9))
        return SeenThrough(0.0, sigma_rows, score, visible), shift / gain

    def _layers(self, face: Floats, fraction: float) -> tuple[Floats, Floats]:
        """The needle over the face, its axis a fraction of a row below the middle, and how that changes downwards."""
        rows = np.arange(self._template.rows) - fraction
        light, transparency = rows_at(self._template.light, rows), rows_at(self._template.transparency, rows)
        needle = transparency * face + light
        slope = -np.gradient(transparency, axis=0) * face - np.gradient(light, axis=0)
        return needle, slope


def _adjusted(score: float, pixels: float) -> float:
    """A correlation as it would be without the freedom that few pixels give (Ezekiel's adjusted R squared)."""
    freedom = len(LIGHT_POWERS) + 2  # the light, the face, the needle
    if score <= 0 or pixels <= freedom + 1:
        return 0.0
    return math.sqrt(max(1.0 - (1.0 - score**2) * (pixels - 1) / (pixels - freedom - 1), 0.0))


class _Light:
    """Takes out of windows what a smooth light explains; `trust` (H, C) weighs the pixels."""

    def __init__(self, trust: Floats) -> None:
        height, width = trust.shape
        row, column = np.meshgrid(np.linspace(-1, 1, height), np.linspace(-1, 1, width), indexing="ij")
        self._root = np.sqrt(trust.ravel().astype(np.float64))
        powers = np.stack([(row**i * column**j).ravel() for i, j in LIGHT_POWERS], axis=1)
        self._basis, _ = np.linalg.qr(powers * self._root[:, None])
        self.total = float(trust.sum())

    def without(self, windows: Floats) -> Floats:
        """(..., H * C), times the root of the weights, without the light."""
        weighted = windows * self._root
        left: Floats = weighted - (weighted @ self._basis) @ self._basis.T
        return left


def _partial_correlation(needle: Floats, seen: Floats, face: Floats) -> Floats:
    """Of needle and gauge given the face, (N, M) each: (N,) in [-1, 1]; 0 where too little is left."""
    size = face.shape[1]
    of_face = (face * face).sum(axis=1) + size * FACE_NOISE_LEVELS**2
    needle = needle - ((needle * face).sum(axis=1) / of_face)[:, None] * face
    seen = seen - ((seen * face).sum(axis=1) / of_face)[:, None] * face
    needle_left, seen_left = (needle * needle).sum(axis=1), (seen * seen).sum(axis=1)
    both = (needle * seen).sum(axis=1)
    usable = np.minimum(needle_left, seen_left) > size * MIN_LEFT_LEVELS**2
    spread = np.sqrt(needle_left * seen_left)
    scores: Floats = np.divide(both, spread, out=np.zeros_like(both), where=usable)
    return scores
