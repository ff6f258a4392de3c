"""Gaps: what a needle may be said to show in the frames where it could not be read (thesis 3.3).

A flagged reading, one whose score stayed below the threshold, is replaced by the line between the nearest frames that
were read, never beyond the first or the last of them. Frames in which the panel itself was not found stay missing.
The uncertainty grows into the gap as that of a random walk pinned at both ends (a Brownian bridge), whose pace is the
needle's own during the flight.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from decoder.arrays import Floats
from decoder.flight_data import CODE, NOWHERE, FlightData, NeedleSeries, spans
from decoder.reading import Status

READ_STATUSES = (Status.READ, Status.EDGE, Status.HIDDEN)


def fill_gaps(data: FlightData) -> FlightData:
    """The flight data with doubtful hidden readings flagged and flagged readings interpolated."""
    by_name = {series.needle.name: series for series in data.series}
    believed = [_without_doubtful_hidden(series, by_name.get(series.needle.covered_by or "")) for series in data.series]
    return replace(data, series=tuple(_interpolated(series, data.time_s) for series in believed))


def _without_doubtful_hidden(series: NeedleSeries, cover: NeedleSeries | None) -> NeedleSeries:
    """Hidden readings stand only where the needle went under the covering one, or came out from under it.

    A glare over the needle somewhere else on the dial looks just like a needle that is hidden. So at each end of a
    run of hidden frames the nearest frame in which the needle was seen must show it near the covering needle.
    """
    hidden = series.has(Status.HIDDEN)
    if cover is None or not hidden.any():
        return series
    seen = np.flatnonzero(series.has(Status.READ, Status.EDGE))
    reach_deg = (series.needle.template.span or 0.0) / 2 + (cover.needle.template.span or 0.0) / 2
    doubtful = np.zeros_like(hidden)
    for first, last in spans(hidden):
        before, after = seen[seen < first][-1:], seen[seen > last][:1]
        ends = [(before, first), (after, last)]
        if any(abs(series.angle_deg[at[0]] - cover.angle_deg[end]) > reach_deg for at, end in ends if at.size):
            doubtful[first : last + 1] = True
    return replace(
        series,
        status=np.where(doubtful, CODE[Status.MISSING], series.status).astype(np.uint8),
        value=np.where(doubtful, NOWHERE, series.value),
        sigma=np.where(doubtful, NOWHERE, series.sigma),
    )


def _interpolated(series: NeedleSeries, time_s: Floats) -> NeedleSeries:
    known = np.flatnonzero(series.has(*READ_STATUSES))
    flagged = np.flatnonzero(series.has(Status.MISSING) & np.isfinite(series.score))
    if known.size:
        flagged = flagged[(flagged > known[0]) & (flagged < known[-1])]
    if not known.size or not flagged.size:
        return series
    status, value, sigma = series.status.copy(), series.value.copy(), series.sigma.copy()
    status[flagged] = CODE[Status.INTERPOLATED]
    value[flagged] = np.interp(time_s[flagged], time_s[known], series.value[known])
    pinned = np.interp(time_s[flagged], time_s[known], series.sigma[known])
    sigma[flagged] = np.hypot(pinned, _bridge_sigma(series.value[known], time_s[known], time_s[flagged]))
    return replace(series, status=status, value=value, sigma=sigma)


def _bridge_sigma(values: Floats, known_s: Floats, wanted_s: Floats) -> Floats:
    """Standard deviation at `wanted_s` of a random walk through the known values, at the pace of their own steps."""
    steps_s = np.maximum(np.diff(known_s), 1e-9)
    pace = float(np.mean(np.diff(values) ** 2 / steps_s)) if steps_s.size else 0.0
    after = np.searchsorted(known_s, wanted_s)
    since_s, until_s = wanted_s - known_s[after - 1], known_s[after] - wanted_s
    bridge: Floats = np.sqrt(np.maximum(pace * since_s * until_s / (since_s + until_s), 0.0))
    return bridge
