"""Photographs become a flight file, and come out of it again."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

from flight_file.reader import open_flight

RECORDER = (sys.executable, "-c", "from recorder.cli import main; main()")


def recorder(*arguments: str | Path) -> subprocess.CompletedProcess[str]:
    """Run a command to its end."""
    return subprocess.run([*RECORDER, *map(str, arguments)], capture_output=True, text=True, timeout=120, check=False)


@pytest.mark.slow
def test_photographs_become_one_flight_and_come_out_of_it(pictures: Path, tmp_path: Path) -> None:
    """What goes in comes out byte for byte, in order, whatever its length: 40 pictures of 40 days."""
    target, folder = tmp_path / "flights" / "august.mcap", tmp_path / "out"
    made = recorder("replay", pictures, "-o", target, "--rate", repr(1 / 86400))
    taken = recorder("extract", target, "-o", folder)

    assert (made.returncode, made.stdout, made.stderr) == (0, f"{target}: 40 pictures\n", "")
    assert (taken.returncode, taken.stdout) == (0, f"{folder}: 40 pictures\n")
    assert [path.read_bytes() for path in sorted(folder.iterdir())] == [
        path.read_bytes() for path in sorted(pictures.iterdir())
    ]
    assert list(target.parent.iterdir()) == [target]
    assert open_flight([target]).recording == "august"


def test_panel_and_camera_go_in(pictures: Path, tmp_path: Path) -> None:
    """With the pictures that the panel names."""
    (tmp_path / "panel.yaml").write_text("{name: P, picture: panel.jpg}", encoding="utf-8")
    (tmp_path / "panel.jpg").write_bytes(b"picture")
    (tmp_path / "lens.yaml").write_text("{}", encoding="utf-8")
    target = tmp_path / "flight.mcap"
    recorder(
        *("replay", pictures, "-o", target, "--rate", "4"),
        *("--panel", tmp_path / "panel.yaml", "--camera", tmp_path / "lens.yaml"),
    )

    assert set(open_flight([target]).attachments) == {"panel.yaml", "panel.jpg", "camera.yaml"}


@pytest.mark.parametrize(
    ("source", "name", "sentence"),
    [
        ("pictures", "there.mcap", "is there already; choose another name"),
        ("pictures", "flight.avi", "a flight file ends in .mcap"),
        ("pictures", "flight.mcap", "give rate_hz (--rate), the pictures per second."),
        ("nothing", "flight.mcap", "there is no such file"),
        ("pictures", "there.mcap/flight.mcap", "cannot be written"),
    ],
)
def test_what_cannot_be_made_is_one_sentence(
    pictures: Path, tmp_path: Path, source: str, name: str, sentence: str
) -> None:
    """Nothing is replaced, and nothing is left behind."""
    (tmp_path / "there.mcap").write_bytes(b"a flight")
    done = recorder("replay", pictures.parent / source, "-o", tmp_path / name)

    assert done.returncode == 1
    assert sentence in done.stderr
    assert sorted(path.name for path in tmp_path.iterdir()) == ["pictures", "there.mcap"]
    assert (tmp_path / "there.mcap").read_bytes() == b"a flight"


def test_what_is_lost_of_a_flight_is_said(pictures: Path, tmp_path: Path) -> None:
    """The other pictures come out; exit code 3."""
    target, folder = tmp_path / "flight.mcap", tmp_path / "out"
    recorder("replay", pictures, "-o", target, "--rate", "4")
    content = target.read_bytes()
    target.write_bytes(content[: len(content) // 2])
    done = recorder("extract", target, "-o", folder)

    assert done.returncode == 3
    assert "  lost: " in done.stderr
    assert len(list(folder.iterdir())) < 40


def test_what_a_replayed_flight_has_lost_is_said(pictures: Path, tmp_path: Path) -> None:
    """Pictures that are lost at its end leave no gap in the new flight file, so they are told; exit code 3."""
    target, again = tmp_path / "flight.mcap", tmp_path / "again.mcap"
    recorder("replay", pictures, "-o", target, "--rate", "4")
    content = target.read_bytes()
    target.write_bytes(content[: len(content) // 2])
    done = recorder("replay", target, "-o", again)

    assert done.returncode == 3
    assert "  lost: " in done.stderr
    assert 0 < open_flight([again]).count() < 40


def test_other_pictures_are_not_replaced(pictures: Path, tmp_path: Path) -> None:
    """A folder that holds another picture of the same name is refused; the same pictures once more are not."""
    target, folder = tmp_path / "flight.mcap", tmp_path / "out"
    recorder("replay", pictures, "-o", target, "--rate", "4")
    again = [recorder("extract", target, "-o", folder).returncode for _ in range(2)]
    (folder / "000003.jpg").write_bytes(b"mine")
    done = recorder("extract", target, "-o", folder)

    assert again == [0, 0]
    assert done.returncode == 1
    assert "000003.jpg: is there already with another picture; choose another folder" in done.stderr
    assert (folder / "000003.jpg").read_bytes() == b"mine"
