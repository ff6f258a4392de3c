"""The report in a real browser without network: what it shows, and that nothing is hidden."""

from __future__ import annotations

import re
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import numpy.typing as npt
import pytest
from playwright.sync_api import Page, expect

from decoder.instruments.reading import Status
from decoder.learning.budget import Budget, Cause
from decoder.outputs.outputs import Decoded
from decoder.panel.camera import parse_camera
from decoder.panel.gauge import Gauge
from decoder.timeseries.flight_data import AlignmentSeries, FlightData
from flight_file.session import UNKNOWN, Session
from tests.report.reports import make_report, source, written

OpenReport = Callable[..., Page]

MARKS = {
    ("n1_pct", 10): Status.INTERPOLATED,
    ("fuel_al_lb", 20): Status.HIDDEN,
    ("fuel_al_lb", 21): Status.EDGE,
    ("n2_pct", 0): Status.MISSING,
}
TWO_HOURS = 28_800
ALONE = 14_321  # the one frame of two hours in which a needle is missing
CAMERA = parse_camera(
    "picture_size: [900, 700]\nfocal: {pixels_per_radian: [0, 200, 0], range_mm: [4, 10],"
    " covariance: [[1, 0, 0], [0, 1, 0], [0, 0, 1]]}\ndistortion: [{focal_length_mm: 5, k1: -0.02}]\n"
)
HOSTILE = '</script><img src=x onerror="alert(1)"><b>'


@pytest.fixture(scope="module")
def small() -> bytes:
    """A short flight with every status, a lost panel, a loss, and a camera."""
    report = make_report(60, MARKS, {40: "knob not found (0.31)", 41: "knob not found (0.30)"}, losses=("a chunk",))
    return written(replace(report, camera=CAMERA))


@pytest.fixture(scope="module")
def long() -> bytes:
    """Two hours at 4 Hz with one single flag."""
    return written(make_report(TWO_HOURS, {("ftit_c", ALONE): Status.MISSING, ("n1_pct", 900): Status.INTERPOLATED}))


@pytest.fixture(scope="module")
def page(small: bytes, open_report: OpenReport) -> Page:
    """The short flight's report, open; tests leave it as they like."""
    return open_report(small)


@pytest.fixture(scope="module")
def long_page(long: bytes, open_report: OpenReport) -> Page:
    """The long flight's report, open."""
    return open_report(long)


def until(page: Page, condition: str, arg: object = None) -> None:
    """Waits until a condition holds; the page's security policy lets no other code be evaluated in it."""
    for _ in range(1200):
        if page.evaluate(condition, arg):
            return
        page.wait_for_timeout(50)
    curves = "one.data?.map((each) => [each.meta, each.x.length])"
    shown = f"[...document.querySelectorAll('.plot')].map((one) => [one.layout?.xaxis.range, {curves}])"
    pytest.fail(f"never came: {condition}; the plots show {page.evaluate(shown)}")


def plotted(page: Page, plot: int, meta: str) -> dict[str, Any]:
    """A curve of a plot, as it was given to the plotting library."""
    until(page, "(plot) => document.querySelectorAll('.plot')[plot].data", plot)
    found: dict[str, Any] = page.evaluate(
        "([plot, meta]) => {"
        " const each = document.querySelectorAll('.plot')[plot].data.filter((one) => one.meta === meta);"
        " return { x: each.flatMap((one) => one.x), rows: each.flatMap((one) => one.customdata || []) }; }",
        [plot, meta],
    )
    return found


def click_row(page: Page, plot: int, row: int) -> None:
    """A click on a plot where a row is."""
    host = page.locator(".plot").nth(plot)
    host.scroll_into_view_if_needed()
    x = page.evaluate(
        "([plot, row]) => { const host = document.querySelectorAll('.plot')[plot]; const axis = host._fullLayout.xaxis;"
        " return axis._offset + axis.d2p(Date.UTC(2018, 4, 4, 12) + row * 250); }",
        [plot, row],
    )
    host.click(position={"x": x, "y": 40})


