"""Parallax over a card: what turns in front of it is seen beside where it points, as the camera looks from aside.

The height of a bug above its card moves it in the picture always the same way, so that what it shows swings once to
and fro as it goes round. A bug stays where it was set and goes round with its card: the swing shows in a flight that
turns, and what remains between two settings does not.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from decoder.imaging.sorting import MAD_TO_SIGMA, median
from decoder.matching.thresholds import OUTLIER_SPREADS
from decoder.panel.arrays import Floats
from decoder.panel.scale import FULL_CIRCLE_DEG, shortest

# What is known before any flight: a bug a sixtieth of its radius above the card, seen from 45 degrees aside.
USUAL_DEG = 1.0
PASSES = 20


@dataclass(frozen=True, slots=True)
class CardParallax:
    """By how much something over a card is seen further clockwise than it points: where it points right, and down."""

    right_deg: float = 0.0
    down_deg: float = 0.0

    def at(self, seen_deg: float) -> float:
        """Return it for something that is seen there, in degrees clockwise from the right."""
        at = np.radians(seen_deg)
        return float(self.right_deg * np.cos(at) + self.down_deg * np.sin(at))


def parallax_of(seen_deg: Floats, on_card_deg: Floats, sigma_deg: float) -> CardParallax:
    """Tell the parallax of what goes round with its card, but for the few times that somebody sets it.

    Least squares of how far it moved on the card from one time to the next, robust against settings, and held by what
    is usual. None is told where it was set again and again, hardly went round, or is not clearly seen from aside.

    Parameters
    ----------
    seen_deg, on_card_deg
        (N,) in order of time: its direction on the dial, and on the card.
    sigma_deg
        How uncertain one of the latter is.
    """
    at = np.radians(seen_deg)
    design = np.diff(np.stack([np.cos(at), np.sin(at)], axis=1), axis=0)
    steps_deg = shortest(np.diff(on_card_deg), FULL_CIRCLE_DEG)
    right_down, information = np.zeros(2), np.eye(2)
    for _ in range(PASSES if len(steps_deg) else 0):
        left = steps_deg - design @ right_down
        spread_deg = max(MAD_TO_SIGMA * float(median(np.abs(left))), sigma_deg)
        weights = np.maximum(1.0 - np.square(left / (OUTLIER_SPREADS * spread_deg)), 0.0) ** 2
        weighted = design.T * (weights / spread_deg**2)
        information = weighted @ design + np.eye(2) / USUAL_DEG**2
        right_down = np.asarray(np.linalg.solve(information, weighted @ steps_deg))
    is_clear = float(right_down @ information @ right_down) > OUTLIER_SPREADS**2
    return CardParallax(*right_down.tolist()) if is_clear else CardParallax()
