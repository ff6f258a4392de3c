"""The alignments of a flight over time: compact columns, some tens of bytes for each frame."""

from __future__ import annotations

import math
from array import array
from collections.abc import Sequence

import numpy as np

from decoder.alignment import Alignment, Point
from decoder.arrays import Floats
from decoder.lens import Lens

Kind = tuple[tuple[str, ...], Lens | None]
_ELEMENTS = 9


class AlignmentSeries(Sequence[Alignment | None]):
    """Where the panel lay in each frame; None for one that could not be read at all.

    An item is made when it is asked for, without its covariance.
    """

    def __init__(self) -> None:
        self._elements, self._score, self._kind = array("d"), array("f"), array("I")
        self._sigma_px, self._shifts_px = array("f"), array("f")
        self._kinds: dict[Kind, int] = {}
        self._gauges = 0

    def add(self, alignment: Alignment, sigma_px: Sequence[float], shifts_px: Sequence[Point] = ()) -> None:
        """A frame's alignment; `sigma_px` is how uncertain the place of each gauge is.

        `shifts_px` are how far their needles lie from there, in all frames of a flight or in none.
        """
        self._gauges = max(self._gauges, len(sigma_px))
        self._append(alignment.elements, alignment.score, alignment.failed, alignment.lens)
        self._sigma_px.extend(sigma_px)
        self._shifts_px.extend(coordinate for shift in shifts_px for coordinate in shift)

    def add_missing(self, failed: Sequence[str]) -> None:
        """A frame without one; `failed` are the features that did not match, as far as they were looked for."""
        self._append((math.nan,) * _ELEMENTS, math.nan, tuple(failed), None)
        self._sigma_px.extend([math.nan] * self._gauges)
        if self._shifts_px:
            self._shifts_px.extend([math.nan] * 2 * self._gauges)

    def __len__(self) -> int:
        return len(self._score)

    def __getitem__(self, index: int) -> Alignment | None:  # type: ignore[override]  # no slices are asked for
        if math.isnan(self._score[index]):
            return None
        index %= len(self)
        failed, lens = list(self._kinds)[self._kind[index]]
        elements = tuple(self._elements[index * _ELEMENTS : (index + 1) * _ELEMENTS])
        return Alignment(elements, self._score[index], failed, lens)

    def shift_px(self, index: int, gauge: int) -> Point:
        """How far the needles of a gauge lie from where a frame's alignment has them, in the panel picture's pixels."""
        if not self._shifts_px:
            return 0.0, 0.0
        lost_first = len(self) * 2 * self._gauges - len(self._shifts_px)
        at = (index % len(self)) * 2 * self._gauges + 2 * gauge - lost_first
        return self._shifts_px[at], self._shifts_px[at + 1]

    def failed(self, index: int) -> tuple[str, ...]:
        """The features that did not match in a frame."""
        return list(self._kinds)[self._kind[index]][0]

    def failures(self) -> dict[str, int]:
        """In how many frames each feature did not match, those that ever failed."""
        frames = np.bincount(np.array(self._kind, np.int64), minlength=len(self._kinds))
        counts: dict[str, int] = {}
        for (failed, _), count in zip(self._kinds, frames.tolist(), strict=True):
            for name in failed:
                counts[name] = counts.get(name, 0) + count
        return dict(sorted(counts.items()))

    @property
    def sigma_px(self) -> Floats:
        """(N, gauges) float32: how uncertain the place of each gauge is, in the panel picture's pixels; NaN where lost.

        Empty if that is not known.
        """
        values = np.array(self._sigma_px, np.float32)
        missing = len(self) * self._gauges - values.size  # frames that were lost before the first that was not
        padded: Floats = np.concatenate([np.full(missing, np.nan, np.float32), values])
        return padded.reshape(len(self), self._gauges)

    def _append(self, elements: Sequence[float], score: float, failed: tuple[str, ...], lens: Lens | None) -> None:
        self._elements.extend(elements)
        self._score.append(score)
        self._kind.append(self._kinds.setdefault((failed, lens), len(self._kinds)))
