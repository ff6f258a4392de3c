"""`decode` on flights that are as they should be."""

from __future__ import annotations

import json
import subprocess
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pyarrow.parquet
import pytest

from flight_file.reader import open_flight

FIXTURES = Path(__file__).parents[2] / "fixtures"
A1, TRUTH = FIXTURES / "thesis_a1.mcap", FIXTURES / "thesis_a1_truth.csv"
Run = Callable[..., subprocess.CompletedProcess[str]]
ReadDecoded = Callable[[Path], Any]
MakeFlight = Callable[..., Path]

NEEDLES = ("n1_pct", "n2_pct", "ftit_c", "fuel_flow_pph", "noz_pos_pct_open", "fuel_al_lb", "fuel_fr_lb")


def test_flight_gives_flight_data_by_its_name(run: Run, read_decoded: ReadDecoded, tmp_path: Path) -> None:
    """`decode thesis_a1.mcap` writes thesis_a1.csv and .json, a row for each frame, with the contract's header."""
    done = run("decode", A1, "-o", tmp_path / "out")
    flight = read_decoded(tmp_path / "out")

    assert (done.returncode, done.stderr) == (0, "")
    assert flight.csv_file.name == "thesis_a1.csv"
    assert sorted(path.name for path in (tmp_path / "out").iterdir()) == [
        "thesis_a1.csv",
        "thesis_a1.json",
        "thesis_a1_alignment.tsv",
    ]
    columns = ["frame", "time_utc", "time_s"]
    columns += [name + suffix for name in NEEDLES for suffix in ("", "_status", "_score", "_sigma")]
    assert list(flight.rows[0]) == columns
    assert [row["frame"] for row in flight.rows] == [str(number) for number in range(20)]
    assert {row[f"{name}_status"] for row in flight.rows for name in NEEDLES} == {"read"}
    assert "lowest score" in done.stdout
    assert str(flight.csv_file) in done.stdout


def test_description_names_what_went_in(run: Run, read_decoded: ReadDecoded, tmp_path: Path) -> None:
    """The JSON holds units, hashes, version and the counts of each status."""
    run("decode", A1, "-o", tmp_path)
    described = json.loads(read_decoded(tmp_path).json_file.read_text())

    assert described["needles"]["fuel_flow_pph"]["unit"] == "pph"
    assert described["needles"]["n1_pct"]["frames"]["read"] == 20
    assert len(described["flight_files"][0]["sha256"]) == len(described["panel"]["sha256"]) == 64
    assert described["software"].startswith("image-flight-recorder ")
    assert described["losses"] == described["gaps"] == described["missing_frames"] == []


def test_same_flight_gives_the_same_bytes(run: Run, tmp_path: Path) -> None:
    """Two decodes of one flight differ in nothing."""
    for name in ("one", "other"):
        run("decode", A1, "-o", tmp_path / name)

    for path in (tmp_path / "one").iterdir():
        assert path.read_bytes() == (tmp_path / "other" / path.name).read_bytes()


@pytest.mark.parametrize("method", ["xcorr", "normxcorr"])
def test_both_methods_beat_the_thesis(run: Run, tmp_path: Path, method: str) -> None:
    """On table A.1's frames every needle's mean error is at most a third of the published one, by either method."""
    published = {"n1_pct": 0.139, "n2_pct": 0.111, "ftit_c": 0.104, "fuel_flow_pph": 0.764}
    published |= {"noz_pos_pct_open": 1.394, "fuel_al_lb": 0.261, "fuel_fr_lb": 0.152}
    run("decode", A1, "-o", tmp_path, "--method", method)
    table = json.loads(run("decode", "accuracy", tmp_path / "thesis_a1.csv", TRUTH, "--json").stdout)

    assert {
        row["needle"]: row["by_status"]["all"]["mean_abs_pct"] <= published[row["needle"]] / 3 for row in table
    } == (dict.fromkeys(NEEDLES, True))


def test_accuracy_is_a_table_for_people(run: Run, tmp_path: Path) -> None:
    """Without --json the accuracy of each needle and status is a line of text."""
    run("decode", A1, "-o", tmp_path)
    done = run("decode", "accuracy", tmp_path / "thesis_a1.csv", TRUTH)

    assert done.returncode == 0
    assert done.stdout.splitlines()[0].split()[:3] == ["needle", "status", "frames"]
    assert sum(line.startswith("n1_pct") for line in done.stdout.splitlines()) == 2


def test_segments_are_one_flight(run: Run, read_decoded: ReadDecoded, tmp_path: Path) -> None:
    """The segments of a recording give one set of files, the same values as the flight in one piece."""
    (tmp_path / "recorder.yaml").write_text(
        f"camera: {{driver: replay, path: {A1}, pace: fastest}}\n"
        "storage: {directory: segments, segment_s: 1, keep_free_gib: 0}\n"
    )
    recorded = run("recorder", "run", "--config", tmp_path / "recorder.yaml")
    segments = sorted((tmp_path / "segments").glob("*.mcap"))
    run("decode", *reversed(segments), "-o", tmp_path / "pieces")
    run("decode", A1, "-o", tmp_path / "whole")
    pieces, whole = read_decoded(tmp_path / "pieces"), read_decoded(tmp_path / "whole")

    assert recorded.returncode == 0
    assert len(segments) > 2
    assert pieces.rows == whole.rows
    assert pieces.csv_file.stem == segments[0].name.removesuffix("_0000.mcap")


