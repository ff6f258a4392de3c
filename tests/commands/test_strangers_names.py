"""Flight files of strangers: whatever they are called inside, nothing is written, replaced or printed but what is ours.

A recording's name, a panel's gauges, files and links that were laid in the way: each of them tries to lead out.
"""

from __future__ import annotations

import json
import os
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import pytest
import yaml

from flight_file.frame import CameraStatus, ClockReading
from flight_file.reader import open_flight
from flight_file.session import Session
from flight_file.untrusted import file_name
from flight_file.writer import SegmentWriter
from tests.programs import A1, FIXTURES, ran, says, yaml_of

FRAMES = 3
NS = 10**9

WriteFlight = Callable[..., Path]
Content = dict[str, Any]


@pytest.fixture
def write_flight(tmp_path: Path) -> WriteFlight:
    """Writes a flight of three frames that says of itself whatever it is told to."""
    flight = open_flight([A1])
    frames = list(flight.frames(range(FRAMES)))

    def write(recording: str, *, name: str = "rec_0000.mcap", attachments: Mapping[str, bytes] | None = None) -> Path:
        at = ClockReading(1_525_435_200 * NS, 0)
        writer = SegmentWriter(
            tmp_path / name,
            session=Session(recording, started=at),
            status=CameraStatus("connected"),
            attachments={**flight.attachments, **(attachments or {})},
        )
        for frame in frames:
            writer.write_frame(frame, at)
        return writer.finish("stopped", dropped=0, at=at)

    return write


def panel_with(change: Callable[[Content], object]) -> dict[str, bytes]:
    """The animation's panel, changed, as an attachment."""
    content: Content = yaml_of(FIXTURES / "panel.yaml")
    change(content)
    return {"panel.yaml": yaml.safe_dump(content).encode()}


def tree(folder: Path) -> dict[str, bytes | None]:
    """Every file below a folder with its content; None for links."""
    paths = sorted(folder.rglob("*"))
    return {
        str(path.relative_to(folder)): None if path.is_symlink() else path.read_bytes()
        for path in paths
        if path.is_symlink() or path.is_file()
    }


@pytest.mark.parametrize("recording", ["../victim", "{tmp}/victim", "..", "\x1b[2J\x1b]0;x\x07", "x" * 5000], ids=ascii)
def test_recording_stays_in_the_output_folder(write_flight: WriteFlight, tmp_path: Path, recording: str) -> None:
    """All outputs in all formats lie in -o under one plain name, and nothing printed does anything on a terminal."""
    recording = recording.format(tmp=tmp_path)
    flight = write_flight(recording)
    out = tmp_path / "box" / "out"
    for suffix in ("csv", "json", "mcap", "html"):
        (tmp_path / f"victim.{suffix}").write_text("mine")
        (tmp_path / "box").mkdir(exist_ok=True)
        (tmp_path / "box" / f"victim.{suffix}").write_text("mine")
    before = tree(tmp_path)
    done = ran("decode", flight, "-o", out, "--format", "csv,mcap,html,layout,parquet", "--with-images")

    name = file_name(recording)
    assert done.returncode == 0, done.stderr
    assert {path: content for path, content in tree(tmp_path).items() if not path.startswith("box/out/")} == before
    ends = (".csv", ".json", ".mcap", ".html", ".layout.json", ".parquet", "_alignment.tsv")
    assert {path.name for path in out.iterdir()} == {name + end for end in ends}
    assert all(line.isprintable() for line in done.stdout.split("\n"))
    assert all(line.isprintable() for line in done.stderr.split("\n"))
    assert "\x1b" not in (out / f"{name}.html").read_text(encoding="utf-8")


