"""How well each gauge of a panel is drawn and read in a flight, in words: what should be redrawn, and why."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from decoder.imaging.thresholds import HALF
from decoder.instruments.reading import Status
from decoder.learning.budget import Budget, Cause
from decoder.panel.scale import Combination, Scale, shortest
from decoder.panel.thresholds import CONFIDENCE_SIGMAS
from decoder.timeseries.flight_data import CODE, FlightData, NeedleSeries, PanelSigmaDeg
from decoder.timeseries.thresholds import NEEDED_PART, SMALLEST_PART

WELL = "drawn well"
SEEN = "it is hard to see there"
CLEAR_NEEDLE = "on a picture in which the moving part has nothing printed behind it"
PLAINLY = "on a picture that shows it plainly"
MOSTLY = {
    Cause.DRAWN: "of how it is drawn: draw its centre, radius and marks more precisely with `decode setup`",
    Cause.PIVOT: "its pivot is uncertain: draw its centre more precisely with `decode setup`",
    Cause.VIEWED: "it is seen from aside: draw its `rim`, or the panel's reference points, with `decode setup`",
    Cause.PLACED: "its dial is not found where the anchors put it: box an anchor nearer to it with `decode setup`",
}


def doubted(data: FlightData, allowed_sigma_deg: PanelSigmaDeg) -> tuple[FlightData, Mapping[str, Sequence[str]]]:
    """Downgrade values that are too uncertain because of their gauge's drawing or position, or their frame; say why.

    A whole needle matched there, but its scale, its pivot or its dial may be off, or it was hard to see. One wrong
    value does more harm than ten that are marked as doubtful. Mere allowances do not count. The reasons are by gauge.
    """
    found, doubts = [], defaultdict(list)
    for series in data.series:
        quantity, doubtful = series.quantity, series.has(Status.READ)
        if quantity.is_measured and quantity.name not in data.combined:
            allowed_deg = allowed_sigma_deg(quantity.name, series.angle_deg)
            scale = Scale.of(quantity.marks, quantity.wraps)
            allowed = scale.steepest_at(series.angle_deg, allowed_deg) * allowed_deg
            parts = np.sqrt(np.maximum(series.sigma**2 - allowed**2, 0.0)) / quantity.full_scale
            doubtful &= parts > SMALLEST_PART
            if doubtful.any():
                worst = int(np.where(doubtful, parts, 0.0).argmax())
                doubts[quantity.gauge].append(
                    f"{quantity.name} is `edge`, not `read`, in {doubtful.sum()} frames: it may be off by"
                    f" {CONFIDENCE_SIGMAS * parts[worst]:.0%} of full scale, mostly because"
                    f" {_mostly(data.budgets.get(quantity.name), series, worst)}"
                )
                status = np.where(doubtful, CODE[Status.EDGE], series.status).astype(np.uint8)
                series = replace(series, status=status)  # noqa: PLW2901
        found.append(series)
    return replace(data, series=tuple(found)), doubts


def _mostly(budget: Budget | None, series: NeedleSeries, row: int) -> str:
    """Name the largest part of a value's uncertainty, apart from mere allowances."""
    sigmas = {} if budget is None else budget.at(float(series.value[row]))
    own_frame = float(series.sigma[row]) ** 2 - sum(sigma**2 for sigma in sigmas.values())
    causes = [(sigmas[cause] ** 2, words) for cause, words in MOSTLY.items() if cause in sigmas]
    return max([(own_frame, SEEN), *causes])[1]


def gauge_health(data: FlightData, fitted: Mapping[str, Sequence[str]]) -> dict[str, tuple[str, ...]]:
    """Collect the remarks on each gauge; empty for one that is drawn and read well.

    Parameters
    ----------
    fitted
        For each gauge, what the fit to the flight found.
    """
    found = {series.quantity.gauge: list(fitted.get(series.quantity.gauge, ())) for series in data.series}
    shown = len(data.frame) - len(data.missing_frames)
    for series in data.series:
        if series.quantity.name not in data.combined:
            found[series.quantity.gauge] += _of_series(series, shown)
    for combination in data.combinations:
        found[combination.quantity.gauge] += _contradictions(data, combination)
    return {gauge: tuple(findings) for gauge, findings in found.items()}


def health_line(findings: Sequence[str]) -> str:
    """Join the remarks in one line."""
    return "; ".join(findings) or WELL


def _of_series(series: NeedleSeries, shown: int) -> Iterator[str]:
    """Say whether one needle is read at all, and whether it could be learned from the flight."""
    name, is_seen = series.quantity.name, _is_seen(series)
    seen = int(is_seen.sum())
    if seen < HALF * shown:
        where = CLEAR_NEEDLE if series.quantity.written is None else PLAINLY
        yield f"{name} is read in {seen} of {shown} frames: look at its gauge with `decode setup`, or draw it {where}"
    elif series.quantity.written is None and seen > 1 and not _moves(series, is_seen):
        yield (
            f"{name} hardly moves: the flight says little about its scale and its centre, and not that it is an"
            " instrument"
        )


def _is_seen(series: NeedleSeries) -> NDArray[np.bool_]:
    return series.has(Status.READ, Status.EDGE, Status.HIDDEN)


def _moves(series: NeedleSeries, is_seen: NDArray[np.bool_]) -> bool:
    """Whether more values than chance explains lie further from most than each may be off, and than matters."""
    values, wraps = series.value[is_seen], series.quantity.wraps
    off = shortest(values - values[0], wraps)
    beside = np.abs(shortest(off - np.median(off), wraps))
    least = max(CONFIDENCE_SIGMAS * float(np.median(series.sigma[is_seen])), SMALLEST_PART * series.quantity.full_scale)
    return bool((beside > least).mean() > 1.0 - NEEDED_PART)


def _contradictions(data: FlightData, combination: Combination) -> Iterator[str]:
    """Report pointers that count each other's turns but contradict each other; each may then be an `edge`."""
    (whole,) = (series for series in data.series if series.quantity.name == combination.quantity.name)
    parts = [series for series in data.series if series.quantity.name in combination.parts]
    apart = ~_is_seen(whole) & np.all([part.has(Status.READ, Status.EDGE) for part in parts], axis=0)
    count, name = int(apart.sum()), combination.quantity.name
    if count:
        yield (
            f"its pointers contradict each other, or agree by chance, in {count} frames, where {name} is not read: has"
            " each of them its own name and marks?"
        )
