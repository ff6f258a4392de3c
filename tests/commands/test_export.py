"""`decode export`: what others read is what `decode` wrote."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pyarrow.parquet
import pytest

from tests.programs import ran

Decoded = Any


def test_parquet_of_the_csv_is_that_of_the_decode(decoded_a2: Decoded, tmp_path: Path) -> None:
    """Column by column the same types, units and numbers, to the last digit: those of the CSV, empty fields nulls."""
    done = ran("decode", "export", decoded_a2.csv_file, "-o", tmp_path / "again.parquet")
    own = pyarrow.parquet.read_table(decoded_a2.folder / "thesis_a2.parquet")
    again = pyarrow.parquet.read_table(tmp_path / "again.parquet")

    assert (done.returncode, done.stderr) == (0, "")
    assert again.schema.equals(own.schema, check_metadata=True)
    assert again.schema.field("fuel_flow_pph").metadata == {b"unit": b"pph"}
    assert b"n1_pct" in again.schema.metadata[b"flight_data"]
    assert {name: again[name].to_pylist() for name in again.column_names} == {
        name: own[name].to_pylist() for name in own.column_names
    }
    rows = decoded_a2.rows
    for name in ("time_s", "n2_pct", "n2_pct_score", "fuel_flow_pph_sigma"):
        assert again[name].to_pylist() == [float(row[name]) if row[name] else None for row in rows]


def test_pandas_and_polars_read_both_formats(decoded_a2: Decoded, tmp_path: Path) -> None:
    """Both libraries find the columns, UTC times, numbers and missing values of Parquet, CSV and G1000 log."""
    pandas, polars = pytest.importorskip("pandas"), pytest.importorskip("polars")
    names = tmp_path / "names.yaml"
    names.write_text("n1_pct: {name: E1 NG, unit: '%'}\nftit_c: E1 ITT\n")
    done = ran("decode", "export", decoded_a2.csv_file, "-o", tmp_path / "g1000.csv", "--map", names)
    assert done.returncode == 0
    assert "n1_pct as E1 NG (%)" in done.stdout
    assert "noz_pos_pct_open left out: no column of a G1000 log goes by its name" in done.stderr

    rows = pandas.read_parquet(decoded_a2.folder / "thesis_a2.parquet")
    frame = polars.read_parquet(decoded_a2.folder / "thesis_a2.parquet")
    assert len(rows) == len(frame) == 21
    assert str(rows["time_utc"].dtype).endswith("UTC]")
    assert frame["time_utc"].dtype == polars.Datetime("us", "UTC")
    assert rows["n1_pct"].tolist() == frame["n1_pct"].to_list()
    assert set(rows["n2_pct_status"]) == set(frame["n2_pct_status"]) >= {"read", "interpolated"}

    table = pandas.read_csv(decoded_a2.csv_file)
    assert table["n1_pct"].tolist() == polars.read_csv(decoded_a2.csv_file)["n1_pct"].to_list()

    g1000 = pandas.read_csv(tmp_path / "g1000.csv", skiprows=2, skipinitialspace=True)
    g1000_polars = polars.read_csv(tmp_path / "g1000.csv", comment_prefix="#")
    assert [name.strip() for name in g1000_polars.columns] == list(g1000.columns)
    assert list(g1000.columns)[-2:] == ["E1 NG", "E1 ITT"]
    assert len(g1000) == len(g1000_polars) == 6
    assert g1000["Latitude"].isna().all()
    assert g1000["E1 NG"][3] == pytest.approx(table["n1_pct"][12], abs=0.051)


@pytest.mark.parametrize(
    ("words", "code", "says"),
    [
        (["-o", "flight.xlsx"], 2, "the name does not show the format"),
        (["-o", "x.csv", "--map", "no.yaml"], 1, "no.yaml: cannot be read"),
        (["-o", "x.csv"], 1, "name them with --map"),
    ],
)
def test_what_cannot_be_exported_says_why(tmp_path: Path, words: list[str], code: int, says: str) -> None:
    """A format, a mapping or a needle that is not there is one sentence."""
    flight = tmp_path / "flight.csv"
    flight.write_text(
        "frame,time_utc,time_s,n1,n1_status,n1_score,n1_sigma\n0,2018-05-04T12:00:00Z,0.0,1.0,read,1.0,0.1\n"
    )
    done = ran("decode", "export", flight, *[tmp_path / word if "." in word else word for word in words])

    assert done.returncode == code
    assert says in done.stderr


def test_flight_data_are_never_overwritten(decoded_a2: Decoded) -> None:
    """Exporting onto the flight data themselves is refused."""
    before = decoded_a2.csv_file.read_bytes()
    done = ran("decode", "export", decoded_a2.csv_file, "-o", decoded_a2.csv_file)

    assert done.returncode == 2
    assert "is the flight data itself" in done.stderr
    assert decoded_a2.csv_file.read_bytes() == before
