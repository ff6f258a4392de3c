"""The report in a real browser: frames enlarged, parameters together, events searched, notes kept, tables given."""

from __future__ import annotations

import csv
import io
import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from playwright.sync_api import Page, expect

from decoder.imaging.panel_pictures import PanelPictures
from decoder.instruments.reading import Status
from decoder.outputs.csv_output import write_csv
from decoder.outputs.outputs import Decoded
from decoder.panel.gauge import Gauge
from decoder.panel.parameters import Column
from decoder.panel.written import BOOLEAN, ValueType, Written
from decoder.timeseries.flight_data import FlightData
from flight_file.session import Session
from tests.decoder.timeseries.test_cross_checks import flown, off_from
from tests.report.reports import make_report, source, written
from tests.report.test_page import OpenReport, until

MARKS = {("n1_pct", 10): Status.INTERPOLATED, ("n2_pct", 0): Status.MISSING}
STEP_AT = 30
DISPLAY = Written(ValueType.NUMBER, "0000000.00")


def flight_with_events() -> Decoded:
    """A step of one needle, a limit that another exceeds, and a recorder's clock that says what it is."""
    report = make_report(60, MARKS)
    data = report.data
    series = tuple(
        replace(one, value=np.where(np.arange(60) < STEP_AT, 400.0, 700.0)) if one.quantity.name == "ftit_c" else one
        for one in data.series
    )
    n1 = next(one for one in series if one.quantity.name == "n1_pct")
    columns = {"n1_pct": Column(above=float(np.nanmax(n1.value)) - 3.0)}
    session = Session("flight", camera_model="simulated", clock="GPS")
    return replace(report, data=replace(data, series=series, columns=columns), session=session)


@pytest.fixture(scope="module")
def content() -> bytes:
    """Its page."""
    return written(flight_with_events())


@pytest.fixture(scope="module")
def page(content: bytes, open_report: OpenReport) -> Page:
    """The page, open; tests leave it as they like."""
    return open_report(content, accept_downloads=True)


def test_headline_says_which_clock_the_times_come_from(page: Page, open_report: OpenReport) -> None:
    """The recorder's, with what it was set by; a clock that was typed or believed is called so."""
    expect(page.locator(".when")).to_contain_text(
        "2018-05-04 12:00:00 to 12:00:14 UTC · time by the recorder's clock (GPS)"
    )
    report = make_report(5)
    typed = replace(
        report, data=replace(report.data, time_of_day="start"), session=Session("flight", time_of_day="start")
    )

    expect(open_report(written(typed)).locator(".when")).to_contain_text("as it was typed")


def test_events_are_listed_and_can_be_searched(page: Page) -> None:
    """A step and an exceeded limit; words that all must be there leave few rows, and a step is no outlier."""
    rows = page.locator("#flags tbody tr")
    expect(rows.filter(has_text="limit exceeded").first).to_contain_text("n1_pct")
    expect(rows.filter(has_text="from 400 to 700")).to_contain_text("step")
    expect(rows.filter(has_text="outlier")).to_have_count(0)

    page.fill("#flag-search", "STEP ftit")
    expect(page.locator("#flags tbody tr:visible")).to_have_count(1)
    expect(page.locator("#flag-count")).to_contain_text("1 of")
    page.locator("#flags tbody tr:visible button").click()
    expect(page.locator("#evidence-title")).to_have_text(f"Frame {STEP_AT - 1}")
    page.fill("#flag-search", "")


def test_evidence_enlarges_to_the_whole_frame(page: Page) -> None:
    """By a click and by a key; the whole picture with all readings drawn in, and arrow keys go on to the next frame."""
    page.locator("#evidence-strip figure svg").first.click()
    dialog = page.locator("#enlarged")

    expect(dialog).to_be_visible()
    expect(dialog.locator("svg")).to_have_attribute("viewBox", "0 0 1024 768")
    expect(dialog.locator("image")).to_have_count(1)
    assert dialog.locator("polygon.rim").count() >= 5
    before = page.locator("#enlarged-title").inner_text()
    page.keyboard.press("ArrowRight")
    expect(page.locator("#enlarged-title")).not_to_have_text(before)
    page.keyboard.press("Escape")
    expect(dialog).to_be_hidden()
    page.locator("#evidence-strip figure svg").nth(1).focus()
    page.keyboard.press("Enter")
    expect(dialog).to_be_visible()
    page.locator("#enlarged-close").click()


