"""What users get wrong: one sentence that says what to do, the right exit code, and nothing left behind."""

from __future__ import annotations

import contextlib
import io
import os
import pty
import signal
import subprocess
import sys
import termios
import threading
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest
from PIL import Image, ImageDraw

from decoder.imaging.panel_pictures import panel_from_attachments
from decoder.learning.fit import reader_from_panel
from decoder.panel.vocabulary import Method
from decoder.timeseries.flight_decoder import decode_flight
from flight_file.frame import Frame
from flight_file.reader import open_flight
from tests.jpegs import encoded
from tests.programs import A1, A2, FIXTURES, PATIENCE_S, MakeFlight, ran, says, write_yaml, yaml_of

PANEL = FIXTURES / "panel.yaml"
Decode = Callable[..., Any]
Panel = dict[str, Any]


def key_spelt_otherwise(panel: Panel, _: Path) -> None:
    """As elsewhere."""
    panel["gauges"][1]["center"] = panel["gauges"][1].pop("centre")


def key_a_level_too_low(panel: Panel, _: Path) -> None:
    """A gauge's key, written to its needle."""
    panel["gauges"][1]["needles"][0]["tail"] = True


def no_picture(_: Panel, picture: Path) -> None:
    """The panel's picture is gone."""
    picture.unlink()


def gauge_outside(panel: Panel, _: Path) -> None:
    """A gauge that is drawn where there is no picture."""
    panel["gauges"][0]["centre"] = [5000, 5000]


def another_cockpit(panel: Panel, picture: Path) -> None:
    """The panel's anchor is in no frame at all."""
    left, top, width, height = panel["anchors"][0]["box"]
    image = Image.open(picture).convert("RGB")
    draw = ImageDraw.Draw(image)
    draw.rectangle([left, top, left + width, top + height], fill=(20, 20, 20))
    for step in range(0, width, 8):
        draw.line([left, top + step, left + width, top], fill=(230, 230, 230), width=3)
    image.save(picture, quality=95)


def test_truncated_flight_is_decoded_as_far_as_it_goes(decode: Decode, tmp_path: Path) -> None:
    """A flight that breaks off gives the frames that are whole, names the loss, and ends with 3."""
    flight = tmp_path / "cut.mcap"
    flight.write_bytes(A1.read_bytes()[:1_200_000])
    found = decode(flight)

    assert found.done.returncode == 3
    assert "lost: cut.mcap" in found.done.stderr
    assert 5 < len(found.rows) < 20
    assert {row["n1_pct_status"] for row in found.rows} == {"read"}


@pytest.mark.parametrize("words", [("frames", "--every", "5", "-o", "pictures"), ("video", "-o", "film.mp4")])
def test_what_a_truncated_flight_lost_is_named_by_every_command(tmp_path: Path, words: tuple[str, ...]) -> None:
    """It draws what is there, and says what is not."""
    (tmp_path / "cut.mcap").write_bytes(A1.read_bytes()[:1_000_000])
    command, *options, target = words
    done = ran("decode", command, tmp_path / "cut.mcap", *options, tmp_path / target)

    assert done.returncode == 3
    assert "lost: cut.mcap: the file ends inside a record" in done.stderr


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (key_spelt_otherwise, ["gauges[1].center: is not a key", "did you mean centre?"]),
        (key_a_level_too_low, ["gauges[1].needles[0].tail: is not a key here, but of gauge: move it there"]),
        (no_picture, ["panel.jpg"]),
        (gauge_outside, ["drawn.yaml: gauges[0]: lies outside", "check where it is drawn"]),
        (another_cockpit, ["flight.mcap", "none of its 2 frames", "knob"]),
    ],
    ids=lambda value: getattr(value, "__name__", None),
)
def test_wrong_panel_is_named(
    make_flight: MakeFlight,
    pictures: list[bytes],
    tmp_path: Path,
    change: Callable[[Panel, Path], None],
    words: list[str],
) -> None:
    """A mistake in the panel is one sentence with the path of the wrong value; one found nowhere gives no table."""
    panel: Panel = yaml_of(PANEL)
    (tmp_path / "panel.jpg").write_bytes((FIXTURES / "panel.jpg").read_bytes())
    change(panel, tmp_path / "panel.jpg")
    write_yaml(tmp_path / "drawn.yaml", panel)

    flight = make_flight(pictures[:2])  # where a panel is found in no frame, each is searched long

    says(ran("decode", flight, "--panel", tmp_path / "drawn.yaml", "-o", tmp_path / "out"), "decode: ", *words)
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize(
    ("flights", "folder", "words"),
    [
        (["no.mcap"], "out", ["no.mcap"]),
        (["empty.mcap"], "out", ["empty.mcap", "empty"]),
        (["letter.mcap"], "out", ["letter.mcap", "MCAP"]),
        (["."], "out", ["give the flight files in it, or make one of its photographs: recorder replay"]),
        ([A1, A2], "out", ["thesis_a1.mcap", "thesis_a2.mcap", "different recordings"]),
        ([A1], "letter.mcap/out", ["out", "-o"]),
    ],
    ids=["not there", "empty", "of another kind", "a folder", "two recordings", "nowhere to write"],
)
def test_what_cannot_be_decoded_is_named(tmp_path: Path, flights: list[object], folder: str, words: list[str]) -> None:
    """A flight that is none, files that are not one flight, and an output folder that cannot be made."""
    (tmp_path / "empty.mcap").touch()
    (tmp_path / "letter.mcap").write_text("Dear Sir or Madam, " * 100)

    says(ran("decode", *(tmp_path / str(flight) for flight in flights), "-o", tmp_path / folder), "decode: ", *words)


