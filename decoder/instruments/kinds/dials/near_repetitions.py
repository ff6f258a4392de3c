"""Telling a turn of a card from its near-repetitions: by the places that it leaves unexplained.

The points of a compass rose repeat all the way round, and four small letters alone tell its turn. In a score over the
whole card they weigh next to nothing: a pivot that is a little off, an oblique view, or light from one side, all of
which stay where they are as the card turns, weigh more, and a turn that is one point off may match best. But then the
dial shows letters where that turn has none, and none where it has some, and another turn explains just these places.
What lies over a card is not explained by any turn.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from enum import Enum, auto

import cv2
import numpy as np

from decoder.imaging.thresholds import HALF
from decoder.instruments.thresholds import CLEARLY_WORSE, MIN_PLACES, SATURATED_LEVEL, SURE_SCORE
from decoder.matching.correlation import ROUNDING
from decoder.matching.thresholds import MAX_PEAK_ROWS, OUTLIER_SPREADS
from decoder.panel.arrays import Floats, Mask
from decoder.registration.thresholds import NOISE_LEVELS, SCORE_THRESHOLD


class Source(Enum):
    """What a card was taken from: a frame of the flight, the panel picture alone, or all frames together."""

    FRAME = auto()
    DRAWN = auto()
    LEARNED = auto()


@dataclass(frozen=True, slots=True)
class Dial:
    """A dial on which a card is searched for.

    Attributes
    ----------
    seen, weights
        (P, C) each: the dial, and how much its places count.
    card, known
        (P, C) each: the card not turned, and how much its places count.
    turned
        Turns the card by some rows.
    reach
        How many rows are a place, such as a letter; it is an eighth of the columns wide.
    source
        What the card was taken from.
    """

    seen: Floats
    weights: Floats
    card: Floats
    known: Floats
    turned: Callable[[Floats, float], Floats]
    reach: int
    source: Source

    def contradicts(self, row: float) -> bool:
        """Whether the dial shows the card at another turn where a turn by `row` rows leaves something unexplained.

        What one place shows is often found elsewhere on a card by chance. So another turn must have print where the
        dial has some, too. In the panel picture's light alone much of that may not show: then it may also be sure to
        explain many places. What stands still over the card in that picture does so where it is, as if nothing turned.
        """
        cards = [self.turned(self.card, row + off) for off in _OFF_ROWS]
        weights = self.weights * np.roll(self.known, round(row), axis=0)
        lit = _in_light(self.seen, cards[0], weights)
        places = weights * _unexplained(lit, cards, weights, self.reach)
        if not places.any():
            return False
        scores, here = _scores(lit, self.card, places), round(row) % len(self.card)
        is_drawn = self.source is Source.DRAWN
        others = self._is_alike(lit, weights, here)
        if is_drawn and cv2.connectedComponents((places > 0).astype(np.uint8))[0] - 1 > MIN_PLACES:
            others |= scores >= SURE_SCORE
        others &= ~self._near(*([row, 0.0] if is_drawn else [row]))
        own, other = max(float(scores[here]), 0.0), float(scores[others].max(initial=0.0))
        return other >= SCORE_THRESHOLD and CLEARLY_WORSE * (1.0 - other**2) < 1.0 - own**2

    def _is_alike(self, lit: Floats, weights: Floats, here: int) -> Mask:
        """(P,): the turns at which the card has print where the dial has some, nearly as well as at one.

        Its contrast counts between two frames, in which much the same lies over both; else whether there is any.
        """
        shown, printed = (_variance(each, np.ones_like(each), self.reach) for each in (lit, self.card))
        if self.source is Source.FRAME:
            shown, printed = np.sqrt(shown), np.sqrt(printed)
        else:
            shown, printed = (SATURATED_LEVEL * each / (each + NOISE_LEVELS**2) for each in (shown, printed))
        scores = np.maximum(_scores(shown, printed, weights), 0.0)
        alike: Mask = 1.0 - scores**2 < CLEARLY_WORSE * (1.0 - scores[here] ** 2)
        return alike

    def _near(self, *rows: float) -> Mask:
        """(P,): which turns are the same as some, in rows."""
        near = np.zeros(len(self.card), bool)
        near[np.add.outer(np.rint(rows).astype(np.intp), np.arange(-self.reach, self.reach + 1)) % len(near)] = True
        return near


# Off its pivot or seen obliquely, a card lies a little further on at some places, and a little less far at others.
_OFF_ROWS = (0.0, -MAX_PEAK_ROWS, MAX_PEAK_ROWS)


def _in_light(seen: Floats, card: Floats, weights: Floats) -> Floats:
    """Bring a dial (P, C) into the light of a card as it is turned there, by least squares."""
    total = max(float(weights.sum()), float(ROUNDING))
    mean, level = (float((weights * each).sum()) / total for each in (seen, card))
    shared = float((weights * (seen - mean) * (card - level)).sum())
    gain = shared / max(float((weights * np.square(card - level)).sum()), float(ROUNDING))
    lit: Floats = level + (seen - mean) / max(gain, float(ROUNDING))
    return lit


def _unexplained(seen: Floats, cards: list[Floats], weights: Floats, reach: int) -> Mask:
    """(P, C): places of a dial at which all of some cards leave a quarter of what either shows, and more than noise."""
    left = np.min([_around(weights * np.square(seen - card), reach) for card in cards], axis=0)
    shown = np.max([_variance(each, weights, reach) for each in (seen, cards[0])], axis=0)
    counts = weights > HALF
    usual = max(NOISE_LEVELS**2, float(np.median(left[counts])) if counts.any() else 0.0)
    places = (left > OUTLIER_SPREADS**2 * usual) & (left > HALF**2 * shown)
    near: Mask = _around(places.astype(np.float32), reach) > 0
    return near


def _scores(seen: Floats, card: Floats, weights: Floats) -> Floats:
    """(P,): the weighted NCC of a dial (P, C) with a card turned by each number of rows."""
    total = float(weights.sum())
    levels = seen - float((weights * seen).sum()) / total
    plain = card - card.mean()

    def sums(image: Floats, turning: Floats) -> Floats:
        spectrum = np.fft.rfft(image, axis=0) * np.fft.rfft(turning, axis=0).conj()
        own: Floats = np.fft.irfft(spectrum.sum(axis=1), len(card)) / total
        return own

    spread = np.sqrt(np.maximum(sums(weights, plain**2) - sums(weights, plain) ** 2, 0.0))
    own_spread = float(np.sqrt((weights * levels**2).sum() / total))
    scores: Floats = sums(weights * levels, plain) / np.maximum(spread * own_spread, NOISE_LEVELS**2)
    return scores


def _variance(levels: Floats, weights: Floats, reach: int) -> Floats:
    """(P, C): the variance around each place, times the weight there."""
    total = np.maximum(_around(weights, reach), ROUNDING)
    variance: Floats = _around(weights * levels**2, reach) - _around(weights * levels, reach) ** 2 / total
    return np.maximum(variance, 0.0)


def _around(levels: Floats, reach: int) -> Floats:
    """(P, C): the mean around each place: as long as `reach` rows, and an eighth of the columns wide."""
    around = np.concatenate([levels[-reach:], levels, levels[:reach]]).astype(np.float32)
    wide = max(round(HALF**3 * levels.shape[1]), 1)
    mean: Floats = np.asarray(cv2.blur(around, (wide, reach)), np.float32)[reach:-reach]
    return mean
