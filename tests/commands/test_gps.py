"""A film with a GoPro's telemetry, decoded: what its GPS says stands beside the needles, in every format."""

from __future__ import annotations

import json
from pathlib import Path

import pyarrow.parquet as pq
import pytest
from jsonschema import validate
from mcap.reader import make_reader

from fixtures.film import film as animation_film
from fixtures.telemetry import flight_payloads, flown, with_telemetry
from tests.programs import A1, FIXTURES, ran, rows_of

COLUMNS = ("gps_latitude_deg", "gps_longitude_deg", "gps_altitude_ft", "gps_speed_kt", "gps_track_deg")
LOST_S = 2


@pytest.fixture(scope="module")
def decoded(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The animation's film of five seconds, with a fix in all of them but one."""
    folder = tmp_path_factory.mktemp("gps")
    animation_film(A1, folder / "plain.mp4")
    film = with_telemetry(folder / "plain.mp4", folder / "GX010123.MP4", flight_payloads(5, lost=(LOST_S,)))
    panel = FIXTURES / "panel.yaml"
    made = ran("recorder", "replay", film, "-o", folder / "f.mcap", "--panel", panel, "--clock", "gps")
    done = ran("decode", folder / "f.mcap", "-o", folder / "out", "--jobs", 1, "--format", "csv,mcap,parquet,html")
    assert (made.returncode, done.returncode) == (0, 0), made.stderr + done.stderr
    assert "GPS: 16 of 20 frames have a position; the receiver had no fix in 10 of 50 samples" in done.stdout
    assert "from the video&#39;s GPS time" in (folder / "out" / "f.html").read_text(encoding="utf-8")
    return folder / "out" / "f.csv"


def test_columns_hold_what_was_flown_and_nothing_where_the_fix_is_lost(decoded: Path) -> None:
    """At each frame's own time; behind the needles."""
    found = rows_of(decoded)

    assert tuple(found[0])[-5:] == COLUMNS
    for row in found:
        at_s = float(row["time_s"])
        latitude, longitude, altitude, speed, _ = flown(at_s)
        if LOST_S <= at_s < LOST_S + 1:
            assert [row[name] for name in COLUMNS] == [""] * 5
        else:
            assert float(row["gps_latitude_deg"]) == pytest.approx(latitude, abs=2e-7)
            assert float(row["gps_longitude_deg"]) == pytest.approx(longitude, abs=2e-7)
            assert float(row["gps_altitude_ft"]) == pytest.approx(altitude / 0.3048, abs=0.06)
            assert float(row["gps_speed_kt"]) == pytest.approx(speed * 3600 / 1852, abs=0.006)


def test_every_format_holds_the_same(decoded: Path) -> None:
    """The description counts and names the frames without a position; an export has the columns with their units."""
    found = rows_of(decoded)
    gps = json.loads(decoded.with_suffix(".json").read_text(encoding="utf-8"))["gps"]
    exported = decoded.with_name("exported.parquet")
    assert ran("decode", "export", decoded, "-o", exported).returncode == 0
    tables = [pq.read_table(path) for path in (decoded.with_suffix(".parquet"), exported)]
    with decoded.with_suffix(".mcap").open("rb") as stream:
        messages = [
            (schema, json.loads(message.data))
            for schema, _, message in make_reader(stream).iter_messages(topics=["/gps/at_frames"])
        ]

    assert gps["without_position"] == [{"first_frame": 8, "last_frame": 11}]
    assert (gps["samples"], gps["samples_without_fix"]) == (50, 10)
    for name in COLUMNS:
        known = [row for row in found if row[name]]
        assert gps["columns"][name] == {"unit": name.rpartition("_")[2], "frames": len(known)}
        for table in tables:
            assert table.schema.field(name).metadata == {b"unit": name.rpartition("_")[2].encode()}
            values = [value for value in table[name].to_pylist() if value is not None]
            assert values == pytest.approx([float(row[name]) for row in known], abs=0.06)
        assert [(each["frame"], each[name]) for _, each in messages if name in each] == [
            (int(row["frame"]), float(row[name])) for row in known
        ]
    assert [each["frame"] for _, each in messages] == [int(row["frame"]) for row in found if row["gps_latitude_deg"]]
    for schema, each in messages:
        assert schema is not None
        assert schema.name == "foxglove.LocationFix"
        validate(each, json.loads(schema.data))
        assert each["altitude"] == pytest.approx(each["gps_altitude_ft"] * 0.3048, abs=0.01)


def truth_of(folder: Path, lost: range) -> Path:
    """Flight data with an airspeed in km/h that is 2 kt above the GPS's speed, which is lost in some frames."""
    lines = ["frame,time_utc,time_s,ias_kph,ias_kph_status,ias_kph_score,ias_kph_sigma,gps_speed_kt"]
    for frame in range(40):
        speed = "" if frame in lost else f"{100 + frame:.2f}"
        lines.append(f"{frame},,{frame / 4:.6f},{(102 + frame) * 1.852:.3f},read,0.99,1.0,{speed}")
    (folder / "f.csv").write_text("\n".join(lines) + "\n", encoding="utf-8")
    needles = {"ias_kph": {"unit": "km/h", "scale_min": 0, "scale_max": 400}}
    gps = {"columns": {"gps_speed_kt": {"unit": "kt", "frames": 40 - len(lost)}}}
    (folder / "f.json").write_text(json.dumps({"needles": needles, "gps": gps}), encoding="utf-8")
    return folder / "f.csv"


@pytest.mark.parametrize("words", [[], ["--offset", "0"]], ids=["by frame", "by time"])
def test_gps_is_a_truth_for_a_needle(tmp_path: Path, words: list[str]) -> None:
    """In the needle's unit; frames without a fix are not compared, and not bridged."""
    flight = truth_of(tmp_path, lost=range(10, 20))
    done = ran("decode", "accuracy", flight, "--map", "ias_kph=gps_speed_kt", "--json", *words)
    assert done.returncode == 0, done.stderr
    (needle,) = json.loads(done.stdout)["needles"]

    assert needle["by_status"]["all"]["frames"] == 30
    assert needle["by_status"]["all"]["mean_signed"] == pytest.approx(2 * 1.852, abs=1e-3)


@pytest.mark.parametrize(
    ("words", "code", "sentence"),
    [
        ([], 2, "give a TRUTH, or --map"),
        (
            ["--map", "ias_kph=gps_altitude_ft"],
            1,
            "has no column gps_altitude_ft of the camera's GPS; it has gps_speed_kt",
        ),
        (["--map", "n1_pct=gps_speed_kt"], 1, "has no needle n1_pct"),
        (["--map", "ias_kph="], 2, "is not NEEDLE=COLUMN"),
    ],
)
def test_what_cannot_be_compared_with_gps_is_a_sentence(
    tmp_path: Path, words: list[str], code: int, sentence: str
) -> None:
    """And says what to give."""
    done = ran("decode", "accuracy", truth_of(tmp_path, lost=range(0)), *words)

    assert done.returncode == code
    assert sentence in done.stderr
