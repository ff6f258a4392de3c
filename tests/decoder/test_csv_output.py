"""`RECORDING.csv`: the columns, the numbers and the bytes of the contract."""

from __future__ import annotations

import csv
import io
import re
from collections.abc import Callable, Mapping
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from decoder.csv_output import utc_text, value_decimals, write_csv
from decoder.flight_data import FlightData
from decoder.gaps import fill_gaps
from decoder.reading import Reading, Status

Fly = Callable[..., FlightData]
HEADER = (
    "frame,time_utc,time_s,"
    "speed_kt,speed_kt_status,speed_kt_score,speed_kt_sigma,"
    "al_lb,al_lb_status,al_lb_score,al_lb_sigma,"
    "fr_lb,fr_lb_status,fr_lb_score,fr_lb_sigma"
)
STATUSES = st.sampled_from([Status.READ, Status.EDGE, Status.HIDDEN, Status.MISSING])


def text_of(data: FlightData) -> str:
    """The CSV of flight data."""
    stream = io.StringIO(newline="")
    write_csv(data, stream)
    return stream.getvalue()


@pytest.fixture
def flight(fly: Fly) -> FlightData:
    """Four frames: a good one, one with a refused reading, one without panel, a good one."""
    bad = Reading(Status.MISSING, 333.0, 0.5, 0.41234)
    still = {name: Reading(Status.READ, 200.0, 0.02, 0.98765) for name in ("speed_kt", "al_lb", "fr_lb")}
    frames: list[Mapping[str, Reading] | str] = [still, still | {"al_lb": bad}, "anchor knob not found", still]
    return fill_gaps(fly(frames))


def test_header_is_the_contract(flight: FlightData) -> None:
    """Frame and times, then for each needle value, status, score and sigma, in the panel's order."""
    assert text_of(flight).splitlines()[0] == HEADER


def test_rows_are_the_contract(flight: FlightData) -> None:
    """One row for each frame, the missing one too, its fields empty."""
    rows = list(csv.DictReader(io.StringIO(text_of(flight))))

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


def test_lines_end_with_a_line_feed(flight: FlightData) -> None:
    """LF alone, after the last line too."""
    text = text_of(flight)

    assert "\r" not in text
    assert text.endswith("\n")
    assert text.count("\n") == 5


def test_same_flight_gives_the_same_bytes(flight: FlightData) -> None:
    """Writing twice gives the same text."""
    assert text_of(flight) == text_of(flight)


def test_flight_without_frames_is_a_header(fly: Fly) -> None:
    """Nothing recorded gives the header alone."""
    assert text_of(fly([])) == HEADER + "\n"


@given(
    rows=st.lists(st.tuples(st.floats(100.0, 440.0), STATUSES, st.floats(0.0, 5.0), st.floats(-1.0, 1.0)), max_size=8)
)
def test_numbers_have_a_point_and_come_back(fly: Fly, rows: list[tuple[float, Status, float, float]]) -> None:
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


def test_value_that_rounds_to_a_full_turn_is_written_as_nothing(fly: Fly, document: dict[str, Any]) -> None:
    """A heading lies in [0, 360) in the file as well."""
    document["gauges"][0] |= {"sweep": [270, 630], "scale": [[270, 0], [450, 180]], "wraps": 360}
    reading = Reading(Status.READ, 629.99999, 0.02, 0.99)
    text = text_of(fly([{"speed_kt": reading}], content=document))

    assert text.splitlines()[1].split(",")[3] == "0.000"


@pytest.mark.parametrize(
    ("full_scale", "decimals"), [(0.01, 7), (1.0, 5), (9.9, 5), (10.0, 4), (1000.0, 2), (84000.0, 1), (1e9, 1)]
)
def test_small_scales_lose_no_digits(fly: Fly, document: dict[str, Any], full_scale: float, decimals: int) -> None:
    """Values have six digits of full scale, and always at least one decimal."""
    document["gauges"][0]["scale"] = [[120, 0], [420, full_scale]]

    assert value_decimals(fly([], content=document).series[0]) == decimals


@pytest.mark.parametrize(
    ("time_ns", "text"),
    [
        (0, "1970-01-01T00:00:00.000000Z"),
        (1_525_435_200_000_000_999, "2018-05-04T12:00:00.000000Z"),
        (1_525_435_200_999_999_999, "2018-05-04T12:00:00.999999Z"),
        (951_782_400_000_001_000, "2000-02-29T00:00:00.000001Z"),
    ],
)
def test_time_is_utc_to_the_microsecond(time_ns: int, text: str) -> None:
    """Whatever the machine's own time zone, times are UTC, cut to microseconds."""
    assert utc_text(time_ns) == text
