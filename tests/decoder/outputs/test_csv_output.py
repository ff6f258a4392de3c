"""`RECORDING.csv`: the columns, the numbers and the bytes of the contract; and tables for people."""

from __future__ import annotations

import csv
import io
import json
import re
from collections.abc import Mapping
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from decoder.imaging.alignment import Alignment
from decoder.instruments.reading import FrameReadings, Reading, Status
from decoder.outputs.csv_output import COLUMNS, text_table, utc_text, value_decimals, write_alignment, write_csv
from decoder.outputs.json_output import Provenance, SourceFile, describe
from decoder.panel.panel import Panel
from decoder.timeseries.flight_data import FlightData, FlightDataBuilder
from decoder.timeseries.gaps import fill_gaps
from tests.decoder.cockpit import fly
from tests.decoder.registration.plane import panel_of

HEADER = (
    "frame,time_utc,time_s,"
    "speed_kt,speed_kt_status,speed_kt_score,speed_kt_sigma,"
    "al_lb,al_lb_status,al_lb_score,al_lb_sigma,"
    "fr_lb,fr_lb_status,fr_lb_score,fr_lb_sigma"
)
CELLS = st.from_regex(r"\A[a-z0-9.%-]{1,12}\Z")
STATUSES = st.sampled_from([Status.READ, Status.EDGE, Status.HIDDEN, Status.MISSING])


def text_of(data: FlightData) -> str:
    """The CSV of flight data."""
    stream = io.StringIO(newline="")
    write_csv(data, stream)
    return stream.getvalue()


@pytest.fixture
def flight() -> FlightData:
    """Four frames: a good one, one with a refused reading, one without panel, a good one."""
    bad = Reading(Status.MISSING, 333.0, 0.5, 0.41234)
    still = {name: Reading(Status.READ, 200.0, 0.02, 0.98765) for name in ("speed_kt", "al_lb", "fr_lb")}
    frames: list[Mapping[str, Reading] | str] = [still, still | {"al_lb": bad}, "anchor knob not found", still]
    return fill_gaps(fly(frames))


def test_rows_are_the_contract(flight: FlightData) -> None:
    """A header, then a row for each frame, the missing one too, its fields empty; each ends with a line feed."""
    lines = text_of(flight).split("\n")
    rows = list(csv.DictReader(io.StringIO(text_of(flight))))

    assert (lines[0], len(lines), lines[-1]) == (HEADER, 6, "")
    assert "\r" not in text_of(flight)
    assert [row["frame"] for row in rows] == ["0", "1", "2", "3"]
    assert [row["time_s"] for row in rows] == ["0.000000", "0.500000", "1.000000", "1.500000"]
    assert rows[1]["time_utc"] == "2018-05-04T12:00:00.500000Z"
    assert [row["al_lb_status"] for row in rows] == ["read", "interpolated", "missing", "read"]
    assert [row["al_lb_score"] for row in rows] == ["0.9877", "0.4123", "", "0.9877"]
    assert float(rows[1]["al_lb"]) == pytest.approx(800.0)
    assert (rows[2]["al_lb"], rows[2]["al_lb_sigma"], rows[2]["speed_kt"], rows[2]["speed_kt_status"]) == (
        "",
        "",
        "",
        "missing",
    )


@given(
    rows=st.lists(st.tuples(st.floats(100.0, 440.0), STATUSES, st.floats(0.0, 5.0), st.floats(-1.0, 1.0)), max_size=8)
)
def test_numbers_have_a_point_and_come_back(rows: list[tuple[float, Status, float, float]]) -> None:
    """Every number has a decimal point and no exponent, and is the value to six digits of full scale."""
    data = fly([{"speed_kt": Reading(status, angle, sigma, score)} for angle, status, sigma, score in rows])
    read = list(csv.DictReader(io.StringIO(text_of(data))))

    for row, value, sigma in zip(read, data.series[0].value, data.series[0].sigma, strict=True):
        fields = [row["time_s"], row["speed_kt"], row["speed_kt_score"], row["speed_kt_sigma"]]
        assert all(re.fullmatch(r"(-?\d+\.\d+)?", field) for field in fields)
        assert bool(row["speed_kt"]) == (row["speed_kt_status"] != "missing")
        if row["speed_kt"]:
            assert float(row["speed_kt"]) == pytest.approx(value, abs=6e-3)
            assert float(row["speed_kt_sigma"]) == pytest.approx(sigma, abs=1e-3)


def test_value_that_rounds_to_a_full_turn_is_written_as_nothing(document: dict[str, Any]) -> None:
    """A heading lies in [0, 360) in the file as well."""
    document["gauges"][0] |= {"sweep": [270, 630], "scale": [[270, 0], [450, 180]], "wraps": 360}
    reading = Reading(Status.READ, 629.99999, 0.02, 0.99)
    text = text_of(fly([{"speed_kt": reading}], content=document))

    assert text.splitlines()[1].split(",")[3] == "0.000"


