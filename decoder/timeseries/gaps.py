"""Gaps: values for a needle in frames in which it could not be read (thesis 3.3).

A flagged reading, one whose score stayed below the threshold, is replaced by linear interpolation between the nearest
frames that were read, never beyond the first or the last of them. Frames in which the panel itself was not found stay
missing. The uncertainty grows towards the middle of the gap. It consists of how far the needle strays from such lines
over equally long stretches elsewhere in the flight, and of the change that the speeds before and after do not explain;
it is at most that of a guess. If the needle may have gone all the way round within the gap, the value is a guess as
well. If the refused match in a frame is a likely one, and continues in the frame before or after, the uncertainty
covers its place too. A needle that was seen in fewer than half of the frames is not interpolated: where it stood may
be why it was not seen, and then what was seen does not tell how it moves elsewhere.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from decoder.imaging.thresholds import HALF
from decoder.instruments.reading import Status
from decoder.instruments.thresholds import APART_DEG, FRAMES_TO_LEARN
from decoder.panel.arrays import Floats, Mask, limited
from decoder.panel.scale import Scale, in_turn, shortest
from decoder.panel.thresholds import CONFIDENCE_SIGMAS
from decoder.registration.thresholds import LIKELY_SCORE
from decoder.timeseries.flight_data import CODE, NOWHERE, FlightData, NeedleSeries, spans
from decoder.timeseries.thresholds import MOST_STRETCHED, MOST_TRIED, SHORTER
from flight_file.reader import spread

# Standard deviation of a uniform distribution of width 1: a blind guess.
UNIFORM_SIGMA = 12**-0.5

SEEN_STATUSES = (Status.READ, Status.EDGE, Status.HIDDEN)


def fill_gaps(data: FlightData) -> FlightData:
    """Flag doubtful readings of covered needles and of hands without a common value, and fill what is missing."""
    data = _doubted_together(_with_unsure_turns(_without_lone_turns(_without_chance(data))))
    by_name = {series.quantity.name: series for series in data.series}
    parts = {each.quantity.name: [by_name[part] for part in each.parts] for each in data.combinations}
    checked = {part for combination in data.combinations for part in combination.parts}  # they check each other
    filled = []
    for series in data.series:
        cover = by_name.get(series.quantity.covered_by or "")
        if cover is not None and series.quantity.name not in checked:
            pace_deg = _pace_deg(series, cover)
            series = _without_doubtful(series, (Status.EDGE, Status.HIDDEN), (Status.READ,), pace_deg)  # noqa: PLW2901
            series = _without_doubtful(series, (Status.HIDDEN,), (Status.READ, Status.EDGE), pace_deg)  # noqa: PLW2901
        filled.append(_interpolated(series, data.time_s, never=_contradicted(series, parts)))
    return replace(data, series=tuple(filled))


def _without_chance(data: FlightData) -> FlightData:
    """Refuse combined values whose pointers, where all of them show, contradict each other as often as they agree.

    Then one of them is something else, or has another's name or marks, and where they agree they do so by chance.
    """
    by_name = {series.quantity.name: series for series in data.series}
    for each in data.combinations:
        series, parts = by_name[each.quantity.name], [by_name[part] for part in each.parts]
        shows_all = np.all([part.has(Status.READ, Status.EDGE) for part in parts], axis=0)
        against, agree = (int((shows_all & where).sum()) for where in (series.has(Status.MISSING), _valued(series)))
        if against >= max(agree, FRAMES_TO_LEARN):
            by_name[series.quantity.name] = _as_missing(series, _valued(series))
    return replace(data, series=tuple(by_name.values()))


def _valued(series: NeedleSeries) -> Mask:
    """(N,): where a combined value was read."""
    return series.has(Status.READ, Status.EDGE)


def _without_lone_turns(data: FlightData) -> FlightData:
    """Refuse combined values with a hidden pointer that are whole turns off all frames in which every pointer shows.

    A pointer that is not seen is assumed to lie below another one. If something else hides it, such as a tail that the
    panel does not describe, the value is turns off. Values between such jumps are kept if some frame among them shows
    all pointers. If no frame of the flight does, the coarsest pointer may be drawn wrongly or be print, and so
    contradict the others wherever it shows: then every value without it is refused, since nothing else counts its
    turns.
    """
    by_name = {series.quantity.name: series for series in data.series}
    for each in data.combinations:
        series, parts = by_name[each.quantity.name], [by_name[part] for part in each.parts]
        is_valued = _valued(series)
        shows_all = is_valued & np.all([part.has(Status.READ, Status.EDGE) for part in parts], axis=0)
        turn = parts[0].quantity.wraps
        if turn is None:
            continue
        lone = is_valued & parts[-1].has(Status.HIDDEN)
        if shows_all.any():
            lone = _is_lone(series, data.time_s, np.flatnonzero(is_valued), np.flatnonzero(shows_all), HALF * turn)
        for one in (series, *parts):
            where = lone if one is series else lone & one.has(Status.HIDDEN)
            by_name[one.quantity.name] = _as_missing(one, where)
    return replace(data, series=tuple(by_name.values()))


def _with_unsure_turns(data: FlightData) -> FlightData:
    """Return combined values as `edge` if a coarser hand is too uncertain to count a finer one's turns; add its sigma.

    What was drawn as that hand may be print, which is the same in each frame: it contradicts nothing, and counts
    nothing.
    """
    by_name = {series.quantity.name: series for series in data.series}
    for each in data.combinations:
        parts = [by_name[part] for part in each.parts]
        for finer, coarser in pairwise(parts):
            sigma = coarser.sigma[coarser.has(Status.READ, Status.EDGE)]
            usual = float(np.median(sigma)) if len(sigma) else 0.0
            if CONFIDENCE_SIGMAS * usual > (finer.quantity.wraps or math.inf):
                series = by_name[each.quantity.name]
                unsure = _as_edge(series, series.has(Status.READ))
                by_name[series.quantity.name] = replace(unsure, sigma=np.hypot(series.sigma, usual))
    return replace(data, series=tuple(by_name.values()))


def _is_lone(
    series: NeedleSeries, time_s: Floats, valued: NDArray[np.intp], trusted: NDArray[np.intp], most: float
) -> Mask:
    """(N,): `valued` frames between jumps by more than `most` from the line through `trusted` frames, without these."""
    wraps, time_s = series.quantity.wraps, np.maximum.accumulate(time_s)  # a clock may have been set back
    seen = series.value[trusted] if wraps is None else np.unwrap(series.value[trusted], period=wraps)
    off = series.value[valued] - np.interp(time_s[valued], time_s[trusted], seen)
    jumps = np.abs(shortest(np.diff(off), wraps)) > most
    run = np.concatenate([[0], np.cumsum(jumps)])
    lone = np.zeros(len(series.value), bool)
    lone[valued] = ~np.isin(run, run[np.isin(valued, trusted)])
    return lone


def _as_missing(series: NeedleSeries, where: Mask) -> NeedleSeries:
    return replace(
        series,
        status=np.where(where, CODE[Status.MISSING], series.status).astype(np.uint8),
        value=np.where(where, NOWHERE, series.value),
        sigma=np.where(where, NOWHERE, series.sigma),
    )


def _doubted_together(data: FlightData) -> FlightData:
    """Return hands as `edge` in frames in which they have no common value: any of them may be something else."""
    by_name = {series.quantity.name: series for series in data.series}
    unsure = {
        part: by_name[each.quantity.name].has(Status.MISSING) for each in data.combinations for part in each.parts
    }
    return replace(
        data,
        series=tuple(
            series if (name := series.quantity.name) not in unsure else _as_edge(series, unsure[name])
            for series in data.series
        ),
    )


def _as_edge(series: NeedleSeries, where: Mask) -> NeedleSeries:
    status = np.where(where & series.has(Status.READ), CODE[Status.EDGE], series.status)
    return replace(series, status=status.astype(np.uint8))


def _contradicted(series: NeedleSeries, parts: Mapping[str, Sequence[NeedleSeries]]) -> Mask:
    """(N,): where all pointers of a combined value are visible, and contradict each other."""
    own = parts.get(series.quantity.name, ())
    seen: Mask = np.all([part.has(Status.READ, Status.EDGE) for part in own], axis=0) & bool(own)
    return seen & series.has(Status.MISSING)


def _without_doubtful(
    series: NeedleSeries, doubted: tuple[Status, ...], trusted: tuple[Status, ...], pace_deg: float
) -> NeedleSeries:
    """Keep covered readings only where the needle went under the covering one, or came out from under it.

    A needle under glare elsewhere on the dial looks just like a hidden one, and the edge of glare beside the covering
    needle like a partly visible one. So at each end of a run of doubted frames, the nearest trusted frame must show the
    needle at about the same place as the run. Otherwise it is not known that the needle was covered.
    """
    covered, seen = series.has(*doubted), np.flatnonzero(series.has(*trusted))
    doubtful = np.zeros_like(covered)
    for first, last in spans(covered):
        ends = [
            (at[0], end) for at, end in ((seen[seen < first][-1:], first), (seen[seen > last][:1], last)) if at.size
        ]
        doubtful[first : last + 1] = not ends or any(
            abs(series.angles_apart_deg(at, end)) > 2 * APART_DEG + pace_deg * abs(int(at) - end) for at, end in ends
        )
    return _as_missing(series, doubtful)


def _pace_deg(series: NeedleSeries, cover: NeedleSeries) -> float:
    """Return how far needles on this dial move per frame, degrees: 95 % of steps between readings are shorter."""
    before, after = slice(None, -1), slice(1, None)
    steps = [np.abs(one.angles_apart_deg(after, before))[_in_sequence(one)] for one in (series, cover)]
    together = np.concatenate(steps)
    return float(np.quantile(together, 0.95)) if together.size else 0.0


def _in_sequence(series: NeedleSeries) -> Mask:
    """(N - 1,): where a frame and the next one both show the whole needle."""
    read = series.has(Status.READ)
    return read[1:] & read[:-1]


def _interpolated(series: NeedleSeries, time_s: Floats, *, never: Mask) -> NeedleSeries:
    if series.quantity.written is not None:  # there is nothing between two states
        return series
    known = np.flatnonzero(series.has(*SEEN_STATUSES))
    flagged = np.flatnonzero(series.has(Status.MISSING) & np.isfinite(series.score) & ~never)
    if known.size < flagged.size:
        return series
    if known.size:
        known = known[_rising(time_s[known])]  # a clock that jumps back leaves frames that belong nowhere
        between = (time_s[flagged] >= time_s[known[0]]) & (time_s[flagged] <= time_s[known[-1]])
        flagged = flagged[between & (flagged > known[0]) & (flagged < known[-1])]
    if not known.size or not flagged.size:
        return series
    wraps = series.quantity.wraps
    seen = series.value[known] if wraps is None else np.unwrap(series.value[known], period=wraps)
    status, value, sigma = series.status.copy(), series.value.copy(), series.sigma.copy()
    pinned = np.interp(time_s[flagged], time_s[known], series.sigma[known])
    guess = NOWHERE if series.quantity.goes_on else series.quantity.full_scale * UNIFORM_SIGMA
    doubt = np.hypot(pinned, _bridge_sigma(seen, time_s[known], time_s[flagged]))
    if wraps is not None:
        doubt[_may_have_turned(seen, known, time_s, wraps)[np.searchsorted(known, flagged) - 1]] = NOWHERE
    doubt = np.fmin(doubt, guess)
    told = np.isfinite(doubt)
    flagged, doubt, line = flagged[told], doubt[told], np.interp(time_s[flagged[told]], time_s[known], seen)
    status[flagged] = CODE[Status.INTERPOLATED]
    doubt = np.hypot(doubt, _likely_off(series, flagged, line) / CONFIDENCE_SIGMAS)
    value[flagged] = line if wraps is None else in_turn(line, wraps, series.quantity.lowest)
    sigma[flagged] = doubt
    return replace(series, status=status, value=value, sigma=sigma)


def _likely_off(series: NeedleSeries, flagged: NDArray[np.intp], line: Floats) -> Floats:
    """(M,): how far the refused match of each flagged frame is from the line; 0 if that match is not likely the needle.

    A whole gap may be due to where the needle is, such as a ball that looks different at its stop. Its matches are then
    likely ones from frame to frame, and move no faster than the readings do; matches in glare jump about.
    """
    quantity = series.quantity
    likely = series.score >= LIKELY_SCORE
    farthest_deg = 2 * APART_DEG + _pace_deg(series, series)
    goes_on = np.abs(series.angles_apart_deg(slice(1, None), slice(None, -1))) <= farthest_deg
    goes_on &= likely[1:] & likely[:-1]
    sighted = np.append(goes_on, False) | np.append(False, goes_on)
    there = Scale.of(quantity.marks, quantity.wraps).values_at(series.angle_deg[flagged])
    if quantity.wraps is None and not quantity.goes_on:
        there = limited(there, *quantity.range)
    off = np.abs(shortest(there - line, quantity.wraps))
    return np.where(sighted[flagged], off, 0.0)


def _may_have_turned(values: Floats, known: NDArray[np.intp], time_s: Floats, wraps: float) -> Mask:
    """(N - 1,): where between two known frames it may have moved by more than half a turn, or the other way round.

    Its highest speed is taken from consecutive frames: 95 % of them show less. With too few frames, it may have gone
    round any number of times.
    """
    gaps_s = np.diff(time_s[known])
    follows = np.diff(known) == 1
    if follows.sum() < FRAMES_TO_LEARN:
        return np.ones(len(gaps_s), bool)
    fastest = np.quantile(np.abs(np.diff(values))[follows] / gaps_s[follows], 0.95)
    far: Mask = ~follows & (fastest * gaps_s > HALF * wraps)
    return far


def _rising(time_s: Floats) -> Mask:
    """(N,): where a time is later than all before it."""
    latest = np.maximum.accumulate(time_s)
    return np.concatenate([[True], time_s[1:] > latest[:-1]])


def _bridge_sigma(values: Floats, known_s: Floats, wanted_s: Floats) -> Floats:
    """Estimate the error of the line between known values at `wanted_s`; NaN where it is unknowable.

    Three contributions add up, each largest in the middle of a gap: how far the needle strays from such lines elsewhere
    in the flight; the distance between its ends that the speeds before and after do not explain, moved at an unknown
    moment of the gap; and the bend between these speeds.
    """
    after = np.clip(np.searchsorted(known_s, wanted_s), 1, len(known_s) - 1)
    start_s, length_s = known_s[after - 1], known_s[after] - known_s[after - 1]
    strays = _by_length(length_s, lambda gap_s: _strays(values, known_s, gap_s))
    ends, of_gap = np.unique(after, return_inverse=True)
    gap_s = known_s[ends] - known_s[ends - 1]
    before = np.array([_speed(values, known_s, end - 1, -gap) for end, gap in zip(ends, gap_s, strict=True)])
    behind = np.array([_speed(values, known_s, end, gap) for end, gap in zip(ends, gap_s, strict=True)])
    unexplained = (values[ends] - values[ends - 1] - gap_s * (before + behind) / 2)[of_gap]
    bend = (gap_s * (behind - before) / 2)[of_gap]
    part = (wanted_s - start_s) / length_s
    across = part * (1 - part)
    sigma: Floats = np.sqrt(across * (4 * strays**2 + unexplained**2) + (bend * across) ** 2)
    return sigma


def _by_length(lengths_s: Floats, of_length: Callable[[float], float]) -> Floats:
    """Compute a function of each length, once for all that are nearly equal."""
    steps, which = np.unique(np.round(np.log(lengths_s) / -math.log(SHORTER)), return_inverse=True)
    return np.array([of_length(SHORTER**-step) for step in steps])[which]


def _speed(values: Floats, known_s: Floats, end: int, reach_s: float) -> float:
    """Return how fast the value changed at a known frame, over a stretch as long as the gap; 0 if unknown."""
    other = int(np.searchsorted(known_s, known_s[end] + reach_s / SHORTER, side="left" if reach_s < 0 else "right"))
    other = other if reach_s < 0 else other - 1
    if other == end:
        return 0.0
    return float((values[other] - values[end]) / (known_s[other] - known_s[end]))


def _strays(values: Floats, known_s: Floats, gap_s: float) -> float:
    """Return how far values stray in the middle of a line over a gap of this length; NaN if the flight shows none.

    Every known frame is taken as the start of such a gap, and the known values in it are compared with the line. For a
    gap longer than all stretches of known frames, the longest one is extrapolated.
    """
    starts = np.array(sorted(spread(len(known_s), MOST_TRIED)))
    reach_s = gap_s
    while reach_s > gap_s / MOST_STRETCHED:
        strays = _strays_over(values, known_s, starts, reach_s)
        if strays.size:
            independent = (known_s[-1] - known_s[0]) / reach_s
            most = max(float(np.sqrt(np.mean(strays**2))), float(np.quantile(np.abs(strays), 0.95)) / CONFIDENCE_SIGMAS)
            return most * gap_s / reach_s * math.sqrt((independent + 2) / independent)
        reach_s *= SHORTER
    return math.nan


def _strays_over(values: Floats, known_s: Floats, starts: NDArray[np.intp], reach_s: float) -> Floats:
    """Return how far known values are from the line across stretches of about this length, scaled to their middle."""
    strays = []
    ends = np.searchsorted(known_s, known_s[starts] + reach_s * SHORTER)
    for start, end in zip(starts, ends, strict=True):
        if end == len(known_s) or known_s[end] - known_s[start] > reach_s / SHORTER:
            continue
        inner = slice(start + 1, end)
        part = (known_s[inner] - known_s[start]) / (known_s[end] - known_s[start])
        line = values[start] + part * (values[end] - values[start])
        strays.append((values[inner] - line) / (2 * np.sqrt(part * (1 - part))))
    return np.concatenate(strays) if strays else np.empty(0)
