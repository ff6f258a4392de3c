"""Parallax over a card: a raised marker seen obliquely appears beside the place on the card it points to.

The height of a bug above its card shifts it in the picture in one fixed direction, so its apparent position on the card
swings once back and forth per turn. A bug stays where it was set and turns with its card, so the swing shows in any
flight that turns; what remains constant between two settings is not parallax.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from decoder.imaging.sorting import MAD_TO_SIGMA, median
from decoder.matching.thresholds import OUTLIER_SPREADS
from decoder.panel.arrays import Floats
from decoder.panel.scale import FULL_CIRCLE_DEG, shortest

# Prior: a bug a sixtieth of its radius above the card, seen from 45 degrees aside.
USUAL_DEG = 1.0
PASSES = 20


@dataclass(frozen=True, slots=True)
class CardParallax:
    """By how much further clockwise than it points something over a card appears: if it points right, and down."""

    right_deg: float = 0.0
    down_deg: float = 0.0

    def at(self, seen_deg: float) -> float:
        """Return the parallax of something seen at this angle, in degrees clockwise from the right."""
        at = np.radians(seen_deg)
        return float(self.right_deg * np.cos(at) + self.down_deg * np.sin(at))


def parallax_of(seen_deg: Floats, on_card_deg: Floats, sigma_deg: float) -> CardParallax:
    """Estimate the parallax of a bug that turns with its card, except for the few times somebody sets it.

    This is a least-squares fit of its movement on the card from one time to the next, robust against settings and
    regularised by a prior. The result is zero if the bug was set again and again, hardly turned, or shows no clear
    parallax.

    Parameters
    ----------
    seen_deg, on_card_deg
        (N,) in order of time: its direction on the dial, and on the card.
    sigma_deg
        The uncertainty of one of the latter.
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
