"""The explanation of one value, from the files written of a flight."""

from __future__ import annotations

import csv
import io
import json
import math
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from decoder.instruments.reading import Status
from decoder.learning.budget import Budget, Cause
from decoder.outputs.csv_output import write_csv
from decoder.outputs.explanation import explained, explanation_text, row_at, row_of_frame
from decoder.outputs.json_output import describe
from decoder.panel.errors import TableError
from decoder.timeseries.flight_data import FlightData
from decoder.timeseries.tables import FlightTable, Table, flight_table_of
from tests.report.reports import flight_data, make_report, source

NAME = "n1_pct"
GAP = {(NAME, row): Status.INTERPOLATED for row in range(20, 26)}


def table_of(data: FlightData, description: dict[str, Any] | None = None) -> FlightTable:
    """Flight data as they are read back."""
    text = io.StringIO()
    write_csv(data, text)
    header, *rows = csv.reader(io.StringIO(text.getvalue()))
    table = Table(Path("flight.csv"), dict(zip(header, zip(*rows, strict=True), strict=True)))
    said = describe(data, make_report(data=data).provenance) if description is None else description
    return flight_table_of(table, json.loads(json.dumps(said)))


def with_column(flight: FlightTable, column: str, texts: tuple[str, ...]) -> FlightTable:
    """Flight data with other texts in one column."""
    return replace(flight, table=replace(flight.table, columns={**flight.table.columns, column: texts}))


@pytest.fixture(scope="module")
def data() -> FlightData:
    """A flight with a gap and a lost panel, and a budget for one needle: the scale's marks get worse along it."""
    values, even = np.array([0.0, 110.0]), np.zeros(2)
    sigmas = {Cause.DRAWN: np.array([0.0, 0.11]), Cause.PIVOT: even + 0.03, Cause.VIEWED: even, Cause.PLACED: even}
    made = flight_data(source(), 60, GAP, {40: "knob not found (0.31)"})
    return replace(made, budgets={NAME: Budget(values, None, sigmas)}, health={"n1": ("turns beside its centre",)})


@given(row=st.sampled_from([0, 5, 17, 30, 59]))
def test_the_shares_add_up_to_sigma(data: FlightData, row: int) -> None:
    """In squares; the part not in the panel's budget is the frame's own."""
    told = explained(table_of(data), NAME, row)
    shares = {share.cause: share.sigma for share in told.shares}

    assert told.sigma is not None
    assert math.hypot(*shares.values()) == pytest.approx(told.sigma, rel=1e-3)
    assert sum(share.part for share in told.shares) == pytest.approx(1.0)
    assert shares["the position of its pivot"] == pytest.approx(0.03)
    assert shares["how precisely its marks and its moving part are drawn"] == pytest.approx(
        float(told.value) / 1000, rel=1e-3
    )
    assert told.low_95 == pytest.approx(float(told.value) - 1.96 * told.sigma)


def test_a_gap_is_told_with_what_was_seen_around_it(data: FlightData) -> None:
    """It says when the needle was last and next seen, and that its gauge is drawn off its pivot."""
    text = explanation_text(explained(table_of(data), NAME, 22))

    assert f"{NAME} in frame 22 (2018-05-04T12:00:05.500000Z, 5.500000 s): interpolated" in text
    assert "last seen in frame 19, at 4.750000 s" in text
    assert "next seen in frame 26, at 6.500000 s" in text
    assert "what it may have done between the frames" in text
    assert "its gauge, n1: turns beside its centre" in text


@pytest.mark.parametrize(
    ("sigma", "words"),
    [
        (0.033 * 115.0, "may be off by 6.5% of full scale or more, which alone may keep it from being `read`"),
        (0.002 * 115.0, "something may hide part of it, such as another needle, glare or a bug"),
    ],
)
def test_an_edge_says_what_makes_it_uncertain(sigma: float, words: str) -> None:
    """A large sigma, or something over it; in frames in which it is `read` neither is said."""
    flight = table_of(flight_data(source(), 60, {(NAME, 7): Status.EDGE}, {}))
    flight = with_column(flight, f"{NAME}_sigma", (f"{sigma:g}",) * 60)

    assert words in explanation_text(explained(flight, NAME, 7))
    assert words not in explanation_text(explained(flight, NAME, 8))


def test_an_edge_names_what_its_gauge_does_not_show_in_that_frame() -> None:
    """Two hands of a gauge: where one is missing, the other one's explanation says so."""
    statuses = {("fuel_al_lb", 7): Status.EDGE, ("fuel_al_lb", 8): Status.EDGE, ("fuel_fr_lb", 7): Status.MISSING}
    flight = table_of(flight_data(source(), 60, statuses, {}))

    assert "missing in this frame on the same gauge: fuel_fr_lb" in explained(flight, "fuel_al_lb", 7).remarks
    assert "on the same gauge" not in explanation_text(explained(flight, "fuel_al_lb", 8))


@pytest.mark.parametrize(
    ("score", "words"),
    [
        ("0.5769", "nothing there looked enough like it: the best match has a score of 0.5769, where 0.8 is needed"),
        ("0.9737", "what looked most like it, with a score of 0.9737, was not taken for it"),
        ("0.0000", "its gauge was not found in this frame"),
    ],
)
@pytest.mark.parametrize("status", [Status.MISSING, Status.INTERPOLATED])
def test_why_it_was_not_seen_is_told_by_what_looked_most_like_it(
    data: FlightData, score: str, words: str, status: Status
) -> None:
    """The score is that of what was refused, so it does not stand beside a value that lies on a line."""
    flight = table_of(data)
    columns = flight.table.columns
    for suffix, text in (("_score", score), ("_status", status.value)):
        flight = with_column(flight, NAME + suffix, (*columns[NAME + suffix][:8], text, *columns[NAME + suffix][9:]))
    told = explained(flight, NAME, 8)

    assert [remark for remark in told.remarks if words in remark]
    assert f", score {score}" not in explanation_text(told)


