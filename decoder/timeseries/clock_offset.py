"""The offset between two clocks, at which the truth's curves coincide with the flight data's.

Curves are compared by their correlation, which neither a wrong unit nor a constant error can change. The best offset
within a window is then refined for each needle by least squares, and the needles must agree: their scatter is part of
the uncertainty. Neighbouring residuals are correlated, so they count as fewer than there are.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from decoder.instruments.reading import Status
from decoder.panel.arrays import Floats
from decoder.panel.errors import AccuracyError
from decoder.panel.vocabulary import WINDOW_S
from decoder.registration.thresholds import CLEAR_SCORE
from decoder.timeseries.tables import FlightTable, Table
from decoder.timeseries.thresholds import MAX_COARSE_ROWS, MIN_OVERLAP, MIN_ROWS, STEP_S

PASSES = 12
SEEN = (Status.READ.value, Status.EDGE.value)


@dataclass(frozen=True, slots=True)
class ClockOffset:
    """What has to be added to the truth's times.

    Attributes
    ----------
    offset_s, sigma_s
        With its standard uncertainty.
    correlation
        The mean correlation of the curves at this offset.
    names
        The needles it was estimated from.
    """

    offset_s: float
    sigma_s: float
    correlation: float
    names: tuple[str, ...]


@dataclass(frozen=True, slots=True)
class _Pair:
    """One needle in the flight data and in the truth, each at its own times."""

    name: str
    time_s: Floats
    values: Floats
    true_s: Floats
    true: Floats

    def thinned(self) -> _Pair:
        step = max(1, len(self.time_s) // MAX_COARSE_ROWS)
        return _Pair(self.name, self.time_s[::step], self.values[::step], self.true_s, self.true)

    def truth_at(self, offset_s: float) -> Floats:
        """Interpolate the truth at the flight data's times, NaN beyond its ends."""
        truth: Floats = np.interp(self.time_s - offset_s, self.true_s, self.true, left=np.nan, right=np.nan)
        return truth

    def correlation(self, offset_s: float) -> float:
        """Return the correlation; NaN if too little overlaps or nothing changes."""
        truth = self.truth_at(offset_s)
        both = np.isfinite(truth)
        if both.sum() < max(MIN_ROWS, MIN_OVERLAP * len(truth)):
            return float("nan")
        one, other = self.values[both] - self.values[both].mean(), truth[both] - truth[both].mean()
        size = float(np.sqrt((one @ one) * (other @ other)))
        return float(one @ other) / size if size > 0 else float("nan")


def clock_offset(flight: FlightTable, truth: Table, *, window_s: float = WINDOW_S) -> ClockOffset:
    """Find the offset of the truth's `time_s` from the flight data's, within a window to either side.

    Raises
    ------
    AccuracyError
        If no needle changes alike in both, or several offsets match equally well.
    """
    pairs = _pairs(flight, truth)
    best_s, correlation = _best(pairs, truth, window_s)
    settled = [(pair, fit) for pair in pairs if (fit := _settled(pair, best_s)) is not None]
    if not settled:
        raise AccuracyError(f"{truth.path}: the clocks' offset cannot be settled; give it with --offset SECONDS")
    offsets = np.array([fit[0] for _, fit in settled])
    weights = 1.0 / np.square([fit[1] for _, fit in settled])
    mean_s = float((weights * offsets).sum() / weights.sum())
    scatter = float((weights * (offsets - mean_s) ** 2).sum()) / max(len(settled) - 1, 1)
    sigma_s = float(np.sqrt(max(scatter, 1.0) / weights.sum()))
    return ClockOffset(mean_s, sigma_s, correlation, tuple(pair.name for pair, _ in settled))


def _pairs(flight: FlightTable, truth: Table) -> list[_Pair]:
    """Pair the needles in both, except those that go all the way round, whose turns cannot be counted."""
    time_s, true_s = flight.table.numbers("time_s"), truth.numbers("time_s")
    pairs = []
    for name in flight.names:
        if name not in truth.columns or flight.described(name).wraps is not None:
            continue
        values, true = flight.table.numbers(name), truth.numbers(name)
        seen = np.isin(flight.table.columns[f"{name}_status"], SEEN) & np.isfinite(values)
        known = np.isfinite(true) & np.isfinite(true_s)
        if seen.sum() >= MIN_ROWS and known.any() and not np.any(np.diff(true_s[known]) <= 0):
            pairs.append(_Pair(name, time_s[seen], values[seen], true_s[known], true[known]))
    return pairs


