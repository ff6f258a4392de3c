"""Accuracy: flight data held against the truth, by the thesis's measure and by harder ones.

The thesis reports 100 minus the mean error in percent of the true value; its published averages are finer than its
own rows, so they are presumably means of signed errors, in which too high and too low cancel. Here are both, and
percent of full scale and units beside them. On a scale that wraps errors go the short way round. Truth at other times
than the frames is interpolated linearly, never extrapolated.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from decoder.instruments.reading import Status
from decoder.panel.arrays import Floats
from decoder.panel.errors import AccuracyError
from decoder.panel.scale import shortest
from decoder.timeseries.tables import Described, FlightTable, Table
from decoder.timeseries.thresholds import CONFIDENCE_SIGMAS

ALL_VALUED = "all"


@dataclass(frozen=True, slots=True)
class Errors:
    """The errors of one needle over some of its frames.

    Percent of the reading leaves out frames whose truth is 0; percent of full scale is None where full scale is
    unknown. `within_95` is the part of the frames whose error is within 1.96 sigma.
    """

    frames: int
    mean_abs: float
    mean_signed: float
    max_abs: float
    mean_abs_pct: float | None
    mean_signed_pct: float | None
    max_abs_pct: float | None
    mean_abs_pct_fs: float | None
    max_abs_pct_fs: float | None
    within_95: float


@dataclass(frozen=True, slots=True)
class NeedleAccuracy:
    """One needle's errors by status, with `all` for every frame that has a value."""

    needle: str
    unit: str
    full_scale: float | None
    frames_compared: int
    by_status: Mapping[str, Errors]


def compare(flight: FlightTable, truth: Table, *, offset_s: float | None = None) -> list[NeedleAccuracy]:
    """Compare every needle that both tables have, in the flight data's order.

    Rows are matched by `frame` where both tables have that column, otherwise by `time_s`. With an `offset_s` they are
    matched by time in any case: it is what the truth's clock lacks to the flight data's.

    Raises
    ------
    AccuracyError
        If the tables share no needle or no row.
    """
    shared = [name for name in flight.names if name in truth.columns]
    if not shared:
        raise AccuracyError(f"{truth.path}: has none of the needles {', '.join(flight.names)} as a column")
    results = []
    for name in shared:
        known = flight.described(name)
        true = truth_at(flight.table, truth, name, known, offset_s)
        results.append(_needle_accuracy(name, flight.table, true, known))
    if not any(result.frames_compared for result in results):
        raise AccuracyError(f"{truth.path}: none of its rows belongs to a frame of {flight.table.path}")
    return results


def truth_at(flight: Table, truth: Table, name: str, described: Described, offset_s: float | None = None) -> Floats:
    """Match the truth to every row of the flight data, NaN where there is none; see `compare`.

    Between two rows of the truth lies a line; of what is written it is the value that was last.

    Raises
    ------
    AccuracyError
        If rows cannot be matched.
    """
    values, wraps = truth.numbers(name, described.written), described.wraps
    if offset_s is None and "frame" in flight.columns and "frame" in truth.columns:
        by_frame = dict(zip(truth.numbers("frame").tolist(), values.tolist(), strict=True))
        return np.array([by_frame.get(frame, np.nan) for frame in flight.numbers("frame").tolist()])
    if "time_s" not in truth.columns:
        raise AccuracyError(f"{truth.path}: has neither a `frame` nor a `time_s` column to match rows by")
    known_s = truth.numbers("time_s")
    usable = np.isfinite(known_s) & np.isfinite(values)
    if not usable.any() or np.any(np.diff(known_s[usable]) <= 0):
        raise AccuracyError(f"{truth.path}: its `time_s` must rise from row to row")
    wanted_s = flight.numbers("time_s") - (offset_s or 0.0)
    if described.written is not None:
        last = np.searchsorted(known_s[usable], wanted_s, side="right") - 1
        there = (last >= 0) & (wanted_s <= known_s[usable][-1])
        return np.where(there, values[usable][last], np.nan)
    known = values[usable] if wraps is None else np.unwrap(values[usable], period=wraps)
    interpolated: Floats = np.interp(wanted_s, known_s[usable], known, left=np.nan, right=np.nan)
    if "frame" in truth.columns:  # a row for each frame: an empty field is a value that is lost, and not bridged
        interpolated[np.interp(wanted_s, known_s, usable.astype(float)) < 1] = np.nan
    return interpolated


def _needle_accuracy(name: str, flight: Table, truth: Floats, described: Described) -> NeedleAccuracy:
    value, sigma = flight.numbers(name, described.written), flight.numbers(f"{name}_sigma")
    if not np.isfinite(sigma).any():  # of a state or a text, which is right or wrong
        sigma = np.zeros_like(value)
    status = np.array(flight.columns[f"{name}_status"])
    full_scale = described.full_scale
    error = shortest(value - truth, described.wraps)
    compared = np.isfinite(truth)
    groups = {ALL_VALUED: compared & np.isfinite(value)}
    groups |= {kind.value: groups[ALL_VALUED] & (status == kind.value) for kind in Status}
    return NeedleAccuracy(
        needle=name,
        unit=described.unit,
        full_scale=full_scale,
        frames_compared=int(compared.sum()),
        by_status={
            kind: _errors(error[where], truth[where], sigma[where], full_scale)
            for kind, where in groups.items()
            if where.any()
        },
    )


def _errors(error: Floats, truth: Floats, sigma: Floats, full_scale: float | None) -> Errors:
    nonzero = truth != 0
    percent = error[nonzero] / truth[nonzero] * 100.0 if nonzero.any() else None
    of_scale = error / full_scale * 100.0 if full_scale else None
    return Errors(
        frames=len(error),
        mean_abs=float(np.abs(error).mean()),
        mean_signed=float(error.mean()),
        max_abs=float(np.abs(error).max()),
        mean_abs_pct=None if percent is None else float(np.abs(percent).mean()),
        mean_signed_pct=None if percent is None else float(percent.mean()),
        max_abs_pct=None if percent is None else float(np.abs(percent).max()),
        mean_abs_pct_fs=None if of_scale is None else float(np.abs(of_scale).mean()),
        max_abs_pct_fs=None if of_scale is None else float(np.abs(of_scale).max()),
        within_95=float((np.abs(error) <= CONFIDENCE_SIGMAS * sigma).mean()),
    )
