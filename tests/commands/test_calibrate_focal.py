"""`decode calibrate focal`: from photographs of a ruler to camera.yaml, and what users get wrong."""

from __future__ import annotations

import json
import subprocess
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
import yaml

from decoder.camera import camera_from_file
from fixtures.calibration.ruler import Scene, photograph

Run = Callable[..., subprocess.CompletedProcess[str]]
LENGTHS_MM = (4.45, 8.0, 15.0, 30.0)
LINE = ("--line", "556,599,1063,612", "--inches", "14.96", "--distance-inches", "36")


def true_pixels_per_radian(focal_length_mm: float) -> float:
    """The lens that the photographs are made with."""
    return 8 + 262 * focal_length_mm - 0.15 * focal_length_mm**2


@pytest.fixture(scope="module")
def zooms(tmp_path_factory: pytest.TempPathFactory) -> list[Path]:
    """Photographs of one ruler at four zooms."""
    folder = tmp_path_factory.mktemp("zooms")
    paths = []
    for seed, length in enumerate(LENGTHS_MM):
        scene = Scene(true_pixels_per_radian(length), place_mm=(200, 6.0), turn_deg=1.5, tilt_deg=1, seed=seed)
        paths.append(folder / f"zoom_{seed}.jpg")
        paths[-1].write_bytes(photograph(scene, length))
    return paths


def says(done: subprocess.CompletedProcess[str], *words: str) -> None:
    """A program failed with exit code 1 and one sentence that holds all the words."""
    assert done.returncode == 1, done.stderr
    assert len(done.stderr.splitlines()) == 1
    assert [word for word in words if word not in done.stderr] == []


def test_one_line_serves_all_zooms(run: Run, zooms: list[Path], tmp_path: Path) -> None:
    """Pixels per radian are right to 0.05 % over the whole range; the plot and camera.yaml are written."""
    out, plot = tmp_path / "camera.yaml", tmp_path / "focal.svg"
    done = run("decode", "calibrate", "focal", *zooms, *LINE, "-o", out, "--plot", plot)
    camera = camera_from_file(out)

    assert done.returncode == 0, done.stderr
    assert "1 cm" in done.stdout
    assert camera.model == "DSC-QX10"
    assert camera.picture_size == (1616, 1212)
    for length in np.linspace(4.45, 30, 20):
        assert camera.focal.at(length) == pytest.approx(true_pixels_per_radian(length), rel=5e-4)
        assert camera.focal.sigma(length) == pytest.approx(camera.focal.at(length) / 16 / 36, rel=0.1)  # the tape's
    assert plot.read_text(encoding="utf-8").count("<circle") == len(zooms)


def test_the_same_photographs_give_the_same_bytes(run: Run, zooms: list[Path], tmp_path: Path) -> None:
    """The camera and the plot."""
    for name in ("one", "two"):
        run(
            "decode",
            "calibrate",
            "focal",
            *zooms,
            *LINE,
            "-o",
            tmp_path / f"{name}.yaml",
            "--plot",
            tmp_path / f"{name}.svg",
        )

    assert (tmp_path / "one.yaml").read_bytes() == (tmp_path / "two.yaml").read_bytes()
    assert (tmp_path / "one.svg").read_bytes() == (tmp_path / "two.svg").read_bytes()


def test_a_list_of_photographs_and_points_by_hand(run: Run, zooms: list[Path], tmp_path: Path) -> None:
    """Lines and points mix; the JSON says both forms."""
    hand = [
        {
            "focal_length_mm": f,
            "picture_size": [1616, 1212],
            "inches": 6.0,
            "points": [[807.5 - x, 605.5], [807.5 + x, 605.5]],
        }
        for f in (10.0, 20.0)
        for x in [true_pixels_per_radian(f) * 3 / 36]
    ]
    listed = {"picture": str(zooms[0]), "line": [556, 599, 1063, 612], "inches": 14.96}
    file = tmp_path / "ruler.yaml"
    file.write_text(yaml.safe_dump({"distance_inches": 36, "photographs": [listed, *hand]}), encoding="utf-8")
    done = run("decode", "calibrate", "focal", file, "-o", tmp_path / "camera.yaml", "--json")
    found = [one["fit"] for one in json.loads(done.stdout)["photographs"]]

    assert camera_from_file(tmp_path / "camera.yaml").focal.at(15) == pytest.approx(
        true_pixels_per_radian(15), rel=5e-4
    )
    assert found[1]["arctangent"] / found[1]["small_angle"] == pytest.approx((3 / 36) / np.arctan(3 / 36))