def test_bad_pictures_cost_their_own_frames(
    decode: Decode, make_flight: MakeFlight, cover_knob: Callable[[bytes], bytes], pictures: list[bytes]
) -> None:
    """One cut short, one too small, two without the anchor: missing with a reason; the others are read."""
    small = encoded(Image.open(io.BytesIO(pictures[2])).resize((32, 24)))
    bad = {2: pictures[2][:30_000], 5: small, 7: cover_knob(pictures[7]), 8: cover_knob(pictures[8])}
    found = decode(make_flight(bad.get(number, jpeg) for number, jpeg in enumerate(pictures)))
    told = [line.partition("missing: ") for line in found.done.stderr.splitlines()]

    assert found.done.returncode == 0
    assert [frame.strip() for frame, *_ in told[:2]] == ["frame 2", "frame 5"]
    for (*_, reason), known in zip(told, ("the picture is damaged", "the picture is 32 x 24", "anchor"), strict=False):
        assert reason.startswith(known)
    for number, row in enumerate(found.rows):
        assert row["n1_pct_status"] == ("missing" if number in bad else "read")
        assert (row["n1_pct"] == row["n1_pct_sigma"] == "") is (number in bad)
    gaps = [(gap["first_frame"], gap["last_frame"]) for gap in found.described["missing_frames"]]
    assert gaps == [(2, 2), (5, 5), (7, 8)]


@pytest.mark.parametrize("words", [[], ["calibrate"]], ids=["decode", "decode calibrate"])
def test_a_command_without_a_word_shows_its_help(words: list[str]) -> None:
    """The lines of its help as `--help` shows them, on stderr, for somebody who types it for the first time."""
    bare, asked = ran("decode", *words), ran("decode", *words, "--help")
    assert (bare.returncode, bare.stdout) == (2, "")
    assert bare.stderr == asked.stdout


def test_wrong_usage(tmp_path: Path) -> None:
    """A method that does not exist, and a call without a flight, end with 2."""
    assert ran("decode", A1, "--method", "guess", "-o", tmp_path).returncode == 2
    assert ran("decode", "-o", tmp_path).returncode == 2
    assert list(tmp_path.iterdir()) == []


def interrupt_in_mid_flight(*words: object) -> tuple[int, str]:
    """Runs `decode` on a terminal of its own, presses Ctrl-C when its progress bar shows frames; exit code and text."""
    ours, theirs = pty.openpty()
    termios.tcsetwinsize(ours, (24, 100))
    command = [str(Path(sys.executable).parent / "decode"), *map(str, words)]
    with subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=theirs) as running:
        os.close(theirs)
        hung = threading.Timer(PATIENCE_S, running.kill)
        hung.start()
        shown = b""
        with contextlib.suppress(OSError):  # a terminal whose program has ended
            while chunk := os.read(ours, 1024):
                before, shown = shown, shown + chunk
                if b" frames" in shown and b" frames" not in before:
                    running.send_signal(signal.SIGINT)
        os.close(ours)
        hung.cancel()
        return running.wait(timeout=60), shown.decode()


@pytest.mark.untraced
def test_interrupt_leaves_nothing_half_written(make_flight: MakeFlight, pictures: list[bytes], tmp_path: Path) -> None:
    """Ctrl-C in mid-flight ends with a sentence and 1; no file is made, and those of an earlier decode stay."""
    flight = make_flight(pictures * 20)
    (tmp_path / "out").mkdir()
    (tmp_path / "out" / "flight.csv").write_text("from an earlier decode")
    code, shown = interrupt_in_mid_flight(flight, "-o", tmp_path / "out")

    assert code == 1, shown
    assert "Traceback" not in shown
    assert shown.rstrip().endswith("decode: interrupted; nothing was written")
    assert [path.name for path in (tmp_path / "out").iterdir()] == ["flight.csv"]
    assert (tmp_path / "out" / "flight.csv").read_text() == "from an earlier decode"


FRAMES = 18  # more than a sample has


