"""Accuracy: known errors give known tables."""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import pytest

from decoder.panel.errors import TableError
from decoder.timeseries.accuracy import NeedleAccuracy, compare
from decoder.timeseries.tables import flight_table, read_table
from tests.decoder.tables import table

FLIGHT: dict[str, Any] = {
    "frame": [0, 1, 2, 3],
    "time_s": [0.0, 1.0, 2.0, 3.0],
    "n1": [10.1, 20.0, 29.7, 40.8],
    "n1_status": ["read", "read", "edge", "interpolated"],
    "n1_score": [0.9, 0.9, 0.9, 0.5],
    "n1_sigma": [0.1, 0.1, 0.1, 0.1],
}
TRUTH: dict[str, Any] = {"frame": [0, 1, 2, 3], "n1": [10.0, 20.0, 30.0, 40.0]}


def compared(flight: Mapping[str, Any], truth: Mapping[str, Any]) -> NeedleAccuracy:
    """The accuracy of the only needle."""
    (result,) = compare(flight_table(table(flight)), table(truth))
    return result


def test_known_errors_give_known_numbers() -> None:
    """Errors of +1, 0, -1 and +2 percent: means, signed means and maxima are theirs, of all and of each status."""
    by_status = compared(FLIGHT, TRUTH).by_status
    errors = by_status["all"]

    assert {kind: each.frames for kind, each in by_status.items()} == {
        "all": 4,
        "read": 2,
        "edge": 1,
        "interpolated": 1,
    }
    assert errors.mean_abs == pytest.approx(0.3)
    assert errors.mean_signed == pytest.approx(0.15)
    assert errors.max_abs == pytest.approx(0.8)
    assert errors.mean_abs_pct == pytest.approx(1.0)
    assert errors.mean_signed_pct == pytest.approx(0.5)
    assert errors.max_abs_pct == pytest.approx(2.0)
    assert errors.mean_abs_pct_fs is None
    assert errors.within_95 == 0.5  # of errors of 0.1, 0, 0.3 and 0.8 at a sigma of 0.1
    assert by_status["edge"].mean_signed_pct == pytest.approx(-1.0)


@pytest.mark.parametrize(
    ("read", "true", "mean_pct", "max_pct"),
    [
        ([10.1, 20.0, 29.7, 40.8], [0, 20, 30, 40], 1.0, 2.0),
        ([10.1, 20.0, 29.7, 40.8], [0, 0, 0, 0], None, None),
        ([-10.1, -20.2, -29.7, -40.0], [-10, -20, -30, -40], 0.75, 1.0),
    ],
    ids=["zero once", "zero alone", "negative"],
)
def test_percent_of_reading(
    read: list[float], true: list[float], mean_pct: float | None, max_pct: float | None
) -> None:
    """If the truth is 0 there is none, though the error in units counts; for a negative truth it is positive."""
    errors = compared(FLIGHT | {"n1": read}, TRUTH | {"n1": true}).by_status["all"]

    assert errors.frames == 4
    assert (errors.mean_abs_pct, errors.max_abs_pct) == (
        (None, None) if mean_pct is None else pytest.approx((mean_pct, max_pct))
    )


@pytest.mark.parametrize(
    ("truth", "frames", "mean_abs"),
    [
        ({"frame": [3, 2, 1, 0], "time_s": [0.0, 1.0, 2.0, 3.0], "n1": [40.0, 30.0, 20.0, 10.0]}, 4, 0.3),
        ({"frame": [1, 2, 9], "n1": [20.0, "", 7.0]}, 1, 0.0),
        ({"time_s": [-1.0, 0.5, 4.0], "n1": [0.0, 15.0, 50.0]}, 4, 0.3),
        ({"time_s": [0.9, 2.1], "n1": [19.0, 31.0]}, 2, 0.15),
    ],
    ids=["by frame before time", "no row or no number", "on the line between rows", "not beyond the first and last"],
)
def test_truth_of_a_frame(truth: Mapping[str, Any], frames: int, mean_abs: float) -> None:
    """By frame numbers where both have them, else by time; without truth nothing is compared."""
    result = compared(FLIGHT, truth)

    assert result.frames_compared == frames
    assert result.by_status["all"].mean_abs == pytest.approx(mean_abs)


