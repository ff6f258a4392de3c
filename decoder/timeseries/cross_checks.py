"""Cross-checks: instruments that show the same thing in two ways, compared with each other.

A vertical speed indicator shows the rate of altitude. A turn indicator shows the rate of heading, which also follows
from bank and airspeed. A compass shows the heading, and two columns of one parameter show one value. Two of them
disagree if they are further apart than their uncertainties, the tolerances of such instruments and the lag between them
explain. A disagreement is reported; nothing is averaged, and it is not decided which is wrong.

Rates are compared by their integrals over some seconds. An instrument that lags by L seconds, whatever the nature of
the lag, then differs from one that does not by at most L times the range of what it shows meanwhile.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import combinations, pairwise

import numpy as np
from numpy.typing import NDArray

from decoder.instruments.reading import Status
from decoder.instruments.thresholds import BEYOND_CHANCE_SPREADS
from decoder.panel.arrays import Floats, Mask
from decoder.panel.errors import UnitError
from decoder.panel.parameters import NONE, parameter_of
from decoder.panel.scale import FULL_CIRCLE_DEG, shortest
from decoder.panel.units import converted
from decoder.timeseries.flight_data import FlightData, NeedleSeries, spans
from decoder.timeseries.outliers import Outlier, find_outliers
from decoder.timeseries.thresholds import LEAST_KT, SMALLEST_PART, WINDOW_S

Rows = NDArray[np.intp]
"""(K,): rows of the flight data."""
SEEN = (Status.READ, Status.EDGE)
KT_MPS, GRAVITY_MPS2, MINUTE_S = 0.514444, 9.80665, 60.0
UNITS = {
    "airspeed": "kt", "true airspeed": "kt", "altitude": "ft", "altimeter setting": "inHg", "vertical speed": "fpm",
    "pitch": "deg", "roll": "deg", "heading": "deg", "compass": "deg", "turn rate": "deg/s",
}  # fmt: skip


@dataclass(frozen=True, slots=True)
class Allowed:
    """By how much two working instruments may differ, besides the uncertainty of their readings.

    Attributes
    ----------
    absolute, of_value
        In the parameter's unit, and as a part of the value; the larger one counts.
    lag_s
        How far the one may lag behind the other.
    """

    absolute: float
    of_value: float = 0.0
    lag_s: float = 0.0

    def sizes(self, values: Floats) -> Floats:
        """Return the tolerance at each value."""
        return np.maximum(self.absolute, self.of_value * np.abs(values))


SAME = {
    "airspeed": Allowed(10, 0.05, 2),
    "true airspeed": Allowed(10, 0.05, 2),
    "altitude": Allowed(100, 0.01, 2),
    "vertical speed": Allowed(250, 0.10, 9),
    "pitch": Allowed(4, 0.0, 1),
    "roll": Allowed(4, 0.0, 1),
    "heading": Allowed(10, 0.0, 1),
    "turn rate": Allowed(1, 0.20, 4),
}
"""Two columns of one parameter: what tables allow an installed system (14 CFR 91 and 135), twice that for angles."""
CLIMB = Allowed(250, 0.10, 9)
"""Those tables' vertical speed; such indicators lag by six to nine seconds (FAA-H-8083-15B)."""
TURN = Allowed(1, 0.20, 4)
"""Degrees a second: a third of a standard rate; the gyro is damped, and canted ones answer to roll first."""
COMPASS = Allowed(15, 0.0, 0.0)
"""Ten degrees of deviation are allowed without a card that says more (14 CFR 23.1327); a gyro drifts in between."""
UNCOORDINATED = Allowed(10, 0.10, 2)
"""Degrees of bank that a slip takes without a turn, and the part that an airspeed may be off."""
SETTING = "a change of altimeter setting would look the same, and no column shows it"


@dataclass(frozen=True, slots=True)
class Disagreement:
    """A time span in which two disagree; `first` and `last` are rows of the flight data.

    Attributes
    ----------
    apart
        The largest difference, in the check's `apart_unit`.
    allowed
        By how much they may differ there.
    """

    first: int
    last: int
    apart: float
    allowed: float


