"""What goes into a report: pictures within their room, the same bytes every time, no way out of the text."""

from __future__ import annotations

import csv
import io
import re
from hashlib import sha256
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from decoder.imaging.panel_pictures import panel_from_file
from decoder.instruments.reading import Status
from decoder.outputs.outputs import Decoded
from decoder.outputs.report.drawings import panel_drawing
from decoder.outputs.report.facts import checked
from decoder.outputs.report.flags import Kind, find_flags, scattered_order
from decoder.outputs.report.report import PLOTLY, plotly, write_report
from decoder.outputs.report_truth import truth_section
from decoder.outputs.thresholds import LARGEST_BYTES
from decoder.panel.vocabulary import TruthRequest
from decoder.parallel.decoding import decoded_flight
from decoder.timeseries.truth_comparison import read_truth
from flight_file.errors import Finding, FindingKind
from flight_file.reader import open_flight
from flight_file.verification import RecordingCheck, SegmentCheck, verify
from tests.programs import A2, FIXTURES
from tests.report.reports import make_report, source, written

TWO_HOURS = 28_800
LARGEST = 25_000_000


@pytest.fixture(scope="module")
def decoded() -> Decoded:
    """The committed flight with reflections; nobody changes it."""
    return decoded_flight(open_flight([A2]), None, "normxcorr")


def rows_of(content: bytes) -> list[int]:
    """The rows whose pictures are in a report."""
    return [int(row) for row in re.findall(rb'class="evidence" data-row="(\d+)"', content)]


@pytest.mark.slow
def test_two_hours_stay_within_the_size() -> None:
    """Two hours at 4 Hz with two hundred flags: under 25 MB, and every flag has a picture."""
    marks = {
        ("n1_pct", row): Status.INTERPOLATED for first in range(50, TWO_HOURS, 144) for row in range(first, first + 5)
    }
    report = make_report(TWO_HOURS, marks)
    made = written(report)
    flags, rows = find_flags(report.data), np.array(rows_of(made))

    assert len(made) < LARGEST
    assert len(flags) == 200
    assert all(((rows >= flag.first) & (rows <= flag.last)).any() for flag in flags)
    assert (
        sum(len(block) for block in re.findall(rb'<script[^>]*class="evidence".*?</script>', made)) < LARGEST_BYTES / 2
    )


def test_little_room_is_kept() -> None:
    """With next to no room some pictures are in all the same, those of the flag first; with none the data are."""
    report = make_report(300, {("n2_pct", 200): Status.INTERPOLATED})
    whole, none = written(report), written(report, 1)
    small = written(report, len(none) + 200_000)

    assert 200 in rows_of(small)
    assert 0 < len(rows_of(small)) < len(rows_of(whole))
    assert len(small) <= len(none) + 200_000
    assert rows_of(none) == []


def test_same_flight_same_bytes(decoded: Decoded) -> None:
    """Nothing of the time or place of writing is in it."""
    again = decoded_flight(open_flight([A2]), None, "normxcorr")
    one, other = io.BytesIO(), io.BytesIO()
    write_report(decoded, one)
    write_report(again, other)
    text = one.getvalue().decode()

    assert one.getvalue() == other.getvalue()
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


def test_flags_come_with_their_reasons() -> None:
    """Runs, not rows; each says what is known of why."""
    marks = {("n1_pct", row): Status.INTERPOLATED for row in (5, 6, 7)} | {("fuel_al_lb", 9): Status.HIDDEN}
    marks |= {("ftit_c", 12): Status.EDGE}
    flags = find_flags(make_report(20, marks, {2: "knob not found (0.31)", 3: "knob not found (0.29)"}).data)

    assert [(flag.kind, flag.needle, flag.first, flag.last) for flag in flags] == [
        (Kind.LOST, "", 2, 3),
        (Kind.INTERPOLATED, "n1_pct", 5, 7),
        (Kind.HIDDEN, "fuel_al_lb", 9, 9),
        (Kind.EDGE, "ftit_c", 12, 12),
    ]
    assert flags[0].reason == "knob not found (0.31)"
    assert "lowest score 0.50" in flags[1].reason
    assert flags[2].reason == "under fuel_fr_lb; it is given that needle's value"
    assert "or its drawing leaves it unsure" in flags[3].reason


def test_drawing_has_marks_where_the_panel_says() -> None:
    """A mark ends on the perimeter at its angle, and a needle's tip, too."""
    gauge = source().panel.gauges[0]
    drawing = panel_drawing(source(), {gauge.name: (1.0, -2.0)}).gauges[0]
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


def test_truth_gives_the_table_of_decode_accuracy(decoded: Decoded) -> None:
    """The tables are those of `decode accuracy`, with units and full scale; the truth's values are for the plots."""
    truth = read_truth(TruthRequest(FIXTURES / "thesis_a2_truth.csv", limits=True))
    section = truth_section(decoded.data, decoded.provenance, truth)
    first = dict(zip(section.tables[0].header, section.tables[0].rows[0], strict=True))

    assert (first["needle"], first["status"], first["unit"]) == ("n1_pct", "all", "%")
    assert float(first["mean%FS"]) < 0.1
    assert section.places == list(range(7))
    assert np.nanmax(np.abs(section.values["n2_pct"] - decoded.data.series[1].value)) < 1.0
    assert [table.title for table in section.tables][1:] == ["Compared with the requirements for recorders"]


def test_needle_without_a_true_value_has_no_plot_of_errors(decoded: Decoded, tmp_path: Path) -> None:
    """A column of a truth may be empty; the others are held against theirs."""
    header, *rows = csv.reader((FIXTURES / "thesis_a2_truth.csv").read_text(encoding="utf-8").splitlines())
    empty = header.index("n1_pct")
    with (tmp_path / "truth.csv").open("w", encoding="utf-8", newline="") as stream:
        csv.writer(stream).writerows([header, *([*row[:empty], "", *row[empty + 1 :]] for row in rows)])
    section = truth_section(decoded.data, decoded.provenance, read_truth(TruthRequest(tmp_path / "truth.csv")))

    assert section.places == list(range(1, 7))


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
