"""What a frame's alignment cannot tell where too few features match: it may have moved as other frames did.

Three anchors carry no perspective, one anchor no roll. Where a hand covers the others, the frame is aligned by a
smaller model, and dials away from what is left may lie pixels beside it. How far, the frames that showed enough tell.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from decoder.agreement import all_fitted
from decoder.alignment import Matrix, Point
from decoder.arrays import Floats
from decoder.motion import Model


def unseen_px(motions: Sequence[Matrix], features: Sequence[Point], places: Floats, model: Model) -> Floats:
    """(N,): how far (2, N) places lie, as a rule, from where the features' best motion of a model has them.

    Parameters
    ----------
    motions
        (3, 3) each: whole motions that were seen.
    features
        Where the features lie before a motion, (x, y) px.
    """
    if not motions or not features or model is Model.PERSPECTIVE:
        return np.zeros(places.shape[1])
    whole, usual = np.array(motions), np.array(features).T
    guesses = all_fitted(usual, _carried(whole, usual), model)
    off_px = _carried(whole, places) - _carried(guesses, places)
    off: Floats = np.sqrt(np.square(off_px).sum(axis=(0, 1)) / len(motions))
    return off


def _carried(motions: Floats, places: Floats) -> Floats:
    """(F, 2, N): where motions (F, 3, 3) carry (2, N) places."""
    there = motions @ np.vstack([places, np.ones(places.shape[1])])
    carried: Floats = there[:, :2] / there[:, 2:]
    return carried
