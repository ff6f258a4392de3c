"""The G1000 log: what goes into which column at which second, and what does not."""

from __future__ import annotations

import io
from collections.abc import Mapping, Sequence
from pathlib import Path

import pytest

from decoder.outputs.garmin_output import column_of, plan, write_garmin
from decoder.panel.errors import OutputError, UnitError
from decoder.panel.kinds.attitude import Attitude
from decoder.timeseries.tables import FlightTable, MappedName
from tests.decoder.tables import flight_of

FLOWN = {
    "asi_kt": ("kt", "IAS"), "alt_ft": ("ft", "AltB"), "vsi_fpm": ("fpm", "VSpd"), "heading_deg": ("deg", "HDG"),
    "roll_deg": ("deg", "Roll"), "pitch_deg": ("deg", "Pitch"),
}  # fmt: skip
OTHERS = {"airspeed_kt": "kt", "oil_temp_c": "deg C", "fuel_flow_pph": "pph", "n1_pct": "%", "hi_heading_deg": "deg"}
UNITS = {name: unit for name, (unit, _) in FLOWN.items()} | OTHERS


def flight(tmp_path: Path, columns: Mapping[str, Sequence[object]], times_s: Sequence[float]) -> FlightTable:
    """Flight data from noon on, with values by needle."""
    times = {
        "frame": range(len(times_s)),
        "time_utc": [f"2018-05-04T12:00:{time_s:09.6f}Z" for time_s in times_s],
        "time_s": times_s,
    }
    return flight_of(tmp_path, times, columns, {name: {"unit": UNITS[name]} for name in columns})


def log(found: FlightTable, mapping: Mapping[str, MappedName] | None = None) -> list[str]:
    """The log's lines."""
    stream = io.StringIO()
    write_garmin(found, plan(found, mapping or {}).chosen, stream)
    return stream.getvalue().splitlines()


@pytest.mark.parametrize(
    ("name", "column"),
    [
        ("ias", "IAS"),
        ("altitude_ft", "AltB"),
        ("rpm", "E1 RPM"),
        ("oil_temp_2_c", "E2 OilT"),
        ("Heading_deg", "HDG"),
        ("oil_temp_3_c", None),
        ("altitude_100s_ft", None),
        ("n1_pct", None),
    ],
)
def test_name_tells_the_column(name: str, column: str | None) -> None:
    """Stem, engine and unit are distinguished; a value for which a G1000 has no column is left out."""
    found = column_of(name)

    assert (found and found.name) == column


def test_an_aircrafts_attitude_and_what_its_six_instruments_show_are_all_there(tmp_path: Path) -> None:
    """By the names that an attitude gauge and the other five have; signs are kept: left wing down, nose down."""
    shown = dict(zip(FLOWN, (75.0, 1676.0, -225.0, 334.2, -12.5, -3.5), strict=True))

    assert {"roll_deg", "pitch_deg"} <= set((Attitude.form.begun or {}).values())
    lines = log(flight(tmp_path, {name: [value] for name, value in shown.items()}, [0.0]))
    row = dict(zip((name.strip() for name in lines[2].split(",")), lines[3].split(","), strict=True))
    assert {column: float(row[column]) for _, column in FLOWN.values()} == {
        FLOWN[name][1]: value for name, value in shown.items()
    }


def test_bank_of_a_ring_that_counts_to_360_is_signed(tmp_path: Path) -> None:
    """As a G1000 writes it: 357.5 is two and a half degrees of left wing down; a heading stays."""
    lines = log(flight(tmp_path, {"roll_deg": [357.5, 20.0], "heading_deg": [357.5, 20.0]}, [0.0, 1.0]))
    rows = [[float(cell) for cell in line.split(",")[6:]] for line in lines[3:]]

    assert rows == [[-2.5, 357.5], [20.0, 20.0]]


