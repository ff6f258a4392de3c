"""Occlusion: reading a needle that another one covers in part or wholly (thesis 3.2.3).

The cascade is the thesis's: the whole needle, else its top edge, else its bottom edge (in the unwrapped gauge, where
rows grow clockwise), else hidden. An edge is matched without the pixels that the covering needle, whose place is known,
lies on: what is left of the template must match what is left of the gauge. So the covering needle's own edges are never
taken for the covered one's.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from decoder.arrays import Floats
from decoder.needle_template import NeedleTemplate
from decoder.over_face import FaceMoments, face_moments, partial_normxcorr

WHOLE_VISIBLE = 0.97
# With less of its contrast in sight than this, a template matches too many things.
MIN_VISIBLE = 0.15


@dataclass(frozen=True, slots=True)
class Visibility:
    """NCC of a template's uncovered pixels, and how much of its contrast they hold; both (R - H + 1,)."""

    scores: Floats
    visible: Floats


def uncovered_scores(
    gauge: Floats, face: Floats, mask: Floats, template: NeedleTemplate, whole: FaceMoments
) -> Visibility:
    """Scores along the rows with the pixels alone that `mask` leaves.

    Parameters
    ----------
    gauge, face, mask : (R, C) float32
        The mask is 0 where the covering needle lies.
    template
        (H, C), H <= R.
    whole
        The moments of the same face without the mask.
    """
    moments = face_moments(face, template, mask)
    scores = partial_normxcorr(gauge, face, moments, mask)
    visible = moments.needle_contrast / np.maximum(whole.needle_contrast, 1e-6)
    return Visibility(scores, np.clip(visible, 0.0, 1.0))
