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
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
import yaml
from PIL import Image, ImageDraw

FIXTURES = Path(__file__).parents[2] / "fixtures"
PATIENCE_S = 120
A1 = FIXTURES / "thesis_a1.mcap"
PANEL = FIXTURES / "panel.yaml"

Run = Callable[..., subprocess.CompletedProcess[str]]
ReadDecoded = Callable[[Path], Any]
MakeFlight = Callable[..., Path]
Change = Callable[[dict[str, Any]], object]
PanelWith = Callable[[Change], Path]


def says(done: subprocess.CompletedProcess[str], *words: str) -> None:
    """A program failed with exit code 1 and one sentence that holds all the words."""
    assert done.returncode == 1, done.stderr
    assert done.stderr.startswith("decode: ")
    assert len(done.stderr.splitlines()) == 1
    assert [word for word in words if word not in done.stderr] == []


@pytest.fixture
def panel_with(tmp_path: Path) -> PanelWith:
    """The animation's panel, changed, in a folder with its picture."""

    def write(change: Change) -> Path:
        panel: dict[str, Any] = yaml.safe_load(PANEL.read_text(encoding="utf-8"))
        change(panel)
        folder = tmp_path / "panel"
        folder.mkdir()
        (folder / "panel.jpg").write_bytes((FIXTURES / "panel.jpg").read_bytes())
        (folder / "panel.yaml").write_text(yaml.safe_dump(panel), encoding="utf-8")
        return folder / "panel.yaml"

    return write


def test_no_such_file(run: Run, tmp_path: Path) -> None:
    """A flight that is not there is named."""
    says(run("decode", tmp_path / "no.mcap", "-o", tmp_path / "out"), "no.mcap")


def test_empty_file(run: Run, tmp_path: Path) -> None:
    """An empty file is no flight."""
    (tmp_path / "empty.mcap").touch()
    says(run("decode", tmp_path / "empty.mcap", "-o", tmp_path / "out"), "empty.mcap", "empty")


def test_file_of_another_kind(run: Run, tmp_path: Path) -> None:
    """A file that is no MCAP is refused by name."""
    (tmp_path / "letter.mcap").write_text("Dear Sir or Madam, " * 100)
    says(run("decode", tmp_path / "letter.mcap", "-o", tmp_path / "out"), "letter.mcap", "MCAP")


def test_truncated_flight_is_decoded_as_far_as_it_goes(run: Run, read_decoded: ReadDecoded, tmp_path: Path) -> None:
    """A flight that breaks off gives the frames that are whole, names the loss, and ends with 3."""
    flight = tmp_path / "cut.mcap"
    flight.write_bytes(A1.read_bytes()[:1_200_000])
    done = run("decode", flight, "-o", tmp_path / "out")
    rows = read_decoded(tmp_path / "out").rows

    assert done.returncode == 3
    assert "lost: cut.mcap" in done.stderr
    assert 5 < len(rows) < 20
    assert {row["n1_pct_status"] for row in rows} == {"read"}


def test_flight_without_panel(run: Run, make_flight: MakeFlight, pictures: list[bytes], tmp_path: Path) -> None:
    """A flight that carries no panel wants one on the command line."""
    says(run("decode", make_flight(pictures[:3], panel=None), "-o", tmp_path / "out"), "flight.mcap", "--panel")


def change_key(panel: dict[str, Any]) -> None:
    """A key is spelt the other way."""
    panel["gauges"][1]["center"] = panel["gauges"][1].pop("centre")


def empty_sweep(panel: dict[str, Any]) -> None:
    """A sweep covers nothing."""
    panel["gauges"][2]["sweep"] = [120, 120]


def scale_up_and_down(panel: dict[str, Any]) -> None:
    """A scale rises and falls."""
    panel["gauges"][3]["scale"] = [[120, 0], [200, 30000], [420, 20000]]


def template_outside(panel: dict[str, Any]) -> None:
    """A gauge lies half outside the picture."""
    panel["gauges"][0]["centre"] = [1000.0, 20.0]


def unknown_cover(panel: dict[str, Any]) -> None:
    """A covering needle does not exist."""
    panel["gauges"][5]["needles"][0]["covered_by"] = "fuel_lb"


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (change_key, ["gauges[1].cent"]),
        (empty_sweep, ["gauges[2].sweep", "empty"]),
        (scale_up_and_down, ["gauges[3].scale", "monotone"]),
        (template_outside, ["gauges[0]", "outside"]),
        (unknown_cover, ["gauges[5]", "fuel_lb"]),
    ],
    ids=lambda value: getattr(value, "__name__", None),
)
def test_wrong_panel_is_named_by_its_path(
    run: Run, panel_with: PanelWith, tmp_path: Path, change: Change, words: list[str]
) -> None:
    """A mistake in the panel is one sentence with the path of the wrong value."""
    says(run("decode", A1, "--panel", panel_with(change), "-o", tmp_path / "out"), *words)
    assert not (tmp_path / "out").exists()