@dataclass(frozen=True, slots=True)
class CrossCheck:
    """Two ways to the same quantity over a flight.

    Attributes
    ----------
    what, names
        In words, and the name of each of the two.
    columns
        The ones used.
    unit, apart_unit
        Of the curves, and of their difference, which for integrated rates is another.
    one, other
        (N,) both curves, NaN where they could not be compared.
    disagreements
        By time.
    but
        A possible cause that would look like a disagreement without being one, if it cannot be excluded here.
    """

    what: str
    names: tuple[str, str]
    columns: tuple[str, ...]
    unit: str
    apart_unit: str
    one: Floats
    other: Floats
    disagreements: tuple[Disagreement, ...]
    but: str = ""

    @property
    def compared(self) -> int:
        """The number of frames in which they could be compared."""
        return int((np.isfinite(self.one) & np.isfinite(self.other)).sum())

    @property
    def words(self) -> str:
        """The result as a sentence."""
        if not self.compared:
            return f"{self.what}: never seen together for long enough"
        if not self.disagreements:
            return f"{self.what}: agree, {self.compared} frames compared"
        worst = max(self.disagreements, key=lambda each: each.apart / each.allowed)
        runs = "1 run" if len(self.disagreements) == 1 else f"{len(self.disagreements)} runs"
        return (
            f"{self.what}: DISAGREE in {runs}, by up to {worst.apart:.4g} {self.apart_unit} where"
            f" {worst.allowed:.4g} {self.apart_unit} can be explained{self.but and f' ({self.but})'}"
        )


@dataclass(frozen=True, slots=True)
class _Sensed:
    """A column in its parameter's unit; (N,), NaN where it was not read."""

    name: str
    parameter: str
    values: Floats
    sigma: Floats

    @property
    def turn(self) -> float | None:
        """The value at which it wraps."""
        return FULL_CIRCLE_DEG if self.parameter in ("heading", "compass", "roll") else None


@dataclass(frozen=True, slots=True)
class _Way:
    """One way to the compared quantity over time: a value (a heading) or a rate to be integrated.

    `allowed` is what a second may add to the difference, `lag_s` how far it may lag, `hop` how far it may stick,
    or be off occasionally.
    """

    words: str
    columns: tuple[str, ...]
    sums: Floats
    sigma: Floats
    rate: Floats | None = None
    allowed: Floats | None = None
    lag_s: float = 0.0
    hop: float = 0.0


def parameters_of(data: FlightData) -> dict[str, str]:
    """Return which parameter each column is, from the panel or else from its name."""
    found = {}
    for series in data.series:
        name = series.quantity.name
        said = data.columns[name].means if name in data.columns else None
        parameter = said or parameter_of(name)
        if parameter not in (None, NONE):
            found[name] = str(parameter)
    return found


def cross_checks(data: FlightData) -> list[CrossCheck]:
    """Compare all columns that show the same quantity in different ways."""
    parameters = parameters_of(data)
    doubtful = find_outliers(data)
    sensed = [
        made
        for series in data.series
        if series.quantity.name in parameters
        and (made := _sensed(series, parameters[series.quantity.name], doubtful)) is not None
    ]
    by_parameter: dict[str, list[_Sensed]] = {}
    for one in sensed:
        by_parameter.setdefault(one.parameter, []).append(one)
    time_s = data.time_s
    return [
        *_of_one_parameter(by_parameter, time_s),
        *_of_compass(by_parameter, time_s),
        *_of_climb(by_parameter, time_s),
        *_of_turns(by_parameter, time_s),
    ]


def _sensed(series: NeedleSeries, parameter: str, doubtful: Sequence[Outlier]) -> _Sensed | None:
    """Bring a column to its parameter's unit; None if its own is unknown or of another kind."""
    low, high = series.quantity.range
    seen = series.has(*SEEN)
    for outlier in doubtful:  # already reported
        if outlier.needle == series.quantity.name:
            seen[outlier.first : outlier.last + 1] = False
    if parameter == "turn rate":  # at its stops it no longer shows the rate
        margin = (high - low) / 50
        seen &= (series.value > low + margin) & (series.value < high - margin)
    try:
        values = converted(np.where(seen, series.value, np.nan), series.quantity.unit, UNITS[parameter])
        ends = converted(np.array([0.0, 1.0]), series.quantity.unit, UNITS[parameter])
    except UnitError:
        return None
    if parameter == "roll":  # a ring may count it from 0 to 360
        values = shortest(values, FULL_CIRCLE_DEG)
    return _Sensed(series.quantity.name, parameter, values, series.sigma * abs(float(ends[1] - ends[0])))


Sensed = Mapping[str, Sequence[_Sensed]]


def _of_one_parameter(by_parameter: Sensed, time_s: Floats) -> Iterator[CrossCheck]:
    for parameter, allowed in SAME.items():
        for one, other in combinations(by_parameter.get(parameter, ()), 2):
            rows = np.arange(len(time_s))
            ranges = np.minimum(
                *(_ranges_within(time_s, each.values, rows, rows, allowed.lag_s) for each in (one, other))
            )
            limit = BEYOND_CHANCE_SPREADS * np.hypot(one.sigma, other.sigma) + allowed.sizes(one.values) + ranges
            yield _of_values(f"{one.name} and {other.name}, two of {parameter}", one, other, limit)


