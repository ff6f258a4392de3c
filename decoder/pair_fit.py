"""Two needles that nearly coincide, read together in many frames at once: as `covered_pair` has it.

Every place is tried at which the lower needle touches the upper one; the best of either side is settled jointly.
"""

from __future__ import annotations

from dataclasses import dataclass, fields
from typing import Self

import numpy as np

from decoder.arrays import Floats, Indices, limited
from decoder.covered_pair import MIN_PAIR_CORRELATION, MIN_SHOWN_PIXELS, MIRROR_BETTER, MUCH_BETTER, SHOWN_PART
from decoder.fitting import MAX_FRACTION_ROWS
from decoder.joint_fit import Joint, JointFitter
from decoder.lower_layer import LowerNeedle
from decoder.matching import MAX_STEPS
from decoder.needle_template import NeedleTemplate
from decoder.pair_places import LIKELY_NOISE, PairPlaces, Tried
from decoder.quick_fit import Fits, QuickFitter
from decoder.strips import Strips


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

    @classmethod
    def none(cls, upper_rows: Floats) -> Self:
        """What is said where no pair explains what is seen."""
        nothing = {field.name: np.zeros(len(upper_rows)) for field in fields(cls)}
        return cls(**nothing | {"upper_row": upper_rows.astype(np.float64)})

    def put(self, which: Indices, others: Pairs) -> None:
        """What was found in some of the frames."""
        for field in fields(self):
            getattr(self, field.name)[which] = getattr(others, field.name)


class PairFitter:
    """Fits two needles of one gauge together; `reach_rows` is how far apart their axes are tried."""

    def __init__(self, upper: NeedleTemplate, lower: NeedleTemplate, reach_rows: int, pixels_per_sample: float) -> None:
        self._upper, self._lower = upper, LowerNeedle(lower, upper.rows)
        self._axis = (upper.rows - 1) // 2
        self._pixels_per_sample = pixels_per_sample
        self._fitter = QuickFitter(upper, pixels_per_sample)
        self._joint = JointFitter(upper, self._lower, pixels_per_sample)
        self._places = PairPlaces(upper, self._lower, reach_rows, pixels_per_sample)

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
        last = len(strips.face) - self._axis - 1
        tried = self._places.tried(strips, limited(np.rint(upper_rows).astype(np.intp), self._axis, last))
        pairs = Pairs.none(upper_rows)
        where = np.flatnonzero(tried.is_hopeful)
        if where.size:
            pairs.put(where, self._settled(strips.part(where), upper_rows[where], tried.part(where)))
        return pairs

    def _settled(self, strips: Strips, upper_rows: Floats, tried: Tried) -> Pairs:
        """The best of the places of either side, settled: the mirrored pair may leave as little unexplained."""
        frames = len(upper_rows)
        sides = (tried.lower_row - tried.upper_row) * np.array([1, -1])[:, None, None] >= 0
        noise = np.where(sides, tried.noise, np.inf)  # (2, M, K)
        least = noise.min(axis=2)
        likely = least <= LIKELY_NOISE * least.min(axis=0)
        side, frame = likely.nonzero()
        place = noise.argmin(axis=2)[side, frame]
        start = tried.upper_row[frame, place]
        joint = self._joint.fit(
            strips.part(frame),
            np.where(np.isfinite(start), start, upper_rows[frame]),
            tried.lower_row[frame, place],
        )
        alone = self._fitter.fit(*strips.windows(tried.middle, self._axis), np.zeros(frames))
        number = np.zeros((2, frames), np.intp)
        number[side, frame] = np.arange(len(frame))
        number = np.where(likely, number, number[::-1])
        return self._believed(joint, number, alone.noise, tried.middle + alone.fraction)

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
            upper_sigma_rows=np.hypot(best.upper_sigma_rows, np.fmax(doubts, 0.0).max(axis=0)),
            upper_score=best.score,
            lower_row=best.lower_row,
            lower_sigma_rows=best.lower_sigma_rows,
            lower_score=lower_score,
            lower_doubt_rows=np.fmax(doubt_rows, 0.0).max(axis=0),
            correlation=np.fmax(best.correlation, 0.0),
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
