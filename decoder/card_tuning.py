"""What a flight's own frames tell of a moving card: its picture without what stands still over it.

Turned back by what was read of each frame, the card is what all frames share; what stays put instead, a lubber line
or an aircraft symbol, is smeared out by that and shows where the frames differ from the card.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from decoder.arrays import Floats
from decoder.card_reader import CardReader, turned
from decoder.gauge import Gauge
from decoder.gauge_grid import card_rows
from decoder.needle_layer import MAD_TO_SIGMA, NOISE_LEVELS
from decoder.pointers import Card
from decoder.scale_marks import FULL_CIRCLE_DEG
from decoder.tuning import CardPicture
from decoder.unwrapping import PolarGrid, UnwrappedGauge

MIN_VIEWS = 5
# Only a card that turned by this much tells itself from what stands still.
MIN_TURN_DEG = 20.0
ROUNDS = 3
# What stands still over a card takes from its score until it is known; a few wrong places do not move a median.
LIKELY_SCORE = 0.5


def first_card(strip: UnwrappedGauge, grid: PolarGrid) -> CardPicture:
    """The card as the panel picture shows it, (R, C), with all that lies over it."""
    card = strip[: card_rows(grid)]
    return CardPicture(card, np.ones_like(card))


def learn_card(
    gauge: Gauge, card: Card, grid: PolarGrid, strips: Sequence[UnwrappedGauge], given: CardPicture
) -> CardPicture:
    """The card from frames (R, C) in the panel picture's light; as it was given if they do not tell."""
    known = given
    for _ in range(ROUNDS):
        reader = CardReader(gauge, card, grid, known)
        found = [(strip[: card_rows(grid)], *reader.turned_rows(strip)) for strip in strips]
        views = [(seen, rows) for seen, rows, _, score in found if score >= LIKELY_SCORE]
        if len(views) < MIN_VIEWS or _spread_deg([rows for _, rows in views], grid) < MIN_TURN_DEG:
            return known
        known = _learned(views)
        off_rows, _, score = CardReader(gauge, card, grid, known).turned_rows(given.card)
        if score < LIKELY_SCORE:
            return given
        known = CardPicture(turned(known.card, off_rows), known.weights)
    return known


def _learned(views: Sequence[tuple[Floats, float]]) -> CardPicture:
    middle = np.median([turned(seen, -rows) for seen, rows in views], axis=0).astype(np.float32)
    apart = MAD_TO_SIGMA * np.median([np.abs(seen - turned(middle, rows)) for seen, rows in views], axis=0)
    weights = NOISE_LEVELS**2 / (NOISE_LEVELS**2 + np.maximum(apart - NOISE_LEVELS, 0.0) ** 2)
    return CardPicture(middle, weights.astype(np.float32))


def _spread_deg(rows: Sequence[float], grid: PolarGrid) -> float:
    """The arc that the card went through, degrees."""
    angles_deg = np.sort(np.mod(np.array(rows) * grid.step_deg, FULL_CIRCLE_DEG))
    gaps = np.diff(np.append(angles_deg, angles_deg[0] + FULL_CIRCLE_DEG))
    return FULL_CIRCLE_DEG - float(gaps.max())
