"""How nearly a card repeats itself at another turn: the points of a compass rose do so all the way round.

Four small letters alone may tell such a card's turn. They weigh less than what stays where it is as the card turns: an
oblique view, or a pivot that is a little off, by which the turn nearest to the panel picture's matches best, right or
wrong.
"""

from __future__ import annotations

import cv2
import numpy as np

from decoder.imaging.thresholds import HALF
from decoder.matching.correlation import ROUNDING
from decoder.panel.arrays import Floats

# A piece is much higher than what it may be displaced by, so that a numeral is not explained by another.
REACHES_PER_PIECE = 4
TURNS = 8


def least_unlike(card: Floats, weights: Floats, reach: tuple[int, int]) -> float:
    """Return the least part of its own variance by which a card (P, C) differs from itself at another turn.

    The turns compared are those at which it is most like itself, of all that are more than a `reach` in rows away. Each
    piece of the card may be displaced by the reach in rows and in columns, as pieces are where a dial is seen obliquely
    or around a point beside its pivot. `weights` (P, C) is how much its places count.
    """
    others = (np.roll(card, rows, axis=0) for rows in _turns(card, reach[0]))
    return min((_unlike(card, other, weights, reach) for other in others), default=1.0)


def _turns(card: Floats, reach: int) -> list[int]:
    """List the turns, more than `reach` rows away and at most half way round, at which a card is most like itself."""
    level = card - card.mean()
    spectrum = np.square(np.abs(np.fft.rfft(level, axis=0))).sum(axis=1)
    alike = np.fft.irfft(spectrum, len(card))[: len(card) // 2 + 1]
    alike[:reach] = -np.inf
    found = []
    for _ in range(TURNS):
        best = int(alike.argmax())
        if alike[best] <= 0.0:
            break
        found.append(best)
        alike[max(best - reach, 0) : best + reach + 1] = -np.inf
    return found


def _unlike(card: Floats, other: Floats, weights: Floats, reach: tuple[int, int]) -> float:
    """Return the part of a card's variance that another (P, C) does not explain, piece by piece."""
    below, aside = reach
    around = np.pad(np.pad(other, ((below, below), (0, 0)), mode="wrap"), ((0, 0), (aside, aside)), mode="edge")
    left = total = 0.0
    height, width = REACHES_PER_PIECE * below, -(-card.shape[1] // 2)
    for top in range(0, len(card), height):
        for first in range(0, card.shape[1], width):
            piece = card[top : top + height, first : first + width]
            rows, columns = piece.shape
            known = float(weights[top : top + height, first : first + width].mean())
            if known < HALF:
                continue
            scores = cv2.matchTemplate(
                around[top : top + rows + 2 * below, first : first + columns + 2 * aside], piece, cv2.TM_CCOEFF_NORMED
            )
            own = known * float(np.square(piece - piece.mean()).sum())
            total += own
            left += own * (1.0 - max(float(np.nan_to_num(scores).max()), 0.0) ** 2)
    return left / total if total > ROUNDING else 1.0
