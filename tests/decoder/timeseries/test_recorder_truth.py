"""A recorder's table converted to the flight data's names, units and clock, and the limits set by regulators."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from datetime import UTC, datetime, timedelta
from pathlib import Path

import pytest

from decoder.panel.errors import AccuracyError, MappingError, TableError, UnitError
from decoder.timeseries.accuracy import EASA, FAA, RECORDING, Judged, Verdict, judged
from decoder.timeseries.tables import FlightTable, MappedName, Table, flight_table, read_mapping
from decoder.timeseries.truth_comparison import recorder_truth
from tests.decoder.tables import flight_of, table

BEGUN = datetime(2018, 5, 4, 23, 59, 58, tzinfo=UTC)
NEEDLES: dict[str, dict[str, object]] = {
    "ias_kt": {"unit": "kt", "scale_max": 200},
    "altitude_ft": {"unit": "ft", "scale_max": 20000},
    "heading_deg": {"unit": "deg", "scale_max": 360, "wraps": 360},
    "n1_pct": {"unit": "%", "scale_max": 115},
    "oil_temp_c": {"unit": "deg C", "scale_max": 150},
}


def flight(tmp_path: Path, values: Mapping[str, Sequence[float]]) -> FlightTable:
    """Flight data from 2018-05-04T23:59:58Z, a second each."""
    seconds = range(len(next(iter(values.values()))))
    times = {
        "frame": seconds,
        "time_utc": [(BEGUN + timedelta(seconds=second)).strftime("%Y-%m-%dT%H:%M:%SZ") for second in seconds],
        "time_s": [float(second) for second in seconds],
    }
    return flight_of(tmp_path, times, values, NEEDLES)


def test_mapped_columns_are_in_our_names_and_units(tmp_path: Path) -> None:
    """A column gets the needle's name and unit; one named like a needle stays; the rest is left out."""
    found = recorder_truth(
        flight(tmp_path, {"oil_temp_c": [1.0] * 3, "ias_kt": [1.0] * 3, "n1_pct": [1.0] * 3}),
        table(
            {"s": [0, 1, 2], "OILT": [212, "", 32], "n1_pct": ["50", "60", "70"], "IAS": [1, 2, 3], "GEAR": [0, 0, 0]}
        ),
        {"oil_temp_c": MappedName(name="OILT", unit="deg F"), "ias_kt": MappedName(name="IAS", factor=10)},
        "s",
    )

    assert set(found.columns) == {"time_s", "ias_kt", "n1_pct", "oil_temp_c"}
    assert found.numbers("oil_temp_c")[[0, 2]] == pytest.approx([100.0, 0.0])
    assert found.columns["oil_temp_c"][1] == ""
    assert found.numbers("ias_kt").tolist() == [10.0, 20.0, 30.0]
    assert found.columns["n1_pct"] == ("50", "60", "70")


@pytest.mark.parametrize(
    ("times", "seconds"),
    [
        (["0.5", "1.5", "2.5"], [0.5, 1.5, 2.5]),
        (["23:59:57", "23:59:59.5", "00:00:01"], [-1.0, 1.5, 3.0]),
        (["00:00:01", "", "00:00:03"], [3.0, None, 5.0]),
        (["2018-05-04T23:59:58Z", "2018-05-05T00:00:00.25Z", "2018-05-05T02:00:01+02:00"], [0.0, 2.25, 3.0]),
    ],
    ids=["seconds", "time of day past midnight", "the day after", "ISO 8601"],
)
@pytest.mark.parametrize("first", [0, 2])
def test_times_count_from_the_first_frame(
    tmp_path: Path, times: list[str], seconds: list[float | None], first: int
) -> None:
    """Plain seconds stay; times of day and dates are aligned with the flight's UTC, also for a part of it."""
    whole = flight(tmp_path, {"n1_pct": [1.0] * 3})
    part = Table(whole.table.path, {name: column[first:] for name, column in whole.table.columns.items()})
    found = recorder_truth(flight_table(part), table({"T": times, "n1_pct": [1, 2, 3]}), {}, "T")

    for own, wanted in zip(found.columns["time_s"], seconds, strict=True):
        assert (float(own) if own else None) == (pytest.approx(wanted) if wanted is not None else None)