def _of_compass(by_parameter: Sensed, time_s: Floats) -> Iterator[CrossCheck]:
    """Compare a compass with headings while neither has turned for a while: in turns it is off by tens of degrees."""
    for heading in by_parameter.get("heading", ()):
        for compass in by_parameter.get("compass", ()):
            rest = _at_rest(time_s, heading) & _at_rest(time_s, compass)
            steady = _Sensed(compass.name, "compass", np.where(rest, compass.values, np.nan), compass.sigma)
            limit = BEYOND_CHANCE_SPREADS * np.hypot(heading.sigma, compass.sigma) + COMPASS.sizes(heading.values)
            yield _of_values(f"{heading.name} and {compass.name} in straight flight", heading, steady, limit)


def _at_rest(time_s: Floats, one: _Sensed) -> Mask:
    """(N,): where it stayed about the same for the whole window before."""
    rest = np.zeros(len(time_s), bool)
    for row, begun in enumerate(np.searchsorted(time_s, time_s - WINDOW_S)):
        before = slice(int(begun), row + 1)
        gone = np.abs(shortest(one.values[before] - one.values[row], one.turn))
        whole = time_s[row] - time_s[begun] > WINDOW_S / 2 and _is_dense(time_s[before])
        rest[row] = whole and bool((gone < SMALLEST_PART * FULL_CIRCLE_DEG).all())
    return rest


def _of_values(what: str, one: _Sensed, other: _Sensed, limit: Floats) -> CrossCheck:
    apart = np.abs(shortest(one.values - other.values, one.turn))
    both = np.isfinite(apart)
    found = tuple(
        Disagreement(first, last, *_worst(apart[first : last + 1], limit[first : last + 1]))
        for first, last in _bridged(both & (apart > limit), both)
    )
    names, unit = (one.name, other.name), UNITS[one.parameter]
    mine, others = (np.where(both, each.values, np.nan) for each in (one, other))
    return CrossCheck(what, names, names, unit, unit, mine, others, found)


def _bridged(where: Mask, known: Mask) -> list[tuple[int, int]]:
    """Find runs of true values, bridging frames in which nothing is known."""
    rows = np.flatnonzero(known)
    return [(int(rows[first]), int(rows[last])) for first, last in spans(where[rows])]


def _worst(apart: Floats, allowed: Floats) -> tuple[float, float]:
    at = int(np.nanargmax(apart / allowed))
    return float(apart[at]), float(allowed[at])


def _of_climb(by_parameter: Sensed, time_s: Floats) -> Iterator[CrossCheck]:
    """Compare altitude with vertical speed, correcting for changes of the altimeter's setting."""
    settings = by_parameter.get("altimeter setting", ())
    for altitude in by_parameter.get("altitude", ()):
        values, columns = altitude.values, [altitude.name]
        for setting in settings[:1]:
            values, columns = values - _altitude_of_setting_ft(setting.values), [altitude.name, setting.name]
        climbed = _Way(f"{altitude.name}'s rate", tuple(columns), values, altitude.sigma, hop=SAME["altitude"].absolute)
        for shown in by_parameter.get("vertical speed", ()):
            rate, sigma = shown.values / MINUTE_S, shown.sigma / MINUTE_S
            allowed = CLIMB.sizes(shown.values) / MINUTE_S
            other = _Way(shown.name, (shown.name,), _added(time_s, rate), sigma, rate, allowed, CLIMB.lag_s)
            check = _of_rates(time_s, climbed, other, ("fpm", "ft"), MINUTE_S)
            yield check if settings else replace(check, but=SETTING)


def _altitude_of_setting_ft(setting_inhg: Floats) -> Floats:
    """Return how much more an altimeter with this setting shows than with 29.92 (ICAO standard atmosphere)."""
    altitude_ft: Floats = 145366.45 * ((setting_inhg / 29.92126) ** 0.190263 - 1.0)
    return altitude_ft


