"""What goes into a report: pictures within their room, the same bytes every time, no way out of the text."""

from __future__ import annotations

import csv
import re
from collections.abc import Callable
from hashlib import sha256
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from decoder.commands.decoding import decoded_flight
from decoder.flight_data import FlightData
from decoder.panel_pictures import PanelPictures, panel_from_file
from decoder.reading import Status
from decoder.report.bundle import PLOTLY, plotly, script
from decoder.report.choosing import Room, planned, scattered_order
from decoder.report.flags import Kind, find_flags
from decoder.report.integrity import checked
from decoder.report.of_flight import report_of
from decoder.report.panel_drawing import panel_drawing
from decoder.report.report import PICTURES_BYTES, Report
from decoder.report.truth_section import truth_section
from decoder.truth_comparison import read_truth
from decoder.truth_request import TruthRequest
from flight_file.findings import Finding, FindingKind
from flight_file.reader import open_flight
from flight_file.verification import RecordingCheck, SegmentCheck, verify

MakeReport = Callable[..., Report]
Write = Callable[..., Any]
FIXTURES = Path(__file__).parents[2] / "fixtures"
A2 = FIXTURES / "thesis_a2.mcap"
TWO_HOURS = 28_800
LARGEST = 25_000_000


def rows_of(content: bytes) -> list[int]:
    """The rows whose pictures are in a report."""
    return [int(row) for row in re.findall(rb'class="evidence" data-row="(\d+)"', content)]


def test_two_hours_stay_within_the_size(make_report: MakeReport, write: Write) -> None:
    """Two hours at 4 Hz with two hundred flags: under 25 MB, and every flag has a picture."""
    marks = {
        ("n1_pct", row): Status.INTERPOLATED for first in range(50, TWO_HOURS, 144) for row in range(first, first + 5)
    }
    report = make_report(TWO_HOURS, marks)
    made = write(report)
    flags, rows = find_flags(report.data), np.array(rows_of(made.content))

    assert len(made.content) < LARGEST
    assert len(flags) == 200
    assert all(((rows >= flag.first) & (rows <= flag.last)).any() for flag in flags)
    assert (
        sum(len(block) for block in re.findall(rb'<script[^>]*class="evidence".*?</script>', made.content))
        < PICTURES_BYTES
    )


def test_little_room_is_kept(make_report: MakeReport, write: Write) -> None:
    """With next to no room some pictures are in all the same, those of the flag first, and no more than a megabyte."""
    report = make_report(300, {("n2_pct", 200): Status.INTERPOLATED})
    whole, small = write(report).content, write(report, 1).content

    assert 200 in rows_of(small)
    assert 0 < len(rows_of(small)) < len(rows_of(whole))
    assert sum(len(block) for block in re.findall(rb'<script[^>]*class="evidence".*?</script>', small)) < 1_000_000


def test_same_flight_same_bytes() -> None:
    """Nothing of the time or place of writing is in it."""
    import io  # noqa: PLC0415

    from decoder.report.report import write_report  # noqa: PLC0415

    contents = []
    for _ in range(2):
        stream = io.BytesIO()
        write_report(report_of(decoded_flight(open_flight([A2]), None, "normxcorr")), stream)
        contents.append(stream.getvalue())
    text = contents[0].decode()

    assert contents[0] == contents[1]
    assert str(FIXTURES) not in text
    assert "decode thesis_a2.mcap --method normxcorr --format html" in text
    assert "http://" not in text.split("plotly.js (")[0]


@given(st.integers(0, 300))
def test_scattered_order_is_all_of_it(count: int) -> None:
    """Every number once, and of any beginning no gap is more than twice another's."""
    order = scattered_order(count)

    assert sorted(order) == list(range(count))
    for part in (4, 8, 16):
        if count > 2 * part:
            gaps = np.diff(sorted(order[:part]))
            assert gaps.max() <= 2 * gaps.min() + 1