def test_last_word_of_a_name_tells_the_column_that_no_other_has(tmp_path: Path) -> None:
    """Of two headings, the log has the one whose whole name is that."""
    alone = plan(flight(tmp_path, {"hi_heading_deg": [10.0]}, [0.0]), {})
    beside = plan(flight(tmp_path, {"hi_heading_deg": [10.0], "heading_deg": [20.0]}, [0.0]), {})

    assert [(one.needle, one.column.name) for one in alone.chosen] == [("hi_heading_deg", "HDG")]
    assert [one.needle for one in beside.chosen] == ["heading_deg"]
    assert "hi_heading_deg" in beside.left_out


def test_head_is_that_of_a_garmin(tmp_path: Path) -> None:
    """The three lines that readers check byte for byte, the columns in order, position empty."""
    lines = log(flight(tmp_path, {"oil_temp_c": [100.0], "airspeed_kt": [87.45]}, [0.0]))

    assert lines[0].startswith("#airframe_info, log_version=")
    assert 'airframe_name="demo"' in lines[0]
    assert lines[1].startswith("#yyy-mm-dd, hh:mm:ss,   hh:mm, ")
    assert lines[2].startswith("  Lcl Date, Lcl Time, UTCOfst, ")
    assert [cell.strip() for cell in lines[2].split(",")] == [
        "Lcl Date", "Lcl Time", "UTCOfst", "AtvWpt", "Latitude", "Longitude", "IAS", "E1 OilT",
    ]  # fmt: skip
    assert [cell.strip() for cell in lines[3].split(",")] == [
        "2018-05-04", "12:00:00", "+00:00", "", "", "", "87.5", "212.0",
    ]  # fmt: skip


def test_second_has_its_nearest_frame(tmp_path: Path) -> None:
    """If it is within half a second and was read, since a log cannot say `interpolated`; no second is missing."""
    values = [1.0, 2.0, (3.0, "edge"), (4.0, "hidden"), (5.0, "interpolated"), None]
    found = flight(tmp_path, {"airspeed_kt": values}, [0.2, 0.7, 1.1, 3.6, 5.0, 6.0])

    assert [line.split(",")[-1].strip() for line in log(found)[3:]] == ["1.0", "3.0", "", "", "4.0", "", ""]


def test_mapping_goes_before_names(tmp_path: Path) -> None:
    """A mass flow is not in gallons an hour unless a mapping says so: 900 pph at 6.7 lb a gallon are 134.33 gph."""
    found = flight(tmp_path, {"airspeed_kt": [1.0], "fuel_flow_pph": [900.0], "n1_pct": [90.0]}, [0.0])
    left_out = plan(found, {}).left_out
    assert left_out["fuel_flow_pph"] == "there is no way from 'pph' (mass flow) to 'gph' (volume flow)"
    assert left_out["n1_pct"] == "no column of a G1000 log goes by its name"
    lines = log(found, {"fuel_flow_pph": MappedName(name="E1 FFlow", unit="gph", factor=1 / 6.7)})

    assert lines[3].split(",")[-1].strip() == "134.33"


@pytest.mark.parametrize(
    ("mapping", "error", "says"),
    [
        ({"ias": MappedName(name="IAS")}, OutputError, "has no needle ias"),
        ({"n1_pct": MappedName(name="N1")}, OutputError, "has no column 'N1'"),
        ({"n1_pct": MappedName(name="Latitude")}, OutputError, "has no column 'Latitude'"),
        ({"n1_pct": MappedName(name="IAS", unit="kt")}, OutputError, "airspeed_kt and n1_pct would both be IAS"),
        ({"n1_pct": MappedName(name="TAS")}, UnitError, "there is no way"),
    ],
)
def test_mapping_that_cannot_be_is_refused(
    tmp_path: Path, mapping: Mapping[str, MappedName], error: type[Exception], says: str
) -> None:
    """One sentence says what is wrong with it, or asks for one where no needle has a column."""
    found = flight(tmp_path, {"airspeed_kt": [1.0], "n1_pct": [90.0]}, [0.0])
    with pytest.raises(error, match=says):
        plan(found, mapping)
    with pytest.raises(OutputError, match="name them with --map"):
        plan(flight(tmp_path, {"n1_pct": [90.0]}, [0.0]), {})