def test_of_a_panel_of_many_gauges_all_pictures_are_parts_of_the_whole_frame(open_report: OpenReport) -> None:
    """One picture a frame: gauges show parts of it, and enlarge to it."""
    panel = round_dials([f"dial_{number}_deg" for number in range(24)])
    page = open_report(written(make_report(20, panel=panel)))
    figures = page.locator("#evidence-strip figure")

    expect(figures).to_have_count(24)
    assert page.locator("#evidence-strip image").first.get_attribute("width") == "1024"
    figures.first.locator("svg").click()
    expect(page.locator("#enlarged-says")).to_have_text("The whole frame, made smaller.")
    page.keyboard.press("Escape")


def test_several_parameters_share_one_plot_and_each_unit_has_an_axis(page: Page) -> None:
    """Two in percent on one axis, a temperature on another: three curves, two axes with their units."""
    page.locator("#compare summary").click()
    for name in ("n1_pct", "n2_pct", "ftit_c"):
        page.locator("#compare label").filter(has_text=name).locator("input").check()
    until(page, "() => (document.getElementById('compare-plot').data || []).length === 3")
    told = page.evaluate(
        "() => { const plot = document.getElementById('compare-plot'); const layout = plot._fullLayout;"
        " return { axes: plot.data.map((one) => one.yaxis), units: [layout.yaxis.title.text, layout.yaxis2.title.text],"
        " legend: plot.data.map((one) => one.name) }; }"
    )

    assert told["axes"] == ["y", "y", "y2"]
    assert told["units"] == ["%", "deg C"]
    assert told["legend"][2] == "ftit_c, deg C"
    page.locator("#compare summary").click()


def test_shown_part_is_given_as_a_table(page: Page) -> None:
    """The rows in view and no others, with the columns of flight.csv and the values that the page shows."""
    page.evaluate("() => document.querySelector('[data-key=\"0\"]').click()")
    page.locator("[data-key='+']").click()
    with page.expect_download() as download:
        page.locator("#download").click()
    rows = list(csv.DictReader(io.StringIO(Path(download.value.path()).read_text(encoding="utf-8"))))
    data = flight_with_events().data

    assert download.value.suggested_filename == "flight_part.csv"
    assert 10 < len(rows) < 60
    for row in rows:
        at = int(row["frame"])
        assert row["time_utc"].startswith("2018-05-04T12:00:")
        assert float(row["time_s"]) == pytest.approx(data.time_s[at], abs=1e-6)
        for series in data.series:
            name = series.quantity.name
            assert (row[name] == "") == bool(np.isnan(series.value[at]))
            if row[name]:
                assert float(row[name]) == pytest.approx(series.value[at], rel=1e-6)
    page.keyboard.press("0")


def test_states_and_texts_are_shown_and_given_as_flight_csv_has_them(open_report: OpenReport) -> None:
    """A lamp is true or false, a long code keeps its zeros and every digit, and neither has a spread."""
    shown = {"n1_pct": BOOLEAN, "n2_pct": Written(ValueType.TEXT, "0,000:000 000"), "ftit_c": DISPLAY}
    values = {"n1_pct": [0.0, 1.0, np.nan], "n2_pct": [1234567891.0, 42.0, np.nan], "ftit_c": [4321987.65, 0.1, np.nan]}
    report = make_report(3, {(name, 2): Status.MISSING for name in shown})
    series = tuple(
        replace(one, quantity=replace(one.quantity, written=shown[name], wraps=None), value=np.array(values[name]))
        if (name := one.quantity.name) in shown
        else one
        for one in report.data.series
    )
    data = replace(report.data, series=series)
    page = open_report(written(replace(report, data=data)), accept_downloads=True)
    with page.expect_download() as download:
        page.locator("#download").click()
    given = list(csv.DictReader(io.StringIO(Path(download.value.path()).read_text(encoding="utf-8"))))
    table = io.StringIO()
    write_csv(data, table)
    table.seek(0)

    for row, own in zip(given, csv.DictReader(table), strict=True):
        assert [row[name] for name in shown] == [own[name] for name in shown]
        assert (row["n1_pct_sigma"], row["n2_pct_sigma"]) == ("", "")


def test_an_interval_is_not_rounded_to_nothing(open_report: OpenReport) -> None:
    """A value whose last digit is coarser than its interval still says how far it may be off."""
    report = make_report(3)
    series = tuple(replace(one, sigma=np.full(3, 0.00013)) for one in report.data.series)
    page = open_report(written(replace(report, data=replace(report.data, series=series))))

    expect(page.locator("#evidence-strip figure").first).to_contain_text("± 0.0003")


