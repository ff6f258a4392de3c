"""Which end of a needle over a card is its tip, if it turns about another point than the card.

A needle stands above its card, so a camera that looks from aside sees it turn about another point. Around the card's
pivot it then appears bent: its tip lies to one side of the line through the centre, its tail to the other, both the
further the nearer they are to the centre. Half a turn on, the sides are swapped. Compared as one picture, a needle may
therefore resemble its reverse more than itself. So both are compared with the needle passing aside by various amounts,
and the best of each counts.
"""

from __future__ import annotations

import numpy as np

from decoder.imaging.unwrapping import PolarGrid, UnwrappedGauge
from decoder.matching.correlation import partial_normxcorr
from decoder.matching.needle_search import COARSE_STEP
from decoder.matching.needle_template import NeedleTemplate
from decoder.panel.arrays import Floats
from decoder.panel.scale import FULL_CIRCLE_DEG

# How far aside a needle may pass, in radii: twice its own height seen from 45 degrees, as the template is bent too.
ASIDE = np.linspace(-0.08, 0.08, 17)
# Its angle may be found this many rows off.
BESIDE_ROWS = 2


def left_both_ways(
    seen: UnwrappedGauge, face: UnwrappedGauge, template: NeedleTemplate, grid: PolarGrid, row: float
) -> Floats:
    """(2,): the part of the variance that a needle leaves unexplained with its tip on a row, and half a turn on.

    Parameters
    ----------
    seen, face : (R, C)
        A dial of more than one turn, and what lies behind the needle.
    """
    turn = round(FULL_CIRCLE_DEG / grid.step_deg)
    radii_px = grid.radii_px  # negative across the centre, where the needle is bent the other way
    away_px = np.where(np.abs(radii_px) > 1.0, radii_px, np.inf)
    bent_deg = np.degrees(np.multiply.outer(ASIDE * radii_px[-1], 1.0 / away_px))
    top_rows = round(row) - (template.rows - 1) // 2 + np.array([0, turn // 2])
    columns = np.arange(0, grid.columns, COARSE_STEP)
    bent_rows = np.rint(bent_deg[:, columns] / grid.step_deg).astype(int)
    first = top_rows[:, None, None] - BESIDE_ROWS + bent_rows
    rows = (first[..., None, :] + np.arange(template.rows + 2 * BESIDE_ROWS)[:, None]) % turn  # (2, A, H, C)
    scores, _ = partial_normxcorr(seen[rows, columns], face[rows, columns], _thinned(template))
    best = np.maximum(scores.reshape(2, -1), 0.0).max(axis=1)
    left: Floats = 1.0 - best**2
    return left


def _thinned(template: NeedleTemplate) -> NeedleTemplate:
    """Return every third column of a template."""
    pixels, light, transparency, trust = (
        np.ascontiguousarray(each[:, ::COARSE_STEP])
        for each in (template.pixels, template.light, template.transparency, template.trust)
    )
    return NeedleTemplate(pixels, light, transparency, trust, template.step_deg)
