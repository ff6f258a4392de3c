"""Reports of synthetic flights: flight data made of arrays, and one picture for all frames."""

from __future__ import annotations

import io
from collections.abc import Callable, Iterator, Mapping
from dataclasses import replace
from functools import cache, partial
from typing import Any

import numpy as np

from decoder.imaging.alignment import IDENTITY
from decoder.imaging.panel_pictures import PanelPictures, panel_from_file
from decoder.instruments.reading import Status
from decoder.outputs.json_output import Provenance, SourceFile
from decoder.outputs.outputs import Decoded
from decoder.outputs.report.report import write_report
from decoder.outputs.thresholds import LARGEST_BYTES
from decoder.timeseries.flight_data import CODE, AlignmentSeries, FlightData, MissingFrame, NeedleSeries
from flight_file.frame import ClockReading, Exif, Frame, HostTimes
from flight_file.reader import open_flight
from flight_file.session import Session
from flight_file.verification import verify
from tests.programs import A1, FIXTURES

START_NS = 1_525_435_200_000_000_000  # 2018-05-04T12:00:00Z
FRAME_NS = 250_000_000
ZERO = ClockReading(0, 0)

Marks = Mapping[tuple[str, int], Status]
"""Statuses other than `read`, by needle and row."""


@cache
def source() -> PanelPictures:
    """The animation's panel."""
    return panel_from_file(FIXTURES / "panel.yaml")


@cache
def _jpeg() -> bytes:
    return next(open_flight([A1]).frames()).encoded


def curve(place: int, rows: int, low: float, high: float) -> np.ndarray[Any, np.dtype[np.float64]]:
    """A slow swing over most of a scale."""
    phase = np.linspace(0.0, 6.0 + place, rows) if rows else np.empty(0)
    return low + (high - low) * (0.5 + 0.35 * np.sin(phase))


def flight_data(source: PanelPictures, rows: int, marks: Marks, lost: Mapping[int, str]) -> FlightData:
    """Flight data with all needles read but for `marks`, and the panel but for `lost`."""
    series = []
    for place, quantity in enumerate(source.panel.quantities):
        value = curve(place, rows, *quantity.range)
        status = np.full(rows, CODE[Status.READ], np.uint8)
        score, sigma = np.full(rows, 0.99), np.full(rows, quantity.full_scale / 1000)
        for (name, row), own in marks.items():
            if name == quantity.name:
                status[row] = CODE[own]
                score[row] = 0.5 if own in (Status.MISSING, Status.INTERPOLATED) else 0.9
        for row in lost:
            status[row], score[row] = CODE[Status.MISSING], np.nan
        gone = status == CODE[Status.MISSING]
        series.append(
            NeedleSeries(
                quantity, status, np.where(gone, np.nan, value), np.where(gone, np.nan, sigma), score, np.zeros(rows)
            )
        )
    alignments = AlignmentSeries()
    for row in range(rows):
        if row in lost:
            alignments.add_missing(["knob"])
        else:
            alignments.add(IDENTITY, ())
    return FlightData(
        frame=np.arange(rows),
        time_ns=START_NS + FRAME_NS * np.arange(rows),
        series=tuple(series),
        missing_frames=tuple(MissingFrame(row, reason) for row, reason in lost.items()),
        alignments=alignments,
    )


def frames_of(data: FlightData) -> Callable[[], Iterator[Frame]]:
    """One picture for every row."""

    def frames() -> Iterator[Frame]:
        for sequence, captured_ns in zip(data.frame.tolist(), data.time_ns.tolist(), strict=True):
            yield Frame(sequence, captured_ns, _jpeg(), "", HostTimes(ZERO, ZERO, ZERO), Exif(), None, None)

    return frames


def make_report(
    rows: int = 60,
    marks: Marks | None = None,
    lost: Mapping[int, str] | None = None,
    *,
    panel: PanelPictures | None = None,
    losses: tuple[str, ...] = (),
    data: FlightData | None = None,
    **more: Any,  # noqa: ANN401 - any part of a report
) -> Decoded:
    """The report of a synthetic flight."""
    panel = panel or source()
    data = data or flight_data(panel, rows, marks or {}, lost or {})
    files = (SourceFile("flight.mcap", "0" * 64),)
    own = SourceFile("panel.yaml", "1" * 64)
    known: dict[str, Any] = {
        "camera": None,
        "provenance": Provenance("flight", "tests 1", "normxcorr", files, own, None, losses),
        "frames": frames_of(data),
        "check": partial(verify, [A1]),
        "session": Session("flight", camera_model="simulated"),
        "command": "decode flight.mcap --format html",
        "name": "flight",
    }
    return replace(Decoded(data=data, source=panel, **known), **more)


def written(report: Decoded, largest_bytes: int = LARGEST_BYTES) -> bytes:
    """The page."""
    stream = io.BytesIO()
    write_report(report, stream, largest_bytes=largest_bytes)
    return stream.getvalue()
