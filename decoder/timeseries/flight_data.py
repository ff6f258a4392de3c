"""Flight data: the readings of a flight over time, one column for each needle, and its alignments.

Columns are compact arrays, so that a long flight takes only a few dozen bytes per value.
"""

from __future__ import annotations

import math
from array import array
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import partial
from itertools import groupby

import numpy as np
from numpy.typing import NDArray

from decoder.imaging.alignment import Alignment, Point
from decoder.instruments.reading import FrameReadings, Status
from decoder.learning.budget import Budget
from decoder.panel.arrays import Floats
from decoder.panel.lens import Lens
from decoder.panel.panel import Panel
from decoder.panel.parameters import Column
from decoder.panel.scale import FULL_CIRCLE_DEG, Combination, Quantity, Scale, in_turn, shortest
from decoder.timeseries.flight_part import FlightPart
from decoder.timeseries.gps import GpsData
from flight_file.session import UNKNOWN

Kind = tuple[tuple[str, ...], Lens | None]
_ELEMENTS = 9

STATUSES = tuple(Status)
CODE = {status: code for code, status in enumerate(STATUSES)}
NOWHERE = float("nan")

PanelSigmaDeg = Callable[[str, Floats], Floats]
"""Tells what the readings of a needle, by its name, at (N,) angles are uncertain by beyond their own frames: (N,)."""


class AlignmentSeries(Sequence[Alignment | None]):
    """Where the panel lay in each frame; None for a frame that could not be read at all.

    Items are made on access, without their covariance.
    """

    def __init__(self) -> None:
        self._elements, self._score, self._kind = array("d"), array("f"), array("I")
        self._shifts_px = array("f")
        self._kinds: dict[Kind, int] = {}
        self._gauges = 0

    def add(self, alignment: Alignment, shifts_px: Sequence[Point] = ()) -> None:
        """Add a frame's alignment, and how far each gauge's needles are from there: for all frames or for none."""
        self._gauges = len(shifts_px)
        self._append(alignment.elements, alignment.score, alignment.failed, alignment.lens)
        self._shifts_px.extend(coordinate for shift in shifts_px for coordinate in shift)

    def add_missing(self, failed: Sequence[str]) -> None:
        """Add a frame without one; `failed` are the features that were searched for and did not match."""
        self._append((math.nan,) * _ELEMENTS, math.nan, tuple(failed), None)
        if self._shifts_px:
            self._shifts_px.extend([math.nan] * 2 * self._gauges)

    def __len__(self) -> int:
        return len(self._score)

    def __getitem__(self, index: int) -> Alignment | None:  # type: ignore[override]  # slices are not supported
        if math.isnan(self._score[index]):
            return None
        index %= len(self)
        failed, lens = list(self._kinds)[self._kind[index]]
        elements = tuple(self._elements[index * _ELEMENTS : (index + 1) * _ELEMENTS])
        return Alignment(elements, self._score[index], failed, lens)

    def shift_px(self, index: int, gauge: int) -> Point:
        """Return how far a gauge's needles are from where a frame's alignment puts them, panel picture pixels."""
        if not self._shifts_px:
            return 0.0, 0.0
        lost_first = len(self) * 2 * self._gauges - len(self._shifts_px)
        at = (index % len(self)) * 2 * self._gauges + 2 * gauge - lost_first
        return self._shifts_px[at], self._shifts_px[at + 1]

    def failed(self, index: int) -> tuple[str, ...]:
        """List the features that did not match in a frame."""
        return list(self._kinds)[self._kind[index]][0]

    def failures(self) -> dict[str, int]:
        """Count the frames in which each feature did not match, for those that ever failed."""
        frames = np.bincount(np.array(self._kind, np.int64), minlength=len(self._kinds))
        counts: dict[str, int] = {}
        for (failed, _), count in zip(self._kinds, frames.tolist(), strict=True):
            for name in failed:
                counts[name] = counts.get(name, 0) + count
        return dict(sorted(counts.items()))

    def _append(self, elements: Sequence[float], score: float, failed: tuple[str, ...], lens: Lens | None) -> None:
        self._elements.extend(elements)
        self._score.append(score)
        self._kind.append(self._kinds.setdefault((failed, lens), len(self._kinds)))


