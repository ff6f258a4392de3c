"""Flags: the spans of a flight that an investigator looks at first, each with what is known of its reason."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from enum import StrEnum
from itertools import groupby

import numpy as np

from decoder.flight_data import FlightData, NeedleSeries, spans
from decoder.gauge_reader import SCORE_THRESHOLD
from decoder.outliers import find_outliers
from decoder.reading import Status


class Kind(StrEnum):
    """What a flag says, the gravest first."""

    OUTLIER = "outlier"
    """Values that the frames around them make hard to believe."""
    LOST = "panel not found"
    """Frames that could not be read at all."""
    MISSING = "missing"
    INTERPOLATED = "interpolated"
    HIDDEN = "hidden"
    EDGE = "edge"


KINDS = tuple(Kind)
_NEEDLE_KINDS = {
    Status.MISSING: Kind.MISSING,
    Status.INTERPOLATED: Kind.INTERPOLATED,
    Status.HIDDEN: Kind.HIDDEN,
    Status.EDGE: Kind.EDGE,
}


@dataclass(frozen=True, slots=True)
class Flag:
    """A run of frames; `first` and `last` are rows of the flight data, both included.

    Attributes
    ----------
    needle
        Empty where it is about the whole panel.
    reason
        As far as the flight data tell it.
    """

    kind: Kind
    needle: str
    first: int
    last: int
    reason: str

    @property
    def frames(self) -> int:
        """How many frames it covers."""
        return self.last - self.first + 1


def find_flags(data: FlightData) -> list[Flag]:
    """All flags, by time; of one time in the order of `Kind`."""
    combined = {combination.quantity.name for combination in data.combinations}
    flags = [
        Flag(Kind.OUTLIER, outlier.needle, outlier.first, outlier.last, outlier.reason.value)
        for outlier in find_outliers(data)
    ]
    flags += _lost(data)
    for series in data.series:
        flags += _of_needle(series, is_combined=series.quantity.name in combined)
    return sorted(flags, key=lambda flag: (flag.first, KINDS.index(flag.kind)))


def _lost(data: FlightData) -> Iterator[Flag]:
    """Runs of frames without a panel, by reason; a score in it is that of the run's first frame."""
    place = {int(frame): row for row, frame in enumerate(data.frame)}
    numbered = [(place[missing.frame], missing.reason) for missing in data.missing_frames]
    runs = groupby(enumerate(numbered), key=lambda item: (item[1][0] - item[0], item[1][1].partition(" (")[0]))
    for _, run in runs:
        rows = [row for _, row in run]
        yield Flag(Kind.LOST, "", rows[0][0], rows[-1][0], rows[0][1])


def _of_needle(series: NeedleSeries, *, is_combined: bool) -> Iterator[Flag]:
    for status, kind in _NEEDLE_KINDS.items():
        for first, last in spans(series.has(status) & np.isfinite(series.score)):
            score = float(np.min(series.score[first : last + 1]))
            yield Flag(kind, series.quantity.name, first, last, _reason(series, kind, score, is_combined=is_combined))


def _reason(series: NeedleSeries, kind: Kind, score: float, *, is_combined: bool) -> str:
    cover = series.quantity.covered_by
    if kind is Kind.HIDDEN:
        return f"under {cover}; it takes that needle's place" if cover else "under another needle"
    if kind is Kind.EDGE:
        what = f"{cover}, a glare or a bug" if cover else "another needle, a glare or a bug"
        return f"{what} covers a part; the rest matched (lowest score {score:.2f})"
    end = "the value is on the line between its neighbours" if kind is Kind.INTERPOLATED else "there is no value"
    if is_combined:
        return f"a pointer was not seen, or they contradict each other; {end}"
    if score == 0.0:
        return f"the gauge was not found, or not whole in the frame; {end}"
    if score < SCORE_THRESHOLD:
        return f"nothing matched well enough (lowest score {score:.2f}); {end}"
    return f"what matched was not believed: it could be another needle, or lies where the needle cannot be; {end}"