def test_a_value_says_what_its_uncertainty_is_made_of(open_report: OpenReport) -> None:
    """The parts of the square in percent, the largest first; opened once it stays open from frame to frame."""
    values, even = np.array([0.0, 110.0]), np.zeros(2)
    sigmas = {Cause.DRAWN: even + 0.08, Cause.PIVOT: even + 0.04, Cause.VIEWED: even, Cause.PLACED: even}
    made = make_report(60)
    page = open_report(
        written(replace(made, data=replace(made.data, budgets={"n1_pct": Budget(values, None, sigmas)})))
    )

    click_row(page, 0, 12)
    why = page.locator("#evidence-strip .reading", has_text="n1_pct").locator("details.why")
    why.locator("summary").click()
    page.keyboard.press("ArrowRight")

    expect(page.locator("#evidence-title")).to_have_text("Frame 13")
    expect(page.locator("#evidence-strip details.why")).to_have_count(1)
    expect(why.locator("li")).to_have_text(
        [re.compile("48 % how precisely"), re.compile("40 % how sharp"), re.compile("12 % the position of its pivot")]
    )


def test_every_status_is_shown(page: Page) -> None:
    """Without network and without a word on the console; each status is in the legend and in the band of its needle."""
    page.keyboard.press("0")

    for status in Status:
        expect(page.locator("#data .legend").first).to_contain_text(status.value)
    assert plotted(page, 0, "strip interpolated")["x"]
    assert plotted(page, 0, "strip missing")["x"]  # the frames without panel
    page.locator(".plot").nth(5).scroll_into_view_if_needed()
    assert len(plotted(page, 5, "strip hidden")["x"]) == 3
    assert {20, 21} <= set(plotted(page, 5, "mark")["rows"])
    expect(page.locator(".alerts")).to_contain_text("a chunk")
    assert page.locator(".chart .main-svg").count() >= 2


def test_single_flag_of_two_hours_is_seen(long_page: Page) -> None:
    """At full zoom out one flagged frame of 28 800 is marked, and at least two pixels wide in the band."""
    page = long_page
    page.keyboard.press("0")
    begun, ended, _ = plotted(page, 2, "strip missing")["x"]
    width_px = page.evaluate(
        "([begun, ended]) => { const axis = document.querySelectorAll('.plot')[2]._fullLayout.xaxis;"
        " return axis.d2p(ended) - axis.d2p(begun); }",
        [begun, ended],
    )

    assert width_px >= 2.0
    assert begun < 1_525_435_200_000 + ALONE * 250 < ended
    # Plots out of sight are drawn when they are seen, and those in sight one after the other.
    page.locator(".plot").first.scroll_into_view_if_needed()
    until(
        page,
        "() => document.querySelectorAll('.plot')[0].data.some((one) => one.meta === 'mark' && one.customdata?.length)",
        0,
    )
    assert plotted(page, 0, "mark")["rows"] == [900]
    assert len(plotted(page, 0, "curve")["x"]) < 4000
    expect(page.locator("#flags tbody tr")).to_have_count(2)


def test_many_flags_are_thinned_but_their_extremes_stay(open_report: OpenReport) -> None:
    """Zoomed out, marks that would lie over each other are left out, the highest and the lowest of a status never."""
    marks = {("n1_pct", row): Status.EDGE for row in range(0, TWO_HOURS, 2)}
    report = make_report(TWO_HOURS, marks)
    page = open_report(written(report, 1))
    rows, value = plotted(page, 0, "mark")["rows"], report.data.series[0].value.astype(np.float32)
    shown = value[rows]

    assert len(rows) < 1000
    assert (shown.min(), shown.max()) == (value[::2].min(), value[::2].max())


def test_zoom_is_linked_and_brings_every_frame(long_page: Page) -> None:
    """A drag over one plot zooms all; near enough every frame is a point."""
    page = long_page
    page.locator("#flags button", has_text="Show").nth(1).click()
    until(page, "document.querySelectorAll('.plot')[0].data[1].x.length < 500")
    ranges = page.evaluate(
        "[...document.querySelectorAll('.plot')].filter((one) => one.data).map((one) => one.layout.xaxis.range)"
    )
    assert len(ranges) >= 3
    assert all(span == ranges[0] for span in ranges)
    host = page.locator(".plot").nth(0)
    host.scroll_into_view_if_needed()
    page.wait_for_timeout(100)
    box = host.bounding_box()
    assert box is not None
    page.mouse.move(box["x"] + 200, box["y"] + 40)
    page.mouse.down()
    page.mouse.move(box["x"] + 500, box["y"] + 40, steps=4)
    page.mouse.up()
    until(page, "(before) => document.querySelectorAll('.plot')[1].layout.xaxis.range[1] < before[1]", ranges[0])
    narrowed = page.evaluate("[0, 1].map((plot) => document.querySelectorAll('.plot')[plot].layout.xaxis.range)")
    assert narrowed[0] == narrowed[1]
    page.keyboard.press("0")
    expect(page.locator("#view")).to_contain_text("122 min")


