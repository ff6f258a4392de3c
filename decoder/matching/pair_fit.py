"""Two needles that nearly coincide, read together in many frames at once.

Too little of the lower needle shows to search for it alone, but what shows still biases the fit of the upper one.

So every position at which the lower needle touches the upper one is tried, and the best on either side is fitted
jointly.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, fields
from functools import cached_property
from typing import Self

import numpy as np

from decoder.imaging.thresholds import HALF
from decoder.matching.joint_fit import Joint, JointFitter
from decoder.matching.lower_layer import LowerNeedle
from decoder.matching.needle_fit import Fits, Settled, WindowFitter, settle
from decoder.matching.needle_template import NeedleTemplate
from decoder.matching.pair_places import PairPlaces, Tried
from decoder.matching.strips import Strips
from decoder.matching.thresholds import MIN_PAIR_CORRELATION, MUCH_BETTER, SHOWN_PART, SHOWN_PIXELS
from decoder.panel.arrays import Floats, Indices, limited


@dataclass(frozen=True, slots=True)
class Pairs:
    """The fits of M pairs, (M,) each.

    Attributes
    ----------
    upper_row, upper_sigma_rows, upper_score
        As in a `matching.Match`; where several pairs explain the pixels nearly as well, sigma covers them.
    lower_row, lower_sigma_rows
        The lower needle's.
    lower_score
        How much of what the upper needle and the face leave unexplained the lower one's visible part explains; 0 where
        it is not trusted.
    lower_doubt_rows
        How far from the upper needle the lower may be while looking nearly the same.
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
        """Return the result for frames in which no pair explains the pixels."""
        nothing = {field.name: np.zeros(len(upper_rows)) for field in fields(cls)}
        return cls(**nothing | {"upper_row": upper_rows.astype(np.float64)})

    def put(self, which: Indices, others: Pairs) -> None:
        """Store the results of some of the frames, in place."""
        for field in fields(self):
            getattr(self, field.name)[which] = getattr(others, field.name)


class PairFitter:
    """Fits two needles of one gauge together, one over the other.

    Attributes
    ----------
    reach_rows
        The largest distance of their axes that is tried.
    """

    def __init__(self, upper: NeedleTemplate, lower: NeedleTemplate, pixels_per_sample: float) -> None:
        self._upper, self._lower = upper, LowerNeedle(lower, upper.rows)
        self._axis = (upper.rows - 1) // 2
        self._pixels_per_sample = pixels_per_sample
        half_widths_rows = sum(needle.half_width_deg / needle.step_deg for needle in (upper, lower))
        self.reach_rows = math.ceil(half_widths_rows / 2) + 2
        self._fitter = WindowFitter([upper], [pixels_per_sample])
        self._joint = JointFitter(upper, self._lower, pixels_per_sample)
        self._places = PairPlaces(upper, self._lower, self.reach_rows, pixels_per_sample)

    @cached_property
    def hidden_reach_rows(self) -> float:
        """The largest distance of the axes at which too little of the lower needle shows to locate it."""
        apart = np.arange(self._axis)
        shown = self._lower.at(self._axis + np.stack([-apart, apart]).astype(float)).shown(self._upper.transparency)
        pixels = shown.sum(axis=(2, 3), where=shown > SHOWN_PART) * self._pixels_per_sample
        tells = (pixels >= SHOWN_PIXELS).any(axis=0)
        return float(tells.argmax()) if tells.any() else float(self._axis)

    def over(self, strips: Strips, upper_rows: Floats, lower_rows: Floats) -> Settled:
        """Fit the upper needle near a row, over the lower one on another row, (M,) each."""

        def fit(open_: Indices, rows: Indices, guess_rows: Floats) -> Fits:
            seen, face = strips.part(open_).windows(rows, self._axis)
            layer = self._lower.at(lower_rows[open_] - rows + self._axis)

            def behind(chosen: Indices | slice, transparency: Floats) -> Floats:
                light, part = layer.chosen(chosen).behind(transparency.reshape(-1, *self._upper.pixels.shape))
                back: Floats = light.reshape(len(light), -1) + part.reshape(len(part), -1) * face[chosen]
                return back

            return self._fitter.fit(seen, face, guess_rows, behind=behind)

        limits = (self._axis, len(strips.face) - self._axis - 1)
        return settle(fit, np.rint(upper_rows), limits, self._axis)

    def fit(self, strips: Strips, upper_rows: Floats) -> Pairs:
        """Return the best pairs near the rows (M,) at which the upper needles were found."""
        last = len(strips.face) - self._axis - 1
        tried = self._places.tried(strips, limited(np.rint(upper_rows).astype(np.intp), self._axis, last))
        pairs = Pairs.none(upper_rows)
        where = np.flatnonzero(tried.is_hopeful)
        if where.size:
            pairs.put(where, self._settled(strips.part(where), upper_rows[where], tried.part(where)))
        return pairs

    def _settled(self, strips: Strips, upper_rows: Floats, tried: Tried) -> Pairs:
        """Fit the best start on either side: a mirrored pair may leave as little unexplained."""
        frames = len(upper_rows)
        sides = (tried.lower_row - tried.upper_row) * np.array([1, -1])[:, None, None] >= 0
        noise = np.where(sides, tried.noise, np.inf)  # (2, M, K)
        side, frame = (each.ravel() for each in np.indices((2, frames)))
        place = noise.argmin(axis=2)[side, frame]
        start = tried.upper_row[frame, place]
        joint = self._joint.fit(
            strips.part(frame),
            np.where(np.isfinite(start), start, upper_rows[frame]),
            tried.lower_row[frame, place],
        )
        alone = self._fitter.fit(*strips.windows(tried.middle, self._axis), np.zeros(frames))
        number = np.arange(2 * frames).reshape(2, frames)
        return self._believed(joint, number, alone.noise, tried.middle + alone.fraction)

    def _believed(self, joint: Joint, number: Indices, noise_alone: Floats, row_alone: Floats) -> Pairs:
        """Choose the best of each frame's pairs, numbered (2, M), and compare it with the rest and no lower needle."""
        noise, upper_row, lower_row = (own[number] for own in (joint.noise, joint.upper_row, joint.lower_row))
        best = joint.part(number[noise.argmin(axis=0), np.arange(number.shape[1])])
        with np.errstate(invalid="ignore"):
            off_upper, beside = np.abs(upper_row - best.upper_row), np.abs(lower_row - best.upper_row)
            is_mirrored = (lower_row - upper_row) * (best.lower_row - best.upper_row) < 0
            is_rival = (HALF * noise <= best.noise) & is_mirrored
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

    def _lower_score(self, joint: Joint) -> Floats:
        """Correlate the lower needle's visible part with what the upper needle and the face leave unexplained there."""
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
        found: Floats = np.where(pixels >= SHOWN_PIXELS / 3, score, 0.0)
        return found