def test_notes_and_a_sign_off_carry_the_hash_of_what_they_are_about(
    page: Page, content: bytes, open_report: OpenReport, tmp_path: Path
) -> None:
    """They are saved as a file, opened on the same data, and refused on other data; a change withdraws a sign-off."""
    page.fill("#note-name", "A. Reader")
    page.fill("#note-text", "Glare <b>from</b> the left")
    page.locator("#note-form button").click()
    page.locator("#sign-form button").click()
    expect(page.locator("#signed")).to_contain_text("Signed off by A. Reader")
    with page.expect_download() as download:
        page.locator("#notes-save").click()
    file = tmp_path / download.value.suggested_filename
    file.write_bytes(Path(download.value.path()).read_bytes())
    saved = json.loads(file.read_text(encoding="utf-8"))

    assert file.name == "flight.notes.json"
    assert saved["about"]["data_sha256"] == page.locator("#notes-hash").inner_text()
    assert {each["what"] for each in saved["about"]["files"]} >= {"flight file", "panel"}
    assert [note["text"] for note in saved["notes"]] == ["Glare <b>from</b> the left"]
    assert saved["sign_off"]["data_sha256"] == saved["about"]["data_sha256"]

    page.fill("#note-text", "and again")
    page.locator("#note-form button").click()
    expect(page.locator("#signed")).to_have_text("Not signed off.")
    again = open_report(content)
    again.set_input_files("#notes-file", file)
    expect(again.locator("#notes-list li")).to_have_count(1)
    expect(again.locator("#notes-list")).to_contain_text("Glare <b>from</b> the left")
    expect(again.locator("#signed")).to_contain_text("Signed off by A. Reader")
    other = open_report(written(make_report(59, MARKS)))
    other.set_input_files("#notes-file", file)
    expect(other.locator("#notes-say")).to_contain_text("is about other data")
    expect(other.locator("#notes-list li")).to_have_count(0)


def test_cross_checks_are_drawn_with_where_they_disagree(open_report: OpenReport) -> None:
    """Both curves on one axis, the step shaded, and the same among the events."""
    data = flown({"altitude_ft": off_from(200, 1000.0)})
    report = make_report(len(data.frame), panel=round_dials([one.quantity.name for one in data.series]))
    page = open_report(written(replace(report, data=of_panel(report.data, data))))
    track = page.locator("#checks .track").filter(has_text="altitude_ft's rate")

    track.scroll_into_view_if_needed()
    expect(track).to_contain_text("DISAGREE in 1 run")
    host = track.locator(".plot").element_handle()
    until(
        page,
        "(host) => host.data && host.data.length >= 2 && host.layout.shapes.some((one) => one.type === 'rect')",
        host,
    )
    expect(page.locator("#flags tbody tr").filter(has_text="disagreement").first).to_contain_text("altitude_ft")


def test_bank_has_a_sign(open_report: OpenReport) -> None:
    """A ring that counts bank from 0 to 360 is shown from -180 to 180: left wing down is negative."""
    panel = round_dials(["ai_roll_deg"])
    report = make_report(40, panel=panel)
    series = replace(report.data.series[0], value=np.mod(20.0 - np.arange(40.0), 360.0))
    page = open_report(written(replace(report, data=replace(report.data, series=(series,)))))
    until(page, "() => document.querySelector('.plot').data")
    lowest = page.evaluate(
        "() => { const curve = document.querySelector('.plot').data.find((one) => one.meta === 'curve');"
        " return Math.min(...curve.y.filter((y) => y !== null)); }"
    )

    assert lowest == pytest.approx(-19.0, abs=1e-3)


def round_dials(names: list[str]) -> PanelPictures:
    """The animation's panel picture with cards of these names instead of its gauges."""
    first = source().panel.gauges[0]
    dial = {"unit": "deg", "centre": first.centre, "radius": first.radius, "sweep": [0, 360], "wraps": 360}
    cards = tuple(
        Gauge.model_validate(
            dial | {"name": name, "scale": [[0, 0], [360, 360]], "card": {"name": name, "index": 270.0}}
        )
        for name in names
    )
    return replace(source(), panel=source().panel.model_copy(update={"gauges": cards}))


def of_panel(made: FlightData, own: FlightData) -> FlightData:
    """Flight data with other values, on the alignments of a made report."""
    series = tuple(replace(one, quantity=replace(one.quantity, gauge=one.quantity.name)) for one in own.series)
    return replace(made, time_ns=made.time_ns[0] + own.time_ns, series=series)