def _of_turns(by_parameter: Sensed, time_s: Floats) -> Iterator[CrossCheck]:
    """Compare heading, turn indicator, and bank with airspeed: three ways to the rate of turn."""
    headings = [
        _Way(f"{one.name}'s rate", (one.name,), _unwrapped(one.values), one.sigma, hop=SAME["heading"].absolute)
        for one in by_parameter.get("heading", ())
    ]
    shown = [
        _Way(
            one.name, (one.name,), _added(time_s, one.values), one.sigma, one.values, TURN.sizes(one.values), TURN.lag_s
        )
        for one in by_parameter.get("turn rate", ())
    ]
    banked = list(_banked(by_parameter, time_s))
    for ones, others in ((headings, shown), (headings, banked), (shown, banked)):
        for one in ones:
            for other in others:
                yield _of_rates(time_s, one, other, ("deg/s", "deg"), 1.0)


def _banked(by_parameter: Sensed, time_s: Floats) -> Iterator[_Way]:
    """Yield the rate of turn that follows from bank: g tan(bank) / TAS."""
    speed = _true_airspeed_mps(by_parameter)
    if speed is None:
        return
    columns, mps, sigma_part = speed
    for roll in by_parameter.get("roll", ())[:1]:
        steep = np.radians(np.clip(roll.values, -80.0, 80.0))
        steeper_deg = np.abs(roll.values) + UNCOORDINATED.absolute
        further = np.radians(np.minimum(steeper_deg, 85.0))
        a_turn = np.degrees(GRAVITY_MPS2 / mps)
        rate = a_turn * np.tan(steep)
        allowed = a_turn * (np.tan(further) - np.tan(np.abs(steep))) + UNCOORDINATED.of_value * np.abs(rate)
        sigma = np.hypot(a_turn / np.cos(steep) ** 2 * np.radians(roll.sigma), rate * sigma_part)
        words = f"what {roll.name} makes at {columns[0]}"
        yield _Way(words, (roll.name, *columns), _added(time_s, rate), sigma, rate, allowed, UNCOORDINATED.lag_s)


def _true_airspeed_mps(by_parameter: Sensed) -> tuple[tuple[str, ...], Floats, Floats] | None:
    """Return true airspeed, (N,) m/s, and its relative uncertainty; None where nothing shows it."""
    for true in by_parameter.get("true airspeed", ()):
        return (true.name,), _flown(true.values), true.sigma / true.values
    for indicated in by_parameter.get("airspeed", ()):
        for altitude in by_parameter.get("altitude", ()):
            thinner = (1.0 - 6.8756e-6 * altitude.values) ** -2.1279  # root of the standard atmosphere's density ratio
            return (
                (indicated.name, altitude.name),
                _flown(indicated.values * thinner),
                indicated.sigma / indicated.values,
            )
    return None


def _flown(knots: Floats) -> Floats:
    """Convert to m/s; NaN where it is too slow for turns by bank."""
    return np.where(knots >= LEAST_KT, knots, np.nan) * KT_MPS


def _unwrapped(values: Floats) -> Floats:
    whole = values.copy()
    known = np.isfinite(values)
    whole[known] = np.unwrap(values[known], period=FULL_CIRCLE_DEG)
    return whole


def _added(time_s: Floats, rate: Floats) -> Floats:
    """(N,): the integral of a rate, NaN where it is not known."""
    known = np.flatnonzero(np.isfinite(rate))
    sums = np.full(len(rate), np.nan)
    if known.size:
        steps = np.diff(time_s[known]) * (rate[known][1:] + rate[known][:-1]) / 2
        sums[known] = np.concatenate([[0.0], np.cumsum(steps)])
    return sums


def _is_dense(time_s: Floats) -> bool:
    return len(time_s) > 1 and bool((np.diff(time_s) <= WINDOW_S / 4).all() and (np.diff(time_s) >= 0).all())


def _ranges_within(time_s: Floats, curve: Floats, first: Rows, last: Rows, lag_s: float) -> Floats:
    """(K,): the range of a curve between two rows each, extended on both sides by how far it may lag."""
    begun = np.searchsorted(time_s, time_s[first] - lag_s)
    ended = np.maximum(np.searchsorted(time_s, time_s[last] + lag_s, side="right"), begun + 1)
    tables = [np.where(np.isfinite(curve), sign * curve, -np.inf) for sign in (1.0, -1.0)]
    level = np.frexp(ended - begun)[1] - 1  # two overlapping runs of a power of two cover a window
    found = np.zeros((2, len(begun)))
    for power in range(int(level.max(initial=0)) + 1):
        here = np.flatnonzero(level == power)
        for own, table in zip(found, tables, strict=True):
            own[here] = np.maximum(table[begun[here]], table[ended[here] - (1 << power)])
        tables = [np.maximum(table[: -(1 << power)], table[1 << power :]) for table in tables]
    ranges = found.sum(axis=0)
    return np.where(np.isfinite(ranges), ranges, 0.0) if lag_s else np.zeros(len(begun))


