"""Reports of flights that nobody flew: flight data made of arrays, one picture for all frames, a real Chromium."""

from __future__ import annotations

import io
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from playwright.sync_api import Browser, Page, expect

from decoder.alignment import IDENTITY
from decoder.alignment_series import AlignmentSeries
from decoder.flight_data import CODE, FlightData, MissingFrame, NeedleSeries
from decoder.json_output import Provenance, SourceFile
from decoder.panel_pictures import PanelPictures, panel_from_file
from decoder.reading import Status
from decoder.report.integrity import NOT_CHECKED, Checked
from decoder.report.report import LARGEST_BYTES, Report, write_report
from flight_file.frame import ClockReading, Exif, Frame, HostTimes
from flight_file.reader import open_flight

FIXTURES = Path(__file__).parents[2] / "fixtures"
START_NS = 1_525_435_200_000_000_000  # 2018-05-04T12:00:00Z
FRAME_NS = 250_000_000
ZERO = ClockReading(0, 0)
GOOD = Checked("good", "chain and digests", "every frame follows the one before")

Marks = Mapping[tuple[str, int], Status]
"""Statuses other than `read`, by needle and row."""

expect.set_options(timeout=60_000)  # a busy machine is no failure


@dataclass(frozen=True, slots=True)
class Made:
    """A report that was written, and what it was made of."""

    path: Path
    report: Report
    content: bytes = field(repr=False)


@pytest.fixture(scope="session")
def source() -> PanelPictures:
    """The animation's panel."""
    return panel_from_file(FIXTURES / "panel.yaml")


@pytest.fixture(scope="session")
def jpeg() -> bytes:
    """A picture of it."""
    return next(open_flight([FIXTURES / "thesis_a1.mcap"]).frames()).jpeg


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


def frames_of(data: FlightData, jpeg: bytes) -> Callable[[], Iterator[Frame]]:
    """One picture for every row."""

    def frames() -> Iterator[Frame]:
        for sequence, captured_ns in zip(data.frame.tolist(), data.time_ns.tolist(), strict=True):
            yield Frame(sequence, captured_ns, jpeg, "", HostTimes(ZERO, ZERO, ZERO), Exif(), None, None)

    return frames


@pytest.fixture(scope="session")
def make_report(source: PanelPictures, jpeg: bytes) -> Callable[..., Report]:
    """Makes the report of a synthetic flight."""

    def make(
        rows: int = 60,
        marks: Marks | None = None,
        lost: Mapping[int, str] | None = None,
        *,
        panel: PanelPictures = source,
        losses: tuple[str, ...] = (),
        data: FlightData | None = None,
        **more: Any,  # noqa: ANN401 - any part of a report
    ) -> Report:
        data = data or flight_data(panel, rows, marks or {}, lost or {})
        file = SourceFile("flight.mcap", "0" * 64)
        provenance = Provenance(
            "flight", "tests 1", "normxcorr", (file,), SourceFile("panel.yaml", "1" * 64), None, losses
        )
        known: dict[str, Any] = {
            "camera": None,
            "provenance": provenance,
            "frames": frames_of(data, jpeg),
            "checked": [GOOD, *NOT_CHECKED],
            "recorded_by": [("camera", "simulated")],
            "command": "decode flight.mcap --format html",
            "name": "flight",
        }
        return replace(Report(data=data, source=panel, **known), **more)

    return make


@pytest.fixture(scope="session")
def write(tmp_path_factory: pytest.TempPathFactory) -> Callable[..., Made]:
    """Writes a report to a file."""

    def written(report: Report, largest_bytes: int = LARGEST_BYTES) -> Made:
        stream = io.BytesIO()
        write_report(report, stream, largest_bytes=largest_bytes)
        path = tmp_path_factory.mktemp("report") / "flight.html"
        path.write_bytes(stream.getvalue())
        return Made(path, report, stream.getvalue())

    return written


def opened_offline(browser: Browser, made: Made, said: list[str], **options: Any) -> Page:  # noqa: ANN401 - a context's
    """A report in a tab without network; what it asks of one, or says on the console, is noted."""
    context = browser.new_context(viewport={"width": 1440, "height": 900}, offline=True, **options)
    page = context.new_page()
    page.on("console", lambda message: said.append(f"{message.type}: {message.text}"))
    page.on("pageerror", lambda error: said.append(str(error)))
    page.on("dialog", lambda dialog: said.append(f"dialog: {dialog.message}"))
    page.on("request", lambda asked: said.append(asked.url) if asked.url.startswith(("http", "ws")) else None)
    page.goto(made.path.as_uri())
    page.wait_for_selector("body[data-ready]")
    return page


@pytest.fixture(scope="module")
def open_report(browser: Browser) -> Iterator[Callable[..., Page]]:
    """Opens reports; what one asks of a network, or says on the console, fails the last test that had it."""
    said: list[str] = []
    pages: list[Page] = []

    def opened(made: Made, **options: Any) -> Page:  # noqa: ANN401 - a browser context's
        pages.append(opened_offline(browser, made, said, **options))
        return pages[-1]

    yield opened
    for page in pages:
        page.context.close()
    assert said == []
