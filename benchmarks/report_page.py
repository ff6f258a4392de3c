"""How large the report of a two-hour flight is, what writing it takes, and how long it takes to open in Chromium."""

from __future__ import annotations

import resource
import time
from collections.abc import Iterator
from functools import partial
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np

from benchmarks.pages import markdown
from benchmarks.setup_page import FIXTURES, chromium
from decoder.imaging.alignment import IDENTITY
from decoder.imaging.panel_pictures import PanelPictures, panel_from_file
from decoder.instruments.reading import Status
from decoder.outputs.json_output import Provenance, SourceFile
from decoder.outputs.outputs import Decoded
from decoder.outputs.report.report import write_report
from decoder.timeseries.flight_data import CODE, AlignmentSeries, FlightData, NeedleSeries
from flight_file.frame import ClockReading, Exif, Frame, HostTimes
from flight_file.reader import open_flight
from flight_file.session import Session
from flight_file.verification import verify

ROWS = 2 * 3600 * 4
FLAG_EVERY, FLAG_ROWS = 144, 5
STEP_NS = 250_000_000
ROUNDS = 5
MOST_MB, MOST_S = 25, 5
BYTES_PER_MB = 1e6
LEGEND = """\
A synthetic flight of two hours at 4 Hz: the demo panel's seven needles, 1400 flagged spans, and the demo's pictures.
Opened from disk in Chromium on the same machine, until everything in view is drawn; the best of five.
"""


def flight_data(source: PanelPictures) -> FlightData:
    """Two hours of slow swings with noise, a needle interpolated now and then."""
    chance, alignments = np.random.default_rng(1), AlignmentSeries()
    for _ in range(ROWS):
        alignments.add(IDENTITY)
    series = []
    for place, quantity in enumerate(source.panel.quantities):
        low, high = quantity.range
        swing = 0.5 + 0.3 * np.sin(np.linspace(0, 60 + 9 * place, ROWS)) + chance.normal(0, 0.002, ROWS)
        flagged = (np.arange(ROWS) + 19 * place) % FLAG_EVERY < FLAG_ROWS
        status = np.where(flagged, CODE[Status.INTERPOLATED], CODE[Status.READ]).astype(np.uint8)
        sigma, score = np.full(ROWS, (high - low) / 1000), np.where(flagged, 0.5, 0.99)
        series.append(NeedleSeries(quantity, status, low + (high - low) * swing, sigma, score, np.zeros(ROWS)))
    return FlightData(
        frame=np.arange(ROWS),
        time_ns=1_525_435_200_000_000_000 + STEP_NS * np.arange(ROWS),
        series=tuple(series),
        missing_frames=(),
        alignments=alignments,
    )


def two_hours() -> Decoded:
    """The report of the flight."""
    source = panel_from_file(FIXTURES / "panel.yaml")
    data, zero = flight_data(source), ClockReading(0, 0)
    jpegs = [frame.encoded for frame in open_flight([FIXTURES / "thesis_a1.mcap"]).frames()]

    def frames() -> Iterator[Frame]:
        for row, captured_ns in enumerate(data.time_ns.tolist()):
            yield Frame(row, captured_ns, jpegs[row % len(jpegs)], "", HostTimes(zero, zero, zero), Exif(), None, None)

    provenance = Provenance(
        "two hours", "benchmark", "normxcorr", (SourceFile("-", "0" * 64),), SourceFile("-", "0" * 64), None, ()
    )
    return Decoded(
        data=data,
        source=source,
        camera=None,
        provenance=provenance,
        frames=frames,
        check=partial(verify, [FIXTURES / "thesis_a1.mcap"]),
        session=Session("two hours"),
    )


def opened_s(browser_path: str, page_file: Path) -> tuple[float, float]:
    """Until the page has drawn what is in view: seconds by the clock, and of the processor, the best of some rounds."""
    from playwright.sync_api import sync_playwright  # noqa: PLC0415 - for development only

    times, works = [], []
    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=browser_path, args=["--no-sandbox"])
        for _ in range(ROUNDS):
            page = browser.new_page(viewport={"width": 1440, "height": 900})
            inside = page.context.new_cdp_session(page)
            inside.send("Performance.enable", {"timeDomain": "threadTicks"})
            begun = time.perf_counter()
            page.goto(page_file.as_uri())
            page.wait_for_selector("body[data-ready]")
            times.append(time.perf_counter() - begun)
            metrics = inside.send("Performance.getMetrics")["metrics"]
            works += [metric["value"] for metric in metrics if metric["name"] == "TaskDuration"]
            page.close()
        browser.close()
    return min(times), min(works)


def report_page() -> str:
    """The page on the report's size and speed."""
    browser = chromium()
    if browser is None:
        return "Not measured: there is no Chromium on this machine.\n"
    with TemporaryDirectory() as name:
        file = Path(name) / "flight.html"
        report = two_hours()
        before, begun = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss, time.process_time()
        with file.open("wb") as stream:
            write_report(report, stream)
        took_s = time.process_time() - begun
        grown_mb = (resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before) / 1e3
        size_mb, (open_s, work_s) = file.stat().st_size / BYTES_PER_MB, opened_s(browser, file)
    rows = [
        ["size, MB", f"{size_mb:.1f}", str(MOST_MB), "yes" if size_mb < MOST_MB else "NO"],
        ["opening, s", f"{open_s:.1f}", str(MOST_S), "yes" if open_s < MOST_S else "NO"],
        ["opening, s of the processor in the page", f"{work_s:.1f}", "-", "-"],
        ["writing, s of the processor", f"{took_s:.1f}", "-", "-"],
        ["memory grown by while writing, MB", f"{grown_mb:.0f}", "-", "-"],
    ]
    return f"{LEGEND}\n{markdown(['what', 'measured', 'required', 'holds'], rows)}\n"
