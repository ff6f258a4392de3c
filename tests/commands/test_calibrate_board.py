"""`decode calibrate board`: focal length and distortion from rendered boards, and what users get wrong."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from decoder.panel.camera import camera_from_file
from fixtures.calibration.board import SIZE_PX, photographs
from fixtures.film import film as make_film
from tests.programs import A1, ran, says

pytestmark = [pytest.mark.slow, pytest.mark.xdist_group("board")]  # one worker renders the photographs

TRUE = 900.0


@pytest.fixture
def shoot(tmp_path: Path) -> Callable[..., list[Path]]:
    """Six photographs of a board in a folder."""

    def write(*, markers: bool = False, tilted: bool = True) -> list[Path]:
        paths = []
        for number, jpeg in enumerate(photographs(TRUE, -0.1, 4.45, markers=markers, tilted=tilted)):
            paths.append(tmp_path / f"board_{number}.jpg")
            paths[-1].write_bytes(jpeg)
        return paths

    return write


@pytest.mark.parametrize("markers", [False, True], ids=["chessboard", "charuco"])
def test_a_board_gives_the_lens(shoot: Callable[..., list[Path]], tmp_path: Path, markers: bool) -> None:  # noqa: FBT001
    """Pixels per radian to 0.3 %; what the lens bends at the corner, to half a pixel."""
    file = tmp_path / "camera.yaml"
    options = ["--dictionary", "DICT_5X5_100"] if markers else []
    done = ran("decode", "calibrate", "board", *shoot(markers=markers), "--squares", "9x7", *options, "-o", file)

    assert done.returncode == 0, done.stderr
    lens = camera_from_file(file).lens(4.45, SIZE_PX)
    radius = 0.35
    bent = lens.distortion.shift(np.array([radius, 0.0]))[0] * lens.pixels_per_radian
    assert lens.pixels_per_radian == pytest.approx(TRUE, rel=3e-3)
    assert bent == pytest.approx(-0.1 * radius**3 * TRUE, abs=0.5)


@pytest.mark.untraced
@pytest.mark.parametrize(("model", "scale", "seen_deg"), [("fisheye", 450.0, 60), ("rational", 700.0, 40)])
def test_a_film_of_a_board_gives_a_wide_lens(tmp_path: Path, model: str, scale: float, seen_deg: float) -> None:
    """An equidistant lens, 130 or 84 degrees wide, from H.264: within a pixel as far out as the board was seen."""
    pictures, flight, film = tmp_path / "pictures", tmp_path / "pictures.mcap", tmp_path / "board.mp4"
    pictures.mkdir()
    for number, jpeg in enumerate(photographs(scale, 0.0, None, fisheye=True)):
        (pictures / f"{number}.jpg").write_bytes(jpeg)
    ran("recorder", "replay", pictures, "-o", flight, "--rate", "2")
    make_film(flight, film)
    ran("recorder", "replay", film, "-o", tmp_path / "board.mcap")
    file = tmp_path / "camera.yaml"
    calibrate = ("decode", "calibrate", "board", tmp_path / "board.mcap", "--squares", "9x7", "--model", model)
    done = ran(*calibrate, "-o", file, "--focal-length-mm", "3", "--json")

    assert done.returncode == 0, done.stderr
    assert json.loads(done.stdout)[0]["model"] == model
    camera = camera_from_file(file)
    lens = camera.lens(3.0, SIZE_PX)
    angle = np.radians(np.linspace(0, seen_deg, 20))
    seen = lens.distorted(lens.pixels(np.stack([np.tan(angle), np.zeros(20)])))[0] - (SIZE_PX[0] - 1) / 2
    assert camera.only_focal_length_mm == 3.0
    assert seen == pytest.approx(scale * angle, abs=1.0)
    says(ran(*calibrate, "-o", file), "frame 0", "says no focal length", "focal_length_mm")
    says(ran("decode", "calibrate", "board", film, "--squares", "9x7"), "recorder replay")


def test_a_flight_that_breaks_off_is_used_as_far_as_it_goes(tmp_path: Path) -> None:
    """What is lost is told; where nothing is left, that is said."""
    whole = A1.read_bytes()
    for name, part in (("part", whole[: len(whole) // 5]), ("nothing", whole[:40_000])):
        (tmp_path / f"{name}.mcap").write_bytes(part)
    board = ("decode", "calibrate", "board", "--squares", "9x7", "-o", tmp_path / "camera.yaml")
    done = ran(*board, tmp_path / "part.mcap")

    assert "lost: part.mcap" in done.stderr
    assert "the board is found in 0 of" in done.stderr
    says(ran(*board, tmp_path / "nothing.mcap"), "nothing.mcap: holds no frame that can be read")


def test_a_focal_length_that_is_known_stays(shoot: Callable[..., list[Path]], tmp_path: Path) -> None:
    """Unless it is to be replaced."""
    file = tmp_path / "camera.yaml"
    file.write_text(
        "picture_size: [1024, 768]\nfocal: {pixels_per_radian: [0, 200, 0], range_mm: [4, 45]}\n", encoding="utf-8"
    )
    photos = shoot()
    ran("decode", "calibrate", "board", *photos, "--squares", "9x7", "-o", file)
    kept = camera_from_file(file)
    ran("decode", "calibrate", "board", *photos, "--squares", "9x7", "-o", file, "--replace-focal")

    assert kept.focal.at(4.45) == pytest.approx(890)
    assert kept.distortion[0].k1 == pytest.approx(-0.1, abs=0.02)
    assert camera_from_file(file).focal.at(4.45) == pytest.approx(TRUE, rel=2e-3)


def test_what_is_no_calibration(shoot: Callable[..., list[Path]]) -> None:
    """A board that is counted wrong, too few photographs, one that never tilts, markers that do not exist."""
    photos, board = shoot(tilted=False), ("decode", "calibrate", "board")

    says(ran(*board, photos[0], "--squares", "9x8"), "found in 0 of 1 photographs at 4.45 mm", "--squares")
    says(ran(*board, *photos[:2], "--squares", "9x7"), "found in 2 of 2", "three are needed")
    says(ran(*board, *photos[:3], "--squares", "9x7"), "faces the camera squarely", "tilt it")
    says(ran(*board, *photos[:3], "--squares", "9x7", "--dictionary", "DICT_NONE"), "DICT_NONE is none of")
    assert ran(*board, *photos, "--squares", "9").returncode == 2