@pytest.mark.parametrize(
    ("seen", "words"),
    [
        (range(20, 60), "not interpolated: it was not seen before this frame"),
        (range(9), "not interpolated: it was not seen after this frame"),
        ((*range(9), *range(50, 60)), "not interpolated: it was seen in 19 of 60 frames"),
    ],
)
def test_why_a_missing_value_was_not_interpolated_is_told(data: FlightData, seen: Sequence[int], words: str) -> None:
    """Nothing leads beyond what was seen, and little seen tells little."""
    statuses = tuple(Status.READ.value if row in seen else Status.MISSING.value for row in range(60))

    assert [
        each
        for each in explained(with_column(table_of(data), f"{NAME}_status", statuses), NAME, 10).remarks
        if words in each
    ]


def test_a_lost_frame_is_told_with_its_reason(data: FlightData) -> None:
    """There is no value, no interval and no share, but a reason."""
    told = explained(table_of(data), NAME, 40)

    assert (told.value, told.sigma, told.low_95, told.shares) == ("", None, None, ())
    assert "the frame could not be read: knob not found (0.31)" in told.remarks


def test_what_other_instruments_say_is_told(data: FlightData) -> None:
    """A cross-check with a disagreement in this frame, and one without; not those of other columns."""
    check = {"columns": [NAME, "n2_pct"], "unit": "%", "frames_compared": 60, "disagreements": []}
    apart = {"first_frame": 3, "last_frame": 5, "apart": 4.0, "explained": 1.5}
    description = {
        "cross_checks": [
            {**check, "what": "one and two"},
            {**check, "what": "one and three", "disagreements": [apart]},
            {**check, "what": "two and three", "columns": ["n2_pct", "ftit_c"]},
        ],
        "outliers": [{"needle": NAME, "first_frame": 4, "last_frame": 4, "reason": "returns"}],
    }
    remarks = explained(table_of(data, description), NAME, 4).remarks

    assert "one and two: no disagreement here (60 frames of the flight compared)" in remarks
    assert "one and three: they differ by 4.0 % here, of which 1.5 % can be explained" in remarks
    assert "an outlier: returns" in remarks
    assert not any("two and three" in remark for remark in remarks)


def test_frames_and_times_that_are_not_there_are_refused(data: FlightData) -> None:
    """The message says which there are."""
    flight = table_of(data)

    assert row_of_frame(flight, 7) == 7
    assert row_at(flight, 1.3) == 5
    with pytest.raises(TableError, match="has no frame 99; it has 0 to 59"):
        row_of_frame(flight, 99)
    with pytest.raises(TableError, match=r"nothing at 99 s; it lasts from 0 to 14\.75 s"):
        row_at(flight, 99.0)
    with pytest.raises(TableError, match="has no speed; its columns are n1_pct"):
        explained(flight, "speed", 0)


@pytest.mark.parametrize(("column", "find"), [("frame", row_of_frame), ("time_s", row_at)])
@pytest.mark.filterwarnings("error")
def test_a_column_without_any_number_is_named(
    data: FlightData, column: str, find: Callable[[FlightTable, int], int]
) -> None:
    """No rows are assumed between two that exist."""
    blank = with_column(table_of(data), column, ("",) * len(data.frame))

    with pytest.raises(TableError, match=f"has no number in `{column}`"):
        find(blank, 3)


def test_a_row_whose_frame_was_deleted_is_refused(data: FlightData) -> None:
    """As a spreadsheet may leave it; the others are still explained."""
    flight = table_of(data)
    frames = ("", *flight.table.columns["frame"][1:])
    spoilt = with_column(flight, "frame", frames)

    assert explained(spoilt, NAME, 1).frame == 1
    with pytest.raises(TableError, match="row 1 has no number in `frame`"):
        explained(spoilt, NAME, row_at(spoilt, 0.0))


KEYS = st.sampled_from(
    [NAME, "gauge", "unit", "uncertainty", "columns", "disagreements", "first_frame", "last_frame", "needle", "turn"]
)
ANYTHING = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats(allow_nan=False) | st.text(max_size=5),
    lambda inner: st.lists(inner, max_size=3) | st.dictionaries(KEYS, inner, max_size=4),
    max_leaves=8,
)
CAUSES = ("values", "turn", *(cause.value for cause in Cause))


@given(
    said=st.fixed_dictionaries(
        dict.fromkeys(("needles", "health", "missing_frames", "outliers", "events", "cross_checks"), ANYTHING)
    ),
    budget=st.fixed_dictionaries({}, optional=dict.fromkeys(CAUSES, ANYTHING)),
)
@example(said={"needles": None}, budget={**dict.fromkeys(CAUSES, 1.0), "values": [0.0], "drawn": 10**400})
@example(said={"needles": None}, budget={**dict.fromkeys(CAUSES, 1.0), "values": [0.0], "drawn": 1e200})
@example(said={"cross_checks": [{"columns": 3}], "health": {}, "needles": {NAME: {"gauge": []}}}, budget={})
def test_a_description_that_somebody_spoilt_takes_no_value_away(
    data: FlightData, said: dict[str, Any], budget: dict[str, Any]
) -> None:
    """Whatever is in the JSON, the CSV's values are explained."""
    if not isinstance(said["needles"], dict):
        said["needles"] = {NAME: {"uncertainty": budget}}
    told = explained(table_of(data, said), NAME, 4)

    assert told.value
    assert told.status == "read"