@dataclass(frozen=True, slots=True)
class NeedleSeries:
    """One needle over the flight; all arrays (N,), NaN where there is nothing.

    Attributes
    ----------
    status
        uint8, index into `STATUSES`.
    value, sigma
        In the quantity's unit.
    score
        NCC of the match.
    angle_deg
        Where the best match points, even if it was refused.
    """

    quantity: Quantity
    status: NDArray[np.uint8]
    value: Floats
    sigma: Floats
    score: Floats
    angle_deg: Floats

    def angles_apart_deg(self, one: int | slice, other: int | slice) -> Floats:
        """Return how far the needle turned from other frames to these, the short way if it goes all the way round."""
        differences = np.asarray(self.angle_deg[one] - self.angle_deg[other])
        return shortest(differences, None if self.quantity.wraps is None else FULL_CIRCLE_DEG)

    @property
    def lowest_score(self) -> float | None:
        """The lowest score of any frame in which the panel was found, to four decimals."""
        scored = self.score[np.isfinite(self.score)]
        return round(float(scored.min()), 4) if scored.size else None

    def has(self, *statuses: Status) -> NDArray[np.bool_]:
        """(N,): where the status is one of these."""
        return np.isin(self.status, [CODE[status] for status in statuses])

    def runs(self, status: Status) -> list[tuple[int, int]]:
        """Find the runs of frames with this status in which the panel was found, as `spans`."""
        return spans(self.has(status) & np.isfinite(self.score))


@dataclass(frozen=True, slots=True)
class MissingFrame:
    """A frame that could not be read at all, and why."""

    frame: int
    reason: str


@dataclass(frozen=True, slots=True)
class FlightData:
    """All needles of a flight.

    Attributes
    ----------
    frame
        (N,) int64: sequence numbers.
    time_ns
        (N,) int64: mid-exposure, realtime.
    combinations
        What several needles show together; their series follow those of the needles.
    moved_pivots_px
        By gauge, for those whose needles turn elsewhere than the panel says: (x, y) of the difference.
    alignments
        N: where the panel lay in each frame; empty if that was not recorded.
    warnings
        The shortcomings of the panel, a sentence each.
    health
        For each gauge, remarks on how it is drawn and read, see `decoder.timeseries.health`; empty if all is well.
    part
        Which frames of the flight these are; None if all.
    time_of_day
        Which clock says when frames were taken, from the flight's session.
    gps
        The camera's GPS data at the frames; None if the flight has none.
    columns
        By name, what the panel says of columns besides how they are read.
    budgets
        By name, for measured quantities, the parts of sigma by cause.
    """

    frame: NDArray[np.int64]
    time_ns: NDArray[np.int64]
    series: tuple[NeedleSeries, ...]
    missing_frames: tuple[MissingFrame, ...]
    combinations: tuple[Combination, ...] = ()
    moved_pivots_px: Mapping[str, tuple[float, float]] = field(default_factory=dict)
    alignments: AlignmentSeries = field(default_factory=AlignmentSeries)
    warnings: tuple[str, ...] = ()
    health: Mapping[str, tuple[str, ...]] = field(default_factory=dict)
    part: FlightPart | None = None
    time_of_day: str = ""
    gps: GpsData | None = None
    columns: Mapping[str, Column] = field(default_factory=dict)
    budgets: Mapping[str, Budget] = field(default_factory=dict)

    @property
    def knows_time_of_day(self) -> bool:
        """Whether times are absolute, not only differences."""
        return self.time_of_day != UNKNOWN

    @property
    def combined(self) -> frozenset[str]:
        """The names of what several needles show together."""
        return frozenset(combination.quantity.name for combination in self.combinations)

    @property
    def time_s(self) -> Floats:
        """(N,): seconds since the flight's first frame."""
        if not self.time_ns.size:
            return np.empty(0)
        return (self.time_ns - (self.time_ns[0] if self.part is None else self.part.began_ns)) / 1e9


def lost_runs(data: FlightData) -> list[tuple[int, int, str]]:
    """Group frames that could not be read into runs (first row, last row, reason) with the same reason.

    A score in the reason is that of the run's first frame.
    """
    row_of = {int(frame): row for row, frame in enumerate(data.frame)}
    lost = [(row_of[missing.frame], missing.reason) for missing in data.missing_frames]
    runs = groupby(enumerate(lost), key=lambda item: (item[1][0] - item[0], item[1][1].partition(" (")[0]))
    found = []
    for _, run in runs:
        (first, reason), *others = (each for _, each in run)
        found.append((first, first + len(others), reason))
    return found


class _Column:
    """The growing arrays behind one series."""

    def __init__(self) -> None:
        self.status, self.angle_deg, self.sigma_deg, self.score = array("B"), array("d"), array("d"), array("d")

    def append(self, status: Status, angle_deg: float, sigma_deg: float, score: float) -> None:
        self.status.append(CODE[status])
        self.angle_deg.append(angle_deg)
        self.sigma_deg.append(sigma_deg)
        self.score.append(score)