def _of_rates(time_s: Floats, one: _Way, other: _Way, units: tuple[str, str], in_units: float) -> CrossCheck:
    """Compare the integrals of two ways: from row to row, and over a window around each row."""
    rows = np.flatnonzero(np.isfinite(one.sums) & np.isfinite(other.sums))
    middles, *windows = _windows(time_s, rows)
    curves = np.full((2, len(time_s)), np.nan)
    for curve, way in zip(curves, (one, other), strict=True):
        first, last = windows
        curve[middles] = (way.sums[last] - way.sums[first]) / (time_s[last] - time_s[first]) * in_units
    spans_s = np.diff(time_s[rows])
    next_to = (spans_s > 0) & (spans_s <= WINDOW_S / 4)
    steps = [rows[:-1][next_to], rows[1:][next_to]]
    gone = one.sums - other.sums
    apart, limit = _apart(time_s, gone, (one, other), *steps)
    runs = []
    for at in np.flatnonzero((apart > limit) & (one.hop + other.hop > 0)):  # rates alone have no steps
        before, after = (int(end[at]) for end in steps)
        runs.append(Disagreement(before, after, float(apart[at]), float(limit[at])))
        gone[after:] -= gone[after] - gone[before]  # so that a step is not reported as a slow drift as well
    apart, limit = _apart(time_s, gone, (one, other), *windows)
    for begun, ended in spans(apart > limit):
        own = slice(begun, ended + 1)  # all of these windows contain a step; a drift lies between their ends
        begin, end = sorted([int(windows[0][own].max()), int(windows[1][own].min())])
        runs.append(Disagreement(begin, end, *_worst(apart[own], limit[own])))
    what, columns = f"{one.words} and {other.words}", tuple(dict.fromkeys([*one.columns, *other.columns]))
    names, found = (one.words, other.words), tuple(_joined(runs))
    return CrossCheck(what, names, columns, *units, curves[0], curves[1], found)


def _apart(time_s: Floats, gone: Floats, ways: tuple[_Way, _Way], first: Rows, last: Rows) -> tuple[Floats, Floats]:
    """Return how much the difference of two ways (N,) changes over each of K windows, and how much can be explained."""
    spans_s = time_s[last] - time_s[first]
    limit = BEYOND_CHANCE_SPREADS * np.hypot(*(_sigmas_over(way, first, last, spans_s) for way in ways))
    for way in ways:
        limit += way.hop
        if way.rate is not None and way.allowed is not None:
            sums = _added(time_s, way.allowed)
            limit += sums[last] - sums[first]
            limit += np.minimum(way.lag_s, spans_s) * _ranges_within(time_s, way.rate, first, last, way.lag_s)
    return np.abs(gone[last] - gone[first]), limit


def _sigmas_over(way: _Way, first: Rows, last: Rows, spans_s: Floats) -> Floats:
    """Return the uncertainty of differences: for values from both ends, for rates, whose error is constant, overall."""
    sigma: Floats = np.hypot(way.sigma[first], way.sigma[last])
    return sigma if way.rate is None else sigma / np.sqrt(2.0) * spans_s


def _joined(runs: Sequence[Disagreement]) -> Iterator[Disagreement]:
    """Merge runs that touch."""
    run: Disagreement | None = None
    for each in sorted(runs, key=lambda each: each.first):
        if run is None or each.first > run.last:
            if run is not None:
                yield run
            run = each
        else:
            worst = max(run, each, key=lambda one: one.apart / one.allowed)
            run = replace(worst, first=run.first, last=max(run.last, each.last))
    if run is not None:
        yield run


def _windows(time_s: Floats, rows: Rows) -> tuple[Rows, Rows, Rows]:
    """Find windows in which both are always known: the middle, the first and the last row of each."""
    seconds = time_s[rows]
    breaks = np.flatnonzero((np.diff(seconds) > WINDOW_S / 4) | (np.diff(seconds) <= 0)) + 1
    ends = np.concatenate([[0], breaks, [len(rows)]])
    first, last = np.empty((2, len(rows)), np.intp)
    for begun, end in pairwise(ends.tolist()):
        own = seconds[begun:end]
        first[begun:end] = begun + np.searchsorted(own, own - WINDOW_S / 2)
        last[begun:end] = begun + np.searchsorted(own, own + WINDOW_S / 2, side="right") - 1
    whole = seconds[last] - seconds[first] >= WINDOW_S / 2
    return rows[whole], rows[first[whole]], rows[last[whole]]