def test_panel_picture_of_another_size(run: Run, panel_with: PanelWith, tmp_path: Path) -> None:
    """A panel drawn on a picture of another size than the flight's cannot read it, and both sizes are said."""
    panel = panel_with(lambda _: None)
    with Image.open(FIXTURES / "panel.jpg") as picture:
        wider = Image.new("RGB", (picture.width + 64, picture.height), (70, 70, 70))
        wider.paste(picture)
    wider.save(panel.parent / "panel.jpg", quality=95)
    says(run("decode", A1, "--panel", panel, "-o", tmp_path / "out"), "1024 x 768", "1088 x 768")


def test_panel_without_its_picture(run: Run, panel_with: PanelWith, tmp_path: Path) -> None:
    """A panel whose picture is gone names the picture."""
    panel = panel_with(lambda _: None)
    (panel.parent / "panel.jpg").unlink()
    says(run("decode", A1, "--panel", panel, "-o", tmp_path / "out"), "panel.jpg")


def test_damaged_jpeg_costs_its_own_frame(
    run: Run, read_decoded: ReadDecoded, make_flight: MakeFlight, pictures: list[bytes], tmp_path: Path
) -> None:
    """A picture that is cut short is a missing frame with a reason; its neighbours are read."""
    frames = [jpeg[:30_000] if number == 3 else jpeg for number, jpeg in enumerate(pictures[:8])]
    done = run("decode", make_flight(frames), "-o", tmp_path / "out")
    rows = read_decoded(tmp_path / "out").rows

    assert done.returncode == 0
    assert done.stderr.startswith("frame 3 missing: the picture is damaged")
    assert len(done.stderr.splitlines()) == 1
    assert [row["n1_pct_status"] for row in rows] == ["read"] * 3 + ["missing"] + ["read"] * 4
    assert rows[3]["n1_pct"] == rows[3]["n1_pct_sigma"] == ""


def test_picture_of_another_shape_costs_its_own_frame(
    run: Run, read_decoded: ReadDecoded, make_flight: MakeFlight, pictures: list[bytes], tmp_path: Path
) -> None:
    """A frame of another shape in mid-flight is missing, with both sizes as the reason."""
    small = io.BytesIO()
    Image.open(io.BytesIO(pictures[2])).resize((512, 300)).save(small, "JPEG")
    done = run("decode", make_flight([*pictures[:6], small.getvalue(), *pictures[6:9]]), "-o", tmp_path / "out")

    assert done.returncode == 0
    assert "frame 6 missing: the picture is 512 x 300" in done.stderr
    assert read_decoded(tmp_path / "out").rows[6]["n1_pct_status"] == "missing"


def test_folder_that_cannot_be_written(run: Run, tmp_path: Path) -> None:
    """Where the output folder cannot be made, the sentence names it."""
    (tmp_path / "file").write_text("in the way")
    says(run("decode", A1, "-o", tmp_path / "file" / "out"), "out", "-o")


def test_wrong_usage(run: Run, tmp_path: Path) -> None:
    """A method that does not exist, and a call without a flight, end with 2."""
    assert run("decode", A1, "--method", "guess", "-o", tmp_path).returncode == 2
    assert run("decode", "-o", tmp_path).returncode == 2
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


def test_folder_instead_of_a_flight(run: Run, tmp_path: Path) -> None:
    """A folder is no flight file."""
    says(run("decode", tmp_path, "-o", tmp_path / "out"), tmp_path.name)


def test_flights_of_two_recordings(run: Run, tmp_path: Path) -> None:
    """Files of two recordings are not one flight; both are named."""
    done = run("decode", A1, FIXTURES / "thesis_a2.mcap", "-o", tmp_path / "out")
    says(done, "thesis_a1.mcap", "thesis_a2.mcap", "different recordings")


def test_panel_of_another_cockpit(run: Run, panel_with: PanelWith, tmp_path: Path) -> None:
    """A panel that is found in no frame at all is an error, not a table of gaps."""
    panel = panel_with(lambda _: None)
    left, top, width, height = yaml.safe_load(panel.read_text(encoding="utf-8"))["anchors"][0]["box"]
    with Image.open(FIXTURES / "panel.jpg") as picture:
        draw = ImageDraw.Draw(picture)
        draw.rectangle([left, top, left + width, top + height], fill=(20, 20, 20))
        for step in range(0, width, 8):
            draw.line([left, top + step, left + width, top], fill=(230, 230, 230), width=3)
        picture.save(panel.parent / "panel.jpg", quality=95)
    says(run("decode", A1, "--panel", panel, "-o", tmp_path / "out"), "thesis_a1.mcap", "none of its 20 frames", "knob")
    assert not (tmp_path / "out").exists()


def test_truth_that_fits_nothing(run: Run, tmp_path: Path) -> None:
    """A truth without any of the flight's needles is refused in a sentence."""
    run("decode", A1, "-o", tmp_path)
    (tmp_path / "truth.csv").write_text("frame,airspeed_kt\n0,120.0\n")
    says(run("decode", "accuracy", tmp_path / "thesis_a1.csv", tmp_path / "truth.csv"), "truth.csv", "n1_pct")
