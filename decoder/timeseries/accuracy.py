"""Accuracy: flight data compared with the truth, by the thesis's measure, stricter ones, and regulators' limits.

The thesis reports 100 minus the mean error in percent of the true value. Its published averages are better than its own
rows, so they are presumably means of signed errors, in which too high and too low cancel. Both means are computed here,
also in percent of full scale and in units. On a scale that wraps, errors go the short way round. Truth at other times
than the frames is interpolated linearly, never extrapolated.

For some parameters, what regulators ask of flight data recorders is given as a range (such as 100 to 700 ft, by
altitude): within its narrow end a needle passes, beyond its wide end it fails, in between it depends on the
installation. It passes or fails by 95 % of its values, because a truth at 1 Hz is itself interpolated. Percentages are
of the value for airspeed and vertical speed, of full scale for the others; a value need not be finer than the
required resolution, 1 kt or 250 fpm. A camera reads the aircraft's own instruments. Where these are the source, 14 CFR
91 lets the recording add at most half of the error allowed for an installed system, except for altimeters: that half
has its own table.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from enum import StrEnum

import numpy as np

from decoder.instruments.reading import Status
from decoder.panel.arrays import Floats
from decoder.panel.errors import AccuracyError, UnitError
from decoder.panel.parameters import WORDS
from decoder.panel.scale import shortest
from decoder.panel.thresholds import CONFIDENCE_SIGMAS
from decoder.panel.units import converted, engine_stem_of, stem_of
from decoder.timeseries.tables import Described, FlightTable, Table
from decoder.timeseries.thresholds import NEEDED_PART

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

    Rows are matched by `frame` if both tables have that column, otherwise by `time_s`. With an `offset_s`, which is
    added to the truth's times, they are always matched by time.

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

    Between two rows of the truth, numbers are interpolated linearly, and states and texts keep the last value.

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
    if "frame" in truth.columns:  # a row for each frame: an empty field is a lost value, and is not interpolated
        interpolated[np.interp(wanted_s, known_s, usable.astype(float)) < 1] = np.nan
    return interpolated


def _needle_accuracy(name: str, flight: Table, truth: Floats, described: Described) -> NeedleAccuracy:
    value, sigma = flight.numbers(name, described.written), flight.numbers(f"{name}_sigma")
    if not np.isfinite(sigma).any():  # for a state or a text, which is right or wrong
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


FAA = "14 CFR 135 App. C"
AIRPLANES = "14 CFR 91 App. E"
RECORDING = "14 CFR 91 App. E, note 1"
EASA = "EASA AMC5 CAT.IDE.A.190"
SOURCES: dict[str, str] = {
    FAA: "14 CFR Part 135 Appendix C, helicopter flight recorder specifications",
    AIRPLANES: "14 CFR Part 91 Appendix E, airplane flight recorder specifications, accuracy of the installed system",
    RECORDING: "the same, note 1: what the recording may add where aircraft instruments are the source, half of that",
    EASA: "EASA Easy Access Rules for Air Operations, AMC5 CAT.IDE.A.190, flight data recorder performance, aeroplanes",
}


KINDS: dict[str, tuple[str, ...]] = {
    "airspeed": WORDS["airspeed"],
    "altitude": (*WORDS["altitude"], "pressure_altitude"),
    "heading": WORDS["heading"],
    "vertical speed": (*WORDS["vertical speed"], "altitude_rate"),
    "attitude": (*WORDS["pitch"], *WORDS["roll"]),
    "power": ("n1", "n2", "ng", "np", "nr", "torque", "trq", "rotor_rpm", "power_turbine"),
}


class Verdict(StrEnum):
    """Whether a needle is as accurate as a recorder has to be."""

    PASS = "pass"  # noqa: S105 - no password
    """Within the narrow end of the limit."""
    DEPENDS = "depends"
    """Within the wide end only."""
    FAIL = "fail"


@dataclass(frozen=True, slots=True)
class Tolerance:
    """How far a value may be off: the largest of the given limits."""

    absolute: float = 0.0
    unit: str = ""
    of_value: float = 0.0
    of_scale: float = 0.0

    def sizes(self, truth: Floats, described: Described) -> Floats:
        """Return the limit at each true value, in the needle's unit.

        Raises
        ------
        UnitError
            If the needle's unit is of another kind.
        """
        absolute = 0.0
        if self.absolute:
            ends = converted(np.array([0.0, self.absolute]), self.unit, described.unit)
            absolute = float(ends[1] - ends[0])
        fixed = max(absolute, self.of_scale * (described.full_scale or 0.0))
        return np.maximum(fixed, self.of_value * np.abs(truth))


@dataclass(frozen=True, slots=True)
class Limit:
    """What one table requires of one kind of parameter; `words` is its wording."""

    source: str
    kind: str
    words: str
    narrow: Tolerance
    wide: Tolerance


def _limit(source: str, kind: str, words: str, narrow: Tolerance, wide: Tolerance | None = None) -> Limit:
    return Limit(source, kind, words, narrow, wide or narrow)


LIMITS: tuple[Limit, ...] = (
    _limit(FAA, "airspeed", "5 % or 10 kt", Tolerance(10, "kt", of_value=0.05)),
    _limit(FAA, "altitude", "100 to 700 ft", Tolerance(100, "ft"), Tolerance(700, "ft")),
    _limit(FAA, "heading", "5 deg", Tolerance(5, "deg")),
    _limit(FAA, "vertical speed", "10 % or 250 fpm", Tolerance(250, "fpm", of_value=0.10)),
    _limit(FAA, "attitude", "2 deg", Tolerance(2, "deg")),
    _limit(FAA, "power", "5 %", Tolerance(of_scale=0.05)),
    _limit(AIRPLANES, "airspeed", "5 % or 10 kt", Tolerance(10, "kt", of_value=0.05)),
    _limit(AIRPLANES, "altitude", "100 to 700 ft", Tolerance(100, "ft"), Tolerance(700, "ft")),
    _limit(AIRPLANES, "heading", "5 deg", Tolerance(5, "deg")),
    _limit(AIRPLANES, "vertical speed", "10 % or 250 fpm", Tolerance(250, "fpm", of_value=0.10)),
    _limit(AIRPLANES, "attitude", "2 deg", Tolerance(2, "deg")),
    _limit(AIRPLANES, "power", "5 %", Tolerance(of_scale=0.05)),
    _limit(RECORDING, "airspeed", "2.5 % or 5 kt", Tolerance(5, "kt", of_value=0.025)),
    _limit(RECORDING, "heading", "2.5 deg", Tolerance(2.5, "deg")),
    _limit(RECORDING, "vertical speed", "5 % or 125 fpm", Tolerance(125, "fpm", of_value=0.05)),
    _limit(RECORDING, "attitude", "1 deg", Tolerance(1, "deg")),
    _limit(RECORDING, "power", "2.5 %", Tolerance(of_scale=0.025)),
    _limit(EASA, "airspeed", "3 to 5 %", Tolerance(1, "kt", of_value=0.03), Tolerance(1, "kt", of_value=0.05)),
    _limit(EASA, "altitude", "100 to 700 ft", Tolerance(100, "ft"), Tolerance(700, "ft")),
    _limit(EASA, "heading", "2 deg", Tolerance(2, "deg")),
    _limit(EASA, "attitude", "2 deg", Tolerance(2, "deg")),
    _limit(EASA, "power", "2 %", Tolerance(of_scale=0.02)),
)


@dataclass(frozen=True, slots=True)
class Judged:
    """One needle compared with one limit.

    Attributes
    ----------
    within, within_wide
        Parts of its values within the narrow and the wide end, 0 to 1.
    worst
        The largest error, in its unit.
    """

    needle: str
    unit: str
    kind: str
    limit: str
    source: str
    values: int
    within: float
    within_wide: float
    worst: float
    verdict: Verdict


def kind_of(name: str) -> str | None:
    """Return which kind of parameter a needle is by its name; None if that is unknown."""
    stems = {stem_of(name), engine_stem_of(name)[0]}
    return next((kind for kind, its in KINDS.items() if stems & set(its)), None)


def judged(flight: FlightTable, truth: Table, *, offset_s: float | None = None) -> list[Judged]:
    """Compare every needle in both tables with every limit for its kind.

    Raises
    ------
    AccuracyError
        If rows cannot be matched.
    """
    results = []
    for name in flight.names:
        described, kind = flight.described(name), kind_of(name)
        if name not in truth.columns or kind is None:
            continue
        true = truth_at(flight.table, truth, name, described, offset_s)
        error = np.abs(shortest(flight.table.numbers(name, described.written) - true, described.wraps))
        known = np.isfinite(error)
        if known.any():
            results += _against(
                name, described, [limit for limit in LIMITS if limit.kind == kind], true[known], error[known]
            )
    return results


def _against(name: str, described: Described, limits: Sequence[Limit], true: Floats, error: Floats) -> list[Judged]:
    found = []
    for limit in limits:
        try:
            within = float((error <= limit.narrow.sizes(true, described)).mean())
            within_wide = float((error <= limit.wide.sizes(true, described)).mean())
        except UnitError:
            continue  # its unit contradicts its name
        if not (limit.narrow.absolute or limit.narrow.of_value or described.full_scale):
            continue
        found.append(
            Judged(
                needle=name,
                unit=described.unit,
                kind=limit.kind,
                limit=limit.words,
                source=limit.source,
                values=len(error),
                within=within,
                within_wide=within_wide,
                worst=float(error.max()),
                verdict=_verdict(within, within_wide),
            )
        )
    return found


def _verdict(within: float, within_wide: float) -> Verdict:
    if within >= NEEDED_PART:
        return Verdict.PASS
    return Verdict.DEPENDS if within_wide >= NEEDED_PART else Verdict.FAIL


def sources_of(results: Sequence[Judged]) -> Mapping[str, str]:
    """List the full names of the tables used."""
    return {result.source: SOURCES[result.source] for result in results}
