"""Gaps: what a needle may be said to show in the frames where it could not be read (thesis 3.3).

A flagged reading, one whose score stayed below the threshold, is replaced by the line between the nearest frames that
were read, never beyond the first or the last of them. Frames in which the panel itself was not found stay missing.
The uncertainty grows into the gap as that of a random walk pinned at both ends (a Brownian bridge), whose pace is the
needle's own during the flight.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from decoder.arrays import Floats, Mask
from decoder.combined import combine
from decoder.flight_data import CODE, NOWHERE, FlightData, NeedleSeries, spans
from decoder.reading import Status
from decoder.scale import in_turn
from decoder.sorting import quantile_of

# From a place where it is seen whole, a needle is soon under another one: about two needles' width.
COVERED_REACH_DEG = 6.0
READ_STATUSES = (Status.READ, Status.EDGE, Status.HIDDEN)


def fill_gaps(data: FlightData) -> FlightData:
    """The flight data with doubtful covered readings flagged, pointers combined and flagged readings interpolated."""
    by_name = {series.quantity.name: series for series in data.series}
    checked = {part for combination in data.combinations for part in combination.parts}  # each by the others
    believed = []
    for series in data.series:
        cover = by_name.get(series.quantity.covered_by or "")
        if cover is not None:
            pace_deg = _pace_deg(series, cover)
            if series.quantity.name not in checked:
                series = _without_doubtful(series, (Status.EDGE, Status.HIDDEN), (Status.READ,), pace_deg)  # noqa: PLW2901
            series = _without_doubtful(series, (Status.HIDDEN,), (Status.READ, Status.EDGE), pace_deg)  # noqa: PLW2901
        believed.append(series)
    filled = [_interpolated(series, data.time_s) for series in believed]
    names = [series.quantity.name for series in believed]
    for combination in data.combinations:
        series, contradicted = combine(combination, [believed[names.index(part)] for part in combination.parts])
        filled.append(_interpolated(series, data.time_s, never=contradicted))
    return replace(data, series=tuple(filled))


def _without_doubtful(
    series: NeedleSeries, doubted: tuple[Status, ...], trusted: tuple[Status, ...], pace_deg: float
) -> NeedleSeries:
    """Covered readings stand only where the needle went under the covering one, or came out from under it.

    A glare over the needle somewhere else on the dial looks just like a needle that is hidden, and its edge beside
    the covering needle like one that peeps out. So at each end of a run of doubted frames the nearest trusted frame
    must show the needle about where the run has it; a needle that is never seen so is not known to be covered.
    """
    covered, seen = series.has(*doubted), np.flatnonzero(series.has(*trusted))
    doubtful = np.zeros_like(covered)
    for first, last in spans(covered):
        ends = [
            (at[0], end) for at, end in ((seen[seen < first][-1:], first), (seen[seen > last][:1], last)) if at.size
        ]
        doubtful[first : last + 1] = not ends or any(
            abs(series.angles_apart_deg(at, end)) > COVERED_REACH_DEG + pace_deg * abs(int(at) - end)
            for at, end in ends
        )
    return replace(
        series,
        status=np.where(doubtful, CODE[Status.MISSING], series.status).astype(np.uint8),
        value=np.where(doubtful, NOWHERE, series.value),
        sigma=np.where(doubtful, NOWHERE, series.sigma),
    )


def _pace_deg(series: NeedleSeries, cover: NeedleSeries) -> float:
    """How far needles on this dial go in a frame, degrees: nineteen of twenty steps between readings are shorter."""
    before, after = slice(None, -1), slice(1, None)
    steps = [np.abs(one.angles_apart_deg(after, before))[_in_sequence(one)] for one in (series, cover)]
    together = np.concatenate(steps)
    return quantile_of(together, 0.95) if together.size else 0.0


def _in_sequence(series: NeedleSeries) -> Mask:
    """(N - 1,): where a frame and the next one both show the whole needle."""
    read = series.has(Status.READ)
    return read[1:] & read[:-1]


def _interpolated(series: NeedleSeries, time_s: Floats, *, never: Mask | None = None) -> NeedleSeries:
    known = np.flatnonzero(series.has(*READ_STATUSES))
    may_be = np.isfinite(series.score) if never is None else np.isfinite(series.score) & ~never
    flagged = np.flatnonzero(series.has(Status.MISSING) & may_be)
    if known.size:
        known = known[_rising(time_s[known])]  # a clock that jumps back leaves frames that belong nowhere
        between = (time_s[flagged] >= time_s[known[0]]) & (time_s[flagged] <= time_s[known[-1]])
        flagged = flagged[between & (flagged > known[0]) & (flagged < known[-1])]
    if not known.size or not flagged.size:
        return series
    wraps = series.quantity.wraps
    seen = series.value[known] if wraps is None else np.unwrap(series.value[known], period=wraps)
    status, value, sigma = series.status.copy(), series.value.copy(), series.sigma.copy()
    status[flagged] = CODE[Status.INTERPOLATED]
    line = np.interp(time_s[flagged], time_s[known], seen)
    value[flagged] = line if wraps is None else in_turn(line, wraps, series.quantity.lowest)
    pinned = np.interp(time_s[flagged], time_s[known], series.sigma[known])
    sigma[flagged] = np.hypot(pinned, _bridge_sigma(seen, time_s[known], time_s[flagged]))
    return replace(series, status=status, value=value, sigma=sigma)


def _rising(time_s: Floats) -> Mask:
    """(N,): where a time is later than all before it."""
    latest = np.maximum.accumulate(time_s)
    return np.concatenate([[True], time_s[1:] > latest[:-1]])


def _bridge_sigma(values: Floats, known_s: Floats, wanted_s: Floats) -> Floats:
    """Standard deviation at `wanted_s` of a random walk through the known values, at the pace of their own steps."""
    steps_s = np.maximum(np.diff(known_s), 1e-9)
    pace = float(np.mean(np.diff(values) ** 2 / steps_s)) if steps_s.size else 0.0
    after = np.clip(np.searchsorted(known_s, wanted_s), 1, max(len(known_s) - 1, 1))
    if len(known_s) < 2:  # noqa: PLR2004 - all known frames are of one moment
        return np.zeros_like(wanted_s)
    since_s, until_s = wanted_s - known_s[after - 1], known_s[after] - wanted_s
    bridge: Floats = np.sqrt(np.maximum(pace * since_s * until_s / np.maximum(since_s + until_s, 1e-9), 0.0))
    return bridge