def _best(pairs: Sequence[_Pair], truth: Table, window_s: float) -> tuple[float, float]:
    """Find the offset with the highest mean correlation, to the nearest step."""
    offsets = np.arange(-window_s, window_s + STEP_S / 2, STEP_S)
    thinned = [pair.thinned() for pair in pairs]
    table = np.array([[pair.correlation(offset) for offset in offsets] for pair in thinned])
    if not table.size or not np.isfinite(table).any():
        raise AccuracyError(
            f"{truth.path}: nothing in it overlaps the flight within {window_s:g} s and changes; give --offset SECONDS"
        )
    enough = np.isfinite(table).sum(axis=0) >= max(1, np.isfinite(table).sum(axis=0).max() // 2)
    mean = np.where(enough, np.nanmean(np.where(enough, table, 0.0), axis=0), -1.0)
    best = int(mean.argmax())
    if mean[best] < CLEAR_SCORE:
        raise AccuracyError(
            f"{truth.path}: its curves are nowhere like the flight's within {window_s:g} s (best correlation"
            f" {mean[best]:.2f}); check --map, or give --offset SECONDS"
        )
    if best in (0, len(offsets) - 1):
        raise AccuracyError(
            f"{truth.path}: its curves match best at the end of the window of {window_s:g} s; look further with"
            " --window, or give --offset SECONDS"
        )
    away = np.abs(offsets - offsets[best]) > 10 * STEP_S
    if away.any() and mean[away].max() > mean[best] - (1 - CLEAR_SCORE) / 5:
        other = float(offsets[away][mean[away].argmax()])
        raise AccuracyError(
            f"{truth.path}: offsets of {offsets[best]:+.1f} s and {other:+.1f} s match alike; give --offset SECONDS"
        )
    return float(offsets[best]), float(mean[best])


def _settled(pair: _Pair, offset_s: float) -> tuple[float, float] | None:
    """Return the offset and its sigma for one needle, by Gauss-Newton; None if it does not converge."""
    start_s, sigma_s = offset_s, 0.0
    for _ in range(PASSES):
        step = _step(pair, offset_s)
        if step is None or abs(offset_s + step[0] - start_s) > 10 * STEP_S:
            return None
        offset_s, sigma_s = offset_s + step[0], step[1]
        if abs(step[0]) < 1e-4:  # noqa: PLR2004 - far below the precision of any frame's time
            return offset_s, sigma_s
    return offset_s, max(sigma_s, STEP_S)


def _step(pair: _Pair, offset_s: float) -> tuple[float, float] | None:
    """Take one least-squares step: `values = constant + gain * truth - gain * slope * change of the offset`."""
    truth = pair.truth_at(offset_s)
    reach_s = STEP_S / 4
    slope = (pair.truth_at(offset_s - reach_s) - pair.truth_at(offset_s + reach_s)) / (2 * reach_s)
    both = np.isfinite(truth) & np.isfinite(slope)
    if both.sum() < MIN_ROWS or not np.any(slope[both]):
        return None
    design = np.stack([np.ones(both.sum()), truth[both], -slope[both]], axis=1)
    solution, _, rank, _ = np.linalg.lstsq(design, pair.values[both], rcond=None)
    if rank < design.shape[1] or solution[1] <= 0:
        return None
    residual = pair.values[both] - design @ solution
    alike = _alike(residual)
    freedom = max(both.sum() - design.shape[1], 1)
    variance = float(residual @ residual) / freedom * (1 + alike) / (1 - alike)
    covariance = variance * np.linalg.inv(design.T @ design)
    gain = float(solution[1])
    return float(solution[2]) / gain, max(float(np.sqrt(covariance[2, 2])) / gain, 1e-6)


def _alike(residual: Floats) -> float:
    """Return the correlation of neighbouring residuals, 0 to 0.98."""
    size = float(residual @ residual)
    return min(max(float(residual[1:] @ residual[:-1]) / size, 0.0), 0.98) if size > 0 else 0.0