@pytest.fixture(scope="module")
def elsewhere(pictures: list[bytes]) -> list[bytes]:
    """Pictures of something else, as large as the animation's: soft blots, other ones in each."""
    with Image.open(io.BytesIO(pictures[0])) as picture:
        width, height = picture.size
    made = []
    for seed in range(FRAMES):
        coarse = np.random.default_rng(seed).uniform(0, 255, (height // 16, width // 16)).astype(np.float32)
        blots = np.clip(cv2.resize(coarse, (width, height), interpolation=cv2.INTER_CUBIC), 0, 255).astype(np.uint8)
        made.append(encoded(Image.fromarray(blots).convert("RGB"), quality=85))
    return made


@pytest.mark.untraced
def test_panel_of_another_cockpit_is_refused_after_a_sample(
    tmp_path: Path, make_flight: MakeFlight, elsewhere: list[bytes]
) -> None:
    """One sentence says what was looked for, in how many frames, and what to do; nothing is written."""
    flight = make_flight(elsewhere[:FRAMES])
    done = ran("decode", flight, "-o", tmp_path / "out")

    assert done.returncode == 1
    assert "none of 16 frames spread over the flight's 18" in done.stderr
    assert "knob" in done.stderr
    assert "--from" in done.stderr
    assert list((tmp_path / "out").glob("*.csv")) == []


def test_flight_that_its_cameras_calibration_does_not_cover_says_so(
    tmp_path: Path, make_flight: MakeFlight, pictures: list[bytes]
) -> None:
    """Frames of another shape are not looked into then: nothing is said of what was looked for in them."""
    cut = encoded(Image.open(io.BytesIO(pictures[0])).crop((0, 0, 1024, 600)))
    camera = tmp_path / "camera.yaml"
    camera.write_text("picture_size: [1024, 768]\nfocal: {pixels_per_radian: [0, 1100, 0], range_mm: [4, 5]}\n")
    flight = make_flight([cut] * 20)

    words = ["none of its 16 frames fits", "the picture is 1024 x 600, the panel's 1024 x 768"]
    says(ran("decode", flight, "--camera", camera, "-o", tmp_path / "out"), "decode: ", *words)


@pytest.mark.untraced
def test_flight_that_begins_elsewhere_is_decoded(
    tmp_path: Path, make_flight: MakeFlight, elsewhere: list[bytes], pictures: list[bytes]
) -> None:
    """Two thirds of it show something else: those frames are missing, the others are read."""
    flight = make_flight([*elsewhere[:FRAMES], *pictures[:9]])
    done = ran("decode", flight, "-o", tmp_path / "out")
    rows = (tmp_path / "out" / "flight.csv").read_text().splitlines()[1:]

    assert done.returncode == 0
    assert len(rows) == FRAMES + 9
    assert all(",missing," in row for row in rows[:FRAMES])
    assert all(",read," in row for row in rows[FRAMES:])


def test_what_is_done_is_told_from_the_first_second(make_flight: MakeFlight, pictures: list[bytes]) -> None:
    """Before the first frame is taken: the panel, each frame of the sample, what is learned; then nothing."""
    told: list[str] = []
    flight = open_flight([make_flight(pictures[:8])])
    reader = reader_from_panel(panel_from_attachments(flight.attachments, flight="flight.mcap"), Method.NORMXCORR)

    def shown(frames: Iterator[Frame]) -> Iterator[Frame]:
        told.append("frames")
        yield from frames

    decode_flight(flight, reader, shown, tell=told.append)

    assert told[0] == "aligning frame 1 of a sample of 8"
    assert any("learning" in words for words in told)
    assert told[-2:] == ["", "frames"]


@pytest.mark.parametrize(
    ("attachment", "problem"),
    [
        ("panel.jpg", "picture: panel.jpg cannot be read: the flight file is cut off"),
        ("panel.yaml", "its panel cannot be read: the flight file is cut off"),
    ],
)
def test_flight_cut_before_its_panel_is_complete_says_so(tmp_path: Path, attachment: str, problem: str) -> None:
    """It is not said that the flight never carried it, which would let people look elsewhere."""
    whole, content = A1.read_bytes(), open_flight([A1]).attachments[attachment]
    cut = tmp_path / "cut.mcap"
    cut.write_bytes(whole[: whole.index(content) + len(content) // 2])
    done = ran("decode", cut, "-o", tmp_path / "out")

    assert done.returncode == 1
    assert f"{problem} before it is complete; give the whole file, or another panel" in done.stderr
    assert done.stderr.count("\n") == 1


def test_flight_without_a_panel_says_how_to_draw_one(tmp_path: Path, pictures: list[bytes]) -> None:
    """The command that draws one is named with the flight's own path, however it is called."""
    photographs, flight = tmp_path / "photographs", tmp_path / "my flight.mcap"
    photographs.mkdir()
    (photographs / "0.jpg").write_bytes(pictures[0])
    ran("recorder", "replay", photographs, "-o", flight)

    says(ran("decode", flight, "-o", tmp_path / "out"), "decode: ", f"decode setup '{flight}'", "--panel")