def test_pictures_of_gauges_stay_and_stay_apart(write_flight: WriteFlight, tmp_path: Path) -> None:
    """Gauges may be called what they like: each gets its picture in -o, also where only the case differs."""
    names = ["../../n1", "N2", "n2"]

    def rename(content: Content) -> None:
        for gauge, name in zip(content["gauges"], names, strict=False):
            gauge["name"] = name

    flight = write_flight("../../victim", attachments=panel_with(rename))
    wanted = [word for name in names for word in ("--gauge", name)]
    done = ran("decode", "frames", flight, "-o", tmp_path / "a" / "b" / "out", "--every", 99, *wanted)

    assert done.returncode == 0, done.stderr
    made = [path for path in tmp_path.rglob("*.jpg") if path.is_file()]
    assert {path.parent for path in made} == {tmp_path / "a" / "b" / "out"}
    assert len({path.name.casefold() for path in made}) == len(names)


PLANTED = [
    part.format(f"thesis_a1{end}")
    for end in (".csv", ".json", "_alignment.tsv", ".decode-journal")
    for part in ("{}", ".{}.part", "{}.part")
]
JOURNAL = "thesis_a1.decode-journal"


@pytest.mark.parametrize(
    "planted", [[name for name in PLANTED if name != JOURNAL], [JOURNAL]], ids=["outputs", "journal"]
)
def test_planted_links_are_not_followed(tmp_path: Path, planted: list[str]) -> None:
    """A link in the output folder is replaced, left or refused; what it points to is never written."""
    (tmp_path / "out").mkdir()
    for name in planted:
        (tmp_path / f"victim of {name}").write_text("mine")
        (tmp_path / "out" / name).symlink_to(tmp_path / f"victim of {name}")
    done = ran("decode", A1, "-o", tmp_path / "out", "--every", 7)

    is_journal = planted == [JOURNAL]
    assert done.returncode == is_journal, done.stderr
    assert not is_journal or "it is a link; remove it" in done.stderr
    assert {path.name: path.read_text() for path in tmp_path.glob("victim*")} == {
        f"victim of {name}": "mine" for name in planted
    }
    assert (tmp_path / "out" / "thesis_a1.csv").is_file() != is_journal


@pytest.mark.parametrize("name", ["flight.mcap", "flight.mcap.part"])
def test_input_is_never_overwritten(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, name: str) -> None:
    """Decoding into the flight's own folder leaves the flight as it is, finished or in work."""
    monkeypatch.chdir(tmp_path)
    (tmp_path / name).write_bytes(A1.read_bytes())
    done = ran("decode", name, "-o", ".", "--format", "csv,mcap", "--every", 7)

    assert (done.returncode == 1) == ("would be overwritten" in done.stderr) == (name == "flight.mcap"), done.stderr
    assert (tmp_path / name).read_bytes() == A1.read_bytes()


def test_another_recording_of_that_name_is_not_replaced(write_flight: WriteFlight, tmp_path: Path) -> None:
    """A recording called as another one's safe name is does not take its place without a word."""
    first = write_flight("../victim", name="one_0000.mcap")
    second = write_flight(file_name("../victim"), name="two_0000.mcap")
    assert ran("decode", first, "-o", tmp_path / "out").returncode == 0
    before = tree(tmp_path / "out")
    done = ran("decode", second, "-o", tmp_path / "out")

    assert done.returncode == 1
    assert "is of the recording ../victim" in done.stderr
    assert tree(tmp_path / "out") == before
    assert ran("decode", first, "-o", tmp_path / "out").returncode == 0


def test_file_name_that_is_no_text(tmp_path: Path) -> None:
    """A flight file whose name is not even UTF-8 is decoded, and its files can be read."""
    flight = tmp_path / os.fsdecode(b"fl\xffght.mcap")
    flight.write_bytes(A1.read_bytes())
    done = ran("decode", flight, "-o", tmp_path / "out", "--every", 7, "--format", "csv,html,mcap")

    assert done.returncode == 0, done.stderr
    (description,) = (tmp_path / "out").glob("fl*.json")
    assert json.loads(description.read_text(encoding="utf-8"))["flight_files"][0]["name"] == "fl\\udcffght.mcap"