class FlightDataBuilder:
    """Collects readings frame by frame."""

    def __init__(self, panel: Panel) -> None:
        self._frame, self._time_ns = array("q"), array("q")
        self._combinations = panel.combinations
        self._quantities = [quantity for gauge in panel.gauges for quantity in gauge.quantities]
        together = [combination.quantity for combination in self._combinations]
        self._columns = {quantity.name: _Column() for quantity in [*self._quantities, *together]}
        self._missing: list[MissingFrame] = []
        self._alignments = AlignmentSeries()

    def add(self, frame: int, time_ns: int, readings: FrameReadings) -> None:
        """Add a frame that was read."""
        self._frame.append(frame)
        self._time_ns.append(time_ns)
        self._alignments.add(readings.alignment, readings.dial_shifts_px)
        for name, column in self._columns.items():
            reading = readings.readings[name]
            column.append(reading.status, reading.angle_deg, reading.sigma_deg, reading.score)

    def add_missing(self, frame: int, time_ns: int, reason: str, failed: Sequence[str] = ()) -> None:
        """Add a frame that could not be read at all; `failed` are the features of the panel that did not match."""
        self._frame.append(frame)
        self._time_ns.append(time_ns)
        self._missing.append(MissingFrame(frame, reason))
        self._alignments.add_missing(failed)
        for column in self._columns.values():
            column.append(Status.MISSING, NOWHERE, NOWHERE, NOWHERE)

    def build(self, panel_sigma_deg: PanelSigmaDeg) -> FlightData:
        """Make flight data from the frames so far."""
        quantities = {quantity.name: quantity for quantity in self._quantities}
        sigmas_deg: dict[str, Callable[[Floats], Floats]] = {
            name: partial(panel_sigma_deg, name) for name in quantities
        }
        for each in self._combinations:
            quantities[each.quantity.name] = each.quantity
            sigmas_deg[each.quantity.name] = _of_finest(each.quantity, quantities[each.parts[0]], panel_sigma_deg)
        series = tuple(
            _series(quantity, self._columns[name], sigmas_deg[name]) for name, quantity in quantities.items()
        )
        frame, time_ns = np.array(self._frame), np.array(self._time_ns)
        return FlightData(frame, time_ns, series, tuple(self._missing), self._combinations, alignments=self._alignments)


def _of_finest(together: Quantity, finest: Quantity, panel_sigma_deg: PanelSigmaDeg) -> Callable[[Floats], Floats]:
    """Return a function for a combined value's sigma, (N,), by its angle on its own scale: its finest pointer's."""
    own, scale = (Scale.of(each.marks, each.wraps) for each in (together, finest))

    def sigma_deg(angles_deg: Floats) -> Floats:
        there_deg = scale.angles_of(own.values_at(angles_deg))
        slopes = scale.slopes_at(there_deg) / own.slopes_at(angles_deg)
        sigma: Floats = np.abs(slopes) * panel_sigma_deg(finest.name, there_deg)
        return sigma

    return sigma_deg


def _series(quantity: Quantity, column: _Column, panel_sigma_deg: Callable[[Floats], Floats]) -> NeedleSeries:
    scale = Scale.of(quantity.marks, quantity.wraps)
    status, angle_deg = np.array(column.status), np.array(column.angle_deg)
    valued, value = status != CODE[Status.MISSING], scale.values_at(angle_deg)
    if quantity.wraps is not None:
        value = in_turn(value, quantity.wraps, quantity.lowest)
    sigma_deg = np.hypot(np.array(column.sigma_deg), panel_sigma_deg(angle_deg))
    return NeedleSeries(
        quantity=quantity,
        status=status,
        value=np.where(valued, value, NOWHERE),
        sigma=np.where(valued, scale.steepest_at(angle_deg, sigma_deg) * sigma_deg, NOWHERE),
        score=np.array(column.score),
        angle_deg=angle_deg,
    )


def status_counts(series: NeedleSeries) -> dict[str, int]:
    """Count the frames with each status, including those that do not occur."""
    return {status.value: int((series.status == CODE[status]).sum()) for status in STATUSES}


def spans(where: Sequence[bool] | NDArray[np.bool_]) -> list[tuple[int, int]]:
    """Find the runs of true values as (first, last) index pairs, both included."""
    edges = np.flatnonzero(np.diff(np.concatenate([[False], np.asarray(where, bool), [False]]).astype(np.int8)))
    return [(int(first), int(end) - 1) for first, end in edges.reshape(-1, 2)]