@pytest.mark.parametrize(("full_scale", "decimals"), [(0.01, 7), (9.9, 5), (10.0, 4), (1e9, 1)])
def test_small_scales_lose_no_digits(document: dict[str, Any], full_scale: float, decimals: int) -> None:
    """Values have six digits of full scale, and always at least one decimal."""
    document["gauges"][0]["scale"] = [[120, 0], [420, full_scale]]

    assert value_decimals(fly([], content=document).series[0]) == decimals


def test_drums_that_roll_are_written_finer_than_their_last_digit(document: dict[str, Any]) -> None:
    """Six of them count to a million tenths, but the last one is read to a hundredth of its turn."""
    drums = {"name": "hobbs_h", "pattern": "00000.0", "shows": "07998.59", "rolls": "up", "pitch": 20}
    window = [[10, 10], [90, 10], [90, 30], [10, 30]]
    document["gauges"].append({"name": "hobbs", "window": window, "printed": drums})
    (series,) = (each for each in fly([], content=document).series if each.quantity.name == "hobbs_h")

    assert value_decimals(series) == 4


@pytest.mark.parametrize(
    ("time_ns", "text"),
    [
        (1_525_435_200_000_000_999, "2018-05-04T12:00:00.000000Z"),
        (1_525_435_200_999_999_999, "2018-05-04T12:00:00.999999Z"),
        (951_782_400_000_001_000, "2000-02-29T00:00:00.000001Z"),
    ],
)
def test_time_is_utc_to_the_microsecond(time_ns: int, text: str) -> None:
    """Whatever the machine's own time zone, times are UTC, cut to microseconds."""
    assert utc_text(time_ns) == text


@given(
    rows=st.integers(1, 5).flatmap(lambda width: st.lists(st.lists(CELLS, min_size=width, max_size=width), min_size=1))
)
@settings(max_examples=20)
def test_cells_come_back_and_end_in_line(rows: list[list[str]]) -> None:
    """Splitting a line at blanks gives its cells, and all but the first end where their column's rule ends."""
    header, rule, *lines = text_table(rows[0], rows[1:]).splitlines()
    ends = [place for place in range(1, len(rule) + 1) if rule[place - 1] == "-" and rule[place : place + 1] != "-"]

    assert [line.split() for line in (header, *lines)] == rows
    for line in (header, *lines):
        assert not line.endswith(" ")
        assert all(line[end - 1] != " " for end in ends[1:])


SIZE_PX = (640, 480)
READ = {"speed_kt": Reading(Status.READ, 200.0, 0.02, 0.99)}


def flight_of(panel: Panel) -> FlightData:
    """One frame as it was drawn, one that moved under a hand, one that was lost, one that was damaged."""
    builder = FlightDataBuilder(panel)
    builder.add(0, 0, FrameReadings(Alignment.rigid(0.0, (0.0, 0.0), 0.99), READ))
    moved = Alignment((1.02, 0.0, 1.61, 0.0, 1.02, -6.79, 0.0, 0.0, 1.0), 0.91, ("north", "level"))
    builder.add(1, 10**9, FrameReadings(moved, READ))
    builder.add_missing(2, 2 * 10**9, "anchor north not found (score 0.10)", ("north", "south"))
    builder.add_missing(4, 4 * 10**9, "the picture is damaged or cut short")
    return builder.build(lambda _, angles_deg: np.zeros_like(angles_deg))


def test_rows_tell_score_failures_and_motion() -> None:
    """Shift, roll and scale are at the picture's middle; lost frames name what was not found; the JSON counts them."""
    text = io.StringIO()
    data = flight_of(panel_of(("north", "south")))
    write_alignment(data, SIZE_PX, text)
    rows = list(csv.reader(io.StringIO(text.getvalue()), delimiter="\t"))

    assert rows == [
        list(COLUMNS),
        ["0", utc_text(0), "0.9900", "", "0.000", "0.000", "0.0000", "1.000000", "1 0 0 0 1 0 0 0 1"],
        [
            "1",
            utc_text(10**9),
            "0.9100",
            "north;level",
            "8.000",
            "-2.000",
            "0.0000",
            "1.020000",
            "1.02 0 1.61 0 1.02 -6.79 0 0 1",
        ],
        ["2", utc_text(2 * 10**9), "", "north;south", "", "", "", "", ""],
        ["4", utc_text(4 * 10**9), "", "", "", "", "", "", ""],
    ]
    described = describe(data, Provenance("r", "s", "m", (), SourceFile("panel.yaml", "0"), None, ()))
    assert described["failed_anchors"] == {"level": 1, "north": 2, "south": 1}
    json.dumps(described, allow_nan=False)