def test_panel_on_the_command_line_goes_first(
    run: Run, read_decoded: ReadDecoded, make_flight: MakeFlight, pictures: list[bytes], tmp_path: Path
) -> None:
    """A flight without a panel is read with the one that --panel names."""
    flight = make_flight(pictures[:5], panel=None)
    done = run("decode", flight, "--panel", FIXTURES / "panel.yaml", "-o", tmp_path / "out")

    assert done.returncode == 0
    assert {row["n1_pct_status"] for row in read_decoded(tmp_path / "out").rows} == {"read"}


def test_panel_on_the_command_line_overrides_the_flights(run: Run, read_decoded: ReadDecoded, tmp_path: Path) -> None:
    """A flight that carries a panel is read with another one, if --panel names it."""
    text = (FIXTURES / "panel.yaml").read_text(encoding="utf-8")
    (tmp_path / "panel.yaml").write_text(text.replace("n1_pct", "fan_speed_pct"), encoding="utf-8")
    (tmp_path / "panel.jpg").write_bytes((FIXTURES / "panel.jpg").read_bytes())
    done = run("decode", A1, "--panel", tmp_path / "panel.yaml", "-o", tmp_path / "out")
    columns = read_decoded(tmp_path / "out").rows[0]

    assert done.returncode == 0
    assert "fan_speed_pct" in columns
    assert "n1_pct" not in columns


def test_lost_anchor_costs_only_its_frames(
    run: Run,
    read_decoded: ReadDecoded,
    make_flight: MakeFlight,
    cover_knob: Callable[[bytes], bytes],
    pictures: list[bytes],
    tmp_path: Path,
) -> None:
    """Frames whose anchor is covered are missing with the reason; the frames before and after them are read."""
    frames = [cover_knob(jpeg) if number in (4, 5) else jpeg for number, jpeg in enumerate(pictures)]
    done = run("decode", make_flight(frames), "-o", tmp_path / "out")
    flight = read_decoded(tmp_path / "out")

    assert done.returncode == 0
    assert "frame 4 missing: anchor" in done.stderr
    for number, row in enumerate(flight.rows):
        assert row["n1_pct_status"] == ("missing" if number in (4, 5) else "read")
        assert (row["n1_pct"] == "") is (number in (4, 5))
    (gap,) = json.loads(flight.json_file.read_text())["missing_frames"]
    assert (gap["first_frame"], gap["last_frame"]) == (4, 5)


def test_parquet_holds_what_the_csv_does(run: Run, read_decoded: ReadDecoded, tmp_path: Path) -> None:
    """`--format csv,parquet` writes both, with the same columns and values."""
    done = run("decode", A1, "-o", tmp_path, "--format", "csv,parquet")
    rows = read_decoded(tmp_path).rows
    table = pyarrow.parquet.read_table(tmp_path / "thesis_a1.parquet").to_pydict()

    assert done.returncode == 0
    assert list(table) == list(rows[0])
    assert table["ftit_c_status"] == [row["ftit_c_status"] for row in rows]
    assert table["ftit_c"] == pytest.approx([float(row["ftit_c"]) for row in rows], abs=0.01)
    assert table["time_utc"][0].isoformat() == "2018-05-04T12:00:00+00:00"


def test_flight_for_viewers(run: Run, tmp_path: Path) -> None:
    """`--format mcap,layout --with-images` writes both files, the same bytes each time, and says where."""
    for name in ("one", "other"):
        done = run("decode", A1, "-o", tmp_path / name, "--format", "mcap,layout", "--with-images")
        assert (done.returncode, done.stderr) == (0, "")
        assert str(tmp_path / name / "thesis_a1.layout.json") in done.stdout

    files = sorted(path.name for path in (tmp_path / "one").iterdir())
    assert files == ["thesis_a1.json", "thesis_a1.layout.json", "thesis_a1.mcap"]
    for name in files:
        assert (tmp_path / "one" / name).read_bytes() == (tmp_path / "other" / name).read_bytes()
    pictures = sum(len(frame.jpeg) for frame in open_flight([A1]).frames())
    assert (tmp_path / "one" / "thesis_a1.mcap").stat().st_size > 0.9 * pictures


def test_images_without_a_file_for_them_are_wrong_usage(run: Run, tmp_path: Path) -> None:
    """`--with-images` alone would do nothing, so it is refused before anything is decoded."""
    done = run("decode", A1, "-o", tmp_path, "--with-images")

    assert done.returncode == 2
    assert "--with-images needs --format mcap" in done.stderr
    assert list(tmp_path.iterdir()) == []


def test_flight_file_is_never_overwritten(run: Run, tmp_path: Path) -> None:
    """`decode flight.mcap --format mcap` in the flight's own folder is refused, and the recording is untouched."""
    flight = tmp_path / "flight.mcap"
    flight.write_bytes(A1.read_bytes())
    done = run("decode", flight, "-o", tmp_path, "--format", "csv,mcap")

    assert done.returncode == 1
    assert "would be overwritten by what is decoded; choose another folder with -o" in done.stderr
    assert flight.read_bytes() == A1.read_bytes()
    assert list(tmp_path.iterdir()) == [flight]


def test_truth_is_never_overwritten(run: Run, tmp_path: Path) -> None:
    """A truth that is called as the flight data would be is refused before anything is decoded."""
    truth = tmp_path / "thesis_a1.csv"
    truth.write_bytes(TRUTH.read_bytes())
    done = run("decode", A1, "-o", tmp_path, "--format", "csv,html", "--truth", truth)

    assert done.returncode == 1
    assert f"{truth}: would be overwritten by what is decoded; choose another folder with -o" in done.stderr
    assert truth.read_bytes() == TRUTH.read_bytes()
