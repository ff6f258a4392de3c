"""Events: what happened in a flight according to its columns: limits exceeded, steps, phases.

A limit is exceeded where a value is beyond it by more than its uncertainty; a value that may be within it is no event.
A step is a change from one frame to the next that is unlike anything near it, and that stays, unlike an outlier. Phases
are derived from airspeed and the rate of altitude, and only roughly: a flight is level if it climbs or descends by less
than a vertical speed indicator may be off.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from enum import StrEnum

import numpy as np

from decoder.imaging.sorting import MAD_TO_SIGMA, median
from decoder.instruments.reading import Status
from decoder.instruments.thresholds import BEYOND_CHANCE_SPREADS
from decoder.panel.arrays import Floats, Mask
from decoder.panel.errors import UnitError
from decoder.panel.scale import shortest
from decoder.panel.thresholds import CONFIDENCE_SIGMAS
from decoder.panel.units import converted
from decoder.timeseries.cross_checks import CLIMB, MINUTE_S, parameters_of
from decoder.timeseries.flight_data import FlightData, NeedleSeries, spans
from decoder.timeseries.outliers import LONGEST_FRAMES, pauses_before
from decoder.timeseries.thresholds import BACK_PART, LEAST_KT, MIN_ROWS, SMALLEST_PART, WINDOW_S

SEEN = (Status.READ, Status.EDGE)


class What(StrEnum):
    """What an event is."""

    EXCEEDED = "limit exceeded"
    STEP = "step"
    PHASE = "phase"


@dataclass(frozen=True, slots=True)
class Event:
    """A run of frames, by rows of the flight data, both included; `needle` is empty if it concerns the aircraft."""

    what: What
    needle: str
    first: int
    last: int
    words: str


def find_events(data: FlightData) -> list[Event]:
    """Find all events, ordered by time."""
    events = [event for series in data.series for event in [*_exceeded(data, series), *_steps(data, series)]]
    return sorted([*events, *_phases(data)], key=lambda event: (event.first, event.last))


def _exceeded(data: FlightData, series: NeedleSeries) -> Iterator[Event]:
    """Find the runs beyond a limit that the panel or the user has given."""
    quantity = series.quantity
    known = data.columns.get(quantity.name)
    if known is None:
        return
    doubt = CONFIDENCE_SIGMAS * series.sigma
    for limit, sign, words in ((known.above, 1.0, "above"), (known.below, -1.0, "below")):
        if limit is None:
            continue
        beyond = sign * (series.value - limit)
        for first, last in spans(np.nan_to_num(beyond - doubt, nan=-1.0) > 0):
            at = first + int(np.nanargmax(beyond[first : last + 1]))
            furthest = f"{series.value[at]:.6g} {quantity.unit}".strip()
            said = f"{words} {limit:g} {quantity.unit}".strip()
            yield Event(What.EXCEEDED, quantity.name, first, last, f"{said}: up to {furthest}")


def _steps(data: FlightData, series: NeedleSeries) -> Iterator[Event]:
    """Find changes from one frame to the next that stay, and are far larger than the value's usual changes."""
    seen = np.flatnonzero(series.has(*SEEN))
    if len(seen) < MIN_ROWS:
        return
    values, sigma, wraps = series.value[seen], series.sigma[seen], series.quantity.wraps
    changes = shortest(np.diff(values), wraps)
    usual = MAD_TO_SIGMA * float(median(np.abs(changes)))
    least = max(BEYOND_CHANCE_SPREADS * usual, BACK_PART * SMALLEST_PART * series.quantity.full_scale)
    large = np.abs(changes) > np.maximum(least, BEYOND_CHANCE_SPREADS * np.hypot(sigma[1:], sigma[:-1]))
    nearby = _largest_nearby(np.abs(changes))
    in_turn = (np.diff(data.time_s[seen]) > 0) & (np.diff(data.time_s[seen]) <= WINDOW_S / 4)
    for at in np.flatnonzero(large & in_turn & (BACK_PART * np.abs(changes) > nearby)):
        before, after = (_text(series, float(values[place])) for place in (at, at + 1))
        words = f"from {before} to {after} {series.quantity.unit}".strip() + " within a frame, and stays"
        yield Event(What.STEP, series.quantity.name, int(seen[at]), int(seen[at + 1]), words)


def _text(series: NeedleSeries, value: float) -> str:
    """Format a value; states and texts as they are written."""
    written = series.quantity.written
    return f"{value:.6g}" if written is None else written.text_of(value)


def _largest_nearby(changes: Floats) -> Floats:
    """(N,): the largest of the changes before and after each; one that reverts has an equal one beside it."""
    padded = np.pad(changes, LONGEST_FRAMES)
    shifted = [padded[LONGEST_FRAMES + by : len(padded) - LONGEST_FRAMES + by] for by in _beside()]
    largest: Floats = np.max(shifted, axis=0)
    return largest


def _beside() -> list[int]:
    return [by for by in range(-LONGEST_FRAMES, LONGEST_FRAMES + 1) if by]


def _phases(data: FlightData) -> Iterator[Event]:
    """Find where the aircraft stands or taxies, climbs, descends, or none of these."""
    climb_fpm = _climb_fpm(data)
    if climb_fpm is None:
        return
    of_a_level_flight = CLIMB.sizes(np.zeros_like(climb_fpm))
    level = np.where(np.abs(climb_fpm) <= of_a_level_flight, 0, np.sign(climb_fpm))
    slow = _slow(data)
    codes = np.where(slow, 2, level)
    names = {0: "level flight", 1: "climb", -1: "descent", 2: "slower than it flies: on the ground, or hovering"}
    runs = [
        (first, last, code)
        for code in names
        for first, last in spans((codes == code) & (np.isfinite(climb_fpm) | slow))
    ]
    for first, last, code in sorted(runs):
        if data.time_s[last] - data.time_s[first] >= WINDOW_S:
            yield Event(What.PHASE, "", first, last, names[code])


def _climb_fpm(data: FlightData) -> Floats | None:
    """Return the rate of altitude over a window, (N,), from the altimeter, or else the vertical speed indicator."""
    altitude, shown = (_of_parameter(data, *each) for each in (("altitude", "ft"), ("vertical speed", "fpm")))
    if altitude is None and shown is None:
        return None
    time_s = data.time_s
    begun = np.searchsorted(time_s, time_s - WINDOW_S)
    ended = np.minimum(np.searchsorted(time_s, time_s + WINDOW_S, side="right"), len(time_s)) - 1
    span_s = time_s[ended] - time_s[begun]
    if altitude is not None:
        with np.errstate(invalid="ignore", divide="ignore"):
            rate = (altitude[ended] - altitude[begun]) / span_s * MINUTE_S
        pauses = pauses_before(time_s)
        return np.where((span_s > WINDOW_S / 2) & (pauses[ended] == pauses[begun]), rate, np.nan)
    return shown


def _slow(data: FlightData) -> Mask:
    airspeed = _of_parameter(data, "airspeed", "kt")
    return np.zeros(len(data.frame), bool) if airspeed is None else np.nan_to_num(airspeed, nan=np.inf) < LEAST_KT


def _of_parameter(data: FlightData, parameter: str, unit: str) -> Floats | None:
    names = [name for name, own in parameters_of(data).items() if own == parameter]
    for series in data.series:
        if series.quantity.name in names[:1]:
            try:
                return converted(series.value, series.quantity.unit, unit)
            except UnitError:
                return None
    return None
