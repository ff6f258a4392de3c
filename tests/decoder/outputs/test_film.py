"""Films: when frames are shown, where readings are drawn, and flight data read back to draw them."""

from __future__ import annotations

import io
import json
import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from decoder.imaging.alignment import Alignment
from decoder.instruments.reading import Status
from decoder.outputs.csv_output import read_back, write_alignment, write_csv
from decoder.outputs.drawn_readings import STATUS_COLOURS, ReadingPlaces
from decoder.outputs.film import TICKS_PER_S, FilmClock, FilmPainter, drawn_film
from decoder.outputs.frame_picture import CAP, matched_frames
from decoder.outputs.json_output import describe
from decoder.timeseries.flight_data import AlignmentSeries
from decoder.timeseries.tables import flight_table, read_table
from tests.report.reports import make_report, source

NS = 1_000_000_000
STATUSES = [Status.READ, Status.EDGE, Status.HIDDEN, Status.INTERPOLATED]


FORWARD_NS = st.integers(12_000, 20_000 * NS)
WRONG_NS = st.integers(-(10**16), 5_000) | st.integers(24_000 * NS, 10**16)


@given(st.lists(FORWARD_NS | WRONG_NS, min_size=1, max_size=30))
def test_a_film_runs_forward_whatever_the_clock_did(steps_ns: list[int]) -> None:
    """Each frame is later than the one before by the clock, if possible, otherwise by the previous step."""
    clock = FilmClock()
    taken_ns = 1_500_000_000 * NS + np.cumsum([0, *steps_ns])
    shown = [clock.tick(each) for each in taken_ns.tolist()]
    believed_ns = [NS // 25]
    for step_ns in steps_ns:
        believed_ns.append(step_ns if 12_000 <= step_ns <= 20_000 * NS else believed_ns[-1])

    assert shown == pytest.approx(np.cumsum([0, *believed_ns[1:]]) * (TICKS_PER_S / NS), abs=1)
    assert all(np.diff(shown) > 0)
    assert clock.jumps == sum(not 12_000 <= step_ns <= 20_000 * NS for step_ns in steps_ns)


@pytest.mark.parametrize("status", STATUSES)
def test_a_reading_is_drawn_where_it_points_in_the_colour_of_its_status(status: Status) -> None:
    """Outside the rim, on the line from pivot to tip, and in the strip, whose other cells keep theirs."""
    report = make_report(3, {("n1_pct", 1): status})
    painter = FilmPainter(report, (900, 674))
    picture = np.full((674, 900, 3), 90, np.uint8)
    drawn = painter.painted(1, picture)
    (gauge,) = (one for one in ReadingPlaces(source(), report.data).frame(1) if one.name == "n1")
    line = gauge.readings[0].line_px
    assert line is not None
    reach = sum(CAP) / 2
    x, y = (round(pivot + (tip - pivot) * reach) for pivot, tip in zip(gauge.pivot_px, line[1], strict=True))

    assert tuple(drawn[y, x]) == STATUS_COLOURS[status]
    in_strip = (drawn[674:] == STATUS_COLOURS[status]).all(axis=2).sum()
    before = (painter.painted(0, picture)[674:] == STATUS_COLOURS[status]).all(axis=2).sum()
    assert in_strip > before or status is Status.READ
    assert drawn.shape[0] % 2 == 0


def test_every_picture_of_a_film_has_the_size_of_the_first() -> None:
    """A larger frame, one of another shape, and one that is damaged."""
    report = make_report(4, lost={2: "knob not found (0.31)"})
    painter = FilmPainter(report, (900, 674))
    given_px = [(674, 900, 3), (1348, 1800, 3), (900, 674, 3), None]
    pictures = [None if each is None else np.zeros(each, np.uint8) for each in given_px]

    assert len({painter.painted(row, picture).shape for row, picture in enumerate(pictures)}) == 1


def test_a_clock_that_was_set_is_told() -> None:
    """Once, with the number of times; every frame is in the film."""
    data = make_report(6).data
    report = make_report(data=replace(data, time_ns=data.time_ns - 10**12 * (np.arange(6) // 3)))
    told: list[str] = []
    shown = list(drawn_film(report, enumerate(matched_frames(report.data, report.frames)), 240, told.append))

    assert told == ["after 1 of the frames the clock goes back, or on by hours: the film goes on steadily"]
    assert [each.tick for each in shown] == [place * TICKS_PER_S // 4 for place in range(6)]
    assert shown[0].picture.shape[:2] == (shown[5].picture.shape[0], 320)


def test_flight_data_are_read_back_as_they_were_written(tmp_path: Path) -> None:
    """Values, statuses, sigmas, times, lost frames with their reasons, and where the panel lay."""
    report = make_report(30, {("n1_pct", 3): Status.HIDDEN, ("ftit_c", 9): Status.MISSING}, {5: "gone", 6: "gone"})
    alignments = AlignmentSeries()
    for row in range(30):
        if row in (5, 6):
            alignments.add_missing(["knob"])
        else:
            alignments.add(
                Alignment.of(np.array([[1, 0.02, row], [-0.03, 1.1, 7.123456], [1e-5 * row, -4e-5, 1]]), 0.9)
            )
    data, size_px = replace(report.data, alignments=alignments), source().optics.size_px
    table, placed = io.StringIO(), io.StringIO()
    write_csv(data, table)
    write_alignment(data, size_px, placed)
    (tmp_path / "flight.csv").write_text(table.getvalue(), encoding="utf-8")
    (tmp_path / "flight_alignment.tsv").write_text(placed.getvalue(), encoding="utf-8")
    (tmp_path / "flight.json").write_text(json.dumps(describe(data, report.provenance)), encoding="utf-8")
    back = read_back(
        flight_table(read_table(tmp_path / "flight.csv")),
        read_table(tmp_path / "flight_alignment.tsv", "\t"),
        source().panel,
        size_px,
        {},
    )

    assert back.frame.tolist() == data.frame.tolist()
    assert back.time_ns.tolist() == data.time_ns.tolist()
    assert back.missing_frames == data.missing_frames
    for own, written in zip(back.series, data.series, strict=True):
        assert own.quantity == written.quantity
        assert own.status.tolist() == written.status.tolist()
        np.testing.assert_allclose(own.value, written.value, atol=written.quantity.full_scale * 1e-5)
        np.testing.assert_allclose(own.sigma, written.sigma, atol=written.quantity.full_scale * 1e-6)
    for row in range(30):
        one, other = back.alignments[row], data.alignments[row]
        assert (one is None) == (other is None) == (row in (5, 6))
        if one is not None and other is not None:
            assert math.dist(one.to_frame((800.0, 600.0)), other.to_frame((800.0, 600.0))) < 1e-4
