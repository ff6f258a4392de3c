"""`decode calibrate focal` and `distortion`: from photographs of a ruler to camera.yaml, and what users get wrong."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path

import cv2
import numpy as np
import pytest

from decoder.panel.camera import camera_from_file
from fixtures.calibration.ruler import Scene, photograph
from tests.programs import ran, says, write_yaml

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


def test_one_line_serves_all_zooms(zooms: list[Path], tmp_path: Path) -> None:
    """Pixels per radian are right to 0.05 % over the whole range; plot and camera.yaml are the same bytes each time."""
    out, plot = tmp_path / "camera.yaml", tmp_path / "focal.svg"
    done = ran("decode", "calibrate", "focal", *zooms, *LINE, "-o", out, "--plot", plot)
    camera = camera_from_file(out)

    assert done.returncode == 0, done.stderr
    assert "1 cm" in done.stdout
    assert camera.model == "DSC-QX10"
    assert camera.picture_size == (1616, 1212)
    for length in np.linspace(4.45, 30, 20):
        assert camera.focal.at(length) == pytest.approx(true_pixels_per_radian(length), rel=5e-4)
        assert camera.focal.sigma(length) == pytest.approx(camera.focal.at(length) / 16 / 36, rel=0.1)  # the tape's
    assert plot.read_text(encoding="utf-8").count("<circle") == len(zooms)
    ran("decode", "calibrate", "focal", *zooms, *LINE, "-o", tmp_path / "again.yaml", "--plot", tmp_path / "again.svg")
    assert (tmp_path / "again.yaml").read_bytes() == out.read_bytes()
    assert (tmp_path / "again.svg").read_bytes() == plot.read_bytes()


def test_a_list_of_photographs_and_points_by_hand(zooms: list[Path], tmp_path: Path) -> None:
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
    write_yaml(file, {"distance_inches": 36, "photographs": [listed, *hand]})
    done = ran("decode", "calibrate", "focal", file, "-o", tmp_path / "camera.yaml", "--json")
    found = [one["fit"] for one in json.loads(done.stdout)["photographs"]]

    assert camera_from_file(tmp_path / "camera.yaml").focal.at(15) == pytest.approx(
        true_pixels_per_radian(15), rel=5e-4
    )
    assert found[1]["arctangent"] / found[1]["small_angle"] == pytest.approx((3 / 36) / np.arctan(3 / 36))


def test_what_the_camera_file_says_else_is_kept(zooms: list[Path], tmp_path: Path) -> None:
    """Its distortion stays; a file that is no camera is left alone."""
    out = tmp_path / "camera.yaml"
    out.write_text(
        "picture_size: [1616, 1212]\nfocal: {pixels_per_radian: [0, 1, 0], range_mm: [4, 5]}\n"
        "distortion: [{focal_length_mm: 4.45, k1: -0.02}]\n",
        encoding="utf-8",
    )
    done = ran("decode", "calibrate", "focal", *zooms, *LINE, "-o", out)

    assert done.returncode == 0, done.stderr
    assert camera_from_file(out).distortion[0].k1 == -0.02
    out.write_text("- nothing", encoding="utf-8")
    says(ran("decode", "calibrate", "focal", *zooms, *LINE, "-o", out), "holds no camera")
    assert out.read_text(encoding="utf-8") == "- nothing"


def test_what_is_no_calibration(zooms: list[Path], tmp_path: Path) -> None:
    """Each in one sentence that names the photograph, or the list with its path, where there is one."""
    plain, large, cut, below = (tmp_path / f"{name}.jpg" for name in ("plain", "large", "cut", "below"))
    plain.write_bytes(photograph(Scene(2000.0), None))
    large.write_bytes(photograph(Scene(4000.0, size_px=(2048, 1536), place_mm=(200, 6.0), turn_deg=1.5), 8.0))
    cut.write_bytes(zooms[0].read_bytes()[:9000])
    below.write_bytes(photograph(Scene(1174.0, place_mm=(200, -150.0)), 4.45))
    listed = tmp_path / "ruler.yaml"
    listed.write_text("distance_inches: 36\nphotographs: [{picture: a.jpg, inches: 6}]\n", encoding="utf-8")
    focal, there = ("decode", "calibrate", "focal"), ("--inches", "14.96", "--distance-inches", "36")

    says(ran(*focal, zooms[0], plain, *LINE), "plain.jpg", "says no focal length")
    says(ran(*focal, *zooms, large, *LINE), "large.jpg is 2048 x 1536, zoom_0.jpg is 1616 x 1212", "one size")
    says(ran(*focal, cut, *LINE), "cut.jpg", "damaged")
    says(ran(*focal, tmp_path / "no.jpg", *LINE), "no.jpg: cannot be read")
    says(ran(*focal, zooms[0], zooms[1], *LINE), "three zooms or more, here are 2")
    says(ran(*focal, *zooms, "--line", "556,530,1063,530", *there), "zoom_0.jpg", "no ticks are found")
    says(ran(*focal, below, "--line", "556,805,1063,805", *there), "below.jpg", "misses the middle")
    says(ran(*focal, listed), "ruler.yaml: photographs[0]: give either `line`")
    assert ran(*focal, *zooms, "--inches", "6").returncode == 2
    assert ran(*focal, *zooms, "--line", "1,2,3").returncode == 2


CAMERA = (
    "picture_size: [1616, 1212]\nfocal: {pixels_per_radian: [0, 263.8202247, 0], range_mm: [4, 45]}\n"  # 1174 at 4.45
)
ACROSS = ("--line", "40,599,1570,612", "--inches", "17")


def wide(k1: float, tilt_deg: float = 2.0) -> Scene:
    """A ruler from edge to edge, near the camera, and not quite square on."""
    return Scene(1174.0, distance_inches=13, k1=k1, place_mm=(220, 1.5), turn_deg=0.5, tilt_deg=tilt_deg, seed=1)


@pytest.fixture
def shoot(tmp_path: Path) -> Callable[[Scene], Path]:
    """A photograph of a scene, and a camera.yaml beside it."""

    def write(scene: Scene) -> Path:
        path = tmp_path / "wide.jpg"
        path.write_bytes(photograph(scene, 4.45))
        (tmp_path / "camera.yaml").write_text(CAMERA, encoding="utf-8")
        return path

    return write


@pytest.mark.parametrize("k1", [-0.08, 0.02])
def test_a_bending_lens_is_found_and_measured(shoot: Callable[[Scene], Path], tmp_path: Path, k1: float) -> None:
    """k1 to a percent, though the ruler is tilted; it takes its place in camera.yaml."""
    file, stacked = tmp_path / "camera.yaml", tmp_path / "stacked.png"
    done = ran(
        "decode", "calibrate", "distortion", shoot(wide(k1)), *ACROSS, "-o", file, "--stacked", stacked, "--json"
    )
    found = json.loads(done.stdout)
    (entry,) = camera_from_file(file).distortion
    bends = np.array([tick["bend_px"] for tick in found["ticks"]])
    picture = cv2.imread(str(stacked), cv2.IMREAD_GRAYSCALE)

    assert not found["negligible"]
    assert entry.k1 == pytest.approx(k1, rel=0.01)
    assert np.sign(bends[[0, -1]]) == pytest.approx(np.sign([k1, k1]))
    assert picture is not None
    assert picture.shape[0] == len(bends) * (picture.shape[0] // len(bends))


@pytest.mark.parametrize("tilt_deg", [0.0, 3.0])
def test_a_straight_lens_is_called_straight(shoot: Callable[[Scene], Path], tmp_path: Path, tilt_deg: float) -> None:
    """Whatever the ruler's tilt; camera.yaml stays as it was."""
    photo = shoot(wide(0.0, tilt_deg))
    done = ran("decode", "calibrate", "distortion", photo, *ACROSS, "-o", tmp_path / "camera.yaml")

    assert done.returncode == 0, done.stderr
    assert "distortion is negligible" in done.stdout
    assert (tmp_path / "camera.yaml").read_text(encoding="utf-8") == CAMERA


def test_without_a_camera_file_the_verdict_is_given_all_the_same(
    shoot: Callable[[Scene], Path], tmp_path: Path
) -> None:
    """With what to do for a k1."""
    done = ran("decode", "calibrate", "distortion", shoot(wide(-0.08)), *ACROSS, "-o", tmp_path / "other.yaml")

    assert done.returncode == 0
    assert "barrel distortion" in done.stdout
    assert "run `decode calibrate focal` first" in done.stderr


def test_a_ruler_that_is_short_or_misses_the_middle(shoot: Callable[[Scene], Path]) -> None:
    """Each in one sentence."""
    photo = shoot(wide(0.0))

    says(
        ran("decode", "calibrate", "distortion", photo, "--line", "600,604,1000,607", "--inches", "4.4"),
        "covers 2",
        "cover all",
    )
    says(
        ran("decode", "calibrate", "distortion", photo, "--line", "40,300,1570,300", "--inches", "17"),
        "misses the middle",
    )