def test_click_shows_the_frame(page: Page) -> None:
    """A click shows that frame's gauges, its values and scores, and the needles drawn in, which can be taken away."""
    page.keyboard.press("0")
    page.locator("#drawing").check()
    click_row(page, 1, 30)

    expect(page.locator("#evidence")).to_have_attribute("data-row", "30")
    expect(page.locator("#evidence-title")).to_have_text("Frame 30")
    expect(page.locator("#evidence figure")).to_have_count(6)
    expect(page.locator("#evidence figure svg image").first).to_have_attribute("href", re.compile("^data:image/jpeg"))
    expect(page.locator("#evidence figure").first).to_contain_text("score 0.990")
    expect(page.locator("#evidence figure.asked")).to_have_attribute("data-gauge", "n2")
    assert page.locator("#evidence figure .needle").count() == 14
    page.locator("#drawing").uncheck()
    expect(page.locator("#evidence figure .needle")).to_have_count(0)


def test_nearest_pictures_are_named(long_page: Page) -> None:
    """Where a frame's pictures are not in the report, the nearest are shown, and it is said."""
    page = long_page
    taken = set(
        page.evaluate("[...document.querySelectorAll('script.evidence')].map((one) => Number(one.dataset.row))")
    )
    free = next(row for row in range(ALONE + 5, ALONE + 400) if row not in taken)
    page.keyboard.press("Home")
    page.locator("#flags button", has_text="Show").nth(1).click()
    for _ in range(free - ALONE):
        page.keyboard.press("ArrowRight")

    expect(page.locator("#evidence")).to_have_attribute("data-row", str(free))
    pictured = int(page.locator("#evidence").get_attribute("data-pictured") or "-1")
    assert pictured == min(taken, key=lambda row: abs(row - free))
    expect(page.locator("#evidence-remark")).to_contain_text(f"frame {pictured}, ")


def test_keys_do_what_the_pointer_does(page: Page) -> None:
    """Frames, flags, zoom and the drawing by the keyboard."""
    page.keyboard.press("0")
    evidence = page.locator("#evidence")
    page.keyboard.press("Home")
    page.keyboard.press("ArrowRight")
    page.keyboard.press("Shift+ArrowRight")
    expect(evidence).to_have_attribute("data-row", "11")
    page.keyboard.press("p")
    expect(evidence).to_have_attribute("data-row", "10")
    page.keyboard.press("n")
    expect(evidence).to_have_attribute("data-row", "20")
    before = page.locator("#view").inner_text()
    page.keyboard.press("+")
    expect(page.locator("#view")).not_to_have_text(before)
    page.locator("#drawing").check()
    page.keyboard.press("d")
    expect(page.locator("#evidence figure .needle")).to_have_count(0)
    page.keyboard.press("f")
    expect(page.locator("#evidence-strip")).to_be_hidden()
    page.keyboard.press("f")
    expect(page.locator("#evidence-strip")).to_be_visible()


def test_what_the_flight_says_stays_text(open_report: OpenReport) -> None:
    """Names, units, reasons and losses that look like a page's own code are shown, and do nothing."""
    gauges = tuple(
        gauge.model_copy(update={"name": HOSTILE + gauge.name, "unit": HOSTILE}) for gauge in source().panel.gauges
    )
    anchors = tuple(anchor.model_copy(update={"name": HOSTILE}) for anchor in source().panel.anchors)
    panel = replace(
        source(), panel=source().panel.model_copy(update={"gauges": gauges, "anchors": anchors, "name": HOSTILE})
    )
    report = make_report(
        20, {("n1_pct", 3): Status.EDGE}, {7: HOSTILE}, panel=panel, losses=(HOSTILE,), command=HOSTILE
    )
    made = written(
        replace(
            report,
            camera=CAMERA.model_copy(update={"model": HOSTILE}),
            session=Session(HOSTILE, camera_model=HOSTILE, host=HOSTILE),
        )
    )
    page = open_report(made)
    page.locator("#flags tr", has_text="whole panel").get_by_role("button").click()

    expect(page.locator("#evidence figure.whole")).to_contain_text(HOSTILE)
    expect(page.locator(".alerts")).to_contain_text(HOSTILE)
    assert page.locator("img").count() == 0
    assert page.locator("script").count() == made.count(b'class="evidence"') + 4
    assert b"<img" not in made.replace(b"<image", b"")[: made.index(b"<!--") if b"<!--" in made else 60_000]