def test_what_the_camera_file_says_else_is_kept(run: Run, zooms: list[Path], tmp_path: Path) -> None:
    """Its distortion stays; a file that is no camera is left alone."""
    out = tmp_path / "camera.yaml"
    out.write_text(
        "picture_size: [1616, 1212]\nfocal: {pixels_per_radian: [0, 1, 0], range_mm: [4, 5]}\n"
        "distortion: [{focal_length_mm: 4.45, k1: -0.02}]\n",
        encoding="utf-8",
    )
    done = run("decode", "calibrate", "focal", *zooms, *LINE, "-o", out)

    assert done.returncode == 0, done.stderr
    assert camera_from_file(out).distortion[0].k1 == -0.02
    out.write_text("- nothing", encoding="utf-8")
    says(run("decode", "calibrate", "focal", *zooms, *LINE, "-o", out), "holds no camera")
    assert out.read_text(encoding="utf-8") == "- nothing"


def test_photographs_without_exif(run: Run, zooms: list[Path], tmp_path: Path) -> None:
    """Somebody sent them through a messenger."""
    plain = tmp_path / "plain.jpg"
    plain.write_bytes(photograph(Scene(2000.0), None))

    says(run("decode", "calibrate", "focal", zooms[0], plain, *LINE), "plain.jpg", "says no focal length")


def test_photographs_of_different_sizes(run: Run, zooms: list[Path], tmp_path: Path) -> None:
    """An Original among 2M pictures."""
    large = tmp_path / "large.jpg"
    large.write_bytes(photograph(Scene(4000.0, size_px=(2048, 1536), place_mm=(200, 6.0), turn_deg=1.5), 8.0))
    done = run("decode", "calibrate", "focal", *zooms, large, *LINE, "-o", tmp_path / "camera.yaml")

    says(done, "large.jpg is 2048 x 1536, zoom_0.jpg is 1616 x 1212", "one size")
    assert not (tmp_path / "camera.yaml").exists()


def test_a_photograph_that_cannot_be_read(run: Run, zooms: list[Path], tmp_path: Path) -> None:
    """Not there, or cut short."""
    cut = tmp_path / "cut.jpg"
    cut.write_bytes(zooms[0].read_bytes()[:9000])

    says(run("decode", "calibrate", "focal", cut, *LINE), "cut.jpg", "damaged or cut short")
    says(run("decode", "calibrate", "focal", tmp_path / "no.jpg", *LINE), "no.jpg: cannot be read")


def test_too_few_zooms_no_ticks_and_a_ruler_beside_the_middle(run: Run, zooms: list[Path], tmp_path: Path) -> None:
    """Each in one sentence that names the photograph where there is one."""
    beside = ("--line", "556,530,1063,530", "--inches", "14.96", "--distance-inches", "36")
    below = tmp_path / "below.jpg"
    below.write_bytes(photograph(Scene(1174.0, place_mm=(200, -150.0)), 4.45))
    there = ("--line", "556,805,1063,805", "--inches", "14.96", "--distance-inches", "36")

    says(run("decode", "calibrate", "focal", zooms[0], zooms[1], *LINE), "three zooms or more, here are 2")
    says(run("decode", "calibrate", "focal", *zooms, *beside), "zoom_0.jpg", "no ticks are found")
    says(run("decode", "calibrate", "focal", below, *there), "below.jpg", "misses the middle")


def test_a_wrong_list_is_named_with_its_path(run: Run, tmp_path: Path) -> None:
    """As a panel is."""
    file = tmp_path / "ruler.yaml"
    file.write_text("distance_inches: 36\nphotographs: [{picture: a.jpg, inches: 6}]\n", encoding="utf-8")

    says(run("decode", "calibrate", "focal", file), "ruler.yaml: photographs[0]: give either `line`")


def test_half_a_description_is_wrong_usage(run: Run, zooms: list[Path]) -> None:
    """Exit code 2."""
    assert run("decode", "calibrate", "focal", *zooms, "--inches", "6").returncode == 2
    assert run("decode", "calibrate", "focal", *zooms, "--line", "1,2,3").returncode == 2