@given(st.lists(st.integers(1, 100), min_size=1, max_size=60), st.integers(0, 2000), st.integers(0, 9))
def test_room_is_never_overdrawn(sizes: list[int], size_bytes: int, seed: int) -> None:
    """Whatever pictures take, what was taken is no more than there was."""
    wanted = np.random.default_rng(seed).permutation(len(sizes)).tolist()
    room = Room(wanted, size_bytes, 30)
    taken = sum(size for row, size in enumerate(sizes) if room.has_for(row) and room.take(size))

    assert taken <= size_bytes


@given(st.integers(1, 60), st.integers(0, 60), st.integers(0, 9))
def test_most_wanted_get_the_room(count: int, places: int, seed: int) -> None:
    """Where all are of one size, exactly the most wanted are in, in whatever order they come."""
    wanted = np.random.default_rng(seed).permutation(count).tolist()
    room = Room(wanted, places * 10, 10)

    assert {row for row in range(count) if room.has_for(row) and room.take(10)} == set(wanted[:places])


def test_flags_come_with_their_reasons(make_report: MakeReport) -> None:
    """Runs, not rows; each says what is known of why."""
    marks = {("n1_pct", row): Status.INTERPOLATED for row in (5, 6, 7)} | {("fuel_al_lb", 9): Status.HIDDEN}
    flags = find_flags(make_report(20, marks, {2: "knob not found (0.31)", 3: "knob not found (0.29)"}).data)

    assert [(flag.kind, flag.needle, flag.first, flag.last) for flag in flags] == [
        (Kind.LOST, "", 2, 3),
        (Kind.INTERPOLATED, "n1_pct", 5, 7),
        (Kind.HIDDEN, "fuel_al_lb", 9, 9),
    ]
    assert flags[0].reason == "knob not found (0.31)"
    assert "lowest score 0.50" in flags[1].reason
    assert flags[2].reason == "under fuel_fr_lb; it takes that needle's place"


def test_flags_extremes_and_steps_are_planned(make_report: MakeReport) -> None:
    """The gravest flag comes first; the highest value, the largest step and both ends are among the planned."""
    data: FlightData = make_report(400, {("n1_pct", 77): Status.EDGE}, {150: "knob not found"}).data
    wanted = planned(data, find_flags(data))
    values = data.series[0].value
    step = int(np.nanargmax(np.abs(np.diff(values))))

    assert wanted[:2] == [150, 77]
    assert {0, 399, int(np.nanargmax(values)), step, step + 1} <= set(wanted)
    assert len(wanted) == len(set(wanted))


def test_drawing_has_marks_where_the_panel_says(source: PanelPictures) -> None:
    """A mark ends on the perimeter at its angle, and a needle's tip, too."""
    gauge = source.panel.gauges[0]
    drawing = panel_drawing(source, {gauge.name: (1.0, -2.0)}).gauges[0]
    angle, _ = gauge.scale[0]
    x, y = map(float, drawing.marks[0].line.split(" ")[1].split(","))

    assert x == pytest.approx(gauge.centre[0] + 0.5 + gauge.radius[1] * np.cos(np.radians(angle)), abs=0.06)
    assert y == pytest.approx(gauge.centre[1] + 0.5 + gauge.radius[1] * np.sin(np.radians(angle)), abs=0.06)
    assert drawing.moved_to == (gauge.centre[0] + 1.5, gauge.centre[1] - 1.5)


def test_names_of_dials_in_one_case_do_not_cover_each_other() -> None:
    """On a panel with two dials in one case no gauge's name stands in another's."""
    drawing = panel_drawing(panel_from_file(FIXTURES / "oblique" / "standby_small" / "panel.yaml"), {})
    one, other = drawing.gauges[2:]
    longest_px = drawing.text_px * 0.62 * (len(one.name) + len(other.name)) / 2

    assert abs(one.name_at[0] - other.name_at[0]) < longest_px
    assert abs(one.name_at[1] - other.name_at[1]) > drawing.text_px


