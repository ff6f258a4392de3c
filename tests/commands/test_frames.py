"""`decode frames`: pictures with the readings drawn in."""

from __future__ import annotations

import json
import shutil
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image

from tests.programs import A2, MakeFlight, ran

Decoded = Any


def test_frames_are_named_by_number_and_time(tmp_path: Path) -> None:
    """Every tenth of 21 frames gives three pictures, named and enlarged, with more than the frame on them."""
    done = ran("decode", "frames", A2, "-o", tmp_path / "out", "--every", "10")

    assert (done.returncode, done.stderr) == (0, "")
    assert sorted(path.name for path in (tmp_path / "out").iterdir()) == [
        "thesis_a2_000000_20180504T120106.000Z.jpg",
        "thesis_a2_000010_20180504T120108.500Z.jpg",
        "thesis_a2_000020_20180504T120111.000Z.jpg",
    ]
    with Image.open(tmp_path / "out" / "thesis_a2_000000_20180504T120106.000Z.jpg") as picture:
        assert picture.width == 2048
        assert picture.height > 2 * 768
    cropped = ran("decode", "frames", A2, "-o", tmp_path / "dials", "--at", "3", "--gauge", "fuel", "--gauge", "n1")
    assert cropped.returncode == 0
    assert {path.name for path in (tmp_path / "dials").iterdir()} == {
        f"thesis_a2_000012_20180504T120109.000Z_{gauge}.jpg" for gauge in ("fuel", "n1")
    }


def test_flagged_frames_are_those_with_a_doubt(decoded_a2: Decoded, tmp_path: Path) -> None:
    """On the flight with reflections, the frames with something interpolated are drawn, and no others."""
    rows = decoded_a2.csv_file.read_text().splitlines()[1:]
    doubtful = {f"{int(row.split(',')[0]):06d}" for row in rows if "interpolated" in row or "missing" in row}
    done = ran("decode", "frames", A2, "-o", tmp_path / "out", "--flagged")
    numbers = {path.name.split("_")[2] for path in (tmp_path / "out").iterdir()}

    assert done.returncode == 0
    assert 0 < len(doubtful) < 21
    assert doubtful <= numbers < {f"{number:06d}" for number in range(21)}


def test_readings_that_are_there_are_drawn_and_others_are_not(decoded_a2: Decoded, tmp_path: Path) -> None:
    """What `decode` wrote into the folder is drawn, the same frames; changed values of other files are not believed."""
    folder = tmp_path / "results"
    shutil.copytree(decoded_a2.folder, folder)
    again = ran("decode", "frames", A2, "-o", tmp_path / "new", "--flagged")
    known = ran("decode", "frames", A2, "-o", folder / "pictures", "--flagged")
    given = ran("decode", "frames", A2, "-o", tmp_path / "given", "--flagged", "--data", folder)
    description = json.loads((folder / "thesis_a2.json").read_text())
    description["panel"]["sha256"] = "0" * 64
    (folder / "thesis_a2.json").write_text(json.dumps(description))
    stale = ran("decode", "frames", A2, "-o", folder / "again", "--flagged")

    assert [done.returncode for done in (again, known, given, stale)] == [0, 0, 0, 0]
    assert f"readings from {folder}/thesis_a2.csv" in known.stdout
    assert "readings from" not in again.stdout + stale.stdout
    names = {path.name for path in (tmp_path / "new").iterdir()}
    assert names == {path.name for path in (folder / "pictures").iterdir()}
    assert names == {path.name for path in (tmp_path / "given").iterdir()}


def test_what_was_read_of_a_part_is_drawn(tmp_path: Path) -> None:
    """Of every fourth frame, those that were asked for; the others are in no data, and no fault of the disk."""
    ran("decode", A2, "-o", tmp_path / "part", "--every", "4")
    done = ran("decode", "frames", A2, "-o", tmp_path / "out", "--at", "2", "--at", "2.9", "--data", tmp_path / "part")

    assert (done.returncode, done.stderr) == (0, "")
    assert sorted(path.name.split("_")[2] for path in (tmp_path / "out").iterdir()) == ["000008", "000012"]


def test_frame_without_panel_is_drawn_with_the_reason(
    tmp_path: Path, make_flight: MakeFlight, pictures: list[bytes], cover_knob: Callable[[bytes], bytes]
) -> None:
    """A frame without a panel has a caption that says why; one whose picture is damaged is named and left out."""
    flight = make_flight([pictures[0], cover_knob(pictures[1]), pictures[2][:20_000], *pictures[3:6]])
    done = ran("decode", "frames", flight, "-o", tmp_path / "out")

    assert "frame 2 not drawn: the picture is damaged or cut short" in done.stderr
    assert len(list((tmp_path / "out").iterdir())) == 5
    red = []
    for number in (0, 1):
        (path,) = (tmp_path / "out").glob(f"*_{number:06d}_*")
        with Image.open(path) as picture:
            bar = np.asarray(picture)[2 * 768 :].reshape(-1, 3).astype(int)
        red.append(((bar[:, 0] - bar[:, 2]) > 120).sum())
    assert red[1] > 2 * red[0]  # the reason, in the colour of what is missing


@pytest.mark.parametrize(
    ("words", "says"),
    [
        (["--at", "1", "--flagged"], "choose one of --at, --flagged and --every"),
        (["--gauge", "rpm"], "the panel has no gauge rpm; it has n1, n2, ftit"),
        (["--every", "0"], "--every"),
    ],
)
def test_wrong_choices_are_wrong_usage(tmp_path: Path, words: list[str], says: str) -> None:
    """What cannot be chosen is said, and nothing is written."""
    done = ran("decode", "frames", A2, "-o", tmp_path / "out", *words)

    assert done.returncode == 2
    assert says in done.stderr
    assert not (tmp_path / "out").exists()