def test_anchor_is_no_formula(write_flight: WriteFlight, tmp_path: Path) -> None:
    """The name of an anchor that failed is text in the table, whatever a spreadsheet thinks of it."""
    extra = {"name": "=1+1", "box": [10, 10, 40, 40]}

    def add(content: Content) -> None:
        content["anchors"].append(extra)

    done = ran("decode", write_flight("rec", attachments=panel_with(add)), "-o", tmp_path / "out")
    table = (tmp_path / "out" / "rec_alignment.tsv").read_text(encoding="utf-8") if done.returncode == 0 else ""

    assert "\t=" not in table


@pytest.mark.parametrize("planted", ["link", "dangling"])
def test_extracted_pictures_follow_no_link(tmp_path: Path, planted: str) -> None:
    """`recorder extract` makes its own files, and leaves what lies in their place."""
    (tmp_path / "out").mkdir()
    victim = tmp_path / "victim"
    if planted == "link":
        victim.write_text("mine")
    (tmp_path / "out" / "000000.jpg").symlink_to(victim)
    done = ran("recorder", "extract", A1, "-o", tmp_path / "out")

    assert done.returncode == 1
    assert "is there already" in done.stderr
    assert not victim.exists() if planted == "dangling" else victim.read_text() == "mine"


@pytest.mark.parametrize("words", [["info"], ["verify"], ["recover"]])
def test_box_commands_print_what_they_read(write_flight: WriteFlight, words: list[str]) -> None:
    """A recording's name moves no cursor, whichever command prints it."""
    done = ran("recorder", *words, write_flight("\x1b[2Jname\x07\nlosses: none"))

    assert "\x1b" not in done.stdout + done.stderr
    assert "\x07" not in done.stdout + done.stderr
    assert words == ["recover"] or "\\x1b[2Jname\\x07\\x0alosses: none" in done.stdout


RULER = "distance_inches: 36\nphotographs:\n- {picture: %s, line: [0, 0, 100, 0], inches: 6}\n"


@pytest.mark.parametrize("picture", ["pipe", "/dev/zero", r'"\0"'])
def test_photograph_that_a_list_names_is_a_file(tmp_path: Path, picture: str) -> None:
    """A pipe is not waited for, a device without an end not read, a name that no file has is told."""
    os.mkfifo(tmp_path / "pipe")
    (tmp_path / "ruler.yaml").write_text(RULER % picture, encoding="utf-8")
    done = ran("decode", "calibrate", "focal", "ruler.yaml", cwd=tmp_path)

    says(done, "cannot be read")


@pytest.mark.parametrize(
    ("words", "code"),
    [
        (("decode", "setup", "pipe", "--no-browser"), 1),
        (("decode", "fleet", "flight.mcap", "-o", "out", "--panel", "pipe"), 1),
        (("decode", "fleet", "@pipe", "-o", "out"), 1),
        (("decode", "accuracy", "data.csv", "data.csv"), 0),
        (("recorder", "verify", "flight.mcap"), 1),
    ],
    ids=lambda words: " ".join(words) if isinstance(words, tuple) else "",
)
def test_pipe_is_not_waited_for(tmp_path: Path, words: tuple[str, ...], code: int) -> None:
    """Wherever it lies: as a picture, a panel, a list, beside flight data or as a signature."""
    for name in ("pipe", "data.json", "flight.mcap.sig"):
        os.mkfifo(tmp_path / name)
    (tmp_path / "flight.mcap").write_bytes(A1.read_bytes())
    rows = "".join(f"{row},{row},{row},read,0.9,0.1\n" for row in range(3))
    (tmp_path / "data.csv").write_text("frame,time_s,a_kt,a_kt_status,a_kt_score,a_kt_sigma\n" + rows)

    assert ran(*words, cwd=tmp_path).returncode == code