def test_truth_gives_the_table_of_decode_accuracy() -> None:
    """The tables are those of `decode accuracy`, with units and full scale; the truth's values are for the plots."""
    decoded = decoded_flight(open_flight([A2]), None, "normxcorr")
    truth = read_truth(TruthRequest(FIXTURES / "thesis_a2_truth.csv", limits=True))
    section = truth_section(decoded.data, decoded.provenance, truth)
    first = dict(zip(section.tables[0].header, section.tables[0].rows[0], strict=True))

    assert (first["needle"], first["status"], first["unit"]) == ("n1_pct", "all", "%")
    assert float(first["mean%FS"]) < 0.1
    assert section.needles == list(range(7))
    assert np.nanmax(np.abs(section.values["n2_pct"] - decoded.data.series[1].value)) < 1.0
    assert [table.title for table in section.tables][1:] == ["Against what is asked of recorders"]


def test_needle_without_a_true_value_has_no_plot_of_errors(tmp_path: Path) -> None:
    """A column of a truth may be empty; the others are held against theirs."""
    header, *rows = csv.reader((FIXTURES / "thesis_a2_truth.csv").read_text(encoding="utf-8").splitlines())
    empty = header.index("n1_pct")
    with (tmp_path / "truth.csv").open("w", encoding="utf-8", newline="") as stream:
        csv.writer(stream).writerows([header, *([*row[:empty], "", *row[empty + 1 :]] for row in rows)])
    decoded = decoded_flight(open_flight([A2]), None, "normxcorr")
    section = truth_section(decoded.data, decoded.provenance, read_truth(TruthRequest(tmp_path / "truth.csv")))

    assert section.needles == list(range(1, 7))


def segment_checks(*findings: Finding, signed_by: tuple[bytes | None, ...] = (None,)) -> list[RecordingCheck]:
    """What a verification of a good file would have come to."""
    (good,) = verify([A2])
    (segment,) = good.segments
    parts = [
        SegmentCheck(segment.segment, 20, "a" * 64, key, findings if place == 0 else ())
        for place, key in enumerate(signed_by)
    ]
    return [RecordingCheck("flight", tuple(parts))]


@pytest.mark.parametrize(
    ("recordings", "chain", "signature", "words"),
    [
        (segment_checks(), "good", "open", "not signed"),
        (segment_checks(signed_by=(b"k" * 32,)), "good", "good", "6b6b6b6b"),
        (segment_checks(signed_by=(b"k" * 32, None)), "good", "warn", "1 of 2 segments"),
        (segment_checks(Finding(FindingKind.CUT, A2, "it ends early")), "warn", "open", "not signed"),
        (segment_checks(Finding(FindingKind.NO_CHAIN, A2, "none")), "warn", "open", "not signed"),
        (segment_checks(Finding(FindingKind.REMOVED, A2, "a break", 7)), "bad", "open", "not signed"),
    ],
)
def test_integrity_is_said_as_it_was_found(
    recordings: list[RecordingCheck], chain: str, signature: str, words: str
) -> None:
    """No more and no less than what was checked; a fault names its frame."""
    lines = {line.what: line for line in checked(recordings)}

    assert lines["chain and digests"].state == chain
    assert lines["signature"].state == signature
    assert words in lines["signature"].says
    assert "not checked" in lines["times"].says
    for finding in recordings[0].findings:
        assert finding.reason in lines[finding.kind.value].says


def test_script_is_in_one_piece() -> None:
    """No module is left that would have to be fetched."""
    text = script()

    assert not re.search(r"^\s*(import|export) ", text, re.MULTILINE)
    assert text.count("class TimePlot") == 1


def test_others_script_is_as_they_published_it() -> None:
    """What is kept of plotly.js are the bytes whose hash and version stand beside it."""
    folder = Path(str(PLOTLY)).parent
    said = re.findall(
        r"^\| `([^`]+)` \|.*\| ([0-9.]+) \|.*\| ([0-9a-f]{64}) \|$", (folder / "README.md").read_text(), re.MULTILINE
    )

    assert {name for name, _, _ in said} == {path.name for path in folder.iterdir()} - {"README.md"}
    for name, _, digest in said:
        assert sha256((folder / name).read_bytes()).hexdigest() == digest
    assert f"plotly.js (basic - minified) v{said[0][1]}\n" in plotly()
