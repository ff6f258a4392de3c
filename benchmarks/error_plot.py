"""Errors over a flight's frames, needle by needle, in the band that the flight data claim: an SVG, always the same.

Drawn here and not by a plotting library: the pages of docs/ carry it, and a dot must be a few bytes.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from xml.sax.saxutils import escape

import numpy as np

from decoder.panel.arrays import Floats
from decoder.panel.scale import shortest
from decoder.panel.thresholds import CONFIDENCE_SIGMAS
from decoder.timeseries.accuracy import truth_at
from decoder.timeseries.tables import Table, flight_table

WIDTH, STRIP, TOP, BOTTOM = 800, 64, 34, 34
LEFT, RIGHT = 166, 700
HALF = 26.0
"""Of a strip's height, from its middle to the limit that stands beside it."""
TEXT = "font-family='sans-serif' font-size='11' fill='#333'"
COLOURS = {"in": "#1f6fb2", "out": "#c0392b"}


@dataclass(frozen=True, slots=True)
class Track:
    """One needle over a flight, percent of full scale; NaN where there is no value or no truth.

    Attributes
    ----------
    error, band : (N,)
        Value less truth, and half the width of the 95 % band around it.
    """

    name: str
    error: Floats
    band: Floats

    @property
    def limit(self) -> float:
        """What the strip has room for, up and down: every error, and a usual band."""
        known = np.isfinite(self.error)
        if not known.any():
            return 1.0
        largest = max(float(np.abs(self.error[known]).max()), float(np.median(self.band[known])))
        return 1.1 * largest or 1.0

    @property
    def inside(self) -> Floats:
        """(N,): 1 where the truth lies in the band, 0 where it does not, NaN where there is no error."""
        return np.where(np.isfinite(self.error), np.abs(self.error) <= self.band, np.nan)


def tracks(flight: Table, truth: Table) -> list[Track]:
    """Of every needle that both tables have."""
    described = flight_table(flight)
    found = []
    for name in (name for name in described.names if name in truth.columns):
        known = described.described(name)
        error = shortest(flight.numbers(name) - truth_at(flight, truth, name, known), known.wraps)
        percent = 100.0 / (known.full_scale or 1.0)
        found.append(Track(name, error * percent, CONFIDENCE_SIGMAS * flight.numbers(f"{name}_sigma") * percent))
    return found


def error_svg(title: str, needles: Sequence[Track]) -> str:
    """A strip for each needle, the frames from left to right: the band in grey, errors in it blue, others red."""
    height = TOP + STRIP * len(needles) + BOTTOM
    frames = max((len(needle.error) for needle in needles), default=1)
    parts = [
        f"<svg xmlns='http://www.w3.org/2000/svg' viewBox='0 0 {WIDTH} {height}' width='{WIDTH}' height='{height}'>",
        f"<title>{escape(title)}</title>",
        f"<rect width='{WIDTH}' height='{height}' fill='white'/>",
        f"<text x='{LEFT}' y='20' {TEXT}>{escape(title)}: error, % of full scale, and 95 % band</text>",
    ]
    for number, needle in enumerate(needles):
        parts += _strip(needle, TOP + STRIP * number + STRIP / 2, frames)
    parts += [
        f"<text x='{LEFT}' y='{height - 12}' {TEXT}>frame 0</text>",
        f"<text x='{RIGHT}' y='{height - 12}' text-anchor='end' {TEXT}>{frames - 1}</text>",
        "</svg>",
    ]
    return "\n".join(parts) + "\n"


def _strip(needle: Track, middle: float, frames: int) -> Iterator[str]:
    x = LEFT + (RIGHT - LEFT) * np.arange(len(needle.error)) / max(frames - 1, 1)
    y = middle - HALF * needle.error / needle.limit
    reach = HALF * np.minimum(needle.band / needle.limit, 1.0)
    for run in _runs(np.isfinite(reach)):
        upper = [f"{x[index]:.1f} {middle - reach[index]:.1f}" for index in run]
        lower = [f"{x[index]:.1f} {middle + reach[index]:.1f}" for index in reversed(run)]
        yield f"<path d='M{'L'.join(upper + lower)}Z' fill='#ddd' stroke='#ddd'/>"
    yield f"<path d='M{LEFT} {middle:g}H{RIGHT}' stroke='#999' stroke-width='.5'/>"
    for kind, wanted in (("in", 1.0), ("out", 0.0)):
        where = np.flatnonzero(needle.inside == wanted)
        if where.size:
            dots = "".join(f"M{x[index]:.1f} {y[index]:.1f}h0" for index in where)
            yield (
                f"<path class='{kind}' d='{dots}' stroke='{COLOURS[kind]}' stroke-width='2.4' stroke-linecap='round'/>"
            )
    known = needle.inside[np.isfinite(needle.inside)]
    share = f"{known.mean():.1%} in it" if known.size else "no value"
    yield f"<text x='{LEFT - 44}' y='{middle + 4:g}' text-anchor='end' {TEXT}>{escape(needle.name)}</text>"
    yield f"<text x='{LEFT - 6}' y='{middle - HALF + 6:g}' text-anchor='end' {TEXT}>{needle.limit:+.2g}</text>"
    yield f"<text x='{LEFT - 6}' y='{middle + HALF + 4:g}' text-anchor='end' {TEXT}>{-needle.limit:+.2g}</text>"
    yield f"<text x='{RIGHT + 8}' y='{middle + 4:g}' {TEXT}>{share}</text>"


def _runs(where: np.typing.NDArray[np.bool_]) -> list[list[int]]:
    """The indices that are true, in rows without a gap."""
    indices = np.flatnonzero(where)
    return [part.tolist() for part in np.split(indices, np.flatnonzero(np.diff(indices) > 1) + 1) if part.size]
