"""`decode` on flights that are as they should be."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from flight_file.reader import open_flight
from tests.programs import FIXTURES, MakeFlight, contents, ran, says

A1, TRUTH = FIXTURES / "thesis_a1.mcap", FIXTURES / "thesis_a1_truth.csv"
Decode = Callable[..., Any]
Decoded = Any
NEEDLES = ("n1_pct", "n2_pct", "ftit_c", "fuel_flow_pph", "noz_pos_pct_open", "fuel_al_lb", "fuel_fr_lb")


def test_flight_gives_flight_data_by_its_name(decoded_a1: Decoded) -> None:
    """`decode thesis_a1.mcap` writes thesis_a1.csv and .json, a row for each frame, with the contract's header."""
    folder, done, rows = decoded_a1.folder, decoded_a1.done, decoded_a1.rows

    assert (done.returncode, done.stderr) == (0, "")
    assert {path.name for path in folder.iterdir()} == {"thesis_a1.csv", "thesis_a1.json", "thesis_a1_alignment.tsv"}
    columns = ["frame", "time_utc", "time_s"]
    columns += [name + suffix for name in NEEDLES for suffix in ("", "_status", "_score", "_sigma")]
    assert list(rows[0]) == columns
    assert [row["frame"] for row in rows] == [str(number) for number in range(20)]
    assert {row[f"{name}_status"] for row in rows for name in NEEDLES} == {"read"}
    assert "lowest score" in done.stdout
    assert str(decoded_a1.csv_file) in done.stdout


def test_same_flight_gives_the_same_bytes(decode: Decode, decoded_a1: Decoded) -> None:
    """Two decodes of one flight differ in nothing."""
    assert contents(decode(A1).folder) == contents(decoded_a1.folder)


@pytest.mark.parametrize("method", ["xcorr", "normxcorr"])
def test_both_methods_beat_the_thesis(decode: Decode, decoded_a1: Decoded, method: str) -> None:
    """On table A.1's frames every needle's mean error is at most a third of the published one, by either method."""
    published = {"n1_pct": 0.139, "n2_pct": 0.111, "ftit_c": 0.104, "fuel_flow_pph": 0.764}
    published |= {"noz_pos_pct_open": 1.394, "fuel_al_lb": 0.261, "fuel_fr_lb": 0.152}
    found = decoded_a1 if method == "normxcorr" else decode(A1, "--method", method)
    table = json.loads(ran("decode", "accuracy", found.csv_file, TRUTH, "--json").stdout)
    wanted = {name: error / 3 for name, error in published.items()}

    assert {row["needle"]: row["by_status"]["all"]["mean_abs_pct"] <= wanted[row["needle"]] for row in table} == (
        dict.fromkeys(NEEDLES, True)
    )


def test_segments_are_one_flight(decode: Decode, decoded_a1: Decoded, tmp_path: Path) -> None:
    """Segments in any order give one set of files, the same values as in one piece; a part of them too."""
    (tmp_path / "recorder.yaml").write_text(
        f"camera: {{driver: replay, path: {A1}, pace: fastest}}\n"
        "storage: {directory: segments, segment_s: 1, keep_free_gib: 0}\n"
    )
    recorded = ran("recorder", "run", "--config", tmp_path / "recorder.yaml")
    segments = sorted((tmp_path / "segments").glob("*.mcap"))
    pieces, part = decode(*reversed(segments)), decode(*segments, "--from", "1", "--every", 2, into="part")

    assert recorded.returncode == 0
    assert len(segments) > 2
    assert pieces.rows == decoded_a1.rows
    assert part.rows == decoded_a1.rows[4::2]
    assert pieces.csv_file.stem == segments[0].name.removesuffix("_0000.mcap")


@pytest.mark.parametrize("carries_panel", [True, False])
def test_panel_on_the_command_line_goes_first(
    decode: Decode,
    make_flight: MakeFlight,
    pictures: list[bytes],
    tmp_path: Path,
    carries_panel: bool,  # noqa: FBT001
) -> None:
    """A flight is read with the panel that --panel names, whether it carries another or wants one."""
    flight = make_flight(pictures[:5], panel=FIXTURES / "panel.yaml" if carries_panel else None)
    text = (FIXTURES / "panel.yaml").read_text(encoding="utf-8")
    (tmp_path / "panel.yaml").write_text(text.replace("n1_pct", "fan_speed_pct"), encoding="utf-8")
    (tmp_path / "panel.jpg").write_bytes((FIXTURES / "panel.jpg").read_bytes())
    found = decode(flight, "--panel", tmp_path / "panel.yaml")

    assert found.done.returncode == 0
    assert {row["fan_speed_pct_status"] for row in found.rows} == {"read"}
    assert "n1_pct" not in found.rows[0]
    if not carries_panel:
        says(ran("decode", flight, "-o", tmp_path / "none"), "flight.mcap", "--panel")


def test_flight_for_viewers(decode: Decode, tmp_path: Path) -> None:
    """`--format mcap,layout --with-images` writes both, the same bytes each time; `--with-images` alone is refused."""
    one, other = (decode(A1, "--format", "mcap,layout", "--with-images", into=name) for name in ("one", "other"))
    alone = ran("decode", A1, "-o", tmp_path / "none", "--with-images")
    files = contents(one.folder)

    assert (one.done.returncode, one.done.stderr) == (0, "")
    assert str(one.folder / "thesis_a1.layout.json") in one.done.stdout
    assert files.keys() == {"thesis_a1.json", "thesis_a1.layout.json", "thesis_a1.mcap"}
    assert contents(other.folder) == files
    assert len(files["thesis_a1.mcap"]) > 0.9 * sum(len(frame.encoded) for frame in open_flight([A1]).frames())
    assert alone.returncode == 2
    assert "--with-images needs --format mcap" in alone.stderr
    assert not (tmp_path / "none").exists()


def test_truth_is_never_overwritten(tmp_path: Path) -> None:
    """A truth that is called as the flight data would be is refused before anything is decoded."""
    truth = tmp_path / "thesis_a1.csv"
    truth.write_bytes(TRUTH.read_bytes())

    says(ran("decode", A1, "-o", tmp_path, "--truth", truth, "--format", "csv,html"), f"{truth}: would be overwritten")
    assert contents(tmp_path) == {truth.name: TRUTH.read_bytes()}