def test_paper_has_everything(small: bytes, open_report: OpenReport) -> None:
    """Printed, all plots are there, nothing asks to be clicked, and tables are whole."""
    page = open_report(small, color_scheme="dark")
    assert page.pdf(prefer_css_page_size=True).startswith(b"%PDF")
    page.emulate_media(media="print")
    until(page, "[...document.querySelectorAll('.plot')].every((one) => one.data)")

    expect(page.locator("button").first).to_be_hidden()
    expect(page.locator("#evidence")).to_have_css("position", "static")
    assert page.evaluate("getComputedStyle(document.body).backgroundColor") == "rgb(255, 255, 255)"
    assert page.evaluate(
        "[...document.querySelectorAll('.scroll')].every((one) => one.scrollHeight <= one.clientHeight + 1)"
    )


def later(data: FlightData, offset_ns: npt.ArrayLike) -> FlightData:
    """The same flight, its frames taken so much later."""
    return replace(data, time_ns=data.time_ns + np.asarray(offset_ns))


AN_HOUR_NS = 3_600_000_000_000
ODD: dict[str, Callable[[], Decoded]] = {
    "no frame": lambda: make_report(0),
    "one frame": lambda: make_report(1),
    "every frame lost": lambda: make_report(6, lost=dict.fromkeys(range(6), "the picture is damaged")),
    "clock set back": lambda: make_report(
        data=later(make_report(30).data, np.where(np.arange(30) < 15, 0, -20_000_000_000))
    ),
    "long gap": lambda: make_report(data=later(make_report(40).data, np.where(np.arange(40) < 20, 0, AN_HOUR_NS))),
    "no alignment kept": lambda: make_report(data=replace(make_report(12).data, alignments=AlignmentSeries())),
}


@pytest.mark.parametrize("name", ODD)
def test_odd_flights_open(name: str, open_report: OpenReport) -> None:
    """The report of a flight at the edge of what can be opens without a complaint."""
    page = open_report(written(ODD[name]()))
    page.keyboard.press("End")
    page.keyboard.press("+")

    expect(page.locator(".track").first).to_be_visible()
    if name == "long gap":  # nothing is drawn over the hour without frames
        page.keyboard.press("0")
        until(page, "document.querySelector('.plot').data?.some((one) => one.x.includes(null))")
        assert plotted(page, 0, "curve")["x"].count(None) == 1
        assert len(plotted(page, 0, "strip read")["x"]) == 6


def test_a_flight_of_unknown_time_lies_where_its_seconds_are(open_report: OpenReport) -> None:
    """Plotly takes some numbers for years; all of the curve's points are in view."""
    data = replace(make_report(60).data, time_ns=250_000_000 * np.arange(60), time_of_day=UNKNOWN)
    page = open_report(written(make_report(data=data)))
    until(page, "document.querySelector('.plot').calcdata")
    low, high, first, last = page.evaluate(
        "(() => { const plot = document.querySelector('.plot'); const axis = plot._fullLayout.xaxis;"
        " const at = plot.calcdata.flat().map((one) => one.x).filter(Number.isFinite);"
        " return [Math.min(...at), Math.max(...at), ...axis.range.map(axis.r2c)]; })()"
    )

    assert first <= low < high <= last


def test_round_scales_do_not_run_across(open_report: OpenReport) -> None:
    """A heading that goes through north is not joined by a line down the whole plot."""
    first = source().panel.gauges[0]
    heading = Gauge.model_validate(
        {"name": "heading °", "unit": "°", "centre": first.centre, "radius": first.radius, "sweep": [0, 360]}
        | {"wraps": 360, "scale": [[0, 0], [360, 360]], "card": {"name": "heading_deg", "index": 270.0}}
    )
    panel = replace(source(), panel=source().panel.model_copy(update={"gauges": (heading,)}))
    data: FlightData = make_report(40, panel=panel).data
    series = replace(data.series[0], value=(340.0 + np.arange(40)) % 360.0)
    page = open_report(written(make_report(panel=panel, data=replace(data, series=(series,)))))

    assert plotted(page, 0, "curve")["x"].count(None) == 1
    expect(page.locator(".track").first).to_contain_text("° · heading °")
