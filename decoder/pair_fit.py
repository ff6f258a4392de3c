"""Two needles that nearly coincide, read together in many frames at once: as `covered_pair` has it.

Every place is tried at which the lower needle touches the upper one. The two of them at one distance are a needle
like any other: a light and a transparency over the face; so the upper one's least squares over each place of the lower
take one product with what is seen.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from decoder.arrays import Floats, Indices, limited
from decoder.covered_pair import MIN_PAIR_CORRELATION, MIN_SHOWN_PIXELS, MIRROR_BETTER, MUCH_BETTER, SHOWN_PART
from decoder.fitting import MAX_FRACTION_ROWS, MIDDLE_GREY, NEEDLE, ONE, SEEN, SLOPE, phases_of
from decoder.joint_fit import Joint, JointFitter
from decoder.lower_layer import LowerNeedle
from decoder.matching import MAX_STEPS
from decoder.needle_template import NeedleTemplate
from decoder.quick_fit import Fits, QuickFitter, solved
from decoder.strips import Strips

# A pair that leaves so many times the least of all pairs unexplained is neither the best nor a rival of that.
LIKELY_NOISE = 3.0


@dataclass(frozen=True, slots=True)
class Over:
    """An upper needle settled over a lower one in M frames; all (M,) or (M, H * C).

    `row` is NaN where it was lost; `window` is the row that its fit was made around.
    """

    row: Floats
    window: Indices
    fits: Fits
    seen: Floats
    face: Floats
    back: Floats


@dataclass(frozen=True, slots=True)
class Pairs:
    """M pairs, (M,) each.

    Attributes
    ----------
    upper_row, upper_sigma_rows, upper_score
        As of a `matching.Match`; where several pairs explain what is seen nearly as well, sigma spans them.
    lower_row, lower_sigma_rows
        The lower needle's.
    lower_score
        Of what shows of it: how much of what upper needle and face leave there it explains; 0 where it is not believed.
    lower_doubt_rows
        How far from the upper needle the lower may be with nearly the same to be seen.
    correlation
        The NCC of the whole window with both needles over the face; 0 where nothing fits.
    """

    upper_row: Floats
    upper_sigma_rows: Floats
    upper_score: Floats
    lower_row: Floats
    lower_sigma_rows: Floats
    lower_score: Floats
    lower_doubt_rows: Floats
    correlation: Floats


class PairFitter:
    """Fits two needles of one gauge together; `reach_rows` is how far apart their axes are tried."""

    def __init__(self, upper: NeedleTemplate, lower: NeedleTemplate, reach_rows: int, pixels_per_sample: float) -> None:
        self._upper, self._lower = upper, LowerNeedle(lower, upper.rows)
        self._axis = (upper.rows - 1) // 2
        self._pixels_per_sample = pixels_per_sample
        self._fitter = QuickFitter(upper, pixels_per_sample)
        self._joint = JointFitter(upper, self._lower, pixels_per_sample)
        self._own = phases_of(upper)[0]
        self._apart = np.arange(-reach_rows, reach_rows + 1)
        self._drawn: dict[int, tuple[Floats, Floats]] = {}
        self._light, self._part = self._layers(self._axis + self._apart)
        trust = upper.trust.ravel()
        self._seen_kernel = self._kernel(self._light * trust, trust)
        self._face_kernel = self._kernel(self._part * trust, None)
        self._known: dict[int, Floats] = {}

    def over(self, strips: Strips, upper_rows: Floats, lower_rows: Floats) -> Over:
        """The upper needle near a row, settled over the lower one on another, (M,) each: as `Matcher.again`."""
        face_rows = len(strips.face)
        rows = np.rint(upper_rows).astype(np.intp)
        lost = ~((rows >= self._axis) & (rows < face_rows - self._axis))
        rows = limited(rows, self._axis, face_rows - self._axis - 1)
        found = self._fit_over(strips, rows, lower_rows)
        for _ in range(1, MAX_STEPS):
            fraction = found.fits.fraction
            lost |= ~(np.abs(fraction) <= self._axis)
            further = np.flatnonzero(~lost & (np.abs(fraction) > MAX_FRACTION_ROWS))
            if not further.size:
                break
            moved = rows[further] + np.rint(fraction[further]).astype(np.intp)
            stays = (moved >= self._axis) & (moved < face_rows - self._axis)
            further = further[stays]
            if not further.size:
                break
            rows[further] = moved[stays]
            again = self._fit_over(strips.part(further), rows[further], lower_rows[further])
            found = _replaced(found, further, again)
        row = np.where(lost | ~(np.abs(found.fits.fraction) <= self._axis), np.nan, found.row)
        return Over(row, found.window, found.fits, found.seen, found.face, found.back)

    def fit(self, strips: Strips, upper_rows: Floats) -> Pairs:
        """The best pairs near the rows, (M,), where the upper needles were found."""
        frames, middle = len(upper_rows), np.rint(upper_rows).astype(np.intp)
        noise, rows = self._noises(strips, middle)
        places = middle[:, None] + self._apart
        # The mirrored pair may leave as little unexplained: the best of either side is settled.
        by_side = np.where((places - rows) * np.array([1, -1])[:, None, None] >= 0, noise, np.inf)  # (2, M, K)
        least = by_side.min(axis=2)
        likely = least <= LIKELY_NOISE * least.min(axis=0)
        side, frame = likely.nonzero()
        own = by_side.argmin(axis=2)[side, frame]
        start = rows[frame, own]
        joint = self._joint.fit(
            strips.part(frame), np.where(np.isfinite(start), start, upper_rows[frame]), places[frame, own]
        )
        seen, face = strips.windows(limited(middle, self._axis, len(strips.face) - self._axis - 1), self._axis)
        alone = self._fitter.fit(seen, face, np.zeros(frames))
        number = np.zeros((2, frames), np.intp)
        number[side, frame] = np.arange(len(frame))
        number = np.where(likely, number, number[::-1])
        return self._believed(joint, number, alone.noise, middle + alone.fraction)

    def _believed(self, joint: Joint, number: Indices, noise_alone: Floats, row_alone: Floats) -> Pairs:
        """The best of the pairs numbered (2, M) for each frame, beside the other and the upper needle alone, (M,)."""
        noise, upper_row, lower_row = (own[number] for own in (joint.noise, joint.upper_row, joint.lower_row))
        best = joint.part(number[noise.argmin(axis=0), np.arange(number.shape[1])])
        with np.errstate(invalid="ignore"):
            off_upper, beside = np.abs(upper_row - best.upper_row), np.abs(lower_row - best.upper_row)
            is_mirrored = (lower_row - upper_row) * (best.lower_row - best.upper_row) < 0
            is_rival = (MIRROR_BETTER * noise <= best.noise) & is_mirrored
            is_hidden = MUCH_BETTER * noise_alone <= best.noise
            doubts = np.vstack(
                [np.where(is_rival, off_upper, 0.0), np.where(is_hidden, np.abs(row_alone - best.upper_row), 0.0)]
            )
            doubt_rows = np.vstack([np.where(is_rival, beside, 0.0), np.abs(best.lower_row - best.upper_row)])
        believed = np.isfinite(best.noise) & ~is_rival.any(axis=0) & ~is_hidden
        believed &= best.correlation >= MIN_PAIR_CORRELATION
        lower_score = np.zeros(len(believed))
        lower_score[believed] = self._lower_score(best.part(believed))
        return Pairs(
            upper_row=best.upper_row,
            upper_sigma_rows=np.hypot(best.upper_sigma_rows, np.nan_to_num(doubts).max(axis=0)),
            upper_score=best.score,
            lower_row=best.lower_row,
            lower_sigma_rows=best.lower_sigma_rows,
            lower_score=lower_score,
            lower_doubt_rows=np.nan_to_num(doubt_rows).max(axis=0),
            correlation=np.nan_to_num(best.correlation),
        )

    def _fit_over(self, strips: Strips, rows: Indices, lower_rows: Floats) -> Over:
        seen, face = strips.windows(rows, self._axis)
        layer = self._lower.at(lower_rows - rows + self._axis)
        back = np.empty_like(seen)

        def behind(chosen: Indices | slice, transparency: Floats) -> Floats:
            light, part = layer.chosen(chosen).behind(transparency.reshape(-1, *self._upper.pixels.shape))
            back[chosen] = light.reshape(len(light), -1) + part.reshape(len(part), -1) * face[chosen]
            return back[chosen]

        fits = self._fitter.fit(seen, face, np.zeros(len(rows)), behind=behind)
        return Over(rows + fits.fraction, rows, fits, seen, face, back)

    def _layers(self, lower_rows: Indices) -> tuple[Floats, Floats]:
        """Both needles as one, the lower's axis on rows (K,) of the window: light and transparency, (K, 2, H * C) each.

        The second of the two is how the upper's own layer changes when it moves on.
        """
        rows, places = np.unique(lower_rows, return_inverse=True)
        new = [row for row in rows.tolist() if row not in self._drawn]
        if new:
            self._drawn.update(zip(new, zip(*self._drawn_on(np.array(new)), strict=True), strict=True))
        light, part = zip(*(self._drawn[row] for row in rows.tolist()), strict=True)
        return np.stack(light)[places], np.stack(part)[places]

    def _drawn_on(self, lower_rows: Indices) -> tuple[Floats, Floats]:
        layer = self._lower.at(lower_rows.astype(np.float64))
        light, part = layer.behind(self._own.transparency[0])
        own_light, own_part = self._own.light, self._own.transparency
        both = (own_light + own_part * light[:, None]), own_part * part[:, None]
        one, other = (each.reshape(len(lower_rows), 2, -1).astype(np.float32) for each in both)
        return one, other

    @staticmethod
    def _kernel(layers: Floats, more: Floats | None) -> Floats:
        """(H * C, 2 K), and one column more."""
        rows = layers.reshape(-1, layers.shape[-1])
        return np.ascontiguousarray((rows if more is None else np.vstack([rows, more])).T.astype(np.float32))

    def _noises(self, strips: Strips, middle: Indices) -> tuple[Floats, Floats]:
        """What each place of the lower needle leaves unexplained, and where the upper one then is; (M, K) each."""
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
        is_off = ~(np.abs(fits.fraction) <= self._axis)
        further = (np.abs(fits.fraction) > MAX_FRACTION_ROWS) & ~is_off
        hopeless = further & (noise > LIKELY_NOISE * noise.min(axis=1, keepdims=True))
        is_off |= hopeless
        further &= ~hopeless
        noise[is_off], rows[is_off] = np.inf, np.nan
        if further.any():
            self._moved_on(strips, middle, noise, rows, np.argwhere(further))
        return noise, rows

    def _moved_on(self, strips: Strips, middle: Indices, noise: Floats, rows: Floats, open_: Indices) -> None:
        """Those places at which the upper needle lies further away, again from there; fills in noise and rows."""
        axis, face_rows = self._axis, len(strips.face)
        at = np.rint(rows[open_[:, 0], open_[:, 1]]).astype(np.intp)
        for _ in range(1, MAX_STEPS):
            frame, place = open_[:, 0], open_[:, 1]
            noise[frame, place], rows[frame, place] = np.inf, np.nan
            inside = (at >= axis) & (at < face_rows - axis)
            open_, at = open_[inside], at[inside]
            if not open_.size:
                return
            frame, place = open_[:, 0], open_[:, 1]
            seen, face = strips.part(frame).windows(at, axis)
            light, part = self._layers(middle[frame] + self._apart[place] - at + axis)
            layers = np.empty((len(at), 4, seen.shape[1]), np.float32)
            np.multiply(part, face[:, None], out=layers[:, :ONE])
            layers[:, :ONE] += light
            layers[:, ONE] = 1.0
            np.subtract(seen, np.float32(MIDDLE_GREY), out=layers[:, SEEN])
            moments = ((layers * self._upper.trust.ravel()) @ layers.transpose(0, 2, 1)).astype(np.float64)
            fits = solved(moments.transpose(1, 2, 0), np.zeros(len(at), np.intp), self._pixels_per_sample)
            done = ~((np.abs(fits.fraction) > MAX_FRACTION_ROWS) & (np.abs(fits.fraction) <= axis))
            noise[frame[done], place[done]] = fits.noise[done]
            rows[frame[done], place[done]] = at[done] + fits.fraction[done]
            at = at[~done] + np.rint(fits.fraction[~done]).astype(np.intp)
            open_ = open_[~done]

    def _unseen(self, row: int, face: Floats) -> Floats:
        """(3, 3, K): the moments of needles and 1 with each other on one row of the gauge: no frame changes them."""
        if row not in self._known:
            layers = np.empty((len(self._apart), 3, face.size), np.float32)
            np.multiply(self._part, face, out=layers[:, :ONE])
            layers[:, :ONE] += self._light
            layers[:, ONE] = 1.0
            moments = (layers * self._upper.trust.ravel()) @ layers.transpose(0, 2, 1)
            self._known[row] = moments.astype(np.float64).transpose(1, 2, 0)
        return self._known[row]

    def _lower_score(self, joint: Joint) -> Floats:
        """How well what shows of the lower needle explains what upper needle and face leave there: a correlation."""
        layer = self._lower.at(joint.lower_row - joint.window + self._axis)
        shown = layer.shown(self._upper.transparency)
        light = (layer.colour * shown).reshape(joint.face.shape)
        shown = shown.reshape(joint.face.shape)
        where = shown > SHOWN_PART
        pixels = np.where(where, shown, 0.0).sum(axis=1) * self._pixels_per_sample
        added = joint.gain.astype(np.float32)[:, None] * (light - joint.face * shown)
        beside = (np.where(where, joint.unexplained, 0.0) ** 2).sum(axis=1)
        without = (np.where(where, joint.unexplained + added, 0.0) ** 2).sum(axis=1)
        score = np.sqrt(np.maximum(1.0 - beside / np.maximum(without, 1e-9), 0.0))
        found: Floats = np.where(pixels >= MIN_SHOWN_PIXELS, score, 0.0)
        return found


def _replaced(over: Over, chosen: Indices, others: Over) -> Over:
    """`over` with `others` in the chosen frames' places."""
    values = {}
    for name in ("row", "window", "seen", "face", "back"):
        values[name] = getattr(over, name).copy()
        values[name][chosen] = getattr(others, name)
    return Over(fits=over.fits.replaced(chosen, others.fits), **values)