@pytest.mark.parametrize(
    ("columns", "mapping", "error", "says"),
    [
        ({"T": [0]}, {"rpm": MappedName(name="T")}, AccuracyError, "has no needle rpm"),
        ({"T": [0]}, {"n1_pct": MappedName(name="N1")}, AccuracyError, "has no column N1"),
        ({"X": [0]}, {}, AccuracyError, "has no column T; name its time column with --time"),
        ({"T": [0], "N1": [1]}, {"n1_pct": MappedName(name="N1", unit="kt")}, UnitError, "there is no way"),
        ({"T": ["noon"]}, {}, TableError, "row 2: 'noon' is no time such as"),
        ({"T": ["2018-05-04T12:00:00"]}, {}, TableError, "does not say which zone"),
    ],
)
def test_what_cannot_be_matched_says_why(
    tmp_path: Path,
    columns: Mapping[str, Sequence[object]],
    mapping: Mapping[str, MappedName],
    error: type[Exception],
    says: str,
) -> None:
    """One sentence names the needle, the column or the row."""
    with pytest.raises(error, match=says):
        recorder_truth(flight(tmp_path, {"n1_pct": [1.0]}), table(columns), mapping, "T")


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("- ias", "must be a name"),
        ("ias: {column: IAS}", "ias"),
        ("ias: {name: IAS, factor: 0}", "ias"),
        ("ias: {", "is not YAML"),
        (None, "cannot be read"),
    ],
)
def test_wrong_mapping_file_says_where(tmp_path: Path, text: str | None, says: str) -> None:
    """The file and the needle whose entry is wrong."""
    path = tmp_path / "names.yaml"
    if text is not None:
        path.write_text(text)
    with pytest.raises(MappingError, match=says) as refused:
        read_mapping(path)

    assert str(path) in str(refused.value)


def judge(tmp_path: Path, name: str, truth: Sequence[float], shown: Sequence[float]) -> dict[str, Judged]:
    """The judgements of one needle by source."""
    results = judged(flight(tmp_path, {name: shown}), table({"time_s": range(len(truth)), name: truth}))
    return {result.source: result for result in results}


@pytest.mark.parametrize(
    ("name", "truth", "off", "faa", "easa", "half"),
    [
        ("ias_kt", 100.0, 4.9, Verdict.PASS, Verdict.DEPENDS, Verdict.PASS),
        ("ias_kt", 100.0, 9.9, Verdict.PASS, Verdict.FAIL, Verdict.FAIL),
        ("ias_kt", 100.0, 10.1, Verdict.FAIL, Verdict.FAIL, Verdict.FAIL),
        ("ias_kt", 0.0, 0.9, Verdict.PASS, Verdict.PASS, Verdict.PASS),
        ("altitude_ft", 5000.0, 300.0, Verdict.DEPENDS, Verdict.DEPENDS, None),
        ("altitude_ft", 5000.0, 701.0, Verdict.FAIL, Verdict.FAIL, None),
        ("heading_deg", 359.0, 1.9, Verdict.PASS, Verdict.PASS, Verdict.PASS),
        ("heading_deg", 1.0, -4.9, Verdict.PASS, Verdict.FAIL, Verdict.FAIL),
        ("n1_pct", 50.0, 2.4, Verdict.PASS, Verdict.FAIL, Verdict.PASS),
    ],
)
def test_verdict_is_by_the_published_limits(
    tmp_path: Path, name: str, truth: float, off: float, faa: Verdict, easa: Verdict, half: Verdict | None
) -> None:
    """Errors just within and just beyond each limit, or the half of it; a compass goes the short way round."""
    turn = 360.0 if name == "heading_deg" else 1e9
    found = judge(tmp_path, name, [truth] * 20, [(truth + off) % turn] * 20)

    assert (found[FAA].verdict, found[EASA].verdict) == (faa, easa)
    assert (found[RECORDING].verdict if RECORDING in found else None) == half
    assert found[FAA].worst == pytest.approx(abs(off))


def test_one_value_in_twenty_may_be_off(tmp_path: Path) -> None:
    """95 % of the values decide."""
    shown = [100.0] * 19
    assert judge(tmp_path, "ias_kt", [100.0] * 20, [*shown, 150.0])[FAA].verdict is Verdict.PASS
    assert judge(tmp_path, "ias_kt", [100.0] * 20, [*shown[1:], 150.0, 150.0])[FAA].verdict is Verdict.FAIL
