"""The places that the lower of two needles may have near the upper one, and what each leaves unexplained.

Two needles at a fixed distance are like one needle: a light and a transparency over the face. So the least squares of
the upper needle over every place of the lower one take a single product with the pixels.
"""

from __future__ import annotations

from dataclasses import dataclass, fields

import numpy as np

from decoder.matching.lower_layer import LowerNeedle
from decoder.matching.needle_fit import (
    MIDDLE_GREY,
    NEEDLE,
    ONE,
    PHASE_REACH,
    SEEN,
    SLOPE,
    phases_of,
    solved,
    summed_products,
)
from decoder.matching.needle_template import NeedleTemplate
from decoder.matching.strips import Strips
from decoder.matching.thresholds import MAX_FRACTION_ROWS
from decoder.panel.arrays import Floats, Indices, Mask
from decoder.registration.thresholds import SCORE_THRESHOLD


@dataclass(frozen=True, slots=True)
class Tried:
    """K places of the lower needle in M frames.

    Attributes
    ----------
    middle
        (M,): the whole row of the upper needle near which they lie.
    lower_row, upper_row
        (M, K): the lower needle's row, and the upper one's as fitted to it; NaN where that is out of reach.
    noise
        (M, K): the mean square residual, infinite where nothing fits within reach.
    is_hopeful
        (M,): whether a pair may explain the pixels at all.
    """

    middle: Indices
    lower_row: Indices
    upper_row: Floats
    noise: Floats
    is_hopeful: Mask

    def part(self, which: Indices) -> Tried:
        """Return those of some of the frames."""
        return Tried(*(getattr(self, field.name)[which] for field in fields(self)))


class PairPlaces:
    """Tries all places at which the axes of two needles are at most `reach_rows` apart."""

    def __init__(self, upper: NeedleTemplate, lower: LowerNeedle, reach_rows: int, pixels_per_sample: float) -> None:
        self._upper, self._lower = upper, lower
        self._axis = (upper.rows - 1) // 2
        self._pixels_per_sample = pixels_per_sample
        phases = phases_of(upper)
        self._own_light, self._own_part = phases.light[PHASE_REACH], phases.transparency[PHASE_REACH]
        self._apart = np.arange(-reach_rows, reach_rows + 1)
        places = self._axis + self._apart
        self._light, self._part = self._drawn_on(places)
        trust = upper.trust.ravel()
        self._seen_kernel = self._kernel(self._light * trust, trust)
        self._face_kernel = self._kernel(self._part * trust, None)
        self._known: dict[int, Floats] = {}

    def tried(self, strips: Strips, middle: Indices) -> Tried:
        """Try all places near whole rows of the upper needle, (M,)."""
        seen, face = strips.windows(middle, self._axis)
        seen = seen - np.float32(MIDDLE_GREY)
        count = len(self._apart)
        with_light = (seen[:, None] @ self._seen_kernel)[:, 0].astype(np.float64)
        with_part = ((seen * face)[:, None] @ self._face_kernel)[:, 0].astype(np.float64)
        both = with_light[:, :-1] + with_part
        moments = np.empty((4, 4, len(middle), count))
        unseen = [self._unseen(row, own) for row, own in zip(middle.tolist(), face, strict=True)]
        moments[: ONE + 1, : ONE + 1] = np.stack(unseen, axis=2)
        by_place = both.reshape(-1, count, 2)
        energy = ((seen * self._upper.trust.ravel())[:, None] @ seen[:, :, None])[:, 0].astype(np.float64)
        for layer, values in ((NEEDLE, by_place[..., 0]), (SLOPE, by_place[..., 1]), (ONE, with_light[:, -1:])):
            moments[layer, SEEN] = moments[SEEN, layer] = values
        moments[SEEN, SEEN] = energy
        fits = solved(moments, np.zeros((len(middle), count), np.intp), self._pixels_per_sample)
        noise, rows = fits.noise, middle[:, None] + fits.fraction
        is_hopeful = fits.correlation.max(axis=1) >= SCORE_THRESHOLD
        is_near = np.abs(fits.fraction) <= 2 * MAX_FRACTION_ROWS
        noise, rows = np.where(is_near, noise, np.inf), np.where(is_near, rows, np.nan)
        return Tried(middle, middle[:, None] + self._apart, rows, noise, is_hopeful)

    def _unseen(self, row: int, face: Floats) -> Floats:
        """(3, 3, K): the moments of needles and 1 with each other on a row of the gauge, the same for all frames."""
        if row not in self._known:
            layers = np.empty((len(self._apart), 3, face.size), np.float32)
            np.multiply(self._part, face, out=layers[:, :ONE])
            layers[:, :ONE] += self._light
            layers[:, ONE] = 1.0
            self._known[row] = summed_products(layers, self._upper.trust.ravel()).transpose(1, 2, 0)
        return self._known[row]

    def _drawn_on(self, lower_rows: Indices) -> tuple[Floats, Floats]:
        layer = self._lower.at(lower_rows.astype(np.float64))
        light, part = layer.behind(self._own_part[0])
        both = (self._own_light + self._own_part * light[:, None]), self._own_part * part[:, None]
        one, other = (each.reshape(len(lower_rows), 2, -1).astype(np.float32) for each in both)
        return one, other

    @staticmethod
    def _kernel(layers: Floats, more: Floats | None) -> Floats:
        """(H * C, 2 K): the layers as columns, and `more` as one more column."""
        rows = layers.reshape(-1, layers.shape[-1])
        return np.ascontiguousarray((rows if more is None else np.vstack([rows, more])).T.astype(np.float32))
