"""Decoding a film of the animation's panel, from the video file on: everything that works with JPEGs."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest
from mcap.reader import make_reader

from decoder.imaging.pictures import grey_picture
from decoder.setup.sources import open_source
from fixtures.film import film as animation_film
from flight_file.reader import open_flight
from tests.programs import A1, FIXTURES, ran, rows_of

pytestmark = pytest.mark.untraced  # what reads films is traced in tests/decoder/imaging and tests/camera_drivers

Decoded = Any
PANEL = FIXTURES / "panel.yaml"
NEEDLES = ("fuel_al_lb", "fuel_fr_lb")


@pytest.fixture(scope="module")
def flight(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The animation's twenty frames as H.264 with B-frames in three groups, as a flight with its panel."""
    folder = tmp_path_factory.mktemp("cockpit")
    animation_film(A1, folder / "cockpit.mp4")
    made = ran(
        "recorder", "replay", folder / "cockpit.mp4", "-o", folder / "cockpit.mcap", "--panel", PANEL,
        "--clock", "creation",
    )  # fmt: skip
    assert made.returncode == 0, made.stderr
    return folder / "cockpit.mcap"


@pytest.fixture(scope="module")
def whole(flight: Path, tmp_path_factory: pytest.TempPathFactory) -> list[dict[str, str]]:
    """What is read of all of it by one process."""
    folder = tmp_path_factory.mktemp("whole")
    done = ran("decode", flight, "-o", folder, "--jobs", 1, "--format", "csv,html,mcap,layout", "--with-images")
    assert done.returncode == 0, done.stderr
    assert (folder / "cockpit.html").stat().st_size > 100_000
    layout = json.loads((folder / "cockpit.layout.json").read_text(encoding="utf-8"))
    assert layout["configById"]["Image!camera"]["imageMode"]["imageTopic"] == "/camera/video"
    with (folder / "cockpit.mcap").open("rb") as stream:
        assert len(list(make_reader(stream).iter_messages(topics=["/camera/video"]))) == 20
    return rows_of(folder / "cockpit.csv")


def test_a_film_is_read_as_its_frames_are(whole: list[dict[str, str]], decoded_a1: Decoded) -> None:
    """In the order of time, numbered so, to within a quarter of a percent of the scale."""
    photographs = decoded_a1.rows

    assert [row["frame"] for row in whole] == [str(number) for number in range(20)]
    assert [row["time_utc"] for row in whole] == [row["time_utc"] for row in photographs]
    for name in NEEDLES:
        for film, photograph in zip(whole, photographs, strict=True):
            assert float(film[name]) == pytest.approx(float(photograph[name]), abs=10)


@pytest.mark.parametrize(
    ("words", "wanted"),
    [(["--jobs", 2], range(20)), (["--from", "2.5"], range(10, 20)), (["--every", "3"], range(0, 20, 3))],
)
def test_processes_share_a_film_and_a_part_of_it_is_read_the_same(
    flight: Path, whole: list[dict[str, str]], tmp_path: Path, words: list[object], wanted: range
) -> None:
    """Of two processes, from a picture in the middle of a group on, or every third."""
    done = ran("decode", flight, "-o", tmp_path, *words)

    assert done.returncode == 0, done.stderr
    for row, number in zip(rows_of(tmp_path / "cockpit.csv"), wanted, strict=True):
        other = whole[number]
        assert (row["frame"], row["time_utc"]) == (other["frame"], other["time_utc"])
        for name in NEEDLES:
            assert row[name] == other[name]


def test_the_set_up_page_gets_jpegs_of_a_film(flight: Path) -> None:
    """Which look to the decoder as the film does."""
    source = open_source([flight])
    frame = next(open_flight([flight]).shown(range(13, 14)))
    picture = grey_picture(source.encoded(13))

    assert source.count == 20
    assert frame.sequence == 13
    assert picture.shape == (768, 1024)


def test_pictures_of_every_third_frame_of_a_film_are_refused(flight: Path, tmp_path: Path) -> None:
    """Nobody could show them."""
    done = ran("decode", flight, "-o", tmp_path, "--every", 3, "--format", "mcap", "--with-images")

    assert done.returncode == 1
    assert "leave --every out" in done.stderr


def test_of_a_damaged_film_what_cannot_be_built_is_missing(flight: Path, tmp_path: Path) -> None:
    """A lost packet takes what is built on it along, and the report says why; the next group is read."""
    data = bytearray(flight.read_bytes())
    frames = list(open_flight([flight]).frames())
    data[data.index(frames[2].encoded) + 50] ^= 1
    damaged = tmp_path / "cockpit.mcap"
    damaged.write_bytes(data)
    done = ran("decode", damaged, "-o", tmp_path, "--jobs", 1)
    described = json.loads((tmp_path / "cockpit.json").read_text(encoding="utf-8"))

    assert done.returncode == 3
    assert "built on is lost" in done.stderr or described["losses"]
    read = [row for row in rows_of(tmp_path / "cockpit.csv") if row["fuel_al_lb_status"] == "read"]
    assert 10 <= len(read) < 20


@pytest.fixture(scope="module")
def timeless(flight: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The results of the same film, of which nobody knows when it was taken."""
    folder = tmp_path_factory.mktemp("timeless")
    made = ran("recorder", "replay", flight.with_name("cockpit.mp4"), "-o", folder / "cockpit.mcap", "--panel", PANEL)
    done = ran("decode", folder / "cockpit.mcap", "-o", folder, "--format", "csv,html")
    assert (made.returncode, done.returncode) == (0, 0), made.stderr + done.stderr
    return folder


def test_a_flight_of_unknown_time_says_so_in_each_output(timeless: Path, whole: list[dict[str, str]]) -> None:
    """No moment of 1970 and none of the conversion: the columns are there and empty."""
    table = rows_of(timeless / "cockpit.csv")
    described = json.loads((timeless / "cockpit.json").read_text(encoding="utf-8"))
    page = (timeless / "cockpit.html").read_text(encoding="utf-8")

    assert {row["time_utc"] for row in table} == {""}
    assert [row["time_s"] for row in table] == [row["time_s"] for row in whole]
    assert (described["time_of_day"], described["start_utc"], described["end_utc"]) == ("unknown", None, None)
    assert "time of day unknown" in page
    assert "1970-01-01" not in page


def test_frames_of_unknown_time_are_named_by_their_seconds(timeless: Path) -> None:
    """The first frame's is 0."""
    done = ran("decode", "frames", timeless / "cockpit.mcap", "-o", timeless / "drawn", "--at", "1.5")

    assert done.returncode == 0, done.stderr
    assert [path.name for path in (timeless / "drawn").iterdir()] == ["cockpit_000006_00001.500s.jpg"]


@pytest.mark.parametrize(
    ("words", "says"),
    [
        (["--from", "12:00:01Z"], "in seconds from its first frame"),
        (["--from", "60"], "no frame lies between --from and --to; the flight lasts 4.75 s"),
    ],
)
def test_a_part_by_a_time_that_it_has_not_is_refused(timeless: Path, words: list[str], says: str) -> None:
    """With what to type in its place, and no time of day that nobody knows."""
    done = ran("decode", timeless / "cockpit.mcap", "-o", timeless / "part", *words)

    assert done.returncode == 1
    assert says in done.stderr


def test_a_g1000_log_needs_a_time_of_day(timeless: Path) -> None:
    """One sentence says how to give it one."""
    done = ran("decode", "export", timeless / "cockpit.csv", "-o", timeless / "log.csv")

    assert done.returncode == 1
    assert "--start or --clock" in done.stderr
