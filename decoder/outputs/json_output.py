"""`NAME.json`: the description of the flight data, with their gaps and the reasons for these."""

from __future__ import annotations

import csv
import io
import json
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import IO, Any

import numpy as np

from decoder.instruments.reading import Status
from decoder.learning.budget import Budget
from decoder.outputs.csv_output import moment_text, write_csv
from decoder.panel.arrays import Floats
from decoder.timeseries.cross_checks import CrossCheck, cross_checks
from decoder.timeseries.events import Event, find_events
from decoder.timeseries.flight_data import FlightData, NeedleSeries, lost_runs, spans, status_counts
from decoder.timeseries.gps import GpsData
from decoder.timeseries.health import health_line
from decoder.timeseries.outliers import Outlier, find_outliers
from decoder.timeseries.tables import FlightTable, Table, flight_table_of


@dataclass(frozen=True, slots=True)
class SourceFile:
    """A file that went into the flight data, by name and SHA-256."""

    name: str
    sha256: str


@dataclass(frozen=True, slots=True)
class Provenance:
    """Where flight data come from."""

    recording: str
    software: str
    method: str
    flight_files: tuple[SourceFile, ...]
    panel: SourceFile
    camera: SourceFile | None
    losses: tuple[str, ...]


def write_json(data: FlightData, provenance: Provenance, stream: IO[str]) -> None:
    """Write the description of flight data as JSON."""
    json.dump(describe(data, provenance), stream, indent=2, ensure_ascii=False, allow_nan=False)
    stream.write("\n")


def describe(data: FlightData, provenance: Provenance) -> dict[str, Any]:
    """Describe flight data in plain dictionaries and lists."""
    return {
        **asdict(provenance),
        **_part(data),
        **({"time_of_day": data.time_of_day} if data.time_of_day else {}),
        **({} if data.gps is None else {"gps": _gps(data, data.gps)}),
        "frames": len(data.frame),
        "start_utc": (moment_text(data, int(data.time_ns[0])) or None) if len(data.frame) else None,
        "end_utc": (moment_text(data, int(data.time_ns[-1])) or None) if len(data.frame) else None,
        "duration_s": round(float(data.time_s[-1] - data.time_s[0]), 6) if len(data.frame) else 0.0,
        "needles": {
            series.quantity.name: _needle(series, data.budgets.get(series.quantity.name)) for series in data.series
        },
        "moved_pivots_px": {name: [round(x, 3), round(y, 3)] for name, (x, y) in data.moved_pivots_px.items()},
        "warnings": list(data.warnings),
        "health": {gauge: health_line(findings) for gauge, findings in data.health.items()},
        "failed_anchors": data.alignments.failures(),
        "missing_frames": [{**_frames(data, first, last), "reason": reason} for first, last, reason in lost_runs(data)],
        "outliers": [_outlier(data, outlier) for outlier in find_outliers(data)],
        "cross_checks": [_cross_check(data, check) for check in cross_checks(data)],
        "events": [_event(data, event) for event in find_events(data)],
        "gaps": [gap for series in data.series for gap in _gaps(data, series)],
    }


def as_read_back(data: FlightData, provenance: Provenance) -> FlightTable:
    """Round flight data as if they were read back from their CSV."""
    text = io.StringIO()
    write_csv(data, text)
    text.seek(0)
    header, *rows = csv.reader(text)
    fields = zip(*rows, strict=True) if rows else [()] * len(header)
    return flight_table_of(
        Table(Path("the flight data"), dict(zip(header, fields, strict=True))), describe(data, provenance)
    )


def _part(data: FlightData) -> dict[str, Any]:
    if data.part is None:
        return {}
    return {
        "part": {
            "every": data.part.ranks.step,
            "frames_in_flight": data.part.frames_in_flight,
            "flight_start_utc": moment_text(data, data.part.began_ns) or None,
        }
    }


def _gps(data: FlightData, gps: GpsData) -> dict[str, Any]:
    return {
        "columns": {
            column.name: {"unit": column.unit, "frames": int(np.isfinite(column.values).sum())}
            for column in gps.columns
        },
        "samples": gps.samples,
        "samples_without_fix": gps.without_fix,
        "without_position": [_frames(data, *span) for span in spans(~gps.located)],
    }


def _needle(series: NeedleSeries, budget: Budget | None) -> dict[str, Any]:
    quantity = series.quantity
    scale_min, scale_max = quantity.range
    return {
        "gauge": quantity.gauge,
        "unit": quantity.unit,
        "scale_min": scale_min,
        "scale_max": scale_max,
        **({} if quantity.wraps is None else {"wraps": quantity.wraps}),
        **(
            {}
            if quantity.written is None
            else {"type": quantity.written.type.value, "pattern": quantity.written.pattern}
        ),
        "frames": status_counts(series),
        "lowest_score": series.lowest_score,
        **({} if budget is None else {"uncertainty": _uncertainty(budget)}),
    }


def _uncertainty(budget: Budget) -> dict[str, Any]:
    """Describe a budget; a cause that is the same at all values is a single number."""
    causes = {cause.value: _rounded(sigma) for cause, sigma in budget.sigmas.items()}
    is_even = all(len(set(sigma)) == 1 for sigma in causes.values())
    return {
        **({} if is_even else {"values": _rounded(budget.values)}),
        **({} if is_even or budget.turn is None else {"turn": budget.turn}),
        **{cause: sigma[0] if len(set(sigma)) == 1 else sigma for cause, sigma in causes.items()},
    }


def _rounded(numbers: Floats) -> list[float]:
    return [float(f"{number:.4g}") for number in numbers.tolist()]


def _outlier(data: FlightData, outlier: Outlier) -> dict[str, Any]:
    return {
        "needle": outlier.needle,
        **_frames(data, outlier.first, outlier.last),
        "reason": outlier.reason.value,
    }


def _cross_check(data: FlightData, check: CrossCheck) -> dict[str, Any]:
    return {
        "what": check.what,
        "columns": list(check.columns),
        "unit": check.apart_unit,
        "frames_compared": check.compared,
        "disagreements": [
            {
                **_frames(data, each.first, each.last),
                "apart": float(f"{each.apart:.4g}"),
                "explained": float(f"{each.allowed:.4g}"),
            }
            for each in check.disagreements
        ],
        **({"but": check.but} if check.but else {}),
    }


def _event(data: FlightData, event: Event) -> dict[str, Any]:
    return {
        "what": event.what.value,
        **({"needle": event.needle} if event.needle else {}),
        **_frames(data, event.first, event.last),
        "words": event.words,
    }


def _gaps(data: FlightData, series: NeedleSeries) -> list[dict[str, Any]]:
    """List runs of frames in which a needle was not seen although the panel was found."""
    return [
        {
            "needle": series.quantity.name,
            "status": status.value,
            **_frames(data, first, last),
            "lowest_score": round(float(np.min(series.score[first : last + 1])), 4),
        }
        for status in (Status.HIDDEN, Status.INTERPOLATED, Status.MISSING)
        for first, last in series.runs(status)
    ]


def _frames(data: FlightData, first: int, last: int) -> dict[str, int]:
    """Name the first and the last frame of a run of rows."""
    return {"first_frame": int(data.frame[first]), "last_frame": int(data.frame[last])}
