"""The places that the lower of two needles may have near the upper one, and what each leaves unexplained.

The two of them at one distance are a needle like any other: a light and a transparency over the face; so the least
squares of the upper one over each place of the lower take one product with what is seen.
"""

from __future__ import annotations

from dataclasses import dataclass, fields

import numpy as np

from decoder.arrays import Floats, Indices, Mask
from decoder.fitting import MAX_FRACTION_ROWS, MIDDLE_GREY, NEEDLE, ONE, PHASE_REACH, SEEN, SLOPE, phases_of
from decoder.lower_layer import LowerNeedle
from decoder.matching import MAX_STEPS
from decoder.needle_template import NeedleTemplate
from decoder.quick_fit import solved, summed_products
from decoder.strips import Strips

# A pair that leaves so many times the least of all pairs unexplained is neither the best nor a rival of that.
LIKELY_NOISE = 3.0
# Where no place explains more than this at first look, none does once it is settled.
MIN_FIRST_CORRELATION = 0.84


@dataclass(frozen=True, slots=True)
class Tried:
    """K places of the lower needle in M frames.

    Attributes
    ----------
    middle
        (M,): the whole row of the upper needle near which they lie.
    lower_row, upper_row
        (M, K): the lower needle's row, and where the upper one then is; NaN where it is lost.
    noise
        (M, K): the mean square that stays unexplained, infinite where that is too much for a pair.
    is_hopeful
        (M,): whether a pair may explain what is seen at all.
    """

    middle: Indices
    lower_row: Indices
    upper_row: Floats
    noise: Floats
    is_hopeful: Mask

    def part(self, which: Indices) -> Tried:
        """In some of the frames."""
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
        # by row of the window, the numbers of the layers that were drawn, and these
        self._drawn = ({row: number for number, row in enumerate(places.tolist())}, self._light, self._part)
        trust = upper.trust.ravel()
        self._seen_kernel = self._kernel(self._light * trust, trust)
        self._face_kernel = self._kernel(self._part * trust, None)
        self._known: dict[int, Floats] = {}

    def tried(self, strips: Strips, middle: Indices) -> Tried:
        """All places near whole rows of the upper needle, (M,)."""
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
        is_hopeful = fits.correlation.max(axis=1) >= MIN_FIRST_CORRELATION
        is_likely = noise <= LIKELY_NOISE * noise.min(axis=1, keepdims=True)
        is_near = np.abs(fits.fraction) <= MAX_FRACTION_ROWS
        further = is_hopeful[:, None] & is_likely & ~is_near & (np.abs(fits.fraction) <= self._axis)
        at = np.rint(rows[further]).astype(np.intp)
        noise[~is_near], rows[~is_near] = np.inf, np.nan
        tried = Tried(middle, middle[:, None] + self._apart, rows, noise, is_hopeful)
        self._move_on(strips, tried, np.argwhere(further), at)
        return tried

    def _move_on(self, strips: Strips, tried: Tried, open_: Indices, at: Indices) -> None:
        """Some places, (N, 2), again where the upper needle lies further away, on rows (N,); fills in what is found."""
        axis, face_rows = self._axis, len(strips.face)
        for _ in range(1, MAX_STEPS):
            inside = (at >= axis) & (at < face_rows - axis)
            open_, at = open_[inside], at[inside]
            if not open_.size:
                return
            frame, place = open_[:, 0], open_[:, 1]
            seen, face = strips.part(frame).windows(at, axis)
            light, part = self._layers(tried.lower_row[frame, place] - at + axis)
            layers = np.empty((len(at), 4, seen.shape[1]), np.float32)
            np.multiply(part, face[:, None], out=layers[:, :ONE])
            layers[:, :ONE] += light
            layers[:, ONE] = 1.0
            np.subtract(seen, np.float32(MIDDLE_GREY), out=layers[:, SEEN])
            moments = summed_products(layers, self._upper.trust.ravel())
            fits = solved(moments.transpose(1, 2, 0), np.zeros(len(at), np.intp), self._pixels_per_sample)
            done = ~((np.abs(fits.fraction) > MAX_FRACTION_ROWS) & (np.abs(fits.fraction) <= axis))
            tried.noise[frame[done], place[done]] = fits.noise[done]
            tried.upper_row[frame[done], place[done]] = at[done] + fits.fraction[done]
            at = at[~done] + np.rint(fits.fraction[~done]).astype(np.intp)
            open_ = open_[~done]

    def _unseen(self, row: int, face: Floats) -> Floats:
        """(3, 3, K): the moments of needles and 1 with each other on one row of the gauge: no frame changes them."""
        if row not in self._known:
            layers = np.empty((len(self._apart), 3, face.size), np.float32)
            np.multiply(self._part, face, out=layers[:, :ONE])
            layers[:, :ONE] += self._light
            layers[:, ONE] = 1.0
            self._known[row] = summed_products(layers, self._upper.trust.ravel()).transpose(1, 2, 0)
        return self._known[row]

    def _layers(self, lower_rows: Indices) -> tuple[Floats, Floats]:
        """Both needles as one, the lower's axis on rows (K,) of the window: light and transparency, (K, 2, H * C) each.

        The second of the two is how the upper's own layer changes when it moves on.
        """
        rows = lower_rows.tolist()
        numbers, light, part = self._drawn
        new = sorted(set(rows).difference(numbers))
        if new:
            numbers = numbers | {row: number for number, row in enumerate(new, len(numbers))}
            more_light, more_part = self._drawn_on(np.array(new))
            light, part = np.concatenate([light, more_light]), np.concatenate([part, more_part])
            self._drawn = numbers, light, part
        where = [numbers[row] for row in rows]
        return light[where], part[where]

    def _drawn_on(self, lower_rows: Indices) -> tuple[Floats, Floats]:
        layer = self._lower.at(lower_rows.astype(np.float64))
        light, part = layer.behind(self._own_part[0])
        both = (self._own_light + self._own_part * light[:, None]), self._own_part * part[:, None]
        one, other = (each.reshape(len(lower_rows), 2, -1).astype(np.float32) for each in both)
        return one, other

    @staticmethod
    def _kernel(layers: Floats, more: Floats | None) -> Floats:
        """(H * C, 2 K), and one column more."""
        rows = layers.reshape(-1, layers.shape[-1])
        return np.ascontiguousarray((rows if more is None else np.vstack([rows, more])).T.astype(np.float32))