def test_errors_go_the_short_way_round_a_turn(tmp_path: Path) -> None:
    """359 read for 1 is two degrees off, not 358, and truth between frames does not run backwards through the dial."""
    path = tmp_path / "flight.csv"
    needle = {"unit": "deg", "scale_min": 0.0, "scale_max": 360.0, "wraps": 360.0}
    path.with_suffix(".json").write_text(json.dumps({"needles": {"n1": needle}}), encoding="utf-8")
    flight = {name: values for name, values in FLIGHT.items() if name != "frame"} | {"n1": [359.0, 1.0, 0.5, 100.0]}
    truth = {"time_s": [0.0, 1.0, 1.5, 3.0], "n1": [1.0, 359.0, 359.0, 2.0]}
    (result,) = compare(flight_table(table(flight, path)), table(truth))

    assert result.by_status["all"].mean_signed == pytest.approx((-2.0 + 2.0 + 0.5 + 98.0) / 4)
    assert result.by_status["read"].max_abs == pytest.approx(2.0)
    assert result.by_status["read"].max_abs_pct_fs == pytest.approx(2.0 / 3.6)


@pytest.mark.parametrize("text", ["", "null", '{"needles": []}', '{"needles": {"n1": 7}}'])
def test_json_that_is_something_else_is_left_aside(tmp_path: Path, text: str) -> None:
    """A JSON beside the flight data that is not its description only costs the percentages of full scale."""
    (tmp_path / "flight.json").write_text(text)
    (result,) = compare(flight_table(table(FLIGHT, tmp_path / "flight.csv")), table(TRUTH))

    assert (result.full_scale, result.by_status["all"].mean_abs_pct_fs) == (None, None)


def test_table_is_read_by_column(tmp_path: Path) -> None:
    """Columns keep their text; numbers are read where asked for, else NaN; a byte order mark is no name."""
    (tmp_path / "flight.csv").write_bytes(b"\xef\xbb\xbfframe,n1\r\n0,1.5\r\n\r\n1,\r\n2,many\r\n")
    read = read_table(tmp_path / "flight.csv")

    assert read.columns == {"frame": ("0", "1", "2"), "n1": ("1.5", "", "many")}
    assert str(read.numbers("n1").tolist()) == "[1.5, nan, nan]"


@pytest.mark.parametrize(
    ("content", "problem"),
    [
        (None, "cannot be read as CSV"),
        (b"frame,n1\n", "has no rows"),
        (b"frame,n1\n0,1,2\n", "its rows are not all as long as its header"),
        (b"\xff\xfe\x00frame", "is not text, and so no table; give the CSV of the same name"),
    ],
    ids=["no file", "header alone", "long row", "not text"],
)
def test_file_that_is_no_table_is_refused(tmp_path: Path, content: bytes | None, problem: str) -> None:
    """One sentence names the file and what is wrong with it."""
    path = tmp_path / "truth.csv"
    if content is not None:
        path.write_bytes(content)
    with pytest.raises(TableError) as refused:
        read_table(path)

    assert str(refused.value).startswith(f"{path}: ")
    assert problem in str(refused.value)


@pytest.mark.parametrize(
    ("flight", "truth", "problem"),
    [
        (TRUTH, TRUTH, "is no flight data"),
        (FLIGHT, {"frame": [0], "n2": [1]}, "has none of the needles n1"),
        (FLIGHT, {"frame": [7, 8], "n1": [1, 2]}, "none of its rows belongs to a frame"),
        (FLIGHT, {"second": [0], "n1": [1]}, "has neither a `frame` nor a `time_s` column"),
        (FLIGHT, {"time_s": [2.0, 1.0], "n1": [1, 2]}, "`time_s` must rise"),
        (FLIGHT, {"time_s": ["", "x"], "n1": [1, 2]}, "`time_s` must rise"),
    ],
)
def test_tables_that_do_not_fit_are_refused(flight: Mapping[str, Any], truth: Mapping[str, Any], problem: str) -> None:
    """Flight data and truth that cannot be compared say why."""
    with pytest.raises(TableError, match=problem):
        compare(flight_table(table(flight)), table(truth))
