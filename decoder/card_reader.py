"""Moving cards: how far a card, such as a heading indicator's, has turned under the index of its dial.

In the unwrapped gauge the whole card shifts around the circle. The best shift comes from the circular NCC of card and
gauge, by Fourier transforms along the rows; least squares on the pixels there give the fraction of a row and the
uncertainty, as for a needle. What does not turn with the card, a lubber line or an aircraft symbol, has no weight.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from decoder.arrays import Floats
from decoder.correlation import MIN_SPREAD_LEVELS
from decoder.gauge import Gauge
from decoder.gauge_grid import card_rows
from decoder.pointers import Card
from decoder.reading import Reading, Status
from decoder.rivals import CLEARLY_WORSE
from decoder.scale_marks import FULL_CIRCLE_DEG
from decoder.tuning import CardPicture
from decoder.unwrapping import PolarGrid, UnwrappedGauge, rows_at

SCORE_THRESHOLD = 0.8
FIT_STEPS = 3
SETTLED_ROWS = 0.01
MAX_SHIFT_ROWS = 4.0
# Another place is one this far away; nearer, it is the same peak.
RIVAL_REACH_DEG = 8.0
# Pixels that the card leaves so far from explained have something over them.
OUTLIER_SPREADS = 4.0
MAD_TO_SIGMA = 1.4826
MIN_SPREAD_LEFT = 3.0
EDGE_ROWS = 2

Spectrum = NDArray[np.complexfloating[Any, Any]]


class CardReader:
    """Reads the card of one gauge; `picture` is the card as it lies in the panel picture."""

    def __init__(self, gauge: Gauge, card: Card, grid: PolarGrid, picture: CardPicture) -> None:
        self._name = card.name
        self._index_deg = card.index
        self._first_deg = gauge.sweep[0]
        self._grid = grid
        self._rows = card_rows(grid)
        self._picture = picture
        weights = picture.weights
        self._total = float(weights.sum())
        transformed = np.fft.rfft(picture.card, axis=0).conj()
        self._transformed = transformed
        self._mean = self._shifted_sums(weights, transformed) / self._total
        square = self._shifted_sums(weights, np.fft.rfft(picture.card**2, axis=0).conj()) / self._total
        self._spread = np.sqrt(np.maximum(square - self._mean**2, 0.0))

    def read(self, unwrapped: UnwrappedGauge, _: Mapping[str, Floats]) -> dict[str, Reading]:
        """The reading, by the card's name, of (R, C) float32: the gauge's grid."""
        return {self._name: self._reading(unwrapped[: self._rows])}

    def unread(self) -> dict[str, Reading]:
        """What is to be said of a card that does not lie in the frame."""
        return {self._name: Reading(Status.MISSING, math.nan, math.inf, 0.0)}

    def turned_rows(self, unwrapped: UnwrappedGauge) -> tuple[float, float, float]:
        """How many rows the card has turned from where it lies in the panel picture, the spread of that, its score."""
        seen = unwrapped[: self._rows]
        return self._fitted(seen, float(self._scores(seen).argmax()))

    def _reading(self, seen: UnwrappedGauge) -> Reading:
        scores = self._scores(seen)
        best = int(scores.argmax())
        row, sigma_rows, score = self._fitted(seen, float(best))
        angle_deg = self._index_deg - row * self._grid.step_deg
        angle_deg = self._first_deg + (angle_deg - self._first_deg) % FULL_CIRCLE_DEG
        alone = 1.0 - self._rival(scores, best) ** 2 > CLEARLY_WORSE * (1.0 - min(float(scores[best]), 1.0) ** 2)
        status = Status.READ if score >= SCORE_THRESHOLD and alone else Status.MISSING
        return Reading(status, angle_deg, sigma_rows * self._grid.step_deg, score)

    def _scores(self, seen: Floats) -> Floats:
        """The weighted NCC of a gauge (P, C) with the card turned by each number of rows: (P,) in [-1, 1]."""
        weighted = self._picture.weights * seen
        mean = float(weighted.sum()) / self._total
        spread = math.sqrt(max(float((weighted * seen).sum()) / self._total - mean**2, 0.0))
        if spread < MIN_SPREAD_LEVELS:
            return np.zeros(self._rows, np.float32)
        together = self._shifted_sums(weighted, self._transformed) / self._total - mean * self._mean
        known = self._spread > MIN_SPREAD_LEVELS
        scores = np.divide(together, self._spread * spread, out=np.zeros_like(together), where=known)
        clipped: Floats = np.clip(scores, -1.0, 1.0)
        return clipped

    def _shifted_sums(self, image: Floats, transformed: Spectrum) -> Floats:
        """Sums over all pixels of an image (P, C) times another turned by each number of rows: (P,)."""
        spectrum = (np.fft.rfft(image, axis=0) * transformed).sum(axis=1)
        sums: Floats = np.fft.irfft(spectrum, self._rows)
        return sums

    def _rival(self, scores: Floats, best: int) -> float:
        """The best score elsewhere."""
        reach = round(RIVAL_REACH_DEG / self._grid.step_deg)
        elsewhere = np.roll(scores, -best)[reach:-reach]
        return float(elsewhere.max(initial=0.0))

    def _fitted(self, seen: Floats, row: float) -> tuple[float, float, float]:
        """Row, spread and score by least squares for gain, offset and shift.

        Outliers have no weight in the row, but all the weight in the score: few pixels match many places.
        """
        start, weights, sigma_rows, score = row, self._picture.weights, math.inf, 0.0
        for _ in range(FIT_STEPS):
            card = turned(self._picture.card, row)
            slope = (np.roll(card, 1, axis=0) - np.roll(card, -1, axis=0)) / 2
            columns = np.stack([card, slope, np.ones_like(card)]).reshape(3, -1).astype(np.float64)
            normal = (columns * weights.ravel()) @ columns.T
            if np.linalg.cond(normal) > 1e12:  # noqa: PLR2004 - a card without marks has no direction
                return start, math.inf, 0.0
            inverse = np.linalg.inv(normal)
            gain, shift, _offset = solution = inverse @ (columns @ (weights.ravel() * seen.ravel()))
            step_rows = float(shift / gain) if gain > 0 else math.inf
            if not abs(row + step_rows - start) <= MAX_SHIFT_ROWS:
                return start, math.inf, 0.0
            left = (seen.ravel() - solution @ columns).reshape(seen.shape)
            noise = float((weights * left**2).sum() / weights.sum())
            sigma_rows = math.sqrt(noise * float(inverse[1, 1]) / self._grid.pixels_per_sample) / float(gain)
            score = _correlation(seen, left, self._picture.weights)
            row += step_rows
            weights = self._picture.weights * _explained(left, self._picture.weights)
            if abs(step_rows) < SETTLED_ROWS:
                break
        return row, sigma_rows, score


def turned(card: Floats, rows: float) -> Floats:
    """A card (P, C) turned clockwise by a number of rows, whole or not."""
    around = np.concatenate([card[-EDGE_ROWS:], card, card[:EDGE_ROWS]])
    return rows_at(around, np.mod(np.arange(len(card)) - rows, len(card)) + EDGE_ROWS)


def _explained(left: Floats, weights: Floats) -> Floats:
    spread = MAD_TO_SIGMA * float(np.median(np.abs(left[weights > 0])))
    return (np.abs(left) <= OUTLIER_SPREADS * max(spread, MIN_SPREAD_LEFT)).astype(np.float32)


def _correlation(seen: Floats, left: Floats, weights: Floats) -> float:
    total = float(weights.sum())
    mean = float((weights * seen).sum()) / total
    variance = float((weights * (seen - mean) ** 2).sum())
    return math.sqrt(max(1.0 - float((weights * left**2).sum()) / variance, 0.0)) if variance > 0 else 0.0
